"""Autoregressive model of coloured noise: whitening of residuals, colouring of innovations."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft
from scipy.signal import lfilter

from swashplate.identification.autocorrelation import Grid, NoiseColour

Array = NDArray[np.float64]

SETTLED = 4.0
"""Correlation lengths that are marched before the first sample that counts."""


class Autoregression(NamedTuple):
    """e_t = Σ a_k e_{t-k} + s u_t with u of variance 1, and e of variance 1 too."""

    coefficients: Array
    """(p,) a_1 to a_p; none for white noise."""
    deviation: float
    """s."""
    settling: int
    """Samples after which the start is forgotten."""

    def innovations(self, noise: Array, grid: Grid) -> Array:
        """Standardised u of a run's noise (n,), where p samples without a gap go before.

        Returns
        -------
        (m,) array
            In order; gaps leave no trace, m may be 0.
        """
        order = self.coefficients.size
        taps = np.concatenate([[1.0], -self.coefficients])
        present = np.convolve(grid.spread(np.ones(noise.size)), np.ones(order + 1))[: grid.size]
        whole = present > order + 0.5
        found: Array = lfilter(taps, [1.0], grid.spread(noise))[whole]
        if found.size < 2:
            return np.zeros(0)
        found = found - found.mean()
        size = float(np.sqrt(np.mean(found**2)))
        return found / size if size > 0.0 else found

    def coloured(self, innovations: Array) -> Array:
        """(m - settling,) noise of variance 1 from m innovations."""
        taps = np.concatenate([[1.0], -self.coefficients])
        noise: Array = lfilter([self.deviation], taps, innovations)
        return noise[self.settling :]


def autoregression(colour: NoiseColour, samples: int) -> Autoregression:
    """Fit to an autocorrelation, its order by Akaike's criterion.

    Parameters
    ----------
    colour : NoiseColour
        Of the noise.
    samples : int
        From which it was estimated; the order is at most 10 log₁₀ of it.

    Notes
    -----
    Yule and Walker's equations by Levinson's recursion, on the autocorrelation with the negative
    parts of its spectrum cut off: it is then that of a process, and the model stable.
    """
    correlation = colour.correlation
    if not colour.length:
        return Autoregression(np.zeros(0), 1.0, 0)
    size = next_fast_len(4 * correlation.size, real=True)
    mirrored = np.zeros(size)
    mirrored[: correlation.size] = correlation
    mirrored[size - correlation.size + 1 :] = correlation[:0:-1]
    power = np.maximum(rfft(mirrored).real, 0.0)
    proper = irfft(power, size)[: correlation.size]
    proper = proper / proper[0]
    most = int(min(10.0 * np.log10(max(samples, 10)), correlation.size - 1, samples // 4))
    best, best_score = Autoregression(np.zeros(0), 1.0, 0), 0.0
    taps, variance = np.zeros(0), 1.0
    for order in range(1, most + 1):
        reflection = (proper[order] - taps @ proper[order - 1 : 0 : -1]) / variance
        if abs(reflection) >= 1.0:
            break  # only rounding is left to predict
        taps = np.append(taps - reflection * taps[::-1], reflection)
        variance *= 1.0 - reflection**2
        score = samples * float(np.log(variance)) + 2.0 * order
        if score < best_score:
            settling = int(SETTLED * colour.length) + order
            best, best_score = Autoregression(taps, float(np.sqrt(variance)), settling), score
    return best
