"""What a drive can do at most: speed, acceleration, and how well it follows a wanted speed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.analysis.trial import speed_per_volt
from swashplate.drive import Drive
from swashplate.errors import InputError
from swashplate.parameters.rules import FULL_VOLTAGE

Array = NDArray[np.float64]
Direction = Literal["both", "positive", "negative"]

SIGNS: Mapping[Direction, tuple[float, ...]] = {
    "both": (1.0, -1.0),
    "positive": (1.0,),
    "negative": (-1.0,),
}
STEP_LENGTH = 2.0
"""Of the full step that shows the largest acceleration. [s]"""
STEP_RATE = 512.0


class Performance(NamedTuple):
    """What a drive can do; of two directions the worse one."""

    speed: float
    """That the largest command settles at. [rad/s]"""
    acceleration: float
    """Largest one after a full step from rest. [rad/s²]"""
    tracking_error: float | None
    """RMS difference from the wanted speed, None where none is wanted. [rad/s]"""


@dataclass(frozen=True, eq=False)
class Wanted:
    """A speed to follow. Make it with `wanted`, which checks."""

    speed: Array
    """(n,) [rad/s]"""
    rate: float
    """Samples a second. [Hz]"""


def wanted(speed: ArrayLike, rate: float = 512.0) -> Wanted:
    """A speed to follow.

    Parameters
    ----------
    speed : (n,) array_like
        [rad/s]
    rate : float
        Samples a second. [Hz]

    Raises
    ------
    InputError
        If it is no row of two finite numbers or more.
    """
    profile = np.array(speed, dtype=np.float64)
    if profile.ndim != 1 or profile.size < 2 or not np.isfinite(profile).all():
        raise InputError("The wanted speed must be two finite numbers or more, in one row.")
    return Wanted(profile, float(rate))


def performance(
    drive: Drive, follow: Wanted | None = None, *, direction: Direction = "both"
) -> Performance:
    """What a drive can do.

    Parameters
    ----------
    drive : Drive
        From rest.
    follow : Wanted, optional
        A speed to follow. The command is in proportion to it, by the drive's own ratio (see
        `trial.speed_per_volt`), and ends at ±10 V: a larger pump is given less voltage.
    direction : {"both", "positive", "negative"}
        Which speed and acceleration count.

    Raises
    ------
    DomainError
        If the drive leaves the model's domain.
    """
    signs = SIGNS[direction]
    speed = min(abs(drive.steady_speed(sign * FULL_VOLTAGE)) for sign in signs)
    acceleration = min(_acceleration(drive, sign) for sign in signs)
    error = None
    if follow is not None:
        run = drive.simulate(command_for(drive, follow), follow.rate)
        error = float(np.sqrt(np.mean((run.shaft_speed - follow.speed) ** 2)))
    return Performance(float(speed), acceleration, error)


def command_for(drive: Drive, follow: Wanted) -> Array:
    """Voltage in proportion to a wanted speed, by the drive's own ratio, within ±10 V. [V]"""
    ratio = np.where(
        follow.speed >= 0.0,
        max(speed_per_volt(drive, 1.0), 1e-300),
        max(speed_per_volt(drive, -1.0), 1e-300),
    )
    return np.clip(follow.speed / ratio, -FULL_VOLTAGE, FULL_VOLTAGE)


def _acceleration(drive: Drive, sign: float) -> float:
    """Largest acceleration in a direction after a full step. [rad/s²]"""
    voltage = np.full(int(STEP_LENGTH * STEP_RATE) + 1, sign * FULL_VOLTAGE)
    voltage[0] = 0.0
    change = np.diff(drive.simulate(voltage, STEP_RATE).shaft_speed)
    return float((sign * change).max() * STEP_RATE)
