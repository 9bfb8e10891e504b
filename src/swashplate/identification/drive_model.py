"""The drive as a model to be fitted: card, pump or the whole chain; the problem of a stage."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import ChannelKind, applying, inside
from swashplate.campaign.campaign import Campaign
from swashplate.campaign.experiment import Channel, Experiment, InputSignal
from swashplate.campaign.samples import signed_by_command
from swashplate.campaign.schema import SIGNALS as SIGNALS
from swashplate.drive import Drive
from swashplate.equations.marching.observation import ObservedRecord, Own
from swashplate.equations.marching.record import SLOWEST, SOURCE_RATE, Record, even_rate, record_of
from swashplate.errors import DomainError, InputError, ParameterError
from swashplate.executors import available_cores
from swashplate.identification.model import EquationModel
from swashplate.identification.problem import Problem, noise_scales
from swashplate.identification.setup import (
    Forces,
    Free,
    ModelParameters,
    Setup,
    Stage,
    deviation,
    load_setup,
)
from swashplate.identification.unknowns import Prior, Unknown, Unknowns, bounded
from swashplate.parameters.definitions import SWITCHES, columns_of, find, is_column
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.results import Result
from swashplate.simulation.instance import START_PRESSURE, at_every_rate
from swashplate.simulation.residuals import Ready, made_ready
from swashplate.simulation.result import Limit, Simulation
from swashplate.simulation.run import check_voltage, simulate_drive

Array = NDArray[np.float64]

OTHER_RATE = 0.01
"""Part by which a rate must differ to be another one."""


def voltage_record(experiment: Experiment) -> Record:
    """An experiment's command on the march's grid.

    Raises
    ------
    InputError
        If its input is no voltage, or leaves the card's range.
    """
    if experiment.input.kind != "voltage":
        raise InputError(
            f"{experiment.name} is driven by a {experiment.input.kind}, not by a voltage: fit the "
            "pump alone."
        )
    return check_voltage(_record(experiment, "voltage"), clip=False)


def current_record(experiment: Experiment) -> Record:
    """An experiment's signed current, measured as its input, on the march's grid."""
    if experiment.input.kind != "current":
        raise InputError(f"{experiment.name} is not driven by a current.")
    return _record(experiment, "current")


def simulated_current(experiment: Experiment, parameters: ParameterSet) -> Record:
    """The signed current that a card makes of an experiment's command."""
    record = voltage_record(experiment)
    # refinements begin behind the card
    run = simulate_drive(parameters.plain, {"voltage": record}, experiment.begins)
    return replace(record, values=run.fine("current"))


def simulated_run(experiment: Experiment, parameters: ParameterSet) -> Simulation:
    """An experiment as a parameter set has it, whatever was measured.

    Raises
    ------
    InputError
        If the input is neither a voltage nor a current, or cannot be marched.
    DomainError
        If the model does not hold under it.
    """
    try:
        if experiment.input.kind == "current":
            records = {"current": current_record(experiment)}
        else:
            records = {"voltage": voltage_record(experiment)}
        return simulate_drive(parameters, records, experiment.begins, experiment.start_pressure)
    except InputError as error:
        raise InputError(f"{experiment.input.source}: {error}") from None


def limits_reached(experiment: Experiment, parameters: ParameterSet) -> set[str]:
    """Columns of the limits that act in a run, such as ``"Z16_plus"``, of Z13 to Z16."""
    run, found = simulated_run(experiment, parameters), set[str]()
    for limit, symbol, signal in (
        (Limit.SWASH_STOP, "Z13", run.swash_angle),
        (Limit.ORIFICE, "Z16", run.orifice_opening),
    ):
        acts = run.active(limit)
        found |= {f"{symbol}_plus"} if (acts & (signal > 0.0)).any() else set()
        found |= {f"{symbol}_minus"} if (acts & (signal < 0.0)).any() else set()
    found |= {"Z14"} if run.active(Limit.SPOOL).any() else set()
    return found | ({"Z15"} if run.active(Limit.RELIEF).any() else set())


def at_rate_of(
    experiments: Sequence[Experiment], parameters: ParameterSet
) -> tuple[ParameterSet, tuple[str, ...]]:
    """A set whose card's filter holds at the rate of the runs, and a sentence if it was changed.

    It then has the filter's differential equation, if a run is marched at another rate than the one
    that its recursion belongs to.
    """
    if parameters.rate is None:
        return parameters, ()
    driven = [each for each in experiments if each.input.kind == "voltage"]
    rates = {each.name: 1.0 / voltage_record(each).step for each in driven}
    for name, rate in rates.items():
        if abs(rate / parameters.rate - 1.0) > OTHER_RATE:
            return at_every_rate(parameters), (
                f"{name} is simulated at {rate:.4g} Hz, but the card's filter of {parameters.name} "
                f"is a recursion for {parameters.rate:g} Hz: the fit takes the differential "
                "equation with the same poles, which holds at every rate.",
            )
    return parameters, ()


def _record(experiment: Experiment, what: str) -> Record:
    """The input on a uniform grid, its own where its stamps are even."""
    time, values = experiment.input.time, experiment.input.values
    interpolation = experiment.input.interpolation
    rate = even_rate(time)
    if rate is not None and rate >= SLOWEST:
        own = record_of(values, rate, what=what, interpolation=interpolation)
        # the march joins the points of its grid by straight lines: of a command that is held, each
        # stands for the step after it
        held = 0.5 * own.step if interpolation == "previous" else 0.0
        return Record(own.values, float(time[0]) + held, own.rate, own.substeps)
    return record_of(values, SOURCE_RATE, what=what, time=time, interpolation=interpolation)


REST = 0.01
"""Share of the largest command below which it has no sign of its own. [1]"""


def measured_current(experiment: Experiment, scale: float = 1.0) -> Record:
    """The signed current that was measured, times a factor, on the march's grid. [A]

    Of an experiment driven by a current, or with a channel of it: signed, of both solenoids, or of
    one ammeter around both leads, which is given the command's sign. Positive towards positive
    speed.

    Raises
    ------
    InputError
        If no current was measured.
    """
    drive = experiment.input
    if drive.kind == "current":
        signed = replace(drive, values=scale * drive.values)
    else:
        channel, values = _signed_channel(experiment)
        signed = InputSignal("current", "A", channel.time, scale * values, "linear", channel.source)
    return current_record(replace(experiment, input=signed))


def _signed_channel(experiment: Experiment) -> tuple[Channel, Array]:
    """A measured current and its values with a sign. [A]"""
    for channel in experiment.of_kind("signed_current"):
        return channel, channel.values
    both = zip(
        experiment.of_kind("current_plus"), experiment.of_kind("current_minus"), strict=False
    )
    for plus, minus in both:
        return plus, plus.values - np.interp(plus.time, minus.time, minus.values)
    for channel in experiment.of_kind("rectified_current"):
        command = experiment.input.at(channel.time)
        # noise about zero leaves readings just below it, and a command at rest without a sign
        readings = np.maximum(channel.values, 0.0)
        level = REST * float(np.abs(command).max())
        return channel, signed_by_command(readings, command, level=level)
    raise InputError(
        f"{experiment.name} has no measured current to drive the pump: it needs a channel of the "
        "kind signed_current, current_plus and current_minus, or rectified_current."
    )


Part = Literal["card", "pump", "chain"]
"""What of the drive is simulated: the card alone, pump and motor over a current, or all."""

CURRENTS: tuple[ChannelKind, ...] = (
    "signed_current",
    "rectified_current",
    "current_plus",
    "current_minus",
)


START_CURRENTS = ("start_current_plus", "start_current_minus")
"""Names of a channel's current at the first sample, where it is an unknown of the experiment."""


@dataclass(frozen=True, eq=False)
class DriveModel(Result, EquationModel):
    """A drive whose parameters are the unknowns, by columns such as ``"Z16_plus"``.

    Besides columns it knows ``"force_plus_1"`` ... (see `Forces`), ``"start_pressure"`` of an
    experiment [Pa], ``"start_current_plus"`` or ``"..._minus"`` of its card [A], and of each
    channel ``"offset NAME"``, its free zero.

    Derivatives are exact, those by refinements as well.
    """

    parameters: ParameterSet
    """Values of what is not unknown."""
    part: Part = "chain"
    currents: Mapping[str, Record] = field(default_factory=dict)
    """For the pump alone, the signed current of each experiment by its name. [A]"""
    forces: Forces | None = None
    """The forces that stand for the solenoids' coefficients."""
    _last: dict[str, tuple[tuple[tuple[str, float], ...], ParameterSet]] = field(
        default_factory=dict, repr=False, init=False
    )

    def __getstate__(self) -> dict[str, object]:
        """Without what can be made again."""
        return {**super().__getstate__(), "_last": {}}

    def signals_of(self, experiment: Experiment) -> Mapping[str, str]:
        """Signal for each channel that this part of the drive gives."""
        return {
            name: SIGNALS[channel.kind]
            for name, channel in experiment.channels.items()
            if channel.kind in SIGNALS
            and (self.part == "chain" or (channel.kind in CURRENTS) == (self.part == "card"))
        }

    def driven(self, experiment: Experiment) -> tuple[str, Record, Mapping[str, Array]]:
        """The experiment's voltage, or the current that drives the pump."""
        if self.part != "pump":
            return "voltage", voltage_record(experiment), {}
        if experiment.name not in self.currents:
            raise InputError(f"{experiment.name} has no current to drive the pump.")
        return "current", self.currents[experiment.name], {}

    def ready(
        self,
        values: Mapping[str, float],
        experiment: Experiment,
        observed: ObservedRecord,
        columns: Sequence[str],
        offsets: Sequence[float],
    ) -> Ready:
        """The drive with numbers; see `EquationModel.ready`."""
        states = {
            path.removeprefix("start."): values[name]
            for name in START_CURRENTS
            if name in values
            for path in self._start_paths(name)
        }
        if START_PRESSURE in values:
            states[START_PRESSURE] = values[START_PRESSURE]
        own = Own(states, offsets)
        try:
            return made_ready(self.parameters_at(values), observed, columns, own)
        except InputError as error:  # a filter that is unstable at this step
            raise DomainError(str(error)) from None

    def moves(self, name: str) -> Mapping[str, float]:
        """Derivatives by a name of the columns that it moves: of coefficients by a force."""
        if self.forces is not None and name in self.forces.names:
            return self.forces.slopes(name)
        if name in START_CURRENTS:
            return dict.fromkeys(self._start_paths(name), 1.0)
        known = is_column(name) or name == START_PRESSURE
        return {name: 1.0} if known else {}

    def _start_paths(self, name: str) -> list[str]:
        """States that a current at the first sample sets: I*, that of a sample before, and I."""
        side = name.removeprefix("start_current_")
        # with the differential equation the second number is a rate
        leaves = ("now", "out") if self.parameters.rate is None else ("now", "before", "out")
        return [f"start.card.{side}.{leaf}" for leaf in leaves]

    def parameters_at(self, values: Mapping[str, float]) -> ParameterSet:
        """The parameter set for some values of the unknowns.

        Raises
        ------
        DomainError
            If a value breaks a rule.
        """
        own = {name: value for name, value in values.items() if self._is_parameter(name)}
        key = tuple(own.items())
        # runs of one evaluation share their parameters, and checking a set takes a while
        last = self._last.get("set")
        if last is not None and last[0] == key:
            return last[1]
        changes = {name: v for name, v in own.items() if is_column(name)}
        if self.forces is not None:
            changes |= self.forces.coefficients(own, self.parameters)
        try:
            # whatever the values, the equations stay those that the fit began with
            made = self.parameters.replace(changes, self.parameters.options)
        except ParameterError as error:
            raise DomainError(str(error)) from None
        self._last["set"] = (key, made)
        return made

    def _is_parameter(self, name: str) -> bool:
        known = is_column(name)
        return known or (self.forces is not None and name in self.forces.names)


# --- from a stage of a fit configuration to its problem -------------------------------------------


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
    weighed = [*stage.weights, *stage.weights_by_input]
    kinds = {c.kind for each in runs for name, c in each.channels.items() if name in channels}
    if weighed and not kinds & set(weighed):  # they would be lost in silence
        raise InputError(
            f"The stage '{stage.name}' weighs {', '.join(dict.fromkeys(weighed))}, but the runs "
            f"have {', '.join(sorted(kinds))}: add weights for that, or take a fit "
            "configuration without."
        )
    of_forces = []
    if stage.forces is not None:
        of_forces = [
            bounded(name, value, relative=stage.forces.relative, unit="N", log=value > 0.0)
            for name, value in stage.forces.values(parameters).items()
        ]
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
        *of_forces,
        *_own(stage, runs, channels, parameters),
    )
    return Problem(
        DriveModel(_switched_on(parameters, free), stage.part, currents, stage.forces),
        tuple(weighted(each, stage) for each in runs),
        Unknowns(unknowns),
        channels,
        noise_scales(runs, channels),
        uncertain=tuple(
            {c: deviation(each, _nominal(parameters, c)) for c in columns_of([name])}
            for name, each in uncertain.items()
        ),
        threads=threads or available_cores(),
    )


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


def true_value(unknown: Unknown, model: DriveModel, truth: ParameterSet) -> float | None:
    """What an unknown of the machine really is; None for one of a single experiment."""
    if unknown.run is not None:
        return None
    forces = model.forces.values(truth) if model.forces is not None else {}
    return {**truth.numbers, **forces}[unknown.targets[0]]
