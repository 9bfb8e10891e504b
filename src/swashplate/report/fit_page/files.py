"""The report's figures as files for print: one of each run, and the starts' costs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from swashplate.campaign import Campaign
from swashplate.errors import FileError
from swashplate.identification.assessment import Assessment, RunQuality, assess
from swashplate.identification.fitting import Fit
from swashplate.identification.starts import StartResult
from swashplate.identification.validation import ignored_windows
from swashplate.identification.verdict import starts_of
from swashplate.report.axis_labels import in_lines
from swashplate.report.broken_lines import draw_broken
from swashplate.report.display_units import display_unit
from swashplate.report.files import save_figure
from swashplate.report.fit_page.run_tables import quality_row
from swashplate.report.fit_page.runs import (
    ShownRun,
    off_scale,
    predicted_runs,
    shown_runs,
)
from swashplate.report.style import (
    BLUE,
    FAINT,
    GREY,
    INK,
    NORMAL,
    VERMILION,
    Margins,
    dress,
    label_below,
    line_up_labels,
    margins,
    new_figure,
    put_legend,
    write_title,
    zero_line,
)

WIDTH = 8.6
HEIGHTS = {"input": 0.75, "overlay": 1.5, "residual": 0.85}
GAP = 0.28
LETTER = 0.065
"""Width of a letter of a label. [inch]"""
AROUND = Margins(left=1.1, right=0.25, bottom=0.5, top=0.75)
"""Sizes. [inch]"""


def save_fit_figures(
    fit: Fit,
    campaign: Campaign,
    folder: str | Path,
    format: Literal["svg", "pdf", "png"] = "svg",
    *,
    assessments: Sequence[Assessment] | None = None,
    validation: Sequence[RunQuality] = (),
    starts: Sequence[StartResult] = (),
) -> tuple[Path, ...]:
    """Save the figures of a fit's report: the overlay of each run, and the starts' costs.

    Parameters
    ----------
    fit : Fit
        What was fitted.
    campaign : Campaign
        The tests that it was fitted to.
    folder : path
        Where to; it is made if there is none.
    format : {"svg", "pdf", "png"}
        Of the files.
    assessments, validation, starts :
        As of `write_fit_report`.

    Returns
    -------
    tuple of Path
        ``overlay-01-hoistr3.svg`` and so on, last ``waterfall-card.svg`` of each stage that had
        several starts, or ``waterfall.svg`` of those given.

    Raises
    ------
    FileError
        If the folder cannot be made or a file cannot be written.
    """
    assessed = assess(fit.stages) if assessments is None else assessments
    paths = list(_overlays(shown_runs(assessed, validation), campaign, Path(folder), format))
    for stage, results in starts_of(assessed, starts).items():
        name = f"waterfall-{_plain_name(stage)}" if stage else "waterfall"
        paths.append(Path(folder) / f"{name}.{format}")
        save_figure(plot_waterfall(results), paths[-1])
    return tuple(paths)


def save_run_figures(
    predicted: Sequence[RunQuality],
    campaign: Campaign,
    folder: str | Path,
    format: Literal["svg", "pdf", "png"] = "svg",
) -> tuple[Path, ...]:
    """Save the overlay of each run that a drive was held against.

    Parameters
    ----------
    predicted : sequence of RunQuality
        As `validation.predict` gives them.
    campaign, folder, format :
        As of `save_fit_figures`.

    Raises
    ------
    FileError
        If the folder cannot be made or a file cannot be written.
    """
    return tuple(_overlays(predicted_runs(predicted), campaign, Path(folder), format))


def _overlays(
    runs: Sequence[ShownRun], campaign: Campaign, folder: Path, format: str
) -> Iterator[Path]:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"{folder} cannot be made: {error.strerror or error}.") from None
    for number, run in enumerate(runs, start=1):
        path = folder / f"overlay-{number:02d}-{_plain_name(run.experiment.name)}.{format}"
        save_figure(plot_overlay(run, virtual=campaign.virtual), path)
        yield path


def plot_overlay(run: ShownRun, *, virtual: bool = False) -> Figure:
    """Figure of one run: its input, and of each channel measured, simulated and residual."""
    kinds = ["input", *(["overlay", "residual"] * len(run.channels))]
    heights = [HEIGHTS[kind] for kind in kinds]
    around = AROUND._replace(top=AROUND.top + 0.17 * len(run.channels))
    total = around.bottom + around.top + sum(heights) + GAP * (len(kinds) - 1)
    figure = new_figure(WIDTH, total)
    axes = figure.subplots(
        len(kinds),
        sharex=True,
        gridspec_kw={
            **margins(figure, around),
            "height_ratios": heights,
            "hspace": GAP * len(heights) / sum(heights),
        },
    )
    drive = run.experiment.input
    unit = display_unit(drive.unit, float(np.abs(drive.values).max(initial=0.0)))
    dress(axes[0], unit.label(drive.kind if drive.kind != "other" else "input"))
    held = drive.interpolation == "previous"
    draw_broken(axes[0], drive.time, unit.factor * drive.values, INK, held=held)
    for place, shown in enumerate(run.channels):
        upper, lower = axes[1 + 2 * place], axes[2 + 2 * place]
        time, factor = shown.channel.time, shown.unit.factor
        for ax, label, height in (
            (upper, shown.unit.label(shown.quality.channel), HEIGHTS["overlay"]),
            (lower, shown.small.label("residual"), HEIGHTS["residual"]),
        ):
            dress(ax, in_lines(label, int(height / LETTER)))
        zero_line(lower)
        draw_broken(upper, time, factor * shown.channel.values, GREY)
        draw_broken(upper, time, factor * shown.quality.simulated, VERMILION)
        draw_broken(lower, time, shown.small.factor * shown.quality.residual, BLUE)
        residual = shown.small.factor * shown.quality.residual
        for ax, values in ((upper, factor * shown.channel.values), (lower, residual)):
            if off_scale(shown.channel, values).any():
                counted = values[shown.channel.used]
                room = 0.1 * float(np.ptp(counted))
                ax.set_ylim(float(counted.min()) - room, float(counted.max()) + room)
        for first, last in ignored_windows(shown.channel):
            for ax in (upper, lower):
                ax.axvspan(first, last, color=FAINT, alpha=0.35, linewidth=0.0)
    axes[-1].set_xlim(float(drive.time[0]), float(drive.time[-1]))
    label_below(axes[-1], "time (s)")
    line_up_labels(figure, axes, 0.62)
    role = "held out" if run.validates else "fitted"
    kind = "virtual test, " if virtual else ""
    write_title(figure, f"{run.experiment.name} ({kind}{role})", AROUND.left)
    _measures(figure, run)
    handles = [
        Line2D([], [], color=color, linewidth=2.0, label=words)
        for color, words in (
            (GREY, "virtual test" if virtual else "measured"),
            (VERMILION, "simulated"),
            (BLUE, "simulated less " + ("virtual test" if virtual else "measured")),
        )
    ]
    put_legend(figure, handles, AROUND.left, 0.45 + 0.17 * len(run.channels))
    return figure


def plot_waterfall(starts: Sequence[StartResult]) -> Figure:
    """Figure of the costs that the starts reached, best first; hollow ones did not converge."""
    ended = sorted((each for each in starts if np.isfinite(each.cost)), key=lambda s: s.cost)
    around = AROUND._replace(top=0.5)
    figure = new_figure(WIDTH, 3.2)
    ax = figure.subplots(gridspec_kw=margins(figure, around))
    dress(ax, "cost")
    if ended and ended[-1].cost > 1.5 * ended[0].cost > 0.0:
        ax.set_yscale("log")
    ax.scatter(
        range(1, len(ended) + 1),
        [each.cost for each in ended],
        s=22.0,
        facecolors=[BLUE if each.converged else "white" for each in ended],
        edgecolors=BLUE,
    )
    label_below(ax, "starts, best first")
    failed = len(starts) - len(ended)
    left_out = f"; {failed} left the model's domain" if failed else ""
    write_title(figure, f"{len(starts)} starts{left_out}", AROUND.left)
    return figure


def _measures(figure: Figure, run: ShownRun) -> None:
    """Write what must stand beside every fit % below the title."""
    width, height = figure.get_size_inches()
    for place, shown in enumerate(run.channels):
        row = quality_row(run, shown)
        figure.text(
            AROUND.left / width,
            1.0 - (0.4 + 0.17 * place) / height,
            f"{row.channel}: fit {row.fit} %, RMSE {row.rmse}, R² {row.r_squared}; "
            f"initial state {row.start}; ignored: {row.ignored}",
            fontsize=NORMAL - 1.0,
            color=INK,
            va="top",
        )


def _plain_name(name: str) -> str:
    """A name that any file system takes."""
    return "".join(letter if letter.isalnum() or letter in "-_+." else "-" for letter in name)
