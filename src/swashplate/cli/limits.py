"""``swashplate limits``: what a drive can do, and what limits it under a command."""

from __future__ import annotations

import shlex
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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
from swashplate.cli.inputs import (
    Options,
    changes_said,
    drive_of,
    simulated,
    title_of,
)
from swashplate.cli.limit_tables import envelope_table, share_table, sine_table
from swashplate.cli.outputs import check_outputs
from swashplate.cli.terminal import note, say, show, working
from swashplate.errors import DomainError, InputError
from swashplate.tables import FIGURE, TABLE

if TYPE_CHECKING:
    from swashplate.analysis.limits import LimitShare, LimitShares
    from swashplate.drive import Drive

EXAMPLES = """\
Examples:
  swashplate limits hoist
  swashplate limits hoist --plot envelope.png --error 0.05 --frequency 0.3
  swashplate limits luff sine:9,0.1 --plot timeline.png
  swashplate limits mine.toml log.csv --interpolation previous --out shares.csv
"""
ERROR = 0.1
FREQUENCIES = (0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0)


def limits(
    drive: DriveWord,
    command: Annotated[
        str | None,
        typer.Argument(
            metavar="MANEUVER|FILE",
            help="A manoeuvre or a log, as in 'swashplate simulate': what limits the drive under "
            "it. Without one, what the drive can do at all.",
            show_default=False,
        ),
    ] = None,
    error: Annotated[
        float | None,
        typer.Option(
            help="Error within which a sine counts as followed, rms by rms, above 0 and below 1.",
            show_default=f"{ERROR:g}",
        ),
    ] = None,
    frequencies: Annotated[
        list[float] | None,
        typer.Option(
            "--frequency",
            help="Frequency of a sine to follow, up to 64; may be repeated. By default 0.02 to 1.",
            metavar="HZ",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Write the envelope, or with a command the shares of each limit, in SI, to a "
            ".csv or .parquet file.",
            metavar="FILE",
        ),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            help="Draw the envelope, or with a command which limit acts when: .png, .svg or .pdf.",
            metavar="FILE",
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
    """Say what a drive can do, or what limits it under a command.

    Without a command: dead zone, gain, limits of speed and acceleration, rise
    times, and the largest sine that it follows at each frequency. With one: how
    often each limit acts, by how much the error falls without it, and so which
    component to change first. The error is the rms of the speed less that of a
    drive without limits. The shares need not add up to 100 %.
    """
    check_outputs((out, TABLE), (plot, FIGURE))
    options = Options(rate, interpolation, start, clip, time_column, column)
    if command is not None and (error is not None or frequencies):
        raise InputError(
            "--error and --frequency belong to the sines that a drive can follow, which are said "
            f"without a command: leave them out, or '{command}'."
        )
    chosen = drive_of(drive, values or (), factors or ())
    title = title_of(drive, chosen)
    if command is None:
        within = ERROR if error is None else error
        _say_envelope(drive, chosen, title, within, tuple(frequencies or FREQUENCIES), out, plot)
    else:
        _say_shares(drive, chosen, title, command, options, out, plot)
    if plot is not None:
        note(f"Figure: {plot}")


def _say_envelope(
    word: str,
    drive: Drive,
    title: str,
    error: float,
    frequencies: tuple[float, ...],
    out: Path | None,
    plot: Path | None,
) -> None:
    with working("Measuring"):
        from swashplate.analysis.envelope import envelope
        from swashplate.analysis.tracking import largest_sine

        found, refusal = envelope(drive), ""
        tables = [envelope_table(found)]
        try:
            tables.append(sine_table(largest_sine(drive, frequencies, error)))
        except DomainError as no_inverse:
            refusal = f"No sine can be commanded: {no_inverse}"
    if out is not None:
        found.write(out)
    if plot is not None:
        with working(f"Drawing {plot}"):
            from swashplate.report.envelope_view import plot_envelope
            from swashplate.report.files import save_figure

            save_figure(plot_envelope(found), plot)
    note(f"{title}: what it can do")
    for line in changes_said(word, drive):
        note(line)
    show(*tables)
    if refusal:
        say(refusal)
    if out is not None:
        note(f"Envelope, in SI: {out}")


def _say_shares(
    word: str,
    drive: Drive,
    title: str,
    command: str,
    options: Options,
    out: Path | None,
    plot: Path | None,
) -> None:
    with working("Simulating"):
        from swashplate.analysis.limits import limit_shares

        name, run = simulated(drive, command, options)
        assert run.voltage is not None  # the command line simulates voltages only
        found = limit_shares(
            drive,
            run.voltage,
            run.record.rate,
            interpolation=options.interpolation,
            start=options.start,
        )
    if out is not None:
        found.write(out)
    if plot is not None:
        with working(f"Drawing {plot}"):
            from swashplate.report.files import save_figure
            from swashplate.report.limit_timeline_view import plot_limit_timeline

            figure = plot_limit_timeline(run, wanted=found.wanted, title=f"{title}, {name}")
            save_figure(figure, plot)
    note(f"{title}, {name}: {degrees(found.error):.3f} deg/s rms from a drive without limits")
    for line in changes_said(word, drive):
        note(line)
    shares = share_table(found)
    if shares.row_count:
        show(shares)
    _say_first(found)
    if found.first is not None and not changes_said(word, drive):
        _say_try(word, command, options, found, found.first)
    if out is not None:
        note(f"Shares of each limit, in SI: {out}")


def _say_try(
    word: str, command: str, options: Options, found: LimitShares, first: LimitShare
) -> None:
    """What a change of the first limit buys, and the command that shows more of it."""
    if first.eased_error is None or options.start != "rest" or options.clip:
        return
    named = " and ".join(f"{name} x {factor:.4g}" for name, factor in first.eased_by.items())
    fall = 100.0 * (1.0 - first.eased_error / found.error)
    say(
        f"With {named} it {'falls' if fall >= 0.0 else 'grows'} by {abs(fall):.1f} % to "
        f"{degrees(first.eased_error):.3f} deg/s rms."
    )
    words = ["swashplate", "whatif", word]
    for name, factor in first.eased_by.items():
        words += ["--scale", f"{name}={factor:.6g}"]
    words += ["--maneuver", command]
    for option, given, usual in (
        ("--rate", f"{options.rate:g}", "512"),
        ("--interpolation", options.interpolation, None),
        ("--time-column", options.time_column, "time"),
        ("--column", options.column, "voltage"),
    ):
        if given is not None and given != usual:
            words += [option, given]
    note(f"See more of it: {shlex.join(words)}")


def _say_first(found: LimitShares) -> None:
    first = found.first
    if first is None or first.error is None or first.error_share is None:
        say("No single change makes the error smaller.")
    else:
        say(
            f"Change first: {first.component}. Without this limit the error falls by "
            f"{100.0 * first.error_share:.1f} % to {degrees(first.error):.3f} deg/s rms."
        )
    for share in found.shares:
        if share.failure:
            say(f"Not without the {share.limit}: {share.failure}")
