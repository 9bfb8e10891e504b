"""Sensitivities of outcomes to levers, each moved by itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swashplate.analysis.outcomes import (
    Outcome,
    Trial,
    batch_outcomes,
    find_outcomes,
    outcome_unit,
)
from swashplate.analysis.whatif import Range, check_ranges, find_lever, pulled_columns
from swashplate.drive import Drive
from swashplate.errors import InputError
from swashplate.results import Result
from swashplate.tables import Cell, Column, Table

Array = NDArray[np.float64]


def ranges_of(levers: Sequence[str], span: float = 0.1) -> dict[str, Range]:
    """Factors 1 - span and 1 + span for each lever.

    Raises
    ------
    InputError
        For an unknown lever, none, or a span that is not between 0 and 1.
    """
    if not 0.0 < span < 1.0:
        raise InputError(f"The span {span:g} of the factors must lie between 0 and 1.")
    ranges = {find_lever(name).name: (1.0 - span, 1.0 + span) for name in levers}
    check_ranges(ranges)
    return ranges


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
    threads: int | None = None,
) -> OneAtATime:
    """Move each lever down and up by itself.

    Parameters
    ----------
    drive : Drive
        As it is.
    ranges : mapping of str to (float, float)
        Lower and upper factor by lever, see `ranges_of`. [1]
    trial : Trial
        The command.
    outcomes : sequence of str
        Names in `outcomes.OUTCOMES`.
    threads : int, optional
        One a core by default.

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
    found = batch_outcomes(drive, columns, trial, find_outcomes(outcomes), threads=threads)
    if 0 in found.failures:
        raise InputError(f"The drive as it is cannot follow this command: {found.failures[0]}")
    names = ["as it is", *(f"{name} x {f:g}" for name, pair in ranges.items() for f in pair)]
    failed = [f"{names[k]} cannot be simulated: {why}" for k, why in found.failures.items()]
    base, low, high = found.values[0], found.values[1::2], found.values[2::2]
    said = (*failed, *found.sentences())
    return OneAtATime(tuple(ranges), found.outcomes, dict(ranges), base, low, high, said)


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
