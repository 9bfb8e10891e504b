"""Intervals in the unknowns' own units, and whether they cover the truth as often as they say."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import t as student
from tests.identification.linear import linear_fit, unknowns_of

from swashplate.errors import InputError
from swashplate.identification.intervals import Uncertainty, estimates, uncertainty
from swashplate.identification.noise import Covariance
from swashplate.identification.problem import LinearisedFit, LinearisedRun


def covariance(freedom: float = np.inf, **more: object) -> Covariance:
    variables = unknowns_of(
        ["plain", "positive"], [3.0, 2.0], scales=[10.0, 1.0], logarithmic=[False, True], **more
    )
    matrix = np.diag([0.01, 0.04])
    return Covariance(variables, matrix, np.ones(2, bool), np.full(2, freedom))


def test_intervals_by_hand() -> None:
    plain, positive = estimates(covariance())
    assert plain.standard_error == pytest.approx(1.0)  # 0.1 of the scale 10
    assert (plain.lower, plain.upper) == pytest.approx((3.0 - 1.959964, 3.0 + 1.959964))
    # Student's quantile for 5 degrees of freedom, 2.570582
    assert estimates(covariance(5.0))[0].upper == pytest.approx(3.0 + 2.570582)
    # 20 % in the logarithm: 2 exp(±0.392)
    assert positive.standard_error == pytest.approx(0.4)
    assert (positive.lower, positive.upper) == pytest.approx((1.351418, 2.959854), rel=1e-6)


def test_at_a_bound_there_is_no_interval() -> None:
    plain, positive = estimates(covariance(at_bound=[-1, 1]))
    assert plain.status == "at its lower bound"
    assert positive.status == "at its upper bound"
    assert plain[3:] == (None, None, None, None)


def test_an_interval_beyond_a_hundredfold_is_none() -> None:
    """A standard error of 4 of the logarithm: its 95 % interval spans a factor of 2540 each way."""
    base = covariance()
    vast = np.diag([base.matrix[0, 0], 4.0**2])
    plain, positive = estimates(replace(base, matrix=vast))
    assert plain.status == "estimated"
    assert (positive.status, positive.lower, positive.upper) == ("undetermined", None, None)


# --- coverage -------------------------------------------------------------------------------------


RHO, RUNS, N = 0.98, 4, 2048
TIME = np.arange(N) / 512.0


def shapes(rng: np.random.Generator) -> np.ndarray:
    """Slow derivatives, one that a single transient tells, none white."""
    lag, turn = rng.uniform(0.1, 0.5), rng.uniform(0.3, 2.0)
    return np.column_stack(
        [
            1.0 - np.exp(-TIME / lag),
            np.sin(turn * TIME + rng.uniform(0.0, 6.0)),
            np.exp(-((TIME - rng.uniform(1.0, 3.0)) ** 2) / 0.02),
        ]
    )


def first_order(rng: np.random.Generator) -> np.ndarray:
    noise = rng.normal(size=(RUNS, N + 400))
    return lfilter([np.sqrt(1.0 - RHO**2)], [1.0, -RHO], noise)[:, 400:]


def fitted(designs: list[np.ndarray], noise: np.ndarray) -> tuple[LinearisedFit, np.ndarray]:
    """A linear regression whose truth is 0, and its estimate."""
    total = sum(each.T @ each for each in designs)
    estimate = -np.linalg.solve(total, sum(J.T @ e for J, e in zip(designs, noise, strict=True)))
    runs = [
        LinearisedRun(f"run {k}", "speed", TIME, e + J @ estimate, J)
        for k, (J, e) in enumerate(zip(designs, noise, strict=True))
    ]
    return linear_fit(runs, unknowns_of("abc", np.ones(3))), estimate


def covers(covariance: Covariance, error: np.ndarray) -> np.ndarray:
    quantile = student.ppf(0.975, covariance.degrees_of_freedom)
    return np.abs(error) <= quantile * covariance.standard_errors


@pytest.fixture(scope="module")
def campaigns() -> list[tuple[Uncertainty, np.ndarray]]:
    """120 campaigns of noise with ρ = 0.98: 83 independent samples of 8192 each."""
    rng = np.random.default_rng(10)
    designs = [shapes(rng) for _ in range(RUNS)]
    made = []
    for _ in range(120):
        fit, estimate = fitted(designs, first_order(rng))
        made.append((uncertainty(fit), estimate))
    return made


def test_intervals_for_coloured_noise_cover_the_truth(campaigns: list) -> None:
    """95 % within three standard deviations of 360 cases: 91.5 to 98.5 %."""
    share = np.mean([covers(each.quoted, error) for each, error in campaigns])
    assert 0.915 <= share <= 0.985


def test_white_residuals_are_called_white() -> None:
    rng = np.random.default_rng(12)
    design = shapes(rng)
    fit, _ = fitted([design] * RUNS, rng.normal(size=(RUNS, N)))
    assert uncertainty(fit).sentences() == ("Residuals of speed are white.",)


def test_perfect_data_give_zero_errors_and_no_nan() -> None:
    fit, _ = fitted([shapes(np.random.default_rng(13))] * RUNS, np.zeros((RUNS, N)))
    found = uncertainty(fit)
    assert all(each.standard_error == 0.0 for each in found.estimates)
    assert np.isfinite(found.inflation).all()
    assert found.sentences()[0].startswith("The residuals are exactly zero")


@pytest.mark.parametrize(
    ("jacobian", "more"),
    [(np.zeros((50, 2)), {}), (np.ones((50, 2)), {}), (np.ones((50, 2)), {"at_bound": [1, -1]})],
)
def test_what_is_not_determined_has_no_number(jacobian: np.ndarray, more: dict) -> None:
    noise = np.random.default_rng(15).normal(size=50)
    run = LinearisedRun("a", "speed", TIME[:50], noise, jacobian)
    found = uncertainty(linear_fit([run], unknowns_of("ab", np.ones(2), **more)))
    assert all(each.standard_error is None for each in found.estimates)
    assert {each.status for each in found.estimates} <= {
        "undetermined",
        "at its lower bound",
        "at its upper bound",
    }


def test_one_sample_is_refused() -> None:
    run = LinearisedRun("a", "speed", np.zeros(1), np.ones(1), np.ones((1, 1)))
    with pytest.raises(InputError, match="1 sample for 1 parameter leave nothing"):
        uncertainty(linear_fit([run], unknowns_of(["p"], [1.0])))


def test_an_estimate_at_its_bound_is_released_in_its_partners_intervals() -> None:
    # only the sum of both is known well; their difference a hundred times less
    generator = np.random.default_rng(3)
    time = np.arange(400) / 100.0
    jacobian = np.column_stack([np.ones(400), 1.0 + 0.01 * np.sin(time)])
    run = LinearisedRun("run", "y", time, generator.normal(0.0, 1.0, 400), jacobian)

    def half(at_bound: list[int]) -> float:
        names = unknowns_of(["a", "b"], [1.0, 1.0], at_bound=at_bound)
        found = uncertainty(linear_fit([run], names)).estimates
        assert (found[0].status == "at its upper bound") == bool(at_bound[0])
        assert found[1].lower is not None
        assert found[1].upper is not None
        return found[1].upper - found[1].lower

    assert half([1, 0]) == pytest.approx(half([0, 0]))
    alone = LinearisedRun("run", "y", time, run.residual, jacobian[:, 1:])
    one = uncertainty(linear_fit([alone], unknowns_of(["b"], [1.0]))).estimates[0]
    assert one.lower is not None
    assert one.upper is not None
    # conditioned on the bound it would be far narrower
    assert half([1, 0]) > 10.0 * (one.upper - one.lower)
