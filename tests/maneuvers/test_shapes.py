"""Maneuvers by name: shapes, recordings, Kruse's tests, and the words of the command line."""

import math

import numpy as np
import pytest

from swashplate import InputError, maneuvers


def test_step_is_on_from_its_start_to_before_its_stop():
    voltage = maneuvers.step(9.0).sample()
    assert voltage.shape == (5121,)
    assert (voltage[:512] == 0.0).all()
    assert (voltage[512:3072] == 9.0).all()
    assert (voltage[3072:] == 0.0).all()


def test_ramp_climbs_until_the_return_cuts_it_short():
    m = maneuvers.ramp(1.0, length=13.0)
    assert m([0.0, 1.0, 3.0, 10.5]).tolist() == [0.0, 0.0, 2.0, 9.5]
    # Half way home: half of 9.5 V, and 1/8 of 2.5 s times 1 V/s.
    assert m(11.75) == pytest.approx(9.5 / 2 + 2.5 / 8, rel=1e-14)
    assert m.sample().size == 6657


def test_stairs_hold_each_level_and_need_no_return_from_zero():
    m = maneuvers.stairs([2, 4, 6, 4, 2, 0], dwell=2.0)
    assert m.length == 13.0
    assert m.sample(1.0).tolist() == [0, 2, 2, 4, 4, 6, 6, 4, 4, 2, 2, 0, 0, 0]


def test_sine_starts_at_one_second_and_peaks_a_quarter_period_later():
    m = maneuvers.sine(6.5, 0.1, length=30.0)
    expected = [0.0, 0.0, 6.5, 0.0, -6.5]
    np.testing.assert_allclose(m([0.5, 1.0, 3.5, 6.0, 8.5]), expected, atol=1e-14)
    # The return begins at 27.5 s: 2.65 periods.
    assert m(27.5) == pytest.approx(6.5 * math.sin(math.tau * 2.65), rel=1e-13)


def test_chirp_sweeps_its_frequency_evenly():
    m = maneuvers.chirp(4.0, 0.5, 0.1, start=1.0, settle=2.0, length=23.0)
    # Phase after t seconds, in turns: 0.5 t − 0.01 t²; 4 at 10 s and 6 at 20 s, where it is slow.
    np.testing.assert_allclose(m([1.0, 11.0, 21.0]), [0.0, 0.0, 0.0], atol=1e-13)
    h, expected = 1e-6, 4.0 * math.tau * np.array([0.5, 0.3, 0.1])
    time = np.array([1.0, 11.0, 21.0 - 2.0 * h])
    np.testing.assert_allclose((m(time + h) - m(time)) / h, expected, rtol=1e-4)


def test_multisine_has_the_frequencies_it_was_given_equally_large():
    # 20 s active: 0.25, 0.6 and 1.5 Hz are its lines 5, 12 and 30.
    m = maneuvers.multisine(5.0, [0.25, 0.6, 1.5], settle=2.0, length=23.0)
    spectrum = np.abs(np.fft.rfft(m.sample()[512 : 512 * 21]))
    assert np.flatnonzero(spectrum > 1e-6 * spectrum.max()).tolist() == [5, 12, 30]
    np.testing.assert_allclose(spectrum[[5, 12, 30]], spectrum[5], rtol=1e-10)


def test_multisine_band_is_rounded_to_whole_periods():
    m = maneuvers.multisine(5.0, (0.11, 0.52, 4), settle=2.0, length=23.0)
    # 0.11, 0.2467, 0.3833 and 0.52 Hz make 2.2, 4.93, 7.67 and 10.4 periods in 20 s.
    spectrum = np.abs(np.fft.rfft(m.sample()[512 : 512 * 21]))
    assert np.flatnonzero(spectrum > 1e-6 * spectrum.max()).tolist() == [2, 5, 8, 10]
    assert m(1.0) == pytest.approx(m(21.0), rel=1e-12)


def test_hoist_has_the_thirteen_runs_of_the_source():
    runs = maneuvers.source_tests("hoist")
    steps = [f"step {sign}{volts} V" for volts in ("4", "6.5", "9") for sign in "+-"]
    slow = [f"sine {volts} V 0.1 Hz" for volts in ("4", "6.5", "9")]
    sizes = dict.fromkeys(["ramp +1 V/s", "ramp -1 V/s"], 6657) | dict.fromkeys(steps, 5121)
    sizes |= dict.fromkeys(slow, 15361)
    sizes |= dict.fromkeys(["sine 6.5 V 0.3 Hz", "sine 9 V 0.3 Hz"], 10241)
    assert {name: run.sample().size for name, run in runs.items()} == sizes
    assert all(run.name == name for name, run in runs.items())


def test_source_tests_are_what_their_names_say():
    hoist, slew, luff = map(maneuvers.source_tests, ("hoist", "slew", "luff"))
    assert hoist["step -6.5 V"](3.0) == -6.5
    assert hoist["ramp -1 V/s"](10.5) == -9.5
    assert luff["ramp +1 V/s"](10.5) == 9.5
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


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("rest:2", maneuvers.rest(2.0)),
        ("step:9", maneuvers.step(9.0)),
        ("sine:6.5,0.1", maneuvers.sine(6.5, 0.1)),
        ("sine:6.5, 0.1, length=40", maneuvers.sine(6.5, 0.1, length=40.0)),
        ("ramp:-1", maneuvers.ramp(-1.0)),
        ("ramp:slope=1,limit=5", maneuvers.ramp(1.0, limit=5.0)),
        ("stairs:2/4/6/0,dwell=3", maneuvers.stairs([2, 4, 6, 0], dwell=3.0)),
        ("stairs:2", maneuvers.stairs([2.0])),
        ("chirp:4,5e-2,0.5", maneuvers.chirp(4.0, 0.05, 0.5)),
        ("multisine:5,0.1/0.7,seed=2", maneuvers.multisine(5.0, [0.1, 0.7], seed=2)),
        ("multisine:5,0.05:1:9,length=80", maneuvers.multisine(5.0, (0.05, 1.0, 9), length=80)),
    ],
)
def test_parse_makes_what_the_function_makes(text, same):
    m = maneuvers.parse(text)
    assert m.name == same.name
    np.testing.assert_array_equal(m.sample(), same.sample())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("jump:9", "'jump' .* maneuver: .* rest, step, ramp, sine, stairs, chirp"),
        ("", "'' .* maneuver"),
        ("step", "'amplitude'; .* amplitude, start, stop"),
        ("step:1,2", "too many .*; step .* amplitude, start, stop, length"),
        ("step:1,end=2", "'end'; step .* amplitude, start, stop"),
        ("step:1,stop=3,stop=4", "keyword twice"),
        ("step:nine", "'nine' .* 6.5, .* 2/4/0"),
        ("step:9,", "'' .* number"),
        ("stairs:2//3", "'' .* number"),
        ("step:1/2", "amplitude .* number"),
        ("step:nan", "amplitude .* nan"),
        ("step:5,stop=1/2", "stop .* number"),
        ("sine:1,0.1,length=2", "length of 2 s"),
        ("multisine:1,0.1:2", "a tuple of frequencies is"),
        ("multisine:1,0.1,seed=1.5", "seed .* whole number"),
    ],
)
def test_parse_says_what_is_right(text, message):
    with pytest.raises(InputError, match=message):
        maneuvers.parse(text)
