"""Figures of a fit: runs for print, the costs of the starts, and a fit at a glance."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from textwrap import wrap
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from swashplate.campaign import Campaign
from swashplate.errors import InputError
from swashplate.identification.assessment import Assessment, assess
from swashplate.identification.fitting import Fit
from swashplate.identification.solving import StartResult
from swashplate.identification.validation import RunQuality, ignored_windows
from swashplate.identification.verdict import starts_of
from swashplate.report.fit_report.runs import (
    ShownRun,
    off_scale,
    predicted_runs,
    run_words,
    shown_runs,
)
from swashplate.report.lines import COARSE, IGNORED, draw, shade
from swashplate.report.style import (
    BLUE,
    FAINT,
    GREY,
    GRID,
    INK,
    LINE,
    NORMAL,
    SMALL,
    VERMILION,
    dress,
    handle,
    in_lines,
    label_below,
    new_figure,
    put_legend,
    save_figure,
    sheet,
    zero_line,
)
from swashplate.tables import made_folder
from swashplate.units import display_unit

HEIGHTS = {"input": 1.0, "overlay": 1.75, "residual": 1.1}
"""Of panels with their ticks. [inch]"""
LETTERS = 110
"""In a line of words above the panels."""
LETTER = 0.065
"""Width of a letter of a label. [inch]"""


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
    made_folder(folder)
    for number, run in enumerate(runs, start=1):
        path = folder / f"overlay-{number:02d}-{_plain_name(run.name)}.{format}"
        save_figure(plot_overlay(run, virtual=campaign.virtual), path)
        yield path


def plot_overlay(run: ShownRun, *, virtual: bool = False) -> Figure:
    """Figure of one run: its input, and of each channel measured, simulated and residual."""
    kinds = ["input", *(["overlay", "residual"] * len(run.channels))]
    what, test = ("virtual test, ", "virtual test") if virtual else ("", "measured")
    role = "held out" if run.validates else "fitted"
    words = (f"{each.quality.channel}: {run_words(each.quality)}" for each in run.channels)
    said = [line for each in words for line in wrap(each, LETTERS)]
    title = f"{run.name} ({what}{role})"
    figure, axes = sheet([HEIGHTS[kind] for kind in kinds], title, lines=len(said) + 1)
    drive = run.experiment.input
    dress(axes[0], run.input_label)
    held = drive.interpolation == "previous"
    draw(axes[0], drive.time, run.input_unit.factor * drive.values, INK, held=held, columns=COARSE)
    for place, shown in enumerate(run.channels):
        upper, lower = axes[1 + 2 * place], axes[2 + 2 * place]
        time, factor = shown.channel.time, shown.unit.factor
        residual = shown.small.factor * shown.quality.residual
        labels = (shown.unit.label(shown.quality.channel), shown.small.label("residual"))
        for ax, label, kind in zip((upper, lower), labels, ("overlay", "residual"), strict=True):
            dress(ax, in_lines(label, int((HEIGHTS[kind] - 0.25) / LETTER)))
        zero_line(lower)
        draw(upper, time, factor * shown.channel.values, GREY, columns=COARSE)
        draw(upper, time, factor * shown.quality.simulated, VERMILION, columns=COARSE)
        draw(lower, time, residual, BLUE, columns=COARSE)
        for ax, values in ((upper, factor * shown.channel.values), (lower, residual)):
            if off_scale(shown.channel, values).any():
                counted = values[shown.channel.used]
                room = 0.1 * float(np.ptp(counted))
                ax.set_ylim(float(counted.min()) - room, float(counted.max()) + room)
            shade(ax, np.reshape(ignored_windows(shown.channel), (-1, 2)), IGNORED)
    axes[-1].set_xlim(float(drive.time[0]), float(drive.time[-1]))
    label_below(axes[-1], "time (s)")
    axes[0].set_title("\n".join(said), loc="left", fontsize=NORMAL - 1.0, color=INK, pad=20.0)
    handles = [
        handle(test, GREY),
        handle("simulated", VERMILION),
        handle(f"simulated less {test}", BLUE),
    ]
    put_legend(axes[0], handles)
    return figure


def plot_waterfall(starts: Sequence[StartResult]) -> Figure:
    """Figure of the costs that the starts reached, best first; hollow ones did not converge."""
    ended = sorted((each for each in starts if np.isfinite(each.cost)), key=lambda s: s.cost)
    failed = len(starts) - len(ended)
    left_out = f"; {failed} left the model's domain" if failed else ""
    figure, (ax,) = sheet([2.6], f"{len(starts)} starts{left_out}", lines=0)
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
    return figure


def _plain_name(name: str) -> str:
    """A name that any file system takes."""
    return "".join(letter if letter.isalnum() or letter in "-_+." else "-" for letter in name)


# --- a fit at a glance ----------------------------------------------------------------------------


def plot_fit(
    run: RunQuality,
    assessments: Sequence[Assessment],
    truth: Mapping[str, float] | None = None,
) -> Figure:
    """Figure of one run, measured and simulated, beside the estimates relative to a reference.

    Parameters
    ----------
    run : RunQuality
        The run to show, a speed as a rule.
    assessments : sequence of Assessment
        Of the stages; unknowns of single runs are left out.
    truth : mapping of str to float, optional
        True values by the unknowns' names; without it intervals stand about the estimates.

    Raises
    ------
    InputError
        If no unknown has an interval with two ends.
    """
    figure = new_figure(10.0, 5.6)
    grid = figure.add_gridspec(3, 2, width_ratios=(1.5, 1.0))
    speed = figure.add_subplot(grid[:2, 0])
    command = figure.add_subplot(grid[2, 0], sharex=speed)
    _run(speed, command, run)
    _estimates(figure.add_subplot(grid[:, 1]), assessments, truth)
    return figure


def _run(ax: Axes, below: Axes, run: RunQuality) -> None:
    channel = run.experiment[run.channel]
    unit = display_unit(channel.unit)
    ax.plot(channel.time, unit.factor * channel.values, color=FAINT, lw=2.6, label="measured")
    ax.plot(channel.time, unit.factor * run.simulated, color=BLUE, lw=LINE, label="simulated")
    dress(ax, unit.label("speed"))
    ax.tick_params(labelbottom=False)
    ax.legend(loc="lower left", frameon=False, fontsize=SMALL)
    percent = run.measures.fit_percent
    said = "" if percent is None else f", fit {percent:.1f} %"
    ax.set_title(
        f"{run.experiment.run}: held out, predicted from the voltage{said}",
        loc="left",
        fontsize=SMALL,
        color=INK,
    )
    source = run.experiment.input
    below.plot(source.time, source.values, color=GREY, lw=LINE)
    dress(below, f"{source.kind} ({source.unit})")
    label_below(below, "time (s)")


def _estimates(
    ax: Axes, assessments: Sequence[Assessment], truth: Mapping[str, float] | None
) -> None:
    rows = [
        (each, each.value if truth is None else truth[each.name])
        for assessment in assessments
        for each, unknown in zip(
            assessment.uncertainty.estimates, assessment.stage.problem.unknowns, strict=True
        )
        if unknown.run is None and (truth is None or each.name in truth)
    ]
    shown = [(each, about) for each, about in rows if None not in (each.lower, each.upper)]
    if not shown:
        raise InputError("No parameter has an interval with two ends: there is nothing to draw.")
    reach: list[float] = []
    for place, (each, about) in enumerate(shown):
        assert each.lower is not None
        assert each.upper is not None
        ends = sorted(100.0 * (end / about - 1.0) for end in (each.lower, each.upper))
        reach.append(max(abs(end) for end in ends))
        holds = ends[0] <= 0.0 <= ends[1]
        color = BLUE if holds else VERMILION
        ax.plot(ends, [place, place], color=color, lw=2.0, solid_capstyle="butt")
        ax.plot(100.0 * (each.value / about - 1.0), place, "o", color=color, ms=3.0)
    ax.axvline(0.0, color=GREY, lw=0.8)
    ax.set_yticks(range(len(shown)), [each.name for each, _ in shown], fontsize=SMALL - 1.5)
    ax.set_ylim(len(shown) - 0.4, -0.6)
    # a few wide ones must not make all others points
    straight = max(float(np.quantile(reach, 0.8)), 1e-9)
    ax.set_xscale("symlog", linthresh=straight, linscale=2.0)
    ticks = [0.5 * straight, straight, *(straight * 10.0**k for k in range(1, 3))]
    ticks = [float(f"{tick:.1g}") for tick in ticks if tick <= max(reach) or tick <= straight]
    ax.set_xticks([*(-tick for tick in reversed(ticks)), 0.0, *ticks])
    ax.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    ax.xaxis.set_minor_locator(NullLocator())
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(axis="x", color=GRID, lw=0.6)
    ax.set_axisbelow(True)
    about_what = "the truth" if truth is not None else "the estimate"
    label_below(ax, f"95 % interval about {about_what} (%)")
    ax.set_title("estimates", loc="left", fontsize=SMALL, color=INK)
