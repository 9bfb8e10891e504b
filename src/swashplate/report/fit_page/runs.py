"""The fitted and the held-out runs as the report shows them: channels, units, what was ignored."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.experiment import Channel, Experiment
from swashplate.identification.assessment import Assessment, RunQuality
from swashplate.identification.measures import Measures, pooled_measures
from swashplate.report.display_units import DisplayUnit, display_unit
from swashplate.report.fit_page.numbers import listed, seconds
from swashplate.report.fit_page.speeds import with_speeds

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Shown:
    """One channel of a run, and the stage that fits it."""

    quality: RunQuality
    stage: str
    """Name of the stage; empty for a run that was held out."""
    unit: DisplayUnit
    """For the signal; of one channel the same in all runs."""
    small: DisplayUnit
    """For its residual."""

    @property
    def channel(self) -> Channel:
        """What was measured."""
        return self.quality.experiment[self.quality.channel]


@dataclass(frozen=True, eq=False)
class ShownRun:
    """One run with all of its channels that are simulated."""

    experiment: Experiment
    validates: bool
    """Whether it was held out of the fit."""
    channels: tuple[Shown, ...]

    @property
    def role(self) -> str:
        """``"fit"`` or ``"validate"``."""
        return "validate" if self.validates else "fit"


def shown_runs(
    assessments: Sequence[Assessment], validation: Sequence[RunQuality]
) -> tuple[ShownRun, ...]:
    """All runs, those that were fitted first, each with its channels in the order of the stages.

    A position is followed by its speed.
    """
    found = [(each, a.stage.stage.name, False) for a in assessments for each in with_speeds(a.runs)]
    found += [(each, "", True) for each in with_speeds(validation)]
    units = {
        channel: _units([each for each, _, _ in found if each.channel == channel])
        for channel in dict.fromkeys(each.channel for each, _, _ in found)
    }
    keys = dict.fromkeys((held, each.experiment.name) for each, _, held in found)
    runs = []
    for held, name in keys:
        channels = tuple(
            Shown(each, stage, *units[each.channel])
            for each, stage, validates in found
            if validates == held and each.experiment.name == name
        )
        runs.append(ShownRun(channels[0].quality.experiment, held, channels))
    return tuple(runs)


def pooled(qualities: Iterable[RunQuality]) -> dict[str, Measures]:
    """Measures over all runs of each channel."""
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


def start_words(experiment: Experiment) -> str:
    """How the run's initial state comes about."""
    if experiment.start == "given" and experiment.start_pressure is not None:
        return f"given, {1e-5 * experiment.start_pressure:.4g} bar"
    return {
        "rest": "at rest",
        "steady": "steady state",
        "given": "given",
        "estimated": "pressure estimated",
    }[experiment.start]


def ignored_windows(experiment: Experiment, channel: Channel) -> tuple[tuple[float, float], ...]:
    """First and last instant of each stretch of a channel that does not count. [s]"""
    out = np.concatenate([[False], ~channel.used, [False]])
    edges = np.flatnonzero(out[1:] != out[:-1])
    return tuple(
        (float(channel.time[first]), float(channel.time[after - 1]))
        for first, after in zip(edges[::2], edges[1::2], strict=True)
    )


def ignored_words(experiment: Experiment, channel: Channel) -> str:
    """What of a channel does not count, and why as far as the campaign says."""
    said = []
    for first, last in ignored_windows(experiment, channel):
        reasons = [why for a, b, why in experiment.ignored if why and a <= last and first <= b]
        why = f" ({listed(list(dict.fromkeys(reasons)))})" if reasons else ""
        said.append(f"{seconds(first)} to {seconds(last)} s{why}")
    return "; ".join(said) or "nothing"


def conditions(runs: Iterable[Experiment], channel: str) -> str:
    """Initial states and ignored windows of several runs in a few words, for beside a fit %."""
    experiments = list(runs)
    starts = list(dict.fromkeys(start_words(each) for each in experiments))
    parts = [(ignored_words(each, each[channel])) for each in experiments]
    left_out = [words for words in dict.fromkeys(parts) if words != "nothing"]
    ignored = "nothing ignored"
    if len(left_out) == 1 and "nothing" not in parts:
        ignored = f"ignored {left_out[0]}"
    elif left_out:
        ignored = "ignored windows differ by run and stand in the table of runs"
    return f"start {listed(starts)}; {ignored}"


def _units(qualities: Sequence[RunQuality]) -> tuple[DisplayUnit, DisplayUnit]:
    channels = [each.experiment[each.channel] for each in qualities]
    unit = channels[0].unit
    largest = max(float(np.abs(each.values).max(initial=0.0)) for each in channels)
    residual = max(float(np.abs(each.residual).max(initial=0.0)) for each in qualities)
    return display_unit(unit, largest), display_unit(unit, residual)
