"""Swash plate and stroking piston in motion (Kruse 2001, eqs. 6.34, 6.38, 6.48-6.51).

The piston at the arm d4 stands at x_st = d4 tan α_sw. Its lever is therefore d4 (1 + tan²α_sw), for
force as for speed: eq. 6.38 has d4 alone, which would not conserve energy (erratum 16).
"""

from math import sqrt

from swashplate.physics.component import component


@component
def piston_speed(tangent: float, swash_rate: float, arm: float) -> float:
    """Speed of the stroking piston, d4 (1 + tan²α_sw) α_sw'; Kruse eq. 6.34. [m/s]"""
    return arm * (1.0 + tangent * tangent) * swash_rate


@component
def piston_speed_partials(
    tangent: float, swash_rate: float, arm: float
) -> tuple[float, float, float]:
    """x_st' with its derivatives by tangent, swash_rate."""
    lever = arm * (1.0 + tangent * tangent)
    return lever * swash_rate, 2.0 * arm * tangent * swash_rate, lever


@component
def holding_pressure(
    tangent: float,
    motor_pressure: float,
    arm: float,
    spring_rate: float,
    piston_area: float,
    pumping_moment: float,
) -> float:
    """Stroker pressure that holds the swash plate where it is.

    Parameters
    ----------
    tangent : float
        tan α_sw.
    motor_pressure : float
        Pressure drop across the motor, P_hi - P_lo. [Pa]
    arm, spring_rate, piston_area : float
        d4 [m], return spring k_r [N/m], stroking piston A_s [m²].
    pumping_moment : float
        A_p d5 of the pumping pistons. [m³]

    Returns
    -------
    float
        (k_r d4 tan α + (P_hi - P_lo) A_p d5 cos α/(d4 (1 + tan²α)))/A_s; Kruse eq. 6.53. [Pa]
    """
    w = 1.0 + tangent * tangent
    return (
        spring_rate * arm * tangent + motor_pressure * pumping_moment / (arm * w * sqrt(w))
    ) / piston_area


@component
def swash_acceleration(
    pressure: float,
    tangent: float,
    swash_rate: float,
    motor_pressure: float,
    arm: float,
    plate_inertia: float,
    piston_mass: float,
    damping: float,
    spring_rate: float,
    piston_area: float,
    pumping_moment: float,
) -> float:
    """Angular acceleration of the swash plate.

    Parameters
    ----------
    pressure : float
        Stroker pressure P. [Pa]
    tangent, swash_rate : float
        tan α_sw and α_sw' [rad/s].
    motor_pressure : float
        Pressure drop across the motor. [Pa]
    arm, plate_inertia, piston_mass : float
        d4 [m], J_sw [kg m²], m_st [kg].
    damping : float
        b_st of the stroking piston. [N s/m]
    spring_rate, piston_area, pumping_moment : float
        As in `holding_pressure`.

    Returns
    -------
    float
        α_sw''. With w = 1 + tan²α, Kruse eq. 6.51 with the lever d4 w (erratum 16):
        (J_sw + m_st d4² w²) α'' = A_s d4 w (P - P_hold) - b_st d4² w² α'
        - 2 m_st d4² tan α w² α'². [rad/s²]
    """
    w = 1.0 + tangent * tangent
    hold = holding_pressure(tangent, motor_pressure, arm, spring_rate, piston_area, pumping_moment)
    lever = arm * w
    inertia = plate_inertia + piston_mass * lever * lever
    # as a difference of pressures, which is exactly zero where the relief valve holds the plate
    moment = piston_area * lever * (pressure - hold)
    resisting = damping * swash_rate + 2.0 * piston_mass * tangent * swash_rate * swash_rate
    return (moment - lever * lever * resisting) / inertia


@component
def swash_acceleration_partials(
    pressure: float,
    tangent: float,
    swash_rate: float,
    motor_pressure: float,
    arm: float,
    plate_inertia: float,
    piston_mass: float,
    damping: float,
    spring_rate: float,
    piston_area: float,
    pumping_moment: float,
) -> tuple[float, float, float, float, float]:
    """α_sw'' with its derivatives by pressure, tangent, swash_rate, motor_pressure."""
    value = swash_acceleration(
        pressure,
        tangent,
        swash_rate,
        motor_pressure,
        arm,
        plate_inertia,
        piston_mass,
        damping,
        spring_rate,
        piston_area,
        pumping_moment,
    )
    t = tangent
    w = 1.0 + t * t
    root = sqrt(w)
    lever = arm * w
    lever_2 = lever * lever
    inverse = 1.0 / (plate_inertia + piston_mass * lever_2)
    moment_t = (
        2.0 * t * piston_area * arm * pressure
        - spring_rate * arm * arm * (w + 2.0 * t * t)
        + motor_pressure * pumping_moment * t / (w * root)
        - 2.0 * piston_mass * swash_rate * swash_rate * (lever_2 + 4.0 * t * t * arm * lever)
        - 4.0 * damping * swash_rate * t * arm * lever
    )
    inertia_t = 4.0 * piston_mass * t * arm * lever
    return (
        value,
        piston_area * lever * inverse,
        (moment_t - value * inertia_t) * inverse,
        -lever_2 * (damping + 4.0 * piston_mass * t * swash_rate) * inverse,
        -pumping_moment / root * inverse,
    )


@component
def swash_energy(
    tangent: float,
    swash_rate: float,
    arm: float,
    plate_inertia: float,
    piston_mass: float,
    spring_rate: float,
) -> tuple[float, float]:
    """Kinetic energy of plate and piston, and energy of the return spring. [J]"""
    speed = piston_speed(tangent, swash_rate, arm)
    stretch = arm * tangent
    kinetic = 0.5 * (plate_inertia * swash_rate * swash_rate + piston_mass * speed * speed)
    return kinetic, 0.5 * spring_rate * stretch * stretch
