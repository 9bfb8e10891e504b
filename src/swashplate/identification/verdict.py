"""The verdict on a fit or a drive in words: whether it can be used, how good it is, and why not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from swashplate.identification import judgements
from swashplate.identification.assessment import Assessment, RunQuality
from swashplate.identification.judgements import Statement, listed, percent
from swashplate.identification.starts import StartResult
from swashplate.identification.validation import pooled, with_speeds


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
        large residuals follow the input. The limits are the constants of `judgements`.

    Notes
    -----
    A position is judged by its speed where it has one: of a position nearly everything is its
    trend.
    """
    fitted = _judged([each for assessment in assessments for each in assessment.runs])
    held = _judged(predicted)
    if assessments:
        statements = [
            judgements.convergence(assessments, planned),
            judgements.agreement(fitted, "fitted"),
            judgements.unknowns(assessments),
            judgements.carrying_over(fitted, held),
        ]
    else:
        statements = [judgements.agreement(held, "predicted")]
    # a position's own residuals are tested: those of its speed are coloured by the filter
    own = [each for assessment in assessments for each in assessment.runs] or predicted
    statements.append(judgements.residuals(own))
    several = starts_of(assessments, starts)
    if several:
        statements.append(judgements.reached(several))
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
