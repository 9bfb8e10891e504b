"""Spectral lines in residuals, such as an ammeter's ripple: found, and told from the noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, rfft, rfftfreq
from scipy.ndimage import median_filter
from scipy.signal import hilbert, welch

from swashplate.identification.linearised import LinearisedFit, LinearisedRun
from swashplate.identification.noise import Grid, grid_of, unweighted

Array = NDArray[np.float64]


SEGMENT = 1024
"""Samples in a stretch of the averaged spectrum: 2 s at 512 Hz, a resolution of some 0.75 Hz."""
NEIGHBOURS = 81
"""Bins about a peak whose median is its background."""
OUTSTANDING = 6.0
"""By how many of its standard deviations a peak must rise above it."""
FLANK = 2.5
"""A tone's band goes on to where the spectrum rises by fewer."""
CORE = 0.2
"""Background over power below which a bin is taken for the line itself."""
ROUNDS = 3
"""How often tones are sought: weaker ones show when the stronger are gone."""
MUTE = 0.02
"""Share of the derivatives' power in a tone's band up to which it tells nothing of the unknowns."""


class Tone(NamedTuple):
    """A line in the spectrum of a channel's residuals."""

    channel: str
    low: float
    """Ends of its band. [Hz]"""
    high: float
    share: float
    """Of the variance of the channel's residuals in all runs. [1]"""
    frequencies: Array
    """(n,) in the band. [Hz]"""
    excess: Array
    """(n,) share of the amplitude there that stands above the background. [1]"""

    @property
    def frequency(self) -> float:
        """Its middle. [Hz]"""
        return 0.5 * (self.low + self.high)


class Separated(NamedTuple):
    """A fit's residuals without their tones, and what the tones do to the estimates."""

    fit: LinearisedFit
    """The fit with tones taken out of the residuals."""
    tones: tuple[Tone, ...]
    scores: Array
    """(rank, rank) covariance of the tones' scores in orthonormal directions, their phases being
    chance."""

    @property
    def covariance(self) -> Array:
        """(K, K) what the tones add to the estimates' covariance."""
        added: Array = self.fit.whitening @ self.scores @ self.fit.whitening.T
        return added


def separated(fit: LinearisedFit) -> Separated:
    """Take tones out of a fit's residuals.

    Parameters
    ----------
    fit : LinearisedFit
        The fit at its optimum.

    Notes
    -----
    A tone of 100 Hz stays correlated over a whole run. Its power then leaks, through any taper of
    the autocovariance, to the low frequencies where the derivatives are, and every error comes out
    too large by as much as the tone stands above the noise. A line counts as a tone only where
    the derivatives have next to no power: a model error at the frequency of a test is none.
    """
    middle = np.zeros((fit.rank, fit.rank))
    runs, found = list(fit.runs), []
    powers: dict[str, float] = {}
    for run in fit.runs:
        each = unweighted(run)
        powers[run.channel] = powers.get(run.channel, 0.0) + float(each @ each)
    for channel, step, members in _groups(fit):
        if min(fit.runs[m].time.size for m in members) < SEGMENT:
            continue
        bands: list[Tone] = []
        left = {m: unweighted(fit.runs[m]) for m in members}
        grids = {m: grid_of(fit.runs[m].time) for m in members}
        seen = {m: _powers(fit.runs[m], grids[m], fit.whitening) for m in members}
        for _ in range(ROUNDS):
            more = _tones(channel, step, [grids[m].spread(left[m]) for m in members])
            more = [tone for tone in more if _mute(tone, grids, seen)]
            if not more:
                break
            remain = sum(float(each @ each) for each in left.values())
            bands += [tone._replace(share=tone.share * remain / powers[channel]) for tone in more]
            for m in members:
                left[m] = left[m] - _within(left[m], grids[m], more)
        if not bands:
            continue
        found += bands
        for m in members:
            run = runs[m]
            part = unweighted(run) - left[m]
            weighted = part if run.weight is None else part * run.weight
            middle += _any_phase(part, run, fit.whitening)
            runs[m] = run._replace(residual=run.residual - weighted)
    if not found:
        return Separated(fit, (), middle)
    return Separated(replace(fit, runs=tuple(runs)), tuple(found), middle)


def _groups(fit: LinearisedFit) -> list[tuple[str, float, list[int]]]:
    """Runs of one channel whose steps are alike to a part in a thousand."""
    groups: list[tuple[str, float, list[int]]] = []
    for number, run in enumerate(fit.runs):
        step = grid_of(run.time).step
        for channel, known, members in groups:
            if channel == run.channel and abs(known - step) < 1e-3 * step:
                members.append(number)
                break
        else:
            groups.append((run.channel, step, [number]))
    return groups


def _tones(channel: str, step: float, runs: Sequence[Array]) -> list[Tone]:
    """Lines of the averaged spectrum of samples on even grids."""
    power = np.zeros(SEGMENT // 2 + 1)
    stretches = 0.0
    for samples in runs:
        frequencies, density = welch(samples, 1.0 / step, nperseg=SEGMENT, detrend="constant")
        power += samples.size * density
        stretches += 2.0 * samples.size / SEGMENT - 1.0
    if not power.any():
        return []
    background = np.maximum(median_filter(power, NEIGHBOURS, mode="nearest"), 1e-300)
    # Hann stretches that overlap by half are nearly independent of each other (Welch 1967)
    above = (power / background - 1.0) * np.sqrt(stretches)
    made: list[Tone] = []
    for peak in np.flatnonzero(above > OUTSTANDING):
        if made and frequencies[peak] <= made[-1].high:
            continue
        low = high = int(peak)
        while low > 0 and above[low - 1] > FLANK:
            low -= 1
        while high < power.size - 1 and above[high + 1] > FLANK:
            high += 1
        band = slice(low, high + 1)
        share = float(power[band].sum() / power.sum())
        level = background[band] / power[band]
        # the line itself goes as a whole: a rest of it would be as long a correlation
        excess = np.where(level < CORE, 1.0, 1.0 - np.sqrt(np.minimum(level, 1.0)))
        ends = float(frequencies[low]), float(frequencies[high])
        made.append(Tone(channel, *ends, share, frequencies[band], excess))
    return made


def _powers(run: LinearisedRun, grid: Grid, whitening: Array) -> Array:
    """(F, rank) power spectra of the derivatives in orthonormal directions."""
    powers: Array = np.abs(rfft(grid.spread(run.jacobian @ whitening), axis=0)) ** 2
    return powers


def _mute(tone: Tone, grids: Mapping[int, Grid], powers: Mapping[int, Array]) -> bool:
    """Whether no direction's derivatives have more than little power in a tone's band."""
    inside = sum(
        powers[m][_band(tone, grid.size, grid.step)].sum(axis=0) for m, grid in grids.items()
    )
    total = sum(each.sum(axis=0) for each in powers.values())
    return bool(np.all(inside <= MUTE * total))


def _any_phase(tone: Array, run: LinearisedRun, whitening: Array) -> Array:
    """(rank, rank) mean of s sᵀ over all phases of a tone (n,), s its score.

    The score as it happened to be would be a sample of one.
    """
    weight = 1.0 if run.weight is None else run.weight
    turned = hilbert(tone) * weight
    score = (run.jacobian @ whitening).T @ turned
    mean: Array = 0.5 * np.outer(score, score.conj()).real
    return mean


def _within(samples: Array, grid: Grid, tones: Sequence[Tone]) -> Array:
    """(n,) what of a run's samples stands above the background in the tones' bands.

    No more than that: a hole in the spectrum would be a long correlation again.
    """
    spectrum = rfft(grid.spread(samples))
    frequencies = rfftfreq(grid.size, grid.step)
    taken = np.zeros(spectrum.size)
    for tone in tones:
        band = _band(tone, grid.size, grid.step)
        taken[band] = np.interp(frequencies[band], tone.frequencies, tone.excess)
    part: Array = irfft(spectrum * taken, grid.size)[grid.places]
    return part


def _band(tone: Tone, size: int, step: float) -> NDArray[np.bool_]:
    frequencies = rfftfreq(size, step)
    inside: NDArray[np.bool_] = (frequencies >= tone.low) & (frequencies <= tone.high)
    return inside


def distinct(tones: Sequence[Tone]) -> tuple[Tone, ...]:
    """Tones by channel and frequency, those whose bands overlap as one.

    A line that was taken out in several rounds is one tone: the strongest, with the shares of all.
    """
    made: list[Tone] = []
    end = 0.0
    channels = list(dict.fromkeys(tone.channel for tone in tones))
    for tone in sorted(tones, key=lambda each: (channels.index(each.channel), each.low)):
        if made and made[-1].channel == tone.channel and tone.low <= end:
            strongest = max(made[-1], tone, key=lambda each: each.share)
            made[-1] = strongest._replace(share=made[-1].share + tone.share)
            end = max(end, tone.high)
        else:
            made.append(tone)
            end = tone.high
    return tuple(made)


def tone_sentences(tones: Sequence[Tone]) -> tuple[str, ...]:
    """What tones there are, one sentence a channel."""
    channels: dict[str, list[Tone]] = {}
    for tone in distinct(tones):
        channels.setdefault(tone.channel, []).append(tone)
    said = []
    for channel, alike in channels.items():
        most = max(alike, key=lambda each: each.share)
        what, them = f"A tone at {most.frequency:.3g} Hz makes", "it"
        largest = ""
        if len(alike) > 1:
            what, them = (
                (
                    f"{len(alike)} tones between {alike[0].frequency:.3g} and "
                    f"{alike[-1].frequency:.3g} Hz make"
                ),
                "them",
            )
            largest = f", the largest {100.0 * most.share:.2g} % at {most.frequency:.3g} Hz"
        share = sum(each.share for each in alike)
        said.append(
            f"{what} {100.0 * share:.2g} % of the residuals' variance of {channel}{largest}; "
            f"no unknown depends on {them}, and the noise is judged without {them}."
        )
    return tuple(said)
