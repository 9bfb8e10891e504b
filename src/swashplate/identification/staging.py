"""From a stage of a set-up and a drive to the problem that it states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import applying, inside
from swashplate.campaign.campaign import Campaign
from swashplate.campaign.experiment import Experiment
from swashplate.drive import Drive
from swashplate.errors import InputError, ParameterError
from swashplate.executors import available_cores
from swashplate.identification.drive_model import (
    CURRENTS,
    SIGNALS,
    DriveModel,
    Forces,
    measured_current,
    simulated_current,
)
from swashplate.identification.problem import Problem, noise_scales
from swashplate.identification.setup import (
    Free,
    ModelParameters,
    Setup,
    Stage,
    deviation,
    load_setup,
)
from swashplate.identification.unknowns import Prior, Unknown, Unknowns, bounded
from swashplate.parameters.definitions import SWITCHES, columns_of, find
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.simulation.instance import START_PRESSURE


def check_weights(stage: Stage, experiments: Sequence[Experiment], channels: Sequence[str]) -> None:
    """Refuse weights that no channel takes, which would be lost in silence.

    Raises
    ------
    InputError
        If the stage has weights, but for no kind of channel that it fits.
    """
    weighed = [*stage.weights, *stage.weights_by_input]
    kinds = {c.kind for e in experiments for name, c in e.channels.items() if name in channels}
    if weighed and not kinds & set(weighed):
        raise InputError(
            f"The stage '{stage.name}' weighs {', '.join(dict.fromkeys(weighed))}, but the runs "
            f"have {', '.join(sorted(kinds))}: add weights for that, or take a fit "
            "configuration without."
        )


def weighted(experiment: Experiment, stage: Stage) -> Experiment:
    """The experiment with the stage's own weights multiplied in."""
    if not stage.weights and not stage.weights_by_input:
        return experiment
    channels = {}
    for name, channel in experiment.channels.items():
        weight = channel.weight.copy()
        for window in applying(stage.weights.get(channel.kind, ()), experiment.maneuver):
            weight[inside(window, channel.time)] *= window.factor
        for sized in applying(stage.weights_by_input.get(channel.kind, ()), experiment.maneuver):
            levels, factors = np.transpose(sized.factors)
            within = inside(sized, channel.time)
            size = np.abs(experiment.input.at(channel.time[within]))
            weight[within] *= np.interp(size, levels, factors)
        channels[name] = replace(channel, weight=weight)
    return replace(experiment, channels=channels)


Array = NDArray[np.float64]
Parameters = ParameterSet | ModelParameters
"""The numbers of what is fitted: a drive, or a model of one's own."""
LARGEST_START_PRESSURE = 4e6
"""Bound of a free pressure at the start where the set-up gives none. [Pa]"""


def setup_of(campaign: Campaign, axis: str, name: str | None = None) -> Setup:
    """The set-up of a name, or the packaged one of the axis's drive.

    Raises
    ------
    InputError
        If none is named and the drive has no packaged one.
    """
    if name is not None:
        return load_setup(name)
    drive = campaign.drive(axis).name
    try:
        return load_setup(drive)
    except ParameterError:
        raise InputError(
            f"There is no packaged fit configuration for the drive '{drive}': give one of your "
            "own, a .toml "
            "file with stages and free parameters; 'swashplate guess' reads one off the logs."
        ) from None


def stage_problem(
    stage: Stage,
    parameters: Parameters,
    experiments: Sequence[Experiment],
    *,
    threads: int | None = None,
    uncertain: Mapping[str, float | str] = MappingProxyType({}),
) -> Problem:
    """The problem of a stage.

    Parameters
    ----------
    stage : Stage
        What is free and what is fitted.
    parameters : ParameterSet or ModelParameters
        Nominal values, those of earlier stages already found.
    experiments : sequence of Experiment
        The runs to fit.
    threads : int, optional
        Threads over experiments; all cores by default.
    uncertain : mapping of str to float or str, optional
        Standard uncertainties of what stays fixed, as of `Setup`.

    Raises
    ------
    InputError
        If no experiment has a channel that the stage fits, none that it weighs, or no current that
        the stage asks for.
    ParameterError
        If a free parameter is unknown or its bounds are wrong.
    """
    if isinstance(parameters, ModelParameters):
        return parameters.setup.problem(experiments, threads=threads or available_cores())
    if stage.part == "model":
        raise InputError("part = 'model' needs a model of your own, not a drive.")
    channels = _channels(stage, experiments)
    runs = tuple(each for each in experiments if any(name in each.channels for name in channels))
    check_weights(stage, runs, channels)
    forces = None
    if stage.forces is not None:
        forces = Forces(stage.forces.plus, stage.forces.minus)
    currents = {}
    if stage.part == "pump":
        currents = {
            each.name: measured_current(each, stage.current_scale)
            if stage.current == "measured" or each.input.kind == "current"
            else simulated_current(each, parameters)
            for each in runs
        }
    free = _parameters(stage.free, parameters)
    unknowns = (
        *free,
        *_forces(stage, forces, parameters),
        *_clocks(stage, runs, channels),
        *_own(stage, runs, channels, parameters),
    )
    return Problem(
        DriveModel(_switched_on(parameters, free), stage.part, currents, forces),
        tuple(weighted(each, stage) for each in runs),
        Unknowns(unknowns),
        channels,
        noise_scales(runs, channels),
        uncertain=uncertain_columns(uncertain, parameters),
        threads=threads or available_cores(),
    )


def uncertain_columns(
    uncertain: Mapping[str, float | str], parameters: ParameterSet
) -> tuple[Mapping[str, float], ...]:
    """Standard uncertainties of a drive's fixed parameters, by columns; see `Problem.uncertain`.

    Raises
    ------
    ParameterError
        If there is no parameter of a name.
    """
    made = []
    for name, each in uncertain.items():
        columns = columns_of([name])
        made.append({c: deviation(each, _nominal(parameters, c)) for c in columns})
    return tuple(made)


def with_estimates(parameters: Parameters, problem: Problem, vector: Array) -> Parameters:
    """The parameters with what a stage found, at a point of its problem.

    Raises
    ------
    DomainError
        If a value breaks a rule.
    """
    found = problem.unknowns.targets(vector, "")
    if isinstance(parameters, ModelParameters):
        numbers = {**parameters.numbers, **found}
        return ModelParameters(parameters.setup, numbers, problem.scales)
    assert isinstance(problem.model, DriveModel)
    return problem.model.parameters_at(found)


def _channels(stage: Stage, experiments: Sequence[Experiment]) -> tuple[str, ...]:
    """Names of the channels that a stage fits."""
    kinds = stage.channels or tuple(
        kind
        for kind in SIGNALS
        if stage.part == "chain" or (kind in CURRENTS) == (stage.part == "card")
    )
    names = dict.fromkeys(
        name
        for each in experiments
        for name, channel in each.channels.items()
        if channel.kind in kinds
    )
    if not names:
        had = ", ".join(dict.fromkeys(c.kind for e in experiments for c in e.channels.values()))
        hint = ""
        if stage.part == "card":
            hint = "; without a current, let 'swashplate guess' write start and fit configuration"
        raise InputError(
            f"The stage '{stage.name}' fits {', '.join(kinds)}, but the runs to fit have "
            f"{had or 'no channel'}{hint}."
        )
    return tuple(names)


def _parameters(free: Mapping[str, Free], parameters: ParameterSet) -> list[Unknown]:
    unknowns: list[Unknown] = []
    for name, entry in free.items():
        definition = find(name)
        columns = definition.columns if name == definition.symbol else (name,)
        groups = [columns] if entry.tied or len(columns) == 1 else [(each,) for each in columns]
        unknowns += [
            bounded(
                name if entry.tied else group[0],
                float(np.mean([_nominal(parameters, column) for column in group])),
                relative=entry.relative,
                absolute=entry.bounds,
                unit=definition.unit,
                least=definition.least,
                log=entry.log,
                prior=None
                if entry.prior is None
                else Prior(entry.prior.mean, entry.prior.deviation),
                sets=group,
            )
            for group in groups
        ]
    return unknowns


def _switched_on(parameters: ParameterSet, free: Sequence[Unknown]) -> ParameterSet:
    """The set where the unknowns begin, with all that they belong to on."""
    begin = {column: each.start for each in free for column in each.targets if column in SWITCHES}
    options = parameters.options | {SWITCHES[column] for column in begin}
    return parameters.replace(begin, options) if begin else parameters


def _nominal(parameters: ParameterSet, column: str) -> float:
    """Where a parameter begins: a refinement that the set does not give, where it is off."""
    if column in parameters.numbers:
        return parameters.numbers[column]
    return parameters[column].values[0]


def _forces(stage: Stage, forces: Forces | None, parameters: ParameterSet) -> list[Unknown]:
    if forces is None or stage.forces is None:
        return []
    return [
        bounded(name, value, relative=stage.forces.relative, unit="N", log=value > 0.0)
        for name, value in forces.values(parameters).items()
    ]


def _clocks(
    stage: Stage, experiments: Sequence[Experiment], channels: Sequence[str]
) -> list[Unknown]:
    """Offsets of the channels' clocks, each the same in all runs."""
    kinds = {
        name: each.channels[name].kind
        for each in experiments
        for name in channels
        if name in each.channels
    }
    idle = [kind for kind in stage.clock_offsets if kind not in kinds.values()]
    if idle:
        raise InputError(
            f"The stage '{stage.name}' frees the clock of {', '.join(idle)}, but fits "
            f"{', '.join(dict.fromkeys(kinds.values()))}."
        )
    return [
        Unknown(f"clock {name}", 0.0, -stage.clock_offsets[kind], stage.clock_offsets[kind], "s")
        for name, kind in kinds.items()
        if kind in stage.clock_offsets
    ]


def _own(
    stage: Stage,
    experiments: Sequence[Experiment],
    channels: Sequence[str],
    parameters: ParameterSet,
) -> list[Unknown]:
    """Unknowns of single experiments: free zeros of positions, initial pressure and current."""
    unknowns = []
    for each in experiments:
        for name in channels:
            channel = each.channels.get(name)
            if channel is None or not channel.is_position:
                continue
            # a free zero: far enough both ways never to be reached
            first, reach = float(channel.values[0]), 1.0 + 10.0 * float(np.ptp(channel.values))
            unknowns.append(
                Unknown(
                    f"offset {name}",
                    first,
                    first - reach,
                    first + reach,
                    channel.unit,
                    run=each.name,
                )
            )
        if stage.part != "card" and (stage.start_pressure is not None or each.start == "estimated"):
            most = stage.start_pressure or LARGEST_START_PRESSURE
            unknowns.append(Unknown(START_PRESSURE, 0.0, -most, most, "Pa", run=each.name))
        measured = [each.channels[name].kind for name in channels if name in each.channels]
        if (
            stage.part != "pump"
            and each.start == "estimated"
            and each.input.kind == "voltage"
            and not set(CURRENTS).isdisjoint(measured)
        ):
            unknowns += _start_current(each, parameters)
    return unknowns


def _start_current(experiment: Experiment, parameters: ParameterSet) -> list[Unknown]:
    """Current of the driven channel at the first sample; none where neither can be told driven."""
    first = float(measured_current(experiment).values[0])
    if first == 0.0:
        return []
    side, sign = ("plus", 1.0) if first > 0.0 else ("minus", -1.0)
    most = 2.0 * abs(Drive(parameters).steady_current(sign * FULL_VOLTAGE))
    start = min(abs(first), 0.9 * most)
    return [Unknown(f"start_current_{side}", start, 0.0, most, "A", run=experiment.name)]


SPREAD = 0.05
"""Standard deviation of the logarithm by which a drawn parameter differs from the nominal one."""

OF_FORCES = ("Z19", "Z21")
"""The solenoids' coefficients that are drawn where a set-up frees forces: those of odd powers."""


def drawn(nominal: Drive, setup: Setup, seed: int, *, spread: float = SPREAD) -> Drive:
    """A drive that differs from a nominal one in what a set-up frees, and in nothing else.

    Parameters
    ----------
    nominal : Drive
        About which it is drawn.
    setup : Setup
        Its free parameters are multiplied by log-normal factors, both directions apart.
    seed : int
        Not negative.
    spread : float
        Standard deviation of the factors' logarithms.

    Raises
    ------
    ParameterError
        If what was drawn breaks a rule: draw with another seed.
    """
    random = np.random.default_rng(seed)
    names = [name for stage in setup.stages for name in columns_of(list(stage.free))]
    if any(stage.forces is not None for stage in setup.stages):
        names += columns_of(list(OF_FORCES))
    numbers = nominal.parameters.numbers
    factors = {name: float(np.exp(random.normal(0.0, spread))) for name in names}
    return nominal.replace(**{name: numbers[name] * factor for name, factor in factors.items()})


def true_value(unknown: Unknown, model: DriveModel, truth: ParameterSet) -> float | None:
    """What an unknown of the machine really is; None for one of a single experiment."""
    if unknown.run is not None:
        return None
    forces = model.forces.values(truth) if model.forces is not None else {}
    return {**truth.numbers, **forces}[unknown.targets[0]]
