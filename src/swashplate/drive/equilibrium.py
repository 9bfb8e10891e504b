"""Where a drive settles, and where small motions about that have an answer."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swashplate.drive.instance import card_of, drive_instance, models_of, without_ripple
from swashplate.errors import DomainError, InputError
from swashplate.machine import Machine, with_replacements
from swashplate.machine.fields import is_real
from swashplate.machine.marching import SOURCE_RATE, InitialStates, SignalId, called, marched
from swashplate.models.displacement_control import moment_sine, solenoid_force
from swashplate.models.pump import overpowered
from swashplate.parameters import FULL_VOLTAGE, ParameterSet

Array = NDArray[np.float64]

NO_GAIN = {
    "swash_stop": "the swash plate is at its stop",
    "relief": "the pressure is at its limit Z15",
    "orifice": "the leakage takes all that the open orifice lets through",
    "spool": "the leakage takes all that the open spool lets through",
}
"""What holds the speed under limits of the pump, see `swashplate.models.pump.PumpLimits`."""
DECIMALS = 4
"""Of the voltage that is proposed; rounded away from 0 V, so that it does have a model."""


def steady_states(parameters: ParameterSet, voltage: Array) -> tuple[Array, Array]:
    """Signed current [A] and speed [rad/s] that each of many constant voltages settles at."""
    instance = without_ripple(drive_instance(parameters, by_voltage=True))
    drive = models_of(parameters.equations).settled_drive
    settled = Machine.of_parts(drive, instance.parts, instance.name)
    stored = (SignalId(0, "signals", "current"), SignalId(1, "signals", "shaft_speed"))
    initial = InitialStates((), {"voltage": 0.0}, ())
    current, speed = marched(settled, {"voltage": voltage}, 1.0, initial, stored)
    return current, speed


@dataclass(frozen=True)
class OperatingPoint:
    """A steady state; signs as everywhere: positive goes with more speed.

    Examples
    --------
    >>> from swashplate import Drive
    >>> point = Drive.preset("hoist").linearize(6.0).operating_point
    >>> point.voltage, round(point.shaft_speed, 1)  # V, rad/s
    (6.0, 2.6)
    """

    voltage: float | None
    """None if a current was given. [V]"""
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


def operating_point(
    parameters: ParameterSet,
    input: str,
    voltage: float | None = None,
    current: float | None = None,
) -> OperatingPoint:
    """Steady state at which small motions of an input, one of `INPUTS`, have an answer.

    Parameters
    ----------
    parameters : ParameterSet
        The drive.
    input : str
        What is to move.
    voltage, current : float, optional
        One of the two: a constant voltage [V], or a constant signed current [A].

    Raises
    ------
    InputError
        If not exactly one of voltage and current is given, or it is out of range.
    DomainError
        If nothing moves: in a dead zone, within the solenoids' hysteresis, at a stop of the swash
        plate, at the relief pressure, after a saturated orifice, in the grip of a friction without
        presliding; or if the solenoid overpowers the feedback spring.
    """
    name = parameters.name
    current = _current_at(parameters, input, voltage, current)
    instance = without_ripple(drive_instance(parameters, by_voltage=False))
    pump, options, _ = instance.parts[1]
    replacements = instance.model.parts[1].replacements
    force = with_replacements(solenoid_force, replacements)(current, pump)
    sine = with_replacements(moment_sine, replacements)(force, pump)
    if not (margin := 1.0 - sine * sine) > 0.0:
        raise DomainError(f"{name}: {overpowered(margin, 'current')}")

    sides = []
    if input == "voltage" and voltage is not None:
        sides += _card_sides(parameters, voltage)
    if input in ("voltage", "current"):
        if options.hysteresis is not None:
            raise DomainError(
                f"{name}: a current that moves by less than the solenoids' hysteresis of "
                f"±{pump.solenoid_hysteresis:g} A produces no force, so the gain is 0; linearise "
                "the drive without it (solenoid_hysteresis=0) for larger motions, or the pump "
                "alone with input solenoid_force, or sweep sines of a size with "
                "frequency_response."
            )
        sides += _solenoid_sides(parameters, pump.Z17, current, voltage)
    if options.friction is not None and pump.spool_presliding == 0.0:
        raise DomainError(
            f"{name}: without spool_presliding the spool_friction of {pump.spool_friction:g} N "
            "prevents small motions of the spool, so the gain is 0; give a presliding, or sweep "
            "sines of a size with frequency_response."
        )
    _, arguments = instance.start({"current": current}, 1.0 / SOURCE_RATE, "steady").arguments
    equations: Any = instance.model.parts[1]
    limits = called(equations, equations.limits, arguments)
    for limit, what in NO_GAIN.items():
        if getattr(limits, limit):
            raise DomainError(
                f"{name}: {what}, so the gain is 0; linearise at a smaller command, at which the "
                "speed still changes."
            )
    signals = arguments["signals"]
    # without leakage the spool is closed, but for rounding
    opening = 0.0 if options.leaky is None else signals.orifice_opening
    if options.symmetric is not None and opening == 0.0:
        sides.append("flow root at a closed spool: the side of positive opening")
    return OperatingPoint(
        voltage=voltage,
        current=current,
        solenoid_force=signals.solenoid_force,
        stroker_pressure=signals.stroker_pressure,
        orifice_opening=opening,
        swash_angle=signals.swash_angle,
        shaft_speed=signals.shaft_speed,
        one_sided=tuple(sides),
    )


def _current_at(
    parameters: ParameterSet, input: str, voltage: float | None, current: float | None
) -> float:
    """Steady current at a voltage, or the given one [A]; refuses what is out of range."""
    command = current if voltage is None else voltage
    if command is None or (voltage is not None and current is not None):
        raise InputError("Linearise at a voltage or a current; give exactly one of them.")
    if not is_real(command) or not isfinite(command):
        raise InputError(f"Linearise at a finite number of volts or amperes, not {command}.")
    if input == "voltage" and voltage is None:
        raise InputError("A model from the voltage needs a voltage to linearise at, not a current.")
    if voltage is None:
        return command
    if abs(voltage) > FULL_VOLTAGE:
        raise InputError(f"The voltage is {voltage:g} V, but the card takes ±10 V.")
    currents, _ = steady_states(parameters, np.array([voltage]))
    return float(currents[0])


def _card_sides(parameters: ParameterSet, voltage: float) -> list[str]:
    """Side of the card whose slope is taken at 0 V; refuses a voltage in its dead zone."""
    card = card_of(parameters)
    channel = card.plus if voltage >= 0.0 else card.minus
    if channel.V_dz == channel.J == voltage == 0.0:
        return ["card at 0 V: the side of positive voltage"]
    if abs(voltage) <= channel.V_dz:
        zone = f"{voltage:g} V is in the card's dead zone"
        raise DomainError(
            f"{parameters.name}: {zone}, so the gain is 0; {_beyond(parameters, voltage)}."
        )
    return []


def _solenoid_sides(
    parameters: ParameterSet, dead_zone: float, current: float, voltage: float | None
) -> list[str]:
    """Side of the solenoids whose slope is taken at 0 A; refuses a current in their dead zone."""
    if dead_zone == current == 0.0:
        return ["solenoids at 0 A: the side of positive current"]
    if abs(current) > dead_zone:
        return []
    cause = "" if voltage is None else f"{voltage:g} V gives "
    instead = f"linearise beyond ±{dead_zone:g} A"
    if voltage is not None:
        instead = _beyond(parameters, voltage)
    raise DomainError(
        f"{parameters.name}: {cause}{current:.6g} A, which is in the solenoids' dead zone of "
        f"Z17 = ±{dead_zone:g} A, so the gain is 0; {instead}."
    )


def _beyond(parameters: ParameterSet, voltage: float) -> str:
    """Advise to linearise beyond the dead zone: name the first voltage of the side beyond it."""
    direction = 1.0 if voltage >= 0.0 else -1.0
    sign = "+" if voltage >= 0.0 else "-"
    side = "plus" if voltage >= 0.0 else "minus"
    # a zone's end is part of it, so that the first step beyond has a model
    steps = np.arange(1, ceil(FULL_VOLTAGE * 10**DECIMALS) + 1) / 10**DECIMALS
    current, _ = steady_states(parameters, direction * steps)
    numbers = parameters.numbers
    answers = (steps > numbers[f"V_dz_{side}"]) & (np.abs(current) > numbers["Z17"])
    instead = f"no voltage up to {sign}{FULL_VOLTAGE:g} V leaves it: linearise on the other side"
    if answers.any():
        first = steps[int(np.argmax(answers))]
        instead = f"linearise at {sign}{first:.{DECIMALS}f} V or beyond"
    return f"{instead}, or the pump alone at current 0 with input solenoid_force"
