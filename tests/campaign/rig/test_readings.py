from dataclasses import replace

import numpy as np
import pytest

from swashplate import InputError
from swashplate.campaign.rig import SEVERITIES, Instruments
from swashplate.campaign.rig.instruments import (
    lost,
    play,
    put_out,
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


def test_codes_of_twelve_bits() -> None:
    """20 V / 4096 = 4.8828125 mV; the last code lies one step below 10 V."""
    volts = np.array([0.0, 0.002, 0.003, 4.0, -4.0, 10.0, -10.0, 12.0])
    expected = np.array([0, 0, 1, 819, -819, 2047, -2048, 2047]) * 0.0048828125
    reading = read_voltage(volts, Instruments(voltage_bits=12), chance())
    np.testing.assert_array_equal(reading, expected)
    made = put_out(volts[:-1], Instruments(command_bits=12))
    np.testing.assert_array_equal(made, expected[:-1])
    np.testing.assert_array_equal(put_out(volts[:-1], NONE), volts[:-1])
    with pytest.raises(InputError, match="The command reaches 12 V, but the card takes ±10 V"):
        put_out(volts, NONE)


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
        # 1.01 · √(0.3² + 0.4²) + 0.004 = 0.509; at zero it reads its floor
        (0.3, 0.0, {"current_gain_error": 0.01, "current_zero": 4e-3, "current_floor": 0.4}, 0.509),
        (0.0, 0.0, {"current_gain_error": 0.01, "current_zero": 4e-3, "current_floor": 0.4}, 0.408),
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


def test_an_averaging_ammeter_counts_the_ripple_in_and_flattens_it() -> None:
    """√(I² + h²/3): a triangle between −h and h has the mean square h²/3."""
    level = np.full(GRID.size, 0.6)
    height = 0.1
    slow = ammeter(level, 0.0 * level, dither=height, averaging_time=0.2)[4096:]
    assert slow.mean() == pytest.approx(np.sqrt(0.36 + height**2 / 3.0), rel=1e-4)
    assert slow.std() < 0.005 * height


def test_an_averaging_ammeter_lags_like_a_first_order_square() -> None:
    """y² = 1 − exp(−t/T) behind a step to 1 A."""
    step = np.where(GRID >= 1.0, 1.0, 0.0)
    reading = ammeter(step, 0.0 * step, averaging_time=0.05)
    assert reading[511] == 0.0
    since = GRID[530:700] - 1.0
    # the step itself is a line one sample long, half of which is late
    expected = np.sqrt(1.0 - np.exp(-(since + 0.5 / 512.0) / 0.05))
    np.testing.assert_allclose(reading[530:700], expected, rtol=5e-3)


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


def test_counts_are_right_on_average() -> None:
    angle, tools = np.array([0.0, 1.2345]), Instruments(encoder_step=1)
    last = [read_counts(angle, 36.0, tools, np.random.default_rng(k))[-1] for k in range(4000)]
    exact = 1.2345 * 36.0 / (2.0 * np.pi)
    assert set(last) == {np.floor(exact), np.ceil(exact)}
    assert np.mean(last) == pytest.approx(exact, abs=4.0 * 0.5 / np.sqrt(4000))


def test_a_counter_of_eight_bits_rolls_over() -> None:
    turns = np.array([0.0, 127.0, 128.0, 255.0, 256.0, 299.0, -128.0, -129.0])
    counts = read_counts(2.0 * np.pi * turns, 1.0, Instruments(counter_bits=8), chance())
    np.testing.assert_allclose(counts, [0, 127, -128, -1, 0, 43, -128, 127])


def test_transducers_are_noisy_in_proportion() -> None:
    signal = 3e6 * np.sin(GRID)
    reading = read_transducer(signal, Instruments(transducer_noise=0.01), chance())
    assert (reading - signal).std() == pytest.approx(3e4, rel=0.04)
    np.testing.assert_array_equal(read_transducer(signal, NONE, chance()), signal)


def test_stamps_tell_the_jitter_but_not_the_hidden_part() -> None:
    tools = Instruments(jitter=2e-4, hidden_jitter=1e-4, stamp_resolution=1e-6)
    instants, stamps = sampled_instants(GRID, tools, chance())
    inner = slice(1, -1)
    assert (stamps - GRID)[inner].std() == pytest.approx(2e-4, rel=0.05)
    assert (instants - stamps)[inner].std() == pytest.approx(1e-4, rel=0.05)
    assert np.diff(stamps).min() > 0.0
    assert np.diff(instants).min() > 0.0
    assert instants.min() >= 0.0
    assert instants.max() <= GRID[-1]
    np.testing.assert_array_equal(stamps, np.round(stamps, 6))
    for each in sampled_instants(GRID, NONE, chance()):
        np.testing.assert_array_equal(each, GRID)
    # however large it is, it keeps the order
    for each in sampled_instants(GRID, Instruments(jitter=1.0, hidden_jitter=1.0), chance()):
        assert np.diff(each).min() > 0.0


@pytest.mark.parametrize("longest", [1, 20])
def test_a_share_of_rows_is_lost_in_runs(longest: int) -> None:
    gone = lost(1_000_000, 0.01, longest, chance())
    # runs overlap now and then
    assert gone.mean() == pytest.approx(0.01, rel=0.05)
    changes = np.flatnonzero(np.diff(gone.astype(int)))
    lengths = np.diff(changes)[0 if gone[changes[0] + 1] else 1 :: 2]
    assert lengths.min() == 1
    assert lengths.mean() == pytest.approx(0.5 * (1 + longest), rel=0.06)
    assert not lost(1000, 0.0, longest, chance()).any()


def test_the_play_operator_sample_by_sample() -> None:
    drives = np.cumsum(np.random.default_rng(0).normal(size=3000))
    behind, expected = drives[0], []
    for position in drives:
        behind = max(position - 0.75, min(position + 0.75, behind))
        expected.append(behind)
    np.testing.assert_array_equal(play(drives, 1.5), expected)
    np.testing.assert_array_equal(play(drives[:1], 1.0), drives[:1])
    np.testing.assert_array_equal(play(drives[:3], 0.0), drives[:3])


def test_clean_instruments_are_none_and_realistic_ones_have_nothing_systematic() -> None:
    assert SEVERITIES["clean"] == Instruments()
    tools = SEVERITIES["realistic"]
    systematic = (
        "voltage_offset current_gain_error current_zero current_floor averaging_time "
        "hidden_jitter counter_bits empty_cells"
    )
    assert [getattr(tools, name) for name in systematic.split()] == [0.0] * 8
    # what is read back has the steps of what is put out
    assert tools.command_bits == tools.voltage_bits == 12


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"jitter": -1.0}, "jitter must not be negative, not -1."),
        ({"dither": float("nan")}, "dither must be finite, not nan."),
        ({"lost_rows": 2.0}, "lost_rows is a share, at most 1, not 2."),
        ({"full_current": 0.0}, "full_current must be positive, not 0."),
    ],
)
def test_impossible_instruments_are_refused(change: dict[str, float], sentence: str) -> None:
    with pytest.raises(InputError) as error:
        replace(NONE, **change)
    assert str(error.value) == sentence
