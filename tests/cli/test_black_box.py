"""One file serves all commands: a machine with what is free of it, or a program in its place."""

import re
import shlex
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.signal import lfilter

from swashplate.documents import parse_toml

EQUATIONS = """
from math import exp
from typing import Annotated, NamedTuple

from swashplate import Definition, Machine, Model, equation


class Tank(NamedTuple):
    gain: Annotated[float, Definition("gain of the valve", "bar/V")]
    lag: Annotated[float, Definition("time constant", "s", above=0.0)]
    leak: float = 0.0


class State(NamedTuple):
    level: Annotated[float, Definition("level of the tank", "bar")]


@equation
def step(state: State, valve: float, bias: float, p: Tank, h: float) -> State:
    aim = p.gain * valve + bias - p.leak
    return State(aim + exp(-h / p.lag) * (state.level - aim))


tank = Model("tank", Tank, State, step)
machine = Machine(tank, Tank(gain=1.0, lag=0.1))
free = {"gain": (0.1, 10.0), "lag": (0.01, 3.0), "start.level": (-1.0, 0.0, 1.0)}
substeps = 2
noise = {"level": 0.01}
"""
PROGRAM = """
import numpy as np

from swashplate import BlackBox, Definition


def level_of(time, inputs, numbers):
    level = np.full(time.size, numbers["start.level"])
    aim = numbers["gain"] * inputs["valve"] + inputs["bias"]
    for k, left in enumerate(np.exp(-np.diff(time) / numbers["lag"])):
        level[k + 1] = aim[k] + left * (level[k] - aim[k])
    return {"level": level}


machine = BlackBox(
    "tank",
    level_of,
    inputs=("valve", "bias"),
    outputs=("level",),
    numbers={"gain": 1.0, "lag": 0.1, "start.level": 0.0},
    definitions={
        "bias": Definition("pressure behind the valve", "bar"),
        "level": Definition("level of the tank", "bar"),
        "lag": Definition("time constant", "s", above=0.0),
    },
)
free = {"gain": (0.1, 10.0, "bar/V"), "lag": (0.01, 3.0), "start.level": (-1.0, 1.0, "bar")}
noise = {"level": 0.01}
"""
CAMPAIGN = """
title = "Tank"

[axes.tank]
time = { column = "time", unit = "s" }
input = { kind = "other", column = "valve", unit = "V", interpolation = "previous" }
channels.level = { kind = "other", column = "level", unit = "bar" }
channels.bias = { kind = "other", column = "bias", unit = "bar" }

[[runs]]
file = "slow.csv"

[[runs]]
file = "fast.csv"

[[runs]]
file = "mixed.csv"
role = "validate"
"""
TIME = 0.02 * np.arange(600)
COMMANDS = {
    "slow": np.sign(np.sin(0.9 * TIME)),
    "fast": np.sin(2.0 * TIME),
    "mixed": 0.5 * np.sin(1.3 * TIME) + 0.3 * np.sin(0.4 * TIME),
}
STEP = "step:1,start=1,stop=3,length=4"


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., str]]:
    """Write a file of a machine; its name."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr(sys, "path", [*sys.path])

    def write(text: str) -> str:
        (tmp_path / "boxed_tank.py").write_text(text, "utf-8")
        return "boxed_tank.py"

    yield write
    sys.modules.pop("boxed_tank", None)


@pytest.fixture(params=["machine", "program"])
def file(request: pytest.FixtureRequest, own: Callable[..., str]) -> str:
    """A file of the tank, as equations or as a program."""
    return own(EQUATIONS if request.param == "machine" else PROGRAM)


def write_logs() -> None:
    """A tank of gain 2 bar/V and lag 0.3 s, which begins at 0.4 bar, by SciPy's recursion."""
    random, left = np.random.default_rng(4), np.exp(-0.02 / 0.3)
    for name, valve in COMMANDS.items():
        forced = lfilter([0.0, 1.0 - left], [1.0, -left], 2.0 * valve)
        level = forced + 0.4 * left ** np.arange(TIME.size)
        noisy = level + 0.01 * random.standard_normal(TIME.size)
        columns = {"time": TIME, "valve": valve, "bias": 0.0 * TIME, "level": noisy}
        pl.DataFrame(columns).write_csv(f"{name}.csv")
    Path("campaign.toml").write_text(CAMPAIGN, "utf-8")


def test_a_step_is_answered_as_by_formula(done, file) -> None:
    words = ("--measured", "bias=0.5", "--set", "lag=300ms", "--set", "start.level=0.2")
    held = ("--interpolation", "previous")
    text = done("simulate", file, STEP, *words, *held, "--out", "run.csv")
    frame = pl.read_csv("run.csv")
    time, level = (frame[name].to_numpy() for name in ("time", "level"))
    expected = 0.5 - 0.3 * np.exp(-time / 0.3)
    expected += np.where(time < 1.0, 0.0, 1.0 - np.exp(-(time - 1.0) / 0.3))
    before = time <= 3.0
    np.testing.assert_allclose(level[before], expected[before], atol=1e-8)
    assert "lag: 0.1 -> 0.3 s" in text
    assert "level of the tank" in text


def test_what_is_fitted_serves_the_other_commands(done, number, file) -> None:
    write_logs()
    words = ("--model", file)
    text = done("fit", "campaign.toml", *words, "--out", "fitted", "--no-report")
    assert number(text, "gain       bar/V", 1) == pytest.approx(2.0, rel=0.01)
    assert number(text, "lag        s", 1) == pytest.approx(0.3, rel=0.02)
    numbers = parse_toml(Path("fitted/parameters.toml").read_text("utf-8"), "")["tank"]
    assert numbers.get("leak", 0.0) == 0.0  # what is not free stays as the machine has it
    assert "Usable" in done("validate", "fitted", "campaign.toml", *words)
    text = done("simulate", "fitted", STEP, *words, "--measured", "bias=0", "--out", "run.csv")
    assert pl.read_csv("run.csv")["level"].max() == pytest.approx(2.0, rel=0.01)
    (line,) = re.findall(r"^lag +time constant +(.*)$", done("show", "fitted", *words), re.M)
    assert float(line.split()[0]) == pytest.approx(0.3, rel=0.02)


SENTENCE = (
    "tank is a black box: it is simulated, compared and fitted; for anything else write its "
    "equations as a Model."
)
VERBS = (
    "linearize FILE --at valve=1 --at bias=0",
    "bode FILE --at bias=0",
    "limits FILE",
    "limits FILE step:1 --measured bias=0",
    "export FILE --c source",
    "export FILE --fmu tank.fmu",
    "export FILE --wasm tank.wasm",
    "live FILE --maneuver step:1 --measured bias=0",
)


@pytest.mark.parametrize("file", ["program"], indirect=True)
@pytest.mark.parametrize("typed", VERBS)
def test_what_needs_equations_refuses_in_one_sentence(refused, file, typed) -> None:
    assert SENTENCE in refused(*shlex.split(typed.replace("FILE", file)))


@pytest.mark.parametrize("file", ["machine"], indirect=True)
def test_a_machine_is_linearised_at_its_numbers(done, number, file) -> None:
    text = done("linearize", file, "--at", "valve=1", "--at", "bias=0", "--input", "valve")
    assert number(text, "rad/s") == pytest.approx(-10.0, rel=1e-6)
    assert "1/1024 s" in text  # two steps a sample


OLD = "from swashplate.identification import UserModel\n"


def test_an_old_file_is_told_what_to_write(refused, own) -> None:
    sentence = refused("simulate", own(OLD + EQUATIONS), STEP)
    assert "boxed_tank.py, line 1" in sentence
    assert "there is no UserModel any more: give a fit a Machine(model, numbers)" in sentence


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("rate = 'fast'", "rate is 'fast', but must be a number"),
        ("def rate(): pass", "rate is <function rate"),
        ("begin = 3", "begin is 3"),
    ],
)
def test_what_stands_beside_a_machine_is_checked(refused, own, line: str, said: str) -> None:
    assert said in refused("simulate", own(EQUATIONS + line), STEP, "--measured", "bias=0")


def test_rate_and_substeps_hold_without_what_is_free(done, own) -> None:
    name = own(EQUATIONS.partition("free = ")[0] + "rate = 100.0\nsubsteps = 4\n")
    assert "at 100 Hz" in done("simulate", name, "step:1", "--measured", "bias=0")
    assert "1/400 s" in done("linearize", name, "--at", "valve=1", "--at", "bias=0")
