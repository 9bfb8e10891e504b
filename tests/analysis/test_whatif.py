import numpy as np
import pytest

from swashplate import InputError, ParameterError, maneuvers
from swashplate.analysis.outcomes import trial
from swashplate.analysis.whatif import AS_IS, CHANGED, what_if

BOTH = {"orifice": 1.5, "pump": 1.5}


def test_figure_9_1(hoist):
    """The source's extrapolation: orifice and pump flow 50 % up, a sine of 9 V and 0.1 Hz."""
    task = trial(hoist, maneuvers.sine(9.0, 0.1).sample())
    result = what_if(hoist, BOTH, task)
    assert np.degrees(result.before.speed_limits) == pytest.approx([196.0, -185.0], abs=0.05)
    assert np.degrees(result.after.speed_limits) == pytest.approx([294.0, -277.5], abs=0.05)
    speed = np.degrees(result.after.run.shaft_speed)
    assert speed.max() == pytest.approx(294.0, abs=0.05)
    assert speed.min() == pytest.approx(-277.5, abs=0.05)


def test_the_acceleration_limit_goes_with_both(hoist):
    """Z10 Z16 stand in the closed form of the limit: 2.25 times as much."""
    task = trial(hoist, maneuvers.step(9.0).sample())
    result = what_if(hoist, BOTH, task, outcomes=["largest_acceleration", "final_speed"])
    ratio = result.after.values / result.before.values
    assert ratio == pytest.approx([2.25, 1.5], rel=5e-3)
    assert list(result.variants) == [AS_IS, "orifice x 1.5", "pump x 1.5", CHANGED]
    alone = [result.variants[name].values for name in ("orifice x 1.5", "pump x 1.5")]
    assert alone[0] / result.before.values == pytest.approx([1.5, 1.0], rel=5e-3)
    assert alone[1] / result.before.values == pytest.approx([1.5, 1.5], rel=5e-3)


def test_a_larger_pump_misses_the_speed_that_the_old_one_was_asked_for(hoist):
    """The wanted speed stays that of the drive as it is."""
    task = trial(hoist, maneuvers.step(5.0).sample())
    result = what_if(hoist, {"pump": 1.2}, task, outcomes=["tracking_error"])
    assert result.after.values[0] > result.before.values[0]
    assert list(result.variants) == [AS_IS, CHANGED]


def test_a_compensated_dead_zone_answers_a_small_command(hoist):
    slew = hoist.preset("slew")
    task = trial(slew, maneuvers.step(0.08).sample())
    result = what_if(slew, {"dead_zone": 0.0}, task, outcomes=["final_speed", "rise_time"])
    assert result.before.values[0] == 0.0
    assert result.after.values[0] > 0.0
    (sentence,) = result.sentences()
    assert sentence.startswith("as it is: no rise_time, the shaft stands still")


def test_refusals(hoist):
    task = trial(hoist, maneuvers.step(9.0).sample())
    with pytest.raises(InputError, match="at least one lever"):
        what_if(hoist, {}, task)
    with pytest.raises(ParameterError, match="Z10"):
        what_if(hoist, {"pump": 0.0}, task)
