"""Where searches begin: Sobol points over the bounds."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import DomainError, InputError
from swashplate.identification.dormant import dormant, effects, nominal_effects
from swashplate.identification.rising import by_increments
from swashplate.identification.solving import Objective

Array = NDArray[np.float64]
TRIES = 200
"""Points that are tried for each start."""


def sobol_starts(objective: Objective, count: int, seed: int) -> Iterator[Array]:
    """Points spread evenly over the bounds; some are left out and drawn again.

    Those are left out where the model does not hold, or where an unknown has no effect although it
    has one nominally: a stop that is not reached, for example, to which no descent finds back. What
    is known to rise (`rising.Ordered`) is drawn by its increments, so that it does.

    Parameters
    ----------
    objective : Objective
        Whose bounds and domain.
    count : int
        How many points.
    seed : int
        Of the scrambling: the same seed, the same points, however many are asked for.

    Raises
    ------
    InputError
        If hardly any point can be used.
    """
    from scipy.stats.qmc import Sobol

    form = by_increments(objective)
    nominal = nominal_effects(objective)
    low, high = form.bounds
    sequence = Sobol(low.size, scramble=True, rng=np.random.default_rng(seed))
    found, tried = 0, 0
    while found < count:
        for point in sequence.random(8):
            tried += 1
            vector = form.to_vector(low + point * (high - low))
            try:
                present = effects(objective, vector)
            except DomainError:
                continue
            if dormant(present, nominal).any():
                continue
            yield vector
            found += 1
            if found == count:
                return
        if tried > TRIES * (found + 1):
            raise InputError(
                f"Of {tried} starts within the bounds only {found} lie in the model's domain and "
                "let every unknown have an effect; narrow the bounds, those of the solenoids' "
                "forces first."
            )
