"""Speed from positions and encoder counts, and simulated speeds through the matching filter.

The source's path is two low passes in a row, of 10 and of 30 Hz. What differs is what drives them
over an interval between two samples. A measured position gives the interval's mean speed, its
difference over the period. A simulated speed must give the mean too, so that of its two samples;
driven by the earlier sample instead it comes half a sample later than the measured one.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from swashplate.campaign.encoder import interpolate_counts, interpolated, radians_per_count
from swashplate.campaign.experiment import Channel
from swashplate.campaign.stamps import Array, Stamps, even_period, samples, signal, stamps_of
from swashplate.equations.cache import kernel
from swashplate.errors import InputError
from swashplate.maneuvers.checks import positive, whole

LOW_PASS = 2.0 * np.pi * 10.0
"""a, cut-off of the low pass. [rad/s]"""
DIFFERENTIATOR = 2.0 * np.pi * 30.0
"""b, cut-off of the band-limited differentiator. [rad/s]"""
Form = Literal["source", "exact"]
"""How the filters are made discrete.

``"source"``: the source's explicit recursions, meant for 512 Hz, refused where they are unstable.
``"exact"``: exact for a position that is straight between two samples, at any rate, even or not.
"""
Method = Literal["source", "exact", "savitzky_golay", "difference"]
"""How a position becomes a speed: by the source's filters for 512 Hz, by the same at any rate,
without phase by a moving polynomial, by the change between neighbours for comparison."""


class Speed(NamedTuple):
    """A speed and how it came about."""

    time: Array
    """(m,) stamps. [s]"""
    speed: Array
    """(m,) samples. [rad/s], or m/s of a position in m"""
    delay: float
    """How late it is at low frequencies. [s]"""


def speed_of(channel: Channel, method: Method = "source") -> Speed:
    """Speed of a channel that measures a position; a measured speed is given as it is.

    Parameters
    ----------
    channel : Channel
        Of the kind ``"position"``, ``"encoder_counts"`` or ``"shaft_speed"``.
    method : Method
        How a position becomes a speed.

    Raises
    ------
    InputError
        If the channel measures something else, or the method cannot be used with its stamps.
    """
    if channel.kind == "shaft_speed":
        return Speed(channel.time, channel.values, 0.0)
    if not channel.is_position:
        raise InputError(
            f"{channel.source} is a {channel.kind}: only positions, encoders and speeds have a "
            "speed."
        )
    time, encoder = channel.time, channel.encoder
    period = float(np.median(np.diff(time)))
    angle = channel.values
    if method != "difference" and encoder is not None and channel.counts is not None:
        # on a grid where the stamps are even, so that their rounding stays out of the speed
        even = stamps_of(time).time
        angle = interpolate_counts(even, channel.counts) * encoder.angle_per_count
    if method in ("source", "exact"):
        form: Form = "source" if method == "source" else "exact"
        return Speed(time, speed_from_angle(time, angle, form=form), path_delay(period, form=form))
    if method == "savitzky_golay":
        return Speed(time, savitzky_golay_speed(time, angle), 0.0)
    if method == "difference":
        return Speed(time[1:], np.diff(angle) / np.diff(time), 0.5 * period)
    raise InputError(
        f"There is no method '{method}'; there are source, exact, savitzky_golay and difference."
    )


def speed_from_counts(
    time: ArrayLike,
    counts: ArrayLike,
    *,
    counts_per_turn: float,
    gear_ratio: float = 1.0,
    sign: Literal[1, -1] = 1,
    form: Form = "source",
    low_pass: float = LOW_PASS,
    differentiator: float = DIFFERENTIATOR,
    start_speed: float = 0.0,
) -> Array:
    """Speed of a shaft from encoder counts: interpolation, low pass, band-limited differentiator.

    Parameters
    ----------
    time : array_like, shape (n,)
        Stamps. [s]
    counts : array_like, shape (n,)
        Position without roll-overs (`encoder.unwrap_counts`). [count]
    counts_per_turn, gear_ratio, sign :
        Scale of the encoder, as in `encoder.radians_per_count`.
    form, low_pass, differentiator, start_speed :
        The filters, as in `speed_from_angle`.

    Returns
    -------
    array, shape (n,)
        Speed, delayed by `path_delay`. [rad/s]

    Raises
    ------
    InputError
        As `encoder.interpolate_counts`, `encoder.radians_per_count` and `speed_from_angle`.
    """
    stamps = stamps_of(time)
    position = interpolated(stamps.time, signal("counts", counts, stamps.time.size))
    position *= radians_per_count(counts_per_turn, gear_ratio, sign)
    return _speed(stamps, position, form, low_pass, differentiator, start_speed)


def speed_from_angle(
    time: ArrayLike,
    angle: ArrayLike,
    *,
    form: Form = "source",
    low_pass: float = LOW_PASS,
    differentiator: float = DIFFERENTIATOR,
    start_speed: ArrayLike = 0.0,
) -> Array:
    """Speed from angles (or any positions): low pass, then band-limited differentiator.

    Parameters
    ----------
    time : array_like, shape (n,)
        Stamps. The explicit form needs them even. [s]
    angle : array_like, shape (n,) or (n, k)
        Position, its staircase interpolated; columns are filtered side by side. [rad]
    form : {"source", "exact"}
        How the filters are made discrete.
    low_pass, differentiator : float
        Cut-offs a and b. [rad/s]
    start_speed : float or array_like, shape (k,)
        Speed at and long before the first row, 0 at rest. [rad/s]

    Returns
    -------
    array, shape of `angle`
        Speed, delayed by `path_delay`; `start_speed` in the first row. [rad/s]

    Raises
    ------
    InputError
        If a number is not finite, the stamps do not increase, a cut-off is not positive, or the
        explicit form cannot be used with these stamps.

    Notes
    -----
    Kruse (2001), figure 7.3: a/(s + a), then b·s/(s + b). With u the angle, the explicit form is
    w ← (1 - ah)·w + ah·u₋₁, then y ← (1 - bh)·y + b·(w - w₋₁), for h = 1/512 s. Differences are
    taken first here, which leaves y as it is and spares it the cancellation. The exact form is the
    zero-order hold of the interval's mean speed in front of a/(s + a) and b/(s + b). A zero-order
    hold of the angle would be no use: it makes a staircase, which the differentiator amplifies by
    bh/(1 - exp(-bh)), 20 % too much at 512 Hz.
    """
    stamps = stamps_of(time)
    position = samples("angle", angle, stamps.time.size)
    return _speed(stamps, position, form, low_pass, differentiator, start_speed)


def _speed(
    stamps: Stamps,
    position: Array,
    form: Form,
    low_pass: float,
    differentiator: float,
    start_speed: ArrayLike,
) -> Array:
    intervals = intervals_of(stamps)
    recursion = recursion_of(stamps, form, low_pass, differentiator)
    start = _start(start_speed, position)
    return filtered_by(position, Taps(-1.0 / intervals, 1.0 / intervals), recursion, start)


def matched_speed(
    time: ArrayLike,
    speed: ArrayLike,
    *,
    form: Form = "source",
    low_pass: float = LOW_PASS,
    differentiator: float = DIFFERENTIATOR,
    start_speed: ArrayLike = 0.0,
    aligned: bool = True,
) -> Array:
    """Simulated speed as the measured path would show it, to be compared with that.

    Parameters
    ----------
    time : array_like, shape (n,)
        Stamps. [s]
    speed : array_like, shape (n,) or (n, k)
        Simulated speed, or its k derivatives by the parameters: the filter is linear and treats
        every column alike. [rad/s]
    form, low_pass, differentiator, start_speed :
        As of the measured path. Of derivatives, `start_speed` is the derivative at the start.
    aligned : bool
        Without it, the source's own filters, whose output comes half a sample later than the
        measured path's.

    Returns
    -------
    array, shape of `speed`
        Speed, delayed by `path_delay`, and by half a sample more if not aligned. [rad/s]

    Raises
    ------
    InputError
        As `speed_from_angle`.

    Notes
    -----
    Kruse (2001), figure 7.4: a/(s + a), then b/(s + b), the differentiator without its zero. The
    explicit y ← (1 - bh)·y + bh·w₋₁ looks at the sample before, where the differentiator looks at
    the mean over the interval: hence the half sample. Aligned, both phases agree at every
    frequency, and the amplitudes to x/tan x with x = π·frequency/rate: 0.1 % at 10 Hz and 512 Hz.
    """
    stamps = stamps_of(time)
    values = samples("speed", speed, stamps.time.size)
    recursion = recursion_of(stamps, form, low_pass, differentiator)
    share = 0.5 if aligned else 0.0
    right = np.full(stamps.time.size - 1, share)
    return filtered_by(values, Taps(1.0 - right, right), recursion, _start(start_speed, values))


def path_delay(
    period: float,
    *,
    form: Form = "source",
    low_pass: float = LOW_PASS,
    differentiator: float = DIFFERENTIATOR,
) -> float:
    """Delay of a slow change of speed on its way through the measured path [s].

    Parameters
    ----------
    period : float
        Sample period h. [s]
    form, low_pass, differentiator :
        As in `speed_from_angle`.

    Returns
    -------
    float
        1/a + 1/b - h/2 in the explicit form, 20.2 ms at 512 Hz, and 1/a + 1/b but for terms in h²
        in the exact one, 21.2 ms. [s]

    Raises
    ------
    InputError
        If a number is not positive, or the explicit form cannot be used.
    """
    h = positive("period", period)
    stamps = Stamps(np.array([0.0, h]), h)
    first, second, from_state, _ = (
        float(each[0]) for each in recursion_of(stamps, form, low_pass, differentiator)
    )
    # mean age of what the output is made of, in samples: half a sample of the mean, what x adds
    # where it is used, and what each recursion keeps
    through_state = from_state / (1.0 - second) * (1.0 + first / (1.0 - first))
    return h * (0.5 + through_state + second / (1.0 - second))


def savitzky_golay_speed(
    time: ArrayLike, angle: ArrayLike, *, window: float = 0.1, order: int = 2
) -> Array:
    """Slope of the polynomial that fits the samples around each instant best.

    Parameters
    ----------
    time : array_like, shape (n,)
        Evenly spaced stamps. [s]
    angle : array_like, shape (n,) or (n, k)
        Position; of an encoder, interpolated (`encoder.interpolate_counts`). [rad]
    window : float
        Length of the fit; the nearest odd number of samples is taken. [s]
    order : int
        Order of the polynomial.

    Returns
    -------
    array, shape of `angle`
        Speed, not delayed: half of each window lies in the future. Within half a window of either
        end it is the slope of the polynomial through the first or last window, and noisier. [rad/s]

    Raises
    ------
    InputError
        If the stamps are uneven, the window holds too few samples for the order or more than the
        record has, or a number is not finite.
    """
    from scipy.signal import savgol_filter

    period = even_period(time, "The Savitzky-Golay filter")
    stamps = np.asarray(time, dtype=float)
    position = samples("angle", angle, stamps.size)
    length = positive("window", window)
    count = 2 * round(0.5 * (length / period - 1.0)) + 1
    degree = whole("order", order)
    if degree < 1:
        raise InputError("order must be 1 at least: a constant has no slope.")
    if not degree < count <= stamps.size:
        raise InputError(
            f"window must hold more than {degree} samples for order {degree} and at most the "
            f"record's {stamps.size}, but {length:g} s hold {max(count, 0)}."
        )
    slope = savgol_filter(position, count, degree, deriv=1, delta=period, axis=0, mode="interp")
    return np.asarray(slope, dtype=np.float64)


# --- the two low passes ---------------------------------------------------------------------------


def _start(start_speed: ArrayLike, values: Array) -> Array:
    columns = values.size // values.shape[0]
    try:
        start = np.broadcast_to(np.asarray(start_speed, dtype=float), (columns,)).copy()
    except (TypeError, ValueError):
        raise InputError(
            f"start_speed must be one number or {columns}, one a column, not {start_speed!r}."
        ) from None
    if not np.isfinite(start).all():
        raise InputError(f"start_speed must be finite, not {start_speed!r}.")
    return start


class Taps(NamedTuple):
    """What drives an interval: ``left`` times the sample before it, ``right`` times the one after.

    Both have shape (n - 1,), one element an interval.
    """

    left: Array
    right: Array


class Recursion(NamedTuple):
    """Coefficients of the two low passes, each of shape (n - 1,), one element an interval.

    With v what drives the interval, x the first low pass and y the second:
    y ← kept_second·y + from_state·x + from_drive·v, then x ← kept_first·x + (1 - kept_first)·v.
    """

    kept_first: Array
    kept_second: Array
    from_state: Array
    from_drive: Array


@kernel
def march_low_passes(
    values: Array, taps: Taps, recursion: Recursion, start: Array, filtered: Array
) -> None:
    """March the two low passes over all rows; the columns are independent of each other.

    Parameters
    ----------
    values : (n, k) array
        Samples.
    taps, recursion : Taps, Recursion
        What drives the low passes, and they themselves.
    start : (k,) array
        State of both low passes at the first row.
    filtered : (n, k) array
        Output: the second low pass, `start` in the first row.
    """
    rows, columns = values.shape
    state = start.copy()
    for j in range(columns):
        filtered[0, j] = start[j]
    for n in range(1, rows):
        left, right = taps.left[n - 1], taps.right[n - 1]
        kept_first, kept_second = recursion.kept_first[n - 1], recursion.kept_second[n - 1]
        from_state, from_drive = recursion.from_state[n - 1], recursion.from_drive[n - 1]
        for j in range(columns):
            drive = left * values[n - 1, j] + right * values[n, j]
            filtered[n, j] = (
                kept_second * filtered[n - 1, j] + from_state * state[j] + from_drive * drive
            )
            state[j] = kept_first * state[j] + (1.0 - kept_first) * drive


def filtered_by(values: Array, taps: Taps, recursion: Recursion, start: Array) -> Array:
    """Run the low passes over samples of shape (n,) or (n, k) from a state of shape (k,)."""
    columns = values.reshape(values.shape[0], -1)
    filtered = np.empty_like(columns)
    march_low_passes(columns, taps, recursion, start, filtered)
    return filtered.reshape(values.shape)


def intervals_of(stamps: Stamps) -> Array:
    """Length of each interval [s]."""
    if stamps.period is None:
        return np.diff(stamps.time)
    return np.full(stamps.time.size - 1, stamps.period)


def recursion_of(stamps: Stamps, form: Form, low_pass: float, differentiator: float) -> Recursion:
    """Coefficients of low passes with cut-offs a and b [rad/s].

    Raises
    ------
    InputError
        If a cut-off is not positive, or the explicit form does not fit the stamps.
    """
    a, b = positive("low_pass", low_pass), positive("differentiator", differentiator)
    intervals = intervals_of(stamps)
    if form == "exact":
        first, second = np.exp(-a * intervals), np.exp(-b * intervals)
        # what x at the start of an interval leaves in y at its end; also for a = b, and for gaps
        apart = abs(b - a) * intervals
        ratio = np.divide(-np.expm1(-apart), apart, out=np.ones_like(apart), where=apart > 0.0)
        from_state = b * intervals * np.exp(-min(a, b) * intervals) * ratio
        return Recursion(first, second, from_state, 1.0 - second - from_state)
    if form != "source":
        raise InputError(f"form must be 'source' or 'exact', not {form!r}.")
    if stamps.period is None:
        raise InputError(
            "The source's form of the filters needs evenly spaced stamps; take form 'exact', or "
            "resample the record first."
        )
    fastest = max(a, b)
    if fastest * stamps.period >= 2.0:
        raise InputError(
            f"The source's form of the filters is unstable at {1.0 / stamps.period:.4g} Hz, as at "
            f"every rate up to {0.5 * fastest:.4g} Hz; take form 'exact'."
        )
    return Recursion(
        1.0 - a * intervals, 1.0 - b * intervals, b * intervals, np.zeros_like(intervals)
    )
