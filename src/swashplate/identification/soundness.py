"""Whether a campaign can be fitted at all: verdicts before the solver starts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from swashplate.campaign.experiment import Channel, Experiment
from swashplate.errors import InputError
from swashplate.identification.contradictions import Finding as Finding
from swashplate.identification.contradictions import contradictions
from swashplate.identification.drive_model import SIGNALS
from swashplate.identification.excitation import simulated_run
from swashplate.identification.identifiability import identifiability
from swashplate.identification.motion import Motion, motions
from swashplate.identification.setup import Setup
from swashplate.identification.staging import stage_problem
from swashplate.identification.unknowns import Unknowns
from swashplate.identification.unmoved import (
    constant_commands,
    frozen_positions,
    idle_commands,
    short_runs,
    still_sensors,
)
from swashplate.parameters.parameter_set import ParameterSet

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
    found = [finding for each in experiments for finding in _samples(each)]
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
