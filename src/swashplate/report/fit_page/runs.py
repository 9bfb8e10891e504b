"""The fitted and the held-out runs as the report shows them: channels, units, what was ignored."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import Channel, Experiment
from swashplate.identification.assessment import Assessment, RunQuality
from swashplate.identification.validation import ignored_windows, with_speeds
from swashplate.report.display_units import DisplayUnit, display_unit
from swashplate.report.fit_page.numbers import listed, seconds

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
    return _gathered(found)


def predicted_runs(predicted: Sequence[RunQuality]) -> tuple[ShownRun, ...]:
    """Runs that a drive was held against, those with the role 'validate' marked as such."""
    return _gathered(
        [(each, "", each.experiment.role == "validate") for each in with_speeds(predicted)]
    )


def _gathered(found: Sequence[tuple[RunQuality, str, bool]]) -> tuple[ShownRun, ...]:
    """Run by run, from qualities with their stage and whether they were held out."""
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


def off_scale(channel: Channel, values: Array) -> NDArray[np.bool_]:
    """(m,) ignored samples so far from those that count that they would press these flat."""
    used = channel.used
    if not used.any():
        return np.zeros(values.size, dtype=np.bool_)
    low, high = float(values[used].min()), float(values[used].max())
    room = 0.5 * (high - low)
    far: NDArray[np.bool_] = ~used & ((values < low - room) | (values > high + room))
    return far


def ignored_words(experiment: Experiment, channel: Channel) -> str:
    """What of a channel does not count, and why as far as the campaign says."""
    said = []
    for first, last in ignored_windows(channel):
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
