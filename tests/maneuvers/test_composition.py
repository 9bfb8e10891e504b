import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swashplate import maneuvers

volts = st.floats(-10.0, 10.0)


def rise(m, at, side, h=1e-5):
    """One-sided difference of second order: an estimate of the slope that knows no formula."""
    return side * (-3 * m(at) + 4 * m(at + side * h) - m(at + 2 * side * h)) / (2 * h)


RETURNING = {
    "ramp": (maneuvers.ramp(1.0), 10.5),
    "sine": (maneuvers.sine(9.0, 0.3, length=20.0), 17.5),
    "stairs": (maneuvers.stairs([3.0, -5.0]), 5.0),
    "chirp": (maneuvers.chirp(4.0, 0.05, 0.1), 57.5),
    "multisine": (maneuvers.multisine(5.0, (0.05, 0.5, 9)), 57.5),
    "recorded": (
        maneuvers.recorded([0, 1, 3], [0, 6, 5], interpolation="linear")
        + maneuvers.spline_return(2.0),
        3.0,
    ),
}


@pytest.mark.parametrize(("m", "end"), RETURNING.values(), ids=RETURNING.keys())
def test_return_continues_voltage_and_slope_and_ends_at_rest(m, end):
    assert m(end - 1e-8) == pytest.approx(m(end), abs=1e-6)
    assert rise(m, end, -1) == pytest.approx(rise(m, end, +1), abs=1e-7)
    assert m.slope(end) == pytest.approx(rise(m, end, +1), abs=1e-7)
    assert m(m.length) == 0.0
    assert m.slope(m.length) == 0.0


def test_return_of_a_fast_command_stays_within_its_amplitude():
    m = maneuvers.chirp(4.0, 0.05, 2.0)  # the help's example
    before, end = m(57.5 - 1e-9), 57.5
    assert m(end) == pytest.approx(before, abs=1e-6)
    # steeper than the return may start, which then just reaches the amplitude, at one instant
    assert abs(rise(m, end, -1)) > abs(m.slope(end)) > 0.0
    assert m.slope(end) * rise(m, end, -1) > 0.0
    back = m(np.linspace(end, m.length, 100_001))
    assert np.abs(back).max() == pytest.approx(4.0, rel=1e-8)
    assert (np.abs(back) == np.abs(back).max()).sum() < 10
    assert (m(m.length), m.slope(m.length)) == (0.0, 0.0)


def test_return_from_what_states_no_amplitude_does_not_exceed_its_end():
    class Line:
        def __call__(self, time):
            return 2.0 * time

        def slope(self, time):
            return np.full_like(time, 2.0)

    own = maneuvers.Maneuver("own", 3.0, (maneuvers.Piece(0.0, Line()),))
    assert (own + maneuvers.spline_return(2.0))(np.linspace(0.0, 5.0, 1001)).max() == 6.0


def test_return_is_the_cubic_of_its_end_conditions():
    ramp = maneuvers.ramp(2.0, start=0.0, settle=None, length=3.0)
    m = ramp + maneuvers.spline_return(2.0)
    # V = a + b t + c t² + d t³ with V(0) = 6, V'(0) = 2, V(2) = V'(2) = 0.
    c, d = np.linalg.solve([[4.0, 8.0], [4.0, 12.0]], [-10.0, -2.0])
    t = np.linspace(0.0, 2.0, 21)
    np.testing.assert_allclose(m(3.0 + t), 6 + 2 * t + c * t**2 + d * t**3, atol=1e-13)
    np.testing.assert_allclose(m.slope(3.0 + t), 2 + 2 * c * t + 3 * d * t**2, atol=1e-13)


@given(volts, st.floats(0.01, 3.0), st.floats(0.1, 20.0), st.floats(0.1, 20.0))
def test_any_return_ends_exactly_at_rest(amplitude, frequency, active, settle):
    length = 1.0 + active + settle
    m = maneuvers.sine(amplitude, frequency, settle=settle, length=length)
    assert m.length == length
    assert (m(length), m.slope(length)) == (0.0, 0.0)
    hold = maneuvers.stairs([amplitude], dwell=active, settle=None)
    m = hold + maneuvers.spline_return(settle)
    assert m.length == hold.length + settle
    assert (m(m.length), m.slope(m.length)) == (0.0, 0.0)


@pytest.mark.parametrize("length", [20.1, 33.3, 7.7])
def test_lengths_are_exact_where_durations_round(length):
    m = maneuvers.sine(3.0, 0.2, start=0.1, settle=0.7, length=length)
    assert m.length == length
    assert m.sample(10.0).size == round(10 * length) + 1
    assert m.sample(10.0)[-1] == 0.0


@pytest.mark.parametrize(("before", "settle"), [(0.1, 0.2), (0.4, 0.7), (0.2, 7.9), (5.9, 6.2)])
def test_lengths_are_exact_where_the_return_is_longer_than_what_precedes_it(before, settle):
    # The length is a rounded sum, (0.1 + 0.2) − 0.1 > 0.2, and its last stamp may lie before it,
    # 0.3 < 0.1 + 0.2: at both the return is over, to the last bit.
    hold = maneuvers.stairs([5.0], dwell=before, start=0.0, settle=None)
    sine = maneuvers.sine(3.0, 0.2, start=0.0, settle=settle, length=before + settle)
    for m in (hold + maneuvers.spline_return(settle), sine):
        assert m.length == before + settle
        assert (m(m.length), m.slope(m.length)) == (0.0, 0.0)
        assert m.sample(10.0).size == round(10 * (before + settle)) + 1
        assert m.sample(10.0)[-1] == 0.0


def test_superposed_voltages_add_up_over_the_longest():
    hold = maneuvers.stairs([2.0], dwell=2.0, start=0.0, settle=0)
    m = maneuvers.superpose(hold, maneuvers.step(1.0, stop=4.0, length=5.0))
    assert m.length == 5.0
    assert m.sample(1.0).tolist() == [2.0, 3.0, 1.0, 1.0, 0.0, 0.0]


def test_superposed_keeps_its_end_within_a_longer_one():
    # (0.1 + 0.3) − 0.1 > 0.3: the end of the whole lies after that of its part.
    hold = maneuvers.stairs([2.0], dwell=0.3, start=0.0, settle=0)
    m = maneuvers.rest(0.1) + maneuvers.superpose(hold, hold)
    assert m.sample(10.0).tolist() == [0.0, 4.0, 4.0, 4.0, 4.0]


@given(volts, volts)
def test_superposing_adds(first, second):
    a, b = maneuvers.step(first), maneuvers.sine(second, 0.3, length=20.0)
    t = np.linspace(0.0, 20.0, 200)
    np.testing.assert_allclose(maneuvers.superpose(a, b)(t), a(t) + b(t), atol=1e-13)
