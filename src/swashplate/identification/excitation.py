"""Which run tells of which unknown: shares of the information, after a fit or before it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.experiment import Experiment
from swashplate.identification.activation import Activation, activation, simulated_run
from swashplate.identification.drive_model import DriveModel
from swashplate.identification.identifiability import Identifiability, identifiability
from swashplate.identification.linearised import LinearisedFit
from swashplate.identification.linearising import linearised_fit
from swashplate.identification.problem import Problem
from swashplate.identification.setup import Stage
from swashplate.identification.staging import stage_problem
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.simulation.result import Simulation

Array = NDArray[np.float64]

Mark = Literal["most", "some", "unseen", "none"]

ALONE = 0.9
"""Share of a single run from which an unknown is said to rest on it."""
MOST = 0.2
"""Share of a run's information from which it is one of those that tell most."""
NAMED = 8
"""Unknowns that a sentence names."""


@dataclass(frozen=True, eq=False)
class Excitation:
    """How much each run moves with each unknown."""

    runs: tuple[str, ...]
    """Experiment and channel of each row."""
    names: tuple[str, ...]
    """Unknown of each column."""
    sensitivity: Array
    """(runs, K) root mean square change of the weighted residual for 1 % of the unknown."""
    share: Array
    """(runs, K) part of an unknown's information (its squared derivatives) from each run; columns
    add up to 1, or are 0 where no run tells anything."""

    def sentences(self) -> tuple[str, ...]:
        """What rests on nothing, and what on one run alone."""
        said = []
        for column, name in enumerate(self.names):
            share = self.share[:, column]
            most = int(np.argmax(share))
            if not share.any():
                said.append(f"{name}: no run depends on it.")
            elif len(self.runs) > 1 and share[most] >= ALONE:
                said.append(
                    f"{name}: {100.0 * share[most]:.0f} % of what is known of it comes from "
                    f"{self.runs[most]} alone."
                )
        return tuple(said)


def excitation(fit: LinearisedFit) -> Excitation:
    """The table of a fit."""
    squares = np.array([np.sum(run.jacobian**2, axis=0) for run in fit.runs])
    samples = np.array([float(run.time.size) for run in fit.runs])
    total = squares.sum(axis=0)
    return Excitation(
        tuple(run.label for run in fit.runs),
        fit.variables.names,
        0.01 * np.sqrt(squares / samples[:, None]),
        np.divide(squares, total, out=np.zeros_like(squares), where=total > 0.0),
    )


@dataclass(frozen=True, eq=False)
class Outlook:
    """What the runs can tell of a stage's unknowns, at the nominal values: known before a fit."""

    stage: Stage
    problem: Problem
    simulations: Mapping[str, Simulation]
    """The nominal drive in each run that the stage fits, by the run's name."""
    activation: Activation
    linearised: LinearisedFit

    @cached_property
    def identifiability(self) -> Identifiability:
        """Singular values, and directions that change nothing."""
        model = self.problem.model
        assert isinstance(model, DriveModel)
        taken = {target for each in self.problem.unknowns for target in each.targets}
        return identifiability(
            self.linearised.triangle,
            self.linearised.variables,
            tolerance=self.linearised.tolerance,
            fixed={k: v for k, v in model.parameters.numbers.items() if k not in taken},
        )

    @cached_property
    def excitation(self) -> Excitation:
        """Shares of the runs and channels."""
        return excitation(self.linearised)

    @cached_property
    def shares(self) -> Array:
        """(runs, K) part of what is known of an unknown from each run, its channels together."""
        shares = np.zeros((len(self.activation.runs), len(self.linearised.variables.names)))
        for run, share in zip(self.linearised.runs, self.excitation.share, strict=True):
            shares[self.activation.runs.index(run.name)] += share
        return shares

    def effect(self, name: str) -> float:
        """Length of the change of all weighted residuals for 1 % of an unknown; 1 is one noise."""
        return float(self.identifiability.sensitivity[self.linearised.variables.index(name)])

    def marks(self, name: str) -> tuple[Mark, ...]:
        """What each run is worth for an unknown.

        "most" and "some" tell of it; in "unseen" what it needs happens, but no sample that counts
        shows it; in "none" it does not happen.
        """
        share = self.shares[:, self.linearised.variables.index(name)]
        return tuple(
            "most"
            if part >= MOST
            else "some"
            if part > 0.0
            else "unseen"
            if seconds > 0.0
            else "none"
            for part, seconds in zip(share, self.activation[name], strict=True)
        )

    def sentences(self) -> tuple[str, ...]:
        """What no run tells of, why, and what rests on one run alone."""
        groups: dict[str, list[str]] = {}
        for name in self.identifiability.unexcited:
            if name in self.activation.names:
                groups.setdefault(self._missing(name), []).append(name)
        said = [
            f"{_listed(names)} need{'s' if len(names) == 1 else ''} {why}."
            for why, names in groups.items()
        ]
        several = len(self.activation.runs) > 1
        for name in self.activation.names:
            share = self.shares[:, self.linearised.variables.index(name)]
            most = int(np.argmax(share))
            if several and share[most] >= ALONE:
                said.append(
                    f"{name}: {100.0 * share[most]:.0f} % of what the runs tell of it comes from "
                    f"{self.activation.runs[most]} alone."
                )
        return tuple(said)

    def _missing(self, name: str) -> str:
        """What an unknown that no sample depends on needs, and whether a run has it."""
        need = self.activation.needs[self.activation.names.index(name)]
        if name.startswith("force_"):
            need = "currents of their size beyond Z17"
        side = next((each for each in ("plus", "minus") if f"_{each}" in name), None)
        need = need if side is None else f"{need} ({side})"
        having = np.flatnonzero(self.activation[name] > 0.0)
        if not having.size:
            return f"{need}, which no run has"
        return (
            f"{need}: {self.activation.runs[having[0]]} has it, but no sample that counts shows it"
        )


def outlook(stage: Stage, parameters: ParameterSet, experiments: Sequence[Experiment]) -> Outlook:
    """What runs can tell of a stage's unknowns, before any fit.

    Parameters
    ----------
    stage : Stage
        What is free and what is fitted.
    parameters : ParameterSet
        Nominal values; best those that `fit.smooth` makes, as a fit takes them.
    experiments : sequence of Experiment
        The runs to fit.

    Raises
    ------
    InputError, ParameterError
        If runs and set-up do not fit each other, see `staging.stage_problem`.
    DomainError
        If the model does not hold at the nominal values.
    """
    problem = stage_problem(stage, parameters, experiments)
    model = problem.model
    assert isinstance(model, DriveModel)
    simulations = {each.name: simulated_run(each, parameters) for each in problem.experiments}
    return Outlook(
        stage,
        problem,
        simulations,
        activation(simulations, parameters, problem.unknowns.items, model.forces),
        linearised_fit(problem, problem.start),
    )


def _listed(names: Sequence[str]) -> str:
    named = list(names[:NAMED])
    more = len(names) - len(named)
    if more:
        return f"{', '.join(named)} and {more} more"
    return named[0] if len(named) == 1 else f"{', '.join(named[:-1])} and {named[-1]}"
