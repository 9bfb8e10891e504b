"""What real drives do and the identified model does not: one effect, one pure function.

The source saw all four and modelled none (Kruse 2001, sections 1.2, 7.3, 7.4 and 9). Their sizes
are assumed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def remembered_current(current: Array, step: float, gain: float, memory: float) -> Array:
    """Current that moves the spool after it stood still: more than there is, for a while. [A]

    Parameters
    ----------
    current : (n,) array
        Signed current of the card, on an even grid. [A]
    step : float
        Distance of the grid's points. [s]
    gain : float
        Share of a sudden change by which the spool goes too far. [1]
    memory : float
        Time constant with which dither sets it right. [s]

    Notes
    -----
    i + g m with m' = i' − m/T and m = 0 at the first sample, solved exactly for a current on
    straight lines: mₙ₊₁ = e mₙ + (T/h)(1 − e)(iₙ₊₁ − iₙ), e = exp(−h/T).

    The source saw steps of the hoist overshoot and thought of a plunger that has to break loose: it
    then goes too far, until dither has relaxed what holds it. Behind a step of ΔI the current is
    too large by g ΔI exp(−t/T); behind a slow change it is right.
    """
    from scipy.signal import lfilter

    keep = float(np.exp(-step / memory))
    changes = np.diff(current, prepend=current[:1])
    excess = lfilter([memory / step * (1.0 - keep)], [1.0, -keep], changes)
    return np.asarray(current + gain * excess)


def leaked_speed(speed: Array, loss: float, released: float) -> Array:
    """Speed that is left of the pump's when a load makes the motor leak. [rad/s]

    Parameters
    ----------
    speed : (n,) array
        Speed without a load, positive raises it. [rad/s]
    loss : float
        Speed lost to the load, up to `released`. [rad/s]
    released : float
        Speed from which the brake no longer carries any of the load. [rad/s]

    Notes
    -----
    Ω − L min(|Ω|/Ω_r, 1): the leakage follows the pressure drop across the motor, whose sign is the
    load's and not the speed's. So the load is raised slower and lowered faster by L; it stays where
    it is at rest, since the brake holds it. With the brake left out this is the model's Z11.
    """
    return np.asarray(speed - loss * np.minimum(np.abs(speed) / released, 1.0))


def rippled_position(position: Array, cycles: float, amplitude: float) -> Array:
    """Angle of a shaft whose motor takes more oil at some angles than at others. [rad]

    Parameters
    ----------
    position : (n,) array
        Angle θ₀ of a motor of constant displacement, 0 where the ripple begins. [rad]
    cycles : float
        Cycles n of the ripple in a turn. [1]
    amplitude : float
        Share a by which the displacement varies, below 1. [1]

    Notes
    -----
    The oil that the pump delivers is θ₀ = ∫(1 + a sin nθ) dθ = θ + (a/n)(1 − cos nθ), Kepler's
    equation, solved by Newton's method. The speed is Ω₀/(1 + a sin nθ), on average over a cycle Ω₀.
    """
    angle = position.copy()
    for _ in range(20):
        missing = position - angle - amplitude / cycles * (1.0 - np.cos(cycles * angle))
        change = missing / (1.0 + amplitude * np.sin(cycles * angle))
        angle += change
        if np.abs(change).max() <= 1e-14 * max(1.0, float(np.abs(angle).max())):
            break
    return angle


def rippled_speed(speed: Array, angle: Array, cycles: float, amplitude: float) -> Array:
    """Speed Ω₀/(1 + a sin nθ) of that shaft, at the angles of `rippled_position`. [rad/s]"""
    return np.asarray(speed / (1.0 + amplitude * np.sin(cycles * angle)))


def play(position: Array, width: float) -> Array:
    """Position behind a gear with backlash: the play operator. [rad]

    Parameters
    ----------
    position : (n,) array
        Position of what drives. [rad]
    width : float
        Way that it can go without taking the other along. [rad]

    Notes
    -----
    yₙ = max(xₙ − b/2, min(xₙ + b/2, yₙ₋₁)), in the middle of the gap at first. Between two
    reversals of x it is one maximum or minimum, which is how it is computed.
    """
    half, behind = 0.5 * width, float(position[0])
    driven = np.empty_like(position)
    driven[0] = behind
    rising = np.diff(position) >= 0.0
    turns = np.flatnonzero(rising[1:] != rising[:-1]) + 1
    for begin, end in zip([0, *turns.tolist()], [*turns.tolist(), rising.size], strict=True):
        way = position[begin + 1 : end + 1]
        if end > begin and rising[begin]:
            driven[begin + 1 : end + 1] = np.maximum(way - half, behind)
        else:
            driven[begin + 1 : end + 1] = np.minimum(way + half, behind)
        behind = float(driven[end])
    return driven
