import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swashplate.campaign.rig.plant_effects import (
    leaked_speed,
    play,
    remembered_current,
    rippled_position,
    rippled_speed,
)

H = 1.0 / 512.0


def test_behind_a_step_the_excess_decays_with_the_memory() -> None:
    """m = (T/h)(1 − exp(−h/T)) exp(−(t − h)/T) behind a rise of 1 A within one sample."""
    current = np.where(np.arange(2000) >= 100, 1.0, 0.0)
    moved = remembered_current(current, H, 0.1, 0.5)
    since = np.arange(1900) * H
    first = 0.5 / H * (1.0 - np.exp(-H / 0.5))
    np.testing.assert_array_equal(moved[:100], 0.0)
    np.testing.assert_allclose(moved[100:], 1.0 + 0.1 * first * np.exp(-since / 0.5), rtol=1e-12)


def test_behind_a_ramp_the_excess_is_its_slope_times_the_memory() -> None:
    """m → T i′: 0.5 s · 0.2 A/s · 0.1 = 10 mA."""
    time = np.arange(5120) * H
    moved = remembered_current(0.2 * time, H, 0.1, 0.5)
    assert moved[0] == 0.0
    assert moved[-1] - 0.2 * time[-1] == pytest.approx(0.01, rel=1e-7)


def test_a_current_that_stands_is_left_alone() -> None:
    np.testing.assert_array_equal(remembered_current(np.full(9, 0.4), H, 0.2, 0.5), 0.4)


def test_a_load_is_raised_slower_and_lowered_faster_and_held_at_rest() -> None:
    speed = np.array([3.0, 1.0, 0.5, 0.0, -0.5, -1.0, -3.0])
    expected = [2.8, 0.8, 0.4, 0.0, -0.6, -1.2, -3.2]
    np.testing.assert_allclose(leaked_speed(speed, 0.2, 1.0), expected, rtol=1e-15)


def test_at_a_constant_flow_the_speed_has_the_cycles_of_the_cam() -> None:
    """Ω₀/(1 ± a) at the extremes, 5.5 cycles in a turn, Ω₀ on average."""
    speed, amplitude = 2.0, 0.2
    # two turns, 11 cycles
    flow = np.linspace(0.0, 4.0 * np.pi, 11 * 400 + 1)
    angle = rippled_position(flow, 5.5, amplitude)
    turning = rippled_speed(np.full(flow.size, speed), angle, 5.5, amplitude)
    assert turning.max() == pytest.approx(2.0 / 0.8, rel=1e-4)
    assert turning.min() == pytest.approx(2.0 / 1.2, rel=1e-4)
    np.testing.assert_allclose(angle[::400], flow[::400], atol=1e-12)
    np.testing.assert_allclose(turning[:-400], turning[400:], rtol=1e-12)
    # the speed is the derivative of the angle by the time that the flow takes
    time = flow / speed
    middle = np.diff(angle) / np.diff(time)
    np.testing.assert_allclose(middle, 0.5 * (turning[1:] + turning[:-1]), rtol=1e-4)


@given(st.floats(0.0, 0.5), st.floats(1.0, 20.0))
def test_the_oil_that_is_delivered_is_what_the_motor_takes(amplitude: float, cycles: float) -> None:
    flow = np.linspace(-10.0, 10.0, 501)
    angle = rippled_position(flow, cycles, amplitude)
    taken = angle + amplitude / cycles * (1.0 - np.cos(cycles * angle))
    np.testing.assert_allclose(taken, flow, atol=1e-12)


def test_play_by_hand() -> None:
    """A gap of 2: 1 is lost at first from its middle, 2 at each reversal."""
    drives = np.array([0.0, 0.5, 1.0, 2.0, 4.0, 3.0, 2.0, 1.0, -1.0, -1.0, 0.0, 1.5, 3.0])
    driven = np.array([0.0, 0.0, 0.0, 1.0, 3.0, 3.0, 3.0, 2.0, 0.0, 0.0, 0.0, 0.5, 2.0])
    np.testing.assert_array_equal(play(drives, 2.0), driven)
    np.testing.assert_array_equal(play(-drives, 2.0), -driven)


def test_the_play_operator_sample_by_sample() -> None:
    drives = np.cumsum(np.random.default_rng(0).normal(size=3000))
    behind, expected = drives[0], []
    for position in drives:
        behind = max(position - 0.75, min(position + 0.75, behind))
        expected.append(behind)
    np.testing.assert_array_equal(play(drives, 1.5), expected)


def test_play_of_one_sample_and_of_none() -> None:
    np.testing.assert_array_equal(play(np.array([3.0]), 1.0), [3.0])
    drives = np.array([0.0, 1.0, 0.5])
    np.testing.assert_array_equal(play(drives, 0.0), drives)
