"""Every expected number is the manoeuvre's own: what was put in has to be found again."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swashplate import InputError, maneuvers
from swashplate.campaign import Recognised, recognise, roundest
from swashplate.logs import open_log
from swashplate.maneuvers import Maneuver

SHARED = Path(__file__).parents[3] / "shared"
CODE = 20.0 / 4096.0
SOURCE = [
    (axis, name) for axis in ("hoist", "slew", "luff") for name in maneuvers.source_tests(axis)
]


def grid(length: float, rate: float) -> np.ndarray:
    return np.arange(int(length * rate + 1e-9) + 1) / rate


def irregular(length: float) -> np.ndarray:
    """Stamps about 19 times a second, 36 to 69 ms apart."""
    stamps = np.cumsum(np.random.default_rng(1).uniform(0.036, 0.069, int(length / 0.0525)))
    return stamps[stamps <= length]


def readback(values: np.ndarray, *, noise: float = 0.01, offset: float = 0.03) -> np.ndarray:
    """12-bit codes of a command with noise and a zero error."""
    disturbed = values + offset + np.random.default_rng(2).normal(0.0, noise, values.size)
    return CODE * np.round(disturbed / CODE)


@pytest.mark.parametrize(("axis", "name"), SOURCE)
@pytest.mark.parametrize("rate", [512.0, 50.0, 19.0])
def test_tests_of_the_source_are_recognised_through_a_12_bit_readback(
    axis: str, name: str, rate: float
) -> None:
    run = maneuvers.source_tests(axis)[name]
    time = irregular(run.length) if rate == 19.0 else grid(run.length, rate)
    found = recognise(time, readback(run(time)))
    assert found.name == name
    assert found.kind == name.split()[0]


@pytest.mark.parametrize(("axis", "name"), SOURCE)
def test_a_clean_command_gives_its_numbers_exactly(axis: str, name: str) -> None:
    run = maneuvers.source_tests(axis)[name]
    time = run.time()
    assert recognise(time, run.sample()).name == name


def test_a_ramp_that_is_held() -> None:
    run = maneuvers.ramp(2.0, limit=6.0, length=13.0)
    assert recognise(run.time(), readback(run.sample())).name == "ramp +2 V/s"


def test_stairs() -> None:
    run = maneuvers.stairs([2.0, 4.0, -6.0, 8.0], 3.0)
    found = recognise(run.time(), readback(run.sample()))
    assert found.name == run.name == "stairs 2/4/-6/8 V"
    down = maneuvers.stairs([2.0, 0.0, -3.0, 0.0], 1.5)
    assert recognise(down.time(), readback(down.sample())).name == down.name


FREE = {
    "chirp": maneuvers.chirp(5.0, 0.05, 1.0),
    "narrow chirp": maneuvers.chirp(5.0, 0.1, 0.11),
    "multisine": maneuvers.multisine(5.0, (0.1, 2.0, 8)),
    "step and sine": maneuvers.step(4.0) + maneuvers.sine(4.0, 0.1),
    "sine on a step": maneuvers.superpose(
        maneuvers.sine(2.0, 0.2, settle=None), maneuvers.step(3.0, stop=30.0, length=30.0)
    ),
    "triangle": maneuvers.recorded([0, 5, 10], [0, 5, 0], interpolation="linear"),
    "triangle wave": maneuvers.recorded(
        np.arange(0, 21, 2.5), [0, 5, 0, -5, 0, 5, 0, -5, 0], interpolation="linear"
    ),
    "less than a period": maneuvers.sine(4.0, 0.1, length=12.5),
    "away from rest": maneuvers.recorded([0, 5], [3, 3], interpolation="linear"),
    "two ramps": maneuvers.ramp(1.0, length=8.0) + maneuvers.ramp(-1.0, length=8.0),
}


@pytest.mark.parametrize("name", FREE)
def test_what_is_no_manoeuvre_is_free(name: str) -> None:
    time = grid(FREE[name].length, 512.0)
    found = recognise(time, readback(FREE[name](time)))
    assert found.kind == found.name == "free"


def test_noise_alone_is_free_unless_it_is_small() -> None:
    time = grid(20.0, 512.0)
    noise = np.random.default_rng(3).normal(0.0, 1.0, time.size)
    assert recognise(time, 2.0 * noise).kind == "free"
    resting = recognise(time, 0.02 * noise)
    assert resting.kind == resting.name == "rest"
    assert recognise(time, 0.02 * noise, unit="%").kind == "free"


def test_a_glitch_is_no_part_of_a_manoeuvre() -> None:
    run = maneuvers.sine(6.5, 0.1)
    voltage = readback(run.sample())
    voltage[5000:5040] = 0.0
    assert recognise(run.time(), voltage).kind == "free"
    step = readback(maneuvers.step(4.0).sample())
    step[2000:2200] += np.linspace(0.0, 0.3, 200)
    assert recognise(maneuvers.step(4.0).time(), step).kind == "free"


def test_samples_on_the_jump_do_not_hide_a_step() -> None:
    """A sample that is taken while the command still rises lies between both levels."""
    time = maneuvers.step(4.0).time()
    voltage = maneuvers.step(4.0).sample()
    for first, last in ((511, 512), (3071, 3072)):
        voltage[first] = 0.3 * voltage[first - 1] + 0.7 * voltage[last]
    found = recognise(time, voltage)
    assert found.name == "step +4 V"
    voltage[511], voltage[3071] = 0.15, 3.9
    assert recognise(time, voltage).name == "step +4 V"


def test_returns_other_than_the_packages_leave_the_manoeuvre_what_it_is() -> None:
    time = grid(14.0, 512.0)
    eased = np.interp(time, [0.0, 1.0, 10.0, 11.0], [0.0, 0.0, 9.0, 0.0])
    found = recognise(time, readback(eased))
    assert found.name == "ramp +1 V/s"


def test_other_units_are_relative_to_rest() -> None:
    time = grid(5.0, 52.0)
    duty = np.where(time < 2.5, 7.4745, 10.01)
    # 2.5355, rounded within 0.2 %
    assert recognise(time, duty, unit="%").name == "step +2.54 %"
    assert recognise(time, duty[::-1], unit="%").name == "step -2.54 %"


def test_stamps_may_begin_anywhere() -> None:
    run = maneuvers.sine(4.0, 0.2, length=15.0)
    found = recognise(run.time() + 1234.5, readback(run.sample()))
    assert found.name == "sine 4 V 0.2 Hz"


def test_what_a_log_begins_and_ends_within() -> None:
    run = maneuvers.sine(4.0, 0.2, length=30.0)
    time, voltage = run.time(), run.sample()
    inside = (time > 3.5) & (time < 21.0)  # from a crossing of zero
    found = recognise(time[inside], voltage[inside])
    assert found.name.endswith("-4 V 0.2 Hz")
    step = maneuvers.step(4.0)
    found = recognise(step.time()[:2000], step.sample()[:2000])
    assert found.name == "step +4 V"


REAL = sorted((SHARED / "data" / "excavator").glob("*.csv"))


@pytest.mark.skipif(not REAL, reason="the excavator's logs are not beside this checkout")
def test_a_joystick_is_free_and_a_step_a_step() -> None:
    neutral = {"Boom Cmd": 7.4745, "Bucket Cmd": 7.614, "Swing Cmd": 7.4695}
    for path in REAL:
        table = open_log(path).read(["Time", *neutral])
        for column, zero in neutral.items():
            found = recognise(table["Time"], table[column] - zero, unit="%")
            if path.name.startswith("manual"):
                assert found.kind == "free"
            elif path.name.startswith("steps_boom") and column == "Boom Cmd":
                assert found.name == "step -5.07 %"
            else:
                assert found.kind == "rest"


amplitudes = st.floats(1.0, 10.0)
signs = st.sampled_from([-1.0, 1.0])
noises = st.floats(0.0, 0.01)
rates = st.sampled_from([512.0, 100.0, 50.0])


def numbers(found: Recognised) -> list[float]:
    """Those of its name."""
    words = found.name.replace(" V/s", "").replace(" Hz", "").replace(" V", "").split()[1:]
    return [float(word) for word in words]


def seen(run: Maneuver, rate: float, noise: float) -> Recognised:
    time = grid(run.length, rate)
    return recognise(time, readback(run(time), noise=noise))


@given(amplitudes, signs, st.floats(0.05, 2.0), noises, rates)
@settings(max_examples=40)
def test_any_sine(
    amplitude: float, sign: float, frequency: float, noise: float, rate: float
) -> None:
    # a longer return would begin with the slope of the sine and rise far above it
    settle = 0.4 / frequency
    length = 1.0 + max(1.2 / frequency, 2.0) + settle
    run = maneuvers.sine(sign * amplitude, frequency, settle=settle, length=length)
    found = seen(run, rate, noise)
    assert found.kind == "sine"
    # fitted to 0.5 % and rounded by 0.4 % more at most
    assert numbers(found)[0] == pytest.approx(sign * amplitude, rel=9e-3)
    assert found.frequency == numbers(found)[1] == pytest.approx(frequency, rel=9e-3)


@given(amplitudes, signs, noises, rates, st.floats(0.2, 2.0), st.floats(0.5, 5.0))
@settings(max_examples=60)
def test_any_step(
    amplitude: float, sign: float, noise: float, rate: float, start: float, dwell: float
) -> None:
    run = maneuvers.step(sign * amplitude, start=start, stop=start + dwell, length=10.0)
    found = seen(run, rate, noise)
    assert found.kind == "step"
    # the converter's step is 0.5 % of 1 V
    assert numbers(found) == [pytest.approx(sign * amplitude, rel=9e-3)]


@given(st.floats(0.3, 20.0), signs, noises, rates, st.floats(1.0, 9.0))
@settings(max_examples=40)
def test_any_ramp(slope: float, sign: float, noise: float, rate: float, limit: float) -> None:
    """From 0.2 s to a third of a minute long; held for longer than its return lasts."""
    slope = min(slope, 5.0 * limit)
    length = limit / slope + 8.0
    found = seen(maneuvers.ramp(sign * slope, limit=limit, length=length), rate, noise)
    assert found.kind == "ramp"
    # ten samples of a rise of 1 V leave a share of the noise
    assert numbers(found) == [pytest.approx(sign * slope, rel=0.02)]


@given(
    st.integers(1, 300),
    st.integers(0, 2**32 - 1),
    st.sampled_from(
        [
            lambda random, n: random.normal(0.0, 3.0, n),
            lambda random, n: np.cumsum(random.normal(0.0, 1.0, n)),
            lambda random, n: np.round(random.normal(0.0, 1.0, n)),
            lambda random, n: np.repeat(random.normal(0.0, 4.0, n // 20 + 1), 20)[:n],
            lambda random, n: np.where(random.random(n) < 0.02, 5.0, 0.0),
            lambda random, n: np.sin(random.uniform(0.0, 3.0) * np.arange(n)),
        ]
    ),
)
@settings(max_examples=100)
def test_any_record_has_an_answer(
    size: int, seed: int, make: Callable[[np.random.Generator, int], np.ndarray]
) -> None:
    random = np.random.default_rng(seed)
    time = np.cumsum(random.uniform(0.001, 0.1, size))
    found = recognise(time, make(random, size))
    assert found.kind in ("rest", "step", "stairs", "ramp", "sine", "free")


@pytest.mark.parametrize(
    ("value", "uncertainty", "expected"),
    [
        (0.09997, 0.0001, 0.1),
        (6.4935, 0.013, 6.5),
        (6.47, 0.013, 6.47),
        (9.98, 0.02, 10.0),
        (-123.4, 5.0, -120.0),
        (0.003, 0.01, 0.0),
        (1.23456, 0.0, 1.23456),
        (0.0, 0.0, 0.0),
    ],
)
def test_roundest(value: float, uncertainty: float, expected: float) -> None:
    assert roundest(value, uncertainty) == expected


@given(st.floats(-1e6, 1e6), st.floats(1e-9, 1e3))
def test_the_roundest_is_near(value: float, uncertainty: float) -> None:
    assert abs(roundest(value, uncertainty) - value) <= uncertainty


@pytest.mark.parametrize(
    ("time", "voltage", "sentence"),
    [
        ([0.0, 1.0], [0.0], "input must be one signal with one row for each of the 2 stamps"),
        ([0.0, 1.0, 1.0], [0.0] * 3, "row 2 (the first is 0) has 1.0 s after 1.0 s"),
        ([0.0, 1.0], [0.0, np.nan], "input must be finite, but row 1 (the first is 0) is nan"),
        ([], [], "time must be one row of numbers"),
    ],
)
def test_bad_records_are_refused(time: list, voltage: list, sentence: str) -> None:
    with pytest.raises(InputError) as error:
        recognise(time, voltage)
    assert sentence in str(error.value)
