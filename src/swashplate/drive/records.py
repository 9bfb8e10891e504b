"""What drives a drive, on the march's grid: its command and measured inputs."""

from __future__ import annotations

from typing import TypedDict, Unpack

from numpy.typing import ArrayLike

from swashplate.errors import InputError
from swashplate.machine import Machine
from swashplate.machine.fields import is_real
from swashplate.machine.marching import Interpolation, Record, Sampling, inputs_of
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
    **keywords: Unpack[RunKeywords],
) -> dict[str, Record]:
    """A drive's command and its measured inputs on the march's grid, checked."""
    inputs, sampling = drive_inputs(machine, command, **keywords)
    return inputs_of(machine, inputs, rate, **sampling)


def drive_inputs(
    machine: Machine,
    command: ArrayLike | Maneuver,
    *,
    clip: bool = False,
    time: ArrayLike | None = None,
    interpolation: Interpolation | None = None,
    substeps: int | None = None,
    **measured: ArrayLike | None,
) -> tuple[dict[str, ArrayLike | Maneuver], Sampling]:
    """A drive's command and its measured inputs by name, and what they are between samples.

    What was measured is a straight line between samples, whatever the command is.
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
    sampling: Sampling = {
        "clip": clip,
        "time": time,
        "interpolation": between,
        "substeps": substeps,
    }
    return {driver: command, **given}, sampling
