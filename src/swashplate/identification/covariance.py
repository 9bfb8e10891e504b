"""Covariance of the estimates under an assumption on the noise; that of white noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft

from swashplate.identification.linearised import LinearisedFit
from swashplate.identification.unknowns import Unknowns

Array = NDArray[np.float64]
Noise = Literal["white", "coloured", "swelling"]

LABELS: Mapping[Noise, str] = {
    "white": "white noise (too small for coloured residuals)",
    "coloured": "coloured noise, alike in all runs of a channel",
    "swelling": "noise that swells and fades along the runs",
}


@dataclass(frozen=True, eq=False)
class Covariance:
    """Covariance of the solver's vector under one assumption on the noise."""

    noise: Noise
    variables: Unknowns
    matrix: Array
    """(K, K); rows and columns of unknowns at a bound or undetermined are 0."""
    determined: NDArray[np.bool_]
    """(K,) unknowns that have a variance."""
    degrees_of_freedom: Array
    """(K,) of Student's distribution for each interval; inf is the normal one."""

    @property
    def label(self) -> str:
        """The assumption in words."""
        return LABELS[self.noise]

    @property
    def standard_errors(self) -> Array:
        """(K,) of the solver's numbers; inf where undetermined, 0 for one held at a bound."""
        errors: Array = np.sqrt(np.maximum(np.diag(self.matrix), 0.0))
        known = self.determined | ~self.variables.free
        standard: Array = np.where(known, errors, np.inf)
        return standard

    @property
    def correlation(self) -> Array:
        """(K, K) with 1 on the diagonal; 0 beside it for what has no variance."""
        errors = np.sqrt(np.maximum(np.diag(self.matrix), 0.0))
        scaled = np.where(errors > 0.0, errors, 1.0)
        correlation: Array = np.clip(self.matrix / np.outer(scaled, scaled), -1.0, 1.0)
        np.fill_diagonal(correlation, 1.0)
        return correlation


def white_noise_covariance(fit: LinearisedFit) -> Covariance:
    """Covariance if the residuals were white: s²(JᵀJ)⁻¹. To stand next to the others, labelled.

    Raises
    ------
    InputError
        If there are no more samples than unknowns.
    """
    spare = fit.spare_samples
    matrix = fit.squares / spare * (fit.whitening @ fit.whitening.T)
    return covariance_of("white", fit, matrix, np.full(fit.variables.count, float(spare)))


def spectrum(window: Array, size: int) -> Array:
    """(size//2 + 1,) spectrum of a symmetric window given at the lags 0, 1, ..."""
    mirrored = np.zeros(size)
    mirrored[: window.size] = window
    mirrored[size - window.size + 1 :] = window[:0:-1]
    power: Array = rfft(mirrored).real
    return power


def covariance_of(noise: Noise, fit: LinearisedFit, matrix: Array, freedom: Array) -> Covariance:
    """A covariance from a matrix, cleared of what the fit does not determine."""
    known = np.outer(fit.determined, fit.determined)
    symmetric = 0.5 * (matrix + matrix.T)
    return Covariance(
        noise, fit.variables, np.where(known, symmetric, 0.0), fit.determined, freedom
    )
