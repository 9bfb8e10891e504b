"""What is recognised: a kind of manoeuvre, its numbers and its windows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from swashplate.errors import InputError

Kind = Literal["rest", "step", "stairs", "ramp", "sine", "free"]


class Window(NamedTuple):
    """A part of a record, on the clock of its stamps."""

    start: float
    """First instant. [s]"""
    stop: float
    """Last instant. [s]"""


@dataclass(frozen=True, eq=False)
class Recognised:
    """The manoeuvre of a record. Numbers are rounded to what the data support.

    Levels and amplitudes are relative to `rest`, in `unit`; positive and negative as in the record.
    A number that does not belong to the kind is None.
    """

    kind: Kind
    name: str
    """As `swashplate.maneuvers` names it: ``"step +4 V"``, ``"sine 6.5 V 0.1 Hz"``, ``"free"``."""
    unit: str
    """Unit of the record."""
    rest: float
    """The input at rest, not rounded. [unit]"""
    noise: float
    """Standard deviation of the noise from sample to sample, an upper estimate. [unit]"""
    residual: float
    """RMS of record less manoeuvre, returns and jumps left out; of a free record its RMS about
    rest. [unit]"""
    reason: str
    """Why it is that, or what spoke against every kind: one sentence."""
    level: float | None = None
    """Level of a step. [unit]"""
    levels: tuple[float, ...] = ()
    """Levels of a step or of stairs in their order, without the rest at the end. [unit]"""
    dwell: float | None = None
    """How long a step or each of the stairs is held; None also where stairs differ. [s]"""
    slope: float | None = None
    """Slope of a ramp. [unit/s]"""
    limit: float | None = None
    """Level at which a ramp ends and is held, None for one that is cut short. [unit]"""
    amplitude: float | None = None
    """Amplitude of a sine, negative for one that begins downwards. [unit]"""
    frequency: float | None = None
    """Frequency of a sine. [Hz]"""
    fitted: Mapping[str, float] = field(default_factory=dict)
    """The same numbers as they were fitted: ``"level"`` or ``"level 1"``, ``"slope"``,
    ``"frequency"``, ``"start"``, ``"return start"`` and the like, in the same units."""
    windows: Mapping[str, tuple[Window, ...]] = field(default_factory=dict)
    """Parts of the record by name, each one or several in their order.

    rest: ``rest``. step: ``before``, ``rise``, ``plateau``, ``fall`` or ``return``, ``after``.
    stairs: the same with a ``rise`` and a ``plateau`` for each level. ramp: ``before``, ``rise``,
    ``hold``, ``return`` or ``fall``, ``after``. sine: ``before``, ``run``, ``periods``, ``return``
    or ``fall``, ``after``. free: none. A part that the record does not have is left out.
    """
    zero_crossings: tuple[float, ...] = ()
    """Instants at which a sine changes its sign within its run. [s]"""

    def window(self, name: str) -> Window:
        """The first window of a name.

        Raises
        ------
        InputError
            If there is none; the sentence lists those that there are.
        """
        if name not in self.windows:
            there = ", ".join(self.windows) or "none"
            raise InputError(f"'{self.name}' has no window '{name}'; its windows are: {there}.")
        return self.windows[name][0]
