"""Logs as ASAM MDF files of version 4."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from swashplate.errors import FileError
from swashplate.logs.damage import (
    MDF,
    UNFINISHED_MDF,
    Reading,
    check_any,
    check_kind,
    left_out_notes,
    missing_extra,
)
from swashplate.logs.log import Array, Column, Log, split_unit
from swashplate.logs.text import TextOptions

name = "MDF"
suffixes = (".mf4", ".mdf")

_NUMBERS = range(6)  # data types: integers and floats of either byte order
_TEXTS = range(7, 12)  # conversions from and to text
_VARIABLE = (1, 5)  # channels whose samples differ in length
_LEFT_OUT = "it holds text or bytes"


class _Source(NamedTuple):
    """Where a column is."""

    group: int
    channel: int
    rows: int


def open(path: Path, options: TextOptions) -> Log:
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
    _check_version(path)
    columns: list[Column] = []
    sources: list[_Source] = []
    left_out: dict[str, str] = {}
    with _reading(path), _opened(path) as file:
        for number, (prefix, group) in enumerate(zip(_prefixes(file), file.groups, strict=True)):
            block = group.channel_group
            rows = block.cycles_nr
            for place, channel in enumerate(group.channels):
                called = prefix + channel.name
                reason = _why_not(channel, rows)
                if reason is not None:
                    left_out[called] = reason
                    continue
                unit = channel.unit or getattr(channel.conversion, "unit", "") or None
                columns.append(Column(called, unit or split_unit(channel.name)[1]))
                sources.append(_Source(number, place, rows))
        comments = (f"start: {file.header.start_time.isoformat()}",)
    check_any(path, columns, "channels", left_out)
    notes = left_out_notes(left_out)

    def load(positions: Sequence[int]) -> list[Array]:
        with _reading(path), _opened(path) as file:
            return [
                _numbers(path, file, columns[position].name, sources[position])
                for position in positions
            ]

    return Log(path, "MDF 4", tuple(columns), load, comments, notes, left_out)


def _check_version(path: Path) -> None:
    with path.open("rb") as file:
        head = file.read(64)
    if head.startswith(UNFINISHED_MDF):
        raise FileError(f"{path} was not finished by its logger; let its program finalise it.")
    version = head[8:16].decode("latin-1").strip(" \0")
    if not head.startswith(MDF) or len(head) < 64:
        raise FileError(f"{path} is no MDF file.")
    if not version.startswith("4"):
        raise FileError(f"{path} is MDF {version!r}; convert it to MDF 4.")


def _reading(path: Path) -> Reading:
    try:
        from asammdf.blocks.utils import MdfException
    except ImportError:
        raise missing_extra(path, "asammdf", "mdf") from None
    return Reading(path, "MDF", (MdfException,))


def _opened(path: Path) -> Any:
    import asammdf

    return asammdf.MDF(path)


def _prefixes(file: Any) -> list[str]:
    names = [group.channel_group.acq_name or "" for group in file.groups]
    if len(names) == 1:
        return [""]
    counts = Counter(names)
    return [
        f"{called}/" if called and counts[called] == 1 else f"group {number}/"
        for number, called in enumerate(names)
    ]


def _why_not(channel: Any, rows: int) -> str | None:
    if rows == 0:
        return "it is empty"
    if channel.data_type not in _NUMBERS or channel.channel_type in _VARIABLE:
        return _LEFT_OUT
    conversion = channel.conversion
    if conversion is not None and conversion.conversion_type in _TEXTS:
        return _LEFT_OUT
    return None


def _numbers(path: Path, file: Any, called: str, source: _Source) -> Array:
    # "ignore" leaves invalid samples where they are; they would be cut out otherwise
    samples, invalid = file.get(
        group=source.group, index=source.channel, samples_only=True, ignore_invalidation_bits=True
    )
    if samples.dtype.kind not in "iufb" or samples.ndim != 1:
        raise FileError(f"{path}: '{called}' cannot be read as numbers: {_LEFT_OUT}.")
    if samples.size != source.rows:
        raise FileError(
            f"{path}: '{called}' has {samples.size} of {source.rows} numbers; the file was cut "
            "off or is damaged."
        )
    numbers = np.array(samples, np.float64)
    if invalid is not None:
        numbers[np.asarray(invalid, bool)] = np.nan
    return numbers
