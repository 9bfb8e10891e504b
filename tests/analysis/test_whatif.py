"""Levers, outcomes of a command, before and after, and sensitivities."""

import numpy as np
import pytest

from swashplate import Drive, InputError, ParameterError, maneuvers
from swashplate.analysis import (
    AS_IS,
    CHANGED,
    DESIGN_VARIABLES,
    Trial,
    find_outcomes,
    one_at_a_time,
    outcome_matrix,
    powers_of,
    proportional_speed,
    speed_per_volt,
    trial_of,
    what_if,
    with_factors,
)

RATE = 10.0
TIME = np.arange(41) / RATE
VOLTAGE = np.where((TIME > 0.95) & (TIME < 3.05), 5.0, 0.0)
TRIAL = Trial(VOLTAGE, RATE, np.where(VOLTAGE > 0.0, 8.0, 0.0))
RAMP = np.clip(10.0 * (TIME - 0.9), 0.0, 10.0)
"""From 0.9 s, the last sample before the command, 10 rad/s² up to 10 rad/s; never down again."""


@pytest.fixture(scope="module")
def task(hoist: Drive) -> Trial:
    return trial_of(hoist, maneuvers.step(9.0, stop=4.0, length=5.0).sample())


# --- design variables -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("factors", "expected"),
    [
        ({"orifice": 1.5}, {"Z16_plus": 1.74510e-4, "Z16_minus": 2.26890e-4}),
        ({"orifice": 1.5, "orifice_plus": 2.0}, {"Z16_plus": 3.4902e-4, "Z16_minus": 2.26890e-4}),
        # an area goes with the square of its diameter
        ({"orifice_diameter": 1.2}, {"Z16_plus": 1.675296e-4, "Z16_minus": 2.178144e-4}),
        # Z12 holds the pump's displacement as Z10 does
        ({"pump": 1.5, "drive_speed": 0.8}, {"Z10": 14.8752, "Z12": 0.24}),
        ({"dead_zone": 0.0}, {"V_dz_plus": 0.0, "V_dz_minus": 0.0}),
        ({"rate_limit_up": np.inf}, {"lim1_plus": np.inf, "lim1_minus": np.inf}),
        ({"relief": 2.0}, {"Z15": 8.2382e6}),
        ({"Z9": 1.1}, {"Z9": 1.18173e7}),
        ({"Z16_minus": 2.0}, {"Z16_minus": 3.0252e-4}),
        (dict.fromkeys(DESIGN_VARIABLES, 1.0), {}),
    ],
)
def test_what_a_lever_multiplies(hoist, factors, expected):
    drive = hoist.replace(Z11=0.1, Z12=0.2)
    before, numbers = drive.parameters.numbers, with_factors(drive, factors).parameters.numbers
    assert {name: numbers[name] for name in expected} == pytest.approx(expected, rel=1e-12)
    assert all(numbers[name] == before[name] for name in set(before) - set(expected))


# --- outcomes -------------------------------------------------------------------------------------


def of(speed: np.ndarray, name: str, task: Trial = TRIAL) -> float:
    return float(outcome_matrix(speed[None, :], task, find_outcomes([name]))[0, 0])


@pytest.mark.parametrize(
    ("name", "expected", "signed"),
    [
        ("final_speed", 10.0, True),
        ("peak_speed", 10.0, False),
        ("rise_time", 0.8, False),
        ("response_time", 0.9, False),
        ("largest_acceleration", 10.0, False),
        ("overshoot", 0.0, False),
        ("creep", 0.0, True),
        ("travel", 26.0, True),  # half of 1 s at 10 rad/s, then 2.1 s of it
    ],
)
def test_a_ramp_by_hand(name, expected, signed):
    assert of(RAMP, name) == pytest.approx(expected, abs=1e-9)
    assert of(-RAMP, name) == pytest.approx(-expected if signed else expected, abs=1e-9)


def test_other_outcomes_by_hand():
    beyond = RAMP.copy()
    beyond[20] = 12.0
    assert of(beyond, "overshoot") == pytest.approx(0.2)
    assert of(-beyond, "overshoot") == pytest.approx(0.2)
    assert of(TRIAL.reference + 3.0, "tracking_error") == pytest.approx(3.0)
    assert of(RAMP + 0.5, "creep") == 0.5
    at_once = Trial(np.where(TIME > 0.05, 5.0, 0.0), RATE, TRIAL.reference)
    assert np.isnan(of(RAMP + 0.5, "creep", at_once))
    still = np.zeros_like(TIME)
    assert of(still, "final_speed") == 0.0
    assert all(np.isnan(of(still, name)) for name in ("rise_time", "response_time", "overshoot"))


def test_the_ratio_is_that_of_the_limit_to_the_voltage_that_reaches_it(hoist):
    """Reference numbers of Kruse's drive: 196.0 at 7.87 V and -185.0 at -7.41 V."""
    up, down = 196.0 / 7.87, 185.0 / 7.41
    volts = [-9.0, 0.0, 4.0, 9.0]
    asked = np.degrees(proportional_speed(hoist, volts, limited=False))
    np.testing.assert_allclose(asked, [-9.0 * down, 0.0, 4.0 * up, 9.0 * up], rtol=1e-3)
    reference = np.degrees(proportional_speed(hoist, volts))
    np.testing.assert_allclose(reference, [-185.0, 0.0, 4.0 * up, 196.0], rtol=1e-3)
    wide = hoist.replace(Z13=0.5, Z15=np.inf)  # never saturates
    assert speed_per_volt(wide, 1.0) == pytest.approx(wide.steady_speed(10.0) / 10.0)


def test_a_rise_time_belongs_to_a_command_that_goes_one_way(hoist):
    volts = np.concatenate([np.zeros(512), np.linspace(0.0, 6.0, 512), np.full(1024, 6.0)])
    noisy = volts + 0.05 * np.random.default_rng(2).normal(size=volts.size)
    driver = volts - 4.0 * np.exp(-((np.arange(volts.size) - 900.0) ** 2) / 2e4)
    for command, rises in ((volts, True), (noisy, True), (driver, False)):
        given = trial_of(hoist, command)
        result = what_if(hoist, {"pump": 1.2}, given, outcomes=["rise_time", "response_time"])
        assert np.isfinite(result.before.values).all() == rises
    assert "the command reverses before it gets there" in result.sentences()[0]


# --- before and after -----------------------------------------------------------------------------


def test_the_acceleration_limit_goes_with_both(hoist):
    """Z10 Z16 stand in the closed form of the limit: 2.25 times as much."""
    task = trial_of(hoist, maneuvers.step(9.0).sample())
    factors, names = {"orifice": 1.5, "pump": 1.5}, ["largest_acceleration", "final_speed"]
    found = what_if(hoist, factors, task, outcomes=names).variants
    ratios = {name: each.values / found[AS_IS].values for name, each in found.items()}
    expected = {"orifice x 1.5": [1.5, 1.0], "pump x 1.5": [1.5, 1.5], CHANGED: [2.25, 1.5]}
    assert list(ratios) == [AS_IS, *expected]
    for name, both in expected.items():
        assert ratios[name] == pytest.approx(both, rel=5e-3)


def test_what_is_wanted_and_what_there_is_not(hoist):
    # the reference speed stays that of the drive as it is
    task = trial_of(hoist, maneuvers.step(5.0).sample())
    result = what_if(hoist, {"pump": 1.2}, task, outcomes=["tracking_error"])
    assert result.after.values[0] > result.before.values[0]
    assert list(result.variants) == [AS_IS, CHANGED]
    # a compensated dead zone answers a small command
    slew = Drive.preset("slew")
    task = trial_of(slew, maneuvers.step(0.08).sample())
    result = what_if(slew, {"dead_zone": 0.0}, task, outcomes=["final_speed", "rise_time"])
    assert result.after.values[0] > result.before.values[0] == 0.0
    (sentence,) = result.sentences()
    assert sentence.startswith("as it is: no rise_time, the shaft does not move")


# --- sensitivities --------------------------------------------------------------------------------


def test_the_speed_limit_goes_with_the_pump_alone(hoist, task):
    ranges, final = dict.fromkeys(["orifice", "pump"], (0.9, 1.1)), np.radians(196.0)
    result = one_at_a_time(hoist, ranges, task, outcomes=["final_speed", "creep"])
    assert result.base[0] == pytest.approx(final, rel=1e-4)
    np.testing.assert_allclose(result.low[:, 0], [final, 0.9 * final], rtol=1e-4)
    np.testing.assert_allclose(result.high[:, 0], [final, 1.1 * final], rtol=1e-4)
    np.testing.assert_allclose(result.swings[:, 0], [0.0, 0.2 * final], rtol=1e-4, atol=1e-9)
    assert result.sentences == ()
    # a feedback spring too weak for the solenoid: Z5 F/√Z4 reaches 1
    at_once = trial_of(hoist, maneuvers.step(9.0, start=0.1, stop=1.0, length=2.0).sample())
    result = one_at_a_time(hoist, {"Z4": (0.01, 1.1)}, at_once, outcomes=["final_speed", "creep"])
    assert np.isnan(result.low[0, 0])
    assert np.isfinite(result.high[0, 0])
    assert result.sentences[0].startswith("Z4 x 0.01 cannot be simulated: hoist: ")
    assert result.sentences[1].startswith(
        "all variants: no creep, the command does not stay at 0 V"
    )


def test_a_maneuver_is_a_command(hoist):
    step = maneuvers.step(4.0, start=0.1, stop=1.0, length=2.0)
    sampled = what_if(hoist, {"pump": 1.5}, trial_of(hoist, step.sample(512.0)))
    found = what_if(hoist, {"pump": 1.5}, step)
    assert np.array_equal(found.trial.voltage, step.sample(512.0))
    assert found.summary() == sampled.summary()


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (
            lambda d, t: powers_of("orifise"),
            r"'orifise' .*orifice",
        ),
        (
            lambda d, t: with_factors(d, {"pump": -1.0}),
            "pump .* -1, .* 0",
        ),
        (lambda d, t: with_factors(d, {"pump": float("nan")}), "pump .* nan"),
        (
            lambda d, t: with_factors(d.replace(Z15=np.inf), {"relief": 0.0}),
            "Z15 .* inf, .* 0",
        ),
        (lambda d, t: what_if(d, {}, t), "design variable"),
        (lambda d, t: what_if(d, {"pump": "1.5"}, t), "pump .* '1.5'"),
        (lambda d, t: find_outcomes(["rise_tim"]), r"'rise_tim' .*rise_time"),
        (lambda d, t: trial_of(d, [3.0, 3.0]), "3 V"),
        (lambda d, t: trial_of(d, [0.0, 11.0]), "±10 V"),
        (
            lambda d, t: trial_of(d, [0.0, 1.0, 2.0], reference=[0.0, 1.0]),
            "3 finite numbers",
        ),
        (
            lambda d, t: one_at_a_time(d, {"pump": (2.0, 1.0)}, t, outcomes=["creep"]),
            "pump.* 2 to 1",
        ),
        (lambda d, t: what_if(d, {"pump": 0.0}, t), "Z10"),
    ],
)
def test_refusals(hoist, task, call, said):
    with pytest.raises((InputError, ParameterError), match=said):
        call(hoist, task)
