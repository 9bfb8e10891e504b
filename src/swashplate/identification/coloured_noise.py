"""Covariance of the estimates when each channel's noise is stationary but coloured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from swashplate.identification.autocorrelation import (
    LONGEST,
    Grid,
    NoiseColour,
    colour_of,
    grid_of,
    noise_colours,
    pair_sums,
    unweighted,
)
from swashplate.identification.covariance import Covariance, covariance_of, spectrum
from swashplate.identification.linearised import LinearisedFit, LinearisedRun

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

ROUNDS = 3
"""How often the autocovariance is corrected for what the fit took from the residuals. Each round
leaves about the share that was taken, mostly a tenth, of the error before it."""

FLAT_TOP_ENERGY = 11.0 / 4.0
"""Sum over all lags of the flat-top taper squared, in correlation lengths."""

BORROWED = 4.0
"""A run's noise level counts as much of the channel's level as so many independent samples."""


def coloured_noise_covariance(
    fit: LinearisedFit, *, colours: Sequence[NoiseColour] | None = None
) -> Covariance:
    """Covariance of the least-squares estimate under stationary coloured noise.

    Parameters
    ----------
    fit : LinearisedFit
        The fit. Its runs, and channels of a run, are taken as independent of each other.
    colours : sequence of NoiseColour, optional
        Those of the residuals, if they are known already.

    Raises
    ------
    InputError
        If there are no more samples than unknowns.

    Notes
    -----
    (JᵀJ)⁻¹ (Σ_runs Uᵀ Γ U) (JᵀJ)⁻¹ with U = w J, the weights twice, and Γ the Toeplitz matrix of
    the noise's autocovariance, taken from the residuals (Maine and Iliff 1981; Morelli and Klein
    1994). Its shape is common to all runs of a channel, its level each run's own. The residuals are
    the noise less what the fit took from it, so the autocovariance is too small, most of all at the
    low frequencies where the derivatives are; the expected loss follows from Γ itself, is given
    back, and the new Γ taken. It needs noise that is alike all along a run, and then also serves
    unknowns that one short stretch determines.
    """
    model = noise_model(fit, colours=colours)
    return covariance_of(
        "coloured",
        fit,
        fit.whitening @ sum(model.middles, model.prior) @ fit.whitening.T,
        _freedom(fit, model),
    )


class NoiseModel(NamedTuple):
    """Noise of all runs, with what the fit took from it given back."""

    colours: tuple[NoiseColour, ...]
    levels: Mapping[int, float]
    """Variance of the unweighted noise of each run, by its number."""
    middles: tuple[Array, ...]
    """For each colour (rank, rank) covariance of the scores in orthonormal directions."""
    prior: Array
    """(rank, rank) the same of the priors."""
    freedoms: tuple[Array, ...]
    """For each colour (K,) degrees of freedom of what it adds to each unknown's variance."""


def noise_model(fit: LinearisedFit, *, colours: Sequence[NoiseColour] | None = None) -> NoiseModel:
    """Autocovariance of each channel's noise from residuals, see `coloured_noise_covariance`.

    Raises
    ------
    InputError
        If there are no more samples than unknowns.
    """
    fit.spare_samples  # noqa: B018  refuses what tells nothing of the noise
    count = fit.rank
    known = colours if colours is not None else noise_colours(fit)
    parts = [_Part(run, fit.whitening) for run in fit.runs]
    prior = fit.whitening.T @ fit.prior_middle @ fit.whitening
    middles = [np.zeros((count, count))] * len(known)
    refined = list(known)
    losses = [np.zeros(part.sums.size) for part in parts]
    levels: dict[int, float] = {}
    for turn in range(ROUNDS + 1):
        for k, colour in enumerate(refined):
            levels |= _levels(colour, parts, losses)
            middles[k] = sum(
                (parts[m].middle(levels[m] * colour.correlation) for m in colour.members),
                np.zeros((count, count)),
            )
        if turn == ROUNDS:
            break
        whole = sum(middles, prior)
        for k, colour in enumerate(refined):
            for m in colour.members:
                losses[m] = parts[m].loss(levels[m] * colour.correlation, whole)
            refined[k] = _refined(colour, parts, losses)
    freedoms = tuple(_spectral_freedom(fit, colour, parts, levels) for colour in refined)
    return NoiseModel(tuple(refined), levels, tuple(middles), prior, freedoms)


class _Part:
    """One run on its grid, in the directions whose derivatives are orthonormal."""

    def __init__(self, run: LinearisedRun, whitening: Array) -> None:
        self.grid: Grid = grid_of(run.time)
        directions = run.jacobian @ whitening
        weight = None if run.weight is None else run.weight[:, None]
        lags = max(int(LONGEST * self.grid.size), 1)
        self.sums, self.counts = pair_sums(unweighted(run), self.grid, lags)
        self.size: int = next_fast_len(self.grid.size + lags, real=True)
        self.by_noise = self._spectra(directions if weight is None else weight * directions)
        self.by_estimate = self.by_noise if weight is None else self._spectra(directions / weight)

    def _spectra(self, columns: Array) -> Complex:
        spread = np.ascontiguousarray(self.grid.spread(columns).T)
        spectra: Complex = rfft(spread, self.size)
        return spectra

    def power(self, autocovariance: Array) -> Array:
        """(size//2 + 1,) the noise's spectrum."""
        # a tapered estimate may dip below zero between two peaks; a spectrum does not
        return np.maximum(spectrum(autocovariance[: self.sums.size], self.size), 0.0)

    def middle(self, autocovariance: Array) -> Array:
        """(rank, rank) Uᵀ Γ U."""
        power = self.power(autocovariance)
        power[1 : (self.size + 1) // 2] *= 2.0
        products: Array = ((self.by_noise * power) @ self.by_noise.conj().T).real / self.size
        return 0.5 * (products + products.T)

    def loss(self, autocovariance: Array, whole: Array) -> Array:
        """(lags + 1,) what the fit takes from the sums of products, if the noise is like this."""
        filtered = irfft(self.by_noise * self.power(autocovariance), self.size)
        # only where the run has samples
        kept = filtered[:, self.grid.places] if not self.grid.whole else filtered
        kept = kept[:, : self.grid.size]
        taken = self._spectra(kept.T)
        cross = 2.0 * np.sum(self.by_estimate.conj() * taken, axis=0).real
        own = np.sum(self.by_estimate.conj() * (whole @ self.by_estimate), axis=0).real
        lost: Array = irfft(cross - own, self.size)
        return lost[: self.sums.size]


def _levels(
    colour: NoiseColour, parts: Sequence[_Part], losses: Sequence[Array]
) -> dict[int, float]:
    """Noise variance of each run of a channel."""
    sums = {m: float(parts[m].sums[0] + max(losses[m][0], 0.0)) for m in colour.members}
    counts = {m: float(parts[m].counts[0]) for m in colour.members}
    common = sum(sums.values()) / sum(counts.values())
    levels = {}
    for m in colour.members:
        worth = counts[m] / colour.inflation
        levels[m] = (worth * sums[m] / counts[m] + BORROWED * common) / (worth + BORROWED)
    return levels


def _refined(colour: NoiseColour, parts: Sequence[_Part], losses: Sequence[Array]) -> NoiseColour:
    """The colour with the losses given back."""
    lags = colour.longest + 1
    sums, counts = np.zeros(lags), np.zeros(lags)
    for m in colour.members:
        part = parts[m]
        some = min(lags, part.sums.size)
        sums[:some] += part.sums[:some] + losses[m][:some]
        counts[:some] += part.counts[:some]
    return colour_of(colour.channel, colour.members, colour.step, sums, counts)


def _spectral_freedom(
    fit: LinearisedFit, colour: NoiseColour, parts: Sequence[_Part], levels: Mapping[int, float]
) -> Array:
    """(K,) degrees of freedom of a colour's part of each unknown's variance.

    Those of the smoothed spectrum at one frequency, or, where more, two for each run and each of
    the frequencies over which an unknown's derivatives spread: it averages over those.
    """
    samples = sum(fit.runs[m].time.size for m in colour.members)
    smoothed = samples / max(FLAT_TOP_ENERGY * colour.length, 1.0)
    weight = np.zeros(fit.variables.count)
    counted = np.zeros(fit.variables.count)
    for m in colour.members:
        part = parts[m]
        power = part.power(levels[m] * colour.correlation)
        seen = np.abs(fit.whitening @ part.by_noise) ** 2 * power
        total, squares = seen.sum(axis=1), np.sum(seen**2, axis=1)
        # bins of the padded spectrum that stand for one independent frequency
        padded = part.size / part.grid.size
        spread = np.divide(total**2, squares, out=np.zeros_like(total), where=squares > 0.0)
        weight += total
        counted += total * np.maximum(spread / padded, 1.0)
    frequencies = np.divide(counted, weight, out=np.ones_like(weight), where=weight > 0.0)
    averaged = 2.0 * len(colour.members) * frequencies
    freedom: Array = np.clip(np.maximum(smoothed, averaged), 1.0, max(samples - fit.rank, 1))
    return freedom


def _freedom(fit: LinearisedFit, model: NoiseModel) -> Array:
    """(K,) degrees of freedom of each variance, from those of the channels."""
    total = np.einsum("ki,ij,kj->k", fit.whitening, model.prior, fit.whitening)
    spread = np.zeros(fit.variables.count)
    for middle, independent in zip(model.middles, model.freedoms, strict=True):
        share = np.einsum("ki,ij,kj->k", fit.whitening, middle, fit.whitening)
        total = total + share
        spread += share**2 / independent
    freedom: Array = np.divide(
        total**2, spread, out=np.full_like(total, np.inf), where=spread > 0.0
    )
    return freedom
