"""What a reproduced figure or table holds, before anything is drawn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Role = Literal["command", "simulated", "other", "virtual"]
"""The scaled command, the curve that Kruse (2001) simulated, what it is compared with, and what the
instruments of a virtual test read."""


class Curve(NamedTuple):
    """A line over time."""

    name: str
    time: Array
    """(n,) [s]"""
    values: Array
    """(n,) in the panel's unit."""
    role: Role
    held: bool = False
    """A staircase: each sample holds up to the next."""


class Level(NamedTuple):
    """A height that the curves are compared with, in the panel's unit."""

    height: float
    words: str


class Panel(NamedTuple):
    """One pair of axes."""

    ordinate: str
    """What is drawn and in which unit."""
    curves: tuple[Curve, ...]
    levels: tuple[Level, ...] = ()


class Node(NamedTuple):
    """A block of a diagram."""

    key: str
    column: float
    row: float
    """Of its middle; rows count downwards."""
    words: str
    plain: bool = False
    """Words without a frame: a signal that enters or leaves."""


class Arrow(NamedTuple):
    """From block to block, by their keys; bent where they share neither row nor column."""

    start: str
    end: str
    words: str = ""


@dataclass(frozen=True)
class Diagram:
    """A block diagram."""

    nodes: tuple[Node, ...]
    arrows: tuple[Arrow, ...]


@dataclass(frozen=True)
class Figure:
    """A figure of Kruse (2001), reproduced."""

    number: str
    """In the source: ``"4.3"``."""
    title: str
    caption: str
    """In sentences: what is drawn, how it is scaled, what the source drew besides."""
    content: tuple[Panel, ...] | Diagram
    errata: tuple[int, ...] = ()
    """Errata of the source that touch it."""
    virtual: bool = False
    """Whether anything in it was read by the instruments of a virtual test."""

    @property
    def anchor(self) -> str:
        """Its place in a page: ``"figure-4-3"``."""
        return f"figure-{self.number.replace('.', '-')}"


class Cell(NamedTuple):
    """A cell of a table. ``_{...}`` in the text is a subscript."""

    text: str
    mark: str = ""
    """Erratum by which it differs from what Kruse (2001) prints."""


@dataclass(frozen=True)
class Table:
    """A table of Kruse (2001), regenerated."""

    number: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    notes: tuple[str, ...] = ()
    virtual: bool = False

    @property
    def anchor(self) -> str:
        """Its place in a page: ``"table-4-1"``."""
        return f"table-{self.number.replace('.', '-')}"


@dataclass(frozen=True)
class Reproduction:
    """All that was reproduced."""

    figures: tuple[Figure, ...]
    tables: tuple[Table, ...]
    seed: int
    """Of the virtual tests."""
    provenance: tuple[tuple[str, str], ...]
    """What it was made of, and with which versions."""
