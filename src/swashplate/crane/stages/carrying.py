"""What the drives carry of the load: the rope's torques on their shafts, a sample late."""

from __future__ import annotations

from typing import Any, NamedTuple

from swashplate.crane.axes import AXES
from swashplate.crane.kinematics import Shafts, Vector, boom_at, shaft_torques
from swashplate.crane.motion import Body
from swashplate.crane.rope import GRAVITY
from swashplate.crane.stages.seeing import Stateless, stateless
from swashplate.machine import Machine, Model, equation, late


class TorquesBefore(NamedTuple):
    """Torques before the first sample."""

    first: Shafts
    """[N m]"""


class RopeTorques(NamedTuple):
    """Torques of the rope on the shafts a sample before. [N m]"""

    torque_hoist: float
    torque_slew: float
    torque_luff: float


class LoadTorques(NamedTuple):
    """Torques that the drives take. [N m]"""

    load_torque_hoist: float
    load_torque_slew: float
    load_torque_luff: float


@equation
def torques_taken(inputs: RopeTorques) -> LoadTorques:
    """Torques of the sample before."""
    return LoadTorques(inputs.torque_hoist, inputs.torque_slew, inputs.torque_luff)


carried = Model(
    "carried",
    parameters=TorquesBefore,
    state=Stateless,
    step=stateless,
    sample=torques_taken,
    inputs=RopeTorques,
)

WIRES: dict[str, Any] = {
    f"torque_{axis}": late(f"body.torque_{axis}", f"first.{axis}") for axis in AXES
}
"""What its inputs take of the `body` that stands behind the drives."""


def carried_load(numbers: Body) -> Machine:
    """The load as it hangs straight below the tip, at rest, before the first sample."""
    g, home = numbers.geometry, numbers.home
    weight = numbers.mass * GRAVITY
    pull = Vector(0.0, 0.0, -weight)
    return Machine(
        carried, TorquesBefore(shaft_torques(pull, home.slew, boom_at(0.0, g, home), weight, g))
    )
