"""Drives that the tests allow, drawn from errors of estimates."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swashplate.analysis.levers import pulled
from swashplate.drive import Drive
from swashplate.errors import InputError, ParameterError
from swashplate.parameters.definitions import columns_of
from swashplate.parameters.parameter_set import ParameterSet

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
