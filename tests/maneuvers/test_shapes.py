import pytest

from swashplate import maneuvers


def test_step_is_on_from_its_start_to_before_its_stop():
    voltage = maneuvers.step(9.0).sample()
    assert voltage.shape == (5121,)
    assert (voltage[:512] == 0.0).all()
    assert (voltage[512:3072] == 9.0).all()
    assert (voltage[3072:] == 0.0).all()


def test_step_to_the_end_is_off_at_the_last_sample():
    voltage = maneuvers.step(2.0, start=0.0, stop=1.0, length=1.0).sample(4.0)
    assert voltage.tolist() == [2.0, 2.0, 2.0, 2.0, 0.0]


def test_ramp_climbs_until_the_return_cuts_it_short():
    m = maneuvers.ramp(1.0, length=13.0)
    assert m([0.0, 1.0, 3.0, 10.5]).tolist() == [0.0, 0.0, 2.0, 9.5]
    assert m.slope([0.5, 1.0, 5.0]).tolist() == [0.0, 1.0, 1.0]
    # Half way home: half of 9.5 V, and 1/8 of 2.5 s times 1 V/s.
    assert m(11.75) == pytest.approx(9.5 / 2 + 2.5 / 8, rel=1e-14)
    assert m.sample().size == 6657


def test_ramp_stays_at_its_limit():
    m = maneuvers.ramp(-4.0, limit=6.0, length=10.0)
    assert m([2.0, 2.5, 7.5]).tolist() == [-4.0, -6.0, -6.0]
    assert m.slope([2.0, 2.5, 7.5]).tolist() == [-4.0, 0.0, 0.0]


def test_ramp_that_just_reaches_its_limit_does_not_leave_it_in_the_return():
    m = maneuvers.ramp(2.0, limit=8.0, start=0.0, settle=1.0, length=5.0)
    assert m(4.0) == 8.0
    assert m.slope(4.0) == 0.0
    m = maneuvers.ramp(2.0, limit=8.5, start=0.0, settle=1.0, length=5.0)
    assert m.slope(4.0) == 2.0


def test_ramp_without_slope_rests():
    assert not maneuvers.ramp(0.0).sample().any()


def test_stairs_hold_each_level_and_need_no_return_from_zero():
    m = maneuvers.stairs([2, 4, 6, 4, 2, 0], dwell=2.0)
    assert m.length == 13.0
    assert m.sample(1.0).tolist() == [0, 2, 2, 4, 4, 6, 6, 4, 4, 2, 2, 0, 0, 0]


def test_stairs_return_from_a_last_level():
    m = maneuvers.stairs([2, 4], dwell=1.0, settle=2.0)
    assert m.length == 5.0
    assert m.sample(1.0).tolist() == [0.0, 2.0, 4.0, 4.0, 2.0, 0.0]


@pytest.mark.parametrize("settle", [None, 0, 0.0])
def test_without_settle_nothing_returns(settle):
    assert maneuvers.stairs([2, 4], dwell=1.0, settle=settle).sample(1.0).tolist() == [0, 2, 4, 4]
    # 2.75 periods of 0.1 Hz after 1 s: the trough, at which this one ends.
    sine = maneuvers.sine(3.0, 0.1, settle=settle, length=28.5)
    assert sine(28.5) == pytest.approx(-3.0, rel=1e-14)
