"""What a command does between its samples, as the runs themselves show it.

Held until the next sample, a command acts half a sample later than joined by straight lines. And a
straight line passes the dead zone at the beginning of a sudden change, half a sample too early. A
drive's lag makes up for the difference, so that the wrong way biases ω by several per cent.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from swashplate.campaign import Between, Experiment
from swashplate.errors import DomainError
from swashplate.identification.estimation.fit_problem import Parameters, problem_of
from swashplate.identification.estimation.model import EquationModel
from swashplate.identification.estimation.problem import Loss
from swashplate.identification.estimation.setup import FitSetup
from swashplate.identification.estimation.solving import Solution, approached, solve

WORDS: Mapping[Between, str] = {
    "linear": "a straight line between samples",
    "previous": "held until the next sample",
    "jumps": "a straight line between samples that jumps in the middle of two",
}
"""The ways, of which the first one is taken if none is better."""
ENOUGH = 30
"""Evaluations after which a search for the better of two is near enough to its end."""
NEAR = 1e-6
"""Relative change of the cost at which such a search ends."""
ALIKE = 1e-5
"""Relative difference of costs below which neither is better: no residual depends on the input."""
CLEARLY = 0.01
"""Part by which residuals must be smaller the other way before what was stated is doubted."""


def joined(runs: Sequence[Experiment], between: Between) -> tuple[Experiment, ...]:
    """Runs with their input joined in one way."""
    return tuple(replace(run, input=run.input.joined(between)) for run in runs)


class Settled(NamedTuple):
    """Runs of which it is known what their input is between samples."""

    runs: tuple[Experiment, ...]
    sentences: tuple[str, ...] = ()
    """On what was taken."""
    near: Mapping[str, float] = MappingProxyType({})
    """Values near the optimum, by the unknowns' labels; none if unknown."""
    solution: Solution | None = None
    """The optimum with these runs, if the search for the better way came to it."""


class _Way(NamedTuple):
    """The fit in one way."""

    solution: Solution
    near: Mapping[str, float]
    """See `Settled`."""

    @property
    def optimum(self) -> Solution | None:
        """See `Settled`."""
        return self.solution if self.solution.converged else None


def settle(
    runs: Sequence[Experiment],
    nominal: Parameters,
    setup: FitSetup,
    *,
    loss: Loss = "linear",
    threads: int | None = None,
) -> Settled:
    """Runs with what their input is between samples settled.

    The fit is made each way, and the one that leaves the smallest residuals is taken. A
    model that its own code simulates is not tried, as each evaluation may take minutes: its input
    is a straight line unless stated, and the sentence says so. What the campaign states is not
    tried either, see `doubt`.
    """
    if all(run.input.settled for run in runs):
        return Settled(tuple(runs))
    ways = _ways(runs, nominal, setup, loss, threads)
    if ways is None:
        return Settled(
            joined(runs, "linear"),
            (
                "The command is taken as a straight line between samples, without trying others: "
                f"state interpolation in [axes.{runs[0].axis}.input] if it is held.",
            ),
        )
    costs = {between: way.solution.cost for between, way in ways.items()}
    better = min(ways, key=costs.__getitem__)
    if _smaller(costs[better], max(costs.values())) < ALIKE:
        linear = ways["linear"]
        return Settled(joined(runs, "linear"), near=linear.near, solution=linear.optimum)
    step = float(np.median([np.median(np.diff(run.input.time)) for run in runs]))
    other: Between = "linear" if better == "previous" else "previous"
    later = "earlier" if better == "previous" else "later"
    taken = (
        f"The command is taken as {WORDS[better]}: as {WORDS[other]}, half a sample "
        f"({500.0 * step:.2g} ms) {later}, it fits worse."
    )
    return Settled(joined(runs, better), (taken,), ways[better].near, ways[better].optimum)


def doubt(
    runs: Sequence[Experiment],
    nominal: Parameters,
    setup: FitSetup,
    *,
    loss: Loss = "linear",
    threads: int | None = None,
) -> tuple[str, ...]:
    """A sentence if the input is stated in one way, but the other fits clearly better."""
    stated = runs[0].input.interpolation
    ways = _ways(runs, nominal, setup, loss, threads)
    if ways is None:
        return ()
    better = min(ways, key=lambda between: ways[between].solution.cost)
    smaller = _smaller(ways[better].solution.cost, ways[stated].solution.cost)
    if smaller < CLEARLY:
        return ()
    return (
        f'The campaign states interpolation = "{stated}" for the input of {runs[0].axis}, but '
        f'residuals are {100.0 * smaller:.2g} % smaller with "{better}": leave the entry out, or '
        "check how the log was written.",
    )


def _ways(
    runs: Sequence[Experiment],
    nominal: Parameters,
    setup: FitSetup,
    loss: Loss,
    threads: int | None,
) -> dict[Between, _Way] | None:
    """The fit each way, straight lines first; None if a model is not tried.

    Each way begins where the one before ended.
    """
    ways = dict[Between, _Way]()
    near = dict[str, float]()
    sudden = any(run.input.jumps.size for run in runs)
    for between in WORDS if sudden else ("linear", "previous"):
        problem = problem_of(setup, nominal, joined(runs, between), threads=threads)
        if not isinstance(problem.model, EquationModel):
            return None
        try:
            if setup.has_spreads and not near:
                near = problem.unknowns.values(approached(problem, loss=loss))
            # one way has instants of jumps among its unknowns, another has none
            start = problem.unknowns.vector_of(near)
            solution = solve(problem, start, loss=loss, tolerance=NEAR, max_evaluations=ENOUGH)
        except DomainError:
            return None  # the fit itself says where the model does not hold
        values = problem.unknowns.values(solution.vector)
        ways[between] = _Way(solution, values)
        if setup.has_spreads:
            near = values
    return ways


def _smaller(cost: float, other: float) -> float:
    """Part by which residuals of one cost are smaller than those of another."""
    return 1.0 - (cost / other) ** 0.5 if other > 0.0 else 0.0
