"""Small charts for the cells of tables, as SVG in the page: they print, and cost nothing."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.identification.assessment import ResidualTest
from swashplate.report.broken_lines import thinned

Array = NDArray[np.float64]

WIDTH, HEIGHT, EDGE = 230.0, 64.0, 4.0
"""Size and white edge of a chart. [px]"""
STRETCHES = 120
"""Of the lags, of which a chart shows the lowest and the highest value."""


class SmallChart(NamedTuple):
    """A correlation over lags, in pixels."""

    line: str
    """Points of the polyline."""
    zero: float
    """Height of zero."""
    band_top: float
    band_height: float
    middle: float | None
    """Where lag 0 is, None where it is the left end."""
    first: str
    """Words at the left end, and at the right one."""
    last: str
    scale: str
    """How wide the band is."""
    words: str
    """What it shows, for those who cannot see it."""


def autocorrelation_chart(test: ResidualTest) -> SmallChart:
    """The residuals' own correlation, from lag 0, with the band of white noise."""
    return _chart(
        test.lags,
        test.autocorrelation,
        test.white_band,
        f"autocorrelation over {test.lags[-1]:.2g} s, white-noise band ±{test.white_band:.3f}",
    )


def cross_correlation_chart(test: ResidualTest) -> SmallChart:
    """The residuals' correlation with the input, with the band of unrelated signals."""
    lag, value = test.peak
    return _chart(
        test.cross_lags,
        test.cross_correlation,
        test.cross_band,
        f"cross-correlation, largest {value:+.2f} at {lag:.2g} s, band ±{test.cross_band:.3f}",
    )


def _chart(lags: Array, values: Array, band: float, words: str) -> SmallChart:
    low, high = min(-band, float(values.min()), -0.1), max(band, float(values.max()), 0.1)
    tall, wide = HEIGHT - 2.0 * EDGE, WIDTH - 2.0 * EDGE

    def height(value: float) -> float:
        return EDGE + tall * (high - value) / (high - low)

    rows = thinned(lags, values, np.empty(0, dtype=np.intp), STRETCHES)
    reach = float(lags[-1] - lags[0]) or 1.0
    across = EDGE + wide * (lags[rows] - lags[0]) / reach
    up = [height(float(value)) for value in values[rows]]
    line = " ".join(f"{x:.1f},{y:.1f}" for x, y in zip(across, up, strict=True))
    middle = EDGE - wide * float(lags[0]) / reach if lags[0] < 0.0 else None
    return SmallChart(
        line,
        round(height(0.0), 1),
        round(height(band), 1),
        round(height(-band) - height(band), 1),
        middle,
        f"{lags[0]:.2g} s".replace("-", "−"),
        f"{lags[-1]:.2g} s",
        f"band ±{band:.2g}",
        words,
    )
