from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swashplate.report.style import legend_columns, legend_rows, signed, spread

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
    assert legend_rows(["a", "b", "c"], 7.0) == 1
    assert legend_rows(["a name of thirty letters, says"] * 7, 7.0) == 3
    assert legend_columns(["a name that is far wider than the figure itself"], 1.0) == 1
    assert legend_rows([], 7.0) == 0
