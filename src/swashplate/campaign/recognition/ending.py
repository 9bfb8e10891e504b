"""How a command ends: a jump to rest, a return along a curve, or the end of the record."""

from __future__ import annotations

from collections.abc import Callable
from math import floor
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.recognition.recognised import Window
from swashplate.campaign.recognition.rounding import roundest
from swashplate.campaign.recognition.trace import Trace
from swashplate.maneuvers.pieces import NEAR, Hermite, return_within

Array = NDArray[np.float64]
Curve = Callable[[Array], Array]

JUMP_SAMPLES = 3
JUMP_SECONDS = 0.03
"""A jump takes so many samples or seconds at most, whichever is more."""


class Refusal(NamedTuple):
    """Why a record is not of a kind."""

    reason: str


class Ending(NamedTuple):
    """What comes after the command."""

    kind: Literal["none", "fall", "return"]
    start: float
    """Where the command ends. [s]"""
    stop: float
    """Where rest begins. [s]"""
    first: int
    """Sample with which it starts."""
    last: int
    """First sample at rest."""
    hermite: Hermite | None = None
    """The package's spline return from start to stop, where that is what it follows."""
    uncertainty: float = 0.0
    """Of start and stop. [s]"""


def jump_instant(trace: Trace, before: int, after: int) -> float:
    """The instant of fewest decimals after one sample and not later than another. [s]"""
    early, late = float(trace.time[before]), float(trace.time[after])
    for decimals in range(10):
        instant = floor((late + NEAR) * 10.0**decimals) / 10.0**decimals
        if instant > early + NEAR:
            return instant
    return late


def jump_samples(trace: Trace) -> int:
    """Samples that a jump may take."""
    return max(JUMP_SAMPLES, round(JUMP_SECONDS / trace.spacing))


def find_ending(
    trace: Trace, first: int, value: Curve, slope: Curve, earliest: float
) -> Ending | Refusal:
    """How it goes on where a record leaves the curve that it followed.

    Parameters
    ----------
    first : int
        First sample that is not on the curve, or the record's length.
    value, slope : callable
        The curve [unit] and its derivative [unit/s] over the time. [s]
    earliest : float
        Where a return may begin, and after which half at least of all must remain. [s]
    """
    end = float(trace.time[-1])
    if first >= trace.time.size:
        return Ending("none", end, end, trace.time.size, trace.time.size)
    moving = np.flatnonzero(np.abs(trace.values[first:]) > trace.tolerance)
    last = first + (int(moving[-1]) + 1 if moving.size else 0)
    if last - first < jump_samples(trace) and last < trace.time.size:
        instant = jump_instant(trace, first - 1, last)
        return Ending("fall", instant, instant, first, last)
    if abs(trace.values[-1]) > max(trace.tolerance, 0.05 * trace.peak):
        return Refusal(f"after {trace.time[first]:.4g} s it goes on instead of returning to rest")
    start, stop = float(trace.time[first]), float(trace.time[min(last, trace.time.size - 1)])
    spline = _spline_return(trace, start, stop, value, slope, earliest)
    if spline is not None:
        return spline
    tail = trace.values[first:] * np.sign(trace.values[first - 1])
    if stop - start > 0.75 * (start - earliest) or tail.min() < -2.0 * trace.tolerance:
        return Refusal(f"what follows after {start:.4g} s is no return to rest")
    return Ending("return", start, stop, first, last, None, trace.spacing)


def _spline_return(
    trace: Trace, start: float, stop: float, value: Curve, slope: Curve, earliest: float
) -> Ending | None:
    """The package's return, fitted by its two ends; None if it is another curve.

    Where it begins it touches the curve, where it ends it touches rest: both ends lie outside of
    what deviates, the more so the more noise there is.
    """
    from scipy.optimize import least_squares

    span = stop - start
    low, high = max(start - span, earliest), min(stop + span, float(trace.time[-1]))
    chosen = trace.picked(*np.searchsorted(trace.time, [low, high], side="right").tolist())
    if chosen.size < 8:
        return None
    time, values = trace.time[chosen], trace.values[chosen]

    def curve(ends: Array) -> Hermite:
        begin = ends[:1]
        level, rise = float(value(begin)[0]), float(slope(begin)[0])
        return return_within(trace.peak, level, rise, float(ends[1] - ends[0]))

    def residual(ends: Array) -> Array:
        begin, end = ends
        if end - begin < trace.spacing:
            return np.full(time.size, 10.0 * trace.peak)
        inside = curve(ends)(np.clip(time - begin, 0.0, end - begin))
        model: Array = np.where(time < begin, value(time), np.where(time < end, inside, 0.0))
        return model - values

    latest = float(trace.time[-1])
    fits = [
        least_squares(
            residual,
            np.clip([start - early * span, stop + late * span], low, latest),
            x_scale=span,
            bounds=([low, low], [latest + 1e-9, latest + max(span, trace.spacing)]),
        )
        for early in (0.05, 0.3)
        for late in (0.0, 0.1)
    ]
    best = min(fits, key=lambda fit: float(fit.cost))
    begin, end = best.x
    rms = float(np.sqrt(2.0 * best.cost / time.size))
    if rms > trace.quality or end - begin > begin - earliest:
        return None
    # standard error of the worse determined end
    normal = best.jac.T @ best.jac
    error = rms * float(np.sqrt(np.linalg.pinv(normal).diagonal().max()))
    first, last = np.searchsorted(trace.time, [begin, end]).tolist()
    spline = curve(best.x)
    return Ending(
        "return", float(begin), float(end), first, last, spline, max(3.0 * error, trace.spacing)
    )


def ending_windows(trace: Trace, ending: Ending) -> dict[str, tuple[Window, ...]]:
    """Windows of the ending and of the rest after it."""
    end = float(trace.time[-1])
    if ending.kind == "none":
        return {}
    start, stop = rounded_ends(trace, ending)
    windows: dict[str, tuple[Window, ...]] = {}
    if ending.kind == "return":
        windows["return"] = (Window(start, stop),)
    if stop < end:
        windows["after"] = (Window(stop, end),)
    return windows


def rounded_ends(trace: Trace, ending: Ending) -> tuple[float, float]:
    """Start and stop as round as the data allow, within the record. [s]"""
    end = float(trace.time[-1])
    start, stop = (roundest(each, ending.uncertainty) for each in (ending.start, ending.stop))
    return min(start, end), min(stop, end)


def follow(trace: Trace, ending: Ending, model: Array) -> NDArray[np.bool_]:
    """Write the ending into a model of the whole record; true where the record is to be judged."""
    judged = np.ones(model.size, dtype=np.bool_)
    if ending.kind == "none":
        return judged
    model[ending.last :] = 0.0
    if ending.hermite is not None:
        inside = slice(ending.first, ending.last)
        model[inside] = ending.hermite(trace.time[inside] - ending.start)
    else:
        judged[max(ending.first - 1, 0) : ending.last] = False
    return judged


def judge(trace: Trace, residual: Array) -> float | Refusal:
    """RMS of a residual, or a refusal where the whole or any part of it is too large.

    Parameters
    ----------
    residual : array
        Record less manoeuvre over the samples that are judged. [unit]
    """
    squares = residual * residual
    rms = float(np.sqrt(squares.mean()))
    if not rms <= trace.quality:
        return Refusal(f"it is off by {rms:.2g} RMS, more than {trace.quality:.2g}")
    parts = max(min(50, squares.size // 8), 1)
    edges = np.linspace(0, squares.size, parts, endpoint=False).astype(np.intp)
    means = np.add.reduceat(squares, edges) / np.diff(edges, append=squares.size)
    worst = float(np.sqrt(means.max()))
    if worst > 3.0 * trace.quality:
        return Refusal(f"a part of it is off by {worst:.2g} RMS")
    return rms
