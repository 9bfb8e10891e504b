"""Which run tells of which unknown: shares of the information."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swashplate.identification.linearised import LinearisedFit

Array = NDArray[np.float64]

ALONE = 0.9
"""Share of a single run from which an unknown is said to rest on it."""


@dataclass(frozen=True, eq=False)
class Excitation:
    """How much each run moves with each unknown."""

    runs: tuple[str, ...]
    """Experiment and channel of each row."""
    names: tuple[str, ...]
    """Unknown of each column."""
    sensitivity: Array
    """(runs, K) root mean square change of the weighted residual for 1 % of the unknown."""
    share: Array
    """(runs, K) part of an unknown's information (its squared derivatives) from each run; columns
    add up to 1, or are 0 where no run tells anything."""

    def sentences(self) -> tuple[str, ...]:
        """What rests on nothing, and what on one run alone."""
        said = []
        for column, name in enumerate(self.names):
            share = self.share[:, column]
            most = int(np.argmax(share))
            if not share.any():
                said.append(f"{name}: no run depends on it.")
            elif len(self.runs) > 1 and share[most] >= ALONE:
                said.append(
                    f"{name}: {100.0 * share[most]:.0f} % of what is known of it comes from "
                    f"{self.runs[most]} alone."
                )
        return tuple(said)


def excitation(fit: LinearisedFit) -> Excitation:
    """The table of a fit."""
    squares = np.array([np.sum(run.jacobian**2, axis=0) for run in fit.runs])
    samples = np.array([float(run.time.size) for run in fit.runs])
    total = squares.sum(axis=0)
    return Excitation(
        tuple(run.label for run in fit.runs),
        fit.variables.names,
        0.01 * np.sqrt(squares / samples[:, None]),
        np.divide(squares, total, out=np.zeros_like(squares), where=total > 0.0),
    )
