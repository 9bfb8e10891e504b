"""A fit at its optimum: plain data, from which everything else is computed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, wraps
from typing import Any, Literal, NamedTuple, TypeVar, cast

from swashplate.campaign import Experiment
from swashplate.drive import Drive
from swashplate.errors import InputError
from swashplate.identification.estimation.fit_problem import Parameters
from swashplate.identification.estimation.model_setup import ModelSetup
from swashplate.identification.estimation.problem import LinearisedFit, Problem, linearised_fit
from swashplate.identification.estimation.setup import FitSetup
from swashplate.identification.estimation.solving import Solution
from swashplate.identification.validation import RunQuality, run_qualities
from swashplate.results import Result

Outcome = TypeVar("Outcome")
Status = Literal[
    "estimated",
    "at its lower bound",
    "at its upper bound",
    "undetermined",
    "no lower end",
    "no upper end",
    "from the forces",
    "fixed",
]
"""How an estimate came about: ``"from the forces"`` are the solenoids' coefficients that stand for
estimated forces, ``"fixed"`` is what the fit did not move."""


class Interval(NamedTuple):
    """Status, standard error and interval of an estimate."""

    status: Status
    standard_error: float | None = None
    """None unless estimated."""
    lower: float | None = None
    """None if there is no end."""
    upper: float | None = None


@dataclass(frozen=True, eq=False)
class Optimum(Result):
    """A problem, its optimum, and the parameters with it.

    Its estimates with their intervals are those of `estimates_of`; `uncertainty_of` and
    `identifiability_of` say what they rest on.
    """

    setup: FitSetup
    nominal: Parameters
    """What the fit began from."""
    runs: tuple[Experiment, ...] = field(repr=False)
    """All that were to be fitted, as the campaign has them."""
    problem: Problem
    solution: Solution
    parameters: Parameters
    """The drive, or the user-defined model, with what was found."""
    starts: tuple[Solution, ...] = ()
    """End of each start, if there was more than one."""
    stored: tuple[Interval, ...] | None = field(default=None, repr=False)
    """What is known of each unknown's error, if it was computed before, such as by the fit that a
    folder holds."""
    _analyses: dict[str, Any] = field(default_factory=dict, repr=False, init=False)
    """See `once_per_fit`."""

    @property
    def values(self) -> dict[str, float]:
        """The unknowns by name, in their units."""
        return self.problem.unknowns.values(self.solution.vector)

    @property
    def drive(self) -> Drive:
        """The drive with what was found; an `InputError` if it is a user-defined model."""
        if isinstance(self.parameters, ModelSetup):
            raise InputError(f"{self.parameters.name} is a user-defined model, not a drive.")
        return Drive(self.parameters)

    @property
    def interrupted(self) -> bool:
        """Whether the search was stopped before its end."""
        return self.solution.interrupted

    @cached_property
    def linearised(self) -> LinearisedFit:
        """Residuals and derivatives at the optimum."""
        return linearised_fit(self.problem, self.solution.vector, self.solution.loss)

    @cached_property
    def qualities(self) -> tuple[RunQuality, ...]:
        """Quality of each channel of each run that was fitted."""
        return run_qualities(self.problem, self.solution.vector)


def once_per_fit(analysis: Callable[[Optimum], Outcome]) -> Callable[[Optimum], Outcome]:
    """Cache an analysis of a fit with the fit: it is computed on its first call.

    Verdict, tables, report and files ask for the same analyses, which take seconds. They are kept
    with the fit, so that they go when it goes, and go with it to other processes: some refer to
    their fit, and a table of weak references would keep both for ever. An error is not kept.
    """
    key = f"{analysis.__module__}.{analysis.__qualname__}"

    @wraps(analysis)
    def cached_analysis(fit: Optimum) -> Outcome:
        if key not in fit._analyses:
            fit._analyses[key] = analysis(fit)
        return cast("Outcome", fit._analyses[key])

    return cached_analysis
