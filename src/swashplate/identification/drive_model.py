"""The drive as a model to be fitted: card, pump or the whole chain; the problem of a stage."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import isfinite, sqrt
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import ChannelKind, applying, inside
from swashplate.campaign.amplifier import CURRENTS as CURRENTS
from swashplate.campaign.campaign import Campaign
from swashplate.campaign.experiment import APART, RISE, Channel, Edge, Experiment, InputSignal
from swashplate.campaign.samples import signed_by_command
from swashplate.campaign.schema import SIGNALS as SIGNALS
from swashplate.documents import validated
from swashplate.drive import Drive
from swashplate.equations.marching.observation import Observation, ObservedRecord, Own
from swashplate.equations.marching.record import (
    SLOWEST,
    SOURCE_RATE,
    Interpolation,
    Record,
    even_rate,
    record_of,
)
from swashplate.errors import DomainError, InputError, ParameterError, UnknownParameterError
from swashplate.executors import available_cores
from swashplate.identification.model import Asked, EquationModel
from swashplate.identification.model_setup import ModelSetup
from swashplate.identification.problem import Problem, noise_scales
from swashplate.identification.setup import (
    Forces,
    FreeParameters,
    Setup,
    Stage,
    deviation,
    free_entries,
    load_setup,
    setup_names,
)
from swashplate.identification.unknowns import Prior, Unknown, Unknowns, bounded, zero_name
from swashplate.parameters.definitions import SWITCHES, Definition, columns_of, find, is_column
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.plausible import check_plausible
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.results import Result
from swashplate.simulation.instance import PRESSURE, START, at_every_rate
from swashplate.simulation.residuals import Ready, made_ready
from swashplate.simulation.result import Limit, Simulation
from swashplate.simulation.run import check_voltage, simulate_drive

Array = NDArray[np.float64]
Part = Literal["card", "pump", "chain"]
"""What of the drive is simulated: the card alone, pump and motor over a current, or all."""
Parameters = ParameterSet | ModelSetup
"""The numbers of what is fitted: a drive, or a model of one's own."""
Fitted = TypeVar("Fitted", bound=Parameters)
Starts = Mapping[str, Mapping[str, float]]
"""For some experiments by name the currents at the first sample, as `START_CURRENTS` has them."""
Instants = Mapping[tuple[str, str], Prior]
"""What an earlier stage found of the instants of edges, by run and name."""

START_PRESSURE = "start_pressure"
"""Name of δP at the first sample, where it is an unknown of the experiment."""
START_CURRENTS = {"start_current_plus": "card.plus", "start_current_minus": "card.minus"}
"""Names of a channel's current at the first sample, where it is an unknown of the experiment, and
the part of the model that it belongs to."""
FORCE = Definition("force of the solenoids", "N", plausible=(0.0, 1e4))
"""What stands for their coefficients."""
MOST_EDGES = 60
"""Jumps of commands whose instants are estimated; more are taken halfway between their samples."""
LARGEST_START_PRESSURE = 4e6
"""Bound of a free pressure at the start where the set-up gives none. [Pa]"""
FINE = 3
"""Points of the march's grid to a sample of a run whose command jumps: odd, so that the middle of
two samples lies between two points. The current's jump then comes 0.16 samples too early, not 0.47;
with 5 points 0.09, for half as much time again."""
OTHER_RATE = 0.01
"""Part by which a rate must differ to be another one."""
REST = 0.01
"""Share of the largest command below which it has no sign of its own. [1]"""
REACHED = (
    (Limit.SWASH_STOP, "swash_angle", "Z13", "the swash plate's stop Z13"),
    (Limit.ORIFICE, "orifice_opening", "Z16", "the orifices' limit Z16"),
    (Limit.SPOOL, "", "Z14", "the spool's stop Z14"),
    (Limit.RELIEF, "", "Z15", "the relief valve Z15"),
)
"""Limits, the signal whose sign says which side acts, the parameter that sets them, and words."""
LIMITS = {symbol: words for _, _, symbol, words in sorted(REACHED, key=lambda each: each[2])}
"""What a drive may never have reached in the fitted runs, by symbol."""
EASED, SHOWN = 1.05, 1.02
"""Factors on limits: those at which a run is simulated to see how far it would go, and how far it
must go for the limit to be seen. A stop that was touched by a hair ended with intervals of 0.1 %,
in 8 of 40 winches away from the truth. [1]"""
LIMIT_COLUMNS = {
    "Z13_plus": ("swash_angle", 1.0),
    "Z13_minus": ("swash_angle", -1.0),
    "Z14": ("spool_position", 0.0),
    "Z15": ("stroker_pressure", 0.0),
    "Z16_plus": ("orifice_opening", 1.0),
    "Z16_minus": ("orifice_opening", -1.0),
}
"""The signal that each of these limits bounds, and the sign of its side, 0 for both."""

# --- what drives an experiment --------------------------------------------------------------------


def _record(signal: InputSignal) -> Record:
    """A signal on the march's grid, its own where its stamps are even.

    The grid of one with sudden changes is finer, so that these come at once.
    """
    what, stamped = str(signal.kind), even_rate(signal.time)
    even = stamped is not None and stamped >= SLOWEST
    rate = stamped if stamped is not None and even else SOURCE_RATE
    if _jumps_at_once(signal, even=even):
        sharp = signal.with_jumps()
        record = record_of(
            sharp.values, FINE * rate, what=what, time=sharp.time, interpolation="linear"
        )
        # held, a sample stands for the time up to the next one
        return replace(record, start=record.start + (0.5 / rate if signal.is_held else 0.0))
    way: Interpolation = "previous" if signal.is_held else "linear"
    if not even:
        return record_of(signal.values, rate, what=what, time=signal.time, interpolation=way)
    record = record_of(signal.values, rate, what=what, interpolation=way)
    # the march joins the points of its grid by straight lines: of a command that is held, each
    # stands for the step after it
    held = 0.5 * record.step if signal.is_held else 0.0
    return replace(record, start=float(signal.time[0]) + held)


def _jumps_at_once(signal: InputSignal, *, even: bool) -> bool:
    """Whether sudden changes of a signal are none of the straight lines between its samples.

    Not of a slow log, in which the instants of these are estimated.
    """
    if signal.interpolation == "linear" or (signal.is_held and not even):
        return False
    places = signal.jumps
    return bool(places.size) and float(np.diff(signal.time)[places].max()) <= APART


def voltage_record(experiment: Experiment) -> Record:
    """An experiment's command on the march's grid; refused unless it is a voltage in the range."""
    if experiment.input.kind != "voltage":
        raise InputError(
            f"{experiment.name} is driven by a {experiment.input.kind}, not by a voltage: fit the "
            "pump alone."
        )
    return check_voltage(_record(experiment.input), clip=False)


def measured_current(experiment: Experiment, scale: float = 1.0) -> Record:
    """The signed current that was measured, times a factor, on the march's grid. [A]

    Of an experiment driven by a current, or with a channel of it: signed, of both solenoids, or of
    one ammeter around both leads, which is given the command's sign. Positive towards positive
    speed. An `InputError` says that no current was measured.
    """
    drive = experiment.input
    if drive.kind == "current":
        return _record(replace(drive, values=scale * drive.values))
    signed = [(each, each.values) for each in experiment.of_kind("signed_current")]
    both = experiment.of_kind("current_plus"), experiment.of_kind("current_minus")
    for plus, minus in zip(*both, strict=False):
        signed.append((plus, plus.values - np.interp(plus.time, minus.time, minus.values)))
    for channel in experiment.of_kind("rectified_current"):
        command = drive.at(channel.time)
        # noise about zero leaves readings just below it, and a command at rest without a sign
        level, reading = REST * float(np.abs(command).max()), np.maximum(channel.values, 0.0)
        signed.append((channel, signed_by_command(reading, command, level=level)))
    if not signed:
        raise InputError(
            f"{experiment.name} has no measured current to drive the pump: it needs a channel of "
            "the kind signed_current, current_plus and current_minus, or rectified_current."
        )
    channel, values = signed[0]
    made = InputSignal("current", "A", channel.time, scale * values, "linear", channel.source)
    return _record(made)


def simulated_current(
    experiment: Experiment,
    parameters: ParameterSet,
    start: Mapping[str, float] = MappingProxyType({}),
) -> Record:
    """The signed current that a card makes of an experiment's command, on the march's grid. [A]

    `start` are currents at the first sample that were estimated, by `START_CURRENTS`; without, the
    card begins at rest or settled, as the experiment does.
    """
    record = voltage_record(experiment)
    seen = Observation("current", record.points, np.zeros(record.values.size))
    observed = ObservedRecord(record, (seen,), "voltage", experiment.begins)
    # refinements begin behind the card
    ready = DriveModel(parameters.plain, "card").ready(start, experiment, Asked(observed))
    return replace(record, values=ready.residuals(observed))


def simulated_run(experiment: Experiment, parameters: ParameterSet) -> Simulation:
    """An experiment as a parameter set has it, whatever was measured.

    An `InputError` says that its input is neither a voltage nor a current, or cannot be marched, a
    `DomainError` that the model does not hold under it.
    """
    part: Part = "pump" if experiment.input.kind == "current" else "chain"
    try:
        driver, record, _ = DriveModel(parameters, part).driven(experiment)
        begin = experiment.begins, experiment.start_pressure
        return simulate_drive(parameters, {driver: record}, *begin)
    except InputError as error:
        raise InputError(f"{experiment.input.source}: {error}") from None


def limits_reached(experiment: Experiment, parameters: ParameterSet) -> set[str]:
    """Columns of the limits that act in a run, such as ``"Z16_plus"``, of Z13 to Z16."""
    run, found = simulated_run(experiment, parameters), set[str]()
    for limit, signal, symbol, _ in REACHED:
        acts = run.active(limit)
        sides = {"_plus": run[signal] > 0.0, "_minus": run[signal] < 0.0} if signal else {"": acts}
        found |= {symbol + side for side, there in sides.items() if (acts & there).any()}
    return found


def limits_unreached(
    experiments: Sequence[Experiment], parameters: ParameterSet
) -> dict[str, float]:
    """Columns of the limits that no run shows, and how far the runs went. [SI]

    Of Z13 to Z16, whether the model has such a limit or not: behind what was reached anything may
    lie. A run shows a limit if it would go beyond by `SHOWN` without it: what is merely touched a
    slightly smaller gain does as well. Errors are those of `simulated_run`.
    """
    limits = {column: parameters.numbers[column] for column in LIMIT_COLUMNS}
    eased = {c: EASED * limit for c, limit in limits.items() if isfinite(limit)}
    without, reached = parameters.with_numbers(eased), dict.fromkeys(LIMIT_COLUMNS, 0.0)
    for each in experiments:
        run = simulated_run(each, without)
        for column, (signal, sign) in LIMIT_COLUMNS.items():
            values = np.abs(run[signal]) if sign == 0.0 else sign * run[signal]
            reached[column] = max(reached[column], float(values.max()))
    return {
        column: min(value, limits[column])
        for column, value in reached.items()
        if value < SHOWN * limits[column]
    }


def smooth(parameters: Fitted) -> Fitted:
    """The set with the decay's switch split within the step; a model of one's own has none.

    Sampled, as published, it makes the current jump by up to 0.7 mA as any of the card's parameters
    varies, and a fit ends where it was caught (docs/decisions/0008).
    """
    if isinstance(parameters, ParameterSet):
        return replace(parameters, card_switch="split")
    return parameters


def with_card_filter(
    form: Literal["equation", "recursion"],
    experiments: Sequence[Experiment],
    parameters: ParameterSet,
) -> tuple[ParameterSet, tuple[str, ...]]:
    """A set with the card's filter in the form that is fitted, and a sentence if it needs one.

    ζ and ω of a recursion are not those of the card's filter: at 512 Hz the packaged ω differ by
    4 to 18 % (docs/theory/time-stepping.md).
    """
    if parameters.rate is None:
        return parameters, ()
    if form == "equation":
        return at_every_rate(parameters), ()
    fitted, changed = at_rate_of(experiments, parameters)
    if fitted.rate is None:
        return fitted, changed
    return fitted, (
        f"zeta, omega and C belong to a recursion at {fitted.rate:g} Hz, as the fit configuration "
        'asks for by card_filter = "recursion": they are not those of the card\'s filter, which '
        "`Drive.at_every_rate` gives.",
    )


def at_rate_of(
    experiments: Sequence[Experiment], parameters: ParameterSet
) -> tuple[ParameterSet, tuple[str, ...]]:
    """A set whose card's filter holds at the rate of the runs, and a sentence if it was changed.

    It then has the filter's differential equation, if a run is marched at another rate than the one
    that its recursion belongs to.
    """
    own, runs = parameters.rate, [each for each in experiments if each.input.kind == "voltage"]
    if own is None:
        return parameters, ()
    for each in runs:
        rate = 1.0 / voltage_record(each).step
        if abs(rate / own - 1.0) > OTHER_RATE:
            return at_every_rate(parameters), (
                f"{each.name} is simulated at {rate:.4g} Hz, but the card's filter of "
                f"{parameters.name} is a recursion for {own:g} Hz: the fit takes the "
                "differential equation with the same poles, which holds at every rate.",
            )
    return parameters, ()


# --- the model ------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class DriveModel(Result, EquationModel):
    """A drive whose parameters are the unknowns, by columns such as ``"Z16_plus"``.

    Besides columns it knows ``"force_plus_1"`` ... (see `Forces`), ``"start_pressure"`` of an
    experiment [Pa], ``"start_current_plus"`` or ``"..._minus"`` of its card [A], and the instants
    of the edges of its command, see `instants_of` [s].

    Derivatives are exact, those by refinements as well.
    """

    parameters: ParameterSet
    """Values of what is not unknown."""
    part: Part = "chain"
    currents: Mapping[str, Record] = field(default_factory=dict)
    """For the pump alone, signed currents by the experiments' names, if not as measured. [A]"""
    forces: Forces | None = None
    """The forces that stand for the solenoids' coefficients."""
    starts: Starts = field(default_factory=dict)
    """Currents at the first sample of simulated currents, see `simulated_current`."""

    def signals_of(self, experiment: Experiment) -> Mapping[str, str]:
        """Signal for each channel that this part of the drive gives."""
        kinds = kinds_of(self.part)
        channels = experiment.channels.items()
        return {name: SIGNALS[each.kind] for name, each in channels if each.kind in kinds}

    def driven(
        self, experiment: Experiment, values: Mapping[str, float] = MappingProxyType({})
    ) -> tuple[str, Record, Mapping[str, Array]]:
        """The experiment's voltage, or the current that drives the pump, measured if not given.

        With the edges of the command where `values` say.
        """
        moved = with_edges(experiment, values)
        if self.part != "pump":
            return "voltage", voltage_record(moved), {}
        given = self.currents.get(experiment.name)
        if moved is not experiment:
            given = simulated_current(moved, self.parameters, self.starts.get(moved.name, {}))
        return "current", measured_current(experiment) if given is None else given, {}

    def ready(self, values: Mapping[str, float], experiment: Experiment, asked: Asked) -> Ready:
        """The drive with numbers; see `EquationModel.ready`."""
        states = {
            state: values[name]
            for name in (START_PRESSURE, *START_CURRENTS)
            if name in values
            for state in self._states_started_by(name)
        }
        parameters, own = self.parameters_at(values), Own(states, asked.offsets)
        try:
            return made_ready(parameters, asked.observed, asked.columns, own)
        except InputError as error:  # a filter that is unstable at this step
            raise DomainError(str(error)) from None

    def moves(self, name: str) -> Mapping[str, float]:
        """Derivatives by a name of the columns that it moves: of coefficients by a force."""
        if self.forces is not None and name in self.forces.names:
            return self.forces.slopes(name)
        if states := self._states_started_by(name):
            return {f"{START}{state}": 1.0 for state in states}
        return {name: 1.0} if is_column(name) else {}

    def _states_started_by(self, name: str) -> list[str]:
        """Paths of the states that a pressure or a current at the first sample sets.

        A pump alone has no card that could begin with a current.
        """
        if name == START_PRESSURE:
            return [PRESSURE]
        if name not in START_CURRENTS or self.part == "pump":
            return []
        # I*, that of a sample before, and I; with the differential equation no sample before
        leaves = ("now", "out") if self.parameters.rate is None else ("now", "before", "out")
        return [f"{START_CURRENTS[name]}.{leaf}" for leaf in leaves]

    def instants_of(self, experiment: Experiment) -> Mapping[str, Edge]:
        """Edges of the command by the names of their instants; see `EquationModel.instants_of`."""
        return _instants_of(experiment.input)

    def parameters_at(self, values: Mapping[str, float]) -> ParameterSet:
        """The set for some values of the unknowns; a `DomainError` if one breaks a rule."""
        forces = () if self.forces is None else self.forces.names
        return _at(self, tuple((n, v) for n, v in values.items() if is_column(n) or n in forces))


@lru_cache(maxsize=8)
def _at(model: DriveModel, values: tuple[tuple[str, float], ...]) -> ParameterSet:
    """The set with values; runs of one evaluation share it, as checking its rules takes a while."""
    changes = {name: value for name, value in values if is_column(name)}
    if model.forces is not None:
        changes |= model.forces.coefficients(dict(values), model.parameters)
    try:
        # whatever the values, the equations stay those that the fit began with
        return model.parameters.with_numbers(changes, model.parameters.options)
    except ParameterError as error:
        raise DomainError(str(error)) from None


def with_edges(experiment: Experiment, values: Mapping[str, float]) -> Experiment:
    """An experiment with the edges of its command where values say."""
    command = experiment.input
    edges = _instants_of(command).items()
    late = {edge.place: values[name] for name, edge in edges if name in values}
    return replace(experiment, input=command.with_edges(late)) if late else experiment


def _instants_of(command: InputSignal) -> dict[str, Edge]:
    """Edges of a command by the names that a model has for their instants."""
    return {f"edge at {edge.middle:.6g} s": edge for edge in command.edges}


def _unknown_instants(run: Experiment, found: Instants) -> list[Unknown]:
    """Instants of a voltage's edges, anywhere between two samples or as an earlier stage found."""
    unknowns = list[Unknown]()
    edges = _instants_of(run.input) if run.input.kind == "voltage" else {}
    for name, edge in edges.items():
        most = 0.5 * (edge.apart + RISE)
        prior = found.get((run.name, name), Prior(0.0, edge.apart / sqrt(12.0)))
        unknown = Unknown(
            name,
            prior.mean,
            -most,
            most,
            "s",
            prior=prior,
            run=run.name,
            kind="instant",
            scale=edge.apart,
        )
        unknowns.append(unknown)
    return unknowns


def edges_problem(parameters: ParameterSet, run: Experiment) -> Problem | None:
    """The problem of the instants of a command's edges in a run that is predicted.

    One unit of residual is what the prediction errs by with all of them halfway, so that a drive
    that is wrong says little of them. None where there are no edges, or too many, or no
    channel of a drive.
    """
    model, edges = DriveModel(parameters), _unknown_instants(run, {})
    if not 0 < len(edges) <= MOST_EDGES or not model.signals_of(run):
        return None
    scales, zeros = dict[str, float](), list[Unknown]()
    for name, simulated in model.simulate({}, run).items():
        channel = run[name]
        errors, weight = channel.values - simulated, np.sqrt(channel.weight)
        if not channel.used.any():
            continue
        if channel.is_position:
            errors -= np.average(errors, weights=channel.weight)
            zeros.append(_free_zero(name, channel, run))
        scales[name] = float(np.linalg.norm(weight * errors) / np.linalg.norm(weight))
    scales = {name: scale for name, scale in scales.items() if scale > 0.0}
    if not scales:
        return None
    zeros = [zero for zero in zeros if zero.channel in scales]
    return Problem(model, (run,), Unknowns((*zeros, *edges)), tuple(scales), scales)


def _free_zero(name: str, channel: Channel, run: Experiment) -> Unknown:
    """Zero of a position, with bounds far enough both ways never to be reached."""
    first, reach = float(channel.values[0]), 1.0 + 10.0 * float(np.ptp(channel.values))
    ends = first - reach, first + reach
    return Unknown(
        zero_name(name), first, *ends, channel.unit, run=run.name, kind="zero", channel=name
    )


def kinds_of(part: str) -> tuple[ChannelKind, ...]:
    """Kinds of the channels that a part of the drive gives."""
    return tuple(k for k in SIGNALS if part == "chain" or (k in CURRENTS) == (part == "card"))


def true_value(unknown: Unknown, model: DriveModel, truth: ParameterSet) -> float | None:
    """What an unknown of the machine really is; None for one of a single experiment."""
    forces = model.forces.values(truth) if model.forces is not None else {}
    return {**truth.numbers, **forces}[unknown.targets[0]] if unknown.run is None else None


# --- from a stage of a fit configuration to its problem -------------------------------------------


def configuration(free: FreeParameters, experiments: Sequence[Experiment]) -> Setup:
    """A drive's fit configuration from any form that a caller may give it in.

    Parameters
    ----------
    free : Setup, str, path or mapping
        A fit configuration, a packaged one by name, a TOML file, or a mapping: the contents of such
        a file, or free parameters by symbol as of `setup.free_entries`. Those are estimated in one
        stage: of the card alone if currents were measured, of pump and motor alone, or through the
        whole chain if both are free or no current was measured.
    experiments : sequence of Experiment
        The runs to fit.

    Raises
    ------
    FileError, ParameterError
        If the configuration cannot be read, or an entry is wrong.
    """
    if isinstance(free, Setup):
        return _with_known_names(free, "the fit configuration")
    if isinstance(free, str | Path):
        return _with_known_names(load_setup(free), str(free))
    given: object = free
    if not isinstance(given, Mapping) or not given:
        raise InputError(
            f"What is free is {free!r}, but must be a fit configuration, its name or file, or a "
            "mapping such as {'Z8': (0.5, 2)}."
        )
    if "stages" in free:
        setup = validated(dict(free), Setup, "the fit configuration")
        return _with_known_names(setup, "the fit configuration")
    entries = free_entries(free)
    blocks = {"card" if find(name).block == "control_card" else "pump" for name in entries}
    kinds = {channel.kind for run in experiments for channel in run.channels.values()}
    part: Literal["card", "pump", "chain"] = "chain"
    if blocks == {"pump"}:
        part = "pump"
    elif blocks == {"card"} and not kinds.isdisjoint(CURRENTS):
        part = "card"
    return Setup(stages=(Stage(name=part, part=part, free=entries),))


def _with_known_names(setup: Setup, origin: str) -> Setup:
    """The fit configuration of a drive; a name in it that no parameter has is refused."""
    names = [
        (f"stage '{stage.name}', free", name)
        for stage in setup.stages
        if stage.part != "model"
        for name in stage.free
    ]
    names += [("standard_uncertainty", name) for name in setup.standard_uncertainty]
    for table, name in names:
        try:
            find(name)
        except UnknownParameterError as error:
            raise UnknownParameterError(f"{origin}, {table}: {error}") from None
    return setup


def setup_of(
    campaign: Campaign, axis: str, drive: ParameterSet, free: FreeParameters | None = None
) -> Setup:
    """The fit configuration of an axis.

    By default the packaged one of the drive that the campaign names, or else of the given one; an
    `InputError` if there is none. `free` as of `configuration`.
    """
    if free is not None:
        return configuration(free, campaign.select(axis=axis, role="fit"))
    name = drive.name if campaign.axes[axis].drive is None else campaign.drive(axis).name
    if name not in setup_names():
        raise InputError(
            f"There is no packaged fit configuration for the drive '{name}': give one of your "
            "own, a .toml file with stages and free parameters; 'swashplate guess' reads one off "
            "the logs."
        )
    return load_setup(name)


def stage_problem(
    stage: Stage,
    parameters: Parameters,
    experiments: Sequence[Experiment],
    *,
    threads: int | None = None,
    uncertain: Mapping[str, float | str] = MappingProxyType({}),
    starts: Starts = MappingProxyType({}),
    instants: Instants = MappingProxyType({}),
) -> Problem:
    """The problem of a stage, over the runs that have a channel of it.

    `parameters` are the nominal values, those of earlier stages already found; `uncertain` standard
    uncertainties of what stays fixed, as of `Setup`; `starts` and `instants` what a stage before
    estimated of currents at the first sample, see `start_currents_of`, and of edges. Threads are
    all cores by default. An `InputError` says that no run has what the stage fits or asks for, a
    `ParameterError` that a free parameter is unknown or its bounds are wrong.
    """
    threads = threads or available_cores()
    if isinstance(parameters, ModelSetup):
        return parameters.problem(experiments, threads=threads)
    if stage.part == "model":
        raise InputError("part = 'model' needs a model of your own, not a drive.")
    channels = _channels_of(stage, experiments)
    runs = tuple(each for each in experiments if any(name in each.channels for name in channels))
    currents = {}
    for each in runs if stage.part == "pump" else ():
        if stage.current == "measured" or each.input.kind == "current":
            currents[each.name] = measured_current(each, stage.current_scale)
        else:
            currents[each.name] = simulated_current(each, parameters, starts.get(each.name, {}))
    free = _of_the_machine(stage, parameters)
    begin = {column: each.start for each in free for column in each.targets if column in SWITCHES}
    on = parameters.options | {SWITCHES[column] for column in begin}
    begun = parameters.with_numbers(begin, on) if begin else parameters
    own = [unknown for each in runs for unknown in _of_a_run(stage, each, channels, parameters)]
    simulated = stage.part != "pump" or stage.current != "measured"
    jumps = [unknown for each in runs if simulated for unknown in _unknown_instants(each, instants)]
    return Problem(
        DriveModel(begun, stage.part, currents, stage.forces, dict(starts)),
        tuple(_weighted(each, stage) for each in runs),
        Unknowns((*free, *own, *(jumps if len(jumps) <= MOST_EDGES else ()))),
        channels,
        noise_scales(runs, channels),
        uncertain=tuple(
            {c: deviation(each, _nominal(parameters, c)) for c in columns_of([name])}
            for name, each in uncertain.items()
        ),
        threads=threads,
    )


def _channels_of(stage: Stage, experiments: Sequence[Experiment]) -> tuple[str, ...]:
    """Names of the channels that a stage fits; weights of others would be lost in silence."""
    kinds = stage.channels or kinds_of(stage.part)
    had = [(name, each.kind) for run in experiments for name, each in run.channels.items()]
    fitted = {kind for _, kind in had if kind in kinds}
    if not fitted:
        hint = ""
        if stage.part == "card":
            hint = "; without a current, let 'swashplate guess' write start and fit configuration"
        raise InputError(
            f"The stage '{stage.name}' fits {', '.join(kinds)}, but the runs to fit have "
            f"{', '.join(dict.fromkeys(kind for _, kind in had)) or 'no channel'}{hint}."
        )
    weighed = {**stage.weights, **stage.weights_by_input}
    if weighed and not fitted & set(weighed):
        raise InputError(
            f"The stage '{stage.name}' weighs {', '.join(weighed)}, but the runs have "
            f"{', '.join(sorted(fitted))}: add weights for that, or take a fit configuration "
            "without."
        )
    return tuple(dict.fromkeys(name for name, kind in had if kind in kinds))


def start_currents_of(problem: Problem, vector: Array) -> Starts:
    """Currents at the first sample that a stage estimated, by run; for the stages after it."""
    found: dict[str, dict[str, float]] = {}
    values = problem.unknowns.at(vector).estimates.tolist()
    for unknown, value in zip(problem.unknowns, values, strict=True):
        if unknown.run is not None and unknown.kind == "start current":
            found.setdefault(unknown.run, {})[unknown.name] = value
    return found


def with_estimates(parameters: Parameters, problem: Problem, vector: Array) -> Parameters:
    """The parameters with what a stage found; a `DomainError` if a value breaks a rule."""
    found = problem.unknowns.targets(vector, "")
    if isinstance(parameters, ModelSetup):
        return replace(parameters, numbers={**parameters.numbers, **found}, scales=problem.scales)
    assert isinstance(problem.model, DriveModel)
    return problem.model.parameters_at(found)


def _weighted(experiment: Experiment, stage: Stage) -> Experiment:
    """The experiment with the stage's own weights multiplied in."""
    if not stage.weights and not stage.weights_by_input:
        return experiment
    channels = {}
    for name, channel in experiment.channels.items():
        weight = channel.weight.copy()
        for window in applying(stage.weights.get(channel.kind, ()), experiment.maneuver):
            weight[inside(window, channel.time)] *= window.factor
        for sized in applying(stage.weights_by_input.get(channel.kind, ()), experiment.maneuver):
            within = inside(sized, channel.time)
            size = np.abs(experiment.input.at(channel.time[within]))
            weight[within] *= np.interp(size, *np.transpose(sized.factors))
        channels[name] = replace(channel, weight=weight)
    return replace(experiment, channels=channels)


def _of_the_machine(stage: Stage, parameters: ParameterSet) -> list[Unknown]:
    """Unknowns of the drive: free parameters, both directions apart unless tied, then forces."""
    unknowns: list[Unknown] = []
    for name, entry in stage.free.items():
        definition, columns = find(name), tuple(columns_of([name]))
        least = -np.inf if definition.least is None else definition.least
        how: Any = {"unit": definition.unit, "log": entry.log, "prior": entry.prior}
        for group in [columns] if entry.tied else [(each,) for each in columns]:
            nominal = float(np.mean([_nominal(parameters, column) for column in group]))
            own, bounds = name if entry.tied else group[0], (entry.relative, entry.bounds)
            unknown = bounded(own, nominal, *bounds, least, sets=group, **how)
            check_plausible(f"a bound of {own}", definition, unknown.low, unknown.high)
            if entry.prior is not None:
                check_plausible(f"the prior mean of {own}", definition, entry.prior.mean)
            unknowns.append(unknown)
    if stage.forces is not None:
        for name, value in stage.forces.values(parameters).items():
            log = value > 0.0
            force = bounded(name, value, stage.forces.relative, unit="N", log=log, kind="force")
            check_plausible(f"a bound of {name}", FORCE, force.low, force.high)
            unknowns.append(force)
    return unknowns


def _nominal(parameters: ParameterSet, column: str) -> float:
    """Where a parameter begins: a refinement that the set does not give, where it is off."""
    if column in parameters.numbers:
        return parameters.numbers[column]
    return parameters[column].values[0]


def _of_a_run(
    stage: Stage, experiment: Experiment, channels: Sequence[str], parameters: ParameterSet
) -> Iterator[Unknown]:
    """Unknowns of one experiment: free zeros of positions, pressure and current at the start."""
    own = {name: experiment.channels[name] for name in channels if name in experiment.channels}
    run, estimated = experiment.name, experiment.start == "estimated"
    for name, channel in own.items():
        if channel.is_position:
            yield _free_zero(name, channel, experiment)
    if stage.part != "card" and (stage.start_pressure is not None or estimated):
        most = stage.start_pressure or LARGEST_START_PRESSURE
        yield Unknown(START_PRESSURE, 0.0, -most, most, "Pa", run=run, kind="start pressure")
    measured = any(channel.kind in CURRENTS for channel in own.values())
    if estimated and measured and stage.part != "pump" and experiment.input.kind == "voltage":
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
