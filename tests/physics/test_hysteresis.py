"""Hysteresis of the solenoids: a loop that neither rate nor step changes and that takes energy."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swashplate.physics.hysteresis import magnetising_current

pytestmark = pytest.mark.interpreted

R = 0.01
PATHS = st.lists(st.floats(-0.8, 0.8), min_size=2, max_size=40)


def followed(path: list[float], width: float = R, start: float = 0.0) -> list[float]:
    made = []
    for current in path:
        start = magnetising_current(current, start, width)
        made.append(start)
    return made


def test_the_force_lags_on_both_sides_of_the_loop() -> None:
    # up to 0.5 A, down to 0.3 A by way of a part that is spent in the play
    assert followed([0.5, 0.495, 0.485, 0.3]) == pytest.approx([0.49, 0.49, 0.49, 0.31])


def test_a_small_motion_moves_nothing() -> None:
    assert followed([0.009, -0.009, 0.005]) == [0.0, 0.0, 0.0]


@given(PATHS)
def test_without_width_it_is_the_current(path: list[float]) -> None:
    assert followed(path, 0.0) == path


@given(PATHS)
def test_points_on_the_way_change_nothing(path: list[float]) -> None:
    there = [0.5 * (a + b) for a, b in pairwise(path)]
    finer = [each for pair in zip(path, [*there, path[-1]], strict=True) for each in pair]
    assert followed(finer)[-1] == followed(path)[-1]


@given(PATHS)
def test_a_closed_loop_takes_energy(path: list[float]) -> None:
    """∮ i dF ≥ 0 with F rising with the magnetising current: each change costs r |Δi_m|."""
    before, taken = 0.0, 0.0
    for current, after in zip(path, followed(path), strict=True):
        work = current * (after - before)
        assert work >= after * (after - before) + R * abs(after - before) - 1e-15
        taken += work - 0.5 * (after**2 - before**2)
        before = after
    assert taken >= -1e-15
