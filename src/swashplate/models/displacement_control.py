"""Displacement control of the pump: solenoid current to swash plate angle (Kruse 2001, 6.55-6.68).

    current ─► solenoids ─► force ─► spool ─► opening
                                       ▲          │
               mechanical feedback     │          ▼
                      swash plate angle ◄─ stroking piston pressure

Stroking piston (eqs. 6.65-6.68):

    δP' = (Z8 √((Z9 - σ δP)/2) x_eff - Z7 δP) / (1 + Z6)

σ is 1 in the published form and the sign of x_eff in the physically right one (erratum 13). The
term Z6, the plate's own motion, is absent while the plate rests on a stop.
"""

from math import asin, atan, inf, pi, sin, sqrt, tan
from typing import Annotated, NamedTuple

from swashplate.machine import Definition, Flag, declared, equation
from swashplate.machine.fields import MINUS, OFF
from swashplate.machine.library import TAN_22_5, arctangent, small_arctangent

WELL_CONDITIONED = 0.25
"""cos(φ+α) cos(φ-α) / cos²φ above which the form without a root in its denominator is used."""

DRIVEN = "a current beyond Z17"

# What no measurement of speed determines apart, by the symmetries' names; the weights stand on the
# parameters. Two are not powers: 1 + Z6 goes with "motion", Z2 moves by Z1 Z9 along "zero".
PRESSURE, ZERO, TRAVEL, FORCE, MOTION = "pressure", "zero", "travel", "force", "motion"


class Pump(NamedTuple):
    """Parameters of pump and motor, then those of the refinements, the prime mover's among them.

    Exported models number them in this order: a new one comes last.

    Plausible is three to four decades about Kruse's machines and the packaged start, and beyond
    where machines are: each term of a solenoid's force reaches 10 kN at 10 mA, torques are those of
    the slew ring of the largest cranes, a motor of 10 kW at 3000 rpm that loses a tenth of its
    speed leaks 1 rad/(s N m), and one of 0.1 cm³ a turn has 6e7 rad/m³.
    """

    # fmt: off
    Z1: Annotated[float, Definition("pressure to swash plate tangent", "1/Pa", above=0.0,
        source="6.55", stands_for="A_s/(k_r d4)", symmetry={PRESSURE: -1.0},
        plausible=(1e-11, 1e-3))]
    Z2: Annotated[float, Definition("offset of the swash plate tangent", "1", source="6.55",
        plausible=(0.0, 10.0))]
    Z3: Annotated[float, Definition("arm ratio of the feedback", "1", above=0.0, source="6.59",
        stands_for="d4/d3", plausible=(1e-4, 1e4))]
    Z4: Annotated[float, Definition("squared moment of the feedback spring", "N^2 m^2", above=0.0,
        source="6.57", stands_for="k_f² d3⁴", symmetry={TRAVEL: 2.0, FORCE: 2.0},
        plausible=(1e-8, 1e4))]
    Z5: Annotated[float, Definition("arm of the spool", "m", above=0.0, source="6.57",
        stands_for="d1", symmetry={TRAVEL: 1.0}, plausible=(1e-6, 1.0))]
    Z6: Annotated[float, Definition("piston motion against oil stiffness", "1", lower=0.0,
        source="6.67", stands_for="A_s² B/(k_r V)", plausible=(0.0, 1e6))]
    Z7: Annotated[float, Definition("leakage around the stroking piston", "1/s", lower=0.0,
        source="6.64", stands_for="K_L B/V", switch="leaky", plausible=(0.0, 1e6))]
    Z8: Annotated[float, Definition("flow gain of the valve", "sqrt(Pa)/(m s)", above=0.0,
        source="6.67", stands_for="C_o B/V",
        symmetry={PRESSURE: 0.5, TRAVEL: -1.0, MOTION: 1.0}, plausible=(10.0, 1e11))]
    Z9: Annotated[float, Definition("supply pressure less static pressure", "Pa", above=0.0,
        source="6.67", stands_for="ΔP − P0", symmetry={PRESSURE: 1.0, ZERO: 1.0},
        plausible=(1e4, 1e9))]
    Z10: Annotated[float, Definition("swash plate angle to shaft speed", "1/s", above=0.0,
        source="6.69", stands_for="K_mf C_q", plausible=(1e-6, 1e6))]
    Z11: Annotated[float, Definition("speed lost to static load", "rad/s", source="6.69",
        stands_for="K_mL C_g", plausible=(0.0, 1e4))]
    Z12: Annotated[float, Definition("speed lost to accelerating load", "1", source="6.69",
        stands_for="K_mL K_mf C_i C_q", switch="loaded", plausible=(0.0, 1e4))]
    Z13_plus: Annotated[float, Definition("stop of the swash plate", "rad", above=0.0, upper=pi / 2,
        source="8.9", needs="the swash plate at its stop", plausible=(1e-3, pi / 2))]
    Z13_minus: Annotated[float, MINUS]
    Z14: Annotated[float, Definition("stroke of the spool", "m", above=0.0, can_be_off=True,
        source="6.36", symmetry={TRAVEL: 1.0}, needs="the spool at its stop",
        plausible=(1e-8, 1.0))]
    Z15: Annotated[float, Definition("largest stroking pressure", "Pa", above=0.0, can_be_off=True,
        source="6.2.5", symmetry={PRESSURE: 1.0}, needs="the relief valve open",
        plausible=(1e4, 1e10))]
    Z16_plus: Annotated[float, Definition("opening at which the orifice limits the flow", "m",
        above=0.0, can_be_off=True, source="6.71", symmetry={TRAVEL: 1.0},
        needs="an orifice limiting the flow", plausible=(1e-8, 0.1))]
    Z16_minus: Annotated[float, MINUS]
    Z17: Annotated[float, Definition("dead zone of the solenoids", "A", lower=0.0, source="6.61",
        needs=DRIVEN, plausible=(0.0, 100.0))]
    Z18: Annotated[float, Definition("neutral offset of the spool", "m", source="6.57",
        symmetry={TRAVEL: 1.0}, plausible=(0.0, 0.1))]
    Z19_plus: Annotated[float, Definition("solenoid force, linear", "N/A", source="6.61",
        symmetry={FORCE: 1.0}, needs=DRIVEN, plausible=(0.0, 1e6))]
    Z19_minus: Annotated[float, MINUS]
    Z20_plus: Annotated[float, Definition("solenoid force, quadratic", "N/A^2", source="6.61",
        symmetry={FORCE: 1.0}, needs=DRIVEN, plausible=(0.0, 1e8))]
    Z20_minus: Annotated[float, MINUS]
    Z21_plus: Annotated[float, Definition("solenoid force, cubic", "N/A^3", source="6.61",
        symmetry={FORCE: 1.0}, needs=DRIVEN, plausible=(0.0, 1e10))]
    Z21_minus: Annotated[float, MINUS]
    Z22_plus: Annotated[float, Definition("solenoid force, quartic", "N/A^4", source="6.61",
        symmetry={FORCE: 1.0}, needs=DRIVEN, plausible=(0.0, 1e12))]
    Z22_minus: Annotated[float, MINUS]
    spool_friction: Annotated[float, Definition("friction of spool and solenoid", "N", lower=0.0,
        stands_for="F_s", default=0.0, switch="friction", least=1e-07, plausible=(0.0, 1e4))] = 0.0
    spool_presliding: Annotated[float, Definition("travel over which that friction builds up", "m",
        lower=0.0, stands_for="x_s", default=0.0, least=1e-10, plausible=(0.0, 0.1))] = 0.0
    dither_time: Annotated[float, Definition("time constant with which dither frees the spool", "s",
        above=0.0, can_be_off=True, stands_for="T", default=inf, least=1e-06,
        plausible=(1e-6, 1e4))] = inf
    solenoid_hysteresis: Annotated[float, Definition("half-width of the solenoids' hysteresis", "A",
        lower=0.0, stands_for="r", default=0.0, switch="hysteresis", least=1e-08,
        plausible=(0.0, 100.0))] = 0.0
    load_torque: Annotated[float, Definition("static torque of the load at the shaft", "N m",
        stands_for="C_g, positive against positive speed", default=0.0,
        plausible=(0.0, 1e10))] = 0.0
    load_inertia: Annotated[float, Definition("inertia of motor and load at the shaft", "kg m^2",
        lower=0.0, stands_for="C_i, J", default=0.0, least=1e-06, plausible=(0.0, 1e12))] = 0.0
    motor_leakage: Annotated[float, Definition("speed lost to leakage for a torque", "rad/(s N m)",
        lower=0.0, stands_for="K_mL", default=0.0, switch="leakage", least=1e-15,
        plausible=(0.0, 1.0))] = 0.0
    cam_ripple: Annotated[float, Definition("variation of the motor's displacement without load",
        "1", lower=0.0, upper=1.0, stands_for="ε0", default=0.0, switch="ripple",
        least=1e-09, plausible=(0.0, 1.0))] = 0.0
    cam_ripple_per_torque: Annotated[float, Definition("growth of that variation with the load",
        "1/(N m)", lower=0.0, stands_for="ε1", default=0.0, switch="ripple", least=1e-15,
        plausible=(0.0, 1.0))] = 0.0
    cam_cycles: Annotated[float, Definition("cycles of the cam ring in a turn", "1", above=0.0,
        stands_for="n", default=5.5, least=1e-06, plausible=(1e-2, 1e4))] = 5.5
    cam_phase: Annotated[float, Definition("phase of the cam ring at the start", "rad",
        stands_for="ψ", default=0.0, plausible=(0.0, 100.0))] = 0.0
    swash_damping: Annotated[float, Definition("time constant of the swash plate's damping", "s",
        lower=0.0, stands_for="T", default=0.0, switch="damping", least=1e-09,
        plausible=(0.0, 100.0))] = 0.0
    line_stiffness: Annotated[float, Definition("stiffness of the line's oil at the shaft",
        "N m/rad", lower=0.0, stands_for="k", default=0.0, switch="line", least=0.001,
        plausible=(0.0, 1e15))] = 0.0
    motor_constant: Annotated[float, Definition("motor speed for a flow", "rad/m^3", lower=0.0,
        stands_for="K_mf", default=0.0, least=1e-06, plausible=(1e-3, 1e8))] = 0.0
    pump_speed: Annotated[float, Definition("speed of the prime mover, relative to that of Z10",
        "1", above=0.0, default=1.0, plausible=(0.0, 10.0))] = 1.0
    solenoid_delay: Annotated[float, Definition("delay from current to spool", "s", lower=0.0,
        upper=10.0, stands_for="T_d", default=0.0, switch="late", least=1e-06,
        plausible=(0.0, 10.0))] = 0.0
    solenoid_lag: Annotated[float, Definition("time constant of the lag from current to spool", "s",
        lower=0.0, stands_for="T_l", default=0.0, switch="late", least=1e-06,
        plausible=(0.0, 10.0))] = 0.0
    # fmt: on


class Solenoids(NamedTuple):
    """Parameters of the solenoids by themselves, those of `Pump` by the same names."""

    Z17: float
    Z19_plus: float
    Z19_minus: float
    Z20_plus: float
    Z20_minus: float
    Z21_plus: float
    Z21_minus: float
    Z22_plus: float
    Z22_minus: float


class Stroking(NamedTuple):
    """Parameters of the stroking piston at a sample, those of `Pump` by the same names."""

    Z6: float
    """0 if the plate does not move with the pressure. [1]"""
    Z7: float
    """Leakage around the piston. [1/s]"""
    Z8: float
    """Flow gain of the valve. [√Pa/(m s)]"""
    Z9: float
    """Supply pressure less static pressure, or the supply pressure that was measured. [Pa]"""


class PumpOptions(NamedTuple):
    """Forms of the pump."""

    symmetric: Flag = OFF  # Root √((Z9 - sgn(x)δP)/2) in place of the published √((Z9 - δP)/2).
    leaky: Flag = OFF  # Z7 counts: the pressure is integrated by Runge-Kutta.
    loaded: Flag = OFF  # Z12 counts: the speed depends on the swash plate's rate.
    steep: Flag = OFF  # A stop of the swash plate lies beyond 22.5°.
    friction: Flag = OFF  # Friction of spool and solenoid, see `held_back`.
    late: Flag = OFF  # Delay and lag of the solenoids, see `lagged_current`.
    hysteresis: Flag = OFF  # Hysteresis of the solenoids, see `magnetising_current`.
    ripple: Flag = OFF  # Ripple of the cam ring, see `rippled_angle`.
    damping: Flag = OFF  # Damping of the swash plate, see `plate_follows`.
    leakage: Flag = OFF  # Leakage of the motor under load, see `load_leakage`.
    line: Flag = OFF  # Line and inertia, see `line_step`.


PUBLISHED_FORMS = frozenset({"symmetric", "leaky", "loaded", "steep"})
"""Options that choose a form of Kruse's equations; every other option is a refinement of them."""


class PressureLimits(NamedTuple):
    """Pressures at which the stroking pressure is limited. [Pa]"""

    lower_stop: float  # At which the swash plate reaches its lower stop.
    upper_stop: float  # At which the swash plate reaches its upper stop.
    lower: float
    upper: float  # The same within ±Z15: the pressure never leaves them.


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
def solenoid_force(current: float, p: Pump | Solenoids) -> float:
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

    Parameters
    ----------
    force : float
        Force F of the solenoids. [N]
    arm_sine : float
        Sine of the angle α of the feedback arm. [1]
    p : Pump
        Parameters; Z4, Z5 and Z18 count.

    Returns
    -------
    float
        Displacement x. [m]

    Notes
    -----
    x = Z5 tan(φ - α) + Z18 with sin φ = Z5 F/√Z4; Kruse eq. 6.57 in closed form (erratum 21). Valid
    for sin φ and sin α between -1 and 1; the caller checks. The first of the two equal forms keeps
    the square root out of the denominator, so that root and division overlap: it makes a whole
    march 14 % faster. It is singular if φ + α = 90°, far from any real spool; there the second
    takes over.
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
def pressure_limits(p: Pump) -> PressureLimits:
    """Pressures at which the swash plate stops, and the same within ±Z15. [Pa]

    The stops are (∓tan Z13 + Z2)/Z1. δP never leaves the other two, so nothing winds up at a stop.
    """
    lower_stop = (p.Z2 - tan(p.Z13_minus)) / p.Z1  # δP at which the plate meets its stop. [Pa]
    upper_stop = (p.Z2 + tan(p.Z13_plus)) / p.Z1  # δP at which the plate meets its stop. [Pa]
    return PressureLimits(lower_stop, upper_stop, max(-p.Z15, lower_stop), min(p.Z15, upper_stop))


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
def pressure_rate(pressure: float, opening: float, p: Stroking, symmetric: Flag) -> float:
    """Rate of the stroking pressure δP under the opening x_eff [m]. [Pa/s]

    Kruse eq. 6.67 with the leakage of eq. 6.64.
    """
    head, _ = flow_head(pressure, opening, p.Z9, symmetric)
    return (p.Z8 * head_root(head) * opening - p.Z7 * pressure) / (1.0 + p.Z6)


@equation
def pumped(pressure: float, opening: float, gain: float, root: float, sign: float) -> float:
    """Pressure after a step in which the head lasts, σ (Z9 - 2 (r - σ g x)²). [Pa]

    r = √head, g = Z8 h/(4 (1 + Z6)). Multiplied out: no cancellation, and fewer operations in line.
    """
    return (pressure + (4.0 * gain * root) * opening) - (2.0 * sign * gain * gain) * (
        opening * opening
    )


@equation
def tight_step(pressure: float, opening: float, p: Stroking, h: float, symmetric: Flag) -> float:
    """Pressure one step later without leakage, integrated exactly at constant opening. [Pa]

    Parameters
    ----------
    pressure : float
        Stroking pressure δP. [Pa]
    opening : float
        Effective opening x_eff of the valve. [m]
    p : Stroking
        Parameters; Z7 counts as zero, it is there for the derivative by it.
    h : float
        Length of the step. [s]
    symmetric : flag
        Symmetric form of the root, see `PumpOptions`; None is the published form.

    Returns
    -------
    float
        Stroking pressure at the end of the step. [Pa]

    Notes
    -----
    With r = √((Z9 - σδP)/2) the equation reads r' = -σ Z8 x_eff / (4 (1 + Z6)), so that δP is a
    parabola in time until the head is used up.
    """
    head, sign = flow_head(pressure, opening, p.Z9, symmetric)
    gain = 0.25 * p.Z8 * h / (1.0 + p.Z6)
    r = sqrt(head)
    return sign * p.Z9 if sign * gain * opening > r else pumped(pressure, opening, gain, r, sign)


@declared(tight_step)
def _tight_step(
    pressure: float, opening: float, p: Stroking, h: float, symmetric: Flag
) -> tuple[float, float, float, float, float, float, float]:
    """Partial derivatives of the pressure after one step of a machine without leakage.

    In this order by: pressure δP, opening x_eff, Z6, Z7, Z8, Z9, step h. With the root
    r = √((Z9 - σδP)/2), which is r_end = r - σ g x_eff after the step, and the gain
    g = Z8 h/(4 (1 + Z6)), the pressure is σ (Z9 - 2 r_end²).

    Z7 is 0 here, but the derivative by it is not: the pressure that leakage takes, at its rate
    along the parabola, is carried to the end of the step and integrated by the trapezoidal rule.
    """
    head, sign = flow_head(pressure, opening, p.Z9, symmetric)
    root = sqrt(head)
    mobility = 1.0 / (1.0 + p.Z6)
    gain = 0.25 * p.Z8 * h / (1.0 + p.Z6)
    if sign * gain * opening > root:
        # the head is used up within the step: the pressure is σ Z9
        return 0.0, 0.0, 0.0, 0.0, 0.0, sign, 0.0
    root_by_head = 0.5 / root if head > 0.0 else 0.0
    root_at_end = root - sign * gain * opening
    pressure_by_gain = 4.0 * opening * root_at_end
    pressure_by_root = 4.0 * gain * opening
    carried_to_end = root_at_end * (2.0 * root_by_head)
    pressure_at_end = pumped(pressure, opening, gain, root, sign)
    # twice the mean of the pressures at both ends
    leaking_pressure = pressure * carried_to_end + pressure_at_end
    return (
        1.0 - sign * pressure_by_root * (0.5 * root_by_head),
        4.0 * gain * root_at_end,
        -pressure_by_gain * (0.25 * p.Z8 * h * (mobility * mobility)),
        -0.5 * h * mobility * leaking_pressure,
        pressure_by_gain * (0.25 * h * mobility),
        pressure_by_root * (0.5 * root_by_head),
        pressure_by_gain * (0.25 * p.Z8 * mobility),
    )


@equation
def leaky_step(pressure: float, opening: float, p: Stroking, h: float, symmetric: Flag) -> float:
    """Pressure one step later with leakage: Runge-Kutta of fourth order, opening constant. [Pa]"""
    half = 0.5 * h
    k1 = pressure_rate(pressure, opening, p, symmetric)
    k2 = pressure_rate(pressure + half * k1, opening, p, symmetric)
    k3 = pressure_rate(pressure + half * k2, opening, p, symmetric)
    k4 = pressure_rate(pressure + h * k3, opening, p, symmetric)
    return pressure + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)


@equation
def plate_motion(pressure: float, p: Pump) -> float:
    """Z6 while the swash plate can move, 0 while it rests on a stop."""
    limits = pressure_limits(p)
    on_stop = pressure >= limits.upper_stop or pressure <= limits.lower_stop
    return 0.0 if on_stop else p.Z6


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
def steep_stops(p: Pump) -> bool:
    """Whether a stop of the swash plate lies beyond 22.5°."""
    return tan(max(p.Z13_plus, p.Z13_minus)) >= TAN_22_5


@equation
def swash_rate(tangent: float, pressure_rate: float, Z1: float) -> float:
    """Rate of the swash plate between its stops, Z1 cos²α_sw δP'; Kruse eq. 6.63. [rad/s]"""
    return Z1 * pressure_rate / (1.0 + tangent * tangent)


@equation
def plate_rate(plate: float, pressure_rate: float, p: Pump) -> float:
    """Rate of the swash plate, zero while a stop or the relief valve holds it. [rad/s]

    Of the pressure at which the plate would stand still [Pa] and its rate [Pa/s].
    """
    limits = pressure_limits(p)
    held = plate >= limits.upper or plate <= limits.lower
    return 0.0 if held else swash_rate(swash_tangent(plate, p), pressure_rate, p.Z1)


# --- equilibrium of the spool ---------------------------------------------------------------------


@equation
def closed_pressure(force: float, p: Pump) -> float:
    """δP at which the spool closes, held within the limits.

    Without leakage sin α = sin(φ + atan(Z18/Z5)), so δP = (sin α/Z3 + Z2)/Z1. [Pa]
    """
    a = min(max(moment_sine(force, p), -1.0), 1.0)
    angle = min(max(asin(a) + atan(p.Z18 / p.Z5), -0.5 * pi), 0.5 * pi)
    closed = (sin(angle) / p.Z3 + p.Z2) / p.Z1
    limits = pressure_limits(p)
    return min(max(closed, limits.lower), limits.upper)


@equation
def leaked_pressure(pressure: float, Z9: float, p: Pump, symmetric: Flag) -> float:
    """What leakage takes from the pressure at which the spool closes. [Pa]

    The spool opens by x = Z7 δP/(Z8 √head), and x falls by Z1 Z3 (Z5² + Z18²)/(Z5 cos α) for each
    pascal: the first order, which is all that the derivative at Z7 = 0 needs.
    """
    head, _ = flow_head(pressure, pressure, Z9, symmetric)
    limits = pressure_limits(p)
    if not limits.lower < pressure < limits.upper or head <= 0.0:
        return 0.0
    s = arm_sine(pressure, p)
    stiffness = p.Z1 * p.Z3 * (p.Z5 * p.Z5 + p.Z18 * p.Z18) / (p.Z5 * sqrt(1.0 - s * s))
    return p.Z7 * pressure / (p.Z8 * sqrt(head) * stiffness)


@equation
def pressure_gain(pressure: float, force: float, Z9: float, p: Pump, options: PumpOptions) -> float:
    """Rate of the stroking pressure under a force; it falls with the pressure. [Pa/s]"""
    opening = orifice_opening(spool_balance(force, arm_sine(pressure, p), p), p)
    return pressure_rate(pressure, opening, Stroking(p.Z6, p.Z7, p.Z8, Z9), options.symmetric)
