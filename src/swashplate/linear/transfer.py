"""Transfer functions as polynomials, and rational approximants of a delay."""

from __future__ import annotations

from math import comb, factorial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError

if TYPE_CHECKING:
    from swashplate.linear.model import LinearDrive

Array = NDArray[np.float64]
StateSpaceMatrices = tuple[Array, Array, Array, Array]

HIGHEST_PADE = 8
"""Above, the approximant's coefficients span more decades than double precision has digits."""


def polynomials(model: LinearDrive, output: str) -> tuple[Array, Array]:
    """Numerator and denominator of one output, highest power first; see `LinearDrive`.

    Raises
    ------
    InputError
        If the model has no such output.

    Notes
    -----
    With the Markov parameters m₀ = D, mₖ = C Aᵏ⁻¹ B the numerator is the polynomial part of
    denominator · Σ mₖ s⁻ᵏ. Those that the structure makes zero are exactly zero, so no leading
    coefficients are left by rounding.
    """
    if output not in model.outputs:
        raise InputError(
            f"The model of {model.name} has no output '{output}'; it has "
            f"{', '.join(model.outputs)}."
        )
    row = model.outputs.index(output)
    n = model.A.shape[0]
    denominator = np.zeros(n + 1)
    moving = np.real(np.poly(model.poles))
    denominator[: moving.size] = moving
    markov = np.empty(n + 1)
    markov[0] = model.D[row, 0]
    into = model.B[:, 0]
    for k in range(1, n + 1):
        markov[k] = model.C[row] @ into
        into = model.A @ into
    numerator = np.convolve(denominator, markov)[: n + 1]
    first = int(np.argmax(numerator != 0.0)) if numerator.any() else n
    return numerator[first:], denominator


def pade_polynomials(delay: float, order: int) -> tuple[Array, Array]:
    """Numerator and denominator of the Padé approximant of e^(-s delay), highest power first.

    Parameters
    ----------
    delay : float
        [s]
    order : int
        Degree of both, 1 to 8.
    """
    powers = np.arange(order, -1, -1)
    denominator = _pade_coefficients(order)[::-1] * delay**powers
    return denominator * (-1.0) ** powers, denominator


def pade_states(delay: float, order: int) -> StateSpaceMatrices:
    """The same as a state space, its states scaled so that the coefficients are of one size."""
    coefficients = _pade_coefficients(order)
    sign = (-1.0) ** np.arange(order + 1)
    through = sign[-1]
    A = np.eye(order, k=1)
    A[-1] = -coefficients[:-1]
    B = np.zeros((order, 1))
    B[-1, 0] = 1.0
    C = ((sign - through) * coefficients)[np.newaxis, :-1]
    return A / delay, B / delay, C, np.array([[through]])


def _pade_coefficients(order: int) -> Array:
    """Coefficients of the denominator in p = s delay, lowest first, the highest being 1."""
    if not 1 <= order <= HIGHEST_PADE:
        raise InputError(
            f"The order of a Padé approximant is {order}, but must be 1 to {HIGHEST_PADE}, or 0 "
            "to leave the delay out."
        )
    return np.array(
        [comb(order, k) * factorial(2 * order - k) / factorial(order) for k in range(order + 1)]
    )
