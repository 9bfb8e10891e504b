"""First guesses of an amplifier from the current: of cards whose numbers are known, with noise."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from tests.identification.given import run_of
from tests.marks import rest_slow

from swashplate import Drive, InputError
from swashplate.campaign import Experiment
from swashplate.drafting import amplifier_table, guess_amplifier, guess_drive, guessed_set
from swashplate.identification import FitSetup, fit, whole_drive
from swashplate.identification.estimation.setup import Free

RATE = 200.0
TIME = np.arange(int(12.0 * RATE)) / RATE
COMMANDS: Mapping[str, np.ndarray] = {
    "ramp up": np.clip(TIME - 1.0, 0.0, 7.0),
    "ramp down": -np.clip(TIME - 1.0, 0.0, 7.0),
    "up": 6.0 * ((TIME > 1.0) & (TIME < 6.0)),
    "down": -6.0 * ((TIME > 1.0) & (TIME < 6.0)),
    "sine": 6.0 * np.sin(2.0 * np.pi * 0.2 * TIME),
}
DEAD, JUMP, GAIN, OMEGA, DELAY = (0.9, 0.6), (0.2, 0.1), (0.08, 0.11), 30.0, 0.02


def plain(command: np.ndarray) -> np.ndarray:
    """Signed current behind dead zone, jump, gain, a filter with ζ = 1 and a delay, at 20 kHz."""
    fine = np.arange(TIME[0], TIME[-1], 5e-5)
    late = np.interp(fine - DELAY, TIME, command)
    level = np.zeros(fine.size)
    for way, sign in enumerate((1.0, -1.0)):
        beyond = sign * late - DEAD[way]
        level += sign * (beyond > 0.0) * (JUMP[way] + GAIN[way] * beyond)
    share = 1.0 - np.exp(-OMEGA * 5e-5)
    for _ in range(2):  # two equal lags are a filter with ζ = 1
        level = lfilter([share], [1.0, share - 1.0], level)
    return np.interp(TIME, fine, level)


def runs(kind: str, commands: Mapping[str, np.ndarray] = COMMANDS) -> list[Experiment]:
    """Currents of a plain amplifier, as an instrument of a kind reads them."""
    random, made = np.random.default_rng(2), []
    read = {
        "signed_current": lambda current: current,
        "rectified_current": np.abs,
        "current_plus": lambda current: np.maximum(current, 0.0),
        "current_minus": lambda current: np.maximum(-current, 0.0),
    }
    kinds = ("current_plus", "current_minus") if kind == "both" else (kind,)
    for name, command in commands.items():
        noise = random.normal(0.0, 0.004, TIME.size)
        channels = {each: read[each](plain(command)) + noise for each in kinds}
        made.append(run_of(name, command, channels, time=TIME))
    return made


@pytest.mark.parametrize("kind", rest_slow(["signed_current", "rectified_current", "both"]))
def test_a_plain_amplifier_is_read_off_its_current(kind: str) -> None:
    found = guess_amplifier(runs(kind))
    assert found is not None
    assert found.card == ""
    assert found.dead_zone == pytest.approx(DEAD, abs=0.06)
    assert found.jump == pytest.approx(JUMP, abs=0.01)
    assert found.gain == pytest.approx(GAIN, rel=0.03)
    # the frequencies that are tried are a factor of two apart, the delay makes up for the rest
    lag = 2.0 / found.dynamics["omega"][0] + found.delay
    assert lag == pytest.approx(2.0 / OMEGA + DELAY, abs=0.01)
    assert found.fit_percent > 93.0
    assert f"{found.jump[0]:.4g}" in str(amplifier_table(found))


@pytest.mark.slow
def test_a_packaged_card_is_recognised(hoist: Drive) -> None:
    """By its limited rate, though its currents are half as large again."""
    card = hoist.at_every_rate().replace(Z19=5.0, Z20=0.0, Z21=0.0, Z22=0.0)
    card = card.scale(J=1.5, G1=1.5, G2=1.5, G3=1.5, lim1=1.5, lim2=1.5)
    card = card.replace(Z17=0.45).scale(I_t1=1.5, I_t2=1.5)
    made = []
    for name, command in COMMANDS.items():
        run = card.simulate(command, RATE)
        current = np.interp(TIME, run.time, run.current)
        made.append(run_of(name, command, {"signed_current": current}, time=TIME))
    found = guess_amplifier(made)
    assert found is not None
    assert found.card == "rexroth_mdsd_1k_2x_2"
    numbers = card.parameters.numbers
    assert found.jump == pytest.approx((numbers["J_plus"], numbers["J_minus"]), rel=0.05)
    assert found.dynamics["lim1"] == pytest.approx(
        (numbers["lim1_plus"], numbers["lim1_minus"]), rel=0.1
    )
    assert found.delay == pytest.approx(numbers["tau"], abs=0.005)


LIMITED = {"dead": 0.5, "jump": 0.4, "gain": 0.1, "up": 1.5, "down": 3.0, "lag": 0.015}


def limited(command: np.ndarray) -> np.ndarray:
    """Magnitude of a current that jumps at once, then follows at a limited rate, behind a lag."""
    step = 5e-4
    fine = np.arange(TIME[0], TIME[-1], step)
    beyond = np.abs(np.interp(fine, TIME, command)) - LIMITED["dead"]
    wanted = np.where(beyond > 0.0, LIMITED["jump"] + LIMITED["gain"] * beyond, 0.0)
    held, lagged, course = 0.0, 0.0, np.zeros(fine.size)
    for k, goal in enumerate(wanted):
        lower = held - LIMITED["down"] * step
        if goal == 0.0:
            held = lower if lower > LIMITED["jump"] else 0.0
        else:
            held = min(max(goal, lower), max(held, LIMITED["jump"]) + LIMITED["up"] * step)
        lagged += (held - lagged) * step / LIMITED["lag"]
        course[k] = lagged
    return np.interp(TIME, fine, course)


@pytest.mark.slow
def test_a_limited_rate_each_way_is_read_off_a_current() -> None:
    random, made = np.random.default_rng(4), []
    for name, command in COMMANDS.items():
        current = limited(command) + random.normal(0.0, 0.003, TIME.size)
        made.append(run_of(name, command, {"rectified_current": current}, time=TIME))
    found = guess_amplifier(made)
    assert found is not None
    assert found.card == ""
    for way in (0, 1):
        assert found.dead_zone[way] == pytest.approx(LIMITED["dead"], abs=0.02)
        assert found.jump[way] == pytest.approx(LIMITED["jump"], rel=0.03)
        assert found.gain[way] == pytest.approx(LIMITED["gain"], rel=0.03)
        assert found.dynamics["lim1"][way] == pytest.approx(LIMITED["up"], rel=0.1)
        assert found.dynamics["lim2"][way] == pytest.approx(LIMITED["down"], rel=0.2)
    assert found.fit_percent > 95.0


def test_a_way_that_was_not_tried_is_the_other_s() -> None:
    commands = {"up": COMMANDS["up"], "ramp": COMMANDS["ramp up"]}
    found = guess_amplifier(runs("rectified_current", commands))
    assert found is not None
    assert found.command == (7.0, 0.0)
    assert found.gain[0] == found.gain[1]
    assert "not tried" in str(amplifier_table(found))


def test_without_a_current_there_is_no_amplifier() -> None:
    speed = {"shaft_speed": np.zeros(TIME.size)}
    assert guess_amplifier([run_of("up", COMMANDS["up"], speed, time=TIME)]) is None


# --- from the guess to the fit --------------------------------------------------------------------


@pytest.fixture(scope="module")
def winch() -> tuple[Drive, list[Experiment]]:
    """A hoist with other numbers, and its tests with tacho and clamp."""
    drive = Drive.preset("hoist").at_every_rate()
    drive = drive.scale(V_dz=1.1, G1=(0.9, 1.1), Z10=1.1, Z8=1.2, Z16=1.2)
    random, made = np.random.default_rng(3), []
    for name, command in COMMANDS.items():
        run = drive.simulate(command, RATE)
        current = run.current_positive + run.current_negative
        channels = {
            "rectified_current": np.interp(TIME, run.time, current),
            "shaft_speed": np.interp(TIME, run.time, run.shaft_speed),
        }
        channels = {
            key: values + random.normal(0.0, 0.005, TIME.size) for key, values in channels.items()
        }
        made.append(run_of(name, command, channels, time=TIME))
    return drive, made


@pytest.mark.slow
def test_a_measured_current_frees_the_amplifier_beside_the_pump(winch) -> None:
    _, tests = winch
    found = guess_drive(tests)
    start = guessed_set(found, "campaign.toml")
    setup = whole_drive(start)
    assert setup.part == "chain"
    assert not setup.channels  # the current is fitted, too
    known = {name: entry.spread for name, entry in setup.free.items()}
    for name in ("V_dz", "J", "G1", "omega", "lim1", "tau", "Z17", "Z19", "Z8"):
        assert known[name] == 0.7, name
    # steady speeds are those that were guessed from the command to the speed
    steady = Drive(start).steady_speed([-6.0, 6.0])
    for way, speed in enumerate((steady[1], -steady[0])):
        linear = found.gain[way] * (6.0 - found.dead_zone[way])
        assert speed == pytest.approx(min(linear, found.top_speed[way]), rel=0.1)


@pytest.mark.slow
def test_current_and_speed_are_fitted_from_nothing(winch) -> None:
    """Numbers of the amplifier within 5 %, the current to its noise, the speed to 5 %."""
    drive, tests = winch
    found = guess_drive(tests)
    start = guessed_set(found, "campaign.toml")
    result = fit(start, tests, whole_drive(start))
    truth = drive.parameters.numbers
    for name in ("V_dz_plus", "V_dz_minus", "J_plus", "J_minus", "tau", "omega_plus", "lim2_plus"):
        assert result.parameters.numbers[name] == pytest.approx(truth[name], rel=0.05), name
    errors = {
        name: [each.measures for each in result.qualities if each.channel == name]
        for name in ("rectified_current", "shaft_speed")
    }
    assert max(each.rmse for each in errors["rectified_current"]) < 1.1 * 0.005
    assert max(each.nrmse for each in errors["shaft_speed"]) < 0.05
    assert not result.doubts


@pytest.mark.slow
def test_a_current_that_is_not_fitted_is_named_with_what_does(winch) -> None:
    _, tests = winch
    found = guess_drive([each for each in tests if each.name != "sine"])
    found = found._replace(amplifier=None)
    start = guessed_set(found, "campaign.toml")
    motion = whole_drive(start).model_copy(update={"channels": ("shaft_speed",)})
    doubts = fit(start, tests, motion, max_evaluations=1).doubts
    (said,) = [each for each in doubts if "leaves it out" in each]
    assert "'rectified_current' is measured" in said
    assert "leave out --setup" in said
    hoist = Drive.preset("hoist")
    doubts = fit(hoist, tests, whole_drive(hoist.parameters), max_evaluations=1).doubts
    assert not [each for each in doubts if "leaves it out" in each]


def test_a_gross_spike_of_the_current_is_refused_with_the_line_that_leaves_it_out(winch) -> None:
    _, tests = winch
    clamp = tests[0]["rectified_current"]
    values = clamp.values.copy()
    values[900:902] = 9.9
    channels = {**tests[0].channels, clamp.name: replace(clamp, values=values)}
    spoilt = [replace(tests[0], channels=channels), *tests[1:]]
    with pytest.raises(InputError, match=r"ramp up: 'rectified_current' .* from = 4\.4975, to = 4"):
        guess_drive(spoilt)


@pytest.mark.slow
def test_parameters_without_a_value_are_named_with_what_to_do(winch) -> None:
    """No test of the winch opens the relief valve."""
    _, tests = winch
    free = {"Z10": Free(relative=(0.5, 2.0)), "Z15": Free(relative=(0.9, 1.1))}
    setup = FitSetup(part="pump", channels=("shaft_speed",), free=free)
    found = fit(Drive.preset("hoist"), tests[2:4], setup)
    (said,) = [each for each in found.sentences if each.startswith("Not estimated")]
    assert "Z15" in said
    assert "Z10" not in said
    assert "swashplate advise" in said
