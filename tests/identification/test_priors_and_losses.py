"""Priors count as much as residuals are worth, and robust losses have intervals that know it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from tests.identification.given import first_order, model_of, run_of

from swashplate import InputError
from swashplate.identification.intervals import estimates, prior_sentences, uncertainty, weighed
from swashplate.identification.problem import Loss, Problem, influence, linearised_fit
from swashplate.identification.solving import solve
from swashplate.identification.unknowns import Prior, Unknown, Unknowns

COUNT, MEMORY = 40_000, 0.95


LEVEL = model_of(lambda values, time, _: np.full(time.size, values["level"]))


def problem(prior: Prior | None, *, memory: float, scale: float = 1.0) -> Problem:
    """A level of 2 under noise of variance 1 with this correlation from sample to sample."""
    noise = first_order(memory, np.random.default_rng(5), (COUNT,))
    unknowns = Unknowns((Unknown("level", 1.0, 0.1, 9.0, prior=prior),))
    time, ones = 0.01 * np.arange(COUNT), np.ones(COUNT)
    run = run_of("run", ones, {"y": 2.0 + noise}, time=time, kind="other", hold="previous")
    return Problem(LEVEL, (run,), unknowns, ("y",), {"y": scale})


def posterior(found: Problem, prior: Prior, memory: float) -> tuple[float, float]:
    """Mean and deviation by hand: a mean has (1 + a)/(1 - a)/n of the noise's variance."""
    mean = float(found.experiments[0]["y"].values.mean())
    data = COUNT * (1.0 - memory) / (1.0 + memory)
    known = 1.0 / prior.deviation**2
    return (data * mean + known * prior.mean) / (data + known), (data + known) ** -0.5


@pytest.mark.parametrize("scale", [1.0, 0.1], ids=["noise as stated", "noise ten times as stated"])
@pytest.mark.parametrize("memory", [0.0, MEMORY], ids=["white", "coloured"])
def test_estimate_and_interval_are_those_of_bayes(memory: float, scale: float) -> None:
    data = COUNT * (1.0 - memory) / (1.0 + memory)
    prior = Prior(2.0 + 3.0 * data**-0.5, data**-0.5)  # as sharp as the data, and beside them
    given = problem(prior, memory=memory, scale=scale)
    first = solve(given).vector
    found = weighed(given, first)
    best = solve(found, first).vector
    mean, deviation = posterior(given, prior, memory)
    assert float(best[0]) == pytest.approx(mean, abs=0.1 * deviation)
    told = uncertainty(linearised_fit(found, best))
    (estimate,) = estimates(told.quoted)
    half = 0.5 * (estimate.upper - estimate.lower)
    assert half == pytest.approx(1.96 * deviation, rel=0.1)
    if (memory, scale) != (0.0, 1.0):
        # unweighed the data would have swept the prior aside
        assert abs(first[0] - mean) > abs(best[0] - mean) + 0.3 * deviation
    (said,) = prior_sentences(found.unknowns, best, told.quoted)
    assert "contributes 5" in said or "contributes 4" in said  # half of what is known
    assert "below its mean" in said


def test_what_the_data_leave_open_is_the_prior() -> None:
    given = problem(Prior(2.0, 1.0), memory=MEMORY)
    # the model uses neither; a prior in the logarithm is a share of its mean
    known = {"low": 0.1, "high": 9.0, "prior": Prior(3.0, 0.2)}
    spare = Unknown("spare", 5.0, **known), Unknown("other", 5.0, **known, log=True)
    given = replace(given, unknowns=Unknowns((*given.unknowns, *spare)))
    found = weighed(given, solve(given).vector)
    best = solve(found).vector
    _, plain, log = estimates(uncertainty(linearised_fit(found, best)).quoted)
    assert (plain.value, log.value) == pytest.approx((3.0, 3.0), abs=1e-6)
    assert plain.upper - plain.lower == pytest.approx(2.0 * 1.959964 * 0.2, rel=1e-3)
    assert log.upper / log.lower == pytest.approx(np.exp(2.0 * 1.959964 * 0.2), rel=1e-3)


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
