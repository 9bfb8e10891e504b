"""A fit on disk: all that its report needs besides the campaign, to make it again at will."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import blake2b
from json import JSONDecodeError, loads
from pathlib import Path

import numpy as np

from swashplate.__about__ import __version__
from swashplate.campaign.campaign import Campaign
from swashplate.campaign.experiment import Experiment
from swashplate.documents import read_text, validated
from swashplate.errors import FileError, InputError
from swashplate.identification.cross_validation import CrossValidation
from swashplate.identification.drive_model import DriveModel
from swashplate.identification.fit import Fit, StageFit, smooth
from swashplate.identification.fit_file import (
    FitFile,
    StageProfile,
    StoredSolution,
    StoredStage,
    profile_entry,
    profile_of,
)
from swashplate.identification.solving import Solution
from swashplate.identification.staging import stage_problem
from swashplate.identification.uncertainty import with_worths
from swashplate.parameters.files import dump_set, read_set
from swashplate.tables import write_text


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
