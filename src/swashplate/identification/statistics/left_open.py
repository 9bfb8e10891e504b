"""What a fit leaves open of its machine's numbers, from the errors of all estimates.

There is one independent error for each principal axis of the covariance, in which priors, noise and
the differences of the runs are, and one for each systematic effect (`intervals`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swashplate.identification.estimation.model import EquationModel
from swashplate.identification.estimation.posterior import Posterior
from swashplate.identification.estimation.unknowns import Unknowns
from swashplate.identification.optimum import Optimum
from swashplate.identification.statistics.effects import effect_of_fixed
from swashplate.identification.statistics.intervals import uncertainty_of

Array = NDArray[np.float64]
NEGLIGIBLE = 1e-9
"""Share of the largest singular value below which an error counts as none. [1]"""


def posterior_of(fit: Optimum) -> Posterior:
    """What a fit leaves open of the machine's numbers.

    Raises
    ------
    InputError
        If there are no more samples than unknowns.
    """
    uncertainty = uncertainty_of(fit)
    unknowns = fit.problem.unknowns
    shared = unknowns.shared
    variances, axes = np.linalg.eigh(uncertainty.within_ends[np.ix_(shared, shared)])
    own = np.zeros((len(unknowns), variances.size))
    own[shared] = np.sqrt(np.maximum(variances, 0.0)) * axes
    systematic = [change[:, None] for change in uncertainty.systematic.values()]
    errors = np.hstack([own, *systematic])
    rows = _of_fixed(fit, list(uncertainty.systematic), own.shape[1], errors.shape[1])
    rows |= _of_numbers(fit, errors)
    names = [name for name, row in rows.items() if row.any()]
    return Posterior(tuple(names), _compressed(np.array([rows[name] for name in names])))


def _of_fixed(fit: Optimum, effects: list[str], first: int, count: int) -> dict[str, Array]:
    """(count,) changes of fixed numbers with a standard uncertainty, each by its own effect."""
    rows = dict[str, Array]()
    for together in fit.problem.uncertain:
        effect = effect_of_fixed(together)
        for name, deviation in together.items():
            rows[name] = np.zeros(count)
            rows[name][first + effects.index(effect)] = deviation
    return rows


def _of_numbers(fit: Optimum, errors: Array) -> dict[str, Array]:
    """(count,) changes of each number of the machine that a fit moves, from its vector's."""
    unknowns: Unknowns = fit.problem.unknowns
    names, model = unknowns.machine_targets, fit.problem.model
    by_name = unknowns.chain(fit.solution.vector, names, "") @ errors[unknowns.shared]
    if isinstance(model, EquationModel):
        columns, derivatives = model.columns(names)
        return dict(zip(columns, derivatives @ by_name, strict=True))
    return dict(zip(names, by_name, strict=True))


def _compressed(changes: Array) -> Array:
    """The same covariance of as few errors as it has directions, each number in its own size."""
    if not changes.size:
        return changes.reshape(len(changes), 0)
    sizes = np.linalg.norm(changes, axis=1)
    left, singular, _ = np.linalg.svd(changes / sizes[:, None], full_matrices=False)
    kept = singular > NEGLIGIBLE * singular[0]
    return np.asarray(sizes[:, None] * left[:, kept] * singular[kept])
