"""A drive linearised: what is asked for, checked, and its linear model."""

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
    inputs: tuple[str, ...] = (input,) if isinstance(input, str) else tuple(input)
    for name in inputs:
        if name not in INPUTS:
            raise InputError(f"The input is '{name}', but must be one of {', '.join(INPUTS)}.")
    if not inputs or len(set(inputs)) != len(inputs) or set(inputs[1:]) & set(COMMANDS):
        raise InputError(
            "A linear model needs one input or several different ones, of which only the first "
            f"may be a command: {', '.join(COMMANDS)}."
        )
    names = (outputs,) if isinstance(outputs, str) else tuple(outputs)
    before = {inputs[0], "current"} if inputs[0] == "solenoid_force" else {inputs[0]}
    possible = [name for name in OUTPUTS if name not in before]
    for name in names:
        if name not in possible:
            raise InputError(
                f"'{name}' is not an output of a model from {inputs[0].replace('_', ' ')}; it has "
                f"{', '.join(possible)}."
            )
    if not names or len(set(names)) != len(names):
        raise InputError("A linear model needs one output or several different ones.")
    if coulomb not in ("ignored", "tangent"):
        raise InputError(f"coulomb is '{coulomb}'; it is 'ignored' or 'tangent'.")
    if coulomb == "tangent" and parameters.coulomb_sign == "literal":
        raise InputError(
            "The literal sign of the card's Coulomb term has no slope; linearise with "
            "coulomb='ignored'."
        )
    point = operating_point(parameters, inputs[0], voltage, current)
    model = small_motion_model(parameters, point, inputs, names, coulomb)
    return LinearDrive(
        name=parameters.name,
        A=model.A,
        B=model.B,
        C=model.C,
        D=model.D,
        states=model.states,
        inputs=inputs,
        outputs=names,
        delay=parameters.numbers["tau"] if inputs[0] == "voltage" else 0.0,
        units={name: UNITS[name] for name in (*inputs, *names)},
        operating_point=point,
        coulomb=coulomb,
        parameters=parameters,
    )
