"""``swashplate simulate``: one drive over one command."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swashplate.cli.arguments import Clip, DriveWord, Figure, StartFrom, TimeColumn, VoltageColumn
from swashplate.cli.inputs import (
    Interpolation,
    Options,
    changes_said,
    drive_of,
    simulated,
    title_of,
)
from swashplate.cli.outputs import check_outputs
from swashplate.cli.terminal import note, show, table, working
from swashplate.tables import FIGURE, TABLE

if TYPE_CHECKING:
    from rich.table import Table

    from swashplate.simulation.result import Simulation

EXAMPLES = """\
Examples:
  swashplate simulate hoist step:9
  swashplate simulate hoist "step +9 V" --plot step.png
  swashplate simulate hoist sine:6.5,0.1 --set Z16_plus=0.12mm --out sine.csv
  swashplate simulate mine.toml log.csv --interpolation previous --out run.csv
"""


def simulate(
    drive: DriveWord,
    command: Annotated[
        str,
        typer.Argument(
            metavar="MANEUVER|FILE",
            help='A manoeuvre such as step:9 or "step +9 V", or a log with columns of time and '
            "voltage: text such as .csv, .parquet, .mat, .h5, .tdms or .mf4; a column may carry "
            "its unit: 'time \\[ms]'.",
            show_default=False,
        ),
    ],
    rate: Annotated[
        float, typer.Option(help="Samples a second of the result, 10 to 100000.", metavar="HZ")
    ] = 512.0,
    out: Annotated[
        Path | None,
        typer.Option(help="Write all signals, in SI, to a .csv or .parquet file.", metavar="FILE"),
    ] = None,
    plot: Figure = None,
    values: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            help="Another value for a parameter: Z16=1.2e-4 in SI, Z16=1.2e-4/1.5e-4 for plus and "
            "minus, Z16_plus=0.12mm with a unit. May be repeated.",
            metavar="NAME=VALUE",
        ),
    ] = None,
    factors: Annotated[
        list[str] | None,
        typer.Option(
            "--scale",
            help="A factor on a parameter, after --set: Z16=1.5. May be repeated.",
            metavar="NAME=FACTOR",
        ),
    ] = None,
    interpolation: Annotated[
        Interpolation | None,
        typer.Option(
            help="The voltage between rows or samples: a straight line, or the earlier one held. "
            "Must be given with a FILE.",
            show_default=False,
        ),
    ] = None,
    start: StartFrom = "rest",
    clip: Clip = False,
    time_column: TimeColumn = "time",
    column: VoltageColumn = "voltage",
) -> None:
    """Simulate a drive over a manoeuvre or a measured voltage.

    Prints what the drive did: its largest speeds and currents, how far it went
    and how long each of its limits held it back, the dead zone only while the
    command is not 0 V. --out writes every signal of the chain, --plot draws
    them. 'swashplate --help' lists the manoeuvres.
    """
    check_outputs((out, TABLE), (plot, FIGURE))
    options = Options(rate, interpolation, start, clip, time_column, column)
    with working("Simulating"):
        chosen = drive_of(drive, values or (), factors or ())
        name, run = simulated(chosen, command, options)
        tables = (_what_it_did(run), _limits(run))
    title = f"{title_of(drive, chosen)}, {name}"
    if out is not None:
        with working(f"Writing {out}"):
            run.write(out)
    if plot is not None:
        with working(f"Drawing {plot}"):
            from swashplate.report.figures import plot_simulation, save_figure

            save_figure(plot_simulation(run, title=title), plot)
    note(f"{title}: {run.time.size} samples at {rate:g} Hz, {run.time[-1] - run.time[0]:.6g} s")
    for line in changes_said(drive, chosen):
        note(line)
    show(*tables)
    if out is not None:
        note(f"All signals, in SI: {out}")
    if plot is not None:
        note(f"Figure: {plot}")


def _what_it_did(run: Simulation) -> Table:
    import numpy as np

    from swashplate.cli.measures import peak_speeds_deg_s, peaks

    speed, current = peak_speeds_deg_s(run), peaks(run.current)
    travel_deg = float(np.degrees(run.shaft_position[-1]))
    made = table(None, "Shaft", ">", "")
    made.add_row("peak speed, positive", f"{speed.positive:z.2f}", "deg/s")
    made.add_row("peak speed, negative", f"{speed.negative:z.2f}", "deg/s")
    made.add_row("speed at the end", f"{np.degrees(run.shaft_speed[-1]):z.2f}", "deg/s")
    made.add_row("position at the end", f"{travel_deg:z.1f}", "deg")
    made.add_row("", f"{travel_deg / 360.0:z.3f}", "turns")
    made.add_section()
    made.add_row("peak current, positive", f"{current.positive:z.4f}", "A")
    made.add_row("peak current, negative", f"{current.negative:z.4f}", "A")
    return made


def _limits(run: Simulation) -> Table:
    from swashplate.cli.measures import limit_shares

    made = table(None, "Limit", ">share of time")
    for limit, share in limit_shares(run).items():
        made.add_row(limit, f"{100.0 * share:.1f} %" if share else "never")
    return made
