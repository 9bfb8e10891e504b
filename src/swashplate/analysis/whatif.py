"""What if: levers of a machine, a drive before and after they are moved, and each by itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.analysis.outcomes import (
    OUTCOMES,
    Outcome,
    Trial,
    batch_outcomes,
    find_outcomes,
    outcome_matrix,
    outcome_unit,
)
from swashplate.drive import Drive
from swashplate.errors import InputError
from swashplate.parameters.definitions import CATALOGUE, COLUMNS, REFINEMENTS, columns_of, find
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.results import Result
from swashplate.simulation.result import Simulation
from swashplate.tables import UNIT, Cell, Column, Table

Array = NDArray[np.float64]
Range = tuple[float, float]  # Lowest and highest factor on a lever. [1]

# --- levers ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Lever:
    """Something on the machine that a factor can be put on."""

    name: str
    powers: Mapping[str, float]
    """By symbol or column: the parameter is multiplied by the factor to this power."""
    meaning: str  # What it is, and what the model takes it for.


def _both_ways(name: str, symbols: Mapping[str, float], meaning: str) -> list[Lever]:
    """A lever for both directions, and one for each."""
    levers = [Lever(name, symbols, meaning)]
    for side, way in (("plus", "positive"), ("minus", "negative")):
        powers = {f"{symbol}_{side}": power for symbol, power in symbols.items()}
        levers.append(Lever(f"{name}_{side}", powers, f"The same, {way} direction only."))
    return levers


_LEVERS = (
    *_both_ways(
        "orifice",
        {"Z16": 1.0},
        "Opening area of the in-line orifices, as the spool displacement of equal area: the "
        "acceleration limit.",
    ),
    *_both_ways(
        "orifice_diameter",
        {"Z16": 2.0},
        "Bore of the in-line orifices; their area, and with it the opening, goes with its square.",
    ),
    Lever(
        "pump",
        {"Z10": 1.0, "Z12": 1.0},
        "Displacement of the pump: flow, and speed of the shaft, at the same swash angle.",
    ),
    Lever(
        "drive_speed",
        {"Z10": 1.0, "Z12": 1.0},
        "Speed of the motor that turns the pump. Flow goes with it as with the displacement; the "
        "control pressure does not, a relief valve holds it.",
    ),
    Lever(
        "supply_pressure",
        {"Z9": 1.0},
        "Control pressure that moves the stroking piston: its flow goes with the root.",
    ),
    *_both_ways("rate_limits", {"lim1": 1.0, "lim2": 1.0}, "Both rate limits of the card's ramps."),
    *_both_ways("rate_limit_up", {"lim1": 1.0}, "Rate limit of the current away from zero."),
    *_both_ways("rate_limit_down", {"lim2": 1.0}, "Rate limit of the current towards zero."),
    *_both_ways(
        "dead_zone",
        {"V_dz": 1.0},
        "Dead zone of the card's input; 0 is a dead zone compensated in full.",
    ),
    Lever("spool_stroke", {"Z14": 1.0}, "Stroke of the spool: what is left without orifices."),
    Lever("relief", {"Z15": 1.0}, "Relief pressure of the stroking piston."),
    Lever(
        "plussing", {"Z18": 1.0}, "Displacement of the spool at rest, which makes the shaft creep."
    ),
)

LEVERS: Mapping[str, Lever] = {each.name: each for each in _LEVERS}  # Levers by name.


def find_lever(name: str) -> Lever:
    """A lever by name, or a parameter by its symbol or column; another one is an `InputError`."""
    if name in LEVERS:
        return LEVERS[name]
    if name in CATALOGUE or name in COLUMNS or name in REFINEMENTS:
        return Lever(name, {name: 1.0}, f"Parameter {name}: {find(name).name}.")
    close = get_close_matches(name, [*LEVERS, *CATALOGUE, *COLUMNS], n=1)
    hint = f" (did you mean {close[0]}?)" if close else ""
    main = [each for each in LEVERS if not each.endswith(("_plus", "_minus"))]
    raise InputError(
        f"There is no lever '{name}'{hint}; the levers are {', '.join(main)}, those with two "
        "directions also as e.g. orifice_plus, and every parameter by its symbol."
    )


def check_ranges(ranges: Mapping[str, Range], around: float | None = None) -> None:
    """Refuse, in an `InputError`, no lever, an unknown one, or factors that do not rise from 0 on.

    With `around` they must also have this factor between them.
    """
    if not ranges:
        raise InputError("Name at least one lever, such as orifice.")
    for name, (low, high) in ranges.items():
        find_lever(name)
        if around is not None and not (0.0 <= low <= around <= high < np.inf and low < high):
            raise InputError(
                f"The factors on {name} must reach from at most {around:g} to at least {around:g}, "
                f"not from {low:g} to {high:g}."
            )
        if not 0.0 <= low < high < np.inf:
            raise InputError(
                f"The factors on {name} must rise from 0 or more, not {low:g} to {high:g}."
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
                columns[column] = columns.get(column, np.ones(())) * factor**power
    with np.errstate(invalid="ignore"):
        made = {name: np.asarray(numbers[name] * factor) for name, factor in columns.items()}
    for name, values in made.items():
        if np.isnan(values).any():  # 0 times inf
            bad = columns[name][np.isnan(values)].flat[0]
            raise InputError(
                f"{name} is {numbers[name]:g}, which the factor {bad:g} cannot change."
            )
    return made


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

    def table(self, widths: Mapping[str, Array] | None = None) -> Table:
        """Speed limits and outcomes of the drive as it is and changed.

        `widths` are half of the intervals of both speed limits and of each outcome, (2 + K,) by
        variant, as `monte_carlo.half_widths` gives them. [SI]
        """
        error = () if widths is None else (Column("±", "z.2f", none="none"),)
        columns = [
            each
            for name in (AS_IS, CHANGED)
            for each in (Column(name, "z.2f", none="none"), *error)
        ]
        made = Table("", (Column(""), *columns, Column("change", "+z.1%"), UNIT))
        rows = [("speed limit, positive", "rad/s"), ("speed limit, negative", "rad/s")]
        rows += [(each.words, each.unit) for each in self.outcomes]
        for k, (words, unit) in enumerate(rows):
            cells: list[float | None] = []
            for name in (AS_IS, CHANGED):
                variant = self.variants[name]
                cells.append(float([*variant.speed_limits, *variant.values][k]))
                cells += [] if widths is None else [float(widths[name][k])]
            before, after = cells[0], cells[1 if widths is None else 2]
            assert after is not None
            change = after / before - 1.0 if before else None
            spec = {"s": "z.3f", "1": "z.2%"}.get(unit, "")
            made.add(words, *cells, change, unit="" if unit == "1" else unit, spec=spec)
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
    drives = {AS_IS: drive}
    if len(factors) > 1:
        drives |= {f"{name} x {f:g}": pulled(drive, {name: f}) for name, f in factors.items()}
    drives[CHANGED] = pulled(drive, factors)
    variants = {}
    for name, each in drives.items():
        run = each.simulate(trial.voltage, trial.rate)
        values = outcome_matrix(run.shaft_speed[None, :], trial, chosen)[0]
        variants[name] = Variant(each, run, values)
    return WhatIf(dict(factors), trial, chosen, variants)


def levers_table() -> Table:
    """The levers, which parameters each multiplies, and what it is."""
    made = Table("", (Column("lever"), Column("multiplies"), Column("what it is", wrap=True)))
    for lever in LEVERS.values():
        if lever.meaning.startswith("The same"):
            continue
        by = ", ".join(
            symbol if power == 1.0 else f"{symbol} by its square"
            for symbol, power in lever.powers.items()
        )
        ways = " _plus _minus" if f"{lever.name}_plus" in LEVERS else ""
        made.add(f"{lever.name}{ways}", by, lever.meaning)
    return made


# --- each lever by itself -------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class OneAtATime(Result):
    """Outcomes with each lever moved down and up by itself."""

    figure = "plot_tornado"

    levers: tuple[str, ...]
    outcomes: tuple[Outcome, ...]
    ranges: Mapping[str, Range]  # Factors down and up by lever.
    base: Array  # (K,) outcomes of the drive as it is; NaN where there is none.
    low: Array  # (L, K) with each lever at its lower factor.
    high: Array  # (L, K) with each lever at its upper factor.
    sentences: tuple[str, ...]  # What could not be simulated, or has no such outcome.

    @property
    def swings(self) -> Array:
        """(L, K) how far apart the two are, NaN where one of them is missing."""
        return np.abs(self.high - self.low)

    def table(self) -> Table:
        """Every number, a row for each outcome and lever, SI."""
        heads = ["lower factor", "upper factor", "as it is", "at lower factor", "at upper factor"]
        words = (Column("outcome"), Column("unit"), Column("lever"))
        made = Table("", (*words, *(Column(head, ".6g") for head in heads)))
        for k, outcome in enumerate(self.outcomes):
            for j, lever in enumerate(self.levers):
                ends = (self.base[k], self.low[j, k], self.high[j, k])
                made.add(
                    outcome.name, outcome.unit, lever, *map(float, (*self.ranges[lever], *ends))
                )
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
    factors = {}
    for number, (name, pair) in enumerate(ranges.items()):
        factors[name] = np.ones(2 * len(ranges) + 1)
        factors[name][1 + 2 * number : 3 + 2 * number] = pair
    columns = pulled_columns(drive.parameters.numbers, factors)
    chosen = find_outcomes(outcomes)
    found = batch_outcomes(drive, columns, trial, chosen)
    if 0 in found.failures:
        raise InputError(f"The drive as it is cannot follow this command: {found.failures[0]}")
    names = [AS_IS, *(f"{name} x {f:g}" for name, pair in ranges.items() for f in pair)]
    said = [f"{names[k]} cannot be simulated: {why}" for k, why in found.failures.items()]
    missing = np.isnan(np.delete(found.values, list(found.failures), axis=0)).sum(axis=0)
    said += [
        f"{number} of {len(names)} variants have no {each.name}: {each.undefined}."
        for each, number in zip(chosen, missing, strict=True)
        if number
    ]
    ends = found.values[0], found.values[1::2], found.values[2::2]
    return OneAtATime(tuple(ranges), chosen, dict(ranges), *ends, tuple(said))


FAINTEST = 5e-4  # A lever that moves an outcome by less than this part has no row of its own.


def outcome_table(single: OneAtATime, number: int) -> Table:
    """Levers that move an outcome, the strongest first; those that do not stand in the caption."""
    outcome, base = single.outcomes[number], float(single.base[number])
    shown, decimals = outcome_unit(outcome), ".3f" if outcome.unit == "s" else ".2f"

    def words(value: float) -> str:
        return "none" if np.isnan(value) else f"{shown.factor * value:z{decimals}}"

    made = Table(
        f"{outcome.words}, {words(base)} {shown.name} as it is",
        (
            Column("lever"),
            *(Column(head, "s") for head in ("factors", "down", "up")),
            Column("swing", ".1%"),
        ),
    )
    swings = np.nan_to_num(single.swings[:, number], nan=0.0)
    quiet = []
    for k in np.argsort(-swings, kind="stable"):
        lever = single.levers[k]
        ends = [float(single.low[k, number]), float(single.high[k, number])]
        missing = np.isnan(ends).any()
        if not missing and swings[k] <= FAINTEST * abs(base):
            quiet.append(lever)
            continue
        low, high = single.ranges[lever]
        swing = None if missing or base == 0.0 else swings[k] / abs(base)
        made.add(lever, f"{low:g} {high:g}", *(Cell(e, words(e)) for e in ends), swing)
    if quiet:
        few = len(quiet) < len(single.levers)
        made.caption = f"not moved by {', '.join(quiet)}" if few else "no lever moves it"
    return made
