"""A command to judge drives by, and the speed that is wanted of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.drive import Drive
from swashplate.errors import InputError
from swashplate.parameters.rules import FULL_VOLTAGE

Array = NDArray[np.float64]

REST = 0.5
"""A command that rests at 0 V this long lets the drive settle at its creep. [s]"""
STOPPED = 1.0 - 1e-9
"""Part of the speed limit from which the plate counts as at its stop."""


@dataclass(frozen=True, eq=False)
class Trial:
    """A command, and the speed that a perfect drive would make of it. Make it with `trial`."""

    voltage: Array
    """(n,) [V]"""
    rate: float
    """Samples a second. [Hz]"""
    wanted: Array
    """(n,) speed of the shaft. [rad/s]"""

    @property
    def time(self) -> Array:
        """(n,) time stamps. [s]"""
        return np.arange(self.voltage.size) / self.rate

    @cached_property
    def begin(self) -> int:
        """Sample from which on the command leaves its first value: the last one before it."""
        return max(int(np.argmax(self.voltage != self.voltage[0])) - 1, 0)

    @cached_property
    def held(self) -> int:
        """The last sample at which the command is at its largest, either way."""
        size = np.abs(self.voltage)
        return int(np.flatnonzero(size >= size.max() - 1e-9)[-1])

    @property
    def rests(self) -> bool:
        """Whether the command begins at 0 V and stays there long enough to see the drive creep."""
        return bool(self.voltage[0] == 0.0 and self.begin >= REST * self.rate)


def trial(
    drive: Drive,
    voltage: ArrayLike,
    rate: float = 512.0,
    *,
    wanted: ArrayLike | None = None,
) -> Trial:
    """A command to judge drives by.

    Parameters
    ----------
    drive : Drive
        The drive as it is.
    voltage : (n,) array_like
        Command. [V]
    rate : float
        Samples a second. [Hz]
    wanted : (n,) array_like, optional
        Speed that a perfect drive would have; by default `proportional_speed` of this drive,
        which stays what is wanted of its variants. [rad/s]

    Raises
    ------
    InputError
        If the command is no row of at least two numbers within ±10 V that changes, or the wanted
        speed is not as long.
    """
    volts = np.array(voltage, dtype=np.float64)
    if volts.ndim != 1 or volts.size < 2 or not (np.abs(volts) <= FULL_VOLTAGE).all():
        raise InputError("A command needs two samples or more, in one row, within ±10 V.")
    if (volts == volts[0]).all():
        raise InputError(f"The command stays at {volts[0]:g} V; to judge a drive it has to change.")
    if wanted is None:
        speed = proportional_speed(drive, volts)
    else:
        speed = np.array(wanted, dtype=np.float64)
        if speed.shape != volts.shape or not np.isfinite(speed).all():
            raise InputError(
                f"The wanted speed must be {volts.size} finite numbers, one a sample of the "
                "command."
            )
    return Trial(volts, float(rate), speed)


def proportional_speed(drive: Drive, voltage: ArrayLike) -> Array:
    """Speed in proportion to the command, each way at the drive's own ratio. [rad/s]

    Parameters
    ----------
    drive : Drive
        Its speed limit by the voltage that first reaches it is the ratio, beyond the limit, too.
    voltage : (n,) array_like
        Command. [V]
    """
    volts = np.asarray(voltage, dtype=np.float64)
    plus, minus = speed_per_volt(drive, 1.0), speed_per_volt(drive, -1.0)
    return np.where(volts >= 0.0, plus, minus) * volts


def speed_per_volt(drive: Drive, sign: float) -> float:
    """Speed limit by the voltage that first reaches it. [(rad/s)/V]

    Parameters
    ----------
    drive : Drive
        The drive.
    sign : float
        Positive or negative direction.
    """
    low, high = 0.0, FULL_VOLTAGE
    limit = abs(drive.steady_speed(float(np.copysign(FULL_VOLTAGE, sign))))
    for _ in range(4):  # each pass narrows the place a hundredfold
        volts = np.linspace(low, high, 101)
        stopped = np.abs(drive.steady_speed(np.copysign(volts, sign))) >= STOPPED * limit
        first = max(int(np.argmax(stopped)), 1)
        low, high = float(volts[first - 1]), float(volts[first])
    return limit / high
