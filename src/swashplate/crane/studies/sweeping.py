"""Sweeps: the swing of several variants over a quantity, in the same seaways."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.crane.axes import check_names
from swashplate.crane.crane import Crane
from swashplate.crane.sea.seaway import HIGHEST, Seaway
from swashplate.crane.studies.changed_drives import with_design_change
from swashplate.crane.studies.spectral import linear_response
from swashplate.crane.studies.study import NO_CONTROL, Case, Controllers, Study
from swashplate.errors import InputError
from swashplate.results import Result, figures
from swashplate.tables import Column, Table

if TYPE_CHECKING:
    from swashplate.results import Figure
Array = NDArray[np.float64]


class Swept(NamedTuple):
    """A quantity that a sweep goes over."""

    points: tuple[float, ...]
    low: float
    high: float
    """Range of plausible points."""
    unit: str
    """In which points are given."""
    at: Callable[[Seaway, Case, float], tuple[Seaway, Case]]
    """Seaway and variant at a point."""


def _at_bearing(seaway: Seaway, case: Case, point: float) -> tuple[Seaway, Case]:
    return seaway, case.changed(slew_deg=point)


def _at_height(seaway: Seaway, case: Case, point: float) -> tuple[Seaway, Case]:
    return replace(seaway, sea=replace(seaway.spectrum, height=point)), case


def _at_orifice(seaway: Seaway, case: Case, point: float) -> tuple[Seaway, Case]:
    if case.options["control"] is None or not case.driven:
        return seaway, case  # no control and ideal drives do not know the orifice
    cranes = tuple(with_design_change(crane, "luff", {"orifice": point}) for crane in case.cranes)
    return seaway, case._replace(cranes=cranes)


SWEPT: Mapping[str, Swept] = {
    "bearing": Swept(tuple(range(0, 360, 15)), -720.0, 720.0, "deg", _at_bearing),
    "height": Swept((0.1, 0.2, 0.3, 0.45, 0.6, 0.9, 1.2), 0.001, HIGHEST, "m", _at_height),
    "orifice": Swept((0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 3.0, 5.0), 0.01, 100.0, "", _at_orifice),
}
"""Bearing of the boom, from the bow to starboard; significant height of the waves; factor on the
luff drive's in-line orifice under control."""
SEEDS = range(6)
"""Seaways of a sweep: an hour together."""


@dataclass(frozen=True, eq=False)
class Sweep(Result):
    """Swing of several variants over a quantity, in the same seaways."""

    over: str
    points: Array
    """(n,) bearings [rad], heights [m], factors on the orifice."""
    names: tuple[str, ...]
    values: Array = field(repr=False)
    """(seaways, n, variants) root mean square swing [rad]; NaN if the run left the model."""
    spectrum: Array = field(repr=False)
    """(n,) root mean square swing without control in the frequency domain [rad]; NaN if the swing
    is not damped."""
    crane: Crane = field(repr=False)
    seaway: Seaway = field(repr=False)

    def rms(self) -> Array:
        """(n, variants) root mean square over the seaways [rad]; NaN if a run left the model."""
        return np.asarray(np.sqrt(np.mean(self.values**2, axis=0)))

    def plot(self, *, title: str | None = None) -> Figure:
        """Figure of the swing over the quantity; `swashplate.report.figures.plot_sweep`."""
        return cast("Figure", figures().plot_sweep(self, title=title))

    def tables(self) -> list[Table]:
        """Root mean square swing."""
        unit = SWEPT[self.over].unit.replace("deg", "rad")
        columns = [Column(self.over, ".0f" if unit == "rad" else ".2f", unit)]
        columns += [Column(name, ".2f", "rad", none="left the model") for name in self.names]
        columns.append(Column(f"{NO_CONTROL}, by its spectrum", ".2f", "rad", none="–"))
        table = Table("Swing, RMS over seaways", columns)
        rows = zip(self.points.tolist(), self.rms().tolist(), self.spectrum.tolist(), strict=True)
        for point, row, spectrum in rows:
            table.add(point, *row, spectrum)
        return [table]


def sweep(
    crane: Crane,
    over: str,
    control: Controllers,
    *,
    points: ArrayLike | None = None,
    **study: Any,
) -> Sweep:
    """Swing over a quantity at some points of it, in the same seaways, by default six.

    Parameters
    ----------
    crane : Crane
    over : {"bearing", "height", "orifice"}
        Bearing of the boom from the bow to starboard [deg]; significant height of the waves [m], of
        whose sea period and peak factor count; factor on the luff drive's in-line orifice under
        control.
    points : array_like, optional
        Values of the quantity, in its unit; by default bearings every 15 deg, 7 heights, 8 factors.
    control, **study
        Controllers, seaways, drives, where each run begins: see `Study.of`.

    Raises
    ------
    InputError
        For a quantity that there is not, and points out of range.
    """
    check_names("There is no sweep over", [over], SWEPT)
    swept = SWEPT[over]
    grid = np.atleast_1d(np.asarray(swept.points if points is None else points, dtype=np.float64))
    if over == "bearing" and "slew_deg" in study:
        raise InputError("A sweep over the bearing sets slew_deg itself: leave it out.")
    if not (grid.size and (swept.low <= grid).all() and (grid <= swept.high).all()):
        raise InputError(
            f"Points of the {over} must be one or more numbers from {swept.low:g} to "
            f"{swept.high:g} {swept.unit}".rstrip()
            + "."
        )
    swept_study = Study.of(crane, control, **{"seeds": SEEDS, **study})
    none = swept_study.cases[NO_CONTROL]
    variants = {
        name: case for name, case in swept_study.cases.items() if name == NO_CONTROL or case != none
    }
    values = np.empty((len(swept_study.seeds), grid.size, len(variants)))
    spectrum = np.full(grid.size, np.nan)
    for index, point in enumerate(grid.tolist()):
        at_point = [swept.at(swept_study.seaway, case, point) for case in variants.values()]
        seaway, _ = at_point[0]  # the same for all variants
        cases = tuple(case for _, case in at_point)
        outcomes = replace(swept_study, seaway=seaway).outcomes(cases)
        values[:, index] = [[outcome.rms_swing for outcome in of] for of in outcomes]
        if cases[0].swing_damping > 0.0:
            linear = linear_response(crane, seaway, **cases[0].pose, **cases[0].hangs)
            spectrum[index] = linear.values["swing"].rms
    if over == "bearing":
        grid = np.radians(grid)
    return Sweep(
        over=over,
        points=grid,
        names=tuple(variants),
        values=values,
        spectrum=spectrum,
        crane=crane,
        seaway=swept_study.seaway,
    )
