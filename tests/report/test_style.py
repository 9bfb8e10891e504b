import subprocess
import sys
import warnings
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swashplate import FileError, Simulation
from swashplate.report.figures import plot_simulation, save_figure
from swashplate.report.style import (
    BLUE,
    dress,
    handle,
    in_lines,
    legend_columns,
    legend_rows,
    sheet,
    signed,
    spread,
)

GAP = 0.1


@given(st.lists(st.floats(0.0, 1.0), max_size=8))
def test_spread_labels_keep_their_order_and_their_distance(places: list[float]) -> None:
    wanted = sorted(places)
    found = spread(wanted, GAP)
    assert len(found) == len(wanted)
    assert all(b - a >= GAP - 1e-9 for a, b in pairwise(found))
    assert sum(found) == pytest.approx(sum(wanted), abs=1e-9)


def test_labels_with_room_stay_where_they_are() -> None:
    assert spread([0.1, 0.5, 0.9], GAP) == [0.1, 0.5, 0.9]
    assert spread([0.5, 0.5], GAP) == pytest.approx([0.45, 0.55])


@pytest.mark.parametrize(
    ("value", "text"), [(1.26, "+1.3"), (-1.26, "−1.3"), (0.0, "0.0"), (-0.01, "0.0")]
)
def test_numbers_have_a_true_minus_and_zero_no_sign(value: float, text: str) -> None:
    assert signed(value, 1) == text


def test_a_legend_takes_as_many_lines_as_its_names_need() -> None:
    assert legend_columns(["a", "b", "c"], 7.0) == 3
    assert legend_columns(["a name that is far wider than the figure itself"], 1.0) == 1
    assert legend_rows([handle("a name of thirty letters, says", "k")] * 7) == 3


@pytest.mark.parametrize(
    ("label", "letters", "lines"),
    [
        ("speed (deg/s)", 20, ["speed (deg/s)"]),
        ("speed from counts (deg/s)", 12, ["speed from", "counts", "(deg/s)"]),
        ("current_of_the_winch (A)", 12, ["current_of_", "the_winch", "(A)"]),
    ],
)
def test_a_label_is_broken_where_it_may_be(label: str, letters: int, lines: list[str]) -> None:
    assert in_lines(label, letters).split("\n") == lines


@given(st.text("ab_ ", max_size=60), st.integers(1, 30))
def test_a_label_never_takes_more_than_three_lines(words: str, letters: int) -> None:
    lines = in_lines(f"{words} (A)", letters).split("\n")
    assert len(lines) <= 3
    assert max(map(len, lines)) <= max(letters, 8)
    assert lines[-1].endswith("(A)")


SIGNATURES = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF", ".PNG": b"\x89PNG"}


@pytest.mark.parametrize("suffix", SIGNATURES)
def test_a_figure_is_written_whole_and_the_same_each_time(
    step: Simulation, tmp_path: Path, suffix: str
) -> None:
    first, second = tmp_path / f"first{suffix}", tmp_path / f"second{suffix}"
    save_figure(plot_simulation(step), first)
    save_figure(plot_simulation(step), str(second))
    content = first.read_bytes()
    assert content.startswith(SIGNATURES[suffix])
    assert content == second.read_bytes()
    assert not any(word in content for word in (b"<dc:date>", b"/CreationDate", b"tEXtCreation"))
    assert sorted(tmp_path.iterdir()) == [first, second]


@pytest.mark.parametrize("name", ["figure.jpg", "figure", "figure.svgz"])
def test_another_ending_is_refused(step: Simulation, tmp_path: Path, name: str) -> None:
    with pytest.raises(FileError, match=r"a figure is written as \.png, \.svg or \.pdf"):
        save_figure(plot_simulation(step), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_said(step: Simulation, tmp_path: Path) -> None:
    with pytest.raises(FileError, match="cannot be written"):
        save_figure(plot_simulation(step), tmp_path / "none" / "figure.png")


def test_an_older_file_stays_when_writing_fails(
    step: Simulation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    figure = plot_simulation(step)
    path = tmp_path / "figure.png"
    path.write_bytes(b"older")

    def full(target: Path, **_: object) -> None:
        target.write_bytes(b"half a pic")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(figure, "savefig", full)
    with pytest.raises(FileError, match="No space left"):
        save_figure(figure, path)
    assert path.read_bytes() == b"older"
    assert list(tmp_path.iterdir()) == [path]


def test_plotting_touches_no_global_state() -> None:
    code = """
import sys
import matplotlib
from swashplate import Drive
from swashplate.report import figures

settings = [name for name in matplotlib.rcParams if name != "backend"]  # asking for it loads one
before = {name: matplotlib.rcParams[name] for name in settings}
figures.plot_simulation(Drive.preset("hoist").simulate([0.0, 1.0]))
assert "matplotlib.pyplot" not in sys.modules
assert {name: matplotlib.rcParams[name] for name in settings} == before
"""
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("format", ["svg", "png", "pdf"])
def test_names_are_drawn_as_they_are(tmp_path: Path, format: str) -> None:
    """A dollar in a name is no formula, and a control character no part of an SVG."""
    figure, (ax,) = sheet([1.0], "$\\frac{1}{$ <b>\x1b]0;x\x07 ${1}", legend=[handle("a$b$", BLUE)])
    dress(ax, "speed $\\x$ (V)", "$t")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        save_figure(figure, tmp_path / f"a.{format}")
    if format == "svg":
        ElementTree.parse(tmp_path / "a.svg")
