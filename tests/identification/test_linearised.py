"""What the runs of a fit determine."""

import numpy as np
import pytest
from tests.identification.linear import linear_fit, unknowns_of

from swashplate.errors import InputError
from swashplate.identification.problem import LinearisedFit, LinearisedRun

RNG = np.random.default_rng(1)


def run(n: int, columns: int, **more: object) -> LinearisedRun:
    made = LinearisedRun(
        "hoistr6", "speed", np.arange(float(n)), RNG.normal(size=n), RNG.normal(size=(n, columns))
    )
    return made._replace(**more)


def fit(runs: list, columns: int, **more: object) -> LinearisedFit:
    names = [f"p{k}" for k in range(columns)]
    return linear_fit(runs, unknowns_of(names, np.ones(columns)), **more)


def test_the_inverse_is_that_of_the_normal_equations() -> None:
    runs = [run(20, 3), run(30, 3)]
    prior = np.array([[0.0, 2.0, 0.0]])
    made = fit(runs, 3, prior=prior)
    jacobian = np.vstack([each.jacobian for each in runs] + [prior])
    expected = np.linalg.inv(jacobian.T @ jacobian)
    np.testing.assert_allclose(made.whitening @ made.whitening.T, expected, rtol=1e-12)
    assert made.determined.all()
    assert made.rank == 3
    assert made.spare_samples == 47


def test_an_undetermined_unknown_does_not_spoil_the_others() -> None:
    base = run(40, 3)
    base.jacobian[:, 1] = -2.0 * base.jacobian[:, 0]
    made = fit([base], 3)
    assert made.rank == 2
    assert made.determined.tolist() == [False, False, True]
    # the third beside the one combination of the others that is determined
    pair = np.column_stack([base.jacobian[:, 0], base.jacobian[:, 2]])
    np.testing.assert_allclose(
        (made.whitening @ made.whitening.T)[2, 2], np.linalg.inv(pair.T @ pair)[1, 1], rtol=1e-10
    )


def test_an_unknown_at_its_bound_is_held() -> None:
    base = run(40, 3)
    variables = unknowns_of("abc", np.ones(3), at_bound=[0, 1, 0])
    made = linear_fit([base], variables)
    free = base.jacobian[:, [0, 2]]
    np.testing.assert_allclose(
        (made.whitening @ made.whitening.T)[np.ix_([0, 2], [0, 2])], np.linalg.inv(free.T @ free)
    )
    assert not made.whitening[1].any()


def test_as_many_unknowns_as_samples_leave_no_noise() -> None:
    with pytest.raises(InputError, match="1 sample for 1 parameter"):
        _ = fit([run(1, 1)], 1).spare_samples
