"""What measured signals are like: rate, jitter, gaps, range, clipping, stuck and lost samples."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.encoder import find_lost_counts, unwrap_counts
from swashplate.campaign.experiment import Channel, Experiment, InputSignal
from swashplate.campaign.stamps import StampStatistics, stamp_statistics

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

FULL_COMMAND = 10.0
"""Range of a command where the campaign file gives none. [V]"""
LONG_GAP = 5.0
"""An interval of more than this many usual ones is worth a look; single lost rows are not."""
LOST_SHARE = 0.01
"""Nor are they worth one until they are more than this share."""
STUCK = 1.0
"""A noisy signal that stays the same to the last bit for longer than this is stuck. [s]"""
LIVELY = 0.5
"""Share of the intervals in which a noisy signal changes."""
AT_REST = 0.25
"""An input within this share of its largest excursion about its first sample may be at rest, or
in a dead zone."""


@dataclass(frozen=True)
class Quality:
    """What one signal of one experiment is like."""

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
    stuck: float | None
    """Longest time that a noisy signal stands still while the input is away from rest [s]; None
    for an input and for a signal that is not noisy, such as an encoder."""
    lost_counts: int | None
    """Jumps that no motion explains, None where it is not an encoder."""
    dropped: int
    """Samples left out because they were missing."""
    ignored: float
    """Share of the samples whose weight is 0."""
    findings: tuple[str, ...]
    """What someone should look into, one sentence each."""

    @property
    def gap_time(self) -> float:
        """The longest interval between samples, gap or not. [s]"""
        return self.stamps.longest


def examine(experiment: Experiment) -> tuple[Quality, ...]:
    """Quality of an experiment's input and channels, in that order."""
    drive = experiment.input
    return (
        _input_quality(experiment, drive),
        *(_channel_quality(experiment, drive, each) for each in experiment.channels.values()),
    )


def _counted(number: int, one: str, several: str) -> str:
    return f"{number} {one if number == 1 else several}"


def _input_quality(experiment: Experiment, drive: InputSignal) -> Quality:
    limits = drive.limits
    if limits is None and drive.kind == "voltage":
        limits = (-FULL_COMMAND, FULL_COMMAND)
    stamps = stamp_statistics(drive.time)
    findings = list(_stamp_findings(stamps))
    if np.ptp(drive.values) == 0.0:
        findings.append("the input never changes: nothing can be identified from this run")
    if limits is not None and (drive.values.min() < limits[0] or drive.values.max() > limits[1]):
        findings.append(
            f"goes from {drive.values.min():g} to {drive.values.max():g} {drive.unit}, beyond its "
            f"range of {limits[0]:g} to {limits[1]:g}: check unit, scale and offset"
        )
    return Quality(
        experiment.name,
        "input",
        drive.kind,
        drive.unit,
        stamps,
        float(drive.values.min()),
        float(drive.values.max()),
        _share_at(drive.values, limits),
        None,
        None,
        drive.dropped,
        0.0,
        tuple(findings),
    )


def _channel_quality(experiment: Experiment, drive: InputSignal, channel: Channel) -> Quality:
    stamps = stamp_statistics(channel.time)
    clipped = _share_at(channel.values, channel.limits)
    stuck = _stuck(channel, _away(drive, channel.time))
    lost = _lost_counts(channel)
    ignored = float(np.mean(~channel.used))
    # the input's stamps are told of once, with the input
    same = np.array_equal(channel.time, drive.time)
    findings = [] if same else list(_stamp_findings(stamps))
    if channel.dropped:
        dropped = channel.dropped
        findings.append(f"{_counted(dropped, 'missing sample is', 'missing samples are')} left out")
    if clipped > 0.0:
        findings.append(f"{100.0 * clipped:.2g} % of the samples are at the end of its range")
    if np.ptp(channel.values) == 0.0 and np.ptp(drive.values) > 0.0:
        findings.append("never changes although the input does: is it connected?")
    elif stuck is not None and stuck > STUCK:
        findings.append(f"stands still for {stuck:.3g} s while the input is away from rest")
    if lost:
        times = "once" if lost == 1 else f"{lost} times"
        findings.append(f"jumps {times} as no motion does: lost or doubled counts")
    findings += _rollover_findings(channel)
    if channel.kind == "rectified_current" and channel.values.min() < -0.02 * np.ptp(
        channel.values
    ):
        findings.append("turns negative, so it is not rectified: should it be signed_current?")
    if _moves_against(drive, channel):
        findings.append("moves against the input: should its sign be -1?")
    if ignored == 1.0:
        findings.append("all samples are ignored")
    elif not (drive.time[0] <= channel.time[0] and channel.time[-1] <= drive.time[-1]):
        outside = (channel.time < drive.time[0]) | (channel.time > drive.time[-1])
        lie = _counted(int(outside.sum()), "sample lies", "samples lie")
        findings.append(f"{lie} before or after the input's record")
    return Quality(
        experiment.name,
        channel.name,
        channel.kind,
        channel.unit,
        stamps,
        float(channel.values.min()),
        float(channel.values.max()),
        clipped,
        stuck,
        lost,
        channel.dropped,
        ignored,
        tuple(findings),
    )


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


def _share_at(values: Array, limits: tuple[float, float] | None) -> float:
    if limits is None:
        return float("nan")
    return float(np.mean((values <= limits[0]) | (values >= limits[1])))


def _away(drive: InputSignal, time: Array) -> Flags:
    """Whether the input is away from its first level at some instants."""
    excursion = np.abs(drive.values - drive.values[0])
    largest = float(excursion.max())
    if largest == 0.0:
        return np.zeros(time.size, dtype=np.bool_)
    away: Flags = np.abs(drive.at(time) - drive.values[0]) > AT_REST * largest
    return away


def _stuck(channel: Channel, away: Flags) -> float | None:
    """Longest time without any change, of a signal that changes from most samples to the next."""
    same = np.diff(channel.values) == 0.0
    if (
        channel.kind == "encoder_counts"
        or np.mean(~same[away[1:]] if away.any() else ~same) < LIVELY
    ):
        return None
    still = same & away[1:] & away[:-1]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]])))
    starts, stops = edges[::2], edges[1::2]
    if not starts.size:
        return 0.0
    return float((channel.time[stops] - channel.time[starts]).max())


def _lost_counts(channel: Channel) -> int | None:
    if channel.counts is None:
        return None
    if channel.counts.size < 8:
        return 0
    return int(find_lost_counts(channel.time, channel.counts).rows.size)


def _rollover_findings(channel: Channel) -> Iterator[str]:
    if channel.encoder is None or channel.encoder.rolls_over_at is None or channel.counts is None:
        return
    size = channel.encoder.rolls_over_at
    doubtful = unwrap_counts(np.mod(channel.counts, size), modulus=size).doubtful
    if doubtful.size:
        yield (
            f"{_counted(doubtful.size, 'step is', 'steps are')} so large that a roll-over more or "
            f"less may be what happened, the first at {channel.time[doubtful[0]]:.4g} s"
        )


def _moves_against(drive: InputSignal, channel: Channel) -> bool:
    """Whether a signed signal goes down where the input goes up."""
    if channel.is_position:
        middle = 0.5 * (channel.time[1:] + channel.time[:-1])
        motion = np.diff(channel.values) / np.diff(channel.time)
    elif channel.kind in ("signed_current", "shaft_speed", "swash_angle", "spool_position"):
        middle, motion = channel.time, channel.values
    else:
        return False
    driven = drive.at(middle) - drive.values[0]
    scale = float(np.std(driven) * np.std(motion))
    if scale == 0.0:
        return False
    return float(np.mean(driven * motion)) < -0.5 * scale
