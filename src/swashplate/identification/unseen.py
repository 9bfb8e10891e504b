"""What a machine may do that a guess from its logs does not see.

A guess takes gains for straight, that of the amplifier and of the solenoids; and a ramp of a
current that was not measured looks like a delay and a limited acceleration. Numbers that do not
take these into account would be off by more than their intervals, so they become estimates. So
does a jump at the edge of the dead zone: a smaller dead zone and a larger one with a jump look
alike but near rest. And so does the part of the dead zone that lies behind the ramp: a current has
to grow to it, which makes a start from rest later than a change of speed.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite

from swashplate.identification.estimation.fit_problem import Parameters, is_read_off
from swashplate.identification.estimation.setup import FitSetup, Free
from swashplate.identification.estimation.unknowns import Prior
from swashplate.parameters import SIDES, ParameterSet

RAMP, WITHIN = 0.3, 1.0
"""Time of a ramp from rest to the current of the largest command beforehand, and the standard
deviation of its logarithm: cranes have ramps of 0.1 to 1 s. [s], [1]"""
BEND, LEAST, MOST = 0.15, -0.4, 1.2
"""Quadratic part of the current at the largest command over the linear one: its standard deviation
beforehand, and its bounds, up to which more command never means less current. [1]"""
JUMP, LARGEST, FIRST = 0.05, 0.3, 0.01
"""Jump of the current over that of the largest command: its standard deviation about 0 beforehand,
its bound, and where a search begins, as one at its bound would stay there. [1]"""
DEAD, DEADEST, SOME = 0.15, 0.5, 0.03
"""The same of the solenoids' dead zone behind a current that was not measured. [1]"""
FORCE, FARTHEST = 0.3, 1.2
"""Part of the solenoids' force at the current of the largest command that each power of the current
beyond the first may have: its standard deviation about 0 beforehand, and its bounds. [1]"""


def is_guessed(nominal: Parameters) -> bool:
    """Whether a drive is one that a guess read off logs."""
    return isinstance(nominal, ParameterSet) and is_read_off(nominal, "V_dz")


def with_unseen(nominal: Parameters, setup: FitSetup) -> tuple[Parameters, FitSetup]:
    """A guessed drive with what its guess does not see; others as they are.

    That is a jump, and gains that may bend, of the solenoids' force only if a current was measured,
    from which it was read off; without one a limited rate, and a dead zone of the solenoids.
    """
    if not isinstance(nominal, ParameterSet) or not is_guessed(nominal) or not nominal.tested:
        return nominal, setup
    numbers = nominal.numbers
    beyond = {
        side: max(volts - numbers[f"V_dz_{side}"], 0.0)
        for side, volts in zip(SIDES, nominal.tested, strict=True)
    }
    free, changed = dict(setup.free), dict[str, float]()
    for side, volts in beyond.items():
        current = numbers[f"G1_{side}"] * volts
        if current > 0.0 and numbers[f"J_{side}"] == 0.0:
            free[f"J_{side}"] = Free(
                bounds=(0.0, LARGEST * current), prior=Prior(0.0, JUMP * current)
            )
            changed[f"J_{side}"] = FIRST * current
        if volts > 0.0 and numbers[f"G2_{side}"] == 0.0:
            unit = numbers[f"G1_{side}"] / volts
            free[f"G2_{side}"] = Free(
                bounds=(LEAST * unit, MOST * unit), prior=Prior(0.0, BEND * unit)
            )
    if is_read_off(nominal, "Z19"):
        free |= _bending_forces(nominal, beyond)
    largest = max(numbers[f"G1_{side}"] * volts for side, volts in beyond.items())
    measured = is_read_off(nominal, "lim1") or isfinite(numbers["lim1_plus"])
    if largest > 0.0 and not measured:
        rate = largest / RAMP
        limited = {"lim1": rate, "lim2": rate, "I_t1": 0.0, "I_t2": 0.0}
        changed |= {f"{name}_{side}": value for name, value in limited.items() for side in SIDES}
        free |= dict.fromkeys(("lim1", "lim2"), Free(spread=WITHIN, tied=True))
        if numbers["Z17"] == 0.0:
            changed["Z17"] = SOME * largest
            free["Z17"] = Free(bounds=(0.0, DEADEST * largest), prior=Prior(0.0, DEAD * largest))
    return nominal.with_numbers(changed), setup.model_copy(update={"free": free})


def _bending_forces(nominal: ParameterSet, beyond: Mapping[str, float]) -> dict[str, Free]:
    """How the solenoids' forces Z20 to Z22 are free, by commands beyond the dead zone [V]."""
    numbers, free = nominal.numbers, dict[str, Free]()
    for side, volts in beyond.items():
        current = numbers[f"J_{side}"] + numbers[f"G1_{side}"] * volts - numbers["Z17"]
        if not current > 0.0:
            continue
        for power, symbol in enumerate(("Z20", "Z21", "Z22"), 1):
            unit = numbers[f"Z19_{side}"] / current**power
            if numbers[f"{symbol}_{side}"] == 0.0:
                free[f"{symbol}_{side}"] = Free(
                    bounds=(-FARTHEST * unit, FARTHEST * unit), prior=Prior(0.0, FORCE * unit)
                )
    return free
