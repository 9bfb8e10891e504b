"""``swashplate compensate``: the voltage for a wanted speed, and what knowing it buys."""

from __future__ import annotations

from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swashplate.cli.arguments import (
    DriveWord,
    Factors,
    FileInterpolation,
    Rate,
    TimeColumn,
    Values,
    VoltageColumn,
)
from swashplate.cli.inputs import (
    Options,
    changes_said,
    drive_of,
    simulated,
    title_of,
)
from swashplate.cli.outputs import check_outputs
from swashplate.cli.terminal import note, show, table, working
from swashplate.errors import InputError
from swashplate.tables import FIGURE, Form

if TYPE_CHECKING:
    from rich.table import Table

    from swashplate.analysis.compensation import InverseMap
    from swashplate.analysis.tracking import Improvement

EXAMPLES = """\
Examples:
  swashplate compensate hoist --out hoist-inverse.toml
  swashplate compensate hoist --speed-deg-s 5 --speed-deg-s -120
  swashplate compensate luff sine:4,0.1 --plot inverse.png
"""
INVERSE_MAP = Form("an inverse map", (".toml", ".csv", ".parquet"), (".pq",))
PRINTED = 5
"""Points each way that are printed."""


def compensate(
    drive: DriveWord,
    stick: Annotated[
        str | None,
        typer.Argument(
            metavar="MANEUVER|FILE",
            help="What the stick does: ±10 V asks for the full speed of that way, in proportion. "
            "A manoeuvre or a log as in 'swashplate simulate'. Says what the map buys under it.",
            show_default=False,
        ),
    ] = None,
    speeds_deg_s: Annotated[
        list[float] | None,
        typer.Option(
            "--speed-deg-s",
            help="A wanted speed to print the voltage of; may be repeated.",
            metavar="DEG/S",
            show_default=False,
        ),
    ] = None,
    points: Annotated[
        int, typer.Option(help="Points of the map each way, 2 to 10001.", metavar="N")
    ] = 101,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Write the map, in SI: .toml for a controller, .csv or .parquet as a table.",
            metavar="FILE",
        ),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            help="Draw the map, with a command also what it buys: .png, .svg or .pdf.",
            metavar="FILE",
        ),
    ] = None,
    values: Values = None,
    factors: Factors = None,
    rate: Rate = 512.0,
    interpolation: FileInterpolation = None,
    time_column: TimeColumn = "time",
    column: VoltageColumn = "voltage",
) -> None:
    """Invert a drive's steady map: the voltage for a wanted speed.

    The map crosses the dead zone at once, ends where the speed saturates, and
    is straight between its points, so that any controller can follow it. With
    what a stick does, compares three controllers in simulation: a straight
    line, the map, and the map with the drive's lag made up for.
    """
    check_outputs((out, INVERSE_MAP), (plot, FIGURE))
    with working("Inverting"):
        from swashplate.analysis.compensation import inverse_map

        chosen = drive_of(drive, values or (), factors or ())
        found = inverse_map(chosen, points)
        tables = [_map_table(found), _limit_table(found)]
        if speeds_deg_s:
            tables.insert(0, _wanted_table(found, speeds_deg_s))
        bought = None
        if stick is not None:
            from swashplate.analysis.tracking import improvement, wanted_of_stick

            options = Options(rate, interpolation, "rest", False, time_column, column)
            name, run = simulated(chosen, stick, options)
            assert run.voltage is not None  # the command line simulates voltages only
            wanted = wanted_of_stick(found, run.voltage)
            bought = improvement(chosen, wanted, run.record.rate, inverse=found)
            tables.append(_bought_table(bought, name))
    if out is not None:
        found.write(out)
    if plot is not None:
        with working(f"Drawing {plot}"):
            from swashplate.report.compensation_view import plot_compensation
            from swashplate.report.files import save_figure

            save_figure(plot_compensation(found, bought), plot)
    note(f"{title_of(drive, chosen)}: voltage for a wanted speed")
    for line in changes_said(drive, chosen):
        note(line)
    show(*tables)
    if out is not None:
        note(f"Inverse map, in SI: {out}")
    if plot is not None:
        note(f"Figure: {plot}")


def _wanted_table(found: InverseMap, speeds_deg_s: list[float]) -> Table:
    import numpy as np

    made = table(None, ">wanted speed deg/s", ">voltage V")
    volts = found.voltage(np.radians(speeds_deg_s))
    for speed, voltage in zip(speeds_deg_s, volts, strict=True):
        made.add_row(f"{speed:g}", f"{voltage:z.4f}")
    return made


def _map_table(found: InverseMap) -> Table:
    import numpy as np

    made = table(None, ">speed deg/s", ">voltage V")
    for branch in (found.minus, None, found.plus):
        if branch is None:
            made.add_row(f"{degrees(found.creep):z.3f}", "0.0000")
            continue
        size = branch.speed.size
        for n in np.unique(np.linspace(0, size - 1, min(PRINTED, size)).round().astype(int)):
            made.add_row(f"{degrees(branch.speed[n]):z.3f}", f"{branch.voltage[n]:z.4f}")
    total = found.minus.speed.size + found.plus.speed.size + 1
    if made.row_count < total:
        made.caption = f"{made.row_count} of {total} points shown"
        made.caption_justify = "left"
    return made


def _limit_table(found: InverseMap) -> Table:
    made = table(None, "Limit", ">negative", ">positive", "")
    low, high = (degrees(each) for each in found.limits)
    below, above = (degrees(each) for each in found.gap)
    up, down = (degrees(each) for each in found.acceleration)
    made.add_row("speed", f"{low:.3f}", f"{high:.3f}", "deg/s")
    made.add_row("slowest that can be held", f"{below:z.3f}", f"{above:z.3f}", "deg/s")
    made.add_row("acceleration at rest", f"{-down:.2f}", f"{up:.2f}", "deg/s²")
    made.add_row("lag", "", f"{1e3 * found.lag:.1f}", "ms")
    made.add_row("error of the straight lines", "", f"{degrees(found.error):.2g}", "deg/s")
    return made


def _bought_table(bought: Improvement, name: str) -> Table:
    made = table(
        f"Error of the speed under {name}", "Controller", ">rms deg/s", ">largest deg/s", ">rms"
    )
    plainest = bought.ways[0].error.rms
    if plainest == 0.0:
        raise InputError(f"{name} asks for nothing but standstill; take one that moves the drive.")
    for way in bought.ways:
        made.add_row(
            way.name,
            f"{degrees(way.error.rms):.3f}",
            f"{degrees(way.error.largest):.3f}",
            f"{100.0 * way.error.rms / plainest:.1f} %",
        )
    return made
