"""The march with refinements: pump, line and motor over a signed current.

The card is not refined: its currents are those of the plain march. With every refinement off the
pressure and the speed are the plain march's to the last bit.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.physics.cam_ripple import rippled_angle
from swashplate.physics.component import component
from swashplate.physics.hysteresis import magnetising_current
from swashplate.physics.leakage import stiff_line_torque
from swashplate.physics.motor import load_leakage, shaft_speed
from swashplate.physics.motor_pressure import motor_pressure_drop
from swashplate.physics.spool import orifice_opening, stopped_spool
from swashplate.physics.stiction import held_back
from swashplate.physics.stroker import leaky_step, tight_step
from swashplate.physics.swash import swash_angle, swash_rate, swash_tangent
from swashplate.physics.swash_damping import plate_follows, plate_pressure_rate
from swashplate.physics.transmission_line import line_step
from swashplate.simulation.chain import (
    moment_squared,
    plate_motion,
    pump_force,
    pump_spool,
    pump_swash_rate,
)
from swashplate.simulation.compilation import kernel
from swashplate.simulation.constants import Pump

Array = NDArray[np.float64]


class Refined(NamedTuple):
    """What the march needs to know of the refinements; 0 is off."""

    stiction_width: float
    """Distance by which friction can hold the spool back. [m]"""
    presliding: float
    """Travel of the spool over which it builds up. [m]"""
    dither_factor: float
    """What dither leaves of it in a step."""
    solenoid_hysteresis: float
    ripple_depth: float
    """Variation of the motor's displacement under the load. [1]"""
    cam_cycles: float
    cam_phase: float
    swash_damping: float
    damping_factor: float
    """What a step leaves of the plate's lag."""
    line_stiffness: float
    motor_leakage: float
    load_torque: float
    load_inertia: float
    motor_constant: float


class RefinedSignals(NamedTuple):
    """What the march leaves on its grid, (n,) arrays."""

    current: Array
    """Current that the force belongs to, behind the hysteresis. [A]"""
    force: Array
    """Net force of both solenoids. [N]"""
    position: Array
    """Displacement of the spool before its stop. [m]"""
    pressure: Array
    """δP. [Pa]"""
    angle: Array
    """α_sw. [rad]"""
    speed: Array
    """Ω. [rad/s]"""
    torque: Array
    """Torque of the motor. [N m]"""
    pressure_drop: Array
    """Over the motor, 0 where its constant is not known. [Pa]"""


(HELD, PRESSURE, PLATE, POSITION, DEFLECTION, TORQUE, SPEED, FLOW_SPEED, TURNED, BEGUN) = range(10)


def rest_state(current: float, pressure: float, refined: Refined) -> Array:
    """What the march remembers from sample to sample, at the start.

    Parameters
    ----------
    current : float
        Magnetising current. [A]
    pressure : float
        δP. [Pa]
    refined : Refined
        The load, which the line bears; friction holds nothing back and the plate stands still.
    """
    state = np.zeros(10)
    state[HELD], state[PRESSURE], state[PLATE] = current, pressure, pressure
    state[TORQUE] = refined.load_torque
    return state


@component
def spool_at(
    balance: float, before: float, deflection: float, pump: Pump, refined: Refined
) -> tuple[float, float]:
    """Displacement of the spool before its stop [m], and what friction holds it back by [m]."""
    if refined.stiction_width == 0.0:
        return balance, 0.0
    stopped = stopped_spool(balance, pump.Z14)
    held = held_back(
        deflection,
        stopped,
        before,
        refined.stiction_width,
        refined.presliding,
        refined.dither_factor,
    )
    return stopped - held, held


@component
def plate_rate(
    pressure: float, plate: float, opening: float, pump: Pump, refined: Refined
) -> float:
    """Rate of the swash plate, zero at a stop. [rad/s]"""
    if refined.swash_damping == 0.0:
        return pump_swash_rate(pressure, opening, pump)
    rate = plate_pressure_rate(pressure, plate, refined.swash_damping)
    held = plate >= pump.upper or plate <= pump.lower
    return 0.0 if held else swash_rate(swash_tangent(plate, pump.Z1, pump.Z2), rate, pump.Z1)


@component
def pressures_step(
    pressure: float, plate: float, opening: float, pump: Pump, refined: Refined, step: float
) -> tuple[float, float]:
    """Stroking pressure, and that at which the plate would stand still, one step later. [Pa]"""
    damped = refined.swash_damping > 0.0
    # a damped plate takes its oil as it turns, not as the pressure rises
    Z6 = 0.0 if damped else plate_motion(pressure, pump)
    if pump.leaky is None:
        free = tight_step(pressure, opening, Z6, pump.Z8, pump.Z9, step, pump.symmetric)
    else:
        free = leaky_step(pressure, opening, Z6, pump.Z7, pump.Z8, pump.Z9, step, pump.symmetric)
    follower = free
    if damped:
        free, follower = plate_follows(free, plate, pump.Z6, refined.damping_factor)
    following = min(max(free, pump.lower), pump.upper)
    return following, (min(max(follower, pump.lower), pump.upper) if damped else following)


@kernel
def march_refined(
    current: Array,
    pump: Pump,
    refined: Refined,
    step: float,
    state: Array,
    signals: RefinedSignals,
) -> float:
    """March pump, line and motor over a signed current.

    Parameters
    ----------
    current : (n,) array
        Of the card. [A]
    pump, refined : Pump, Refined
        The drive.
    step : float
        h. [s]
    state : (10,) array
        See `rest_state`; advanced in place, so that a march can go on.
    signals : RefinedSignals
        Filled.

    Returns
    -------
    float
        Largest sin²φ met. From 1 on the outputs mean nothing, and the caller must say so.
    """
    held, p, plate = state[HELD], state[PRESSURE], state[PLATE]
    position, deflection = state[POSITION], state[DEFLECTION]
    torque, speed, flow_speed = state[TORQUE], state[SPEED], state[FLOW_SPEED]
    turned = state[TURNED]
    first = state[BEGUN] == 0.0
    worst = 0.0
    for n in range(current.size):
        held = magnetising_current(current[n], held, refined.solenoid_hysteresis)
        worst = max(worst, moment_squared(held, pump))
        force = pump_force(held, pump)
        balance = pump_spool(force, plate, pump)
        if first:
            position = stopped_spool(balance, pump.Z14)
        position, deflection = spool_at(balance, position, deflection, pump, refined)
        opening = orifice_opening(position, pump.Z14, pump.Z16_plus, pump.Z16_minus)

        tangent = swash_tangent(plate, pump.Z1, pump.Z2)
        angle = swash_angle(tangent, pump.Z13_plus, pump.Z13_minus, pump.steep)
        rate = plate_rate(p, plate, opening, pump, refined)
        leakage = 0.0
        if pump.loaded is not None:
            leakage = load_leakage(tangent, rate, pump.Z12)
        # the shaft's angle at this sample, as far as its speed so far tells
        ahead = turned + step * speed
        effective = rippled_angle(
            angle, ahead, refined.ripple_depth, refined.cam_cycles, refined.cam_phase
        )
        last_flow, last_speed = flow_speed, speed
        flow_speed = shaft_speed(effective, leakage, pump.Z10, pump.Z11)
        if refined.line_stiffness == 0.0:
            speed = flow_speed
            torque = stiff_line_torque(
                tangent, rate, refined.load_torque, refined.load_inertia, pump.Z10
            )
        elif first:
            speed = flow_speed - refined.motor_leakage * torque
        else:
            torque, speed = line_step(
                torque,
                speed,
                0.5 * (last_flow + flow_speed),
                refined.load_torque,
                refined.line_stiffness,
                refined.motor_leakage,
                refined.load_inertia,
                step,
            )
        if not first:
            turned = turned + 0.5 * step * (last_speed + speed)
        first = False

        signals.current[n] = held
        signals.force[n] = force
        signals.position[n] = position
        signals.pressure[n] = p
        signals.angle[n] = angle
        signals.speed[n] = speed
        signals.torque[n] = torque
        signals.pressure_drop[n] = motor_pressure_drop(torque, refined.motor_constant)
        p, plate = pressures_step(p, plate, opening, pump, refined, step)
    state[HELD], state[PRESSURE], state[PLATE] = held, p, plate
    state[POSITION], state[DEFLECTION] = position, deflection
    state[TORQUE], state[SPEED], state[FLOW_SPEED] = torque, speed, flow_speed
    state[TURNED] = turned
    state[BEGUN] = 0.0 if first else 1.0
    return worst
