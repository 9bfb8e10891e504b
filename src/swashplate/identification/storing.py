"""A fit on disk: all that its report needs besides the campaign, to make it again at will."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import blake2b
from json import JSONDecodeError, loads
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict

from swashplate.__about__ import __version__
from swashplate.campaign.campaign import Campaign
from swashplate.campaign.experiment import Experiment
from swashplate.documents import read_text, validated
from swashplate.errors import FileError, InputError
from swashplate.identification.cross_validation import CrossValidation
from swashplate.identification.drive_model import DriveModel
from swashplate.identification.fit import Fit, StageFit, smooth
from swashplate.identification.profile import Ending, Point, Profile, Threshold
from swashplate.identification.setup import Setup
from swashplate.identification.solving import Solution
from swashplate.identification.staging import stage_problem
from swashplate.identification.starts import StartResult
from swashplate.identification.uncertainty import with_worths
from swashplate.parameters.files import dump_set, read_set
from swashplate.tables import write_text

Numbers = tuple[float, ...]


class StageProfile(NamedTuple):
    """A profile, and the stage whose unknown it is of."""

    stage: str
    profile: Profile


class Entry(BaseModel):
    """A table of the file; a key that it does not know is refused."""

    model_config = ConfigDict(extra="forbid", ser_json_inf_nan="strings")


class StoredSolution(Entry):
    """As `solving.Solution`."""

    vector: Numbers
    cost: float
    start_cost: float
    evaluations: int
    converged: bool
    interrupted: bool
    message: str
    seconds: float


class StoredStage(Entry):
    """How a stage ended, and its starts."""

    name: str
    unknowns: tuple[str, ...]
    solution: StoredSolution
    starts: tuple[StartResult, ...]
    worths: tuple[float, ...] = ()
    """Of the priors, in the order of the unknowns."""


class StoredPoint(Entry):
    """As `profile_side.Point`."""

    number: float
    cost: float
    vector: Numbers


class StoredProfile(Entry):
    """As `profiles.Profile`, with its stage."""

    stage: str
    index: int
    cost: float
    points: tuple[StoredPoint, ...]
    threshold: Threshold
    lower: float | None
    upper: float | None
    endings: tuple[Ending, Ending]
    better: StoredPoint | None


class FitFile(Entry):
    """The whole file."""

    format: int = 1
    swashplate: str
    axis: str
    campaign: str
    runs: dict[str, str]
    """Name to fingerprint of each run that was fitted, in their order."""
    nominal: str
    """Parameter file of the drive that the fit began from."""
    setup: Setup
    stages: tuple[StoredStage, ...]
    profiles: tuple[StoredProfile, ...]
    folds: CrossValidation | None
    notes: dict[str, str]


def profile_entry(given: StageProfile) -> StoredProfile:
    """A profile as it is stored."""
    profile = given.profile
    return StoredProfile(
        stage=given.stage,
        index=profile.index,
        cost=profile.cost,
        points=tuple(_point_entry(each) for each in profile.points),
        threshold=profile.threshold,
        lower=profile.lower,
        upper=profile.upper,
        endings=profile.endings,
        better=None if profile.better is None else _point_entry(profile.better),
    )


def _point_entry(point: Point) -> StoredPoint:
    vector = tuple(map(float, point.vector))
    return StoredPoint(number=point.number, cost=point.cost, vector=vector)


def profile_of(entry: StoredProfile) -> StageProfile:
    """A stored profile."""
    return StageProfile(
        entry.stage,
        Profile(
            entry.index,
            entry.cost,
            tuple(_point(each) for each in entry.points),
            entry.threshold,
            entry.lower,
            entry.upper,
            entry.endings,
            None if entry.better is None else _point(entry.better),
        ),
    )


def _point(entry: StoredPoint) -> Point:
    return Point(entry.number, entry.cost, np.array(entry.vector))


@dataclass(frozen=True, eq=False)
class StoredFit:
    """A fit as it was, and what was computed with it."""

    fit: Fit
    axis: str
    experiments: tuple[Experiment, ...]
    """That were fitted."""
    profiles: tuple[StageProfile, ...] = ()
    folds: CrossValidation | None = None
    notes: Mapping[str, str] | None = None
    """Versions, seed, command."""


def save_fit(
    fit: Fit,
    experiments: Sequence[Experiment],
    path: str | Path,
    *,
    campaign: str | Path = "",
    profiles: Sequence[StageProfile] = (),
    folds: CrossValidation | None = None,
    notes: Mapping[str, str] | None = None,
) -> None:
    """Store a fit as JSON, whole or not at all.

    Parameters
    ----------
    fit : Fit
        What was found.
    experiments : sequence of Experiment
        The runs that it was fitted to, as they were given to `fit.fit`. Their samples stay in the
        campaign; a fingerprint of each is stored.
    path : path
        ``fitted/fit.json``.
    campaign : path
        The campaign's file, for people.
    profiles, folds :
        What was computed besides, if anything.
    notes : mapping of str to str, optional
        What belongs to the report: versions, seed, command.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    stages = tuple(
        StoredStage(
            name=each.stage.name,
            unknowns=each.problem.unknowns.names,
            solution=StoredSolution(
                **{
                    **{name: getattr(each.solution, name) for name in StoredSolution.model_fields},
                    "vector": tuple(map(float, each.solution.vector)),
                }
            ),
            starts=each.starts,
            worths=tuple(
                unknown.prior.worth
                for unknown in each.problem.unknowns
                if unknown.prior is not None
            ),
        )
        for each in fit.stages
    )
    content = FitFile(
        swashplate=__version__,
        axis=experiments[0].axis,
        campaign=str(campaign),
        runs={each.name: fingerprint(each) for each in experiments},
        nominal=dump_set(fit.nominal),
        setup=fit.setup,
        stages=stages,
        profiles=tuple(profile_entry(each) for each in profiles),
        folds=folds,
        notes=dict(notes or {}),
    )
    write_text(content.model_dump_json(indent=1, by_alias=True) + "\n", path)


def load_fit(path: str | Path, campaign: Campaign, *, threads: int | None = None) -> StoredFit:
    """A stored fit with its campaign, without fitting again.

    Parameters
    ----------
    path : path
        What `save_fit` wrote.
    campaign : Campaign
        The tests that were fitted.
    threads : int, optional
        As of `fit.fit`.

    Raises
    ------
    FileError, ParameterError
        If the file is none, or was written by another version.
    InputError
        If the campaign is not the one that was fitted; the sentence names the run.
    """
    try:
        content = loads(read_text(path))
    except JSONDecodeError as error:
        raise FileError(f"{path} is no stored fit: {error}.") from None
    file = validated(content, FitFile, str(path))
    experiments = tuple(_same(campaign, name, mark, path) for name, mark in file.runs.items())
    nominal = read_set(file.nominal, str(path))
    parameters, stages = smooth(nominal), list[StageFit]()
    for stage, entry in zip(file.setup.stages, file.stages, strict=False):
        problem = stage_problem(stage, parameters, experiments, threads=threads)
        if (stage.name, problem.unknowns.names) != (entry.name, entry.unknowns):
            raise FileError(
                f"{path}: stage {entry.name} has other unknowns than swashplate {__version__} "
                f"makes of its set-up; it was written by {file.swashplate}, fit again."
            )
        if entry.worths:
            problem = with_worths(problem, entry.worths)
        given = entry.solution.model_dump()
        solution = Solution(**{**given, "vector": np.array(entry.solution.vector)})
        model = problem.model
        assert isinstance(model, DriveModel)
        parameters = model.parameters_at(problem.unknowns.targets(solution.vector, ""))
        stages.append(StageFit(stage, problem, solution, parameters, entry.starts))
    return StoredFit(
        Fit(file.setup, nominal, tuple(stages)),
        file.axis,
        experiments,
        tuple(profile_of(each) for each in file.profiles),
        file.folds,
        file.notes,
    )


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
            "samples, weights or ignored windows differ): fit again."
        )
    return experiment
