"""What a machine takes, gives and is set by, whether equations are behind it or a program."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import inf
from typing import Protocol

from swashplate.machine.fields import Definition


class Ports(Protocol):
    """Names of a machine with what they are: those of a `Model`, or of a black box."""

    @property
    def name(self) -> str:
        """Of the model, or of the black box."""
        ...

    @property
    def external(self) -> tuple[str, ...]:
        """Signals that come from outside."""
        ...

    @property
    def every_signal(self) -> tuple[str, ...]:
        """Signals that a run has besides those, integrals apart."""
        ...

    @property
    def integrals(self) -> Mapping[str, str]:
        """Signals that are integrals of others."""
        ...

    @property
    def outputs(self) -> Sequence[str]:
        """Signals of most use; none named means all."""
        ...

    @property
    def definitions(self) -> Mapping[str, Definition]:
        """Definitions of inputs, states and signals, as far as they are stated."""
        ...

    @property
    def input_definitions(self) -> Mapping[str, Definition]:
        """Those of the inputs."""
        ...

    @property
    def input_ranges(self) -> Mapping[str, tuple[float, float]]:
        """Least and largest value of the inputs that have a range."""
        ...

    @property
    def input_parameters(self) -> Mapping[str, str]:
        """Inputs that may be left out, with the parameter that then stands for each."""
        ...

    @property
    def parameter_definitions(self) -> Mapping[str, Definition]:
        """Definition of each parameter, by path."""
        ...

    @property
    def ranges(self) -> Mapping[str, Definition]:
        """Definitions of the parameters that have a range."""
        ...

    @property
    def starts(self) -> Mapping[str, str]:
        """Signal that each number of the state at the first sample is of, by ``start.PATH``."""
        ...

    @property
    def limit_bits(self) -> Mapping[str, tuple[int, int]]:
        """Part and bit of every limit."""
        ...

    @property
    def limit_meanings(self) -> Mapping[str, str]:
        """What each limit means."""
        ...

    @property
    def longest(self) -> float:
        """Longest step that its equations allow. [s]"""
        ...

    @property
    def state_signals(self) -> tuple[str, ...]:
        """Signals that are numbers of the state."""
        ...


@dataclass(frozen=True)
class StatedPorts:
    """Ports of a black box, as its author states them; see `Ports`."""

    name: str
    external: tuple[str, ...]
    every_signal: tuple[str, ...]
    parameters: tuple[str, ...]
    stated: Mapping[str, Definition] = field(default_factory=dict)
    """Definitions of inputs, outputs and parameters by name."""

    longest: float = inf
    outputs: tuple[str, ...] = ()
    state_signals: tuple[str, ...] = ()
    integrals: Mapping[str, str] = field(default_factory=dict)
    input_parameters: Mapping[str, str] = field(default_factory=dict)
    starts: Mapping[str, str] = field(default_factory=dict)
    limit_bits: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    limit_meanings: Mapping[str, str] = field(default_factory=dict)

    def _of(self, names: tuple[str, ...]) -> dict[str, Definition]:
        return {name: self.stated[name] for name in names if name in self.stated}

    @cached_property
    def definitions(self) -> dict[str, Definition]:
        """See `Ports`."""
        return self._of((*self.external, *self.every_signal))

    @cached_property
    def input_definitions(self) -> dict[str, Definition]:
        """See `Ports`."""
        return self._of(self.external)

    @cached_property
    def input_ranges(self) -> dict[str, tuple[float, float]]:
        """See `Ports`."""
        ranges = {name: (each.lower, each.upper) for name, each in self.input_definitions.items()}
        return {name: ends for name, ends in ranges.items() if ends != (-inf, inf)}

    @cached_property
    def parameter_definitions(self) -> dict[str, Definition]:
        """See `Ports`."""
        return {
            name: self.stated.get(name, Definition(name.rpartition(".")[2], ""))
            for name in self.parameters
        }

    @cached_property
    def ranges(self) -> dict[str, Definition]:
        """See `Ports`."""
        return self._of(self.parameters)
