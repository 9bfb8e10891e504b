"""``swashplate export``: a drive where there is no Python."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Literal

from swashplate.cli.options import DriveChoice, option
from swashplate.cli.terminal import Outputs, check_free, note, working
from swashplate.errors import InputError
from swashplate.tables import Form, check_folder

FMU = Form("an FMU", (".fmu",))
WASM = Form("WebAssembly", (".wasm",))


def export(
    drive: DriveChoice,
    fmu: Annotated[
        Path | None, option("An FMU for co-simulation.", "--fmu", metavar="FILE.fmu")
    ] = None,
    c: Annotated[
        Path | None,
        option("C source with the drive's numbers, in a folder of its own.", "--c", metavar="DIR"),
    ] = None,
    wasm: Annotated[
        Path | None,
        option("WebAssembly with the drive's numbers.", "--wasm", metavar="FILE.wasm"),
    ] = None,
    fmi: Annotated[
        Literal["2", "2.0", "3", "3.0"], option("Version of the standard for the FMU.")
    ] = "2.0",
    step: Annotated[
        float | None,
        option("The drive's own step, at most 1/512 s, whatever the master's is.", metavar="S"),
    ] = None,
    platforms: Annotated[
        str | None,
        option(
            "Machines that the FMU is for: linux64, aarch64-linux, win64, darwin64; all by "
            "default.",
            metavar="NAME,NAME",
        ),
    ] = None,
    compile: Annotated[
        bool, option("Compile the C source for this machine, too.", "--compile")
    ] = False,
) -> None:
    """Take a drive along: as an FMU, as C source, or as WebAssembly.

    An FMU needs neither Python nor a compiler where it runs, and none is
    needed to write it: the package brings its libraries along.

    For example:
      swashplate export hoist --fmu hoist.fmu
      swashplate export fitted/ --fmu winch.fmu --fmi 3.0 --platforms linux64,win64
      swashplate export mine.toml --c folder
      swashplate export hoist --set tau=10ms --step 0.001 --fmu hoist.fmu
      swashplate export hoist --wasm hoist.wasm
    """
    if fmu is None and c is None and wasm is None:
        raise InputError("Say what to export: --fmu FILE.fmu, --c DIR or --wasm FILE.wasm.")
    if compile and c is None:
        raise InputError("--compile compiles the C source; name its folder with --c DIR.")
    if fmu is None and platforms is not None:
        raise InputError("--platforms is of an FMU; name it with --fmu FILE.fmu.")
    files = Outputs((fmu, FMU), (wasm, WASM))
    if c is not None:
        check_folder(c)
        check_free(c)
    with working("Exporting"):
        from swashplate import export as exporting

        chosen = drive.chosen
        own = exporting.LONGEST_STEP if step is None else step
        names = None if platforms is None else [each.strip() for each in platforms.split(",")]
        with said():
            if fmu is not None:
                version: Literal["2.0", "3.0"] = "2.0" if fmi.startswith("2") else "3.0"
                files.write(
                    fmu,
                    f"FMU {version}",
                    lambda path: exporting.fmu(
                        chosen, path, fmi=version, step=own, platforms=names
                    ),
                )
            if c is not None:
                written = exporting.c(chosen, c, own)
                if compile:
                    (header,) = (each.name for each in written if each.name.endswith("drive.h"))
                    written.append(exporting.compiled_c(c, header))
                for made in written:
                    note(f"C: {made}")
            if wasm is not None:
                files.write(
                    wasm, "WebAssembly", lambda path: exporting.wasm(chosen, path, step=own)
                )
    for line in drive.changes:
        note(line)
    files.say()


@contextmanager
def said() -> Iterator[None]:
    """Print what the export warns of, each once."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        yield
    for text in dict.fromkeys(str(each.message) for each in found):
        note(f"Note: {text}")
