"""What a fit takes away from its residuals, and how much independent noise each unknown saw."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from swashplate.identification.autocorrelation import Grid
from swashplate.identification.linearised import LinearisedFit

Array = NDArray[np.float64]
Edges = NDArray[np.intp]

LARGEST = 1.0 - 1e-4
"""Leverage beyond which a stretch is not corrected further: it holds next to no noise."""


def stretches(grid: Grid, length: float, at_least: int = 1) -> Edges:
    """Bounds of the stretches of about equal time into which a run is cut.

    Parameters
    ----------
    grid : Grid
        Where the samples lie.
    length : float
        Wanted length. [steps]
    at_least : int
        Fewest steps in one.

    Returns
    -------
    (m + 1,) array of int
        Stretch k holds the samples from element k to before element k + 1; none is empty.
    """
    count = max(1, round(grid.size / max(length, at_least, 1.0)))
    edges = np.linspace(0.0, grid.size, count + 1)
    bounds: Edges = np.unique(np.searchsorted(grid.places, edges))
    return bounds


def corrected_residuals(
    fit: LinearisedFit, grids: Sequence[Grid], lengths: Sequence[float]
) -> Iterator[Array]:
    """Weighted residuals as large as they would be, had the fit not followed the noise.

    Parameters
    ----------
    fit : LinearisedFit
        The fit.
    grids : sequence of Grid
        Of its runs.
    lengths : sequence of float
        For each run the time over which noise is correlated. [steps]

    Yields
    ------
    (n,) array
        For each run.

    Notes
    -----
    In a stretch with derivatives J_b, r_b ← (1 - J_b (JᵀJ)⁻¹ J_bᵀ)^(-1/2) r_b (Bell and McCaffrey
    2002, with stretches in place of clusters). If the noise of different stretches is independent
    and inflates all directions alike, the scores J_bᵀ r_b then have the covariance of those of the
    noise itself. Slow directions need it: the fit takes from them more than samples suggest.
    """
    whitening = fit.whitening
    for run, grid, length in zip(fit.runs, grids, lengths, strict=True):
        directions = run.jacobian @ whitening
        corrected = run.residual.copy()
        # shorter stretches than unknowns would cost much and correct nothing
        bounds = stretches(grid, length, at_least=4 * max(fit.rank, 1))
        for first, last in pairwise(bounds):
            part = directions[first:last]
            share, axes = np.linalg.eigh(part.T @ part)
            share = np.clip(share, 1e-12, LARGEST)
            gain = ((1.0 - share) ** -0.5 - 1.0) / share
            along = axes.T @ (part.T @ run.residual[first:last])
            corrected[first:last] += part @ (axes @ (gain * along))
        yield corrected


def independent_stretches(
    fit: LinearisedFit, grids: Sequence[Grid], lengths: Sequence[float]
) -> Array:
    """(K,) in how many independent stretches the noise of each unknown's estimate was seen.

    Parameters
    ----------
    fit, grids, lengths :
        As of `corrected_residuals`.

    Returns
    -------
    (K,) array
        (Σ v)²/Σ v² over all stretches, v their share of the variance if the noise is the same
        everywhere: the degrees of freedom of a variance that is estimated from them. 1 for an
        unknown that a single short stretch determines, such as an initial pressure.
    """
    inverse = fit.whitening @ fit.whitening.T
    total = np.zeros(fit.variables.count)
    squares = np.zeros(fit.variables.count)
    for run, grid, length in zip(fit.runs, grids, lengths, strict=True):
        influence = (run.jacobian @ inverse) ** 2
        shares = np.add.reduceat(influence, stretches(grid, length)[:-1], axis=0)
        total += shares.sum(axis=0)
        squares += (shares**2).sum(axis=0)
    return np.divide(total**2, squares, out=np.ones_like(total), where=squares > 0.0)
