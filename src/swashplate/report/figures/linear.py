"""Bode figure: gain, phase and distortion over the frequency, a line for each amplitude."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, overload

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MultipleLocator, NullFormatter, NullLocator
from numpy.typing import NDArray

from swashplate.drive import LinearDrive
from swashplate.errors import InputError
from swashplate.full_order import SIGNAL_UNITS
from swashplate.linear import FrequencyResponse, LinearModel
from swashplate.report.style import (
    FAINT,
    GREY,
    LINE,
    dress_given,
    handle,
    sheet,
    strokes,
    write_words,
)
from swashplate.results import GivenAxes
from swashplate.units import display_unit

Array = NDArray[np.float64]

DECADE = 10.0
DEEPEST = 2e3
"""Gains this far below the largest are not shown: lines that end in a dead zone fall for ever."""
STEPS = (15.0, 30.0, 45.0, 90.0, 180.0, 360.0, 720.0)
"""Distances of the phase's grid lines. [deg]"""
MOST_STEPS = 7
WORDS = {"shaft_speed": "speed"}


@overload
def plot_bode(
    response: FrequencyResponse,
    *,
    linear: LinearModel | None = None,
    mark: float | None = 0.3,
    ax: None = None,
    title: str | None = None,
) -> Figure: ...


@overload
def plot_bode(
    response: FrequencyResponse,
    *,
    linear: LinearModel | None = None,
    mark: float | None = 0.3,
    ax: GivenAxes,
    title: str | None = None,
) -> GivenAxes: ...


def plot_bode(
    response: FrequencyResponse,
    *,
    linear: LinearModel | None = None,
    mark: float | None = 0.3,
    ax: Axes | Sequence[Axes] | None = None,
    title: str | None = None,
) -> Figure | Axes | Sequence[Axes]:
    """Figure of gain, phase and distortion over the frequency, a line for each amplitude.

    Lines end where nothing moves any more, which is said at the foot of the gain.

    Parameters
    ----------
    response : FrequencyResponse
        What was swept.
    linear : LinearModel, optional
        Its first output is drawn dashed, for comparison.
    mark : float, optional
        A frequency to mark. [Hz]
    ax : sequence of two or three matplotlib axes, optional
        Where to draw gain and phase, and in the third the distortion, which share their frequency;
        by default in a new figure. A single one is refused: a gain without its phase is no Bode
        plot.

    Returns
    -------
    Figure, or `ax` as it was given

    Raises
    ------
    InputError
        If the linear model has another input or first output than the sweep, or for another number
        of axes.

    Examples
    --------
    >>> from swashplate import Drive
    >>> from swashplate.report.figures import plot_bode
    >>> response = Drive.preset("hoist").frequency_response([0.1, 0.5], [3.0], bias=6.0)
    >>> plot_bode(response).savefig("bode.png")
    """
    ends = (response.input, response.output)
    if linear is not None and (linear.input, linear.outputs[0]) != ends:
        raise InputError(
            f"The sweep is from {response.input} to {response.output}, but the linear model from "
            f"{linear.input} to {linear.outputs[0]}."
        )
    unit = response.units.get(response.input, "")
    looks = strokes(f"{amplitude:g} {unit}" for amplitude in response.amplitudes)
    legend = [handle(name, *look) for name, look in looks.items()]
    if linear is not None:
        about = ""
        if isinstance(linear, LinearDrive):
            point = linear.operating_point
            where = f"{point.current:.4g} A" if point.voltage is None else f"{point.voltage:.4g} V"
            about = f" about {where}"
        legend.append(handle(f"small motions{about}", GREY, "dashed"))
    output = WORDS.get(response.output, response.output.replace("_", " "))
    words = f"{response.name}: {response.input} to {output}, sines about {response.bias:g} {unit}"
    si = SIGNAL_UNITS.get(response.output, response.units.get(response.output, ""))
    shown = display_unit(si, float(response.gain.max()))
    by = f"({shown.name})" if "/" in shown.name else shown.name or "1"
    gain_label = f"gain ({by}/{unit})" if unit else f"gain ({by})"
    labels = [gain_label, "phase (deg)", "distortion (%)"]
    if ax is None:
        words = words if title is None else title
        figure, axes = sheet([2.3, 2.3, 1.3], words, labels, "frequency (Hz)", legend=legend)
    else:
        count = min(max(np.size(np.asarray(ax, dtype=object)), 2), 3)
        axes = dress_given(ax, title, labels[:count], "frequency (Hz)", legend=legend)
    swept = shown.factor * response.gain, np.degrees(response.phase), 100.0 * response.distortion
    marker = "o" if response.frequencies.size == 1 else None
    for panel, rows in zip(axes, swept, strict=False):
        for row, moves, look in zip(rows, response.moves, looks.values(), strict=True):
            style: dict[str, Any] = {"color": look.color, "ls": look.dashes, "lw": LINE}
            shown_row = np.where(moves, row, np.nan)
            panel.plot(response.frequencies, shown_row, marker=marker, ms=4.0, **style)
    if linear is not None:
        highest = np.inf if linear.rate is None else 0.5 * linear.rate
        low, high = response.frequencies[0], response.frequencies[-1]
        fine = np.geomspace(low, min(high, highest), 400)
        ratio = linear.response(fine)[0]
        small = (shown.factor * np.abs(ratio), np.degrees(np.unwrap(np.angle(ratio))))
        for panel, row in zip(axes, small, strict=False):
            panel.plot(fine, row, color=GREY, linestyle="dashed", linewidth=LINE, zorder=1.8)
    _scale(axes, response)
    # the lines are at the top there
    write_words(
        axes[0], "\n".join(response.still()), (0.0, 0.0), (4.0, 4.0), color=GREY, va="bottom"
    )
    if mark is not None and response.frequencies[0] <= mark <= response.frequencies[-1]:
        for panel in axes:
            panel.axvline(mark, color=FAINT, linewidth=1.0, zorder=1.3)
        position: dict[str, Any] = {"coords": ("data", "axes fraction"), "va": "bottom"}
        write_words(axes[0], f"{mark:g} Hz", (mark, 0.0), (3.0, 3.0), color=GREY, **position)
    return figure if ax is None else ax


def _scale(axes: list[Axes], response: FrequencyResponse) -> None:
    gain, phase = axes[:2]
    ends = response.frequencies[0], response.frequencies[-1]
    for ax in axes:  # which need not share their abscissa
        ax.set_xscale("log")
        if ends[0] < ends[1]:
            ax.set_xlim(*ends)
        _number(ax, "x", ends[1] / ends[0])
    gain.set_yscale("log")
    low, high = gain.get_ylim()
    low = max(low, high / DEEPEST)
    gain.set_ylim(low, high)
    _number(gain, "y", high / low)
    low, high = phase.get_ylim()
    step = next((step for step in STEPS if (high - low) / step <= MOST_STEPS), STEPS[-1])
    phase.yaxis.set_major_locator(MultipleLocator(step))
    for distortion in axes[2:]:
        distortion.set_ylim(0.0, max(1.05 * 100.0 * float(response.distortion.max()), 1e-3))


def _number(ax: Axes, which: str, span: float) -> None:
    """Plain numbers along a logarithmic axis, as many as fit."""
    axis = ax.xaxis if which == "x" else ax.yaxis
    room = DECADE**3 if which == "x" else DECADE**2
    subs = (1.0, 2.0, 5.0) if span < room else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs, numticks=15))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())
