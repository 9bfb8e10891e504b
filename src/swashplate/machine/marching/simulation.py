"""A model with numbers simulated: over whole inputs, or one sample at a time."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cached_property
from math import isfinite
from typing import (
    TYPE_CHECKING,
    Any,
    ClassVar,
    Generic,
    Literal,
    NamedTuple,
    Self,
    TypeVar,
    cast,
    overload,
)

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.errors import DomainError, InputError, UnknownNameError
from swashplate.machine.marching.inputs import Command, inputs_of, substeps_of
from swashplate.machine.marching.part_code import SignalId
from swashplate.machine.marching.record import Between, Record, checked_sampling
from swashplate.machine.marching.run import (
    InitialStates,
    Machine,
    Start,
    check_start,
)
from swashplate.machine.marching.sample_code import output_of
from swashplate.machine.marching.stepping import CompiledStep, StepContext, bound_step
from swashplate.machine.model import full_name
from swashplate.results import GivenAxes, Tabular, figures, pandas_frame
from swashplate.units import in_si

if TYPE_CHECKING:
    import polars

    from swashplate.results import Axes, Figure

Array = NDArray[np.float64]
LARGEST = sys.float_info.max
S = TypeVar("S")
T = TypeVar("T", bound=np.generic)


def read_only(array: NDArray[T]) -> NDArray[T]:
    """A view that cannot be written to."""
    view = array.view()
    view.flags.writeable = False
    return view


@dataclass(frozen=True, eq=False)
class Run(Tabular):
    """Signals of a model over its inputs, read by name: ``run["position"]``.

    Arrays are read-only, of the inputs' length. The first march computes some of the signals; the
    model is marched again when one of the others, or a limit, is first asked for. `to_polars`,
    `to_pandas` and `to_xarray` give all of them, `write` a file.
    """

    instance: Machine = field(repr=False)
    """The model with its numbers."""
    records: Mapping[str, Record] = field(repr=False)
    """Inputs by name, on the march's grid; what drives the model comes first."""
    start: Start = "rest"
    """State at the first sample."""
    begin: Mapping[str, float] = field(default_factory=dict, repr=False)
    """Numbers of the state that differ from that, by path."""
    on_grid: dict[str, Array] = field(default_factory=dict, repr=False)
    """Signals on the march's grid that were computed so far."""
    samples: dict[str, Array] = field(default_factory=dict, repr=False)
    """Signals at the samples that were asked for so far."""
    maneuver: str = ""
    """Names of the maneuvers among the inputs; empty if there is none."""

    plotted: ClassVar[tuple[str, ...]] = ()
    """Signals that `plot` shows unless others are named; all of them if none is here."""
    first_signals: ClassVar[tuple[str, ...]] = ()
    """Signals that the first march computes; all of them if none is named."""
    has_states: ClassVar[bool] = True
    """Whether numbers of the state are signals, too."""

    def marched(self) -> Self:
        """The run with its first march done."""
        self._march()
        return self

    def _march(self, *, everything: bool = False) -> None:
        """Compute the signals of the first march, or all of them and the limits."""
        signals = self.instance.signals_under(
            self.records,
            self.start,
            self.begin,
            first=self.first_signals,
            states=self.has_states,
            everything=everything,
        )
        self.on_grid.update(signals)

    @property
    def initial(self) -> InitialStates:
        """States at the first sample, `begin` apart, and what they follow from."""
        first = {name: float(record.values[0]) for name, record in self.records.items()}
        return self.instance.start(first, self.record.step, self.start)

    @property
    def record(self) -> Record:
        """The first input on the march's grid."""
        return next(iter(self.records.values()))

    @property
    def driven_by(self) -> str:
        """Name of the first input."""
        return next(iter(self.records))

    @property
    def name(self) -> str:
        """Name of the model's numbers: a parameter set's, or the model's own."""
        return self.instance.name

    @property
    def title(self) -> str:
        """Title of a figure: `name` and that of the maneuver."""
        return f"{self.name}: {self.maneuver}" if self.maneuver else self.name

    @property
    def time(self) -> Array:
        """Time stamps. [s]"""
        return self["time"]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """``"time"``, the inputs, and all signals."""
        ports = self.instance.ports
        every = ("time", *self.records, *ports.every_signal, *ports.integrals)
        return tuple(dict.fromkeys(every))

    @property
    def limit_names(self) -> tuple[str, ...]:
        """Limits of the model."""
        return tuple(self.instance.ports.limit_bits)

    def __repr__(self) -> str:
        samples = f"{self.time.size} samples at {self.record.rate:g} Hz"
        return f"{type(self).__name__}({self.name!r}, {samples})"

    @overload
    def plot(
        self,
        signals: str | Sequence[str] = (),
        *,
        ax: None = None,
        label: str = "",
        window: tuple[float, float] | None = None,
        title: str | None = None,
    ) -> Figure: ...

    @overload
    def plot(
        self,
        signals: str | Sequence[str] = (),
        *,
        ax: GivenAxes,
        label: str = "",
        window: tuple[float, float] | None = None,
        title: str | None = None,
    ) -> GivenAxes: ...

    def plot(
        self,
        signals: str | Sequence[str] = (),
        *,
        ax: Axes | Sequence[Axes] | None = None,
        label: str = "",
        window: tuple[float, float] | None = None,
        title: str | None = None,
    ) -> Figure | Axes | Sequence[Axes]:
        """Figure of signals over time, a panel each, with the model's limits.

        Words, units and ranges are those of the `Definition` of each signal, state and input.

        Parameters
        ----------
        signals : str or sequence of str
            Names as of `names`, a panel each; by default the inputs and the model's `outputs`, or
            all signals if it names no outputs. A drive shows its whole chain by default.
        ax : matplotlib axes or sequence of them, optional
            Where to draw the signals, one for each, of a drive the shaft's speed if none is named;
            by default in a new figure.
        label : str
            Of the curves: each panel gets a legend of all labelled curves in it.
        window : (float, float), optional
            First and last instant to show. [s]
        title : str, optional
            In the place of `title`; axes that are given have none by default.

        Returns
        -------
        Figure, or `ax` as it was given

        Raises
        ------
        InputError
            For a signal that the run does not have, another number of axes, or a window with fewer
            than two samples.
        """
        names = (signals,) if isinstance(signals, str) else tuple(signals)
        if not names and ax is None:
            return self._overview(label=label, window=window, title=title)
        names = names or self.plotted or self._usual
        draw = figures().plot_signals
        return cast("Figure", draw(self, names, ax=ax, label=label, window=window, title=title))

    def _overview(
        self, *, label: str, window: tuple[float, float] | None, title: str | None
    ) -> Figure:
        """Figure of what is shown if no signals are named."""
        names = self.plotted or self._usual
        draw = figures().plot_signals
        return cast("Figure", draw(self, names, label=label, window=window, title=title))

    @property
    def _usual(self) -> tuple[str, ...]:
        """Signals that `plot` shows of a user-defined model."""
        outputs = self.instance.ports.outputs
        usual = (*self.records, *outputs) if outputs else self.names[1:]
        return tuple(dict.fromkeys(usual))

    def to_polars(self, units: Literal["SI", "display"] = "SI") -> polars.DataFrame:
        """Table of time, all signals and a true/false column ``limit_NAME`` for each limit, SI.

        The model is marched again for signals and limits that were not computed so far; the run
        keeps them.

        Parameters
        ----------
        units : "SI"
            A model's signals have no other units; those of a `Simulation` of a drive do.

        Raises
        ------
        InputError
            For other units.
        """
        if units != "SI":
            raise InputError(
                f"A run of {self.name} has one set of units, that of its equations: units is "
                f"{units!r}, leave it out or give 'SI'."
            )
        import polars as pl

        return pl.DataFrame(self.columns())

    def columns(self) -> dict[str, NDArray[Any]]:
        """Columns of the table of `to_polars`, by name."""
        limits = {f"limit_{name}": self.active(name) for name in self.limit_names}
        return {name: self[name] for name in self.names} | limits

    def to_pandas(self, units: Literal["SI", "display"] = "SI") -> Any:
        """The table of `to_polars` as a ``pandas.DataFrame``.

        Raises
        ------
        InputError
            For units that the table cannot have, or if pandas is not installed.
        """
        return pandas_frame(self.to_polars(units))

    def __getitem__(self, signal: str) -> Array:
        """A signal by its name, SI: ``run["shaft_speed"]``.

        Raises
        ------
        InputError
            If there is none of that name.
        """
        signal = full_name(str(signal), self.names)
        if signal in self.samples:
            return self.samples[signal]
        if signal not in self.names:
            ends = [name for name in self.names if name.endswith(f".{signal}")]
            if ends:
                raise UnknownNameError(
                    f"A run of {self.name} has several signals '{signal}': {', '.join(ends)}."
                )
            near = get_close_matches(str(signal), self.names, 1)
            meant = f"did you mean {near[0]}? It" if near else "it"
            raise UnknownNameError(
                f"A run of {self.name} has no signal '{signal}': {meant} has "
                f"{', '.join(self.names)}."
            )
        if signal == "time":
            samples = read_only(self.record.time)
        else:
            samples = self.sampled(self.fine(signal))
        return self.samples.setdefault(signal, samples)

    def fine(self, signal: str) -> Array:
        """A signal on the march's grid, `substeps` points a sample."""
        if signal in self.records:
            return self.records[signal].values
        integrals = self.instance.ports.integrals
        if signal in integrals and signal not in self.on_grid:
            rate = self.fine(integrals[signal])
            total = np.zeros_like(rate)
            with np.errstate(all="ignore"):
                np.cumsum(0.5 * self.record.step * (rate[:-1] + rate[1:]), out=total[1:])
            if not np.isfinite(total[-1]):  # a sum that is not finite stays so
                raise DomainError(
                    f"{self.name}: {signal} overflows under this {self.driven_by}; check the size "
                    "of the parameters and of what was measured."
                )
            self.on_grid[signal] = total
        if signal not in self.on_grid:
            self._march(everything=True)
        return self.on_grid[signal]

    def sampled(self, fine: NDArray[T]) -> NDArray[T]:
        """Samples of the inputs out of the march's grid."""
        return read_only(np.ascontiguousarray(fine[:: self.record.substeps]))

    def active(self, limit: str, *, fine: bool = False) -> NDArray[np.bool_]:
        """Samples, or points of the march's grid, at which a limit of the model acts, by its name.

        Raises
        ------
        InputError
            If the model has no such limit.
        """
        limits = self.instance.ports.limit_bits
        if limit not in limits:
            names = ", ".join(limits) or "none"
            raise InputError(f"There is no limit '{limit}'; there are {names}.")
        part, bit = limits[limit]
        if f"limits {part}" not in self.on_grid:
            self._march(everything=True)
        bits = self.on_grid[f"limits {part}"]
        acts = (bits if fine else self.sampled(bits)).astype(np.uint32) & np.uint32(1 << bit)
        return np.asarray(acts != 0)


def simulate(
    machine: Machine,
    inputs: Mapping[str, ArrayLike | Command],
    rate: float,
    *,
    time: ArrayLike | None = None,
    interpolation: Between = None,
    substeps: int | None = None,
    clip: bool = False,
    start: Start = "rest",
    begin: Mapping[str, float] | None = None,
) -> Run:
    """Simulate a machine over its inputs.

    Parameters
    ----------
    machine : Machine
        A model with its numbers.
    inputs : mapping of str to (n,) array_like, float or Maneuver
        External signals, numbers for constant ones; those with a default parameter may be left out.
        A maneuver is sampled at `rate`, its volts as the unit of the input.
    rate : float
        Samples a second; with `time`, of the result's grid. [Hz]
    time : (n,) array_like, optional
        Increasing time stamps of the inputs, in any distances; `interpolation` must then be given.
        [s]
    interpolation : {"linear", "previous"} or mapping, optional
        What the inputs, or each of them by its name, are between samples: a straight line (default)
        or held.
    substeps : int, optional
        Steps of the model a sample; by default one, or so many as its longest step demands.
    clip : bool
        Clip inputs to the range of their `Definition`; by default what lies beyond it is refused.
    start : {"rest", "steady"}
        See `Machine.start`.
    begin : mapping of str to float, optional
        Numbers of the state at the first sample, by path.

    Returns
    -------
    Run
        Signals of the model by name, ``run["speed"]``, on the grid of `rate`.

    Raises
    ------
    InputError
        For inputs that do not fit the model or lie beyond their range, and a step at which the
        equations are unstable.
    DomainError
        If the model leaves its domain, or a number overflows.

    Examples
    --------
    >>> import numpy as np
    >>> from swashplate import FullOrderDrive, Machine, simulate
    >>> from swashplate.models.full_order import Substeps, plant
    >>> numbers = FullOrderDrive.preset("hoist").plant
    >>> current = {"current": np.full(1024, 0.7)}
    >>> machine = Machine(plant, numbers, given=Substeps(8.0))
    >>> run = simulate(machine, current, 512.0)
    >>> run["shaft_speed"].shape
    (1024,)
    """
    records = inputs_of(
        machine,
        inputs,
        rate,
        time=time,
        interpolation=interpolation,
        substeps=substeps,
        clip=clip,
    )
    maneuver = ", ".join(
        command.name for command in inputs.values() if isinstance(command, Command)
    )
    return Run(machine, records, start, begin or {}, maneuver=maneuver).marched()


# --- one sample at a time -------------------------------------------------------------------------


class StepperState(NamedTuple):
    """All that a stepper remembers; one that was kept can be returned to."""

    context: StepContext
    totals: Array
    """Integrals so far, and their rates at the sample."""
    inputs: Array
    """Inputs of the sample before, and of this one."""
    initialised: bool
    """Whether there was a sample."""

    def copied(self) -> StepperState:
        """A copy that shares no memory with this one."""
        return StepperState(
            context=self.context.copied(),
            totals=self.totals.copy(),
            inputs=self.inputs.copy(),
            initialised=self.initialised,
        )


class Stepper(Generic[S]):
    """A model that takes a sample of its inputs and gives one, the same numbers as `simulate`.

    Created by `stepper`, and for drives by `Drive.stepper`. The first step gives the sample at time
    zero.
    """

    def __init__(
        self,
        instance: Machine,
        inputs: Sequence[str],
        outputs: Sequence[str],
        rate: float,
        sample: Callable[[list[float]], S],
        start: Start = "rest",
        *,
        interpolation: Between = None,
        substeps: int | None = None,
    ) -> None:
        check_start(start)
        rate = in_si(rate, "Hz", "The rate")
        substeps = substeps_of(instance.model, rate, substeps)
        if len(set(inputs)) < len(inputs):
            raise InputError(f"A step takes each input once, not {', '.join(inputs)}.")
        between, self._substeps = checked_sampling(inputs, rate, interpolation, substeps)
        self._start = start
        self._sample = sample
        self._name = instance.name
        ranges = instance.model.input_ranges
        self._ranges = [ranges.get(name, (-LARGEST, LARGEST)) for name in inputs]
        self.inputs = tuple(inputs)
        limits = instance.model.limit_bits
        signals: list[tuple[SignalId, bool]] = []
        for name in outputs:
            if name in limits:
                part, _ = limits[name]
                signals.append((SignalId(part, "limits"), False))
            else:
                signals.append(output_of(instance.model, name))
        stored = list(dict.fromkeys(signal for signal, _ in signals))
        rates = [stored.index(signal) for signal, is_integral in signals if is_integral]
        self._rates, self._integrates = np.array(rates, dtype=np.int64), bool(rates)
        # of each output its index in a row of inputs, numbers of the step and integrals
        first_integral = len(inputs) + len(stored)
        integrals = iter(range(first_integral, first_integral + len(rates)))
        self._order = [*range(len(inputs))]
        for signal, is_integral in signals:
            index = next(integrals) if is_integral else len(inputs) + stored.index(signal)
            self._order.append(index)
        self._zero_order = np.array([between[name] == "previous" for name in inputs])
        self._compiled = CompiledStep(instance, inputs, stored, 1.0 / (rate * self._substeps))
        self._keep(
            StepperState(
                context=self._compiled.context(),
                totals=np.zeros((2, len(rates))),
                inputs=np.zeros((2, len(inputs))),
                initialised=False,
            )
        )

    def _keep(self, state: StepperState) -> None:
        self._state, self._take_step = state, bound_step(state.context)

    def __repr__(self) -> str:
        return f"Stepper({self._compiled!r})"

    @property
    def state(self) -> StepperState:
        """A copy of the present state; assign it to return to that instant."""
        return self._state.copied()

    @state.setter
    def state(self, state: StepperState) -> None:
        present, earlier = self._state.context, state.context
        same_lines = earlier.lines.shape == present.lines.shape
        if not same_lines or earlier.states.size != present.states.size:
            raise InputError("This state belongs to a stepper of another model, delay or rate.")
        context = present._replace(
            states=earlier.states,
            outputs=earlier.outputs,
            lines=earlier.lines,
            position=earlier.position,
            inputs=earlier.inputs,
        )
        self._keep(state._replace(context=context).copied())

    def step(self, *inputs: float) -> S:
        """Advance by one sample interval.

        Parameters
        ----------
        *inputs : float
            One new sample of each input, in the order of `Stepper.inputs`.

        Returns
        -------
        dict, or of a drive Sample
            Inputs and outputs at the new sample; at the first call, those at time zero.

        Raises
        ------
        InputError
            For inputs that are not finite or beyond their bound, or not as many; the state stays as
            it was.
        DomainError
            If the model leaves its domain, or a number grows beyond all bounds.

        Examples
        --------
        >>> from swashplate import Drive
        >>> stepper = Drive.preset("hoist").stepper(512.0)
        >>> stepper.step(0.0).shaft_speed
        0.0
        """
        if len(inputs) != len(self.inputs):
            raise InputError(
                f"A step takes {', '.join(self.inputs)}: {len(self.inputs)} numbers, not "
                f"{len(inputs)}."
            )
        for name, value, (low, high) in zip(self.inputs, inputs, self._ranges, strict=True):
            try:
                within = bool(low <= value <= high)
            except (TypeError, ValueError):
                within = False
            if not within:
                within_range = ""
                if low == -high and high < LARGEST:
                    within_range = f" within ±{high:g}"
                elif low > -LARGEST:
                    within_range = f" from {low:g} to {high:g}"
                raise InputError(
                    f"The {name} is {value!r}, but must be a finite number{within_range}."
                )
        context, totals, values, initialised = self._state
        values[1] = inputs
        if not initialised:
            if self._start == "steady":
                first = dict(zip(self.inputs, inputs, strict=True))
                context = self._compiled.context(first, "steady")
            self._keep(StepperState(context, totals, values, True))
        worst = self._advance(self._substeps if initialised else 1)
        if not initialised:
            totals[0] = 0.0
        outputs = [*context.outputs.tolist(), *totals[0].tolist()]
        if not (worst > 0.0 and all(map(isfinite, [*outputs, *context.states.tolist()]))):
            self._compiled.check(context, worst, self.inputs[0])
            raise DomainError(f"{self._name}: an integral overflows under this {self.inputs[0]}.")
        row = [*inputs, *outputs]
        return self._sample([row[index] for index in self._order])

    def _advance(self, substeps: int) -> float:
        """Advance from the inputs before to these, in several steps; the least margin."""
        context, totals, (before, now), _ = self._state
        worst = np.inf
        take_step = self._take_step
        for j in range(1, substeps + 1):
            context.inputs[:] = now
            if j < substeps:
                rise = np.where(self._zero_order, 0.0, j / substeps)
                context.inputs[:] = before + rise * (now - before)
            take_step()
            worst = min(worst, context.margin.item(0))
            if self._integrates:
                rates = context.outputs[self._rates]
                with np.errstate(over="ignore", invalid="ignore"):  # `step` says it
                    totals[0] += 0.5 * context.h * (totals[1] + rates)
                totals[1] = rates
        before[:] = now
        return worst


def stepper(
    machine: Machine,
    inputs: Sequence[str],
    outputs: Sequence[str] | None = None,
    *,
    rate: float,
    interpolation: Between = None,
    substeps: int | None = None,
    start: Start = "rest",
) -> Stepper[dict[str, float]]:
    """A machine one sample at a time: inputs in, sample out, numbers as in `simulate`.

    Parameters
    ----------
    model, p, rate, interpolation, substeps, options, given, start :
        As in `simulate`.
    inputs : sequence of str
        Signals that go in.
    outputs : sequence of str, optional
        Signals that come out, and limits by their names, true if they act; by default all.

    Returns
    -------
    Stepper
        Its ``step(*inputs)`` returns inputs and outputs by name.

    Raises
    ------
    InputError
        For names that do not fit the model.

    Examples
    --------
    >>> from swashplate import FullOrderDrive, Machine, stepper
    >>> from swashplate.models.full_order import Substeps, plant
    >>> numbers = FullOrderDrive.preset("hoist").plant
    >>> machine = Machine(plant, numbers, given=Substeps(8.0))
    >>> steps = stepper(machine, ["current"], ["shaft_speed"], rate=512.0)
    >>> steps.step(0.0)
    {'current': 0.0, 'shaft_speed': 0.0}
    """
    model = machine.model
    limits = model.limit_bits
    if outputs is None:
        outputs = (*model.every_signal, *model.integrals, *limits)
    inputs = [full_name(name, model.external) for name in inputs]
    names = (*inputs, *outputs)

    def sample(values: list[float]) -> dict[str, float]:
        named = dict(zip(names, values, strict=True))
        for name in names:
            if name in limits:
                _, bit = limits[name]
                named[name] = bool(int(named[name]) >> bit & 1)
        return named

    return Stepper(
        machine,
        inputs,
        outputs,
        rate,
        sample,
        start,
        interpolation=interpolation,
        substeps=substeps,
    )
