"""The drive with five states beside the one with one state, under the same current.

`compare` has one run, `validity` a table of maneuvers for which one state does, and `convergence`
shows that it is the limit of five. The reduced model is marched in fine steps, so that what is
compared are the equations: its own step error at 512 Hz is given beside.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate import maneuvers
from swashplate.equations.marching.record import SOURCE_RATE, least_substeps
from swashplate.equations.marching.run import Start
from swashplate.full_order.drive import FullOrderDrive, FullOrderSimulation
from swashplate.results import Result, Tabular
from swashplate.simulation.result import read_only
from swashplate.tables import Cell, Column, Table
from swashplate.units import display_unit

if TYPE_CHECKING:
    import polars

    from swashplate.maneuvers import Maneuver
    from swashplate.simulation.result import Simulation

Array = NDArray[np.float64]

FINE_STEPS = 64  # Steps a sample of the reduced model, whose march is of first order.
LEAST_FINE_STEPS = 4
MOST_STEPS = 20_000_000
"""Steps of a whole record, beyond which a sample gets fewer than `FINE_STEPS`."""
STILL = 1e-6  # Top speed up to which a drive does not move. [rad/s]
BANDS = (0.001, 0.01)  # Differences, over the largest speed, that the table sorts by.
TABLE_MANEUVERS: tuple[tuple[str, Maneuver], ...] = (
    ("step 1 V", maneuvers.step(1.0, start=1.0, length=10.0)),
    ("step 2 V", maneuvers.step(2.0, start=1.0, length=10.0)),
    ("step 4 V", maneuvers.step(4.0, start=1.0, length=10.0)),
    ("step 9 V", maneuvers.step(9.0, start=1.0, length=10.0)),
    ("step -9 V", maneuvers.step(-9.0, start=1.0, length=10.0)),
    ("ramp 1 V/s", maneuvers.ramp(1.0)),
    *(
        (
            f"sine 6.5 V {frequency:g} Hz",
            maneuvers.sine(
                6.5, frequency, settle=None, length=max(10.0, ceil(4.0 + 2.0 / frequency))
            ),
        )
        for frequency in (0.05, 0.1, 0.3, 1.0, 3.0)
    ),
)
"""Maneuvers of the table of the reduction's validity."""


@dataclass(frozen=True)
class Difference(Result):
    """Difference in shaft speed of the reduced model to the full-order one."""

    largest: float
    """[rad/s]"""
    rms: float
    """[rad/s]"""
    top_speed: float
    """Largest speed of the full-order model. [rad/s]"""
    step_error: float
    """Largest error of the reduced model's march at its usual step, for comparison. [rad/s]"""

    @property
    def moves(self) -> bool:
        """Whether the full-order model moves at all."""
        return self.top_speed > STILL

    @property
    def relative(self) -> float:
        """Largest difference over the largest speed. [1]"""
        return self.largest / self.top_speed if self.top_speed > 0.0 else self.largest

    @property
    def within(self) -> float | None:
        """Smallest of `BANDS` that holds the difference, None beyond all of them."""
        return next((band for band in BANDS if self.relative <= band), None)


@dataclass(frozen=True, eq=False)
class Comparison(Tabular):
    """Both models over one command, driven by the same current."""

    figure = "plot_full_order"

    full: FullOrderSimulation
    reduced_speed: Array
    """Shaft speed of the reduced model, marched in fine steps. [rad/s]"""
    difference: Difference
    voltage: Array | None
    """Command, None where a current was given instead. [V]"""

    @property
    def time(self) -> Array:
        """Time stamps. [s]"""
        return self.full.time

    @property
    def error(self) -> Array:
        """Speed of the reduced model less that of the full-order one. [rad/s]"""
        return self.reduced_speed - self.full.shaft_speed

    def to_polars(self) -> polars.DataFrame:
        """Table of the full-order model's signals, with command and reduced model's speed."""
        import polars as pl

        made = self.full.to_polars().with_columns(
            pl.Series("reduced_shaft_speed", self.reduced_speed)
        )
        if self.voltage is not None:
            made.insert_column(1, pl.Series("voltage", self.voltage))
        return made


def compare(full: FullOrderDrive, run: Simulation, *, start: Start = "rest") -> Comparison:
    """Simulate both models over the current of a run of ``full.drive``.

    The reduced model has the lumps of the full-order one; `start` as in
    `FullOrderDrive.simulate_current`.
    """
    followed = full.follow(run, start=start)
    reference, record = followed.shaft_speed, followed.record
    reduced, grid_rate = full.reduced, record.rate * record.substeps

    def speed(substeps: int) -> Array:
        made = reduced.simulate_current(record.values, grid_rate, start=start, substeps=substeps)
        return np.ascontiguousarray(made.shaft_speed[:: record.substeps])

    least = least_substeps(grid_rate)
    fine = speed(max(fine_steps(grid_rate, record.values.size), least))
    error = fine - reference
    found = Difference(
        float(np.abs(error).max()),
        float(np.sqrt(np.mean(error**2))),
        float(np.abs(reference).max()),
        float(np.abs(speed(least) - fine).max()),
    )
    return Comparison(followed, read_only(fine), found, run.voltage)


def fine_steps(rate: float, samples: int) -> int:
    """Steps a sample of the reduced model: as short as `FINE_STEPS` at 512 Hz, or nearly.

    A very long record gets fewer, so that it can be simulated at all.
    """
    wanted = ceil(FINE_STEPS * SOURCE_RATE / rate)
    return max(min(wanted, MOST_STEPS // samples), LEAST_FINE_STEPS)


def convergence(
    full: FullOrderDrive,
    voltage: ArrayLike,
    epsilons: Sequence[float] = (1.0, 0.25, 0.0625, 0.015625, 0.00390625),
    rate: float = SOURCE_RATE,
) -> list[tuple[float, Difference]]:
    """Differences as inertias shrink with ε and dampings with √ε: they shrink like √ε.

    Under a command [V] at a rate [Hz], for some ε above 0.
    """
    drives = [full.scaled(epsilon) for epsilon in epsilons]
    found = [compare(each, each.drive.simulate(voltage, rate)).difference for each in drives]
    return list(zip(epsilons, found, strict=True))


def validity(
    full: FullOrderDrive, rate: float = SOURCE_RATE, *, begin: Callable[[str], object] | None = None
) -> Table:
    """For which of `TABLE_MANEUVERS` the one-state model is within 1 % and 0.1 %, for one drive.

    A row for each maneuver: top speed, largest and rms difference and step error in percent of it,
    and whether the largest difference is within 1 % and 0.1 %; none where the drive does not move.
    `begin` is called with the name of each maneuver before it is simulated.
    """
    made = Table(
        "Reduced model less full-order one, in % of the top speed",
        (
            Column("axis", of="f"),
            Column("Maneuver", key="maneuver"),
            Column("top", ".2f", "rad/s", key="top_speed"),
            Column("largest", ".2f", key="largest_percent"),
            Column("rms", ".2f", key="rms_percent"),
            Column(f"step error at {usual_rate(rate):g} Hz", ".2f", key="step_error_percent"),
            Column("within", key="within_1_percent"),
            Column("within_0_1_percent", of="f"),
        ),
    )
    for title, maneuver in TABLE_MANEUVERS:
        if begin is not None:
            begin(title)
        found = compare(full, full.drive.simulate(maneuver.sample(rate), rate)).difference
        top, percent = found.top_speed, 100.0 / found.top_speed if found.moves else None
        shares = (found.largest, found.rms, found.step_error)
        numbers = (None if percent is None else share * percent for share in shares)
        within = [found.relative <= band if found.moves else None for band in reversed(BANDS)]
        words = "does not move" if not found.moves else "1 %" if within[0] else "no"
        words = "0.1 %" if within[1] else words
        made.add(full.physical.name, title, top, *numbers, Cell(within[0], words), within[1])
    return made


# --- tables and verdicts --------------------------------------------------------------------------


def usual_rate(rate: float) -> float:
    """Steps a second of the reduced model's march at a rate of samples. [Hz]"""
    return rate * least_substeps(rate)


def modes_table(full: FullOrderDrive) -> Table:
    """Natural modes at rest."""
    modes = full.modes()
    heads = (Column("Mode"), Column("Hz", ".4g"), Column("damping", ".3f"), Column(""))
    made = Table("Modes at rest", heads)
    slow = f"τ = {-1.0 / modes.slow.real:.4g} s, " if modes.slow.real < 0.0 else ""
    for name, mode, words in (
        ("spool", modes.spool, "on its feedback spring"),
        ("swash plate", modes.swash, "on its spring and the trapped oil"),
        ("swash plate, held pressure", modes.swash_at_held_pressure, "on its spring alone"),
        ("slow pole", modes.slow, f"{slow}which one state keeps"),
    ):
        made.add(name, modes.frequency_hz(mode), modes.damping_ratio(mode), words)
    return made


def comparison_table(found: Comparison) -> Table:
    """Both models under one command."""
    differ = found.difference
    columns = (Column("Shaft speed"), Column("", ".4f", "rad/s"), Column("% of top speed", ".3f"))
    made = Table("Reduced model less full-order one", columns)
    top, steps = differ.top_speed, usual_rate(found.full.record.rate)
    made.add("top speed", Cell(top, f"{display_unit('rad/s').factor * top:.2f}"), None)
    for name, value in (
        ("largest difference", differ.largest),
        ("rms difference", differ.rms),
        (f"step error of the march at {steps:g} Hz", differ.step_error),
    ):
        made.add(name, value, 100.0 * value / top if differ.moves else None)
    for band in reversed(BANDS) if differ.moves else ():
        made.add(f"within {100.0 * band:g} %", None, "yes" if differ.relative <= band else "no")
    drop = 1e-6 * found.full.motor_pressure_drop
    ends = (Cell(drop.min(), f"{drop.min():z.3f}"), f"to {drop.max():z.3f}")
    made.add("motor pressure drop, MPa", *ends, section=True)
    return made


def comparison_verdict(found: Comparison) -> list[str]:
    """Whether one state is enough under a command, and what it leaves out."""
    differ = found.difference
    if not differ.moves:
        return ["The shaft does not move under this command, so nothing can be said of one state."]
    largest, rms = (
        f"{100.0 * each / differ.top_speed:.2f} %" for each in (differ.largest, differ.rms)
    )
    if differ.within is not None:
        said = (
            f"One state is enough here: within {100.0 * differ.within:g} % of the top speed, at "
            f"most {largest} and {rms} rms off."
        )
    else:
        said = (
            f"One state is not enough here: up to {largest} of the top speed off, {rms} rms, where "
            "1 % is allowed."
        )
    left_out = "the masses of spool and swash plate, and the motor's pressure drop"
    return [said, f"It leaves out {left_out}."]


def validity_verdict(table: Table) -> str:
    """For how many of the maneuvers of `validity` one state is enough, and for which it is not."""
    found = table.to_polars()
    moving = found.filter(found["within_1_percent"].is_not_null())
    if not moving.height:
        return "The shaft does not move under any of these, so nothing can be said of one state."
    beyond = moving.filter(~moving["within_1_percent"])["maneuver"].to_list()
    if not beyond:
        return "One state is enough for all of these that move the drive, to 1 % of the top speed."
    if len(beyond) == moving.height:
        return "One state is enough for none of these, to 1 % of the top speed."
    within = moving.height - len(beyond)
    return (
        f"One state is enough for {within} of {moving.height}, to 1 % of the top speed; not for "
        f"{', '.join(beyond)}."
    )
