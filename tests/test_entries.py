"""A number in a file is a number: neither ``true`` nor ``"36"``; and a truth value is no number."""

import re
from types import SimpleNamespace

import pytest

from swashplate import Drive, InputError, ParameterError
from swashplate.campaign import Campaign
from swashplate.cli.parsing import model_parameters_of
from swashplate.identification import ModelSetup, load_setup

CAMPAIGN = """
virtual = true
format = { header_row = 1 }
[axes.a]
time = { rate = 10.0 }
input = { column = "u", sign = 1, scale = 2.0, offset = 0.5 }
[axes.a.channels.c]
kind = "position"
column = "y"
limits = [0.0, 3.0]
weight_by_input = [[4.0, 1.0]]
[[runs]]
file = "x.csv"
weight = 5.0
"""
SETUP = """
part = "card"
current_scale = 1.0
[free.Z1]
relative = [0.5, 2.0]
log = true
prior = { mean = 3.0, deviation = 4.0 }
[forces]
plus = [0.1, 0.2, 0.3, 0.4]
minus = [0.15, 0.25, 0.35, 0.45]
[standard_uncertainty]
Z2 = 5.0
"""
NUMBER = re.compile(r"(?<![\w.])\d+\.\d+(?![\w.])")


def variants(text, pattern, *replacements):
    """The text with each match of a pattern replaced in turn."""
    for match in re.finditer(pattern, text):
        for new in replacements:
            yield text[: match.start()] + new(match[0]) + text[match.end() :]


def refused(read, path, texts):
    """Number of texts, each of which must be refused in a sentence that names the file."""
    texts = list(texts)
    for text in texts:
        path.write_text(text)
        with pytest.raises(ParameterError, match=re.escape(path.name)) as error:
            read(path)
        assert "valid" in str(error.value) or "number" in str(error.value), text
    return len(texts)


def truth(number):
    return "true"


def quoted(number):
    return f'"{number}"'


def test_numbers_of_a_campaign(tmp_path):
    path = tmp_path / "campaign.toml"
    assert refused(Campaign.from_toml, path, variants(CAMPAIGN, NUMBER, truth, quoted)) == 16
    whole = r"(?<=sign = )1|(?<=header_row = )1"
    assert refused(Campaign.from_toml, path, variants(CAMPAIGN, whole, truth, quoted)) == 4
    switch = variants(CAMPAIGN, "true", lambda _: "1", lambda _: '"yes"')
    assert refused(Campaign.from_toml, path, switch) == 2


def test_numbers_of_a_fit_configuration(tmp_path):
    path = tmp_path / "setup.toml"
    assert load_setup(_written(path, SETUP)).free["Z1"].relative == (0.5, 2.0)
    assert refused(load_setup, path, variants(SETUP, NUMBER, truth, quoted)) == 28
    assert refused(load_setup, path, variants(SETUP, "true", lambda _: "1")) == 1


def test_numbers_of_a_drive(tmp_path):
    path = tmp_path / "drive.toml"
    Drive.preset("hoist").to_toml(path)
    text = "".join(
        line
        for line in path.read_text().splitlines(keepends=True)
        if line.startswith(("Z16 ", "Z7 ", "Z1 ", "[", "format", "name"))
    )
    found = refused(
        Drive.from_toml, path, variants(text, r"(?<=[ \[])\d[\d.e-]*(?=[,\]])", truth, quoted)
    )
    assert found >= 8
    for name in ("name", "card"):
        Drive.preset("hoist").to_toml(path)
        long = re.sub(f"^{name} = .*", f'{name} = "{"x" * 10_000}"', path.read_text(), flags=re.M)
        path.write_text(long)
        with pytest.raises(ParameterError, match=f"drive.toml: {name} .* 100"):
            Drive.from_toml(path)


@pytest.mark.parametrize("value", ["true", '"0.1"', "[0.1]", "{ value = 0.1 }"])
def test_numbers_of_a_model_of_ones_own(tmp_path, monkeypatch, value):
    nominal = SimpleNamespace(numbers={"lag": 0.1})
    setup = SimpleNamespace(name="valve", nominal=lambda runs: nominal)
    monkeypatch.setattr(ModelSetup, "from_file", lambda path: setup)
    _written(tmp_path / "parameters.toml", f"[valve]\nlag = {value}\n")
    with pytest.raises(InputError, match=r"parameters.toml: lag under \[valve\]"):
        model_parameters_of(str(tmp_path), tmp_path / "valve.py", ())


def _written(path, text):
    path.write_text(text)
    return path
