"""When samples are taken, which rows are lost and which cells stay empty."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.rig.instruments import Instruments

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FARTHEST = 0.4
"""Of the way to the next grid point a sample strays at most, so that the stamps increase. [1]"""


def sampled_instants(
    grid: Array, instruments: Instruments, generator: np.random.Generator
) -> tuple[Array, Array]:
    """Instants at which samples are taken, and the stamps that are written for them.

    Parameters
    ----------
    grid : (n,) array
        Even instants from the run's beginning to its end. [s]

    Returns
    -------
    instants, stamps : (n,) arrays
        Instants lie within the run. The stamps leave the hidden part of the jitter out and are
        rounded; without jitter both are the grid. [s]
    """
    told = instruments.jitter * generator.standard_normal(grid.size)
    hidden = instruments.hidden_jitter * generator.standard_normal(grid.size)
    spacing = grid[1] - grid[0] if grid.size > 1 else 0.0
    bound = 0.5 * FARTHEST * spacing
    stamps = np.clip(grid + np.clip(told, -bound, bound), grid[0], grid[-1])
    instants = np.clip(stamps + np.clip(hidden, -bound, bound), grid[0], grid[-1])
    if instruments.stamp_resolution:
        stamps = rounded(stamps, instruments.stamp_resolution)
    return instants, stamps


def rounded(values: Array, step: float) -> Array:
    """Values rounded to whole steps, as the nearest decimals where the step is one."""
    per_unit = 1.0 / step
    if abs(per_unit - round(per_unit)) < 1e-6 * per_unit:
        # division by a whole number gives the float that the decimal number is read as
        return np.asarray(np.rint(values * round(per_unit)) / round(per_unit) + 0.0)
    return np.asarray(np.rint(values / step) * step + 0.0)


def lost(size: int, share: float, longest: int, generator: np.random.Generator) -> Mask:
    """Which of `size` rows are lost: in runs of 1 to `longest`, together about a share of all.

    Parameters
    ----------
    share : float
        Expected share of rows that are lost, as long as it is small. [1]
    """
    mask = np.zeros(size, dtype=np.bool_)
    begins = np.flatnonzero(generator.random(size) < share / (0.5 * (1 + longest)))
    lengths = generator.integers(1, longest, size=begins.size, endpoint=True)
    for begin, length in zip(begins.tolist(), lengths.tolist(), strict=True):
        mask[begin : begin + length] = True
    return mask
