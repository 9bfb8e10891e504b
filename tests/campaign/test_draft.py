"""A first draft of a campaign file, which must be readable as it is."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from tests.campaign.conftest import Drafted

from swashplate import InputError, ParameterError
from swashplate.campaign import draft_campaign as draft


@pytest.mark.parametrize(
    ("header", "kind"),
    [
        ("Joystick voltage", "voltage"),
        ("lever [V]", "voltage"),
        ("Boom Cmd", "other"),
        ("command_V", "voltage"),
        ("ammeter [mA]", "rectified_current"),
        ("Current", "rectified_current"),
        ("encoderCounts", "encoder_counts"),
        ("winch speed [rpm]", "shaft_speed"),
        ("EXP_PosFb", "position"),
        ("swash angle", "swash_angle"),
        ("drum [deg/s]", "shaft_speed"),
        ("Trommeldrehzahl", "shaft_speed"),
        ("Joystickspannung", "voltage"),
        ("Magnetstrom", "rectified_current"),
        ("Strøm", "rectified_current"),
        ("Courant", "rectified_current"),
        ("Vitesse du tambour", "shaft_speed"),
        ("tambour vitesse", "shaft_speed"),
        ("trommel toerental", "shaft_speed"),
        ("Turtall", "shaft_speed"),
        ("Kolbenweg", "position"),
        ("Ángulo", "position"),
        ("Drehzahl der Trommel", "shaft_speed"),
        ("Hebel", "other"),
        ("Impulse", "encoder_counts"),
        ("Drehgeber", "encoder_counts"),
        ("oil temperature [degC]", None),
    ],
)
def test_what_a_header_says(tmp_path: Path, header: str, kind: str | None) -> None:
    (tmp_path / "log.csv").write_text(f"Time [ms],{header}\n0,0.5\n1,1.5\n2,1.5\n", "utf-8")
    text = draft([tmp_path / "log.csv"], tmp_path)
    assert 'time = { column = "Time [ms]" }' in text
    tables = tomllib.loads(text)["axes"]["drive"]
    entries = [tables["input"], *tables["channels"].values()]
    assert [each["kind"] for each in entries if each["column"] == header] == [kind] * (
        kind is not None
    )
    assert (f"# Columns that are not used: {header}" in text) == (kind is None)


def test_a_draft_can_be_read(drafted: Drafted) -> None:
    row = np.arange(100.0)
    on = 1.0 * (row > 20)
    columns = {"time [s]": row / 100, "voltage [V]": 4 * on, "current [A]": 0.4 * on}
    logs = {f"run{number}.csv": {**columns, "counts": 7 * row} for number in range(4)}
    with pytest.raises(ParameterError, match="encoder_counts need counts_per_turn"):
        drafted(logs, draft={"drive": "hoist"})
    tests = drafted(logs, draft={"drive": "hoist", "counts_per_turn": 2526.3})
    text = tests.path.read_text("utf-8")
    content = tomllib.loads(text)
    axis = content["axes"]["hoist"]
    assert axis["drive"] == "hoist"
    assert axis["input"]["kind"] == "voltage"
    assert set(axis["channels"]) == {"rectified_current", "encoder_counts"}
    assert [run["role"] for run in content["runs"]] == ["fit", "fit", "fit", "validate"]
    assert "100 samples, 0.99 s at 100 Hz, step +4 V" in text
    assert axis["channels"]["encoder_counts"]["counts_per_turn"] == 2526.3
    assert tests["run2"].input.values[-1] == 4.0
    assert tests["run2"]["rectified_current"].values[-1] == pytest.approx(0.4)


def test_logs_of_one_name_are_told_apart_by_their_folders(drafted: Drafted) -> None:
    text = "t,voltage [V],speed [rpm]\n0,0,0\n0.1,0,0\n0.2,4,9\n"
    tests = drafted(dict.fromkeys(("monday/run.csv", "tuesday/run.csv"), text))
    assert [each.run for each in tests] == ["monday/run.csv", "tuesday/run.csv"]


def test_an_axis_for_each_prefix_and_logs_without_some(drafted: Drafted) -> None:
    both = "Time,Boom Cmd,Stick Cmd,Boom Ms,Stick Ms\n0,7,6,1,2\n1,8,6,1,2\n"
    one = "Time,Boom Cmd,Boom Ms\n0,7,1\n1,8,2\n"
    content = tomllib.loads(drafted({"both.csv": both, "one.csv": one}).path.read_text("utf-8"))
    assert list(content["axes"]) == ["boom", "stick"]
    assert content["axes"]["stick"]["input"]["offset"] == -6.0
    assert content["axes"]["boom"]["channels"]["position"]["unit"] == "mm"
    assert "only" not in content["runs"][0]
    assert content["runs"][1]["only"] == ["boom"]


def test_a_log_without_a_command_leaves_a_line_to_fill_in(drafted: Drafted, tmp_path: Path) -> None:
    logs = {"log.csv": {"time": [0.0, 1.0], "current": [1.0, 2.0], "Kanal 3": [2.0, 3.0]}}
    with pytest.raises(InputError, match="For the input: .* has no column 'FIXME'; it has 'time'"):
        drafted(logs)
    text = (tmp_path / "campaign.toml").read_text("utf-8")
    assert "column = \"FIXME\"    # which of 'time', 'current', 'Kanal 3' commands?" in text
    columns = {"Kanal 3": "voltage"}
    drive = drafted(logs, draft={"columns": columns, "units": {"Kanal 3": "mV"}})["log"].input
    assert (drive.kind, drive.values.tolist()) == ("voltage", [0.002, 0.003])
    with pytest.raises(InputError, match="No log has a column 'Kanal 4'"):
        drafted(logs, draft={"columns": {"Kanal 4": "voltage"}})
    with pytest.raises(InputError, match="cannot be a 'volts': it is time, voltage"):
        drafted(logs, draft={"columns": {"Kanal 3": "volts"}})
    with pytest.raises(InputError, match="at least one log"):
        draft([], tmp_path)


ENCODER = {"drive": "hoist", "counts_per_turn": 4096.0}


@pytest.mark.parametrize("name", ["Drehgeber", "counts"])
def test_a_counter_that_begins_anew_is_an_encoder_s(drafted: Drafted, name: str) -> None:
    """A column of whole numbers that go up to 4095 and begin anew, and one that numbers rows."""
    row = np.arange(200)
    on, counts = row > 20, 60 * np.maximum(row - 20, 0) % 4096
    columns = {"Nr": row, "time": row / 100, "voltage": 4 * on, name: counts, "state": ["on"] * 200}
    text = drafted({"log.csv": columns}, draft=ENCODER).path.read_text("utf-8")
    found = tomllib.loads(text)["axes"]["hoist"]["channels"]["encoder_counts"]
    assert found["column"] == name
    assert (found["counts_per_turn"], found["rolls_over_at"]) == (4096, 4096)
    assert "rolls_over_at = 4096    # guessed" in text
    assert "# Columns that are not used: Nr, state" in text
