"""What passes through the full-order model and what it stores: powers, energies, shaft speed."""

from math import sqrt, tan

from swashplate.physics.component import component
from swashplate.physics.five_states import Machine, machine_motor_pressure
from swashplate.physics.motor import shaft_speed
from swashplate.physics.motor_pressure import load_torque, pump_flow
from swashplate.physics.spool_mechanism import feedback_moment, spool_energy
from swashplate.physics.swash_mechanism import piston_speed, swash_energy


@component
def machine_powers(
    position: float,
    velocity: float,
    pressure: float,
    angle: float,
    swash_rate: float,
    force: float,
    machine: Machine,
) -> tuple[float, float, float, float, float, float, float]:
    """Powers that pass through the mechanisms. [W]

    Returns
    -------
    solenoid, spool_damping, feedback : float
        Work done on the spool's mechanism by the solenoids, lost in its damping, done on it by the
        swash plate's feedback arm.
    piston, piston_damping, pumping : float
        Work done on the plate by the stroker pressure, lost in the piston's damping, done by the
        plate against the pumping pistons.
    motor : float
        Hydraulic power that the pump sends to the motor, (P_hi - P_lo) Q.
    """
    tangent = tan(angle)
    stretch = 1.0 + tangent * tangent
    sine = machine.arm_ratio * tangent
    arm_rate = machine.arm_ratio * stretch * swash_rate / sqrt(1.0 - sine * sine)
    moment = feedback_moment(
        position, sine, machine.spool_arm, machine.spring_moment, machine.plussing
    )
    speed = piston_speed(tangent, swash_rate, machine.swash_arm)
    motor_pressure = machine_motor_pressure(swash_rate, machine)
    return (
        force * velocity,
        machine.spool_damping * velocity * velocity,
        moment * arm_rate,
        pressure * machine.piston_area * speed,
        machine.piston_damping * speed * speed,
        motor_pressure * machine.pumping_moment / sqrt(stretch) * swash_rate,
        motor_pressure * pump_flow(angle, machine.flow_gain),
    )


@component
def machine_energies(
    position: float, velocity: float, angle: float, swash_rate: float, machine: Machine
) -> tuple[float, float, float]:
    """Energy of the spool's mechanism, of plate, piston and spring, and of the moving load. [J]"""
    tangent = tan(angle)
    spool_kinetic, spool_spring = spool_energy(
        position,
        velocity,
        machine.arm_ratio * tangent,
        machine.spool_arm,
        machine.spool_mass,
        machine.arm_inertia,
        machine.spring_moment,
        machine.plussing,
    )
    swash_kinetic, swash_spring = swash_energy(
        tangent,
        swash_rate,
        machine.swash_arm,
        machine.plate_inertia,
        machine.piston_mass,
        machine.spring_rate,
    )
    speed = machine.motor_constant * machine.flow_gain * angle
    load = 0.5 * machine.load_inertia * speed * speed
    return spool_kinetic + spool_spring, swash_kinetic + swash_spring, load


@component
def machine_speed(angle: float, swash_rate: float, machine: Machine) -> float:
    """Shaft speed, less what leaks at the motor under its load. [rad/s]"""
    torque = load_torque(
        swash_rate,
        machine.load_inertia,
        machine.load_torque,
        machine.motor_constant,
        machine.flow_gain,
    )
    leakage = machine.motor_leakage * torque
    return shaft_speed(angle, leakage, machine.motor_constant * machine.flow_gain, 0.0)
