"""Factor and inverse of many runs, against dense algebra on the same derivatives."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.identification.given import TIME, bench_run

from swashplate.identification import (
    Linearised,
    Problem,
    Unknown,
    Unknowns,
    linearised_fit,
    solve,
    uncertainty,
)
from swashplate.identification.estimation.arrow import RunRows, arrow_factor, whitening

TOLERANCE = 1e-10


@st.composite
def campaigns(draw: st.DrawFn) -> tuple[int, np.ndarray, list[RunRows]]:
    """Derivatives of some runs: size, numbers of the shared unknowns, rows of each run.

    Columns are of sizes far apart; some are zero, some the same as others of their run, so that an
    unknown has no effect, or moves together with another one of the run or of the machine.
    """
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    shared = draw(st.integers(0, 5))
    own = draw(st.lists(st.integers(0, 3), min_size=1, max_size=5))
    size = shared + sum(own)
    if not size:
        shared = size = 1
    numbers = rng.permutation(size)
    ends = shared + np.cumsum([0, *own])
    blocks = []
    for k, count in enumerate(own):
        rows = rng.normal(size=(draw(st.integers(1, 30)), count + shared))
        rows *= 10.0 ** rng.integers(-5, 6, count + shared)
        for _ in range(draw(st.integers(0, 2))):
            first, other = rng.integers(0, max(rows.shape[1], 1), 2)
            if rows.shape[1]:
                rows[:, first] = draw(st.sampled_from([0.0, 3.0])) * rows[:, other]
        blocks.append(RunRows(f"run {k}", numbers[ends[k] : ends[k + 1]], rows))
    return size, numbers[:shared], blocks


def dense(size: int, shared: np.ndarray, blocks: list[RunRows]) -> np.ndarray:
    parts = []
    for block in blocks:
        part = np.zeros((len(block.rows), size))
        part[:, np.concatenate([block.own, shared])] = block.rows
        parts.append(part)
    return np.vstack(parts)


@pytest.mark.slow
@given(campaigns(), st.integers(0, 2**32 - 1))
@settings(max_examples=300)
def test_the_inverse_is_that_of_dense_algebra(campaign, seed: int) -> None:
    """The pseudoinverse of the derivatives with scaled columns, by their dense SVD."""
    size, shared, blocks = campaign
    jacobian = dense(*campaign)
    factor = arrow_factor(size, shared, blocks)
    lengths = np.linalg.norm(jacobian, axis=0)
    scale = np.where(lengths > 0.0, lengths, 1.0)
    scaled = jacobian / scale
    triangle = factor.dense() / scale
    np.testing.assert_allclose(triangle.T @ triangle, scaled.T @ scaled, atol=1e-12)
    np.testing.assert_allclose(factor.lengths, lengths, rtol=1e-12, atol=0.0)

    free = np.random.default_rng(seed).random(size) > 0.1
    found = whitening(factor, free, TOLERANCE)
    moving = np.flatnonzero(free & (lengths > 0.0))
    _, sizes, right = np.linalg.svd(scaled[:, moving], full_matrices=True)
    rank = np.count_nonzero(sizes > TOLERANCE * sizes.max(initial=0.0))
    assert found.rank == rank
    determined = np.zeros(size, bool)
    determined[moving] = np.sum(right[rank:] ** 2, axis=0) < 1e-8
    np.testing.assert_array_equal(found.determined, determined)

    # the inverse is as large as the square of this, and rounding is as much larger again
    worst = 1.0 / sizes[rank - 1] if rank else 1.0
    inverse = np.zeros((size, size))
    half = right[:rank].T / sizes[:rank]
    inverse[np.ix_(moving, moving)] = half @ half.T
    matrix = scale[:, None] * found.matrix
    np.testing.assert_allclose(matrix @ matrix.T, inverse, rtol=0.0, atol=1e-11 * worst**3)
    for block in blocks:
        directions, local = found.of_run(block.run)
        moved = dense(size, shared, [block]) @ found.matrix
        np.testing.assert_allclose(block.rows @ local, moved[:, directions], atol=1e-11 * worst**2)
        others = np.delete(moved, directions, axis=1)
        np.testing.assert_allclose(others, 0.0, atol=1e-11 * worst**2)


class Level:
    """y = gain · level · t, with its derivative."""

    def simulate(self, values, experiment):
        return {"y": values["gain"] * experiment.input.values[-1] * experiment["y"].time}

    def linearise(self, values, experiment, names):
        outputs = self.simulate(values, experiment)["y"]
        return {"y": Linearised(outputs, outputs[:, None] / values["gain"])}


@pytest.mark.slow
def test_memory_does_not_grow_with_runs_times_unknowns(monkeypatch) -> None:
    """200 runs with a free zero each: all derivatives together would be 26 MB."""
    monkeypatch.setattr("swashplate.identification.estimation.problem.KEPT", 1e5)
    rng, count = np.random.default_rng(1), 200
    levels = rng.uniform(1.0, 2.0, count)
    runs = [
        bench_run(f"run {k}", level, 3.0 * level * TIME + k + 0.1 * rng.normal(size=TIME.size))
        for k, level in enumerate(levels)
    ]
    zeros = [
        Unknown("offset y", 1.0, -1e3, 1e3, run=run.name, kind="zero", channel="y") for run in runs
    ]
    unknowns = Unknowns((Unknown("gain", 1.0, 0.1, 10.0), *zeros))
    problem = Problem(Level(), tuple(runs), unknowns, ("y",), {"y": 0.1})
    all_derivatives = problem.samples * len(unknowns) * 8
    assert all_derivatives > 25e6
    tracemalloc.start()
    try:
        solution = solve(problem)
        found = uncertainty(linearised_fit(problem, solution.vector))
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    # some matrices of all unknowns, 0.3 MB each
    assert peak < 0.6 * all_derivatives
    # by hand: in each run the time about its mean, as its zero is free
    error = 0.1 / np.linalg.norm(np.outer(levels, TIME - TIME.mean()))
    np.testing.assert_allclose(found.quoted.standard_errors[0], error, rtol=0.1)
