"""Figure of the full-order model beside the reduced one: what masses and load add to a run."""

from __future__ import annotations

from math import degrees
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from swashplate.full_order import Comparison
from swashplate.report.panels import NARROW, WIDE, Mark, Trace, fill_panel
from swashplate.report.shading import shade_handle, shade_stretches, stretches
from swashplate.report.style import (
    BLUE,
    INK,
    VERMILION,
    Margins,
    label_below,
    line_up_labels,
    margins,
    new_figure,
    put_legend,
    signed,
    write_title,
)
from swashplate.report.traces import fit_time
from swashplate.simulation.result import Limit

Flags = NDArray[np.int8]

WIDTH = 8.6
SMALL_PANEL, LARGE_PANEL, GAP = 1.0, 1.7, 0.2
LEGEND = 0.25
AROUND = Margins(left=0.95, right=1.2, bottom=0.55, top=0.47)
"""Sizes; a legend adds to the margin at the top. [inch]"""

LEAST_PRESSURE = 0.1
"""Range that a panel of pressures shows at least, so that rounding looks like nothing. [MPa]"""


class Panel(NamedTuple):
    """What one panel shows, in its unit."""

    label: str
    traces: tuple[Trace, ...]
    height: float = SMALL_PANEL
    marks: tuple[Mark, ...] = ()
    limit: Limit | None = None
    held: Flags | None = None
    """Where the limit holds: not zero."""
    least: float = 0.0
    """Range that is shown at least."""


def plot_full_order(found: Comparison, *, title: str | None = None) -> Figure:
    """Figure of both models over one command: speeds, their difference, and what lies between.

    Parameters
    ----------
    found : Comparison
        What `swashplate.full_order.compare` found. Limits that hold are shaded.
    title : str, optional
        By default the name of the physical set.
    """
    panels = _panels(found)
    handles = [
        shade_handle(panel.limit)
        for panel in panels
        if panel.limit is not None and panel.held is not None and panel.held.any()
    ]
    around = AROUND._replace(top=AROUND.top + LEGEND) if handles else AROUND
    heights = [panel.height for panel in panels]
    figure = new_figure(WIDTH, around.bottom + around.top + sum(heights) + GAP * (len(panels) - 1))
    axes = figure.subplots(
        len(panels),
        sharex=True,
        gridspec_kw={
            **margins(figure, around),
            "height_ratios": heights,
            "hspace": GAP * len(panels) / sum(heights),
        },
    )
    for ax, panel in zip(axes, panels, strict=True):
        if panel.limit is not None and panel.held is not None:
            held = stretches(panel.held != 0, found.time, found.full.record.rate)
            shade_stretches(ax, held, panel.limit)
        fill_panel(
            figure, ax, panel.label, found.time, panel.traces, panel.marks, least=panel.least
        )
    fit_time(axes[-1], found.time)
    label_below(axes[-1], "time (s)")
    line_up_labels(figure, axes, 0.58)
    write_title(figure, found.full.name if title is None else title, around.left)
    if handles:
        put_legend(figure, handles, around.left, 0.42)
    return figure


def _panels(found: Comparison) -> list[Panel]:
    full, differ = found.full, found.difference
    machine = full.case.p.machine
    command = (
        Panel("current\n(A)", (Trace(full.current, INK),))
        if found.voltage is None
        else Panel("voltage\n(V)", (Trace(found.voltage, INK),))
    )
    error = (
        Panel("difference\n(% of top)", (Trace(100.0 * found.error / differ.top_speed, INK),))
        if differ.moves
        else Panel("difference\n(deg/s)", (Trace(np.degrees(found.error), INK),))
    )
    stops = [degrees(angle) for angle in (machine.swash_stop_plus, -machine.swash_stop_minus)]
    openings = [
        1e3 * edge for edge in (machine.orifice_opening_plus, -machine.orifice_opening_minus)
    ]
    return [
        command,
        Panel(
            "shaft speed\n(deg/s)",
            (
                # where the two are the same, the wide line shows on both sides of the narrow one
                Trace(np.degrees(full.shaft_speed), BLUE, "five states", WIDE),
                Trace(np.degrees(found.reduced_speed), VERMILION, "one state", NARROW),
            ),
            LARGE_PANEL,
        ),
        error,
        Panel(
            "spool\n(mm)",
            (
                Trace(1e3 * full.spool_position, BLUE, "position", WIDE),
                Trace(1e3 * full.orifice_opening, VERMILION, "opening", NARROW),
            ),
            marks=tuple(Mark(edge, f"orifice {signed(edge, 2)} mm") for edge in openings),
            limit=Limit.SPOOL,
            held=full.spool_hold,
        ),
        Panel(
            "swash angle\n(deg)",
            (Trace(np.degrees(full.swash_angle), BLUE),),
            marks=tuple(Mark(stop, f"stop {signed(stop, 1)}°") for stop in stops),
            limit=Limit.SWASH_STOP,
            held=full.plate_hold,
        ),
        Panel(
            "stroker pres-\nsure (MPa)",
            (Trace(1e-6 * full.stroker_pressure, BLUE),),
            limit=Limit.RELIEF,
            held=full.relief_hold,
            least=LEAST_PRESSURE,
        ),
        Panel(
            "motor pressure\ndrop (MPa)",
            (Trace(1e-6 * full.motor_pressure_drop, BLUE),),
            least=LEAST_PRESSURE,
        ),
    ]
