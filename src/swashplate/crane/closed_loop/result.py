"""Runs of a crane: signals with units, and what they amount to."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf, pi, sqrt
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from swashplate.crane.axes import AXES, RATE, check_names
from swashplate.crane.closed_loop.signals import ROWS, Signals
from swashplate.crane.closed_loop.stepper import Fixed
from swashplate.crane.crane import Crane
from swashplate.crane.rope import GRAVITY, in_ship_axes, rope_leads, swing_of
from swashplate.crane.sea.transfer_functions import MOTIONS
from swashplate.drive import Limit, Simulation
from swashplate.errors import InputError
from swashplate.results import Named, Tabular, figures
from swashplate.tables import Column, Table

if TYPE_CHECKING:
    import polars

    from swashplate.results import Figure

Array = NDArray[np.float64]

CALMS = 4.0
"""Time after the shaper's last impulse from which residual swing counts. [s]"""
WATCHED = 25.0
"""Time for which residual swing counts. [s]"""
FARTHEST_SWING = 30.0
"""Swing beyond which a run is not an operation any more: the model is a mass on a free rope, and
nobody goes on with a load that swings beyond it. [deg]"""
IN_WATER = "the load is in the water"
IN_DECK = "the load is in the deck"
LOOK = 32
"""Every so many samples the swing and the position of the load are looked at: 16 a second."""
SETTLED = 1.0
"""Swing below which a load counts as settled. [deg]"""
PUMPS = (Limit.DEAD_ZONE, Limit.ORIFICE, Limit.SPOOL, Limit.SWASH_STOP, Limit.RELIEF)
"""Limits that the loop stores of each drive, in the order of its bits."""

THREES = {
    "tip": "tip",
    "load": "load",
    "hook": "hook",
    "voltage": "voltage",
    "shaft_speed": "speed",
    "load_torque": "torque",
}
"""Signals of three columns, and how their names in `ROWS` begin."""


class Departure(NamedTuple):
    """When and why a run left what the model holds for."""

    time: float
    """[s]"""
    reason: str


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
    stored: Array = field(repr=False)
    """Stored signals of each sample, by `fixed.columns`, SI."""
    fixed: Fixed = field(repr=False)
    """Constants of the run: home, mass of load and hook, settings of the controller."""
    stick_end: float
    """When the last command has returned to zero. [s]"""

    rows = ROWS

    def __post_init__(self) -> None:
        self.stored.flags.writeable = False

    def __repr__(self) -> str:
        return (
            f"CraneRun({self.crane.name!r}, {self.time[-1]:g} s, {self.actuation}, swing up to "
            f"{self.swing_deg.max():.3g} deg)"
        )

    def __getitem__(self, signal: str) -> Array:
        """(n,) signal by its name in `rows`, or (n, 3) of `THREES`; an `InputError` for another."""
        if signal in THREES:
            return self._signals.three(THREES[signal])
        check_names("A crane's run has no signal", [signal], ROWS, "it has")
        return self._signals[signal]

    @cached_property
    def _signals(self) -> Signals:
        return Signals(self.stored, self.fixed.columns)

    @cached_property
    def out(self) -> Array:
        """(n, 28) all signals, a column for each name in `rows`, SI."""
        table = self._signals.table()
        table.flags.writeable = False
        return table

    tip = Named()
    """(n, 3) tip of the boom. [m]"""
    load = Named()
    """(n, 3) load. [m]"""
    hook = Named()
    """(n, 3) hook, or the load if there is none. [m]"""
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
        """Actuation that turned reference speeds into speeds, as of `RunOptions`."""
        return self.fixed.actuation

    @cached_property
    def time(self) -> Array:
        """(n,) [s]"""
        return np.arange(len(self.stored)) / RATE

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
        """(n,) tension of the rope, 0 while it is slack. [N]"""
        return self.fixed.mass * self["pull"]

    @property
    def dynamic_factor(self) -> Array:
        """(n,) tension of the rope over the weight of load and hook.

        With a rigid rope it is NaN from the first snap on, see `snap`.
        """
        factor = self["pull"] / GRAVITY
        if self._rigid and self._snaps.size:
            factor[self._snaps[0] :] = np.nan
        return np.asarray(factor)

    @property
    def _rigid(self) -> bool:
        return self.fixed.hanging.stiffness == 0.0

    @cached_property
    def _snaps(self) -> NDArray[np.int64]:
        """Samples in which a slack rope snaps taut."""
        return 1 + np.flatnonzero(self.slack[:-1] & ~self.slack[1:])

    @property
    def snap(self) -> float | None:
        """Largest tension from the first moment on at which a slack rope snaps taut. [N]

        0 if it never snaps. None if a rigid rope snaps: that tension would depend on the time step,
        so it is not computed; give the rope a `Suspension.stiffness`.
        """
        if not self._snaps.size:
            return 0.0
        if self._rigid:
            return None
        return float(self.tension[self._snaps[0] :].max())

    @property
    def stretch(self) -> Array:
        """(n,) elongation of the rope by its tension. [m]"""
        return np.asarray(np.linalg.norm(self.hook - self.tip, axis=1) - self.rope)

    @property
    def slack(self) -> NDArray[np.bool_]:
        """(n,) whether the rope is slack."""
        return self["pull"] <= 0.0

    @cached_property
    def swing_deg(self) -> Array:
        """(n,) angle between rope and plumb line. [deg]"""
        return np.degrees(swing_of(self.load, self.tip))

    @cached_property
    def _leads_deg(self) -> Array:
        slew = self.fixed.home.slew + self["shaft_slew"]
        return np.degrees(rope_leads(self.hook - self.tip, slew, self.ship))

    @property
    def off_lead_deg(self) -> Array:
        """(n,) angle of the rope in the crane's own axes, positive outwards along the boom.

        The crane's axes turn with slew, roll and pitch, so a list of the ship is in it. [deg]
        """
        return self._leads_deg[:, 0]

    @property
    def side_lead_deg(self) -> Array:
        """(n,) angle of the rope likewise, across the boom, positive to starboard of it. [deg]"""
        return self._leads_deg[:, 1]

    @property
    def hook_velocity(self) -> Array:
        """(n,) vertical velocity of the hook, inertial, positive upwards. [m/s]"""
        return np.asarray(np.gradient(self.hook[:, 2], 1.0 / RATE))

    @cached_property
    def departure(self) -> Departure | None:
        """When and why a run is not an operation any more; None if it stays one.

        The first time at which the load swings beyond 30 degrees, the rope is slack or lies on the
        boom, or the load is in the water, or in the deck if the crane's file has one. The load is a
        point, and nothing that stands on the deck is known. Control changes the speed of ideal
        drives instantaneously, which slackens any rope for a moment: that is not looked at.
        """
        looked_at = slice(None, None, LOOK)
        tip = self.tip[looked_at]
        hook = self.hook[looked_at]
        load = self.load[looked_at]
        ship = self.ship[looked_at]
        slew = self.fixed.home.slew + self["shaft_slew"][looked_at]
        inboard = -rope_leads(hook - tip, slew, ship)[:, 0]
        seen = replace(self._signals, stored=self.stored[looked_at])
        boom = np.arctan2(seen["boom_sin"], seen["boom_cos"])
        beyond = np.degrees(swing_of(load, tip)) > FARTHEST_SWING
        times = {
            f"the load swings beyond {FARTHEST_SWING:g} deg": _first(beyond, LOOK),
            "the rope touches the boom": _first(inboard >= 0.5 * pi - boom, LOOK),
            IN_WATER: _first(load[:, 2] < 0.0, LOOK),
        }
        deck = self.crane.deck
        if deck is not None:
            aboard = in_ship_axes(load, ship)
            below = (aboard[:, 2] < deck.height) & (np.abs(aboard[:, 1]) < deck.half_breadth)
            times[IN_DECK] = _first(below, LOOK)
        if not (self.actuation == "ideal" and self.fixed.settings.path):
            times["the rope is slack"] = _first(self.slack, 1)
        reason = min(times, key=times.__getitem__)
        return Departure(times[reason], reason) if np.isfinite(times[reason]) else None

    @property
    def settling(self) -> slice:
        """Samples in which residual swing counts.

        25 s from 4 s after the stick's end and the shaper's last impulse; an `InputError` if the
        run ends before.
        """
        halves = sum(impulse > 0.0 for impulse in self.fixed.settings.tip[1:])
        starts = self.stick_end + halves * pi * sqrt(self.rope[-1] / GRAVITY) + CALMS
        first = round(starts * RATE)
        if first >= len(self.stored):
            raise InputError(
                f"The run is {self.time[-1]:g} s long, but its residual swing is evaluated from "
                f"{starts:.4g} s on: use a longer stick."
            )
        return slice(first, first + round(WATCHED * RATE))

    @property
    def residual_deg(self) -> float:
        """Largest swing in `settling`; refused if the run is too short for it. [deg]"""
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
        bits = self[f"limits_{axis}"].astype(np.int64)
        return (bits >> PUMPS.index(limit)) & 1 > 0

    def limits(self, axis: str) -> dict[str, float]:
        """Share of time for which each limit of a drive acts, by name, 0 to 1."""
        return {str(limit.name).lower(): float(self.active(axis, limit).mean()) for limit in PUMPS}

    def drive(self, axis: str) -> Simulation:
        """The simulation of one drive, not an ideal one, under its voltages, with all signals."""
        if self.actuation == "ideal":
            raise InputError("Ideal drives have neither voltages nor limits other than of speed.")
        torque = self[f"torque_{axis}"] if self.fixed.loaded else None
        drive = getattr(self.crane, axis)
        simulation: Simulation = drive.simulate(self[f"voltage_{axis}"], RATE, load_torque=torque)
        return simulation

    def tables(self) -> list[Table]:
        """Tabulate the summary of the run and the limits that acted on its drives."""
        return run_tables({self.actuation: self})

    def sentences(self) -> tuple[str, ...]:
        """Why the run is not an operation any more, and what of it is not computed."""
        sentences = []
        lowest = float(self.load[:, 2].min())
        if lowest < 0.0:
            sentences.append(
                f"The load is down to z = {lowest:.1f} m, below the reference point of the ship's "
                "motion, near the waterline. The model has no water."
            )
        departure = self.departure
        if departure is not None and departure.reason != IN_WATER:
            sentences.append(
                f"From {departure.time:.2f} s on the run is no longer a valid operation: "
                f"{departure.reason}."
            )
        jumps = self.actuation == "ideal" and self.fixed.settings.path
        if self.snap is None and not jumps:
            sentences.append(
                f"The slack rope snaps taut at {self.time[self._snaps[0]]:.2f} s. With a rigid "
                "rope the resulting tension is not computed: use an elastic rope, "
                "suspension=Suspension(stiffness=6e7)."
            )
        return tuple(sentences)

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


def _first(happens: NDArray[np.bool_], every: int) -> float:
    """Time of the first of samples at which something happens [s]; inf if it never does."""
    first = int(np.argmax(happens))
    return first * every / RATE if happens[first] else inf


def named_runs(
    runs: CraneRun | Mapping[str, CraneRun], most: int, shown: str
) -> dict[str, CraneRun]:
    """Runs by their names; a single one is named by its actuation.

    Parameters
    ----------
    runs : CraneRun or mapping of str to CraneRun
    most : int
        How many can be shown.
    shown : str
        What shows them, as the error names it.

    Raises
    ------
    InputError
        If there is none, or more.
    """
    named = {runs.actuation: runs} if isinstance(runs, CraneRun) else dict(runs)
    if not 0 < len(named) <= most:
        raise InputError(f"{shown} shows 1 to {most} runs of a crane, not {len(named)}.")
    return named


def run_tables(runs: Mapping[str, CraneRun]) -> list[Table]:
    """Swing and end of runs, a row for each by its name; what limits their drives.

    The residual swing is empty if a run is too short for it; ideal drives have no limits.
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
    table = Table("", columns, "Swing, and final position of slew, boom and rope")
    shares = []
    for name, run in runs.items():
        try:
            residual = run.residual_deg
        except InputError:  # too short
            residual = np.nan
        swing = (residual, run.rms_deg(), run.swing_deg.max())
        angles = np.radians([*swing, run.slew_deg[-1], run.boom_deg[-1]])
        table.add(name, *angles.tolist(), float(run.rope[-1]), float(run.slack.mean()))
        if run.actuation != "ideal":
            shares += [(name, axis, run.limits(axis).values()) for axis in AXES]
    return [table, limit_table(shares)] if shares else [table]


def limit_table(rows: Iterable[tuple[str, str, Iterable[float]]]) -> Table:
    """Share of time for which limits act: of a name and an axis, in the order of `PUMPS`."""
    headings = [str(limit.name).lower().replace("_", " ") for limit in PUMPS]
    numbers = [Column(heading, ".1%", none="–") for heading in headings]
    columns = (Column("variant", wrap=True), Column("axis"), *numbers)
    note = "dead zone: the current is within that of the solenoids"
    table = Table("Share of time for which limits act", columns, note)
    for name, axis, shares in rows:
        table.add(name, axis, *shares)
    return table
