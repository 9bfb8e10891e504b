"""Matrices in MATLAB's own files: numbers column by column, plain or compressed."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from math import prod
from pathlib import Path
from typing import BinaryIO, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import FileError
from swashplate.logs.log import Array, Column, Log
from swashplate.logs.lookup import split_unit
from swashplate.logs.signals import Signal, signals

_BLOCK = 1 << 22  # bytes that are held at a time


class Stream(Protocol):
    """Bytes one after another."""

    def read(self, count: int) -> bytes:
        """Exactly so many bytes; EOFError if there are fewer."""
        ...

    def skip(self, count: int) -> None:
        """Pass over so many bytes."""
        ...

    def finish(self) -> None:
        """Check what can be checked at the end."""
        ...


class Plain:
    """Bytes of a file as they are."""

    def __init__(self, file: BinaryIO, begin: int) -> None:
        self._file = file
        file.seek(begin)

    def read(self, count: int) -> bytes:
        """Exactly so many bytes."""
        found = self._file.read(count)
        if len(found) < count:
            raise EOFError("it ends too early")
        return found

    def skip(self, count: int) -> None:
        """Pass over so many bytes."""
        self._file.seek(count, 1)

    def finish(self) -> None:
        """Nothing to check: plain numbers carry no checksum."""


class Inflated:
    """Bytes that zlib has compressed; never more than asked for are in memory."""

    def __init__(self, file: BinaryIO, begin: int, length: int) -> None:
        self._file = file
        self._left = length
        self._inflater = zlib.decompressobj()
        self._packed = b""
        file.seek(begin)

    def read(self, count: int) -> bytes:
        """Exactly so many bytes."""
        parts = []
        while count > 0:
            part = self._some(min(count, _BLOCK))
            if not part:
                raise EOFError("its compressed data end too early")
            parts.append(part)
            count -= len(part)
        return b"".join(parts)

    def skip(self, count: int) -> None:
        """Pass over so many bytes."""
        while count > 0:
            count -= len(self.read(min(count, _BLOCK)))

    def finish(self) -> None:
        """Unpack the rest, so that zlib compares its checksum."""
        while self._some(_BLOCK):
            pass
        if not self._inflater.eof:
            raise EOFError("its compressed data end too early")

    def _some(self, most: int) -> bytes:
        while not self._inflater.eof:
            if not self._packed:
                self._packed = self._file.read(min(self._left, 1 << 16))
                self._left -= len(self._packed)
                if not self._packed:
                    break
            found = self._inflater.decompress(self._packed, most)
            self._packed = self._inflater.unconsumed_tail
            if found:
                return found
        return b""


class Matrix(NamedTuple):
    """Numbers in a file, column after column."""

    name: str
    shape: tuple[int, ...]
    kind: np.dtype[np.generic]
    """As they are stored, byte order included."""
    begin: int
    """Byte of the first number, in the file or among the unpacked bytes."""
    packed: tuple[int, int] | None = None
    """First byte and length of the compressed part of the file that it is in."""

    @property
    def size(self) -> int:
        """Bytes of its numbers."""
        return prod(self.shape) * self.kind.itemsize


def log_of_matrices(
    path: Path,
    form: str,
    matrices: Sequence[Matrix],
    left_out: dict[str, str],
    comments: tuple[str, ...] = (),
) -> Log:
    """A log of the vectors in these matrices.

    Raises
    ------
    FileError
        If there are none.
    """
    columns: list[Column] = []
    found: list[tuple[Matrix, Signal]] = []
    for matrix in matrices:
        several = signals(matrix.name, matrix.shape, matlab=True)
        if isinstance(several, str):
            left_out[matrix.name] = several
            continue
        for signal in several:
            columns.append(Column(signal.name, split_unit(matrix.name)[1]))
            found.append((matrix, signal))
    if not columns:
        why = "".join(f"; '{each}': {reason}" for each, reason in left_out.items())[:300]
        raise FileError(f"{path} has no vectors of numbers{why}.")
    notes = tuple(f"'{each}' is left out: {reason}." for each, reason in left_out.items())

    def load(positions: Sequence[int]) -> list[Array]:
        return [_read(path, *found[position]) for position in positions]

    return Log(path, form, tuple(columns), load, comments, notes, left_out)


def _read(path: Path, matrix: Matrix, signal: Signal) -> Array:
    from swashplate.logs.damage import Reading

    with Reading(path, "MATLAB"), path.open("rb") as file:
        stream: Stream = Plain(file, matrix.begin)
        if matrix.packed is not None:
            stream = Inflated(file, *matrix.packed)
            stream.skip(matrix.begin)
        numbers = _signal(stream, matrix, signal)
        stream.finish()
        return numbers


def _signal(stream: Stream, matrix: Matrix, signal: Signal) -> Array:
    rows = matrix.shape[0]
    width = matrix.kind.itemsize
    if signal.axis is None:
        return _vector(stream, prod(matrix.shape), matrix.kind)
    if signal.axis == 1:
        stream.skip(signal.place * rows * width)
        return _vector(stream, rows, matrix.kind)
    count = matrix.shape[1]
    numbers = np.empty(count)
    step = max(1, _BLOCK // (rows * width))
    for begin in range(0, count, step):
        some = min(step, count - begin)
        block: NDArray[np.generic] = np.frombuffer(stream.read(some * rows * width), matrix.kind)
        numbers[begin : begin + some] = block.reshape(some, rows)[:, signal.place]
    return numbers


def _vector(stream: Stream, count: int, kind: np.dtype[np.generic]) -> Array:
    numbers = np.empty(count)
    step = _BLOCK // kind.itemsize
    for begin in range(0, count, step):
        some = min(step, count - begin)
        numbers[begin : begin + some] = np.frombuffer(stream.read(some * kind.itemsize), kind)
    return numbers
