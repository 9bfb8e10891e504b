"""Operability: the share of a year that can be worked, and what limits it, sea by sea.

A scatter diagram says how often each significant height comes with each peak period. For each of
its cells and each heading the frequency domain gives what is linear: the crane without control, and
with control as long as no drive is at a limit. A cell is simulated if that is near a limit, or asks
of a drive what it cannot do. At one period and heading, what is beyond a limit stays beyond it in
higher waves, so that only the boundary is looked for.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from swashplate.crane.axes import AXES
from swashplate.crane.closed_loop.result import PUMPS
from swashplate.crane.control import Control
from swashplate.crane.crane import Crane
from swashplate.crane.limits import LIMITED
from swashplate.crane.sea.extremes import largest_of_peaks
from swashplate.crane.sea.scatter import Scatter
from swashplate.crane.sea.seaway import Seaway, Spectrum
from swashplate.crane.sea.transfer_functions import TransferFunctions
from swashplate.crane.studies.run_outcome import RunOutcome
from swashplate.crane.studies.spectral import DEMANDS, linear_response
from swashplate.crane.studies.study import (
    BUILT,
    IDEAL,
    NO_CONTROL,
    Case,
    Drives,
    Study,
    assumed_sentences,
)
from swashplate.drive import Limit
from swashplate.errors import InputError
from swashplate.executors import Executor, Serial, Threads
from swashplate.progress import counted
from swashplate.results import Tabular, figures
from swashplate.tables import Column, Table, count, listed

if TYPE_CHECKING:
    import polars

    from swashplate.results import Figure

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

HEADINGS = tuple(range(0, 360, 45))
"""Headings of the waves by default, equally likely. [deg]"""
LOW_SEA = 0.125
"""Height of the sea from which the frequency domain scales: its waves break at no period that a sea
may have. [m]"""
MOST_PERIODS = 100
"""Periods of a scatter diagram; classes of 0.25 s between 2 and 25 s are 92."""
NEAR = 1.3
"""Factor on a limit, and from it, within which the frequency domain is not relied on."""
SEEDS = (0, 1)
"""Seaways in which a cell is simulated, ten minutes each."""
SHORTEST = 300.0
"""Least time for which each of them counts: some fifty peaks of a swing. [s]"""
ACTS = 0.05
"""Share of time at a limit from which on a drive is what limits a cell."""
CALM = 0.25
"""Height of a sea in which people work with cranes; a crane that cannot, by the model, is damped by
its crew. The lowest class of most scatter diagrams. [m]"""
NOT_MODELLED = (
    "Not modelled is what a crew does: it damps the swing by moving the boom and with tag lines, "
    "so that without control a crane may work in more of the year than is shown."
)
LEFT_OUT = "saturation"
"""Limit that is not assessed: a drive's limits are found by what they do."""
WORKABLE = ""
"""In place of a limit, for a cell that can be worked."""
LEFT = "leaves the model"
"""In place of a limit, for a cell in which a run is not a valid operation to its end."""
DRIVES_LIMITS: Mapping[Limit, str] = {
    Limit.ORIFICE: "orifice",
    Limit.SWASH_STOP: "swash stop",
    Limit.RELIEF: "relief",
}


class SeaCell(NamedTuple):
    """A sea of one height, period and heading, for one variant."""

    limited_by: str
    """A name of `LIMITED`, or drive and its limit, ``"luff orifice"``; empty if workable."""
    ratio: float
    """Largest ratio of a value to its limit; inf if the run left the model; NaN if it was not
    computed, as a higher sea is workable."""
    simulated: bool
    """Whether it was simulated, or follows from a cell that was."""


@dataclass(frozen=True, eq=False)
class Operability(Tabular):
    """Share of the year that can be worked, by variant, and what limits each sea."""

    crane: Crane = field(repr=False)
    control: Control
    scatter: Scatter
    headings: tuple[float, ...]
    """[deg]"""
    cells: Mapping[str, Mapping[tuple[int, float], SeaCell]] = field(repr=False)
    """By variant, and by row of the scatter diagram and heading."""
    seaway: Seaway
    """Ship, peak factor, spreading."""
    case: str
    """Sentences on pose and control of the crane, and on the simulation of cells."""
    hoist_limit: tuple[float, float, float]
    """Least significant height at which the hoist is too slow for the hook, with period and
    heading; inf if none. [m], [s], [deg]"""

    @property
    def names(self) -> tuple[str, ...]:
        """Variants, the crane without control first."""
        return tuple(self.cells)

    def workable(self, name: str) -> float:
        """Share of the year that a variant can work, 0 to 1, headings as likely as each other."""
        return self.shares(name).get(WORKABLE, 0.0)

    def shares(self, name: str) -> dict[str, float]:
        """Share of the year by what limits it, the largest first; `WORKABLE` is workable."""
        shares: dict[str, float] = {}
        for (row, _), cell in self.cells[name].items():
            share = float(self.scatter.share[row]) / len(self.headings)
            shares[cell.limited_by] = shares.get(cell.limited_by, 0.0) + share
        return dict(sorted(shares.items(), key=lambda entry: -entry[1]))

    def plot(self, *, title: str | None = None) -> Figure:
        """Figure of what limits each sea, a panel for each variant."""
        return cast("Figure", figures().plot_operability(self, title=title))

    def tables(self) -> list[Table]:
        """Share of the year that each variant can work, and what limits the rest."""
        limits = list[str]()
        for name in self.names:
            for limit in self.shares(name):
                if limit != WORKABLE and limit not in limits:
                    limits.append(limit)
        limit_columns = [Column(label_of(limit), ".1%", wrap=True) for limit in limits]
        columns = (Column("variant", wrap=True), Column("workable", ".1%"), *limit_columns)
        table = Table("Share of the year, and what limits the rest first", columns)
        for name in self.names:
            shares = self.shares(name)
            rest = [shares.get(limit, 0.0) for limit in limits]
            table.add(name, self.workable(name), *rest)
        return [table]

    def to_polars(self) -> polars.DataFrame:
        """Limits of all cells: a row for each variant, sea and heading, SI."""
        import polars as pl

        rows = [
            {
                "variant": name,
                "hs": float(self.scatter.height[row]),
                "tp": float(self.scatter.period[row]),
                "heading": float(np.radians(heading)),
                "share": float(self.scatter.share[row]) / len(self.headings),
                "limited_by": label_of(cell.limited_by),
                # not known below a cell that was simulated, and beyond the model
                "ratio": cell.ratio if np.isfinite(cell.ratio) else None,
                "simulated": cell.simulated,
            }
            for name, cells in self.cells.items()
            for (row, heading), cell in cells.items()
        ]
        return pl.DataFrame(rows)

    def _lowest_unworkable(self) -> float:
        """Least significant height that the crane without control cannot work; inf if none. [m]"""
        heights = [
            float(self.scatter.height[row])
            for (row, _), cell in self.cells[NO_CONTROL].items()
            if cell.limited_by != WORKABLE
        ]
        return min(heights, default=np.inf)

    def sentences(self) -> tuple[str, ...]:
        """State the basis of the shares."""
        simulated = sum(cell.simulated for cells in self.cells.values() for cell in cells.values())
        every = sum(map(len, self.cells.values()))
        headings = listed([f"{heading:g}" for heading in self.headings])
        sentences = [
            self.case,
            f"Equally likely headings: {headings} deg.",
            f"Of {every} cells {simulated} were simulated or lie beyond one that was; the others "
            "are from the frequency domain.",
        ]
        height, period, heading = self.hoist_limit
        if np.isfinite(height):
            sentences.append(
                f"The hoist is slower than the hook's vertical motion from {height:.2g} m on, at "
                f"{period:g} s and a heading of {heading:g} deg."
            )
        if self.scatter.note:
            sentences.append(self.scatter.note)
        if isinstance(self.seaway.ship, TransferFunctions) and self.seaway.ship.unchecked:
            sentences.append(self.seaway.ship.unchecked)
        if self._lowest_unworkable() <= CALM:
            sentences.append(NOT_MODELLED)
        assessed = {name: limit for name, limit in self.crane.limits.items() if name != LEFT_OUT}
        return (*sentences, *assumed_sentences(replace(self.crane, limits=assessed)))


def label_of(limit: str) -> str:
    """Label of the quantity that limits a cell, as a table shows it."""
    return LIMITED[limit].label if limit in LIMITED else limit


def operability(
    crane: Crane,
    control: Control,
    scatter: Scatter,
    *,
    headings: Sequence[float] = HEADINGS,
    drives: Drives = (IDEAL, BUILT),
    sea: Seaway | None = None,
    executor: Executor | None = None,
    **options: Any,
) -> Operability:
    """Share of a year that a crane can work with control, by its limits.

    Parameters
    ----------
    crane : Crane
        With limits, see `limits.LIMITED`; the saturation is left out.
    control : Control
        One controller; the crane without control is always a variant.
    scatter : Scatter
        Seas and their shares of the year.
    headings : sequence of float
        Of the waves, equally likely. [deg]
    drives
        As of `assess`.
    sea : Seaway, optional
        Ship, peak factor, spreading, speed; its height, period and heading do not count.
    executor : Executor, optional
        Threads by default; the numbers do not depend on it.
    **options
        As of `Study.of`, without a command.

    Raises
    ------
    InputError
        For a crane without limits, no heading, one that is given twice, and seas or headings that
        `Seaway` refuses: all before the first is computed.
    """
    limits = {name: limit for name, limit in crane.limits_si.items() if name != LEFT_OUT}
    if not limits:
        raise InputError(
            f"{crane.name} has no limits: give its file a table [limits], as [limits] with "
            'side_lead = { value = 4, unit = "deg" }.'
        )
    _check_headings(headings)
    base = Seaway() if sea is None else sea
    study = Study.of(crane, control, sea=base, drives=drives, **{"seeds": SEEDS, **options})
    if study.length < SHORTEST:
        raise InputError(
            f"A sea is simulated for {study.length:g} s, but its largest values in three hours "
            f"need at least {SHORTEST:g} s."
        )
    columns_of_sea = _columns_of_sea(scatter)
    if len(columns_of_sea) > MOST_PERIODS:
        raise InputError(
            f"The scatter diagram has {len(columns_of_sea)} different periods, but at most "
            f"{MOST_PERIODS} are computed: gather its seas into classes, such as 0.25 m by 0.5 s."
        )
    for heading in headings:
        replace(base, heading_deg=float(heading))  # or it is refused
    for period, rows in columns_of_sea.items():
        highest = float(scatter.height[rows[-1]])
        replace(base, sea=Spectrum(highest, period, base.spectrum.peak_factor))  # or it is refused
    columns = [
        _Column(name, float(heading), period, rows)
        for name in study.cases
        for heading in headings
        for period, rows in columns_of_sea.items()
    ]
    work = (study, scatter, limits)
    cells: dict[str, dict[tuple[int, float], SeaCell]] = {name: {} for name in study.cases}
    hoist = (np.inf, np.nan, np.nan)
    runs = (executor or Threads()).run(_of_column, work, columns)
    for position, (column_cells, too_slow) in counted(
        runs, len(columns), "columns", f"Operability of {crane.name}"
    ):
        column = columns[position]
        for row, cell in column_cells.items():
            cells[column.variant][row, column.heading] = cell
        if too_slow < hoist[0] and column.variant == NO_CONTROL:
            hoist = (too_slow, column.period, column.heading)
    ordered = {name: dict(sorted(of_name.items())) for name, of_name in cells.items()}
    seaways = count(len(study.seeds), "seaway")
    simulated = f"A cell is simulated in {seaways} of {study.length / 60.0:g} min."
    case = f"{study.cases[list(study.cases)[-1]].sentence()} {simulated}"
    return Operability(
        crane=crane,
        control=control,
        scatter=scatter,
        headings=tuple(map(float, headings)),
        cells=ordered,
        seaway=base,
        case=case,
        hoist_limit=hoist,
    )


def _check_headings(headings: Sequence[float]) -> None:
    """Refuse no headings, and one that stands twice and would count twice."""
    if not headings:
        raise InputError("Operability needs at least one heading of the waves.")
    given = dict[float, float]()
    for heading in map(float, headings):
        turned = heading % 360.0
        if turned in given:
            raise InputError(
                f"The headings {given[turned]:g} and {heading:g} deg are one, which would count "
                "twice: give it once."
            )
        given[turned] = heading


def _columns_of_sea(scatter: Scatter) -> dict[float, Rows]:
    """Rows of a scatter diagram by their period, those of each with the lowest waves first."""
    order = np.lexsort((scatter.height, scatter.period))
    ends = np.flatnonzero(np.diff(scatter.period[order])) + 1
    return {float(scatter.period[rows[0]]): rows for rows in np.split(order, ends)}


class _Column(NamedTuple):
    """All heights of one period and heading, for a variant."""

    variant: str
    heading: float
    period: float
    rows: Rows
    """Of the scatter diagram, the lowest waves first."""


def _of_column(
    work: tuple[Study, Scatter, Mapping[str, float]], column: _Column
) -> tuple[dict[int, SeaCell], float]:
    """Cells of a column by their row, and the height from which on the hoist is too slow. [m]"""
    study, scatter, limits = work
    case = study.cases[column.variant]
    factor = study.seaway.spectrum.peak_factor
    low = replace(
        study.seaway,
        sea=Spectrum(LOW_SEA, column.period, factor),
        heading_deg=column.heading,
    )
    linear = _linear(case, low, limits)
    cells = {
        int(row): _by_spectrum(float(scatter.height[row]), linear, limits) for row in column.rows
    }

    def simulated(row: int) -> SeaCell:
        sea = Spectrum(float(scatter.height[row]), column.period, factor)
        return _by_simulation(study, case, replace(low, sea=sea), limits)

    open_rows = [row for row, cell in cells.items() if cell is None]
    complete = cells | _boundary(open_rows, simulated)
    slope = linear.slope["hoist_demand"]
    too_slow = limits.get("hoist_demand", np.inf) / slope if slope > 0.0 else np.inf
    return {row: cell for row, cell in complete.items() if cell is not None}, too_slow


def _boundary(rows: Sequence[int], simulated: Callable[[int], SeaCell]) -> dict[int, SeaCell]:
    """Cells of rows, the lowest waves first: each that is simulated decides half of the others."""
    cells: dict[int, SeaCell] = {}
    low = 0
    high = len(rows)
    limiting = SeaCell(LEFT, np.inf, True)
    while low < high:
        middle = (low + high) // 2
        cell = simulated(rows[middle])
        cells[rows[middle]] = cell
        if cell.limited_by == WORKABLE:
            low = middle + 1
        else:
            high = middle
            limiting = cell
    for position, row in enumerate(rows):
        if row not in cells:
            cells[row] = SeaCell(WORKABLE, np.nan, True) if position < low else limiting
    return cells


class _Linear(NamedTuple):
    """A crane in the frequency domain."""

    slope: Mapping[str, float]
    """Largest values for each metre of significant height, by names of `LIMITED`."""
    mean: Mapping[str, float]
    """What they are without waves."""
    demand: float
    """Largest part for each metre of what drives and clip can do that control asks for."""


def _linear(case: Case, sea: Seaway, limits: Mapping[str, float]) -> _Linear:
    """The first of a case's cranes in a sea of `LOW_SEA`, in the frequency domain."""
    control = case.options["control"]
    response = linear_response(case.cranes[0], sea, control, **case.pose, **case.hangs)
    values = response.values
    named = {*limits, "hoist_demand"}
    mean = {name: abs(values[name].mean) for name in named}
    slope = {name: (values[name].largest - mean[name]) / LOW_SEA for name in named}
    demands = [name for name in DEMANDS if name in values and (case.driven or name == "clip")]
    demand = max((values[name].largest for name in demands), default=0.0) / LOW_SEA
    return _Linear(slope, mean, demand if control is not None else 0.0)


def _by_spectrum(height: float, linear: _Linear, limits: Mapping[str, float]) -> SeaCell | None:
    """A cell by the frequency domain; None if it is too near a limit, of a drive as well."""
    ratios = {
        name: (linear.mean[name] + height * linear.slope[name]) / limit
        for name, limit in limits.items()
    }
    worst = max(ratios, key=lambda name: ratios[name])
    ratio = ratios[worst]
    if linear.demand == 0.0:  # no drive moves
        return SeaCell(worst if ratio > 1.0 else WORKABLE, ratio, False)
    if ratio > NEAR:  # drives that are at their limits do not make it better
        return SeaCell(worst, ratio, False)
    if ratio < 1.0 / NEAR and linear.demand * height < 1.0 / NEAR:
        return SeaCell(WORKABLE, ratio, False)
    return None


def _by_simulation(
    study: Study, case: Case, seaway: Seaway, limits: Mapping[str, float]
) -> SeaCell:
    """A cell by simulated seaways."""
    in_sea = replace(study, seaway=seaway, executor=Serial(), progress=None)
    outcomes = [outcome for (outcome,) in in_sea.outcomes([case])]
    if any(outcome.departure_reason for outcome in outcomes):
        return SeaCell(_drive_limit(outcomes) or LEFT, np.inf, True)
    evaluated_time = sum(outcome.evaluated_time for outcome in outcomes)
    ratios = {
        name: largest_of_peaks([outcome.peaks[name] for outcome in outcomes], evaluated_time).value
        / limit
        for name, limit in limits.items()
        if all(name in outcome.peaks for outcome in outcomes)
    }
    worst = max(ratios, key=lambda name: ratios[name])
    if ratios[worst] <= 1.0:
        return SeaCell(WORKABLE, ratios[worst], True)
    return SeaCell(_drive_limit(outcomes) or worst, ratios[worst], True)


def _drive_limit(outcomes: Sequence[RunOutcome]) -> str:
    """Drive and limit that act for the longest time, in words; empty if none acts for long."""
    shares = np.mean([np.nan_to_num(outcome.limits) for outcome in outcomes], axis=0)
    longest = ACTS
    cause = ""
    for row, axis in zip(shares, AXES, strict=True):
        for limit, name in DRIVES_LIMITS.items():
            share = float(row[PUMPS.index(limit)])
            if share > longest:
                longest = share
                cause = f"{axis} {name}"
    return cause
