"""Validation: runs predicted from the command alone, and what an engineer judges them by."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.experiment import Channel, Experiment
from swashplate.campaign.speed import speed_of
from swashplate.errors import InputError
from swashplate.identification.assessment import (
    Measures,
    RunQuality,
    compared,
    measures,
    pooled_measures,
)
from swashplate.identification.drive_model import SIGNALS, DriveModel, current_record
from swashplate.identification.error_tables import (
    SOURCE_RULES,
    ComparedRun,
    ErrorTable,
    Kind,
    Quantity,
    Rule,
    WholeKind,
    error_table,
)
from swashplate.identification.own_model import ModelParameters
from swashplate.identification.staging import Parameters

Array = NDArray[np.float64]
DITHER_MEAN = 0.1
"""Width of the moving mean over a current's differences, against the dither. [s]"""


def predict(parameters: Parameters, experiments: Sequence[Experiment]) -> tuple[RunQuality, ...]:
    """Predict runs from their input alone and compare every channel that the drive has.

    Parameters
    ----------
    parameters : ParameterSet or ModelParameters
        The drive, or a model of one's own with its numbers.
    experiments : sequence of Experiment
        Runs that it was not fitted to. A voltage goes through the whole chain, a current through
        pump and motor.

    Returns
    -------
    tuple of RunQuality
        One for each run and channel. The free zero of a position is the one that fits best.

    Raises
    ------
    InputError
        If a run is driven by neither, or has no channel that a drive has.
    DomainError
        If the model does not hold under a run's input.
    """
    if isinstance(parameters, ModelParameters):
        return tuple(
            compared(each, name, simulated)
            for each in experiments
            for name, simulated in parameters.predicted(each).items()
            if each[name].used.any()
        )
    made = []
    for experiment in experiments:
        if not any(channel.kind in SIGNALS for channel in experiment.channels.values()):
            raise InputError(f"{experiment.name} has no channel that a drive has.")
        if experiment.input.kind == "current":
            model = DriveModel(parameters, "pump", {experiment.name: current_record(experiment)})
        else:
            model = DriveModel(parameters, "chain")
        for name, simulated in model.simulate({}, experiment).items():
            channel = experiment[name]
            if channel.is_position and channel.used.any():
                zero = np.average(channel.values - simulated, weights=channel.weight)
                simulated = simulated + zero
            if channel.used.any():
                made.append(compared(experiment, name, simulated))
    return tuple(made)


def with_speeds(qualities: Iterable[RunQuality]) -> tuple[RunQuality, ...]:
    """The qualities, each of a position followed by that of its speed.

    Measured and simulated positions go through the same filters (`speed_of`, ``"exact"``), so that
    both carry the same phase. A position whose stamps no filter takes has no speed.
    """
    made: list[RunQuality] = []
    for each in qualities:
        made.append(each)
        if each.experiment[each.channel].is_position:
            speed = _speed_quality(each)
            made += [speed] if speed is not None else []
    return tuple(made)


def pooled(qualities: Iterable[RunQuality]) -> dict[str, Measures]:
    """Measures over all runs of each channel, by its name."""
    channels: dict[str, list[RunQuality]] = {}
    for each in qualities:
        channels.setdefault(each.channel, []).append(each)
    made = {}
    for name, alike in channels.items():
        parts: list[tuple[Array, Array, Array | None]] = [
            (q.experiment[name].values, q.simulated, q.experiment[name].weight) for q in alike
        ]
        made[name] = pooled_measures(parts)
    return made


def ignored_windows(channel: Channel) -> tuple[tuple[float, float], ...]:
    """First and last instant of each stretch of a channel that does not count. [s]"""
    out = np.concatenate([[False], ~channel.used, [False]])
    edges = np.flatnonzero(out[1:] != out[:-1])
    return tuple(
        (float(channel.time[first]), float(channel.time[after - 1]))
        for first, after in zip(edges[::2], edges[1::2], strict=True)
    )


class ChannelErrors(NamedTuple):
    """The source's error table of one channel."""

    channel: str
    table: ErrorTable
    average: float
    """Width of the moving mean over the differences. [s]"""
    unjudged: tuple[str, ...]
    """Runs that are neither ramp, step nor sine, or too short."""


def source_rules(drive: str) -> tuple[Rule, ...]:
    """What the source leaves out of its tables for a drive of that name: of slew all steps."""
    return (*SOURCE_RULES, WholeKind("step")) if drive == "slew" else tuple(SOURCE_RULES)


def channel_errors(
    qualities: Sequence[RunQuality], rules: Sequence[Rule] = SOURCE_RULES
) -> tuple[ChannelErrors, ...]:
    """The source's error table of each channel: the largest per cent error by kind of test.

    Parameters
    ----------
    qualities : sequence of RunQuality
        Runs of one axis. Positions are passed over: their zero is free, so that a per cent of one
        means nothing; take `with_speeds`.
    rules : sequence of Rule
        What is left out.
    """
    made = []
    for name in dict.fromkeys(each.channel for each in qualities):
        alike = [each for each in qualities if each.channel == name]
        channel = alike[0].experiment[name]
        if channel.is_position:
            continue
        found = [compared_run(each) for each in alike]
        judged = [each for each in found if each is not None]
        if not judged:
            continue
        average = DITHER_MEAN if channel.unit == "A" else 0.0
        unjudged = tuple(
            each.experiment.name for each, run in zip(alike, found, strict=True) if run is None
        )
        table = error_table(judged, rules=rules, average=average)
        made.append(ChannelErrors(name, table, average, unjudged))
    return tuple(made)


def compared_run(quality: RunQuality) -> ComparedRun | None:
    """A channel of a run as the source's error tables take it, None if it is of no kind there."""
    experiment, channel = quality.experiment, quality.experiment[quality.channel]
    kind = kind_of(experiment)
    used = channel.used
    if kind is None or np.count_nonzero(used) < 8:
        return None
    quantity: Quantity = "other"
    if channel.kind in ("rectified_current", "shaft_speed"):
        quantity = "rectified_current" if channel.kind == "rectified_current" else "shaft_speed"
    recognised = experiment.recognised
    time = channel.time[used]
    return ComparedRun(
        experiment.name,
        kind,
        quantity,
        time,
        experiment.input.at(time),
        channel.values[used],
        quality.simulated[used],
        recognised.frequency if recognised is not None else None,
    )


def kind_of(experiment: Experiment) -> Kind | None:
    """Kind of a test in the source's tables, by the first word of its manoeuvre."""
    word = experiment.maneuver.split(" ")[0]
    return next((each for each in get_args(Kind) if each == word), None)


def _speed_quality(quality: RunQuality) -> RunQuality | None:
    channel = quality.experiment[quality.channel]
    plain = replace(channel, values=quality.simulated, encoder=None, counts=None)
    try:
        found, same = speed_of(channel, "exact"), speed_of(plain, "exact")
    except InputError:
        return None
    speed = replace(
        channel,
        name=f"speed from {channel.name}",
        kind="shaft_speed",
        unit=f"{channel.unit}/s",
        values=found.speed,
        noise=None,
        limits=None,
        encoder=None,
        counts=None,
    )
    experiment = replace(
        quality.experiment, channels={**quality.experiment.channels, speed.name: speed}
    )
    # the residuals of a filtered signal are coloured by the filter: there is no test of them
    return RunQuality(
        experiment,
        speed.name,
        same.speed,
        measures(speed.values, same.speed, speed.weight),
        None,
    )
