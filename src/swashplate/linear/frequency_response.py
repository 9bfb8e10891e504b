"""Frequency response of a drive to sines of a size: its describing function."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError

if TYPE_CHECKING:
    import polars

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Counts = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """First harmonic of the answer to bias + amplitude · sin(2π f t), once it repeats itself.

    A row for each amplitude, a column for each frequency.
    """

    name: str
    """Name of the drive."""
    input: str
    """``"voltage"`` or ``"current"``."""
    output: str
    bias: float
    """Mean of the input. [V or A]"""
    frequencies: Array
    """Rising, (f,). [Hz]"""
    amplitudes: Array
    """Of the input, as given, (a,). [V or A]"""
    ratio: ComplexArray
    """First harmonic of the output by that of the input, (a, f); 0 where nothing moves."""
    distortion: Array
    """Root mean square of all but mean and first harmonic, by that of the first harmonic, (a, f);
    0 where nothing moves. [1]"""
    mean: Array
    """Mean of the output, (a, f)."""
    cycles: Counts
    """Cycles until the answer repeated itself, (a, f)."""

    def __repr__(self) -> str:
        return (
            f"FrequencyResponse({self.name!r}, {self.input} to {self.output}, "
            f"{self.amplitudes.size} amplitudes, {self.frequencies.size} frequencies)"
        )

    @property
    def gain(self) -> Array:
        """Magnitude of the ratio, (a, f)."""
        return np.abs(self.ratio)

    @property
    def moves(self) -> NDArray[np.bool_]:
        """Where there is an answer at all, (a, f): a small sine may stay in a dead zone."""
        return np.asarray(self.ratio != 0.0)

    @property
    def phase(self) -> Array:
        """Phase of the output, negative where it lags, followed from low to high frequencies. [rad]

        The lowest frequency's is within ±π. NaN marks what `moves` denies: nothing has no phase.
        """
        phase = np.full(self.ratio.shape, np.nan)
        for row, ratio in zip(phase, self.ratio, strict=True):
            there = ratio != 0.0
            row[there] = np.unwrap(np.angle(ratio[there]))
        return phase

    def at(self, frequency: float) -> FrequencyResponse:
        """The part at one of the frequencies. [Hz]

        Raises
        ------
        InputError
            If it is none of them; nothing is interpolated.
        """
        k = int(np.argmin(np.abs(self.frequencies - frequency)))
        nearest = float(self.frequencies[k])
        if not abs(nearest - frequency) <= 1e-9 * nearest:
            raise InputError(
                f"The response was not taken at {frequency:g} Hz; the nearest frequency is "
                f"{nearest:.6g} Hz."
            )
        near = slice(k, k + 1)
        return FrequencyResponse(
            self.name,
            self.input,
            self.output,
            self.bias,
            self.frequencies[near],
            self.amplitudes,
            self.ratio[:, near],
            self.distortion[:, near],
            self.mean[:, near],
            self.cycles[:, near],
        )

    def to_polars(self) -> polars.DataFrame:
        """Table in SI, a row for each amplitude and frequency; no phase where nothing moves."""
        import polars as pl

        shape = self.ratio.shape
        table = pl.DataFrame(
            {
                "amplitude": np.repeat(self.amplitudes, shape[1]),
                "frequency": np.tile(self.frequencies, shape[0]),
                "gain": self.gain.ravel(),
                "phase": self.phase.ravel(),
                "distortion": self.distortion.ravel(),
                "mean": self.mean.ravel(),
                "cycles": self.cycles.ravel(),
            }
        )
        return table.with_columns(pl.col("phase").fill_nan(None))

    def write(self, path: str | Path) -> None:
        """Write the table of `to_polars` as CSV or Parquet, by the path's ending.

        Raises
        ------
        FileError
            For another ending or a place that cannot be written.
        """
        from swashplate.tables import write_table

        write_table(self.to_polars(), path)
