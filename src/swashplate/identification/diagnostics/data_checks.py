"""Data checks: whether a campaign can be fitted at all, before the solver starts."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import (
    SIGNALS,
    Campaign,
    Channel,
    Experiment,
    beyond_the_card,
    reversed_commands,
    spiked,
    turned,
    unsigned_currents,
    unsigned_word_sentence,
    wrapped_positions,
)
from swashplate.drive import Simulation
from swashplate.errors import InputError, UnsoundDataError
from swashplate.identification.estimation.drive_model import (
    CURRENTS,
    kinds_of,
    simulated_run,
)
from swashplate.identification.estimation.fit_problem import smooth
from swashplate.identification.estimation.model import EquationModel
from swashplate.identification.estimation.model_setup import ModelSetup
from swashplate.identification.estimation.problem import Loss, Problem
from swashplate.identification.estimation.setup import FitSetup
from swashplate.parameters import FULL_VOLTAGE, ParameterSet
from swashplate.tables import count

Array = NDArray[np.float64]

SPEED_WINDOW = 0.2
"""Time over which a mean speed is taken from a position. [s]"""
MOVING = 0.1
"""Motion of a run that is enough to judge it, as a part of the largest in any run. [1]"""
FAR_OFF = 3.0
"""Factor by which a channel should not differ from the nominal drive. [1]"""
FROZEN, DEAD = 1.0, 0.2
"""Time for which no position stands still while its drive runs [s]; and the part of a channel's
largest simulated range that a run must have for a still sensor to be broken."""
NAMED = 8
"""Unknowns that a sentence names."""
TO_AND_FRO = 0.05
"""Share of a channel's changes that turn back by more than one step if it is noisy. [1]"""
DWELLS = 0.1
"""Time for which a noisy channel stands at its very largest value only if it is clipped. [s]"""


class Finding(NamedTuple):
    """Something that stands in the way of a fit."""

    severity: Literal["refuse", "warn"]
    """"refuse" if no result could mean anything; "warn" if some of it could."""
    run: str | None
    """The experiment's name; None for the campaign or its fit setup."""
    channel: str | None
    sentence: str
    """What is wrong, where, and what would be right."""


refusal, warning = partial(Finding, "refuse"), partial(Finding, "warn")


# --- what is looked at ----------------------------------------------------------------------------


def check_runs(experiments: Sequence[Experiment], nominal: ParameterSet) -> list[Finding]:
    """What stands in the way of a fit: runs against each other and against the nominal drive.

    What must be refused comes first. Later checks need what earlier ones found sound, so that not
    everything that is wrong is always listed at once. Runs or a drive that cannot be simulated are
    refused in an `InputError` or a `DomainError`.
    """
    unsigned = {**unsigned_currents(experiments), **wrapped_positions(experiments)}
    findings = [refusal(None, name, f"{clause}.") for (_, name), clause in unsigned.items()]
    findings += [
        refusal(run.name if run else None, None, f"{sentence}.")
        for run, sentence in reversed_commands(experiments)
    ]
    for run in experiments:
        of_the_drive = [name for name, channel in run.channels.items() if channel.kind in SIGNALS]
        findings += _samples(run, of_the_drive)
    if not _refused(findings):
        findings += _idle_commands(experiments, nominal)
    if not _refused(findings):
        for name, runs in simulated_readings(experiments, nominal).items():
            named = {finding.run for finding in findings if finding.channel is None}
            unnamed = [readings for readings in runs if readings.run not in named]
            stuck_sensors = list(_stuck_sensors(name, unnamed))
            named |= {finding.run for finding in stuck_sensors}
            findings += stuck_sensors
            unnamed = [readings for readings in runs if readings.run not in named]
            findings += contradictions(name, unnamed)
    return sorted(findings, key=lambda finding: finding.severity != "refuse")


def unfitted_currents(experiments: Sequence[Experiment], setup: FitSetup) -> list[Finding]:
    """Warnings of currents of an amplifier that are measured, but that the fit does not use."""
    if setup.current == "measured":
        return []
    unfitted_kinds = set(CURRENTS).difference(setup.channels or kinds_of(setup.part))
    unfitted = dict.fromkeys(
        name
        for run in experiments
        if run.input.kind == "voltage"
        for name, channel in run.channels.items()
        if channel.kind in unfitted_kinds
    )
    return [
        warning(
            None,
            name,
            f"'{name}' is measured, but the fit setup leaves it out, so the amplifier is not "
            "known: leave out --setup, or name the current among its channels.",
        )
        for name in unfitted
    ]


def check_model(experiments: Sequence[Experiment], setup: ModelSetup) -> list[Finding]:
    """What stands in the way of a fit of a user-defined model, as `check_runs` of a drive.

    Whatever the model: samples that are not numbers, angles that begin again, sensors that stand
    still while their input moves, and a run that is there twice.
    """
    wrapped = wrapped_positions(experiments)
    fitted = setup.channels or tuple(name for _, name in wrapped)
    findings = [
        refusal(None, name, f"{clause}.") for (_, name), clause in wrapped.items() if name in fitted
    ]
    for run in experiments:
        findings += _samples(run, setup.channels or tuple(run.channels))
    if _refused(findings):
        return findings
    problem = setup.problem(experiments)
    moving = {
        name
        for run in experiments
        for name, channel in run.channels.items()
        if np.ptp(channel.values) > 0.0
    }
    first_with = dict[bytes, str]()
    for run in problem.experiments:
        names = [name for name in problem.channels if name in run.channels]
        findings += _repeated(run, names, first_with)
        if np.ptp(run.input.values) > 0.0:
            findings += _unchanging(run, [name for name in names if name in moving])
    return findings


def _repeated(
    run: Experiment, names: Sequence[str], first_with: dict[bytes, str]
) -> Iterator[Finding]:
    """A run with the samples of an earlier one; `first_with` gets those of a new one."""
    arrays = [run.input.values, *(run[name].values for name in names)]
    samples = b"".join(array.tobytes() for array in arrays)
    first = first_with.setdefault(samples, run.name)
    if first != run.name:
        yield warning(
            run.name,
            None,
            f"{run.name} has the samples of {first}, to the last bit, and counts twice; leave one "
            'of them out with role = "ignore".',
        )


def _unchanging(run: Experiment, names: Sequence[str]) -> Iterator[Finding]:
    """Channels that stand still in a run, of those that move in another one."""
    for name in names:
        used = run[name].values[run[name].used]
        if used.size and np.ptp(used) == 0.0:
            yield warning(
                run.name,
                name,
                f"{run.name}: '{name}' never changes, although the input does and it moves in "
                "other runs; check the sensor, or ignore the channel in this run.",
            )


def contradicting_runs(
    experiments: Sequence[Experiment], parameters: ParameterSet
) -> list[Finding]:
    """Runs whose sign or scale contradicts the others, judged by a drive that was fitted to all."""
    return [
        finding
        for name, runs in simulated_readings(experiments, parameters).items()
        for finding in contradictions(name, runs)
        if finding.run is not None
    ]


def refuse_unsound(
    findings: Sequence[Finding], error: type[InputError] = UnsoundDataError
) -> tuple[str, ...]:
    """Sentences of what is only a warning; an error if something must be refused.

    It says the first of these, and how many more there are.
    """
    refused = _refused(findings)
    if refused:
        others = len(refused) - 1
        remark = ""
        if others:
            remark = f" ({others} more finding{'s' if others > 1 else ''} of this severity.)"
        raise error(refused[0].sentence + remark)
    return tuple(finding.sentence for finding in findings)


def spike_findings(experiments: Sequence[Experiment], loss: Loss) -> list[Finding]:
    """Spikes, gross ones to be refused unless a robust loss takes their weight."""
    return [
        (refusal if gross and loss == "linear" else warning)(run, name, f"{sentence}.")
        for (run, name), (sentence, gross) in spiked(experiments).items()
    ]


def _refused(findings: Sequence[Finding]) -> list[Finding]:
    return [finding for finding in findings if finding.severity == "refuse"]


# --- samples and commands -------------------------------------------------------------------------


def _samples(experiment: Experiment, fitted: Collection[str]) -> Iterator[Finding]:
    """Runs without two samples, and samples that are not finite."""
    run = experiment.name
    signal = experiment.input
    if signal.values.size < 2:
        samples = count(signal.values.size, "sample")
        yield refusal(
            run,
            None,
            f"{run}: its input has {samples}; at least two are needed, and a run with motion has "
            "hundreds.",
        )
        return
    bad = ~(np.isfinite(signal.values) & np.isfinite(signal.time))
    if bad.any():
        yield refusal(
            run,
            None,
            f"{run}: its input is not finite at sample {int(np.argmax(bad))}; correct the log or "
            "cut the run with a span.",
        )
        return
    for name, channel in experiment.channels.items():
        used = int(np.count_nonzero(channel.used))
        if name not in fitted or (channel.values.size and not used):
            continue
        if word := unsigned_word_sentence(channel):
            yield refusal(run, name, f"{run}: of '{name}', {word}.")
            continue
        bad = channel.used & ~(np.isfinite(channel.values) & np.isfinite(channel.time))
        if bad.any():
            samples = count(int(np.count_nonzero(bad)), "sample")
            yield refusal(
                run,
                name,
                f"{run}: '{name}' is not finite in {samples}, the first at "
                f'{channel.time[np.argmax(bad)]:.6g} s; write missing = "drop", or ignore a '
                "window, the channel or the run.",
            )
        elif used < 2:
            yield refusal(
                run,
                name,
                f"{run}: '{name}' has {count(used, 'sample')} in use, too few to show "
                'a motion; leave the run out with role = "ignore".',
            )


def _idle_commands(experiments: Sequence[Experiment], nominal: ParameterSet) -> list[Finding]:
    """Commands that move nothing."""
    clauses = dict[str, str]()
    for run in experiments:
        clause = _within_dead_zone(run, nominal)
        if clause:
            clauses[run.name] = clause
    if not clauses or len(clauses) < len(experiments):
        return [
            warning(name, None, f"{name}: its command {clause}; it shows the drive only at rest.")
            for name, clause in clauses.items()
        ]
    first, clause = next(iter(clauses.items()))
    others = ", and so it is in all other runs" if len(clauses) > 1 else ""
    sentence = (
        f"{first}: its command {clause}{others}; a drive that does not move cannot be identified: "
        "use larger commands"
    )
    peak = 1e3 * max(float(np.abs(run.input.values).max()) for run in experiments)
    if experiments[0].input.kind == "voltage" and 1.0 <= peak <= FULL_VOLTAGE:
        # a thousandth of a usual command, in volts that were declared as millivolts
        sentence += f', or, if the log is in V, write unit = "V": it then reaches {peak:.3g} V'
    return [refusal(first, None, f"{sentence}.")]


def _within_dead_zone(run: Experiment, nominal: ParameterSet) -> str:
    """Clause on a command that never leaves the dead zone; empty if it does."""
    symbols = {"voltage": ("V_dz", "V_dz_minus", "V_dz_plus"), "current": ("Z17", "Z17", "Z17")}
    if run.input.kind not in symbols:
        return ""
    symbol, minus, plus = symbols[run.input.kind]
    low, high = -nominal.numbers[minus], nominal.numbers[plus]
    least, most = run.input.values.min(), run.input.values.max()
    if least < low or most > high:
        return ""
    unit = run.input.unit
    zone = f"the dead zone {symbol} ({low:.3g} to {high:.3g} {unit})"
    return f"stays between {least:.3g} and {most:.3g} {unit}, within {zone}"


# --- channels against the nominal drive -----------------------------------------------------------


class SimulatedReadings(NamedTuple):
    """What a channel did in a run, measured and simulated, at the samples that count."""

    run: str
    channel: Channel
    time: Array
    """(n,) [s]"""
    measured: Array
    """(n,) of a position its mean speeds. [unit]"""
    simulated: Array
    """(n,) the nominal drive's. [unit]"""

    @property
    def gain(self) -> float:
        """Measured over simulated, in the least-squares sense; negative if turned round."""
        return float(self.measured @ self.simulated / (self.simulated @ self.simulated))

    @property
    def unlike(self) -> float:
        """Share of the measured square sum that the best multiple of the simulated one leaves."""
        total = float(self.measured @ self.measured)
        if not total > 0.0:
            return 1.0
        remainder = self.measured - self.gain * self.simulated
        return float(remainder @ remainder) / total


def simulated_readings(
    experiments: Sequence[Experiment], parameters: ParameterSet
) -> dict[str, list[SimulatedReadings]]:
    """Measured and simulated readings by channel, of the runs in which the drive moves enough."""
    by_channel = dict[str, list[SimulatedReadings]]()
    for experiment in experiments:
        simulation = simulated_run(experiment, parameters)
        for name, channel in experiment.channels.items():
            driven = experiment.input.kind == "current" and "current" in channel.kind
            if channel.kind not in SIGNALS or driven or np.count_nonzero(channel.used) < 2:
                continue
            readings = _readings_of(experiment.name, channel, simulation)
            by_channel.setdefault(name, []).append(readings)
    return {name: _moving(runs) for name, runs in by_channel.items()}


def _readings_of(run: str, channel: Channel, simulation: Simulation) -> SimulatedReadings:
    """Used readings of a channel in a run, and the simulated ones; of a position mean speeds."""
    time = channel.time[channel.used]
    measured = channel.values[channel.used]
    signal = SIGNALS[channel.kind]
    if signal == "current_sum":
        summands: tuple[str, ...] = ("current_positive", "current_negative")
    else:
        summands = (signal,)
    simulated = np.sum(
        [np.interp(time, simulation.time, simulation[name]) for name in summands], axis=0
    )
    if channel.is_position:
        # a position drifts with small errors of speed: speeds are what can be compared
        windows = max(int((time[-1] - time[0]) / SPEED_WINDOW), 4)
        grid = np.linspace(time[0], time[-1], windows + 1)
        measured = np.diff(np.interp(grid, time, measured)) / np.diff(grid)
        simulated = np.diff(np.interp(grid, time, simulated)) / np.diff(grid)
        time = 0.5 * (grid[1:] + grid[:-1])
    return SimulatedReadings(run, channel, time, measured, simulated)


def _moving(runs: Sequence[SimulatedReadings]) -> list[SimulatedReadings]:
    """The runs of a channel in which it should move."""
    sizes = [float(np.sqrt(np.mean(np.square(readings.simulated)))) for readings in runs]
    least = MOVING * max(sizes)
    return [
        readings for readings, size in zip(runs, sizes, strict=True) if size > 0.0 and size >= least
    ]


def _stuck_sensors(name: str, runs: Sequence[SimulatedReadings]) -> Iterator[Finding]:
    """Sensors that show nothing while the drive moves, and positions that freeze for a while."""
    ranges = [float(np.ptp(readings.simulated)) for readings in runs]
    fastest = max((float(np.abs(readings.simulated).max()) for readings in runs), default=0.0)
    for readings, simulated_range in zip(runs, ranges, strict=True):
        channel = readings.channel
        if np.ptp(readings.measured) == 0.0 and simulated_range > DEAD * max(ranges):
            unit = f"{channel.unit}/s" if channel.is_position else channel.unit
            yield refusal(
                readings.run,
                name,
                f"{readings.run}: '{name}' never changes, although the drive should move it by "
                f"about {simulated_range:.3g} {unit}; check the sensor, and ignore the channel in "
                "this run.",
            )
        elif channel.is_position:
            yield from _frozen(name, readings, DEAD * fastest)


def _frozen(name: str, readings: SimulatedReadings, least: float) -> Iterator[Finding]:
    """The first long stretch in which a position stands still though it should move."""
    frozen = (readings.measured == 0.0) & (np.abs(readings.simulated) > least)
    edges = np.flatnonzero(np.diff(frozen, prepend=False, append=False))
    half = 0.5 * float(np.median(np.diff(readings.time)))
    for first, stop in edges.reshape(-1, 2):
        begin, end = readings.time[first] - half, readings.time[stop - 1] + half
        if end - begin > FROZEN:
            yield warning(
                readings.run,
                name,
                f"{readings.run}: '{name}' does not move from {begin:.4g} to {end:.4g} s, although "
                "the drive should move it; check the sensor and the machine's stops, and ignore "
                "that window.",
            )
            return


def contradictions(name: str, runs: Sequence[SimulatedReadings]) -> Iterator[Finding]:
    """Runs whose sign or scale against the drive cannot be right, or a channel's as a whole."""
    against = [turned(readings.simulated, readings.measured) for readings in runs]
    if len(runs) > 1 and all(against):
        yield refusal(
            None,
            name,
            f"In all {len(runs)} runs '{name}' moves opposite to the command: reverse it with sign "
            "= -1 in its channel, or the input's.",
        )
        return
    others = "" if len(runs) == 1 else ", in the other runs with it"
    along = list[SimulatedReadings]()
    for readings, is_against in zip(runs, against, strict=True):
        if not is_against:
            along.append(readings)
            continue
        yield refusal(
            readings.run,
            name,
            f"In {readings.run} '{name}' moves opposite to the command{others}: reverse it with "
            'sign = -1 for this run, or leave the run out with role = "ignore".',
        )
    yield from _far_off_gains(name, along)


def _far_off_gains(name: str, runs: Sequence[SimulatedReadings]) -> Iterator[Finding]:
    """Channels that move much more or less than the drive, in all runs or in one."""
    if not runs:
        return
    gains = np.array([abs(readings.gain) for readings in runs])
    median = float(np.median(gains))
    remedy = "check its unit, scale, counts_per_turn (quadrature included) and the drive."
    if not 1.0 / FAR_OFF < median < FAR_OFF:
        yield warning(
            None,
            name,
            f"'{name}' moves {median:.3g} times as far as in the nominal drive: {remedy}",
        )
        return
    for readings, gain in zip(runs, gains, strict=True):
        if not 1.0 / FAR_OFF < gain / median < FAR_OFF:
            yield warning(
                readings.run,
                name,
                f"In {readings.run} '{name}' moves {gain:.3g} times as far as in the nominal "
                f"drive, in the other runs {median:.3g} times: {remedy}",
            )


# --- ends of instruments --------------------------------------------------------------------------


def clipped_channels(experiments: Sequence[Experiment]) -> Iterator[Finding]:
    """Channels that stand at an end of their instrument, with the limits to state.

    A channel is clipped if it reads its very largest or smallest value for 0.1 s and longer
    while the input moves by more than a tenth of its range: no noisy signal does that. Nor does one
    stand there so long at inputs that far apart, a machine at its stop included; but one without
    noise does, and one that reads it at a run's first sample is at rest. Positions are passed over,
    as they stand still by themselves.
    """
    for name in dict.fromkeys(name for run in experiments for name in run.channels):
        runs = [run for run in experiments if name in run.channels]
        if runs[0][name].is_position:
            continue
        values = np.concatenate([run[name].values for run in runs])
        low, high = float(values.min()), float(values.max())
        reach = float(np.ptp(np.concatenate([run.input.values for run in runs])))
        stated = (run[name].limits for run in runs)
        limits = [pair for pair in stated if pair is not None]
        for end in (low, high):
            # limits may be stated a little within the end at which the readings stand
            if any(not lower < end < upper for lower, upper in limits):
                continue
            spans = np.array([span for run in runs for span in _inputs_at(end, run, name)])
            if not spans.size or low == high:
                continue
            rests = any(run[name].values[0] == end for run in runs)
            largest_range, total_range = float(np.ptp(spans, axis=1).max()), float(np.ptp(spans))
            # a rounded reading stands still by itself for as long as a step of it lasts
            coarse = float(np.diff(np.unique(np.round(values / (high - low), 9))).min())
            step = max(coarse, 3e-4) * (high - low)
            if total_range > largest_range and not rests and _is_noisy(values, step):
                largest_range = total_range
            if largest_range > (0.1 + 2.0 * coarse) * reach:
                yield refusal(
                    None,
                    name,
                    f"'{name}' reads exactly {end:.6g} {runs[0][name].unit} at inputs that differ "
                    f"by {largest_range:.3g} {runs[0].input.unit}: it is clipped there. Set limits "
                    f"= [{low:.6g}, {high:.6g}] in its channel, and such samples are ignored.",
                )


def _inputs_at(end: float, experiment: Experiment, name: str) -> list[tuple[float, float]]:
    """Smallest and largest input of each stretch in which a channel stands at an end.

    In its first three quarters: a rounded reading that lags stays where it is when the input has
    left already.
    """
    channel, spans = experiment[name], list[tuple[float, float]]()
    edges = np.flatnonzero(np.diff(channel.values == end, prepend=False, append=False))
    for first, stop in edges.reshape(-1, 2):
        if channel.time[stop - 1] - channel.time[first] >= DWELLS:
            inputs = experiment.input.at(channel.time[first : stop - (stop - first) // 4])
            spans.append((float(inputs.min()), float(inputs.max())))
    return spans


def _is_noisy(values: Array, step: float) -> bool:
    """Whether samples (n,) go to and fro by two of their steps or more, both ends left out.

    No motion does that from sample to sample, nor rounding. Of the pairs of changes that noise of
    one step makes, a tenth are such.
    """
    inner = (values > values.min()) & (values < values.max())
    first, second = np.diff(values)[:-1], np.diff(values)[1:]
    within = inner[:-2] & inner[1:-1] & inner[2:]
    least = np.minimum(np.abs(first), np.abs(second))
    turns = within & (first * second < 0.0) & (least > 1.5 * step)
    return bool(turns.sum() > TO_AND_FRO * max(int(within.sum()), 1))


# --- what the runs determine ----------------------------------------------------------------------


def check_rank(where: str, problem: Problem) -> list[Finding]:
    """Refusals of fewer samples than unknowns, and of unknowns on which nothing depends."""
    unknowns = problem.unknowns
    if problem.samples < len(unknowns):
        sentence = (
            f"{where}: {count(problem.samples, 'sample')} cannot determine {len(unknowns)} "
            "parameters; record longer runs, or free less."
        )
        return [refusal(None, None, sentence)]
    exact = isinstance(problem.model, EquationModel)  # any other may take minutes
    if exact and not problem.evaluate(problem.start).jacobian.any():
        names = ", ".join(unknowns.names[:NAMED])
        sentence = (
            f"{where}: no run depends on any of {names}; free what the runs exercise, or add a "
            "test that exercises these."
        )
        return [refusal(None, None, sentence)]
    return []


def beside_the_drives(campaign: Campaign) -> list[str]:
    """Sentences on runs that stand out against a simulation of their axis's drive."""
    sentences = list[str]()
    for name, axis in campaign.axes.items():
        if axis.drive is None:
            continue
        nominal = smooth(campaign.drive(name).parameters)
        runs = list[Experiment]()
        for run in campaign.select(axis=name):
            beyond = beyond_the_card(run)
            for sentence in beyond:
                sentences.append(f"{sentence}; this run is not compared with the drive")
            # words without a sign are findings of their channel
            if not beyond and not any(map(unsigned_word_sentence, run.channels.values())):
                runs.append(run)
        # a drive of assumed numbers says nothing of what a machine does
        assumed = all(parameter.status == "assumed" for parameter in nominal.values())
        if runs and not assumed and all(run.input.kind != "other" for run in runs):
            sentences += [finding.sentence.rstrip(".") for finding in check_runs(runs, nominal)]
    return sentences
