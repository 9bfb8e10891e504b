"""Signals of a log in SI, on their time stamps: what a campaign file says, applied."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import schema
from swashplate.campaign.experiment import Source
from swashplate.campaign.kinds import KINDS, si_unit
from swashplate.campaign.weighting import inside
from swashplate.errors import FileError, InputError
from swashplate.logs import Column, Log, check_stamps, unit_of
from swashplate.units import to_si

Array = NDArray[np.float64]


class Columns:
    """The wanted columns of one log, read together."""

    def __init__(self, log: Log, wanted: list[tuple[str, str]]) -> None:
        self.log = log
        self.found: dict[str, Column] = {}
        for name, what in wanted:
            try:
                self.found[name] = log.find(name)
            except InputError as error:
                raise InputError(f"For {what}: {error}") from None
        self.values = log.read(list(self.found))

    def __getitem__(self, name: str) -> tuple[Column, Array]:
        return self.found[name], self.values[name]


def named(axis: schema.Axis) -> Iterator[tuple[str, str]]:
    """Columns that an axis needs, and what for."""
    signals: dict[str, schema.Signal] = {"the input": axis.input}
    signals |= {f"channel '{name}'": channel for name, channel in axis.channels.items()}
    for what, signal in signals.items():
        yield signal.column, what
        clock = signal.time or axis.time
        if clock.column is not None:
            yield clock.column, f"the time of {what}"


@dataclass(frozen=True)
class LogSignal:
    """A signal out of the log, in SI, on its stamps."""

    unit: str
    time: Array
    values: Array
    source: Source
    factor: float
    """Size of one of the signal's units in SI."""
    limits: tuple[float, float] | None
    dropped: int


def read_signal(
    what: str,
    signal: schema.Input | schema.Channel,
    axis: schema.Axis,
    columns: Columns,
    span: schema.Window | None,
) -> LogSignal:
    """A signal as the campaign file says it is to be read.

    Parameters
    ----------
    what : str
        The signal, for sentences: ``channel 'speed'``.
    signal, axis :
        Its entry and that of its axis.
    columns : Columns
        The log's.
    span : schema.Window or None
        The part of the log to take.

    Raises
    ------
    FileError
        If a sample is missing and may not be, or fewer than two are left.
    InputError
        If the unit is unknown or measures something else.
    """
    column, numbers = columns[signal.column]
    said = f"{columns.log.path}: column '{column.name}' ({what})"
    time = _stamps(signal.time or axis.time, columns, numbers.size)
    if time.size != numbers.size:
        raise FileError(f"{said} has {numbers.size} samples, but its time {time.size}.")
    kept = np.ones(numbers.size, dtype=np.bool_) if span is None else inside(span, time)
    missing = kept & ~np.isfinite(numbers)
    if missing.any() and signal.missing == "refuse":
        rows = np.flatnonzero(missing) + 1
        others = f" and {rows.size - 1} others" if rows.size > 1 else ""
        raise FileError(
            f"{said} has no finite number in data row {rows[0]}{others}; mend the log, or say "
            "missing = 'drop' to leave such samples out."
        )
    kept &= ~missing
    if np.count_nonzero(kept) < 2:
        raise FileError(
            f"{said} has {np.count_nonzero(kept)} samples that can be used, but needs two at least."
        )
    first = KINDS[signal.kind].units[0] if KINDS[signal.kind].units else "1"
    unit = signal.unit or unit_of(column, signal.column, first)
    si = si_unit(signal.kind, unit, said)
    factor, zero = 1.0, 0.0
    if signal.kind not in ("encoder_counts", "other"):
        zero = to_si(0.0, unit, si, said)
        factor = to_si(1.0, unit, si, said) - zero
    # an encoder's sign belongs to the scale of its counts, see `Encoder`
    sign = 1 if signal.kind == "encoder_counts" else signal.sign
    written = sign * (signal.scale * numbers[kept] + signal.offset)
    limits = signal.limits
    return LogSignal(
        si,
        np.ascontiguousarray(time[kept]),
        factor * written + zero,
        Source(columns.log.path, column.name),
        factor,
        None if limits is None else (factor * limits[0] + zero, factor * limits[1] + zero),
        int(np.count_nonzero(missing)),
    )


def _stamps(clock: schema.Clock, columns: Columns, size: int) -> Array:
    """Increasing time stamps of a signal. [s]"""
    if clock.rate is not None:
        return clock.offset + np.arange(size) / clock.rate
    assert clock.column is not None  # the schema sees to one of the two
    column, numbers = columns[clock.column]
    unit = clock.unit or unit_of(column, clock.column, "s")
    factor = to_si(1.0, unit, "s", f"{columns.log.path}: column '{column.name}' (the time)")
    check_stamps(columns.log, column.name, numbers)
    return factor * numbers + clock.offset
