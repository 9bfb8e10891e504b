"""What the runs can tell, known before a fit: which run tells of which unknown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import exp, isfinite
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.experiment import Experiment
from swashplate.errors import InputError
from swashplate.identification.drive_model import DriveModel, Forces, current_record, voltage_record
from swashplate.identification.identifiability import Identifiability, identifiability
from swashplate.identification.problem import LinearisedFit, Problem, linearised_fit
from swashplate.identification.setup import Stage
from swashplate.identification.staging import stage_problem
from swashplate.identification.unknowns import Unknown
from swashplate.parameters.definitions import CATALOGUE, COLUMNS, OWN, REFINEMENTS
from swashplate.parameters.parameter_set import HasParameters, ParameterSet, set_of
from swashplate.results import Result
from swashplate.simulation.result import Limit, Simulation
from swashplate.simulation.run import simulate_drive, simulate_pump
from swashplate.tables import listed

Array = NDArray[np.float64]

Mask = NDArray[np.bool_]

SAME = 1e-9
"""Difference below which two currents are the same. [A]"""
LEAST_CURRENT = 1e-4
"""Current from which it is not merely fading. [A]"""
TILTED = 1e-4
"""Angle of the swash plate that counts as one. [rad]"""

OTHERS = "a tilted swash plate"
"""What parameters need that say nothing of it, and single runs' numbers."""


def simulated_run(experiment: Experiment, parameters: ParameterSet) -> Simulation:
    """An experiment as a parameter set has it, whatever was measured.

    Raises
    ------
    InputError
        If the input is neither a voltage nor a current, or cannot be marched.
    DomainError
        If the model does not hold under it.
    """
    begins = experiment.begins
    try:
        if experiment.input.kind == "current":
            return simulate_pump(
                parameters, current_record(experiment), begins, experiment.start_pressure
            )
        return simulate_drive(
            parameters, voltage_record(experiment), begins, experiment.start_pressure
        )
    except InputError as error:
        raise InputError(f"{experiment.input.source}: {error}") from None


def acting(simulation: Simulation, parameters: ParameterSet) -> dict[str, float]:
    """How long what a parameter needs happens in a run [s], for every column (``"Z16_plus"``).

    0 where it never happens; without a card its parameters have 0.
    """
    numbers, found = parameters.numbers, dict.fromkeys(COLUMNS, 0.0)
    for side, sign in (("plus", 1.0), ("minus", -1.0)):
        for symbol, mask in _of_pump(simulation, sign, numbers["Z17"]).items():
            found[f"{symbol}_{side}"] = float(np.count_nonzero(mask)) / simulation.record.rate
        for symbol, mask in _of_channel(simulation, side, numbers).items():
            found[f"{symbol}_{side}"] = float(np.count_nonzero(mask)) * simulation.record.step
    found["tau"] = found["V_dz_plus"] + found["V_dz_minus"]
    found["Z17"] = found["Z19_plus"] + found["Z19_minus"]
    rest = {"Z14": simulation.active(Limit.SPOOL), "Z15": simulation.active(Limit.RELIEF)}
    tilted = np.abs(simulation.swash_angle) > TILTED
    for symbol, definition in CATALOGUE.items():
        if definition.block == "pump_motor" and not definition.directional and symbol != "Z17":
            mask = rest.get(symbol, tilted)
            found[symbol] = float(np.count_nonzero(mask)) / simulation.record.rate
    return {**found, **dict.fromkeys((*REFINEMENTS, *OWN), found["Z1"])}


def _of_pump(simulation: Simulation, sign: float, Z17: float) -> dict[str, Mask]:
    """Samples at which the pump's parameters of one direction act, by symbol."""
    driven = sign * simulation.current > Z17
    return {
        "Z13": simulation.active(Limit.SWASH_STOP) & (sign * simulation.swash_angle > 0.0),
        "Z16": simulation.active(Limit.ORIFICE) & (sign * simulation.orifice_opening > 0.0),
        **dict.fromkeys(("Z19", "Z20", "Z21", "Z22"), driven),
    }


def _of_channel(simulation: Simulation, side: str, numbers: Mapping[str, float]) -> dict[str, Mask]:
    """Steps of the march at which the card's parameters of one channel act, by symbol."""
    if not simulation.driven_by_voltage:
        return {}
    sign = 1.0 if side == "plus" else -1.0
    lim1, lim2, I_t1, I_t2, a, V_dz = (
        numbers[f"{symbol}_{side}"] for symbol in ("lim1", "lim2", "I_t1", "I_t2", "a", "V_dz")
    )
    step = simulation.record.step
    current = simulation.fine("current_positive" if sign > 0.0 else "current_negative")
    before, after = current[:-1], current[1:]
    limited = simulation.rate_limited()[1:]
    # where the current moves as fast as a limit lets it, that limit has set it; in the step in
    # which it passes I_t1 it does so for a part of the step alone
    passing = limited & (before <= I_t1) & (after > I_t1)
    rising = passing | (limited & (before > I_t1) & (after - before >= lim1 * step - SAME))
    falling = limited & (after >= I_t2) & (before - after >= lim2 * step - SAME)
    decaying = np.zeros(before.shape, dtype=np.bool_)
    if isfinite(a) and a > 0.0:
        left = before * exp(-a * step)
        decaying = (before <= I_t2) & (before > LEAST_CURRENT) & (np.abs(after - left) <= SAME)
    beyond = sign * simulation.record.values[1:] > V_dz
    return {
        **dict.fromkeys(("V_dz", "J", "G1", "G2", "G3"), beyond),
        **dict.fromkeys(("zeta", "omega", "C"), np.abs(after - before) > SAME),
        "lim1": rising,
        "lim2": falling,
        "I_t1": passing,
        "I_t2": (before > I_t2) & (after < I_t2),
        "a": decaying,
    }


def activation(
    simulations: Mapping[str, Simulation],
    parameters: ParameterSet,
    unknowns: Sequence[Unknown],
    forces: Forces | None = None,
) -> Array:
    """How long each run makes happen what each unknown of the machine needs: (runs, K). [s]

    `parameters` are those that were simulated, `forces` stand for the solenoids' coefficients.
    """
    rows = []
    for simulation in simulations.values():
        found = acting(simulation, parameters)
        if forces is not None:
            for name in forces.names:
                # from half way to the force's effective current on
                signed = (1.0 if "_plus_" in name else -1.0) * simulation.current
                reached = signed - simulation.pump.Z17 >= _current_of(name, forces)[1]
                found[name] = float(np.count_nonzero(reached)) / simulation.record.rate
        rows.append([max(found[t] for t in each.targets) for each in unknowns if each.run is None])
    return np.array(rows)


def need_of(name: str, forces: Forces | None = None) -> str:
    """What an unknown needs, in words."""
    if forces is not None and name in forces.names:
        return f"{_current_of(name, forces)[0]:g} A beyond Z17"
    symbol = COLUMNS.get(name, name)
    return (CATALOGUE[symbol].needs if symbol in CATALOGUE else "") or OTHERS


def _current_of(name: str, forces: Forces) -> tuple[float, float]:
    """Effective current of a force, and where its neighbourhood begins. [A]"""
    _, side, number = name.split("_")
    currents = (0.0, *getattr(forces, side))
    k = int(number)
    return currents[k], 0.5 * (currents[k] + currents[k - 1])


Mark = Literal["most", "some", "unseen", "none"]

ALONE = 0.9
"""Share of a single run from which an unknown is said to rest on it."""
MOST = 0.2
"""Share of a run's information from which it is one of those that tell most."""


@dataclass(frozen=True, eq=False)
class Outlook(Result):
    """What the runs can tell of a stage's unknowns, at the nominal values: known before a fit."""

    stage: Stage
    problem: Problem
    simulations: Mapping[str, Simulation]
    """The nominal drive in each run that the stage fits, by the run's name."""
    linearised: LinearisedFit
    seconds: Array
    """(runs, K) how long what each unknown of `names` needs happens. [s]"""

    @property
    def names(self) -> tuple[str, ...]:
        """The unknowns, those of single runs left out."""
        return tuple(each.name for each in self.problem.unknowns if each.run is None)

    @property
    def _model(self) -> DriveModel:
        assert isinstance(self.problem.model, DriveModel)
        return self.problem.model

    def need(self, name: str) -> str:
        """What an unknown needs, in words."""
        return need_of(name, self._model.forces)

    @cached_property
    def identifiability(self) -> Identifiability:
        """Which unknowns the runs determine, and directions that change nothing."""
        taken = {target for each in self.problem.unknowns for target in each.targets}
        return identifiability(
            self.linearised.triangle,
            self.linearised.variables,
            tolerance=self.linearised.tolerance,
            fixed={k: v for k, v in self._model.parameters.numbers.items() if k not in taken},
        )

    @cached_property
    def shares(self) -> Array:
        """(runs, K) part of what is known of an unknown from each run, its channels together."""
        runs = list(self.simulations)
        squares = np.zeros((len(runs), self.linearised.variables.count))
        for run in self.linearised.runs:
            squares[runs.index(run.name)] += np.sum(run.jacobian**2, axis=0)
        total = squares.sum(axis=0)
        shares: Array = np.divide(squares, total, out=np.zeros_like(squares), where=total > 0.0)
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
            for part, seconds in zip(share, self._seconds(name), strict=True)
        )

    def sentences(self) -> tuple[str, ...]:
        """What no run tells of, why, and what rests on one run alone."""
        groups: dict[str, list[str]] = {}
        for name in self.identifiability.unexcited:
            if name in self.names:
                groups.setdefault(self._missing(name), []).append(name)
        said = [
            f"{listed(names)} need{'s' if len(names) == 1 else ''} {why}."
            for why, names in groups.items()
        ]
        runs = list(self.simulations)
        for name in self.names if len(runs) > 1 else ():
            share = self.shares[:, self.linearised.variables.index(name)]
            most = int(np.argmax(share))
            if share[most] >= ALONE:
                said.append(
                    f"{name}: {100.0 * share[most]:.0f} % of its information is from {runs[most]} "
                    "alone."
                )
        return tuple(said)

    def _missing(self, name: str) -> str:
        """What an unknown that no sample depends on needs, and whether a run has it."""
        need = self.need(name)
        if name.startswith("force_"):
            need = "currents of their size beyond Z17"
        side = next((each for each in ("plus", "minus") if f"_{each}" in name), None)
        need = need if side is None else f"{need} ({side})"
        having = [run for run, s in zip(self.simulations, self._seconds(name), strict=True) if s]
        if not having:
            forces = name.startswith("force_")
            instead = "ask for forces at smaller currents" if forces else "fix it"
            return f"{need}, which no run has: {instead}, or add a test that has it"
        return f"{need}: {having[0]} meets it, but shows it in no sample that is used"

    def _seconds(self, name: str) -> Array:
        seconds: Array = self.seconds[:, self.names.index(name)]
        return seconds


def outlook(
    stage: Stage, nominal: ParameterSet | HasParameters, experiments: Sequence[Experiment]
) -> Outlook:
    """What runs can tell of a stage's unknowns, before any fit.

    Parameters
    ----------
    stage : Stage
        What is free and what is fitted.
    nominal : ParameterSet or Drive
        Nominal values; best those that `fitting.smooth` makes, as a fit takes them.
    experiments : sequence of Experiment
        The runs to fit.

    Raises
    ------
    InputError, ParameterError
        If runs and set-up do not fit each other, see `staging.stage_problem`.
    DomainError
        If the model does not hold at the nominal values.
    """
    parameters = set_of(nominal)
    problem = stage_problem(stage, parameters, experiments)
    model = problem.model
    assert isinstance(model, DriveModel)
    simulations = {each.name: simulated_run(each, parameters) for each in problem.experiments}
    seconds = activation(simulations, parameters, problem.unknowns.items, model.forces)
    fit = linearised_fit(problem, problem.start)
    return Outlook(stage, problem, simulations, fit, seconds)
