"""The drive as a model to be fitted: card, pump and motor, or the whole chain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import ChannelKind
from swashplate.campaign.experiment import Channel, Experiment, InputSignal
from swashplate.campaign.samples import signed_by_command
from swashplate.equations.marching.observation import ObservedRecord
from swashplate.equations.marching.record import SLOWEST, SOURCE_RATE, Record, even_rate, record_of
from swashplate.errors import DomainError, InputError, ParameterError
from swashplate.identification.model import EquationModel
from swashplate.parameters.definitions import is_column
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.results import Result
from swashplate.simulation.instance import START_PRESSURE, at_every_rate
from swashplate.simulation.residuals import Own, Ready, made_ready
from swashplate.simulation.result import Limit, Simulation
from swashplate.simulation.run import check_voltage, simulate_drive, simulate_pump

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
    run = simulate_drive(parameters.plain, record, experiment.begins)
    return Record(run.fine("current"), record.start, record.rate, record.substeps)


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


SYMBOLS = ("Z19", "Z20", "Z21", "Z22")


@dataclass(frozen=True)
class Forces:
    """Forces at four effective currents each way, as magnitudes.

    ``"force_plus_1"`` is the force at the first of `plus`; the effective current is what is left
    of the current beyond the dead zone Z17.
    """

    plus: tuple[float, float, float, float]
    """Effective currents of the positive direction, increasing. [A]"""
    minus: tuple[float, float, float, float]
    """Of the negative direction, as magnitudes. [A]"""

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the eight forces."""
        return tuple(f"force_{side}_{k}" for side in ("plus", "minus") for k in (1, 2, 3, 4))

    @property
    def columns(self) -> tuple[str, ...]:
        """The parameters that they stand for."""
        return tuple(f"{symbol}_{side}" for side in ("plus", "minus") for symbol in SYMBOLS)

    @cached_property
    def _maps(self) -> dict[str, Array]:
        """For each direction the (4, 4) map from forces to coefficients."""
        signs = {"plus": np.ones(4), "minus": np.array([1.0, -1.0, 1.0, -1.0])}
        return {
            side: np.linalg.inv(
                np.power.outer(np.array(getattr(self, side)), np.arange(1, 5)) * signs[side]
            )
            for side in ("plus", "minus")
        }

    def values(self, parameters: ParameterSet) -> dict[str, float]:
        """The forces of a parameter set, by name. [N]"""
        forces = {}
        for side, map_ in self._maps.items():
            coefficients = [parameters.numbers[f"{symbol}_{side}"] for symbol in SYMBOLS]
            for k, force in enumerate(np.linalg.solve(map_, coefficients), start=1):
                forces[f"force_{side}_{k}"] = float(force)
        return forces

    def coefficients(
        self, values: Mapping[str, float], parameters: ParameterSet
    ) -> dict[str, float]:
        """Coefficients for some forces; those not named are as in the parameter set. [N/Aᵏ]"""
        forces = {**self.values(parameters), **{k: v for k, v in values.items() if k in self.names}}
        made = {}
        for side, map_ in self._maps.items():
            of_side = np.array([forces[f"force_{side}_{k}"] for k in (1, 2, 3, 4)])
            for symbol, coefficient in zip(SYMBOLS, map_ @ of_side, strict=True):
                made[f"{symbol}_{side}"] = float(coefficient)
        return made

    def slopes(self, name: str) -> dict[str, float]:
        """Derivatives of the coefficients by one force. [1/Aᵏ]"""
        _, side, number = name.split("_")
        column = self._maps[side][:, int(number) - 1]
        return {
            f"{symbol}_{side}": float(slope) for symbol, slope in zip(SYMBOLS, column, strict=True)
        }


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

SIGNALS: Mapping[ChannelKind, str] = {
    "signed_current": "current",
    "rectified_current": "current_sum",
    "current_plus": "current_positive",
    "current_minus": "current_negative",
    "shaft_speed": "shaft_speed",
    "position": "shaft_position",
    "encoder_counts": "shaft_position",
    "stroker_pressure": "stroker_pressure",
    "swash_angle": "swash_angle",
    "spool_position": "spool_position",
}
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
    channel ``"offset NAME"`` (its free zero) and ``"clock NAME"`` (by how much the input's clock
    is ahead of the channel's [s]).

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
        shifts: tuple[Sequence[float], Sequence[float]],
    ) -> Ready:
        """The drive with numbers; see `EquationModel.ready`."""
        states = {
            path.removeprefix("start."): values[name]
            for name in START_CURRENTS
            if name in values
            for path in self._start_paths(name)
        }
        own = Own(values.get(START_PRESSURE), *shifts, states)
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
