"""Maneuvers as objects: sampled, scaled, joined, returned, within their amplitude."""

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
    "scaled": -0.3 * maneuvers.sine(6.5, 0.3, length=20.0),
    "later": maneuvers.rest(3.0) + maneuvers.chirp(4.0, 0.05, 0.5),
}


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


@given(volts, volts, st.floats(0.05, 2.0))
def test_a_factor_scales_the_voltage(factor, amplitude, frequency):
    t = np.linspace(0.0, 30.0, 100)
    m = maneuvers.sine(amplitude, frequency)
    scaled, other = factor * m, m * factor
    np.testing.assert_array_equal(scaled(t), factor * m(t))
    np.testing.assert_array_equal(scaled(t), other(t))
    np.testing.assert_array_equal((-m)(t), -(m(t)))
    assert scaled.length == m.length


def test_what_cannot_be_joined_is_a_type_error():
    with pytest.raises(TypeError):
        maneuvers.rest(1.0) + 3


def test_voltage_is_zero_outside_and_has_the_shape_of_the_times():
    m = maneuvers.stairs([5.0], dwell=1.0, start=0.0, settle=0)
    assert m([[-1.0, -1e-12], [1.0, 1.001]]).tolist() == [[0.0, 0.0], [5.0, 0.0]]
    assert isinstance(m(0.5), float)
    assert m([]).shape == (0,)
    assert math.isnan(m(math.nan))


@pytest.mark.parametrize(
    ("m", "name"),
    [
        (maneuvers.step(9.0), "step 9 V"),
        (maneuvers.ramp(-1.0), "ramp -1 V/s"),
        (maneuvers.sine(6.5, 0.1), "sine 6.5 V 0.1 Hz"),
        (maneuvers.stairs([2, 4, 0]), "stairs 2/4/0 V"),
        (maneuvers.chirp(4.0, 0.05, 0.5), "chirp 4 V 0.05 to 0.5 Hz"),
        (maneuvers.multisine(5, [0.1, 2], seed=3), "multisine 5 V 0.1 to 2 Hz seed 3"),
        (maneuvers.rest(1.0) + maneuvers.step(2.0), "rest 1 s + step 2 V"),
        (0.5 * maneuvers.step(9.0), "0.5 * (step 9 V)"),
        (np.float64(0.5) * maneuvers.step(9.0), "0.5 * (step 9 V)"),
        (-maneuvers.step(9.0), "-(step 9 V)"),
        (replace(maneuvers.step(9.0), name="mine"), "mine"),
    ],
)
def test_names(m, name):
    assert m.name == name


@pytest.mark.parametrize("m", SMOOTH.values(), ids=SMOOTH.keys())
def test_maneuvers_travel_to_other_processes(m):
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(m))(3.0), m(3.0))


def rise(m, at, side, h=1e-5):
    """One-sided difference of second order: an estimate of the slope that knows no formula."""
    return side * (-3 * m(at) + 4 * m(at + side * h) - m(at + 2 * side * h)) / (2 * h)


RETURNING = {
    "ramp": (maneuvers.ramp(1.0), 10.5),
    "sine": (maneuvers.sine(9.0, 0.3, length=20.0), 17.5),
    "stairs": (maneuvers.stairs([3.0, -5.0]), 5.0),
    "chirp": (maneuvers.chirp(4.0, 0.05, 0.1), 57.5),
    "multisine": (maneuvers.multisine(5.0, (0.05, 0.5, 9)), 57.5),
}


@pytest.mark.parametrize(("m", "end"), RETURNING.values(), ids=RETURNING.keys())
def test_return_continues_voltage_and_slope_and_ends_at_rest(m, end):
    assert m(end - 1e-8) == pytest.approx(m(end), abs=1e-6)
    assert rise(m, end, -1) == pytest.approx(rise(m, end, +1), abs=1e-7)
    assert m(m.length) == 0.0
    assert rise(m, m.length, -1) == pytest.approx(0.0, abs=1e-7)


def test_return_of_a_fast_command_stays_within_its_amplitude():
    m = maneuvers.chirp(4.0, 0.05, 2.0)  # the help's example
    before, end = m(57.5 - 1e-9), 57.5
    assert m(end) == pytest.approx(before, abs=1e-6)
    # steeper than the return may start, which then just reaches the amplitude, at one instant
    before, after = rise(m, end, -1), rise(m, end, +1)
    assert abs(before) > abs(after) > 0.0
    assert before * after > 0.0
    back = m(np.linspace(end, m.length, 100_001))
    assert np.abs(back).max() == pytest.approx(4.0, rel=1e-8)
    assert (np.abs(back) == np.abs(back).max()).sum() < 10
    assert m(m.length) == 0.0


def test_return_is_the_cubic_of_its_end_conditions():
    m = maneuvers.ramp(2.0, start=0.0, settle=2.0, length=5.0)
    # V = a + b t + c t² + d t³ with V(0) = 6, V'(0) = 2, V(2) = V'(2) = 0.
    c, d = np.linalg.solve([[4.0, 8.0], [4.0, 12.0]], [-10.0, -2.0])
    t = np.linspace(0.0, 2.0, 21)
    np.testing.assert_allclose(m(3.0 + t), 6 + 2 * t + c * t**2 + d * t**3, atol=1e-13)


@given(volts, st.floats(0.01, 3.0), st.floats(0.1, 20.0), st.floats(0.1, 20.0))
def test_any_return_ends_exactly_at_rest(amplitude, frequency, active, settle):
    length = 1.0 + active + settle
    m = maneuvers.sine(amplitude, frequency, settle=settle, length=length)
    assert m.length == length
    assert m(length) == 0.0


@pytest.mark.parametrize(("before", "settle"), [(0.1, 0.2), (0.4, 0.7), (0.2, 7.9), (5.9, 6.2)])
def test_lengths_are_exact_where_the_return_is_longer_than_what_precedes_it(before, settle):
    # The length is a rounded sum, (0.1 + 0.2) − 0.1 > 0.2, and its last stamp may lie before it,
    # 0.3 < 0.1 + 0.2: at both the return is over, to the last bit.
    hold = maneuvers.stairs([5.0], dwell=before, start=0.0, settle=settle)
    sine = maneuvers.sine(3.0, 0.2, start=0.0, settle=settle, length=before + settle)
    for m in (hold, sine):
        assert m.length == before + settle
        assert m(m.length) == 0.0
        assert m.sample(10.0).size == round(10 * (before + settle)) + 1
        assert m.sample(10.0)[-1] == 0.0


seconds = st.floats(0.01, 8.0)
hertz = st.floats(0.01, 20.0)
levels = st.lists(volts, min_size=1, max_size=5)


@st.composite
def windows(draw):
    start, settle = draw(st.floats(0.0, 2.0)), draw(st.none() | st.floats(0.0, 5.0))
    length = start + (settle or 0.0) + draw(seconds)
    return {"start": start, "settle": settle, "length": length}


def of_one_kind():
    """Maneuver and the amplitude that its name says."""
    return st.one_of(
        seconds.map(lambda duration: (maneuvers.rest(duration), 0.0)),
        volts.map(lambda v: (maneuvers.step(v), abs(v))),
        st.builds(
            lambda slope, limit, window: (maneuvers.ramp(slope, limit=limit, **window), limit),
            st.floats(-50.0, 50.0),
            st.floats(0.1, 10.0),
            windows(),
        ),
        st.builds(
            lambda v, f, window: (maneuvers.sine(v, f, **window), abs(v)), volts, hertz, windows()
        ),
        st.builds(
            lambda v, f, g, window: (maneuvers.chirp(v, f, g, **window), abs(v)),
            volts,
            hertz,
            hertz,
            windows(),
        ),
        st.builds(
            lambda v, f, seed, window: (maneuvers.multisine(v, f, seed=seed, **window), abs(v)),
            volts,
            st.lists(hertz, min_size=1, max_size=6),
            st.integers(0, 9),
            windows(),
        ),
        st.builds(
            lambda v, dwell, settle: (maneuvers.stairs(v, dwell, settle=settle), max(map(abs, v))),
            levels,
            seconds,
            st.floats(0.0, 5.0),
        ),
    )


def together(parts):
    return st.one_of(
        st.tuples(parts, parts).map(lambda p: (p[0][0] + p[1][0], max(p[0][1], p[1][1]))),
        st.tuples(parts, st.floats(-2.0, 2.0)).map(lambda p: (p[1] * p[0][0], abs(p[1]) * p[0][1])),
    )


@given(st.recursive(of_one_kind(), together, max_leaves=4), st.floats(0.001, 1.0))
def test_no_voltage_exceeds_the_amplitude_at_any_rate(made, fraction):
    m, amplitude = made
    assert m.amplitude == pytest.approx(amplitude, rel=1e-12)
    # a grid over all of it, the ends included, and one of another spacing beside it
    for time in (
        np.linspace(0.0, m.length, 4001),
        np.arange(0.0, m.length, 0.01 * fraction + 1e-3),
    ):
        assert np.abs(m(time)).max() <= m.amplitude


@pytest.mark.parametrize("text", ["chirp:4,0.05,2", "sine:6.5,3", "multisine:4,0.1:2:8"])
def test_examples_of_the_command_line_stay_within(text):
    m = maneuvers.parse(text)
    peak = np.abs(m.sample()).max()
    assert 0.999 * m.amplitude < peak <= m.amplitude == float(text.split(":")[1].split(",")[0])
