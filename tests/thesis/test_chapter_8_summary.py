"""The whole chain (eqs. 8.1-8.13), marched in plain Python from chapter 8 with its errata."""

from itertools import pairwise
from math import asin, atan, cos, exp, floor, sin, sqrt, tan

import numpy as np
import pytest

from swashplate import Drive, maneuvers

H = 1.0 / 512.0


def channel(command: np.ndarray, p: dict[str, float], side: str) -> list[float]:
    """One channel of the card, eqs. 8.1 to 8.6: magnitudes, the limits on the output."""
    n = {key: p[f"{key}_{side}"] for key in (
        "V_dz", "J", "G1", "G2", "G3", "zeta", "omega", "C", "lim1", "lim2", "I_t1", "I_t2", "a"
    )}  # fmt: skip
    late = p["tau"] / H

    def volts(at: float) -> float:
        """Command `at` samples from the start, on straight lines, none before."""
        low = floor(at)
        here = command[low] if low >= 0 else 0.0
        there = command[low + 1] if 0 <= low + 1 < command.size else here
        return here + (at - low) * (there - here)

    def share(at: float) -> float:
        """Share of the sample around `at` in which the command exceeds the dead zone."""
        kinks = [at - 0.5, *(k for k in (floor(at), floor(at) + 1) if abs(k - at) < 0.5), at + 0.5]
        cuts = list(kinks)
        for low, high in pairwise(kinks):
            rise = volts(high) - volts(low)
            if rise != 0.0:
                cuts.append(
                    low + min(max((n["V_dz"] - volts(low)) / rise, 0.0), 1.0) * (high - low)
                )
        above = [
            high - low
            for low, high in pairwise(sorted(cuts))
            if volts(0.5 * (low + high)) > n["V_dz"]
        ]
        return sum(above)

    output, filtered, before = 0.0, 0.0, 0.0
    currents = []
    for i in range(command.size):
        delayed = volts(i - late)
        d = max(delayed - n["V_dz"], 0.0)
        settled = n["J"] * share(i - late) + n["G1"] * d + n["G2"] * d**2 + n["G3"] * d**3
        if filtered >= output:
            if filtered > n["I_t1"]:
                output = min(filtered, max(output, n["I_t1"]) + n["lim1"] * H)
            else:
                output = filtered
        elif output > n["I_t2"]:
            output = max(filtered, output - n["lim2"] * H, 0.0)
        else:
            left = output * exp(-n["a"] * H)
            output = left if settled == 0.0 else max(filtered, left)
        currents.append(output)
        change = filtered - before
        sign = min(max(change / (0.01 * H), -1.0), 1.0)
        w = n["omega"] * H
        following = 2 * (1 - n["zeta"] * w) * filtered + (2 * n["zeta"] * w - w**2 - 1) * before
        following += w**2 * settled - n["C"] * H**2 * sign
        before, filtered = filtered, following
    return currents


def pump(current: np.ndarray, p: dict[str, float], clamp: float = 1.0) -> np.ndarray:
    """Pump and motor, eqs. 8.7 to 8.13: the pressure by Runge-Kutta, the opening held.

    `clamp` is the share of the stop's pressure at which the relief valve holds it.
    """
    lower, upper = (clamp * tan(stop) / p["Z1"] for stop in (-p["Z13_minus"], p["Z13_plus"]))
    lower, upper = max(lower, -p["Z15"]), min(upper, p["Z15"])
    pressure, speeds = 0.0, []
    for i in current:
        alpha = min(max(atan(p["Z1"] * pressure), -p["Z13_minus"]), p["Z13_plus"])
        speeds.append(p["Z10"] * alpha)
        side = "plus" if i > 0 else "minus"
        e = float(np.sign(i)) * max(abs(i) - p["Z17"], 0.0)
        force = sum(p[f"Z{18 + n}_{side}"] * e**n for n in (1, 2, 3, 4))
        arm = asin(p["Z3"] * tan(alpha))
        square = (p["Z5"] * force) ** 2
        top = -p["Z5"] * p["Z4"] * sin(arm) * cos(arm) + p["Z5"] ** 2 * force * sqrt(
            p["Z4"] - square
        )
        x = top / (p["Z4"] * cos(arm) ** 2 - square) + p["Z18"]
        x = min(max(x, -p["Z14"]), p["Z14"])
        x = min(max(x, -p["Z16_minus"]), p["Z16_plus"])
        motion = 0.0 if not lower < pressure < upper else p["Z6"]

        def rate(at: float, x: float = x, motion: float = motion) -> float:
            return p["Z8"] / (1 + motion) * sqrt((p["Z9"] - at) / 2) * x

        k1 = rate(pressure)
        k2 = rate(pressure + H / 2 * k1)
        k3 = rate(pressure + H / 2 * k2)
        k4 = rate(pressure + H * k3)
        pressure += H / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        pressure = min(max(pressure, lower), upper)
    return np.array(speeds)


@pytest.mark.parametrize(
    ("name", "test"),
    [
        ("hoist", "step +9 V"),
        ("hoist", "step -6.5 V"),
        ("slew", "step +2 V"),
        ("luff", "step +4 V"),
    ],
)
def test_eq_3_1_to_3_9_and_8_1_to_8_13_in_plain_python(name: str, test: str) -> None:
    """Voltage to speed, to the rounding."""
    drive = Drive.preset(name)
    voltage = maneuvers.source_tests(name)[test].sample(512.0)
    p = drive.parameters.numbers
    run = drive.simulate(voltage)
    plus, minus = channel(voltage, p, "plus"), channel(-voltage, p, "minus")
    np.testing.assert_allclose(run.current_positive, plus, rtol=0, atol=1e-12)
    np.testing.assert_allclose(run.current_negative, minus, rtol=0, atol=1e-12)
    speed = pump(run.current, p)
    np.testing.assert_allclose(run.shaft_speed, speed, atol=1e-9 * np.abs(speed).max())


@pytest.mark.parametrize("name", ["hoist", "slew", "luff"])
def test_eq_8_7_to_8_13_under_a_sine(name: str) -> None:
    drive = Drive.preset(name)
    current = 0.7 * np.sin(2 * np.pi * 0.2 * np.arange(5120) * H)
    speed = pump(current, drive.parameters.numbers)
    found = drive.simulate_current(current).shaft_speed
    np.testing.assert_allclose(found, speed, atol=1e-9 * np.abs(speed).max())


@pytest.mark.parametrize("test", ["sine 9 V 0.1 Hz", "step -9 V"])
def test_erratum_31_what_the_published_routine_does_otherwise(hoist: Drive, test: str) -> None:
    """Its clamp at 0.999 of the stop's pressure costs 0.19 deg/s; its look ahead, a sample.

    The opening that it holds through a Runge-Kutta step is no difference: so does the exact step.
    """
    run = hoist.simulate(maneuvers.source_tests("hoist")[test].sample(512.0))
    p = hoist.parameters.numbers
    clamped = pump(run.current, p, clamp=0.999) - run.shaft_speed
    assert 0.15 < np.rad2deg(np.abs(clamped).max()) < 0.19
    ahead = pump(np.append(run.current[1:], 0.0), p)
    assert np.rad2deg(np.abs(ahead - run.shaft_speed).max()) > 0.25
    assert np.rad2deg(np.abs(ahead[:-1] - run.shaft_speed[1:]).max()) < 0.05


def test_erratum_15_eq_8_11_limits_the_opening_by_itself(hoist: Drive) -> None:
    """Printed with conditions on α: a small angle would leave a wide open spool unlimited."""
    run = hoist.simulate_current(np.full(3, 0.7))
    assert abs(run.swash_angle[1]) < 0.05
    assert run.spool_position[1] > 1e-3
    assert run.orifice_opening[1] == hoist["Z16"].value.plus
