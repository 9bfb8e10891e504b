"""Bokeh's figures of runs: input, overlays and residuals over one time axis.

A run's figures are made once for each set of channels, empty; the page fills a copy of them with
the samples of a run when the reader comes to it (`page.js`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from bokeh.embed import json_item
from bokeh.layouts import gridplot
from bokeh.models import (
    BoxZoomTool,
    ColumnDataSource,
    CrosshairTool,
    PanTool,
    Range1d,
    ResetTool,
    SaveTool,
    Span,
    WheelZoomTool,
)
from bokeh.plotting import figure

from swashplate.report.axis_labels import in_lines
from swashplate.report.display_units import display_unit
from swashplate.report.fit_page.bokeh_style import dress
from swashplate.report.fit_page.runs import ShownRun
from swashplate.report.style import BLUE, FAINT, GREY, INK, VERMILION

HEIGHTS = {"input": 92, "overlay": 156, "residual": 98}
AXIS = 40
"""What the lowest panel is higher for its time axis. [px]"""
MARGIN = 10
"""What of a panel's height is not its axis. [px]"""
LETTER = 6.2
"""Width of a letter of a label. [px]"""


class Stack(NamedTuple):
    """What the panels of a run are: runs with the same get the same figures."""

    input: str
    """Label of the input's panel."""
    channels: tuple[tuple[str, str], ...]
    """Labels of each channel's overlay and residual."""


def stack_of(run: ShownRun) -> Stack:
    """Which panels a run needs."""
    drive = run.experiment.input
    unit = display_unit(drive.unit, float(np.abs(drive.values).max(initial=0.0)))
    word = drive.kind if drive.kind != "other" else "input"
    stages = [each.stage for each in run.channels]
    channels = []
    for each in run.channels:
        name = each.quality.channel
        twice = sum(name == other.quality.channel for other in run.channels) > 1
        words = f"{name}, {each.stage}" if twice and len(set(stages)) > 1 else name
        channels.append((each.unit.label(words), each.small.label("residual")))
    return Stack(unit.label(word), tuple(channels))


def stack_item(stack: Stack) -> Any:
    """The figures of a stack as Bokeh's JSON, all sources empty.

    Sources are named ``"input"``, ``"overlay 0"``, ``"residual 0"``, ``"ignored 0"`` and so on;
    the time range is named ``"time"``.
    """
    time = Range1d(0.0, 1.0, name="time")
    across = Span(dimension="height", line_color=FAINT, line_width=1)
    panels = [_panel(stack.input, "input", time, across)]
    _line(panels[0], "input", "values", INK)
    for number, (overlay, residual) in enumerate(stack.channels):
        ignored = ColumnDataSource({"first": [], "last": []}, name=f"ignored {number}")
        upper = _panel(overlay, "overlay", time, across)
        _shade(upper, ignored)
        _line(upper, f"overlay {number}", "measured", GREY, width=1.8)
        _line(upper, f"overlay {number}", "simulated", VERMILION)
        lower = _panel(residual, "residual", time, across)
        _shade(lower, ignored)
        lower.add_layout(Span(dimension="width", location=0.0, line_color=FAINT))
        _line(lower, f"residual {number}", "residual", BLUE)
        panels += [upper, lower]
    for each in panels[:-1]:
        each.xaxis.visible = False
    panels[-1].xaxis.axis_label = "time (s)"
    panels[-1].height += AXIS
    grid = gridplot(
        [[each] for each in panels],
        sizing_mode="stretch_width",
        toolbar_location="right",
        merge_tools=True,
        toolbar_options={"logo": None},
    )
    return json_item(grid)


def _panel(label: str, kind: str, time: Range1d, across: Span) -> Any:
    zoom = BoxZoomTool(dimensions="width")
    tools = [
        zoom,
        PanTool(dimensions="width"),
        # without a key held the wheel scrolls the page
        WheelZoomTool(dimensions="width", modifiers={"ctrl": True}),
        ResetTool(),
        SaveTool(),
        CrosshairTool(overlay=across),
    ]
    panel = figure(
        height=HEIGHTS[kind],
        x_range=time,
        tools=tools,
        active_drag=zoom,
        min_border_left=94,
        sizing_mode="stretch_width",
        # many points: let the browser draw them at once
        output_backend="canvas",
    )
    dress(panel, in_lines(label, int((HEIGHTS[kind] - MARGIN) / LETTER)))
    return panel


def _line(panel: Any, source: str, column: str, color: str, width: float = 1.2) -> None:
    data = panel.select_one({"name": source})
    if data is None:
        data = ColumnDataSource({"time": []}, name=source)
    data.data[column] = []
    panel.line("time", column, source=data, color=color, line_width=width, line_join="round")


def _shade(panel: Any, ignored: ColumnDataSource) -> None:
    """Mark windows that do not count."""
    panel.vstrip(
        x0="first", x1="last", source=ignored, fill_color=FAINT, fill_alpha=0.35, line_color=None
    )


def stacks_of(runs: Sequence[ShownRun]) -> dict[Stack, str]:
    """Every stack that the runs need, with a short name for each."""
    return {
        stack: f"stack-{number}"
        for number, stack in enumerate(dict.fromkeys(stack_of(run) for run in runs))
    }
