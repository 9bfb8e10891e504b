"""Where a drive is linearised: a steady state at which small motions have an answer."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, isfinite, nextafter
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.equation import interpreted
from swashplate.equations.marching.run import Instance, called
from swashplate.errors import DomainError, InputError
from swashplate.models.card import Card
from swashplate.models.displacement_control import Pump, moment_sine, solenoid_force
from swashplate.models.pump import overpowered
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.simulation.instance import card_of, instance_of, without_ripple
from swashplate.simulation.run import pump_arguments, steady_states

Array = NDArray[np.float64]
Input = Literal[
    "voltage", "current", "solenoid_force", "load_torque", "pump_speed", "supply_pressure"
]

INPUTS: tuple[Input, ...] = get_args(Input)
COMMANDS = INPUTS[:3]  # Of which one moves at a time; the others can move beside it.
_SEARCHED = 4001  # Voltages among which a speed is looked for, before the place is found exactly.
_DECIMALS = 4
"""Of the voltage that is proposed; rounded away from 0 V, so that it does have a model."""


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
    """The mean of a turn. [rad/s]"""
    one_sided: tuple[str, ...] = ()
    """Switches that the point lies on, and the side whose slope is taken."""


class DeadZoneError(DomainError):
    """A point in a dead zone, where the gain is 0, and where there is a model instead.

    `where` names the point and its dead zone, `instead` what to linearise at.
    """

    def __init__(self, where: str, instead: str) -> None:
        self.where, self.instead = f"{where}, so the gain is 0", instead
        super().__init__(f"{self.where}; {instead}, or the pump alone with input='solenoid_force'.")


def operating_point(
    parameters: ParameterSet,
    input: str,
    *,
    voltage: float | None = None,
    current: float | None = None,
    speed: float | None = None,
) -> OperatingPoint:
    """Steady state at which small motions of an input, one of `INPUTS`, have an answer.

    Given by one of voltage [V], current [A] and speed [rad/s].

    Raises
    ------
    InputError
        If not exactly one is given, or it cannot be had.
    DomainError
        Where nothing moves: in a dead zone, within the solenoids' hysteresis, at a stop of the
        swash plate, at the relief pressure, behind a saturated orifice, in the grip of a friction
        without presliding; or where the solenoid overpowers the feedback spring.
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
    if input == "voltage" and current is not None:
        raise InputError(
            "A model from the voltage needs a voltage or a speed to linearise at, not a current."
        )
    if speed is not None:
        voltage = _voltage_of(parameters, speed)
    instance = without_ripple(instance_of(parameters, False))
    pump: Pump = instance.parts[1].p
    sides: list[str] = []
    if voltage is not None:
        if abs(voltage) > FULL_VOLTAGE:
            raise InputError(f"The voltage is {voltage:g} V, but the card takes ±10 V.")
        if input == "voltage":
            sides += _check_card(parameters, voltage)
        current = float(steady_states(parameters, np.array([voltage]))[0][0])
    assert current is not None
    sine = interpreted(moment_sine)(interpreted(solenoid_force)(current, pump), pump)
    if not 1.0 - sine * sine > 0.0:
        raise DomainError(f"{parameters.name}: {overpowered(1.0 - sine * sine, 'current')}")
    if input in ("voltage", "current"):
        sides += _check_solenoid(instance, parameters, current, voltage)
    _check_friction(instance)
    known = pump_arguments(instance, current)
    equations: Any = instance.model.parts[1]
    known["state"] = called(equations.settled, known)
    _check_limits(instance.name, known["state"].pressure, known["k"])
    signals = called(equations.sample, known)
    opening, position = signals.orifice_opening, signals.spool_position
    options = instance.parts[1].options
    if options.leaky is None:
        opening = 0.0  # and not what rounding leaves of it
    elif not -min(pump.Z14, pump.Z16_minus) < position < min(pump.Z14, pump.Z16_plus):
        raise DomainError(
            f"{parameters.name}: at {current:.6g} A the leakage takes all that the open orifice "
            "lets through, so the gain is 0; linearise at a smaller speed."
        )
    if options.symmetric is not None and opening == 0.0:
        sides.append("flow root at a closed spool: the side of positive opening")
    return OperatingPoint(
        voltage,
        current,
        signals.solenoid_force,
        known["state"].pressure,
        opening,
        signals.swash_angle,
        signals.shaft_speed,
        tuple(sides),
    )


def beyond_dead_zone(voltage: float, card: Card) -> float:
    """A voltage kept beyond its channel's dead zone by a hair. [V]"""
    if voltage >= 0.0:
        return max(voltage, nextafter(card.plus.V_dz, np.inf))
    return min(voltage, -nextafter(card.minus.V_dz, np.inf))


# --- where nothing moves --------------------------------------------------------------------------


def _check_card(parameters: ParameterSet, voltage: float) -> tuple[str, ...]:
    """Switches that a voltage lies on; refused in the dead zone of the card."""
    card = card_of(parameters)
    channel = card.plus if voltage >= 0.0 else card.minus
    if abs(voltage) > channel.V_dz:
        return ()
    if channel.V_dz == 0.0 and channel.J == 0.0:
        return ("card at 0 V: the side of positive voltage",)
    raise DeadZoneError(
        f"{parameters.name}: {voltage:g} V lies in the card's dead zone",
        _proposed(parameters, voltage),
    )


def _check_solenoid(
    instance: Instance, parameters: ParameterSet, current: float, voltage: float | None
) -> tuple[str, ...]:
    """Switches that a signed current lies on; refused where small motions change no force."""
    pump, options, _ = instance.parts[1]
    name = instance.name
    if options.hysteresis is not None:
        raise DeadZoneError(
            f"{name}: a current that moves by less than the solenoids' hysteresis of "
            f"±{pump.solenoid_hysteresis:g} A moves no force",
            "linearise the drive without it (solenoid_hysteresis=0) for larger motions, or sweep "
            "sines of a size with frequency_response",
        )
    if abs(current) > pump.Z17:
        return ()
    if pump.Z17 == 0.0:
        return ("solenoids at 0 A: the side of positive current",)
    zone = f"in the solenoids' dead zone of Z17 = ±{pump.Z17:g} A"
    if voltage is None:
        raise DeadZoneError(
            f"{name}: {current:.6g} A lies {zone}", f"linearise beyond ±{pump.Z17:g} A"
        )
    raise DeadZoneError(
        f"{name}: {voltage:g} V gives {current:.6g} A, which lies {zone}",
        _proposed(parameters, voltage),
    )


def _check_friction(instance: Instance) -> None:
    pump, options, _ = instance.parts[1]
    if options.friction is not None and pump.spool_presliding == 0.0:
        raise DomainError(
            f"{instance.name}: without spool_presliding the spool_friction of "
            f"{pump.spool_friction:g} N holds the spool fast under small motions, so the gain is "
            "0; give a presliding, or sweep sines of a size with frequency_response."
        )


def _check_limits(name: str, pressure: float, k: Any) -> None:
    if k.lower < pressure < k.upper:
        return
    stop = k.upper >= k.upper_stop if pressure >= k.upper else k.lower <= k.lower_stop
    what = "the swash plate is at its stop" if stop else "the pressure is at its limit Z15"
    raise DomainError(
        f"{name}: {what}, so the gain is 0; linearise at a smaller command, where the speed still "
        "follows."
    )


# --- other voltages -------------------------------------------------------------------------------


def _proposed(parameters: ParameterSet, voltage: float) -> str:
    """The first voltage of a side that has a model."""
    way, sign, side = (1.0, "+", "plus") if voltage >= 0.0 else (-1.0, "-", "minus")
    # a zone's end is part of it, so that the first step beyond has a model
    steps = np.arange(1, ceil(FULL_VOLTAGE * 10**_DECIMALS) + 1) / 10**_DECIMALS
    current, _ = steady_states(parameters, way * steps)
    numbers = parameters.numbers
    answers = (steps > numbers[f"V_dz_{side}"]) & (np.abs(current) > numbers["Z17"])
    if not answers.any():
        return f"no voltage up to {sign}{FULL_VOLTAGE:g} V leaves it: linearise on the other side"
    return f"linearise at {sign}{steps[int(np.argmax(answers))]:.{_DECIMALS}f} V or beyond"


def _voltage_of(parameters: ParameterSet, speed: float) -> float:
    """The voltage nearest to zero that settles at a speed."""
    from scipy.optimize import brentq

    def error(volts: float) -> float:
        return float(steady_states(parameters, np.array([volts]))[1][0] - speed)

    volts = np.linspace(-FULL_VOLTAGE, FULL_VOLTAGE, _SEARCHED)
    _, speeds = steady_states(parameters, volts)
    crossing = np.flatnonzero(np.diff(np.signbit(speeds - speed)))
    size = max(abs(float(speeds[0])), abs(float(speeds[-1])))
    found = [float(brentq(error, volts[k], volts[k + 1], xtol=1e-14)) for k in crossing]
    # where the speed jumps, the dead zone's end, brentq finds the jump
    roots = [each for each in found if abs(error(each)) <= 1e-9 * size]
    if not roots:
        lowest, highest = float(np.degrees(speeds.min())), float(np.degrees(speeds.max()))
        raise InputError(
            f"{parameters.name}: no constant voltage settles at {float(np.degrees(speed)):.6g} "
            f"deg/s; speeds lie between {lowest:.6g} and {highest:.6g} deg/s, without what the "
            "jump at the end of the dead zone leaves out."
        )
    return min(roots, key=abs)
