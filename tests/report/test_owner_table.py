"""The owner's numbers: intervals where the tests tell, one end or none where they do not."""

import tomllib
from collections.abc import Mapping, Sequence
from math import inf
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest
from tests.identification.given import run_of

from swashplate import Drive, Experiment, maneuvers
from swashplate.analysis import envelope, standard_errors, variances_from_bounds
from swashplate.drafting import guess_drive, guess_table, guessed_fit_setup, guessed_set
from swashplate.identification import Fit, FitSetup, assess_fit, fit, identifiability_of, predict
from swashplate.identification.estimation.setup import Free
from swashplate.report.fit_report.summary import largest_commands, machine_numbers_of, numbers_table
from swashplate.tables import Cell

NEUTRAL = Drive.preset("neutral")
OPENING = 6e-5
"""Of the winch's orifices: about a sixth of what a step to 8 V asks for. [m]"""
WINCH = NEUTRAL.replace(V_dz=(0.8, 0.6), tau=0.04, Z8=1.4e6, Z16=(OPENING, OPENING))
"""No stop within ±10 V; a lag of 0.15 s, accelerations limited both ways."""
ROWS = {"dead zone": 0, "top speed": 1, "acceleration": 2, "delay": 3, "lag": 4, "creep": 5}


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


def fitted(
    runs: Sequence[Experiment],
    without: Sequence[str] = (),
    bounds: Mapping[str, tuple[float, float]] = MappingProxyType({}),
) -> Fit:
    """The fit of a guess, by its fit setup without some parameters or with other bounds."""
    guess = guess_drive(runs)
    start = guessed_set(guess, "campaign.toml")
    setup = FitSetup(**tomllib.loads(guessed_fit_setup(guess, start)))
    (stage,) = setup.stages
    free = {name: entry for name, entry in stage.free.items() if name not in without}
    free |= {name: Free(bounds=pair) for name, pair in bounds.items()}
    setup = setup.model_copy(update={"stages": (stage.model_copy(update={"free": free}),)})
    if without:
        start = start.replace(dict.fromkeys(without, inf))
    start = start.replace({name: sum(pair) / 2.0 for name, pair in bounds.items()})
    return fit(start, runs, setup, threads=1)


def cells(result: Fit) -> list[list[str]]:
    """Texts of the table, positive and negative, by its rows."""
    table, _ = numbers_table(result.drive, result.stages)
    return [
        [cell.text if isinstance(cell, Cell) else str(cell) for cell in row.cells[1:3]]
        for row in table.rows
    ]


def interval(text: str) -> tuple[float, float]:
    value, half = map(float, text.split("±"))
    return value - half, value + half


@pytest.fixture(scope="module")
def runs() -> list[Experiment]:
    return measured(WINCH)


@pytest.fixture(scope="module")
def found(runs: list[Experiment]) -> Fit:
    return fitted(runs)


@pytest.mark.slow
def test_numbers_of_what_was_tested_hold(found: Fit) -> None:
    shown, largest = cells(found), largest_commands(found.stages)
    assert largest == (8.0, 7.0)
    truth = machine_numbers_of(WINCH, largest)
    degrees = {"acceleration": 180.0 / np.pi}
    for name in ("dead zone", "acceleration", "delay", "lag"):
        row = ROWS[name]
        for way in (0, 1):
            low, high = interval(shown[row][way])
            # 1.5 times the interval: eight of them at 95 % each
            slack = 0.25 * (high - low)
            assert low - slack <= degrees.get(name, 1.0) * truth[row, way] <= high + slack, name


@pytest.mark.slow
def test_the_top_speed_is_that_of_the_largest_command_that_was_tested(found: Fit) -> None:
    """Of a stick that ends there, one at 10 V would be nobody's."""
    shown = cells(found)[ROWS["top speed"]]
    for text, volts in zip(shown, (8.0, -7.0), strict=True):
        low, high = interval(text)
        seen = np.degrees(float(WINCH.steady_speed(volts)))
        slack = 0.25 * (high - low)
        assert low - slack <= seen <= high + slack


@pytest.mark.slow
def test_an_orifice_that_the_fit_does_not_look_for_leaves_no_interval(
    runs: list[Experiment],
) -> None:
    """A lag stands for it, and the lag is the same both ways."""
    shown = cells(fitted(runs, without=["Z16_minus"]))
    assert "±" not in shown[ROWS["acceleration"]][1]
    assert "Z16_minus fixed" in shown[ROWS["acceleration"]][1]
    for name in ("delay", "lag"):
        assert not any("±" in text for text in shown[ROWS[name]])
    # the gain bends to make up for it, with some processors' last digits as far as it may: the dead
    # zone is then 1.0 V, not 0.6, so that an interval, if one is printed, must hold the truth
    negative = shown[ROWS["dead zone"]][1].replace("\N{MINUS SIGN}", "-")
    if "±" in negative:
        value, half = map(float, negative.split(" ± "))
        assert abs(abs(value) - 0.6) <= half
    assert "±" in shown[ROWS["dead zone"]][0]


@pytest.mark.slow
@pytest.mark.parametrize("bounds", [(0.0, 0.4), (0.75, 2.0)])
def test_an_estimate_at_its_bound_gives_no_interval(
    runs: list[Experiment], bounds: tuple[float, float]
) -> None:
    """A dead zone of 0.6 V that the search was not allowed, and what it decides."""
    result = fitted(runs, bounds={"V_dz_minus": bounds})
    (stage,) = result.stages
    assert "V_dz_minus" in identifiability_of(stage).at_bounds
    shown = cells(result)
    assert "±" not in shown[ROWS["dead zone"]][1]
    assert "V_dz_minus" in shown[ROWS["dead zone"]][1]
    assert "bound" in shown[ROWS["dead zone"]][1]
    # what it does not decide has its interval
    assert "±" in shown[ROWS["dead zone"]][0]
    assert "±" in shown[ROWS["acceleration"]][0]
    # by how much the others follow it is the covariance's: all of its own variance
    variances = variances_from_bounds(
        result.stages, lambda one: machine_numbers_of(one, (8.0, 7.0))
    )
    whole = standard_errors(result.stages, lambda one: machine_numbers_of(one, (8.0, 7.0))) ** 2
    share = variances["V_dz_minus"] / np.where(whole > 0.0, whole, inf)
    assert share[ROWS["dead zone"], 1] == pytest.approx(1.0, rel=0.02)
    assert share[ROWS["dead zone"], 0] < 0.1
    assert (share < 1.02).all()


@pytest.mark.slow
def test_a_way_that_no_run_goes_has_no_interval(runs: list[Experiment]) -> None:
    shown = cells(fitted([run for run in runs if "up" in run.name]))
    assert "±" in shown[ROWS["lag"]][0]
    for name in ("dead zone", "top speed", "acceleration", "delay", "lag"):
        assert shown[ROWS[name]][1].endswith("(not tested)")


@pytest.mark.slow
def test_a_limit_that_the_model_has_not_is_not_called_unreached(found: Fit) -> None:
    said = assess_fit(found.stages, predict(found.parameters, found.runs)).validity
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
    setup = FitSetup(**tomllib.loads(guessed_fit_setup(guess, start)))
    assert {"Z13_plus", "Z16_plus"} <= setup.stages[0].free.keys()
    # where it starts the limits act under the largest command
    run = Drive(start).simulate(maneuvers.step(8.0))
    assert run.active("swash_stop").any()
    assert run.active("orifice").any()
    table = str(guess_table(guess))
    (top,) = (line for line in table.splitlines() if line.startswith("top speed"))
    assert "at least" in top
    assert top.count("not seen") == 1

    Drive(start).to_toml(tmp_path / "start.toml")
    again = Drive.from_toml(tmp_path / "start.toml")
    assert again.parameters == start
    shown = str(envelope(again).table())
    (speed,) = (line for line in shown.splitlines() if line.startswith("speed at full"))
    assert speed.count("at least") == 1
    (pull,) = (line for line in shown.splitlines() if line.startswith("acceleration at"))
    assert pull.count("not seen") == 1
    # who gives a number knows it
    given = again.replace(Z13_plus=0.2, Z16_plus=1e-4)
    assert not given.parameters.unreached
    assert "not seen" not in str(envelope(given).table())
