"""How well a speed follows the one that was wanted, and what compensation does for it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.analysis.compensation import inverse_map
from swashplate.analysis.inverse import InverseMap
from swashplate.drive import Drive
from swashplate.equations.marching.record import SOURCE_RATE
from swashplate.errors import InputError

if TYPE_CHECKING:
    import polars

    from swashplate.simulation.result import Simulation

Array = NDArray[np.float64]


class TrackingError(NamedTuple):
    """Speed less the wanted speed over a record. [rad/s]"""

    rms: float
    largest: float
    """Magnitude."""


@dataclass(frozen=True, eq=False)
class Tracked:
    """One way to command a wanted speed, and how the drive then follows."""

    name: str
    run: Simulation
    error: TrackingError


@dataclass(frozen=True, eq=False)
class Improvement:
    """A wanted speed commanded in several ways, the plainest first."""

    name: str
    """Name of the drive."""
    time: Array
    """(n,). [s]"""
    wanted: Array
    """(n,). [rad/s]"""
    ways: tuple[Tracked, ...]

    def to_polars(self) -> polars.DataFrame:
        """Table of time, wanted speed, and voltage and speed of each way, SI."""
        import polars as pl

        columns = {"time": self.time, "wanted_speed": self.wanted}
        for way in self.ways:
            assert way.run.voltage is not None
            label = way.name.replace(" ", "_")
            columns[f"voltage_{label}"] = way.run.voltage
            columns[f"speed_{label}"] = way.run.shaft_speed
        return pl.DataFrame(columns)


def tracking_error(speed: ArrayLike, wanted: ArrayLike) -> TrackingError:
    """Root mean square and largest magnitude of the difference of two speeds.

    Parameters
    ----------
    speed, wanted : (n,) array_like
        [rad/s]

    Raises
    ------
    InputError
        If they are not of one length, or a number is not finite.
    """
    done, asked = np.asarray(speed, dtype=np.float64), np.asarray(wanted, dtype=np.float64)
    if done.shape != asked.shape or done.ndim != 1 or done.size == 0:
        raise InputError(
            f"The speed has shape {done.shape} and the wanted speed {asked.shape}; both must be "
            "one row of as many samples."
        )
    if not (np.isfinite(done).all() and np.isfinite(asked).all()):
        raise InputError("Speed and wanted speed must be finite everywhere.")
    difference = done - asked
    return TrackingError(
        float(np.sqrt(np.mean(difference * difference))), float(np.abs(difference).max())
    )


def proportional_command(inverse: InverseMap, wanted: ArrayLike) -> Array:
    """Voltage of a controller that knows nothing of the drive but its full speed each way. [V]

    A straight line each way from 0 V at standstill to the saturation voltage at the limit. [V]
    """
    speed = np.asarray(wanted, dtype=np.float64)
    low, high = inverse.limits
    up = inverse.plus.voltage[-1] / high
    down = inverse.minus.voltage[0] / low
    return np.asarray(np.where(speed >= 0.0, up * speed, down * speed))


def wanted_of_stick(inverse: InverseMap, voltage: ArrayLike) -> Array:
    """Speed that a stick asks for: in proportion, ±10 V for the full speed of that way. [rad/s]"""
    volts = np.asarray(voltage, dtype=np.float64)
    low, high = inverse.limits
    return np.asarray(np.where(volts >= 0.0, 0.1 * high * volts, -0.1 * low * volts))


def improvement(
    drive: Drive,
    wanted_speed: ArrayLike,
    rate: float = SOURCE_RATE,
    *,
    inverse: InverseMap | None = None,
) -> Improvement:
    """What the inverse map buys: a wanted speed simulated with and without it.

    Parameters
    ----------
    drive : Drive
        What is driven.
    wanted_speed : (n,) array_like
        [rad/s]
    rate : float
        Its samples a second. [Hz]
    inverse : InverseMap, optional
        The map to use, of another drive perhaps, to see what a wrong one does; by default this
        drive's own.

    Returns
    -------
    Improvement
        Three ways: ``"straight line"`` (`proportional_command`), ``"inverse map"``
        (`InverseMap.voltage`), ``"inverse map and lead"`` (`InverseMap.command`).

    Raises
    ------
    InputError
        For a wanted speed beyond the drive's limits, or a record that cannot be simulated.
    """
    chosen = inverse_map(drive) if inverse is None else inverse
    led = chosen.command(wanted_speed, rate)
    wanted = np.array(wanted_speed, dtype=np.float64)
    commands = {
        "straight line": proportional_command(chosen, wanted),
        "inverse map": chosen.voltage(wanted),
        "inverse map and lead": led,
    }
    ways = []
    for name, voltage in commands.items():
        run = drive.simulate(voltage, rate)
        ways.append(Tracked(name, run, tracking_error(run.shaft_speed, wanted)))
    return Improvement(drive.name, ways[0].run.time, wanted, tuple(ways))
