"""Monte Carlo over a fit's uncertainty: drives drawn from the errors of its estimates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.analysis.design_variables import with_factors
from swashplate.analysis.outcomes import Outcome, Trial, outcome_matrix
from swashplate.analysis.propagation import drive_model_of, effects_on, set_at
from swashplate.drive import Drive
from swashplate.errors import DomainError, InputError
from swashplate.identification import Identification, Optimum, uncertainty_of
from swashplate.identification.statistics import effect_of_fixed
from swashplate.parameters import FULL_VOLTAGE, ParameterSet
from swashplate.results import Result

Array = NDArray[np.float64]

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


def drawn_drives(fit: Optimum, draws: int = 200, seed: int = 0) -> Draws:
    """Drives that a fit's tests allow, drawn from the errors of its estimates.

    Parameters
    ----------
    fit : Optimum
        Of a drive.
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
        If there is no draw, or nearly all draws leave the model's domain.

    Notes
    -----
    Errors are normal in the solver's vector, so that a logarithmic parameter is log-normal. Fixed
    parameters with a standard uncertainty are drawn as well, and the estimates follow them.
    """
    if draws < 1:
        raise InputError(f"There must be at least one draw, not {draws}.")
    random = np.random.default_rng(seed)
    drives = list[Drive]()
    redrawn = 0
    while len(drives) < draws:
        parameters = _drawn(fit, random)
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
    determined = uncertainty_of(fit).own.determined
    fixed = [
        unknown.name
        for unknown, is_determined in zip(fit.problem.unknowns, determined, strict=True)
        if unknown.run is None and not is_determined
    ]
    return Draws(tuple(drives), redrawn, tuple(fixed))


def _drawn(fit: Optimum, random: np.random.Generator) -> ParameterSet | None:
    """A set with drawn errors of the vector; None outside bounds or domain."""
    names = effects_on(fit)
    effects = dict(zip(names, random.normal(size=len(names)).tolist(), strict=True))
    uncertainty = uncertainty_of(fit)
    covariance = uncertainty.own.matrix
    vector = fit.solution.vector + random.multivariate_normal(
        np.zeros(len(covariance)), covariance, check_valid="ignore", method="eigh"
    )
    for effect, size in effects.items():
        if effect in uncertainty.systematic:
            vector = vector + size * uncertainty.systematic[effect]
    low, high = fit.problem.unknowns.bounds
    if ((vector < low) | (vector > high))[uncertainty.own.determined].any():
        return None
    numbers = drive_model_of(fit).parameters.numbers
    fixed = {
        name: numbers[name] + size * effects.get(effect_of_fixed(together), 0.0)
        for together in fit.problem.uncertain
        for name, size in together.items()
    }
    return set_at(fit, vector, fixed)


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
    return drawn_drives(fit, draws, seed)


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
