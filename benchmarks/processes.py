"""Rows of the table that are measured in processes of their own: memory, files, commands."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

import numpy as np
import polars as pl
from cases import RATE, SETS
from table import Row, duration, size
from timing import seconds

from swashplate import maneuvers

WORKER = Path(__file__).parent / "worker.py"
HOUR = 3600.0


def work(*job: str, environment: Mapping[str, str] | None = None) -> dict[str, float]:
    """What a job of worker.py finds."""
    command = [sys.executable, str(WORKER), *job]
    process = subprocess.run(
        command, check=True, stdout=subprocess.PIPE, env={**os.environ, **(environment or {})}
    )
    return json.loads(process.stdout)


def limited(what: str, found: float, limit: float, text: str, target: str) -> Row:
    """A row with an upper limit."""
    return Row(what, text, "", target, found < limit)


def memory_rows() -> Iterator[Row]:
    """Memory of a batch that keeps only costs."""
    for what, length in (("30 s", 30.0), ("30 min", 1800.0)):
        found = work("batch", str(length))
        beyond = max(found["growth"] - found["record"], 0.0)
        record = size(found["record"])
        yield Row(
            f"memory of {SETS:,} costs over {what}, beyond the record's {record}", size(beyond)
        )


def hour_rows() -> Iterator[Row]:
    """One hour at 512 Hz: simulated, read and written."""
    with TemporaryDirectory() as folder:
        voltage = maneuvers.sine(6.5, 0.1, length=HOUR).sample(RATE)
        log = pl.DataFrame({"time": np.arange(voltage.size) / RATE, "voltage": voltage})
        log.write_csv(Path(folder) / "log.csv")
        found = work("hour", folder)
        written = (Path(folder) / "result.csv").stat().st_size
    for what, key, limit in (
        ("one hour, `simulate` and speed", "simulate", 0.2),
        ("one hour, log read from CSV", "read", 5.0),
        (f"one hour, all signals written to CSV ({size(written)})", "write", 5.0),
    ):
        yield limited(what, found[key], limit, duration(found[key]), f"< {limit:g} s")
    yield limited(
        "one hour, memory of the whole process", found["peak"], 1e9, size(found["peak"]), "< 1 GB"
    )


def command_rows() -> Iterator[Row]:
    """The command line, from its start to its end."""
    with TemporaryDirectory() as folder:
        for arguments, limit in ((("--help",), 0.5), (("simulate", "hoist", "step:9"), 1.5)):
            command = (sys.executable, "-m", "swashplate", *arguments)
            what = f"`swashplate {' '.join(arguments)}`"
            if _answers(command, folder):
                wall = median(seconds(partial(_answers, command, folder)) for _ in range(7))
                yield limited(what, wall, limit, duration(wall), f"< {limit:g} s")
            else:
                yield Row(what, "fails", "", f"< {limit:g} s", False)


def _answers(command: Sequence[str], folder: str) -> bool:
    return subprocess.run(command, capture_output=True, cwd=folder, check=False).returncode == 0


def first_use_rows() -> Iterator[Row]:
    """A first simulation in a new process, without and with a cache of compiled code."""
    with TemporaryDirectory() as folder:
        environment = {"SWASHPLATE_CACHE_DIR": folder}
        for what in ("empty cache: compiled", "cached"):
            found = work("first", environment=environment)
            yield Row(f"first simulation of a process, {what}", duration(found["first"]))
