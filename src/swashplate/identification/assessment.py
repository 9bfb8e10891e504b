"""A fit with all that is found out about it, and its file."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ConfigDict

from swashplate.__about__ import __version__
from swashplate.campaign.campaign import Campaign
from swashplate.campaign.experiment import Experiment
from swashplate.documents import read_json
from swashplate.errors import FileError, InputError
from swashplate.identification import tables
from swashplate.identification.criteria import REQUIRED, Grade, Verdict, verdict
from swashplate.identification.drive_model import Parameters
from swashplate.identification.fitting import Fit, Solved, StageFit, fingerprint, staged
from swashplate.identification.problem import Loss, Problem
from swashplate.identification.profiles import Profile, profiles_of
from swashplate.identification.resampling import (
    Bootstrap,
    CrossValidation,
    bootstraps_of,
    cross_validate,
)
from swashplate.identification.setup import ModelSetup, Setup, Stage
from swashplate.identification.solving import Solution
from swashplate.identification.unknowns import Unknown, Unknowns
from swashplate.identification.validation import RunQuality, predict
from swashplate.parameters.definitions import find
from swashplate.parameters.files import dump_set, read_set
from swashplate.parameters.parameter_set import Motion, ParameterSet
from swashplate.progress import working
from swashplate.results import Result, folded
from swashplate.tables import Table, write_text

if TYPE_CHECKING:
    from swashplate.executors import Executor


@dataclass(frozen=True, eq=False)
class Judged(Result):
    """A fit, just made or stored, and all that is found out about it."""

    campaign: Campaign
    result: Fit
    bootstraps: Mapping[str, Bootstrap] = field(default_factory=dict)
    """By stage."""
    profiles: Sequence[Profile] = ()
    folds: CrossValidation | None = None
    notes: Mapping[str, str] = field(default_factory=dict)
    """Versions, seed, campaign."""
    required: float = REQUIRED
    """Largest error of held-out runs over their range."""

    @cached_property
    def predicted(self) -> tuple[RunQuality, ...]:
        """Runs of the axis that were held out, predicted."""
        runs = self.result.runs
        names = {each.name for each in runs}
        out = self.campaign.select(axis=runs[0].axis, role="validate")
        return predict(self.result.parameters, [each for each in out if each.name not in names])

    @cached_property
    def verdict(self) -> Verdict:
        """What it can be used for."""
        planned = [each.name for each in self.result.setup.stages]
        with working("Judging the fit"):
            return verdict(
                self.result.stages, self.predicted, planned=planned, required=self.required
            )

    def tables(self) -> list[Table]:
        """Criteria of the verdict, then the fit's tables and the errors of held-out runs."""
        return [self.verdict.table(), *self.result.tables(), *self._held_out_tables()]

    def _held_out_tables(self) -> list[Table]:
        made = tables.runs_tables(self.predicted)
        return [replace(table, title=f"{table.title}, held-out runs") for table in made]

    def _repr_html_(self) -> str:
        estimates = folded("Estimates, and errors of fitted runs", self.result.tables())
        held_out = self._held_out_tables()
        errors = folded("Errors of held-out runs", held_out) if held_out else ""
        return f"{self.verdict._repr_html_()}{estimates}{errors}"

    @property
    def headline(self) -> str:
        """The verdict in one sentence."""
        return self.verdict.headline

    @property
    def sentences(self) -> tuple[str, ...]:
        """What the verdict says below its table."""
        return tuple(self.verdict.remarks())

    def store(self, path: str | Path) -> None:
        """Write what `load_fit` reads and the report can be made from again, whole or not at all.

        Samples stay in the campaign; a fingerprint of each run is stored.
        """
        start = self.result.nominal
        content = FitFile(
            swashplate=__version__,
            axis=self.result.runs[0].axis,
            campaign=str(self.campaign.path),
            runs={each.name: fingerprint(each) for each in self.result.runs},
            nominal=dict(start.numbers) if isinstance(start, ModelSetup) else dump_set(start),
            setup=self.result.setup,
            stages=tuple(
                StoredStage(
                    name=each.stage.name,
                    unknowns=each.problem.unknowns.items,
                    solution=each.solution,
                    starts=each.starts,
                )
                for each in self.result.stages
            ),
            profiles=tuple(self.profiles),
            folds=self.folds,
            notes=dict(self.notes),
            verdict=StoredVerdict(
                grade=self.verdict.grade,
                headline=self.verdict.headline,
                numbers=dict(self.result.parameters.numbers),
            ),
        )
        write_text(content.model_dump_json(indent=1, by_alias=True) + "\n", path)

    def fitted_set(self) -> ParameterSet:
        """The fitted set, where each number says whether it was fitted or fixed, and its source.

        Of a fitted one the source is campaign, date and 95 % interval; of a fixed one that of the
        set which the fit began from. The title of one that is not usable says so.
        """
        found, nominal = self.result.drive.parameters, self.result.nominal
        assert isinstance(nominal, ParameterSet)
        today, ends = f"{date.today():%d %b %Y}", _interval_words(self.result.stages, found)
        parameters = dict(found.parameters)
        for symbol, parameter in parameters.items():
            if symbol in ends:
                source = f"{self.campaign.path.name}, {today}; 95 %: {'; '.join(ends[symbol])}"
                parameters[symbol] = replace(parameter, status="fitted", source=source)
            elif parameter.status != "inactive":
                before = nominal.parameters.get(symbol, parameter).source
                source = f"{nominal.name}: {before}" if before else nominal.name
                parameters[symbol] = replace(parameter, status="fixed", source=source)
        fitted = len(self.result.stages[0].problem.experiments)
        title = f"{self.campaign.title}: fitted to {fitted} runs, {today}"
        if not self.verdict.usable:
            title += f". {self.verdict.headline.rstrip('.')}"
        return replace(
            found, title=title, parameters=parameters, motion=motion_of(self.result.runs)
        )


def motion_of(runs: Iterable[Experiment]) -> Motion:
    """What the drive of some runs moves: a rod where all positions were measured in m.

    Where none was, a rod if all speeds are in m/s.
    """
    channels = [each for run in runs for each in run.channels.values()]
    units = {each.unit for each in channels if each.is_position}
    units = units or {each.unit for each in channels if each.kind == "shaft_speed"}
    return "rod" if units and units <= {"m", "m/s"} else "shaft"


def _interval_words(stages: Sequence[StageFit], found: ParameterSet) -> dict[str, list[str]]:
    """Intervals of the fitted parameters in words, by symbol."""
    words: dict[str, list[str]] = {}
    for each in stages:
        unknowns = each.problem.unknowns
        for estimate, unknown in zip(each.uncertainty.estimates, unknowns, strict=True):
            if unknown.run is None and unknown.name.startswith("force_"):
                forces = ("Z19", "Z20", "Z21", "Z22")
                words |= {symbol: ["from the fitted forces"] for symbol in forces}
            elif unknown.run is None:
                ends = " to ".join(filter(None, estimate.ends()))
                for target in (each for each in unknown.targets if each in found.numbers):
                    side = target.rpartition("_")[2]
                    side = f"{side} " if side in ("plus", "minus") else ""
                    words.setdefault(find(target).symbol, []).append(f"{side}{ends}")
    return words


def judge_fit(
    campaign: Campaign,
    result: Fit,
    *,
    first: Fit | None = None,
    folds: int = 0,
    bootstrap: int = 0,
    profiles: Sequence[str] = (),
    seed: int = 0,
    executor: Executor | None = None,
    loss: Loss = "linear",
    required: float = REQUIRED,
    watch: Callable[[str], None] = lambda _: None,
) -> Judged:
    """A fit with what was asked for besides: folds, bootstrap, profiles.

    Parameters
    ----------
    campaign, result :
        What was fitted, and what was found.
    first : Fit, optional
        The fit in stages that a joint one went on from: folds begin where it did.
    folds, bootstrap : int
        Folds of the cross-validation, and refits to new noise; 0 for none.
    profiles : sequence of str
        Unknowns by name, or ``"all"``; an `InputError` for one that there is not.
    seed, executor, loss :
        Of the refits.
    required : float
        Largest error of held-out runs over their range. [1]
    watch : callable
        Is given in words how far the work is.
    """
    stages = result.stages
    known = [name for each in stages for name in each.problem.unknowns.names]
    for name in profiles:
        if name != "all" and name not in known:
            machine = ", ".join(each for each in known if "(" not in each)
            raise InputError(f"There is no parameter '{name}'; there are {machine}.")
    how: dict[str, Any] = {"executor": executor, "seed": seed}
    validated, bootstraps, made = None, {}, list[Profile]()
    if folds:
        begun = result if first is None else first
        validated = cross_validate(
            begun.runs,
            begun.nominal,
            begun.setup,
            folds=folds,
            loss=loss,
            watch=lambda _, done: watch(f"{done} of {folds} folds"),
            **how,
        )
    if bootstrap:
        words = f"of {bootstrap} fits to new noise"
        bootstraps = bootstraps_of(stages, bootstrap, watch=lambda n: watch(f"{n} {words}"), **how)
    for each in stages if profiles else ():

        def profiled(done: int, stage: str = each.stage.name) -> None:
            watch(f"{stage}: {done} profiles")

        own = each.problem.unknowns.names
        names = None if "all" in profiles else [name for name in profiles if name in own]
        made += profiles_of(each, names, executor=executor, watch=profiled).values()
    notes = {**versions(), "seed": str(seed), "campaign": str(campaign.path)}
    return Judged(campaign, result, bootstraps, made, validated, notes, required)


def versions() -> dict[str, str]:
    """Of this package and of Python."""
    return {"swashplate": __version__, "Python": platform.python_version()}


# --- files ----------------------------------------------------------------------------------------


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


class StoredVerdict(Entry):
    """The verdict on the fit when it was stored."""

    grade: Grade
    headline: str
    numbers: dict[str, float]
    """Of the drive or model that it is about."""


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
    profiles: tuple[Profile | tuple[str, Profile], ...]
    """Behind the name of their stage in older files, which do not name the unknown."""
    folds: CrossValidation | None
    notes: dict[str, str]
    verdict: StoredVerdict | None = None
    """None in a file of a version that did not store it."""


def read_verdict(path: str | Path) -> StoredVerdict | None:
    """The verdict that a stored fit had, without its campaign; None if the file has none.

    A `FileError` or `ParameterError` if the file is none that `Judged.store` wrote.
    """
    return read_json(path, FitFile, strict=False).verdict


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
        What `Judged.store` wrote; a `FileError` if it is none, or was written by another version.
    campaign : Campaign
        The tests that were fitted; an `InputError` names the run that is not as it was.
    model : ModelSetup, optional
        The model of one's own that was fitted; the file does not have it.
    threads : int, optional
        As of `fitting.fit`.
    """
    file = read_json(path, FitFile, strict=False)
    if file.swashplate != __version__:
        raise FileError(
            f"{path} was written by swashplate {file.swashplate}, this is {__version__}: fit again."
        )
    runs = {each.name: each for each in campaign}
    for name, mark in file.runs.items():
        if name not in runs:
            raise InputError(
                f"{path} was fitted to the run '{name}', which {campaign.path} has not: give the "
                "campaign of the fit, or fit again."
            )
        if fingerprint(runs[name]) != mark:
            raise InputError(
                f"The run '{name}' of {campaign.path} is not as it was when {path} was fitted (its "
                "samples, weights or ignored windows differ): name the campaign that was fitted, "
                "or fit again."
            )
    experiments = tuple(runs[name] for name in file.runs)
    nominal: Parameters
    if isinstance(file.nominal, str):
        nominal = read_set(file.nominal, str(path))
    elif model is None:
        raise InputError(f"{path} is the fit of a model of your own: give that, with --model FILE.")
    else:
        nominal = model.nominal(experiments)
    if isinstance(nominal, ModelSetup) and nominal.setup != file.setup:
        raise InputError(f"{path} is the fit of another model, or of other bounds: fit again.")
    entries = iter(file.stages)

    def stored(stage: Stage, problem: Problem) -> Solved:
        entry = next(entries)
        ours, theirs = (
            (name, [(unknown.name, unknown.run) for unknown in unknowns])
            for name, unknowns in ((stage.name, problem.unknowns), (entry.name, entry.unknowns))
        )
        if ours != theirs or entry.solution.vector.size != len(entry.unknowns):
            raise FileError(
                f"{path}: stage {entry.name} has other parameters than its fit configuration "
                "makes: fit again."
            )
        return replace(problem, unknowns=Unknowns(entry.unknowns)), entry.solution, entry.starts

    begun = file.setup.model_copy(update={"stages": file.setup.stages[: len(file.stages)]})
    stages = staged(begun, nominal, experiments, stored, threads=threads)
    found, profiles = Fit(file.setup, nominal, experiments, stages), list[Profile]()
    for each in file.profiles:
        stage, profile = (each.stage, each) if isinstance(each, Profile) else each
        names = found.stage(stage).problem.unknowns.names
        if not 0 <= profile.index < len(names):
            raise FileError(f"{path}: stage {stage} has no parameter {profile.index + 1}.")
        profiles.append(replace(profile, stage=stage, name=names[profile.index]))
    return Judged(campaign, found, {}, profiles, file.folds, file.notes)
