"""Logs as channels: Parquet by Polars, TDMS by npTDMS, MDF 4 by asammdf."""

from __future__ import annotations

import logging
import struct
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from swashplate.errors import FileError
from swashplate.logs.log import Array, Column, Log, check_kind, checked, split_unit


def _missing(path: Path, library: str, extra: str) -> FileError:
    """What to say where a library is not installed that this format needs."""
    return FileError(
        f"{path} needs the library {library}, which is not installed: "
        f"pip install 'swashplate[{extra}]'."
    )


# --- Parquet --------------------------------------------------------------------------------------


def open_parquet(path: Path) -> Log:
    """Look into a Parquet file: its columns of numbers, dates and durations.

    Dates and times become seconds since the first of the column, durations seconds.

    Raises
    ------
    FileError
        If it is damaged, of another kind, or has no columns of numbers.
    """
    import polars as pl

    check_kind(path, "Parquet")
    with path.open("rb") as file:
        first = file.read(4)
        size = file.seek(0, 2)
        file.seek(max(size - 8, 0))
        last = file.read(8)
    if first != b"PAR1":
        raise FileError(f"{path} is no Parquet file.")
    if last[4:] != first or int.from_bytes(last[:4], "little") > size - 12:
        raise FileError(f"{path} has no end; it was cut off.")
    schema = pl.read_parquet_schema(path)
    columns, left_out = [], {}
    for column, kind in schema.items():
        if kind.is_numeric() or kind.is_temporal() or kind == pl.Boolean:
            columns.append(Column(column, "s" if kind.is_temporal() else split_unit(column)[1]))
        else:
            left_out[column] = f"it is of the type {kind}"

    def load(positions: Sequence[int], first: int = 0, last: int | None = None) -> list[Array]:
        count = None if last is None else last - first
        # one column after the other: none that is done waits in the form that Polars reads it in
        return [_column(path, columns[position].name, first, count) for position in positions]

    rows = int(pl.scan_parquet(path).select(pl.len()).collect().item())
    lengths = (rows,) * len(columns)
    return checked(Log(path, "Parquet", tuple(columns), load, left_out, lengths))


def _column(path: Path, column: str, first: int, count: int | None) -> Array:
    import polars as pl

    stored = pl.scan_parquet(path).select(column)
    cells = stored.slice(first, count).collect()[column]
    if not cells.dtype.is_temporal():
        return cells.cast(pl.Float64).to_numpy()
    zero = 0
    if cells.dtype == pl.Duration:
        ticks = cells.dt.total_nanoseconds()
    elif cells.dtype == pl.Time:
        ticks = cells.cast(pl.Int64)
    else:
        ticks = cells.cast(pl.Datetime("ns")).dt.epoch("ns")
        begin = stored.drop_nulls().head(1).collect()[column].cast(pl.Datetime("ns"))
        zero = next(iter(begin.dt.epoch("ns")), 0)
    # subtracted as integers: a double of nanoseconds since 1970 would be 256 ns coarse
    seconds = (ticks - zero).cast(pl.Float64) / 1e9
    return np.asarray(seconds.to_numpy(), np.float64)


# --- TDMS -----------------------------------------------------------------------------------------

_LEAD_IN = 28
_BIG_ENDIAN, _RAW = 1 << 6, 1 << 3


class _Source(NamedTuple):
    """Where a column comes from."""

    group: str
    channel: str
    rows: int
    clock: tuple[float, float, int] | None = None
    """Begin [s], increment [s] and number of the samples of a waveform, which has no stamps."""


def open_tdms(path: Path) -> Log:
    """Look into a TDMS file: the channels of numbers and of times, in all groups.

    In a file of several groups, a column is called ``group/channel``. The clock of a waveform, an
    increment among its properties, becomes a column ``time``. Times are seconds since the first.

    Raises
    ------
    FileError
        If it is damaged, of another kind, has no channels of numbers, or npTDMS is not installed.
    """
    check_kind(path, "TDMS")
    stored = _check_segments(path)
    columns: dict[str, tuple[Column, _Source]] = {}
    left_out: dict[str, str] = {}
    with _tdms(path) as file:
        for group in file.groups():
            prefix = f"{group.name}/" if len(file.groups()) > 1 else ""
            clocks: dict[tuple[float, float, int], str] = {}
            for channel in group.channels():
                called, kind = prefix + channel.name, channel.dtype.kind
                if len(channel) == 0 or kind not in "iufbM":
                    held = "complex numbers" if kind == "c" else "text"
                    left_out[called] = f"it holds {held}" if len(channel) else "it is empty"
                    continue
                unit = channel.properties.get("unit_string") or split_unit(channel.name)[1]
                unit = "s" if kind == "M" else unit
                source = _Source(group.name, channel.name, len(channel))
                columns[called] = Column(called, str(unit) if unit else None), source
                step = channel.properties.get("wf_increment")
                begin = channel.properties.get("wf_start_offset", 0.0)
                if isinstance(step, float) and step > 0.0 and isinstance(begin, float):
                    clocks.setdefault((begin, step, len(channel)), channel.name)
            for clock, channel_name in clocks.items():
                called = f"{prefix}time" if len(clocks) == 1 else f"{prefix}{channel_name} time"
                source = _Source(group.name, channel_name, clock[2], clock)
                columns.setdefault(called, (Column(called, "s"), source))
        _check_stored(path, file, stored)
    found, sources = zip(*columns.values(), strict=True) if columns else ((), ())

    def load(positions: Sequence[int], first: int = 0, last: int | None = None) -> list[Array]:
        with _tdms(path) as file:
            return [_channel(path, file, sources[each], first, last) for each in positions]

    lengths = tuple(source.rows for source in sources)
    return checked(Log(path, "TDMS", found, load, left_out, lengths), "channels")


@contextmanager
def _tdms(path: Path) -> Iterator[Any]:
    """npTDMS on a file; an index beside it, which may belong to another, is not used."""
    try:
        import nptdms
        from nptdms.log import log_manager
    except ImportError:
        raise _missing(path, "npTDMS", "tdms") from None
    log_manager.console_handler.setLevel(logging.CRITICAL)
    logger, refusal = logging.getLogger("nptdms"), _Refusal()
    logger.addHandler(refusal)
    try:
        with path.open("rb") as file, nptdms.TdmsFile.open(file) as opened:
            yield opened
    finally:
        logger.removeHandler(refusal)


class _Refusal(logging.Handler):
    """Refuses what npTDMS merely warns of: data that are cut off, and read as far as they go."""

    def emit(self, record: logging.LogRecord) -> None:
        raise ValueError(record.getMessage())


def _check_segments(path: Path) -> int:
    """Follow the segments from one to the next; return the bytes of numbers in them."""
    size = path.stat().st_size
    begin = stored = 0
    with path.open("rb") as file:
        while begin < size:
            file.seek(begin)
            head = file.read(_LEAD_IN)
            if head[:4] != b"TDSm":
                what = f"is damaged at byte {begin}" if begin else "is no TDMS file"
                raise FileError(f"{path} {what}.")
            if len(head) < _LEAD_IN:
                raise FileError(f"{path} was cut off at byte {size}.")
            (contents,) = struct.unpack("<I", head[4:8])
            order = ">" if contents & _BIG_ENDIAN else "<"
            following, raw = struct.unpack(f"{order}QQ", head[12:])
            if begin + _LEAD_IN + following > size:
                raise FileError(f"{path} was cut off: the segment at byte {begin} is not complete.")
            if raw > following:
                raise FileError(f"{path} is damaged at byte {begin + 20}.")
            stored += following - raw if contents & _RAW else 0
            begin += _LEAD_IN + following
    return stored


def _check_stored(path: Path, file: Any, stored: int) -> None:
    """Refuse a file whose channels do not account for all its bytes, and the other way round."""
    channels = [channel for group in file.groups() for channel in group.channels()]
    sizes = [(len(each), getattr(each.data_type, "size", None)) for each in channels]
    counted = sum(length * size for length, size in sizes if size)
    if counted > stored or (all(size for length, size in sizes if length) and counted != stored):
        raise FileError(
            f"{path} has {stored} bytes of numbers where its channels claim {counted}; it was cut "
            "off or is damaged."
        )


def _channel(path: Path, file: Any, source: _Source, first: int, last: int | None) -> Array:
    last = source.rows if last is None else min(last, source.rows)
    if source.clock is not None:
        offset, increment, _ = source.clock
        return offset + increment * np.arange(first, last, dtype=np.float64)
    channel = file[source.group][source.channel]
    numbers = np.asarray(channel.read_data(first, last - first))
    if numbers.dtype.kind == "M":
        numbers = (numbers - channel.read_data(0, 1)[0]) / np.timedelta64(1, "s")
    found: Array = numbers.astype(np.float64, copy=False)
    return _whole(path, source.channel, found, last - first)


def _whole(path: Path, called: str, numbers: Array, claimed: int) -> Array:
    """Refuse a channel with fewer numbers than it claims."""
    if numbers.size != claimed:
        raise FileError(
            f"{path}: '{called}' has {numbers.size} numbers where it claims {claimed}; the file "
            "was cut off or is damaged."
        )
    return numbers


# --- MDF ------------------------------------------------------------------------------------------

_NUMBERS = range(6)  # data types: integers and floats of either byte order
_TEXTS = range(7, 12)  # conversions from and to text
_VARIABLE = (1, 5)  # channels whose samples differ in length
_LEFT_OUT = "it holds text or bytes"


def open_mdf(path: Path) -> Log:
    """Look into an MDF 4 file: the channels of numbers of all groups, and the clock of each group.

    In a file of several groups a column is called ``group/channel``, by the group's acquisition
    name or ``group 0``, ``group 1`` and so on. Samples that the file marks as invalid are NaN.

    Raises
    ------
    FileError
        If it is damaged, not finished, of another kind, has no channels of numbers, or asammdf is
        not installed.
    """
    check_kind(path, "MDF")
    with path.open("rb") as file:
        head = file.read(64)
    if head.startswith(b"UnFinMF "):
        raise FileError(f"{path} was not finished by its logger; let its program finalise it.")
    version = head[8:16].decode("latin-1").strip(" \0")
    if not head.startswith(b"MDF     ") or len(head) < 64:
        raise FileError(f"{path} is no MDF file.")
    if not version.startswith("4"):
        raise FileError(f"{path} is MDF {version!r}; convert it to MDF 4.")
    try:
        import asammdf
    except ImportError:
        raise _missing(path, "asammdf", "mdf") from None
    columns: list[Column] = []
    sources: list[tuple[int, int, int]] = []  # group, channel, rows
    left_out: dict[str, str] = {}
    opened: Callable[[], Any] = partial(asammdf.MDF, path)
    with opened() as mdf:
        for number, (prefix, group) in enumerate(zip(_prefixes(mdf), mdf.groups, strict=True)):
            rows = group.channel_group.cycles_nr
            for place, channel in enumerate(group.channels):
                called, conversion = prefix + channel.name, channel.conversion
                texts = conversion is not None and conversion.conversion_type in _TEXTS
                if channel.data_type not in _NUMBERS or channel.channel_type in _VARIABLE or texts:
                    left_out[called] = _LEFT_OUT
                elif rows == 0:
                    left_out[called] = "it is empty"
                else:
                    unit = channel.unit or getattr(conversion, "unit", "") or None
                    columns.append(Column(called, unit or split_unit(channel.name)[1]))
                    sources.append((number, place, rows))

    def load(positions: Sequence[int], first: int = 0, last: int | None = None) -> list[Array]:
        with opened() as mdf:
            return [
                _samples(path, mdf, columns[each].name, *sources[each], first, last)
                for each in positions
            ]

    lengths = tuple(rows for _, _, rows in sources)
    return checked(Log(path, "MDF 4", tuple(columns), load, left_out, lengths), "channels")


def _prefixes(mdf: Any) -> list[str]:
    names = [group.channel_group.acq_name or "" for group in mdf.groups]
    if len(names) == 1:
        return [""]
    counts = Counter(names)
    return [
        f"{called}/" if called and counts[called] == 1 else f"group {number}/"
        for number, called in enumerate(names)
    ]


def _samples(
    path: Path,
    mdf: Any,
    called: str,
    group: int,
    place: int,
    rows: int,
    first: int,
    last: int | None,
) -> Array:
    count = (rows if last is None else min(last, rows)) - first
    # "ignore" leaves invalid samples where they are; they would be cut out otherwise
    samples, invalid = mdf.get(
        group=group,
        index=place,
        samples_only=True,
        ignore_invalidation_bits=True,
        record_offset=first,
        record_count=count,
    )
    if samples.dtype.kind not in "iufb" or samples.ndim != 1:
        raise FileError(f"{path}: '{called}' cannot be read as numbers: {_LEFT_OUT}.")
    numbers = _whole(path, called, np.array(samples, np.float64), count)
    if invalid is not None:
        numbers[np.asarray(invalid, bool)] = np.nan
    return numbers
