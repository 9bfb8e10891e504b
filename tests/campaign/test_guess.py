"""First guesses: numbers that made the logs are found again, and a fit begins from them."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.identification.given import run_of

from swashplate import Campaign, Drive, Experiment, InputError
from swashplate.campaign import Encoder, fit_configuration, guess_drive, guessed_set
from swashplate.identification.setup import Setup

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


@pytest.mark.parametrize("kind", ["shaft_speed", "position"])
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


def test_a_noisy_position_shows_the_same() -> None:
    """Neighbours differ by up to 20 times what the machine moves in between."""
    found = guess_drive(runs("position", rough=0.1))
    assert found.dead_zone == pytest.approx(DEAD, abs=0.15)
    assert found.gain == pytest.approx(GAIN, rel=0.05)
    assert found.lag + found.delay == pytest.approx(LAG + DELAY, abs=0.05)


def test_limits_are_found_where_they_act() -> None:
    found = guess_drive(runs(top=2.0, pull=4.0))
    assert found.top_speed == pytest.approx((2.0, 2.0), rel=0.02)
    assert found.acceleration == pytest.approx((4.0, 4.0), rel=0.1)
    assert found.gain == pytest.approx(GAIN, rel=0.05)


def test_a_jump_at_the_edge_of_the_dead_zone_is_found() -> None:
    found = guess_drive(runs(jump=0.3))
    assert found.jump == pytest.approx((0.3, 0.3), rel=0.1)
    assert found.dead_zone == pytest.approx(DEAD, abs=0.05)
    assert found.gain == pytest.approx(GAIN, rel=0.03)
    parameters = guessed_set(found, "campaign.toml")
    steady = Drive(parameters).steady_speed([-1.1 * DEAD[1], 1.1 * DEAD[0]])
    expected = [-0.3 - 0.1 * GAIN[1] * DEAD[1], 0.3 + 0.1 * GAIN[0] * DEAD[0]]
    assert steady == pytest.approx(expected, rel=0.2)
    assert "J_plus" in fit_configuration(found, parameters)
    none = guess_drive(runs())
    assert none.jump == (0.0, 0.0)
    assert "J_plus" not in fit_configuration(none, guessed_set(none, "x"))


@pytest.mark.parametrize("pulses", [60.0, 240.0])
def test_an_encoder_of_few_pulses_shows_no_jump(pulses: float) -> None:
    made = []
    for each in runs("position", lag=0.05):
        speed = machine(each.input.values, lag=0.05)
        position = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1])) / RATE])
        encoder = Encoder(pulses, 1.0, 1, None)
        counts = np.floor(position / encoder.angle_per_count + 0.3)
        read = {"counts": counts, "values": counts * encoder.angle_per_count, "encoder": encoder}
        channel = replace(each["position"], kind="encoder_counts", **read)
        made.append(replace(each, channels={"counts": channel}))
    found = guess_drive(made)
    assert found.jump == (0.0, 0.0)
    assert found.gain == pytest.approx(GAIN, rel=0.08)
    assert found.dead_zone == pytest.approx(DEAD, abs=0.3)


def test_a_lag_that_is_not_seen_stays_fixed() -> None:
    found = guess_drive(runs(lag=1e-4, pull=4.0))
    text = fit_configuration(found, guessed_set(found, "x"))
    assert "Z16_plus" in text
    assert "Z8 =" not in text


def test_a_guess_becomes_a_drive_and_a_fit_configuration() -> None:
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
    setup = Setup(**tomllib.loads(fit_configuration(found, parameters)))
    (stage,) = setup.stages
    assert {"V_dz_plus", "G1_minus", "Z8", "tau", "Z13_plus", "Z16_minus"} <= stage.free.keys()


def test_a_way_that_was_not_tried_is_the_other_s_and_fixed() -> None:
    found = guess_drive([each for each in runs() if each.name == "up"])
    assert found.command == (8.0, 0.0)
    assert found.gain[0] == found.gain[1]
    text = fit_configuration(found, guessed_set(found, "x"))
    assert "G1_plus" in text
    assert "G1_minus" not in text


def test_what_tells_nothing_is_refused() -> None:
    (sine, *_) = runs()
    speed = sine["shaft_speed"]
    for changes, said in (
        ({"values": -speed.values}, "against the command: reverse it with sign = -1"),
        ({"weight": np.zeros(TIME.size)}, "No run measures a motion"),
    ):
        with pytest.raises(InputError, match=said):
            guess_drive([replace(sine, channels={"speed": replace(speed, **changes)})])
    with pytest.raises(InputError, match="needs a command in V"):
        guess_drive([replace(sine, input=replace(sine.input, kind="other", unit="%"))])


DATA = Path(__file__).parents[3] / "shared" / "data" / "eha"


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
input = {{ kind = "voltage", column = "EXP_Velocity", unit = "V", scale = 0.005 }}
channels.position = {{ kind = "position", column = "EXP_PosFb", unit = "mm" }}

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
    with pytest.raises(
        InputError, match=f"In {second.name} 'shaft_speed' goes against the command, in"
    ):
        guess_drive([first, replace(second, channels={"shaft_speed": turned}), *others])
