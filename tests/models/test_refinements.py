"""The refinements against what they are to be: friction, hysteresis, ripple, damping, line."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from swashplate.models.displacement_control import Pump
from swashplate.models.refinements import (
    damping_factor,
    held_back,
    line_step,
    magnetising_current,
    plate_follows,
    plate_pressure_rate,
)

pytestmark = pytest.mark.interpreted

# --- friction -------------------------------------------------------------------------------------

W, TRAVEL = 3e-5, 5e-5
BALANCES = st.lists(st.floats(-4e-4, 4e-4), min_size=2, max_size=40)


@given(BALANCES, st.sampled_from([0.0, 1e-6, TRAVEL, 1e-3]), st.floats(0.0, 1.0))
def test_it_never_gives_energy(path: list[float], travel: float, factor: float) -> None:
    """Work on the spool, over the stiffness: at least what the travel stores, x_s d²/(2 w)."""
    deflection, spool, work = 0.0, 0.0, 0.0
    for balance in path:
        deflection = held_back(deflection, balance, spool, W, travel, factor)
        work += deflection * (balance - deflection - spool)
        spool = balance - deflection
        assert abs(deflection) <= W
        assert work >= 0.5 * travel / W * deflection**2 - 1e-22


# --- hysteresis -----------------------------------------------------------------------------------

PLAY = 0.01
CURRENTS = st.lists(st.floats(-0.8, 0.8), min_size=2, max_size=40)


def followed(path: list[float], width: float = PLAY, start: float = 0.0) -> list[float]:
    made = []
    for current in path:
        start = magnetising_current(current, start, width)
        made.append(start)
    return made


@given(CURRENTS)
def test_a_closed_loop_takes_energy(path: list[float]) -> None:
    """∮ i dF ≥ 0 with F rising with the magnetising current: each change costs r |Δi_m|."""
    before, taken = 0.0, 0.0
    for current, after in zip(path, followed(path), strict=True):
        work = current * (after - before)
        assert work >= after * (after - before) + PLAY * abs(after - before) - 1e-15
        taken += work - 0.5 * (after**2 - before**2)
        before = after
    assert taken >= -1e-15


# --- damping --------------------------------------------------------------------------------------

PRESSURES = st.floats(-5e6, 5e6)
PISTONS = st.floats(0.0, 500.0)


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


# --- line -----------------------------------------------------------------------------------------

K, LEAK, J, LOAD = 1e6, 1e-6, 5e3, 3e4
LINE = Pump(*[0.0] * 28, line_stiffness=K, motor_leakage=LEAK, load_inertia=J)
STATES = st.tuples(st.floats(-1e5, 1e5), st.floats(-4.0, 4.0))


def energy(torque: float, speed: float) -> float:
    return torque**2 / (2.0 * K) + 0.5 * J * speed**2


def test_it_solves_its_equations() -> None:
    def rates(_: float, state: list[float]) -> list[float]:
        torque, speed = state
        return [K * (2.0 - speed - LEAK * torque), (torque - LOAD) / J]

    expected = solve_ivp(rates, (0.0, 1.0), [0.0, 0.0], rtol=1e-10, atol=1e-8).y[:, -1]
    state = (0.0, 0.0)
    for _ in range(4096):
        state = line_step(*state, 2.0, LOAD, LINE, 1.0 / 4096.0)
    assert state == pytest.approx(tuple(expected), rel=2e-4)


@given(STATES, st.floats(0.0, 1e-4), st.floats(1e-5, 1.0))
def test_left_alone_it_never_gains_energy(
    state: tuple[float, float], leakage: float, step: float
) -> None:
    after = line_step(*state, 0.0, 0.0, LINE._replace(motor_leakage=leakage), step)
    middle = 0.5 * (state[0] + after[0])
    lost = step * leakage * middle**2
    assert energy(*after) == pytest.approx(energy(*state) - lost, rel=1e-9, abs=1e-9)
