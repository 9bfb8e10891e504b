"""Spool and feedback arms in motion (Kruse 2001, eqs. 6.13-6.19).

The spool moves a lever of arm d1 by the angle β, tan β = (x - x0)/d1; the swash plate turns the
other feedback arm by α. Between both hangs the feedback spring.
"""

from math import sqrt

from swashplate.physics.component import component


@component
def feedback_moment(
    position: float, arm_sine: float, arm: float, spring_moment: float, plussing: float
) -> float:
    """Moment k_f d3² sin(α + β) with which the spring resists the swash plate's arm. [N m]"""
    u = position - plussing
    cos_arm = sqrt(1.0 - arm_sine * arm_sine)
    return spring_moment * (arm * arm_sine + u * cos_arm) / sqrt(arm * arm + u * u)


@component
def spool_acceleration(
    position: float,
    velocity: float,
    force: float,
    arm_sine: float,
    arm: float,
    mass: float,
    arm_inertia: float,
    damping: float,
    spring_moment: float,
    plussing: float,
) -> float:
    """Acceleration of the spool.

    Parameters
    ----------
    position, velocity : float
        x [m] and its rate [m/s], positive towards more speed.
    force : float
        Net force F of both solenoids. [N]
    arm_sine : float
        sin α of the feedback arm, (d4/d3) tan α_sw.
    arm, mass, arm_inertia : float
        d1 [m], spool mass m_sp [kg], inertia J_fa of its feedback arm about the pivot [kg m²].
    damping : float
        Viscous damping of the spool, which eq. 6.19 lacks. [N s/m]
    spring_moment : float
        k_f d3² of the feedback spring. [N m]
    plussing : float
        x0, the displacement at which the lever stands upright. [m]

    Returns
    -------
    float
        x''. With u = x - x0 and D = d1² + u², Kruse eq. 6.19:
        (m_sp D/d1 + J_fa d1/D) x'' = (F - b x') D/d1 - k_f d3² (d1 sin α + u cos α)/√D
        + 2 J_fa d1 u x'²/D². [m/s²]
    """
    u = position - plussing
    D = arm * arm + u * u
    inertia = mass * D / arm + arm_inertia * arm / D
    moment = (force - damping * velocity) * D / arm
    spring = feedback_moment(position, arm_sine, arm, spring_moment, plussing)
    turning = 2.0 * arm_inertia * arm * u * velocity * velocity / (D * D)
    return (moment - spring + turning) / inertia


@component
def spool_acceleration_partials(
    position: float,
    velocity: float,
    force: float,
    arm_sine: float,
    arm: float,
    mass: float,
    arm_inertia: float,
    damping: float,
    spring_moment: float,
    plussing: float,
) -> tuple[float, float, float, float, float]:
    """x'' with its derivatives by position, velocity, force, arm_sine.

    No parameters are among them: nothing fits the full-order model, and its solvers ask for states.
    """
    value = spool_acceleration(
        position,
        velocity,
        force,
        arm_sine,
        arm,
        mass,
        arm_inertia,
        damping,
        spring_moment,
        plussing,
    )
    u = position - plussing
    D = arm * arm + u * u
    R = sqrt(D)
    cos_arm = sqrt(1.0 - arm_sine * arm_sine)
    inverse = 1.0 / (mass * D / arm + arm_inertia * arm / D)
    inertia_u = 2.0 * u * (mass / arm - arm_inertia * arm / (D * D))
    spring_u = spring_moment * (cos_arm - (arm * arm_sine + u * cos_arm) * u / D) / R
    turning = 2.0 * arm_inertia * arm / (D * D)
    moment_u = (
        2.0 * u * (force - damping * velocity) / arm
        - spring_u
        + turning * velocity * velocity * (1.0 - 4.0 * u * u / D)
    )
    return (
        value,
        (moment_u - value * inertia_u) * inverse,
        (2.0 * turning * u * velocity - damping * D / arm) * inverse,
        D / arm * inverse,
        -spring_moment * (arm - u * arm_sine / cos_arm) / R * inverse,
    )


@component
def spool_energy(
    position: float,
    velocity: float,
    arm_sine: float,
    arm: float,
    mass: float,
    arm_inertia: float,
    spring_moment: float,
    plussing: float,
) -> tuple[float, float]:
    """Kinetic energy of spool and its arm, and energy of the feedback spring. [J]

    β' = d1 x'/D in T = (J_fa β'² + m_sp x'²)/2; V = k_f d3² (1 - cos(α + β)): Kruse eqs. 6.13 and
    6.14, without the arm that the swash plate moves.
    """
    u = position - plussing
    D = arm * arm + u * u
    turning = arm * velocity / D
    cosine = (arm * sqrt(1.0 - arm_sine * arm_sine) - u * arm_sine) / sqrt(D)
    kinetic = 0.5 * (arm_inertia * turning * turning + mass * velocity * velocity)
    return kinetic, spring_moment * (1.0 - cosine)
