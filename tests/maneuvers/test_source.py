import numpy as np
import pytest

from swashplate import maneuvers


def test_hoist_has_the_thirteen_runs_of_the_source():
    runs = maneuvers.source_tests("hoist")
    sizes = {name: run.sample().size for name, run in runs.items()}
    assert sizes == {
        "ramp +1 V/s": 6657,
        "ramp -1 V/s": 6657,
        "step +4 V": 5121,
        "step -4 V": 5121,
        "step +6.5 V": 5121,
        "step -6.5 V": 5121,
        "step +9 V": 5121,
        "step -9 V": 5121,
        "sine 4 V 0.1 Hz": 15361,
        "sine 6.5 V 0.1 Hz": 15361,
        "sine 9 V 0.1 Hz": 15361,
        "sine 6.5 V 0.3 Hz": 10241,
        "sine 9 V 0.3 Hz": 10241,
    }
    assert sum(sizes.values()) == 110_605
    assert all(run.name == name for name, run in runs.items())


def test_slew_and_luff_have_the_runs_of_the_source():
    lengths = {
        axis: {name: run.length for name, run in maneuvers.source_tests(axis).items()}
        for axis in ("slew", "luff")
    }
    assert lengths["slew"] == {
        "ramp +1 V/s": 13.0,
        "step +2 V": 10.0,
        "sine 4 V 0.05 Hz": 40.0,
        "sine 4 V 0.1 Hz": 30.0,
        "sine 6 V 0.05 Hz": 40.0,
    }
    assert lengths["luff"] == {
        "ramp +1 V/s": 13.0,
        "step +4 V": 10.0,
        "step +6.5 V": 10.0,
        "step +9 V": 10.0,
        "sine 4 V 0.1 Hz": 30.0,
        "sine 6.5 V 0.1 Hz": 30.0,
        "sine 9 V 0.05 Hz": 40.0,
    }


def test_source_tests_are_what_their_names_say():
    hoist, slew = maneuvers.source_tests("hoist"), maneuvers.source_tests("slew")
    assert hoist["step -6.5 V"](3.0) == -6.5
    assert hoist["ramp -1 V/s"](10.5) == -9.5
    assert hoist["sine 9 V 0.3 Hz"](1.0 + 0.25 / 0.3) == pytest.approx(9.0)
    # The return of slewing takes 4.5 s: the ramp comes to 7.5 V before it.
    assert slew["ramp +1 V/s"](8.5) == 7.5
    assert slew["ramp +1 V/s"](10.75) == pytest.approx(7.5 / 2 + 4.5 / 8, rel=1e-14)
    assert slew["step +2 V"](3.0) == 2.0


@pytest.mark.parametrize("axis", ["hoist", "slew", "luff"])
def test_source_tests_begin_and_end_at_rest_within_ten_volts(axis):
    for run in maneuvers.source_tests(axis).values():
        voltage = run.sample()
        assert not voltage[:512].any()
        assert voltage[-1] == 0.0
        assert np.abs(voltage).max() <= 10.0
