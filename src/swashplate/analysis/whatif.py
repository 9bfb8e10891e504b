"""What if: levers of a machine, a drive before and after they are moved, and each by itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isnan
from typing import TYPE_CHECKING, cast, overload

import numpy as np
from numpy.typing import NDArray

from swashplate.analysis.outcomes import (
    OUTCOMES,
    Outcome,
    Trial,
    find_outcomes,
    meant,
    outcome_matrix,
)
from swashplate.analysis.outcomes import trial as trial_of
from swashplate.drive import Drive
from swashplate.errors import DomainError, InputError, ParameterError
from swashplate.maneuvers import Maneuver
from swashplate.parameters.definitions import CATALOGUE, COLUMNS, REFINEMENTS, columns_of
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.results import GivenAxes, Result, figures
from swashplate.simulation.result import Simulation
from swashplate.tables import UNIT, Column, Table, listed, quantity
from swashplate.units import of_shaft

if TYPE_CHECKING:
    from swashplate.analysis.monte_carlo import Bands
    from swashplate.results import Axes, Figure

Array = NDArray[np.float64]
Range = tuple[float, float]  # Lowest and highest factor on a lever. [1]

# --- levers ---------------------------------------------------------------------------------------


MACHINE: Mapping[str, tuple[Mapping[str, float], str]] = {
    "orifice": (
        {"Z16": 1.0},
        "Opening area of the in-line orifices, as the spool displacement of equal area: the "
        "acceleration limit.",
    ),
    "orifice_diameter": (
        {"Z16": 2.0},
        "Bore of the in-line orifices; their area, and with it the opening, goes with its square.",
    ),
    "pump": (
        {"Z10": 1.0, "Z12": 1.0},
        "Displacement of the pump: flow, and speed of the shaft, at the same swash angle.",
    ),
    "drive_speed": (
        {"Z10": 1.0, "Z12": 1.0},
        "Speed of the motor that turns the pump. Flow goes with it as with the displacement; the "
        "control pressure does not, a relief valve holds it.",
    ),
    "supply_pressure": (
        {"Z9": 1.0},
        "Control pressure that moves the stroking piston: its flow goes with the root.",
    ),
    "rate_limits": ({"lim1": 1.0, "lim2": 1.0}, "Both rate limits of the card's ramps."),
    "rate_limit_up": ({"lim1": 1.0}, "Rate limit of the current away from zero."),
    "rate_limit_down": ({"lim2": 1.0}, "Rate limit of the current towards zero."),
    "dead_zone": (
        {"V_dz": 1.0},
        "Dead zone of the card's input; 0 is a dead zone compensated in full.",
    ),
    "spool_stroke": ({"Z14": 1.0}, "Stroke of the spool: what is left without orifices."),
    "relief": ({"Z15": 1.0}, "Relief pressure of the stroking piston."),
    "plussing": ({"Z18": 1.0}, "Displacement of the spool at rest, which makes the shaft creep."),
}
"""What a factor can be put on: parameters by symbol, multiplied by the factor to some power, and
what it is, and what the model takes it for."""

LEVERS: Mapping[str, Mapping[str, float]] = {
    f"{name}{side}": {f"{symbol}{side}": power for symbol, power in powers.items()}
    for side in ("", "_plus", "_minus")
    for name, (powers, _) in MACHINE.items()
    if not side or all(f"{symbol}{side}" in COLUMNS for symbol in powers)
}
"""Powers by symbol or column of each lever, by its name; those of parameters with two directions
also for each, as ``orifice_plus``."""


def find_lever(name: str) -> Mapping[str, float]:
    """Powers of a lever, or of a parameter by symbol or column; another one is an `InputError`."""
    if name in LEVERS:
        return LEVERS[name]
    if name in CATALOGUE or name in COLUMNS or name in REFINEMENTS:
        return {name: 1.0}
    hint = meant(name, [*LEVERS, *CATALOGUE, *COLUMNS])
    raise InputError(
        f"There is no lever '{name}'{hint}; the levers are {', '.join(MACHINE)}, those with two "
        "directions also as e.g. orifice_plus, and every parameter by its symbol."
    )


def levers_table() -> Table:
    """The levers, which parameters each multiplies, and what it is."""
    made = Table("", (Column("lever"), Column("multiplies"), Column("what it is", wrap=True)))
    for name, (powers, meaning) in MACHINE.items():
        how = {1.0: "", 2.0: " by its square"}
        by = ", ".join(f"{symbol}{how[power]}" for symbol, power in powers.items())
        made.add(f"{name} _plus _minus" if f"{name}_plus" in LEVERS else name, by, meaning)
    return made


def check_ranges(ranges: Mapping[str, Range], around: float | None = None) -> None:
    """Refuse, in an `InputError`, no lever, an unknown one, or factors that do not rise from 0 on.

    With `around` they must also have this factor between them.
    """
    if not ranges:
        raise InputError("Name at least one lever, such as orifice.")
    for name, (low, high) in ranges.items():
        find_lever(name)
        within = around is None or low <= around <= high
        if not (within and 0.0 <= low < high < np.inf):
            between = "" if around is None else f" and have {around:g} between them"
            raise InputError(
                f"The factors on {name} must rise from 0 or more{between}, not {low:g} to {high:g}."
            )


def pulled(drive: Drive, factors: Mapping[str, float]) -> Drive:
    """The drive with its levers moved, e.g. by ``{"orifice": 1.5, "pump": 1.5}``.

    Levers that move the same parameter multiply.

    Raises
    ------
    InputError
        For an unknown lever, a refinement without a value, a factor that is negative or NaN, or 0
        times infinity.
    ParameterError
        If what comes out breaks a rule.
    """
    numbers, moved = drive.parameters.numbers, dict[str, float]()
    for name, factor in factors.items():
        powers = find_lever(name)
        if isinstance(factor, str):
            raise InputError(f"The factor on {name} is the text {factor!r}, but must be a number.")
        if not factor >= 0.0:
            raise InputError(f"The factor on {name} is {factor:g}, but must be 0 or more.")
        for symbol, power in powers.items():
            for column in columns_of([symbol]):
                if column not in numbers:
                    raise InputError(f"{column} has no value here that a factor could change.")
                moved[column] = moved.get(column, numbers[column]) * factor**power
                if isnan(moved[column]):  # 0 times inf
                    what = f"{column} is {numbers[column]:g}"
                    raise InputError(f"{what}, which the factor {factor:g} cannot change.")
    return drive.replace(**moved)


# --- before and after -----------------------------------------------------------------------------

AS_IS, CHANGED = "as it is", "changed"


@dataclass(frozen=True, eq=False)
class Variant(Result):
    """A drive over the trial's command."""

    drive: Drive
    run: Simulation
    values: Array  # (K,) its outcomes, NaN where there is none.

    @property
    def speed_limits(self) -> tuple[float, float]:
        """Speeds that the largest commands settle at, positive and negative. [rad/s]"""
        return tuple(self.drive.steady_speed([FULL_VOLTAGE, -FULL_VOLTAGE]).tolist())


def _variant(
    drive: Drive, factors: Mapping[str, float], trial: Trial, outcomes: Sequence[Outcome]
) -> Variant:
    made = pulled(drive, factors)
    run = made.simulate(trial.voltage, trial.rate)
    return Variant(made, run, outcome_matrix(run.shaft_speed[None, :], trial, outcomes)[0])


def _undefined(outcomes: Sequence[Outcome], values: Mapping[str, Array]) -> tuple[str, ...]:
    """Outcomes that variants have not, and why."""
    said = []
    for k, outcome in enumerate(outcomes):
        without = [name for name, each in values.items() if np.isnan(each[k])]
        if without:
            who = "all variants" if len(without) == len(values) else listed(without)
            said.append(f"{who}: no {outcome.name}, {outcome.undefined}.")
    return tuple(said)


@dataclass(frozen=True, eq=False)
class WhatIf(Result):
    """A drive before and after."""

    factors: Mapping[str, float]  # By lever.
    trial: Trial
    outcomes: tuple[Outcome, ...]
    variants: Mapping[str, Variant]
    """``"as it is"`` first, then ``"changed"``; with several levers each alone in between, by
    words such as ``"orifice x 1.5"``."""

    @property
    def before(self) -> Variant:
        """The drive as it is."""
        return self.variants[AS_IS]

    @property
    def after(self) -> Variant:
        """The drive with all levers moved."""
        return self.variants[CHANGED]

    def plot(self, *, bands: Mapping[str, Bands] | None = None, title: str | None = None) -> Figure:
        """Figure of the command, the speeds and the accelerations of the drive before and after.

        With `bands` as of `swashplate.report.figures.plot_whatif`.
        """
        return cast("Figure", figures().plot_whatif(self, bands=bands or {}, title=title))

    def sentences(self) -> tuple[str, ...]:
        """Outcomes that variants have not, and why."""
        values = {name: each.values for name, each in self.variants.items()}
        return _undefined(self.outcomes, values)

    def table(self, bands: Mapping[str, Bands] | None = None) -> Table:
        """Speed limits and outcomes of the drive as it is and changed.

        With the `bands` of both, of the same outcomes, each number has half of its interval.
        """
        values = [
            np.array([*each.speed_limits, *each.values]) for each in (self.before, self.after)
        ]
        columns, cells = list[Column](), list[Array]()
        for name, own in zip((AS_IS, CHANGED), values, strict=True):
            columns.append(Column(name, "z.2f", none="none"))
            cells.append(own)
            if bands:
                columns.append(Column("±", "z.2f", none="none"))
                cells.append(bands[name].half_widths)
        change = values[1] / np.where(values[0] == 0.0, np.nan, values[0]) - 1.0
        made = Table("", (Column(""), *columns, Column("change", "+z.1%"), UNIT))
        rows = np.array([*cells, change]).T.tolist()
        for way, row in zip(("positive", "negative"), rows, strict=False):
            made.add(f"top speed, {way}", *row, unit="rad/s")
        for outcome, row in zip(self.outcomes, rows[2:], strict=True):
            outcome.add_to(made, row)
        return made


def what_if(
    drive: Drive,
    factors: Mapping[str, float],
    trial: Trial | Maneuver,
    *,
    outcomes: Sequence[str] = tuple(OUTCOMES),
) -> WhatIf:
    """Move levers and see what becomes of a command.

    Parameters
    ----------
    drive : Drive
        As it is.
    factors : mapping of str to float
        By lever, see `LEVERS`, e.g. ``{"orifice": 1.5, "pump": 1.5}``. [1]
    trial : Trial or Maneuver
        The command, see `outcomes.trial`; both drives begin at rest.
    outcomes : sequence of str
        Names in `outcomes.OUTCOMES`.

    Raises
    ------
    InputError
        For no lever, an unknown one, or an impossible factor.
    ParameterError
        If the changed drive breaks a rule of the model.
    """
    if not factors:
        raise InputError("Move at least one lever, such as orifice=1.5.")
    pulled(drive, factors)  # refuses what no drive can have
    if not isinstance(trial, Trial):
        trial = trial_of(drive, trial)
    chosen = find_outcomes(outcomes)
    moved: dict[str, Mapping[str, float]] = {AS_IS: {}}
    if len(factors) > 1:
        moved |= {f"{name} x {factor:g}": {name: factor} for name, factor in factors.items()}
    moved[CHANGED] = factors
    variants = {name: _variant(drive, own, trial, chosen) for name, own in moved.items()}
    return WhatIf(dict(factors), trial, chosen, variants)


# --- each lever by itself -------------------------------------------------------------------------

LEAST = 5e-4  # A lever that moves an outcome by less than this part has no row of its own.


@dataclass(frozen=True, eq=False)
class OneAtATime(Result):
    """Outcomes with each lever moved down and up by itself."""

    ranges: Mapping[str, Range]  # Factors down and up by lever.
    outcomes: tuple[Outcome, ...]
    base: Array  # (K,) outcomes of the drive as it is; NaN where there is none.
    low: Array  # (L, K) with each lever at its lower factor.
    high: Array  # (L, K) with each lever at its upper factor.
    sentences: tuple[str, ...]  # What could not be simulated, or has no such outcome.

    @overload
    def plot(self, *, ax: None = None, title: str | None = None) -> Figure: ...

    @overload
    def plot(self, *, ax: GivenAxes, title: str | None = None) -> GivenAxes: ...

    def plot(
        self, *, ax: Axes | Sequence[Axes] | None = None, title: str | None = None
    ) -> Figure | Axes | Sequence[Axes]:
        """Figure of what each lever does by itself, a panel an outcome, the strongest at the top.

        By default a new figure; with `ax`, one for each outcome that is defined, it is drawn there,
        and `ax` returned. See `swashplate.report.figures.plot_tornado`.
        """
        return cast("Figure", figures().plot_tornado(self, ax=ax, title=title))

    @property
    def swings(self) -> Array:
        """(L, K) how far apart the two are, NaN where one of them is missing."""
        return np.abs(self.high - self.low)

    def tables(self, *, every: bool = False) -> list[Table]:
        """A table for each outcome, the strongest lever first.

        Levers that do not move it stand in the caption, unless every one shall have its row.
        """
        return [self._table(k, every) for k in range(len(self.outcomes))]

    def _table(self, k: int, every: bool) -> Table:
        outcome, base, swings = self.outcomes[k], float(self.base[k]), self.swings[:, k]
        unit = of_shaft(outcome.unit)
        number = "none" if np.isnan(base) else quantity(base, unit, spec=outcome.spec)
        values = (outcome.spec, unit, "none")
        columns = (
            *(Column(head, of="f") for head in ("outcome", "unit")),
            Column("lever"),
            Column("from", "g", key="lower factor"),
            Column("to", "g", key="upper factor"),
            Column("as it is", of="f"),
            Column("down", *values, key="at lower factor"),
            Column("up", *values, key="at upper factor"),
            Column("swing", ".1%"),
        )
        made, quiet, names = Table("", columns), list[str](), list(self.ranges)
        made.title = f"{outcome.words}, {number} as it is"
        for j in np.argsort(-np.nan_to_num(swings), kind="stable"):
            if swings[j] <= LEAST * abs(base) and not every:
                quiet.append(names[j])
                continue
            row = (*self.ranges[names[j]], base, float(self.low[j, k]), float(self.high[j, k]))
            swing = float(swings[j] / abs(base)) if base else None
            made.add(outcome.name, outcome.unit, names[j], *row, swing)
        if quiet:
            few = len(quiet) < len(names)
            made.caption = f"not moved by {', '.join(quiet)}" if few else "no lever moves it"
        return made


def one_at_a_time(
    drive: Drive,
    ranges: Mapping[str, Range],
    trial: Trial,
    *,
    outcomes: Sequence[str],
) -> OneAtATime:
    """Move each lever down and up by itself.

    Parameters
    ----------
    drive : Drive
        As it is.
    ranges : mapping of str to (float, float)
        Lower and upper factor by lever, such as ``{"orifice": (0.9, 1.1)}``. [1]
    trial : Trial
        The command.
    outcomes : sequence of str
        Names in `outcomes.OUTCOMES`.

    Raises
    ------
    InputError
        For an unknown lever or outcome, or a range that does not rise.
    DomainError
        If the drive as it is leaves the model's domain under the command.
    """
    check_ranges(ranges)
    chosen, said = find_outcomes(outcomes), list[str]()
    found = {AS_IS: _variant(drive, {}, trial, chosen).values}
    ends = np.full((2, len(ranges), len(chosen)), np.nan)
    for j, (name, pair) in enumerate(ranges.items()):
        for end, factor in enumerate(pair):
            words = f"{name} x {factor:g}"
            try:
                found[words] = ends[end, j] = _variant(drive, {name: factor}, trial, chosen).values
            except (ParameterError, DomainError) as refusal:
                said.append(f"{words} cannot be simulated: {refusal}")
    said += _undefined(chosen, found)
    return OneAtATime(dict(ranges), chosen, found[AS_IS], ends[0], ends[1], tuple(said))
