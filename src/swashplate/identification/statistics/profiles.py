"""Profile likelihood: how far an unknown can move before the others cannot make up for it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError
from swashplate.executors import Executor, Serial
from swashplate.identification.estimation.problem import Problem
from swashplate.identification.estimation.unknowns import Unknown
from swashplate.identification.optimum import Optimum
from swashplate.identification.statistics.interval_ends import (
    Ending,
    Minimise,
    Point,
    ProfileSide,
    minimiser,
    side_of,
)
from swashplate.identification.statistics.intervals import uncertainty_of
from swashplate.progress import counted
from swashplate.results import Result
from swashplate.tables import UNIT, Column, Table

Array = NDArray[np.float64]


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
    """End of the interval, in the solver's vector; None if there is none on that side."""
    upper: float | None
    endings: tuple[Ending, Ending]
    """Of the lower and the upper side."""
    better: Point | None
    """A better optimum that was met; the profile stopped there and its ends mean nothing."""
    name: str = ""
    """The unknown's."""
    unknown: Unknown | None = None
    """By which its numbers are values; None if only the solver's numbers are given."""

    def tables(self) -> list[Table]:
        """The points: value, and rise of the cost over that at an interval's end."""
        if self.unknown is None:
            return []
        columns = (Column(self.name, ".5g"), UNIT, Column("rise of the cost", ".2f", "1"))
        made = Table(
            f"Profile likelihood of {self.name}",
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
                f"The profile of {self.name} found a better optimum, cost {self.better.cost:.6g} "
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
            "side: the interval has no end there."
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
            "The residuals are exactly zero: there is no noise to compare a profile with."
        )
    optimum = Point(float(vector[index]), cost, vector)
    lower = side_of(minimise, optimum, index, rise, -step, bounds[0])
    upper = ProfileSide([], "open")
    if lower.better is None:
        upper = side_of(minimise, optimum, index, rise, step, bounds[1])
    better = lower.better or upper.better
    points = sorted([*lower.points, optimum, *upper.points], key=lambda point: point.number)
    ends = (lower.end, upper.end) if better is None else (None, None)
    return Profile(index, cost, tuple(points), rise, *ends, (lower.ending, upper.ending), better)


def profiles_of(
    fit: Optimum,
    names: Sequence[str] | None = None,
    *,
    executor: Executor | None = None,
    watch: Callable[[int], None] | None = None,
) -> dict[str, Profile]:
    """Profile likelihoods of a fit's unknowns by name, in their order.

    By default of all unknowns of the machine that have an interval; an `InputError` for a name that
    is none of the fit's. `watch` is called with how many are done.

    Notes
    -----
    The cost rises to ½ q² s² f with s² = 2 cost/(n - K), q Student's quantile and f the samples
    that count as one independent sample: on a linear model exactly the estimate ± q standard
    errors.
    """
    problem = fit.problem
    vector = fit.solution.vector
    errors = uncertainty_of(fit)
    covariance = errors.own
    variables = covariance.variables
    if names is None:
        pairs = zip(problem.unknowns, covariance.determined, strict=True)
        numbers = [
            k for k, (unknown, determined) in enumerate(pairs) if unknown.run is None and determined
        ]
    else:
        numbers = sorted({variables.index(name) for name in names})
    cost = problem.cost(vector)
    rises = covariance.quantiles**2 * errors.inflation * cost / fit.linearised.spare_samples
    shared = (
        replace(problem, threads=1),
        vector,
        cost,
        {k: float(rises[k]) for k in numbers},
        covariance.standard_errors,
    )
    by_name: dict[str, Profile] = {}
    profiles = (executor or Serial()).run(_profiled, shared, numbers)
    for position, profile in counted(profiles, len(numbers), "parameters", "Profiling"):
        number = numbers[position]
        name = variables.names[number]
        unknown = problem.unknowns.items[number]
        by_name[name] = replace(profile, name=name, unknown=unknown)
        if watch is not None:
            watch(len(by_name))
    return {variables.names[k]: by_name[variables.names[k]] for k in numbers}


def _profiled(shared: tuple[Problem, Array, float, dict[int, float], Array], index: int) -> Profile:
    problem, vector, cost, rises, steps = shared
    low, high = (float(bound[index]) for bound in problem.bounds)
    step = float(steps[index])
    if not (np.isfinite(step) and step > 0.0):
        step = 0.01 * (high - low)
    return profile(minimiser(problem), vector, cost, index, rises[index], step, (low, high))
