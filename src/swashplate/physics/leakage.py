"""Leakage of the motor under load: Z11 and Z12 from what they stand for (Kruse 2001, eq. 6.70)."""

from swashplate.physics.component import component
from swashplate.physics.motor import load_leakage
from swashplate.physics.motor_pressure import load_torque


@component
def leakage_lumps(
    motor_leakage: float, static_torque: float, load_inertia: float, Z10: float
) -> tuple[float, float]:
    """Speed lost to a static load and to an accelerating one.

    Parameters
    ----------
    motor_leakage : float
        K_mL, speed lost to leakage for a torque. [rad/(s N m)]
    static_torque : float
        C_g of gravity at the shaft, positive against positive speed: a load that hangs on the hoist
        is positive. [N m]
    load_inertia : float
        C_i of motor and load at the shaft. [kg m²]
    Z10 : float
        K_mf C_q, swash plate angle to shaft speed. [1/s]

    Returns
    -------
    Z11 : float
        K_mL C_g, positive where the load slows hoisting; it speeds lowering up. [rad/s]
    Z12 : float
        K_mL C_i Z10, on cos α dα/dt (erratum 22). [1]
    """
    return motor_leakage * static_torque, motor_leakage * load_inertia * Z10


@component
def stiff_line_torque(
    tangent: float, swash_rate: float, static_torque: float, load_inertia: float, Z10: float
) -> float:
    """Torque that the motor bears where the line is stiff.

    Parameters
    ----------
    tangent : float
        tan α_sw.
    swash_rate : float
        dα_sw/dt, zero at a stop. [rad/s]
    static_torque, load_inertia, Z10 : float
        As of `leakage_lumps`.

    Returns
    -------
    float
        C_g + C_i Z10 cos α dα/dt; Kruse eqs. 6.42 and 6.45. [N m]
    """
    acceleration = load_leakage(tangent, swash_rate, Z10)
    return load_torque(acceleration, load_inertia, static_torque, 1.0, 1.0)
