"""The full-order model: rates of its five states (Kruse 2001, eqs. 6.19, 6.35, 6.51).

The components are those of `spool_mechanism`, `stroker_flow`, `swash_mechanism` and
`motor_pressure`. What holds the states at their limits is left to whoever integrates them.
"""

from math import tan
from typing import NamedTuple

from swashplate.physics.component import component
from swashplate.physics.motor_pressure import load_torque, motor_pressure_drop
from swashplate.physics.spool import orifice_opening
from swashplate.physics.spool_mechanism import (
    spool_acceleration,
    spool_acceleration_partials,
)
from swashplate.physics.stroker_flow import oil_pressure_rate, valve_flow, valve_flow_partials
from swashplate.physics.swash_mechanism import (
    piston_speed,
    piston_speed_partials,
    swash_acceleration,
    swash_acceleration_partials,
)


class Machine(NamedTuple):
    """Physical parameters, ready for compiled code; all SI."""

    spool_arm: float
    spool_mass: float
    arm_inertia: float
    spool_damping: float
    spring_moment: float
    """k_f d3²."""
    arm_ratio: float
    """d4 over the control arm: sin α = arm_ratio tan α_sw."""
    plussing: float
    stroke: float
    opening_plus: float
    opening_minus: float
    valve_gain: float
    supply_pressure: float
    volume: float
    bulk_modulus: float
    leakage: float
    piston_area: float
    swash_arm: float
    plate_inertia: float
    piston_mass: float
    piston_damping: float
    spring_rate: float
    pumping_moment: float
    """A_p d5."""
    motor_constant: float
    flow_gain: float
    motor_leakage: float
    load_inertia: float
    load_torque: float
    lower_angle: float
    """Stops of the swash plate with their signs. [rad]"""
    upper_angle: float
    lower_pressure: float
    """Pressures at which the relief valve opens. [Pa]"""
    upper_pressure: float
    grip: float
    """Inward acceleration that counts as none while the plate rests on a stop. [rad/s²]"""
    symmetric: bool | None
    """True: root √((ΔP - sgn(x)P)/2)."""


@component
def machine_opening(position: float, machine: Machine) -> float:
    """x_eff. [m]"""
    return orifice_opening(position, machine.stroke, machine.opening_plus, machine.opening_minus)


@component
def machine_flow(position: float, pressure: float, machine: Machine) -> float:
    """Flow through the valve. [m³/s]"""
    return valve_flow(
        pressure,
        machine_opening(position, machine),
        machine.valve_gain,
        machine.supply_pressure,
        machine.symmetric,
    )


@component
def machine_motor_pressure(swash_rate: float, machine: Machine) -> float:
    """Pressure drop across the motor. [Pa]"""
    torque = load_torque(
        swash_rate,
        machine.load_inertia,
        machine.load_torque,
        machine.motor_constant,
        machine.flow_gain,
    )
    return motor_pressure_drop(torque, machine.motor_constant)


@component
def free_rates(
    position: float,
    velocity: float,
    pressure: float,
    angle: float,
    swash_rate: float,
    force: float,
    machine: Machine,
) -> tuple[float, float, float]:
    """Rates of velocity [m/s²], pressure [Pa/s] and swash rate [rad/s²] where no limit holds.

    The rates of position and angle are the velocity and the swash rate.
    """
    tangent = tan(angle)
    return (
        spool_acceleration(
            position,
            velocity,
            force,
            machine.arm_ratio * tangent,
            machine.spool_arm,
            machine.spool_mass,
            machine.arm_inertia,
            machine.spool_damping,
            machine.spring_moment,
            machine.plussing,
        ),
        oil_pressure_rate(
            pressure,
            machine_flow(position, pressure, machine),
            piston_speed(tangent, swash_rate, machine.swash_arm),
            machine.piston_area,
            machine.leakage,
            machine.volume,
            machine.bulk_modulus,
        ),
        swash_acceleration(
            pressure,
            tangent,
            swash_rate,
            machine_motor_pressure(swash_rate, machine),
            machine.swash_arm,
            machine.plate_inertia,
            machine.piston_mass,
            machine.piston_damping,
            machine.spring_rate,
            machine.piston_area,
            machine.pumping_moment,
        ),
    )


@component
def free_rate_partials(
    position: float,
    velocity: float,
    pressure: float,
    angle: float,
    swash_rate: float,
    force: float,
    machine: Machine,
) -> tuple[
    tuple[float, float, float], tuple[float, float, float, float], tuple[float, float, float]
]:
    """Derivatives of the three rates by the states that they depend on.

    Returns
    -------
    velocity : (float, float, float)
        By position, velocity, angle.
    pressure : (float, float, float, float)
        By position, pressure, angle, swash_rate.
    swash_rate : (float, float, float)
        By pressure, angle, swash_rate.
    """
    tangent = tan(angle)
    stretch = 1.0 + tangent * tangent
    _, v_x, v_v, _, v_s = spool_acceleration_partials(
        position,
        velocity,
        force,
        machine.arm_ratio * tangent,
        machine.spool_arm,
        machine.spool_mass,
        machine.arm_inertia,
        machine.spool_damping,
        machine.spring_moment,
        machine.plussing,
    )
    opening = machine_opening(position, machine)
    _, q_p, q_x = valve_flow_partials(
        pressure, opening, machine.valve_gain, machine.supply_pressure, machine.symmetric
    )
    q_x = q_x if opening == position else 0.0
    _, speed_t, speed_r = piston_speed_partials(tangent, swash_rate, machine.swash_arm)
    stiffness = machine.bulk_modulus / machine.volume
    _, r_p, r_t, r_r, r_m = swash_acceleration_partials(
        pressure,
        tangent,
        swash_rate,
        machine_motor_pressure(swash_rate, machine),
        machine.swash_arm,
        machine.plate_inertia,
        machine.piston_mass,
        machine.piston_damping,
        machine.spring_rate,
        machine.piston_area,
        machine.pumping_moment,
    )
    m_r = machine_motor_pressure(1.0, machine) - machine_motor_pressure(0.0, machine)
    return (
        (v_x, v_v, v_s * machine.arm_ratio * stretch),
        (
            stiffness * q_x,
            stiffness * (q_p - machine.leakage),
            -stiffness * machine.piston_area * speed_t * stretch,
            -stiffness * machine.piston_area * speed_r,
        ),
        (r_p, r_t * stretch, r_r + r_m * m_r),
    )
