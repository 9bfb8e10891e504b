"""Logs in binary formats: thin layers over Polars, SciPy, h5py, npTDMS and asammdf.

A format is a row of `FORMATS`: a context in which a file is open and says what it holds. What a
library reads from a damaged file without a word is refused here: variables, blocks and channels
that were cut off. All of it runs in a process of its own, see `swashplate.logs.subprocess_reader`.
"""

from __future__ import annotations

import logging
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from datetime import UTC, datetime
from fractions import Fraction
from functools import partial
from importlib import import_module
from math import ceil, prod
from numbers import Real
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from swashplate.errors import FileError, InputError
from swashplate.logs.clocks import second_of
from swashplate.logs.log import Array, check_kind, first_sentence, printable, split_unit


class _Item(NamedTuple):
    """Something that a file holds: a column of a log, or the reason why it is none."""

    name: str
    reason: str = ""
    unit: str | None = None
    rows: int = 0
    read: Any = None
    """Gives the numbers from a row to before a last one (None: the end), while the file is open."""
    begin: int | None = None
    """Of stamps that count from a date: that date since 1970 [ns]; None of anything else."""


def look(
    reader: str, path: Path, requested: Sequence[int] = (), first: int = 0, last: int | None = None
) -> tuple[dict[str, Any], list[Array]]:
    """Contents of a file, as `Log` has them, and columns at some positions.

    The columns begin at the row `first` and end before the row `last`; None is the end.

    The reader is one of `FORMATS`, or MATLAB of any version. Of a damaged file it raises
    whatever its library does.
    """
    form = _form_of(reader, path)
    opened, what = FORMATS[form]
    with opened(path) as log:
        items = list(log)
        readable = [item for item in items if not item.reason]
        left_out = {item.name: item.reason for item in items if item.reason}
        if not readable:
            why = "".join(f"; '{signal}': {reason}" for signal, reason in left_out.items())[:300]
            raise FileError(f"{path} has no {what} of numbers{printable(why)}.")
        # all dates of a log count from one zero, or its channels would shift against each other
        zero = min((item.begin for item in readable if item.begin is not None), default=0)
        arrays = []
        for item in (readable[position] for position in requested):
            numbers = np.asarray(item.read(first, last), np.float64).ravel()
            if item.begin is not None:
                numbers = numbers + 1e-9 * (item.begin - zero)
            claimed = len(range(item.rows)[first:last])
            if numbers.size != claimed:
                raise FileError(
                    f"{path}: '{item.name}' has {numbers.size} numbers, but claims {claimed}; the "
                    "file is truncated or damaged."
                )
            arrays.append(numbers)
    lengths = [signal.rows for signal in readable]
    columns = [(signal.name, signal.unit) for signal in readable]
    contents = {"format": form, "columns": columns, "left_out": left_out, "lengths": lengths}
    return contents, arrays


_LARGEST = 256 << 20
"""A file of MATLAB 4 or 5 is read as a whole; a larger one is refused. [byte]"""


def _form_of(reader: str, path: Path) -> str:
    """The row of `FORMATS` by the first bytes of a file; another kind of file is refused."""
    check_kind(path, reader, *["HDF5"] * (reader in ("MATLAB", "Capytaine")))
    with path.open("rb") as file:
        head, size = file.read(2056), file.seek(0, 2)
    if reader == "MDF":
        version = head[8:16].decode("latin-1").strip(" \0")
        why = "" if version.startswith("4") else f"is MDF {version!r}; convert it to MDF 4"
        if not head.startswith(b"MDF     ") or len(head) < 64:
            why = "is not an MDF file"
        if head.startswith(b"UnFinMF "):
            why = "was not finished by its logger; let its program finalise it"
        if why:
            raise FileError(f"{path} {why}.")
        return "MDF 4"
    if reader != "MATLAB":
        return reader
    # HDF5 begins at 0 or, after MATLAB's own header, at a power of two
    if any(head[offset:].startswith(b"\x89HDF\r\n\x1a\n") for offset in (0, 512, 1024, 2048)):
        return "MATLAB 7.3"
    if size > _LARGEST:
        raise FileError(
            f"{path} has {size >> 20} MB, and MATLAB files up to version 7 are read at once, up to "
            f"{_LARGEST >> 20} MB: save it with -v7.3, or as CSV."
        )
    return "MATLAB 5" if head[126:128] in (b"IM", b"MI") else "MATLAB 4"


def _library(path: Path, name: str, extra: str) -> Any:
    """A library that only this format needs."""
    try:
        return import_module(name.lower())
    except ImportError:
        raise FileError(
            f"{path} needs the library {name}, which is not installed: "
            f"pip install 'swashplate[{extra}]'."
        ) from None


# --- Parquet --------------------------------------------------------------------------------------


@contextmanager
def _parquet(path: Path) -> Iterator[Iterable[_Item]]:
    import polars as pl

    stored = pl.scan_parquet(path)
    rows = int(stored.select(pl.len()).collect().item())
    items = list[_Item]()
    for name, kind in stored.collect_schema().items():
        holds_numbers = kind.is_temporal() or kind.is_numeric() or kind == pl.Boolean
        reason = "" if holds_numbers else f"it is of the type {kind}"
        unit = "s" if kind.is_temporal() else split_unit(name)[1]
        column, first_date, begin = stored.select(name), 0, None
        if kind in (pl.Date, pl.Datetime):
            cells = column.drop_nulls().head(1).collect().to_series().cast(pl.Datetime("ns"))
            first_date = next(iter(cells.dt.epoch("ns")), 0)
            # a day is no clock that others are to be aligned with
            begin = first_date if kind == pl.Datetime and len(cells) else None
        read = partial(_parquet_rows, column, first_date)
        items.append(_Item(name, reason, unit, rows, read, begin))
    yield items


def _parquet_rows(column: Any, first_date: int, first: int, last: int | None) -> Any:
    """Numbers; dates as seconds since the first one [ns], times and durations as seconds."""
    import polars as pl

    cells = column.slice(first, None if last is None else last - first).collect().to_series()
    if not cells.dtype.is_temporal():
        return cells.cast(pl.Float64).to_numpy()
    if cells.dtype == pl.Duration:
        ticks = cells.dt.total_nanoseconds()
    elif cells.dtype == pl.Time:
        ticks = cells.cast(pl.Int64)
    else:
        ticks = cells.cast(pl.Datetime("ns")).dt.epoch("ns")
    # subtracted as integers: a double of nanoseconds since 1970 would be 256 ns coarse
    return ((ticks - first_date).cast(pl.Float64) / 1e9).to_numpy()


# --- arrays: MATLAB and HDF5 ----------------------------------------------------------------------

_MOST = 4096  # signals in one matrix; one with more of both rows and columns is a picture or a map
_KINDS = {"c": "it holds complex numbers", "S": "it holds text", "U": "it holds text"}
_UNITS = ("unit", "units", "Unit", "Units", "UNIT", "UNITS")
_OBJECTS = 100_000  # in one file


def _vectors(
    name: str, array: Any, form: str, units: Sequence[str] = (), reverse: bool = False
) -> Iterator[_Item]:
    """Vectors of an array, the longer dimension being time.

    `form` is how its language writes an index: ``"({})"`` of MATLAB, which counts from 1,
    ``"[{}]"`` of HDF5. In `reverse` its dimensions are stored the other way round.
    """
    shape = array.shape[::-1] if reverse else array.shape
    reason = _why_no_vectors(shape, array.dtype.kind)
    if reason:
        yield _Item(name, reason)
        return
    rows = max(shape, default=1)
    if len(shape) < 2 or 1 in shape:
        unit = units[0] if units else split_unit(name)[1]
        yield _Item(name, "", unit, rows, partial(_vector, array, None, 0))
        return
    # the axis of the vectors' numbers, the shorter one
    axis = 1 if shape[0] >= shape[1] else 0
    stored_axis = 1 - axis if reverse else axis
    first_index = 1 if form.startswith("(") else 0
    for number in range(shape[axis]):
        index = number + first_index
        suffix = form.format(f":,{index}" if axis == 1 else f"{index},:")
        if len(units) == shape[axis]:
            unit = units[number]
        else:
            unit = units[0] if units else split_unit(name)[1]
        yield _Item(name + suffix, "", unit, rows, partial(_vector, array, stored_axis, number))


def _why_no_vectors(shape: Sequence[int], kind: str) -> str:
    """Reason for which an array of a shape and a kind of NumPy's holds no vectors, or empty."""
    if kind not in "iufb":
        return _KINDS.get(kind, "it is not an array of numbers")
    if 0 in shape:
        return "it is empty"
    if len(shape) > 2:
        return f"it has {len(shape)} dimensions"
    if len(shape) == 2 and min(shape) > _MOST:
        return f"it is a matrix of {shape[0]} by {shape[1]}"
    return ""


def _vector(array: Any, axis: int | None, number: int, first: int, last: int | None) -> Any:
    """Vector of an array of NumPy or HDF5, by its number along an axis; None: the array is one."""
    rows = slice(first, last)
    if not isinstance(array, np.ndarray):
        _check_stored(array)
    if axis is not None:
        return array[(rows, number) if axis else (number, rows)]
    if array.size <= 1:
        return array[...]
    # a vector of n by 1 or 1 by n
    return array[tuple(rows if size > 1 else 0 for size in array.shape)]


@contextmanager
def _matlab(path: Path) -> Iterator[Iterable[_Item]]:
    """Arrays by the names of the variables and, of structures, of their fields."""
    from scipy.io import loadmat

    def items(name: str, value: Any) -> Iterator[_Item]:
        if isinstance(value, dict):
            for field, inner in value.items():
                yield from items(f"{name}.{printable(field)}", inner)
        else:
            yield from _vectors(name, np.asarray(value), "({})")

    variables = loadmat(path, appendmat=False, simplify_cells=True).items()
    named = (variable for variable in variables if not variable[0].startswith("__"))
    yield (item for name, value in named for item in items(printable(name), value))


@contextmanager
def _hdf5(path: Path, *, matlab: bool = False) -> Iterator[Iterable[_Item]]:
    """All datasets, each once; neither soft nor external links are followed."""
    import h5py

    with h5py.File(path, "r", locking=False) as file:
        names: list[str] = []
        file.visit(names.append)
        if len(names) > _OBJECTS:
            raise ValueError(f"it has {len(names)} objects, more than the {_OBJECTS} that are read")
        datasets = (item for item in map(file.get, names) if isinstance(item, h5py.Dataset))
        items = _matlab73_items if matlab else _hdf5_items
        yield (item for dataset in datasets for item in items(dataset))


def _hdf5_items(dataset: Any, name: str | None = None, form: str = "[{}]") -> Iterator[_Item]:
    name = f"/{dataset.name.lstrip('/')}" if name is None else name
    reason = "" if dataset.shape else "it is a single value"
    try:
        if dataset.is_virtual or dataset.external:
            reason = reason or "its numbers are in other files"
        stated: Any = next((dataset.attrs[key] for key in _UNITS if key in dataset.attrs), [])
        units = [_decoded(number) for number in np.ravel(stated).tolist()]
        packing = _packing(dataset)
        if isinstance(packing, str):
            reason, packing = reason or packing, None
        if reason:
            yield _Item(name, reason)
            return
        for item in _vectors(name, dataset, form, units, reverse=form == "({})"):
            unpacked = item
            if not item.reason and packing is not None:
                unpacked = item._replace(read=partial(_unpacked, packing, item.read))
            yield _counted_from_date(unpacked)
    except (TypeError, ValueError) as error:  # a type that NumPy does not have
        yield _Item(name, first_sentence(error))


class _Packing(NamedTuple):
    """How numbers are packed by the conventions of netCDF: number = scale * stored + offset."""

    scale: float
    offset: float
    missing: tuple[float, ...]
    """Stored numbers that stand for none."""
    least: float
    most: float
    """Range of the stored numbers that count."""
    is_unsigned: bool
    """Whether what is stored as a signed integer is meant without a sign."""


_OTHER_SCALES = re.compile(
    r"(?:scale|scaling|gain|slope|factor|lsb|conversion|resolution)[_ ]?(?:factor|value)?",
    re.IGNORECASE,
)
_OTHER_OFFSETS = re.compile(r"(?:add[_ ]?)?offset|intercept|bias", re.IGNORECASE)
"""Attributes by which programs that keep to no convention say how integers are packed."""
_COUNTED = frozenset({"", "1", "count", "counts", "pulses", "ticks"})
"""Units of integers that are what they are."""
_PACKED = ("scale_factor", "add_offset", "_FillValue", "missing_value", "valid_min", "valid_max")


def _packing(dataset: Any) -> _Packing | str | None:
    """Packing of a dataset by its attributes, None if there is none, or why it cannot be read."""
    stated = {key: np.ravel(dataset.attrs[key]) for key in _PACKED if key in dataset.attrs}
    if "valid_range" in dataset.attrs:
        limits = np.ravel(dataset.attrs["valid_range"])
        stated |= {"valid_min": limits[:1], "valid_max": limits[-1:]}
    is_unsigned = _decoded(dataset.attrs.get("_Unsigned", "")).lower() == "true"
    other_name = _packed_by_another_name(dataset)
    if other_name and not {"scale_factor", "add_offset"} & stated.keys():
        return (
            f"its integers may be packed, as its attribute {other_name} says: call it scale_factor "
            "or add_offset if number = scale_factor * stored + add_offset"
        )
    if not stated and not is_unsigned:
        return None
    numbers = dict[str, list[float]]()
    for key, values in stated.items():
        if values.dtype.kind not in "iuf" or not (values.size == 1 or key == "missing_value"):
            return f"its attribute {key} is not a number"
        if key not in ("scale_factor", "add_offset"):
            # these are stored numbers
            values = _as_stored(values.astype(dataset.dtype), is_unsigned=is_unsigned)
        numbers[key] = [float(value) for value in values]
    return _Packing(
        scale=numbers.get("scale_factor", [1.0])[0],
        offset=numbers.get("add_offset", [0.0])[0],
        missing=(*numbers.get("_FillValue", []), *numbers.get("missing_value", [])),
        least=numbers.get("valid_min", [-np.inf])[0],
        most=numbers.get("valid_max", [np.inf])[0],
        is_unsigned=is_unsigned,
    )


def _packed_by_another_name(dataset: Any) -> str:
    """An attribute like a scale or an offset of integers with a unit, if it changes them."""
    units = {_decoded(dataset.attrs[key]).lower() for key in _UNITS if key in dataset.attrs}
    if dataset.dtype.kind not in "iu" or units <= _COUNTED:
        return ""
    for pattern, neutral in ((_OTHER_SCALES, 1.0), (_OTHER_OFFSETS, 0.0)):
        for name, value in dataset.attrs.items():
            numbers = np.ravel(value)
            is_number = numbers.dtype.kind in "iuf" and numbers.size == 1
            if pattern.fullmatch(name) and is_number and float(numbers[0]) != neutral:
                return str(name)
    return ""


def _as_stored(numbers: Any, *, is_unsigned: bool) -> Any:
    """Stored numbers, integers without their sign if they are meant so."""
    if not is_unsigned or numbers.dtype.kind != "i":
        return numbers
    return numbers.view(numbers.dtype.str.replace("i", "u"))


def _unpacked(packing: _Packing, read: Any, first: int, last: int | None) -> Array:
    """Numbers that are stored packed, NaN where none is."""
    stored = _as_stored(np.asarray(read(first, last)), is_unsigned=packing.is_unsigned)
    numbers = np.array(stored, np.float64)
    is_missing = np.isin(numbers, packing.missing)
    is_missing |= (numbers < packing.least) | (numbers > packing.most)
    numbers = packing.scale * numbers + packing.offset
    numbers[is_missing] = np.nan
    return numbers


_SINCE = re.compile(r"\s*(\w+)\s+since\s+(\d{4}-\d{1,2}-\d{1,2})(?:[T ]+([0-9:.]+)\s*(Z|UTC)?)?\s*")


def _counted_from_date(item: _Item) -> _Item:
    """A column of "days since 2024-03-11" and the like in seconds, with the date; others as are."""
    since = _SINCE.fullmatch(item.unit or "")
    if since is None or item.reason:
        return item
    year, month, day = map(int, since[2].split("-"))
    clock = [float(part) for part in (since[3] or "0").split(":")]
    try:
        second, midnight = second_of(since[1], ""), datetime(year, month, day, tzinfo=UTC)
    except (InputError, ValueError):
        return item
    seconds = sum(part * unit for part, unit in zip(clock, (3600, 60, 1), strict=False))
    begin = int(midnight.timestamp()) * 10**9 + round(1e9 * seconds)
    first_number = np.ravel(item.read(0, 1))[:1]
    if not np.isfinite(first_number).all():
        return item
    # a log's first stamp is near its others, whatever date they are counted from
    offset = first_number[0].item() if first_number.size else 0
    begin += round(Fraction(offset) * Fraction(str(second)) * 10**9)

    def read(first: int, last: int | None) -> Array:
        return second * np.asarray(item.read(first, last) - offset, np.float64)

    return item._replace(unit="s", read=read, begin=begin)


def _matlab73_items(dataset: Any) -> Iterator[_Item]:
    """Items of a dataset of MATLAB 7.3, whose dimensions are stored the other way round."""
    name = dataset.name.strip("/").replace("/", ".")
    kind = _decoded(dataset.attrs.get("MATLAB_class", "double"))
    numbers = kind in ("single", "logical", "double") or kind.lstrip("u").startswith("int")
    if name.startswith("#"):
        return  # what cells and objects refer to
    if "MATLAB_object_decode" in dataset.attrs or not numbers:
        yield _Item(name, f"it is a MATLAB {kind}")
    elif dataset.attrs.get("MATLAB_empty", 0):
        yield _Item(name, "it is empty")
    else:
        yield from _hdf5_items(dataset, name, "({})")


def _decoded(value: object) -> str:
    """Text of an attribute, which may be stored as bytes."""
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def _check_stored(dataset: Any) -> None:
    """Refuse numbers that are claimed but were never stored: HDF5 would give zeros for them."""
    name, shape, stored = dataset.name, dataset.shape, dataset.id
    if stored.get_storage_size() == 0:
        raise ValueError(f"'{name}' claims {prod(shape)} numbers, but none is stored")
    if dataset.chunks is not None:
        count = stored.get_num_chunks()
        expected = prod(ceil(size / side) for size, side in zip(shape, dataset.chunks, strict=True))
        if count != expected:
            raise ValueError(
                f"'{name}' has only {count} of its {expected} blocks, the others were never written"
            )


# --- Capytaine: transfer functions of ships -------------------------------------------------------

_MOTIONS = ("surge", "sway", "heave", "roll", "pitch", "yaw")
_AXES = ("wave_direction", "omega", "radiating_dof")


@contextmanager
def _capytaine(path: Path) -> Iterator[Iterable[_Item]]:
    """Rows of all waves and motions in the array RAO of a file that xarray wrote."""
    import h5py

    try:
        with h5py.File(path, "r", locking=False) as file:
            columns = _wave_rows(file["RAO"])
    except Exception as error:  # at a broken byte the library and its objects raise all there is
        raise FileError(
            f"{path} is not a file of netCDF 4 with an array RAO over complex, {', '.join(_AXES)}, "
            f"with their coordinates and the parts re and im: {first_sentence(error)}."
        ) from None
    yield (
        _Item(name, "", None, values.size, partial(_some, values))
        for name, values in columns.items()
    )


def _wave_rows(array: Any) -> dict[str, Array]:
    """A row for each motion of a ship in each wave; other degrees of freedom are left out."""
    scales = {scale[0].name.rpartition("/")[2]: scale[0] for scale in array.dims}
    names = ["radiating_dof" if name.endswith("_dof") else name for name in scales]
    labels = dict(zip(names, scales.values(), strict=True))
    for stored in (array, *labels.values()):
        _check_stored(stored)
    table = np.transpose(array[...], [names.index(name) for name in ("complex", *_AXES)])
    components, freedoms = (
        [str(word).lower() for word in labels[name].asstr()[...]]
        for name in ("complex", "radiating_dof")
    )
    motion_numbers = [number for number, freedom in enumerate(freedoms) if freedom in _MOTIONS]
    motions = np.array([_MOTIONS.index(freedoms[number]) + 1.0 for number in motion_numbers])
    directions, frequencies = (np.asarray(labels[name][...], np.float64) for name in _AXES[:2])
    grids = np.meshgrid(directions, frequencies, motions, indexing="ij")
    columns = dict(zip(("wave_direction", "omega", "motion"), grids, strict=True))
    for part in ("re", "im"):
        columns[part] = np.asarray(table[components.index(part)][..., motion_numbers], np.float64)
    return {name: values.ravel() for name, values in columns.items()}


def _some(values: Array, first: int, last: int | None) -> Array:
    return values[first:last]


# --- TDMS -----------------------------------------------------------------------------------------


class _Refusal(logging.Handler):
    """Refuses what npTDMS merely warns of: data that are cut off, and read as far as they go."""

    def emit(self, record: logging.LogRecord) -> None:
        raise ValueError(record.getMessage().partition(", will")[0])


@contextmanager
def _tdms(path: Path) -> Iterator[Iterable[_Item]]:
    """npTDMS on a file; an index next to it, which may belong to another, is not used."""
    nptdms = _library(path, "npTDMS", "tdms")
    nptdms.log.log_manager.console_handler.setLevel(logging.CRITICAL)
    logger, refusal = logging.getLogger("nptdms"), _Refusal()
    logger.addHandler(refusal)
    try:
        with path.open("rb") as file, nptdms.TdmsFile.open(file) as opened:
            yield _tdms_items(opened)
    finally:
        logger.removeHandler(refusal)


class _Waveform(NamedTuple):
    """Clock of a waveform: even stamps that count from a date."""

    date: int | None
    """Since 1970 [ns]; None if none is given."""
    first: float
    """First stamp [s]."""
    step: float
    """[s]"""
    rows: int


_NO_START = np.datetime64("1904-01-02")  # LabVIEW writes its zero, 1904, for a date that is not set


def _waveform(properties: Mapping[str, Any], rows: int) -> _Waveform | str | None:
    """Clock of a channel by its properties, None if it has none, or the reason why it has none."""
    step, begin = properties.get("wf_increment"), properties.get("wf_start_offset", 0.0)
    # what is a single float is written so that it is the decimal that was meant
    step, begin = (
        float(str(number)) if isinstance(number, np.float32) else number for number in (step, begin)
    )
    if not isinstance(step, Real) or not isinstance(begin, Real) or not float(step) > 0.0:
        return None
    unit = str(properties.get("wf_xunit_string") or "s").strip()
    try:
        second = second_of("s" if unit.lower() in _SECONDS else unit, "")
    except InputError:
        return f"its increment is in '{unit}', which is not a unit of time"
    start = properties.get("wf_start_time")
    date = None
    if isinstance(start, np.datetime64) and start > _NO_START:
        date = int(start.astype("M8[ns]").astype(np.int64))
    return _Waveform(date, second * float(begin), second * float(step), rows)


_SECONDS = ("", "s", "sec", "secs", "second", "seconds")


def _tdms_items(file: Any) -> Iterator[_Item]:
    """Channels and, of waveforms, whose properties hold an increment, a column ``time``.

    If the waveforms of a group differ in start, increment or length, each channel has a column of
    its own, ``channel time``. In a file of several groups, a column is called ``group/channel``.
    Beside waveforms that begin at a date, one without is left out: nobody knows when it begins.
    """
    waveforms = [
        _waveform(channel.properties, len(channel))
        for group in file.groups()
        for channel in group.channels()
    ]
    some_have_dates = any(isinstance(each, _Waveform) and each.date for each in waveforms)
    for group in file.groups():
        prefix = f"{group.name}/" if len(file.groups()) > 1 else ""
        clocks, names = dict[str, _Waveform | str](), set[str]()
        for channel in group.channels():
            kind, rows, properties = channel.dtype.kind, len(channel), channel.properties
            name = prefix + channel.name
            names.add(channel.name)
            if rows == 0 or kind not in "iufbM":
                yield _Item(name, _KINDS.get(kind, _KINDS["S"]) if rows else "it is empty")
                continue
            unit, begin = properties.get("unit_string") or split_unit(channel.name)[1], None
            if kind == "M":
                unit, first = "s", channel.read_data(0, 1)[0]
                begin = None if np.isnat(first) else int(first.astype("M8[ns]").astype(np.int64))
            read = partial(_tdms_rows, channel)
            yield _Item(name, "", str(unit) if unit else None, rows, read, begin)
            clock = _waveform(properties, rows)
            if some_have_dates and isinstance(clock, _Waveform) and clock.date is None:
                clock = "it has no wf_start_time as others have, so nobody knows when it begins"
            if clock is not None:
                clocks[channel.name] = clock
        differ = len({*clocks.values()}) > 1
        for channel_name, clock in clocks.items():
            called = f"{channel_name} time" if differ else "time"
            if called in names:
                continue
            if isinstance(clock, str):  # the reason why there is none
                yield _Item(prefix + called, clock)
            else:
                read = partial(_stamps, clock)
                yield _Item(prefix + called, "", "s", clock.rows, read, clock.date)
            names.add(called)


def _tdms_rows(channel: Any, first: int, last: int | None) -> Any:
    numbers = np.asarray(channel.read_data(first, len(range(len(channel))[first:last])))
    if numbers.dtype.kind == "M":  # seconds since the first
        numbers = (numbers - channel.read_data(0, 1)[0]) / np.timedelta64(1, "s")
    return numbers


def _stamps(clock: _Waveform, first: int, last: int | None) -> Array:
    rows = range(clock.rows)[first:last]
    return clock.first + clock.step * np.arange(rows.start, rows.stop, dtype=np.float64)


# --- MDF ------------------------------------------------------------------------------------------

_NUMBERS = range(6)  # data types: integers and floats of either byte order
_TEXTS = range(7, 12)  # conversions from and to text
_VARIABLE = (1, 5)  # channels whose samples differ in length
_LEFT_OUT = "it holds text or bytes"


@contextmanager
def _mdf(path: Path) -> Iterator[Iterable[_Item]]:
    with _library(path, "asammdf", "mdf").MDF(path) as mdf:
        yield _mdf_items(mdf)


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
        for position, channel in enumerate(group.channels):
            conversion, name = channel.conversion, channel.name
            texts = conversion is not None and conversion.conversion_type in _TEXTS
            numeric = channel.data_type in _NUMBERS and channel.channel_type not in _VARIABLE
            reason = _LEFT_OUT if texts or not numeric else "" if rows else "it is empty"
            unit = channel.unit or getattr(conversion, "unit", "") or split_unit(name)[1]
            read = partial(_mdf_rows, mdf, number, position)
            yield _Item(prefix + name, reason, unit or None, rows, read)


def _mdf_rows(mdf: Any, group: int, channel: int, first: int, last: int | None) -> Any:
    """Numbers; samples that the file marks as invalid are NaN."""
    rows = range(mdf.groups[group].channel_group.cycles_nr)[first:last]
    # invalid samples would be cut out otherwise
    samples, invalid = mdf.get(
        group=group,
        index=channel,
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


FORMATS: dict[str, tuple[Callable[[Path], AbstractContextManager[Iterable[_Item]]], str]] = {
    "Parquet": (_parquet, "columns"),
    "MATLAB 4": (_matlab, "vectors"),
    "MATLAB 5": (_matlab, "vectors"),
    "MATLAB 7.3": (partial(_hdf5, matlab=True), "columns"),
    "HDF5": (_hdf5, "columns"),
    "Capytaine": (_capytaine, "motions"),
    "TDMS": (_tdms, "channels"),
    "MDF 4": (_mdf, "channels"),
}
"""For each format the function that opens a file and lists its items, and a word for these."""
