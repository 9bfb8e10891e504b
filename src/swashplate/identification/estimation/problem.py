"""Problem of a fit: residuals and derivatives, and what they are near the optimum."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache, partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import Channel, Experiment
from swashplate.errors import DomainError, InputError
from swashplate.identification.estimation.arrow import (
    ArrowFactor,
    RunRows,
    Whitening,
    arrow_factor,
    stacked,
    triangular_factor,
    whitening,
)
from swashplate.identification.estimation.measured_machine import measured
from swashplate.identification.estimation.model import (
    RELATIVE_STEP,
    EquationModel,
    Linearised,
    MachineModel,
    SimulationRequest,
    linearised,
    part_of,
    simulated,
)
from swashplate.identification.estimation.unknowns import Unknowns
from swashplate.machine import Machine
from swashplate.machine import Model as OfEquations
from swashplate.machine.marching import ObservedRecord
from swashplate.results import Result, short
from swashplate.tables import count

if TYPE_CHECKING:
    from concurrent.futures import ThreadPoolExecutor

    from swashplate.machine.marching import BoundModel

Array = NDArray[np.float64]
Returned = TypeVar("Returned")
Loss = Literal["linear", "soft_l1", "cauchy"]


STACKED = 1000
"""Rows of all runs together up to which it does not pay to reduce them further."""


class Evaluation(NamedTuple):
    """Residuals and their derivatives by the solver's vector at one point."""

    def __repr__(self) -> str:
        return short(self)

    residuals: Array
    """(m,) residuals, or any vector of which sum of squares and gradient are the same."""
    jacobian: Array
    """(m, K)"""


@dataclass(frozen=True, eq=False)
class _MarchedRun(Result):
    """An experiment as the march of a model of equations sees it."""

    observed: ObservedRecord
    names: list[str]
    """Names of the model that its unknowns are of."""
    free_zeros: list[str]
    """Channels whose zeros are free."""
    columns: list[str]
    """Columns of the model that the names depend on."""
    by_names: Array
    """(columns, names) derivatives of the columns by the names."""


@dataclass(frozen=True, eq=False)
class Problem(Result):
    """Half the weighted sum of squares of all experiments, as a function of the unknowns.

    The residual of a sample is sqrt(weight)/scale times (simulated less measured).

    Raises
    ------
    InputError
        If there is no unknown, no experiment, or no sample that counts.

    Examples
    --------
    >>> from swashplate import BlackBox, Campaign, maneuvers, rig
    >>> from swashplate.identification import Problem, Unknown, Unknowns
    >>> def gained(time, inputs, numbers):
    ...     return {"shaft_speed": numbers["gain"] * inputs["voltage"]}
    >>> machine = BlackBox(
    ...     "gain",
    ...     gained,
    ...     inputs=("voltage",),
    ...     outputs=("shaft_speed",),
    ...     numbers={"gain": 0.3},
    ... )
    >>> sine = {"sine": maneuvers.sine(9.0, 0.1)}
    >>> tests = rig.run("hoist", sine, channels=("shaft_speed",))
    >>> campaign = Campaign.from_toml(rig.write(tests, "sines"))
    >>> problem = Problem(
    ...     machine,
    ...     campaign.experiments,
    ...     Unknowns((Unknown("gain", 0.3, 0.01, 1.0, "rad/(s V)"),)),
    ...     channels=("shaft_speed",),
    ...     scales={"shaft_speed": 0.01},
    ... )
    >>> problem.start.shape
    (1,)
    """

    model: MachineModel
    """A machine, a model of equations without numbers, or what `ModelSetup` and drives make of
    theirs."""
    experiments: tuple[Experiment, ...]
    unknowns: Unknowns
    channels: tuple[str, ...]
    """Names of the channels that are fitted."""
    scales: Mapping[str, float]
    """Unit of the residuals of each channel: the standard deviation of its noise, in its unit."""
    fixed: Mapping[str, float] = field(default_factory=dict)
    """Values of the model's names that are not unknown but differ from the model's own."""
    zeros: Mapping[str, float] = field(default_factory=dict)
    """Zeros of channels that are known, by the channel. [unit]"""
    uncertain: tuple[Mapping[str, float], ...] = ()
    """Standard uncertainties of fixed numbers, by the model's names; those of one mapping are off
    together. [unit]"""
    threads: int = 1
    """Threads over experiments, for a model that releases the interpreter's lock."""
    compare: Callable[[Channel, Array], Array] | None = None
    """Linear map of a channel's samples, (m,) or (m, k), before they are compared: a position that
    drifts by its motion since the last anchor, for example."""
    _last: dict[Any, Evaluation] = field(default_factory=dict, repr=False, init=False)

    def __post_init__(self) -> None:
        if isinstance(self.model, Machine | OfEquations):
            object.__setattr__(self, "model", measured(self.model))
        if not self.unknowns:
            raise InputError("A fit needs at least one parameter.")
        if not self.experiments:
            raise InputError("A fit needs at least one experiment.")
        if not self.samples:
            raise InputError(
                f"No sample of {', '.join(self.channels) or 'any channel'} is used: all are "
                "ignored or there are none."
            )

    @property
    def start(self) -> Array:
        """(K,) nominal vector."""
        return self.unknowns.start

    @property
    def bounds(self) -> tuple[Array, Array]:
        """(K,) bounds of the vector."""
        return self.unknowns.bounds

    @cached_property
    def weights(self) -> tuple[Mapping[str, Array], ...]:
        """For each experiment and fitted channel the (m,) factors on the residuals."""
        weights = []
        for run in self.experiments:
            names = [name for name in self.channels if name in run.channels]
            weights.append({name: _factors(run[name].weight, self.scales[name]) for name in names})
        return tuple(weights)

    @property
    def samples(self) -> int:
        """Samples that count."""
        return sum(int(np.count_nonzero(w)) for run in self.weights for w in run.values())

    def evaluate(self, vector: Array, *, compressed: bool = True) -> Evaluation:
        """Residuals and Jacobian by the vector; compressed, as triangular factors of the runs.

        Of many runs these are reduced to one of all, of K + 1 rows.
        The last ones are kept. A `DomainError` says that the model does not hold there.
        """
        key = vector.tobytes(), compressed
        if key not in self._last:
            evaluation = self._compressed(vector) if compressed else self._all_samples(vector)
            self._last.clear()
            self._last[key] = evaluation
        return self._last[key]

    def _compressed(self, vector: Array) -> Evaluation:
        """[J r] as the triangular factors of the runs, or as that of all."""
        ways = [self._reduced if marched else self._factored for marched in self._marched]
        blocks = self._each(lambda number: ways[number](vector, number))
        residuals, _ = self.unknowns.prior_rows(vector)
        priors = prior_blocks(self.unknowns, vector)
        for block, residual in zip(priors, residuals, strict=True):
            blocks.append(block._replace(rows=np.append(block.rows, [[residual]], axis=1)))
        size = len(self.unknowns)
        shared = np.append(self.unknowns.shared, size)
        if sum(len(block.rows) for block in blocks) > STACKED:
            factor = arrow_factor(size + 1, shared, blocks).dense()
        else:
            factor = stacked(size + 1, shared, blocks)
        residuals, jacobian = factor[:, -1], factor[:, :-1]
        return Evaluation(np.ascontiguousarray(residuals), np.ascontiguousarray(jacobian))

    def _all_samples(self, vector: Array) -> Evaluation:
        """Residuals and derivatives of all samples, as a robust loss needs them."""
        parts = self._each(lambda number: self._full(vector, number))
        residuals, rows = self.unknowns.prior_rows(vector)
        jacobians = []
        for experiment, part in zip(self.experiments, parts, strict=True):
            jacobian = np.zeros((part.residuals.size, len(self.unknowns)))
            jacobian[:, self.unknowns.columns(experiment.name)] = part.jacobian
            jacobians.append(jacobian)
        values = [part.residuals for part in parts]
        return Evaluation(np.concatenate([*values, residuals]), np.vstack([*jacobians, rows]))

    def cost(self, vector: Array) -> float:
        """Only half the sum of squares, which is quicker."""
        priors, _ = self.unknowns.prior_rows(vector)
        return 0.5 * (sum(self._each(partial(self._squares, vector))) + float(priors @ priors))

    def _squares(self, vector: Array, number: int) -> float:
        if self._marched[number]:
            ready, observed = self._ready(vector, number)
            residuals = ready.residuals(observed)
            if np.isfinite(total := float(residuals @ residuals)):
                return total
        # by channel, which also says what is not finite
        return sum(
            float(np.sum(residual**2)) for residual in self.residuals(vector, number).values()
        )

    def residuals(self, vector: Array, number: int) -> Mapping[str, Array]:
        """Weighted residuals (m,) of the fitted channels of one experiment, 0 if ignored."""
        experiment, weights = self.experiments[number], self.weights[number]
        return {
            name: weights[name] * self._compared(experiment[name], y - experiment[name].values)
            for name, y in self.outputs(vector, number).items()
        }

    def outputs(self, vector: Array, number: int) -> Mapping[str, Array]:
        """Simulated samples of the fitted channels of one experiment, offsets included."""
        experiment, zeros = self.experiments[number], self._zeros(vector, number)
        outputs = simulated(self.model, self.model_values(vector, number), experiment)
        return {name: part_of(outputs, experiment, name) + zero for name, zero in zeros.items()}

    def linearised(self, vector: Array, number: int) -> Mapping[str, Linearised]:
        """Weighted residuals of each channel of one experiment and their derivatives.

        These are by the unknowns that can move the experiment, `Unknowns.columns`.
        """
        experiment, run = self.experiments[number], self.experiments[number].name
        values, zeros = self.model_values(vector, number), self._zeros(vector, number)
        names = list(self.unknowns.targets(vector, run))
        outputs = linearised(self.model, values, experiment, names)
        chain = self.unknowns.chain(vector, names, run)
        by_channel = dict[str, Linearised]()
        for name, weight in self.weights[number].items():
            channel, output = experiment[name], part_of(outputs, experiment, name)
            residual = output.values + zeros[name] - channel.values
            by = output.by @ chain
            by += self.unknowns.zeros_chain(vector, [name], run)
            by = self._compared(channel, by)
            by *= weight[:, None]
            by_channel[name] = Linearised(weight * self._compared(channel, residual), by)
        return by_channel

    def model_values(self, vector: Array, number: int) -> dict[str, float]:
        """Values by the model's names for one experiment; a channel's zero is none of them."""
        return {**self.fixed, **self.unknowns.targets(vector, self.experiments[number].name)}

    def _zeros(self, vector: Array, number: int) -> dict[str, float]:
        """Zero of each fitted channel of one experiment, 0 unless it is known or free."""
        free = self.unknowns.zeros(vector, self.experiments[number].name)
        zeros = {**self.zeros, **free}
        return {name: zeros.get(name, 0.0) for name in self.weights[number]}

    def _compared(self, channel: Channel, rows: Array) -> Array:
        return rows if self.compare is None else self.compare(channel, rows)

    def _full(self, vector: Array, number: int) -> Evaluation:
        """All samples of one experiment, by the unknowns that can move it."""
        values, by = zip(*self.linearised(vector, number).values(), strict=True)
        return Evaluation(np.concatenate(values), np.vstack(by))

    def _factored(self, vector: Array, number: int) -> RunRows:
        """[J r] of one experiment if the march cannot make its triangular factor."""
        residuals, jacobian = self._full(vector, number)
        factor = triangular_factor(np.column_stack([jacobian, residuals]))
        return self._block(number, factor)

    def _reduced(self, vector: Array, number: int) -> RunRows:
        """The triangular factor of [J r] of one experiment, without ever holding J."""
        ready, observed = self._ready(vector, number)
        run_name, marched = self.experiments[number].name, self._marched_runs[number]
        factor = ready.triangle(observed).factor
        chain = self.unknowns.chain(vector, marched.names, run_name)
        count = len(marched.columns)
        jacobian = factor[:, :count] @ marched.by_names @ chain
        zeros_chain = self.unknowns.zeros_chain(vector, marched.free_zeros, run_name)
        jacobian += factor[:, count:-1] @ zeros_chain
        return self._block(number, np.column_stack([jacobian, factor[:, -1]]))

    def _block(self, number: int, rows: Array) -> RunRows:
        run = self.experiments[number].name
        return RunRows(run, self.unknowns.of_run(run), rows)

    @cached_property
    def _marched(self) -> tuple[bool, ...]:
        """Whether the march itself makes the residuals of each experiment."""
        can_march = self.compare is None and isinstance(self.model, EquationModel)
        with_moved_edges = {unknown.run for unknown in self.unknowns if unknown.kind == "instant"}
        return tuple(can_march and run.name not in with_moved_edges for run in self.experiments)

    def _ready(self, vector: Array, number: int) -> tuple[BoundModel, ObservedRecord]:
        """The model with the numbers of one experiment, and this as the march sees it."""
        experiment, marched = self.experiments[number], self._marched_runs[number]
        model = cast("EquationModel", self.model)
        zeros = list(self._zeros(vector, number).values())
        request = SimulationRequest(marched.observed, marched.columns, zeros)
        ready = model.ready(self.model_values(vector, number), experiment, request)
        return ready, marched.observed

    @cached_property
    def _marched_runs(self) -> list[_MarchedRun]:
        """Each experiment as the march of a model of equations sees it."""
        model = cast("EquationModel", self.model)
        marched = list[_MarchedRun]()
        for experiment, weights in zip(self.experiments, self.weights, strict=True):
            names = list(self.unknowns.targets(self.start, experiment.name))
            free = self.unknowns.zeros(self.start, experiment.name)
            zeros = [name for name in weights if name in free]
            observed = model.observed(experiment, weights, zeros)
            columns, by_names = model.columns(names)
            marched.append(_MarchedRun(observed, names, zeros, columns, by_names))
        return marched

    def _each(self, work: Callable[[int], Returned]) -> list[Returned]:
        """Results of some work for each experiment, in their order."""
        numbers = range(len(self.experiments))
        if min(self.threads, len(numbers)) == 1:
            return [work(number) for number in numbers]
        return list(_pool(self.threads).map(work, numbers))


def _factors(weight: Array, scale: float) -> Array:
    """(m,) factors on residuals; if all are equal, an array that takes no memory."""
    if weight.size and weight.min() == weight.max():
        return np.broadcast_to(np.sqrt(weight[0]) / scale, weight.shape)
    return np.sqrt(weight) / scale


@lru_cache
def _pool(threads: int) -> ThreadPoolExecutor:
    """Threads that stay: a fit evaluates hundreds of times, and to start them takes as long."""
    from concurrent.futures import ThreadPoolExecutor

    return ThreadPoolExecutor(threads)


def noise_scales(
    experiments: Sequence[Experiment], channels: Sequence[str], *, least: float = 0.0
) -> dict[str, float]:
    """What one unit of residual is, by channel.

    A noise that is stated; or the rounding of an encoder; or 1 % of the range in all runs. At
    `least` that share of the range. A channel that is in no experiment, or never changes, is
    refused.
    """
    scales = {}
    for name in channels:
        having: list[Channel] = [run[name] for run in experiments if name in run.channels]
        if not having:
            channel_names = ", ".join(dict.fromkeys(c for run in experiments for c in run.channels))
            raise InputError(f"No experiment has a channel '{name}'; there are {channel_names}.")
        # an ignored spike says nothing of the range
        ranges = [
            float(np.ptp(channel.values[channel.used])) for channel in having if channel.used.any()
        ]
        largest = max(ranges, default=0.0)
        stated = [channel.noise for channel in having if channel.noise is not None]
        if stated:
            scales[name] = float(np.sqrt(np.mean(np.square(stated))))
        elif step := having[0].resolution:
            # rounding leaves an error between -1/2 and 1/2 of a step
            scales[name] = step / np.sqrt(12.0)
        else:
            scales[name] = 0.01 * largest
        scales[name] = max(scales[name], least * largest)
        if scales[name] == 0.0:
            raise InputError(f"The channel '{name}' never changes: nothing can be fitted to it.")
    return scales


# --- what a model rounds --------------------------------------------------------------------------

FARTHER = 10.0
"""Factor from one tried change of an unknown to the next."""


class RoundedUnknown(NamedTuple):
    """An unknown that a model rounds: small changes of it change no sample."""

    def __repr__(self) -> str:
        return short(self)

    name: str
    same: float
    """Largest change of it that was tried and changed nothing. [unit]"""
    other: float
    """Smallest one that changed something. [unit]"""
    unit: str

    @property
    def sentence(self) -> str:
        """What the fit cannot do about it, and what its author can."""
        unit = f" {self.unit}" if self.unit else ""
        return (
            f"The model rounds {self.name}: a change by {self.same:.2g}{unit} changes no sample, "
            f"one by {self.other:.2g}{unit} does, so that no search can move it. Let the model "
            f"follow {self.name} without steps, a delay as np.interp(time - {self.name}, time, "
            "command), or fix it and compare fits at several values."
        )


def rounded_unknowns(problem: Problem, vector: Array) -> tuple[RoundedUnknown, ...]:
    """Unknowns that a model rounds, such as a delay by whole samples.

    Only of a model that is differentiated by differences. Larger and larger changes towards the
    farther bound are tried: an unknown is rounded if the first that changes a sample lands on
    another step, on which small changes change nothing again. A limit that is not reached before
    is no such step, as beyond it every change counts.
    """
    if getattr(problem.model, "linearise", None):
        return ()
    point = problem.unknowns.at(vector)
    found = (_rounded(problem, point, k) for k in range(len(point)))
    return tuple(rounded for rounded in found if rounded is not None)


def _rounded(problem: Problem, point: Unknowns, k: int) -> RoundedUnknown | None:
    """See `rounded_unknowns`, of one unknown."""
    unknown = point[k]
    value = float(point.estimates[k])
    room_above, room_below = unknown.high - value, value - unknown.low
    direction = 1.0 if room_above >= room_below else -1.0
    smallest = RELATIVE_STEP * max(abs(value), 1e-3)
    numbers = [
        number
        for number, experiment in enumerate(problem.experiments)
        if unknown.run in (None, experiment.name)
    ]

    def are_same(one: float, another: float) -> bool:
        """Whether two changes of the unknown give the same samples in every run."""
        vectors = []
        for change in (one, another):
            values = point.estimates.copy()
            values[k] += direction * change
            vectors.append(problem.unknowns.to_vector(values))
        for number in numbers:
            first, second = (problem.outputs(vector, number) for vector in vectors)
            if any(not np.array_equal(first[name], second[name]) for name in first):
                return False
        return True

    room = max(room_above, room_below)
    same = smallest
    try:
        while FARTHER * same < room:
            other = FARTHER * same
            if not are_same(smallest, other):
                # it may land on the very edge of a step
                on_step = are_same(other, other + smallest) or are_same(other, other - smallest)
                return RoundedUnknown(unknown.label, same, other, unknown.unit) if on_step else None
            same = other
    except DomainError:
        pass
    return None


# --- at the optimum -------------------------------------------------------------------------------

TOLERANCE = 1e-10
"""Singular values below this part of the largest count as zero.

With exact derivatives a gauge of the hoist's fit setup lies at 1e-15, and the weakest direction
that the tests determine at 2e-5. Derivatives by central differences are good to about 1e-9: those
take `BY_DIFFERENCES`.
"""
BY_DIFFERENCES = 1e-6


class LinearisedRun(NamedTuple):
    """One channel of one experiment at the optimum; only the samples that count."""

    def __repr__(self) -> str:
        return short(self)

    name: str
    """The experiment's."""
    channel: str
    time: Array
    """(n,) stamps, increasing; ignored samples are simply absent. [s]"""
    residual: Array
    """(n,) weighted: w times (simulated less measured)."""
    weight: Array | None = None
    """(n,) the factors w; None if all are equal. Samples of factor 0 are dropped."""

    @property
    def unweighted(self) -> Array:
        """(n,) differences simulated less measured, without the weights if those are known."""
        return self.residual if self.weight is None else self.residual / self.weight


@dataclass(frozen=True, eq=False)
class LinearisedFit(Result):
    """All runs of a fit at its optimum that have a sample which counts; see `linearised_fit`.

    An unknown belongs to the machine or to one run. So the derivatives of a run are those by the
    unknowns that can move it, `Unknowns.columns`, and those of all runs are never held together:
    `jacobians` goes through them, and `factor` is all that is needed of them at once.
    """

    runs: tuple[LinearisedRun, ...]
    derivatives: Iterable[Array] = field(repr=False)
    """(n, q + M) for each run the derivatives of `residual` by the unknowns that can move it; it
    can be gone through again and again."""
    variables: Unknowns
    factor: ArrowFactor = field(repr=False)
    """Of all derivatives and priors. Never of the normal equations: a null direction of JᵀJ drowns
    in rounding at 1e-8."""
    prior: Array
    """(p, K) rows of the Gaussian priors: derivatives of (number less mean)/deviation, times the
    root of `prior_noise`."""
    tolerance: float = TOLERANCE
    prior_noise: Array = field(default_factory=lambda: np.ones(0))
    """(p,) variance of each prior's residual, which counts as that many of the data's."""

    def jacobians(self) -> Iterator[tuple[LinearisedRun, Array]]:
        """Each run with its derivatives (n, q + M), one after another."""
        return zip(self.runs, self.derivatives, strict=True)

    @property
    def samples(self) -> int:
        """Samples of all runs."""
        return sum(run.time.size for run in self.runs)

    @cached_property
    def squares(self) -> float:
        """Sum of the squared weighted residuals."""
        return float(sum(run.residual @ run.residual for run in self.runs))

    @cached_property
    def triangle(self) -> Array:
        """(<= K, K) factor R of all derivatives and priors, RᵀR = JᵀJ."""
        return self.factor.dense()

    @cached_property
    def inverse(self) -> Whitening:
        """Inverse of the derivatives; unknowns at a bound are fixed there."""
        return whitening(self.factor, self.variables.free, self.tolerance)

    @property
    def whitening(self) -> Array:
        """(K, rank) matrix W with W Wᵀ the inverse of JᵀJ on what the runs determine.

        The columns of J W are orthonormal. Rows of unknowns at a bound are 0: they are fixed there.
        """
        return self.inverse.matrix

    @property
    def determined(self) -> NDArray[np.bool_]:
        """(K,) unknowns that are free and have no part in any null direction."""
        return self.inverse.determined

    @property
    def rank(self) -> int:
        """How many combinations of the unknowns the runs determine."""
        return self.inverse.rank

    @property
    def spare_samples(self) -> int:
        """Samples more than combinations determined; an `InputError` if there are none."""
        spare = self.samples - self.rank
        if spare < 1:
            had, wanted = count(self.samples, "sample"), count(self.rank, "parameter")
            raise InputError(
                f"{had} for {wanted} leave nothing to estimate the noise from; use more samples or "
                "fewer parameters."
            )
        return spare


def prior_blocks(unknowns: Unknowns, vector: Array) -> list[RunRows]:
    """The derivatives of each prior's residual, as rows of the run that its unknown belongs to."""
    _, rows = unknowns.prior_rows(vector)
    having = [unknown for unknown in unknowns if unknown.prior is not None]
    runs = [unknown.run or "" for unknown in having]
    return [
        RunRows(run, unknowns.of_run(run), row[None, unknowns.columns(run)])
        for run, row in zip(runs, rows, strict=True)
    ]


def factor_of(
    runs: Iterable[tuple[LinearisedRun, Array]], unknowns: Unknowns, priors: Iterable[RunRows] = ()
) -> ArrowFactor:
    """Factor of the derivatives of some runs, each (n, q + M), and of rows of priors."""

    def blocks() -> Iterator[RunRows]:
        yield from priors
        for run, jacobian in runs:
            yield RunRows(run.name, unknowns.of_run(run.name), jacobian)

    return arrow_factor(len(unknowns), unknowns.shared, blocks())


def influence(residuals: Array, loss: Loss) -> tuple[Array, Array]:
    """ψ of each residual, half the derivative of its loss, and the derivative of that.

    The losses are SciPy's, of residuals in units of their noise (Huber 1981, chapter 4).
    """
    z = 1.0 + residuals**2
    if loss == "soft_l1":
        return residuals / np.sqrt(z), z**-1.5
    if loss == "cauchy":
        return residuals / z, (2.0 - z) / z**2
    return residuals, np.ones_like(residuals)


KEPT = 160e6
"""Derivatives of a fit that are kept instead of marched again: those of a dozen runs of half a
minute at 512 Hz, by fifty unknowns. [bytes]"""


class _Derivatives:
    """Derivatives of each run of a fit at a point, marched again whenever they are gone through.

    The first ones are kept, as far as `KEPT` goes.
    """

    def __init__(self, problem: Problem, vector: Array) -> None:
        self.problem, self.vector = problem, vector
        self._kept = dict[int, list[Array]]()
        self._left = KEPT

    def linearised(self, number: int) -> dict[str, Linearised]:
        """Residuals and derivatives of an experiment at the samples that count, by channel."""
        parts = dict[str, Linearised]()
        for name, part in self.problem.linearised(self.vector, number).items():
            used = self.problem.weights[number][name] > 0.0
            if used.all():
                parts[name] = part
            elif used.any():
                parts[name] = Linearised(part.values[used], part.by[used])
        arrays = [part.by for part in parts.values()]
        size = sum(array.nbytes for array in arrays)
        if number not in self._kept and size <= self._left:
            self._kept[number] = arrays
            self._left -= size
        return parts

    def __iter__(self) -> Iterator[Array]:
        for number in range(len(self.problem.experiments)):
            if number in self._kept:
                yield from self._kept[number]
            else:
                yield from (part.by for part in self.linearised(number).values())


def linearised_fit(problem: Problem, vector: Array, loss: Loss = "linear") -> LinearisedFit:
    """Residuals and derivatives of every run at a point, ignored samples left out.

    Parameters
    ----------
    problem : Problem
        The runs and their unknowns.
    vector : (K,) array
        The point, as of `Solution.vector`.
    loss : Loss
        The loss on each residual whose sum the fit minimised.

    Returns
    -------
    LinearisedFit
        For `uncertainty`.

    Raises
    ------
    InputError
        If so many residuals lie in the tails of the loss that it has no optimum there.

    Notes
    -----
    With a robust loss each residual stands as ψ over the mean of ψ', by channel: the covariance of
    these is that of the estimates (Huber 1981, equation 6.5), whatever their spectrum.
    """
    derivatives, runs = _Derivatives(problem, vector), list[LinearisedRun]()

    def marched() -> Iterator[tuple[LinearisedRun, Array]]:
        for number, experiment in enumerate(problem.experiments):
            for name, part in derivatives.linearised(number).items():
                time, weight = experiment[name].time, problem.weights[number][name]
                if part.values.size < weight.size:
                    used = weight > 0.0
                    time, weight = time[used], weight[used]
                runs.append(LinearisedRun(experiment.name, name, time, part.values, weight))
                yield runs[-1], part.by

    unknowns = problem.unknowns
    factor = factor_of(marched(), unknowns, prior_blocks(unknowns, vector))
    for name in problem.channels if loss != "linear" else ():
        mine = [k for k, run in enumerate(runs) if run.channel == name]
        parts = [influence(runs[k].residual, loss) for k in mine]
        slope = float(np.mean(np.concatenate([slopes for _, slopes in parts] or [np.ones(1)])))
        if not slope > 0.0:
            raise InputError(
                f"Most residuals of {name} lie in the tails of the loss '{loss}', which gives them "
                "almost no weight: state a larger noise for it, or use the loss 'linear'."
            )
        for k, (bounded, _) in zip(mine, parts, strict=True):
            runs[k] = runs[k]._replace(residual=bounded / slope)
    worths = np.array([unknown.worth for unknown in unknowns if unknown.prior is not None])
    tolerance = TOLERANCE if hasattr(problem.model, "linearise") else BY_DIFFERENCES
    return LinearisedFit(
        tuple(runs),
        derivatives,
        unknowns.at(vector),
        factor,
        unknowns.prior_rows(vector)[1],
        tolerance,
        worths,
    )
