import numpy as np
import pytest

from swashplate import InputError, maneuvers
from swashplate.analysis import outcomes as outcome_batch
from swashplate.analysis.outcomes import (
    OUTCOMES,
    Trial,
    batch_outcomes,
    find_outcomes,
    outcome_matrix,
    proportional_speed,
    speed_per_volt,
    trial,
)

RATE = 10.0
TIME = np.arange(41) / RATE
VOLTAGE = np.where((TIME > 0.95) & (TIME < 3.05), 5.0, 0.0)
TRIAL = Trial(VOLTAGE, RATE, np.where(VOLTAGE > 0.0, 8.0, 0.0))
RAMP = np.clip(10.0 * (TIME - 0.9), 0.0, 10.0)
"""From 0.9 s, the last sample before the command, 10 rad/s² up to 10 rad/s; never down again."""


def of(speed: np.ndarray, name: str, task: Trial = TRIAL) -> float:
    return float(outcome_matrix(speed[None, :], task, find_outcomes([name]))[0, 0])


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("final_speed", 10.0),
        ("peak_speed", 10.0),
        ("rise_time", 0.8),
        ("response_time", 0.9),
        ("largest_acceleration", 10.0),
        ("overshoot", 0.0),
        ("creep", 0.0),
        # half of 1 s at 10 rad/s, then 2.1 s of it
        ("travel", 26.0),
    ],
)
def test_a_ramp_by_hand(name, expected):
    assert of(RAMP, name) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("name", ["final_speed", "travel", "creep"])
def test_signed_outcomes_turn_round_with_the_speed(name):
    assert of(-RAMP, name) == pytest.approx(-of(RAMP, name), abs=1e-12)


@pytest.mark.parametrize(
    "name", ["peak_speed", "rise_time", "response_time", "largest_acceleration", "overshoot"]
)
def test_sizes_and_times_do_not(name):
    assert of(-RAMP, name) == pytest.approx(of(RAMP, name), abs=1e-12)


def test_overshoot_and_tracking_error_by_hand():
    speed = RAMP.copy()
    speed[20] = 12.0
    assert of(speed, "overshoot") == pytest.approx(0.2)
    offset = TRIAL.wanted + 3.0
    assert of(offset, "tracking_error") == pytest.approx(3.0)


def test_creep_is_seen_only_where_the_command_rests():
    creeping = RAMP + 0.5
    assert of(creeping, "creep") == 0.5
    at_once = Trial(np.where(TIME > 0.05, 5.0, 0.0), RATE, TRIAL.wanted)
    assert np.isnan(of(creeping, "creep", at_once))


def test_a_shaft_that_stands_still_has_no_rise_time():
    still = np.zeros_like(TIME)
    for name in ("rise_time", "response_time", "overshoot"):
        assert np.isnan(of(still, name))
    assert of(still, "final_speed") == 0.0


def test_a_batch_is_what_single_runs_are(hoist, monkeypatch):
    monkeypatch.setattr(outcome_batch, "SAMPLES_AT_ONCE", 8 * 5121)  # two blocks
    task = trial(hoist, maneuvers.step(9.0).sample())
    factors = np.linspace(0.8, 1.2, 11)
    z16 = hoist.parameters.numbers["Z16_plus"] * factors
    chosen = tuple(OUTCOMES.values())
    found = batch_outcomes(hoist, {"Z16_plus": z16}, task, chosen, threads=2)
    for k in (0, 7, 10):
        run = hoist.replace(Z16_plus=float(z16[k])).simulate(task.voltage)
        single = outcome_matrix(run.shaft_speed[None, :], task, chosen)[0]
        # the march side by side agrees to 1e-12; an acceleration is a difference of its speeds
        np.testing.assert_allclose(found.values[k], single, rtol=1e-8, atol=1e-8)
    assert not found.failures
    assert list(found.sentences()) == []


def test_variants_that_cannot_run_and_outcomes_that_are_not(hoist):
    task = trial(hoist, maneuvers.step(9.0, start=0.1, stop=1.0, length=2.0).sample())
    values = np.array([12.0, -1.0])
    found = batch_outcomes(hoist, {"Z10": values}, task, find_outcomes(["creep", "final_speed"]))
    assert list(found.failures) == [1]
    assert "Z10" in found.failures[1]
    assert np.isnan(found.values[1]).all()
    (sentence,) = found.sentences()
    assert sentence == (
        "1 of 2 variants have no creep: the command does not rest at 0 V long enough at its start."
    )


def test_the_ratio_is_that_of_the_limit_to_the_voltage_that_reaches_it(hoist):
    """Reference numbers of the source's drive: 196.0 at 7.87 V and -185.0 at -7.41 V."""
    assert np.degrees(speed_per_volt(hoist, 1.0)) == pytest.approx(196.0 / 7.87, rel=1e-3)
    assert np.degrees(speed_per_volt(hoist, -1.0)) == pytest.approx(185.0 / 7.41, rel=1e-3)
    wanted = np.degrees(proportional_speed(hoist, [-9.0, 0.0, 4.0]))
    expected = [-9.0 * 185.0 / 7.41, 0.0, 4.0 * 196.0 / 7.87]
    np.testing.assert_allclose(wanted, expected, rtol=1e-3)


def test_a_drive_that_never_saturates_goes_by_full_voltage(hoist):
    wide = hoist.replace(Z13=0.5, Z15=np.inf)
    assert speed_per_volt(wide, 1.0) == pytest.approx(wide.steady_speed(10.0) / 10.0)


def test_refusals(hoist):
    with pytest.raises(InputError, match=r"no outcome 'rise_tim' \(did you mean rise_time\?\)"):
        find_outcomes(["rise_tim"])
    with pytest.raises(InputError, match="at least one outcome"):
        find_outcomes([])
    with pytest.raises(InputError, match="stays at 3 V"):
        trial(hoist, [3.0, 3.0])
    with pytest.raises(InputError, match="within ±10 V"):
        trial(hoist, [0.0, 11.0])
    with pytest.raises(InputError, match="must be 3 finite numbers"):
        trial(hoist, [0.0, 1.0, 2.0], wanted=[0.0, 1.0])
