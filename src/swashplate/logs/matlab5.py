"""MATLAB files of version 5, 6 and 7: tagged elements, most of them compressed.

Written here rather than left to a library, because a hostile file must neither be believed about
its sizes nor have its objects built, and because a vector shall be read without its neighbours.
The format is described in MathWorks' "MAT-File Format".
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import BinaryIO

import numpy as np

from swashplate.errors import FileError
from swashplate.logs.damage import check_claim, printable
from swashplate.logs.log import Log
from swashplate.logs.matrices import Inflated, Matrix, Plain, Stream, log_of_matrices

_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
_STRUCT, _OPAQUE = 2, 17
_STORED = {
    1: "i1",
    2: "u1",
    3: "i2",
    4: "u2",
    5: "i4",
    6: "u4",
    7: "f4",
    9: "f8",
    12: "i8",
    13: "u8",
}
_NUMERIC = range(6, 16)
_CLASSES = {1: "cell", 3: "object", 4: "text", 5: "sparse matrix", 16: "function", 17: "object"}
_COMPLEX = 0x08
_LONGEST = 1 << 16  # bytes of a name, of dimensions and of the names of fields
_DEEPEST = 16  # structures within structures
_MOST = 100_000  # matrices in one file


@dataclass
class _Walk:
    """What was found so far, and where in the file."""

    path: Path
    order: str
    matrices: list[Matrix]
    left_out: dict[str, str]
    packed: tuple[int, int] | None = None


def open_matlab5(path: Path, order: str) -> Log:
    """Look into a file of version 5, 6 or 7; `order` is its byte order. See `matlab.open`."""
    walk = _Walk(path, order, [], {})
    size = path.stat().st_size
    with path.open("rb") as file:
        comment = file.read(116).decode("latin-1").strip(" \0")
        begin = _HEADER
        while begin < size:
            begin = _element(walk, file, begin, size)
    return log_of_matrices(path, "MATLAB 5", walk.matrices, walk.left_out, (comment,))


def _element(walk: _Walk, file: BinaryIO, begin: int, size: int) -> int:
    """Look into the element that begins at a byte of the file; return where the next begins."""
    data = begin + 8
    kind, length = _Tags(Plain(file, begin), walk.order, begin).whole()
    if data + length > size:
        raise FileError(
            f"{walk.path}: the variable at byte {begin} claims {length} bytes, but only "
            f"{size - data} are left; the file was cut off or is damaged."
        )
    if kind == _COMPRESSED:
        walk.packed = (data, length)
        tags = _Tags(Inflated(file, data, length), walk.order, 0)
        kind, inner = tags.whole()
        check_claim(walk.path, f"the variable at byte {begin}", inner, length)
    else:
        walk.packed = None
        tags = _Tags(Plain(file, data), walk.order, data)
        inner = length
    if kind != _MATRIX:
        raise FileError(f"{walk.path} has no variable at byte {begin}; it is damaged.")
    _matrix(walk, tags, tags.place + inner, "", 0)
    return data + length


class _Tags:
    """A stream of tagged elements that knows its place."""

    def __init__(self, stream: Stream, order: str, place: int) -> None:
        self._stream = stream
        self._order = order
        self.place = place

    def whole(self) -> tuple[int, int]:
        """Type and length of an element, by its tag of 8 bytes."""
        kind, length = struct.unpack(f"{self._order}II", self._read(8))
        return kind, length

    def small(self, end: int, most: int = _LONGEST) -> bytes:
        """Data of an element that must be short, its padding passed over."""
        _, length, inside = self.numbers(end)
        if length > most:
            raise ValueError(f"a part has {length} bytes, where {most} are the most")
        found = self._read(length)
        self.skip(-length % 8 if not inside else 4 - length)
        return found

    def numbers(self, end: int) -> tuple[int, int, bool]:
        """Type and length of an element; whether its data are within the tag."""
        word = self._read(4)
        (first,) = struct.unpack(f"{self._order}I", word)
        if first >> 16:
            kind, length = first & 0xFFFF, first >> 16
            if length > 4:
                raise ValueError("a short element is longer than 4 bytes")
        else:
            kind = first
            (length,) = struct.unpack(f"{self._order}I", self._read(4))
        if self.place + length > end:
            raise ValueError("an element reaches beyond the variable that it is in")
        return kind, length, bool(first >> 16)

    def skip(self, count: int) -> None:
        """Pass over so many bytes."""
        self._stream.skip(count)
        self.place += count

    def _read(self, count: int) -> bytes:
        found = self._stream.read(count)
        self.place += count
        return found


def _matrix(walk: _Walk, tags: _Tags, end: int, called: str, depth: int) -> None:
    """Look into a matrix whose tag was read; `called` is its name in a structure, if it has one."""
    flags = tags.small(end)
    if len(flags) != 8:
        raise ValueError("a variable has no flags")
    (word,) = struct.unpack(f"{walk.order}I", flags[:4])
    kind, complex_numbers = word & 0xFF, bool(word >> 8 & _COMPLEX)
    if kind == _OPAQUE:
        own = _text(tags.small(end))
        walk.left_out[called or own] = "it is a MATLAB object"
        return
    dimensions = np.frombuffer(tags.small(end), f"{walk.order}i4")
    shape = tuple(int(each) for each in dimensions)
    name = called or _text(tags.small(end))
    if called:
        tags.small(end)
    if len(walk.matrices) + len(walk.left_out) > _MOST:
        raise ValueError(f"it has more than {_MOST} variables")
    if len(shape) < 2 or min(shape) < 0:
        raise ValueError(f"'{name}' has impossible dimensions")
    if not name:
        return  # what objects refer to
    if kind == _STRUCT:
        _structure(walk, tags, end, name, shape, depth)
    elif kind not in _NUMERIC:
        walk.left_out[name] = f"it is a MATLAB {_CLASSES.get(kind, 'variable of unknown class')}"
    elif complex_numbers:
        walk.left_out[name] = "it holds complex numbers"
    else:
        stored, length, _ = tags.numbers(end)
        count = prod(shape)
        if stored not in _STORED or length != count * int(_STORED[stored][1]):
            raise ValueError(f"'{name}' has {length} bytes for {count} numbers")
        dtype = np.dtype(walk.order + _STORED[stored])
        walk.matrices.append(Matrix(name, shape, dtype, tags.place, walk.packed))


def _structure(
    walk: _Walk, tags: _Tags, end: int, name: str, shape: tuple[int, ...], depth: int
) -> None:
    if prod(shape) != 1:
        walk.left_out[name] = "it is a MATLAB array of structures"
        return
    if depth >= _DEEPEST:
        raise ValueError(f"'{name}' holds structures in more than {_DEEPEST} levels")
    (width,) = struct.unpack(f"{walk.order}i", tags.small(end, 4))
    packed = tags.small(end)
    if width < 1 or len(packed) % width:
        raise ValueError(f"'{name}' has fields without names")
    for field in _names(packed, width):
        kind, length = tags.whole()
        after = tags.place + length
        if kind != _MATRIX or after > end:
            raise ValueError(f"'{name}.{field}' reaches beyond the structure")
        if length:
            _matrix(walk, tags, after, f"{name}.{field}", depth + 1)
            tags.skip(after - tags.place)


def _names(packed: bytes, width: int) -> Iterator[str]:
    for place in range(0, len(packed), width):
        yield _text(packed[place : place + width])


def _text(name: bytes) -> str:
    return printable(name.split(b"\0", 1)[0].decode("utf-8", "replace"))
