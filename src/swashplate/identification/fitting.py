"""The fit of a drive, stage after stage, or of a user-defined model."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import cached_property, partial
from hashlib import blake2b
from math import isfinite, sqrt
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.__about__ import __version__
from swashplate.campaign import Campaign, Channel, Experiment
from swashplate.drive import Drive
from swashplate.errors import InputError, UnknownNameError
from swashplate.executors import Executor, Serial
from swashplate.identification import tables
from swashplate.identification.contradiction import less_of_currents, with_weight_of_currents
from swashplate.identification.diagnostics.data_checks import (
    check_model,
    check_rank,
    check_runs,
    refuse_unsound,
    spike_findings,
    unfitted_currents,
)
from swashplate.identification.estimation.between_samples import settle
from swashplate.identification.estimation.drive_model import DriveModel, with_card_filter
from swashplate.identification.estimation.model import EquationModel, MachineModel, UserModel
from swashplate.identification.estimation.model_setup import ModelSetup
from swashplate.identification.estimation.problem import Loss, Problem
from swashplate.identification.estimation.setup import FitSetup, FreeParameters, Stage
from swashplate.identification.estimation.solving import (
    Progress,
    Solution,
    approached,
    sobol_starts,
    solve,
    solve_from,
)
from swashplate.identification.estimation.stages import (
    Parameters,
    as_fit_setup,
    smooth,
    stage_problem,
    start_currents_of,
    with_estimates,
)
from swashplate.identification.estimation.unknowns import Prior
from swashplate.identification.lateness import (
    FIRST,
    is_in_question,
    is_whole_drive,
    lateness_of,
    with_lateness,
)
from swashplate.identification.ramp import read_off, with_ramp
from swashplate.identification.stage_fit import Interval, StageFit
from swashplate.identification.statistics.intervals import Estimate, uncertainty_of, weighed
from swashplate.machine import Model as Equations
from swashplate.parameters import SIDES, ParameterSet
from swashplate.progress import LOGGER, working
from swashplate.results import Tabular
from swashplate.tables import Table, count, listed

if TYPE_CHECKING:
    import polars

Array = NDArray[np.float64]

OTHERS = 6
"""Starts in addition to the nominal one if that ends far from what was measured: of 419 sound
campaigns of slew eleven did, and in ten of them one of these starts reached the best. That some
agree says nothing: in one campaign the nominal start and the first three ended in the same wrong
optimum."""
ROUGH = 1e-4
"""Tolerance of these starts, of which the best goes on: optima differ by factors. Where the model
lacks an effect, so that no start can help, six starts take 235 evaluations instead of 929."""
LEAST_EXPLAINED = 0.4
"""Share of the variance of what was measured that a search must explain after `solving.LEG`
evaluations, or it is given up. Channels clipped at half of their range, late by 0.2 s, after a lag
of 0.5 s, doubled, or under noise of 30 % of it left 0.57 or more in 36 campaigns; outputs of other
runs, and runs tiled with jumps, 0 to 0.32."""
TRIAL = 12
"""Evaluations of each other start if the first search was given up."""
WINDOW = 1.0
"""Time over which the mean speed of a position is taken. [s]"""
CLIFFS = 2
"""How often such a search goes on where the cost jumps: where a dead zone passes a level of a
staircase."""
WITH_PRIORS = 1e-6
"""Tolerance of a search in which every number has a prior: what changes the cost by less lies along
directions that only these hold."""
BEFORE_WEIGHING = 1e-4
"""And of the one before it is known what the residuals are worth."""
FAR = 3.0
"""Deviations beyond which a number is not like that of the named drive: by chance one of 40 is in a
tenth of fits."""
UNEXPLAINED = 5.0
"""Residuals over their known measurement error from which another optimum is looked for."""
SPREAD = 0.05
"""Standard deviation of the logarithm by which a drawn parameter differs from the nominal one."""
OF_FORCES = ("Z19", "Z21")
"""Coefficients of the solenoids that are drawn if a fit setup frees forces: those of odd powers."""


class SolvedStage(NamedTuple):
    """Solution of a stage, and its starts."""

    problem: Problem
    """With its priors weighed."""
    solution: Solution
    starts: tuple[Solution, ...] = ()
    """End of each start, if there was more than one."""
    intervals: tuple[Interval, ...] | None = None
    """What is known of each unknown's error, if it was computed before."""


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
    watch: Callable[[str, Solution, int], None] | None = None
    """Called with the stage, each result and how many there are by now."""


class Estimated(Tabular, ABC):
    """A result with estimates by name: ``result["Z8"].value``, ``result["Z16_plus"].interval``."""

    @property
    @abstractmethod
    def estimates(self) -> Mapping[str, Estimate]:
        """Every number of the machine by name, estimated or fixed, and those of single runs."""

    def __getitem__(self, name: str) -> Estimate:
        """What the fit says of a number: its value, standard error, interval, unit and status.

        Raises
        ------
        UnknownNameError
            If there is none of that name; it is a ``KeyError`` as well.
        """
        if name in self.estimates:
            return self.estimates[name]
        sides = [f"{name}_{side}" for side in SIDES]
        if all(side in self.estimates for side in sides):
            raise UnknownNameError(f"{name} has two directions: name {' or '.join(sides)}.")
        near = get_close_matches(str(name), self.estimates, 1)
        meant = f" (did you mean {near[0]}?)" if near else ""
        names = ", ".join(key for key, estimate in self.estimates.items() if estimate.run is None)
        raise UnknownNameError(f"There is no parameter '{name}'{meant}; there are {names}.")

    def __contains__(self, name: object) -> bool:
        return name in self.estimates

    def __iter__(self) -> Iterator[str]:
        return iter(self.estimates)

    def __len__(self) -> int:
        return len(self.estimates)


@dataclass(frozen=True, eq=False)
class Fit(Estimated):
    """A fitted drive, or a user-defined model, and how it came about.

    Estimates are there by name: ``fit["Z8"].standard_error``.
    """

    setup: FitSetup
    nominal: Parameters
    runs: tuple[Experiment, ...] = field(repr=False)
    """Those that were fitted."""
    stages: tuple[StageFit, ...]
    doubts: tuple[str, ...] = ()
    """What the runs lack, in sentences, if they could be fitted all the same."""

    @property
    def parameters(self) -> Parameters:
        """The fitted parameters."""
        return self.stages[-1].parameters

    @property
    def drive(self) -> Drive:
        """The fitted drive; refused if a user-defined model was fitted."""
        return self.stages[-1].drive

    @property
    def interrupted(self) -> bool:
        """Whether it was stopped before the last stage's optimum."""
        return self.stages[-1].solution.interrupted

    @cached_property
    def estimates(self) -> Mapping[str, Estimate]:
        """Every number of the machine by name, estimated or fixed, and those of single runs."""
        return tables.estimates_by_name(self.stages)

    def to_polars(self) -> polars.DataFrame:
        """What was estimated, one row for each parameter, SI.

        Columns are stage, parameter, unit, nominal, value, lower and upper (ends of the 95 %
        interval), standard_error and status.
        """
        return tables.all_estimates(self.stages).to_polars()

    def stage(self, name: str) -> StageFit:
        """The stage of a name; an `UnknownNameError` if there is none."""
        for stage in self.stages:
            if stage.stage.name == name:
                return stage
        names = ", ".join(stage.stage.name for stage in self.stages)
        raise UnknownNameError(f"The fit has no stage '{name}'; there are {names}.")

    def tables(self) -> list[Table]:
        """Estimates with their intervals, stage by stage, then the errors of each fitted run."""
        runs = [quality for stage in self.stages for quality in stage.runs]
        errors = tables.runs_tables(runs)
        errors = [replace(table, title=f"{table.title}, fitted runs") for table in errors]
        return [*map(tables.estimates_table, self.stages), *errors]

    @property
    def sentences(self) -> tuple[str, ...]:
        """How each stage ended, what its estimates lack, and what stayed fixed."""
        sentences = list(self.doubts)
        for part in map(tables.stage_part, self.stages):
            sentences += [*part.remarks, *part.sentences]
        unknowns = [unknown for stage in self.stages for unknown in stage.problem.unknowns]
        jumps = {unknown.label for unknown in unknowns if unknown.kind == "instant"}
        if jumps:
            times = count(len(jumps), "time")
            sentences.append(
                f"Commands jump {times} between two samples: the instant is estimated."
            )
        sentences += tables.single_runs_line(self.stages)
        fixed = tables.fixed_part(self.stages, self.nominal)
        return (*sentences, *fixed.remarks, *fixed.sentences)


def fit(
    model: Drive | Parameters | MachineModel | Equations,
    tests: Campaign | Sequence[Experiment],
    free: FreeParameters | None = None,
    *,
    channels: Sequence[str] = (),
    noise: Mapping[str, float] | None = None,
    fixed: Mapping[str, float] | None = None,
    loss: Loss = "linear",
    tolerance: float = 1e-10,
    max_evaluations: int = 600,
    threads: int | None = None,
    search: Search | None = None,
    watch: Callable[[str, Progress], None] | None = None,
) -> Fit:
    """Estimate the parameters of a drive, or of a user-defined model, from tests.

    The step of `identify` that estimates: it also takes experiments that no campaign file
    describes, and gives no verdict.

    Parameters
    ----------
    model : Drive, ParameterSet, MachineModel or ModelSetup
        A drive: where to begin, and what stays fixed. The decay's switch is split, see `smooth`,
        the card's filter is its differential equation unless the fit setup's `card_filter`
        says "recursion". Or a user-defined model: of equations,
        a `UserModel` of them, any object with `simulate`, or a `ModelSetup`.
    tests : Campaign or sequence of Experiment
        The runs to fit; of a campaign those with the role ``"fit"``.
    free : FitSetup, str, path or mapping
        What to estimate. Of a drive a fit setup: a `FitSetup`, a packaged one by name, a TOML
        file, or a mapping as of `as_fit_setup`. Of a user-defined model a mapping to (low,
        nominal, high) or an `Unknown`, see `ModelSetup`.
    channels, noise, fixed : optional
        Of a user-defined model, as of `ModelSetup`.
    loss, tolerance, max_evaluations :
        As of `solving.solve`, in each stage.
    threads : int, optional
        Threads over experiments; all cores by default. The result does not depend on it.
    search : Search, optional
        More starts than the nominal one; the best is refined. Without, up to six more are tried if
        residuals are five times as large as their known measurement error, until one of them is
        not, and if none explains two fifths of what was measured, the fit is refused; `Search(0)`
        tries none.
        Ctrl-C during them ends the whole fit, with the best start of that stage as its last result.
    watch : callable, optional
        Called with the stage's name and each of its iterations.

    Raises
    ------
    InputError, ParameterError
        If tests, model and what is free do not fit each other, no fit of these runs can mean
        anything, or none of the starts comes near what was measured.
    DomainError
        If the model does not hold at the nominal values.

    Examples
    --------
    >>> from swashplate import Campaign, Drive, maneuvers, rig
    >>> from swashplate.identification import fit
    >>> tests = rig.run("hoist", {"step": maneuvers.step(9.0), "sine": maneuvers.sine(9.0, 0.1)})
    >>> campaign = Campaign.from_toml(rig.write(tests, "excited"))
    >>> result = fit(Drive.preset("hoist"), campaign, {"Z8": (0.5, 2), "Z16": (0.5, 2)})
    >>> abs(result.drive["Z8"].value / Drive.preset("hoist")["Z8"].value - 1.0) < 0.05
    True
    """
    runs = tests.select(role="fit") if isinstance(tests, Campaign) else tuple(tests)
    if not runs:
        raise InputError("There is no run to fit.")
    doubts = refuse_unsound(spike_findings(runs, loss))
    if isinstance(tests, Campaign):
        doubts += refuse_unsound(spike_findings(tests.select(role="validate"), "linear"))
    stated: _Stated
    if isinstance(model, Drive):
        stated = _of_drive(model.parameters, free, runs)
    elif isinstance(model, ParameterSet):
        stated = _of_drive(model, free, runs)
    elif isinstance(model, ModelSetup):
        stated = _of_model(model, runs)
    else:
        entries = free if isinstance(free, Mapping) else {}
        user_defined = ModelSetup(
            model, entries, channels=tuple(channels), noise=noise or {}, fixed=fixed or {}
        )
        stated = _of_model(user_defined, runs)
    nominal, setup = stated.nominal, stated.setup
    doubts += stated.doubts

    def solved(stage: Stage, problem: Problem) -> SolvedStage:
        def seen(now: Progress) -> None:
            work.at(f"evaluation {now.evaluations}, cost {now.cost:.5g}")
            if watch is not None:
                watch(stage.name, now)

        refuse_unsound(check_rank(f"Stage {stage.name}", problem), InputError)
        limits: dict[str, Any] = {"tolerance": tolerance, "max_evaluations": max_evaluations}
        with working(f"Stage {stage.name}") as work:
            if stage.has_spreads:
                limits |= {"tolerance": max(tolerance, WITH_PRIORS), "cliffs": CLIFFS}
            solve_stage = partial(solve, loss=loss, watch=seen, keep_best=True, **limits)
            start = problem.unknowns.vector_of(near) if near and stage.has_spreads else None
            result = _solved(stage, problem, solve_stage, search, doubts, start)
        LOGGER.info(
            "Stage %s: %s after %d evaluations, cost %.5g",
            stage.name,
            result.solution.message,
            result.solution.evaluations,
            result.solution.cost,
        )
        return result

    with working(f"Fitting {nominal.name}"):
        settled = settle(runs, smooth(nominal), setup, loss=loss, threads=threads)
        runs, near = settled.runs, dict(settled.near)
        doubts += settled.sentences
        asked = _Asked(nominal, setup, near)
        if isinstance(nominal, ParameterSet) and is_whole_drive(setup):
            stages_of = partial(staged, runs=runs, threads=threads)
            asked = _asked_for(setup, nominal, near, loss, stages_of)
        nominal, setup, near = asked.nominal, asked.setup, dict(asked.near)
        stages = asked.interrupted or staged(setup, nominal, runs, solved, threads=threads)
    doubts += tuple(each for stage in stages for each in _unlike(stage, nominal.name))
    return Fit(setup, nominal, tuple(runs), stages, doubts)


def _unlike(stage: StageFit, drive: str) -> Iterator[str]:
    """A sentence if the tests drive numbers far from those of the drive that the fit began with."""
    if not stage.stage.has_spreads:
        return
    far = [
        f"{unknown.name} {abs(pull):.2g} deviations {'above' if pull > 0.0 else 'below'}"
        for unknown, number in zip(stage.problem.unknowns, stage.solution.vector, strict=True)
        if unknown.run is None and abs(pull := unknown.pull(float(number))) > FAR
    ]
    if far:
        yield (
            f"The machine is not like {drive}, from whose numbers differ {listed(far)}. Begin from "
            "a drive that it is like, or let 'swashplate guess' read one off the logs."
        )


class _Asked(NamedTuple):
    """A setup of a whole drive with what the runs ask for beyond it."""

    nominal: Parameters
    setup: FitSetup
    near: Mapping[str, float]
    """Values near the optimum by the unknowns' labels; none if unknown."""
    interrupted: tuple[StageFit, ...] = ()
    """Stages of a rough fit that was interrupted."""


def _asked_for(
    setup: FitSetup,
    nominal: ParameterSet,
    near: Mapping[str, float],
    loss: Loss,
    stages_of: Callable[..., tuple[StageFit, ...]],
) -> _Asked:
    """What runs ask for: a ramp that no guess sees, a lateness, and currents that count less.

    By rough fits, which end where a step changes the cost by less than `ROUGH` of itself.
    """

    def rough(_: Stage, problem: Problem) -> SolvedStage:
        begin = near or problem.unknowns.values(approached(problem, loss=loss))
        start = problem.unknowns.vector_of({**begin, **first})
        solution = solve(problem, start, loss=loss, tolerance=ROUGH, keep_best=True)
        if solution.interrupted:
            return SolvedStage(problem, solution)
        return SolvedStage(weighed(problem, solution.vector), solution)

    nominal, setup = with_ramp(nominal, setup)
    first: Mapping[str, float] = {}
    if is_in_question(setup, nominal) and read_off(nominal):
        # a guess has one lag for all, which the step of a search at it does not take apart
        setup, first = with_lateness(setup), FIRST
    stages_of = partial(stages_of, nominal=nominal)
    with working("Searching roughly"):
        (stage,) = stages_of(setup, solved=rough)
        if stage.solution.interrupted:
            return _Asked(nominal, setup, near, (stage,))
        near, first = stage.values, {}
        if is_in_question(setup, nominal) and (late := lateness_of(stage, nominal)):
            setup, near = with_lateness(setup), near | late
            (stage,) = stages_of(setup, solved=rough)
            if stage.solution.interrupted:
                return _Asked(nominal, setup, near, (stage,))
            near = stage.values
        freed = less_of_currents(stage)
        if freed is not None:
            setup, near = with_weight_of_currents(setup, freed.factor), freed.values
    return _Asked(nominal, setup, near)


class _Stated(NamedTuple):
    """Stages to be fitted, and doubts about them."""

    nominal: Parameters
    setup: FitSetup
    doubts: tuple[str, ...]


def _of_drive(
    parameters: ParameterSet, free: FreeParameters | None, runs: Sequence[Experiment]
) -> _Stated:
    """A drive, the card's filter in the form that is fitted; unsound runs are refused."""
    if free is None:
        raise InputError(
            "A fit of a drive needs its free parameters, such as 'hoist' or {'Z8': (0.5, 2)}; "
            "swashplate.identify takes drive and fit setup from the campaign."
        )
    setup = as_fit_setup(free, runs, parameters.definitions)
    nominal, changed = with_card_filter(setup.card_filter, runs, parameters)
    doubts = refuse_unsound(check_runs(runs, smooth(nominal)))
    doubts += refuse_unsound(unfitted_currents(runs, setup))
    return _Stated(nominal, setup, doubts + changed)


def _of_model(model: ModelSetup, runs: Sequence[Experiment]) -> _Stated:
    """A user-defined model with its numbers before the fit; unsound runs are refused."""
    doubts = refuse_unsound(check_model(runs, model))
    nominal = model if model.numbers else model.nominal(runs)
    return _Stated(nominal, nominal.setup, doubts)


def staged(
    setup: FitSetup,
    nominal: Parameters,
    runs: Sequence[Experiment],
    solved: Callable[[Stage, Problem], SolvedStage],
    *,
    threads: int | None = None,
) -> tuple[StageFit, ...]:
    """The stages of a fit setup, each from what the ones before found, until one is interrupted."""
    parameters = smooth(nominal)
    stages = list[StageFit]()
    starts = dict[str, Mapping[str, float]]()
    instants = dict[tuple[str, str], Prior]()
    for stage in setup.stages:
        problem = stage_problem(
            stage,
            parameters,
            runs,
            threads=threads,
            uncertain=setup.standard_uncertainty,
            starts=starts,
            instants=instants,
        )
        result = solved(stage, problem)
        problem, vector = result.problem, result.solution.vector
        parameters = with_estimates(parameters, problem, vector)
        starts |= start_currents_of(problem, vector)
        stages.append(
            StageFit(
                stage,
                problem,
                result.solution,
                parameters,
                starts=result.starts,
                earlier=tuple(stages),
                stored=result.intervals,
            )
        )
        if result.solution.interrupted:
            break
        # what was stored has the priors of the stages after it, too
        if stage is not setup.stages[-1] and result.intervals is None:
            instants |= _instants_found(stages[-1])
    return tuple(stages)


def _instants_found(stage: StageFit) -> dict[tuple[str, str], Prior]:
    """Estimated instants of edges of a stage, by run and name."""
    unknowns = stage.problem.unknowns
    numbers = [k for k, unknown in enumerate(unknowns) if unknown.kind == "instant"]
    if not numbers:
        return {}
    values = unknowns.at(stage.solution.vector).estimates
    errors = uncertainty_of(stage).quoted.standard_errors * unknowns.scales
    priors = dict[tuple[str, str], Prior]()
    for k in numbers:
        unknown = unknowns[k]
        assert unknown.prior is not None
        assert unknown.run is not None
        deviation = unknown.prior.deviation
        error = min(float(errors[k]), deviation)
        if not error > 0.0:
            error = deviation
        priors[unknown.run, unknown.name] = Prior(float(values[k]), error)
    return priors


def _solved(
    stage: Stage,
    problem: Problem,
    solver: partial[Solution],
    search: Search | None,
    doubts: Sequence[str],
    start: Array | None = None,
) -> SolvedStage:
    """See `SolvedStage`; a search without other starts begins at `start` if there is one."""
    limits = {key: solver.keywords[key] for key in ("tolerance", "max_evaluations")}
    if search is not None and search.starts:
        solutions = _from_starts(stage, problem, search, limits)
        solution = solutions[0]
        planned = 1 + search.starts
    else:
        hopeless = None
        if search is None and isinstance(problem.model, EquationModel):
            hopeless = partial(_is_hopeless, problem)
        if stage.has_spreads and start is None:
            start = approached(problem, loss=solver.keywords["loss"])
        first = solver
        if stage.has_spreads:
            first = partial(solver, tolerance=max(limits["tolerance"], BEFORE_WEIGHING))
        solution = first(problem, start, hopeless=hopeless)
        solutions = ()
        planned = 1 + OTHERS
    if (
        search is None
        and not stage.has_spreads
        and solution.loss == "linear"
        and _unexplained(problem, solution)
    ):
        solutions, planned = _from_other_starts(stage, problem, solution, limits)
    if solutions:
        best = min(solutions, key=lambda solution: solution.cost)
        if solution.given_up and len(solutions) == planned:
            share = share_explained(problem, best.vector)
            if share < LEAST_EXPLAINED:
                raise InputError(_no_fit(stage, problem, planned, share, doubts))
        if len(solutions) < planned:
            message = f"interrupted after {len(solutions)} of {planned} starts: the best of them"
            solution = replace(best, converged=False, interrupted=True, message=message)
        elif search is not None or best.number or solution.given_up:
            solution = solver(problem, best.vector)
    if any(unknown.prior is not None for unknown in problem.unknowns) and not solution.interrupted:
        # what the residuals are worth is known only now
        problem = weighed(problem, solution.vector)
        solution = solver(problem, solution.vector)
    return SolvedStage(problem, solution, solutions)


def _from_starts(
    stage: Stage, problem: Problem, search: Search, limits: dict[str, Any]
) -> tuple[Solution, ...]:
    """Solutions from the nominal values and from the starts of a search."""
    # starts run side by side, so each of them runs on one thread
    single_threaded = replace(problem, threads=1)
    return solve_from(
        single_threaded,
        [problem.start, *sobol_starts(single_threaded, search.starts, search.seed)],
        executor=search.executor,
        store=None if search.store is None else search.store / stage.name,
        origin=_origin(stage, problem, limits),
        resume=search.resume,
        watch=None if search.watch is None else partial(search.watch, stage.name),
        **limits,
    )


def _from_other_starts(
    stage: Stage, problem: Problem, solution: Solution, limits: Mapping[str, float]
) -> tuple[tuple[Solution, ...], int]:
    """A solution that leaves too much unexplained and those from a few other starts.

    Beside them how many were planned.
    """
    LOGGER.info(
        "Stage %s: residuals exceed %g times their known measurement error: up to %d more "
        "starts (starts=0 tries none)",
        stage.name,
        UNEXPLAINED,
        OTHERS,
    )
    most = TRIAL if solution.given_up else int(limits["max_evaluations"])
    starts = list[Array]()
    # nobody asked for these starts: if few can be used, they are enough
    with suppress(InputError):
        for start in sobol_starts(problem, OTHERS, 0):
            starts.append(start)
    try:
        others = solve_from(
            problem,
            starts,
            enough=partial(_explained, problem),
            tolerance=ROUGH,
            max_evaluations=most,
        )
    except KeyboardInterrupt:  # before the first of them ended
        others = ()
    numbered = [replace(result, number=result.number + 1) for result in others]
    solutions = (solution, *numbered)
    if _explained(problem, solutions[-1]):
        return solutions, len(solutions)
    return solutions, 1 + len(starts)


def share_explained(problem: Problem, vector: Array) -> float:
    """Share of the variance of what was measured that a point explains, at most 1.

    In units of the residuals, so that the channels that are measured best count most. Of a position
    that of its mean speeds: where it drifts to after minutes says little of how a drive moves.
    """
    total = 0.0
    unexplained = 0.0
    for number, experiment in enumerate(problem.experiments):
        for name, output in problem.outputs(vector, number).items():
            channel = experiment[name]
            used = channel.used
            if not used.any():
                continue
            measured = channel.values[used]
            errors = (output - channel.values)[used]
            if channel.is_position and measured.size > 1:
                step = float(np.median(np.diff(channel.time[used])))
                width = max(min(round(WINDOW / step), measured.size // 4), 1)
                measured, errors = _changes(measured, width), _changes(errors, width)
            unit = problem.scales[name] ** 2
            total += float(np.sum((measured - measured.mean()) ** 2)) / unit
            unexplained += float(errors @ errors) / unit
    return 1.0 - unexplained / total if total > 0.0 else 1.0


def _changes(values: Array, width: int) -> Array:
    """Differences between the means of so many samples each, which noise hardly reaches."""
    count = values.size // width
    return np.diff(values[: count * width].reshape(count, width).mean(axis=1))


def _is_hopeless(problem: Problem, vector: Array) -> bool:
    return share_explained(problem, vector) < LEAST_EXPLAINED


def _no_fit(
    stage: Stage, problem: Problem, starts: int, share: float, doubts: Sequence[str]
) -> str:
    """Sentence that no search comes near the measurements, and on what to look at."""
    channels, percentage = listed(problem.channels), 100.0 * max(share, 0.0)
    best = f"the best of {starts} starts" if starts > 1 else "the search"
    sentence = (
        f"Stage {stage.name} does not fit: {best} explains {percentage:.0f} % of the variance of "
        f"{channels}. Inspect the runs with 'swashplate campaign plot': did this command move the "
        "machine, do jumps or resets cut a signal, are kinds, units and signs right? Start from "
        "another drive with --from, or search anyway with --starts 20 (in Python search = "
        "Search(20))."
    )
    return " ".join([sentence, *(f"Seen in the runs: {doubt}" for doubt in doubts[:1])])


def _unexplained(problem: Problem, solution: Solution) -> bool:
    """Whether residuals of a channel are far larger than its known measurement error."""
    if solution.interrupted or not isinstance(problem.model, EquationModel):
        return False  # any object with simulate may take minutes
    relative: dict[str, list[Array]] = {}
    for number, experiment in enumerate(problem.experiments):
        for name, output in problem.outputs(solution.vector, number).items():
            channel = experiment[name]
            error = _known_error(channel)
            if error is not None:
                residuals = (output - channel.values)[channel.used]
                relative.setdefault(name, []).append(residuals / error)
    joined = map(np.concatenate, relative.values())
    return any(float(r @ r) > UNEXPLAINED**2 * r.size for r in joined)


def _known_error(channel: Channel) -> float | None:
    """Standard deviation of what a channel is stated to err by, or of rounding to its steps."""
    if channel.noise is not None:
        return channel.noise
    return channel.resolution and channel.resolution / sqrt(12.0)


def _explained(problem: Problem, solution: Solution) -> bool:
    """Whether a start ended near what was measured; one that could not be simulated did not."""
    return isfinite(solution.cost) and not _unexplained(problem, solution)


def _origin(stage: Stage, problem: Problem, limits: Mapping[str, float]) -> dict[str, str]:
    """Fingerprints of all that the result of a start depends on."""
    model = repr(problem.model) if isinstance(problem.model, UserModel) else ""
    fixed = sorted(problem.fixed.items()), sorted(problem.zeros.items())
    nominal: object = (model, problem.start.tolist(), fixed)
    if isinstance(problem.model, DriveModel):
        drive = problem.model.parameters
        forms = drive.pressure_root, drive.coulomb_sign, drive.rate, sorted(drive.options)
        nominal = sorted(drive.numbers.items()), forms
    marks = {
        "stage of the fit setup": stage.model_dump_json(),
        "tolerances": sorted(limits.items()),
        "nominal values": nominal,
        "runs and their weights": (problem.scales, [*map(fingerprint, problem.experiments)]),
    }
    hashes = {k: blake2b(repr(v).encode(), digest_size=8).hexdigest() for k, v in marks.items()}
    return {"version of swashplate": __version__, **hashes}


def fingerprint(experiment: Experiment) -> str:
    """Hash of a run's input and channels: stamps, samples and weights."""
    digest = blake2b(digest_size=8)
    start = (experiment.start, experiment.start_pressure, experiment.input.interpolation)
    digest.update(repr(start).encode())
    arrays = [experiment.input.time, experiment.input.values]
    for name, channel in experiment.channels.items():
        digest.update(f"{name} {channel.kind}".encode())
        arrays += [channel.time, channel.values, channel.weight]
    for array in arrays:
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def drawn_drive(nominal: Drive, setup: FitSetup, seed: int, *, spread: float = SPREAD) -> Drive:
    """A drive that differs from a nominal one in what a fit setup frees, and in nothing else.

    Each free parameter is multiplied by a log-normal factor, each direction by another.

    Parameters
    ----------
    nominal : Drive
        The drive that the factors apply to.
    setup : FitSetup
        Its free parameters are drawn, those of the solenoids if it frees forces.
    seed : int
        Not negative. The same seed gives the same drive.
    spread : float
        Standard deviation of the logarithm of a factor. [1]

    Returns
    -------
    Drive
        For virtual tests, whose truth it is.

    Raises
    ------
    ParameterError
        If what was drawn breaks a rule: draw with another seed.
    """
    random = np.random.default_rng(seed)
    definitions = nominal.parameters.definitions
    names = [name for stage in setup.stages for name in definitions.columns_of(stage.free)]
    if any(stage.forces is not None for stage in setup.stages):
        names += definitions.columns_of(OF_FORCES)
    numbers = nominal.parameters.numbers
    factors = {name: float(np.exp(random.normal(0.0, spread))) for name in names}
    return nominal.replace(**{name: numbers[name] * factor for name, factor in factors.items()})
