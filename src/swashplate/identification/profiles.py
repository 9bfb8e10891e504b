"""Profile likelihood: how far an unknown can move before the others cannot make up for it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError
from swashplate.identification.profile_side import Ending, Minimise, Point, ProfileSide

Array = NDArray[np.float64]


class Threshold(NamedTuple):
    """Rise of the cost up to which a value is within the interval."""

    rise: float
    """Of half the sum of squares."""
    level: float
    inflation: float
    """Samples that stand for one independent one."""


@dataclass(frozen=True, eq=False)
class Profile:
    """Least cost as a function of one unknown."""

    index: int
    cost: float
    """Of the optimum that it starts from."""
    points: tuple[Point, ...]
    """In order of the unknown, the optimum among them."""
    threshold: Threshold
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
            "open": "can go as far as was looked without the cost rising enough",
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
) -> Threshold:
    """Rise of the cost that ends an interval, for coloured residuals.

    Parameters
    ----------
    cost : float
        Half the sum of squares at the optimum.
    samples, unknowns : int
        Numbers of samples and of combinations determined.
    inflation : float
        Samples that stand for one independent one, at least 1: the ratio of the unknown's variance
        under coloured noise to that under white noise, or a channel's samples over its effective
        ones.
    freedom : float, optional
        Degrees of freedom of Student's quantile; by default samples/inflation - unknowns.
    level : float
        Probability of the interval.

    Raises
    ------
    InputError
        If there are no more samples than unknowns, the residuals are worth no more independent
        samples than there are unknowns, or inflation or level are out of range.

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
        raise InputError(f"{samples} samples for {unknowns} unknowns tell nothing of the noise.")
    if freedom is None:
        freedom = samples / inflation - unknowns
    if not freedom > 0.0:
        raise InputError(
            f"{samples} samples are worth {samples / inflation:.1f} independent ones, no more than "
            f"the {unknowns} unknowns: no interval follows from them."
        )
    from scipy.stats import t as student

    quantile = float(student.ppf(0.5 + 0.5 * level, freedom))
    rise = quantile**2 * inflation * cost / (samples - unknowns)
    return Threshold(rise, level, inflation)


def profile(
    minimise: Minimise,
    vector: Array,
    cost: float,
    index: int,
    threshold: Threshold,
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
    vector : (K,) array
        The optimum.
    cost : float
        Its half sum of squares.
    index : int
        Number of the unknown.
    threshold : Threshold
        Where the interval ends.
    step : float
        About one standard error of the unknown's number, positive: how far the first step goes.
    bounds : (float, float)
        Of the unknown's number.
    most : int
        Largest number of points a side.

    Raises
    ------
    InputError
        If the step or the threshold is not positive, or the optimum lies outside the bounds.
    """
    if not (step > 0.0 and np.isfinite(step)):
        raise InputError(f"The first step of a profile, {step:g}, must be positive and finite.")
    if not threshold.rise > 0.0:
        raise InputError(
            "The residuals are exactly zero: there is no noise that a profile could weigh against."
        )
    if not bounds[0] <= vector[index] <= bounds[1]:
        raise InputError("The optimum of a profile lies outside the bounds of its unknown.")
    optimum = Point(float(vector[index]), cost, vector)
    sides = [
        ProfileSide(minimise, optimum, index, threshold.rise, direction, step, bound, most)
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
        threshold,
        sides[0].end if better is None else None,
        sides[1].end if better is None else None,
        (endings[0], endings[1]),
        better,
    )
