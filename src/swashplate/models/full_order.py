"""The drive with five states: spool, oil and swash plate in motion (Kruse 2001, chapter 6).

States are the spool's position and velocity, the stroker pressure, the swash plate's angle and its
rate; the input is the solenoids' current, from the card or given. `swashplate.models.machine` has
the equations of the parts.

Between two samples the machine takes sub-steps, as many as a run is given, of the Störmer-Verlet
scheme (leapfrog): half a step of what has a velocity, a step of the velocities with forces from the
middle, and the other half. Damping is trapezoidal and the pressure's own flow follows the midpoint
rule. It is of second order and stable while the fastest natural frequency times the sub-step is
below 2. Limits are projections: what is beyond a stop is put back on it and stops there.
"""

from math import atan, floor, tan
from typing import NamedTuple

from swashplate.machine import Flag, Model, equation, join, repeated, root
from swashplate.machine.fields import OFF
from swashplate.machine.library import clipped
from swashplate.models.amplifier import card
from swashplate.models.displacement_control import Solenoids, solenoid_force
from swashplate.models.drive import AMMETER, POSITION, source
from swashplate.models.machine import (
    Hydrostat,
    ReliefPressures,
    balanced_spool,
    balanced_tangent,
    fastest_rate,
    feedback_sine,
    holding_pressure,
    load_resistance,
    machine_speed,
    motor_drop,
    oil_pressure_rate,
    piston_speed,
    plate_inertia,
    plate_moment,
    plate_resistance,
    pump_flow,
    relief_pressures,
    spool_acceleration,
    spool_inertia,
    spool_moment,
    spool_resistance,
    static_pressure,
    surplus_flow,
    swash_acceleration,
    valve_flow,
    valve_opening,
)


class Plant(NamedTuple):
    """Parameters of everything behind the card."""

    machine: Hydrostat
    solenoids: Solenoids


class PlantOptions(NamedTuple):
    """Forms of the machine."""

    symmetric: Flag = OFF  # √((ΔP - sgn(x)P)/2) in place of the published root (erratum 13).
    air: Flag = OFF  # The oil has free air in it, see `mixture_modulus`.


class Substeps(NamedTuple):
    """How a run is integrated: the same for all runs that are compared."""

    substeps: float = 0.0  # Sub-steps between two samples; 0 for `enough_substeps`.


class Motion(NamedTuple):
    """The five states."""

    spool_position: float  # x, positive towards more speed. [m]
    spool_velocity: float  # [m/s]
    piston_pressure: float  # Stroker pressure P. [Pa]
    swash_angle: float  # α_sw. [rad]
    swash_rate: float  # [rad/s]


class PlantState(NamedTuple):
    """What the machine remembers from sample to sample."""

    motion: Motion  # One sample earlier.
    current: float  # One sample earlier. [A]
    initialised: float  # 0 at the first sample, 1 from the second on.


class PlantSignals(NamedTuple):
    """What is known of the machine at a sample."""

    solenoid_force: float  # Net force of both solenoids on the spool. [N]
    spool_position: float  # Displacement of the spool. [m]
    spool_velocity: float  # [m/s]
    orifice_opening: float  # What the orifices leave of the spool's displacement. [m]
    valve_flow: float  # Flow through the valve towards the stroking piston. [m³/s]
    piston_pressure: float  # Stroker pressure P. [Pa]
    stroker_pressure: float  # δP = P - P0 about the one that holds the load at rest. [Pa]
    swash_angle: float  # [rad]
    swash_rate: float  # [rad/s]
    shaft_speed: float  # Speed of the shaft, of the turret for slew. [rad/s]
    motor_pressure_drop: float  # P_hi - P_lo across the motor, under load inertia and gravity. [Pa]
    pump_flow: float  # Flow of the pump to the motor. [m³/s]


class Rates(NamedTuple):
    """Rates of the three states whose rate is not itself a state, where no limit holds."""

    velocity: float  # [m/s²]
    pressure: float  # [Pa/s]
    swash_rate: float  # [rad/s²]


# --- in motion -----------------------------------------------------------------------------------


@equation
def free_rates(state: Motion, force: float, p: Hydrostat, options: PlantOptions) -> Rates:
    """Rates where no limit holds; those of position and angle are velocity and swash rate."""
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
def damped(velocity: float, moment: float, resistance: float, inertia: float, h: float) -> float:
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

    step: float  # A sub-step. [s]
    current: float  # At its beginning. [A]
    rise: float  # Of the current in a sub-step. [A]


@equation
def substep(
    state: Motion,
    number: float,
    span: Span,
    relief: ReliefPressures,
    p: Plant,
    options: PlantOptions,
) -> Motion:
    """The five states a sub-step later, see the module's text; sub-steps are counted from 0."""
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
    pressure = clipped(before + half * filling, relief.lower, relief.upper)

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
        clipped(before + h * filling, relief.lower, relief.upper),
        clipped(angle + half * turning, -m.swash_stop_minus, m.swash_stop_plus),
        turning,
    )


@equation
def plant_rates(state: Motion, current: float, p: Plant, options: PlantOptions) -> Motion:
    """Rates of the five states under a signed current [A], where no limit holds. [1/s]"""
    force = solenoid_force(current, p.solenoids)
    rates = free_rates(state, force, p.machine, options)
    return Motion(
        spool_position=state.spool_velocity,
        spool_velocity=rates.velocity,
        piston_pressure=rates.pressure,
        swash_angle=state.swash_rate,
        swash_rate=rates.swash_rate,
    )


# --- the model -----------------------------------------------------------------------------------


@equation
def plant_signals(motion: Motion, current: float, p: Plant, options: PlantOptions) -> PlantSignals:
    """What follows from the five states and the current."""
    m, stroke = p.machine, p.machine.spool_stroke
    velocity = stopped(motion.spool_velocity, motion.spool_position, -stroke, stroke)
    rate = stopped(motion.swash_rate, motion.swash_angle, -m.swash_stop_minus, m.swash_stop_plus)
    return PlantSignals(
        solenoid_force=solenoid_force(current, p.solenoids),
        spool_position=motion.spool_position,
        spool_velocity=velocity,
        orifice_opening=valve_opening(motion.spool_position, m),
        valve_flow=valve_flow(motion.spool_position, motion.piston_pressure, m, options.symmetric),
        piston_pressure=motion.piston_pressure,
        stroker_pressure=motion.piston_pressure - static_pressure(m),
        swash_angle=motion.swash_angle,
        swash_rate=rate,
        shaft_speed=machine_speed(motion.swash_angle, rate, m),
        motor_pressure_drop=motor_drop(rate, m),
        pump_flow=pump_flow(motion.swash_angle, m),
    )


RESOLUTION = 1.0
"""Largest product of a sub-step and the fastest natural frequency."""
STABLE = 2.0
"""The same if the march is not stable any longer."""
LEAST_SUBSTEPS = 8.0
"""Sub-steps a sample that kinks of the flow, at the orifices' limits, are worth."""
MOST_SUBSTEPS = 20_000.0
"""Sub-steps a sample, beyond which the machine is too stiff for the march."""


@equation
def enough_substeps(p: Hydrostat, h: float) -> float:
    """Sub-steps a sample that the fastest mode needs, six a turn, and at least 8."""
    return max(-floor(-fastest_rate(p) * h / RESOLUTION), LEAST_SUBSTEPS)


@equation
def substeps_of(p: Hydrostat, h: float, given: Substeps) -> float:
    """Sub-steps of a sample: those given, else as many as needed."""
    needed = min(enough_substeps(p, h), MOST_SUBSTEPS)
    return given.substeps if given.substeps > 0.0 else needed


@equation
def plant_sample(
    state: PlantState,
    current: float,
    p: Plant,
    h: float,
    options: PlantOptions,
    given: Substeps,
) -> PlantSignals:
    """Everything at a sample under a signed current [A], the sub-steps from the one before done.

    The current of this sample must be known for the straight line to it, so what is remembered is
    one sample old; the first sample has no time before it.
    """
    count = substeps_of(p.machine, h, given)
    rise = (current - state.current) / count
    span = Span(state.initialised * h / count, state.current, rise)
    relief = relief_pressures(p.machine)
    motion = repeated(substep, count, state.motion, span, relief, p, options)
    return plant_signals(motion, current, p, options)


@equation
def plant_step(signals: PlantSignals, current: float) -> PlantState:
    """The machine from a sample to the next."""
    motion = Motion(
        signals.spool_position,
        signals.spool_velocity,
        signals.piston_pressure,
        signals.swash_angle,
        signals.swash_rate,
    )
    return PlantState(motion, current, 1.0)


@equation
def plant_rest(p: Plant) -> PlantState:
    """The plate upright with its load held, and the spool where no current moves it."""
    pressure = static_pressure(p.machine)
    return PlantState(Motion(p.machine.plussing, 0.0, pressure, 0.0, 0.0), 0.0, 0.0)


@equation
def plant_settled(current: float, p: Plant, options: PlantOptions) -> PlantState:
    """Where the machine settles under a constant current."""
    m = p.machine
    force = solenoid_force(current, p.solenoids)
    closed = root(surplus_flow, -m.spool_stroke, m.spool_stroke, force, m, options.symmetric)
    tangent = balanced_tangent(closed, force, m)
    # at a stop of the plate the valve stays open
    position = balanced_spool(force, feedback_sine(tangent, m), m)
    pressure = holding_pressure(tangent, m.motor_constant * m.load_torque, m)
    relief = relief_pressures(m)
    held = min(max(pressure, relief.lower), relief.upper)
    angle = min(max(atan(tangent), -m.swash_stop_minus), m.swash_stop_plus)
    return PlantState(Motion(position, 0.0, held, angle, 0.0), current, 0.0)


@equation
def plant_domain(p: Plant, h: float, given: Substeps) -> float:
    """2 less the fastest rate times a sub-step: above 0 where the scheme is stable. [1]"""
    return STABLE - fastest_rate(p.machine) * h / substeps_of(p.machine, h, given)


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
    rest=plant_rest,
    settled=plant_settled,
    options=PlantOptions,
    given=Substeps,
    domain=plant_domain,
    outside=too_fast,
    outputs=("shaft_speed",),
)
"""Solenoids and machine behind a signed current."""

full_drive = join("full_drive", card, plant, links=AMMETER, integrals=POSITION)
"""The drive with five states behind a voltage."""

full_machine = join("full_machine", source, plant, links=AMMETER, integrals=POSITION)
"""The same without a card, behind a signed current."""

flowing_plant = Model(
    "flowing_plant", parameters=Plant, state=Motion, step=plant_rates, options=PlantOptions
)
"""The machine in continuous time, behind a signed current: rates in place of the step."""
