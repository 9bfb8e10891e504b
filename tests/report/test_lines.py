import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from swashplate import InputError, Limit, Simulation
from swashplate.report.lines import (
    active_spans,
    alone,
    broken,
    draw_broken,
    envelope,
    gap_rows,
    merged,
    rows_within,
    thinned,
)

WINDOWED = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
NONE = np.empty(0, dtype=np.intp)


def test_a_step_of_more_than_five_usual_ones_is_a_gap() -> None:
    time = np.array([0.0, 1.0, 2.0, 7.0, 8.0, 13.1, 14.1])
    assert gap_rows(time).tolist() == [4]
    assert gap_rows(time[:1]).size == 0


def test_a_line_is_broken_at_gaps_and_nowhere_else() -> None:
    time = np.array([0.0, 1.0, 2.0, 12.0, 13.0])
    stamps, heights = broken(time, 10.0 * time)
    np.testing.assert_array_equal(stamps, [0.0, 1.0, 2.0, 2.0, 12.0, 13.0])
    np.testing.assert_array_equal(heights, [0.0, 10.0, 20.0, np.nan, 120.0, 130.0])


def test_a_short_signal_is_drawn_as_it_is() -> None:
    time = np.arange(20.0)
    np.testing.assert_array_equal(thinned(time, np.sin(time), NONE, columns=10), np.arange(20))


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
    for gap in gaps:
        assert kept[gap]
        assert kept[gap + 1]
    assert kept[0]
    assert kept[-1]
    # of each column and each piece: two extremes, two ends
    assert rows.size <= 2 * (columns + 1) + 4 * (gaps.size + 1)


def test_a_long_signal_keeps_a_single_spike_either_way() -> None:
    time = np.arange(1_000_000) / 512.0
    values = np.zeros(time.size)
    values[123_456], values[765_432] = 7.0, -3.0
    stamps, heights = broken(time, values)
    assert stamps.size < 3000
    assert heights[stamps == time[123_456]] == 7.0
    assert heights[stamps == time[765_432]] == -3.0
    assert (stamps[0], stamps[-1]) == (time[0], time[-1])


def test_samples_between_two_gaps_are_alone() -> None:
    assert alone(5, np.array([0, 1])).tolist() == [True, True, False, False, False]
    assert alone(3, NONE).tolist() == [False, False, False]
    assert alone(1, NONE).tolist() == [True]


def test_drawing_leaves_out_what_is_not_shown_and_dots_what_is_alone() -> None:
    ax = Figure().subplots()
    time = np.arange(10.0)
    shown = np.array([1, 1, 1, 0, 1, 0, 1, 1, 1, 1], dtype=bool)
    draw_broken(ax, time, 2.0 * time, "k", shown=shown, label="x")
    line, dots = ax.lines
    assert np.flatnonzero(np.isnan(line.get_ydata())).tolist() == [3, 5]
    np.testing.assert_array_equal(dots.get_xdata(), [4.0])
    np.testing.assert_array_equal(dots.get_ydata(), [8.0])


def test_a_staircase_ends_with_its_last_sample_before_a_gap() -> None:
    ax = Figure().subplots()
    draw_broken(ax, np.array([0.0, 1.0, 2.0, 30.0, 31.0]), np.ones(5), "k", held=True)
    (line,) = ax.lines
    assert line.get_drawstyle() == "steps-post"
    broken_at = np.isnan(line.get_ydata())
    np.testing.assert_array_equal(np.asarray(line.get_xdata())[broken_at], [2.0])


def test_nothing_to_show_draws_nothing() -> None:
    ax = Figure().subplots()
    draw_broken(ax, np.arange(3.0), np.ones(3), "k", shown=np.zeros(3, dtype=bool))
    assert not ax.lines


@pytest.mark.parametrize("size", [16, 17, 100, 999, 1000])
def test_an_envelope_keeps_the_extremes_of_every_stretch(size: int) -> None:
    time = np.arange(size) / 10.0
    values = np.random.default_rng(size).normal(size=size)
    stamps, heights = envelope(time, values, most=16)
    assert stamps.size <= 16 + 4
    assert (np.diff(stamps) > 0.0).all()
    np.testing.assert_array_equal(values[np.searchsorted(time, stamps)], heights)
    assert stamps[0] == time[0]
    assert stamps[-1] == time[-1]
    stretch = -(-size // 8)
    for start in range(0, size, stretch):
        assert values[start : start + stretch].max() in heights
        assert values[start : start + stretch].min() in heights


def test_spans_are_merged_only_when_there_are_too_many() -> None:
    spans = np.array([[0.0, 1.0], [1.1, 2.0], [3.0, 4.0], [4.05, 5.0]])
    np.testing.assert_array_equal(merged(spans, 0.5, most=4), spans)
    np.testing.assert_array_equal(merged(spans, 0.5, most=3), [[0.0, 2.0], [3.0, 5.0]])


def test_a_limit_that_never_acts_has_no_spans(step: Simulation) -> None:
    assert active_spans(step, Limit.RELIEF).shape == (0, 2)


def test_a_window_holds_its_ends() -> None:
    assert rows_within(WINDOWED, (1.0, 3.0), "x") == slice(1, 4)
    assert rows_within(WINDOWED, (0.5, 9.0), "x") == slice(1, 5)
    assert rows_within(WINDOWED, None, "x") == slice(0, 5)


@pytest.mark.parametrize("window", [(1.5, 2.5), (8.0, 9.0), (3.0, 1.0)])
def test_a_window_without_a_line_is_refused(window: tuple[float, float]) -> None:
    with pytest.raises(InputError, match=r"samples of boom.csv, which goes from 0 s to 4 s"):
        rows_within(WINDOWED, window, "boom.csv")
