"""A problem at a point as the statistics see it: weighted residuals and derivatives, run by run."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swashplate.identification.linearised import TOLERANCE, LinearisedFit, LinearisedRun
from swashplate.identification.model import Differentiable
from swashplate.identification.problem import Problem
from swashplate.identification.variables import Variables

Array = NDArray[np.float64]
BY_DIFFERENCES = 1e-6
"""Singular values of difference derivatives below this part of the largest count as zero."""


def variables_of(problem: Problem, vector: Array) -> Variables:
    """The unknowns at a point, as the statistics see them."""
    unknowns = problem.unknowns
    bounds = unknowns.at_bounds(vector)
    side = {"lower": -1, "upper": 1}
    return Variables.of(
        unknowns.names,
        list(unknowns.values(vector).values()),
        scales=[each.scale for each in unknowns],
        logarithmic=[each.log for each in unknowns],
        at_bound=[side.get(bounds.get(name, ""), 0) for name in unknowns.names],
    )


def linearised_fit(problem: Problem, vector: Array) -> LinearisedFit:
    """Residuals and derivatives of every run at a point, ignored samples left out.

    Parameters
    ----------
    problem : Problem
        What was fitted.
    vector : (K,) array
        The solver's vector at the optimum.
    """
    runs = []
    for number, experiment in enumerate(problem.experiments):
        weights = problem.weights[number]
        for name, part in problem.linearised(vector, number).items():
            used = weights[name] > 0.0
            runs.append(
                LinearisedRun(
                    experiment.name,
                    name,
                    experiment[name].time[used],
                    part.values[used],
                    part.by[used],
                    weights[name][used],
                )
            )
    _, prior = problem.unknowns.prior_rows(vector)
    worths = [each.prior.worth for each in problem.unknowns if each.prior is not None]
    exact = isinstance(problem.model, Differentiable)
    return LinearisedFit.of(
        runs,
        variables_of(problem, vector),
        prior=prior,
        prior_noise=np.array(worths),
        tolerance=TOLERANCE if exact else BY_DIFFERENCES,
    )
