"""Data checks: whether a campaign can be fitted at all, before the solver starts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.campaign import Campaign
from swashplate.campaign.experiment import Channel, Experiment
from swashplate.campaign.quality import beyond_the_card, unsigned_currents
from swashplate.drive import Drive
from swashplate.errors import InputError
from swashplate.identification.drive_model import SIGNALS
from swashplate.identification.excitation import simulated_run
from swashplate.identification.identifiability import identifiability
from swashplate.identification.motion import Motion, motions, rms
from swashplate.identification.setup import Setup
from swashplate.identification.staging import stage_problem
from swashplate.identification.unknowns import Unknowns
from swashplate.parameters.parameter_set import ParameterSet

Array = NDArray[np.float64]

Severity = Literal["refuse", "warn"]

POINTS = 1024
"""Instants at which two runs are compared."""
SAME_COMMAND = 0.05
"""Difference of two commands, over their size, below which they are the same."""
ALIKE = 0.5
"""Correlation below which two signals have nothing in common, or above minus which none is the
other turned round."""
FACTOR = 1.5
"""By which two runs of one command cannot differ."""
DOUBTFUL = 1.15
"""By which they should not."""
FAR_OFF = 3.0
"""By which a channel should not differ from the nominal drive."""


class Finding(NamedTuple):
    """Something that stands in the way of a fit."""

    severity: Severity
    """"refuse" where no result could mean anything; "warn" where some of it could."""
    run: str | None
    """The experiment's name; None for the campaign or its set-up."""
    channel: str | None
    sentence: str
    """What is wrong, where, and what would be right."""


def contradictions(of_channels: Mapping[str, Sequence[Motion]]) -> tuple[Finding, ...]:
    """Runs whose sign or scale cannot be right, each once.

    Runs of the same command are held against each other, which needs no model; the nominal drive
    tells which of the two is the odd one, and whether a channel as a whole is turned round or far
    off in scale.
    """
    found: list[Finding] = []
    for name, ours in of_channels.items():
        if not ours:
            continue
        turned = [each for each in ours if each.correlation < -ALIKE]
        found += _turned(name, turned, len(ours))
        right = [each for each in ours if each not in turned]
        found += _twins(name, right)
        odd = {each.run for each in found if each.channel == name}
        found += _scales(name, [each for each in right if each.experiment.name not in odd])
    return tuple(found)


def _turned(name: str, turned: Sequence[Motion], runs: int) -> list[Finding]:
    if runs > 1 and len(turned) == runs:
        return [
            Finding(
                "refuse",
                None,
                name,
                f"In all {runs} runs '{name}' goes against the command: turn it round with "
                "sign = -1 in its channel, or the input's.",
            )
        ]
    others = "" if runs == 1 else ", in the other runs with it"
    return [
        Finding(
            "refuse",
            each.experiment.name,
            name,
            f"In {each.experiment.name} '{name}' goes against the command{others}: turn it round "
            f'with sign = -1 for this run, or leave the run out with role = "ignore".',
        )
        for each in turned
    ]


def _twins(name: str, ours: Sequence[Motion]) -> list[Finding]:
    """Runs beside the one of the same command that is nearest to what all have in common."""
    middle = float(np.median([each.gain for each in ours])) if ours else 1.0
    nearest = sorted(ours, key=lambda each: abs(np.log(abs(each.gain / middle) + 1e-12)))
    found: list[Finding] = []
    for good, *others in _of_one_command(nearest):
        for odd in others:
            factor, correlation = _compared(good, odd)
            both = f"{good.experiment.name} and {odd.experiment.name} have the same command, but"
            if correlation < ALIKE:
                severity: Severity = "refuse"
                said = (
                    f"{both} '{name}' has nothing in common: one of them belongs to another test; "
                    "leave it out."
                )
            elif not 1.0 / FACTOR < factor < FACTOR:
                severity = "refuse"
                said = (
                    f"{both} '{name}' moves {factor:.3g} times as far in the second: both cannot "
                    f"be right; mend scale or unit of '{name}' in one of them, or leave it out."
                )
            elif not 1.0 / DOUBTFUL < factor < DOUBTFUL:
                severity = "warn"
                said = (
                    f"{both} '{name}' moves {factor:.3g} times as far in the second: was the load "
                    "or the oil another?"
                )
            else:
                continue
            found.append(Finding(severity, odd.experiment.name, name, said))
    return found


def _of_one_command(ours: Sequence[Motion]) -> list[list[Motion]]:
    """Runs in groups of the same command, in their order: each is held against each group once."""
    inputs = [each.experiment.input for each in ours]
    longest = max((each.time[-1] - each.time[0] for each in inputs), default=0.0)
    since = np.linspace(0.0, longest, POINTS)
    groups: list[list[Motion]] = []
    heads = np.empty((len(ours), POINTS))
    for each, drive in zip(ours, inputs, strict=True):
        within = since <= drive.time[-1] - drive.time[0]
        command = np.where(within, drive.at(drive.time[0] + since), np.nan)
        known = heads[: len(groups)]
        both = np.isfinite(known) & within
        count = np.maximum(both.sum(axis=1), 1)
        off, left, right = (
            np.sqrt(np.sum(np.where(both, part, 0.0) ** 2, axis=1) / count)
            for part in (known - command, known, np.broadcast_to(command, known.shape))
        )
        same = np.flatnonzero(off <= SAME_COMMAND * np.maximum(left, right))
        kinds = [k for k in same if groups[k][0].experiment.input.kind == drive.kind]
        if kinds:
            groups[kinds[0]].append(each)
        else:
            heads[len(groups)] = command
            groups.append([each])
    return groups


def _compared(first: Motion, second: Motion) -> tuple[float, float]:
    """How many times as far the second one moves, and the correlation of both about zero."""
    zeros = first.experiment.input.time[0], second.experiment.input.time[0]
    begin = max(first.time[0] - zeros[0], second.time[0] - zeros[1])
    end = min(first.time[-1] - zeros[0], second.time[-1] - zeros[1])
    since = np.linspace(begin, max(end, begin), POINTS)
    a = np.interp(since, first.time - zeros[0], first.measured)
    b = np.interp(since, second.time - zeros[1], second.measured)
    sizes = rms(a), rms(b)
    if not min(sizes) > 0.0:
        return (0.0 if sizes[1] == 0.0 else np.inf), 1.0
    return sizes[1] / sizes[0], float(np.mean(a * b)) / (sizes[0] * sizes[1])


def _scales(name: str, ours: Sequence[Motion]) -> list[Finding]:
    if not ours:
        return []
    gains = np.array([abs(each.gain) for each in ours])
    middle = float(np.median(gains))
    hint = "check its unit, scale, counts_per_turn (quadrature included) and the drive"
    if not 1.0 / FAR_OFF < middle < FAR_OFF:
        return [
            Finding(
                "warn",
                None,
                name,
                f"'{name}' moves {middle:.3g} times as far as in the nominal drive: {hint}.",
            )
        ]
    return [
        Finding(
            "warn",
            each.experiment.name,
            name,
            f"In {each.experiment.name} '{name}' moves {gain:.3g} times as far as in the nominal "
            f"drive, in the other runs {middle:.3g} times: {hint}.",
        )
        for each, gain in zip(ours, gains, strict=True)
        if not 1.0 / FAR_OFF < gain / middle < FAR_OFF
    ]


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


NAMED = 8
"""Unknowns that a sentence names."""


def check_sound(
    experiments: Sequence[Experiment],
    nominal: ParameterSet,
    setup: Setup,
    *,
    rank: bool = True,
) -> tuple[Finding, ...]:
    """What stands in the way of a fit, before it is tried.

    Parameters
    ----------
    experiments : sequence of Experiment
        The runs to fit.
    nominal : ParameterSet
        Where the fit begins.
    setup : Setup
        What is free.
    rank : bool
        Also look at what the runs can determine, which needs derivatives; `excitation.outlook`
        tells it in full.

    Returns
    -------
    tuple of Finding
        What must be refused first. Later checks need what earlier ones found sound, so that not
        everything that is wrong is always listed at once.

    Raises
    ------
    InputError, ParameterError
        If runs and set-up do not fit each other.
    DomainError
        If the model does not hold at the nominal values.
    """
    found = check_runs(experiments, nominal)
    if not _refused(found):
        card = all(stage.part == "card" for stage in setup.stages)
        found += short_runs(experiments, nominal, of_current=card)
    if rank and not _refused(found):
        found += _rank(experiments, nominal, setup)
    return tuple(sorted(found, key=lambda each: each.severity != "refuse"))


def check_runs(experiments: Sequence[Experiment], nominal: ParameterSet) -> list[Finding]:
    """What is wrong with runs beside each other and beside the nominal drive.

    Raises
    ------
    InputError
        If an input is neither a voltage nor a current, or cannot be simulated.
    DomainError
        If the model does not hold at the nominal values.
    """
    found = [
        Finding("refuse", None, name, f"{said}.")
        for (_, name), said in unsigned_currents(experiments).items()
    ]
    found += [finding for each in experiments for finding in _samples(each)]
    if not _refused(found):
        found += idle_commands(experiments, nominal)
    if _refused(found):
        return found
    simulations = {each.name: simulated_run(each, nominal) for each in experiments}
    of_channels = motions(experiments, simulations)
    found += constant_commands(experiments, of_channels)
    of_channels = _without(of_channels, found)
    found += still_sensors(of_channels)
    found += frozen_positions(_without(of_channels, found))
    found += contradictions(_without(of_channels, found))
    return found


def contradicting_runs(
    experiments: Sequence[Experiment], parameters: ParameterSet
) -> list[Finding]:
    """Runs whose sign or scale contradicts the others, beside a drive that was fitted to all.

    Raises
    ------
    InputError, DomainError
        As `check_runs`.
    """
    simulations = {each.name: simulated_run(each, parameters) for each in experiments}
    found = contradictions(motions(experiments, simulations))
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


def _without(
    of_channels: Mapping[str, Sequence[Motion]], found: Sequence[Finding]
) -> dict[str, list[Motion]]:
    """Motions of runs and channels of which nothing has been found yet."""
    said = {(each.run, each.channel) for each in found}
    return {
        name: [
            each
            for each in ours
            if (each.experiment.name, name) not in said and (each.experiment.name, None) not in said
        ]
        for name, ours in of_channels.items()
    }


def _refused(found: Sequence[Finding]) -> bool:
    return any(each.severity == "refuse" for each in found)


def _samples(experiment: Experiment) -> list[Finding]:
    """Runs without two samples, and numbers that are none."""
    name, signal = experiment.name, experiment.input
    if signal.values.size < 2:
        said = (
            f"{name}: its input has {_count(signal.values.size)}; two are the least, and a run "
            "that tells of motion has hundreds."
        )
        return [Finding("refuse", name, None, said)]
    bad = ~(np.isfinite(signal.values) & np.isfinite(signal.time))
    if bad.any():
        said = (
            f"{name}: its input is not finite at sample {int(np.argmax(bad))}; mend the log or cut "
            "the run with a span."
        )
        return [Finding("refuse", name, None, said)]
    return [finding for each in experiment.channels.values() for finding in _of_channel(name, each)]


def _of_channel(run: str, channel: Channel) -> list[Finding]:
    used, name = channel.used, channel.name
    if channel.kind not in SIGNALS or (channel.values.size and not used.any()):
        return []
    bad = used & ~(np.isfinite(channel.values) & np.isfinite(channel.time))
    samples = int(np.count_nonzero(used))
    if bad.any() and bad[used].all():
        said = (
            f"{run}: '{name}' has no finite value at all; ignore the channel in this run, or leave "
            'the run out with role = "ignore".'
        )
    elif bad.any():
        said = (
            f"{run}: '{name}' is not finite in {_count(int(np.count_nonzero(bad)))}, the first at "
            f'{channel.time[np.argmax(bad)]:.6g} s; say missing = "drop", or ignore a window.'
        )
    elif samples < 2:
        said = (
            f"{run}: '{name}' has {_count(samples)} that can count, which tells nothing of motion; "
            'leave the run out with role = "ignore".'
        )
    else:
        return []
    return [Finding("refuse", run, name, said)]


def _rank(experiments: Sequence[Experiment], nominal: ParameterSet, setup: Setup) -> list[Finding]:
    """Stages with fewer samples than unknowns, or unknowns that the runs cannot determine."""
    found: list[Finding] = []
    for stage in setup.stages:
        problem = stage_problem(stage, nominal, experiments)
        where = f"Stage {stage.name}"
        if problem.samples < len(problem.unknowns):
            said = (
                f"{where}: {_count(problem.samples)} cannot determine {len(problem.unknowns)} "
                "unknowns; record longer runs, or free less."
            )
            found.append(Finding("refuse", None, None, said))
            continue
        taken = {target for each in problem.unknowns for target in each.targets}
        verdict = identifiability(
            problem.evaluate(problem.start).jacobian,
            _variables(problem.unknowns),
            fixed={name: value for name, value in nominal.numbers.items() if name not in taken},
        )
        if verdict.rank == 0:
            said = (
                f"{where}: no run depends on any of {', '.join(problem.unknowns.names[:NAMED])}; "
                "free what the runs exercise, or test what exercises these."
            )
            found.append(Finding("refuse", None, None, said))
            continue
        if verdict.unexcited:
            several = len(verdict.unexcited) > 1
            said = (
                f"{where}: no run exercises {', '.join(verdict.unexcited)}, which "
                f"{'stay' if several else 'stays'} where the fit begins: hold "
                f"{'them' if several else 'it'}, or add a test that does."
            )
            found.append(Finding("warn", None, None, said))
        found += [
            Finding("warn", None, None, f"{where}: {direction.sentence}")
            for direction in verdict.null
        ]
    return found


def _variables(unknowns: Unknowns) -> Unknowns:
    """The unknowns where a fit begins, as the statistics see them; none counts as at a bound."""
    return Unknowns.of(
        unknowns.names,
        [each.start for each in unknowns],
        scales=[each.scale for each in unknowns],
        logarithmic=[each.log for each in unknowns],
    )


def _count(samples: int) -> str:
    return f"{samples} sample{'' if samples == 1 else 's'}"


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
            f"{said}; this run is not held against the drive"
            for said in chain.from_iterable(beyond.values())
        ]
        runs = tuple(each for each in runs if not beyond[each.name])
        # a drive that is made up says nothing of what a machine does
        made_up = all(each.status == "assumed" for each in nominal.values())
        if runs and not made_up and all(each.input.kind != "other" for each in runs):
            found += [each.sentence.rstrip(".") for each in check_runs(runs, nominal)]
    return found
