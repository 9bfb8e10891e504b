"""The inverse steady-state map as an object: voltages for wanted speeds, tables and files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.errors import FileError, InputError

if TYPE_CHECKING:
    import polars

Array = NDArray[np.float64]

ROUNDING = 1e-9
"""Part of the range of speeds by which a wanted one may exceed it and still count as the limit."""


class Branch(NamedTuple):
    """One way's part of the map, both rising, straight lines between the points."""

    speed: Array
    """[rad/s]"""
    voltage: Array
    """[V]"""


@dataclass(frozen=True, eq=False)
class InverseMap:
    """Voltage for a wanted speed; positive voltage and positive speed go together.

    Between the slowest speeds that can be held each way there is nothing but the creep at 0 V. A
    wanted speed in this gap gets whichever of the three is nearest, 0 V if two are.
    """

    name: str
    """Name of the drive."""
    minus: Branch
    """From the speed limit to the dead zone's edge."""
    plus: Branch
    """From the dead zone's edge to the speed limit."""
    creep: float
    """Speed at 0 V. [rad/s]"""
    acceleration: tuple[float, float]
    """Largest acceleration from rest, plus and minus, magnitudes. A wanted speed that changes
    faster is not followed, whatever the voltage. [rad/s²]"""
    lag: float
    """Time by which the speed follows a slow change of the command, see `command`. [s]"""
    error: float
    """Largest error of the straight lines: steady speed less wanted speed half way between two
    points. [rad/s]"""

    def __repr__(self) -> str:
        low, high = self.limits
        return (
            f"InverseMap({self.name!r}, {self.minus.speed.size} + {self.plus.speed.size} points, "
            f"{low:.4g} to {high:.4g} rad/s)"
        )

    @property
    def limits(self) -> tuple[float, float]:
        """Lowest and highest speed that a voltage settles at. [rad/s]"""
        return float(self.minus.speed[0]), float(self.plus.speed[-1])

    @property
    def gap(self) -> tuple[float, float]:
        """Speeds between which only the creep can be held. [rad/s]"""
        return float(self.minus.speed[-1]), float(self.plus.speed[0])

    def voltage(self, speed: ArrayLike, *, clip: bool = False) -> Array:
        """Voltage for wanted speeds, element by element; it never falls where the speed rises.

        Parameters
        ----------
        speed : array_like
            Wanted speeds of any shape. [rad/s]
        clip : bool
            Take the limit for a speed beyond it instead of refusing it.

        Returns
        -------
        array
            [V]

        Raises
        ------
        InputError
            For a speed beyond the limits, or one that is no finite number.
        """
        wanted = _finite(speed)
        low, high = self.limits
        slack = ROUNDING * (high - low)
        beyond = wanted.size and (wanted.min() < low - slack or wanted.max() > high + slack)
        if beyond and not clip:
            worst = float(wanted.max() if wanted.max() > high else wanted.min())
            raise InputError(
                f"{self.name} cannot settle at {np.degrees(worst):.6g} deg/s: its speeds reach "
                f"from {np.degrees(low):.6g} to {np.degrees(high):.6g} deg/s; want less, or clip."
            )
        wanted = np.clip(wanted, low, high)
        below, above = self.gap
        held = np.array([below, self.creep, above])
        volts = np.array([self.minus.voltage[-1], 0.0, self.plus.voltage[0]])
        # the creep comes first, so that it wins a tie
        order = np.array([1, 0, 2])
        away = np.abs(wanted[..., np.newaxis] - held[order])
        found = volts[order][np.argmin(away, axis=-1)]
        found = np.where(wanted > above, np.interp(wanted, *self.plus), found)
        return np.asarray(np.where(wanted < below, np.interp(wanted, *self.minus), found))

    def command(self, speed: ArrayLike, rate: float, *, lead: float | None = None) -> Array:
        """Voltage over time for a wanted speed over time, with the drive's lag made up for.

        Parameters
        ----------
        speed : (n,) array_like
            Wanted speed, n ≥ 2. [rad/s]
        rate : float
            Its samples a second. [Hz]
        lead : float, optional
            Time by which the wanted speed is run ahead along its tangent, by default `lag`; 0 for
            the steady map alone. [s]

        Returns
        -------
        (n,) array
            Voltage for wanted + lead · d(wanted)/dt, that sum held within the speed limits. [V]

        Raises
        ------
        InputError
            For a wanted speed beyond the limits, or a rate or lead out of range.
        """
        wanted = _finite(speed)
        if wanted.ndim != 1 or wanted.size < 2:
            raise InputError("A command needs two or more samples of the wanted speed in one row.")
        ahead = self.lag if lead is None else lead
        if not (np.isfinite(rate) and rate > 0.0 and np.isfinite(ahead) and ahead >= 0.0):
            raise InputError(
                f"A command needs a rate above 0 Hz and a lead of 0 s or more, not {rate:g} Hz and "
                f"{ahead:g} s."
            )
        plain = self.voltage(wanted)
        if ahead == 0.0:
            return plain
        return self.voltage(wanted + ahead * np.gradient(wanted, 1.0 / rate), clip=True)

    def reachable(self, speed: ArrayLike, rate: float) -> Array:
        """A wanted speed over time, held within the limits of speed and acceleration.

        What the drive is asked for then never changes faster than the orifice lets it, so that it
        does not trail behind. Arguments as in `command`; beyond the limits it is clipped. [rad/s]
        """
        wanted = np.clip(_finite(speed), *self.limits)
        if wanted.ndim != 1 or not rate > 0.0:
            raise InputError("A wanted speed over time is one row of numbers at a rate above 0 Hz.")
        up, down = (each / rate for each in self.acceleration)
        held = wanted.tolist()
        for n in range(1, len(held)):
            held[n] = min(max(held[n], held[n - 1] - down), held[n - 1] + up)
        return np.array(held)

    def to_polars(self) -> polars.DataFrame:
        """Table of the points, voltage rising: ``speed`` [rad/s] and ``voltage`` [V], SI."""
        import polars as pl

        rest = np.zeros(1)
        return pl.DataFrame(
            {
                "speed": np.concatenate((self.minus.speed, rest + self.creep, self.plus.speed)),
                "voltage": np.concatenate((self.minus.voltage, rest, self.plus.voltage)),
            }
        )

    def to_toml(self, path: str | Path) -> None:
        """Write the map for a controller; `from_toml` gives an equal one back.

        Raises
        ------
        FileError
            If the file cannot be written; an older file of that name then stays as it was.
        """
        from swashplate.analysis.compensation_file import dump_map
        from swashplate.tables import write_text

        write_text(dump_map(self), path)

    @classmethod
    def from_toml(cls, path: str | Path) -> InverseMap:
        """A map from a file that `to_toml` wrote.

        Raises
        ------
        FileError
            If the file cannot be read or is not TOML.
        ParameterError
            If an entry is wrong; the sentence names it.
        """
        from swashplate.analysis.compensation_file import load_map

        return load_map(path)

    def write(self, path: str | Path) -> None:
        """Write the map as .toml, or the table of `to_polars` as .csv or .parquet.

        Raises
        ------
        FileError
            For another ending or a place that cannot be written.
        """
        from swashplate.tables import write_table

        suffix = Path(path).suffix.lower()
        if suffix == ".toml":
            self.to_toml(path)
        elif suffix in (".csv", ".parquet", ".pq"):
            write_table(self.to_polars(), path)
        else:
            raise FileError(
                f"{path} ends in '{suffix}'; an inverse map is written as .toml, .csv or .parquet."
            )


def _finite(speed: ArrayLike) -> Array:
    try:
        wanted = np.asarray(speed, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError("The wanted speed must be a number or a sequence of numbers.") from None
    if not np.isfinite(wanted).all():
        raise InputError("The wanted speed must be finite everywhere.")
    return wanted
