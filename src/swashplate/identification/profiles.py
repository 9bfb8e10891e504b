"""Profile likelihood: how far an unknown can move before the others cannot make up for it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import DomainError, InputError
from swashplate.executors import Executor, Serial
from swashplate.identification.drive_model import DriveModel
from swashplate.identification.problem import TOLERANCE, LinearisedFit, Problem
from swashplate.identification.solving import solve
from swashplate.identification.unknowns import Unknown, Vector
from swashplate.progress import counted
from swashplate.results import Result
from swashplate.tables import UNIT, Column, Table

if TYPE_CHECKING:
    from swashplate.identification.fitting import StageFit

Array = NDArray[np.float64]

Minimise = Callable[[int, float, Array], tuple[float, Array]]
"""Number of the unknown that is fixed, its number in the vector, and a (K,) start to the least cost
of all vectors that have it there, and the vector; cost is half the sum of squares."""

Ending = Literal["crossed", "bound", "open", "domain", "better optimum"]
"""How a side ended: beyond the threshold, at the bound below it, below it as far as was looked,
where the model no longer holds, or at a cost below the optimum's."""

STRIDE = 0.35
"""Step aimed at, in the square root of the cost's rise over that of the threshold: three points
a side on a parabola."""
BETTER = 0.02
"""Part of the threshold by which a cost must lie below the optimum's to be a better optimum: a
smaller difference moves the ends of an interval by less than 1 % of their distance."""
CLOSE = 1e-3
"""Relative error in the root of the cost's rise at which a crossing counts as found."""
FURTHEST, MOST, HALVINGS = 300.0, 40, 6
"""Largest distance looked at, in first steps; most points a side; and how often a step is halved at
the edge of the model's domain."""


class Point(NamedTuple):
    """One point of a profile."""

    number: float
    """Of the unknown, in the solver's vector."""
    cost: float
    vector: Vector


@dataclass(frozen=True, eq=False)
class Profile(Result):
    """Least cost as a function of one unknown."""

    index: int
    cost: float
    """Of the optimum that it starts from."""
    points: tuple[Point, ...]
    """In order of the unknown, the optimum among them."""
    rise: float
    """Of the cost, up to which a value is within the interval."""
    lower: float | None
    """End of the interval, in the solver's vector; None where there is none on that side."""
    upper: float | None
    endings: tuple[Ending, Ending]
    """Of the lower and the upper side."""
    better: Point | None
    """A better optimum that was met; the profile stopped there and its ends mean nothing."""
    name: str = ""
    """The unknown's."""
    stage: str = ""
    """That of the unknown."""
    unknown: Unknown | None = None
    """By which its numbers are values; None if only the solver's numbers are given."""

    def tables(self) -> list[Table]:
        """The points: value, and rise of the cost over that at an interval's end."""
        if self.unknown is None:
            return []
        columns = (Column(self.name, ".5g"), UNIT, Column("rise of the cost", ".2f", "1"))
        made = Table(
            f"Profile likelihood of {self.name}, stage {self.stage}",
            columns,
            "A rise of 1 ends the 95 % interval.",
            si=True,
        )
        for point in self.points:
            rise = (point.cost - self.cost) / self.rise
            made.add(self.unknown.to_value(point.number), rise, unit=self.unknown.unit)
        return [made]

    def sentences(self) -> tuple[str, ...]:
        """What stands in the way of an interval, if anything does."""
        if self.better is not None:
            return (
                f"The profile of {self.name} met a better optimum, cost {self.better.cost:.6g} "
                f"against {self.cost:.6g}: fit again with --starts 20 (in Python search = "
                "Search(20)).",
            )
        reasons: dict[Ending, str] = {
            "bound": "its bound",
            "open": "the end of the search",
            "domain": "the edge of the model's domain",
        }
        return tuple(
            f"{self.name} reaches {reasons[ending]} before the cost rises enough on its {side} "
            "side: no end of the interval there."
            for side, ending in zip(("lower", "upper"), self.endings, strict=True)
            if ending in reasons
        )


def profile(
    minimise: Minimise,
    vector: Array,
    cost: float,
    index: int,
    rise: float,
    step: float,
    bounds: tuple[float, float] = (-np.inf, np.inf),
) -> Profile:
    """Profile of one unknown: outwards from the optimum both ways, each point from the last.

    The optimum is a vector (K,) with its half sum of squares; the interval ends where that has
    risen by `rise`, or an `InputError` says that this is not positive. `step`, positive, is about
    one standard error of the unknown's number in the vector, `bounds` are those of the number.
    `minimise` may raise DomainError.
    """
    if not rise > 0.0:
        raise InputError(
            "The residuals are exactly zero: there is no noise that a profile could weigh against."
        )
    optimum = Point(float(vector[index]), cost, vector)
    lower = _side(minimise, optimum, index, rise, -step, bounds[0])
    upper = _Side([], "open")
    if lower.better is None:
        upper = _side(minimise, optimum, index, rise, step, bounds[1])
    better = lower.better or upper.better
    points = sorted([*lower.points, optimum, *upper.points], key=lambda point: point.number)
    ends = (lower.end, upper.end) if better is None else (None, None)
    return Profile(index, cost, tuple(points), rise, *ends, (lower.ending, upper.ending), better)


class _Side(NamedTuple):
    """One side of a profile."""

    points: list[Point]
    ending: Ending
    end: float | None = None
    better: Point | None = None


class _BetterOptimumError(Exception):
    """A point that costs less than the optimum."""


def _side(
    minimise: Minimise,
    optimum: Point,
    index: int,
    rise: float,
    step: float,
    bound: float,
    most: int = MOST,
) -> _Side:
    """Outwards until the cost has risen enough, or something else ends the side.

    `step` is that of about one standard error, negative downwards; `most` points are looked at.
    """
    points, sign, step = list[Point](), float(np.sign(step)), abs(step)

    def height(distance: float) -> float | None:
        """Root of the least cost's rise over the threshold's; None outside the model's domain.

        It is nearly a straight line.
        """
        number = optimum.number + sign * distance
        near = min((optimum, *points), key=lambda point: abs(point.number - number))
        start = near.vector.copy()
        start[index] = number
        try:
            cost, vector = minimise(index, number, start)
        except DomainError:
            return None
        if not np.isfinite(cost):
            return None
        if cost < optimum.cost - BETTER * rise:
            raise _BetterOptimumError(Point(number, float(cost), vector))
        points.append(Point(number, float(cost), vector))
        return float(np.sqrt(max(cost - optimum.cost, 0.0) / rise))

    def walked() -> tuple[Ending, float | None]:
        """How the side ended, and how far from the optimum the cost has risen just enough."""
        near, low, stride, halvings = 0.0, 0.0, STRIDE * step, 0
        while len(points) < most:
            distance = min(near + stride, abs(bound - optimum.number))
            if distance <= near:
                return "bound", None
            if distance > FURTHEST * step:
                break
            now = height(distance)
            if now is None:
                if halvings == HALVINGS:
                    return "domain", None
                halvings, stride = halvings + 1, 0.5 * stride
                continue
            if now >= 1.0:
                return "crossed", _crossing(height, near, low, distance, now)
            # slowly, so that the next start is good and a flat stretch is not leapt over
            stride *= float(np.clip(STRIDE / max(now - low, 0.1 * STRIDE), 0.3, 2.5))
            near, low = distance, now
        return "open", None

    try:
        ending, distance = walked()
    except _BetterOptimumError as found:
        return _Side(points, "better optimum", better=found.args[0])
    end = None if distance is None else optimum.number + sign * distance
    return _Side(points, ending, end)


def _crossing(
    height: Callable[[float], float | None], near: float, low: float, far: float, high: float
) -> float:
    """Distance of height 1 between two, by false position (Illinois)."""
    low, high = low - 1.0, high - 1.0
    distance = far
    for _ in range(12):
        if abs(high) <= CLOSE:
            break
        distance = far - high * (far - near) / (high - low)
        now = height(distance)
        if now is None:
            break
        if (now - 1.0) * high < 0.0:
            near, low = far, high
        else:
            low *= 0.5
        far, high = distance, now - 1.0
    return distance


def minimiser(problem: Problem, *, tolerance: float = 1e-8, max_evaluations: int = 60) -> Minimise:
    """What `profile` asks for: the least cost with one unknown fixed."""

    def minimise(index: int, number: float, start: Array) -> tuple[float, Array]:
        if start.size == 1:
            return problem.cost(start), start
        fixed, most = {index: number}, max_evaluations
        found = solve(problem, start, fixed=fixed, tolerance=tolerance, max_evaluations=most)
        return found.cost, found.vector

    return minimise


# --- where derivatives mislead --------------------------------------------------------------------

SWITCHING = ("V_dz", "J_", "lim", "I_t", "Z13", "Z14", "Z15", "Z16", "Z17")
"""What the names of a drive's parameters begin with at which its equations switch."""
STRAIGHT = 0.02
"""Half width, in the solver's vector, up to which the drive is linear in all others."""
SHALLOW = 0.25
"""Part of the linearised rise of the cost below which an interval's end is looked for anew."""
MOST_POINTS = 8
"""Most points of the profile on such a side."""
LEAST_STEP = 1e-3
"""First step of that profile at least, in parts of the bounds: where the derivative is that of a
switch that one sample just passes, the linearised interval is next to nothing."""
TRIES, LOOK = 20, 4
"""Evaluations of a fit without a limit, and after how many it is seen whether it gets there."""
HOPELESS = 100.0
"""Rise of the cost, in that of the threshold, that a first linear step without a limit may leave.
In 48 such fits of hoist, luff and slew it left 250 or more in 47, where the limit was needed, and
0.03 in the one where it was not."""


class CheckedEnd(NamedTuple):
    """One side of an unknown on which the linearised interval does not hold."""

    number: int
    """Of the unknown."""
    upper: bool
    distance: float
    """From the estimate to where the cost has risen enough, in the solver's vector; inf if it never
    does."""
    better: float | None = None
    """A lower cost that was met on the way."""


def checked_ends(
    problem: Problem,
    vector: Array,
    linearised: LinearisedFit,
    reach: Array,
    limits: Collection[int] = (),
) -> Iterator[CheckedEnd]:
    """Sides on which the cost does not rise as the linearised fit says, and how it does.

    Unknowns of single runs, such as a free zero, are passed over: residuals are linear in them; and
    those of a drive with narrow intervals and without a switch, in which it is as good as linear.
    `reach` (K,) is the half width of each interval in the solver's vector, 0 for unknowns without
    one; `limits` are the numbers of the unknowns that limit something, such as a stop.

    Notes
    -----
    A stop that a drive just touches, or a threshold between two samples, has derivatives on one
    side only: the linearised interval is narrow on both. So the cost is taken at both ends, the
    other unknowns moved along as linear theory says. Where it has risen by less than a quarter of
    what it should, the profile is followed on that side, to a true end or to none.

    So it is where an end lies beyond a bound at which the cost has risen by more than it should: an
    unknown that next to nothing moves here may well be told farther off.

    A level that a drive keeps may be a stop, or the balance of its forces: two optima far apart. So
    each limit is also put out of the way, at its upper bound, and all else fitted again; if that
    costs less than the interval's end would, the data do not need the limit, and it has no upper
    end.
    """
    inverse = linearised.whitening @ linearised.whitening.T
    low, high = problem.bounds
    cost = problem.cost(vector)
    drive = isinstance(problem.model, DriveModel)
    minimise = minimiser(problem, tolerance=1e-6, max_evaluations=TRIES)
    for index, unknown in enumerate(problem.unknowns):
        bends = not drive or unknown.targets[0].startswith(SWITCHING)
        if unknown.run is not None or not reach[index] > (0.0 if bends else STRAIGHT):
            continue
        direction = inverse[index] / inverse[index, index]
        rise = 0.5 * reach[index] ** 2 / inverse[index, index]
        if index in limits and _unneeded(problem, vector, index, cost, rise):
            yield CheckedEnd(index, True, np.inf)
            continue
        for sign, bound in ((-1.0, low[index]), (1.0, high[index])):
            end = np.clip(vector + sign * reach[index] * direction, low, high)
            try:
                risen = problem.cost(end) - cost
            except DomainError:
                continue  # beyond the model's domain nothing is possible
            room = abs(float(bound - vector[index]))
            shallow = risen < SHALLOW * rise
            if not (shallow or (risen > rise and reach[index] > room > 0.0)):
                continue
            optimum = Point(float(vector[index]), cost, vector)
            least = LEAST_STEP * float(high[index] - low[index])
            step = sign * max(min(float(reach[index]), room), least)
            side = _side(minimise, optimum, index, rise, step, float(bound), MOST_POINTS)
            distance = np.inf if side.end is None else abs(side.end - optimum.number)
            better = None if side.better is None else side.better.cost
            if not shallow and side.end is None:  # the linearised end holds
                if better is None:
                    continue  # as the others make up for this one
                distance = float(reach[index])
            yield CheckedEnd(index, sign > 0.0, float(distance), better)


def _unneeded(problem: Problem, vector: Array, index: int, cost: float, rise: float) -> bool:
    """Whether a fit with a limit out of the way is as good.

    It is given up where a first linear step leaves far too much. Then it is followed for a few
    evaluations at a time, until the cost falls so slowly that the tries left would not do.
    """
    start, minimise = vector.copy(), minimiser(problem, tolerance=1e-6, max_evaluations=LOOK)
    start[index] = problem.bounds[1][index]
    try:
        residuals, jacobian = problem.evaluate(start)
        jacobian = np.delete(jacobian, index, axis=1)
        step = np.linalg.lstsq(jacobian, residuals, rcond=TOLERANCE)[0]
        left = 0.5 * float(np.sum((residuals - jacobian @ step) ** 2))
        if left - cost > HOPELESS * rise:
            return False
        before = 0.5 * float(residuals @ residuals)
        for tried in range(LOOK, TRIES + 1, LOOK):
            now, start = minimise(index, float(start[index]), start)
            over = now - cost - rise
            if over < 0.0:
                return True
            if (before - now) * (TRIES - tried) / LOOK < over:
                return False
            before = now
    except DomainError:
        pass
    return False


# --- of a stage -----------------------------------------------------------------------------------


def profiles_of(
    stage: StageFit,
    names: Sequence[str] | None = None,
    *,
    executor: Executor | None = None,
    watch: Callable[[int], None] | None = None,
) -> dict[str, Profile]:
    """Profile likelihoods of a stage's unknowns by name, in their order.

    By default of all unknowns of the machine that have an interval; an `InputError` for a name that
    is none of the stage's. What earlier stages do not know is not in them. `watch` is told how many
    are done.

    Notes
    -----
    The cost rises to ½ q² s² f with s² = 2 cost/(n - K), q Student's quantile and f the samples
    that count as one independent sample: on a linear model exactly the estimate ± q standard
    errors.
    """
    problem, found, fit = stage.problem, stage.uncertainty, stage.linearised
    variables, vector = found.own.variables, stage.solution.vector
    if names is None:
        known = zip(problem.unknowns, found.own.determined, strict=True)
        chosen = [k for k, (each, told) in enumerate(known) if each.run is None and told]
    else:
        chosen = sorted({variables.index(name) for name in names})
    cost = problem.cost(vector)
    every = found.own.quantiles**2 * found.inflation * cost / fit.spare_samples
    rises = {k: float(every[k]) for k in chosen}
    shared = replace(problem, threads=1), vector, cost, rises, found.own.standard_errors
    made: dict[str, Profile] = {}
    profiles = (executor or Serial()).run(_profiled, shared, chosen)
    words = f"Profiling {stage.stage.name}"
    for position, each in counted(profiles, len(chosen), "parameters", words):
        name = variables.names[chosen[position]]
        unknown = problem.unknowns.items[chosen[position]]
        made[name] = replace(each, name=name, stage=stage.stage.name, unknown=unknown)
        if watch is not None:
            watch(len(made))
    return {variables.names[k]: made[variables.names[k]] for k in chosen}


def _profiled(shared: tuple[Problem, Array, float, dict[int, float], Array], index: int) -> Profile:
    problem, vector, cost, rises, steps = shared
    low, high = (float(each[index]) for each in problem.bounds)
    step = float(steps[index])
    if not (np.isfinite(step) and step > 0.0):
        step = 0.01 * (high - low)
    return profile(minimiser(problem), vector, cost, index, rises[index], step, (low, high))
