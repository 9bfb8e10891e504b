"""Lack of fit: what is left in residuals that noise does not explain."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from swashplate.errors import InputError
from swashplate.identification.noise import (
    LONGEST,
    Grid,
    correlation_length,
    grid_of,
    pair_sums,
)

Array = NDArray[np.float64]


LONGEST_SHOWN = 2.0
"""Largest lag of the curves. [s]"""

DEVIATIONS = 1.96
"""Half width of the bands, in standard deviations: 95 %."""

CHANCE = 0.05
"""Probability that unrelated signals are said to be related, all lags together."""


@dataclass(frozen=True, eq=False)
class ResidualTest:
    """Whiteness of the residuals of one channel of one run, and independence of the input."""

    lags: Array
    """(m,) from 0. [s]"""
    autocorrelation: Array
    """(m,) of the residuals."""
    white_band: float
    """Half width of the 95 % band of white noise."""
    cross_lags: Array
    """(2 m - 1,) positive where the residual comes after the input. [s]"""
    cross_correlation: Array
    """(2 m - 1,) of the residuals with the input."""
    cross_band: float
    """Half width of the 95 % band of residuals, coloured as these are, without relation to the
    input."""
    duration: float
    """Time over which the residuals stay correlated; 0 if they are white. [s]"""
    samples: int
    verdict: str
    """In words."""

    @property
    def white(self) -> bool:
        """Whether nothing but white noise is left."""
        return self.duration == 0.0

    @property
    def peak(self) -> tuple[float, float]:
        """Lag of the largest cross-correlation [s], and its value."""
        place = int(np.argmax(np.abs(self.cross_correlation)))
        return float(self.cross_lags[place]), float(self.cross_correlation[place])


def residual_test(
    time: Array, residual: Array, command: Array, *, longest: float = LONGEST_SHOWN
) -> ResidualTest:
    """Test the residuals of one channel of one run.

    Parameters
    ----------
    time : (n,) array
        Stamps of the samples that count; gaps are respected. [s]
    residual : (n,) array
        Simulated less measured, weights left out.
    command : (n,) array
        The input at the same stamps, in its unit.
    longest : float
        Largest lag of the curves; at most a quarter of the run is shown. [s]

    Raises
    ------
    InputError
        If lengths differ, a number is not finite, or there are fewer than 8 samples.

    Notes
    -----
    The band of the cross-correlation is 1.96 √(Σ ρ_r ρ_u/n): two coloured signals without any
    relation show large correlations by chance (Bartlett's formula), and a band of 1.96/√n would
    call every one of them a finding.
    """
    if not time.shape == residual.shape == command.shape:
        raise InputError(
            f"{time.size} stamps, {residual.size} residuals and {command.size} samples of the "
            "input do not belong together."
        )
    if time.size < 8:
        raise InputError(f"{time.size} samples tell nothing of correlation; 8 are the least.")
    if not (np.isfinite(residual).all() and np.isfinite(command).all()):
        raise InputError("Residuals and input must be finite; leave the other samples out.")
    grid = grid_of(time)
    most = max(int(LONGEST * grid.size), 1)
    own, counts = _autocorrelation(residual - residual.mean(), grid, most)
    theirs, _ = _autocorrelation(command - command.mean(), grid, most)
    length = correlation_length(own, counts)
    shown = min(most, max(int(longest / grid.step), 1))
    cross = _cross_correlation(residual - residual.mean(), command - command.mean(), grid, shown)
    # beyond the residuals' own length their estimated correlation is chance
    kept = slice(1, max(length, 1) + 1)
    inflation = max(1.0, 1.0 + 2.0 * float(own[kept] @ theirs[kept]))
    band = DEVIATIONS * float(np.sqrt(inflation / time.size))
    lags: Array = np.arange(shown + 1.0) * grid.step
    made = ResidualTest(
        lags,
        own[: shown + 1],
        DEVIATIONS / float(np.sqrt(time.size)),
        np.concatenate([-lags[:0:-1], lags]),
        cross,
        min(band, 1.0),
        length * grid.step,
        time.size,
        "",
    )
    return _judged(made, residual, command)


def _judged(test: ResidualTest, residual: Array, command: Array) -> ResidualTest:
    if not np.any(residual != residual[0]):
        what = "exactly zero" if residual[0] == 0.0 else f"{residual[0]:.4g} throughout"
        return replace(test, verdict=f"The residuals are {what}: there is no noise to test.")
    colour = (
        "The residuals are white"
        if test.white
        else f"The residuals stay correlated over {test.duration:.2g} s"
    )
    if not np.any(command != command[0]):
        return replace(test, verdict=f"{colour}; the input is constant and explains nothing.")
    from scipy.stats import norm

    # neighbouring lags say the same: as many looks as correlation lengths fit
    looks = max(test.cross_lags.size / max(test.duration / test.lags[1], 1.0), 1.0)
    limit = float(norm.isf(0.5 * CHANCE / looks)) / DEVIATIONS * test.cross_band
    lag, value = test.peak
    if abs(value) <= limit:
        return replace(test, verdict=f"{colour} and have no relation to the input.")
    when = (
        f"{lag:.2g} s after it"
        if lag > 0.0
        else f"{-lag:.2g} s before it"
        if lag < 0.0
        else "at the same time"
    )
    return replace(
        test,
        verdict=(
            f"{colour} and follow the input (correlation {value:+.2f} {when}): the model leaves "
            "out something that the input causes."
        ),
    )


def _autocorrelation(samples: Array, grid: Grid, lags: int) -> tuple[Array, Array]:
    sums, counts = pair_sums(samples, grid, lags)
    means = sums / np.maximum(counts, 1.0)
    if not means[0] > 0.0:
        return np.where(np.arange(lags + 1) == 0, 1.0, 0.0), counts
    return np.clip(means / means[0], -1.0, 1.0), counts


def _cross_correlation(residual: Array, command: Array, grid: Grid, lags: int) -> Array:
    """(2 lags + 1,) at the lags -lags to lags, the residual after the input."""
    scale = float(np.linalg.norm(residual) * np.linalg.norm(command))
    if not scale > 0.0:
        return np.zeros(2 * lags + 1)
    size = next_fast_len(grid.size + lags, real=True)
    spectra = rfft(grid.spread(command), size).conj() * rfft(grid.spread(residual), size)
    products = irfft(spectra, size)
    return np.concatenate([products[size - lags :], products[: lags + 1]]) / scale
