"""A machine from the spool to the load: its quantities and the equations of its parts.

Parameters are physical: arms, springs, masses, areas, oil and load. Kruse's equations are
Kruse (2001) 6.13-6.19 (spool), 6.31-6.35 (flow and oil), 6.34-6.38 and 6.48-6.53 (swash plate) and
6.39-6.46 (motor and load).

The spool moves a lever of arm d1 by the angle β, tan β = (x - x0)/d1; the swash plate turns the
other feedback arm by α. Between both hangs the feedback spring. The stroking piston at the arm d4
stands at x_st = d4 tan α_sw. Its lever is therefore d4 (1 + tan²α_sw), for force as for speed:
eq. 6.38 has d4 alone, which would not conserve energy (erratum 16).
"""

from math import asin, atan, pi, sin, sqrt, tan
from typing import Annotated, NamedTuple

from swashplate.machine import Definition, Flag, equation, root
from swashplate.machine.fields import MINUS
from swashplate.machine.library import clipped
from swashplate.models.displacement_control import flow_head, head_root

ATMOSPHERE = 101325.0
"""Pressure in the reservoir. [Pa]"""


class Hydrostat(NamedTuple):
    """Physical parameters of a hydrostatic transmission, from the spool to the load.

    Plausible is three decades or more about what the packaged sets have or assume; a mass or an
    inertia may be as small as one likes, towards the model without it.
    """

    # fmt: off
    spool_arm: Annotated[float, Definition("arm from the pivot to the spool", "m", above=0.0,
        stands_for="d1", plausible=(1e-6, 1.0))]
    spool_mass: Annotated[float, Definition("mass of the spool", "kg", above=0.0,
        stands_for="m_sp", plausible=(0.0, 100.0))]
    feedback_arm_inertia: Annotated[float, Definition("inertia of the spool's feedback arm",
        "kg m^2", 0.0, stands_for="J_fa", plausible=(0.0, 10.0))]
    spool_damping: Annotated[float, Definition("viscous damping of the spool", "N s/m", 0.0,
        stands_for="b_sp", plausible=(0.0, 1e6))]
    feedback_spring_rate: Annotated[float, Definition("stiffness of the feedback spring", "N/m",
        above=0.0, stands_for="k_f", plausible=(1.0, 1e9))]
    feedback_spring_arm: Annotated[float, Definition("arm of the feedback spring", "m", above=0.0,
        stands_for="d3", plausible=(1e-5, 10.0))]
    control_arm: Annotated[float, Definition("arm of the ball on the stroking piston", "m",
        above=0.0, stands_for="d3'", plausible=(1e-5, 10.0))]
    plussing: Annotated[float, Definition("spool displacement at rest", "m", stands_for="x0",
        plausible=(0.0, 0.1))]
    spool_stroke: Annotated[float, Definition("stroke of the spool, both ways", "m", above=0.0,
        stands_for="x_max", plausible=(1e-8, 1.0))]
    orifice_opening_plus: Annotated[float,
        Definition("opening at which the in-line orifice limits the flow", "m", above=0.0,
        can_be_off=True, stands_for="x_o", plausible=(1e-8, 0.1))]
    orifice_opening_minus: Annotated[float, MINUS]
    valve_flow_gain: Annotated[float, Definition("flow gain of the valve", "m^2/(s sqrt(Pa))",
        above=0.0, stands_for="C_o", plausible=(1e-9, 10.0))]
    supply_pressure: Annotated[float, Definition("supply pressure less reservoir pressure", "Pa",
        above=0.0, stands_for="ΔP", plausible=(1e4, 1e9))]
    oil_volume: Annotated[float, Definition("oil under pressure at the stroking piston", "m^3",
        above=0.0, stands_for="V", plausible=(1e-9, 1.0))]
    bulk_modulus: Annotated[float, Definition("bulk modulus of the oil", "Pa", above=0.0,
        stands_for="B", plausible=(1e7, 1e11))]
    piston_leakage: Annotated[float, Definition("leakage around the stroking piston", "m^3/(s Pa)",
        0.0, stands_for="K_L", plausible=(0.0, 1e-6))]
    piston_area: Annotated[float, Definition("area of the stroking piston", "m^2", above=0.0,
        stands_for="A_s", plausible=(1e-7, 1.0))]
    relief_pressure: Annotated[float, Definition("pressure of the relief valve", "Pa", above=0.0,
        can_be_off=True, stands_for="P_r", plausible=(1e4, 1e10))]
    swash_arm: Annotated[float, Definition("arm of the stroking piston on the swash plate", "m",
        above=0.0, stands_for="d4", plausible=(1e-4, 10.0))]
    swash_inertia: Annotated[float, Definition("inertia of the swash plate", "kg m^2", above=0.0,
        stands_for="J_sw", plausible=(0.0, 1e4))]
    piston_mass: Annotated[float, Definition("mass of the stroking piston", "kg", 0.0,
        stands_for="m_st", plausible=(0.0, 1e4))]
    piston_damping: Annotated[float, Definition("viscous damping of the stroking piston", "N s/m",
        0.0, stands_for="b_st", plausible=(0.0, 1e9))]
    return_spring_rate: Annotated[float, Definition("stiffness of the return spring", "N/m",
        above=0.0, stands_for="k_r", plausible=(1.0, 1e11))]
    swash_stop_plus: Annotated[float, Definition("stop of the swash plate", "rad", above=0.0,
        upper=pi / 2, stands_for="α_max", plausible=(1e-3, pi / 2))]
    swash_stop_minus: Annotated[float, MINUS]
    pumping_area: Annotated[float, Definition("effective area of the pumping pistons", "m^2", 0.0,
        stands_for="A_p", plausible=(0.0, 1.0))]
    pumping_arm: Annotated[float, Definition("arm of the pumping pistons' force on the plate", "m",
        0.0, stands_for="d5", plausible=(0.0, 1.0))]
    motor_constant: Annotated[float, Definition("motor speed over flow", "rad/m^3", above=0.0,
        stands_for="K_mf", plausible=(1e-3, 1e8))]
    pump_flow_gain: Annotated[float, Definition("pump flow over swash angle", "m^3/s", above=0.0,
        stands_for="C_q", plausible=(1e-8, 1e3))]
    motor_leakage: Annotated[float, Definition("motor speed lost over load torque",
        "rad/(s N m)", 0.0, stands_for="K_mL", plausible=(0.0, 1.0))]
    load_inertia: Annotated[float, Definition("inertia of the load at the motor", "kg m^2", 0.0,
        stands_for="C_i", plausible=(0.0, 1e12))]
    load_torque: Annotated[float, Definition("static torque of the load, against positive speed",
        "N m", stands_for="C_g", plausible=(0.0, 1e10))]
    air_fraction: Annotated[float, Definition("free air over oil at atmospheric pressure", "1", 0.0,
        upper=1.0, default=0.0, switch=True, least=1e-9, stands_for="χ",
        plausible=(0.0, 1.0))] = 0.0
    # fmt: on


class ReliefPressures(NamedTuple):
    """Stroker pressures at which the relief valve opens. [Pa]"""

    lower: float
    upper: float


# --- spool ---------------------------------------------------------------------------------------


@equation
def feedback_sine(tangent: float, p: Hydrostat) -> float:
    """sin α of the feedback arm, (d4/d3') tan α_sw; Kruse eq. 6.20."""
    return p.swash_arm / p.control_arm * tangent


@equation
def spring_moment(p: Hydrostat) -> float:
    """k_f d3² of the feedback spring. [N m]"""
    return p.feedback_spring_rate * (p.feedback_spring_arm * p.feedback_spring_arm)


@equation
def feedback_moment(position: float, arm_sine: float, p: Hydrostat) -> float:
    """Moment k_f d3² sin(α + β) with which the spring resists the swash plate's arm. [N m]"""
    u = position - p.plussing
    cosine = sqrt(1.0 - arm_sine * arm_sine)
    arm = p.spool_arm
    return spring_moment(p) * (arm * arm_sine + u * cosine) / sqrt(arm * arm + u * u)


@equation
def spool_inertia(position: float, p: Hydrostat) -> float:
    """Inertia of spool and feedback arm against the spool's lever, m_sp D/d1 + J_fa d1/D. [kg m]"""
    u = position - p.plussing
    D = p.spool_arm * p.spool_arm + u * u
    return p.spool_mass * D / p.spool_arm + p.feedback_arm_inertia * p.spool_arm / D


@equation
def spool_moment(position: float, force: float, arm_sine: float, p: Hydrostat) -> float:
    """Moment of solenoids and feedback spring on the spool's lever; it falls with x. [N m]"""
    u = position - p.plussing
    D = p.spool_arm * p.spool_arm + u * u
    return force * D / p.spool_arm - feedback_moment(position, arm_sine, p)


@equation
def spool_resistance(position: float, velocity: float, p: Hydrostat) -> float:
    """Moment that resists the spool's motion, by its velocity, b_sp D/d1 - 2 J_fa d1 u x'/D²."""
    u = position - p.plussing
    D = p.spool_arm * p.spool_arm + u * u
    turning = 2.0 * p.feedback_arm_inertia * p.spool_arm * u * velocity / (D * D)
    return p.spool_damping * D / p.spool_arm - turning


@equation
def spool_acceleration(
    position: float, velocity: float, force: float, arm_sine: float, p: Hydrostat
) -> float:
    """Acceleration x'' of the spool under the net force F of both solenoids. [m/s²]

    With u = x - x0 and D = d1² + u², Kruse eq. 6.19 with the viscous damping that it lacks:
    (m_sp D/d1 + J_fa d1/D) x'' = (F - b x') D/d1 - k_f d3² (d1 sin α + u cos α)/√D
    + 2 J_fa d1 u x'²/D².
    """
    moment = spool_moment(position, force, arm_sine, p)
    resisting = spool_resistance(position, velocity, p) * velocity
    return (moment - resisting) / spool_inertia(position, p)


# --- valve and oil -------------------------------------------------------------------------------


@equation
def valve_opening(position: float, p: Hydrostat) -> float:
    """Effective opening x_eff = clip(clip(x, ±x_max), -x_o₋, +x_o₊); Kruse eqs. 6.36, 6.71. [m]"""
    upper = min(p.orifice_opening_plus, p.spool_stroke)
    return clipped(position, -min(p.orifice_opening_minus, p.spool_stroke), upper)


@equation
def valve_flow(position: float, pressure: float, p: Hydrostat, symmetric: Flag) -> float:
    """Flow through the valve towards the stroking piston. [m³/s]

    q = C_o √((ΔP - σP)/2) x_eff; Kruse eq. 6.31 with the constant gain of eq. 6.37. σ is 1 in the
    published root, with `symmetric` sgn(x) (erratum 13).
    """
    opening = valve_opening(position, p)
    head, _ = flow_head(pressure, opening, p.supply_pressure, symmetric)
    return p.valve_flow_gain * head_root(head) * opening


@equation
def mixture_modulus(pressure: float, p: Hydrostat) -> float:
    """Bulk modulus of oil with free air in it, at an absolute pressure. [Pa]

    B (1 + χ p0/p)/(1 + χ p0 B/p²), air compressed at a constant temperature and none of it
    dissolved; Gholizadeh, Burton and Schoenau (2011), Fluid bulk modulus: a literature survey,
    International Journal of Fluid Power 12(3), 5-15.
    """
    air = p.air_fraction * ATMOSPHERE / pressure
    return p.bulk_modulus * (1.0 + air) / (1.0 + air * p.bulk_modulus / pressure)


@equation
def oil_modulus(pressure: float, p: Hydrostat, air: Flag) -> float:
    """Bulk modulus at a stroker pressure P: with air the mean of both ends of the cylinder. [Pa]

    Both orifices of the valve drop the same, so that the ends are at p0 + (ΔP ± P)/2 (eqs. 6.26 to
    6.28).
    """
    if air is None:
        return p.bulk_modulus
    ahead = max(0.5 * (p.supply_pressure + pressure), 0.0) + ATMOSPHERE
    behind = max(0.5 * (p.supply_pressure - pressure), 0.0) + ATMOSPHERE
    return 0.5 * (mixture_modulus(ahead, p) + mixture_modulus(behind, p))


@equation
def oil_pressure_rate(
    pressure: float, flow: float, piston_speed: float, p: Hydrostat, air: Flag
) -> float:
    """Rate of the stroker pressure, (q - K_L P - A_s x_st') B/V; Kruse eqs. 6.32 to 6.35. [Pa/s]"""
    stays = flow - p.piston_leakage * pressure - p.piston_area * piston_speed
    return stays * (oil_modulus(pressure, p, air) / p.oil_volume)


# --- swash plate ---------------------------------------------------------------------------------


@equation
def plate_lever(tangent: float, p: Hydrostat) -> float:
    """Lever d4 (1 + tan²α_sw) of the stroking piston, for force as for speed. [m]"""
    return p.swash_arm * (1.0 + tangent * tangent)


@equation
def piston_speed(tangent: float, swash_rate: float, p: Hydrostat) -> float:
    """Speed of the stroking piston, d4 (1 + tan²α_sw) α_sw'; Kruse eq. 6.34. [m/s]"""
    return plate_lever(tangent, p) * swash_rate


@equation
def holding_pressure(tangent: float, motor_pressure: float, p: Hydrostat) -> float:
    """Stroker pressure that holds the swash plate where it is. [Pa]

    (k_r d4 tan α + (P_hi - P_lo) A_p d5 cos α/(d4 (1 + tan²α)))/A_s; Kruse eq. 6.53.
    """
    w = 1.0 + tangent * tangent
    arm = p.swash_arm
    pumping = p.pumping_area * p.pumping_arm
    pushed = motor_pressure * pumping / (arm * w * sqrt(w))
    return (p.return_spring_rate * arm * tangent + pushed) / p.piston_area


@equation
def plate_inertia(tangent: float, p: Hydrostat) -> float:
    """Inertia J_sw + m_st d4² (1 + tan²α)² of plate and piston. [kg m²]"""
    lever = plate_lever(tangent, p)
    return p.swash_inertia + p.piston_mass * lever * lever


@equation
def plate_moment(pressure: float, tangent: float, motor_pressure: float, p: Hydrostat) -> float:
    """Moment of stroking piston, return spring and pumping pistons on the plate. [N m]"""
    # as a difference of pressures, which is exactly zero where the relief valve holds the plate
    surplus = pressure - holding_pressure(tangent, motor_pressure, p)
    return p.piston_area * plate_lever(tangent, p) * surplus


@equation
def plate_resistance(tangent: float, swash_rate: float, p: Hydrostat) -> float:
    """Moment that resists the plate's motion, by its rate. [N m s]"""
    lever = plate_lever(tangent, p)
    return lever * lever * (p.piston_damping + 2.0 * p.piston_mass * tangent * swash_rate)


@equation
def swash_acceleration(
    pressure: float, tangent: float, swash_rate: float, motor_pressure: float, p: Hydrostat
) -> float:
    """Angular acceleration α_sw'' of the swash plate. [rad/s²]

    With w = 1 + tan²α, Kruse eq. 6.51 with the lever d4 w (erratum 16):
    (J_sw + m_st d4² w²) α'' = A_s d4 w (P - P_hold) - b_st d4² w² α' - 2 m_st d4² tan α w² α'².
    """
    moment = plate_moment(pressure, tangent, motor_pressure, p)
    resisting = plate_resistance(tangent, swash_rate, p) * swash_rate
    return (moment - resisting) / plate_inertia(tangent, p)


# --- motor and load ------------------------------------------------------------------------------


@equation
def pump_flow(swash_angle: float, p: Hydrostat) -> float:
    """Flow of the pump, Q = C_q α_sw. [m³/s]

    A swash plate pump's flow goes with tan α_sw; the published Z10 belongs to the angle (erratum
    18).
    """
    return p.pump_flow_gain * swash_angle


@equation
def load_inertance(p: Hydrostat) -> float:
    """Torque of the load's inertia for a swash rate, C_i K_mf C_q; Kruse eq. 6.42. [N m s]"""
    return p.load_inertia * p.motor_constant * p.pump_flow_gain


@equation
def motor_torque(swash_rate: float, p: Hydrostat) -> float:
    """Torque of the load on the motor, C_i Ω' + C_g with Ω' = K_mf C_q α_sw'. [N m]

    Kruse eqs. 6.42 and 6.45; C_g of gravity is positive against positive speed.
    """
    return load_inertance(p) * swash_rate + p.load_torque


@equation
def motor_drop(swash_rate: float, p: Hydrostat) -> float:
    """P_hi - P_lo = K_mf τ, from the work done by the motor; Kruse eq. 6.41. [Pa]"""
    return p.motor_constant * motor_torque(swash_rate, p)


@equation
def load_resistance(tangent: float, p: Hydrostat) -> float:
    """Moment with which the load's inertia resists the plate, by its rate. [N m s]

    It comes through the pressure drop across the motor and the pumping pistons.
    """
    pumping = p.pumping_area * p.pumping_arm
    return p.motor_constant * load_inertance(p) * pumping / sqrt(1.0 + tangent * tangent)


@equation
def machine_speed(angle: float, swash_rate: float, p: Hydrostat) -> float:
    """Shaft speed K_mf Q less K_mL τ, what leaks at the motor under its load. [rad/s]"""
    return p.motor_constant * pump_flow(angle, p) - p.motor_leakage * motor_torque(swash_rate, p)


# --- limits and equilibria -----------------------------------------------------------------------


@equation
def static_pressure(p: Hydrostat) -> float:
    """P0 = K_mf C_g A_p d5/(A_s d4), which holds the load with the plate upright; eq. 6.54. [Pa]"""
    load = p.motor_constant * p.load_torque
    return load * (p.pumping_area * p.pumping_arm) / (p.piston_area * p.swash_arm)


@equation
def relief_pressures(p: Hydrostat) -> ReliefPressures:
    """Lowest and highest stroker pressure that the relief valve allows. [Pa]

    It keeps the pressure between those that hold the swash plate and its static load at the stops
    (eq. 6.53), and within P_r of the pressure at rest: nothing winds up at a stop.
    """
    load, rest = p.motor_constant * p.load_torque, static_pressure(p)
    lower = holding_pressure(tan(-p.swash_stop_minus), load, p)
    upper = holding_pressure(tan(p.swash_stop_plus), load, p)
    return ReliefPressures(
        max(lower, rest - p.relief_pressure), min(upper, rest + p.relief_pressure)
    )


@equation
def fastest_rate(p: Hydrostat) -> float:
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
def balanced_spool(force: float, arm_sine: float, p: Hydrostat) -> float:
    """Spool position at which solenoids and feedback spring balance, within the stroke. [m]

    Where the solenoids overpower the spring the spool is at its stop.
    """
    return root(spool_moment, -p.spool_stroke, p.spool_stroke, force, arm_sine, p)


@equation
def balanced_tangent(position: float, force: float, p: Hydrostat) -> float:
    """tan α_sw, within the stops, at which solenoids and feedback spring hold the spool.

    d1 F (1 + tan²β) = k_f d3² sin(α + β), the printed eq. 6.19 at rest.
    """
    lever = (position - p.plussing) / p.spool_arm
    sine = p.spool_arm * force * (1.0 + lever * lever) / spring_moment(p)
    arm = asin(min(max(sine, -1.0), 1.0)) - atan(lever)
    tangent = sin(min(max(arm, -0.5 * pi), 0.5 * pi)) * p.control_arm / p.swash_arm
    return min(max(tangent, -tan(p.swash_stop_minus)), tan(p.swash_stop_plus))


@equation
def surplus_flow(position: float, force: float, p: Hydrostat, symmetric: Flag) -> float:
    """Flow through the valve less what leaks, with spool and plate in balance. [m³/s]"""
    tangent = balanced_tangent(position, force, p)
    pressure = holding_pressure(tangent, p.motor_constant * p.load_torque, p)
    return valve_flow(position, pressure, p, symmetric) - p.piston_leakage * pressure
