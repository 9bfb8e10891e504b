"""Measured logs of other machines load as campaigns; they are not part of the project."""

from pathlib import Path

import numpy as np
import pytest

from swashplate import Campaign
from swashplate.campaign import examine

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data"
pytestmark = pytest.mark.skipif(
    not DATA.exists(), reason="the measured logs of other machines are not beside this checkout"
)
BOOM = """
[axes.boom]
time = { column = "Time", unit = "s" }
input = { kind = "other", column = "Boom Cmd", unit = "%", offset = -7.4745 }
channels.position = { kind = "position", column = "Boom Ms", unit = "mm" }
"""
ROD = """
[axes.eha]
time = { column = "EXP_Time", unit = "s" }
input = { kind = "other", column = "EXP_Speed", unit = "rpm" }
channels.position = { kind = "position", column = "EXP_PosFb", unit = "mm" }
channels.pressure = { kind = "other", column = "EXP_Pressure_A", unit = "bar" }
channels.speed = { kind = "shaft_speed", column = "EXP_Velocity", unit = "mm/s" }
"""


def loaded(folder: Path, axis: str, log: Path) -> Campaign:
    path = folder / "campaign.toml"
    path.write_text(f'{axis}\n[[runs]]\nfile = "{log.as_posix()}"\n', "utf-8")
    return Campaign.from_toml(path)


def test_hands_at_a_joystick_at_irregular_stamps() -> None:
    tests = Campaign.from_toml(ROOT / "examples" / "excavator.toml", logs=DATA / "excavator")
    assert {each.maneuver for each in tests} == {"unnamed motion"}
    run = tests["manual_1021_mitch boom"]
    command, _ = examine(run)
    first = np.array([0.00605297088623, 0.0761840343475])
    assert run.input.time[:2] == pytest.approx(first, abs=0.0)
    assert command.stamps.rate == pytest.approx(19.7, abs=0.1)
    assert command.stamps.jitter > 0.0


def test_a_pause_in_the_log_is_found(tmp_path: Path) -> None:
    tests = loaded(tmp_path, BOOM, DATA / "excavator" / "steps_boom_0928_0829.csv")
    command, _ = examine(tests[0])
    assert command.stamps.longest > 0.9
    assert "gap" in command.findings[0]


def test_the_electro_hydrostatic_actuator(tmp_path: Path) -> None:
    log = DATA / "eha" / "exp_data_1_3.csv"
    run = loaded(tmp_path, ROD, log)["exp_data_1_3"]
    lines = log.read_text("utf-8").splitlines()
    last = 1e-3 * float(lines[-1].split(";")[2])
    assert run["position"].values.size == len(lines) - 1
    assert run["position"].values[-1] == pytest.approx(last, rel=1e-12)
    assert [run[name].unit for name in ("position", "speed", "pressure")] == ["m", "m/s", "bar"]
