"""Damping of a load that swings freely, from a log of its angle."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, pi, sqrt
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
EXPLAINED = 0.9
"""Least share of the log's variance that a decaying sine must explain: what it leaves is then at
most a third of the swing."""
AGREE = 0.2
"""Relative difference of two damping ratios, of halves or planes, above which neither holds: each
is then 10 % off their mean, by which a swing without control changes by 5 %, as it goes with the
root of the damping."""
IN_PLANE = 0.1
"""Part of a swing below which the swing across it does not count: a plane that turns so little
takes 0.5 % off the swing, which is a damping ratio of 0.0001 in ten swings."""
GAP = 10.0
"""Step between two stamps, over the usual step, across which a log is not interpolated."""
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
    """Damping ratio of a free swing with its 95 % confidence interval, and where it holds."""

    value: float
    low: float
    high: float
    period: float
    """Undamped. [s]"""
    largest: float
    """Amplitude at the begin of the log. [rad]"""
    smallest: float
    """Amplitude at its end. [rad]"""
    both_planes: bool
    """Whether the angle across was given, so that a plane of swing that turns would be seen."""

    def sentences(self) -> tuple[str, ...]:
        """Say at which angles the damping holds, and what the log cannot show."""
        holds = (
            f"It holds for swings of {degrees(self.largest):.3g} down to "
            f"{degrees(self.smallest):.3g} deg, which the log has, if no wind drove the load."
        )
        if self.both_planes:
            return (holds,)
        return (
            holds,
            "The log has one plane: a plane of swing that turns slowly looks like damping, which "
            "only the angle across it would show.",
        )


def swing_damping(
    time: ArrayLike,
    angle: ArrayLike,
    *,
    across: ArrayLike | None = None,
    rope: float | None = None,
) -> FreeSwing:
    """Identify the damping ratio of a free swing from a log of its angle.

    Parameters
    ----------
    time : (n,) array_like
        Rising. [s]
    angle : (n,) array_like
        Of the rope, signed, in one plane; an offset of the sensor is fitted. [rad]
    across : (n,) array_like, optional
        Angle in the plane across that one, by which a plane of swing that turns is found. [rad]
    rope : float, optional
        Length of the rope, by which the log's period is checked. [m]

    Raises
    ------
    InputError
        For fewer than five swings, a gap of more than half a swing, an angle that exceeds 1 rad or
        never changes its sign, and for a log that is not a free swing with one damping ratio: a
        decaying sine explains less than 90 % of it, its decay is not certain, its period is not
        that of the rope, or its halves or planes have damping ratios that differ.

    Notes
    -----
    A decaying sine is fitted by least squares, starting at the largest line of the spectrum and the
    logarithmic decrement. The interval takes the residuals as correlated: their effective number is
    the number of samples over a correlation time. That time is one plus twice the sum of the
    residuals' autocorrelation, up to its first value that is not positive.

    The same is fitted to both halves of the log, as far as the swing exceeds the residuals, and to
    the plane across. Damping ratios whose intervals do not meet are refused if
    they differ by more than 20 % of their mean, which a plane that turns, wind and drag that grows
    with the swing do; if they differ by less, the interval is made to hold them.

    Examples
    --------
    >>> import numpy as np
    >>> from swashplate.crane import swing_damping
    >>> time = np.arange(0.0, 60.0, 0.05)
    >>> angle = 0.1 * np.exp(-0.01 * time) * np.cos(1.0 * time)
    >>> round(swing_damping(time, angle).value, 4)
    0.01
    """
    log = _checked(time, angle)
    whole = _fitted(log, _start(log))
    explained = 1.0 - float(np.var(whole.residuals) / np.var(log.swing))
    if explained < EXPLAINED:
        raise InputError(
            f"A decaying sine explains {100.0 * max(explained, 0.0):.0f} % of the log, so it is "
            "not a free swing: cut the log to the part with the crane at rest."
        )
    if rope is not None:
        _check_period(whole.period, rope)
    if not np.isfinite(whole.half_width):
        raise InputError(
            "The log contains changes that are too slow to separate from the swing's damping: "
            "remove any drift, or use a longer log."
        )
    if whole.ratio - whole.half_width <= 0.0:
        raise InputError(
            f"The log does not show that the swing decays: its damping ratio would be "
            f"{whole.ratio:.2g}, within {whole.ratio - whole.half_width:.2g} and "
            f"{whole.ratio + whole.half_width:.2g}: use a longer log of a load that swings freely."
        )
    ratios = _ratios_of_halves(log, whole)
    if across is not None:
        ratios += _ratio_across(log, whole, _checked(time, across, across=True))
    return FreeSwing(
        value=whole.ratio,
        low=min([whole.ratio - whole.half_width, *ratios]),
        high=max([whole.ratio + whole.half_width, *ratios]),
        period=whole.period,
        largest=float(whole.amplitude(log.elapsed[0])),
        smallest=float(whole.amplitude(log.elapsed[-1])),
        both_planes=across is not None,
    )


class _Fit(NamedTuple):
    """A decaying sine through a log."""

    unknowns: Array
    """Offset, cosine, sine [rad], frequency [rad/s], damping ratio."""
    residuals: Array
    """[rad]"""
    half_width: float
    """Half of the damping ratio's 95 % interval; inf if the residuals are too slow for one."""

    @property
    def ratio(self) -> float:
        """Damping ratio."""
        return float(self.unknowns[4])

    @property
    def period(self) -> float:
        """Undamped. [s]"""
        return 2.0 * pi / float(self.unknowns[3])

    def amplitude(self, elapsed: float | Array) -> Array:
        """Amplitude of the swing at a time. [rad]"""
        _, cosine, sine, frequency, ratio = self.unknowns
        return np.asarray(np.hypot(cosine, sine) * np.exp(-ratio * frequency * elapsed))


def _fitted(log: _Log, start: Array) -> _Fit:
    """Fit a decaying sine by least squares."""
    from scipy.optimize import least_squares
    from scipy.special import stdtrit

    # offset, cosine, sine, frequency, damping ratio
    lower = [-np.inf, -np.inf, -np.inf, 0.0, -STRONGEST]
    upper = [np.inf, np.inf, np.inf, np.inf, STRONGEST]
    fit = least_squares(
        _residual,
        start,
        jac=_jacobian,
        bounds=(lower, upper),
        x_scale="jac",
        args=(log.elapsed, log.swing),
    )
    residuals = fit.fun
    degrees_of_freedom = residuals.size / _correlation_time(residuals) - UNKNOWNS
    if degrees_of_freedom < 1.0:
        return _Fit(fit.x, residuals, np.inf)
    variance = float(residuals @ residuals) / degrees_of_freedom
    covariance = np.linalg.pinv(fit.jac.T @ fit.jac)
    standard_error = sqrt(variance * max(covariance[4, 4], 0.0))
    return _Fit(fit.x, residuals, float(stdtrit(degrees_of_freedom, 0.975)) * standard_error)


def _check_period(period: float, rope: float) -> None:
    """Refuse a log whose period is not that of its rope."""
    if not rope > 0.0:
        raise InputError(f"The rope is {rope:g} m long, but must be longer than 0 m.")
    expected = 2.0 * pi * sqrt(rope / GRAVITY)
    if abs(period / expected - 1.0) > PERIOD_TOLERANCE:
        raise InputError(
            f"The log swings once in {period:.3g} s, but a load on {rope:g} m of rope once in "
            f"{expected:.3g} s: check the column and the unit of the time."
        )


def _ratios_of_halves(log: _Log, whole: _Fit) -> list[float]:
    """Damping ratios of the log's halves, if they certainly differ; refused if by too much."""
    seen = whole.amplitude(log.elapsed) > np.std(whole.residuals)
    rows = np.flatnonzero(seen)
    middle = 0.5 * (log.elapsed[rows[0]] + log.elapsed[rows[-1]])
    halves = []
    for half in (log.elapsed <= middle, log.elapsed > middle):
        part = _Log(log.elapsed[seen & half], log.swing[seen & half])
        if part.elapsed.size <= 2 * UNKNOWNS:
            return []
        halves.append(_fitted(part, whole.unknowns))
    first, second = halves
    if not _differ(first, second):
        return []
    ratios = [first.ratio, second.ratio]
    if _agree(ratios):
        return ratios
    begin, between, end = np.degrees(
        whole.amplitude(np.array([0.0, middle, log.elapsed[rows[-1]]]))
    )
    raise InputError(
        f"The halves of the log do not agree: the damping ratio is {100.0 * first.ratio:.3g} % "
        f"from {begin:.3g} to {between:.3g} deg, and {100.0 * second.ratio:.3g} % from there to "
        f"{end:.3g} deg: it depends on the angle, or the plane of swing turns, or wind drives the "
        "load; log both planes without wind, and cut the log to the angles that matter."
    )


def _ratio_across(log: _Log, whole: _Fit, across: _Log) -> list[float]:
    """Damping ratio in the plane across, if it certainly differs; refused if by too much."""
    other = _fitted(across, whole.unknowns)
    swing_across = across.swing + other.residuals
    if np.std(swing_across) < IN_PLANE * np.std(log.swing) or not _differ(whole, other):
        return []
    if _agree([whole.ratio, other.ratio]):
        return [other.ratio]
    raise InputError(
        f"The planes of the log do not agree: the damping ratio is {100.0 * whole.ratio:.3g} % "
        f"along and {100.0 * other.ratio:.3g} % across, so the plane of swing turns: let the load "
        "swing in one plane."
    )


def _differ(one: _Fit, other: _Fit) -> bool:
    """Whether 95 % intervals of two damping ratios do not meet; by chance in 0.6 % of logs."""
    return abs(one.ratio - other.ratio) > one.half_width + other.half_width


def _agree(ratios: Sequence[float]) -> bool:
    """Whether two damping ratios differ by little of their mean."""
    return max(ratios) - min(ratios) <= AGREE * float(np.mean(ratios))


def _checked(time: ArrayLike, angle: ArrayLike, *, across: bool = False) -> _Log:
    """The log, if it can be a free swing, or the motion across one; else an `InputError`."""
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
    if not across and (swing.min() >= 0.0 or swing.max() <= 0.0):
        raise InputError(
            "The swing never changes its sign: use the signed angle in one plane, or subtract a "
            "constant."
        )
    return _Log(stamps - stamps[0], swing)


def _start(log: _Log) -> Array:
    """Offset, cosine, sine [rad], frequency [rad/s] and damping ratio to start the fit at.

    An `InputError` for fewer than five swings, and for a gap of more than half a swing.
    """
    time, swing = log
    grid = np.linspace(0.0, time[-1], time.size)
    even = np.interp(grid, time, swing) - swing.mean()
    steps = np.diff(time)
    following = np.clip(np.searchsorted(time, grid, side="right"), 1, steps.size)
    # a straight line across a gap would be a swing of its own
    even[steps[following - 1] > GAP * np.median(steps)] = 0.0
    power = np.abs(np.fft.rfft(even * np.hanning(grid.size), PADDED * grid.size))
    largest = int(np.argmax(power[1:])) + 1
    frequency = 2.0 * pi * largest / (PADDED * grid.size * grid[1])
    swings = frequency * time[-1] / (2.0 * pi)
    # of a pure offset or a drift the largest line is the lowest one
    if swings < FEWEST:
        raise InputError(
            f"The log has {swings:.1f} swings, but {FEWEST:g} are needed: use a longer one, "
            "beginning when the crane is at rest."
        )
    widest = int(np.argmax(steps))
    if steps[widest] > pi / frequency:
        raise InputError(
            f"The log has a gap of {steps[widest]:.3g} s, {time[widest]:.4g} s after its begin, "
            f"but swings once in {2.0 * pi / frequency:.3g} s: use the part before the gap, or "
            "the one after it."
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
