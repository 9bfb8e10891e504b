"""Files of a simulated campaign: logs, campaign.toml and, apart from them, the truth."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict
from importlib.metadata import version
from io import BytesIO
from json import dumps
from pathlib import Path
from platform import python_version
from re import fullmatch
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from swashplate.__about__ import __version__
from swashplate.campaign.rig.bench import VirtualRun, VirtualTests
from swashplate.campaign.rig.readings import COLUMNS
from swashplate.campaign.schema import KINDS
from swashplate.errors import FileError, InputError
from swashplate.tables import write_text, write_whole

if TYPE_CHECKING:
    import polars

Array = NDArray[np.float64]
Format = Literal["csv", "mat", "parquet"]

DRIVE_FILE = "drive.toml"
"""Parameters of the drive that was simulated, beside truth.toml; or, beside campaign.toml, those of
the one that a fit starts from."""
MAT_HEADER = 116
"""Bytes of free text at the beginning of a MAT-file of version 5."""


def write(
    tests: VirtualTests,
    folder: str | Path,
    format: Format = "csv",
    *,
    overwrite: bool = False,
) -> Path:
    """Write the files that a campaign leaves, and the truth beside them.

    Parameters
    ----------
    folder : path
        New or empty: logs, named after axis and manoeuvre, and campaign.toml. In its folder
        ``truth`` lie truth.toml and the parameters that were simulated.
    format : {"csv", "mat", "parquet"}
        Of the logs. A .mat file (version 5) holds one matrix ``data`` whose rows are the columns of
        the others, as the source kept its logs, and ``rows``, their names.
    overwrite : bool
        Allow a folder that holds something, and replace files of the same names.

    Returns
    -------
    path
        Of campaign.toml, written last: where it is, everything is.

    Raises
    ------
    FileError
        If the folder is not empty or something cannot be written.
    InputError
        For another format.
    """
    if format not in get_args(Format):
        raise InputError(f"format is {format!r}; it is one of {', '.join(get_args(Format))}.")
    place = _prepared(Path(folder), overwrite)
    for run in tests.runs.values():
        note = _note(tests, run)
        write_whole(place / f"{run.stem}.{format}", _WRITERS[format](run, note))
    if tests.preset is None:
        tests.nominal.to_toml(place / DRIVE_FILE)
    tests.drive.to_toml(place / "truth" / DRIVE_FILE)
    write_text(truth_text(tests), place / "truth" / "truth.toml")
    campaign = place / "campaign.toml"
    write_text(campaign_text(tests, format), campaign)
    return campaign


def _prepared(place: Path, overwrite: bool) -> Path:
    """The folder, made if need be."""
    try:
        if place.exists() and not place.is_dir():
            raise FileError(f"{place} is a file; name a folder.")
        if place.is_dir() and not overwrite and any(place.iterdir()):
            raise FileError(f"{place} is not empty; name a new folder, or allow overwriting.")
        (place / "truth").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"{place} cannot be written: {error.strerror or error}.") from None
    return place


def _note(tests: VirtualTests, run: VirtualRun) -> str:
    refinements = ", ".join(tests.drive.parameters.refinements) or "none"
    return (
        f"virtual: simulated by swashplate {__version__}, no measurement; axis {tests.axis}, "
        f"{run.name}, instruments {tests.severity}, refinements {refinements}, seed {tests.seed}"
    )


def frame(columns: Mapping[str, Array]) -> polars.DataFrame:
    """Columns as a table: an empty cell for NaN, whole numbers for an encoder that counts them."""
    import polars as pl

    table = pl.DataFrame(dict(columns), nan_to_null=True)
    if "counts" in columns and np.array_equal(
        columns["counts"], np.rint(columns["counts"]), equal_nan=True
    ):
        table = table.with_columns(pl.col("counts").cast(pl.Int64))
    return table


def _csv(run: VirtualRun, note: str) -> Callable[[Path], None]:
    def write_csv(path: Path) -> None:
        with path.open("wb") as file:
            file.write(f"# {note}\n".encode())
            frame(run.columns).write_csv(file)

    return write_csv


def _parquet(run: VirtualRun, note: str) -> Callable[[Path], None]:
    return lambda path: frame(run.columns).write_parquet(
        path, metadata={"virtual": note.removeprefix("virtual: ")}
    )


def _mat(run: VirtualRun, note: str) -> Callable[[Path], None]:
    from scipy.io import savemat

    content = {
        "virtual": note,
        "rows": ", ".join(run.columns),
        "data": np.vstack(list(run.columns.values())),
    }

    def write_mat(path: Path) -> None:
        memory = BytesIO()
        savemat(memory, content)
        whole = bytearray(memory.getvalue())
        # SciPy puts the time of day there, and the same seed would not give the same file
        text = "MATLAB 5.0 MAT-file, virtual test by swashplate"
        whole[:MAT_HEADER] = text.ljust(MAT_HEADER).encode("ascii")
        path.write_bytes(whole)

    return write_mat


_WRITERS: Mapping[str, Callable[[VirtualRun, str], Callable[[Path], None]]] = {
    "csv": _csv,
    "mat": _mat,
    "parquet": _parquet,
}


def campaign_text(tests: VirtualTests, ending: str) -> str:
    """The campaign file of tests whose logs have an ending, such as "csv".

    The input is joined by straight lines, because that is what was simulated between two samples.
    """
    refinements = ", ".join(tests.drive.parameters.refinements) or "none"
    drive = tests.preset or DRIVE_FILE
    lines = [
        f"# Virtual tests, simulated by swashplate {__version__}: nothing here was measured.",
        f"# Instruments: {tests.severity}; refinements: {refinements}; seed {tests.seed}.",
        "# What was simulated stands in truth/truth.toml: look only after the fit.",
        f"title = {dumps(f'Virtual tests, {tests.axis}', ensure_ascii=False)}",
        "virtual = true",
        "",
        f"[axes.{_key(tests.axis)}]",
        f'drive = "{drive}"    # the model that a fit starts from',
        f'time = {{ column = {_column(tests, ending, "time")}, unit = "s" }}',
        'start = "rest"',
        "",
        f"[axes.{_key(tests.axis)}.input]",
        'kind = "voltage"',
        f"column = {_column(tests, ending, 'voltage')}",
        'unit = "V"',
        'interpolation = "linear"',
        *_missing(tests),
    ]
    for kind in tests.channels:
        column = COLUMNS.get(kind, kind)
        lines += ["", f"[axes.{_key(tests.axis)}.channels.{column}]", f'kind = "{kind}"']
        lines.append(f"column = {_column(tests, ending, column)}")
        if kind == "encoder_counts":
            lines.append(f"counts_per_turn = {tests.counts_per_turn!r}    # of the shaft")
            if tests.instruments.counter_bits:
                lines.append(f"rolls_over_at = {2**tests.instruments.counter_bits}")
        else:
            lines.append(f'unit = "{KINDS[kind].units[0]}"')
        lines += _missing(tests)
    for run in tests.runs.values():
        lines += ["", "[[runs]]", f'file = "{run.stem}.{ending}"', f'role = "{run.role}"']
    return "\n".join(lines) + "\n"


def _key(axis: str) -> str:
    """A name as a key of TOML, whose strings are escaped as those of JSON."""
    return axis if fullmatch(r"[A-Za-z0-9_-]+", axis) else dumps(axis, ensure_ascii=False)


def _missing(tests: VirtualTests) -> list[str]:
    if not tests.instruments.empty_cells:
        return []
    return ['missing = "drop"    # cells without a number']


def _column(tests: VirtualTests, ending: str, name: str) -> str:
    """What a column is called in the log; the rows of a matrix have only numbers, from 1 on."""
    if ending != "mat":
        return f'"{name}"'
    names = ["time", "voltage", *(COLUMNS.get(kind, kind) for kind in tests.channels)]
    return f'"data({names.index(name) + 1},:)"'


def truth_text(tests: VirtualTests) -> str:
    """What was simulated: instruments, seed and versions; the drive has its own file."""
    from tomlkit import comment, document, table

    text = document()
    text.add(comment("The truth behind the virtual tests beside this folder."))
    text.add("virtual", True)
    text.add("axis", tests.axis)
    text.add("drive", DRIVE_FILE)
    text.add("severity", tests.severity)
    text.add("seed", tests.seed)
    text.add("counts_per_turn", tests.counts_per_turn)
    text.add("runs", list(tests.runs))
    for name, values in (
        ("instruments", asdict(tests.instruments)),
        (
            "versions",
            {
                "swashplate": __version__,
                "numpy": version("numpy"),
                "numba": version("numba"),
                "python": python_version(),
            },
        ),
    ):
        entries = table()
        for key, value in values.items():
            entries.add(key, value)
        text.add(name, entries)
    return text.as_string()
