"""`make reproduce`: a page and a PDF, or a sentence."""

from pathlib import Path

import pytest

from reproduction import __main__ as command
from reproduction import build

FEW = ("figure 4.4", "figure 9.1", "table 8.1")


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(build, "ALL", FEW)
    monkeypatch.chdir(tmp_path)


@pytest.mark.usefixtures("few")
def test_page_and_print_are_written(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert command.main(["--out", "sub/thesis", "--seed", "3"]) == 0
    folder = tmp_path / "sub/thesis"
    made = sorted(each.name for each in folder.iterdir())
    assert made == ["reproduction.html", "reproduction.pdf"]
    page = (folder / "reproduction.html").read_text("utf-8")
    assert "seed 3" in page
    assert "figure-9-1" in page
    assert (folder / "reproduction.pdf").read_bytes().startswith(b"%PDF")
    said = capsys.readouterr().out
    assert "2 figures and 1 tables" in said
    assert all(f"sub/thesis/{name}" in said for name in made)


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--out", "file"], "File exists"),
        (["--out", "file/below"], "Not a directory"),
        (["--out", "taken"], "reproduction.html cannot be written: it is a folder"),
    ],
)
def test_what_cannot_be_written_is_said(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, words: list[str], sentence: str
) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "taken/reproduction.html").mkdir(parents=True)
    assert command.main(words) == 2
    assert sentence in capsys.readouterr().err


def test_a_seed_below_zero_is_refused() -> None:
    with pytest.raises(SystemExit):
        command.main(["--seed", "-1"])
