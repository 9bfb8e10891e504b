"""Noise of residuals: autocorrelation, spectral lines, and the covariance that follows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq
from scipy.linalg import eigh_tridiagonal

from swashplate.identification.problem import LinearisedFit, LinearisedRun
from swashplate.identification.unknowns import Unknowns
from swashplate.results import Result

Array = NDArray[np.float64]


LEVEL = 0.95
"""Probability of the intervals."""


@dataclass(frozen=True, eq=False)
class Covariance(Result):
    """Covariance of the solver's vector under one assumption on the noise."""

    variables: Unknowns
    matrix: Array
    """(K, K); rows and columns of unknowns at a bound or undetermined are 0."""
    determined: NDArray[np.bool_]
    """(K,) unknowns that have a variance."""
    degrees_of_freedom: Array
    """(K,) of Student's distribution for each interval; inf is the normal one."""

    @property
    def standard_errors(self) -> Array:
        """(K,) of the solver's numbers; inf where undetermined, 0 for one at its bound."""
        known = self.determined | ~self.variables.free
        return np.where(known, np.sqrt(np.maximum(np.diag(self.matrix), 0.0)), np.inf)

    @property
    def quantiles(self) -> Array:
        """(K,) half widths of the intervals in standard errors, Student's."""
        from scipy.special import stdtrit  # of scipy.stats, without its second to load

        return np.asarray(stdtrit(self.degrees_of_freedom, 0.5 + 0.5 * LEVEL))

    @property
    def correlation(self) -> Array:
        """(K, K) with 1 on the diagonal; 0 beside it for what has no variance."""
        errors = np.sqrt(np.maximum(np.diag(self.matrix), 0.0))
        errors[errors == 0.0] = 1.0
        correlation: Array = np.clip(self.matrix / np.outer(errors, errors), -1.0, 1.0)
        np.fill_diagonal(correlation, 1.0)
        return correlation


def covariance_of(fit: LinearisedFit, matrix: Array, freedom: Array) -> Covariance:
    """A covariance from a matrix, cleared of what the fit does not determine."""
    known = np.outer(fit.determined, fit.determined)
    symmetric = 0.5 * (matrix + matrix.T)
    return Covariance(fit.variables, np.where(known, symmetric, 0.0), fit.determined, freedom)


# --- correlation over time ------------------------------------------------------------------------

LONGEST, DRIFTING = 0.25, 0.3
"""Longest lag looked at, as a part of the longest run: beyond it too few pairs are left; and the
correlation length, as a part of that lag, from which it is a model error."""
IN_A_ROW, STRAY = 5, 0.2
"""Lags in a row that must lie inside their band where a correlation is said to end, and the share
of those that follow that may lie outside."""
SAME_STEP = 0.01
"""Relative difference of two runs' sampling steps below which they are treated as one."""


class Grid(NamedTuple):
    """Even time grid that a run's samples lie on, its gaps left empty."""

    places: NDArray[np.intp]
    """(n,) place of each sample, from 0, increasing."""
    size: int
    """Places in all."""
    step: float
    """[s]"""

    def spread(self, samples: Array) -> Array:
        """(size, ...) samples (n, ...) on the grid, 0 in the gaps."""
        if self.size == self.places.size:
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
    """Sums of products of samples (n,) a lag apart, and how many pairs there are.

    Both (lags + 1,), for the lags 0 to `lags` in steps; pairs across a gap count with their true
    distance.
    """
    size = next_fast_len(grid.size + lags, real=True)
    sums = irfft(np.abs(rfft(grid.spread(samples), size)) ** 2, size)[: lags + 1]
    if grid.size == grid.places.size:
        return sums, np.maximum(grid.size - np.arange(lags + 1.0), 0.0)
    present = rfft(grid.spread(np.ones(samples.size)), size)
    return sums, np.rint(irfft(np.abs(present) ** 2, size)[: lags + 1])


def correlation_length(autocovariance: Array, counts: Array) -> int:
    """First lag, 0 to m, after which the autocorrelation stays inside its band; 0 for white noise.

    From the autocovariance (m + 1,) at the lags 0 to m and the number of pairs of each.

    Notes
    -----
    The band at lag k is ±2 √((1 + 2 Σ_{j<k} ρ_j²)/n), Bartlett's for noise that is correlated over
    fewer than k lags; "stays" means at least five lags in a row (Politis 2003), and not more than a
    fifth of the next max(20, k/4): far out one lag in twenty lies outside by chance. A first-order
    plug-in from the lag-one correlation (Andrews 1991) would miss a small slow part under white
    noise.
    """
    if not autocovariance[0] > 0.0:
        return 0
    rho = autocovariance / autocovariance[0]
    before = np.concatenate([[0.0], np.cumsum(rho[1:-1] ** 2)])[: rho.size - 1]
    band = 2.0 * np.sqrt((1.0 + 2.0 * before) / np.maximum(counts[1:], 1.0))
    outside = np.abs(rho[1:]) > band  # of lag k at k - 1
    lengths = np.concatenate([[0], np.flatnonzero(outside) + 1])
    ends = np.minimum(lengths + np.maximum(20, lengths // 4), outside.size)
    so_far = np.concatenate([[0], np.cumsum(outside)])
    near = so_far[np.minimum(lengths + IN_A_ROW, outside.size)] - so_far[lengths]
    stray = so_far[ends] - so_far[lengths]
    stays = (near == 0) & (stray <= STRAY * np.maximum(ends - lengths, 1))
    return int(lengths[np.argmax(stays)]) if stays.any() else int(rho.size - 1)


@dataclass(frozen=True, eq=False)
class NoiseColour(Result):
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
    def inflation(self) -> float:
        """Samples that stand for one independent sample, at least 1: 1 + 2 Σ ρ."""
        return max(1.0, float(2.0 * self.correlation.sum() - 1.0))

    @property
    def drifting(self) -> bool:
        """Whether the runs are only a few correlation lengths long: no noise does that."""
        return self.length > max(DRIFTING * self.longest, 5.0)

    @property
    def sentence(self) -> str:
        """How long the residuals stay correlated, and what that makes the samples worth."""
        if not self.length:
            return f"Residuals of {self.channel} are white."
        during = f"{self.length * self.step:.3g} s"
        start = f"Residuals of {self.channel} stay correlated over {during}"
        if self.inflation <= 1.05:
            return f"{start}, but intervals are those of independent samples: correlations cancel."
        wider = sqrt(self.inflation)
        return (
            f"{start}, so that intervals are about {wider:.2g} times as wide as for independent "
            "samples."
        )


def noise_colours(fit: LinearisedFit) -> tuple[NoiseColour, ...]:
    """Colours of the residuals of each channel, pooled over its runs of one sampling step."""
    grids, groups = [grid_of(run.time) for run in fit.runs], list[list[int]]()
    for k, run in enumerate(fit.runs):
        for group in groups:
            step = grids[group[0]].step
            alike = abs(grids[k].step - step) <= SAME_STEP * step or run.time.size < 2
            if fit.runs[group[0]].channel == run.channel and alike:
                group.append(k)
                break
        else:
            groups.append([k])
    colours = []
    for members in groups:
        longest = int(LONGEST * max(grids[k].size for k in members))
        pairs = [pair_sums(fit.runs[k].unweighted, grids[k], longest) for k in members]
        sums, counts = (np.sum(part, axis=0) for part in zip(*pairs, strict=True))
        autocovariance = sums / np.maximum(counts, 1.0)
        length = correlation_length(autocovariance, counts)
        flat = min(length, longest // 2)  # the taper must have come down at the longest lag
        lags = np.arange(min(2 * max(flat, 1), longest) + 1.0)
        correlation = np.where(lags == 0.0, 1.0, 0.0)
        if autocovariance[0] > 0.0 and flat:
            # Politis's (2003) flat top, with a cosine in place of the straight flank: a spectral
            # line then leaks less into other frequencies
            taper = 0.5 * (1.0 + np.cos(np.pi * np.clip(lags / flat - 1.0, 0.0, 1.0)))
            correlation = autocovariance[: lags.size] / autocovariance[0] * taper
        channel, step = fit.runs[members[0]].channel, grids[members[0]].step
        colours.append(NoiseColour(channel, tuple(members), step, correlation, length, longest))
    return tuple(colours)


# --- covariances ----------------------------------------------------------------------------------

NEIGHBOURS, LEAST_LEFT = 21, 0.1
"""Frequencies, of all runs of a channel together, over which a periodogram is averaged; and the
part of them that the fit must have left for the noise to be known there."""
BAND, FEWEST_BANDS = 10.0, 20.0
"""Width of the bands within which noise may swell and fade in any way [Hz]; bands up to half the
sampling rate, where that is low."""


class _Spectrum:
    """One run in the frequency domain, in directions whose derivatives are orthonormal."""

    def __init__(self, run: LinearisedRun, whitening: Array) -> None:
        grid = grid_of(run.time)
        self.step, scale = grid.step, 1.0 / np.sqrt(grid.size)
        directions, residual = run.jacobian @ whitening, run.unweighted
        weight = np.ones((1, 1)) if run.weight is None else run.weight[:, None]
        self.derivatives = scale * rfft(grid.spread(weight * directions), axis=0)
        """(F, rank) by which the noise enters the scores: with the weights twice."""
        self.frequencies: Array = rfftfreq(grid.size, grid.step)
        self.residual = scale * rfft(grid.spread(residual))
        """(F,) without the weights."""
        if weight.min() == weight.max():
            by_estimate = self.derivatives / weight[:1] ** 2
        else:
            by_estimate = scale * rfft(grid.spread(directions / weight), axis=0)
        products = (self.derivatives.conj() * by_estimate).real
        self.left: Array = 1.0 - np.clip(np.sum(products, axis=1), 0.0, 1.0)
        """(F,) part of the noise that the fit leaves."""
        # a real signal's spectrum stands for its mirror image too, but at the ends
        self.twice: Array = np.full(self.frequencies.size, 2.0)
        self.twice[[0, -1] if grid.size % 2 == 0 else 0] = 1.0
        self.level = float(np.mean(residual**2))


class _Sandwich:
    """(JᵀJ)⁻¹ M (JᵀJ)⁻¹ in the making: M, the unknowns' variances, the squares of their parts."""

    def __init__(self, fit: LinearisedFit) -> None:
        self.fit, self.spare = fit, fit.spare_samples  # refused where there are none
        prior = fit.prior @ fit.whitening
        self.middle: Array = (prior.T * fit.prior_noise) @ prior
        self.total: Array = np.einsum("ki,ij,kj->k", fit.whitening, self.middle, fit.whitening)
        self.squares: Array = np.zeros(len(fit.variables))

    def add(self, middle: Array, parts: Array) -> None:
        """Add to the middle (rank, rank), and parts (n, K) of the variances, all independent."""
        self.middle = self.middle + middle
        self.total += parts.sum(axis=0)
        self.squares += np.sum(parts**2, axis=0)

    def covariance(self, each: float, without: float) -> Covariance:
        """The covariance, a part having `each` degrees of freedom; `without` any part."""
        freedom = np.full_like(self.total, without)
        np.divide(each * self.total**2, self.squares, out=freedom, where=self.squares > 0.0)
        matrix = self.fit.whitening @ self.middle @ self.fit.whitening.T
        return covariance_of(self.fit, matrix, np.maximum(freedom, 1.0))


def spectral_covariance(
    fit: LinearisedFit, spectra: Sequence[_Spectrum] | None = None
) -> Covariance:
    """Covariance of the least-squares estimate under coloured noise, from its smoothed spectrum.

    Runs, and channels of a run, are taken as independent of each other. An `InputError` says that
    there are no more samples than unknowns.

    Notes
    -----
    The sandwich (JᵀJ)⁻¹ (Σ_runs Σ_f J(f)* S(f) J(f)ᵀ) (JᵀJ)⁻¹ with the spectrum S of the residuals
    without their weights (Hannan 1963; Maine and Iliff 1981 in the time domain): the periodogram of
    all runs of a channel, averaged over neighbouring frequencies (Daniell 1946); its shape is
    common to them, its level each run's own. The fit has taken a part h(f) of the noise,
    the leverage of its derivatives there, and of E|r(f)|² = (1 - h) S only the rest is seen: sums
    of squares are divided by sums of 1 - h, as in HC2 of MacKinnon and White (1985). Degrees of
    freedom follow from the frequencies that an unknown's variance is an average over.
    """
    sums, spectra = _Sandwich(fit), spectra or [_Spectrum(r, fit.whitening) for r in fit.runs]
    for channel in dict.fromkeys(run.channel for run in fit.runs):
        parts = [s for s, run in zip(spectra, fit.runs, strict=True) if run.channel == channel]
        order = np.argsort(np.concatenate([part.frequencies for part in parts]), kind="stable")
        power = [np.abs(part.residual) ** 2 / (part.level or 1.0) for part in parts]
        seen = np.concatenate(power)[order]
        left = np.concatenate([part.left for part in parts])[order]
        rest = np.maximum(_smoothed(left), LEAST_LEFT * NEIGHBOURS)
        shape = np.empty(order.size)
        shape[order] = _smoothed(seen) / rest
        weights, middle = [], np.zeros((fit.rank, fit.rank))
        ends = np.cumsum([part.frequencies.size for part in parts])[:-1]
        for part, spectrum in zip(parts, np.split(shape, ends), strict=True):
            density = part.level * spectrum * part.twice
            middle += ((part.derivatives.conj().T * density) @ part.derivatives).real
            across = np.abs(part.derivatives @ fit.whitening.T) ** 2
            weights.append(across * (part.level * part.twice)[:, None])
        # what each frequency's square adds to the variances: the smoothing the other way round
        share = np.concatenate(weights)[order] / rest[:, None]
        sums.add(middle, _smoothed(share) * seen[:, None])
    return sums.covariance(4.0, np.inf)


def _smoothed(values: Array) -> Array:
    """Sums over each value and its neighbours (n, ...), mirrored at both ends."""
    near = min((NEIGHBOURS - 1) // 2, values.shape[0] - 1)
    others = [(0, 0)] * (values.ndim - 1)
    sums = np.cumsum(np.pad(values, [(near, near), *others], mode="reflect"), axis=0)
    sums = np.pad(sums, [(1, 0), *others])
    return np.asarray(sums[2 * near + 1 :] - sums[: values.shape[0]])


def band_score_covariance(
    fit: LinearisedFit, spectra: Sequence[_Spectrum] | None = None
) -> Covariance:
    """Covariance under noise that may differ along the runs; otherwise as `spectral_covariance`.

    Notes
    -----
    The sandwich (JᵀJ)⁻¹ Σ_runs Σ_bands ½ Re(C Cᴴ) (JᵀJ)⁻¹ with C = Σ_{f in band} J(f)* r(f): scores
    clustered by bands of frequency (Liang and Zeger 1986). Within a band the score is summed before
    it is squared, so that noise which comes with every step, or a ripple that meets ten reversals
    at the same phase, counts in full. Degrees of freedom are those of a sum of squares, two for
    each band and run.
    """
    sums = _Sandwich(fit)
    for part in spectra or [_Spectrum(run, fit.whitening) for run in fit.runs]:
        products = part.derivatives.conj() * (part.twice * part.residual)[:, None]
        width = min(BAND, 0.5 / part.step / FEWEST_BANDS)
        band = (part.frequencies / width).astype(np.intp)
        scores = np.add.reduceat(products, np.flatnonzero(np.diff(band, prepend=-1)), axis=0)
        middle = 0.5 * (scores.conj().T @ scores).real
        sums.add(middle, 0.5 * np.abs(scores @ fit.whitening.T) ** 2)
    return sums.covariance(2.0, 1.0)


def coloured_noise_covariance(fit: LinearisedFit) -> Covariance:
    """Covariance to quote: the larger of both errors, unknown by unknown.

    A smoothed spectrum knows the noise well but takes it as alike all along a run; scores by bands
    take in noise that is not, but are few. On the bench neither alone covers 93 to 97 % on every
    axis, both together do (docs/calibration.md).
    """
    spectra = [_Spectrum(run, fit.whitening) for run in fit.runs]
    first, second = spectral_covariance(fit, spectra), band_score_covariance(fit, spectra)
    known = first.determined & (first.standard_errors > 0.0)
    ratio = np.ones(known.size)
    np.divide(second.standard_errors, first.standard_errors, out=ratio, where=known)
    stretch = np.maximum(ratio, 1.0)
    freedom = np.where(ratio > 1.0, second.degrees_of_freedom, first.degrees_of_freedom)
    matrix = first.matrix * np.outer(stretch, stretch)
    return replace(first, matrix=matrix, degrees_of_freedom=freedom)


# --- spectral lines -------------------------------------------------------------------------------

HALF_BANDWIDTH = 4.0
"""Time-bandwidth product NW of the tapers, of which 2 NW - 1 are used (Thomson 1982)."""
LOWEST = 4.0
"""Half bandwidths of the shortest run below which no line is told from slow noise or drift."""
FALSE_ALARM = 0.01
"""Probability that white noise has a line, over all frequencies of a channel together."""
MOST, FEWEST = 40, 256
"""Lines of a channel that are removed, the strongest first; samples of a run from which they are
sought."""
PADDING = 4
"""Zeros beside a run, in its lengths, before its spectrum is taken; a parabola through the largest
three values then tells a line's frequency to a hundredth of a bin."""


class SpectralLine(NamedTuple):
    """A sinusoid in the residuals of a channel, of one frequency in all its runs."""

    channel: str
    frequency: float
    """[Hz]"""
    share: float
    """Part of the channel's residual variance that removing it takes away, 0 to 1. [1]"""


def without_lines(fit: LinearisedFit) -> tuple[LinearisedFit, tuple[SpectralLine, ...]]:
    """A fit with the spectral lines of its residuals removed, and those lines.

    Notes
    -----
    Lines are found by Thomson's (1982) harmonic F-test on discrete prolate spheroidal tapers,
    numerators and denominators summed over the runs of a channel. At each a sine and a cosine are
    fitted to every run by least squares and subtracted; what that takes from the sum of squares is
    the line's share. None is sought below four half bandwidths of the shortest run, 16 of its
    bins, where a model error or a drift is no line.
    """
    runs, found = list(fit.runs), list[SpectralLine]()
    for channel in dict.fromkeys(run.channel for run in fit.runs):
        alike = [k for k, run in enumerate(fit.runs) if run.channel == channel]
        whole = sum(float(np.sum(runs[k].unweighted ** 2)) for k in alike)
        members = [k for k in alike if runs[k].time.size >= FEWEST]
        left = {k: runs[k].unweighted for k in members}
        grids = [grid_of(runs[k].time) for k in members]
        for frequency in _frequencies([*left.values()], grids):
            taken = 0.0
            for k in members:
                turn = 2.0 * np.pi * frequency * runs[k].time
                waves = np.stack([np.cos(turn), np.sin(turn)])
                products = waves @ left[k]
                amplitudes = np.linalg.solve(waves @ waves.T, products)
                left[k] = left[k] - amplitudes @ waves
                taken += float(products @ amplitudes)
            found.append(SpectralLine(channel, frequency, taken / whole))
        for k in members:
            weight = runs[k].weight
            runs[k] = runs[k]._replace(residual=left[k] if weight is None else weight * left[k])
    return (replace(fit, runs=tuple(runs)) if found else fit), tuple(found)


def _percent(share: float) -> str:
    """A share in per cent, two digits of it, never as a power of ten."""
    percent = 100.0 * share
    return f"{percent:.0f} %" if percent >= 10.0 else f"{percent:.2g} %"


def line_sentences(lines: Sequence[SpectralLine]) -> tuple[str, ...]:
    """What lines there are, one sentence a channel."""
    said = []
    for channel in dict.fromkeys(line.channel for line in lines):
        alike = sorted((e for e in lines if e.channel == channel), key=lambda e: e.frequency)
        low, high = alike[0].frequency, alike[-1].frequency
        most = max(alike, key=lambda each: each.share)
        what, largest = f"A spectral line at {low:.3g} Hz makes", ""
        if len(alike) > 1:
            what = f"{len(alike)} spectral lines between {low:.3g} and {high:.3g} Hz make"
            largest = f", the largest {_percent(most.share)} at {most.frequency:.3g} Hz"
        share = _percent(sum(each.share for each in alike))
        said.append(f"{what} {share} of the residuals' variance of {channel}{largest}.")
    return tuple(said)


def _frequencies(runs: Sequence[Array], grids: Sequence[Grid]) -> list[float]:
    """Frequencies of significant lines, the strongest first, no two within a bandwidth. [Hz]"""
    from scipy.special import fdtri

    if not runs:
        return []
    step = float(np.median([grid.step for grid in grids]))
    size = next_fast_len(PADDING * max(grid.size for grid in grids), real=True)
    count = round(2.0 * HALF_BANDWIDTH) - 1
    explained, unexplained = np.zeros(size // 2 + 1), np.zeros(size // 2 + 1)
    for samples, grid in zip(runs, grids, strict=True):
        tapers = _tapers(grid.size, count)
        spectra = rfft(tapers * grid.spread(samples), size, axis=1)
        sums = tapers.sum(axis=1)
        energy = float(sums @ sums)
        amplitude = sums @ spectra / energy
        explained += energy * np.abs(amplitude) ** 2
        unexplained += np.sum(np.abs(spectra - sums[:, None] * amplitude) ** 2, axis=0)
    frequencies = rfftfreq(size, step)
    shortest = min(grid.size for grid in grids) * step
    bandwidth = HALF_BANDWIDTH / shortest
    looks = 0.5 * shortest / step  # independent frequencies
    ratio = (count - 1.0) * explained / np.maximum(unexplained, 1e-300)
    freedom = 2.0 * len(runs), 2.0 * len(runs) * (count - 1.0)
    # the upper quantile of F is one over the lower one with its freedoms exchanged
    limit = 1.0 / float(fdtri(*freedom[::-1], FALSE_ALARM / looks))
    # at half the rate itself a sine is zero; the last frequency of an odd size lies below it
    highest = (1.0 - 1e-9) * 0.5 / step
    told = (ratio > limit) & (frequencies > LOWEST * bandwidth) & (frequencies < highest)
    chosen: list[float] = []
    for place in np.argsort(-np.where(told, explained, 0.0)):
        if not told[place] or len(chosen) == MOST:
            break
        near = abs(np.array(chosen) - frequencies[place]) < bandwidth
        if not near.any():
            # the parabola through the maximum and its neighbours; the last frequency has one, and
            # zero is never told
            low, middle, *after = explained[place - 1 : place + 2]
            high = after[0] if after else low
            bend = low - 2.0 * middle + high
            aside = np.clip(0.5 * (low - high) / bend, -0.5, 0.5) if bend < 0.0 else 0.0
            chosen.append(float(frequencies[place] + aside * frequencies[1]))
    return chosen


@lru_cache(maxsize=32)
def _tapers(size: int, count: int) -> Array:
    """(count, size) Slepian sequences of unit energy, each of either sign.

    Eigenvectors of Slepian's (1978) tridiagonal matrix, as in SciPy's ``dpss``, which comes with
    all of `scipy.signal` and half a second to load it.
    """
    n = np.arange(size)
    middle = (0.5 * (size - 1) - n) ** 2 * np.cos(2.0 * np.pi * HALF_BANDWIDTH / size)
    beside = 0.5 * n[1:] * (size - n[1:])
    wanted = (size - count, size - 1)
    tapers: Array = eigh_tridiagonal(middle, beside, select="i", select_range=wanted)[1].T[::-1]
    return tapers
