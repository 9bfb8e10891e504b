"""Speed from positions by a moving polynomial, without phase (Savitzky and Golay)."""

import numpy as np
from numpy.typing import ArrayLike

from swashplate.campaign.stamps import Array, even_period, samples
from swashplate.errors import InputError
from swashplate.maneuvers.pieces import positive, whole


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
