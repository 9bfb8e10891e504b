"""The linear model of a drive: where it is taken, continuous, and at a sample time as the march is.

Small motions leave out the cam ring's ripple, which does not change the mean of a turn, and the
card's rate limits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from math import ceil, isfinite, log, nextafter
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from swashplate.drive.instance import (
    card_of,
    check_filter_stability,
    instance_of,
    models_of,
    without_ripple,
)
from swashplate.drive.march import steady_states
from swashplate.drive.simulation import UNITS
from swashplate.equations.declaration import interpreted
from swashplate.equations.fields import is_real
from swashplate.equations.marching.record import (
    SOURCE_RATE,
    Interpolation,
    check_rate,
    least_substeps,
)
from swashplate.equations.marching.run import Instance, called
from swashplate.errors import DomainError, InputError
from swashplate.linear.discrete import recurrence
from swashplate.linear.model import LinearModel, Matrices, with_line
from swashplate.models.card import Card
from swashplate.models.displacement_control import moment_sine, solenoid_force
from swashplate.models.pump import overpowered
from swashplate.models.refinements import dither_factor, friction_width
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.results import Result
from swashplate.tables import UNIT, Cell, Column, Table
from swashplate.units import display_unit

Array = NDArray[np.float64]
Coulomb = Literal["ignored", "tangent"]
Input = Literal[
    "voltage", "current", "solenoid_force", "load_torque", "pump_speed", "supply_pressure"
]

INPUTS: tuple[Input, ...] = get_args(Input)
COMMANDS = INPUTS[:3]  # Of which one moves at a time; the others can move beside it.
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
PLATE_STATES = ("stroker_pressure", "plate_pressure", "spool_deflection")
"""States between current and swash angle."""
NO_GAIN = {
    "swash_stop": "the swash plate is at its stop",
    "relief": "the pressure is at its limit Z15",
    "orifice": "the leakage takes all that the open orifice lets through",
    "spool": "the leakage takes all that the open spool lets through",
}
"""What holds the speed under limits of the pump, see `swashplate.models.pump.PumpLimits`."""
FORCE = {"Z17": 0.0, "Z19_plus": 1.0, "Z19_minus": 1.0} | dict.fromkeys(
    ("Z20_plus", "Z20_minus", "Z21_plus", "Z21_minus", "Z22_plus", "Z22_minus"), 0.0
)
"""Solenoids whose force is the current, for a model whose input is the force."""
DECIMALS = 4
"""Of the voltage that is proposed; rounded away from 0 V, so that it does have a model."""
SHOWN_AT = 0.3
"""Frequency at which a model shows its gain and phase: of a load's swing. [Hz]"""
CLOSED = 64.0 * float(np.finfo(float).eps)
"""By this much tan α_sw stands below a closed spool, on the side of positive opening."""


@dataclass(frozen=True)
class OperatingPoint:
    """A steady state; signs as everywhere: positive goes with more speed."""

    voltage: float | None
    """None where a current was given. [V]"""
    current: float
    """Signed. [A]"""
    solenoid_force: float
    """[N]"""
    stroker_pressure: float
    """δP. [Pa]"""
    orifice_opening: float
    """x_eff: zero, unless the stroking piston leaks. [m]"""
    swash_angle: float
    """[rad]"""
    shaft_speed: float
    """The mean of a turn. [rad/s]"""
    one_sided: tuple[str, ...] = ()
    """Switches that the point lies on, and the side whose slope is taken."""


@dataclass(frozen=True, eq=False)
class LinearDrive(LinearModel, Result):
    """Small motions of a drive about an operating point."""

    operating_point: OperatingPoint
    coulomb: Coulomb
    """Whether the card's Coulomb term is left out or counts with its slope at rest."""
    parameters: ParameterSet
    """The drive that was linearised."""

    __repr__ = LinearModel.__repr__

    def tables(self) -> list[Table]:
        """Operating point, small motion and poles, as of `model_tables`."""
        return model_tables(self, SHOWN_AT)

    def content(self) -> dict[str, Any]:
        """What is written of a model; see `LinearModel.content`."""
        point = {k: v for k, v in asdict(self.operating_point).items() if v is not None}
        sides = {"coulomb": self.coulomb, "one_sided": list(point.pop("one_sided"))}
        # tables last, as TOML has them
        return {**super().content(), **sides, "operating_point": point}

    @property
    def time_constant(self) -> float:
        """Time constant of the pump's lag, from current to swash angle. [s]

        At rest without plussing τ = (1 + Z6)/(Z1 Z3 Z5 Z8 √(Z9/2)); Kruse (2001), eqs. 6.72-6.74
        with errata 4 and 23. Of a sampled model that of the lag with the same pole; one that is
        shorter than its step is refused in a `DomainError`. Where friction or damping give it more
        poles than one, that of the slowest.
        """
        slowest = self.poles_of(*PLATE_STATES)[0]
        if self.sample_time is None:
            return -1.0 / float(slowest.real)
        pole = float(abs(slowest) if slowest.imag else slowest.real)
        if not 0.0 < pole < 1.0:
            raise DomainError(
                f"{self.name}: sampled at {self.sample_time:g} s the pump's pole is at z = "
                f"{pole:g}, which is no lag's; take a smaller sample time."
            )
        return -self.sample_time / log(pole)

    def discrete(self, sample_time: float, interpolation: Interpolation = "linear") -> LinearDrive:
        """The model at a sample time of 10 µs to 0.1 s, with the recurrences of the march. [s]

        Between samples the input is a straight line or held, as in `Drive.simulate`; above 1/512 s
        the march's own sub-steps are taken. Agrees with a small motion of `Drive.simulate` or
        `Drive.stepper` sample for sample.

        Raises
        ------
        InputError
            For another sample time, or one at which the card's filter is unstable.
        """
        if interpolation not in ("linear", "previous"):
            raise InputError(f"interpolation is '{interpolation}'; it is 'linear' or 'previous'.")
        check_rate(sample_time, "sample time", "s")
        rate = 1.0 / sample_time
        substeps = least_substeps(round(rate) if abs(rate - round(rate)) < 1e-9 * rate else rate)
        step = sample_time / substeps
        if self.input == "voltage":
            check_filter_stability(self.parameters, step)
        at = self.parameters, self.operating_point, self.inputs, self.outputs, self.coulomb
        matrices, states, memory, whole = _matrices(*at, step)
        delay = whole * step
        if substeps > 1:
            line = tuple(f"{self.input}_{k}" for k in range(1, whole + 1))
            last = tuple(f"{name}_last" for name in self.inputs)
            # what is measured beside the command goes straight from sample to sample
            held = [interpolation == "previous", *(False for _ in self.inputs[1:])]
            matrices = _lifted(*with_line(matrices, whole), substeps, held)
            states, memory, delay = (*line, *states, *last), (*line, *memory, *last), 0.0
        A, B, C, D = matrices
        found = replace(self, A=A, B=B, C=C, D=D, states=states, memory=memory)
        return replace(found, delay=delay, sample_time=sample_time)


def linearize_drive(
    parameters: ParameterSet,
    voltage: float | None = None,
    current: float | None = None,
    input: Input | Sequence[Input] | None = None,
    outputs: Sequence[str] = ("shaft_speed",),
    coulomb: Coulomb = "ignored",
) -> LinearDrive:
    """Linear model of small motions about a steady state; see `Drive.linearize`."""
    if input is None:
        input = "voltage" if current is None else "current"
    inputs: tuple[str, ...] = (input,) if isinstance(input, str) else tuple(input)
    for name in inputs:
        if name not in INPUTS:
            raise InputError(f"The input is '{name}', but must be one of {', '.join(INPUTS)}.")
    if not inputs or len(set(inputs)) != len(inputs) or set(inputs[1:]) & set(COMMANDS):
        raise InputError(
            "A linear model needs one input or several different ones, of which the first alone "
            f"may be a command: {', '.join(COMMANDS)}."
        )
    names = (outputs,) if isinstance(outputs, str) else tuple(outputs)
    before = {inputs[0], "current"} if inputs[0] == "solenoid_force" else {inputs[0]}
    possible = [name for name in OUTPUTS if name not in before]
    for name in names:
        if name not in possible:
            raise InputError(
                f"'{name}' is no output of a model from {inputs[0].replace('_', ' ')}; it has "
                f"{', '.join(possible)}."
            )
    if not names or len(set(names)) != len(names):
        raise InputError("A linear model needs one output or several different ones.")
    if coulomb not in ("ignored", "tangent"):
        raise InputError(f"coulomb is '{coulomb}'; it is 'ignored' or 'tangent'.")
    if coulomb == "tangent" and parameters.coulomb_sign == "literal":
        raise InputError(
            "The literal sign of the card's Coulomb term has no slope; linearise with "
            "coulomb='ignored'."
        )
    point = operating_point(parameters, inputs[0], voltage, current)
    matrices, states, _, _ = _matrices(parameters, point, inputs, names, coulomb)
    delay = parameters.numbers["tau"] if inputs[0] == "voltage" else 0.0
    kept = point, coulomb, parameters
    return LinearDrive(*matrices, states, inputs, names, delay, None, parameters.name, (), *kept)


# --- operating point ------------------------------------------------------------------------------


def operating_point(
    parameters: ParameterSet,
    input: str,
    voltage: float | None = None,
    current: float | None = None,
) -> OperatingPoint:
    """Steady state at which small motions of an input, one of `INPUTS`, have an answer.

    Given by either of voltage [V] and current [A]. Refused is where nothing moves: in a dead zone,
    within the solenoids' hysteresis, at a stop of the swash plate, at the relief pressure, behind a
    saturated orifice, in the grip of a friction without presliding; or where the solenoid
    overpowers the feedback spring.
    """
    name, given = parameters.name, current if voltage is None else voltage
    if given is None or (voltage is not None and current is not None):
        raise InputError("Linearise at a voltage or a current; give exactly one of them.")
    if not is_real(given) or not isfinite(given):
        raise InputError(f"Linearise at a finite number of volts or amperes, not {given}.")
    if input == "voltage" and voltage is None:
        raise InputError("A model from the voltage needs a voltage to linearise at, not a current.")
    if voltage is not None:
        if abs(voltage) > FULL_VOLTAGE:
            raise InputError(f"The voltage is {voltage:g} V, but the card takes ±10 V.")
        current = float(steady_states(parameters, np.array([voltage]))[0][0])
    assert current is not None
    instance = without_ripple(instance_of(parameters, False))
    pump, options, _ = instance.parts[1]
    replacements = instance.model.parts[1].replacements
    force = interpreted(solenoid_force, replacements)(current, pump)
    sine = interpreted(moment_sine, replacements)(force, pump)
    if not (margin := 1.0 - sine * sine) > 0.0:
        raise DomainError(f"{name}: {overpowered(margin, 'current')}")

    sides = []
    if input == "voltage":
        assert voltage is not None
        card = card_of(parameters)
        channel = card.plus if voltage >= 0.0 else card.minus
        if channel.V_dz == channel.J == voltage == 0.0:
            sides.append("card at 0 V: the side of positive voltage")
        elif abs(voltage) <= channel.V_dz:
            zone = f"{voltage:g} V lies in the card's dead zone"
            raise DomainError(f"{name}: {zone}, so the gain is 0; {_beyond(parameters, voltage)}.")
    if input in ("voltage", "current"):
        if options.hysteresis is not None:
            raise DomainError(
                f"{name}: a current that moves by less than the solenoids' hysteresis of "
                f"±{pump.solenoid_hysteresis:g} A moves no force, so the gain is 0; linearise the "
                "drive without it (solenoid_hysteresis=0) for larger motions, or the pump alone "
                "with input solenoid_force, or sweep sines of a size with frequency_response."
            )
        if pump.Z17 == current == 0.0:
            sides.append("solenoids at 0 A: the side of positive current")
        elif abs(current) <= pump.Z17:
            at = "" if voltage is None else f"{voltage:g} V gives "
            instead = f"linearise beyond ±{pump.Z17:g} A"
            raise DomainError(
                f"{name}: {at}{current:.6g} A, which lies in the solenoids' dead zone of Z17 = "
                f"±{pump.Z17:g} A, so the gain is 0; "
                f"{instead if voltage is None else _beyond(parameters, voltage)}."
            )
    if options.friction is not None and pump.spool_presliding == 0.0:
        raise DomainError(
            f"{name}: without spool_presliding the spool_friction of {pump.spool_friction:g} N "
            "holds the spool fast under small motions, so the gain is 0; give a presliding, or "
            "sweep sines of a size with frequency_response."
        )
    known = instance.start({"current": current}, 1.0 / SOURCE_RATE, "steady").arguments[1]
    equations: Any = instance.model.parts[1]
    limits = called(equations, equations.limits, known)
    for limit, what in NO_GAIN.items():
        if getattr(limits, limit):
            raise DomainError(
                f"{name}: {what}, so the gain is 0; linearise at a smaller command, where the "
                "speed still follows."
            )
    signals = known["signals"]
    # without leakage the spool is closed, but for rounding
    opening = 0.0 if options.leaky is None else signals.orifice_opening
    if options.symmetric is not None and opening == 0.0:
        sides.append("flow root at a closed spool: the side of positive opening")
    return OperatingPoint(
        *(voltage, current, signals.solenoid_force, signals.stroker_pressure, opening),
        *(signals.swash_angle, signals.shaft_speed, tuple(sides)),
    )


def _beyond(parameters: ParameterSet, voltage: float) -> str:
    """What to linearise instead of in a dead zone: at the first voltage of the side beyond it."""
    way, sign, side = (1.0, "+", "plus") if voltage >= 0.0 else (-1.0, "-", "minus")
    # a zone's end is part of it, so that the first step beyond has a model
    steps = np.arange(1, ceil(FULL_VOLTAGE * 10**DECIMALS) + 1) / 10**DECIMALS
    current, _ = steady_states(parameters, way * steps)
    numbers = parameters.numbers
    answers = (steps > numbers[f"V_dz_{side}"]) & (np.abs(current) > numbers["Z17"])
    instead = f"no voltage up to {sign}{FULL_VOLTAGE:g} V leaves it: linearise on the other side"
    if answers.any():
        first = steps[int(np.argmax(answers))]
        instead = f"linearise at {sign}{first:.{DECIMALS}f} V or beyond"
    return f"{instead}, or the pump alone at current 0 with input solenoid_force"


# --- matrices -------------------------------------------------------------------------------------


def _matrices(
    parameters: ParameterSet,
    point: OperatingPoint,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    coulomb: Coulomb = "ignored",
    step: float = 0.0,
) -> tuple[Matrices, tuple[str, ...], tuple[str, ...], int]:
    """Matrices, states, those of them that are past inputs, and whole samples of delay.

    In continuous time, at a step of 0, the delay stands apart.
    """
    by_voltage = inputs[0] == "voltage"
    instance = without_ripple(instance_of(parameters, by_voltage))
    front, machine = instance.parts
    command, side, sign, at = "current", "", 1.0, {"current": point.current}
    if by_voltage:
        assert point.voltage is not None
        side, sign = ("plus", 1.0) if point.voltage >= 0.0 else ("minus", -1.0)
        if coulomb == "ignored":
            plus, minus = (each._replace(C=0.0) for each in (front.p.plus, front.p.minus))
            front = front._replace(p=Card(plus, minus, front.p.tau))
        # at a dead zone without width, by a hair
        command = "voltage"
        at = {command: point.voltage or nextafter(0.0, 1.0)}
    elif inputs[0] == "solenoid_force":
        options = machine.options._replace(hysteresis=None)
        machine = machine._replace(p=machine.p._replace(**FORCE), options=options)
        at = {"current": point.solenoid_force}
    p, options, _ = machine
    at |= {"load_torque": p.load_torque, "pump_speed": p.pump_speed, "supply_pressure": p.Z9}
    instance = Instance(instance.model, (front, machine), instance.name)

    # a pump that has stood for a sample
    standing = instance.start(at, step or 1.0 / SOURCE_RATE, "steady").arguments[1]
    pump = instance.model.parts[1]
    state = called(pump, pump.step, standing)
    if options.symmetric is not None and point.orifice_opening == 0.0:
        lower = CLOSED / p.Z1
        state = state._replace(
            pressure=state.pressure - lower, plate_pressure=state.plate_pressure - lower
        )
    if step == 0.0:
        models = models_of(parameters.equations)
        flowing = models.flowing_drive if by_voltage else models.flowing_pump_drive
        instance = replace(instance, model=flowing)
    card = instance.start(at, step, "steady").states[0]
    started = instance.start(at, step, "steady", (card, state))
    records = tuple(command if name in COMMANDS else name for name in inputs)
    (A, B, C, D), states, memory, whole = recurrence(instance, started, step, records, outputs)
    names = _names(side, step, front.options)
    if options.friction is not None and step > 0.0:
        # the next sample knows the spool's place x and its deflection d as d e^(-h/T) - x w/x_s
        # alone, the deflection that would be left if it came back to where it was balanced
        spool, deflection = (states.index(f"pump.{each}") for each in ("spool", "deflection"))
        width_of = interpreted(friction_width, pump.replacements)
        left_of = interpreted(dither_factor, pump.replacements)
        friction = width_of(p.spool_friction, p.Z4, p.Z5) / p.spool_presliding
        left = left_of(p.dither_time, step)
        for matrix in (A, C):
            matrix[:, deflection] = -matrix[:, spool] / friction
        for matrix in (A, B):
            matrix[deflection] = left * matrix[deflection] - friction * matrix[spool]
    if not isfinite(p.dither_time):
        del names["pump.deflection"]  # without dither nothing is left of it
    names |= {each: each for each in memory}
    moving = np.asarray(B.any(axis=1))
    moving[states.index("pump.pressure")] = True
    for _ in states:
        moving |= A[:, moving].any(axis=1)
    kept = [path for path in names if moving[states.index(path)]]
    places = [states.index(path) for path in kept]
    # a channel counts in its own direction, the model in that of the speed
    signs = np.array([sign if path.startswith("card.") else 1.0 for path in kept])
    matrices = (
        A[np.ix_(places, places)] * np.outer(signs, signs),
        B[places] * signs[:, np.newaxis],
        C[:, places] * signs,
        D,
    )
    return matrices, tuple(names[path] for path in kept), memory, whole


def _names(side: str, step: float, options: Any) -> dict[str, str]:
    """Paths of the states that small motions can move, and what they are called."""
    ending = "_before" if step > 0.0 else ""
    names = {
        "pump.pressure": "stroker_pressure",
        "pump.plate_pressure": "plate_pressure",
        "pump.deflection": "spool_deflection",
        "pump.torque": f"motor_torque{ending}",
        "pump.speed": f"shaft_speed{ending}",
        "pump.flow_speed": f"flow_speed{ending}",
        "pump.load_torque": f"load_torque{ending}",
    }
    if not side:
        return names
    before = "current_rate" if step == 0.0 or options.exact is not None else "current_before"
    return {f"card.{side}.before": before, f"card.{side}.now": "current", **names}


# --- at a sample time -----------------------------------------------------------------------------


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

    Small motion and margins are of a model whose first output is the shaft's speed. Gain and phase
    are given at `frequency` [Hz]; `loop_gain` is that of a proportional speed loop
    [V, A or N / (rad/s)].
    """
    point, unit = model.operating_point, UNITS[model.input]
    answer, at = complex(model.response(frequency)[0]), f"at {frequency:g} Hz"
    made = _key_values("Operating point")
    if point.voltage is not None:
        made.add("voltage", point.voltage, unit="V")
    made.add("current", Cell(point.current, f"{point.current:z.4f}"), unit="A")
    made.add("swash angle", point.swash_angle, unit="rad", spec="z.3f")
    made.add("shaft speed", point.shaft_speed, unit="rad/s", spec="z.3f")

    if model.outputs[0] != "shaft_speed":
        return [made, _poles_table(model)]
    moving = _key_values("Small motion")
    moving.add("steady gain", model.gain, unit=f"rad/s/{unit}", spec="z.5g")
    try:
        lag: float | Cell = model.time_constant
    except DomainError:
        lag = Cell(None, "shorter than a sample")
    moving.add("time constant of the pump", lag, unit="s")
    if model.input == "voltage":
        delay = 1e3 * model.parameters.numbers["tau"]
        moving.add("delay of the card", delay, unit="ms", spec="z.3f")
    moving.add("bandwidth (-3 dB)", _finite(model.bandwidth), unit="Hz", spec=".4g")
    moving.add(f"gain {at}", abs(answer), unit=f"rad/s/{unit}", spec=".5g")
    moving.add(f"phase {at}", float(np.angle(answer, deg=True)), unit="deg", spec="z.2f")
    largest = _finite(model.largest_gain)
    moving.add("largest proportional gain", largest, unit=f"{unit}/(rad/s)", spec=".4g")

    poles = _poles_table(model)
    if loop_gain is None:
        return [made, moving, poles]
    margins, shown = model.margins(loop_gain), display_unit(f"{unit}/(rad/s)")
    loop = _key_values(f"Proportional loop, {shown.factor * loop_gain:g} {shown.name}")
    loop.add("crossover", margins.crossover or Cell(None, "none"), unit="Hz", spec=".4g")
    loop.add("phase margin", _finite(np.degrees(margins.phase_margin)), unit="deg", spec=".1f")
    loop.add("delay margin", _finite(1e3 * margins.delay_margin), unit="ms", spec=".2f")
    loop.add("gain margin", _finite(margins.gain_margin), spec=".3g")
    return [made, moving, poles, loop]


def _poles_table(model: LinearDrive) -> Table:
    """Poles without those of delays, of two conjugate ones the upper."""
    heads = (("real", "z.5g"), ("imaginary", "s"), ("Hz", ".4g"), ("damping", ".3f"))
    poles = Table("", (Column("Poles"), *(Column(*each) for each in heads)))
    h = model.sample_time
    for pole in model.poles[model.poles.imag >= 0.0]:
        s = pole if h is None else np.log(pole) / h
        size = float(abs(s))
        imaginary = f"±{pole.imag:.5g}" if pole.imag else ""
        numbers = float(pole.real), imaginary, size / (2.0 * np.pi), float(-s.real) / size
        poles.add("rad/s" if h is None else "z", *numbers)
    return poles


def _key_values(title: str) -> Table:
    return Table("", (Column(title), Column("", "z.4f", none="no limit"), UNIT))


def _finite(value: float) -> float | None:
    return None if np.isinf(value) else float(value)
