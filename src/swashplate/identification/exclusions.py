"""Named rules for what the source leaves out of its error tables, each to be switched off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Kind = Literal["ramp", "step", "sine"]
Quantity = Literal["rectified_current", "shaft_speed", "other"]

EDGE = 0.25
"""A jump between two samples by this part of the largest command is an edge."""

OFF_ZERO = 0.01
"""Part of the largest command beyond which it has left zero."""


@dataclass(frozen=True, eq=False)
class ComparedRun:
    """One run of one kind of test, measured and simulated."""

    name: str
    kind: Kind
    quantity: Quantity
    time: Array
    """(n,) stamps. [s]"""
    command: Array
    """(n,) voltage. [V]"""
    measured: Array
    """(n,) in the quantity's unit."""
    simulated: Array
    """(n,) the same."""
    frequency: float | None = None
    """Of a sine. [Hz]"""


class Rule(Protocol):
    """Leaves out samples."""

    @property
    def name(self) -> str:
        """In a few words."""
        ...

    @property
    def why(self) -> str:
        """What is left out and for what reason, as a sentence."""
        ...

    def excluded(self, run: ComparedRun) -> Mask:
        """(n,) samples that are left out."""
        ...


@dataclass(frozen=True)
class StartTransient:
    """Leaves out the begin of speed records."""

    duration: float = 400.0 / 512.0
    """[s]"""
    name: str = "start transient"

    @property
    def why(self) -> str:
        """See `Rule`."""
        return (
            f"The first {self.duration:.3g} s of the speed: the plussing acts as a step when the "
            "simulation begins."
        )

    def excluded(self, run: ComparedRun) -> Mask:
        """See `Rule`."""
        concerned = run.quantity == "shaft_speed"
        early: Mask = (run.time < run.time[0] + self.duration) & concerned
        return early


@dataclass(frozen=True)
class Overshoot:
    """Leaves out what follows an edge of the command."""

    duration: float = 2.0
    """How long, which for steps must take in the rise. [s]"""
    kinds: tuple[Kind, ...] = ("step",)
    name: str = "overshoot"

    @property
    def why(self) -> str:
        """See `Rule`."""
        return (
            f"{self.duration:.3g} s after each edge of the command in {' and '.join(self.kinds)} "
            "tests: the solenoids' overshoot is not modelled."
        )

    def excluded(self, run: ComparedRun) -> Mask:
        """See `Rule`."""
        out = np.zeros(run.time.shape, dtype=np.bool_)
        if run.kind not in self.kinds:
            return out
        for begin in edges(run):
            out |= (run.time >= begin) & (run.time < begin + self.duration)
        return out


@dataclass(frozen=True)
class ZeroCrossings:
    """Leaves out the middle of sines of the rectified current."""

    share: float = 0.1
    """Of the largest command."""
    name: str = "zero crossings"

    @property
    def why(self) -> str:
        """See `Rule`."""
        return (
            f"Sines of the rectified current below {100.0 * self.share:.3g} % of the largest "
            "command: one ammeter around both leads misreads where the solenoids change over."
        )

    def excluded(self, run: ComparedRun) -> Mask:
        """See `Rule`."""
        concerned = run.kind == "sine" and run.quantity == "rectified_current"
        size = np.abs(run.command)
        small: Mask = (size < self.share * size.max(initial=0.0)) & concerned
        return small


@dataclass(frozen=True)
class FastSines:
    """Leaves out whole runs of fast sines."""

    frequency: float = 0.3
    """[Hz]"""
    name: str = "fast sines"

    @property
    def why(self) -> str:
        """See `Rule`."""
        return (
            f"Sines of {self.frequency:g} Hz and above: faster than any swell that a crane is "
            "to follow."
        )

    def excluded(self, run: ComparedRun) -> Mask:
        """See `Rule`."""
        fast = run.kind == "sine" and (run.frequency or 0.0) >= (1.0 - 1e-6) * self.frequency
        return np.full(run.time.shape, fast)


@dataclass(frozen=True)
class WholeKind:
    """Leaves out all tests of a kind."""

    kind: Kind = "step"
    reason: str = "the turret swings in its backlash, so that no steady value can be told"

    @property
    def name(self) -> str:
        """See `Rule`."""
        return f"{self.kind}s"

    @property
    def why(self) -> str:
        """See `Rule`."""
        return f"All {self.kind} tests: {self.reason}."

    def excluded(self, run: ComparedRun) -> Mask:
        """See `Rule`."""
        return np.full(run.time.shape, run.kind == self.kind)


@dataclass(frozen=True)
class SmallValues:
    """Leaves out where a relative error has no meaning."""

    share: float = 0.2
    """Of the largest measured size in the run."""
    name: str = "small values"

    @property
    def why(self) -> str:
        """See `Rule`."""
        return (
            f"Measured values below {100.0 * self.share:.3g} % of the run's largest: a per cent "
            "of next to nothing means nothing. The source does not state how it did this."
        )

    def excluded(self, run: ComparedRun) -> Mask:
        """See `Rule`."""
        size = np.abs(run.measured)
        small: Mask = size < self.share * size.max(initial=0.0)
        return small


SOURCE_RULES: Sequence[Rule] = (
    StartTransient(),
    Overshoot(),
    ZeroCrossings(),
    FastSines(),
    SmallValues(),
)
"""The source's exclusions on hoist; slew leaves out `WholeKind("step")` as well."""


def edges(run: ComparedRun) -> Array:
    """Instants at which the command jumps, or leaves zero for the first time. [s]"""
    size = np.abs(run.command)
    largest = float(size.max(initial=0.0))
    if largest == 0.0:
        return np.zeros(0)
    jumps = np.flatnonzero(np.abs(np.diff(run.command)) > EDGE * largest)
    leaving = np.flatnonzero(size > OFF_ZERO * largest)[:1]
    found: Array = run.time[np.unique(np.concatenate([jumps + 1, leaving]))]
    return found
