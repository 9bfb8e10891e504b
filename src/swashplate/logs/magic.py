"""What a file is by its first bytes, whatever it is called."""

from __future__ import annotations

from pathlib import Path

from swashplate.errors import FileError

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
