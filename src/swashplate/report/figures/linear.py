"""Bode figure: gain, phase and distortion over the frequency, a line for each amplitude."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, overload

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MultipleLocator, NullFormatter, NullLocator
from numpy.typing import NDArray

from swashplate.errors import InputError
from swashplate.full_order import SIGNAL_UNITS
from swashplate.machine.linear import FrequencyResponse, LinearModel
from swashplate.report.style import (
    FAINT,
    GREY,
    LINE,
    Stroke,
    dress_given,
    handle,
    put_text,
    sheet,
    stroke_handles,
    strokes,
)
from swashplate.results import GivenAxes
from swashplate.units import DisplayUnit, display_unit

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

    Lines end at the frequency from which nothing moves, which the foot of the gain's panel states.

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
    if linear is not None:
        _check_ends(linear, response)
    unit = response.units.get(response.input, "")
    stroke_by_name = strokes(f"{amplitude:g} {unit}" for amplitude in response.amplitudes)
    legend = stroke_handles(stroke_by_name)
    if linear is not None:
        legend.append(handle(f"small motions{_operating_point_label(linear)}", GREY, "dashed"))
    output = WORDS.get(response.output, response.output.replace("_", " "))
    default_title = (
        f"{response.name}: {response.input} to {output}, sines about {response.bias:g} {unit}"
    )
    output_unit = _output_unit(response)
    by = f"({output_unit.name})" if "/" in output_unit.name else output_unit.name or "1"
    gain_label = f"gain ({by}/{unit})" if unit else f"gain ({by})"
    labels = [gain_label, "phase (deg)", "distortion (%)"]
    if ax is None:
        sheet_title = default_title if title is None else title
        heights = [2.3, 2.3, 1.3]
        figure, axes = sheet(heights, sheet_title, labels, "frequency (Hz)", legend=legend)
    else:
        count = min(max(np.size(np.asarray(ax, dtype=object)), 2), 3)
        axes = dress_given(ax, title, labels[:count], "frequency (Hz)", legend=legend)
    _draw_response(axes, response, list(stroke_by_name.values()))
    if linear is not None:
        _draw_linear(axes, linear, response)
    _scale_axes(axes, response)
    # the lines are at the top there
    put_text(
        axes[0],
        "\n".join(response.sentences_on_no_motion()),
        (0.0, 0.0),
        (4.0, 4.0),
        color=GREY,
        va="bottom",
    )
    if mark is not None and response.frequencies[0] <= mark <= response.frequencies[-1]:
        for panel in axes:
            panel.axvline(mark, color=FAINT, linewidth=1.0, zorder=1.3)
        position: dict[str, Any] = {"coords": ("data", "axes fraction"), "va": "bottom"}
        put_text(axes[0], f"{mark:g} Hz", (mark, 0.0), (3.0, 3.0), color=GREY, **position)
    return figure if ax is None else ax


def _check_ends(linear: LinearModel, response: FrequencyResponse) -> None:
    """Refuse a linear model between other signals than those of a sweep."""
    swept = (response.input, response.output)
    if (linear.input, linear.outputs[0]) != swept:
        raise InputError(
            f"The sweep is from {response.input} to {response.output}, but the linear model "
            f"from {linear.input} to {linear.outputs[0]}."
        )


def _operating_point_label(linear: LinearModel) -> str:
    """Operating point of a linear model, such as ``" about 2 V"``; empty if it is not known."""
    units = {**SIGNAL_UNITS, **linear.units}
    values = [f"{value:.4g} {units.get(name, '')}".rstrip() for name, value in linear.at.items()]
    return f" about {', '.join(values)}" if values else ""


def _output_unit(response: FrequencyResponse) -> DisplayUnit:
    """Unit in which a sweep's output is shown."""
    si = SIGNAL_UNITS.get(response.output, response.units.get(response.output, ""))
    return display_unit(si, float(response.gain.max()))


def _draw_response(
    axes: Sequence[Axes], response: FrequencyResponse, stroke_by_name: Sequence[Stroke]
) -> None:
    """Draw gain, phase and distortion, in so many axes as there are, a line for each amplitude."""
    gain = _output_unit(response).factor * response.gain
    swept = (gain, np.degrees(response.phase), 100.0 * response.distortion)
    marker = "o" if response.frequencies.size == 1 else None
    for panel, rows in zip(axes, swept, strict=False):
        for row, moves, stroke in zip(rows, response.has_motion, stroke_by_name, strict=True):
            style: dict[str, Any] = {"color": stroke.color, "ls": stroke.dashes, "lw": LINE}
            shown_row = np.where(moves, row, np.nan)
            panel.plot(response.frequencies, shown_row, marker=marker, ms=4.0, **style)


def _draw_linear(axes: Sequence[Axes], linear: LinearModel, response: FrequencyResponse) -> None:
    """Draw gain and phase of a linear model over the frequencies of a sweep."""
    highest = np.inf if linear.rate is None else 0.5 * linear.rate
    low, high = response.frequencies[0], response.frequencies[-1]
    fine = np.geomspace(low, min(high, highest), 400)
    ratio = linear.response(fine)[0]
    gain = _output_unit(response).factor * np.abs(ratio)
    phase = np.degrees(np.unwrap(np.angle(ratio)))
    for panel, row in zip(axes, (gain, phase), strict=False):
        panel.plot(fine, row, color=GREY, linestyle="dashed", linewidth=LINE, zorder=1.8)


def _scale_axes(axes: list[Axes], response: FrequencyResponse) -> None:
    gain, phase = axes[:2]
    lowest, highest = response.frequencies[0], response.frequencies[-1]
    for ax in axes:  # which need not share their abscissa
        ax.set_xscale("log")
        if lowest < highest:
            ax.set_xlim(lowest, highest)
        _set_plain_numbers(ax, "x", highest / lowest)
    gain.set_yscale("log")
    low, high = gain.get_ylim()
    low = max(low, high / DEEPEST)
    gain.set_ylim(low, high)
    _set_plain_numbers(gain, "y", high / low)
    low, high = phase.get_ylim()
    step = next((step for step in STEPS if (high - low) / step <= MOST_STEPS), STEPS[-1])
    phase.yaxis.set_major_locator(MultipleLocator(step))
    for distortion in axes[2:]:
        distortion.set_ylim(0.0, max(1.05 * 100.0 * float(response.distortion.max()), 1e-3))


def _set_plain_numbers(ax: Axes, which: str, span: float) -> None:
    """Write plain numbers along a logarithmic axis, as many as fit."""
    axis = ax.xaxis if which == "x" else ax.yaxis
    margin = DECADE**3 if which == "x" else DECADE**2
    subs = (1.0, 2.0, 5.0) if span < margin else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs, numticks=15))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())
