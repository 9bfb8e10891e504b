"""Every expected number is the maneuver's own: what was put in has to be found again."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swashplate import maneuvers
from swashplate.campaign import recognise
from swashplate.maneuvers import Maneuver

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
@pytest.mark.parametrize("rate", [512.0, 19.0])
def test_tests_of_the_source_are_recognised_through_a_12_bit_readback(axis, name, rate) -> None:
    run = maneuvers.source_tests(axis)[name]
    time = irregular(run.length) if rate == 19.0 else grid(run.length, rate)
    found = recognise(time, readback(run(time)))
    assert found.name == name
    assert found.kind == name.split()[0]
    if rate == 512.0:
        assert recognise(run.time(), run.sample()).name == name


def of(run: Maneuver, *, shift: float = 0.0, part: slice = slice(None)) -> tuple:
    """Stamps and readback of a maneuver."""
    return (run.time() + shift)[part], readback(run.sample())[part]


def on_jumps(*taken: float) -> tuple:
    """A step of 4 V with samples that were taken while the command rose and fell."""
    time, voltage = maneuvers.step(4.0).time(), maneuvers.step(4.0).sample()
    voltage[[511, 3071]] = taken
    return time, voltage


LONG = grid(14.0, 512.0)
DUTY = np.where(grid(5.0, 52.0) < 2.5, 7.4745, 10.01)
SINE = maneuvers.sine(4.0, 0.2, length=30.0)
NOISE = np.random.default_rng(3).normal(0.0, 1.0, 10_241)
GLITCHES = readback(maneuvers.sine(6.5, 0.1).sample())
GLITCHES[5000:5040] = 0.0
CREEP = readback(maneuvers.step(4.0).sample())
CREEP[2000:2200] += np.linspace(0.0, 0.3, 200)


@pytest.mark.parametrize(
    ("record", "unit", "name"),
    [
        (of(maneuvers.ramp(2.0, limit=6.0, length=13.0)), "V", "ramp +2 V/s"),
        (of(maneuvers.stairs([2.0, 4.0, -6.0, 8.0], 3.0)), "V", "stairs 2/4/-6/8 V"),
        (of(maneuvers.stairs([2.0, 0.0, -3.0, 0.0], 1.5)), "V", "stairs 2/0/-3/0 V"),
        (on_jumps(0.3 * 0.0 + 0.7 * 4.0, 0.3 * 4.0), "V", "step +4 V"),
        (on_jumps(0.15, 3.9), "V", "step +4 V"),
        # a return other than the package's leaves the maneuver what it is
        ((LONG, readback(np.interp(LONG, [0, 1, 10, 11], [0, 0, 9, 0]))), "V", "ramp +1 V/s"),
        # 2.5355, rounded within 0.2 %
        ((grid(5.0, 52.0), DUTY), "%", "step +2.54 %"),
        ((grid(5.0, 52.0), DUTY[::-1]), "%", "step -2.54 %"),
        (of(maneuvers.sine(4.0, 0.2, length=15.0), shift=1234.5), "V", "sine 4 V 0.2 Hz"),
        # from a crossing of zero downwards to within the sine
        ((SINE.time()[1793:10752], SINE.sample()[1793:10752]), "V", "sine -4 V 0.2 Hz"),
        (of(maneuvers.step(4.0), part=slice(2000)), "V", "step +4 V"),
        ((grid(20.0, 512.0), 0.02 * NOISE), "V", "rest"),
        ((grid(20.0, 512.0), 0.02 * NOISE), "%", "unnamed motion"),
        ((grid(20.0, 512.0), 2.0 * NOISE), "V", "unnamed motion"),
        # a glitch is no part of a maneuver
        ((maneuvers.sine(6.5, 0.1).time(), GLITCHES), "V", "unnamed motion"),
        ((maneuvers.step(4.0).time(), CREEP), "V", "unnamed motion"),
    ],
)
def test_names_of_records(record: tuple, unit: str, name: str) -> None:
    found = recognise(*record, unit=unit)
    assert (found.name, found.kind) == (name, name.split()[0])


def drawn(length: float, curve: Callable[[np.ndarray], np.ndarray]) -> Maneuver:
    return Maneuver("drawn", length, ((0.0, curve),))


WAVE = np.arange(0.0, 21.0, 2.5), [0, 5, 0, -5, 0, 5, 0, -5, 0]
FREE = {
    "chirp": maneuvers.chirp(5.0, 0.05, 1.0),
    "narrow chirp": maneuvers.chirp(5.0, 0.1, 0.11),
    "multisine": maneuvers.multisine(5.0, (0.1, 2.0, 8)),
    "step and sine": maneuvers.step(4.0) + maneuvers.sine(4.0, 0.1),
    "sine on a step": drawn(
        30.0, lambda t: np.where(t >= 1.0, 3.0 + 2.0 * np.sin(0.4 * np.pi * (t - 1.0)), 0.0)
    ),
    "triangle": drawn(10.0, lambda t: np.interp(t, [0, 5, 10], [0, 5, 0])),
    "triangle wave": drawn(20.0, lambda t: np.interp(t, *WAVE)),
    "less than a period": maneuvers.sine(4.0, 0.1, length=12.5),
    "away from rest": drawn(5.0, lambda t: np.full_like(t, 3.0)),
    "two ramps": maneuvers.ramp(1.0, length=8.0) + maneuvers.ramp(-1.0, length=8.0),
}


@pytest.mark.parametrize("name", FREE)
def test_what_is_no_maneuver_is_free(name: str) -> None:
    time = grid(FREE[name].length, 512.0)
    found = recognise(time, readback(FREE[name](time)))
    assert found.name == "unnamed motion"


@st.composite
def shapes(draw: st.DrawFn) -> tuple[Maneuver, str, list[float], float]:
    """A maneuver, its kind, the numbers of its name, and by how much these may be off."""
    signed = draw(st.floats(1.0, 10.0)) * draw(st.sampled_from([-1.0, 1.0]))
    kind = draw(st.sampled_from(["sine", "step", "ramp"]))
    if kind == "step":
        start, dwell = draw(st.floats(0.2, 2.0)), draw(st.floats(0.5, 5.0))
        run = maneuvers.step(signed, start=start, stop=start + dwell, length=10.0)
        # the converter's step is 0.5 % of 1 V
        return run, kind, [signed], 9e-3
    if kind == "sine":
        frequency = draw(st.floats(0.05, 2.0))
        # a longer return would begin with the slope of the sine and rise far above it
        settle = 0.4 / frequency
        length = 1.0 + max(1.2 / frequency, 2.0) + settle
        run = maneuvers.sine(signed, frequency, settle=settle, length=length)
        # fitted to 0.5 % and rounded by 0.4 % more at most
        return run, kind, [signed, frequency], 9e-3
    # from 0.2 s to a third of a minute long; held for longer than its return lasts
    limit = draw(st.floats(1.0, 9.0))
    slope = float(np.sign(signed)) * min(draw(st.floats(0.3, 20.0)), 5.0 * limit)
    run = maneuvers.ramp(slope, limit=limit, length=limit / abs(slope) + 8.0)
    # ten samples of a rise of 1 V leave a share of the noise
    return run, kind, [slope], 0.02


@given(shapes(), st.floats(0.0, 0.01), st.sampled_from([512.0, 100.0, 50.0]))
@settings(max_examples=60)
def test_any_sine_step_or_ramp(shape, noise: float, rate: float) -> None:
    run, kind, numbers, within = shape
    time = grid(run.length, rate)
    found = recognise(time, readback(run(time), noise=noise))
    words = found.name.replace(" V/s", "").replace(" Hz", "").replace(" V", "").split()
    assert words[0] == found.kind == kind
    assert [float(word) for word in words[1:]] == pytest.approx(numbers, rel=within)
    assert found.frequency == (float(words[2]) if kind == "sine" else None)


RECORDS = [
    lambda random, n: random.normal(0.0, 3.0, n),
    lambda random, n: np.cumsum(random.normal(0.0, 1.0, n)),
    lambda random, n: np.round(random.normal(0.0, 1.0, n)),
    lambda random, n: np.repeat(random.normal(0.0, 4.0, n // 20 + 1), 20)[:n],
    lambda random, n: np.where(random.random(n) < 0.02, 5.0, 0.0),
    lambda random, n: np.sin(random.uniform(0.0, 3.0) * np.arange(n)),
]


@given(st.integers(1, 300), st.integers(0, 2**32 - 1), st.sampled_from(RECORDS))
@settings(max_examples=40)
def test_any_record_has_an_answer(size: int, seed: int, make: Callable) -> None:
    random = np.random.default_rng(seed)
    time = np.cumsum(random.uniform(0.001, 0.1, size))
    found = recognise(time, make(random, size))
    assert found.kind in ("rest", "step", "stairs", "ramp", "sine", "unnamed")
