"""A row of a campaign's page: one run, its heading and its panels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.offsetbox import AnnotationBbox, HPacker, TextArea
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from swashplate.report.broken_lines import draw_broken, gap_rows
from swashplate.report.campaign_columns import Column, counted, signals_of
from swashplate.report.campaign_marks import (
    IGNORED,
    mark_clipped,
    mark_gaps,
    shade,
    spans_of,
    widened,
)
from swashplate.report.campaign_weights import FOOT, has_weights, mark_weights
from swashplate.report.style import BLUE, GREY, INK, SMALL, THIN, dress, zero_line

if TYPE_CHECKING:
    from swashplate.campaign import Channel, Experiment, InputSignal

Array = NDArray[np.float64]

PANEL = 0.86
"""Height of a panel. [inch]"""
_ROOM = 0.08
"""Empty share of a panel above and below its signal."""
_NEAR_ZERO = 0.02
"""A record that begins at less than this share of its length is shown from zero on."""
_ROLES = {"fit": "for the fit", "validate": "for validation"}


def fill_row(row: Sequence[Axes], columns: Sequence[Column], experiment: Experiment) -> None:
    """Draw a run into a row of panels that share their abscissa."""
    signals = signals_of(experiment)
    first = min(float(signal.time[0]) for signal in signals.values())
    last = max(float(signal.time[-1]) for signal in signals.values())
    if 0.0 < first < _NEAR_ZERO * (last - first):
        first = 0.0
    row[0].set_xlim(first, last if last > first else first + 1.0)
    for ax, column in zip(row, columns, strict=True):
        dress(ax)
        ax.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
        ax.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
        signal = signals.get(column.key)
        if signal is None:
            _say_missing(ax)
            continue
        _fill(ax, column, signal, experiment)
    row[0].add_artist(_heading(row[0], experiment))


def _say_missing(ax: Axes) -> None:
    ax.set_yticks([])
    ax.text(
        0.5,
        0.5,
        "not measured",
        transform=ax.transAxes,
        fontsize=SMALL,
        color=GREY,
        ha="center",
        va="center",
    )


def _fill(ax: Axes, column: Column, signal: InputSignal | Channel, experiment: Experiment) -> None:
    from swashplate.campaign import Channel

    factor = column.unit.factor
    values = factor * signal.values
    # the input has no weights, and a channel nothing that holds between its samples
    weight, held = None, False
    if isinstance(signal, Channel):
        weight = signal.weight
    else:
        held = signal.interpolation == "previous"
    zero_line(ax)
    low, high = column.limits(factor * counted(signal))
    margin = _ROOM * (high - low) or 1.0
    below = 0.0
    if weight is not None and has_weights(weight):
        # the weights at the foot have their own room
        below = (high - low + 2.0 * margin) * FOOT / (PANEL - FOOT)
    ax.set_ylim(low - margin - below, high + margin)
    if weight is None:
        shade(ax, _ignored(experiment, signal.time), IGNORED)
    else:
        shade(ax, widened(signal.time, spans_of(signal.time, weight == 0.0)), IGNORED)
        mark_weights(ax, signal.time, weight)
    if signal.limits is not None:
        mark_clipped(
            ax, signal.time, values, (factor * signal.limits[0], factor * signal.limits[1])
        )
    mark_gaps(ax, signal.time)
    color = INK if weight is None else BLUE
    draw_broken(ax, signal.time, values, color, held=held, width=THIN)


def _ignored(experiment: Experiment, time: Array) -> Array:
    """Windows that are left out of every channel, as far as there are stamps."""
    windows = [
        (max(start, float(time[0])), min(stop, float(time[-1])))
        for start, stop, _ in experiment.ignored
    ]
    return np.array(sorted(w for w in windows if w[0] < w[1])).reshape(-1, 2)


def _heading(ax: Axes, experiment: Experiment) -> AnnotationBbox:
    """Name of a run in bold, and what else there is to say of it, above its first panel."""
    letters = {"fontsize": SMALL, "color": INK}
    words = [experiment.maneuver, _ROLES[experiment.role], *_stamps_in_words(experiment)]
    line = HPacker(
        children=[
            TextArea(experiment.run, textprops={**letters, "fontweight": "bold"}),
            TextArea("  ·  ".join(words), textprops=letters),
        ],
        pad=0.0,
        sep=7.0,
        align="baseline",
    )
    return AnnotationBbox(
        line,
        (0.0, 1.0),
        xycoords="axes fraction",
        xybox=(0.0, 6.0),
        boxcoords="offset points",
        box_alignment=(0.0, 0.0),
        frameon=False,
        pad=0.0,
        annotation_clip=False,
    )


def _stamps_in_words(experiment: Experiment) -> list[str]:
    """The rates, and the gaps of the signal that has most."""
    stamps = {name or "input": each.time for (name, _), each in signals_of(experiment).items()}
    words = _rates_in_words(
        {name: 1.0 / float(np.median(np.diff(time))) for name, time in stamps.items()}
    )
    gaps = max((np.diff(time)[gap_rows(time)] for time in stamps.values()), key=np.size)
    if gaps.size:
        longest = f"{float(gaps.max()):.3g} s"
        words.append(
            f"a gap of {longest}" if gaps.size == 1 else f"{gaps.size} gaps, longest {longest}"
        )
    return words


def _rates_in_words(rates: Mapping[str, float]) -> list[str]:
    """The rate of all signals, or of each of two groups, or from which to which rates go. [Hz]"""
    groups: dict[float, list[str]] = {}
    for name, rate in rates.items():
        # stamps that jitter do not have quite the same rate
        same = (known for known in groups if abs(rate - known) < 0.01 * known)
        groups.setdefault(next(same, rate), []).append(name)
    written = {f"{rate:.0f}" if rate >= 100.0 else f"{rate:.3g}": rate for rate in groups}
    if len(groups) == 1:
        return [f"{next(iter(written))} Hz"]
    if len(groups) == 2:
        return [f"{', '.join(groups[rate])} {words} Hz" for words, rate in written.items()]
    return [f"{min(written, key=float)} to {max(written, key=float)} Hz"]
