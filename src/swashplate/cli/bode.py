"""``swashplate bode``: gain and phase of a drive under sines of any size."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swashplate.cli.arguments import DriveWord, Factors, Figure, Values
from swashplate.cli.inputs import changes_said, drive_of, title_of
from swashplate.cli.outputs import check_outputs
from swashplate.cli.terminal import note, show, table, working
from swashplate.errors import DomainError, InputError
from swashplate.tables import FIGURE, TABLE

if TYPE_CHECKING:
    from rich.table import Table

    from swashplate.drive import Drive
    from swashplate.linear import FrequencyResponse, LinearDrive

EXAMPLES = """\
Examples:
  swashplate bode hoist
  swashplate bode hoist --amplitude 1 --amplitude 9 --plot bode.png
  swashplate bode slew --bias 3 --amplitude 0.1 --linear-at 3 --out bode.csv
"""
MOST_POINTS = 2000
AMPLITUDES = (1.0, 4.0, 6.5, 9.0)


def bode(
    drive: DriveWord,
    amplitudes: Annotated[
        list[float] | None,
        typer.Option(
            "--amplitude",
            help="Amplitude of the sine; may be repeated. By default 1, 4, 6.5 and 9.",
            metavar="V",
            show_default=False,
        ),
    ] = None,
    bias: Annotated[float, typer.Option(help="Mean of the sine.", metavar="V")] = 0.0,
    lowest: Annotated[float, typer.Option("--from", help="Lowest frequency.", metavar="HZ")] = 0.02,
    highest: Annotated[float, typer.Option("--to", help="Highest frequency.", metavar="HZ")] = 5.0,
    points: Annotated[
        int, typer.Option(help="Frequencies, evenly spaced on a logarithmic axis.", metavar="N")
    ] = 40,
    frequency: Annotated[
        float, typer.Option(help="Frequency to print and to mark.", metavar="HZ")
    ] = 0.3,
    linear_at: Annotated[
        float | None,
        typer.Option(
            help="Draw the linear model at this voltage beside the sines.",
            metavar="V",
            show_default=False,
        ),
    ] = None,
    plot: Figure = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Write gain, phase and distortion, in SI, to a .csv or .parquet file.",
            metavar="FILE",
        ),
    ] = None,
    values: Values = None,
    factors: Factors = None,
) -> None:
    """Sweep sines of several amplitudes through a drive.

    Each sine is simulated until the answer repeats itself; gain and phase are
    those of its first harmonic, the distortion is all the rest of it. Prints the
    gain, the phase and the time by which the speed lags at one frequency: what a
    controller that is to damp a swing of that frequency has to make up for.
    """
    import numpy as np

    check_outputs((out, TABLE), (plot, FIGURE))
    if not 2 <= points <= MOST_POINTS:
        raise InputError(f"--points is {points}, but must be 2 to {MOST_POINTS}.")
    if not (np.isfinite([lowest, highest]).all() and 0.0 < lowest < highest):
        raise InputError(
            f"--from and --to must rise from above 0 Hz, not {lowest:g} to {highest:g}."
        )
    with working("Sweeping"):
        chosen = drive_of(drive, values or (), factors or ())
        linear = None if linear_at is None else _linear(chosen, linear_at)
        grid = np.union1d(np.geomspace(lowest, highest, points), [frequency])
        response = chosen.frequency_response(grid, amplitudes or AMPLITUDES, bias=bias)
        made = _at(response.at(frequency))
    title = f"{title_of(drive, chosen)}, sines about {bias:g} V"
    if out is not None:
        response.write(out)
    if plot is not None:
        with working(f"Drawing {plot}"):
            from swashplate.report.bode_view import plot_bode
            from swashplate.report.files import save_figure

            save_figure(plot_bode(response, linear=linear, mark=frequency), plot)
    note(f"{title}: {grid.size} frequencies from {grid[0]:g} to {grid[-1]:g} Hz")
    for line in changes_said(drive, chosen):
        note(line)
    note(f"At {frequency:g} Hz:")
    show(made)
    if out is not None:
        note(f"Gain, phase and distortion, in SI: {out}")
    if plot is not None:
        note(f"Figure: {plot}")


def _linear(drive: Drive, voltage: float) -> LinearDrive:
    from swashplate.linear import DeadZoneError

    try:
        return drive.linearize(voltage)
    except DeadZoneError as error:
        raise DomainError(f"--linear-at: {error.where}; {error.instead}.") from None


def _at(response: FrequencyResponse) -> Table:
    import numpy as np

    made = table(
        None,
        ">amplitude V",
        ">gain (deg/s)/V",
        ">phase deg",
        ">lag ms",
        ">distortion %",
        ">mean speed deg/s",
    )
    (frequency,) = response.frequencies
    rows = zip(
        response.amplitudes,
        np.degrees(response.gain[:, 0]),
        response.phase[:, 0],
        response.distortion[:, 0],
        np.degrees(response.mean[:, 0]),
        response.moves[:, 0],
        strict=True,
    )
    for amplitude, gain, phase, distortion, mean, moves in rows:
        answer = (
            (
                f"{gain:.3f}",
                f"{np.degrees(phase):z.1f}",
                f"{-1e3 * phase / (2.0 * np.pi * frequency):z.1f}",
                f"{100.0 * distortion:.1f}",
            )
            if moves
            else ("none", "", "", "")
        )
        made.add_row(f"{amplitude:g}", *answer, f"{mean:z.2f}")
    return made
