"""Texts of users within C: whatever they hold, they stay comments."""

import shutil
import subprocess
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Annotated, NamedTuple
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.marks import rest_slow

from swashplate import Drive, export
from swashplate.export.c_source import interface
from swashplate.machine import Definition, Machine, Model, equation
from swashplate.machine.code_generation import c_comment, c_function, comment_line

GCC = shutil.which("gcc")
needs_gcc = pytest.mark.skipif(GCC is None, reason="there is no gcc here")

PIECES = ["*", "/", "\\", "?", "\n", "\r", " ", "\t", "\v", "\f", "\0", "evil", "é", "\u2028"]
PIECES += ["\u202e", "\x85", "\ufffe", "\ud800", '"', "'", "//", "??/", "%:"]
TEXTS = st.lists(st.sampled_from(PIECES), max_size=12).map("".join)
ATTACKS = [
    "*/ int evil; /*",
    "*\\\n/ int evil; /*",
    "*\\ \n/ int evil; /*",
    "*\\\r\n/ int evil; /*",
    "*??/\n/ int evil; /*",
    "*?\\\n?/\n/ int evil; /*",
    "evil \\",
    "evil ??/",
]


def preprocessed(text: str, standard: str) -> str:
    """What a compiler sees of a text."""
    assert GCC is not None
    words = [GCC, f"-std={standard}", "-Werror=comment", "-E", "-P", "-x", "c", "-"]
    done = subprocess.run(words, input=text.encode(), capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()
    return done.stdout.decode()


@pytest.mark.slow
@needs_gcc
@pytest.mark.parametrize("standard", ["c99", "gnu11"])
@given(texts=st.lists(TEXTS, min_size=1, max_size=20))
def test_nothing_of_a_text_leaves_its_comment(standard: str, texts: list[str]) -> None:
    lines, code = [], []
    for text in [*texts, *ATTACKS]:
        number = len(code)
        lines += [*c_comment(text), f"int a{number}; /* {comment_line(text)} */"]
        lines.append(c_function(text, f"int b{number}(void)", [f"return {number};"]))
        code.append(f"int a{number};int b{number}(void){{return {number};}}")
    seen = preprocessed("\n".join(lines), standard)
    assert "".join(seen.split()) == "".join("".join(code).split())


def test_a_text_without_harm_stays_as_it_is() -> None:
    text = "Druck δP = p₁ − p₂, 100 % of √(2/ρ) [m/s²]; what is it? a * b / c"
    assert comment_line(text) == text


class Lag(NamedTuple):
    time: Annotated[float, Definition("time */ int evil; /*", "s*\\\n/ int evil; /*", above=0.0)]
    gain: float = 1.0  # A comment behind a field. */ int evil; /*


class Output(NamedTuple):
    """A state. */ int evil; /*"""

    value: float


@equation
def lagged(state: Output, command: float, p: Lag, h: float) -> Output:
    """A lag. */ int evil; /* and another *\\
/ int evil; /*"""
    return Output(state.value + h / p.time * (p.gain * command - state.value))


@pytest.mark.slow
@needs_gcc
@pytest.mark.parametrize("standard", rest_slow(["c99", "gnu11"]))
def test_no_text_of_a_model_or_a_drive_becomes_code(
    standard: str, hoist: Drive, tmp_path: Path
) -> None:
    model = Model("lag", Lag, Output, lagged)
    content = export.content_of(Machine(model, Lag(0.5)), 0.01, prefix="lag")
    texts = list(interface(content.exported).values())
    files = export.c(Machine(model, Lag(0.5)), tmp_path / "model", 0.01)
    for number, title in enumerate(ATTACKS):
        drive = Drive(replace(hoist.parameters, title=title))
        files += export.c(drive, tmp_path / f"drive_{number}")
    texts += [file.read_text("utf-8") for file in files if file.suffix in (".c", ".h")]
    assert sum("evil" in text for text in texts) > len(ATTACKS)  # as comments they are there
    for text in texts:
        lines = [line for line in text.splitlines() if not line.lstrip().startswith("#")]
        assert "evil" not in preprocessed("\n".join(lines), standard)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_a_title_that_xml_cannot_have_still_makes_a_model_description(
    fmi: str, hoist: Drive, tmp_path: Path
) -> None:
    drive = Drive(replace(hoist.parameters, title='A \ufffe "title" \x0b <&> \ud800 ü'))
    path = export.fmu(drive, tmp_path / "a.fmu", fmi=fmi, platforms=["linux64"])
    with zipfile.ZipFile(path) as opened:
        root = ET.fromstring(opened.read("modelDescription.xml"))
    assert root.attrib["description"].startswith('A \ufffd "title" \ufffd <&> \ufffd ü. Own steps')


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_a_name_of_any_length_makes_files_that_can_be_unpacked(
    fmi: str, hoist: Drive, tmp_path: Path
) -> None:
    drive = hoist.renamed("long" * 25_000)
    path = export.fmu(drive, tmp_path / "a.fmu", fmi=fmi, platforms=["linux64"])
    with zipfile.ZipFile(path) as opened:
        opened.extractall(tmp_path / "unpacked")
        root = ET.fromstring(opened.read("modelDescription.xml"))
    assert root.attrib["modelName"] == drive.name
    identifier = root.find("CoSimulation").attrib["modelIdentifier"]
    (library,) = (tmp_path / "unpacked" / "binaries").glob("*/*.so")
    assert library.stem == identifier
    assert len(identifier) == 63
    names = [file.name for file in export.c(drive, tmp_path / "c")]
    assert f"{identifier}_values.h" in names
