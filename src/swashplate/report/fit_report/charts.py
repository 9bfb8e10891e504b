"""Charts of a page as SVG: sensitivities, correlations, starts, profiles, residual tests."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from swashplate.identification.identifiability import Identifiability
from swashplate.identification.noise import Covariance
from swashplate.identification.profile import Profile
from swashplate.identification.solving import StartResult
from swashplate.identification.unknowns import Unknown
from swashplate.identification.validation import ResidualTest
from swashplate.identification.verdict import SAME
from swashplate.report.lines import thinned
from swashplate.report.style import BLUE, VERMILION

Array = NDArray[np.float64]

WIDE = 640.0
"""Width of a chart. [px]"""
NAMES, VALUES = 132.0, 70.0
"""Room for names on the left, and for numbers on the right. [px]"""
ROW = 16.0
"""Height of a bar with its name, and size of a cell of the correlations. [px]"""
MOST = 60
"""Unknowns up to which correlations are drawn."""
LEAST_SCALE = 10.0 * SAME
"""Range of the starts' costs, of the best, below which differences are not drawn larger."""
SMALL = (230.0, 64.0, 4.0)
"""Width, height and edge of a chart in a table's cell. [px]"""
STRETCHES = 120
"""Of the lags, of which a small chart shows the lowest and the highest value."""


# --- marks ----------------------------------------------------------------------------------------


def _svg(width: float, height: float, words: str, parts: Iterable[Markup], look: str) -> Markup:
    """A chart; `words` say what it shows to those who cannot see it."""
    head = Markup('<svg class="{0}" width="{1:g}" viewBox="0 0 {1:g} {2:g}" role="img" ')
    label = Markup('aria-label="{}">').format(words)
    return Markup("").join([head.format(look, width, height), label, *parts, Markup("</svg>")])


def _text(
    x: float,
    y: float,
    words: str,
    anchor: str = "start",
    turned: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Markup:
    """Words at a place, which may be `turned` about a point (x, y) by an angle [deg]."""
    made = Markup('<text x="{:.1f}" y="{:.1f}" text-anchor="{}"{}>{}</text>')
    how = Markup(' transform="translate({:.0f} {:.0f}) rotate({:.0f})"').format(*turned)
    return made.format(x, y, anchor, how if any(turned) else "", words.replace("-", "−"))


def _line(x1: float, y1: float, x2: float, y2: float, look: str = "axis") -> Markup:
    made = Markup('<line class="{}" x1="{:.1f}" y1="{:.1f}" x2="{:.1f}" y2="{:.1f}"/>')
    return made.format(look, x1, y1, x2, y2)


def _polyline(x: Array, y: Array) -> Markup:
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
    return Markup('<polyline points="{}"/>').format(points)


def _points(x: Array, y: Array, words: Sequence[str], hollow: Sequence[bool]) -> list[Markup]:
    made = Markup('<circle class="{}" cx="{:.1f}" cy="{:.1f}" r="3"><title>{}</title></circle>')
    return [
        made.format("hollow" if open_ else "full", a, b, said)
        for a, b, said, open_ in zip(x, y, words, hollow, strict=True)
    ]


def _scatter(
    x: Array,
    y: Array,
    words: Sequence[str],
    hollow: Sequence[bool],
    labels: tuple[str, str],
    size: tuple[float, float],
    *,
    least: float = 0.0,
    joined: bool = False,
    level: float | None = None,
) -> Markup:
    """Points over an abscissa, with the ends of both axes written beside them."""
    width, height = size
    left, right, top, bottom = 70.0, width - 14.0, 10.0, height - 38.0
    low, high = (float(each(y)) for each in (np.min, np.max))
    if level is not None:
        high = max(high, level)
    if high - low < least:
        low, high = 0.5 * (low + high - least), 0.5 * (low + high + least)
    first, last = float(x.min()), float(x.max())
    across = left + 8.0 + (right - left - 16.0) * (x - first) / (last - first or 1.0)
    up = bottom - 6.0 - (bottom - top - 12.0) * (y - low) / (high - low or 1.0)
    parts = [_line(left, top, left, bottom), _line(left, bottom, right, bottom)]
    if level is not None:
        at = bottom - 6.0 - (bottom - top - 12.0) * (level - low) / (high - low or 1.0)
        parts.append(_line(left, at, right, at, "level"))
    if joined:
        parts.append(_polyline(across, up))
    parts += _points(across, up, words, hollow)
    digits = 7 if high - low < 1e-3 * abs(high) else 4
    parts += [
        _text(left - 6.0, bottom - 2.0, f"{low:.{digits}g}", "end"),
        _text(left - 6.0, top + 8.0, f"{high:.{digits}g}", "end"),
        _text(left, bottom + 14.0, f"{first:.5g}"),
        _text(right, bottom + 14.0, f"{last:.5g}", "end"),
        _text(0.5 * (left + right), bottom + 30.0, labels[0], "middle"),
        _text(0.0, 0.0, labels[1], "middle", (12.0, 0.5 * (top + bottom), -90.0)),
    ]  # fmt: skip
    return _svg(width, height, f"{labels[1]} over {labels[0]}", parts, "chart")


# --- what the data tell ---------------------------------------------------------------------------


def sensitivity_chart(found: Identifiability, shown: Sequence[bool]) -> Markup:
    """Bars: how much all weighted residuals change for 1 % of each unknown that is shown."""
    order = np.argsort(-found.sensitivity, kind="stable")
    moving = [int(k) for k in order if found.sensitivity[k] > 0.0 and shown[k]]
    if not moving:
        return Markup("")
    sizes = np.log10([float(found.sensitivity[k]) for k in moving])
    # a logarithmic axis has no zero to start from
    low = float(np.floor(sizes.min()) - 0.5)
    scale = (WIDE - NAMES - VALUES) / (float(sizes.max()) - low)
    bar = Markup('<rect class="{}" x="{:.1f}" y="{:.1f}" width="{:.1f}" height="10"/>')
    parts = []
    for row, (k, size) in enumerate(zip(moving, sizes, strict=True)):
        top, long = ROW * row, scale * (float(size) - low)
        look = "bar fixed" if found.variables.at_bound[k] else "bar"
        parts += [
            _text(NAMES - 6.0, top + 12.0, found.variables.names[k], "end"),
            bar.format(look, NAMES, top + 3.0, long),
            _text(NAMES + long + 5.0, top + 12.0, f"{found.sensitivity[k]:.3g}"),
        ]
    words = "Change of all weighted residuals for 1 % of each parameter, logarithmic"
    return _svg(WIDE, ROW * len(moving) + 4.0, words, parts, "chart")


def correlation_chart(covariance: Covariance, shown: Sequence[bool]) -> Markup | None:
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
    cell = Markup(
        '<rect x="{:g}" y="{:g}" width="15" height="15" fill="{}" fill-opacity="{:.2f}">'
        "<title>{}, {}: {:+.3f}</title></rect>"
    )
    parts = []
    for i, name in enumerate(names):
        below = (NAMES + ROW * i + 11.0, ROW * len(names) + 8.0, -60.0)
        parts += [
            _text(NAMES - 6.0, ROW * i + 12.0, name, "end"),
            _text(0.0, 0.0, name, "end", below),
        ]
        for j, other in enumerate(names):
            value = float(values[i, j])
            if abs(value) >= 0.05:
                color = VERMILION if value > 0.0 else BLUE
                where = (NAMES + ROW * j, ROW * i)
                parts.append(cell.format(*where, color, abs(value), name, other, value))
    width = NAMES + ROW * len(names) + 10.0
    words = "Correlations of the estimates: vermilion +1, white 0, blue -1"
    return _svg(width, ROW * len(names) + 95.0, words, parts, "chart")


def waterfall_chart(starts: Sequence[StartResult]) -> Markup:
    """The costs that the starts reached, best first, as multiples of the best one."""
    ended = sorted((each for each in starts if np.isfinite(each.cost)), key=lambda each: each.cost)
    if not ended:
        return Markup("")
    best = ended[0].cost
    costs = np.array([each.cost / best if best > 0.0 else each.cost for each in ended])
    label = "cost, best = 1" if best > 0.0 else "cost"
    if best > 0.0 and costs[-1] > 10.0:
        costs, label = np.log10(costs), "log₁₀ of cost, best = 0"
    words = [f"start {e.number}: cost {e.cost:.7g}, {e.evaluations} evaluations" for e in ended]
    hollow = [not each.converged for each in ended]
    labels = ("starts, best first", label)
    places = np.arange(1.0, len(ended) + 1.0)
    return _scatter(places, costs, words, hollow, labels, (WIDE, 240.0), least=LEAST_SCALE)


def profile_chart(profile: Profile, unknown: Unknown, name: str) -> Markup:
    """The least cost over one unknown, above that of the optimum, and where the interval ends."""
    values = np.array([unknown.to_value(each.number) for each in profile.points])
    rises = np.array([each.cost - profile.cost for each in profile.points])
    if not values.size:
        return Markup("")
    words = [f"{v:.6g}: rise {r:.3g}" for v, r in zip(values, rises, strict=True)]
    labels = (f"{name} ({unknown.unit})" if unknown.unit else name, "rise of the cost")
    size, hollow = (330.0, 220.0), [False] * values.size
    return _scatter(values, rises, words, hollow, labels, size, joined=True, level=profile.rise)


# --- residual tests -------------------------------------------------------------------------------


def autocorrelation_chart(test: ResidualTest) -> Markup:
    """The residuals' own correlation, from lag 0, with the band of white noise."""
    band = test.white_band
    words = f"autocorrelation over {test.lags[-1]:.2g} s, white-noise band ±{band:.3f}"
    return _lags_chart(test.lags, test.autocorrelation, band, words)


def cross_correlation_chart(test: ResidualTest) -> Markup:
    """The residuals' correlation with the input, with the band of unrelated signals."""
    (lag, value), band = test.peak, test.cross_band
    words = f"cross-correlation, largest {value:+.2f} at {lag:.2g} s, band ±{band:.3f}"
    return _lags_chart(test.cross_lags, test.cross_correlation, band, words)


def _lags_chart(lags: Array, values: Array, band: float, words: str) -> Markup:
    wide, tall, edge = SMALL
    low, high = min(-band, float(values.min()), -0.1), max(band, float(values.max()), 0.1)

    def height(value: float | Array) -> Array:
        return np.asarray(edge + (tall - 2.0 * edge) * (high - value) / (high - low))

    rows = thinned(lags, values, np.empty(0, dtype=np.intp), STRETCHES)
    reach = float(lags[-1] - lags[0]) or 1.0
    across = edge + (wide - 2.0 * edge) * (lags - lags[0]) / reach
    zero, top, bottom = (float(height(each)) for each in (0.0, band, -band))
    belt = Markup('<rect class="band" x="{:g}" y="{:.1f}" width="{:g}" height="{:.1f}"/>')
    parts = [
        belt.format(edge, top, wide - 2.0 * edge, bottom - top),
        _line(edge, zero, wide - edge, zero),
    ]
    if lags[0] < 0.0:
        middle = float(np.interp(0.0, lags, across))
        parts.append(_line(middle, edge, middle, tall - edge))
    parts += [
        _polyline(across[rows], height(values[rows])),
        _text(edge, tall + 12.0, f"{lags[0]:.2g} s"),
        _text(0.5 * wide, tall + 12.0, f"band ±{band:.2g}", "middle"),
        _text(wide - edge, tall + 12.0, f"{lags[-1]:.2g} s", "end"),
    ]
    return _svg(wide, tall + 16.0, words, parts, "small")
