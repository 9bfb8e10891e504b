"""Positions re-anchored to the measurement every few seconds: how far the machine moved since.

A position is the integral of a speed, so a small error of the speed grows without end, and the
RMSE of a long run says more about its length than about the model. Setting the simulation to the
measured position at the beginning of every window asks instead how well a model predicts the next
few seconds; runs of any length are then comparable.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.experiment import Channel, Experiment
from swashplate.errors import InputError
from swashplate.identification.model import (
    Differentiable,
    Linearised,
    Model,
    linearised,
    simulated,
)

Array = NDArray[np.float64]


def anchor_rows(channel: Channel, every: float) -> NDArray[np.intp]:
    """For each sample, the sample that anchors it.

    Parameters
    ----------
    channel : Channel
        Its stamps are cut into windows from the first one on.
    every : float
        Length of a window. [s]

    Returns
    -------
    (m,) array of int
        The first sample of its window that counts, or the first of all if none does.

    Raises
    ------
    InputError
        If a window has no length.
    """
    if not (np.isfinite(every) and every > 0.0):
        raise InputError(f"Anchors every {every:g} s: give a positive number of seconds.")
    windows = (channel.time - channel.time[0]) // every
    counting = np.flatnonzero(channel.used)
    first: NDArray[np.intp] = np.searchsorted(windows, windows)
    if not counting.size:
        return first
    held = np.minimum(np.searchsorted(windows[counting], windows), counting.size - 1)
    candidate = counting[held]
    anchors: NDArray[np.intp] = np.where(windows[candidate] == windows, candidate, first)
    return anchors


def since_anchor(rows: Array, anchors: NDArray[np.intp]) -> Array:
    """Rows of a time series, (m,) or (m, k), less the row that anchors each."""
    return rows - rows[anchors]


def anchored(experiment: Experiment, channels: Sequence[str], every: float) -> Experiment:
    """An experiment of which some channels say how far it moved since the last anchor.

    Parameters
    ----------
    experiment : Experiment
        As measured.
    channels : sequence of str
        Channels to anchor; the others stay.
    every : float
        Length of a window. [s]

    Returns
    -------
    Experiment
        To be fitted or compared with an `anchored_model` of the same windows. The free zero of a
        position drops out. Noise of the anchoring sample is in the whole window.

    Raises
    ------
    InputError
        If there is no such channel, or a window has no length.
    """
    changed = {}
    for name in channels:
        channel = experiment[name]
        moved = since_anchor(channel.values, anchor_rows(channel, every))
        # what was counts is a difference now
        changed[name] = replace(channel, values=moved, encoder=None, counts=None)
    return replace(experiment, channels={**experiment.channels, **changed})


def anchored_model(model: Model, channels: Sequence[str], every: float) -> Model:
    """A model of which some channels are set to the measurement at the beginning of each window.

    Parameters
    ----------
    model : Model
        It runs on freely; only what it moves since the anchor is compared.
    channels, every :
        As of `anchored`.

    Returns
    -------
    Model
        `Differentiable` if the model is.
    """
    kind = _DifferentiableAnchored if isinstance(model, Differentiable) else _Anchored
    return kind(model, tuple(channels), every)


@dataclass(frozen=True)
class _Anchored:
    model: Model
    channels: tuple[str, ...]
    every: float

    def simulate(self, values: Mapping[str, float], experiment: Experiment) -> Mapping[str, Array]:
        outputs = dict(simulated(self.model, values, experiment))
        for name in self.channels:
            if name in outputs:
                anchors = anchor_rows(experiment[name], self.every)
                outputs[name] = since_anchor(outputs[name], anchors)
        return outputs


@dataclass(frozen=True)
class _DifferentiableAnchored(_Anchored):
    def linearise(
        self, values: Mapping[str, float], experiment: Experiment, names: Sequence[str]
    ) -> Mapping[str, Linearised]:
        outputs = dict(linearised(self.model, values, experiment, names))
        for name in self.channels:
            if name in outputs:
                anchors = anchor_rows(experiment[name], self.every)
                moved, by = (since_anchor(rows, anchors) for rows in outputs[name])
                outputs[name] = Linearised(moved, by)
        return outputs
