"""Stiction: it holds back, slides, fades under dither and never gives energy."""

from math import exp, inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swashplate.physics.stiction import (
    dither_factor,
    held_back,
    spring_stiffness,
    stiction_width,
)

pytestmark = pytest.mark.interpreted

W, TRAVEL = 3e-5, 5e-5
PATHS = st.lists(st.floats(-4e-4, 4e-4), min_size=2, max_size=40)


def test_the_width_is_the_force_over_the_springs_stiffness() -> None:
    # √0.25 N m over (0.01 m)² is 5000 N/m, and 0.1 N moves it by 20 µm
    assert spring_stiffness(0.25, 0.01) == pytest.approx(5000.0, rel=1e-15)
    assert stiction_width(0.1, 0.25, 0.01) == pytest.approx(2e-5, rel=1e-15)


def test_dither_leaves_a_share_each_step() -> None:
    assert dither_factor(0.5, 0.25) == pytest.approx(exp(-0.5), rel=1e-15)
    assert dither_factor(inf, 0.25) == 1.0


def test_a_spool_without_give_stands_still_until_the_force_is_spent() -> None:
    # the balance moves by 2/3 of the width and back, then by two widths
    assert 2e-5 - held_back(0.0, 2e-5, 0.0, W, 0.0, 1.0) == 0.0
    assert held_back(2e-5, 0.0, 0.0, W, 0.0, 1.0) == 0.0
    assert held_back(0.0, 6e-5, 0.0, W, 0.0, 1.0) == W


def test_friction_and_spring_share_a_small_motion() -> None:
    # two springs in series with the balance: k and F_s/x_s = k W/TRAVEL
    deflection = held_back(0.0, 1.6e-5, 0.0, W, TRAVEL, 1.0)
    assert deflection == pytest.approx(1.6e-5 * W / (W + TRAVEL), rel=1e-15)
    assert deflection / W == pytest.approx((1.6e-5 - deflection) / TRAVEL, rel=1e-15)


def test_dither_lets_the_spool_go_to_its_balance() -> None:
    """With the balance at rest d' = -(x_s/(x_s + w)) d/T, solved by an exponential."""
    T, h, seconds = 0.6, 1e-4, 0.5
    deflection, factor = W, dither_factor(T, h)
    for _ in range(round(seconds / h)):
        deflection = held_back(deflection, W, W - deflection, W, TRAVEL, factor)
    expected = W * exp(-TRAVEL / (TRAVEL + W) * seconds / T)
    assert deflection == pytest.approx(expected, rel=1e-3)


@given(PATHS, st.sampled_from([0.0, 1e-6, TRAVEL, 1e-3]), st.floats(0.0, 1.0))
def test_it_never_gives_energy(path: list[float], travel: float, factor: float) -> None:
    """Work on the spool, over the stiffness: at least what the travel stores, x_s d²/(2 w)."""
    deflection, spool, work = 0.0, 0.0, 0.0
    for balance in path:
        deflection = held_back(deflection, balance, spool, W, travel, factor)
        work += deflection * (balance - deflection - spool)
        spool = balance - deflection
        assert abs(deflection) <= W
        assert work >= 0.5 * travel / W * deflection**2 - 1e-22


@given(PATHS)
def test_without_friction_to_speak_of_the_spool_is_at_its_balance(path: list[float]) -> None:
    deflection, spool = 0.0, 0.0
    for balance in path:
        deflection = held_back(deflection, balance, spool, 1e-15, TRAVEL, 1.0)
        spool = balance - deflection
        assert abs(spool - balance) < 2e-15  # the width, and rounding
