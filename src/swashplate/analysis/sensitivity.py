"""Sensitivities of outcomes to levers, one lever at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swashplate.analysis.levers import find_lever, pulled_columns
from swashplate.analysis.outcome_batch import batch_outcomes, undefined_sentences
from swashplate.analysis.outcomes import Outcome, find_outcomes
from swashplate.analysis.trial import Trial
from swashplate.drive import Drive
from swashplate.errors import InputError

Array = NDArray[np.float64]
Range = tuple[float, float]


@dataclass(frozen=True, eq=False)
class OneAtATime:
    """Outcomes with each lever moved down and up by itself."""

    levers: tuple[str, ...]
    outcomes: tuple[Outcome, ...]
    ranges: Mapping[str, Range]
    """Factors down and up by lever."""
    base: Array
    """(K,) outcomes of the drive as it is; NaN where there is none."""
    low: Array
    """(L, K) with each lever at its lower factor."""
    high: Array
    """(L, K) with each lever at its upper factor."""
    sentences: tuple[str, ...]
    """What could not be simulated, or has no such outcome."""

    @property
    def swings(self) -> Array:
        """(L, K) how far apart the two are, NaN where one of them is missing."""
        return np.abs(self.high - self.low)


def ranges_of(levers: Sequence[str], span: float = 0.1) -> dict[str, Range]:
    """Factors 1 - span and 1 + span for each lever.

    Raises
    ------
    InputError
        For an unknown lever, none, or a span that is not between 0 and 1.
    """
    if not levers:
        raise InputError("Name at least one lever, such as orifice.")
    if not 0.0 < span < 1.0:
        raise InputError(f"The span {span:g} of the factors must lie between 0 and 1.")
    return {find_lever(name).name: (1.0 - span, 1.0 + span) for name in levers}


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
    count = len(ranges)
    factors = {}
    for number, (name, (low, high)) in enumerate(ranges.items()):
        each = np.ones(2 * count + 1)
        each[1 + 2 * number : 3 + 2 * number] = low, high
        factors[name] = each
    columns = pulled_columns(drive.parameters.numbers, factors)
    found = batch_outcomes(drive, columns, trial, find_outcomes(outcomes), threads=threads)
    if 0 in found.failures:
        raise InputError(f"The drive as it is cannot follow this command: {found.failures[0]}")
    names = ["as it is", *(f"{name} x {f:g}" for name, pair in ranges.items() for f in pair)]
    failed = [f"{names[k]} cannot be simulated: {why}" for k, why in found.failures.items()]
    return OneAtATime(
        tuple(ranges),
        found.outcomes,
        dict(ranges),
        found.values[0],
        found.values[1::2],
        found.values[2::2],
        (*failed, *undefined_sentences(found)),
    )


def check_ranges(ranges: Mapping[str, Range]) -> None:
    """Refuse ranges that are none.

    Raises
    ------
    InputError
        For no lever, an unknown one, or a range that does not rise from 0 or more.
    """
    if not ranges:
        raise InputError("Name at least one lever, such as orifice.")
    for name, (low, high) in ranges.items():
        find_lever(name)
        if not 0.0 <= low < high < np.inf:
            raise InputError(
                f"The factors on {name} must rise from 0 or more, not {low:g} to {high:g}."
            )
