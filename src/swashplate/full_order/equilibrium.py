"""Equilibria of the full-order model: at rest, and under a constant force."""

from math import asin, atan, sin, sqrt, tan

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.equation import interpreted
from swashplate.full_order.machine import Plate
from swashplate.full_order.march import N_ROW
from swashplate.models import full_order as model

Array = NDArray[np.float64]


def plate_pressure(angle: float, machine: Plate) -> float:
    """Stroker pressure that holds plate and static load at an angle. [Pa]"""
    drop = machine.p.motor_constant * machine.p.load_torque
    return float(interpreted(model.holding_pressure)(tan(angle), drop, machine.p))


def balanced_spool(force: float, angle: float, machine: Plate) -> float:
    """Spool position at which solenoids and feedback spring balance, within the stroke. [m]

    d1 F (1 + tan²β) = k_f d3² sin(α + β), the printed eq. 6.19 at rest. Where the solenoids
    overpower the spring the spool is at its stop.
    """
    from scipy.optimize import brentq

    p = machine.p
    arm = asin(p.swash_arm / p.control_arm * tan(angle))
    moment_of_spring = interpreted(model.spring_moment)(p)

    def surplus(position: float) -> float:
        lever = (position - p.plussing) / p.spool_arm
        moment = p.spool_arm * force * (1.0 + lever * lever)
        return float(moment - moment_of_spring * sin(arm + atan(lever)))

    stroke = p.spool_stroke
    if surplus(stroke) >= 0.0:
        return stroke
    if surplus(-stroke) <= 0.0:
        return -stroke
    return float(brentq(surplus, -stroke, stroke, xtol=1e-16, rtol=1e-15))


def steady_row(force: float, machine: Plate) -> Array:
    """Row at which the drive settles under a constant force. (N_ROW,)"""
    from scipy.optimize import brentq

    p, flow = machine.p, interpreted(model.valve_flow)

    def surplus(angle: float) -> float:
        pressure = plate_pressure(angle, machine)
        position = balanced_spool(force, angle, machine)
        return float(flow(position, pressure, p, machine.symmetric) - p.piston_leakage * pressure)

    low, high = -p.swash_stop_minus, p.swash_stop_plus
    if surplus(high) >= 0.0:
        angle = high
    elif surplus(low) <= 0.0:
        angle = low
    else:
        angle = float(brentq(surplus, low, high, xtol=1e-15, rtol=1e-15))
    pressure = min(max(plate_pressure(angle, machine), machine.k.lower), machine.k.upper)
    return _row(balanced_spool(force, angle, machine), pressure, angle)


def rest_row(force: float, machine: Plate) -> Array:
    """Row with the plate upright, its load held, and the spool in balance. (N_ROW,)"""
    return _row(balanced_spool(force, 0.0, machine), plate_pressure(0.0, machine), 0.0)


def _row(position: float, pressure: float, angle: float) -> Array:
    row = np.zeros(N_ROW)
    row[0], row[2], row[3] = position, pressure, angle
    return row


def fastest_rate(machine: Plate) -> float:
    """Fastest of the modes: spool, and plate on its spring and trapped oil. [rad/s]"""
    p = machine.p
    spool = p.spool_mass * p.spool_arm**2 + p.feedback_arm_inertia
    plate = p.swash_inertia + p.piston_mass * p.swash_arm**2
    oil = p.piston_area**2 * p.bulk_modulus / p.oil_volume
    spring = (p.return_spring_rate + oil) * p.swash_arm**2
    loaded = (
        p.motor_constant**2 * p.load_inertia * p.pump_flow_gain * p.pumping_area * p.pumping_arm
    )
    # an overdamped mode decays at up to 2 ζ ω
    decays = (
        p.spool_damping * p.spool_arm**2 / spool,
        (p.piston_damping * p.swash_arm**2 + loaded) / plate,
    )
    moment = p.feedback_spring_rate * p.feedback_spring_arm**2
    return max(sqrt(moment / spool), sqrt(spring / plate), *decays)
