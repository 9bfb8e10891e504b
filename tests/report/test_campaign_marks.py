import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from swashplate.report.campaign_marks import (
    IGNORED,
    MASKED,
    MOST_SPANS,
    clipped,
    mark_clipped,
    mark_gaps,
    mark_handles,
    shade,
    spans_of,
    widened,
)
from swashplate.report.campaign_weights import FOOT, has_weights, mark_weights, usual_weight

TIME = np.arange(10.0)


@pytest.fixture
def ax() -> Axes:
    """A panel of 4 by 2 inches, 10 s long."""
    found = Figure(figsize=(4.0, 2.0)).add_axes((0.0, 0.0, 1.0, 1.0))
    found.set_xlim(0.0, 10.0)
    return found


def bounds(collection) -> list[tuple[float, float]]:
    return [
        (path.vertices[:, 0].min(), path.vertices[:, 0].max()) for path in collection.get_paths()
    ]


def test_stretches_end_with_their_last_sample_and_are_shown_half_a_step_wider() -> None:
    active = np.array([1, 1, 0, 0, 1, 0, 0, 0, 1, 1], dtype=bool)
    spans = spans_of(TIME, active)
    np.testing.assert_array_equal(spans, [[0.0, 1.0], [4.0, 4.0], [8.0, 9.0]])
    np.testing.assert_array_equal(widened(TIME, spans), [[-0.5, 1.5], [3.5, 4.5], [7.5, 9.5]])
    assert spans_of(TIME, np.zeros(10, dtype=bool)).shape == (0, 2)


def test_shading_spans_the_panel_over_its_stretches(ax: Axes) -> None:
    shade(ax, np.array([[1.0, 2.0], [4.0, 8.0]]), IGNORED)
    (found,) = ax.collections
    assert bounds(found) == [(1.0, 2.0), (4.0, 8.0)]
    assert {y for path in found.get_paths() for y in path.vertices[:, 1]} == {0.0, 1.0}
    assert found.get_hatch() == IGNORED.hatch != MASKED.hatch
    shade(ax, np.empty((0, 2)), IGNORED)
    assert len(ax.collections) == 1


def test_very_many_stretches_are_merged_where_none_could_tell(ax: Axes) -> None:
    starts = np.arange(0.0, 10.0, 1e-3)
    shade(ax, np.stack((starts, starts + 5e-4), axis=1), MASKED)
    assert len(bounds(ax.collections[0])) <= MOST_SPANS


def test_samples_at_the_ends_of_the_range_are_clipped_whatever_the_units_round_away() -> None:
    values = np.array([-10.0, -9.99, 0.0, 9.99, 10.0, 11.0])
    assert clipped(values, (-10.0, 10.0)).tolist() == [True, False, False, False, True, True]
    factor = 1.0 / 3.0
    rounded = np.array([3.0 * factor * 0.1])
    assert clipped(rounded, (0.0, 0.1 * (1.0 - 1e-15))).all()
    assert not clipped(values, None).any()


def test_clipped_stretches_are_barred_at_the_end_of_the_range(ax: Axes) -> None:
    values = np.array([0.0, 5.0, 5.0, 5.0, 0.0, 0.0, -5.0, 0.0, 0.0, 0.0])
    mark_clipped(ax, TIME, values, (-5.0, 5.0))
    low, high = ax.collections
    np.testing.assert_array_equal(low.get_segments(), [[[5.5, -5.0], [6.5, -5.0]]])
    np.testing.assert_array_equal(high.get_segments(), [[[0.5, 5.0], [3.5, 5.0]]])


def test_nothing_is_barred_without_a_range_or_within_it(ax: Axes) -> None:
    mark_clipped(ax, TIME, TIME, None)
    mark_clipped(ax, TIME, TIME, (-1.0, 10.0))
    assert not ax.collections


def test_gaps_are_pointed_at_in_their_middle(ax: Axes) -> None:
    mark_gaps(ax, np.array([0.0, 1.0, 2.0, 8.0, 9.0]))
    np.testing.assert_array_equal(ax.lines[0].get_xdata(), [5.0])
    mark_gaps(ax, TIME)
    assert len(ax.lines) == 1


def test_the_usual_weight_is_the_most_frequent_that_counts() -> None:
    assert usual_weight(np.array([0.0, 0.0, 0.0, 2.0, 2.0, 20.0])) == 2.0
    assert usual_weight(np.zeros(3)) == 1.0
    assert not has_weights(np.array([0.0, 3.0, 3.0]))
    assert has_weights(np.array([1.0, 3.0]))


def test_weights_stand_at_the_foot_with_their_factors(ax: Axes) -> None:
    weight = np.array([0.0, 2.0, 20.0, 20.0, 2.0, 2.0, 2.0, 1.0, 2.0, 2.0])
    mark_weights(ax, TIME, weight)
    (foot,) = ax.collections
    x, y = foot.get_paths()[0].vertices.T
    highest = FOOT / 2.0
    assert y.max() == pytest.approx(highest)
    assert x[y == y.max()].tolist() == [2.0, 3.0]
    # an edge of one weight that is drawn as such: the 2 among 20 are a tenth as high
    assert y[(x == 5.0) | (x == 4.0)].max() == pytest.approx(0.1 * highest)
    assert [(text.get_text(), text.xy[0]) for text in ax.texts] == [("×10", 3.0), ("×0.5", 7.0)]


def test_factors_without_room_are_left_out(ax: Axes) -> None:
    weight = np.ones(10)
    weight[[2, 9]] = 4.0
    # 0.14 inches from the first to the second, and as much as one likes after that
    mark_weights(ax, TIME / 20.0, weight)
    assert [(text.get_text(), text.xy[0]) for text in ax.texts] == [("×4", 0.45)]


def test_weights_that_follow_the_input_keep_their_extremes_and_have_no_factors(ax: Axes) -> None:
    time = np.linspace(0.0, 10.0, 200_001)
    weight = 1.5 + np.sin(time)
    weight[77_777] = 9.0
    mark_weights(ax, time, weight)
    y = ax.collections[0].get_paths()[0].vertices[:, 1]
    assert y.size < 5000
    assert y.max() == pytest.approx(FOOT / 2.0)
    assert not ax.texts


def test_equal_weights_are_no_news(ax: Axes) -> None:
    mark_weights(ax, TIME, np.r_[np.zeros(5), np.full(5, 64.4)])
    assert not ax.collections


def test_the_legend_explains_what_is_there_and_why(ax: Axes) -> None:
    assert mark_handles([ax], ["start"]) == []
    shade(ax, np.array([[1.0, 2.0]]), IGNORED)
    mark_gaps(ax, np.array([0.0, 1.0, 2.0, 8.0, 9.0]))
    names = [handle.get_label() for handle in mark_handles([ax], ["start", "", "start", "stop"])]
    assert names == ["ignored: start; stop", "gap in the stamps"]
    (ignored, _) = mark_handles([ax], ["a reason that takes more than a line", "and another " * 4])
    assert ignored.get_label() == "ignored"
