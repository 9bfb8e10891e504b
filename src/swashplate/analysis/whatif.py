"""What if: levers of a machine, a drive before and after they are moved, and each by itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.analysis.outcomes import (
    OUTCOMES,
    Outcome,
    Trial,
    find_outcomes,
    outcome_matrix,
    sweep,
)
from swashplate.drive import Drive
from swashplate.errors import InputError
from swashplate.parameters.definitions import CATALOGUE, COLUMNS, REFINEMENTS, columns_of, find
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.results import Result
from swashplate.simulation.result import Simulation
from swashplate.tables import UNIT, Column, Table, quantity

if TYPE_CHECKING:
    from swashplate.analysis.monte_carlo import Bands

Array = NDArray[np.float64]
Range = tuple[float, float]  # Lowest and highest factor on a lever. [1]

# --- levers ---------------------------------------------------------------------------------------


class Lever(NamedTuple):
    """Something on the machine that a factor can be put on."""

    powers: Mapping[str, float]
    """By symbol or column: the parameter is multiplied by the factor to this power."""
    meaning: str  # What it is, and what the model takes it for.


MACHINE = {
    "orifice": Lever(
        {"Z16": 1.0},
        "Opening area of the in-line orifices, as the spool displacement of equal area: the "
        "acceleration limit.",
    ),
    "orifice_diameter": Lever(
        {"Z16": 2.0},
        "Bore of the in-line orifices; their area, and with it the opening, goes with its square.",
    ),
    "pump": Lever(
        {"Z10": 1.0, "Z12": 1.0},
        "Displacement of the pump: flow, and speed of the shaft, at the same swash angle.",
    ),
    "drive_speed": Lever(
        {"Z10": 1.0, "Z12": 1.0},
        "Speed of the motor that turns the pump. Flow goes with it as with the displacement; the "
        "control pressure does not, a relief valve holds it.",
    ),
    "supply_pressure": Lever(
        {"Z9": 1.0},
        "Control pressure that moves the stroking piston: its flow goes with the root.",
    ),
    "rate_limits": Lever({"lim1": 1.0, "lim2": 1.0}, "Both rate limits of the card's ramps."),
    "rate_limit_up": Lever({"lim1": 1.0}, "Rate limit of the current away from zero."),
    "rate_limit_down": Lever({"lim2": 1.0}, "Rate limit of the current towards zero."),
    "dead_zone": Lever(
        {"V_dz": 1.0}, "Dead zone of the card's input; 0 is a dead zone compensated in full."
    ),
    "spool_stroke": Lever({"Z14": 1.0}, "Stroke of the spool: what is left without orifices."),
    "relief": Lever({"Z15": 1.0}, "Relief pressure of the stroking piston."),
    "plussing": Lever(
        {"Z18": 1.0}, "Displacement of the spool at rest, which makes the shaft creep."
    ),
}
SIDES = {"plus": "positive", "minus": "negative"}


def _one_way(lever: Lever, side: str) -> Lever:
    powers = {f"{symbol}_{side}": power for symbol, power in lever.powers.items()}
    return Lever(powers, f"The same, {SIDES[side]} direction only.")


LEVERS: Mapping[str, Lever] = MACHINE | {
    f"{name}_{side}": _one_way(lever, side)
    for name, lever in MACHINE.items()
    for side in SIDES
    if all(len(columns_of([symbol])) == len(SIDES) for symbol in lever.powers)
}
"""Levers by name; those of parameters with two directions also for each, as ``orifice_plus``."""


def find_lever(name: str) -> Lever:
    """A lever by name, or a parameter by its symbol or column; another one is an `InputError`."""
    if name in LEVERS:
        return LEVERS[name]
    if name in CATALOGUE or name in COLUMNS or name in REFINEMENTS:
        return Lever({name: 1.0}, f"Parameter {name}: {find(name).name}.")
    close = get_close_matches(name, [*LEVERS, *CATALOGUE, *COLUMNS], n=1)
    hint = f" (did you mean {close[0]}?)" if close else ""
    raise InputError(
        f"There is no lever '{name}'{hint}; the levers are {', '.join(MACHINE)}, those with two "
        "directions also as e.g. orifice_plus, and every parameter by its symbol."
    )


def levers_table() -> Table:
    """The levers, which parameters each multiplies, and what it is."""
    made = Table("", (Column("lever"), Column("multiplies"), Column("what it is", wrap=True)))
    for name, lever in MACHINE.items():
        how = {1.0: "", 2.0: " by its square"}
        by = ", ".join(f"{symbol}{how[power]}" for symbol, power in lever.powers.items())
        made.add(f"{name} _plus _minus" if f"{name}_plus" in LEVERS else name, by, lever.meaning)
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


def pulled_columns(
    numbers: Mapping[str, float], factors: Mapping[str, ArrayLike]
) -> dict[str, Array]:
    """Values of the parameters that levers move, as `Drive.simulate_many` takes them.

    Parameters
    ----------
    numbers : mapping of str to float
        Every value of the drive by column. [SI]
    factors : mapping of str to float or (m,) array_like
        By lever. Levers that move the same parameter multiply. [1]

    Returns
    -------
    dict of str to (m,) array
        By column such as ``Z16_plus``. [SI]

    Raises
    ------
    InputError
        For an unknown lever, a refinement without a value, a factor that is negative or NaN, or 0
        times infinity.
    """
    columns: dict[str, Array] = {}
    for name, given in factors.items():
        lever, factor = find_lever(name), np.asarray(given, dtype=np.float64)
        if not (factor >= 0.0).all():
            bad = factor[~(factor >= 0.0)].flat[0]
            raise InputError(f"The factor on {name} is {bad:g}, but must be 0 or more.")
        for symbol, power in lever.powers.items():
            for column in columns_of([symbol]):
                if column not in numbers:
                    raise InputError(f"{column} has no value here that a factor could change.")
                with np.errstate(invalid="ignore"):
                    moved = np.asarray(columns.get(column, numbers[column]) * factor**power)
                if np.isnan(moved).any():  # 0 times inf
                    what, bad = f"{numbers[column]:g}", factor[np.isnan(moved)].flat[0]
                    raise InputError(f"{column} is {what}, which the factor {bad:g} cannot change.")
                columns[column] = moved
    return columns


def pulled(drive: Drive, factors: Mapping[str, float]) -> Drive:
    """The drive with its levers moved, e.g. by ``{"orifice": 1.5, "pump": 1.5}``.

    Raises an `InputError` as `pulled_columns`, and a `ParameterError` if what comes out breaks a
    rule.
    """
    moved = pulled_columns(drive.parameters.numbers, factors)
    return drive.replace(**{column: float(value) for column, value in moved.items()})


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


@dataclass(frozen=True, eq=False)
class WhatIf(Result):
    """A drive before and after."""

    figure = "plot_whatif"

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

    def sentences(self) -> tuple[str, ...]:
        """Outcomes that a variant has not, and why."""
        return tuple(
            f"{name}: no {outcome.name}, {outcome.undefined}."
            for name, variant in self.variants.items()
            for outcome, value in zip(self.outcomes, variant.values, strict=True)
            if np.isnan(value)
        )

    def table(self, bands: Mapping[str, Bands] | None = None) -> Table:
        """Speed limits and outcomes of the drive as it is and changed.

        With the `bands` of both, of the same outcomes, each number has half of its interval.
        """
        rows = [("speed limit, positive", "rad/s"), ("speed limit, negative", "rad/s")]
        rows += [(each.words, each.unit) for each in self.outcomes]
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
        change = np.divide(
            values[1], values[0], where=values[0] != 0.0, out=np.full(len(rows), np.nan)
        )
        made = Table("", (Column(""), *columns, Column("change", "+z.1%"), UNIT))
        for k, (words, unit) in enumerate(rows):
            spec = {"s": "z.3f", "1": "z.2%"}.get(unit, "")
            row = (float(each[k]) for each in (*cells, change - 1.0))
            made.add(words, *row, unit="" if unit == "1" else unit, spec=spec)
        return made


def what_if(
    drive: Drive,
    factors: Mapping[str, float],
    trial: Trial,
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
    trial : Trial
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
    chosen = find_outcomes(outcomes)
    moved: dict[str, Mapping[str, float]] = {AS_IS: {}}
    if len(factors) > 1:
        moved |= {f"{name} x {factor:g}": {name: factor} for name, factor in factors.items()}
    moved[CHANGED] = factors
    variants = {}
    for name, own in moved.items():
        each = pulled(drive, own)
        run = each.simulate(trial.voltage, trial.rate)
        values = outcome_matrix(run.shaft_speed[None, :], trial, chosen)[0]
        variants[name] = Variant(each, run, values)
    return WhatIf(dict(factors), trial, chosen, variants)


# --- each lever by itself -------------------------------------------------------------------------

LEAST = 5e-4  # A lever that moves an outcome by less than this part has no row of its own.


@dataclass(frozen=True, eq=False)
class OneAtATime(Result):
    """Outcomes with each lever moved down and up by itself."""

    figure = "plot_tornado"

    ranges: Mapping[str, Range]  # Factors down and up by lever.
    outcomes: tuple[Outcome, ...]
    base: Array  # (K,) outcomes of the drive as it is; NaN where there is none.
    low: Array  # (L, K) with each lever at its lower factor.
    high: Array  # (L, K) with each lever at its upper factor.
    sentences: tuple[str, ...]  # What could not be simulated, or has no such outcome.

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
        spec = {"s": "z.3f", "1": "z.2%"}.get(outcome.unit, "z.2f")
        number = "none" if np.isnan(base) else quantity(base, outcome.unit, spec=spec)
        values = (spec, outcome.unit, "none")
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
    """
    check_ranges(ranges)
    names = [AS_IS, *(f"{name} x {f:g}" for name, pair in ranges.items() for f in pair)]
    factors = {name: np.ones(len(names)) for name in ranges}
    for number, (name, pair) in enumerate(ranges.items()):
        factors[name][1 + 2 * number : 3 + 2 * number] = pair
    chosen = find_outcomes(outcomes)
    found = sweep(drive, pulled_columns(drive.parameters.numbers, factors), trial, chosen)
    if 0 in found.failures:
        raise InputError(f"The drive as it is cannot follow this command: {found.failures[0]}")
    said = [f"{names[k]} cannot be simulated: {why}" for k, why in found.failures.items()]
    missing = np.isnan(found.values).sum(axis=0) - len(found.failures)
    said += [
        f"{number} of {len(names)} variants have no {each.name}: {each.undefined}."
        for each, number in zip(chosen, missing, strict=True)
        if number
    ]
    ends = found.values[0], found.values[1::2], found.values[2::2]
    return OneAtATime(dict(ranges), chosen, *ends, tuple(said))
