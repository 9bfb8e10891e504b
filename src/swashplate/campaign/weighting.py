"""Weights of measured samples: by channel, window, manoeuvre and size of the input."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fnmatch import fnmatchcase
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.experiment import InputSignal
from swashplate.campaign.schema import Channel, Weight, Window

Array = NDArray[np.float64]
AnyWindow = TypeVar("AnyWindow", bound=Window)


def applying(windows: Iterable[AnyWindow], maneuver: str) -> tuple[AnyWindow, ...]:
    """The windows that hold in runs of a manoeuvre, such as ``"step +4 V"``."""
    return tuple(
        each for each in windows if each.maneuver is None or fnmatchcase(maneuver, each.maneuver)
    )


def inside(window: Window, time: Array) -> NDArray[np.bool_]:
    """(m,) whether stamps [s] lie in a window, its ends included."""
    within = np.ones(time.shape, dtype=np.bool_)
    if window.start is not None:
        within &= time >= window.start
    if window.stop is not None:
        within &= time <= window.stop
    return within


def weights(
    channel: Channel,
    time: Array,
    drive: InputSignal,
    ignored: Sequence[Window],
    weighted: Sequence[Weight],
    factor: float,
) -> Array:
    """Factors on the squared errors of a channel's samples.

    Parameters
    ----------
    channel : schema.Channel
        Its own weight, windows and weight by input.
    time : (m,) array
        Its stamps. [s]
    drive : InputSignal
        What drove the axis.
    ignored, weighted : sequences of Window, Weight
        Those of run, axis and channel that apply.
    factor : float
        The run's.

    Returns
    -------
    (m,) array
        Products of all that apply; 0 where ignored.
    """
    product = np.full(time.shape, factor * channel.weight)
    if channel.weight_by_input:
        levels, factors = np.transpose(channel.weight_by_input)
        product *= np.interp(np.abs(drive.at(time)), levels, factors)
    for each in weighted:
        product[inside(each, time)] *= each.factor
    for window in ignored:
        product[inside(window, time)] = 0.0
    return product
