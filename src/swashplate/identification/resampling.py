"""Resampling: cross-validation over the runs."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import Experiment
from swashplate.errors import DomainError, InputError
from swashplate.executors import Executor, Serial
from swashplate.identification.estimation.problem import Loss
from swashplate.identification.estimation.setup import FitSetup
from swashplate.identification.estimation.solving import NO_EFFECT
from swashplate.identification.estimation.stages import Parameters
from swashplate.identification.fitting import Search, fit
from swashplate.identification.stage_fit import StageFit
from swashplate.identification.validation import (
    Measures,
    measures,
    pooled_measures,
    predict,
    with_speeds,
)
from swashplate.progress import counted
from swashplate.results import Result
from swashplate.tables import NONE, UNIT, Column, Table

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Fold(Result):
    """One part of the runs, and the fit to the others."""

    number: int
    """From 0."""
    held: tuple[str, ...]
    """Names of the runs that were held out."""
    lost: tuple[str, ...] = ()
    """Unknowns on which no run left in the fold depends: its fit leaves their values arbitrary."""
    measures: Mapping[str, Measures] = field(default_factory=dict)
    """Measures of each channel over the runs that were held out."""
    converged: bool = False
    failure: str = ""
    """Why there is no fit, or empty."""


@dataclass(frozen=True)
class CrossValidation(Result):
    """The folds of a campaign."""

    seed: int
    planned: int
    """Number of folds that were to be fitted."""
    folds: tuple[Fold, ...]
    measures: Mapping[str, Measures]
    """Measures of each channel over all runs, each predicted by a fit that did not see it."""
    units: Mapping[str, str]
    """SI unit of each channel."""

    def tables(self) -> list[Table]:
        """Errors held out, by channel, and the folds."""
        return folds_tables(self)

    def sentences(self) -> tuple[str, ...]:
        """Sentences on folds that are missing, did not converge or depend on the runs held out."""
        sentences = list[str]()
        if len(self.folds) < self.planned:
            sentences.append(f"Interrupted: {len(self.folds)} of {self.planned} folds were fitted.")
        for fold in self.folds:
            name = f"Fold {fold.number + 1} (without {', '.join(fold.held)})"
            if fold.failure:
                sentences.append(f"{name} could not be fitted: {fold.failure}")
            elif not fold.converged:
                sentences.append(f"{name} did not converge.")
            if fold.lost:
                sentences.append(
                    f"{name} loses {', '.join(fold.lost)}, on which no other run depends: its "
                    "prediction is not reliable."
                )
        return tuple(sentences)


def folds_tables(result: CrossValidation, stages: Sequence[StageFit] = ()) -> list[Table]:
    """Errors held out, next to those of the fit to all runs if its stages are given; the folds."""
    fitted_columns = "tpf" if stages else ""
    of_all_runs = pooled_measures(
        with_speeds(quality for stage in stages for quality in stage.runs)
    )
    held_out = Table(
        "Cross-validation: each part predicted by a fit to the others",
        (
            Column("channel"),
            Column("fit %", ".2f", "1", none="-"),
            Column("RMSE held out", ".3g"),
            Column("RMSE fitted", ".3g", none=NONE, of=fitted_columns),
            UNIT,
            Column("ratio", ".2f", "1", none=NONE, of=fitted_columns),
            Column("samples", ",d", "1", of="pf"),
        ),
    )
    for name, predicted in result.measures.items():
        fitted = of_all_runs[name].rmse if name in of_all_runs else None
        held_out.add(
            name,
            predicted.fit_percent,
            predicted.rmse,
            fitted,
            predicted.rmse / fitted if fitted else None,
            predicted.samples,
            unit=result.units[name],
        )
    columns = (Column("fold", "d"), Column("held out", wrap=True), Column("fit to the others"))
    folds = Table("Folds", (*columns, Column("fit % of those held out")))
    for fold in result.folds:
        state = "converged" if fold.converged else "not converged"
        if fold.failure:
            state = "not fitted"
        if fold.lost:
            state += f"; loses {', '.join(fold.lost)}"
        fits = (
            f"{name} {'-' if measures.fit_percent is None else f'{measures.fit_percent:.2f}'} %"
            for name, measures in fold.measures.items()
        )
        folds.add(fold.number + 1, ", ".join(fold.held), state, ", ".join(fits) or NONE)
    return [held_out, folds]


ONE_WAY = 0.25
"""A command whose smaller extreme is below this part of the larger one goes one way."""


def cross_validate(
    experiments: Sequence[Experiment],
    nominal: Parameters,
    setup: FitSetup,
    *,
    folds: int = 5,
    seed: int = 0,
    executor: Executor | None = None,
    loss: Loss = "linear",
    watch: Callable[[Fold, int], None] | None = None,
) -> CrossValidation:
    """Fit to all runs but some, predict those from the command alone, and so on for each part.

    Parameters
    ----------
    experiments, nominal, setup, loss :
        As of `fitting.fit`: each fit begins at nominal values, not at the fit to all runs, which
        has seen those that are held out.
    folds : int
        Parts, at least 2 and at most as many as there are runs: then each run is one.
    seed : int
        Of the dealing; the same seed, the same folds.
    executor : Executor, optional
        Where the fits run; here by default. The results do not depend on it.
    watch : callable, optional
        Called with each fold and how many there are by now. Ctrl-C ends it; folds that are done are
        returned.

    Raises
    ------
    InputError
        If there are fewer runs than folds, or fewer than 2 folds.
    """
    parts = deal(experiments, folds, seed)
    here = executor or Serial()
    # fits run side by side elsewhere, so each of them runs on one thread
    shared = tuple(experiments), nominal, setup, loss, None if isinstance(here, Serial) else 1
    done: dict[int, tuple[Fold, list[_Prediction]]] = {}
    try:
        folds_done = here.run(_fold, shared, list(enumerate(parts)))
        for number, (fold, predictions) in counted(folds_done, folds, "folds", "Cross-validating"):
            done[number] = fold, predictions
            if watch is not None:
                watch(fold, len(done))
    except KeyboardInterrupt:
        if not done:
            raise
    results = [done[number] for number in sorted(done)]
    predictions = [prediction for _, of_fold in results for prediction in of_fold]
    return CrossValidation(
        seed,
        len(parts),
        tuple(fold for fold, _ in results),
        _measures_of(predictions),
        {prediction.channel: prediction.unit for prediction in predictions},
    )


class _Prediction(NamedTuple):
    """A channel of a run that was held out: the samples that count."""

    channel: str
    unit: str
    measured: Array
    predicted: Array


def _measures_of(predictions: Sequence[_Prediction]) -> dict[str, Measures]:
    """Measures of each channel over some runs."""
    by_channel = defaultdict[str, list[tuple[Array, Array, None]]](list)
    for prediction in predictions:
        by_channel[prediction.channel].append((prediction.measured, prediction.predicted, None))
    return {channel: measures(*runs) for channel, runs in by_channel.items()}


def deal(experiments: Sequence[Experiment], folds: int, seed: int) -> tuple[tuple[int, ...], ...]:
    """Deal runs into folds, those of a kind and direction apart as far as there are folds.

    Gives the numbers of each fold's runs, increasing; folds differ by at most one run. The seed is
    that of the order within each kind.
    """
    if folds < 2:
        raise InputError(f"Cross-validation needs at least 2 folds, not {folds}.")
    if folds > len(experiments):
        raise InputError(
            f"{folds} folds need at least as many runs; there are {len(experiments)} to fit."
        )
    strata: dict[tuple[str, str], list[int]] = {}
    for number, experiment in enumerate(experiments):
        high = max(experiment.input.values.max(), 0.0)
        low = max(-experiment.input.values.min(), 0.0)
        direction = "plus" if high >= low else "minus"
        if min(high, low) > ONE_WAY * max(high, low):
            direction = "both"
        kind = experiment.maneuver.split(" ")[0]
        strata.setdefault((kind, direction), []).append(number)
    random = np.random.default_rng(seed)
    order = random.permutation(folds)
    dealt = [
        int(number) for _, runs in sorted(strata.items()) for number in random.permutation(runs)
    ]
    parts: list[list[int]] = [[] for _ in range(folds)]
    for position, number in enumerate(dealt):
        parts[order[position % folds]].append(number)
    return tuple(tuple(sorted(part)) for part in parts)


def _fold(
    shared: tuple[tuple[Experiment, ...], Parameters, FitSetup, Loss, int | None],
    task: tuple[int, tuple[int, ...]],
) -> tuple[Fold, list[_Prediction]]:
    (experiments, nominal, setup, loss, threads), (number, part) = shared, task
    left_out = [experiments[k] for k in part]
    others = [experiment for k, experiment in enumerate(experiments) if k not in part]
    names = tuple(run.name for run in left_out)
    try:
        result = fit(nominal, others, setup, loss=loss, threads=threads, search=Search(0))
        if result.stages[-1].solution.interrupted:
            raise KeyboardInterrupt
        predicted = with_speeds(predict(result.parameters, left_out))
    except (InputError, DomainError) as error:
        return Fold(number, names, failure=str(error)), []
    predictions = []
    for quality in predicted:
        channel = quality.experiment[quality.channel]
        predictions.append(
            _Prediction(
                channel=quality.channel,
                unit=channel.unit,
                measured=channel.values[channel.used],
                predicted=quality.simulated[channel.used],
            )
        )
    lost = list[str]()
    for stage in result.stages:
        effects = np.linalg.norm(stage.problem.evaluate(stage.solution.vector).jacobian, axis=0)
        least = NO_EFFECT * effects.max()
        each_one = zip(stage.problem.unknowns, effects, strict=True)
        lost += [
            unknown.name for unknown, effect in each_one if unknown.run is None and effect <= least
        ]
    converged = all(stage.solution.converged for stage in result.stages)
    fold = Fold(number, names, tuple(lost), _measures_of(predictions), converged)
    return fold, predictions
