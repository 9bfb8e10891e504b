"""Simulation with refinements: from a parameter set and a record to a result."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.refinements import REFINEMENTS
from swashplate.physics.cam_ripple import ripple_depth
from swashplate.physics.component import uncompiled
from swashplate.physics.leakage import leakage_lumps
from swashplate.physics.stiction import dither_factor, stiction_width
from swashplate.physics.swash_damping import damping_factor
from swashplate.simulation.build import build, build_pump
from swashplate.simulation.constants import Pump
from swashplate.simulation.march import march_drive
from swashplate.simulation.record import Record
from swashplate.simulation.refined_march import Refined, RefinedSignals, march_refined, rest_state
from swashplate.simulation.refined_result import RefinedSimulation
from swashplate.simulation.result import CardSignals
from swashplate.simulation.run import (
    Start,
    check_domain,
    check_start_pressure,
    drive_start,
    pump_start,
)

Array = NDArray[np.float64]


def build_refined(parameters: ParameterSet, step: float) -> tuple[Pump, Refined]:
    """Pump and refinements, ready to be marched at one step.

    The leakage under load needs no march of its own: with a stiff line it is what Z11 and Z12 stand
    for, and comes on top of what the set has of them.

    Parameters
    ----------
    parameters : ParameterSet
        The drive; refinements that are not given are off.
    step : float
        h. [s]
    """
    pump = build_pump(parameters.plain)
    given = {symbol: float(parameters[symbol].values[0]) for symbol in REFINEMENTS}
    damping, torque = given["swash_damping"], given["load_torque"]
    refined = Refined(
        stiction_width=uncompiled(stiction_width)(given["spool_friction"], pump.Z4, pump.Z5),
        presliding=given["spool_presliding"],
        dither_factor=uncompiled(dither_factor)(given["dither_time"], step),
        solenoid_hysteresis=given["solenoid_hysteresis"],
        ripple_depth=uncompiled(ripple_depth)(
            given["cam_ripple"], given["cam_ripple_per_torque"], torque
        ),
        cam_cycles=given["cam_cycles"],
        cam_phase=given["cam_phase"],
        swash_damping=damping,
        damping_factor=uncompiled(damping_factor)(damping, pump.Z6, step) if damping else 0.0,
        line_stiffness=given["line_stiffness"],
        motor_leakage=given["motor_leakage"],
        load_torque=torque,
        load_inertia=given["load_inertia"],
        motor_constant=given["motor_constant"],
    )
    return (pump if refined.line_stiffness else _leaking(pump, refined)), refined


def build_steady(parameters: ParameterSet) -> Pump:
    """Pump that settles at the speed that the drive settles at, refinements included.

    Friction and hysteresis leave a range open, of which this is the middle; the cam ring's ripple
    does not change the mean of a turn, and a line at rest bears the load.
    """
    pump = build_pump(parameters.plain)
    return _leaking(pump, build_refined(parameters, 1.0)[1]) if parameters.refinements else pump


def _leaking(pump: Pump, refined: Refined) -> Pump:
    """The pump with the load's leakage on top of its own Z11 and Z12."""
    if refined.motor_leakage == 0.0:
        return pump
    Z11, Z12 = uncompiled(leakage_lumps)(
        refined.motor_leakage, refined.load_torque, refined.load_inertia, pump.Z10
    )
    loaded = True if pump.Z12 + Z12 != 0.0 else None
    return pump._replace(Z11=pump.Z11 + Z11, Z12=pump.Z12 + Z12, loaded=loaded)


def simulate_refined_drive(
    parameters: ParameterSet, record: Record, start: Start, start_pressure: float | None = None
) -> RefinedSimulation:
    """March card, pump, line and motor over a voltage record; as `run.simulate_drive`."""
    delay, plus, minus, plain, step = build(parameters.plain, record.step)
    command = record.values
    before, state = drive_start(command, plus, minus, plain, start)
    if start_pressure is not None:
        state = (*state[:2], check_start_pressure(parameters.name, start_pressure, plain))
    current_plus, current_minus, pressure = (np.empty_like(command) for _ in range(3))
    flags = np.empty(command.size, dtype=np.uint8)
    march_drive(
        command,
        before,
        delay,
        plus,
        minus,
        plain,
        step,
        state,
        current_plus,
        current_minus,
        pressure,
        flags,
    )
    card = CardSignals(current_plus, current_minus, flags)
    current = current_plus - current_minus
    held = state[0] - state[1]
    return _marched(parameters, record, current, (held, state[2]), card, "voltage")


def simulate_refined_pump(
    parameters: ParameterSet, record: Record, start: Start, start_pressure: float | None = None
) -> RefinedSimulation:
    """March pump, line and motor alone over a signed current; as `run.simulate_pump`."""
    plain, current = build_pump(parameters.plain), record.values
    pressure = pump_start(current, plain, start)
    if start_pressure is not None:
        pressure = check_start_pressure(parameters.name, start_pressure, plain)
    held = 0.0 if start == "rest" else float(current[0])
    return _marched(parameters, record, current, (held, pressure), None, "current")


def _marched(
    parameters: ParameterSet,
    record: Record,
    current: Array,
    start: tuple[float, float],
    card: CardSignals | None,
    drive: str,
) -> RefinedSimulation:
    pump, refined = build_refined(parameters, record.step)
    signals = RefinedSignals(*(np.empty_like(current) for _ in RefinedSignals._fields))
    state = rest_state(*start, refined)
    worst = march_refined(current, pump, refined, record.step, state, signals)
    check_domain(parameters.name, worst, drive)
    return RefinedSimulation(
        parameters.name,
        record,
        pump,
        signals.pressure,
        card,
        refined=signals,
        knows_pressure=refined.motor_constant > 0.0,
    )
