"""Profile likelihood: how far an unknown can move before the others cannot make up for it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import DomainError, InputError
from swashplate.executors import Executor, Serial
from swashplate.identification.drive_model import DriveModel
from swashplate.identification.problem import TOLERANCE, LinearisedFit, Problem
from swashplate.identification.solving import Evaluation, solve
from swashplate.identification.unknowns import Vector
from swashplate.results import Result

if TYPE_CHECKING:
    from swashplate.identification.assessment import Assessment

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Beside:
    """A problem with one of its unknowns fixed, as `solving.Objective` has it."""

    problem: Problem
    index: int
    number: float
    """Of the fixed unknown, in the solver's vector."""
    start: Array
    """(K - 1,)"""

    @property
    def bounds(self) -> tuple[Array, Array]:
        low, high = self.problem.bounds
        return np.delete(low, self.index), np.delete(high, self.index)

    def evaluate(self, vector: Array, *, compressed: bool = True) -> Evaluation:
        whole = self.problem.evaluate(self.whole(vector), compressed=compressed)
        return Evaluation(whole.residuals, np.delete(whole.jacobian, self.index, axis=1))

    def cost(self, vector: Array) -> float:
        return self.problem.cost(self.whole(vector))

    def whole(self, vector: Array) -> Array:
        return np.insert(vector, self.index, self.number)


def minimiser(
    problem: Problem, *, tolerance: float = 1e-8, max_evaluations: int = 60
) -> Callable[[int, float, Array], tuple[float, Array]]:
    """What `profile` asks for: the least cost with one unknown fixed."""

    def minimise(index: int, number: float, start: Array) -> tuple[float, Array]:
        low, high = problem.bounds
        others = np.delete(np.clip(start, low, high), index)
        if not others.size:
            vector = np.array([number])
            return problem.cost(vector), vector
        beside = _Beside(problem, index, number, others)
        found = solve(beside, tolerance=tolerance, max_evaluations=max_evaluations)
        return found.cost, beside.whole(found.vector)

    return minimise


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

FURTHEST = 300.0
"""Largest distance looked at, in first steps."""

HALVINGS = 6
"""How often a step is halved at the edge of the model's domain."""


class Point(NamedTuple):
    """One point of a profile."""

    number: float
    """Of the unknown, in the solver's vector."""
    cost: float
    vector: Vector


@dataclass(eq=False)
class ProfileSide(Result):
    """One side of a profile, outwards."""

    minimise: Minimise
    optimum: Point
    index: int
    rise: float
    """Of the cost, at which the side ends."""
    direction: float
    """1 upwards, -1 downwards."""
    step: float
    """Of about one standard error."""
    bound: float
    most: int
    """Largest number of points."""
    points: list[Point] = field(default_factory=list)
    end: float | None = None
    better: Point | None = None

    def march(self) -> Ending:
        """Outwards until the cost has risen enough, or something else ends the side."""
        # roots of the rise over the threshold's, by distance: nearly a straight line
        path = [(0.0, 0.0)]
        stride, halvings = STRIDE * self.step, 0
        while len(self.points) < self.most:
            distance = min(path[-1][0] + stride, abs(self.bound - self.optimum.number))
            if distance <= path[-1][0]:
                return "bound"
            if distance > FURTHEST * self.step:
                return "open"
            point = self._at(distance)
            if point is None:
                if halvings == HALVINGS:
                    return "domain"
                halvings, stride = halvings + 1, 0.5 * stride
                continue
            if self._improves(point):
                return "better optimum"
            self.points.append(point)
            height = self._height(point)
            if height >= 1.0:
                return self._crossing(path[-1], (distance, height))
            gained = max(height - path[-1][1], 0.1 * STRIDE)
            path.append((distance, height))
            # slowly, so that the next start is good and a flat stretch is not leapt over
            stride *= float(np.clip(STRIDE / gained, 0.3, 2.5))
        return "open"

    def _crossing(self, inside: tuple[float, float], outside: tuple[float, float]) -> Ending:
        """Find where the cost has risen just enough, by false position (Illinois) in the root."""
        (near, low), (far, high) = inside, outside
        low, high = low - 1.0, high - 1.0
        distance = far
        for _ in range(12):
            if abs(high) <= CLOSE:
                distance = far
                break
            distance = far - high * (far - near) / (high - low)
            point = self._at(distance)
            if point is None:
                break
            if self._improves(point):
                return "better optimum"
            self.points.append(point)
            self.points.sort(key=lambda each: abs(each.number - self.optimum.number))
            value = self._height(point) - 1.0
            if abs(value) <= CLOSE:
                break
            if value * high < 0.0:
                near, low = far, high
            else:
                low *= 0.5
            far, high = distance, value
        self.end = self.optimum.number + self.direction * distance
        return "crossed"

    def _at(self, distance: float) -> Point | None:
        """The least cost at a distance from the optimum; None outside the model's domain."""
        number = self.optimum.number + self.direction * distance
        known = (self.optimum, *self.points)
        start = min(known, key=lambda point: abs(point.number - number)).vector.copy()
        start[self.index] = number
        try:
            cost, vector = self.minimise(self.index, number, start)
        except DomainError:
            return None
        return Point(number, float(cost), vector) if np.isfinite(cost) else None

    def _improves(self, point: Point) -> bool:
        better = point.cost < self.optimum.cost - BETTER * self.rise
        if better:
            self.better = point
        return better

    def _height(self, point: Point) -> float:
        return float(np.sqrt(max(point.cost - self.optimum.cost, 0.0) / self.rise))


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

    def sentences(self, name: str) -> tuple[str, ...]:
        """What stands in the way of an interval, if anything does."""
        if self.better is not None:
            return (
                f"The profile of {name} met a better optimum, cost {self.better.cost:.6g} against "
                f"{self.cost:.6g}: fit again from there.",
            )
        reasons: dict[Ending, str] = {
            "bound": "reaches its bound before the cost rises enough",
            "open": "reaches the end of the search before the cost rises enough",
            "domain": "reaches the edge of the model's domain before the cost rises enough",
        }
        return tuple(
            f"{name} {reasons[ending]} on its {side} side: no end of the interval there."
            for side, ending in zip(("lower", "upper"), self.endings, strict=True)
            if ending in reasons
        )


def threshold(
    cost: float,
    samples: int,
    unknowns: int,
    *,
    inflation: float = 1.0,
    freedom: float | None = None,
    level: float = 0.95,
) -> float:
    """Rise of the cost (half the sum of squares) that ends an interval, for coloured residuals.

    Parameters
    ----------
    cost : float
        At the optimum.
    samples, unknowns : int
        Numbers of samples and of combinations determined.
    inflation : float
        Samples that stand for one independent one, at least 1: the ratio of the unknown's variance
        under coloured noise to that under white noise.
    freedom : float, optional
        Degrees of freedom of Student's quantile; by default samples/inflation - unknowns.
    level : float
        Probability of the interval.

    Raises
    ------
    InputError
        If nothing is left to tell the noise from, or inflation or level are out of range.

    Notes
    -----
    ½ q² s² times the inflation, s² = 2 cost/(n - K) and q Student's quantile: on a linear model
    exactly the estimate ± q standard errors.
    """
    if not 0.0 < level < 1.0:
        raise InputError(f"The level {level:g} of a profile must lie between 0 and 1.")
    if not inflation >= 1.0 or not np.isfinite(inflation):
        raise InputError(f"{inflation:g} samples cannot stand for one; 1 is the least.")
    if samples <= unknowns:
        raise InputError(f"{samples} samples for {unknowns} parameters do not determine the noise.")
    if freedom is None:
        freedom = samples / inflation - unknowns
    if not freedom > 0.0:
        raise InputError(
            f"{samples} samples count as {samples / inflation:.1f} independent ones, no more than "
            f"the {unknowns} parameters: no interval follows from them."
        )
    from scipy.special import stdtrit

    quantile = float(stdtrit(freedom, 0.5 + 0.5 * level))
    return quantile**2 * inflation * cost / (samples - unknowns)


def profile(
    minimise: Minimise,
    vector: Array,
    cost: float,
    index: int,
    rise: float,
    step: float,
    bounds: tuple[float, float] = (-np.inf, np.inf),
    *,
    most: int = 40,
) -> Profile:
    """Profile of one unknown: outwards from the optimum both ways, each point from the last.

    Parameters
    ----------
    minimise : callable
        See `Minimise`. It may raise DomainError where the model does not hold.
    vector, cost :
        The optimum (K,), and its half sum of squares.
    index : int
        Number of the unknown.
    rise : float
        Of the cost at which the interval ends, see `threshold`.
    step : float
        About one standard error of the unknown's number, positive: how far the first step goes.
    bounds : (float, float)
        Of the unknown's number.
    most : int
        Largest number of points a side.

    Raises
    ------
    InputError
        If the step or the rise is not positive, or the optimum lies outside the bounds.
    """
    if not (step > 0.0 and np.isfinite(step)):
        raise InputError(f"The first step of a profile, {step:g}, must be positive and finite.")
    if not rise > 0.0:
        raise InputError(
            "The residuals are exactly zero: there is no noise that a profile could weigh against."
        )
    if not bounds[0] <= vector[index] <= bounds[1]:
        raise InputError("The optimum of a profile lies outside the bounds of its parameter.")
    optimum = Point(float(vector[index]), cost, vector)
    sides = [
        ProfileSide(minimise, optimum, index, rise, direction, step, bound, most)
        for direction, bound in ((-1.0, bounds[0]), (1.0, bounds[1]))
    ]
    endings: list[Ending] = []
    for side in sides:
        endings.append(side.march())
        if side.better is not None:
            break
    endings += ["open"] * (2 - len(endings))
    points = (*reversed(sides[0].points), optimum, *sides[1].points)
    better = next((side.better for side in sides if side.better is not None), None)
    return Profile(
        index,
        cost,
        points,
        rise,
        sides[0].end if better is None else None,
        sides[1].end if better is None else None,
        (endings[0], endings[1]),
        better,
    )


SWITCHING = ("V_dz", "J_", "lim", "I_t", "Z13", "Z14", "Z15", "Z16", "Z17")
"""What the names of a drive's parameters begin with at which its equations switch."""
STRAIGHT = 0.02
"""Half width, in the solver's vector, up to which the drive is linear in all others."""
SHALLOW = 0.25
"""Part of the linearised rise of the cost below which an interval's end is looked for anew."""
MOST_POINTS = 8
"""Most points of the profile on such a side."""
LEAST_STEP = 1e-3
"""First step of that profile, in parts of the bounds: where the derivative is that of a switch that
one sample just passes, the linearised interval is next to nothing."""
TRIES, LOOK = 20, 4
"""Evaluations of a fit without a limit, and after how many it is seen whether it gets there."""
HOPELESS = 100.0
"""Rise of the cost, in that of the threshold, that a first linear step without a limit may leave.
In 48 such fits of hoist, luff and slew it left 200 or more in 47, where the limit was needed, and
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
) -> tuple[CheckedEnd, ...]:
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

    A level that a drive keeps may be a stop, or the balance of its forces: two optima far apart. So
    each limit is also put out of the way, at its upper bound, and all else fitted again; if that
    costs less than the interval's end would, the data do not need the limit, and it has no upper
    end.
    """
    inverse = linearised.whitening @ linearised.whitening.T
    low, high = problem.bounds
    cost = problem.cost(vector)
    found = []
    machine = np.array([each.run is None for each in problem.unknowns])
    drive = isinstance(problem.model, DriveModel)
    bends = np.array([_bends(each.targets[0]) or not drive for each in problem.unknowns])
    looked = machine & ((bends & (reach > 0.0)) | (reach > STRAIGHT))
    for index in np.flatnonzero(looked):
        direction = inverse[index] / inverse[index, index]
        rise = 0.5 * reach[index] ** 2 / inverse[index, index]
        if index in limits and _unneeded(problem, vector, int(index), cost, rise):
            found.append(CheckedEnd(int(index), True, np.inf))
            continue
        for sign in (-1.0, 1.0):
            end = np.clip(vector + sign * reach[index] * direction, low, high)
            try:
                risen = problem.cost(end) - cost
            except DomainError:
                continue  # beyond the model's domain nothing is possible
            if risen >= SHALLOW * rise:
                continue
            bound = float(high[index] if sign > 0.0 else low[index])
            side = ProfileSide(
                minimiser(problem, tolerance=1e-6, max_evaluations=TRIES),
                Point(float(vector[index]), cost, vector),
                int(index),
                rise,
                sign,
                max(float(reach[index]), LEAST_STEP * float(high[index] - low[index])),
                bound,
                MOST_POINTS,
            )
            side.march()
            distance = np.inf if side.end is None else abs(side.end - float(vector[index]))
            better = side.better.cost if side.better is not None else None
            found.append(CheckedEnd(int(index), sign > 0.0, float(distance), better))
    return tuple(found)


def _bends(name: str) -> bool:
    """Whether a drive's parameter is one at which its equations switch."""
    return name.startswith(SWITCHING)


def _unneeded(problem: Problem, vector: Array, index: int, cost: float, rise: float) -> bool:
    """Whether a fit with a limit out of the way is as good.

    It is given up where a first linear step leaves far too much. Then it is followed for a few
    evaluations at a time, until the cost falls so slowly that the tries left would not do.
    """
    start = vector.copy()
    start[index] = problem.bounds[1][index]
    beside = _Beside(problem, index, float(start[index]), np.delete(start, index))
    minimise = minimiser(problem, tolerance=1e-6, max_evaluations=LOOK)
    try:
        residuals, jacobian = beside.evaluate(beside.start)
    except DomainError:
        return False
    step = np.linalg.lstsq(jacobian, residuals, rcond=TOLERANCE)[0]
    left = 0.5 * float(np.sum((residuals - jacobian @ step) ** 2))
    if left - cost > HOPELESS * rise:
        return False
    before, allowed = 0.5 * float(residuals @ residuals), cost + rise
    for tried in range(LOOK, TRIES + 1, LOOK):
        try:
            now, start = minimise(index, float(start[index]), start)
        except DomainError:
            return False
        if now < allowed:
            return True
        if (before - now) * (TRIES - tried) / LOOK < now - allowed:
            return False
        before = now
    return False


class _Sideways(NamedTuple):
    """What a worker needs to follow a profile."""

    problem: Problem
    vector: Array
    cost: float
    rises: dict[int, float]
    steps: Array


def profiles_of(
    assessment: Assessment,
    names: Sequence[str] | None = None,
    *,
    executor: Executor | None = None,
    watch: Callable[[int], None] | None = None,
) -> dict[str, Profile]:
    """Profile likelihoods of a stage's unknowns.

    Parameters
    ----------
    assessment : Assessment
        Of the stage.
    names : sequence of str, optional
        Which unknowns; by default all of the machine that have an interval.
    executor, watch :
        Where they are followed, here by default; told how many are done.

    Returns
    -------
    dict of str to Profile
        In the order of the unknowns. What earlier stages do not know is not in them.

    Raises
    ------
    InputError
        For a name that is none of the stage's unknowns.
    """
    problem, found, fit = assessment.stage.problem, assessment.uncertainty, assessment.linearised
    variables, vector = found.own.variables, assessment.stage.solution.vector
    if names is None:
        known = zip(problem.unknowns, found.own.determined, strict=True)
        chosen = [k for k, (each, told) in enumerate(known) if each.run is None and told]
    else:
        chosen = sorted({variables.index(name) for name in names})
    cost = problem.cost(vector)
    rises = {
        k: threshold(
            cost,
            fit.samples,
            fit.rank,
            inflation=float(found.inflation[k]),
            freedom=float(found.own.degrees_of_freedom[k]),
            level=found.level,
        )
        for k in chosen
    }
    steps = found.own.standard_errors
    shared = _Sideways(replace(problem, threads=1), vector, cost, rises, steps)
    made: dict[str, Profile] = {}
    for position, each in (executor or Serial()).run(_profiled, shared, chosen):
        made[variables.names[chosen[position]]] = each
        if watch is not None:
            watch(len(made))
    return {variables.names[k]: made[variables.names[k]] for k in chosen}


def _profiled(shared: _Sideways, index: int) -> Profile:
    low, high = (float(each[index]) for each in shared.problem.bounds)
    step = float(shared.steps[index])
    if not (np.isfinite(step) and step > 0.0):
        step = 0.01 * (high - low)
    least, rise = minimiser(shared.problem), shared.rises[index]
    return profile(least, shared.vector, shared.cost, index, rise, step, (low, high))
