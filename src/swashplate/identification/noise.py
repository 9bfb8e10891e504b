"""Noise of residuals: autocorrelation, spectrum, and the covariance that follows.

All goes through the runs one by one and keeps of each a few numbers a frequency.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from swashplate.identification.estimation.problem import KEPT, LinearisedFit, LinearisedRun
from swashplate.identification.estimation.unknowns import Unknowns
from swashplate.results import Result

Array = NDArray[np.float64]


CONFIDENCE_LEVEL = 0.95
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
        """(K,) of the solver's numbers; inf if undetermined, 0 for one at its bound."""
        has_error = self.determined | ~self.variables.free
        return np.where(has_error, np.sqrt(np.maximum(np.diag(self.matrix), 0.0)), np.inf)

    @property
    def quantiles(self) -> Array:
        """(K,) half widths of the intervals in standard errors, Student's."""
        from scipy.special import stdtrit  # of scipy.stats, without its second to load

        return np.asarray(stdtrit(self.degrees_of_freedom, 0.5 + 0.5 * CONFIDENCE_LEVEL))

    @property
    def correlation(self) -> Array:
        """(K, K) with 1 on the diagonal; 0 elsewhere for what has no variance."""
        errors = np.sqrt(np.maximum(np.diag(self.matrix), 0.0))
        errors[errors == 0.0] = 1.0
        correlation: Array = np.clip(self.matrix / np.outer(errors, errors), -1.0, 1.0)
        np.fill_diagonal(correlation, 1.0)
        return correlation


def covariance_of(fit: LinearisedFit, matrix: Array, freedom: Array) -> Covariance:
    """A covariance from a matrix (K, K); entries of undetermined unknowns are 0."""
    determined = np.outer(fit.determined, fit.determined)
    symmetric = 0.5 * (matrix + matrix.T)
    return Covariance(
        variables=fit.variables,
        matrix=np.where(determined, symmetric, 0.0),
        determined=fit.determined,
        degrees_of_freedom=freedom,
    )


# --- correlation over time ------------------------------------------------------------------------

LONGEST = 0.25
"""Longest lag looked at, over the longest run: beyond it too few pairs remain. [1]"""
DRIFTING = 0.3
"""Correlation length, over that lag, from which it is a model error. [1]"""
IN_A_ROW = 5
"""Lags in a row that must lie inside their band for a correlation to end."""
STRAY = 0.2
"""Share of the lags after them that may lie outside. [1]"""
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
        """(..., size) samples (..., n) on the grid, 0 in the gaps."""
        if self.size == self.places.size:
            return samples
        spread = np.zeros((*samples.shape[:-1], self.size))
        spread[..., self.places] = samples
        return spread


def grid_of(time: Array) -> Grid:
    """The grid of a run from its stamps; the step is their median distance.

    Every sample gets a place of its own, so that jitter of the stamps moves the grid, not the
    order. Very long gaps are shortened to at least fifteen times the samples in all gaps' total,
    far longer than any lag that is looked at.
    """
    if time.size < 2:
        return Grid(np.zeros(time.size, np.intp), time.size, 1.0)
    distances = np.diff(time)
    step = float(np.median(distances))
    steps = np.maximum(np.rint(distances / step), 1.0)
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
    cumulated_squares = np.concatenate([[0.0], np.cumsum(rho[1:-1] ** 2)])[: rho.size - 1]
    band = 2.0 * np.sqrt((1.0 + 2.0 * cumulated_squares) / np.maximum(counts[1:], 1.0))
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
    """Correlation of the residuals of one channel, from all its runs of one sampling step."""

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
            f"{start}, so intervals are about {wider:.2g} times as wide as for independent samples."
        )


def noise_colours(fit: LinearisedFit) -> tuple[NoiseColour, ...]:
    """Colours of the residuals of each channel, pooled over its runs of one sampling step."""
    steps, sizes = list[float](), list[int]()
    for run in fit.runs:
        grid = grid_of(run.time)
        steps.append(grid.step)
        sizes.append(grid.size)
    groups = list[list[int]]()
    for k, run in enumerate(fit.runs):
        for group in groups:
            step = steps[group[0]]
            alike = abs(steps[k] - step) <= SAME_STEP * step or run.time.size < 2
            if fit.runs[group[0]].channel == run.channel and alike:
                group.append(k)
                break
        else:
            groups.append([k])
    colours = []
    for members in groups:
        longest = int(LONGEST * max(sizes[k] for k in members))
        sums, counts = np.zeros(longest + 1), np.zeros(longest + 1)
        for k in members:
            products, pairs = pair_sums(fit.runs[k].unweighted, grid_of(fit.runs[k].time), longest)
            sums += products
            counts += pairs
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
        channel, step = fit.runs[members[0]].channel, steps[members[0]]
        colours.append(NoiseColour(channel, tuple(members), step, correlation, length, longest))
    return tuple(colours)


# --- covariances ----------------------------------------------------------------------------------

NEIGHBOURS, LEAST_LEFT = 21, 0.1
"""Frequencies, of all runs of a channel together, over which a periodogram is averaged; and the
part of them that the fit must have left for the noise to be known there."""
TOGETHER = 8
"""Directions whose spectra are taken together."""
ROUNDING = 1e-9
"""Relative growth of a variance that is rounding. [1]"""
BAND, FEWEST_BANDS = 10.0, 20.0
"""Width of the bands within which noise may swell and fade in any way [Hz]; bands up to half the
sampling rate, where that is low."""


class _Spectrum:
    """One run in the frequency domain, in directions whose derivatives are orthonormal."""

    def __init__(self, fit: LinearisedFit, run: LinearisedRun, jacobian: Array) -> None:
        grid = grid_of(run.time)
        self.step, scale = grid.step, 1.0 / np.sqrt(grid.size)
        self.directions, self.whitening = fit.inverse.of_run(run.name)
        """(d,) numbers of those that move the run, and (q + M, d) its unknowns along them."""
        residual = run.unweighted
        weight = np.ones(1) if run.weight is None else run.weight
        alike = weight.min() == weight.max()
        self.frequencies: Array = rfftfreq(grid.size, grid.step)
        self.residual = scale * rfft(grid.spread(residual))
        """(F,) without the weights."""
        shape = self.directions.size, self.frequencies.size
        self.derivatives = np.empty(shape, np.complex128)
        """(d, F) by which the noise enters the scores: with the weights twice."""
        leverage = np.zeros(self.frequencies.size)
        # a few directions at a time, as all of a long run together would not stay in the cache
        for first in range(0, shape[0], TOGETHER):
            few = slice(first, first + TOGETHER)
            projected = self.whitening[:, few].T @ jacobian.T
            along = self.derivatives[few]
            along[:] = scale * rfft(grid.spread(weight * projected))
            by_estimate = along / weight[0] ** 2
            if not alike:
                by_estimate = scale * rfft(grid.spread(projected / weight))
            leverage += np.sum((along.conj() * by_estimate).real, axis=0)
        self.left: Array = 1.0 - np.clip(leverage, 0.0, 1.0)
        """(F,) part of the noise that the fit leaves."""
        # a real signal's spectrum stands for its mirror image too, but at the ends
        self.twice: Array = np.full(self.frequencies.size, 2.0)
        self.twice[[0, -1] if grid.size % 2 == 0 else 0] = 1.0
        self.level = float(np.mean(residual**2))

    def variances(self, scores: NDArray[np.complex128]) -> Array:
        """(q + M, b) squares of what scores (d, b) move the unknowns by."""
        return np.abs(self.whitening @ scores) ** 2


class _Spectra:
    """The spectrum of each run, one after another.

    It is gone through twice; the first spectra are kept, as far as `KEPT` goes.
    """

    def __init__(self, fit: LinearisedFit) -> None:
        self.fit = fit
        self._kept = list[_Spectrum]()
        self._left = KEPT

    def __iter__(self) -> Iterator[_Spectrum]:
        jacobians = self.fit.jacobians()
        for number in range(len(self.fit.runs)):
            run, jacobian = next(jacobians)
            if number < len(self._kept):
                yield self._kept[number]
                continue
            spectrum = _Spectrum(self.fit, run, jacobian)
            if number == len(self._kept) and spectrum.derivatives.nbytes <= self._left:
                self._kept.append(spectrum)
                self._left -= spectrum.derivatives.nbytes
            yield spectrum


class _Pooled:
    """Noise spectrum of a channel: its shape is common to its runs, its level each run's own."""

    def __init__(self, frequencies: list[Array], powers: list[Array], left: list[Array]) -> None:
        ends = np.cumsum([frequency.size for frequency in frequencies])[:-1]
        order = np.argsort(np.concatenate(frequencies), kind="stable")
        power = np.concatenate(powers)[order]
        remaining = np.concatenate(left)[order]
        smoothed_remaining = np.maximum(_smoothed(remaining), LEAST_LEFT * NEIGHBOURS)
        shape = np.empty(order.size)
        shape[order] = _smoothed(power) / smoothed_remaining
        self.shapes = np.split(shape, ends)
        """(F,) of each run, in units of its level."""
        count = max(order.size // NEIGHBOURS, 1)
        first = np.arange(count) * NEIGHBOURS
        number = np.empty(order.size, np.int32)
        number[order] = np.minimum(np.arange(order.size) // NEIGHBOURS, count - 1)
        self.bins = np.split(number, ends)
        """(F,) of each run, the number of the bin of neighbours that each frequency lies in."""
        sizes = np.diff(np.append(first, order.size))
        in_bins = np.maximum(np.add.reduceat(remaining, first), LEAST_LEFT * sizes)
        self.means = np.add.reduceat(power, first) / in_bins
        """(B,) of each bin."""
        self.squares = np.add.reduceat(power**2, first) / in_bins**2
        """(B,) of each bin, sums of the squares of the terms whose sum its mean is."""


class _Sandwich:
    """(JᵀJ)⁻¹ M (JᵀJ)⁻¹ in the making: M, and what the unknowns' degrees of freedom follow from.

    A variance is a sum of parts that are independent of each other. Of an unknown of one run those
    from this run are added up; what others add, by way of the machine, has the degrees of freedom
    of the machine's unknowns that it follows.
    """

    def __init__(self, fit: LinearisedFit) -> None:
        self.fit, self.spare = fit, fit.spare_samples  # refused if there are none
        prior = fit.prior @ fit.whitening
        self.middle: Array = (prior.T * fit.prior_noise) @ prior
        self.total: Array = np.sum((fit.whitening @ self.middle) * fit.whitening, axis=1)
        """(K,) sums of the parts."""
        self.squares: Array = np.zeros(len(fit.variables))
        """(K,) sums of their squares."""

    def add(self, directions: NDArray[np.intp], middle: Array) -> None:
        """Add the part (d, d) of a run in some directions to the middle."""
        self.middle[np.ix_(directions, directions)] += middle

    def covariance(self, each: float, without: float) -> Covariance:
        """The covariance, a part having `each` degrees of freedom; `without` any part."""
        whitening, inverse = self.fit.whitening, self.fit.inverse
        matrix = whitening @ self.middle @ whitening.T
        freedom = np.full_like(self.total, without)
        shared = self.fit.variables.shared
        np.divide(each * self.total**2, self.squares, out=freedom, where=self.squares > 0.0)
        by_direction = np.linalg.pinv(inverse.machine)
        variances = np.diag(matrix)
        by_freedom = 1.0 / np.maximum(freedom[shared], 1.0)
        for run, (_, _, follow) in inverse.runs.items():
            run_columns = inverse.factor.runs[run].own
            others = np.maximum(variances[run_columns] - self.total[run_columns], 0.0)
            # by each of the machine's unknowns, as if they were independent of each other
            shares = (follow @ by_direction) ** 2 * variances[shared]
            shares /= np.maximum(shares.sum(axis=1, keepdims=True), 1e-300)
            squares = self.squares[run_columns] + each * others**2 * (shares**2 @ by_freedom)
            total = self.total[run_columns] + others
            positive = squares > 0.0
            freedom[run_columns[positive]] = each * total[positive] ** 2 / squares[positive]
        return covariance_of(self.fit, matrix, np.maximum(freedom, 1.0))


class _SmoothedSandwich(_Sandwich):
    """That of the smoothed spectrum of the noise."""

    def __init__(self, fit: LinearisedFit, spectra: Iterable[_Spectrum]) -> None:
        super().__init__(fit)
        self.pooled = _pooled_spectra(fit, spectra)
        self.shapes_and_bins = {
            channel: iter(zip(noise.shapes, noise.bins, strict=True))
            for channel, noise in self.pooled.items()
        }
        self.shared = {
            channel: np.zeros((fit.variables.shared.size, noise.means.size))
            for channel, noise in self.pooled.items()
        }

    def take(self, run: LinearisedRun, spectrum: _Spectrum) -> None:
        """Add the next run."""
        noise = self.pooled[run.channel]
        shape, bins = next(self.shapes_and_bins[run.channel])
        derivatives = spectrum.derivatives
        density = spectrum.level * shape * spectrum.twice
        middle = ((derivatives.conj() * density) @ derivatives.T).real
        self.add(spectrum.directions, middle)
        # contribution of a unit of the noise's shape in each bin to the variances
        weights = spectrum.variances(derivatives) * (spectrum.level * spectrum.twice)
        first = np.flatnonzero(np.diff(bins, prepend=-1))
        weights, bins = np.add.reduceat(weights, first, axis=1), bins[first]
        run_columns = self.fit.variables.of_run(run.name)
        self.shared[run.channel][:, bins] += weights[run_columns.size :]
        self.total[run_columns] += weights[: run_columns.size] @ noise.means[bins]
        self.squares[run_columns] += weights[: run_columns.size] ** 2 @ noise.squares[bins]

    def result(self) -> Covariance:
        """The covariance, all runs taken."""
        machine = self.fit.variables.shared
        for channel, noise in self.pooled.items():
            self.total[machine] += self.shared[channel] @ noise.means
            self.squares[machine] += self.shared[channel] ** 2 @ noise.squares
        return self.covariance(4.0, np.inf)


class _BandedSandwich(_Sandwich):
    """That of scores of bands of frequency."""

    def take(self, run: LinearisedRun, spectrum: _Spectrum) -> None:
        """Add the next run."""
        products = spectrum.derivatives.conj() * (spectrum.twice * spectrum.residual)
        width = min(BAND, 0.5 / spectrum.step / FEWEST_BANDS)
        band = (spectrum.frequencies / width).astype(np.intp)
        scores = np.add.reduceat(products, np.flatnonzero(np.diff(band, prepend=-1)), axis=1)
        self.add(spectrum.directions, 0.5 * (scores.conj() @ scores.T).real)
        parts = 0.5 * spectrum.variances(scores)
        columns = self.fit.variables.columns(run.name)
        self.total[columns] += parts.sum(axis=1)
        self.squares[columns] += np.sum(parts**2, axis=1)

    def result(self) -> Covariance:
        """The covariance, all runs taken."""
        return self.covariance(2.0, 1.0)


def spectral_covariance(fit: LinearisedFit) -> Covariance:
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
    freedom follow from the frequencies that an unknown's variance is an average over, in bins of
    neighbours that do not overlap.
    """
    spectra = _Spectra(fit)
    smoothed = _SmoothedSandwich(fit, spectra)
    for run, spectrum in zip(fit.runs, spectra, strict=True):
        smoothed.take(run, spectrum)
    return smoothed.result()


def band_score_covariance(fit: LinearisedFit) -> Covariance:
    """Covariance under noise that may differ along the runs; otherwise as `spectral_covariance`.

    Notes
    -----
    The sandwich (JᵀJ)⁻¹ Σ_runs Σ_bands ½ Re(C Cᴴ) (JᵀJ)⁻¹ with C = Σ_{f in band} J(f)* r(f): scores
    clustered by bands of frequency (Liang and Zeger 1986). Within a band the score is summed before
    it is squared, so that noise which comes with every step, or a ripple that meets ten reversals
    at the same phase, counts in full. Degrees of freedom are those of a sum of squares, two for
    each band and run.
    """
    banded = _BandedSandwich(fit)
    for run, spectrum in zip(fit.runs, _Spectra(fit), strict=True):
        banded.take(run, spectrum)
    return banded.result()


def _pooled_spectra(fit: LinearisedFit, spectra: Iterable[_Spectrum]) -> dict[str, _Pooled]:
    """The noise spectrum of each channel."""
    parts: dict[str, tuple[list[Array], list[Array], list[Array]]] = {}
    for run, spectrum in zip(fit.runs, spectra, strict=True):
        frequencies, powers, left = parts.setdefault(run.channel, ([], [], []))
        frequencies.append(spectrum.frequencies)
        powers.append(np.abs(spectrum.residual) ** 2 / (spectrum.level or 1.0))
        left.append(spectrum.left)
    return {channel: _Pooled(*part) for channel, part in parts.items()}


def _smoothed(values: Array) -> Array:
    """(n,) sums over each value and its neighbours, mirrored at both ends."""
    near = min((NEIGHBOURS - 1) // 2, values.size - 1)
    sums = np.cumsum(np.pad(values, (near, near), mode="reflect"))
    sums = np.pad(sums, (1, 0))
    return np.asarray(sums[2 * near + 1 :] - sums[: values.size])


def coloured_noise_covariance(fit: LinearisedFit) -> Covariance:
    """Covariance that intervals are quoted from.

    The larger of two errors: a smoothed spectrum knows the noise well but takes it as alike all
    along a run; scores by bands take in noise that is not, but are few. Both take the machine for
    the same in all runs (see `effects.RunToRun`).

    Notes
    -----
    The larger one is taken along each principal axis of the first's correlations, not of each
    unknown by itself: numbers whose errors make up for each other, as those of a product that alone
    is determined, would no longer do so if one were widened more than another.
    """
    spectra = _Spectra(fit)
    smoothed, banded = _SmoothedSandwich(fit, spectra), _BandedSandwich(fit)
    for run, spectrum in zip(fit.runs, spectra, strict=True):
        smoothed.take(run, spectrum)
        banded.take(run, spectrum)
    return _widened(smoothed.result(), banded.result())


def _widened(covariance: Covariance, other: Covariance) -> Covariance:
    """A covariance with the variances of another along the axes on which that has larger ones."""
    compared = covariance.determined & other.determined
    compared &= (covariance.standard_errors > 0.0) & (other.standard_errors > 0.0)
    part = np.ix_(compared, compared)
    sizes = covariance.standard_errors[compared]
    units = np.outer(sizes, sizes)
    variances, axes = np.linalg.eigh(covariance.matrix[part] / units)
    others = np.sum((other.matrix[part] / units) @ axes * axes, axis=0)
    matrix = covariance.matrix.copy()
    matrix[part] = units * ((axes * np.maximum(variances, others)) @ axes.T)
    is_wider = np.diag(matrix) > (1.0 + ROUNDING) * np.diag(covariance.matrix)
    freedom = np.where(is_wider, other.degrees_of_freedom, covariance.degrees_of_freedom)
    return replace(covariance, matrix=matrix, degrees_of_freedom=freedom)
