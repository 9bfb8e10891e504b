"""Runs of one drive or of two: largest speeds and currents, distance, and what limited them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.analysis.limits import time_share
from swashplate.simulation.result import Limit
from swashplate.tables import UNIT, Cell, Column, Table

if TYPE_CHECKING:
    from swashplate.drive import Drive
    from swashplate.simulation.result import Simulation

Array = NDArray[np.float64]

REACHED = 0.9
"""Part of the settled speed that counts as reached."""
SHARE = Column("share of time", ".1%")


class Peaks(NamedTuple):
    """Largest values either way; zero where there is none."""

    positive: float
    negative: float


def peaks(signal: Array) -> Peaks:
    """Peaks of a signal, in its unit."""
    return Peaks(max(float(signal.max()), 0.0), min(float(signal.min()), 0.0))


def limit_time_shares(run: Simulation) -> dict[str, float]:
    """Share of the samples at which each limit acts, see `analysis.limits.time_share`, by name."""
    return {str(limit.name).lower().replace("_", " "): time_share(run, limit) for limit in Limit}


def time_to_reach(run: Simulation, settled_speed: float) -> float | None:
    """Time from the command's first move to 90 % of a speed, None if it is never reached.

    Parameters
    ----------
    run : Simulation
        A run by voltage.
    settled_speed : float
        The speed meant. [rad/s]

    Returns
    -------
    float or None
        Counted from the last sample before the command leaves its first value. [s]
    """
    voltage = _voltage(run)
    begin = max(int(np.argmax(voltage != voltage[0])) - 1, 0)
    part = run.shaft_speed[begin:] * np.sign(settled_speed)
    reached = part >= REACHED * abs(settled_speed)
    if settled_speed == 0.0 or not reached.any():
        return None
    return float(run.time[begin + np.argmax(reached)] - run.time[begin])


def run_tables(run: Simulation) -> tuple[Table, Table]:
    """What a drive did under a command, and how long each of its limits held it back."""
    speed, current = peaks(run.shaft_speed), peaks(run.current)
    position = float(run.shaft_position[-1])
    did = Table("", (Column("Shaft"), Column("", "z.2f"), UNIT))
    did.add("peak speed, positive", speed.positive, unit="rad/s")
    did.add("peak speed, negative", speed.negative, unit="rad/s")
    did.add("speed at the end", float(run.shaft_speed[-1]), unit="rad/s")
    did.add("position at the end", position, unit="rad", spec="z.1f")
    did.add("", position / (2.0 * np.pi), unit="turns", spec="z.3f")
    did.add("peak current, positive", current.positive, unit="A", spec="z.4f", section=True)
    did.add("peak current, negative", current.negative, unit="A", spec="z.4f")
    held = Table("", (Column("Limit"), SHARE))
    for limit, share in limit_time_shares(run).items():
        held.add(limit, share or Cell(0.0, "never"))
    return did, held


def side_by_side(drives: Mapping[str, Drive], runs: Mapping[str, Simulation]) -> Table:
    """Two drives or more under the same command: peaks, settled speed and the time to reach it."""
    voltage = _voltage(next(iter(runs.values())))
    volts = float(voltage[np.argmax(np.abs(voltage))])
    speeds = [peaks(run.shaft_speed) for run in runs.values()]
    settled = [float(drive.steady_speed(volts)) for drive in drives.values()]
    times = [time_to_reach(run, each) for run, each in zip(runs.values(), settled, strict=True)]
    columns = [Column(label, "z.2f", none="never") for label in runs]
    made = Table("", (Column(""), *columns, UNIT))
    made.add("peak speed, positive", *(each.positive for each in speeds), unit="rad/s")
    made.add("peak speed, negative", *(each.negative for each in speeds), unit="rad/s")
    made.add(f"settled speed at {volts:g} V", *settled, unit="rad/s")
    made.add("time to 90 % of it", *times, unit="s", spec=".3f")
    return made


def overview_table(runs: Mapping[str, Mapping[str, Simulation]]) -> Table:
    """Peak speeds of many runs and the limits that they meet, by axis and manoeuvre."""
    speed = ("z.2f", "rad/s")
    made = Table(
        "Peak speeds",
        (
            Column("axis"),
            Column("manoeuvre"),
            Column("samples", "d"),
            Column("plus", *speed),
            Column("minus", *speed),
            Column("limits met", wrap=True),
        ),
    )
    for axis, by_name in runs.items():
        for number, (name, run) in enumerate(by_name.items()):
            limits = ", ".join(limit for limit, share in limit_time_shares(run).items() if share)
            ends = peaks(run.shaft_speed)
            made.add(axis, name, run.time.size, *ends, limits, section=number == 0)
    return made


def rms_difference(run: Simulation, other: Simulation) -> float:
    """Root of the mean squared difference of two speeds. [rad/s]"""
    return float(np.sqrt(np.mean((run.shaft_speed - other.shaft_speed) ** 2)))


def _voltage(run: Simulation) -> Array:
    assert run.voltage is not None  # runs by voltage only
    return run.voltage
