"""`swashplate export` writes files that others read, and refuses what it cannot."""

import zipfile
from importlib.util import find_spec
from shutil import which

import pytest

from swashplate import Drive


def test_writes_fmi_3_for_chosen_platforms(done, tmp_path):
    words = ("--fmi", "3", "--platforms", "linux64, win64", "--scale", "Z16=1.5")
    said = done("export", "hoist", "--fmu", "a.fmu", *words)
    assert "FMU 3.0: a.fmu" in said
    assert "Z16" in said
    with zipfile.ZipFile(tmp_path / "a.fmu") as made:
        libraries = [name for name in made.namelist() if name.startswith("binaries/")]
        text = made.read("modelDescription.xml").decode()
    assert [each.split("/")[1] for each in libraries] == ["x86_64-linux", "x86_64-windows"]
    assert repr(1.5 * Drive.preset("hoist")["Z16"].value.plus) in text


def test_says_what_it_warns_of(done):
    said = done("export", "hoist", "--step", "0.001", "--fmu", "a.fmu", "--platforms", "linux64")
    assert said.endswith("FMU 2.0: a.fmu\n")
    assert "Note: hoist: the card's filter is a recursion for 512 Hz" in " ".join(said.split())
    assert "below 1.5 steps" in done("export", "neutral", "--fmu", "b.fmu")


def test_writes_c_and_compiles_it(done, tmp_path):
    if not which("cc") and find_spec("ziglang") is None:
        pytest.skip("there is no C compiler")
    said = done("export", "slew", "--c", "folder", "--compile")
    (header,) = (tmp_path / "folder").glob("*drive.h")
    library = tmp_path / "folder" / f"{header.stem}.so"
    assert library.exists()
    assert f"C: folder/{library.name}" in said
