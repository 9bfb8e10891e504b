"""Validation: runs predicted from the command alone, and what an engineer judges them by."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

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
from swashplate.identification.own_model import ModelParameters
from swashplate.identification.staging import Parameters

Array = NDArray[np.float64]


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
