"""One side of a profile: from the optimum outwards, each point started from the last."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import DomainError

Array = NDArray[np.float64]
Minimise = Callable[[int, float, Array], tuple[float, Array]]
"""Number of the unknown held, its number in the vector, and a (K,) start to the least cost of all
vectors that have it there, and the vector; cost is half the sum of squares."""

Ending = Literal["crossed", "bound", "open", "domain", "better optimum"]
"""How a side ended: beyond the threshold, at the bound below it, below it as far as was looked,
where the model no longer holds, or at a cost below the optimum's."""

STRIDE = 0.35
"""Step aimed at, in the square root of the cost's rise over that of the threshold: three points
a side on a parabola."""

BETTER = 1e-3
"""Part of the threshold by which a cost must lie below the optimum's to be a better optimum."""

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
    vector: Array


class ProfileSide:
    """One side of a profile, outwards."""

    def __init__(
        self,
        minimise: Minimise,
        optimum: Point,
        index: int,
        rise: float,
        direction: float,
        step: float,
        bound: float,
        most: int,
    ) -> None:
        self._minimise, self._optimum, self._index = minimise, optimum, index
        self._rise, self._direction, self._step, self._most = rise, direction, step, most
        self._room = abs(bound - optimum.number)
        self.points: list[Point] = []
        self.end: float | None = None
        self.better: Point | None = None

    def march(self) -> Ending:
        """Outwards until the cost has risen enough, or something else ends the side."""
        # roots of the rise over the threshold's, by distance: nearly a straight line
        path = [(0.0, 0.0)]
        stride, halvings = STRIDE * self._step, 0
        while len(self.points) < self._most:
            distance = min(path[-1][0] + stride, self._room)
            if distance <= path[-1][0]:
                return "bound"
            if distance > FURTHEST * self._step:
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
            self._insert(point)
            value = self._height(point) - 1.0
            if abs(value) <= CLOSE:
                break
            if value * high < 0.0:
                near, low = far, high
            else:
                low *= 0.5
            far, high = distance, value
        self.end = self._optimum.number + self._direction * distance
        return "crossed"

    def _at(self, distance: float) -> Point | None:
        """The least cost at a distance from the optimum; None outside the model's domain."""
        number = self._optimum.number + self._direction * distance
        start = self._nearest(number).vector.copy()
        start[self._index] = number
        try:
            cost, vector = self._minimise(self._index, number, start)
        except DomainError:
            return None
        return Point(number, float(cost), vector) if np.isfinite(cost) else None

    def _nearest(self, number: float) -> Point:
        return min((self._optimum, *self.points), key=lambda point: abs(point.number - number))

    def _insert(self, point: Point) -> None:
        self.points.append(point)
        self.points.sort(key=lambda each: abs(each.number - self._optimum.number))

    def _improves(self, point: Point) -> bool:
        better = point.cost < self._optimum.cost - BETTER * self._rise
        if better:
            self.better = point
        return better

    def _height(self, point: Point) -> float:
        return float(np.sqrt(max(point.cost - self._optimum.cost, 0.0) / self._rise))
