"""Signals that are lost for longer than a spike."""

import numpy as np
import pytest
from tests.drafting.conftest import RATE, TIME, Drafted
from tests.drafting.conftest import drafted as drafted

from swashplate import Campaign
from swashplate.campaign import campaign_findings, examine

COMMAND = 4.0 * (TIME > 1.0) * (TIME < 7.0)
NOISE = np.random.default_rng(3).normal(0.0, 1.0, TIME.size)


def followed(level: float, lag: float = 0.2) -> np.ndarray:
    """What goes to a level with the command, by a lag [s]."""
    after, back = TIME - 1.0, TIME - 7.0
    rise = np.where(after > 0.0, 1.0 - np.exp(-np.maximum(after, 0.0) / lag), 0.0)
    fall = np.where(back > 0.0, 1.0 - np.exp(-np.maximum(back, 0.0) / lag), 0.0)
    return level * (rise - fall)


SPEED = np.round(followed(25.0) + 0.05 * NOISE, 3)
CLEAN = np.round(followed(25.0, lag=1.5), 4)
POSITION = np.round(np.cumsum(followed(100.0)) / RATE, 2)
AMPERES = np.round(followed(0.5, lag=0.02) + 2e-3 * NOISE, 4)


def lost(values: np.ndarray, begin: float, length: float, reading: float | None) -> np.ndarray:
    """Values with one reading for a while, by default the one at its beginning."""
    first, stop = np.searchsorted(TIME, (begin, begin + length))
    changed = values.copy()
    changed[first:stop] = values[first] if reading is None else reading
    return changed


def findings(tests: Campaign) -> dict[str, tuple[str, ...]]:
    return {each.signal: each.findings for each in examine(tests[next(iter(tests)).name])}


@pytest.mark.parametrize("length", [0.1, 0.4, 1.0])
@pytest.mark.parametrize(
    ("column", "values", "reading", "said"),
    [
        ("speed [rpm]", SPEED, -999.0, "far off all else, as a mark for no value"),
        ("speed [rpm]", SPEED, -9999.0, "far off all else, as a mark for no value"),
        ("speed [rpm]", SPEED, 0.0, "jumps there and back"),
        ("speed [rpm]", SPEED, None, "while the motion goes on"),
        ("speed [rpm]", CLEAN, 0.0, "jumps there and back"),
        ("position [mm]", POSITION, -999.0, "as a mark for no value"),
        ("position [mm]", POSITION, 0.0, "jumps there and back"),
        ("position [mm]", POSITION, None, "while the motion goes on"),
        ("current [A]", AMPERES, 0.0, "jumps there and back"),
        ("current [A]", AMPERES, -9999.0, "as a mark for no value"),
    ],
)
def test_a_lost_signal_is_named_with_the_line_that_leaves_it_out(
    drafted: Drafted,
    column: str,
    values: np.ndarray,
    reading: float | None,
    said: str,
    length: float,
) -> None:
    begin = 4.0
    tests = drafted(voltage=COMMAND, **{column: lost(values, begin, length, reading)})
    channel = next(iter(next(iter(tests)).channels))
    (found,) = (text for text in findings(tests)[channel] if "dropout" in text)
    assert said in found
    assert f"leave out with axes.drive.channels.{channel}.ignore = [{{ from = 3.9975" in found
    assert f"to = {begin + length - 0.5 / RATE:.6g}, why" in found


def test_the_printed_line_leaves_the_dropout_out(drafted: Drafted, tmp_path) -> None:
    tests = drafted(voltage=COMMAND, **{"speed [rpm]": lost(SPEED, 3.0, 0.4, -999.0)})
    (found,) = findings(tests)["shaft_speed"]
    path = tmp_path / "campaign.toml"
    line = found.partition("leave out with ")[2].removesuffix(" in this run")
    path.write_text(f"{path.read_text('utf-8')}{line}\n", "utf-8")
    mended = examine(Campaign.from_toml(path)["log"])
    assert all(each.findings == () for each in mended)
    assert mended[-1].low > -1.0


@pytest.mark.parametrize(
    ("column", "values", "reading"),
    [
        ("speed [rpm]", SPEED, -999.0),
        ("speed [rpm]", SPEED, -60.0),
        ("position [mm]", POSITION, 0.0),
    ],
)
def test_a_lost_signal_is_no_motion(drafted: Drafted, column, values, reading) -> None:
    """Its mark is not taken for a motion both ways under a command of one sign."""
    tests = drafted(voltage=COMMAND, **{column: lost(values, 3.0, 0.3, reading)})
    assert campaign_findings(tests) == ()


@pytest.mark.parametrize("length", [0.2, 0.3, 0.4])
def test_zeros_while_a_motion_turns_are_named(drafted: Drafted, length: float) -> None:
    phase = np.pi * TIME
    speed = lost(np.round(150.0 * np.sin(phase - 0.8), 3), 3.0, length, 0.0)
    tests = drafted(voltage=6.0 * np.sin(phase), **{"speed [deg/s]": speed})
    assert any("jumps there and back" in said for said in findings(tests)["shaft_speed"])


def test_a_stop_at_a_cylinder_s_end_is_no_dropout(drafted: Drafted) -> None:
    """It stands until the command has turned, and starts as it would."""
    phase = np.pi * TIME
    speed = np.round(150.0 * np.sin(phase), 3)
    speed[(TIME % 2.0 > 0.6) & (TIME % 2.0 < 1.0)] = 0.0
    tests = drafted(voltage=6.0 * np.sin(phase), **{"speed [deg/s]": speed})
    assert not any("dropout" in said for said in findings(tests)["shaft_speed"])


def test_a_command_that_drops_while_the_current_flows_on(drafted: Drafted) -> None:
    tests = drafted(voltage=lost(COMMAND, 4.0, 0.3, 0.0), **{"current [A]": AMPERES})
    assert any("axes.drive.input.ignore" in text for text in findings(tests)["input"])


STAIRS = np.floor(POSITION / 5.0) * 5.0
PULSES = 4.0 * (TIME % 2.0 < 0.4) * (TIME > 1.0)
STOPPED = np.minimum(POSITION, 250.0)
SLOW = np.round(3.0 * np.sin(2.0 * np.pi * 0.125 * TIME), 1)


@pytest.mark.parametrize(
    ("command", "columns"),
    [
        (COMMAND, {"speed [rpm]": SPEED}),
        (COMMAND, {"speed [rpm]": CLEAN}),
        (COMMAND, {"position [mm]": POSITION}),
        (COMMAND, {"position [mm]": STAIRS}),
        (COMMAND, {"position [mm]": STOPPED}),
        (SLOW, {"speed [rpm]": SLOW}),
        (PULSES, {"current [A]": 0.1 * PULSES}),
        (PULSES, {"current [A]": np.round(0.1 * PULSES + 2e-3 * NOISE, 4)}),
        (PULSES, {"speed [rpm]": np.round(6.0 * PULSES, 1)}),
    ],
)
def test_rests_stops_steps_and_pulses_are_no_dropouts(
    drafted: Drafted, command: np.ndarray, columns: dict[str, np.ndarray]
) -> None:
    tests = drafted(voltage=command, **columns)
    said = [text for each in findings(tests).values() for text in each]
    assert not any("dropout" in text or "clipped" in text for text in said)
    assert not any("offset" in text for text in campaign_findings(tests))
