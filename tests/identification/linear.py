"""Linearised fits that are written down rather than fitted."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from swashplate.identification.problem import TOLERANCE, LinearisedFit, LinearisedRun
from swashplate.identification.unknowns import Unknown, Unknowns


def unknowns_of(
    names: Sequence[str],
    values: ArrayLike,
    *,
    scales: ArrayLike | None = None,
    logarithmic: Sequence[bool] | None = None,
    at_bound: Sequence[int] | None = None,
) -> Unknowns:
    """Unknowns at their estimates: -1 at the lower bound, 1 at the upper one, 0 between."""
    number = np.asarray(values, dtype=float)
    size = np.where(number == 0.0, 1.0, np.abs(number)) if scales is None else np.asarray(scales)
    items = []
    for k, (name, value, scale) in enumerate(zip(names, number, size, strict=True)):
        log, side = bool(logarithmic and logarithmic[k]), at_bound[k] if at_bound else 0
        low, high = (value / 1e9, value * 1e9) if log else (value - scale, value + scale)
        low, high = (value if side < 0 else low), (value if side > 0 else high)
        items.append(Unknown(name, float(value), low, high, log=log, scale=float(scale)))
    return Unknowns(tuple(items))


def linear_fit(
    runs: Sequence[LinearisedRun],
    variables: Unknowns,
    *,
    prior: np.ndarray | None = None,
    prior_noise: np.ndarray | None = None,
    tolerance: float = TOLERANCE,
) -> LinearisedFit:
    """A fit of some runs, without priors by default."""
    rows = np.zeros((0, len(variables))) if prior is None else prior
    noise = np.ones(len(rows)) if prior_noise is None else prior_noise
    return LinearisedFit(tuple(runs), variables, rows, tolerance, noise)
