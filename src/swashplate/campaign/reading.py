"""Signals of a log on their clocks, in SI; of a log too long to hold, its windows with motion."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import schema
from swashplate.campaign.experiment import Channel, Encoder, InputSignal, Source
from swashplate.campaign.schema import conversion, inside
from swashplate.errors import FileError, InputError
from swashplate.logs import LONG, Column, Log, check_duration, check_stamps, in_parts, unit_of
from swashplate.units import to_si

Array = NDArray[np.float64]

SINCE_1970 = 1e8
"""Stamps that begin beyond this are seconds of a calendar and are counted from the first. [s]"""
LARGEST = 1e30
"""No signal of a machine has so much of any SI unit."""


class Columns:
    """The wanted columns of one log, read together."""

    def __init__(self, log: Log, wanted: list[tuple[str, str]]) -> None:
        self.log = log
        self.found = self.find(log, wanted)
        self.values = log.read(list(self.found))
        self.stamps: dict[tuple[schema.Clock, int], Array] = {}
        """Stamps by their clock and number, so that signals share them."""
        self.begins = {name: values[:1] for name, values in self.values.items()}
        if log.first:
            self.begins = log.between(0, 1).read(list(self.found))

    @staticmethod
    def find(log: Log, wanted: Iterable[tuple[str, str]]) -> dict[str, Column]:
        """Columns by the names that are wanted, each with what for.

        Raises
        ------
        InputError
            If there is none; the sentence says what for.
        """
        found = {}
        for name, what in wanted:
            try:
                found[name] = log.find(name)
            except InputError as error:
                raise InputError(f"For {what}: {error}") from None
        return found


def wanted_columns(axis: schema.Axis) -> Iterator[tuple[str, str]]:
    """Columns that an axis needs, and what for."""
    signals: dict[str, schema.Signal] = {"the input": axis.input}
    signals |= {f"channel '{name}'": channel for name, channel in axis.channels.items()}
    for what, signal in signals.items():
        yield signal.column, what
        for clock in (signal.time, axis.time):
            if clock is not None and clock.column is not None:
                yield clock.column, f"the time of {what}"


class _Samples(NamedTuple):
    """Samples of a signal that can be used, in SI, and what a signal says of them."""

    unit: str
    time: Array
    values: Array
    source: Source
    factor: float
    """Size of one of the signal's units in SI."""
    limits: tuple[float, float] | None
    dropped: int


def read_input(axis: schema.Axis, columns: Columns, span: schema.Window | None) -> InputSignal:
    """The input of an axis as the campaign file says."""
    read = _samples("the input", axis.input, axis, columns, span)
    assert read is not None  # an input without samples is refused
    held = axis.input.interpolation
    return InputSignal(
        axis.input.kind,
        *read[:3],
        held,
        source=read.source,
        limits=read.limits,
        dropped=read.dropped,
    )


def read_channel(
    name: str, axis: schema.Axis, columns: Columns, span: schema.Window | None
) -> Channel | None:
    """A channel as the campaign file says, all samples alike; None where all of them are missing.

    Of an encoder the counts are as they were read, roll-overs and all.
    """
    entry, encoder = axis.channels[name], None
    read = _samples(f"channel '{name}'", entry, axis, columns, span)
    if read is None:
        return None
    if entry.counts_per_turn is not None:
        encoder = Encoder(entry.counts_per_turn, entry.gear_ratio, entry.sign, entry.rolls_over_at)
    return Channel(
        *(name, entry.kind, *read[:3], np.ones(read.time.size), read.source),
        None if entry.noise is None else read.factor * entry.noise,
        read.limits,
        read.dropped,
        encoder,
        None if encoder is None else read.values,
    )


def _samples(
    what: str,
    signal: schema.Input | schema.Channel,
    axis: schema.Axis,
    columns: Columns,
    span: schema.Window | None,
) -> _Samples | None:
    """Samples of a signal; None for a channel all of whose samples are missing."""
    column, numbers = columns.found[signal.column], columns.values[signal.column]
    said = f"{columns.log.path}: column '{column.name}' ({what})"
    time = stamps_in(signal.time or axis.time, axis.time, columns, numbers.size)
    if time.size != numbers.size:
        raise FileError(f"{said} has {numbers.size} samples, but its time {time.size}.")
    kept = np.ones(numbers.size, dtype=np.bool_) if span is None else inside(span, time)
    for window in signal.ignore if isinstance(signal, schema.Input) else ():
        kept &= ~inside(window, time)
    missing = kept & ~np.isfinite(numbers)
    if missing.any() and signal.missing == "refuse":
        rows = np.flatnonzero(missing) + 1 + columns.log.first
        others = f" and {rows.size - 1} others" if rows.size > 1 else ""
        raise FileError(
            f"{said} has no finite number in data row {rows[0]}{others}; mend the log, or say "
            "missing = 'drop' to leave such samples out."
        )
    if isinstance(signal, schema.Channel) and missing.any() and missing.sum() == kept.sum():
        return None
    kept &= ~missing
    if np.count_nonzero(kept) < 2:
        raise FileError(
            f"{said} has {np.count_nonzero(kept)} samples that can be used, but needs two at least."
        )
    first = schema.KINDS[signal.kind].units[:1] or ("1",)
    unit = signal.unit or unit_of(column, signal.column, first[0])
    si, factor, zero = conversion(signal.kind, unit, said)
    # an encoder's sign belongs to the scale of its counts, see `Encoder`
    sign = 1 if signal.kind == "encoder_counts" else signal.sign
    with np.errstate(over="ignore"):
        values = factor * sign * (signal.scale * numbers[kept] + signal.offset) + zero
        largest = float(np.max(np.abs(values)))
    if not largest < LARGEST:
        raise InputError(f"{said} reaches {largest:.3g} {si}; check its unit, scale and offset.")
    limits = signal.limits
    return _Samples(
        si,
        time if kept.all() else np.ascontiguousarray(time[kept]),
        values,
        Source(columns.log.path, column.name),
        factor,
        None if limits is None else (factor * limits[0] + zero, factor * limits[1] + zero),
        int(np.count_nonzero(missing)),
    )


def stamps_in(clock: schema.Clock, main: schema.Clock, columns: Columns, size: int) -> Array:
    """Increasing time stamps of a signal; those of a calendar from the axis's first one on. [s]"""
    if (clock, size) not in columns.stamps:
        columns.stamps[clock, size] = _stamps(clock, main, columns, size)
    return columns.stamps[clock, size]


def _stamps(clock: schema.Clock, main: schema.Clock, columns: Columns, size: int) -> Array:
    with np.errstate(over="ignore"):
        if clock.rate is not None:
            time = clock.offset + (columns.log.first + np.arange(size)) / clock.rate
            return check_duration(columns.log, "the rate", time)
        numbers, factor = _clock(clock, columns)
        name = columns.found[clock.column or ""].name
        check_stamps(columns.log, name, numbers)
        of_main = _clock(main, columns)[1] if main.column is not None else factor
        begin = of_main * float(columns.begins[main.column or clock.column or ""][0])
        # the difference first: a float64 keeps a thousandth of a millisecond of a calendar's stamp
        since = numbers if begin < SINCE_1970 else numbers - begin / factor
        return check_duration(columns.log, f"column '{name}'", factor * since + clock.offset)


def _clock(clock: schema.Clock, columns: Columns) -> tuple[Array, float]:
    """Numbers of a column of time, and the size of their unit [s]."""
    assert clock.column is not None  # the schema sees to a column or a rate
    column, numbers = columns.found[clock.column], columns.values[clock.column]
    unit = clock.unit or unit_of(column, clock.column, "s")
    factor = to_si(1.0, unit, "s", f"{columns.log.path}: column '{column.name}' (the time)")
    return numbers, factor


# --- long logs ------------------------------------------------------------------------------------

BLOCK = 250_000
"""Rows that are looked at together."""
GRAIN = 256
"""Rows of which the largest and the smallest input are kept."""
MOVES = 0.02
"""Share of its largest excursion from rest beyond which an input moves."""
BEFORE, AFTER = 2.0, 5.0
"""What belongs to a window with motion before the input moves and after it has stopped. [s]"""
HELD = 120_000
"""Rows of one log that a campaign takes at most, more than the 110,605 of Kruse's thirteen tests of
the hoist: a fit of three channels takes about 1.6 kB of memory for each."""
PIECE = 60_000
"""A longer motion is cut into pieces of so many rows, of which the later ones begin in motion."""


def windows(axes: Iterable[schema.Axis], log: Log, span: schema.Window | None) -> list[Log]:
    """The log itself or, of one of more rows than `LONG`, its windows in which an input moves.

    Within the span of the run, if it has one. The log is looked through once, block after block,
    its stamps checked. A window takes in 2 s of rest before and 5 s after the motion; if all
    together have more rows than `HELD`, one in several is taken, evenly over the log.

    Raises
    ------
    FileError, InputError
        As `read_signal`; or if no input ever moves.
    """
    tested = list(axes)
    wanted = [each for axis in tested for each in wanted_columns(axis)]
    found = list(Columns.find(log, wanted))
    log = in_parts(log, found)
    rows = log.rows_of(found)
    if rows is None or rows <= LONG:
        return [log]
    moving = np.zeros(-(-rows // GRAIN), dtype=np.bool_)
    period = np.inf
    for axis in tested:
        inputs = [each for each in wanted_columns(axis) if each[1] == "the input"]
        inputs += [each for each in wanted_columns(axis) if each[1] == "the time of the input"]
        ends = np.empty((moving.size, 2))
        for begin in range(0, rows, BLOCK // GRAIN * GRAIN):
            last = min(begin + BLOCK // GRAIN * GRAIN, rows)
            # with the row before, so that stamps are compared across blocks
            block = Columns(log.between(max(begin - 1, 0), last), inputs)
            values = block.values[axis.input.column]
            time = stamps_in(axis.input.time or axis.time, axis.time, block, values.size)
            period = min(period, float(np.median(np.diff(time[:BLOCK]))))
            values = values[1:] if begin else values
            edges = np.arange(0, values.size, GRAIN)
            part = slice(begin // GRAIN, begin // GRAIN + edges.size)
            ends[part, 0] = np.fmin.reduceat(values, edges)
            ends[part, 1] = np.fmax.reduceat(values, edges)
            if span is not None:
                ends[part][~inside(span, time[-values.size :][edges])] = np.nan
        moving |= _moves(ends)
    if not moving.any():
        raise InputError(
            f"{log.path} has {rows} rows, in none of which the input moves: leave the run out with "
            'role = "ignore".'
        )
    return _cut(log, rows, moving, period)


def _moves(ends: Array) -> NDArray[np.bool_]:
    """Whether an input leaves its rest, where it is most often, by its extremes in each grain."""
    middle = 0.5 * (ends[:, 0] + ends[:, 1])
    known = middle[np.isfinite(middle)]
    if not known.size or known.min() == known.max():
        return np.zeros(middle.size, dtype=np.bool_)
    counts, edges = np.histogram(known, 64)
    most = int(counts.argmax())
    rest = np.median(known[(known >= edges[most]) & (known <= edges[most + 1])])
    away = np.max(np.abs(ends - rest), axis=1)
    moves: NDArray[np.bool_] = np.nan_to_num(away) > MOVES * np.nanmax(away)
    return moves


def _cut(log: Log, rows: int, moving: NDArray[np.bool_], period: float) -> list[Log]:
    """Parts of a log about its motion, so many that all can be held."""
    changes = np.flatnonzero(np.diff(np.concatenate([[False], moving, [False]])))
    first = np.maximum(changes[::2] * GRAIN - round(BEFORE / period), 0)
    last = np.minimum(changes[1::2] * GRAIN + round(AFTER / period), rows)
    apart = np.flatnonzero(first[1:] > last[:-1])
    begins, ends = first[[0, *(apart + 1)]], last[[*apart, last.size - 1]]
    pieces = [
        (int(place), int(min(place + PIECE, end)), place > begin)
        for begin, end in zip(begins, ends, strict=True)
        for place in range(begin, end, PIECE)
    ]
    every = 1
    while sum(end - begin for begin, end, _ in pieces[::every]) > HELD and every < len(pieces):
        every += 1
    taken = pieces[::every]
    said = f"the log has {len(pieces)} windows with motion"
    said += f", of which 1 in {every} is taken" * (every > 1)
    if log.table is not None:
        said += f"; its {rows} rows are read from {log.table.name}, written beside it"
    found = []
    for number, (begin, end, within) in enumerate(taken, 1):
        part = log.between(begin, end)
        cut = f"window {number} of {len(taken)}: {part.cut}"
        found.append(replace(part, cut=f"{cut}; {said}" if number == 1 else cut, resumes=within))
    return found
