"""Speed from positions and encoder counts by Kruse's two low passes, of 10 and of 30 Hz.

They are made discrete exactly for a position that is straight between two samples: what drives them
over an interval is its mean speed, the difference of two positions over the time between them.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from swashplate.campaign.experiment import Channel
from swashplate.campaign.samples import Array, interpolate_counts, signal, stamps_of
from swashplate.errors import InputError
from swashplate.machine import Machine, Model, equation, simulate

LOW_PASS = 2.0 * np.pi * 10.0
"""a, cut-off of the low pass. [rad/s]"""
DIFFERENTIATOR = 2.0 * np.pi * 30.0
"""b, cut-off of the band-limited differentiator. [rad/s]"""
RATE = 1.0
"""Of the march, which knows intervals by what they leave. [Hz]"""
Method = Literal["exact", "difference"]
"""How a position becomes a speed: by the filters, or by the change between neighbours."""


class DerivedSpeed(NamedTuple):
    """A speed and how it came about."""

    time: Array
    """(m,) stamps. [s]"""
    speed: Array
    """(m,) samples. [rad/s], or m/s of a position in m"""
    delay: float
    """How late it is at low frequencies. [s]"""


def speed_of(channel: Channel, method: Method = "exact") -> DerivedSpeed:
    """Speed of a channel that measures a position; a measured speed is given as it is.

    Parameters
    ----------
    channel : Channel
        Of the kind ``"position"``, ``"encoder_counts"`` or ``"shaft_speed"``.
    method : {"exact", "difference"}
        How a position becomes a speed. The filters delay a slow motion by 1/a + 1/b, 21.2 ms, but
        for terms in the square of the sample period.

    Raises
    ------
    InputError
        If the channel measures something else, or there is no such method.

    Examples
    --------
    >>> from swashplate import Campaign, campaign, maneuvers, rig
    >>> file = rig.write(rig.run("hoist", {"step": maneuvers.step(9.0)}), "tests")
    >>> derived = campaign.speed_of(Campaign.from_toml(file)["hoist_step"]["counts"])
    >>> derived.speed.shape == derived.time.shape  # rad/s, s
    True
    """
    time, values, encoder = channel.time, channel.values, channel.encoder
    if channel.kind == "shaft_speed":
        return DerivedSpeed(time, values, 0.0)
    if not channel.is_position or method not in get_args(Method):
        raise InputError(
            f"{channel.source} is a {channel.kind}: only positions, encoders and speeds have a "
            "speed, by the method exact or difference."
        )
    if method == "difference":
        half = 0.5 * float(np.median(np.diff(time)))
        return DerivedSpeed(time[1:], np.diff(values) / np.diff(time), half)
    if encoder is not None and channel.counts is not None:
        # on a grid if the stamps are even, so that their rounding stays out of the speed
        even, _ = stamps_of(time)
        values = interpolate_counts(even, channel.counts) * encoder.angle_per_count
    return DerivedSpeed(time, speed_from_angle(time, values), 1.0 / LOW_PASS + 1.0 / DIFFERENTIATOR)


def speed_from_angle(time: ArrayLike, angle: ArrayLike) -> Array:
    """Speed (n,) from positions (n,) at stamps [s], even or not: low pass, then differentiator.

    At rest before the first row; 1/a + 1/b late. [rad/s]

    Raises
    ------
    InputError
        If a number is not finite or the stamps do not increase.

    Notes
    -----
    Kruse (2001), figure 7.3: a/(s + a), then b·s/(s + b), as the zero-order hold of the interval's
    mean speed in front of a/(s + a) and b/(s + b). A zero-order hold of the angle would be no use:
    it makes a staircase, which the differentiator amplifies by bh/(1 - exp(-bh)), 20 % too much at
    512 Hz.
    """
    stamps, period = stamps_of(time)
    position = signal("angle", angle, stamps.size)
    intervals = np.diff(stamps) if period is None else np.full(stamps.size - 1, period)
    speed = np.diff(position) / intervals
    # of each interval, and of none after the last sample
    records = {
        "speed": np.append(speed, 0.0),
        "first": np.append(np.exp(-LOW_PASS * intervals), 0.0),
        "second": np.append(np.exp(-DIFFERENTIATOR * intervals), 0.0),
    }
    return np.array(simulate(Machine(low_passes, NoParameters()), records, RATE)["differentiated"])


class NoParameters(NamedTuple):
    """What the low passes have, whose cut-offs are constants."""


class LowPasses(NamedTuple):
    """Outputs of the low passes, at rest at first."""

    smooth: float = 0.0
    """Of the first, a/(s + a). [rad/s]"""
    differentiated: float = 0.0
    """Of the second, b/(s + b), behind it. [rad/s]"""


@equation
def over_interval(state: LowPasses, speed: float, first: float, second: float) -> LowPasses:
    """Outputs at the end of an interval with a mean `speed`, of which so much is left of each."""
    # what the first low pass has at the start of an interval leaves in the second at its end
    difference = DIFFERENTIATOR / (DIFFERENTIATOR - LOW_PASS) * (first - second)
    fresh = 1.0 - second - difference
    return LowPasses(
        first * state.smooth + (1.0 - first) * speed,
        second * state.differentiated + difference * state.smooth + fresh * speed,
    )


low_passes = Model("low_passes", NoParameters, LowPasses, over_interval)
