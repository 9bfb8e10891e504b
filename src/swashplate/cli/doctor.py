"""``swashplate doctor``: what this installation consists of, and whether it works."""

from __future__ import annotations

import os
import platform
import sys
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

import typer

from swashplate.__about__ import __version__
from swashplate.cli.terminal import note, say, show, working
from swashplate.tables import Column, Table

LIBRARIES = ("numpy", "scipy", "numba", "polars", "pydantic", "matplotlib", "jinja2", "h5py")
"""Whose versions matter when a result or a figure differs."""


class Extra(NamedTuple):
    """An optional extra of the package."""

    name: str
    library: str
    enables: str


EXTRAS = (
    Extra("binaries", "ziglang", "exports of equations of one's own for every platform"),
    Extra("control", "control", "linear models as python-control's StateSpace"),
    Extra("dask", "distributed", "fit --dask: many starts on a cluster"),
    Extra("fmu", "fmpy", "an FMU compared with the drive, export.compare"),
    Extra("mdf", "asammdf", "logs in ASAM MDF 4 (.mf4)"),
    Extra("tdms", "npTDMS", "logs in National Instruments' TDMS"),
)
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
    show(_versions(), _machine(), _extras())
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


def _versions() -> Table:
    made = Table("Versions", (Column("what"), Column("version")))
    made.add("swashplate", __version__)
    made.add("Python", f"{platform.python_version()} ({platform.python_implementation()})")
    for library in LIBRARIES:
        made.add(library, _version(library) or "missing: install swashplate again")
    return made


def _machine() -> Table:
    made = Table("Machine", (Column("what"), Column("found")))
    made.add("system", f"{platform.system()} {platform.machine()}")
    made.add("cores", _cores())
    threads = os.environ.get("OPENBLAS_NUM_THREADS")
    if threads:
        made.add("OPENBLAS_NUM_THREADS", threads)
    if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        made.add("NUMBA_DISABLE_JIT", "set: nothing is compiled, all is a hundred times slower")
    made.add("installed in", str(Path(sys.prefix)))
    return made


def _cores() -> str:
    there = os.cpu_count() or 1
    given = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else there
    return f"{there}" if given == there else f"{given} of {there} given to this process"


def _extras() -> Table:
    columns = (Column("name"), Column("version"), Column("enables"))
    made = Table("Extras: pip install 'swashplate[NAME]'", columns)
    for extra in EXTRAS:
        made.add(extra.name, _version(extra.library) or "-", extra.enables)
    return made


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
