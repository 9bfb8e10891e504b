"""Logs as National Instruments' TDMS files."""

from __future__ import annotations

import logging
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from swashplate.errors import FileError
from swashplate.logs.damage import (
    TDMS,
    Reading,
    check_any,
    check_kind,
    left_out_notes,
    missing_extra,
)
from swashplate.logs.log import Array, Column, Log, split_unit
from swashplate.logs.text import TextOptions

name = "TDMS"
suffixes = (".tdms",)

_LEAD_IN = 28
_BIG_ENDIAN, _RAW = 1 << 6, 1 << 3
_KEPT = 500  # letters of a property that are kept as a comment


class _Source(NamedTuple):
    """Where a column comes from."""

    group: str
    channel: str
    clock: tuple[float, float, int] | None = None
    """Begin [s], increment [s] and number of the samples of a waveform, which has no stamps."""


def open(path: Path, options: TextOptions) -> Log:
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
    with Reading(path, "TDMS"), _opened(path) as file:
        groups = file.groups()
        columns: dict[str, tuple[Column, _Source]] = {}
        left_out: dict[str, str] = {}
        for group in groups:
            prefix = f"{group.name}/" if len(groups) > 1 else ""
            clocks: dict[tuple[float, float, int], str] = {}
            for channel in group.channels():
                called = prefix + channel.name
                reason = _why_not(channel)
                if reason is not None:
                    left_out[called] = reason
                    continue
                unit = channel.properties.get("unit_string") or split_unit(channel.name)[1]
                unit = "s" if channel.dtype.kind == "M" else unit
                source = _Source(group.name, channel.name)
                columns[called] = Column(called, str(unit) if unit else None), source
                clock = _clock(channel)
                if clock is not None:
                    clocks.setdefault(clock, channel.name)
            for clock, channel_name in clocks.items():
                called = f"{prefix}time" if len(clocks) == 1 else f"{prefix}{channel_name} time"
                source = _Source(group.name, channel_name, clock)
                columns.setdefault(called, (Column(called, "s"), source))
        _check_stored(path, file, stored)
        comments = tuple(
            f"{key}: {value}" for key, value in file.properties.items() if len(str(value)) <= _KEPT
        )
    check_any(path, columns, "channels", left_out)
    sources = [source for _, source in columns.values()]
    notes = [
        f"'{column.name}' is computed from the increment of a waveform."
        for column, source in columns.values()
        if source.clock
    ]
    notes += left_out_notes(left_out)

    def load(positions: Sequence[int]) -> list[Array]:
        with Reading(path, "TDMS"), _opened(path) as file:
            return [_numbers(path, file, sources[position]) for position in positions]

    found = tuple(column for column, _ in columns.values())
    return Log(path, "TDMS", found, load, comments, tuple(notes), left_out)


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """npTDMS on a file; an index beside it, which may belong to another, is not used."""
    try:
        import nptdms
        from nptdms.log import log_manager
    except ImportError:
        raise missing_extra(path, "npTDMS", "tdms") from None
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
            if head[:4] != TDMS:
                what = f"is damaged at byte {begin}" if begin else "is no TDMS file"
                raise FileError(f"{path} {what}.")
            if len(head) < _LEAD_IN:
                raise FileError(f"{path} was cut off at byte {size}.")
            (contents,) = struct.unpack("<I", head[4:8])
            order = ">" if contents & _BIG_ENDIAN else "<"
            following, raw = struct.unpack(f"{order}QQ", head[12:])
            end = begin + _LEAD_IN + following
            if end > size:
                raise FileError(f"{path} was cut off: the segment at byte {begin} is not complete.")
            if raw > following:
                raise FileError(f"{path} is damaged at byte {begin + 20}.")
            stored += following - raw if contents & _RAW else 0
            begin = end
    return stored


def _check_stored(path: Path, file: Any, stored: int) -> None:
    """Refuse a file whose channels do not account for all its bytes, and the other way round."""
    channels = [channel for group in file.groups() for channel in group.channels()]
    sizes = [getattr(channel.data_type, "size", None) for channel in channels]
    counted = sum(
        len(channel) * size for channel, size in zip(channels, sizes, strict=True) if size
    )
    whole = all(size for size, channel in zip(sizes, channels, strict=True) if len(channel))
    if counted > stored or (whole and counted != stored):
        raise FileError(
            f"{path} has {stored} bytes of numbers where its channels claim {counted}; it was cut "
            "off or is damaged."
        )


def _why_not(channel: Any) -> str | None:
    if len(channel) == 0:
        return "it is empty"
    if channel.dtype.kind == "c":
        return "it holds complex numbers"
    return None if channel.dtype.kind in "iufbM" else "it holds text"


def _clock(channel: Any) -> tuple[float, float, int] | None:
    increment = channel.properties.get("wf_increment")
    offset = channel.properties.get("wf_start_offset", 0.0)
    if not isinstance(increment, float) or not increment > 0.0 or not isinstance(offset, float):
        return None
    return offset, increment, len(channel)


def _numbers(path: Path, file: Any, source: _Source) -> Array:
    if source.clock is not None:
        offset, increment, count = source.clock
        return offset + increment * np.arange(count, dtype=np.float64)
    channel = file[source.group][source.channel]
    pieces = []
    first = None
    for chunk in channel.data_chunks():
        numbers = np.asarray(chunk[:])
        if numbers.dtype.kind == "M":
            first = numbers[0] if first is None else first
            numbers = (numbers - first) / np.timedelta64(1, "s")
        pieces.append(numbers.astype(np.float64, copy=False))
    found: Array = np.concatenate(pieces) if pieces else np.empty(0)
    if found.size != len(channel):
        raise FileError(
            f"{path}: '{source.channel}' has {found.size} numbers where it claims {len(channel)}; "
            "the file was cut off or is damaged."
        )
    return found
