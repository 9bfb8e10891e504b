"""What runs lack, or have too much of, to be held against a drive."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from swashplate.campaign.experiment import Experiment
from swashplate.parameters.rules import FULL_VOLTAGE


def without_motion(experiments: Iterable[Experiment]) -> tuple[str, ...]:
    """A sentence for each axis of which no run measures how it moves."""
    moving = {each.axis: False for each in experiments}
    for each in experiments:
        moving[each.axis] |= bool(each.of_kind("shaft_speed", "position", "encoder_counts"))
    return tuple(
        f"axis '{axis}': no channel measures its motion; a fit of the pump needs one of the kind "
        "shaft_speed, position or encoder_counts"
        for axis, seen in moving.items()
        if not seen
    )


def beyond_the_card(experiment: Experiment) -> tuple[str, ...]:
    """A sentence if the command goes where no card does, so that nothing can be simulated."""
    drive = experiment.input
    far = np.abs(drive.values) > FULL_VOLTAGE
    if drive.kind != "voltage" or not far.any():
        return ()
    first = int(np.argmax(far))
    return (
        f"{drive.source}: the voltage is {drive.values[first]:g} V at {drive.time[first]:g} s, but "
        f"the card takes ±{FULL_VOLTAGE:g} V; check unit, scale and offset of "
        f"[axes.{experiment.axis}.input]",
    )
