"""Pump and motor: solenoid current to shaft speed (Kruse 2001, eqs. 6.55-6.71, 8.9).

    current ─► solenoids ─► force ─► spool ─► opening
                                       ▲          │
               mechanical feedback     │          ▼
    shaft speed ◄─ motor ◄─ swash plate angle ◄─ stroking piston pressure

Stroking piston (eqs. 6.65-6.68):

    δP' = (Z8 √((Z9 - σ δP)/2) x_eff - Z7 δP) / (1 + Z6)

σ is 1 in the published form and the sign of x_eff in the physically right one (erratum 13). The
term Z6, the plate's own motion, is absent while the plate rests on a stop.

The refinements (`swashplate.models.refinements`) stand in the same sample and the same step; an
option that is off leaves nothing of them.
"""

from math import asin, atan, inf, pi, sin, sqrt, tan
from typing import Annotated, NamedTuple

from swashplate.equations.derivatives import declared
from swashplate.equations.equation import equation
from swashplate.equations.fields import MINUS, OFF, Definition, Flag
from swashplate.equations.library import arctangent, small_arctangent
from swashplate.equations.loops import root
from swashplate.equations.model import Model
from swashplate.models.refinements import (
    accelerating_leakage,
    damping_factor,
    dither_factor,
    friction_width,
    held_back,
    line_rates,
    line_step,
    load_leakage,
    magnetising_current,
    motor_pressure_drop,
    plate_follows,
    plate_pressure_rate,
    ripple_depth,
    rippled_angle,
    static_leakage,
    stiff_line_torque,
    unloaded_leakage,
)

WELL_CONDITIONED = 0.25
"""cos(φ+α) cos(φ-α) / cos²φ above which the form without a root in its denominator is used."""

DRIVEN = "a current beyond Z17"

# What no measurement of speed determines apart, by the symmetries' names; the weights stand on the
# parameters. Two are not powers: 1 + Z6 goes with "motion", Z2 moves by Z1 Z9 along "zero".
PRESSURE, ZERO, TRAVEL, FORCE = "pressure", "zero", "travel", "force"
MOTION, TILT, ANGLE = "motion", "tilt", "angle"
OF_FORCE = {FORCE: 1.0, TILT: 1.0}


class Pump(NamedTuple):
    """Parameters of pump and motor, then those of the refinements, then the prime mover's."""

    # fmt: off
    Z1: Annotated[float, Definition("pressure to swash plate tangent", "1/Pa", above=0.0,
        source="6.55", stands_for="A_s/(k_r d4)", symmetry={PRESSURE: -1.0, ANGLE: 1.0})]
    Z2: Annotated[float, Definition("offset of the swash plate tangent", "1", source="6.55",
        symmetry={ANGLE: 1.0})]
    Z3: Annotated[float, Definition("arm ratio of the feedback", "1", above=0.0, source="6.59",
        stands_for="d4/d3", symmetry={TILT: 1.0, ANGLE: -1.0})]
    Z4: Annotated[float, Definition("squared moment of the feedback spring", "N^2 m^2", above=0.0,
        source="6.57", stands_for="k_f² d3⁴", symmetry={TRAVEL: 2.0, FORCE: 2.0})]
    Z5: Annotated[float, Definition("arm of the spool", "m", above=0.0, source="6.57",
        stands_for="d1", symmetry={TRAVEL: 1.0})]
    Z6: Annotated[float, Definition("piston motion against oil stiffness", "1", lower=0.0,
        source="6.67", stands_for="A_s² B/(k_r V)")]
    Z7: Annotated[float, Definition("leakage around the stroking piston", "1/s", lower=0.0,
        source="6.64", stands_for="K_L B/V", switch="leaky")]
    Z8: Annotated[float, Definition("flow gain of the valve", "sqrt(Pa)/(m s)", above=0.0,
        source="6.67", stands_for="C_o B/V",
        symmetry={PRESSURE: 0.5, TRAVEL: -1.0, MOTION: 1.0, TILT: -1.0})]
    Z9: Annotated[float, Definition("supply pressure less static pressure", "Pa", above=0.0,
        source="6.67", stands_for="ΔP − P0", symmetry={PRESSURE: 1.0, ZERO: 1.0})]
    Z10: Annotated[float, Definition("swash plate angle to shaft speed", "1/s", above=0.0,
        source="6.69", stands_for="K_mf C_q", symmetry={ANGLE: -1.0})]
    Z11: Annotated[float, Definition("speed lost to static load", "rad/s", source="6.69",
        stands_for="K_mL C_g")]
    Z12: Annotated[float, Definition("speed lost to accelerating load", "1", source="6.69",
        stands_for="K_mL K_mf C_i C_q", switch="loaded")]
    Z13_plus: Annotated[float, Definition("stop of the swash plate", "rad", above=0.0, upper=pi / 2,
        source="8.9", symmetry={ANGLE: 1.0}, needs="the swash plate at its stop")]
    Z13_minus: Annotated[float, MINUS]
    Z14: Annotated[float, Definition("stroke of the spool", "m", above=0.0, can_be_off=True,
        source="6.36", symmetry={TRAVEL: 1.0}, needs="the spool at its stop")]
    Z15: Annotated[float, Definition("largest stroking pressure", "Pa", above=0.0, can_be_off=True,
        source="6.2.5", symmetry={PRESSURE: 1.0}, needs="the relief valve open")]
    Z16_plus: Annotated[float, Definition("opening at which the orifice limits the flow", "m",
        above=0.0, can_be_off=True, source="6.71", symmetry={TRAVEL: 1.0, TILT: 1.0},
        needs="an orifice limiting the flow")]
    Z16_minus: Annotated[float, MINUS]
    Z17: Annotated[float, Definition("dead zone of the solenoids", "A", lower=0.0, source="6.61",
        needs=DRIVEN)]
    Z18: Annotated[float, Definition("plussing: spool displacement at rest", "m", source="6.57",
        symmetry={TRAVEL: 1.0, TILT: 1.0})]
    Z19_plus: Annotated[float, Definition("solenoid force, linear", "N/A", source="6.61",
        symmetry=OF_FORCE, needs=DRIVEN)]
    Z19_minus: Annotated[float, MINUS]
    Z20_plus: Annotated[float, Definition("solenoid force, quadratic", "N/A^2", source="6.61",
        symmetry=OF_FORCE, needs=DRIVEN)]
    Z20_minus: Annotated[float, MINUS]
    Z21_plus: Annotated[float, Definition("solenoid force, cubic", "N/A^3", source="6.61",
        symmetry=OF_FORCE, needs=DRIVEN)]
    Z21_minus: Annotated[float, MINUS]
    Z22_plus: Annotated[float, Definition("solenoid force, quartic", "N/A^4", source="6.61",
        symmetry=OF_FORCE, needs=DRIVEN)]
    Z22_minus: Annotated[float, MINUS]
    spool_friction: Annotated[float, Definition("friction of spool and solenoid", "N", lower=0.0,
        stands_for="F_s", default=0.0, switch="friction", least=1e-07)] = 0.0
    spool_presliding: Annotated[float, Definition("travel over which that friction builds up", "m",
        lower=0.0, stands_for="x_s", default=0.0, least=1e-10)] = 0.0
    dither_time: Annotated[float, Definition("time constant with which dither frees the spool", "s",
        above=0.0, can_be_off=True, stands_for="T", default=inf, least=1e-06)] = inf
    solenoid_hysteresis: Annotated[float, Definition("half-width of the solenoids' hysteresis", "A",
        lower=0.0, stands_for="r", default=0.0, switch="hysteresis", least=1e-08)] = 0.0
    load_torque: Annotated[float, Definition("static torque of the load at the shaft", "N m",
        stands_for="C_g, positive against positive speed", default=0.0)] = 0.0
    load_inertia: Annotated[float, Definition("inertia of motor and load at the shaft", "kg m^2",
        lower=0.0, stands_for="C_i, J", default=0.0, least=1e-06)] = 0.0
    motor_leakage: Annotated[float, Definition("speed lost to leakage for a torque", "rad/(s N m)",
        lower=0.0, stands_for="K_mL", default=0.0, switch="leakage", least=1e-15)] = 0.0
    cam_ripple: Annotated[float, Definition("variation of the motor's displacement without load",
        "1", lower=0.0, upper=1.0, stands_for="ε0", default=0.0, switch="ripple",
        least=1e-09)] = 0.0
    cam_ripple_per_torque: Annotated[float, Definition("growth of that variation with the load",
        "1/(N m)", lower=0.0, stands_for="ε1", default=0.0, switch="ripple", least=1e-15)] = 0.0
    cam_cycles: Annotated[float, Definition("cycles of the cam ring in a turn", "1", above=0.0,
        stands_for="n", default=5.5, least=1e-06)] = 5.5
    cam_phase: Annotated[float, Definition("phase of the cam ring at the start", "rad",
        stands_for="ψ", default=0.0)] = 0.0
    swash_damping: Annotated[float, Definition("time constant of the swash plate's damping", "s",
        lower=0.0, stands_for="T", default=0.0, switch="damping", least=1e-09)] = 0.0
    line_stiffness: Annotated[float, Definition("stiffness of the line's oil at the shaft",
        "N m/rad", lower=0.0, stands_for="k", default=0.0, switch="line", least=0.001)] = 0.0
    motor_constant: Annotated[float, Definition("motor speed for a flow", "rad/m^3", lower=0.0,
        stands_for="K_mf", default=0.0, least=1e-06)] = 0.0
    pump_speed: Annotated[float, Definition("speed of the prime mover, relative to that of Z10",
        "1", above=0.0, default=1.0)] = 1.0
    # fmt: on


class Solenoids(NamedTuple):
    """Parameters of the solenoids, those of `Pump` by the same names."""

    Z17: float
    Z19_plus: float
    Z19_minus: float
    Z20_plus: float
    Z20_minus: float
    Z21_plus: float
    Z21_minus: float
    Z22_plus: float
    Z22_minus: float


class PumpInputs(NamedTuple):
    """What drives the pump at a sample; where nothing was measured, the parameter's value."""

    current: float  # Signed, that of the positive channel less that of the negative one. [A]
    pump_speed: float  # Speed of the prime mover, relative to that of Z10. [1]
    load_torque: float  # C_g of gravity at the shaft, positive against positive speed. [N m]
    supply_pressure: float  # Supply pressure less static pressure, in place of Z9. [Pa]


class PumpOptions(NamedTuple):
    """Forms of the pump."""

    symmetric: Flag = OFF  # Root √((Z9 - sgn(x)δP)/2) in place of the published √((Z9 - δP)/2).
    leaky: Flag = OFF  # Z7 counts: the pressure is integrated by Runge-Kutta.
    loaded: Flag = OFF  # Z12 counts: the speed depends on the swash plate's rate.
    steep: Flag = OFF  # A stop of the swash plate lies beyond 22.5°.
    friction: Flag = OFF  # Friction of spool and solenoid, see `held_back`.
    hysteresis: Flag = OFF  # Hysteresis of the solenoids, see `magnetising_current`.
    ripple: Flag = OFF  # Ripple of the cam ring, see `rippled_angle`.
    damping: Flag = OFF  # Damping of the swash plate, see `plate_follows`.
    leakage: Flag = OFF  # Leakage of the motor under load, see `static_leakage`.
    line: Flag = OFF  # Line and inertia, see `line_step`.
    own: Flag = OFF  # An equation is the user's own: the steady state is searched for.


class PumpConstants(NamedTuple):
    """What the march needs of the parameters and the step; 0 for what is off."""

    lower_stop: float
    upper_stop: float  # Pressures at which the swash plate reaches its stops. [Pa]
    lower: float
    upper: float  # The same within ±Z15: the pressure never leaves them. [Pa]
    Z12: float  # With the motor's leakage, where the line is stiff. [1]
    friction_width: float  # Distance by which friction can hold the spool back. [m]
    dither_factor: float  # What dither leaves of it in a step. [1]
    damping_factor: float  # What a step leaves of the plate's lag. [1]


class PumpState(NamedTuple):
    """What the pump remembers from sample to sample; what belongs to an option is 0 without it."""

    pressure: float  # δP at this sample. [Pa]
    plate_pressure: float = 0.0  # At which the plate would stand still now (damping). [Pa]
    magnetising_current: float = 0.0  # One sample earlier (hysteresis). [A]
    spool: float = 0.0  # Displacement of the spool one sample earlier (friction). [m]
    deflection: float = 0.0  # Distance by which friction held it back then (friction). [m]
    torque: float = 0.0  # Torque of the motor one sample earlier (line). [N m]
    speed: float = 0.0  # Speed of the shaft one sample earlier (line, ripple). [rad/s]
    flow_speed: float = 0.0  # Speed that the flow would have given a stiff line then. [rad/s]
    load_torque: float = 0.0  # Torque of the load one sample earlier (line). [N m]
    shaft_angle: float = 0.0  # Since the start, one sample earlier (ripple). [rad]
    begun: float = 0.0  # 0 at the first sample, 1 from the second on (friction, line, ripple).


class PumpSignals(NamedTuple):
    """What is known of the pump at a sample."""

    magnetising_current: float  # Current that the force belongs to, behind the hysteresis. [A]
    solenoid_force: float  # Net force on the spool, positive towards more speed. [N]
    spool_free: float  # Displacement of the spool before its stop. [m]
    spool_position: float  # Displacement of the spool, within its stroke. [m]
    spool_deflection: float  # Distance by which friction holds it back. [m]
    orifice_opening: float  # What the orifices leave of the spool's displacement. [m]
    stroker_pressure: float  # Stroking pressure δP about its equilibrium. [Pa]
    swash_angle: float  # Angle of the swash plate. [rad]
    swash_rate: float  # Rate of the swash plate, zero at a stop. [rad/s]
    flow_speed: float  # Speed that the pump's flow would give a stiff line. [rad/s]
    shaft_speed: float  # Speed of the shaft, of the turret for slew. [rad/s]
    shaft_angle: float  # Since the start, as the ripple needs it; 0 without. [rad]
    motor_torque: float  # Positive where the motor drives towards positive speed. [N m]
    motor_pressure_drop: float  # P_hi - P_lo, 0 where the motor's constant is not known. [Pa]


class PumpLimits(NamedTuple):
    """Limits of the pump that can act at a sample."""

    dead_zone: bool  # The current is within the solenoids' dead zone: no force.
    orifice: bool  # The in-line orifice limits the flow, the plate moves: acceleration limit.
    spool: bool  # The spool is at its stop.
    swash_stop: bool  # The swash plate is at a stop: the speed limit.
    relief: bool  # The relief valve holds the stroking pressure at ±Z15.


# --- solenoids and spool -------------------------------------------------------------------------


@equation
def effective_current(current: float, Z17: float) -> float:
    """Current beyond the symmetric dead zone, i_e = sign(i) max(|i| - Z17, 0). [A]"""
    return max(current - Z17, 0.0) + min(current + Z17, 0.0)


@declared(effective_current)
def _effective_current(current: float, Z17: float) -> tuple[float, float]:
    # an edge of the dead zone belongs to it; without one, zero belongs to the positive side
    above = current > Z17 or (current == 0.0 and Z17 == 0.0)
    below = current < -Z17
    return (1.0 if above or below else 0.0, -1.0 if above else (1.0 if below else 0.0))


@equation
def solenoids_of(p: Pump) -> Solenoids:
    """The solenoids of a pump."""
    return Solenoids(
        p.Z17,
        p.Z19_plus,
        p.Z19_minus,
        p.Z20_plus,
        p.Z20_minus,
        p.Z21_plus,
        p.Z21_minus,
        p.Z22_plus,
        p.Z22_minus,
    )


@equation
def solenoid_force(current: float, p: Solenoids) -> float:
    """Net force of both solenoids on the spool under a signed current. [N]

    F = Z19 i_e + Z20 i_e² + Z21 i_e³ + Z22 i_e⁴, positive towards more speed; Kruse eq. 6.61 on the
    *signed* i_e: even powers keep their own sign (erratum 1).
    """
    e = effective_current(current, p.Z17)
    plus = e >= 0.0
    c1 = p.Z19_plus if plus else p.Z19_minus
    c2 = p.Z20_plus if plus else p.Z20_minus
    c3 = p.Z21_plus if plus else p.Z21_minus
    c4 = p.Z22_plus if plus else p.Z22_minus
    return e * (c1 + e * (c2 + e * (c3 + e * c4)))


@equation
def moment_sine(force: float, p: Pump) -> float:
    """sin φ = Z5 F/√Z4: solenoid moment over the feedback spring's; must lie within ±1."""
    return force * (p.Z5 / sqrt(p.Z4))


@equation
def arm_sine(pressure: float, p: Pump) -> float:
    """sin α of the feedback arm, which follows the swash plate; must lie within ±1.

    sin α = Z3 tan α_sw with tan α_sw = Z1 δP - Z2 (Kruse eqs. 6.55, 6.59), multiplied out so that
    the products of parameters are constants of the march.
    """
    return (p.Z3 * p.Z1) * pressure - p.Z3 * p.Z2


@equation
def spool_balance(force: float, arm_sine: float, p: Pump) -> float:
    """Spool displacement at which solenoid and feedback spring balance, before any stop. [m]

    x = Z5 tan(φ - α) + Z18 with sin φ = Z5 F/√Z4; Kruse eq. 6.57 in closed form (erratum 21). Valid
    for |sin φ| < 1 and |sin α| < 1; the caller checks. The first of the two equal forms keeps the
    square root out of the denominator, so that root and division overlap: it makes a whole march 14
    % faster. It is singular where φ + α = 90°, far from any real spool; there the second takes
    over.
    """
    a = moment_sine(force, p)
    s = arm_sine
    t = a / sqrt(1.0 - a * a)
    cos_arm = sqrt(1.0 - s * s)
    w = 1.0 + t * t
    spread = 1.0 - w * (s * s)
    if spread > WELL_CONDITIONED:
        return (p.Z5 * t - (p.Z5 * w * s) * cos_arm) * (1.0 / spread) + p.Z18
    return p.Z5 * (t * cos_arm - s) / (cos_arm + t * s) + p.Z18


@equation
def stopped_spool(position: float, p: Pump) -> float:
    """Spool displacement within its stroke ±Z14. [m]"""
    return min(max(position, -p.Z14), p.Z14)


@equation
def orifice_opening(position: float, p: Pump) -> float:
    """Effective opening towards the stroking piston, of the spool before its stop. [m]

    x_eff = clip(clip(x, ±Z14), -Z16₋, +Z16₊), beyond which the in-line orifice, not the spool,
    limits the flow; Kruse eqs. 6.36 and 6.71.
    """
    return min(max(position, -min(p.Z14, p.Z16_minus)), min(p.Z14, p.Z16_plus))


# --- stroking piston and swash plate -------------------------------------------------------------


@equation
def pressure_limits(p: Pump) -> tuple[float, float, float, float]:
    """Pressures at which the swash plate stops, and the same within ±Z15. [Pa]

    The stops are (∓tan Z13 + Z2)/Z1. δP never leaves the other two, so nothing winds up at a stop.
    """
    lower_stop = (p.Z2 - tan(p.Z13_minus)) / p.Z1
    upper_stop = (p.Z2 + tan(p.Z13_plus)) / p.Z1
    return lower_stop, upper_stop, max(-p.Z15, lower_stop), min(p.Z15, upper_stop)


@equation
def flow_head(pressure: float, opening: float, Z9: float, symmetric: Flag) -> tuple[float, float]:
    """Pressure head over the valve, (Z9 - σ δP)/2 [Pa], and σ.

    A pressure outside the supply has no head left and gives zero, not an imaginary flow.
    """
    sign = 1.0
    if symmetric is not None:
        sign = -1.0 if opening < 0.0 else 1.0
    return max((Z9 - sign * pressure) * 0.5, 0.0), sign


@equation
def head_root(head: float) -> float:
    """√head. [√Pa]"""
    return sqrt(head)


@declared(head_root)
def _head_root(head: float) -> float:
    return 0.5 / sqrt(head) if head > 0.0 else 0.0


@equation
def pressure_rate(
    pressure: float, opening: float, Z6: float, Z7: float, Z8: float, Z9: float, symmetric: Flag
) -> float:
    """Rate of the stroking pressure δP under the opening x_eff [m]. [Pa/s]

    Kruse eq. 6.67 with the leakage of eq. 6.64; Z6 is 0 at a stop.
    """
    head, _ = flow_head(pressure, opening, Z9, symmetric)
    return (Z8 * head_root(head) * opening - Z7 * pressure) / (1.0 + Z6)


@equation
def pumped(pressure: float, opening: float, gain: float, root: float, sign: float) -> float:
    """Pressure after a step in which the head lasts, σ (Z9 - 2 (r - σ g x)²). [Pa]

    r = √head, g = Z8 h/(4 (1 + Z6)). Multiplied out: no cancellation, and fewer operations in line.
    """
    return (pressure + (4.0 * gain * root) * opening) - (2.0 * sign * gain * gain) * (
        opening * opening
    )


@equation
def tight_step(
    pressure: float,
    opening: float,
    Z6: float,
    Z7: float,
    Z8: float,
    Z9: float,
    h: float,
    symmetric: Flag,
) -> float:
    """Pressure one step later without leakage, integrated exactly at constant opening. [Pa]

    With r = √((Z9 - σδP)/2) the equation reads r' = -σ Z8 x_eff / (4 (1 + Z6)), so that δP is a
    parabola in time until the head is used up. Z7 counts as zero; it is there for the derivative
    by it.
    """
    head, sign = flow_head(pressure, opening, Z9, symmetric)
    gain = 0.25 * Z8 * h / (1.0 + Z6)
    r = sqrt(head)
    return sign * Z9 if sign * gain * opening > r else pumped(pressure, opening, gain, r, sign)


@declared(tight_step)
def _tight_step(
    pressure: float,
    opening: float,
    Z6: float,
    Z7: float,
    Z8: float,
    Z9: float,
    h: float,
    symmetric: Flag,
) -> tuple[float, float, float, float, float, float, float]:
    # that by Z7 is the one at Z7 = 0: the leakage's rate along the parabola, carried to the end of
    # the step and integrated by the trapezoidal rule
    head, sign = flow_head(pressure, opening, Z9, symmetric)
    r = sqrt(head)
    inverse = 1.0 / (1.0 + Z6)
    gain = 0.25 * Z8 * h / (1.0 + Z6)
    if sign * gain * opening > r:
        return 0.0, 0.0, 0.0, 0.0, 0.0, sign, 0.0
    half_inverse = 0.5 / r if head > 0.0 else 0.0
    r_end = r - sign * gain * opening
    by_gain = 4.0 * opening * r_end
    by_root = 4.0 * gain * opening
    leaked = pressure * (r_end * (2.0 * half_inverse)) + pumped(pressure, opening, gain, r, sign)
    return (
        1.0 - sign * by_root * (0.5 * half_inverse),
        4.0 * gain * r_end,
        -by_gain * (0.25 * Z8 * h * (inverse * inverse)),
        -0.5 * h * inverse * leaked,
        by_gain * (0.25 * h * inverse),
        by_root * (0.5 * half_inverse),
        by_gain * (0.25 * Z8 * inverse),
    )


@equation
def leaky_step(
    pressure: float,
    opening: float,
    Z6: float,
    Z7: float,
    Z8: float,
    Z9: float,
    h: float,
    symmetric: Flag,
) -> float:
    """Pressure one step later with leakage: Runge-Kutta of fourth order, opening constant. [Pa]"""
    half = 0.5 * h
    k1 = pressure_rate(pressure, opening, Z6, Z7, Z8, Z9, symmetric)
    k2 = pressure_rate(pressure + half * k1, opening, Z6, Z7, Z8, Z9, symmetric)
    k3 = pressure_rate(pressure + half * k2, opening, Z6, Z7, Z8, Z9, symmetric)
    k4 = pressure_rate(pressure + h * k3, opening, Z6, Z7, Z8, Z9, symmetric)
    return pressure + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)


@equation
def plate_motion(pressure: float, p: Pump, k: PumpConstants) -> float:
    """Z6 while the swash plate can move, 0 while it rests on a stop."""
    return 0.0 if pressure >= k.upper_stop or pressure <= k.lower_stop else p.Z6


@equation
def swash_tangent(pressure: float, p: Pump) -> float:
    """tan α_sw = Z1 δP - Z2; Kruse eq. 6.55, before the stops."""
    return p.Z1 * pressure - p.Z2


@equation
def swash_angle(tangent: float, p: Pump, steep: Flag) -> float:
    """Swash plate angle clip(atan(tan α_sw), -Z13₋, +Z13₊); Kruse eqs. 6.55 and 8.9. [rad]

    Where both stops lie within 22.5°, not `steep`, the arctangent is spared its reduction.
    """
    angle = small_arctangent(tangent) if steep is None else arctangent(tangent)
    return min(max(angle, -p.Z13_minus), p.Z13_plus)


@equation
def swash_rate(tangent: float, pressure_rate: float, Z1: float) -> float:
    """Rate of the swash plate between its stops, Z1 cos²α_sw δP'; Kruse eq. 6.63. [rad/s]"""
    return Z1 * pressure_rate / (1.0 + tangent * tangent)


@equation
def plate_rate(plate: float, pressure_rate: float, p: Pump, k: PumpConstants) -> float:
    """Rate of the swash plate, zero while a stop or the relief valve holds it. [rad/s]

    Of the pressure at which the plate would stand still [Pa] and its rate [Pa/s].
    """
    held = plate >= k.upper or plate <= k.lower
    return 0.0 if held else swash_rate(swash_tangent(plate, p), pressure_rate, p.Z1)


# --- motor ---------------------------------------------------------------------------------------


@equation
def shaft_speed(swash_angle: float, leakage: float, Z10: float, Z11: float) -> float:
    """Speed of the shaft, Ω = Z10 α_sw - Z11 - leakage; Kruse eq. 6.69. [rad/s]

    Positive hoists, slews right, lifts the boom. For the leakage see `load_leakage`.
    """
    return Z10 * swash_angle - Z11 - leakage


@equation
def flow_speed(
    angle: float,
    tangent: float,
    rate: float,
    inputs: PumpInputs,
    p: Pump,
    k: PumpConstants,
    options: PumpOptions,
) -> float:
    """Speed that the pump's flow gives a stiff line, less what leaks there. [rad/s]

    A prime mover at another speed pumps in proportion: Z10 and Z12 hold its flow. The rate of its
    speed is taken as small.
    """
    Z11 = p.Z11
    lost = 0.0
    if options.leakage is not None and options.line is None:
        Z11 = p.Z11 + static_leakage(p.motor_leakage, inputs.load_torque)
        lost = load_leakage(tangent, rate, k.Z12 * inputs.pump_speed)
    elif options.loaded is not None:
        lost = load_leakage(tangent, rate, k.Z12 * inputs.pump_speed)
    else:
        lost = unloaded_leakage(tangent, rate * inputs.pump_speed, k.Z12)
    return shaft_speed(angle, lost, p.Z10 * inputs.pump_speed, Z11)


# --- the pump ------------------------------------------------------------------------------------


@equation
def pump_constants(p: Pump, h: float, options: PumpOptions) -> PumpConstants:
    """Constants of the pump's march."""
    lower_stop, upper_stop, lower, upper = pressure_limits(p)
    Z12 = p.Z12
    if options.leakage is not None and options.line is None:
        Z12 = p.Z12 + accelerating_leakage(p.motor_leakage, p.load_inertia, p.Z10)
    width = 0.0
    dither = 0.0
    if options.friction is not None:
        width = friction_width(p.spool_friction, p.Z4, p.Z5)
        dither = dither_factor(p.dither_time, h)
    damping = 0.0
    if options.damping is not None:
        damping = damping_factor(p.swash_damping, p.Z6, h)
    return PumpConstants(lower_stop, upper_stop, lower, upper, Z12, width, dither, damping)


@equation
def pump_sample(
    state: PumpState, inputs: PumpInputs, p: Pump, k: PumpConstants, h: float, options: PumpOptions
) -> PumpSignals:
    """Everything that is known of the pump at a sample.

    The order is the chain's: hysteresis, force, balance of the spool, friction, opening, rate of
    the plate, leakage, ripple, line.
    """
    current = inputs.current
    if options.hysteresis is not None:
        current = magnetising_current(current, state.magnetising_current, p.solenoid_hysteresis)
    force = solenoid_force(current, solenoids_of(p))

    plate = state.pressure if options.damping is None else state.plate_pressure
    spool = spool_balance(force, arm_sine(plate, p), p)
    deflection = 0.0
    if options.friction is not None:
        balance = stopped_spool(spool, p)
        before = balance if state.begun == 0.0 else state.spool
        deflection = held_back(
            state.deflection, balance, before, k.friction_width, p.spool_presliding, k.dither_factor
        )
        spool = balance - deflection
    opening = orifice_opening(spool, p)

    tangent = swash_tangent(plate, p)
    angle = swash_angle(tangent, p, options.steep)
    if options.damping is None:
        rising = pressure_rate(
            plate, opening, p.Z6, p.Z7, p.Z8, inputs.supply_pressure, options.symmetric
        )
    else:
        rising = plate_pressure_rate(state.pressure, plate, p.swash_damping)
    rate = plate_rate(plate, rising, p, k)

    effective = angle
    if options.ripple is not None:
        # the shaft's angle at this sample, as far as its speed so far tells
        ahead = state.shaft_angle + h * state.speed
        depth = ripple_depth(p.cam_ripple, p.cam_ripple_per_torque, inputs.load_torque)
        effective = rippled_angle(angle, ahead, depth, p.cam_cycles, p.cam_phase)
    flow = flow_speed(effective, tangent, rate, inputs, p, k, options)

    if options.line is None:
        speed = flow
        torque = stiff_line_torque(
            tangent, rate, inputs.load_torque, p.load_inertia, p.Z10 * inputs.pump_speed
        )
    elif state.begun == 0.0:
        torque = inputs.load_torque
        speed = flow - p.motor_leakage * torque
    else:
        torque, speed = line_step(
            state.torque,
            state.speed,
            0.5 * (state.flow_speed + flow),
            0.5 * (state.load_torque + inputs.load_torque),
            p.line_stiffness,
            p.motor_leakage,
            p.load_inertia,
            h,
        )
    turned = 0.0
    if options.ripple is not None:
        moved = 0.5 * h * (state.speed + speed)
        turned = state.shaft_angle if state.begun == 0.0 else state.shaft_angle + moved

    return PumpSignals(
        magnetising_current=current,
        solenoid_force=force,
        spool_free=spool,
        spool_position=stopped_spool(spool, p),
        spool_deflection=deflection,
        orifice_opening=opening,
        stroker_pressure=state.pressure,
        swash_angle=angle,
        swash_rate=rate,
        flow_speed=flow,
        shaft_speed=speed,
        shaft_angle=turned,
        motor_torque=torque,
        motor_pressure_drop=motor_pressure_drop(torque, p.motor_constant),
    )


@equation
def pump_step(
    state: PumpState,
    signals: PumpSignals,
    inputs: PumpInputs,
    p: Pump,
    k: PumpConstants,
    h: float,
    options: PumpOptions,
) -> PumpState:
    """The pump from a sample to the next."""
    opening = signals.orifice_opening
    Z9 = inputs.supply_pressure
    # a damped plate takes its oil as it turns, not as the pressure rises
    Z6 = plate_motion(state.pressure, p, k) if options.damping is None else 0.0
    if options.leaky is None:
        free = tight_step(state.pressure, opening, Z6, p.Z7, p.Z8, Z9, h, options.symmetric)
    else:
        free = leaky_step(state.pressure, opening, Z6, p.Z7, p.Z8, Z9, h, options.symmetric)
    plate = 0.0
    if options.damping is not None:
        free, follower = plate_follows(free, state.plate_pressure, p.Z6, k.damping_factor)
        plate = min(max(follower, k.lower), k.upper)
    turning = options.ripple is not None or options.line is not None
    return PumpState(
        pressure=min(max(free, k.lower), k.upper),
        plate_pressure=plate,
        magnetising_current=0.0 if options.hysteresis is None else signals.magnetising_current,
        spool=0.0 if options.friction is None else signals.spool_free,
        deflection=signals.spool_deflection,
        torque=0.0 if options.line is None else signals.motor_torque,
        speed=signals.shaft_speed if turning else 0.0,
        flow_speed=0.0 if options.line is None else signals.flow_speed,
        load_torque=0.0 if options.line is None else inputs.load_torque,
        shaft_angle=signals.shaft_angle,
        begun=1.0 if turning or options.friction is not None else 0.0,
    )


@equation
def pump_rates(
    state: PumpState,
    signals: PumpSignals,
    inputs: PumpInputs,
    p: Pump,
    k: PumpConstants,
    options: PumpOptions,
) -> PumpState:
    """Rates of the pump's state in continuous time, in place of `pump_step`. [1/s]

    The sample before them has h = 0 and `begun` = 1, so that the line stands where its state says
    and the spool is held back by (w x_b + x_s d)/(x_s + w): by what it has moved of its balance
    x_b and by the state's deflection d, which dither lets go.
    """
    Z6 = plate_motion(state.pressure, p, k) if options.damping is None else 0.0
    rising = pressure_rate(
        state.pressure,
        signals.orifice_opening,
        Z6,
        p.Z7,
        p.Z8,
        inputs.supply_pressure,
        options.symmetric,
    )
    plate = 0.0
    if options.damping is not None:
        plate = plate_pressure_rate(state.pressure, state.plate_pressure, p.swash_damping)
        rising = rising - p.Z6 * plate
    released = 0.0
    if options.friction is not None:
        released = -signals.spool_deflection / p.dither_time
    charging = 0.0
    accelerating = 0.0
    if options.line is not None:
        charging, accelerating = line_rates(
            state.torque,
            state.speed,
            signals.flow_speed,
            inputs.load_torque,
            p.line_stiffness,
            p.motor_leakage,
            p.load_inertia,
        )
    return PumpState(
        pressure=rising,
        plate_pressure=plate,
        magnetising_current=0.0,
        spool=0.0,
        deflection=released,
        torque=charging,
        speed=accelerating,
        flow_speed=0.0,
        load_torque=0.0,
        shaft_angle=0.0,
        begun=0.0,
    )


@equation
def standing(
    pressure: float, current: float, load_torque: float, options: PumpOptions
) -> PumpState:
    """State of a pump whose plate stands and whose line bears the load, nothing held back."""
    return PumpState(
        pressure=pressure,
        plate_pressure=0.0 if options.damping is None else pressure,
        magnetising_current=0.0 if options.hysteresis is None else current,
        spool=0.0,
        deflection=0.0,
        torque=0.0 if options.line is None else load_torque,
        speed=0.0,
        flow_speed=0.0,
        load_torque=0.0,
        shaft_angle=0.0,
        begun=0.0,
    )


@equation
def pump_rest(p: Pump, k: PumpConstants, options: PumpOptions, inputs: PumpInputs) -> PumpState:
    """State of a pump without current: the plate upright at δP = Z2/Z1."""
    return standing(p.Z2 / p.Z1, 0.0, inputs.load_torque, options)


@equation
def closed_pressure(force: float, p: Pump, k: PumpConstants) -> float:
    """δP at which the spool closes, held within the limits.

    Without leakage sin α = sin(φ + atan(Z18/Z5)), so δP = (sin α/Z3 + Z2)/Z1. [Pa]
    """
    a = min(max(moment_sine(force, p), -1.0), 1.0)
    angle = min(max(asin(a) + atan(p.Z18 / p.Z5), -0.5 * pi), 0.5 * pi)
    closed = (sin(angle) / p.Z3 + p.Z2) / p.Z1
    return min(max(closed, k.lower), k.upper)


@equation
def leaked_pressure(
    pressure: float, Z9: float, p: Pump, k: PumpConstants, symmetric: Flag
) -> float:
    """What leakage takes from the pressure at which the spool closes. [Pa]

    The spool opens by x = Z7 δP/(Z8 √head), and x falls by Z1 Z3 (Z5² + Z18²)/(Z5 cos α) for each
    pascal: the first order, which is all that the derivative at Z7 = 0 needs.
    """
    head, _ = flow_head(pressure, pressure, Z9, symmetric)
    if not k.lower < pressure < k.upper or head <= 0.0:
        return 0.0
    s = arm_sine(pressure, p)
    stiffness = p.Z1 * p.Z3 * (p.Z5 * p.Z5 + p.Z18 * p.Z18) / (p.Z5 * sqrt(1.0 - s * s))
    return p.Z7 * pressure / (p.Z8 * sqrt(head) * stiffness)


@equation
def pressure_gain(pressure: float, force: float, Z9: float, p: Pump, options: PumpOptions) -> float:
    """Rate of the stroking pressure under a force; it falls with the pressure. [Pa/s]"""
    opening = orifice_opening(spool_balance(force, arm_sine(pressure, p), p), p)
    return pressure_rate(pressure, opening, p.Z6, p.Z7, p.Z8, Z9, options.symmetric)


@equation
def settled_pressure(inputs: PumpInputs, p: Pump, k: PumpConstants, options: PumpOptions) -> float:
    """δP that the pump settles at under a constant current. [Pa]

    Without leakage where the spool closes, with it where the flow through the spool is what leaks.
    Where it closes is known in closed form of the package's equations alone.
    """
    force = solenoid_force(inputs.current, solenoids_of(p))
    if options.leaky is None and options.own is None:
        closed = closed_pressure(force, p, k)
        return closed - leaked_pressure(closed, inputs.supply_pressure, p, k, options.symmetric)
    return root(pressure_gain, k.lower, k.upper, force, inputs.supply_pressure, p, options)


@equation
def pump_settled(inputs: PumpInputs, p: Pump, k: PumpConstants, options: PumpOptions) -> PumpState:
    """State that a pump settles at: the middle of what friction and hysteresis leave open.

    The sample there has the speed that the drive settles at; the cam ring's ripple, which does not
    change the mean of a turn, must be off.
    """
    pressure = settled_pressure(inputs, p, k, options)
    return standing(pressure, inputs.current, inputs.load_torque, options)


@equation
def pump_limits(
    state: PumpState,
    signals: PumpSignals,
    inputs: PumpInputs,
    p: Pump,
    k: PumpConstants,
    options: PumpOptions,
) -> PumpLimits:
    """Limits that act at a sample."""
    free = signals.spool_free
    pressure = signals.stroker_pressure
    orifice = p.Z16_plus if free > 0.0 else p.Z16_minus
    # against a stop nothing accelerates, however wide the spool is open
    held = (pressure >= k.upper and free > 0.0) or (pressure <= k.lower and free < 0.0)
    return PumpLimits(
        dead_zone=abs(signals.magnetising_current) <= p.Z17,
        orifice=min(abs(free), p.Z14) > orifice and not held,
        spool=abs(free) > p.Z14,
        swash_stop=pressure >= k.upper_stop or pressure <= k.lower_stop,
        relief=(pressure >= k.upper and k.upper < k.upper_stop)
        or (pressure <= k.lower and k.lower > k.lower_stop),
    )


@equation
def pump_domain(signals: PumpSignals, inputs: PumpInputs, p: Pump, k: PumpConstants) -> float:
    """1 - sin²φ, above 0 within the model: at 0 the solenoid overpowers the feedback spring."""
    a = moment_sine(signals.solenoid_force, p)
    return 1.0 - a * a


def overpowered(margin: float, cause: str) -> str:
    """What has happened where sin²φ is not below 1, for a sentence."""
    return (
        f"Z5·F/√Z4 reaches {sqrt(1.0 - margin):.4g} under this {cause}, but must stay below 1, "
        "where the solenoid overpowers the feedback spring; check Z19 to Z22, Z4, Z5 and the "
        f"{cause}'s size."
    )


pump = Model(
    "pump",
    parameters=Pump,
    state=PumpState,
    step=pump_step,
    sample=pump_sample,
    constants=pump_constants,
    rest=pump_rest,
    settled=pump_settled,
    inputs=PumpInputs,
    defaults={"pump_speed": "pump_speed", "load_torque": "load_torque", "supply_pressure": "Z9"},
    options=PumpOptions,
    limits=pump_limits,
    domain=pump_domain,
    integrals={"shaft_position": "shaft_speed"},
    free_start={"pressure": ("pressure", "plate_pressure")},
    outside=overpowered,
)
