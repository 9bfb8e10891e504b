"""Verdict on a fit or a drive: acceptance criteria, what it can be used for, and why not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from swashplate.campaign.experiment import Experiment
from swashplate.errors import DomainError, InputError
from swashplate.identification.assessment import Assessment, RunQuality
from swashplate.identification.criteria import (
    CARRIES_OVER,
    FAR,
    FOLLOWS,
    MISFIT,
    REQUIRED,
    SAME,
    SERIOUS,
    Criterion,
    bounded_predictions,
    carried_over,
    consistent,
    convergence,
    determined,
    fitted_runs,
    followed,
    following,
    misfit_criteria,
    misfit_of,
    model_error,
    no_worse_than_mean,
    part_of_range,
    percent,
    required_accuracy,
)
from swashplate.identification.drive_model import DriveModel
from swashplate.identification.identifiability import WIDE, listed
from swashplate.identification.lack_of_fit import (
    LackOfFit,
)
from swashplate.identification.starts import StartResult
from swashplate.identification.validation import pooled, with_speeds
from swashplate.results import Result, short

if TYPE_CHECKING:
    from swashplate.tables import Table

Weight = Literal["good", "look", "bad", "plain"]
Grade = Literal["Usable", "Usable for prediction", "Not usable"]


class Statement(NamedTuple):
    """One subject of a verdict."""

    def __repr__(self) -> str:
        return short(self)

    subject: str
    weight: Weight
    """``"bad"`` where it rules out the use, ``"look"`` where something asks for attention."""
    sentences: tuple[str, ...]


@dataclass(frozen=True)
class Verdict(Result):
    """The judgement on a fit, or on a drive over some runs."""

    headline: str
    """One sentence."""
    statements: tuple[Statement, ...]
    criteria: tuple[Criterion, ...] = ()
    grade: Grade = "Usable"
    validity: str = ""
    """Sentence that names the manoeuvres and the range that it holds for, and what they never
    reach; empty for a drive that was not fitted."""
    assumed: tuple[str, ...] = ()
    """What is assumed and cannot be checked from these logs."""

    def table(self) -> Table:
        """Its criteria."""
        from swashplate.identification.tables import criteria_table

        return criteria_table(self)

    @property
    def usable(self) -> bool:
        """Whether nothing rules out the use."""
        return self.grade != "Not usable"

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
    required: float = REQUIRED,
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
        Names of all stages of the fit configuration, to tell those that were never begun.
    required : float
        Largest error of the runs predicted, over the range of each channel. [1]

    Returns
    -------
    Verdict
        "Not usable" where a criterion on the use fails, "Usable for prediction" where only those on
        the parameters' values do.

    Notes
    -----
    A position is judged by its speed where it has one: of a position nearly everything is its
    trend.
    """
    fitted = _judged([each for assessment in assessments for each in assessment.runs])
    held = _judged(predicted)
    own = [each for assessment in assessments for each in assessment.runs] or predicted
    misfit = misfit_of(assessments)
    criteria = [*convergence(assessments, planned)]
    for which, qualities in (
        ("fitted", fitted),
        ("held-out" if assessments else "predicted", held),
    ):
        if qualities:
            criteria += [followed(qualities, which), no_worse_than_mean(qualities, which)]
    if held:
        criteria.append(required_accuracy(held, required))
    if assessments:
        criteria += [
            *carried_over(fitted, held),
            consistent(assessments),
            determined(assessments),
            bounded_predictions(assessments, predicted),
        ]
    if misfit is not None:
        criteria += misfit_criteria(misfit, held or fitted)
    criteria.append(model_error(own))
    statements = _statements(assessments, fitted, held, own, planned, misfit, criteria)
    several = starts_of(assessments, starts)
    if several:
        statements.append(reached(several))
    unusable = [each for each in criteria if not each.passed and each.rules == "use"]
    untrusted = [each for each in criteria if not each.passed and each.rules == "values"]
    grade: Grade = "Not usable" if unusable else "Usable for prediction" if untrusted else "Usable"
    experiments = fitted_runs(assessments)
    words = _headline(bool(assessments), fitted, held, unusable, untrusted, experiments)
    return Verdict(
        words,
        tuple(statements),
        tuple(criteria),
        grade,
        _validity(assessments) if experiments else "",
        _assumptions(misfit),
    )


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


# --- words ---------------------------------------------------------------------------------------


def _statements(
    assessments: Sequence[Assessment],
    fitted: Sequence[RunQuality],
    held: Sequence[RunQuality],
    own: Sequence[RunQuality],
    planned: Sequence[str],
    misfit: LackOfFit | None,
    criteria: Sequence[Criterion],
) -> list[Statement]:
    """What is said beside the criteria, subject by subject."""
    made = []
    if assessments:
        made.append(_progress(assessments, planned))
        made.append(_agreement(fitted, "Agreement"))
        made.append(_unknowns(assessments))
        made.append(_carrying_over(fitted, held))
    else:
        made.append(_agreement(held, "Agreement"))
    if misfit is not None and (misfit.runs or misfit.clipped):
        said = [
            f"{name}: residuals are {ratio:.3g} times their known measurement error."
            for name, ratio in misfit.ratios.items()
        ]
        poor = any(ratio > MISFIT for ratio in misfit.ratios.values())
        if poor and misfit.causes:
            said += [f"A likely cause: {each.cause}." for each in misfit.causes]
        said += misfit.clipped
        weight: Weight = "look" if poor or misfit.clipped else "good"
        made.append(Statement("Lack of fit", weight, tuple(said)))
    made.append(_residuals(own))
    failures = [each for each in criteria if not each.passed and each.rules == "use"]
    subjects = {
        "Convergence": ("convergence", "stages"),
        "Agreement": ("RMSE /", "predicted runs", "fitted runs"),
        "Validation": ("held-out", "RMSE, held-out", "error / range"),
        "Identifiability": ("unknowns", "predictions"),
        "Lack of fit": ("lack of fit", "drift", "clipped"),
        "Residuals": ("residuals",),
    }
    return [
        each._replace(weight="bad")
        if any(f.name.startswith(subjects[each.subject]) for f in failures)
        else each
        for each in made
    ]


def _progress(assessments: Sequence[Assessment], planned: Sequence[str]) -> Statement:
    said, look = list[str](), False
    for each in assessments:
        solution, name = each.stage.solution, each.stage.stage.name
        state = "converged"
        if solution.interrupted:
            state = "interrupted, the best so far is kept"
        elif not solution.converged:
            state, look = f"not converged ({solution.message})", True
        said.append(
            f"{name}: {state} after {solution.evaluations:,} evaluations in "
            f"{solution.seconds:.2f} s, cost {solution.start_cost:.5g} → {solution.cost:.5g}."
        )
    missing = [name for name in planned if name not in {a.stage.stage.name for a in assessments}]
    if missing:
        said.append(f"Not fitted: {listed(missing)}.")
    return Statement("Convergence", "look" if look else "good", tuple(said))


def _agreement(qualities: Sequence[RunQuality], subject: str) -> Statement:
    said = [
        f"{name}: what was measured never moves, so there is nothing to judge."
        for name, found in pooled(qualities).items()
        if found.nrmse is None
    ]
    said += [
        f"{no_worse_than_mean(some, 'these').failure}."
        for some in [[each for each in qualities if (each.measures.nrmse or 0.0) >= 1.0]]
        if some and not no_worse_than_mean(qualities, "these").passed
    ]
    return Statement(subject, "look" if said else "good", tuple(said))


def _carrying_over(fitted: Sequence[RunQuality], held: Sequence[RunQuality]) -> Statement:
    if not held:
        words = "No run was held out: how the fit carries over to other tests was not tried."
        return Statement("Validation", "look", (words,))
    said, look = list[str](), False
    reference = pooled(fitted)
    for name, found in pooled(held).items():
        if name not in reference or reference[name].rmse == 0.0 or found.nrmse is None:
            continue
        ratio = found.rmse / reference[name].rmse
        words = "the fit carries over"
        if ratio > CARRIES_OVER:
            look = True
            near = ratio <= FAR or found.nrmse < SERIOUS
            words = (
                f"the fit {'carries over with a larger error' if near else 'does not carry over'}"
            )
        said.append(
            f"{name}: the RMSE of held-out runs is {ratio:.2f} times that of fitted runs; {words} "
            f"(up to {CARRIES_OVER:g} counts as alike)."
        )
    return Statement("Validation", "look" if look else "good", tuple(said))


def _unknowns(assessments: Sequence[Assessment]) -> Statement:
    said, look = list[str](), False
    for each in assessments:
        name, found = each.stage.stage.name, each.identifiability
        said += [f"{name}: {words}" for words in found.sentences()]
        wide = weak_unknowns(each)
        look = look or bool(wide or found.at_bounds or found.to_fix)
        if wide:
            said.append(f"{name}: not determined to within ±{percent(WIDE)}: {listed(wide)}.")
    return Statement("Identifiability", "look" if look else "good", tuple(said))


def weak_unknowns(assessment: Assessment) -> list[str]:
    """Unknowns of the machine with an interval wider than 10 % of the value, or without one."""
    try:
        found = {each.name: each.relative_half_width for each in assessment.uncertainty.estimates}
    except InputError:
        found = {}
    machine = [each.name for each in assessment.stage.problem.unknowns if each.run is None]
    bounds = assessment.identifiability.at_bounds
    return [name for name in machine if found.get(name, inf) > WIDE and name not in bounds]


def _residuals(qualities: Sequence[RunQuality]) -> Statement:
    said = []
    for name in pooled(qualities):
        tests, related = following(qualities, name)
        if related:
            said.append(
                f"{name}: the residuals of {len(related)} of {tests} runs follow the input "
                f"(correlation up to {max(related, key=abs):+.2f}): the model leaves out something "
                "that the input causes."
            )
    quiet = f"No residuals follow the input with a correlation beyond {FOLLOWS:g}."
    return Statement("Residuals", "look" if said else "good", tuple(said) or (quiet,))


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
    return Statement("Starts", "look" if alone else "good", tuple(said))


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
    unusable: Sequence[Criterion],
    untrusted: Sequence[Criterion],
    experiments: Sequence[Experiment],
) -> str:
    if unusable:
        return f"Not usable: {'; '.join(each.failure for each in unusable)}."
    if not is_fit:
        runs = len({each.experiment.name for each in held})
        return f"Predicts {_accuracy(held)} over {runs} run{'s' if runs > 1 else ''}."
    if untrusted:
        accuracy = f"{'held-out ' if held else 'fitted '}{_accuracy(held or fitted)}"
        return (
            f"Usable for prediction of {_manoeuvres(experiments)} ({accuracy}); parameter values "
            f"not to be trusted because {'; '.join(each.failure for each in untrusted)}."
        )
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


def _manoeuvres(experiments: Sequence[Experiment]) -> str:
    """``ramps, steps and sines of up to 0.3 Hz from -9 to 9 V``."""
    kinds, fastest = dict[str, None](), 0.0
    for each in experiments:
        word = each.maneuver.split(" ")[0]
        kinds[f"{word}s" if word in ("ramp", "step", "sine", "chirp") else word] = None
        if each.recognised is not None and each.recognised.frequency:
            fastest = max(fastest, each.recognised.frequency)
    low = min(float(each.input.values.min()) for each in experiments)
    high = max(float(each.input.values.max()) for each in experiments)
    words = [f"sines of up to {fastest:.3g} Hz" if k == "sines" and fastest else k for k in kinds]
    return f"{listed(words)} from {low:.3g} to {high:.3g} {experiments[0].input.unit}"


def _validity(assessments: Sequence[Assessment]) -> str:
    """What the fit holds for, and what of the drive the fitted runs never reach."""
    from swashplate.identification.excitation import acting, simulated_run

    experiments = fitted_runs(assessments)
    said = f"Holds for {_manoeuvres(experiments)}"
    if isinstance(assessments[-1].stage.problem.model, DriveModel):
        parameters, longest = assessments[-1].stage.drive.parameters, dict[str, float]()
        try:
            for each in experiments:
                for name, seconds in acting(simulated_run(each, parameters), parameters).items():
                    longest[name] = max(longest.get(name, 0.0), seconds)
        except (DomainError, InputError):
            return f"{said}."
        never = [words for prefix, words in LIMITS.items() if not _any(longest, prefix)]
        one_way = [
            f"{words} in {'negative' if sign == 'minus' else 'positive'} direction"
            for prefix, words in LIMITS.items()
            for sign in ("plus", "minus")
            if _any(longest, prefix) and longest.get(f"{prefix}_{sign}", 1.0) == 0.0
        ]
        if never or one_way:
            said += f"; never reached: {listed([*never, *one_way])}"
    return f"{said}."


LIMITS: Mapping[str, str] = {
    "Z13": "the swash plate's stop Z13",
    "Z14": "the spool's stop Z14",
    "Z15": "the relief valve Z15",
    "Z16": "the orifices' limit Z16",
}
"""What a drive may never have reached in the fitted runs, by symbol."""


def _any(longest: Mapping[str, float], symbol: str) -> bool:
    return any(seconds > 0.0 for name, seconds in longest.items() if name.startswith(symbol))


def _assumptions(misfit: LackOfFit | None) -> tuple[str, ...]:
    """What cannot be checked, in sentences."""
    if misfit is None:
        return ()
    said = [f"{each.assumption}." for each in misfit.assumed]
    if misfit.units:
        said.insert(0, f"The estimates are in units of the fixed {listed(misfit.units)}.")
    return tuple(said)
