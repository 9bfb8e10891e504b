"""From a physical set to the tuple that the compiled code takes."""

from math import tan

from swashplate.full_order.lumps import static_pressure
from swashplate.full_order.physical_set import PhysicalSet
from swashplate.parameters.parameter_set import PressureRoot
from swashplate.physics.component import uncompiled
from swashplate.physics.five_states import Machine
from swashplate.physics.motor_pressure import motor_pressure_drop
from swashplate.physics.swash_mechanism import holding_pressure

GRIP = 1e-12
"""Pressure, over the supply pressure, that is lost in rounding where a stop holds the plate."""


def build_machine(physical: PhysicalSet, root: PressureRoot = "published") -> Machine:
    """Physical quantities with what follows from them: moments, limits of pressure, ratios.

    The relief valve keeps the stroker pressure between those that hold the swash plate and its
    static load at the stops, and within `relief_pressure` of the pressure at rest.
    """
    n = physical.numbers
    pumping = n["pumping_area"] * n["pumping_arm"]
    load = uncompiled(motor_pressure_drop)(n["load_torque"], n["motor_constant"])
    rest = static_pressure(n)
    lower, upper = (
        uncompiled(holding_pressure)(
            tan(angle),
            load,
            n["swash_arm"],
            n["return_spring_rate"],
            n["piston_area"],
            pumping,
        )
        for angle in (-n["swash_stop_minus"], n["swash_stop_plus"])
    )
    return Machine(
        spool_arm=n["spool_arm"],
        spool_mass=n["spool_mass"],
        arm_inertia=n["feedback_arm_inertia"],
        spool_damping=n["spool_damping"],
        spring_moment=n["feedback_spring_rate"] * n["feedback_spring_arm"] ** 2,
        arm_ratio=n["swash_arm"] / n["control_arm"],
        plussing=n["plussing"],
        stroke=n["spool_stroke"],
        opening_plus=n["orifice_opening_plus"],
        opening_minus=n["orifice_opening_minus"],
        valve_gain=n["valve_flow_gain"],
        supply_pressure=n["supply_pressure"],
        volume=n["oil_volume"],
        bulk_modulus=n["bulk_modulus"],
        leakage=n["piston_leakage"],
        piston_area=n["piston_area"],
        swash_arm=n["swash_arm"],
        plate_inertia=n["swash_inertia"],
        piston_mass=n["piston_mass"],
        piston_damping=n["piston_damping"],
        spring_rate=n["return_spring_rate"],
        pumping_moment=pumping,
        motor_constant=n["motor_constant"],
        flow_gain=n["pump_flow_gain"],
        motor_leakage=n["motor_leakage"],
        load_inertia=n["load_inertia"],
        load_torque=n["load_torque"],
        lower_angle=-n["swash_stop_minus"],
        upper_angle=n["swash_stop_plus"],
        lower_pressure=max(lower, rest - n["relief_pressure"]),
        upper_pressure=min(upper, rest + n["relief_pressure"]),
        grip=GRIP * n["piston_area"] * n["swash_arm"] * n["supply_pressure"] / n["swash_inertia"],
        symmetric=True if root == "symmetric" else None,
    )
