"""What the runs of a fit determine."""

import numpy as np
import pytest

from swashplate.errors import InputError
from swashplate.identification.problem import LinearisedFit, LinearisedRun, whitening
from swashplate.identification.unknowns import Unknowns

RNG = np.random.default_rng(1)


def run(n: int, columns: int, **more: object) -> LinearisedRun:
    made = LinearisedRun(
        "hoistr6", "speed", np.arange(float(n)), RNG.normal(size=n), RNG.normal(size=(n, columns))
    )
    return made._replace(**more)


def fit(runs: list, columns: int, **more: object) -> LinearisedFit:
    names = [f"p{k}" for k in range(columns)]
    return LinearisedFit.of(runs, Unknowns.of(names, np.ones(columns)), **more)


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
    variables = Unknowns.of("abc", np.ones(3), at_bound=[0, 1, 0])
    made = LinearisedFit.of([base], variables)
    free = base.jacobian[:, [0, 2]]
    np.testing.assert_allclose(
        (made.whitening @ made.whitening.T)[np.ix_([0, 2], [0, 2])], np.linalg.inv(free.T @ free)
    )
    assert not made.whitening[1].any()


def test_scales_of_columns_do_not_matter() -> None:
    base = run(40, 2)
    columns = base.jacobian * [1e-9, 1e9]
    made = fit([base._replace(jacobian=columns)], 2)
    assert made.rank == 2


def test_nothing_is_determined_by_nothing() -> None:
    found, determined = whitening(np.zeros((3, 2)), np.ones(2, bool), 1e-10)
    assert found.shape == (2, 0)
    assert not determined.any()


def test_samples_of_weight_zero_are_dropped() -> None:
    weight = np.ones(10)
    weight[3:5] = 0.0
    made = fit([run(10, 2, weight=weight)], 2)
    assert made.samples == 8
    assert made.runs[0].time.tolist() == [0, 1, 2, 5, 6, 7, 8, 9]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"residual": np.zeros(9)}, "residual has the shape"),
        ({"jacobian": np.zeros((10, 3))}, "jacobian has the shape"),
        ({"residual": np.full(10, np.nan)}, "residual is not finite at 0 s"),
        ({"time": np.zeros(10)}, "must be finite and increase"),
        ({"weight": np.full(10, -1.0)}, "a weight is negative"),
        ({"weight": np.zeros(10)}, "No sample counts"),
    ],
)
def test_wrong_runs_are_refused_by_name(change: dict, said: str) -> None:
    with pytest.raises(InputError, match=said):
        fit([run(10, 2, **change)], 2)


def test_priors_need_a_column_for_each_unknown() -> None:
    with pytest.raises(InputError, match="priors need 2 finite columns"):
        fit([run(10, 2)], 2, prior=np.ones((1, 3)))


def test_as_many_unknowns_as_samples_leave_no_noise() -> None:
    with pytest.raises(InputError, match="1 sample for 1 unknown"):
        _ = fit([run(1, 1)], 1).spare_samples
