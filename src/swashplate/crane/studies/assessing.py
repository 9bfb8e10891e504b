"""Assessment of control over many seaways, and a search for what would do if it fails."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import pi, sqrt
from typing import Any, NamedTuple

import numpy as np

from swashplate.crane.axes import AXES, check_names
from swashplate.crane.control import Chain, Clip, Control, PositionLoop
from swashplate.crane.crane import Crane
from swashplate.crane.rope import GRAVITY
from swashplate.crane.sea.confidence import fewest_seaways, rms_of
from swashplate.crane.studies.assumptions import tipping_points_of
from swashplate.crane.studies.changed_drives import with_design_change
from swashplate.crane.studies.crane_assessment import (
    LOOP,
    QUESTIONS,
    Assessment,
    Question,
    Remedy,
    share_worse_of,
)
from swashplate.crane.studies.following import follow
from swashplate.crane.studies.judging import ALLOWED_SHARE, judge
from swashplate.crane.studies.run_outcome import RunOutcome
from swashplate.crane.studies.spectral import linear_response
from swashplate.crane.studies.study import NO_CONTROL, Case, Controllers, Study
from swashplate.drive import Limit
from swashplate.errors import InputError
from swashplate.tables import count

SEAWAYS = 120
"""Seaways that are assessed by default: an allowed share of 5 % needs 72 at least, and 110 if the
model is left in one of them with and without control."""
FACTORS = (1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0)
"""Factors on an in-line orifice that are tried, the smallest first."""
SHARES = (0.8, 0.6, 0.4)
"""Shares of what the luff can follow at which a clip is tried, the largest first."""
ACTS = 0.05
"""Share of time from which on a drive's acceleration limit is worth a larger orifice."""
BLOCK = 20
"""Seaways of a trial after which it is given up if it has failed already."""


def assess(
    crane: Crane,
    control: Controllers,
    *,
    allowed_share_worse: float = ALLOWED_SHARE,
    questions: Sequence[Question] | None = None,
    remedies: bool = True,
    tipping_points: bool = True,
    **study: Any,
) -> Assessment:
    """Assess control on sets of drives over seeded seaways, by default 120 of ten minutes.

    Parameters
    ----------
    crane : Crane
    control : Control or mapping of str to Control
        One controller, or several by name.
    allowed_share_worse : float
        Share of seaways in which control may be worse than none.
    questions : sequence of {"harm", "sufficiency"}, optional
        Questions that `Assessment.passed` answers; by default both, or only harm if the crane has
        no limits.
    remedies : bool
        Whether to look for a larger orifice and for a clip that would do on the crane's own drives,
        if control fails: the least of each that surely does, else the least that may.
    tipping_points : bool
        Whether to look for assumed or given numbers that would turn the answer.
    **study
        Seaways, drives, command, where each run begins: see `Study.of`. The verdict is on the last
        of the drives.

    Raises
    ------
    InputError
        For a share out of range, a question that there is not, or sufficiency without limits.
    """
    _check_allowed(allowed_share_worse)
    checked_questions = _questions(crane, questions)
    variants = Study.of(crane, control, **{"seeds": range(SEAWAYS), **study})
    none = variants.cases[NO_CONTROL]
    damped = none.swing_damping > 0.0  # an undamped swing has no stationary answer
    outcomes = tuple(variants.outcomes(list(variants.cases.values())))
    linear = None
    if damped:
        linear = linear_response(crane, variants.seaway, **none.pose, **none.hangs)
    assessment = Assessment(
        study=variants,
        outcomes=outcomes,
        allowed_share_worse=allowed_share_worse,
        questions=checked_questions,
        linear=linear,
    )
    if tipping_points and damped:
        limits = crane.limits_si if "sufficiency" in checked_questions else {}
        points = tipping_points_of(variants, assessment.assessed_variant, limits)
        assessment = replace(assessment, tipping_points=points)
    if assessment.outcome == "fails" and remedies:
        return _with_remedies(assessment)
    return assessment


def _check_allowed(allowed: float) -> None:
    if not 0.0 <= allowed < 1.0:
        raise InputError(
            f"allowed_share_worse is {allowed:g}, but must be a share of seaways: 0 to below 1, or "
            "below 100 %."
        )


def _questions(crane: Crane, questions: Sequence[Question] | None) -> tuple[Question, ...]:
    if questions is None:
        return QUESTIONS if crane.limits else QUESTIONS[:1]
    check_names("There is no question", questions, QUESTIONS)
    if "sufficiency" in questions and not crane.limits:
        raise InputError(
            f"{crane.name} has no limits by which control could be sufficient: give its file a "
            "table [limits], as "
            '[limits] with side_lead = { value = 4, unit = "deg" }.'
        )
    return tuple(questions)


def seaways_needed(seaways: int, allowed: float) -> str:
    """Say what a number of seaways can decide: a sentence to print before they are run."""
    _check_allowed(allowed)
    needed = fewest_seaways(allowed)
    if seaways >= needed:
        return (
            f"{count(seaways, 'seaway')} can show that control does no harm: {needed} or more are "
            f"needed for {100.0 * allowed:g} %."
        )
    return (
        f"{count(seaways, 'seaway')} cannot show that control does no harm: {needed} or more are "
        f"needed for {100.0 * allowed:g} %."
    )


def _with_remedies(assessment: Assessment) -> Assessment:
    """The assessment with the larger orifices and the clips that would be remedies."""
    case = assessment.study.cases[assessment.assessed_variant]
    control = case.options["control"]
    if not case.driven or control is None:
        return assessment
    # factors refer to the crane as it is built, whichever variant was assessed
    cranes = (assessment.study.crane,) if len(case.cranes) == 1 else case.cranes
    remedies: list[Remedy] = []
    failed: list[str] = []
    for trials in (_larger_orifices(assessment, cranes, control), _clips(case, cranes, control)):
        results = _results(assessment, trials)
        remedies += _least([result for result in results if result is not None])
        # the last one, if it passes, has not failed
        for trial, result in zip(trials, results, strict=False):
            if result is None or not result.passes:
                failed.append(trial.change)
    named = [remedy.change for remedy in remedies]
    others = [change for change in failed if change not in named]
    return replace(assessment, remedies=tuple(remedies), tried=tuple(others))


def _least(remedies: list[Remedy]) -> list[Remedy]:
    """The smallest remedy that does no harm and the smallest that passes.

    Without any that does no harm, the smallest of the others.
    """
    harmless = [remedy for remedy in remedies if remedy.harmless == "yes"]
    passing = [remedy for remedy in harmless if remedy.passes]
    if harmless:
        return list(dict.fromkeys([harmless[0], *passing[:1]]))
    return remedies[:1]


class RemedyTrial(NamedTuple):
    """A change that is tried."""

    change: str
    """Its description: ``"luff orifice ×1.5"``."""
    size: float
    """Factor on the orifice [1], or size of the clip [m]."""
    case: Case
    """The variant with that change."""


def _larger_orifices(
    assessment: Assessment, cranes: tuple[Crane, ...], control: Control
) -> list[RemedyTrial]:
    """Larger orifices of the drive whose acceleration limit acts the longest, if one does."""
    variant = assessment.assessed_variant
    case = assessment.study.cases[variant]
    shares = {axis: assessment.acting(variant, axis, Limit.ORIFICE) for axis in AXES}
    axis = max(shares, key=lambda name: float(np.nan_to_num(shares[name])))
    if not shares[axis] >= ACTS:
        return []
    trials = []
    for factor in FACTORS:
        larger = tuple(with_design_change(crane, axis, {"orifice": factor}) for crane in cranes)
        changed = case.changed(control=control)._replace(cranes=larger)
        trials.append(RemedyTrial(f"{axis} orifice ×{factor:g}", factor, changed))
    return trials


def _clips(case: Case, cranes: tuple[Crane, ...], control: Control) -> list[RemedyTrial]:
    """Trials of clips at shares of the amplitude that the luff can follow at the load's period.

    The assessed control, without its clip and position loop, is followed by the clip and a stiff
    position loop. Only clips smaller than that of the assessed control are tried.
    """
    stages = [stage for stage in control.stages if not isinstance(stage, Clip | PositionLoop)]
    present_shares = [stage.share for stage in control.stages if isinstance(stage, Clip)]
    pendulum_period = 2.0 * pi * sqrt(case.pose["rope_m"] / GRAVITY)
    followable = follow(cranes[0], [pendulum_period], seas=(), **case.pose)
    luff_amplitude = float(followable.amplitude[0, AXES.index("luff")])
    trials = []
    for share in SHARES:
        if present_shares and share >= present_shares[0]:
            continue
        size = share * luff_amplitude
        clipped = Chain((*stages, Clip(share=share), LOOP))
        changed = case.changed(control=clipped)._replace(cranes=cranes)
        trials.append(RemedyTrial(f"a clip of {size:.2g} m", size, changed))
    return trials


def _results(assessment: Assessment, trials: Sequence[RemedyTrial]) -> list[Remedy | None]:
    """Results of trials up to the first that passes.

    None for a trial that harms, and for one that does not pass after another did no harm.
    """
    results: list[Remedy | None] = []
    harmless = False
    for trial in trials:
        result = _result(assessment, trial, only_if_sufficient=harmless)
        results.append(result)
        if result is not None and result.passes:
            break
        harmless = harmless or (result is not None and result.harmless == "yes")
    return results


def _result(
    assessment: Assessment, trial: RemedyTrial, *, only_if_sufficient: bool
) -> Remedy | None:
    """Simulate a trial in all seaways; None as soon as it certainly harms.

    With `only_if_sufficient`, None also as soon as it certainly is not sufficient.
    """
    uncontrolled = assessment.of(NO_CONTROL)
    seaways = len(assessment.study.seeds)
    is_sufficiency_question = "sufficiency" in assessment.questions
    limits = assessment.study.crane.limits_si if is_sufficiency_question else {}
    outcomes: list[RunOutcome] = []
    for first in range(0, seaways, BLOCK):
        block = range(first, min(first + BLOCK, seaways))
        outcomes += [outcome for (outcome,) in assessment.study.outcomes([trial.case], block)]
        share_worse = share_worse_of(outcomes, uncontrolled[: len(outcomes)])
        judgement = judge(
            outcomes,
            limits,
            length=assessment.study.length,
            allowed=assessment.allowed_share_worse,
        )
        if share_worse.value * len(outcomes) > assessment.allowed_share_worse * seaways:
            return None
        if only_if_sufficient and judgement.sufficient == "no":
            return None
    swing = rms_of(np.array([outcome.rms_swing for outcome in outcomes]))
    return Remedy(
        change=trial.change,
        size=trial.size,
        harmless="yes" if share_worse.high <= assessment.allowed_share_worse else "not decided",
        sufficient=judgement.sufficient if is_sufficiency_question else None,
        share_worse=share_worse,
        swing=swing,
        beyond=tuple(
            quantity.description() for quantity in judgement.limited if quantity.within == "no"
        ),
    )
