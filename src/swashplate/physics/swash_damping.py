"""Damping of the swash plate: it turns towards its equilibrium instead of standing there.

With a damping moment c α' in eq. 6.55 and T = c/(k_r d4²),

    T (tan α_sw)' = (Z1 δP - Z2) - tan α_sw.

The plate's place is written as the pressure p at which it would stand still, tan α_sw = Z1 p - Z2:
T p' = δP - p. Whatever the plate has yet to turn has not yet taken its oil: δP + Z6 p is the oil in
the cylinder, which the plate's motion does not change.
"""

from math import exp

from swashplate.physics.component import component


@component
def damping_factor(swash_damping: float, Z6: float, step: float) -> float:
    """What is left of δP - p after one step without flow, exp(-h (1 + Z6)/T).

    Parameters
    ----------
    swash_damping : float
        T, above 0. [s]
    Z6 : float
        Piston motion against oil stiffness. [1]
    step : float
        h. [s]
    """
    return exp(-step * (1.0 + Z6) / swash_damping)


@component
def plate_follows(
    pressure: float, plate_pressure: float, Z6: float, factor: float
) -> tuple[float, float]:
    """Pressure and plate one step later, without flow.

    Parameters
    ----------
    pressure, plate_pressure : float
        δP, and p of the plate. [Pa]
    Z6 : float
        Piston motion against oil stiffness. [1]
    factor : float
        See `damping_factor`.

    Returns
    -------
    pressure, plate_pressure : float
        With δP + Z6 p as before and δP - p smaller by the factor. [Pa]

    Notes
    -----
    The energy of oil and spring, δP² + Z6 p² but for a factor, falls: the damper takes it.
    """
    motion = (pressure - plate_pressure) * (1.0 - factor) / (1.0 + Z6)
    return pressure - Z6 * motion, plate_pressure + motion


@component
def plate_pressure_rate(pressure: float, plate_pressure: float, swash_damping: float) -> float:
    """Rate of the plate's pressure, p' = (δP - p)/T. [Pa/s]"""
    return (pressure - plate_pressure) / swash_damping
