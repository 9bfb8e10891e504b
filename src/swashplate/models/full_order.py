"""The machine with five states: spool, oil and swash plate in motion (Kruse 2001, chapter 6).

States are the spool's position and velocity, the stroker pressure, the swash plate's angle and its
rate; the input is the net force of both solenoids. Parameters are physical: arms, springs, masses,
areas, oil and load. The source's equations are 6.13-6.19 (spool), 6.31-6.35 (flow and oil),
6.34-6.38 and 6.48-6.53 (swash plate) and 6.39-6.46 (motor and load).

The spool moves a lever of arm d1 by the angle β, tan β = (x - x0)/d1; the swash plate turns the
other feedback arm by α. Between both hangs the feedback spring. The stroking piston at the arm d4
stands at x_st = d4 tan α_sw. Its lever is therefore d4 (1 + tan²α_sw), for force as for speed:
eq. 6.38 has d4 alone, which would not conserve energy (erratum 16).
"""

from math import pi, sqrt, tan
from typing import Annotated, NamedTuple

from swashplate.equations.definition import MINUS, Definition, Flag
from swashplate.equations.equation import equation
from swashplate.models.pump import flow_head, head_root


class Machine(NamedTuple):
    """Physical parameters of a machine, from the spool to the load."""

    spool_arm: Annotated[
        float, Definition("arm from the pivot to the spool", "m", above=0.0, stands_for="d1")
    ]
    spool_mass: Annotated[
        float, Definition("mass of the spool", "kg", above=0.0, stands_for="m_sp")
    ]
    feedback_arm_inertia: Annotated[
        float,
        Definition("inertia of the spool's feedback arm", "kg m^2", 0.0, stands_for="J_fa"),
    ]
    spool_damping: Annotated[
        float, Definition("viscous damping of the spool", "N s/m", 0.0, stands_for="b_sp")
    ]
    feedback_spring_rate: Annotated[
        float, Definition("stiffness of the feedback spring", "N/m", above=0.0, stands_for="k_f")
    ]
    feedback_spring_arm: Annotated[
        float, Definition("arm of the feedback spring", "m", above=0.0, stands_for="d3")
    ]
    control_arm: Annotated[
        float,
        Definition("arm of the ball on the stroking piston", "m", above=0.0, stands_for="d3'"),
    ]
    plussing: Annotated[float, Definition("spool displacement at rest", "m", stands_for="x0")]
    spool_stroke: Annotated[
        float, Definition("stroke of the spool, both ways", "m", above=0.0, stands_for="x_max")
    ]
    orifice_opening_plus: Annotated[
        float,
        Definition(
            "opening at which the in-line orifice limits the flow",
            "m",
            above=0.0,
            can_be_off=True,
            stands_for="x_o",
        ),
    ]
    orifice_opening_minus: Annotated[float, MINUS]
    valve_flow_gain: Annotated[
        float,
        Definition("flow gain of the valve", "m^2/(s sqrt(Pa))", above=0.0, stands_for="C_o"),
    ]
    supply_pressure: Annotated[
        float,
        Definition("supply pressure less reservoir pressure", "Pa", above=0.0, stands_for="ΔP"),
    ]
    oil_volume: Annotated[
        float,
        Definition("oil under pressure at the stroking piston", "m^3", above=0.0, stands_for="V"),
    ]
    bulk_modulus: Annotated[
        float, Definition("bulk modulus of the oil", "Pa", above=0.0, stands_for="B")
    ]
    piston_leakage: Annotated[
        float,
        Definition("leakage around the stroking piston", "m^3/(s Pa)", 0.0, stands_for="K_L"),
    ]
    piston_area: Annotated[
        float, Definition("area of the stroking piston", "m^2", above=0.0, stands_for="A_s")
    ]
    relief_pressure: Annotated[
        float,
        Definition(
            "pressure of the relief valve", "Pa", above=0.0, can_be_off=True, stands_for="P_r"
        ),
    ]
    swash_arm: Annotated[
        float,
        Definition(
            "arm of the stroking piston on the swash plate", "m", above=0.0, stands_for="d4"
        ),
    ]
    swash_inertia: Annotated[
        float, Definition("inertia of the swash plate", "kg m^2", above=0.0, stands_for="J_sw")
    ]
    piston_mass: Annotated[
        float, Definition("mass of the stroking piston", "kg", 0.0, stands_for="m_st")
    ]
    piston_damping: Annotated[
        float,
        Definition("viscous damping of the stroking piston", "N s/m", 0.0, stands_for="b_st"),
    ]
    return_spring_rate: Annotated[
        float, Definition("stiffness of the return spring", "N/m", above=0.0, stands_for="k_r")
    ]
    swash_stop_plus: Annotated[
        float,
        Definition("stop of the swash plate", "rad", above=0.0, upper=pi / 2, stands_for="α_max"),
    ]
    swash_stop_minus: Annotated[float, MINUS]
    pumping_area: Annotated[
        float, Definition("effective area of the pumping pistons", "m^2", 0.0, stands_for="A_p")
    ]
    pumping_arm: Annotated[
        float,
        Definition("arm of the pumping pistons' force on the plate", "m", 0.0, stands_for="d5"),
    ]
    motor_constant: Annotated[
        float, Definition("motor speed over flow", "1/m^3", above=0.0, stands_for="K_mf")
    ]
    pump_flow_gain: Annotated[
        float, Definition("pump flow over swash angle", "m^3/s", above=0.0, stands_for="C_q")
    ]
    motor_leakage: Annotated[
        float,
        Definition("motor speed lost over load torque", "1/(N m s)", 0.0, stands_for="K_mL"),
    ]
    load_inertia: Annotated[
        float, Definition("inertia of the load at the motor", "kg m^2", 0.0, stands_for="C_i")
    ]
    load_torque: Annotated[
        float,
        Definition("static torque of the load, against positive speed", "N m", stands_for="C_g"),
    ]


class Motion(NamedTuple):
    """The five states."""

    spool_position: float
    """x, positive towards more speed. [m]"""
    spool_velocity: float
    """[m/s]"""
    piston_pressure: float
    """Stroker pressure P. [Pa]"""
    swash_angle: float
    """α_sw. [rad]"""
    swash_rate: float
    """[rad/s]"""


class Rates(NamedTuple):
    """Rates of the three states whose rate is not itself a state, where no limit holds."""

    velocity: float
    """[m/s²]"""
    pressure: float
    """[Pa/s]"""
    swash_rate: float
    """[rad/s²]"""


class MachineConstants(NamedTuple):
    """What follows from the parameters alone."""

    rest_pressure: float
    """P0, which holds the load at rest with the plate upright. [Pa]"""
    lower: float
    upper: float
    """Pressures at which the relief valve opens. [Pa]"""
    grip: float
    """Inward acceleration that counts as none while the plate rests on a stop. [rad/s²]"""


GRIP = 1e-12
"""Pressure, over the supply pressure, that is lost in rounding where a stop holds the plate."""


# --- spool ---------------------------------------------------------------------------------------


@equation
def feedback_sine(tangent: float, p: Machine) -> float:
    """sin α of the feedback arm, (d4/d3') tan α_sw; Kruse eq. 6.20."""
    return p.swash_arm / p.control_arm * tangent


@equation
def spring_moment(p: Machine) -> float:
    """k_f d3² of the feedback spring. [N m]"""
    return p.feedback_spring_rate * (p.feedback_spring_arm * p.feedback_spring_arm)


@equation
def feedback_moment(position: float, arm_sine: float, p: Machine) -> float:
    """Moment k_f d3² sin(α + β) with which the spring resists the swash plate's arm. [N m]"""
    u = position - p.plussing
    cosine = sqrt(1.0 - arm_sine * arm_sine)
    arm = p.spool_arm
    return spring_moment(p) * (arm * arm_sine + u * cosine) / sqrt(arm * arm + u * u)


@equation
def spool_inertia(position: float, p: Machine) -> float:
    """Inertia of spool and feedback arm against the spool's lever, m_sp D/d1 + J_fa d1/D. [kg m]"""
    u = position - p.plussing
    D = p.spool_arm * p.spool_arm + u * u
    return p.spool_mass * D / p.spool_arm + p.feedback_arm_inertia * p.spool_arm / D


@equation
def spool_acceleration(
    position: float, velocity: float, force: float, arm_sine: float, p: Machine
) -> float:
    """Acceleration of the spool.

    Parameters
    ----------
    position, velocity : float
        x [m] and its rate [m/s], positive towards more speed.
    force : float
        Net force F of both solenoids. [N]
    arm_sine : float
        sin α of the feedback arm, see `feedback_sine`.
    p : Machine
        d1, m_sp, J_fa, b_sp (viscous damping, which eq. 6.19 lacks), k_f d3², x0.

    Returns
    -------
    float
        x''. With u = x - x0 and D = d1² + u², Kruse eq. 6.19:
        (m_sp D/d1 + J_fa d1/D) x'' = (F - b x') D/d1 - k_f d3² (d1 sin α + u cos α)/√D
        + 2 J_fa d1 u x'²/D². [m/s²]
    """
    u = position - p.plussing
    D = p.spool_arm * p.spool_arm + u * u
    moment = (force - p.spool_damping * velocity) * D / p.spool_arm
    spring = feedback_moment(position, arm_sine, p)
    turning = 2.0 * p.feedback_arm_inertia * p.spool_arm * u * velocity * velocity / (D * D)
    return (moment - spring + turning) / spool_inertia(position, p)


@equation
def spool_energy(
    position: float, velocity: float, arm_sine: float, p: Machine
) -> tuple[float, float]:
    """Kinetic energy of spool and its arm, and energy of the feedback spring. [J]

    β' = d1 x'/D in T = (J_fa β'² + m_sp x'²)/2; V = k_f d3² (1 - cos(α + β)): Kruse eqs. 6.13 and
    6.14, without the arm that the swash plate moves.
    """
    u = position - p.plussing
    arm = p.spool_arm
    D = arm * arm + u * u
    turning = arm * velocity / D
    cosine = (arm * sqrt(1.0 - arm_sine * arm_sine) - u * arm_sine) / sqrt(D)
    kinetic = p.feedback_arm_inertia * turning * turning + p.spool_mass * velocity * velocity
    return 0.5 * kinetic, spring_moment(p) * (1.0 - cosine)


# --- valve and oil -------------------------------------------------------------------------------


@equation
def valve_opening(position: float, p: Machine) -> float:
    """Effective opening x_eff = clip(clip(x, ±x_max), -x_o₋, +x_o₊); Kruse eqs. 6.36, 6.71. [m]"""
    upper = min(p.orifice_opening_plus, p.spool_stroke)
    return min(upper, max(-min(p.orifice_opening_minus, p.spool_stroke), position))


@equation
def valve_flow(position: float, pressure: float, p: Machine, symmetric: Flag) -> float:
    """Flow through the valve towards the stroking piston.

    Parameters
    ----------
    position : float
        x of the spool. [m]
    pressure : float
        Stroker pressure P. [Pa]
    p : Machine
        C_o, ΔP, stroke and in-line orifices.
    symmetric : None or True
        True takes the root √((ΔP - sgn(x)P)/2), None the published √((ΔP - P)/2) (erratum 13).

    Returns
    -------
    float
        q = C_o √((ΔP - σP)/2) x_eff; Kruse eq. 6.31 with the constant gain of eq. 6.37. [m³/s]
    """
    opening = valve_opening(position, p)
    head, _ = flow_head(pressure, opening, p.supply_pressure, symmetric)
    return p.valve_flow_gain * head_root(head) * opening


@equation
def oil_pressure_rate(pressure: float, flow: float, piston_speed: float, p: Machine) -> float:
    """Rate of the stroker pressure.

    Parameters
    ----------
    pressure : float
        P. [Pa]
    flow : float
        Flow through the valve. [m³/s]
    piston_speed : float
        x_st'. [m/s]
    p : Machine
        A_s, K_L around the piston, V, B.

    Returns
    -------
    float
        (q - K_L P - A_s x_st') B/V; Kruse eqs. 6.32, 6.33, 6.35. [Pa/s]
    """
    stays = flow - p.piston_leakage * pressure - p.piston_area * piston_speed
    return stays * (p.bulk_modulus / p.oil_volume)


# --- swash plate ---------------------------------------------------------------------------------


@equation
def piston_speed(tangent: float, swash_rate: float, p: Machine) -> float:
    """Speed of the stroking piston, d4 (1 + tan²α_sw) α_sw'; Kruse eq. 6.34. [m/s]"""
    return p.swash_arm * (1.0 + tangent * tangent) * swash_rate


@equation
def holding_pressure(tangent: float, motor_pressure: float, p: Machine) -> float:
    """Stroker pressure that holds the swash plate where it is.

    Parameters
    ----------
    tangent : float
        tan α_sw.
    motor_pressure : float
        Pressure drop across the motor, P_hi - P_lo. [Pa]
    p : Machine
        d4, k_r, A_s and A_p d5 of the pumping pistons.

    Returns
    -------
    float
        (k_r d4 tan α + (P_hi - P_lo) A_p d5 cos α/(d4 (1 + tan²α)))/A_s; Kruse eq. 6.53. [Pa]
    """
    w = 1.0 + tangent * tangent
    arm = p.swash_arm
    pumping = p.pumping_area * p.pumping_arm
    pushed = motor_pressure * pumping / (arm * w * sqrt(w))
    return (p.return_spring_rate * arm * tangent + pushed) / p.piston_area


@equation
def swash_acceleration(
    pressure: float, tangent: float, swash_rate: float, motor_pressure: float, p: Machine
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
    p : Machine
        d4, J_sw, m_st, b_st, and as in `holding_pressure`.

    Returns
    -------
    float
        α_sw''. With w = 1 + tan²α, Kruse eq. 6.51 with the lever d4 w (erratum 16):
        (J_sw + m_st d4² w²) α'' = A_s d4 w (P - P_hold) - b_st d4² w² α'
        - 2 m_st d4² tan α w² α'². [rad/s²]
    """
    lever = p.swash_arm * (1.0 + tangent * tangent)
    inertia = p.swash_inertia + p.piston_mass * lever * lever
    # as a difference of pressures, which is exactly zero where the relief valve holds the plate
    surplus = pressure - holding_pressure(tangent, motor_pressure, p)
    damping = p.piston_damping * swash_rate
    resisting = damping + 2.0 * p.piston_mass * tangent * swash_rate * swash_rate
    return (p.piston_area * lever * surplus - lever * lever * resisting) / inertia


@equation
def swash_energy(tangent: float, swash_rate: float, p: Machine) -> tuple[float, float]:
    """Kinetic energy of plate and piston, and energy of the return spring. [J]"""
    speed = piston_speed(tangent, swash_rate, p)
    stretch = p.swash_arm * tangent
    kinetic = p.swash_inertia * swash_rate * swash_rate + p.piston_mass * speed * speed
    return 0.5 * kinetic, 0.5 * p.return_spring_rate * stretch * stretch


# --- motor and load ------------------------------------------------------------------------------


@equation
def pump_flow(swash_angle: float, p: Machine) -> float:
    """Flow of the pump, Q = C_q α_sw. [m³/s]

    A swash plate pump's flow goes with tan α_sw; the angle itself is what the published Z10
    belongs to (erratum 18).
    """
    return p.pump_flow_gain * swash_angle


@equation
def motor_torque(swash_rate: float, p: Machine) -> float:
    """Torque of the load on the motor, C_i Ω' + C_g with Ω' = K_mf C_q α_sw'. [N m]

    Kruse eqs. 6.42 and 6.45; C_g of gravity is positive against positive speed.
    """
    return p.load_inertia * p.motor_constant * p.pump_flow_gain * swash_rate + p.load_torque


@equation
def motor_drop(swash_rate: float, p: Machine) -> float:
    """P_hi - P_lo = K_mf τ, from the work done by the motor; Kruse eq. 6.41. [Pa]"""
    return p.motor_constant * motor_torque(swash_rate, p)


@equation
def machine_speed(angle: float, swash_rate: float, p: Machine) -> float:
    """Shaft speed K_mf Q less K_mL τ, what leaks at the motor under its load. [rad/s]"""
    return p.motor_constant * pump_flow(angle, p) - p.motor_leakage * motor_torque(swash_rate, p)


# --- the machine ---------------------------------------------------------------------------------


@equation
def machine_constants(p: Machine) -> MachineConstants:
    """Limits of the stroker pressure.

    The relief valve keeps it between those that hold the swash plate and its static load at the
    stops (eq. 6.53), and within P_r of the pressure at rest, P0 = K_mf C_g A_p d5/(A_s d4) (eq.
    6.54): nothing winds up at a stop.
    """
    load = p.motor_constant * p.load_torque
    rest = load * (p.pumping_area * p.pumping_arm) / (p.piston_area * p.swash_arm)
    lower = holding_pressure(tan(-p.swash_stop_minus), load, p)
    upper = holding_pressure(tan(p.swash_stop_plus), load, p)
    return MachineConstants(
        rest,
        max(lower, rest - p.relief_pressure),
        min(upper, rest + p.relief_pressure),
        GRIP * p.piston_area * p.swash_arm * p.supply_pressure / p.swash_inertia,
    )


@equation
def free_rates(state: Motion, force: float, p: Machine, symmetric: Flag) -> Rates:
    """Rates where no limit holds; those of position and angle are velocity and swash rate.

    Parameters
    ----------
    state : Motion
        The five states.
    force : float
        Net force of both solenoids. [N]
    p : Machine
        The machine.
    symmetric : None or True
        As in `valve_flow`.
    """
    tangent = tan(state.swash_angle)
    sine = feedback_sine(tangent, p)
    pressure, rate = state.piston_pressure, state.swash_rate
    flow = valve_flow(state.spool_position, pressure, p, symmetric)
    speed = piston_speed(tangent, rate, p)
    return Rates(
        spool_acceleration(state.spool_position, state.spool_velocity, force, sine, p),
        oil_pressure_rate(pressure, flow, speed, p),
        swash_acceleration(pressure, tangent, rate, motor_drop(rate, p), p),
    )


class Powers(NamedTuple):
    """What passes through the mechanisms. [W], volumes in [m³/s]"""

    solenoid_work: float
    """Done on the spool's mechanism by the solenoids."""
    spool_damping_loss: float
    feedback_work: float
    """Done on it by the swash plate's feedback arm."""
    piston_work: float
    """Done on the plate by the stroker pressure."""
    piston_damping_loss: float
    pumping_work: float
    """Done by the plate against the pumping pistons."""
    motor_work: float
    """Hydraulic power that the pump sends to the motor, (P_hi - P_lo) Q."""
    valve_volume: float
    leakage_volume: float


@equation
def machine_powers(state: Motion, force: float, p: Machine, symmetric: Flag) -> Powers:
    """Powers that pass through the mechanisms, and flows through valve and piston's leak."""
    tangent = tan(state.swash_angle)
    stretch = 1.0 + tangent * tangent
    sine = feedback_sine(tangent, p)
    velocity, rate, pressure = state.spool_velocity, state.swash_rate, state.piston_pressure
    arm_rate = p.swash_arm / p.control_arm * stretch * rate / sqrt(1.0 - sine * sine)
    speed = piston_speed(tangent, rate, p)
    drop = motor_drop(rate, p)
    return Powers(
        force * velocity,
        p.spool_damping * velocity * velocity,
        feedback_moment(state.spool_position, sine, p) * arm_rate,
        pressure * p.piston_area * speed,
        p.piston_damping * speed * speed,
        drop * (p.pumping_area * p.pumping_arm) / sqrt(stretch) * rate,
        drop * pump_flow(state.swash_angle, p),
        valve_flow(state.spool_position, pressure, p, symmetric),
        p.piston_leakage * pressure,
    )


class Energies(NamedTuple):
    """What is stored. [J]"""

    spool: float
    """Spool, its arm and the feedback spring."""
    swash: float
    """Plate, piston and return spring."""
    load: float
    """The moving load."""


@equation
def machine_energies(state: Motion, p: Machine) -> Energies:
    """Energies of spool's mechanism, of plate, piston and spring, and of the moving load."""
    tangent = tan(state.swash_angle)
    sine = feedback_sine(tangent, p)
    moving, sprung = spool_energy(state.spool_position, state.spool_velocity, sine, p)
    turning, bent = swash_energy(tangent, state.swash_rate, p)
    speed = p.motor_constant * pump_flow(state.swash_angle, p)
    return Energies(moving + sprung, turning + bent, 0.5 * p.load_inertia * speed * speed)
