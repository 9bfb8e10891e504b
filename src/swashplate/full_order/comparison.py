"""One run of the full-order model beside the one-state model under the same current.

The reduced model is marched in fine steps, so that what is compared are the equations: its own step
error at 512 Hz is given beside.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.record import SOURCE_RATE, least_substeps
from swashplate.equations.run import Start
from swashplate.full_order.drive import FullOrderDrive, Method
from swashplate.full_order.result import FullOrderSimulation
from swashplate.simulation.result import read_only

if TYPE_CHECKING:
    import polars

    from swashplate.simulation.result import Simulation

Array = NDArray[np.float64]

FINE_STEPS = 64
"""Steps a sample of the reduced model, whose march is of first order."""
LEAST_FINE_STEPS = 4
MOST_STEPS = 20_000_000
"""Steps of a whole record, beyond which a sample gets fewer than `FINE_STEPS`."""
STILL = 1e-6
"""Top speed up to which a drive does not move. [rad/s]"""
BANDS = (0.001, 0.01)
"""Differences, over the largest speed, that the table sorts by."""


@dataclass(frozen=True)
class Difference:
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


class Lag(NamedTuple):
    """How much later the full-order model's speed comes, as if that were all the difference."""

    time: float
    """Positive where the full-order model comes later. [s]"""
    share: float
    """Share of the mean squared difference that it explains. [1]"""


@dataclass(frozen=True, eq=False)
class Comparison:
    """Both models over one command, driven by the same current."""

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

    @cached_property
    def lag(self) -> Lag | None:
        """The lag that explains most of the difference, by least squares; None at a constant speed.

        A speed that comes later by a time T is less by T times its acceleration.
        """
        if self.time.size < 2:
            return None
        acceleration = np.gradient(self.full.shaft_speed, 1.0 / self.full.record.rate)
        error, power = self.error, float(acceleration @ acceleration)
        whole = float(error @ error)
        if not self.difference.moves or power == 0.0 or whole == 0.0:
            return None
        time = float(error @ acceleration) / power
        rest = error - time * acceleration
        return Lag(time, 1.0 - float(rest @ rest) / whole)

    def to_polars(self) -> polars.DataFrame:
        """Table of the full-order model's signals, with command and reduced model's speed."""
        import polars as pl

        made = self.full.to_polars().with_columns(
            pl.Series("reduced_shaft_speed", self.reduced_speed)
        )
        if self.voltage is not None:
            made.insert_column(1, pl.Series("voltage", self.voltage))
        return made

    def write(self, path: str | Path) -> None:
        """Write the table of `to_polars` as CSV or Parquet, by the path's ending.

        Raises
        ------
        FileError
            For another ending, or a folder that cannot be written.
        """
        from swashplate.tables import write_table

        write_table(self.to_polars(), path)


def compare(
    full: FullOrderDrive, run: Simulation, *, start: Start = "rest", method: Method = "march"
) -> Comparison:
    """Simulate both models over the current of a run.

    Parameters
    ----------
    full : FullOrderDrive
        The full-order model; the reduced one has its lumps.
    run : Simulation
        Of ``full.drive`` over a command; its current drives both models.
    start, method :
        As in `FullOrderDrive.simulate_current`.
    """
    followed = full.follow(run, method=method, start=start)
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
