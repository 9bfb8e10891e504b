"""For which motions the one-state model does, and that it is the limit of the full-order one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from math import ceil
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate import maneuvers
from swashplate.equations.record import SOURCE_RATE
from swashplate.full_order.comparison import BANDS, Difference, compare
from swashplate.full_order.drive import FullOrderDrive

if TYPE_CHECKING:
    import polars

    from swashplate.maneuvers import Maneuver

Array = NDArray[np.float64]

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
VALIDITY = {
    "axis": str,
    "maneuver": str,
    "top_speed": float,
    "largest_percent": float,
    "rms_percent": float,
    "step_error_percent": float,
    "within_1_percent": bool,
    "within_0_1_percent": bool,
}
"""Columns of that table; the top speed is in rad/s."""


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
    return compare(full, full.drive.simulate(voltage, rate)).difference


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
        The rows of `validity` of each axis.
    """
    import polars as pl

    return pl.concat([validity(FullOrderDrive.preset(name), rate) for name in names])


def validity(
    full: FullOrderDrive,
    rate: float = SOURCE_RATE,
    *,
    begin: Callable[[str], object] | None = None,
) -> polars.DataFrame:
    """For which of `TABLE_MANEUVERS` the one-state model is within 1 % and 0.1 %, for one drive.

    Parameters
    ----------
    full : FullOrderDrive
        The full-order model; the reduced one has its lumps.
    begin : callable, optional
        Called with the name of each manoeuvre before it is simulated.

    Returns
    -------
    polars.DataFrame
        A row for each manoeuvre: top speed, largest and rms difference and step error in percent
        of it, and whether the largest difference is within 1 % and 0.1 %; null where the drive
        does not move.
    """
    import polars as pl

    rows = []
    for title, maneuver in TABLE_MANEUVERS:
        if begin is not None:
            begin(title)
        run = full.drive.simulate(maneuver.sample(rate), rate)
        found = compare(full, run).difference
        percent = 100.0 / found.top_speed if found.moves else None
        shares = (found.largest, found.rms, found.step_error)
        rows.append(
            (
                full.physical.name,
                title,
                found.top_speed,
                *(None if percent is None else share * percent for share in shares),
                *(found.relative <= band if found.moves else None for band in reversed(BANDS)),
            )
        )
    return pl.DataFrame(rows, schema=VALIDITY, orient="row")
