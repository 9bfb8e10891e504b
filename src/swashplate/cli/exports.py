"""``swashplate export`` and ``live``: a drive where there is no Python."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Literal

from swashplate.cli.options import AxisName, DriveChoice
from swashplate.cli.terminal import check_free, note, save, working
from swashplate.cli.words import campaign_of, drive_file, maneuver_of
from swashplate.errors import InputError
from swashplate.tables import PAGE, Form, check_folder

FMU = Form("an FMU", (".fmu",))
WASM = Form("WebAssembly", (".wasm",))


def export(
    drive: DriveChoice,
    *,
    fmu: Annotated[Path | None, FMU] = None,
    c: Path | None = None,
    wasm: Annotated[Path | None, WASM] = None,
    fmi: Literal["2", "2.0", "3", "3.0"] = "2.0",
    step: float | None = None,
    platforms: str | None = None,
    compile: bool = False,
) -> None:
    """Take a drive along: as an FMU, as C source, or as WebAssembly.

    An FMU needs neither Python nor a compiler where it runs, and none is
    needed to write it: the package brings its libraries along.

    Options:
      fmu FILE.fmu: An FMU for co-simulation.
      c DIR: C source with the drive's numbers, in a folder of its own.
      wasm FILE.wasm: WebAssembly with the drive's numbers.
      fmi: Version of the standard for the FMU.
      step S: The drive's own step, at most 1/512 s, whatever the master's is.
      platforms NAME,NAME: Machines that the FMU is for: linux64, aarch64-linux, win64, darwin64;
          all by default.
      compile: Compile the C source for this machine, too.

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
            save(
                fmu,
                f"FMU {version}",
                lambda path: exporting.fmu(chosen, path, fmi=version, step=own, platforms=names),
            )
        if c is not None:
            with working(f"Writing {c}"):
                written = exporting.c(chosen, c, own)
                if compile:
                    (header,) = (each.name for each in written if each.name.endswith("drive.h"))
                    written.append(exporting.compiled_c(c, header))
            for made in written:
                note(f"C: {made}")
        if wasm is not None:
            save(wasm, "WebAssembly", lambda path: exporting.wasm(chosen, path, step=own))
    drive.warn()
    for line in drive.changes:
        note(line)


@contextmanager
def said() -> Iterator[None]:
    """Print what the export warns of, each once."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        yield
    for text in dict.fromkeys(str(each.message) for each in found):
        note(f"Note: {text}")


def live(
    drive: DriveChoice,
    path: Path | None = None,
    *,
    axis: AxisName = None,
    maneuver: str | None = None,
    out: Annotated[Path, PAGE] = Path("live.html"),
) -> None:
    """Write a page in which the drive runs, with sliders for its parameters.

    One file that works offline: open it in a browser, move a slider, and the
    simulated curves, their errors and the limits follow. Changed values stand
    below as lines to put into the drive's file.

    Options:
      path CAMPAIGN.toml: Tests that are shown beside what the drive makes of them.
      maneuver NAME: A maneuver instead of tests, such as step:9.
      out FILE: The page, .html.

    For example:
      swashplate live fitted harbour/campaign.toml
      swashplate live hoist --maneuver step:9 --out hoist.html
      swashplate live fitted harbour/campaign.toml --scale orifice=1.5
    """
    if (path is None) == (maneuver is None):
        raise InputError("Name a campaign, or a maneuver with --maneuver; one of them.")
    with working("Writing the page"):
        from swashplate.report.fit_report import write_live_page

        place = drive_file(drive.drive)
        name = str(place) if place is not None else "your copy of it, --toml of 'swashplate show'"
        if path is not None:
            campaign, chosen = campaign_of(path, axis)
            said = write_live_page(drive.chosen, out, campaign=campaign, axis=chosen, name=name)
        else:
            command = maneuver_of(maneuver or "", drive.chosen)
            said = write_live_page(drive.chosen, out, command=command, name=name)
    drive.warn()
    for sentence in (*drive.changes, *said):
        note(sentence)
    note(f"Page: {out} ({out.stat().st_size / 1e3:.0f} kB)")
