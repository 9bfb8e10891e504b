"""What a prior counts beside residuals that are coloured, or larger than their stated noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import log
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from swashplate.identification.covariance import Covariance
from swashplate.identification.linearised import linearised_fit
from swashplate.identification.problem import Problem
from swashplate.identification.uncertainty import uncertainty
from swashplate.identification.unknowns import Unknowns

Array = NDArray[np.float64]
P = TypeVar("P", bound=Problem)

LEAST = 1e-6
"""Smallest worth: residuals that are all but zero leave a prior its say on what they leave open."""


def weighed(problem: P, vector: Array) -> P:
    """The problem with priors that count as much as the residuals are really worth.

    The cost takes every residual for an independent one of variance 1. Where a hundred of them are
    worth one, data would outweigh a prior a hundred times too much. So a prior counts as often as
    that: by the ratio of its unknown's variance under the noise that the residuals show to its
    variance under the noise that the cost assumes, both from the data alone; by the median of the
    others where the data alone do not determine the unknown.

    Parameters
    ----------
    problem : Problem
        What was fitted.
    vector : (K,) array
        The solver's vector, at or near the optimum.

    Raises
    ------
    InputError
        If there are no more samples than unknowns.
    """
    bare = replace(problem, unknowns=problem.unknowns.with_worths(None))
    fit = linearised_fit(bare, vector)
    own = uncertainty(fit).own
    assumed = np.sum(fit.whitening**2, axis=1)
    known = own.determined & (assumed > 0.0)
    ratio = np.diag(own.matrix)[known] / assumed[known]
    found = np.full(known.size, float(np.median(ratio)) if known.any() else 1.0)
    found[known] = ratio
    worths = [
        max(float(worth), LEAST)
        for worth, unknown in zip(found, problem.unknowns, strict=True)
        if unknown.prior is not None
    ]
    return with_worths(problem, worths)


def with_worths(problem: P, worths: Sequence[float]) -> P:
    """The problem with these worths of its priors, in the order of the unknowns."""
    return replace(problem, unknowns=problem.unknowns.with_worths(worths))


def prior_sentences(unknowns: Unknowns, vector: Array, quoted: Covariance) -> tuple[str, ...]:
    """What each prior adds, and how far from it the estimate lies."""
    said = []
    errors = quoted.standard_errors
    for k, unknown in enumerate(unknowns):
        prior = unknown.prior
        if prior is None:
            continue
        scale = 1.0 if unknown.log else unknown.scale
        middle = log(prior.mean) if unknown.log else prior.mean
        pull = (float(vector[k]) * scale - middle) / prior.deviation
        share = min(float(errors[k] * scale / prior.deviation) ** 2, 1.0)
        percent = 100.0 * share
        part = f"{percent:.0f}" if percent >= 10.0 else f"{percent:.2g}"
        spread = f"{100.0 * prior.deviation:.3g} %" if unknown.log else f"{prior.deviation:.4g}"
        said.append(
            f"The prior of {unknown.name}, {prior.mean:.5g} ± {spread}, makes up "
            f"{part} % of what is known of it; the estimate lies "
            f"{abs(pull):.2g} deviations {'above' if pull >= 0.0 else 'below'} its mean."
        )
    return tuple(said)
