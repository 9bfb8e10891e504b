"""Speed of a measured position or encoder, by a method of choice."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.encoder import interpolate_counts
from swashplate.campaign.experiment import Channel
from swashplate.campaign.filters import path_delay, speed_from_angle, speed_from_counts
from swashplate.campaign.kalman import Smoothed, smooth_counts, smooth_positions
from swashplate.campaign.savitzky_golay import savitzky_golay_speed
from swashplate.errors import InputError

Array = NDArray[np.float64]
Method = Literal["source", "exact", "savitzky_golay", "kalman", "difference"]
"""How a position becomes a speed.

``"source"``: the source's explicit low pass and differentiator, for 512 Hz. ``"exact"``: the same
filters at any rate, even or not. ``"savitzky_golay"`` and ``"kalman"``: without phase.
``"difference"``: the change between neighbouring samples, for comparison.
"""


class Speed(NamedTuple):
    """A speed and how it came about."""

    time: Array
    """(m,) stamps. [s]"""
    speed: Array
    """(m,) samples. [rad/s], or m/s of a position in m"""
    deviation: Array | None
    """(m,) standard deviations of its error, where the method tells. [as the speed]"""
    delay: float
    """How late it is at low frequencies. [s]"""


def speed_of(channel: Channel, method: Method = "source") -> Speed:
    """Speed of a channel that measures a position.

    Parameters
    ----------
    channel : Channel
        Of the kind ``"position"`` or ``"encoder_counts"``; a measured speed is given as it is.
    method : Method
        How a position becomes a speed.

    Raises
    ------
    InputError
        If the channel measures something else, or the method cannot be used with its stamps.
    """
    if channel.kind == "shaft_speed":
        return Speed(channel.time, channel.values, None, 0.0)
    if not channel.is_position:
        raise InputError(
            f"{channel.source} is a {channel.kind}: only positions, encoders and speeds have a "
            "speed."
        )
    time = channel.time
    period = float(np.median(np.diff(time)))
    if method in ("source", "exact"):
        form: Literal["source", "exact"] = "source" if method == "source" else "exact"
        speed = _filtered(channel, form)
        return Speed(time, speed, None, path_delay(period, form=form))
    if method == "kalman":
        smoothed = _smoothed(channel)
        return Speed(time, smoothed.speed, smoothed.speed_deviation, 0.0)
    if method == "savitzky_golay":
        return Speed(time, savitzky_golay_speed(time, _continuous(channel)), None, 0.0)
    if method == "difference":
        steps = np.diff(channel.values) / np.diff(time)
        return Speed(time[1:], steps, None, 0.5 * period)
    raise InputError(
        f"There is no method '{method}'; there are source, exact, savitzky_golay, kalman and "
        "difference."
    )


def _filtered(channel: Channel, form: Literal["source", "exact"]) -> Array:
    if channel.encoder is None or channel.counts is None:
        return speed_from_angle(channel.time, channel.values, form=form)
    return speed_from_counts(
        channel.time,
        channel.counts,
        counts_per_turn=channel.encoder.counts_per_turn,
        gear_ratio=channel.encoder.gear_ratio,
        sign=channel.encoder.sign,
        form=form,
    )


def _continuous(channel: Channel) -> Array:
    """Positions, those of an encoder interpolated between changes of the count."""
    if channel.encoder is None or channel.counts is None:
        return channel.values
    return interpolate_counts(channel.time, channel.counts) * channel.encoder.angle_per_count


def _smoothed(channel: Channel) -> Smoothed:
    if channel.encoder is not None and channel.counts is not None:
        return smooth_counts(
            channel.time,
            channel.counts,
            counts_per_turn=channel.encoder.counts_per_turn,
            gear_ratio=channel.encoder.gear_ratio,
            sign=channel.encoder.sign,
        )
    if channel.noise is None:
        raise InputError(
            f"{channel.source} needs its noise, a standard deviation, for a Kalman smoother; add "
            "noise = ... to the channel."
        )
    return smooth_positions(channel.time, channel.values, channel.noise**2)
