"""A jump of the current at the edge of the dead zone, of an amplifier that was read off its motion.

What a motion shows of an amplifier is a straight line beyond a dead zone. A smaller dead zone and a
larger one with a jump at its edge look alike but near rest, so that a dead zone without a jump
would have an interval that is far too narrow.
"""

from __future__ import annotations

from swashplate.identification.estimation.fit_problem import Parameters, is_read_off
from swashplate.identification.estimation.setup import FitSetup, Free
from swashplate.identification.estimation.unknowns import Prior
from swashplate.parameters import SIDES, ParameterSet

USUAL, LARGEST, FIRST = 0.05, 0.3, 0.01
"""Standard deviation of a jump beforehand, about 0, its bound, and where a search begins, over the
current of the largest command of the tests."""


def unseen_jumps(nominal: Parameters) -> dict[str, float]:
    """Columns of jumps of which a guess saw none, and the currents of the largest commands. [A]"""
    if not isinstance(nominal, ParameterSet) or nominal.tested is None:
        return {}
    numbers, currents = nominal.numbers, dict[str, float]()
    for side, volts in zip(SIDES, nominal.tested, strict=True):
        beyond = volts - numbers[f"V_dz_{side}"]
        if is_read_off(nominal, "J") and numbers[f"J_{side}"] == 0.0 and beyond > 0.0:
            currents[f"J_{side}"] = numbers[f"G1_{side}"] * beyond
    return currents


def with_jumps(setup: FitSetup, currents: dict[str, float]) -> FitSetup:
    """The setup with jumps that are known to be near 0, by their largest currents."""
    free = dict(setup.free)
    for column, current in currents.items():
        free[column] = Free(bounds=(0.0, LARGEST * current), prior=Prior(0.0, USUAL * current))
    return setup.model_copy(update={"free": free})


def first_jumps(currents: dict[str, float]) -> dict[str, float]:
    """Where a search for jumps begins: one at its bound would stay there. [A]"""
    return {column: FIRST * current for column, current in currents.items()}
