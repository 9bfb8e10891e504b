"""Where an interval ends: along one unknown, the others fitted, until the cost has risen enough."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import DomainError
from swashplate.identification.estimation.drive_model import DriveModel
from swashplate.identification.estimation.problem import TOLERANCE, LinearisedFit, Problem
from swashplate.identification.estimation.solving import solve
from swashplate.identification.estimation.unknowns import Vector

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
BETTER = 0.3
"""Part of the threshold by which a cost must lie below the optimum's to be a better optimum: a
search ends a little above it, and ends are counted from the least cost that was met."""
CLOSE = 1e-3
"""Relative error in the root of the cost's rise at which a crossing counts as found."""
CLOSE_ENOUGH = 0.03
"""The same of an interval's end that is looked for again: of its half width."""
SETTLED = 0.03
"""Part of the cost's rise to a threshold by which the others, fitted, need not fall any further."""
FURTHEST, MOST, HALVINGS = 1000.0, 40, 6
"""Largest distance looked at, in first ones; most points a side; and how often a step is halved at
the edge of the model's domain."""


class Point(NamedTuple):
    """One point of a profile."""

    number: float
    """Of the unknown, in the solver's vector."""
    cost: float
    vector: Vector


class ProfileSide(NamedTuple):
    """One side of an optimum, along one unknown."""

    points: list[Point]
    ending: Ending
    end: float | None = None
    better: Point | None = None


class _BetterOptimumError(Exception):
    """A point that costs less than the optimum."""


def side_of(
    minimise: Minimise,
    optimum: Point,
    index: int,
    rise: float,
    step: float,
    bound: float,
) -> ProfileSide:
    """Outwards until the cost has risen enough, or something else ends the side.

    `step` is that of about one standard error, negative downwards.
    """
    walk = _Walk(minimise, optimum, index, rise, float(np.sign(step)))
    return walk.side(STRIDE * abs(step), bound, MOST)


def end_of(
    minimise: Minimise,
    optimum: Point,
    index: int,
    rise: float,
    step: float,
    bound: float,
    others: Array,
) -> ProfileSide:
    """The same for an end alone: to `CLOSE_ENOUGH`, the first point a whole step away.

    `others` (K,) are changes of the vector for one of the unknown's number, as linear theory has
    them: each search begins there.
    """
    walk = _Walk(minimise, optimum, index, rise, float(np.sign(step)), CLOSE_ENOUGH, others)
    return walk.side(abs(step), bound, MOST_POINTS)


@dataclass(frozen=True, eq=False)
class _Walk:
    """Points of a profile on one side of an optimum."""

    minimise: Minimise
    optimum: Point
    index: int
    rise: float
    """Rise of the cost at which the side ends."""
    sign: float
    """1 upwards, -1 downwards."""
    close: float = CLOSE
    """See `CLOSE`."""
    others: Array | None = None
    """See `end_of`; none if the others begin where they were at the nearest point."""
    points: list[Point] = field(default_factory=list)

    def side(self, stride: float, bound: float, most: int) -> ProfileSide:
        """The side, from a first distance on."""
        try:
            ending, distance = self.outwards(stride, abs(bound - self.optimum.number), most)
        except _BetterOptimumError as error:
            return ProfileSide(self.points, "better optimum", better=error.args[0])
        end = None if distance is None else self.optimum.number + self.sign * distance
        return ProfileSide(self.points, ending, end)

    def height(self, distance: float) -> float | None:
        """Root of the least cost's rise over the threshold's; None outside the model's domain.

        It is nearly a straight line.
        """
        number = self.optimum.number + self.sign * distance
        near = min((self.optimum, *self.points), key=lambda point: abs(point.number - number))
        start = near.vector.copy()
        if self.others is not None:
            start += (number - near.number) * self.others
        start[self.index] = number
        try:
            cost, vector = self.minimise(self.index, number, start)
        except DomainError:
            return None
        if not np.isfinite(cost):
            return None
        if cost < self.optimum.cost - BETTER * self.rise:
            raise _BetterOptimumError(Point(number, float(cost), vector))
        self.points.append(Point(number, float(cost), vector))
        least = min(self.optimum.cost, *(point.cost for point in self.points))
        return float(np.sqrt(max(cost - least, 0.0) / self.rise))

    def outwards(self, stride: float, reach: float, most: int) -> tuple[Ending, float | None]:
        """Ending of the side, and how far from the optimum the cost has risen just enough."""
        near = low = 0.0
        furthest = FURTHEST * stride
        halvings = 0
        while len(self.points) < most:
            distance = min(near + stride, reach)
            if distance <= near:
                return "bound", None
            if distance > furthest:
                break
            height = self.height(distance)
            if height is None:
                if halvings == HALVINGS:
                    return "domain", None
                halvings += 1
                stride *= 0.5
                continue
            if height >= 1.0:
                return "crossed", _crossing(self.height, near, low, distance, height, self.close)
            # slowly, so that the next start is good and a flat stretch is not leapt over
            stride *= float(np.clip(STRIDE / max(height - low, 0.1 * STRIDE), 0.3, 2.5))
            near, low = distance, height
        return "open", None


def _crossing(
    height: Callable[[float], float | None],
    near: float,
    low: float,
    far: float,
    high: float,
    close: float,
) -> float:
    """Distance of height 1 between two, by false position (Illinois)."""
    low, high = low - 1.0, high - 1.0
    distance = far
    for _ in range(12):
        # where the cost jumps over the threshold, no height is close: the jump is the end
        at_a_jump = abs(far - near) <= close**2 * far
        if abs(high) <= close or at_a_jump:
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
    """The least cost of a problem with one unknown fixed."""

    def minimise(index: int, number: float, start: Array) -> tuple[float, Array]:
        if start.size == 1:
            return problem.cost(start), start
        solution = solve(
            problem,
            start,
            fixed={index: number},
            tolerance=tolerance,
            max_evaluations=max_evaluations,
        )
        return solution.cost, solution.vector

    return minimise


# --- where derivatives mislead --------------------------------------------------------------------

SWITCHING = ("V_dz", "J_", "lim", "I_t", "Z13", "Z14", "Z15", "Z16", "Z17")
"""What the names of a drive's parameters begin with at which its equations switch."""
STRAIGHT = 0.02
"""Half width, in the solver's vector, up to which the drive is linear in all others."""
SHALLOW = 0.25
"""Part of the linearised rise of the cost below which an interval's end is looked for again."""
STEEP = 10.0
"""How many times the linearised rise the cost must rise for a limit's end to be looked for nearer:
one that is just not reached has no derivative, though it cannot be lower."""
ALONE = 1e-3
"""Largest change of the other numbers that goes with a limit which moves nothing. [1]"""
LEAST_PART = 1e-4
"""Part of the linearised half width that such an end is at least away."""
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

    A limit that a drive just does not reach has no derivative at all, and the linearised interval
    is that of what was known beforehand, whatever the others are; but it cannot be lower. Where its
    end costs ten times as much as it should, the place where it costs what it should is taken.

    So it is where an end lies beyond a bound at which the cost has risen by more than it should: an
    unknown that next to nothing moves here may well be told farther off.

    And so it is where two thresholds make up for each other only at first: a dead zone that grows
    with a jump at its edge moves the drive over as much of the command as it has grown, and so by
    its square. The derivative leaves both as they were known beforehand. The cost says more.

    A level that a drive keeps may be a stop, or the balance of its forces: two optima far apart. So
    each limit is also put out of the way, at its upper bound, and all else fitted again; if that
    costs less than the interval's end would, the data do not need the limit, and it has no upper
    end.
    """
    inverse = linearised.whitening @ linearised.whitening.T
    low, high = problem.bounds
    cost = problem.cost(vector)
    drive = isinstance(problem.model, DriveModel)
    switches = np.array(
        [
            unknown.run is None and unknown.targets[0].startswith(SWITCHING)
            for unknown in problem.unknowns
        ]
    )
    for index, unknown in enumerate(problem.unknowns):
        if unknown.run is not None:
            continue
        bends = not drive or bool(switches[index])
        if not reach[index] > (0.0 if bends else STRAIGHT):
            continue
        direction = inverse[index] / inverse[index, index]
        rise = 0.5 * reach[index] ** 2 / inverse[index, index]
        # thresholds that move together farther than is known of either beforehand
        together = switches & (reach[index] * np.abs(direction) > problem.unknowns.prior_widths)
        made_up_for = drive and bool(together[index]) and np.count_nonzero(together) > 1
        alone = index in limits and np.abs(np.delete(direction, index)).max(initial=0.0) < ALONE
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
            shallow, first = risen < SHALLOW * rise, float(reach[index])
            steep = risen > STEEP * rise and (alone or made_up_for)
            if steep:
                along = sign * reach[index] * direction
                first *= _part_within(problem, vector, along, cost + rise)
                if alone:
                    yield CheckedEnd(index, sign > 0.0, first)
                    continue
            if not (shallow or steep or (risen > rise and first > room > 0.0)):
                continue
            optimum = Point(float(vector[index]), cost, vector)
            least = LEAST_STEP * float(high[index] - low[index])
            step = sign * max(min(first, room), least)
            tolerance = float(np.clip(SETTLED * rise / cost, 1e-8, 1e-4)) if cost > 0.0 else 1e-6
            minimise = minimiser(problem, tolerance=tolerance, max_evaluations=TRIES)
            side = end_of(minimise, optimum, index, rise, step, float(bound), direction)
            distance = np.inf if side.end is None else abs(side.end - optimum.number)
            better = None if side.better is None else side.better.cost
            if not shallow and side.end is None:  # the linearised end holds
                if better is None:
                    continue  # as the others make up for this one
                distance = float(reach[index])
            yield CheckedEnd(index, sign > 0.0, float(distance), better)


def _part_within(problem: Problem, vector: Array, change: Array, most: float) -> float:
    """Part of a change up to which the cost stays within a limit, to a factor of 1.1 or so."""
    low, high = problem.bounds
    inside, outside = LEAST_PART, 1.0
    while outside > 1.1 * inside:
        middle = float(np.sqrt(inside * outside))
        try:
            within = problem.cost(np.clip(vector + middle * change, low, high)) <= most
        except DomainError:
            within = False
        inside, outside = (middle, outside) if within else (inside, middle)
    return outside


def _unneeded(problem: Problem, vector: Array, index: int, cost: float, rise: float) -> bool:
    """Whether a fit with a limit out of the way is as good.

    It is given up if a first linear step leaves far too much. Then it is followed for a few
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
        limited_cost = 0.5 * float(residuals @ residuals)
        for tried in range(LOOK, TRIES + 1, LOOK):
            now, start = minimise(index, float(start[index]), start)
            over = now - cost - rise
            if over < 0.0:
                return True
            if (limited_cost - now) * (TRIES - tried) / LOOK < over:
                return False
            limited_cost = now
    except DomainError:
        pass
    return False
