"""Dropouts: a signal that is lost for longer than a spike, while the motion goes on.

The instrument or the bus then repeats one reading: a mark such as -999, zero, or the last value.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.experiment import Channel, Experiment, InputSignal
from swashplate.campaign.schema import CURRENTS, shown_unit
from swashplate.parameters import FULL_VOLTAGE
from swashplate.units import display_unit

Array = NDArray[np.float64]

FEWEST, FEWEST_OF_INPUT = 6, 3
"""Equal samples in a row from which a stretch is looked at: fewer may be a spike."""
LONGEST = 2.0
"""A signal that stands for longer is not one that comes back. [s]"""
BESIDE = 20
"""Samples on each side that show what the signal does otherwise, if the stretch has no more."""
SUDDEN = 5.0
"""Factor by which a jump exceeds the steps beside it. An acceleration doubles them at most from one
sample to the next, a lag of three samples takes two thirds of a jump in its first."""
STARTS = 2.0
"""Factor by which a jump from zero exceeds the steps after it: a machine that stopped starts by a
step that is no larger than those that follow."""
LARGE = 0.05
"""Part of a signal's range below which a jump is no dropout. [1]"""
MOVES = 0.2
"""Part of a signal's largest value, or greatest speed, from which it is in motion. [1]"""
CHANCE = 1e-6
"""Probability of a stretch of equal samples in a run that is not left to chance. [1]"""
TO_AND_FRO = 0.25
"""Share of changes that turn back in a signal with noise: half of them do in white noise. [1]"""
REACTS, STRIDE = 0.3, 0.05
"""Time within which a drive begins to follow a jump of its command, and within which a command that
changes by more than a tenth of its range jumps. [s]"""
LARGEST_COMMAND = {"voltage": FULL_VOLTAGE, "current": 10.0}
"""Range of a card [V], and more than any solenoid takes [A]."""
NAMED = 6
"""Windows that a sentence names."""
Loss = Literal["mark", "fallen", "frozen"]
"""Far off all else; a value to which it falls and from which it comes back; its last value."""


class Dropout(NamedTuple):
    """A stretch of equal samples in which a signal was lost."""

    begin: float
    """Half an interval before it. [s]"""
    end: float
    """Half an interval after it. [s]"""
    value: float
    """[unit of the signal]"""
    loss: Loss


_KNOWN: WeakKeyDictionary[Experiment, list[tuple[Channel | InputSignal, tuple[Dropout, ...]]]]
_KNOWN = WeakKeyDictionary()
"""What was found in signals of an experiment: reading, check and report each ask for it."""


def find_dropouts(experiment: Experiment, signal: Channel | InputSignal) -> tuple[Dropout, ...]:
    """Stretches of at least six equal samples and at most 2 s that no motion explains.

    Notes
    -----
    A mark is beyond all other values by more than their range, a command's beyond the card. What
    else is lost could not do that: it jumps there and back by steps five times as large as those
    beside them, or its noise stops, or a position stands still between two fast motions, and the
    command does not jump before. Of equal samples in a row the probability follows from how many
    there are beside the stretch: readings that rest, or whose steps are coarse, are not frozen.
    """
    known = _KNOWN.setdefault(experiment, [])
    for other, dropouts in known:
        if other is signal:
            return dropouts
    known.append((signal, tuple(_found(experiment, signal))))
    return known[-1][1]


def _found(experiment: Experiment, signal: Channel | InputSignal) -> Iterator[Dropout]:
    """See `find_dropouts`."""
    time, values = signal.time[signal.used], signal.values[signal.used]
    if signal.kind == "other" or values.size < 4 * FEWEST or np.ptp(values) == 0.0:
        return
    fewest = FEWEST if isinstance(signal, Channel) else FEWEST_OF_INPUT
    changes = np.flatnonzero(np.diff(values) != 0.0) + 1
    firsts, stops = np.append(0, changes), np.append(changes, values.size)
    long = stops - firsts >= fewest
    half = 0.5 * float(np.median(np.diff(time)))
    levels = np.unique(values)
    for first, stop in zip(firsts[long].tolist(), stops[long].tolist(), strict=True):
        begin, end = float(time[first]) - half, float(time[stop - 1]) + half
        if end - begin > min(LONGEST, 0.5 * float(time[-1] - time[0])):
            continue
        loss = _loss(experiment, signal, values, levels, (first, stop), (begin, end))
        if loss is not None:
            yield Dropout(begin, end, float(values[first]), loss)


def _loss(
    experiment: Experiment,
    signal: Channel | InputSignal,
    values: Array,
    levels: Array,
    rows: tuple[int, int],
    window: tuple[float, float],
) -> Loss | None:
    """What became of a signal with values (n,) within a stretch of rows; None if it is sound.

    `levels` are its values in order, each once.
    """
    first, stop = rows
    value = float(values[first])
    low = float(levels[0] if levels[0] != value else levels[1])
    high = float(levels[-1] if levels[-1] != value else levels[-2])
    far_off = high > low and not 2.0 * low - high <= value <= 2.0 * high - low
    at_an_end = first < 2 or stop > values.size - 2
    # a log may begin or end with an instrument that is off
    if far_off and _is_mark(experiment, signal, value, window) and not (at_an_end and value == 0.0):
        return "mark"
    if at_an_end:
        return None
    length = max(stop - first, BESIDE)
    before, after = values[max(first - length, 0) : first], values[stop : stop + length]
    steps = np.diff(before), np.diff(after)
    if any(step.size < 2 for step in steps):
        return None
    largest_step = max(float(np.abs(step).max()) for step in steps)
    arrives, leaves = value - float(values[first - 1]), float(values[stop]) - value
    is_input = isinstance(signal, InputSignal)

    def noisy() -> bool:
        return all(_is_noisy(step) for step in steps)

    def unexplained() -> bool:
        if is_input:
            return noisy() or _unanswered(experiment, window)
        return not _command_jumps(experiment.input, window)

    least_jump = max(SUDDEN * largest_step, LARGE * float(levels[-1] - levels[0]))
    comes_back = arrives * leaves < 0.0 and abs(arrives + leaves) < 0.5 * abs(arrives)
    if comes_back and min(abs(arrives), abs(leaves)) > least_jump and unexplained():
        return "fallen"
    # a motion that passes zero meanwhile does not come back to the side that it left
    falls = abs(arrives) > max(least_jump, MOVES * max(abs(low), abs(high)))
    starts_suddenly = abs(leaves) > STARTS * largest_step
    if value == 0.0 and not is_input and falls and starts_suddenly and unexplained():
        return "fallen"
    repeats = max(float(np.mean(step == 0.0)) for step in steps)
    # none among so many may still be three in a hundred: the rule of three
    repeats = max(repeats, 3.0 / sum(step.size for step in steps))
    by_chance = values.size * min(repeats, 1.0) ** (stop - first)
    if by_chance > CHANCE or (is_input and not noisy()):
        return None
    if isinstance(signal, Channel) and signal.is_position:
        fastest = float(np.quantile(np.abs(_moved(values, stop - first)), 0.99))
        moved = float(values[first - 1] - before[0]), float(after[-1] - values[stop])
        fast = min(abs(part) for part in moved) > MOVES * fastest
        frozen = fast and moved[0] * moved[1] > 0.0
    else:
        in_motion = abs(value) > MOVES * max(abs(low), abs(high))
        frozen = in_motion and low < value < high and (noisy() or abs(leaves) > least_jump)
    return "frozen" if frozen and unexplained() else None


def _is_mark(
    experiment: Experiment, signal: Channel | InputSignal, value: float, window: tuple[float, float]
) -> bool:
    """Whether a value far off is a mark for none, and not a command or what answers one."""
    if isinstance(signal, InputSignal):
        return abs(value) > LARGEST_COMMAND[signal.kind]
    return not _command_jumps(experiment.input, window)


def _moved(values: Array, rows: int) -> Array:
    """Changes of a position over so many rows."""
    return np.asarray(values[rows:] - values[:-rows])


def _is_noisy(steps: Array) -> bool:
    """Whether steps (n,) turn back as often as those of noise do."""
    return bool(np.mean(steps[1:] * steps[:-1] < 0.0) > TO_AND_FRO)


def _command_jumps(drive: InputSignal, window: tuple[float, float]) -> bool:
    """Whether a command jumps shortly before either end of a window [s]."""
    for end in window:
        commands = drive.at(np.arange(end - REACTS, end + STRIDE, STRIDE))
        if np.abs(np.diff(commands)).max() > 0.1 * np.ptp(drive.values):
            return True
    return False


def _unanswered(experiment: Experiment, window: tuple[float, float]) -> bool:
    """Whether a measured current does not follow a command in a window [s]."""
    begin, end = window
    for channel in experiment.of_kind(*CURRENTS):
        within = (channel.time > begin - STRIDE) & (channel.time < end) & channel.used
        if within.any():
            current = np.abs(channel.values[within])
            flows = current.min() > MOVES * np.abs(channel.values[channel.used]).max()
            if flows and np.ptp(current) < MOVES * current.max():
                return True
    return False


def dropout_sentences(experiment: Experiment, signal: Channel | InputSignal) -> Iterator[str]:
    """A sentence for each way in which a signal was lost, with the line that leaves it out."""
    table = f"channels.{signal.name}" if isinstance(signal, Channel) else "input"
    found = find_dropouts(experiment, signal)
    for loss in dict.fromkeys(dropout.loss for dropout in found):
        lost = [dropout for dropout in found if dropout.loss == loss]
        display = display_unit(shown_unit(signal.kind, signal.unit), float(np.ptp(signal.values)))
        reading = f"{display.factor * lost[0].value:.4g} {display.name}"
        when = f"from {lost[0].begin:.6g} to {lost[0].end:.6g} s"
        if len(lost) > 1:
            when += " and once more" if len(lost) == 2 else f" and {len(lost) - 1} times more"
        said = {
            "mark": f"reads {reading} {when}, far off all else, as a mark for no value",
            "fallen": f"reads {reading} {when} and jumps there and back, which no motion does",
            "frozen": f"stands at {reading} {when} while the motion goes on",
        }[loss]
        windows = [
            f'{{ from = {dropout.begin:.6g}, to = {dropout.end:.6g}, why = "dropout" }}'
            for dropout in lost[:NAMED]
        ]
        line = f"axes.{experiment.axis}.{table}.ignore = [{', '.join(windows)}]"
        yield f"{said}: leave out with {line} in this run"
