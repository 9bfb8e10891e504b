"""Spectral lines in residuals, such as an ammeter's ripple: found and removed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len, rfft, rfftfreq
from scipy.linalg import eigh_tridiagonal

from swashplate.identification.linearised import LinearisedFit
from swashplate.identification.noise import Grid, grid_of, unweighted

Array = NDArray[np.float64]

HALF_BANDWIDTH = 4.0
"""Time-bandwidth product NW of the tapers, of which 2 NW - 1 are used (Thomson 1982)."""
LOWEST = 4.0
"""Half bandwidths of the shortest run below which no line is told from slow noise or drift."""
FALSE_ALARM = 0.01
"""Probability that white noise has a line, over all frequencies of a channel together."""
MOST = 40
"""Lines of a channel that are removed, the strongest first."""
PADDING = 4
"""Zeros beside a run, in its lengths, before its spectrum is taken; a parabola through the largest
three values then tells a line's frequency to a hundredth of a bin."""
FEWEST = 256
"""Samples of a run from which lines are sought."""


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
        members = [
            k
            for k, run in enumerate(fit.runs)
            if run.channel == channel and run.time.size >= FEWEST
        ]
        if not members:
            continue
        whole = sum(
            float(np.sum(unweighted(run) ** 2)) for run in fit.runs if run.channel == channel
        )
        left = {k: unweighted(fit.runs[k]) for k in members}
        for frequency in _frequencies([left[k] for k in members], [_grid(fit, k) for k in members]):
            before = sum(float(each @ each) for each in left.values())
            for k in members:
                turn = 2.0 * np.pi * frequency * fit.runs[k].time
                waves = np.linalg.qr(np.column_stack([np.cos(turn), np.sin(turn)]))[0]
                left[k] = left[k] - waves @ (waves.T @ left[k])
            taken = before - sum(float(each @ each) for each in left.values())
            found.append(SpectralLine(channel, frequency, taken / whole))
        for k in members:
            weight = fit.runs[k].weight
            runs[k] = runs[k]._replace(residual=left[k] if weight is None else weight * left[k])
    return (replace(fit, runs=tuple(runs)) if found else fit), tuple(found)


def line_sentences(lines: Sequence[SpectralLine]) -> tuple[str, ...]:
    """What lines there are, one sentence a channel."""
    said = []
    for channel in dict.fromkeys(line.channel for line in lines):
        alike = sorted((e for e in lines if e.channel == channel), key=lambda e: e.frequency)
        most = max(alike, key=lambda each: each.share)
        what, largest = f"A spectral line at {most.frequency:.3g} Hz makes", ""
        if len(alike) > 1:
            what = (
                f"{len(alike)} spectral lines between {alike[0].frequency:.3g} and "
                f"{alike[-1].frequency:.3g} Hz make"
            )
            largest = f", the largest {100.0 * most.share:.2g} % at {most.frequency:.3g} Hz"
        share = sum(each.share for each in alike)
        said.append(
            f"{what} {100.0 * share:.2g} % of the residuals' variance of {channel}{largest}."
        )
    return tuple(said)


def _grid(fit: LinearisedFit, number: int) -> Grid:
    return grid_of(fit.runs[number].time)


def _frequencies(runs: Sequence[Array], grids: Sequence[Grid]) -> list[float]:
    """Frequencies of significant lines, the strongest first, no two within a bandwidth. [Hz]"""
    from scipy.special import fdtri

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
    told = (ratio > limit) & (frequencies > LOWEST * bandwidth) & (frequencies < 0.5 / step)
    chosen: list[float] = []
    for place in np.argsort(-np.where(told, explained, 0.0)):
        if not told[place] or len(chosen) == MOST:
            break
        near = abs(np.array(chosen) - frequencies[place]) < bandwidth
        if not near.any():
            chosen.append(float(frequencies[place] + _aside(explained, place) * frequencies[1]))
    return chosen


def _aside(power: Array, place: int) -> float:
    """How far beside a maximum the parabola through it and its neighbours has its own. [bin]"""
    if not 0 < place < power.size - 1:
        return 0.0
    low, middle, high = power[place - 1 : place + 2]
    bend = low - 2.0 * middle + high
    return float(np.clip(0.5 * (low - high) / bend, -0.5, 0.5)) if bend < 0.0 else 0.0


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
