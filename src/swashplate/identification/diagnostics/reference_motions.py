"""Motions by which it is judged what a fit leaves open of a drive, whatever its tests were.

A stair through all commands that the tests had, steps as large as theirs, and a sine as fast as the
fastest of the tests: what a drive is used for. Beside them steps to the largest commands and a
faster sine, which no test needs to have and which tell most where the tests are slow.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import Experiment
from swashplate.errors import DomainError, InputError
from swashplate.identification.diagnostics.discrepancy import TIME, ChannelErrors
from swashplate.identification.estimation.drive_model import DriveModel
from swashplate.identification.estimation.model import linearised as linearised_model
from swashplate.identification.estimation.posterior import Posterior
from swashplate.identification.optimum import Optimum
from swashplate.machine.marching import SOURCE_RATE

Array = NDArray[np.float64]

LEVELS, MOST_LEVELS = 10, 40
"""Levels of the stair, each way, and of one whose steps are as small as those of the tests."""
HELD = 1.0
"""Time for which a level of the stair is held; a step three times as long. [s]"""
PERIODS = 3
"""Of a sine."""
FASTER = 0.5
"""Frequency of the faster sine: an operator who swings the stick. [Hz]"""
SAMPLED = 64.0
"""Rate at which a reference motion is looked at. [Hz]"""
ALIKE = 0.95
"""Part of the largest command from which a step of a test is one to it. [1]"""


class Pace(NamedTuple):
    """How fast the tests of a fit were."""

    sine: float
    """Highest frequency of a sine; 0 without one. [Hz]"""
    step: float
    """Largest change of the command within 0.1 s. [unit of the command]"""


def pace_of(runs: Sequence[Experiment], sine: float) -> Pace:
    """How fast some runs are, of which the frequency of the fastest sine is known [Hz]."""
    largest = 0.0
    for run in runs:
        command = run.input
        ahead = np.interp(command.time + TIME, command.time, command.values)
        largest = max(largest, float(np.abs(ahead - command.values).max()))
    return Pace(sine, largest)


class ReferenceMotion(NamedTuple):
    """A command that no log needs to have, in the unit of the campaign's commands."""

    name: str
    values: Array
    """(n,) samples at `SOURCE_RATE`."""
    beyond: str = ""
    """In words, if it is faster than any test."""


def motions_between(low: float, high: float, pace: Pace) -> Iterator[ReferenceMotion]:
    """The motions between two commands, 0 within them, for tests of a pace."""
    low, high = min(low, 0.0), max(high, 0.0)
    ends = [end for end in (high, low) if end != 0.0]
    largest = max(high, -low)
    if pace.step > 0.0:
        count = int(np.clip(np.ceil(largest / pace.step), LEVELS, MOST_LEVELS))
        up = np.arange(count + 1) / count
        stair = np.concatenate([end * np.concatenate([up, up[-2:0:-1]]) for end in ends])
        yield ReferenceMotion("stair", _held([*stair, 0.0], HELD))
        steps = [float(np.copysign(min(pace.step, abs(end)), end)) for end in ends]
        yield ReferenceMotion("steps", _held([0.0, *steps, 0.0], 3.0 * HELD))
    if pace.sine > 0.0:
        yield ReferenceMotion("sine", _sine(low, high, pace.sine))
    if pace.step < ALIKE * largest:
        yield ReferenceMotion("larger steps", _held([0.0, *ends, 0.0], 3.0 * HELD), "steps")
    if pace.sine < FASTER:
        yield ReferenceMotion("faster sine", _sine(low, high, FASTER), f"a sine of {FASTER:g} Hz")


def _held(levels: Sequence[float], duration: float) -> Array:
    """Levels one after another, each for so long [s]."""
    return np.repeat(np.array(levels), round(duration * SOURCE_RATE))


def _sine(low: float, high: float, frequency: float) -> Array:
    """A sine that begins at 0 and reaches both ends; half waves of one sign if one of them is 0."""
    time = np.arange(round(PERIODS / frequency * SOURCE_RATE)) / SOURCE_RATE
    wave = np.sin(2.0 * np.pi * frequency * time)
    size_down = -low if low < 0.0 else -high
    return np.where(wave > 0.0, high if high > 0.0 else low, size_down) * wave


def motions_left_open(
    fit: Optimum, posterior: Posterior, fastest_sine: float
) -> Iterator[tuple[ReferenceMotion, str, ChannelErrors]]:
    """What the posterior leaves open of each channel in each reference motion of a drive.

    `fastest_sine` is the highest frequency of a sine among the tests, 0 without one [Hz]. Nothing
    of a user-defined model, or of a drive that does not hold under such a command.
    """
    if not isinstance(fit.problem.model, DriveModel) or not posterior.names:
        return
    runs = fit.problem.experiments
    alike = [run for run in runs if run.input.kind == "voltage"] or runs
    template = max(alike, key=lambda run: len(run.channels))
    low = min(float(run.input.values.min()) for run in alike)
    high = max(float(run.input.values.max()) for run in alike)
    if low == high == 0.0:
        return
    model = DriveModel(fit.drive.parameters)
    for motion in motions_between(low, high, pace_of(alike, fastest_sine)):
        experiment = _moved(template, motion.values)
        try:
            response = linearised_model(model, {}, experiment, posterior.names)
        except (DomainError, InputError):
            continue
        for name, part in response.items():
            errors = part.by @ posterior.changes
            yield motion, name, _record(motion, experiment, name, part.values, errors)


def _moved(template: Experiment, command: Array) -> Experiment:
    """A run with another command, in which each channel would be read evenly."""
    time = np.arange(command.size) / SOURCE_RATE
    stamps = np.arange(0.0, time[-1], 1.0 / SAMPLED)
    channels = {
        name: replace(
            channel,
            time=stamps,
            values=np.zeros(stamps.size),
            weight=np.ones(stamps.size),
            counts=None,
        )
        for name, channel in template.channels.items()
    }
    signal = replace(template.input, time=time, values=command, interpolation="linear")
    return replace(template, input=signal, channels=channels, start="rest", start_pressure=None)


def _record(
    motion: ReferenceMotion, experiment: Experiment, name: str, simulated: Array, errors: Array
) -> ChannelErrors:
    """A channel of a reference motion, which errs by nothing but what is left open of it."""
    channel, step = experiment[name], 1.0 / SAMPLED
    signal = np.gradient(simulated, step) if channel.is_position else simulated
    nothing = np.zeros(simulated.size)
    return ChannelErrors(
        run=motion.name,
        maneuver=motion.name,
        held_out=True,
        start=0.0,
        step=step,
        measured=simulated,
        error=nothing,
        noise=0.0,
        rounding=nothing,
        signal=signal,
        rate=TIME * np.gradient(signal, step),
        command=experiment.input.at(channel.time),
        is_position=channel.is_position,
        left_open=errors,
    )
