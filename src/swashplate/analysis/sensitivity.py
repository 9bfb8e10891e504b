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


# --- one at a time --------------------------------------------------------------------------------


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
        """Every number, a row for each outcome and lever."""
        return sensitivity_table(self, None)


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


# --- all at once ----------------------------------------------------------------------------------

FEWEST, MOST = 16, 2**20  # Base samples of Sobol's sequence.


@dataclass(frozen=True, eq=False)
class SobolIndices(Result):
    """Shares of the outcomes' variances that levers are the cause of."""

    figure = "plot_sobol"

    levers: tuple[str, ...]
    outcomes: tuple[Outcome, ...]
    ranges: Mapping[str, Range]  # Factors by lever; all values between are equally likely.
    first: Array  # (L, K) share that a lever causes by itself; NaN where an outcome has no indices.
    total: Array  # (L, K) share with all that it does together with others.
    first_error: Array  # (L, K) half width of the 95 % interval, from resampling.
    total_error: Array  # (L, K) as `first_error`.
    mean: Array  # (K,) of the outcomes. [their units]
    deviation: Array  # (K,) standard deviation of the outcomes. [their units]
    runs: int  # Simulations in all.
    sentences: tuple[str, ...]  # Which outcomes have no indices, and why.

    @property
    def largest_error(self) -> float:
        """Largest half width of an index that there is."""
        errors = np.array([self.first_error, self.total_error])
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
        As of `one_at_a_time`; factors are equally likely between the two ends.
    samples : int
        Base samples N, a power of 2; L levers take N (L + 2) simulations.
    seed : int
        Of the scrambled sequence and of the resampling for the errors.

    Raises
    ------
    InputError
        If SALib is not installed, the samples are no power of 2, a variant cannot be simulated, or
        as of `one_at_a_time`.

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
    try:
        sampling, analysis = (
            import_module(f"SALib.{part}.sobol") for part in ("sample", "analyze")
        )
    except ImportError:
        raise InputError(
            "Sobol's indices need SALib, which is not installed: pip install "
            "'swashplate[sensitivity]'."
        ) from None
    problem = {
        "num_vars": len(ranges),
        "names": list(ranges),
        "bounds": [list(pair) for pair in ranges.values()],
    }
    drawn = sampling.sample(problem, samples, calc_second_order=False, seed=seed)
    factors = {name: drawn[:, k] for k, name in enumerate(ranges)}
    columns = pulled_columns(drive.parameters.numbers, factors)
    found = batch_outcomes(drive, columns, trial, find_outcomes(outcomes), threads=threads)
    if found.failures:
        raise InputError(
            f"{len(found.failures)} of {len(drawn)} variants cannot be simulated, the first "
            f"because: {next(iter(found.failures.values())).rstrip('.')}; narrow the ranges."
        )
    indices, sentences = _indices(found, analysis, problem, seed)
    mean, deviation = found.values.mean(axis=0), found.values.std(axis=0)
    levers, runs = tuple(ranges), len(found.values)
    return SobolIndices(
        *(levers, found.outcomes, dict(ranges), *indices, mean, deviation, runs, sentences)
    )


def _indices(
    found: BatchOutcomes, analysis: Any, problem: dict[str, Any], seed: int
) -> tuple[Array, tuple[str, ...]]:
    """(4, L, K) both indices and their errors, and which outcomes have none."""
    keys = ("S1", "ST", "S1_conf", "ST_conf")
    indices = np.full((len(keys), problem["num_vars"], len(found.outcomes)), np.nan)
    sentences = list(found.sentences())
    for k, each in enumerate(found.outcomes):
        column = found.values[:, k]
        if np.isnan(column).any():
            continue
        if np.ptp(column) <= 1e-12 * np.abs(column).max():
            sentences.append(f"None of the levers moves {each.name}.")
            continue
        # 0 would mean to SALib that there is no seed
        made = analysis.analyze(
            problem, column, calc_second_order=False, seed=seed + 1, print_to_console=False
        )
        indices[:, :, k] = [made[key] for key in keys]
    return indices, tuple(sentences)


# --- tables ---------------------------------------------------------------------------------------

FAINTEST = 5e-4  # A lever that moves an outcome by less than this part has no row of its own.


def outcome_table(single: OneAtATime, indices: SobolIndices | None, number: int) -> Table:
    """Levers that move an outcome, the strongest first; those that do not stand in the caption."""
    outcome, base = single.outcomes[number], float(single.base[number])
    shown, decimals = outcome_unit(outcome), ".3f" if outcome.unit == "s" else ".2f"

    def words(value: float) -> str:
        return "none" if np.isnan(value) else f"{shown.factor * value:z{decimals}}"

    heads = () if indices is None else ("by itself", "in total")
    made = Table(
        f"{outcome.words}, {words(base)} {shown.name} as it is",
        (
            Column("lever"),
            *(Column(head, "s") for head in ("factors", "down", "up")),
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
    more: list[Array] = []
    if indices is not None:
        heads += ["first order", "first order, half width", "total", "total, half width"]
        more = [indices.first, indices.first_error, indices.total, indices.total_error]
    words = (Column("outcome"), Column("unit"), Column("lever"))
    made = Table("", (*words, *(Column(head, ".6g") for head in heads)))
    for k, outcome in enumerate(single.outcomes):
        for j, lever in enumerate(single.levers):
            ends = (each[j, k] for each in (single.low, single.high, *more))
            row = map(float, (*single.ranges[lever], single.base[k], *ends))
            made.add(outcome.name, outcome.unit, lever, *row)
    return made
