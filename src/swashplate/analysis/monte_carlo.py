"""Monte Carlo over a fit's uncertainty: drives drawn from the errors of its estimates."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite, sqrt
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.analysis.design_variables import with_factors
from swashplate.analysis.outcomes import Outcome, Trial, outcome_matrix
from swashplate.drive import Drive
from swashplate.errors import DomainError, InputError, ParameterError
from swashplate.identification import (
    DriveModel,
    Identification,
    StageFit,
    identifiability_of,
    uncertainty_of,
)
from swashplate.identification.estimation import LIMIT_COLUMNS, Forces
from swashplate.identification.statistics import effect_of_fixed, slopes_by
from swashplate.parameters import FULL_VOLTAGE, ParameterSet
from swashplate.results import Result

Array = NDArray[np.float64]

ERROR_OF_ASSUMED = 0.2
"""Standard deviation of an assumed parameter over its value: a guess takes 0.2 rad for the plate's
largest angle, machines have 0.25 to 0.35. [1]"""
STEP = 0.1
"""Step of a derivative along an error of the estimates, over the standard error. [1]"""
LARGEST_STEP = 0.05
"""Largest change of one of the solver's numbers in such a step. [1]"""
NEGLIGIBLE = 1e-12
"""Change of the solver's numbers that counts as none. [1]"""
MOST_REDRAWN = 20
"""Draws outside the model's domain for each one inside from which the drawing is given up."""
LARGEST_SHARE_REDRAWN = 0.1
"""Largest share of draws left out for which the bands do not count as too narrow. [1]"""

# --- drives that the tests allow ------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Draws(Result):
    """Drives that the tests allow."""

    drives: tuple[Drive, ...]
    redrawn: int
    """Draws that were outside the parameters' bounds or the model's domain, and drawn again."""
    fixed: tuple[str, ...] = ()
    """Parameters that stay as fitted: at a bound or not determined by the tests."""

    def with_factors(self, factors: Mapping[str, float]) -> Draws:
        """The same with design variables scaled on every drive."""
        return replace(self, drives=tuple(with_factors(drive, factors) for drive in self.drives))

    @property
    def columns(self) -> dict[str, Array]:
        """Every value of every drive by column, as `Drive.simulate_many` takes them. [SI]"""
        numbers = [drive.parameters.numbers for drive in self.drives]
        return {name: np.array([by_name[name] for by_name in numbers]) for name in numbers[0]}

    def sentences(self) -> tuple[str, ...]:
        """State the basis of the draws."""
        sentences = []
        if self.fixed:
            sentences.append(
                f"Not varied, with the fitted value in all drives: {', '.join(self.fixed)}; the "
                "bands do not include their errors."
            )
        attempts = self.redrawn + len(self.drives)
        if self.redrawn > LARGEST_SHARE_REDRAWN * attempts:
            sentences.append(
                f"The bands are too narrow: {100.0 * self.redrawn / attempts:.0f} % of the drives "
                "that the errors of the estimates allow lie beyond the parameters' bounds or the "
                "model's domain, and were left out. Widen the bounds in the fit setup, or fix the "
                "parameters that are not determined."
            )
        return tuple(sentences)


def drawn_drives(stages: Sequence[StageFit], draws: int = 200, seed: int = 0) -> Draws:
    """Drives that a fit's tests allow, drawn from the errors of its estimates.

    Parameters
    ----------
    stages : sequence of StageFit
        All stages of the fit.
    draws : int
        How many, at least 1.
    seed : int
        The same seed gives the same drives.

    Returns
    -------
    Draws
        The drives, and what was drawn again or stays fixed.

    Raises
    ------
    InputError
        If there is no stage or no draw, or nearly all draws leave the model's domain.

    Notes
    -----
    Errors are normal in the solver's vector, so that a logarithmic parameter is log-normal. What
    the card's stage does not know moves pump and motor as the fit would follow it: δ₁ = ε₁ and
    δ₂ = S δ₁ + ε₂ with independent normal ε, see `identification.intervals`. Fixed parameters with
    a standard uncertainty are drawn as well, and the estimates follow them.
    """
    if not stages:
        raise InputError("A Monte Carlo needs at least one stage of a fit.")
    if draws < 1:
        raise InputError(f"There must be at least one draw, not {draws}.")
    random = np.random.default_rng(seed)
    drives = list[Drive]()
    redrawn = 0
    while len(drives) < draws:
        parameters = _drawn(stages, random)
        if parameters is not None:
            drives.append(Drive(parameters))
            continue
        redrawn += 1
        if redrawn > MOST_REDRAWN * (len(drives) + 10):
            raise InputError(
                f"Of {redrawn + len(drives)} draws only {len(drives)} lie within the bounds "
                "and the model's domain: the errors are too large for a Monte Carlo; test more, or "
                "free fewer parameters."
            )
    fixed = []
    for stage in stages:
        determined = uncertainty_of(stage).own.determined
        for unknown, is_determined in zip(stage.problem.unknowns, determined, strict=True):
            if unknown.run is None and not is_determined:
                fixed.append(unknown.name)
    return Draws(tuple(drives), redrawn, tuple(fixed))


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


def standard_errors(
    stages: Sequence[StageFit],
    numbers: Callable[[Drive], Array],
    assumed: Sequence[Mapping[str, float]] = (),
) -> Array:
    """Standard errors of numbers of the fitted drive, from those of the estimates.

    Parameters
    ----------
    stages : sequence of StageFit
        All stages of the fit.
    numbers : callable
        From a drive to an array of any shape.
    assumed : sequence of mappings
        Standard deviations of other fixed numbers, by column, as of `assumed_parameters`. For
        each of them the estimates are refitted to first order, so that the drive still agrees
        with the tests. [SI]

    Raises
    ------
    InputError
        If no small step along an error keeps the bounds and the model's domain.

    Notes
    -----
    To first order: the root of the sum of squares of the numbers' changes for one standard error
    along each principal axis of every stage's covariance. The change is that of a step of a tenth
    of the standard error, or of 5 % of the parameter that moves most. Draws would leave the bounds
    if one estimate is hardly known; its neighbours, and what depends only on them, are known all
    the same.
    """
    base = numbers(stages[-1].drive)
    variance = np.zeros_like(base)
    for stage in stages:
        # unknowns of a single run are not part of the drive
        machine = stage.problem.unknowns.shared
        covariance = uncertainty_of(stage).own.matrix[np.ix_(machine, machine)]
        variances, axes = np.linalg.eigh(covariance)
        for variance_along, axis in zip(variances, axes.T, strict=True):
            error = np.zeros(len(stage.problem.unknowns))
            error[machine] = sqrt(max(variance_along, 0.0)) * axis
            if np.abs(error).max(initial=0.0) > NEGLIGIBLE:
                slope = _slope(stages, {stage.stage.name: error}, {}, numbers, base)
                variance += slope**2
    for effect in _effects(stages):
        variance += _slope(stages, {}, {effect: 1.0}, numbers, base) ** 2
    following = {stage.stage.name: slopes_by(stage, assumed) for stage in stages if assumed}
    for k, offsets in enumerate(assumed):
        errors = {name: slopes[:, k] for name, slopes in following.items()}
        variance += _slope(stages, errors, {}, numbers, base, offsets) ** 2
    return np.asarray(np.sqrt(variance))


def variances_from_bounds(
    stages: Sequence[StageFit], numbers: Callable[[Drive], Array], but: Collection[str] = ()
) -> dict[str, Array]:
    """Variances of numbers that go with each estimate at a bound, by its name.

    Of the machine's unknowns, `but` some. Arguments and errors are those of `standard_errors`,
    whose variances these are parts of; two estimates that go together share theirs.

    Notes
    -----
    To first order: the square of what the numbers change by for one standard error of the estimate,
    if it were free to move and all others followed it. An estimate at its bound is not where the
    data would have it: by how much it is off is not known, and that it is off to either side alike
    is wrong.
    """
    base = numbers(stages[-1].drive)
    variances = {}
    for stage in stages:
        covariance = uncertainty_of(stage).own.matrix
        unknowns = stage.problem.unknowns
        for name in set(identifiability_of(stage).at_bounds).difference(but):
            index = unknowns.names.index(name)
            deviation = sqrt(max(float(covariance[index, index]), 0.0))
            if unknowns[index].run is None and deviation > NEGLIGIBLE:
                errors = {stage.stage.name: covariance[index] / deviation}
                variances[name] = _slope(stages, errors, {}, numbers, base) ** 2
    return variances


def changes_left_open(
    stages: Sequence[StageFit], numbers: Callable[[Drive], Array], but: Collection[str] = ()
) -> Array:
    """Largest changes of numbers for 5 % along what the tests do not determine.

    Along each direction in which parameters can move together unseen, and for each parameter that
    no test exercises, `but` some. Arguments and errors are those of `standard_errors`.
    """
    base = numbers(stages[-1].drive)
    largest = np.zeros_like(base)
    for stage in stages:
        identifiability = identifiability_of(stage)
        names = stage.problem.unknowns.names
        directions = [direction.changes for direction in identifiability.null]
        directions += [{name: 1.0} for name in identifiability.unexcited if name not in but]
        for changes in directions:
            error = np.zeros(len(names))
            for name, change in changes.items():
                error[names.index(name)] = change
            slope = _slope(stages, {stage.stage.name: error}, {}, numbers, base)
            largest = np.maximum(largest, LARGEST_STEP * np.abs(slope))
    return largest


def _slope(
    stages: Sequence[StageFit],
    errors: Mapping[str, Array],
    effects: Mapping[str, float],
    numbers: Callable[[Drive], Array],
    base: Array,
    assumed: Mapping[str, float] = MappingProxyType({}),
) -> Array:
    """Directional derivative of numbers of the drive, by a small step along errors.

    The errors are those of the stages' vectors, of systematic effects by name, in standard
    uncertainties, and of assumed numbers. The uncertainties of a stage are computed at their first
    use, and kept with it.
    """
    largest = max((float(np.abs(error).max()) for error in errors.values()), default=0.0)
    for stage in stages:
        for effect, size in effects.items():
            change = size * uncertainty_of(stage).systematic.get(effect, np.zeros(1))
            largest = max(largest, float(np.abs(change).max()))
    first_step = min(STEP, LARGEST_STEP / largest) if largest else STEP
    for step in (first_step, -first_step, 0.1 * first_step, -0.1 * first_step):
        parameters = _with_errors(
            stages,
            {name: step * error for name, error in errors.items()},
            {effect: step * size for effect, size in effects.items()},
            {column: step * size for column, size in assumed.items()},
        )
        if parameters is not None:
            return np.asarray((numbers(Drive(parameters)) - base) / step)
    raise InputError(
        "A small step along the errors of the estimates leaves the bounds or the model's domain "
        "in both directions: widen the bounds, or free fewer parameters."
    )


def _drawn(stages: Sequence[StageFit], random: np.random.Generator) -> ParameterSet | None:
    """A set with drawn errors of each stage's vector; None outside bounds or domain."""
    names = _effects(stages)
    effects = dict(zip(names, random.normal(size=len(names)).tolist(), strict=True))
    errors = {}
    for stage in stages:
        covariance = uncertainty_of(stage).own.matrix
        errors[stage.stage.name] = random.multivariate_normal(
            np.zeros(len(covariance)), covariance, check_valid="ignore", method="eigh"
        )
    return _with_errors(stages, errors, effects)


def _effects(stages: Sequence[StageFit]) -> list[str]:
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


def _with_errors(
    stages: Sequence[StageFit],
    own_errors: Mapping[str, Array],
    effects: Mapping[str, float],
    assumed: Mapping[str, float] = MappingProxyType({}),
) -> ParameterSet | None:
    """A set with errors of each stage's vector, 0 if none is given; None outside bounds or domain.

    `effects` are systematic effects, fixed numbers among them, in standard uncertainties; `assumed`
    are errors of other fixed numbers.
    """
    model = stages[0].problem.model
    assert isinstance(model, DriveModel)
    parameters = model.parameters
    fixed = {
        name: parameters.numbers[name] + size * effects.get(effect_of_fixed(together), 0.0)
        for together in stages[0].problem.uncertain
        for name, size in together.items()
    }
    fixed |= {column: parameters.numbers[column] + size for column, size in assumed.items()}
    errors = dict[str, Array]()  # of each stage, by its name
    try:
        if fixed:
            parameters = parameters.with_numbers(fixed, parameters.options)
        for stage in stages:
            problem = stage.problem
            assert isinstance(problem.model, DriveModel)
            uncertainty = uncertainty_of(stage)
            error = own_errors.get(stage.stage.name, np.zeros(len(problem.unknowns)))
            for earlier in uncertainty.earlier_stages:
                error = error + earlier.slopes @ errors[earlier.stage]
            errors[stage.stage.name] = error
            vector = stage.solution.vector + error
            for effect, size in effects.items():
                if effect in uncertainty.systematic:
                    vector = vector + size * uncertainty.systematic[effect]
            low, high = problem.unknowns.bounds
            beyond = (vector < low) | (vector > high)
            if beyond[uncertainty.own.determined].any():
                return None
            # a new model: the fitted one keeps what it computed for other parameters
            fresh = DriveModel(parameters, problem.model.part, forces=problem.model.forces)
            parameters = fresh.parameters_at(problem.unknowns.targets(vector, ""))
    except (DomainError, ParameterError):
        return None
    return parameters


# --- drives of a stored fit -----------------------------------------------------------------------


def stored_draws(
    folder: str | Path,
    *,
    drive: Drive | None = None,
    campaign: str | Path | None = None,
    draws: int = 200,
    seed: int = 0,
) -> Draws:
    """Drives that the tests allow, from the folder that a fit wrote.

    Parameters
    ----------
    folder : path
        With ``fit.json``.
    drive : Drive, optional
        What the draws are to belong to: refused if it is not the fitted one.
    campaign : path, optional
        The tests that were fitted; by default those that ``fit.json`` names. They are needed
        for the whole covariance.
    draws, seed : int
        As of `drawn_drives`.

    Returns
    -------
    Draws
        The drives, and what was drawn again or stays fixed.

    Raises
    ------
    FileError, InputError, ParameterError
        If the folder holds no fit, or campaign or drive are not those of the fit.
    """
    path = Path(folder)
    fit = Identification.load(path, campaign).fit
    if drive is not None:
        numbers = drive.parameters.numbers
        fitted = fit.drive.parameters.numbers
        different = [name for name, value in fitted.items() if numbers[name] != value]
        if different:
            raise InputError(
                f"The fit in {path} belongs to another drive ({', '.join(different[:3])} differ): "
                f"give its fitted drive, {path}."
            )
    return drawn_drives(fit.stages, draws, seed)


# --- bands ----------------------------------------------------------------------------------------

MOST_SAMPLES = 150_000_000  # Samples of speed that are kept at once: 1.2 GB.


class BandWidth(NamedTuple):
    """Width of a band at an instant."""

    width: float
    """[rad/s]"""
    time: float
    """[s]"""


@dataclass(frozen=True, eq=False)
class Bands(Result):
    """Bands of the speed at each instant, and of each outcome."""

    time: Array  # (n,) [s]
    lower: Array  # (n,) [rad/s]
    median: Array  # (n,) [rad/s]
    upper: Array  # (n,) [rad/s]
    half_widths: Array
    """(2 + K,) half of the intervals of the speed limits, positive and negative [rad/s], and of
    each outcome in its unit."""
    level: float
    """Share of the drives between lower and upper, instant by instant. [1]"""
    draws: int
    """Drives that it is taken from."""

    @property
    def widest(self) -> BandWidth:
        """The largest width of the band."""
        width = self.upper - self.lower
        index = int(np.argmax(width))
        return BandWidth(float(width[index]), float(self.time[index]))


def bands(
    drawn: Draws, trial: Trial, outcomes: Sequence[Outcome] = (), *, level: float = 0.95
) -> Bands:
    """Band of the shaft's speed over drawn drives, instant by instant, and of their outcomes.

    Parameters
    ----------
    drawn : Draws
        See `drawn_drives`.
    trial : Trial
        The command, from rest.
    outcomes : sequence of Outcome
        Outcomes whose intervals are computed, such as `WhatIf.outcomes`.
    level : float
        Share of the drives within the band, between 0 and 1.

    Raises
    ------
    InputError
        If the level is not between 0 and 1, or the record is too long for so many drives.
    DomainError
        If a drive leaves the model's domain under the command.
    """
    if not 0.0 < level < 1.0:
        raise InputError(f"The level {level:g} of a band must lie between 0 and 1.")
    count = len(drawn.drives)
    size = trial.voltage.size
    if size * count > MOST_SAMPLES:
        raise InputError(
            f"{count} drives over {size} samples take too much memory: use {MOST_SAMPLES // size} "
            "drives at most, or give the command at a lower rate."
        )
    run = drawn.drives[0].simulate_many(drawn.columns, voltage=trial.voltage, rate=trial.rate)
    if run.failures:
        why = next(iter(run.failures.values()))
        raise DomainError(f"A drawn drive cannot be simulated: {why}")
    assert run.output is not None
    shares = 0.5 - 0.5 * level, 0.5, 0.5 + 0.5 * level
    limits = [drive.steady_speed([FULL_VOLTAGE, -FULL_VOLTAGE]) for drive in drawn.drives]
    numbers = np.column_stack([limits, outcome_matrix(run.output, trial, outcomes)])
    low, _, high = np.quantile(numbers, shares, axis=0)
    lower, median, upper = np.quantile(run.output, shares, axis=0, overwrite_input=True)
    return Bands(
        time=trial.time,
        lower=lower,
        median=median,
        upper=upper,
        half_widths=0.5 * (high - low),
        level=level,
        draws=count,
    )
