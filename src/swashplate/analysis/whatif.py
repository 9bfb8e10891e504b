"""What if: a drive before and after its levers are moved, over one command."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swashplate.analysis.levers import pulled
from swashplate.analysis.outcomes import OUTCOMES, Outcome, find_outcomes, outcome_matrix
from swashplate.analysis.trial import Trial
from swashplate.drive import Drive
from swashplate.errors import InputError
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.simulation.result import Simulation

Array = NDArray[np.float64]

AS_IS, CHANGED = "as it is", "changed"


@dataclass(frozen=True, eq=False)
class Variant:
    """A drive over the trial's command."""

    drive: Drive
    run: Simulation
    values: Array
    """(K,) its outcomes, NaN where there is none."""

    @property
    def speed_limits(self) -> tuple[float, float]:
        """Speeds that the largest commands settle at, positive and negative. [rad/s]"""
        return tuple(self.drive.steady_speed([FULL_VOLTAGE, -FULL_VOLTAGE]).tolist())


@dataclass(frozen=True, eq=False)
class WhatIf:
    """A drive before and after."""

    factors: Mapping[str, float]
    """By lever."""
    trial: Trial
    outcomes: tuple[Outcome, ...]
    variants: Mapping[str, Variant]
    """``"as it is"`` first, then ``"changed"``; with several levers each alone in between, by
    words such as ``"orifice x 1.5"``."""

    @property
    def before(self) -> Variant:
        """The drive as it is."""
        return self.variants[AS_IS]

    @property
    def after(self) -> Variant:
        """The drive with all levers moved."""
        return self.variants[CHANGED]

    def sentences(self) -> tuple[str, ...]:
        """Outcomes that a variant has not, and why."""
        return tuple(
            f"{name}: no {outcome.name}, {outcome.undefined}."
            for name, variant in self.variants.items()
            for outcome, value in zip(self.outcomes, variant.values, strict=True)
            if np.isnan(value)
        )


def what_if(
    drive: Drive,
    factors: Mapping[str, float],
    trial: Trial,
    *,
    outcomes: Sequence[str] = tuple(OUTCOMES),
) -> WhatIf:
    """Move levers and see what becomes of a command.

    Parameters
    ----------
    drive : Drive
        As it is.
    factors : mapping of str to float
        By lever, see `levers.LEVERS`, e.g. ``{"orifice": 1.5, "pump": 1.5}``. [1]
    trial : Trial
        The command, see `trial.trial`; both drives begin at rest.
    outcomes : sequence of str
        Names in `outcomes.OUTCOMES`.

    Raises
    ------
    InputError
        For no lever, an unknown one, or an impossible factor.
    ParameterError
        If the changed drive breaks a rule of the model.
    """
    if not factors:
        raise InputError("Move at least one lever, such as orifice=1.5.")
    chosen = find_outcomes(outcomes)
    drives = {AS_IS: drive}
    if len(factors) > 1:
        drives |= {f"{name} x {f:g}": pulled(drive, {name: f}) for name, f in factors.items()}
    drives[CHANGED] = pulled(drive, factors)
    variants = {}
    for name, each in drives.items():
        run = each.simulate(trial.voltage, trial.rate)
        values = outcome_matrix(run.shaft_speed[None, :], trial, chosen)[0]
        variants[name] = Variant(each, run, values)
    return WhatIf(dict(factors), trial, chosen, variants)
