"""Outcome of a run: swing, peaks of limited quantities, limits of the drives, the end."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.crane.axes import AXES, RATE
from swashplate.crane.closed_loop.result import PUMPS, CraneRun
from swashplate.crane.rope import GRAVITY, rope_leads, swing_of
from swashplate.crane.sea.extremes import peaks_of
from swashplate.drive import Limit

Array = NDArray[np.float64]

EVERY = 32
"""Every so many samples one counts: 16 a second, of periods of 2 s and more."""
ELASTIC_EVERY = 4
"""The same for the tension of an elastic rope, whose bounce has a few hertz."""
BITS = np.arange(2 ** len(PUMPS))[:, None] >> np.arange(len(PUMPS)) & 1
"""Which of `PUMPS` act, a row for each sum of the loop's bits."""
SATURATED = BITS[:, [PUMPS.index(Limit.ORIFICE), PUMPS.index(Limit.SWASH_STOP)]].any(axis=1)
"""Sums of bits with a limit at which a drive does not follow its command: acceleration, speed."""


class RunOutcome(NamedTuple):
    """Outcome of one run, in SI."""

    rms_swing: float
    """NaN if the run left the model or was stopped."""
    largest_swing: float
    limits: Array
    """(3, 5) shares of time for which `PUMPS` act on hoist, slew, luff."""
    saturation: float
    """Largest share of time, over the drives, at the acceleration or the speed limit."""
    peaks: Mapping[str, Array]
    """Peaks of quantities by names of `limits.LIMITED`, until the run left the model."""
    evaluated_time: float
    """Time in which peaks are evaluated. [s]"""
    departure_reason: str
    """Why the run stops being a valid operation; empty if it is valid to its end."""


LEAST = 10.0
"""Time below which nothing counts. [s]"""
STOPPED = RunOutcome(
    rms_swing=np.nan,
    largest_swing=np.nan,
    limits=np.full((3, len(PUMPS)), np.nan),
    saturation=np.nan,
    peaks={},
    evaluated_time=0.0,
    departure_reason="stopped at a limit",
)
"""Of a run that met a limit of the crane's travel, or left the domain of a drive's model."""


def outcome_of(run: CraneRun, start: float, target: tuple[float, float] | None) -> RunOutcome:
    """Summarise a run from a time [s] on.

    Parameters
    ----------
    run : CraneRun
    start : float
        [s]
    target : (float, float), optional
        Where the load shall be, horizontal and inertial [m]; None if it shall move.
    """
    first = round(start * RATE)
    departure = run.departure
    end = len(run.stored) if departure is None else round(departure.time * RATE)
    reason = "" if departure is None else departure.reason
    evaluated_time = max(end - first, 0) / RATE
    if evaluated_time < LEAST:
        return STOPPED._replace(departure_reason=reason)
    evaluated = slice(first, end, EVERY)
    load = run.load[evaluated]
    tip = run.tip[evaluated]
    hook = run.hook[evaluated]
    swing = swing_of(load, tip)
    slew = run.fixed.home.slew + run["shaft_slew"][evaluated]
    out, across = rope_leads(hook - tip, slew, run.ship[evaluated]).T
    speed = np.abs(np.diff(hook[:, 2])) * RATE / EVERY
    hoist = run.crane.geometry.hoist * min(np.abs(run.crane.inverse("hoist").limits))
    elastic = run.fixed.hanging.stiffness > 0.0
    pull = run["pull"][slice(first, end, ELASTIC_EVERY if elastic else EVERY)]
    peaks = {
        "swing": peaks_of(swing),
        "off_lead": peaks_of(np.abs(out)),
        "side_lead": peaks_of(np.abs(across)),
        "hook_speed": peaks_of(speed),
        "hoist_demand": peaks_of(speed) / hoist,
    }
    jumps = run.actuation == "ideal" and run.fixed.settings.path
    if not jumps:  # of speed, which are impulses of the rope
        peaks["dynamic_factor"] = peaks_of(pull / GRAVITY)
    if target is not None:
        away = load[:, :2] - np.array(target)
        peaks["placement"] = peaks_of(np.hypot(away[:, 0], away[:, 1]))
    completed = departure is None
    limits, saturation = _shares(run, slice(first, end))
    return RunOutcome(
        rms_swing=float(np.sqrt(np.mean(swing**2))) if completed else np.nan,
        largest_swing=float(swing.max()) if completed else np.nan,
        limits=limits,
        saturation=saturation,
        peaks=peaks,
        evaluated_time=evaluated_time,
        departure_reason=reason,
    )


def _shares(run: CraneRun, samples: slice) -> tuple[Array, float]:
    """(3, 5) shares of time for which `PUMPS` act on the drives, and the largest at `SATURATED`."""
    sums = np.empty((len(AXES), len(BITS)))  # shares of each sum of the loop's bits
    for row, axis in zip(sums, AXES, strict=True):
        bits = run[f"limits_{axis}"][samples].astype(np.intp)
        row[:] = np.bincount(bits, minlength=len(BITS)) / len(bits)
    return sums @ BITS, float(sums[:, SATURATED].sum(axis=1).max())
