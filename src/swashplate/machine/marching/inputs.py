"""Inputs of a machine: sampled, in SI, within their ranges, on the grid of its steps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import inf
from typing import Any, Protocol, Unpack, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.errors import InputError, ParameterError
from swashplate.machine.fields import Definition, check_mapping
from swashplate.machine.marching.record import Record, Sampling, least_substeps, on_grid
from swashplate.machine.marching.run import Machine
from swashplate.machine.model import full_name
from swashplate.machine.plausible import check_plausible
from swashplate.machine.ports import Ports
from swashplate.units import in_si

Array = NDArray[np.float64]


@runtime_checkable
class Command(Protocol):
    """An input as a function of time, such as a `swashplate.maneuvers.Maneuver`."""

    # more than is used here, as columns of pandas and polars have a name and draw samples, too

    @property
    def name(self) -> str:
        """What a figure calls it."""
        ...

    @property
    def length(self) -> float:
        """Duration. [s]"""
        ...

    def sample(self, rate: float) -> Array:
        """Samples at a rate [Hz], from 0 s on."""
        ...

    def __call__(self, time: Any) -> Array:
        """Values at some instants. [s]"""
        ...


def inputs_of(
    machine: Machine,
    inputs: Mapping[str, ArrayLike | Command],
    rate: float,
    **sampling: Unpack[Sampling],
) -> dict[str, Record]:
    """External signals of a machine on its grid, checked; arguments as of `simulate`.

    Raises
    ------
    InputError
        For signals that do not fit the model or lie beyond their range.
    """
    check_mapping("inputs", inputs)
    ports = machine.ports
    inputs = {full_name(name, ports.external): each for name, each in inputs.items()}
    machine.check_inputs(inputs)
    if not inputs:
        needed = ", ".join(ports.external) or "an input, but its equations take none"
        raise InputError(f"{machine.name} needs a record of {needed}.")
    rate = in_si(rate, "Hz", "The rate")
    if sampling.get("time") is not None:
        sampling["time"] = in_si(sampling["time"], "s", "The time")
    sampling["substeps"] = substeps_of(ports, rate, sampling.get("substeps"))
    samples = {name: _samples(ports, name, signal, rate) for name, signal in inputs.items()}
    return {
        name: within_range(ports, name, record, clip=sampling.get("clip", False))
        for name, record in on_grid(samples, rate, **sampling).items()
    }


def substeps_of(ports: Ports, rate: float, requested: int | None) -> int | None:
    """Steps a sample that keep a model's step as short as it must be, or those requested."""
    if ports.longest == inf:
        return requested
    return least_substeps(rate, requested, ports.longest)


def _samples(ports: Ports, name: str, signal: ArrayLike | Command, rate: float) -> ArrayLike:
    """Samples of an input in its SI unit."""
    if isinstance(signal, np.ndarray):  # told sooner than what has a method or a unit
        return signal
    if isinstance(signal, str):
        raise InputError(
            f"The {name} is the text '{signal}': give samples, or a maneuver such as "
            f"maneuvers.parse('{signal}')."
        )
    if isinstance(signal, Command):
        return signal.sample(rate)
    definition = ports.input_definitions.get(name)
    samples: ArrayLike = signal
    if definition is not None:
        samples = in_si(signal, definition.unit, f"The {name}")
    return samples


def within_range(ports: Ports, name: str, record: Record, *, clip: bool = False) -> Record:
    """An input's record; one beyond the range of the input is refused, or clipped on request.

    Raises
    ------
    InputError
        The sentence names the first such sample, and what the input is.
    """
    definition = ports.input_definitions.get(name)
    if definition is None:
        return record
    if name not in ports.input_ranges and definition.plausible is None:
        return record
    least, most = ports.input_ranges.get(name, (-inf, inf))
    values = record.values
    low, high = float(values.min()), float(values.max())
    if definition.plausible is not None:
        try:
            check_plausible(name, definition, max(low, high, key=abs))
        except ParameterError as error:
            raise InputError(str(error)) from None
    if low >= least and high <= most:
        return record
    if clip:
        return replace(record, values=np.clip(values, least, most))
    first = int(np.argmax((values < least) | (values > most)))
    seconds = record.start + first * record.step
    raise InputError(f"{beyond_range(name, definition, values[first], seconds)}.")


def beyond_range(name: str, definition: Definition, value: float, seconds: float) -> str:
    """What is wrong with a sample beyond the range of its input, without the stop."""
    unit = "" if definition.unit == "1" else f" {definition.unit}"
    return (
        f"The {name} is {value:g}{unit} at {seconds:g} s, but must be {definition.span}"
        f"{unit}: it is the {definition.name}; check its unit, or clip it"
    )
