"""A held-out log that the fit does not predict is named by fit, validate and report."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter
from tests.marks import rest_slow
from typer.testing import CliRunner

from swashplate.cli import app
from swashplate.identification import Identification, assess_fit, predict
from swashplate.identification.validation import RunQuality

MODEL = """
from typing import NamedTuple
from swashplate.machine import Model, discretised, equation

class Motor(NamedTuple):
    gain: float
    lag: float

class State(NamedTuple):
    speed: float

@equation
def rates(state: State, valve: float, p: Motor) -> State:
    return State((p.gain * valve - state.speed) / p.lag)

step = discretised(rates, "midpoint")
model = Model("motor", parameters=Motor, state=State, step=step)
substeps = 4
free = {"gain": (0.1, 1.0, 10.0), "lag": (0.02, 0.1, 2.0)}
noise = {"speed": 0.02}
"""
TIME = 0.01 * np.arange(1000)
COMMANDS = {
    "slow": 4.0 * np.sin(0.8 * TIME),
    "fast": 3.0 * np.sin(3.0 * TIME),
    "steps": 4.0 * np.sign(np.sin(1.3 * TIME)),
    "stairs": np.round(4.0 * np.sin(0.6 * TIME)),
    "mixed": 2.0 * np.sin(1.7 * TIME) + 1.5 * np.sin(0.5 * TIME),
    "square": 2.5 * np.sign(np.sin(2.0 * TIME)),
}
HELD_OUT = ("mixed", "square")


def answer(command: np.ndarray, gain: float, lag: float) -> np.ndarray:
    """A first-order lag behind a command that is held from sample to sample, exactly."""
    left = np.exp(-0.01 / lag)
    return np.asarray(lfilter([0.0, (1.0 - left) * gain], [1.0, -left], command))


def dropped_out(speed: np.ndarray) -> np.ndarray:
    return np.where((TIME >= 4.0) & (TIME < 4.4), 0.0, speed)


DAMAGES = {
    "x 0.5": lambda speed, command: 0.5 * speed,
    "x 0.7": lambda speed, command: 0.7 * speed,
    "x 1.3": lambda speed, command: 1.3 * speed,
    "zeros for 0.4 s": lambda speed, command: dropped_out(speed),
    "another machine": lambda speed, command: answer(command, 1.5, 0.45),
}


def write(folder: Path, damage: str = "", damaged: tuple[str, ...] = ()) -> Path:
    """A campaign of a motor of gain 2 and lag 0.3 s, with damage to some logs."""
    folder.mkdir(exist_ok=True)
    random = np.random.default_rng(3)
    lines = [
        'title = "Motor"\n[axes.motor]\ntime = { column = "time", unit = "s" }',
        'input = { kind = "other", column = "valve", unit = "V", interpolation = "previous" }',
        'channels.speed = { kind = "other", column = "speed", unit = "rad/s" }',
    ]
    for name, command in COMMANDS.items():
        speed = answer(command, 2.0, 0.3)
        if name in damaged:
            speed = DAMAGES[damage](speed, command)
        speed = speed + random.normal(0.0, 0.02, TIME.size)
        rows = np.column_stack([TIME, command, speed])
        np.savetxt(
            folder / f"{name}.csv", rows, "%.6f", ",", header="time,valve,speed", comments=""
        )
        role = "validate" if name in HELD_OUT else "fit"
        lines.append(f'[[runs]]\nfile = "{name}.csv"\nrole = "{role}"')
    (folder / "campaign.toml").write_text("\n".join(lines) + "\n", "utf-8")
    return folder / "campaign.toml"


OPTIONS = ("--no-report", "--out")


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The model's file, one for all campaigns: a module is loaded once."""
    path = tmp_path_factory.mktemp("model") / "held_out_motor.py"
    path.write_text(MODEL, "utf-8")
    return str(path)


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory, model: str) -> Path:
    """The sound campaign, with its fit in the folder beside it."""
    campaign = write(tmp_path_factory.mktemp("held_out") / "sound")
    fitted = str(campaign.parent / "fitted")
    found = CliRunner().invoke(app, ["fit", str(campaign), "--model", model, *OPTIONS, fitted])
    assert found.exit_code == 0, found.output
    assert "Data: Sound: no fitted run stands out" in found.stdout
    return campaign


def test_sound_logs_are_not_refused(run: Callable, sound: Path, model: str) -> None:
    found = run("validate", str(sound.parent / "fitted"), str(sound), "--model", model)
    assert found.exit_code == 0, found.output
    assert "Usable: " in found.stdout


def test_soundness_claims_no_more_than_was_judged(sound: Path, model: str) -> None:
    fit = Identification.load(sound.parent / "fitted", sound, model=model)
    predicted = predict(fit.fit.parameters, fit.held_out)
    assert "2 held-out runs are predicted as the fitted ones lead one to expect" in fit.verdict.data
    assert "udged" not in fit.verdict.data

    none = assess_fit(fit.fit, ()).data
    assert none.endswith("none is clipped. No held-out run was judged.")
    assert "predicted" not in none

    def twice(quality: RunQuality) -> RunQuality:
        run = quality.experiment
        command = replace(run.input, values=2.0 * run.input.values)
        return replace(quality, experiment=replace(run, input=command))

    # the fitted commands go to 4 V, these to 3.5 V and 2.5 V
    beyond = [
        twice(quality) if quality.experiment.name == "mixed" else quality for quality in predicted
    ]
    some = assess_fit(fit.fit, beyond).data
    assert "1 held-out run is predicted" in some
    assert some.endswith("Not judged, as the command goes beyond the fitted ones: mixed.")


@pytest.mark.parametrize("damaged", [HELD_OUT[:1], HELD_OUT], ids=["one", "all"])
@pytest.mark.parametrize("damage", rest_slow([*DAMAGES], 2))
def test_damaged_logs_are_named(
    run: Callable,
    sound: Path,
    model: str,
    tmp_path: Path,
    damage: str,
    damaged: tuple[str, ...],
) -> None:
    campaign = write(tmp_path / "damaged", damage, damaged)
    found = run("fit", str(campaign), "--model", model, *OPTIONS, "fitted")
    assert found.exit_code == 1, found.output
    assert "Not usable, as the data are not sound: " in found.stderr
    said = " ".join(found.stdout.split())
    for name in HELD_OUT:
        assert (f"{name}: 'speed', which was held out, is" in said) == (name in damaged)
    # what the sound fit stated tells the same of logs that it has never seen
    found = run("validate", str(sound.parent / "fitted"), str(campaign), "--model", model)
    assert found.exit_code == 1
    said = " ".join(found.stdout.split())
    for name in HELD_OUT:
        assert (f"{name}: 'speed'" in said.partition("Data: ")[2]) == (name in damaged)


def test_the_report_names_the_run(run: Callable, model: str, tmp_path: Path) -> None:
    campaign = write(tmp_path / "damaged", "x 0.7", ("mixed",))
    assert run("fit", str(campaign), "--model", model, "--out", "fitted").exit_code == 1
    page = (tmp_path / "fitted" / "report.html").read_text("utf-8")
    assert "mixed: &#39;speed&#39;, which was held out, is" in page
    assert "Settle first: mixed" in page
