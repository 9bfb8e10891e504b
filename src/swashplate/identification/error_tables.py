"""Error tables as the source has them: the largest per cent error of each kind of test."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol, get_args

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError

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


Reference = Literal["measured", "largest"]
"""What 100 % is: what is measured at that instant, or the largest size measured in the run."""


class LargestError(NamedTuple):
    """The largest error of a kind of test."""

    kind: Kind
    percent: float | None
    """None where no sample is left. [%]"""
    run: str | None
    """In which it is."""
    time: float | None
    """When. [s]"""
    samples: int
    """That were looked at, in all runs of the kind."""
    runs: int
    """Runs of the kind of which some samples were looked at."""


@dataclass(frozen=True)
class ErrorTable:
    """Largest per cent errors, as in the source's tables 4.5, 4.6, 7.5 and 7.6."""

    rows: tuple[LargestError, ...]
    """Of the kinds of test that there are: ramp, step, sine."""
    rules: tuple[Rule, ...]
    """That were applied."""
    acted: tuple[Rule, ...]
    """Those of them that left out a sample."""
    reference: Reference
    left_out: tuple[tuple[str, str], ...]
    """Runs that were left out as a whole, and the rule."""

    def sentences(self) -> tuple[str, ...]:
        """The table in words, and every rule that left out anything."""
        said = []
        for row in self.rows:
            if row.percent is None:
                said.append(f"{row.kind}: no sample is left to judge.")
            else:
                said.append(
                    f"{row.kind}: {row.percent:.2f} % in {row.run} at {row.time:.2f} s, of "
                    f"{row.samples} samples in {row.runs} run{'s' if row.runs > 1 else ''}."
                )
        of = "what is measured then" if self.reference == "measured" else "the run's largest value"
        said.append(f"Per cent of {of}.")
        said += [f"Left out ({rule.name}): {rule.why}" for rule in self.acted]
        return tuple(said)


def error_table(
    runs: Sequence[ComparedRun],
    *,
    rules: Sequence[Rule] = SOURCE_RULES,
    reference: Reference = "measured",
    average: float = 0.0,
) -> ErrorTable:
    """Largest per cent error by kind of test.

    Parameters
    ----------
    runs : sequence of ComparedRun
        Runs of one axis and quantity.
    rules : sequence of Rule
        What is left out; fewer rules switch the others off.
    reference : {"measured", "largest"}
        What 100 % is.
    average : float
        Width of a moving mean over the differences, for currents with dither: the source read its
        errors off figures. 0 is none. [s]

    Raises
    ------
    InputError
        If there is no run, lengths differ, a number is not finite, or the width is negative.

    Notes
    -----
    The source speaks of the region with the largest per cent error and gives neither formula nor
    limits of the regions; they are stated here as rules and printed with the table.
    """
    if not runs:
        raise InputError("An error table needs at least one run.")
    if not average >= 0.0:
        raise InputError(f"The width {average:g} s of a moving mean must not be negative.")
    rows, left_out = [], list[tuple[str, str]]()
    acted = set[str]()
    for kind in get_args(Kind):
        alike = [run for run in runs if run.kind == kind]
        if not alike:
            continue
        best: tuple[float, str, float] | None = None
        samples, judged = 0, 0
        for run in alike:
            _check(run)
            kept, whole, by = _kept(run, rules)
            acted.update(by)
            if whole is not None:
                left_out.append((run.name, whole))
            percent, defined = _percent(run, reference, average)
            places = np.flatnonzero(kept & defined)
            samples += places.size
            judged += bool(places.size)
            if places.size and (best is None or percent[places].max() > best[0]):
                worst = int(places[np.argmax(percent[places])])
                best = float(percent[worst]), run.name, float(run.time[worst])
        percent_of, where, when = best if best is not None else (None, None, None)
        rows.append(LargestError(kind, percent_of, where, when, samples, judged))
    of_use = tuple(rule for rule in rules if rule.name in acted)
    return ErrorTable(tuple(rows), tuple(rules), of_use, reference, tuple(left_out))


class SineError(NamedTuple):
    """Error of a sine by its first harmonic."""

    amplitude_percent: float
    """Simulated amplitude less measured, of the measured. [%]"""
    phase: float
    """Simulated phase less measured; positive leads. [rad]"""


def sine_error(run: ComparedRun, *, rules: Sequence[Rule] = SOURCE_RULES) -> SineError:
    """Amplitude and phase error of a sine, which its shape's errors do not enter.

    Parameters
    ----------
    run : ComparedRun
        With a frequency.
    rules : sequence of Rule
        What is left out.

    Raises
    ------
    InputError
        If it is no sine of known frequency, or rectified, less than a period is left, or nothing
        was measured.
    """
    _check(run)
    if run.kind != "sine" or not run.frequency:
        raise InputError(f"{run.name} is no sine of known frequency; it has no amplitude error.")
    if run.quantity == "rectified_current":
        raise InputError(f"{run.name}: a rectified current is no sine any more.")
    kept, _, _ = _kept(run, rules)
    time = run.time[kept]
    if time.size < 8 or _length(time) < (1.0 - 1e-6) / run.frequency:
        raise InputError(f"Of {run.name} less than one period is left to judge.")
    turn = 2.0 * np.pi * run.frequency * time
    columns = np.column_stack([np.cos(turn), np.sin(turn), np.ones(time.size)])
    measured, simulated = (
        complex(*np.linalg.lstsq(columns, samples[kept], rcond=None)[0][:2]).conjugate()
        for samples in (run.measured, run.simulated)
    )
    if abs(measured) == 0.0:
        raise InputError(f"Of {run.name} nothing was measured at {run.frequency:g} Hz.")
    ratio = simulated / measured
    return SineError(100.0 * (abs(ratio) - 1.0), float(np.angle(ratio)))


def _length(time: Array) -> float:
    """Time that samples stand for. [s]"""
    return float(np.ptp(time) + np.median(np.diff(time)))


def _percent(
    run: ComparedRun, reference: Reference, average: float
) -> tuple[Array, NDArray[np.bool_]]:
    """(n,) errors, and where there is something that they can be a part of. [%]"""
    difference = run.simulated - run.measured
    if average > 0.0 and run.time.size > 1:
        width = max(round(average / float(np.median(np.diff(run.time)))), 1)
        inside = np.convolve(np.ones(difference.size), np.ones(width), "same")
        difference = np.convolve(difference, np.ones(width), "same") / inside
    size = np.abs(run.measured)
    full = size if reference == "measured" else np.full(size.shape, size.max())
    percent = 100.0 * np.abs(difference)
    return np.divide(percent, full, out=np.zeros_like(full), where=full > 0.0), full > 0.0


def _kept(
    run: ComparedRun, rules: Sequence[Rule]
) -> tuple[NDArray[np.bool_], str | None, list[str]]:
    """(n,) samples that no rule leaves out, the rule that leaves out all, and those that act."""
    kept = np.ones(run.time.shape, dtype=np.bool_)
    acted = []
    for rule in rules:
        out = rule.excluded(run)
        if out.all():
            # of what is not there at all no other rule can take anything
            return ~out, rule.name, [rule.name]
        if out.any():
            acted.append(rule.name)
        kept &= ~out
    return kept, None, acted


def _check(run: ComparedRun) -> None:
    arrays = (run.time, run.command, run.measured, run.simulated)
    if len({each.shape for each in arrays}) != 1 or not run.time.size:
        raise InputError(f"{run.name}: time, command, measured and simulated differ in length.")
    if not all(np.isfinite(each).all() for each in arrays):
        raise InputError(f"{run.name}: a sample is not finite; leave it out.")
