"""Hydraulic motor under load: torque and pressure drop (Kruse 2001, eqs. 6.39-6.46)."""

from swashplate.physics.component import component


@component
def pump_flow(swash_angle: float, flow_gain: float) -> float:
    """Flow of the pump, Q = C_q α_sw. [m³/s]

    A swash plate pump's flow goes with tan α_sw; the angle itself is what the published Z10
    belongs to (erratum 18).
    """
    return flow_gain * swash_angle


@component
def load_torque(
    swash_rate: float,
    load_inertia: float,
    static_torque: float,
    motor_constant: float,
    flow_gain: float,
) -> float:
    """Torque of the load on the motor.

    Parameters
    ----------
    swash_rate : float
        α_sw'. [rad/s]
    load_inertia, static_torque : float
        C_i [kg m²] and C_g of gravity [N m], positive against positive speed.
    motor_constant, flow_gain : float
        K_mf, speed over flow [rad/m³]; C_q, pump flow over swash angle [m³/s].

    Returns
    -------
    float
        C_i Ω' + C_g with Ω' = K_mf C_q α_sw'; Kruse eqs. 6.42 and 6.45. [N m]
    """
    return load_inertia * motor_constant * flow_gain * swash_rate + static_torque


@component
def motor_pressure_drop(torque: float, motor_constant: float) -> float:
    """P_hi - P_lo = K_mf τ, from the work done by the motor; Kruse eq. 6.41. [Pa]"""
    return motor_constant * torque
