"""Windows: the samples of an input that an equation sees."""

from typing import NamedTuple

from swashplate.equations.equation import equation


class Window(NamedTuple):
    """Neighbouring samples of an input, seen from between two of them."""

    s: tuple[float, ...]
    """Samples, newest first."""
    f: float
    """How far the instant looked at lies behind the newest, in samples, 0 to 1."""


@equation
def linear(window: Window) -> float:
    """Signal at the instant looked at, straight between samples."""
    return window.s[0] + window.f * (window.s[1] - window.s[0])


@equation
def previous(window: Window) -> float:
    """Last sample at or before the instant looked at."""
    return window.s[1] if window.f > 0.0 else window.s[0]


@equation
def mean_over_sample(window: Window) -> float:
    """Mean over the sample interval before the instant looked at, straight between samples."""
    f = window.f
    newest, middle, oldest = window.s[0], window.s[1], window.s[2]
    last = newest + f * (middle - newest)
    first = middle + f * (oldest - middle)
    return (1.0 - f) * (0.5 * (last + middle)) + f * (0.5 * (middle + first))
