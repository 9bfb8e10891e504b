"""What counts of a run: swing, peaks of all that has a limit, limits of the drives, the end."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.crane.axes import AXES, RATE
from swashplate.crane.extremes import peaks_of
from swashplate.crane.result import PUMPS, CraneRun
from swashplate.simulation.result import Limit

Array = NDArray[np.float64]

EVERY = 32
"""Samples from one of those that count to the next: 16 a second, of periods of 2 s and more."""
ELASTIC_EVERY = 4
"""The same of the tension of an elastic rope, whose bounce has a few hertz."""
BITS = np.arange(2 ** len(PUMPS))[:, None] >> np.arange(len(PUMPS)) & 1
"""Which of `PUMPS` act, a row for each sum of the loop's bits."""
SATURATED = (PUMPS.index(Limit.ORIFICE), PUMPS.index(Limit.SWASH_STOP))
"""Limits at which a drive does not do what it is asked to: acceleration and speed."""


class Outcome(NamedTuple):
    """What counts of one run, in SI."""

    rms_swing: float
    """NaN if the run left the model or was stopped."""
    largest_swing: float
    limits: Array
    """(3, 5) shares of time for which `PUMPS` act on hoist, slew, luff."""
    saturation: float
    """Largest share of time, over the drives, at the acceleration or the speed limit."""
    peaks: Mapping[str, Array]
    """Peaks of quantities by names of `limits.LIMITED`, until the run left the model."""
    counted: float
    """Time for which peaks count. [s]"""
    left: str
    """Why the run is not an operation any more from some time on; empty if it is one."""


STOPPED = Outcome(
    np.nan, np.nan, np.full((3, len(PUMPS)), np.nan), np.nan, {}, 0.0, "stopped at a limit"
)
"""Of a run that met a limit of the crane's travel, or left the domain of a drive's model."""


def outcome_of(run: CraneRun, start: float, wanted: tuple[float, float] | None) -> Outcome:
    """What counts of a run from a time [s] on.

    Parameters
    ----------
    run : CraneRun
    start : float
        [s]
    wanted : (float, float), optional
        Where the load shall be, horizontal and inertial [m]; None if it shall move.
    """
    first = round(start * RATE)
    left = run.left_model
    last = len(run.time) if left is None else round(left[0] * RATE)
    if last - first < 2 * EVERY:
        return STOPPED._replace(left=left[1] if left is not None else STOPPED.left)
    some = slice(first, last, EVERY)
    out, across = run.leads(some)
    peaks = {
        "swing": peaks_of(run.swing(some)),
        "off_lead": peaks_of(np.abs(out)),
        "side_lead": peaks_of(np.abs(across)),
        "hook_speed": peaks_of(np.abs(run.hook_speed(some))),
    }
    hoist = run.crane.geometry.hoist * min(np.abs(run.crane.inverse("hoist").limits))
    peaks["hoist_demand"] = peaks["hook_speed"] / hoist
    tension = run["pull"][slice(first, last, ELASTIC_EVERY if run.elastic else EVERY)]
    peaks["dynamic_factor"] = peaks_of(tension / GRAVITY)
    if wanted is not None:
        away = run.load[some, :2] - np.array(wanted)
        peaks["placement"] = peaks_of(np.hypot(away[:, 0], away[:, 1]))
