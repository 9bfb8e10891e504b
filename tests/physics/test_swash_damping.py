"""Damping of the swash plate: it comes late, keeps the oil and takes energy."""

from math import exp

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from swashplate.physics.swash_damping import damping_factor, plate_follows, plate_pressure_rate

pytestmark = pytest.mark.interpreted

PRESSURES = st.floats(-5e6, 5e6)
PISTONS = st.floats(0.0, 500.0)


def test_one_step_by_hand() -> None:
    # Z6 = 1, half of the lag of 4 bar left: 1 bar for each of the two
    assert plate_follows(9e5, 5e5, 1.0, 0.5) == pytest.approx((8e5, 6e5))
    assert damping_factor(0.1, 1.0, 0.05) == pytest.approx(exp(-1.0))
    assert plate_pressure_rate(9e5, 5e5, 0.1) == pytest.approx(4e6)


@given(PRESSURES, PRESSURES, PISTONS, st.floats(0.0, 1.0))
def test_the_oil_stays_and_the_energy_falls(p: float, q: float, Z6: float, factor: float) -> None:
    pressure, plate = plate_follows(p, q, Z6, factor)
    scale = 1e-12 * (1.0 + Z6) * 1e7
    assert pressure + Z6 * plate == pytest.approx(p + Z6 * q, abs=scale)
    assert pressure - plate == pytest.approx(factor * (p - q), abs=scale)
    assert pressure**2 + Z6 * plate**2 <= p**2 + Z6 * q**2 + 1e7 * scale


def test_it_solves_the_plates_equation() -> None:
    """T p' = δP - p with δP + Z6 p constant, by SciPy."""
    T, Z6, time = 0.03, 2.0, 0.02

    def rates(_: float, state: list[float]) -> list[float]:
        moving = plate_pressure_rate(state[0], state[1], T)
        return [-Z6 * moving, moving]

    expected = solve_ivp(rates, (0.0, time), [2e6, 5e5], rtol=1e-10, atol=1e-3).y[:, -1]
    made = plate_follows(2e6, 5e5, Z6, damping_factor(T, Z6, time))
    assert made == pytest.approx(tuple(expected), rel=1e-7)
