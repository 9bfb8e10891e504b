"""Weights that a set-up's stage puts on top of the campaign's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from swashplate.campaign import applying, inside
from swashplate.campaign.experiment import Experiment
from swashplate.errors import InputError
from swashplate.identification.setup import Stage


def check_weights(stage: Stage, experiments: Sequence[Experiment], channels: Sequence[str]) -> None:
    """Refuse weights that no channel takes, which would be lost in silence.

    Raises
    ------
    InputError
        If the stage has weights, but for no kind of channel that it fits.
    """
    weighed = [*stage.weights, *stage.weights_by_input]
    kinds = {c.kind for e in experiments for name, c in e.channels.items() if name in channels}
    if weighed and not kinds & set(weighed):
        raise InputError(
            f"The stage '{stage.name}' weighs {', '.join(dict.fromkeys(weighed))}, but the runs "
            f"have {', '.join(sorted(kinds))}: add weights for that, or take a set-up without."
        )


def weighted(experiment: Experiment, stage: Stage) -> Experiment:
    """The experiment with the stage's own weights multiplied in."""
    if not stage.weights and not stage.weights_by_input:
        return experiment
    channels = {}
    for name, channel in experiment.channels.items():
        weight = channel.weight.copy()
        for window in applying(stage.weights.get(channel.kind, ()), experiment.maneuver):
            weight[inside(window, channel.time)] *= window.factor
        for sized in applying(stage.weights_by_input.get(channel.kind, ()), experiment.maneuver):
            levels, factors = np.transpose(sized.factors)
            within = inside(sized, channel.time)
            size = np.abs(experiment.input.at(channel.time[within]))
            weight[within] *= np.interp(size, levels, factors)
        channels[name] = replace(channel, weight=weight)
    return replace(experiment, channels=channels)
