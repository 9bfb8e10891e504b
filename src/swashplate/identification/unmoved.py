"""Runs in which the drive is not moved, or not for long enough to answer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.experiment import Experiment
from swashplate.drive import Drive
from swashplate.identification.contradictions import Finding
from swashplate.identification.motion import Motion
from swashplate.parameters.parameter_set import ParameterSet

Array = NDArray[np.float64]

LONGEST = 20
"""Length of the simulated step. [s]"""
RATE = 512
"""Its rate. [Hz]"""
TRIAL = 5.0
"""Command of the step from which the drive's time constant is taken. [V]"""
RISEN = 1.0 - float(np.exp(-1.0))
"""Part of the settled value that is reached after one time constant."""
FROZEN = 1.0
"""Time for which no position stands still while its drive runs. [s]"""
DEAD = 0.2
"""Part of a channel's largest simulated range that a run must have for a still sensor to be
broken."""


def idle_commands(experiments: Sequence[Experiment], nominal: ParameterSet) -> list[Finding]:
    """Commands that move nothing."""
    idle = {}
    for each in experiments:
        low, high = _dead_zone(each, nominal)
        if low <= each.input.values.min() and each.input.values.max() <= high:
            symbol = "V_dz" if each.input.kind == "voltage" else "Z17"
            idle[each.name] = (
                f"its command stays between {each.input.values.min():.3g} and "
                f"{each.input.values.max():.3g} {each.input.unit}, within the dead zone {symbol} "
                f"({low:.3g} to {high:.3g} {each.input.unit})"
            )
    if idle and len(idle) == len(experiments):
        first, why = next(iter(idle.items()))
        others = ", and so it is in all other runs" if len(idle) > 1 else ""
        said = f"{first}: {why}{others}; a drive that is not moved tells nothing: command more."
        return [Finding("refuse", first, None, said)]
    return [
        Finding("warn", run, None, f"{run}: {why}; it tells of the drive at rest alone.")
        for run, why in idle.items()
    ]


def _dead_zone(experiment: Experiment, nominal: ParameterSet) -> tuple[float, float]:
    """Inputs between which a drive does not answer; none for an input that drives none."""
    numbers = nominal.numbers
    if experiment.input.kind == "voltage":
        return -numbers["V_dz_minus"], numbers["V_dz_plus"]
    if experiment.input.kind == "current":
        return -numbers["Z17"], numbers["Z17"]
    return np.inf, -np.inf


def still_sensors(of_channels: Mapping[str, Sequence[Motion]]) -> list[Finding]:
    """Sensors that show nothing while the drive moves."""
    found = []
    for name, ours in of_channels.items():
        largest = max((float(np.ptp(each.simulated)) for each in ours), default=0.0)
        for each in ours:
            moves, run = float(np.ptp(each.simulated)), each.experiment.name
            if float(np.ptp(each.measured)) == 0.0 and moves > DEAD * largest:
                said = (
                    f"{run}: '{name}' never changes, though the drive should move it by about "
                    f"{moves:.3g} {each.unit}; look at the sensor, and ignore the channel "
                    "in this run."
                )
                found.append(Finding("refuse", run, name, said))
    return found


def frozen_positions(of_channels: Mapping[str, Sequence[Motion]]) -> list[Finding]:
    """Positions that stay the same to the last count for a while in which the drive runs."""
    found = []
    for name, ours in of_channels.items():
        fastest = max((float(np.abs(each.simulated).max()) for each in ours), default=0.0)
        for each in ours:
            if not each.channel.is_position:
                continue
            frozen = (each.measured == 0.0) & (np.abs(each.simulated) > DEAD * fastest)
            edges = np.flatnonzero(np.diff(np.concatenate([[False], frozen, [False]])))
            windows = 0.5 * float(np.median(np.diff(each.time)))
            for first, stop in zip(edges[::2], edges[1::2], strict=True):
                begin, end = each.time[first] - windows, each.time[stop - 1] + windows
                if end - begin > FROZEN:
                    run = each.experiment.name
                    said = (
                        f"{run}: '{name}' stands still from {begin:.4g} to {end:.4g} s, though the "
                        "drive should move it; look at the sensor and at the machine's stops, and "
                        "ignore that window."
                    )
                    found.append(Finding("warn", run, name, said))
                    break
    return found


def constant_commands(
    experiments: Sequence[Experiment], of_channels: Mapping[str, Sequence[Motion]]
) -> list[Finding]:
    """Commands that never change."""
    constant = [each for each in experiments if np.ptp(each.input.values) == 0.0]
    found = []
    for each in constant:
        level = f"{each.input.values[0]:.3g} {each.input.unit}"
        said = f"{each.name}: its command is {level} throughout"
        running = [
            motion.channel.name
            for motion in chain.from_iterable(of_channels.values())
            if motion.experiment is each
            and motion.channel.kind == "shaft_speed"
            and _runs_from_the_first(motion.measured)
        ]
        if each.start != "rest":
            severity = len(constant) == len(experiments)
            said += f', and it starts "{each.start}": nothing moves; add commands that change.'
        elif running:
            severity = True
            said += (
                f", and '{running[0]}' runs from the first sample on, though it is to start at "
                'rest; say start = "steady" and add commands that change.'
            )
        else:
            severity = False
            said += ", which counts as a step at the first sample; log from before the command on."
        found.append(Finding("refuse" if severity else "warn", each.name, None, said))
    return found


def _runs_from_the_first(speed: Array) -> bool:
    """Whether the first hundredth of a run is half as fast as the rest, or faster."""
    few = max(speed.size // 100, 1)
    rest = float(np.median(speed[few:])) if speed.size > few else 0.0
    return abs(rest) > 0.0 and float(np.median(speed[:few])) / rest > 0.5


def short_runs(
    experiments: Sequence[Experiment], nominal: ParameterSet, *, of_current: bool
) -> list[Finding]:
    """Runs that end before the drive, or its card's current alone, has answered."""
    lag = time_constant(nominal, of_current=of_current)
    if lag is None:
        return []
    after = {each.name: _answer(each, nominal) for each in experiments}
    short = {name: length for name, length in after.items() if 0.0 <= length < lag}
    needs = (
        f"the drive's {'current' if of_current else 'speed'} needs {lag:.3g} s for 63 % of a "
        f"{TRIAL:g} V step"
    )
    if short and len(short) == sum(length >= 0.0 for length in after.values()):
        longest = max(short, key=lambda name: short[name])
        said = (
            f"No run lasts: the longest, {longest}, ends {short[longest]:.3g} s after its command "
            f"begins, and {needs}; record several seconds."
        )
        return [Finding("refuse", longest, None, said)]
    return [
        Finding(
            "warn",
            name,
            None,
            f"{name} ends {length:.3g} s after its command begins, and {needs}; it tells of the "
            "beginning alone.",
        )
        for name, length in short.items()
    ]


def time_constant(nominal: ParameterSet, *, of_current: bool = False) -> float | None:
    """Time for 63 % of a 5 V step, delay and rate limits included; None if there is no answer. [s]

    Parameters
    ----------
    nominal : ParameterSet
        The drive.
    of_current : bool
        Of the card's current instead of the shaft's speed.
    """
    drive = Drive(nominal)
    settled = drive.steady_current(TRIAL) if of_current else drive.steady_speed(TRIAL)
    at_rest = drive.steady_current(0.0) if of_current else drive.steady_speed(0.0)
    if not abs(settled - at_rest) > 0.0:
        return None
    run = drive.simulate(np.full(LONGEST * RATE + 1, TRIAL), float(RATE))
    answer = run.current if of_current else run.shaft_speed
    risen = np.flatnonzero((answer / settled) >= RISEN)
    return float(run.time[risen[0]]) if risen.size else None


def _answer(experiment: Experiment, nominal: ParameterSet) -> float:
    """From the first command beyond the dead zone to the last sample that counts. [s]

    Negative where there is no such command.
    """
    low, high = _dead_zone(experiment, nominal)
    signal = experiment.input
    beyond = np.flatnonzero((signal.values < low) | (signal.values > high))
    last = [each.time[each.used][-1] for each in experiment.channels.values() if each.used.any()]
    if not beyond.size or not last:
        return -1.0
    return float(max(last) - signal.time[beyond[0]])
