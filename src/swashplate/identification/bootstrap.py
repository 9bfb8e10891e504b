"""Bootstrap: estimates from other noise of the same kind, by fitting again."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from swashplate.errors import DomainError, InputError
from swashplate.executors import Executor, Serial
from swashplate.identification.assessment import Assessment
from swashplate.identification.drive_model import DriveModel, simulated_current
from swashplate.identification.fitting import StageFit
from swashplate.identification.linearised import LinearisedFit
from swashplate.identification.noise import (
    Grid,
    NoiseColour,
    colour_of,
    grid_of,
    noise_colours,
    pair_sums,
    unweighted,
)
from swashplate.identification.problem import Problem
from swashplate.identification.profile import Profile, Threshold, minimiser, profile, threshold
from swashplate.identification.solving import solve
from swashplate.identification.spectral_lines import without_lines
from swashplate.identification.unknowns import Unknowns
from swashplate.parameters.parameter_set import ParameterSet

Array = NDArray[np.float64]


SETTLED = 4.0
"""Correlation lengths that are marched before the first sample that counts."""


class Autoregression(NamedTuple):
    """e_t = Σ a_k e_{t-k} + s u_t with u of variance 1, and e of variance 1 too."""

    coefficients: Array
    """(p,) a_1 to a_p; none for white noise."""
    deviation: float
    """s."""
    settling: int
    """Samples after which the start is forgotten."""

    def innovations(self, noise: Array, grid: Grid) -> Array:
        """Standardised u of a run's noise (n,), where p samples without a gap go before.

        Returns
        -------
        (m,) array
            In order; gaps leave no trace, m may be 0.
        """
        from scipy.signal import lfilter

        order = self.coefficients.size
        taps = np.concatenate([[1.0], -self.coefficients])
        present = np.convolve(grid.spread(np.ones(noise.size)), np.ones(order + 1))[: grid.size]
        whole = present > order + 0.5
        found: Array = lfilter(taps, [1.0], grid.spread(noise))[whole]
        if found.size < 2:
            return np.zeros(0)
        found = found - found.mean()
        size = float(np.sqrt(np.mean(found**2)))
        return found / size if size > 0.0 else found

    def coloured(self, innovations: Array) -> Array:
        """(m - settling,) noise of variance 1 from m innovations."""
        from scipy.signal import lfilter

        taps = np.concatenate([[1.0], -self.coefficients])
        noise: Array = lfilter([self.deviation], taps, innovations)
        return noise[self.settling :]


def autoregression(colour: NoiseColour, samples: int) -> Autoregression:
    """Fit to an autocorrelation, its order by Akaike's criterion.

    Parameters
    ----------
    colour : NoiseColour
        Of the noise.
    samples : int
        From which it was estimated; the order is at most 10 log₁₀ of it.

    Notes
    -----
    Yule and Walker's equations by Levinson's recursion, on the autocorrelation with the negative
    parts of its spectrum cut off: it is then that of a process, and the model stable.
    """
    correlation = colour.correlation
    if not colour.length:
        return Autoregression(np.zeros(0), 1.0, 0)
    size = next_fast_len(4 * correlation.size, real=True)
    mirrored = np.zeros(size)
    mirrored[: correlation.size] = correlation
    mirrored[size - correlation.size + 1 :] = correlation[:0:-1]
    power = np.maximum(rfft(mirrored).real, 0.0)
    proper = irfft(power, size)[: correlation.size]
    proper = proper / proper[0]
    most = int(min(10.0 * np.log10(max(samples, 10)), correlation.size - 1, samples // 4))
    best, best_score = Autoregression(np.zeros(0), 1.0, 0), 0.0
    taps, variance = np.zeros(0), 1.0
    for order in range(1, most + 1):
        reflection = (proper[order] - taps @ proper[order - 1 : 0 : -1]) / variance
        if abs(reflection) >= 1.0:
            break  # only rounding is left to predict
        taps = np.append(taps - reflection * taps[::-1], reflection)
        variance *= 1.0 - reflection**2
        score = samples * float(np.log(variance)) + 2.0 * order
        if score < best_score:
            settling = int(SETTLED * colour.length) + order
            best, best_score = Autoregression(taps, float(np.sqrt(variance)), settling), score
    return best


LONGEST_BLOCK = 0.25
"""Of a run's innovations: with longer blocks draws would hardly differ."""


FEWEST = 100
"""Innovations from which a run draws on its own alone."""


class Resampling:
    """Draws noise like a fit's, run by run.

    Parameters
    ----------
    fit : LinearisedFit
        The fit.
    seed : int
        Of the draws. Draw k is the same on any number of cores and in any order.
    block : float, optional
        Length of the blocks. [s] By default Politis and White's for each channel's innovations.

    Raises
    ------
    InputError
        If the block length is not positive, or there are no more samples than unknowns.

    Notes
    -----
    Residuals are whitened with an autoregression, moving blocks of these innovations are drawn
    within the run, and coloured again (post-blackened blocks, Davison and Hinkley 1997, section
    8.2). Blocks of the residuals themselves cut every slow swing in two: with residuals that are
    correlated over a fiftieth of a run their 95 % intervals covered 88 %. Residuals are enlarged
    by the root of the samples over those that the fit leaves. Gaps are marched over and then left
    out, and weights are put back where noise lands.
    """

    def __init__(self, fit: LinearisedFit, *, seed: int = 0, block: float | None = None) -> None:
        if block is not None and not block > 0.0:
            raise InputError(f"A block of {block:g} s is none; give a positive length.")
        colours = noise_colours(fit)
        spare = fit.samples / fit.spare_samples
        self.fit, self.seed = fit, seed
        self._runs: dict[int, _Run] = {}
        for colour in colours:
            samples = sum(fit.runs[m].time.size for m in colour.members)
            process = autoregression(colour, samples)
            innovations = {
                m: process.innovations(unweighted(fit.runs[m]), grid_of(fit.runs[m].time))
                for m in colour.members
            }
            common = np.concatenate(list(innovations.values()))
            length = _block_length(common, colour) if block is None else block / colour.step
            for m in colour.members:
                # a run too short for innovations of its own borrows the others'
                enough = innovations[m].size >= max(FEWEST, 4.0 * length)
                own = innovations[m] if enough else common
                size = float(np.sqrt(spare * np.mean(unweighted(fit.runs[m]) ** 2)))
                self._runs[m] = _Run(fit.runs[m].time, process, own, length, size)

    @property
    def blocks(self) -> tuple[float, ...]:
        """Length of the blocks of each run. [s]"""
        return tuple(
            self._runs[m].length * grid_of(run.time).step for m, run in enumerate(self.fit.runs)
        )

    def differences(self, draw: int) -> tuple[Array, ...]:
        """For each run (n,) differences simulated less measured that might have been as well.

        To refit, take as measured what the optimum simulates less these.
        """
        return tuple(
            self._runs[m].noise(
                np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(draw, m)))
            )
            for m in range(len(self.fit.runs))
        )

    def residuals(self, draw: int) -> tuple[Array, ...]:
        """The same, weighted."""
        return tuple(
            difference if run.weight is None else run.weight * difference
            for run, difference in zip(self.fit.runs, self.differences(draw), strict=True)
        )


class _Run:
    """One run: where its innovations come from and where its noise goes."""

    def __init__(
        self,
        time: Array,
        process: Autoregression,
        innovations: Array,
        length: float,
        size: float,
    ) -> None:
        self.process, self.size = process, size
        # one sample has no innovations to draw from: its sign alone can differ
        self.innovations = innovations if innovations.size else np.array([-1.0, 1.0])
        most = max(int(LONGEST_BLOCK * self.innovations.size), 1)
        self.length = int(np.clip(round(length), 1, most))
        grid = grid_of(time)
        self.places = grid.places
        self.count = grid.size + process.settling

    def noise(self, generator: np.random.Generator) -> Array:
        """(n,) one draw."""
        blocks = -(-self.count // self.length)
        starts = generator.integers(self.innovations.size - self.length + 1, size=blocks)
        picked = (starts[:, None] + np.arange(self.length)).ravel()[: self.count]
        return self.size * self.process.coloured(self.innovations[picked])[self.places]


def _block_length(innovations: Array, colour: NoiseColour) -> float:
    """Politis and White's length for innovations. [steps]"""
    if innovations.size < 8:
        return 1.0
    grid = grid_of(np.arange(innovations.size, dtype=np.float64))
    lags = min(innovations.size // 4, max(colour.longest, 1))
    sums, counts = pair_sums(innovations, grid, lags)
    left = colour_of(colour.channel, (0,), 1.0, sums, counts)
    return politis_white_length(left, innovations.size)


def politis_white_length(colour: NoiseColour, samples: int) -> float:
    """Length of moving blocks that estimates a mean's variance with the least squared error.

    Parameters
    ----------
    colour : NoiseColour
        Of what is drawn from.
    samples : int
        Over which it is spread.

    Returns
    -------
    float
        At least 1. [steps]

    Notes
    -----
    (2 (Σ |k| γ_k)² N / (4/3 g²))^(1/3), g = Σ γ_k (Politis and White 2004, with the correction of
    Patton, Politis and White 2009).
    """
    lags = np.arange(colour.correlation.size)
    slope = 2.0 * float(np.sum(lags * colour.correlation))
    return max(1.0, float(np.cbrt(1.5 * (slope / colour.inflation) ** 2 * samples)))


@dataclass(frozen=True, eq=False)
class Bootstrap:
    """Estimates from resampled noise."""

    variables: Unknowns
    vectors: Array
    """(draws, K) solver's vectors; held ones stay."""
    determined: NDArray[np.bool_]
    """(K,)"""
    failed: int
    """Refits that did not end."""
    blocks: tuple[float, ...]
    """Length of each run's blocks. [s]"""
    seed: int

    @property
    def values(self) -> Array:
        """(draws, K) in their own units."""
        return self.variables.to_values(self.vectors)

    @property
    def covariance(self) -> Array:
        """(K, K) of the solver's vector."""
        return np.cov(self.vectors, rowvar=False).reshape(2 * (self.variables.count,))

    def intervals(self, level: float = 0.95) -> tuple[tuple[float, float] | None, ...]:
        """Percentile intervals in own units; None for what is held or undetermined.

        Raises
        ------
        InputError
            If the level is not between 0 and 1, or too few draws reach its ends.
        """
        if not 0.0 < level < 1.0:
            raise InputError(f"The level {level:g} of an interval must lie between 0 and 1.")
        outside = 0.5 * (1.0 - level) * self.vectors.shape[0]
        if outside < 1.0:
            raise InputError(
                f"{self.vectors.shape[0]} draws do not reach the ends of a {100.0 * level:g} % "
                f"interval; take {int(np.ceil(2.0 / (1.0 - level)))} or more."
            )
        ends = np.quantile(self.values, [0.5 - 0.5 * level, 0.5 + 0.5 * level], axis=0)
        return tuple(
            (float(low), float(high)) if known else None
            for low, high, known in zip(*ends, self.determined, strict=True)
        )

    def sentences(self) -> tuple[str, ...]:
        """How it was done, and what failed."""
        draws = self.vectors.shape[0]
        shortest, longest = min(self.blocks), max(self.blocks)
        length = f"{longest:.2g} s" if shortest == longest else f"{shortest:.2g} to {longest:.2g} s"
        said = [f"{draws} draws of blocks of {length} of the innovations, seed {self.seed}."]
        if self.failed:
            said.append(
                f"{self.failed} of {draws + self.failed} refits did not end and are left out: the "
                "intervals are too narrow if those would have gone far."
            )
        return tuple(said)


def refit_bootstrap(
    resampling: Resampling,
    refit: Callable[[int], Array | None],
    draws: int = 1000,
    *,
    mapped: Callable[[Callable[[int], Array | None], Sequence[int]], Iterable[Array | None]] = map,
) -> Bootstrap:
    """Bootstrap in which each draw is fitted anew.

    Parameters
    ----------
    resampling : Resampling
        Of the fit's residuals.
    refit : callable
        From a draw's number to the (K,) vector fitted to ``resampling.differences(number)``, None
        if it did not end.
    draws : int
        How many, at least 2.
    mapped : callable
        Applies `refit` to all numbers, in order: `map`, or that of a pool of processes.

    Raises
    ------
    InputError
        If there are fewer than two draws, or fewer than two refits ended.
    """
    if draws < 2:
        raise InputError(f"{draws} draws do not make a distribution; take 1000.")
    found = list(mapped(refit, range(draws)))
    ended = [vector for vector in found if vector is not None]
    if len(ended) < 2:
        raise InputError(f"{len(ended)} of {draws} refits ended; there is nothing to compare.")
    fit = resampling.fit
    return Bootstrap(
        fit.variables,
        np.array(ended),
        fit.determined,
        draws - len(ended),
        resampling.blocks,
        resampling.seed,
    )


class _Again(NamedTuple):
    """What a worker needs to fit a stage again to other noise."""

    stage: StageFit
    resampling: Resampling


def bootstraps_of(
    assessments: Sequence[Assessment],
    draws: int = 1000,
    *,
    seed: int = 0,
    executor: Executor | None = None,
    watch: Callable[[int], None] | None = None,
) -> dict[str, Bootstrap]:
    """Fit all stages again and again to what they simulate with other noise of the same colour.

    Parameters
    ----------
    assessments : sequence of Assessment
        Of the stages. In each draw a pump is driven by the current of the card of that draw.
    draws : int
        How many times.
    seed : int
        Of the noise; draw k is the same on any executor.
    executor : Executor, optional
        Where the fits run; here by default.
    watch : callable, optional
        Told how many are done.

    Returns
    -------
    dict of str to Bootstrap
        By stage.

    Raises
    ------
    InputError
        If there are fewer than two draws, or fewer than two of the fits ended.
    """
    shared = tuple(
        _Again(
            replace(each.stage, problem=replace(each.stage.problem, threads=1)),
            Resampling(without_lines(each.linearised)[0], seed=seed),
        )
        for each in assessments
    )
    found: dict[int, tuple[Array, ...] | None] = {}
    for number, vectors in (executor or Serial()).run(_refitted, shared, range(draws)):
        found[number] = vectors
        if watch is not None:
            watch(len(found))
    made = {}
    for place, again in enumerate(shared):
        vectors_of = {k: None if each is None else each[place] for k, each in found.items()}
        made[again.stage.stage.name] = refit_bootstrap(again.resampling, vectors_of.get, draws)
    return made


def _refitted(shared: tuple[_Again, ...], number: int) -> tuple[Array, ...] | None:
    """The vectors of all stages fitted to one draw; None if a fit did not end."""
    vectors: list[Array] = []
    parameters: ParameterSet | None = None
    for again in shared:
        stage = again.stage
        problem = _redrawn(again, number)
        if parameters is not None:
            problem = replace(problem, model=_driven(stage, parameters))
        try:
            solution = solve(problem, stage.solution.vector, tolerance=1e-7, max_evaluations=100)
        except DomainError:
            return None
        if not solution.converged:
            return None
        vectors.append(solution.vector)
        model = problem.model
        if isinstance(model, DriveModel) and model.part == "card":
            parameters = model.parameters_at(problem.unknowns.targets(solution.vector, ""))
    return tuple(vectors)


def _redrawn(again: _Again, number: int) -> Problem:
    """A stage's problem with other noise about what its optimum simulates."""
    problem, vector = again.stage.problem, again.stage.solution.vector
    drawn = again.resampling.differences(number)
    differences = {
        (run.name, run.channel): each
        for run, each in zip(again.resampling.fit.runs, drawn, strict=True)
    }
    experiments = []
    for place, experiment in enumerate(problem.experiments):
        channels = dict(experiment.channels)
        for name, simulated in problem.outputs(vector, place).items():
            used = problem.weights[place][name] > 0.0
            if not used.any():
                continue
            values = experiment[name].values.copy()
            values[used] = simulated[used] - differences[experiment.name, name]
            channels[name] = replace(experiment[name], values=values)
        experiments.append(replace(experiment, channels=channels))
    # a copy of the model, which would keep every draw's records otherwise
    return replace(problem, model=copy(problem.model), experiments=tuple(experiments))


def _driven(stage: StageFit, parameters: ParameterSet) -> DriveModel:
    """A stage's model with another card, whose current drives the pump where it did before."""
    model = stage.problem.model
    assert isinstance(model, DriveModel)
    currents = dict(model.currents)
    for each in stage.problem.experiments:
        if stage.stage.current == "simulated" and each.input.kind == "voltage" and currents:
            currents[each.name] = simulated_current(each, parameters)
    return DriveModel(parameters, model.part, currents, model.forces)


class _Sideways(NamedTuple):
    """What a worker needs to follow a profile."""

    problem: Problem
    vector: Array
    cost: float
    thresholds: dict[int, Threshold]
    steps: Array


def profiles_of(
    assessment: Assessment,
    names: Sequence[str] | None = None,
    *,
    executor: Executor | None = None,
    watch: Callable[[int], None] | None = None,
) -> dict[str, Profile]:
    """Profile likelihoods of a stage's unknowns.

    Parameters
    ----------
    assessment : Assessment
        Of the stage.
    names : sequence of str, optional
        Which unknowns; by default all of the machine that have an interval.
    executor, watch :
        As of `bootstraps_of`.

    Returns
    -------
    dict of str to Profile
        In the order of the unknowns. What earlier stages do not know is not in them.

    Raises
    ------
    InputError
        For a name that is none of the stage's unknowns.
    """
    problem, found = assessment.stage.problem, assessment.uncertainty
    variables = found.own.variables
    chosen = [
        k
        for k, unknown in enumerate(problem.unknowns)
        if (names is None and unknown.run is None and found.own.determined[k])
        or (names is not None and variables.names[k] in names)
    ]
    for name in names or ():
        variables.index(name)  # refuses what is none
    linearised = assessment.linearised
    cost = problem.cost(assessment.stage.solution.vector)
    errors = found.own.standard_errors
    thresholds = {
        k: threshold(
            cost,
            linearised.samples,
            linearised.rank,
            inflation=float(found.inflation[k]),
            freedom=float(found.own.degrees_of_freedom[k]),
            level=found.level,
        )
        for k in chosen
    }
    shared = _Sideways(
        replace(problem, threads=1), assessment.stage.solution.vector, cost, thresholds, errors
    )
    made: dict[str, Profile] = {}
    for position, each in (executor or Serial()).run(_profiled, shared, chosen):
        made[variables.names[chosen[position]]] = each
        if watch is not None:
            watch(len(made))
    return {variables.names[k]: made[variables.names[k]] for k in chosen}


def _profiled(shared: _Sideways, index: int) -> Profile:
    low, high = shared.problem.bounds
    step = shared.steps[index]
    if not (np.isfinite(step) and step > 0.0):
        step = 0.01 * (high[index] - low[index])
    return profile(
        minimiser(shared.problem),
        shared.vector,
        shared.cost,
        index,
        shared.thresholds[index],
        float(step),
        (float(low[index]), float(high[index])),
    )
