"""Parts of records that a figure shows."""

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError

Array = NDArray[np.float64]


def rows_within(time: Array, window: tuple[float, float] | None, what: str) -> slice:
    """Rows of stamps within a window, its ends included; all without one.

    Parameters
    ----------
    time : (n,) array
        Increasing stamps. [s]
    window : (float, float) or None
        First and last instant. [s]
    what : str
        The signal, for the error's sentence.

    Raises
    ------
    InputError
        If fewer than two stamps lie within it.
    """
    if window is None:
        return slice(0, time.size)
    first = int(np.searchsorted(time, window[0], side="left"))
    after = int(np.searchsorted(time, window[1], side="right"))
    if after - first < 2:
        raise InputError(
            f"The window from {window[0]:g} s to {window[1]:g} s holds {max(after - first, 0)} "
            f"samples of {what}, which goes from {time[0]:g} s to {time[-1]:g} s; choose one that "
            "holds two at least."
        )
    return slice(first, after)
