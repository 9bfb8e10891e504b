"""A drive is named by a packaged set, a parameter file or the folder of a fit."""

import re
from pathlib import Path

import pytest

from swashplate.cli.words import drive_file

NUMBER = re.compile(r"(?<!\S)[-+]?\d[\d.e+-]*(?!\S)")


@pytest.fixture
def fitted(done, tmp_path):
    """A folder as 'fit' leaves it: a hoist with a larger pump, which is 1.1 times as fast."""
    (tmp_path / "fitted").mkdir()
    done("whatif", "hoist", "--scale", "pump=1.1", "--out", "fitted/drive.toml")


@pytest.mark.usefixtures("fitted")
@pytest.mark.parametrize(
    "words",
    [
        ("show", "fitted"),
        ("simulate", "fitted", "step:4"),
        ("compare", "hoist", "fitted"),
        ("limits", "fitted"),
        ("whatif", "fitted", "--scale", "pump=1.1"),
    ],
)
def test_each_command_takes_the_folder_of_a_fit(done, words):
    by_file = ["fitted/drive.toml" if word == "fitted" else word for word in words]
    first, second = (NUMBER.findall(done(*each)) for each in (words, by_file))
    assert len(first) > 5
    assert first == second


def test_what_a_word_means(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("hoist", "fit"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "drive.toml").touch()
    assert drive_file("hoist") is None
    assert drive_file("./hoist") == Path("hoist/drive.toml")
    assert drive_file("fit") == Path("fit/drive.toml")
    assert drive_file("fit/drive.toml") == Path("fit/drive.toml")
    assert drive_file("mine.TOML") == Path("mine.TOML")


def test_what_is_none_of_them(refused, tmp_path):
    (tmp_path / "empty").mkdir()
    assert "no packaged set, file or folder 'nofit'" in refused("simulate", "nofit", "step:9")
    assert "There is no drive.toml in empty: give a folder" in refused("limits", "empty")
