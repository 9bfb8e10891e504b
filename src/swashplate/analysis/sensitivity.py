"""Sensitivities of outcomes to levers: one at a time, and Sobol's indices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swashplate.analysis.outcomes import (
    BatchOutcomes,
    Outcome,
    Trial,
    batch_outcomes,
    find_outcomes,
    outcome_unit,
    undefined_sentences,
)
from swashplate.analysis.whatif import find_lever, pulled_columns
from swashplate.drive import Drive
from swashplate.errors import InputError
from swashplate.tables import Cell, Column, Table

# --- sensitivity ----------------------------------------------------------------------------------


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


# --- sobol ----------------------------------------------------------------------------------------


FEWEST, MOST = 16, 2**20
"""Base samples of Sobol's sequence."""


@dataclass(frozen=True, eq=False)
class SobolIndices:
    """Shares of the outcomes' variances that levers are the cause of."""

    levers: tuple[str, ...]
    outcomes: tuple[Outcome, ...]
    ranges: Mapping[str, Range]
    """Factors by lever; all values between are equally likely."""
    first: Array
    """(L, K) share that a lever causes by itself; NaN where an outcome has no indices."""
    total: Array
    """(L, K) share with all that it does together with others."""
    first_error: Array
    """(L, K) half width of the 95 % interval, from resampling."""
    total_error: Array
    """(L, K) as `first_error`."""
    mean: Array
    """(K,) of the outcomes. [their units]"""
    deviation: Array
    """(K,) standard deviation of the outcomes. [their units]"""
    runs: int
    """Simulations in all."""
    sentences: tuple[str, ...]
    """Which outcomes have no indices, and why."""

    @property
    def largest_error(self) -> float:
        """Largest half width of an index that there is."""
        errors = np.concatenate([self.first_error.ravel(), self.total_error.ravel()])
        return float(np.max(errors[np.isfinite(errors)], initial=0.0))


def sobol(
    drive: Drive,
    ranges: Mapping[str, Range],
    trial: Trial,
    *,
    outcomes: Sequence[str],
    samples: int = 1024,
    seed: int = 0,
    threads: int | None = None,
) -> SobolIndices:
    """Sobol's indices of first order and in total.

    Parameters
    ----------
    drive, ranges, trial, outcomes, threads :
        As of `sensitivity.one_at_a_time`; factors are equally likely between the two ends.
    samples : int
        Base samples N, a power of 2; L levers take N (L + 2) simulations.
    seed : int
        Of the scrambled sequence and of the resampling for the errors.

    Raises
    ------
    InputError
        If SALib is not installed, the samples are no power of 2, a variant cannot be simulated, or
        as of `sensitivity.one_at_a_time`.

    Notes
    -----
    Saltelli's scheme over Sobol's sequence, the estimators of SALib (Saltelli et al. 2010).
    """
    check_ranges(ranges)
    if not FEWEST <= samples <= MOST or samples & (samples - 1):
        raise InputError(
            f"The base samples of Sobol's indices are {samples}, but must be a power of 2 from "
            f"{FEWEST} to {MOST}."
        )
    sampling, analysis = _salib("sample"), _salib("analyze")
    problem = {
        "num_vars": len(ranges),
        "names": list(ranges),
        "bounds": [list(pair) for pair in ranges.values()],
    }
    drawn = sampling.sample(problem, samples, calc_second_order=False, seed=seed)
    columns = pulled_columns(
        drive.parameters.numbers, {name: drawn[:, k] for k, name in enumerate(ranges)}
    )
    found = batch_outcomes(drive, columns, trial, find_outcomes(outcomes), threads=threads)
    if found.failures:
        raise InputError(
            f"{len(found.failures)} of {len(drawn)} variants cannot be simulated, the first "
            f"because: {next(iter(found.failures.values())).rstrip('.')}; narrow the ranges."
        )
    return _indices(found, analysis, problem, dict(ranges), seed)


def _indices(
    found: BatchOutcomes,
    analysis: Any,
    problem: dict[str, Any],
    ranges: dict[str, Range],
    seed: int,
) -> SobolIndices:
    values = found.values
    shape = (len(ranges), len(found.outcomes))
    parts = {key: np.full(shape, np.nan) for key in ("S1", "ST", "S1_conf", "ST_conf")}
    sentences = list(undefined_sentences(found))
    for k, each in enumerate(found.outcomes):
        column = values[:, k]
        if np.isnan(column).any():
            continue
        if np.ptp(column) <= 1e-12 * np.abs(column).max():
            sentences.append(f"None of the levers moves {each.name}.")
            continue
        made = analysis.analyze(
            problem, column, calc_second_order=False, seed=seed, print_to_console=False
        )
        for key, into in parts.items():
            into[:, k] = made[key]
    return SobolIndices(
        tuple(ranges),
        found.outcomes,
        ranges,
        parts["S1"],
        parts["ST"],
        parts["S1_conf"],
        parts["ST_conf"],
        values.mean(axis=0),
        values.std(axis=0),
        len(values),
        tuple(sentences),
    )


def _salib(part: str) -> Any:
    try:
        return import_module(f"SALib.{part}.sobol")
    except ImportError:
        raise InputError(
            "Sobol's indices need SALib, which is not installed: pip install "
            "'swashplate[sensitivity]'."
        ) from None


FAINTEST = 5e-4
"""A lever that moves an outcome by less than this part has no row of its own."""


def outcome_table(single: OneAtATime, indices: SobolIndices | None, number: int) -> Table:
    """Levers that move an outcome, the strongest first; those that do not stand in the caption."""
    outcome, base = single.outcomes[number], float(single.base[number])
    shown = outcome_unit(outcome)
    decimals = ".3f" if outcome.unit == "s" else ".2f"

    def words(value: float) -> str:
        return "none" if np.isnan(value) else f"{shown.factor * value:z{decimals}}"

    heads = () if indices is None else ("by itself", "in total")
    made = Table(
        f"{outcome.words}, {words(base)} {shown.name} as it is",
        (
            Column("lever"),
            Column("factors", "s"),
            Column("down", "s"),
            Column("up", "s"),
            Column("swing", ".1%"),
            *(Column(head, "z.3f", none="none") for head in heads),
        ),
    )
    swings = np.nan_to_num(single.swings[:, number], nan=0.0)
    shares = np.zeros(swings.size) if indices is None else indices.total[:, number]
    quiet = []
    for k in np.argsort(-swings, kind="stable"):
        lever = single.levers[k]
        ends = [float(single.low[k, number]), float(single.high[k, number])]
        missing = np.isnan(ends).any()
        if not missing and swings[k] <= FAINTEST * abs(base) and not shares[k] > FAINTEST:
            quiet.append(lever)
            continue
        low, high = single.ranges[lever]
        swing = None if missing or base == 0.0 else swings[k] / abs(base)
        values = () if indices is None else (indices.first[k, number], indices.total[k, number])
        made.add(lever, f"{low:g} {high:g}", *(Cell(e, words(e)) for e in ends), swing, *values)
    if quiet:
        made.caption = f"not moved by {', '.join(quiet)}"
    return made


def sensitivity_table(single: OneAtATime, indices: SobolIndices | None) -> Table:
    """Every number, a row for each outcome and lever, SI."""
    heads = ["lower factor", "upper factor", "as it is", "at lower factor", "at upper factor"]
    if indices is not None:
        heads += ["first order", "first order, half width", "total", "total, half width"]
    words = (Column("outcome"), Column("unit"), Column("lever"))
    made = Table("", (*words, *(Column(head, ".6g") for head in heads)))
    for k, outcome in enumerate(single.outcomes):
        for j, lever in enumerate(single.levers):
            row = [*single.ranges[lever], single.base[k], single.low[j, k], single.high[j, k]]
            if indices is not None:
                found = (indices.first, indices.first_error, indices.total, indices.total_error)
                row += [each[j, k] for each in found]
            made.add(outcome.name, outcome.unit, lever, *map(float, row))
    return made
