"""The largest acceleration at every speed, and what sets it."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.drive import Drive
from swashplate.equations.cache import kernel
from swashplate.models.pump import (
    Pump,
    PumpConstants,
    PumpOptions,
    arm_sine,
    orifice_opening,
    plate_rate,
    pressure_rate,
    shaft_speed,
    solenoid_force,
    solenoids_of,
    spool_balance,
    swash_angle,
    swash_tangent,
)
from swashplate.models.refinements import static_leakage
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.simulation.instance import instance_of
from swashplate.simulation.run import pressure_limits, settled_state

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
    pressure: Array,
    current: float,
    p: Pump,
    k: PumpConstants,
    options: PumpOptions,
    speed: Array,
    acceleration: Array,
    code: Codes,
) -> None:
    """Speed [rad/s] and acceleration [rad/s²] at stroking pressures [Pa], under one current [A].

    The speed is that of the plate's angle less what leaks under a load that stands still; what
    leaks while it accelerates is left out.
    """
    leakage = 0.0 if options.leakage is None else static_leakage(p.motor_leakage, p.load_torque)
    force = solenoid_force(current, solenoids_of(p))
    for n in range(pressure.size):
        free = spool_balance(force, arm_sine(pressure[n], p), p)
        orifice = p.Z16_plus if free > 0.0 else p.Z16_minus
        opening = orifice_opening(free, p)
        angle = swash_angle(swash_tangent(pressure[n], p), p, options.steep)
        rising = pressure_rate(pressure[n], opening, p.Z6, p.Z7, p.Z8, p.Z9, options.symmetric)
        speed[n] = shaft_speed(angle, leakage, p.Z10, p.Z11)
        acceleration[n] = p.Z10 * plate_rate(pressure[n], rising, p, k)
        code[n] = 1 if abs(free) > p.Z14 else 0
        if min(abs(free), p.Z14) > orifice:
            code[n] = 2


def acceleration_curve(drive: Drive, voltage: float, points: int = 201) -> AccelerationCurve:
    """Acceleration at every speed while a command has been held long enough for its current.

    With refinements it is that of the plate's mean motion: in the middle of what friction and
    hysteresis leave open, without the lag of a damped plate, the swing of a line or the ripple of a
    turn.

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
    instance = instance_of(drive.parameters, False)
    low, high = (
        settled_state(instance, drive.steady_current(way * FULL_VOLTAGE)).pressure
        for way in (-1.0, 1.0)
    )
    inside = INSIDE * (high - low)
    return _curve(drive, voltage, np.linspace(low + inside, high - inside, points))


def speed_limits(drive: Drive) -> tuple[float, float]:
    """Lowest and highest speed that the swash plate's stops, or Z15, allow at all. [rad/s]"""
    k = pressure_limits(instance_of(drive.parameters, False))
    low, high = _curve(drive, 0.0, np.array([k.lower, k.upper])).speed
    return float(low), float(high)


def starting_acceleration(drive: Drive, way: float) -> tuple[float, AcceleratedBy]:
    """Acceleration of the plate upright under the full command, and what sets it. [rad/s²]

    Z10 Z1 Z8 √(Z9/2) x/(1 + Z6) without offset and leakage, x = Z16 where the orifice limits.
    """
    numbers = drive.parameters.numbers
    curve = _curve(drive, way * FULL_VOLTAGE, np.array([numbers["Z2"] / numbers["Z1"]]))
    return float(curve.acceleration[0]), curve.by[0]


def _curve(drive: Drive, voltage: float, pressure: Array) -> AccelerationCurve:
    instance = instance_of(drive.parameters, False)
    p, options, _ = instance.parts[1]
    # a line at rest leaks as a stiff one does
    leaks = options.leakage if options.line is None else options.line
    forms = PumpOptions(symmetric=options.symmetric, steep=options.steep, leakage=leaks)
    speed, acceleration = np.empty_like(pressure), np.empty_like(pressure)
    code = np.empty(pressure.size, dtype=np.int64)
    accelerations(
        *(pressure, drive.steady_current(voltage), p, pressure_limits(instance), forms),
        *(speed, acceleration, code),
    )
    return AccelerationCurve(speed, acceleration, tuple(CODES[each] for each in code))
