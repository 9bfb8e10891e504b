"""The fit of a drive to a campaign: stage after stage, each from what the ones before found."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from hashlib import blake2b
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from swashplate.__about__ import __version__
from swashplate.campaign.experiment import Experiment
from swashplate.executors import Executor, Serial
from swashplate.identification.data_checks import check_sound, refuse_unsound
from swashplate.identification.drive_model import DriveModel
from swashplate.identification.drives import at_rate_of
from swashplate.identification.problem import Problem
from swashplate.identification.setup import Setup, Stage
from swashplate.identification.solving import Loss, Method, Progress, Solution, solve
from swashplate.identification.staging import stage_problem
from swashplate.identification.starts import StartResult, sobol_starts, solve_from
from swashplate.identification.uncertainty import weighed
from swashplate.parameters.parameter_set import ParameterSet

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Search:
    """Starts besides the nominal one, in each stage."""

    starts: int
    """Sobol points over the bounds, besides the nominal values."""
    seed: int = 0
    executor: Executor = field(default_factory=Serial)
    store: Path | None = None
    """Folder that keeps each result as it is ready, a folder in it for each stage."""
    resume: bool = False
    """Take what is in the store instead of computing it again."""
    watch: Callable[[str, StartResult, int], None] | None = None
    """Told the stage, each result and how many there are by now."""


@dataclass(frozen=True, eq=False)
class StageFit:
    """What one stage found."""

    stage: Stage
    problem: Problem
    solution: Solution
    parameters: ParameterSet
    """The drive with what was found."""
    starts: tuple[StartResult, ...] = ()
    """How each start ended, where there was more than one."""

    @property
    def values(self) -> dict[str, float]:
        """The unknowns by name, in their units."""
        return self.problem.unknowns.values(self.solution.vector)


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted drive and how it came about."""

    setup: Setup
    nominal: ParameterSet
    stages: tuple[StageFit, ...]
    doubts: tuple[str, ...] = ()
    """What the runs lack, in sentences, where they could be fitted all the same."""

    @property
    def parameters(self) -> ParameterSet:
        """The fitted drive's parameters."""
        return self.stages[-1].parameters

    @property
    def interrupted(self) -> bool:
        """Whether it was stopped before the last stage's optimum."""
        return self.stages[-1].solution.interrupted


def fit(
    experiments: Sequence[Experiment],
    nominal: ParameterSet,
    setup: Setup,
    *,
    method: Method = "trf",
    loss: Loss = "linear",
    tolerance: float = 1e-10,
    max_evaluations: int = 300,
    threads: int | None = None,
    search: Search | None = None,
    watch: Callable[[str, Progress], None] | None = None,
) -> Fit:
    """Fit a drive to experiments.

    Parameters
    ----------
    experiments : sequence of Experiment
        The runs to fit.
    nominal : ParameterSet
        Where to begin, and what stays fixed. The decay's switch is split, see `smooth`, and the
        card's filter one that holds at the rate of the runs.
    setup : Setup
        Stages and their free parameters.
    method, loss, tolerance, max_evaluations :
        As of `solving.solve`, in each stage.
    threads : int, optional
        Threads over experiments; all cores by default. The result does not depend on it.
    search : Search, optional
        More starts than the nominal one; the best is refined.
    watch : callable, optional
        Told the stage's name and each of its iterations.

    Raises
    ------
    InputError, ParameterError
        If campaign and set-up do not fit each other, or no fit of these runs can mean anything
        (`soundness`).
    DomainError
        If the model does not hold at the nominal values.
    """
    doubts = refuse_unsound(check_sound(experiments, smooth(nominal), setup))
    nominal, changed = at_rate_of(experiments, nominal)
    parameters, stages, doubts = smooth(nominal), [], (*doubts, *changed)
    for stage in setup.stages:
        problem = stage_problem(stage, parameters, experiments, threads=threads)
        begin: Array | None = None
        results: tuple[StartResult, ...] = ()
        if search is not None and search.starts > 0:
            results = _searched(stage, problem, search, method, tolerance, max_evaluations)
            begin = np.array(min(results, key=lambda each: each.cost).vector)
        solved = partial(
            solve,
            method=method,
            loss=loss,
            tolerance=tolerance,
            max_evaluations=max_evaluations,
            watch=None if watch is None else _named(watch, stage.name),
        )
        solution = solved(problem, begin)
        if any(each.prior is not None for each in problem.unknowns) and not solution.interrupted:
            # what the residuals are worth is known only now
            problem = weighed(problem, solution.vector)
            solution = solved(problem, solution.vector)
        model = problem.model
        assert isinstance(model, DriveModel)
        parameters = model.parameters_at(problem.unknowns.targets(solution.vector, ""))
        stages.append(StageFit(stage, problem, solution, parameters, results))
        if solution.interrupted:
            break
    return Fit(setup, nominal, tuple(stages), doubts)


def refined(
    staged: Fit,
    experiments: Sequence[Experiment],
    *,
    tolerance: float = 1e-10,
    max_evaluations: int = 100,
    threads: int | None = None,
    watch: Callable[[str, Progress], None] | None = None,
) -> Fit:
    """All unknowns of a staged fit at once through the whole chain, from where the stages ended.

    A staged fit takes each stage's result for granted in the next one, so that its intervals leave
    out what the earlier stages do not know. Those of a joint fit do not; from afar, though, a joint
    fit is often caught on its way.

    Parameters
    ----------
    staged : Fit
        Of more than one stage.
    experiments, tolerance, max_evaluations, threads, watch :
        As of `fit`.
    """
    return fit(
        experiments,
        staged.parameters,
        staged.setup.joint(),
        tolerance=tolerance,
        max_evaluations=max_evaluations,
        threads=threads,
        watch=watch,
    )


def smooth(parameters: ParameterSet) -> ParameterSet:
    """The set with the decay's switch split within the step.

    Sampled, as published, it makes the current jump by up to 0.7 mA as any of the card's parameters
    varies, and a fit ends where it was caught (docs/decisions/0008).
    """
    return replace(parameters, card_switch="split")


def _searched(
    stage: Stage,
    problem: Problem,
    search: Search,
    method: Method,
    tolerance: float,
    max_evaluations: int,
) -> tuple[StartResult, ...]:
    # starts run side by side, so each of them runs on one thread
    alone = replace(problem, threads=1)
    watch = search.watch
    return solve_from(
        alone,
        [problem.start, *sobol_starts(alone, search.starts, search.seed)],
        executor=search.executor,
        store=None if search.store is None else search.store / stage.name,
        fingerprint=_fingerprint(stage, problem, search, method, tolerance, max_evaluations),
        resume=search.resume,
        method=method,
        tolerance=tolerance,
        max_evaluations=max_evaluations,
        watch=None if watch is None else (lambda result, done: watch(stage.name, result, done)),
    )


def _fingerprint(stage: Stage, problem: Problem, search: Search, *settings: object) -> str:
    """Hash of all that the result of a start depends on."""
    digest = blake2b(digest_size=16)
    model = problem.model
    assert isinstance(model, DriveModel)
    known = model.parameters
    forms = known.pressure_root, known.coulomb_sign, known.rate, sorted(known.options)
    numbers = sorted(known.numbers.items())
    words = (__version__, stage.model_dump_json(), search.seed, settings, numbers, forms)
    digest.update(repr(words).encode())
    for experiment, weights in zip(problem.experiments, problem.weights, strict=True):
        arrays = [experiment.input.time, experiment.input.values]
        for name, weight in weights.items():
            channel = experiment[name]
            arrays += [channel.time, channel.values, weight]
        for array in arrays:
            digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _named(watch: Callable[[str, Progress], None], name: str) -> Callable[[Progress], None]:
    return lambda progress: watch(name, progress)
