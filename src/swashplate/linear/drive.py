"""The linear model of a drive: continuous, and at a sample time as the march has it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.marching.record import Interpolation, least_substeps
from swashplate.equations.marching.run import Instance, Started
from swashplate.errors import InputError
from swashplate.linear.discrete import Recurrence, recurrence
from swashplate.linear.model import UNITS, Coulomb, LinearDrive, Matrices, with_line
from swashplate.linear.operating_point import (
    COMMANDS,
    INPUTS,
    Input,
    OperatingPoint,
    beyond_dead_zone,
    operating_point,
)
from swashplate.models.card import Card
from swashplate.models.channel import COULOMB_WIDTH
from swashplate.models.pump import PumpState
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.simulation.instance import (
    card_of,
    check_filter_stability,
    instance_of,
    models_of,
    without_ripple,
)
from swashplate.tables import UNIT, Cell, Column, Table
from swashplate.units import display_unit

Array = NDArray[np.float64]

OUTPUTS = (
    "shaft_speed",
    "swash_angle",
    "stroker_pressure",
    "orifice_opening",
    "spool_position",
    "solenoid_force",
    "current",
    "motor_torque",
    "motor_pressure_drop",
)
"""Signals that a linear model can have as outputs."""
FORCE = {"Z17": 0.0, "Z19_plus": 1.0, "Z19_minus": 1.0} | dict.fromkeys(
    ("Z20_plus", "Z20_minus", "Z21_plus", "Z21_minus", "Z22_plus", "Z22_minus"), 0.0
)
"""Solenoids whose force is the current, for a model whose input is the force."""


def linearize_drive(
    parameters: ParameterSet,
    voltage: float | None = None,
    current: float | None = None,
    speed: float | None = None,
    input: Input | Sequence[Input] | None = None,
    outputs: Sequence[str] = ("shaft_speed",),
    coulomb: Coulomb = "ignored",
) -> LinearDrive:
    """Linear model of small motions about a steady state; see `Drive.linearize`."""
    if input is None:
        input = "voltage" if current is None else "current"
    inputs = _checked_inputs((input,) if isinstance(input, str) else tuple(input))
    if coulomb not in ("ignored", "tangent"):
        raise InputError(f"coulomb is '{coulomb}'; it is 'ignored' or 'tangent'.")
    if coulomb == "tangent" and parameters.coulomb_sign == "literal":
        raise InputError(
            "The literal sign of the card's Coulomb term has no slope; linearise with "
            "coulomb='ignored'."
        )
    point = operating_point(parameters, inputs[0], voltage=voltage, current=current, speed=speed)
    names = _checked_outputs(outputs, inputs[0])
    matrices, states, _, _ = _matrices(parameters, point, inputs, names, coulomb)
    delay = parameters.numbers["tau"] if inputs[0] == "voltage" else 0.0
    kept = point, coulomb, parameters
    return LinearDrive(*matrices, states, inputs, names, delay, None, parameters.name, (), *kept)


def _checked_inputs(inputs: tuple[str, ...]) -> tuple[str, ...]:
    for name in inputs:
        if name not in INPUTS:
            raise InputError(f"The input is '{name}', but must be one of {', '.join(INPUTS)}.")
    if not inputs or len(set(inputs)) != len(inputs) or set(inputs[1:]) & set(COMMANDS):
        raise InputError(
            "A linear model needs one input or several different ones, of which the first alone "
            f"may be a command: {', '.join(COMMANDS)}."
        )
    return inputs


def _checked_outputs(outputs: Sequence[str], input: str) -> tuple[str, ...]:
    """Names of outputs, refused where the input is all there is before them."""
    names = (outputs,) if isinstance(outputs, str) else tuple(outputs)
    possible = [name for name in OUTPUTS if name != input]
    if input == "solenoid_force":
        possible.remove("current")
    for name in names:
        if name not in possible:
            raise InputError(
                f"'{name}' is no output of a model from {input.replace('_', ' ')}; it has "
                f"{', '.join(possible)}."
            )
    if not names or len(set(names)) != len(names):
        raise InputError("A linear model needs one output or several different ones.")
    return names


# --- the pump -------------------------------------------------------------------------------------


class _Known(NamedTuple):
    """A drive with numbers at its operating point."""

    instance: Instance
    started: Started
    records: tuple[str, ...]  # external signals that stand for the inputs
    step: float  # 0 in continuous time [s]


def _known(
    parameters: ParameterSet,
    point: OperatingPoint,
    inputs: tuple[str, ...],
    coulomb: Coulomb,
    step: float,
) -> _Known:
    """The equations at the point, with whatever small motions leave out."""
    by_voltage = inputs[0] == "voltage"
    instance = without_ripple(instance_of(parameters, by_voltage))
    front, machine = instance.parts
    command, at = "current", {"current": point.current}
    if by_voltage:
        assert point.voltage is not None
        if coulomb == "ignored":
            plus, minus = (each._replace(C=0.0) for each in (front.p.plus, front.p.minus))
            front = front._replace(p=Card(plus, minus, front.p.tau))
        command, at = "voltage", {"voltage": beyond_dead_zone(point.voltage, front.p)}
    elif inputs[0] == "solenoid_force":
        options = machine.options._replace(hysteresis=None)
        machine = machine._replace(p=machine.p._replace(**FORCE), options=options)
        at = {"current": point.solenoid_force}
    model = instance.model
    if step == 0.0:
        models = models_of(parameters.equations)
        model = models.flowing_drive if by_voltage else models.flowing_pump_drive
    instance = Instance(model, (front, machine), instance.name)
    p = machine.p
    at |= {"load_torque": p.load_torque, "pump_speed": p.pump_speed, "supply_pressure": p.Z9}
    records = tuple(command if name in COMMANDS else name for name in inputs)
    return _Known(instance, _standing(instance, at, step, point), records, step)


def _standing(
    instance: Instance, at: dict[str, float], step: float, point: OperatingPoint
) -> Started:
    """A drive that has stood at its operating point for longer than a sample."""
    card = instance.start(at, step, "steady").states[0]
    pressure = point.stroker_pressure
    apart = float(np.spacing(abs(pressure)))
    while True:
        state = PumpState(pressure, pressure, point.current)
        started = instance.start(at, step, "steady", (card, state))
        signals = started.arguments[1]["signals"]
        if point.orifice_opening != 0.0 or signals.orifice_opening >= 0.0:
            break
        # closed but for rounding: the side of positive opening, in case its root is another one
        pressure, apart = pressure - apart, 2.0 * apart
    state = state._replace(
        spool=signals.spool_free,
        torque=signals.motor_torque,
        speed=signals.shaft_speed,
        flow_speed=signals.flow_speed,
        load_torque=at["load_torque"],
        begun=1.0,
    )
    return instance.start(at, step, "steady", (card, state))


def _pump_states(known: _Known) -> dict[str, str]:
    """States of the pump that move, and what they are called."""
    p, options, _ = known.instance.parts[1]
    sampled = known.step > 0.0
    found = {"pressure": "stroker_pressure"}
    if options.damping is not None:
        found["plate_pressure"] = "plate_pressure"
    if options.friction is not None and isfinite(p.dither_time):
        found["deflection"] = "spool_deflection"
    if options.line is not None:
        ending = "_before" if sampled else ""
        found |= {"torque": f"motor_torque{ending}", "speed": f"shaft_speed{ending}"}
        if sampled:
            found["flow_speed"] = "flow_speed_before"
        if sampled and "load_torque" in known.records:
            found["load_torque"] = "load_torque_before"
    return {f"pump.{path}": name for path, name in found.items()}


def _one_deflection(found: Recurrence, known: _Known) -> Recurrence:
    """The same with one state of the friction in place of two, place and deflection of the spool.

    The next sample knows them only as d e^(-h/T) - x w/x_s: the deflection that would be left if
    the spool came back to where it was balanced. In continuous time it is the state itself.
    """
    p, options, _ = known.instance.parts[1]
    if known.step == 0.0 or options.friction is None:
        return found
    k = known.started.arguments[1]["k"]
    A, B, C = found.A.copy(), found.B.copy(), found.C.copy()
    spool, deflection = (found.states.index(f"pump.{name}") for name in ("spool", "deflection"))
    friction = k.friction_width / p.spool_presliding
    for matrix in (A, C):
        matrix[:, deflection] = -matrix[:, spool] / friction
    for matrix in (A, B):
        matrix[deflection] = k.dither_factor * matrix[deflection] - friction * matrix[spool]
    return found._replace(A=A, B=B, C=C)


def _matrices(
    parameters: ParameterSet,
    point: OperatingPoint,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    coulomb: Coulomb = "ignored",
    step: float = 0.0,
) -> tuple[Matrices, tuple[str, ...], tuple[str, ...], int]:
    """Matrices, states, those of them that are past commands, and whole samples of delay.

    States behind a voltage: the commands since the delay's whole samples (its fraction lies between
    the last two), what the filter of the channel that is driven remembers, the pump. In continuous
    time, at a step of 0, the delay stands apart.
    """
    known = _known(parameters, point, inputs, coulomb, step)
    found = recurrence(known.instance, known.started, step, known.records, outputs)
    found = _one_deflection(found, known)
    names, sign = _pump_states(known), 1.0
    if inputs[0] == "voltage":
        assert point.voltage is not None
        side, sign = ("plus", 1.0) if point.voltage >= 0.0 else ("minus", -1.0)
        rate = step == 0.0 or known.instance.parts[0].options.exact is not None
        names = {
            f"card.{side}.before": "current_rate" if rate else "current_before",
            f"card.{side}.now": "current",
            **names,
        }
    at = [found.states.index(path) for path in names]
    # a channel counts in its own direction, the model in that of the speed
    signs = np.array([sign if path.startswith("card.") else 1.0 for path in names])
    A, C = found.A[np.ix_(at, at)] * np.outer(signs, signs), found.C[:, at] * signs
    B, D = found.B[at] * signs[:, np.newaxis], found.D
    states = tuple(names.values())
    if inputs[0] != "voltage" or step == 0.0:
        return (A, B, C, D), states, (), 0
    whole = int(known.instance.places(known.records, step).whole[0])
    late = {late: k for k, (of, late) in enumerate(found.columns) if of == "voltage"}
    others = [k for k, (of, _) in enumerate(found.columns) if of != "voltage"]
    read = [k for lag, k in late.items() if lag > whole + 1 and (B[:, k].any() or D[:, k].any())]
    past, now = [late[whole + 1], *read], [late[whole], *others]
    count = len(past)
    memory = ("voltage_before", *(f"voltage_before_{j}" for j in range(2, count + 1)))
    line = np.block([[np.eye(count, k=-1), np.zeros((count, len(at)))], [B[:, past], A]])
    into = np.hstack((np.eye(count, 1), np.zeros((count, len(others)))))
    matrices = line, np.vstack((into, B[:, now])), np.hstack((D[:, past], C)), D[:, now]
    return matrices, (*memory, *states), memory, whole


def slowest_lag(parameters: ParameterSet) -> float:
    """Time within which a drive at rest forgets most: pump's and card's lags and the delay. [s]"""
    numbers = parameters.numbers
    changes = {"Z18": 0.0}
    if "spool_friction" in numbers and numbers.get("spool_presliding", 0.0) == 0.0:
        changes["spool_friction"] = 0.0  # it holds the spool fast, for ever
    rest = OperatingPoint(None, 0.0, 0.0, numbers["Z2"] / numbers["Z1"], 0.0, 0.0, 0.0)
    (A, *_), *_ = _matrices(
        parameters.replace(changes), rest, ("solenoid_force",), ("swash_angle",)
    )
    poles = np.linalg.eigvals(A)
    lasting = poles[-poles.real > 1e-6 * np.abs(poles)]
    lag = 1.0 / float(-lasting.real.max())
    card = card_of(parameters)
    # of the filter with the slope that its Coulomb term has at rest
    cards = (
        (2.0 * each.zeta * each.omega + each.C / COULOMB_WIDTH) / each.omega**2
        for each in (card.plus, card.minus)
    )
    return numbers["tau"] + lag + max(cards)


# --- at a sample time -----------------------------------------------------------------------------


def sampled(
    model: LinearDrive, sample_time: float, interpolation: Interpolation = "linear"
) -> LinearDrive:
    """Linear model at a sample time; see `LinearDrive.discrete`.

    Raises
    ------
    InputError
        For a sample time outside 10 µs to 0.1 s, or one at which the card's filter is unstable.
    """
    if interpolation not in ("linear", "previous"):
        raise InputError(f"interpolation is '{interpolation}'; it is 'linear' or 'previous'.")
    if not sample_time > 0.0:
        raise InputError(f"The sample time is {sample_time:g} s, but must be above 0.")
    rate = 1.0 / sample_time
    substeps = least_substeps(round(rate) if abs(rate - round(rate)) < 1e-9 * rate else rate)
    step = sample_time / substeps
    if model.input == "voltage":
        check_filter_stability(model.parameters, step)
    matrices, states, memory, whole = _matrices(
        *(model.parameters, model.operating_point, model.inputs, model.outputs, model.coulomb, step)
    )
    delay = whole * step
    if substeps > 1:
        before = len(states)
        matrices, states = with_line(matrices, states, model.input, whole)
        line, last = states[: len(states) - before], tuple(f"{name}_last" for name in model.inputs)
        # what is measured beside the command goes straight from sample to sample
        held = [interpolation == "previous", *(False for _ in model.inputs[1:])]
        matrices = _lifted(*matrices, substeps, held)
        states, memory, delay = (*states, *last), (*line, *memory, *last), 0.0
    A, B, C, D = matrices
    found = replace(model, A=A, B=B, C=C, D=D, states=states, memory=memory)
    return replace(found, delay=delay, sample_time=sample_time)


def _lifted(
    A: Array, B: Array, C: Array, D: Array, substeps: int, held: Sequence[bool]
) -> Matrices:
    """Several steps as one sample.

    The state is that of the step after the sample before, together with the inputs at that sample:
    from there on the steps up to this sample know their inputs.
    """
    n, k = B.shape
    # columns: the state, the last inputs, the present ones
    z = np.eye(n, n + 2 * k)
    y = np.empty(0)
    for j in range(1, substeps + 1):
        rise = np.array([float(j == substeps) if each else j / substeps for each in held])
        u = np.hstack((np.zeros((k, n)), np.diag(1.0 - rise), np.diag(rise)))
        y = C @ z + D @ u
        z = A @ z + B @ u
    longer = np.zeros((n + k, n + k))
    longer[:n] = z[:, : n + k]
    into = np.vstack((z[:, n + k :], np.eye(k)))
    return longer, into, y[:, : n + k], y[:, n + k :]


# --- tables ---------------------------------------------------------------------------------------


def model_tables(
    model: LinearDrive, frequency: float, loop_gain: float | None = None
) -> list[Table]:
    """Operating point, small motion and poles of a model, and margins of a loop closed over it.

    Parameters
    ----------
    model : LinearDrive
        From voltage, current or force to the shaft's speed.
    frequency : float
        At which gain and phase are given. [Hz]
    loop_gain : float, optional
        Of a proportional speed loop. [V, A or N / (rad/s)]
    """
    point, poles = model.operating_point, model.poles
    made, moving = _key_values("Operating point"), _key_values("Small motion")
    if point.voltage is not None:
        made.add("voltage", point.voltage, unit="V")
    made.add("current", Cell(point.current, f"{point.current:z.4f}"), unit="A")
    made.add("swash angle", point.swash_angle, unit="rad", spec="z.3f")
    made.add("shaft speed", point.shaft_speed, unit="rad/s", spec="z.3f")

    unit, answer = UNITS[model.input], complex(model.response(frequency)[0])
    moving.add("steady gain", model.gain, unit=f"rad/s/{unit}", spec="z.5g")
    moving.add("time constant of the pump", model.time_constant, unit="s")
    if model.input == "voltage":
        delay = 1e3 * model.parameters.numbers["tau"]
        moving.add("delay of the card", delay, unit="ms", spec="z.3f")
    moving.add("bandwidth (-3 dB)", _finite(model.bandwidth), unit="Hz", spec=".4g")
    at = f"at {frequency:g} Hz"
    moving.add(f"gain {at}", abs(answer), unit=f"rad/s/{unit}", spec=".5g")
    moving.add(f"phase {at}", float(np.angle(answer, deg=True)), unit="deg", spec="z.2f")
    largest = _finite(model.largest_gain)
    moving.add("largest proportional gain", largest, unit=f"{unit}/(rad/s)", spec=".4g")

    heads = (("real", "z.5g"), ("imaginary", "s"), ("Hz", ".4g"), ("damping", ".3f"))
    pole_table = Table("", (Column("Poles"), *(Column(*each) for each in heads)))
    h = model.sample_time
    for pole in poles[poles.imag >= 0.0]:  # its conjugate stands for both
        s = pole if h is None else np.log(pole) / h
        size = float(abs(s))
        imaginary = f"±{pole.imag:.5g}" if pole.imag else ""
        numbers = float(pole.real), imaginary, size / (2.0 * np.pi), float(-s.real) / size
        pole_table.add("rad/s" if h is None else "z", *numbers)
    tables = [made, moving, pole_table]
    if loop_gain is None:
        return tables
    margins, shown = model.margins(loop_gain), display_unit(f"{unit}/(rad/s)")
    loop = _key_values(f"Proportional loop, {shown.factor * loop_gain:g} {shown.name}")
    loop.add("crossover", margins.crossover or Cell(None, "none"), unit="Hz", spec=".4g")
    loop.add("phase margin", _finite(np.degrees(margins.phase_margin)), unit="deg", spec=".1f")
    loop.add("delay margin", _finite(1e3 * margins.delay_margin), unit="ms", spec=".2f")
    loop.add("gain margin", _finite(margins.gain_margin), spec=".3g")
    return [*tables, loop]


def _key_values(title: str) -> Table:
    return Table("", (Column(title), Column("", "z.4f", none="no limit"), UNIT))


def _finite(value: float) -> float | None:
    return None if np.isinf(value) else float(value)
