"""A model of one's own in use: simulated and differentiated.

Examples
--------
>>> class Valve(NamedTuple):
...     lag: float
...     gain: float
>>> class Rod(NamedTuple):
...     opening: float
...     position: float
>>> @equation
... def step(state: Rod, command: float, p: Valve, h: float) -> Rod:
...     opening = state.opening + (1.0 - exp(-h / p.lag)) * (command - state.opening)
...     return Rod(opening, state.position + h * p.gain * opening)
>>> valve = Model("valve", parameters=Valve, state=Rod, step=step)
>>> run = simulate(valve, Valve(0.05, 0.1), {"command": command}, rate=100.0)
>>> run["position"]
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.equations.fields import floats_of, is_real, value_at
from swashplate.equations.marching.jacobian import jacobian
from swashplate.equations.marching.march import output_of
from swashplate.equations.marching.observation import Own, every_sample
from swashplate.equations.marching.part import Stored
from swashplate.equations.marching.record import Record, column
from swashplate.equations.marching.run import Instance, Part, Start, marched
from swashplate.equations.model import Model, parameter_paths
from swashplate.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Run:
    """Signals of a model over a record, read by name: ``run["position"]``."""

    model: Model
    time: Array
    """(n,) [s]"""
    inputs: Mapping[str, Array] = field(repr=False)
    """External signals."""
    signals: Mapping[str, Array] = field(repr=False)
    """(n,) each, by name."""

    def __getitem__(self, name: str) -> Array:
        """A signal, a number of the state, or an input."""
        for found in (self.signals, self.inputs):
            if name in found:
                return found[name]
        raise InputError(
            f"{self.model.name} has no signal '{name}'; it has "
            f"{', '.join((*self.signals, *self.inputs))}."
        )

    def __repr__(self) -> str:
        return f"Run({self.model.name!r}, {self.time.size} samples)"

    @cached_property
    def names(self) -> tuple[str, ...]:
        """All signals, inputs included."""
        return (*self.inputs, *self.signals)


def instance_of(
    model: Model, p: Any, *, options: Any = None, given: Any = None, name: str | None = None
) -> Instance:
    """A model with its numbers.

    Parameters
    ----------
    model : Model
        A single model, or a joined one.
    p, options, given : named tuple
        Of a joined model each has a field for every part that has any.
    name : str, optional
        For messages; by default the model's.

    Raises
    ------
    InputError
        If a tuple has not the type that the model declares.
    """
    parts = []
    for part in model.parts:
        numbers = [p, options, given]
        if len(model.parts) > 1:
            numbers = [getattr(each, part.name, None) for each in numbers]
        for what, number, kind in zip(
            ("parameters", "options", "given"),
            numbers,
            (part.parameters, part.options, part.given),
            strict=True,
        ):
            if number is None and kind is not None and what == "options":
                continue
            if kind is not None and not isinstance(number, kind):
                raise InputError(
                    f"Model {part.name}: its {what} must be a {kind.__name__}, not {number!r}."
                )
            for path in () if kind is None or what == "options" else floats_of(kind):
                value = value_at(number, path)
                if not is_real(value):
                    raise InputError(
                        f"Model {part.name}: {path} is {value!r}, but must be a real number."
                    )
        chosen = numbers[1]
        if chosen is None and part.options is not None:
            chosen = part.options()
        parts.append(Part(numbers[0], chosen, numbers[2]))
    return Instance(model, tuple(parts), name or model.name)


def records_of(
    instance: Instance, inputs: Mapping[str, ArrayLike], rate: float
) -> dict[str, Array]:
    """External signals on the model's grid, checked.

    Raises
    ------
    InputError
        For a missing or unknown signal, another length, or a sample that is no finite number.
    """
    if not is_real(rate) or not 0.0 < rate < np.inf:
        raise InputError(f"The rate is {rate!r} Hz, but must be a number above 0.")
    found = {name: column(values, name) for name, values in inputs.items()}
    sizes = {name: samples.size for name, samples in found.items()}
    if len(set(sizes.values())) > 1:
        listed = ", ".join(f"{name} {size}" for name, size in sizes.items())
        raise InputError(f"All inputs need the same number of samples: {listed}.")
    instance.check_inputs(found)
    if not found:
        raise InputError(f"{instance.name} needs a record of {', '.join(instance.model.external)}.")
    return found


def simulate(
    model: Model,
    p: Any,
    inputs: Mapping[str, ArrayLike],
    rate: float,
    *,
    options: Any = None,
    given: Any = None,
    start: Start = "rest",
    begin: Mapping[str, float] | None = None,
) -> Run:
    """Simulate a model over records on its own grid.

    Parameters
    ----------
    model : Model
        Of one's own, or one of the package's.
    p, options, given : named tuple
        Its numbers, see `instance_of`.
    inputs : mapping of str to (n,) array_like
        External signals; those with a default parameter may be left out.
    rate : float
        Samples a second; the step is one sample. [Hz]
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
    records = records_of(instance, inputs, rate)
    h = 1.0 / rate
    begun = instance.start({name: float(v[0]) for name, v in records.items()}, h, start)
    stored: list[Stored] = []
    names: list[str] = []
    for i, part in enumerate(model.parts):
        own = floats_of(part.signals) if part.signals is not None else ()
        for name in part.signal_names:
            stored.append(Stored(i, "signals" if name in own else "state", name))
            names.append(name)
    for name, link in model.links.items():
        stored.append(Stored(link.after, "link", name))
        names.append(name)
    out = marched(instance, records, h, begun, tuple(stored), begin=begin or {})
    signals = dict(zip(names, out, strict=True))
    for name, rate_of in model.integrals.items():
        total = np.zeros_like(signals[rate_of])
        np.cumsum(0.5 * h * (signals[rate_of][:-1] + signals[rate_of][1:]), out=total[1:])
        signals[name] = total
    size = next(iter(records.values())).size
    return Run(model, np.arange(size) / rate, records, signals)


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
) -> Array:
    """(n, k) exact derivatives of a signal by parameters, and by where the state begins.

    Parameters
    ----------
    model, p, inputs, rate, options, given, start, begin :
        As in `simulate`.
    output : str
        The signal.
    parameters : sequence of str, optional
        Paths of parameters, or ``start.`` with the path of a state that `begin` names; by default
        all parameters.
    """
    instance = instance_of(model, p, options=options, given=given)
    records = records_of(instance, inputs, rate)
    output_of(model, output)
    columns = tuple(parameters) if parameters is not None else parameter_paths(model)
    unknown = [c for c in columns if c not in parameter_paths(model) and c[:6] != "start."]
    if unknown:
        raise InputError(
            f"{model.name} has no parameter '{unknown[0]}'; it has "
            f"{', '.join(parameter_paths(model))}."
        )
    first, *others = records
    record, rest = Record(records[first], 0.0, rate, 1), {name: records[name] for name in others}
    observed = every_sample(record, output, first, start, rest)
    return jacobian(instance, observed, columns, Own(begin or {})).columns
