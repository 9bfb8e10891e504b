"""How golden arrays lie in their file, and how what is found today is compared with them.

The file has two arrays: the index, which is JSON, and all numbers in one row. Of a long array a few
rows are kept, with what tells of all the others: a hash of its bytes, or of each column the largest
magnitude and the root mean square of each quarter.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping
from dataclasses import dataclass, field
from hashlib import blake2b
from pathlib import Path
from typing import Any, Literal

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Class = Literal["bits", "tight", "derivatives"]
Output = NDArray[Any] | tuple[str, ...]

FILE = Path(__file__).with_name("golden.npz")
TOLERANCES: dict[Class, float] = {"bits": 0.0, "tight": 1e-12, "derivatives": 1e-9}
"""Of the largest magnitude of a column."""
PARTS = 4
"""Parts of a column whose root mean squares are kept, where not all of its rows are."""


def machine() -> str:
    """Where the bits come from: another compiler or library may round another way."""
    return (
        f"{platform.machine()}, Python {platform.python_version()}, NumPy {np.__version__}, "
        f"Numba {numba.__version__}"
    )


def kept_rows(size: int, count: int) -> NDArray[np.int64]:
    """Rows that are kept of an array: the first and last ones, and others at equal distances."""
    if size <= count:
        return np.arange(size)
    ends = max(count // 8, 1)
    inner = np.linspace(ends, size - 1 - ends, count - 2 * ends).astype(np.int64)
    return np.concatenate([np.arange(ends), inner, np.arange(size - ends, size)])


def as_columns(values: NDArray[Any]) -> Array:
    """An array as columns of floats: a number or a row of numbers is one column."""
    numbers = np.asarray(values, dtype=np.float64)
    return numbers.reshape(-1, 1) if numbers.ndim < 2 else numbers.reshape(numbers.shape[0], -1)


def parts(columns: Array) -> Array:
    """Root mean squares of each part of each column, (PARTS, k)."""
    scale = np.abs(columns).max(axis=0)
    scaled = columns / np.where(scale > 0.0, scale, 1.0)
    means = [np.sqrt(np.mean(each**2, axis=0)) for each in np.array_split(scaled, PARTS)]
    return np.asarray(means * scale)


def fingerprint(values: NDArray[Any]) -> str:
    """Hash of an array's bytes."""
    return blake2b(np.ascontiguousarray(values).tobytes(), digest_size=8).hexdigest()


@dataclass
class Golden:
    """The contents of a golden file."""

    inputs: dict[str, Array] = field(default_factory=dict)
    """Records, stamps and the like, every bit of them."""
    cases: dict[str, dict[str, dict[str, Any]]] = field(default_factory=dict)
    """Each array of each case, as `kept` has it."""
    made_on: str = ""

    @classmethod
    def read(cls, path: Path = FILE) -> Golden:
        """Read a file that `write` wrote."""
        with np.load(path) as stored:
            index = json.loads(stored["index"].tobytes())
            # bytes of equal rank lie side by side in the file: they pack better
            numbers = np.ascontiguousarray(stored["numbers"].T).reshape(-1).view(np.float64)

        def array(place: list[Any]) -> Array:
            first, shape = place
            return numbers[first : first + int(np.prod(shape))].reshape(shape)

        cases = {
            case: {
                name: {
                    key: array(value) if key in ("rows", "scale", "parts") else value
                    for key, value in entry.items()
                }
                for name, entry in entries.items()
            }
            for case, entries in index["cases"].items()
        }
        inputs = {name: array(place) for name, place in index["inputs"].items()}
        return cls(inputs, cases, index["made_on"])

    def write(self, path: Path = FILE) -> None:
        """Write the file; the same contents give the same bytes."""
        numbers: list[Array] = []
        at = 0

        def place(values: Array) -> list[Any]:
            nonlocal at
            numbers.append(np.asarray(values, dtype=np.float64).reshape(-1))
            at += values.size
            return [at - values.size, list(values.shape)]

        index = {
            "made_on": self.made_on,
            "inputs": {name: place(values) for name, values in self.inputs.items()},
            "cases": {
                case: {
                    name: {
                        key: place(value) if isinstance(value, np.ndarray) else value
                        for key, value in entry.items()
                    }
                    for name, entry in entries.items()
                }
                for case, entries in self.cases.items()
            },
        }
        packed = np.concatenate(numbers).view(np.uint8).reshape(-1, 8).T
        text = np.frombuffer(json.dumps(index, separators=(",", ":")).encode(), dtype=np.uint8)
        np.savez_compressed(path, index=text, numbers=np.ascontiguousarray(packed))


def kept(values: Output, kind: Class, count: int) -> dict[str, Any]:
    """What the file keeps of an array, or of a row of names.

    Parameters
    ----------
    values : array or tuple of str
        What a case gave.
    kind : {"bits", "tight", "derivatives"}
        Class of the comparison.
    count : int
        Rows to keep.
    """
    if isinstance(values, tuple):
        return {"names": list(values)}
    values = np.asarray(values)
    columns = as_columns(values)
    entry: dict[str, Any] = {
        "shape": list(values.shape),
        "dtype": values.dtype.str,
        "count": count,
        "rows": columns[kept_rows(columns.shape[0], count)],
    }
    if kind == "bits":
        entry["hash"] = fingerprint(values)
    elif columns.shape[0] > count:
        entry["scale"] = np.abs(columns).max(axis=0)
        entry["parts"] = parts(columns)
    return entry


def differences(found: Output, entry: Mapping[str, Any], kind: Class) -> list[str]:
    """What is wrong with an array, in words; nothing if it is the golden one in its class."""
    if isinstance(found, tuple):
        return [] if list(found) == entry.get("names") else [f"is {found}, was {entry}"]
    if "shape" not in entry:
        return [f"is an array, was {entry}"]
    found = np.asarray(found)
    if list(found.shape) != entry["shape"] or found.dtype.str != entry["dtype"]:
        return [
            f"is {found.dtype.str} of shape {found.shape}, was {entry['dtype']} of shape "
            f"{tuple(entry['shape'])}"
        ]
    columns = as_columns(found)
    at = kept_rows(columns.shape[0], entry["count"])
    rows = columns[at]
    golden = entry["rows"]
    scale = entry.get("scale", np.abs(golden).max(axis=0, initial=0.0))
    if kind == "bits":
        if fingerprint(found) == entry["hash"]:
            return []
        return [f"has other bits; {_worst(rows, golden, scale, at)}"]
    told = []
    # what is zero but for rounding has no digits to keep
    tolerance = np.where(np.isfinite(scale), np.maximum(TOLERANCES[kind] * scale, 1e-17), 0.0)
    if not _within(rows, golden, tolerance):
        told.append(f"is beyond {TOLERANCES[kind]:g}: {_worst(rows, golden, scale, at)}")
    if "parts" in entry:
        largest = np.abs(columns).max(axis=0)
        for what, of_all, was in (
            ("largest magnitude", largest[None], entry["scale"][None]),
            ("root mean square of a quarter", parts(columns), entry["parts"]),
        ):
            if not _within(of_all, was, tolerance):
                worst = _worst(of_all, was, scale, np.arange(was.shape[0]))
                told.append(f"is beyond {TOLERANCES[kind]:g} in the {what}: {worst}")
    return told


def _within(found: Array, golden: Array, tolerance: Array) -> bool:
    same = (found == golden) | (np.isnan(found) & np.isnan(golden))
    with np.errstate(invalid="ignore"):
        return bool((same | (np.abs(found - golden) <= tolerance)).all())


def _worst(found: Array, golden: Array, scale: Array, at: NDArray[np.int64]) -> str:
    """The largest difference among the rows that were kept."""
    same = (found == golden) | (np.isnan(found) & np.isnan(golden))
    if same.all():
        return "the rows that were kept are equal, others are not"
    with np.errstate(invalid="ignore", divide="ignore"):
        size = np.abs(found - golden) / scale
    size = np.where(same, 0.0, np.where(np.isnan(size), np.inf, size))
    i, j = np.unravel_index(int(size.argmax()), size.shape)
    return (
        f"{int((~same).any(axis=1).sum())} of {at.size} kept rows differ, most row {at[i]}, column "
        f"{j}: {float(found[i, j])!r}, was {float(golden[i, j])!r}, {size[i, j]:.3g} of its "
        "column's largest"
    )
