"""Card, pump, shaft and cylinder in continuous time, marched by fourth-order Runge-Kutta steps.

Numbers in parentheses are equations of Kruse (2001). Everything is SI; currents of a channel are
magnitudes, and the signed current is the positive channel's less the negative one's.

Steps end at the instants at which the delayed command changes, so it is constant within each, and
the jump of the card's steady state happens at its instant. What switches on a state (limiter, dead
zones, stops) is resolved within a step only where first order would show: see `limited`.
"""

from math import asin, atan, exp, floor, pi, sin, sqrt, tan
from typing import NamedTuple

import numpy as np
from numba import njit

LONGEST_STEP = 1.0 / (16 * 512)
"""Longest step of a march. [s] With the fastest shaft, 40 Hz, 0.03 of its angular period."""


class Channel(NamedTuple):
    """One solenoid's half of the control card."""

    V_dz: float  # dead zone [V]
    J: float  # jump at its end [A]
    G1: float  # [A/V]
    G2: float  # [A/V²]
    G3: float  # [A/V³]
    zeta: float  # of the filter's differential equation [1]
    omega: float  # [rad/s]
    C: float  # Coulomb-like term [A/s²]
    lim1: float  # rate limit away from zero [A/s]
    lim2: float  # rate limit towards zero [A/s]
    I_t1: float  # current above which lim1 acts [A]
    I_t2: float  # current above which lim2 acts, below which the decay does [A]
    a: float  # rate of the decay [1/s]


class Pump(NamedTuple):
    """Pump, its displacement control, and motor. Of pairs, _p is the positive direction's."""

    Z1: float
    Z2: float
    Z3: float
    Z4: float
    Z5: float
    Z6: float
    Z7: float
    Z8: float
    Z9: float
    Z10: float
    Z11: float
    Z13_p: float
    Z13_m: float
    Z14: float
    Z15: float
    Z16_p: float
    Z16_m: float
    Z17: float
    Z18: float
    Z19_p: float
    Z19_m: float
    Z20_p: float
    Z20_m: float
    Z21_p: float
    Z21_m: float
    Z22_p: float
    Z22_m: float


class Condition(NamedTuple):
    """What a run adds to the pump: oil, charge pressure, what is left of friction, the shaft."""

    orifice: float  # factor on Z8 [1]
    speed: float  # factor on Z10 [1]
    level: float  # charge pressure's deviation in this run, share of Z9 [1]
    ripple: float  # amplitude of the charge pump's ripple, share of Z9 [1]
    ripple_frequency: float  # [Hz]
    ripple_phase: float  # [rad]
    hunting: float  # amplitude of the relief valve's hunting, share of Z9 [1]
    hunting_frequency: float  # [Hz]
    hunting_phase: float  # [rad]
    droop: float  # share of Z9 lost at full opening [1]
    hysteresis: float  # full width, of the current [A]
    shaft_frequency: float  # [Hz]; 0 for a rigid shaft
    shaft_damping: float  # [1]
    leakage: float  # speed that the motor loses to leakage under a load that resists it [rad/s]


class Cylinder(NamedTuple):
    """The user-defined model's truth: a cylinder behind a proportional valve."""

    lag: float  # of the valve's spool [s]
    d_plus: float  # overlap [V]
    d_minus: float
    K_plus: float  # speed a volt beyond the overlap [m/(V s)]
    K_minus: float
    omega: float  # mass on the oil's spring [rad/s]
    zeta: float  # [1]


def continuous_filter(zeta, omega, step=1.0 / 512.0):
    """ζ and ω [rad/s] of the differential equation that samples of Kruse's recursion follow.

    The recursion (3.6) is I[n+1] = 2(1 - ζωh) I[n] + (2ζωh - ω²h² - 1) I[n-1] + ω²h² I_ss. With
    I[n] = zⁿ and z = 1 + hλ its characteristic polynomial is h²(λ² + 2ζωλ + ω²): explicit Euler of
    the filter's equation. So each root λ_d of that equation with the printed numbers makes samples
    (1 + hλ_d)ⁿ, which are those of exp(λ_c t) with

        λ_c = log(1 + h λ_d) / h.

    Of the two roots λ_c (a conjugate or a real pair) ω_c² is the product and -2ζ_cω_c the sum.
    """
    roots = np.roots([1.0, 2.0 * zeta * omega, omega**2]).astype(complex)
    moved = np.log1p(step * roots) / step
    converted = sqrt(np.prod(moved).real)
    return -np.sum(moved).real / (2.0 * converted), converted


@njit(cache=True)
def steady_current(v, c):
    """(3.3): current at a constant command, of its magnitude in this channel's direction. [A]"""
    d = v - c.V_dz
    if d <= 0.0:
        return 0.0
    return c.J + d * (c.G1 + d * (c.G2 + d * c.G3))


@njit(cache=True)
def filter_acceleration(level, rate, target, sign, c):
    """(3.7) with erratum 3: İ* by time. [A/s²] The sign is that of İ*, given by the caller."""
    return c.omega**2 * (target - level) - 2.0 * c.zeta * c.omega * rate - c.C * sign


@njit(cache=True)
def smooth_step(level, rate, target, sign, h, c):
    """I* [A] and its rate [A/s] a step later, in which İ* keeps its sign."""
    a1 = filter_acceleration(level, rate, target, sign, c)
    r2 = rate + 0.5 * h * a1
    a2 = filter_acceleration(level + 0.5 * h * rate, r2, target, sign, c)
    r3 = rate + 0.5 * h * a2
    a3 = filter_acceleration(level + 0.5 * h * r2, r3, target, sign, c)
    r4 = rate + h * a3
    a4 = filter_acceleration(level + h * r3, r4, target, sign, c)
    after = level + h / 6.0 * (rate + 2.0 * r2 + 2.0 * r3 + r4)
    return after, rate + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)


@njit(cache=True)
def direction_of_motion(level, rate, target, c):
    """Sign of İ* from here on; 0 where the Coulomb term holds I*."""
    if rate != 0.0:
        return 1.0 if rate > 0.0 else -1.0
    pull = c.omega**2 * (target - level)
    if abs(pull) <= c.C:
        return 0.0
    return 1.0 if pull > 0.0 else -1.0


@njit(cache=True)
def filter_step(level, rate, target, h, c):
    """I* [A] and its rate [A/s] a step later.

    The Coulomb term is C sign(İ*), and whatever holds I* still where C is enough for that. So a
    step in which İ* passes zero is made in two: up to there, found by regula falsi, and on.
    """
    left = h
    for _ in range(4):  # İ* passes zero once in a step, in rounding once more
        sign = direction_of_motion(level, rate, target, c)
        if sign == 0.0:
            return level, 0.0
        after, moving = smooth_step(level, rate, target, sign, left, c)
        if c.C == 0.0 or sign * moving >= 0.0:
            return after, moving
        low, high = 0.0, left
        low_rate, high_rate = rate, moving
        if low_rate == 0.0:
            return level, 0.0
        for _ in range(30):
            part = low - low_rate * (high - low) / (high_rate - low_rate)
            after, moving = smooth_step(level, rate, target, sign, part, c)
            if abs(moving) < 1e-12:
                break
            if sign * moving > 0.0:
                low, low_rate = part, moving
            else:
                high, high_rate = part, moving
        level, rate = after, 0.0
        left -= part
        if left <= 0.0:
            return level, rate
    return level, rate


@njit(cache=True)
def limited(before, start, end, h, c):
    """Output of the limiter (3.8, 3.9, erratum 2) a step later. [A]

    The output follows I*, upwards above I_t1 at most with lim1, downwards above I_t2 at most with
    lim2 and below it at most with the decay. It is the largest (or smallest) curve of those slopes
    on its side of I*, so that a step is exact but for I* between its ends, O(h²), if the instants
    at which the thresholds are passed are.

    Parameters
    ----------
    before : float
        Output at the step's start. [A]
    start, end : float
        I* at the step's ends. [A]
    """
    if end >= before:
        if end <= c.I_t1:
            return end
        if before >= c.I_t1:
            return min(end, before + c.lim1 * h)
        left = h
        if start < c.I_t1:
            left = h * (end - c.I_t1) / (end - start)
        return min(end, c.I_t1 + c.lim1 * left)
    if before > c.I_t2:
        passed = (before - c.I_t2) / c.lim2
        if passed >= h:
            return max(end, before - c.lim2 * h)
        return max(end, c.I_t2 * exp(-c.a * (h - passed)))
    return max(end, before * exp(-c.a * h))


@njit(cache=True)
def solenoid_force(i, p):
    """(6.61, erratum 1): net force of the solenoids at a signed current. [N]"""
    if i >= 0.0:
        e = max(i - p.Z17, 0.0)
        return e * (p.Z19_p + e * (p.Z20_p + e * (p.Z21_p + e * p.Z22_p)))
    e = min(i + p.Z17, 0.0)
    return e * (p.Z19_m + e * (p.Z20_m + e * (p.Z21_m + e * p.Z22_m)))


@njit(cache=True)
def swash_angle(pressure, p):
    """(6.55): angle of the swash plate, within its stops. [rad]"""
    return min(max(atan(p.Z1 * pressure - p.Z2), -p.Z13_m), p.Z13_p)


@njit(cache=True)
def spool_opening(i, angle, p):
    """(6.57, 6.59): opening of the stroking orifices. [m]"""
    phi = asin(p.Z5 * solenoid_force(i, p) / sqrt(p.Z4))
    alpha = asin(p.Z3 * tan(angle))
    x = p.Z5 * tan(phi - alpha) + p.Z18
    x = min(max(x, -p.Z14), p.Z14)
    return min(max(x, -p.Z16_m), p.Z16_p)


@njit(cache=True)
def pressure_rate(t, pressure, i, p, run):
    """(6.67): rate of the stroking pressure. [Pa/s]

    Away from the stops, where the relief valve holds it; the published form of the root.
    """
    x = spool_opening(i, swash_angle(pressure, p), p)
    widest = p.Z16_p if x >= 0.0 else p.Z16_m
    charge = (
        1.0
        + run.level
        + run.ripple * sin(2.0 * pi * run.ripple_frequency * t + run.ripple_phase)
        + run.hunting * sin(2.0 * pi * run.hunting_frequency * t + run.hunting_phase)
    ) * (1.0 - run.droop * abs(x) / widest)
    drop = max(0.5 * (p.Z9 * charge - pressure), 0.0)
    return (p.Z8 * run.orifice * sqrt(drop) * x - p.Z7 * pressure) / (1.0 + p.Z6)


@njit(cache=True)
def motor_speed(pressure, p, run):
    """(6.69): speed of the motor, at the drum, less what leaks under its load. [rad/s]

    A load that resists motion in both directions holds the motor until the pump gives more than
    leaks.
    """
    speed = p.Z10 * run.speed * swash_angle(pressure, p) - p.Z11
    if speed > 0.0:
        return max(speed - run.leakage, 0.0)
    return min(speed + run.leakage, 0.0)


@njit(cache=True)
def rates(t, state, i, p, run):
    """By time: stroking pressure, motor's angle, drum's angle, drum's speed."""
    pressure, motor, drum, speed = state
    drive = motor_speed(pressure, p, run)
    dp = pressure_rate(t, pressure, i, p, run)
    if run.shaft_frequency == 0.0:
        return dp, drive, drive, 0.0
    w = 2.0 * pi * run.shaft_frequency
    torque = w * w * (motor - drum) + 2.0 * run.shaft_damping * w * (drive - speed)
    return dp, drive, speed, torque


@njit(cache=True)
def moved(state, h, slope):
    """A state moved along a slope."""
    return (
        state[0] + h * slope[0],
        state[1] + h * slope[1],
        state[2] + h * slope[2],
        state[3] + h * slope[3],
    )


@njit(cache=True)
def pump_step(t, state, currents, h, p, run):
    """State of pump and shaft a step later; `currents` at its start, middle and end. [A]"""
    s1 = rates(t, state, currents[0], p, run)
    s2 = rates(t + 0.5 * h, moved(state, 0.5 * h, s1), currents[1], p, run)
    s3 = rates(t + 0.5 * h, moved(state, 0.5 * h, s2), currents[1], p, run)
    s4 = rates(t + h, moved(state, h, s3), currents[2], p, run)
    after = moved(moved(state, h / 6.0, s1), h / 3.0, s2)
    after = moved(moved(after, h / 3.0, s3), h / 6.0, s4)
    low = max((-tan(p.Z13_m) + p.Z2) / p.Z1, -p.Z15)
    high = min((tan(p.Z13_p) + p.Z2) / p.Z1, p.Z15)
    return (min(max(after[0], low), high), after[1], after[2], after[3])


@njit(cache=True)
def follow(value, play, width):
    """Output of a play of full width `width`, whose input is `value` and output was `play`."""
    return min(max(play, value - 0.5 * width), value + 0.5 * width)


@njit(cache=True)
def steps_between(start, stop):
    """Number of equal steps from an instant to another. [s]"""
    return floor((stop - start) / LONGEST_STEP) + 1


@njit(cache=True)
def count_steps(edges):
    """Steps of a march whose delayed command changes at `edges`."""
    steps = 0
    for k in range(edges.size - 1):
        steps += steps_between(edges[k], edges[k + 1])
    return steps


@njit(cache=True)
def march_drive(edges, volts, plus, minus, p, run):
    """March card, pump and shaft from rest.

    Parameters
    ----------
    edges : (m + 1,) array
        Instants between which the delayed command is constant. [s]
    volts : (m,) array
        The command between them. [V]
    plus, minus : Channel
    p : Pump
    run : Condition

    Returns
    -------
    (steps + 1, 6) array
        Time [s], currents of both channels [A], stroking pressure [Pa], angle [rad] and speed
        [rad/s] of the drum.
    """
    rows = np.empty((count_steps(edges) + 1, 6))
    level_p, rate_p, out_p = 0.0, 0.0, 0.0
    level_m, rate_m, out_m = 0.0, 0.0, 0.0
    state = (p.Z2 / p.Z1, 0.0, 0.0, motor_speed(p.Z2 / p.Z1, p, run))
    play = 0.0
    rows[0] = (edges[0], 0.0, 0.0, state[0], state[2], state[3])
    row = 0
    for k in range(edges.size - 1):
        target_p = steady_current(volts[k], plus)
        target_m = steady_current(-volts[k], minus)
        steps = steps_between(edges[k], edges[k + 1])
        h = (edges[k + 1] - edges[k]) / steps
        for n in range(steps):
            t = edges[k] + n * h
            end_p, end_rate_p = filter_step(level_p, rate_p, target_p, h, plus)
            end_m, end_rate_m = filter_step(level_m, rate_m, target_m, h, minus)
            # cubic between the step's ends
            mid_p = 0.5 * (level_p + end_p) + 0.125 * h * (rate_p - end_rate_p)
            mid_m = 0.5 * (level_m + end_m) + 0.125 * h * (rate_m - end_rate_m)
            half_p = limited(out_p, level_p, mid_p, 0.5 * h, plus)
            half_m = limited(out_m, level_m, mid_m, 0.5 * h, minus)
            out_p = limited(half_p, mid_p, end_p, 0.5 * h, plus)
            out_m = limited(half_m, mid_m, end_m, 0.5 * h, minus)
            middle = follow(half_p - half_m, play, run.hysteresis)
            after = follow(out_p - out_m, middle, run.hysteresis)
            state = pump_step(t, state, (play, middle, after), h, p, run)
            play = after
            level_p, rate_p = end_p, end_rate_p
            level_m, rate_m = end_m, end_rate_m
            row += 1
            speed = state[3]
            if run.shaft_frequency == 0.0:
                speed = motor_speed(state[0], p, run)
            rows[row] = (t + h, out_p, out_m, state[0], state[2], speed)
    return rows


@njit(cache=True)
def cylinder_rates(state, volt, c, gain):
    """By time: opening of the valve [V], position, speed and acceleration of the rod."""
    opening, _, speed, acceleration = state
    flow = c.K_plus * max(opening - c.d_plus, 0.0) - c.K_minus * max(-opening - c.d_minus, 0.0)
    jerk = c.omega**2 * (gain * flow - speed) - 2.0 * c.zeta * c.omega * acceleration
    return (volt - opening) / c.lag, speed, acceleration, jerk


@njit(cache=True)
def march_cylinder(edges, volts, c, gain):
    """March the cylinder from rest.

    Returns
    -------
    (steps + 1, 4) array
        Time [s], opening of the valve [V], position [m] and speed [m/s] of the rod.
    """
    rows = np.empty((count_steps(edges) + 1, 4))
    state = (0.0, 0.0, 0.0, 0.0)
    rows[0] = (edges[0], 0.0, 0.0, 0.0)
    row = 0
    for k in range(edges.size - 1):
        steps = steps_between(edges[k], edges[k + 1])
        h = (edges[k + 1] - edges[k]) / steps
        for n in range(steps):
            s1 = cylinder_rates(state, volts[k], c, gain)
            s2 = cylinder_rates(moved(state, 0.5 * h, s1), volts[k], c, gain)
            s3 = cylinder_rates(moved(state, 0.5 * h, s2), volts[k], c, gain)
            s4 = cylinder_rates(moved(state, h, s3), volts[k], c, gain)
            state = moved(moved(state, h / 6.0, s1), h / 3.0, s2)
            state = moved(moved(state, h / 3.0, s3), h / 6.0, s4)
            row += 1
            rows[row] = (edges[k] + (n + 1) * h, state[0], state[1], state[2])
    return rows


def settled_speed(i, p):
    """Section 9: speed at a constant current, with no opening or the plate at its stop. [rad/s]"""
    phi = asin(p.Z5 * solenoid_force(i, p) / sqrt(p.Z4))
    angle = atan(sin(phi + atan(p.Z18 / p.Z5)) / p.Z3)
    return p.Z10 * min(max(angle, -p.Z13_m), p.Z13_p) - p.Z11
