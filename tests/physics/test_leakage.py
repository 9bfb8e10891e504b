"""Leakage under load: the lumps of eq. 6.70, and the torque that makes it."""

from math import atan, cos

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swashplate.physics.leakage import leakage_lumps, stiff_line_torque
from swashplate.physics.motor import load_leakage

pytestmark = pytest.mark.interpreted


def test_the_lumps() -> None:
    # 1e-6 rad/(s N m), 30 kN m, 5000 kg m², 12 1/s
    assert leakage_lumps(1e-6, 3e4, 5e3, 12.0) == pytest.approx((0.03, 0.06))


def test_a_hanging_load_slows_hoisting_and_speeds_lowering_up() -> None:
    Z11, _ = leakage_lumps(1e-6, 3e4, 5e3, 12.0)
    assert 1.0 - Z11 < 1.0
    assert abs(-1.0 - Z11) > 1.0


def test_a_load_at_rest_bears_its_weight_alone() -> None:
    assert stiff_line_torque(0.2, 0.0, 3e4, 5e3, 12.0) == 3e4
    assert stiff_line_torque(0.0, 0.5, 0.0, 5e3, 12.0) == pytest.approx(5e3 * 6.0)


@given(st.floats(-1.0, 1.0), st.floats(-2.0, 2.0), st.floats(-5e4, 5e4))
def test_the_leakage_goes_with_the_torque(tangent: float, rate: float, torque: float) -> None:
    K, J, Z10 = 1e-6, 5e3, 12.0
    Z11, Z12 = leakage_lumps(K, torque, J, Z10)
    lost = Z11 + load_leakage(tangent, rate, Z12)
    assert lost == pytest.approx(K * stiff_line_torque(tangent, rate, torque, J, Z10), abs=1e-15)
    expected = K * (torque + J * Z10 * cos(atan(tangent)) * rate)
    assert lost == pytest.approx(expected, rel=1e-12, abs=1e-15)
