"""Figure of one simulation: the chain's signals from command to speed, one under another."""

from __future__ import annotations

from math import degrees
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from swashplate.report.panels import NARROW, WIDE, Mark, Trace, fill_panel
from swashplate.report.shading import shade_handles, shade_limits
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
from swashplate.simulation.result import Limit, Simulation

Array = NDArray[np.float64]

WIDTH = 8.6
PANEL, GAP = 1.3, 0.22
AROUND = Margins(left=0.95, right=1.2, bottom=0.55, top=0.72)
"""Sizes. [inch]"""


class Panel(NamedTuple):
    """What one panel shows."""

    label: str
    traces: tuple[Trace, ...]
    limits: tuple[Limit, ...] = ()
    marks: tuple[Mark, ...] = ()


def plot_simulation(simulation: Simulation, *, title: str | None = None) -> Figure:
    """Figure of the chain's signals over time, with the active limits shaded.

    Parameters
    ----------
    simulation : Simulation
        What to show. Voltage has a panel only if the simulation was driven by one.
    title : str, optional
        By default the name of the parameter set.
    """
    panels = _panels(simulation)
    height = AROUND.bottom + AROUND.top + len(panels) * (PANEL + GAP) - GAP
    figure = new_figure(WIDTH, height)
    axes = figure.subplots(
        len(panels),
        sharex=True,
        squeeze=False,
        gridspec_kw={**margins(figure, AROUND), "hspace": GAP / PANEL},
    )[:, 0]
    for ax, panel in zip(axes, panels, strict=True):
        shade_limits(ax, simulation, panel.limits)
        fill_panel(figure, ax, panel.label, simulation.time, panel.traces, panel.marks)
    fit_time(axes[-1], simulation.time)
    label_below(axes[-1], "time (s)")
    line_up_labels(figure, axes, 0.58)
    write_title(figure, simulation.name if title is None else title, AROUND.left)
    handles = shade_handles(simulation)
    if handles:
        put_legend(figure, handles, AROUND.left, 0.42)
    return figure


def _panels(simulation: Simulation) -> list[Panel]:
    """The panels from command to speed, in the units that people read."""
    pump = simulation.pump
    pressure_unit, pressure_factor = _pressure_unit(simulation.stroker_pressure)
    panels = [
        Panel(
            "current\n(A)",
            (
                Trace(simulation.current_positive, BLUE, "positive"),
                Trace(simulation.current_negative, VERMILION, "negative"),
            ),
            (Limit.DEAD_ZONE, Limit.CURRENT_RATE),
            (Mark(pump.Z17, f"dead zone {pump.Z17:.2f} A"),),
        ),
        Panel(
            "spool\n(mm)",
            (
                # where the two are the same, the wide line shows on both sides of the narrow one
                Trace(1e3 * simulation.spool_position, BLUE, "position", WIDE),
                Trace(1e3 * simulation.orifice_opening, VERMILION, "opening", NARROW),
            ),
            (Limit.ORIFICE, Limit.SPOOL),
            tuple(
                Mark(1e3 * edge, f"orifice {signed(1e3 * edge, 2)} mm")
                for edge in (pump.Z16_plus, -pump.Z16_minus)
            ),
        ),
        Panel(
            f"stroker pressure\n({pressure_unit})",
            (Trace(pressure_factor * simulation.stroker_pressure, BLUE),),
            (Limit.RELIEF,),
        ),
        Panel(
            "swash angle\n(deg)",
            (Trace(np.degrees(simulation.swash_angle), BLUE),),
            (Limit.SWASH_STOP,),
            tuple(
                Mark(degrees(stop), f"stop {signed(degrees(stop), 1)}°")
                for stop in (pump.Z13_plus, -pump.Z13_minus)
            ),
        ),
        Panel(
            "shaft speed\n(deg/s)",
            (Trace(np.degrees(simulation.shaft_speed), BLUE),),
            (Limit.SWASH_STOP,),
        ),
    ]
    if simulation.voltage is not None:
        panels.insert(0, Panel("voltage\n(V)", (Trace(simulation.voltage, INK),)))
    return panels


def _pressure_unit(pressure: Array) -> tuple[str, float]:
    largest = float(np.abs(pressure).max())
    if largest >= 2e6:
        return "MPa", 1e-6
    return ("Pa", 1.0) if 0.0 < largest < 1e3 else ("kPa", 1e-3)
