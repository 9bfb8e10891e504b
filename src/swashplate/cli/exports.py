"""``swashplate export`` and ``live``: a drive, or a machine of one's own, outside Python."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from swashplate.cli.commands import command
from swashplate.cli.options import (
    NO_VALUE,
    AxisOption,
    Force,
    MachineChoice,
    new_file,
    new_folder,
)
from swashplate.cli.parsing import campaign_of, drive_file, key_numbers_of
from swashplate.cli.terminal import check_free, note, save, spinner
from swashplate.cli.trials import commanded_inputs, named_maneuver
from swashplate.errors import InputError
from swashplate.tables import PAGE, Form, check_folder

if TYPE_CHECKING:
    from swashplate.cli.machines import OwnMachine
    from swashplate.drive import Drive
    from swashplate.machine import Machine

FMU = Form("an FMU", (".fmu",))
WASM = Form("WebAssembly", (".wasm",))


app = typer.Typer(rich_markup_mode="rich")


@dataclass(frozen=True)
class ExportFiles:
    """What is written of an exported machine, and how."""

    fmu: Annotated[Path | None, new_file(FMU, "FMU for co-simulation.", metavar="FILE.fmu")] = None
    c: Annotated[
        Path | None,
        new_folder("New or empty folder for C source with the machine's numbers.", "*"),
    ] = None
    wasm: Annotated[
        Path | None,
        new_file(WASM, "WebAssembly with the machine's numbers.", metavar="FILE.wasm"),
    ] = None
    fmi: Annotated[
        Literal["2", "2.0", "3", "3.0"], typer.Option(help="FMI version of the FMU.")
    ] = "2.0"
    step: Annotated[
        float | None,
        typer.Option(
            metavar="S",
            help=(
                "Internal step, of a drive at most 1/512 s; independent of the communication step "
                "(default: 1/512 s, or the step that 'swashplate simulate' takes)."
            ),
        ),
    ] = None
    platforms: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,NAME",
            help="Platforms of the FMU (default: all): linux64, aarch64-linux, win64, darwin64.",
        ),
    ] = None
    compile: Annotated[
        bool,
        typer.Option(
            "--compile", metavar=NO_VALUE, help="Also compile the C source for this machine."
        ),
    ] = False

    def check(self, *, force: bool) -> None:
        """Refuse options that contradict each other, and a folder that is not free."""
        if self.fmu is None and self.c is None and self.wasm is None:
            raise InputError("Choose what to export: --fmu FILE.fmu, --c DIR or --wasm FILE.wasm.")
        if self.compile and self.c is None:
            raise InputError("--compile compiles the C source; name its folder with --c DIR.")
        if self.fmu is None and self.platforms is not None:
            raise InputError("--platforms applies only to an FMU; name it with --fmu FILE.fmu.")
        if self.c is not None:
            check_folder(self.c)
            check_free(self.c, force=force)

    def write(self, machine: Drive | Machine, usual_step: float) -> None:
        """Write a machine in steps of `usual_step` [s], unless others are stated."""
        from swashplate import export as exporting

        step = usual_step if self.step is None else self.step
        platforms = self.platforms
        names = None if platforms is None else [part.strip() for part in platforms.split(",")]
        with texts_of_warnings():
            if self.fmu is not None:
                version: Literal["2.0", "3.0"] = "2.0" if self.fmi.startswith("2") else "3.0"
                save(
                    self.fmu,
                    f"FMU {version}",
                    lambda path: exporting.fmu(
                        machine, path, fmi=version, step=step, platforms=names
                    ),
                )
            if self.c is not None:
                _export_c(machine, self.c, step, compile=self.compile)
            if self.wasm is not None:
                save(
                    self.wasm, "WebAssembly", lambda path: exporting.wasm(machine, path, step=step)
                )


@command(
    app,
    "export",
    examples="""
        swashplate export hoist --fmu hoist.fmu
        swashplate export fitted/ --fmu winch.fmu --fmi 3.0 --platforms linux64,win64
        swashplate export mine.toml --c folder
        swashplate export hoist --set tau=10ms --step 0.001 --fmu hoist.fmu
        swashplate export hoist --wasm hoist.wasm
        swashplate export valve.py --fmu valve.fmu --set gain=0.03
    """,
)
def export(machine: MachineChoice, files: ExportFiles, *, force: Force = False) -> None:
    """Export a drive, or a machine of your own, as FMU, C source or WebAssembly.

    An FMU of a drive needs no Python and no compiler, neither to write it nor to
    run it: the package contains its libraries. A machine of your own is compiled
    when it is exported.
    """
    files.check(force=force)
    with spinner("Exporting"):
        from swashplate import export as exporting

        own = machine.own
        exported = machine.loaded_drive if own is None else own.machine
    files.write(exported, exporting.LONGEST_STEP if own is None else 1.0 / own.steps_a_second())
    machine.warn()
    for line in machine.changes:
        note(line)
    if own is not None and own.stated:
        note(f"What is exported starts at rest: {', '.join(sorted(own.stated))} left out.")


def _export_c(drive: Drive | Machine, folder: Path, step: float, *, compile: bool) -> None:
    """Write the C source of a machine, compile it if it is asked for, and name the files."""
    from swashplate import export as exporting

    with spinner(f"Writing {folder}"):
        files = exporting.c(drive, folder, step)
        if compile:
            headers = [file.name for file in files if file.suffix == ".h"]
            (header,) = (name for name in headers if not name.endswith("_values.h"))
            files.append(exporting.compiled_c(folder, header))
    for file in files:
        note(f"C: {file}")


@contextmanager
def texts_of_warnings() -> Iterator[None]:
    """Print what the export warns of, each once."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield
    for text in dict.fromkeys(str(warning.message) for warning in caught):
        note(f"Note: {text}")


@command(
    app,
    "live",
    examples="""
        swashplate live fitted harbour/campaign.toml
        swashplate live hoist --maneuver step:9 --out hoist.html
        swashplate live fitted harbour/campaign.toml --scale orifice=1.5
        swashplate live valve.py --maneuver step:2 --measured supply=100
    """,
)
def live(
    drive: MachineChoice,
    path: Annotated[
        Path | None,
        typer.Argument(
            metavar="CAMPAIGN.toml", help="Campaign of tests to show with their simulation."
        ),
    ] = None,
    *,
    axis: AxisOption = None,
    maneuver: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Maneuver to simulate in place of tests: step:9."),
    ] = None,
    measured: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=NUMBER",
            help=(
                "Further input of a machine of your own, a number in SI units or a maneuver; may "
                "be repeated."
            ),
        ),
    ] = None,
    out: Annotated[Path, new_file(PAGE, "Page: .html.")] = Path("live.html"),
    force: Force = False,
) -> None:
    """Write a page that simulates a machine, with sliders for its parameters.

    A single file that works offline: open it in a browser, move a slider, and
    the simulated curves, their errors and the limits follow. Changed values are
    listed as lines for the drive's parameter file, or as options of the other
    commands. A machine of your own is compiled and shows a maneuver.
    """
    if drive.own is not None:
        _own_live_page(drive.own, path, maneuver, measured or (), out)
        return
    if measured:
        raise InputError("--measured is for a machine of your own; a drive shows --maneuver alone.")
    if (path is None) == (maneuver is None):
        raise InputError("Name either a campaign, or a maneuver with --maneuver.")
    with spinner("Writing the page"):
        from swashplate.report.fit_report import write_live_page

        numbers = key_numbers_of(drive.drive, drive.loaded_drive)
        parameter_file = drive_file(drive.drive)
        name = (
            str(parameter_file)
            if parameter_file is not None
            else "your copy of it, --toml of 'swashplate show'"
        )
        if path is not None:
            campaign, axis_name = campaign_of(path, axis)
            sentences = write_live_page(
                drive.loaded_drive,
                out,
                campaign=campaign,
                axis=axis_name,
                name=name,
                key_numbers=numbers,
            )
        else:
            command = named_maneuver(maneuver or "", drive.loaded_drive)
            sentences = write_live_page(
                drive.loaded_drive, out, command=command, name=name, key_numbers=numbers
            )
    drive.warn()
    _note_page(out, [*drive.changes, *sentences])


def _own_live_page(
    own: OwnMachine, path: Path | None, maneuver: str | None, measured: Sequence[str], out: Path
) -> None:
    """Write the live page of a machine of a user's own under a maneuver."""
    if path is not None or maneuver is None:
        raise InputError(
            f"{own.title}: the live page of a machine of your own shows a maneuver, not tests: "
            "write --maneuver step:2."
        )
    with spinner("Writing the page"):
        from swashplate.report.fit_report import write_machine_page

        rate = own.steps_a_second()
        inputs = commanded_inputs(own, maneuver, measured, rate)
        sentences = write_machine_page(own.machine, out, inputs, rate)
    if own.stated:
        sentences += (f"The page starts at rest: {', '.join(sorted(own.stated))} left out.",)
    _note_page(out, [*own.changes, *sentences])


def _note_page(out: Path, sentences: Iterable[str]) -> None:
    """Say what a page leaves out or changes, and where it is."""
    for sentence in sentences:
        note(sentence)
    note(f"Page: {out} ({out.stat().st_size / 1e3:.0f} kB)")
