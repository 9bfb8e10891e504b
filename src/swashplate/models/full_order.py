"""The machine with five states: spool, oil and swash plate in motion (Kruse 2001, chapter 6).

States are the spool's position and velocity, the stroker pressure, the swash plate's angle and its
rate; the input is the solenoids' current. Parameters are physical: arms, springs, masses, areas,
oil and load. The source's equations are 6.13-6.19 (spool), 6.31-6.35 (flow and oil), 6.34-6.38 and
6.48-6.53 (swash plate) and 6.39-6.46 (motor and load).

The spool moves a lever of arm d1 by the angle β, tan β = (x - x0)/d1; the swash plate turns the
other feedback arm by α. Between both hangs the feedback spring. The stroking piston at the arm d4
stands at x_st = d4 tan α_sw. Its lever is therefore d4 (1 + tan²α_sw), for force as for speed:
eq. 6.38 has d4 alone, which would not conserve energy (erratum 16).

Between two samples the machine takes sub-steps, as many as a run is given, of the Störmer-Verlet
scheme (leapfrog): half a step of what has a velocity, a step of the velocities with forces from the
middle, and the other half. Damping is trapezoidal and the pressure's own flow follows the midpoint
rule. It is of second order and stable while the fastest natural frequency times the sub-step is
below 2. Limits are projections: what is beyond a stop is put back on it and stops there.
"""

from math import asin, atan, pi, sin, sqrt, tan
from typing import Annotated, NamedTuple

from swashplate.equations.definition import MINUS, OFF, Definition, Flag
from swashplate.equations.equation import equation
from swashplate.equations.library import clipped
from swashplate.equations.model import Model, join
from swashplate.equations.primitives import repeated, root
from swashplate.models.drive import card, current_sum, signed_current, source
from swashplate.models.pump import Solenoids, flow_head, head_root, solenoid_force

ATMOSPHERE = 101325.0
"""Pressure in the reservoir. [Pa]"""


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
    air_fraction: Annotated[
        float,
        Definition(
            "free air in the oil, by volume at atmospheric pressure",
            "1",
            0.0,
            upper=1.0,
            default=0.0,
            switch=True,
            least=1e-9,
            stands_for="χ",
        ),
    ] = 0.0


class Plant(NamedTuple):
    """Parameters of everything behind the card."""

    machine: Machine
    solenoids: Solenoids


class PlantOptions(NamedTuple):
    """Forms of the machine."""

    symmetric: Flag = OFF
    """Root √((ΔP - sgn(x)P)/2) in place of the published √((ΔP - P)/2) (erratum 13)."""
    air: Flag = OFF
    """The oil has free air in it, see `mixture_modulus`."""
    held: Flag = OFF
    """The current keeps its value between samples, in place of a straight line."""


class Substeps(NamedTuple):
    """How a run is integrated: the same for all runs that are compared."""

    substeps: float
    """Sub-steps between two samples."""


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


class PlantState(NamedTuple):
    """What the machine remembers from sample to sample."""

    motion: Motion
    """One sample earlier."""
    current: float
    """One sample earlier. [A]"""
    begun: float
    """0 at the first sample, 1 from the second on."""


class PlantInputs(NamedTuple):
    """What drives the machine at a sample."""

    current: float
    """Signed current, that of the positive channel less that of the negative one. [A]"""


class PlantConstants(NamedTuple):
    """What follows from the parameters alone."""

    rest_pressure: float
    """P0, which holds the load at rest with the plate upright. [Pa]"""
    lower: float
    upper: float
    """Pressures at which the relief valve opens. [Pa]"""
    reserve: float
    """2 less the fastest rate times a sub-step: above 0 where the scheme is stable. [1]"""


class PlantSignals(NamedTuple):
    """What is known of the machine at a sample."""

    solenoid_force: float
    """Net force of both solenoids on the spool. [N]"""
    spool_position: float
    """Displacement of the spool. [m]"""
    spool_velocity: float
    """[m/s]"""
    orifice_opening: float
    """Effective opening, what the orifices leave of the spool's displacement. [m]"""
    valve_flow: float
    """Flow through the valve towards the stroking piston. [m³/s]"""
    piston_pressure: float
    """Stroker pressure P. [Pa]"""
    stroker_pressure: float
    """Stroking pressure δP = P - P0 about the one that holds the load at rest. [Pa]"""
    swash_angle: float
    """[rad]"""
    swash_rate: float
    """[rad/s]"""
    shaft_speed: float
    """Speed of the shaft, of the turret for slew. [rad/s]"""
    motor_pressure_drop: float
    """P_hi - P_lo across the motor, under load inertia and gravity. [Pa]"""
    pump_flow: float
    """Flow of the pump to the motor. [m³/s]"""


class Rates(NamedTuple):
    """Rates of the three states whose rate is not itself a state, where no limit holds."""

    velocity: float
    """[m/s²]"""
    pressure: float
    """[Pa/s]"""
    swash_rate: float
    """[rad/s²]"""


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
def spool_moment(position: float, force: float, arm_sine: float, p: Machine) -> float:
    """Moment of solenoids and feedback spring on the spool's lever; it falls with x. [N m]"""
    u = position - p.plussing
    D = p.spool_arm * p.spool_arm + u * u
    return force * D / p.spool_arm - feedback_moment(position, arm_sine, p)


@equation
def spool_resistance(position: float, velocity: float, p: Machine) -> float:
    """Moment that resists the spool's motion, by its velocity, b_sp D/d1 - 2 J_fa d1 u x'/D²."""
    u = position - p.plussing
    D = p.spool_arm * p.spool_arm + u * u
    turning = 2.0 * p.feedback_arm_inertia * p.spool_arm * u * velocity / (D * D)
    return p.spool_damping * D / p.spool_arm - turning


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
    moment = spool_moment(position, force, arm_sine, p)
    resisting = spool_resistance(position, velocity, p) * velocity
    return (moment - resisting) / spool_inertia(position, p)


# --- valve and oil -------------------------------------------------------------------------------


@equation
def valve_opening(position: float, p: Machine) -> float:
    """Effective opening x_eff = clip(clip(x, ±x_max), -x_o₋, +x_o₊); Kruse eqs. 6.36, 6.71. [m]"""
    upper = min(p.orifice_opening_plus, p.spool_stroke)
    return clipped(position, -min(p.orifice_opening_minus, p.spool_stroke), upper)


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
def mixture_modulus(pressure: float, p: Machine) -> float:
    """Bulk modulus of oil with free air in it.

    Parameters
    ----------
    pressure : float
        Absolute. [Pa]
    p : Machine
        B of the oil alone, χ the air's volume over the oil's at atmospheric pressure p0.

    Returns
    -------
    float
        B (1 + χ p0/p)/(1 + χ p0 B/p²), air compressed at a constant temperature and none of it
        dissolved; Gholizadeh, Burton and Schoenau (2011), Fluid bulk modulus: a literature survey,
        International Journal of Fluid Power 12(3), 5-15. [Pa]
    """
    air = p.air_fraction * ATMOSPHERE / pressure
    return p.bulk_modulus * (1.0 + air) / (1.0 + air * p.bulk_modulus / pressure)


@equation
def oil_modulus(pressure: float, p: Machine, air: Flag) -> float:
    """Bulk modulus at a stroker pressure P: with air the mean of both ends of the cylinder.

    Both orifices of the valve drop the same, so that the ends are at p0 + (ΔP ± P)/2 (eqs. 6.26 to
    6.28). [Pa]
    """
    if air is None:
        return p.bulk_modulus
    ahead = max(0.5 * (p.supply_pressure + pressure), 0.0) + ATMOSPHERE
    behind = max(0.5 * (p.supply_pressure - pressure), 0.0) + ATMOSPHERE
    return 0.5 * (mixture_modulus(ahead, p) + mixture_modulus(behind, p))


@equation
def oil_pressure_rate(
    pressure: float, flow: float, piston_speed: float, p: Machine, air: Flag
) -> float:
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
        A_s, K_L around the piston, V, B, χ.
    air : None or True
        As in `oil_modulus`.

    Returns
    -------
    float
        (q - K_L P - A_s x_st') B/V; Kruse eqs. 6.32, 6.33, 6.35. [Pa/s]
    """
    stays = flow - p.piston_leakage * pressure - p.piston_area * piston_speed
    return stays * (oil_modulus(pressure, p, air) / p.oil_volume)


# --- swash plate ---------------------------------------------------------------------------------


@equation
def plate_lever(tangent: float, p: Machine) -> float:
    """Lever d4 (1 + tan²α_sw) of the stroking piston, for force as for speed. [m]"""
    return p.swash_arm * (1.0 + tangent * tangent)


@equation
def piston_speed(tangent: float, swash_rate: float, p: Machine) -> float:
    """Speed of the stroking piston, d4 (1 + tan²α_sw) α_sw'; Kruse eq. 6.34. [m/s]"""
    return plate_lever(tangent, p) * swash_rate


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
def plate_inertia(tangent: float, p: Machine) -> float:
    """Inertia J_sw + m_st d4² (1 + tan²α)² of plate and piston. [kg m²]"""
    lever = plate_lever(tangent, p)
    return p.swash_inertia + p.piston_mass * lever * lever


@equation
def plate_moment(pressure: float, tangent: float, motor_pressure: float, p: Machine) -> float:
    """Moment of stroking piston, return spring and pumping pistons on the plate. [N m]"""
    # as a difference of pressures, which is exactly zero where the relief valve holds the plate
    surplus = pressure - holding_pressure(tangent, motor_pressure, p)
    return p.piston_area * plate_lever(tangent, p) * surplus


@equation
def plate_resistance(tangent: float, swash_rate: float, p: Machine) -> float:
    """Moment that resists the plate's motion, by its rate. [N m s]"""
    lever = plate_lever(tangent, p)
    return lever * lever * (p.piston_damping + 2.0 * p.piston_mass * tangent * swash_rate)


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
    moment = plate_moment(pressure, tangent, motor_pressure, p)
    resisting = plate_resistance(tangent, swash_rate, p) * swash_rate
    return (moment - resisting) / plate_inertia(tangent, p)


# --- motor and load ------------------------------------------------------------------------------


@equation
def pump_flow(swash_angle: float, p: Machine) -> float:
    """Flow of the pump, Q = C_q α_sw. [m³/s]

    A swash plate pump's flow goes with tan α_sw; the angle itself is what the published Z10
    belongs to (erratum 18).
    """
    return p.pump_flow_gain * swash_angle


@equation
def load_inertance(p: Machine) -> float:
    """Torque of the load's inertia for a swash rate, C_i K_mf C_q; Kruse eq. 6.42. [N m s]"""
    return p.load_inertia * p.motor_constant * p.pump_flow_gain


@equation
def motor_torque(swash_rate: float, p: Machine) -> float:
    """Torque of the load on the motor, C_i Ω' + C_g with Ω' = K_mf C_q α_sw'. [N m]

    Kruse eqs. 6.42 and 6.45; C_g of gravity is positive against positive speed.
    """
    return load_inertance(p) * swash_rate + p.load_torque


@equation
def motor_drop(swash_rate: float, p: Machine) -> float:
    """P_hi - P_lo = K_mf τ, from the work done by the motor; Kruse eq. 6.41. [Pa]"""
    return p.motor_constant * motor_torque(swash_rate, p)


@equation
def load_resistance(tangent: float, p: Machine) -> float:
    """Moment with which the load's inertia resists the plate, by its rate. [N m s]

    It comes through the pressure drop across the motor and the pumping pistons.
    """
    pumping = p.pumping_area * p.pumping_arm
    return p.motor_constant * load_inertance(p) * pumping / sqrt(1.0 + tangent * tangent)


@equation
def machine_speed(angle: float, swash_rate: float, p: Machine) -> float:
    """Shaft speed K_mf Q less K_mL τ, what leaks at the motor under its load. [rad/s]"""
    return p.motor_constant * pump_flow(angle, p) - p.motor_leakage * motor_torque(swash_rate, p)


# --- limits and equilibria -----------------------------------------------------------------------


@equation
def static_pressure(p: Machine) -> float:
    """P0 = K_mf C_g A_p d5/(A_s d4), which holds the load with the plate upright; eq. 6.54. [Pa]"""
    load = p.motor_constant * p.load_torque
    return load * (p.pumping_area * p.pumping_arm) / (p.piston_area * p.swash_arm)


@equation
def relief_pressures(p: Machine) -> tuple[float, float]:
    """Lowest and highest stroker pressure that the relief valve allows. [Pa]

    It keeps the pressure between those that hold the swash plate and its static load at the stops
    (eq. 6.53), and within P_r of the pressure at rest: nothing winds up at a stop.
    """
    load, rest = p.motor_constant * p.load_torque, static_pressure(p)
    lower = holding_pressure(tan(-p.swash_stop_minus), load, p)
    upper = holding_pressure(tan(p.swash_stop_plus), load, p)
    return max(lower, rest - p.relief_pressure), min(upper, rest + p.relief_pressure)


@equation
def fastest_rate(p: Machine) -> float:
    """Fastest of spool, plate on its spring and trapped oil, and leakage. [rad/s]

    Damping does not count: the scheme is stable with any.
    """
    spool = spring_moment(p) / (p.spool_mass * p.spool_arm * p.spool_arm + p.feedback_arm_inertia)
    steepest = tan(max(p.swash_stop_plus, p.swash_stop_minus))
    lever = plate_lever(steepest, p)
    oil = p.bulk_modulus / p.oil_volume
    spring = p.return_spring_rate + p.piston_area * p.piston_area * oil
    plate = lever * lever * spring / plate_inertia(steepest, p)
    return max(sqrt(max(spool, plate)), p.piston_leakage * oil)


@equation
def balanced_spool(force: float, arm_sine: float, p: Machine) -> float:
    """Spool position at which solenoids and feedback spring balance, within the stroke. [m]

    Where the solenoids overpower the spring the spool is at its stop.
    """
    return root(spool_moment, -p.spool_stroke, p.spool_stroke, force, arm_sine, p)


@equation
def balanced_tangent(position: float, force: float, p: Machine) -> float:
    """tan α_sw, within the stops, at which solenoids and feedback spring hold the spool.

    d1 F (1 + tan²β) = k_f d3² sin(α + β), the printed eq. 6.19 at rest.
    """
    lever = (position - p.plussing) / p.spool_arm
    sine = p.spool_arm * force * (1.0 + lever * lever) / spring_moment(p)
    arm = asin(min(max(sine, -1.0), 1.0)) - atan(lever)
    tangent = sin(min(max(arm, -0.5 * pi), 0.5 * pi)) * p.control_arm / p.swash_arm
    return min(max(tangent, -tan(p.swash_stop_minus)), tan(p.swash_stop_plus))


@equation
def surplus_flow(position: float, force: float, p: Machine, symmetric: Flag) -> float:
    """Flow through the valve less what leaks, with spool and plate in balance. [m³/s]"""
    tangent = balanced_tangent(position, force, p)
    pressure = holding_pressure(tangent, p.motor_constant * p.load_torque, p)
    return valve_flow(position, pressure, p, symmetric) - p.piston_leakage * pressure


# --- in motion -----------------------------------------------------------------------------------


@equation
def free_rates(state: Motion, force: float, p: Machine, options: PlantOptions) -> Rates:
    """Rates where no limit holds; those of position and angle are velocity and swash rate.

    Parameters
    ----------
    state : Motion
        The five states.
    force : float
        Net force of both solenoids. [N]
    p : Machine
        The machine.
    options : PlantOptions
        Its form.
    """
    tangent = tan(state.swash_angle)
    sine = feedback_sine(tangent, p)
    pressure, rate = state.piston_pressure, state.swash_rate
    flow = valve_flow(state.spool_position, pressure, p, options.symmetric)
    speed = piston_speed(tangent, rate, p)
    return Rates(
        spool_acceleration(state.spool_position, state.spool_velocity, force, sine, p),
        oil_pressure_rate(pressure, flow, speed, p, options.air),
        swash_acceleration(pressure, tangent, rate, motor_drop(rate, p), p),
    )


@equation
def damped(
    velocity: float, moment: float, resistance: float, inertia: float, h: float
) -> float:
    """Velocity after a step under a constant moment, resistance by the trapezoidal rule."""
    lost = 0.5 * h * resistance
    return ((inertia - lost) * velocity + h * moment) / (inertia + lost)


@equation
def stopped(velocity: float, position: float, lower: float, upper: float) -> float:
    """A velocity, zero where it points beyond a stop."""
    outward = (position >= upper and velocity > 0.0) or (position <= lower and velocity < 0.0)
    return 0.0 if outward else velocity


class Span(NamedTuple):
    """What the time between two samples is divided into."""

    step: float
    """A sub-step. [s]"""
    current: float
    """At its beginning. [A]"""
    rise: float
    """Of the current in a sub-step. [A]"""


@equation
def substep(
    state: Motion,
    number: float,
    span: Span,
    p: Plant,
    k: PlantConstants,
    options: PlantOptions,
) -> Motion:
    """The five states a sub-step later, see the module's text.

    Parameters
    ----------
    state : Motion
        Before.
    number : float
        Of the sub-step, from 0.
    span : Span
        Length and current of the sub-steps.
    p, k, options :
        The machine.
    """
    m, h, before = p.machine, span.step, state.piston_pressure
    half, stroke = 0.5 * h, m.spool_stroke
    velocity = stopped(state.spool_velocity, state.spool_position, -stroke, stroke)
    rate = stopped(state.swash_rate, state.swash_angle, -m.swash_stop_minus, m.swash_stop_plus)
    force = solenoid_force(span.current + (number + 0.5) * span.rise, p.solenoids)
    position = state.spool_position + half * velocity
    angle = clipped(state.swash_angle + half * rate, -m.swash_stop_minus, m.swash_stop_plus)
    tangent = tan(angle)
    flow = valve_flow(position, before, m, options.symmetric)
    filling = oil_pressure_rate(before, flow, piston_speed(tangent, rate, m), m, options.air)
    pressure = clipped(before + half * filling, k.lower, k.upper)

    moment = spool_moment(position, force, feedback_sine(tangent, m), m)
    resistance = spool_resistance(position, velocity, m)
    faster = damped(velocity, moment, resistance, spool_inertia(position, m), h)
    moment = plate_moment(pressure, tangent, m.motor_constant * m.load_torque, m)
    resistance = plate_resistance(tangent, rate, m) + load_resistance(tangent, m)
    turning = damped(rate, moment, resistance, plate_inertia(tangent, m), h)

    flow = valve_flow(position, pressure, m, options.symmetric)
    speed = piston_speed(tangent, 0.5 * (rate + turning), m)
    filling = oil_pressure_rate(pressure, flow, speed, m, options.air)
    return Motion(
        clipped(position + half * faster, -stroke, stroke),
        faster,
        clipped(before + h * filling, k.lower, k.upper),
        clipped(angle + half * turning, -m.swash_stop_minus, m.swash_stop_plus),
        turning,
    )


# --- the model -----------------------------------------------------------------------------------


@equation
def plant_constants(p: Plant, h: float, given: Substeps) -> PlantConstants:
    """Constants of the march."""
    lower, upper = relief_pressures(p.machine)
    fastest = fastest_rate(p.machine) * h / given.substeps
    return PlantConstants(static_pressure(p.machine), lower, upper, 2.0 - fastest)


@equation
def plant_signals(
    motion: Motion, current: float, p: Plant, k: PlantConstants, options: PlantOptions
) -> PlantSignals:
    """What follows from the five states and the current."""
    m, stroke = p.machine, p.machine.spool_stroke
    velocity = stopped(motion.spool_velocity, motion.spool_position, -stroke, stroke)
    rate = stopped(motion.swash_rate, motion.swash_angle, -m.swash_stop_minus, m.swash_stop_plus)
    return PlantSignals(
        solenoid_force=solenoid_force(current, p.solenoids),
        spool_position=motion.spool_position,
        spool_velocity=velocity,
        orifice_opening=valve_opening(motion.spool_position, m),
        valve_flow=valve_flow(
            motion.spool_position, motion.piston_pressure, m, options.symmetric
        ),
        piston_pressure=motion.piston_pressure,
        stroker_pressure=motion.piston_pressure - k.rest_pressure,
        swash_angle=motion.swash_angle,
        swash_rate=rate,
        shaft_speed=machine_speed(motion.swash_angle, rate, m),
        motor_pressure_drop=motor_drop(rate, m),
        pump_flow=pump_flow(motion.swash_angle, m),
    )


@equation
def plant_sample(
    state: PlantState,
    inputs: PlantInputs,
    p: Plant,
    k: PlantConstants,
    h: float,
    options: PlantOptions,
    given: Substeps,
) -> PlantSignals:
    """Everything at a sample, the sub-steps from the one before done.

    The current of this sample must be known for the straight line to it, so what is remembered is
    one sample old; the first sample has no time before it.
    """
    count = given.substeps
    rise = 0.0
    if options.held is None:
        rise = (inputs.current - state.current) / count
    span = Span(state.begun * h / count, state.current, rise)
    motion = repeated(substep, count, state.motion, span, p, k, options)
    return plant_signals(motion, inputs.current, p, k, options)


@equation
def plant_step(signals: PlantSignals, inputs: PlantInputs) -> PlantState:
    """The machine from a sample to the next."""
    motion = Motion(
        signals.spool_position,
        signals.spool_velocity,
        signals.piston_pressure,
        signals.swash_angle,
        signals.swash_rate,
    )
    return PlantState(motion, inputs.current, 1.0)


@equation
def plant_rest(p: Plant, k: PlantConstants) -> PlantState:
    """The plate upright with its load held, and the spool where no current moves it."""
    return PlantState(Motion(p.machine.plussing, 0.0, k.rest_pressure, 0.0, 0.0), 0.0, 0.0)


@equation
def plant_settled(
    inputs: PlantInputs, p: Plant, k: PlantConstants, options: PlantOptions
) -> PlantState:
    """Where the machine settles under a constant current."""
    m = p.machine
    force = solenoid_force(inputs.current, p.solenoids)
    closed = root(surplus_flow, -m.spool_stroke, m.spool_stroke, force, m, options.symmetric)
    tangent = balanced_tangent(closed, force, m)
    # at a stop of the plate the valve stays open
    position = balanced_spool(force, feedback_sine(tangent, m), m)
    pressure = holding_pressure(tangent, m.motor_constant * m.load_torque, m)
    held = min(max(pressure, k.lower), k.upper)
    angle = min(max(atan(tangent), -m.swash_stop_minus), m.swash_stop_plus)
    return PlantState(Motion(position, 0.0, held, angle, 0.0), inputs.current, 0.0)


@equation
def plant_domain(k: PlantConstants) -> float:
    """Above 0 where the scheme is stable."""
    return k.reserve


def too_fast(margin: float, cause: str) -> str:
    """What has happened where the scheme is not stable, for a sentence."""
    return (
        f"the fastest mode turns {2.0 - margin:.4g} rad in a sub-step, but the march is stable "
        "below 2; give it more substeps, or let mass and oil_volume be larger."
    )


plant = Model(
    "plant",
    parameters=Plant,
    state=PlantState,
    step=plant_step,
    sample=plant_sample,
    constants=plant_constants,
    rest=plant_rest,
    settled=plant_settled,
    inputs=PlantInputs,
    options=PlantOptions,
    given=Substeps,
    domain=plant_domain,
    outside=too_fast,
    outputs=("shaft_speed",),
)
"""Solenoids and machine behind a signed current."""

full_drive = join(
    "full_drive",
    card,
    plant,
    links={"current": signed_current, "current_sum": current_sum},
    integrals={"shaft_position": "shaft_speed"},
)
"""The drive with five states behind a voltage."""

full_machine = join(
    "full_machine",
    source,
    plant,
    links={"current_sum": current_sum},
    integrals={"shaft_position": "shaft_speed"},
)
"""The same without a card, behind a signed current."""
