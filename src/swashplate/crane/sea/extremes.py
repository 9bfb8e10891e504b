"""Most probable largest value in three hours: of Gaussian processes, and from peaks of runs.

The most probable largest value of a duration is the level that is crossed upwards once in it on
average. For a Gaussian process it follows from variances (Rice); for simulated signals from a
Weibull distribution through the highest of their peaks.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.crane.sea.confidence import ConfidenceInterval

Array = NDArray[np.float64]

THREE_HOURS = 10_800.0
"""Duration for which an extreme is stated, as a sea state is taken to last. [s]"""
GROUPS = 10
"""Groups of runs; for the interval of an extreme each is left out in turn."""
UPPER, FEWEST_UPPER = 0.1, 20
"""Part of the peaks that the tail is fitted to, and their least number. On Gaussian signals whose
extreme is known, narrow and wide, of one and two components, the upper tenth errs by 2.5 % at most,
the upper half by 5 %: docs/crane-checks.md."""
DIRECTIONS = 240
"""Directions over half a circle in which a vector's crossings are added up."""
THINNEST = 0.01
"""Least variance of a vector's second component over that of its first, as it is taken: crossings
of a thinner vector differ from those of a line by less than 1 %."""
BISECTIONS = 30
"""Halvings of the range in which a largest value is looked for."""


# --- Gaussian processes ---------------------------------------------------------------------------


def largest_of_gaussian(
    variance: ArrayLike, rate_variance: ArrayLike, duration: float = THREE_HOURS
) -> Array:
    """Most probable largest magnitude of Gaussian vectors of zero mean.

    Parameters
    ----------
    variance, rate_variance : (..., m) array_like
        Variances of m = 1 or 2 components along the principal axes, and of their derivatives with
        respect to time.
    duration : float
        [s]

    Returns
    -------
    (...) array
        The radius r with ν(r) duration = 1; the standard deviation if that is crossed less often.

    Notes
    -----
    Crossings of one component, of both signs, are ν(r) = σ'/(π σ) exp(-r²/(2 σ²)) a second (Rice).
    Of two they are those out of a circle, ν(r) = r ∫ f(r u) σ'(u)/√(2π) dθ over its directions u,
    with the density f and the standard deviation σ'(u) of the velocity along u (Belyaev 1968),
    taken as independent of the place.
    """
    variances, rate_variances = np.broadcast_arrays(
        np.asarray(variance, dtype=np.float64), np.asarray(rate_variance, dtype=np.float64)
    )
    deviation = np.sqrt(variances.max(axis=-1))
    low = deviation
    high = 12.0 * deviation
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        crossed_more = _crossings(middle, variances, rate_variances) * duration > 1.0
        low = np.where(crossed_more, middle, low)
        high = np.where(crossed_more, high, middle)
    return np.asarray(low)


def _crossings(radius: Array, variance: Array, rate_variance: Array) -> Array:
    """Crossings of a radius outwards in a second; 0 for a vector that stands still. [1/s]"""
    order = np.argsort(-variance, axis=-1)
    variance = np.take_along_axis(variance, order, axis=-1)
    rate_variance = np.take_along_axis(rate_variance, order, axis=-1)
    largest = np.where(variance[..., 0] > 0.0, variance[..., 0], 1.0)
    if variance.shape[-1] == 1:
        rate = np.sqrt(rate_variance[..., 0] / largest) / pi
        crossings = rate * np.exp(-0.5 * radius**2 / largest)
    else:
        smallest = np.maximum(variance[..., 1], THINNEST * largest)
        angle = (np.arange(DIRECTIONS) + 0.5) * pi / DIRECTIONS
        along = np.cos(angle) ** 2
        across = np.sin(angle) ** 2
        squares = along / largest[..., None] + across / smallest[..., None]
        density = np.exp(-0.5 * radius[..., None] ** 2 * squares)
        density /= 2.0 * pi * np.sqrt(largest * smallest)[..., None]
        speed_variance = rate_variance[..., :1] * along + rate_variance[..., 1:] * across
        speed = np.sqrt(speed_variance / (2.0 * pi))
        crossings = 2.0 * radius * (density * speed).sum(axis=-1) * pi / DIRECTIONS
    return np.where(variance[..., 0] > 0.0, crossings, 0.0)


# --- peaks ----------------------------------------------------------------------------------------


def peaks_of(signal: Array) -> Array:
    """Local maxima of a signal, (n,), rising in time."""
    inside = signal[1:-1]
    highest = (inside > signal[:-2]) & (inside >= signal[2:])
    return np.asarray(inside[highest])


def largest_of_peaks(
    runs: Sequence[Array], observed: float, duration: float = THREE_HOURS
) -> ConfidenceInterval:
    """Most probable largest value in a duration, from the peaks of independent runs.

    Parameters
    ----------
    runs : sequence of (n,) array
        Peaks of each run.
    observed : float
        Duration of all runs together. [s]
    duration : float
        [s]

    Returns
    -------
    ConfidenceInterval
        With a 95 % interval by the jackknife over groups of runs; the interval is NaN for fewer
        than two groups, and all is NaN for fewer than 40 peaks.

    Notes
    -----
    A Weibull distribution P(x > ξ) = exp(-(ξ/a)^c) is fitted to the upper tenth of all peaks by
    least squares of ln(-ln P) over ln ξ; one of ``n duration/observed`` peaks exceeds the largest.
    """
    from scipy.special import stdtrit

    value = _weibull_level(np.concatenate([np.zeros(0), *runs]), observed, duration)
    groups = min(GROUPS, len(runs))
    if groups < 2 or not np.isfinite(value):
        return ConfidenceInterval(value, np.nan, np.nan)
    numbers = np.arange(len(runs)) % groups
    left_out = np.empty(groups)
    for group in range(groups):
        rest = [peaks for peaks, number in zip(runs, numbers, strict=True) if number != group]
        share = len(rest) / len(runs)
        left_out[group] = _weibull_level(np.concatenate(rest), share * observed, duration)
    variance = (groups - 1) / groups * float(np.sum((left_out - left_out.mean()) ** 2))
    half = float(stdtrit(groups - 1, 0.975)) * variance**0.5
    return ConfidenceInterval(value, max(value - half, 0.0), value + half)


def _weibull_level(peaks: Array, observed: float, duration: float) -> float:
    """Level that peaks exceed once in a duration on average; NaN for too few of them."""
    n = peaks.size
    upper = max(round(UPPER * n), FEWEST_UPPER)
    if n < 2 * upper:
        return float("nan")
    first = n - upper
    highest = np.sort(peaks)[first:]
    if highest[-1] - highest[0] <= 1e-9 * highest[-1]:  # a signal that repeats itself
        return float(highest[-1])
    exceeded = 1.0 - (np.arange(first, n) + 0.65) / (n + 0.3)
    x = np.log(highest)
    y = np.log(-np.log(exceeded))
    shape = float(np.sum((x - x.mean()) * (y - y.mean())) / np.sum((x - x.mean()) ** 2))
    y_of_level = np.log(np.log(max(n * duration / observed, 2.0)))
    return float(np.exp(x.mean() + (y_of_level - y.mean()) / shape))
