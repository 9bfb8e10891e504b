"""Drives whose parameters are known, to hold a fit against: drawn about a nominal one."""

from __future__ import annotations

import numpy as np

from swashplate.drive import Drive
from swashplate.identification.drive_model import DriveModel
from swashplate.identification.setup import Setup
from swashplate.identification.unknowns import Unknown
from swashplate.parameters.definitions import columns_of
from swashplate.parameters.parameter_set import ParameterSet

SPREAD = 0.05
"""Standard deviation of the logarithm by which a drawn parameter differs from the nominal one."""

OF_FORCES = ("Z19", "Z21")
"""The solenoids' coefficients that are drawn where a set-up frees forces: those of odd powers."""


def drawn(nominal: Drive, setup: Setup, seed: int, *, spread: float = SPREAD) -> Drive:
    """A drive that differs from a nominal one in what a set-up frees, and in nothing else.

    Parameters
    ----------
    nominal : Drive
        About which it is drawn.
    setup : Setup
        Its free parameters are multiplied by log-normal factors, both directions apart.
    seed : int
        Not negative.
    spread : float
        Standard deviation of the factors' logarithms.

    Raises
    ------
    ParameterError
        If what was drawn breaks a rule: draw with another seed.
    """
    random = np.random.default_rng(seed)
    names = [name for stage in setup.stages for name in columns_of(list(stage.free))]
    if any(stage.forces is not None for stage in setup.stages):
        names += columns_of(list(OF_FORCES))
    numbers = nominal.parameters.numbers
    factors = {name: float(np.exp(random.normal(0.0, spread))) for name in names}
    return nominal.replace(**{name: numbers[name] * factor for name, factor in factors.items()})


def true_value(unknown: Unknown, model: DriveModel, truth: ParameterSet) -> float | None:
    """What an unknown of the machine really is; None for one of a single experiment."""
    if unknown.run is not None:
        return None
    forces = model.forces.values(truth) if model.forces is not None else {}
    return {**truth.numbers, **forces}[unknown.targets[0]]
