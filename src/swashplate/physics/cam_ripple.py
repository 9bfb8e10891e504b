"""Ripple of the motor's cam ring: displacement that varies with the shaft's angle.

The source saw 5.5 cycles a turn of the drum, the larger the heavier the load (Kruse 2001, sections
1.2 and 9, figures 9.2 and 9.3).
"""

from math import sin

from swashplate.physics.component import component


@component
def ripple_depth(cam_ripple: float, cam_ripple_per_torque: float, static_torque: float) -> float:
    """Relative variation of the displacement, ε = ε0 + ε1 |C_g|.

    Parameters
    ----------
    cam_ripple : float
        ε0, without a load. [1]
    cam_ripple_per_torque : float
        ε1, its growth. [1/(N m)]
    static_torque : float
        C_g of the load at the shaft. [N m]
    """
    return cam_ripple + cam_ripple_per_torque * abs(static_torque)


@component
def rippled_angle(
    swash_angle: float, shaft_angle: float, depth: float, cam_cycles: float, cam_phase: float
) -> float:
    """Swash plate angle that would give a motor without ripple the same speed.

    Parameters
    ----------
    swash_angle : float
        α_sw. [rad]
    shaft_angle : float
        Angle θ of the shaft since the start. [rad]
    depth : float
        ε, see `ripple_depth`; below 1.
    cam_cycles : float
        Cycles n a turn of the shaft. [1]
    cam_phase : float
        Phase ψ of the ring at the start. [rad]

    Returns
    -------
    float
        α_sw / (1 + ε sin(n θ + ψ)). [rad]

    Notes
    -----
    The motor's displacement is D (1 + ε sin(n θ + ψ)). Speed times displacement is the flow, so
    that the oil of n whole cycles, and with it the mean speed of a turn, is that without ripple;
    torque goes with the displacement, and no energy is made.
    """
    return swash_angle / (1.0 + depth * sin(cam_cycles * shaft_angle + cam_phase))
