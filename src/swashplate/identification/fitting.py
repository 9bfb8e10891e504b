"""The fit of a drive, or of a user-defined model: the search, from its starts to its optimum."""

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
from swashplate.identification.estimation.fit_problem import (
    Parameters,
    as_fit_setup,
    problem_of,
    smooth,
    with_estimates,
)
from swashplate.identification.estimation.model import EquationModel
from swashplate.identification.estimation.model_setup import ModelSetup
from swashplate.identification.estimation.problem import Loss, Problem
from swashplate.identification.estimation.setup import FitSetup, FreeParameters
from swashplate.identification.estimation.solving import (
    Progress,
    Solution,
    approached,
    sobol_starts,
    solve,
    solve_from,
)
from swashplate.identification.lateness import (
    FIRST,
    is_in_question,
    is_whole_drive,
    lateness_of,
    with_lateness,
)
from swashplate.identification.optimum import Optimum
from swashplate.identification.statistics.intervals import Estimate, weighed
from swashplate.identification.unseen import is_guessed, with_unseen
from swashplate.machine import Machine
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


class _Solved(NamedTuple):
    """A problem, its solution, and its starts."""

    problem: Problem
    """With its priors weighed."""
    solution: Solution
    starts: tuple[Solution, ...] = ()
    """End of each start, if there was more than one."""


@dataclass(frozen=True)
class Search:
    """Starts besides the nominal one."""

    starts: int
    """Sobol points over the bounds, besides the nominal values."""
    seed: int = 0
    executor: Executor = field(default_factory=Serial)
    store: Path | None = None
    """Folder that keeps each result as it is ready."""
    resume: bool = False
    """Take what is in the store instead of computing it again."""
    watch: Callable[[Solution, int], None] | None = None
    """Called with each result and how many there are by now."""


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
class Fit(Optimum, Estimated):
    """A fitted drive, or a user-defined model, and how it came about.

    Estimates are there by name: ``fit["Z8"].standard_error``.
    """

    doubts: tuple[str, ...] = ()
    """What the runs lack, in sentences, if they could be fitted all the same."""

    @cached_property
    def estimates(self) -> Mapping[str, Estimate]:
        """Every number of the machine by name, estimated or fixed, and those of single runs."""
        return tables.estimates_by_name(self)

    def to_polars(self) -> polars.DataFrame:
        """What was estimated, one row for each parameter, SI.

        Columns are parameter, unit, nominal, value, lower and upper (ends of the 95 % interval),
        standard_error and status.
        """
        return tables.all_estimates(self).to_polars()

    def tables(self) -> list[Table]:
        """Estimates with their intervals, then the errors of each fitted run."""
        errors = tables.runs_tables(self.qualities)
        errors = [replace(table, title=f"{table.title}, fitted runs") for table in errors]
        return [tables.estimates_table(self), *errors]

    @property
    def sentences(self) -> tuple[str, ...]:
        """How the search ended, what the estimates lack, and what stayed fixed."""
        part = tables.estimates_part(self)
        sentences = [*self.doubts, *part.remarks, *part.sentences]
        jumps = {each.label for each in self.problem.unknowns if each.kind == "instant"}
        if jumps:
            times = count(len(jumps), "time")
            sentences.append(
                f"Commands jump {times} between two samples: the instant is estimated."
            )
        sentences += tables.single_runs_line(self)
        fixed = tables.fixed_part(self)
        return (*sentences, *fixed.remarks, *fixed.sentences)


def fit(
    model: Drive | Parameters | Machine | Equations,
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
    watch: Callable[[Progress], None] | None = None,
) -> Fit:
    """Estimate the parameters of a drive, or of a user-defined model, from tests.

    The step of `identify` that estimates: it also takes experiments that no campaign file
    describes, and gives no verdict.

    Parameters
    ----------
    model : Drive, ParameterSet, Machine, Model or ModelSetup
        A drive: where to begin, and what stays fixed. The decay's switch is split, see `smooth`,
        the card's filter is its differential equation unless the fit setup's `card_filter`
        says "recursion". Or a machine of your own: one of equations or a
        `BlackBox`, a `Model` without numbers, or a `ModelSetup` of either, which says more.
    tests : Campaign or sequence of Experiment
        The runs to fit; of a campaign those with the role ``"fit"``.
    free : FitSetup, str, path or mapping
        What to estimate. Of a drive a fit setup: a `FitSetup`, a TOML file, or a mapping as of
        `as_fit_setup`. Of a user-defined model a mapping to (low, nominal, high) or an `Unknown`,
        see `ModelSetup`.
    channels, noise, fixed : optional
        Of a user-defined model, as of `ModelSetup`.
    loss, tolerance, max_evaluations :
        As of `solving.solve`.
    threads : int, optional
        Threads over experiments; all cores by default. The result does not depend on it.
    search : Search, optional
        More starts than the nominal one; the best is refined. Without, up to six more are tried if
        residuals are five times as large as their known measurement error, until one of them is
        not, and if none explains two fifths of what was measured, the fit is refused; `Search(0)`
        tries none.
        Ctrl-C during them ends the fit, with the best start as its result.
    watch : callable, optional
        Called with each iteration.

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
    if is_whole_drive(setup, nominal):
        nominal, setup = with_unseen(nominal, setup)
    doubts += stated.doubts

    def found(setup: FitSetup, solved: _Solved) -> Fit:
        """The fit that a solution of the problem of a setup makes."""
        problem, solution, starts = solved
        parameters = with_estimates(smooth(nominal), problem, solution.vector)
        return Fit(setup, nominal, tuple(runs), problem, solution, parameters, starts)

    def searched(setup: FitSetup, near: Mapping[str, float], roughly: Fit | None) -> Fit:
        """The optimum for a fit setup, from some values or a rough fit if there are any."""
        problem = problem_of(setup, smooth(nominal), runs, threads=threads)
        refuse_unsound(check_rank("The fit", problem), InputError)
        with working("Searching") as work:

            def seen(now: Progress) -> None:
                work.at(f"evaluation {now.evaluations}, cost {now.cost:.5g}")
                if watch is not None:
                    watch(now)

            limits: dict[str, Any] = {"tolerance": tolerance, "max_evaluations": max_evaluations}
            start = None
            if setup.has_spreads:
                limits |= {"tolerance": max(tolerance, WITH_PRIORS), "cliffs": CLIFFS}
                start = problem.unknowns.vector_of(near) if near else None
            solver = partial(solve, loss=loss, watch=seen, keep_best=True, **limits)
            if roughly is not None and (search is None or not search.starts):
                solved = _refined(roughly, solver)
            else:
                solved = _solved(setup, problem, solver, search, doubts, start)
        LOGGER.info(
            "Search: %s after %d evaluations, cost %.5g",
            solved.solution.message,
            solved.solution.evaluations,
            solved.solution.cost,
        )
        return found(setup, solved)

    def rough(setup: FitSetup, near: Mapping[str, float], first: Mapping[str, float]) -> Fit:
        """A fit that ends where a step changes the cost by less than `ROUGH` of itself.

        From some values, or from where a search with a larger unit of residual ended, some numbers
        of it elsewhere.
        """
        problem = problem_of(setup, smooth(nominal), runs, threads=threads)
        solution = settled.solution if near is settled.near and not first else None
        if solution is None:
            begin = near or problem.unknowns.values(approached(problem, loss=loss))
            start = problem.unknowns.vector_of({**begin, **first})
            solution = solve(problem, start, loss=loss, tolerance=ROUGH, keep_best=True)
        if not solution.interrupted:
            problem = weighed(problem, solution.vector)
        return found(setup, _Solved(problem, solution))

    with working(f"Fitting {nominal.name}"):
        settled = settle(runs, smooth(nominal), setup, loss=loss, threads=threads)
        runs = settled.runs
        doubts += settled.sentences
        near, roughly = settled.near, None
        if is_whole_drive(setup, nominal):
            with working("Searching roughly"):
                setup, near, roughly = _asked_for(setup, nominal, near, rough)
        if roughly is not None and roughly.interrupted:
            result = roughly
        else:
            result = searched(setup, near, roughly)
    return replace(result, doubts=(*doubts, *_unlike(result)))


class _Asked(NamedTuple):
    """A setup of a whole drive with what the runs ask for beyond it."""

    setup: FitSetup
    near: Mapping[str, float]
    """Values near the optimum by the unknowns' labels; none if unknown."""
    roughly: Fit | None = None
    """A fit for this setup that ended there; one that was interrupted for an earlier one."""


def _asked_for(
    setup: FitSetup,
    nominal: Parameters,
    near: Mapping[str, float],
    rough: Callable[[FitSetup, Mapping[str, float], Mapping[str, float]], Fit],
) -> _Asked:
    """What runs ask for: a lateness behind the current, and currents that count less."""
    first: Mapping[str, float] = {}
    if is_in_question(setup, nominal) and is_guessed(nominal):
        # a guess has one lag for all, which one step of a search from it does not take apart
        setup, first = with_lateness(setup), FIRST
    fit = rough(setup, near, first)
    if fit.interrupted:
        return _Asked(setup, near, fit)
    late = lateness_of(fit) if is_in_question(setup, fit.parameters) else {}
    if late:
        setup = with_lateness(setup)
        fit = rough(setup, fit.values | late, {})
        if fit.interrupted:
            return _Asked(setup, near, fit)
    # of a named drive, whose amplifier is known beforehand, the currents count in full
    freed = less_of_currents(fit) if is_guessed(nominal) else None
    if freed is None:
        return _Asked(setup, fit.values, fit)
    return _Asked(with_weight_of_currents(setup, freed.factor), freed.values)


def _unlike(fit: Optimum) -> Iterator[str]:
    """A sentence if the tests drive numbers far from those of the drive that the fit began with."""
    if not fit.setup.has_spreads:
        return
    far = [
        f"{unknown.name} {abs(pull):.2g} deviations {'above' if pull > 0.0 else 'below'}"
        for unknown, number in zip(fit.problem.unknowns, fit.solution.vector, strict=True)
        if unknown.run is None and abs(pull := unknown.pull(float(number))) > FAR
    ]
    if far:
        yield (
            f"The machine is not like {fit.nominal.name}, from whose numbers differ {listed(far)}. "
            "Begin from a drive that it is like, or let 'swashplate guess' read one off the logs."
        )


class _Stated(NamedTuple):
    """What is to be fitted, and doubts about it."""

    nominal: Parameters
    setup: FitSetup
    doubts: tuple[str, ...]


def _of_drive(
    parameters: ParameterSet, free: FreeParameters | None, runs: Sequence[Experiment]
) -> _Stated:
    """A drive, the card's filter in the form that is fitted; unsound runs are refused."""
    if free is None:
        raise InputError(
            "A fit of a drive needs its free parameters, such as {'Z8': (0.5, 2)}; "
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


def _solved(
    setup: FitSetup,
    problem: Problem,
    solver: partial[Solution],
    search: Search | None,
    doubts: Sequence[str],
    start: Array | None = None,
) -> _Solved:
    """See `_Solved`; a search without other starts begins at `start` if there is one."""
    limits = {key: solver.keywords[key] for key in ("tolerance", "max_evaluations")}
    if search is not None and search.starts:
        solutions = _from_starts(setup, problem, search, limits)
        solution = solutions[0]
        planned = 1 + search.starts
    else:
        hopeless = None
        if search is None and isinstance(problem.model, EquationModel):
            hopeless = partial(_is_hopeless, problem)
        if setup.has_spreads and start is None:
            start = approached(problem, loss=solver.keywords["loss"])
        first = solver
        if setup.has_spreads:
            first = partial(solver, tolerance=max(limits["tolerance"], BEFORE_WEIGHING))
        solution = first(problem, start, hopeless=hopeless)
        solutions = ()
        planned = 1 + OTHERS
    if (
        search is None
        and not setup.has_spreads
        and solution.loss == "linear"
        and _unexplained(problem, solution)
    ):
        solutions, planned = _from_other_starts(problem, solution, limits)
    if solutions:
        best = min(solutions, key=lambda solution: solution.cost)
        if solution.given_up and len(solutions) == planned:
            share = share_explained(problem, best.vector)
            if share < LEAST_EXPLAINED:
                raise InputError(_no_fit(problem, planned, share, doubts))
        if len(solutions) < planned:
            message = f"interrupted after {len(solutions)} of {planned} starts: the best of them"
            solution = replace(best, converged=False, interrupted=True, message=message)
        elif search is not None or best.number or solution.given_up:
            solution = solver(problem, best.vector)
    if any(unknown.prior is not None for unknown in problem.unknowns) and not solution.interrupted:
        # what the residuals are worth is known only now
        problem = weighed(problem, solution.vector)
        solution = solver(problem, solution.vector)
    return _Solved(problem, solution, solutions)


def _refined(roughly: Fit, solver: partial[Solution]) -> _Solved:
    """The optimum from a rough fit whose priors are weighed already."""
    return _Solved(roughly.problem, solver(roughly.problem, roughly.solution.vector))


def _from_starts(
    setup: FitSetup, problem: Problem, search: Search, limits: dict[str, Any]
) -> tuple[Solution, ...]:
    """Solutions from the nominal values and from the starts of a search."""
    # starts run side by side, so each of them runs on one thread
    single_threaded = replace(problem, threads=1)
    return solve_from(
        single_threaded,
        [problem.start, *sobol_starts(single_threaded, search.starts, search.seed)],
        executor=search.executor,
        store=search.store,
        origin=_origin(setup, problem, limits),
        resume=search.resume,
        watch=search.watch,
        **limits,
    )


def _from_other_starts(
    problem: Problem, solution: Solution, limits: Mapping[str, float]
) -> tuple[tuple[Solution, ...], int]:
    """A solution that leaves too much unexplained and those from a few other starts.

    Beside them how many were planned.
    """
    LOGGER.info(
        "Residuals exceed %g times their known measurement error: up to %d more "
        "starts (starts=0 tries none)",
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


def _no_fit(problem: Problem, starts: int, share: float, doubts: Sequence[str]) -> str:
    """Sentence that no search comes near the measurements, and on what to look at."""
    channels, percentage = listed(problem.channels), 100.0 * max(share, 0.0)
    best = f"the best of {starts} starts" if starts > 1 else "the search"
    sentence = (
        f"Nothing fits: {best} explains {percentage:.0f} % of the variance of "
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


def _origin(setup: FitSetup, problem: Problem, limits: Mapping[str, float]) -> dict[str, str]:
    """Fingerprints of all that the result of a start depends on."""
    if isinstance(problem.model, DriveModel):
        drive = problem.model.parameters
        forms = drive.pressure_root, drive.coulomb_sign, drive.rate, sorted(drive.options)
        nominal: object = (sorted(drive.numbers.items()), forms)
    else:
        fixed = sorted(problem.fixed.items()), sorted(problem.zeros.items())
        nominal = (getattr(problem.model, "origin", ""), problem.start.tolist(), fixed)
    marks = {
        "fit setup": setup.model_dump_json(),
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
    names = definitions.columns_of(setup.free)
    if setup.forces is not None:
        names += definitions.columns_of(OF_FORCES)
    numbers = nominal.parameters.numbers
    factors = {name: float(np.exp(random.normal(0.0, spread))) for name in names}
    return nominal.replace(**{name: numbers[name] * factor for name, factor in factors.items()})
