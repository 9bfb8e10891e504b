"""Speeds beside positions: what an engineer judges, from what was fitted."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from swashplate.campaign.speed import speed_of
from swashplate.errors import InputError
from swashplate.identification.assessment import RunQuality
from swashplate.identification.measures import measures


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
