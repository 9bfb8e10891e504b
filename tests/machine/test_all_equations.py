"""Every equation's partial derivatives by every float, against Richardson-extrapolated differences.

Equations are found by looking, so that a new one is tested or missed aloud.
"""

import importlib
import inspect
import pkgutil
from collections.abc import Callable
from functools import cache
from math import inf, isfinite
from random import Random
from typing import Any, get_type_hints

import pytest
from tests.machine.differences import compared, leaves
from tests.marks import rest_slow

import swashplate.machine
import swashplate.models
from swashplate import Drive, PhysicalSet
from swashplate.machine import Window, derive
from swashplate.machine.declaration import is_function
from swashplate.models import amplifier, full_order, machine, pump
from swashplate.models import displacement_control as control

POINTS, FEWER = 100, 30
SLOW = 25
"""Floats among the arguments from which on fewer points do."""
H = 1.0 / 512.0

IMPLICIT = {
    "tight_step": {"p.Z7"},
    "pump_step": {"p.Z7"},
    "unloaded_leakage": {"Z12"},
    "flow_speed": {"p.Z12"},
    "pump_sample": {"p.Z12"},
    "settled_sample": {"p.Z12"},
}
"""Declared as that at zero leakage, of an equation that leaves leakage out."""
VANISHING = {"settled_sample": {"spool_free", "orifice_opening", "swash_rate"}}
"""Zero at rest but for rounding, whose differences say nothing; `pump_sample` and `pump_settled`,
of which the equation consists, are compared by themselves."""


# --- equations ------------------------------------------------------------------------------------


def equations_of(space: dict[str, Any]) -> dict[str, Any]:
    """Equations that a module defines."""
    return {
        name: thing
        for name, thing in space.items()
        if is_function(thing)
        and thing.__module__ == space["__name__"]
        and inspect.getsource(thing).startswith("@equation\n")
    }


def packaged() -> dict[str, Any]:
    """All equations of the models and of the engine's library, by module and name."""
    found = {}
    for package in (swashplate.models, swashplate.machine):
        for each in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
            own = equations_of(vars(importlib.import_module(each.name)))
            stem = each.name.rpartition(".")[2]
            found |= {f"{stem}.{name}": thing for name, thing in own.items()}
    return found


EQUATIONS = packaged()


# --- arguments ------------------------------------------------------------------------------------

INSTEAD = {
    "Z2": 3e-3, "Z7": 0.3, "Z11": 0.02, "Z12": 0.2, "Z14": 3e-4, "Z15": 2e6, "Z16_plus": 1.5e-4,
    "Z16_minus": 1.5e-4, "Z17": 0.05, "Z18": 1e-5, "Z20_plus": 3.0, "Z20_minus": 3.0,
    "Z21_plus": 2.0, "Z21_minus": 2.0, "Z22_plus": 1.0, "Z22_minus": 1.0, "spool_friction": 0.1,
    "spool_presliding": 5e-5, "dither_time": 0.6, "solenoid_hysteresis": 0.005, "load_torque": 3e4,
    "load_inertia": 5e3, "motor_leakage": 1e-6, "cam_ripple": 0.01, "cam_ripple_per_torque": 5e-7,
    "cam_phase": 0.3, "swash_damping": 0.02, "line_stiffness": 1e6, "motor_constant": 250.0,
    "G2": 1e-3, "G3": 1e-5, "C": 2.0, "lim1": 2.3, "lim2": 2.3, "I_t1": 0.35, "I_t2": 0.14,
    "a": 20.0, "Z6": 0.07, "piston_leakage": 3e-11, "air_fraction": 0.01, "solenoid_delay": 0.01,
    "solenoid_lag": 0.015,
}  # fmt: skip
"""Usual sizes of what a packaged set leaves off."""

VOLTS, AMPERES = (-9.0, 9.0), (0.0, 0.7)
RANGES = {
    "voltage": VOLTS, "command": VOLTS, "first": (-1.0, 2.0), "last": (-1.0, 2.0),
    "newest": (-1.0, 2.0), "middle": (-1.0, 2.0), "oldest": (-1.0, 2.0), "threshold": (0.0, 1.0),
    "newer": (-2.0, 2.0), "older": (-2.0, 2.0), "share": (0.0, 1.0), "fraction": (0.02, 0.98),
    "length": (0.1, 1.0), "centre": (-0.5, 0.5), "change": (-3e-5, 3e-5), "now": AMPERES,
    "steady": AMPERES, "previous": AMPERES, "target": AMPERES, "output": AMPERES,
    "fallen": AMPERES, "begins": AMPERES, "ends": AMPERES, "level": AMPERES, "before": AMPERES,
    "current_positive": AMPERES, "current_negative": AMPERES, "current": (-0.7, 0.7),
    "w": (0.05, 2.5), "decay": (0.8, 0.99), "value": (-1.0, 1.0), "width": (0.05, 0.5),
    "t": (-0.41, 0.41), "rate": (-0.5, 0.5), "opening": (-2e-4, 2e-4), "position": (-3e-4, 3e-4),
    "arm_sine": (-0.3, 0.3), "head": (1e5, 1e7), "gain": (1e2, 1e3), "root": (3e2, 3e3),
    "tangent": (-0.35, 0.35), "swash_rate": (-1.0, 1.0), "pressure_rate": (-1e7, 1e7),
    "angle": (-0.3, 0.3), "swash_angle": (-0.3, 0.3), "leakage": (-0.05, 0.05),
    "deflection": (-1e-5, 1e-5), "balance": (-3e-5, 3e-5), "presliding": (1e-5, 1e-4),
    "factor": (0.8, 1.0), "depth": (0.0, 0.3), "shaft_angle": (0.0, 20.0), "torque": (-3e4, 3e4),
    "speed": (-3.0, 3.0), "flow_speed": (-3.0, 3.0), "load_torque": (-3e4, 3e4),
    "velocity": (-0.3, 0.3), "flow": (-1e-4, 1e-4), "piston_speed": (-0.1, 0.1),
    "motor_pressure": (-2e7, 2e7), "force": (-35.0, 35.0), "pressure": (-6e5, 6e5),
    "plate": (-6e5, 6e5), "plate_pressure": (-6e5, 6e5), "number": (0.0, 5.0),
    "tau": (0.014, 0.014), "lagged": AMPERES,
    "spool_position": (-3e-4, 3e-4), "spool_velocity": (-0.3, 0.3), "piston_pressure": (-6e5, 6e5),
    "step": (1e-5, 1e-4), "rise": (-0.01, 0.01), "substeps": (2.0, 2.0), "initialised": (1.0, 1.0),
    "moment": (-100.0, 100.0),
    "resistance": (0.0, 5.0), "inertia": (0.005, 0.01),
}  # fmt: skip
"""Physical ranges of what is no parameter, by its name."""
OWN_RANGES: dict[str, dict[str, tuple[float, float]]] = {
    "refinements.held_back": {"before": (-3e-5, 3e-5), "width": (1e-6, 1e-5)},
    "refinements.magnetising_current": {"current": (0.0, 0.02), "previous": (0.0, 0.02)},
    "amplifier.current_acceleration": {"rate": (-0.05, 0.05)},
    "library.arctangent": {"tangent": (-4.0, 4.0)},
    "machine.mixture_modulus": {"pressure": (2e5, 1e7)},
    "full_order.stopped": {"position": (-1.0, 1.0), "lower": (-0.5, -0.2), "upper": (0.2, 0.5)},
    "library.clipped": {"lower": (-0.5, -0.2), "upper": (0.2, 0.5)},
    "displacement_control.swash_angle": {"tangent": (-0.5, 0.5)},
}


class Draw:
    """Arguments of one equation, one set after the other."""

    def __init__(self, name: str, random: Random) -> None:
        self.random, self.uniform, self.name = random, random.uniform, name
        self.own = OWN_RANGES.get(name, {})
        self.drive = Drive.preset(random.choice(["hoist", "slew", "luff"]))

    def parameter(self, name: str) -> float:
        """A value about that of a packaged set."""
        numbers = self.drive.parameters.numbers
        usual = INSTEAD.get(name, control.Pump._field_defaults.get(name, 0.0))
        value = numbers.get(name, numbers.get(f"{name}_plus", usual))
        value = usual if value == 0.0 or abs(value) == inf else value
        return value * self.uniform(0.7, 1.3)

    def number(self, name: str) -> float:
        if name in self.own or name in RANGES:
            return self.uniform(*(self.own.get(name) or RANGES[name]))
        if name == "h":
            return H
        if name in ("direction", "sign"):
            return self.random.choice([1.0, -1.0])
        if name in control.Pump._fields or name in amplifier.CardChannel._fields:
            return self.parameter(name)
        raise AssertionError(f"{self.name}: say in RANGES what '{name}' can be")

    def flags(self, kind: Any) -> Any:
        return kind(*(self.random.choice([None, True]) for _ in kind._fields))

    def arguments(self, hints: dict[str, Any]) -> dict[str, Any]:
        """One argument after the other, each consistent with those that it follows from."""
        options = {name: self.flags(kind) for name, kind in hints.items() if name == "options"}
        known: dict[str, Any] = {"h": H, **options}
        own = full_order.Plant if self.name.startswith("full_order.") else control.Pump
        known["p"] = self.argument("p", hints.get("p", own), known)
        for name in (*[n for n in ("state", "inputs", "signals") if n in hints], *hints):
            if name not in known:
                known[name] = self.argument(name, hints[name], known)
        return {name: known[name] for name in hints}

    def argument(self, name: str, kind: Any, known: dict[str, Any]) -> Any:
        if kind in MADE:
            return MADE[kind](self, known)
        if kind is float:
            return self.number(name)
        if kind == control.Flag:
            return self.random.choice([None, True])
        if kind == control.Pump | control.Solenoids:
            kind = control.Pump
        if kind in (control.Pump, control.Solenoids, amplifier.CardChannel):
            return kind(*map(self.parameter, kind._fields))
        if kind in (amplifier.CardSignals, amplifier.ChannelSignals):
            return kind(*(self.uniform(*AMPERES) for _ in kind._fields))
        if not hasattr(kind, "_fields"):
            raise AssertionError(f"{self.name}: say how a {kind} is drawn")
        return kind(*(self.argument(n, each, known) for n, each in get_type_hints(kind).items()))

    def options(self, known: dict[str, Any], kind: Any, **more: Any) -> Any:
        """Those of the equation, or some."""
        return known.get("options") or kind(**more)


def filter_state(draw: Draw, _: dict[str, Any]) -> amplifier.Filter:
    now = draw.uniform(0.0, 0.7)
    before = now + draw.uniform(-0.01, 0.01)
    return amplifier.Filter(now, before, max(now + draw.uniform(-0.02, 0.02), 1e-3))


def window(draw: Draw, _: dict[str, Any]) -> Window:
    middle = draw.uniform(*VOLTS) * draw.random.choice([1.0, 0.1])
    near = [middle + draw.uniform(-0.5, 0.5) for _ in range(2)]
    return Window((near[0], middle, near[1]), draw.uniform(0.02, 0.98))


def hoist_machine(draw: Draw, _: dict[str, Any]) -> machine.Hydrostat:
    numbers = PhysicalSet.preset("hoist").numbers
    sizes = (v if isfinite(v) and v else INSTEAD.get(n, 1e-3) for n, v in numbers.items())
    return machine.Hydrostat(*(size * draw.uniform(0.9, 1.1) for size in sizes))


def pump_state(draw: Draw, known: dict[str, Any]) -> pump.PumpState:
    limits = control.pressure_limits(known["p"])
    pressures = [draw.uniform(0.98 * limits.lower, 0.98 * limits.upper) for _ in range(2)]
    names = (*("current",) * 3, "position", *pump.PumpState._fields[6:-1])
    return pump.PumpState(*pressures, *map(draw.number, names), 1.0)


def pump_signals(draw: Draw, known: dict[str, Any]) -> pump.PumpSignals:
    options = draw.options(known, control.PumpOptions)
    given = {"options": options, **known}
    state = known.get("state") or pump_state(draw, given)
    inputs = known.get("inputs") or draw.argument("inputs", pump.PumpInputs, known)
    return pump.pump_sample(state, inputs, known["p"], H, options)


def plant_signals(draw: Draw, known: dict[str, Any]) -> full_order.PlantSignals:
    motion = draw.argument("state", full_order.Motion, known)
    options = full_order.PlantOptions()
    return full_order.plant_signals(motion, 0.4, known["p"], options)


MADE: dict[Any, Callable[[Draw, dict[str, Any]], Any]] = {
    amplifier.Filter: filter_state,
    Window: window,
    machine.Hydrostat: hoist_machine,
    pump.PumpInputs: lambda draw, known: pump.PumpInputs(
        draw.number("current"),
        draw.uniform(0.8, 1.2),
        draw.number("load_torque"),
        known["p"].Z9 * draw.uniform(0.9, 1.1),
        draw.number("current"),
    ),
    pump.PumpState: pump_state,
    pump.PumpSignals: pump_signals,
    machine.ReliefPressures: lambda _, known: machine.relief_pressures(known["p"].machine),
    full_order.PlantSignals: plant_signals,
}
"""What is no mere tuple of numbers, each of a range of its own."""


# --- comparison -----------------------------------------------------------------------------------


def compared_at(
    function: Any, arguments: dict[str, Any], implicit: set[str], vanishing: set[str]
) -> bool:
    """Compare all partial derivatives at one point, unless it has to be drawn again."""
    options, lengths, floats = {}, {}, []
    for name, value in arguments.items():
        if value is None or value is True or name == "options":
            options[name] = value
            continue
        if name == "given":  # nobody differentiates by how a run is integrated
            continue
        floats += [path for path, _ in leaves(value, name)]
    for path in floats:
        if path.endswith(".s.0"):
            lengths[path.removesuffix(".0")] = 3
    derived = derived_of(function, tuple(floats), tuple(options.items()), tuple(lengths.items()))
    return compared(function, derived, arguments, implicit, vanishing)


@cache
def derived_of(function: Any, by: Any, options: Any, lengths: Any) -> Any:
    return derive(function, by, options=dict(options), lengths=dict(lengths))


@pytest.mark.parametrize("name", rest_slow([*EQUATIONS], 40))
def test_partials_are_those_of_differences(name: str) -> None:
    function = EQUATIONS[name]
    hints = get_type_hints(function)
    hints.pop("return", None)
    random = Random(name)
    several = [Draw(name, random) for _ in range(6)]
    wanted, accepted, tries = POINTS, 0, 0
    kinds = [draw.flags(hints["options"]) for draw in several[:3]] if "options" in hints else []
    if kinds:
        kinds[0] = type(kinds[0])()
    while accepted < wanted and tries < 40 * POINTS:
        draw = several[tries % 6]
        tries += 1
        if kinds:
            chosen = kinds[tries % 3]
            draw.flags = lambda kind, chosen=chosen: (  # type: ignore[method-assign]
                chosen if isinstance(chosen, kind) else kind()
            )
        arguments = draw.arguments(hints)
        floats = sum(1 for v in arguments.values() for _ in leaves(v, ""))
        if floats == 0:
            return  # nothing to differentiate by
        wanted = FEWER if floats > SLOW else POINTS
        called = name.split(".")[1]
        accepted += compared_at(
            function, arguments, IMPLICIT.get(called, set()), VANISHING.get(called, set())
        )
    assert accepted >= wanted, f"{accepted} of {tries} points could be compared"


def test_no_equation_is_missed() -> None:
    """Those that the models name, and the library's, are among what was found."""
    assert EQUATIONS.keys() >= OWN_RANGES.keys()
    modules = "amplifier pump refinements machine full_order library model"
    for package in modules.split():
        assert any(name.startswith(f"{package}.") for name in EQUATIONS), package
    assert len(EQUATIONS) > 100
