"""Windows of a campaign file that no run takes: a misspelt manoeuvre, or another clock."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from swashplate.campaign import schema
from swashplate.campaign.campaign import Campaign
from swashplate.campaign.experiment import Experiment
from swashplate.campaign.loading import read_campaign_file
from swashplate.campaign.weighting import applying, inside

NAMED = 6
"""Manoeuvres that a sentence names."""


class _Place(NamedTuple):
    """Windows that stand together, and what they are for."""

    where: str
    windows: tuple[schema.Window, ...]
    runs: tuple[Experiment, ...]
    channel: str | None


def unused_windows(campaign: Campaign) -> tuple[str, ...]:
    """A sentence for each window that leaves out or weighs no sample of any run.

    Parameters
    ----------
    campaign : Campaign
        A campaign from its file, which is read once more.

    Raises
    ------
    FileError, ParameterError
        If the file has changed meanwhile, and cannot be read.
    """
    file = read_campaign_file(campaign.path)
    return tuple(
        sentence
        for place in _places(campaign, file)
        for window in place.windows
        for sentence in _unused(place, window)
    )


def _places(campaign: Campaign, file: schema.CampaignFile) -> Iterator[_Place]:
    for name, axis in file.axes.items():
        runs = campaign.select(axis=name)
        yield _Place(f"axes.{name}.ignore", tuple(axis.ignore), runs, None)
        for key, channel in axis.channels.items():
            where = f"axes.{name}.channels.{key}"
            yield _Place(f"{where}.ignore", tuple(channel.ignore), runs, key)
            yield _Place(f"{where}.weights", tuple(channel.weights), runs, key)
    for number, run in enumerate(file.runs, 1):
        ours = tuple(each for each in campaign if each.run == (run.name or Path(run.file).stem))
        where = f"run {number} ({run.file})"
        yield _Place(f"{where}: ignore", tuple(run.ignore), ours, None)
        yield _Place(f"{where}: weights", tuple(run.weights), ours, None)


def _unused(place: _Place, window: schema.Window) -> Iterator[str]:
    held = [each for each in place.runs if applying((window,), each.maneuver)]
    if not held:
        yield (
            f"{place.where}: no run has the manoeuvre '{window.maneuver}', so that its window "
            f"does nothing; there are {_listed(place.runs)}"
        )
    elif not any(
        inside(window, channel.time).any()
        for each in held
        for name, channel in each.channels.items()
        if place.channel in (None, name)
    ):
        yield (
            f"{place.where}: the window from {_instant(window.start)} to {_instant(window.stop)} "
            f"holds no sample of {_runs(held)}"
        )


def _listed(runs: Iterable[Experiment]) -> str:
    names = list(dict.fromkeys(f"'{each.maneuver}'" for each in runs))
    more = [f"{len(names) - NAMED} others"] if len(names) > NAMED else []
    return ", ".join([*names[:NAMED], *more])


def _runs(held: Sequence[Experiment]) -> str:
    if len(held) > 1:
        return f"any of {len(held)} runs"
    time = next(iter(held[0].channels.values())).time
    return f"{held[0].name}, which goes from {np.min(time):.4g} to {np.max(time):.4g} s"


def _instant(time: float | None) -> str:
    return "its end" if time is None else f"{time:g} s"
