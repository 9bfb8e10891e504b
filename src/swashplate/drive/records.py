"""What drives a drive, on the march's grid: its command and measured inputs."""

from __future__ import annotations

from typing import TypedDict

from numpy.typing import ArrayLike

from swashplate.equations import Machine, is_real
from swashplate.equations.marching import Interpolation, Record, inputs_of
from swashplate.errors import InputError
from swashplate.maneuvers import Maneuver


class RunKeywords(TypedDict, total=False):
    """Inputs, and signals measured in addition to the command; see `Drive.simulate`."""

    clip: bool
    time: ArrayLike | None
    interpolation: Interpolation | None
    substeps: int | None
    load_torque: ArrayLike | None
    pump_speed: ArrayLike | None
    supply_pressure: ArrayLike | None


def drive_records(
    machine: Machine,
    command: ArrayLike | Maneuver,
    rate: float,
    *,
    clip: bool = False,
    time: ArrayLike | None = None,
    interpolation: Interpolation | None = None,
    substeps: int | None = None,
    **measured: ArrayLike | None,
) -> dict[str, Record]:
    """A drive's command and its measured inputs on the march's grid, checked.

    What was measured is a straight line between samples, whatever the command is. Pint quantities
    are turned into SI.
    """
    driver = machine.model.external[0]
    if is_real(command):
        instead = f", or a maneuver such as maneuvers.step({command:g})"
        raise InputError(
            f"The {driver} is a single number, {command:g}: give an array with a number for each "
            f"sample{instead if driver == 'voltage' else ''}."
        )
    given = {name: values for name, values in measured.items() if values is not None}
    between: dict[str, Interpolation | None] = {driver: interpolation}
    between |= dict.fromkeys(given, "linear")
    return inputs_of(
        machine,
        {driver: command, **given},
        rate,
        clip=clip,
        time=time,
        interpolation=between,
        substeps=substeps,
    )
