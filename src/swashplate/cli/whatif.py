"""``swashplate whatif``: a drive before and after its levers are moved."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swashplate.cli.arguments import (
    DriveWord,
    Figure,
    FileInterpolation,
    Rate,
    TimeColumn,
    VoltageColumn,
)
from swashplate.cli.inputs import Options, drive_of, title_of
from swashplate.cli.levers import factors_of, list_levers, trial_of
from swashplate.cli.outputs import check_outputs
from swashplate.cli.terminal import note, say, show, table, working
from swashplate.errors import InputError
from swashplate.tables import FIGURE

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from rich.table import Table

    from swashplate.analysis.monte_carlo import Bands, Draws
    from swashplate.analysis.outcomes import Outcome
    from swashplate.analysis.whatif import WhatIf

EXAMPLES = """\
Examples:
  swashplate whatif hoist --scale orifice=1.5 --scale pump=1.5
  swashplate whatif slew --scale orifice_diameter=1.2 --maneuver step:6 --plot w.png
  swashplate whatif fitted --scale dead_zone=0 --uncertainty fitted
  swashplate whatif mine.toml --scale pump=1.2 --maneuver log.csv --interpolation previous
  swashplate whatif --levers
"""
LEVEL = 0.95
CHOSEN = ("final_speed", "rise_time", "largest_acceleration", "tracking_error", "creep", "travel")


def whatif(
    drive: DriveWord,
    factors: Annotated[
        list[str],
        typer.Option(
            "--scale",
            help="A factor on a lever: orifice=1.5, pump=1.5, dead_zone=0 ... (see --levers), or "
            "on a parameter: Z16_plus=1.2. May be repeated.",
            metavar="LEVER=FACTOR",
            show_default=False,
        ),
    ],
    maneuver: Annotated[
        str,
        typer.Option(
            help='Command for both: a manoeuvre such as step:9 or "step +9 V", or a log.',
            metavar="NAME|FILE",
        ),
    ] = "sine:9,0.1",
    rate: Rate = 512.0,
    interpolation: FileInterpolation = None,
    time_column: TimeColumn = "time",
    column: VoltageColumn = "voltage",
    uncertainty: Annotated[
        Path | None,
        typer.Option(
            help="Folder that 'fit' wrote: bands from the errors of its estimates.",
            metavar="DIR",
            show_default=False,
        ),
    ] = None,
    campaign: Annotated[
        Path | None,
        typer.Option(
            help="The campaign of that fit, if it is not where it was.",
            metavar="CAMPAIGN.toml",
            show_default=False,
        ),
    ] = None,
    draws: Annotated[int, typer.Option(help="Drives drawn for the bands, 20 or more.")] = 200,
    seed: Annotated[int, typer.Option(help="Of the draws.", min=0)] = 0,
    plot: Figure = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Write the changed drive as a parameter file.", metavar="SET.toml"),
    ] = None,
    levers: Annotated[
        bool,
        typer.Option(
            "--levers", callback=list_levers, is_eager=True, help="List the levers and end."
        ),
    ] = False,
) -> None:
    """See what a change of the machine does.

    Simulates the drive as it is and with its levers moved, over one command.
    The speed that is wanted is in proportion to the voltage, at the ratio of
    the drive as it is. With --uncertainty outcomes get intervals and the figure
    bands: drives are drawn from the errors of a fit's estimates.
    """
    from swashplate.analysis.whatif import what_if

    check_outputs((out, None), (plot, FIGURE))
    moved = factors_of(factors)
    if uncertainty is not None and draws < 20:
        raise InputError(f"--draws is {draws}, but bands need 20 or more.")
    with working("Simulating"):
        chosen = drive_of(drive)
        options = Options(rate, interpolation, "rest", False, time_column, column)
        name, trial = trial_of(chosen, maneuver, options)
        result = what_if(chosen, moved, trial, outcomes=CHOSEN)
    drawn: Mapping[str, Draws] = {}
    if uncertainty is not None:
        with working("Drawing drives"):
            from swashplate.analysis.monte_carlo import stored_draws
            from swashplate.analysis.whatif import AS_IS, CHANGED

            before = stored_draws(
                uncertainty, drive=chosen, campaign=campaign, draws=draws, seed=seed
            )
            drawn = {AS_IS: before, CHANGED: before.pulled(moved)}
    with working("Writing"):
        made = _before_and_after(result, drawn)
        bands = _bands(result, drawn)
        title = f"{title_of(drive, chosen)}, {name}"
        if out is not None:
            result.after.drive.to_toml(out)
        if plot is not None:
            from swashplate.report.files import save_figure
            from swashplate.report.whatif_view import plot_whatif

            words = ", ".join(f"{name} x {factor:g}" for name, factor in moved.items())
            save_figure(plot_whatif(result, bands=bands, title=f"{title}: {words}"), plot)
    note(title)
    for line in _changes(result):
        note(line)
    show(made)
    for sentence in (*result.sentences(), *_band_sentences(drawn, bands)):
        say(f"- {sentence}")
    if out is not None:
        note(f"Changed drive: {out}")
    if plot is not None:
        note(f"Figure: {plot}")


def _changes(result: WhatIf) -> list[str]:
    """A line for each parameter that moved."""
    lines = []
    for old in result.before.drive.parameters.values():
        new = result.after.drive[old.symbol]
        if new.value != old.value:
            before, after = ("/".join(f"{v:g}" for v in each.values) for each in (old, new))
            lines.append(f"{old.symbol} ({old.name}): {before} -> {after} {old.unit}")
    return lines


def _before_and_after(result: WhatIf, drawn: Mapping[str, Draws]) -> Table:
    from swashplate.report.outcome_units import outcome_text, outcome_unit, outcome_words

    halves = [_half_widths(result, each) for each in drawn.values()]
    columns = (">as it is", ">±", ">changed", ">±") if drawn else (">as it is", ">changed")
    made = table(None, "", *columns, ">change", "unit")
    speed = next(each for each in result.outcomes if each.unit == "rad/s")
    limits = zip(result.before.speed_limits, result.after.speed_limits, strict=True)
    ends = [_limit_half_widths(speed, each) for each in drawn.values()]
    for way, (before, after) in enumerate(limits):
        texts = [outcome_text(speed, before), outcome_text(speed, after)]
        cells = [texts[0], ends[0][way], texts[1], ends[1][way]] if drawn else texts
        word = ("positive", "negative")[way]
        made.add_row(f"speed limit, {word}", *cells, _change(before, after), "deg/s")
    for k, outcome in enumerate(result.outcomes):
        before, after = float(result.before.values[k]), float(result.after.values[k])
        texts = [outcome_text(outcome, before), outcome_text(outcome, after)]
        cells = [texts[0], halves[0][k], texts[1], halves[1][k]] if drawn else texts
        unit = outcome_unit(outcome).name
        made.add_row(outcome_words(outcome), *cells, _change(before, after), unit)
    return made


def _change(before: float, after: float) -> str:
    from math import isnan

    if isnan(before) or isnan(after) or before == 0.0:
        return ""
    return f"{100.0 * (after / before - 1.0):+z.1f} %"


def _half_widths(result: WhatIf, draws: Draws) -> list[str]:
    """Half of the interval that holds most of the drives, for each outcome."""
    from swashplate.analysis.outcomes import batch_outcomes
    from swashplate.report.outcome_units import outcome_text

    found = batch_outcomes(draws.drives[0], draws.columns, result.trial, result.outcomes)
    return [
        outcome_text(outcome, _half_width(found.values[:, k]))
        for k, outcome in enumerate(found.outcomes)
    ]


def _limit_half_widths(speed: Outcome, draws: Draws) -> list[str]:
    """The same of the speed limits, each way."""
    import numpy as np

    from swashplate.parameters.rules import FULL_VOLTAGE
    from swashplate.report.outcome_units import outcome_text

    speeds = [each.steady_speed([FULL_VOLTAGE, -FULL_VOLTAGE]) for each in draws.drives]
    return [outcome_text(speed, _half_width(each)) for each in np.transpose(speeds)]


def _half_width(values: NDArray[Any]) -> float:
    import numpy as np

    low, high = np.quantile(values, [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL])
    return 0.5 * float(high - low)


def _bands(result: WhatIf, drawn: Mapping[str, Draws]) -> dict[str, Bands]:
    from swashplate.analysis.monte_carlo import bands

    trial = result.trial
    return {
        name: bands(each, trial.voltage, trial.rate, level=LEVEL) for name, each in drawn.items()
    }


def _band_sentences(drawn: Mapping[str, Draws], bands: Mapping[str, Bands]) -> list[str]:
    import numpy as np

    first = next(iter(drawn.values()), None)
    if first is None:
        return []
    said = [f"± is half of the interval that holds {100.0 * LEVEL:g} % of the drives."]
    for name, band in bands.items():
        width, when = band.widest
        said.append(
            f"Band of {band.draws} drives, {name}: at most {np.degrees(width):.3g} deg/s wide, at "
            f"{when:.3g} s."
        )
    return [*said, *first.sentences()]
