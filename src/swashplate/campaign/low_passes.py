"""Two low passes in a row: made discrete, and marched over many signals side by side."""

from typing import Literal, NamedTuple

import numpy as np

from swashplate.campaign.stamps import Array, Stamps
from swashplate.equations.cache import kernel
from swashplate.errors import InputError
from swashplate.maneuvers.pieces import positive

Form = Literal["source", "exact"]
"""How the filters are made discrete.

``"source"``: the source's explicit recursions, meant for 512 Hz, refused where they are unstable.
``"exact"``: exact for a position that is straight between two samples, at any rate, even or not.
"""


class Taps(NamedTuple):
    """What drives an interval: ``left`` times the sample before it, ``right`` times the one after.

    Both have shape (n - 1,), one element an interval.
    """

    left: Array
    right: Array


class Recursion(NamedTuple):
    """Coefficients of the two low passes, each of shape (n - 1,), one element an interval.

    With v what drives the interval, x the first low pass and y the second:
    y ← kept_second·y + from_state·x + from_drive·v, then x ← kept_first·x + (1 - kept_first)·v.
    """

    kept_first: Array
    kept_second: Array
    from_state: Array
    from_drive: Array


@kernel
def march_low_passes(
    values: Array, taps: Taps, recursion: Recursion, start: Array, filtered: Array
) -> None:
    """March the two low passes over all rows; the columns are independent of each other.

    Parameters
    ----------
    values : (n, k) array
        Samples.
    taps, recursion : Taps, Recursion
        What drives the low passes, and they themselves.
    start : (k,) array
        State of both low passes at the first row.
    filtered : (n, k) array
        Output: the second low pass, `start` in the first row.
    """
    rows, columns = values.shape
    state = start.copy()
    for j in range(columns):
        filtered[0, j] = start[j]
    for n in range(1, rows):
        left, right = taps.left[n - 1], taps.right[n - 1]
        kept_first, kept_second = recursion.kept_first[n - 1], recursion.kept_second[n - 1]
        from_state, from_drive = recursion.from_state[n - 1], recursion.from_drive[n - 1]
        for j in range(columns):
            drive = left * values[n - 1, j] + right * values[n, j]
            filtered[n, j] = (
                kept_second * filtered[n - 1, j] + from_state * state[j] + from_drive * drive
            )
            state[j] = kept_first * state[j] + (1.0 - kept_first) * drive


def filtered_by(values: Array, taps: Taps, recursion: Recursion, start: Array) -> Array:
    """Run the low passes over samples of shape (n,) or (n, k) from a state of shape (k,)."""
    columns = values.reshape(values.shape[0], -1)
    filtered = np.empty_like(columns)
    march_low_passes(columns, taps, recursion, start, filtered)
    return filtered.reshape(values.shape)


def intervals_of(stamps: Stamps) -> Array:
    """Length of each interval [s]."""
    if stamps.period is None:
        return np.diff(stamps.time)
    return np.full(stamps.time.size - 1, stamps.period)


def recursion_of(stamps: Stamps, form: Form, low_pass: float, differentiator: float) -> Recursion:
    """Coefficients of low passes with cut-offs a and b [rad/s].

    Raises
    ------
    InputError
        If a cut-off is not positive, or the explicit form does not fit the stamps.
    """
    a, b = positive("low_pass", low_pass), positive("differentiator", differentiator)
    intervals = intervals_of(stamps)
    if form == "exact":
        first, second = np.exp(-a * intervals), np.exp(-b * intervals)
        # what x at the start of an interval leaves in y at its end; also for a = b, and for gaps
        apart = abs(b - a) * intervals
        ratio = np.divide(-np.expm1(-apart), apart, out=np.ones_like(apart), where=apart > 0.0)
        from_state = b * intervals * np.exp(-min(a, b) * intervals) * ratio
        return Recursion(first, second, from_state, 1.0 - second - from_state)
    if form != "source":
        raise InputError(f"form must be 'source' or 'exact', not {form!r}.")
    if stamps.period is None:
        raise InputError(
            "The source's form of the filters needs evenly spaced stamps; take form 'exact', or "
            "resample the record first."
        )
    fastest = max(a, b)
    if fastest * stamps.period >= 2.0:
        raise InputError(
            f"The source's form of the filters is unstable at {1.0 / stamps.period:.4g} Hz, as at "
            f"every rate up to {0.5 * fastest:.4g} Hz; take form 'exact'."
        )
    return Recursion(
        1.0 - a * intervals, 1.0 - b * intervals, b * intervals, np.zeros_like(intervals)
    )
