"""Input records on the march's grid: uniform or with time stamps, any rate, sub-stepped."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import ceil
from typing import Literal, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.errors import InputError
from swashplate.machine.fields import is_real

Array = NDArray[np.float64]
Interpolation = Literal["linear", "previous"]
Between = Interpolation | Mapping[str, Interpolation | None] | None
"""What inputs, or each of them by its name, are between two samples; None is linear."""


class Sampling(TypedDict, total=False):
    """How inputs are given; see `on_grid`."""

    clip: bool
    """Whether values beyond an input's range are clipped instead of refused."""
    time: ArrayLike | None
    interpolation: Between
    substeps: int | None


SOURCE_RATE = 512.0
"""Rate of Kruse's logs; a drive's step is at most one of its samples. [Hz]"""
LONGEST = 100_000_000
"""Steps that a record may take: 54 hours at 512 Hz. More is a mistake, in a unit perhaps."""
SLOWEST, FASTEST = 10.0, 100_000.0
"""Range of a drive's record rates. [Hz]"""


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

    @property
    def points(self) -> Array:
        """Time of the grid's points, `substeps` a sample. [s]"""
        return self.start + np.arange(self.values.size) / (self.rate * self.substeps)


def on_grid(
    inputs: Mapping[str, ArrayLike],
    rate: float,
    **sampling: Unpack[Sampling],
) -> dict[str, Record]:
    """Inputs by name as records on one grid; arguments as of `swashplate.machine.simulate`."""
    time = sampling.get("time")
    between, substeps = checked_sampling(
        inputs, rate, sampling.get("interpolation"), sampling.get("substeps")
    )
    samples_of = {
        name: column(values, f"The {name}")
        for name, values in inputs.items()
        if not is_real(values)
    }
    sizes = {name: samples.size for name, samples in samples_of.items()}
    if len(set(sizes.values())) != 1:
        if not sizes:
            first = next(iter(inputs), "input")
            raise InputError(
                f"The {first} is a single number: give an array with a number for each sample."
            )
        listed = ", ".join(f"{name} {size}" for name, size in sizes.items())
        raise InputError(f"All inputs need the same number of samples: {listed}.")
    what, size = next(iter(sizes.items()))
    columns = {
        name: samples_of[name]
        if name in samples_of
        else column(np.full(size, value), f"The {name}")
        for name, value in inputs.items()
    }
    if time is None:
        _check_length(size * substeps, f"{size} samples at {rate:g} Hz")
        return {
            name: Record(_refined(samples, between[name], substeps), 0.0, float(rate), substeps)
            for name, samples in columns.items()
        }
    stamps = column(time, "The time")
    if stamps.size != size:
        raise InputError(f"There are {stamps.size} time stamps for {size} samples of {what}.")
    late = np.flatnonzero(np.diff(stamps) <= 0.0)
    if late.size:
        raise InputError(
            f"The time must increase, but goes from {stamps[late[0]]:g} s at sample {late[0]} to "
            f"{stamps[late[0] + 1]:g} s at sample {late[0] + 1}."
        )
    if None in between.values():
        raise InputError(
            "A record with time stamps needs interpolation='previous' (held between stamps) or "
            "'linear' (a straight line between them)."
        )
    return {
        name: gridded(samples, stamps, rate, between[name] or "linear", substeps)
        for name, samples in columns.items()
    }


def record_of(
    values: ArrayLike,
    rate: float,
    *,
    what: str,
    time: ArrayLike | None = None,
    interpolation: Interpolation | None = None,
) -> Record:
    """A drive's input, `what` by name, on the march's grid: see `on_grid` and `least_substeps`."""
    steps = least_substeps(rate)
    records = on_grid({what: values}, rate, time=time, interpolation=interpolation, substeps=steps)
    return records[what]


def least_substeps(
    rate: float, requested: int | None = None, longest: float = 1.0 / SOURCE_RATE
) -> int:
    """Steps a sample that keep h at or below the longest step [s], or those that are requested."""
    if not is_real(rate) or not SLOWEST <= rate <= FASTEST:
        text = f"{rate:g}" if is_real(rate) else repr(rate)
        raise InputError(
            f"The rate is {text} Hz, but must be between {SLOWEST:g} and {FASTEST:g} Hz."
        )
    least = max(ceil(1.0 / (rate * longest) - 1e-9), 1)
    if is_real(requested) and requested < least:
        raise InputError(
            f"substeps is {requested}, but at {rate:g} Hz at least {least} are needed to keep the "
            f"step at or below 1/{1.0 / longest:g} s."
        )
    return least if requested is None else requested


def check_rate(value: float, what: str = "rate", unit: str = "Hz") -> None:
    """Refuse a rate, or a step, that is not a finite number above 0."""
    if not is_real(value) or not 0.0 < value < np.inf:
        raise InputError(f"The {what} is {value!r} {unit}, but must be a number above 0.")


def checked_sampling(
    names: Iterable[str], rate: float, interpolation: Between, substeps: int | None
) -> tuple[dict[str, Interpolation | None], int]:
    """What each input is between two samples, and the steps a sample, one by default."""
    check_rate(rate)
    counts = is_real(substeps) and 1 <= substeps < np.inf and substeps == int(substeps)
    if substeps is not None and not counts:
        raise InputError(f"substeps is {substeps!r}, but must be a whole number, at least 1.")
    if isinstance(interpolation, Mapping):
        names = tuple(names)
        for strange in interpolation.keys() - set(names):
            raise InputError(
                f"interpolation names '{strange}', but the inputs are {', '.join(names)}."
            )
        between = {name: interpolation.get(name) for name in names}
    else:
        between = dict.fromkeys(names, interpolation)
    for way in between.values():
        if way not in (None, "linear", "previous"):
            raise InputError(f"interpolation is '{way}'; it is 'linear' or 'previous'.")
    return between, int(substeps or 1)


def column(values: ArrayLike, what: str, *, finite: bool = True) -> Array:
    """A copy of one column of real numbers; an `InputError` names by `what` anything else."""
    try:
        array = np.asarray(values)
    except ValueError:  # rows of different lengths
        array = np.array("")
    if array.dtype.kind not in "fiub":
        raise InputError(f"{what} must be a sequence of real numbers.")
    if array.ndim != 1:
        raise InputError(f"{what} must be one column, not {array.ndim}-dimensional.")
    if array.size == 0:
        raise InputError(f"{what} is empty.")
    data = np.array(array, dtype=np.float64, order="C")  # not changed with the user's array
    # one pass: a sum is finite if and only if no sample is NaN or infinite, overflow apart
    with np.errstate(all="ignore"):
        total = data.sum()
    if finite and not np.isfinite(total):
        bad = np.flatnonzero(~np.isfinite(data))
        if bad.size:
            raise InputError(
                f"{what} has {bad.size} sample(s) that are not finite, the first {data[bad[0]]} at "
                f"sample {bad[0]}; fill or cut them."
            )
    return data


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
    """Samples with stamps, on a grid that starts at the first one."""
    start = float(stamps[0])
    span = float(stamps[-1]) - start
    _check_length(span * rate * substeps, f"stamps from {start:g} s to {stamps[-1]:g} s")
    samples = int(span * rate + 1e-9) + 1
    fine = start + np.arange((samples - 1) * substeps + 1) / (rate * substeps)
    if interpolation == "linear":
        return Record(np.interp(fine, stamps, data), start, float(rate), substeps)
    # a stamp counts from the grid point that it falls on, rounding errors apart
    last = np.searchsorted(stamps, fine + 1e-9 / rate, side="right") - 1
    return Record(data[last], start, float(rate), substeps)


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
