import math

import numpy as np
import pytest

from swashplate import maneuvers


def test_sine_starts_at_one_second_and_peaks_a_quarter_period_later():
    m = maneuvers.sine(6.5, 0.1, length=30.0)
    expected = [0.0, 0.0, 6.5, 0.0, -6.5]
    np.testing.assert_allclose(m([0.5, 1.0, 3.5, 6.0, 8.5]), expected, atol=1e-14)
    assert m.slope(1.0) == pytest.approx(6.5 * math.tau * 0.1, rel=1e-15)
    # The return begins at 27.5 s: 2.65 periods.
    assert m(27.5) == pytest.approx(6.5 * math.sin(math.tau * 2.65), rel=1e-13)


def test_chirp_sweeps_its_frequency_evenly():
    m = maneuvers.chirp(4.0, 0.5, 0.1, start=1.0, settle=2.0, length=23.0)
    # Phase after t seconds, in turns: 0.5 t − 0.01 t²; 4 at 10 s and 6 at 20 s, where it is slow.
    np.testing.assert_allclose(m([1.0, 11.0, 21.0]), [0.0, 0.0, 0.0], atol=1e-13)
    expected = 4.0 * math.tau * np.array([0.5, 0.3, 0.1])
    np.testing.assert_allclose(m.slope([1.0, 11.0, 21.0]), expected, rtol=1e-12)


def test_multisine_has_the_frequencies_it_was_given_equally_large():
    # 20 s active: 0.25, 0.6 and 1.5 Hz are its lines 5, 12 and 30.
    m = maneuvers.multisine(5.0, [0.25, 0.6, 1.5], settle=2.0, length=23.0)
    spectrum = np.abs(np.fft.rfft(m.sample()[512 : 512 * 21]))
    assert np.flatnonzero(spectrum > 1e-6 * spectrum.max()).tolist() == [5, 12, 30]
    np.testing.assert_allclose(spectrum[[5, 12, 30]], spectrum[5], rtol=1e-10)


def test_multisine_band_is_rounded_to_whole_periods():
    m = maneuvers.multisine(5.0, (0.11, 0.52, 4), settle=2.0, length=23.0)
    # 0.11, 0.2467, 0.3833 and 0.52 Hz make 2.2, 4.93, 7.67 and 10.4 periods in 20 s.
    spectrum = np.abs(np.fft.rfft(m.sample()[512 : 512 * 21]))
    assert np.flatnonzero(spectrum > 1e-6 * spectrum.max()).tolist() == [2, 5, 8, 10]
    assert m(1.0) == pytest.approx(m(21.0), rel=1e-12)
    assert m.slope(1.0) == pytest.approx(m.slope(21.0), rel=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_multisine_peaks_at_its_amplitude(seed):
    m = maneuvers.multisine(5.0, (0.05, 2.0, 20), seed=seed)
    peak = np.abs(m(np.linspace(1.0, 57.5, 200_001))).max()
    assert 5.0 * (1 - 2e-4) < peak <= 5.0


def test_multisine_is_its_seed():
    first = maneuvers.multisine(5.0, (0.05, 1.0, 10), seed=1).sample()
    np.testing.assert_array_equal(first, maneuvers.multisine(5.0, (0.05, 1.0, 10), seed=1).sample())
    assert np.abs(first - maneuvers.multisine(5.0, (0.05, 1.0, 10), seed=2).sample()).max() > 1.0
