"""Manoeuvres from logs: a voltage that was measured, to be commanded again."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt

from swashplate.errors import InputError
from swashplate.logs import TextOptions, read_series
from swashplate.maneuvers.pieces import Array, Maneuver, Piece, interval, positive, row


@dataclass(frozen=True, eq=False)
class _Held:
    """Each of `volts` [V] from its one of `times` [s] until the next."""

    times: Array
    volts: Array

    def __call__(self, time: Array) -> Array:
        return self.volts[interval(self.times, time)]

    def slope(self, time: Array) -> Array:
        return np.zeros_like(time)


@dataclass(frozen=True, eq=False)
class _Joined:
    """Straight lines through `volts` [V] at `times` [s]."""

    times: Array
    volts: Array

    def __call__(self, time: Array) -> Array:
        return np.interp(time, self.times, self.volts)

    def slope(self, time: Array) -> Array:
        # At the last row there is no line that follows: keep to the one before.
        slopes: Array = np.diff(self.volts) / np.diff(self.times)
        return slopes[interval(self.times[:-1], time)]


_CURVES: dict[str, type[_Held | _Joined]] = {"previous": _Held, "linear": _Joined}


def recorded(
    time: npt.ArrayLike,
    voltage: npt.ArrayLike,
    *,
    interpolation: Literal["previous", "linear"],
    length: float | None = None,
) -> Maneuver:
    """Voltage from a log; its first row is at 0 s whatever its time says, its last at the end.

    Parameters
    ----------
    time, voltage : array_like, shape (n,)
        At least two rows; time increases from each to the next. [s], [V]
    interpolation : {"previous", "linear"}
        Between two rows: hold the earlier one, or go straight to the later one.
    length : float, optional
        Where to end instead of at the last row: earlier, or later with its voltage held. A log
        seldom lasts a whole number of samples, which `Maneuver.sample` asks for. [s]

    Raises
    ------
    InputError
        If the rows are not such, or a number is not finite; it names the first row that is wrong.
    """
    if interpolation not in _CURVES:
        raise InputError(f"interpolation must be 'previous' or 'linear', not {interpolation!r}.")
    stamps, volts = row("time", time), row("voltage", voltage)
    if stamps.size != volts.size or stamps.size < 2:
        raise InputError(
            "time and voltage must have the same number of rows, at least two, "
            f"not {stamps.size} and {volts.size}."
        )
    times = stamps - stamps[0]
    late = np.flatnonzero(np.diff(times) <= 0.0) + 1
    if late.size:
        before, after = stamps[late[0] - 1 : late[0] + 1]
        raise InputError(
            f"time must increase, but row {late[0]} (first is 0) has {after} s after {before} s."
        )
    curve = _CURVES[interpolation](times, volts)
    end = float(times[-1]) if length is None else positive("length", length)
    return Maneuver(
        f"recorded {times.size} rows", end, (Piece(0.0, curve),), float(np.abs(volts).max())
    )


def recorded_file(
    path: str | Path,
    *,
    interpolation: Literal["previous", "linear"],
    length: float | None = None,
    column: str = "voltage",
    time_column: str = "time",
    options: TextOptions | None = None,
) -> Maneuver:
    """Voltage from a log's file, of any format that `logs.open_log` reads; see `recorded`.

    Parameters
    ----------
    path : path
        A log; a unit may stand in its header, as in ``voltage [mV]``.
    column, time_column : str
        Names of the columns.
    interpolation, length :
        As in `recorded`.
    options : TextOptions, optional
        How a text file is written, where that cannot be told from it.

    Raises
    ------
    FileError
        If the file cannot be read, a number is missing or time stamps do not increase; it names
        file, column and row.
    InputError
        If a column is missing or its unit wrong, or as in `recorded`.
    """
    time, voltage = read_series(path, column, "V", time_column=time_column, options=options)
    recording = recorded(time, voltage, interpolation=interpolation, length=length)
    return replace(recording, name=Path(path).name)
