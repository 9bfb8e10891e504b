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
from swashplate.identification import DriveModel, StageFit, identifiability_of, uncertainty_of
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


def drive_model_of(stages: Sequence[StageFit]) -> DriveModel:
    """The model of the drive that the first stage began with."""
    model = stages[0].problem.model
    assert isinstance(model, DriveModel)
    return model


def set_at(
    stages: Sequence[StageFit],
    vectors: Mapping[str, Array] = MappingProxyType({}),
    fixed: Mapping[str, float] = NO_NUMBERS,
) -> ParameterSet | None:
    """The drive of a fit at other vectors and with other fixed numbers; None outside the domain.

    Vectors are by their stage's name, by default where it ended; fixed numbers are by column. [SI]
    """
    parameters = drive_model_of(stages).parameters
    try:
        if fixed:
            parameters = parameters.with_numbers(fixed, parameters.options)
        for stage in stages:
            problem = stage.problem
            assert isinstance(problem.model, DriveModel)
            vector = vectors.get(stage.stage.name, stage.solution.vector)
            # a new model: the fitted one keeps what it computed for other parameters
            fresh = DriveModel(parameters, problem.model.part, forces=problem.model.forces)
            parameters = fresh.parameters_at(problem.unknowns.targets(vector, ""))
    except (DomainError, ParameterError):
        return None
    return parameters


def effects_on(stages: Sequence[StageFit]) -> list[str]:
    """Names of the systematic effects that move an estimate of the machine in some stage."""
    moving = dict[str, None]()
    for stage in stages:
        machine = stage.problem.unknowns.shared
        for effect, change in uncertainty_of(stage).systematic.items():
            if np.abs(change[machine]).max(initial=0.0) > NEGLIGIBLE:
                moving[effect] = None
    # a fixed number that moves no estimate still moves what is computed of the drive
    for together in stages[0].problem.uncertain:
        moving[effect_of_fixed(together)] = None
    return list(moving)


def assumed_parameters(stages: Sequence[StageFit]) -> list[dict[str, float]]:
    """Standard deviations of the fixed parameters that nobody measured, by column.

    A mapping for each parameter of the fit's initial set whose status is "assumed" or
    "approximate"; it holds both directions. Left out are parameters that a stage estimates and
    those whose uncertainty is stated.
    """
    model = stages[0].problem.model
    assert isinstance(model, DriveModel)
    estimated = set[str]()
    for stage in stages:
        for unknown in stage.problem.unknowns:
            estimated.update(unknown.targets)
    if any(stage.stage.forces is not None for stage in stages):
        estimated.update(Forces.columns)
    with_stated_uncertainty = set[str]()
    for columns in stages[0].problem.uncertain:
        with_stated_uncertainty.update(columns)
    left_out = estimated | with_stated_uncertainty | LIMIT_COLUMNS.keys()
    assumed = []
    for parameter in model.parameters.values():
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


def spread_of(stages: Sequence[StageFit], numbers: Numbers, left_out: Sequence[str] = ()) -> Spread:
    """95 % intervals of numbers of a fitted drive, from the errors of its estimates.

    Parameters
    ----------
    stages : sequence of StageFit
        All stages of the fit.
    numbers : callable
        From a drive to (N,) numbers.
    left_out : sequence of str
        Columns that no test exercises and whose effect is accounted for elsewhere.

    Raises
    ------
    InputError
        If a stage has no more samples than unknowns.

    Notes
    -----
    To first order: the sum of squares of what the numbers change by for one standard error along
    each principal axis of every stage's covariance, one standard uncertainty of each systematic
    effect, and one of each assumed number. The later stages follow an error of the earlier ones as
    the fit would, the estimates follow an assumed number so that the drive still agrees with the
    tests. A derivative is that of a small step, to the side that bounds and model allow. An
    estimate at a bound counts as one that is free to move, as in its neighbours' intervals: if
    neither side is allowed, as several are at bounds, the derivative is taken unknown by unknown.

    What the tests do not determine, a direction in which parameters move together unseen, or a
    parameter that no test exercises, is moved as far as the bounds of the search.
    """
    derivatives = _MovedNumbers(stages, numbers)
    variance = np.zeros_like(derivatives.base)
    for stage in stages:
        for axis in _principal_axes(stage):
            variance += derivatives.along(_followed(stages, {stage.stage.name: axis})) ** 2
    for effect in effects_on(stages):
        changes = {
            stage.stage.name: _within_bounds(stage) @ systematic[effect]
            for stage in stages
            if effect in (systematic := uncertainty_of(stage).systematic)
        }
        fixed = dict[str, float]()
        for together in stages[0].problem.uncertain:
            if effect_of_fixed(together) == effect:
                fixed.update(together)
        variance += derivatives.along(changes, fixed) ** 2
    assumed = assumed_parameters(stages)
    following = {
        stage.stage.name: _within_bounds(stage) @ slopes_by(stage, assumed)
        for stage in stages
        if assumed
    }
    for k, together in enumerate(assumed):
        changes = {name: slopes[:, k] for name, slopes in following.items()}
        variance += derivatives.along(_followed(stages, changes), together) ** 2
    at_bounds = dict[str, NDArray[np.bool_]]()
    for stage in stages:
        for name, error in _errors_at_bounds(stage):
            part = derivatives.along(_followed(stages, {stage.stage.name: error})) ** 2
            at_bounds[name] = part > LEANS * variance
    below, above = derivatives.left_open(left_out)
    return Spread(QUANTILE * np.sqrt(variance), below, above, at_bounds)


def _principal_axes(stage: StageFit) -> Iterator[Array]:
    """Standard errors (K,) along the axes of a stage's covariance of the machine's unknowns."""
    unknowns = stage.problem.unknowns
    machine = unknowns.shared
    covariance = _covariance(stage)[np.ix_(machine, machine)]
    variances, axes = np.linalg.eigh(covariance)
    for variance, axis in zip(variances, axes.T, strict=True):
        error = np.zeros(len(unknowns))
        error[machine] = np.sqrt(max(variance, 0.0)) * axis
        yield error


def _followed(stages: Sequence[StageFit], own: Mapping[str, Array]) -> dict[str, Array]:
    """Changes of all stages' vectors for changes of some, which the later stages follow."""
    changes = dict[str, Array]()
    for stage in stages:
        change = own.get(stage.stage.name, np.zeros(len(stage.problem.unknowns)))
        for earlier in uncertainty_of(stage).earlier_stages:
            followed = earlier.slopes @ changes[earlier.stage]
            if followed.any():
                change = change + _within_bounds(stage) @ followed
        changes[stage.stage.name] = change
    return changes


def _within_bounds(stage: StageFit) -> Array:
    """Factor (K, K) by which errors of a stage's vector shrink if its bounds were known beforehand.

    Notes
    -----
    P (P + C)⁻¹, with the tests' covariance C and the variances P of a uniform distribution between
    the bounds: what a posterior's mean and covariance make of an error of the data, and of C. What
    tests determine stays as it is; what they hardly do lies within the bounds.
    """
    low, high = stage.problem.unknowns.bounds
    width = np.clip(high - low, NEGLIGIBLE, UNBOUNDED)
    prior = np.diag(width**2 / 12.0)
    return np.asarray(prior @ np.linalg.inv(prior + _of_tests(stage)))


def _of_tests(stage: StageFit) -> Array:
    """Covariance (K, K) of a stage's vector as its tests tell it, 0 of what they do not."""
    covariance = uncertainty_of(stage).own.matrix
    return np.where(np.isfinite(covariance), covariance, 0.0)


def _covariance(stage: StageFit) -> Array:
    """Covariance (K, K) of a stage's vector within its bounds."""
    covariance = _within_bounds(stage) @ _of_tests(stage)
    return 0.5 * (covariance + covariance.T)


def _errors_at_bounds(stage: StageFit) -> Iterator[tuple[str, Array]]:
    """Name of each estimate of the machine at a bound, and a standard error that others follow.

    An estimate at its bound is not where the data would have it: by how much it is off is not
    known.
    """
    unknowns, covariance = stage.problem.unknowns, _covariance(stage)
    for name in identifiability_of(stage).at_bounds:
        index = unknowns.names.index(name)
        deviation = float(np.sqrt(max(covariance[index, index], 0.0)))
        if unknowns[index].run is None and deviation > NEGLIGIBLE:
            yield name, covariance[index] / deviation


class _MovedNumbers:
    """Derivatives of numbers of a fitted drive by what the fit found or took as known."""

    def __init__(self, stages: Sequence[StageFit], numbers: Numbers) -> None:
        self.stages = stages
        self._numbers = numbers
        self._of_unknowns = dict[tuple[str, int], Array]()
        self.base = numbers(stages[-1].drive)

    def _at(
        self, changes: Mapping[str, Array], fixed: Mapping[str, float] = NO_NUMBERS
    ) -> Array | None:
        """The numbers at changed vectors; None outside the bounds or the model's domain."""
        vectors = dict[str, Array]()
        for stage in self.stages:
            if stage.stage.name in changes:
                change, unknowns = changes[stage.stage.name], stage.problem.unknowns
                vector = stage.solution.vector + change
                # at its bound the value of an unknown ends
                low, high = unknowns.bounds
                beyond = (vector < low - ROUNDING) | (vector > high + ROUNDING)
                if (beyond & (change != 0.0))[unknowns.shared].any():
                    return None
                vectors[stage.stage.name] = vector
        parameters = set_at(self.stages, vectors, fixed)
        if parameters is None:
            return None
        try:
            return self._numbers(Drive(parameters))
        except SwashplateError:
            return None

    def along(self, changes: Mapping[str, Array], fixed: Mapping[str, float] = NO_NUMBERS) -> Array:
        """Derivative (N,) along changes of the stages' vectors and of fixed numbers, by column."""
        largest = max(
            (float(np.abs(each).max(initial=0.0)) for each in changes.values()), default=0.0
        )
        if largest <= NEGLIGIBLE and not fixed:
            return np.zeros_like(self.base)
        slope = self._slope(changes, fixed, min(STEP, LARGEST_STEP / max(largest, NEGLIGIBLE)))
        if slope is not None:
            return slope
        total = np.zeros_like(self.base)
        if fixed:
            alone = self._slope({}, fixed, STEP)
            total += 0.0 if alone is None else alone
        for stage in self.stages:
            change = changes.get(stage.stage.name, np.zeros(0))
            for index in np.flatnonzero(np.abs(change) > NEGLIGIBLE).tolist():
                total += change[index] * self._by_unknown(stage, index)
        return total

    def _slope(
        self, changes: Mapping[str, Array], fixed: Mapping[str, float], first: float
    ) -> Array | None:
        """Derivative by a small step to the first side that is allowed; None if neither is."""
        numbers = drive_model_of(self.stages).parameters.numbers
        for step in (first, -first, 0.1 * first, -0.1 * first):
            moved = self._at(
                {name: step * change for name, change in changes.items()},
                {column: numbers[column] + step * unit for column, unit in fixed.items()},
            )
            if moved is not None:
                # what the drive has not, here or there, has no derivative
                return np.nan_to_num((moved - self.base) / step)
        return None

    def _by_unknown(self, stage: StageFit, index: int) -> Array:
        """Derivative by one unknown of a stage; 0 if the model does not let it move at all."""
        key = stage.stage.name, index
        if key not in self._of_unknowns:
            unit = np.zeros(len(stage.problem.unknowns))
            unit[index] = 1.0
            slope = self._slope({stage.stage.name: unit}, {}, LARGEST_STEP)
            self._of_unknowns[key] = np.zeros_like(self.base) if slope is None else slope
        return self._of_unknowns[key]

    def left_open(self, left_out: Sequence[str]) -> tuple[Array, Array]:
        """By how much numbers fall and grow as far as the bounds along what is not determined."""
        below, above = np.zeros_like(self.base), np.zeros_like(self.base)
        for stage in self.stages:
            for direction in _undetermined(stage, left_out):
                change = LARGEST_STEP * np.abs(self.along({stage.stage.name: direction}))
                moves = change > FOLLOWS * np.abs(self.base)
                if not moves.any():
                    continue
                for sign in (1.0, -1.0):
                    end = self._at_bound(stage, sign * direction)
                    if end is None:
                        below[moves], above[moves] = inf, inf
                        continue
                    gone = np.where(np.isfinite(end), end - self.base, 0.0)
                    below[moves] = np.maximum(below, -gone)[moves]
                    above[moves] = np.maximum(above, gone)[moves]
        return below, above

    def _at_bound(self, stage: StageFit, direction: Array) -> Array | None:
        """The numbers as far along a direction as the bounds and the model allow."""
        vector = stage.solution.vector
        low, high = stage.problem.unknowns.bounds
        ends = np.where(direction > 0.0, high - vector, low - vector)
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = np.where(direction != 0.0, ends / direction, inf)
        farthest = max(float(reach.min()), 0.0)
        if not isfinite(farthest):
            return None
        for share in (1.0, 0.5, 0.25, 0.1):
            moved = self._at({stage.stage.name: share * farthest * direction})
            if moved is not None:
                return moved
        return None


def _undetermined(stage: StageFit, left_out: Sequence[str]) -> Iterator[Array]:
    """Directions (K,) of a stage's vector that its tests do not determine."""
    identifiability = identifiability_of(stage)
    names = stage.problem.unknowns.names
    directions: list[Mapping[str, float]] = [each.changes for each in identifiability.null]
    directions += [{name: 1.0} for name in identifiability.unexcited if name not in left_out]
    for changes in directions:
        direction = np.zeros(len(names))
        for name, change in changes.items():
            direction[names.index(name)] = change
        yield direction
