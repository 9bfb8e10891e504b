"""A model of one's own, marched and differentiated like the package's drives."""

import pickle
from dataclasses import replace
from math import cos, exp, log, sin
from typing import Any, NamedTuple

import numpy as np
import pytest

from swashplate import DomainError, InputError
from swashplate.errors import EquationError
from swashplate.machine import (
    Machine,
    Model,
    Tap,
    derive,
    equation,
    join,
    replaced,
    sensitivities,
    simulate,
    stepper,
)
from swashplate.machine.batch import simulate_many
from swashplate.machine.marching import vectorisation_report
from swashplate.models.drive import pump_drive


class Valve(NamedTuple):
    lag: float
    overlap: float
    gain: float
    delay: float


class Rod(NamedTuple):
    opening: float
    position: float


class Stroke(NamedTuple):
    low: float
    high: float


@equation
def lag_share(p: Valve, h: float) -> float:
    return 1.0 - exp(-h / p.lag)


@equation
def step(state: Rod, command: float, p: Valve, h: float, given: Stroke) -> Rod:
    opening = state.opening + lag_share(p, h) * (command - state.opening)
    flow = max(opening - p.overlap, 0.0) + min(opening + p.overlap, 0.0)
    position = state.position + h * p.gain * flow
    return Rod(opening, min(max(position, given.low), given.high))


valve = Model(
    "valve",
    parameters=Valve,
    state=Rod,
    step=step,
    given=Stroke,
    taps={"command": Tap("command", delay="delay", hold="mean")},
)
P, STROKE, RATE = Valve(0.05, 0.1, 0.4, 0.033), Stroke(-1.0, 1.0), 100.0
COMMAND = np.sin(np.arange(300) / 25.0) + 0.3


def by_hand(p: Valve) -> np.ndarray:
    """The same equations in a loop of plain Python, the mean of the command by integration."""
    at = np.arange(COMMAND.size + 1) / RATE
    padded = np.concatenate([[0.0], COMMAND])
    times = np.concatenate([[-1.0 / RATE], at[:-1]])
    fine = np.arange(-10_000, COMMAND.size * 1000) / (1000.0 * RATE)
    value = np.interp(fine, times, padded, left=0.0)
    total = np.concatenate([[0.0], np.cumsum(0.5 * (value[1:] + value[:-1]) * np.diff(fine))])
    opening, position, found = 0.0, 0.0, []
    for n in range(COMMAND.size):
        found.append(position)
        ends = np.interp([(n - 1) / RATE - p.delay, n / RATE - p.delay], fine, total)
        mean = (ends[1] - ends[0]) * RATE
        opening += (1.0 - exp(-1.0 / RATE / p.lag)) * (mean - opening)
        flow = max(opening - p.overlap, 0.0) + min(opening + p.overlap, 0.0)
        position = min(max(position + p.gain * flow / RATE, STROKE.low), STROKE.high)
    return np.array(found)


def test_simulation_is_the_loop_by_hand() -> None:
    run = simulate(Machine(valve, P, given=STROKE), {"command": COMMAND}, RATE)
    assert run["position"] == pytest.approx(by_hand(P), abs=1e-9)
    assert run.names == ("time", "command", "opening", "position")
    assert run.to_polars("SI").columns == list(run.names)


@pytest.mark.parametrize("method", ["to_polars", "to_pandas"])
def test_units_that_no_signal_has_are_refused(method: str) -> None:
    run = simulate(Machine(valve, P, given=STROKE), {"command": COMMAND}, RATE)
    with pytest.raises(InputError, match=r"units .* 'display', .*'SI'"):
        getattr(run, method)(units="display")


class Stops(NamedTuple):
    low: bool
    high: bool


@equation
def at_stops(state: Rod, given: Stroke) -> Stops:
    return Stops(state.position <= given.low, state.position >= given.high)


stopped = replace(valve, limits=at_stops, parts=(), integrals={"travel": "position"})
SHORT = Stroke(-0.05, 0.2)
TIMES = np.cumsum(0.02 + 0.015 * np.sin(np.arange(300))) - 0.3
WAYS = {
    "sub-steps": {"rate": 25.0, "substeps": 4},
    "sub-steps, held": {"rate": 25.0, "substeps": 4, "interpolation": "previous"},
    "stamps": {"rate": 40.0, "time": TIMES, "interpolation": "linear"},
    "stamps, held": {"rate": 40.0, "time": TIMES, "interpolation": "previous", "substeps": 3},
}


def gridded(rate, time=None, interpolation="linear", substeps=1) -> np.ndarray:
    """The command on the march's grid."""
    stamps = np.arange(COMMAND.size) / rate if time is None else time
    count = round((stamps[-1] - stamps[0]) * rate - 0.4999) * substeps
    fine = stamps[0] + np.arange(count + 1) / (rate * substeps)
    if interpolation == "linear":
        return np.interp(fine, stamps, COMMAND)
    return COMMAND[np.searchsorted(stamps, fine + 1e-9, side="right") - 1]


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_stamps_and_sub_steps_are_a_finer_grid(way) -> None:
    """Of signals, limits, integrals, many sets and derivatives: those of the gridded command."""
    substeps, inputs = way.get("substeps", 1), {"command": COMMAND}
    fine, rate = {"command": gridded(**way)}, way["rate"] * substeps
    expected = simulate(Machine(stopped, P, given=SHORT), fine, rate)
    run = simulate(Machine(stopped, P, given=SHORT), inputs, **way)
    assert run.time == pytest.approx(expected.time[::substeps] + way.get("time", [0.0])[0])
    assert run.names == ("time", "command", "opening", "position", "travel")
    for name in ("position", "travel"):
        assert run[name] == pytest.approx(expected[name][::substeps], abs=1e-12)
    assert (run.active("high") == (run["position"] == SHORT.high)).all()
    assert run.active("high").any()
    assert (run.active("low") == (run["position"] == SHORT.low)).all()
    table = run.to_polars()
    assert table.columns == [*run.names, "limit_low", "limit_high"]
    assert all((table[name].to_numpy() == run[name]).all() for name in run.names)
    assert (table["limit_high"].to_numpy() == run.active("high")).all()
    many = simulate_many(
        Machine(stopped, P, given=SHORT), {"gain": [0.3, 0.4]}, inputs, output="travel", **way
    )
    assert (many.output[1] == run["travel"]).all()
    by = sensitivities(Machine(stopped, P, given=SHORT), inputs, **way)["position"]
    finely = sensitivities(Machine(stopped, P, given=SHORT), fine, rate)["position"]
    assert by == pytest.approx(finely[::substeps], abs=1e-9)


@pytest.mark.parametrize("way", ["sub-steps", "sub-steps, held"])
def test_a_stepper_gives_the_bits_of_the_run(way: str) -> None:
    run = simulate(Machine(stopped, P, given=SHORT), {"command": COMMAND}, **WAYS[way])
    made = stepper(Machine(stopped, P, given=SHORT), ["command"], **WAYS[way])
    samples = [made.step(u) for u in COMMAND[:200]]
    kept = made.state
    later = [made.step(u) for u in COMMAND[200:]]
    made.state = kept
    assert [made.step(u) for u in COMMAND[200:]] == later
    for name in ("command", "position", "travel"):
        assert [each[name] for each in samples + later] == run[name].tolist()
    for limit in Stops._fields:
        assert [each[limit] for each in samples + later] == run.active(limit).tolist()
    with pytest.raises(InputError, match="command .* nan, .* finite"):
        made.step(np.nan)


def test_a_number_stands_for_a_constant_input() -> None:
    both = Model("both", Valve, Rod, pushed)
    levels = {"command": COMMAND, "push": np.full(COMMAND.size, 0.2)}
    expected = simulate(Machine(both, P), levels, RATE)["position"]
    assert (simulate(Machine(both, P), {**levels, "push": 0.2}, RATE)["position"] == expected).all()
    with pytest.raises(InputError, match="single number: .* array"):
        simulate(Machine(both, P), {"command": 1.0, "push": 0.2}, RATE)


@equation
def pushed(state: Rod, command: float, push: float, p: Valve, h: float) -> Rod:
    return Rod(command, state.position + h * p.gain * (state.opening + push))


@pytest.mark.parametrize("name", Valve._fields)
def test_derivatives_are_those_of_differences(name: str) -> None:
    by = sensitivities(
        Machine(valve, P, given=STROKE), {"command": COMMAND}, RATE, parameters=[name]
    )
    found = by["position"][:, 0]
    value = getattr(P, name)
    ends = []
    for factor in (1.0 + 1e-5, 1.0 - 1e-5):
        moved = P._replace(**{name: value * factor})
        ends.append(
            simulate(Machine(valve, moved, given=STROKE), {"command": COMMAND}, RATE)["position"]
        )
    assert found == pytest.approx((ends[0] - ends[1]) / (2e-5 * value), rel=1e-5, abs=1e-6)
    assert np.abs(found).max() > 0.0


def test_a_library_and_decisions_leave_the_bits_of_many_sets_alone() -> None:
    model = Model("wobbling", Valve, Rod, wobbling)
    changes = {"gain": np.linspace(0.1, 0.9, 21), "lag": np.linspace(0.04, 0.08, 21)}
    changes["overlap"] = np.linspace(-0.2, 0.2, 21)
    rows = simulate_many(
        Machine(model, P), changes, {"command": COMMAND}, RATE, output="position"
    ).output
    for i, row in enumerate(rows):
        p = P._replace(**{name: float(values[i]) for name, values in changes.items()})
        alone = simulate(Machine(model, p), {"command": COMMAND}, RATE)["position"]
        assert (alone == row).all()


@equation
def wobbling(state: Rod, command: float, p: Valve, h: float) -> Rod:
    left = exp(-h / p.lag) if p.lag > 0.05 else exp(-h / 0.05)
    far = abs(command) > p.overlap and (state.position > 0.1 or state.opening < 0.2)
    swing = 0.0
    if far:
        swing = sin(state.position) / (1.0 + cos(state.opening) ** 2)
    target = command + swing if far else p.overlap
    opening = left * state.opening + (1.0 - left) * target
    return Rod(opening, state.position + h * p.gain * opening**3 / (p.overlap + 0.5))


def test_bad_inputs_are_named() -> None:
    machine, good = Machine(valve, P, given=STROKE), {"command": COMMAND}
    with pytest.raises(InputError, match="input 'voltage'; .* command"):
        simulate(machine, {"voltage": COMMAND}, RATE)
    with pytest.raises(InputError, match="a Valve"):
        Machine(valve, STROKE, given=STROKE)
    with pytest.raises(InputError, match="command .* nan at sample 3"):
        simulate(machine, {"command": np.array([0.0, 0.0, 0.0, np.nan])}, RATE)
    with pytest.raises(InputError, match="parameter 'lead'"):
        sensitivities(machine, good, RATE, parameters=["lead"])


def test_names_and_numbers_that_mean_nothing_are_refused() -> None:
    made = stepper(Machine(stopped, P, given=SHORT), ["command"], rate=100.0)
    for wrong in ((), (1.0, 2.0), ("a",), (None,), (np.zeros(2),)):
        with pytest.raises(InputError, match="step takes command: 1 |command is"):
            made.step(*wrong)
    way: Any = {"order": "previous"}
    with pytest.raises(InputError, match="interpolation .* 'order', .* inputs"):
        simulate(
            Machine(stopped, P, given=SHORT), {"command": COMMAND}, rate=100.0, interpolation=way
        )


class Gain(NamedTuple):
    gain: float


class Ways(NamedTuple):
    twice: bool | None = None


class Lone(NamedTuple):
    place: float = 0.0


@equation
def counted(state: Lone, command: float, options: Ways, p: Gain) -> Lone:
    step = p.gain * command
    if options.twice:
        step = 2.0 * step
    return Lone(state.place + step)


def test_an_option_that_is_false_is_off() -> None:
    made = Model("counter", Gain, Lone, counted, options=Ways)
    for options, end in ((Ways(True), 6.0), (Ways(False), 3.0), (Ways(), 3.0)):
        run = simulate(Machine(made, Gain(1.0), options=options), {"command": np.ones(4)}, rate=1.0)
        assert run["place"][-1] == end
    with pytest.raises(InputError, match="None or False .* or True"):
        simulate(Machine(made, Gain(1.0), options=Ways(2)), {"command": np.ones(4)}, rate=1.0)
    with pytest.raises(InputError, match="counter .* given"):
        simulate(Machine(made, Gain(1.0), given=Ways()), {"command": np.ones(4)}, rate=1.0)


@equation
def implicit(p: Valve, h: float) -> float:
    return 1.0 - 1.0 / (1.0 + h / p.lag)


def test_an_equation_of_a_model_is_replaced() -> None:
    other = replaced(valve, lag_share, implicit)
    opening = simulate(Machine(other, P, given=STROKE), {"command": np.ones(9)}, RATE)["opening"]
    # the delay of 3.3 samples is over
    np.testing.assert_allclose((1.0 - opening[6:]) / (1.0 - opening[5:-1]), 1.0 / 1.2, rtol=1e-12)
    assert replaced(join("two", valve), lag_share, implicit).parts[0] is not valve


# --- what is refused ------------------------------------------------------------------------------


class Fill(NamedTuple):
    level: float


class Outlet(NamedTuple):
    width: float


class Odd(NamedTuple):
    level: complex


@equation
def filled(state: Fill, flow: float) -> Fill:
    return Fill(state.level + flow)


@equation
def swung(state: Fill, flow: float) -> Fill:
    return Fill(sin(state.level) + flow)


@equation
def unknown_below(state: Fill) -> float:
    """No number at one level: the difference of two infinities."""
    return 1.0 if state.level != 2.0 else 1e308 * 10.0 - 1e308 * 10.0


@equation
def nothing(state: Fill, flow: float) -> Fill:
    return None


@equation
def row(state: Fill, flow: float) -> Fill:
    return (state.level, flow)


@equation
def growing(state: Fill, flow: float) -> Fill:
    return Fill(1e300 * (state.level + flow))


@equation
def drained(state: Fill, flow: float, p: Outlet) -> Fill:
    return Fill(state.level + log(p.width - 1.0) * flow)


@equation
def full(p: Outlet) -> Fill:
    return Fill(1.0 / (p.width - 1.0))


@equation
def no_state(p: Outlet) -> Outlet:
    return p


@equation
def room(state: Fill) -> float:
    return 3.0 - state.level


@equation
def two_margins(state: Fill) -> Fill:
    return state


@equation
def bare(state: Fill) -> float:
    return state.level


@equation
def mixed(state: Fill, level: float) -> Fill:
    return Fill(state.level + level)


@equation
def still(state: Fill) -> Fill:
    return state


class Flow(NamedTuple):
    flow: float


@equation
def passed_on(flow: float) -> Flow:
    return Flow(2.0 * flow)


@equation
def returned(state: Flow, level: float) -> Flow:
    return Flow(state.flow + level)


class Load(NamedTuple):
    load_torque: float


@equation
def pulled(state: Load, shaft_speed: float) -> Load:
    return Load(shaft_speed)


@equation
def doubled(level: float) -> float:
    return 2.0 * level


WIDE = Outlet(1.0)


def run(step: Any = filled, p: Any = WIDE, flow: Any = None, rate: Any = 1.0, **more: Any):
    """A tank that one unit a second flows into."""
    begin = {"begin": more.pop("begin")} if "begin" in more else {}
    tank = Model("tank", more.pop("parameters", Outlet), more.pop("state", Fill), step, **more)
    return simulate(Machine(tank, p), {"flow": np.ones(5) if flow is None else flow}, rate, **begin)


NO_STATE = "must return a Fill of numbers on every path"
REFUSED = {
    "nothing": ({"step": nothing}, f"tank: nothing {NO_STATE}"),
    "row": ({"step": row}, f"row {NO_STATE}"),
    "text": ({"step": "filled"}, "step .* equation, .*'filled'"),
    "complex state": ({"state": Odd}, "Odd.level .* complex, .* float"),
    "signals": ({"sample": bare}, "bare .* named tuple"),
    "margins": ({"domain": two_margins}, "two_margins .* one number"),
    "rest": ({"rest": no_state}, "no_state .* a Fill, .* Outlet"),
    "p complex": ({"p": Outlet(1j)}, "width .* 1j, .* real number"),
    "p list": ({"p": Outlet([1.0])}, r"width .*\[1.0\]"),
    "flow complex": ({"flow": np.ones(5) * 1j}, "flow .* real numbers"),
    "flow none": ({"flow": [None]}, "flow .* real numbers"),
    "rate": ({"rate": "fast"}, "rate .*'fast' Hz, .* above 0"),
    "no such state": ({"begin": {"depth": 1.0}}, "state 'depth' .* level"),
    "hold": ({"taps": {"flow": Tap("flow", hold="cubic")}}, "hold 'cubic'; .* linear"),
    "delay": (
        {"taps": {"flow": Tap("flow", "width")}, "p": Outlet(-0.1)},
        "tank: width .* -0.1 s, .* 0",
    ),
    "input and state": (
        {"step": mixed},
        "tank: 'level' .* input .* Fill: rename",
    ),
    "tap and state": ({"taps": {"flow": Tap("level")}}, "'level' .* input .* Fill"),
    "input time": ({"taps": {"flow": Tap("time")}}, "input .* 'time'"),
    "input and signal": ({"sample": passed_on}, "'flow' .* input .* Flow: rename"),
    "time": ({"integrals": {"time": "level"}}, "'time' .* integrals"),
    "no input": ({"step": still}, "tank .* input 'flow'; .* none"),
    "no delay": ({"taps": {"flow": Tap("flow", "width")}, "p": Outlet(np.nan)}, "width .* nan s"),
}


@pytest.mark.parametrize(("options", "sentence"), REFUSED.values(), ids=REFUSED)
def test_a_model_that_cannot_be_marched_is_refused(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        run(**options)


TANK, PUMP = Model("tank", Outlet, Fill, filled), Model("pump", Outlet, Flow, returned)
FED = Model("tank", Outlet, Fill, filled, taps={"flow": Tap("inflow")})
LATE = "needs 'level', which is known only after tank: put tank before pump"
LOOP = "a loop takes a signal a sample late, late[(].flow.[)], or is one model"
LOAD = Model("load", Outlet, Load, pulled)
JOINED = {
    "order": ((PUMP, FED), {}, f"Model x: pump {LATE}"),
    "loop": ((TANK, PUMP), {}, f"tank needs 'flow', which is known only after pump: {LOOP}"),
    "load": ((LOAD, *pump_drive.parts), {}, "load .* 'shaft_speed', .* after pump: "),
    "drive": ((*pump_drive.parts, LOAD), {}, "pump .* 'load_torque', .* after load: "),
    "link": ((TANK,), {"flow": doubled}, f"tank needs 'flow', .* after tank: {LOOP}"),
    "text": ((TANK, "pump"), {}, "x .* models, .*'pump'"),
}


@pytest.mark.parametrize(("parts", "links", "sentence"), JOINED.values(), ids=JOINED)
def test_models_that_cannot_be_in_series_are_refused(parts, links, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        join("x", *parts, links=links)


def test_a_part_of_a_joined_model_is_named_in_its_numbers() -> None:
    whole = join("whole", FED, PUMP)
    with pytest.raises(InputError, match=r"whole .*parameters\(tank=..., pump=...\)"):
        simulate(Machine(whole, WIDE), {"inflow": np.ones(5)}, 1.0)


def test_a_derivative_that_overflows_is_named() -> None:
    tank = Model("tank", Outlet, Fill, growing)
    columns = {"parameters": ["width", "start.level"], "begin": {"level": 0.0}}
    with pytest.raises(DomainError, match=r"level by start\.level .* inf at sample 2"):
        print(sensitivities(Machine(tank, WIDE), {"flow": np.zeros(5)}, 1.0, **columns)["level"])
    with pytest.raises(InputError, match="limit 'full'; .* none"):
        simulate(Machine(tank, WIDE), {"flow": np.zeros(5)}, 1.0).active("full")


@pytest.mark.parametrize("value", ['"high"', "1j", "[flow]"])
def test_text_complex_numbers_and_lists_are_refused_in_the_equation(tmp_path, value: str) -> None:
    path = tmp_path / "own.py"
    path.write_text(f"def step(state: float, flow: float) -> float:\n    return {value}\n", "utf-8")
    names: dict[str, Any] = {"__name__": "own"}
    exec(compile(path.read_text("utf-8"), str(path), "exec"), names)
    with pytest.raises(EquationError, match=r"own\.py, line 1: a result .* in step"):
        derive(equation(names["step"]), "state")


OUTSIDE = {
    "text": ({"domain": room, "outside": "the tank runs over"}, "tank: the tank runs over under "),
    "function": (
        {
            "domain": room,
            "outside": lambda margin, cause: f"{-margin:g} m too high by the {cause}.",
        },
        r"tank: 1 m too high by the flow\.$",
    ),
    "parameters": ({"step": drained}, "tank's level .* -inf at the end"),
    "rest": ({"rest": full}, r"full .*\(.*zero\)"),
    "overflow": ({"step": growing}, "tank's level .* inf at the end"),
}


@pytest.mark.parametrize(("options", "sentence"), OUTSIDE.values(), ids=OUTSIDE)
def test_leaving_the_domain_ends_in_its_sentence(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(DomainError, match=sentence):
        run(**options)


@pytest.mark.parametrize("sets", [1, 20])
def test_a_margin_that_is_no_number_at_one_sample_is_outside(sets: int) -> None:
    tank = Model("tank", Outlet, Fill, filled, domain=unknown_below)
    inputs = {"flow": np.ones(9)}
    if sets == 1:
        with pytest.raises(DomainError, match="tank: "):
            simulate(Machine(tank, Outlet(1.0)), inputs, 1.0)
        return
    made = simulate_many(
        Machine(tank, Outlet(1.0)), {"width": np.ones(sets)}, inputs, 1.0, output="level"
    )
    assert len(made.failures) == sets


def test_a_report_names_what_is_not_vector_instructions() -> None:
    assert vectorisation_report(valve) == "Nothing keeps valve from vector instructions."
    assert vectorisation_report(pump_drive) == "Nothing keeps pump_drive from vector instructions."
    swinging = Model("swinging", parameters=Outlet, state=Fill, step=swung)
    assert vectorisation_report(swinging).splitlines()[1:] == ["swung calls sin"]


def test_of_two_models_in_series_both_say_what_may_have_happened() -> None:
    tank = {"parameters": Outlet, "state": Fill, "step": filled, "domain": room}
    first = Model("first", **tank, outside="the first runs over")
    second = Model("second", **tank, outside="the second does")
    both = join("both", first, second)
    p = both.parameters(Outlet(1.0), Outlet(1.0))
    with pytest.raises(DomainError, match=r"the first runs over .* Or: the second does"):
        simulate(Machine(both, p), {"flow": np.ones(5)}, 1.0)


@pytest.mark.slow
def test_a_model_goes_to_other_processes_by_its_name() -> None:
    assert pickle.loads(pickle.dumps(pump_drive)) is pump_drive
    with pytest.raises(InputError, match=r"tank .* module .*--jobs 1"):
        pickle.dumps(Model("tank", Outlet, Fill, filled))


# --- what parameters decide alone -----------------------------------------------------------------


class Pipe(NamedTuple):
    lag: float
    leak: float = 0.0
    stop: float = 0.0


class Filled(NamedTuple):
    level: float


@equation
def piped(state: Filled, flow: float, p: Pipe, h: float) -> Filled:
    level = state.level + h / p.lag * flow
    if p.leak > 0.0:
        level = level - h * p.leak * level
    if p.stop > 0.0 and level > p.stop:
        level = p.stop
    return Filled(level)


pipe = Model("pipe", Pipe, Filled, piped)
PIPES = [Pipe(0.5), Pipe(0.5, leak=0.3), Pipe(0.5, stop=0.25), Pipe(0.5, 0.3, 0.25)]


@pytest.mark.parametrize("p", PIPES)
def test_what_parameters_decide_alone_is_decided_ahead(p: Pipe) -> None:
    flow = np.abs(np.sin(0.1 * np.arange(60)))
    decisions = Machine(pipe, p).form(["flow"]).decisions
    assert sorted(decisions) == sorted((p.leak > 0.0, p.stop > 0.0))
    state, expected = Filled(0.0), []
    for each in flow.tolist():
        expected.append(state.level)
        state = piped(state, each, p, 0.01)
    assert simulate(Machine(pipe, p), {"flow": flow}, 100.0)["level"].tolist() == expected
    single = stepper(Machine(pipe, p), ["flow"], rate=100.0)
    assert [single.step(each)["level"] for each in flow] == expected
    slopes = sensitivities(Machine(pipe, p), {"flow": flow}, 100.0)["level"]
    for column, (name, value) in enumerate(p._asdict().items()):
        if value == 0.0:
            assert not slopes[:, column].any()
            continue
        ends = [
            simulate(Machine(pipe, p._replace(**{name: value + change})), {"flow": flow}, 100.0)[
                "level"
            ]
            for change in (-1e-6, 1e-6)
        ]
        difference = (ends[1] - ends[0]) / 2e-6
        np.testing.assert_allclose(slopes[:, column], difference, rtol=1e-6, atol=1e-8)
