"""Input records: stamps, interpolation, and what is refused."""

import numpy as np
import pytest

from swashplate import Drive, InputError


def test_stamps_need_a_choice_of_interpolation(hoist: Drive) -> None:
    with pytest.raises(InputError, match="interpolation='previous'"):
        hoist.simulate([0.0, 1.0], time=[0.0, 1.0])


def test_held_between_stamps(hoist: Drive) -> None:
    run = hoist.simulate([0.0, 3.0, -2.0], time=[1.0, 1.3, 2.0], interpolation="previous", rate=100)
    assert run.time[0] == 1.0
    assert run.time[-1] == pytest.approx(2.0)
    assert list(np.unique(run.voltage)) == [-2.0, 0.0, 3.0]
    assert run.voltage[29] == 0.0
    assert run.voltage[30] == 3.0  # a stamp counts from the sample that it falls on
    assert run.voltage[99] == 3.0
    assert run.voltage[100] == -2.0


def test_straight_lines_between_stamps(hoist: Drive) -> None:
    run = hoist.simulate([0.0, 3.0], time=[0.0, 1.5], interpolation="linear", rate=10.0)
    np.testing.assert_allclose(run.voltage, np.arange(16) * 0.2, atol=1e-12)


def test_uniform_stamps_are_the_same_as_a_rate(hoist: Drive) -> None:
    voltage = 3.0 * np.sin(np.arange(600) / 60.0)
    plain = hoist.simulate(voltage)
    stamped = hoist.simulate(voltage, time=np.arange(600) / 512.0, interpolation="previous")
    assert np.array_equal(plain.shaft_speed, stamped.shaft_speed)


@pytest.mark.parametrize(
    ("voltage", "options", "sentence"),
    [
        ([], {}, "The voltage is empty"),
        ([1.0, np.nan, 2.0], {}, "not finite, the first nan at sample 1"),
        ([1.0, np.inf], {}, "not finite, the first inf at sample 1"),
        ([[1.0, 2.0]], {}, "2-dimensional"),
        (["a"], {}, "sequence of real numbers"),
        ([0.0, 10.5], {}, r"10.5 V at 0.00195312 s, but the card takes ±10 V"),
        ([0.0, 1.0], {"time": [0.0], "interpolation": "linear"}, "1 time stamps for 2 samples"),
        ([0.0, 1.0], {"time": [0.0, 0.0], "interpolation": "linear"}, "from 0 s at sample 0 to 0"),
        ([0.0, 1.0], {"time": [1.0, 0.5], "interpolation": "linear"}, "time must increase"),
        ([0.0, 1.0], {"time": [0.0, np.nan], "interpolation": "linear"}, "The time has 1 sample"),
        ([0.0, 1.0], {"interpolation": "cubic"}, "'linear' or 'previous'"),
        ([0.0, 1.0], {"start": "warm"}, "'rest' or 'steady'"),
        ([0.0, 1.0], {"rate": 100.0, "substeps": 3}, "at least 6 are needed"),
    ],
)
def test_bad_records_are_refused_in_a_sentence(
    hoist: Drive, voltage: list, options: dict, sentence: str
) -> None:
    with pytest.raises(InputError, match=sentence):
        hoist.simulate(voltage, **options)


def test_clipping_is_on_request_only(hoist: Drive) -> None:
    run = hoist.simulate([0.0, 12.0, -11.0], clip=True)
    assert list(run.voltage) == [0.0, 10.0, -10.0]


def test_a_result_does_not_change_with_the_users_array(hoist: Drive) -> None:
    voltage = np.full(100, 5.0)
    run = hoist.simulate(voltage)
    voltage[:] = 0.0
    assert run.voltage[50] == 5.0
    with pytest.raises(ValueError, match="read-only"):
        run.shaft_speed[0] = 1.0


def test_single_sample(hoist: Drive) -> None:
    run = hoist.simulate([3.0])
    assert run.shaft_speed.shape == (1,)
    assert run.shaft_position[0] == 0.0


def test_solenoid_overpowering_the_spring_is_an_error() -> None:
    hoist = Drive.preset("hoist")
    assert hoist.simulate_current(np.full(10, 1.3)).shaft_speed.size == 10
    from swashplate import DomainError

    with pytest.raises(DomainError, match="Z5·F/√Z4 reaches .* below 1"):
        hoist.simulate_current(np.full(10, 4.0))


def test_stamps_in_the_wrong_unit_are_not_marched_for_ever(hoist: Drive) -> None:
    with pytest.raises(InputError, match="check the unit of the time"):
        hoist.simulate([0.0, 1.0], time=[0.0, 3.6e6], interpolation="linear")
