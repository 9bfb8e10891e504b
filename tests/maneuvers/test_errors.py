import math
import tracemalloc

import pytest

from swashplate import maneuvers
from swashplate.errors import InputError


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: maneuvers.step(math.inf), "amplitude must be finite, not inf"),
        (lambda: maneuvers.step("9 V"), "amplitude must be a number, not '9 V'"),
        (lambda: maneuvers.step(9, start=-1), "a step needs 0 <= start < stop <= length"),
        (lambda: maneuvers.step(9, stop=1), "not 1, 1, 10 s"),
        (lambda: maneuvers.step(9, length=5), "not 1, 6, 5 s"),
        (lambda: maneuvers.rest(-1), "duration must not be negative, not -1"),
        (lambda: maneuvers.rest("long"), "duration must be a number"),
        (lambda: maneuvers.rest(1e7).sample(), r"5\.12e\+09 samples, more than the 1e\+08"),
        (lambda: maneuvers.ramp(math.nan), "slope must be finite"),
        (lambda: maneuvers.ramp(1, limit=0), "limit must be positive"),
        (lambda: maneuvers.ramp(1, length=3.5), "start 1 s and settle 2.5 s leave nothing of a"),
        (lambda: maneuvers.ramp(1, length=-3), "length must not be negative"),
        (lambda: maneuvers.sine(1, 0), "frequency must be positive"),
        (lambda: maneuvers.sine(1, 1, start=-1), "start must not be negative"),
        (lambda: maneuvers.sine(1, 1, settle=-1), "settle must not be negative"),
        (lambda: maneuvers.sine(1, 1, settle=math.nan), "settle must be finite"),
        (lambda: maneuvers.stairs([]), "levels must be one row of numbers, not of shape"),
        (lambda: maneuvers.stairs([[1, 2]]), "levels must be one row of numbers"),
        (lambda: maneuvers.stairs(["up"]), "levels must be numbers, not"),
        (lambda: maneuvers.stairs([1, math.nan]), "levels must be finite, but row 1 .* is nan"),
        (lambda: maneuvers.stairs([1], dwell=0), "dwell must be positive"),
        (lambda: maneuvers.chirp(1, -0.1, 1), "first must not be negative"),
        (lambda: maneuvers.chirp(1, 0.1, math.inf), "last must be finite"),
        (lambda: maneuvers.multisine(1, [0.1, 0.0]), "lowest frequency must be positive, not 0"),
        (lambda: maneuvers.multisine(1, []), "frequencies must be one row"),
        (
            lambda: maneuvers.multisine(1, [1.0], seed=-1),
            "seed must be a whole number of at least 0",
        ),
        (lambda: maneuvers.multisine(1, (0.1, 0.2)), "a tuple of frequencies is"),
        (lambda: maneuvers.multisine(1, (0.1, 0.2, 0.3)), "a tuple of frequencies is"),
        (lambda: maneuvers.multisine(1, (0.1, 0.2, 0)), "a tuple of frequencies is"),
        (lambda: maneuvers.multisine(1, (0.0, 0.2, 3)), "low must be positive"),
        (lambda: maneuvers.multisine(1, (0.1, 0.2, 50)), "50 frequencies from 0.1 to 0.2 Hz"),
        (lambda: maneuvers.multisine(1, (1e-3, 0.2, 3)), "cannot be distinguished in 56.5 s"),
        (lambda: maneuvers.step(1e308), "amplitude must be at most 1e.12, not 1e.308"),
        (lambda: maneuvers.stairs([1.0, -1e308]), "levels must be at most 1e.12, not 1e.308"),
        (lambda: maneuvers.rest(1) * 1e308, "factor must be at most 1e.12"),
        (
            lambda: maneuvers.parse("multisine:4,0.1:2:100000000"),
            "100000000 frequencies from 0.1 to 2 Hz cannot be distinguished",
        ),
        (lambda: maneuvers.multisine(1, (0.1, 250.0, 9000)), "9000 frequencies .* are too many"),
        (lambda: maneuvers.multisine(1, [1e9]), "1 frequencies up to 1e.09 Hz .* are too many"),
        (lambda: maneuvers.rest(1) * math.nan, "factor must be finite"),
        (lambda: "twice" * maneuvers.rest(1), "factor must be a number"),
        (lambda: maneuvers.rest(1.3).sample(), "rest 1.3 s lasts 1.3 s, at 512 Hz 665.6 samples"),
        (
            lambda: maneuvers.sine(1, 300.0).sample(),
            "300 Hz, but samples at 512 Hz show only .* 256",
        ),
        (lambda: maneuvers.sine(1, 5.0).sample(10.0), "sine 1 V 5 Hz reaches 5 Hz"),
        (lambda: (2.0 * maneuvers.sine(1, 300.0)).sample(), "reaches 300 Hz"),
        (lambda: (maneuvers.sine(1, 300.0) + maneuvers.rest(1)).sample(), "reaches 300 Hz"),
        (lambda: maneuvers.chirp(1, 400.0, 1.0).sample(), "reaches 400 Hz"),
        (lambda: maneuvers.multisine(1, [1.0, 260.0]).sample(), "reaches 260 Hz"),
        (lambda: maneuvers.rest(1).time(0), "rate must be positive"),
        (lambda: maneuvers.source_tests("boom"), "'boom': Kruse .2001. has hoist, slew, luff"),
    ],
)
def test_errors_say_what_is_wrong(make, message):
    with pytest.raises(InputError, match=message) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_a_sentence_on_too_many_frequencies_takes_no_memory():
    tracemalloc.start()
    try:
        with pytest.raises(InputError):
            maneuvers.multisine(4, (0.1, 2.0, 100_000_000))
        assert tracemalloc.get_traced_memory()[1] < 10e6
    finally:
        tracemalloc.stop()
