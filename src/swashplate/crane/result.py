"""Runs of a crane: signals with units, and what they amount to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import pi, sqrt
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from swashplate.crane.loop import HOOK, ROWS, TORQUES
from swashplate.crane.rope import GRAVITY
from swashplate.crane.stick import AXES
from swashplate.errors import InputError
from swashplate.results import Tabular
from swashplate.simulation.result import Limit, Simulation
from swashplate.tables import Column, Table

if TYPE_CHECKING:
    import polars

    from swashplate.crane.crane import Crane
    from swashplate.crane.stepper import Pose

Array = NDArray[np.float64]

CALMS, WATCHED = 4.0, 25.0
"""Residual swing counts from so long after the shaper's last impulse, for so long. [s]"""
SETTLED = 1.0
"""Swing below which a load counts as settled. [deg]"""


@dataclass(frozen=True, eq=False)
class CraneRun(Tabular):
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
    """Of the load and its hook. [kg]"""
    rows: tuple[str, ...] = field(default=ROWS, repr=False)
    """Columns of `out`."""

    figure = "plot_crane"

    def __repr__(self) -> str:
        return (
            f"CraneRun({self.crane.name!r}, {self.time[-1]:g} s, {self.actuation}, swing up to "
            f"{self.swing_deg.max():.3g} deg)"
        )

    def _rows(self, *names: str) -> Array:
        made = self.out[:, [self.rows.index(name) for name in names]]
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
    def load_torque(self) -> Array:
        """(n, 3) torques of the rope that the drives took, zero unless they are loaded. [N m]"""
        return self._rows(*TORQUES) if TORQUES[0] in self.rows else np.zeros((len(self.out), 3))

    @cached_property
    def hook(self) -> Array:
        """(n, 3) hook, or the load where there is none. [m]"""
        return self._rows(*HOOK) if HOOK[0] in self.rows else self.load

    @property
    def stretch(self) -> Array:
        """(n,) what the tension has added to the rope's length. [m]"""
        return np.asarray(np.linalg.norm(self.hook - self.tip, axis=1) - self.rope)

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
            torque = self.load_torque[:, AXES.index(axis)] if TORQUES[0] in self.rows else None
            self._drives[axis] = found.simulate(volts, self.rate, load_torque=torque)
        return self._drives[axis]

    @cached_property
    def _drives(self) -> dict[str, Simulation]:
        return {}

    def limits(self, axis: str) -> dict[str, float]:
        """Share of time for which each limit of a drive acts, by name, 0 to 1."""
        run = self.drive(axis)
        return {each.name.lower(): float(run.active(each).mean()) for each in Limit if each.name}

    def tables(self) -> list[Table]:
        """What the run amounts to, and what limits its drives."""
        runs = {self.actuation: self}
        return [run_table(runs), *([] if self.actuation == "ideal" else [limit_table(runs)])]

    def to_polars(self) -> polars.DataFrame:
        """All signals, a row for each sample, in SI."""
        import polars as pl

        columns = {"time": self.time}
        columns |= {f"stick_{axis}": self.stick[:, i] for i, axis in enumerate(AXES)}
        columns |= {name: self.out[:, i] for i, name in enumerate(self.rows)}
        columns["swing"] = np.radians(self.swing_deg)
        return pl.DataFrame(columns)


def run_table(runs: Mapping[str, CraneRun]) -> Table:
    """What runs amount to, a row for each by its name: swing, where they end, slack.

    The residual swing is empty where a run is too short for it.
    """
    columns = (
        Column("run"),
        Column("residual", ".2f", "rad", none="–", key="residual_swing"),
        Column("rms", ".2f", "rad", key="rms_swing"),
        Column("largest", ".2f", "rad", of="pf", key="largest_swing"),
        Column("slew", ".2f", "rad"),
        Column("boom", ".2f", "rad"),
        Column("rope", ".2f", "m"),
        Column("slack", ".1%", of="pf"),
    )
    made = Table("", columns, "Swing, and where slew, boom and rope end")
    for name, run in runs.items():
        late = run.settling_starts > run.time[-1]
        angles = (
            np.nan if late else run.residual_deg,
            run.rms_deg(),
            run.swing_deg.max(),
            run.slew_deg[-1],
            run.boom_deg[-1],
        )
        numbers = [float(np.radians(each)) for each in angles]
        made.add(name, *numbers, float(run.rope[-1]), float(run.slack.mean()))
    return made


def limit_table(runs: Mapping[str, CraneRun]) -> Table:
    """Share of time for which limits of the drives act, a row for each run and axis.

    Ideal drives are left out.
    """
    shown = (Limit.CURRENT_RATE, Limit.ORIFICE, Limit.SWASH_STOP)
    heads = ("current rate", "orifice", "swash stop")
    columns = (Column("run"), Column("axis"), *(Column(each, ".1%") for each in heads))
    made = Table("Share of time for which limits act", columns)
    for name, run in runs.items():
        for axis in AXES if run.actuation != "ideal" else ():
            shares = run.limits(axis)
            made.add(name, axis, *(shares[str(each.name).lower()] for each in shown))
    return made
