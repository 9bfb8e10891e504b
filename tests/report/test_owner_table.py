"""The owner's numbers: intervals where the tests tell, one end or none where they do not."""

from collections.abc import Sequence
from dataclasses import replace
from math import inf, sqrt
from pathlib import Path

import numpy as np
import pytest
from tests.identification.given import run_of

from swashplate import Drive, Experiment, maneuvers
from swashplate.analysis import envelope, key_numbers
from swashplate.analysis.propagation import spread_of
from swashplate.drafting import guess_drive, guessed_set
from swashplate.identification import (
    Fit,
    Prior,
    assess_fit,
    fit,
    identifiability_of,
    predict,
    whole_drive,
)
from swashplate.identification.estimation.setup import Free

NEUTRAL = Drive.preset("neutral")
OPENING = 6e-5
"""Of the winch's orifices: about a sixth of what a step to 8 V asks for. [m]"""
WINCH = NEUTRAL.replace(V_dz=(0.8, 0.6), tau=0.04, Z8=1.4e6, Z16=(OPENING, OPENING))
"""No stop within ±10 V; a lag of 0.15 s, accelerations limited both ways."""
WAYS = ("plus", "minus")


def measured(drive: Drive) -> list[Experiment]:
    """Steps and a sine, read by a tacho with a noise of 0.02 rad/s."""
    random, runs = np.random.default_rng(3), list[Experiment]()
    plus, minus = 8.0, 7.0
    commands = {
        "up": maneuvers.step(plus, start=0.5, stop=2.5, length=4.0),
        "down": maneuvers.step(-minus, start=0.5, stop=2.5, length=4.0),
        "half up": maneuvers.step(0.5 * plus, start=0.5, stop=2.5, length=4.0),
        "half down": maneuvers.step(-0.5 * minus, start=0.5, stop=2.5, length=4.0),
        "sine": maneuvers.sine(minus, 0.3, start=0.5, length=6.0),
    }
    for name, maneuver in commands.items():
        command = maneuver.sample()
        speed = drive.simulate(command).shaft_speed
        speed = speed + 0.02 * random.standard_normal(speed.size)
        runs.append(run_of(name, command, {"shaft_speed": speed}))
    return runs


FAST = 100.0
"""Rate of a current that rises at once, in A/s."""


def fitted(
    runs: Sequence[Experiment],
    *,
    orifice_minus: bool = True,
    dead_zone_minus: tuple[float, float] | None = None,
    behind: bool = True,
) -> Fit:
    """The fit of every number of a guess; no orifice, or bounds of the dead zone in V, one way.

    Not `behind`: the current is known to rise at once, so that no dead zone lies behind a ramp.
    """
    guess = guess_drive(runs)
    if dead_zone_minus is not None:
        # a search begins within its bounds
        guess = guess._replace(dead_zone=(guess.dead_zone[0], sum(dead_zone_minus) / 2.0))
    start = guessed_set(guess, "campaign.toml")
    if not behind:
        start = start.replace({"lim1": FAST, "lim2": FAST, "I_t1": 0.0, "I_t2": 0.0})
    setup = whole_drive(start)
    free = dict(setup.free)
    if not orifice_minus:
        free["Z16_plus"] = free.pop("Z16")
        start = start.replace({"Z16_minus": inf})
    if dead_zone_minus is not None:
        free["V_dz_plus"] = free.pop("V_dz")
        wide = Prior(sum(dead_zone_minus) / 2.0, 10.0)
        free["V_dz_minus"] = Free(bounds=dead_zone_minus, prior=wide)
    return fit(start, runs, setup.model_copy(update={"free": free}), threads=1)


def texts(result: Fit) -> dict[str, str]:
    """Each number as it is shown, in SI, by its name with the direction."""
    return {number.label: number.text() for number in key_numbers(result).numbers}


def with_tests(drive: Drive) -> Drive:
    """A drive that knows how far its tests went."""
    return Drive(replace(drive.parameters, tested=(8.0, 7.0)))


@pytest.fixture(scope="module")
def runs() -> list[Experiment]:
    return measured(WINCH)


@pytest.fixture(scope="module")
def found(runs: list[Experiment]) -> Fit:
    return fitted(runs)


@pytest.mark.slow
def test_numbers_of_what_was_tested_hold(found: Fit) -> None:
    numbers, truth = key_numbers(found), key_numbers(with_tests(WINCH))
    assert numbers.commands == truth.commands == (8.0, 7.0)
    for number in numbers.numbers:
        low, high = number.interval
        if number.name in ("jump", "creep"):  # the winch has none
            # a jump may stand for a part of the dead zone, but is not told from none
            none = number.unseen or number.note == "not seen" or low == 0.0 or high == 0.0
            assert none, number.label
            assert abs(number.value or 0.0) < 0.01 * float(WINCH.steady_speed(8.0))
            continue
        assert low is not None
        assert high is not None
        # 1.5 times the interval: twelve of them at 95 % each
        slack, true = 0.25 * (high - low), truth[number.label].value
        assert low - slack <= true <= high + slack, number.label


@pytest.mark.slow
def test_the_top_speed_is_that_of_the_largest_command_that_was_tested(found: Fit) -> None:
    """Of a stick that ends there, one at 10 V would be nobody's."""
    numbers = key_numbers(found)
    for way, volts in zip(WAYS, (8.0, -7.0), strict=True):
        low, high = numbers[f"top_speed_{way}"].interval
        seen = float(WINCH.steady_speed(volts))
        slack = 0.25 * (high - low)
        assert low - slack <= seen <= high + slack
    assert "steps from rest to 8 and -7 V" in " ".join(numbers.sentences)


@pytest.mark.slow
def test_an_orifice_that_the_fit_does_not_look_for_leaves_no_interval(
    runs: list[Experiment],
) -> None:
    """A lag stands for it, and the lag is the same both ways."""
    result = fitted(runs, orifice_minus=False)
    numbers = key_numbers(result)
    doubtful = [
        "acceleration_minus",
        *(f"{name}_{way}" for name in ("delay", "lag") for way in WAYS),
    ]
    for label in doubtful:
        assert numbers[label].interval == (None, None)
        assert "Z16_minus fixed" in texts(result)[label]
    # ramp and bend make up for it as far as they may. The dead zone that results is false, and no
    # interval covers a limit that the model lacks, but the fit says so
    assert identifiability_of(result).at_bounds
    assert any("not like" in doubt for doubt in result.doubts)


@pytest.mark.slow
@pytest.mark.parametrize("bounds", [(0.0, 0.4), (0.75, 2.0)])
def test_an_estimate_at_its_bound_keeps_its_interval_and_is_named(
    runs: list[Experiment], bounds: tuple[float, float]
) -> None:
    """A dead zone of 0.6 V that the search was not allowed, and what it decides."""
    result = fitted(runs, dead_zone_minus=bounds, behind=False)
    assert "V_dz_minus" in identifiability_of(result).at_bounds
    numbers = key_numbers(result)
    for number in numbers.numbers:
        assert number.name in ("jump", "creep") or None not in number.interval, number.label
    assert numbers["dead_zone_minus"].note == "V_dz_minus at its bound"
    assert texts(result)["dead_zone_minus"].endswith(" *")
    assert any("V_dz_minus" in sentence for sentence in numbers.basis)
    # its error is at most what a uniform distribution between the bounds has
    low, high = numbers["dead_zone_minus"].interval
    assert high - low <= 2.0 * 1.96 * (bounds[1] - bounds[0]) / sqrt(12.0)
    # the other way has lag and ramp in common with this one, but holds
    assert numbers["top_speed_plus"].note == numbers["acceleration_plus"].note == ""
    low, high = numbers["dead_zone_plus"].interval
    assert low <= 0.8 <= high


@pytest.mark.slow
def test_a_dead_zone_is_known_beside_a_jump_that_makes_up_for_it_at_first(
    runs: list[Experiment],
) -> None:
    """A profile ends where no derivative says so, and the dead zone's spread is the profile's."""
    found = fitted(runs, behind=False)

    def dead_zones(drive: Drive) -> np.ndarray:
        return np.array([drive.parameters.numbers[f"V_dz_{way}"] for way in WAYS])

    spread = spread_of(found, dead_zones)
    for way, half in zip(WAYS, spread.half, strict=True):
        estimate = found[f"V_dz_{way}"]
        low, high = estimate.interval
        # to first order, where the interval is that of the logarithm
        assert half == pytest.approx(max(high - estimate.value, estimate.value - low), rel=0.2)
        assert half < 0.3 * estimate.value
        assert abs({"plus": 0.8, "minus": 0.6}[way] - estimate.value) < half
    assert not spread.below.any()
    assert not spread.above.any()


@pytest.mark.slow
def test_a_way_that_no_run_goes_has_no_interval(runs: list[Experiment]) -> None:
    shown = texts(fitted([run for run in runs if "up" in run.name]))
    assert "±" in shown["lag_plus"]
    for name in ("dead_zone", "gain", "top_speed", "acceleration", "delay", "lag"):
        assert shown[f"{name}_minus"].endswith("(not tested)")


@pytest.mark.slow
def test_a_limit_that_the_model_has_not_is_not_called_unreached(found: Fit) -> None:
    said = assess_fit(found, predict(found.parameters, found.runs)).validity
    reached, _, lacking = said.partition("not in the model")
    assert "Z14" in lacking
    assert "Z15" in lacking
    assert "Z14" not in reached
    assert "Z15" not in reached
    # the stops are in the model, which no run reached
    assert "Z13" in reached


@pytest.mark.slow
def test_what_a_guess_did_not_see_is_looked_for(runs: list[Experiment], tmp_path: Path) -> None:
    guess = guess_drive(runs)._replace(top_speed=(inf, 6.4), acceleration=(inf, 20.0))
    start = guessed_set(guess, "campaign.toml")
    assert start.unreached.keys() == {"Z13_plus", "Z16_plus"}
    assert {"Z13", "Z16"} <= whole_drive(start).free.keys()
    # where it starts the limits act under the largest command
    run = Drive(start).simulate(maneuvers.step(8.0))
    assert run.active("swash_stop").any()
    assert run.active("orifice").any()
    numbers = key_numbers(Drive(start))
    assert numbers["top_speed_plus"].text().startswith("at least")
    assert numbers["top_speed_plus"].text().endswith("not seen")
    assert numbers["acceleration_plus"].text() == "not seen"
    assert numbers["top_speed_minus"].note == numbers["acceleration_minus"].note == ""

    Drive(start).to_toml(tmp_path / "start.toml")
    again = Drive.from_toml(tmp_path / "start.toml")
    assert again.parameters == start
    shown = str(envelope(again).table())
    (speed,) = (line for line in shown.splitlines() if line.startswith("top speed"))
    assert speed.count("at least") == 1
    (pull,) = (line for line in shown.splitlines() if line.startswith("acceleration at"))
    assert pull.count("not seen") == 1
    # who gives a number knows it
    given = again.replace(Z13_plus=0.2, Z16_plus=1e-4)
    assert not given.parameters.unreached
    assert "not seen" not in str(envelope(given).table())
