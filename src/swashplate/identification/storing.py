"""A fit on disk: all that its report needs besides the campaign, to make it again at will."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import blake2b
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict

from swashplate.__about__ import __version__
from swashplate.campaign.campaign import Campaign
from swashplate.campaign.experiment import Experiment
from swashplate.documents import read_json
from swashplate.errors import FileError, InputError
from swashplate.identification.cross_validation import CrossValidation
from swashplate.identification.fitting import Fit, StageFit, smooth
from swashplate.identification.own_model import ModelParameters, ModelSetup
from swashplate.identification.profile import Profile
from swashplate.identification.setup import Setup
from swashplate.identification.solving import Solution
from swashplate.identification.staging import Parameters, stage_problem, with_estimates
from swashplate.identification.starts import StartResult
from swashplate.identification.unknowns import Unknown, Unknowns
from swashplate.parameters.files import dump_set, read_set
from swashplate.results import Result
from swashplate.tables import write_text


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
    starts: tuple[StartResult, ...]


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


@dataclass(frozen=True, eq=False)
class StoredFit(Result):
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
            unknowns=each.problem.unknowns.items,
            solution=each.solution,
            starts=each.starts,
        )
        for each in fit.stages
    )
    start = fit.nominal
    content = FitFile(
        swashplate=__version__,
        axis=experiments[0].axis,
        campaign=str(campaign),
        runs={each.name: fingerprint(each) for each in experiments},
        nominal=dict(start.numbers) if isinstance(start, ModelParameters) else dump_set(start),
        setup=fit.setup,
        stages=stages,
        profiles=tuple(profiles),
        folds=folds,
        notes=dict(notes or {}),
    )
    write_text(content.model_dump_json(indent=1, by_alias=True) + "\n", path)


def load_fit(
    path: str | Path,
    campaign: Campaign,
    *,
    model: ModelSetup | None = None,
    threads: int | None = None,
) -> StoredFit:
    """A stored fit with its campaign, without fitting again.

    Parameters
    ----------
    path : path
        What `save_fit` wrote.
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
    if isinstance(nominal, ModelParameters) and nominal.setup.setup != file.setup:
        raise InputError(f"{path} is the fit of another model, or of other bounds: fit again.")
    parameters, stages = smooth(nominal), list[StageFit]()
    for stage, entry in zip(file.setup.stages, file.stages, strict=False):
        uncertain = file.setup.standard_uncertainty
        problem = stage_problem(
            stage, parameters, experiments, threads=threads, uncertain=uncertain
        )
        known, theirs = problem.unknowns.items, entry.unknowns
        if (stage.name, [(each.name, each.run) for each in known]) != (
            entry.name,
            [(each.name, each.run) for each in theirs],
        ) or entry.solution.vector.size != len(known):
            raise FileError(
                f"{path}: stage {entry.name} has other unknowns than its set-up makes: fit again."
            )
        problem = replace(problem, unknowns=Unknowns(theirs))
        parameters = with_estimates(parameters, problem, entry.solution.vector)
        stages.append(StageFit(stage, problem, entry.solution, parameters, entry.starts))
    return StoredFit(
        Fit(file.setup, nominal, tuple(stages)),
        file.axis,
        experiments,
        file.profiles,
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
