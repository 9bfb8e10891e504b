"""Bootstrap: estimates from other noise of the same kind, by fitting again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from swashplate.errors import DomainError, InputError
from swashplate.executors import Executor, Serial
from swashplate.identification.assessment import Assessment
from swashplate.identification.drive_model import DriveModel, simulated_current
from swashplate.identification.fitting import StageFit
from swashplate.identification.linearised import LinearisedFit
from swashplate.identification.noise import grid_of, noise_colours, unweighted
from swashplate.identification.problem import Problem
from swashplate.identification.solving import solve
from swashplate.identification.spectral_lines import without_lines
from swashplate.identification.unknowns import Unknowns
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.results import Result

Array = NDArray[np.float64]


class NoiseDraws:
    """Noise like a fit's, drawn run by run.

    Parameters
    ----------
    fit : LinearisedFit
        The fit.
    seed : int
        Of the draws. Draw k is the same on any number of cores and in any order.

    Raises
    ------
    InputError
        If there are no more samples than unknowns.

    Notes
    -----
    Gaussian noise with the autocorrelation of the channel's residuals (a parametric bootstrap,
    Efron and Tibshirani 1993, section 6.5), drawn by circulant embedding (Dietrich and Newsam
    1997), in each run of the size of its own residuals, enlarged by the root of the samples over
    those that the fit leaves.
    """

    def __init__(self, fit: LinearisedFit, *, seed: int = 0) -> None:
        spare = fit.samples / fit.spare_samples
        self.fit, self.seed = fit, seed
        self._amplitudes: dict[int, tuple[Array, int]] = {}
        for colour in noise_colours(fit):
            lags = colour.correlation.size
            for m in colour.members:
                size = next_fast_len(grid_of(fit.runs[m].time).size + lags, real=True)
                circle = np.zeros(size)
                circle[:lags] = colour.correlation
                circle[size - lags + 1 :] = colour.correlation[:0:-1]
                # negative parts of the spectrum are errors of the estimate
                power = np.maximum(rfft(circle).real, 0.0)
                variance = spare * np.mean(unweighted(fit.runs[m]) ** 2)
                amplitude = np.sqrt(variance * power / irfft(power, size)[0])
                self._amplitudes[m] = amplitude, size

    def differences(self, draw: int) -> tuple[Array, ...]:
        """For each run (n,) differences simulated less measured that might have been as well.

        To refit, take as measured what the optimum simulates less these.
        """
        made = []
        for m, run in enumerate(self.fit.runs):
            amplitude, size = self._amplitudes[m]
            random = np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(draw, m)))
            noise = irfft(amplitude * rfft(random.standard_normal(size)), size)
            made.append(noise[grid_of(run.time).places])
        return tuple(made)


@dataclass(frozen=True, eq=False)
class Bootstrap(Result):
    """Estimates from other noise."""

    variables: Unknowns
    vectors: Array
    """(draws, K) solver's vectors; those at a bound stay."""
    determined: NDArray[np.bool_]
    """(K,)"""
    failed: int
    """Refits that did not end."""
    seed: int

    @property
    def values(self) -> Array:
        """(draws, K) in their own units."""
        return self.variables.to_values(self.vectors)

    def intervals(self, level: float = 0.95) -> tuple[tuple[float, float] | None, ...]:
        """Percentile intervals in own units; None for what is fixed or undetermined.

        Raises
        ------
        InputError
            If the level is not between 0 and 1, or too few draws reach its ends.
        """
        if not 0.0 < level < 1.0:
            raise InputError(f"The level {level:g} of an interval must lie between 0 and 1.")
        draws = self.vectors.shape[0]
        if 0.5 * (1.0 - level) * draws < 1.0:
            raise InputError(
                f"{draws} draws do not reach the ends of a {100.0 * level:g} % interval; take "
                f"{int(np.ceil(2.0 / (1.0 - level)))} or more."
            )
        ends = np.quantile(self.values, [0.5 - 0.5 * level, 0.5 + 0.5 * level], axis=0)
        return tuple(
            (float(low), float(high)) if known else None
            for low, high, known in zip(*ends, self.determined, strict=True)
        )

    def sentences(self) -> tuple[str, ...]:
        """How it was done, and what failed."""
        draws = self.vectors.shape[0]
        said = [f"{draws} draws of noise of the residuals' autocorrelation, seed {self.seed}."]
        if self.failed:
            said.append(
                f"{self.failed} of {draws + self.failed} refits did not end and are left out: the "
                "intervals are too narrow if those would have gone far."
            )
        return tuple(said)


_Stages = Sequence[tuple[StageFit, NoiseDraws]]


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
        How many times, at least 2.
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
    if draws < 2:
        raise InputError(f"{draws} draws do not make a distribution; take 1000.")
    shared = tuple(
        (
            replace(each.stage, problem=replace(each.stage.problem, threads=1)),
            NoiseDraws(without_lines(each.linearised)[0], seed=seed),
        )
        for each in assessments
    )
    found: dict[int, tuple[Array, ...] | None] = {}
    for number, vectors in (executor or Serial()).run(_refitted, shared, range(draws)):
        found[number] = vectors
        if watch is not None:
            watch(len(found))
    ended = [each for _, each in sorted(found.items()) if each is not None]
    if len(ended) < 2:
        raise InputError(f"{len(ended)} of {draws} refits ended; there is nothing to compare.")
    made = {}
    for place, (stage, noise) in enumerate(shared):
        of_stage = np.array([each[place] for each in ended])
        fit, failed = noise.fit, draws - len(ended)
        made[stage.stage.name] = Bootstrap(fit.variables, of_stage, fit.determined, failed, seed)
    return made


def _refitted(shared: _Stages, number: int) -> tuple[Array, ...] | None:
    """The vectors of all stages fitted to one draw; None if a fit did not end."""
    vectors: list[Array] = []
    parameters: ParameterSet | None = None
    for stage, noise in shared:
        problem = _redrawn(stage, noise, number)
        model = problem.model
        if parameters is not None and isinstance(model, DriveModel):
            # another card, whose current drives the pump where it did before
            currents = {
                each.name: simulated_current(each, parameters)
                for each in problem.experiments
                if stage.stage.current == "simulated" and each.input.kind == "voltage"
            }
            currents = {**model.currents, **(currents if model.currents else {})}
            model = DriveModel(parameters, model.part, currents, model.forces)
            problem = replace(problem, model=model)
        try:
            solution = solve(problem, stage.solution.vector, tolerance=1e-7, max_evaluations=100)
        except DomainError:
            return None
        if not solution.converged:
            return None
        vectors.append(solution.vector)
        if isinstance(model, DriveModel) and model.part == "card":
            parameters = model.parameters_at(problem.unknowns.targets(solution.vector, ""))
    return tuple(vectors)


def _redrawn(stage: StageFit, noise: NoiseDraws, number: int) -> Problem:
    """A stage's problem with other noise about what its optimum simulates."""
    problem, vector = stage.problem, stage.solution.vector
    drawn = zip(noise.fit.runs, noise.differences(number), strict=True)
    differences = {(run.name, run.channel): each for run, each in drawn}
    experiments = []
    for place, experiment in enumerate(problem.experiments):
        channels = dict(experiment.channels)
        for name, simulated in problem.outputs(vector, place).items():
            used = problem.weights[place][name] > 0.0
            if used.any():
                values = experiment[name].values.copy()
                values[used] = simulated[used] - differences[experiment.name, name]
                channels[name] = replace(experiment[name], values=values)
        experiments.append(replace(experiment, channels=channels))
    # a copy of the model, which would keep every draw's records otherwise
    return replace(problem, model=copy(problem.model), experiments=tuple(experiments))
