"""Damping of a load that swings freely, from a log of its angle."""

from __future__ import annotations

from math import pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.crane.rope import GRAVITY
from swashplate.errors import InputError

Array = NDArray[np.float64]

FEWEST = 5.0
"""Least number of swings in a log from which damping is identified."""
WIDEST = 1.0
"""Angle beyond which a log is probably in degrees. [rad]"""
EXPLAINED = 0.5
"""Least share of the log's variance that a decaying sine must explain."""
PERIOD_TOLERANCE = 0.1
"""Largest relative difference between the log's period and that of the rope: at 1 rad a pendulum
swings 7 % slower, and a hook above the load makes the rope a few per cent longer or shorter."""
STRONGEST = 0.9
"""The damping ratio is searched between this value and its negative."""
PADDED = 8
"""Points of the transform that finds the frequency, over those of the log."""
UNKNOWNS = 5
"""Offset, amplitude, phase, frequency, damping ratio."""


class _Log(NamedTuple):
    elapsed: Array
    """Time since its first sample. [s]"""
    swing: Array
    """Angle. [rad]"""


class FreeSwing(NamedTuple):
    """Damping ratio of a free swing with its 95 % confidence interval, and its period."""

    value: float
    low: float
    high: float
    period: float
    """Undamped. [s]"""


def swing_damping(time: ArrayLike, angle: ArrayLike, *, rope: float | None = None) -> FreeSwing:
    """Identify the damping ratio of a free swing in one plane from a log of its angle.

    Parameters
    ----------
    time : (n,) array_like
        Rising. [s]
    angle : (n,) array_like
        Of the rope, signed, in one plane; an offset of the sensor is fitted. [rad]
    rope : float, optional
        Length of the rope, by which the log's period is checked. [m]

    Raises
    ------
    InputError
        For fewer than five swings, for an angle that exceeds 1 rad or never changes its sign, and
        for a log that is not a free swing: a decaying sine explains less than half of it, its decay
        is not certain, or its period is not that of the rope.

    Notes
    -----
    A decaying sine is fitted by least squares, starting at the largest line of the spectrum and the
    logarithmic decrement. The interval takes the residuals as correlated: their effective number is
    the number of samples over a correlation time. That time is one plus twice the sum of the
    residuals' autocorrelation, up to its first value that is not positive.

    Examples
    --------
    >>> import numpy as np
    >>> from swashplate.crane import swing_damping
    >>> time = np.arange(0.0, 60.0, 0.05)
    >>> angle = 0.1 * np.exp(-0.01 * time) * np.cos(1.0 * time)
    >>> round(swing_damping(time, angle).value, 4)
    0.01
    """
    from scipy.optimize import least_squares
    from scipy.special import stdtrit

    elapsed, swing = _checked(time, angle)
    start = _start(elapsed, swing)
    # offset, cosine, sine, frequency, damping ratio
    lower = [-np.inf, -np.inf, -np.inf, 0.0, -STRONGEST]
    upper = [np.inf, np.inf, np.inf, np.inf, STRONGEST]
    fit = least_squares(
        _residual,
        start,
        jac=_jacobian,
        bounds=(lower, upper),
        x_scale="jac",
        args=(elapsed, swing),
    )
    frequency, ratio = fit.x[3:].tolist()
    residuals = fit.fun
    explained = 1.0 - float(np.var(residuals) / np.var(swing))
    if explained < EXPLAINED:
        raise InputError(
            f"A decaying sine explains {100.0 * max(explained, 0.0):.0f} % of the log, so it is "
            "not a free swing: cut the log to the part with the crane at rest."
        )
    period = 2.0 * pi / frequency
    if rope is not None:
        if not rope > 0.0:
            raise InputError(f"The rope is {rope:g} m long, but must be longer than 0 m.")
        expected = 2.0 * pi * sqrt(rope / GRAVITY)
        if abs(period / expected - 1.0) > PERIOD_TOLERANCE:
            raise InputError(
                f"The log swings once in {period:.3g} s, but a load on {rope:g} m of rope once in "
                f"{expected:.3g} s: check the column and the unit of the time."
            )
    correlation = _correlation_time(residuals)
    degrees_of_freedom = residuals.size / correlation - UNKNOWNS
    if degrees_of_freedom < 1.0:
        raise InputError(
            "The log contains changes that are too slow to separate from the swing's damping: "
            "remove any drift, or use a longer log."
        )
    variance = float(residuals @ residuals) / degrees_of_freedom
    covariance = np.linalg.inv(fit.jac.T @ fit.jac)
    standard_error = sqrt(variance * covariance[4, 4])
    half = float(stdtrit(degrees_of_freedom, 0.975)) * standard_error
    if ratio - half <= 0.0:
        raise InputError(
            f"The log does not show that the swing decays: its damping ratio would be {ratio:.2g}, "
            f"within {ratio - half:.2g} and {ratio + half:.2g}: use a longer log of a load that "
            "swings freely."
        )
    return FreeSwing(ratio, ratio - half, ratio + half, period)


def _checked(time: ArrayLike, angle: ArrayLike) -> _Log:
    """The log, if it can be a free swing; else an `InputError`."""
    stamps, swing = (np.asarray(values, dtype=np.float64) for values in (time, angle))
    if stamps.ndim != 1 or stamps.shape != swing.shape or stamps.size <= UNKNOWNS:
        raise InputError(
            "Time and angle of a swing must be two rows of equal length, with more than "
            f"{UNKNOWNS}, not of shapes {stamps.shape} and {swing.shape}."
        )
    if not (np.isfinite(stamps).all() and np.isfinite(swing).all() and (np.diff(stamps) > 0).all()):
        raise InputError("Time and angle of a swing must be finite, and the time must rise.")
    largest = float(np.abs(swing).max())
    if largest > WIDEST:
        raise InputError(
            f"The swing reaches {largest:.3g} rad, more than the {WIDEST:g} rad that are taken: "
            "if it is in degrees, say so in the log's header, swing [deg], or convert it."
        )
    if swing.min() >= 0.0 or swing.max() <= 0.0:
        raise InputError(
            "The swing never changes its sign: use the signed angle in one plane, or subtract a "
            "constant."
        )
    return _Log(stamps - stamps[0], swing)


def _start(time: Array, swing: Array) -> Array:
    """Offset, cosine, sine [rad], frequency [rad/s] and damping ratio to start the fit at.

    An `InputError` for fewer than five swings.
    """
    grid = np.linspace(0.0, time[-1], time.size)
    even = np.interp(grid, time, swing)
    power = np.abs(np.fft.rfft((even - even.mean()) * np.hanning(grid.size), PADDED * grid.size))
    largest = int(np.argmax(power[1:])) + 1
    frequency = 2.0 * pi * largest / (PADDED * grid.size * grid[1])
    swings = frequency * time[-1] / (2.0 * pi)
    # of a pure offset or a drift the largest line is the lowest one
    if swings < FEWEST:
        raise InputError(
            f"The log has {swings:.1f} swings, but {FEWEST:g} are needed: use a longer one, "
            "beginning when the crane is at rest."
        )
    basis = np.stack(
        [np.ones(time.size), np.cos(frequency * time), np.sin(frequency * time)], axis=1
    )
    number = np.minimum((time / time[-1] * int(swings)).astype(np.int64), int(swings) - 1)
    amplitudes = []
    middles = []
    for k in range(int(swings)):
        in_swing = number == k
        if in_swing.sum() > basis.shape[1]:
            coefficients = np.linalg.lstsq(basis[in_swing], swing[in_swing], rcond=None)[0]
            amplitudes.append(np.hypot(*coefficients[1:]))
            middles.append(time[in_swing].mean())
    decay = 0.0
    if len(middles) > 1:
        decay = -float(np.polyfit(middles, np.log(np.maximum(amplitudes, 1e-12)), 1)[0])
    decaying = np.exp(-decay * time)[:, None] * basis[:, 1:]
    offset, cosine, sine = np.linalg.lstsq(
        np.column_stack([basis[:, 0], decaying]), swing, rcond=None
    )[0]
    return np.array([offset, cosine, sine, frequency, np.clip(decay / frequency, -0.5, 0.5)])


class _DecayingWaves(NamedTuple):
    cosine: Array
    sine: Array


def _decaying_waves(x: Array, time: Array) -> _DecayingWaves:
    """Decaying exponential times cosine and sine of the damped swing."""
    frequency, ratio = x[3:]
    damped = frequency * np.sqrt(1.0 - ratio * ratio)
    decay = np.exp(-ratio * frequency * time)
    return _DecayingWaves(decay * np.cos(damped * time), decay * np.sin(damped * time))


def _residual(x: Array, time: Array, swing: Array) -> Array:
    """A decaying sine less the log. [rad]"""
    offset, cosine, sine = x[:3]
    c, s = _decaying_waves(x, time)
    return np.asarray(offset + cosine * c + sine * s - swing)


def _jacobian(x: Array, time: Array, swing: Array) -> Array:
    """Derivatives of the residual by the unknowns, (n, 5)."""
    _, cosine, sine, frequency, ratio = x
    c, s = _decaying_waves(x, time)
    root = np.sqrt(1.0 - ratio * ratio)
    value = cosine * c + sine * s
    turned = sine * c - cosine * s
    by_frequency = time * (-ratio * value + root * turned)
    by_ratio = frequency * time * (-value - ratio / root * turned)
    return np.stack([np.ones(swing.size), c, s, by_frequency, by_ratio], axis=1)


def _correlation_time(residuals: Array) -> float:
    """One plus twice the sum of the autocorrelation up to the first that is not positive."""
    count = residuals.size
    power = np.abs(np.fft.rfft(residuals - residuals.mean(), 2 * count)) ** 2
    covariance = np.fft.irfft(power)[:count]
    if not covariance[0] > 0.0:
        return 1.0
    correlation = covariance / covariance[0]
    ends = np.flatnonzero(correlation <= 0.0)
    return float(1.0 + 2.0 * correlation[1 : ends[0] if ends.size else None].sum())
