"""Loops with signals that come late, and pasts at ages that change, in C and as FMU."""

import ctypes
import warnings
from typing import Any, NamedTuple

import numpy as np
import pytest
from tests.export.conftest import InC
from tests.machine.test_late import (
    LEVEL,
    RATE,
    TARGET,
    Count,
    Gauge,
    Law,
    Push,
    Tank,
    at_rest,
    closed,
    counted,
    forgetful,
    gauge,
    looking_back,
    remembering,
    tank,
)
from tests.marks import rest_slow

from swashplate import Drive, InputError, join, simulate
from swashplate.errors import DomainError
from swashplate.export import content_of, fmu
from swashplate.export.c_source import interface
from swashplate.machine import History, Machine, Model, Tap, Window, equation, late, past

OK, BAD_DELAY, DOMAIN = 0, 3, 4


class Filter(NamedTuple):
    delay: float = 0.0131
    longest: float = 0.05
    before: float = 0.4


class Filtered(NamedTuple):
    value: float = 0.0
    spread: float = 0.0


class Looked(NamedTuple):
    looked: float


@equation
def looks(state: Filtered, seen: Window, mean: float, back: History, target: History) -> Looked:
    shift = past(back, 2.5 + state.value) + past(target, 4.0 * state.spread)
    return Looked(seen.s[0] + 2.0 * seen.s[2] + seen.f + mean + shift)


@equation
def looks_on(signals: Looked, mean: float) -> Filtered:
    return Filtered(min(abs(signals.looked), 9.0), min(abs(mean), 5.0))


@equation
def settled_filter() -> Filtered:
    return Filtered()


filter_ = Model(
    "filter",
    Filter,
    Filtered,
    looks_on,
    looks,
    settled=settled_filter,
    taps={
        "seen": Tap("seen", delay="delay", width=3, before="before"),
        "mean": Tap("mean", delay="delay", hold="mean"),
        "back": Tap("back", delay="delay", longest="longest"),
        "target": Tap("target", longest="longest"),
    },
)


@equation
def sum_of(push: float, level: float) -> float:
    """Of two parts."""
    return push + 0.5 * level


def filtering(**links: Any) -> Machine:
    """A loop whose first part looks at late signals in every way that there is."""
    members = {
        "filter": Machine(filter_, Filter()),
        "law": Machine(forgetful, Law()),
        "tank": Machine(tank, Tank()),
    }
    wires = {
        "total": (sum_of, "law.push", "tank.level"),
        "filter.seen": late("total", "before"),
        "filter.mean": late("tank.level"),
        "filter.back": late("tank.level", "before"),
        "law.level": LEVEL,
        "tank.push": "law.push",
    }
    return join("filtering", members, links={**wires, **links})


def metered() -> Machine:
    """Two parts that take a signal late, each with a value of its own before."""
    members = {
        "law": Machine(forgetful, Law()),
        "gauge": Machine(gauge, Gauge(-2.0)),
        "tank": Machine(tank, Tank()),
    }
    links = {"tank.push": "law.push", "law.level": LEVEL, "gauge.level": LEVEL}
    return join("metered", members, links=links)


def unlooped() -> Machine:
    """A past of a signal of a part before, and no loop."""
    members = {"tank": Machine(tank, Tank()), "law": Machine(remembering, Law())}
    return join("unlooped", members, links={"law.level": "tank.level", "law.history": "tank.level"})


LOOPS = {
    "register": closed(forgetful),
    "past": closed(remembering, **{"law.history": LEVEL}),
    "metered": metered(),
    "every tap": filtering(),
    "no loop": unlooped(),
}


def inputs_of(machine: Machine) -> dict[str, np.ndarray]:
    """A target for each input, none like another."""
    names = machine.ports.external
    return {name: TARGET + 0.3 * np.cos(TARGET * k) for k, name in enumerate(names)}


def in_c(machine: Machine, compiled: Any) -> InC:
    content = content_of(machine, 1.0 / RATE, prefix="loop")
    return InC(compiled(interface(content.exported)), "loop", content.values)


@pytest.mark.parametrize("name", LOOPS)
@pytest.mark.parametrize("start", ["rest", "steady"])
def test_a_loop_in_c_has_the_bits_of_its_march(name, start, compiled):
    machine = LOOPS[name]
    model, inputs = in_c(machine, compiled), inputs_of(machine)
    if start == "steady" and name in ("past", "no loop"):
        assert not hasattr(model.library, "loop_settle")  # the law has no equation for it
        return
    run = simulate(machine, inputs, RATE, start=start)
    names = machine.ports.every_signal
    places = [model.number("_output", each) for each in names]
    assert -1 not in places
    rows = np.transpose([*inputs.values()]).tolist()
    for _ in range(2):  # a reset gives the start back
        if start == "steady":
            assert model.settle(*rows[0]) == OK
        for n, row in enumerate(rows):
            # the sample with another command first, then as it is
            if n % 7 == 3:
                assert model.step(*(value + 1.0 for value in row)) == OK
                assert model.correct(*row) == OK
            else:
                assert model.step(*row) == OK
            assert [model.output(place) for place in places] == [run[each][n] for each in names]
        assert model.reset() == OK


@pytest.mark.parametrize("name", LOOPS)
def test_a_copy_of_the_struct_goes_on_as_the_loop(name, compiled):
    machine = LOOPS[name]
    model, rows = in_c(machine, compiled), np.transpose([*inputs_of(machine).values()]).tolist()
    place = model.number("_output", "law.push")
    for row in rows[:100]:
        assert model.step(*row) == OK
    kept = bytes(model.model)
    went = [(model.step(*row), model.output(place)) for row in rows[100:]]
    ctypes.memmove(model.model, kept, len(kept))
    assert model.valid()
    again = [(model.step(*row), model.output(place)) for row in rows[100:]]
    assert went == again


class PI(NamedTuple):
    gain: float = 4.0
    lag: float = 0.5


class Integral(NamedTuple):
    volts: float = 0.0


class Command(NamedTuple):
    command: float
    integral: float


@equation
def command(state: Integral, reference: float, speed: float, p: PI, h: float) -> Command:
    error = reference - speed
    integral = state.volts + p.gain * error * h / p.lag
    return Command(min(max(integral + p.gain * error, -10.0), 10.0), integral)


@equation
def kept(signals: Command) -> Integral:
    return Integral(signals.integral)


def test_a_controller_joined_with_a_drive_has_the_bits_of_its_march(compiled):
    law = Machine(Model("law", PI, Integral, kept, command), PI())
    links = {"hoist.voltage": "law.command", "law.speed": late("hoist.shaft_speed")}
    machine = join("closed", {"law": law, "hoist": Drive.preset("hoist")}, links=links)
    reference = np.repeat([0.5, 1.5, -1.0], 400)
    run = simulate(machine, {"law.reference": reference}, RATE)
    assert abs(run["hoist.shaft_speed"][790] - 1.5) < 0.3  # the loop follows
    model = in_c(machine, compiled)
    names = ["law.command", "hoist.shaft_speed", "hoist.motor_torque"]
    places = [model.number("_output", name) for name in names]
    for n, each in enumerate(reference.tolist()):
        assert model.step(each) == OK
        assert [model.output(place) for place in places] == [run[name][n] for name in names]


def test_values_before_the_first_sample_are_those_of_the_parameters_then(compiled):
    model = in_c(closed(forgetful), compiled)
    first, push = model.number("", "law_first"), model.number("_output", "law.push")
    assert model.set(first, 0.25) == OK
    assert model.step(0.0) == OK
    assert model.output(push) == 1.3 * (0.0 - 0.25)


def test_a_past_goes_as_far_back_as_the_exported_numbers(compiled):
    model = in_c(closed(remembering, **{"law.history": LEVEL}), compiled)
    memory = model.number("", "law_memory")
    assert model.set(memory, 0.1) == OK
    assert model.step(0.0) == OK
    assert model.set(memory, 0.2) == OK
    assert model.step(0.0) == BAD_DELAY
    assert b"or export it with the longest past" in model.function("sentence")(BAD_DELAY)
    assert model.set(memory, 0.05) == OK
    assert model.step(0.0) == OK


@equation
def everywhere(history: History, age: float) -> Push:
    return Push(past(history, age))


def test_an_age_is_held_within_what_is_kept(compiled):
    """Before the record, at ages below 0 and beyond the longest, and none of a number."""
    law = Model(
        "law", Law, Count, counted, everywhere, taps={"history": Tap("history", longest="memory")}
    )
    machine = Machine(law, Law(memory=3.5 / RATE))
    ages = np.array([0.0, -7.0, 1e300, 2.25, np.inf, 3.5, 3.0, 1.0])
    history = np.array([5.0, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0])
    by_hand = [5.0, 1.0, 0.0, 2.0, 3.0, 1.5, 4.0, 32.0]
    model = in_c(machine, compiled)
    push = model.number("_output", "push")
    found = []
    for pair in zip(history.tolist(), np.minimum(ages, 1e308).tolist(), strict=True):
        assert model.step(*pair) == OK
        found.append(model.output(push))
    run = simulate(machine, {"history": history, "age": np.minimum(ages, 1e308)}, RATE)
    np.testing.assert_array_equal(found, run["push"])
    np.testing.assert_array_equal(found, by_hand)


class Driven(NamedTuple):
    gain: float


@equation
def driven(target: float, level: float, p: Driven) -> Push:
    return Push(p.gain * level + target)


@pytest.mark.parametrize(("gain", "status"), [(-1.5, DOMAIN), (-0.5, OK)])
def test_a_loop_that_does_not_settle_says_so(gain, status, compiled):
    part = Model("part", Driven, Count, counted, driven, settled=at_rest)
    machine = join(
        "circle", {"part": Machine(part, Driven(gain))}, links={"part.level": late("part.push")}
    )
    model = in_c(machine, compiled)
    assert model.settle(1.0) == status
    if status == DOMAIN:
        with pytest.raises(DomainError, match="do not settle"):
            simulate(machine, {"part.target": np.ones(2)}, RATE, start="steady")
        return
    run = simulate(machine, {"part.target": np.ones(2)}, RATE, start="steady")
    assert model.step(1.0) == OK
    assert model.output(model.number("_output", "part.push")) == run["part.push"][0]
    assert run["part.push"][0] == pytest.approx(1.0 / 1.5, rel=1e-12)


def test_a_past_with_a_parameter_in_its_place_is_refused():
    law = Model(
        "law",
        Law,
        Count,
        counted,
        looking_back,
        taps={"history": Tap("history", longest="memory")},
        defaults={"history": "first"},
    )
    with pytest.raises(InputError, match="law looks back at 'history', for which a parameter"):
        content_of(Machine(law, Law()), 1.0 / RATE)


@pytest.mark.parametrize(
    ("name", "fmi"),
    rest_slow([("every tap", "2.0"), ("every tap", "3.0"), ("past", "2.0"), ("past", "3.0")]),
)
def test_an_fmu_of_a_loop_has_the_bits_of_its_march(name, fmi, tmp_path):
    fmpy = pytest.importorskip("fmpy")
    from tests.export.test_fmu import Master

    machine, names = LOOPS[name], LOOPS[name].ports.every_signal
    inputs = inputs_of(machine)
    run = simulate(machine, inputs, RATE)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".* depend on the filter.target at the same")
        path = fmu(machine, tmp_path / "loop.fmu", step=1.0 / RATE, fmi=fmi)
    fmpy.extract(str(path), unzipdir=str(tmp_path / "loop"))
    master = Master(tmp_path / "loop")
    rows = [
        dict(zip(inputs, row.tolist(), strict=True)) for row in np.transpose([*inputs.values()])
    ]

    def play(begin: int, end: int) -> None:
        for n in range(begin, end):
            master.set(**rows[n])
            assert master.get(*names) == [run[each][n] for each in names]
            master.step(n / RATE, 1.0 / RATE)

    master.begin(**rows[0])
    play(0, 150)
    kept = master.state
    play(150, 250)
    master.state = kept
    play(150, 300)
    master.fmu.reset()
    master.initialize(**rows[0])
    play(0, 50)
    master.fmu.terminate()
    master.fmu.freeInstance()
