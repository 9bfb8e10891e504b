"""The triangular factor against NumPy's, also where columns are missing, equal or empty."""

import numpy as np
import pytest
from tests.simulation.experiments import triangle

from swashplate import DomainError, Drive, InputError
from swashplate.equations.marching.observation import Observation, ObservedRecord
from swashplate.equations.marching.record import record_of
from swashplate.equations.marching.triangle import ROWS, combine

pytestmark = pytest.mark.traced


def numbers(rows: int, columns: int, seed: int = 0) -> np.ndarray:
    """Columns of very different size, as derivatives by parameters in SI are."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(rows, columns)) * 10.0 ** rng.uniform(-9, 9, columns)


def upright(factor: np.ndarray) -> np.ndarray:
    return np.where(np.diag(factor) < 0.0, -1.0, 1.0)[:, None] * factor


@pytest.mark.parametrize("rows", [7, ROWS, ROWS + 1, 5 * ROWS + 3])
def test_factor_is_numpys(rows: int) -> None:
    matrix = numbers(rows, 7)
    scale = np.linalg.norm(matrix, axis=0)
    found, expected = combine([matrix]), upright(np.linalg.qr(matrix, mode="r"))
    assert np.array_equal(found, np.triu(found))
    np.testing.assert_allclose(found / scale, expected / scale, rtol=0.0, atol=1e-13)


def test_empty_and_equal_columns_keep_the_singular_values() -> None:
    matrix = np.random.default_rng(1).normal(size=(900, 6))
    matrix[:, 0] = 0.0
    matrix[:, 3] = 0.0
    matrix[:, 4] = 2.0 * matrix[:, 1]
    factor = combine([matrix])
    found = np.linalg.svd(factor, compute_uv=False)
    expected = np.linalg.svd(matrix, compute_uv=False)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-13 * expected[0])
    assert (factor[:, [0, 3]] == 0.0).all()


def test_a_nearly_singular_problem_is_solved_as_well_as_by_numpy() -> None:
    rng = np.random.default_rng(2)
    matrix = rng.normal(size=(2000, 4))
    matrix[:, 3] = matrix[:, 0] + 1e-9 * matrix[:, 3]  # squared, its condition would be lost
    solution = np.array([1.0, -2.0, 3.0, 0.5])
    factor = combine([np.column_stack([matrix, matrix @ solution])])
    found = np.linalg.solve(factor[:4, :4], factor[:4, 4])
    np.testing.assert_allclose(found, solution, atol=1e-5)
    assert abs(factor[4, 4]) < 1e-12 * np.linalg.norm(matrix @ solution)


def test_nothing_to_combine() -> None:
    with pytest.raises(InputError, match="but there are none"):
        combine([])
    with pytest.raises(InputError, match="but they have 2 and 3"):
        combine([np.eye(2), np.eye(3)])


@pytest.mark.parametrize("size", [1e-150, 1e-158, 1e-162, 1e-200, 1e150])
def test_columns_of_any_size_leave_numbers(size: float) -> None:
    """A column that is next to nothing leaves the others' products as they are."""
    matrix = np.random.default_rng(3).normal(size=(900, 4))
    matrix[:, 1] *= size
    factor = combine([matrix])
    assert np.isfinite(factor).all()
    others = [0, 2, 3]
    products = (factor.T @ factor)[np.ix_(others, others)]
    expected = (matrix.T @ matrix)[np.ix_(others, others)]
    np.testing.assert_allclose(products, expected, rtol=0.0, atol=1e-10)


def test_derivatives_that_overflow_end_in_a_sentence(hoist: Drive) -> None:
    current = np.full(64, 0.4)
    stamps = np.arange(64) / 512.0
    record = record_of(current, 512.0, what="current")
    huge = Observation("shaft_speed", stamps, np.zeros(64), weight=1e170)
    observed = ObservedRecord(record, [huge], driven_by="current")
    with pytest.raises(DomainError, match="Z8: the derivatives are too large"):
        triangle(hoist.parameters, observed, ["Z8", "Z10"])
