"""Covariance of the estimates when the residuals are coloured: sandwich with HAC, by run, white."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len, rfft

from swashplate.errors import InputError
from swashplate.identification.autocorrelation import (
    Grid,
    NoiseColour,
    grid_of,
    noise_colours,
)
from swashplate.identification.leverage import corrected_residuals, independent_stretches
from swashplate.identification.linearised import LinearisedFit
from swashplate.identification.variables import Variables

Array = NDArray[np.float64]
Noise = Literal["white", "coloured", "swelling", "HAC", "by run"]

BANDWIDTH = 4.0
"""Longest lag of the HAC estimate, in correlation lengths: Parzen's window there keeps 0.72 of the
covariance at one correlation length, and more where most of it is."""

PARZEN_ENERGY = 151.0 / 280.0
"""Integral of Parzen's window squared: what an estimate's variance is inversely to."""

LABELS: Mapping[Noise, str] = {
    "white": "white noise (too small for coloured residuals)",
    "coloured": "coloured noise, alike in all runs of a channel",
    "swelling": "noise that swells and fades along the runs",
    "HAC": "heteroskedasticity and autocorrelation consistent",
    "by run": "clusters, one for each run",
}


@dataclass(frozen=True, eq=False)
class Covariance:
    """Covariance of the solver's vector under one assumption on the noise."""

    noise: Noise
    variables: Variables
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


def hac_covariance(
    fit: LinearisedFit, *, bandwidths: Mapping[str, float] | None = None
) -> Covariance:
    """Sandwich covariance with scores that are correlated over time and differ in size.

    Parameters
    ----------
    fit : LinearisedFit
        The fit. Its runs, and channels of a run, are taken as independent of each other.
    bandwidths : mapping of str to float, optional
        For each channel the lag from which on scores are uncorrelated. [s]
        By default four times the time over which its residuals stay correlated.

    Raises
    ------
    InputError
        If there are no more samples than unknowns, or a channel has no bandwidth.

    Notes
    -----
    (JᵀJ)⁻¹ S (JᵀJ)⁻¹ with S = Σ_runs Σ_{t,u} k((t-u)/b) J_tᵀ r_t r_u J_u, k Parzen's window: it
    keeps S positive semi-definite as Bartlett's does, with a bias of second order as the
    quadratic-spectral one has, and ends at b, so that gaps and short runs are respected exactly.
    The residuals are corrected for what the fit took from them (`leverage`). Intervals use
    Student's quantile with the number of independent stretches (length 0.54 b, where the window's
    energy is that of a block) in which an unknown's noise was seen: with a normal quantile the
    noise of the variance estimate itself costs some per cent of coverage.
    """
    fit.spare_samples  # noqa: B018  refuses what tells nothing of the noise
    grids = [grid_of(run.time) for run in fit.runs]
    widths = _bandwidths(fit, grids, bandwidths)
    directions = fit.whitening
    middle = directions.T @ fit.prior_middle @ directions
    for run, grid, width, residual in zip(
        fit.runs, grids, widths, corrected_residuals(fit, grids, widths), strict=True
    ):
        scores = (run.jacobian @ directions) * residual[:, None]
        middle += windowed_products(scores, grid, parzen(width))
    freedom = independent_stretches(fit, grids, [PARZEN_ENERGY * width for width in widths])
    return covariance_of("HAC", fit, directions @ middle @ directions.T, freedom)


def cluster_covariance(fit: LinearisedFit) -> Covariance:
    """Sandwich covariance that takes nothing for granted but that experiments are independent.

    Raises
    ------
    InputError
        If there are fewer than two experiments.

    Notes
    -----
    S = G/(G-1) Σ g gᵀ over the G experiments, g = Σ_t J_tᵀ r_t; Student's quantile with G - 1
    degrees of freedom. With few experiments, or unknowns of single ones, it is of little use.
    """
    scores: dict[str, Array] = {}
    for run in fit.runs:
        score = fit.whitening.T @ (run.jacobian.T @ run.residual)
        scores[run.name] = scores.get(run.name, 0.0) + score
    count = len(scores)
    if count < 2:
        raise InputError("Errors by run need at least two experiments; there is one.")
    stacked = np.array(list(scores.values()))
    middle = count / (count - 1.0) * stacked.T @ stacked
    matrix = fit.whitening @ middle @ fit.whitening.T
    return covariance_of("by run", fit, matrix, np.full(fit.variables.count, count - 1.0))


def parzen(width: float) -> Array:
    """(L,) Parzen's window at the lags 0 to L - 1, beyond which it is 0.

    Parameters
    ----------
    width : float
        Lag at which it ends, in steps; up to 1 leaves the lag 0 alone.
    """
    lag = np.arange(max(int(np.ceil(width)), 1)) / max(width, 1.0)
    near = 1.0 - 6.0 * lag**2 + 6.0 * lag**3
    window: Array = np.where(lag <= 0.5, near, 2.0 * (1.0 - lag) ** 3)
    return window


def windowed_products(columns: Array, grid: Grid, window: Array) -> Array:
    """(K, K) Σ_{t,u} window(|t-u|) c_tᵀ c_u of columns (n, K) that lie on a grid."""
    size = next_fast_len(grid.size + window.size, real=True)
    spectra = rfft(np.ascontiguousarray(grid.spread(columns).T), size)
    power = spectrum(window, size)
    # a real signal's spectrum stands for its mirror image too, but at the ends
    power[1 : (size + 1) // 2] *= 2.0
    products: Array = ((spectra * power) @ spectra.conj().T).real / size
    return 0.5 * (products + products.T)


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


def _bandwidths(
    fit: LinearisedFit, grids: list[Grid], given: Mapping[str, float] | None
) -> list[float]:
    """Bandwidth of each run, in its steps."""
    if given is None:
        return run_widths(fit, noise_colours(fit), BANDWIDTH)
    missing = sorted({run.channel for run in fit.runs} - set(given))
    if missing:
        raise InputError(f"The bandwidth of channel {missing[0]} is missing; give it in seconds.")
    return [
        max(given[run.channel] / grid.step, 1.0) for run, grid in zip(fit.runs, grids, strict=True)
    ]


def run_widths(fit: LinearisedFit, colours: tuple[NoiseColour, ...], factor: float) -> list[float]:
    """For each run `factor` times the correlation length of its colour, at least 1. [steps]"""
    widths = [1.0] * len(fit.runs)
    for colour in colours:
        for member in colour.members:
            widths[member] = max(factor * colour.length, 1.0)
    return widths
