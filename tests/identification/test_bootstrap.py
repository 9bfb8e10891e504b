"""Estimates from other noise, and profiles, of models that can be followed by hand."""

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from scipy.signal import lfilter
from tests.identification.linear import linear_fit, unknowns_of

from swashplate import Experiment
from swashplate.errors import InputError
from swashplate.executors import Serial
from swashplate.identification.assessment import Assessment
from swashplate.identification.fitting import StageFit
from swashplate.identification.noise import spectral_covariance
from swashplate.identification.problem import LinearisedFit, LinearisedRun, Problem
from swashplate.identification.profile import profiles_of
from swashplate.identification.resampling import Bootstrap, NoiseDraws, bootstraps_of
from swashplate.identification.setup import Free, Stage
from swashplate.identification.solving import solve
from swashplate.identification.unknowns import Unknown, Unknowns
from swashplate.parameters.files import load_preset

N, RUNS = 2048, 4
TIME = np.arange(N) / 512.0
DESIGN = np.column_stack([1.0 - np.exp(-TIME / 0.3), np.sin(2.0 * TIME)])
LINE_TIME = np.linspace(0.0, 4.0, 81)


def coloured(rho: float, seed: int) -> np.ndarray:
    white = np.random.default_rng(seed).normal(size=(RUNS, N + 400))
    return lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], white)[:, 400:]


def regression(noise: np.ndarray) -> LinearisedFit:
    """Two unknowns fitted to noise alone, by linear least squares."""
    estimate = -np.linalg.solve(RUNS * DESIGN.T @ DESIGN, DESIGN.T @ noise.sum(axis=0))
    runs = [
        LinearisedRun(f"run {k}", "speed", TIME, each + DESIGN @ estimate, DESIGN)
        for k, each in enumerate(noise)
    ]
    return linear_fit(runs, unknowns_of("ab", [2.0, 1.0]))


def test_estimates_from_draws_scatter_as_the_covariance_says() -> None:
    made = regression(coloured(0.95, 1))
    draws = NoiseDraws(made, seed=1)
    total = np.array([np.sum(draws.differences(k), axis=0) for k in range(500)])
    found = np.linalg.solve(RUNS * DESIGN.T @ DESIGN, DESIGN.T @ total.T)
    # 500 draws tell a deviation to 3 %, and each method knows the noise at the low frequencies of
    # the derivatives to some 10 %
    expected = spectral_covariance(made).standard_errors
    np.testing.assert_allclose(found.std(axis=1), expected, rtol=0.2)


@pytest.mark.parametrize("rho", [0.0, 0.9, 0.98])
def test_draws_have_the_colour_and_size_of_the_noise(rho: float) -> None:
    drawn = np.array(NoiseDraws(regression(coloured(rho, 2)), seed=3).differences(0))
    # of 4 runs of 4 s: at 0.98 their size is known to 10 %
    assert drawn.std() == pytest.approx(1.0, rel=0.25)
    lag_one = np.mean(drawn[:, 1:] * drawn[:, :-1]) / np.mean(drawn**2)
    assert lag_one == pytest.approx(rho, abs=0.05)


def test_quantiles_by_hand() -> None:
    found = Bootstrap(unknowns_of("a", [1.0]), np.arange(101.0)[:, None], np.ones(1, bool), 0, 0)
    assert found.intervals()[0] == pytest.approx((2.5, 97.5))
    unknown = Bootstrap(found.variables, found.vectors, np.zeros(1, bool), 3, 0)
    assert unknown.intervals() == (None,)
    assert "3 of 104 refits did not end" in unknown.sentences()[1]


def test_too_few_draws_are_refused() -> None:
    found = Bootstrap(unknowns_of("a", [1.0]), np.arange(10.0)[:, None], np.ones(1, bool), 0, 0)
    with pytest.raises(InputError, match="10 draws do not reach the ends"):
        found.intervals()


class Line:
    """y = slope · t + level."""

    def simulate(
        self, values: Mapping[str, float], experiment: Experiment
    ) -> Mapping[str, np.ndarray]:
        return {"y": values["slope"] * experiment["y"].time + values["level"]}


class Backwards(Serial):
    """Results in another order than asked for, as from several processes."""

    def run(self, function, shared, items):  # type: ignore[no-untyped-def]
        yield from reversed(list(super().run(function, shared, items)))


@pytest.fixture
def assessed(experiment: Callable[..., Experiment]) -> Assessment:
    """A line fitted to four runs with white noise of 0.1."""
    rng = np.random.default_rng(7)
    runs = tuple(
        experiment(f"run {k}", 1.0, 2.0 * LINE_TIME + 1.0 + 0.1 * rng.normal(size=81))
        for k in range(4)
    )
    unknowns = Unknowns((Unknown("slope", 1.5, 0.0, 4.0), Unknown("level", 0.5, -3.0, 3.0)))
    problem = Problem(Line(), runs, unknowns, ("y",), {"y": 0.1})
    stage = Stage(name="line", part="chain", free={"J": Free(relative=(0.5, 2.0))})
    return Assessment(StageFit(stage, problem, solve(problem), load_preset("neutral")))


def textbook() -> np.ndarray:
    """Standard errors of slope and level from 4 times 81 samples with noise 0.1."""
    design = np.column_stack([LINE_TIME, np.ones(81)])
    return 0.1 * np.sqrt(np.diag(np.linalg.inv(4.0 * design.T @ design)))


def test_refits_scatter_as_the_textbook_says(assessed: Assessment) -> None:
    found = bootstraps_of([assessed], 200, seed=3)["line"]
    assert found.failed == 0
    # 200 draws tell a standard deviation to 5 %, and the noise itself is known to 4 %
    np.testing.assert_allclose(found.values.std(axis=0), textbook(), rtol=0.2)
    np.testing.assert_allclose(
        found.values.mean(axis=0),
        list(assessed.stage.values.values()),
        atol=float(4.0 * textbook().max() / np.sqrt(200.0)),
    )
    with pytest.raises(InputError, match="1 draws do not make a distribution"):
        bootstraps_of([assessed], 1)


def test_draws_do_not_depend_on_the_order_in_which_they_are_done(assessed: Assessment) -> None:
    counts: list[int] = []
    forwards = bootstraps_of([assessed], 40, seed=3)["line"]
    backwards = bootstraps_of([assessed], 40, seed=3, executor=Backwards(), watch=counts.append)
    np.testing.assert_array_equal(forwards.vectors, backwards["line"].vectors)
    assert counts == list(range(1, 41))
    other = bootstraps_of([assessed], 40, seed=4)["line"]
    assert not np.array_equal(forwards.vectors, other.vectors)


def test_profiles_of_a_linear_model_are_its_intervals(assessed: Assessment) -> None:
    found = profiles_of(assessed, executor=Backwards())
    assert list(found) == ["slope", "level"]
    variables = assessed.uncertainty.own.variables
    for k, (name, each) in enumerate(found.items()):
        estimate = assessed.uncertainty.estimates[k]
        assert (estimate.name, each.index) == (name, k)
        ends = variables.to_values(np.array([[each.lower] * 2, [each.upper] * 2]))[:, k]
        np.testing.assert_allclose(ends, [estimate.lower, estimate.upper], rtol=2e-3)
