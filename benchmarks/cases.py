"""What is simulated: the record's rate and the sets of a batch."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RATE = 512.0
STEP = 1.0 / RATE
SETS = 1000
PUMP_SPREAD = ("Z1", "Z3", "Z8", "Z10", "Z13", "Z16", "Z17", "Z19")
CARD_SPREAD = ("V_dz", "J", "G1", "omega", "lim1", "tau")
"""Parameters that the sets of a batch differ in."""


def changes(numbers: Mapping[str, float], symbols: tuple[str, ...]) -> dict[str, Array]:
    """Values of a batch, each within ±5 % of the drive's, both directions for themselves."""
    rng = np.random.default_rng(0)
    sides = ("", "_plus", "_minus")
    columns = [symbol + side for symbol in symbols for side in sides if symbol + side in numbers]
    return {name: numbers[name] * rng.uniform(0.95, 1.05, SETS) for name in columns}
