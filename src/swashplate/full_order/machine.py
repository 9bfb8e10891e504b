"""From a physical set to the tuple that the compiled code takes."""

from typing import NamedTuple

from swashplate.equations.definition import Flag
from swashplate.equations.equation import interpreted
from swashplate.full_order.physical_set import PhysicalSet
from swashplate.models.full_order import Machine, MachineConstants, machine_constants
from swashplate.parameters.parameter_set import PressureRoot


class Plate(NamedTuple):
    """A machine with what follows from its parameters, ready for compiled code."""

    p: Machine
    k: MachineConstants
    symmetric: Flag
    """True: root √((ΔP - sgn(x)P)/2)."""


def build_machine(physical: PhysicalSet, root: PressureRoot = "published") -> Plate:
    """Physical quantities with what follows from them."""
    p = Machine(**physical.numbers)
    return Plate(p, interpreted(machine_constants)(p), True if root == "symmetric" else None)
