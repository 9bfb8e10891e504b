"""Input records on the march's grid: uniform or with time stamps, any rate, sub-stepped."""

from dataclasses import dataclass
from math import ceil
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.errors import InputError

Array = NDArray[np.float64]
Interpolation = Literal["linear", "previous"]

SOURCE_RATE = 512.0
"""Rate of Kruse's logs; no step is longer than one of its samples. [Hz]"""
LONGEST = 100_000_000
"""Steps that a record may take: 54 hours at 512 Hz. More is a mistake, in a unit perhaps."""
SLOWEST, FASTEST = 10.0, 100_000.0
"""Range of record rates. [Hz]"""


@dataclass(frozen=True)
class Record:
    """An input on the grid of the march."""

    values: Array
    """Input on the fine grid, `substeps` points a sample."""
    start: float
    """Time of the first sample. [s]"""
    rate: float
    """Samples a second. [Hz]"""
    substeps: int
    """Steps of the march from one sample to the next."""

    @property
    def step(self) -> float:
        """h. [s]"""
        return 1.0 / (self.rate * self.substeps)

    @property
    def time(self) -> Array:
        """Time stamps of the samples. [s]"""
        samples = (self.values.size - 1) // self.substeps + 1
        return self.start + np.arange(samples) / self.rate


def record_of(
    values: ArrayLike,
    rate: float,
    *,
    what: str,
    time: ArrayLike | None = None,
    interpolation: Interpolation | None = None,
    substeps: int | None = None,
) -> Record:
    """Put an input record on the march's grid.

    Parameters
    ----------
    values : (n,) array_like
        Input samples.
    rate : float
        Rate of the samples or, with `time`, of the grid that they are put on. [Hz]
    what : str
        Name of the input, for errors: ``"voltage"`` or ``"current"``.
    time : (n,) array_like, optional
        Time stamps, increasing, in any distances. [s]
    interpolation : {"linear", "previous"}, optional
        What the input is between two samples: a straight line or held. Must be chosen with
        `time`; otherwise ``"linear"``.
    substeps : int, optional
        Steps of the march a sample; by default as many as keep h at or below 1/512 s.

    Raises
    ------
    InputError
        For an empty, non-finite or unsorted record or a rate out of range, naming the sample.
    """
    data = column(values, f"The {what}")
    least = least_substeps(rate)
    if substeps is None:
        substeps = least
    elif substeps < least:
        raise InputError(
            f"substeps is {substeps}, but at {rate:g} Hz at least {least} are needed to keep the "
            "step at or below 1/512 s."
        )
    if interpolation not in (None, "linear", "previous"):
        raise InputError(f"interpolation is '{interpolation}'; it is 'linear' or 'previous'.")
    if time is not None:
        if interpolation is None:
            raise InputError(
                "A record with time stamps needs interpolation='previous' (held between stamps) "
                "or 'linear' (a straight line between them)."
            )
        stamps = _checked_stamps(time, data.size, what)
        return gridded(data, stamps, rate, interpolation, substeps)
    _check_length(data.size * substeps, f"{data.size} samples at {rate:g} Hz")
    return Record(_refined(data, interpolation, substeps), 0.0, float(rate), substeps)


def least_substeps(rate: float) -> int:
    """Steps a sample that keep h at or below 1/512 s.

    Raises
    ------
    InputError
        For a rate out of range.
    """
    if not SLOWEST <= rate <= FASTEST:
        raise InputError(
            f"The rate is {rate:g} Hz, but must be between {SLOWEST:g} and {FASTEST:g} Hz."
        )
    return max(ceil(SOURCE_RATE / rate - 1e-9), 1)


def column(values: ArrayLike, what: str, *, finite: bool = True) -> Array:
    """A copy of one column of real numbers, so that nothing changes with the user's array.

    Raises
    ------
    InputError
        For anything else, no number at all or one that is not finite; `what` names it.
    """
    try:
        given = np.asarray(values)
    except ValueError:  # rows of different lengths
        given = np.array("")
    if given.dtype.kind not in "fiub":
        raise InputError(f"{what} must be a sequence of real numbers.")
    if given.ndim != 1:
        raise InputError(f"{what} must be one column, not {given.ndim}-dimensional.")
    if given.size == 0:
        raise InputError(f"{what} is empty.")
    data = np.array(given, dtype=np.float64, order="C")
    # one pass: a sum is finite if and only if no sample is NaN or infinite, overflow apart
    if finite and not np.isfinite(data.sum()):
        bad = np.flatnonzero(~np.isfinite(data))
        if bad.size:
            raise InputError(
                f"{what} has {bad.size} sample(s) that are not finite, the first {data[bad[0]]} at "
                f"sample {bad[0]}; fill or cut them."
            )
    return data


def _checked_stamps(time: ArrayLike, size: int, what: str) -> Array:
    stamps = column(time, "The time")
    if stamps.size != size:
        raise InputError(f"There are {stamps.size} time stamps for {size} samples of {what}.")
    steps = np.diff(stamps)
    if np.any(steps <= 0.0):
        first = int(np.argmax(steps <= 0.0))
        raise InputError(
            f"The time must increase, but goes from {stamps[first]:g} s at sample {first} to "
            f"{stamps[first + 1]:g} s at sample {first + 1}."
        )
    return stamps


def _refined(data: Array, interpolation: Interpolation | None, substeps: int) -> Array:
    """A uniform record on a grid of `substeps` points a sample."""
    if substeps == 1:
        return data
    fine = np.empty((data.size - 1) * substeps + 1)
    fine[::substeps] = data
    for j in range(1, substeps):
        rise = 0.0 if interpolation == "previous" else j / substeps
        # written as the stepper does, so that both give the same bits
        fine[j::substeps] = data[:-1] + rise * (data[1:] - data[:-1])
    return fine


def _check_length(steps: float, what: str) -> None:
    if steps > LONGEST:
        raise InputError(
            f"The record with {what} takes {steps:.3g} steps, more than the {LONGEST:.0e} that are "
            "simulated at once; check the unit of the time."
        )


def even_rate(stamps: Array) -> float | None:
    """Rate of stamps that lie evenly, within 2 % of a step; None if they do not. [Hz]"""
    if stamps.size < 2:
        return None
    rate = float((stamps.size - 1) / (stamps[-1] - stamps[0]))
    even = stamps[0] + np.arange(stamps.size) / rate
    if np.abs(stamps - even).max() >= 0.02 / rate:
        return None
    return float(round(rate)) if abs(rate - round(rate)) < 1e-6 * rate else rate


def gridded(
    data: Array, stamps: Array, rate: float, interpolation: Interpolation, substeps: int = 1
) -> Record:
    """Samples with stamps, on a grid that starts at the first one.

    Raises
    ------
    InputError
        If the grid has more points than anyone means.
    """
    start = float(stamps[0])
    span = float(stamps[-1]) - start
    _check_length(span * rate * substeps, f"stamps from {start:g} s to {stamps[-1]:g} s")
    samples = int((stamps[-1] - start) * rate + 1e-9) + 1
    fine = start + np.arange((samples - 1) * substeps + 1) / (rate * substeps)
    if interpolation == "linear":
        return Record(np.interp(fine, stamps, data), start, float(rate), substeps)
    # a stamp counts from the grid point that it falls on, rounding errors apart
    held = np.searchsorted(stamps, fine + 1e-9 / rate, side="right") - 1
    return Record(data[held], start, float(rate), substeps)
