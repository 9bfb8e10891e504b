"""What measured signals are like, and what someone should look into before a fit.

Rate, jitter, gaps, range, clipping, spikes and lost samples of each run; of a campaign,
windows that no run takes and currents that have no sign. What is ignored counts for nothing.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import isnan
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import schema
from swashplate.campaign.campaign import Campaign, read_campaign_file
from swashplate.campaign.experiment import Channel, Experiment, InputSignal
from swashplate.campaign.samples import (
    StampStatistics,
    find_lost_counts,
    stamp_statistics,
)
from swashplate.campaign.schema import applying, inside
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.results import Result
from swashplate.tables import Column, Table
from swashplate.units import display_unit

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

LONG_GAP = 5.0
"""An interval of more than this many usual ones is worth a look; single lost rows are not."""
LOST_SHARE = 0.01
"""Nor are they worth one until they are more than this share."""
AT_REST = 0.25
"""An input within this share of its largest excursion may be at rest, or in a dead zone."""
NEGATIVE = 0.05
"""Share of its peak below zero that is noise of a rectified current; a signed one goes to about
minus its peak."""
SURE = 6.0
"""Standard deviations that noise does not reach."""
SPIKE = 8.0
"""Median absolute deviations from the running median beyond which a sample may be a spike."""
SPIKE_SHARE = 0.1
"""A spike is farther than this share of what lasts from it as well, in range or beyond."""
NEIGHBOURS = 11
"""Samples of the running median: up to five in a row may be a spike."""
GROSS = 2.0
"""Distance from the median, over all that a channel moves, from which a spike is gross. [1]"""
QUIET = 0.3
"""So long the input stands still before a spike within the range of what lasts. [s]"""
NAMED = 6
"""Windows, or maneuvers, that a sentence names."""


@dataclass(frozen=True)
class Quality(Result):
    """What one signal of one experiment is like; of a channel what is not ignored."""

    experiment: str
    signal: str
    """``"input"`` or the channel's name."""
    kind: str
    unit: str
    """Of `low` and `high`, SI."""
    stamps: StampStatistics
    low: float
    high: float
    clipped: float
    """Share of the samples at the ends of the instrument's range; NaN where no range is known."""
    lost_counts: int | None
    """Jumps that no motion explains, None where it is not an encoder."""
    dropped: int
    """Samples left out because they were missing."""
    ignored: float
    """Share of the samples whose weight is 0."""
    findings: tuple[str, ...]
    """What someone should look into, one sentence each."""


def examine(experiment: Experiment, unsigned: Collection[str] = ()) -> tuple[Quality, ...]:
    """Quality of an experiment's input and channels, in that order.

    Parameters
    ----------
    experiment : Experiment
        A run.
    unsigned : collection of str
        Channels whose sign says nothing, see `unsigned_currents`.
    """
    drive, found = experiment.input, list[Quality]()
    signals: dict[str, InputSignal | Channel] = {"input": drive, **experiment.channels}
    for name, signal in signals.items():
        stamps, lost = stamp_statistics(signal.time), None
        used = np.ones(signal.time.size, np.bool_)
        if isinstance(signal, Channel):
            used = signal.used
            limits, findings = signal.limits, _of_channel(experiment, signal, name not in unsigned)
            if signal.counts is not None:
                lost = 0 if used.sum() < 8 else _lost(signal)
            if lost:
                times = "once" if lost == 1 else f"{lost} times"
                findings.append(f"jumps {times} as no motion does: lost or doubled counts")
        else:
            full = (-FULL_VOLTAGE, FULL_VOLTAGE) if drive.kind == "voltage" else None
            limits = drive.limits or full
            findings = _of_input(drive, limits)
        values = signal.values[used]
        clipped = float("nan")
        if limits is not None and values.size:
            clipped = float(np.mean((values <= limits[0]) | (values >= limits[1])))
        if clipped > 0.0 and signal is not drive:
            findings.insert(
                0, f"{100.0 * clipped:.2g} % of the samples are at the end of its range"
            )
        if signal.dropped and signal is not drive:
            many = _counted(signal.dropped, "missing sample is", "missing samples are")
            findings.insert(0, f"{many} left out")
        # the input's stamps are told of once, with the input
        if signal is drive or not np.array_equal(signal.time, drive.time):
            findings = [*_stamp_findings(stamps), *findings]
        shown = values if values.size else signal.values
        ends = float(shown.min()), float(shown.max())
        found.append(
            Quality(
                *(experiment.name, name, signal.kind, signal.unit, stamps, *ends, clipped, lost),
                dropped=signal.dropped,
                ignored=float(np.mean(~used)),
                findings=tuple(findings),
            )
        )
    return tuple(found)


def _of_input(drive: InputSignal, limits: tuple[float, float] | None) -> list[str]:
    low, high, findings = drive.values.min(), drive.values.max(), []
    if low == high:
        findings.append("the input never changes: nothing can be identified from this run")
    if limits is not None and (low < limits[0] or high > limits[1]):
        findings.append(
            f"goes from {low:g} to {high:g} {drive.unit}, beyond its range of {limits[0]:g} to "
            f"{limits[1]:g}: check unit, scale and offset"
        )
    return findings


def _of_channel(experiment: Experiment, channel: Channel, signed: bool) -> list[str]:
    drive, used, findings = experiment.input, channel.used, list[str]()
    time, values = channel.time[used], channel.values[used]
    if time.size < 2:
        return []
    if np.ptp(values) == 0.0 and np.ptp(drive.values) > 0.0:
        findings.append("never changes although the input does: is it connected?")
    findings += _spike_findings(experiment, channel)
    if channel.kind == "rectified_current" and has_sign([values], NEGATIVE):
        findings.append("turns negative, so it is not rectified: should it be signed_current?")
    if signed and _moves_against(drive, channel):
        findings.append("moves against the input: should its sign be -1?")
    outside = int(np.count_nonzero((time < drive.time[0]) | (time > drive.time[-1])))
    if outside:
        lie = _counted(outside, "sample lies", "samples lie")
        findings.append(f"{lie} before or after the input's record")
    return findings


def _lost(channel: Channel) -> int:
    assert channel.counts is not None
    return int(find_lost_counts(channel.time[channel.used], channel.counts[channel.used]).size)


def _counted(number: int, one: str, several: str) -> str:
    return f"{number} {one if number == 1 else several}"


def _stamp_findings(stamps: StampStatistics) -> Iterator[str]:
    if stamps.longest > LONG_GAP * stamps.period or stamps.missing > LOST_SHARE * stamps.rows:
        yield (
            f"{_counted(stamps.gaps.size, 'gap', 'gaps')}, the longest {stamps.longest:.3g} s; "
            f"{_counted(stamps.missing, 'sample is', 'samples are')} missing at the median rate"
        )
    if stamps.jitter > 0.2 * stamps.period:
        yield (
            f"the interval of {1e3 * stamps.period:.3g} ms varies by {1e3 * stamps.jitter:.2g} ms: "
            "its own stamps are kept"
        )


def _moves_against(drive: InputSignal, channel: Channel) -> bool:
    """Whether a signed signal goes down where the input goes up."""
    time, values = channel.time[channel.used], channel.values[channel.used]
    if channel.is_position:
        middle = 0.5 * (time[1:] + time[:-1])
        motion = np.diff(values) / np.diff(time)
    elif channel.kind in ("signed_current", "shaft_speed", "swash_angle", "spool_position"):
        middle, motion = time, values
    else:
        return False
    return turned(drive.at(middle) - drive.values[0], motion)


def turned(driven: Array, motion: Array) -> bool:
    """Whether a motion (n,) goes against what it should be (n,), both about zero: clearly so."""
    size = float(np.linalg.norm(driven) * np.linalg.norm(motion))
    return float(driven @ motion) < -0.5 * size


# --- currents with and without a sign -------------------------------------------------------------


def _noise(values: Array) -> float:
    """Standard deviation from sample to sample."""
    return float(np.median(np.abs(np.diff(values)))) / (0.6745 * 2.0**0.5) if values.size > 1 else 0


def has_sign(currents: Sequence[Array], share: float = 0.25) -> bool:
    """Whether a current of several runs goes below zero by more than noise and a share of its peak.

    Single samples do not count.
    """
    finite = [each[np.isfinite(each)] for each in currents if np.isfinite(each).any()]
    ends = np.array([[*np.quantile(each, (0.002, 0.998))] for each in finite] or [[0.0, 0.0]])
    noise = max((_noise(each) for each in finite), default=0.0)
    return bool(-ends[:, 0].min() > max(share * ends[:, 1].max(), SURE * noise))


def unsigned_currents(experiments: Iterable[Experiment]) -> dict[tuple[str, str], str]:
    """Currents that are said to have a sign and have none, with a sentence on each.

    Parameters
    ----------
    experiments : iterable of Experiment
        Runs beside each other: of one alone a current that never turns negative may be right.

    Returns
    -------
    dict of (str, str) to str
        By axis and channel.
    """
    met: dict[tuple[str, str], list[tuple[Array, float]]] = {}
    for each in experiments:
        # a log that is cut out of a motion begins away from rest
        rest = each.input.values[0] if each.input.kind == "other" else 0.0
        driven = each.input.values - rest
        down = float(driven.min() / np.abs(driven).max()) if np.any(driven) else 0.0
        for channel in each.of_kind("signed_current"):
            if channel.used.any():
                of_runs = met.setdefault((each.axis, channel.name), [])
                of_runs.append((channel.values[channel.used], down))
    return {
        (axis, name): (
            f"'{name}' of the axis '{axis}' never turns negative although the input does: it is "
            f'rectified; write kind = "rectified_current" in [axes.{axis}.channels.{name}]'
        )
        for (axis, name), runs in met.items()
        if min(down for _, down in runs) < -AT_REST and not has_sign([values for values, _ in runs])
    }


# --- spikes ---------------------------------------------------------------------------------------


def spikes(channel: Channel, drive: InputSignal) -> list[tuple[float, float, float]]:
    """Single samples, up to five in a row, that no motion explains; an encoder's are lost counts.

    Returns
    -------
    list of (float, float, float)
        Instants before and after each spike, half an interval off [s], and its value farthest from
        what lasts [unit of the channel].

    Notes
    -----
    A sample is one where it lies more than 8 median absolute deviations from the running median of
    11 samples, and beyond all values of that median by a tenth of their range; or, while the input
    stands still, by a quarter of the range from the median within it.
    """
    from scipy.ndimage import median_filter

    used = np.flatnonzero(channel.used)
    time, values = channel.time[used], channel.values[used]
    if channel.kind in ("encoder_counts", "other") or time.size < 4 * NEIGHBOURS:
        return []
    lasting = median_filter(values, size=NEIGHBOURS, mode="nearest")
    low, high = float(lasting.min()), float(lasting.max())
    off = np.abs(values - lasting)
    least = SPIKE * float(np.median(off))
    room = max(SPIKE_SHARE * (high - low), least)
    found = (values > high + room) | (values < low - room)
    if (off > max(0.25 * (high - low), least)).any():
        grid = np.linspace(-QUIET, 0.0, 7)[:, None] + time
        commands = drive.at(grid.ravel()).reshape(grid.shape)
        quiet = np.ptp(commands, axis=0) <= 0.02 * np.ptp(drive.values)
        found |= quiet & (off > max(0.25 * (high - low), least))
    rows = np.flatnonzero(found & (off > least))
    half = 0.5 * float(np.median(np.diff(time)))
    groups = np.split(rows, np.flatnonzero(np.diff(rows) > NEIGHBOURS // 2) + 1)
    return [
        (
            float(time[group[0]] - half),
            float(time[group[-1]] + half),
            float(values[group[np.argmax(off[group])]]),
        )
        for group in groups
        if group.size and group[-1] - group[0] < NEIGHBOURS // 2
    ]


def spiked(experiments: Sequence[Experiment]) -> dict[tuple[str, str], tuple[str, bool]]:
    """Channels with spikes, by run and name, and the line that leaves them out.

    Beside the sentence, whether a spike is gross: farther beyond all that lasts than the channel
    moves in any run, so that squared errors would be the spike's.
    """
    said, moves = dict[tuple[str, str], str](), dict[str, float]()
    for each in experiments:
        for name, channel in each.channels.items():
            kept = channel.used
            for begin, end, _ in spikes(channel, each.input):
                kept &= (channel.time < begin) | (channel.time > end)
            if kept.any():
                moves[name] = max(moves.get(name, 0.0), float(np.ptp(channel.values[kept])))
            for sentence in _spike_findings(each, channel):
                said[each.name, name] = f"{each.name}: '{name}' has {sentence}"
    runs, found = {each.name: each for each in experiments}, {}
    for (run, name), sentence in said.items():
        values = runs[run][name].values[runs[run][name].used]
        far = float(np.abs(values - np.median(values)).max())
        found[run, name] = sentence, far > GROSS * moves.get(name, 0.0)
    return found


def _spike_findings(experiment: Experiment, channel: Channel) -> Iterator[str]:
    found = spikes(channel, experiment.input)
    if not found:
        return
    windows = ", ".join(
        f'{{ from = {begin:.6g}, to = {end:.6g}, why = "spike" }}'
        for begin, end, _ in found[:NAMED]
    )
    more = "" if len(found) <= NAMED else f" and {len(found) - NAMED} more like these"
    largest = max((value for _, _, value in found), key=abs)
    yield (
        f"{_counted(len(found), 'spike', 'spikes')}, up to {largest:.4g} {channel.unit}{more}: "
        f"leave out with axes.{experiment.axis}.channels.{channel.name}.ignore = "
        f"[{windows}] in this run"
    )


# --- the campaign as a whole ----------------------------------------------------------------------


def campaign_findings(campaign: Campaign) -> tuple[str, ...]:
    """Sentences on the campaign file: idle windows, axes without motion, currents without a sign.

    Raises
    ------
    FileError, ParameterError
        If the file, which is read once more, has changed meanwhile and cannot be read.
    """
    moving = dict.fromkeys((each.axis for each in campaign), False)
    for each in campaign:
        moving[each.axis] |= bool(each.of_kind("shaft_speed", "position", "encoder_counts"))
    return (
        *_unused_windows(campaign),
        *(
            f"axis '{axis}': no channel measures its motion; a fit of the pump needs one of the "
            "kind shaft_speed, position or encoder_counts"
            for axis, seen in moving.items()
            if not seen
        ),
        *unsigned_currents(campaign).values(),
    )


def beyond_the_card(experiment: Experiment) -> tuple[str, ...]:
    """A sentence if the command goes where no card does, so that nothing can be simulated."""
    drive = experiment.input
    far = np.abs(drive.values) > FULL_VOLTAGE
    if drive.kind != "voltage" or not far.any():
        return ()
    first = int(np.argmax(far))
    return (
        f"{drive.source}: the voltage is {drive.values[first]:g} V at {drive.time[first]:g} s, but "
        f"the card takes ±{FULL_VOLTAGE:g} V; check unit, scale and offset of "
        f"[axes.{experiment.axis}.input]",
    )


def _unused_windows(campaign: Campaign) -> Iterator[str]:
    """Windows that leave out or weigh no sample of any run: a misspelt maneuver, another clock."""
    file = read_campaign_file(campaign.path)
    for name, axis in file.axes.items():
        runs = campaign.select(axis=name)
        yield from _unused(f"axes.{name}.ignore", axis.ignore, runs)
        for key, channel in axis.channels.items():
            where = f"axes.{name}.channels.{key}"
            yield from _unused(f"{where}.ignore", channel.ignore, runs, key)
            yield from _unused(f"{where}.weights", channel.weights, runs, key)
    for number, run in enumerate(file.runs, 1):
        if run.role != "ignore":
            ours = [each for each in campaign if each.run == (run.name or Path(run.file).stem)]
            where = f"run {number} ({run.file})"
            yield from _unused(f"{where}: ignore", run.ignore, ours)
            yield from _unused(f"{where}: weights", run.weights, ours)


def _unused(
    where: str,
    windows: Iterable[schema.Window],
    runs: Sequence[Experiment],
    channel: str | None = None,
) -> Iterator[str]:
    for window in windows:
        held = [each for each in runs if applying((window,), each.maneuver)]
        if not held:
            names = list(dict.fromkeys(f"'{each.maneuver}'" for each in runs))
            more = [f"{len(names) - NAMED} others"] if len(names) > NAMED else []
            yield (
                f"{where}: no run has the maneuver '{window.maneuver}', so that its window does "
                f"nothing; there are {', '.join([*names[:NAMED], *more])}"
            )
        elif not any(
            inside(window, signal.time).any()
            for each in held
            for name, signal in each.channels.items()
            if channel in (None, name)
        ):
            first, last = (
                "its end" if each is None else f"{each:g} s" for each in (window.start, window.stop)
            )
            of = f"any of {len(held)} runs"
            if len(held) == 1:
                time = next(iter(held[0].channels.values())).time
                of = f"{held[0].name}, which goes from {time[0]:.4g} to {time[-1]:.4g} s"
            yield f"{where}: the window from {first} to {last} holds no sample of {of}"


def quality_table(experiment: Experiment, qualities: Sequence[Quality]) -> Table:
    """The signals of one experiment: rate, jitter, gaps, range, clipping and lost counts."""
    stamps = qualities[0].stamps
    made = Table(
        f"{experiment.name}: {experiment.maneuver}, to {experiment.role}, "
        f"{experiment.duration:.4g} s, {stamps.rows} samples",
        (
            Column("run", of="p"),
            Column("signal", wrap=True),
            Column("kind", of="p"),
            Column("samples", ",d", of="p"),
            Column("Hz", ".4g"),
            Column("jitter", "s", of="t"),
            Column("gap", "s"),
            Column("range"),
            Column("clip", "s"),
            Column("lost", "d"),
            Column("ignored", "s", of="p"),
        ),
    )
    for each in qualities:
        stamps = each.stamps
        clipped = "" if isnan(each.clipped) else f"{100.0 * each.clipped:.2g}"
        made.add(
            experiment.name,
            each.signal,
            each.kind.replace("_", " "),
            stamps.rows,
            stamps.rate,
            f"{round(1e3 * stamps.jitter, 4):.3g}",
            f"{round(1e3 * stamps.longest, 4):.3g}" if stamps.gaps.size else "-",
            _range(each),
            clipped,
            each.lost_counts,
            f"{100.0 * each.ignored:.3g} %",
            look=bool(each.findings),
        )
    return made


def _range(quality: Quality) -> str:
    shown = display_unit(quality.unit, max(abs(quality.low), abs(quality.high)))
    low, high = shown.factor * quality.low, shown.factor * quality.high
    return f"{low:z.4g} to {high:z.4g} {shown.name}".rstrip()
