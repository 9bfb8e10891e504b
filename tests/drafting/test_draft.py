"""A first draft of a campaign file, which must be readable as it is."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.drafting.conftest import Drafted
from tests.identification.given import run_of
from tests.marks import rest_slow

from swashplate import Campaign, Drive, Experiment, InputError, ParameterError, maneuvers, rig
from swashplate.campaign import Encoder
from swashplate.drafting import draft_campaign as draft
from swashplate.drafting import guess_drive, guessed_set
from swashplate.identification import whole_drive
from swashplate.identification.unseen import with_unseen

HEADERS = {
    "voltage": ("Joystick voltage", "lever [V]", "command_V", "Joystickspannung"),
    "rectified_current": ("ammeter [mA]", "Current", "Magnetstrom", "Strøm", "Courant"),
    "shaft_speed": (
        *("winch speed [rpm]", "drum [deg/s]", "Trommeldrehzahl", "Drehzahl der Trommel"),
        *("Vitesse du tambour", "tambour vitesse", "trommel toerental", "Turtall"),
    ),
    "position": ("EXP_PosFb", "Kolbenweg", "Ángulo"),
    "encoder_counts": ("encoderCounts", "Impulse", "Drehgeber"),
    "swash_angle": ("swash angle",),
    "other": ("Boom Cmd", "Hebel"),
    None: ("oil temperature [degC]",),
}


@pytest.mark.parametrize(("kind", "header"), [(k, each) for k in HEADERS for each in HEADERS[k]])
def test_what_a_header_says(tmp_path: Path, kind: str | None, header: str) -> None:
    (tmp_path / "log.csv").write_text(f"Time [ms],{header}\n0,0.5\n1,1.5\n2,1.5\n", "utf-8")
    text = draft([tmp_path / "log.csv"], tmp_path)
    assert 'time = { column = "Time [ms]" }' in text
    tables = tomllib.loads(text)["axes"]["drive"]
    entries = [tables["input"], *tables["channels"].values()]
    found = [each["kind"] for each in entries if each["column"] == header]
    assert found == ([] if kind is None else [kind])
    assert (f"# Columns that are not used: {header}" in text) == (kind is None)


def test_a_draft_can_be_read(drafted: Drafted) -> None:
    row = np.arange(100.0)
    on = 1.0 * (row > 20)
    columns = {"time [s]": row / 100, "voltage [V]": 4 * on, "current [A]": 0.4 * on}
    logs = {f"run{number}.csv": {**columns, "counts": 7 * row} for number in range(4)}
    with pytest.raises(
        ParameterError, match=r"line 29, .*\.encoder_counts\]: counts_per_turn .* FIXME"
    ):
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
    with pytest.raises(ParameterError, match=r"line 16, \[axes.drive.input\]: .* FIXME"):
        drafted(logs)
    text = (tmp_path / "campaign.toml").read_text("utf-8")
    assert "column = \"FIXME\"    # which of 'time', 'current', 'Kanal 3' commands?" in text
    columns = {"Kanal 3": "voltage"}
    drive = drafted(logs, draft={"columns": columns, "units": {"Kanal 3": "mV"}})["log"].input
    assert (drive.kind, drive.values.tolist()) == ("voltage", [0.002, 0.003])
    with pytest.raises(InputError, match="column 'Kanal 4'"):
        drafted(logs, draft={"columns": {"Kanal 4": "voltage"}})
    with pytest.raises(InputError, match="'volts': .* time, voltage"):
        drafted(logs, draft={"columns": {"Kanal 3": "volts"}})
    with pytest.raises(InputError, match="one log"):
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


# --- first guesses --------------------------------------------------------------------------------


RATE = 500.0
TIME = np.arange(int(12.0 * RATE)) / RATE
DEAD, GAIN, LAG, DELAY = (0.8, 0.5), (0.4, 0.6), 0.15, 0.06


def machine(
    command: np.ndarray,
    top: float = np.inf,
    pull: float = np.inf,
    lag: float = LAG,
    jump: float = 0.0,
) -> np.ndarray:
    """Speed behind dead zone, jump, gain, limits, lag and delay, in steps of 2 ms."""
    late = np.interp(TIME - DELAY, TIME, command)
    target = GAIN[0] * np.maximum(late - DEAD[0], 0.0) - GAIN[1] * np.maximum(-late - DEAD[1], 0.0)
    target += jump * ((late > DEAD[0]) * 1.0 - (late < -DEAD[1]))
    target = np.clip(target, -top, top)
    speed = np.zeros(TIME.size)
    for n in range(1, TIME.size):
        move = (target[n - 1] - speed[n - 1]) * (1.0 - np.exp(-1.0 / RATE / lag))
        speed[n] = speed[n - 1] + np.clip(move, -pull / RATE, pull / RATE)
    return speed


COMMANDS = {
    "sine": 6.0 * np.sin(2.0 * np.pi * 0.2 * TIME),
    "up": 8.0 * ((TIME > 1.0) & (TIME < 6.0)),
    "down": -8.0 * ((TIME > 1.0) & (TIME < 6.0)),
    "small": 3.0 * np.sin(2.0 * np.pi * 0.5 * TIME),
}


def runs(
    kind: str = "shaft_speed", noise: float = 0.02, rough: float = 0.0, **numbers: float
) -> list[Experiment]:
    """A run of each command, measured by a tacho or by a position, which may be rough."""
    random, made = np.random.default_rng(1), []
    for name, command in COMMANDS.items():
        speed = machine(command, **numbers)
        position = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1])) / RATE])
        values = speed + random.normal(0.0, noise, TIME.size)
        if kind == "position":
            values = np.round(position + random.normal(0.0, rough, TIME.size), 3)
        made.append(run_of(name, command, {kind: values}, time=TIME, hold="previous"))
    return made


@pytest.mark.slow
@pytest.mark.parametrize("kind", rest_slow(["shaft_speed", "position"]))
def test_dead_zones_gains_lag_and_delay_are_found_again(kind: str) -> None:
    found = guess_drive(runs(kind))
    assert found.dead_zone == pytest.approx(DEAD, abs=0.05)
    assert found.gain == pytest.approx(GAIN, rel=0.02)
    assert found.lag == pytest.approx(LAG, rel=0.05)
    # of a command that is held, half a sample comes to the delay
    assert found.delay == pytest.approx(DELAY + 0.5 / RATE, abs=0.004)
    assert found.top_speed == found.acceleration == (np.inf, np.inf)
    assert found.unit == "rad/s"
    assert found.fit_percent > 97.0


@pytest.mark.slow
def test_a_noisy_position_shows_the_same() -> None:
    """Neighbours differ by up to 20 times what the machine moves in between."""
    found = guess_drive(runs("position", rough=0.1))
    assert found.dead_zone == pytest.approx(DEAD, abs=0.15)
    assert found.gain == pytest.approx(GAIN, rel=0.05)
    assert found.lag + found.delay == pytest.approx(LAG + DELAY, abs=0.05)


@pytest.mark.slow
def test_limits_are_found_where_they_act() -> None:
    found = guess_drive(runs(top=2.0, pull=4.0))
    assert found.top_speed == pytest.approx((2.0, 2.0), rel=0.02)
    assert found.acceleration == pytest.approx((4.0, 4.0), rel=0.1)
    assert found.gain == pytest.approx(GAIN, rel=0.05)


@pytest.mark.slow
def test_a_jump_at_the_edge_of_the_dead_zone_is_found() -> None:
    found = guess_drive(runs(jump=0.3))
    assert found.jump == pytest.approx((0.3, 0.3), rel=0.1)
    assert found.dead_zone == pytest.approx(DEAD, abs=0.05)
    assert found.gain == pytest.approx(GAIN, rel=0.03)
    parameters = guessed_set(found, "campaign.toml")
    steady = Drive(parameters).steady_speed([-1.1 * DEAD[1], 1.1 * DEAD[0]])
    expected = [-0.3 - 0.1 * GAIN[1] * DEAD[1], 0.3 + 0.1 * GAIN[0] * DEAD[0]]
    assert steady == pytest.approx(expected, rel=0.2)
    none = guess_drive(runs())
    assert none.jump == (0.0, 0.0)


def encoder_runs(pulses: float, **numbers: float) -> list[Experiment]:
    """A run of each command, measured by an encoder with few counts a turn."""
    encoder = Encoder(pulses, 1.0, 1, None)
    made = []
    for run in runs("position", lag=0.05):
        speed = machine(run.input.values, lag=0.05, **numbers)
        position = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1])) / RATE])
        counts = np.floor(position / encoder.angle_per_count + 0.3)
        channel = replace(
            run["position"],
            kind="encoder_counts",
            counts=counts,
            values=counts * encoder.angle_per_count,
            encoder=encoder,
        )
        made.append(replace(run, channels={"counts": channel}))
    return made


@pytest.mark.slow
@pytest.mark.parametrize("pulses", rest_slow([60.0, 240.0]))
def test_an_encoder_of_few_pulses_shows_no_jump(pulses: float) -> None:
    found = guess_drive(encoder_runs(pulses))
    assert found.jump == (0.0, 0.0)
    assert found.gain == pytest.approx(GAIN, rel=0.005)
    assert found.dead_zone == pytest.approx(DEAD, abs=0.01)
    assert found.top_speed == found.acceleration == (np.inf, np.inf)


@pytest.mark.slow
@pytest.mark.parametrize("pulses", rest_slow([60.0, 240.0]))
def test_an_encoder_of_few_pulses_shows_a_jump(pulses: float) -> None:
    found = guess_drive(encoder_runs(pulses, jump=0.3))
    assert found.jump == pytest.approx((0.3, 0.3), rel=0.1)
    assert found.gain == pytest.approx(GAIN, rel=0.03)


@pytest.mark.slow
def test_a_run_without_a_count_widens_the_dead_zone() -> None:
    """Two large steps leave the dead zone open; a command of 0.45 V moved nothing."""
    steps = [run for run in encoder_runs(60.0) if run.name in ("up", "down")]
    command = 0.45 * np.sin(TIME)
    still = run_of("still", command, {"counts": np.zeros(TIME.size)}, time=TIME, hold="previous")
    channel = replace(
        still["counts"],
        kind="encoder_counts",
        counts=np.zeros(TIME.size),
        encoder=steps[0]["counts"].encoder,
    )
    found = guess_drive([*steps, replace(still, channels={"counts": channel})])
    assert min(found.dead_zone) > 0.43


@pytest.mark.slow
def test_a_guess_becomes_a_drive() -> None:
    """The drive's speeds are those that were guessed: steady ones, and the lag of a small step."""
    found = guess_drive(runs(top=2.0, pull=4.0))
    parameters = guessed_set(found, "campaign.toml")
    drive = Drive(parameters)
    steady = drive.steady_speed([-9.0, -2.5, 2.0, 9.0])
    expected = [-2.0, -GAIN[1] * (2.5 - DEAD[1]), GAIN[0] * (2.0 - DEAD[0]), 2.0]
    assert steady == pytest.approx(expected, rel=0.06)
    run = drive.simulate(np.full(1024, 2.5))
    end = run.shaft_speed[-1]
    reached = np.interp(1.0 - np.exp(-1.0), run.shaft_speed / end, run.time)
    # the card's two milliseconds twice
    assert reached == pytest.approx(DELAY + LAG + 2.0 / 512.0, rel=0.1)
    assert {parameters[name].status for name in ("V_dz", "G1", "Z8", "tau")} == {"approximate"}
    known = {name: entry.spread for name, entry in whole_drive(parameters).free.items()}
    for name in ("V_dz", "G1", "Z8", "tau", "Z13", "Z16"):
        assert known[name] == 0.7
    assert known["Z9"] == 0.3
    faster = found._replace(gain=(4e9, 6e9), top_speed=(2e10, 2e10))
    with pytest.raises(ParameterError, match="from campaign.toml .* units and scales .* Z10 "):
        guessed_set(faster, "campaign.toml")


@pytest.mark.slow
def test_a_way_that_was_not_tried_is_the_other_s() -> None:
    found = guess_drive([each for each in runs() if each.name == "up"])
    assert found.command == (8.0, 0.0)
    assert found.gain[0] == found.gain[1]
    _, setup = with_unseen(guessed_set(found, "x"), whole_drive(guessed_set(found, "x")))
    assert "G2_plus" in setup.free
    assert "G2_minus" not in setup.free


WINCH = Drive.preset("neutral").replace(V_dz=(0.8, 0.45), tau=0.04, Z8=1.4e6)
"""A lag of 0.15 s; its steady speed is a straight line beyond the dead zone."""


def rig_runs(drive: Drive, folder: Path, channel: str, **how: object) -> Campaign:
    """Steps with a rest of three seconds after them, and a sine, of a drive in the virtual rig."""
    steps = [maneuvers.step(volts, start=0.5, stop=3.0, length=6.0) for volts in (8.0, -8.0)]
    tests = [*steps, maneuvers.sine(7.0, 0.2, length=6.0)]
    logs = rig.run("neutral", tests, truth=drive, channels=[channel], **how)
    return Campaign.from_toml(rig.write(logs, folder))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("offset", "seed", "channel", "counts"),
    rest_slow([(2e-5, 23, "encoder_counts", 2500.0), (-2e-5, 24, "shaft_speed", None)]),
)
def test_a_creep_at_rest_is_found(
    tmp_path: Path, offset: float, seed: int, channel: str, counts: float | None
) -> None:
    truth = WINCH.replace(Z18=offset)
    logs = rig_runs(truth, tmp_path / "logs", channel, seed=seed, counts_per_turn=counts)
    found = guess_drive(logs)
    assert found.creep == pytest.approx(float(truth.steady_speed(0.0)), rel=0.1)
    # nothing else stands for it
    assert found.dead_zone == pytest.approx((0.8, 0.45), abs=0.05)
    start = guessed_set(found, "campaign.toml")
    assert float(Drive(start).steady_speed(0.0)) == pytest.approx(found.creep, rel=1e-6)
    assert start["Z18"].status == "approximate"
    assert whole_drive(start).free["Z18"].spread == 0.7


@pytest.mark.slow
@pytest.mark.parametrize(
    ("channel", "counts", "severity"),
    rest_slow(
        [
            ("encoder_counts", 40.0, "realistic"),
            ("shaft_speed", None, "harsh"),
            ("encoder_counts", 2500.0, "harsh"),
        ]
    ),
)
def test_no_creep_is_made_of_noise_or_counts(
    tmp_path: Path, channel: str, counts: float | None, severity: str
) -> None:
    how = {"seed": 25, "counts_per_turn": counts, "severity": severity}
    found = guess_drive(rig_runs(WINCH, tmp_path / "logs", channel, **how))
    assert found.creep == 0.0
    start = guessed_set(found, "campaign.toml")
    assert start.numbers["Z18"] == 0.0
    assert "no creep" in start["Z18"].source
    assert "Z18" not in whole_drive(start).free


@pytest.mark.slow
def test_without_a_rest_no_creep_is_told() -> None:
    """Sines cross the dead zone too fast for the motion to end there."""
    found = guess_drive([each for each in runs() if each.name in ("sine", "small")])
    assert found.creep is None
    start = guessed_set(found, "campaign.toml")
    assert "rest" in start["Z18"].source
    assert "Z18" not in whole_drive(start).free


def test_what_tells_nothing_is_refused() -> None:
    (sine, *_) = runs()
    speed = sine["shaft_speed"]
    for changes, said in (
        ({"values": -speed.values}, "command: .* sign = -1"),
        ({"weight": np.zeros(TIME.size)}, "run .* shaft_speed, position or encoder_counts"),
        ({"weight": np.where(TIME[3] > TIME, 1.0, 0.0)}, "short"),
    ):
        with pytest.raises(InputError, match=said):
            guess_drive([replace(sine, channels={"speed": replace(speed, **changes)})])
    with pytest.raises(InputError, match=r"kind = .voltage., unit = .V."):
        guess_drive([replace(sine, input=replace(sine.input, kind="other", unit="%"))])


DATA = Path(__file__).parents[3] / "shared" / "data" / "eha"


@pytest.mark.slow
@pytest.mark.skipif(not DATA.exists(), reason="the actuator's logs are not beside this checkout")
@pytest.mark.parametrize(
    "rounding", [0.0, *(pytest.param(each, marks=pytest.mark.slow) for each in (1e-12, 1e-9))]
)
def test_an_electro_hydrostatic_actuator_blind(tmp_path: Path, rounding: float) -> None:
    """Speed of its pump to position of its rod: the same guess whatever the last digits are.

    Its squares have many minima: one with a lag of 0.11 s follows the mean speeds to 90.8 %.
    """
    (tmp_path / "campaign.toml").write_text(
        f"""
[axes.rod]
time = {{ column = "EXP_Time", unit = "s" }}
channels.position = {{ kind = "position", column = "EXP_PosFb", unit = "mm" }}

[axes.rod.input]
kind = "voltage"
column = "EXP_Velocity"
unit = "V"
scale = 0.005
interpolation = "previous"

[[runs]]
file = "{(DATA / "exp_data_1_3.csv").as_posix()}"
""",
        "utf-8",
    )
    (run,) = Campaign.from_toml(tmp_path / "campaign.toml").experiments
    position = run["position"]
    noise = 1.0 + rounding * np.random.default_rng(1).normal(size=position.values.size)
    position = replace(position, values=position.values * noise)
    found = guess_drive([replace(run, channels={"position": position})])
    assert found.unit == "m/s"
    assert found.fit_percent == pytest.approx(92.05, abs=0.1)
    assert found.dead_zone[1] == pytest.approx(3.12, rel=0.02)
    assert found.acceleration == pytest.approx((0.0326, 0.0661), rel=0.02)
    assert found.lag == pytest.approx(0.0167, rel=0.1)


def test_a_run_that_goes_the_other_way_is_named() -> None:
    first, second, *others = runs()
    turned = replace(second["shaft_speed"], values=-second["shaft_speed"].values)
    with pytest.raises(InputError, match=f"In {second.name} 'shaft_speed' .* command"):
        guess_drive([first, replace(second, channels={"shaft_speed": turned}), *others])
