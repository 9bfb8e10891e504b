"""C source of a drive or a model of one's own, with its numbers, in a folder of its own."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swashplate.drive import Drive
from swashplate.equations.c_interface import interface
from swashplate.equations.c_model import Exported
from swashplate.equations.c_model import feedthrough as feedthrough_of
from swashplate.equations.c_source import literal
from swashplate.equations.fields import numbers_of
from swashplate.equations.marching.part import PartCode
from swashplate.equations.marching.record import SOURCE_RATE
from swashplate.equations.marching.run import Instance, called
from swashplate.equations.model import Model
from swashplate.errors import FileError, InputError
from swashplate.models.card import stable_step
from swashplate.models.displacement_control import steep_stops
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.simulation.instance import (
    PATHS,
    check_filter_stability,
    instance_of,
    models_of,
)
from swashplate.simulation.stepper import Sample

Array = NDArray[np.float64]
STEP = 1.0 / SOURCE_RATE


def exported_drive(drive: Drive | None = None) -> Exported:
    """The drive as it is in C; with equations of one's own if the drive has some."""
    equations = () if drive is None else drive.parameters.equations
    model = models_of(equations).drive
    columns = {path: column for column, path in PATHS.items()}
    return Exported(
        model,
        "swp",
        "A hydrostatic drive from joystick voltage to shaft speed.",
        parameters=columns,
        outputs=(*Sample._fields[1:], "motor_torque", "motor_pressure_drop"),
        bounds={"voltage": FULL_VOLTAGE},
        stable={0: stable_step},
        follows={(1, "steep"): steep_stops},
        longest=STEP,
    )


def drive_sources(drive: Drive | None = None) -> dict[str, str]:
    """Header and source of the drive, by file name: the same for every set of parameters."""
    return interface(exported_drive(drive))


def feedthrough(drive: Drive | None = None) -> dict[str, frozenset[str]]:
    """Inputs that each output follows at the same sample, by output; a delayed command is none."""
    return feedthrough_of(exported_drive(drive))


def values_of(drive: Drive, step: float = STEP) -> Array:
    """All numbers that ``swp_init`` takes, as Python computed them.

    Parameters
    ----------
    drive : Drive
        Whose.
    step : float
        Step of its grid. [s]

    Returns
    -------
    (n,) array
        Step [s], parameters, options (0 or 1) and the constants that follow from them.

    Raises
    ------
    InputError
        If the card's filter is unstable at that step, or the step is none.
    """
    if not 0.0 < step <= STEP:
        raise InputError(
            f"The step is {step:g} s, but must be above 0 and at most 1/{SOURCE_RATE:g} s."
        )
    check_filter_stability(drive.parameters, step)
    return _values(instance_of(drive.parameters, True), step)


def _values(instance: Instance, step: float) -> Array:
    options, constants = list[float](), list[float]()
    for model, part in zip(instance.model.parts, instance.parts, strict=True):
        if model.options is not None:
            options += [0.0 if each is None else 1.0 for each in part.options]
        if model.constants is not None:
            known = {"p": part.p, "options": part.options, "given": part.given, "h": step}
            constants += numbers_of(called(model.constants, known))
    return np.array([step, *instance.params, *instance.given, *options, *constants])
