"""Figures of a page: the runs over time, and what the data tell of the unknowns.

Large ones are Bokeh's; small ones are SVG in the cells of tables: they print, and cost nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from bokeh.embed import json_item
from bokeh.layouts import gridplot
from bokeh.models import (
    BasicTicker,
    BoxZoomTool,
    ColorBar,
    ColumnDataSource,
    CrosshairTool,
    LinearAxis,
    LinearColorMapper,
    PanTool,
    Range1d,
    ResetTool,
    SaveTool,
    Span,
    WheelZoomTool,
)
from bokeh.plotting import figure
from markupsafe import Markup
from numpy.typing import NDArray

from swashplate.identification.acceptance import SAME
from swashplate.identification.identifiability import Identifiability
from swashplate.identification.noise import Covariance
from swashplate.identification.profile import Profile
from swashplate.identification.solving import StartResult
from swashplate.identification.unknowns import Unknown
from swashplate.identification.validation import ResidualTest
from swashplate.report.fit_report.runs import ShownRun
from swashplate.report.lines import thinned
from swashplate.report.style import BLUE, FAINT, GREY, GRID, INK, VERMILION, in_lines

Array = NDArray[np.float64]

HEIGHTS = {"input": 92, "overlay": 156, "residual": 98}
AXIS = 40
"""What the lowest panel is higher for its time axis. [px]"""
MARGIN = 10
"""What of a panel's height is not its axis. [px]"""
LETTER = 6.2
"""Width of a letter of a label. [px]"""
FONT = "Inter, 'Helvetica Neue', Arial, sans-serif"
ROW = 15
"""Height of a bar with its name. [px]"""
CELL = 17
"""Size of a cell of the correlations. [px]"""
MOST = 60
"""Unknowns up to which correlations are drawn."""
LEAST_SCALE = 10.0 * SAME
"""Range of the starts' costs, of the best, below which differences are not drawn larger."""


# --- runs -----------------------------------------------------------------------------------------


class Stack(NamedTuple):
    """What the panels of a run are: runs with the same get the same figures.

    The figures are made once for each, empty; the page fills a copy of them with the samples of a
    run when the reader comes to it (`page.js`).
    """

    input: str
    """Label of the input's panel."""
    channels: tuple[tuple[str, str], ...]
    """Labels of each channel's overlay and residual."""


def stack_of(run: ShownRun) -> Stack:
    """Which panels a run needs."""
    names = [each.quality.channel for each in run.channels]
    several = len({each.stage for each in run.channels}) > 1
    channels = []
    for each, name in zip(run.channels, names, strict=True):
        words = f"{name}, {each.stage}" if names.count(name) > 1 and several else name
        channels.append((each.unit.label(words), each.small.label("residual")))
    return Stack(run.input_label, tuple(channels))


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
        lower = _panel(residual, "residual", time, across)
        for each in (upper, lower):  # windows that do not count
            look = {"fill_color": FAINT, "fill_alpha": 0.35, "line_color": None}
            each.vstrip(x0="first", x1="last", source=ignored, **look)
        _line(upper, f"overlay {number}", "measured", GREY, width=1.8)
        _line(upper, f"overlay {number}", "simulated", VERMILION)
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


def dress(panel: Any, label: str = "", below: str = "") -> None:
    """Give a figure of Bokeh's its light grid, quiet axes and labels."""
    panel.background_fill_color = panel.border_fill_color = panel.outline_line_color = None
    panel.min_border_top, panel.min_border_bottom = 6, 4
    panel.toolbar.logo = None
    panel.yaxis.axis_label, panel.xaxis.axis_label = label, below
    for axis in (*panel.xaxis, *panel.yaxis):
        if isinstance(axis, LinearAxis):
            axis.ticker.desired_num_ticks = 4 if axis in panel.yaxis else 8
        axis.axis_line_color = axis.major_tick_line_color = FAINT
        axis.minor_tick_line_color = None
        axis.major_tick_in, axis.major_tick_out = 0, 4
        axis.major_label_text_color = axis.axis_label_text_color = INK
        axis.major_label_text_font = axis.axis_label_text_font = FONT
        axis.major_label_text_font_size, axis.axis_label_text_font_size = "11px", "12px"
        axis.axis_label_text_font_style = "normal"
    for grid in (*panel.xgrid, *panel.ygrid):
        grid.grid_line_color = GRID


# --- what the data tell ---------------------------------------------------------------------------


def sensitivity_item(found: Identifiability, shown: Sequence[bool]) -> Any:
    """Bars: how much all weighted residuals change for 1 % of each unknown that is shown."""
    order = np.argsort(found.sensitivity, kind="stable")
    moving = [int(k) for k in order if found.sensitivity[k] > 0.0 and shown[k]]
    names = [found.variables.names[k] for k in moving]
    sizes = [float(found.sensitivity[k]) for k in moving]
    colors = [GREY if found.variables.at_bound[k] else BLUE for k in moving]
    # a logarithmic axis has no zero to start from
    low = 10.0 ** (np.floor(np.log10(min(sizes, default=1.0))) - 0.5)
    panel = figure(
        height=60 + ROW * max(len(names), 1),
        y_range=names or ["none"],
        x_axis_type="log",
        x_range=(low, 2.0 * max(sizes, default=1.0)),
        tools="hover,save",
        tooltips=[("unknown", "@name"), ("change for 1 %", "@size{0.000 a}")],
        sizing_mode="stretch_width",
        toolbar_location=None,
    )
    source = ColumnDataSource({"name": names, "size": sizes, "color": colors})
    panel.hbar(y="name", right="size", left=low, height=0.62, color="color", source=source)
    dress(panel, "", "change of all weighted residuals for 1 % of the unknown")
    panel.ygrid.grid_line_color = None
    return json_item(panel)


def correlation_item(covariance: Covariance, shown: Sequence[bool]) -> Any | None:
    """Heat map of the estimates' correlations; None where there are none, or too many to draw.

    Parameters
    ----------
    covariance : Covariance
        The quoted one.
    shown : sequence of bool
        Which unknowns to draw; those of single runs, for instance, are not.
    """
    kept = np.flatnonzero(np.asarray(shown) & covariance.determined)
    if not 2 <= kept.size <= MOST:
        return None
    names = [covariance.variables.names[k] for k in kept]
    values = covariance.correlation[np.ix_(kept, kept)]
    rows, columns = np.divmod(np.arange(values.size), kept.size)
    source = ColumnDataSource(
        {
            "first": [names[k] for k in rows],
            "second": [names[k] for k in columns],
            "value": values.ravel(),
        }
    )
    panel = figure(
        width=150 + CELL * kept.size + 70,
        height=110 + CELL * kept.size,
        x_range=names,
        y_range=names[::-1],
        tools="hover,save",
        tooltips=[("", "@first, @second"), ("correlation", "@value{+0.000}")],
        toolbar_location=None,
    )
    colors = LinearColorMapper(palette=diverging(), low=-1.0, high=1.0)
    panel.rect(
        "second",
        "first",
        0.94,
        0.94,
        source=source,
        line_color=None,
        fill_color={"field": "value", "transform": colors},
    )
    dress(panel)
    panel.xaxis.major_label_orientation = np.pi / 3.0
    panel.xgrid.grid_line_color = panel.ygrid.grid_line_color = None
    bar = ColorBar(color_mapper=colors, width=10, bar_line_color=None, title=None)
    panel.add_layout(bar, "right")
    return json_item(panel)


def waterfall_item(starts: Sequence[StartResult]) -> Any:
    """The costs that the starts reached, best first, as multiples of the best one."""
    ended = sorted((each for each in starts if np.isfinite(each.cost)), key=lambda each: each.cost)
    best = ended[0].cost if ended else 1.0
    costs = [each.cost / best if best > 0.0 else each.cost for each in ended]
    source = ColumnDataSource(
        {
            "place": list(range(1, len(ended) + 1)),
            "cost": costs,
            "start": [each.number for each in ended],
            "evaluations": [each.evaluations for each in ended],
            "color": [BLUE if each.converged else "white" for each in ended],
        }
    )
    wide = bool(costs) and best > 0.0 and costs[-1] > 10.0
    panel = figure(
        height=260,
        y_axis_type="log" if wide else "linear",
        tools="hover,save",
        tooltips=[
            ("start", "@start"),
            ("cost", "@cost{0.000000}"),
            ("evaluations", "@evaluations"),
        ],
        sizing_mode="stretch_width",
        toolbar_location=None,
    )
    panel.scatter("place", "cost", size=7, line_color=BLUE, fill_color="color", source=source)
    dress(panel, "cost, best = 1" if best > 0.0 else "cost", "starts, best first")
    if best > 0.0 and costs[-1] < 1.0 + LEAST_SCALE:
        panel.y_range = Range1d(1.0 - LEAST_SCALE, 1.0 + LEAST_SCALE)
    panel.xaxis.ticker = BasicTicker(desired_num_ticks=8, min_interval=1.0)
    return json_item(panel)


def profile_item(profile: Profile, unknown: Unknown, name: str) -> Any:
    """The least cost over one unknown, above that of the optimum, and where the interval ends."""
    values = [unknown.to_value(each.number) for each in profile.points]
    rises = [each.cost - profile.cost for each in profile.points]
    panel = figure(
        height=220,
        width=330,
        tools="hover,save",
        toolbar_location=None,
        tooltips=[("value", "@x{0.00000e+0}"), ("rise", "@y{0.000}")],
    )
    panel.line(values, rises, color=BLUE, line_width=1.4)
    panel.scatter(values, rises, color=BLUE, size=4)
    panel.add_layout(
        Span(
            dimension="width",
            location=profile.rise,
            line_color=VERMILION,
            line_dash="dashed",
        )
    )
    dress(panel, "rise of the cost", f"{name} ({unknown.unit})" if unknown.unit else name)
    panel.xaxis.ticker.desired_num_ticks = 4
    return json_item(panel)


def diverging(steps: int = 101) -> list[str]:
    """Colours from blue over white to vermilion."""
    ends = [np.array([int(each[k : k + 2], 16) for k in (1, 3, 5)]) for each in (BLUE, VERMILION)]
    white = np.full(3, 255.0)
    colors = []
    for share in np.linspace(-1.0, 1.0, steps):
        end = ends[0] if share < 0.0 else ends[1]
        mixed = white + abs(share) * (end - white)
        colors.append("#" + "".join(f"{round(x):02x}" for x in mixed))
    return colors


# --- small charts ---------------------------------------------------------------------------------

WIDTH, HEIGHT, EDGE = 230.0, 64.0, 4.0
"""Size and white edge of a chart. [px]"""
STRETCHES = 120
"""Of the lags, of which a chart shows the lowest and the highest value."""


def autocorrelation_chart(test: ResidualTest) -> Markup:
    """The residuals' own correlation, from lag 0, with the band of white noise."""
    band = test.white_band
    words = f"autocorrelation over {test.lags[-1]:.2g} s, white-noise band ±{band:.3f}"
    return _chart(test.lags, test.autocorrelation, band, words)


def cross_correlation_chart(test: ResidualTest) -> Markup:
    """The residuals' correlation with the input, with the band of unrelated signals."""
    (lag, value), band = test.peak, test.cross_band
    words = f"cross-correlation, largest {value:+.2f} at {lag:.2g} s, band ±{band:.3f}"
    return _chart(test.cross_lags, test.cross_correlation, band, words)


def _chart(lags: Array, values: Array, band: float, words: str) -> Markup:
    """A correlation over lags; `words` say what it shows to those who cannot see it."""
    low, high = min(-band, float(values.min()), -0.1), max(band, float(values.max()), 0.1)
    tall, wide = HEIGHT - 2.0 * EDGE, WIDTH - 2.0 * EDGE

    def height(value: float) -> float:
        return round(EDGE + tall * (high - value) / (high - low), 1)

    rows = thinned(lags, values, np.empty(0, dtype=np.intp), STRETCHES)
    reach = float(lags[-1] - lags[0]) or 1.0
    across = EDGE + wide * (lags[rows] - lags[0]) / reach
    up = [height(float(value)) for value in values[rows]]
    line = " ".join(f"{x:.1f},{y:.1f}" for x, y in zip(across, up, strict=True))
    zero, top, ends = height(0.0), height(band), (EDGE, WIDTH - EDGE)
    axes = f'<line class="axis" x1="{ends[0]:g}" x2="{ends[1]:g}" y1="{zero}" y2="{zero}"/>'
    if lags[0] < 0.0:
        middle = EDGE - wide * float(lags[0]) / reach
        axes += f'<line class="axis" x1="{middle:.1f}" x2="{middle:.1f}" y1="4" y2="60"/>'
    labels = ((EDGE, "start", f"{lags[0]:.2g} s"), (0.5 * WIDTH, "middle", f"band ±{band:.2g}"))
    texts = "".join(
        f'<text x="{x:g}" y="76" text-anchor="{anchor}">{text.replace("-", "−")}</text>'
        for x, anchor, text in (*labels, (ends[1], "end", f"{lags[-1]:.2g} s"))
    )
    return Markup(
        f'<svg class="small" viewBox="0 0 230 80" role="img" aria-label="{words}">'
        f"<title>{words}</title>"
        f'<rect class="band" x="{EDGE:g}" y="{top}" width="{wide:g}" '
        f'height="{height(-band) - top:.1f}"/>{axes}<polyline points="{line}"/>{texts}</svg>'
    )
