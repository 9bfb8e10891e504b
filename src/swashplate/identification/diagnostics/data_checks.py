"""Data checks: whether a campaign can be fitted at all, before the solver starts."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.campaign import Campaign
from swashplate.campaign.experiment import Channel, Experiment
from swashplate.campaign.quality import (
    beyond_the_card,
    spiked,
    turned,
    unsigned_currents,
    wrapped_positions,
)
from swashplate.errors import InputError, UnsoundDataError
from swashplate.identification.estimation.drive_model import (
    CURRENTS,
    SIGNALS,
    kinds_of,
    simulated_run,
)
from swashplate.identification.estimation.model import EquationModel
from swashplate.identification.estimation.model_setup import ModelSetup
from swashplate.identification.estimation.problem import Loss, Problem
from swashplate.identification.estimation.setup import FitSetup
from swashplate.identification.estimation.stages import smooth
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.tables import count

Array = NDArray[np.float64]

WINDOW = 0.2
"""Time over which the speed behind a position is taken. [s]"""
MOVING = 0.1
"""Of the largest motion in any run, from which a run's own can be judged."""
FAR_OFF = 3.0
"""By which a channel should not differ from the nominal drive."""
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
    """"refuse" where no result could mean anything; "warn" where some of it could."""
    run: str | None
    """The experiment's name; None for the campaign or its fit setup."""
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
    unsigned = {**unsigned_currents(experiments), **wrapped_positions(experiments)}
    found = [refusal(None, name, f"{said}.") for (_, name), said in unsigned.items()]
    for run in experiments:
        found += _samples(run, [n for n, c in run.channels.items() if c.kind in SIGNALS])
    if not _refused(found):
        found += _idle_commands(experiments, nominal)
    if not _refused(found):
        for name, ours in motions(experiments, nominal).items():
            idle = {finding.run for finding in found if finding.channel is None}
            still = [*_still(name, [readings for readings in ours if readings.run not in idle])]
            seen = idle | {finding.run for finding in still}
            found += still
            found += contradictions(
                name, [readings for readings in ours if readings.run not in seen]
            )
    return sorted(found, key=lambda finding: finding.severity != "refuse")


def unfitted_currents(experiments: Sequence[Experiment], setup: FitSetup) -> list[Finding]:
    """Currents of an amplifier that are measured, and fitted by no stage."""
    fitted = {kind for stage in setup.stages for kind in stage.channels or kinds_of(stage.part)}
    driving = any(stage.current == "measured" for stage in setup.stages)
    left = {
        name: None
        for run in experiments
        for name, channel in run.channels.items()
        if run.input.kind == "voltage" and channel.kind in CURRENTS and channel.kind not in fitted
    }
    return [
        warning(
            None,
            name,
            f"'{name}' is measured, but no stage fits it, so that the amplifier is not known: let "
            "'swashplate guess' write a start and a fit setup whose first stage fits the "
            "amplifier to it, and give them by --from and --setup.",
        )
        for name in ([] if driving else left)
    ]


def check_model(experiments: Sequence[Experiment], setup: ModelSetup) -> list[Finding]:
    """What stands in the way of a fit of a model of one's own, as `check_runs` of a drive.

    Whatever the model: samples that are no numbers, angles that begin anew, sensors that stand
    still while their input moves, and a run that is there twice.
    """
    wrapped, seen = wrapped_positions(experiments), dict[bytes, str]()
    fitted = setup.channels or tuple(name for _, name in wrapped)
    found = [refusal(None, n, f"{said}.") for (_, n), said in wrapped.items() if n in fitted]
    for run in experiments:
        found += _samples(run, setup.channels or tuple(run.channels))
    if _refused(found):
        return found
    problem = setup.problem(experiments)
    moving = {n for e in experiments for n, c in e.channels.items() if np.ptp(c.values) > 0.0}
    for experiment in problem.experiments:
        names = [name for name in problem.channels if name in experiment.channels]
        arrays = [experiment.input.values, *(experiment[name].values for name in names)]
        first = seen.setdefault(b"".join(array.tobytes() for array in arrays), experiment.name)
        if first != experiment.name:
            said = (
                f"{experiment.name} has the samples of {first}, to the last bit, and counts twice; "
            )
            said += 'leave one of them out with role = "ignore".'
            found.append(warning(experiment.name, None, said))
        for name in names if np.ptp(experiment.input.values) > 0.0 else ():
            used = experiment[name].values[experiment[name].used]
            if name in moving and used.size and np.ptp(used) == 0.0:
                said = f"{experiment.name}: '{name}' never changes, though the input does and it moves in"
                said += " other runs; look at the sensor, or ignore the channel in this run."
                found.append(warning(experiment.name, name, said))
    return found


def contradicting_runs(
    experiments: Sequence[Experiment], parameters: ParameterSet
) -> list[Finding]:
    """Runs whose sign or scale contradicts the others, beside a drive that was fitted to all."""
    of_channels = motions(experiments, parameters).items()
    found = (finding for name, ours in of_channels for finding in contradictions(name, ours))
    return [finding for finding in found if finding.run is not None]


def refuse_unsound(
    findings: Sequence[Finding], error: type[InputError] = UnsoundDataError
) -> tuple[str, ...]:
    """Sentences of what is only a warning; an error if something must be refused.

    It says the first of these, and how many more there are.
    """
    if refused := _refused(findings):
        more = len(refused) - 1
        also = f" ({more} more finding{'s' if more > 1 else ''} of this weight.)" if more else ""
        raise error(refused[0].sentence + also)
    return tuple(finding.sentence for finding in findings)


def spike_findings(experiments: Sequence[Experiment], loss: Loss) -> list[Finding]:
    """Spikes, gross ones to be refused unless a robust loss takes their weight."""
    return [
        (refusal if gross and loss == "linear" else warning)(run, name, f"{sentence}.")
        for (run, name), (sentence, gross) in spiked(experiments).items()
    ]


def _refused(found: Sequence[Finding]) -> list[Finding]:
    return [finding for finding in found if finding.severity == "refuse"]


# --- samples and commands -------------------------------------------------------------------------


def _samples(experiment: Experiment, fitted: Collection[str]) -> Iterator[Finding]:
    """Runs without two samples, and numbers that are none."""
    run, signal = experiment.name, experiment.input
    bad = ~(np.isfinite(signal.values) & np.isfinite(signal.time))
    if signal.values.size < 2:
        had = count(signal.values.size, "sample")
        said = f"{run}: its input has {had}; at least two are needed, and a run with motion has "
        yield refusal(run, None, f"{said}hundreds.")
        return
    if bad.any():
        said = f"{run}: its input is not finite at sample {int(np.argmax(bad))}; mend the log or "
        yield refusal(run, None, f"{said}cut the run with a span.")
        return
    for name, channel in experiment.channels.items():
        used, samples = channel.used, int(np.count_nonzero(channel.used))
        if name not in fitted or (channel.values.size and not samples):
            continue
        bad = used & ~(np.isfinite(channel.values) & np.isfinite(channel.time))
        if bad.any():
            had = count(int(np.count_nonzero(bad)), "sample")
            said = f"{run}: '{name}' is not finite in {had}, the first at "
            said += f'{channel.time[np.argmax(bad)]:.6g} s; say missing = "drop", or ignore a '
            yield refusal(run, name, f"{said}window, the channel or the run.")
        elif samples < 2:
            said = f"{run}: '{name}' has {count(samples, 'sample')} that can count, which shows no "
            yield refusal(run, name, f'{said}motion; leave the run out with role = "ignore".')


def _idle_commands(experiments: Sequence[Experiment], nominal: ParameterSet) -> list[Finding]:
    """Commands that move nothing."""
    idle, numbers = {}, nominal.numbers
    symbols = {"voltage": ("V_dz", "V_dz_minus", "V_dz_plus"), "current": ("Z17", "Z17", "Z17")}
    for experiment in experiments:
        if experiment.input.kind not in symbols:
            continue
        symbol, minus, plus = symbols[experiment.input.kind]
        low, high = -numbers[minus], numbers[plus]
        least, most, unit = (
            experiment.input.values.min(),
            experiment.input.values.max(),
            experiment.input.unit,
        )
        if low <= least and most <= high:
            zone = f"the dead zone {symbol} ({low:.3g} to {high:.3g} {unit})"
            idle[experiment.name] = (
                f"stays between {least:.3g} and {most:.3g} {unit}, within {zone}"
            )
    if not idle or len(idle) < len(experiments):
        also = "; it shows the drive at rest only."
        return [warning(run, None, f"{run}: its command {why}{also}") for run, why in idle.items()]
    first, why = next(iter(idle.items()))
    others = ", and so it is in all other runs" if len(idle) > 1 else ""
    said = f"{first}: its command {why}{others}; a drive that does not move cannot be identified: "
    said += "use larger commands"
    peak = 1e3 * max(float(np.abs(run.input.values).max()) for run in experiments)
    if experiments[0].input.kind == "voltage" and 1.0 <= peak <= FULL_VOLTAGE:
        # a thousandth of a usual command, in volts that were declared as millivolts
        said += f', or, if the log is in V, write unit = "V": it then reaches {peak:.3g} V'
    return [refusal(first, None, f"{said}.")]


# --- what channels do beside the nominal drive ----------------------------------------------------


class SimulatedReadings(NamedTuple):
    """What a channel did in a run, measured and simulated, where it counts."""

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
        """Measured over simulated, in the least-squares sense; negative where turned round."""
        return float(self.measured @ self.simulated / (self.simulated @ self.simulated))

    @property
    def unlike(self) -> float:
        """Share of the measured square sum that the best multiple of the simulated one leaves."""
        total = float(self.measured @ self.measured)
        left = self.measured - self.gain * self.simulated
        return float(left @ left) / total if total > 0.0 else 1.0


def motions(
    experiments: Sequence[Experiment], parameters: ParameterSet
) -> dict[str, list[SimulatedReadings]]:
    """What each channel did in each run, by the channel's name; runs that hardly move left out."""
    found: dict[str, list[SimulatedReadings]] = {}
    for experiment in experiments:
        simulation = simulated_run(experiment, parameters)
        for name, channel in experiment.channels.items():
            used, signal = channel.used, SIGNALS.get(channel.kind)
            driven = experiment.input.kind == "current" and "current" in channel.kind
            if signal is None or driven or np.count_nonzero(used) < 2:
                continue
            time, measured = channel.time[used], channel.values[used]
            both = ("current_positive", "current_negative")
            parts = both if signal == "current_sum" else (signal,)
            simulated = np.sum(
                [np.interp(time, simulation.time, simulation[part]) for part in parts], axis=0
            )
            if channel.is_position:
                # mean speeds in short windows: where a position drifts to says little
                windows = max(int((time[-1] - time[0]) / WINDOW), 4)
                grid = np.linspace(time[0], time[-1], windows + 1)
                measured, simulated = (
                    np.diff(np.interp(grid, time, values)) / np.diff(grid)
                    for values in (measured, simulated)
                )
                time = 0.5 * (grid[1:] + grid[:-1])
            ours = SimulatedReadings(experiment.name, channel, time, measured, simulated)
            found.setdefault(name, []).append(ours)
    for name, readings in found.items():
        sizes = [float(np.sqrt(np.mean(np.square(one.simulated)))) for one in readings]
        least = MOVING * max(sizes)
        kept = zip(readings, sizes, strict=True)
        found[name] = [one for one, size in kept if size > 0.0 and size >= least]
    return found


def _still(name: str, ours: Sequence[SimulatedReadings]) -> Iterator[Finding]:
    """Sensors that show nothing while the drive moves, and positions that freeze for a while."""
    ranges = [float(np.ptp(each.simulated)) for each in ours]
    fastest = max((float(np.abs(each.simulated).max()) for each in ours), default=0.0)
    for readings, moves in zip(ours, ranges, strict=True):
        where, position = f"{readings.run}: '{name}'", readings.channel.is_position
        if np.ptp(readings.measured) == 0.0 and moves > DEAD * max(ranges):
            unit = f"{readings.channel.unit}/s" if position else readings.channel.unit
            said = f"never changes, though the drive should move it by about {moves:.3g} {unit}"
            also = "look at the sensor, and ignore the channel in this run."
            yield refusal(readings.run, name, f"{where} {said}; {also}")
            continue
        frozen = (
            (readings.measured == 0.0) & (np.abs(readings.simulated) > DEAD * fastest) & position
        )
        edges = np.flatnonzero(np.diff(frozen, prepend=False, append=False))
        half = 0.5 * float(np.median(np.diff(readings.time)))
        for first, stop in edges.reshape(-1, 2):
            begin, end = readings.time[first] - half, readings.time[stop - 1] + half
            if end - begin > FROZEN:
                said = f"stands still from {begin:.4g} to {end:.4g} s, though the drive should move"
                also = "it; look at the sensor and at the machine's stops, and ignore that window."
                yield warning(readings.run, name, f"{where} {said} {also}")
                break


def contradictions(name: str, ours: Sequence[SimulatedReadings]) -> Iterator[Finding]:
    """Runs whose sign or scale beside the drive cannot be right, or a channel's as a whole."""
    against = [turned(each.simulated, each.measured) for each in ours]
    if len(ours) > 1 and all(against):
        said = f"In all {len(ours)} runs '{name}' goes against the command: reverse it with "
        yield refusal(None, name, f"{said}sign = -1 in its channel, or the input's.")
        return
    others = "" if len(ours) == 1 else ", in the other runs with it"
    for readings in (each for each, wrong in zip(ours, against, strict=True) if wrong):
        said = f"In {readings.run} '{name}' goes against the command{others}: reverse it with "
        said += 'sign = -1 for this run, or leave the run out with role = "ignore".'
        yield refusal(readings.run, name, said)
    left = [each for each, wrong in zip(ours, against, strict=True) if not wrong]
    gains = np.array([abs(each.gain) for each in left])
    middle = float(np.median(gains)) if left else 1.0
    hint = "check its unit, scale, counts_per_turn (quadrature included) and the drive."
    if not 1.0 / FAR_OFF < middle < FAR_OFF:
        said = f"'{name}' moves {middle:.3g} times as far as in the nominal drive: {hint}"
        yield warning(None, name, said)
        return
    for each, gain in zip(left, gains, strict=True):
        if not 1.0 / FAR_OFF < gain / middle < FAR_OFF:
            said = f"In {each.run} '{name}' moves {gain:.3g} times as far as in the nominal drive, "
            said += f"in the other runs {middle:.3g} times: {hint}"
            yield warning(each.run, name, said)


# --- ends of instruments --------------------------------------------------------------------------


def clipped_channels(experiments: Sequence[Experiment]) -> Iterator[Finding]:
    """Channels that stand at an end of their instrument, with the limits to state.

    A channel is clipped where it reads its very largest or smallest value for 0.1 s and longer
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
            moved, apart = float(np.ptp(spans, axis=1).max()), float(np.ptp(spans))
            # a rounded reading stands still by itself for as long as a step of it lasts
            coarse = float(np.diff(np.unique(np.round(values / (high - low), 9))).min())
            step = max(coarse, 3e-4) * (high - low)
            if apart > moved and not rests and _is_noisy(values, step):
                moved = apart
            if moved > (0.1 + 2.0 * coarse) * reach:
                yield refusal(
                    None,
                    name,
                    f"'{name}' stands at exactly {end:.6g} {runs[0][name].unit} at inputs that "
                    f"differ by {moved:.3g} {runs[0].input.unit}: it is clipped there. "
                    f"Set limits = [{low:.6g}, {high:.6g}] in its channel, and such samples are "
                    "ignored.",
                )


def _inputs_at(end: float, experiment: Experiment, name: str) -> list[tuple[float, float]]:
    """Smallest and largest input of each stretch in which a channel stands at an end.

    In its first three quarters: a rounded reading that lags stays where it is when the input has
    left already.
    """
    channel, spans = experiment[name], list[tuple[float, float]]()
    edges = np.flatnonzero(np.diff(channel.values == end, prepend=False, append=False))
    for first, after in edges.reshape(-1, 2):
        if channel.time[after - 1] - channel.time[first] >= DWELLS:
            inputs = experiment.input.at(channel.time[first : after - (after - first) // 4])
            spans.append((float(inputs.min()), float(inputs.max())))
    return spans


def _is_noisy(values: Array, step: float) -> bool:
    """Whether samples (n,) go to and fro by two of their steps or more, both ends left out.

    No motion does that from sample to sample, nor rounding. Of the pairs of changes that noise of
    one step makes, a tenth are such.
    """
    inner = (values > values.min()) & (values < values.max())
    first, after = np.diff(values)[:-1], np.diff(values)[1:]
    within = inner[:-2] & inner[1:-1] & inner[2:]
    least = np.minimum(np.abs(first), np.abs(after))
    turns = within & (first * after < 0.0) & (least > 1.5 * step)
    return bool(turns.sum() > TO_AND_FRO * max(within.sum(), 1))


# --- what the runs determine ----------------------------------------------------------------------


def check_rank(where: str, problem: Problem) -> list[Finding]:
    """Fewer samples than unknowns, or unknowns on which nothing depends."""
    unknowns = problem.unknowns
    if problem.samples < len(unknowns):
        said = f"{count(problem.samples, 'sample')} cannot determine {len(unknowns)} parameters; "
        return [refusal(None, None, f"{where}: {said}record longer runs, or free less.")]
    exact = isinstance(problem.model, EquationModel)  # any other may take minutes
    if exact and not problem.evaluate(problem.start).jacobian.any():
        said = f"no run depends on any of {', '.join(unknowns.names[:NAMED])}; free what the runs "
        return [refusal(None, None, f"{where}: {said}exercise, or test what exercises these.")]
    return []


def beside_the_drives(campaign: Campaign) -> list[str]:
    """What stands out when each axis's drive is simulated under the runs' commands."""
    found = []
    for name, axis in campaign.axes.items():
        if axis.drive is None:
            continue
        nominal, runs = smooth(campaign.drive(name).parameters), []
        for run in campaign.select(axis=name):
            beyond = beyond_the_card(run)
            found += [f"{said}; this run is not compared with the drive" for said in beyond]
            runs += [] if beyond else [run]
        # a drive that is made up says nothing of what a machine does
        made_up = all(parameter.status == "assumed" for parameter in nominal.values())
        if runs and not made_up and all(experiment.input.kind != "other" for experiment in runs):
            found += [finding.sentence.rstrip(".") for finding in check_runs(runs, nominal)]
    return found
