"""Most probable largest values: closed forms, and Gaussian signals whose extreme is known."""

from math import exp, log, pi, sqrt

import numpy as np
import pytest

from swashplate.crane.sea.extremes import largest_of_gaussian, largest_of_peaks, peaks_of

DURATION = 10_800.0


def test_one_component_is_rices_formula():
    # ν = ω/π exp(-r²/(2 σ²)) for both signs; once in the duration
    found = largest_of_gaussian([[4.0]], [[4.0 * 0.6**2]], DURATION)
    assert found == pytest.approx(2.0 * sqrt(2.0 * log(DURATION * 0.6 / pi)), rel=1e-8)


def test_two_equal_components_are_a_rayleigh_radius():
    """Out of a circle of radius r the rate is r/σ² exp(-r²/(2 σ²)) σ'/√(2π)."""
    (radius,) = largest_of_gaussian([[4.0, 4.0]], [[4.0 * 0.6**2] * 2], DURATION)
    rate = radius / 4.0 * exp(-(radius**2) / 8.0) * 2.0 * 0.6 / sqrt(2.0 * pi)
    assert rate * DURATION == pytest.approx(1.0, rel=1e-3)


def test_a_thin_second_component_changes_nothing():
    line = largest_of_gaussian([[4.0]], [[1.44]], DURATION)
    thin = largest_of_gaussian([[4.0, 1e-6]], [[1.44, 1e-6]], DURATION)
    np.testing.assert_allclose(thin, line, rtol=1e-3)
    # and which of them is the wider one does not matter
    turned = largest_of_gaussian([[1e-6, 4.0]], [[1e-6, 1.44]], DURATION)
    np.testing.assert_allclose(turned, thin, rtol=1e-12)


def gaussian(duration, damping, components, seed):
    """A Gaussian process about 0.6 rad/s with a damping ratio, 8 samples a second."""
    random, count = np.random.default_rng(seed), round(8.0 * duration)
    omega = 2.0 * pi * np.fft.rfftfreq(count, 1.0 / 8.0)
    resonance = np.abs(1.0 / (0.36 - omega**2 + 2j * damping * 0.6 * omega))
    resonance[(omega < 0.2) | (omega > 3.0)] = 0.0
    drawn = random.standard_normal((2, components, omega.size))
    return np.fft.irfft(resonance * (drawn[0] + 1j * drawn[1]), count, axis=1)


@pytest.mark.parametrize("components", [1, 2])
@pytest.mark.parametrize("damping", [0.05, 0.2])
def test_peaks_give_the_extreme_that_is_known(damping, components):
    """Eighty runs of ten minutes, as of an assessment; the extreme of the process is Rice's."""
    signal = gaussian(DURATION * 20, damping, components, seed=1)
    variance, rates = signal.var(axis=1), (8.0 * np.gradient(signal, axis=1)).var(axis=1)
    (known,) = largest_of_gaussian(variance[None], rates[None], DURATION)
    size = np.sqrt((signal**2).sum(axis=0))
    held = 0
    for seed in range(20):
        starts = np.random.default_rng(seed).integers(0, size.size - 4800, 80)
        runs = [peaks_of(size[start : start + 4800]) for start in starts]
        found = largest_of_peaks(runs, 80 * 600.0, DURATION)
        assert found.value == pytest.approx(known, rel=0.12)
        held += found.low <= known <= found.high
    assert held >= 14  # of 20, of 95 % intervals: 19 expected


def test_too_few_peaks_have_no_extreme():
    few = largest_of_peaks([np.array([1.0, 2.0, 3.0])], 600.0)
    assert np.isnan(few.value)
    assert np.isnan(few.low)


def test_peaks_are_local_maxima():
    np.testing.assert_array_equal(peaks_of(np.array([0.0, 2.0, 1.0, 1.5, 1.5, 0.0])), [2.0, 1.5])
