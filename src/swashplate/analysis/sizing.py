"""Sizing: the smallest change of a drive that meets what is required."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import product
from math import ceil, copysign

import numpy as np
from numpy.typing import NDArray

from swashplate.analysis.outcomes import Direction, Performance, Wanted, performance
from swashplate.analysis.whatif import find_lever, pulled
from swashplate.drive import Drive
from swashplate.errors import DomainError, InputError, ParameterError
from swashplate.tables import UNIT, Cell, Column, Table
from swashplate.units import display_unit

# --- search ---------------------------------------------------------------------------------------


Array = NDArray[np.float64]
Slack = Callable[[Array], Array]
"""From (L,) factors to (r,) slacks, all 0 or more where the factors satisfy."""

SCANNED = 5
"""ln₂ of the points of a Sobol sequence that are tried besides the corners."""
MOST_CORNERS = 64
FINEST = 1e-9
"""Part of the way to which an end is bisected."""
ALONG = 33
"""Points along a single factor's range."""


def smallest_change(slack: Slack, low: Array, high: Array) -> Array | None:
    """Factors with the least Σ (factor - 1)² of those that satisfy, None if none was found.

    Parameters
    ----------
    slack : callable
        The inequalities, as `Slack`.
    low, high : (L,) array
        Range of each factor, 1 within.

    Returns
    -------
    (L,) array or None
        Satisfies exactly: the last step is a bisection that ends on the right side.

    Notes
    -----
    The box is scanned (corners and a Sobol sequence); from the best points on, SLSQP minimises the
    change under the inequalities, with derivatives by differences; what it finds is drawn towards
    1, as a whole and factor by factor, as far as the inequalities allow.
    """
    unchanged = np.ones(low.size)
    if _met(slack, unchanged):
        return unchanged
    points = [unchanged, *_scan(low, high)]
    singles = [smallest_alone(slack, low, high, k) for k in range(low.size)]
    for k, factor in enumerate(singles):
        if factor is not None:
            points.append(_with(unchanged, k, factor))
    best = max(points, key=lambda point: float(slack(point).min()))
    if not _met(slack, best):
        best = _most_nearly(slack, best, low, high)
        if not _met(slack, best):
            return None
    good = sorted((point for point in [*points, best] if _met(slack, point)), key=_change)
    found = [_drawn_in(slack, each) for each in good[:2]]
    for start in list(found):
        moved = _constrained(slack, start, low, high)
        for each in (moved, start + 1.0001 * (moved - start), _beyond(moved, low, high)):
            if _met(slack, each):
                found.append(_drawn_in(slack, each))
                break
    return min(found, key=_change)


def smallest_alone(slack: Slack, low: Array, high: Array, index: int) -> float | None:
    """The factor nearest to 1 that satisfies by itself, None if none does.

    Parameters
    ----------
    slack, low, high :
        As of `smallest_change`.
    index : int
        Which factor; the others are 1.
    """
    unchanged = np.ones(low.size)
    if _met(slack, unchanged):
        return 1.0
    ends = []
    for end in (float(low[index]), float(high[index])):
        before = 1.0
        for factor in np.linspace(1.0, end, ALONG)[1:] if end != 1.0 else ():
            if _met(slack, _with(unchanged, index, factor)):
                base = _with(unchanged, index, before)
                goal = _with(unchanged, index, factor)
                ends.append(float(_bisected(slack, base, goal)[index]))
                break
            before = float(factor)
    return min(ends, key=lambda factor: abs(factor - 1.0), default=None)


def _scan(low: Array, high: Array) -> list[Array]:
    from scipy.stats.qmc import Sobol

    points = list(Sobol(low.size, scramble=False).random_base2(SCANNED))
    if 2**low.size <= MOST_CORNERS:
        points += [np.array(corner, dtype=float) for corner in product((0, 1), repeat=low.size)]
    return [low + point * (high - low) for point in points]


def _most_nearly(slack: Slack, start: Array, low: Array, high: Array) -> Array:
    """The point whose worst slack is largest, by raising a level below all slacks."""
    from scipy.optimize import minimize

    found = minimize(
        lambda x: -x[-1],
        [*start, float(slack(start).min())],
        method="SLSQP",
        bounds=[*zip(low, high, strict=True), (None, None)],
        constraints={
            "type": "ineq",
            "fun": lambda x: slack(np.clip(x[:-1], low, high)) - x[-1],
        },
        options={"maxiter": 60, "ftol": 1e-8, "eps": 1e-5},
    )
    point: Array = np.clip(found.x[:-1], low, high)
    return max((start, point), key=lambda each: float(slack(each).min()))


def _constrained(slack: Slack, start: Array, low: Array, high: Array) -> Array:
    from scipy.optimize import minimize

    found = minimize(
        lambda x: float(np.sum((x - 1.0) ** 2)),
        start,
        jac=lambda x: 2.0 * (x - 1.0),
        method="SLSQP",
        bounds=list(zip(low, high, strict=True)),
        constraints={"type": "ineq", "fun": lambda x: slack(np.clip(x, low, high))},
        options={"maxiter": 60, "ftol": 1e-10, "eps": 1e-5},
    )
    point: Array = np.clip(found.x, low, high)
    return point


def _drawn_in(slack: Slack, point: Array) -> Array:
    """A point that satisfies, moved towards 1 as a whole and then factor by factor."""
    drawn = _bisected(slack, np.ones(point.size), point)
    for k in range(point.size):
        alone = _with(drawn, k, 1.0)
        drawn = alone if _met(slack, alone) else _bisected(slack, alone, drawn)
    return drawn


def _bisected(slack: Slack, bad: Array, good: Array) -> Array:
    """The end of what satisfies, on the way from a point that does to one that does not."""
    low, high = 0.0, 1.0
    while high - low > FINEST:
        middle = 0.5 * (low + high)
        if _met(slack, bad + middle * (good - bad)):
            high = middle
        else:
            low = middle
    return good if high == 1.0 else bad + high * (good - bad)


def _beyond(point: Array, low: Array, high: Array) -> Array:
    """A little farther from 1, where SLSQP has stopped on the wrong side."""
    return np.asarray(np.clip(1.0 + 1.001 * (point - 1.0), low, high))


def _with(point: Array, index: int, factor: float) -> Array:
    moved = point.copy()
    moved[index] = factor
    return moved


def _met(slack: Slack, point: Array) -> bool:
    return bool(slack(point).min() >= 0.0)


def _change(point: Array) -> float:
    return float(np.sum((point - 1.0) ** 2))


# --- sizing ---------------------------------------------------------------------------------------


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


def levers_table(found: Sizing) -> Table:
    """How far each lever moves, and how far it would have to by itself."""
    made = Table(
        "",
        (
            Column("lever"),
            Column("factor", ".4f"),
            Column("change", "+z.2%"),
            Column("enough by itself", ".4f", none="no"),
        ),
    )
    for name, factor in found.factors.items():
        made.add(name, factor, factor - 1.0, found.alone[name])
    return made


def performance_table(found: Sizing, required: Requirements) -> Table:
    """What is required, what the drive does as it is, and what it does when changed."""
    columns = (Column(each, ".2f") for each in ("required", "as it is", "changed"))
    made = Table("", (Column(""), *columns, UNIT))
    for name, sign, unit in (
        ("speed", ">=", "rad/s"),
        ("acceleration", ">=", "rad/s^2"),
        ("tracking_error", "<=", "rad/s"),
    ):
        before, after = getattr(found.before, name), getattr(found.after, name)
        if before is None or after is None:
            continue
        wanted = getattr(required, name)
        limit = wanted and Cell(wanted, f"{sign} {display_unit(unit).factor * wanted:.2f}")
        made.add(name.replace("_", " "), limit, before, after, unit=unit)
    return made


def typed_factors(
    found: Sizing, drive: Drive, required: Requirements, follow: Wanted | None
) -> dict[str, float]:
    """Factors that someone can type: short, and still enough.

    Each is rounded away from 1, to as few decimals, four or more, as meet what is required.
    """
    moved = {name: factor for name, factor in found.factors.items() if factor != 1.0}
    for decimals in range(4, 9):
        factors = {name: _away_from_one(factor, decimals) for name, factor in moved.items()}
        after = performance(pulled(drive, factors), follow, direction=required.direction)
        if min(required.slacks(after).values()) >= 0.0:
            return factors
    return moved


def _away_from_one(factor: float, decimals: int) -> float:
    # round() drops what only the factor's last bits are off a number of so many decimals
    steps = ceil(round(abs(factor - 1.0) * 10.0**decimals, 6))
    return 1.0 + copysign(steps, factor - 1.0) / 10.0**decimals
