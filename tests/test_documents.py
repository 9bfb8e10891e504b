"""What is wrong in a TOML document, said in one sentence."""

import os

import pytest
from pydantic import BaseModel, ConfigDict

from swashplate import FileError, ParameterError, documents
from swashplate.documents import parse_toml, read_json, read_text, validated

QUOTED = ".".join(['"a"'] * 20_000)
SPACED = " . ".join(["'a'"] * 20_000)
MIXED = ".".join(['"a"', "'b'", "c", r'"\u0061"'] * 5_000)


class Entry(BaseModel):
    model_config = ConfigDict(extra="forbid")
    column: str
    unit: str


class Document(BaseModel):
    model_config = ConfigDict(extra="forbid")
    signal: Entry


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        ({"colunm": "u", "unit": "V"}, "'colunm': ... 'column'"),
        ({"rate": 1, "unit": "V"}, "entry 'column'"),
        ({"column": "u", "unit": "V", "unti": "V"}, "'unti': ... 'unit'"),
    ],
)
def test_one_sentence(entries, said):
    with pytest.raises(ParameterError) as refused:
        validated({"signal": entries}, Document, "a.toml")
    for part in said.split("..."):
        assert part in str(refused.value)
    assert str(refused.value).startswith("a.toml: [signal]")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f"a = {'[' * 500}{']' * 500}", "nests its tables or lists too deeply"),
        (f"a = {'[' * 100_000}{']' * 100_000}", "nests its tables or lists too deeply"),
        (f"a = {'{a=' * 3000}1{'}' * 3000}", "nests its tables or lists too deeply"),
        (f"a = {'9' * 5000}", "many digits"),
        (f"{'.'.join('a' * 20_000)} = 1", "a key of more than 40 parts"),
        (f"[{' . '.join('a' * 20_000)}]", "a key of more than 40 parts"),
        (f"{QUOTED} = 1", "a key of more than 40 parts"),
        (f"{SPACED} = 1", "a key of more than 40 parts"),
        (f"{MIXED} = 1", "a key of more than 40 parts"),
        (f"[{QUOTED}]", "a key of more than 40 parts"),
        (f"[[{QUOTED}]]", "a key of more than 40 parts"),
        (f"a = {{ {QUOTED} = 1 }}", "a key of more than 40 parts"),
        (f"a = [{{ {SPACED} = 1 }}]", "a key of more than 40 parts"),
        # behind quotes that end later than a hasty reader thinks
        (f'a = ["""b"""", {{ {QUOTED} = 1 }}]', "a key of more than 40 parts"),
        (f"# it's\n{QUOTED} = 1", "a key of more than 40 parts"),
        (f"a = 0x{'f' * 100_000}", "many digits"),
        (f"a = [0o{'7' * 100_000}]", "many digits"),
        (f"a = {{ b = 0b{'1' * 100_000} }}", "many digits"),
        (f"a = {2**63}", "many digits"),
        ('name = "\\u001b[31mred"', "the character U+001B"),
        ('[runs]\n"a\\u0007" = 1', "the character U+0007"),
        ('title = "\\uFFFE"', "the character U+FFFE"),
        ('title = "\\u202Egnp.exe"', "the character U+202E"),
        ('title = "\\uFFFF"', "the character U+FFFF"),
        ('title = "\\uD800"', "is not TOML"),
        (f"name = '{'x' * 100_000}'", "a text of 100000 characters"),
        (f"{'x' * 100_000} = 1", "a key of 100000 characters"),
        (f"a = [{'1,' * 4_300_000}]", "more than 8 MB"),
        ("name = ", "Invalid value (at end of document)"),
    ],
)
def test_toml_that_nobody_writes(text, said):
    with pytest.raises(FileError) as refused:
        parse_toml(text, "a.toml")
    assert str(refused.value).startswith("a.toml ")
    assert said in str(refused.value)


def test_toml_that_people_write():
    """Dots and quotes in texts and comments are no keys, however many there are."""
    dots = ".".join(["a"] * 100)
    text = f"""
# {dots}
title = "{dots} and \\"{dots}\\" 'x'"
path = '{dots}'
long = \"\"\"
{dots}\"\"\"
least = {-(2**63)}
[axes.hoist.channels."shaft speed".time]
numbers = [1.5, 2.5, 0xff, 1_000.5e-3]
"""
    content = parse_toml(text, "a.toml")
    assert content["long"] == dots
    assert content["least"] == -(2**63)
    assert content["axes"]["hoist"]["channels"]["shaft speed"]["time"]["numbers"][2] == 255


def test_texts_that_are_no_files(tmp_path, monkeypatch):
    (tmp_path / "bom.toml").write_bytes(b"\xef\xbb\xbfname = 'a'")
    assert parse_toml(read_text(tmp_path / "bom.toml"), "a") == {"name": "a"}
    os.mkfifo(tmp_path / "fifo.toml")
    (tmp_path / "zero.toml").symlink_to("/dev/zero")
    for name in ("fifo.toml", "zero.toml", "."):
        with pytest.raises(FileError, match="(ordinary|folder, not a) file"):
            read_text(tmp_path / name)
    monkeypatch.setattr(documents, "LARGEST", 5)
    with pytest.raises(FileError, match=r"bom\.toml.* large"):
        read_text(tmp_path / "bom.toml")


def test_json_that_nobody_writes(tmp_path):
    place = tmp_path / "fit.json"
    for text in ("[" * 100_000, f'{{"column": {"9" * 5000}, "unit": "V"}}', "", '{"column"'):
        place.write_text(text)
        with pytest.raises((FileError, ParameterError), match="fit.json"):
            read_json(place, Entry)
