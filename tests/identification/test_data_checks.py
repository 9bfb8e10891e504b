"""Campaigns that cannot be fitted get a verdict before the solver; sound ones get none."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from swashplate import Channel, Drive, Experiment, InputError, maneuvers
from swashplate.campaign import Campaign, InputSignal, Source, guess_drive, rig
from swashplate.cli import app
from swashplate.identification.data_checks import (
    Finding,
    Motion,
    check_runs,
    contradictions,
    refuse_unsound,
)
from swashplate.identification.fitting import fit, smooth
from swashplate.identification.setup import Free, Setup, Stage

NOMINAL = smooth(Drive.preset("hoist").parameters)
TRUTH = Drive(NOMINAL).scale(Z10=1.1)
SOURCE = Source(Path("log.csv"), "speed")
FACTOR = Free(relative=(0.5, 2.0))
PUMP = Setup(stages=(Stage(name="pump", part="pump", free={"Z8": FACTOR, "Z10": FACTOR}),))
Change = Callable[[np.ndarray], np.ndarray]


def held(volts: float) -> np.ndarray:
    return maneuvers.step(volts, start=0.5, stop=2.5, length=4.0).sample(512.0)


def run(
    name: str,
    command: np.ndarray,
    change: Change = lambda speed: speed,
    *,
    start: str = "rest",
    weight: float = 1.0,
) -> Experiment:
    """A run of the true drive with noise of 0.6 deg/s; `change` is what goes wrong."""
    simulated = TRUTH.simulate(command, start=start)
    time = np.arange(command.size) / 512.0
    noise = np.random.default_rng(7).normal(0.0, 0.01, command.size)
    channel = Channel(
        "speed",
        "shaft_speed",
        "rad/s",
        time,
        change(simulated.shaft_speed + noise),
        np.full(command.size, weight),
        SOURCE,
        noise=0.01,
    )
    signal = InputSignal("voltage", "V", time, command, "linear", SOURCE)
    return Experiment(name, "hoist", name, "fit", start, None, signal, {"speed": channel})


GOOD = (run("up", held(8.0)), run("down", held(-8.0)), run("low", held(3.0)))


def findings(*runs: Experiment) -> list[Finding]:
    return check_runs(runs, NOMINAL)


def refused(*runs: Experiment, setup: Setup = PUMP) -> str:
    with pytest.raises(InputError) as caught:
        fit(NOMINAL, runs, setup)
    said = str(caught.value)
    assert said.count("\n") == 0
    return said


def warned(*runs: Experiment) -> tuple[str, ...]:
    return refuse_unsound(findings(*runs))


def test_a_sound_campaign_has_no_finding() -> None:
    assert findings(*GOOD) == []


@pytest.mark.parametrize("axis", ["hoist", "slew", "luff"])
def test_the_sources_campaigns_are_sound(axis: str, tmp_path: Path) -> None:
    tests = rig.run(axis, perturb=0.1, seed=3)
    campaign = Campaign.from_toml(rig.write(tests, tmp_path / "virtual"))
    nominal = smooth(campaign.drive(axis).parameters)
    assert check_runs(campaign.select(role="fit"), nominal) == []


# --- contradictory runs ---------------------------------------------------------------------------


def test_a_run_of_the_wrong_sign() -> None:
    said = refused(*GOOD, run("again", held(8.0), lambda speed: -speed))
    assert said.startswith("In again 'speed' goes against the command, in the other runs with it")
    assert "sign = -1" in said


def test_all_runs_of_the_wrong_sign_are_one_finding() -> None:
    runs = [run(f"run {v:g}", held(v), lambda speed: -speed) for v in (8.0, -3.0, 2.0)]
    (found,) = findings(*runs)
    assert found.severity == "refuse"
    assert found.run is None
    assert found.sentence.startswith("In all 3 runs 'speed' goes against the command")


def test_a_gross_spike_is_refused_with_the_line_that_leaves_it_out() -> None:
    def spike(speed: np.ndarray) -> np.ndarray:
        return np.where(np.arange(speed.size) == 900, 100.0, speed)

    spoilt = (*GOOD, run("spoilt", held(5.0), spike))
    with pytest.raises(InputError, match=r"spoilt: 'speed' has 1 spike.*ignore = \[\{ from = 1.75"):
        fit(NOMINAL, spoilt, PUMP)
    with pytest.raises(InputError, match="1 spike"):
        guess_drive(spoilt)
    found = fit(NOMINAL, spoilt, PUMP, loss="soft_l1")
    assert any("1 spike" in each for each in found.doubts)
    assert found.parameters.numbers["Z10"] == pytest.approx(TRUTH.parameters.numbers["Z10"], 0.01)


def test_a_scale_without_a_twin() -> None:
    (said,) = warned(*GOOD, run("again", held(5.0), lambda speed: 4.0 * speed))
    assert said.startswith("In again 'speed' moves 4.4 times as far as in the nominal drive")
    assert "in the other runs 1.1 times" in said


def test_degrees_taken_for_radians() -> None:
    (said,) = warned(*(run(each.name, each.input.values, np.degrees) for each in GOOD))
    assert said.startswith("'speed' moves 63 times as far as in the nominal drive: check its unit")


# --- unexcited ------------------------------------------------------------------------------------


def test_fewer_samples_than_unknowns() -> None:
    few = run("few", held(8.0))
    thin = np.zeros(few.input.values.size)
    thin[[600, 1200]] = 1.0
    few = replace(few, channels={"speed": replace(few["speed"], weight=thin)})
    more = Setup(stages=(Stage(name="pump", part="pump", free={"Z8": FACTOR, "Z16": FACTOR}),))
    assert "Stage pump: 2 samples cannot determine 3 parameters" in refused(few, setup=more)


def test_commands_within_the_dead_zone() -> None:
    said = refused(run("timid", held(0.1)), run("shy", held(-0.05)))
    assert said.startswith("timid: its command stays between 0 and 0.1 V, within the dead zone")
    assert "and so it is in all other runs; a drive that does not move cannot be identified" in said
    assert "-0.0979 to 0.127 V" in said
    (said,) = warned(*GOOD, run("timid", held(0.1)))
    assert said.endswith("it shows the drive at rest only.")


# --- sensors --------------------------------------------------------------------------------------


def test_a_sensor_that_stands_still() -> None:
    said = refused(*GOOD, run("dead", held(8.0), np.zeros_like))
    assert said.startswith("dead: 'speed' never changes, though the drive should move it by about")


def test_a_channel_without_a_number() -> None:
    empty = run("empty", held(8.0), lambda speed: np.full_like(speed, np.nan))
    assert refused(*GOOD, empty).startswith("empty: 'speed' is not finite in 2049 samples")

    def holed(speed: np.ndarray) -> np.ndarray:
        return np.where(np.arange(speed.size) == 512, np.nan, speed)

    assert "not finite in 1 sample, the first at 1 s" in refused(run("holed", held(8.0), holed))
    # what is ignored may be anything
    ignored = run("ignored", held(8.0), lambda speed: np.full_like(speed, np.nan), weight=0.0)
    assert warned(*GOOD, ignored) == ()


def test_an_input_that_is_no_number() -> None:
    broken = run("broken", held(8.0))
    values = broken.input.values.copy()
    values[3] = np.inf
    broken = replace(broken, input=replace(broken.input, values=values))
    assert refused(*GOOD, broken).startswith("broken: its input is not finite at sample 3")


def test_a_run_of_one_sample() -> None:
    one = run("one", held(8.0))
    short = replace(one.input, time=one.input.time[:1], values=one.input.values[:1])
    assert "one: its input has 1 sample;" in refused(*GOOD, replace(one, input=short))
    speed = one["speed"]
    single = replace(speed, time=speed.time[:1], values=speed.values[:1], weight=speed.weight[:1])
    said = refused(*GOOD, replace(one, channels={"speed": single}))
    assert said.startswith("one: 'speed' has 1 sample that can count")


# --- set-ups --------------------------------------------------------------------------------------


def test_a_set_up_that_nothing_depends_on() -> None:
    free = {"Z14": FACTOR, "Z15": FACTOR}
    setup = Setup(stages=(Stage(name="pump", part="pump", free=free),))
    said = refused(*GOOD, setup=setup)
    assert said.startswith("Stage pump: no run depends on any of Z14, Z15")


# --- through the command line ---------------------------------------------------------------------

CAMPAIGN = """
[axes.hoist]
drive = "hoist"
time = { column = "time", unit = "s" }
[axes.hoist.input]
column = "voltage"
interpolation = "linear"
[axes.hoist.channels.speed]
kind = "shaft_speed"
column = "speed"
missing = "drop"
"""


def written(folder: Path, *runs: Experiment) -> Path:
    """Logs and a campaign file."""
    text = CAMPAIGN
    for each in runs:
        rows = np.column_stack([each.input.time, each.input.values, each["speed"].values])
        lines = [",".join("" if np.isnan(x) else repr(float(x)) for x in row) for row in rows]
        log = folder / f"{each.name}.csv"
        log.write_text("time,voltage,speed\n" + "\n".join(lines) + "\n", "utf-8")
        text += f'[[runs]]\nfile = "{log.name}"\n'
    path = folder / "campaign.toml"
    path.write_text(text, "utf-8")
    setup = '[[stages]]\nname = "pump"\npart = "pump"\nfree.Z10 = { relative = [0.5, 2.0] }\n'
    (folder / "setup.toml").write_text(setup, "utf-8")
    return path


def nothing(speed: np.ndarray) -> np.ndarray:
    return np.full_like(speed, np.nan)


@pytest.mark.parametrize(
    ("runs", "said"),
    [
        ((run("timid", held(0.1)),), "timid: its command stays between 0 and 0.1 V"),
        ((*GOOD, run("empty", held(8.0), nothing)), "0 samples that can be used"),
        ((*GOOD, run("one", np.zeros(1))), "1 samples that can be used"),
    ],
)
def test_the_command_line_refuses(tmp_path: Path, runs: tuple[Experiment, ...], said: str) -> None:
    path = written(tmp_path, *runs)
    words = ["fit", str(path), "--setup", str(tmp_path / "setup.toml")]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 2
    assert said in result.stderr
    assert result.stderr.count("\n") == 1


def test_a_position_that_freezes_while_the_drive_runs() -> None:
    """An encoder that hangs from 1.2 to 2.6 s of a step that lasts from 0.5 to 2.5 s."""
    time = np.arange(GOOD[0].input.values.size) / 512.0
    hung = (time > 1.2) & (time < 2.6)

    def turned(run: Experiment, freeze: bool) -> Experiment:
        angle = np.cumsum(TRUTH.simulate(run.input.values).shaft_speed) / 512.0
        if freeze:
            angle[hung] = angle[hung][0]
        channel = Channel(
            "angle", "position", "rad", time, angle, np.ones(time.size), SOURCE, noise=0.001
        )
        return replace(run, channels={"angle": channel})

    good = [turned(each, freeze=False) for each in GOOD]
    assert check_runs(good, NOMINAL) == []
    found = check_runs([turned(GOOD[0], freeze=True), *good[1:]], NOMINAL)
    (said,) = [each.sentence for each in found if "stands still" in each.sentence]
    first, last = (float(each) for each in said.partition("from ")[2].split()[:3:2])
    assert 1.2 <= first <= 1.4
    assert 2.4 <= last <= 2.6
    assert said.startswith("up: 'angle' stands still from ")


def test_the_odd_one_of_many_runs_is_found() -> None:
    time, found = np.arange(0.0, 4.0, 0.02), []
    for number in range(120):
        command = float(number % 3 + 2) * (time > 1.0)
        speed = command * (2.0 if number == 77 else 0.5)
        channel = Channel("speed", "shaft_speed", "rad/s", time, speed, np.ones(time.size), SOURCE)
        found.append(Motion(f"run {number}", channel, time, speed, 0.5 * command))
    (odd,) = contradictions({"speed": found})
    assert odd.run == "run 77"
