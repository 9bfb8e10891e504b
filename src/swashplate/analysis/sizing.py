"""Sizing: the smallest change of a drive that meets what is required."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.analysis.design_variables import FactorRange, check_ranges, with_factors
from swashplate.analysis.outcomes import Trial, rms_difference, speed_per_volt
from swashplate.drive import Drive
from swashplate.errors import DomainError, InputError, ParameterError
from swashplate.parameters import FULL_VOLTAGE
from swashplate.results import Result
from swashplate.stopping import as_a_whole
from swashplate.tables import UNIT, Cell, Column, Table, listed, quantity
from swashplate.units import display_unit

Array = NDArray[np.float64]

# --- what a drive can do --------------------------------------------------------------------------

Direction = Literal["both", "positive", "negative"]
STEP_LENGTH = 2.0
"""Duration of the full step that shows the largest acceleration. [s]"""
STEP_RATE = 512.0
"""Its samples a second. [Hz]"""
SMALLEST = 1e-300
"""In place of zero as a divisor or as the argument of a logarithm."""


class Performance(NamedTuple):
    """Performance of a drive; of two directions the worse one."""

    speed: float
    """Steady speed at the largest command. [rad/s]"""
    acceleration: float
    """Largest acceleration after a full step from rest. [rad/s²]"""
    tracking_error: float | None
    """RMS difference from the reference speed, None if there is none. [rad/s]"""


def performance(
    drive: Drive, follow: Trial | None = None, *, direction: Direction = "both"
) -> Performance:
    """Simulate what a drive can do.

    Parameters
    ----------
    drive : Drive
        From rest.
    follow : Trial, optional
        Its reference speed is to be followed. The command is in proportion to it, by the ratio of
        the drive itself (see `speed_per_volt`), within ±10 V: a larger pump is given less voltage.
    direction : {"both", "positive", "negative"}
        Which speed and acceleration count.

    Returns
    -------
    Performance
        Speed [rad/s], acceleration [rad/s²] and tracking error [rad/s].

    Raises
    ------
    DomainError
        If the drive leaves the model's domain.

    Examples
    --------
    >>> from swashplate import Drive, analysis
    >>> round(analysis.performance(Drive.preset("hoist")).speed, 2)
    3.23
    """
    speeds = []
    accelerations = []
    for name, sign in (("positive", 1.0), ("negative", -1.0)):
        if direction in (name, "both"):
            voltage = np.full(int(STEP_LENGTH * STEP_RATE) + 1, sign * FULL_VOLTAGE)
            voltage[0] = 0.0
            speeds.append(abs(drive.steady_speed(sign * FULL_VOLTAGE)))
            change = sign * np.diff(drive.simulate(voltage, STEP_RATE).shaft_speed)
            accelerations.append(float(change.max() * STEP_RATE))
    error = None
    if follow is not None:
        plus_gain, minus_gain = (max(speed_per_volt(drive, sign), SMALLEST) for sign in (1.0, -1.0))
        volts = follow.reference / np.where(follow.reference >= 0.0, plus_gain, minus_gain)
        run = drive.simulate(np.clip(volts, -FULL_VOLTAGE, FULL_VOLTAGE), follow.rate)
        error = rms_difference(run.shaft_speed, follow.reference)
    return Performance(min(speeds), min(accelerations), error)


# --- what is required -----------------------------------------------------------------------------

REQUIRED = {
    "speed": ("rad/s", 1.0),
    "acceleration": ("rad/s^2", 1.0),
    "tracking_error": ("rad/s", -1.0),
}
"""Requirements by name, with unit, and 1 for at least, -1 for at most."""


@dataclass(frozen=True)
class Requirements(Result):
    """Required performance; None is not required.

    Parameters
    ----------
    speed, acceleration : float, optional
        What is to be reached at least, positive. [rad/s, rad/s²]
    tracking_error : float, optional
        RMS of the tracking error at most, positive. [rad/s]
    direction : {"both", "positive", "negative"}
        In which directions speed and acceleration are required.

    Raises
    ------
    InputError
        If nothing is required, or a number is not positive.

    Examples
    --------
    >>> from swashplate import analysis
    >>> analysis.Requirements(speed=4.0).given
    {'speed': 4.0}
    """

    speed: float | None = None  # At least. [rad/s]
    acceleration: float | None = None  # At least. [rad/s²]
    tracking_error: float | None = None  # At most, RMS. [rad/s]
    direction: Direction = "both"
    """In which directions speed and acceleration are required."""

    def __post_init__(self) -> None:
        if not self.given:
            raise InputError(
                "Nothing is required: give a speed, an acceleration, a tracking error, or several."
            )
        for name, value in self.given.items():
            if not (np.isfinite(value) and value > 0.0):
                raise InputError(
                    f"The required {name.replace('_', ' ')} is {value:g}, but must be positive."
                )

    @property
    def given(self) -> dict[str, float]:
        """Requirements that are not None, by name, SI."""
        values = {name: getattr(self, name) for name in REQUIRED}
        return {name: value for name, value in values.items() if value is not None}

    def slacks(self, reached: Performance) -> Array:
        """By how much each is met, in the order of `given`: ln of the ratio, negative if not."""
        slacks = []
        for name, required in self.given.items():
            _, sign = REQUIRED[name]
            slacks.append(sign * np.log(max(getattr(reached, name), SMALLEST) / required))
        return np.array(slacks)

    def reached(self, performances: Sequence[Performance]) -> str:
        """Say, as the rest of a sentence, how far the best of some drives come."""
        slacks = np.array([self.slacks(performance) for performance in performances])
        best = slacks.argmax(axis=0)
        missed = [
            self._compared(name, performances[best[k]])
            for k, name in enumerate(self.given)
            if slacks[best[k], k] < 0.0
        ]
        if missed:
            return f"reaches {listed(missed)}"
        nearest = performances[int(slacks.min(axis=1).argmax())]
        numbers = listed([self._compared(name, nearest) for name in self.given])
        return f"meets each requirement, but not all at the same time: nearest is {numbers}"

    def _compared(self, name: str, performance: Performance) -> str:
        """A number that was reached, with the required one."""
        unit, _ = REQUIRED[name]
        number = quantity(getattr(performance, name), unit, spec=".4g")
        required = quantity(self.given[name], unit, spec=".4g")
        return f"{name.replace('_', ' ')} {number} (required {required})"


@dataclass(frozen=True, eq=False)
class Sizing(Result):
    """The smallest change that meets the requirements."""

    requirements: Requirements
    factors: Mapping[str, float]
    """By design variable; 1 leaves it as it is."""
    drive: Drive
    """The changed drive."""
    before: Performance
    after: Performance
    sufficient_factors: Mapping[str, float | None]
    """By design variable the factor that suffices if only this one changes; None if none does."""

    @property
    def change(self) -> float:
        """Root of the summed squares of (factor - 1). [1]"""
        return float(np.sqrt(_change(np.array([*self.factors.values()]))))

    def tables(self) -> tuple[Table, Table]:
        """A table of the factors, and one of the requirements with the values before and after."""
        factors = Table(
            "",
            (
                Column("design variable"),
                Column("factor", ".4f"),
                Column("change", "+z.2%"),
                Column("enough alone", ".4f", none="no"),
            ),
        )
        for name, factor in self.factors.items():
            factors.add(name, factor, factor - 1.0, self.sufficient_factors[name])
        columns = (Column(heading, ".2f") for heading in ("required", "as it is", "changed"))
        requirements = Table("", (Column(""), *columns, UNIT))
        for name, (unit, sign) in REQUIRED.items():
            before = getattr(self.before, name)
            if before is None:
                continue
            required = getattr(self.requirements, name)
            limit = None
            if required is not None:
                relation = ">=" if sign > 0.0 else "<="
                limit = Cell(required, f"{relation} {display_unit(unit).factor * required:.2f}")
            after = getattr(self.after, name)
            requirements.add(name.replace("_", " "), limit, before, after, unit=unit)
        return factors, requirements


DEFAULT_RANGE: FactorRange = (0.5, 2.0)
"""Factors that a design variable may take unless others are given. [1]"""


def size(
    drive: Drive,
    requirements: Requirements,
    ranges: Mapping[str, FactorRange],
    *,
    follow: Trial | None = None,
) -> Sizing:
    """Find the smallest change of the design variables that meets the requirements.

    Parameters
    ----------
    drive : Drive
        As it is.
    requirements : Requirements
        What it shall do.
    ranges : mapping of str to (float, float)
        The design variables that may change, with the lowest and highest factor; 1 lies between.
        [1]
    follow : Trial, optional
        Whose reference speed is to be followed, needed for a required tracking error.

    Returns
    -------
    Sizing
        The factors, the drive that has them, and what it does before and after.

    Raises
    ------
    InputError
        If the requirements cannot be met: the sentence says what can be reached. Or for an unknown
        design variable, a range without 1, or a tracking error without a speed to follow.

    Notes
    -----
    Smallest means the least Σ (factor - 1)².

    Examples
    --------
    >>> from swashplate import Drive, analysis
    >>> hoist = Drive.preset("hoist")
    >>> found = analysis.size(hoist, analysis.Requirements(speed=4.0), {"pump": (0.5, 2.0)})
    >>> round(found.factors["pump"], 2)
    1.24
    """
    if requirements.tracking_error is not None and follow is None:
        raise InputError("A required tracking error needs a reference speed.")
    check_ranges(ranges, around=1.0)
    names = list(ranges)
    low, high = np.array(list(ranges.values()), dtype=np.float64).T
    tried: dict[tuple[float, ...], Performance | None] = {}

    def performance_at(point: Array) -> Performance | None:
        key = tuple(point.tolist())
        if key not in tried:
            try:
                changed = with_factors(drive, dict(zip(names, key, strict=True)))
                tried[key] = performance(changed, follow, direction=requirements.direction)
            except (ParameterError, DomainError):
                tried[key] = None
        return tried[key]

    def slack(point: Array) -> Array:
        reached = performance_at(point)
        if reached is None:
            return np.full(len(requirements.given), WORSE_THAN_ANY)
        return requirements.slacks(reached)

    before = performance(drive, follow, direction=requirements.direction)
    point = smallest_change(slack, low, high)
    after = None if point is None else performance_at(point)
    if point is None or after is None:
        searched = ", ".join(
            f"{name} x {low:g} to {high:g}" for name, (low, high) in ranges.items()
        )
        simulated = [reached for reached in tried.values() if reached is not None]
        raise InputError(f"Within {searched} the {drive.name} {requirements.reached(simulated)}.")
    factors = dict(zip(names, point.tolist(), strict=True))
    sufficient = {name: smallest_single(slack, low, high, k) for k, name in enumerate(names)}
    return Sizing(
        requirements=requirements,
        factors=factors,
        drive=with_factors(drive, factors),
        before=before,
        after=after,
        sufficient_factors=sufficient,
    )


# --- search ---------------------------------------------------------------------------------------

Slack = Callable[[Array], Array]
"""From (L,) factors to (r,) slacks, all 0 or more if the factors satisfy."""
WORSE_THAN_ANY = -1e3
"""Slack of what cannot be simulated: below that of any drive that can. [1]"""
SCANNED = 6
"""log₂ of the points of a Sobol sequence that are tried."""
FINEST = 1e-9
"""Share of the way to which an end is bisected. [1]"""
ALONG = 32
"""Points along the range of a single factor."""


def smallest_change(slack: Slack, low: Array, high: Array) -> Array | None:
    """Factors with the least Σ (factor - 1)² of those that satisfy, None if none was found.

    Each is between its `low` and `high`, (L,) both, with 1 within. They satisfy exactly: the last
    step is a bisection that ends on the right side.

    Notes
    -----
    The box is scanned (single factors, and a Sobol sequence with faces and corners); from the two
    best points on, SLSQP minimises the change under the inequalities, with derivatives by
    differences; what it finds is drawn towards 1, as a whole and factor by factor, as far as the
    inequalities allow.
    """
    from scipy.optimize import minimize
    from scipy.stats.qmc import Sobol

    unchanged = np.ones(low.size)
    if _is_met(slack, unchanged):
        return unchanged
    # a quarter of the sequence's range lies beyond each side of the box: faces and corners
    # its numbers are read within a callback of C, which would drop what a signal raises
    with as_a_whole():
        scanned = Sobol(low.size, scramble=False).random_base2(SCANNED)
    inner = np.clip(2.0 * scanned - 0.5, 0.0, 1.0)
    points = [low, high, *(low + inner * (high - low))]
    for k in range(low.size):
        factor = smallest_single(slack, low, high, k)
        if factor is not None:
            points.append(_with(unchanged, k, factor))

    def drawn_in(point: Array) -> Array:
        drawn = _edge(slack, unchanged, point)
        for k in range(point.size):
            drawn = _edge(slack, _with(drawn, k, 1.0), drawn)
        return drawn

    satisfying = sorted((point for point in points if _is_met(slack, point)), key=_change)
    starts = [drawn_in(point) for point in satisfying[:2]]
    solutions = list(starts)
    for start in starts:
        solved = minimize(
            _change,
            start,
            jac=lambda x: 2.0 * (x - 1.0),
            method="SLSQP",
            bounds=list(zip(low, high, strict=True)),
            constraints={"type": "ineq", "fun": lambda x: slack(np.clip(x, low, high))},
            options={"maxiter": 60, "ftol": 1e-10, "eps": 1e-5},
        )
        # SLSQP may have stopped on the wrong side: back towards its start
        solutions.append(drawn_in(_edge(slack, np.clip(solved.x, low, high), start)))
    return min(solutions, key=_change, default=None)


def smallest_single(slack: Slack, low: Array, high: Array, index: int) -> float | None:
    """The factor nearest to 1 that satisfies while all others are 1; None if none does."""
    unchanged = np.ones(low.size)
    reached = list[float]()
    for end in (float(low[index]), float(high[index])):
        previous = unchanged
        for factor in np.linspace(1.0, end, ALONG + 1):
            goal = _with(unchanged, index, float(factor))
            if _is_met(slack, goal):
                reached.append(float(_edge(slack, previous, goal)[index]))
                break
            previous = goal
    return min(reached, key=lambda factor: abs(factor - 1.0), default=None)


def _edge(slack: Slack, start: Array, goal: Array) -> Array:
    """First point that satisfies on the way from a start to a goal that does, by bisection."""
    if _is_met(slack, start):
        return start
    low, high = 0.0, 1.0
    while high - low > FINEST:
        middle = 0.5 * (low + high)
        if _is_met(slack, start + middle * (goal - start)):
            high = middle
        else:
            low = middle
    return goal if high == 1.0 else start + high * (goal - start)


def _with(point: Array, index: int, factor: float) -> Array:
    changed = point.copy()
    changed[index] = factor
    return changed


def _is_met(slack: Slack, point: Array) -> bool:
    return bool(slack(point).min() >= 0.0)


def _change(point: Array) -> float:
    return float(np.sum((point - 1.0) ** 2))
