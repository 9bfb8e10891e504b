"""Monte Carlo over a fit's uncertainty: drives drawn from the errors of its estimates."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from json import JSONDecodeError, loads
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.analysis.outcomes import batch_outcomes
from swashplate.analysis.whatif import WhatIf, pulled
from swashplate.campaign import Campaign
from swashplate.documents import read_text
from swashplate.drive import Drive
from swashplate.errors import DomainError, FileError, InputError, ParameterError
from swashplate.identification.assessment import Assessment, assess
from swashplate.identification.drive_model import DriveModel
from swashplate.identification.storing import load_fit
from swashplate.parameters.definitions import CATALOGUE, COLUMNS, columns_of
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.rules import FULL_VOLTAGE

# --- draws ----------------------------------------------------------------------------------------


Array = NDArray[np.float64]

MOST_REDRAWN = 20
"""Draws outside the model's domain for each one inside from which the drawing is given up."""


@dataclass(frozen=True, eq=False)
class Draws:
    """Drives that the tests allow."""

    drives: tuple[Drive, ...]
    redrawn: int
    """Draws that were outside the unknowns' bounds or the model's domain, and drawn again."""
    held: tuple[str, ...] = ()
    """Unknowns that stay as fitted: at a bound, not determined by the tests, or without error."""
    correlated: bool = True
    """Whether errors were drawn together; if not, each by itself, which widens most bands."""

    def pulled(self, factors: Mapping[str, float]) -> Draws:
        """The same with levers moved on every drive."""
        moved = tuple(pulled(each, factors) for each in self.drives)
        return Draws(moved, self.redrawn, self.held, self.correlated)

    @property
    def columns(self) -> dict[str, Array]:
        """Every value of every drive by column, as `Drive.simulate_many` takes them. [SI]"""
        numbers = [each.parameters.numbers for each in self.drives]
        return {name: np.array([each[name] for each in numbers]) for name in numbers[0]}

    def sentences(self) -> tuple[str, ...]:
        """What the draws rest on."""
        said = []
        if not self.correlated:
            said.append(
                "Correlations ignored: each estimate is drawn by its own standard error, which "
                "makes most bands wider than they are."
            )
        if self.held:
            said.append(
                f"Not drawn, as fitted in all drives: {', '.join(self.held)}; the bands leave out "
                "what their errors would add."
            )
        if self.redrawn:
            said.append(
                f"{self.redrawn} draws lay outside bounds or the model's domain and were drawn "
                "again."
            )
        return tuple(said)


def independent_drives(
    drive: Drive, standard_errors: Mapping[str, float], draws: int = 200, seed: int = 0
) -> Draws:
    """Drives about a fitted one, each estimate drawn by itself.

    For fits of which no more than standard errors are left: the correlations of the estimates, in
    which errors largely cancel, are ignored.

    Parameters
    ----------
    drive : Drive
        As fitted.
    standard_errors : mapping of str to float
        By symbol (one error for both directions, which move together) or column. [SI]
    draws, seed :
        As of `monte_carlo.drives`.

    Raises
    ------
    InputError
        If an error is negative or not finite, none is given, or nearly all draws leave the model's
        domain.
    ParameterError
        For an unknown parameter.
    """
    for name, error in standard_errors.items():
        if not (np.isfinite(error) and error >= 0.0):
            raise InputError(
                f"The standard error of {name} is {error:g}, but must be a finite number, 0 or "
                "more."
            )
    if not standard_errors:
        raise InputError("A Monte Carlo needs the standard error of at least one parameter.")
    random = np.random.default_rng(seed)
    numbers = drive.parameters.numbers

    def once() -> ParameterSet | None:
        changes: dict[str, float] = {}
        for name, error in standard_errors.items():
            shift = float(error * random.normal())
            for column in columns_of([name]):
                changes[column] = numbers[column] + shift
        try:
            return drive.parameters.replace(changes)
        except ParameterError:
            return None

    columns_of(list(standard_errors))  # refuses an unknown name before anything is drawn
    return filled(once, draws, (), False)


def filled(
    once: Callable[[], ParameterSet | None], draws: int, held: tuple[str, ...], correlated: bool
) -> Draws:
    """As many drives as wanted; what could not be drawn is drawn again.

    Parameters
    ----------
    once : callable
        Draws a parameter set, None if the draw lies outside of bounds or domain.
    draws : int
        How many, at least 1.
    held, correlated :
        As in `Draws`.

    Raises
    ------
    InputError
        If there is no draw, or nearly all lie outside.
    """
    if draws < 1:
        raise InputError(f"There must be at least one draw, not {draws}.")
    made: list[Drive] = []
    redrawn = 0
    while len(made) < draws:
        parameters = once()
        if parameters is not None:
            made.append(Drive(parameters))
            continue
        redrawn += 1
        if redrawn > MOST_REDRAWN * (len(made) + 10):
            raise InputError(
                f"Of {redrawn + len(made)} draws only {len(made)} lie within the unknowns' bounds "
                "and the model's domain: the errors are too large for a Monte Carlo; test more, or "
                "free fewer parameters."
            )
    return Draws(tuple(made), redrawn, held, correlated)


# --- monte carlo ----------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Deviations:
    """Errors of one stage's vector."""

    own: Array
    """(K, K) covariance of its own noise."""
    slopes: Mapping[int, Array] = field(default_factory=dict)
    """By the number of an earlier stage (K, K_earlier): by how much its errors move this one's."""

    @cached_property
    def axes(self) -> tuple[Array, Array]:
        """(K,) standard deviations along the covariance's own axes, and (K, K) these as columns."""
        values, directions = np.linalg.eigh(self.own)
        return np.sqrt(np.maximum(values, 0.0)), directions


def draw_deviations(stages: Sequence[Deviations], random: np.random.Generator) -> tuple[Array, ...]:
    """Errors of all stages' vectors, drawn together.

    Parameters
    ----------
    stages : sequence of Deviations
        In the order of the fit.
    random : Generator
        Source of the numbers.

    Returns
    -------
    tuple of (K,) arrays
        For each stage.

    Notes
    -----
    δ₁ = ε₁ and δ₂ = S δ₁ + ε₂ with independent normal ε: then cov(δ₂) = S cov(δ₁) Sᵀ + own, which
    is the quoted covariance, and cov(δ₂, δ₁) = S cov(δ₁).
    """
    drawn: list[Array] = []
    for each in stages:
        deviations, directions = each.axes
        error = directions @ (deviations * random.normal(size=deviations.size))
        for earlier, slopes in each.slopes.items():
            error = error + slopes @ drawn[earlier]
        drawn.append(error)
    return tuple(drawn)


def drives(assessments: Sequence[Assessment], draws: int = 200, seed: int = 0) -> Draws:
    """Drives that a fit's tests allow, drawn from the errors of its estimates.

    Parameters
    ----------
    assessments : sequence of Assessment
        Of all stages of the fit, see `identification.assessment.assess`.
    draws : int
        How many, at least 1.
    seed : int
        The same seed gives the same drives.

    Raises
    ------
    InputError
        If there is no assessment or no draw, or nearly all draws leave the model's domain.

    Notes
    -----
    Errors are normal in the solver's vector, so that a logarithmic unknown is log-normal. What the
    card's stage does not know moves pump and motor as the fit would follow it, see
    `identification.uncertainty`.
    """
    if not assessments:
        raise InputError("A Monte Carlo needs the assessment of at least one stage.")
    stages = [_deviations(assessments, number) for number in range(len(assessments))]
    random = np.random.default_rng(seed)

    def once() -> ParameterSet | None:
        parameters: ParameterSet | None = None
        for each, error in zip(assessments, draw_deviations(stages, random), strict=True):
            problem, model = each.stage.problem, each.stage.problem.model
            assert isinstance(model, DriveModel)
            vector = each.stage.solution.vector + error
            low, high = problem.unknowns.bounds
            free = each.uncertainty.own.determined
            if ((vector < low) | (vector > high))[free].any():
                return None
            begin = model.parameters if parameters is None else parameters
            try:
                # a model of its own: the fitted one keeps what it made for other parameters
                parameters = DriveModel(begin, model.part, forces=model.forces).parameters_at(
                    problem.unknowns.targets(vector, "")
                )
            except DomainError:
                return None
        return parameters

    held = tuple(
        name
        for each in assessments
        for name, unknown, known in zip(
            each.stage.problem.unknowns.names,
            each.stage.problem.unknowns,
            each.uncertainty.own.determined,
            strict=True,
        )
        if not known and unknown.run is None
    )
    return filled(once, draws, held, True)


def _deviations(assessments: Sequence[Assessment], number: int) -> Deviations:
    found = assessments[number].uncertainty
    slopes = {
        earlier: each.slopes
        for each in found.handed
        for earlier in range(number)
        if assessments[earlier].uncertainty.quoted is each.covariance
    }
    return Deviations(found.own.matrix, slopes)


# --- stored draws ---------------------------------------------------------------------------------


STORED, ESTIMATES, FITTED = "fit.json", "estimates.csv", "drive.toml"
"""Files of a fit."""


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
        With ``fit.json``, or with ``drive.toml`` and ``estimates.csv``, which know nothing of
        correlations.
    drive : Drive, optional
        What the draws are to belong to: refused if it is not the fitted one.
    campaign : path, optional
        The tests that were fitted; by default where ``fit.json`` says they were. They are needed
        for the whole covariance.
    draws, seed :
        As of `monte_carlo.drives`.

    Raises
    ------
    FileError, InputError, ParameterError
        If the folder holds neither, or campaign or drive are not those of the fit.
    """
    place = Path(folder)
    if (place / STORED).is_file():
        tests = _campaign_of(place / STORED) if campaign is None else Path(campaign)
        if campaign is None and not tests.is_file():
            raise InputError(
                f"{place / STORED} was fitted to {tests}, which is not there: say where the "
                "campaign is."
            )
        stored = load_fit(place / STORED, Campaign.from_toml(tests))
        _check_same(drive, stored.fit.drive, place)
        return drives(assess(stored.fit.stages), draws, seed)
    if not (place / ESTIMATES).is_file():
        raise InputError(
            f"{place} holds neither {STORED} nor {ESTIMATES}: give a folder that a fit wrote."
        )
    fitted = Drive.from_toml(place / FITTED)
    _check_same(drive, fitted, place)
    errors, left_out = _standard_errors(place / ESTIMATES)
    made = independent_drives(fitted, errors, draws, seed)
    return Draws(made.drives, made.redrawn, left_out, correlated=False)


def _check_same(drive: Drive | None, fitted: Drive, place: Path) -> None:
    if drive is None:
        return
    given, found = drive.parameters.numbers, fitted.parameters.numbers
    other = [name for name, value in found.items() if given[name] != value]
    if other:
        raise InputError(
            f"The fit in {place} is that of another drive ({', '.join(other[:3])} differ): give "
            f"the drive that it found, {place}."
        )


def _campaign_of(path: Path) -> Path:
    try:
        content = loads(read_text(path))
        return Path(content["campaign"])
    except (JSONDecodeError, KeyError, TypeError) as error:
        raise FileError(f"{path} is no stored fit: {error}.") from None


def _standard_errors(path: Path) -> tuple[dict[str, float], tuple[str, ...]]:
    """Standard errors of parameters, and the unknowns of the machine that have none."""
    import polars as pl
    from polars.exceptions import PolarsError

    try:
        table = pl.read_csv(path)
    except (OSError, PolarsError) as error:
        raise FileError(f"{path} cannot be read: {error}.") from None
    missing = {"unknown", "standard error"} - set(table.columns)
    if missing:
        raise FileError(f"{path} has no column '{min(missing)}'; give what 'swashplate fit' wrote.")
    errors: dict[str, float] = {}
    left_out = []
    for row, (name, given) in enumerate(table.select("unknown", "standard error").rows(), start=2):
        if name not in CATALOGUE and name not in COLUMNS:
            if "(" not in str(name):  # a number of one test, such as its free zero
                left_out.append(str(name))
        elif given is None:
            left_out.append(name)
        else:
            errors[name] = _number(given, path, row)
    if not errors:
        raise FileError(f"{path} has no parameter with a standard error: nothing can be drawn.")
    return errors, tuple(left_out)


def _number(text: object, path: Path, row: int) -> float:
    try:
        return float(str(text))
    except ValueError:
        raise FileError(f"{path}, row {row}: the standard error '{text}' is no number.") from None


# --- bands ----------------------------------------------------------------------------------------


MOST_SAMPLES = 150_000_000
"""Samples of speed that a band may take: 1.2 GB."""


@dataclass(frozen=True, eq=False)
class Bands:
    """Where the speed lies at each instant."""

    time: Array
    """(n,) [s]"""
    lower: Array
    """(n,) [rad/s]"""
    median: Array
    """(n,) [rad/s]"""
    upper: Array
    """(n,) [rad/s]"""
    level: float
    """Part of the drives between lower and upper, instant by instant."""
    draws: int
    """Drives that it is taken from."""

    @property
    def widest(self) -> tuple[float, float]:
        """Largest width [rad/s] and when. [s]"""
        width = self.upper - self.lower
        at = int(np.argmax(width))
        return float(width[at]), float(self.time[at])


def bands(drawn: Draws, voltage: ArrayLike, rate: float = 512.0, *, level: float = 0.95) -> Bands:
    """Band of the shaft's speed over drawn drives, instant by instant.

    Parameters
    ----------
    drawn : Draws
        See `monte_carlo.drives`.
    voltage : (n,) array_like
        Command, from rest. [V]
    rate : float
        Samples a second. [Hz]
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
    volts = np.asarray(voltage, dtype=np.float64)
    count = len(drawn.drives)
    if volts.size * count > MOST_SAMPLES:
        raise InputError(
            f"A band of {count} drives over {volts.size} samples takes too much memory: draw "
            f"{MOST_SAMPLES // volts.size} drives at most, or give the command at a lower rate."
        )
    run = drawn.drives[0].simulate_many(drawn.columns, voltage=volts, rate=rate)
    if run.failures:
        raise DomainError(f"A drawn drive cannot be simulated: {next(iter(run.failures.values()))}")
    assert run.output is not None
    run.output.sort(axis=0)
    tail = 0.5 * (1.0 - level)
    lower, median, upper = (_quantile(run.output, part) for part in (tail, 0.5, 1.0 - tail))
    return Bands(np.arange(volts.size) / rate, lower, median, upper, level, count)


def _quantile(ordered: Array, part: float) -> Array:
    """(n,) quantile of each column of sorted (m, n) values, between neighbours in proportion."""
    place = part * (len(ordered) - 1)
    below = int(place)
    above = min(below + 1, len(ordered) - 1)
    between: Array = ordered[below] + (place - below) * (ordered[above] - ordered[below])
    return between


def half_widths(result: WhatIf, draws: Draws, level: float = 0.95) -> Array:
    """Half of the intervals that hold most of the drives drawn.

    Parameters
    ----------
    result : WhatIf
        Whose outcomes are meant.
    draws : Draws
        Of one of its variants.
    level : float
        Part of the drives within the interval.

    Returns
    -------
    (2 + m,) array
        Of the speed limits, positive and negative [rad/s], and of each outcome in its unit.
    """
    found = batch_outcomes(draws.drives[0], draws.columns, result.trial, result.outcomes)
    speeds = [each.steady_speed([FULL_VOLTAGE, -FULL_VOLTAGE]) for each in draws.drives]
    values = np.column_stack([np.array(speeds), found.values])
    low, high = np.quantile(values, [0.5 - 0.5 * level, 0.5 + 0.5 * level], axis=0)
    widths: Array = 0.5 * (high - low)
    return widths
