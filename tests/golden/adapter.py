"""The one place that reaches inside the package: residuals, their Jacobian and its triangle.

All else goes through public classes. When the inside moves, edit this file and no other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from swashplate import Drive
from swashplate.equations.marching.observation import Observation, ObservedRecord
from swashplate.equations.marching.record import record_of
from swashplate.simulation.residuals import Own, jacobian, residuals, triangle

Array = NDArray[np.float64]
DrivenBy = Literal["voltage", "current"]
Start = Literal["rest", "steady"]


def observe(
    values: Array,
    rate: float,
    observations: Sequence[Mapping[str, Any]],
    driven_by: DrivenBy = "voltage",
    start: Start = "rest",
) -> ObservedRecord:
    """A record and what was observed under it; each observation by its arguments."""
    record = record_of(values, rate, what=driven_by)
    return ObservedRecord(record, [Observation(**each) for each in observations], driven_by, start)


def own_of(start_pressure: float | None, offsets: Array, clock_offsets: Array) -> Own:
    """Values of an experiment's own unknowns."""
    return Own(start_pressure, tuple(offsets.tolist()), tuple(clock_offsets.tolist()))


def residuals_of(drive: Drive, observed: ObservedRecord, own: Own, block: int) -> Array:
    """Weighted residuals, one observation after the other."""
    return residuals(drive.parameters, observed, own, block=block)


def jacobian_of(
    drive: Drive, observed: ObservedRecord, columns: Sequence[str], own: Own, block: int
) -> tuple[tuple[str, ...], Array, Array, Array]:
    """Names, (m, k) derivatives, (m,) residuals, squares of each observation."""
    found = jacobian(drive.parameters, observed, columns, own, block=block)
    return found.names, found.columns, found.residuals, found.squares


def triangle_of(
    drive: Drive, observed: ObservedRecord, columns: Sequence[str], own: Own, block: int
) -> tuple[tuple[str, ...], Array, Array]:
    """Names, (k + 1, k + 1) triangular factor of [J r], squares of each observation."""
    found = triangle(drive.parameters, observed, columns, own, block=block)
    return found.names, found.factor, found.squares
