import math
import tracemalloc

import pytest

from swashplate import maneuvers
from swashplate.errors import InputError


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: maneuvers.step(math.inf), "amplitude .* inf"),
        (lambda: maneuvers.step("9 V"), "amplitude .* number, .* '9 V'"),
        (lambda: maneuvers.step(9, start=-1), "0 <= start < stop <= length"),
        (lambda: maneuvers.step(9, stop=1), "1, 1, 10 s"),
        (lambda: maneuvers.step(9, length=5), "1, 6, 5 s"),
        (lambda: maneuvers.rest(-1), "duration .* -1"),
        (lambda: maneuvers.rest("long"), "duration .* number, .*'long'"),
        (lambda: maneuvers.rest(1e7).sample(), r"5\.12e\+09 samples, .* 1e\+08"),
        (lambda: maneuvers.ramp(math.nan), "slope .* nan"),
        (lambda: maneuvers.ramp(1, limit=0), "limit .* positive"),
        (lambda: maneuvers.ramp(1, length=3.5), "start 1 s .* settle 2.5 s"),
        (lambda: maneuvers.ramp(1, length=-3), "length .* -3"),
        (lambda: maneuvers.sine(1, 0), "frequency .* positive"),
        (lambda: maneuvers.sine(1, 1, start=-1), "start .* -1"),
        (lambda: maneuvers.sine(1, 1, settle=-1), "settle .* -1"),
        (lambda: maneuvers.sine(1, 1, settle=math.nan), "settle .* nan"),
        (lambda: maneuvers.stairs([]), "levels .* one row of numbers"),
        (lambda: maneuvers.stairs([[1, 2]]), "levels .* one row of numbers"),
        (lambda: maneuvers.stairs(["up"]), "levels .* numbers"),
        (lambda: maneuvers.stairs([1, math.nan]), "levels .* row 1 .* nan"),
        (lambda: maneuvers.stairs([1], dwell=0), "dwell .* positive"),
        (lambda: maneuvers.chirp(1, -0.1, 1), "first .* -0.1"),
        (lambda: maneuvers.chirp(1, 0.1, math.inf), "last .* inf"),
        (lambda: maneuvers.multisine(1, [0.1, 0.0]), "lowest frequency .* 0"),
        (lambda: maneuvers.multisine(1, []), "frequencies .* one row"),
        (
            lambda: maneuvers.multisine(1, [1.0], seed=-1),
            "seed .* whole number of at least 0",
        ),
        (lambda: maneuvers.multisine(1, (0.1, 0.2)), "a tuple of frequencies is"),
        (lambda: maneuvers.multisine(1, (0.1, 0.2, 0.3)), "a tuple of frequencies is"),
        (lambda: maneuvers.multisine(1, (0.1, 0.2, 0)), "a tuple of frequencies is"),
        (lambda: maneuvers.multisine(1, (0.0, 0.2, 3)), "low .* positive"),
        (lambda: maneuvers.multisine(1, (0.1, 0.2, 50)), "50 frequencies from 0.1 to 0.2 Hz"),
        (lambda: maneuvers.multisine(1, (1e-3, 0.2, 3)), "3 frequencies .* 56.5 s"),
        (lambda: maneuvers.step(1e308), "amplitude .* 1e.12, .* 1e.308"),
        (lambda: maneuvers.stairs([1.0, -1e308]), "levels .* 1e.12, .* 1e.308"),
        (lambda: maneuvers.rest(1) * 1e308, "factor .* 1e.12"),
        (
            lambda: maneuvers.parse("multisine:4,0.1:2:100000000"),
            "100000000 frequencies from 0.1 to 2 Hz",
        ),
        (lambda: maneuvers.multisine(1, (0.1, 250.0, 9000)), "9000 frequencies "),
        (lambda: maneuvers.multisine(1, [1e9]), "1 frequencies .* 1e.09 Hz"),
        (lambda: maneuvers.rest(1) * math.nan, "factor .* nan"),
        (lambda: "twice" * maneuvers.rest(1), "factor .* number"),
        (lambda: maneuvers.rest(1.3).sample(), "rest 1.3 s .* 512 Hz 665.6 samples"),
        (
            lambda: maneuvers.sine(1, 300.0).sample(),
            "300 Hz, .* 512 Hz .* 256",
        ),
        (lambda: maneuvers.sine(1, 5.0).sample(10.0), "sine 1 V 5 Hz .* 5 Hz"),
        (lambda: (2.0 * maneuvers.sine(1, 300.0)).sample(), "300 Hz, .* 512 Hz"),
        (lambda: (maneuvers.sine(1, 300.0) + maneuvers.rest(1)).sample(), "300 Hz, .* 512 Hz"),
        (lambda: maneuvers.chirp(1, 400.0, 1.0).sample(), "400 Hz, .* 512 Hz"),
        (lambda: maneuvers.multisine(1, [1.0, 260.0]).sample(), "260 Hz, .* 512 Hz"),
        (lambda: maneuvers.rest(1).time(0), "rate .* positive"),
        (lambda: maneuvers.source_tests("boom"), "'boom': .* hoist, slew, luff"),
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
