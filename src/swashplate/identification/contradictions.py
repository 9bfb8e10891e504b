"""Runs that cannot all be right: measured against each other and against the nominal drive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Literal, NamedTuple

import numpy as np

from swashplate.identification.motion import Motion, rms

Severity = Literal["refuse", "warn"]

POINTS = 512
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
    middle = float(np.median([each.gain for each in ours])) if ours else 1.0
    found: dict[str, Finding] = {}
    for pair in combinations(ours, 2):
        if not _same_command(*pair):
            continue
        # the odd one is that which is further from what the runs have in common
        good, odd = sorted(pair, key=lambda each: abs(np.log(abs(each.gain / middle) + 1e-12)))
        if odd.experiment.name in found:
            continue
        factor, correlation = _compared(good, odd)
        both = f"{good.experiment.name} and {odd.experiment.name} have the same command, but"
        if correlation < ALIKE:
            sentence = f"{both} '{name}' has nothing in common: one of them belongs to another test"
            found[odd.experiment.name] = Finding(
                "refuse", odd.experiment.name, name, f"{sentence}; leave it out."
            )
        elif not 1.0 / DOUBTFUL < factor < DOUBTFUL:
            certain = not 1.0 / FACTOR < factor < FACTOR
            found[odd.experiment.name] = Finding(
                "refuse" if certain else "warn",
                odd.experiment.name,
                name,
                f"{both} '{name}' moves {factor:.3g} times as far in the second: both cannot be "
                f"right; mend scale or unit of '{name}' in one of them, or leave it out."
                if certain
                else f"{both} '{name}' moves {factor:.3g} times as far in the second: was the load "
                "or the oil another?",
            )
    return list(found.values())


def _same_command(first: Motion, second: Motion) -> bool:
    a, b = first.experiment.input, second.experiment.input
    if a.kind != b.kind:
        return False
    length = min(a.time[-1] - a.time[0], b.time[-1] - b.time[0])
    since = np.linspace(0.0, length, POINTS)
    left, right = a.at(a.time[0] + since), b.at(b.time[0] + since)
    return rms(left - right) <= SAME_COMMAND * max(rms(left), rms(right))


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
