"""The linear crane, for controllers that are designed outside the package."""

from __future__ import annotations

from math import cos, radians, sin

import numpy as np

from swashplate.crane.axes import AXES
from swashplate.crane.crane import Crane
from swashplate.crane.kinematics import Boom, boom_rate, reach_rate
from swashplate.crane.rope import GRAVITY
from swashplate.machine.linear import LinearModel

STATES = ("offset_out", "speed_out", "offset_across", "speed_across", "rope", "slew", "boom")
OUTPUTS = ("swing_out", "swing_across", "rope", "slew", "boom")


def linearize(crane: Crane, boom_deg: float = 45.0, rope_m: float = 20.0) -> LinearModel:
    """Linearise a crane about a load that hangs at rest; the angle of slew has no effect.

    Parameters
    ----------
    crane : Crane
        Its geometry is used, not its drives.
    boom_deg : float
        Elevation of the boom. [deg]
    rope_m : float
        Rope below the tip. [m]

    Returns
    -------
    LinearModel
        Inputs: speeds of the shafts, hoist, slew, luff [rad/s]. States: position of the load
        relative to the tip, outwards along the boom and across it to starboard [m], each with the
        load's speed in that direction [m/s]; changes of rope [m], slew and boom [rad]. Outputs:
        angles of the rope outwards and to starboard [rad], changes of rope [m], slew and boom
        [rad].

    Raises
    ------
    InputError
        For a boom or rope beyond the crane's limits.

    Notes
    -----
    Both axes of the swing are independent pendulums: d' = v - p', v' = -g/L d with the speed of the
    tip p', which is -∂ρ/∂θ times the speed of the luff's shaft, and the radius ρ times that of the
    slew.

    Examples
    --------
    >>> from swashplate.crane import Crane, linearize
    >>> linearize(Crane.preset("tg3637"), boom_deg=45.0, rope_m=20.0).A.shape
    (7, 7)
    """
    crane.home(0.0, boom_deg, rope_m)  # refuses a pose beyond the crane's limits
    geometry = crane.geometry
    boom = Boom(cos(radians(boom_deg)), sin(radians(boom_deg)))
    A = np.zeros((7, 7))
    B = np.zeros((7, 3))
    C = np.zeros((5, 7))
    # the two pendulums, with their offset and speed as states
    for swing, offset in ((0, 0), (1, 2)):
        A[offset, offset + 1] = 1.0
        A[offset + 1, offset] = -GRAVITY / rope_m
        C[swing, offset] = 1.0 / rope_m
    tip_radius = geometry.foot + geometry.boom * boom.cos
    B[0, 2] = reach_rate(boom, geometry)
    B[2, 1] = -tip_radius
    # rope, slew, boom
    B[4] = (-geometry.hoist, 0.0, geometry.coupling * geometry.luff)
    B[5, 1] = 1.0
    B[6, 2] = boom_rate(boom, geometry)
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
