"""Errors of a fit carried over to numbers of its drive, to first order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from swashplate.drive import Drive
from swashplate.errors import DomainError, ParameterError, SwashplateError
from swashplate.identification import DriveModel, Optimum, identifiability_of, uncertainty_of
from swashplate.identification.estimation import LIMIT_COLUMNS, Forces
from swashplate.identification.statistics import effect_of_fixed, slopes_by
from swashplate.parameters import ParameterSet
from swashplate.results import Result

Array = NDArray[np.float64]
Numbers = Callable[[Drive], Array]
"""From a drive to N numbers, (N,)."""
NO_NUMBERS: Mapping[str, float] = MappingProxyType({})

QUANTILE = 1.96
"""Standard deviations on either side of a 95 % interval."""
ERROR_OF_ASSUMED = 0.2
"""Standard deviation of an assumed parameter over its value: a guess takes 0.2 rad for the plate's
largest angle, machines have 0.25 to 0.35. [1]"""
STEP = 0.1
"""Step of a derivative, over the standard error of the estimate. [1]"""
LARGEST_STEP = 0.05
"""Largest change of one of the solver's numbers in such a step. [1]"""
UNBOUNDED = 1e6
"""Width of bounds, in the solver's vector, that is as good as none. [1]"""
ROUNDING = 1e-9
"""By how much one of the solver's numbers may lie beyond its bound and still count as there. [1]"""
NEGLIGIBLE = 1e-12
"""Change of the solver's numbers that counts as none. [1]"""
FOLLOWS = 0.01
"""Share of a number by which 5 % of what the tests do not determine moves it, up to which it counts
as determined all the same. [1]"""
LEANS = 0.1
"""Share of a number's variance that goes with an estimate at its bound, from which the number says
so: 5 % of its width. [1]"""


# --- the drive at other estimates -----------------------------------------------------------------


def drive_model_of(fit: Optimum) -> DriveModel:
    """The model of the drive that was fitted, with what it began with."""
    model = fit.problem.model
    assert isinstance(model, DriveModel)
    return model


def set_at(
    fit: Optimum, vector: Array, fixed: Mapping[str, float] = NO_NUMBERS
) -> ParameterSet | None:
    """The drive of a fit at another vector (K,) and with other fixed numbers, by column. [SI]

    None outside the domain.
    """
    model = drive_model_of(fit)
    parameters = model.parameters
    try:
        if fixed:
            parameters = parameters.with_numbers(fixed, parameters.options)
        # a new model: the fitted one keeps what it computed for other parameters
        fresh = DriveModel(parameters, model.part, forces=model.forces)
        return fresh.parameters_at(fit.problem.unknowns.targets(vector, ""))
    except (DomainError, ParameterError):
        return None


def effects_on(fit: Optimum) -> list[str]:
    """Names of the systematic effects that move an estimate of the machine."""
    machine = fit.problem.unknowns.shared
    moving = {
        effect: None
        for effect, change in uncertainty_of(fit).systematic.items()
        if np.abs(change[machine]).max(initial=0.0) > NEGLIGIBLE
    }
    # a fixed number that moves no estimate still moves what is computed of the drive
    for together in fit.problem.uncertain:
        moving[effect_of_fixed(together)] = None
    return list(moving)


def assumed_parameters(fit: Optimum) -> list[dict[str, float]]:
    """Standard deviations of the fixed parameters that nobody measured, by column.

    A mapping for each parameter of the fit's initial set whose status is "assumed" or
    "approximate"; it holds both directions. Left out are parameters that are estimated and those
    whose uncertainty is stated.
    """
    left_out = {target for unknown in fit.problem.unknowns for target in unknown.targets}
    left_out |= LIMIT_COLUMNS.keys()
    if fit.setup.forces is not None:
        left_out.update(Forces.columns)
    for with_stated_uncertainty in fit.problem.uncertain:
        left_out.update(with_stated_uncertainty)
    assumed = []
    for parameter in drive_model_of(fit).parameters.values():
        numbers = {
            column: ERROR_OF_ASSUMED * value
            for column, value in parameter.numbers.items()
            if isfinite(value) and value != 0.0
        }
        is_assumed = parameter.status in ("assumed", "approximate")
        if is_assumed and numbers and left_out.isdisjoint(numbers):
            assumed.append(numbers)
    return assumed


# --- intervals ------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Spread(Result):
    """How far numbers of a fitted drive may lie from their values, (N,) each."""

    half: Array
    """Half widths of 95 % intervals of what the tests determine."""
    below: Array
    """By how much a number falls, beyond that, if what the tests leave open goes as far as its
    bounds; infinite if it has no end there."""
    above: Array
    """By how much it grows."""
    at_bounds: Mapping[str, NDArray[np.bool_]]
    """By the estimates that ended at a bound of their search: which numbers lean on them."""


def spread_of(fit: Optimum, numbers: Numbers, left_out: Sequence[str] = ()) -> Spread:
    """95 % intervals of numbers of a fitted drive, from the errors of its estimates.

    Parameters
    ----------
    fit : Optimum
        Of a drive.
    numbers : callable
        From a drive to (N,) numbers.
    left_out : sequence of str
        Columns that no test exercises and whose effect is accounted for elsewhere.

    Raises
    ------
    InputError
        If there are no more samples than unknowns.

    Notes
    -----
    To first order: the sum of squares of what the numbers change by for one standard error along
    each principal axis of the covariance, one standard uncertainty of each systematic effect, and
    one of each assumed number, which the estimates follow so that the drive still agrees with the
    tests. A derivative is that of a small step, to the side that bounds and model allow. An
    estimate at a bound counts as one that is free to move, as in its neighbours' intervals: if
    neither side is allowed, as several are at bounds, the derivative is taken unknown by unknown.

    What the tests do not determine, a direction in which parameters move together unseen, or a
    parameter that no test exercises, is moved as far as the bounds of the search.
    """
    derivatives = _MovedNumbers(fit, numbers)
    variance = np.zeros_like(derivatives.base)
    for axis in _principal_axes(fit):
        variance += derivatives.along(axis) ** 2
    within, systematic = _within_bounds(fit), uncertainty_of(fit).systematic
    nothing = np.zeros(len(fit.problem.unknowns))
    for effect in effects_on(fit):
        fixed = dict[str, float]()
        for together in fit.problem.uncertain:
            if effect_of_fixed(together) == effect:
                fixed.update(together)
        variance += derivatives.along(within @ systematic.get(effect, nothing), fixed) ** 2
    assumed = assumed_parameters(fit)
    following = within @ slopes_by(fit, assumed)
    for together, change in zip(assumed, following.T, strict=True):
        variance += derivatives.along(change, together) ** 2
    leaning = {name: derivatives.along(error) ** 2 for name, error in _errors_at_bounds(fit)}
    most = np.max([np.zeros_like(variance), *leaning.values()], axis=0)
    at_bounds = {
        name: (squares > LEANS * variance) & (squares == most) for name, squares in leaning.items()
    }
    below, above = derivatives.left_open(left_out)
    return Spread(QUANTILE * np.sqrt(variance), below, above, at_bounds)


def _principal_axes(fit: Optimum) -> Iterator[Array]:
    """Standard errors (K,) along the axes of the covariance of the machine's unknowns."""
    unknowns = fit.problem.unknowns
    machine = unknowns.shared
    covariance = _covariance(fit)[np.ix_(machine, machine)]
    variances, axes = np.linalg.eigh(covariance)
    for variance, axis in zip(variances, axes.T, strict=True):
        error = np.zeros(len(unknowns))
        error[machine] = np.sqrt(max(variance, 0.0)) * axis
        yield error


def _within_bounds(fit: Optimum) -> Array:
    """Factor (K, K) by which errors of the vector shrink if its bounds were known beforehand.

    Notes
    -----
    P (P + C)⁻¹, with the tests' covariance C and the variances P of a uniform distribution between
    the bounds: what a posterior's mean and covariance make of an error of the data, and of C. What
    tests determine stays as it is; what they hardly do lies within the bounds.
    """
    low, high = fit.problem.unknowns.bounds
    width = np.clip(high - low, NEGLIGIBLE, UNBOUNDED)
    prior = np.diag(width**2 / 12.0)
    return np.asarray(prior @ np.linalg.inv(prior + _of_tests(fit)))


def _of_tests(fit: Optimum) -> Array:
    """Covariance (K, K) of the vector as the tests tell it, 0 of what they do not."""
    covariance = uncertainty_of(fit).within_ends
    return np.where(np.isfinite(covariance), covariance, 0.0)


def _covariance(fit: Optimum) -> Array:
    """Covariance (K, K) of the vector within its bounds."""
    covariance = _within_bounds(fit) @ _of_tests(fit)
    return 0.5 * (covariance + covariance.T)


def _errors_at_bounds(fit: Optimum) -> Iterator[tuple[str, Array]]:
    """Name of each estimate of the machine at a bound, and a standard error that others follow.

    An estimate at its bound is not where the data would have it: by how much it is off is not
    known. One of what is known to be near its bound beforehand, such as a lag that a machine need
    not have, is where it belongs.
    """
    unknowns, covariance = fit.problem.unknowns, _covariance(fit)
    for name in identifiability_of(fit).at_bounds:
        index = unknowns.names.index(name)
        deviation = float(np.sqrt(max(covariance[index, index], 0.0)))
        prior = unknowns[index].prior
        low, high = unknowns[index].low, unknowns[index].high
        belongs = prior is not None and not low < prior.mean < high
        if unknowns[index].run is None and deviation > NEGLIGIBLE and not belongs:
            yield name, covariance[index] / deviation


class _MovedNumbers:
    """Derivatives of numbers of a fitted drive by what the fit found or took as known."""

    def __init__(self, fit: Optimum, numbers: Numbers) -> None:
        self._fit = fit
        self._numbers = numbers
        self._of_unknowns = dict[int, Array]()
        self.base = numbers(fit.drive)

    def _at(self, change: Array, fixed: Mapping[str, float] = NO_NUMBERS) -> Array | None:
        """The numbers at a changed vector; None outside the bounds or the model's domain."""
        unknowns = self._fit.problem.unknowns
        vector = self._fit.solution.vector + change
        # at its bound the value of an unknown ends
        low, high = unknowns.bounds
        beyond = (vector < low - ROUNDING) | (vector > high + ROUNDING)
        if (beyond & (change != 0.0))[unknowns.shared].any():
            return None
        parameters = set_at(self._fit, vector, fixed)
        if parameters is None:
            return None
        try:
            return self._numbers(Drive(parameters))
        except SwashplateError:
            return None

    def along(self, change: Array, fixed: Mapping[str, float] = NO_NUMBERS) -> Array:
        """Derivative (N,) along a change (K,) of the vector and of fixed numbers, by column."""
        largest = float(np.abs(change).max(initial=0.0))
        if largest <= NEGLIGIBLE and not fixed:
            return np.zeros_like(self.base)
        slope = self._slope(change, fixed, min(STEP, LARGEST_STEP / max(largest, NEGLIGIBLE)))
        if slope is not None:
            return slope
        total = np.zeros_like(self.base)
        if fixed:
            alone = self._slope(np.zeros_like(change), fixed, STEP)
            total += 0.0 if alone is None else alone
        for index in np.flatnonzero(np.abs(change) > NEGLIGIBLE).tolist():
            total += change[index] * self._by_unknown(index)
        return total

    def _slope(self, change: Array, fixed: Mapping[str, float], first: float) -> Array | None:
        """Derivative by a small step to the first side that is allowed; None if neither is."""
        numbers = drive_model_of(self._fit).parameters.numbers
        for step in (first, -first, 0.1 * first, -0.1 * first):
            moved = self._at(
                step * change,
                {column: numbers[column] + step * unit for column, unit in fixed.items()},
            )
            if moved is not None:
                # what the drive has not, here or there, has no derivative
                return np.nan_to_num((moved - self.base) / step)
        return None

    def _by_unknown(self, index: int) -> Array:
        """Derivative by one unknown; 0 if the model does not let it move at all."""
        if index not in self._of_unknowns:
            unit = np.zeros(len(self._fit.problem.unknowns))
            unit[index] = 1.0
            slope = self._slope(unit, {}, LARGEST_STEP)
            self._of_unknowns[index] = np.zeros_like(self.base) if slope is None else slope
        return self._of_unknowns[index]

    def left_open(self, left_out: Sequence[str]) -> tuple[Array, Array]:
        """By how much numbers fall and grow as far as the bounds along what is not determined."""
        below, above = np.zeros_like(self.base), np.zeros_like(self.base)
        for direction in _undetermined(self._fit, left_out):
            change = LARGEST_STEP * np.abs(self.along(direction))
            moves = change > FOLLOWS * np.abs(self.base)
            if not moves.any():
                continue
            for sign in (1.0, -1.0):
                end = self._at_bound(sign * direction)
                if end is None:
                    below[moves], above[moves] = inf, inf
                    continue
                gone = np.where(np.isfinite(end), end - self.base, 0.0)
                below[moves] = np.maximum(below, -gone)[moves]
                above[moves] = np.maximum(above, gone)[moves]
        return below, above

    def _at_bound(self, direction: Array) -> Array | None:
        """The numbers as far along a direction (K,) as the bounds and the model allow."""
        vector = self._fit.solution.vector
        low, high = self._fit.problem.unknowns.bounds
        ends = np.where(direction > 0.0, high - vector, low - vector)
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = np.where(direction != 0.0, ends / direction, inf)
        farthest = max(float(reach.min()), 0.0)
        if not isfinite(farthest):
            return None
        for share in (1.0, 0.5, 0.25, 0.1):
            moved = self._at(share * farthest * direction)
            if moved is not None:
                return moved
        return None


def _undetermined(fit: Optimum, left_out: Sequence[str]) -> Iterator[Array]:
    """Directions (K,) of the vector that the tests do not determine."""
    identifiability = identifiability_of(fit)
    names = fit.problem.unknowns.names
    directions: list[Mapping[str, float]] = [each.changes for each in identifiability.null]
    directions += [{name: 1.0} for name in identifiability.unexcited if name not in left_out]
    for changes in directions:
        direction = np.zeros(len(names))
        for name, change in changes.items():
            direction[names.index(name)] = change
        yield direction
