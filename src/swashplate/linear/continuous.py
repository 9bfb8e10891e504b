"""The continuous linear model of a drive."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError
from swashplate.linear.model import Coulomb, LinearDrive
from swashplate.linear.operating_point import (
    Input,
    OperatingPoint,
    card_command,
    operating_point,
)
from swashplate.linear.slopes import (
    CardSlopes,
    PumpSlopes,
    card_slopes,
    pump_slopes,
    solenoid_slope,
)
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.physics.card_dynamics import COULOMB_WIDTH
from swashplate.simulation.build import build_channel, build_pump
from swashplate.simulation.record import SOURCE_RATE

Array = NDArray[np.float64]

OUTPUTS = (
    "shaft_speed",
    "swash_angle",
    "stroker_pressure",
    "orifice_opening",
    "spool_position",
    "solenoid_force",
    "current",
)
"""Signals that a linear model can have as outputs."""


def linearize(
    parameters: ParameterSet,
    *,
    voltage: float | None = None,
    current: float | None = None,
    speed: float | None = None,
    input: Input | None = None,
    outputs: Sequence[str] = ("shaft_speed",),
    coulomb: Coulomb = "ignored",
) -> LinearDrive:
    """Linear model of small motions about a steady state; see `Drive.linearize`."""
    if input is None:
        input = "voltage" if current is None else "current"
    if coulomb not in ("ignored", "tangent"):
        raise InputError(f"coulomb is '{coulomb}'; it is 'ignored' or 'tangent'.")
    if coulomb == "tangent" and parameters.coulomb_sign == "literal":
        raise InputError(
            "The literal sign of the card's Coulomb term has no slope; linearise with "
            "coulomb='ignored'."
        )
    point = operating_point(parameters, input, voltage=voltage, current=current, speed=speed)
    names = checked_outputs(outputs, input)
    slopes, force_slope = slopes_at(parameters, point, 1.0 / SOURCE_RATE)
    by_input = 1.0 if input == "solenoid_force" else force_slope
    pump_row = slopes.rate_by_pressure, slopes.rate_by_force * by_input
    if input != "voltage":
        A, B = np.array([[pump_row[0]]]), np.array([[pump_row[1]]])
        rows = output_rows(names, slopes, by_input)
        C, D = rows[:, :1], rows[:, 1:]
        states: tuple[str, ...] = ("stroker_pressure",)
        delay = 0.0
    else:
        side = channel_side(point)
        numbers = parameters.numbers
        zeta, omega, C_coulomb = (numbers[f"{n}_{side}"] for n in ("zeta", "omega", "C"))
        damping = 2.0 * zeta * omega
        if coulomb == "tangent":
            damping += C_coulomb / COULOMB_WIDTH
        by_voltage = card_at(parameters, point, coulomb, 1.0 / SOURCE_RATE).steady_by_voltage
        A = np.array(
            [
                [-damping, -omega * omega, 0.0],
                [1.0, 0.0, 0.0],
                [0.0, pump_row[1], pump_row[0]],
            ]
        )
        B = np.array([[omega * omega * by_voltage], [0.0], [0.0]])
        rows = output_rows(names, slopes, by_input)
        C = np.column_stack((np.zeros(len(names)), rows[:, 1], rows[:, 0]))
        D = np.zeros((len(names), 1))
        states = ("current_rate", "current", "stroker_pressure")
        delay = numbers["tau"]
    return LinearDrive(A, B, C, D, states, names, input, delay, None, point, coulomb, parameters)


def checked_outputs(outputs: Sequence[str], input: Input) -> tuple[str, ...]:
    """Names of outputs, refused where the input is all there is before them."""
    names = (outputs,) if isinstance(outputs, str) else tuple(outputs)
    possible = [name for name in OUTPUTS if name != input]
    if input == "solenoid_force":
        possible.remove("current")
    for name in names:
        if name not in possible:
            raise InputError(
                f"'{name}' is no output of a model from {input.replace('_', ' ')}; it has "
                f"{', '.join(possible)}."
            )
    if not names or len(set(names)) != len(names):
        raise InputError("A linear model needs one output or several different ones.")
    return names


def channel_side(point: OperatingPoint) -> str:
    """The card's channel that is on, ``"plus"`` or ``"minus"``."""
    assert point.voltage is not None
    return "plus" if point.voltage >= 0.0 else "minus"


def slopes_at(
    parameters: ParameterSet, point: OperatingPoint, step: float
) -> tuple[PumpSlopes, float]:
    """Slopes of the pump at a point and of the force by the current [N/A]."""
    pump = build_pump(parameters)
    force, by_current = solenoid_slope(point.current, pump)
    found = pump_slopes(point.stroker_pressure, force, point.orifice_opening, pump, step)
    return PumpSlopes._make(found), by_current


def card_at(
    parameters: ParameterSet, point: OperatingPoint, coulomb: Coulomb, step: float
) -> CardSlopes:
    """Slopes of the card's channel at a point, with or without the Coulomb term's."""
    assert point.voltage is not None
    channel = build_channel(parameters, channel_side(point), step)
    if coulomb == "ignored":
        channel = channel._replace(C=0.0)
    command = card_command(point.voltage, channel)
    return CardSlopes._make(card_slopes(command, abs(point.current), channel, step))


def output_rows(names: tuple[str, ...], slopes: PumpSlopes, force_by_input: float) -> Array:
    """Derivatives of outputs by the stroking pressure and by current or force, (m, 2)."""
    by = force_by_input
    rows = {
        "shaft_speed": (slopes.speed_by_pressure, slopes.speed_by_force * by),
        "swash_angle": (slopes.angle_by_pressure, 0.0),
        "stroker_pressure": (1.0, 0.0),
        "orifice_opening": (slopes.opening_by_pressure, slopes.opening_by_force * by),
        "spool_position": (slopes.spool_by_pressure, slopes.spool_by_force * by),
        "solenoid_force": (0.0, by),
        "current": (0.0, 1.0),
    }
    return np.array([rows[name] for name in names])
