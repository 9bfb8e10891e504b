"""A machine says what its inputs, steps and numbers may be, and every verb keeps to it."""

from collections.abc import Callable, Iterator
from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest
from pint import UnitRegistry

from swashplate import Drive, FullOrderDrive, Machine, simulate_many
from swashplate.errors import InputError, ParameterError
from swashplate.machine import (
    Definition,
    Flag,
    Model,
    equation,
    join,
    sensitivities,
    simulate,
    stepper,
)
from swashplate.machine.fields import OFF
from swashplate.machine.linear import linearize, sweep

RATE = 100.0
UNITS = UnitRegistry()


class Valve(NamedTuple):
    lag: Annotated[float, Definition("lag", "s", above=0.0)]
    gain: Annotated[float, Definition("gain", "m/(s V)", lower=0.0, upper=10.0)] = 0.5
    leak: Annotated[float, Definition("leakage", "1/s", lower=0.0, switch="leaky")] = 0.0


class Options(NamedTuple):
    leaky: Flag = OFF
    slow: Flag = OFF


class State(NamedTuple):
    opening: float = 0.0


class Signals(NamedTuple):
    flow: float


Command = Annotated[float, Definition("command of the valve", "V", lower=-5.0, upper=5.0)]


@equation
def opened(state: State, command: Command, p: Valve, h: float, options: Options) -> State:
    opening = state.opening + h / p.lag * (command - state.opening)
    if options.leaky is not None:
        opening -= h * p.leak * state.opening
    return State(opening)


@equation
def flows(state: State, p: Valve, options: Options) -> Signals:
    return Signals(
        0.5 * p.gain * state.opening if options.slow is not None else p.gain * state.opening
    )


@equation
def settled(command: Command) -> State:
    return State(command)


@equation
def euler_margin(p: Valve, h: float) -> float:
    """An Euler step of a lag is stable below twice the lag."""
    return 2.0 - h / p.lag


@equation
def is_slow(p: Valve) -> bool:
    return p.lag > 1.0


valve = Model(
    "valve",
    Valve,
    State,
    opened,
    flows,
    settled=settled,
    options=Options,
    stable=euler_margin,
    longest_step=0.01,
    follows={"slow": is_slow},
)
quick = Machine(valve, Valve(lag=0.05))
pair = join("pair", {"left": quick, "right": quick})
BEYOND = np.r_[np.zeros(10), np.full(10, 7.0)]
Run = Callable[[Machine, str, np.ndarray], Any]


def verbs() -> Iterator[Run]:
    """Every verb that takes records of inputs."""
    yield lambda machine, name, record: simulate(machine, {name: record}, RATE)
    yield lambda machine, name, record: sensitivities(machine, {name: record}, RATE)["flow"]
    yield lambda machine, name, record: simulate_many(
        machine, {"lag": [0.05, 0.06]}, {name: record}, RATE, output="flow"
    )
    yield lambda machine, name, record: [
        stepper(machine, [name], ["flow"], rate=RATE).step(value) for value in record.tolist()
    ]


@pytest.mark.parametrize("run", [*verbs()])
def test_an_input_beyond_its_range_is_refused_by_every_verb(run: Run) -> None:
    with pytest.raises(InputError, match=r"command is 7(\.0)?.*within ±5"):
        run(quick, "command", BEYOND)


def test_the_sentence_says_where_and_what_and_a_joined_machine_says_it_too() -> None:
    inputs = {"left.command": BEYOND, "right.command": np.zeros(20)}
    with pytest.raises(InputError, match=r"left.command is 7 V at 0.1 s, .* command of the valve"):
        simulate(pair, inputs, RATE)
    winches = join("winches", {"one": Drive.preset("hoist"), "two": Drive.preset("slew")})
    inputs = {"one.voltage": np.full(9, 12.0), "two.voltage": np.zeros(9)}
    with pytest.raises(InputError, match=r"one.voltage is 12 V at 0 s, .* within ±10 V"):
        simulate(winches, inputs, 512.0)


def test_clipped_it_is_the_end_of_its_range() -> None:
    clipped = simulate(quick, {"command": BEYOND}, RATE, clip=True)
    within = simulate(quick, {"command": np.minimum(BEYOND, 5.0)}, RATE)
    assert np.array_equal(clipped["flow"], within["flow"])


def test_a_quantity_is_turned_into_the_unit_of_the_input() -> None:
    record = np.linspace(0.0, 4.0, 30)
    millivolts = simulate(quick, {"command": 1e3 * record * UNITS.mV}, RATE)
    np.testing.assert_allclose(
        millivolts["flow"], simulate(quick, {"command": record}, RATE)["flow"], rtol=1e-12
    )


UNSTABLE = Machine(valve, Valve(lag=0.004))


@pytest.mark.parametrize(
    "run",
    [
        lambda: simulate(UNSTABLE, {"command": np.ones(9)}, RATE),
        lambda: sensitivities(UNSTABLE, {"command": np.ones(9)}, RATE),
        lambda: stepper(UNSTABLE, ["command"], rate=RATE),
        lambda: linearize(UNSTABLE, {"command": 1.0}, RATE),
        lambda: sweep(UNSTABLE, [1.0], [1.0], RATE, input="command", output="flow"),
    ],
)
def test_a_step_that_its_equations_do_not_bear_is_refused(run: Callable[[], Any]) -> None:
    with pytest.raises(InputError, match=r"valve is unstable at a step of 1/100 s"):
        run()


def test_of_many_sets_only_those_with_an_unstable_step_fail() -> None:
    lags = [0.05, 0.004, 0.006]
    batch = simulate_many(quick, {"lag": lags}, {"command": np.ones(9)}, RATE, output="flow")
    assert [*batch.failures] == [1]
    assert "1/100 s" in batch.failures[1]
    alone = simulate(quick.replace(lag=0.006), {"command": np.ones(9)}, RATE)
    assert batch.output is not None
    assert np.array_equal(batch.output[2], alone["flow"])


def test_steps_are_no_longer_than_the_longest_one() -> None:
    """At 25 Hz four steps a sample: a lag's Euler steps by hand."""
    run = simulate(quick, {"command": np.full(5, 2.0)}, 25.0)
    expected = 2.0 * (1.0 - 0.8 ** (4.0 * np.arange(5)))
    np.testing.assert_allclose(run["opening"], expected, rtol=1e-12)
    with pytest.raises(InputError, match=r"substeps is 2, .* at least 4 .* 1/100 s"):
        simulate(quick, {"command": np.ones(5)}, 25.0, substeps=2)


def test_numbers_are_replaced_by_path_or_by_a_last_word_that_is_unique() -> None:
    wider = pair.replace({"left.gain": 1.0})
    assert wider.params.tolist() == [0.05, 1.0, 0.0, 0.05, 0.5, 0.0]
    assert pair.params.tolist() == [0.05, 0.5, 0.0, 0.05, 0.5, 0.0]
    assert quick.replace(lag=60.0 * UNITS.ms).params[0] == pytest.approx(0.06, rel=1e-12)
    assert quick.replace(gain=1.0).params.tolist() == [0.05, 1.0, 0.0]
    with pytest.raises(InputError, match=r"'gain'; there are left.gain, right.gain"):
        pair.replace(gain=1.0)
    with pytest.raises(InputError, match=r"'gian'; there are gain"):
        quick.replace(gian=1.0)
    with pytest.raises(ParameterError, match=r"left.gain \(gain\) is 11"):
        pair.replace({"left.gain": 11.0})
    with pytest.raises(InputError, match=r"lag is 'long'"):
        quick.replace(lag="long")


def test_of_a_drive_a_symbol_means_both_directions_and_a_pair_one_each() -> None:
    hoist = Drive.preset("hoist")
    winches = join("winches", {"left": hoist, "right": hoist})
    both = winches.replace({"left.pump.Z16": 2e-4, "left.card.J": (0.3, 0.2)})
    card, pump = (part.p for part in both.parts[:2])
    assert (pump.Z16_plus, pump.Z16_minus) == (2e-4, 2e-4)
    assert (card.plus.J, card.minus.J) == (0.3, 0.2)
    assert hoist.replace({"card.plus.J": 0.3}) == hoist.replace(J_plus=0.3)


def test_options_follow_from_the_numbers() -> None:
    """A leakage that is not 0 counts, without a word on its option, in one set or in many."""
    steps = {"command": np.full(40, 2.0)}
    leaky = Machine(valve, Valve(lag=0.05, leak=4.0))
    assert leaky.options[0].leaky
    assert quick.replace(leak=4.0).options == leaky.options
    assert leaky.replace(leak=0.0).options == quick.options
    slow = Machine(valve, Valve(lag=2.0))
    assert slow.options[0].slow
    assert simulate(slow, steps, RATE)["flow"][-1] == pytest.approx(
        0.25 * simulate(slow, steps, RATE)["opening"][-1]
    )
    changes = {"leak": [0.0, 4.0, 4.0], "lag": [0.05, 0.05, 2.0]}
    batch = simulate_many(quick, changes, steps, RATE, output="flow")
    for row, (leak, lag) in enumerate(zip(*changes.values(), strict=True)):
        alone = simulate(quick.replace(leak=leak, lag=lag), steps, RATE)
        assert batch.output is not None
        assert np.array_equal(batch.output[row], alone["flow"]), row


def test_a_drive_and_five_states_are_machines_with_their_own_bits() -> None:
    hoist, five = Drive.preset("hoist"), FullOrderDrive.preset("hoist")
    voltage = np.where(np.arange(700) > 50, 7.0, 0.0)
    run = simulate(hoist, {"voltage": voltage}, 512.0)
    assert np.array_equal(run["shaft_speed"], hoist.simulate(voltage, 512.0).shaft_speed)
    whole = five.simulate(voltage, 512.0)
    assert np.array_equal(
        simulate(five, {"voltage": voltage}, 512.0)["shaft_speed"], whole.shaft_speed
    )
    both = join("both", {"one": hoist, "five": five})
    joined = simulate(both, {"one.voltage": voltage, "five.voltage": voltage}, 512.0)
    assert np.array_equal(joined["one.shaft_speed"], run["shaft_speed"])
    assert np.array_equal(joined["five.shaft_speed"], whole.shaft_speed)


def test_five_states_over_a_drive_s_current_are_those_behind_its_card() -> None:
    five = FullOrderDrive.preset("slew")
    voltage = np.where(np.arange(600) > 30, -6.0, 0.0)
    behind = five.simulate(voltage, 512.0)
    after = five.follow(five.drive.simulate(voltage, 512.0))
    np.testing.assert_allclose(behind.shaft_speed, after.shaft_speed, rtol=0.0, atol=1e-12)


def test_a_drive_is_linearised_as_any_machine() -> None:
    """Pump and motor alone: the general linear model has the gain of the drive's own."""
    hoist = Drive.preset("hoist")
    general = linearize(hoist.by_current, {"current": 0.6}, 512.0, outputs=["shaft_speed"])
    own = hoist.linearize(current=0.6)
    assert general.gain == pytest.approx(own.gain, rel=1e-9)


def test_signals_of_a_joined_drive_have_meaning_and_unit() -> None:
    winches = join("winches", {"one": Drive.preset("hoist"), "two": Drive.preset("slew")})
    definitions = winches.model.definitions
    assert definitions["one.shaft_speed"].unit == "rad/s"
    assert definitions["two.shaft_position"].unit == "rad"
    assert definitions["two.voltage"].name.startswith("command of the card")


def test_derivatives_and_sets_take_the_same_names() -> None:
    hoist = Drive.preset("hoist")
    winches = join("winches", {"left": hoist, "right": hoist})
    voltage = np.where(np.arange(400) > 20, 7.0, 0.0)
    inputs = {"left.voltage": voltage, "right.voltage": -voltage}
    by = sensitivities(winches, inputs, 512.0, parameters=["left.pump.Z16", "right.pump.Z1"])
    assert by.names == ("left.pump.Z16_plus", "left.pump.Z16_minus", "right.pump.Z1")
    alone = hoist.sensitivities(voltage, 512.0, parameters=["Z16"])
    np.testing.assert_allclose(
        by["left.shaft_speed"][:, :2], alone["shaft_speed"], rtol=1e-9, atol=1e-12
    )
    assert not by["left.shaft_speed"][:, 2].any()
    many = simulate_many(
        winches, {"left.pump.Z16": [2e-4, 3e-4]}, inputs, 512.0, output="left.shaft_speed"
    )
    assert many.output is not None
    expected = hoist.replace(Z16=3e-4).simulate(voltage, 512.0).shaft_speed
    np.testing.assert_allclose(many.output[1], expected, rtol=0.0, atol=1e-12)
    with pytest.raises(InputError, match=r"'Z17'; there are left.pump.Z17, right.pump.Z17"):
        simulate_many(winches, {"Z17": [0.1]}, inputs, 512.0, output="left.shaft_speed")
    with pytest.raises(InputError, match=r"left.pump.Z16_plus is given twice"):
        simulate_many(
            winches,
            {"left.pump.Z16": [1e-4], "left.pump.Z16_plus": [1e-4]},
            inputs,
            512.0,
            output="left.shaft_speed",
        )


def test_joined_drives_keep_the_rules_between_their_numbers() -> None:
    hoist = Drive.preset("hoist")
    tug = join("tug", {"port": hoist, "starboard": hoist})
    with pytest.raises(ParameterError, match=r"tug: port: .* but must be below 1: at its stop"):
        tug.replace({"port.pump.Z13": 1.4})
    volts = {f"{side}.voltage": np.full(64, 5.0) for side in ("port", "starboard")}
    batch = simulate_many(
        tug, {"starboard.Z5": [hoist["Z5"].value, 1.0]}, volts, 512.0, output="port.shaft_speed"
    )
    assert list(batch.failures) == [1]
    assert "starboard: Z5·F/√Z4 reaches" in batch.failures[1]
    with pytest.raises(ParameterError, match="overpower the feedback spring"):
        hoist.by_current.replace(Z5=1.0)
