"""``swashplate full-order``: what the one-state model leaves out of a drive."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from swashplate.cli.arguments import (
    Clip,
    DriveWord,
    Factors,
    FileInterpolation,
    Rate,
    StartFrom,
    TimeColumn,
    Values,
    VoltageColumn,
)
from swashplate.cli.full_order_tables import (
    assumed_said,
    chosen_table,
    modes_table,
    physical_values,
    run_table,
    run_verdict,
    validity_rows,
    validity_verdict,
)
from swashplate.cli.inputs import Options, changes_said, drive_of, simulated, title_of
from swashplate.cli.outputs import check_outputs
from swashplate.cli.terminal import note, progress, say, show, working
from swashplate.errors import InputError
from swashplate.tables import FIGURE, TABLE

if TYPE_CHECKING:
    from rich.table import Table

    from swashplate.full_order import FullOrderDrive

Method = Literal["march", "radau"]

EXAMPLES = """\
Examples:
  swashplate full-order hoist
  swashplate full-order hoist step:9 --plot full.png
  swashplate full-order fitted/drive.toml sine:4,1 --like luff
  swashplate full-order hoist step:4 --physical load_torque=2kN*m --out run.csv
  swashplate full-order hoist log.csv --interpolation previous --method radau
"""


def full_order(
    drive: DriveWord,
    command: Annotated[
        str | None,
        typer.Argument(
            metavar="MANEUVER|FILE",
            help="A manoeuvre or a log, as in 'swashplate simulate'. Without one, a table of "
            "manoeuvres.",
            show_default=False,
        ),
    ] = None,
    like: Annotated[
        str | None,
        typer.Option(
            help="Packaged axis whose assumed physical values count; by default the drive's own, "
            "or else hoist.",
            metavar="AXIS",
            show_default=False,
        ),
    ] = None,
    physical: Annotated[
        list[str] | None,
        typer.Option(
            help="Another physical value: oil_volume=1e-4 in SI, oil_volume=100cm^3 with a unit. "
            "May be repeated.",
            metavar="NAME=VALUE",
        ),
    ] = None,
    method: Annotated[
        Method,
        typer.Option(help="How the five states are integrated: march, or radau to check it by."),
    ] = "march",
    out: Annotated[
        Path | None,
        typer.Option(
            help="Write the five states and both speeds, or without a command the table, to a .csv "
            "or .parquet file.",
            metavar="FILE",
        ),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            help="Draw both models under the command: .png, .svg or .pdf.", metavar="FILE"
        ),
    ] = None,
    values: Values = None,
    factors: Factors = None,
    rate: Rate = 512.0,
    interpolation: FileInterpolation = None,
    start: StartFrom = "rest",
    clip: Clip = False,
    time_column: TimeColumn = "time",
    column: VoltageColumn = "voltage",
) -> None:
    """Say whether one state is enough for a drive and a command.

    Gives spool and swash plate their mass back: a model with five states, whose
    physical values are completed from the drive's parameters and from assumed
    ones. Prints these, the modes, and by how much the speed of the one-state
    model differs. What is assumed can be replaced by what you know.
    """
    check_outputs((out, TABLE), (plot, FIGURE))
    if command is None and plot is not None:
        raise InputError("--plot draws one run; name a manoeuvre or a log, such as step:9.")
    if command is None and method != "march":
        raise InputError(
            f"--method {method} checks one run; name a manoeuvre or a log, such as step:9."
        )
    given = physical_values(physical or ())
    with working("Completing the physical values"):
        from swashplate.full_order import FullOrderDrive
        from swashplate.full_order.physical_set import nearest_set

        chosen = drive_of(drive, values or (), factors or ())
        axis = nearest_set(chosen.name) if like is None else like
        full = FullOrderDrive.from_drive(chosen.plain, axis, **given)
        tables = [chosen_table(axis, given), modes_table(full)]
    head = [*changes_said(drive, chosen), assumed_said(axis, given)]
    if chosen.parameters.refinements:
        listed = ", ".join(chosen.parameters.refinements)
        head.append(f"Left out of both models, which do not know refinements: {listed}.")
    title = title_of(drive, chosen)
    if command is None:
        _say_table(full, title, head, tables, rate, out)
    else:
        options = Options(rate, interpolation, start, clip, time_column, column)
        _say_run(full, title, head, tables, command, options, method, out=out, plot=plot)


def _say_table(
    full: FullOrderDrive,
    title: str,
    head: list[str],
    tables: list[Table],
    rate: float,
    out: Path | None,
) -> None:
    from swashplate.equations.marching.record import least_substeps
    from swashplate.full_order.comparison import TABLE_MANEUVERS, validity

    least_substeps(rate)  # a rate out of range is refused before anything is sampled
    with progress(len(TABLE_MANEUVERS)) as begin:
        found = validity(full, rate, begin=begin)
    if out is not None:
        from swashplate.tables import write_table

        write_table(found, out)
    note(f"{title}, five states against one: {found.height} manoeuvres")
    for line in head:
        note(line)
    show(*tables, validity_rows(found, rate))
    say(validity_verdict(found))
    if out is not None:
        note(f"Table: {out}")


def _say_run(
    full: FullOrderDrive,
    title: str,
    head: list[str],
    tables: list[Table],
    command: str,
    options: Options,
    method: Method,
    *,
    out: Path | None,
    plot: Path | None,
) -> None:
    from swashplate.full_order import compare

    with working("Simulating"):
        name, run = simulated(full.drive, command, options)
        found = compare(full, run, start=options.start, method=method)
        tables.append(run_table(found))
    title = f"{title}, {name}"
    if out is not None:
        with working(f"Writing {out}"):
            found.write(out)
    if plot is not None:
        with working(f"Drawing {plot}"):
            from swashplate.report.files import save_figure
            from swashplate.report.full_order_view import plot_full_order

            save_figure(plot_full_order(found, title=f"{title}, five states against one"), plot)
    duration = f"{found.time.size} samples at {options.rate:g} Hz"
    note(f"{title}, five states against one: {duration}")
    for line in head:
        note(line)
    show(*tables)
    for line in run_verdict(found):
        say(line)
    if out is not None:
        note(f"All signals, in SI: {out}")
    if plot is not None:
        note(f"Figure: {plot}")
