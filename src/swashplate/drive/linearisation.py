"""Linear model of a drive from checked inputs and outputs."""

from __future__ import annotations

from collections.abc import Sequence

from swashplate.drive.equilibrium import operating_point
from swashplate.drive.linear_drive import LinearDrive
from swashplate.drive.signals import UNITS
from swashplate.drive.small_motion import (
    COMMANDS,
    INPUTS,
    OUTPUTS,
    Coulomb,
    Input,
    small_motion_model,
)
from swashplate.errors import InputError
from swashplate.parameters import ParameterSet


def linearize_drive(
    parameters: ParameterSet,
    voltage: float | None = None,
    current: float | None = None,
    input: Input | Sequence[Input] | None = None,
    outputs: Sequence[str] = ("shaft_speed",),
    coulomb: Coulomb = "ignored",
) -> LinearDrive:
    """Linear model of small motions about a steady state; see `Drive.linearize`."""
    if input is None:
        input = "voltage" if current is None else "current"
    inputs = _checked_inputs((input,) if isinstance(input, str) else tuple(input))
    output_names = _checked_outputs(
        (outputs,) if isinstance(outputs, str) else tuple(outputs), inputs[0]
    )
    if coulomb not in ("ignored", "tangent"):
        raise InputError(f"coulomb is '{coulomb}'; it is 'ignored' or 'tangent'.")
    if coulomb == "tangent" and parameters.coulomb_sign == "literal":
        raise InputError(
            "The literal sign of the card's Coulomb term has no slope; linearise with "
            "coulomb='ignored'."
        )
    point = operating_point(parameters, inputs[0], voltage, current)
    model = small_motion_model(parameters, point, inputs, output_names, coulomb)
    return LinearDrive(
        name=parameters.name,
        A=model.A,
        B=model.B,
        C=model.C,
        D=model.D,
        states=model.states,
        inputs=inputs,
        outputs=output_names,
        delay=_delay(parameters, inputs[0], output_names),
        units={name: UNITS[name] for name in (*inputs, *output_names)},
        at={"current": point.current} if point.voltage is None else {"voltage": point.voltage},
        operating_point=point,
        coulomb=coulomb,
        parameters=parameters,
    )


def _delay(parameters: ParameterSet, command: str, outputs: tuple[str, ...]) -> float:
    """Delay of the outputs behind the command. [s]

    The solenoids' delay stands behind the card's dynamics, but small motions are linear and do not
    change with time, so that it counts as well before the command.
    """
    card = parameters.numbers["tau"] if command == "voltage" else 0.0
    solenoids = parameters.numbers.get("solenoid_delay", 0.0)
    passes = command in ("voltage", "current") and "late" in parameters.options
    if not passes or solenoids == 0.0:
        return card
    ahead = [name for name in outputs if name == "current"]
    if ahead and len(ahead) < len(outputs):
        raise InputError(
            f"The current is not behind the solenoids' delay of {solenoids:g} s, and a linear "
            "model has one delay, before its command: linearise for the current by itself."
        )
    return card if ahead else card + solenoids


def _checked_inputs(names: tuple[str, ...]) -> tuple[str, ...]:
    """Inputs of a linear model, refused unless they are known and only the first is a command."""
    for name in names:
        if name not in INPUTS:
            raise InputError(f"The input is '{name}', but must be one of {', '.join(INPUTS)}.")
    if not names or len(set(names)) != len(names) or set(names[1:]) & set(COMMANDS):
        raise InputError(
            "A linear model needs one input or several different ones, of which only the first "
            f"may be a command: {', '.join(COMMANDS)}."
        )
    return names


def _checked_outputs(names: tuple[str, ...], command: str) -> tuple[str, ...]:
    """Outputs of a linear model, refused unless they are downstream of the first input."""
    upstream = {command, "current"} if command == "solenoid_force" else {command}
    possible = [name for name in OUTPUTS if name not in upstream]
    for name in names:
        if name not in possible:
            raise InputError(
                f"'{name}' is not an output of a model from {command.replace('_', ' ')}; it has "
                f"{', '.join(possible)}."
            )
    if not names or len(set(names)) != len(names):
        raise InputError("A linear model needs one output or several different ones.")
    return names
