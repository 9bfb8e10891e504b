import numpy as np
import pytest

from swashplate import maneuvers
from swashplate.errors import InputError


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
        ("jump:9", "'jump' is no manoeuvre: choose one of rest, step, ramp, sine, stairs, chirp"),
        ("", "'' is no manoeuvre"),
        ("step", "missing a required argument: 'amplitude'; step takes amplitude, start, stop"),
        ("step:1,2", "too many positional arguments; step takes amplitude, start, stop, length"),
        ("step:1,end=2", "unexpected keyword argument 'end'; step takes amplitude, start, stop"),
        ("step:1,stop=3,stop=4", "gives a keyword twice"),
        ("step:nine", "'nine' is not a number: write one as 6.5, a list as 2/4/0"),
        ("step:9,", "'' is not a number"),
        ("stairs:2//3", "'' is not a number"),
        ("step:1/2", "amplitude must be a number"),
        ("step:nan", "amplitude must be finite"),
        ("step:5,stop=1/2", "stop must be a number"),
        ("sine:1,0.1,length=2", "leave nothing of a length of 2 s"),
        ("multisine:1,0.1:2", "a tuple of frequencies is"),
        ("multisine:1,0.1,seed=1.5", "seed must be a whole number"),
    ],
)
def test_parse_says_what_is_right(text, message):
    with pytest.raises(InputError, match=message):
        maneuvers.parse(text)
