"""MATLAB files of version 7.3, which are HDF5."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from swashplate.logs.hdf5 import log_of, look_into
from swashplate.logs.log import Log
from swashplate.logs.text.options import TextOptions

_NUMBERS = frozenset(
    ["double", "single", "logical"]
    + [f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)]
)


def open(path: Path, options: TextOptions) -> Log:
    """Look into a file whose first bytes are HDF5's; see `matlab.open`."""
    return log_of(path, "MATLAB 7.3", look_into(path, _named, matlab=True))


def _named(dataset: Any) -> tuple[str | None, str | None]:
    parts = dataset.name.strip("/").split("/")
    if parts[0].startswith("#"):  # what cells and objects refer to
        return None, None
    called = ".".join(parts)
    kind = dataset.attrs.get("MATLAB_class", b"double")
    kind = kind.decode("latin-1") if isinstance(kind, bytes) else str(kind)
    if "MATLAB_object_decode" in dataset.attrs or kind not in _NUMBERS:
        return called, f"it is a MATLAB {kind}"
    if dataset.attrs.get("MATLAB_empty", 0):
        return called, "it is empty"
    return called, None
