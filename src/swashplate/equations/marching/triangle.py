"""The triangular factor of a least-squares problem, made from blocks of its rows.

With [J r] = Q R, the small triangle R holds all that a Gauss-Newton or trust-region step needs: RᵀR
is [J r]ᵀ[J r], and J has the singular values of R's columns. R is made by Householder reflections,
never from the normal equations, whose condition number is squared and which a zero column breaks.
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.cache import kernel
from swashplate.equations.equation import inlined
from swashplate.equations.marching.pieces import behind

Array = NDArray[np.float64]

ROWS = 512
"""Rows of a block: known to the compiler, and few enough for a fast cache."""
EIGHTH = ROWS // 8
NOTHING = 1e-290
"""Square of a column's norm that counts as none: the reflection divides by numbers of its size."""
CACHE_LINE = 64
"""Bytes. Vectors that lie across two lines take twice as long to load."""


def aligned_room(size: int) -> Array:
    """Memory, as it is, that begins with a cache line."""
    room = np.empty(size + CACHE_LINE // 8)
    skipped = -room.ctypes.data % CACHE_LINE // 8
    return room[skipped : skipped + size]


def aligned(*shape: int) -> Array:
    """Zeros that begin with a cache line."""
    room = aligned_room(int(np.prod(shape))).reshape(shape)
    room[:] = 0.0
    return room


@inlined
def dot(a: Array, b: Array, room: Array) -> float:
    """Scalar product of two columns of ROWS numbers, folded in eighths.

    Summed from left to right, one addition would wait for the other; folded, it vectorises without
    leave to reorder sums (docs/decisions/0002), and rounds less.
    """
    for i in range(EIGHTH):
        j, k, l = i + 2 * EIGHTH, i + 4 * EIGHTH, i + 6 * EIGHTH
        room[i] = (
            (a[i] * b[i] + a[i + EIGHTH] * b[i + EIGHTH])
            + (a[j] * b[j] + a[j + EIGHTH] * b[j + EIGHTH])
        ) + (
            (a[k] * b[k] + a[k + EIGHTH] * b[k + EIGHTH])
            + (a[l] * b[l] + a[l + EIGHTH] * b[l + EIGHTH])
        )
    for i in range(8):
        room[i] = ((room[i] + room[i + 8]) + (room[i + 16] + room[i + 24])) + (
            (room[i + 32] + room[i + 40]) + (room[i + 48] + room[i + 56])
        )
    return ((room[0] + room[1]) + (room[2] + room[3])) + (  # type: ignore[no-any-return]
        (room[4] + room[5]) + (room[6] + room[7])
    )


@kernel
def absorb(rows: Array, factor: Array, room: Array) -> None:
    """Rotate a block of rows into the triangular factor of all rows before it.

    (k, ROWS) `rows` column by column, zeros where it lacks some, are used up; the (k, k) upper
    triangle `factor`, zeros before the first block, is replaced; `room` has EIGHTH places.
    """
    for j in range(rows.shape[0]):
        pivot = behind(rows, j * ROWS)
        square = dot(pivot, pivot, room)
        if square < NOTHING:
            continue  # nothing to rotate, as with a parameter that the block does not depend on
        corner = factor[j, j]
        norm = sqrt(corner * corner + square)
        diagonal = -norm if corner > 0.0 else norm
        lead = corner - diagonal
        # the reflection 1 - v vᵀ · scale with v = [lead, pivot]: no difference of like numbers
        scale = 1.0 / (norm * (norm + abs(corner)))
        factor[j, j] = diagonal
        for k in range(j + 1, rows.shape[0]):
            column = behind(rows, k * ROWS)
            along = scale * (lead * factor[j, k] + dot(pivot, column, room))
            factor[j, k] -= along * lead
            for i in range(ROWS):
                column[i] -= along * pivot[i]


def upright(factor: Array) -> Array:
    """The triangle with rows turned so that no diagonal element is negative."""
    turned = np.where(np.diag(factor) < 0.0, -1.0, 1.0)
    return np.asarray(turned[:, None] * factor)
