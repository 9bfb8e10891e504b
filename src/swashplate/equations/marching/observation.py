"""What was measured of a model under its records, ready to be compared with simulations of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from types import MappingProxyType
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.equations.marching.record import Record, column
from swashplate.equations.marching.rows import Plan
from swashplate.equations.marching.run import Start, check_start
from swashplate.errors import InputError

Array = NDArray[np.float64]
Unknown = Literal["offset", "clock_offset"]

ON_GRID = 1e-7
"""Samples by which a stamp may miss a grid point and still means it: rounding of its seconds."""


@dataclass(frozen=True, eq=False)
class Observation:
    """Measured samples of one signal, compared with the simulated signal at their stamps.

    The residual of sample i is ``weight[i] · (simulated(time[i]) + offset - values[i])``, where
    simulated(t) is the signal behind the low passes at ``t + clock_offset - delay``, linearly
    interpolated between the samples of the march's grid, and held outside the record.
    """

    signal: str
    """Of the model, or one of its integrals."""
    time: ArrayLike
    """(m,) stamps on the record's clock, never falling. [s]"""
    values: ArrayLike
    """(m,) measured, in the signal's SI unit."""
    weight: ArrayLike = 1.0
    """(m,) or one number, not negative, which multiplies the residual. Samples of weight 0 do not
    count, whatever their values are."""
    poles: Sequence[float] = ()
    """Poles of the first-order low passes that the measured signal went through, which the
    simulated one goes through as well. They are discretised exactly for an input that is held over
    a step, y[n+1] = e⁻ᵖʰ y[n] + (1 - e⁻ᵖʰ) u[n], and begin with y = u. [rad/s]"""
    delay: float = 0.0
    """By how much what was measured lags behind, apart from the poles; negative if it leads. [s]"""
    unknown: Sequence[Unknown] = ()
    """Of the offset and the clock offset, those to be found."""

    def __post_init__(self) -> None:
        what = f"The observation of {self.signal}"
        time = column(self.time, f"{what}: the time", finite=False)
        values = column(self.values, f"{what}: the values", finite=False)
        if values.size != time.size:
            raise InputError(f"{what} has {time.size} stamps for {values.size} values.")
        try:
            weight = np.array(np.broadcast_to(np.asarray(self.weight, np.float64), time.shape))
        except ValueError:
            raise InputError(
                f"{what}: the weight must be one number or {time.size} of them, not of shape "
                f"{np.shape(self.weight)}."
            ) from None
        bad = ~np.isfinite(time)
        bad[1:] |= time[1:] < time[:-1]
        if bad.any():
            raise InputError(
                f"{what}: the time must be finite and never fall, but is {time[bad][0]:g} s at "
                f"sample {int(np.argmax(bad))}."
            )
        bad = ~np.isfinite(weight) | (weight < 0.0) | ((weight > 0.0) & ~np.isfinite(values))
        if bad.any():
            raise InputError(
                f"{what}: value or weight is not finite, or the weight negative, at sample "
                f"{int(np.argmax(bad))}; give weight 0 to samples that are not to count."
            )
        poles = tuple(float(pole) for pole in self.poles)
        if not all(0.0 < pole < np.inf for pole in poles):
            raise InputError(f"{what}: poles are in rad/s, above 0 and finite, not {poles}.")
        if not np.isfinite(self.delay):
            raise InputError(f"{what}: the delay must be a finite time, not {self.delay}.")
        strange = [each for each in self.unknown if each not in ("offset", "clock_offset")]
        if strange or len(set(self.unknown)) != len(tuple(self.unknown)):
            raise InputError(
                f"{what}: unknown can be 'offset', 'clock_offset' or both, not {self.unknown!r}."
            )
        for name, value in (("time", time), ("values", values), ("weight", weight)):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "poles", poles)
        object.__setattr__(self, "unknown", tuple(self.unknown))

    def __repr__(self) -> str:
        return f"Observation({self.signal!r}, {np.size(self.time)} samples)"


class Own(NamedTuple):
    """Values of what belongs to one experiment alone, not to the machine."""

    start: Mapping[str, float] = MappingProxyType({})
    """Parts of the state at the first sample, by path; others are those of the start."""
    offsets: Sequence[float] = ()
    """Offset of each observation, in its signal's unit; none given means none."""
    clock_offsets: Sequence[float] = ()
    """By how much the record's clock is ahead of each observation's; none given means none. [s]"""


@dataclass(frozen=True, eq=False)
class ObservedRecord:
    """A record that drove a model, and what was observed of it."""

    record: Record
    observations: Sequence[Observation]
    driven_by: str = "voltage"  # The signal that the record is of.
    start: Start = "rest"
    others: Mapping[str, Array] = field(default_factory=dict)
    """Further signals from outside, on the grid of the record."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "observations", tuple(self.observations))
        if not self.observations:
            raise InputError("There is nothing observed under this record.")
        check_start(self.start)
        for name, values in self.others.items():
            if np.shape(values) != self.record.values.shape:
                raise InputError(
                    f"{name} has {np.size(values)} points, but the grid has "
                    f"{self.record.values.size}."
                )

    @property
    def records(self) -> dict[str, Array]:
        """All signals from outside, on the grid, by name."""
        found = {self.driven_by: self.record.values, **self.others}
        # the kernels are compiled for arrays that can be written to
        return {name: np.require(v, np.float64, ["C", "W"]) for name, v in found.items()}

    @property
    def own_columns(self) -> tuple[str, ...]:
        """Labels of the observations' own unknowns, in the order of their columns."""
        return tuple(
            f"{name} of {each.signal} [{r}]"
            for r, each in enumerate(self.observations)
            for name in ("offset", "clock_offset")
            if name in each.unknown
        )

    @cached_property
    def _first(self) -> NDArray[np.int64]:
        sizes = [np.size(each.time) for each in self.observations]
        return np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)

    @property
    def rows(self) -> int:
        """Samples of all observations together."""
        return int(self._first[-1])

    def rows_of(self, number: int) -> slice:
        """Rows of an observation among all."""
        return slice(int(self._first[number]), int(self._first[number + 1]))

    @cached_property
    def extremes(self) -> tuple[float, float]:
        """Lowest and highest value of the record. [V or A]"""
        return float(self.record.values.min()), float(self.record.values.max())

    def plan(self, own: Own, first_own: int) -> Plan:
        """What the march needs to know of the observations, at values of their own unknowns.

        `first_own` is the column of the first of these; an `InputError` says if there are not as
        many offsets as observations.
        """
        offsets = _one_each(own.offsets, self, "offset")
        clocks = _one_each(own.clock_offsets, self, "clock offset")
        plan = self._placed(clocks) if any(clocks) else self._unmoved
        if any(offsets):
            shifts = np.repeat(np.array(offsets), np.diff(plan.first))
            plan = plan._replace(measured=plan.measured - shifts)
        at = first_own
        columns = np.full((2, len(self.observations)), -1, dtype=np.int64)
        for r, each in enumerate(self.observations):
            for k, name in enumerate(("offset", "clock_offset")):
                if name in each.unknown:
                    columns[k, r] = at
                    at += 1
        return plan._replace(offset_column=columns[0], clock_column=columns[1])

    @cached_property
    def _unmoved(self) -> Plan:
        """The plan without offsets of any kind."""
        return self._placed((0.0,) * len(self.observations))

    def _placed(self, clocks: Sequence[float]) -> Plan:
        cells, fractions, slopes = [], [], []
        moving = any("clock_offset" in each.unknown for each in self.observations)
        for each, clock in zip(self.observations, clocks, strict=True):
            time = np.asarray(each.time) + (clock - each.delay)
            cell, fraction, slope = _cells(self.record, time, moving)
            cells.append(cell)
            fractions.append(fraction)
            slopes.append(slope)
        back, ahead = np.concatenate(slopes, axis=1)
        weight = np.concatenate([np.asarray(each.weight) for each in self.observations])
        measured = np.concatenate([np.asarray(each.values) for each in self.observations])
        poles = max(len(each.poles) for each in self.observations)
        kept = np.zeros((len(self.observations), poles))
        for r, each in enumerate(self.observations):
            kept[r, : len(each.poles)] = np.exp(-self.record.step * np.array(each.poles))
        none = np.zeros(0, dtype=np.int64)
        return Plan(
            first=self._first,
            cell=np.concatenate(cells),
            fraction=np.concatenate(fractions),
            back=np.ascontiguousarray(back),
            ahead=np.ascontiguousarray(ahead),
            measured=np.where(weight > 0.0, measured, 0.0),
            weight=weight,
            regular=np.array(
                [
                    bool((fraction == 0.0).all() and (np.diff(cell) == 1).all())
                    for cell, fraction in zip(cells, fractions, strict=True)
                ]
            ),
            kept=kept,
            offset_column=none,
            clock_column=none,
        )


def every_sample(
    record: Record,
    signal: str,
    driven_by: str,
    start: Start,
    others: Mapping[str, Array] = MappingProxyType({}),
) -> ObservedRecord:
    """A record under which a signal was observed as zero, at every sample and with weight 1."""
    size = record.values.size
    seen, plan = _every_sample(signal, record.start, record.rate, record.substeps, size)
    observed = ObservedRecord(record, (seen,), driven_by, start, others)
    observed.__dict__["_unmoved"] = plan
    return observed


@lru_cache(maxsize=8)
def _every_sample(
    signal: str, start: float, rate: float, substeps: int, size: int
) -> tuple[Observation, Plan]:
    record = Record(np.zeros(size), start, rate, substeps)
    seen = Observation(signal, record.time, np.zeros(record.time.size))
    return seen, ObservedRecord(record, (seen,))._unmoved


def _cells(record: Record, time: Array, moving: bool) -> tuple[NDArray[np.int64], Array, Array]:
    """Where stamps lie on the grid: (m,) point at or before each, how far behind it, in steps.

    And (2, m) weights of the slopes before and behind that point in the derivative by time, on a
    grid point the mean of both sides, as a central difference has it; (2, 0) unless `moving`. [1/s]
    """
    last = record.values.size - 1
    at = (time - record.start) * (record.rate * record.substeps)
    nearest = np.rint(at)
    if (np.abs(at - nearest) < ON_GRID).all():
        at = nearest
    else:
        at = np.where(np.abs(at - nearest) < ON_GRID, nearest, at)
    held = (at < 0.0) | (at > last)
    at = np.clip(at, 0.0, last)
    cell = at.astype(np.int64)
    fraction = at - cell
    if not moving:
        return cell, fraction, np.zeros((2, 0))
    on_grid = fraction == 0.0
    ahead = np.where(held | (cell == last), 0.0, np.where(on_grid, 0.5, 1.0))
    back = np.where(held | (cell == 0) | ~on_grid, 0.0, 0.5)
    return cell, fraction, np.stack([back, ahead]) / record.step


def _one_each(values: Sequence[float], observed: ObservedRecord, what: str) -> tuple[float, ...]:
    count = len(observed.observations)
    if len(values) == 0:
        return (0.0,) * count
    if len(values) != count or not np.isfinite(values).all():
        raise InputError(
            f"There are {count} observations, which need as many finite {what}s, not "
            f"{tuple(values)}."
        )
    return tuple(float(value) for value in values)
