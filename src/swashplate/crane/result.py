"""Runs of a crane: signals with units, and what they amount to."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import pi, sqrt
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from swashplate.crane.axes import AXES, RATE, check_names
from swashplate.crane.crane import Crane
from swashplate.crane.loop import ROWS, Fixed
from swashplate.crane.rope import GRAVITY, swing_of
from swashplate.crane.stepper import ACTUATIONS
from swashplate.crane.transfer_functions import MOTIONS
from swashplate.errors import InputError
from swashplate.results import Tabular, figures
from swashplate.simulation.result import Limit, Named, Simulation
from swashplate.tables import Column, Table

if TYPE_CHECKING:
    import polars
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

CALMS, WATCHED = 4.0, 25.0
"""Residual swing counts from so long after the shaper's last impulse, for so long. [s]"""
SETTLED = 1.0
"""Swing below which a load counts as settled. [deg]"""
PUMPS = (Limit.DEAD_ZONE, Limit.ORIFICE, Limit.SPOOL, Limit.SWASH_STOP, Limit.RELIEF)
"""Limits that the loop leaves of each drive, in the order of its bits."""

THREES = {
    **{"tip": "tip_x", "load": "load_x", "hook": "hook_x", "voltage": "voltage_hoist"},
    **{"shaft_speed": "speed_hoist", "load_torque": "torque_hoist"},
}
"""Signals of three neighbours of `ROWS`, by the first of them."""


@dataclass(frozen=True, eq=False)
class CraneRun(Tabular):
    """Signals of one run at 512 Hz, each by its name in `rows`, SI: ``run["pull"]``.

    Positions are inertial, z up, in m.
    """

    crane: Crane = field(repr=False)
    stick: Array
    """(n, 3) commands of hoist, slew and luff, -1 to 1."""
    ship: Array
    """(n, 6) surge, sway, heave [m], roll, pitch, yaw [rad]; (n, 1) zeros for a ship at rest."""
    out: Array = field(repr=False)
    """(n, 28) signals by `loop.ROWS`, SI."""
    fixed: Fixed = field(repr=False)
    """What stayed as it was: home, mass of load and hook, settings of the controller."""
    stick_end: float
    """When the last command has returned to zero. [s]"""

    rows = ROWS

    def __post_init__(self) -> None:
        self.out.flags.writeable = False

    def __repr__(self) -> str:
        return (
            f"CraneRun({self.crane.name!r}, {self.time[-1]:g} s, {self.actuation}, swing up to "
            f"{self.swing_deg.max():.3g} deg)"
        )

    def __getitem__(self, signal: str) -> Array:
        """(n,) signal by its name in `rows`, or (n, 3) of `THREES`; an `InputError` for another."""
        first = THREES.get(signal, signal)
        check_names("A crane's run has no signal", [first], ROWS, "it has")
        place = ROWS.index(first)
        return self.out[:, place : place + 3] if signal in THREES else self.out[:, place]

    tip = Named()
    """(n, 3) tip of the boom. [m]"""
    load = Named()
    """(n, 3) load. [m]"""
    hook = Named()
    """(n, 3) hook, or the load where there is none. [m]"""
    voltage = Named()
    """(n, 3) commands of the drives, zero with ideal ones. [V]"""
    shaft_speed = Named()
    """(n, 3) speeds of the shafts; the slew's at the turret, the hoist's braked. [rad/s]"""
    load_torque = Named()
    """(n, 3) torques of the rope that the drives took, zero unless they are loaded. [N m]"""
    rope = Named()
    """(n,) rope below the tip. [m]"""

    def plot(
        self, *, sea: Mapping[str, CraneRun] | None = None, title: str | None = None
    ) -> Figure:
        """Figure of swing, slew and boom, and when limits of the drives act.

        With `sea` as of `swashplate.report.figures.plot_crane`, which draws several runs, too.
        """
        return cast("Figure", figures().plot_crane(self, sea=sea, title=title))

    @property
    def actuation(self) -> str:
        """What made speeds of wanted speeds, as of `Setup`."""
        return ACTUATIONS[self.fixed.actuation]

    @cached_property
    def time(self) -> Array:
        """(n,) [s]"""
        return np.arange(len(self.out)) / RATE

    @cached_property
    def slew_deg(self) -> Array:
        """(n,) slew from forward, positive to starboard. [deg]"""
        return np.degrees(self.fixed.home.slew + self["shaft_slew"])

    @cached_property
    def boom_deg(self) -> Array:
        """(n,) elevation of the boom. [deg]"""
        return np.degrees(np.arctan2(self["boom_sin"], self["boom_cos"]))

    @property
    def tension(self) -> Array:
        """(n,) tension of the rope, 0 where it is slack. [N]"""
        return self.fixed.mass * self["pull"]

    @property
    def stretch(self) -> Array:
        """(n,) what the tension has added to the rope's length. [m]"""
        return np.asarray(np.linalg.norm(self.hook - self.tip, axis=1) - self.rope)

    @property
    def slack(self) -> NDArray[np.bool_]:
        """(n,) whether the rope is slack."""
        return self["pull"] <= 0.0

    @cached_property
    def swing_deg(self) -> Array:
        """(n,) angle between rope and plumb line. [deg]"""
        return np.degrees(swing_of(self.load, self.tip))

    @property
    def settling(self) -> slice:
        """Samples in which residual swing counts.

        25 s from 4 s after the stick's end and the shaper's last impulse; an `InputError` if the
        run ends before.
        """
        impulses = (*self.fixed.settings.joint[1:], *self.fixed.settings.tip[1:])
        halves = sum(each > 0.0 for each in impulses)
        starts = self.stick_end + halves * pi * sqrt(self.rope[-1] / GRAVITY) + CALMS
        first = round(starts * RATE)
        if first >= len(self.out):
            raise InputError(
                f"The run is {self.time[-1]:g} s long, but its residual swing counts from "
                f"{starts:.4g} s on: take a longer stick."
            )
        return slice(first, first + round(WATCHED * RATE))

    @property
    def residual_deg(self) -> float:
        """Largest swing in `settling`, refused as that. [deg]"""
        return float(self.swing_deg[self.settling].max())

    def rms_deg(self, start: float = 0.0) -> float:
        """Root mean square of the swing from a time [s] on. [deg]"""
        if not 0.0 <= start <= self.time[-1]:
            raise InputError(f"The run is {self.time[-1]:g} s long: there is no {start:g} s in it.")
        return float(np.sqrt(np.mean(self.swing_deg[round(start * RATE) :] ** 2)))

    @property
    def settled_at(self) -> float:
        """Last time at which the swing is above 1 degree; 0 if it never is. [s]"""
        return float(self.time[self.swing_deg > SETTLED].max(initial=0.0))

    def active(self, axis: str, limit: Limit) -> NDArray[np.bool_]:
        """(n,) samples at which a limit of `PUMPS` acts on the drive of an axis."""
        bits = self.out[:, ROWS.index(f"limits_{axis}")].astype(np.int64)
        return (bits >> PUMPS.index(limit)) & 1 > 0

    def limits(self, axis: str) -> dict[str, float]:
        """Share of time for which each limit of a drive acts, by name, 0 to 1."""
        return {str(each.name).lower(): float(self.active(axis, each).mean()) for each in PUMPS}

    def drive(self, axis: str) -> Simulation:
        """The simulation of one drive under its voltages, with all signals; not of ideal ones."""
        if self.actuation == "ideal":
            raise InputError("Ideal drives have neither voltages nor limits other than of speed.")
        torque = self[f"torque_{axis}"] if self.fixed.loaded else None
        drive = getattr(self.crane, axis)
        made: Simulation = drive.simulate(self[f"voltage_{axis}"], RATE, load_torque=torque)
        return made

    def tables(self) -> list[Table]:
        """What the run amounts to, and what limits its drives."""
        return run_tables({self.actuation: self})

    def sentences(self) -> tuple[str, ...]:
        """Where the load goes under water, as far as that is known."""
        lowest = float(self.load[:, 2].min())
        if lowest >= 0.0:
            return ()
        return (
            f"The load is down to z = {lowest:.1f} m, below the point of the ship that its motion "
            "is given for, near the waterline. Water is not in the model.",
        )

    def to_polars(self) -> polars.DataFrame:
        """All signals and the ship's motion, a row for each sample, in SI."""
        import polars as pl

        columns = {"time": self.time}
        columns |= {f"stick_{axis}": self.stick[:, i] for i, axis in enumerate(AXES)}
        columns |= {name: self[name] for name in ROWS}
        columns["swing"] = np.radians(self.swing_deg)
        moving = self.ship.shape[1] > 1
        columns |= {name: self.ship[:, i if moving else 0] for i, name in enumerate(MOTIONS)}
        return pl.DataFrame(columns)


def run_tables(runs: Mapping[str, CraneRun]) -> list[Table]:
    """Swing and end of runs, a row for each by its name; what limits their drives.

    The residual swing is empty where a run is too short for it; ideal drives have no limits.
    """
    columns = (
        Column("run", wrap=True),
        Column("residual", ".2f", "rad", none="–", key="residual_swing"),
        Column("rms", ".2f", "rad", key="rms_swing"),
        Column("largest", ".2f", "rad", of="pf", key="largest_swing"),
        Column("slew", ".2f", "rad"),
        Column("boom", ".2f", "rad"),
        Column("rope", ".2f", "m"),
        Column("slack", ".1%", of="pf"),
    )
    made, shares = Table("", columns, "Swing, and where slew, boom and rope end"), []
    for name, run in runs.items():
        try:
            residual = run.residual_deg
        except InputError:  # too short
            residual = np.nan
        swing = (residual, run.rms_deg(), run.swing_deg.max())
        angles = np.radians([*swing, run.slew_deg[-1], run.boom_deg[-1]])
        made.add(name, *angles.tolist(), float(run.rope[-1]), float(run.slack.mean()))
        if run.actuation != "ideal":
            shares += [(name, axis, run.limits(axis).values()) for axis in AXES]
    return [made, limit_table(shares)] if shares else [made]


def limit_table(rows: Iterable[tuple[str, str, Iterable[float]]]) -> Table:
    """Share of time for which limits act: of a name and an axis, in the order of `PUMPS`."""
    heads = [str(each.name).lower().replace("_", " ") for each in PUMPS]
    numbers = [Column(each, ".1%", none="–") for each in heads]
    columns = (Column("variant", wrap=True), Column("axis"), *numbers)
    said = "dead zone: the current is within that of the solenoids"
    made = Table("Share of time for which limits act", columns, said)
    for name, axis, shares in rows:
        made.add(name, axis, *shares)
    return made
