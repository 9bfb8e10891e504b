"""Filter and smoother of a motion of constant jerk, marched forth and back through a record.

State: position, speed, acceleration, jerk; white noise drives the jerk's derivative. Time is in
units of the usual interval. No covariance P is ever formed, only a root R of it, P = Rᵀ·R, and two
are added by rotating their roots, one below the other, to a triangle. So nothing can become
negative or lose its digits where intervals of a second stand beside intervals of a millisecond.
"""

from math import log, sqrt

import numpy as np

from swashplate.campaign.stamps import Array
from swashplate.equations.cache import kernel
from swashplate.equations.equation import inlined

ORDER = 4
"""Number of states."""
NOISE_COVARIANCE = np.array(
    [
        [1 / 252, 1 / 72, 1 / 30, 1 / 24],
        [1 / 72, 1 / 20, 1 / 8, 1 / 6],
        [1 / 30, 1 / 8, 1 / 3, 1 / 2],
        [1 / 24, 1 / 6, 1 / 2, 1.0],
    ]
)
"""What unit noise adds to the covariance over a unit interval."""
NOISE_ROOT: Array = np.asarray(np.linalg.cholesky(NOISE_COVARIANCE), dtype=np.float64)
"""Its lower triangular root."""


@inlined
def set_noise_root(interval: float, noise: float, unit_root: Array, root: Array) -> None:
    """Write the root, upper triangular, of the covariance that the noise adds over an interval."""
    scale = sqrt(noise * interval)
    for i in range(ORDER - 1, -1, -1):
        for j in range(ORDER):
            root[j, i] = scale * unit_root[i, j]
        scale *= interval


@inlined
def move(interval: float, rows: Array) -> None:
    """Move states, or the rows of a root, over an interval: each row times Fᵀ, in place."""
    d = interval
    for i in range(rows.shape[0]):
        speed, acceleration, jerk = rows[i, 1], rows[i, 2], rows[i, 3]
        rows[i, 0] += d * (speed + d * (acceleration / 2.0 + d * jerk / 6.0))
        rows[i, 1] += d * (acceleration + d * jerk / 2.0)
        rows[i, 2] += d * jerk


@inlined
def triangularise(matrix: Array, columns: int) -> None:
    """Rotate the rows, in place, until the first four columns are an upper triangle."""
    rows = matrix.shape[0]
    for p in range(ORDER):
        length = 0.0
        for i in range(p, rows):
            length += matrix[i, p] * matrix[i, p]
        length = sqrt(length)
        if length == 0.0:
            continue
        # Householder: reflect the column onto its diagonal, away from its own sign
        diagonal = -length if matrix[p, p] > 0.0 else length
        head = matrix[p, p] - diagonal
        matrix[p, p] = diagonal
        for j in range(p + 1, columns):
            along = head * matrix[p, j]
            for i in range(p + 1, rows):
                along += matrix[i, p] * matrix[i, j]
            along /= diagonal * head
            matrix[p, j] += along * head
            for i in range(p + 1, rows):
                matrix[i, j] += along * matrix[i, p]
        for i in range(p + 1, rows):
            matrix[i, p] = 0.0


@inlined
def measure(state: Array, root: Array, position: float, variance: float, seen: Array) -> float:
    """Correct state and root, in place, by a measured position (Potter).

    Returns
    -------
    float
        Logarithm of the measurement's likelihood, but for a constant.
    """
    spread = variance
    for i in range(ORDER):
        seen[i] = root[i, 0]
        spread += seen[i] * seen[i]
    surprise: float = position - state[0]
    share = 1.0 / (1.0 + sqrt(variance / spread))
    for j in range(ORDER):
        gain = 0.0
        for i in range(ORDER):
            gain += root[i, j] * seen[i]
        gain /= spread
        state[j] += gain * surprise
        for i in range(ORDER):
            root[i, j] -= share * seen[i] * gain
    return -0.5 * (log(spread) + surprise * surprise / spread)


@kernel
def filter_positions(
    time: Array,
    position: Array,
    variance: Array,
    noise: float,
    vague: float,
    unit_root: Array,
    states: Array,
    roots: Array,
) -> float:
    """Filter forth in time.

    Parameters
    ----------
    time, position, variance : (n,) arrays
        Instants in usual intervals, positions measured and their variance.
    noise : float
        Density of the noise on the jerk's derivative.
    vague : float
        Standard deviation of every state before the first measurement.
    unit_root : (4, 4) array
        `NOISE_ROOT`.
    states, roots : (n, 4), (n, 4, 4) arrays
        Outputs; of length 0 if only the likelihood is wanted.

    Returns
    -------
    float
        Logarithm of the likelihood, but for a constant; without the first four measurements,
        which only determine where the motion starts.
    """
    stacked = np.zeros((2 * ORDER, ORDER))
    root, state, seen = stacked[:ORDER], np.zeros((1, ORDER)), np.zeros(ORDER)
    for i in range(ORDER):
        root[i, i] = vague
    state[0, 0] = position[0]
    likelihood = 0.0
    for n in range(time.size):
        if n > 0:
            interval = time[n] - time[n - 1]
            set_noise_root(interval, noise, unit_root, stacked[ORDER:])
            move(interval, root)
            move(interval, state)
            triangularise(stacked, ORDER)
        gained = measure(state[0], root, position[n], variance[n], seen)
        if n >= ORDER:
            likelihood += gained
        if states.shape[0] > 0:
            for i in range(ORDER):
                states[n, i] = state[0, i]
                for j in range(ORDER):
                    roots[n, i, j] = root[i, j]
    return likelihood


@kernel
def smooth_back(time: Array, noise: float, unit_root: Array, states: Array, roots: Array) -> None:
    """Turn filtered states and roots into smoothed ones, in place (Rauch, Tung, Striebel).

    Parameters
    ----------
    time, noise, unit_root, states, roots :
        As `filter_positions` had and left them.

    Notes
    -----
    A triangle of [R·Fᵀ, R; root of the noise, 0] holds the root A of the predicted covariance, then
    A·Gᵀ with the smoother's gain G, and below it a root B of what the row after cannot tell. The
    smoothed root is the triangle of [B; R₊·Gᵀ], R₊ that of the row after.
    """
    stacked, joined = np.zeros((2 * ORDER, 2 * ORDER)), np.zeros((2 * ORDER, ORDER))
    gain, moved = np.zeros((ORDER, ORDER)), np.zeros((1, ORDER))
    for n in range(time.size - 2, -1, -1):
        interval = time[n + 1] - time[n]
        set_noise_root(interval, noise, unit_root, stacked[ORDER:])
        for i in range(ORDER):
            moved[0, i] = states[n, i]
            for j in range(ORDER):
                stacked[i, j] = stacked[i, ORDER + j] = roots[n, i, j]
                stacked[ORDER + i, ORDER + j] = 0.0
        move(interval, stacked[:ORDER])
        move(interval, moved)
        triangularise(stacked, 2 * ORDER)
        for c in range(ORDER):
            for i in range(ORDER - 1, -1, -1):
                total = stacked[i, ORDER + c]
                for m in range(i + 1, ORDER):
                    total -= stacked[i, m] * gain[m, c]
                gain[i, c] = total / stacked[i, i]
                states[n, c] += gain[i, c] * (states[n + 1, i] - moved[0, i])
            for i in range(ORDER):
                joined[i, c] = stacked[ORDER + i, ORDER + c]
                joined[ORDER + i, c] = 0.0
                for m in range(ORDER):
                    joined[ORDER + i, c] += roots[n + 1, i, m] * gain[m, c]
        triangularise(joined, ORDER)
        for i in range(ORDER):
            for j in range(ORDER):
                roots[n, i, j] = joined[i, j]
