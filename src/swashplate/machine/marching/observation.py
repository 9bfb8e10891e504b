"""What was measured of a model under its records, ready to be compared with simulations of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from types import MappingProxyType
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.errors import InputError
from swashplate.machine.marching.kernels import Struct
from swashplate.machine.marching.record import Record, column
from swashplate.machine.marching.rows import Plan
from swashplate.machine.marching.run import Start, check_start

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

ON_GRID = 1e-7
"""Samples by which a stamp may miss a grid point and still means it: rounding of its seconds."""


@dataclass(frozen=True, eq=False)
class Observation:
    """Measured samples of one signal, compared with the simulated signal at their stamps.

    The residual of sample i is ``weight[i] · (simulated(time[i]) + offset - values[i])``, where
    simulated(t) is linearly interpolated between the samples of the march's grid, and held outside
    the record.
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
    free_offset: bool = False
    """Whether the offset is to be found."""

    def __post_init__(self) -> None:
        what = f"The observation of {self.signal}"
        time = column(self.time, f"{what}: the time", finite=False)
        values = column(self.values, f"{what}: the values", finite=False)
        if values.size != time.size:
            raise InputError(f"{what} has {time.size} stamps for {values.size} values.")
        try:
            weight = np.broadcast_to(np.asarray(self.weight, np.float64), time.shape)
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
                f"{int(np.argmax(bad))}; give weight 0 to samples that are to be ignored."
            )
        alike = weight.size > 0 and weight.min() == weight.max()
        weight = _alike(float(weight[0]), weight.size) if alike else np.array(weight)
        for name, value in (("time", time), ("values", values), ("weight", weight)):
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        return f"Observation({self.signal!r}, {np.size(self.time)} samples)"


class RunValues(NamedTuple):
    """Values of what belongs to one experiment only, not to the machine."""

    start: Mapping[str, float] = MappingProxyType({})
    """Parts of the state at the first sample, by path; others are those of the start."""
    offsets: Sequence[float] = ()
    """Offset of each observation, in its signal's unit; none given means none."""


@dataclass(frozen=True, eq=False)
class ObservedRecord:
    """A record that drove a model, and what was observed of it."""

    record: Record
    observations: Sequence[Observation]
    driven_by: str = "voltage"
    """The signal that the record is of."""
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
        signals = {self.driven_by: self.record.values, **self.others}
        # the kernels are compiled for arrays that can be written to
        return {
            name: np.require(values, np.float64, ["C", "W"]) for name, values in signals.items()
        }

    @property
    def own_columns(self) -> tuple[str, ...]:
        """Labels of the observations' free offsets, in the order of their columns."""
        return tuple(
            f"offset of {observation.signal} [{r}]"
            for r, observation in enumerate(self.observations)
            if observation.free_offset
        )

    @cached_property
    def _first(self) -> Indices:
        sizes = [np.size(observation.time) for observation in self.observations]
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

    def offsets(self, offsets: Sequence[float]) -> Array:
        """(r,) offset of each observation as an array, zeros if there are no `offsets`.

        An `InputError` says if there are not as many as observations.
        """
        count = len(self.observations)
        if len(offsets) not in (0, count) or not np.isfinite(offsets).all():
            raise InputError(
                f"There are {count} observations, which need as many finite offsets, not "
                f"{tuple(offsets)}."
            )
        return np.array(offsets, dtype=np.float64) if len(offsets) else np.zeros(count)

    def offset_rows(self, first: int) -> Indices:
        """(r,) row of the derivative by each offset, from `first` on; -1 for fixed ones."""
        free = np.array([observation.free_offset for observation in self.observations])
        return np.where(free, first + np.cumsum(free) - 1, -1).astype(np.int64)

    @cached_property
    def plan(self) -> Struct[Plan]:
        """What the march needs to know of the observations."""
        positions = [
            _cells(self.record, np.asarray(observation.time)) for observation in self.observations
        ]
        weights = [np.asarray(observation.weight) for observation in self.observations]
        measured = _joined([np.asarray(observation.values) for observation in self.observations])
        weight = _joined(weights)
        if not weight.all():
            measured = np.where(weight > 0.0, measured, 0.0)
        regular: list[bool] = []
        cells: list[Indices] = []
        fractions: list[Array] = []
        for cell, fraction in positions:
            regular.append(bool((fraction == 0.0).all() and (np.diff(cell) == 1).all()))
            if regular[-1]:
                cells.append(_in_a_row(int(cell[0]), cell.size))
                fractions.append(_alike(0.0, fraction.size))
            else:
                cells.append(cell)
                fractions.append(fraction)
        plan = Plan(
            observations=len(cells),
            first=self._first,
            cell=_joined(cells),
            fraction=_joined(fractions),
            measured=measured,
            weight=weight,
            regular=np.array(regular, dtype=np.int64),
            all_weigh=np.array([weight.all() for weight in weights], dtype=np.int64),
        )
        return Struct(plan)


Rows = TypeVar("Rows", Array, Indices)


def _joined(parts: Sequence[Rows]) -> Rows:
    """All parts one after another; a single one as it is, so that it takes no memory twice."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


# arrays that the plans of runs of one length share; nobody writes to them


@lru_cache(maxsize=256)
def _alike(value: float, size: int) -> Array:
    return np.full(size, value)


@lru_cache(maxsize=256)
def _in_a_row(first: int, size: int) -> Indices:
    return np.arange(first, first + size, dtype=np.int64)


def every_sample(
    record: Record,
    signal: str,
    driven_by: str,
    start: Start,
    others: Mapping[str, Array] = MappingProxyType({}),
) -> ObservedRecord:
    """A record under which a signal was observed as zero, at every sample and with weight 1."""
    size = record.values.size
    observation, plan = _every_sample(signal, record.start, record.rate, record.substeps, size)
    observed = ObservedRecord(record, (observation,), driven_by, start, others)
    observed.__dict__["plan"] = plan
    return observed


@lru_cache(maxsize=8)
def _every_sample(
    signal: str, start: float, rate: float, substeps: int, size: int
) -> tuple[Observation, Struct[Plan]]:
    record = Record(np.zeros(size), start, rate, substeps)
    observation = Observation(signal, record.time, np.zeros(record.time.size))
    return observation, ObservedRecord(record, (observation,)).plan


def _cells(record: Record, time: Array) -> tuple[Indices, Array]:
    """Where stamps lie on the grid: (m,) point at or before each, and steps from it."""
    at = (time - record.start) * (record.rate * record.substeps)
    nearest = np.rint(at)
    at = np.where(np.abs(at - nearest) < ON_GRID, nearest, at)
    at = np.clip(at, 0.0, record.values.size - 1)
    cell = at.astype(np.int64)
    return cell, at - cell
