"""The stepper's own manners; its numbers are in test_agreement."""

import pytest

from swashplate import Drive, InputError


def test_bad_command_leaves_the_state(hoist: Drive) -> None:
    stepper = hoist.stepper()
    stepper.step(1.0)
    before = stepper.state
    for bad in (10.1, float("nan"), float("-inf")):
        with pytest.raises(InputError, match="must be a finite number within ±10"):
            stepper.step(bad)
    assert stepper.state.last == before.last
    assert (stepper.state.machine.states == before.machine.states).all()
    assert (stepper.state.machine.lines == before.machine.lines).all()


def test_state_of_another_rate_is_refused(hoist: Drive) -> None:
    with pytest.raises(InputError, match="of another model, delay or rate"):
        hoist.stepper(1e-3).state = hoist.stepper(1e-4).state


@pytest.mark.parametrize("h", [0.0, -1.0, float("nan"), 1.0, 1e-6])
def test_bad_intervals_are_refused(hoist: Drive, h: float) -> None:
    with pytest.raises(InputError):
        hoist.stepper(h)


def test_steady_start_stays_steady(axis: Drive) -> None:
    stepper = axis.stepper(start="steady")
    samples = [stepper.step(3.0) for _ in range(500)]
    for sample in (samples[0], samples[-1]):
        assert sample.shaft_speed == pytest.approx(axis.steady_speed(3.0), rel=1e-9)
        assert sample.current == pytest.approx(axis.steady_current(3.0), rel=1e-12)
