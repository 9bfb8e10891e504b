"""Whether a measured current keeps a drive from following its motion.

A model that cannot describe both a current and the motion that it makes is pulled away from the
motion by the current, so that the more was measured, the worse it predicts. What a channel's
residuals are worth is therefore found in the fit: currents count as little as they must for the
motion to be followed as well as the model can.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from swashplate.campaign import CURRENTS, WeightWindow
from swashplate.errors import DomainError
from swashplate.identification.estimation.problem import Problem
from swashplate.identification.estimation.setup import FitSetup
from swashplate.identification.estimation.solving import solve
from swashplate.identification.estimation.unknowns import Vector
from swashplate.identification.optimum import Optimum

LOOSER = 30.0
"""Factor on the unit of currents with which a search shows what the motion is without them. [1]"""
CONTRADICTS = 1.1
"""Ratio of the motion's error with the currents to that nearly without from which they pull. [1]"""
EVALUATIONS, TOLERANCE = 40, 1e-4
"""Of that search."""


class Freed(NamedTuple):
    """What a fit becomes if its currents no longer keep the motion away."""

    factor: float
    """On the squared errors of currents. [1]"""
    values: Mapping[str, float]
    """The unknowns by their labels, near the optimum."""


def less_of_currents(fit: Optimum) -> Freed | None:
    """By how much less currents must count; None if they do not keep the motion away.

    From where the fit ended a search goes on in which currents count next to nothing. If the motion
    is then followed better, each channel is given the error that the model has there: the factor is
    the ratio of the motion's mean square to that of the currents, in units of their residuals.
    """
    problem = fit.problem
    kinds = {
        name: run[name].kind
        for run in problem.experiments
        for name in problem.channels
        if name in run.channels
    }
    currents = [name for name, kind in kinds.items() if kind in CURRENTS]
    motions = [name for name in kinds if name not in currents]
    if not currents or not motions:
        return None
    looser = {name: LOOSER * problem.scales[name] for name in currents}
    loose = replace(problem, scales={**problem.scales, **looser})
    start = fit.solution.vector
    try:
        free = solve(loose, start, tolerance=TOLERANCE, max_evaluations=EVALUATIONS).vector
    except DomainError:
        return None
    before, after = _mean_squares(problem, start), _mean_squares(problem, free)
    motion = sum(after[name] for name in motions)
    if sum(before[name] for name in motions) < CONTRADICTS**2 * motion:
        return None
    ratio = (motion / len(motions)) / (sum(after[name] for name in currents) / len(currents))
    return Freed(min(ratio, 1.0), problem.unknowns.values(free))


def _mean_squares(problem: Problem, vector: Vector) -> dict[str, float]:
    """Mean squared residual of each channel, of the samples that count. [1]"""
    squares, counts = dict[str, float](), dict[str, int]()
    for number, run in enumerate(problem.experiments):
        for name, residual in problem.residuals(vector, number).items():
            squares[name] = squares.get(name, 0.0) + float(residual @ residual)
            counts[name] = counts.get(name, 0) + int(np.count_nonzero(run[name].used))
    return {name: squares[name] / max(counts[name], 1) for name in squares}


def with_weight_of_currents(setup: FitSetup, factor: float) -> FitSetup:
    """The setup with a factor on the squared errors of currents."""
    window = WeightWindow(factor=float(f"{factor:.3g}"))
    weights = {**setup.weights, **dict.fromkeys(CURRENTS, (window,))}
    return setup.model_copy(update={"weights": weights})
