"""What the stages of a fit leave open of their machine's numbers, from the errors of all estimates.

There is one independent error for each principal axis of each stage's own covariance, in which
priors, noise and the differences of the runs are, and one for each systematic effect
(`intervals`). What an earlier stage does not know moves the later one as well.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from swashplate.identification.estimation.model import EquationModel
from swashplate.identification.estimation.posterior import Posterior
from swashplate.identification.estimation.unknowns import Unknowns
from swashplate.identification.stage_fit import StageFit
from swashplate.identification.statistics.effects import effect_of_fixed
from swashplate.identification.statistics.intervals import Uncertainty, reach, uncertainty_of

Array = NDArray[np.float64]
ALONE = 0.01
"""Largest correlation of an error that goes with no other. [1]"""
NEGLIGIBLE = 1e-9
"""Share of the largest singular value below which an error counts as none. [1]"""


def posterior_of(stages: Sequence[StageFit]) -> Posterior:
    """What the stages of a fit leave open of the machine's numbers.

    Raises
    ------
    InputError
        If a stage has no more samples than unknowns.
    """
    sources = list[tuple[int, Array]]()  # number of a stage, and an error of its own vector
    effects = dict[str, None]()
    for number, stage in enumerate(stages):
        uncertainty = uncertainty_of(stage)
        shared = stage.problem.unknowns.shared
        nearer = _nearer_ends(uncertainty)
        matrix = nearer[:, None] * uncertainty.own.matrix * nearer
        variances, axes = np.linalg.eigh(matrix[np.ix_(shared, shared)])
        for variance, axis in zip(variances, axes.T, strict=True):
            error = np.zeros(len(stage.problem.unknowns))
            error[shared] = np.sqrt(max(float(variance), 0.0)) * axis
            sources.append((number, error))
        effects |= dict.fromkeys(uncertainty.systematic)
    count = len(sources) + len(effects)
    rows = dict[str, Array]()
    for number, (stage, own) in enumerate(zip(stages, _own_errors(stages, sources), strict=True)):
        systematic = uncertainty_of(stage).systematic
        errors = np.zeros((len(own), count))
        errors[:, : len(sources)] = own
        for column, effect in enumerate(effects, len(sources)):
            errors[:, column] = systematic.get(effect, 0.0)
        if number == 0:
            rows |= _of_fixed(stage, list(effects), len(sources), count)
        rows |= _of_numbers(stage, errors)
    names = [name for name, row in rows.items() if row.any()]
    return Posterior(tuple(names), _compressed(np.array([rows[name] for name in names])))


def _nearer_ends(uncertainty: Uncertainty) -> Array:
    """(K,) by how much smaller an error is than the linearised one, if an end was found nearer.

    A limit that is just not reached has its nearer end towards what the tests reached; beyond it
    lies what no motion like theirs shows. Only of one whose error goes with no other: of two that
    make up for each other, neither can be smaller by itself.
    """
    half_widths = reach(uncertainty.own)
    correlation = np.abs(uncertainty.own.correlation)
    np.fill_diagonal(correlation, 0.0)
    nearer = np.ones(half_widths.size)
    for end in uncertainty.ends:
        width = half_widths[end.number]
        if width > 0.0 and correlation[end.number].max(initial=0.0) < ALONE:
            nearer[end.number] = min(nearer[end.number], end.distance / width)
    return nearer


def _own_errors(stages: Sequence[StageFit], sources: Sequence[tuple[int, Array]]) -> list[Array]:
    """Of each stage (K, sources) errors of its vector, those that follow from earlier ones too."""
    errors = list[Array]()
    by_name = dict[str, Array]()
    for number, stage in enumerate(stages):
        of_stage = np.zeros((len(stage.problem.unknowns), len(sources)))
        for earlier in uncertainty_of(stage).earlier_stages:
            of_stage += earlier.slopes @ by_name[earlier.stage]
        for column, (origin, error) in enumerate(sources):
            if origin == number:
                of_stage[:, column] += error
        by_name[stage.stage.name] = of_stage
        errors.append(of_stage)
    return errors


def _of_fixed(stage: StageFit, effects: list[str], first: int, count: int) -> dict[str, Array]:
    """(count,) changes of fixed numbers with a standard uncertainty, each by its own effect."""
    rows = dict[str, Array]()
    for together in stage.problem.uncertain:
        effect = effect_of_fixed(together)
        for name, deviation in together.items():
            rows[name] = np.zeros(count)
            rows[name][first + effects.index(effect)] = deviation
    return rows


def _of_numbers(stage: StageFit, errors: Array) -> dict[str, Array]:
    """(count,) changes of each number of the machine that a stage moves, from its vector's."""
    unknowns: Unknowns = stage.problem.unknowns
    names, model = unknowns.machine_targets, stage.problem.model
    by_name = unknowns.chain(stage.solution.vector, names, "") @ errors[unknowns.shared]
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
