"""Steady states: the pressure at which the valve is closed, and the speed that goes with it."""

from math import asin, atan, pi, sin

import numpy as np
from numpy.typing import NDArray

from swashplate.physics.component import component
from swashplate.physics.control_card import steady_current
from swashplate.physics.spool import moment_sine, orifice_opening
from swashplate.physics.stroker import pressure_rate
from swashplate.simulation.chain import pump_force, pump_speed, pump_spool
from swashplate.simulation.compilation import kernel
from swashplate.simulation.constants import Channel, Pump

Array = NDArray[np.float64]

BISECTIONS = 200
"""Enough to halve any interval of doubles down to neighbours."""


@component
def channel_level(voltage: float, channel: Channel) -> float:
    """Current at which one channel settles; `voltage` in the channel's direction. [A]"""
    share = 1.0 if voltage > channel.V_dz else 0.0
    return steady_current(
        voltage, share, channel.V_dz, channel.J, channel.G1, channel.G2, channel.G3
    )


@component
def closed_pressure(current: float, pump: Pump) -> float:
    """δP at which the spool closes, held within the limits.

    Without leakage sin α = sin(φ + atan(Z18/Z5)), so δP = (sin α/Z3 + Z2)/Z1. [Pa]
    """
    a = min(max(moment_sine(pump_force(current, pump), pump.Z4, pump.Z5), -1.0), 1.0)
    angle = min(max(asin(a) + atan(pump.Z18 / pump.Z5), -0.5 * pi), 0.5 * pi)
    closed = (sin(angle) / pump.Z3 + pump.Z2) / pump.Z1
    return min(max(closed, pump.lower), pump.upper)


@component
def leaking_pressure(current: float, pump: Pump) -> float:
    """δP at which the flow through the spool equals the leakage, by bisection. [Pa]

    The pressure's rate falls with the pressure, so there is one such point or a limit.
    """
    force = pump_force(current, pump)
    low, high = pump.lower, pump.upper
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        free = pump_spool(force, middle, pump)
        opening = orifice_opening(free, pump.Z14, pump.Z16_plus, pump.Z16_minus)
        rate = pressure_rate(middle, opening, pump.Z6, pump.Z7, pump.Z8, pump.Z9, pump.symmetric)
        if rate > 0.0:
            low = middle
        else:
            high = middle
    # the ends are neighbours now; a limit, where one of them still is it, counts exactly
    return high if high >= pump.upper else low


@component
def steady_pressure(current: float, pump: Pump) -> float:
    """δP that the pump settles at under a constant signed current. [Pa]"""
    if pump.leaky is None:
        return closed_pressure(current, pump)
    return leaking_pressure(current, pump)


@kernel
def steady_states(
    voltage: Array, plus: Channel, minus: Channel, pump: Pump, current: Array, speed: Array
) -> None:
    """Signed current [A] and speed [rad/s] that each of many constant voltages settles at."""
    for n in range(voltage.size):
        current[n] = channel_level(voltage[n], plus) - channel_level(-voltage[n], minus)
        speed[n] = pump_speed(steady_pressure(current[n], pump), current[n], pump)


@kernel
def steady_start(
    voltage: float, plus: Channel, minus: Channel, pump: Pump
) -> tuple[float, float, float]:
    """Currents of both channels [A] and pressure [Pa] that a constant voltage settles at."""
    current_plus = channel_level(voltage, plus)
    current_minus = channel_level(-voltage, minus)
    return current_plus, current_minus, steady_pressure(current_plus - current_minus, pump)


@kernel
def steady_pump_start(current: float, pump: Pump) -> float:
    """Pressure that a constant signed current settles at. [Pa]"""
    return steady_pressure(current, pump)
