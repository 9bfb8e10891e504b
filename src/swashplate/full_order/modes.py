"""Natural modes of the full-order model about an equilibrium."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swashplate.full_order.machine import Plate
from swashplate.full_order.march import N_STATES, jacobian_at
from swashplate.models.pump import Pump

Complex = NDArray[np.complex128]
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Modes:
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
    """Swash plate on its return spring alone, the source's reckoning. [rad/s]"""

    @staticmethod
    def frequency_hz(mode: complex) -> float:
        """Undamped natural frequency. [Hz]"""
        return abs(mode) / (2.0 * np.pi)

    @staticmethod
    def damping_ratio(mode: complex) -> float:
        """Damping ratio. [1]"""
        return -mode.real / abs(mode)


def state_matrix(row: Array, current: float, machine: Plate, pump: Pump) -> Array:
    """Derivatives of the five rates by the five states, no limit holding. (5, 5)"""
    record = np.array([current, current])
    jacobian = jacobian_at(0.0, row, record, True, 1.0, (0, 0, 0), machine, pump)
    return np.ascontiguousarray(jacobian[:N_STATES, :N_STATES])


def modes_at(row: Array, current: float, machine: Plate, pump: Pump) -> Modes:
    """Modes about a row.

    The slow pole is the eigenvalue nearest zero. The spool's mode is the one in which position and
    velocity of the spool take the largest part, by the product of left and right eigenvectors.
    """
    matrix = state_matrix(row, current, machine, pump)
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
