"""Unknowns of a fit: names, bounds, transforms, ties and priors; the vector that a solver moves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import exp, isfinite, log, sqrt

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import ParameterError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Prior:
    """What is known of an unknown beforehand: a normal distribution."""

    mean: float
    """In the unknown's unit."""
    deviation: float
    """Standard deviation, positive; of a logarithmic unknown that of its logarithm."""
    worth: float = 1.0
    """Squared residuals of the data's cost that stand for one independent one of variance 1: so
    often the prior counts, see `prior_weights`."""


@dataclass(frozen=True)
class Unknown:
    """One number that a fit is to find."""

    name: str
    start: float
    """Nominal value: where a fit begins. [unit]"""
    low: float
    high: float
    """Bounds. [unit]"""
    unit: str = ""
    log: bool = False
    """Whether the solver moves its logarithm: for positive numbers that are known by order."""
    prior: Prior | None = None
    sets: tuple[str, ...] = ()
    """Names in the model that take its value; its own if empty. Two names tie two directions."""
    run: str | None = None
    """The experiment that it belongs to, None for one of the machine."""

    def __post_init__(self) -> None:
        if not (isfinite(self.low) and isfinite(self.high) and self.low < self.high):
            raise ParameterError(
                f"{self.name} is bounded by {self.low:g} and {self.high:g}; two finite numbers, "
                "the lower one first, are needed."
            )
        if not self.low <= self.start <= self.high:
            raise ParameterError(
                f"{self.name} begins at {self.start:g}, outside its bounds {self.low:g} and "
                f"{self.high:g}."
            )
        if self.log and self.low <= 0.0:
            raise ParameterError(
                f"{self.name} is moved by its logarithm, so its lower bound must be above 0, not "
                f"{self.low:g}."
            )
        if self.prior is not None and not self.prior.deviation > 0.0:
            raise ParameterError(f"The prior of {self.name} needs a positive standard deviation.")

    @property
    def targets(self) -> tuple[str, ...]:
        """Names in the model that take its value."""
        return self.sets or (self.name,)

    @property
    def scale(self) -> float:
        """What one unit of the solver's vector means, for an unknown that is not logarithmic."""
        reach = self.high - self.low
        # one that begins at next to nothing, or at 0, is known by its bounds alone
        return abs(self.start) if abs(self.start) > 1e-6 * reach else 0.25 * reach

    def to_vector(self, value: float) -> float:
        """The solver's number for a value."""
        return log(value) if self.log else value / self.scale

    def to_value(self, number: float) -> float:
        """The value for a solver's number, kept within the bounds against rounding."""
        value = exp(number) if self.log else number * self.scale
        return min(max(value, self.low), self.high)

    def slope(self, number: float) -> float:
        """d value / d number."""
        return exp(number) if self.log else self.scale


def bounded(
    name: str,
    nominal: float,
    *,
    relative: tuple[float, float] | None = None,
    absolute: tuple[float, float] | None = None,
    least: float | None = None,
    **more: object,
) -> Unknown:
    """An unknown with bounds that are multiples of its nominal value, or numbers.

    Parameters
    ----------
    name : str
        Its name.
    nominal : float
        Where the fit begins.
    relative, absolute : (float, float)
        One of the two: factors on the nominal value, in either order, or bounds as they are.
    least : float, optional
        Value that it must not fall below, whatever the bounds: it begins there at the lowest.
    **more :
        Other fields of `Unknown`.

    Raises
    ------
    ParameterError
        If both or none are given, or `relative` is given for a nominal value of 0, which no
        factor moves.
    """
    if (relative is None) == (absolute is None):
        raise ParameterError(f"{name} needs bounds: give relative or absolute ones, one of them.")
    if relative is not None:
        if nominal == 0.0:
            raise ParameterError(
                f"{name} is nominally 0, which no factor moves: give absolute bounds."
            )
        low, high = sorted(factor * nominal for factor in relative)
    else:
        assert absolute is not None
        low, high = absolute
    if least is not None:
        nominal, low = max(nominal, least), max(low, least)
    return Unknown(name, nominal, low, high, **more)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Unknowns(Sequence[Unknown]):
    """The unknowns of a fit in the order of the solver's vector."""

    items: tuple[Unknown, ...]

    def __post_init__(self) -> None:
        taken: set[tuple[str | None, str]] = set()
        for each in self.items:
            for target in each.targets:
                if (each.run, target) in taken:
                    raise ParameterError(f"{target} is set by two unknowns; let one set it.")
                taken.add((each.run, target))

    def __getitem__(self, index):  # type: ignore[no-untyped-def]
        return self.items[index]

    def __len__(self) -> int:
        return len(self.items)

    def __iter__(self) -> Iterator[Unknown]:
        return iter(self.items)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names, with the experiment of those that belong to one: ``"offset counts (hoistr6)"``."""
        return tuple(
            each.name if each.run is None else f"{each.name} ({each.run})" for each in self.items
        )

    @cached_property
    def start(self) -> Array:
        """(K,) vector of the nominal values."""
        return np.array([each.to_vector(each.start) for each in self.items])

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """(K,) lower and upper bounds of the vector."""
        low = np.array([each.to_vector(each.low) for each in self.items])
        high = np.array([each.to_vector(each.high) for each in self.items])
        return low, high

    def values(self, vector: Array) -> dict[str, float]:
        """Values by name."""
        return {
            name: each.to_value(float(number))
            for name, each, number in zip(self.names, self.items, vector, strict=True)
        }

    def vector(self, values: Mapping[str, float]) -> Array:
        """The vector of some values by name; those not named stay nominal."""
        return np.array(
            [
                each.to_vector(values.get(name, each.start))
                for name, each in zip(self.names, self.items, strict=True)
            ]
        )

    def targets(self, vector: Array, run: str) -> dict[str, float]:
        """Values by the model's names, as one experiment sees them."""
        return {
            target: each.to_value(float(number))
            for each, number in zip(self.items, vector, strict=True)
            if each.run in (None, run)
            for target in each.targets
        }

    def chain(self, vector: Array, targets: Sequence[str], run: str) -> Array:
        """(len(targets), K) derivatives of the model's numbers by the vector."""
        matrix = np.zeros((len(targets), len(self.items)))
        rows = {target: row for row, target in enumerate(targets)}
        for column, (each, number) in enumerate(zip(self.items, vector, strict=True)):
            if each.run not in (None, run):
                continue
            for target in each.targets:
                if target in rows:
                    matrix[rows[target], column] = each.slope(float(number))
        return matrix

    def with_worths(self, worths: Sequence[float] | None) -> Unknowns:
        """The same with these worths of the priors, in order; without any priors for None."""
        given = iter(worths or ())
        items = []
        for each in self.items:
            prior = each.prior
            if prior is not None:
                prior = None if worths is None else replace(prior, worth=next(given))
            items.append(replace(each, prior=prior))
        return Unknowns(tuple(items))

    def prior_rows(self, vector: Array) -> tuple[Array, Array]:
        """Residuals (p,) of the priors and their derivatives (p, K) by the vector."""
        having = [k for k, each in enumerate(self.items) if each.prior is not None]
        residuals, rows = np.zeros(len(having)), np.zeros((len(having), len(self.items)))
        for row, k in enumerate(having):
            each, number = self.items[k], float(vector[k])
            assert each.prior is not None
            if each.log:
                residuals[row] = (number - log(each.prior.mean)) / each.prior.deviation
                rows[row, k] = 1.0 / each.prior.deviation
            else:
                residuals[row] = (number * each.scale - each.prior.mean) / each.prior.deviation
                rows[row, k] = each.scale / each.prior.deviation
            residuals[row] *= sqrt(each.prior.worth)
            rows[row] *= sqrt(each.prior.worth)
        return residuals, rows

    def at_bounds(self, vector: Array, tolerance: float = 1e-6) -> dict[str, str]:
        """Unknowns that lie at a bound, by name: ``"lower"`` or ``"upper"``."""
        low, high = self.bounds
        near = tolerance * (high - low)
        sides = {}
        for name, number, lower, upper, reach in zip(
            self.names, vector, low, high, near, strict=True
        ):
            if number <= lower + reach:
                sides[name] = "lower"
            elif number >= upper - reach:
                sides[name] = "upper"
        return sides
