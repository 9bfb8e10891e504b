"""Intervals in the unknowns' own units, and what leaves an unknown without one."""

from dataclasses import replace

import numpy as np
import pytest
from tests.identification.given import linear_fit, unknowns_of

from swashplate.errors import InputError
from swashplate.identification.intervals import estimates, uncertainty
from swashplate.identification.noise import Covariance
from swashplate.identification.problem import LinearisedRun


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
    plain, positive = estimates(covariance(at_bound=[-1, 1]))
    assert (plain.status, positive.status) == ("at its lower bound", "at its upper bound")
    assert plain[3:] == (None, None, None, None)


def test_an_interval_beyond_a_hundredfold_is_none() -> None:
    """A standard error of 4 of the logarithm: its 95 % interval spans a factor of 2540 each way."""
    base = covariance()
    vast = np.diag([base.matrix[0, 0], 4.0**2])
    plain, positive = estimates(replace(base, matrix=vast))
    assert plain.status == "estimated"
    assert (positive.status, positive.lower, positive.upper) == ("undetermined", None, None)


@pytest.mark.parametrize(
    ("jacobian", "more"),
    [(np.zeros((50, 2)), {}), (np.ones((50, 2)), {}), (np.ones((50, 2)), {"at_bound": [1, -1]})],
)
def test_what_is_not_determined_has_no_number(jacobian: np.ndarray, more: dict) -> None:
    noise = np.random.default_rng(15).normal(size=50)
    run = LinearisedRun("a", "speed", np.arange(50.0), noise, jacobian)
    found = uncertainty(linear_fit([run], unknowns_of("ab", np.ones(2), **more)))
    assert all(each.standard_error is None for each in found.estimates)
    assert {each.status for each in found.estimates} <= {
        "undetermined",
        "at its lower bound",
        "at its upper bound",
    }


def test_an_undetermined_unknown_does_not_spoil_the_others() -> None:
    rng = np.random.default_rng(1)
    jacobian = rng.normal(size=(40, 3))
    jacobian[:, 1] = -2.0 * jacobian[:, 0]
    run = LinearisedRun("a", "speed", np.arange(40.0), rng.normal(size=40), jacobian)
    made = linear_fit([run], unknowns_of("abc", np.ones(3)))
    assert made.determined.tolist() == [False, False, True]
    # the third beside the one combination of the others that is determined
    pair = jacobian[:, [0, 2]]
    found = (made.whitening @ made.whitening.T)[2, 2]
    assert found == pytest.approx(np.linalg.inv(pair.T @ pair)[1, 1], rel=1e-10)


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
