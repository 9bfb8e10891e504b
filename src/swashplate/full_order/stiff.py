"""The referee: SciPy's stiff solver on the rates of the five states, restarted at every event.

It shares the rates with the march of `swashplate.models.full_order`, and nothing of its scheme. A
limit that holds is -1 or 1, one that does not is 0: the spool at its stroke, the relief valve open,
the swash plate at a stop. Stops are inelastic.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.cache import kernel
from swashplate.equations.equation import inlined
from swashplate.errors import DomainError
from swashplate.full_order.modes import N_STATES, state_matrix
from swashplate.models.full_order import (
    Motion,
    Plant,
    PlantConstants,
    PlantOptions,
    free_rates,
)
from swashplate.models.pump import solenoid_force

Array = NDArray[np.float64]
Holds = tuple[int, int, int]
"""Spool, relief valve, swash plate."""

LOOKS = 4
"""Points a sample at which a step is searched for an event."""
SHORT = -1e-12
"""Margin below which a limit has been reached or let go; a restart on a limit has none, but for
rounding. [1, rad]"""
GRAZING = -1e-7
"""The same after a limit has let go, until the state is clear of it: a step's interpolation is off
by more than rounding, and would find the limit that is being left again and again. [1, rad]"""
GRIP = 1e-12
"""Pressure, over the supply pressure, that is lost in rounding where a stop holds the plate."""
MOST_EVENTS = 10_000
TOLERANCES = (1e-9, 1e-7, 1.0, 1e-9, 1e-7)
"""Absolute: position [m], velocity [m/s], pressure [Pa], angle [rad], swash rate [rad/s]."""
LONG_SAMPLES, SHORT_SAMPLES = 4, 1
"""Longest step where the force is smooth, and where it is not, in samples."""
KINK = 1e-4
"""Change of the force's slope from one sample to the next that counts as none, times step. [N]"""
SHORTEST = 16
"""Samples below which a smooth stretch is not worth a restart of the solver."""


class Feed(NamedTuple):
    """The current over time."""

    current: Array
    """At the samples. [A]"""
    held: bool
    """Whether it keeps its value between them, in place of a straight line."""
    step: float
    """Distance of the samples. [s]"""


class Case(NamedTuple):
    """What is integrated."""

    p: Plant
    k: PlantConstants
    options: PlantOptions


# --- compiled ------------------------------------------------------------------------------------


@kernel
def force_at(time: float, feed: Feed, p: Plant) -> float:
    """Net solenoid force at any time of the record. [N]"""
    current = feed.current
    at = min(max(time / feed.step, 0.0), current.size - 1.0)
    n = max(min(int(at), current.size - 2), 0)
    rise = 0.0 if feed.held else at - n
    after = current[min(n + 1, current.size - 1)]
    return solenoid_force(current[n] + rise * (after - current[n]), p.solenoids)


@kernel
def rates_at(time: float, state: Array, feed: Feed, case: Case, holds: Holds) -> Array:
    """Rates of the five states; one that a limit holds has none."""
    force = force_at(time, feed, case.p)
    motion = Motion(state[0], state[1], state[2], state[3], state[4])
    v_rate, p_rate, r_rate = free_rates(motion, force, case.p.machine, case.options)
    rates = np.empty(5)
    rates[0] = state[1]
    rates[1] = 0.0 if holds[0] != 0 else v_rate
    rates[2] = 0.0 if holds[1] != 0 else p_rate
    rates[3] = state[4]
    rates[4] = 0.0 if holds[2] != 0 else r_rate
    return rates


@kernel
def margin_at(time: float, state: Array, feed: Feed, case: Case, holds: Holds) -> float:
    """How far a state is from its next event: negative beyond. [1]

    A free state must stay within its limits; a held one must still be pushed against its limit.
    """
    m, k = case.p.machine, case.k
    spool, relief, plate = holds
    least = np.inf
    if spool == 0:
        least = min(least, (m.spool_stroke - abs(state[0])) / m.spool_stroke)
    if relief == 0:
        least = min(least, (k.upper - state[2]) / m.supply_pressure)
        least = min(least, (state[2] - k.lower) / m.supply_pressure)
    if plate == 0:
        least = min(least, m.swash_stop_plus - state[3])
        least = min(least, state[3] + m.swash_stop_minus)
    if spool == 0 and relief == 0 and plate == 0:
        return least
    force = force_at(time, feed, case.p)
    motion = Motion(state[0], state[1], state[2], state[3], state[4])
    v_rate, p_rate, r_rate = free_rates(motion, force, m, case.options)
    if spool != 0:
        least = min(least, spool * v_rate)
    if relief != 0:
        least = min(least, relief * p_rate / m.bulk_modulus)
    if plate != 0:
        least = min(least, plate * r_rate + grip_of(case.p))
    return least


@inlined
def grip_of(p: Plant) -> float:
    """Inward acceleration that counts as none while the plate rests on a stop. [rad/s²]"""
    m = p.machine
    return GRIP * m.piston_area * m.swash_arm * m.supply_pressure / m.swash_inertia


@kernel
def first_short(
    times: Array, states: Array, least: float, feed: Feed, case: Case, holds: Holds
) -> int:
    """First of the states (m, 5) at times (m,) whose margin is below `least`, or -1."""
    for n in range(times.size):
        if margin_at(times[n], states[n], feed, case, holds) < least:
            return n
    return -1


@kernel
def settle(time: float, state: Array, feed: Feed, case: Case) -> Holds:
    """Which limits hold from here on; what arrives at one is set on it, in place, and stops."""
    m, k = case.p.machine, case.k
    spool, relief, plate = 0, 0, 0
    if abs(state[0]) >= m.spool_stroke and state[0] * state[1] >= 0.0:
        spool = 1 if state[0] > 0.0 else -1
        state[0], state[1] = spool * m.spool_stroke, 0.0
    if state[3] >= m.swash_stop_plus and state[4] >= 0.0:
        plate = 1
        state[3], state[4] = m.swash_stop_plus, 0.0
    elif state[3] <= -m.swash_stop_minus and state[4] <= 0.0:
        plate = -1
        state[3], state[4] = -m.swash_stop_minus, 0.0
    if state[2] >= k.upper:
        relief = 1
        state[2] = k.upper
    elif state[2] <= k.lower:
        relief = -1
        state[2] = k.lower
    force = force_at(time, feed, case.p)
    motion = Motion(state[0], state[1], state[2], state[3], state[4])
    v_rate, p_rate, r_rate = free_rates(motion, force, m, case.options)
    spool = spool if spool * v_rate >= 0.0 else 0
    relief = relief if relief * p_rate >= 0.0 else 0
    if plate != 0 and plate * r_rate < -grip_of(case.p):
        plate = 0
    return spool, relief, plate


@kernel
def force_along(feed: Feed, p: Plant) -> Array:
    """Net solenoid force at the samples. [N]"""
    force = np.empty(feed.current.size)
    for n in range(force.size):
        force[n] = solenoid_force(feed.current[n], p.solenoids)
    return force


# --- the solver's steps --------------------------------------------------------------------------


def solve(feed: Feed, case: Case, start: Motion, tolerance: float) -> Array:
    """Integrate the five states over a signed current.

    Parameters
    ----------
    feed, case :
        Current and machine.
    start : Motion
        At the first sample.
    tolerance : float
        Relative tolerance; the absolute ones are `TOLERANCES`, in proportion to it, given for 1e-6.

    Returns
    -------
    (n, 5) array
        The states at the samples.

    Raises
    ------
    DomainError
        If the solver gives up or a limit chatters, with the time.

    Notes
    -----
    It is Radau. BDF beyond second order is unstable along the imaginary axis, where the plate on
    its trapped oil swings, and took 25 times as long.
    """
    time = feed.step * np.arange(feed.current.size, dtype=np.float64)
    states, state = np.empty((time.size, N_STATES)), np.array(start)
    holds = settle(0.0, state, feed, case)
    states[0] = state
    now, done, events, least = 0.0, 1, 0, SHORT
    for end, longest in stretches(force_along(feed, case.p), feed) if time.size > 1 else []:
        solver = _solver(feed, case, holds, (now, time[end]), state, longest, tolerance)
        while done <= end:
            before = now
            message = solver.step()
            if solver.status == "failed":
                raise DomainError(f"The radau solver gives up at {now:.6g} s: {message}")
            now, state, between = solver.t, solver.y, solver.dense_output()
            looks = _looks(before, now, feed.step)
            seen = np.vstack([between(looks[:-1]).T, state])
            short = first_short(looks, seen, least, feed, case, holds)
            if short >= 0:
                span = (looks[short - 1] if short else before, looks[short])
                now = _first_beyond(span, between, least, feed, case, holds)
                state = np.array(between(now))
            while done < time.size and time[done] <= now:
                states[done] = between(time[done]) if time[done] < now else state
                done += 1
            if short < 0:
                if margin_at(now, state, feed, case, holds) > 0.0:
                    least = SHORT
                continue
            holds = settle(now, state, feed, case)
            least = SHORT if margin_at(now, state, feed, case, holds) > 0.0 else GRAZING
            if time[done - 1] == now:
                states[done - 1] = state
            events += 1
            if events > MOST_EVENTS:
                raise DomainError(f"The limits of the machine chatter at {now:.6g} s.")
            if done <= end:
                solver = _solver(feed, case, holds, (now, time[end]), state, longest, tolerance)
    return states


def _solver(
    feed: Feed,
    case: Case,
    holds: Holds,
    span: tuple[float, float],
    state: Array,
    longest: float,
    tolerance: float,
) -> Any:
    """SciPy's solver over a span of time."""
    from scipy.integrate import Radau

    def matrix(time: float, state: Array) -> Array:
        force = force_at(time, feed, case.p)
        made = state_matrix(state, force, case.p.machine, case.options)
        for hold, at in zip(holds, (1, 2, 4), strict=True):
            if hold != 0:
                made[at] = 0.0
        return made

    return Radau(
        lambda time, state: rates_at(time, state, feed, case, holds),
        span[0],
        state,
        span[1],
        jac=matrix,
        rtol=tolerance,
        atol=np.array(TOLERANCES) * (tolerance / 1e-6),
        max_step=longest,
    )


def stretches(force: Array, feed: Feed) -> list[tuple[int, float]]:
    """Divide a record into stretches with a smooth force and stretches without.

    A solver that steps over a short pulse of the force never sees it, however small its tolerance.

    Parameters
    ----------
    force : (n,) array
        Net solenoid force at the samples, n at least 2. [N]

    Returns
    -------
    list of (int, float)
        Last sample and longest step [s] of each, in order; the last one ends at the last sample.
    """
    kinks = np.diff(force) if feed.held else np.diff(force, 2)
    rough = np.zeros(force.size - 1, dtype=bool)  # intervals between samples
    places = np.flatnonzero(np.abs(kinks) > KINK) + (0 if feed.held else 1)
    for reach in range(-LONG_SAMPLES, LONG_SAMPLES):
        rough[np.clip(places + reach, 0, rough.size - 1)] = True
    found: list[tuple[int, float]] = []
    begin = 0
    for end in [*np.flatnonzero(np.diff(rough)) + 1, rough.size]:
        smooth = not rough[begin] and end - begin >= SHORTEST
        longest = feed.step * (LONG_SAMPLES if smooth else SHORT_SAMPLES)
        if found and found[-1][1] == longest:
            found.pop()
        found.append((int(end), longest))
        begin = end
    return found


def _looks(before: float, now: float, step: float) -> Array:
    """Times within a step at which it is searched for events, its end the last. [s]"""
    count = max(int(np.ceil((now - before) / step * LOOKS)), 1)
    looks = np.linspace(before, now, count + 1)[1:]
    looks[-1] = now
    return looks


def _first_beyond(
    span: tuple[float, float], between: Any, least: float, feed: Feed, case: Case, holds: Holds
) -> float:
    """The time just beyond an event, by bisection down to neighbours. [s]"""
    low, high = span
    while True:
        middle = 0.5 * (low + high)
        if not low < middle < high:
            return high
        if margin_at(middle, np.array(between(middle)), feed, case, holds) < least:
            high = middle
        else:
            low = middle
