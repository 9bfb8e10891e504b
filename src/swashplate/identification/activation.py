"""What each run makes the drive do, known before a fit: thresholds passed and limits reached.

A parameter matters only while something happens: an orifice's while it limits the flow, a rate
limit's while the current follows it. The nominal simulation tells whether and for how long; what
the measured samples then see of it is told by the derivatives (`excitation`).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import exp, isfinite

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.experiment import Experiment
from swashplate.equations.marching.run import Start
from swashplate.errors import InputError
from swashplate.identification.drives import current_record, voltage_record
from swashplate.identification.forces import Forces
from swashplate.identification.unknowns import Unknown
from swashplate.parameters.definitions import CATALOGUE, COLUMNS, REFINEMENTS
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.simulation.result import Limit, Simulation
from swashplate.simulation.run import simulate_drive, simulate_pump

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
    start: Start = "steady" if experiment.start == "steady" else "rest"
    try:
        if experiment.input.kind == "current":
            return simulate_pump(
                parameters, current_record(experiment), start, experiment.start_pressure
            )
        return simulate_drive(
            parameters, voltage_record(experiment), start, experiment.start_pressure
        )
    except InputError as error:
        raise InputError(f"{experiment.input.source}: {error}") from None


def acting(simulation: Simulation, parameters: ParameterSet) -> dict[str, float]:
    """How long what a parameter needs happens in a run, for every column such as ``"Z16_plus"``.

    Parameters
    ----------
    simulation : Simulation
        Of the run.
    parameters : ParameterSet
        What was simulated.

    Returns
    -------
    dict of str to float
        Durations, 0 where it never happens. Without a card its parameters have 0. [s]
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
    return {**found, **dict.fromkeys(REFINEMENTS, found["Z1"])}


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


@dataclass(frozen=True, eq=False)
class Activation:
    """How long each run makes happen what each unknown needs."""

    runs: tuple[str, ...]
    names: tuple[str, ...]
    """The unknowns, those of single runs left out."""
    needs: tuple[str, ...]
    """What each needs, in words."""
    seconds: Array
    """(runs, K) how long it happens. [s]"""

    def __getitem__(self, name: str) -> Array:
        """(runs,) durations for one unknown. [s]"""
        return self.seconds[:, self.names.index(name)]

    @property
    def idle(self) -> tuple[str, ...]:
        """Unknowns whose need no run meets."""
        return tuple(
            name for k, name in enumerate(self.names) if not (self.seconds[:, k] > 0.0).any()
        )


def activation(
    simulations: Mapping[str, Simulation],
    parameters: ParameterSet,
    unknowns: Sequence[Unknown],
    forces: Forces | None = None,
) -> Activation:
    """The table of runs and unknowns.

    Parameters
    ----------
    simulations : mapping of str to Simulation
        Of each run by its name, see `simulated_run`.
    parameters : ParameterSet
        What was simulated.
    unknowns : sequence of Unknown
        Of a fit; those of single runs are left out.
    forces : Forces, optional
        Where forces stand for the solenoids' coefficients.
    """
    ours = [each for each in unknowns if each.run is None]
    rows = []
    for simulation in simulations.values():
        found = acting(simulation, parameters)
        row = []
        for each in ours:
            if forces is not None and each.name in forces.names:
                row.append(_near(simulation, each.name, forces, parameters.numbers["Z17"]))
            else:
                row.append(max(found[target] for target in each.targets))
        rows.append(row)
    return Activation(
        tuple(simulations),
        tuple(each.name for each in ours),
        tuple(need_of(each.name, forces) for each in ours),
        np.array(rows).reshape(len(rows), len(ours)),
    )


def need_of(name: str, forces: Forces | None = None) -> str:
    """What an unknown needs, in words."""
    if forces is not None and name in forces.names:
        return f"{_current_of(name, forces)[0]:g} A beyond Z17"
    symbol = COLUMNS.get(name, name)
    return (CATALOGUE[symbol].needs if symbol in CATALOGUE else "") or OTHERS


def _current_of(name: str, forces: Forces) -> tuple[float, float]:
    """Effective current of a force, and where its neighbourhood begins. [A]"""
    match = re.fullmatch(r"force_(plus|minus)_(\d)", name)
    assert match is not None
    currents = forces.plus if match[1] == "plus" else forces.minus
    k = int(match[2]) - 1
    return currents[k], 0.5 * (currents[k] + (currents[k - 1] if k else 0.0))


def _near(simulation: Simulation, name: str, forces: Forces, Z17: float) -> float:
    """How long the effective current is at that of a force or beyond, from half way to it. [s]"""
    sign = 1.0 if "_plus_" in name else -1.0
    reached = sign * simulation.current - Z17 >= _current_of(name, forces)[1]
    return float(np.count_nonzero(reached)) / simulation.record.rate
