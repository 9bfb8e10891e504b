"""Kruse's error tables: the largest per cent error of each kind of test, by stated rules."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import Experiment
from swashplate.errors import InputError
from swashplate.identification import RunQuality

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Kind = Literal["ramp", "step", "sine"]

START = 400.0 / 512.0
"""Begin of speed records that is left out. [s]"""
OVERSHOOT = 2.0
"""What is left out behind an edge of a step, its rise taken in. [s]"""
CROSSING = 0.1
"""Of a sine's largest command, below which one ammeter around both leads misreads. [1]"""
FAST = 0.3
"""Frequency from which sines are left out. [Hz]"""
SMALL = 0.2
"""Of the largest measured size, below which a per cent means nothing. [1]"""
EDGE = 0.25
"""A jump between two samples by this part of the largest command is an edge."""
OFF_ZERO = 0.01
"""Part of the largest command beyond which it has left zero."""
DITHER_MEAN = 0.1
"""Width of the moving mean over a current's differences, against the dither. [s]"""


@dataclass(frozen=True, eq=False)
class ComparedRun:
    """One run of one kind of test, measured and simulated, where it counts."""

    name: str
    kind: Kind
    quantity: str
    """Kind of the channel, such as ``"shaft_speed"``."""
    time: Array
    """(n,) stamps. [s]"""
    command: Array
    """(n,) voltage. [V]"""
    measured: Array
    """(n,) in the channel's unit."""
    simulated: Array
    """(n,) the same."""
    frequency: float | None = None
    """Of a sine. [Hz]"""


class Rule(NamedTuple):
    """What leaves out samples."""

    name: str
    """In a few words."""
    why: str
    """What is left out and for what reason, as a sentence."""
    excluded: Callable[[ComparedRun], Mask | bool]
    """From a run the (n,) samples that are left out, or one answer for all."""


def _after_edges(run: ComparedRun) -> Mask | bool:
    if run.kind != "step":
        return False
    since = run.time[:, None] - edges(run)
    after: Mask = np.any((since >= 0.0) & (since < OVERSHOOT), axis=1)
    return after


def _small(values: Array, share: float) -> Mask:
    size = np.abs(values)
    small: Mask = size < share * size.max(initial=0.0)
    return small


SOURCE_RULES: tuple[Rule, ...] = (
    Rule(
        "start transient",
        f"The first {START:.3g} s of the speed: the plussing acts as a step when the simulation "
        "begins.",
        lambda run: (run.time < run.time[0] + START) & (run.quantity == "shaft_speed"),
    ),
    Rule(
        "overshoot",
        f"{OVERSHOOT:.3g} s after each edge of the command in step tests: the solenoids' overshoot "
        "is not modelled.",
        _after_edges,
    ),
    Rule(
        "zero crossings",
        f"Sines of the rectified current below {100.0 * CROSSING:.3g} % of the largest command: "
        "one ammeter around both leads misreads where the solenoids change over.",
        lambda run: (
            (run.kind == "sine" and run.quantity == "rectified_current")
            & _small(run.command, CROSSING)
        ),
    ),
    Rule(
        "fast sines",
        f"Sines of {FAST:g} Hz and above: faster than any swell that a crane is to follow.",
        lambda run: run.kind == "sine" and (run.frequency or 0.0) >= (1.0 - 1e-6) * FAST,
    ),
    Rule(
        "small values",
        f"Measured values below {100.0 * SMALL:.3g} % of the run's largest: a per cent of next to "
        "nothing means nothing. Kruse (2001) does not state how he did this.",
        lambda run: _small(run.measured, SMALL),
    ),
)
"""Kruse's exclusions on hoist."""

STEPS = Rule(
    "steps",
    "All step tests: the turret swings in its backlash, so that no steady value can be told.",
    lambda run: run.kind == "step",
)


def source_rules(drive: str) -> tuple[Rule, ...]:
    """What Kruse (2001) leaves out of his tables for a drive of that name: of slew all steps."""
    return (*SOURCE_RULES, STEPS) if drive == "slew" else SOURCE_RULES


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
    """Largest per cent errors of one channel, as in Kruse's tables 4.5, 4.6, 7.5 and 7.6."""

    channel: str
    rows: tuple[LargestError, ...]
    """Of the kinds of test that there are: ramp, step, sine."""
    rules: tuple[Rule, ...]
    """That were applied."""
    acted: tuple[Rule, ...]
    """Those of them that left out a sample."""
    left_out: tuple[tuple[str, str], ...]
    """Runs that were left out as a whole, and the rule."""
    average: float
    """Width of the moving mean over the differences. [s]"""
    unjudged: tuple[str, ...] = ()
    """Runs that are neither ramp, step nor sine, or too short."""


def error_tables(
    qualities: Sequence[RunQuality], rules: Sequence[Rule] = SOURCE_RULES
) -> tuple[ErrorTable, ...]:
    """Kruse's error table of each channel: the largest per cent error by kind of test.

    Positions are passed over: their zero is free, so that a per cent of one means nothing; take
    `with_speeds`. Kruse (2001) speaks of the region with the largest per cent error without a
    formula or limits of the regions; they are stated here as rules and printed with the table.
    """
    made = []
    for name in dict.fromkeys(each.channel for each in qualities):
        alike = [each for each in qualities if each.channel == name]
        channel = alike[0].experiment[name]
        found = {each.experiment.name: compared_run(each) for each in alike}
        judged = [run for run in found.values() if run is not None]
        if judged and not channel.is_position:
            unjudged = tuple(run for run, each in found.items() if each is None)
            average = DITHER_MEAN if channel.unit == "A" else 0.0
            made.append(error_table(name, judged, rules, average, unjudged))
    return tuple(made)


def compared_run(quality: RunQuality) -> ComparedRun | None:
    """A channel of a run as Kruse's error tables take it, None if it is of no kind there."""
    experiment, channel = quality.experiment, quality.experiment[quality.channel]
    kind, used = kind_of(experiment), channel.used
    if kind is None or np.count_nonzero(used) < 8:
        return None
    time, recognised = channel.time[used], experiment.recognised
    return ComparedRun(
        experiment.name,
        kind,
        channel.kind,
        time,
        experiment.input.at(time),
        channel.values[used],
        quality.simulated[used],
        recognised.frequency if recognised is not None else None,
    )


def kind_of(experiment: Experiment) -> Kind | None:
    """Kind of a test in Kruse's tables, by the first word of its maneuver."""
    word = experiment.maneuver.split(" ")[0]
    return next((each for each in get_args(Kind) if each == word), None)


def error_table(
    channel: str,
    runs: Sequence[ComparedRun],
    rules: Sequence[Rule] = SOURCE_RULES,
    average: float = 0.0,
    unjudged: tuple[str, ...] = (),
) -> ErrorTable:
    """Largest per cent error of what is measured in runs of one axis and channel, by kind of test.

    `average` is the width of a moving mean over the differences, for currents with dither: the
    source read its errors off figures. 0 is none. [s]

    Raises
    ------
    InputError
        If lengths differ or a number is not finite.
    """
    rows, acted, left_out = [], set[str](), list[tuple[str, str]]()
    for kind in get_args(Kind):
        alike = [run for run in runs if run.kind == kind]
        best: tuple[float, str, float] | None = None
        samples = judged = 0
        for run in alike:
            kept, by, whole = kept_by(run, rules)
            acted.update(by)
            left_out += [(run.name, by[0])] if whole else []
            percent = _percent(run, average)
            places = np.flatnonzero(kept & np.isfinite(percent))
            samples += places.size
            judged += bool(places.size)
            if places.size and (best is None or percent[places].max() > best[0]):
                worst = int(places[np.argmax(percent[places])])
                best = float(percent[worst]), run.name, float(run.time[worst])
        if alike:
            percent_of, where, when = best or (None, None, None)
            rows.append(LargestError(kind, percent_of, where, when, samples, judged))
    of_use = tuple(rule for rule in rules if rule.name in acted)
    return ErrorTable(
        channel, tuple(rows), tuple(rules), of_use, tuple(left_out), average, unjudged
    )


def kept_by(run: ComparedRun, rules: Sequence[Rule]) -> tuple[Mask, list[str], bool]:
    """(n,) samples that rules leave in, names of those that act, and whether one leaves out all."""
    arrays = (run.time, run.command, run.measured, run.simulated)
    if len({each.shape for each in arrays}) != 1 or not run.time.size:
        raise InputError(f"{run.name}: time, command, measured and simulated differ in length.")
    if not all(np.isfinite(each).all() for each in arrays):
        raise InputError(f"{run.name}: a sample is not finite; leave it out.")
    kept, acted = np.ones(run.time.shape, dtype=np.bool_), list[str]()
    for rule in rules:
        out = np.broadcast_to(rule.excluded(run), kept.shape)
        if out.all():
            # of what is not there at all no other rule can take anything
            return ~out, [rule.name], True
        acted += [rule.name] if out.any() else []
        kept &= ~out
    return kept, acted, False


def _percent(run: ComparedRun, average: float) -> Array:
    """(n,) errors of what is measured; nan where that is nothing. [%]"""
    difference = run.simulated - run.measured
    if average > 0.0 and run.time.size > 1:
        width = max(round(average / float(np.median(np.diff(run.time)))), 1)
        inside = np.convolve(np.ones(difference.size), np.ones(width), "same")
        difference = np.convolve(difference, np.ones(width), "same") / inside
    size = np.abs(run.measured)
    nothing = np.full_like(size, np.nan)
    return np.divide(100.0 * np.abs(difference), size, out=nothing, where=size > 0.0)
