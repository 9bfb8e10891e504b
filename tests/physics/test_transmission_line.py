"""The line between pump and motor: its frequency, its rest, its energy."""

from itertools import pairwise
from math import pi, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from swashplate.physics.transmission_line import line_step

pytestmark = pytest.mark.interpreted

K, LEAK, J, LOAD = 1e6, 1e-6, 5e3, 3e4
H = 1.0 / 512.0
STATES = st.tuples(st.floats(-1e5, 1e5), st.floats(-4.0, 4.0))


def energy(torque: float, speed: float) -> float:
    return torque**2 / (2.0 * K) + 0.5 * J * speed**2


def test_at_rest_the_line_bears_the_load() -> None:
    flow = 1.5
    state = (LOAD, flow - LEAK * LOAD)
    assert line_step(*state, flow, LOAD, K, LEAK, J, H) == pytest.approx(state, rel=1e-14)


def test_it_solves_its_equations() -> None:
    def rates(_: float, state: list[float]) -> list[float]:
        torque, speed = state
        return [K * (2.0 - speed - LEAK * torque), (torque - LOAD) / J]

    expected = solve_ivp(rates, (0.0, 1.0), [0.0, 0.0], rtol=1e-10, atol=1e-8).y[:, -1]
    state = (0.0, 0.0)
    for _ in range(4096):
        state = line_step(*state, 2.0, LOAD, K, LEAK, J, 1.0 / 4096.0)
    assert state == pytest.approx(tuple(expected), rel=2e-4)


def test_a_tight_line_swings_with_its_own_frequency() -> None:
    period = 2.0 * pi / sqrt(K / J)
    state, speeds = (0.0, 1.0), []
    for _ in range(2048):
        state = line_step(*state, 0.0, 0.0, K, 0.0, J, H)
        speeds.append(state[1])
    rising = np.flatnonzero((np.array(speeds[:-1]) < 0.0) & (np.array(speeds[1:]) >= 0.0))
    assert np.diff(rising).mean() * H == pytest.approx(period, rel=3e-3)


@given(STATES, st.floats(0.0, 1e-4), st.floats(1e-5, 1.0))
def test_left_alone_it_never_gains_energy(
    state: tuple[float, float], leakage: float, step: float
) -> None:
    after = line_step(*state, 0.0, 0.0, K, leakage, J, step)
    middle = 0.5 * (state[0] + after[0])
    lost = step * leakage * middle**2
    assert energy(*after) == pytest.approx(energy(*state) - lost, rel=1e-9, abs=1e-9)


def test_a_stiff_line_follows_the_flow() -> None:
    """k → ∞: Ω = Ω_0 - K_mL T with the torque that the load asks for."""
    flows = np.linspace(0.0, 2.0, 513)
    state = (LOAD, -LEAK * LOAD)
    for last, flow in pairwise(flows):
        state = line_step(*state, 0.5 * (last + flow), LOAD, 1e8, LEAK, J, H)
    torque, speed = state
    assert torque == pytest.approx(LOAD + J * 2.0 / (512 * H), rel=1e-2)
    assert speed == pytest.approx(2.0 - LEAK * torque, rel=1e-3)
