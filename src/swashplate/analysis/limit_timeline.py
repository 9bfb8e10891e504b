"""Which limit acts when: the stretches of time of a simulation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from swashplate.simulation.result import Limit, Simulation

if TYPE_CHECKING:
    import polars

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LimitTimeline:
    """Stretches of time in which limits act; several can act at once."""

    limits: tuple[Limit, ...]
    """Those that act anywhere, in the order of the chain."""
    spans: tuple[Array, ...]
    """For each of them beginning and end of every stretch, (m, 2). [s]"""
    shares: tuple[float, ...]
    """For each of them the share of the samples at which it acts."""
    free: float
    """Share of the samples at which none acts."""

    def to_polars(self) -> polars.DataFrame:
        """Table of the stretches by their beginning: ``limit``, ``begin`` [s], ``end`` [s]."""
        import polars as pl

        rows = [
            (str(limit.name).lower(), *span)
            for limit, spans in zip(self.limits, self.spans, strict=True)
            for span in spans.tolist()
        ]
        schema = {"limit": pl.String, "begin": pl.Float64, "end": pl.Float64}
        return pl.DataFrame(rows, schema=schema, orient="row").sort("begin", maintain_order=True)


def limit_timeline(run: Simulation) -> LimitTimeline:
    """Which limit acts when in a simulation.

    Parameters
    ----------
    run : Simulation
        Whose flags are read.

    Returns
    -------
    LimitTimeline
        A sample stands for the time up to half way to its neighbours, the first and the last for
        half as much.
    """
    acting = [limit for limit in Limit if run.active(limit).any()]
    return LimitTimeline(
        tuple(acting),
        tuple(_spans(run.active(limit), run.time) for limit in acting),
        tuple(float(run.active(limit).mean()) for limit in acting),
        float((run.limits == 0).mean()),
    )


def _spans(active: NDArray[np.bool_], time: Array) -> Array:
    turns = np.flatnonzero(np.diff(active, prepend=False, append=False))
    middles = np.concatenate((time[:1], 0.5 * (time[1:] + time[:-1]), time[-1:]))
    return np.stack((middles[turns[::2]], middles[turns[1::2]]), axis=1)
