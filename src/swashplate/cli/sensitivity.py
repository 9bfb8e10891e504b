"""``swashplate sensitivity``: which lever moves which outcome, and by how much."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swashplate.cli.arguments import DriveWord, FileInterpolation, Rate, TimeColumn, VoltageColumn
from swashplate.cli.inputs import Options, drive_of, title_of
from swashplate.cli.levers import ranges_from, trial_of
from swashplate.cli.outputs import check_outputs
from swashplate.cli.terminal import note, say, show, table, working
from swashplate.errors import InputError
from swashplate.tables import FIGURE, TABLE

if TYPE_CHECKING:
    from rich.table import Table

    from swashplate.analysis.sensitivity import OneAtATime, SobolIndices

EXAMPLES = """\
Examples:
  swashplate sensitivity hoist
  swashplate sensitivity hoist --lever orifice --lever pump=0.8/1.5 --plot tornado.png
  swashplate sensitivity slew --maneuver step:4 --sobol 1024 --plot sobol.png
"""
LEVERS = (
    "orifice",
    "pump",
    "supply_pressure",
    "rate_limits",
    "dead_zone",
    "spool_stroke",
    "relief",
    "plussing",
)
OUTCOMES = ("final_speed", "rise_time", "largest_acceleration", "tracking_error", "creep")
FAINTEST = 5e-4
"""A lever that moves an outcome by less than this part has no row of its own."""


def sensitivity(
    drive: DriveWord,
    levers: Annotated[
        list[str] | None,
        typer.Option(
            "--lever",
            help="A lever, by itself or with its lowest and highest factor; may be repeated. "
            "'swashplate whatif --levers' lists them.",
            metavar="LEVER[=LOW/HIGH]",
            show_default=False,
        ),
    ] = None,
    span: Annotated[
        float, typer.Option(help="Levers without factors go this part down and up.")
    ] = 0.1,
    outcomes: Annotated[
        list[str] | None,
        typer.Option(
            "--outcome",
            help="final_speed, peak_speed, rise_time, response_time, largest_acceleration, "
            "overshoot, tracking_error, creep or travel; may be repeated.",
            metavar="NAME",
            show_default=False,
        ),
    ] = None,
    maneuver: Annotated[
        str,
        typer.Option(
            help='Command: a manoeuvre such as step:9 or "step +9 V", or a log.',
            metavar="NAME|FILE",
        ),
    ] = "step:9",
    rate: Rate = 512.0,
    interpolation: FileInterpolation = None,
    time_column: TimeColumn = "time",
    column: VoltageColumn = "voltage",
    samples: Annotated[
        int | None,
        typer.Option(
            "--sobol",
            help="Sobol's indices as well, from N base samples, a power of 2 (1024 is usual): N "
            "times the number of levers and two simulations.",
            metavar="N",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Of Sobol's sequence.", min=0)] = 0,
    plot: Annotated[
        Path | None,
        typer.Option(
            help="Draw a tornado, or with --sobol the indices: .png, .svg or .pdf.", metavar="FILE"
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Write all numbers, in SI, to a .csv or .parquet file.", metavar="FILE"),
    ] = None,
) -> None:
    """See which lever moves which outcome.

    Each lever is moved down and up by itself. With --sobol all are moved at once,
    and the variance of each outcome is shared out among them: by itself, and in
    total with what a lever does together with others.
    """
    from swashplate.analysis.sensitivity import one_at_a_time, sobol

    check_outputs((out, TABLE), (plot, FIGURE))
    wanted = tuple(outcomes) if outcomes else OUTCOMES
    indices = None
    with working("Simulating"):
        chosen = drive_of(drive)
        options = Options(rate, interpolation, "rest", False, time_column, column)
        name, trial = trial_of(chosen, maneuver, options)
        ranges = ranges_from(levers or LEVERS, (1.0 - _span(span), 1.0 + span))
        single = one_at_a_time(chosen, ranges, trial, outcomes=wanted)
        if samples is not None:
            indices = sobol(chosen, ranges, trial, outcomes=wanted, samples=samples, seed=seed)
    title = f"{title_of(drive, chosen)}, {name}"
    if out is not None:
        _write(single, indices, out)
    if plot is not None:
        with working(f"Drawing {plot}"):
            from swashplate.report.files import save_figure
            from swashplate.report.sensitivity_view import plot_sobol, plot_tornado

            figure = (
                plot_tornado(single, title=f"{title}: each lever by itself")
                if indices is None
                else plot_sobol(indices, title=f"{title}: shares of the variance")
            )
            save_figure(figure, plot)
    note(title)
    show(*(_outcome_table(single, indices, k) for k in range(len(single.outcomes))))
    said = dict.fromkeys((*single.sentences, *(() if indices is None else indices.sentences)))
    for sentence in said:
        say(f"- {sentence}")
    if indices is not None:
        error = _largest_error(indices)
        say(f"- {indices.runs} simulations; indices are good to {error:.2g} or better.")
    if out is not None:
        note(f"All numbers, in SI: {out}")
    if plot is not None:
        note(f"Figure: {plot}")


def _span(span: float) -> float:
    if not 0.0 < span < 1.0:
        raise InputError(f"--span is {span:g}, but must lie between 0 and 1.")
    return span


def _outcome_table(single: OneAtATime, indices: SobolIndices | None, number: int) -> Table:
    """Levers that move an outcome, the strongest first."""
    import numpy as np

    from swashplate.report.outcome_units import outcome_text, outcome_unit, outcome_words

    outcome = single.outcomes[number]
    unit = outcome_unit(outcome).name
    base = float(single.base[number])
    more = [] if indices is None else [">by itself", ">in total"]
    made = table(
        f"{outcome_words(outcome)}, {outcome_text(outcome, base)} {unit} as it is",
        "lever",
        ">factors",
        ">down",
        ">up",
        ">swing",
        *more,
    )
    swings = np.nan_to_num(single.swings[:, number], nan=0.0)
    shares = np.zeros(swings.size) if indices is None else indices.total[:, number]
    quiet = []
    for k in np.argsort(-swings, kind="stable"):
        lever = single.levers[k]
        missing = np.isnan([single.low[k, number], single.high[k, number]]).any()
        if not missing and swings[k] <= FAINTEST * abs(base) and not shares[k] > FAINTEST:
            quiet.append(lever)
            continue
        low, high = single.ranges[lever]
        swing = "" if missing or base == 0.0 else f"{100.0 * swings[k] / abs(base):.1f} %"
        made.add_row(
            lever,
            f"{low:g} {high:g}",
            outcome_text(outcome, float(single.low[k, number])),
            outcome_text(outcome, float(single.high[k, number])),
            swing,
            *([] if indices is None else _shares(indices, k, number)),
        )
    if quiet:
        made.caption = f"not moved by {', '.join(quiet)}"
        made.caption_justify = "left"
    return made


def _shares(indices: SobolIndices, lever: int, number: int) -> list[str]:
    values = (float(indices.first[lever, number]), float(indices.total[lever, number]))
    return ["none" if value != value else f"{value:z.3f}" for value in values]


def _largest_error(indices: SobolIndices) -> float:
    import numpy as np

    errors = np.concatenate([indices.first_error.ravel(), indices.total_error.ravel()])
    return float(np.max(errors[np.isfinite(errors)], initial=0.0))


def _write(single: OneAtATime, indices: SobolIndices | None, path: Path) -> None:
    import polars as pl

    from swashplate.tables import write_table

    rows = []
    for k, outcome in enumerate(single.outcomes):
        for j, lever in enumerate(single.levers):
            row = {
                "outcome": outcome.name,
                "unit": outcome.unit,
                "lever": lever,
                "lower factor": single.ranges[lever][0],
                "upper factor": single.ranges[lever][1],
                "as it is": float(single.base[k]),
                "at lower factor": float(single.low[j, k]),
                "at upper factor": float(single.high[j, k]),
            }
            if indices is not None:
                row |= {
                    "first order": float(indices.first[j, k]),
                    "first order, half width": float(indices.first_error[j, k]),
                    "total": float(indices.total[j, k]),
                    "total, half width": float(indices.total_error[j, k]),
                }
            rows.append(row)
    write_table(pl.DataFrame(rows).fill_nan(None), path)
