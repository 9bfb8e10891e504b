"""Small motions of a drive about a steady state: its equations' linear model, at the march's steps.

They leave out the cam ring's ripple, which does not change the mean of a turn, and the card's rate
limits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import isfinite, nextafter
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from swashplate.drive.equilibrium import OperatingPoint
from swashplate.drive.instance import drive_instance, models_of, without_ripple
from swashplate.machine import Machine, with_replacements
from swashplate.machine.linear import LinearModel, Matrices, linearize
from swashplate.machine.marching import SOURCE_RATE, called
from swashplate.models.amplifier import Card
from swashplate.models.displacement_control import PumpOptions
from swashplate.models.refinements import dither_factor, friction_width
from swashplate.parameters import ParameterSet

Array = NDArray[np.float64]
Coulomb = Literal["ignored", "tangent"]
Input = Literal[
    "voltage", "current", "solenoid_force", "load_torque", "pump_speed", "supply_pressure"
]

INPUTS: tuple[Input, ...] = get_args(Input)
COMMANDS = INPUTS[:3]  # Of which one moves at a time; the others can move together with it.
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
CLOSED = 64.0 * float(np.finfo(float).eps)
"""By this much tan α_sw stands below a closed spool, on the side of positive opening."""


def small_motion_model(
    parameters: ParameterSet,
    point: OperatingPoint,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    coulomb: Coulomb = "ignored",
    rate: float | None = None,
) -> LinearModel:
    """Linear model of a drive's small motions about a point, at the march's steps.

    Parameters
    ----------
    parameters : ParameterSet
        The drive.
    point : OperatingPoint
        The steady state, at which the inputs have an answer.
    inputs : tuple of str
        What moves it: of `INPUTS`, a command or a force first.
    outputs : tuple of str
        Signals of `OUTPUTS`.
    coulomb : {"ignored", "tangent"}
        Whether the card's Coulomb term counts, with its slope at rest.
    rate : float, optional
        Steps a second; by default the model is in continuous time and leaves out the delays of
        card and solenoids. [Hz]

    Returns
    -------
    LinearModel
        Of the states that can move, with the drive's own names of them.
    """
    step = 0.0 if rate is None else 1.0 / rate
    by_voltage = inputs[0] == "voltage"
    instance = without_ripple(drive_instance(parameters, by_voltage=by_voltage))
    front, machine = instance.parts
    command = "current"
    side = ""
    sign = 1.0
    at = {"current": point.current}
    if by_voltage:
        assert point.voltage is not None
        side, sign = ("plus", 1.0) if point.voltage >= 0.0 else ("minus", -1.0)
        if coulomb == "ignored":
            card = Card(
                plus=front.p.plus._replace(C=0.0),
                minus=front.p.minus._replace(C=0.0),
                tau=front.p.tau,
            )
            front = front._replace(p=card)
        # at a dead zone without width, by a hair
        command = "voltage"
        at = {command: point.voltage or nextafter(0.0, 1.0)}
    elif inputs[0] == "solenoid_force":
        options = machine.options._replace(late=None, hysteresis=None)
        machine = machine._replace(p=machine.p._replace(**FORCE), options=options)
        at = {"current": point.solenoid_force}
    p, options, _ = machine
    at |= {"load_torque": p.load_torque, "pump_speed": p.pump_speed, "supply_pressure": p.Z9}
    instance = Machine.of_parts(instance.model, (front, machine), instance.name)

    # a pump that has stood for a sample
    standing = instance.start(at, step or 1.0 / SOURCE_RATE, "steady").arguments[1]
    pump = instance.model.parts[1]
    state = called(pump, pump.step, standing)
    if options.symmetric is not None and point.orifice_opening == 0.0:
        lower = CLOSED / p.Z1
        state = state._replace(
            pressure=state.pressure - lower, plate_pressure=state.plate_pressure - lower
        )
    if rate is None:
        models = models_of(parameters.equations)
        flowing = models.flowing_drive if by_voltage else models.flowing_pump_drive
        instance = Machine.of_parts(flowing, instance.parts, instance.name)
    card_state = instance.start(at, step, "steady").states[0]
    model = linearize(
        instance,
        at,
        rate,
        states=(card_state, state),
        inputs=tuple(command if name in COMMANDS else name for name in inputs),
        outputs=outputs,
    )
    A, B, C = model.A, model.B, model.C
    states = model.states
    names = _names(side, step, front.options, options)
    if options.friction is not None and step > 0.0:
        # the next sample knows the spool's place x and its deflection d as d e^(-h/T) - x w/x_s
        # alone, the deflection that would be left if it came back to its balance
        spool = states.index("pump.spool")
        deflection = states.index("pump.deflection")
        width_of = with_replacements(friction_width, pump.replacements)
        remaining_of = with_replacements(dither_factor, pump.replacements)
        friction = width_of(p.spool_friction, p.Z4, p.Z5) / p.spool_presliding
        remaining = remaining_of(p.dither_time, step)
        for matrix in (A, C):
            matrix[:, deflection] = -matrix[:, spool] / friction
        for matrix in (A, B):
            matrix[deflection] = remaining * matrix[deflection] - friction * matrix[spool]
    if not isfinite(p.dither_time):
        del names["pump.deflection"]  # without dither nothing is left of it
    names |= {name: name for name in model.memory}
    moving = np.asarray(B.any(axis=1))
    moving[states.index("pump.pressure")] = True
    for _ in states:
        moving |= A[:, moving].any(axis=1)
    paths = [path for path in names if moving[states.index(path)]]
    indices = [states.index(path) for path in paths]
    # a channel counts in its own direction, the model in that of the speed
    signs = np.array([sign if path.startswith("card.") else 1.0 for path in paths])
    return replace(
        model,
        A=A[np.ix_(indices, indices)] * np.outer(signs, signs),
        B=B[indices] * signs[:, np.newaxis],
        C=C[:, indices] * signs,
        states=tuple(names[path] for path in paths),
        inputs=inputs,
    )


def _names(side: str, step: float, options: Any, pump_options: PumpOptions) -> dict[str, str]:
    """Paths of the states that small motions can move and that count, and what they are called."""
    ending = "_before" if step > 0.0 else ""
    names = dict[str, str]()
    if pump_options.late is not None:
        names |= {
            "pump.lagged_current": f"lagged_current{ending}",
            "pump.delayed_current": f"delayed_current{ending}",
        }
    names["pump.pressure"] = "stroker_pressure"
    if pump_options.damping is not None:
        names["pump.plate_pressure"] = "plate_pressure"
    names["pump.deflection"] = "spool_deflection"
    if pump_options.line is not None:
        names |= {
            "pump.torque": f"motor_torque{ending}",
            "pump.speed": f"shaft_speed{ending}",
            "pump.flow_speed": f"flow_speed{ending}",
            "pump.load_torque": f"load_torque{ending}",
        }
    if not side:
        return names
    name_before = "current_rate" if step == 0.0 or options.exact is not None else "current_before"
    return {f"card.{side}.before": name_before, f"card.{side}.now": "current", **names}


# --- several steps a sample -----------------------------------------------------------------------


def lifted(
    A: Array, B: Array, C: Array, D: Array, substeps: int, zero_order: Sequence[bool]
) -> Matrices:
    """Several steps as one sample.

    The state is that of the step after the sample before, together with the inputs at that sample:
    from there on the steps up to this sample know their inputs. Inputs with `zero_order` keep their
    last value between samples, the others follow a straight line.
    """
    n, k = B.shape
    # columns: the state, the last inputs, the present ones
    z = np.eye(n, n + 2 * k)
    y = np.empty(0)
    for j in range(1, substeps + 1):
        rise = np.where(zero_order, float(j == substeps), j / substeps)
        u = np.hstack((np.zeros((k, n)), np.diag(1.0 - rise), np.diag(rise)))
        y = C @ z + D @ u
        z = A @ z + B @ u
    longer = np.zeros((n + k, n + k))
    longer[:n] = z[:, : n + k]
    into = np.vstack((z[:, n + k :], np.eye(k)))
    return longer, into, y[:, : n + k], y[:, n + k :]
