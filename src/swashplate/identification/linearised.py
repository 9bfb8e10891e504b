"""A fit near its optimum: residuals and derivatives of every run, and what the runs determine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError
from swashplate.identification.model import Differentiable
from swashplate.identification.problem import Problem
from swashplate.identification.solving import Loss, influence
from swashplate.identification.unknowns import Unknowns
from swashplate.results import Result, short

Array = NDArray[np.float64]

TOLERANCE = 1e-10
"""Singular values below this part of the largest count as zero.

With exact derivatives a gauge of the hoist set-up lies at 1e-15 and the faintest direction that the
tests do tell at 2e-5. Derivatives by central differences are good to about 1e-9: use 1e-6 there.
"""


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

    @property
    def label(self) -> str:
        """Experiment and channel, for people."""
        return f"{self.name}, {self.channel}"


@dataclass(frozen=True, eq=False)
class LinearisedFit(Result):
    """All runs of a fit at its optimum. Make it with `of`, which checks and cleans."""

    runs: tuple[LinearisedRun, ...]
    variables: Unknowns
    prior: Array
    """(p, K) rows of the Gaussian priors: derivatives of (number less mean)/deviation, times the
    root of `prior_noise`."""
    tolerance: float = TOLERANCE
    prior_noise: Array = field(default_factory=lambda: np.ones(0))
    """(p,) variance of each prior's residual, which counts as that many of the data's."""

    @classmethod
    def of(
        cls,
        runs: Sequence[LinearisedRun],
        variables: Unknowns,
        *,
        prior: Array | None = None,
        prior_noise: Array | None = None,
        tolerance: float = TOLERANCE,
    ) -> LinearisedFit:
        """Check the runs, drop samples of weight 0 and runs without samples.

        Raises
        ------
        InputError
            If shapes do not fit, stamps do not increase, a number is not finite, or no sample is
            left; the sentence names the run.
        """
        count = variables.count
        kept = [_checked(run, count) for run in runs]
        kept = [run for run in kept if run.time.size]
        if not kept:
            raise InputError(
                "No sample counts: every run is empty or has weight 0; give a window a weight."
            )
        rows = np.zeros((0, count)) if prior is None else np.asarray(prior, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != count or not np.isfinite(rows).all():
            raise InputError(f"The rows of the priors need {count} finite columns each.")
        noise = np.ones(len(rows)) if prior_noise is None else np.asarray(prior_noise)
        return cls(tuple(kept), variables, rows, tolerance, noise)

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
                f"unknown{'s' if self.rank > 1 else ''} leave nothing to tell the noise from; take "
                "more samples or fewer unknowns."
            )


def triangular_factor(matrix: Array) -> Array:
    """(min(m, K), K) factor R of a matrix (m, K), RᵀR = matrixᵀ matrix."""
    factor: Array = np.linalg.qr(matrix, mode="r")  # type: ignore[assignment]
    return factor


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


def _checked(run: LinearisedRun, count: int) -> LinearisedRun:
    samples = run.time.shape
    shapes = {"residual": (run.residual, samples), "jacobian": (run.jacobian, (*samples, count))}
    if run.weight is not None:
        shapes["weight"] = (run.weight, samples)
    for what, (array, wanted) in shapes.items():
        if array.shape != wanted:
            raise InputError(f"{run.label}: {what} has the shape {array.shape}, needs {wanted}.")
        if not np.isfinite(array).all():
            row = int(np.argwhere(~np.isfinite(array))[0][0])
            raise InputError(
                f"{run.label}: {what} is not finite at {run.time[row]:g} s; leave the sample out."
            )
    if not (np.diff(run.time) > 0.0).all() or not np.isfinite(run.time).all():
        raise InputError(f"{run.label}: the time stamps must be finite and increase.")
    if run.weight is None or (run.weight > 0.0).all():
        return run
    if (run.weight < 0.0).any():
        raise InputError(f"{run.label}: a weight is negative; a factor on a residual is not.")
    used = run.weight > 0.0
    return run._replace(
        time=run.time[used],
        residual=run.residual[used],
        jacobian=run.jacobian[used],
        weight=run.weight[used],
    )


BY_DIFFERENCES = 1e-6
"""Singular values of difference derivatives below this part of the largest count as zero."""


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
            runs.append(
                LinearisedRun(
                    experiment.name,
                    name,
                    experiment[name].time[used],
                    part.values[used],
                    part.by[used],
                    weights[name][used],
                )
            )
    if loss != "linear":
        for name in problem.channels:
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
    exact = isinstance(problem.model, Differentiable)
    return LinearisedFit.of(
        runs,
        problem.unknowns.at(vector),
        prior=prior,
        prior_noise=np.array(worths),
        tolerance=TOLERANCE if exact else BY_DIFFERENCES,
    )
