"""Ramps: a straight rise from rest, perhaps to a level that is held."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swashplate.campaign.recognition.ending import (
    Ending,
    Refusal,
    ending_windows,
    find_ending,
    follow,
    judge,
    rounded_ends,
)
from swashplate.campaign.recognition.recognised import Recognised, Window
from swashplate.campaign.recognition.rounding import roundest
from swashplate.campaign.recognition.trace import Array, Trace

FEWEST = 5
"""Samples between 10 % and 90 % of the peak; with fewer it is no ramp but a jump."""
SHORTEST_HOLD = 0.25
"""For so long a ramp stays at its limit; a shorter stay is the crest of its return. [s]"""


@dataclass(frozen=True)
class _Line:
    slope: float
    start: float
    """Where it leaves rest. [s]"""
    error: float
    """Standard error of the slope. [unit/s]"""

    def __call__(self, time: Array) -> Array:
        return self.slope * np.maximum(time - self.start, 0.0)

    def steepness(self, time: Array) -> Array:
        return np.full_like(time, self.slope)


def find_ramp(trace: Trace, unit: str) -> Recognised | Refusal:
    """A ramp, or why it is none."""
    values = trace.values * np.sign(trace.values[np.abs(trace.values).argmax()])
    low, high = (int((values >= share * trace.peak).argmax()) for share in (0.1, 0.8))
    if high - low < FEWEST or trace.time[high] - trace.time[low] < 0.1:
        return Refusal("it rises in a jump")
    line = _line(trace, low, high)
    if line.slope == 0.0 or not trace.time[0] - trace.spacing <= line.start < trace.time[low]:
        return Refusal("its rise is not straight")
    leaves = _leaves(trace, line, low)
    if leaves < high:
        return Refusal("its rise is not straight")
    line = _line(trace, low, leaves)
    leaves = _leaves(trace, line, low)
    ending = find_ending(trace, leaves, line, line.steepness, line.start)
    limit = None
    if isinstance(ending, Refusal) or (ending.kind == "return" and ending.hermite is None):
        held = _held(trace, line, leaves)
        if held is not None:
            limit, ending = held
    if isinstance(ending, Refusal):
        return ending
    if limit is None:
        line = _line(trace, low, min(ending.first, leaves))
    model = line(trace.time) if limit is None else _limited(line, limit, trace.time)
    judged = follow(trace, ending, model)
    rms = judge(trace, (trace.values - model)[judged])
    if isinstance(rms, Refusal):
        return rms
    return _described(trace, unit, line, limit, ending, rms)


def _line(trace: Trace, first: int, last: int) -> _Line:
    """Least-squares line through samples `first` to before `last`."""
    chosen = trace.picked(first, last)
    time, values = trace.time[chosen], trace.values[chosen]
    middle = time.mean()
    spread = float(((time - middle) ** 2).sum())
    slope = float(((time - middle) @ values) / spread)
    error = trace.noise / spread**0.5
    start = float(middle - values.mean() / slope) if slope else float(middle)
    return _Line(slope, start, error)


def _limited(line: _Line, limit: float, time: Array) -> Array:
    ramp = line(time)
    return np.minimum(ramp, limit) if limit > 0.0 else np.maximum(ramp, limit)


def _leaves(trace: Trace, line: _Line, low: int) -> int:
    """First sample from `low` on that is not on the line, or the record's length."""
    away = np.abs(trace.values[low:] - line(trace.time[low:])) > trace.tolerance
    return trace.first(away, low)


def _held(trace: Trace, line: _Line, leaves: int) -> tuple[float, Ending | Refusal] | None:
    """Level at which a ramp is held, and what comes after; None if it is not held."""
    begin = leaves + 2
    near = trace.values[begin : begin + FEWEST]
    if near.size < FEWEST:
        return None
    away = np.abs(trace.values[begin:] - np.median(near)) > trace.tolerance
    stops = trace.first(away, begin)
    if trace.time[stops - 1] - trace.time[leaves] < SHORTEST_HOLD:
        return None
    limit = float(trace.values[begin:stops].mean())
    reaches = line.start + limit / line.slope
    return limit, find_ending(
        trace, stops, lambda time: np.full_like(time, limit), np.zeros_like, reaches
    )


def _described(
    trace: Trace, unit: str, line: _Line, limit: float | None, ending: Ending, rms: float
) -> Recognised:
    slope = roundest(line.slope, max(3.0 * line.error, 0.002 * abs(line.slope)))
    begin = float(trace.time[0])
    timing = max(trace.spacing, 3.0 * trace.noise / abs(line.slope))
    start = max(roundest(line.start, timing), begin)
    stop = rounded_ends(trace, ending)[0] if ending.kind != "none" else float(trace.time[-1])
    windows: dict[str, tuple[Window, ...]] = {}
    if start > begin:
        windows["before"] = (Window(begin, start),)
    fitted = {"slope": line.slope, "start": line.start}
    rounded_limit = None
    if limit is None:
        windows["rise"] = (Window(start, stop),)
    else:
        reaches = line.start + limit / line.slope
        top = roundest(reaches, timing)
        windows |= {"rise": (Window(start, top),), "hold": (Window(top, stop),)}
        rounded_limit = roundest(limit, 0.002 * trace.peak)
        fitted |= {"limit": limit, "hold start": reaches}
    if ending.kind != "none":
        fitted |= {"return start": ending.start, "return stop": ending.stop}
    return Recognised(
        "ramp",
        f"ramp {slope:+g} {unit}/s",
        unit,
        trace.rest,
        trace.noise,
        rms,
        f"a slope of {slope:g} {unit}/s fits to {rms:.2g} {unit} RMS",
        slope=slope,
        limit=rounded_limit,
        fitted=fitted,
        windows=windows | ending_windows(trace, ending),
    )
