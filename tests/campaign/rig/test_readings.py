from dataclasses import replace

import numpy as np
import pytest

from swashplate import InputError
from swashplate.campaign.rig import Instruments
from swashplate.campaign.rig.instruments import (
    play,
    read_counts,
    read_current,
    read_transducer,
    read_voltage,
    sampled_instants,
)

NONE = Instruments()
GRID = np.arange(10_241) / 512.0


def chance() -> np.random.Generator:
    return np.random.default_rng(7)


def ammeter(plus: np.ndarray, minus: np.ndarray, **errors: float) -> np.ndarray:
    return read_current(GRID, plus, minus, GRID, Instruments(**errors), chance())


@pytest.mark.parametrize(
    ("volts", "tools", "mean", "spread"),
    [
        # standard errors: 0.03 mV of the mean, 0.7 % of the deviation
        (5.0, Instruments(voltage_offset=0.02, voltage_noise=0.003), 5.02, 0.003),
        # steps of 4.88 mV and noise of half of it read right on average; 0.29 of a step more
        (4.0013, Instruments(voltage_bits=12, voltage_noise=0.003), 4.0013, 0.00331),
    ],
)
def test_noise_of_the_readback(
    volts: float, tools: Instruments, mean: float, spread: float
) -> None:
    reading = read_voltage(np.full(100_000, volts), tools, chance())
    assert reading.mean() == pytest.approx(mean, abs=5e-5)
    assert reading.std() == pytest.approx(spread, rel=0.03)


@pytest.mark.parametrize(
    ("plus", "minus", "errors", "shown"),
    [
        (0.3, 0.1, {}, 0.4),
        (0.4567, 0.0, {"current_resolution": 0.0005}, 0.4565),
        (0.3, 0.2, {"current_gain_error": 0.01, "current_zero": 4e-3}, 0.509),
    ],
)
def test_readings_of_the_ammeter_by_hand(
    plus: float, minus: float, errors: dict[str, float], shown: float
) -> None:
    reading = ammeter(np.full(GRID.size, plus), np.full(GRID.size, minus), **errors)
    np.testing.assert_allclose(reading, shown, rtol=1e-14)


def spectrum(reading: np.ndarray) -> dict[float, float]:
    """Amplitudes by frequency over 16 s: whole numbers of hertz are lines of their own."""
    part = reading[:8192]
    lines = 2.0 * np.abs(np.fft.rfft(part)) / part.size
    return dict(zip(np.fft.rfftfreq(part.size, 1.0 / 512.0).tolist(), lines.tolist(), strict=True))


def test_the_dither_shows_at_its_aliases_and_beats() -> None:
    """Of 100 Hz at 512 Hz the multiples 1 to 5 show at 100, 200, 212, 112 and 12 Hz.

    The nth amplitude of a triangle that rises for a share D of its period between −h and h is
    2 h |sin nπD| / (n²π² D (1 − D)).
    """
    level, dither, duty = 0.36, 0.015, 0.3
    seen = spectrum(ammeter(np.full(GRID.size, level), np.zeros(GRID.size), dither=dither))
    height = 4.0 * dither * duty * (1.0 - duty)
    for n, alias in enumerate((100.0, 200.0, 212.0, 112.0, 12.0), start=1):
        line = 2.0 * height * abs(np.sin(n * np.pi * duty)) / (n * np.pi) ** 2 / duty / (1.0 - duty)
        # multiples beyond 100 share these lines, with a ten-thousandth of the first
        assert seen[alias] == pytest.approx(line, abs=3e-4 * height)
    assert seen[0.0] / 2.0 == pytest.approx(level, rel=1e-5)
    others = [line for hertz, line in seen.items() if hertz % 4.0]
    assert max(others) < 1e-9
    # five samples and a little are a period: its picture drifts through once in 1/12 s
    assert 5 * 100.0 - 512.0 == -12.0


def test_counts_are_passed_edges() -> None:
    """36 counts a turn, one in ten degrees; where the first edge lies is chance."""
    degrees = np.linspace(0.0, 720.0, 7201)
    tools = Instruments(encoder_step=1)
    counts = read_counts(np.radians(degrees), 36.0, tools, chance())
    assert counts[0] == 0.0
    assert counts[-1] == 72.0
    assert set(np.diff(counts)) == {0.0, 1.0}
    edges = degrees[np.flatnonzero(np.diff(counts)) + 1]
    np.testing.assert_allclose(np.diff(edges), 10.0, atol=0.11)
    np.testing.assert_allclose(
        read_counts(np.radians(degrees), 36.0, NONE, chance()), degrees / 10.0, rtol=1e-14
    )


def test_a_counter_of_eight_bits_rolls_over() -> None:
    turns = np.array([0.0, 127.0, 128.0, 255.0, 256.0, 299.0, -128.0, -129.0])
    counts = read_counts(2.0 * np.pi * turns, 1.0, Instruments(counter_bits=8), chance())
    np.testing.assert_allclose(counts, [0, 127, -128, -1, 0, 43, -128, 127])


def test_transducers_are_noisy_in_proportion() -> None:
    signal = 3e6 * np.sin(GRID)
    reading = read_transducer(signal, Instruments(transducer_noise=0.01), chance())
    assert (reading - signal).std() == pytest.approx(3e4, rel=0.04)
    np.testing.assert_array_equal(read_transducer(signal, NONE, chance()), signal)


def test_stamps_tell_the_jitter_and_keep_the_order() -> None:
    instants, stamps = sampled_instants(
        GRID, Instruments(jitter=2e-4, stamp_resolution=1e-6), chance()
    )
    assert (stamps - GRID)[1:-1].std() == pytest.approx(2e-4, rel=0.05)
    np.testing.assert_array_equal(stamps, np.round(instants, 6))
    for each in sampled_instants(GRID, Instruments(jitter=1.0), chance()):
        assert np.diff(each).min() > 0.0
        assert each.min() >= 0.0
        assert each.max() <= GRID[-1]


def test_the_play_operator_sample_by_sample() -> None:
    drives = np.cumsum(np.random.default_rng(0).normal(size=3000))
    behind, expected = drives[0], []
    for position in drives:
        behind = max(position - 0.75, min(position + 0.75, behind))
        expected.append(behind)
    np.testing.assert_array_equal(play(drives, 1.5), expected)
    np.testing.assert_array_equal(play(drives[:1], 1.0), drives[:1])
    np.testing.assert_array_equal(play(drives[:3], 0.0), drives[:3])


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"jitter": -1.0}, "jitter must be 0 or more, not -1."),
        ({"dither": float("nan")}, "dither must be finite, not nan."),
        ({"lost_rows": 2.0}, "lost_rows must be a share, at most 1, not 2."),
        ({"full_current": 0.0}, "full_current must be positive, not 0."),
    ],
)
def test_impossible_instruments_are_refused(change: dict[str, float], sentence: str) -> None:
    with pytest.raises(InputError) as error:
        replace(NONE, **change)
    assert str(error.value) == sentence
