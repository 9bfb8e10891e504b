"""Robust losses: what they weigh, and intervals that know it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from tests.identification.test_prior_weights import problem

from swashplate import InputError
from swashplate.identification.intervals import uncertainty
from swashplate.identification.problem import Loss, Problem, influence, linearised_fit
from swashplate.identification.solving import solve
from swashplate.identification.unknowns import Unknown, Unknowns


def level(seed: int, *, count: int = 500, outliers: float = 0.1) -> Problem:
    """A level of 2 under white noise of variance 1, one sample in ten of ten times that."""
    random = np.random.default_rng(seed)
    noise = random.normal(size=count) * np.where(random.random(count) < outliers, 10.0, 1.0)
    made = problem(None, memory=0.0)
    (run,) = made.experiments
    y = run["y"]
    y = replace(y, time=y.time[:count], values=2.0 + noise, weight=np.ones(count))
    unknowns = Unknowns((Unknown("level", 1.0, -9.0, 9.0),))
    return replace(made, experiments=(replace(run, channels={"y": y}),), unknowns=unknowns)


@pytest.mark.parametrize("loss", ["linear", "soft_l1", "cauchy"])
def test_the_influence_is_the_gradient_that_scipy_searches_with(loss: Loss) -> None:
    residuals = np.random.default_rng(3).standard_cauchy(40)
    found = least_squares(lambda x: residuals + x, np.zeros(1), loss=loss, max_nfev=1)
    bounded, slopes = influence(residuals + found.x, loss)
    assert float(found.grad[0]) == pytest.approx(bounded.sum(), rel=1e-12)
    step = 1e-6
    above, below = (influence(residuals + found.x + d, loss)[0] for d in (step, -step))
    smooth = np.abs(np.abs(residuals + found.x) - 1.0) > 2.0 * step
    np.testing.assert_allclose(((above - below) / (2 * step))[smooth], slopes[smooth], atol=1e-7)


@pytest.mark.parametrize("loss", ["soft_l1", "cauchy"])
def test_intervals_hold_the_truth_among_outliers(loss: Loss) -> None:
    held, widths = 0, []
    for seed in range(1000, 1100):
        made = level(seed)
        vector = solve(made, loss=loss).vector
        (estimate,) = uncertainty(linearised_fit(made, vector, loss)).estimates
        held += estimate.lower <= 2.0 <= estimate.upper
        widths.append(estimate.upper - estimate.lower)
    # 100 campaigns tell a coverage of 95 % to 2.2 %
    assert held / 100 >= 0.88
    # the mean's own: 1.96 √(0.9 + 0.1·100)/√500 each way
    assert np.median(widths) < 0.5 * 2.0 * 1.96 * np.sqrt(10.9 / 500)


def test_a_loss_that_takes_all_for_outliers_is_refused() -> None:
    made = problem(None, memory=0.0, scale=1e-3)
    with pytest.raises(InputError, match="state a larger noise"):
        linearised_fit(made, np.array([2.0]), "cauchy")
