"""Figure of a drive's envelope: the acceleration that it can have at each speed."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from swashplate.analysis.envelope import AcceleratedBy, AccelerationCurve, Envelope, Way
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.report.style import (
    BLUE,
    FAINT,
    INK,
    LINE,
    SMALL,
    VERMILION,
    Dashes,
    Margins,
    dress,
    label_below,
    line_up_labels,
    margins,
    new_figure,
    put_legend,
    signed,
    write_title,
    zero_line,
)

Array = NDArray[np.float64]

WIDTH, HEIGHT = 8.6, 5.0
AROUND = Margins(left=0.95, right=0.3, bottom=0.55, top=0.72)
"""Sizes. [inch]"""
ROOM = 1.12
"""How far the axes go beyond the speeds that are reached, and the accelerations there."""
DASHES: dict[AcceleratedBy, Dashes] = {
    "orifice": "solid",
    "spool stop": "dashed",
    "valve": "dotted",
}
WORDS: dict[AcceleratedBy, str] = {
    "orifice": "limited by the orifice",
    "spool stop": "limited by the spool's stop",
    "valve": "limited by the valve's opening",
}
BENEATH = 3.0
"""Width of the grey line, part of which lies under another. [pt]"""
FILLED = 0.08
"""Opacity of what can be reached."""


def plot_envelope(envelope: Envelope, *, title: str | None = None) -> Figure:
    """Figure of acceleration over speed with the limits labelled.

    The upper line is what +10 V gives, the lower one -10 V; between them everything can be
    reached. How a line is drawn says what limits it. The grey one is the stick let go.

    Parameters
    ----------
    envelope : Envelope
        What to show.
    title : str, optional
        By default it says what is shown.
    """
    figure = new_figure(WIDTH, HEIGHT)
    ax = figure.subplots(gridspec_kw=margins(figure, AROUND))
    dress(ax, "acceleration (deg/s²)")
    zero_line(ax)
    ax.axvline(0.0, color=FAINT, linewidth=0.8, zorder=1.2)
    low, high = (float(np.degrees(way.top_speed)) for way in (envelope.minus, envelope.plus))
    span = (high - low) or 1.0
    ax.set_xlim(low - (ROOM - 1.0) * span, high + (ROOM - 1.0) * span)
    drawn: set[AcceleratedBy] = set()
    most = []
    curves = (*envelope.accelerating, envelope.released)
    for curve, sign, color in zip(curves, (1.0, -1.0, 0.0), (BLUE, VERMILION, FAINT), strict=True):
        shown, parts = _part(curve, sign)
        most.append(float(np.abs(shown[1]).max()))
        drawn.update(parts)
        for by, start, stop in _runs(parts):
            ax.plot(
                shown[0, start:stop],
                shown[1, start:stop],
                color=color,
                linestyle=DASHES[by],
                linewidth=LINE if sign else BENEATH,
                zorder=2.0 if sign else 1.7,
            )
        if sign:
            ax.fill_between(shown[0], shown[1], color=color, alpha=FILLED, linewidth=0.0)
    height = 1.3 * max(most[:2]) or 1.0
    ax.set_ylim(-height, height)
    for way, color in ((envelope.plus, BLUE), (envelope.minus, VERMILION)):
        _mark(ax, way, color, height)
    label_below(ax, "speed (deg/s)")
    line_up_labels(figure, [ax], 0.6)
    words = f"{envelope.name}: acceleration that each speed allows" if title is None else title
    write_title(figure, words, AROUND.left)
    volts = f"{FULL_VOLTAGE:g} V"
    handles = [
        Line2D([], [], color=color, linewidth=2.0, label=label)
        for color, label in ((BLUE, f"+{volts}"), (VERMILION, f"−{volts}"), (FAINT, "let go"))
    ]
    handles += [
        Line2D([], [], color=INK, linestyle=dashes, linewidth=LINE, label=WORDS[by])
        for by, dashes in DASHES.items()
        if by in drawn
    ]
    put_legend(figure, handles, AROUND.left, 0.42)
    return figure


def _part(curve: AccelerationCurve, sign: float) -> tuple[Array, tuple[AcceleratedBy, ...]]:
    """Speed and acceleration (2, n), in degrees, and what sets each.

    Of the full commands only what speeds up their own way counts.
    """
    speed, acceleration = np.degrees(curve.speed), np.degrees(curve.acceleration)
    if sign:
        acceleration = sign * np.maximum(sign * acceleration, 0.0)
    return np.stack((speed, acceleration)), curve.by


def _runs(parts: tuple[AcceleratedBy, ...]) -> list[tuple[AcceleratedBy, int, int]]:
    """Stretches of one cause; each reaches to the first point of the next."""
    starts = [n for n in range(len(parts)) if n == 0 or parts[n] != parts[n - 1]]
    stops = [*(start + 1 for start in starts[1:]), len(parts)]
    return [(parts[start], start, stop) for start, stop in zip(starts, stops, strict=True)]


def _mark(ax: Axes, way: Way, color: str, height: float) -> None:
    """The speed that a way ends at, and the acceleration that it begins with."""
    speed, acceleration = np.degrees([way.top_speed, way.acceleration])
    up = way.acceleration > 0.0
    stopped = way.top_speed == way.speed_limit
    ax.axvline(speed, color=color, linewidth=1.0, linestyle="solid" if stopped else "dotted")
    what = "swash stop" if stopped else f"at {'+' if up else '−'}{FULL_VOLTAGE:g} V"
    ax.annotate(
        f"{what}\n{signed(speed, 3 if abs(speed) < 10.0 else 1)} deg/s",
        (speed, -0.96 * height if up else 0.96 * height),
        xytext=(-4.0 if up else 4.0, 0.0),
        textcoords="offset points",
        fontsize=SMALL,
        color=color,
        ha="right" if up else "left",
        va="bottom" if up else "top",
    )
    ax.plot([0.0], [acceleration], "o", color=color, markersize=4.5)
    ax.annotate(
        f"{way.accelerated_by}, at rest\n"
        f"{signed(acceleration, 2 if abs(acceleration) < 10.0 else 1)} deg/s²",
        (0.0, acceleration),
        xytext=(5.0, 6.0) if up else (-5.0, -6.0),  # away from where the line falls
        textcoords="offset points",
        fontsize=SMALL,
        color=color,
        ha="left" if up else "right",
        va="bottom" if up else "top",
    )
