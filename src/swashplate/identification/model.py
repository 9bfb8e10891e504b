"""Models as a fit sees them: what any must do, and models of equations with exact derivatives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.experiment import Experiment
from swashplate.equations import Model as Equations
from swashplate.equations import instance_of, parameter_paths, state_paths
from swashplate.equations.fields import made, numbers_of
from swashplate.equations.marching.jacobian import jacobian, residuals, triangle
from swashplate.equations.marching.layout import started_by
from swashplate.equations.marching.march import output_of
from swashplate.equations.marching.observation import Observation, ObservedRecord
from swashplate.equations.marching.observation import Own as EngineOwn
from swashplate.equations.marching.record import Record, even_rate, gridded
from swashplate.errors import DomainError, InputError
from swashplate.results import Result, short
from swashplate.simulation.residuals import Ready

Array = NDArray[np.float64]


class Model(Protocol):
    """A model of the machine; with `simulate` alone it is differentiated by central differences.

    Examples
    --------
    >>> class Lag:
    ...     def simulate(self, values, experiment):
    ...         speed = values["gain"] * filtered(experiment.input, values["time constant"])
    ...         return {"speed": np.interp(experiment["speed"].time, experiment.input.time, speed)}
    """

    def simulate(self, values: Mapping[str, float], experiment: Experiment) -> Mapping[str, Array]:
        """Simulate what an experiment measured.

        Parameters
        ----------
        values : mapping
            The unknowns by name, in their units.
        experiment : Experiment
            Its input drives the model; the model does not look at what was measured.

        Returns
        -------
        mapping of str to (m,) array
            For each channel that the model has, its samples at the channel's time stamps, SI.

        Raises
        ------
        DomainError
            If the model does not hold for these values; the fit takes the step back.
        """
        ...


class Linearised(NamedTuple):
    """A channel's simulated samples and their derivatives."""

    def __repr__(self) -> str:
        return short(self)

    values: Array
    """(m,)"""
    by: Array
    """(m, k) derivatives by the names asked for, in their order."""


@runtime_checkable
class Differentiable(Protocol):
    """A model that knows its derivatives."""

    def linearise(
        self, values: Mapping[str, float], experiment: Experiment, names: Sequence[str]
    ) -> Mapping[str, Linearised]:
        """Simulate with derivatives by some of the unknowns; otherwise as `Model.simulate`."""
        ...


RELATIVE_STEP = 1e-6
"""Step of the central differences, in units of each number's size."""


def linearised(
    model: Model, values: Mapping[str, float], experiment: Experiment, names: Sequence[str]
) -> Mapping[str, Linearised]:
    """Simulation with derivatives: the model's own, or central differences.

    Parameters
    ----------
    model : Model
        With or without `linearise`.
    values, experiment, names :
        As in `Differentiable.linearise`.

    Raises
    ------
    DomainError
        If the model does not hold there, or yields a number that is not finite.
    InputError
        If it returns something else than it must.
    """
    if isinstance(model, Differentiable):
        made = model.linearise(values, experiment, names)
        _check(made, experiment, "linearise", "a Linearised", (len(names),))
        return made
    middle = simulated(model, values, experiment)
    columns: dict[str, list[Array]] = {channel: [] for channel in middle}
    for name in names:
        step = RELATIVE_STEP * max(abs(values[name]), 1e-3)
        above = simulated(model, {**values, name: values[name] + step}, experiment)
        below = simulated(model, {**values, name: values[name] - step}, experiment)
        for channel, column in columns.items():
            column.append((above[channel] - below[channel]) / (2.0 * step))
    return {
        channel: Linearised(
            middle[channel],
            np.column_stack(column) if column else np.zeros((middle[channel].size, 0)),
        )
        for channel, column in columns.items()
    }


def simulated(
    model: Model, values: Mapping[str, float], experiment: Experiment
) -> Mapping[str, Array]:
    """What a model simulates, checked.

    Raises
    ------
    DomainError
        If a number is not finite.
    InputError
        If what it returns is no array of real numbers for each channel, one a sample.
    """
    outputs = model.simulate(values, experiment)
    _check(outputs, experiment, "simulate", "an array of floats")
    for name, output in outputs.items():
        if not np.isfinite(output).all():
            row = int(np.argmax(~np.isfinite(output)))
            raise DomainError(
                f"{experiment.name}: the model gives {output[row]} for {name} at "
                f"{experiment[name].time[row]:g} s."
            )
    return outputs


def _check(
    made: object,
    experiment: Experiment,
    method: str,
    each: str,
    names: tuple[int, ...] | None = None,
) -> None:
    """Refuse what a model must not return; with `names`, of a Linearised by so many."""

    def refused(must: str, other: object) -> InputError:
        said = f"a {type(other).__name__}"
        if other is None:
            said = "None (is a return missing?)"
        elif isinstance(other, np.ndarray):
            said = f"an array of {other.dtype.name}"
        return InputError(f"{experiment.name}: {method} must return {must}, not {said}.")

    if not isinstance(made, Mapping):
        first = next(iter(experiment.channels), "speed")
        raise refused(f"a mapping of channel names to {each}, such as {{'{first}': ...}}", made)
    for name, part in made.items():
        if names is not None and not isinstance(part, Linearised):
            raise refused(f"a Linearised for {name}", part)
        size = experiment[name].time.shape
        arrays = [(part, size)] if names is None else [(part.values, size), (part.by, size + names)]
        for array, shape in arrays:
            if not isinstance(array, np.ndarray) or array.dtype.kind not in "fiu":
                raise refused(f"a NumPy array of real numbers for {name}", array)
            if array.shape != shape:
                columns = "" if len(shape) == 1 else ", and a column for each name asked for"
                raise InputError(
                    f"{experiment.name}: {method} returns an array of shape {array.shape} for "
                    f"{name}, but must return {shape}: a row for each of the channel's own time "
                    f"stamps{columns}."
                )


def refused_channel(experiment: Experiment, name: str, known: Collection[str]) -> InputError:
    """What to say of a channel that the model does not give."""
    return InputError(
        f"{experiment.name}: the model gives no '{name}'; it gives {', '.join(known)}."
    )


OFFSET = "offset "
"""What the name of a channel's free zero begins with."""
_Key = tuple[int, tuple[int, ...], tuple[str, ...]]


@dataclass(frozen=True, eq=False)
class EquationModel(ABC):
    """What every model of equations has in common; see `OwnModel` and `DriveModel`.

    Besides its own names it knows ``"offset NAME"`` of each channel.
    """

    _observed: dict[_Key, tuple[object, ObservedRecord]] = field(
        default_factory=dict, repr=False, init=False
    )
    _chains: dict[tuple[int, tuple[str, ...]], tuple[object, tuple[list[str], Array]]] = field(
        default_factory=dict, repr=False, init=False
    )

    def __getstate__(self) -> dict[str, object]:
        """Without what can be made again."""
        return {**self.__dict__, "_observed": {}, "_chains": {}}

    @abstractmethod
    def signals_of(self, experiment: Experiment) -> Mapping[str, str]:
        """Signal of the model for each channel that it gives."""

    @abstractmethod
    def driven(self, experiment: Experiment) -> tuple[str, Record, Mapping[str, Array]]:
        """Signal that drives the model, its record, and other external signals on its grid."""

    @abstractmethod
    def ready(
        self,
        values: Mapping[str, float],
        experiment: Experiment,
        observed: ObservedRecord,
        columns: Sequence[str],
        offsets: Sequence[float],
    ) -> Ready:
        """The model with numbers and offsets of observations; columns as the engine names them."""

    def moves(self, name: str) -> Mapping[str, float]:
        """Derivatives by a name of the columns that it moves."""
        return {name: 1.0}

    def simulate(self, values: Mapping[str, float], experiment: Experiment) -> Mapping[str, Array]:
        """Simulate the measured channels; see `model.Model`."""
        channels = list(self.signals_of(experiment))
        observed = self._record(experiment, dict.fromkeys(channels), ())
        ready = self.ready(values, experiment, observed, (), ())
        flat = residuals(ready.instance, observed, ready.own)
        return {name: flat[observed.rows_of(k)] for k, name in enumerate(channels)}

    def linearise(
        self, values: Mapping[str, float], experiment: Experiment, names: Sequence[str]
    ) -> Mapping[str, Linearised]:
        """Simulate with derivatives; see `model.Differentiable`."""
        channels = list(self.signals_of(experiment))
        observed = self._record(experiment, dict.fromkeys(channels), names)
        columns, chain = self._chain(names, channels, observed)
        ready = self.ready(values, experiment, observed, columns, ())
        found = jacobian(ready.instance, observed, ready.paths, ready.own, moved=ready.moved)
        by = found.columns @ chain
        return {
            name: Linearised(found.residuals[observed.rows_of(k)], by[observed.rows_of(k)])
            for k, name in enumerate(channels)
        }

    def reduce(
        self,
        values: Mapping[str, float],
        experiment: Experiment,
        names: Sequence[str],
        weights: Mapping[str, Array],
    ) -> Array:
        """Triangular factor (k+1, k+1) of [J r] by some of the unknowns, without ever holding J.

        `weights` are the channels that count, and the factors (m,) on their residuals.
        """
        known, channels = self.signals_of(experiment), list(weights)
        for name in channels:
            if name not in known:
                raise refused_channel(experiment, name, known)
        observed = self._record(experiment, weights, names)
        columns, chain = self._chain(names, channels, observed)
        offsets = [values.get(f"{OFFSET}{name}", 0.0) for name in channels]
        ready = self.ready(values, experiment, observed, columns, offsets)
        found = triangle(ready.instance, observed, ready.paths, ready.own, moved=ready.moved)
        return np.column_stack([found.factor[:, :-1] @ chain, found.factor[:, -1]])

    def _chain(
        self, names: Sequence[str], channels: Sequence[str], observed: ObservedRecord
    ) -> tuple[list[str], Array]:
        """Columns to ask for, and the derivatives of all columns by the names; made once."""
        key = id(observed), tuple(names)
        if key not in self._chains:
            self._chains[key] = (observed, self._chain_of(names, channels, observed))
        return self._chains[key][1]

    def _chain_of(
        self, names: Sequence[str], channels: Sequence[str], observed: ObservedRecord
    ) -> tuple[list[str], Array]:
        moved = [{name: 1.0} if name.startswith(OFFSET) else self.moves(name) for name in names]
        own = [
            f"{OFFSET}{channel}"
            for channel, each in zip(channels, observed.observations, strict=True)
            if each.free_offset
        ]
        asked = list(dict.fromkeys(c for each in moved for c in each if not c.startswith(OFFSET)))
        chain = np.array([[each.get(row, 0.0) for each in moved] for row in (*asked, *own)])
        return asked, chain.reshape(len(asked) + len(own), len(names))

    def _record(
        self,
        experiment: Experiment,
        weights: Mapping[str, Array | None],
        names: Sequence[str],
    ) -> ObservedRecord:
        """The experiment as the march sees it; made once."""
        own = tuple(name for name in names if name.startswith(OFFSET))
        key = (id(experiment), tuple(id(each) for each in weights.values()), own)
        if key not in self._observed:
            # both are kept as well, so that no others can have their identity
            kept = (experiment, dict(weights))
            signals = self.signals_of(experiment)
            observations = [
                Observation(
                    signals[name],
                    experiment[name].time,
                    np.zeros_like(experiment[name].values)
                    if weight is None
                    else experiment[name].values,
                    1.0 if weight is None else weight,
                    free_offset=f"{OFFSET}{name}" in own,
                )
                for name, weight in weights.items()
            ]
            by, record, others = self.driven(experiment)
            made = ObservedRecord(record, observations, by, experiment.begins, others)
            self._observed[key] = (kept, made)
        return self._observed[key][1]


@dataclass(frozen=True, eq=False)
class OwnModel(Result, EquationModel):
    """A model of equations whose parameters, by their paths, are the unknowns.

    ``"start.PATH"`` is a number of the state at the first sample, by its path or as `free_start` of
    the model has it: an unknown of each run.

    A channel is compared with the signal of its name. Of the model's external signals those that
    are channels of an experiment are taken from there; the one that is left is its input.

    Examples
    --------
    >>> problem = Problem(
    ...     OwnModel(valve, rate=100.0, begin={"position": "position"}),
    ...     campaign.experiments,
    ...     Unknowns((Unknown("lag", 0.06, 0.005, 0.5, "s", log=True), ...)),
    ...     channels=("position",),
    ...     scales={"position": 1e-3},
    ... )
    """

    model: Equations
    p: Any = None
    """Values of what is neither unknown nor fixed by the problem: the model's parameters."""
    rate: float | None = None
    """Steps a second; by default the input's samples. Needed where its stamps are not even. [Hz]"""
    options: Any = None
    given: Any = None
    """The model's givens, or a mapping of them by the experiments' names."""
    signals: Mapping[str, str] = field(default_factory=dict)
    """The model's signal for a channel of another name."""
    begin: Mapping[str, str] = field(default_factory=dict)
    """Channel that says where a number of the state begins, by its path: at the first sample that
    counts."""

    def signals_of(self, experiment: Experiment) -> Mapping[str, str]:
        """Signal of the model for each channel that it gives.

        Raises
        ------
        InputError
            If the model has no such signal, or gives none of the channels.
        """
        known = [name for part in self.model.parts for name in part.signal_names]
        known += [*self.model.links, *self.model.integrals]
        found = {name: self.signals.get(name, name) for name in experiment.channels}
        found = {k: v for k, v in found.items() if k in self.signals or v in known}
        for signal in found.values():
            output_of(self.model, signal)
        if not found:
            raise InputError(
                f"{experiment.name} has the channels {', '.join(experiment.channels)}, of which "
                f"{self.model.name} gives none; it gives {', '.join(known)}."
            )
        return found

    def driven(self, experiment: Experiment) -> tuple[str, Record, Mapping[str, Array]]:
        """The experiment's input on the grid, and external signals that are channels.

        Raises
        ------
        InputError
            If stamps are uneven and no rate is said, or it is not clear which signal the input is.
        """
        external, defaults = self.model.external, set[str]()
        for part in self.model.parts:
            defaults |= {part.tap(name).signal for name in part.defaults}
        others = [name for name in external if name in experiment.channels]
        left = [name for name in external if name not in others]
        left = [name for name in left if name not in defaults] or left
        if len(left) != 1:
            raise InputError(
                f"{self.model.name} needs the signals {', '.join(external)}; {experiment.name} has "
                f"one input, for one of them, and the channels {', '.join(experiment.channels)}."
            )
        command = experiment.input
        even = even_rate(command.time)
        rate = self.rate or even
        if rate is None:
            raise InputError(
                f"{experiment.name}: the stamps of its input are not even, so the model needs a "
                f"rate, as in OwnModel({self.model.name}, rate=100.0)."
            )
        if rate == even:
            record = Record(command.values, float(command.time[0]), rate, 1)
        else:
            record = gridded(command.values, command.time, rate, command.interpolation)
        channels = [experiment[name] for name in others]
        on_grid = {c.name: np.interp(record.time, c.time, c.values) for c in channels}
        return left[0], record, on_grid

    def ready(
        self,
        values: Mapping[str, float],
        experiment: Experiment,
        observed: ObservedRecord,
        columns: Sequence[str],
        offsets: Sequence[float],
    ) -> Ready:
        """The model with numbers; see `EquationModel.ready`.

        Raises
        ------
        InputError
            If a name is not known, or a parameter has no value.
        """
        model = self.model
        paths, states = parameter_paths(model), state_paths(model)
        numbers = {} if self.p is None else dict(zip(paths, numbers_of(self.p), strict=True))
        begin = {}
        for path, channel in self.begin.items():
            measured = experiment[channel]
            begin[path] = float(measured.values[int(np.argmax(measured.used))])
        for name, value in values.items():
            if name in paths:
                numbers[name] = value
            elif name.startswith("start."):
                begin |= dict.fromkeys(self._started(name), value)
            elif not name.startswith(OFFSET):
                raise InputError(
                    f"{model.name} has no parameter '{name}'; it has {', '.join(paths)}."
                )
        unknown = [path for path in begin if path not in states]
        if unknown:
            raise InputError(
                f"{model.name} has no state '{unknown[0]}' to begin at; it has {', '.join(states)}."
            )
        try:
            p = made(model.parameters, numbers)
        except KeyError as error:
            raise InputError(
                f"{model.name} has no value of {error.args[0]}: let it be free, fix it, or give p."
            ) from None
        given = self.given
        if isinstance(given, Mapping):
            if experiment.name not in given:
                raise InputError(f"{model.name} has no given numbers for {experiment.name}.")
            given = given[experiment.name]
        instance = instance_of(model, p, options=self.options, given=given)
        return Ready(instance, EngineOwn(begin, offsets), columns)

    def _started(self, name: str) -> list[str]:
        """Paths of the states that a name such as ``start.position`` sets."""
        several = len(self.model.parts) > 1
        return [
            f"{part.name}.{path}" if several else path
            for i, part in enumerate(self.model.parts)
            for path in started_by(self.model, i, name)
        ]
