"""Properties of measured signals, and findings to look into before a fit.

Rate, jitter, gaps, range, clipping, spikes and lost samples of each run; of a campaign, windows
that no run takes and currents that have no sign. What is ignored counts for nothing.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, isnan, nan, pi
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import schema
from swashplate.campaign.campaign import Campaign, read_campaign_file
from swashplate.campaign.directions import (
    currents_are_turned,
    reversed_commands,
    swapped_currents,
    turned_channels,
)
from swashplate.campaign.dropouts import dropout_sentences, find_dropouts
from swashplate.campaign.experiment import Channel, Experiment, InputSignal
from swashplate.campaign.instruments import instrument_sentences, unsigned_word
from swashplate.campaign.samples import (
    StampStatistics,
    find_lost_counts,
    stamp_statistics,
    turns_over,
)
from swashplate.campaign.schema import applying, ends, inside, shown_unit
from swashplate.campaign.spikes import (
    NEIGHBOURS,
    lost_count_sentences,
    spike_sentences,
    step_of_reading,
)
from swashplate.parameters import FULL_VOLTAGE
from swashplate.results import Result
from swashplate.tables import Column, Table, count
from swashplate.units import display_unit

Array = NDArray[np.float64]

LONG_GAP = 5.0
"""An interval of more than this many usual ones is worth a look; single lost rows are not."""
LOST_SHARE = 0.01
"""Nor are they worth one until they are more than this share."""
SLOWEST_LOG = 1.0
"""Rate from which a log of a drive's motion is plausible: it reaches its speed within some tenths
of a second. [Hz]"""
SHORTEST_LOG, MANY_ROWS = 0.2, 100
"""Time that so many rows of a log last at least: a pump takes about as long to swing out. [s]"""
AT_REST = 0.25
"""An input within this share of its largest excursion may be at rest, or in a dead zone."""
NEGATIVE = 0.05
"""Share of its peak below zero that is noise of a rectified current; a signed one goes to about
minus its peak."""
SURE = 6.0
"""Standard deviations that noise does not reach."""
AT_FIRST, SLOW = 0.1, 0.1
"""Share of the greatest speed from which a run begins in motion; intervals of a position longer
than so many seconds tell nothing of it. [s]"""
COARSE = 0.03
"""Step of a reading over its range from which slow motions cannot be resolved."""
AVERAGED, HELD, LARGE, OFF_SCALE = 0.5, 1.0, 0.4, 3.0
"""Time over which motions are averaged, and for which a command has been larger than this part of
the largest one, so that the machine has about its steady speed [s]; and the factor by which a run's
speed for a volt does not differ from that of the other runs of one machine."""
TOGGLING = 3.0
"""Steps of its converter up to which a reading's change is no motion."""
NAMED = 6
"""Windows, or maneuvers, that a sentence names."""


@dataclass(frozen=True)
class Quality(Result):
    """Properties of one signal of one experiment; of a channel without what is ignored."""

    signal: str
    """``"input"`` or the channel's name."""
    kind: str
    unit: str
    """Of `low` and `high`, SI."""
    stamps: StampStatistics
    low: float
    high: float
    clipped: float
    """Share of the samples at the ends of the instrument's range; NaN if no range is known."""
    lost_counts: int | None
    """Jumps that no motion explains, None if it is not an encoder."""
    ignored: float
    """Share of the samples whose weight is 0."""
    findings: tuple[str, ...]
    """Findings to look into, one sentence each."""


def examine(experiment: Experiment, unsigned: Collection[str] = ()) -> tuple[Quality, ...]:
    """Quality of an experiment's input and channels, in that order.

    The sign of `unsigned` channels says nothing, see `unsigned_currents`.

    Examples
    --------
    >>> from swashplate import Campaign, campaign, maneuvers, rig
    >>> file = rig.write(rig.run("hoist", {"step": maneuvers.step(9.0)}), "tests")
    >>> [quality.signal for quality in campaign.examine(Campaign.from_toml(file)["hoist_step"])]
    ['input', 'current', 'counts']
    """
    moving = moves_at_first(experiment)
    signals: dict[str, InputSignal | Channel] = {"input": experiment.input, **experiment.channels}
    return tuple(
        _quality(experiment, name, signal, moves=name in moving, signed=name not in unsigned)
        for name, signal in signals.items()
    )


def _quality(
    experiment: Experiment,
    name: str,
    signal: InputSignal | Channel,
    *,
    moves: bool,
    signed: bool,
) -> Quality:
    """Quality of one signal, which moves at the first sample or not, and has a sign or not."""
    drive = experiment.input
    used = signal.used
    stamps = stamp_statistics(signal.time)
    values = signal.values[used] if used.any() else signal.values
    low, high = float(values.min()), float(values.max())
    limits = signal.limits
    if limits is None and signal is drive and drive.kind == "voltage":
        limits = (-FULL_VOLTAGE, FULL_VOLTAGE)
    clipped = nan
    if limits is not None and used.any():
        clipped = float(np.mean((values <= limits[0]) | (values >= limits[1])))
    lost = None
    findings = list[str]()
    if moves:
        findings.append(
            "moves at the first sample, although the run is stated to begin at rest: write "
            f"axes.{experiment.axis}.{ESTIMATED_START} in this run"
        )
    # the input's stamps are reported once, with the input
    if signal is drive or not np.array_equal(signal.time, drive.time):
        findings += _of_stamps(stamps)
    if signal.dropped:
        findings.append(
            f"{count(signal.dropped, 'missing sample is', 'missing samples are')} left out"
        )
    if isinstance(signal, Channel):
        if clipped > 0.0:
            findings.append(f"{100.0 * clipped:.2g} % of the samples are at the end of its range")
        findings += _of_channel(experiment, signal, signed)
        if signal.counts is not None:
            lost = int(find_lost_counts(signal.time[used], signal.counts[used]).size)
    else:
        findings += _of_clocks(experiment)
        if not unsigned_word(signal):
            findings += _of_input(signal, low, high, limits)
        findings += spike_sentences(experiment, signal)
        findings += dropout_sentences(experiment, signal)
        findings += instrument_sentences(experiment, signal)
    return Quality(
        signal=name,
        kind=signal.kind,
        unit=signal.unit,
        stamps=stamps,
        low=low,
        high=high,
        clipped=clipped,
        lost_counts=lost,
        ignored=float(np.mean(~used)),
        findings=tuple(findings),
    )


def _of_input(
    drive: InputSignal, low: float, high: float, limits: tuple[float, float] | None
) -> Iterator[str]:
    if low == high and drive.kind != "none":
        yield "the input never changes: nothing can be identified from this run"
    if limits is not None and (low < limits[0] or high > limits[1]):
        yield (
            f"goes from {low:g} to {high:g} {drive.unit}, beyond its range of "
            f"{limits[0]:g} to {limits[1]:g}: check unit, scale and offset"
        )


def _of_clocks(experiment: Experiment) -> Iterator[str]:
    """A sentence on a run that is too slow or too short for a motion, as in another unit of time.

    What is left of a run after a gap may be short.
    """
    signals: tuple[InputSignal | Channel, ...] = (experiment.input, *experiment.channels.values())
    period = min(float(np.median(np.diff(signal.time))) for signal in signals)
    if period > 1.0 / SLOWEST_LOG:
        yield (
            f"has a sample every {period:.3g} s, too few for any motion of a drive: check the unit "
            "of the time stamps"
        )
    rows = max(signal.time.size for signal in signals)
    too_short = experiment.duration < SHORTEST_LOG and rows >= MANY_ROWS
    if too_short and experiment.start != "estimated":
        yield (
            f"has {rows} samples in {experiment.duration:.3g} s, too short for any motion of a "
            "drive: check the unit of the time stamps"
        )


def _of_stamps(stamps: StampStatistics) -> Iterator[str]:
    if stamps.longest > LONG_GAP * stamps.period or stamps.missing > LOST_SHARE * stamps.rows:
        yield (
            f"{count(stamps.gaps.size, 'gap')}, the longest {stamps.longest:.3g} s; "
            f"{count(stamps.missing, 'sample is', 'samples are')} missing at the median rate"
        )
    if stamps.jitter > 0.2 * stamps.period and stamps.rounded > 0.0:
        rate = f"{stamps.rate:.4g}"
        yield (
            f"time stamps rounded to {1e3 * stamps.rounded:.2g} ms, of an even {rate} Hz: write "
            f"time = {{ rate = {rate} }} instead of their column"
        )
    elif stamps.jitter > 0.2 * stamps.period:
        yield (
            f"the interval of {1e3 * stamps.period:.3g} ms varies by {1e3 * stamps.jitter:.2g} ms: "
            "the time stamps are used as they are"
        )


def _of_channel(experiment: Experiment, channel: Channel, signed: bool) -> Iterator[str]:
    drive, time, values = experiment.input, channel.time[channel.used], channel.values[channel.used]
    if time.size < 2:
        return
    if np.ptp(values) == 0.0 and np.ptp(drive.values) > 0.0:
        yield "never changes although the input does: is it connected?"
    if unsigned_word(channel):
        # its jumps are those of the words, and say nothing else
        yield from instrument_sentences(experiment, channel)
        return
    yield from spike_sentences(experiment, channel)
    yield from dropout_sentences(experiment, channel)
    yield from instrument_sentences(experiment, channel)
    yield from lost_count_sentences(experiment, channel)
    if channel.kind == "rectified_current" and has_sign([values], NEGATIVE):
        yield "turns negative, so it is not rectified: should it be signed_current?"
    levels, extent = np.unique(values), float(np.ptp(values))
    if channel.kind in ("shaft_speed", "position"):
        step = float(np.median(np.diff(levels))) if levels.size > 3 else step_of_reading(values)
        toggles = np.count_nonzero(np.diff(values)) >= 2 * levels.size
        if step > COARSE * extent and (levels.size > 3 or toggles):
            size = display_unit(channel.shown_unit, extent)
            yield (
                f"reads in steps of {size.factor * step:.3g} {size.name}, "
                f"{_percent(step / extent)} of its range: smaller motions and dead zones "
                "cannot be resolved"
            )
    currents_turned = currents_are_turned(experiment)
    if signed and not currents_turned and channel.name in turned_channels(experiment):
        yield "moves against the input: should its sign be -1?"
    if channel.kind == "current_plus" and swapped_currents(experiment):
        yield (
            "flows while the command is negative, although the motion follows the command: swap "
            "the columns of current_plus and current_minus"
        )
    if outside := int(np.count_nonzero((time < drive.time[0]) | (time > drive.time[-1]))):
        yield f"{count(outside, 'sample is', 'samples are')} before or after the input's record"


def _percent(share: float) -> str:
    """A share in per cent, with two digits."""
    return f"{float(f'{100.0 * share:.2g}'):g} %"


ESTIMATED_START = 'start = "estimated"'
"""Entry of a run that begins in motion."""


def moves_at_first(experiment: Experiment) -> tuple[str, ...]:
    """Channels that move from the first sample on in a run that is said to begin at rest.

    At a tenth of the greatest speed or more, and above noise, over three intervals, which are long
    enough for ten steps of the reading at that speed, and not from zero, as a step at the first
    sample does. At a command of 0 a reading is an instrument's zero error.
    """
    moving_channels, drive = list[str](), experiment.input
    begins_at_rest = (
        abs(drive.values[0]) <= 0.02 * np.abs(drive.values).max() and drive.kind != "other"
    )
    moving = experiment.of_kind("shaft_speed", "position", "encoder_counts")
    for channel in moving if experiment.start == "rest" and not begins_at_rest else ():
        time, motion = channel.time[channel.used], channel.values[channel.used]
        if time.size < 4 * NEIGHBOURS or np.ptp(motion) == 0.0:
            continue
        if channel.is_position:
            coarse, interval = float(np.diff(np.unique(motion)).min()), np.median(np.diff(time))
            fastest = float(np.quantile(np.abs(np.diff(motion)), 0.998))
            stride = max(ceil(10.0 * coarse / fastest), 1) if fastest else time.size
            if stride * interval > SLOW:
                continue
            motion = np.diff(motion[::stride]) / np.diff(time[::stride])
        speeds = motion[:6] * np.sign(motion[0])
        noise = np.median(np.abs(np.diff(motion)))
        least = max(AT_FIRST * float(np.quantile(np.abs(motion), 0.998)), 3.0 * noise)
        grows = np.median(speeds[3:]) > 2.0 * speeds[0]
        if speeds.size == 6 and speeds[:3].min() > least and not grows:
            moving_channels.append(channel.name)
    return tuple(moving_channels)


# --- currents with and without a sign -------------------------------------------------------------


def has_sign(currents: Sequence[Array], share: float = 0.25) -> bool:
    """Whether a current of several runs goes below zero by more than noise and a share of its peak.

    Single samples do not count.
    """
    finite = [current[np.isfinite(current)] for current in currents if np.isfinite(current).any()]
    ends = np.array([[*np.quantile(current, (0.002, 0.998))] for current in finite] or [[0.0, 0.0]])
    steps = [np.median(np.abs(np.diff(current))) for current in finite if current.size > 1]
    noise = float(max(steps, default=0.0)) / (0.6745 * 2.0**0.5)
    return bool(-ends[:, 0].min() > max(share * ends[:, 1].max(), SURE * noise))


def unsigned_currents(experiments: Iterable[Experiment]) -> dict[tuple[str, str], str]:
    """Currents that are said to have a sign and have none, with a sentence on each.

    By axis and channel. Give runs together: of one only, a current that never turns
    negative may be right.
    """
    currents, lowest = dict[tuple[str, str], list[Array]](), dict[tuple[str, str], float]()
    for experiment in experiments:
        # a log that is cut out of a motion begins away from rest
        rest = experiment.input.values[0] if experiment.input.kind == "other" else 0.0
        driven = experiment.input.values - rest
        down = float(driven.min() / np.abs(driven).max()) if np.any(driven) else 0.0
        for channel in experiment.of_kind("signed_current"):
            if not channel.used.any():
                continue
            key = experiment.axis, channel.name
            currents.setdefault(key, []).append(channel.values[channel.used])
            lowest[key] = min(lowest.get(key, 0.0), down)
    return {
        (axis, name): (
            f"'{name}' of the axis '{axis}' never turns negative although the input does: it is "
            f'rectified; write kind = "rectified_current" in [axes.{axis}.channels.{name}]'
        )
        for (axis, name), values in currents.items()
        if lowest[axis, name] < -AT_REST and not has_sign(values)
    }


def wrapped_positions(experiments: Iterable[Experiment]) -> dict[tuple[str, str], str]:
    """Positions that jump by a turn where their angle wraps, with the line that mends it.

    By axis and channel.
    """
    sentences = dict[tuple[str, str], str]()
    for experiment in experiments:
        for name, channel in experiment.channels.items():
            turn = 2.0 * pi
            angle = channel.kind == "position" and channel.unit == "rad"
            if angle and turns_over(channel.values[channel.used], turn):
                size = f"{turn / channel.stated:.9g}"
                where = f"axes.{experiment.axis}.channels.{name}"
                sentences[experiment.axis, name] = (
                    f"'{name}' of the axis '{experiment.axis}' jumps by about one turn, as a "
                    f"wrapping angle does; write rolls_over_at = {size} in [{where}]"
                )
    return sentences


# --- the campaign as a whole ----------------------------------------------------------------------


def campaign_findings(campaign: Campaign) -> tuple[str, ...]:
    """Sentences on the campaign file: idle windows, axes without motion, currents without a sign.

    Parameters
    ----------
    campaign : Campaign
        The tests, read from a file.

    Returns
    -------
    tuple of str
        A sentence for each finding; empty if there is none.

    Raises
    ------
    FileError, ParameterError
        If the file, which is read once more, has changed meanwhile and cannot be read.
    """
    findings, file = list[str](), read_campaign_file(campaign.path)
    long = {overview.run: (overview.begin, overview.end) for overview in campaign.overviews}
    for name, axis in file.axes.items():
        runs, where = campaign.select(axis=name), f"axes.{name}"
        findings += _unused(f"{where}.ignore", axis.ignore, runs, long)
        for key, channel in axis.channels.items():
            of = f"{where}.channels.{key}"
            findings += _unused(f"{of}.ignore", channel.ignore, runs, long, key)
            findings += _unused(f"{of}.weights", channel.weights, runs, long, key)
        findings += [*_one_sided(name, runs), *_of_other_scale(runs)]
        findings += [sentence for _, sentence in reversed_commands(runs)]
    for number, run in enumerate(file.runs, 1):
        of_run = [
            experiment
            for experiment in campaign
            if experiment.run == (run.name or Path(run.file).stem)
        ]
        for key in ("ignore", "weights") if run.role != "ignore" else ():
            findings += _unused(
                f"run {number} ({run.file}): {key}", getattr(run, key), of_run, long
            )
    moving = {e.axis for e in campaign if e.of_kind("shaft_speed", "position", "encoder_counts")}
    moving |= {experiment.axis for experiment in campaign if experiment.input.kind == "none"}
    findings += [
        f"axis '{axis}': no channel measures its motion; a fit of the pump needs one of the kind "
        "shaft_speed, position or encoder_counts"
        for axis in dict.fromkeys(experiment.axis for experiment in campaign)
        if axis not in moving
    ]
    return (*findings, *unsigned_currents(campaign).values(), *wrapped_positions(campaign).values())


def _one_sided(axis: str, runs: Sequence[Experiment]) -> Iterator[str]:
    """A sentence if a machine moves both ways though its command, also at rest, keeps its sign.

    Over 0.5 s, by more than a third of the largest such motion each way.
    """
    commands = [run.input.values for run in runs if run.input.kind == "voltage"]
    if not commands or min(c.min() for c in commands) < 0.0 < max(c.max() for c in commands):
        return
    speeds, driven = list[Array](), list[Array]()
    for run in runs:
        for channel, time, speed in _mean_speeds(run):
            step = step_of_reading(channel.values[channel.used])
            within_steps = TOGGLING * step / (AVERAGED if channel.is_position else 1.0)
            if np.abs(speed).max(initial=0.0) > within_steps:
                speeds.append(speed)
                driven.append(run.input.at(time))
    motion, command = (np.concatenate([np.zeros(0), *parts]) for parts in (speeds, driven))
    most = float(np.abs(motion).max(initial=0.0))
    at_rest = np.abs(motion) < 0.02 * most
    if at_rest.any() and min(motion.max(), -motion.min()) > most / 3.0:
        rest = float(np.median(command[at_rest]))
        if abs(rest) < 0.02 * float(np.abs(command).max()):
            yield (
                f"axis '{axis}': it moves both ways although its command never changes sign and "
                "rests at 0 V: it is logged without its sign; look for a column of the direction"
            )
            return
        yield (
            f"axis '{axis}': it moves both ways although its command never changes sign; a stick "
            f"that rests at {rest:.3g} V needs offset = {-rest:.3g} in [axes.{axis}.input]"
        )


def _mean_speeds(experiment: Experiment) -> Iterator[tuple[Channel, Array, Array]]:
    """Each channel that moves, with instants (m,) [s] and its mean speeds (m,) over 0.5 s before.

    [unit, or unit/s of a position] Of dropouts nothing is said here.
    """
    for channel in experiment.of_kind("shaft_speed", "position", "encoder_counts"):
        kept = channel.used
        for lost in find_dropouts(experiment, channel):
            kept = kept & ((channel.time < lost.begin) | (channel.time > lost.end))
        time, values = channel.time[kept], channel.values[kept]
        width = 1
        if time.size > 1:
            width = max(round(AVERAGED / float(np.median(np.diff(time)))), 1)
        if not channel.is_position:
            values = np.concatenate([[0.0], np.cumsum(values[:-1] * np.diff(time))])
        last = np.arange(width, time.size, max(width // 4, 1))
        first = last - width
        speeds = (values[last] - values[first]) / (time[last] - time[first])
        yield channel, time[last], speeds


def _of_other_scale(runs: Sequence[Experiment]) -> Iterator[str]:
    """A sentence on a run that moves far more or less than others do at such commands."""
    largest = max((float(np.abs(run.input.values).max()) for run in runs), default=0.0)
    gains = dict[str, dict[str, tuple[float, str]]]()
    if largest == 0.0:
        return
    for run in runs:
        for channel, time, speed in _mean_speeds(run):
            instants = np.linspace(-HELD, 0.0, 9)[:, None] + time
            command = run.input.at(instants.ravel()).reshape(instants.shape)
            size = np.abs(command).min(axis=0)
            one_way = np.abs(np.sign(command).sum(axis=0)) == instants.shape[0]
            steady = one_way & (size > LARGE * largest) & (time > run.input.time[0] + HELD)
            if steady.sum() > 1:
                gain = float(np.median(np.abs(speed[steady] / command[-1, steady])))
                gains.setdefault(channel.name, {})[run.name] = gain, channel.source.column
    for name, of_runs in gains.items():
        for run_name, (gain, column) in of_runs.items():
            others = [other for key, (other, _) in of_runs.items() if key != run_name]
            usual = float(np.median(others)) if len(others) > 2 else gain
            if min(gain, usual) > 0.0 and not 1.0 / OFF_SCALE < gain / usual < OFF_SCALE:
                yield (
                    f"{run_name}: '{name}' moves {gain / usual:.3g} times as fast as in the other "
                    f"runs at similar commands; check the unit of '{column}' in this log (1 rad/s "
                    "is 9.55 1/min), its scale and the machine's gear"
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


def _unused(
    where: str,
    windows: Iterable[schema.TimeWindow],
    runs: Sequence[Experiment],
    long: Mapping[str, tuple[float, float]],
    channel: str | None = None,
) -> Iterator[str]:
    """Windows that leave out or weigh no sample of any run: a misspelt maneuver, another clock.

    `long` holds the first and the last instant of long logs by their run [s]: a window of such a
    log may lie where no experiment is.
    """
    for window in windows:
        matching = [run for run in runs if applying((window,), run.maneuver)]
        times = list[Array]()
        for run in matching:
            if channel is None:
                times += [measured.time for measured in run.channels.values()]
            elif channel in run.channels:
                times.append(run.channels[channel].time)
        start, stop = ends(window)
        logs = [long[name] for name in {run.run for run in matching} & long.keys()]
        within_log = any(start <= last and stop >= first for first, last in logs)
        if not matching:
            names = list(dict.fromkeys(f"'{run.maneuver}'" for run in runs))
            rest = [f"{len(names) - NAMED} others"] if len(names) > NAMED else []
            yield (
                f"{where}: no run has the maneuver '{window.maneuver}', so its window has no "
                f"effect; the maneuvers are {', '.join([*names[:NAMED], *rest])}"
            )
        elif not within_log and not any(inside(window, time).any() for time in times):
            begin = "its end" if window.start is None else f"{window.start:g} s"
            end = "its end" if window.stop is None else f"{window.stop:g} s"
            searched = f"any of {len(matching)} runs"
            if len(matching) == 1:
                run, time = matching[0], matching[0].input.time
                searched = f"{run.name}, which goes from {time[0]:.4g} to {time[-1]:.4g} s"
            yield f"{where}: the window from {begin} to {end} contains no sample of {searched}"


def quality_table(experiment: Experiment, qualities: Sequence[Quality]) -> Table:
    """The signals of one experiment: rate, jitter, gaps, range, clipping and lost counts."""
    table = Table(
        f"{experiment.name}: {experiment.maneuver}, to {experiment.role}, "
        f"{experiment.duration:.4g} s, {qualities[0].stamps.rows} samples",
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
    for quality in qualities:
        stamps, largest = quality.stamps, max(abs(quality.low), abs(quality.high))
        display = display_unit(shown_unit(quality.kind, quality.unit), largest)
        low, high = display.factor * quality.low, display.factor * quality.high
        table.add(
            experiment.name,
            quality.signal,
            quality.kind.replace("_", " "),
            stamps.rows,
            stamps.rate,
            f"{round(1e3 * stamps.jitter, 4):.3g}",
            f"{round(1e3 * stamps.longest, 4):.3g}" if stamps.gaps.size else "-",
            f"{low:z.4g} to {high:z.4g} {display.name}".rstrip(),
            "" if isnan(quality.clipped) else f"{100.0 * quality.clipped:.2g}",
            quality.lost_counts,
            f"{100.0 * quality.ignored:.3g} %",
            look=bool(quality.findings),
        )
    return table
