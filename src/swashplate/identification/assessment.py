"""What a stage's data tell: identifiability, errors of the estimates, quality of each run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.experiment import Experiment
from swashplate.identification.checked_ends import checked_ends
from swashplate.identification.fit import StageFit
from swashplate.identification.handed_on import Handed, slopes_by_earlier
from swashplate.identification.identifiability import Identifiability, identifiability
from swashplate.identification.intervals import reach
from swashplate.identification.linearised import LinearisedFit, linearised_fit
from swashplate.identification.measures import Measures, measures
from swashplate.identification.prior_weights import prior_sentences
from swashplate.identification.problem import Problem
from swashplate.identification.residual_tests import ResidualTest, residual_test
from swashplate.identification.uncertainty import Uncertainty, uncertainty

Array = NDArray[np.float64]
LIMITS = ("Z13", "Z14", "Z15", "Z16")
"""Parameters that limit something: stops, strokes, relief, orifices."""


@dataclass(frozen=True, eq=False)
class RunQuality:
    """How well one channel of one run is simulated."""

    experiment: Experiment
    channel: str
    simulated: Array
    """(m,) at the channel's stamps, its free zero included. [unit of the channel]"""
    measures: Measures
    test: ResidualTest | None
    """None where there are too few samples."""

    @property
    def residual(self) -> Array:
        """(m,) simulated less measured."""
        return self.simulated - self.experiment[self.channel].values


@dataclass(frozen=True, eq=False)
class Assessment:
    """What a stage's data tell of its unknowns, and how good the fit is."""

    stage: StageFit
    earlier: tuple[Assessment, ...] = ()
    """Of the stages before, whose results this one takes for granted."""

    @property
    def _vector(self) -> Array:
        return self.stage.solution.vector

    @cached_property
    def linearised(self) -> LinearisedFit:
        """Residuals and derivatives at the optimum."""
        return linearised_fit(self.stage.problem, self._vector)

    @cached_property
    def identifiability(self) -> Identifiability:
        """Which unknowns the tests determine."""
        problem = self.stage.problem
        fixed = {
            name: value
            for name, value in self.stage.parameters.numbers.items()
            if name not in problem.unknowns.names
        }
        return identifiability(
            self.linearised.triangle,
            self.linearised.variables,
            tolerance=self.linearised.tolerance,
            fixed=fixed,
        )

    @cached_property
    def uncertainty(self) -> Uncertainty:
        """Errors of the estimates, for coloured residuals, those of earlier stages taken in."""
        handed = []
        for each in self.earlier:
            slopes = slopes_by_earlier(self.stage, each.stage, self.linearised)
            if slopes is not None:
                handed.append(Handed(each.uncertainty.quoted, slopes))
        found = uncertainty(self.linearised, handed=handed)
        said = prior_sentences(self.stage.problem.unknowns, self._vector, found.quoted)
        found = replace(found, priors=said)
        if not found.noisy:
            return found
        half = reach(found.own, found.level)
        limits = [
            number
            for number, unknown in enumerate(self.stage.problem.unknowns)
            if unknown.targets[0].startswith(LIMITS)
        ]
        ends = checked_ends(self.stage.problem, self._vector, self.linearised, half, limits)
        return replace(found, ends=ends)

    @cached_property
    def runs(self) -> tuple[RunQuality, ...]:
        """Quality of each channel of each run that was fitted."""
        return run_qualities(self.stage.problem, self._vector)


def run_qualities(problem: Problem, vector: Array) -> tuple[RunQuality, ...]:
    """Quality of each channel of each run of a problem at a point."""
    return tuple(
        compared(experiment, name, simulated)
        for number, experiment in enumerate(problem.experiments)
        for name, simulated in problem.outputs(vector, number).items()
        if experiment[name].used.any()
    )


def compared(experiment: Experiment, name: str, simulated: Array) -> RunQuality:
    """Quality of one channel of one run, simulated at its stamps."""
    channel = experiment[name]
    used = channel.used
    return RunQuality(
        experiment,
        name,
        simulated,
        measures(channel.values, simulated, channel.weight),
        _tested(experiment, channel.time[used], (simulated - channel.values)[used]),
    )


def _tested(experiment: Experiment, time: Array, residual: Array) -> ResidualTest | None:
    if time.size < 8:
        return None
    return residual_test(time, residual, experiment.input.at(time))


def assess(stages: Sequence[StageFit]) -> tuple[Assessment, ...]:
    """The assessment of each stage of a fit."""
    made: list[Assessment] = []
    for each in stages:
        made.append(Assessment(each, tuple(made)))
    return tuple(made)
