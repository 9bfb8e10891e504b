"""A machine that is late behind its current is found to be, and one that is not is left alone."""

import numpy as np
import pytest
from tests.identification.given import virtual

from swashplate import Drive, identify
from swashplate.identification import fit, whole_drive
from swashplate.identification.lateness import LATE, is_in_question, with_lateness
from swashplate.maneuvers import parse

HOIST = Drive.preset("hoist")
MANEUVERS = [
    *(parse(f"step:{volts},length=6") for volts in (9, -9, 4, -4)),
    parse("sine:6,0.1,length=15"),
    parse("sine:3,0.3,length=10"),
]


def test_it_is_in_question_where_all_is_known_beforehand_and_nobody_stated_it() -> None:
    nominal = HOIST.parameters
    whole = whole_drive(nominal)
    assert is_in_question(whole, nominal)
    assert not is_in_question(with_lateness(whole), nominal)
    stated = nominal.with_numbers({"solenoid_delay": 0.02}, frozenset({"late"}))
    assert not is_in_question(whole, stated)
    assert not is_in_question(whole_drive(nominal, part="pump"), nominal)
    free = with_lateness(whole).free
    assert set(free) == {*whole.free, *LATE}
    assert all(free[name].prior.mean == 0.0 for name in LATE)


@pytest.mark.slow
def test_a_delay_and_a_lag_behind_the_current_are_found(tmp_path) -> None:
    late = Drive(
        HOIST.parameters.with_numbers(
            {"solenoid_delay": 0.04, "solenoid_lag": 0.02},
            HOIST.parameters.options | {"late"},
        )
    )
    campaign = virtual(tmp_path, "hoist", MANEUVERS, truth=late, seed=2)
    result = identify(campaign)
    found = sum(result[name].value for name in LATE)
    assert found == pytest.approx(0.06, abs=0.006)
    assert result.drive.linearize(4.0).delay > 0.03
    command = parse("sine:5,0.4,length=8")
    expected = late.simulate(command).shaft_speed
    error = result.drive.simulate(command).shaft_speed - expected
    assert np.sqrt(np.mean(error**2)) < 0.01 * np.ptp(expected)


@pytest.mark.slow
def test_a_machine_that_is_not_late_has_no_delay(tmp_path) -> None:
    campaign = virtual(tmp_path, "hoist", MANEUVERS, seed=2)
    result = fit(HOIST, campaign, whole_drive(HOIST.parameters))
    assert not set(LATE) & set(result.setup.free)
