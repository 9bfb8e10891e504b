"""Logs as people have them: each case was met by someone who tried the package as a new user."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat
from tests.drafting.conftest import BOTH, RATE, TIME, Columns, Drafted, read_draft, write
from tests.logs.writing import write_log

from swashplate import Campaign, Drive, FileError, InputError, ParameterError
from swashplate.campaign import (
    campaign_findings,
    examine,
    spiked,
    unsigned_currents,
)
from swashplate.drafting import draft_campaign, guess_drive
from swashplate.identification.diagnostics import check_runs, refuse_unsound, spike_findings

SINE = 5.0 * np.sin(2.0 * np.pi * 0.4 * TIME)
PER_TURN = {"counts_per_turn": 1000.0}


def lagged(command: np.ndarray, lag: float = 0.1) -> np.ndarray:
    """A first-order lag of a command, exact for one that is held."""
    share, state, out = 1.0 - np.exp(-1.0 / RATE / lag), 0.0, np.empty_like(command)
    for k, each in enumerate(command):
        out[k] = state
        state += share * (each - state)
    return out


def text_of(tests: Campaign) -> str:
    return tests.path.read_text("utf-8")


def edit(tests: Campaign, old: str, new: str) -> Campaign:
    assert old in text_of(tests)
    tests.path.write_text(text_of(tests).replace(old, new), "utf-8")
    return Campaign.from_toml(tests.path)


def findings(tests: Campaign) -> list[str]:
    found = [said for each in tests for quality in examine(each) for said in quality.findings]
    return [*campaign_findings(tests), *found]


# --- a clamp that lost its sign -------------------------------------------------------------------


def clamp(command: np.ndarray, seed: int, *, rectified: bool) -> np.ndarray:
    """0.78 A at 4 V and noise of 20 mA, which crosses zero. [A]"""
    current = 0.195 * lagged(command)
    noise = np.random.default_rng(seed).normal(0.0, 0.007, current.size)
    return (np.abs(current) if rectified else current) + noise


def clamped(seed: int, *, rectified: bool) -> dict[str, Columns]:
    """Three logs of a clamp."""
    commands = {"step": BOTH, "down": -np.abs(BOTH), "sine": SINE}
    return {
        f"{name}.csv": {"time": TIME, "voltage": u, "Strom": clamp(u, seed, rectified=rectified)}
        for name, u in commands.items()
    }


@pytest.mark.parametrize("seed", [0, 6, 9])
@pytest.mark.parametrize("rectified", [True, False])
def test_a_noisy_clamp_keeps_the_kind_it_has(drafted: Drafted, seed: int, rectified: bool) -> None:
    tests = drafted(clamped(seed, rectified=rectified))
    kind = "rectified_current" if rectified else "signed_current"
    assert [channel.kind for each in tests for channel in each.channels.values()] == [kind] * 3
    assert not any("current" in said or "sign" in said for said in findings(tests))


def test_a_rectified_clamp_called_signed_is_told_in_one_sentence(drafted: Drafted) -> None:
    tests = drafted(clamped(3, rectified=True))
    tests = edit(tests, '"rectified_current"', '"signed_current"')
    (said,) = unsigned_currents(tests).values()
    assert 'write kind = "rectified_current" in [axes.drive.channels.rectified_current]' in said
    assert said in campaign_findings(tests)
    unsigned = {name for _, name in unsigned_currents(tests)}
    assert not [f for e in tests for q in examine(e, unsigned) for f in q.findings]


def test_two_clamps_are_plus_and_minus(drafted: Drafted) -> None:
    plus, minus = np.maximum(BOTH, 0.0), np.maximum(-BOTH, 0.0)
    assert list(drafted(I_A=plus, I_B=minus)["log"].channels) == ["current_plus", "current_minus"]
    assert list(drafted(I_A=plus)["log"].channels) == ["rectified_current"]


# --- units of a speed -----------------------------------------------------------------------------


MINUTE, SECOND = 2.0 * np.pi / 60.0, 2.0 * np.pi
"""A turn a minute and a turn a second. [rad/s]"""


@pytest.mark.parametrize(
    ("header", "factor"),
    [
        *((f"n_Trommel [{unit}]", MINUTE) for unit in ("1/min", "min^-1", "min⁻¹", "min-1", "Upm")),
        *((f"n [{unit}]", MINUTE) for unit in ("RPM", "tr/min", "U/min", "r/min", "rev/min")),
        *((f"speed [{unit}]", SECOND) for unit in ("Hz", "1/s", "s^-1", "U/s")),
        ("rpm", MINUTE),
    ],
)
def test_a_nameplates_turns(drafted: Drafted, header: str, factor: float) -> None:
    tests = drafted(**{header: 35.0 + BOTH})
    channel = tests["log"]["shaft_speed"]
    assert channel.unit == "rad/s"
    assert channel.values == pytest.approx(factor * (35.0 + BOTH))
    assert ('unit = "rpm"' in text_of(tests)) == (header == "rpm")


# --- spikes, and what is ignored ------------------------------------------------------------------


def mended(tests: Campaign, start: str) -> Campaign:
    """The campaign with the line that its only finding on a spike proposes."""
    (said,) = [each for each in findings(tests) if "spike" in each]
    assert said.startswith(f"{start}: leave out with ")
    line = said.removeprefix(f"{start}: leave out with ").removesuffix(" in this run")
    tests.path.write_text(text_of(tests) + line + "\n", "utf-8")
    return Campaign.from_toml(tests.path)


def test_a_spike_is_found_with_the_line_that_leaves_it_out(drafted: Drafted) -> None:
    current = clamp(BOTH, 1, rectified=True)
    current[700:702] = 9.9
    tests = mended(drafted(Strom=current), "1 spike, up to 9.9 A")
    assert not [each for each in findings(tests) if "spike" in each]
    assert np.flatnonzero(~tests["log"]["rectified_current"].used).tolist() == [700, 701]
    assert examine(tests["log"])[1].high < 1.0


def test_a_spike_of_the_command_is_found_and_left_out(drafted: Drafted) -> None:
    command = SINE + np.random.default_rng(4).normal(0.0, 0.002, TIME.size)
    command[900] = -9.0
    tests = mended(drafted(voltage=command, speed=lagged(SINE)), "1 spike, up to -9 V")
    assert findings(tests) == []
    beside = 0.5 * (command[899] + command[901])
    assert tests["log"].input.at(TIME[900:901]) == pytest.approx([beside])


COUNTED = np.floor(200.0 * np.cumsum(lagged(BOTH)) / RATE)
"""Counts of an encoder of 200 to a radian, of a speed of 1 rad/s for a volt."""


def test_a_glitch_of_a_counter_is_found_with_the_line_that_leaves_it_out(drafted: Drafted) -> None:
    glitch = 5000.0 * ((TIME > 3.498) & (TIME < 3.507))
    tests = drafted(draft=PER_TURN, counts=COUNTED + glitch)
    ((sentence, gross),) = spiked(tests).values()
    assert "log: 'encoder_counts' has 1 spike, up to +5000 counts" in sentence
    assert gross
    with pytest.raises(InputError, match=r"from = 3\.4975, to = 3\.5075"):
        guess_drive(tests)
    tests = mended(tests, "1 spike, up to +5000 counts")
    assert findings(tests) == []
    assert spiked(tests) == {}


def test_counts_lost_for_good_are_found_with_the_lines_that_cut_the_run(drafted: Drafted) -> None:
    tests = drafted(draft=PER_TURN, counts=COUNTED - 300.0 * (TIME > 4.498))
    (finding,) = findings(tests)
    ((sentence, gross),) = spiked(tests).values()
    assert sentence == f"log: 'encoder_counts' {finding}"
    assert not gross
    assert "-300 counts at 4.4975 s" in finding
    doubts = refuse_unsound(spike_findings(tests.experiments, "linear"))
    assert [each.startswith(sentence) for each in doubts] == [True]
    # as the sentence says
    first, second = "span = { to = 4.4975 }", "span = { from = 4.4975 }"
    more = ['name = "log from 4.4975 s"', second, 'start = "estimated"']
    assert all(each in finding for each in (first, *more))
    run = '[[runs]]\nfile = "log.csv"\nrole = "fit"\n'
    text = text_of(tests) + "\n".join([first, "", run, *more, ""])
    tests.path.write_text(text, "utf-8")
    tests = Campaign.from_toml(tests.path)
    assert [each.name for each in tests] == ["log", "log from 4.4975 s"]
    assert findings(tests) == []


def test_a_tap_of_the_command_is_no_spike_but_a_drop_out_while_it_stands_still_is(drafted) -> None:
    command = 5.0 * ((TIME > 1.0) & (TIME < 1.019)) - 3.0 * (TIME > 4.0)
    assert findings(drafted(voltage=command, speed=lagged(command))) == []
    speed = lagged(BOTH) + np.random.default_rng(1).normal(0.0, 0.01, TIME.size)
    speed[500] = 0.0
    (said,) = findings(drafted(speed=speed))
    assert said.startswith("1 spike, up to 0 rad/s")


@pytest.mark.parametrize("command", [BOTH, SINE, np.abs(BOTH)])
@pytest.mark.parametrize("lag", [0.02, 0.1])
def test_motions_and_zero_crossings_are_no_spikes(drafted, command, lag) -> None:
    rng = np.random.default_rng(2)
    for size in (0.0, 0.01):
        speed = lagged(command, lag) + rng.normal(0.0, size, TIME.size)
        current = np.abs(lagged(command, lag)) + rng.normal(0.0, size, TIME.size)
        tests = drafted(voltage=command, speed=speed, current=current)
        assert not [said for said in findings(tests) if "spike" in said]


@pytest.mark.parametrize(
    ("columns", "said", "old", "new"),
    [
        (
            {"counts": np.floor(200.0 * np.cumsum(lagged(BOTH)) / RATE)
             + 5000.0 * ((TIME > 3.498) & (TIME < 3.507))},
            "ignore = [{ from = 3.4975, to = 3.5075",
            "gear_ratio = 1.0",
            "ignore = [{ from = 3.4975, to = 3.5075 }]\ngear_ratio = 1.0",
        ),
        (
            {"speed": -lagged(BOTH), "pos": TIME},
            "moves against",
            '"shaft_speed"    #',
            '"shaft_speed"\nignore = [{ from = 0.0 }]    #',
        ),
    ],
    ids=["glitches of a counter", "a whole channel"],
)  # fmt: skip
def test_what_is_ignored_has_no_findings(drafted, columns, said, old, new) -> None:
    tests = drafted(draft=PER_TURN, **columns)
    assert any(said in each for each in findings(tests))
    assert findings(edit(tests, old, new)) == []


# --- a gap in which a counter may have gone round -------------------------------------------------


@pytest.mark.parametrize("again", [7.3, 5.5])
def test_a_run_is_split_where_its_counter_may_have_gone_round(drafted, again) -> None:
    """17,000 counts a second and 16 bits: half a round takes 1.9 s, the gap 2.3 s or 0.5 s."""
    command = 4.0 * (TIME > 0.1)
    speed = 17_000.0 * lagged(command) / 4.0
    counts, kept = np.floor(np.cumsum(speed) / RATE) % 65536, (TIME < 5.0) | (again < TIME)
    tests = drafted(voltage=command, counts=counts, keep=kept, draft={"counts_per_turn": 4096.0})
    first, *others = tests
    if again == 5.5:  # it leaves no doubt
        moved = first["encoder_counts"].counts
        assert (first.notes, others) == ((), [])
        assert moved[-1] - moved[0] == pytest.approx(speed.sum() / RATE, rel=1e-3)
        return
    (second,) = others
    assert (first.name, second.name) == ("log", "log from 7.305 s")
    assert (first.start, second.start) == ("rest", "estimated")
    assert first.input.time[-1] < 5.0
    assert "split at 7.305 s" in first.notes[0]
    assert "the counter 'encoder_counts', which wraps at 65536" in first.notes[0]
    # each part turns as fast as the shaft did
    for part, true in ((first, speed[TIME < 5.0]), (second, speed[TIME > 7.3])):
        turns = np.diff(part["encoder_counts"].values) / (2.0 * np.pi) * 4096.0 * RATE
        assert turns[-50:].mean() == pytest.approx(true[-50:].mean(), rel=2e-3)


# --- an angle that wraps --------------------------------------------------------------------

SPEED = 4.0 * lagged(BOTH)
"""Of a shaft that turns by about seven turns to and fro. [rad/s]"""
TURNED = 350.0 + np.degrees(np.cumsum(SPEED)) / RATE


@pytest.mark.parametrize(("noise", "begin"), [(0.0, 0.0), (0.3, 0.0), (0.3, -180.0)])
def test_an_angle_that_begins_anew(drafted: Drafted, noise: float, begin: float) -> None:
    true = TURNED + np.random.default_rng(0).normal(0.0, noise, TIME.size)
    tests = drafted(**{"angle [deg]": (true - begin) % 360.0 + begin})
    assert "rolls_over_at = 360    # guessed" in text_of(tests)
    assert findings(tests) == []
    moved = np.degrees(tests["log"]["position"].values)
    assert moved - moved[0] == pytest.approx(true - true[0], abs=1e-6)
    tests = edit(tests, "rolls_over_at = 360", "#")
    (said,) = findings(tests)
    assert "jumps by about one turn" in said
    assert said.endswith("write rolls_over_at = 360 in [axes.drive.channels.position]")
    with pytest.raises(InputError, match="rolls_over_at = 360 in"):
        refuse_unsound(check_runs(tests.experiments, Drive.preset("hoist").parameters))


def test_an_angle_without_a_unit_is_in_degrees_and_a_motion_of_half_a_turn_in_none(drafted) -> None:
    assert 'unit = "deg"    # guessed' in text_of(drafted(angle=TURNED % 360.0))
    text = text_of(drafted(angle=np.radians(0.1 * TURNED)))
    assert 'unit = "rad"    # guessed' in text
    assert "rolls_over_at" not in text


def test_a_sample_read_while_the_angle_went_back_turns_no_shaft(drafted: Drafted) -> None:
    angle = TURNED % 360.0
    (row, *_) = np.flatnonzero(np.diff(angle) < -180.0)
    angle[row] = 180.0
    tests = drafted(**{"angle [deg]": angle})
    moved = np.degrees(tests["log"]["position"].values)
    kept = np.arange(TIME.size) != row
    assert (moved - moved[0])[kept] == pytest.approx((TURNED - TURNED[0])[kept], abs=1e-6)
    assert findings(mended(tests, f"1 spike, up to {np.radians(moved[row]):.4g} rad")) == []


def test_a_run_is_split_where_an_angle_may_have_gone_round(drafted: Drafted) -> None:
    kept = (TIME < 2.0) | (TIME > 2.9)
    first, second = drafted(keep=kept, **{"angle [deg]": TURNED % 360.0})
    assert "the position 'position', which wraps at 360, may have" in first.notes[0]
    assert (first.start, second.start) == ("rest", "estimated")


# --- runs that begin in motion --------------------------------------------------------------------


@pytest.mark.parametrize("what", ["speed", "counts"])
@pytest.mark.parametrize("begin", [0.0, 1.0, 2.0])
def test_a_run_that_begins_in_motion(drafted: Drafted, what: str, begin: float) -> None:
    """Cut out at rest, at the step, and a second after it."""
    values = {
        "speed": lagged(BOTH) + np.random.default_rng(5).normal(0.0, 0.05, TIME.size),
        "counts": np.floor(200.0 * np.cumsum(lagged(BOTH)) / RATE),
    }
    tests = drafted(keep=begin < TIME, draft=PER_TURN, **{what: values[what]})
    assert tests["log"].start == ("estimated" if begin == 2.0 else "rest")
    assert findings(tests) == []
    if begin == 2.0:
        (said,) = findings(edit(tests, "axes.drive.start", "#"))
        assert 'write axes.drive.start = "estimated" in this run' in said


# --- files whose groups have their own time -------------------------------------------------------


@pytest.mark.parametrize("suffix", [".h5", ".mf4", ".tdms"])
def test_each_group_has_its_own_clock(tmp_path: Path, suffix: str) -> None:
    log, late, speed = tmp_path / f"log{suffix}", TIME[::2] + 1e-3, lagged(BOTH)[::2]
    groups = {"cmd": {"time": TIME, "voltage": BOTH}, "meas": {"time": late, "speed": speed}}
    write_log(log, groups, units={"voltage": "V", "speed": "rad/s"})
    tests = read_draft(tmp_path, [log], drive="hoist")
    run = tests["log"]
    assert run.input.time == pytest.approx(TIME)
    assert run["shaft_speed"].time == pytest.approx(late)
    assert run["shaft_speed"].values == pytest.approx(speed)
    assert findings(tests) == []
    if suffix == ".h5":  # as the handbook names it
        tests = edit(tests, '"/meas/speed"', '"meas/speed"')
        assert tests["log"]["shaft_speed"].values == pytest.approx(speed)


def test_groups_of_one_length_have_their_clocks(tmp_path: Path) -> None:
    groups = {"cmd": {"time": TIME, "voltage": BOTH}, "meas": {"time": TIME + 0.5, "speed": BOTH}}
    write_log(tmp_path / "log.h5", groups, units={"voltage": "V", "speed": "rad/s"})
    run = read_draft(tmp_path, [tmp_path / "log.h5"])["log"]
    assert (run.input.time[0], run["shaft_speed"].time[0]) == (0.0, 0.5)


# --- runs that lack a channel ---------------------------------------------------------------------


def test_a_run_without_a_channel(drafted: Drafted) -> None:
    whole = {"time": TIME, "voltage": BOTH, "speed": lagged(BOTH), "Strom": np.abs(lagged(BOTH))}
    logs = {
        "all.csv": whole,
        "no_clamp.csv": {name: each for name, each in whole.items() if name != "Strom"},
        "empty.csv": {**whole, "Strom": [""] * TIME.size},
        "no_input.csv": {name: each for name, each in whole.items() if name != "voltage"},
    }
    tests = drafted(logs, draft={"drive": "hoist"})
    assert "axes.hoist.channels.rectified_current = false" in text_of(tests)
    assert list(tests["all"].channels) == ["shaft_speed", "rectified_current"]
    assert list(tests["no_clamp"].channels) == ["shaft_speed"]
    assert list(tests["empty"].channels) == ["shaft_speed"]
    assert "'rectified_current' has no sample here" in tests["empty"].notes[0]
    assert tests.ignored == ("no_input",)


def test_an_axis_whose_only_channel_is_empty_in_a_run(drafted: Drafted) -> None:
    columns = {"time": TIME}
    for axis in ("Boom", "Stick"):
        columns |= {f"{axis} voltage": BOTH, f"{axis} speed": lagged(BOTH)}
    tests = drafted({"a.csv": columns, "b.csv": {**columns, "Stick speed": [""] * TIME.size}})
    assert [each.name for each in tests] == ["a boom", "a stick", "b boom"]
    only = 'only = ["boom"]'
    assert only in text_of(tests)
    with pytest.raises(InputError, match=r"axis 'stick' .* 0 samples.* only = \["):
        edit(tests, only, "")
    said = r"'shaft_speed' .* axis 'stick'.* only = \[\"boom"
    with pytest.raises(FileError, match=said):
        edit(tests, 'missing = "drop"', "# missing")


def test_what_cannot_be_read_is_drafted_as_ignored_and_not_opened(drafted: Drafted) -> None:
    good = {"time": TIME, "voltage": BOTH, "speed": BOTH}
    tests = drafted({"good.csv": good, "back.csv": {**good, "time": TIME - 0.3 * (TIME > 0.5)}})
    assert 'role = "ignore"    # left out: ' in text_of(tests)
    (tests.path.parent / "back.csv").unlink()
    tests = Campaign.from_toml(tests.path)
    assert (len(tests), tests.ignored) == (1, ("back",))
    with pytest.raises(InputError, match="run 'back' .* role 'ignore'"):
        tests["back"]


# --- headers --------------------------------------------------------------------------------------


EPOCH = [f"{1_710_284_397_000 + round(1e3 * each)}" for each in TIME]
"""Milliseconds since 1970."""


@pytest.mark.parametrize(
    ("columns", "speed"),
    [
        ({"time_ms": 1e3 * TIME, "voltage_V": BOTH, "speed_rpm": BOTH}, MINUTE * BOTH),
        ({"time_ms": EPOCH, "Voltage [V]": BOTH, "Speed [rpm]": BOTH}, MINUTE * BOTH),
        # percent of a joystick
        ({"t": TIME, "Stellgröße [%]": 10.0 * BOTH, "n": BOTH}, BOTH),
        ({"t": TIME, "Kanal 1 [%]": 10.0 * BOTH, "n": BOTH}, BOTH),
    ],
)
def test_headers(drafted: Drafted, columns: Columns, speed: np.ndarray) -> None:
    given = {"Kanal 1 [%]": "voltage"} if "Kanal 1 [%]" in columns else {}
    run = drafted({"t1.csv": columns}, draft={"columns": given})["t1"]
    assert run.input.time == pytest.approx(TIME, abs=1e-9)
    assert run.input.kind == "voltage"
    assert run.input.values == pytest.approx(BOTH)
    assert list(run.channels) == ["shaft_speed"]
    assert run["shaft_speed"].values == pytest.approx(speed)


@pytest.mark.parametrize(
    ("name", "kind", "unit"),
    [
        ("Kanal_mV", "voltage", "mV"),
        ("Geber_deg", "position", "deg"),
        ("Druck_bar", "stroker_pressure", "bar"),
        ("Kanal_links", "other", "1"),
    ],
)
def test_the_unit_at_the_end_of_a_name_that_is_given(tmp_path, name, kind, unit) -> None:
    log = write(tmp_path, "log.csv", {"time": TIME, "n": BOTH, name: 0.001 * BOTH})
    text = draft_campaign([log], tmp_path, columns={name: kind})
    axis = tomllib.loads(text)["axes"]["drive"]
    entries = [axis["input"], *axis["channels"].values()]
    (found,) = [each for each in entries if each["column"] == name]
    assert (found["kind"], found["unit"]) == (kind, unit)


def test_a_log_without_a_clock_leaves_its_rate_open(drafted: Drafted, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"line 12, \[axes.drive\]: time .* FIXME"):
        drafted({"log.csv": {"voltage": BOTH, "speed": lagged(BOTH)}})
    path = tmp_path / "campaign.toml"
    text = path.read_text("utf-8")
    assert "# time = { rate = 512 }    # FIXME" in text
    assert "Hz" not in text
    text = text.replace(line_of(text, "# time = "), "time = { rate = 200 }")
    path.write_text(text, "utf-8")
    assert Campaign.from_toml(path)["log"].input.time == pytest.approx(TIME)


def test_maneuvers_in_a_comment_are_in_volts(drafted: Drafted) -> None:
    command = np.where((TIME > 1.0) & (TIME < 5.0), -3000.0, 0.0)
    columns = {"time": TIME, "stick [mV]": command, "speed": BOTH}
    assert "step -3 V" in text_of(drafted({"log.csv": columns}))


def test_the_run_held_back_leaves_its_kind_in_the_fit(drafted: Drafted) -> None:
    """The last by name is the only step upwards."""
    steps = {"a": -8.0 * (TIME > 1.0), "b": -6.0 * (TIME > 1.0), "c": -4.0 * (TIME > 1.0)}
    steps["d"] = 8.0 * (TIME > 1.0)
    logs = {f"{key}.csv": {"time": TIME, "voltage": u, "speed": u} for key, u in steps.items()}
    roles = {each.name: each.role for each in drafted(logs)}
    assert roles == {"a": "fit", "b": "fit", "c": "validate", "d": "fit"}


def test_an_axis_has_the_packaged_drive_of_its_name(drafted: Drafted) -> None:
    names = [f"{axis} {what}" for axis in ("hoist", "slew", "aux") for what in ("voltage", "speed")]
    log = {"time": TIME, **dict.fromkeys(names, BOTH)}
    tests = drafted({"log.csv": log}, draft={"drive": "hoist"})
    drives = {name: axis.drive for name, axis in tests.axes.items()}
    assert drives == {"hoist": "hoist", "slew": "slew", "aux": "hoist"}


# --- time stamps ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "stamps",
    [
        ("2024-03-12T23:59:57.000+01:00", "2024-03-13T00:00:02.500+01:00"),
        ("2024-03-12T23:59:57.000Z", "2024-03-13T01:00:02.500+01:00"),
        ("2024-03-12 22:29:57-0130", "2024-03-13 00:00:02.5+0000"),
        ("11:59:57 AM", "12:00:02.5 PM"),
        ("12:59:57.0 pm", "1:00:02.5 pm"),
        ("3/12/2024 11:59:57 PM", "3/13/2024 12:00:02.5 AM"),
        ("23:59:57,000", "00:00:02,500"),
        ("11:59:57 PM", "12:00:02.5 AM"),
    ],
)
def test_stamps_of_a_calendar_and_of_a_clock(drafted: Drafted, stamps: tuple[str, str]) -> None:
    text = "Zeit;voltage;speed\n{};0;0\n{};1;1\n".format(*stamps)
    assert drafted({"log.csv": text})["log"].input.time == pytest.approx([0.0, 5.5])


def test_dashes_are_missing_numbers_and_commas_between_commas_are_named(drafted: Drafted) -> None:
    cells = [f"{each:g}" for each in BOTH]
    cells[5:8] = ["---", "--", "---"]
    tests = drafted(speed=cells)
    assert 'missing = "drop"    # guessed: 3 cells are empty' in text_of(tests)
    assert tests["log"]["shaft_speed"].dropped == 3
    with pytest.raises(FileError, match="decimal commas"):
        drafted({"log.csv": "time,voltage,speed\n0,0,1,0,2,0\n0,1,1,5,2,5\n"})


# --- columns without a unit, and a PLC's words ----------------------------------------------------


def drafted_entries(folder: Path, logged: Columns, **draft: object) -> tuple[str, dict, dict]:
    """Text of a draft, and its input and channels by their columns."""
    text = draft_campaign([write(folder, "log.csv", logged)], folder, **draft)
    (axis,) = tomllib.loads(text)["axes"].values()
    signals = (axis["input"], *axis["channels"].values())
    return text, axis, {each["column"]: each for each in signals}


def line_of(text: str, start: str) -> str:
    """The only line that begins so."""
    (line,) = [line for line in text.splitlines() if line.startswith(start)]
    return line


def test_a_declared_kind_restricts_the_units(tmp_path: Path) -> None:
    """A rod's stroke is in mm, a pressure is not, whatever the column is called."""
    columns = {"time": TIME, "u": BOTH, "PIW_STROKE": 3.7 + 0.1 * BOTH}
    text, _, entries = drafted_entries(
        tmp_path, columns, columns={"PIW_STROKE": "stroker_pressure"}
    )
    assert entries["PIW_STROKE"]["kind"] == "stroker_pressure"
    assert "unit" not in entries["PIW_STROKE"]
    assert "guessed" not in line_of(text, 'kind = "stroker_pressure"')
    assert "FIXME" in line_of(text, '# unit = "Pa"')
    assert 'role = "fit"' in text
    _, _, entries = drafted_entries(tmp_path, columns, columns={"PIW_STROKE": "position"})
    assert entries["PIW_STROKE"]["unit"] == "mm"


def test_a_unit_of_another_quantity_is_open_in_a_header_and_refused_if_given(tmp_path) -> None:
    columns = {"time": TIME, "u": BOTH, "Kanal [mm]": 0.1 * BOTH}
    given = {"Kanal [mm]": "stroker_pressure"}
    text, _, entries = drafted_entries(tmp_path, columns, columns=given)
    assert "unit" not in entries["Kanal [mm]"]
    line = line_of(text, '# unit = "Pa"')
    assert "FIXME" in line
    assert "'mm'" in line
    with pytest.raises(InputError, match=r"'Kanal \[mm\]' .*'mm'.* Pa"):
        drafted_entries(tmp_path, columns, columns=given, units={"Kanal [mm]": "mm"})
    _, _, entries = drafted_entries(tmp_path, columns, columns=given, units={"Kanal [mm]": "bar"})
    assert entries["Kanal [mm]"]["unit"] == "bar"


@pytest.mark.parametrize(
    ("ticks", "unit"),
    [
        (1.0 + 20.0 * np.arange(TIME.size), "ms"),
        (5000.0 * np.arange(TIME.size), "us"),
        (5e6 * np.arange(TIME.size), "ns"),
        (TIME, "s"),
    ],
)
def test_stamps_without_a_unit(tmp_path: Path, ticks: np.ndarray, unit: str) -> None:
    """1, 21, 41 are no seconds: no machine is logged every 20 s."""
    text, axis, _ = drafted_entries(tmp_path, {"TIME": ticks, "u [V]": BOTH, "n [rpm]": BOTH})
    assert axis["time"] == {"column": "TIME", "unit": unit}
    assert "guessed" in line_of(text, "time = ")
    _, axis, _ = drafted_entries(
        tmp_path, {"TIME": ticks, "u [V]": BOTH, "n [rpm]": BOTH}, units={"TIME": "ms"}
    )
    assert axis["time"]["unit"] == "ms"


@pytest.mark.parametrize(
    ("header", "kind", "unit"),
    [
        ("stick mV", "voltage", "mV"),
        ("speed rpm", "shaft_speed", "rpm"),
        ("Drehzahl 1/min", "shaft_speed", "1/min"),
        ("Strom mA", "rectified_current", "mA"),
        ("encoder speed", "shaft_speed", "rad/s"),
    ],
)
def test_a_unit_behind_a_space(tmp_path: Path, header: str, kind: str, unit: str) -> None:
    columns = {"time [s]": TIME, header: 0.5 + np.abs(BOTH)}
    _, _, entries = drafted_entries(tmp_path, columns)
    assert (entries[header]["kind"], entries[header]["unit"]) == (kind, unit)


@pytest.mark.parametrize(
    ("largest", "full"),
    [(22118, 27648), (27648, 27648), (16384, 16384), (32767, 32767), (32768, 32768)],
)
def test_a_plc_s_words_of_a_command_are_volts(tmp_path: Path, largest: int, full: int) -> None:
    words = np.round(0.25 * BOTH * largest)
    columns = {"time [s]": TIME, "JOY_W": words, "n [rpm]": BOTH}
    text, _, entries = drafted_entries(tmp_path, columns)
    joystick = entries["JOY_W"]
    assert (joystick["kind"], joystick["unit"]) == ("voltage", "V")
    assert joystick["scale"] * full == pytest.approx(10.0)
    assert "guessed" in line_of(text, "scale = ")
    assert np.abs(read_draft(tmp_path, [tmp_path / "log.csv"])["log"].input.values).max() <= 10.0


def test_a_plc_s_words_of_a_sensor_need_its_range(tmp_path: Path) -> None:
    words = np.round(5000.0 * np.abs(BOTH))
    columns = {"time [s]": TIME, "u": BOTH, "PIW640 druck": words}
    text, _, _ = drafted_entries(tmp_path, columns, columns={"PIW640 druck": "stroker_pressure"})
    line = line_of(text, "# scale = ")
    assert "FIXME" in line
    assert "27648" in line


def test_whole_numbers_of_a_command_in_thousands_are_millivolts(tmp_path: Path) -> None:
    columns = {"time [s]": TIME, "u": 1000.0 * BOTH, "n [rpm]": BOTH}
    text, _, entries = drafted_entries(tmp_path, columns)
    assert entries["u"]["unit"] == "mV"
    assert "guessed" in line_of(text, 'unit = "mV"')


def test_the_comment_of_a_split_run_says_how_long_it_is(tmp_path: Path) -> None:
    """A counter of 10 bits may have gone round within a second."""
    counts = np.mod(np.floor(800.0 * TIME), 1024.0)
    keep = (TIME < 3.0) | (TIME > 4.0)
    columns = {"time [s]": TIME[keep], "u": BOTH[keep], "Drehgeber": counts[keep]}
    text, _, _ = drafted_entries(tmp_path, columns, counts_per_turn=1000.0)
    assert "7.995 s at 200 Hz in 2 parts" in line_of(text, "file = ")


def test_a_draft_s_title_and_axis(tmp_path: Path) -> None:
    """No machine is called like the start for any of them, so that no exported file is either."""
    columns = {"time [s]": TIME, "u": BOTH, "n [rpm]": BOTH}
    text, _, _ = drafted_entries(tmp_path, columns, drive="neutral")
    assert "guessed" in line_of(text, "title = ")
    assert [*tomllib.loads(text)["axes"]] == ["drive"]
    text, _, _ = drafted_entries(tmp_path, columns, title="Winch 3, J. Weber")
    assert line_of(text, "title = ") == 'title = "Winch 3, J. Weber"'


# --- read as meant, or not at all -----------------------------------------------------------------

DEGREE = np.pi / 180.0


@pytest.mark.parametrize(
    ("headers", "factor"),
    [
        (("Zeit [s]", "Spannung [V]", "Drehzahl [grad/s]"), DEGREE),
        (("Zeit [s]", "Spannung [V]", "Drehzahl [Grad/s]"), DEGREE),
        (("Zeit [s]", "Spannung [V]", "Winkel [Grad]"), DEGREE),
        (("Tid [s]", "Spænding [V]", "Vinkel [GRAD]"), DEGREE),
        (("Zeit", "Spannung [V]", "Winkel_grad"), DEGREE),
        (("time [s]", "voltage [V]", "speed [Grad/s]"), DEGREE),
        (("time [s]", "voltage [V]", "angle [gon]"), np.pi / 200.0),
        (("Temps [s]", "u [V]", "Vitesse [t/min]"), MINUTE),
        (("Temps [s]", "u [V]", "Vitesse [tr.min-1]"), MINUTE),
        (("Zeit [s]", "Spannung [V]", "Drehzahl [U/min]"), MINUTE),
        (("time [Sec]", "Joystick [Volts]", "speed [Deg/Sec]"), DEGREE),
        (("TIME [S]", "VOLTAGE [VDC]", "SPEED [Â°/s]"), DEGREE),
    ],
)
def test_units_of_other_languages(drafted: Drafted, headers, factor) -> None:
    columns = dict(zip(headers, (TIME, BOTH, 10.0 * lagged(BOTH)), strict=True))
    run = drafted({"log.csv": columns})["log"]
    assert run.input.time == pytest.approx(TIME, abs=1e-9)
    assert run.input.values == pytest.approx(BOTH)
    (channel,) = run.channels.values()
    assert channel.values == pytest.approx(factor * 10.0 * lagged(BOTH), abs=1e-7)


@pytest.mark.parametrize(
    ("header", "said"),
    [
        ("speed [grad/s]", "deg/s or gon/s"),
        ("angle [grad]", "deg or gon"),
        ("angle_grad", "deg or gon"),
        ("speed [Mrad/s]", "is not a unit"),
        ("position [%]", "is not a unit"),
        ("speed [counts/s]", "is not a unit"),
    ],
)
def test_a_unit_that_may_mean_two_things_or_none_stays_open(
    drafted: Drafted, tmp_path: Path, header: str, said: str
) -> None:
    with pytest.raises(ParameterError, match=rf"unit = .* FIXME: '.*{said}"):
        drafted({"log.csv": {"time [s]": TIME, "voltage [V]": BOTH, header: lagged(BOTH)}})
    text = (tmp_path / "campaign.toml").read_text("utf-8")
    assert "unit" not in next(iter(tomllib.loads(text)["axes"]["drive"]["channels"].values()))
    assert 'role = "fit"' in text


def test_an_angle_in_grad_wraps_at_360(tmp_path: Path) -> None:
    columns = {"Zeit [s]": TIME, "Spannung [V]": BOTH, "Winkel [grad]": (90.0 * TIME) % 360.0}
    _, _, entries = drafted_entries(tmp_path, columns)
    assert entries["Winkel [grad]"]["unit"] == "deg"
    assert entries["Winkel [grad]"]["rolls_over_at"] == pytest.approx(360.0)


def test_logs_of_a_logger_that_scales_itself(drafted: Drafted) -> None:
    """Each log has the units that suit it; the columns are the same."""
    speed = lagged(BOTH)
    tests = drafted(
        {
            "large.csv": {"Time [ms]": 1e3 * TIME, "Voltage [V]": BOTH, "Speed [rpm]": speed},
            "small.csv": {"Time [s]": TIME, "Voltage [mV]": 10.0 * BOTH, "Speed [rpm]": speed},
        }
    )
    assert tests["large"].input.values == pytest.approx(BOTH)
    assert tests["small"].input.values == pytest.approx(0.01 * BOTH)
    for run in tests:
        assert run.input.time == pytest.approx(TIME, abs=1e-9)
        assert run["shaft_speed"].values == pytest.approx(MINUTE * speed)


def test_logs_of_a_logger_that_scales_itself_in_names(drafted: Drafted) -> None:
    first = {"Time_s": TIME, "Voltage_V": BOTH, "Speed_rpm": lagged(BOTH)}
    second = {"Time_ms": 1e3 * TIME, "Voltage_mV": 10.0 * BOTH, "Speed_rpm": lagged(BOTH)}
    tests = drafted({"large.csv": first, "small.csv": second})
    assert tests["large"].input.values == pytest.approx(BOTH)
    assert tests["small"].input.values == pytest.approx(0.01 * BOTH)
    assert tests["small"].input.time == pytest.approx(TIME, abs=1e-9)


def test_columns_of_one_name_and_several_quantities_are_told_apart(drafted: Drafted) -> None:
    first = {"time": TIME, "voltage": BOTH, "Speed [rpm]": BOTH}
    tests = drafted({"a.csv": first, "b.csv": {**first, "Speed [mm/s]": BOTH}})
    assert [*tests["a"].channels] == ["shaft_speed"]
    assert [*tests["b"].channels] == ["shaft_speed", "shaft_speed_2"]


def test_what_is_left_out_is_said_with_its_reason(tmp_path: Path) -> None:
    good = {"time": TIME, "voltage": BOTH, "speed": BOTH, "temperature": 20.0 + 0.1 * BOTH}
    logs = {
        "good.csv": {**good, "state": ["on"] * TIME.size},
        "other.csv": {"time": TIME, "Kanal 7": BOTH, "speed": BOTH},
        "half.csv": {"time": TIME, "voltage": BOTH, "current": np.abs(BOTH), "speed": BOTH},
    }
    text = draft_campaign([write(tmp_path, *each) for each in logs.items()], tmp_path)
    unused = line_of(text, "# Columns that are not used")
    assert "temperature (only in good.csv)" in unused
    assert "state (it holds cells that are no numbers; only in good.csv)" in unused
    assert "Kanal 7 (only in other.csv)" in unused
    assert "role = \"ignore\"    # left out: it has no input: no column 'voltage'" in text
    assert 'rectified_current = false    # left out: no column "current"' in text


@pytest.mark.parametrize(
    "names",
    [
        ("Boom Cmd", "Boom Ms [mm]", "Stick Cmd", "Stick Ms [mm]"),
        ("Cmd_1", "Pos_1", "Cmd_2", "Pos_2"),
        ("boom_valve", "boom_angle [deg]", "bucket_temp", "bucket_angle [deg]"),
    ],
)
def test_channels_of_other_axes_are_not_those_of_the_one_named(tmp_path: Path, names) -> None:
    columns = {"Time [s]": TIME} | {name: (k + 1.0) * BOTH for k, name in enumerate(names)}
    text, axis, _ = drafted_entries(tmp_path, columns, columns={names[0]: "voltage"})
    assert axis["input"]["column"] == names[0]
    assert [channel["column"] for channel in axis["channels"].values()] == [names[1]]
    assert f"{names[3]} (of axis '" in line_of(text, "# Columns that are not used")
    # whoever states a column has it
    stated = {names[0]: "voltage", names[3]: "position"}
    _, axis, _ = drafted_entries(tmp_path, columns, columns=stated)
    assert {channel["column"] for channel in axis["channels"].values()} == {names[1], names[3]}


def test_several_axes_in_a_log_are_said(tmp_path: Path) -> None:
    columns = {"Time [s]": TIME, "u links": BOTH, "n links [rpm]": BOTH, "u rechts": BOTH}
    text, *_ = drafted_entries(tmp_path, columns | {"n rechts [rpm]": BOTH})
    assert "Inputs: u links, u rechts" in line_of(text, "# Several axes?")


def test_letters_behind_names_tell_axes(tmp_path: Path) -> None:
    columns = {"voltage_A [V]": BOTH, "speed_A [rpm]": BOTH}
    columns |= {"voltage_B [V]": BOTH, "speed_B [rpm]": BOTH}
    text = draft_campaign([write(tmp_path, "log.csv", {"t [s]": TIME, **columns})], tmp_path)
    assert "# Several axes, by the beginnings of the columns' names: a, b" in text


def test_channels_alike_of_one_command_are_said(tmp_path: Path) -> None:
    columns = {"u [V]": BOTH, "boom position [mm]": BOTH, "stick position [mm]": BOTH}
    text, *_ = drafted_entries(tmp_path, {"Time [s]": TIME, **columns})
    said = line_of(text, "# Several axes?")
    assert "Channels alike: boom position [mm], stick position [mm]" in said


# --- guesses that no machine fits -----------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "values", "said"),
    [
        ("current", 150.0 * np.abs(BOTH), "in A it would reach 600 A"),
        ("speed", 1000.0 * BOTH, "the fastest hydraulic motors turn at 11,000 rpm"),
        ("spool position", 20.0 * BOTH, "the header gives none"),
    ],
)
def test_a_unit_that_no_machine_fits_stays_open(tmp_path, name, values, said) -> None:
    log = write(
        tmp_path, "log.csv", {"time [s]": TIME, "u [V]": BOTH, name: values, "n [rpm]": BOTH}
    )
    text = draft_campaign([log], tmp_path)
    (line,) = [each for each in text.splitlines() if each.startswith("# unit")]
    assert "FIXME" in line
    assert said in line
    (tmp_path / "campaign.toml").write_text(text, "utf-8")
    with pytest.raises(ParameterError, match="is marked FIXME"):
        Campaign.from_toml(tmp_path / "campaign.toml")


def test_a_voltage_that_no_card_takes_stays_open(tmp_path: Path) -> None:
    log = write(tmp_path, "log.csv", {"t [s]": TIME, "voltage": 12.3 * BOTH, "n [rpm]": BOTH})
    assert "in V it would reach 49.2 V, but a card takes 10 V" in draft_campaign([log], tmp_path)


def test_marks_for_no_value_leave_the_guessed_unit(drafted: Drafted) -> None:
    current = np.where((TIME > 2.0) & (TIME < 2.4), -999.0, np.abs(BOTH) / 5.0)
    tests = drafted(current=current, **{"n [rpm]": BOTH})
    assert 'unit = "A"    # guessed: the header gives none' in text_of(tests)


@pytest.mark.parametrize(
    ("stamps", "said"),
    [
        (TIME / 3600.0, "in s it lasts 0.00222 s"),
        (TIME / 86400.0, "in s it lasts 9.25e-05 s"),
        (1000.0 * TIME + 0.25, "in s it has 0.2 Hz"),
    ],
)
def test_a_clock_that_no_motion_fits_stays_open_and_is_a_finding(tmp_path, stamps, said) -> None:
    columns = {"u [V]": BOTH, "n [rpm]": lagged(BOTH)}
    log = write(tmp_path, "log.csv", {"time": np.round(stamps, 12), **columns})
    (line,) = [each for each in draft_campaign([log], tmp_path).splitlines() if "time =" in each]
    assert "FIXME" in line
    assert said in line
    tests = read_draft(tmp_path, [write(tmp_path, "log.csv", {"t [s]": stamps, **columns})])
    assert any("check the unit of the time stamps" in each for each in findings(tests))


def test_clocks_of_signals_that_they_do_not_name_stay_open(tmp_path: Path) -> None:
    columns = {"t_cmd": TIME, "u [V]": BOTH, "t_enc": TIME + 0.5, "n [rpm]": lagged(BOTH)}
    text = draft_campaign([write(tmp_path, "log.csv", columns)], tmp_path)
    for name in ("u [V]", "n [rpm]"):
        assert f"FIXME: the clock of '{name}' is 't_cmd' or 't_enc'" in text
    assert 'column = "u [V]"' in text


def test_a_clock_of_one_length_is_that_of_the_signals_of_its_length(tmp_path: Path) -> None:
    log = tmp_path / "log.mat"
    later = {"t_enc": TIME[100:], "speed": lagged(BOTH)[100:]}
    savemat(log, {"t_cmd": TIME, "voltage": BOTH, **later})
    run = read_draft(tmp_path, [log])[0]
    assert (run.input.time[0], run.channels["shaft_speed"].time[0]) == (0.0, 0.5)


def test_the_unit_of_a_clock_at_the_end_of_its_name(drafted: Drafted) -> None:
    columns = {"TimeMs": 1000.0 * TIME, "u [V]": BOTH, "n [rpm]": lagged(BOTH)}
    assert drafted({"log.csv": columns})[0].duration == pytest.approx(TIME[-1])


@pytest.mark.parametrize(
    ("header", "unit"),
    [
        ("speed_deg_s", "deg/s"),
        ("Drehzahl_Grad_s", "Grad/s"),
        ("Drehzahl in Grad/s", "Grad/s"),
        ("speed deg per s", "deg/s"),
        ("n_U_min", "U/min"),
        ("rod_speed_mm_s", "mm/s"),
    ],
)
def test_a_fraction_at_the_end_of_a_name(tmp_path: Path, header: str, unit: str) -> None:
    _, axis, _ = drafted_entries(tmp_path, {"t [s]": TIME, "u [V]": BOTH, header: BOTH})
    assert axis["channels"]["shaft_speed"]["unit"] == unit
