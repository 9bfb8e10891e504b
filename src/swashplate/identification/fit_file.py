"""What a stored fit looks like on disk."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict

from swashplate.identification.cross_validation import CrossValidation
from swashplate.identification.profile import Ending, Point, Profile, Threshold
from swashplate.identification.setup import Setup
from swashplate.identification.starts import StartResult

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
