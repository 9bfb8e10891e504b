"""Checks of the one-state model against the full-order one.

Both are driven by the same current. The reduced model is marched in fine steps, so that what is
compared are the equations: its own step error at 512 Hz is given beside.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import ceil
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate import maneuvers
from swashplate.full_order.drive import FullOrderDrive
from swashplate.simulation.record import SOURCE_RATE

if TYPE_CHECKING:
    import polars

    from swashplate.maneuvers import Maneuver

Array = NDArray[np.float64]

FINE_STEPS = 64
"""Steps a sample of the reduced model, whose march is of first order."""
BANDS = (0.001, 0.01)
"""Differences, over the largest speed, that the table sorts by."""

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
"""Manoeuvres of the table of the reduction's validity."""


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
    """Largest error of the reduced model's march at 512 Hz, for comparison. [rad/s]"""

    @property
    def relative(self) -> float:
        """Largest difference over the largest speed. [1]"""
        return self.largest / self.top_speed if self.top_speed > 0.0 else self.largest

    @property
    def within(self) -> float | None:
        """Smallest of `BANDS` that holds the difference, None beyond all of them."""
        return next((band for band in BANDS if self.relative <= band), None)


def difference(full: FullOrderDrive, voltage: ArrayLike, rate: float = SOURCE_RATE) -> Difference:
    """Compare both models over a command [V].

    Parameters
    ----------
    full : FullOrderDrive
        The full-order model; the reduced one has its lumps.
    voltage : (n,) array_like
        Command. [V]
    rate : float
        Samples a second. [Hz]
    """
    current = full.drive.simulate(voltage, rate).current
    reference = full.simulate_current(current, rate).shaft_speed
    reduced = full.reduced
    fine = reduced.simulate_current(current, rate, substeps=FINE_STEPS).shaft_speed
    usual = reduced.simulate_current(current, rate).shaft_speed
    error = fine - reference
    return Difference(
        float(np.abs(error).max()),
        float(np.sqrt(np.mean(error**2))),
        float(np.abs(reference).max()),
        float(np.abs(usual - fine).max()),
    )


def convergence(
    full: FullOrderDrive,
    voltage: ArrayLike,
    epsilons: Sequence[float] = (1.0, 0.25, 0.0625, 0.015625, 0.00390625),
    rate: float = SOURCE_RATE,
) -> list[tuple[float, Difference]]:
    """Differences as inertias shrink with ε and dampings with √ε: they shrink like √ε.

    Parameters
    ----------
    epsilons : sequence of float
        Each above 0.
    full, voltage, rate :
        As in `difference`.
    """
    return [(epsilon, difference(full.scaled(epsilon), voltage, rate)) for epsilon in epsilons]


def validity_table(
    names: Iterable[str] = ("hoist", "slew", "luff"), rate: float = SOURCE_RATE
) -> polars.DataFrame:
    """For which manoeuvres the one-state model is within 1 % and 0.1 % of the full-order one.

    Parameters
    ----------
    names : iterable of str
        Axes, with their assumed physical sets.

    Returns
    -------
    polars.DataFrame
        A row for each axis and manoeuvre: largest and rms difference and step error in percent of
        the largest speed, and whether the largest difference is within 1 % and 0.1 %.
    """
    import polars as pl

    rows = []
    for name in names:
        full = FullOrderDrive.preset(name)
        for title, maneuver in TABLE_MANEUVERS:
            found = difference(full, maneuver.sample(rate), rate)
            percent = 100.0 / found.top_speed
            rows.append(
                {
                    "axis": name,
                    "maneuver": title,
                    "largest_percent": found.largest * percent,
                    "rms_percent": found.rms * percent,
                    "step_error_percent": found.step_error * percent,
                    "within_1_percent": found.relative <= BANDS[1],
                    "within_0_1_percent": found.relative <= BANDS[0],
                }
            )
    return pl.DataFrame(rows)
