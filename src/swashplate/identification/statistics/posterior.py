"""What a fit leaves open of its machine's numbers, and what that leaves open of a motion.

The numbers θ of the machine are normal about the fitted ones, with the covariance B Bᵀ: each column
of B is the change of all numbers for a standard deviation of one independent error. There is one
for each principal axis of each stage's own covariance, in which priors, noise and the differences
of the runs are, and one for each systematic effect (`intervals`). What an earlier stage does not
know moves the later one as well.

A signal y of any motion is then off by ∂y/∂θ B z with independent normal z of variance 1, to first
order. The mean square over some samples is zᵀ G z, G = Bᵀ ⟨∂y/∂θᵀ ∂y/∂θ⟩ B.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import PlainSerializer, PlainValidator
from scipy.special import chdtri

from swashplate.campaign import Experiment
from swashplate.identification.estimation.model import EquationModel, MachineModel
from swashplate.identification.estimation.model import linearised as linearised_model
from swashplate.identification.estimation.unknowns import Unknowns
from swashplate.identification.stage_fit import StageFit
from swashplate.identification.statistics.effects import effect_of_fixed
from swashplate.identification.statistics.intervals import uncertainty_of
from swashplate.results import Result

Array = NDArray[np.float64]


def _finite_matrix(content: object) -> Array:
    """Matrix (n, s) of a file's list of rows."""
    matrix = np.asarray(content)
    if matrix.size == 0:
        return np.zeros((0, 0))
    if matrix.ndim != 2 or matrix.dtype.kind not in "fi" or not np.isfinite(matrix).all():
        raise ValueError("it must be a list of rows of finite numbers")
    return matrix.astype(np.float64)


Matrix = Annotated[Array, PlainValidator(_finite_matrix), PlainSerializer(np.ndarray.tolist)]
"""A matrix; in a file a list of rows."""
NEGLIGIBLE = 1e-9
"""Share of the largest singular value below which an error counts as none. [1]"""


@dataclass(frozen=True, eq=False)
class Posterior(Result):
    """Errors that a machine's fitted numbers may have, as far as the tests tell."""

    names: tuple[str, ...]
    """Of the numbers that have one, by columns such as ``"Z16_plus"``."""
    changes: Matrix
    """(n, s) changes of these numbers for a standard deviation of each independent error. [SI]"""

    @property
    def covariance(self) -> Array:
        """(n, n) of the numbers. [SI]"""
        return np.asarray(self.changes @ self.changes.T)

    def errors_of(
        self, model: MachineModel, values: Mapping[str, float], experiment: Experiment
    ) -> dict[str, Array]:
        """By channel (m, s) changes of what a model simulates, for each independent error. [unit]

        Parameters
        ----------
        model : MachineModel
            With the fitted numbers.
        values : mapping
            Of the numbers that the model does not have by itself.
        experiment : Experiment
            Its command drives the model; the channels say what is simulated, and when.
        """
        if not self.names:
            return {}
        response = linearised_model(model, values, experiment, self.names)
        return {name: part.by @ self.changes for name, part in response.items()}


def mean_square_bound(errors: Array, level: float) -> float:
    """Mean square of (m, s) errors that a draw stays below with a probability.

    By Satterthwaite: zᵀ G z with the eigenvalues λ of G is taken for (Σ λ/ν) χ²_ν with the same
    variance, ν = (Σ λ)²/Σ λ².
    """
    if not errors.size:
        return 0.0
    gram = errors.T @ errors / len(errors)
    mean, squares = float(np.trace(gram)), float(np.sum(gram**2))
    if not mean > 0.0:
        return 0.0
    freedom = mean**2 / squares
    return float(mean * chdtri(freedom, 1.0 - level) / freedom)


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
        variances, axes = np.linalg.eigh(uncertainty.own.matrix[np.ix_(shared, shared)])
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
