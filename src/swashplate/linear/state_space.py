"""Frequency response of a state space with a delay before it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.errors import InputError

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def state_space_response(
    A: Array,
    B: Array,
    C: Array,
    D: Array,
    delay: float,
    sample_time: float | None,
    frequency: ArrayLike,
) -> ComplexArray:
    """G(jω) e^(-jω delay) with G = C (p - A)⁻¹ B + D, p being jω or, sampled, e^(jωh).

    Parameters
    ----------
    A, B, C, D : (n, n), (n, 1), (m, n), (m, 1) arrays
        The system, of one input.
    delay, sample_time : float
        Delay and, for a sampled system, its interval, else None. [s]
    frequency : float or (f,) array_like
        [Hz]

    Returns
    -------
    (m,) or (m, f) complex array
        For one frequency or several.

    Raises
    ------
    InputError
        For a frequency that is not finite, negative or beyond half the rate.
    """
    f = np.atleast_1d(np.asarray(frequency, dtype=np.float64))
    highest = np.inf if sample_time is None else 0.5 / sample_time
    # half the rate may have been computed in another way
    if f.ndim != 1 or not (np.isfinite(f) & (f >= 0.0) & (f <= highest * (1.0 + 1e-12))).all():
        raise InputError(
            "Frequencies must be one row of finite numbers from 0 on"
            + ("." if sample_time is None else f" to 1/(2 h) = {highest:g} Hz.")
        )
    s = 2j * np.pi * f
    point = s if sample_time is None else np.exp(s * sample_time)
    n = A.shape[0]
    system = point[:, np.newaxis, np.newaxis] * np.eye(n) - A
    inside = np.linalg.solve(system, np.broadcast_to(B, (f.size, n, 1)))
    found = ((C @ inside)[:, :, 0].T + D) * np.exp(-s * delay)
    return np.asarray(found[:, 0] if np.ndim(frequency) == 0 else found, dtype=np.complex128)
