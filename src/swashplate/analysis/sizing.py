"""Sizing: the smallest change of a drive that meets a speed, an acceleration, a tracking error."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swashplate.analysis.levers import find_lever, pulled
from swashplate.analysis.performance import Direction, Performance, Wanted, performance
from swashplate.analysis.search import smallest_alone, smallest_change
from swashplate.drive import Drive
from swashplate.errors import DomainError, InputError, ParameterError

Array = NDArray[np.float64]
Range = tuple[float, float]

WIDEST: Range = (0.5, 2.0)
"""Factors that a lever may take unless others are given."""


@dataclass(frozen=True)
class Requirements:
    """What is required; None is not."""

    speed: float | None = None
    """At least. [rad/s]"""
    acceleration: float | None = None
    """At least. [rad/s²]"""
    tracking_error: float | None = None
    """At most, RMS. [rad/s]"""
    direction: Direction = "both"
    """In which directions speed and acceleration are required."""

    def __post_init__(self) -> None:
        given = {name: getattr(self, name) for name in ("speed", "acceleration", "tracking_error")}
        if all(value is None for value in given.values()):
            raise InputError(
                "Require at least one of a speed, an acceleration and a tracking error."
            )
        for name, value in given.items():
            if value is not None and not (np.isfinite(value) and value > 0.0):
                raise InputError(
                    f"The required {name.replace('_', ' ')} is {value:g}, but must be positive."
                )

    def slacks(self, found: Performance) -> dict[str, float]:
        """By how much each requirement is met: ln of the ratio, negative where it is not. [1]"""
        made = {}
        if self.speed is not None:
            made["speed"] = _ratio(found.speed, self.speed)
        if self.acceleration is not None:
            made["acceleration"] = _ratio(found.acceleration, self.acceleration)
        if self.tracking_error is not None:
            assert found.tracking_error is not None
            made["tracking_error"] = -_ratio(found.tracking_error, self.tracking_error)
        return made


@dataclass(frozen=True, eq=False)
class Sizing:
    """The smallest change that meets the requirements."""

    factors: Mapping[str, float]
    """By lever; 1 leaves it alone."""
    drive: Drive
    """The changed drive."""
    before: Performance
    after: Performance
    alone: Mapping[str, float | None]
    """By lever the factor that is enough without the others, None where there is none."""

    @property
    def change(self) -> float:
        """Root of the summed squares of (factor - 1). [1]"""
        return float(np.sqrt(sum((factor - 1.0) ** 2 for factor in self.factors.values())))


def size(
    drive: Drive,
    requirements: Requirements,
    ranges: Mapping[str, Range],
    *,
    follow: Wanted | None = None,
) -> Sizing:
    """Find the smallest change of the levers that meets the requirements.

    Parameters
    ----------
    drive : Drive
        As it is.
    requirements : Requirements
        What it shall do.
    ranges : mapping of str to (float, float)
        The levers that may be moved, with the lowest and highest factor; 1 lies between. [1]
    follow : Wanted, optional
        The speed to follow, needed for a required tracking error.

    Raises
    ------
    InputError
        If the levers do not reach the requirements: the sentence says what they reach. Or for an
        unknown lever, a range without 1, or a tracking error without a speed to follow.

    Notes
    -----
    Smallest means the least Σ (factor - 1)²: twice as large counts as much as 100 % off.
    """
    _check(requirements, ranges, follow)
    names = list(ranges)
    low, high = (np.array([pair[k] for pair in ranges.values()]) for k in (0, 1))
    known: dict[bytes, Array] = {}

    def slack(point: Array) -> Array:
        key = point.tobytes()
        if key not in known:
            known[key] = _slack(drive, requirements, follow, dict(zip(names, point, strict=True)))
        return known[key]

    before = performance(drive, follow, direction=requirements.direction)
    point = smallest_change(slack, low, high)
    if point is None:
        raise InputError(_unreachable(drive, requirements, follow, ranges, known))
    factors = {name: float(factor) for name, factor in zip(names, point, strict=True)}
    changed = pulled(drive, factors)
    alone = {name: smallest_alone(slack, low, high, k) for k, name in enumerate(names)}
    after = performance(changed, follow, direction=requirements.direction)
    return Sizing(factors, changed, before, after, alone)


def _slack(
    drive: Drive, requirements: Requirements, follow: Wanted | None, factors: Mapping[str, float]
) -> Array:
    try:
        found = performance(pulled(drive, factors), follow, direction=requirements.direction)
    except (ParameterError, DomainError):
        # as far from all requirements as no drive that can be simulated is
        return np.full(len(_required(requirements)), -1e3)
    return np.array(list(requirements.slacks(found).values()))


def _required(requirements: Requirements) -> tuple[str, ...]:
    return tuple(
        name
        for name in ("speed", "acceleration", "tracking_error")
        if getattr(requirements, name) is not None
    )


def _unreachable(
    drive: Drive,
    requirements: Requirements,
    follow: Wanted | None,
    ranges: Mapping[str, Range],
    known: Mapping[bytes, Array],
) -> str:
    """What is reachable instead, of all points that were tried."""
    points = np.array([np.frombuffer(key) for key in known])
    slacks = np.array(list(known.values()))
    words = ", ".join(f"{name} x {low:g} to {high:g}" for name, (low, high) in ranges.items())
    names = _required(requirements)

    def at(index: int) -> Performance:
        factors = dict(zip(ranges, points[index], strict=True))
        return performance(pulled(drive, factors), follow, direction=requirements.direction)

    missed = [k for k in range(len(names)) if slacks[:, k].max() < 0.0]
    if missed:
        reached = [
            _said(names[k], getattr(at(int(slacks[:, k].argmax())), names[k]), requirements)
            for k in missed
        ]
        return f"Within {words} the {drive.name} reaches {', and '.join(reached)}."
    best = at(int(slacks.min(axis=1).argmax()))
    reached = [_said(name, getattr(best, name), requirements) for name in names]
    return (
        f"Within {words} the {drive.name} meets each requirement, but not all at once: nearest is "
        f"{', '.join(reached)}."
    )


def _said(name: str, reached: float, requirements: Requirements) -> str:
    required = np.degrees(getattr(requirements, name))
    unit = "deg/s²" if name == "acceleration" else "deg/s"
    words = {
        "speed": "a speed of",
        "acceleration": "an acceleration of",
        "tracking_error": "a tracking error of",
    }[name]
    return f"{words} {np.degrees(reached):.4g} {unit} (required {required:.4g})"


def _ratio(found: float, required: float) -> float:
    return float(np.log(max(found, 1e-300) / required))


def _check(requirements: Requirements, ranges: Mapping[str, Range], follow: Wanted | None) -> None:
    if not ranges:
        raise InputError("Name at least one lever that may be moved, such as orifice.")
    if requirements.tracking_error is not None and follow is None:
        raise InputError("A tracking error can only be required with a speed to follow.")
    for name, (low, high) in ranges.items():
        find_lever(name)
        if not (0.0 <= low <= 1.0 <= high < np.inf and low < high):
            raise InputError(
                f"The factors on {name} must reach from at most 1 to at least 1, not from {low:g} "
                f"to {high:g}."
            )
