"""From physical quantities to the lumped parameters Z (Kruse 2001, eqs. 6.54-6.70)."""

from __future__ import annotations

from collections.abc import Mapping

from swashplate.errors import ParameterError
from swashplate.full_order.physical_set import PhysicalSet
from swashplate.parameters.parameter_set import Change, Pair, ParameterSet

AGREES = 1e-9
"""Relative difference up to which a given value agrees with the one that follows."""


def static_pressure(numbers: Mapping[str, float]) -> float:
    """P0 = K_mf C_g A_p d5/(A_s d4), which holds the load at rest; Kruse eq. 6.54. [Pa]"""
    load = numbers["motor_constant"] * numbers["load_torque"]
    moment = numbers["pumping_area"] * numbers["pumping_arm"]
    return load * moment / (numbers["piston_area"] * numbers["swash_arm"])


def lumped(physical: PhysicalSet, Z6: float | None = None) -> dict[str, Change]:
    """Lumped parameters that a physical set stands for.

    Parameters
    ----------
    physical : PhysicalSet
        The machine.
    Z6 : float, optional
        Value to move to along the gauge Z6↔Z8: away from the stops only Z7/(1+Z6) and Z8/(1+Z6)
        count. By default the physical A_s²B/(k_r V).

    Returns
    -------
    dict
        Z1 to Z16 and Z18 by symbol, pairs (plus, minus) where the directions differ; Kruse eqs.
        6.56-6.70 and table 6.1. The solenoids' Z17 and Z19 to Z22 are not the pump's geometry.
    """
    n = physical.numbers
    stiffness = n["bulk_modulus"] / n["oil_volume"]
    own = n["piston_area"] ** 2 * stiffness / n["return_spring_rate"]
    gauge = 1.0 if Z6 is None else (1.0 + Z6) / (1.0 + own)
    spring_moment = n["feedback_spring_rate"] * n["feedback_spring_arm"] ** 2
    accelerating = n["motor_leakage"] * n["motor_constant"] * n["pump_flow_gain"]
    return {
        "Z1": n["piston_area"] / (n["return_spring_rate"] * n["swash_arm"]),
        # K_mf C_g A_p d5/(k_r d4²) - Z1 P0, which the definition of P0 makes zero (erratum 20)
        "Z2": 0.0,
        "Z3": n["swash_arm"] / n["control_arm"],
        "Z4": spring_moment**2,
        "Z5": n["spool_arm"],
        "Z6": own if Z6 is None else Z6,
        "Z7": n["piston_leakage"] * stiffness * gauge,
        "Z8": n["valve_flow_gain"] * stiffness * gauge,
        "Z9": n["supply_pressure"] - static_pressure(n),
        "Z10": n["motor_constant"] * n["pump_flow_gain"],
        "Z11": n["motor_leakage"] * n["load_torque"] + 0.0,  # not -0
        "Z12": accelerating * n["load_inertia"],
        "Z13": Pair(n["swash_stop_plus"], n["swash_stop_minus"]),
        "Z14": n["spool_stroke"],
        "Z15": n["relief_pressure"],
        "Z16": Pair(n["orifice_opening_plus"], n["orifice_opening_minus"]),
        "Z18": n["plussing"],
    }


def check_lumps(physical: PhysicalSet, parameters: ParameterSet, tolerance: float = AGREES) -> None:
    """Refuse a physical set whose lumps are not those of a drive.

    Raises
    ------
    ParameterError
        For the first lump that differs by more than the tolerance, taken at the drive's own Z6.
    """
    for symbol, lump in lumped(physical, parameters.numbers["Z6"]).items():
        values = lump if isinstance(lump, tuple) else (lump,)
        for column, value in zip(parameters[symbol].definition.columns, values, strict=False):
            wanted = parameters.numbers[column]
            if value != wanted and not abs(value - wanted) <= tolerance * abs(wanted):
                raise ParameterError(
                    f"{physical.name}: its quantities make {column} = {value:.9g}, but "
                    f"{parameters.name} has {wanted:.9g} {parameters[symbol].unit}."
                )
