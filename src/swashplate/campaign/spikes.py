"""Spikes of a signal, and counts that an encoder lost: samples that no motion explains."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import inf, isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.dropouts import dropout_sentences, find_dropouts
from swashplate.campaign.experiment import Channel, Experiment, InputSignal
from swashplate.campaign.samples import find_lost_counts
from swashplate.tables import count

Array = NDArray[np.float64]

NEIGHBOURS = 11
"""Samples of the running median: up to five in a row may be a spike."""
TOGGLES = 2.5
"""Steps of its converter within which a reading at rest goes to and fro: a converter's noise at a
steady input spans a few codes (Kester, ADC input noise, Analog Devices MT-004)."""
UNUSUAL = 2.0
"""Factor by which a spike's own steps exceed the larger ones of the motion around it: at a turning
point, the steps to and from it are the motion's own."""
FEW = 3
"""Excursions from which on levels are taken for steps of a converter."""
NAMED = 6
"""Windows that a sentence names."""


def find_spikes(
    signal: Channel | InputSignal, drive: InputSignal
) -> list[tuple[float, float, float]]:
    """Single samples that no motion explains: up to five in a row, of the input itself up to two.

    For each the instants before and after it, half an interval off [s], and its value farthest from
    what lasts [unit of the signal]. Of an encoder, jumps of its counter that come back.

    Notes
    -----
    A sample is one where it lies more than 8 median absolute deviations from the running median of
    11 samples, and beyond all values of that median by a tenth of their range; or, of a channel
    while the input has stood still for 0.3 s, by a quarter of the range from the median within it.
    Of a position that wraps a quarter of a turn is enough: it is read while it goes back.
    A still sensor that toggles between neighbouring steps of its converter has no spikes; nor is
    the peak of a slow log one, to which steps of the usual size lead.
    """
    from scipy.ndimage import median_filter

    time, values = signal.time[signal.used], signal.values[signal.used]
    if isinstance(signal, Channel) and signal.counts is not None:
        return [(jump.begin, jump.end, jump.value) for jump in lost_counts(signal) if jump.returns]
    if signal.kind == "other" or time.size < 4 * NEIGHBOURS:
        return []
    lasting = median_filter(values, size=NEIGHBOURS, mode="nearest")
    low, high = float(lasting.min()), float(lasting.max())
    off = np.abs(values - lasting)
    least = max(8.0 * float(np.median(off)), TOGGLES * step_of_reading(values))
    room, most = max(0.1 * (high - low), least), 2
    is_spike = (values > high + room) | (values < low - room)
    if signal is not drive:
        most = NEIGHBOURS // 2
        within = off > max(0.25 * (high - low), least)
        if within.any():
            grid = np.linspace(-0.3, 0.0, 7)[:, None] + time
            commands = drive.at(grid.ravel()).reshape(grid.shape)
            is_spike |= within & (np.ptp(commands, axis=0) <= 0.02 * np.ptp(drive.values))
        if isinstance(signal, Channel) and signal.rolls_over_at is not None:
            is_spike |= off > 0.25 * signal.rolls_over_at
    rows = np.flatnonzero(is_spike & (off > least))
    half = 0.5 * float(np.median(np.diff(time)))
    groups = np.split(rows, np.flatnonzero(np.diff(rows) > NEIGHBOURS // 2) + 1)
    return [
        (float(time[g[0]]) - half, float(time[g[-1]]) + half, float(values[g[off[g].argmax()]]))
        for g in groups
        if g.size and g[-1] - g[0] < most and _stands_out(values, int(g[0]), int(g[-1]))
    ]


def _stands_out(values: Array, first: int, last: int) -> bool:
    """Whether samples from one row to another are reached and left by steps of unusual size.

    Of the steps beside them within the running median, the larger ones are usual: a motion whose
    turning point a slow log shows arrives there by such steps.
    """
    begin, end = max(first - NEIGHBOURS // 2, 0), last + NEIGHBOURS // 2 + 1
    beside = np.concatenate(
        [np.abs(np.diff(values[begin:first])), np.abs(np.diff(values[last + 1 : end]))]
    )
    usual = float(np.quantile(beside, 0.75)) if beside.size else 0.0
    arrives = abs(values[first] - values[first - 1]) if first else np.inf
    leaves = abs(values[last + 1] - values[last]) if last + 1 < values.size else np.inf
    return bool(min(arrives, leaves) > UNUSUAL * usual)


def step_of_reading(values: Array) -> float:
    """Step of the converter that readings (n,) come from, 0 if they do not show any.

    The smallest distance between two of their levels, if the readings go to and fro between them:
    one sample far off is no converter's step.
    """
    if np.count_nonzero(np.diff(values)) < 2 * FEW:
        return 0.0
    levels = np.unique(values)
    distances = np.diff(levels)
    # rounding of a decimal number, or of a scale, makes equal levels differ
    distances = distances[distances > 1e-9 * float(np.abs(levels).max())]
    return float(distances.min()) if distances.size else 0.0


def spike_sentences(experiment: Experiment, signal: Channel | InputSignal) -> Iterator[str]:
    """A sentence on a signal's spikes, with the line that leaves them out."""
    spiked_at = find_spikes(signal, experiment.input)
    windows = [f'{{ from = {a:.6g}, to = {b:.6g}, why = "spike" }}' for a, b, _ in spiked_at]
    rest = f" and {len(spiked_at) - NAMED} more like these" if len(spiked_at) > NAMED else ""
    table = f"channels.{signal.name}" if isinstance(signal, Channel) else "input"
    line = f"axes.{experiment.axis}.{table}.ignore = [{', '.join(windows[:NAMED])}]"
    if spiked_at:
        largest = f"{max((value for _, _, value in spiked_at), key=abs):.4g} {signal.unit}"
        if isinstance(signal, Channel) and signal.counts is not None:
            jumps = [jump.counts for jump in lost_counts(signal) if jump.returns]
            largest = f"{max(jumps, key=abs):+.0f} counts"
        spike = count(len(spiked_at), "spike")
        yield f"{spike}, up to {largest}{rest}: leave out with {line} in this run"


class LostCounts(NamedTuple):
    """A jump of an encoder's counter that no motion explains."""

    begin: float
    """Half an interval before it. [s]"""
    end: float
    """Half an interval before it came back; infinite if it did not. [s]"""
    counts: float
    """Counts that it jumped by, less those of the motion before it."""
    value: float
    """Reading after it. [unit]"""

    @property
    def returns(self) -> bool:
        """Whether the counter came back, so that leaving out the samples between is enough."""
        return isfinite(self.end)


def lost_counts(channel: Channel) -> list[LostCounts]:
    """Jumps of an encoder's counter, see `samples.find_lost_counts`.

    Two that cancel within five samples, but for what the shaft moves meanwhile, are one that came
    back.
    """
    if channel.counts is None:
        return []
    time, counts = channel.time[channel.used], channel.counts[channel.used]
    values, rows = channel.values[channel.used], find_lost_counts(time, counts).tolist()
    half = 0.5 * float(np.median(np.diff(time))) if rows else 0.0
    usual = float(np.median(np.abs(np.diff(counts)))) if rows else 0.0

    def jump_at(row: int) -> float:
        last_step = counts[row - 1] - counts[row - 2] if row > 1 else 0.0
        return float(counts[row] - counts[row - 1] - last_step)

    jumps, skip = list[LostCounts](), False
    for number, row in enumerate(rows):
        if skip:
            skip = False
            continue
        jump, end = jump_at(row), inf
        following = rows[number + 1] if number + 1 < len(rows) else len(counts)
        if following < len(counts) and following - row <= NEIGHBOURS // 2:
            room = max(0.1 * abs(jump), 2.0 * usual * (following - row))
            back = float(counts[following] - counts[row - 1])
            skip = abs(back) <= room
            end = float(time[following]) - half if skip else inf
        jumps.append(LostCounts(float(time[row]) - half, end, jump, float(values[row])))
    return jumps


def lost_count_sentences(experiment: Experiment, channel: Channel) -> Iterator[str]:
    """A sentence on counts that are lost for good, with the lines that cut the run there."""
    windows = [(lost.begin, lost.end) for lost in find_dropouts(experiment, channel)]
    lasting = [
        jump
        for jump in lost_counts(channel)
        if not jump.returns and not any(a <= jump.begin <= b for a, b in windows)
    ]
    if not lasting:
        return
    times = ", ".join(f"{spike.begin:.6g} s" for spike in lasting[:NAMED])
    times += f" and {len(lasting) - NAMED} times more" if len(lasting) > NAMED else ""
    most = max((spike.counts for spike in lasting), key=abs)
    cut = f"{lasting[0].begin:.6g}"
    yield (
        f"jumps by up to {most:+.0f} counts at {times} faster than any motion, and does not come "
        f"back: lost or doubled counts. Cut the run there: span = {{ to = {cut} }} in this run, "
        "and add a second run of the same file with "
        f'name = "{experiment.run} from {cut} s", span = {{ from = {cut} }}, start = "estimated"'
    )


def spiked(experiments: Sequence[Experiment]) -> dict[tuple[str, str], tuple[str, bool]]:
    """Channels with spikes, dropouts or lost counts, by run and name, and the line that mends each.

    Beside the sentence, whether it is gross: twice as far from the median as the channel moves
    in any run, so that squared errors would be the spike's.
    """
    sentences_by_channel, moves = dict[tuple[str, str], tuple[str, float]](), dict[str, float]()
    for experiment in experiments:
        for name, channel in experiment.channels.items():
            used, far = channel.used, 0.0
            middle = float(np.median(channel.values[used])) if used.any() else 0.0
            off = find_spikes(channel, experiment.input)
            off += [
                (lost.begin, lost.end, lost.value) for lost in find_dropouts(experiment, channel)
            ]
            for begin, end, value in off:
                used &= (channel.time < begin) | (channel.time > end)
                far = max(far, abs(value - middle))
            if used.any():
                moves[name] = max(moves.get(name, 0.0), float(np.ptp(channel.values[used])))
            sentences = [f"has {sentence}" for sentence in spike_sentences(experiment, channel)]
            sentences += lost_count_sentences(experiment, channel)
            sentences += dropout_sentences(experiment, channel)
            if sentences:
                sentences_by_channel[experiment.name, name] = (
                    f"{experiment.name}: '{name}' {'; it '.join(sentences)}",
                    far,
                )
    return {
        (run, name): (sentence, far > 2.0 * moves.get(name, 0.0))
        for (run, name), (sentence, far) in sentences_by_channel.items()
    }
