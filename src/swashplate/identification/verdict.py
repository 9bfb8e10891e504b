"""Verdict on a fit: usable, usable for prediction, or not, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING, Literal

import numpy as np

from swashplate.campaign.experiment import Experiment
from swashplate.errors import DomainError, InputError
from swashplate.identification.acceptance import (
    MISFIT,
    REQUIRED,
    Criterion,
    bounded_predictions,
    carried_over,
    consistent,
    convergence,
    determined,
    fitted_runs,
    followed,
    following,
    held_over_fitted,
    misfit_criteria,
    model_error,
    no_worse_than_mean,
    part_of_range,
    percent,
    range_of,
    required_accuracy,
)
from swashplate.identification.drive_model import DriveModel, limits_reached
from swashplate.identification.identifiability import WIDE
from swashplate.identification.lack_of_fit import LackOfFit, lack_of_fit
from swashplate.identification.solving import StartResult
from swashplate.identification.validation import pooled, with_speeds
from swashplate.results import Result
from swashplate.tables import listed

if TYPE_CHECKING:
    from swashplate.identification.assessment import Assessment
    from swashplate.identification.validation import RunQuality
    from swashplate.tables import Table

Grade = Literal["Usable", "Usable for prediction", "Not usable"]

CARRIES_OVER = 1.5
"""Factor on the fitted runs' RMSE up to which held-out runs count as simulated alike: maneuvers
differ that much among the fitted ones."""
SAME = 1e-6
"""Costs that differ by less than this part are the same optimum."""

LIMITS: Mapping[str, str] = {
    "Z13": "the swash plate's stop Z13",
    "Z14": "the spool's stop Z14",
    "Z15": "the relief valve Z15",
    "Z16": "the orifices' limit Z16",
}
"""What a drive may never have reached in the fitted runs, by symbol."""


@dataclass(frozen=True)
class Verdict(Result):
    """The judgement on a fit, or on a drive over some runs."""

    headline: str
    """One sentence."""
    criteria: tuple[Criterion, ...] = ()
    grade: Grade = "Usable"
    sentences: tuple[str, ...] = ()
    """What asks for attention and is no criterion."""
    validity: str = ""
    """Sentence that names the maneuvers and the range that it holds for, and what they never
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


def verdict(
    assessments: Sequence[Assessment],
    predicted: Sequence[RunQuality],
    *,
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
    misfit = None
    if assessments:
        with suppress(InputError):  # nothing to tell noise from
            misfit = lack_of_fit(assessments)
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
            *([carried_over(fitted, held)] if held else []),
            consistent(assessments),
            determined(assessments),
            bounded_predictions(assessments, predicted),
        ]
    if misfit is not None:
        criteria += misfit_criteria(misfit, held or fitted)
    criteria.append(model_error(own))
    unusable = [each for each in criteria if not each.passed and each.rules == "use"]
    untrusted = [each for each in criteria if not each.passed and each.rules == "values"]
    grade: Grade = "Not usable" if unusable else "Usable for prediction" if untrusted else "Usable"
    tested = {each.name: each for each in fitted_runs(assessments)}
    tested |= {each.experiment.name: each.experiment for each in held}
    experiments = list(tested.values())
    words = _headline(bool(assessments), fitted, held, unusable, untrusted, experiments)
    return Verdict(
        words,
        tuple(criteria),
        grade,
        tuple(_remarks(assessments, fitted, held, own, misfit)),
        _validity(assessments, experiments) if assessments else "",
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


# --- words ----------------------------------------------------------------------------------------


def _remarks(
    assessments: Sequence[Assessment],
    fitted: Sequence[RunQuality],
    held: Sequence[RunQuality],
    own: Sequence[RunQuality],
    misfit: LackOfFit | None,
) -> list[str]:
    """What asks for attention beside the criteria."""
    said = [
        f"{name}: the measured signal never moves, so nothing can be judged."
        for name, found in pooled(fitted or held).items()
        if found.nrmse is None
    ]
    if assessments and not held:
        said.append("No run was held out: the prediction of other tests was not checked.")
    for name, (ratio, _) in held_over_fitted(fitted, held).items() if assessments else ():
        if ratio > CARRIES_OVER:
            said.append(
                f"{name}: the RMSE of held-out runs is {ratio:.2f} times that of fitted runs: "
                f"larger errors on other tests (limit {CARRIES_OVER:g})."
            )
    for each in assessments:
        if wide := weak_unknowns(each):
            name = each.stage.stage.name
            said.append(f"{name}: not determined to within ±{percent(WIDE)}: {listed(wide)}.")
    if misfit is not None:
        if any(ratio > MISFIT for ratio in misfit.ratios.values()):
            said += [f"A likely cause: {each.cause}." for each in misfit.causes]
        said += misfit.clipped
    for name in pooled(own):
        tests, related = following(own, name)
        if related:
            said.append(
                f"{name}: the residuals of {len(related)} of {tests} runs follow the input "
                f"(correlation up to {max(related, key=abs):+.2f}): the model leaves out something "
                "that the input causes."
            )
    return said + _reached(starts_of(assessments))


def weak_unknowns(assessment: Assessment) -> list[str]:
    """Unknowns of the machine with an interval wider than 10 % of the value, or without one."""
    try:
        found = {each.name: each.relative_half_width for each in assessment.uncertainty.estimates}
    except InputError:
        found = {}
    machine = [each.name for each in assessment.stage.problem.unknowns if each.run is None]
    bounds = assessment.identifiability.at_bounds
    return [name for name in machine if found.get(name, inf) > WIDE and name not in bounds]


def _reached(starts: Mapping[str, Sequence[StartResult]]) -> list[str]:
    """How many starts of each stage found the same."""
    said = []
    for stage, results in starts.items():
        before = f"{stage}: " if stage else ""
        costs = np.array([each.cost for each in results])
        best = float(costs.min())
        if not np.isfinite(best):
            said.append(f"{before}No start ended with a finite cost.")
            continue
        alike = int(np.count_nonzero(costs <= best * (1.0 + SAME)))
        said.append(f"{before}{alike} of {len(results)} starts reached the best cost, {best:.6g}.")
    return said


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
            f"Usable for prediction of {_maneuvers(experiments)} ({accuracy}); parameter values "
            f"not to be trusted because {'; '.join(each.failure for each in untrusted)}."
        )
    if held:
        return f"Usable: predicts held-out {_accuracy(held)}."
    return f"Usable as far as tested: follows {_accuracy(fitted)}; no run was held out."


def _accuracy(qualities: Sequence[RunQuality]) -> str:
    """``speed to 1.2 % of its range (worst run 1.6 %) and current to 2.0 % (worst run 2.2 %)``."""
    parts = list[str]()
    for name in dict.fromkeys(each.channel for each in qualities):
        part, alike = part_of_range(qualities, name), [q for q in qualities if q.channel == name]
        if part is not None:
            largest = max(each.measures.rmse for each in alike) / range_of(alike)
            worst = f" (worst run {percent(largest)})" if len(alike) > 1 else ""
            parts.append(f"{name} to {percent(part)}{'' if parts else ' of its range'}{worst}")
    return listed(parts) or "channels that never move"


def _maneuvers(experiments: Sequence[Experiment]) -> str:
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


def _validity(assessments: Sequence[Assessment], tested: Sequence[Experiment]) -> str:
    """What the fit holds for, and what of the drive the fitted runs never reach."""
    experiments = fitted_runs(assessments)
    said = f"Holds for {_maneuvers(tested)}"
    if isinstance(assessments[-1].stage.problem.model, DriveModel):
        parameters = assessments[-1].stage.drive.parameters
        try:
            reached = set().union(*(limits_reached(each, parameters) for each in experiments))
        except (DomainError, InputError):
            return f"{said}."
        never = [
            words for name, words in LIMITS.items() if not any(r.startswith(name) for r in reached)
        ]
        never += [
            f"{LIMITS[name]} in {way} direction"
            for name in ("Z13", "Z16")
            for side, other, way in (("plus", "minus", "positive"), ("minus", "plus", "negative"))
            if f"{name}_{side}" not in reached and f"{name}_{other}" in reached
        ]
        if never:
            said += f"; never reached: {listed(never)}"
    return f"{said}."


def _assumptions(misfit: LackOfFit | None) -> tuple[str, ...]:
    """What cannot be checked, in sentences."""
    if misfit is None:
        return ()
    units = [f"The estimates are in units of the fixed {listed(misfit.units)}."]
    return (*(units if misfit.units else ()), *(f"{each.assumption}." for each in misfit.assumed))
