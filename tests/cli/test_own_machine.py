"""A user's own machine is simulated, analysed and exported by the commands that run a drive."""

import re
import shlex
import sys
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from math import atan, degrees, hypot, log, pi
from pathlib import Path
from shutil import which

import numpy as np
import polars as pl
import pytest
import typer.main

from swashplate import Drive, linearize, maneuvers
from swashplate.cli import app
from swashplate.cli.machines import OwnMachine, machine_in
from swashplate.cli.parsing import machine_word

FILE = """
from typing import Annotated, NamedTuple

from swashplate import Drive
from swashplate.machine import Definition, Machine, Model, discretised, equation, join


class Filter(NamedTuple):
    lag: Annotated[float, Definition("time constant", "s", above=0.0)]
    gain: float


class State(NamedTuple):
    level: Annotated[float, Definition("level of the tank", "bar", lower=-5.0, upper=1.5)]


class Limits(NamedTuple):
    high: Annotated[bool, Definition("the level is above 1 bar", "1")]
    low: bool


Volts = Annotated[float, Definition("valve command", "V", lower=-50.0, upper=50.0)]
Bias = Annotated[float, Definition("pressure behind the valve", "bar")]


@equation
def rates(state: State, valve: Volts, bias: Bias, p: Filter) -> State:
    return State((p.gain * valve + bias - state.level) / p.lag)


@equation
def settled(valve: float, bias: float, p: Filter) -> State:
    return State(p.gain * valve + bias)


@equation
def limits(state: State, p: Filter) -> Limits:
    return Limits(state.level > 1.0, state.level < -p.gain)


step = discretised(rates, "rk4")
tank = Model("tank", Filter, State, step, limits=limits)
model = tank
free = {"lag": (0.01, 0.5, 1.0, "s"), "start.level": (-1.0, 0.25, 1.0)}
fixed = {"gain": 2.0}
"""
"""A first-order lag of two inputs, of which everything is known by formula."""
FURTHER = """
slow = Machine(tank, Filter(lag=2.0, gain=1.0))
settling = Machine(Model("tank", Filter, State, step, settled=settled), Filter(lag=0.1, gain=2.0))
pair = join("pair", {"left": slow, "right": settling})
winch = Drive.preset("hoist").scale(Z16=0.5)
"""
WITH_WAY = (
    FILE.replace("    level: Annotated[float", "    way: float\n    level: Annotated[float")
    .replace("return State((p.gain", "return State(state.level, (p.gain")
    .replace("    return State(p.gain * valve + bias)", "    return State(0.0, p.gain * valve)")
)
"""The same with the integral of the level as a state."""
NO_BIAS = ("--measured", "bias=0")
STEP = "step:1,start=1,stop=3,length=4"


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., str]]:
    """Write a file of machines, by default tank.py; its name."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr(sys, "path", [*sys.path])
    before = {*sys.modules}

    def write(text: str = FILE + FURTHER, name: str = "own_tank.py") -> str:
        (tmp_path / name).write_text(text, "utf-8")
        sys.modules.pop(Path(name).stem, None)
        return name

    yield write
    for name in {*sys.modules} - before:
        if name.startswith("own_"):
            del sys.modules[name]


def machine_of(word: str) -> OwnMachine:
    named = machine_word(word)
    assert named is not None
    found = machine_in(named)
    assert isinstance(found, OwnMachine)
    return found


# --- simulate -------------------------------------------------------------------------------------


def test_a_step_is_answered_as_by_formula(done, number, own):
    text = done("simulate", own(), STEP, *NO_BIAS, "--set", "lag=100ms", "--out", "run.csv")
    frame = pl.read_csv("run.csv")
    time, level = (frame[name].to_numpy() for name in ("time", "level"))
    start = 0.25 * np.exp(-time / 0.1)
    expected = start + np.where(time < 1.0, 0.0, 2.0 - 2.0 * np.exp(-(time - 1.0) / 0.1))
    before_stop = time <= 3.0
    np.testing.assert_allclose(level[before_stop], expected[before_stop], rtol=0.0, atol=1e-8)
    assert "lag: 0.5 -> 0.1 s" in text
    assert "level of the tank" in text
    # above 1 bar from T ln 2 after the rise until T ln 2 after the fall, of 4 s
    assert re.search(r"^high .* 50\.0 %$", text, re.MULTILINE)
    assert "low" in text
    assert "range of level" in text


def test_states_begin_where_they_are_set(done, own):
    done("simulate", own(), STEP, *NO_BIAS, "--set", "start.level=0.4", "--out", "run.csv")
    assert pl.read_csv("run.csv")["level"][0] == 0.4


@pytest.mark.parametrize(
    ("word", "lag"), [("own_tank.py", 0.5), ("own_tank.py:slow", 2.0), ("own_tank.py:tank", 0.5)]
)
def test_a_word_names_a_machine(own, word, lag):
    own()
    assert machine_of(word).machine.parts[0].p.lag == lag


def test_the_machine_of_a_file_goes_before_its_model(own):
    own(FILE + "machine = Machine(tank, Filter(lag=3.0, gain=1.0))\n")
    assert machine_of("own_tank.py").machine.parts[0].p.lag == 3.0


def test_a_drive_in_a_file_is_a_drive(done, own):
    own()
    Drive.preset("hoist").scale(Z16=0.5).to_toml("winch.toml")
    by_name, by_file = (
        done("simulate", word, "step:9").splitlines()
        for word in ("own_tank.py:winch", "winch.toml")
    )
    assert by_name[1:] == by_file[1:]
    assert "Gain beyond it" in done("limits", "own_tank.py:winch")


def test_the_folder_of_a_fit_has_its_numbers(done, refused, own, tmp_path):
    own()
    (tmp_path / "fitted").mkdir()
    numbers = tmp_path / "fitted" / "parameters.toml"
    numbers.write_text("[tank]\nlag = 0.2\ngain = 2.0\n", "utf-8")
    words = ("linearize", "fitted", "--model", "own_tank.py", "--at", "1", "--at", "bias=0")
    text = done(*words)
    assert "-5  " in text  # the pole, -1/0.2 s
    assert "fitted (own_tank.py)" in text
    numbers.write_text("[tank]\ngain = 2.0\n", "utf-8")
    assert "[tank] with gain, lag" in refused(*words)


def test_a_log_drives_all_inputs_by_their_names(done, own):
    time = 0.02 * np.arange(201)
    columns = {"time": time, "valve [mV]": 500.0 * np.ones(201), "bias": 0.1 * time, "other": time}
    pl.DataFrame(columns).write_csv("log.csv")
    own()
    text = done("simulate", "own_tank.py", "log.csv", "--interpolation", "linear", "--out", "a.csv")
    assert "201 samples at 50 Hz" in text
    frame = pl.read_csv("a.csv")
    np.testing.assert_allclose(frame["valve"], 0.5)
    np.testing.assert_allclose(frame["bias"], columns["bias"], atol=1e-12)
    words = ("--column", "other", "--measured", "bias=0.2", "--interpolation", "linear")
    done("simulate", "own_tank.py", "log.csv", *words, "--out", "b.csv", "--rate", "100")
    frame = pl.read_csv("b.csv")
    np.testing.assert_allclose(frame["valve"], frame["time"], atol=1e-12)
    np.testing.assert_allclose(frame["bias"], 0.2)


def test_a_joined_machine_is_named_by_paths(done, own):
    own()
    words = ("--measured", "right.valve=sine:1,0.5", "--measured", "left.bias=1bar")
    changes = ("--measured", "right.bias=0", "--set", "left.lag=1", "--scale", "right.gain=2")
    text = done("simulate", "own_tank.py:pair", STEP, *words, *changes, "--out", "run.csv")
    assert "left.lag: 2 -> 1 s" in text
    assert "right.gain: 2 -> 4" in text
    frame = pl.read_csv("run.csv")
    assert frame["left.valve"].max() == 1.0
    time, level = frame["time"].to_numpy(), frame["left.level"].to_numpy()
    before = time < 1.0
    np.testing.assert_allclose(level[before], 1.0 - np.exp(-time[before]), atol=1e-8)


def test_a_script_finds_no_arguments_and_prints_aside(run, own):
    own("import sys\nassert len(sys.argv) == 1\nprint('as a script')\n" + FILE)
    result = run("show", "own_tank.py")
    assert result.exit_code == 0
    assert result.stderr == "as a script\n"
    assert "script" not in result.stdout


# --- analyse --------------------------------------------------------------------------------------


@pytest.mark.parametrize("word", ["own_tank.py", "own_tank.py:settling"])
def test_poles_and_gains_are_those_of_the_formula(done, number, own, word):
    own()
    words = ("--at", "valve=0.5", "--at", "bias=0.25", "--set", "lag=0.1", "--frequency", "2")
    text = done("linearize", word, *words, "--out", "a.toml", "--input", "valve")
    assert number(text, "level            state") == pytest.approx(1.25, rel=1e-6)
    by = 2.0 * pi * 2.0 * 0.1
    found = [number(text, "valve  level", place) for place in (0, 1, 3)]
    assert found == pytest.approx([2.0, 2.0 / hypot(1.0, by), -degrees(atan(by))], rel=2e-2)
    assert number(text, "rad/s") == pytest.approx(-10.0, rel=1e-6)
    own_machine = machine_of(word)
    machine = own_machine.machine
    assert "A = " in Path("a.toml").read_text("utf-8")
    assert machine.model.external == ("valve", "bias")


def test_a_linear_model_is_that_of_python(done, own):
    own()
    words = ("--at", "valve=0.5", "--at", "bias=0", "--rate", "100", "--out", "a.json")
    done("linearize", "own_tank.py:settling", *words)
    machine = machine_of("own_tank.py:settling").machine
    expected = linearize(machine, {"valve": 0.5, "bias": 0.0}, 100.0)
    expected.write("b.json")
    assert Path("a.json").read_bytes() == Path("b.json").read_bytes()


def test_a_position_goes_on_from_its_start(done, number, own):
    """The level settles, and its integral is that of the level."""
    own(WITH_WAY)
    words = ("--at", "valve=0.5", "--at", "bias=0", "--output", "way")
    text = done("linearize", "own_tank.py", *words)
    assert number(text, "way              state") == 0.0
    assert "by 1 1/s" in text
    assert text.count("integrates") == 3


def test_a_position_that_runs_on_has_no_frequency_response(done, refused, own):
    own(WITH_WAY)
    words = ("bode", "own_tank.py", "--at", "bias=0", "--output", "way", "--points", "2")
    assert "way runs on under this mean, by 1 a second" in refused(*words, "--bias", "0.5")
    assert "valve to way" in done(*words)


def test_a_sine_is_answered_as_by_formula(done, own):
    own()
    words = ("--at", "bias=1", "--from", "0.5", "--to", "4", "--points", "3", "--frequency", "1")
    for word in ("own_tank.py", "own_tank.py:settling"):
        words_of_plot = ("--plot", "a.png", "--linear-at", "0.5", "--force")
        text = done("bode", word, *words, "--set", "lag=0.1", "--out", "a.csv", *words_of_plot)
        assert "valve to level" in text
        frame = pl.read_csv("a.csv")
        by = 2.0 * pi * frame["frequency"].to_numpy() * 0.1
        np.testing.assert_allclose(frame["gain"], 2.0 / np.hypot(1.0, by), rtol=5e-3)
        held = pi * frame["frequency"].to_numpy() / 512.0  # over each step: half of it late
        np.testing.assert_allclose(frame["phase"], -np.arctan(by) - held, rtol=1e-2)


def test_limits_are_listed_and_timed(done, number, own):
    own()
    text = done("limits", "own_tank.py")
    assert "the level is above 1 bar" in text
    assert "level of the tank: at least -5 and below 1.5 bar" in text
    text = done("limits", "own_tank.py", STEP, *NO_BIAS, "--set", "lag=0.1", "--out", "a.csv")
    shares = dict(pl.read_csv("a.csv").select("limit", "share of time").iter_rows())
    assert shares["high"] == pytest.approx(0.5, abs=1e-3)
    assert shares["low"] == 0.0
    # above 1.5 bar from T ln 4 after the rise until T ln 4/3 after the fall
    expected = (2.0 - 0.1 * log(4.0) + 0.1 * log(4.0 / 3.0)) / 4.0
    assert shares["range of level"] == pytest.approx(expected, abs=1e-3)


def test_show_lists_numbers_and_signals(done, number, own):
    text = done("show", own(), "--set", "gain=3")
    assert number(text, "lag        time constant") == 0.5
    assert "gain: 2 -> 3" in text
    assert "valve command" in text


# --- export ---------------------------------------------------------------------------------------


def test_c_source_has_the_numbers(done, own):
    own()
    text = done("export", "own_tank.py", "--c", "source", "--set", "lag=0.125")
    assert "C: source/tank.h" in text
    assert "0.125, /* lag" in Path("source/tank_values.h").read_text("utf-8")
    if which("cc"):
        done("export", "own_tank.py", "--c", "built", "--compile")
        assert [path for path in Path("built").iterdir() if path.suffix in (".so", ".dylib")]


@pytest.mark.slow
@pytest.mark.skipif(not (which("cc") and find_spec("fmpy")), reason="needs a compiler and FMPy")
def test_an_fmu_answers_as_by_formula(done, own, tmp_path):
    import fmpy

    own()
    assert "FMU 2.0: a.fmu" in done("export", "own_tank.py", "--fmu", "a.fmu", "--set", "lag=0.1")
    inputs = np.array(
        [(0.0, 1.0, 0.5), (1.0, 1.0, 0.5)],
        dtype=[("time", float), ("valve", float), ("bias", float)],
    )
    result = fmpy.simulate_fmu(
        str(tmp_path / "a.fmu"),
        stop_time=1.0,
        output_interval=1.0 / 512.0,
        input=inputs,
        output=["level"],
    )
    expected = 2.5 * (1.0 - np.exp(-result["time"] / 0.1))
    np.testing.assert_allclose(result["level"], expected, atol=1e-8)


def test_a_command_beyond_its_range_is_clipped_on_request(done, own):
    done("simulate", own(), "step:60", *NO_BIAS, "--clip", "--out", "clipped.csv")
    done("simulate", own(), "step:50", *NO_BIAS, "--out", "within.csv")
    clipped, within = (pl.read_csv(f"{name}.csv")["level"] for name in ("clipped", "within"))
    assert (clipped == within).all()


# --- refusals -------------------------------------------------------------------------------------

REFUSED = {
    "simulate own_tank.py step:1": "bias [bar]... --measured bias=NUMBER",
    "simulate own_tank.py:tub step:1": "own_tank.py has no 'tub'; ... slow, settling, pair, winch",
    "simulate own_none.py step:1": "There is no file own_none.py",
    "simulate own_tank.py step:1 --measured bios=0": "no input 'bios'; there are bias",
    "simulate own_tank.py step:1 --measured bias=0 --set lagg=1": "'lagg'; there are lag",
    "simulate own_tank.py step:1 --measured bias=0 --set lag=-1": "lag (time constant) is -1 s",
    "simulate own_tank.py step:1 --measured bias=0 --set lag=1bar": "bar... s",
    "simulate own_tank.py step:1 --scale start.level=2": "--set start.level=VALUE",
    "simulate own_tank.py step:1 --measured bias=1V": "bias ... 'V'... bar",
    "simulate own_tank.py:pair step:1 --set lag=1": "'lag'; there are left.lag, right.lag",
    "simulate own_tank.py step:60 --measured bias=0": "60 V at 1 s... within ±50 V",
    "simulate own_tank.py --model own_tank.py step:1": "leave out --model",
    "linearize own_tank.py --at 1": "bias [bar]... --at bias=NUMBER",
    "linearize own_tank.py --at 1 --at bias=0 --output lewel": "no signal 'lewel'; there are level",
    "linearize own_tank.py --at 1 --at bias=0 --current 1": "--current is for a drive",
    "linearize hoist --at 4 --output shaft_speed": "--output is for a machine of your own",
    "linearize hoist --at four": "--at four... number",
    "linearize hoist --at 4 --input speed": "--input speed... voltage, current, solenoid_force",
    "linearize own_tank.py --at 1 --at bias=0 --rate 0": "rate is 0",
    "linearize own_tank.py --at 1 --at bias=0 --frequency 300": "--frequency is 300 Hz... 256 Hz",
    "simulate own_tank.py:x.y step:1": "own_tank.py has no 'x.y'",
    "show own_tank.py --set lag=nan": "lag=nan",
    "bode own_tank.py": "bias [bar]",
    "bode own_tank.py --at bias=0 --at valve=1": "valve, ... --bias",
    "compare hoist own_tank.py": "own_tank.py is a model file, not a drive",
    "compensate own_tank.py:slow": "own_tank.py is a model file, not a drive",
    "live own_tank.py --maneuver step:1": "tank needs bias [bar]... --measured bias=NUMBER",
    "live own_tank.py camp.toml": "own_tank.py... shows a maneuver... --maneuver step:2",
    "live hoist --maneuver step:9 --measured supply=1": "--measured is for a machine of your own",
    "show own_tank.py --toml": "--toml is for a drive",
    "fit own_tank.py": "own_tank.py is a model file, not a campaign... --model",
}


@pytest.mark.parametrize("typed", REFUSED)
def test_a_sentence_says_what_would_be_right(refused, own, typed):
    own()
    sentence = refused(*shlex.split(typed))
    for part in REFUSED[typed].split("..."):
        assert part in sentence


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x = 1\n", "has no machine: it needs machine = Machine(model, ...)"),
        ("1/0\n", "own_broken.py, line 1: ZeroDivisionError"),
        ("def f(:\n", "own_broken.py, line 1: SyntaxError"),
        ("import sys\nsys.exit(3)\n", "sys.exit(3)"),
        ("machine = 3\n", "machine has the type int"),
        (FILE.replace('fixed = {"gain": 2.0}', ""), "states no value of gain"),
        (FILE + "given = {}\n", "depends on the run"),
        (
            FILE.replace("model = ", "x = ").replace("free", "y") + FURTHER,
            "there are slow, settling, pair, winch: write own_broken.py:slow",
        ),
    ],
)
def test_a_file_without_a_machine(refused, own, text, said):
    assert said in refused("limits", own(text, "own_broken.py"))


def test_a_machine_without_limits_says_how_to_declare_some(refused, own):
    own(FILE.replace(", limits=limits", "").replace(", lower=-5.0, upper=1.5", ""))
    assert "tank declares no limits" in refused("limits", "own_tank.py")


# --- tests to come --------------------------------------------------------------------------------

CAMPAIGN = """
title = "Tank"

[axes.tank]
time = { column = "time", unit = "s" }
input = { kind = "other", column = "valve", unit = "V", interpolation = "previous" }
channels.level = { kind = "other", column = "level", unit = "bar", noise = 0.01 }
channels.bias = { kind = "other", column = "bias", unit = "bar" }

[[runs]]
file = "run.csv"
"""


NOMINAL = np.array([0.5, 2.5, 0.25])
"""Lag [s], gain [bar/V] and level at the start [bar] that a fit begins with."""


def level_of_tank(lag: float, gain: float, start: float) -> np.ndarray:
    """Level under the step, by formula. [bar]"""
    time = 0.02 * np.arange(201)
    rise = gain * (1.0 - np.exp(-np.maximum(time - 1.0, 0.0) / lag))
    fall = gain * (1.0 - np.exp(-np.maximum(time - 3.0, 0.0) / lag))
    return rise - fall + start * np.exp(-time / lag)


@pytest.fixture
def campaign(own: Callable[..., str]) -> str:
    """A campaign of one step of the tank, whose lag is 0.1 s and gain 2 bar/V."""
    own(FILE.replace('fixed = {"gain": 2.0}', 'free["gain"] = (0.5, 2.5, 8.0, "bar/V")'))
    time = 0.02 * np.arange(201)
    valve = maneuvers.parse(STEP)(time)
    noise = 0.01 * np.random.default_rng(1).standard_normal(time.size)
    level = level_of_tank(0.1, 2.0, 0.3) + noise
    frame = {"time": time, "valve": valve, "bias": 0.0 * time, "level": level}
    pl.DataFrame(frame).write_csv("run.csv")
    Path("campaign.toml").write_text(CAMPAIGN, "utf-8")
    return "campaign.toml"


def test_a_test_made_twice_tells_twice_as_much(done, number, campaign):
    words = ("--model", "own_tank.py", "--maneuver", STEP, "--out", "tests.csv")
    text = done("advise", campaign, *words)
    assert "1.41x" in text
    last = text[text.index("For each parameter") :]
    now, then = (number(last, "gain", place) for place in (0, 2))
    assert now / then == pytest.approx(np.sqrt(2.0), rel=0.05)
    # by Fisher information of the formula at the nominal values, one sample in 0.1 s independent
    by = [
        (level_of_tank(*(NOMINAL + step)) - level_of_tank(*(NOMINAL - step))) / 2e-6
        for step in 1e-6 * np.eye(3)
    ]
    errors = 0.01 * np.sqrt(5.0) * np.sqrt(np.diag(np.linalg.inv(np.array(by) @ np.array(by).T)))
    assert now == pytest.approx(100.0 * errors[1] / NOMINAL[1], rel=0.05)
    assert pl.read_csv("tests.csv")["test"].to_list() == ["step 1 V"]


def test_usual_tests_keep_to_the_range_of_the_runs(done, campaign):
    text = done("advise", campaign, "--model", "own_tank.py", "--top", "20")
    assert "step 0.9 V" in text
    assert "step -" not in text  # no run goes the other way
    done("fit", campaign, "--model", "own_tank.py", "--no-report")
    text = done("advise", campaign, "--model", "own_tank.py", "--drive", "fitted")
    assert "residuals of the drive" in text


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--setup", "mine.toml"), "--setup is for a drive"),
        (("--largest", "3"), "--largest is for a drive"),
    ],
)
def test_advice_on_a_model_takes_no_words_of_drives(refused, campaign, words, said):
    assert said in refused("advise", campaign, "--model", "own_tank.py", *words)


def test_a_machine_without_tests_needs_a_campaign(refused, own):
    assert "name their campaign first" in refused("advise", own())


# --- examples -------------------------------------------------------------------------------------

VALVE = re.compile(r"^  (swashplate (?!fit|advise).*valve\.py.*)$", re.MULTILINE)
EXAMPLES = [
    found
    for each in typer.main.get_command(app).commands.values()
    for found in VALVE.findall(str(each.epilog))
]


@pytest.mark.slow
@pytest.mark.parametrize("example", [each for each in EXAMPLES if which("cc") or "fmu" not in each])
def test_the_examples_can_be_run(done, own, example):
    if " live " in example and find_spec("ziglang") is None:
        pytest.skip("ziglang is not installed")
    page = Path(__file__).parents[2] / "docs" / "how-to" / "user-defined-model-fit.md"
    (text,) = re.findall(
        r"^```python\n(# valve\.py\n.*?)^```", page.read_text("utf-8"), re.M | re.S
    )
    own(text, "own_valve.py")
    done(*shlex.split(example.replace("valve.py", "own_valve.py"))[1:])
