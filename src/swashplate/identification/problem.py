"""Problem of a fit: residuals and derivatives, and what they are near the optimum."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.experiment import Channel, Experiment
from swashplate.equations import Model as OfEquations
from swashplate.equations.marching.jacobian import triangle
from swashplate.equations.marching.observation import ObservedRecord
from swashplate.errors import InputError
from swashplate.identification.model import (
    OFFSET,
    Differentiable,
    EquationModel,
    Linearised,
    Model,
    OwnModel,
    linearised,
    refused_channel,
    simulated,
)
from swashplate.identification.unknowns import Unknowns
from swashplate.results import Result, short

if TYPE_CHECKING:
    from concurrent.futures import ThreadPoolExecutor

Array = NDArray[np.float64]
Part = TypeVar("Part")
Loss = Literal["linear", "soft_l1", "cauchy"]


class Evaluation(NamedTuple):
    """Residuals and their derivatives by the solver's vector at one point."""

    def __repr__(self) -> str:
        return short(self)

    residuals: Array
    """(m,) residuals, or any vector of which sum of squares and gradient are the same."""
    jacobian: Array
    """(m, K)"""


@dataclass(frozen=True, eq=False)
class Problem(Result):
    """Half the weighted sum of squares of all experiments, as a function of the unknowns.

    The residual of a sample is sqrt(weight)/scale times (simulated less measured).
    """

    model: Model
    """One of equations stands for itself, or as an `OwnModel` with more said about it."""
    experiments: tuple[Experiment, ...]
    unknowns: Unknowns
    channels: tuple[str, ...]
    """Names of the channels that are fitted."""
    scales: Mapping[str, float]
    """What one unit of residual is, by channel: its noise, in its unit."""
    fixed: Mapping[str, float] = field(default_factory=dict)
    """Values of the model's names that are not unknown but differ from the model's own."""
    uncertain: tuple[Mapping[str, float], ...] = ()
    """Standard uncertainties of fixed numbers, by the model's names; those of one mapping are off
    together. [unit]"""
    threads: int = 1
    """Threads over experiments, for a model that releases the interpreter's lock."""
    compare: Callable[[Channel, Array], Array] | None = None
    """Linear map of a channel's samples, (m,) or (m, k), before they are compared: a position that
    drifts by its motion since the last anchor, for example."""
    _last: dict[tuple[bytes, bool], Evaluation] = field(
        default_factory=dict, repr=False, init=False
    )

    def __post_init__(self) -> None:
        if isinstance(self.model, OfEquations):
            object.__setattr__(self, "model", OwnModel(self.model))
        if not self.unknowns:
            raise InputError("A fit needs at least one parameter.")
        if not self.experiments:
            raise InputError("A fit needs at least one experiment.")
        if not any(weight.any() for run in self.weights for weight in run.values()):
            raise InputError(
                f"No sample of {', '.join(self.channels) or 'any channel'} counts: all are ignored "
                "or there are none."
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
        return tuple(
            {
                name: np.sqrt(each[name].weight) / self.scales[name]
                for name in self.channels
                if name in each.channels
            }
            for each in self.experiments
        )

    @property
    def samples(self) -> int:
        """Samples that count."""
        return sum(int(np.count_nonzero(w)) for run in self.weights for w in run.values())

    def evaluate(self, vector: Array, *, compressed: bool = True) -> Evaluation:
        """Residuals and Jacobian by the vector; compressed, as a triangular factor of a few rows.

        The last ones are kept.

        Raises
        ------
        DomainError
            If the model does not hold there.
        """
        key = vector.tobytes(), compressed
        if key not in self._last:
            small = compressed and self.compare is None and isinstance(self.model, EquationModel)
            parts = self._each(lambda k: (self._reduced if small else self._full)(vector, k))
            parts.append(Evaluation(*self.unknowns.prior_rows(vector)))
            residuals, jacobians = zip(*parts, strict=True)
            self._last.clear()
            self._last[key] = Evaluation(np.concatenate(residuals), np.vstack(jacobians))
        return self._last[key]

    def cost(self, vector: Array) -> float:
        """Half the sum of squares alone, which is quicker."""

        def squares(number: int) -> float:
            experiment, total = self.experiments[number], 0.0
            for name, output in self.outputs(vector, number).items():
                residual = self._compared(experiment[name], output - experiment[name].values)
                total += float(np.sum((self.weights[number][name] * residual) ** 2))
            return total

        priors, _ = self.unknowns.prior_rows(vector)
        return 0.5 * (sum(self._each(squares)) + float(priors @ priors))

    def outputs(self, vector: Array, number: int) -> Mapping[str, Array]:
        """Simulated samples of the fitted channels of one experiment, offsets included."""
        experiment, values = self.experiments[number], self._values(vector, number)
        outputs = simulated(self.model, self.model_values(vector, number), experiment)
        return {
            name: self._output(outputs, experiment, name) + values.get(f"{OFFSET}{name}", 0.0)
            for name in self.weights[number]
        }

    def linearised(self, vector: Array, number: int) -> Mapping[str, Linearised]:
        """Weighted residuals of each channel of one experiment and derivatives by the vector."""
        experiment, run = self.experiments[number], self.experiments[number].name
        values, own = self._values(vector, number), self.model_values(vector, number)
        names = [name for name in self.unknowns.targets(vector, run) if name in own]
        outputs = linearised(self.model, own, experiment, names)
        chain, made = self.unknowns.chain(vector, names, run), {}
        for name, weight in self.weights[number].items():
            channel, zero = experiment[name], f"{OFFSET}{name}"
            output = self._output(outputs, experiment, name)
            shifted = output.values + values.get(zero, 0.0) - channel.values
            by = output.by @ chain + self.unknowns.chain(vector, [zero], run)
            made[name] = Linearised(
                weight * self._compared(channel, shifted),
                weight[:, None] * self._compared(channel, by),
            )
        return made

    def model_values(self, vector: Array, number: int) -> dict[str, float]:
        """Values by the model's names for one experiment; a channel's zero is none of them."""
        zeros = {f"{OFFSET}{name}" for name in self.channels}
        values = self._values(vector, number)
        return {name: value for name, value in values.items() if name not in zeros}

    def _values(self, vector: Array, number: int) -> dict[str, float]:
        return {**self.fixed, **self.unknowns.targets(vector, self.experiments[number].name)}

    def _compared(self, channel: Channel, rows: Array) -> Array:
        return rows if self.compare is None else self.compare(channel, rows)

    @staticmethod
    def _output(outputs: Mapping[str, Part], experiment: Experiment, name: str) -> Part:
        if name not in outputs:
            raise refused_channel(experiment, name, outputs)
        return outputs[name]

    def _full(self, vector: Array, number: int) -> Evaluation:
        values, by = zip(*self.linearised(vector, number).values(), strict=True)
        return Evaluation(np.concatenate(values), np.vstack(by))

    def _reduced(self, vector: Array, number: int) -> Evaluation:
        """A triangular factor of [J r] of one experiment, without ever holding J."""
        assert isinstance(self.model, EquationModel)
        experiment, (observed, names, asked, moves) = self.experiments[number], self._own[number]
        values = self._values(vector, number)
        offsets = [values.get(f"{OFFSET}{name}", 0.0) for name in self.weights[number]]
        ready = self.model.ready(values, experiment, observed, asked, offsets)
        found = triangle(ready.instance, observed, ready.paths, ready.own, moved=ready.moved)
        chain = self.unknowns.chain(vector, names, experiment.name)
        return Evaluation(found.factor[:, -1], found.factor[:, :-1] @ moves @ chain)

    @cached_property
    def _own(self) -> list[tuple[ObservedRecord, list[str], list[str], Array]]:
        """Each experiment as the march of a model of equations sees it.

        With the names of its unknowns, free zeros last; the columns that they ask for; and the
        derivatives of those columns, and of one for each zero, by the names.
        """
        from scipy.linalg import block_diag

        assert isinstance(self.model, EquationModel)
        made = []
        for number, experiment in enumerate(self.experiments):
            names = list(self.unknowns.targets(self.start, experiment.name))
            zeros = [z for name in self.weights[number] if (z := f"{OFFSET}{name}") in names]
            others = [name for name in names if name not in zeros]
            observed = self.model.observed(experiment, self.weights[number], zeros)
            asked, by = self.model.columns(others)
            made.append((observed, [*others, *zeros], asked, block_diag(by, np.eye(len(zeros)))))
        return made

    def _each(self, work: Callable[[int], Part]) -> list[Part]:
        """What is found for each experiment, in their order."""
        numbers = range(len(self.experiments))
        if min(self.threads, len(numbers)) == 1:
            return [work(number) for number in numbers]
        return list(_pool(self.threads).map(work, numbers))


@lru_cache
def _pool(threads: int) -> ThreadPoolExecutor:
    """Threads that stay: a fit evaluates hundreds of times, and to start them takes as long."""
    from concurrent.futures import ThreadPoolExecutor

    return ThreadPoolExecutor(threads)


def noise_scales(experiments: Sequence[Experiment], channels: Sequence[str]) -> dict[str, float]:
    """What one unit of residual is, by channel.

    A noise that is stated; or the rounding of an encoder; or 1 % of the range in all runs.

    Raises
    ------
    InputError
        If a channel is in no experiment, or never changes.
    """
    scales = {}
    for name in channels:
        having: list[Channel] = [each[name] for each in experiments if name in each.channels]
        if not having:
            known = ", ".join(dict.fromkeys(c for each in experiments for c in each.channels))
            raise InputError(f"No experiment has a channel '{name}'; there are {known}.")
        stated = [each.noise for each in having if each.noise is not None]
        if stated:
            scales[name] = float(np.sqrt(np.mean(np.square(stated))))
        elif having[0].encoder is not None:
            # rounding to whole counts leaves an error between -1/2 and 1/2 of one
            scales[name] = abs(having[0].encoder.angle_per_count) / np.sqrt(12.0)
        else:
            # an ignored spike says nothing of the range
            used = [each.values[each.used] for each in having if each.used.any()]
            scales[name] = 0.01 * max((float(np.ptp(each)) for each in used), default=0.0)
        if scales[name] == 0.0:
            raise InputError(f"The channel '{name}' never changes: nothing can be fitted to it.")
    return scales


# --- at the optimum -------------------------------------------------------------------------------

TOLERANCE = 1e-10
"""Singular values below this part of the largest count as zero.

With exact derivatives a gauge of the hoist set-up lies at 1e-15 and the faintest direction that the
tests do tell at 2e-5. Derivatives by central differences are good to about 1e-9: those take
`BY_DIFFERENCES`.
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
    jacobian: Array
    """(n, K) derivatives of `residual` by the solver's vector."""
    weight: Array | None = None
    """(n,) the factors w; None where all are alike. Samples of factor 0 are dropped."""


@dataclass(frozen=True, eq=False)
class LinearisedFit(Result):
    """All runs of a fit at its optimum that have a sample which counts; see `linearised_fit`."""

    runs: tuple[LinearisedRun, ...]
    variables: Unknowns
    prior: Array
    """(p, K) rows of the Gaussian priors: derivatives of (number less mean)/deviation, times the
    root of `prior_noise`."""
    tolerance: float = TOLERANCE
    prior_noise: Array = field(default_factory=lambda: np.ones(0))
    """(p,) variance of each prior's residual, which counts as that many of the data's."""

    @property
    def prior_middle(self) -> Array:
        """(K, K) covariance of the scores of the priors."""
        middle: Array = (self.prior.T * self.prior_noise) @ self.prior
        return middle

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
        """(<= K, K) factor R of all derivatives and priors, RᵀR = JᵀJ, by blocks of runs.

        Never from the normal equations: a null direction of JᵀJ drowns in rounding at 1e-8.
        """
        triangle = self.prior
        for run in self.runs:
            triangle = triangular_factor(np.vstack([triangle, run.jacobian]))
        return triangle

    @cached_property
    def _decomposed(self) -> tuple[Array, NDArray[np.bool_]]:
        return whitening(self.triangle, self.variables.free, self.tolerance)

    @property
    def whitening(self) -> Array:
        """(K, rank) matrix W with W Wᵀ the inverse of JᵀJ on what the runs determine.

        The columns of J W are orthonormal. Rows of unknowns at a bound are 0: they are held there.
        """
        return self._decomposed[0]

    @property
    def determined(self) -> NDArray[np.bool_]:
        """(K,) unknowns that are free and have no part in any null direction."""
        return self._decomposed[1]

    @property
    def rank(self) -> int:
        """How many combinations of the unknowns the runs determine."""
        return int(self.whitening.shape[1])

    @property
    def spare_samples(self) -> int:
        """Samples more than combinations determined; refused as by `check_spare_samples`."""
        self.check_spare_samples()
        return self.samples - self.rank

    def check_spare_samples(self) -> None:
        """Refuse a fit whose residual tells nothing of the noise.

        Raises
        ------
        InputError
            If there are no more samples than combinations determined.
        """
        if self.samples - self.rank < 1:
            raise InputError(
                f"{self.samples} sample{'s' if self.samples > 1 else ''} for {self.rank} "
                f"parameter{'s' if self.rank > 1 else ''} leave nothing to estimate the noise "
                "from; take more samples or fewer parameters."
            )


def triangular_factor(matrix: Array) -> Array:
    """(min(m, K), K) factor R of a matrix (m, K), RᵀR = matrixᵀ matrix."""
    return np.asarray(np.linalg.qr(matrix, mode="r"))


def whitening(
    triangle: Array, free: NDArray[np.bool_], tolerance: float
) -> tuple[Array, NDArray[np.bool_]]:
    """Inverse of a triangular factor on what it determines.

    Parameters
    ----------
    triangle : (m, K) array
        Derivatives, or their triangular factor.
    free : (K,) array of bool
        Unknowns that may move; the others are held.
    tolerance : float
        Singular values of the column-scaled factor below this part of the largest count as zero.

    Returns
    -------
    (K, rank) array, (K,) array of bool
        W with W Wᵀ = (JᵀJ)⁻¹ on the free unknowns, and which unknowns are determined.
    """
    count = triangle.shape[1]
    if triangle.shape[0] > count:
        triangle = triangular_factor(triangle)
    length = np.linalg.norm(triangle, axis=0)
    moving = np.flatnonzero(free & (length > 0.0))
    determined = np.zeros(count, dtype=np.bool_)
    if not moving.size:
        return np.zeros((count, 0)), determined
    _, sizes, rows = np.linalg.svd(triangle[:, moving] / length[moving], full_matrices=True)
    rank = int(np.count_nonzero(sizes > tolerance * sizes[0]))
    inverse = np.zeros((count, rank))
    inverse[moving] = (rows[:rank].T / sizes[:rank]) / length[moving, None]
    # an unknown whose unit vector lies in the row space is determined in spite of null directions
    determined[moving] = np.sum(rows[rank:] ** 2, axis=0) < 1e-8
    return inverse, determined


def influence(residuals: Array, loss: Loss) -> tuple[Array, Array]:
    """ψ of each residual, half the derivative of its loss, and the derivative of that.

    The losses are SciPy's, of residuals in units of their noise (Huber 1981, chapter 4).
    """
    z = residuals**2
    if loss == "soft_l1":
        return residuals / np.sqrt(1.0 + z), (1.0 + z) ** -1.5
    if loss == "cauchy":
        return residuals / (1.0 + z), (1.0 - z) / (1.0 + z) ** 2
    return residuals, np.ones_like(residuals)


def linearised_fit(problem: Problem, vector: Array, loss: Loss = "linear") -> LinearisedFit:
    """Residuals and derivatives of every run at a point, ignored samples left out.

    Parameters
    ----------
    problem : Problem
        What was fitted.
    vector : (K,) array
        The solver's vector at the optimum.
    loss : Loss
        What of each residual the fit summed.

    Raises
    ------
    InputError
        If so many residuals lie in the tails of a robust loss that it has no optimum there.

    Notes
    -----
    With a robust loss each residual stands as ψ over the mean of ψ', by channel: the covariance of
    these is that of the estimates (Huber 1981, equation 6.5), whatever their spectrum.
    """
    runs = []
    for number, experiment in enumerate(problem.experiments):
        weights = problem.weights[number]
        for name, part in problem.linearised(vector, number).items():
            used = weights[name] > 0.0
            if used.any():
                columns = experiment[name].time, part.values, part.by, weights[name]
                runs.append(LinearisedRun(experiment.name, name, *(each[used] for each in columns)))
    for name in problem.channels if loss != "linear" else ():
        mine = [k for k, run in enumerate(runs) if run.channel == name]
        parts = [influence(runs[k].residual, loss) for k in mine]
        slope = float(np.mean(np.concatenate([slopes for _, slopes in parts] or [np.ones(1)])))
        if not slope > 0.0:
            raise InputError(
                f"Most residuals of {name} lie in the tails of the loss '{loss}', which says "
                "nothing of them: state a larger noise for it, or take the loss 'linear'."
            )
        for k, (bounded, _) in zip(mine, parts, strict=True):
            runs[k] = runs[k]._replace(residual=bounded / slope)
    _, prior = problem.unknowns.prior_rows(vector)
    worths = [each.prior.worth for each in problem.unknowns if each.prior is not None]
    tolerance = TOLERANCE if isinstance(problem.model, Differentiable) else BY_DIFFERENCES
    variables = problem.unknowns.at(vector)
    return LinearisedFit(tuple(runs), variables, prior, tolerance, np.array(worths))
