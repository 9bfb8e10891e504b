"""The card's equations against what they stand for, worked out another way."""

from itertools import pairwise
from math import cos, cosh, exp, inf, log, sin, sinh, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from swashplate import Drive
from swashplate.machine import Window
from swashplate.models import amplifier
from swashplate.models.amplifier import CardChannel, Filter

Array = NDArray[np.float64]
RATES = (200.0, 512.0, 600.0, 1000.0, 2000.0)


# --- command to settled current ------------------------------------------------------------------


@pytest.mark.interpreted
def test_share_of_an_interval_above_the_dead_zone() -> None:
    # a ramp from 0 to 2 V over the two intervals; the last 0.5 V lie above 1.5 V
    assert amplifier.share_above(0.0, 2.0, 1.5) == 0.25
    assert amplifier.share_above(2.0, 0.0, 1.5) == 0.25
    assert amplifier.share_above(1.0, 1.0, 1.0) == 0.0
    assert amplifier.share_above(2.0, 3.0, 1.0) == 1.0
    # the interval ends 0.3 samples before the newest: it sees 1.3..2 of 0..1 and 1..2 of 1..2
    assert amplifier.jump_share(2.0, 1.0, 0.0, 0.3, 1.0) == pytest.approx(0.7)


# --- the filter's differential equation ----------------------------------------------------------


def marched(p: CardChannel, steady: Array, h: float) -> Array:
    """I* of the exact filter under an I_ss straight between samples, settled at the first."""
    state, found = Filter(float(steady[0]), 0.0, 0.0), []
    for begins, ends in pairwise([float(steady[0]), *map(float, steady)]):
        filtered, rate = amplifier.exact_filter(state, begins, ends, p, h)
        found.append(filtered)
        state = Filter(filtered, rate, 0.0)
    return np.array(found)


@pytest.mark.interpreted
@given(st.floats(0.01, 3.0), st.floats(1e-3, 20.0))
def test_the_waves_are_cosh_and_sinh(zeta: float, w: float) -> None:
    q, e = (zeta * zeta - 1.0) * w * w, exp(-zeta * w)
    r = sqrt(abs(q))
    even, odd = (cosh(r), sinh(r)) if q > 0.0 else (cos(r), sin(r))
    found = amplifier.damped_waves(zeta, w)
    expected = (e * even, e * odd / r if r > 0.0 else e)
    assert found == pytest.approx(expected, rel=1e-13, abs=1e-15)


@pytest.mark.interpreted
def test_nothing_happens_at_critical_damping() -> None:
    """Value and slope by ζ go through ζ = 1 as those of the power series, known there."""
    for w in (0.03, 0.3, 0.99, 1.0, 2.0):
        e, s = exp(-w), 1e-5
        assert amplifier.damped_waves(1.0, w) == pytest.approx((e, e), rel=1e-15)
        below, above = amplifier.damped_waves(1.0 - s, w), amplifier.damped_waves(1.0 + s, w)
        slopes = [(b - a) / (2.0 * s) for a, b in zip(below, above, strict=True)]
        # cosh r is 1 + r²/2 and sinh r/r is 1 + r²/6 there, with r² = (ζ² - 1) w²
        expected = (e * (w * w - w), e * (w * w / 3.0 - w))
        assert slopes == pytest.approx(expected, rel=1e-8, abs=1e-10)


@pytest.mark.parametrize("axis_side", ["hoist_plus", "slew_plus", "slew_minus"])
def test_it_converges_with_order_two(axis_side: str) -> None:
    """A command on the rise, solved by SciPy from the moment at which it overcomes C."""
    name, side = axis_side.split("_")
    numbers = Drive.preset(name).parameters.numbers
    p = CardChannel(*(numbers[f"{each}_{side}"] for each in CardChannel._fields))

    def command(t: Array | float) -> Array | float:
        return 0.5 * t**2 * (3.0 - 2.0 * t) + 0.05 * t

    begins = brentq(lambda t: p.omega**2 * command(t) - p.C, 0.0, 1.0) if p.C else 0.0
    truth = solve_ivp(
        lambda t, y: [y[1], p.omega**2 * (command(t) - y[0]) - 2 * p.zeta * p.omega * y[1] - p.C],
        (begins, 1.0),
        [0.0, 0.0],
        rtol=1e-11,
        atol=1e-13,
        dense_output=True,
    ).sol
    errors = []
    for rate in (200.0, 400.0, 800.0):
        time = np.arange(0.0, 1.0, 1.0 / rate)
        found = marched(p, np.asarray(command(time)), 1.0 / rate)
        moving = time > 0.3
        errors.append(np.abs(found - truth(time)[0])[moving].max())
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.02)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.02)


@pytest.mark.parametrize("zeta", [0.1, 1.0, 1.1014, 1.4157])
def test_it_is_stable_and_sticks_at_any_rate(zeta: float) -> None:
    """After a step it comes to rest within C/ω² of I_ss, and stays there exactly."""
    p = CardChannel(0.1, 0.1, 0.1, 0.0, 0.0, zeta, 98.377, 4.8368, inf, inf, inf, 0.0, inf)
    for rate in (50.0, *RATES):
        assert p.omega / rate < amplifier.step_limit(zeta, True)
        found = marched(p, np.r_[0.0, np.full(round(3.0 * rate), 0.5)], 1.0 / rate)
        assert abs(found[-1] - 0.5) <= p.C / p.omega**2 * (1.0 + 1e-9)
        assert found[-1] == pytest.approx(found[-5], abs=1e-15)
        assert np.abs(found).max() < 1.0


@pytest.mark.interpreted
def test_friction_takes_the_rate_and_stops_at_zero(channel: CardChannel) -> None:
    # a filter that nothing else moves: x = x_0 + v h - C h²/2, less where it stops before h
    p, h = channel._replace(zeta=1e-6, omega=1e-3, C=2.5), 0.2
    found = [amplifier.exact_filter(Filter(0.2, v, 0.0), 0.0, 0.0, p, h) for v in (0.8, -0.4)]
    assert found[0] == pytest.approx((0.31, 0.3))
    assert found[1] == pytest.approx((0.16, 0.0))


@pytest.mark.slow
@pytest.mark.interpreted
@given(st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3), st.floats(0.0, 1.0))
def test_the_course_over_a_step_keeps_integral_and_moment(samples: list[float], f: float) -> None:
    p = CardChannel(0.5, 0.3, 0.1, 0.0, 0.0, 1.0, 1.0, 0.0, inf, inf, inf, 0.0, inf)
    begins, ends = amplifier.steady_course(-1.0, Window(tuple(samples), f), p)
    # time in samples back from the newest; the step goes from f + 1 to f
    back = f + (np.arange(100_000) + 0.5) / 100_000
    command = -np.interp(back, [0.0, 1.0, 2.0], samples)
    steady = np.where(command > 0.5, 0.3 + 0.1 * (command - 0.5), 0.0)
    assert 0.5 * (begins + ends) == pytest.approx(steady.mean(), abs=1e-5)
    moment = (steady * (f + 0.5 - back)).mean()
    assert (ends - begins) / 12.0 == pytest.approx(moment, abs=1e-5)


# --- filter to output ----------------------------------------------------------------------------

LIMITS = {"lim1": 2.0, "lim2": 3.0, "I_t1": 0.3, "I_t2": 0.1, "a": -log(0.9) / 0.01}
"""The decay leaves 0.9 in a step of 0.01 s."""


@pytest.mark.interpreted
@pytest.mark.parametrize(
    ("target", "previous", "steady", "output", "limited"),
    [
        (0.25, 0.1, 0.5, 0.25, False),  # below I_t1 the filter passes
        (0.9, 0.5, 0.9, 0.52, True),  # above it lim1 counts, from the last output on
        (0.9, 0.1, 0.9, 0.32, True),  # or from I_t1, when a sample jumps over it
        (0.51, 0.5, 0.9, 0.51, False),  # slower than the limit
        (0.2, 0.5, 0.0, 0.47, True),  # towards zero lim2
        (0.49, 0.5, 0.4, 0.49, False),
        (-0.1, 0.08, 0.0, 0.072, False),  # gone below I_t2: decay, whatever the filter does
        (0.05, 0.08, 0.04, 0.072, False),  # still commanded: the higher of filter and decay
        (0.075, 0.08, 0.04, 0.075, False),
    ],
)
def test_limiter_branches(
    channel: CardChannel,
    target: float,
    previous: float,
    steady: float,
    output: float,
    limited: bool,
) -> None:
    p = channel._replace(**LIMITS)
    found = amplifier.limited_current(target, previous, steady, p, 0.01, None)
    assert found == pytest.approx(output)
    assert amplifier.rate_limit_active(output, target, previous, p.I_t2) is limited


@pytest.mark.interpreted
@pytest.mark.parametrize(
    ("target", "previous", "steady", "output"),
    [
        (0.0, 0.14, 0.0, 0.11),  # I_t2 is not reached
        (0.0, 0.12, 0.0, 0.1 * (0.9 + 2 / 3 * 0.1)),  # reached after two thirds of the step
        (0.095, 0.12, 0.0, 0.1 * (0.9 + 0.8 * 0.1)),  # after four fifths, led by the filter
        (0.097, 0.104, 0.5, 0.097),  # still commanded, and the filter is higher than the decay
        (-0.1, 0.1, 0.0, 0.09),  # reached already
        (0.9, 0.1, 0.9, 0.3 + 0.75 * 0.02),  # on the way up I_t1 is passed after a quarter
        (0.31, 0.1, 0.9, 0.3 + 0.02 / 21.0),  # shortly before the step's end
        (0.31, 0.295, 0.9, 0.31),  # the filter is slower than the limit
        (0.9, 0.5, 0.9, 0.52),  # passed already
    ],
)
def test_switches_from_within_a_step(
    channel: CardChannel, target: float, previous: float, steady: float, output: float
) -> None:
    p = channel._replace(**LIMITS)
    found = amplifier.limited_current(target, previous, steady, p, 0.01, True)
    assert found == pytest.approx(output)
