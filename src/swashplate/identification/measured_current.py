"""The measured current as what drives the pump."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.ammeter import signed_by_command
from swashplate.campaign.experiment import Channel, Experiment, InputSignal
from swashplate.equations.marching.record import Record
from swashplate.errors import InputError
from swashplate.identification.drives import current_record

Array = NDArray[np.float64]
SIGN_WIDTH = 0.05
"""Width that `signed_by_command` masks; the mask is not used to drive a pump. [s]"""
REST = 0.01
"""Share of the largest command below which it has no sign of its own. [1]"""


def measured_current(experiment: Experiment, scale: float = 1.0) -> Record:
    """The signed current that was measured, on the march's grid.

    Parameters
    ----------
    experiment : Experiment
        Driven by a current, or with a channel of it: signed, of both solenoids, or of one ammeter
        around both leads, which is given the command's sign.
    scale : float
        Factor on it. [1]

    Returns
    -------
    Record
        Positive towards positive speed. [A]

    Raises
    ------
    InputError
        If no current was measured.
    """
    drive = experiment.input
    if drive.kind == "current":
        signed = replace(drive, values=scale * drive.values)
    else:
        channel, values = _signed_channel(experiment)
        signed = InputSignal("current", "A", channel.time, scale * values, "linear", channel.source)
    return current_record(replace(experiment, input=signed))


def _signed_channel(experiment: Experiment) -> tuple[Channel, Array]:
    """A measured current and its values with a sign. [A]"""
    for channel in experiment.of_kind("signed_current"):
        return channel, channel.values
    both = zip(
        experiment.of_kind("current_plus"), experiment.of_kind("current_minus"), strict=False
    )
    for plus, minus in both:
        return plus, plus.values - np.interp(plus.time, minus.time, minus.values)
    for channel in experiment.of_kind("rectified_current"):
        command = experiment.input.at(channel.time)
        # noise about zero leaves readings just below it, and a command at rest without a sign
        signed = signed_by_command(
            channel.time,
            np.maximum(channel.values, 0.0),
            command,
            width=SIGN_WIDTH,
            level=REST * float(np.abs(command).max()),
        )
        return channel, signed.current
    raise InputError(
        f"{experiment.name} has no measured current to drive the pump: it needs a channel of the "
        "kind signed_current, current_plus and current_minus, or rectified_current."
    )
