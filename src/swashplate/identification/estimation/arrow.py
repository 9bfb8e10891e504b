"""Triangular factors of many runs, in which an unknown belongs to the machine or to one run.

Ordered by runs, the machine last, the factor has the shape of an arrow: a small block for each run,
what couples it to the machine, and the machine's block. It is made run by run and grows with them
linearly.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

UNDETERMINED = 1e-8
"""Square of an unknown's part in the null space, its column scaled, from which it is in it."""
ROWS = 32_768
"""Of a matrix that are reduced together: a long run takes no more memory than a short one."""
GATHERED = 512
"""Rows of the machine's block that are gathered before they are reduced."""


def triangular_factor(matrix: Array) -> Array:
    """(min(m, K), K) factor R of a matrix (m, K), RᵀR = matrixᵀ matrix."""
    if len(matrix) > ROWS:
        return triangular_factor_of(matrix.T)
    return np.asarray(np.linalg.qr(matrix, mode="r"))


def triangular_factor_of(columns: Sequence[Array] | Array) -> Array:
    """The factor of a matrix that is given by its columns (m,), which are never stacked whole."""
    size = len(columns[0])
    factor = np.zeros((0, len(columns)))
    for first in range(0, size, ROWS):
        rows = [column[first : first + ROWS] for column in columns]
        factor = np.asarray(np.linalg.qr(np.vstack([factor, np.transpose(rows)]), mode="r"))
    return factor


class RunRows(NamedTuple):
    """Rows of derivatives that belong to one run."""

    run: str
    own: Numbers
    """(q,) numbers of the unknowns that belong only to this run."""
    rows: Array
    """(n, q + M) derivatives by them, then by the shared unknowns."""


class RunFactor(NamedTuple):
    """What the factor has of one run's own unknowns."""

    own: Numbers
    """(q,) their numbers."""
    factor: Array
    """(<= q, q) upper triangle."""
    coupling: Array
    """(<= q, M) by the shared unknowns."""


@dataclass(frozen=True, eq=False)
class ArrowFactor:
    """Factor R of derivatives J, RᵀR = JᵀJ."""

    size: int
    """How many unknowns K there are."""
    shared: Numbers = field(repr=False)
    """(M,) numbers of those that all runs share."""
    runs: Mapping[str, RunFactor] = field(repr=False)
    """By run, of those that have unknowns of their own."""
    rest: Array = field(repr=False)
    """(<= M, M) triangle of what is left for the shared ones."""

    @cached_property
    def lengths(self) -> Array:
        """(K,) lengths of the columns of J."""
        squares = np.zeros(self.size)
        squares[self.shared] = np.sum(self.rest**2, axis=0)
        for run in self.runs.values():
            squares[run.own] = np.sum(run.factor**2, axis=0)
            squares[self.shared] += np.sum(run.coupling**2, axis=0)
        return np.sqrt(squares)

    def dense(self) -> Array:
        """(<= K, K) the factor as a matrix, its rows in the order of the runs."""
        counts = [len(run.factor) for run in self.runs.values()]
        matrix, row = np.zeros((sum(counts) + len(self.rest), self.size)), 0
        for run, count in zip(self.runs.values(), counts, strict=True):
            matrix[row : row + count, run.own] = run.factor
            matrix[row : row + count, self.shared] = run.coupling
            row += count
        matrix[row:, self.shared] = self.rest
        return matrix


def arrow_factor(size: int, shared: Numbers, blocks: Iterable[RunRows]) -> ArrowFactor:
    """The factor of the derivatives of some runs.

    Parameters
    ----------
    size : int
        Number K of unknowns.
    shared : (M,) array of int
        Numbers of the unknowns that all runs share.
    blocks : iterable of RunRows
        Rows of each run; several of one run are taken together. They are reduced one by one.
    """
    columns_of_runs, triangles = dict[str, Numbers](), dict[str, Array]()
    for block in blocks:
        rows = block.rows
        if block.run in triangles:
            rows = np.vstack([triangles[block.run], rows])
        columns_of_runs[block.run], triangles[block.run] = block.own, triangular_factor(rows)
    runs, gathered = dict[str, RunFactor](), [np.zeros((0, shared.size))]
    for run, triangle in triangles.items():
        count = columns_of_runs[run].size
        if count:
            runs[run] = RunFactor(
                columns_of_runs[run], triangle[:count, :count], triangle[:count, count:]
            )
        gathered.append(triangle[count:, count:])
        if sum(map(len, gathered)) > GATHERED:
            gathered = [triangular_factor(np.vstack(gathered))]
    return ArrowFactor(size, shared, runs, triangular_factor(np.vstack(gathered)))


def stacked(size: int, shared: Numbers, blocks: Sequence[RunRows]) -> Array:
    """(n, K) rows of all blocks by all unknowns; arguments as of `arrow_factor`."""
    matrix, first = np.zeros((sum(len(block.rows) for block in blocks), size)), 0
    for block in blocks:
        last = first + len(block.rows)
        matrix[first:last, np.concatenate([block.own, shared])] = block.rows
        first = last
    return matrix


def dense_factor(matrix: Array) -> ArrowFactor:
    """The factor of a matrix (n, K) of derivatives by unknowns that are all shared."""
    count = matrix.shape[1]
    return arrow_factor(count, np.arange(count), [RunRows("", np.arange(0), matrix)])


# --- its inverse ----------------------------------------------------------------------------------


class RunDirections(NamedTuple):
    """How one run's own unknowns move along the directions."""

    first: int
    """Number of the run's first own direction."""
    inverse: Array
    """(q, r) along its own directions."""
    follow: Array
    """(q, m) along the machine's."""


@dataclass(frozen=True, eq=False)
class Whitening:
    """Matrix W with W Wᵀ the inverse of JᵀJ on what is determined: columns of J W are orthonormal.

    Its columns are directions: first those of the machine, in which each run's own unknowns follow,
    then those of each run, in which only its own unknowns change.
    """

    factor: ArrowFactor
    rank: int
    """How many directions there are."""
    machine: Array
    """(M, m) how the shared unknowns move along the machine's directions."""
    runs: Mapping[str, RunDirections]
    null: Array
    """(K, k) orthonormal combinations of the unknowns, in units of their `lengths`, that change
    nothing; those without any effect, or not free, are none."""
    determined: NDArray[np.bool_]
    """(K,) unknowns that are free and have no part in any of these."""

    def of_run(self, run: str) -> tuple[Numbers, Array]:
        """Numbers (d,) of the directions that move a run, and (q + M, d) its unknowns along them.

        All other directions leave its samples as they are.
        """
        directions = np.arange(self.machine.shape[1])
        if run not in self.runs:
            return directions, self.machine
        first, inverse, follow = self.runs[run]
        run_columns = np.arange(first, first + inverse.shape[1])
        zeros = np.zeros((len(self.machine), run_columns.size))
        matrix = np.block([[follow, inverse], [self.machine, zeros]])
        return np.concatenate([directions, run_columns]), matrix

    @cached_property
    def matrix(self) -> Array:
        """(K, rank) W as a matrix, of all that fit the one without a part in the null space."""
        matrix = np.zeros((self.factor.size, self.rank))
        matrix[self.factor.shared, : self.machine.shape[1]] = self.machine
        for run, (first, inverse, follow) in self.runs.items():
            run_columns = self.factor.runs[run].own
            matrix[run_columns, : follow.shape[1]] = follow
            matrix[run_columns, first : first + inverse.shape[1]] = inverse
        if self.null.size:
            lengths = self.factor.lengths[:, None]
            along = self.null @ (self.null.T @ (lengths * matrix))
            matrix -= np.divide(along, lengths, out=np.zeros_like(along), where=lengths > 0.0)
        return matrix


class _Reduced(NamedTuple):
    """Singular value decomposition of one run's scaled triangle, and its scaled coupling."""

    left: Array
    sizes: Array
    right: Array
    coupling: Array


def whitening(factor: ArrowFactor, free: NDArray[np.bool_], tolerance: float) -> Whitening:
    """Inverse of the derivatives on what they determine.

    Parameters
    ----------
    factor : ArrowFactor
        The derivatives' factor.
    free : (K,) array of bool
        Unknowns that may move.
    tolerance : float
        Singular values of the factor with scaled columns below this part of the largest count as
        zero.

    Notes
    -----
    Of each run the own unknowns are eliminated first, as in a Schur complement but by orthogonal
    transformations alone: the rows of its block U S Vᵀ x + C z that belong to singular values of
    zero tell of the shared unknowns z only, and go to the machine's block. So a gauge between an
    unknown of one run and those of the machine is a null direction of this block.
    """
    lengths, shared = factor.lengths, factor.shared
    moving = free & (lengths > 0.0)
    scale = np.where(lengths > 0.0, lengths, 1.0)
    columns = np.flatnonzero(moving[shared])
    by_shared = scale[shared[columns]]

    reduced, largest = dict[str, _Reduced](), 0.0
    rest = factor.rest[:, columns] / by_shared
    gram = rest.T @ rest
    for run, (columns_of_run, triangle, coupling) in factor.runs.items():
        triangle_left, along = triangle[:, moving[columns_of_run]], coupling[:, columns] / by_shared
        parts = np.linalg.svd(
            triangle_left / scale[columns_of_run[moving[columns_of_run]]], full_matrices=True
        )
        reduced[run] = _Reduced(*parts, along)
        largest = max(largest, float(parts[1].max(initial=0.0)))
        gram += along.T @ along
    if columns.size:
        largest = max(largest, float(np.sqrt(np.linalg.eigvalsh(gram)[-1])))

    gathered, ranks = [rest], dict[str, int]()
    for run, (left, sizes, _, coupling) in reduced.items():
        ranks[run] = int(np.count_nonzero(sizes > tolerance * largest))
        gathered.append(left[:, ranks[run] :].T @ coupling)
    block = triangular_factor(np.vstack(gathered))
    _, sizes, right = np.linalg.svd(block, full_matrices=True)
    count = int(np.count_nonzero(sizes > tolerance * largest))
    along = right[:count].T / sizes[:count]
    machine = np.zeros((shared.size, count))
    machine[columns] = along / by_shared[:, None]

    null = np.zeros((factor.size, columns.size - count))
    null[shared[columns]] = right[count:].T
    runs, alone_null, first = dict[str, RunDirections](), [null], count
    for run, (left, sizes, rows, coupling) in reduced.items():
        rank, columns_of_run = ranks[run], factor.runs[run].own
        free_own = columns_of_run[moving[columns_of_run]]
        inverse = rows[:rank].T / sizes[:rank]
        solution = -inverse @ (left[:, :rank].T @ coupling)
        null[free_own] = solution @ right[count:].T
        padded, followed = (
            np.zeros((columns_of_run.size, rank)),
            np.zeros((columns_of_run.size, count)),
        )
        padded[moving[columns_of_run]] = inverse / scale[free_own, None]
        followed[moving[columns_of_run]] = solution @ along / scale[free_own, None]
        runs[run] = RunDirections(first, padded, followed)
        first += rank
        if rank < free_own.size:
            without = np.zeros((factor.size, free_own.size - rank))
            without[free_own] = rows[rank:].T
            alone_null.append(without)
    basis = np.linalg.qr(np.hstack(alone_null))[0]
    determined = moving & (np.sum(basis**2, axis=1) < UNDETERMINED)
    return Whitening(factor, first, machine, runs, basis, determined)
