"""Where a drive is linearised: the steady state of a voltage, a current or a speed."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, nextafter
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import DomainError, InputError
from swashplate.linear.dead_zone import check_card, check_solenoid
from swashplate.linear.slopes import solenoid_slope
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.simulation.build import build_channel, build_pump
from swashplate.simulation.constants import Channel, Pump
from swashplate.simulation.march import observe_inside, observe_speed
from swashplate.simulation.record import SOURCE_RATE
from swashplate.simulation.run import check_domain
from swashplate.simulation.steady import steady_pump_start, steady_start, steady_states

Array = NDArray[np.float64]
Input = Literal["voltage", "current", "solenoid_force"]

INPUTS: tuple[Input, ...] = ("voltage", "current", "solenoid_force")
_SEARCHED = 4001
"""Voltages among which a speed is looked for, before the place is found exactly."""


@dataclass(frozen=True)
class OperatingPoint:
    """A steady state; signs as everywhere: positive goes with more speed."""

    voltage: float | None
    """None where a current was given. [V]"""
    current: float
    """Signed. [A]"""
    solenoid_force: float
    """[N]"""
    stroker_pressure: float
    """δP. [Pa]"""
    orifice_opening: float
    """x_eff: zero, unless the stroking piston leaks. [m]"""
    swash_angle: float
    """[rad]"""
    shaft_speed: float
    """[rad/s]"""
    one_sided: tuple[str, ...] = ()
    """Switches that the point lies on, and the side whose slope is taken."""


def operating_point(
    parameters: ParameterSet,
    input: Input,
    *,
    voltage: float | None = None,
    current: float | None = None,
    speed: float | None = None,
) -> OperatingPoint:
    """Steady state at which small motions of an input have an answer.

    Parameters
    ----------
    parameters : ParameterSet
        The drive.
    input : {"voltage", "current", "solenoid_force"}
        What moves.
    voltage, current, speed : float
        One of them. [V, A, rad/s]

    Raises
    ------
    InputError
        If not exactly one is given, or it cannot be had.
    DomainError
        Where nothing moves: in a dead zone, at a stop of the swash plate, at the relief pressure,
        behind a saturated orifice; or where the solenoid overpowers the feedback spring.
    """
    given = {"voltage": voltage, "current": current, "speed": speed}
    chosen = {name: value for name, value in given.items() if value is not None}
    if len(chosen) != 1:
        raise InputError("Linearise at a voltage, a current or a speed; give exactly one of them.")
    if input not in INPUTS:
        raise InputError(f"The input is '{input}', but must be one of {', '.join(INPUTS)}.")
    ((name, value),) = chosen.items()
    if not isfinite(value):
        raise InputError(f"The {name} to linearise at is {value}, but must be a finite number.")
    pump = build_pump(parameters)
    plus, minus = (build_channel(parameters, s, 1.0 / SOURCE_RATE) for s in ("plus", "minus"))
    if speed is not None:
        voltage = _voltage_of(parameters.name, speed, plus, minus, pump)
    sides: list[str] = []
    if voltage is not None:
        if abs(voltage) > FULL_VOLTAGE:
            raise InputError(f"The voltage is {voltage:g} V, but the card takes ±10 V.")
        if input == "voltage":
            sides += check_card(parameters.name, voltage, plus, minus, pump)
        positive, negative, pressure = steady_start(voltage, plus, minus, pump)
        current = positive - negative
    else:
        assert current is not None
        if input == "voltage":
            raise InputError(
                "A model from the voltage needs a voltage or a speed to linearise at, not a "
                "current."
            )
        pressure = steady_pump_start(current, pump)
    force, _ = solenoid_slope(current, pump)
    check_domain(parameters.name, pump.Z5**2 * force**2 / pump.Z4, "current")
    if input != "solenoid_force":
        sides += check_solenoid(parameters.name, current, voltage, plus, minus, pump)
    _check_limits(parameters.name, pressure, pump)
    inside = [np.empty(1) for _ in range(5)]
    at = (np.array([current]), np.array([pressure]))
    observe_inside(*at, pump, *inside[:4])
    observe_speed(*at, pump, inside[4])
    _, position, opening, angle, shaft_speed = (float(each[0]) for each in inside)
    if pump.leaky is None:
        opening = 0.0  # and not what rounding leaves of it
    elif not -min(pump.Z14, pump.Z16_minus) < position < min(pump.Z14, pump.Z16_plus):
        raise DomainError(
            f"{parameters.name}: at {current:.6g} A the leakage takes all that the open orifice "
            "lets through, so the gain is 0; linearise at a smaller speed."
        )
    if pump.symmetric is not None and opening == 0.0:
        sides.append("flow root at a closed spool: the side of positive opening")
    return OperatingPoint(
        voltage, current, force, pressure, opening, angle, shaft_speed, tuple(sides)
    )


def card_command(voltage: float, channel: Channel) -> float:
    """Command in the channel's direction, kept beyond its dead zone by a hair. [V]"""
    return max(abs(voltage), nextafter(channel.V_dz, np.inf))


def _check_limits(name: str, pressure: float, pump: Pump) -> None:
    if pump.lower < pressure < pump.upper:
        return
    high = pressure >= pump.upper
    stop = pump.upper >= pump.upper_stop if high else pump.lower <= pump.lower_stop
    what = "the swash plate is at its stop" if stop else "the pressure is at its limit Z15"
    raise DomainError(
        f"{name}: {what}, so the gain is 0; linearise at a smaller command, where the speed still "
        "follows."
    )


def _voltage_of(name: str, speed: float, plus: Channel, minus: Channel, pump: Pump) -> float:
    """The voltage nearest to zero that settles at a speed."""
    from scipy.optimize import brentq

    def error(volts: float) -> float:
        found = np.empty(2)
        steady_states(np.array([volts]), plus, minus, pump, found[:1], found[1:])
        return float(found[1] - speed)

    volts = np.linspace(-FULL_VOLTAGE, FULL_VOLTAGE, _SEARCHED)
    current, speeds = np.empty(volts.size), np.empty(volts.size)
    steady_states(volts, plus, minus, pump, current, speeds)
    crossing = np.flatnonzero(np.diff(np.signbit(speeds - speed)))
    size = max(abs(float(speeds[0])), abs(float(speeds[-1])))
    found = [float(brentq(error, volts[k], volts[k + 1], xtol=1e-14)) for k in crossing]
    # where the speed jumps, the dead zone's end, brentq finds the jump
    roots = [each for each in found if abs(error(each)) <= 1e-9 * size]
    if not roots:
        lowest, highest = float(np.degrees(speeds.min())), float(np.degrees(speeds.max()))
        raise InputError(
            f"{name}: no constant voltage settles at {float(np.degrees(speed)):.6g} deg/s; speeds "
            f"lie between {lowest:.6g} and {highest:.6g} deg/s, without what the jump at the end "
            "of the dead zone leaves out."
        )
    return min(roots, key=abs)
