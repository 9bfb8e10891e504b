"""Signatures that can be read: few arguments by position; what does not fit them is said."""

import ast
import inspect
from collections.abc import Callable
from math import inf, nan
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import pytest
import typer

import swashplate
from swashplate import Drive, simulate_many
from swashplate.cli import app
from swashplate.errors import SwashplateError
from swashplate.export import content_of, fmu
from swashplate.identification import ModelSetup
from swashplate.machine import Definition, Machine, Model, equation, sensitivities, simulate
from swashplate.machine.linear import linearize
from swashplate.models.displacement_control import spool_balance

MOST = 8
"""Arguments by position; the options of a command are none, they are given by name."""


@pytest.mark.slow
def test_no_function_takes_many_arguments_by_position() -> None:
    package = Path(swashplate.__file__).parent
    found_commands = [*typer.main.get_group(app).commands.values()]
    for each in found_commands:
        found_commands += getattr(each, "commands", {}).values()
    functions = [inspect.unwrap(each.callback) for each in found_commands if each.callback]
    commands = {(Path(inspect.getfile(each)), each.__name__) for each in functions}
    assert len(commands) > 20
    found = []
    for path in sorted(package.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if not isinstance(node, ast.FunctionDef):
                continue
            taken = [a.arg for a in (*node.args.posonlyargs, *node.args.args)]
            own = [name for name in taken if name not in ("self", "cls")]
            if len(own) > MOST and (path, node.name) not in commands:
                found.append(f"{path.relative_to(package)}: {node.name} takes {len(own)}")
    assert found == []


# --- what does not fit ----------------------------------------------------------------------------


class Lag(NamedTuple):
    time: Annotated[float, Definition("time constant", "s", above=0.0)]
    gain: float = 1.0


class State(NamedTuple):
    place: float


@equation
def step(state: State, command: float, p: Lag, h: float) -> State:
    return State(state.place + h / p.time * (p.gain * command - state.place))


LAG = Model("lagging", Lag, State, step)
RECORD = {"command": [1.0, 2.0]}
STILL, BEGUN, NUMBERS = {"command": 0.0}, (State(0.0),), Lag(0.1)
HOIST = Drive.preset("hoist")


def simulated(p: Any = NUMBERS, inputs: Any = RECORD, **given: Any) -> Any:
    return simulate(Machine(LAG, p), inputs, 10.0, **given)


def linear(at: Any = STILL, rate: Any = 10.0, states: Any = BEGUN, **given: Any) -> Any:
    return linearize(Machine(LAG, NUMBERS), at, rate, states=states, **given)


def exported(step: Any) -> Any:
    return content_of(Machine(LAG, NUMBERS), step)


WRONG: list[tuple[Callable[..., Any], tuple[Any, ...], str]] = [
    (exported, (inf, nan, 0.0, "a", None), "step .* number above 0"),
    (
        lambda step: fmu(HOIST, "a.fmu", step=step),
        (inf, nan, -1.0, "a", None),
        "step .* number above 0",
    ),
    (lambda what: content_of(what, 0.1), ("hoist", None), "give a Drive or a Machine"),
    (lambda p: content_of(Machine(LAG, p), 0.1), (None, 3), "parameters .* a Lag"),
    (lambda at: linear(at), (3, None, [0.2]), "at .* mapping"),
    (lambda x: linear({"command": x}), ("a", nan, [1]), "command .* finite"),
    (
        lambda rate: linear(rate=rate),
        (inf, nan, -1.0, "a"),
        "rate .* number above 0",
    ),
    (
        lambda states: linear(states=states),
        ((), (1,), State(0.1), 3, (State("a"),), (State(nan),), (State(0.1), State(0.1))),
        "lagging: states .* tuple of one State of finite numbers",
    ),
    (lambda inputs: linear(inputs=inputs), ((),), "one varying input"),
    (lambda outputs: linear(outputs=outputs), ((),), "an output"),
    (lambda model: linearize(model, STILL, 10.0), (LAG, None), "model with numbers"),
    (lambda k: linear().margins(k), ("a", None, lambda f: f[:3]), "controller .* gain"),
    (lambda f: linear().response(f), ("a", None), "Frequencies .* one row of finite num"),
    (
        lambda begin: simulated(begin=begin),
        ((1, 2), 3, "place", [("place", 1.0)]),
        "begin .* mapping",
    ),
    (
        lambda begin: sensitivities(Machine(LAG, NUMBERS), RECORD, 10.0, begin=begin),
        ((1, 2), "place"),
        "begin .* mapping",
    ),
    (lambda inputs: simulated(inputs=inputs), (3, None, [1, 2]), "inputs .* mapping"),
    (
        lambda number: simulated(substeps=number),
        (0, 1.5, inf, nan, "a"),
        "substeps .* whole number",
    ),
    (lambda options: Machine(LAG, NUMBERS, options=options), (3,), "lagging.* options"),
    (
        lambda time: simulated(Lag(time)),
        (0.0, -0.1, nan),
        r"lagging: time .* s, .* above 0",
    ),
    (
        lambda low: ModelSetup(LAG, {"time": (low, 0.1, 1.0)}),
        (0.0, -0.1),
        r"lagging, a bound: time .* s, .* above 0",
    ),
    (
        lambda changes: simulate_many(Machine(LAG, NUMBERS), changes, RECORD, 10.0, output="place"),
        (3, [("time", [1.0])]),
        "changes .* mapping",
    ),
    (lambda z: HOIST.scale(Z10=z), ("text", None), "factor of Z10 .* number"),
    (lambda name: HOIST[name], (3, "Z99"), "no parameter"),
    (lambda old: HOIST.with_equation(old, spool_balance), ("text", None, 3), "equation"),
    (lambda new: HOIST.with_equation(spool_balance, new), ("text", None, 3), "equation"),
    (
        lambda own: HOIST.with_equation(spool_balance, spool_balance, own),
        (3, dict),
        "class of named tuples",
    ),
    (lambda rate: HOIST.stepper(rate), ("a", None, inf), "rate .* between"),
    (lambda rate: HOIST.simulate([1.0, 2.0], rate), ("a", None, nan), "rate .* between"),
    (lambda at: HOIST.linearize(at), ("a", nan, inf), "finite number of volts"),
    (lambda at: HOIST.steady_speed(at), ("a", nan, [[1.0], [1.0, 2.0]]), "finite commands"),
    (
        lambda each: HOIST.simulate([1.0, 1.0], supply_pressure=each),
        (0.0, -1.0, [1e6, -1.0]),
        "supply_pressure .*, .* 1 to",
    ),
    (
        lambda each: HOIST.simulate([1.0, 1.0], pump_speed=each),
        (-1.0, [1.0, -0.1]),
        "pump_speed .* -.*, .* 0 to 10",
    ),
    (lambda name: HOIST.renamed(name), ("", " ", None), "drive's name .* text"),
    (
        lambda bias: HOIST.frequency_response([1.0], [1.0], bias=bias),
        ("a", None, nan),
        "bias .* finite number",
    ),
]


@pytest.mark.parametrize(
    ("call", "value", "sentence"),
    [(call, value, sentence) for call, values, sentence in WRONG for value in values],
)
def test_what_does_not_fit_is_said_in_a_sentence(
    call: Callable[..., Any], value: Any, sentence: str
) -> None:
    with pytest.raises(SwashplateError, match=sentence) as caught:
        call(value)
    assert "\n" not in str(caught.value)


def test_sets_beyond_a_range_do_not_stop_the_others() -> None:
    sets = {"time": [0.1, -0.1, 0.2]}
    batch = simulate_many(Machine(LAG, NUMBERS), sets, RECORD, 10.0, output="place")
    assert list(batch.failures) == [1]
    assert "time (time constant) is -0.1 s, but must be above 0" in batch.failures[1]
