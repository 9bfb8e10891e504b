"""Data checks: whether a campaign can be fitted at all, before the solver starts."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import partial
from itertools import chain
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.campaign import Campaign
from swashplate.campaign.experiment import Channel, Experiment
from swashplate.campaign.quality import beyond_the_card, spiked, unsigned_currents
from swashplate.errors import InputError
from swashplate.identification.drive_model import SIGNALS, simulated_run
from swashplate.identification.model import EquationModel
from swashplate.identification.problem import Loss, Problem
from swashplate.identification.setup import ModelSetup
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.simulation.result import Simulation

Array = NDArray[np.float64]

Severity = Literal["refuse", "warn"]

WINDOW = 0.2
"""Time over which the speed behind a position is taken. [s]"""
MOVING = 0.1
"""Of the largest motion in any run, from which a run's own can be judged."""
ALIKE = 0.5
"""Correlation below minus which a signal is that of the drive turned round."""
FAR_OFF = 3.0
"""By which a channel should not differ from the nominal drive."""
FROZEN = 1.0
"""Time for which no position stands still while its drive runs. [s]"""
DEAD = 0.2
"""Part of a channel's largest simulated range that a run must have for a still sensor to be
broken."""
NAMED = 8
"""Unknowns that a sentence names."""


class Finding(NamedTuple):
    """Something that stands in the way of a fit."""

    severity: Severity
    """"refuse" where no result could mean anything; "warn" where some of it could."""
    run: str | None
    """The experiment's name; None for the campaign or its set-up."""
    channel: str | None
    sentence: str
    """What is wrong, where, and what would be right."""


refusal, warning = partial(Finding, "refuse"), partial(Finding, "warn")


# --- what is looked at ----------------------------------------------------------------------------


def check_runs(experiments: Sequence[Experiment], nominal: ParameterSet) -> list[Finding]:
    """What stands in the way of a fit: runs beside each other and beside the nominal drive.

    What must be refused comes first. Later checks need what earlier ones found sound, so that not
    everything that is wrong is always listed at once. Runs or a drive that cannot be simulated are
    refused in an `InputError` or a `DomainError`.
    """
    unsigned = unsigned_currents(experiments).items()
    found = [refusal(None, name, f"{said}.") for (_, name), said in unsigned]
    for each in experiments:
        found += _samples(each, [n for n, c in each.channels.items() if c.kind in SIGNALS])
    if not _refused(found):
        found += idle_commands(experiments, nominal)
    if _refused(found):
        return found
    of_channels = motions(experiments, nominal)
    for check in (_still_sensors, _frozen_positions, contradictions):
        said = {(each.run, each.channel) for each in found}
        left = {
            name: [
                each
                for each in ours
                if said.isdisjoint({(each.experiment.name, name), (each.experiment.name, None)})
            ]
            for name, ours in of_channels.items()
        }
        found += check(left)
    return sorted(found, key=lambda each: each.severity != "refuse")


def check_model(experiments: Sequence[Experiment], setup: ModelSetup) -> tuple[Finding, ...]:
    """What stands in the way of a fit of a model of one's own, as `check_runs` of a drive.

    Whatever the model: samples that are no numbers, sensors that stand still while their input
    moves, and a run that is there twice.
    """
    found, seen = list[Finding](), dict[bytes, str]()
    for each in experiments:
        found += _samples(each, setup.channels or tuple(each.channels))
    if _refused(found):
        return tuple(found)
    problem = setup.problem(experiments)
    moving = {n for e in experiments for n, c in e.channels.items() if np.ptp(c.values) > 0.0}
    for each in problem.experiments:
        names = [name for name in problem.channels if name in each.channels]
        arrays = [each.input.values, *(each[name].values for name in names)]
        first = seen.setdefault(b"".join(array.tobytes() for array in arrays), each.name)
        if first != each.name:
            said = (
                f"{each.name} has the samples of {first}, to the last bit, and counts twice; leave"
            )
            found.append(warning(each.name, None, f'{said} one of them out with role = "ignore".'))
        for name in names if np.ptp(each.input.values) > 0.0 else ():
            used = each[name].values[each[name].used]
            if name in moving and used.size and np.ptp(used) == 0.0:
                said = f"{each.name}: '{name}' never changes, though the input does and it moves in"
                also = "other runs; look at the sensor, or ignore the channel in this run."
                found.append(warning(each.name, name, f"{said} {also}"))
    return tuple(sorted(found, key=lambda each: each.severity != "refuse"))


def contradicting_runs(
    experiments: Sequence[Experiment], parameters: ParameterSet
) -> list[Finding]:
    """Runs whose sign or scale contradicts the others, beside a drive that was fitted to all."""
    found = contradictions(motions(experiments, parameters))
    return [each for each in found if each.run is not None]


def refuse_unsound(findings: Sequence[Finding]) -> tuple[str, ...]:
    """Sentences of what is only a warning.

    Raises
    ------
    InputError
        With the first finding that must be refused, and how many more there are.
    """
    refused = [each for each in findings if each.severity == "refuse"]
    if refused:
        more = len(refused) - 1
        also = f" ({more} more finding{'s' if more > 1 else ''} of this weight.)" if more else ""
        raise InputError(refused[0].sentence + also)
    return tuple(each.sentence for each in findings)


def spike_findings(experiments: Sequence[Experiment], loss: Loss) -> list[Finding]:
    """Spikes, gross ones to be refused unless a robust loss takes their weight."""
    found = []
    for (run, name), (sentence, gross) in spiked(experiments).items():
        make = refusal if gross and loss == "linear" else warning
        found.append(make(run, name, f"{sentence}."))
    return found


def _refused(found: Sequence[Finding]) -> bool:
    return any(each.severity == "refuse" for each in found)


# --- samples --------------------------------------------------------------------------------------


def _samples(experiment: Experiment, fitted: Collection[str]) -> list[Finding]:
    """Runs without two samples, and numbers that are none."""
    name, signal = experiment.name, experiment.input
    bad = ~(np.isfinite(signal.values) & np.isfinite(signal.time))
    if signal.values.size < 2:
        said = f"its input has {_count(signal.values.size)}; at least two are needed, and a run "
        return [refusal(name, None, f"{name}: {said}with motion has hundreds.")]
    if bad.any():
        said = f"{name}: its input is not finite at sample {int(np.argmax(bad))}; mend the log or "
        return [refusal(name, None, f"{said}cut the run with a span.")]
    channels = (each for key, each in experiment.channels.items() if key in fitted)
    return [finding for each in channels for finding in _of_channel(name, each)]


def _of_channel(run: str, channel: Channel) -> list[Finding]:
    used, name = channel.used, channel.name
    if channel.values.size and not used.any():
        return []
    bad = used & ~(np.isfinite(channel.values) & np.isfinite(channel.time))
    samples = int(np.count_nonzero(used))
    if bad.any():
        said = (
            f"is not finite in {_count(int(np.count_nonzero(bad)))}, the first at "
            f'{channel.time[np.argmax(bad)]:.6g} s; say missing = "drop", or ignore a window, the '
            "channel or the run."
        )
    elif samples < 2:
        said = (
            f"has {_count(samples)} that can count, which shows no motion; leave the run "
            'out with role = "ignore".'
        )
    else:
        return []
    return [refusal(run, name, f"{run}: '{name}' {said}")]


def _count(samples: int) -> str:
    return f"{samples} sample{'' if samples == 1 else 's'}"


# --- commands -------------------------------------------------------------------------------------


def idle_commands(experiments: Sequence[Experiment], nominal: ParameterSet) -> list[Finding]:
    """Commands that move nothing."""
    idle, numbers = {}, nominal.numbers
    symbols = {"voltage": ("V_dz", "V_dz_minus", "V_dz_plus"), "current": ("Z17", "Z17", "Z17")}
    for each in experiments:
        if each.input.kind not in symbols:
            continue
        symbol, minus, plus = symbols[each.input.kind]
        low, high = -numbers[minus], numbers[plus]
        least, most, unit = each.input.values.min(), each.input.values.max(), each.input.unit
        if low <= least and most <= high:
            idle[each.name] = (
                f"its command stays between {least:.3g} and {most:.3g} {unit}, within the dead "
                f"zone {symbol} ({low:.3g} to {high:.3g} {unit})"
            )
    if idle and len(idle) == len(experiments):
        first, why = next(iter(idle.items()))
        others = ", and so it is in all other runs" if len(idle) > 1 else ""
        peak = 1e3 * max(float(np.abs(each.input.values).max()) for each in experiments)
        # a thousandth of a usual command, in volts that were declared as millivolts
        meant = f' or, if the log is in V, write unit = "V": it then reaches {peak:.3g} V'
        millivolts = experiments[0].input.kind == "voltage" and 1.0 <= peak <= FULL_VOLTAGE
        said = (
            f"{first}: {why}{others}; a drive that does not move cannot be identified: "
            f"use larger commands{meant * millivolts}."
        )
        return [refusal(first, None, said)]
    return [
        warning(run, None, f"{run}: {why}; it shows the drive at rest only.")
        for run, why in idle.items()
    ]


# --- what channels do beside the nominal drive ----------------------------------------------------


class Motion(NamedTuple):
    """What a channel did in a run, measured and simulated, where it counts."""

    experiment: Experiment
    channel: Channel
    time: Array
    """(n,) [s]"""
    measured: Array
    """(n,) of a position its mean speeds. [unit]"""
    simulated: Array
    """(n,) the nominal drive's. [unit]"""

    @property
    def gain(self) -> float:
        """Measured over simulated, in the least-squares sense; negative where turned round."""
        return float(self.measured @ self.simulated / (self.simulated @ self.simulated))

    @property
    def correlation(self) -> float:
        """Of measured and simulated about zero, -1 to 1."""
        return _correlation(self.measured, self.simulated)


def motions(experiments: Sequence[Experiment], parameters: ParameterSet) -> dict[str, list[Motion]]:
    """What each channel did in each run, by the channel's name; runs that hardly move left out."""
    found: dict[str, list[Motion]] = {}
    for experiment in experiments:
        simulation = simulated_run(experiment, parameters)
        for name, channel in experiment.channels.items():
            used, signal = channel.used, SIGNALS.get(channel.kind)
            driven = experiment.input.kind == "current" and "current" in channel.kind
            if signal is None or driven or np.count_nonzero(used) < 2:
                continue
            time, measured = channel.time[used], channel.values[used]
            simulated = _simulated(simulation, signal, time)
            if channel.is_position:
                # mean speeds in short windows: where a position drifts to says little
                windows = max(int((time[-1] - time[0]) / WINDOW), 4)
                grid = np.linspace(time[0], time[-1], windows + 1)
                measured, simulated = (
                    np.diff(np.interp(grid, time, each)) / np.diff(grid)
                    for each in (measured, simulated)
                )
                time = 0.5 * (grid[1:] + grid[:-1])
            found.setdefault(name, []).append(
                Motion(experiment, channel, time, measured, simulated)
            )
    moving = {}
    for name, ours in found.items():
        sizes = [_rms(each.simulated) for each in ours]
        pairs = zip(ours, sizes, strict=True)
        moving[name] = [m for m, size in pairs if size > 0.0 and size >= MOVING * max(sizes)]
    return moving


def _simulated(simulation: Simulation, signal: str, time: Array) -> Array:
    if signal == "current_sum":
        plus, minus = (simulation.at(time, f"current_{side}") for side in ("positive", "negative"))
        return plus + minus
    return simulation.at(time, signal)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else 0.0


def _correlation(first: Array, second: Array) -> float:
    size = float(np.linalg.norm(first) * np.linalg.norm(second))
    return float(first @ second) / size if size > 0.0 else 0.0


def _still_sensors(of_channels: Mapping[str, Sequence[Motion]]) -> list[Finding]:
    """Sensors that show nothing while the drive moves."""
    found = []
    for name, ours in of_channels.items():
        largest = max((float(np.ptp(each.simulated)) for each in ours), default=0.0)
        for each in ours:
            moves, run = float(np.ptp(each.simulated)), each.experiment.name
            unit = f"{each.channel.unit}/s" if each.channel.is_position else each.channel.unit
            if float(np.ptp(each.measured)) == 0.0 and moves > DEAD * largest:
                said = f"never changes, though the drive should move it by about {moves:.3g} {unit}"
                also = "look at the sensor, and ignore the channel in this run."
                found.append(refusal(run, name, f"{run}: '{name}' {said}; {also}"))
    return found


def _frozen_positions(of_channels: Mapping[str, Sequence[Motion]]) -> list[Finding]:
    """Positions that stay the same to the last count for a while in which the drive runs."""
    found = []
    for name, ours in of_channels.items():
        fastest = max((float(np.abs(each.simulated).max()) for each in ours), default=0.0)
        for each in (each for each in ours if each.channel.is_position):
            frozen = (each.measured == 0.0) & (np.abs(each.simulated) > DEAD * fastest)
            edges = np.flatnonzero(np.diff(np.concatenate([[False], frozen, [False]])))
            half = 0.5 * float(np.median(np.diff(each.time)))
            windows = [
                (each.time[first] - half, each.time[stop - 1] + half)
                for first, stop in zip(edges[::2], edges[1::2], strict=True)
            ]
            long = [window for window in windows if window[1] - window[0] > FROZEN]
            if long:
                (begin, end), run = long[0], each.experiment.name
                said = (
                    f"{run}: '{name}' stands still from {begin:.4g} to {end:.4g} s, though the "
                    "drive should move it; look at the sensor and at the machine's stops, and "
                    "ignore that window."
                )
                found.append(warning(run, name, said))
    return found


# --- runs beside each other -----------------------------------------------------------------------


def contradictions(of_channels: Mapping[str, Sequence[Motion]]) -> list[Finding]:
    """Runs whose sign or scale beside the drive cannot be right, or a channel's as a whole."""
    found: list[Finding] = []
    for name, ours in of_channels.items():
        turned = [each for each in ours if each.correlation < -ALIKE]
        found += _turned(name, turned, len(ours))
        found += _scales(name, [each for each in ours if each not in turned])
    return found


def _turned(name: str, turned: Sequence[Motion], runs: int) -> list[Finding]:
    if runs > 1 and len(turned) == runs:
        said = f"In all {runs} runs '{name}' goes against the command: reverse it with "
        return [refusal(None, name, f"{said}sign = -1 in its channel, or the input's.")]
    others = "" if runs == 1 else ", in the other runs with it"
    return [
        refusal(
            each.experiment.name,
            name,
            f"In {each.experiment.name} '{name}' goes against the command{others}: reverse it "
            'with sign = -1 for this run, or leave the run out with role = "ignore".',
        )
        for each in turned
    ]


def _scales(name: str, ours: Sequence[Motion]) -> list[Finding]:
    gains = np.array([abs(each.gain) for each in ours])
    middle = float(np.median(gains)) if ours else 1.0
    hint = "check its unit, scale, counts_per_turn (quadrature included) and the drive."
    if not 1.0 / FAR_OFF < middle < FAR_OFF:
        said = f"'{name}' moves {middle:.3g} times as far as in the nominal drive: {hint}"
        return [warning(None, name, said)]
    return [
        warning(
            each.experiment.name,
            name,
            f"In {each.experiment.name} '{name}' moves {gain:.3g} times as far as in the nominal "
            f"drive, in the other runs {middle:.3g} times: {hint}",
        )
        for each, gain in zip(ours, gains, strict=True)
        if not 1.0 / FAR_OFF < gain / middle < FAR_OFF
    ]


# --- what the runs determine ----------------------------------------------------------------------


def check_rank(where: str, problem: Problem) -> list[Finding]:
    """Fewer samples than unknowns, or unknowns on which nothing depends."""
    unknowns = problem.unknowns
    if problem.samples < len(unknowns):
        said = f"{_count(problem.samples)} cannot determine {len(unknowns)} parameters; "
        return [refusal(None, None, f"{where}: {said}record longer runs, or free less.")]
    exact = isinstance(problem.model, EquationModel)  # any other may take minutes
    if exact and not problem.evaluate(problem.start).jacobian.any():
        said = f"no run depends on any of {', '.join(unknowns.names[:NAMED])}; free what the runs "
        return [refusal(None, None, f"{where}: {said}exercise, or test what exercises these.")]
    return []


def beside_the_drives(campaign: Campaign) -> list[str]:
    """What stands out when each axis's drive is simulated under the runs' commands."""
    from swashplate.identification.fitting import smooth

    found = []
    for name, axis in campaign.axes.items():
        if axis.drive is None:
            continue
        nominal = smooth(campaign.drive(name).parameters)
        runs = campaign.select(axis=name)
        beyond = {each.name: beyond_the_card(each) for each in runs}
        found += [
            f"{said}; this run is not compared with the drive"
            for said in chain.from_iterable(beyond.values())
        ]
        runs = tuple(each for each in runs if not beyond[each.name])
        # a drive that is made up says nothing of what a machine does
        made_up = all(each.status == "assumed" for each in nominal.values())
        if runs and not made_up and all(each.input.kind != "other" for each in runs):
            found += [each.sentence.rstrip(".") for each in check_runs(runs, nominal)]
    return found
