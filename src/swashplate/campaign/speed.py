"""Speed from positions and encoder counts, and simulated speeds through the matching filter.

Kruse's path is two low passes in a row, of 10 and of 30 Hz. What differs is what drives them
over an interval between two samples. A measured position gives the interval's mean speed, its
difference over the period. A simulated speed must give the mean too, so that of its two samples;
driven by the earlier sample instead it comes half a sample later than the measured one.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from swashplate.campaign.experiment import Channel
from swashplate.campaign.samples import Array, Stamps, interpolate_counts, signal, stamps_of
from swashplate.equations.cache import kernel
from swashplate.errors import InputError
from swashplate.maneuvers.pieces import positive

LOW_PASS = 2.0 * np.pi * 10.0
"""a, cut-off of the low pass. [rad/s]"""
DIFFERENTIATOR = 2.0 * np.pi * 30.0
"""b, cut-off of the band-limited differentiator. [rad/s]"""
WINDOW = 0.1
"""Length of the moving parabola. [s]"""
Form = Literal["source", "exact"]
"""How the filters are made discrete.

``"source"``: Kruse's explicit recursions, meant for 512 Hz, refused where they are unstable.
``"exact"``: exact for a position that is straight between two samples, at any rate, even or not.
"""
Method = Literal["source", "exact", "savitzky_golay", "difference"]
"""How a position becomes a speed: by Kruse's filters for 512 Hz, by the same at any rate,
without phase by a moving parabola, by the change between neighbours for comparison."""


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

    Notes
    -----
    ``"savitzky_golay"`` is the slope of the parabola that fits the samples within 0.05 s of each
    instant best. It is not delayed, because half of each window lies in the future; within half a
    window of either end it is that of the first or last window, and noisier.
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
        return Speed(time, _slope(stamps_of(time), angle), 0.0)
    if method == "difference":
        return Speed(time[1:], np.diff(angle) / np.diff(time), 0.5 * period)
    raise InputError(
        f"There is no method '{method}'; there are source, exact, savitzky_golay and difference."
    )


def speed_from_angle(time: ArrayLike, angle: ArrayLike, *, form: Form = "source") -> Array:
    """Speed from angles (or any positions): low pass, then band-limited differentiator.

    Parameters
    ----------
    time : array_like, shape (n,)
        Stamps. The explicit form needs them even. [s]
    angle : array_like, shape (n,)
        Position, its staircase interpolated; at rest before the first row. [rad]
    form : {"source", "exact"}
        How the filters are made discrete.

    Returns
    -------
    array, shape (n,)
        Speed, delayed by `path_delay`; 0 in the first row. [rad/s]

    Raises
    ------
    InputError
        If a number is not finite, the stamps do not increase, or the explicit form cannot be used
        with these stamps.

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
    position = signal("angle", angle, stamps.time.size)
    intervals, recursion = _recursion(stamps, form)
    return _filtered(np.diff(position) / intervals, recursion)


def matched_speed(
    time: ArrayLike, speed: ArrayLike, *, form: Form = "source", aligned: bool = True
) -> Array:
    """Simulated speed as the measured path would show it, to be compared with that.

    Parameters
    ----------
    time : array_like, shape (n,)
        Stamps. [s]
    speed : array_like, shape (n,)
        Simulated speed, from rest. [rad/s]
    form :
        As of the measured path.
    aligned : bool
        Without it, Kruse's own filters, whose output is half a sample later.

    Notes
    -----
    Kruse (2001), figure 7.4: a/(s + a), then b/(s + b), the differentiator without its zero. The
    explicit y ← (1 - bh)·y + bh·w₋₁ looks at the sample before, where the differentiator looks at
    the mean over the interval: hence the half sample. Aligned, both phases agree at every
    frequency, and the amplitudes to x/tan x with x = π·frequency/rate: 0.1 % at 10 Hz and 512 Hz.
    """
    stamps = stamps_of(time)
    values = signal("speed", speed, stamps.time.size)
    _, recursion = _recursion(stamps, form)
    return _filtered(0.5 * (values[:-1] + values[1:]) if aligned else values[:-1], recursion)


def path_delay(period: float, *, form: Form = "source") -> float:
    """Delay of a slow change of speed on its way through the measured path. [s]

    Of a sample period h [s], 1/a + 1/b - h/2 in the explicit form, 20.2 ms at 512 Hz, and 1/a + 1/b
    but for terms in h² in the exact one, 21.2 ms.

    Raises
    ------
    InputError
        If the period is not positive, or the explicit form cannot be used.
    """
    h = positive("period", period)
    _recursion(Stamps(np.array([0.0, h]), h), form)
    return 1.0 / LOW_PASS + 1.0 / DIFFERENTIATOR - (0.5 * h if form == "source" else 0.0)


def _slope(stamps: Stamps, angle: Array) -> Array:
    """Slope of the moving parabola; refused where the window does not fit the stamps."""
    from scipy.signal import savgol_filter

    if stamps.period is None:
        raise InputError(
            "The Savitzky-Golay filter needs evenly spaced stamps; take the exact filters, or "
            "resample the record first."
        )
    count = 2 * round(0.5 * (WINDOW / stamps.period - 1.0)) + 1
    if not 3 <= count <= angle.size:
        raise InputError(
            f"The window of {WINDOW:g} s must hold from 3 samples to the record's {angle.size}, "
            f"but at {1.0 / stamps.period:.4g} Hz it holds {max(count, 0)}."
        )
    slope: Array = savgol_filter(angle, count, 2, deriv=1, delta=stamps.period, mode="interp")
    return slope


# --- the two low passes ---------------------------------------------------------------------------


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
def march_low_passes(drive: Array, recursion: Recursion, filtered: Array) -> None:
    """March the two low passes from rest: `drive` (n - 1,) by the interval, `filtered` (n,)."""
    state = 0.0
    filtered[0] = 0.0
    for n in range(drive.size):
        filtered[n + 1] = (
            recursion.kept_second[n] * filtered[n]
            + recursion.from_state[n] * state
            + recursion.from_drive[n] * drive[n]
        )
        state = recursion.kept_first[n] * state + (1.0 - recursion.kept_first[n]) * drive[n]


def _filtered(drive: Array, recursion: Recursion) -> Array:
    filtered = np.empty(drive.size + 1)
    march_low_passes(np.ascontiguousarray(drive), recursion, filtered)
    return filtered


def _recursion(stamps: Stamps, form: Form) -> tuple[Array, Recursion]:
    """Intervals [s], and coefficients of low passes with the cut-offs a and b over them."""
    a, b = LOW_PASS, DIFFERENTIATOR
    intervals = np.diff(stamps.time)
    if stamps.period is not None:
        intervals = np.full(stamps.time.size - 1, stamps.period)
    if form == "exact":
        first, second = np.exp(-a * intervals), np.exp(-b * intervals)
        # what x at the start of an interval leaves in y at its end
        from_state = b / (b - a) * (first - second)
        return intervals, Recursion(first, second, from_state, 1.0 - second - from_state)
    if form != "source":
        raise InputError(f"form must be 'source' or 'exact', not {form!r}.")
    if stamps.period is None:
        raise InputError(
            "Kruse's form of the filters needs evenly spaced stamps; take form 'exact', or "
            "resample the record first."
        )
    if b * stamps.period >= 2.0:
        raise InputError(
            f"Kruse's form of the filters is unstable at {1.0 / stamps.period:.4g} Hz, as at "
            f"every rate up to {0.5 * b:.4g} Hz; take form 'exact'."
        )
    keep = 1.0 - a * intervals, 1.0 - b * intervals
    return intervals, Recursion(*keep, b * intervals, np.zeros_like(intervals))
