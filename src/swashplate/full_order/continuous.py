"""The five states in continuous time: natural modes, and SciPy's stiff solver as the referee.

The referee restarts at every event. It shares the rates with the march of
`swashplate.models.full_order`, and nothing of its scheme. A limit that holds is -1 or 1, one that
does not is 0: the spool at its stroke, the relief valve open, the swash plate at a stop. Stops are
inelastic.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.cache import kernel
from swashplate.equations.code import generating
from swashplate.equations.derivatives import derive
from swashplate.equations.equation import inlined
from swashplate.equations.marching.run import module
from swashplate.errors import DomainError
from swashplate.models.displacement_control import solenoid_force
from swashplate.models.full_order import (
    Motion,
    Plant,
    PlantConstants,
    PlantOptions,
    Rates,
    free_rates,
)
from swashplate.models.machine import Machine
from swashplate.results import Result, short

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Holds = tuple[int, int, int]  # Spool, relief valve, swash plate.

N_STATES = len(Motion._fields)
LOOKS = 4  # Points a sample at which a step is searched for an event.
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
SHORTEST = 16  # Samples below which a smooth stretch is not worth a restart of the solver.


@generating
def slopes_of(options: PlantOptions) -> Callable[..., None]:
    """The compiled derivatives of the rates by the five states, as rows of a matrix."""
    made = derive(free_rates, by="state", options={"options": options})
    text = "\n\n".join(f"@inlined\n{each}" for each in made.texts.values())
    lines = [
        f"matrix[{(1, 2, 4)[row]}, {column}] = found[{len(made.outputs) + place}]"
        for place, (row, column) in enumerate(made.entries)
    ]
    text += "\n\n@kernel\ndef slopes(state, force, p, options, matrix):\n"
    text += f"    found = {made.name}(state, force, p, options)\n    "
    text += "\n    ".join(lines) + "\n"
    return module("full_order_slopes", text, made.names)["slopes"]  # type: ignore[no-any-return]


def state_matrix(state: Array, force: float, p: Machine, options: PlantOptions) -> Array:
    """(5, 5) derivatives of the rates of the five states by themselves, no limit holding."""
    matrix = np.zeros((N_STATES, N_STATES))
    slopes_of(options)(Motion(*state), force, p, options, matrix)
    matrix[0, 1] = matrix[3, 4] = 1.0
    return matrix


@dataclass(frozen=True)
class Modes(Result):
    """Eigenvalues of the linearised model, told apart by the states that take part in them."""

    eigenvalues: Complex
    """All five. [rad/s]"""
    slow: complex
    """The pole that the reduced model keeps, -1/τ. [rad/s]"""
    spool: complex
    """Spool on the feedback spring, the upper of a pair. [rad/s]"""
    swash: complex
    """Swash plate on its return spring and the oil trapped behind the closed valve. [rad/s]"""
    swash_at_held_pressure: complex
    """Swash plate on its return spring alone, the source's reckoning. [rad/s]"""

    @staticmethod
    def frequency_hz(mode: complex) -> float:
        """Undamped natural frequency. [Hz]"""
        return abs(mode) / (2.0 * np.pi)

    @staticmethod
    def damping_ratio(mode: complex) -> float:
        """Damping ratio. [1]"""
        return -mode.real / abs(mode)


def modes_of(matrix: Array) -> Modes:
    """Modes of a state matrix.

    The slow pole is the eigenvalue nearest zero. The spool's mode is the one in which position and
    velocity of the spool take the largest part, by the product of left and right eigenvectors.
    """
    values, right = np.linalg.eig(matrix)
    left = np.linalg.inv(right)
    parts = np.abs(left.T * right)  # (state, mode), free of the states' units
    slow = int(np.argmin(np.abs(values)))
    others = [k for k in range(N_STATES) if k != slow]
    by_spool = sorted(others, key=lambda k: -float(parts[:2, k].sum() / parts[:, k].sum()))
    held = np.linalg.eigvals(matrix[3:, 3:])
    return Modes(
        values.astype(np.complex128),
        complex(values[slow]),
        _upper(values[by_spool[:2]]),
        _upper(values[by_spool[2:]]),
        _upper(held),
    )


def _upper(pair: NDArray[np.number]) -> complex:
    """The eigenvalue of a pair with positive imaginary part, or the slower of two real ones."""
    if np.iscomplexobj(pair) and np.any(np.imag(pair) > 0.0):
        return complex(pair[int(np.argmax(np.imag(pair)))])
    return complex(pair[int(np.argmin(np.abs(pair)))])


# --- the referee ----------------------------------------------------------------------------------


class Feed(NamedTuple):
    """The current over time."""

    current: Array  # At the samples. [A]
    held: bool  # Whether it keeps its value between them, in place of a straight line.
    step: float  # Distance of the samples. [s]


class Case(NamedTuple):
    """What is integrated."""

    def __repr__(self) -> str:
        return short(self)

    p: Plant
    k: PlantConstants
    options: PlantOptions


@kernel
def force_at(time: float, feed: Feed, p: Plant) -> float:
    """Net solenoid force at any time of the record. [N]"""
    current = feed.current
    at = min(max(time / feed.step, 0.0), current.size - 1.0)
    n = max(min(int(at), current.size - 2), 0)
    rise = 0.0 if feed.held else at - n
    after = current[min(n + 1, current.size - 1)]
    return solenoid_force(current[n] + rise * (after - current[n]), p.solenoids)


@inlined
def free_of(state: Array, force: float, case: Case) -> Rates:
    """Rates where no limit holds."""
    motion = Motion(state[0], state[1], state[2], state[3], state[4])
    return free_rates(motion, force, case.p.machine, case.options)


@kernel
def rates_at(time: float, state: Array, feed: Feed, case: Case, holds: Holds) -> Array:
    """Rates of the five states; one that a limit holds has none."""
    force = force_at(time, feed, case.p)
    v_rate, p_rate, r_rate = free_of(state, force, case)
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
    v_rate, p_rate, r_rate = free_of(state, force, case)
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
    v_rate, p_rate, r_rate = free_of(state, force, case)
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


def solve(feed: Feed, case: Case, start: Motion, tolerance: float) -> Array:
    """The (n, 5) states at the samples of a signed current, by Radau's method.

    The relative tolerance is given; the absolute ones are `TOLERANCES`, in proportion to it, for
    1e-6. BDF beyond second order is unstable along the imaginary axis, where the plate on its
    trapped oil swings, and took 25 times as long.

    Raises
    ------
    DomainError
        If the solver gives up or a limit chatters, with the time.
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
    """Last sample and longest step [s] of stretches with a smooth force and stretches without.

    Of the net solenoid force at the samples, two or more. [N] A solver that steps over a short
    pulse of the force never sees it, however small its tolerance.
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
