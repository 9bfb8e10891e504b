"""Steps and stairs: levels that are held, with jumps between them."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from swashplate.campaign.recognition.ending import (
    Ending,
    Refusal,
    ending_windows,
    find_ending,
    follow,
    judge,
    jump_instant,
    jump_samples,
    rounded_ends,
)
from swashplate.campaign.recognition.recognised import Recognised, Window
from swashplate.campaign.recognition.rounding import roundest
from swashplate.campaign.recognition.trace import Array, Trace

SMALLEST_JUMP = 0.05
"""Smallest jump, as a share of the largest level. [1]"""
MOST_JUMPS = 200
"""A record with more jumps is not looked at as stairs."""
SHORTEST = 5
"""Samples for which a level is held at least."""
EDGE = 2
"""Samples on either side of a jump that may lie on it."""


class _Level(NamedTuple):
    height: float
    start: float
    """Instant of the jump to it. [s]"""
    first: int
    last: int
    """Samples from `first` to before `last` are held."""


def find_levels(trace: Trace, unit: str, settling: float) -> Recognised | Refusal:
    """A step or stairs, or why it is neither."""
    held = _held(trace)
    if isinstance(held, Refusal):
        return held
    levels, ending = held
    model = np.zeros_like(trace.values)
    judged = follow(trace, ending, model)
    for level in levels:
        model[level.first : level.last] = level.height
    for before, after in pairwise(levels):
        judged[before.last : after.first] = False
    # of the jump to the first level it is known when it is complete
    judged[max(levels[0].first - jump_samples(trace), 0) : levels[0].first] = False
    if ending.kind == "fall":
        judged[levels[-1].last : ending.first] = False
    rms = judge(trace, (trace.values - model)[judged])
    if isinstance(rms, Refusal):
        return rms
    return _described(trace, unit, settling, levels, ending, rms)


def _held(trace: Trace) -> tuple[list[_Level], Ending] | Refusal:
    """Levels other than the rest before and after, and the ending."""
    values, least = trace.values, max(2.0 * trace.tolerance, SMALLEST_JUMP * trace.peak)
    jumps = np.flatnonzero(np.abs(np.diff(values)) > least)
    if jumps.size == 0:
        return Refusal("there is no jump")
    groups = np.split(jumps, np.flatnonzero(np.diff(jumps) > SHORTEST) + 1)
    if len(groups) > MOST_JUMPS:
        return Refusal(f"there are {len(groups)} jumps")
    if any(group[-1] - group[0] >= jump_samples(trace) for group in groups):
        return Refusal("it moves between levels without jumping")
    firsts = [0, *(int(group[-1]) + 1 for group in groups)]
    lasts = [*(int(group[0]) + 1 for group in groups), values.size]
    levels: list[_Level] = []
    before = 0
    for number, bounds in enumerate(zip(firsts, lasts, strict=True)):
        first, last = _trimmed(trace, *bounds)
        final = last == values.size
        start = jump_instant(trace, before, first) if number else float(trace.time[0])
        leaves = _leaves(trace, first, last)
        before = leaves - 1
        if leaves - first < (1 if final else SHORTEST):
            return Refusal(f"it holds no level at {trace.time[first]:.4g} s")
        level = _Level(float(values[first:leaves].mean()), start, first, leaves)
        resting = abs(level.height) <= trace.tolerance
        if leaves < last:
            if resting or not final:
                return Refusal(f"it drifts at {trace.time[leaves]:.4g} s")
            return _returned(trace, [*levels, level])
        if final and resting:
            ending = Ending("fall", level.start, level.start, first, first)
            return (levels, ending) if levels else Refusal("there is no level but rest")
        if levels or not resting:
            levels.append(level)
    end = float(trace.time[-1])
    return levels, Ending("none", end, end, values.size, values.size)


def _trimmed(trace: Trace, first: int, last: int) -> tuple[int, int]:
    """A level without the samples beside its jumps that were taken while they lasted."""
    values = trace.values
    width = min(max(SHORTEST, (last - first) // 10), last - first)
    late = _off(trace, values[first : first + width])
    early = _off(trace, values[last - width : last][::-1])
    return first + (late if first else 0), last - (early if last < values.size else 0)


def _off(trace: Trace, level: Array) -> int:
    """How many of its first samples belong to the jump before it."""
    away = np.abs(level[:EDGE] - np.median(level)) > trace.tolerance
    return int(np.flatnonzero(away)[-1]) + 1 if away.any() else 0


def _leaves(trace: Trace, first: int, last: int) -> int:
    """First sample from `first` on that is no longer at the level that is held there."""
    sure = trace.values[first : first + max(SHORTEST, (last - first) // 10)]
    away = np.abs(trace.values[first:last] - np.median(sure)) > trace.tolerance
    return min(trace.first(away, first), last)


def _returned(trace: Trace, levels: list[_Level]) -> tuple[list[_Level], Ending] | Refusal:
    """Levels of which the last is followed by a return."""
    final = levels[-1]
    ending = find_ending(
        trace,
        final.last,
        lambda time: np.full_like(time, final.height),
        np.zeros_like,
        levels[0].start,
    )
    if isinstance(ending, Refusal):
        return ending
    if ending.kind == "none" or ending.first - final.first < SHORTEST:
        return Refusal(f"it drifts at {trace.time[final.last]:.4g} s")
    levels[-1] = final._replace(
        last=ending.first, height=float(trace.values[final.first : ending.first].mean())
    )
    return levels, ending


def _described(
    trace: Trace,
    unit: str,
    settling: float,
    levels: list[_Level],
    ending: Ending,
    rms: float,
) -> Recognised:
    heights = [_rounded(trace, level) for level in levels]
    starts = [level.start for level in levels]
    stops = [*starts[1:], rounded_ends(trace, ending)[0]]
    windows = _windows(trace, settling, starts, stops, ending)
    whole = [stop - start for start, stop in zip(starts, stops, strict=True)]
    closed = ending.kind == "fall" or ending.hermite is not None
    dwells = whole if closed else whole[:-1]
    if levels[0].first == 0:
        dwells = dwells[1:]  # the record begins within it
    slack = 3.0 * trace.spacing + ending.uncertainty
    even = dwells and max(dwells) - min(dwells) <= max(slack, 0.02 * max(dwells))
    dwell = roundest(float(np.mean(dwells)), slack) if even else None
    one = len(levels) == 1
    if one:
        name, what = f"step {heights[0]:+g} {unit}", f"a level of {heights[0]:g} {unit}"
    else:
        shown = [*heights, 0.0] if ending.kind == "fall" else heights
        name = f"stairs {'/'.join(f'{height:g}' for height in shown)} {unit}"
        what = f"{len(levels)} levels"
    fitted = {
        ("level" if one else f"level {number}"): level.height
        for number, level in enumerate(levels, start=1)
    }
    fitted |= {"start": levels[0].start, "stop": ending.start}
    return Recognised(
        "step" if one else "stairs",
        name,
        unit,
        trace.rest,
        trace.noise,
        rms,
        f"{what} fits to {rms:.2g} {unit} RMS" if one else f"{what} fit to {rms:.2g} {unit} RMS",
        level=heights[0] if one else None,
        levels=tuple(heights),
        dwell=dwell,
        fitted=fitted,
        windows=windows,
    )


def _rounded(trace: Trace, level: _Level) -> float:
    error = np.hypot(trace.noise / (level.last - level.first) ** 0.5, trace.rest_error)
    return roundest(level.height, max(3.0 * float(error), 0.002 * trace.peak))


def _windows(
    trace: Trace, settling: float, starts: list[float], stops: list[float], ending: Ending
) -> dict[str, tuple[Window, ...]]:
    begin, end = float(trace.time[0]), float(trace.time[-1])
    rises = [Window(a, min(a + settling, b)) for a, b in zip(starts, stops, strict=True)]
    plateaus = [Window(rise.stop, b) for rise, b in zip(rises, stops, strict=True) if rise.stop < b]
    windows: dict[str, tuple[Window, ...]] = {}
    if starts[0] > begin:
        windows["before"] = (Window(begin, starts[0]),)
    windows["rise"] = tuple(rises)
    if plateaus:
        windows["plateau"] = tuple(plateaus)
    if ending.kind != "fall":
        return windows | ending_windows(trace, ending)
    settled = min(ending.start + settling, end)
    windows["fall"] = (Window(ending.start, settled),)
    if settled < end:
        windows["after"] = (Window(settled, end),)
    return windows
