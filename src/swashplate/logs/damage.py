"""Damaged and hostile files: whatever a library meets in one becomes one sentence.

A file is known by its first bytes, whatever it is called.
"""

from __future__ import annotations

import csv
import re
import struct
import warnings
import zlib
from collections.abc import Collection, Mapping
from pathlib import Path
from types import TracebackType

from swashplate.errors import FileError, SwashplateError

DAMAGE = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    BufferError,
    EOFError,
    LookupError,
    MemoryError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
    csv.Error,
    struct.error,
    zlib.error,
)
"""What libraries raise at files that break their format's rules; it depends on the broken byte."""

INFLATION = 1032
"""No more bytes than this come out of one byte of zlib's; Parquet's codecs are no better."""


class Reading:
    """Context in which a file is read: errors of its format become one FileError.

    Parameters
    ----------
    path : path
        The file.
    kind : str
        What it is read as: ``MATLAB``.
    more : tuple of exception types
        What the library raises besides `DAMAGE`.
    """

    def __init__(self, path: Path, kind: str, more: tuple[type[BaseException], ...] = ()) -> None:
        self.path = path
        self.kind = kind
        self.expected: tuple[type[BaseException], ...] = (*DAMAGE, *more)
        self._warnings = warnings.catch_warnings()

    def __enter__(self) -> None:
        """Begin; what a library warns of is either refused here or of no concern."""
        self._warnings.__enter__()
        warnings.simplefilter("ignore")

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Turn an expected error into a FileError; let others pass."""
        self._warnings.__exit__(kind, error, trace)
        if error is None or isinstance(error, SwashplateError):
            return
        # some libraries raise the bare Exception, which has no name to be expected by
        if isinstance(error, self.expected) or type(error) is Exception:
            raise FileError(
                f"{self.path} cannot be read as {self.kind}, it is damaged or of another kind: "
                f"{said(error)}."
            ) from None


def said(error: BaseException) -> str:
    """The first sentence of an error's message, or what it is."""
    if isinstance(error, MemoryError):
        return "it asks for more memory than there is"
    lines = str(error).strip().splitlines()
    first = printable(lines[0]) if lines else ""
    sentence = re.split(r"[.!?;](?:\s|$)", first, maxsplit=1)[0].strip()[:200]
    return sentence or type(error).__name__


def printable(text: str) -> str:
    """A text for a sentence: what cannot be printed is replaced."""
    return "".join(each if each.isprintable() else "�" for each in text)


def check_file(path: Path) -> int:
    """Size in bytes of a file that can be read.

    Raises
    ------
    FileError
        If it is missing, a folder, not readable or empty.
    """
    try:
        if path.is_dir():
            reason = "is a folder, not a log"
        elif path.exists() and not path.is_file():
            reason = "is no ordinary file"
        else:
            with path.open("rb") as file:
                size = file.seek(0, 2)
            reason = "" if size else "is empty"
    except FileNotFoundError:
        raise FileError(f"There is no file {path}.") from None
    except (OSError, ValueError) as error:
        reason = f"cannot be read: {getattr(error, 'strerror', None) or said(error)}"
    if reason:
        raise FileError(f"{path} {reason}.")
    return size


def left_out_notes(left_out: Mapping[str, str]) -> tuple[str, ...]:
    """What is left out of a file and why, one sentence each."""
    return tuple(f"'{each}' is left out: {reason}." for each, reason in left_out.items())


def check_any(
    path: Path, columns: Collection[object], what: str, left_out: Mapping[str, str]
) -> None:
    """Refuse a file without columns of numbers, and say what it has instead."""
    if not columns:
        why = "".join(f"; '{each}': {reason}" for each, reason in left_out.items())[:300]
        raise FileError(f"{path} has no {what} of numbers{why}.")


def missing_extra(path: Path, library: str, extra: str) -> FileError:
    """What to say where a library is not installed that this format needs."""
    return FileError(
        f"{path} needs the library {library}, which is not installed: "
        f"pip install 'swashplate[{extra}]'."
    )


# --- kinds by their first bytes -------------------------------------------------------------------

HDF5 = b"\x89HDF\r\n\x1a\n"
PARQUET = b"PAR1"
TDMS = b"TDSm"
MDF = b"MDF     "
UNFINISHED_MDF = b"UnFinMF "
MATLAB = b"MATLAB 5.0 MAT-file"
MATLAB_73 = b"MATLAB 7.3 MAT-file"

_KINDS = {
    HDF5: "HDF5",
    PARQUET: "Parquet",
    TDMS: "TDMS",
    MDF: "MDF",
    UNFINISHED_MDF: "MDF",
    MATLAB: "MATLAB",
    MATLAB_73: "MATLAB",
    b"PK\x03\x04": "Excel or zip",
    b"\xd0\xcf\x11\xe0": "Excel",
    b"\x1f\x8b": "gzip",
    b"\x28\xb5\x2f\xfd": "zstd",
    b"\xfd7zXZ": "xz",
    b"\x80\x02": "Python pickle",
    b"\x80\x03": "Python pickle",
    b"\x80\x04": "Python pickle",
    b"\x80\x05": "Python pickle",
    b"\x93NUMPY": "NumPy",
    b"%PDF-": "PDF",
}


def check_kind(path: Path, *expected: str) -> None:
    """Refuse a file whose first bytes are those of another kind, and say of which.

    Parameters
    ----------
    expected : str
        Kinds that are right, by name; a file of no known kind passes.
    """
    with path.open("rb") as file:
        first = file.read(32)
    for magic, kind in _KINDS.items():
        if first.startswith(magic) and kind not in expected:
            raise FileError(
                f"{path} ends in '{path.suffix}' but holds {kind}; rename or convert it."
            )
