"""Speed from positions through the source's two filters, and simulated speeds through their match.

Both paths are one linear filter: two low passes in a row, of 10 and of 30 Hz. What differs is what
drives them over an interval between two samples. A measured position gives the interval's mean
speed, its difference over the period. A simulated speed must give the mean too, so that of its two
samples; driven by the earlier sample instead it comes half a sample later than the measured one.
"""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from swashplate.campaign.encoder import interpolated, radians_per_count
from swashplate.campaign.low_passes import Form, Taps, filtered_by, intervals_of, recursion_of
from swashplate.campaign.stamps import Array, Stamps, samples, signal, stamps_of
from swashplate.errors import InputError
from swashplate.maneuvers.pieces import positive

LOW_PASS = 2.0 * np.pi * 10.0
"""a, cut-off of the low pass. [rad/s]"""
DIFFERENTIATOR = 2.0 * np.pi * 30.0
"""b, cut-off of the band-limited differentiator. [rad/s]"""


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
