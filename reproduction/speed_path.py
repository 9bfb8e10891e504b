"""Speed from counts as Kruse (2001) computes it: explicit recursions, meant for 512 Hz."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from swashplate.campaign import DIFFERENTIATOR, LOW_PASS

Array = NDArray[np.float64]


def speed_of_angle(angle: Array, period: float) -> Array:
    """Speed (n,) [rad/s] of angles (n,) [rad] at even stamps, `path_delay` late.

    w ← (1 - ah)·w + ah·u₋₁, then y ← (1 - bh)·y + b·(w - w₋₁), from rest (figure 7.3). Differences
    are taken first, which leaves y as it is and spares it the cancellation.
    """
    return _filtered(np.diff(angle) / period, period)


def simulated_speed(speed: Array, period: float, *, aligned: bool = True) -> Array:
    """Simulated speed (n,) [rad/s] as the path of `speed_of_angle` would show it.

    The same low passes, the differentiator without its zero (figure 7.4). Kruse drives them by the
    sample before, which comes half a sample later than the measured path (erratum 33); `aligned`,
    they are driven by the mean of two samples.
    """
    return _filtered(0.5 * (speed[:-1] + speed[1:]) if aligned else speed[:-1], period)


def path_delay(period: float) -> float:
    """Delay of a slow change of speed on its way through `speed_of_angle`. [s]"""
    return 1.0 / LOW_PASS + 1.0 / DIFFERENTIATOR - 0.5 * period


def _filtered(drive: Array, period: float) -> Array:
    """What drives each interval (n - 1,) through both low passes, the state before the drive."""
    ah, bh = LOW_PASS * period, DIFFERENTIATOR * period
    state = lfilter([0.0, ah], [1.0, ah - 1.0], [*drive, 0.0])
    return np.asarray(lfilter([0.0, bh], [1.0, bh - 1.0], state))
