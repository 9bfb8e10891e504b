"""Page and PDF: whole, self-contained, labelled, the same every time, or a sentence."""

import re
from base64 import b64decode
from pathlib import Path

import pytest
from matplotlib.text import Text
from reproduction.content import Cell, Curve, Figure, Panel, Reproduction, Table
from reproduction.drawing import own_canvas
from reproduction.page import write_page
from reproduction.printed import write_pdf

from reproduction import __main__ as command
from reproduction import build


def attributes(text: str, name: str) -> list[str]:
    """Every value of an attribute in a page."""
    return re.findall(rf'<[^>]* {name}="([^"]+)"', text)


@pytest.fixture(scope="module")
def text(small: Reproduction, tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("page") / "reproduction.html"
    write_page(small, path)
    return path.read_text("utf-8")


def test_the_page_needs_nothing_else(text: str) -> None:
    sources = attributes(text, "src")
    assert len(sources) == 7
    for source in sources:
        picture = b64decode(source.removeprefix("data:image/svg+xml;base64,"))
        assert picture.startswith(b"<?xml")
        assert b"NaN" not in picture
    assert not re.search(r"(src|href)=\"(https?:)?//", text)
    assert "<script" not in text


def test_every_link_has_its_place(text: str, small: Reproduction) -> None:
    links, ids = re.findall(r'href="#([^"]+)"', text), attributes(text, "id")
    assert len(set(ids)) == len(ids)
    assert set(links) <= set(ids)
    assert {each.anchor for each in (*small.figures, *small.tables)} <= set(links)


def test_what_is_virtual_says_so(text: str) -> None:
    assert "Nothing here was measured." in text
    figures = re.findall(r"<figure id=\"figure-([\d-]+)\"(.*?)</figure>", text, re.DOTALL)
    assert {number for number, shown in figures if "virtual-badge" in shown} == {"7-2", "7-22"}


def test_errata_and_provenance_stand_at_the_end(text: str) -> None:
    assert text.index('id="errata"') < text.index('id="provenance"')
    assert "seed 1" in text
    assert re.search(r"swashplate \d+\.\d+", text)
    assert "table 8.2, for the same card" in text
    assert "0.13 deg/s" in text


def test_the_same_bytes_again(small: Reproduction, text: str, tmp_path: Path) -> None:
    write_page(small, tmp_path / "again.html")
    assert (tmp_path / "again.html").read_text("utf-8") == text
    told = list[str]()
    for name in ("one.pdf", "two.pdf"):
        write_pdf(small, tmp_path / name, begin=told.append)
    first, second = ((tmp_path / name).read_bytes() for name in ("one.pdf", "two.pdf"))
    assert first == second
    assert first.startswith(b"%PDF")
    assert told[:2] == ["printing figure 4.1", "printing figure 4.4"]
    assert sorted(each.name for each in tmp_path.iterdir()) == ["again.html", "one.pdf", "two.pdf"]


def test_texts_stay_within_their_figure(small: Reproduction) -> None:
    for figure in small.figures:
        canvas = own_canvas(figure)
        canvas.draw_without_rendering()
        ticks = [t for ax in canvas.axes for t in (*ax.get_xticklabels(), *ax.get_yticklabels())]
        for text in canvas.findobj(Text):
            if not text.get_visible() or not text.get_text().strip() or text in ticks:
                continue
            box = text.get_window_extent()
            assert text.get_fontsize() >= 8.0, (figure.number, text)
            assert canvas.bbox.x0 <= box.x0 < box.x1 <= canvas.bbox.x1, (figure.number, text)
            assert canvas.bbox.y0 <= box.y0 < box.y1 <= canvas.bbox.y1, (figure.number, text)


def test_foreign_words_are_escaped(tmp_path: Path) -> None:
    import numpy as np

    time = np.array([0.0, 1.0])
    panel = Panel("<b>", (Curve("a & b", time, time, "simulated"),))
    figure = Figure("4.3", "<script>", "1 < 2", (panel,))
    table = Table("4.1", "a & b", ("", "x"), ((Cell("V_{<}"), Cell("1")),))
    made = Reproduction((figure,), (table,), 1, (("seed", "<1>"),))
    write_page(made, tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text("utf-8")
    assert "<script>" not in text
    assert "V<sub>&lt;</sub>" in text


@pytest.mark.slow
def test_all_of_it(everything: Reproduction, tmp_path: Path) -> None:
    assert (len(everything.figures), len(everything.tables)) == (46, 15)
    write_page(everything, tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text("utf-8")
    assert len(attributes(text, "src")) == 46
    assert set(re.findall(r'href="#([^"]+)"', text)) <= set(attributes(text, "id"))
    write_pdf(everything, tmp_path / "page.pdf")
    assert (tmp_path / "page.pdf").stat().st_size > 100_000


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
