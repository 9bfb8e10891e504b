"""``swashplate compare``: two drives over one manoeuvre."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swashplate.cli.arguments import Rate
from swashplate.cli.inputs import drive_of, maneuver_of
from swashplate.cli.outputs import check_outputs
from swashplate.cli.terminal import note, show, table, working
from swashplate.tables import FIGURE, TABLE

if TYPE_CHECKING:
    from rich.table import Table

    from swashplate.drive import Drive
    from swashplate.simulation.result import Simulation

EXAMPLES = """\
Examples:
  swashplate compare hoist luff
  swashplate compare hoist mine.toml --maneuver sine:6.5,0.1 --plot both.png
"""


def compare(
    first: Annotated[
        str,
        typer.Argument(metavar="A", help="A packaged drive or a TOML file.", show_default=False),
    ],
    second: Annotated[
        str,
        typer.Argument(metavar="B", help="Another, compared with the first.", show_default=False),
    ],
    maneuver: Annotated[
        str,
        typer.Option(help='Manoeuvre for both, such as step:9 or "step +9 V".', metavar="NAME"),
    ] = "step:9",
    rate: Rate = 512.0,
    plot: Annotated[
        Path | None, typer.Option(help="Draw both speeds: .png, .svg or .pdf.", metavar="FILE")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Write voltage and both speeds, in SI, to a .csv or .parquet file.",
            metavar="FILE",
        ),
    ] = None,
) -> None:
    """Compare two drives over the same manoeuvre.

    The settled speed is the one that the manoeuvre's largest voltage would lead
    to if it were held. The time to 90 % of it counts from the moment at which
    the voltage first changes.
    """
    from swashplate.cli.measures import rms_difference_deg_s
    from swashplate.equations.marching.record import least_substeps

    check_outputs((out, TABLE), (plot, FIGURE))
    least_substeps(rate)  # a rate out of range is refused before anything is sampled
    with working("Simulating"):
        drives = _labelled(first, second)
        command = maneuver_of(maneuver, *drives.values())
        voltage = command.sample(rate)
        runs = {label: drive.simulate(voltage, rate) for label, drive in drives.items()}
        made = _side_by_side(drives, runs)
        rms = rms_difference_deg_s(*runs.values())
    title = f"{' and '.join(runs)}, {command.name}"
    if out is not None:
        with working(f"Writing {out}"):
            _write(runs, out)
    if plot is not None:
        with working(f"Drawing {plot}"):
            from swashplate.report.figures import plot_comparison, save_figure

            save_figure(plot_comparison(runs, title=title), plot)
    note(title)
    show(made)
    note(f"rms difference of the speeds: {rms:.2f} deg/s")
    if out is not None:
        note(f"Voltage and both speeds, in SI: {out}")
    if plot is not None:
        note(f"Figure: {plot}")


def _labelled(first: str, second: str) -> dict[str, Drive]:
    """Both drives by name, or by what was typed where they have the same name."""
    drives = (drive_of(first), drive_of(second))
    labels = (drives[0].name, drives[1].name)
    if labels[0] == labels[1]:
        labels = (first, second if second != first else f"{second} (2)")
    return dict(zip(labels, drives, strict=True))


def _side_by_side(drives: dict[str, Drive], runs: dict[str, Simulation]) -> Table:
    from swashplate.cli.measures import (
        degrees,
        largest_command,
        peak_speeds_deg_s,
        time_to_reach,
    )

    volts = largest_command(next(iter(runs.values())))
    speeds = [peak_speeds_deg_s(run) for run in runs.values()]
    settled = [drive.steady_speed(volts) for drive in drives.values()]
    times = [time_to_reach(run, each) for run, each in zip(runs.values(), settled, strict=True)]
    made = table(None, "", *(f">{label}" for label in runs), "")
    made.add_row("peak speed, positive", *(f"{each.positive:z.2f}" for each in speeds), "deg/s")
    made.add_row("peak speed, negative", *(f"{each.negative:z.2f}" for each in speeds), "deg/s")
    made.add_row(
        f"settled speed at {volts:g} V", *(f"{degrees(each):z.2f}" for each in settled), "deg/s"
    )
    made.add_row("time to 90 % of it", *("never" if t is None else f"{t:.3f}" for t in times), "s")
    return made


def _write(runs: dict[str, Simulation], path: Path) -> None:
    import polars as pl

    from swashplate.tables import write_table

    run = next(iter(runs.values()))
    speeds = {f"shaft_speed {label}": each.shaft_speed for label, each in runs.items()}
    write_table(pl.DataFrame({"time": run.time, "voltage": run.voltage, **speeds}), path)
