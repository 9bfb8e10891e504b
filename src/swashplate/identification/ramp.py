"""What an amplifier may do that no guess from a motion alone sees: a limited rate.

A ramp of the current looks like a delay and a limited acceleration at first sight. Numbers that do
not take it into account would be off by more than their intervals, so it becomes an estimate.
"""

from __future__ import annotations

from math import isfinite

from swashplate.identification.estimation.setup import FitSetup, Free
from swashplate.identification.estimation.stages import is_read_off
from swashplate.parameters import SIDES, ParameterSet

RAMP, WITHIN = 0.3, 1.0
"""Time of a ramp from rest to the current of the largest command beforehand, and the standard
deviation of its logarithm: cranes have ramps of 0.1 to 1 s. [s], [1]"""


def read_off(nominal: ParameterSet) -> bool:
    """Whether a drive is one that a guess read off logs."""
    return is_read_off(nominal, "V_dz")


def with_ramp(nominal: ParameterSet, setup: FitSetup) -> tuple[ParameterSet, FitSetup]:
    """A whole drive that a guess read off a motion, with a limited rate; others as they are."""
    if not read_off(nominal):
        return nominal, setup
    numbers = nominal.numbers
    if is_read_off(nominal, "lim1") or isfinite(numbers["lim1_plus"]) or nominal.tested is None:
        return nominal, setup
    largest = max(
        numbers[f"G1_{side}"] * (volts - numbers[f"V_dz_{side}"])
        for side, volts in zip(SIDES, nominal.tested, strict=True)
    )
    if not largest > 0.0:
        return nominal, setup
    rate = largest / RAMP
    limited = {"lim1": rate, "lim2": rate, "I_t1": 0.0, "I_t2": 0.0}
    nominal = nominal.with_numbers(
        {f"{name}_{side}": value for name, value in limited.items() for side in SIDES}
    )
    (stage,) = setup.stages
    free = {**stage.free, **dict.fromkeys(("lim1", "lim2"), Free(spread=WITHIN, tied=True))}
    stage = stage.model_copy(update={"free": free})
    return nominal, setup.model_copy(update={"stages": (stage,)})
