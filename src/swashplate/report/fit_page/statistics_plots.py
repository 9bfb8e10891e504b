"""Bokeh's figures of what the data tell: sensitivities, singular values, correlations, profiles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from bokeh.embed import json_item
from bokeh.models import BasicTicker, ColorBar, ColumnDataSource, LinearColorMapper, Range1d, Span
from bokeh.plotting import figure

from swashplate.identification.criteria import SAME
from swashplate.identification.identifiability import Identifiability
from swashplate.identification.noise import Covariance
from swashplate.identification.profile import Profile
from swashplate.identification.starts import StartResult
from swashplate.identification.unknowns import Unknown
from swashplate.report.fit_page.bokeh_style import dress
from swashplate.report.style import BLUE, GREY, VERMILION

ROW = 15
"""Height of a bar with its name. [px]"""
CELL = 17
"""Size of a cell of the correlations. [px]"""
MOST = 60
"""Unknowns up to which correlations are drawn."""
LEAST_SCALE = 10.0 * SAME
"""Range of the starts' costs, of the best, below which differences are not drawn larger."""


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
