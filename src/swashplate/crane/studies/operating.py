"""Operability: the share of a year that can be worked, and what limits it, sea by sea.

A scatter diagram says how often each significant height comes with each peak period. For each of
its cells and each heading the frequency domain gives what is linear: the crane without control, and
with control as long as no drive is at a limit. A cell is simulated if that is near a limit, or asks
of a drive what it cannot do, and judged as a verdict is. At one period and heading, what is beyond
a limit stays beyond it in higher waves, so that only the boundary is looked for, and what limits
first, as the sea rises, is what limits all seas above. A crew does not answer small swing, so that
no cell is workable with it by the frequency domain alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from math import pi, sqrt
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from swashplate.crane.axes import AXES
from swashplate.crane.closed_loop.operator_command import OperatorCommand
from swashplate.crane.closed_loop.result import PUMPS
from swashplate.crane.control import Control, stages_of
from swashplate.crane.crane import Crane
from swashplate.crane.limits import LIMITED
from swashplate.crane.rope import GRAVITY
from swashplate.crane.sea.confidence import rms_of
from swashplate.crane.sea.scatter import Scatter
from swashplate.crane.sea.seaway import Seaway, Spectrum
from swashplate.crane.sea.transfer_functions import TransferFunctions
from swashplate.crane.studies.crane_assessment import share_worse_of
from swashplate.crane.studies.following import follow
from swashplate.crane.studies.judging import (
    ALLOWED_SHARE,
    TAKEOVER,
    Decision,
    Judgement,
    has_left,
    judge,
)
from swashplate.crane.studies.run_outcome import RunOutcome
from swashplate.crane.studies.spectral import DEMANDS, linear_response
from swashplate.crane.studies.study import (
    BUILT,
    CALM,
    CREW_ASSUMED,
    CREW_NOT_MODELLED,
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
SEEDS = tuple(range(60))
"""Seaways in which a cell is simulated at most, ten minutes each."""
FIRST = 4
"""Seaways in which it is simulated at first: the least whose interval is of use, as Student's for
four groups is 3.2 standard errors wide, and for three 4.3. As long as that decides nothing, they
are doubled."""
LARGEST_STARTS = 12
"""Starts with the largest swing of all seaways that are tried together: control fails to take over
large swings first."""
SHORTEST = 300.0
"""Least time for which each of them counts: some fifty peaks of a swing. [s]"""
ACTS = 0.05
"""Share of time at a limit from which on a drive is what limits a cell."""
WORKABLE = ""
"""In place of a limit, for a cell that can be worked."""
UNDECIDED = "undecided"
"""In place of a limit, for a cell that all seaways together do not decide."""
LEFT = "leaves the model"
"""In place of a limit, for a cell in which a run is not a valid operation to its end."""
HARM = "control harms"
"""In place of a limit, for a cell in which control makes more swing than none, at no limit of a
drive."""
DRIVES_LIMITS: Mapping[Limit, str] = {
    Limit.ORIFICE: "orifice",
    Limit.SWASH_STOP: "swash stop",
    Limit.RELIEF: "relief",
}


class SeaCell(NamedTuple):
    """A sea of one height, period and heading, for one variant."""

    limited_by: str
    """What limits first as the sea rises at this period and heading, a name of `LIMITED` or drive
    and its limit, ``"luff orifice"``; `WORKABLE` or `UNDECIDED`."""
    ratio: float
    """Largest ratio of a value to its limit; NaN if it is not known: a run left the model, or the
    cell follows from another one."""
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
    crewed: bool
    """Whether a crew is among the variants."""
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

    def undecided(self, name: str) -> float:
        """Share of the year of which it is not decided whether a variant can work."""
        return self.shares(name).get(UNDECIDED, 0.0)

    def shares(self, name: str) -> dict[str, float]:
        """Share of the year by what limits it, the largest first.

        `WORKABLE` is workable, `UNDECIDED` not decided.
        """
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
                if limit not in (WORKABLE, UNDECIDED, *limits):
                    limits.append(limit)
        if any(self.undecided(name) for name in self.names):
            limits.insert(0, UNDECIDED)
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
        undecided = [
            f"{100.0 * self.undecided(name):.1f} % with '{name}'"
            for name in self.names
            if self.undecided(name)
        ]
        if undecided:
            sentences.append(
                f"Undecided is {listed(undecided)}: there, after all seaways, the interval of a "
                "value holds its limit, or control sometimes fails to take over the swing that it "
                "is switched on in."
            )
        if self.crewed:
            sentences.append(CREW_ASSUMED)
        elif self._lowest_unworkable() <= CALM:
            sentences.append(CREW_NOT_MODELLED)
        return (*sentences, *assumed_sentences(self.crane))


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
        With limits, see `limits.LIMITED`.
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
        As of `Study.of`, without a command. `seeds` are the seaways in which a cell is simulated at
        most, 60 by default.

    Raises
    ------
    InputError
        For a crane without limits, no heading, one that is given twice, and seas or headings that
        `Seaway` refuses: all before the first is computed.
    """
    limits = crane.limits_si
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
    if len(study.seeds) > FIRST:
        seaways = f"{FIRST} to {seaways}, as many as decide,"
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
        crewed=study.crewed,
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
    heights = {int(row): float(scatter.height[row]) for row in column.rows}

    @cache
    def simulated(height: float) -> _Simulated:
        sea = Spectrum(height, column.period, factor)
        return _by_simulation(study, case, replace(low, sea=sea), limits)

    border = _border(linear, list(heights.values()), simulated)
    cells = {row: _cell(height, linear, border, simulated) for row, height in heights.items()}
    slope = linear.slope["hoist_demand"]
    too_slow = limits.get("hoist_demand", np.inf) / slope if slope > 0.0 else np.inf
    return cells, too_slow


class _Linear(NamedTuple):
    """A crane in the frequency domain."""

    slope: Mapping[str, float]
    """Largest values for each metre of significant height, by names of `LIMITED`."""
    mean: Mapping[str, float]
    """What they are without waves."""
    demand: float
    """Largest part for each metre of what drives and clip can do that control asks for."""
    limits: Mapping[str, float]
    """Of quantities that the frequency domain has."""
    idle: _Idle | None = None
    """Waves in which the crew has nothing to do."""

    def ratio(self, height: float) -> float:
        """Largest ratio of a value to its limit in waves of a height."""
        if self.idle is not None and height < self.idle.height:
            return self.idle.without.ratio(height)
        ratios = [
            (self.mean[name] + height * self.slope[name]) / limit
            for name, limit in self.limits.items()
        ]
        return max(ratios, default=0.0)

    def first(self) -> tuple[float, str]:
        """Height at which the first limit is met, and that limit; inf if none is. [m]"""
        met = {
            name: max((limit - self.mean[name]) / self.slope[name], 0.0)
            if self.slope[name] > 0.0
            else (0.0 if self.mean[name] > limit else np.inf)
            for name, limit in self.limits.items()
        }
        name = min(met, key=lambda limit: met[limit], default=LEFT)
        return met.get(name, np.inf), name

    def decision(self, height: float) -> Decision:
        """Whether the crane works; not decided if too near a limit, of a drive as well."""
        if self.idle is not None and height < self.idle.height:
            return self.idle.without.decision(height)
        ratio = self.ratio(height)
        if self.demand == 0.0:  # no drive moves
            return "no" if ratio > 1.0 else "yes"
        if ratio > NEAR:  # drives that are at their limits do not make it better
            return "no"
        far = ratio < 1.0 / NEAR and self.demand * height < 1.0 / NEAR
        return "yes" if far else "not decided"


class _Idle(NamedTuple):
    """Waves so low that a crew sees no swing and does nothing."""

    height: float
    """[m]"""
    without: _Linear
    """The crane without the crew."""


def _linear(case: Case, sea: Seaway, limits: Mapping[str, float]) -> _Linear:
    """The first of a case's cranes in a sea of `LOW_SEA`, in the frequency domain."""
    control = case.options["control"]
    response = linear_response(case.cranes[0], sea, control, **case.pose, **case.hangs)
    values = response.values
    known = {name: limit for name, limit in limits.items() if name in values}
    named = {*known, "hoist_demand", "off_lead", "side_lead"}
    mean = {name: abs(values[name].mean) for name in named}
    slope = {name: (values[name].largest - mean[name]) / LOW_SEA for name in named}
    if control is None:
        return _Linear(slope, mean, 0.0, known)
    demands = [name for name in DEMANDS if name in values and (case.driven or name == "clip")]
    demand = max((values[name].largest for name in demands), default=0.0)
    operator = stages_of(control).settings.crew
    if operator is not None:  # not linear in any waves in which it sees the swing
        without = _linear(case.changed(control=None), sea, limits)
        seen = max(without.slope["off_lead"], without.slope["side_lead"])
        idle = _Idle(operator.threshold / NEAR / seen if seen > 0.0 else np.inf, without)
        return _Linear(slope, mean, np.inf, known, idle)
    return _Linear(slope, mean, max(demand, _demand_at_start(case, sea)) / LOW_SEA, known)


def _demand_at_start(case: Case, sea: Seaway) -> float:
    """Part of what slew or luff can follow that the feedback of a swing without control asks for.

    A clip keeps that within what they can follow.
    """
    settings = stages_of(case.options["control"])[0]
    clipped = settings.clip > 0.0 or settings.share > 0.0
    if not case.driven or clipped or not settings.feedback or case.swing_damping <= 0.0:
        return 0.0
    crane = case.cranes[0]
    rope = case.pose["rope_m"]
    swing = linear_response(crane, sea, **case.pose, **case.hangs).values["swing"].largest
    followable = follow(crane, [2.0 * pi * sqrt(rope / GRAVITY)], seas=(), **case.pose)
    return float(settings.feedback * swing * rope / followable.amplitude[0, 1:].min())


class _Simulated(NamedTuple):
    """A sea by simulated seaways."""

    decision: Decision
    ratio: float
    """Largest ratio of a value to its limit; NaN if a run left the model."""
    cause: str
    """Drive and limit that act for the longest time, or else the worst quantity."""


class _Border(NamedTuple):
    """Heights between which the crane ceases to work, at one period and heading. [m]"""

    workable: float
    """Highest waves that are certainly workable."""
    unworkable: float
    """Lowest waves that are certainly not."""
    limited_by: str
    """What limits first as the sea rises."""


def _border(
    linear: _Linear, heights: Sequence[float], simulated: Callable[[float], _Simulated]
) -> _Border:
    """Look for the border among heights, the lowest first, by halving those that are open.

    What limits first is known but for the limits of drives and clip, as all else is linear in the
    height. These are first if the crane ceases to work in lower waves: if no height tells, 1/1.3 of
    that of the linear crane is tried.
    """
    decisions = {height: linear.decision(height) for height in heights}
    workable = max((height for height in heights if decisions[height] == "yes"), default=0.0)
    unworkable = min((height for height in heights if decisions[height] == "no"), default=np.inf)
    tries = sorted(height for height in heights if decisions[height] == "not decided")
    failing = _first_of(tries, lambda height: simulated(height).decision != "yes")
    certain = failing + _first_of(
        tries[failing:], lambda height: simulated(height).decision == "no"
    )
    if failing > 0:
        workable = tries[failing - 1]
    if certain < len(tries):
        unworkable = tries[certain]
    first_height, first_limit = linear.first()
    if unworkable < first_height:
        return _Border(workable, unworkable, simulated(unworkable).cause)
    trial = first_height / NEAR
    if workable < trial and unworkable < np.inf and linear.demand * trial > 1.0 / NEAR:
        in_trial = simulated(trial)
        if in_trial.decision == "no":
            return _Border(workable, unworkable, in_trial.cause)
    return _Border(workable, unworkable, first_limit)


def _first_of(heights: Sequence[float], beyond: Callable[[float], bool]) -> int:
    """Position of the first of rising heights that is beyond a border, by halving."""
    low = 0
    high = len(heights)
    while low < high:
        middle = (low + high) // 2
        if beyond(heights[middle]):
            high = middle
        else:
            low = middle + 1
    return low


def _cell(
    height: float, linear: _Linear, border: _Border, simulated: Callable[[float], _Simulated]
) -> SeaCell:
    """The cell of a height in its column."""
    by_spectrum = linear.decision(height)
    limited_by = UNDECIDED
    if by_spectrum == "yes" or height <= border.workable:
        limited_by = WORKABLE
    elif by_spectrum == "no" or height >= border.unworkable:
        limited_by = border.limited_by
    if by_spectrum != "not decided":
        return SeaCell(limited_by, linear.ratio(height), False)
    tried = height in (border.workable, border.unworkable) or limited_by == UNDECIDED
    return SeaCell(limited_by, simulated(height).ratio if tried else np.nan, True)


def _by_simulation(
    study: Study, case: Case, seaway: Seaway, limits: Mapping[str, float]
) -> _Simulated:
    """A sea by simulated seaways: as many as decide, or all."""
    in_sea = replace(study, seaway=seaway, executor=Serial(), progress=None)
    outcomes: list[RunOutcome] = []
    number = min(FIRST, len(study.seeds))
    while True:
        numbers = range(len(outcomes), number)
        outcomes += [outcome for (outcome,) in in_sea.outcomes([case], numbers)]
        judgement = judge(outcomes, limits, length=study.length)
        left = any(map(has_left, outcomes))
        # once a run has left the model, longer ones say no more than short ones, how often it does
        if judgement.sufficient != "not decided" or left or number == len(study.seeds):
            break
        number = min(2 * number, len(study.seeds))
    if judgement.sufficient == "yes" or (judgement.sufficient == "not decided" and left):
        judgement = _with_other_starts(in_sea, case, outcomes, limits)
    ratios = {
        quantity.name: quantity.largest.value / quantity.limit for quantity in judgement.limited
    }
    worst = max(ratios, key=lambda name: float(np.nan_to_num(ratios[name])), default=LEFT)
    cause = _drive_limit(outcomes) or (LEFT if left else worst)
    decision = judgement.sufficient
    if decision == "yes":
        decision = _harmless(in_sea, case, outcomes)
        cause = _drive_limit(outcomes) or HARM
    return _Simulated(decision, np.nan if left else ratios.get(worst, np.nan), cause)


def _harmless(study: Study, case: Case, outcomes: Sequence[RunOutcome]) -> Decision:
    """Whether control makes more swing than none at most as often as is allowed.

    If its swing is far less than without it, the first seaways decide; else they are doubled, and
    if all together do not show that it harms, the value of the share does not exceed the allowed.
    """
    controlled = list(outcomes)
    uncontrolled: list[RunOutcome] = []
    number = min(FIRST, len(study.seeds))
    without = study.cases[NO_CONTROL]
    while True:
        controlled += [run for (run,) in study.outcomes([case], range(len(controlled), number))]
        uncontrolled += [
            run for (run,) in study.outcomes([without], range(len(uncontrolled), number))
        ]
        swings = [
            rms_of(np.array([outcome.rms_swing for outcome in of_case])).value
            for of_case in (controlled[:number], uncontrolled)
        ]
        share = share_worse_of(controlled[:number], uncontrolled)
        if share.low > ALLOWED_SHARE:
            return "no"
        if share.value == 0.0 and swings[0] < swings[1] / NEAR:
            return "yes"
        if number == len(study.seeds):
            return "yes" if share.value <= ALLOWED_SHARE else "not decided"
        number = min(2 * number, len(study.seeds))


def _with_other_starts(
    study: Study, case: Case, outcomes: Sequence[RunOutcome], limits: Mapping[str, float]
) -> Judgement:
    """Judge runs together with short ones, of which only that counts: whether control takes over.

    Those that begin in the largest swing are tried first, by the dozen. If control takes over all
    of a dozen, it is taken to do so in the rest, which begin in less.
    """
    swings = {
        number: case.swing_at_start(replace(study.seaway, seed=study.seeds[number]))
        for number in range(len(outcomes), len(study.seeds))
    }
    numbers = sorted(swings, key=lambda number: -swings[number])
    short = case._replace(command=OperatorCommand.rest(study.run_in + TAKEOVER))
    failed = [False] * len(numbers)
    judgement = judge(outcomes, limits, length=study.length, other_starts=failed)
    for first in range(0, len(numbers), LARGEST_STARTS):
        tried = numbers[first : first + LARGEST_STARTS]
        of_tried = study.outcomes([short], tried)
        failed[first : first + len(tried)] = [has_left(outcome) for (outcome,) in of_tried]
        judgement = judge(outcomes, limits, length=study.length, other_starts=failed)
        if judgement.sufficient == "no" or not any(failed[first : first + len(tried)]):
            break
    return judgement


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
