"""Ripple of the cam ring: it goes with the angle and the load, and makes no oil."""

from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from swashplate.physics.cam_ripple import ripple_depth, rippled_angle

pytestmark = pytest.mark.interpreted


def test_the_depth_grows_with_the_load_whatever_its_sign() -> None:
    assert ripple_depth(0.01, 1e-6, 3e4) == pytest.approx(0.04)
    assert ripple_depth(0.01, 1e-6, -3e4) == pytest.approx(0.04)
    assert ripple_depth(0.01, 1e-6, 0.0) == 0.01


def test_a_quarter_cycle() -> None:
    assert rippled_angle(0.21, 0.0, 0.05, 5.5, 0.0) == 0.21
    assert rippled_angle(0.21, 0.5 * pi / 5.5, 0.05, 5.5, 0.0) == pytest.approx(0.2)
    assert rippled_angle(0.21, 0.0, 0.05, 5.5, -0.5 * pi) == pytest.approx(0.21 / 0.95)


@given(st.floats(-0.3, 0.3), st.floats(-50.0, 50.0))
def test_without_depth_it_is_the_plates_own_angle(angle: float, shaft: float) -> None:
    assert rippled_angle(angle, shaft, 0.0, 5.5, 0.3) == angle


@given(st.floats(0.0, 0.9), st.floats(-pi, pi))
def test_two_turns_take_the_oil_of_two_turns(depth: float, phase: float) -> None:
    """Time of eleven cycles at a constant flow: the integral of dθ over the speed."""
    time, _ = quad(lambda q: 1.0 / rippled_angle(1.0, q, depth, 5.5, phase), 0.0, 4.0 * pi)
    assert time == pytest.approx(4.0 * pi, rel=1e-9)
