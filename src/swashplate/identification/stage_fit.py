"""Result of a stage of a fit: plain data, below all that judges it.

What follows from it alone is there as an attribute. What it is worth are functions of a stage, each
in the file of its subject: `intervals.uncertainty_of`, `determination.identifiability_of`,
`profiles.profiles_of`, `effects.effects_of`, `tables.estimates_table`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, wraps
from typing import Any, Literal, NamedTuple, TypeVar, cast

from swashplate.drive import Drive
from swashplate.errors import InputError
from swashplate.identification.estimation.model_setup import ModelSetup
from swashplate.identification.estimation.problem import LinearisedFit, Problem, linearised_fit
from swashplate.identification.estimation.setup import Stage
from swashplate.identification.estimation.solving import Solution
from swashplate.identification.estimation.stages import Parameters
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
estimated forces, ``"fixed"`` is what no stage moved."""


class Interval(NamedTuple):
    """Status, standard error and interval of an estimate."""

    status: Status
    standard_error: float | None = None
    """None unless estimated."""
    lower: float | None = None
    """None if there is no end."""
    upper: float | None = None


@dataclass(frozen=True, eq=False)
class StageFit(Result):
    """Result of one stage: its problem, the optimum, and the parameters with it.

    Its estimates with their intervals are those of `estimates_of`; `uncertainty_of` and
    `identifiability_of` say what they rest on.
    """

    stage: Stage
    problem: Problem
    solution: Solution
    parameters: Parameters
    """The drive, or the user-defined model, with what was found."""
    starts: tuple[Solution, ...] = ()
    """End of each start, if there was more than one."""
    earlier: tuple[StageFit, ...] = field(default=(), repr=False)
    """The stages before, whose results this one takes for granted."""
    stored: tuple[Interval, ...] | None = field(default=None, repr=False)
    """What is known of each unknown's error, if it was computed before, such as by the fit that a
    folder holds."""
    _analyses: dict[str, Any] = field(default_factory=dict, repr=False, init=False)
    """See `once_per_stage`."""

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

    @cached_property
    def linearised(self) -> LinearisedFit:
        """Residuals and derivatives at the optimum."""
        return linearised_fit(self.problem, self.solution.vector, self.solution.loss)

    @cached_property
    def runs(self) -> tuple[RunQuality, ...]:
        """Quality of each channel of each run that was fitted."""
        return run_qualities(self.problem, self.solution.vector)


def once_per_stage(analysis: Callable[[StageFit], Outcome]) -> Callable[[StageFit], Outcome]:
    """Cache an analysis of a stage with the stage: it is computed on its first call.

    Verdict, tables, report and files ask for the same analyses, which take seconds. They are kept
    with the stage, so that they go when it goes, and go with it to other processes: some refer to
    their stage, and a table of weak references would keep both for ever. An error is not kept.
    """
    key = f"{analysis.__module__}.{analysis.__qualname__}"

    @wraps(analysis)
    def cached_analysis(stage: StageFit) -> Outcome:
        if key not in stage._analyses:
            stage._analyses[key] = analysis(stage)
        return cast("Outcome", stage._analyses[key])

    return cached_analysis
