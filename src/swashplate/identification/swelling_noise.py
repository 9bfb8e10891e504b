"""Covariance of the estimates when noise swells and fades along a run, tones among it."""

from __future__ import annotations

import numpy as np
from scipy.fft import rfft, rfftfreq

from swashplate.identification.autocorrelation import grid_of
from swashplate.identification.covariance import Covariance, covariance_of
from swashplate.identification.linearised import LinearisedFit

BAND = 10.0
"""Width of the bands, within which noise may swell and fade in any way. [Hz]"""
FEWEST = 20.0
"""Bands up to half the sampling rate, where that is low."""


def swelling_noise_covariance(fit: LinearisedFit) -> Covariance:
    """Covariance of the least-squares estimate under noise that differs along the runs.

    Parameters
    ----------
    fit : LinearisedFit
        The fit. Its runs, and channels of a run, are taken as independent of each other.

    Raises
    ------
    InputError
        If there are no more samples than unknowns.

    Notes
    -----
    (JᵀJ)⁻¹ Σ_runs Σ_bands ½ Re(C Cᴴ) (JᵀJ)⁻¹, C = Σ_{f in band} J(f)* r(f): the score of one band,
    its parts at rest and a quarter period later. Within a band the score is summed before it is
    squared, so that noise which comes with every step, or a ripple that meets ten reversals at the
    same phase, counts in full; stationary noise of any colour gives the same on average. Neither
    holds of an autocovariance of the whole run. The quarter period later is what no fit has taken
    anything from. Degrees of freedom are those of a sum of squares, two for each band and run:
    fewer than a stationary estimate has, so the two belong together (`uncertainty`).
    """
    fit.spare_samples  # noqa: B018  refuses what tells nothing of the noise
    rank = fit.rank
    middle = fit.whitening.T @ fit.prior_middle @ fit.whitening
    total = np.einsum("ki,ij,kj->k", fit.whitening, middle, fit.whitening)
    squares = np.zeros(fit.variables.count)
    for run in fit.runs:
        grid = grid_of(run.time)
        derivatives = rfft(grid.spread(run.jacobian @ fit.whitening), axis=0)
        products = derivatives.conj() * rfft(grid.spread(run.residual))[:, None]
        # a real signal's spectrum stands for its mirror image too, but at the ends
        products *= 2.0 / grid.size
        products[0] *= 0.5
        frequencies = rfftfreq(grid.size, grid.step)
        width = min(BAND, 0.5 / grid.step / FEWEST)
        band = (frequencies / width).astype(np.intp)
        scores = np.add.reduceat(products, np.flatnonzero(np.diff(band, prepend=-1)), axis=0)
        middle = middle + 0.5 * (scores.conj().T @ scores).real
        seen = 0.5 * np.abs(scores @ fit.whitening.T) ** 2
        total += seen.sum(axis=0)
        squares += np.sum(seen**2, axis=0)
    assert middle.shape == (rank, rank)
    freedom = np.divide(2.0 * total**2, squares, out=np.ones_like(total), where=squares > 0.0)
    matrix = fit.whitening @ middle @ fit.whitening.T
    return covariance_of("swelling", fit, matrix, np.maximum(freedom, 1.0))
