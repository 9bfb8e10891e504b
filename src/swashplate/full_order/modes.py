"""Natural modes of the five states: eigenvalues of their linearised rates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.code import generating
from swashplate.equations.derivatives import derive
from swashplate.models.full_order import Motion, PlantOptions, free_rates
from swashplate.models.machine import Machine
from swashplate.results import Result

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

N_STATES = len(Motion._fields)


@generating
def slopes_of(options: PlantOptions) -> Callable[..., Array]:
    """The derivatives of the rates by the five states, as a function that gives their matrix."""
    made = derive(free_rates, by="state", options={"options": options})

    def slopes(state: Array, force: float, p: Machine) -> Array:
        matrix = np.zeros((N_STATES, N_STATES))
        found = made.python(Motion(*state), force, p, options)
        for (row, column), slope in zip(made.entries, found[len(made.outputs) :], strict=True):
            matrix[(1, 2, 4)[row], column] = slope
        return matrix

    return slopes


def state_matrix(state: Array, force: float, p: Machine, options: PlantOptions) -> Array:
    """(5, 5) derivatives of the rates of the five states by themselves, no limit holding."""
    matrix = slopes_of(options)(state, force, p)
    matrix[0, 1] = matrix[3, 4] = 1.0
    return matrix


@dataclass(frozen=True)
class Modes(Result):
    """Eigenvalues of the linearised model, told apart by the states that take part in them."""

    eigenvalues: Complex
    """All five. [rad/s]"""
    slow: complex
    """The pole that the reduced model keeps, -1/τ. [rad/s]"""
    spool: complex
    """Spool on the feedback spring, the upper of a pair. [rad/s]"""
    swash: complex
    """Swash plate on its return spring and the oil trapped behind the closed valve. [rad/s]"""
    swash_at_held_pressure: complex
    """Swash plate on its return spring alone, Kruse's reckoning. [rad/s]"""

    @staticmethod
    def frequency_hz(mode: complex) -> float:
        """Undamped natural frequency. [Hz]"""
        return abs(mode) / (2.0 * np.pi)

    @staticmethod
    def damping_ratio(mode: complex) -> float:
        """Damping ratio. [1]"""
        return -mode.real / abs(mode)


def modes_of(matrix: Array) -> Modes:
    """Modes of a state matrix.

    The slow pole is the eigenvalue nearest zero. The spool's mode is the one in which position and
    velocity of the spool take the largest part, by the product of left and right eigenvectors.
    """
    values, right = np.linalg.eig(matrix)
    left = np.linalg.inv(right)
    parts = np.abs(left.T * right)  # (state, mode), free of the states' units
    slow = int(np.argmin(np.abs(values)))
    others = [k for k in range(N_STATES) if k != slow]
    by_spool = sorted(others, key=lambda k: -float(parts[:2, k].sum() / parts[:, k].sum()))
    held = np.linalg.eigvals(matrix[3:, 3:])
    return Modes(
        values.astype(np.complex128),
        complex(values[slow]),
        _upper(values[by_spool[:2]]),
        _upper(values[by_spool[2:]]),
        _upper(held),
    )


def _upper(pair: NDArray[np.number]) -> complex:
    """The eigenvalue of a pair with positive imaginary part, or the slower of two real ones."""
    if np.iscomplexobj(pair) and np.any(np.imag(pair) > 0.0):
        return complex(pair[int(np.argmax(np.imag(pair)))])
    return complex(pair[int(np.argmin(np.abs(pair)))])
