"""The table of cases: what is computed, of which drive, and how closely it must stay."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from math import inf
from typing import Any, NamedTuple

import adapter
import numpy as np
from numpy.typing import NDArray
from store import Class, Output

from swashplate import Drive, FullOrderDrive, Serial, SquaredError

Array = NDArray[np.float64]
Inputs = Mapping[str, Array]
Outputs = dict[str, Output]
Changes = dict[str, Any]

AXES = ("hoist", "slew", "luff")
OPTIONS = ("pressure_root", "coulomb_sign", "card_switch")


@dataclass(frozen=True)
class Case:
    """One computation and the class of its numbers."""

    name: str
    kind: Class
    compute: Callable[[Inputs], Outputs]
    counts: Mapping[str, int]
    """Rows that the file keeps of an array; "" stands for all that are not named."""

    def count(self, output: str) -> int:
        """Rows that the file keeps of an output."""
        return self.counts.get(output, self.counts[""])


# --- drives ------------------------------------------------------------------------------------


class Load(NamedTuple):
    """A load that suits an axis."""

    load_torque: float
    load_inertia: float
    motor_leakage: float
    motor_constant: float
    line_stiffness: float
    cam_ripple_per_torque: float


LOADS = {
    "hoist": Load(3e4, 5e3, 1e-6, 250.0, 1e6, 5e-7),
    "slew": Load(3e5, 2e6, 2e-9, 10.0, 4e8, 5e-8),
    "luff": Load(-2e4, 4e3, 1e-6, 385.0, 8e5, 5e-7),
}
STOPPED = {
    "hoist": {"Z14": 1.05e-4, "Z15": 3e5},
    "slew": {"Z14": 1.5e-4, "Z15": 2e5},
    "luff": {"Z14": 1.5e-4, "Z15": 4e4},
}
STEEP = {
    "hoist": {"Z13": (0.43, 0.6), "Z3": 0.4, "Z16": (4e-4, 6e-4)},
    "slew": {"Z13": (0.4, 0.42), "Z16": (5e-4, 6e-4)},
    "luff": {"Z13": (0.39, 0.41), "Z3": 0.4, "Z6": 1.0, "Z16": (6e-4, 8e-4)},
}


def everything(axis: str) -> Changes:
    """Several options and terms at once."""
    Z10 = Drive.preset(axis).parameters.numbers["Z10"]
    return {
        **STEEP[axis],
        "Z2": 0.005,
        "Z7": 0.4,
        "Z11": 0.002 * Z10,
        "Z12": 0.02 * Z10,
        "C": 3.0,
        "pressure_root": "symmetric",
        "card_switch": "split",
    }


VARIANTS: dict[str, Callable[[str], Changes]] = {
    "default": lambda axis: {},
    "literal": lambda axis: {"coulomb_sign": "literal", "C": 3.0},
    "split": lambda axis: {"card_switch": "split", "C": 3.0},
    "literal split": lambda axis: {"coulomb_sign": "literal", "card_switch": "split", "C": 3.0},
    "symmetric": lambda axis: {"pressure_root": "symmetric"},
    "leaky": lambda axis: {"Z7": 0.3},
    "loaded": lambda axis: {
        "Z11": 0.002 * Drive.preset(axis).parameters.numbers["Z10"],
        "Z12": 0.02 * Drive.preset(axis).parameters.numbers["Z10"],
    },
    "steep": lambda axis: STEEP[axis],
    "everything": everything,
    "stopped": lambda axis: STOPPED[axis],
    "unlimited": lambda axis: dict.fromkeys(
        ("lim1", "lim2", "I_t1", "a", "Z14", "Z15", "Z16"), inf
    ),
    "quick": lambda axis: {"tau": 0.0, "V_dz": 0.0, "J": 0.0, "C": 0.0, "Z17": 0.0, "Z6": 0.0},
    "late": lambda axis: {"tau": 0.0971, "C": (1.0, 8.0), "Z18": 2e-5},
}
PUMP_VARIANTS = (
    *("default", "symmetric", "leaky", "loaded", "steep", "everything", "stopped", "unlimited"),
    "quick",
)
DERIVED_VARIANTS = (
    *("default", "literal", "split", "symmetric", "leaky", "loaded", "steep", "everything"),
    "stopped",
)

STICTION = {"spool_friction": 0.115, "spool_presliding": 5e-5, "dither_time": 0.6}


def load_of(axis: str, *names: str) -> Changes:
    """Some parameters of an axis's load."""
    return {name: getattr(LOADS[axis], name) for name in names}


def leaking(axis: str) -> Changes:
    """Leakage of the motor under the load."""
    return load_of(axis, "load_torque", "load_inertia", "motor_leakage")


def all_without_line(axis: str) -> Changes:
    """All refinements but the line."""
    return {
        **STICTION,
        **leaking(axis),
        **load_of(axis, "motor_constant", "cam_ripple_per_torque"),
        "solenoid_hysteresis": 0.005,
        "cam_ripple": 0.01,
        "cam_cycles": 4.5,
        "cam_phase": 0.3,
        "swash_damping": 0.02,
    }


def all_with_line(axis: str) -> Changes:
    """All refinements."""
    return {**all_without_line(axis), **load_of(axis, "line_stiffness")}


REFINED: dict[str, Callable[[str], Changes]] = {
    "stiction": lambda axis: STICTION,
    "stiction without dither": lambda axis: {"spool_friction": 0.08, "spool_presliding": 3e-5},
    "friction that does not give": lambda axis: {"spool_friction": 0.1},
    "hysteresis": lambda axis: {"solenoid_hysteresis": 0.01},
    "leakage": leaking,
    "cam ring": lambda axis: {"cam_ripple": 0.02, "cam_phase": 0.7},
    "cam ring under load": lambda axis: {
        **load_of(axis, "load_torque", "cam_ripple_per_torque"),
        "cam_cycles": 7.0,
    },
    "swash damping": lambda axis: {"swash_damping": 0.03},
    "line": lambda axis: load_of(axis, "line_stiffness", "load_inertia", "load_torque"),
    "leaking line": lambda axis: {**leaking(axis), **load_of(axis, "line_stiffness")},
    "motor constant": lambda axis: load_of(axis, "motor_constant", "load_torque", "load_inertia"),
    "all without line": all_without_line,
    "all": all_with_line,
    "all and everything": lambda axis: {**everything(axis), **all_with_line(axis)},
}


@cache
def drive_of(axis: str, variant: str) -> Drive:
    """A drive of the table, plain or refined."""
    changes = {**VARIANTS, **REFINED}[variant](axis)
    drive = Drive.preset(axis).replace(**{k: v for k, v in changes.items() if k not in OPTIONS})
    options = {k: v for k, v in changes.items() if k in OPTIONS}
    return Drive(replace(drive.parameters, **options)) if options else drive


# --- signals -----------------------------------------------------------------------------------

SIGNALS = (
    "current",
    "current_positive",
    "current_negative",
    "solenoid_force",
    "spool_position",
    "orifice_opening",
    "stroker_pressure",
    "swash_angle",
    "shaft_speed",
    "shaft_position",
    "limits",
)
PRINCIPAL = {"": 5, "current": 13, "stroker_pressure": 17, "shaft_speed": 25, "fields": 17}


class Way(NamedTuple):
    """A way to give a command: an input's name and what else `simulate` is told."""

    voltage: str = "voltage"
    options: Mapping[str, Any] = {}
    time: str | None = None

    def arguments(self, inputs: Inputs) -> Changes:
        """Arguments of `simulate` besides the command."""
        more = {} if self.time is None else {"time": inputs[self.time]}
        return {**self.options, **more}


WAYS = {
    "200 Hz": Way("slow voltage", {"rate": 200.0}),
    "200 Hz, held, seven substeps": Way(
        "slow voltage", {"rate": 200.0, "substeps": 7, "interpolation": "previous"}
    ),
    "1000 Hz": Way("fast voltage", {"rate": 1000.0}),
    "stamps, straight": Way(
        "stamped voltage", {"rate": 512.0, "interpolation": "linear"}, "stamps"
    ),
    "stamps, held": Way("stamped voltage", {"rate": 300.0, "interpolation": "previous"}, "stamps"),
    "steady start": Way("from 4 V", {"start": "steady"}),
    "steady start, minus": Way("from -6 V", {"start": "steady", "rate": 300.0}),
    "clipped": Way("beyond 10 V", {"clip": True}),
}
CURRENT_WAYS = {
    "200 Hz": Way("current", {"rate": 200.0}),
    "1000 Hz, held": Way("current", {"rate": 1000.0, "interpolation": "previous", "substeps": 2}),
    "stamps, straight": Way(
        "stamped current", {"rate": 512.0, "interpolation": "linear"}, "stamps"
    ),
    "stamps, held": Way("stamped current", {"rate": 300.0, "interpolation": "previous"}, "stamps"),
    "steady start": Way("current from 0.4 A", {"start": "steady"}),
}


def signals_of(run: Any, names: tuple[str, ...] = SIGNALS) -> Outputs:
    """Signals of a simulation, and those that only a refined one has."""
    found: Outputs = {name: np.array(getattr(run, name)) for name in names}
    found["time"] = np.array(run.time)
    for name in ("motor_torque", "motor_pressure_drop") if getattr(run, "refined", False) else ():
        values = getattr(run, name, None)
        if values is not None:
            found[name] = np.array(values)
    return found


def simulated(axis: str, variant: str, way: Way, inputs: Inputs) -> Outputs:
    """Signals under a voltage."""
    drive = drive_of(axis, variant)
    return signals_of(drive.simulate(inputs[way.voltage], **way.arguments(inputs)))


def simulated_current(axis: str, variant: str, way: Way, inputs: Inputs) -> Outputs:
    """Signals under a current."""
    drive = drive_of(axis, variant)
    current = inputs[f"{way.voltage} of {axis}"]
    return signals_of(drive.simulate_current(current, **way.arguments(inputs)))


class Stepping(NamedTuple):
    """How a stepper goes."""

    voltage: str = "voltage"
    count: int = 1200
    options: Mapping[str, Any] = {}


STEPPINGS = {
    "default": Stepping(),
    "200 Hz": Stepping("slow voltage", 500, {"h": 1.0 / 200.0}),
    "200 Hz, held": Stepping("slow voltage", 500, {"h": 1 / 200.0, "interpolation": "previous"}),
    "steady start": Stepping("from 4 V", 600, {"start": "steady"}),
    "1000 Hz": Stepping("fast voltage", 700, {"h": 1e-3}),
}


def stepped(axis: str, variant: str, way: Stepping, inputs: Inputs) -> Outputs:
    """Samples of a stepper, and some again from a state that was kept."""
    stepper = drive_of(axis, variant).stepper(**way.options)
    command = inputs[way.voltage][: way.count].tolist()
    half = len(command) // 2
    samples = [stepper.step(volts) for volts in command[:half]]
    state = stepper.state
    samples += [stepper.step(volts) for volts in command[half:]]
    stepper.state = state
    again = [stepper.step(volts) for volts in command[half : half + 100]]
    return {"names": samples[0]._fields, "fields": np.array(samples), "again": np.array(again)}


MANY: dict[str, Callable[[str], Changes]] = {
    "pump": lambda axis: {
        "Z7": np.array([0.0, 0.2, 0.0, 0.3, 0.0, 0.0, 0.1, -1.0]),
        "Z12": np.array([0.0, 0.0, 0.02, 0.03, 0.0, 0.0, 0.01, 0.0]),
        "Z13_plus": np.array([0.05, 0.2, 0.1, 0.2, 0.45, 0.3, 0.41, 0.2]),
        "Z3": np.array([0.6, 0.5, 0.4, 0.6, 0.5, 0.7, 0.3, 0.4]),
        "Z16_minus": np.array([1e-4, 2e-4, 3e-4, inf, 1e-4, 2e-4, 5e-4, 1e-4]),
    },
    "card": lambda axis: {
        "tau": np.array([0.0, 0.014, 0.1, 0.003, 0.5, 0.02]),
        "C": np.array([0.0, 1.0, 5.0, 10.0, 0.5, 0.0]),
        "J_plus": np.array([0.1, 0.2, 0.15, 0.0, 0.05, 0.25]),
        "lim1": np.array([2.0, inf, 1.0, 3.0, 0.5, 2.0]),
        "omega_minus": np.array([50.0, 100.0, 150.0, 60.0, 80.0, 3000.0]),
    },
}


def many(axis: str, variant: str, inputs: Inputs) -> Outputs:
    """Outputs and costs of many sets, some of which fail."""
    drive = drive_of(axis, variant)
    found: Outputs = {}
    for name, changes in MANY.items():
        sets = changes(axis)
        by_voltage = {"voltage": inputs["slow voltage"], "rate": 200.0}
        for output in ("shaft_speed", "shaft_position", "current"):
            batch = drive.simulate_many(sets, output=output, executor=Serial(), **by_voltage)
            assert batch.output is not None
            found[f"{name}, {output}"] = batch.output.T
        found[f"{name}, failures"] = tuple(f"{k}: {why}" for k, why in batch.failures.items())
        measured = drive.simulate(**by_voltage).shaft_speed
        weight = inputs["weight"][: measured.size]
        cost = SquaredError(np.where(weight > 0.0, measured, np.nan), weight)
        found[f"{name}, cost"] = drive.simulate_many(
            sets, cost=cost, executor=Serial(), **by_voltage
        ).cost
    sets = MANY["pump"](axis)
    current = inputs[f"current of {axis}"][:1500]
    batch = drive.simulate_many(sets, current=current, executor=Serial())
    assert batch.output is not None
    found["by current"] = batch.output.T
    cost = SquaredError(np.cumsum(current) / 512.0, output="shaft_position")
    found["by current, cost"] = drive.simulate_many(
        sets, current=current, cost=cost, interpolation="previous", executor=Serial()
    ).cost
    return found


# --- steady states and linear models -----------------------------------------------------------


def steady(axis: str, variant: str, inputs: Inputs) -> Outputs:
    """Steady currents and speeds, the dead zone's edges among them."""
    drive, volts = drive_of(axis, variant), inputs["steady volts"]
    one = float(volts[3])
    return {
        "current": drive.steady_current(volts),
        "speed": drive.steady_speed(volts),
        "one": np.array([drive.steady_current(one), drive.steady_speed(one)]),
    }


STATES = ("voltage", "current", "solenoid_force", "stroker_pressure", "orifice_opening")
POINT = (*STATES, "swash_angle", "shaft_speed")
LINEAR_OUTPUTS = (
    "shaft_speed",
    "swash_angle",
    "stroker_pressure",
    "orifice_opening",
    "spool_position",
    "solenoid_force",
    "current",
)
LINEAR: dict[str, Changes] = {
    "3 V": {"at": 3.0},
    "-4 V, tangent": {"at": -4.0, "coulomb": "tangent"},
    "by speed": {"speed": None},
    "current": {"current": 0.35, "outputs": LINEAR_OUTPUTS[:-1]},
    "force": {"at": -2.0, "input": "solenoid_force", "outputs": LINEAR_OUTPUTS[:-2]},
}
LINEAR_VARIANTS = (
    *("default", "literal", "split", "symmetric", "leaky", "loaded", "steep", "everything"),
    "late",
)


def each_alone(matrix: Array) -> Array:
    """Entries of a matrix as one row, so that each is compared by its own size."""
    return np.asarray(matrix).reshape(1, -1)


def real(values: Any) -> Array:
    """Real parts, then imaginary ones, as one column."""
    numbers = np.asarray(values).reshape(-1)
    return np.concatenate([numbers.real, numbers.imag])


def linear(axis: str, variant: str, chosen: Changes, inputs: Inputs) -> Outputs:
    """Matrices, gains and responses of a linear model, continuous and sampled."""
    drive = drive_of(axis, variant)
    arguments = {"outputs": LINEAR_OUTPUTS, **chosen}
    if "speed" in arguments:
        arguments["speed"] = 0.4 * drive.steady_speed(10.0)
    model = drive.linearize(**arguments)
    point = [getattr(model.operating_point, name) for name in POINT]
    found: Outputs = {
        "states": model.states,
        "one-sided": model.operating_point.one_sided,
        "point": each_alone(np.array([np.nan if x is None else x for x in point])),
        "poles": real(model.poles),
        "gains": each_alone(model.gains),
        "constants": each_alone(
            np.array([model.delay, model.time_constant, model.bandwidth, model.largest_gain])
        ),
    }
    models = {
        "": model,
        "512 Hz, ": model.discrete(1.0 / 512.0),
        "50 Hz, held, ": model.discrete(0.02, "previous"),
    }
    for name, each in models.items():
        found |= {f"{name}{letter}": each_alone(getattr(each, letter)) for letter in "ABCD"}
        response = each.response(inputs["frequencies"])
        for output, row in zip(each.outputs, response, strict=True):
            found[f"{name}response of {output}"] = real(row)
    return found


def swept(axis: str, variant: str, inputs: Inputs) -> Outputs:
    """Describing functions of voltage and current."""
    drive = drive_of(axis, variant)
    sizes = {"voltage": ([0.5, 6.0], 2.0), "current": ([0.1, 0.3], 0.1)}
    found: Outputs = {}
    for name, (amplitudes, bias) in sizes.items():
        response = drive.frequency_response(
            [0.7, 4.0], amplitudes, bias=bias, input=name, tolerance=1e-3
        )
        found[f"{name}, ratio"] = real(response.ratio)
        found[f"{name}, distortion"] = response.distortion.reshape(-1)
        found[f"{name}, mean"] = response.mean.reshape(-1)
        found[f"{name}, cycles"] = response.cycles.reshape(-1)
    return found


# --- derivatives -------------------------------------------------------------------------------


def some_sensitivities(found: Any, outputs: tuple[str, ...]) -> Outputs:
    """Columns of each output."""
    return {"names": found.names, **{name: getattr(found, name) for name in outputs}}


BY_VOLTAGE = ("current_positive", "current_negative", "shaft_speed")
WITH_POSITION = (*BY_VOLTAGE, "current", "shaft_position")
SOME = ("Z16", "tau", "omega_minus", "Z3", "Z10")


def sensitivities(axis: str, variant: str, way: Way, inputs: Inputs) -> Outputs:
    """Sensitivities under a voltage by all columns."""
    found = drive_of(axis, variant).sensitivities(inputs[way.voltage], **way.arguments(inputs))
    return some_sensitivities(found, BY_VOLTAGE)


def chosen_sensitivities(axis: str, variant: str, inputs: Inputs) -> Outputs:
    """Sensitivities of all outputs by some columns, under a voltage and a current."""
    drive = drive_of(axis, variant)
    by_voltage = drive.sensitivities(inputs["slow voltage"], 200.0, parameters=SOME)
    current = inputs[f"current of {axis}"]
    by_current = drive.sensitivities_current(current, parameters=("Z16_minus", "Z4", "Z19"))
    at = by_voltage.at(inputs["stamps"], "shaft_position")
    found = some_sensitivities(by_voltage, WITH_POSITION)
    more = some_sensitivities(by_current, ("shaft_speed", "shaft_position"))
    return {**found, "at": at, **{f"by current, {name}": each for name, each in more.items()}}


def sensitivities_current(axis: str, variant: str, way: Way, inputs: Inputs) -> Outputs:
    """Sensitivities under a current by all columns."""
    current = inputs[f"{way.voltage} of {axis}"]
    found = drive_of(axis, variant).sensitivities_current(current, **way.arguments(inputs))
    return some_sensitivities(found, ("shaft_speed", "shaft_position"))


CARD = (
    *("V_dz", "J", "G1", "G2", "G3", "zeta", "omega", "C", "lim1", "lim2", "I_t1", "I_t2", "a"),
    "tau",
)
PUMP = tuple(f"Z{k}" for k in range(1, 23))
ALL_COLUMNS = (*PUMP, *CARD)
FEW_COLUMNS = ("Z16", "start_pressure", "tau", "Z3", "J", "Z10", "omega", "lim1_plus", "Z17")
MORE_OF = {"leaky": ("Z7",), "loaded": ("Z12",), "steep": ("Z13",), "stopped": ("Z14",)}
SPEEDS = {"hoist": 4.0, "slew": 0.08, "luff": 3.0}


class Seen(NamedTuple):
    """How an experiment is observed."""

    variant: str = "default"
    driven_by: adapter.DrivenBy = "voltage"
    start: adapter.Start = "rest"
    start_pressure: float | None = None
    block: int = 512


def observations(axis: str, inputs: Inputs) -> list[Changes]:
    """Nine observations: off and on the grid, filtered, delayed, with unknowns of their own."""
    stamps, noise, weight = (inputs[name] for name in ("observed", "noise", "weight"))
    speed = SPEEDS[axis]

    def off_grid(first: int, every: int) -> Array:
        return np.array(stamps[first::every])

    def seen(signal: str, time: Array, size: float, **more: Any) -> Changes:
        values = 0.1 * size * noise[: time.size]
        return {"signal": signal, "time": time, "values": values, "weight": 1.0 / size, **more}

    speed_time = off_grid(0, 2)
    weights = weight[: speed_time.size] / speed
    measured = np.where(weights > 0.0, speed * noise[: speed_time.size], np.nan)
    return [
        {
            **seen("shaft_speed", speed_time, speed, poles=(60.0,), delay=0.0113),
            "values": measured,
            "weight": weights,
            "unknown": ("offset", "clock_offset"),
        },
        seen(
            *("current_sum", off_grid(1, 3), 0.5),
            poles=(120.0, 400.0),
            delay=0.0031,
            unknown=("offset",),
        ),
        seen("shaft_position", np.arange(40, 340) / 512.0, 4.0 * speed, unknown=("clock_offset",)),
        seen("stroker_pressure", off_grid(2, 5), 2e5, delay=-0.004),
        seen("swash_angle", off_grid(3, 5), 0.3),
        seen("spool_position", off_grid(4, 5), 1e-4, poles=(300.0,)),
        seen("current", np.arange(0, 1024, 4) / 512.0, 0.5),
        seen("current_positive", off_grid(0, 7), 0.5),
        seen("current_negative", off_grid(5, 7), 0.5, delay=0.002),
    ]


def experiment(axis: str, seen: Seen, inputs: Inputs) -> tuple[Any, Any]:
    """An observed record and values of its own unknowns."""
    if seen.driven_by == "current":
        name = "current" if seen.start == "rest" else "current from 0.4 A"
        record = inputs[f"{name} of {axis}"]
    else:
        record = inputs["voltage" if seen.start == "rest" else "from 4 V"]
    observed = adapter.observe(
        record, 512.0, observations(axis, inputs), seen.driven_by, seen.start
    )
    own = adapter.own_of(seen.start_pressure, inputs["offsets"], inputs["clock offsets"])
    return observed, own


def by_observation(observed: Any, rows: Array) -> Outputs:
    """Rows of each observation."""
    return {
        f"{number} {each.signal}": rows[observed.rows_of(number)]
        for number, each in enumerate(observed.observations)
    }


def residuals(axis: str, seen: Seen, inputs: Inputs) -> Outputs:
    """Weighted residuals of each observation."""
    observed, own = experiment(axis, seen, inputs)
    found = adapter.residuals_of(drive_of(axis, seen.variant), observed, own, seen.block)
    return by_observation(observed, found)


def jacobian(axis: str, seen: Seen, inputs: Inputs) -> Outputs:
    """Derivatives of each observation's residuals by all columns, and the residuals."""
    observed, own = experiment(axis, seen, inputs)
    columns = ALL_COLUMNS if seen.start_pressure is None else (*ALL_COLUMNS, "start_pressure")
    names, J, r, squares = adapter.jacobian_of(
        drive_of(axis, seen.variant), observed, columns, own, seen.block
    )
    found = by_observation(observed, np.column_stack([J, r]))
    return {"names": names, "squares": each_alone(squares), **found}


def triangle(axis: str, seen: Seen, inputs: Inputs) -> Outputs:
    """Triangle of [J r] by all columns: norms of the columns and cosines of their angles.

    The factor itself is noise where columns depend on each other.
    """
    observed, own = experiment(axis, seen, inputs)
    names, factor, squares = adapter.triangle_of(
        drive_of(axis, seen.variant), observed, ALL_COLUMNS, own, seen.block
    )
    norms = np.sqrt((factor**2).sum(axis=0))
    units = factor / np.where(norms > 0.0, norms, 1.0)
    cosines = (units.T @ units)[np.triu_indices(norms.size)]
    return {
        "names": names,
        "squares": each_alone(squares),
        "norms": each_alone(norms),
        "cosines": cosines,
    }


def few_columns(axis: str, seen: Seen, inputs: Inputs) -> Outputs:
    """The triangular factor itself, of columns that are told apart well."""
    observed, own = experiment(axis, seen, inputs)
    columns = (*FEW_COLUMNS, *MORE_OF.get(seen.variant, ()))
    names, factor, squares = adapter.triangle_of(
        drive_of(axis, seen.variant), observed, columns, own, seen.block
    )
    signs = np.where(np.diag(factor) < 0.0, -1.0, 1.0)
    return {"names": names, "squares": each_alone(squares), "factor": signs[:, None] * factor}


# --- full order --------------------------------------------------------------------------------

FULL_SIGNALS = (
    *("solenoid_force", "spool_position", "spool_velocity", "orifice_opening", "valve_flow"),
    *("stroker_pressure", "swash_angle", "swash_rate", "shaft_speed", "shaft_position"),
    *("motor_pressure_drop", "pump_flow", "plate_hold", "relief_hold", "spool_hold"),
)
FULL = ("default", "under load", "stopped", "symmetric", "steady start")
NARROW = {
    "hoist": {"Z13_plus": 0.03, "Z15": 1.2e5},
    "slew": {"Z13_plus": 0.03, "Z15": 7e4},
    "luff": {"Z13_plus": 0.005, "Z15": 3e4},
}
"""Stop and relief pressure that a short command reaches."""


def full_drive(axis: str, variant: str) -> FullOrderDrive:
    """A full-order drive of the table."""
    match variant:
        case "under load":
            load = LOADS[axis].load_torque
            return FullOrderDrive.preset(axis).replace(load_torque=load)
        case "stopped":
            return FullOrderDrive.from_drive(Drive.preset(axis).replace(**NARROW[axis]))
        case "symmetric":
            return FullOrderDrive.from_drive(drive_of(axis, "symmetric"), oil_volume=1.5e-4)
    return FullOrderDrive.preset(axis)


def full_order(axis: str, variant: str, inputs: Inputs) -> Outputs:
    """Signals of the five-state model under a voltage."""
    drive = full_drive(axis, variant)
    if variant == "steady start":
        run = drive.simulate(inputs["from 4 V"][:600], start="steady")
    else:
        run = drive.simulate(inputs["full voltage"])
    return signals_of(run, FULL_SIGNALS)


def full_order_current(axis: str, inputs: Inputs) -> Outputs:
    """Signals of the five-state model under a held current, its modes and its lumps."""
    drive = FullOrderDrive.preset(axis)
    current = inputs[f"current of {axis}"][:500]
    run = drive.simulate_current(current, interpolation="previous")
    modes = drive.modes(0.4)
    more: Outputs = {
        "eigenvalues": real(modes.eigenvalues),
        "modes": real([modes.slow, modes.spool, modes.swash, modes.swash_at_held_pressure]),
        "lumps": each_alone(np.array(list(drive.reduced.parameters.numbers.values()))),
    }
    return {**signals_of(run, FULL_SIGNALS), **more}


# --- the table ---------------------------------------------------------------------------------


def _of_axis(axis: str) -> Iterator[Case]:
    def case(name: str, kind: Class, compute: Any, *arguments: Any, **counts: int) -> Case:
        return Case(
            f"{axis}: {name}",
            kind,
            partial(compute, axis, *arguments),
            counts.pop("counts", None) or {"": counts.get("keep", 64)},
        )

    def signals(name: str, compute: Any, *arguments: Any) -> Case:
        return Case(f"{axis}: {name}", "bits", partial(compute, axis, *arguments), PRINCIPAL)

    for variant in VARIANTS:
        yield signals(f"simulate, {variant}", simulated, variant, Way())
    for name, way in WAYS.items():
        for variant in ("default", "everything"):
            yield signals(f"simulate, {variant}, {name}", simulated, variant, way)
    for variant in PUMP_VARIANTS:
        yield signals(f"simulate_current, {variant}", simulated_current, variant, Way("current"))
    for name, way in CURRENT_WAYS.items():
        for variant in ("default", "everything"):
            yield signals(f"simulate_current, {variant}, {name}", simulated_current, variant, way)
    for name, stepping in STEPPINGS.items():
        for variant in ("default", "everything"):
            yield signals(f"stepper, {variant}, {name}", stepped, variant, stepping)
    yield signals("stepper, literal split", stepped, "literal split", Stepping())
    for variant in ("default", "literal", "split", "symmetric"):
        yield signals(f"simulate_many, {variant}", many, variant)

    for variant in REFINED:
        yield signals(f"simulate, {variant}", simulated, variant, Way())
        yield signals(f"simulate_current, {variant}", simulated_current, variant, Way("current"))
    for name in ("200 Hz", "stamps, held", "steady start"):
        yield signals(f"simulate, all, {name}", simulated, "all", WAYS[name])
    for name in ("1000 Hz, held", "steady start"):
        yield signals(
            f"simulate_current, all, {name}", simulated_current, "all", CURRENT_WAYS[name]
        )
    refined_steps = Stepping(count=700)
    for variant in ("stiction", "leakage", "line", "all without line", "all and everything"):
        yield signals(f"stepper, {variant}", stepped, variant, refined_steps)
    for name in ("200 Hz, held", "steady start"):
        short = STEPPINGS[name]._replace(count=300)
        yield signals(f"stepper, all, {name}", stepped, "all", short)

    for variant in (*VARIANTS, "leakage", "hysteresis", "all without line", "all"):
        yield case(f"steady, {variant}", "tight", steady, variant)
    for variant in LINEAR_VARIANTS:
        few = ("3 V",) if variant == "literal" else ("3 V", "-4 V, tangent")
        for name in LINEAR if variant in ("default", "everything") else few:
            yield case(f"linear, {variant}, {name}", "tight", linear, variant, LINEAR[name])
    for variant in ("default", "everything"):
        yield case(f"sweep, {variant}", "tight", swept, variant)

    for variant in DERIVED_VARIANTS:
        yield case(
            f"sensitivities, {variant}", "derivatives", sensitivities, variant, Way(), keep=3
        )
    for name in ("200 Hz", "stamps, held", "steady start"):
        yield case(
            f"sensitivities, everything, {name}",
            "derivatives",
            sensitivities,
            "everything",
            WAYS[name],
            keep=3,
        )
    for variant in ("default", "everything"):
        yield case(
            f"sensitivities, {variant}, some columns",
            "derivatives",
            chosen_sensitivities,
            variant,
            keep=12,
        )
        yield case(
            f"sensitivities_current, {variant}, steady start",
            "derivatives",
            sensitivities_current,
            variant,
            CURRENT_WAYS["steady start"],
            keep=3,
        )
    for variant in ("default", "symmetric", "leaky", "loaded", "steep", "everything", "stopped"):
        yield case(
            f"sensitivities_current, {variant}",
            "derivatives",
            sensitivities_current,
            variant,
            Way("current"),
            keep=3,
        )

    for name, seen in {
        "default": Seen(start_pressure=2e4),
        "everything, steady start": Seen("everything", start="steady"),
        "current": Seen("default", "current", start_pressure=-1e4),
        "everything, current, steady start": Seen("everything", "current", "steady"),
    }.items():
        yield case(f"jacobian, {name}", "derivatives", jacobian, seen, keep=2)
    for name, seen in {
        "default": Seen(),
        "everything, blocks of 100": Seen("everything", block=100),
        "default, steady start, blocks of 17": Seen(start="steady", block=17),
    }.items():
        yield case(f"triangle, {name}", "derivatives", triangle, seen, keep=5000)
    for variant in DERIVED_VARIANTS:
        seen = Seen(variant, start_pressure=1.5e4, block=64)
        yield case(f"triangle, few columns, {variant}", "derivatives", few_columns, seen, keep=100)
    for variant in DERIVED_VARIANTS:
        yield case(f"residuals, {variant}", "tight", residuals, Seen(variant, block=7), keep=6)
    seen = Seen("everything", start="steady", start_pressure=3e4)
    yield case("residuals, everything, start pressure", "tight", residuals, seen, keep=6)

    for variant in FULL:
        yield case(f"full order, {variant}", "derivatives", full_order, variant, keep=16)
    yield case("full order, current", "derivatives", full_order_current, keep=16)


CASES: dict[str, Case] = {each.name: each for axis in AXES for each in _of_axis(axis)}
