"""Pump and motor: solenoid current to shaft speed (Kruse 2001, eqs. 6.55-6.71, 8.9).

The pump's displacement control (`swashplate.models.displacement_control`) sets the angle of the
swash plate, and with it the flow to the motor. The refinements (`swashplate.models.refinements`)
stand in the same sample and the same step; an option that is off leaves nothing of them.
"""

from math import sqrt
from typing import Annotated, NamedTuple

from swashplate.machine import Definition, Model, Tap, equation, root
from swashplate.models.amplifier import LONGEST_STEP
from swashplate.models.displacement_control import (
    Pump,
    PumpOptions,
    Stroking,
    arm_sine,
    closed_pressure,
    leaked_pressure,
    leaky_step,
    moment_sine,
    orifice_opening,
    plate_motion,
    plate_rate,
    pressure_gain,
    pressure_limits,
    pressure_rate,
    solenoid_force,
    spool_balance,
    steep_stops,
    stopped_spool,
    swash_angle,
    swash_tangent,
    tight_step,
)
from swashplate.models.refinements import (
    damping_factor,
    dither_factor,
    friction_width,
    held_back,
    lagged_current,
    lagged_current_rate,
    line_rates,
    line_step,
    load_leakage,
    magnetising_current,
    motor_pressure_drop,
    plate_follows,
    plate_pressure_rate,
    rippled_angle,
    stiff_line_torque,
    unloaded_leakage,
)

# Ranges lie beyond any machine: a sample outside is in another unit, or no measurement. What is
# plausible is the largest size in a record.
PumpSpeed = Annotated[
    float,
    Definition(
        "speed of the prime mover, relative to that of Z10",
        "1",
        lower=0.0,
        upper=10.0,
        plausible=(0.0, 10.0),
    ),
]
LoadTorque = Annotated[
    float,
    Definition(
        "static torque of the load, positive against positive speed",
        "N m",
        lower=-1e12,
        upper=1e12,
        plausible=(0.0, 1e10),
    ),
]
SupplyPressure = Annotated[
    float,
    Definition(
        "supply pressure less static pressure",
        "Pa",
        lower=1.0,
        upper=1e9,
        plausible=(1e4, 1e9),
    ),
]


class PumpInputs(NamedTuple):
    """What drives the pump at a sample; the parameter's value if nothing was measured."""

    current: float  # Signed, that of the positive channel less that of the negative one. [A]
    pump_speed: PumpSpeed  # Speed of the prime mover, relative to that of Z10. [1]
    load_torque: LoadTorque  # C_g of gravity at the shaft, positive against positive speed. [N m]
    supply_pressure: SupplyPressure  # Supply pressure less static pressure, in place of Z9. [Pa]
    delayed_current: float  # The same current T_d ago (lateness). [A]


class PumpState(NamedTuple):
    """What the pump remembers from sample to sample.

    What belongs to an option is kept without it, too, so that the option can be switched on in a
    running drive; only the shaft's angle is 0 without ripple.
    """

    pressure: float  # δP at this sample. [Pa]
    plate_pressure: float = 0.0  # At which the plate would stand still now (damping). [Pa]
    lagged_current: float = 0.0  # That acted on the spool one sample earlier (lateness). [A]
    delayed_current: float = 0.0  # Of the input, one sample earlier (lateness). [A]
    magnetising_current: float = 0.0  # One sample earlier (hysteresis). [A]
    spool: float = 0.0  # Displacement of the spool one sample earlier (friction). [m]
    deflection: float = 0.0  # Distance by which friction held it back then (friction). [m]
    torque: float = 0.0  # Torque of the motor one sample earlier (line). [N m]
    speed: float = 0.0  # Speed of the shaft one sample earlier (line, ripple). [rad/s]
    flow_speed: float = 0.0  # Speed that the flow would have given a stiff line then. [rad/s]
    load_torque: float = 0.0  # Torque of the load one sample earlier (line). [N m]
    shaft_angle: float = 0.0  # Since the start, one sample earlier (ripple). [rad]
    initialised: float = 0.0  # 0 at the first sample, 1 afterwards (friction, line, ripple).


class PumpSignals(NamedTuple):
    """What is known of the pump at a sample."""

    lagged_current: float  # Current that acts on the spool, behind delay and lag. [A]
    delayed_current: float  # Current behind the delay alone. [A]
    magnetising_current: float  # Current that the force belongs to, behind the hysteresis. [A]
    solenoid_force: Annotated[float, Definition("net force of both solenoids on the spool", "N")]
    spool_free: float  # Displacement of the spool before its stop. [m]
    spool_position: Annotated[
        float, Definition("displacement of the spool, within its stroke", "m")
    ]
    spool_deflection: float  # Distance by which friction holds it back. [m]
    orifice_opening: Annotated[
        float,
        Definition("effective opening, what the orifices leave of the displacement", "m"),
    ]
    stroker_pressure: Annotated[float, Definition("stroking pressure about its equilibrium", "Pa")]
    swash_angle: Annotated[float, Definition("angle of the swash plate", "rad")]
    swash_rate: float  # Rate of the swash plate, zero at a stop. [rad/s]
    flow_speed: float  # Speed that the pump's flow would give a stiff line. [rad/s]
    shaft_speed: Annotated[float, Definition("speed of the shaft, of the turret for slew", "rad/s")]
    shaft_angle: float  # Since the start, as the ripple needs it; 0 without. [rad]
    motor_torque: Annotated[
        float,
        Definition("torque of the motor, positive if it drives towards positive speed", "N m"),
    ]
    motor_pressure_drop: Annotated[
        float,
        Definition("pressure drop over the motor, 0 if motor_constant is not known", "Pa"),
    ]


class PumpLimits(NamedTuple):
    """Limits of the pump that can act at a sample."""

    dead_zone: bool  # The current is within the solenoids' dead zone: no force.
    orifice: bool  # The in-line orifice limits the flow, the plate moves: acceleration limit.
    spool: bool  # The spool is at its stop.
    swash_stop: bool  # The swash plate is at a stop: the speed limit.
    relief: bool  # The relief valve holds the stroking pressure at ±Z15.


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
    options: PumpOptions,
) -> float:
    """Speed that the pump's flow gives a stiff line, less what leaks there. [rad/s]

    A prime mover at another speed pumps in proportion: Z10 and Z12 hold its flow. The rate of its
    speed is taken as small.
    """
    flow_gain = p.Z10 * inputs.pump_speed
    lost_to_load = p.Z11
    lost = 0.0
    if options.leakage is not None and options.line is None:
        # a load that hangs on the hoist slows hoisting and speeds lowering up (eq. 6.70)
        lost_to_load = p.Z11 + p.motor_leakage * inputs.load_torque
        # Speed lost for an acceleration of the plate, Z12 and that of the motor's leakage. [1]
        inertial_leakage = p.Z12 + p.motor_leakage * p.load_inertia * p.Z10
        leakage_now = inertial_leakage * inputs.pump_speed
        lost = load_leakage(tangent, rate, leakage_now)
    elif options.loaded is not None:
        leakage_now = p.Z12 * inputs.pump_speed
        lost = load_leakage(tangent, rate, leakage_now)
    else:
        lost = unloaded_leakage(tangent, rate * inputs.pump_speed, p.Z12)
    return shaft_speed(angle, lost, flow_gain, lost_to_load)


# --- the pump ------------------------------------------------------------------------------------


@equation
def pump_sample(
    state: PumpState, inputs: PumpInputs, p: Pump, h: float, options: PumpOptions
) -> PumpSignals:
    """Everything that is known of the pump at a sample.

    The order is the chain's: delay and lag, hysteresis, force, balance of the spool, friction,
    opening, rate of the plate, leakage, ripple, line.
    """
    first_sample = state.initialised == 0.0
    delayed = inputs.current
    current = inputs.current
    if options.late is not None:
        delayed = inputs.delayed_current
        current = lagged_current(
            delayed, state.lagged_current, state.delayed_current, p.solenoid_lag, h
        )
    lagged = current
    if options.hysteresis is not None:
        current = magnetising_current(current, state.magnetising_current, p.solenoid_hysteresis)
    force = solenoid_force(current, p)

    plate = state.pressure if options.damping is None else state.plate_pressure
    spool = spool_balance(force, arm_sine(plate, p), p)
    deflection = 0.0
    if options.friction is not None:
        balance = stopped_spool(spool, p)
        before = balance if first_sample else state.spool
        deflection = held_back(
            state.deflection,
            balance,
            before,
            friction_width(p.spool_friction, p.Z4, p.Z5),
            p.spool_presliding,
            dither_factor(p.dither_time, h),
        )
        spool = balance - deflection
    opening = orifice_opening(spool, p)

    tangent = swash_tangent(plate, p)
    angle = swash_angle(tangent, p, options.steep)
    if options.damping is None:
        stroking = Stroking(p.Z6, p.Z7, p.Z8, inputs.supply_pressure)
        rising = pressure_rate(plate, opening, stroking, options.symmetric)
    else:
        rising = plate_pressure_rate(state.pressure, plate, p.swash_damping)
    rate = plate_rate(plate, rising, p)

    effective = angle
    if options.ripple is not None:
        # the shaft's angle at this sample, as far as its speed so far tells
        ahead = state.shaft_angle + h * state.speed
        depth = p.cam_ripple + p.cam_ripple_per_torque * abs(inputs.load_torque)
        effective = rippled_angle(angle, ahead, depth, p.cam_cycles, p.cam_phase)
    flow = flow_speed(effective, tangent, rate, inputs, p, options)

    if options.line is None:
        speed = flow
        torque = stiff_line_torque(
            tangent, rate, inputs.load_torque, p.load_inertia, p.Z10 * inputs.pump_speed
        )
    elif first_sample:
        torque = inputs.load_torque
        speed = flow - p.motor_leakage * torque
    else:
        torque, speed = line_step(
            state.torque,
            state.speed,
            0.5 * (state.flow_speed + flow),
            0.5 * (state.load_torque + inputs.load_torque),
            p,
            h,
        )
    turned = 0.0
    if options.ripple is not None:
        moved = 0.5 * h * (state.speed + speed)
        turned = state.shaft_angle if first_sample else state.shaft_angle + moved

    return PumpSignals(
        lagged_current=lagged,
        delayed_current=delayed,
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
    h: float,
    options: PumpOptions,
) -> PumpState:
    """The pump from a sample to the next."""
    limits = pressure_limits(p)
    opening = signals.orifice_opening
    # a damped plate takes its oil as it turns, not as the pressure rises
    Z6 = plate_motion(state.pressure, p) if options.damping is None else 0.0
    stroking = Stroking(Z6, p.Z7, p.Z8, inputs.supply_pressure)
    if options.leaky is None:
        free_pressure = tight_step(state.pressure, opening, stroking, h, options.symmetric)
    else:
        free_pressure = leaky_step(state.pressure, opening, stroking, h, options.symmetric)
    plate_pressure = free_pressure
    if options.damping is not None:
        lag = damping_factor(p.swash_damping, p.Z6, h)
        free_pressure, plate_pressure = plate_follows(
            free_pressure, state.plate_pressure, p.Z6, lag
        )
    return PumpState(
        pressure=min(max(free_pressure, limits.lower), limits.upper),
        plate_pressure=min(max(plate_pressure, limits.lower), limits.upper),
        lagged_current=signals.lagged_current,
        delayed_current=signals.delayed_current,
        magnetising_current=signals.magnetising_current,
        spool=signals.spool_free,
        deflection=signals.spool_deflection,
        torque=signals.motor_torque,
        speed=signals.shaft_speed,
        flow_speed=signals.flow_speed,
        load_torque=inputs.load_torque,
        shaft_angle=signals.shaft_angle,
        initialised=1.0,
    )


@equation
def pump_rates(
    state: PumpState,
    signals: PumpSignals,
    inputs: PumpInputs,
    p: Pump,
    options: PumpOptions,
) -> PumpState:
    """Rates of the pump's state in continuous time, in place of `pump_step`. [1/s]

    The sample before them has h = 0 and `initialised` = 1, so that the line is at its state and
    friction holds the spool at (w x_b + x_s d)/(x_s + w): by the share of its balance x_b that it
    has moved, and by the state's deflection d, which dither releases.
    """
    Z6 = plate_motion(state.pressure, p) if options.damping is None else 0.0
    stroking = Stroking(Z6, p.Z7, p.Z8, inputs.supply_pressure)
    rising = pressure_rate(state.pressure, signals.orifice_opening, stroking, options.symmetric)
    plate = 0.0
    if options.damping is not None:
        plate = plate_pressure_rate(state.pressure, state.plate_pressure, p.swash_damping)
        rising = rising - p.Z6 * plate
    approaching = 0.0
    if options.late is not None:
        approaching = lagged_current_rate(
            inputs.delayed_current, state.lagged_current, p.solenoid_lag
        )
    released = 0.0
    if options.friction is not None:
        released = -signals.spool_deflection / p.dither_time
    charging = 0.0
    accelerating = 0.0
    if options.line is not None:
        charging, accelerating = line_rates(
            state.torque, state.speed, signals.flow_speed, inputs.load_torque, p
        )
    return PumpState(
        pressure=rising,
        plate_pressure=plate,
        lagged_current=approaching,
        delayed_current=0.0,
        magnetising_current=0.0,
        spool=0.0,
        deflection=released,
        torque=charging,
        speed=accelerating,
        flow_speed=0.0,
        load_torque=0.0,
        shaft_angle=0.0,
        initialised=0.0,
    )


@equation
def standing(pressure: float, current: float, load_torque: float) -> PumpState:
    """State of a pump whose plate stands and whose line bears the load, nothing held back."""
    return PumpState(
        pressure=pressure,
        plate_pressure=pressure,
        lagged_current=current,
        delayed_current=current,
        magnetising_current=current,
        spool=0.0,
        deflection=0.0,
        torque=load_torque,
        speed=0.0,
        flow_speed=0.0,
        load_torque=0.0,
        shaft_angle=0.0,
        initialised=0.0,
    )


@equation
def pump_rest(p: Pump, inputs: PumpInputs) -> PumpState:
    """State of a pump without current: the plate upright at δP = Z2/Z1."""
    return standing(p.Z2 / p.Z1, 0.0, inputs.load_torque)


@equation
def settled_pressure(inputs: PumpInputs, p: Pump, options: PumpOptions) -> float:
    """δP that the pump settles at under a constant current. [Pa]

    Without leakage where the spool closes, which is known in closed form.
    """
    if options.leaky is not None:
        return searched_pressure(inputs, p, options)
    closed = closed_pressure(solenoid_force(inputs.current, p), p)
    return closed - leaked_pressure(closed, inputs.supply_pressure, p, options.symmetric)


@equation
def searched_pressure(inputs: PumpInputs, p: Pump, options: PumpOptions) -> float:
    """δP at which the flow through the spool is what leaks, whatever the equations are. [Pa]

    With leakage there is no closed form, and of equations that stand for the package's none is
    known: see `swashplate.drive.instance.models_of`.
    """
    force = solenoid_force(inputs.current, p)
    limits = pressure_limits(p)
    supply = inputs.supply_pressure
    return root(pressure_gain, limits.lower, limits.upper, force, supply, p, options)


@equation
def pump_settled(inputs: PumpInputs, p: Pump, options: PumpOptions) -> PumpState:
    """State that a pump settles at: the middle of what friction and hysteresis leave open.

    The sample there has the speed that the drive settles at; the cam ring's ripple, which does not
    change the mean of a turn, must be off.
    """
    pressure = settled_pressure(inputs, p, options)
    return standing(pressure, inputs.current, inputs.load_torque)


@equation
def pump_limits(
    state: PumpState,
    signals: PumpSignals,
    inputs: PumpInputs,
    p: Pump,
    options: PumpOptions,
) -> PumpLimits:
    """Limits that act at a sample."""
    lower_stop, upper_stop, lower, upper = pressure_limits(p)
    free = signals.spool_free
    pressure = signals.stroker_pressure
    spool_positive = free > 0.0
    orifice = p.Z16_plus if spool_positive else p.Z16_minus
    at_upper = pressure >= upper
    at_lower = pressure <= lower
    distance = abs(free)
    # against a stop nothing accelerates, however wide the spool is open
    blocked = (at_upper and spool_positive) or (at_lower and free < 0.0)
    on_stop = pressure >= upper_stop or pressure <= lower_stop
    return PumpLimits(
        dead_zone=abs(signals.magnetising_current) <= p.Z17,
        orifice=min(distance, p.Z14) > orifice and not blocked,
        spool=distance > p.Z14,
        swash_stop=on_stop,
        relief=(at_upper and upper < upper_stop) or (at_lower and lower > lower_stop),
    )


@equation
def pump_domain(signals: PumpSignals, inputs: PumpInputs, p: Pump) -> float:
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
    rest=pump_rest,
    settled=pump_settled,
    inputs=PumpInputs,
    taps={"delayed_current": Tap("current", delay="solenoid_delay")},
    defaults={"pump_speed": "pump_speed", "load_torque": "load_torque", "supply_pressure": "Z9"},
    options=PumpOptions,
    limits=pump_limits,
    domain=pump_domain,
    integrals={"shaft_position": "shaft_speed"},
    free_start={"pressure": ("pressure", "plate_pressure")},
    outside=overpowered,
    longest_step=LONGEST_STEP,
    follows={"steep": steep_stops},
)
