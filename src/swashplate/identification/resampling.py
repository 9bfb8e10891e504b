"""Resampling: cross-validation over the runs, and the bootstrap of the noise."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from swashplate.campaign.experiment import Experiment
from swashplate.errors import DomainError, InputError
from swashplate.executors import Executor, Serial
from swashplate.identification import tables
from swashplate.identification.drive_model import (
    DriveModel,
    Parameters,
    Starts,
    simulated_current,
    start_currents_of,
)
from swashplate.identification.fitting import Search, StageFit, fit
from swashplate.identification.noise import grid_of, noise_colours, without_lines
from swashplate.identification.problem import LinearisedFit, Loss, Problem
from swashplate.identification.setup import Setup
from swashplate.identification.solving import NO_EFFECT, solve
from swashplate.identification.unknowns import Unknowns
from swashplate.identification.validation import Measures, measures, predict, with_speeds
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.progress import counted
from swashplate.results import Result
from swashplate.tables import Table

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Fold(Result):
    """One part of the runs, and the fit to the others."""

    number: int
    """From 0."""
    held: tuple[str, ...]
    """Names of the runs that were held out."""
    lost: tuple[str, ...] = ()
    """Unknowns on which no run left in the fold depends: where its fit leaves them is chance."""
    measures: Mapping[str, Measures] = field(default_factory=dict)
    """Measures of each channel over the runs that were held out."""
    converged: bool = False
    failure: str = ""
    """Why there is no fit, or empty."""


@dataclass(frozen=True)
class CrossValidation(Result):
    """The folds of a campaign."""

    seed: int
    planned: int
    """How many folds there were to be."""
    folds: tuple[Fold, ...]
    measures: Mapping[str, Measures]
    """Measures of each channel over all runs, each predicted by a fit that did not see it."""
    units: Mapping[str, str]
    """SI unit of each channel."""

    def tables(self) -> list[Table]:
        """Errors held out, by channel, and the folds."""
        return tables.folds_tables(self)

    def sentences(self) -> tuple[str, ...]:
        """What must be known besides the numbers."""
        said = []
        if len(self.folds) < self.planned:
            said.append(f"Interrupted: {len(self.folds)} of {self.planned} folds were fitted.")
        for fold in self.folds:
            name = f"Fold {fold.number + 1} (without {', '.join(fold.held)})"
            if fold.failure:
                said.append(f"{name} could not be fitted: {fold.failure}")
            elif not fold.converged:
                said.append(f"{name} did not converge.")
            if fold.lost:
                said.append(
                    f"{name} loses {', '.join(fold.lost)}, on which no other run depends: its "
                    "prediction is not reliable."
                )
        return tuple(said)


ONE_WAY = 0.25
"""A command whose smaller extreme is below this part of the larger one goes one way."""


def cross_validate(
    experiments: Sequence[Experiment],
    nominal: Parameters,
    setup: Setup,
    *,
    folds: int = 5,
    seed: int = 0,
    executor: Executor | None = None,
    loss: Loss = "linear",
    watch: Callable[[Fold, int], None] | None = None,
) -> CrossValidation:
    """Fit to all runs but some, predict those from the command alone, and so on for each part.

    Parameters
    ----------
    experiments, nominal, setup, loss :
        As of `fitting.fit`: each fit begins at nominal values, not at the fit to all runs, which
        has seen those that are held out.
    folds : int
        Parts, at least 2 and at most as many as there are runs: then each run is one.
    seed : int
        Of the dealing; the same seed, the same folds.
    executor : Executor, optional
        Where the fits run; here by default. The results do not depend on it.
    watch : callable, optional
        Told of each fold and how many there are by now. Ctrl-C ends it; folds that are done are
        returned.

    Raises
    ------
    InputError
        If there are fewer runs than folds, or fewer than 2 folds.
    """
    parts = deal(experiments, folds, seed)
    here = executor or Serial()
    # fits run side by side elsewhere, so each of them runs on one thread
    shared = tuple(experiments), nominal, setup, loss, None if isinstance(here, Serial) else 1
    done: dict[int, tuple[Fold, list[_Held]]] = {}
    try:
        folds_done = here.run(_fold, shared, list(enumerate(parts)))
        for place, found in counted(folds_done, folds, "folds", "Cross-validating"):
            done[place] = found
            if watch is not None:
                watch(found[0], len(done))
    except KeyboardInterrupt:
        if not done:
            raise
    made, of_folds = zip(*(done[place] for place in sorted(done)), strict=True)
    held = list(chain.from_iterable(of_folds))
    units = {name: unit for name, unit, *_ in held}
    return CrossValidation(seed, len(parts), made, _measured(held), units)


_Held = tuple[str, str, Array, Array]
"""Channel, unit, and what was measured and predicted of the samples that count in one run."""


def _measured(held: Sequence[_Held]) -> dict[str, Measures]:
    """Measures of each channel over some runs."""
    names = dict.fromkeys(name for name, *_ in held)
    return {n: measures(*((a, b, None) for name, _, a, b in held if name == n)) for n in names}


def deal(experiments: Sequence[Experiment], folds: int, seed: int) -> tuple[tuple[int, ...], ...]:
    """Deal runs into folds, those of a kind and direction apart as far as there are folds.

    Places of each fold's runs, increasing; folds differ by at most one run. The seed is that of the
    order within each kind.
    """
    if folds < 2:
        raise InputError(f"Cross-validation needs at least 2 folds, not {folds}.")
    if folds > len(experiments):
        raise InputError(
            f"{folds} folds need at least as many runs; there are {len(experiments)} to fit."
        )
    strata: dict[tuple[str, str], list[int]] = {}
    for place, each in enumerate(experiments):
        high, low = max(each.input.values.max(), 0.0), max(-each.input.values.min(), 0.0)
        way = "plus" if high >= low else "minus"
        way = "both" if min(high, low) > ONE_WAY * max(high, low) else way
        strata.setdefault((each.maneuver.split(" ")[0], way), []).append(place)
    random = np.random.default_rng(seed)
    order = random.permutation(folds)
    dealt = [int(p) for _, places in sorted(strata.items()) for p in random.permutation(places)]
    parts: list[list[int]] = [[] for _ in range(folds)]
    for number, place in enumerate(dealt):
        parts[order[number % folds]].append(place)
    return tuple(tuple(sorted(part)) for part in parts)


def _fold(
    shared: tuple[tuple[Experiment, ...], Parameters, Setup, Loss, int | None],
    item: tuple[int, tuple[int, ...]],
) -> tuple[Fold, list[_Held]]:
    (experiments, nominal, setup, loss, threads), (number, part) = shared, item
    left_out = [experiments[place] for place in part]
    others = [each for place, each in enumerate(experiments) if place not in part]
    names = tuple(each.name for each in left_out)
    try:
        result = fit(nominal, others, setup, loss=loss, threads=threads, search=Search(0))
        if result.stages[-1].solution.interrupted:
            raise KeyboardInterrupt
        predicted = with_speeds(predict(result.parameters, left_out))
    except (InputError, DomainError) as error:
        return Fold(number, names, failure=str(error)), []
    held = []
    for each in predicted:
        channel = each.experiment[each.channel]
        samples = channel.values[channel.used], each.simulated[channel.used]
        held.append((each.channel, channel.unit, *samples))
    lost = list[str]()
    for stage in result.stages:
        effects = np.linalg.norm(stage.problem.evaluate(stage.solution.vector).jacobian, axis=0)
        least = NO_EFFECT * effects.max()
        each_one = zip(stage.problem.unknowns, effects, strict=True)
        lost += [each.name for each, effect in each_one if each.run is None and effect <= least]
    converged = all(each.solution.converged for each in result.stages)
    return Fold(number, names, tuple(lost), _measured(held), converged), held


# --- bootstrap ------------------------------------------------------------------------------------


class NoiseDraws:
    """Noise like a fit's, run by run; draw k of a seed is the same on any cores and in any order.

    An `InputError` says that there are no more samples than unknowns.

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
                variance = spare * np.mean(fit.runs[m].unweighted ** 2)
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


FEWEST_DRAWS = 40
"""Draws that reach the ends of a 95 % interval."""


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

    def intervals(self) -> tuple[tuple[float, float] | None, ...]:
        """Percentile intervals of 95 % in own units; None for what is fixed or undetermined."""
        draws = self.vectors.shape[0]
        if draws < FEWEST_DRAWS:
            raise InputError(
                f"{draws} draws do not reach the ends of a 95 % interval; take {FEWEST_DRAWS} or "
                "more."
            )
        ends = np.quantile(self.values, [0.025, 0.975], axis=0)
        return tuple(
            (float(low), float(high)) if known else None
            for low, high, known in zip(*ends, self.determined, strict=True)
        )

    def table(self) -> Table:
        """Median and spread of the draws of each unknown of the machine, and its interval."""
        return tables.bootstrap_table(self)

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


def bootstraps_of(
    stages: Sequence[StageFit],
    draws: int = 1000,
    *,
    seed: int = 0,
    executor: Executor | None = None,
    watch: Callable[[int], None] | None = None,
) -> dict[str, Bootstrap]:
    """Fit all stages again and again to what they simulate with other noise of the same colour.

    Results by stage. In each draw a pump is driven by the current of the card of that draw; draw k
    of a seed is the same on any executor. `watch` is told how many are done.

    Raises
    ------
    InputError
        If there are fewer than two draws, or fewer than two of the fits ended.
    """
    if draws < 2:
        raise InputError(f"{draws} draws do not make a distribution; take 1000.")
    fits = [without_lines(each.linearised)[0] for each in stages]
    shared = tuple(
        (
            replace(each, problem=replace(each.problem, threads=1), earlier=()),
            NoiseDraws(fit, seed=seed),
        )
        for each, fit in zip(stages, fits, strict=True)
    )
    found: dict[int, tuple[Array, ...] | None] = {}
    refits = (executor or Serial()).run(_refitted, shared, range(draws))
    for number, vectors in counted(refits, draws, "fits to new noise", "Bootstrapping"):
        found[number] = vectors
        if watch is not None:
            watch(len(found))
    ended = [each for _, each in sorted(found.items()) if each is not None]
    if len(ended) < 2:
        raise InputError(f"{len(ended)} of {draws} refits ended; there is nothing to compare.")
    vectors, failed = map(np.array, zip(*ended, strict=True)), draws - len(ended)
    return {
        stage.stage.name: Bootstrap(fit.variables, of_stage, fit.determined, failed, seed)
        for stage, fit, of_stage in zip(stages, fits, vectors, strict=True)
    }


def _refitted(
    shared: Sequence[tuple[StageFit, NoiseDraws]], number: int
) -> tuple[Array, ...] | None:
    """The vectors of all stages fitted to one draw; None if a fit did not end."""
    vectors: list[Array] = []
    card: tuple[ParameterSet, Starts] | None = None
    for stage, noise in shared:
        problem = _redrawn(stage, noise, number)
        model = problem.model
        if card is not None and isinstance(model, DriveModel):
            # another card, whose current drives the pump where it did before
            currents = dict(model.currents)
            for each in problem.experiments if stage.stage.current == "simulated" else ():
                if each.name in currents and each.input.kind == "voltage":
                    start = card[1].get(each.name, {})
                    currents[each.name] = simulated_current(each, card[0], start)
            model = DriveModel(card[0], model.part, currents, model.forces, card[1])
            problem = replace(problem, model=model)
        try:
            solution = solve(problem, stage.solution.vector, tolerance=1e-7, max_evaluations=100)
        except DomainError:
            return None
        if not solution.converged:
            return None
        vectors.append(solution.vector)
        if isinstance(model, DriveModel) and model.part == "card":
            found = model.parameters_at(problem.unknowns.targets(solution.vector, ""))
            card = found, start_currents_of(problem, solution.vector)
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
