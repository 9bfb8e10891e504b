"""Bokeh's figures in the house's looks."""

from __future__ import annotations

from typing import Any

from bokeh.models import LinearAxis

from swashplate.report.style import FAINT, GRID, INK

FONT = "Inter, 'Helvetica Neue', Arial, sans-serif"


def dress(figure: Any, label: str = "", below: str = "") -> None:
    """Give a figure its light grid, quiet axes and labels."""
    figure.background_fill_color = None
    figure.border_fill_color = None
    figure.outline_line_color = None
    figure.min_border_top = 6
    figure.min_border_bottom = 4
    figure.toolbar.logo = None
    figure.yaxis.axis_label = label
    figure.xaxis.axis_label = below
    for axis in (*figure.xaxis, *figure.yaxis):
        if isinstance(axis, LinearAxis):
            axis.ticker.desired_num_ticks = 4 if axis in figure.yaxis else 8
        axis.axis_line_color = FAINT
        axis.major_tick_line_color = FAINT
        axis.minor_tick_line_color = None
        axis.major_tick_in = 0
        axis.major_tick_out = 4
        axis.major_label_text_color = INK
        axis.major_label_text_font = FONT
        axis.major_label_text_font_size = "11px"
        axis.axis_label_text_color = INK
        axis.axis_label_text_font = FONT
        axis.axis_label_text_font_size = "12px"
        axis.axis_label_text_font_style = "normal"
    for grid in (*figure.xgrid, *figure.ygrid):
        grid.grid_line_color = GRID
