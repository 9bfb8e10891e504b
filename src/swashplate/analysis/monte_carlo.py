"""Monte Carlo over a fit's uncertainty: drives drawn from the errors of its estimates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from swashplate.analysis.outcomes import Outcome, Trial, outcome_matrix
from swashplate.analysis.whatif import pulled
from swashplate.drive import Drive
from swashplate.errors import DomainError, InputError, ParameterError
from swashplate.identification.assessment import Identification
from swashplate.identification.drive_model import DriveModel
from swashplate.identification.fitting import StageFit
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.results import Result

Array = NDArray[np.float64]

MOST_REDRAWN, NARROWED = 20, 0.1
"""Draws outside the model's domain for each one inside from which the drawing is given up, and part
of all draws from which those that were left out narrow the bands."""

# --- drives that the tests allow ------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Draws(Result):
    """Drives that the tests allow."""

    drives: tuple[Drive, ...]
    redrawn: int
    """Draws that were outside the parameters' bounds or the model's domain, and drawn again."""
    fixed: tuple[str, ...] = ()
    """Parameters that stay as fitted: at a bound or not determined by the tests."""

    def pulled(self, factors: Mapping[str, float]) -> Draws:
        """The same with levers moved on every drive."""
        return replace(self, drives=tuple(pulled(each, factors) for each in self.drives))

    @property
    def columns(self) -> dict[str, Array]:
        """Every value of every drive by column, as `Drive.simulate_many` takes them. [SI]"""
        numbers = [each.parameters.numbers for each in self.drives]
        return {name: np.array([each[name] for each in numbers]) for name in numbers[0]}

    def sentences(self) -> tuple[str, ...]:
        """What the draws rest on."""
        said = []
        if self.fixed:
            said.append(
                f"Not drawn, as fitted in all drives: {', '.join(self.fixed)}; the bands leave out "
                "what their errors would add."
            )
        drawn = self.redrawn + len(self.drives)
        if self.redrawn > NARROWED * drawn:
            said.append(
                f"The bands are too narrow: {100.0 * self.redrawn / drawn:.0f} % of the drives "
                "that the errors of the estimates allow lie beyond the parameters' bounds or the "
                "model's domain, and were left out. Widen the bounds in the fit configuration, or "
                "fix the parameters that are not determined."
            )
        return tuple(said)


def drives(stages: Sequence[StageFit], draws: int = 200, seed: int = 0) -> Draws:
    """Drives that a fit's tests allow, drawn from the errors of its estimates.

    Parameters
    ----------
    stages : sequence of StageFit
        All stages of the fit.
    draws : int
        How many, at least 1.
    seed : int
        The same seed gives the same drives.

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
    random, made, redrawn = np.random.default_rng(seed), list[Drive](), 0
    while len(made) < draws:
        parameters = _drawn(stages, random)
        if parameters is not None:
            made.append(Drive(parameters))
            continue
        redrawn += 1
        if redrawn > MOST_REDRAWN * (len(made) + 10):
            raise InputError(
                f"Of {redrawn + len(made)} draws only {len(made)} lie within the bounds "
                "and the model's domain: the errors are too large for a Monte Carlo; test more, or "
                "free fewer parameters."
            )
    fixed = tuple(
        unknown.name
        for each in stages
        for unknown, determined in zip(
            each.problem.unknowns, each.uncertainty.own.determined, strict=True
        )
        if not determined and unknown.run is None
    )
    return Draws(tuple(made), redrawn, fixed)


def _drawn(stages: Sequence[StageFit], random: np.random.Generator) -> ParameterSet | None:
    """A set with each stage's vector off by a drawn error, None outside bounds or domain."""
    model, uncertain = stages[0].problem.model, stages[0].problem.uncertain
    assert isinstance(model, DriveModel)
    parameters = model.parameters
    # of the fixed numbers, in standard uncertainties
    off = random.normal(size=len(uncertain))
    fixed = {
        name: parameters.numbers[name] + size * each
        for together, each in zip(uncertain, off.tolist(), strict=True)
        for name, size in together.items()
    }
    errors = dict[str, Array]()  # of each stage, by its name
    try:
        if fixed:
            parameters = parameters.replace(fixed, parameters.options)
        for each in stages:
            problem, known, own = each.problem, each.uncertainty, each.uncertainty.own.matrix
            assert isinstance(problem.model, DriveModel)
            error = random.multivariate_normal(
                np.zeros(len(own)), own, check_valid="ignore", method="eigh"
            )
            for handed in known.handed:
                error = error + handed.slopes @ errors[handed.stage]
            errors[each.stage.name] = error
            vector = each.solution.vector + error + known.fixed @ off
            low, high = problem.unknowns.bounds
            if ((vector < low) | (vector > high))[known.own.determined].any():
                return None
            # a model of its own: the fitted one keeps what it made for other parameters
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
        The tests that were fitted; by default where ``fit.json`` says they were. They are needed
        for the whole covariance.
    draws, seed :
        As of `drives`.

    Raises
    ------
    FileError, InputError, ParameterError
        If the folder holds no fit, or campaign or drive are not those of the fit.
    """
    place = Path(folder)
    fit = Identification.load(place, campaign).fit
    if drive is not None:
        given, found = drive.parameters.numbers, fit.drive.parameters.numbers
        other = [name for name, value in found.items() if given[name] != value]
        if other:
            raise InputError(
                f"The fit in {place} is that of another drive ({', '.join(other[:3])} differ): "
                f"give the drive that it found, {place}."
            )
    return drives(fit.stages, draws, seed)


# --- bands ----------------------------------------------------------------------------------------

MOST_SAMPLES = 150_000_000  # Samples of speed that are kept at once: 1.2 GB.


@dataclass(frozen=True, eq=False)
class Bands(Result):
    """Where the speed lies at each instant, and each outcome."""

    time: Array  # (n,) [s]
    lower: Array  # (n,) [rad/s]
    median: Array  # (n,) [rad/s]
    upper: Array  # (n,) [rad/s]
    half_widths: Array
    """(2 + K,) half of the intervals of the speed limits, positive and negative [rad/s], and of
    each outcome in its unit."""
    level: float  # Part of the drives between lower and upper, instant by instant.
    draws: int  # Drives that it is taken from.

    @property
    def widest(self) -> tuple[float, float]:
        """Largest width [rad/s] and when. [s]"""
        width = self.upper - self.lower
        at = int(np.argmax(width))
        return float(width[at]), float(self.time[at])


def bands(
    drawn: Draws, trial: Trial, outcomes: Sequence[Outcome] = (), *, level: float = 0.95
) -> Bands:
    """Band of the shaft's speed over drawn drives, instant by instant, and of their outcomes.

    Parameters
    ----------
    drawn : Draws
        See `drives`.
    trial : Trial
        The command, from rest.
    outcomes : sequence of Outcome
        Of which intervals are wanted, such as `WhatIf.outcomes`.
    level : float
        Part of the drives within the band, between 0 and 1.

    Raises
    ------
    InputError
        If the level is none, or the record is too long for so many drives.
    DomainError
        If a drive leaves the model's domain under the command.
    """
    if not 0.0 < level < 1.0:
        raise InputError(f"The level {level:g} of a band must lie between 0 and 1.")
    count, size = len(drawn.drives), trial.voltage.size
    if size * count > MOST_SAMPLES:
        raise InputError(
            f"{count} drives over {size} samples take too much memory: take "
            f"{MOST_SAMPLES // size} drives at most, or give the command at a lower rate."
        )
    run = drawn.drives[0].simulate_many(drawn.columns, voltage=trial.voltage, rate=trial.rate)
    if run.failures:
        why = next(iter(run.failures.values()))
        raise DomainError(f"A drawn drive cannot be simulated: {why}")
    assert run.output is not None
    parts = 0.5 - 0.5 * level, 0.5, 0.5 + 0.5 * level
    limits = [each.steady_speed([FULL_VOLTAGE, -FULL_VOLTAGE]) for each in drawn.drives]
    found = np.column_stack([limits, outcome_matrix(run.output, trial, outcomes)])
    low, _, high = np.quantile(found, parts, axis=0)
    lower, median, upper = np.quantile(run.output, parts, axis=0, overwrite_input=True)
    return Bands(trial.time, lower, median, upper, 0.5 * (high - low), level, count)
