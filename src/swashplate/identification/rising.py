"""Unknowns that rise, searched by their increments: they cannot cross on the way to an optimum."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from swashplate.identification.solving import Evaluation, Objective

Array = NDArray[np.float64]
REACH = 1e-9
"""What a start may lie beyond the increments' bounds by rounding."""


@runtime_checkable
class Ordered(Protocol):
    """An objective that knows which of its unknowns rise, such as forces with the current."""

    @property
    def rising(self) -> Sequence[Sequence[int]]:
        """Places in the vector, in rising order, of numbers that are logarithms."""
        ...


@dataclass(frozen=True)
class Increments:
    """An objective by the logarithms of increments, in place of those of rising values.

    Values a < b < c of a group become a, b - a, c - b, and bounds that are factors on a, b, c the
    same factors on these. Each point within the increments' bounds lies within those of the values,
    but not the other way round: what crosses, or nearly does, is left out.
    """

    objective: Objective
    groups: tuple[tuple[int, ...], ...]
    """Places of the values, rising at the objective's start."""

    @property
    def start(self) -> Array:
        """(K,) where the objective starts."""
        return self.to_search(self.objective.start)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """(K,) lower and upper bounds."""
        low, high = (each.copy() for each in self.objective.bounds)
        values, increments = self.objective.start, self.start
        for group in self.groups:
            places = list(group)
            # factors that hold for all values of the group keep sums of increments within bounds
            low[places] = increments[places] + (low[places] - values[places]).max()
            high[places] = increments[places] + (high[places] - values[places]).min()
        return low, high

    def to_search(self, vector: Array) -> Array:
        """(K,) vector by increments; NaN where the values do not rise."""
        made = vector.copy()
        for group in self.groups:
            places = list(group)
            steps = np.diff(np.exp(vector[places]), prepend=0.0)
            made[places] = np.log(np.where(steps > 0.0, steps, np.nan))
        return made

    def to_vector(self, search: Array) -> Array:
        """(K,) the objective's vector for one by increments."""
        made = search.copy()
        for group in self.groups:
            places = list(group)
            made[places] = np.log(np.cumsum(np.exp(search[places])))
        # a sum of increments at their bounds misses those of the values by rounding
        return np.clip(made, *self.objective.bounds)

    def evaluate(self, vector: Array, *, compressed: bool = True) -> Evaluation:
        """Residuals and Jacobian by increments, see `solving.Objective`."""
        values = self.to_vector(vector)
        found = self.objective.evaluate(values, compressed=compressed)
        jacobian = found.jacobian.copy()
        for group in self.groups:
            places = list(group)
            # of ln(d1 + ... + dk) by ln dj: dj over the sum
            by = np.tril(np.exp(vector[places] - values[places][:, None]))
            jacobian[:, places] = found.jacobian[:, places] @ by
        return Evaluation(found.residuals, jacobian)

    def cost(self, vector: Array) -> float:
        """Half the sum of squares."""
        return self.objective.cost(self.to_vector(vector))


def by_increments(objective: Objective, start: Array | None = None) -> Increments:
    """An objective by increments of what is known to rise; as it is where nothing is.

    Parameters
    ----------
    objective : Objective
        Best one that is `Ordered`.
    start : (K,) array, optional
        A point that must be expressible: groups that do not rise there stay as they are.
    """
    groups = []
    for group in objective.rising if isinstance(objective, Ordered) else ():
        points = [objective.start] if start is None else [objective.start, start]
        if all((np.diff(point[list(group)]) > 0.0).all() for point in points):
            groups.append(tuple(group))
    made = Increments(objective, tuple(groups))
    if start is not None and groups:
        low, high = made.bounds
        search = made.to_search(start)
        if ((search < low - REACH) | (search > high + REACH)).any():
            return Increments(objective, ())
    return made
