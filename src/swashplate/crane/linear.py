"""The linear crane about a load at rest, for controllers that are designed outside the package."""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib import import_module
from math import cos, radians, sin
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from swashplate.crane.kinematics import Boom, boom_rate, reach_rate
from swashplate.crane.rope import GRAVITY
from swashplate.errors import InputError
from swashplate.results import Result

if TYPE_CHECKING:
    from swashplate.crane.crane import Crane

Array = NDArray[np.float64]

INPUTS = ("hoist", "slew", "luff")
"""Speeds of the shafts. [rad/s]"""
STATES = ("offset_out", "speed_out", "offset_across", "speed_across", "rope", "slew", "boom")
"""Load less tip, outwards along the boom and across it to starboard [m]; the load's speed that way
[m/s]; rope [m]; slew and boom [rad]; the last three from where they are."""
OUTPUTS = ("swing_out", "swing_across", "rope", "slew", "boom")
"""Angles of the rope outwards and to starboard [rad]; the rest as the states."""


@dataclass(frozen=True, eq=False)
class LinearCrane(Result):
    """A crane about a load that hangs at rest: ẋ = A x + B u, y = C x.

    States, inputs and outputs are `STATES`, `INPUTS` and `OUTPUTS` of `swashplate.crane.linear`.
    Both axes of the swing are pendulums, apart from each other: d' = v - p', v' = -g/L d with p'
    the speed of the tip, -∂ρ/∂θ of the luff and ρ of the slew.
    """

    name: str
    A: Array = field(repr=False)
    """(7, 7)"""
    B: Array = field(repr=False)
    """(7, 3)"""
    C: Array = field(repr=False)
    """(5, 7)"""

    def to_control(self) -> Any:
        """The model as python-control's StateSpace with named signals.

        Raises
        ------
        InputError
            If python-control is not installed.
        """
        try:
            control = import_module("control")
        except ImportError:
            raise InputError(
                "python-control is not installed: pip install swashplate[control]; A, B and C need "
                "nothing more."
            ) from None
        named = {"inputs": list(INPUTS), "outputs": list(OUTPUTS), "name": self.name}
        return control.ss(self.A, self.B, self.C, np.zeros((5, 3)), states=list(STATES), **named)


def linearize(crane: Crane, boom_deg: float = 45.0, rope_m: float = 20.0) -> LinearCrane:
    """Linear crane at a boom and rope; the slew changes nothing in the boom's own axes.

    Parameters
    ----------
    crane : Crane
    boom_deg, rope_m : float
        Elevation of the boom, and rope below the tip.

    Raises
    ------
    InputError
        For a boom or rope beyond the crane's limits.
    """
    from swashplate.crane.stepper import Pose

    crane.home(Pose(0.0, radians(boom_deg), rope_m))
    g, boom = crane.geometry, Boom(cos(radians(boom_deg)), sin(radians(boom_deg)))
    A, B, C = np.zeros((7, 7)), np.zeros((7, 3)), np.zeros((5, 7))
    for i in (0, 2):
        A[i, i + 1], A[i + 1, i], C[i // 2, i] = 1.0, -GRAVITY / rope_m, 1.0 / rope_m
    B[0, 2], B[2, 1] = reach_rate(boom, g), -(g.foot + g.boom * boom.cos)
    B[4], B[5, 1], B[6, 2] = (-g.hoist, 0.0, g.coupling * g.luff), 1.0, boom_rate(boom, g)
    C[2:, 4:] = np.eye(3)
    return LinearCrane(f"{crane.name}_{boom_deg:g}_{rope_m:g}", A, B, C)
