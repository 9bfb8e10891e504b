"""Charts of a page as SVG: profiles, and what is left in the residuals."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from swashplate.identification import Profile, Unknown
from swashplate.report.lines import thinned

Array = NDArray[np.float64]

STRETCHES = 120
"""Of the lags, of which a chart shows the lowest and the highest value."""


def _svg(
    width: float, height: float, description: str, elements: Iterable[Markup], css_class: str
) -> Markup:
    """A chart, with a description for those who cannot see it."""
    opening = Markup('<svg class="{0}" width="{1:g}" viewBox="0 0 {1:g} {2:g}" role="img" ')
    label = Markup('aria-label="{}">').format(description)
    start = opening.format(css_class, width, height)
    return Markup("").join([start, label, *elements, Markup("</svg>")])


def _text(x: float, y: float, text: str, anchor: str = "start", turn: float = 0.0) -> Markup:
    """A text at a point, turned about it by an angle [deg]."""
    template = Markup(
        '<text text-anchor="{}" transform="translate({:.1f} {:.1f}) rotate({:g})">{}</text>'
    )
    return template.format(anchor, x, y, turn, text.replace("-", "−"))


def _line(x1: float, y1: float, x2: float, y2: float, look: str = "axis") -> Markup:
    template = Markup('<line class="{}" x1="{:.1f}" y1="{:.1f}" x2="{:.1f}" y2="{:.1f}"/>')
    return template.format(look, x1, y1, x2, y2)


def _polyline(x: Array, y: Array) -> Markup:
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
    return Markup('<polyline points="{}"/>').format(points)


def profile_chart(profile: Profile, unknown: Unknown) -> Markup:
    """The least cost over one unknown, above that of the optimum, with the ends of the interval."""
    values = np.array([unknown.to_value(point.number) for point in profile.points])
    rises = np.array([point.cost - profile.cost for point in profile.points])
    if not values.size:
        return Markup("")
    left, right, top, bottom = 70.0, 316.0, 10.0, 182.0
    low, high = float(rises.min()), max(float(rises.max()), profile.rise)
    first, last = float(values.min()), float(values.max())
    scale = (bottom - top - 12.0) / (high - low or 1.0)
    across = left + 8.0 + (right - left - 16.0) * (values - first) / (last - first or 1.0)
    up = bottom - 6.0 - scale * (rises - low)
    level = bottom - 6.0 - scale * (profile.rise - low)
    point = Markup('<circle class="full" cx="{:.1f}" cy="{:.1f}" r="3"><title>{}</title></circle>')
    label = f"{profile.name} ({unknown.unit})" if unknown.unit else profile.name
    elements = [
        _line(left, top, left, bottom),
        _line(left, bottom, right, bottom),
        _line(left, level, right, level, "level"),
        _polyline(across, up),
        *(
            point.format(x, y, f"{value:.6g}: rise {rise:.3g}")
            for x, y, value, rise in zip(across, up, values, rises, strict=True)
        ),
        _text(left - 6.0, bottom - 2.0, f"{low:.4g}", "end"),
        _text(left - 6.0, top + 8.0, f"{high:.4g}", "end"),
        _text(left, bottom + 14.0, f"{first:.5g}"),
        _text(right, bottom + 14.0, f"{last:.5g}", "end"),
        _text(0.5 * (left + right), bottom + 30.0, label, "middle"),
        _text(12.0, 0.5 * (top + bottom), "rise of the cost", "middle", -90.0),
    ]
    return _svg(330.0, 220.0, f"rise of the cost over {label}", elements, "chart")


def lags_chart(lags: Array, values: Array, band: float, description: str) -> Markup:
    """A correlation over the lag [s], with the band of what has none, by half its width."""
    width = 230.0
    plot_height = 64.0
    margin = 4.0
    low, high = min(-band, float(values.min()), -0.1), max(band, float(values.max()), 0.1)

    def height(value: float | Array) -> Array:
        return np.asarray(margin + (plot_height - 2.0 * margin) * (high - value) / (high - low))

    rows = thinned(lags, values, np.empty(0, dtype=np.intp), STRETCHES)
    reach = float(lags[-1] - lags[0]) or 1.0
    x = margin + (width - 2.0 * margin) * (lags - lags[0]) / reach
    zero, top, bottom = (float(height(level)) for level in (0.0, band, -band))
    belt = Markup('<rect class="band" x="{:g}" y="{:.1f}" width="{:g}" height="{:.1f}"/>')
    elements = [
        belt.format(margin, top, width - 2.0 * margin, bottom - top),
        _line(margin, zero, width - margin, zero),
    ]
    if lags[0] < 0.0:
        middle = float(np.interp(0.0, lags, x))
        elements.append(_line(middle, margin, middle, plot_height - margin))
    elements += [
        _polyline(x[rows], height(values[rows])),
        _text(margin, plot_height + 12.0, f"{lags[0]:.2g} s"),
        _text(0.5 * width, plot_height + 12.0, f"band ±{band:.2g}", "middle"),
        _text(width - margin, plot_height + 12.0, f"{lags[-1]:.2g} s", "end"),
    ]
    return _svg(width, plot_height + 16.0, description, elements, "small")
