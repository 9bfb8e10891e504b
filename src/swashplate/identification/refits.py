"""What a stage's unknowns would be under other noise, and how far each can move: by fitting again.

Many fits from a good start, side by side: the bootstrap by refits, and profiles of all unknowns.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import DomainError
from swashplate.executors import Executor, Serial
from swashplate.identification.assessment import Assessment
from swashplate.identification.bootstrap import Bootstrap, refit_bootstrap
from swashplate.identification.drive_model import DriveModel, simulated_current
from swashplate.identification.fit import StageFit
from swashplate.identification.held import minimiser
from swashplate.identification.problem import Problem
from swashplate.identification.profiles import Profile, Threshold, profile, threshold
from swashplate.identification.resampling import Resampling
from swashplate.identification.solving import solve
from swashplate.identification.tones import separated
from swashplate.parameters.parameter_set import ParameterSet

Array = NDArray[np.float64]


class _Again(NamedTuple):
    """What a worker needs to fit a stage again to other noise."""

    stage: StageFit
    resampling: Resampling


def bootstraps_of(
    assessments: Sequence[Assessment],
    draws: int = 1000,
    *,
    seed: int = 0,
    executor: Executor | None = None,
    watch: Callable[[int], None] | None = None,
) -> dict[str, Bootstrap]:
    """Fit all stages again and again to what they simulate with other noise of the same colour.

    Parameters
    ----------
    assessments : sequence of Assessment
        Of the stages. In each draw a pump is driven by the current of the card of that draw.
    draws : int
        How many times.
    seed : int
        Of the noise; draw k is the same on any executor.
    executor : Executor, optional
        Where the fits run; here by default.
    watch : callable, optional
        Told how many are done.

    Returns
    -------
    dict of str to Bootstrap
        By stage.

    Raises
    ------
    InputError
        If there are fewer than two draws, or fewer than two of the fits ended.
    """
    shared = tuple(
        _Again(
            replace(each.stage, problem=replace(each.stage.problem, threads=1)),
            Resampling(separated(each.linearised).fit, seed=seed),
        )
        for each in assessments
    )
    found: dict[int, tuple[Array, ...] | None] = {}
    for number, vectors in (executor or Serial()).run(_refitted, shared, range(draws)):
        found[number] = vectors
        if watch is not None:
            watch(len(found))
    made = {}
    for place, again in enumerate(shared):
        vectors_of = {k: None if each is None else each[place] for k, each in found.items()}
        made[again.stage.stage.name] = refit_bootstrap(again.resampling, vectors_of.get, draws)
    return made


def _refitted(shared: tuple[_Again, ...], number: int) -> tuple[Array, ...] | None:
    """The vectors of all stages fitted to one draw; None if a fit did not end."""
    vectors: list[Array] = []
    parameters: ParameterSet | None = None
    for again in shared:
        stage = again.stage
        problem = _redrawn(again, number)
        if parameters is not None:
            problem = replace(problem, model=_driven(stage, parameters))
        try:
            solution = solve(problem, stage.solution.vector, tolerance=1e-7, max_evaluations=100)
        except DomainError:
            return None
        if not solution.converged:
            return None
        vectors.append(solution.vector)
        model = problem.model
        if isinstance(model, DriveModel) and model.part == "card":
            parameters = model.parameters_at(problem.unknowns.targets(solution.vector, ""))
    return tuple(vectors)


def _redrawn(again: _Again, number: int) -> Problem:
    """A stage's problem with other noise about what its optimum simulates."""
    problem, vector = again.stage.problem, again.stage.solution.vector
    drawn = again.resampling.differences(number)
    differences = {
        (run.name, run.channel): each
        for run, each in zip(again.resampling.fit.runs, drawn, strict=True)
    }
    experiments = []
    for place, experiment in enumerate(problem.experiments):
        channels = dict(experiment.channels)
        for name, simulated in problem.outputs(vector, place).items():
            used = problem.weights[place][name] > 0.0
            if not used.any():
                continue
            values = experiment[name].values.copy()
            values[used] = simulated[used] - differences[experiment.name, name]
            channels[name] = replace(experiment[name], values=values)
        experiments.append(replace(experiment, channels=channels))
    # a copy of the model, which would keep every draw's records otherwise
    return replace(problem, model=copy(problem.model), experiments=tuple(experiments))


def _driven(stage: StageFit, parameters: ParameterSet) -> DriveModel:
    """A stage's model with another card, whose current drives the pump where it did before."""
    model = stage.problem.model
    assert isinstance(model, DriveModel)
    currents = dict(model.currents)
    for each in stage.problem.experiments:
        if stage.stage.current == "simulated" and each.input.kind == "voltage" and currents:
            currents[each.name] = simulated_current(each, parameters)
    return DriveModel(parameters, model.part, currents, model.forces)


class _Sideways(NamedTuple):
    """What a worker needs to follow a profile."""

    problem: Problem
    vector: Array
    cost: float
    thresholds: dict[int, Threshold]
    steps: Array


def profiles_of(
    assessment: Assessment,
    names: Sequence[str] | None = None,
    *,
    executor: Executor | None = None,
    watch: Callable[[int], None] | None = None,
) -> dict[str, Profile]:
    """Profile likelihoods of a stage's unknowns.

    Parameters
    ----------
    assessment : Assessment
        Of the stage.
    names : sequence of str, optional
        Which unknowns; by default all of the machine that have an interval.
    executor, watch :
        As of `bootstraps_of`.

    Returns
    -------
    dict of str to Profile
        In the order of the unknowns. What earlier stages do not know is not in them.

    Raises
    ------
    InputError
        For a name that is none of the stage's unknowns.
    """
    problem, found = assessment.stage.problem, assessment.uncertainty
    variables = found.own.variables
    chosen = [
        k
        for k, unknown in enumerate(problem.unknowns)
        if (names is None and unknown.run is None and found.own.determined[k])
        or (names is not None and variables.names[k] in names)
    ]
    for name in names or ():
        variables.index(name)  # refuses what is none
    linearised = assessment.linearised
    cost = problem.cost(assessment.stage.solution.vector)
    errors = found.own.standard_errors
    thresholds = {
        k: threshold(
            cost,
            linearised.samples,
            linearised.rank,
            inflation=float(found.inflation[k]),
            freedom=float(found.own.degrees_of_freedom[k]),
            level=found.level,
        )
        for k in chosen
    }
    shared = _Sideways(
        replace(problem, threads=1), assessment.stage.solution.vector, cost, thresholds, errors
    )
    made: dict[str, Profile] = {}
    for position, each in (executor or Serial()).run(_profiled, shared, chosen):
        made[variables.names[chosen[position]]] = each
        if watch is not None:
            watch(len(made))
    return {variables.names[k]: made[variables.names[k]] for k in chosen}


def _profiled(shared: _Sideways, index: int) -> Profile:
    low, high = shared.problem.bounds
    step = shared.steps[index]
    if not (np.isfinite(step) and step > 0.0):
        step = 0.01 * (high[index] - low[index])
    return profile(
        minimiser(shared.problem),
        shared.vector,
        shared.cost,
        index,
        shared.thresholds[index],
        float(step),
        (float(low[index]), float(high[index])),
    )
