"""``swashplate doctor``: what this installation consists of, and whether it works."""

from __future__ import annotations

import os
import platform
import sys
from importlib import metadata
from pathlib import Path

import typer

from swashplate.__about__ import __version__
from swashplate.cli.terminal import note, say, show, working
from swashplate.tables import Column, Table

LIBRARIES = ("numpy", "scipy", "numba", "polars", "pydantic", "matplotlib", "jinja2", "h5py")
"""Whose versions matter when a result or a figure differs."""


EXTRAS = {
    "binaries": ("ziglang", "exports of equations of one's own for every platform"),
    "control": ("control", "linear models as python-control's StateSpace"),
    "dask": ("distributed", "fit --dask: many starts on a cluster"),
    "fmu": ("fmpy", "an FMU compared with the drive, export.compare"),
    "mdf": ("asammdf", "logs in ASAM MDF 4 (.mf4)"),
    "tdms": ("npTDMS", "logs in National Instruments' TDMS"),
}
"""Library of each optional extra, and what it enables."""
FULL_SPEED_DEG_S = 196.0
"""At which the published hoist's step of 9 V ends: the swash plate's stop times Z10. [deg/s]"""
DIGITS = 0.05
"""Half a unit of its last digit. [deg/s]"""


def doctor() -> None:
    """Show versions, cores, compiled kernels and extras, and simulate once.

    Paste what it prints into a question or a report of a problem. Exit code 1
    if the simulation does not give the published speed.

    For example:
      swashplate doctor
    """
    show(*_tables())
    with working("Simulating the hoist"):
        speed, seconds = _simulated()
    well = abs(speed - FULL_SPEED_DEG_S) < DIGITS
    say(
        f"A step of 9 V takes the hoist to {speed:.1f} deg/s, "
        + ("as published." if well else f"but {FULL_SPEED_DEG_S} deg/s is published.")
        + f" First simulation of this process: {seconds:.2f} s."
    )
    note(_kernels())
    if not well:
        raise typer.Exit(1)


def _version(library: str) -> str | None:
    try:
        return metadata.version(library)
    except metadata.PackageNotFoundError:
        return None


def _tables() -> tuple[Table, Table, Table]:
    """Versions, machine and extras."""
    there = os.cpu_count() or 1
    given = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else there
    versions = Table("Versions", (Column("what"), Column("version")))
    versions.add("swashplate", __version__)
    versions.add("Python", f"{platform.python_version()} ({platform.python_implementation()})")
    for library in LIBRARIES:
        versions.add(library, _version(library) or "missing: install swashplate again")
    machine = Table("Machine", (Column("what"), Column("found")))
    machine.add("system", f"{platform.system()} {platform.machine()}")
    machine.add("cores", f"{given} of {there} given to this process")
    if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        machine.add("NUMBA_DISABLE_JIT", "set: nothing is compiled, all is a hundred times slower")
    machine.add("installed in", str(Path(sys.prefix)))
    columns = (Column("name"), Column("version"), Column("enables"))
    extras = Table("Extras: pip install 'swashplate[NAME]'", columns)
    for name, (library, enables) in EXTRAS.items():
        extras.add(name, _version(library) or "-", enables)
    return versions, machine, extras


def _simulated() -> tuple[float, float]:
    """Speed at the end of the step [deg/s], and how long it took [s]."""
    from math import degrees
    from time import perf_counter

    from swashplate.drive import Drive
    from swashplate.maneuvers import step

    begin = perf_counter()
    run = Drive.preset("hoist").simulate(step(9.0, start=0.0, stop=10.0, length=10.0).sample())
    return degrees(float(run.shaft_speed[-1])), perf_counter() - begin


def _kernels() -> str:
    """Where the machine code is kept, and how much of it."""
    from swashplate.equations.cache import UNCACHED, cache_folder

    kept = cache_folder()
    if kept is None:
        return UNCACHED
    files = list(kept.rglob("*.nbc"))
    size = sum(each.stat().st_size for each in files)
    return f"Compiled kernels: {len(files)} files, {size / 1e6:.1f} MB, below {kept}"
