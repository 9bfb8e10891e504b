"""Where a record is smooth enough for a solver to take long steps through it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LONG_SAMPLES, SHORT_SAMPLES = 4, 1
"""Longest step of a solver where the force is smooth, and where it is not, in samples."""
KINK = 1e-4
"""Change of the force's slope from one sample to the next that counts as none, times step. [N]"""
SHORTEST = 16
"""Samples below which a smooth stretch is not worth a restart of the solver."""


class Stretch(NamedTuple):
    """Part of a record."""

    end: int
    """Its last sample."""
    longest: float
    """Longest step to take in it. [s]"""


def stretches_of(force: Array, held: bool, step: float) -> list[Stretch]:
    """Divide a record into stretches with a smooth force and stretches without.

    A solver that steps over a short pulse of the force never sees it, however small its tolerance.

    Parameters
    ----------
    force : (n,) array
        Net solenoid force at the samples, n at least 2. [N]
    held : bool
        Whether the current is constant between samples instead of a straight line.
    step : float
        Distance of the samples. [s]

    Returns
    -------
    list of Stretch
        In order; the last one ends at the last sample.
    """
    kinks = np.diff(force) if held else np.diff(force, 2)
    rough = np.zeros(force.size - 1, dtype=bool)  # intervals between samples
    places = np.flatnonzero(np.abs(kinks) > KINK) + (0 if held else 1)
    for reach in range(-LONG_SAMPLES, LONG_SAMPLES):
        rough[np.clip(places + reach, 0, rough.size - 1)] = True
    ends = [*np.flatnonzero(np.diff(rough)) + 1, rough.size]
    found: list[Stretch] = []
    begin = 0
    for end in ends:
        smooth = not rough[begin] and end - begin >= SHORTEST
        longest = step * (LONG_SAMPLES if smooth else SHORT_SAMPLES)
        if found and found[-1].longest == longest:
            found.pop()
        found.append(Stretch(int(end), longest))
        begin = end
    return found
