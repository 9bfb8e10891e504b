"""Cross-validation over experiments: each part of the runs predicted by a fit to the others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.experiment import Experiment
from swashplate.errors import DomainError, InputError
from swashplate.executors import Executor, Serial
from swashplate.identification.fit import Fit, fit, smooth
from swashplate.identification.fold_results import (
    CrossValidation,
    Fold,
    FoldEstimate,
    HeldRun,
)
from swashplate.identification.setup import Setup
from swashplate.identification.solving import Loss
from swashplate.identification.staging import stage_problem
from swashplate.identification.validation import predict, with_speeds
from swashplate.parameters.parameter_set import ParameterSet

Array = NDArray[np.float64]
LEFT = 0.01
"""Share of what all runs tell of an unknown, below which the runs left in a fold do not tell it."""
ONE_WAY = 0.25
"""A command whose smaller extreme is below this part of the larger one goes one way."""


@dataclass(frozen=True)
class _Task:
    """What the fits of all folds share."""

    experiments: tuple[Experiment, ...]
    nominal: ParameterSet
    setup: Setup
    loss: Loss
    tolerance: float
    max_evaluations: int
    threads: int | None


class _Item(NamedTuple):
    number: int
    held: tuple[int, ...]


def cross_validate(
    experiments: Sequence[Experiment],
    nominal: ParameterSet,
    setup: Setup,
    *,
    folds: int = 5,
    seed: int = 0,
    executor: Executor | None = None,
    loss: Loss = "linear",
    tolerance: float = 1e-10,
    max_evaluations: int = 300,
    watch: Callable[[Fold, int], None] | None = None,
) -> CrossValidation:
    """Fit to all runs but some, predict those from the command alone, and so on for each part.

    Parameters
    ----------
    experiments : sequence of Experiment
        The runs of the fit.
    nominal : ParameterSet
        Where each fit begins: not at the fit to all runs, which has seen those that are held out.
    setup : Setup
        Stages and free parameters.
    folds : int
        Parts, at least 2 and at most as many as there are runs: then each run is one.
    seed : int
        Of the dealing; the same seed, the same folds.
    executor : Executor, optional
        Where the fits run; here, one after another, by default. The results do not depend on it.
    loss, tolerance, max_evaluations :
        As of `fit.fit`.
    watch : callable, optional
        Told of each fold and how many there are by now. Ctrl-C ends it; folds that are done are
        returned.

    Raises
    ------
    InputError
        If there are fewer runs than folds, or fewer than 2 folds.
    """
    parts = deal(experiments, folds, seed)
    here = executor or Serial()
    task = _Task(
        tuple(experiments),
        nominal,
        setup,
        loss,
        tolerance,
        max_evaluations,
        # fits run side by side elsewhere, so each of them runs on one thread
        None if isinstance(here, Serial) else 1,
    )
    done: dict[int, Fold] = {}
    try:
        for _, fold in here.run(_fold, task, [_Item(k, part) for k, part in enumerate(parts)]):
            done[fold.number] = fold
            if watch is not None:
                watch(fold, len(done))
    except KeyboardInterrupt:
        if not done:
            raise
    return CrossValidation(seed, len(parts), tuple(done[number] for number in sorted(done)))


def deal(experiments: Sequence[Experiment], folds: int, seed: int) -> tuple[tuple[int, ...], ...]:
    """Deal runs into folds, those of a kind and direction apart as far as there are folds.

    Parameters
    ----------
    experiments : sequence of Experiment
        The runs.
    folds : int
        How many parts.
    seed : int
        Of the order within each kind.

    Returns
    -------
    tuple of tuple of int
        Places of each fold's runs, increasing. Folds differ by at most one run.

    Raises
    ------
    InputError
        If there are fewer runs than folds, or fewer than 2 folds.
    """
    if folds < 2:
        raise InputError(f"Cross-validation needs at least 2 folds, not {folds}.")
    if folds > len(experiments):
        raise InputError(
            f"{folds} folds need at least as many runs; there are {len(experiments)} to fit."
        )
    strata: dict[tuple[str, str], list[int]] = {}
    for place, each in enumerate(experiments):
        strata.setdefault((each.maneuver.split(" ")[0], _direction(each)), []).append(place)
    random = np.random.default_rng(seed)
    parts: list[list[int]] = [[] for _ in range(folds)]
    order = random.permutation(folds)
    dealt = 0
    for _, places in sorted(strata.items()):
        for place in random.permutation(places):
            parts[order[dealt % folds]].append(int(place))
            dealt += 1
    return tuple(tuple(sorted(part)) for part in parts)


def _direction(experiment: Experiment) -> str:
    values = experiment.input.values
    high, low = max(float(values.max()), 0.0), max(-float(values.min()), 0.0)
    if min(high, low) > ONE_WAY * max(high, low):
        return "both"
    return "plus" if high >= low else "minus"


def _fold(task: _Task, item: _Item) -> Fold:
    held = [task.experiments[place] for place in item.held]
    others = [each for place, each in enumerate(task.experiments) if place not in item.held]
    names = tuple(each.name for each in held)
    try:
        result = fit(
            others,
            task.nominal,
            task.setup,
            loss=task.loss,
            tolerance=task.tolerance,
            max_evaluations=task.max_evaluations,
            threads=task.threads,
        )
        if result.stages[-1].solution.interrupted:
            raise KeyboardInterrupt
        runs = tuple(HeldRun.of(each) for each in with_speeds(predict(result.parameters, held)))
    except (InputError, DomainError) as error:
        return Fold(item.number, names, (), (), (), False, str(error))
    return Fold(
        item.number,
        names,
        tuple(
            FoldEstimate(each.stage.name, unknown.name, unknown.unit, each.values[unknown.name])
            for each in result.stages
            for unknown in each.problem.unknowns
            if unknown.run is None
        ),
        _lost(result, held, task.threads),
        runs,
        all(each.solution.converged for each in result.stages),
        "",
    )


def _lost(result: Fit, held: Sequence[Experiment], threads: int | None) -> tuple[str, ...]:
    """Unknowns that the runs held out tell, and those left in do not."""
    lost, before = [], smooth(result.nominal)
    for stage in result.stages:
        try:
            apart = stage_problem(stage.stage, before, held, threads=threads)
        except InputError:  # none of them has a channel of this stage
            before = stage.parameters
            continue
        before = stage.parameters
        left = _information(stage.problem.evaluate(stage.solution.vector).jacobian)
        there = _information(apart.evaluate(apart.unknowns.vector_of(stage.values)).jacobian)
        told = dict(zip(apart.unknowns.names, there, strict=True))
        lost += [
            unknown.name
            for unknown, kept in zip(stage.problem.unknowns, left, strict=True)
            if unknown.run is None and kept < LEFT * (kept + told.get(unknown.name, 0.0))
        ]
    return tuple(lost)


def _information(jacobian: Array) -> Array:
    squares: Array = np.sum(jacobian**2, axis=0)
    return squares
