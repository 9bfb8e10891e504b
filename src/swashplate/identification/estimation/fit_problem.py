"""What a fit is of: its fit setup, and the problem of that over the runs.

What is fitted is a drive or a user-defined model, `Parameters`; here, and where results are
written and shown, it is asked which of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import Campaign, Experiment, applying, inside
from swashplate.documents import validated
from swashplate.drive import Drive
from swashplate.errors import InputError, ParameterError, UnknownParameterError
from swashplate.executors import available_cores
from swashplate.identification.estimation.drive_model import (
    CURRENTS,
    MOST_EDGES,
    START_CURRENTS,
    START_PRESSURE,
    DriveModel,
    free_zero,
    kinds_of,
    measured_current,
    simulated_current,
    unknown_instants,
)
from swashplate.identification.estimation.model_setup import ModelSetup
from swashplate.identification.estimation.problem import Problem, noise_scales
from swashplate.identification.estimation.setup import (
    FitSetup,
    Free,
    FreeParameters,
    deviation,
    free_entries,
    load_setup,
)
from swashplate.identification.estimation.unknowns import Unknown, Unknowns, bounded
from swashplate.machine.marching import Record
from swashplate.machine.plausible import check_plausible
from swashplate.parameters import (
    DEFINITIONS,
    FULL_VOLTAGE,
    SWITCHES,
    Definition,
    Definitions,
    ParameterSet,
)

Array = NDArray[np.float64]
Parameters = ParameterSet | ModelSetup
"""The numbers of what is fitted: a drive, or a user-defined model."""
Fitted = TypeVar("Fitted", bound=Parameters)
FORCE = Definition("force of the solenoids", "N", plausible=(0.0, 1e4))
"""What stands for their coefficients."""
UNKNOWN_MACHINE = "neutral"
"""The packaged drive that stands for no machine: nothing is known of one by its numbers."""
MODEL_ERROR = 0.01
"""Error of any model of a machine, as a share of a channel's range: where numbers have priors, a
channel that is read more finely counts no more than this, or the model's own error, small but the
same over a whole run, would drive them away from what is known. [1]"""
LIKE_NAMED = 0.3
"""How near a machine's numbers are taken to be to those of the drive that is named for it, a
standard deviation of their logarithms: what differs between machines of a kind is not known, so
this is wide. [1]"""
READ_OFF = 0.7
"""The same of a number that a guess read off logs, in which a lag can stand for a limit. [1]"""
CERTAIN = 0.009
"""Interval between the samples of an edge up to which its instant is no unknown among numbers that
have priors: 125 samples a second. [s]"""
LARGEST_START_PRESSURE = 4e6
"""Bound of a free pressure at the start if the fit setup gives none. [Pa]"""


def smooth(parameters: Fitted) -> Fitted:
    """The parameters as a fit takes them: the card's switches act within a sample.

    Sampled, as published, the switch to the decay makes the current jump by up to 0.7 mA as any of
    the card's parameters varies, and a fit ends where it was caught (docs/decisions/0008).

    Parameters
    ----------
    parameters : ParameterSet or ModelSetup
        A drive's, or a user-defined model with its numbers, which has no such switch.

    Returns
    -------
    ParameterSet or ModelSetup
        The set with ``card_switch="split"``; a user-defined model as it is.
    """
    if isinstance(parameters, ParameterSet):
        return replace(parameters, card_switch="split")
    return parameters


def as_fit_setup(
    free: FreeParameters,
    experiments: Sequence[Experiment],
    definitions: Definitions = DEFINITIONS,
) -> FitSetup:
    """A drive's fit setup from any form that a caller may give it in.

    Parameters
    ----------
    free : FitSetup, str, path or mapping
        A fit setup, a TOML file, or a mapping: the contents of such a file, or free parameters by
        symbol as of `setup.free_entries`. Those are estimated through the card alone if currents
        were measured, of pump and motor alone, or through the whole chain if both are free or no
        current was measured.
    experiments : sequence of Experiment
        The runs to fit.
    definitions : Definitions
        What the drive has, `ParameterSet.definitions`; by default without user-defined equations.

    Raises
    ------
    FileError, ParameterError
        If the fit setup cannot be read, or an entry is wrong.

    Examples
    --------
    >>> from swashplate.identification import as_fit_setup
    >>> as_fit_setup({"Z8": (0.5, 2)}, ()).part
    'pump'
    """
    if isinstance(free, FitSetup):
        return _with_known_names(free, "the fit setup", definitions)
    if isinstance(free, str | Path):
        return _with_known_names(load_setup(free), str(free), definitions)
    entries_given: object = free
    if not isinstance(entries_given, Mapping) or not entries_given:
        raise InputError(
            f"The free parameters are {free!r}, but must be a fit setup, its file, or a mapping "
            "such as {'Z8': (0.5, 2)}."
        )
    if "stages" in free or "free" in free:
        setup = validated(dict(free), FitSetup, "the fit setup")
        return _with_known_names(setup, "the fit setup", definitions)
    entries = free_entries(free, definitions)
    in_card = {definitions.find(name).block == "control_card" for name in entries}
    blocks = {"card" if inside else "pump" for inside in in_card}
    kinds = {channel.kind for run in experiments for channel in run.channels.values()}
    part: Literal["card", "pump", "chain"] = "chain"
    if blocks == {"pump"}:
        part = "pump"
    elif blocks == {"card"} and not kinds.isdisjoint(CURRENTS):
        part = "card"
    return FitSetup(part=part, free=entries)


def _with_known_names(setup: FitSetup, origin: str, definitions: Definitions) -> FitSetup:
    """The fit setup of a drive; a name in it that no parameter has is refused."""
    free = () if setup.part == "model" else setup.free
    names = [("free", name) for name in free]
    names += [("standard_uncertainty", name) for name in setup.standard_uncertainty]
    for table, name in names:
        try:
            definitions.find(name)
        except UnknownParameterError as error:
            raise UnknownParameterError(f"{origin}, {table}: {error}") from None
    return setup


def setup_of(
    campaign: Campaign, axis: str, drive: ParameterSet, free: FreeParameters | None = None
) -> FitSetup:
    """The fit setup of an axis.

    By default `whole_drive` of the given drive, of its pump alone if currents drive all runs. Of
    the drive that stands for no machine nothing is known beforehand: see `of_any_machine`.
    `free` as of `as_fit_setup`.
    """
    runs = campaign.select(axis=axis, role="fit")
    if free is not None:
        return as_fit_setup(free, runs, drive.definitions)
    if drive.name == UNKNOWN_MACHINE:
        return of_any_machine()
    by_current = all(run.input.kind == "current" for run in runs)
    return whole_drive(drive, part="pump" if by_current else "chain")


def of_any_machine() -> FitSetup:
    """A fit setup of a machine of which nothing is known beforehand: command to motion as a whole.

    Z8 is the lag and Z10 the scale of all speeds, of which the gains G1 tell both ways apart; Z1,
    Z3, Z4, Z5, Z9 and Z19 are scales that no speed tells.
    """
    wide = Free(relative=(0.02, 20.0), log=True)
    free = {
        "V_dz": Free(bounds=(0.0, 5.0)),
        "G1": wide,
        "Z8": wide,
        "tau": Free(bounds=(0.0, 0.5)),
    }
    return FitSetup(
        title="a machine of unknown numbers",
        channels=("shaft_speed", "position", "encoder_counts"),
        free=free,
    )


def whole_drive(
    parameters: ParameterSet,
    spread: float = LIKE_NAMED,
    part: Literal["pump", "chain"] = "chain",
) -> FitSetup:
    """A fit setup of every number that is not 0 or off, through the whole drive.

    Each is known beforehand to within a share of its nominal value: what the tests determine
    becomes narrower, and what they do not stays as wide as it was, in the intervals as in the
    stated error of a prediction. So nothing need be fixed that is not known.

    Parameters
    ----------
    parameters : ParameterSet
        The drive that the machine is like.
    spread : float
        Standard deviation of a number, as a share of its nominal value; at least `READ_OFF` of one
        that a guess read off logs. [1]
    part : {"chain", "pump"}
        The whole drive, or pump and motor without their amplifier.

    Returns
    -------
    FitSetup
        Refinements, which somebody stated, stay fixed.
    """
    free = dict[str, Free]()
    for symbol, parameter in parameters.items():
        block = parameter.definition.block
        if block == "refinements" or (part == "pump" and block == "control_card"):
            continue
        moved = [
            column
            for column, number in parameter.numbers.items()
            if number != 0.0 and np.isfinite(number)
        ]
        names = [symbol] if len(moved) == len(parameter.numbers) else moved
        spread_of_symbol = max(spread, READ_OFF) if is_read_off(parameters, symbol) else spread
        free |= {name: Free(spread=spread_of_symbol) for name in names}
    title = f"every number of {parameters.name}, known to within {100.0 * spread:g} %"
    return FitSetup(title=title, part=part, free=free)


def is_read_off(parameters: ParameterSet, symbol: str) -> bool:
    """Whether a guess read a parameter off the logs of tests."""
    return parameters.tested is not None and parameters[symbol].status == "approximate"


def problem_of(
    setup: FitSetup,
    parameters: Parameters,
    experiments: Sequence[Experiment],
    *,
    threads: int | None = None,
) -> Problem:
    """The problem of a fit, over the runs that have a channel of it.

    `parameters` are the nominal values. Threads are all cores by default. An `InputError` says that
    no run has what the setup fits or asks for, a `ParameterError` that a free parameter is unknown
    or its bounds are wrong.
    """
    threads = threads or available_cores()
    if isinstance(parameters, ModelSetup):
        return parameters.problem(experiments, threads=threads)
    if setup.part == "model":
        raise InputError("part = 'model' needs a user-defined model, not a drive.")
    channels = _channels_of(setup, experiments)
    runs = tuple(run for run in experiments if any(name in run.channels for name in channels))
    unknowns = _of_the_machine(setup, parameters)
    model = DriveModel(
        parameters=_switched_on(parameters, unknowns),
        part=setup.part,
        currents=_currents(setup, runs, parameters),
        forces=setup.forces,
    )
    for run in runs:
        unknowns += _of_a_run(setup, run, channels, parameters)
    if setup.part != "pump" or setup.current != "measured":
        edges = [unknown for run in runs for unknown in unknown_instants(run)]
        if len(edges) <= MOST_EDGES and not _edges_are_certain(setup, runs):
            unknowns += edges
    return Problem(
        model,
        tuple(_weighted(run, setup) for run in runs),
        Unknowns(tuple(unknowns)),
        channels,
        noise_scales(runs, channels, least=MODEL_ERROR if setup.has_spreads else 0.0),
        uncertain=tuple(
            {
                column: deviation(doubt, _nominal(parameters, column))
                for column in parameters.definitions.columns_of([name])
            }
            for name, doubt in setup.standard_uncertainty.items()
        ),
        threads=threads,
    )


def _edges_are_certain(setup: FitSetup, runs: Sequence[Experiment]) -> bool:
    """Whether the instants of the command's edges, halfway between samples, are certain enough.

    A fit that grants every model an error of 1 % of the range does not see by which part of a short
    interval they are off, some earlier and some later.
    """
    intervals = [edge.interval for run in runs for edge in run.input.edges]
    return setup.has_spreads and float(np.median(intervals or [0.0])) <= CERTAIN


def _currents(
    setup: FitSetup, runs: Sequence[Experiment], parameters: ParameterSet
) -> dict[str, Record]:
    """Currents that drive the pump, by run; none if another part is fitted."""
    if setup.part != "pump":
        return {}
    currents = {}
    for run in runs:
        if setup.current == "measured" or run.input.kind == "current":
            currents[run.name] = measured_current(run, setup.current_scale)
        else:
            currents[run.name] = simulated_current(run, parameters)
    return currents


def _switched_on(parameters: ParameterSet, unknowns: Sequence[Unknown]) -> ParameterSet:
    """The set with the refinements that are estimated, at the values that the fit begins with."""
    numbers = {
        column: unknown.start
        for unknown in unknowns
        for column in unknown.targets
        if column in SWITCHES
    }
    if not numbers:
        return parameters
    options = parameters.options | {SWITCHES[column] for column in numbers}
    return parameters.with_numbers(numbers, options)


def _channels_of(setup: FitSetup, experiments: Sequence[Experiment]) -> tuple[str, ...]:
    """Names of the channels that are fitted; weights of others would be lost in silence."""
    kinds = setup.channels or kinds_of(setup.part)
    measured = [
        (name, channel.kind) for run in experiments for name, channel in run.channels.items()
    ]
    fitted = {kind for _, kind in measured if kind in kinds}
    if not fitted:
        hint = ""
        if setup.part == "card":
            hint = "; without a current, let 'swashplate guess' write a drive to begin with"
        raise InputError(
            f"The fit setup fits {', '.join(kinds)}, but the runs to fit have "
            f"{', '.join(dict.fromkeys(kind for _, kind in measured)) or 'no channel'}{hint}."
        )
    weighed = {**setup.weights, **setup.weights_by_input}
    if weighed and not fitted & set(weighed):
        raise InputError(
            f"The fit setup weighs {', '.join(weighed)}, but the runs have "
            f"{', '.join(sorted(fitted))}: add weights for that, or use a fit setup without."
        )
    return tuple(dict.fromkeys(name for name, kind in measured if kind in kinds))


def with_estimates(parameters: Parameters, problem: Problem, vector: Array) -> Parameters:
    """The parameters with what a fit found; a `DomainError` if a value breaks a rule."""
    numbers = problem.unknowns.targets(vector, "")
    if isinstance(parameters, ModelSetup):
        return replace(parameters, numbers={**parameters.numbers, **numbers}, scales=problem.scales)
    assert isinstance(problem.model, DriveModel)
    return problem.model.parameters_at(numbers)


def _weighted(experiment: Experiment, setup: FitSetup) -> Experiment:
    """The experiment with the fit setup's own weights multiplied in."""
    if not setup.weights and not setup.weights_by_input:
        return experiment
    channels = {}
    for name, channel in experiment.channels.items():
        weight = channel.weight.copy()
        for window in applying(setup.weights.get(channel.kind, ()), experiment.maneuver):
            weight[inside(window, channel.time)] *= window.factor
        for sized in applying(setup.weights_by_input.get(channel.kind, ()), experiment.maneuver):
            within = inside(sized, channel.time)
            size = np.abs(experiment.input.at(channel.time[within]))
            weight[within] *= np.interp(size, *np.transpose(sized.factors))
        channels[name] = replace(channel, weight=weight)
    return replace(experiment, channels=channels)


def _of_the_machine(setup: FitSetup, parameters: ParameterSet) -> list[Unknown]:
    """Unknowns of the drive: free parameters, both directions apart unless tied, then forces."""
    unknowns: list[Unknown] = []
    for name, entry in setup.free.items():
        definition = parameters.definitions.find(name)
        columns = tuple(parameters.definitions.columns_of([name]))
        least = -np.inf if definition.least is None else definition.least
        for group in [columns] if entry.tied else [(column,) for column in columns]:
            nominal = float(np.mean([_nominal(parameters, column) for column in group]))
            if entry.spread is not None and nominal == 0.0:
                raise ParameterError(
                    f"{name} is nominally 0, and no spread is a share of that: give bounds "
                    "and a prior."
                )
            about = entry.about(nominal)
            bounds = about.bounds
            if entry.spread is not None and entry.bounds is None and bounds is not None:
                bounds = _possible(definition, bounds)
            unknown = bounded(
                name if entry.tied else group[0],
                nominal,
                factors=about.relative,
                bounds=bounds,
                least=least,
                sets=group,
                unit=definition.unit,
                log=about.log,
                prior=about.prior,
            )
            check_plausible(f"a bound of {unknown.name}", definition, unknown.low, unknown.high)
            if about.prior is not None:
                check_plausible(f"the prior mean of {unknown.name}", definition, about.prior.mean)
            unknowns.append(unknown)
    if setup.forces is not None:
        for name, value in setup.forces.values(parameters).items():
            force = bounded(
                name,
                value,
                factors=setup.forces.relative,
                unit="N",
                log=value > 0.0,
                kind="force",
            )
            check_plausible(f"a bound of {name}", FORCE, force.low, force.high)
            unknowns.append(force)
    return unknowns


def _possible(definition: Definition, bounds: tuple[float, float]) -> tuple[float, float]:
    """Bounds within what a parameter may be, and what somebody can mean."""
    low, high = max(bounds[0], definition.lower), min(bounds[1], definition.upper)
    least, most = definition.plausible or (0.0, np.inf)
    if low > 0.0:
        low = max(low, least)
    return max(low, -most), min(high, most)


def _nominal(parameters: ParameterSet, column: str) -> float:
    """Where a parameter begins; for a refinement that the set does not give, where it is off."""
    if column in parameters.numbers:
        return parameters.numbers[column]
    return parameters[column].values[0]


def _of_a_run(
    setup: FitSetup, experiment: Experiment, channels: Sequence[str], parameters: ParameterSet
) -> Iterator[Unknown]:
    """Unknowns of one experiment: free zeros of positions, pressure and current at the start."""
    run = experiment.name
    estimated = experiment.start == "estimated"
    fitted = {name: experiment.channels[name] for name in channels if name in experiment.channels}
    for name, channel in fitted.items():
        if channel.is_position:
            yield free_zero(name, channel, experiment)
    if setup.part != "card" and (setup.start_pressure is not None or estimated):
        most = setup.start_pressure or LARGEST_START_PRESSURE
        yield Unknown(START_PRESSURE, 0.0, -most, most, "Pa", run=run, kind="start pressure")
    measured = any(channel.kind in CURRENTS for channel in fitted.values())
    if estimated and measured and setup.part != "pump" and experiment.input.kind == "voltage":
        first = float(measured_current(experiment).values[0])
        if first != 0.0:  # else neither channel is the driven one
            plus, minus = START_CURRENTS
            full = np.copysign(FULL_VOLTAGE, first)
            most = 2.0 * abs(Drive(parameters).steady_current(float(full)))
            yield Unknown(
                minus if first < 0.0 else plus,
                min(abs(first), 0.9 * most),
                0.0,
                most,
                "A",
                run=run,
                kind="start current",
            )
