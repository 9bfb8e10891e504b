"""Equilibria of the full-order model: at rest, and under a constant force."""

from math import asin, atan, sin, sqrt, tan

import numpy as np
from numpy.typing import NDArray

from swashplate.full_order.march import N_ROW
from swashplate.physics.component import uncompiled
from swashplate.physics.five_states import Machine, machine_flow, machine_motor_pressure
from swashplate.physics.swash_mechanism import holding_pressure

Array = NDArray[np.float64]


def plate_pressure(angle: float, machine: Machine) -> float:
    """Stroker pressure that holds plate and static load at an angle. [Pa]"""
    return uncompiled(holding_pressure)(
        tan(angle),
        machine_motor_pressure(0.0, machine),
        machine.swash_arm,
        machine.spring_rate,
        machine.piston_area,
        machine.pumping_moment,
    )


def balanced_spool(force: float, angle: float, machine: Machine) -> float:
    """Spool position at which solenoids and feedback spring balance, within the stroke. [m]

    d1 F (1 + tan²β) = k_f d3² sin(α + β), the printed eq. 6.19 at rest. Where the solenoids
    overpower the spring the spool is at its stop.
    """
    from scipy.optimize import brentq

    arm = asin(machine.arm_ratio * tan(angle))

    def surplus(position: float) -> float:
        lever = (position - machine.plussing) / machine.spool_arm
        moment = machine.spool_arm * force * (1.0 + lever * lever)
        return moment - machine.spring_moment * sin(arm + atan(lever))

    stroke = machine.stroke
    if surplus(stroke) >= 0.0:
        return stroke
    if surplus(-stroke) <= 0.0:
        return -stroke
    return float(brentq(surplus, -stroke, stroke, xtol=1e-16, rtol=1e-15))


def steady_row(force: float, machine: Machine) -> Array:
    """Row at which the drive settles under a constant force. (N_ROW,)"""
    from scipy.optimize import brentq

    def surplus(angle: float) -> float:
        pressure = plate_pressure(angle, machine)
        position = balanced_spool(force, angle, machine)
        return machine_flow(position, pressure, machine) - machine.leakage * pressure

    low, high = machine.lower_angle, machine.upper_angle
    if surplus(high) >= 0.0:
        angle = high
    elif surplus(low) <= 0.0:
        angle = low
    else:
        angle = float(brentq(surplus, low, high, xtol=1e-15, rtol=1e-15))
    pressure = plate_pressure(angle, machine)
    pressure = min(max(pressure, machine.lower_pressure), machine.upper_pressure)
    return _row(balanced_spool(force, angle, machine), pressure, angle)


def rest_row(force: float, machine: Machine) -> Array:
    """Row with the plate upright, its load held, and the spool in balance. (N_ROW,)"""
    return _row(balanced_spool(force, 0.0, machine), plate_pressure(0.0, machine), 0.0)


def _row(position: float, pressure: float, angle: float) -> Array:
    row = np.zeros(N_ROW)
    row[0], row[2], row[3] = position, pressure, angle
    return row


def fastest_rate(machine: Machine) -> float:
    """Fastest of the modes: spool, and plate on its spring and trapped oil. [rad/s]"""
    spool = machine.spool_mass * machine.spool_arm**2 + machine.arm_inertia
    plate = machine.plate_inertia + machine.piston_mass * machine.swash_arm**2
    oil = machine.piston_area**2 * machine.bulk_modulus / machine.volume
    spring = (machine.spring_rate + oil) * machine.swash_arm**2
    # an overdamped mode decays at up to 2 ζ ω
    decays = (
        machine.spool_damping * machine.spool_arm**2 / spool,
        (machine.piston_damping * machine.swash_arm**2 + _load_damping(machine)) / plate,
    )
    return max(sqrt(machine.spring_moment / spool), sqrt(spring / plate), *decays)


def _load_damping(machine: Machine) -> float:
    rise = machine_motor_pressure(1.0, machine) - machine_motor_pressure(0.0, machine)
    return rise * machine.pumping_moment
