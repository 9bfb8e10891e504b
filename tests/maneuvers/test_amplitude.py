"""No manoeuvre, whatever it is made of, exceeds the amplitude that it states."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swashplate import maneuvers

volts = st.floats(-10.0, 10.0)
seconds = st.floats(0.01, 8.0)
hertz = st.floats(0.01, 20.0)
levels = st.lists(volts, min_size=1, max_size=5)


@st.composite
def windows(draw):
    start, settle = draw(st.floats(0.0, 2.0)), draw(st.none() | st.floats(0.0, 5.0))
    length = start + (settle or 0.0) + draw(seconds)
    return {"start": start, "settle": settle, "length": length}


@st.composite
def records(draw):
    values = draw(st.lists(volts, min_size=2, max_size=6))
    gaps = draw(st.lists(seconds, min_size=len(values), max_size=len(values)))
    how = draw(st.sampled_from(["previous", "linear"]))
    return maneuvers.recorded(np.cumsum(gaps), values, interpolation=how)


def of_one_kind():
    """Manoeuvre and the amplitude that its name says."""
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
        records().map(lambda m: (m, m.amplitude)),
    )


def together(parts):
    return st.one_of(
        st.tuples(parts, parts).map(lambda p: (p[0][0] + p[1][0], max(p[0][1], p[1][1]))),
        st.tuples(parts, parts).map(
            lambda p: (maneuvers.superpose(p[0][0], p[1][0]), p[0][1] + p[1][1])
        ),
        st.tuples(parts, st.floats(-2.0, 2.0)).map(lambda p: (p[1] * p[0][0], abs(p[1]) * p[0][1])),
        st.tuples(parts, seconds).map(lambda p: (p[0][0] + maneuvers.spline_return(p[1]), p[0][1])),
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


@given(volts, hertz, windows(), st.sampled_from([10.0, 512.0, 4096.0]))
def test_slope_of_a_return_is_the_derivative_wherever_it_is(amplitude, frequency, window, rate):
    # a voltage that were only cut off at the amplitude would not follow its slope
    m = maneuvers.sine(amplitude, frequency, **window)
    end, settle = m.length - (window["settle"] or 0.0), window["settle"] or 0.0
    if settle < 0.1:
        return
    time = end + settle * (np.arange(1, rate) / rate)
    h = 1e-5 * settle
    differences = (m(time + h) - m(time - h)) / (2.0 * h)
    scale = max(np.abs(m.slope(time)).max(), 1e-6)
    np.testing.assert_allclose(m.slope(time), differences, atol=1e-5 * scale)


@pytest.mark.parametrize("text", ["chirp:4,0.05,2", "sine:6.5,3", "multisine:4,0.1:2:8"])
def test_examples_of_the_command_line_stay_within(text):
    m = maneuvers.parse(text)
    peak = np.abs(m.sample()).max()
    assert 0.999 * m.amplitude < peak <= m.amplitude == float(text.split(":")[1].split(",")[0])


@pytest.mark.parametrize("axis", ["hoist", "slew", "luff"])
def test_returns_of_the_source_start_with_the_slope_that_they_find(axis):
    for run in maneuvers.source_tests(axis).values():
        last, before = run.pieces[-1], run.pieces[-2]
        if last.start < run.length and not run.name.startswith("step"):
            slope = before.curve.slope(np.array([last.start - before.start]))
            assert run.slope(last.start) == pytest.approx(slope[0], rel=1e-12)
