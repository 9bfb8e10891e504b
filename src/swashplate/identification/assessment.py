"""Assessment of a fit, all that follows it, and its file."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date
from functools import cached_property, partial
from hashlib import blake2b
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from swashplate.__about__ import __version__
from swashplate.campaign.campaign import Campaign
from swashplate.campaign.experiment import Experiment
from swashplate.documents import read_json
from swashplate.errors import FileError, InputError
from swashplate.identification.drive_model import (
    Parameters,
    stage_problem,
    start_currents_of,
    with_estimates,
)
from swashplate.identification.fitting import Fit, StageFit, smooth
from swashplate.identification.identifiability import Identifiability, identifiability
from swashplate.identification.intervals import (
    Handed,
    Uncertainty,
    prior_sentences,
    reach,
    released,
    slopes_by_earlier,
    slopes_by_fixed,
    uncertainty,
)
from swashplate.identification.problem import LinearisedFit, linearised_fit
from swashplate.identification.profile import Profile, checked_ends, profiles_of
from swashplate.identification.resampling import (
    Bootstrap,
    CrossValidation,
    bootstraps_of,
    cross_validate,
)
from swashplate.identification.setup import ModelSetup, Setup
from swashplate.identification.solving import Solution
from swashplate.identification.unknowns import Unknown, Unknowns
from swashplate.identification.validation import RunQuality, predict, run_qualities
from swashplate.identification.verdict import LIMITS, REQUIRED, Verdict, verdict
from swashplate.parameters.definitions import find
from swashplate.parameters.files import dump_set, read_set
from swashplate.parameters.parameter_set import Motion, ParameterSet
from swashplate.results import Result
from swashplate.tables import write_text

if TYPE_CHECKING:
    from swashplate.campaign import Campaign, Experiment
    from swashplate.executors import Executor
    from swashplate.identification.problem import Loss
    from swashplate.tables import Table

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Assessment(Result):
    """What a stage's data tell of its unknowns, and how good the fit is."""

    stage: StageFit
    earlier: tuple[Assessment, ...] = ()
    """Of the stages before, whose results this one takes for granted."""

    def tables(self) -> list[Table]:
        """Estimates with their intervals, then the errors of each run."""
        from swashplate.identification.tables import estimates_table, runs_tables

        return [estimates_table(self), *runs_tables(self.runs)]

    @property
    def _vector(self) -> Array:
        return self.stage.solution.vector

    @cached_property
    def linearised(self) -> LinearisedFit:
        """Residuals and derivatives at the optimum."""
        return linearised_fit(self.stage.problem, self._vector, self.stage.solution.loss)

    @cached_property
    def identifiability(self) -> Identifiability:
        """Which unknowns the tests determine."""
        problem = self.stage.problem
        fixed = {
            name: value
            for name, value in self.stage.parameters.numbers.items()
            if name not in problem.unknowns.names
        }
        try:
            covariance = self.uncertainty.quoted.matrix
        except InputError:  # too few samples to tell the noise from
            covariance = None
        return identifiability(
            self.linearised.triangle,
            self.linearised.variables,
            covariance=covariance,
            tolerance=self.linearised.tolerance,
            fixed=fixed,
        )

    @cached_property
    def uncertainty(self) -> Uncertainty:
        """Errors of the estimates, for coloured residuals, those of earlier stages taken in."""
        handed = []
        fixed = slopes_by_fixed(self.stage, self.linearised)
        for each in self.earlier:
            slopes = slopes_by_earlier(self.stage, each.stage, self.linearised)
            if slopes is not None:
                before = each.uncertainty
                handed.append(Handed(before.sampled, slopes))
                # a fixed number acts on this stage by itself, and through what it does to others
                fixed = fixed + slopes @ before.fixed
        found = uncertainty(self.linearised, handed=handed, fixed=fixed)
        said = prior_sentences(self.stage.problem.unknowns, self._vector, found.quoted)
        found = replace(found, priors=said)
        if not found.noisy:
            return found
        half, fit = reach(found.own, found.level), released(self.linearised)
        unknowns = enumerate(self.stage.problem.unknowns)
        limits = [number for number, each in unknowns if each.targets[0].startswith(tuple(LIMITS))]
        ends = checked_ends(self.stage.problem, self._vector, fit, half, limits)
        return replace(found, ends=tuple(ends))

    @cached_property
    def runs(self) -> tuple[RunQuality, ...]:
        """Quality of each channel of each run that was fitted."""
        return run_qualities(self.stage.problem, self._vector)


def assess(stages: Sequence[StageFit]) -> tuple[Assessment, ...]:
    """The assessment of each stage of a fit."""
    made: list[Assessment] = []
    for each in stages:
        made.append(Assessment(each, tuple(made)))
    return tuple(made)


@dataclass(frozen=True)
class Wanted:
    """What was asked for besides the fit."""

    folds: int = 0
    bootstrap: int = 0
    profiles: tuple[str, ...] = ()
    """Unknowns by name, or ``"all"``."""
    seed: int = 0
    executor: Executor | None = None
    loss: Loss = "linear"
    required: float = REQUIRED
    """Largest error of held-out runs over their range."""


@dataclass(frozen=True, eq=False)
class Judged(Result):
    """A fit, just made or stored, and all that is found out about it."""

    campaign: Campaign
    result: Fit
    runs: Sequence[Experiment]
    """Those that were fitted."""
    bootstraps: Mapping[str, Bootstrap] = field(default_factory=dict)
    """By stage."""
    profiles: Sequence[StageProfile] = ()
    folds: CrossValidation | None = None
    notes: Mapping[str, str] = field(default_factory=dict)
    """Versions, seed, campaign."""
    required: float = REQUIRED
    """Largest error of held-out runs over their range."""

    @property
    def assessments(self) -> tuple[Assessment, ...]:
        """Of each stage."""
        return self.result.assessments

    @cached_property
    def predicted(self) -> tuple[RunQuality, ...]:
        """Runs of the axis that were held out, predicted."""
        names = {each.name for each in self.runs}
        held = self.campaign.select(axis=self.runs[0].axis, role="validate")
        return predict(self.result.parameters, [each for each in held if each.name not in names])

    @cached_property
    def verdict(self) -> Verdict:
        """What it can be used for."""
        planned = [each.name for each in self.result.setup.stages]
        return verdict(self.assessments, self.predicted, planned=planned, required=self.required)

    def tables(self) -> list[Table]:
        """Criteria of the verdict, then the fit's tables and the errors of held-out runs."""
        from swashplate.identification.tables import criteria_table, runs_tables

        return [
            criteria_table(self.verdict),
            *self.result.tables(),
            *(runs_tables(self.predicted) if self.predicted else ()),
        ]

    @property
    def sentences(self) -> tuple[str, ...]:
        """The verdict's headline and all that it says."""
        return (self.verdict.headline, *self.verdict.sentences, *self.verdict.not_judged)

    def name_of(self, profile: StageProfile) -> str:
        """The unknown that a profile is of."""
        stage = next(each for each in self.result.stages if each.stage.name == profile.stage)
        return stage.problem.unknowns.names[profile.profile.index]

    def store(self, path: str | Path) -> None:
        """Write what `load_fit` reads and the report can be made from again, whole or not at all.

        Samples stay in the campaign; a fingerprint of each run is stored.

        Raises
        ------
        FileError
            If the file cannot be written.
        """
        stages = tuple(
            StoredStage(
                name=each.stage.name,
                unknowns=each.problem.unknowns.items,
                solution=each.solution,
                starts=each.starts,
            )
            for each in self.result.stages
        )
        start = self.result.nominal
        content = FitFile(
            swashplate=__version__,
            axis=self.runs[0].axis,
            campaign=str(self.campaign.path),
            runs={each.name: fingerprint(each) for each in self.runs},
            nominal=dict(start.numbers) if isinstance(start, ModelSetup) else dump_set(start),
            setup=self.result.setup,
            stages=stages,
            profiles=tuple(self.profiles),
            folds=self.folds,
            notes=dict(self.notes),
        )
        write_text(content.model_dump_json(indent=1, by_alias=True) + "\n", path)

    def fitted_set(self) -> ParameterSet:
        """The fitted set, where each number says whether it was fitted or fixed, and its source.

        Of a fitted one the source is campaign, date and 95 % interval; of a fixed one that of the
        set which the fit began from. The title of one that is not usable says so.
        """
        found, nominal = self.result.drive.parameters, self.result.nominal
        assert isinstance(nominal, ParameterSet)
        today, ends = f"{date.today():%d %b %Y}", _interval_words(self.assessments, found)
        parameters = {}
        for symbol, parameter in found.parameters.items():
            if symbol in ends:
                words = "; ".join(ends[symbol])
                source = f"{self.campaign.path.name}, {today}; 95 %: {words}"
                parameter = replace(parameter, status="fitted", source=source)
            elif parameter.status != "inactive":
                before = nominal.parameters.get(symbol, parameter)
                source = f"{nominal.name}: {before.source}" if before.source else nominal.name
                parameter = replace(parameter, status="fixed", source=source)
            parameters[symbol] = parameter
        fitted = len(self.result.stages[0].problem.experiments)
        title = f"{self.campaign.title}: fitted to {fitted} runs, {today}"
        if not self.verdict.usable:
            title += f". {self.verdict.headline.rstrip('.')}"
        return replace(found, title=title, parameters=parameters, motion=motion_of(self.runs))


def motion_of(runs: Iterable[Experiment]) -> Motion:
    """What the drive of some runs moves: a rod where all positions were measured in m."""
    channels = [each for run in runs for each in run.channels.values()]
    units = {each.unit for each in channels if each.is_position}
    return "rod" if units == {"m"} else "shaft"


def _interval_words(assessments: Sequence[Assessment], found: ParameterSet) -> dict[str, list[str]]:
    """Intervals of the fitted parameters in words, by symbol."""
    words: dict[str, list[str]] = {}
    for each in assessments:
        unknowns = each.stage.problem.unknowns
        for estimate, unknown in zip(each.uncertainty.estimates, unknowns, strict=True):
            if unknown.run is not None:
                continue
            if unknown.name.startswith("force_"):
                forces = ("Z19", "Z20", "Z21", "Z22")
                words |= {symbol: ["from the fitted forces"] for symbol in forces}
                continue
            low, high = estimate.lower, estimate.upper
            ends: str = estimate.status
            if low is not None or high is not None:
                ends = f"{'none below' if low is None else f'{low:.5g}'} to "
                ends += "none above" if high is None else f"{high:.5g}"
            for target in unknown.targets:
                if target in found.numbers:
                    side = target.rpartition("_")[2]
                    side = f"{side} " if side in ("plus", "minus") else ""
                    words.setdefault(find(target).symbol, []).append(f"{side}{ends}")
    return words


def judge_fit(
    campaign: Campaign,
    runs: Sequence[Experiment],
    nominal: Parameters,
    plan: Setup,
    result: Fit,
    wanted: Wanted,
    watch: Callable[[str], None] = lambda _: None,
) -> Judged:
    """A fit with what was asked for besides: folds, bootstrap, profiles.

    Parameters
    ----------
    campaign, runs, nominal, plan :
        What was fitted, from where, and how.
    result : Fit
        What was found.
    wanted : Wanted
        Folds, bootstrap, profiles.
    watch : callable
        Is told in words how far the work is.

    Raises
    ------
    InputError
        If a profile of an unknown is wanted that there is not.
    """
    assessments = result.assessments
    known = [name for each in assessments for name in each.stage.problem.unknowns.names]
    for name in wanted.profiles:
        if name != "all" and name not in known:
            machine = [each for each in known if "(" not in each]
            raise InputError(f"There is no parameter '{name}'; there are {', '.join(machine)}.")
    folds, bootstraps, profiles = None, {}, list[StageProfile]()
    if wanted.folds:
        folds = cross_validate(
            runs,
            nominal,
            plan,
            folds=wanted.folds,
            loss=wanted.loss,
            watch=lambda _, done: watch(f"{done} of {wanted.folds} folds"),
            executor=wanted.executor,
            seed=wanted.seed,
        )
    if wanted.bootstrap:
        bootstraps = bootstraps_of(
            assessments,
            wanted.bootstrap,
            watch=lambda done: watch(f"{done} of {wanted.bootstrap} fits to new noise"),
            executor=wanted.executor,
            seed=wanted.seed,
        )
    for each in assessments if wanted.profiles else ():
        stage, own = each.stage.stage.name, each.stage.problem.unknowns.names
        every = "all" in wanted.profiles
        found = profiles_of(
            each,
            None if every else [name for name in wanted.profiles if name in own],
            executor=wanted.executor,
            watch=partial(_profiled, watch, stage),
        )
        profiles += [StageProfile(stage, one) for one in found.values()]
    notes = {**versions(), "seed": str(wanted.seed), "campaign": str(campaign.path)}
    return Judged(campaign, result, runs, bootstraps, profiles, folds, notes, wanted.required)


def _profiled(watch: Callable[[str], None], stage: str, done: int) -> None:
    """Say how many parameters of a stage are profiled."""
    watch(f"{stage}: {done} profiles")


def versions() -> dict[str, str]:
    """Of this package and of Python."""
    return {"swashplate": __version__, "Python": platform.python_version()}


class StageProfile(NamedTuple):
    """A profile, and the stage whose unknown it is of."""

    stage: str
    profile: Profile


class Entry(BaseModel):
    """A table of the file; a key that it does not know is refused."""

    model_config = ConfigDict(extra="forbid", ser_json_inf_nan="strings")


class StoredStage(Entry):
    """How a stage ended, and its starts."""

    name: str
    unknowns: tuple[Unknown, ...]
    """With what their priors are worth."""
    solution: Solution
    starts: tuple[Solution, ...]


class FitFile(Entry):
    """The whole file."""

    swashplate: str
    axis: str
    campaign: str
    runs: dict[str, str]
    """Name to fingerprint of each run that was fitted, in their order."""
    nominal: str | dict[str, float]
    """What the fit began from: a drive's parameter file, or the numbers of a model of one's own."""
    setup: Setup
    stages: tuple[StoredStage, ...]
    profiles: tuple[StageProfile, ...]
    folds: CrossValidation | None
    notes: dict[str, str]


def load_fit(
    path: str | Path,
    campaign: Campaign,
    *,
    model: ModelSetup | None = None,
    threads: int | None = None,
) -> Judged:
    """A stored fit with its campaign, without fitting again.

    Parameters
    ----------
    path : path
        What `Judged.store` wrote.
    campaign : Campaign
        The tests that were fitted.
    model : ModelSetup, optional
        The model of one's own that was fitted; the file does not hold it.
    threads : int, optional
        As of `fitting.fit`.

    Raises
    ------
    FileError, ParameterError
        If the file is none, or was written by another version.
    InputError
        If the campaign is not the one that was fitted, the sentence names the run; or the model is
        not given, or another one.
    """
    file = read_json(path, FitFile, strict=False)
    if file.swashplate != __version__:
        raise FileError(
            f"{path} was written by swashplate {file.swashplate}, this is {__version__}: fit again."
        )
    experiments = tuple(_same(campaign, name, mark, path) for name, mark in file.runs.items())
    nominal: Parameters
    if isinstance(file.nominal, str):
        nominal = read_set(file.nominal, str(path))
    elif model is None:
        raise InputError(f"{path} is the fit of a model of your own: give that, with --model FILE.")
    else:
        nominal = model.nominal(experiments)
    if isinstance(nominal, ModelSetup) and nominal.setup != file.setup:
        raise InputError(f"{path} is the fit of another model, or of other bounds: fit again.")
    parameters, stages, starts = smooth(nominal), list[StageFit](), dict[str, Any]()
    for stage, entry in zip(file.setup.stages, file.stages, strict=False):
        uncertain = file.setup.standard_uncertainty
        problem = stage_problem(
            stage, parameters, experiments, threads=threads, uncertain=uncertain, starts=starts
        )
        known, theirs = problem.unknowns.items, entry.unknowns
        if (stage.name, [(each.name, each.run) for each in known]) != (
            entry.name,
            [(each.name, each.run) for each in theirs],
        ) or entry.solution.vector.size != len(known):
            raise FileError(
                f"{path}: stage {entry.name} has other parameters than its fit configuration "
                "makes: fit again."
            )
        problem = replace(problem, unknowns=Unknowns(theirs))
        parameters = with_estimates(parameters, problem, entry.solution.vector)
        starts |= start_currents_of(problem, entry.solution.vector)
        stages.append(StageFit(stage, problem, entry.solution, parameters, entry.starts))
    found = Fit(file.setup, nominal, tuple(stages))
    return Judged(campaign, found, experiments, {}, file.profiles, file.folds, file.notes)


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


def _same(campaign: Campaign, name: str, mark: str, path: str | Path) -> Experiment:
    """A run of the campaign, if it is the one that was fitted."""
    experiment = next((each for each in campaign if each.name == name), None)
    if experiment is None:
        raise InputError(
            f"{path} was fitted to the run '{name}', which {campaign.path} has not: give the "
            "campaign of the fit, or fit again."
        )
    if fingerprint(experiment) != mark:
        raise InputError(
            f"The run '{name}' of {campaign.path} is not as it was when {path} was fitted (its "
            "samples, weights or ignored windows differ): name the campaign that was fitted, or "
            "fit again."
        )
    return experiment
