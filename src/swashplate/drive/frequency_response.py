"""Frequency responses of a drive to sines of a size, and their table at one frequency."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import ArrayLike

from swashplate.drive.instance import drive_instance, without_ripple
from swashplate.drive.signals import UNITS
from swashplate.drive.small_motion import OUTPUTS
from swashplate.errors import InputError
from swashplate.machine.linear import (
    FrequencyResponse,
    sweep,
)
from swashplate.machine.marching import FASTEST, SOURCE_RATE, check_rate
from swashplate.models.displacement_control import Pump
from swashplate.parameters import ParameterSet
from swashplate.tables import Column, Table

SWEPT_OUTPUTS = OUTPUTS[:7]  # Without the motor's.


def sweep_drive(
    parameters: ParameterSet,
    frequencies: ArrayLike,
    amplitudes: ArrayLike,
    bias: float,
    input: str,
    output: str,
    rate: float,
    tolerance: float,
) -> FrequencyResponse:
    """Describing function of a drive; see `Drive.frequency_response`."""
    check_rate(rate)
    if not SOURCE_RATE <= rate <= FASTEST:
        raise InputError(
            f"The rate is {rate:g} Hz, but must be between {SOURCE_RATE:g} and {FASTEST:g} Hz."
        )
    if input not in ("voltage", "current"):
        raise InputError(f"The input is '{input}'; it is 'voltage' or 'current'.")
    if output not in SWEPT_OUTPUTS or output == input:
        raise InputError(
            f"'{output}' is not an output of a sweep of the {input}; there are "
            f"{', '.join(name for name in SWEPT_OUTPUTS if name != input)}."
        )
    instance = without_ripple(drive_instance(parameters, by_voltage=input == "voltage"))
    return sweep(
        instance,
        frequencies,
        amplitudes,
        rate,
        input=input,
        output=output,
        bias=bias,
        tolerance=tolerance,
        size=_signal_size(instance.parts[1].p, output),
        units={name: UNITS[name] for name in (input, output)},
    )


def _signal_size(pump: Pump, output: str) -> float:
    """Natural size of a signal, in its SI unit: changes far smaller than it are rounding."""
    sizes = {
        "shaft_speed": pump.Z10,
        "stroker_pressure": 1.0 / pump.Z1,
        "spool_position": pump.Z5,
        "orifice_opening": pump.Z5,
        "solenoid_force": sqrt(pump.Z4) / pump.Z5,
    }
    return sizes.get(output, 1.0)


def response_table(response: FrequencyResponse, frequency: float) -> Table:
    """Gain, phase, lag and distortion of a drive by the amplitude of the sine.

    `response` is from voltage to the shaft's speed; at one of its frequencies [Hz]: another is
    refused in an `InputError`, nothing is interpolated.
    """
    index = int(np.argmin(np.abs(response.frequencies - frequency)))
    nearest = float(response.frequencies[index])
    if not abs(nearest - frequency) <= 1e-9 * nearest:
        raise InputError(
            f"The response was not computed at {frequency:g} Hz; the nearest frequency is "
            f"{nearest:.6g} Hz."
        )
    columns = (
        Column("amplitude", "g", "V"),
        Column("gain", ".3f", "rad/s/V", "none"),
        Column("phase", "z.1f", "deg"),
        Column("lag", "z.1f", "ms"),
        Column("distortion %", ".1f"),
        Column("mean speed", "z.2f", "rad/s"),
    )
    table = Table("", columns)
    # within ±180°: a phase at one frequency is not followed from lower ones
    phases = np.angle(response.ratio[:, index])
    for k, amplitude in enumerate(map(float, response.amplitudes)):
        gain = phase = lag = distortion = None
        if response.has_motion[k, index]:
            gain = float(response.gain[k, index])
            phase = float(np.degrees(phases[k]))
            lag = -1e3 * float(phases[k]) / (2.0 * np.pi * frequency)
            distortion = 100.0 * float(response.distortion[k, index])
        table.add(amplitude, gain, phase, lag, distortion, float(response.mean[k, index]))
    return table
