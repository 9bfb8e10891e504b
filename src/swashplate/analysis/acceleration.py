"""The largest acceleration at every speed, and what sets it."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.drive import Drive
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.physics.motor import shaft_speed
from swashplate.physics.spool import orifice_opening
from swashplate.physics.swash import swash_angle, swash_tangent
from swashplate.simulation.build import build_pump
from swashplate.simulation.chain import pump_force, pump_spool, pump_swash_rate
from swashplate.simulation.compilation import kernel
from swashplate.simulation.constants import Pump
from swashplate.simulation.run import rest_pressure
from swashplate.simulation.steady import steady_pump_start

Array = NDArray[np.float64]
Codes = NDArray[np.int64]
AcceleratedBy = Literal["valve", "spool stop", "orifice"]

CODES: tuple[AcceleratedBy, ...] = ("valve", "spool stop", "orifice")
"""What sets the flow to the stroking piston: the opening that the solenoids can give, the spool's
stop Z14, or the in-line orifice Z16."""


INSIDE = 1e-9
"""Part of the range of pressure by which a curve ends before it."""


class AccelerationCurve(NamedTuple):
    """Acceleration over the speed under one held command, (n,) each."""

    speed: Array
    """Rising. [rad/s]"""
    acceleration: Array
    """With its sign. [rad/s²]"""
    by: tuple[AcceleratedBy, ...]
    """What sets it."""


@kernel
def accelerations(
    pressure: Array, current: float, pump: Pump, speed: Array, acceleration: Array, code: Codes
) -> None:
    """Speed [rad/s] and acceleration [rad/s²] at stroking pressures [Pa], under one current [A].

    The speed is that of the plate's angle; what Z12 takes from it while it accelerates is left out.
    """
    force = pump_force(current, pump)
    for n in range(pressure.size):
        free = pump_spool(force, pressure[n], pump)
        orifice = pump.Z16_plus if free > 0.0 else pump.Z16_minus
        opening = orifice_opening(free, pump.Z14, pump.Z16_plus, pump.Z16_minus)
        tangent = swash_tangent(pressure[n], pump.Z1, pump.Z2)
        angle = swash_angle(tangent, pump.Z13_plus, pump.Z13_minus, pump.steep)
        speed[n] = shaft_speed(angle, 0.0, pump.Z10, pump.Z11)
        acceleration[n] = pump.Z10 * pump_swash_rate(pressure[n], opening, pump)
        code[n] = 1 if abs(free) > pump.Z14 else 0
        if min(abs(free), pump.Z14) > orifice:
            code[n] = 2


def acceleration_curve(drive: Drive, voltage: float, points: int = 201) -> AccelerationCurve:
    """Acceleration at every speed while a command has been held long enough for its current.

    Parameters
    ----------
    drive : Drive
        The drive.
    voltage : float
        Command, within ±10 V; 0 is the stick let go. [V]
    points : int
        Speeds, evenly spaced in stroking pressure between those that ±10 V settle at.

    Returns
    -------
    AccelerationCurve
        The ends lie a hair's breadth inside, where the plate still moves.
    """
    pump = build_pump(drive.parameters)
    low, high = (
        steady_pump_start(float(drive.steady_current(way * FULL_VOLTAGE)), pump)
        for way in (-1.0, 1.0)
    )
    inside = INSIDE * (high - low)
    return _curve(drive, voltage, np.linspace(low + inside, high - inside, points))


def speed_limits(drive: Drive) -> tuple[float, float]:
    """Lowest and highest speed that the swash plate's stops, or Z15, allow at all. [rad/s]"""
    pump = build_pump(drive.parameters)
    low, high = _curve(drive, 0.0, np.array([pump.lower, pump.upper])).speed
    return float(low), float(high)


def starting_acceleration(drive: Drive, way: float) -> tuple[float, AcceleratedBy]:
    """Acceleration of the plate upright under the full command, and what sets it. [rad/s²]

    Z10 Z1 Z8 √(Z9/2) x/(1 + Z6) without offset and leakage, x = Z16 where the orifice limits.
    """
    pressure = np.array([rest_pressure(build_pump(drive.parameters))])
    curve = _curve(drive, way * FULL_VOLTAGE, pressure)
    return float(curve.acceleration[0]), curve.by[0]


def _curve(drive: Drive, voltage: float, pressure: Array) -> AccelerationCurve:
    pump = build_pump(drive.parameters)
    speed, acceleration = np.empty_like(pressure), np.empty_like(pressure)
    code = np.empty(pressure.size, dtype=np.int64)
    accelerations(pressure, drive.steady_current(voltage), pump, speed, acceleration, code)
    return AccelerationCurve(speed, acceleration, tuple(CODES[each] for each in code))
