"""The linear crane, for controllers that are designed outside the package."""

from __future__ import annotations

from math import cos, radians, sin

import numpy as np

from swashplate.crane.axes import AXES
from swashplate.crane.crane import Crane
from swashplate.crane.kinematics import Boom, boom_rate, reach_rate
from swashplate.crane.rope import GRAVITY
from swashplate.linear import LinearModel

STATES = ("offset_out", "speed_out", "offset_across", "speed_across", "rope", "slew", "boom")
OUTPUTS = ("swing_out", "swing_across", "rope", "slew", "boom")


def linearize(crane: Crane, boom_deg: float = 45.0, rope_m: float = 20.0) -> LinearModel:
    """Linear crane about a load that hangs at rest; the slew changes nothing in the boom's axes.

    Parameters
    ----------
    crane : Crane
        Whose geometry counts.
    boom_deg : float
        Elevation of the boom. [deg]
    rope_m : float
        Rope below the tip. [m]

    Returns
    -------
    LinearModel
        Inputs are the shafts' speeds, hoist, slew, luff [rad/s]. States are load less tip, outwards
        along the boom and across it to starboard [m], and the load's speed that way [m/s]; rope
        [m], slew and boom [rad] from where they are. Outputs are angles of the rope outwards and to
        starboard [rad], rope [m], slew and boom [rad].

    Raises
    ------
    InputError
        For a boom or rope beyond the crane's limits.

    Notes
    -----
    Both axes of the swing are pendulums, apart from each other: d' = v - p', v' = -g/L d with p'
    the speed of the tip, -∂ρ/∂θ of the luff and ρ of the slew.

    Examples
    --------
    >>> from swashplate.crane import Crane, linearize
    >>> linearize(Crane.preset("tg3637"), boom_deg=45.0, rope_m=20.0).A.shape
    (7, 7)
    """
    crane.home(0.0, boom_deg, rope_m)
    g = crane.geometry
    boom = Boom(cos(radians(boom_deg)), sin(radians(boom_deg)))
    A = np.zeros((7, 7))
    B = np.zeros((7, 3))
    C = np.zeros((5, 7))
    # the two pendulums
    for i in (0, 2):
        A[i, i + 1] = 1.0
        A[i + 1, i] = -GRAVITY / rope_m
        C[i // 2, i] = 1.0 / rope_m
    B[0, 2] = reach_rate(boom, g)
    B[2, 1] = -(g.foot + g.boom * boom.cos)
    # rope, slew, boom
    B[4] = (-g.hoist, 0.0, g.coupling * g.luff)
    B[5, 1] = 1.0
    B[6, 2] = boom_rate(boom, g)
    C[2:, 4:] = np.eye(3)
    name = f"{crane.name}_{boom_deg:g}_{rope_m:g}"
    return LinearModel(
        name=name,
        A=A,
        B=B,
        C=C,
        D=np.zeros((5, 3)),
        states=STATES,
        inputs=AXES,
        outputs=OUTPUTS,
    )
