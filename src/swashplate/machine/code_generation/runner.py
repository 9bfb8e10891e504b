"""Equations that are run on symbols, as loops see it that run others within them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any, NamedTuple, Protocol

from swashplate.machine.code_generation.values import Value
from swashplate.machine.declaration import Replacements
from swashplate.machine.graph import Node
from swashplate.machine.language import Parsed


class Callee(NamedTuple):
    """An equation that is run, and what stands for others within it."""

    source: Parsed
    replacements: Replacements


class Runner(Protocol):
    """What a loop needs of the trace that it becomes part of; see `tracing.Trace`."""

    labels: dict[Node, str]
    origins: dict[Node, Parsed]
    under_way: list[Callee]

    def run(self, callee: Callee, arguments: Mapping[str, Value]) -> Value:
        """What an equation returns."""

    def inner(self, source: Parsed) -> Runner:
        """A separate trace for an equation that is run within another, again and again."""

    def within(self, chain: Sequence[Callee]) -> AbstractContextManager[None]:
        """Back within equations that were under way at some time."""

    def make(self, op: str, *args: Node, value: Any = None) -> Node:
        """A node that comes from the equation that is being run."""

    def label(self, value: Value, stem: str) -> None:
        """Remember what an equation calls a value."""
