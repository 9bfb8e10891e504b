"""What a fit leaves open of its machine's numbers, and what that leaves open of a motion.

The numbers θ of the machine are normal about the fitted ones, with the covariance B Bᵀ: each column
of B is the change of all numbers for a standard deviation of one independent error. A signal y of
any motion is then off by ∂y/∂θ B z with independent normal z of variance 1, to first order. The
mean square over some samples is zᵀ G z, G = Bᵀ ⟨∂y/∂θᵀ ∂y/∂θ⟩ B.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import PlainSerializer, PlainValidator
from scipy.special import chdtri

from swashplate.campaign import Experiment
from swashplate.identification.estimation.model import MachineModel
from swashplate.identification.estimation.model import linearised as linearised_model
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
