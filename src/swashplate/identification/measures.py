"""How well a simulation follows a measurement: RMSE, NRMSE, fit per cent, R²."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError

Array = NDArray[np.float64]


class Measures(NamedTuple):
    """Measures of one channel of one run, or of several together."""

    samples: int
    """Samples that count."""
    rmse: float
    """Root of the mean squared difference, in the channel's unit."""
    spread: float
    """Standard deviation of what was measured, in the channel's unit."""

    @property
    def nrmse(self) -> float | None:
        """RMSE over the measured standard deviation; None where nothing moved."""
        return self.rmse / self.spread if self.spread > 0.0 else None

    @property
    def fit_percent(self) -> float | None:
        """100 (1 - NRMSE); 100 is perfect, 0 no better than the measured mean. [%]"""
        return None if self.nrmse is None else 100.0 * (1.0 - self.nrmse)

    @property
    def r_squared(self) -> float | None:
        """1 - NRMSE²."""
        return None if self.nrmse is None else 1.0 - self.nrmse**2

    @property
    def sentence(self) -> str:
        """The verdict for a table's cell or a line of text."""
        if self.fit_percent is None:
            return f"RMSE {self.rmse:.4g}; what was measured is constant, so there is no fit %"
        return f"RMSE {self.rmse:.4g}, fit {self.fit_percent:.1f} %, R² {self.r_squared:.4f}"


def measures(
    measured: Array, simulated: Array, weight: Array | None = None, *, weighted: bool = False
) -> Measures:
    """Measures of one channel of one run.

    Parameters
    ----------
    measured, simulated : (n,) arrays
        In the channel's unit.
    weight : (n,) array, optional
        Factors on the squared errors; samples with 0 are ignored.
    weighted : bool
        Whether the factors weigh mean, error and spread as well. By default they only say which
        samples count: a window of weight ten would otherwise pass for the whole run.

    Raises
    ------
    InputError
        If lengths differ, no sample counts, one that does is not finite, or a weight is negative.
    """
    return pooled_measures([(measured, simulated, weight)], weighted=weighted)


def pooled_measures(
    runs: list[tuple[Array, Array, Array | None]], *, weighted: bool = False
) -> Measures:
    """Measures of one channel over several runs, each about the mean of all.

    Parameters
    ----------
    runs : list of (measured, simulated, weight)
        As of `measures`.
    weighted : bool
        See there.

    Raises
    ------
    InputError
        As `measures`.
    """
    parts = [_counting(*run) for run in runs]
    measured, simulated, factor = (np.concatenate(column) for column in zip(*parts, strict=True))
    if not measured.size:
        raise InputError("No sample counts: all are ignored or have weight 0.")
    if not weighted:
        factor = np.ones(measured.size)
    total = float(factor.sum())
    mean = float(factor @ measured) / total
    squares = float(factor @ (simulated - measured) ** 2) / total
    # a constant channel's own mean is off by rounding
    about = measured - mean
    about[np.abs(about) <= 4.0 * np.finfo(np.float64).eps * abs(mean)] = 0.0
    return Measures(
        measured.size, float(np.sqrt(squares)), float(np.sqrt(factor @ about**2 / total))
    )


def _counting(
    measured: Array, simulated: Array, weight: Array | None
) -> tuple[Array, Array, Array]:
    """The samples that count, and their factors."""
    factor = np.ones(measured.shape) if weight is None else weight
    if measured.shape != simulated.shape or measured.shape != factor.shape:
        raise InputError(
            f"{measured.size} measured and {simulated.size} simulated samples with {factor.size} "
            "weights cannot be compared; simulate at the measurement's stamps."
        )
    if not (factor >= 0.0).all():
        raise InputError(
            "A weight is negative or not a number; a factor on a squared error is 0 or more."
        )
    used = factor > 0.0
    for what, samples in (("measured", measured), ("simulated", simulated)):
        if not np.isfinite(samples[used]).all():
            row = int(np.flatnonzero(used & ~np.isfinite(samples))[0])
            raise InputError(f"Sample {row + 1} of what was {what} is not finite; ignore it.")
    return measured[used], simulated[used], factor[used]
