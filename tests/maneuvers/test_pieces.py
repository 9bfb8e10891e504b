import math
import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swashplate import maneuvers

volts = st.floats(-10.0, 10.0)
# Eighths of a second: whole at 512 Hz, and their sums are exact.
durations = st.integers(1, 160).map(lambda n: n / 8)

SMOOTH = {
    "sine": maneuvers.sine(6.5, 0.3, length=20.0),
    "chirp": maneuvers.chirp(4.0, 0.05, 0.5),
    "multisine": maneuvers.multisine(5.0, [0.1, 0.37, 1.1]),
    "superposed": maneuvers.superpose(maneuvers.ramp(1.0), maneuvers.sine(2.0, 0.5)),
    "scaled": -0.3 * maneuvers.sine(6.5, 0.3, length=20.0),
    "later": maneuvers.rest(3.0) + maneuvers.chirp(4.0, 0.05, 0.5),
}


@pytest.mark.parametrize("m", SMOOTH.values(), ids=SMOOTH.keys())
def test_slope_is_the_derivative(m):
    # An irrational offset keeps the differences off the kinks.
    t, h = np.linspace(0.0, m.length, 500)[1:-1] + math.pi / 1000, 1e-4
    differences = (m(t - 2 * h) - 8 * m(t - h) + 8 * m(t + h) - m(t + 2 * h)) / (12 * h)
    np.testing.assert_allclose(m.slope(t), differences, atol=1e-9)


def test_pieces_follow_one_another():
    m = maneuvers.rest(2.0) + maneuvers.step(3.0, stop=2.0, length=3.0) + maneuvers.rest(1.0)
    assert m.length == 6.0
    assert m.sample(2.0).tolist() == [0, 0, 0, 0, 0, 0, 3, 3, 0, 0, 0, 0, 0]


def test_a_jump_is_not_missed_where_durations_round():
    # 0.1 + 0.2 > 0.3, the stamp of sample 3 at 10 Hz.
    m = maneuvers.rest(0.1) + maneuvers.stairs([5.0], dwell=0.7, start=0.2, settle=0)
    assert m.sample(10.0).tolist() == [0.0] * 3 + [5.0] * 8


def test_the_last_sample_is_the_end_where_its_stamp_rounds():
    # Within a millionth of a sample of whole, but the last stamp is 5 ns after the end.
    m = maneuvers.stairs([5.0], dwell=1.0 - 5e-9, start=0.0, settle=0)
    assert m.sample(10.0).tolist() == [5.0] * 11


def test_jumps_are_right_continuous():
    m = maneuvers.step(4.0)
    assert m([1.0 - 1e-8, 1.0, 6.0 - 1e-8, 6.0]).tolist() == [0.0, 4.0, 4.0, 0.0]


@given(volts, durations, volts, durations)
def test_lengths_and_samples_concatenate(first, one, second, other):
    a = maneuvers.stairs([first], dwell=one, start=0.125, settle=None)
    b = maneuvers.stairs([second], dwell=other, start=0.25, settle=None)
    both = a + b
    assert both.length == one + 0.125 + other + 0.25
    expected = np.concatenate([a.sample()[:-1], b.sample()])
    np.testing.assert_array_equal(both.sample(), expected)


@given(volts, volts, st.floats(0.05, 2.0))
def test_a_factor_scales_voltage_and_slope(factor, amplitude, frequency):
    t = np.linspace(0.0, 30.0, 100)
    m = maneuvers.sine(amplitude, frequency)
    scaled, other = factor * m, m * factor
    np.testing.assert_array_equal(scaled(t), factor * m(t))
    np.testing.assert_array_equal(scaled.slope(t), factor * m.slope(t))
    np.testing.assert_array_equal(scaled(t), other(t))
    np.testing.assert_array_equal((-m)(t), -(m(t)))
    assert scaled.length == m.length


def test_what_cannot_be_joined_is_a_type_error():
    with pytest.raises(TypeError):
        maneuvers.rest(1.0) + 3
    with pytest.raises(TypeError):
        3 + maneuvers.spline_return(1.0)


def test_voltage_is_zero_outside_and_has_the_shape_of_the_times():
    m = maneuvers.stairs([5.0], dwell=1.0, start=0.0, settle=0)
    assert m([[-1.0, -1e-12], [1.0, 1.001]]).tolist() == [[0.0, 0.0], [5.0, 0.0]]
    assert m.slope([-1.0, 2.0]).tolist() == [0.0, 0.0]
    assert isinstance(m(0.5), float)
    assert m([]).shape == (0,)
    assert math.isnan(m(math.nan))


def test_time_stamps_go_with_the_samples():
    m = maneuvers.rest(2.0)
    assert m.time(2.0).tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert m.time().size == m.sample().size == 1025
    assert maneuvers.rest(0.0).sample().tolist() == [0.0]


def test_sampling_calls_each_curve_once():
    sizes = []

    class Counted:
        def __call__(self, time):
            sizes.append(time.size)
            return np.zeros_like(time)

        slope = __call__

    pieces = (maneuvers.Piece(0.0, Counted()), maneuvers.Piece(10.0, Counted()))
    maneuvers.Maneuver("counted", 30.0, pieces).sample()
    assert sizes == [5120, 10241]


@pytest.mark.parametrize(
    ("m", "name"),
    [
        (maneuvers.step(9.0), "step 9 V"),
        (maneuvers.ramp(-1.0), "ramp -1 V/s"),
        (maneuvers.sine(6.5, 0.1), "sine 6.5 V 0.1 Hz"),
        (maneuvers.stairs([2, 4, 0]), "stairs 2/4/0 V"),
        (maneuvers.chirp(4.0, 0.05, 0.5), "chirp 4 V 0.05 to 0.5 Hz"),
        (maneuvers.multisine(5, [0.1, 2], seed=3), "multisine 5 V 0.1 to 2 Hz seed 3"),
        (maneuvers.recorded([0, 1], [0, 1], interpolation="linear"), "recorded 2 rows"),
        (maneuvers.rest(1.0) + maneuvers.step(2.0), "rest 1 s + step 2 V"),
        (maneuvers.step(2.0) + maneuvers.spline_return(2.5), "step 2 V + return 2.5 s"),
        (0.5 * maneuvers.step(9.0), "0.5 * (step 9 V)"),
        (np.float64(0.5) * maneuvers.step(9.0), "0.5 * (step 9 V)"),
        (-maneuvers.step(9.0), "-(step 9 V)"),
        (maneuvers.superpose(maneuvers.step(1), maneuvers.ramp(1)), "step 1 V with ramp 1 V/s"),
        (replace(maneuvers.step(9.0), name="mine"), "mine"),
    ],
)
def test_names(m, name):
    assert m.name == name


@pytest.mark.parametrize("m", SMOOTH.values(), ids=SMOOTH.keys())
def test_manoeuvres_travel_to_other_processes(m):
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(m))(3.0), m(3.0))
