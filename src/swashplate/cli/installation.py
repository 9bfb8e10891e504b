"""``swashplate doctor``: versions of this installation, and whether it works."""

from __future__ import annotations

import platform
import sys
from importlib import metadata
from importlib.util import find_spec
from math import degrees
from pathlib import Path

import typer

from swashplate.__about__ import __version__
from swashplate.cli.commands import command
from swashplate.cli.terminal import note, say, show, spinner
from swashplate.environment import COMPILE, compiles
from swashplate.executors import available_cores
from swashplate.tables import Column, Table

LIBRARIES = ("numpy", "scipy", "llvmlite", "polars", "pydantic", "matplotlib", "jinja2", "h5py")
"""Whose versions matter when a result or a figure differs."""
EXTRAS = {
    "binaries": ("ziglang", "exports of user-defined equations for every platform"),
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
WITHOUT_BYTE_CODE = (
    "not stored for {names}: every start compiles their source again, which takes seconds. Run "
    "'python -m compileall -q' on the folder of the installed packages, or unset "
    "PYTHONDONTWRITEBYTECODE"
)
"""{names} are those of the libraries, or the package itself."""

app = typer.Typer(rich_markup_mode="rich")


@command(app, "doctor", examples="swashplate doctor", units=False)
def doctor() -> None:
    """Show versions, cores, compiled code and extras, and check a simulation.

    Paste the output into a question or a problem report. Exit code 1: the
    simulation does not give the published speed.
    """
    table = Table("", (Column("component"), Column("value"), Column("enables", wrap=True)))
    table.add("swashplate", __version__, "")
    table.add("Python", platform.python_version(), "")
    table.add("system", f"{platform.system()} {platform.machine()}", "")
    table.add("cores", str(available_cores()), "")
    if not compiles():
        table.add(
            COMPILE,
            "0",
            "nothing is compiled; everything is about a hundred times slower",
        )
    if sys.dont_write_bytecode and (names := _without_byte_code()):
        table.add("byte code", "-", WITHOUT_BYTE_CODE.format(names=", ".join(names)))
    extras = {f"extra {name}": entry for name, entry in EXTRAS.items()}
    for entry_name, (library, enables) in {
        **{e: (e, "") for e in LIBRARIES},
        **extras,
    }.items():
        try:
            table.add(entry_name, metadata.version(library), enables)
        except metadata.PackageNotFoundError:
            table.add(entry_name, "-", enables)
    show(table)
    with spinner("Simulating the hoist"):
        from swashplate.drive import Drive
        from swashplate.machine.cache import cache_folder, no_cache_reason
        from swashplate.maneuvers import step

        run = Drive.preset("hoist").simulate(step(9.0, start=0.0, stop=10.0, length=10.0))
    speed = degrees(float(run.shaft_speed[-1]))
    well = abs(speed - FULL_SPEED_DEG_S) < DIGITS
    outcome = "as published." if well else f"but {FULL_SPEED_DEG_S} deg/s is published."
    say(f"A step of 9 V takes the hoist to {speed:.1f} deg/s, {outcome}")
    note(f"Installed in {sys.prefix}")
    cache = cache_folder()
    if cache is None:
        note(no_cache_reason())
    else:
        sizes = [path.stat().st_size for path in cache.rglob("*.nbc")]
        note(f"Compiled code: {len(sizes)} files, {sum(sizes) / 1e6:.1f} MB, below {cache}")
    if not well:
        raise typer.Exit(1)


def _without_byte_code() -> list[str]:
    """Packages whose modules were never compiled to byte code, or were before they changed.

    An installer may have left it out, as container images do to be small.
    """
    specs = {name: find_spec(name) for name in ("swashplate.cli.installation", *LIBRARIES)}
    return [
        name.partition(".")[0]
        for name, spec in specs.items()
        if spec is not None and spec.cached is not None and not Path(spec.cached).exists()
    ]
