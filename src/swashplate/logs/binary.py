"""Logs in binary formats: thin layers over Polars, SciPy, h5py, npTDMS and asammdf.

A format is a row of `FORMATS`: how a file is opened, what it holds, how a column is read. What a
library reads from a damaged file without a word is refused here: variables, blocks and channels
that were cut off. All of it runs in a process of its own, see `swashplate.logs.apart`.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from math import ceil, prod
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from swashplate.errors import FileError
from swashplate.logs.log import Array, Column, Log, check_kind, printable, said, split_unit


class _Item(NamedTuple):
    """Something that a file holds: a column of a log, or the reason why it is none."""

    name: str
    reason: str = ""
    unit: str | None = None
    rows: int = 0
    key: Any = None
    """Where it is in the file."""


class _Format(NamedTuple):
    """How files of a format are read."""

    opened: Callable[[Path], AbstractContextManager[Any]]
    items: Callable[[Any], Iterator[_Item]]
    """What an opened file holds."""
    column: Callable[[Any, Any, int, int | None], Any]
    """Numbers of an opened file by a key, from a row to before a last one (None: to the end)."""
    what: str = "columns"


def look(reader: str, path: Path) -> Log:
    """Look into a file as one of the formats of `swashplate.logs.log.ENDINGS` but text.

    Raises
    ------
    FileError
        If it is of another kind, has no columns of numbers, or needs a library that is not
        installed. Of a damaged file whatever its library raises.
    """
    form = _form_of(reader, path)
    opened, items_of, column, what = FORMATS[form]
    with opened(path) as file:
        items = list(items_of(file))
    kept = [each for each in items if not each.reason]
    left_out = {each.name: each.reason for each in items if each.reason}
    if not kept:
        why = "".join(f"; '{each}': {reason}" for each, reason in left_out.items())[:300]
        raise FileError(f"{path} has no {what} of numbers{printable(why)}.")

    def load(positions: Sequence[int], first: int = 0, last: int | None = None) -> list[Array]:
        arrays = []
        with opened(path) as file:
            for item in (kept[position] for position in positions):
                numbers = np.asarray(column(file, item.key, first, last), np.float64).ravel()
                claimed = len(range(item.rows)[first:last])
                if numbers.size != claimed:
                    raise FileError(
                        f"{path}: '{item.name}' has {numbers.size} numbers where it claims "
                        f"{claimed}; the file was cut off or is damaged."
                    )
                arrays.append(numbers)
        return arrays

    columns = tuple(Column(each.name, each.unit) for each in kept)
    return Log(path, form, columns, load, left_out, tuple(each.rows for each in kept))


_LARGEST = 256 << 20
"""A file of MATLAB 4 or 5 is read as a whole; a larger one is refused. [byte]"""


def _form_of(reader: str, path: Path) -> str:
    """The row of `FORMATS` by the first bytes of a file; another kind of file is refused."""
    check_kind(path, reader, *["HDF5"] * (reader == "MATLAB"))
    with path.open("rb") as file:
        head, size = file.read(2056), file.seek(0, 2)
    if reader == "MDF":
        version = head[8:16].decode("latin-1").strip(" \0")
        why = "" if version.startswith("4") else f"is MDF {version!r}; convert it to MDF 4"
        if not head.startswith(b"MDF     ") or len(head) < 64:
            why = "is no MDF file"
        if head.startswith(b"UnFinMF "):
            why = "was not finished by its logger; let its program finalise it"
        if why:
            raise FileError(f"{path} {why}.")
        return "MDF 4"
    if reader != "MATLAB":
        return reader
    # HDF5 begins at 0 or, behind MATLAB's own header, at a power of two
    if any(head[place:].startswith(b"\x89HDF\r\n\x1a\n") for place in (0, 512, 1024, 2048)):
        return "MATLAB 7.3"
    if size > _LARGEST:
        raise FileError(
            f"{path} has {size >> 20} MB, and MATLAB files up to version 7 are read as a whole, up "
            f"to {_LARGEST >> 20} MB: save it with -v7.3, or as CSV."
        )
    return "MATLAB 5" if head[126:128] in (b"IM", b"MI") else "MATLAB 4"


def _missing(path: Path, library: str, extra: str) -> FileError:
    """What to say where a library is not installed that this format needs."""
    return FileError(
        f"{path} needs the library {library}, which is not installed: "
        f"pip install 'swashplate[{extra}]'."
    )


# --- Parquet --------------------------------------------------------------------------------------


def _parquet(path: Path) -> AbstractContextManager[Any]:
    import polars as pl

    return nullcontext(pl.scan_parquet(path))


def _parquet_items(stored: Any) -> Iterator[_Item]:
    import polars as pl

    rows = int(stored.select(pl.len()).collect().item())
    for name, kind in stored.collect_schema().items():
        unit = "s" if kind.is_temporal() else split_unit(name)[1]
        numbers = kind.is_numeric() or kind.is_temporal() or kind == pl.Boolean
        yield _Item(name, "" if numbers else f"it is of the type {kind}", unit, rows, name)


def _parquet_column(stored: Any, name: str, first: int, last: int | None) -> Any:
    """Numbers; dates and times as seconds since the first of the column, durations as seconds."""
    import polars as pl

    stored = stored.select(name)
    cells = stored.slice(first, None if last is None else last - first).collect()[name]
    if not cells.dtype.is_temporal():
        return cells.cast(pl.Float64).to_numpy()
    zero = 0
    if cells.dtype == pl.Duration:
        ticks = cells.dt.total_nanoseconds()
    elif cells.dtype == pl.Time:
        ticks = cells.cast(pl.Int64)
    else:
        ticks = cells.cast(pl.Datetime("ns")).dt.epoch("ns")
        begin = stored.drop_nulls().head(1).collect()[name].cast(pl.Datetime("ns"))
        zero = next(iter(begin.dt.epoch("ns")), 0)
    # subtracted as integers: a double of nanoseconds since 1970 would be 256 ns coarse
    return ((ticks - zero).cast(pl.Float64) / 1e9).to_numpy()


# --- arrays: MATLAB and HDF5 ----------------------------------------------------------------------

_MOST = 4096  # signals in one matrix; one with more of both rows and columns is a picture or a map
_KINDS = {"c": "it holds complex numbers", "S": "it holds text", "U": "it holds text"}
_UNITS = ("unit", "units", "Unit", "Units", "UNIT", "UNITS")
_OBJECTS = 100_000  # in one file


def _signals(
    name: str, array: str, shape: tuple[int, ...], kind: str, units: Sequence[str], form: str
) -> Iterator[_Item]:
    """Vectors of an array of a shape in its own language's order; the longer dimension is time.

    Their keys are the array's place, the dimension along which a vector is chosen, None of an array
    that is one, and its number along it. `form` is ``"({})"`` of MATLAB, ``"[{}]"`` of HDF5.
    """
    reason = "" if kind in "iufb" else _KINDS.get(kind, "it is no array of numbers")
    reason = reason or ("it is empty" if 0 in shape else "")
    if not reason and len(shape) > 2:
        reason = f"it has {len(shape)} dimensions"
    axis, count = None, 1
    if len(shape) == 2 and 1 not in shape:
        axis, count = (1, shape[1]) if shape[0] >= shape[1] else (0, shape[0])
        if count > _MOST and not reason:
            reason = f"it is a matrix of {shape[0]} by {shape[1]}"
    if reason:
        yield _Item(name, reason)
        return
    given = list(units) if len(units) == count else [*units[:1], split_unit(name)[1]][:1] * count
    first = int(form[0] == "(")  # MATLAB counts from 1
    for i in range(count):
        place = "" if axis is None else form.format(("{},:", ":,{}")[axis].format(i + first))
        yield _Item(name + place, "", given[i], max(shape, default=1), (array, axis, i))


@contextmanager
def _matlab(path: Path) -> Iterator[Any]:
    """Arrays by the names of the variables and, of structures, of their fields."""
    from scipy.io import loadmat

    def of(called: str, value: Any) -> Iterator[tuple[str, Any]]:
        if isinstance(value, dict):
            for field, inner in value.items():
                yield from of(f"{called}.{printable(field)}", inner)
        else:
            yield called, np.asarray(value)

    variables = loadmat(path, appendmat=False, simplify_cells=True).items()
    named = (each for each in variables if not each[0].startswith("__"))
    yield dict(pair for name, content in named for pair in of(printable(name), content))


def _matlab_items(arrays: Mapping[str, Any]) -> Iterator[_Item]:
    for name, value in arrays.items():
        yield from _signals(name, name, value.shape, value.dtype.kind, (), "({})")


def _matlab_column(arrays: Mapping[str, Any], key: Any, first: int, last: int | None) -> Any:
    name, axis, number = key
    vector = arrays[name] if axis is None else np.take(arrays[name], number, axis=axis)
    return np.ravel(vector)[first:last]


@contextmanager
def _hdf5(path: Path) -> Iterator[Any]:
    import h5py

    with h5py.File(path, "r", locking=False) as file:
        yield file


def _datasets(file: Any) -> Iterator[Any]:
    """All datasets, each once; neither soft nor external links are followed."""
    import h5py

    names: list[str] = []
    file.visit(names.append)
    if len(names) > _OBJECTS:
        raise ValueError(f"it has {len(names)} objects, more than the {_OBJECTS} that are read")
    found = map(file.get, names)
    yield from (each for each in found if isinstance(each, h5py.Dataset))


def _hdf5_signals(name: str, dataset: Any, form: str) -> Iterator[_Item]:
    reason = "" if dataset.shape else "it is a single value"
    try:
        if dataset.is_virtual or dataset.external:
            reason = reason or "its numbers are in other files"
        given: Any = next((dataset.attrs[key] for key in _UNITS if key in dataset.attrs), [])
        units = [_text(each) for each in np.ravel(given).tolist()]
        shape = dataset.shape[::-1] if form == "({})" else dataset.shape
        found = list(_signals(name, dataset.name, shape, dataset.dtype.kind, units, form))
        yield from [_Item(name, reason)] if reason else found
    except (TypeError, ValueError) as error:  # a type that NumPy does not have
        yield _Item(name, said(error))


def _hdf5_items(file: Any) -> Iterator[_Item]:
    for dataset in _datasets(file):
        yield from _hdf5_signals(f"/{dataset.name.lstrip('/')}", dataset, "[{}]")


def _matlab73_items(file: Any) -> Iterator[_Item]:
    """Of MATLAB 7.3, whose dimensions are stored the other way round."""
    for dataset in _datasets(file):
        name = dataset.name.strip("/").replace("/", ".")
        kind = _text(dataset.attrs.get("MATLAB_class", "double"))
        numbers = kind in ("single", "logical", "double") or kind.lstrip("u").startswith("int")
        if name.startswith("#"):
            continue  # what cells and objects refer to
        if "MATLAB_object_decode" in dataset.attrs or not numbers:
            yield _Item(name, f"it is a MATLAB {kind}")
        elif dataset.attrs.get("MATLAB_empty", 0):
            yield _Item(name, "it is empty")
        else:
            for each in _hdf5_signals(name, dataset, "({})"):
                if each.key and each.key[1] is not None:
                    array, axis, number = each.key
                    each = each._replace(key=(array, 1 - axis, number))
                yield each


def _text(value: object) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def _hdf5_column(file: Any, key: Any, first: int, last: int | None) -> Any:
    array, axis, number = key
    dataset, rows = file[array], slice(first, last)
    # HDF5 would give zeros for numbers that are claimed but were never stored
    if dataset.id.get_storage_size() == 0:
        raise ValueError(
            f"'{dataset.name}' claims {prod(dataset.shape)} numbers, but none is stored"
        )
    if dataset.chunks is not None:
        sides = zip(dataset.shape, dataset.chunks, strict=True)
        expected, count = (
            prod(ceil(size / side) for size, side in sides),
            dataset.id.get_num_chunks(),
        )
        if count != expected:
            raise ValueError(
                f"'{dataset.name}' has only {count} of its {expected} blocks, the others were "
                "never written"
            )
    if axis is not None:
        return dataset[(rows, number) if axis else (number, rows)]
    # a vector of n by 1 or 1 by n
    return dataset[
        tuple(rows if size > 1 else 0 for size in dataset.shape) if dataset.size > 1 else ...
    ]


# --- TDMS -----------------------------------------------------------------------------------------


class _Refusal(logging.Handler):
    """Refuses what npTDMS merely warns of: data that are cut off, and read as far as they go."""

    def emit(self, record: logging.LogRecord) -> None:
        raise ValueError(record.getMessage().partition(", will")[0])


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


def _tdms_items(file: Any) -> Iterator[_Item]:
    """Channels and, of waveforms, whose properties hold an increment, a column ``time``.

    In a file of several groups, a column is called ``group/channel``.
    """
    for group in file.groups():
        prefix = f"{group.name}/" if len(file.groups()) > 1 else ""
        clocks, names = dict[tuple[float, float, int], str](), set[str]()
        for channel in group.channels():
            kind, rows, given = channel.dtype.kind, len(channel), channel.properties
            names.add(channel.name)
            if rows == 0 or kind not in "iufbM":
                yield _Item(
                    prefix + channel.name, _KINDS.get(kind, _KINDS["S"]) if rows else "it is empty"
                )
                continue
            unit = "s" if kind == "M" else given.get("unit_string") or split_unit(channel.name)[1]
            key = group.name, channel.name, None
            yield _Item(prefix + channel.name, "", str(unit) if unit else None, rows, key)
            step, begin = given.get("wf_increment"), given.get("wf_start_offset", 0.0)
            if isinstance(step, float) and step > 0.0 and isinstance(begin, float):
                clocks.setdefault((begin, step, rows), channel.name)
        for clock, name in clocks.items():
            called = "time" if len(clocks) == 1 else f"{name} time"
            if called not in names:
                yield _Item(prefix + called, "", "s", clock[2], (group.name, name, clock))


def _tdms_column(file: Any, key: Any, first: int, last: int | None) -> Any:
    group, name, clock = key
    channel = file[group][name]
    rows = range(len(channel))[first:last]
    if clock is not None:
        return clock[0] + clock[1] * np.arange(rows.start, rows.stop, dtype=np.float64)
    numbers = np.asarray(channel.read_data(first, len(rows)))
    if numbers.dtype.kind == "M":  # seconds since the first
        numbers = (numbers - channel.read_data(0, 1)[0]) / np.timedelta64(1, "s")
    return numbers


# --- MDF ------------------------------------------------------------------------------------------

_NUMBERS = range(6)  # data types: integers and floats of either byte order
_TEXTS = range(7, 12)  # conversions from and to text
_VARIABLE = (1, 5)  # channels whose samples differ in length
_LEFT_OUT = "it holds text or bytes"


def _mdf(path: Path) -> AbstractContextManager[Any]:
    try:
        import asammdf
    except ImportError:
        raise _missing(path, "asammdf", "mdf") from None
    opened: AbstractContextManager[Any] = asammdf.MDF(path)
    return opened


def _mdf_items(mdf: Any) -> Iterator[_Item]:
    """Channels of all groups, and the clock of each.

    In a file of several groups a column is called ``group/channel``, by the group's acquisition
    name or ``group 0``, ``group 1`` and so on.
    """
    named = [group.channel_group.acq_name or "" for group in mdf.groups]
    counts = Counter(named)
    for number, group in enumerate(mdf.groups):
        called, rows = named[number], group.channel_group.cycles_nr
        prefix = f"{called}/" if called and counts[called] == 1 else f"group {number}/"
        prefix = "" if len(named) == 1 else prefix
        for place, channel in enumerate(group.channels):
            conversion = channel.conversion
            texts = conversion is not None and conversion.conversion_type in _TEXTS
            numeric = channel.data_type in _NUMBERS and channel.channel_type not in _VARIABLE
            reason = _LEFT_OUT if texts or not numeric else "" if rows else "it is empty"
            unit = channel.unit or getattr(conversion, "unit", "") or split_unit(channel.name)[1]
            yield _Item(prefix + channel.name, reason, unit or None, rows, (number, place))


def _mdf_column(mdf: Any, key: Any, first: int, last: int | None) -> Any:
    """Numbers; samples that the file marks as invalid are NaN."""
    group, place = key
    rows = range(mdf.groups[group].channel_group.cycles_nr)[first:last]
    # invalid samples would be cut out otherwise
    samples, invalid = mdf.get(
        group=group,
        index=place,
        samples_only=True,
        ignore_invalidation_bits=True,
        record_offset=first,
        record_count=len(rows),
    )
    if samples.dtype.kind not in "iufb" or samples.ndim != 1:
        raise ValueError(f"a channel cannot be read as numbers: {_LEFT_OUT}")
    numbers = np.array(samples, np.float64)
    if invalid is not None:
        numbers[np.asarray(invalid, bool)] = np.nan
    return numbers


FORMATS: Mapping[str, _Format] = {
    "Parquet": _Format(_parquet, _parquet_items, _parquet_column),
    "MATLAB 4": _Format(_matlab, _matlab_items, _matlab_column, "vectors"),
    "MATLAB 5": _Format(_matlab, _matlab_items, _matlab_column, "vectors"),
    "MATLAB 7.3": _Format(_hdf5, _matlab73_items, _hdf5_column),
    "HDF5": _Format(_hdf5, _hdf5_items, _hdf5_column),
    "TDMS": _Format(_tdms, _tdms_items, _tdms_column, "channels"),
    "MDF 4": _Format(_mdf, _mdf_items, _mdf_column, "channels"),
}
"""How files of each format are read."""
