"""The triangular factor against NumPy's, also where columns are missing, equal or empty."""

import pickle
from collections.abc import Callable
from copy import copy, deepcopy
from typing import NamedTuple

import numpy as np
import pytest
from tests.drive.experiments import triangle

from swashplate import DomainError, Drive
from swashplate.machine import Machine, Model, equation
from swashplate.machine.marching import Observation, ObservedRecord, Record, record_of
from swashplate.machine.marching import derivatives as engine

pytestmark = pytest.mark.traced


class Gains(NamedTuple):
    a: float = 0.0
    b: float = 0.0
    c: float = 0.0
    d: float = 0.0
    e: float = 0.0
    f: float = 0.0


class Still(NamedTuple):
    nothing: float


class Seen(NamedTuple):
    total: float


@equation
def sample(u: float, v: float, w: float, x: float, y: float, z: float, p: Gains) -> Seen:
    return Seen(p.a * u + p.b * v + p.c * w + p.d * x + p.e * y + p.f * z)


@equation
def step(state: Still) -> Still:
    return state


weighted = Model("weighted", parameters=Gains, state=Still, step=step, sample=sample)


def factor_of(matrix: np.ndarray) -> np.ndarray:
    """Triangle of rows whose first columns are the model's inputs, and whose last one is left."""
    inputs = {name: np.zeros(len(matrix)) for name in "uvwxyz"}
    inputs |= dict(zip("uvwxyz", matrix.T[:-1].copy(), strict=False))
    record = Record(inputs.pop("u"), 0.0, 1.0, 1)
    seen = Observation("total", record.time, -matrix[:, -1])
    observed = ObservedRecord(record, [seen], driven_by="u", others=inputs)
    columns = "abcdef"[: matrix.shape[1] - 1]
    return engine.triangle(Machine(weighted, Gains()), observed, columns).factor


def numbers(rows: int, columns: int, seed: int = 0) -> np.ndarray:
    """Columns of very different size, as derivatives by parameters in SI are."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(rows, columns)) * 10.0 ** rng.uniform(-9, 9, columns)


def upright(factor: np.ndarray) -> np.ndarray:
    return np.where(np.diag(factor) < 0.0, -1.0, 1.0)[:, None] * factor


@pytest.mark.parametrize("rows", [7, 512, 513, 2563])
def test_factor_is_numpys(rows: int) -> None:
    matrix = numbers(rows, 7)
    scale = np.linalg.norm(matrix, axis=0)
    found, expected = factor_of(matrix), upright(np.linalg.qr(matrix, mode="r"))
    assert np.array_equal(found, np.triu(found))
    np.testing.assert_allclose(found / scale, expected / scale, rtol=0.0, atol=1e-13)


def test_empty_and_equal_columns_keep_the_singular_values() -> None:
    matrix = np.random.default_rng(1).normal(size=(900, 6))
    matrix[:, 0] = 0.0
    matrix[:, 3] = 0.0
    matrix[:, 4] = 2.0 * matrix[:, 1]
    factor = factor_of(matrix)
    found = np.linalg.svd(factor, compute_uv=False)
    expected = np.linalg.svd(matrix, compute_uv=False)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-13 * expected[0])
    assert (factor[:, [0, 3]] == 0.0).all()


def test_a_nearly_singular_problem_is_solved_as_well_as_by_numpy() -> None:
    rng = np.random.default_rng(2)
    matrix = rng.normal(size=(2000, 4))
    matrix[:, 3] = matrix[:, 0] + 1e-9 * matrix[:, 3]  # squared, its condition would be lost
    solution = np.array([1.0, -2.0, 3.0, 0.5])
    factor = factor_of(np.column_stack([matrix, matrix @ solution]))
    found = np.linalg.solve(factor[:4, :4], factor[:4, 4])
    np.testing.assert_allclose(found, solution, atol=1e-5)
    assert abs(factor[4, 4]) < 1e-12 * np.linalg.norm(matrix @ solution)


@pytest.mark.parametrize("size", [1e-150, 1e-158, 1e-162, 1e-200, 1e150])
def test_columns_of_any_size_leave_numbers(size: float) -> None:
    """A column that is next to nothing leaves the others' products as they are."""
    matrix = np.random.default_rng(3).normal(size=(900, 4))
    matrix[:, 1] *= size
    factor = factor_of(matrix)
    assert np.isfinite(factor).all()
    others = [0, 2, 3]
    products = (factor.T @ factor)[np.ix_(others, others)]
    expected = (matrix.T @ matrix)[np.ix_(others, others)]
    np.testing.assert_allclose(products, expected, rtol=0.0, atol=1e-10)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of NumPy, without the JIT
def test_derivatives_that_overflow_end_in_a_sentence(hoist: Drive) -> None:
    current = np.full(64, 0.4)
    stamps = np.arange(64) / 512.0
    record = record_of(current, 512.0, what="current")
    huge = Observation("shaft_speed", stamps, np.zeros(64), weight=1e170)
    observed = ObservedRecord(record, [huge], driven_by="current")
    with pytest.raises(DomainError, match="Z8: .* derivatives"):
        triangle(hoist.parameters, observed, ["Z8", "Z10"])


@pytest.mark.parametrize("copied", [deepcopy, copy, lambda each: pickle.loads(pickle.dumps(each))])
def test_a_copy_of_an_observed_record_outlives_it(copied: Callable[..., ObservedRecord]) -> None:
    measured = np.random.default_rng(0).normal(size=2000)
    record = Record(np.zeros(2000), 0.0, 1.0, 1)
    inputs = {name: np.zeros(2000) for name in "vwxyz"}
    seen = Observation("total", record.time, -measured)
    observed = ObservedRecord(record, [seen], driven_by="u", others=inputs)
    instance = Machine(weighted, Gains())
    assert np.array_equal(engine.residuals(instance, observed), measured)
    again = copied(observed)
    del observed, seen, record
    other = [np.full(2000, 7.0) for _ in range(20)]  # Takes memory that has become free.
    assert np.array_equal(engine.residuals(instance, again), measured)
    assert len(other) == 20
