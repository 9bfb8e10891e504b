"""Logs in binary formats: thin layers over Polars, SciPy, h5py, npTDMS and asammdf.

They are opened in a process of their own, see `swashplate.logs.apart`. What a library reads from a
damaged file without a word is refused here: variables, blocks and channels that were cut off.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from math import ceil, prod
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from swashplate.errors import FileError
from swashplate.logs.log import Array, Column, Log, check_kind, printable, said, split_unit


class _Item(NamedTuple):
    """Something that a file holds: a column of a log, or the reason why it is none."""

    name: str
    unit: str | None = None
    rows: int = 0
    key: Any = None
    """Where it is in the file."""
    reason: str = ""


def _log(
    path: Path,
    form: str,
    items: Iterable[_Item],
    read: Callable[[Sequence[Any], int, int | None], Sequence[Array]],
    what: str = "columns",
) -> Log:
    """The log of a file's items; `read` gives those of some keys, `what` is what they are called.

    Raises
    ------
    FileError
        If none of them is a column of numbers.
    """
    items = list(items)
    kept = [each for each in items if not each.reason]
    left_out = {each.name: each.reason for each in items if each.reason}
    if not kept:
        why = "".join(f"; '{each}': {reason}" for each, reason in left_out.items())[:300]
        raise FileError(f"{path} has no {what} of numbers{printable(why)}.")

    def load(positions: Sequence[int], first: int = 0, last: int | None = None) -> Sequence[Array]:
        return read([kept[position].key for position in positions], first, last)

    columns = tuple(Column(each.name, each.unit) for each in kept)
    return Log(path, form, columns, load, left_out, tuple(each.rows for each in kept))


def _whole(path: Path, called: str, numbers: Array, claimed: int) -> Array:
    """Refuse a column with fewer numbers than it claims."""
    if numbers.size != claimed:
        raise FileError(
            f"{path}: '{called}' has {numbers.size} numbers where it claims {claimed}; the file "
            "was cut off or is damaged."
        )
    return numbers


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
    """
    import polars as pl

    check_kind(path, "Parquet")
    rows = int(pl.scan_parquet(path).select(pl.len()).collect().item())

    def item(name: str, kind: pl.DataType) -> _Item:
        if not (kind.is_numeric() or kind.is_temporal() or kind == pl.Boolean):
            return _Item(name, reason=f"it is of the type {kind}")
        return _Item(name, "s" if kind.is_temporal() else split_unit(name)[1], rows, name)

    def read(names: Sequence[str], first: int, last: int | None) -> list[Array]:
        # one column after the other: none that is done waits in the form that Polars reads it in
        return [_parquet_column(path, name, first, last) for name in names]

    items = (item(*each) for each in pl.read_parquet_schema(path).items())
    return _log(path, "Parquet", items, read)


def _parquet_column(path: Path, column: str, first: int, last: int | None) -> Array:
    import polars as pl

    stored = pl.scan_parquet(path).select(column)
    cells = stored.slice(first, None if last is None else last - first).collect()[column]
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
    return np.asarray(((ticks - zero).cast(pl.Float64) / 1e9).to_numpy(), np.float64)


# --- arrays: MATLAB and HDF5 ----------------------------------------------------------------------

_MOST = 4096  # signals in one matrix; one with more of both rows and columns is a picture or a map
_KINDS = {"c": "it holds complex numbers", "S": "it holds text", "U": "it holds text"}
_OTHER = "it is no array of numbers"
_LARGEST = 256 << 20
"""A file of MATLAB 4 or 5 is read as a whole; a larger one is refused. [byte]"""
_HDF5 = b"\x89HDF\r\n\x1a\n"
_UNITS = ("unit", "units", "Unit", "Units", "UNIT", "UNITS")
_OBJECTS = 100_000  # in one file


class _Place(NamedTuple):
    """A vector, or a row or a column of a matrix."""

    array: str
    axis: int | None
    """Dimension along which it is chosen, None for a vector."""
    number: int
    """Position along that dimension, from 0."""
    rows: int


def _signals(
    name: str, array: str, shape: tuple[int, ...], kind: str, units: Sequence[str], *, matlab: bool
) -> list[_Item]:
    """Vectors of an array of a shape in its own language's order; `array` is its place.

    The longer dimension is taken for the time.
    """
    reason = "" if kind in tuple("iufb") else _KINDS.get(kind, _OTHER)
    reason = reason or ("it is empty" if 0 in shape else "")
    if not reason and len(shape) > 2:
        reason = f"it has {len(shape)} dimensions"
    axis, count = None, 1
    if len(shape) == 2 and 1 not in shape:
        axis, count = (1, shape[1]) if shape[0] >= shape[1] else (0, shape[0])
        if count > _MOST and not reason:
            reason = f"it is a matrix of {shape[0]} by {shape[1]}"
    if reason:
        return [_Item(name, reason=reason)]
    given = list(units) if len(units) == count else [*units[:1], split_unit(name)[1]][:1] * count
    if axis is None:
        return [_Item(name, given[0], prod(shape), _Place(array, None, 0, prod(shape)))]
    form = (("({},:)", "(:,{})") if matlab else ("[{},:]", "[:,{}]"))[axis]
    rows = max(shape)
    return [
        _Item(name + form.format(i + matlab), given[i], rows, _Place(array, axis, i, rows))
        for i in range(count)
    ]


def open_matlab(path: Path) -> Log:
    """Look into a MATLAB file: vectors, matrices and the fields of structures.

    Columns are called as MATLAB writes them: ``x``, ``s.t``, ``x(1,:)``, ``x(:,1)``; of a matrix,
    the longer dimension is taken for the time. Whatever else there is, is left out.
    """
    check_kind(path, "MATLAB", "HDF5")
    with path.open("rb") as file:
        head, size = file.read(2056), file.seek(0, 2)
    # HDF5 begins at 0 or, behind MATLAB's own header, at a power of two
    if any(head[place : place + 8] == _HDF5 for place in (0, 512, 1024, 2048)):
        return _open_h5(path, "MATLAB 7.3", _matlab_name, matlab=True)
    five = head[126:128] in (b"IM", b"MI")
    if size > _LARGEST:
        raise FileError(
            f"{path} has {size >> 20} MB, and MATLAB files up to version 7 are read as a whole, up "
            f"to {_LARGEST >> 20} MB: save it with -v7.3, or as CSV."
        )

    def read(places: Sequence[Any], first: int, last: int | None) -> list[Array]:
        values, arrays = _matlab_values(path), []
        for name, axis, number, _ in places:
            vector = values[name] if axis is None else np.take(values[name], number, axis=axis)
            arrays.append(np.asarray(vector, np.float64).ravel()[first:last])
        return arrays

    items = (
        item
        for name, value in _matlab_values(path).items()
        for item in _signals(name, name, value.shape, value.dtype.kind, (), matlab=True)
    )
    return _log(path, "MATLAB 5" if five else "MATLAB 4", items, read, "vectors")


def _matlab_values(path: Path) -> dict[str, Any]:
    """Arrays by the names of the variables and, of structures, of their fields."""
    from scipy.io import loadmat

    def of(called: str, value: Any) -> Iterator[tuple[str, Any]]:
        if isinstance(value, dict):
            for field, inner in value.items():
                yield from of(f"{called}.{printable(field)}", inner)
        else:
            yield called, np.asarray(value)

    variables = loadmat(path, appendmat=False, simplify_cells=True).items()
    return {
        called: value
        for name, content in variables
        if not name.startswith("__")
        for called, value in of(printable(name), content)
    }


def _matlab_name(dataset: Any) -> tuple[str, str]:
    """What a dataset of version 7.3 is called, and why it cannot be read."""
    kind = _text(dataset.attrs.get("MATLAB_class", "double"))
    numbers = kind in ("single", "logical", "double") or kind.lstrip("u").startswith("int")
    reason = "it is empty" if dataset.attrs.get("MATLAB_empty", 0) else ""
    if "MATLAB_object_decode" in dataset.attrs or not numbers:
        reason = f"it is a MATLAB {kind}"
    return dataset.name.strip("/").replace("/", "."), reason


def open_hdf5(path: Path) -> Log:
    """Look into an HDF5 file: every dataset of numbers, of one or two dimensions.

    Columns are called ``/group/data``, those of a matrix ``/group/data[:,0]`` or
    ``/group/data[0,:]``, along its longer dimension. Units are from attributes. Links to other
    files are not followed.
    """
    check_kind(path, "HDF5")
    return _open_h5(path, "HDF5", lambda each: (f"/{each.name.lstrip('/')}", ""), matlab=False)


def _open_h5(
    path: Path, form: str, naming: Callable[[Any], tuple[str, str]], *, matlab: bool
) -> Log:
    """A log of the datasets that `naming` gives a name and no reason why they cannot be read."""
    import h5py

    items: list[_Item] = []
    with h5py.File(path, "r", locking=False) as file:
        names: list[str] = []
        # visits neither soft nor external links, and an object of several names once
        file.visit(names.append)
        if len(names) > _OBJECTS:
            raise FileError(
                f"{path} has {len(names)} objects, more than the {_OBJECTS} that are read."
            )
        # MATLAB keeps what cells and objects refer to below a name with a #
        for dataset in (file.get(name) for name in names if not (matlab and name[:1] == "#")):
            if not isinstance(dataset, h5py.Dataset):
                continue
            called, reason = naming(dataset)
            try:
                if not dataset.shape:
                    reason = reason or "it is a single value"
                elif dataset.is_virtual or dataset.external:
                    reason = reason or "its numbers are in other files"
                found = [_Item(called, reason=reason)] if reason else None
                items += found or _h5_signals(called, dataset, matlab)
            except (TypeError, ValueError) as error:  # a type that NumPy does not have
                items.append(_Item(called, reason=said(error)))

    def read(places: Sequence[Any], first: int, last: int | None) -> list[Array]:
        with h5py.File(path, "r", locking=False) as file:
            return [_h5_vector(path, file, each, first, last, matlab) for each in places]

    return _log(path, form, items, read)


def _h5_signals(called: str, dataset: Any, matlab: bool) -> list[_Item]:
    given: Any = next((dataset.attrs[key] for key in _UNITS if key in dataset.attrs), [])
    units = [_text(each) for each in np.ravel(given).tolist()]
    shape = dataset.shape[::-1] if matlab else dataset.shape
    return _signals(called, dataset.name, shape, dataset.dtype.kind, units, matlab=matlab)


def _text(value: object) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def _h5_vector(
    path: Path, file: Any, place: _Place, first: int, last: int | None, matlab: bool
) -> Array:
    dataset, rows = file[place.array], slice(first, last)
    _check_stored(path, dataset)
    if place.axis is not None:
        # MATLAB's dimensions are stored the other way round
        by_column = (place.axis == 1) is not matlab
        where: Any = (rows, place.number) if by_column else (place.number, rows)
    else:
        # a vector of n by 1 or 1 by n
        where = tuple(rows if size == place.rows else 0 for size in dataset.shape)
        where = where if dataset.ndim == 1 or place.rows > 1 else ...
    return np.asarray(dataset[where], np.float64).ravel()


def _check_stored(path: Path, dataset: Any) -> None:
    """Refuse numbers that are claimed but were never stored: HDF5 would give zeros for them."""
    what = f"'{dataset.name}'"
    if dataset.id.get_storage_size() == 0:
        raise FileError(f"{path}: {what} claims {prod(dataset.shape)} numbers, but none is stored.")
    if dataset.chunks is not None:
        sides = zip(dataset.shape, dataset.chunks, strict=True)
        expected = prod(ceil(length / chunk) for length, chunk in sides)
        count = dataset.id.get_num_chunks()
        if count != expected:
            raise FileError(
                f"{path}: {what} has only {count} of its {expected} blocks; the others were never "
                "written."
            )


# --- TDMS -----------------------------------------------------------------------------------------


def open_tdms(path: Path) -> Log:
    """Look into a TDMS file: the channels of numbers and of times, in all groups.

    In a file of several groups, a column is called ``group/channel``. The clock of a waveform, an
    increment among its properties, becomes a column ``time``. Times are seconds since the first.
    """
    check_kind(path, "TDMS")
    items: list[_Item] = []
    with _tdms(path) as file:
        for group in file.groups():
            prefix = f"{group.name}/" if len(file.groups()) > 1 else ""
            clocks: dict[tuple[float, float, int], str] = {}
            for channel in group.channels():
                called, kind, rows = prefix + channel.name, channel.dtype.kind, len(channel)
                if rows == 0 or kind not in "iufbM":
                    held = "it holds complex numbers" if kind == "c" else "it holds text"
                    items.append(_Item(called, reason=held if rows else "it is empty"))
                    continue
                unit = channel.properties.get("unit_string") or split_unit(channel.name)[1]
                unit = "s" if kind == "M" else unit
                key = group.name, channel.name, rows, None
                items.append(_Item(called, str(unit) if unit else None, rows, key))
                step = channel.properties.get("wf_increment")
                begin = channel.properties.get("wf_start_offset", 0.0)
                if isinstance(step, float) and step > 0.0 and isinstance(begin, float):
                    clocks.setdefault((begin, step, rows), channel.name)
            for clock, name in clocks.items():
                called = f"{prefix}time" if len(clocks) == 1 else f"{prefix}{name} time"
                if called not in {each.name for each in items}:
                    items.append(_Item(called, "s", clock[2], (group.name, name, clock[2], clock)))

    def read(keys: Sequence[Any], first: int, last: int | None) -> list[Array]:
        with _tdms(path) as file:
            return [_tdms_channel(path, file, key, first, last) for key in keys]

    return _log(path, "TDMS", items, read, "channels")


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
        raise ValueError(record.getMessage().partition(", will")[0])


def _tdms_channel(path: Path, file: Any, key: Any, first: int, last: int | None) -> Array:
    group, name, rows, clock = key
    last = rows if last is None else min(last, rows)
    if clock is not None:
        offset, increment, _ = clock
        return np.asarray(offset + increment * np.arange(first, last, dtype=np.float64))
    channel = file[group][name]
    numbers = np.asarray(channel.read_data(first, last - first))
    if numbers.dtype.kind == "M":
        numbers = (numbers - channel.read_data(0, 1)[0]) / np.timedelta64(1, "s")
    return _whole(path, name, numbers.astype(np.float64, copy=False), last - first)


# --- MDF ------------------------------------------------------------------------------------------

_NUMBERS = range(6)  # data types: integers and floats of either byte order
_TEXTS = range(7, 12)  # conversions from and to text
_VARIABLE = (1, 5)  # channels whose samples differ in length
_LEFT_OUT = "it holds text or bytes"


def open_mdf(path: Path) -> Log:
    """Look into an MDF 4 file: the channels of numbers of all groups, and the clock of each group.

    In a file of several groups a column is called ``group/channel``, by the group's acquisition
    name or ``group 0``, ``group 1`` and so on. Samples that the file marks as invalid are NaN.
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
    items: list[_Item] = []
    opened: Callable[[], Any] = partial(asammdf.MDF, path)
    with opened() as mdf:
        named = [group.channel_group.acq_name or "" for group in mdf.groups]
        counts = Counter(named)
        for number, group in enumerate(mdf.groups):
            called = named[number]
            prefix = f"{called}/" if called and counts[called] == 1 else f"group {number}/"
            prefix = "" if len(named) == 1 else prefix
            rows = group.channel_group.cycles_nr
            for place, channel in enumerate(group.channels):
                name, conversion = prefix + channel.name, channel.conversion
                texts = conversion is not None and conversion.conversion_type in _TEXTS
                numeric = channel.data_type in _NUMBERS and channel.channel_type not in _VARIABLE
                if texts or not numeric or rows == 0:
                    empty = numeric and not texts
                    items.append(_Item(name, reason="it is empty" if empty else _LEFT_OUT))
                    continue
                unit = channel.unit or getattr(conversion, "unit", "") or None
                unit = unit or split_unit(channel.name)[1]
                items.append(_Item(name, unit, rows, (name, number, place, rows)))

    def read(keys: Sequence[Any], first: int, last: int | None) -> list[Array]:
        with opened() as mdf:
            return [_mdf_samples(path, mdf, key, first, last) for key in keys]

    return _log(path, "MDF 4", items, read, "channels")


def _mdf_samples(path: Path, mdf: Any, key: Any, first: int, last: int | None) -> Array:
    called, group, place, rows = key
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


OPENERS: Mapping[str, Callable[[Path], Log]] = MappingProxyType(
    {
        "Parquet": open_parquet,
        "MATLAB": open_matlab,
        "HDF5": open_hdf5,
        "TDMS": open_tdms,
        "MDF": open_mdf,
    }
)
"""What opens a file of each format. All raise a FileError for a file that is damaged, of another
kind, without columns of numbers, or whose library is not installed."""
