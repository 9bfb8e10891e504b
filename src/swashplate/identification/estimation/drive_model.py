"""The drive as a model to be fitted: card, pump or the whole chain, and what drives a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import isfinite, sqrt
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import CURRENTS as CURRENTS
from swashplate.campaign import (
    JUMP_TIME,
    LARGEST_CERTAIN_INTERVAL,
    SIGNALS,
    Channel,
    ChannelKind,
    CommandJump,
    Experiment,
    InputSignal,
    signed_by_command,
)
from swashplate.drive import (
    PRESSURE_PATH,
    START,
    Limit,
    Simulation,
    at_every_rate,
    bound_drive,
    simulate_drive,
)
from swashplate.errors import DomainError, InputError, ParameterError
from swashplate.identification.estimation.model import EquationModel, SimulationRequest
from swashplate.identification.estimation.problem import Problem
from swashplate.identification.estimation.setup import Forces
from swashplate.identification.estimation.unknowns import Prior, Unknown, Unknowns, zero_name
from swashplate.machine.marching import (
    SLOWEST,
    SOURCE_RATE,
    BoundModel,
    Interpolation,
    Observation,
    ObservedRecord,
    Record,
    RunValues,
    even_rate,
    record_of,
    within_range,
)
from swashplate.models.drive import drive as drive_equations
from swashplate.parameters import ParameterSet
from swashplate.results import Result

Array = NDArray[np.float64]
DrivePart = Literal["card", "pump", "chain"]
"""What of the drive is simulated: the card alone, pump and motor over a current, or all."""

START_PRESSURE = "start_pressure"
"""Name of δP at the first sample, where it is an unknown of the experiment."""
START_CURRENTS = {"start_current_plus": "card.plus", "start_current_minus": "card.minus"}
"""Names of a channel's current at the first sample, where it is an unknown of the experiment, and
the part of the model that it belongs to."""
MOST_EDGES = 60
"""Jumps of commands whose instants are estimated; more are taken halfway between their samples."""
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
LIMITS = {symbol: words for _, _, symbol, words in sorted(REACHED, key=lambda zone: zone[2])}
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


def _gridded(signal: InputSignal) -> Record:
    """A signal on the march's grid, which is its own grid if its stamps are even.

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
    half_step = 0.5 * record.step if signal.is_held else 0.0
    return replace(record, start=float(signal.time[0]) + half_step)


def _jumps_at_once(signal: InputSignal, *, even: bool) -> bool:
    """Whether a signal changes suddenly, and not along straight lines between its samples.

    Not of a slow log, in which the instants of these are estimated.
    """
    if signal.interpolation == "linear" or (signal.is_held and not even):
        return False
    jumps = signal.jumps
    return bool(jumps.size) and float(np.diff(signal.time)[jumps].max()) <= LARGEST_CERTAIN_INTERVAL


def voltage_record(experiment: Experiment) -> Record:
    """An experiment's command on the march's grid; refused unless it is a voltage in the range."""
    if experiment.input.kind != "voltage":
        raise InputError(
            f"{experiment.name} is driven by a {experiment.input.kind}, not by a voltage: fit the "
            "pump alone."
        )
    return within_range(drive_equations, "voltage", _gridded(experiment.input))


def measured_current(experiment: Experiment, scale: float = 1.0) -> Record:
    """The signed current that was measured, times a factor, on the march's grid. [A]

    Of an experiment driven by a current, or with a channel of it: signed, of both solenoids, or of
    one ammeter around both leads, which is given the command's sign. Positive towards positive
    speed. An `InputError` says that no current was measured.
    """
    drive = experiment.input
    if drive.kind == "current":
        return _gridded(replace(drive, values=scale * drive.values))
    signed = [(channel, channel.values) for channel in experiment.of_kind("signed_current")]
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
    current = InputSignal("current", "A", channel.time, scale * values, "linear", channel.source)
    return _gridded(current)


def simulated_current(experiment: Experiment, parameters: ParameterSet) -> Record:
    """The signed current that a card makes of an experiment's command, on the march's grid. [A]

    The card begins at rest or settled, as the experiment does.
    """
    record = voltage_record(experiment)
    observation = Observation("current", record.points, np.zeros(record.values.size))
    observed = ObservedRecord(record, (observation,), "voltage", experiment.begins)
    # refinements begin downstream of the card
    ready = DriveModel(parameters.plain, "card").ready({}, experiment, SimulationRequest(observed))
    return replace(record, values=ready.residuals(observed))


def simulated_run(experiment: Experiment, parameters: ParameterSet) -> Simulation:
    """An experiment as a parameter set has it, whatever was measured.

    An `InputError` says that its input is neither a voltage nor a current, or cannot be marched, a
    `DomainError` that the model does not hold under it.
    """
    part: DrivePart = "pump" if experiment.input.kind == "current" else "chain"
    try:
        driver, record, _ = DriveModel(parameters, part).driven(experiment)
        return simulate_drive(
            parameters, {driver: record}, experiment.begins, experiment.start_pressure
        )
    except InputError as error:
        raise InputError(f"{experiment.input.source}: {error}") from None


def limits_reached(experiment: Experiment, parameters: ParameterSet) -> set[str]:
    """Columns of the limits that act in a run, such as ``"Z16_plus"``, of Z13 to Z16."""
    run = simulated_run(experiment, parameters)
    columns = set[str]()
    for limit, signal, symbol, _ in REACHED:
        acts = run.active(limit)
        sides = {"": acts}
        if signal:
            sides = {"_plus": run[signal] > 0.0, "_minus": run[signal] < 0.0}
        for side, is_on_side in sides.items():
            if (acts & is_on_side).any():
                columns.add(symbol + side)
    return columns


def limits_unreached(
    experiments: Sequence[Experiment], parameters: ParameterSet
) -> dict[str, float]:
    """Columns of the limits that no run shows, and how far the runs went. [SI]

    Of Z13 to Z16, whether the model has such a limit or not: beyond what was reached anything may
    lie. A run shows a limit if it would go beyond by `SHOWN` without it: what is merely touched a
    slightly smaller gain does as well. Errors are those of `simulated_run`.
    """
    limits = {column: parameters.numbers[column] for column in LIMIT_COLUMNS}
    eased = {c: EASED * limit for c, limit in limits.items() if isfinite(limit)}
    without, reached = parameters.with_numbers(eased), dict.fromkeys(LIMIT_COLUMNS, 0.0)
    for experiment in experiments:
        run = simulated_run(experiment, without)
        for column, (signal, sign) in LIMIT_COLUMNS.items():
            values = np.abs(run[signal]) if sign == 0.0 else sign * run[signal]
            reached[column] = max(reached[column], float(values.max()))
    return {
        column: min(value, limits[column])
        for column, value in reached.items()
        if value < SHOWN * limits[column]
    }


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
        f"zeta, omega and C belong to a recursion at {fitted.rate:g} Hz, as the fit setup "
        'requires by card_filter = "recursion": they are not those of the card\'s filter, which '
        "`Drive.at_every_rate` gives.",
    )


def at_rate_of(
    experiments: Sequence[Experiment], parameters: ParameterSet
) -> tuple[ParameterSet, tuple[str, ...]]:
    """A set whose card's filter holds at the rate of the runs, and a sentence if it was changed.

    It then has the filter's differential equation, if a run is marched at another rate than the one
    that its recursion belongs to.
    """
    recursion_rate = parameters.rate
    if recursion_rate is None:
        return parameters, ()
    for run in experiments:
        if run.input.kind != "voltage":
            continue
        rate = 1.0 / voltage_record(run).step
        if abs(rate / recursion_rate - 1.0) > OTHER_RATE:
            return at_every_rate(parameters), (
                f"{run.name} is simulated at {rate:.4g} Hz, but the card's filter of "
                f"{parameters.name} is a recursion for {recursion_rate:g} Hz: the fit takes the "
                "differential equation with the same poles, which is valid at every rate.",
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
    part: DrivePart = "chain"
    currents: Mapping[str, Record] = field(default_factory=dict)
    """For the pump alone, signed currents by the experiments' names, if not as measured. [A]"""
    forces: Forces | None = None
    """The forces that stand for the solenoids' coefficients."""

    def signals_of(self, experiment: Experiment) -> Mapping[str, str]:
        """Signal for each channel that this part of the drive gives."""
        kinds = kinds_of(self._part_of(experiment))
        channels = experiment.channels.items()
        return {name: SIGNALS[channel.kind] for name, channel in channels if channel.kind in kinds}

    def driven(
        self, experiment: Experiment, values: Mapping[str, float] = MappingProxyType({})
    ) -> tuple[str, Record, Mapping[str, Array]]:
        """The experiment's voltage, or the current that drives the pump, measured if not given.

        With the edges of the command where `values` say.
        """
        with_instants = with_edges(experiment, values)
        if self._part_of(experiment) != "pump":
            return "voltage", voltage_record(with_instants), {}
        given = self.currents.get(experiment.name)
        if with_instants is not experiment:
            given = simulated_current(with_instants, self.parameters)
        return "current", measured_current(experiment) if given is None else given, {}

    def _part_of(self, experiment: Experiment) -> DrivePart:
        """What an experiment drives: of the whole drive only the pump if a current drives it."""
        by_current = self.part == "chain" and experiment.input.kind == "current"
        return "pump" if by_current else self.part

    def ready(
        self, values: Mapping[str, float], experiment: Experiment, request: SimulationRequest
    ) -> BoundModel:
        """The drive with numbers; see `EquationModel.ready`."""
        states = {
            state: values[name]
            for name in (START_PRESSURE, *START_CURRENTS)
            if name in values
            for state in self._states_started_by(name)
        }
        parameters = self.parameters_at(values)
        run_values = RunValues(states, request.offsets)
        try:
            return bound_drive(parameters, request.observed, request.columns, run_values)
        except InputError as error:  # a filter that is unstable at this step
            raise DomainError(str(error)) from None

    def moves(self, name: str) -> Mapping[str, float]:
        """Derivatives by a name of the columns that it moves: of coefficients by a force."""
        if self.forces is not None and name in self.forces.names:
            return self.forces.slopes(name)
        if states := self._states_started_by(name):
            return {f"{START}{state}": 1.0 for state in states}
        return {name: 1.0} if name in self.parameters.definitions.columns else {}

    def _states_started_by(self, name: str) -> list[str]:
        """Paths of the states that a pressure or a current at the first sample sets.

        A pump alone has no card that could begin with a current.
        """
        if name == START_PRESSURE:
            return [PRESSURE_PATH]
        if name not in START_CURRENTS or self.part == "pump":
            return []
        # I*, that of a sample before, and I; with the differential equation no sample before
        leaves = ("now", "out") if self.parameters.rate is None else ("now", "before", "out")
        return [f"{START_CURRENTS[name]}.{leaf}" for leaf in leaves]

    def instants_of(self, experiment: Experiment) -> Mapping[str, CommandJump]:
        """Edges of the command by the names of their instants; see `EquationModel.instants_of`."""
        return _instants_of(experiment.input)

    def parameters_at(self, values: Mapping[str, float]) -> ParameterSet:
        """The set for some values of the unknowns; a `DomainError` if one breaks a rule."""
        forces = () if self.forces is None else self.forces.names
        set_names = {*self.parameters.definitions.columns, *forces}
        return _at(
            self, tuple((name, value) for name, value in values.items() if name in set_names)
        )


@lru_cache(maxsize=8)
def _at(model: DriveModel, values: tuple[tuple[str, float], ...]) -> ParameterSet:
    """The set with values; runs of one evaluation share it, as checking its rules takes a while."""
    columns = model.parameters.definitions.columns
    changes = {name: value for name, value in values if name in columns}
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
    late = {edge.row: values[name] for name, edge in edges if name in values}
    return replace(experiment, input=command.with_edges(late)) if late else experiment


def _instants_of(command: InputSignal) -> dict[str, CommandJump]:
    """Edges of a command by the names that a model has for their instants."""
    return {f"edge at {edge.middle:.6g} s": edge for edge in command.edges}


def unknown_instants(run: Experiment) -> list[Unknown]:
    """Instants of a voltage's edges, each anywhere between two samples."""
    unknowns = list[Unknown]()
    edges = _instants_of(run.input) if run.input.kind == "voltage" else {}
    for name, edge in edges.items():
        most = 0.5 * (edge.interval + JUMP_TIME)
        prior = Prior(0.0, edge.interval / sqrt(12.0))
        unknown = Unknown(
            name,
            prior.mean,
            -most,
            most,
            "s",
            prior=prior,
            run=run.name,
            kind="instant",
            scale=edge.interval,
        )
        unknowns.append(unknown)
    return unknowns


def edges_problem(parameters: ParameterSet, run: Experiment) -> Problem | None:
    """The problem of the instants of a command's edges in a run that is predicted.

    One unit of residual is what the prediction errs by with all of them halfway, so that a drive
    that is wrong says little of them. None where there are no edges, or too many, or no
    channel of a drive.
    """
    model, edges = DriveModel(parameters), unknown_instants(run)
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
            zeros.append(free_zero(name, channel, run))
        scales[name] = float(np.linalg.norm(weight * errors) / np.linalg.norm(weight))
    scales = {name: scale for name, scale in scales.items() if scale > 0.0}
    if not scales:
        return None
    zeros = [zero for zero in zeros if zero.channel in scales]
    return Problem(model, (run,), Unknowns((*zeros, *edges)), tuple(scales), scales)


def free_zero(name: str, channel: Channel, run: Experiment) -> Unknown:
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
    """True value of an unknown, known for virtual tests.

    Parameters
    ----------
    unknown : Unknown
        Of the model's problem: a parameter, or a force of the solenoids.
    model : DriveModel
        The fitted model.
    truth : ParameterSet
        What the tests were simulated with.

    Returns
    -------
    float or None
        In the unit of the unknown [SI]; None for an unknown of a single experiment.
    """
    forces = model.forces.values(truth) if model.forces is not None else {}
    return {**truth.numbers, **forces}[unknown.targets[0]] if unknown.run is None else None
