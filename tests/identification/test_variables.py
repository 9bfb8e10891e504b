"""The unknowns as the statistics see them."""

import numpy as np
import pytest

from swashplate.errors import InputError
from swashplate.identification.variables import Variables


def test_vector_and_values_are_inverses() -> None:
    variables = Variables.of(
        ["Z8", "Z18", "offset"], [2.0, 0.0, -3.0], scales=[1.0, 5.0, 2.0],
        logarithmic=[True, False, False],
    )  # fmt: skip
    np.testing.assert_allclose(variables.vector, [np.log(2.0), 0.0, -1.5])
    np.testing.assert_allclose(variables.to_values(variables.vector), [2.0, 0.0, -3.0])
    # d exp(u)/du is the value, d (u scale)/du the scale
    np.testing.assert_allclose(variables.slopes, [2.0, 5.0, 2.0])


def test_scales_default_to_the_values_sizes() -> None:
    np.testing.assert_array_equal(Variables.of(["a", "b"], [-4.0, 0.0]).scales, [4.0, 1.0])


def test_unbounded_vectors_give_no_nan() -> None:
    variables = Variables.of(["a", "b"], [1.0, 1.0], logarithmic=[True, False])
    assert variables.to_values(np.array([np.inf, np.inf])).tolist() == [np.inf, np.inf]
    assert variables.to_values(np.array([-np.inf, -np.inf])).tolist() == [0.0, -np.inf]


@pytest.mark.parametrize(
    ("names", "values", "more", "said"),
    [
        ([], [], {}, "at least one unknown"),
        (["a", "a"], [1.0, 2.0], {}, "a appears twice"),
        (["a", "b"], [1.0], {}, "2 unknowns need as many values"),
        (["a"], [np.nan], {}, "a = nan"),
        (["a"], [1.0], {"scales": [0.0]}, "scale"),
        (["a"], [-1.0], {"logarithmic": [True]}, "no logarithm"),
        (["a"], [1.0], {"at_bound": [0, 1]}, "as many at_bound"),
    ],
)
def test_wrong_unknowns_are_refused(names: list, values: list, more: dict, said: str) -> None:
    with pytest.raises(InputError, match=said):
        Variables.of(names, values, **more)


def test_an_unknown_is_found_by_name() -> None:
    variables = Variables.of(["a", "b"], [1.0, 2.0])
    assert variables.index("b") == 1
    with pytest.raises(InputError, match="no unknown c; there are a, b"):
        variables.index("c")
