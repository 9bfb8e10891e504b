"""What a command does between its samples, as the runs themselves show it.

Held until the next sample, a command acts half a sample later than joined by straight lines. A
drive's lag makes up for the difference, so that the wrong one biases ω by several per cent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from swashplate.campaign.experiment import Experiment
from swashplate.equations.marching.record import Interpolation
from swashplate.errors import DomainError
from swashplate.identification.drive_model import Parameters, stage_problem
from swashplate.identification.model import EquationModel
from swashplate.identification.problem import Loss
from swashplate.identification.setup import Setup
from swashplate.identification.solving import solve

OTHER: dict[Interpolation, Interpolation] = {"linear": "previous", "previous": "linear"}
WORDS = {"linear": "a straight line between samples", "previous": "held until the next sample"}
LATER = {"linear": "later", "previous": "earlier"}
"""How the other way acts."""
ENOUGH = 30
"""Evaluations after which a search for the better of two is near enough to its end."""
ALIKE = 1e-6
"""Relative difference of costs below which neither is better: no residual depends on the input."""
CLEARLY = 0.01
"""Part by which residuals must be smaller the other way before what was stated is doubted."""


def joined(runs: Sequence[Experiment], between: Interpolation) -> tuple[Experiment, ...]:
    """Runs with their input joined in one way."""
    return tuple(replace(run, input=run.input.joined(between)) for run in runs)


def settle(
    runs: Sequence[Experiment],
    nominal: Parameters,
    setup: Setup,
    *,
    loss: Loss = "linear",
    threads: int | None = None,
) -> tuple[tuple[Experiment, ...], tuple[str, ...]]:
    """Runs with what their input is between samples settled, and a sentence on what was taken.

    The first stage is fitted both ways, and the one that leaves the smaller residuals is taken. A
    model that its own code simulates is not tried, as each evaluation may take minutes: its input
    is a straight line unless stated, and the sentence says so. What the campaign states is not
    tried either, see `doubt`.
    """
    if all(run.input.settled for run in runs):
        return tuple(runs), ()
    compared = _compared(runs, nominal, setup, loss, threads)
    if compared is None:
        return joined(runs, "linear"), (
            "The command is taken as a straight line between samples, which was not tried: state "
            f"interpolation in [axes.{runs[0].axis}.input] if it is held.",
        )
    better, smaller = compared
    if smaller < ALIKE:
        return joined(runs, "linear"), ()
    step = float(np.median([np.median(np.diff(run.input.time)) for run in runs]))
    return joined(runs, better), (
        f"The command is taken as {WORDS[better]}: as {WORDS[OTHER[better]]}, half a sample "
        f"({500.0 * step:.2g} ms) {LATER[better]}, it fits worse.",
    )


def doubt(
    runs: Sequence[Experiment],
    nominal: Parameters,
    setup: Setup,
    *,
    loss: Loss = "linear",
    threads: int | None = None,
) -> tuple[str, ...]:
    """A sentence if the input is stated in one way, but the other fits clearly better."""
    better, smaller = _compared(runs, nominal, setup, loss, threads) or ("linear", 0.0)
    stated = runs[0].input.interpolation
    if better == stated or smaller < CLEARLY:
        return ()
    return (
        f'The campaign states interpolation = "{stated}" for the input of {runs[0].axis}, but '
        f'residuals are {100.0 * smaller:.2g} % smaller with "{better}": leave the entry out, or '
        "check how the log was written.",
    )


def _compared(
    runs: Sequence[Experiment],
    nominal: Parameters,
    setup: Setup,
    loss: Loss,
    threads: int | None,
) -> tuple[Interpolation, float] | None:
    """The way that fits better, and by what part its residuals are smaller; None if not tried."""
    costs = dict[Interpolation, float]()
    for between in OTHER:
        problem = stage_problem(setup.stages[0], nominal, joined(runs, between), threads=threads)
        if not isinstance(problem.model, EquationModel):
            return None
        try:
            costs[between] = solve(problem, loss=loss, max_evaluations=ENOUGH).cost
        except DomainError:
            return None  # the fit itself says where the model does not hold
    better = min(costs, key=lambda between: costs[between])
    larger = costs[OTHER[better]]
    return better, 1.0 - (costs[better] / larger) ** 0.5 if larger > 0.0 else 0.0
