"""Intervals in the unknowns' own units."""

from dataclasses import replace

import numpy as np
import pytest
from tests.identification.linear import unknowns_of

from swashplate.errors import InputError
from swashplate.identification.intervals import Estimate, estimates
from swashplate.identification.noise import Covariance


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
    # 20 % in the logarithm: 2 exp(±0.392)
    assert positive.standard_error == pytest.approx(0.4)
    assert (positive.lower, positive.upper) == pytest.approx((1.351418, 2.959854), rel=1e-6)


def test_few_degrees_of_freedom_widen() -> None:
    # Student's quantile for 5 degrees of freedom, 2.570582
    assert estimates(covariance(5.0))[0].upper == pytest.approx(3.0 + 2.570582)


def test_another_level() -> None:
    assert estimates(covariance(), level=0.5)[0].upper == pytest.approx(3.0 + 0.6744898)


def test_at_a_bound_there_is_no_interval() -> None:
    plain, positive = estimates(covariance(at_bound=[-1, 1]))
    assert plain.status == "at its lower bound"
    assert positive.status == "at its upper bound"
    assert plain[3:] == (None, None, None, None)


def test_undetermined_there_is_none_either() -> None:
    base = covariance()
    found = estimates(Covariance(base.variables, base.matrix, np.array([False, True]), np.ones(2)))
    assert found[0].status == "undetermined"
    assert found[0].standard_error is None
    assert found[1].status == "estimated"


def test_an_interval_beyond_a_hundredfold_is_none() -> None:
    """A standard error of 4 of the logarithm: its 95 % interval spans a factor of 2540 each way."""
    base = covariance()
    vast = np.diag([base.matrix[0, 0], 4.0**2])
    plain, positive = estimates(replace(base, matrix=vast))
    assert plain.status == "estimated"
    assert (positive.status, positive.lower, positive.upper) == ("undetermined", None, None)


@pytest.mark.parametrize("level", [0.0, 1.0, 95.0])
def test_a_level_is_a_probability(level: float) -> None:
    with pytest.raises(InputError, match="between 0 and 1"):
        estimates(covariance(), level=level)


def test_half_widths_are_of_the_values_size() -> None:
    known = Estimate("Z2", -4.0, "estimated", 0.1, -4.2, -3.8, 30.0)
    assert known.relative_half_width == pytest.approx(0.05)
    assert known._replace(upper=None).relative_half_width == np.inf
    assert known._replace(value=0.0).relative_half_width == np.inf
