"""Unknowns of a fit: names, bounds, transforms, ties and priors; the vector that a solver moves."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import exp, inf, isfinite, log
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import PlainSerializer, PlainValidator

from swashplate.entries import Finite, Positive
from swashplate.errors import InputError, ParameterError
from swashplate.results import Result

Array = NDArray[np.float64]


def _finite_vector(content: object) -> Array:
    """Vector (K,) of a file's list of finite numbers."""
    vector = np.asarray(content)
    if vector.ndim != 1 or vector.dtype.kind not in "fi" or not np.isfinite(vector).all():
        raise ValueError("it must be a list of finite numbers")
    return vector.astype(np.float64)


Vector = Annotated[Array, PlainValidator(_finite_vector), PlainSerializer(np.ndarray.tolist)]
"""The numbers that a solver moves, (K,); in a file a list."""
AT_BOUND = 1e-4
"""Part of the reach between the bounds within which a number is at one of them: a search stays
inside, and was seen to end 2e-5 of it off a bound that the data pulled at."""


@dataclass(frozen=True)
class Prior:
    """What is known of an unknown beforehand: a normal distribution."""

    mean: Finite
    """In the unknown's unit."""
    deviation: Positive
    """Standard deviation, positive; of a logarithmic unknown that of its logarithm."""


Kind = Literal[
    "parameter",
    "force",
    "zero",
    "start",
    "start pressure",
    "start current",
    "instant",
]
"""What an unknown is: a parameter of the model; the force of the solenoids at a current; or of a
single run the free zero of a channel, a number of the state at the first sample, a drive's pressure
or a card's current there, or the instant of a jump of the command between two samples."""


@dataclass(frozen=True)
class Unknown:
    """One number that a fit is to find.

    Raises
    ------
    ParameterError
        If the bounds are not finite or not in their order, the nominal value lies outside them, or
        a logarithmic unknown may be 0 or negative.

    Examples
    --------
    >>> from swashplate.identification import Unknown
    >>> gain = Unknown("gain", 0.05, 0.001, 1.0, "m/(V s)", log=True)
    >>> gain.label
    'gain'
    """

    name: str
    start: float
    """Nominal value: where a fit begins. [unit]"""
    low: float
    high: float
    """Bounds. [unit]"""
    unit: str = ""
    log: bool = False
    """Whether the solver moves its logarithm: for positive numbers that are known by order."""
    prior: Prior | None = None
    sets: tuple[str, ...] = ()
    """Names in the model that take its value; its own if empty. Two names tie two directions."""
    run: str | None = None
    """The experiment that it belongs to, None for one of the machine."""
    kind: Kind = "parameter"
    channel: str | None = None
    """The channel whose zero it is; None for any other kind."""
    scale: float = field(default=0.0, repr=False)
    """What one unit of the solver's vector means, of an unknown that is not logarithmic; by default
    the size of its nominal value."""
    worth: float = field(default=1.0, repr=False)
    """Squared residuals of the data's cost that stand for one independent one of variance 1: so
    often the prior counts, see `intervals.weighed`."""

    def __post_init__(self) -> None:
        name, low, high = self.name, self.low, self.high
        if (self.kind == "zero") != (self.channel is not None):
            raise ParameterError(
                f"{name} has the kind '{self.kind}' and the channel {self.channel!r}: the zero of "
                "a sensor, and nothing else, names a channel."
            )
        if not (isfinite(low) and isfinite(high) and low < high):
            raise ParameterError(
                f"{name} is bounded by {low:g} and {high:g}; two finite numbers, the lower one "
                "first, are needed."
            )
        if not low <= self.start <= high:
            hint = "; 'swashplate guess' estimates those of a drive from its logs"
            raise ParameterError(
                f"{name} begins at {self.start:g}, outside its bounds {low:g} and {high:g}; let "
                f"the fit begin from another value{'' if isfinite(self.start) else hint}."
            )
        if self.log and low <= 0.0:
            raise ParameterError(
                f"{name} is moved by its logarithm: its lower bound must be above 0, not {low:g}."
            )
        if self.prior is not None and not self.prior.deviation > 0.0:
            raise ParameterError(f"The prior of {name} needs a positive standard deviation.")
        if not self.scale:
            # one that begins at next to nothing, or at 0, is known only by its bounds
            size, reach = abs(self.start), high - low
            object.__setattr__(self, "scale", size if size > 1e-6 * reach else 0.25 * reach)

    @property
    def targets(self) -> tuple[str, ...]:
        """Names in the model that take its value; none for a zero, which no model knows."""
        return () if self.kind == "zero" else self.sets or (self.name,)

    @property
    def label(self) -> str:
        """Its name, with the experiment of one that belongs to one: ``"offset counts (hoistr6)"``.

        It stands for the unknown in tables and mappings; nothing takes it apart.
        """
        return self.name if self.run is None else f"{self.name} ({self.run})"

    def to_value(self, number: float) -> float:
        """The value for a solver's number, kept within the bounds against rounding."""
        value = exp(number) if self.log else number * self.scale
        return min(max(value, self.low), self.high)

    def pull(self, number: float) -> float:
        """Distance of a solver's number from the prior's mean, in its deviations; 0 without one."""
        if self.prior is None:
            return 0.0
        size = number if self.log else number * self.scale
        middle = log(self.prior.mean) if self.log else self.prior.mean
        return (size - middle) / self.prior.deviation


def zero_name(channel: str) -> str:
    """What the free zero of a channel is called, also by users who free or fix it by name."""
    return f"offset {channel}"


def bounded(
    name: str,
    nominal: float,
    *,
    factors: tuple[float, float] | None = None,
    bounds: tuple[float, float] | None = None,
    least: float = -inf,
    **fields: Any,
) -> Unknown:
    """An unknown with bounds that are multiples of its nominal value, or numbers.

    `factors` are those on the nominal value, in either order, `bounds` the bounds as they are; the
    unknown never falls below `least`. `fields` are further ones of `Unknown`. A nominal value of 0,
    which no factor moves, is refused in a `ParameterError`.
    """
    if factors is not None and nominal == 0.0:
        raise ParameterError(
            f"{name} is nominally 0, which no factor changes: give absolute bounds."
        )
    low, high = bounds or sorted(factor * nominal for factor in factors or ())
    return Unknown(name, max(nominal, least), max(low, least), high, **fields)


def _places_of(
    names: Sequence[str], positions: Mapping[str | None, int]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows of the names that have a position, and these."""
    rows = [row for row, name in enumerate(names) if name in positions]
    return np.array(rows, np.intp), np.array([positions[names[row]] for row in rows], np.intp)


@dataclass(frozen=True, eq=False)
class Unknowns(Result):
    """The unknowns of a fit in the order of the solver's vector, at a point: nominal or estimated.

    The solver moves ln(value) of a logarithmic one, else value/scale: a change of 0.01 in its
    vector is one per cent, of the value or of the scale.

    Raises
    ------
    ParameterError
        If two unknowns set the same number of the model.

    Examples
    --------
    >>> from swashplate.identification import Unknown, Unknowns
    >>> gain = Unknown("gain", 0.05, 0.001, 1.0)
    >>> lag = Unknown("lag", 0.1, 0.01, 1.0, "s")
    >>> Unknowns((gain, lag)).names
    ('gain', 'lag')
    """

    items: tuple[Unknown, ...]
    point: Array | None = field(default=None, repr=False)
    """(K,) vector of the point; nominal if None. See `at`."""

    def __post_init__(self) -> None:
        taken = Counter(
            (unknown.run, target)
            for unknown in self.items
            for target in unknown.targets or (unknown.name,)
        )
        for (_, target), times in taken.items():
            if times > 1:
                raise ParameterError(f"{target} is set by two parameters; let one set it.")

    def __getitem__(self, number: int) -> Unknown:
        return self.items[number]

    def __len__(self) -> int:
        return len(self.items)

    def __iter__(self) -> Iterator[Unknown]:
        return iter(self.items)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The label of each."""
        return tuple(unknown.label for unknown in self.items)

    def index(self, name: str) -> int:
        """Number of an unknown; an `InputError` if there is none of that name."""
        if name not in self.names:
            raise InputError(f"There is no parameter {name}; there are {', '.join(self.names)}.")
        return self.names.index(name)

    @cached_property
    def logarithmic(self) -> NDArray[np.bool_]:
        """(K,) which are moved by their logarithms."""
        return np.array([unknown.log for unknown in self.items], dtype=np.bool_)

    @cached_property
    def scales(self) -> Array:
        """(K,) what one unit of the vector means; not used of logarithmic ones. [unit]"""
        return np.array([unknown.scale for unknown in self.items])

    @cached_property
    def prior_widths(self) -> Array:
        """(K,) standard deviations of the priors in the solver's vector; inf without one."""
        deviations = [
            np.inf if unknown.prior is None else unknown.prior.deviation for unknown in self.items
        ]
        return np.array(deviations) / np.where(self.logarithmic, 1.0, self.scales)

    @cached_property
    def start(self) -> Array:
        """(K,) vector of the nominal values."""
        return self.to_vector(np.array([unknown.start for unknown in self.items]))

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """(K,) lower and upper bounds of the vector."""
        low = np.array([unknown.low for unknown in self.items])
        high = np.array([unknown.high for unknown in self.items])
        return self.to_vector(low), self.to_vector(high)

    def at(self, vector: Array) -> Unknowns:
        """The same at another point."""
        return replace(self, point=np.asarray(vector, dtype=np.float64))

    @property
    def vector(self) -> Array:
        """(K,) the point."""
        return self.start if self.point is None else self.point

    @cached_property
    def estimates(self) -> Array:
        """(K,) values at the point, within the bounds. [unit]"""
        return np.array(self._within(self.vector))

    @cached_property
    def at_bound(self) -> NDArray[np.int8]:
        """(K,) -1 if the point is at the lower bound, 1 at the upper, 0 between."""
        low, high = self.bounds
        near = AT_BOUND * (high - low)
        return np.where(self.vector <= low + near, -1, self.vector >= high - near).astype(np.int8)

    @property
    def free(self) -> NDArray[np.bool_]:
        """(K,) unknowns that are not at a bound."""
        return np.asarray(self.at_bound == 0)

    @property
    def released(self) -> Unknowns:
        """The same at the same point, with bounds so much wider that none is at one."""
        items = []
        for unknown, side in zip(self.items, self.at_bound, strict=True):
            low, high = unknown.low, unknown.high
            if side < 0:
                low = low * low / high if unknown.log else low - (high - low)
            if side > 0:
                high = high * high / low if unknown.log else high + (high - low)
            items.append(replace(unknown, low=low, high=high))
        return replace(self, items=tuple(items), point=self.vector)

    @property
    def slopes(self) -> Array:
        """(K,) derivative of each value by its number in the vector."""
        return np.where(self.logarithmic, self.to_values(self.vector), self.scales)

    def to_values(self, vector: Array) -> Array:
        """(..., K) values of vectors; a logarithm beyond any float's becomes inf or 0."""
        with np.errstate(over="ignore"):
            powers = np.exp(np.where(self.logarithmic, vector, 0.0))
        return np.where(self.logarithmic, powers, vector * self.scales)

    def to_vector(self, values: Array) -> Array:
        """(..., K) vectors of values, positive if logarithmic."""
        logarithms = np.log(np.where(self.logarithmic, values, 1.0))
        return np.where(self.logarithmic, logarithms, values / self.scales)

    def _within(self, vector: Array) -> list[float]:
        numbers = zip(self.items, vector.tolist(), strict=True)
        return [unknown.to_value(number) for unknown, number in numbers]

    def values(self, vector: Array) -> dict[str, float]:
        """Values by name, within the bounds."""
        return dict(zip(self.names, self._within(vector), strict=True))

    def vector_of(self, values: Mapping[str, float]) -> Array:
        """(K,) vector of some values by name; those not named stay nominal."""
        named = zip(self.names, self.items, strict=True)
        return self.to_vector(
            np.array([values.get(name, unknown.start) for name, unknown in named])
        )

    @property
    def machine_targets(self) -> list[str]:
        """Names in the model that unknowns of no single run set."""
        return [name for unknown in self.items if unknown.run is None for name in unknown.targets]

    @cached_property
    def shared(self) -> NDArray[np.intp]:
        """(M,) numbers of the unknowns of the machine, which all runs share."""
        return np.array([k for k, unknown in enumerate(self.items) if unknown.run is None], np.intp)

    @cached_property
    def _of_runs(self) -> Mapping[str, NDArray[np.intp]]:
        """By run the numbers of the unknowns that belong only to it."""
        numbers: dict[str, list[int]] = {}
        for k, unknown in enumerate(self.items):
            if unknown.run is not None:
                numbers.setdefault(unknown.run, []).append(k)
        return {run: np.array(of_run, np.intp) for run, of_run in numbers.items()}

    def of_run(self, run: str) -> NDArray[np.intp]:
        """(q,) numbers of the unknowns that belong only to one experiment."""
        return self._of_runs.get(run, np.zeros(0, np.intp))

    def columns(self, run: str) -> NDArray[np.intp]:
        """(q + M,) numbers of the unknowns that can move one experiment: its own come first."""
        return np.concatenate([self.of_run(run), self.shared])

    def targets(self, vector: Array, run: str) -> dict[str, float]:
        """Values by the model's names, as one experiment sees them."""
        if any(self.items[k].targets for k in self.of_run(run).tolist()):
            return self._targets_of(vector, sorted(self.columns(run).tolist()))
        # all runs without numbers of their own see the same
        key = vector.tobytes()
        found = self._last_targets.get(key)
        if found is None:
            found = self._targets_of(vector, self.shared.tolist())
            self._last_targets.clear()
            self._last_targets[key] = found
        return dict(found)

    def _targets_of(self, vector: Array, numbers: Sequence[int]) -> dict[str, float]:
        """Values by the model's names that some unknowns set."""
        values = ((self.items[k], self.items[k].to_value(float(vector[k]))) for k in numbers)
        return {name: value for unknown, value in values for name in unknown.targets}

    @cached_property
    def _last_targets(self) -> dict[bytes, dict[str, float]]:
        """What the machine's unknowns set at the last vector."""
        return {}

    def zeros(self, vector: Array, run: str) -> dict[str, float]:
        """Free zeros of one experiment by their channels.

        Parameters
        ----------
        vector : (K,) array
            The solver's.
        run : str
            Name of the experiment.

        Returns
        -------
        dict of str to float
            Zeros that are unknown, by channel; empty if none is. [unit of the channel]

        Examples
        --------
        >>> import numpy as np
        >>> from swashplate.identification import Unknown, Unknowns
        >>> zero = Unknown(
        ...     "offset", 0.0, -1.0, 1.0, "A", run="test", kind="zero", channel="current", scale=1.0
        ... )
        >>> Unknowns((zero,)).zeros(np.array([0.02]), "test")
        {'current': 0.02}
        """
        zeros = dict[str, float]()
        for number in self.columns(run).tolist():
            unknown = self.items[number]
            if unknown.channel is not None:
                zeros[unknown.channel] = unknown.to_value(float(vector[number]))
        return zeros

    def chain(self, vector: Array, targets: Sequence[str], run: str) -> Array:
        """(len(targets), q + M) derivatives of the model's numbers by `columns` of the vector."""
        key = (run, "targets", *targets)
        if key not in self._places:
            columns = self.columns(run)
            positions = dict[str | None, int]()
            for position in np.argsort(columns).tolist():
                positions |= dict.fromkeys(self.items[columns[position]].targets, position)
            self._places[key] = _places_of(targets, positions)
        return self._selected(vector, run, len(targets), self._places[key])

    def zeros_chain(self, vector: Array, channels: Sequence[str], run: str) -> Array:
        """(len(channels), q + M) derivatives of channels' zeros by `columns` of the vector."""
        key = (run, "zeros", *channels)
        if key not in self._places:
            positions = {
                self.items[column].channel: position
                for position, column in enumerate(self.columns(run).tolist())
            }
            self._places[key] = _places_of(channels, positions)
        return self._selected(vector, run, len(channels), self._places[key])

    @cached_property
    def _places(self) -> dict[tuple[str, ...], tuple[NDArray[np.intp], NDArray[np.intp]]]:
        """Rows and columns of the derivatives that are not 0, by run and what is moved."""
        return {}

    def _selected(
        self,
        vector: Array,
        run: str,
        size: int,
        places: tuple[NDArray[np.intp], NDArray[np.intp]],
    ) -> Array:
        """(size, columns of the run) slopes of unknowns at some rows and positions, else 0."""
        columns = self.columns(run)
        slopes = np.where(self.logarithmic, self.to_values(vector), self.scales)[columns]
        rows, positions = places
        matrix = np.zeros((size, columns.size))
        matrix[rows, positions] = slopes[positions]
        return matrix

    def with_worths(self, worths: Sequence[float] | None) -> Unknowns:
        """The same with these worths of the priors, in order; without any priors for None."""
        if worths is None:
            without = tuple(replace(unknown, prior=None) for unknown in self.items)
            return replace(self, items=without)
        remaining = iter(worths)
        items = tuple(
            replace(unknown, worth=next(remaining)) if unknown.prior else unknown
            for unknown in self.items
        )
        return replace(self, items=items)

    def prior_rows(self, vector: Array) -> tuple[Array, Array]:
        """Residuals (p,) of the priors and their derivatives (p, K) by the vector."""
        with_prior = [
            (k, unknown, unknown.prior) for k, unknown in enumerate(self.items) if unknown.prior
        ]
        residuals, rows = np.zeros(len(with_prior)), np.zeros((len(with_prior), len(self.items)))
        for row, (k, unknown, prior) in enumerate(with_prior):
            scale, mean = (1.0, np.log(prior.mean)) if unknown.log else (unknown.scale, prior.mean)
            weight = np.sqrt(unknown.worth) / prior.deviation
            residuals[row] = weight * (vector[k] * scale - mean)
            rows[row, k] = weight * scale
        return residuals, rows
