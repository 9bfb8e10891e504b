"""Sizing: the smallest change of a drive that meets what is required."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from swashplate.analysis.outcomes import Direction, Performance, Trial, performance
from swashplate.analysis.whatif import Range, check_ranges, pulled
from swashplate.drive import Drive
from swashplate.errors import DomainError, InputError, ParameterError
from swashplate.results import Result
from swashplate.tables import UNIT, Cell, Column, Table
from swashplate.units import display_unit

Array = NDArray[np.float64]
Slack = Callable[[Array], Array]
"""From (L,) factors to (r,) slacks, all 0 or more where the factors satisfy."""

# --- search ---------------------------------------------------------------------------------------

SCANNED = 6  # ln₂ of the points of a Sobol sequence that are tried besides the corners.
MOST_CORNERS = 64
FINEST = 1e-9  # Part of the way to which an end is bisected.
ALONG = 33  # Points along a single factor's range.


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
    The box is scanned (each factor alone, corners and a Sobol sequence); from the two best points
    on, SLSQP minimises the change under the inequalities, with derivatives by differences; what it
    finds is drawn towards 1, as a whole and factor by factor, as far as the inequalities allow.
    """
    from scipy.optimize import minimize
    from scipy.stats.qmc import Sobol

    unchanged = np.ones(low.size)
    if _met(slack, unchanged):
        return unchanged
    scanned = list(Sobol(low.size, scramble=False).random_base2(SCANNED))
    if 2**low.size <= MOST_CORNERS:
        scanned += [np.array(corner, dtype=float) for corner in product((0, 1), repeat=low.size)]
    points = [low + point * (high - low) for point in scanned]
    for k in range(low.size):
        factor = smallest_alone(slack, low, high, k)
        points += [] if factor is None else [_with(unchanged, k, factor)]
    good = sorted((point for point in points if _met(slack, point)), key=_change)
    found = [_drawn_in(slack, each) for each in good[:2]]
    for start in list(found):
        solved = minimize(
            _change,
            start,
            jac=lambda x: 2.0 * (x - 1.0),
            method="SLSQP",
            bounds=list(zip(low, high, strict=True)),
            constraints={"type": "ineq", "fun": lambda x: slack(np.clip(x, low, high))},
            options={"maxiter": 60, "ftol": 1e-10, "eps": 1e-5},
        )
        moved = np.clip(solved.x, low, high)
        # SLSQP may have stopped on the wrong side: a little farther from 1
        beyond = np.clip(1.0 + 1.001 * (moved - 1.0), low, high)
        for each in (moved, start + 1.0001 * (moved - start), beyond):
            if _met(slack, each):
                found.append(_drawn_in(slack, each))
                break
    return min(found, key=_change, default=None)


def smallest_alone(slack: Slack, low: Array, high: Array, index: int) -> float | None:
    """The factor nearest to 1 that satisfies by itself, the others being 1; None if none does."""
    unchanged = np.ones(low.size)
    if _met(slack, unchanged):
        return 1.0
    ends = []
    for end in (float(low[index]), float(high[index])):
        before = 1.0
        for factor in np.linspace(1.0, end, ALONG)[1:] if end != 1.0 else ():
            goal = _with(unchanged, index, factor)
            if _met(slack, goal):
                ends.append(float(_bisected(slack, _with(unchanged, index, before), goal)[index]))
                break
            before = float(factor)
    return min(ends, key=lambda factor: abs(factor - 1.0), default=None)


def _drawn_in(slack: Slack, point: Array) -> Array:
    """A point that satisfies, moved towards 1 as a whole and then factor by factor."""
    drawn = _bisected(slack, np.ones(point.size), point)
    for k in range(point.size):
        drawn = _bisected(slack, _with(drawn, k, 1.0), drawn)
    return drawn


def _bisected(slack: Slack, wanted: Array, good: Array) -> Array:
    """The end of what satisfies, on the way from a point that does to a wanted one."""
    if _met(slack, wanted):
        return wanted
    low, high = 0.0, 1.0
    while high - low > FINEST:
        middle = 0.5 * (low + high)
        if _met(slack, wanted + middle * (good - wanted)):
            high = middle
        else:
            low = middle
    return good if high == 1.0 else wanted + high * (good - wanted)


def _with(point: Array, index: int, factor: float) -> Array:
    moved = point.copy()
    moved[index] = factor
    return moved


def _met(slack: Slack, point: Array) -> bool:
    return bool(slack(point).min() >= 0.0)


def _change(point: Array) -> float:
    return float(np.sum((point - 1.0) ** 2))


# --- sizing ---------------------------------------------------------------------------------------

WIDEST: Range = (0.5, 2.0)  # Factors that a lever may take unless others are given.
REQUIRED = {
    "speed": ("a speed of", "rad/s", ">="),
    "acceleration": ("an acceleration of", "rad/s^2", ">="),
    "tracking_error": ("a tracking error of", "rad/s", "<="),
}
"""What can be required: in words, its unit, and how it is compared."""


@dataclass(frozen=True)
class Requirements(Result):
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
        if not self.given:
            raise InputError(
                "Require at least one of a speed, an acceleration and a tracking error."
            )
        for name, value in self.given.items():
            if not (np.isfinite(value) and value > 0.0):
                raise InputError(
                    f"The required {name.replace('_', ' ')} is {value:g}, but must be positive."
                )

    @property
    def given(self) -> dict[str, float]:
        """What is required by name, SI."""
        values = {name: getattr(self, name) for name in REQUIRED}
        return {name: value for name, value in values.items() if value is not None}

    def slacks(self, found: Performance) -> dict[str, float]:
        """By how much each requirement is met: ln of the ratio, negative where it is not. [1]"""
        return {
            name: (1.0 if REQUIRED[name][2] == ">=" else -1.0)
            * float(np.log(max(getattr(found, name), 1e-300) / value))
            for name, value in self.given.items()
        }


@dataclass(frozen=True, eq=False)
class Sizing(Result):
    """The smallest change that meets the requirements."""

    factors: Mapping[str, float]  # By lever; 1 leaves it alone.
    drive: Drive  # The changed drive.
    before: Performance
    after: Performance
    alone: Mapping[str, float | None]
    """By lever the factor that is enough without the others, None where there is none."""

    @property
    def change(self) -> float:
        """Root of the summed squares of (factor - 1). [1]"""
        return float(np.sqrt(sum((factor - 1.0) ** 2 for factor in self.factors.values())))

    def table(self) -> Table:
        """How far each lever moves, and how far it would have to by itself."""
        heads = Column("lever"), Column("factor", ".4f"), Column("change", "+z.2%")
        made = Table("", (*heads, Column("enough by itself", ".4f", none="no")))
        for name, factor in self.factors.items():
            made.add(name, factor, factor - 1.0, self.alone[name])
        return made


def size(
    drive: Drive,
    requirements: Requirements,
    ranges: Mapping[str, Range],
    *,
    follow: Trial | None = None,
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
    follow : Trial, optional
        Whose wanted speed is to be followed, needed for a required tracking error.

    Raises
    ------
    InputError
        If the levers do not reach the requirements: the sentence says what they reach. Or for an
        unknown lever, a range without 1, or a tracking error without a speed to follow.

    Notes
    -----
    Smallest means the least Σ (factor - 1)²: twice as large counts as much as 100 % off.
    """
    if requirements.tracking_error is not None and follow is None:
        raise InputError("A tracking error can only be required with a speed to follow.")
    check_ranges(ranges, around=1.0)
    names = list(ranges)
    low, high = (np.array([pair[k] for pair in ranges.values()]) for k in (0, 1))
    known: dict[bytes, Array] = {}

    def done(point: Array) -> Performance:
        changed = pulled(drive, dict(zip(names, point, strict=True)))
        return performance(changed, follow, direction=requirements.direction)

    def slack(point: Array) -> Array:
        key = point.tobytes()
        if key not in known:
            try:
                known[key] = np.array(list(requirements.slacks(done(point)).values()))
            except (ParameterError, DomainError):
                # as far from all requirements as no drive that can be simulated is
                known[key] = np.full(len(requirements.given), -1e3)
        return known[key]

    before = performance(drive, follow, direction=requirements.direction)
    point = smallest_change(slack, low, high)
    if point is None:
        words = ", ".join(f"{name} x {pair[0]:g} to {pair[1]:g}" for name, pair in ranges.items())
        points = np.array([np.frombuffer(key) for key in known])
        reached = _reached(requirements, points, np.array(list(known.values())), done)
        raise InputError(f"Within {words} the {drive.name} {reached}.")
    factors = {name: float(factor) for name, factor in zip(names, point, strict=True)}
    alone = {name: smallest_alone(slack, low, high, k) for k, name in enumerate(names)}
    return Sizing(factors, pulled(drive, factors), before, done(point), alone)


def _reached(
    required: Requirements, points: Array, slacks: Array, done: Callable[[Array], Performance]
) -> str:
    """What is reachable instead, of all points that were tried."""

    def said(name: str, index: int) -> str:
        words, unit, _ = REQUIRED[name]
        reached, limit = (np.degrees(getattr(x, name)) for x in (done(points[index]), required))
        shown = "deg/s²" if unit == "rad/s^2" else "deg/s"
        return f"{words} {reached:.4g} {shown} (required {limit:.4g})"

    best = slacks.argmax(axis=0)
    missed = [k for k in range(len(required.given)) if slacks[best[k], k] < 0.0]
    names = list(required.given)
    if missed:
        return f"reaches {', and '.join(said(names[k], int(best[k])) for k in missed)}"
    nearest = int(slacks.min(axis=1).argmax())
    return (
        "meets each requirement, but not all at once: nearest is "
        f"{', '.join(said(name, nearest) for name in names)}"
    )


def performance_table(found: Sizing, required: Requirements) -> Table:
    """What is required, what the drive does as it is, and what it does when changed."""
    columns = (Column(each, ".2f") for each in ("required", "as it is", "changed"))
    made = Table("", (Column(""), *columns, UNIT))
    for name, (_, unit, sign) in REQUIRED.items():
        before, after = getattr(found.before, name), getattr(found.after, name)
        if before is None or after is None:
            continue
        wanted = getattr(required, name)
        limit = wanted and Cell(wanted, f"{sign} {display_unit(unit).factor * wanted:.2f}")
        made.add(name.replace("_", " "), limit, before, after, unit=unit)
    return made
