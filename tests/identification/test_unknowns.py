from math import log

import numpy as np
import pytest
from tests.identification.linear import unknowns_of

from swashplate import ParameterError
from swashplate.identification.unknowns import Prior, Unknown, Unknowns, bounded


def test_values_and_vector_are_inverse() -> None:
    unknowns = Unknowns(
        (
            bounded("a", 4.0, relative=(0.5, 2.0)),
            bounded("b", 2e-7, relative=(0.1, 10.0), log=True),
            bounded("c", 0.0, absolute=(-3.0, 5.0)),
            bounded("d", -6.0, relative=(2.0, 0.5)),
        )
    )
    assert unknowns.start == pytest.approx([1.0, log(2e-7), 0.0, -1.0])
    low, high = unknowns.bounds
    assert low == pytest.approx([0.5, log(2e-8), -1.5, -2.0])
    assert high == pytest.approx([2.0, log(2e-6), 2.5, -0.5])
    vector = np.array([1.3, log(3e-7), 0.5, -0.7])
    values = unknowns.values(vector)
    assert values == pytest.approx({"a": 5.2, "b": 3e-7, "c": 1.0, "d": -4.2})
    assert unknowns.vector_of(values) == pytest.approx(vector)


def test_tied_directions_and_unknowns_of_one_experiment() -> None:
    unknowns = Unknowns(
        (
            bounded("Z16", 2.0, relative=(0.5, 2.0), sets=("Z16_plus", "Z16_minus")),
            Unknown("offset", 1.0, -9.0, 9.0, run="lift"),
            Unknown("offset", 3.0, -9.0, 9.0, run="lower"),
        )
    )
    assert unknowns.names == ("Z16", "offset (lift)", "offset (lower)")
    vector = unknowns.start
    assert unknowns.targets(vector, "lower") == {"Z16_plus": 2.0, "Z16_minus": 2.0, "offset": 3.0}
    chain = unknowns.chain(vector, ["Z16_minus", "offset", "Z16_plus"], "lift")
    np.testing.assert_allclose(chain, [[2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [2.0, 0.0, 0.0]])


def test_priors() -> None:
    unknowns = Unknowns(
        (
            bounded("a", 4.0, relative=(0.5, 2.0), prior=Prior(3.0, 0.5)),
            bounded("b", 2.0, relative=(0.5, 2.0)),
            bounded("c", 2.0, relative=(0.5, 2.0), log=True, prior=Prior(2.2, 0.1)),
        )
    )
    residuals, rows = unknowns.prior_rows(unknowns.start)
    assert residuals == pytest.approx([2.0, log(2.0 / 2.2) / 0.1])
    np.testing.assert_allclose(rows, [[8.0, 0.0, 0.0], [0.0, 0.0, 10.0]])


def test_bounds_that_are_reached() -> None:
    unknowns = Unknowns(
        (bounded("a", 1.0, absolute=(0.0, 2.0)), bounded("b", 1.0, absolute=(0, 2)))
    )
    assert unknowns.at(np.array([0.0, 2.0 - 1e-9])).at_bound.tolist() == [-1, 1]
    assert unknowns.at(np.array([0.1, 1.9])).at_bound.tolist() == [0, 0]


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: bounded("Z2", 0.0, relative=(0.5, 2.0)), "Z2 is nominally 0.*absolute bounds"),
        (lambda: bounded("a", 5.0, absolute=(0.0, 2.0)), "begins at 5, outside its bounds 0 and 2"),
        (lambda: bounded("a", 1.0, absolute=(2.0, 0.0)), "lower one first"),
        (lambda: bounded("a", 1.0, absolute=(0.0, 2.0), log=True), "above 0"),
        (lambda: bounded("a", 1.0, absolute=(0.0, 2.0), prior=Prior(1.0, 0.0)), "positive"),
        (
            lambda: Unknowns((Unknown("a", 1, 0, 2), Unknown("b", 1, 0, 2, sets=("a",)))),
            "a is set by two parameters",
        ),
    ],
)
def test_what_is_refused(make, sentence: str) -> None:
    with pytest.raises(ParameterError, match=sentence):
        make()


def test_released_unknowns_stay_where_they_are() -> None:
    made = unknowns_of(
        "abc", [2.0, -3.0, 1.0], logarithmic=[True, False, False], at_bound=[-1, 1, 0]
    )
    free = made.released
    assert made.at_bound.tolist() == [-1, 1, 0]
    assert free.at_bound.tolist() == [0, 0, 0]
    np.testing.assert_array_equal(free.vector, made.vector)
    np.testing.assert_array_equal(free.scales, made.scales)
    np.testing.assert_allclose(free.estimates, [2.0, -3.0, 1.0])
