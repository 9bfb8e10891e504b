"""Encoders and filters (eqs. 7.1-7.7), what speed tells, and steady errors (eqs. 7.8-7.14)."""

import numpy as np
import pytest
from reproduction.speed_path import path_delay, simulated_speed, speed_of_angle

from swashplate import Drive, maneuvers
from swashplate.campaign import DIFFERENTIATOR, LOW_PASS, Encoder, speed_from_angle

H = 1.0 / 512.0
HOIST_TURN = 400.0 * 120.0 / 19.0


@pytest.mark.parametrize(
    ("axis", "counts_per_turn", "gear_ratio", "turn"),
    [
        ("slew", 81_000.0, 7.0, 567_000.0),
        ("luff as printed", 4 * 100.0, 120.0 / 19.0, 2526.3),
        ("hoist as printed", 4 * 635.0, 1.0, 2540.0),
    ],
)
def test_eq_7_2_to_7_4_counts_of_a_turn(
    axis: str, counts_per_turn: float, gear_ratio: float, turn: float
) -> None:
    angle = turn * Encoder(counts_per_turn, gear_ratio, 1, None).angle_per_count
    assert angle == pytest.approx(2.0 * np.pi, rel=2e-5), axis


def test_erratum_24_the_factor_2_pi_is_missing() -> None:
    """7.2 to 7.4 give turns per second; the model's speed, and the tables', are rad/s."""
    time = np.arange(2048) * H
    turns = 0.25 * time  # a quarter turn per second
    count = Encoder(HOIST_TURN, 1.0, 1, None).angle_per_count
    speed = speed_from_angle(time, count * turns * HOIST_TURN)
    assert speed[-1] == pytest.approx(2.0 * np.pi * 0.25, rel=1e-9)


def test_eq_7_5_and_erratum_30_slew_motor() -> None:
    """Turret to motor 3150.1: at the speed limit of 4.24 deg/s the motor would run at 2227 rpm."""
    turret = np.rad2deg(Drive.preset("slew").steady_speed(10.0))
    assert turret * 3150.1 / 6.0 == pytest.approx(2227.0, abs=1.5)


@pytest.mark.parametrize(("deg_s", "shared"), [(1.0, True), (50.0, True), (100.0, False)])
def test_erratum_25_eq_7_6_has_its_inequality_reversed(deg_s: float, shared: bool) -> None:
    """Samples share a count while h < 2π/(N ω); 7.6 prints h < N ω/(2π), which holds for all."""
    apart = Encoder(HOIST_TURN, 1.0, 1, None).angle_per_count / np.deg2rad(deg_s)
    counts = np.floor(H / apart * np.arange(5000) + 0.37)
    assert bool(np.any(np.diff(counts) == 0.0)) == shared == (apart > H)
    assert 1.0 / apart > H


def test_eq_7_7_cut_offs() -> None:
    assert pytest.approx((10.0, 30.0)) == (LOW_PASS / (2 * np.pi), DIFFERENTIATOR / (2 * np.pi))


def test_erratum_33_figures_7_3_and_7_4_have_the_same_low_passes() -> None:
    """a/(s + a) and b/(s + b): a slow ramp comes 1/a + 1/b late.

    In discrete form the measured path is half a sample earlier, the simulated one not unless it
    is driven by the mean of two samples.
    """
    late = 1.0 / (20.0 * np.pi) + 1.0 / (60.0 * np.pi)
    time = np.arange(4096) * H
    angle, speed = 50.0 * time**2, 100.0 * time
    paths = (
        (speed_from_angle(time, angle), pytest.approx(late, rel=2e-3)),  # but for terms in h²
        (speed_of_angle(angle, H), pytest.approx(late - 0.5 * H, rel=1e-9)),
        (simulated_speed(speed, H, aligned=False), pytest.approx(late, rel=1e-9)),
        (simulated_speed(speed, H), pytest.approx(path_delay(H), rel=1e-9)),
    )
    for found, expected in paths:
        assert time[-1] - found[-1] / 100.0 == expected


def test_figure_7_3_is_its_two_recursions() -> None:
    """As printed: w ← (1 - ah)·w + ah·u₋₁, then y ← (1 - bh)·y + b·(w - w₋₁)."""
    angle = np.random.default_rng(3).normal(size=1500).cumsum()
    a, b, low, speed = LOW_PASS, DIFFERENTIATOR, np.full(1500, angle[0]), np.zeros(1500)
    for n in range(1, 1500):
        low[n] = (1.0 - a * H) * low[n - 1] + a * H * angle[n - 1]
        speed[n] = (1.0 - b * H) * speed[n - 1] + b * (low[n] - low[n - 1])
    np.testing.assert_allclose(speed_of_angle(angle, H), speed, atol=1e-10)


def test_erratum_27_what_a_speed_below_its_limit_does_not_show() -> None:
    """Section 7.5 calls Z10 unobservable; the limit is Z10·Z13, and it is Z13 that never counts."""
    luff = Drive.preset("luff")
    voltage = maneuvers.source_tests("luff")["sine 4 V 0.1 Hz"].sample(512.0)
    found = luff.sensitivities(voltage, parameters=["Z10", "Z13"])
    by = dict(zip(found.names, np.abs(found["shaft_speed"]).max(axis=0), strict=True))
    assert by["Z13_plus"] == by["Z13_minus"] == 0.0
    assert by["Z10"] > 0.01
    hard = luff.simulate_current(np.repeat([1.0, -1.0], [5000, 9000])).shaft_speed
    limits = [luff["Z10"].value * each for each in luff["Z13"].values]
    assert (hard.max(), -hard.min()) == pytest.approx(limits, rel=1e-12)


@pytest.mark.parametrize(
    ("axis", "volts", "hertz"),
    [
        ("hoist", {4.0, 6.5, 9.0}, {0.1, 0.3}),
        ("slew", {4.0, 6.0}, {0.05, 0.1}),
        ("luff", {4.0, 6.5, 9.0}, {0.05, 0.1}),
    ],
)
def test_figures_7_5_to_7_27_list_the_tests(axis: str, volts: set, hertz: set) -> None:
    sines = [each.split() for each in maneuvers.source_tests(axis) if each.startswith("sine")]
    assert {float(each[1]) for each in sines} == volts
    assert {float(each[3]) for each in sines} == hertz


def test_eq_7_8_to_7_14_and_erratum_26_steady_error_of_two_lags() -> None:
    """Gains k/a and k_s/a_s: a step leaves their difference, a ramp of equal gains that of lags.

    7.11 is (k a_s - k_s a)/(a a_s), printed over a - a_s; 7.14 is (k - k_s)/(a a_s).
    """
    one = Drive.preset("neutral")
    linear = one.linearize(0.0)
    a, k = 1.0 / linear.time_constant, linear.gain / linear.time_constant
    time = np.arange(1024) * H
    for other, command, k_s, a_s in (
        (one.scale(Z10=0.8), 0.01 + 0.0 * time, 0.8 * k, a),
        (one.scale(Z8=0.5), 0.005 * time, 0.5 * k, 0.5 * a),
    ):
        steady, ramp = (k * a_s - k_s * a) / (a * a_s), (k - k_s) / (a * a_s)
        expected = command[-1] * steady + (command[-1] - command[-2]) / H * ramp * (steady == 0.0)
        ends = [drive.simulate(command).shaft_speed[-1] for drive in (one, other)]
        assert ends[0] - ends[1] == pytest.approx(expected, rel=0.01)
