"""A model with numbers in use: simulated, differentiated, one sample at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any, ClassVar, Generic, NamedTuple, Self, TypeVar, Unpack, get_type_hints

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.equations.cache import kernel
from swashplate.equations.code import generating
from swashplate.equations.marching.jacobian import jacobian
from swashplate.equations.marching.march import output_of
from swashplate.equations.marching.observation import Own, every_sample
from swashplate.equations.marching.part import Stored
from swashplate.equations.marching.record import (
    Between,
    Record,
    Sampling,
    checked_sampling,
    on_grid,
)
from swashplate.equations.marching.run import (
    Instance,
    Start,
    Started,
    check_start,
    instance_of,
    marched,
)
from swashplate.equations.marching.stepping import CompiledStep, Machine
from swashplate.equations.model import Model, parameter_paths
from swashplate.equations.syntax import plain
from swashplate.errors import InputError

Array = NDArray[np.float64]
S = TypeVar("S")
T = TypeVar("T", bound=np.generic)


def signals_of(model: Model) -> tuple[str, ...]:
    """Signals of all parts and numbers of their states, and links; integrals apart."""
    own = [name for part in model.parts for name in part.signal_names]
    return tuple(dict.fromkeys([*own, *model.links]))


def limits_of(model: Model) -> dict[str, tuple[int, int]]:
    """Part and bit of every limit, by its name."""
    found: dict[str, tuple[int, int]] = {}
    for i, part in enumerate(model.parts):
        if part.limits is not None:
            fields = get_type_hints(plain(part.limits))["return"]._fields
            found |= {name: (i, bit) for bit, name in enumerate(fields)}
    return found


def read_only(array: NDArray[T]) -> NDArray[T]:
    """A view that cannot be written to."""
    view = array.view()
    view.flags.writeable = False
    return view


@dataclass(frozen=True, eq=False)
class Run:
    """Signals of a model over its inputs, read by name: ``run["position"]``.

    Arrays are read-only, of the inputs' length. Some signals are kept from the first march; for
    the others it is marched again when one of them is first asked for.
    """

    instance: Instance = field(repr=False)
    """The model with its numbers."""
    records: Mapping[str, Record] = field(repr=False)
    """Inputs by name, on the march's grid; what drives the model comes first."""
    start: Start = "rest"
    """How it began,"""
    begin: Mapping[str, float] = field(default_factory=dict, repr=False)
    """but for these numbers of the state, by path."""
    found: dict[str, Array] = field(default_factory=dict, repr=False)
    """Signals on the march's grid, as far as they were asked for,"""
    samples: dict[str, Array] = field(default_factory=dict, repr=False)
    """and at the samples."""

    kept: ClassVar[tuple[str, ...]] = ()
    """Signals that the first march leaves; all of them if none is named."""
    later: ClassVar[tuple[str, ...]] = ()
    """Signals that the second one leaves, besides limits."""

    def marched(self, cause: str = "input") -> Self:
        """The run with its first march done; `cause` is what drives the model, for messages."""
        self._march(self.kept or signals_of(self.instance.model), (), cause)
        return self

    def _march(self, names: Iterable[str], limits: Sequence[int], cause: str) -> None:
        """Find signals, and all limits of some parts."""
        places = {name: output_of(self.instance.model, name)[0] for name in names}
        places |= {f"limits {part}": Stored(part, "limits") for part in limits}
        records = {name: each.values for name, each in self.records.items()}
        kept, step = tuple(places.values()), self.record.step
        out = marched(self.instance, records, step, self.started, kept, cause, self.begin)
        self.found.update(zip(places, out, strict=True))

    @property
    def started(self) -> Started:
        """States at the first sample, `begin` apart, and what they follow from."""
        first = {name: float(each.values[0]) for name, each in self.records.items()}
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
        """Name of the model, or of its numbers."""
        return self.instance.name

    @property
    def time(self) -> Array:
        """Time stamps. [s]"""
        return self["time"]

    @property
    def names(self) -> tuple[str, ...]:
        """All signals, behind ``"time"`` and the inputs."""
        model = self.instance.model
        every = ("time", *self.records, *signals_of(model), *model.integrals)
        return tuple(dict.fromkeys(every))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, {self.time.size} samples)"

    def __getitem__(self, signal: str) -> Array:
        """A signal by its name, SI: ``run["shaft_speed"]``.

        Raises
        ------
        InputError
            If there is none of that name.
        """
        if signal in self.samples:
            return self.samples[signal]
        if signal not in self.names:
            near = get_close_matches(str(signal), self.names, 1)
            meant = f"did you mean {near[0]}? It" if near else "it"
            raise InputError(
                f"A run of {self.name} has no signal '{signal}': {meant} has "
                f"{', '.join(self.names)}."
            )
        time = signal == "time"
        made = read_only(self.record.time) if time else self.sampled(self.fine(signal))
        return self.samples.setdefault(signal, made)

    def fine(self, signal: str) -> Array:
        """A signal on the march's grid, `substeps` points a sample."""
        if signal in self.records:
            return self.records[signal].values
        found, integrals = self.found, self.instance.model.integrals
        if signal in integrals and signal not in found:
            rate, step = self.fine(integrals[signal]), self.record.step
            total = found[signal] = np.zeros_like(rate)
            np.cumsum(0.5 * step * (rate[:-1] + rate[1:]), out=total[1:])
        if signal not in found:
            self._march_again()
        return found[signal]

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
        limits = limits_of(self.instance.model)
        if limit not in limits:
            raise InputError(f"There is no limit '{limit}'; there are {', '.join(limits)}.")
        part, bit = limits[limit]
        if f"limits {part}" not in self.found:
            self._march_again()
        acts = (self.found[f"limits {part}"].astype(np.int64) & (1 << bit)) != 0
        return acts if fine else self.sampled(acts)

    def _march_again(self) -> None:
        parts = sorted({part for part, _ in limits_of(self.instance.model).values()})
        self._march(self.later, parts, "input")


def inputs_of(
    instance: Instance,
    inputs: Mapping[str, ArrayLike],
    rate: float,
    **sampling: Unpack[Sampling],
) -> dict[str, Record]:
    """External signals of a model on its grid, checked; see `on_grid`."""
    instance.check_inputs(inputs)
    if not inputs:
        raise InputError(f"{instance.name} needs a record of {', '.join(instance.model.external)}.")
    return on_grid(inputs, rate, **sampling)


def simulate(
    model: Model,
    p: Any,
    inputs: Mapping[str, ArrayLike],
    rate: float,
    *,
    time: ArrayLike | None = None,
    interpolation: Between = None,
    substeps: int | None = None,
    options: Any = None,
    given: Any = None,
    start: Start = "rest",
    begin: Mapping[str, float] | None = None,
) -> Run:
    """Simulate a model over its inputs.

    Parameters
    ----------
    model : Model
        Of one's own, or one of the package's.
    p, options, given : named tuple
        Its numbers, see `instance_of`.
    inputs : mapping of str to (n,) array_like or float
        External signals, numbers for constant ones; those with a default parameter may be left out.
    rate : float
        Samples a second; with `time`, of the result's grid. [Hz]
    time : (n,) array_like, optional
        Increasing time stamps of the inputs, in any distances; `interpolation` must then be given.
        [s]
    interpolation : {"linear", "previous"} or mapping, optional
        What the inputs, or each of them by its name, are between samples: a straight line (default)
        or held.
    substeps : int, optional
        Steps of the model a sample; by default one.
    start : {"rest", "steady"}
        See `Instance.start`.
    begin : mapping of str to float, optional
        Numbers of the state at the first sample, by path.

    Raises
    ------
    InputError
        For inputs or numbers that do not fit the model.
    DomainError
        If the model leaves its domain, or a number overflows.
    """
    instance = instance_of(model, p, options=options, given=given)
    records = inputs_of(
        instance, inputs, rate, time=time, interpolation=interpolation, substeps=substeps
    )
    return Run(instance, records, start, begin or {}).marched()


def sensitivities(
    model: Model,
    p: Any,
    inputs: Mapping[str, ArrayLike],
    rate: float,
    *,
    output: str,
    parameters: Sequence[str] | None = None,
    options: Any = None,
    given: Any = None,
    start: Start = "rest",
    begin: Mapping[str, float] | None = None,
    **sampling: Unpack[Sampling],
) -> Array:
    """(n, k) exact derivatives of a signal by parameters, and by where the state begins.

    Parameters
    ----------
    model, p, inputs, rate, options, given, start, begin, **sampling :
        As in `simulate`; `time`, `interpolation`, `substeps`.
    output : str
        The signal.
    parameters : sequence of str, optional
        Paths of parameters, or ``start.`` with the path of a state that `begin` names; by default
        all parameters.
    """
    instance = instance_of(model, p, options=options, given=given)
    records = inputs_of(instance, inputs, rate, **sampling)
    output_of(model, output)
    columns = tuple(parameters) if parameters is not None else parameter_paths(model)
    unknown = [c for c in columns if c not in parameter_paths(model) and c[:6] != "start."]
    if unknown:
        raise InputError(
            f"{model.name} has no parameter '{unknown[0]}'; it has "
            f"{', '.join(parameter_paths(model))}."
        )
    (first, record), *others = records.items()
    rest = {name: each.values for name, each in others}
    observed = every_sample(record, output, first, start, rest)
    return jacobian(instance, observed, columns, Own(begin or {})).columns


# --- one sample at a time -------------------------------------------------------------------------


@generating
def _steps(step: Callable[[Machine], float]) -> Callable[..., float]:
    """The compiled march over the steps of one sample."""

    @kernel
    def steps(
        last: Array, values: Array, held: NDArray[np.bool_], substeps: int, machine: Machine,
        rates: NDArray[np.int64], totals: Array,
    ) -> float:  # fmt: skip
        """Advance by one sample of the inputs; `totals` are integrals, and their rates."""
        worst = np.inf
        for j in range(substeps):
            for i in range(values.size):
                machine.inputs[i] = values[i]
                if j < substeps - 1:
                    rise = 0.0 if held[i] else (j + 1) / substeps
                    machine.inputs[i] = last[i] + rise * (values[i] - last[i])
            worst = min(worst, step(machine))
            for r in range(rates.size):
                rate = machine.outputs[rates[r]]
                totals[0, r] = totals[0, r] + 0.5 * machine.h * (totals[1, r] + rate)
                totals[1, r] = rate
        return worst

    return steps


class StepperState(NamedTuple):
    """All that a stepper remembers, good to keep and to return to."""

    machine: Machine
    totals: Array
    """Integrals so far, and their rates at the sample."""
    last: Array | None
    """Inputs of the sample before, None if there was none."""


class Stepper(Generic[S]):
    """A model that takes a sample of its inputs and gives one, the same numbers as `simulate`.

    Created by `stepper`, and for drives by `Drive.stepper`. The first step gives the sample at time
    zero.
    """

    def __init__(
        self,
        instance: Instance,
        inputs: Sequence[str],
        outputs: Sequence[str],
        rate: float,
        sample: Callable[..., S],
        start: Start = "rest",
        *,
        interpolation: Between = None,
        substeps: int | None = None,
        bound: float = np.inf,
    ) -> None:
        check_start(start)
        between, self._substeps = checked_sampling(inputs, rate, interpolation, substeps)
        self._start, self._bound = start, bound
        self._sample, self.inputs, limits = sample, tuple(inputs), limits_of(instance.model)
        self._held = np.array([between[name] == "previous" for name in inputs])
        self._shown: dict[str, tuple[Stored, int | None]] = {}
        integrals: dict[str, Stored] = {}
        for name in outputs:
            if name in limits:
                part, bit = limits[name]
                self._shown[name] = Stored(part, "limits"), bit
                continue
            place, integral = output_of(instance.model, name)
            self._shown[name] = place, None
            integrals |= {name: place} if integral else {}
        stored = list(dict.fromkeys(place for place, _ in self._shown.values()))
        self._compiled = CompiledStep(instance, inputs, stored, 1.0 / (rate * self._substeps))
        self._steps = _steps(self._compiled.step)
        self._at = {name: stored.index(place) for name, (place, _) in self._shown.items()}
        self._integrals = tuple(integrals)
        self._rates = np.array([self._at[name] for name in integrals], dtype=np.int64)
        totals = np.zeros((2, self._rates.size))
        self._state = StepperState(self._compiled.machine(), totals, None)

    def __repr__(self) -> str:
        return f"Stepper({self._compiled!r})"

    @property
    def state(self) -> StepperState:
        """A copy of the present state; assign it to return to that instant."""
        machine, totals, last = self._state
        return StepperState(machine.copied(), totals.copy(), last)

    @state.setter
    def state(self, state: StepperState) -> None:
        own, given = self._state.machine, state.machine.copied()
        if given.lines.shape != own.lines.shape or given.states.size != own.states.size:
            raise InputError("This state belongs to a stepper of another model, delay or rate.")
        machine = own._replace(
            states=given.states, outputs=given.outputs, lines=given.lines, inputs=given.inputs
        )
        self._state = StepperState(machine, state.totals.copy(), state.last)

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
        """
        values = np.array(inputs, dtype=np.float64)
        if values.shape != (len(self.inputs),):
            raise InputError(f"A step takes a number for each of {', '.join(self.inputs)}.")
        for name, value in zip(self.inputs, inputs, strict=True):
            if not abs(value) <= self._bound or not np.isfinite(value):
                raise InputError(
                    f"The {name} is {value:g}, but must be a finite number within ±{self._bound:g}."
                )
        machine, totals, last = self._state
        substeps = self._substeps
        if last is None:
            substeps = 1
            if self._start == "steady":
                first = dict(zip(self.inputs, inputs, strict=True))
                machine = self._compiled.machine(first, "steady")
        before = values if last is None else last
        worst = self._steps(before, values, self._held, substeps, machine, self._rates, totals)
        if last is None:
            totals[0] = 0.0
        self._compiled.check(machine, worst, self.inputs[0])
        self._state = StepperState(machine, totals, values)
        out = machine.outputs.tolist()
        found = dict(zip(self.inputs, values.tolist(), strict=True))
        for name, (_, bit) in self._shown.items():
            value = out[self._at[name]]
            found[name] = value if bit is None else bool(int(value) >> bit & 1)
        found |= zip(self._integrals, totals[0].tolist(), strict=True)
        return self._sample(**found)


def stepper(
    model: Model,
    p: Any,
    inputs: Sequence[str],
    outputs: Sequence[str] | None = None,
    *,
    rate: float,
    interpolation: Between = None,
    substeps: int | None = None,
    options: Any = None,
    given: Any = None,
    start: Start = "rest",
) -> Stepper[dict[str, float]]:
    """A model one sample at a time: inputs in, sample out, numbers as in `simulate`.

    Parameters
    ----------
    model, p, rate, interpolation, substeps, options, given, start :
        As in `simulate`.
    inputs : sequence of str
        Signals that go in.
    outputs : sequence of str, optional
        Signals that come out, and limits by their names, true where they act; by default all.
    """
    instance, names = instance_of(model, p, options=options, given=given), outputs
    if names is None:
        names = (*signals_of(model), *model.integrals, *limits_of(model))
    return Stepper(
        instance, inputs, names, rate, dict, start, interpolation=interpolation, substeps=substeps
    )
