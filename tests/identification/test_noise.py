"""Noise of residuals: correlation over time, and errors of the estimates."""

import numpy as np
import pytest
from scipy.linalg import matmul_toeplitz
from scipy.stats import t as student
from tests.identification.given import first_order, linear_fit, unknowns_of

from swashplate.identification import Unknown, Unknowns, uncertainty
from swashplate.identification.estimation.problem import LinearisedFit, LinearisedRun
from swashplate.identification.noise import (
    NoiseColour,
    band_score_covariance,
    noise_colours,
    spectral_covariance,
)

RUNS, N, RATE = 4, 4096, 512.0
TIME = np.arange(N) / RATE
LEVEL = np.clip((TIME - 1.0) / 0.2, 0.0, 1.0) - np.clip((TIME - 6.0) / 0.2, 0.0, 1.0)
BUMP = np.exp(-((TIME - 2.0) ** 2) / 0.02)
DESIGN = np.column_stack([LEVEL, np.sin(1.7 * TIME), BUMP])


def linearised(
    name: str, residual: np.ndarray, channel: str = "current", **more: object
) -> LinearisedRun:
    """A run from 0 s on."""
    how = {"time": TIME[: residual.size], **more}
    return LinearisedRun(name, channel, residual=residual, **how)


def fitted(
    noise: np.ndarray, weight: np.ndarray | None = None, design: np.ndarray = DESIGN
) -> tuple[LinearisedFit, np.ndarray]:
    """Weighted regression of noise (runs, samples) on a design, the truth being 0."""
    count = noise.shape[1]
    w = np.ones(count) if weight is None else weight
    design = design[:count]
    rows = w[:, None] * design
    estimate = -np.linalg.solve(
        len(noise) * rows.T @ rows, sum(rows.T @ (w * each) for each in noise)
    )
    runs = [
        linearised(f"run {k}", w * (e + design @ estimate), weight=weight)
        for k, e in enumerate(noise)
    ]
    names = [f"p{k}" for k in range(design.shape[1])]
    variables = unknowns_of(names, np.ones(len(names)))
    return linear_fit(runs, [rows] * len(runs), variables), estimate


# --- correlation over time ------------------------------------------------------------------------


def level(*runs: LinearisedRun) -> LinearisedFit:
    """A fit of a level."""
    levels = [np.ones((run.time.size, 1)) for run in runs]
    return linear_fit(runs, levels, unknowns_of(["p"], [1.0]))


def colour(residual: np.ndarray, time: np.ndarray | None = None) -> NoiseColour:
    time = np.arange(residual.size) / RATE if time is None else time
    run = linearised("a", residual, time=time)
    return noise_colours(level(run))[0]


def test_gaps_and_jitter_of_stamps_do_not_change_the_colour() -> None:
    """The longest is of years, which costs no memory."""
    rng = np.random.default_rng(3)
    noise = first_order(0.9, rng, (100_000,))
    kept = np.ones(noise.size, bool)
    kept[20_000:50_000] = False
    kept[::7] = False
    time = (np.arange(noise.size) + rng.uniform(-0.3, 0.3, noise.size)) / RATE
    time[50_000:] += 1e9
    assert colour(noise[kept], time=time[kept]).inflation == pytest.approx(19.0, rel=0.15)


def test_slow_noise_under_white_noise_is_seen() -> None:
    """A first-order plug-in from lag one would see ρ = 0.1 and an inflation of 1.2."""
    rng = np.random.default_rng(5)
    slow = first_order(0.99, rng, (100_000,))
    mixed = np.sqrt(0.9) * rng.normal(size=slow.size) + np.sqrt(0.1) * slow
    assert colour(mixed).inflation == pytest.approx(0.9 + 0.1 * 199.0, rel=0.25)


def test_drifts_and_next_to_no_residuals() -> None:
    assert colour(np.linspace(-1.0, 1.0, 2000)).drifting
    assert not colour(first_order(0.5, np.random.default_rng(1), (4000,))).drifting
    assert colour(np.array([0.3])).inflation == 1.0
    assert colour(np.zeros(100)).inflation == 1.0


def test_what_correlation_does_to_intervals_is_said() -> None:
    """First order with 0.9: 1.9/0.1 = 19 samples are worth one, intervals √19 times as wide."""
    found = colour(first_order(0.9, np.random.default_rng(2), (400_000,)))
    assert "about 4.4 times as wide" in found.sentence


def test_channels_and_steps_have_their_own_colours() -> None:
    kinds = (("a", "speed", RATE), ("a", "current", RATE), ("b", "speed", 100.0))
    runs = [
        linearised(name, TIME[:100], channel, time=np.arange(100) / rate)
        for name, channel, rate in (*kinds, ("c", "speed", RATE))
    ]
    found = [(each.channel, each.members) for each in noise_colours(level(*runs))]
    assert found == [("speed", (0, 3)), ("current", (1,)), ("speed", (2,))]


def ripple(rng: np.random.Generator, level: np.ndarray | float = 1.0) -> np.ndarray:
    """A 100 Hz ripple far above white noise, of another phase in each run."""
    phase = rng.uniform(0.0, 2.0 * np.pi, (RUNS, 1))
    return 8.0 * level * np.sin(2.0 * np.pi * 100.03 * TIME + phase)


@pytest.mark.slow
def test_errors_are_those_of_the_noise_under_a_ripple() -> None:
    """Estimates scatter by the noise alone, as the ripple averages out; errors say so."""
    rng = np.random.default_rng(2)
    estimates, errors = [], []
    for _ in range(60):
        fit, estimate = fitted(rng.normal(size=(RUNS, N)) + ripple(rng, LEVEL))
        estimates.append(estimate)
        errors.append(uncertainty(fit).quoted.standard_errors)
    scatter = np.sqrt(np.mean(np.square(estimates), axis=0))
    # 60 draws tell a standard deviation to 9 %
    np.testing.assert_allclose(np.mean(errors, axis=0), scatter, rtol=0.3)


# --- errors ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("rho", [0.0, 0.95])
def test_errors_are_those_of_the_true_noise(rho: float, weighted: bool) -> None:
    """By hand from the known autocovariance ρ^|k|."""
    rng = np.random.default_rng(1)
    weight = np.where(TIME < 4.0, 2.0, 1.0) if weighted else np.ones(N)
    errors = [
        spectral_covariance(fitted(first_order(rho, rng, (RUNS, N)), weight)[0]).standard_errors
        for _ in range(20)
    ]
    columns = (weight**2)[:, None] * DESIGN
    inner = RUNS * columns.T @ matmul_toeplitz(rho ** np.arange(N), columns)
    inverse = np.linalg.inv(RUNS * DESIGN.T @ columns)
    expected = np.sqrt(np.diag(inverse @ inner @ inverse))
    # each from 4 runs of 8 s: about 20 independent frequencies, 20 campaigns
    found = np.sqrt(np.mean(np.square(errors), axis=0))
    np.testing.assert_allclose(found, expected, rtol=0.15)


@pytest.mark.slow
def test_intervals_under_coloured_noise_cover_the_truth() -> None:
    """120 campaigns of ρ = 0.98: 95 % within three standard deviations of 360 cases."""
    rng, inside = np.random.default_rng(10), []
    for _ in range(120):
        fit, estimate = fitted(first_order(0.98, rng, (RUNS, 2048)))
        found = uncertainty(fit).quoted
        reach = student.ppf(0.975, found.degrees_of_freedom) * found.standard_errors
        inside.append(np.abs(estimate) <= reach)
    assert 0.915 <= np.mean(inside) <= 0.985


def test_perfect_data_give_zero_errors_and_no_nan() -> None:
    found = uncertainty(fitted(np.zeros((RUNS, N)))[0])
    assert all(each.standard_error == 0.0 for each in found.estimates)
    assert np.isfinite(found.inflation).all()
    assert "exactly zero" in found.sentences()[0]


def test_runs_have_levels_of_their_own() -> None:
    rng = np.random.default_rng(3)
    loud = first_order(0.5, rng, (RUNS, N)) * np.array([[5.0], [1.0], [1.0], [1.0]])
    quiet = first_order(0.5, rng, (RUNS, N))
    errors = [spectral_covariance(fitted(each)[0]).standard_errors for each in (loud, quiet)]
    # (25 + 3)/4 of the variance
    np.testing.assert_allclose(errors[0] / errors[1], np.sqrt(7.0), rtol=0.35)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "width"), [("ripple", 0.02), ("with every pulse", 0.15)])
def test_noise_that_differs_along_the_runs(kind: str, width: float) -> None:
    """12 Hz come to the same phase every second: the pulses' errors add up, not their squares."""
    rng = np.random.default_rng(5)
    pulses = (np.abs(TIME % 1.0 - 0.5) < width).astype(float)
    estimates, errors = [], []
    for _ in range(80):
        noise = rng.normal(size=(6, N))
        if kind == "ripple":
            phase = rng.uniform(0.0, 2.0 * np.pi, (6, 1))
            noise += np.sin(2.0 * np.pi * 12.0 * TIME + phase)
        else:
            noise *= 1.0 + 4.0 * pulses
        fit, estimate = fitted(noise, design=np.column_stack([pulses, np.ones(N)]))
        estimates.append(estimate[0])
        errors.append(band_score_covariance(fit).standard_errors[0])
    ratio = np.sqrt(np.mean(np.square(errors)) / np.mean(np.square(estimates)))
    # 80 draws tell a standard deviation to 8 %
    assert 0.8 < ratio < 1.25


# --- many runs ------------------------------------------------------------------------------------


def dense_covariances(
    residuals: list[np.ndarray], jacobians: list[np.ndarray], weights: list[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """By the smoothed spectrum and by band scores, from derivatives (n, K) of all runs at once."""
    factor = np.linalg.qr(np.vstack(jacobians), mode="r")
    inverse = np.linalg.inv(factor)
    spectra, powers, left, frequencies = [], [], [], []
    for residual, jacobian, weight in zip(residuals, jacobians, weights, strict=True):
        directions, size = jacobian @ inverse, np.sqrt(residual.size)
        derivatives = np.fft.rfft(weight[:, None] * directions, axis=0) / size
        by_estimate = np.fft.rfft(directions / weight[:, None], axis=0) / size
        noise, level = residual / weight, np.mean((residual / weight) ** 2)
        spectrum = np.fft.rfft(noise) / size
        twice = np.full(spectrum.size, 2.0)
        twice[[0, -1]] = 1.0
        spectra.append((derivatives, spectrum, twice, level))
        powers.append(np.abs(spectrum) ** 2 / level)
        leverage = np.sum((derivatives.conj() * by_estimate).real, axis=1)
        left.append(1.0 - np.clip(leverage, 0.0, 1.0))
        frequencies.append(np.fft.rfftfreq(residual.size, 1.0 / RATE))
    order = np.argsort(np.concatenate(frequencies), kind="stable")

    def smoothed(parts: list[np.ndarray]) -> np.ndarray:
        """Sums over 21 neighbours of all runs, in the order of the runs again."""
        padded = np.pad(np.concatenate(parts)[order], (10, 10), mode="reflect")
        sums = np.empty(order.size)
        sums[order] = np.convolve(padded, np.ones(21), mode="valid")
        return sums

    shapes = np.split(
        smoothed(powers) / np.maximum(smoothed(left), 2.1),
        np.cumsum([each.size for each in powers])[:-1],
    )
    by_spectrum, by_bands = np.zeros_like(factor), np.zeros_like(factor)
    for (derivatives, spectrum, twice, level), shape, at in zip(
        spectra, shapes, frequencies, strict=True
    ):
        density = level * shape * twice
        by_spectrum += ((derivatives.conj().T * density) @ derivatives).real
        products = derivatives.conj() * (twice * spectrum)[:, None]
        for band in np.unique(np.floor(at / 10.0)):
            score = products[np.floor(at / 10.0) == band].sum(axis=0)
            by_bands += 0.5 * np.outer(score.conj(), score).real
    return inverse @ by_spectrum @ inverse.T, inverse @ by_bands @ inverse.T


def test_covariances_run_by_run_are_those_of_all_derivatives_at_once() -> None:
    """Three runs of different lengths with a free zero each; in one the weights differ."""
    rng, sizes = np.random.default_rng(4), (800, 1200, 1000)
    names = [f"run {k}" for k in range(3)]
    zeros = [Unknown("zero", 1.0, -9.0, 9.0, run=name) for name in names]
    machine = [Unknown(name, 1.0, -9.0, 9.0) for name in ("a", "b", "c")]
    # the order of the unknowns is not that of the runs
    variables = Unknowns((zeros[2], machine[0], zeros[0], *machine[1:], zeros[1]))
    runs, derivatives, dense, weights, residuals = [], [], [], [], []
    for name, size in zip(names, sizes, strict=True):
        weight = np.where(TIME[:size] < 1.0, 2.0, 0.5) if name == "run 1" else np.full(size, 3.0)
        rows = weight[:, None] * np.column_stack([np.ones(size), rng.uniform() * DESIGN[:size]])
        residual = weight * first_order(0.9, rng, (size,))
        matrix = np.zeros((size, len(variables)))
        matrix[:, variables.columns(name)] = rows
        runs.append(linearised(name, residual, weight=weight))
        derivatives.append(rows)
        dense.append(matrix)
        weights.append(weight)
        residuals.append(residual)
    fit = linear_fit(runs, derivatives, variables)
    expected = dense_covariances(residuals, dense, weights)
    found_ones = spectral_covariance(fit), band_score_covariance(fit)
    for found, matrix in zip(found_ones, expected, strict=True):
        np.testing.assert_allclose(found.matrix, matrix, rtol=1e-8, atol=1e-12 * matrix.max())
        assert found.determined.all()
        # as many as bands or independent frequencies at most, and of the zeros not many times fewer
        assert found.degrees_of_freedom.min() > 1.0
        assert found.degrees_of_freedom.max() < 2.0 * sum(sizes)
