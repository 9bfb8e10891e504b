"""Linear recurrences over a block of samples: the derivatives of states, and low passes.

A derivative follows the state that it belongs to by y[n+1] = a[n] y[n] + g[n], one number after
the other. Four of them side by side fill the time that each waits for its own last number.
"""

import numpy as np
from numpy.typing import NDArray

from swashplate.simulation.compilation import kernel

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

ABREAST = 4
"""Rows marched together: lists of rows are filled up to a multiple of it with a row of zeros."""


@kernel
def follow(
    factor: Array, rows: Array, chosen: Indices, start: int, count: int, state: Array
) -> None:
    """Replace g by y with y[n+1] = factor[n] y[n] + g[n], in each chosen row.

    Parameters
    ----------
    factor : (m,) array
        What a step leaves of y.
    rows : (r, m) array
        Inputs g, replaced by y, which begins with the state.
    chosen : (4 j,) array
        Numbers of the rows to march.
    start, count : int
        First place of a row's samples, and how many there are.
    state : (r,) array
        y at the first sample, a number for each row; replaced by that behind the last one.
    """
    for first in range(0, chosen.size, ABREAST):
        c0, c1, c2, c3 = chosen[first], chosen[first + 1], chosen[first + 2], chosen[first + 3]
        r0, r1, r2, r3 = rows[c0], rows[c1], rows[c2], rows[c3]
        y0, y1, y2, y3 = state[c0], state[c1], state[c2], state[c3]
        for n in range(start, start + count):
            a = factor[n - start]
            g0, g1, g2, g3 = r0[n], r1[n], r2[n], r3[n]
            r0[n], r1[n], r2[n], r3[n] = y0, y1, y2, y3
            y0, y1, y2, y3 = a * y0 + g0, a * y1 + g1, a * y2 + g2, a * y3 + g3
        state[c0], state[c1], state[c2], state[c3] = y0, y1, y2, y3


@kernel
def settle(factor: Array, rows: Array, chosen: Indices, count: int, state: Array) -> None:
    """Replace g by y with y[n] = factor[n] y[n-1] + g[n], from place 0 on; see `follow`.

    The state is y at the sample before the first, then y at the last.
    """
    for first in range(0, chosen.size, ABREAST):
        c0, c1, c2, c3 = chosen[first], chosen[first + 1], chosen[first + 2], chosen[first + 3]
        r0, r1, r2, r3 = rows[c0], rows[c1], rows[c2], rows[c3]
        y0, y1, y2, y3 = state[c0], state[c1], state[c2], state[c3]
        for n in range(count):
            a = factor[n]
            y0, y1 = a * y0 + r0[n], a * y1 + r1[n]
            y2, y3 = a * y2 + r2[n], a * y3 + r3[n]
            r0[n], r1[n], r2[n], r3[n] = y0, y1, y2, y3
        state[c0], state[c1], state[c2], state[c3] = y0, y1, y2, y3


@kernel
def follow_second_order(
    by_state: Array,
    by_previous: Array,
    rows: Array,
    chosen: Indices,
    count: int,
    state: Array,
    previous: Array,
) -> None:
    """Replace g by y with y[n+1] = by_state[n] y[n] + by_previous[n] y[n-1] + g[n], as `settle`."""
    for first in range(0, chosen.size, ABREAST):
        c0, c1, c2, c3 = chosen[first], chosen[first + 1], chosen[first + 2], chosen[first + 3]
        r0, r1, r2, r3 = rows[c0], rows[c1], rows[c2], rows[c3]
        y0, y1, y2, y3 = state[c0], state[c1], state[c2], state[c3]
        z0, z1, z2, z3 = previous[c0], previous[c1], previous[c2], previous[c3]
        for n in range(count):
            a, b = by_state[n], by_previous[n]
            g0, g1, g2, g3 = r0[n], r1[n], r2[n], r3[n]
            r0[n], r1[n], r2[n], r3[n] = y0, y1, y2, y3
            g0, g1, g2, g3 = b * z0 + g0, b * z1 + g1, b * z2 + g2, b * z3 + g3
            z0, z1, z2, z3 = y0, y1, y2, y3
            y0, y1, y2, y3 = a * y0 + g0, a * y1 + g1, a * y2 + g2, a * y3 + g3
        state[c0], state[c1], state[c2], state[c3] = y0, y1, y2, y3
        previous[c0], previous[c1], previous[c2], previous[c3] = z0, z1, z2, z3


@kernel
def integrate_row(row: Array, first: int, count: int, step: float, state: Array) -> None:
    """Replace a rate by its trapezoidal integral, as `integrate` does over a whole record.

    Parameters
    ----------
    row : (m,) array
        Rate in `count` places from `first` on, replaced.
    state : (3,) array
        Integral and rate at the sample before, and 1.0 once there is one.
    """
    total, last = state[0], state[1]
    for n in range(first, first + count):
        rate = row[n]
        if state[2] != 0.0:
            total = total + 0.5 * step * (last + rate)
        state[2] = 1.0
        last = rate
        row[n] = total
    state[0], state[1] = total, last
