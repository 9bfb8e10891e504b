"""Runs of a crane: signals with units, and what they amount to."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from math import pi, sqrt
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from swashplate.crane.loop import ROWS
from swashplate.crane.rope import GRAVITY
from swashplate.crane.stick import AXES
from swashplate.errors import InputError
from swashplate.simulation.result import Limit, Simulation
from swashplate.tables import UNIT, Column, Table

if TYPE_CHECKING:
    import polars
    from matplotlib.figure import Figure

    from swashplate.crane.crane import Crane, Pose

Array = NDArray[np.float64]

CALMS, WATCHED = 4.0, 25.0
"""Residual swing counts from so long after the shaper's last impulse, for so long. [s]"""
SETTLED = 1.0
"""Swing below which a load counts as settled. [deg]"""


@dataclass(frozen=True, eq=False)
class CraneRun:
    """Signals of one run at 512 Hz; positions are inertial, z up, in m."""

    crane: Crane = field(repr=False)
    stick: Array
    """(n, 3) commands of hoist, slew and luff, -1 to 1."""
    ship: Array
    """(n, 6) surge, sway, heave [m], roll, pitch, yaw [rad]; (n, 1) zeros for a ship at rest."""
    out: Array = field(repr=False)
    rate: float
    pose: Pose
    actuation: str
    stick_end: float
    """When the last command has returned to zero. [s]"""
    halves: int
    """Half periods of the load that the shaper takes."""
    mass: float
    """Of the load. [kg]"""

    def __repr__(self) -> str:
        return (
            f"CraneRun({self.crane.name!r}, {self.time[-1]:g} s, {self.actuation}, swing up to "
            f"{self.swing_deg.max():.3g} deg)"
        )

    def _rows(self, *names: str) -> Array:
        made = self.out[:, [ROWS.index(name) for name in names]]
        made.flags.writeable = False
        return made if len(names) > 1 else made[:, 0]

    @cached_property
    def time(self) -> Array:
        """(n,) [s]"""
        return np.arange(len(self.out)) / self.rate

    @cached_property
    def tip(self) -> Array:
        """(n, 3) tip of the boom. [m]"""
        return self._rows("tip_x", "tip_y", "tip_z")

    @cached_property
    def load(self) -> Array:
        """(n, 3) load. [m]"""
        return self._rows("load_x", "load_y", "load_z")

    @cached_property
    def rope(self) -> Array:
        """(n,) rope below the tip. [m]"""
        return self._rows("rope")

    @cached_property
    def slew_deg(self) -> Array:
        """(n,) slew from forward, positive to starboard. [deg]"""
        return np.degrees(self.pose.slew + self._rows("shaft_slew"))

    @cached_property
    def boom_deg(self) -> Array:
        """(n,) elevation of the boom. [deg]"""
        return np.degrees(np.arctan2(self._rows("boom_sin"), self._rows("boom_cos")))

    @cached_property
    def voltage(self) -> Array:
        """(n, 3) commands of the drives, zero with ideal ones. [V]"""
        return self._rows("voltage_hoist", "voltage_slew", "voltage_luff")

    @cached_property
    def shaft_speed(self) -> Array:
        """(n, 3) speeds of the shafts; the slew's at the turret, the hoist's braked. [rad/s]"""
        return self._rows("speed_hoist", "speed_slew", "speed_luff")

    @cached_property
    def tension(self) -> Array:
        """(n,) tension of the rope, 0 where it is slack. [N]"""
        return self.mass * self._rows("pull")

    @cached_property
    def slack(self) -> NDArray[np.bool_]:
        """(n,) whether the rope is slack."""
        return np.asarray(self.tension <= 0.0)

    @cached_property
    def swing_deg(self) -> Array:
        """(n,) angle between rope and plumb line. [deg]"""
        d = self.load - self.tip
        return np.degrees(np.arctan2(np.hypot(d[:, 0], d[:, 1]), -d[:, 2]))

    def _after(self, start: float, lasts: float) -> slice:
        first = round(start * self.rate)
        if first >= len(self.out):
            raise InputError(
                f"The run is {self.time[-1]:g} s long, but its residual swing counts from "
                f"{start:.4g} s on: take a longer stick."
            )
        return slice(first, first + round(lasts * self.rate))

    @property
    def settling_starts(self) -> float:
        """When residual swing counts: the stick's end, the shaper's last impulse, and 4 s. [s]"""
        return self.stick_end + self.halves * pi * sqrt(self.rope[-1] / GRAVITY) + CALMS

    @cached_property
    def residual_deg(self) -> float:
        """Largest swing for 25 s from `settling_starts` on. [deg]

        Raises
        ------
        InputError
            If the run ends before.
        """
        return float(self.swing_deg[self._after(self.settling_starts, WATCHED)].max())

    def rms_deg(self, start: float = 0.0) -> float:
        """Root mean square of the swing from a time [s] on. [deg]"""
        return float(
            np.sqrt(np.mean(self.swing_deg[self._after(start, np.ceil(self.time[-1]))] ** 2))
        )

    @cached_property
    def settled_at(self) -> float:
        """Last time at which the swing is above 1 degree; 0 if it never is. [s]"""
        above = np.flatnonzero(self.swing_deg > SETTLED)
        return float(self.time[above[-1]]) if above.size else 0.0

    def drive(self, axis: str) -> Simulation:
        """The simulation of one drive under its voltages, with all signals inside it.

        Raises
        ------
        InputError
            For ideal drives, which have none.
        """
        if axis not in AXES:
            raise InputError(f"There is no axis '{axis}'; there are {', '.join(AXES)}.")
        if self.actuation == "ideal":
            raise InputError("Ideal drives have neither voltages nor limits other than of speed.")
        if axis not in self._drives:
            found = getattr(self.crane, axis)
            volts = np.ascontiguousarray(self.voltage[:, AXES.index(axis)])
            self._drives[axis] = found.simulate(volts, self.rate)
        return self._drives[axis]

    @cached_property
    def _drives(self) -> dict[str, Simulation]:
        return {}

    def limits(self, axis: str) -> dict[str, float]:
        """Share of time for which each limit of a drive acts, by name, 0 to 1."""
        run = self.drive(axis)
        return {each.name.lower(): float(run.active(each).mean()) for each in Limit if each.name}

    def table(self) -> Table:
        """What the run amounts to."""
        made = Table("", (Column("Result"), Column("value", ".4g"), UNIT))
        late = self.time[-1] < self.settling_starts
        made.add("residual swing", None if late else np.radians(self.residual_deg), unit="rad")
        made.add("largest swing", float(np.radians(self.swing_deg.max())), unit="rad")
        made.add("swing, rms", float(np.radians(self.rms_deg())), unit="rad")
        made.add("slew at the end", float(np.radians(self.slew_deg[-1])), unit="rad")
        made.add("boom at the end", float(np.radians(self.boom_deg[-1])), unit="rad")
        made.add("rope at the end", float(self.rope[-1]), unit="m")
        made.add("largest tension", float(self.tension.max()), unit="N")
        made.add("rope slack", 100.0 * float(self.slack.mean()), unit="%")
        return made

    def limits_table(self) -> Table:
        """Shares of time for which limits act, for each axis."""
        columns = (Column("Limit"), *(Column(axis, ".1%") for axis in AXES))
        made = Table("Share of time for which limits act", columns)
        shares = [self.limits(axis) for axis in AXES]
        for name in shares[0]:
            made.add(name.replace("_", " "), *(each[name] for each in shares))
        return made

    def to_polars(self) -> polars.DataFrame:
        """All signals, a row for each sample, in SI."""
        import polars as pl

        columns = {"time": self.time}
        columns |= {f"stick_{axis}": self.stick[:, i] for i, axis in enumerate(AXES)}
        columns |= {name: self.out[:, i] for i, name in enumerate(ROWS)}
        columns["swing"] = np.radians(self.swing_deg)
        return pl.DataFrame(columns)

    def plot(self) -> Figure:
        """Figure of the run; see `swashplate.report.figures.plot_crane`."""
        from swashplate.report.figures import plot_crane

        return plot_crane(self)
