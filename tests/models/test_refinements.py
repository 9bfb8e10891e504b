"""The refinements against what they are to be: friction, hysteresis, ripple, damping, line."""

from math import atan, cos, exp, pi, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp

from swashplate.models.refinements import (
    accelerating_leakage,
    damping_factor,
    dither_factor,
    friction_width,
    held_back,
    line_step,
    load_leakage,
    magnetising_current,
    plate_follows,
    plate_pressure_rate,
    ripple_depth,
    rippled_angle,
    spring_stiffness,
    static_leakage,
    stiff_line_torque,
)

pytestmark = pytest.mark.interpreted

# --- friction -------------------------------------------------------------------------------------

W, TRAVEL = 3e-5, 5e-5
BALANCES = st.lists(st.floats(-4e-4, 4e-4), min_size=2, max_size=40)


def test_the_frictions_width_is_the_force_over_the_springs_stiffness() -> None:
    # √0.25 N m over (0.01 m)² is 5000 N/m, and 0.1 N moves it by 20 µm
    assert spring_stiffness(0.25, 0.01) == pytest.approx(5000.0, rel=1e-15)
    assert friction_width(0.1, 0.25, 0.01) == pytest.approx(2e-5, rel=1e-15)


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


def test_the_force_lags_on_both_sides_of_the_loop() -> None:
    # up to 0.5 A, down to 0.3 A by way of a part that is spent in the play
    assert followed([0.5, 0.495, 0.485, 0.3]) == pytest.approx([0.49, 0.49, 0.49, 0.31])


def test_a_small_motion_moves_nothing() -> None:
    assert followed([0.009, -0.009, 0.005]) == [0.0, 0.0, 0.0]


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


# --- ripple ---------------------------------------------------------------------------------------


def test_the_depth_grows_with_the_load_whatever_its_sign() -> None:
    assert ripple_depth(0.01, 1e-6, 3e4) == pytest.approx(0.04)
    assert ripple_depth(0.01, 1e-6, -3e4) == pytest.approx(0.04)
    assert ripple_depth(0.01, 1e-6, 0.0) == 0.01


def test_a_quarter_cycle() -> None:
    assert rippled_angle(0.21, 0.0, 0.05, 5.5, 0.0) == 0.21
    assert rippled_angle(0.21, 0.5 * pi / 5.5, 0.05, 5.5, 0.0) == pytest.approx(0.2)
    assert rippled_angle(0.21, 0.0, 0.05, 5.5, -0.5 * pi) == pytest.approx(0.21 / 0.95)


@given(st.floats(0.0, 0.9), st.floats(-pi, pi))
def test_two_turns_take_the_oil_of_two_turns(depth: float, phase: float) -> None:
    """Time of eleven cycles at a constant flow: the integral of dθ over the speed."""
    time, _ = quad(lambda q: 1.0 / rippled_angle(1.0, q, depth, 5.5, phase), 0.0, 4.0 * pi)
    assert time == pytest.approx(4.0 * pi, rel=1e-9)


# --- damping --------------------------------------------------------------------------------------

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


# --- leakage --------------------------------------------------------------------------------------


def lumps(K: float, torque: float, J: float, Z10: float) -> tuple[float, float]:
    return static_leakage(K, torque), accelerating_leakage(K, J, Z10)


def test_the_lumps() -> None:
    # 1e-6 rad/(s N m), 30 kN m, 5000 kg m², 12 1/s
    assert lumps(1e-6, 3e4, 5e3, 12.0) == pytest.approx((0.03, 0.06))


@given(st.floats(-1.0, 1.0), st.floats(-2.0, 2.0), st.floats(-5e4, 5e4))
def test_the_leakage_goes_with_the_torque(tangent: float, rate: float, torque: float) -> None:
    K, J, Z10 = 1e-6, 5e3, 12.0
    Z11, Z12 = lumps(K, torque, J, Z10)
    lost = Z11 + load_leakage(tangent, rate, Z12)
    assert lost == pytest.approx(K * stiff_line_torque(tangent, rate, torque, J, Z10), abs=1e-15)
    expected = K * (torque + J * Z10 * cos(atan(tangent)) * rate)
    assert lost == pytest.approx(expected, rel=1e-12, abs=1e-15)


# --- line -----------------------------------------------------------------------------------------

K, LEAK, J, LOAD = 1e6, 1e-6, 5e3, 3e4
H = 1.0 / 512.0
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
