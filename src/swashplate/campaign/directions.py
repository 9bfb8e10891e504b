"""Signals that go against each other: a command, a current or a motion with the wrong sign."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.experiment import Channel, Experiment
from swashplate.campaign.samples import Array

DIRECTED = ("signed_current", "shaft_speed", "swash_angle", "spool_position")
"""Kinds of channel that have the sign of the command, beside positions, whose changes have it."""


def turned(driven: Array, motion: Array) -> bool:
    """Whether a motion (n,) goes against what it should be (n,), in any units, both about zero.

    Their correlation is below -0.5.
    """
    size = float(np.linalg.norm(driven) * np.linalg.norm(motion))
    return float(driven @ motion) < -0.5 * size


def turned_channels(experiment: Experiment, unsigned: Collection[str] = ()) -> tuple[str, ...]:
    """Channels that go against the input, without the `unsigned` ones, whose sign says nothing."""
    drive, names = experiment.input, list[str]()
    for name, channel in experiment.channels.items():
        used = channel.used
        time, motion = channel.time[used], channel.values[used]
        directed = channel.is_position or channel.kind in DIRECTED
        if not directed or name in unsigned or time.size < 2:
            continue
        if channel.is_position:
            motion, time = np.diff(motion) / np.diff(time), 0.5 * (time[1:] + time[:-1])
        if turned(drive.at(time) - drive.values[0], motion):
            names.append(name)
    return tuple(names)


def currents_are_turned(experiment: Experiment) -> bool:
    """Whether the positive solenoid's current flows under negative commands, or the other way.

    Of a current with a sign, whether it has the opposite one.
    """
    for channel in experiment.of_kind("signed_current"):
        if channel.name in turned_channels(experiment):
            return True
    for channel in experiment.of_kind("current_plus", "current_minus"):
        if _flows_against(experiment, channel):
            return True
    return False


def _flows_against(experiment: Experiment, channel: Channel) -> bool:
    """Whether one solenoid's current flows while the command is on the other solenoid's side."""
    time, current = channel.time[channel.used], np.abs(channel.values[channel.used])
    peak = float(np.quantile(current, 0.99)) if current.size else 0.0
    others = [
        float(np.abs(other.values[other.used]).max(initial=0.0))
        for other in experiment.of_kind("current_plus", "current_minus")
    ]
    # an idle solenoid's noise has no direction
    if peak < 0.25 * max(others) or peak == 0.0:
        return False
    command = experiment.input.at(time) - experiment.input.values[0]
    flowing: NDArray[np.bool_] = current > 0.5 * peak
    against = 1.0 if channel.kind == "current_minus" else -1.0
    return float(np.mean(np.sign(command[flowing]) == against)) > 0.5


def reversed_commands(experiments: Sequence[Experiment]) -> Iterator[tuple[Experiment | None, str]]:
    """A sentence if a command goes against both currents and motion, with the run it is of.

    Currents and motion agree then, and what has the wrong sign is the command. None stands for all
    runs; without a current in them nothing is said.
    """
    measured = [
        run
        for run in experiments
        if run.of_kind("signed_current", "current_plus", "current_minus")
        and run.of_kind("shaft_speed", "position", "encoder_counts")
    ]
    against = [run for run in measured if currents_are_turned(run) and _moves_against(run)]
    if not against:
        return
    why = "current and motion agree with each other, so the command has the wrong sign"
    if len(against) == len(measured) and len(measured) > 1:
        axis = against[0].axis
        yield (
            None,
            f"In all {len(against)} runs of the axis '{axis}' the current flows in the solenoid "
            f"opposite to the command: {why}; reverse the input with sign = -1 in "
            f"[axes.{axis}.input]",
        )
        return
    for run in against:
        others = " (in other runs in the command's own)" if len(measured) > 1 else ""
        yield (
            run,
            f"In {run.name} the current flows in the solenoid opposite to the command{others}: "
            f"{why}; reverse the input with axes.{run.axis}.input.sign = -1 in this run",
        )


def _moves_against(experiment: Experiment) -> bool:
    """Whether a motion goes against the input."""
    motions = experiment.of_kind("shaft_speed", "position", "encoder_counts")
    names = {channel.name for channel in motions}
    return bool(names & {*turned_channels(experiment)})


def swapped_currents(experiment: Experiment) -> bool:
    """Whether both solenoids' currents go against a command that the motion follows."""
    halves = experiment.of_kind("current_plus", "current_minus")
    return bool(halves) and currents_are_turned(experiment) and not _moves_against(experiment)


def solenoid_side(
    commands: Sequence[Array], first: Sequence[Array], second: Sequence[Array]
) -> Literal[-1, 0, 1]:
    """Side of the command on which the first of two solenoids' currents flows, 0 if unknown.

    From arrays (n,) of some logs. The currents must take turns: while one is beyond half of its
    largest value the other is below a quarter of its own.
    """
    logs = [
        log
        for log in zip(commands, first, second, strict=False)
        if log[0].size == log[1].size == log[2].size
    ]
    if not logs or not len(commands) == len(first) == len(second):
        return 0
    command, one, other = (np.concatenate(parts) for parts in zip(*logs, strict=True))
    finite = np.isfinite(command) & np.isfinite(one) & np.isfinite(other)
    command = command[finite]
    flows = list[Array]()
    for current in (np.abs(one[finite]), np.abs(other[finite])):
        # a solenoid may have a bias at rest; single samples do not count
        if not current.size:
            return 0
        low, high = np.quantile(current, (0.01, 0.99))
        if high <= low:
            return 0
        flows.append((current - low) / (high - low))
    alone = [(flows[0] > 0.5) & (flows[1] < 0.25), (flows[1] > 0.5) & (flows[0] < 0.25)]
    together = (flows[0] > 0.5) & (flows[1] > 0.5)
    if min(part.sum() for part in alone) <= together.sum():
        return 0
    levels = [float(np.median(command[part])) for part in alone]
    if levels[0] == levels[1]:
        return 0
    return 1 if levels[0] > levels[1] else -1
