"""Verdict on a fit or a drive: whether it can be used, how good it is, and why not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from math import inf
from typing import Literal, NamedTuple

import numpy as np

from swashplate.errors import InputError
from swashplate.identification.assessment import Assessment, Measures, RunQuality
from swashplate.identification.starts import StartResult
from swashplate.identification.validation import pooled, with_speeds

Weight = Literal["good", "look", "bad", "plain"]

USELESS = 1.0
"""NRMSE from which a simulation is no better than the mean of what was measured, by definition."""
POOR = 0.5
"""NRMSE from which a drive is not usable: a constant gain misses less of a step's record."""
SERIOUS = 0.2
"""NRMSE below which a model error or a fit that carries over badly is still of use: 80 % of the
movement is followed, about what the source reached on its worst kind of test."""
CARRIES_OVER = 1.5
"""Factor on the fitted runs' RMSE up to which held-out runs count as simulated alike: manoeuvres
differ that much among the fitted ones."""
FAR = 3.0
"""Factor from which the fit does not carry over: twice what manoeuvres differ by anyway."""
MOST = 0.5
"""Share of unknowns without a value of their own from which a fit has found nothing."""
WIDE = 0.1
"""Half width of an interval, over the estimate, from which a faint direction shows in it: any value
within 10 % would then do as well."""
MOVES = 0.05
"""A run that moves by less than this part of the channel's movement is not judged by itself."""
FOLLOWS = 0.5
"""Correlation of residuals with the input that counts as model error: a quarter of their square."""
BANDS = 1.35
"""And how many of its 95 % bands it must reach: where a band is wide, about six independent looks
fit into the lags, and the largest of them stays below that."""
SURE = 0.9
"""A correlation from which no band is asked: in short runs of one slow movement it reaches 1."""
SAME = 1e-6
"""Costs that differ by less than this part are the same optimum."""


class Statement(NamedTuple):
    """One subject of a verdict."""

    subject: str
    weight: Weight
    """``"bad"`` where it rules out the use, ``"look"`` where something asks for attention."""
    sentences: tuple[str, ...]
    reasons: tuple[str, ...] = ()
    """Clauses that say why it rules out the use."""


def convergence(assessments: Sequence[Assessment], planned: Sequence[str]) -> Statement:
    """Whether each stage came to its end."""
    said, reasons, look = list[str](), list[str](), False
    for each in assessments:
        solution, name = each.stage.solution, each.stage.stage.name
        state = "converged"
        if solution.interrupted:
            state = "interrupted, the best so far is kept"
            reasons.append(f"stage {name} was interrupted, and its best so far is no optimum")
        elif not solution.converged:
            state, look = f"not converged ({solution.message})", True
        said.append(
            f"{name}: {state} after {solution.evaluations:,} evaluations in "
            f"{solution.seconds:.2f} s, cost {solution.start_cost:.5g} → {solution.cost:.5g}."
        )
    missing = [name for name in planned if name not in {a.stage.stage.name for a in assessments}]
    if missing:
        reasons.append(f"{listed(missing)} {'were' if len(missing) > 1 else 'was'} never fitted")
        said.append(f"Not fitted: {listed(missing)}.")
    return _statement("Convergence", said, reasons, look)


def agreement(qualities: Sequence[RunQuality], which: str, subject: str = "Agreement") -> Statement:
    """Whether the runs are simulated at all.

    Parameters
    ----------
    qualities : sequence of RunQuality
        Of the channels to judge by.
    which : str
        Which runs they are: ``"fitted"``.
    subject : str
        Of the statement.
    """
    said, reasons, look = list[str](), list[str](), False
    for name, found in pooled(qualities).items():
        error = found.nrmse
        if error is None:
            look = True
            said.append(f"{name}: what was measured never moves, so there is nothing to judge.")
            continue
        if error >= POOR:
            words = (
                "is simulated no better than by its mean"
                if error >= USELESS
                else "misses at least half of the movement"
            )
            words = f"{name} {words} in the {which} runs"
            reasons.append(f"{words} (fit {found.fit_percent:z.0f} %)")
            said.append(f"{words}: fit {found.fit_percent:z.1f} %.")
        worse = [each for each in qualities if each.channel == name and _worse(each, found)]
        if worse and error < USELESS:
            look = True
            names = listed([each.experiment.name for each in worse])
            said.append(
                f"{name} is simulated no better than by its mean in {names}: contradicts the other "
                "runs, or shows what the model has not."
            )
    return _statement(subject, said, reasons, look)


def carrying_over(fitted: Sequence[RunQuality], held: Sequence[RunQuality]) -> Statement:
    """Whether runs that were held out are simulated as well as those that were fitted."""
    if not held:
        words = "No run was held out: how the fit carries over to other tests was not tried."
        return Statement("Validation", "look", (words,))
    judged = agreement(held, "held-out")
    said, reasons, look = [*judged.sentences], [*judged.reasons], judged.weight != "good"
    reference = pooled(fitted)
    for name, found in pooled(held).items():
        if name not in reference or reference[name].rmse == 0.0 or found.nrmse is None:
            continue
        ratio = found.rmse / reference[name].rmse
        if ratio <= CARRIES_OVER:
            words = "the fit carries over"
        elif ratio <= FAR or found.nrmse < SERIOUS:
            words, look = "the fit carries over with a larger error", True
        else:
            words = "the fit does not carry over"
            if found.nrmse < POOR:  # otherwise its reason is given already
                reasons.append(f"held-out {name} has {ratio:.1f} times the RMSE of the fitted runs")
        said.append(
            f"{name}: the RMSE of held-out runs is {ratio:.2f} times that of fitted runs; {words} "
            f"(up to {CARRIES_OVER:g} counts as alike)."
        )
    return _statement("Validation", said, reasons, look)


def unknowns(assessments: Sequence[Assessment]) -> Statement:
    """Whether the unknowns that all runs share have values of their own."""
    said, reasons, look = list[str](), list[str](), False
    lost, total = 0, 0
    for each in assessments:
        problem, found = each.stage.problem, each.identifiability
        shared = {
            label
            for label, unknown in zip(problem.unknowns.names, problem.unknowns, strict=True)
            if unknown.run is None
        }
        without = shared & {*found.at_bounds, *found.to_hold}
        lost, total = lost + len(without), total + len(shared)
        faint = shared & {name for direction in found.faint for name in direction.changes}
        wide = _wide(each, faint) if faint else []
        look = look or bool(without or wide)
        said += [f"{each.stage.stage.name}: {words}" for words in found.sentences()]
        if wide:
            said.append(
                f"{each.stage.stage.name}: intervals wider than ±{percent(WIDE)} along faint "
                f"directions: {listed(wide)}."
            )
    if lost > MOST * total:
        words = f"{lost} of {total} unknowns stand at a bound or are not determined"
        reasons.append(words)
        said.insert(0, f"{words}: hold them, or make tests that exercise them.")
    return _statement("Identifiability", said, reasons, look)


def residuals(qualities: Sequence[RunQuality]) -> Statement:
    """Whether residuals follow the input, which is the mark of a model error."""
    said, reasons, look = list[str](), list[str](), False
    for name, found in pooled(qualities).items():
        tests = [each.test for each in qualities if each.channel == name and each.test is not None]
        related = [
            each.peak[1]
            for each in tests
            if abs(each.peak[1]) >= min(max(FOLLOWS, BANDS * each.cross_band), SURE)
        ]
        if not related:
            continue
        look = True
        largest = max(related, key=abs)
        said.append(
            f"{name}: the residuals of {len(related)} of {len(tests)} runs follow the input "
            f"(correlation up to {largest:+.2f}): the model leaves out something that the input "
            "causes."
        )
        # from POOR on its disagreement is a reason already
        if SERIOUS <= (found.nrmse or 0.0) < POOR and 2 * len(related) > len(tests):
            reasons.append(
                f"the residuals of {name} follow the input and are {percent(found.nrmse or 0.0)} "
                "of its movement: the model leaves out something that the input causes"
            )
    if not said:
        said.append(f"No residuals follow the input with a correlation beyond {FOLLOWS:g}.")
    return _statement("Residuals", said, reasons, look)


def reached(starts: Mapping[str, Sequence[StartResult]]) -> Statement:
    """How many starts of each stage found the same.

    Parameters
    ----------
    starts : mapping of str to sequence of StartResult
        By the stage's name, which may be empty.
    """
    said, alone = list[str](), False
    for stage, results in starts.items():
        before = f"{stage}: " if stage else ""
        costs = np.array([each.cost for each in results])
        finite = costs[np.isfinite(costs)]
        if not finite.size:
            said.append(f"{before}No start ended with a finite cost.")
            alone = True
            continue
        best = float(finite.min())
        alike = int(np.count_nonzero(costs <= best * (1.0 + SAME)))
        alone = alone or alike == 1
        said.append(f"{before}{alike} of {len(results)} starts reached the best cost, {best:.6g}.")
    return _statement("Starts", said, (), alone)


def percent(part: float) -> str:
    """A part in per cent, two digits."""
    number = 100.0 * part
    return f"{number:.0f} %" if number >= 9.95 else f"{number:.2g} %"


def listed(words: Sequence[str]) -> str:
    """``a, b and c``; empty for none."""
    return " and ".join([*([", ".join(words[:-1])] if words[:-1] else []), *words[-1:]])


def _wide(assessment: Assessment, names: Set[str]) -> list[str]:
    """Those of some unknowns whose intervals are wide or have no end; all if there are none."""
    try:
        found = {each.name: each.relative_half_width for each in assessment.uncertainty.estimates}
    except InputError:
        found = {}
    return [name for name in sorted(names) if found.get(name, inf) > WIDE]


def _worse(quality: RunQuality, pool: Measures) -> bool:
    """Whether a run that moves is no better than its own mean."""
    own = quality.measures
    return own.spread > MOVES * pool.spread and (own.nrmse or 0.0) >= USELESS


def _statement(subject: str, said: Sequence[str], reasons: Sequence[str], look: bool) -> Statement:
    weight: Weight = "bad" if reasons else "look" if look else "good"
    return Statement(subject, weight, tuple(said), tuple(reasons))


@dataclass(frozen=True)
class Verdict:
    """The judgement on a fit, or on a drive over some runs."""

    headline: str
    """One sentence."""
    statements: tuple[Statement, ...]

    @property
    def usable(self) -> bool:
        """Whether nothing rules out the use."""
        return not any(each.reasons for each in self.statements)

    @property
    def sentences(self) -> tuple[str, ...]:
        """Everything that is said, subject after subject."""
        return tuple(words for each in self.statements for words in each.sentences)


def verdict(
    assessments: Sequence[Assessment],
    predicted: Sequence[RunQuality],
    *,
    starts: Sequence[StartResult] = (),
    planned: Sequence[str] = (),
) -> Verdict:
    """Judge a fit by what it found and by what it predicts, or a drive by what it predicts.

    Parameters
    ----------
    assessments : sequence of Assessment
        One for each stage of the fit; none for a drive that is only held against runs.
    predicted : sequence of RunQuality
        Of runs that were held out of the fit, as `validation.predict` gives them.
    starts : sequence of StartResult
        Of a search that is not kept in the stages.
    planned : sequence of str
        Names of all stages of the set-up, to tell those that were never begun.

    Returns
    -------
    Verdict
        Not usable if a stage was interrupted or never begun, most unknowns have no value of their
        own, a channel is hardly simulated at all, held-out runs are far worse than fitted ones, or
        large residuals follow the input. The limits are the constants of this module.

    Notes
    -----
    A position is judged by its speed where it has one: of a position nearly everything is its
    trend.
    """
    fitted = _judged([each for assessment in assessments for each in assessment.runs])
    held = _judged(predicted)
    if assessments:
        statements = [
            convergence(assessments, planned),
            agreement(fitted, "fitted"),
            unknowns(assessments),
            carrying_over(fitted, held),
        ]
    else:
        statements = [agreement(held, "predicted")]
    # a position's own residuals are tested: those of its speed are coloured by the filter
    own = [each for assessment in assessments for each in assessment.runs] or predicted
    statements.append(residuals(own))
    several = starts_of(assessments, starts)
    if several:
        statements.append(reached(several))
    return Verdict(_headline(bool(assessments), fitted, held, statements), tuple(statements))


def starts_of(
    assessments: Sequence[Assessment], starts: Sequence[StartResult] = ()
) -> dict[str, Sequence[StartResult]]:
    """Starts by stage, of the stages that had several; or those given, under no name."""
    own: dict[str, Sequence[StartResult]] = {
        each.stage.stage.name: each.stage.starts
        for each in assessments
        if len(each.stage.starts) > 1
    }
    return own or ({"": starts} if len(starts) > 1 else {})


def part_of_range(qualities: Sequence[RunQuality], channel: str) -> float | None:
    """RMSE of a channel over the range that was measured of it, all runs together.

    None where nothing moved.
    """
    alike = [each for each in qualities if each.channel == channel]
    counted = [each.experiment[channel].values[each.experiment[channel].used] for each in alike]
    reach = max(float(x.max()) for x in counted) - min(float(x.min()) for x in counted)
    return pooled(alike)[channel].rmse / reach if reach > 0.0 else None


def _judged(qualities: Sequence[RunQuality]) -> list[RunQuality]:
    """With speeds in place of the positions that have one, speeds first."""
    found = with_speeds(qualities)
    named = {each.channel for each in found}
    kept = [each for each in found if f"speed from {each.channel}" not in named]
    return sorted(kept, key=lambda each: each.experiment[each.channel].kind != "shaft_speed")


def _headline(
    is_fit: bool,
    fitted: Sequence[RunQuality],
    held: Sequence[RunQuality],
    statements: Sequence[Statement],
) -> str:
    reasons = [words for each in statements for words in each.reasons]
    if reasons:
        return f"Not usable: {'; '.join(reasons)}."
    if not is_fit:
        runs = len({each.experiment.name for each in held})
        return f"Predicts {_accuracy(held)} over {runs} run{'s' if runs > 1 else ''}."
    if held:
        return f"Usable: predicts held-out {_accuracy(held)}."
    return f"Usable as far as was tried: follows {_accuracy(fitted)}; no run was held out."


def _accuracy(qualities: Sequence[RunQuality]) -> str:
    """``speed from counts to 1.2 % of its range and current to 2.0 %``."""
    parts = list[str]()
    for name in dict.fromkeys(each.channel for each in qualities):
        part = part_of_range(qualities, name)
        if part is not None:
            parts.append(f"{name} to {percent(part)}{'' if parts else ' of its range'}")
    return listed(parts) or "channels that never move"
