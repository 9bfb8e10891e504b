"""Readings that no machine has, words without a sign, steps of a converter and clipped signals."""

from pathlib import Path

import numpy as np
import pytest
from tests.campaign.test_dropouts import AMPERES, COMMAND, NOISE, SPEED, findings
from tests.drafting.conftest import TIME, Drafted, write
from tests.drafting.conftest import drafted as drafted

from swashplate import Drive
from swashplate.campaign import campaign_findings
from swashplate.drafting import draft_campaign
from swashplate.identification.diagnostics import check_runs


@pytest.mark.parametrize(
    ("column", "values", "said"),
    [
        ("speed [rad/s]", 60.0 * SPEED, "the fastest hydraulic motors turn at 11,000 rpm"),
        ("speed [m/s]", SPEED, "the fastest servo cylinders reach 15 m/s"),
        ("current [A]", 1000.0 * AMPERES, "proportional solenoids take 0.6 to 4 A"),
        ("position [m]", 10.0 * SPEED, "draw-wire sensors reach 60 m"),
        ("swash angle [rad]", 0.1 * SPEED, "bent-axis units, the steepest, reach 45 deg"),
    ],
)
def test_no_machine_has_such_readings(
    drafted: Drafted, column: str, values: np.ndarray, said: str
) -> None:
    tests = drafted(voltage=COMMAND, **{column: values})
    (found,) = [text for text in [*findings(tests).values()][1] if "reaches" in text]
    assert said in found
    assert found.endswith("check unit, scale and offset")


@pytest.mark.parametrize(("bits", "scale"), [(16, 1.0), (16, 0.1), (32, 1.0)])
def test_words_read_without_their_sign_are_named_so(
    drafted: Drafted, bits: int, scale: float
) -> None:
    """A negative speed in the words of a controller, with noise about zero at rest."""
    words = np.round(-7.0 * SPEED + NOISE)
    words[words < 0.0] += 2.0**bits
    tests = drafted(voltage=-COMMAND, **{"speed [rpm]": [f"{scale * word:.12g}" for word in words]})
    (found,) = findings(tests)["shaft_speed"]
    assert f"values above {2 ** (bits - 1) - 1} are negative words of {bits} bits" in found
    assert f"subtract {2**bits}" in found


@pytest.mark.parametrize(("bits", "largest"), [(16, 22000.0), (32, 15000.0)])
def test_large_words_without_their_sign_and_few_of_their_steps(drafted, bits, largest) -> None:
    """A sine that reaches into the middle of the word, in which single steps are rare."""
    phase = np.pi * TIME
    words = np.round(largest * np.sin(phase - 0.8))
    words[words < 0.0] += 2.0**bits
    tests = drafted(voltage=6.0 * np.sin(phase), **{"speed [rpm]": [f"{w:.12g}" for w in words]})
    assert any(f"negative words of {bits} bits" in said for said in findings(tests)["shaft_speed"])
    (refused, *_) = check_runs([*tests], Drive.preset("neutral").parameters)
    assert refused.severity == "refuse"
    assert "negative words" in refused.sentence


def test_words_of_a_command_without_their_sign(drafted: Drafted) -> None:
    words = np.round(1000.0 * COMMAND * np.sin(TIME))
    words[words < 0.0] += 65536.0
    tests = drafted({"log.csv": {"t [s]": TIME, "u [mV]": words, "n [rpm]": SPEED}})
    (said,) = findings(tests)["input"]
    assert "negative words of 16 bits" in said


@pytest.mark.parametrize("largest", [20000.0, 50000.0])
def test_large_steps_in_whole_numbers_are_no_words(drafted: Drafted, largest: float) -> None:
    speed = np.where(COMMAND > 0.0, largest, 0.0)
    tests = drafted(voltage=COMMAND, **{"speed [deg/s]": speed})
    assert not any("words" in said for said in findings(tests)["shaft_speed"])


def test_a_still_sensor_that_toggles_has_steps_and_no_spikes(drafted: Drafted) -> None:
    toggling = 50.0 + 0.25 * (np.random.default_rng(5).random(TIME.size) < 0.02)
    tests = drafted(voltage=0.075 * COMMAND, **{"position [mm]": toggling})
    (found,) = findings(tests)["position"]
    assert found.startswith("reads in steps of 0.25 mm, 100 % of its range")
    assert campaign_findings(tests) == ()


def test_a_command_without_its_sign_needs_no_offset(drafted: Drafted) -> None:
    one_way = 4.0 * (TIME > 1.0) * (TIME < 3.0) + 4.0 * (TIME > 4.0) * (TIME < 6.0)
    speed = np.where(TIME < 3.5, 20.0, -20.0) * (one_way > 0.0)
    (said,) = campaign_findings(drafted(voltage=one_way, **{"speed [rpm]": speed}))
    assert "logged without its sign" in said
    assert "offset" not in said


@pytest.mark.parametrize("shape", [np.sin, lambda phase: np.arcsin(np.sin(phase))])
def test_turning_points_of_a_slow_log_are_no_spikes(drafted: Drafted, shape) -> None:
    """A sine, and a triangle, of 0.5 Hz at 20 Hz, as a PLC logs them."""
    keep = slice(None, None, 10)
    driven = 3.0 * shape(np.pi * TIME) * (TIME < 7.0)
    speed = np.round(20.0 * shape(np.pi * (TIME - 0.1)) * (TIME > 0.1) + 0.05 * NOISE, 2)
    tests = drafted(keep=keep, voltage=driven, **{"speed [rpm]": speed})
    assert all(not any("spike" in text for text in each) for each in findings(tests).values())


def test_a_spike_of_a_slow_log_is_still_one(drafted: Drafted) -> None:
    speed = np.round(20.0 * np.sin(np.pi * TIME), 2)
    speed[400] = 90.0
    tests = drafted(
        keep=slice(None, None, 10), voltage=3.0 * np.sin(np.pi * TIME), **{"speed [rpm]": speed}
    )
    assert "1 spike" in findings(tests)["shaft_speed"][0]


STICK = np.round(4.0 * np.sin(0.5 * np.pi * TIME) + 0.004 * NOISE, 3)


@pytest.mark.parametrize(
    ("columns", "signal", "level"),
    [
        ({"voltage": COMMAND, "current [A]": np.minimum(AMPERES, 0.3)}, "rectified_current", "0.3"),
        ({"voltage": np.minimum(STICK, 2.2), "speed [rpm]": SPEED}, "input", "2.2 V"),
        ({"voltage": np.maximum(STICK, -2.2), "speed [rpm]": SPEED}, "input", "-2.2 V"),
    ],
)
def test_a_clipped_signal_is_named(
    drafted: Drafted, columns: dict[str, np.ndarray], signal: str, level: str
) -> None:
    said = findings(drafted(**columns))[signal]
    assert any(text.startswith(f"clipped at {level}") for text in said)


@pytest.mark.parametrize(
    "columns",
    [
        {"voltage": COMMAND, "current [A]": AMPERES},
        {"voltage": COMMAND, "current [A]": 0.125 * COMMAND},
        {"voltage": COMMAND, "current [A]": np.maximum(AMPERES, 0.0)},
        {"voltage": STICK, "speed [rpm]": np.round(SPEED)},
        {"voltage": np.clip(STICK, -3.0, 3.0).round(1), "speed [rpm]": SPEED},
    ],
)
def test_sound_signals_are_not_clipped(drafted: Drafted, columns: dict[str, np.ndarray]) -> None:
    said = [text for each in findings(drafted(**columns)).values() for text in each]
    assert not any("clipped" in text for text in said)


# --- two solenoids --------------------------------------------------------------------------------

BOTH_WAYS = 4.0 * ((TIME > 1.0) & (TIME < 3.0)) - 4.0 * ((TIME > 4.0) & (TIME < 6.0))
UP, DOWN = np.maximum(BOTH_WAYS, 0.0), np.maximum(-BOTH_WAYS, 0.0)


@pytest.mark.parametrize("rest", [0.0, 5.0])
@pytest.mark.parametrize("bias", [0.0, 0.1])
@pytest.mark.parametrize(
    ("up", "down"), [("I_Magnet_A", "I_Magnet_B"), ("Strom_Y2", "Strom_Y1"), ("I_B", "I_A")]
)
def test_currents_that_take_turns_are_both_solenoids(
    drafted: Drafted, up: str, down: str, rest: float, bias: float
) -> None:
    noise = 1e-3 * NOISE
    tests = drafted(
        voltage=rest + BOTH_WAYS,
        **{f"{down} [A]": bias + 0.1 * DOWN + noise, f"{up} [A]": bias + 0.1 * UP - noise},
        **{"speed [rpm]": 5.0 * BOTH_WAYS},
    )
    channels = next(iter(tests)).channels
    assert channels["current_plus"].source.column == f"{up} [A]"
    assert channels["current_minus"].source.column == f"{down} [A]"


def test_two_ammeters_of_one_current_are_not_two_solenoids(tmp_path: Path) -> None:
    currents = {"I_1st [A]": 0.1 * UP + 0.1 * DOWN, "I_2nd [A]": 0.1 * UP + 0.1 * DOWN}
    log = write(tmp_path, "log.csv", {"time": TIME, "voltage": BOTH_WAYS} | currents)
    text = draft_campaign([log], tmp_path)
    assert "current_plus" not in text
    assert text.count('kind = "rectified_current"') == 2
