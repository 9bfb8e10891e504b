"""Steady states of a drive: the pressure at which the valve is closed, and the speed with it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swashplate.equations import expressions as ex
from swashplate.equations.code import Code, Tuple, generating, leaves
from swashplate.equations.expressions import text
from swashplate.equations.marching.march import Sampler, function_source, indented, value_of
from swashplate.equations.marching.run import Instance, called, module
from swashplate.equations.writing import lines_of
from swashplate.models.card import channel_level
from swashplate.models.drive import drive
from swashplate.models.pump import (
    PumpConstants,
    PumpInputs,
    PumpState,
    pump_constants,
    pump_sample,
    pump_settled,
)
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.simulation.instance import instance_of

Array = NDArray[np.float64]


@generating
def _kernel(options: tuple[Any, ...]) -> Callable[..., None]:
    """The compiled map from constant voltages to currents and speeds."""
    sampler = Sampler(drive, ("voltage",), options, [])
    card, pump = sampler.parts
    code = Code(pump.code.taken)
    volts = ex.name("volts")
    plus = card.call(code, channel_level, {"voltage": volts, "p": card.p.items[0]})  # type: ignore[union-attr]
    minus = card.call(
        code,
        channel_level,
        {"voltage": ex.make("neg", volts), "p": card.p.items[1]},  # type: ignore[union-attr]
    )
    current = ex.make("-", plus, minus)  # type: ignore[arg-type]
    given = (current, *(value_of(pump.p, name) for name in ("pump_speed", "load_torque", "Z9")))
    known = {**pump.known, "inputs": Tuple(PumpInputs, given)}
    known["state"] = pump.call(code, pump_settled, known)
    speed = value_of(pump.call(code, pump_sample, known), "shaft_speed")
    results = [current, speed]
    sampler.ends = [[ex.name(node.value) for _, node in leaves(part.p)] for part in sampler.parts]
    read = code.reads(results)
    for part in sampler.parts:
        sampler.ends[part.part] = [ex.name(name) for name in sorted(read)]
    lines = [
        *sampler.ahead(),
        "for n in range(voltage.size):",
        "    volts = voltage[n]",
        *indented(lines_of(code, results)),
        f"    current[n] = {text(current)}",
        f"    speed[n] = {text(speed)}",
    ]
    source = function_source(
        "settled(voltage, params, given, h, current, speed)",
        "Signed current and speed that each of many constant voltages settles at.",
        lines,
    )
    return module("drive_settled", source, sampler.names | code.names)["settled"]  # type: ignore[no-any-return]


def steady_states(parameters: ParameterSet, voltage: Array) -> tuple[Array, Array]:
    """Signed current [A] and speed [rad/s] that each of many constant voltages settles at."""
    instance = instance_of(parameters, True)
    card, pump = instance.options
    current, speed = np.empty(voltage.size), np.empty(voltage.size)
    _kernel((card, pump._replace(ripple=None)))(
        voltage, instance.params, instance.given, 1.0, current, speed
    )
    return current, speed


def pump_arguments(instance: Instance, current: float, step: float = 1.0) -> dict[str, Any]:
    """What the pump's equations take under a constant current, by the arguments' names."""
    p, options, _ = instance.parts[1]
    known: dict[str, Any] = {"p": p, "options": options, "h": step}
    known["k"] = called(pump_constants, known)
    known["inputs"] = PumpInputs(current, p.pump_speed, p.load_torque, p.Z9)
    return known


def settled_state(instance: Instance, current: float) -> PumpState:
    """State of the pump that a constant signed current settles at."""
    made: PumpState = called(pump_settled, pump_arguments(instance, current))
    return made


def pressure_limits(instance: Instance) -> PumpConstants:
    """Pressures at which stops and relief valve act, with the other constants. [Pa]"""
    made: PumpConstants = pump_arguments(instance, 0.0)["k"]
    return made
