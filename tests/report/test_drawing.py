"""What all figures share: lines that lose no extreme, labels that fit, files written whole."""

import subprocess
import sys
import warnings
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from swashplate import FileError, Simulation
from swashplate.report.figures import plot_simulation, save_figure
from swashplate.report.lines import draw, gap_rows, thinned
from swashplate.report.style import BLUE, dress, handle, sheet

GAP = 0.1


@given(
    st.lists(st.integers(-5, 5), min_size=25, max_size=150),
    st.lists(st.sampled_from([1.0, 1.3, 20.0]), min_size=150, max_size=150),
    st.integers(3, 12),
)
def test_no_extreme_is_lost_on_either_side_of_a_gap(
    values: list[int], steps: list[float], columns: int
) -> None:
    heights = np.array(values, dtype=float)
    time = np.cumsum(steps)[: heights.size]
    gaps = gap_rows(time)
    rows = thinned(time, heights, gaps, columns)
    assert (np.diff(rows) > 0).all()
    # the reference: every piece between gaps, cut by hand into columns of time
    width = (time[-1] - time[0]) / columns
    column = np.floor((time - time[0]) / width)
    piece = np.zeros(time.size)
    for gap in gaps:
        piece[gap + 1 :] += 1.0
    kept = np.isin(np.arange(time.size), rows)
    if heights.size <= 2 * columns:
        assert kept.all()
        return
    for key in {*zip(piece, column, strict=True)}:
        # columns whose edge a stamp meets are left out: rounding decides whose it is
        inside = (piece == key[0]) & (column == key[1])
        edges = (time[piece == key[0]] - time[0]) / width
        met = np.round(edges[np.abs(edges - np.round(edges)) < 1e-9])
        if np.isin(met, [key[1], key[1] + 1]).any():
            continue
        assert heights[inside & kept].min() == heights[inside].min()
        assert heights[inside & kept].max() == heights[inside].max()
    assert kept[[0, -1, *gaps, *(gaps + 1)]].all()
    # of each column and each piece: two extremes, two ends
    assert rows.size <= 2 * (columns + 1) + 4 * (gaps.size + 1)


def test_a_line_is_broken_where_samples_are_missing_and_a_lonely_one_is_a_dot() -> None:
    ax = Figure().subplots()
    time = np.array([0.0, 1.0, 2.0, 9.1, 15.0, 16.0])  # two steps of more than 5 s
    draw(ax, time, time, "k", held=True)
    line, dots = ax.lines
    stamps, heights = line.get_data()
    np.testing.assert_array_equal(stamps, [0.0, 1.0, 2.0, 2.0, 9.1, 9.1, 15.0, 16.0])
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(heights)), [3, 5])
    assert line.get_drawstyle() == "steps-post"
    assert [each.tolist() for each in dots.get_data()] == [[9.1], [9.1]]


SIGNATURES = {".PNG": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}


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


def test_a_file_that_cannot_be_written_is_said_and_the_older_one_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    figure, path = Figure(), tmp_path / "figure.png"
    for name in ("figure.jpg", "figure", "figure.svgz"):
        with pytest.raises(FileError, match=r"a figure is written as \.png, \.svg or \.pdf"):
            save_figure(figure, tmp_path / name)
    with pytest.raises(FileError, match="cannot be written"):
        save_figure(figure, tmp_path / "none" / "figure.png")
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


@pytest.mark.parametrize("format", ["svg", "png"])
def test_names_are_drawn_as_they_are(tmp_path: Path, format: str) -> None:
    """A dollar in a name is no formula, and a control character no part of an SVG."""
    figure, (ax,) = sheet([1.0], "$\\frac{1}{$ <b>\x1b]0;x\x07 ${1}", legend=[handle("a$b$", BLUE)])
    dress(ax, "speed $\\x$ (V)", "$t")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        save_figure(figure, tmp_path / f"a.{format}")
    if format == "svg":
        ElementTree.parse(tmp_path / "a.svg")
