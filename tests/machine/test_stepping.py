"""Compiled steps in loops of one's own: the numbers of `simulate`, for drives and own models."""

from typing import NamedTuple

import numpy as np
import pytest

from swashplate import DomainError, Drive, InputError, Limit
from swashplate.machine import Machine, Model, Tap, equation, kernel, simulate
from swashplate.machine.marching import compiled_step


def marched(compiled, context, records):
    """Outputs of a kernel that takes a step for each row of inputs, (n, outputs)."""
    step = compiled.step

    @kernel
    def march(context, records, out):
        worst = np.inf
        for n in range(records.shape[0]):
            context.inputs[:] = records[n]
            worst = min(worst, step(context))
            out[n] = context.outputs
        return worst

    out = np.empty((len(records), context.outputs.size))
    compiled.check(context, march(context, np.ascontiguousarray(records), out), "command")
    return out


VOLTAGE = 6.0 * np.sin(np.arange(700) / 90.0) ** 3


@pytest.mark.slow
@pytest.mark.interpreted
@pytest.mark.parametrize(
    ("name", "rate"), [pytest.param("slew", 512.0, marks=pytest.mark.slow), ("hoist", 1024.0)]
)
def test_step_of_a_drive_gives_the_numbers_of_its_simulation(name, rate):
    drive = Drive.preset(name).at_every_rate()
    compiled = drive.compiled_step(("shaft_speed", "swash_angle", "current"), rate=rate)
    out = marched(compiled, compiled.context(), VOLTAGE[:, None])
    run = drive.simulate(VOLTAGE, rate)
    for k, signal in enumerate((run.shaft_speed, run.swash_angle, run.current)):
        np.testing.assert_array_equal(out[:, k], signal)
    assert repr(compiled) == (
        f"CompiledStep('{name}', voltage -> shaft_speed, swash_angle, current, {rate:g} Hz)"
    )


@pytest.mark.slow
def test_step_takes_measured_inputs_and_begins_settled():
    drive = Drive.preset("hoist").replace(motor_leakage=1e-6, motor_constant=250.0)
    torque = 3e4 * (1.0 + np.sin(np.arange(VOLTAGE.size) / 40.0))
    compiled = drive.compiled_step(inputs=("voltage", "load_torque"))
    command = VOLTAGE + 4.0
    context = compiled.context({"voltage": 4.0, "load_torque": torque[0]}, "steady")
    out = marched(compiled, context, np.stack([command, torque], axis=1))
    run = drive.simulate(command, load_torque=torque, start="steady")
    np.testing.assert_array_equal(out[:, 0], run.shaft_speed)


def test_limits_of_the_pump_are_bits():
    drive = Drive.preset("luff")
    compiled = drive.compiled_step(("limits",))
    out = marched(compiled, compiled.context(), VOLTAGE[:, None])
    run = drive.simulate(VOLTAGE)
    names = (Limit.DEAD_ZONE, Limit.ORIFICE, Limit.SPOOL, Limit.SWASH_STOP, Limit.RELIEF)
    acting = [(out[:, 0].astype(int) >> k) & 1 for k in range(5)]
    for bits, name in zip(acting, names, strict=True):
        np.testing.assert_array_equal(bits == 1, run.active(name))
    assert np.any(acting[1])


class Lag(NamedTuple):
    time: float
    delay: float


class Level(NamedTuple):
    level: float


@equation
def approach(state: Level, command: float, p: Lag, h: float) -> Level:
    return Level(state.level + h / p.time * (command - state.level))


lag = Model("lag", Lag, Level, approach, taps={"command": Tap("command", delay="delay")})


def test_step_of_ones_own_model_waits_as_its_simulation_does():
    p = Lag(0.3, 0.0377)
    compiled = compiled_step(Machine(lag, p), ("command",), ("level",), 100.0)
    out = marched(compiled, compiled.context(), VOLTAGE[:, None])
    run = simulate(Machine(lag, p), {"command": VOLTAGE}, 100.0)
    np.testing.assert_array_equal(out[:, 0], run["level"])


def test_what_no_step_has_is_refused():
    hoist = Drive.preset("hoist")
    with pytest.raises(InputError, match="shaft_position .* integral of shaft_speed"):
        hoist.compiled_step(("shaft_position",))
    with pytest.raises(InputError, match="hoist .* input 'wind'; .* voltage, "):
        hoist.compiled_step(inputs=("voltage", "wind"))
    with pytest.raises(InputError, match="hoist: card .* 'voltage'"):
        hoist.compiled_step(inputs=("load_torque",))
    with pytest.raises(InputError, match=r"step of 1/20 s"):
        hoist.compiled_step(rate=20.0)
    compiled = compiled_step(Machine(lag, Lag(0.001, 0.0)), ("command",), ("level",), 100.0)
    with pytest.raises(DomainError, match="lag: lag's level .* end of the record"):
        marched(compiled, compiled.context(), np.ones((700, 1)))
