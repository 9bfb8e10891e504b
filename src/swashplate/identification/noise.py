"""Noise of residuals: its autocorrelation, and the covariance of the estimates that follows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from swashplate.identification.linearised import LinearisedFit, LinearisedRun
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


Places = NDArray[np.intp]

LONGEST = 0.25
"""Longest lag looked at, as a part of the longest run: beyond it too few pairs are left."""

DRIFTING = 0.3
"""Correlation length, as a part of the longest lag looked at, from which it is a model error."""

IN_A_ROW = 5
"""Lags in a row that must lie inside their band where a correlation is said to end."""

STRAY = 0.2
"""Share of those that follow that may lie outside."""

SAME_STEP = 0.01
"""Relative difference of two runs' sampling steps below which they are treated as one."""


class Grid(NamedTuple):
    """Even time grid that a run's samples lie on, its gaps left empty."""

    places: Places
    """(n,) place of each sample, from 0, increasing."""
    size: int
    """Places in all."""
    step: float
    """[s]"""

    @property
    def whole(self) -> bool:
        """Whether there are no gaps."""
        return self.size == self.places.size

    def spread(self, samples: Array) -> Array:
        """(size, ...) samples (n, ...) on the grid, 0 in the gaps."""
        if self.whole:
            return samples
        spread = np.zeros((self.size, *samples.shape[1:]))
        spread[self.places] = samples
        return spread


def grid_of(time: Array) -> Grid:
    """The grid of a run from its stamps; the step is their median distance.

    Every sample gets a place of its own, so that jitter of the stamps moves the grid, not the
    order. Very long gaps are shortened to at least fifteen times the samples in all gaps' total,
    far longer than any lag that is looked at.
    """
    if time.size < 2:
        return Grid(np.zeros(time.size, np.intp), time.size, 1.0)
    apart = np.diff(time)
    step = float(np.median(apart))
    steps = np.maximum(np.rint(apart / step), 1.0)
    gaps = int(np.count_nonzero(steps > 1.0))
    steps = np.minimum(steps, max(15 * time.size // max(gaps, 1), 2))
    places = np.concatenate([[0], np.cumsum(steps)]).astype(np.intp)
    return Grid(places, int(places[-1]) + 1, step)


def pair_sums(samples: Array, grid: Grid, lags: int) -> tuple[Array, Array]:
    """Sums of products of samples a lag apart, and how many pairs there are.

    Parameters
    ----------
    samples : (n,) array
        Of one run.
    grid : Grid
        Where they lie.
    lags : int
        Largest lag, in steps.

    Returns
    -------
    sums, counts : (lags + 1,) arrays
        For the lags 0 to `lags`; pairs across a gap count with their true distance.
    """
    size = next_fast_len(grid.size + lags, real=True)
    spectrum = rfft(grid.spread(samples), size)
    sums = irfft(np.abs(spectrum) ** 2, size)[: lags + 1]
    if grid.whole:
        counts = np.maximum(grid.size - np.arange(lags + 1.0), 0.0)
    else:
        present = rfft(grid.spread(np.ones(samples.size)), size)
        counts = np.rint(irfft(np.abs(present) ** 2, size)[: lags + 1])
    return sums, counts


def correlation_length(autocovariance: Array, counts: Array) -> int:
    """First lag after which the autocorrelation stays inside its band.

    Parameters
    ----------
    autocovariance : (m + 1,) array
        At the lags 0 to m.
    counts : (m + 1,) array
        Pairs that each was taken from.

    Returns
    -------
    int
        0 for white noise, at most m.

    Notes
    -----
    The band at lag k is ±2 √((1 + 2 Σ_{j<k} ρ_j²)/n), Bartlett's for noise that is correlated over
    fewer than k lags; "stays" means at least five lags in a row (Politis 2003), and not more than a
    fifth of the next max(20, k/4): far out one lag in twenty lies outside by chance, and to wait
    for k/4 in a row there would be to wait for ever. A first-order plug-in from the lag-one
    correlation (Andrews 1991) is not used: filtered noise is smooth from sample to sample and its
    lag one says hardly anything of its length, and a small slow part under white noise would be
    missed.
    """
    variance = float(autocovariance[0])
    if not variance > 0.0:
        return 0
    rho = autocovariance / variance
    before = np.concatenate([[0.0], np.cumsum(rho[1:-1] ** 2)]) if rho.size > 1 else np.zeros(0)
    band = 2.0 * np.sqrt((1.0 + 2.0 * before) / np.maximum(counts[1:], 1.0))
    outside = np.abs(rho[1:]) > band  # of lag k at k - 1
    for length in (0, *(np.flatnonzero(outside) + 1)):
        after = outside[length : length + max(20, length // 4)]
        if not after[:IN_A_ROW].any() and after.sum() <= STRAY * max(after.size, 1):
            return int(length)
    return int(rho.size - 1)


def flat_top(lags: Array, length: float) -> Array:
    """Taper that leaves lags up to `length` alone and falls to 0 at twice that.

    Politis's (2003) flat top, with a cosine in place of the straight flank: a tone in the
    residuals, the beat of an ammeter's current, then leaks less into other frequencies.
    """
    beyond = np.clip(lags / max(length, 1.0) - 1.0, 0.0, 1.0)
    return 0.5 * (1.0 + np.cos(np.pi * beyond))


@dataclass(frozen=True, eq=False)
class NoiseColour:
    """How the residuals of one channel are correlated, from all its runs of one sampling step."""

    channel: str
    members: tuple[int, ...]
    """Numbers of the runs in the fit."""
    step: float
    """Sampling step. [s]"""
    correlation: Array
    """(L + 1,) autocorrelation at the lags 0 to L, tapered; beyond L it is 0."""
    length: int
    """Lag after which it stays inside its band, in steps."""
    longest: int
    """Longest lag looked at, in steps."""

    @property
    def duration(self) -> float:
        """Time over which the residuals stay correlated. [s]"""
        return self.length * self.step

    @property
    def inflation(self) -> float:
        """Samples that stand for one independent sample, at least 1: 1 + 2 Σ ρ."""
        return max(1.0, float(2.0 * self.correlation.sum() - 1.0))

    @property
    def drifting(self) -> bool:
        """Whether the runs are only a few correlation lengths long: no noise does that."""
        return self.length > max(DRIFTING * self.longest, 5.0)

    def effective_samples(self, samples: int) -> float:
        """Independent samples that `samples` correlated ones are worth.

        Notes
        -----
        n/(1 + 2 Σ ρ_k), for noise of first order n (1 - ρ)/(1 + ρ).
        """
        return max(samples / self.inflation, min(1.0, float(samples)))


def unweighted(run: LinearisedRun) -> Array:
    """(n,) differences simulated less measured, without the weights if those are known."""
    return run.residual if run.weight is None else run.residual / run.weight


def noise_colours(fit: LinearisedFit) -> tuple[NoiseColour, ...]:
    """Colours of the residuals of each channel, pooled over its runs."""
    colours = []
    grids = [grid_of(run.time) for run in fit.runs]
    for members in _alike(fit, grids):
        longest = int(LONGEST * max(grids[k].size for k in members))
        sums, counts = np.zeros(longest + 1), np.zeros(longest + 1)
        for k in members:
            added, pairs = pair_sums(unweighted(fit.runs[k]), grids[k], longest)
            sums, counts = sums + added, counts + pairs
        colours.append(
            colour_of(fit.runs[members[0]].channel, members, grids[members[0]].step, sums, counts)
        )
    return tuple(colours)


def colour_of(
    channel: str, members: Sequence[int], step: float, sums: Array, counts: Array
) -> NoiseColour:
    """A colour from sums of products and their counts at the lags 0 to m."""
    autocovariance = sums / np.maximum(counts, 1.0)
    length = correlation_length(autocovariance, counts)
    flat = min(length, (sums.size - 1) // 2)  # the taper must have come down at the longest lag
    lags = np.arange(min(2 * max(flat, 1), sums.size - 1) + 1.0)
    white = np.where(lags == 0.0, 1.0, 0.0)
    correlation = (
        autocovariance[: lags.size] / autocovariance[0] * flat_top(lags, flat)
        if autocovariance[0] > 0.0 and flat
        else white
    )
    return NoiseColour(channel, tuple(members), step, correlation, length, sums.size - 1)


def _alike(fit: LinearisedFit, grids: Sequence[Grid]) -> list[tuple[int, ...]]:
    """Numbers of runs of the same channel and step."""
    groups: list[list[int]] = []
    for k, run in enumerate(fit.runs):
        for group in groups:
            first = group[0]
            if fit.runs[first].channel == run.channel and (
                abs(grids[k].step - grids[first].step) <= SAME_STEP * grids[first].step
                or run.time.size < 2
            ):
                group.append(k)
                break
        else:
            groups.append([k])
    return [tuple(group) for group in groups]


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
