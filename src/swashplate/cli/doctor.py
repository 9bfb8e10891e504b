"""``swashplate doctor``: what this installation consists of, and whether it works."""

from __future__ import annotations

import os
import platform
import sys
from importlib import metadata

import typer

from swashplate.__about__ import __version__
from swashplate.cli.terminal import note, say, show, working
from swashplate.executors import available_cores
from swashplate.tables import Column, Table

LIBRARIES = ("numpy", "scipy", "numba", "polars", "pydantic", "matplotlib", "jinja2", "h5py")
"""Whose versions matter when a result or a figure differs."""
EXTRAS = {
    "binaries": ("ziglang", "exports of equations of one's own for every platform"),
    "dask": ("distributed", "fit --dask: many starts on a cluster"),
    "fmu": ("fmpy", "an FMU compared with the drive, export.compare"),
    "mdf": ("asammdf", "logs in ASAM MDF 4 (.mf4)"),
    "mpc": ("osqp", "the example of predictive control of a crane"),
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
    made = Table("", (Column("what"), Column("found"), Column("enables", wrap=True)))
    made.add("swashplate", __version__, "")
    made.add("Python", platform.python_version(), "")
    made.add("system", f"{platform.system()} {platform.machine()}", "")
    made.add("cores", str(available_cores()), "")
    if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        made.add("NUMBA_DISABLE_JIT", "set", "nothing is compiled, all is a hundred times slower")
    for library in LIBRARIES:
        made.add(library, _version(library), "")
    for name, (library, enables) in EXTRAS.items():
        made.add(f"extra {name}", _version(library), enables)
    show(made)
    with working("Simulating the hoist"):
        speed = _simulated()
    well = abs(speed - FULL_SPEED_DEG_S) < DIGITS
    say(
        f"A step of 9 V takes the hoist to {speed:.1f} deg/s, "
        + ("as published." if well else f"but {FULL_SPEED_DEG_S} deg/s is published.")
    )
    note(f"Installed in {sys.prefix}")
    note(_kernels())
    if not well:
        raise typer.Exit(1)


def _version(library: str) -> str:
    try:
        return metadata.version(library)
    except metadata.PackageNotFoundError:
        return "-"


def _simulated() -> float:
    """Speed at the end of the step. [deg/s]"""
    from math import degrees

    from swashplate.drive import Drive
    from swashplate.maneuvers import step

    run = Drive.preset("hoist").simulate(step(9.0, start=0.0, stop=10.0, length=10.0))
    return degrees(float(run.shaft_speed[-1]))


def _kernels() -> str:
    """Where the machine code is kept, and how much of it."""
    from swashplate.equations.cache import UNCACHED, cache_folder

    kept = cache_folder()
    if kept is None:
        return UNCACHED
    files = list(kept.rglob("*.nbc"))
    size = sum(each.stat().st_size for each in files)
    return f"Compiled kernels: {len(files)} files, {size / 1e6:.1f} MB, below {kept}"
