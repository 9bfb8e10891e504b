"""Assessing control over many seaways, and looking for what would do if it fails."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import pi, sqrt
from typing import Any

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
    all_of,
    assessed_limits,
    share_worse,
)
from swashplate.crane.studies.following import follow
from swashplate.crane.studies.run_outcome import RunOutcome
from swashplate.crane.studies.spectral import linear_response
from swashplate.crane.studies.study import NONE, Case, Controllers, Study
from swashplate.drive import Limit
from swashplate.errors import InputError
from swashplate.tables import count

SEAWAYS = 120
"""Seaways that are assessed by default: 72 are the least that can tell an allowed share of 5 %, 110
if one of them leaves the model with and without control."""
FACTORS = (1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0)
"""Factors on an in-line orifice that are tried, the smallest first."""
SHARES = (0.8, 0.6, 0.4)
"""Shares of what the luff can follow at which control is clipped on trial, the largest first."""
ACTS = 0.05
"""Share of time from which on a drive's acceleration limit is worth a larger orifice."""
BLOCK = 20
"""Seaways of a trial after which it is given up if it has failed already."""


def assess(
    crane: Crane,
    control: Controllers,
    *,
    allowed: float = 0.05,
    asked: Sequence[Question] | None = None,
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
    allowed : float
        Share of seaways in which control may be worse than none.
    asked : sequence of {"harm", "sufficiency"}, optional
        Questions that `Assessment.passed` answers; by default both, or harm alone if the crane has
        no limits.
    remedies : bool
        Whether to look for a larger orifice and for a clip that would do on the crane's own drives,
        if control fails: the least of each that surely does, else the least that may.
    tipping_points : bool
        Whether to look for assumed or given numbers that would turn the answer.
    **study
        Seaways, drives, stick, where each run begins: see `Study.of`. The verdict is on the last of
        the drives.

    Raises
    ------
    InputError
        For a share out of range, a question that there is not, or sufficiency without limits.
    """
    _check_allowed(allowed)
    questions = _questions(crane, asked)
    asked_study = Study.of(crane, control, **{"seeds": range(SEAWAYS), **study})
    none = asked_study.cases[NONE]
    outcomes = tuple(asked_study.outcomes(list(asked_study.cases.values())))
    linear = None
    if none.swing_damping > 0.0:
        linear = linear_response(crane, asked_study.seaway, **none.pose, **none.hangs)
    assessment = Assessment(asked_study, outcomes, allowed, questions, linear)
    if (
        tipping_points and none.swing_damping > 0.0
    ):  # of an undamped swing there is no stationary answer
        limits = crane.limits_si if "sufficiency" in questions else {}
        assessment = replace(
            assessment,
            tipping_points=tipping_points_of(asked_study, assessment.assessed_variant, limits),
        )
    if assessment.outcome == "fails" and remedies:
        return _with_remedies(assessment)
    return assessment


def _check_allowed(allowed: float) -> None:
    if not 0.0 <= allowed < 1.0:
        raise InputError(
            f"allowed is {allowed:g}, but is a share of seaways: 0 to below 1, or below 100 %."
        )


def _questions(crane: Crane, asked: Sequence[Question] | None) -> tuple[Question, ...]:
    if asked is None:
        return QUESTIONS if crane.limits else QUESTIONS[:1]
    check_names("There is no question", asked, QUESTIONS)
    if "sufficiency" in asked and not crane.limits:
        raise InputError(
            f"{crane.name} has no limits to suffice for: give its file a table [limits], as "
            '[limits] with side_lead = { value = 4, unit = "deg" }.'
        )
    return tuple(asked)


def seaways_needed(seaways: int, allowed: float) -> str:
    """What a number of seaways can decide, in a sentence to print before they are run."""
    _check_allowed(allowed)
    needed = fewest_seaways(allowed)
    if seaways >= needed:
        return (
            f"{count(seaways, 'seaway')} can show that control does no harm: {needed} are needed "
            f"at least for {100.0 * allowed:g} %."
        )
    return (
        f"{count(seaways, 'seaway')} cannot show that control does no harm: {needed} are needed at "
        f"least for {100.0 * allowed:g} %."
    )


def _with_remedies(assessment: Assessment) -> Assessment:
    """The assessment with what would do, of larger orifices and of clips."""
    study, case = assessment.study, assessment.study.cases[assessment.assessed_variant]
    controller = case.options["control"]
    if not case.driven or controller is None:
        return assessment
    # factors are of the crane as it is built, whatever was assessed
    cranes = (study.crane,) if len(case.cranes) == 1 else case.cranes
    found: list[Remedy] = []
    tried: list[str] = []
    for trials in (
        _larger_orifices(assessment, cranes, controller),
        _clips(case, cranes, controller),
    ):
        remedies = _tried(assessment, trials)
        tried += [what for what, *_ in trials[: len(remedies)]]
        passing = [remedy for remedy in remedies if remedy is not None and remedy.passes]
        tried = tried[: len(tried) - len(passing)]
        found += _least([remedy for remedy in remedies if remedy is not None])
    named = [remedy.what for remedy in found]
    others = [what for what in tried if what not in named]
    return replace(assessment, remedies=tuple(found), tried=tuple(others))


def _least(remedies: list[Remedy]) -> list[Remedy]:
    """The least that does no harm, and the least that passes; else the least that may do."""
    harmless = [remedy for remedy in remedies if remedy.harmless == "yes"]
    passing = [remedy for remedy in harmless if remedy.passes]
    if harmless:
        return list(dict.fromkeys([harmless[0], *passing[:1]]))
    return remedies[:1]


Trial = tuple[str, float, Case]


def _larger_orifices(
    assessment: Assessment, cranes: tuple[Crane, ...], controller: Control
) -> list[Trial]:
    """Larger orifices of the drive whose acceleration limit acts the longest, if one does."""
    case = assessment.study.cases[assessment.assessed_variant]
    shares = {
        axis: assessment.acting(assessment.assessed_variant, axis, Limit.ORIFICE) for axis in AXES
    }
    axis = max(shares, key=lambda name: float(np.nan_to_num(shares[name])))
    if not shares[axis] >= ACTS:
        return []
    trials = []
    for factor in FACTORS:
        larger = tuple(with_design_change(crane, axis, {"orifice": factor}) for crane in cranes)
        trial = case.changed(control=controller)._replace(cranes=larger)
        trials.append((f"{axis} orifice ×{factor:g}", factor, trial))
    return trials


def _clips(case: Case, cranes: tuple[Crane, ...], controller: Control) -> list[Trial]:
    """Clips at shares of what the luff can follow at the load's period."""
    stages = [stage for stage in controller.stages if not isinstance(stage, Clip | PositionLoop)]
    present = [stage.share for stage in controller.stages if isinstance(stage, Clip)]
    period = 2.0 * pi * sqrt(case.pose["rope_m"] / GRAVITY)
    reach = float(follow(cranes[0], [period], seas=(), **case.pose).amplitude[0, 2])
    trials = []
    for share in SHARES:
        if present and share >= present[0]:
            continue  # what is assessed has that clip already
        control = Chain((*stages, Clip(share=share), LOOP))
        trial = case.changed(control=control)._replace(cranes=cranes)
        trials.append((f"a clip of {share * reach:.2g} m", share * reach, trial))
    return trials


def _tried(assessment: Assessment, trials: Sequence[Trial]) -> list[Remedy | None]:
    """Trials up to the first that passes; None for one that harms, or does not help on."""
    remedies: list[Remedy | None] = []
    harmless = False
    for what, size, case in trials:
        remedy = _trial(assessment, what, size, case, only_if_sufficient=harmless)
        remedies.append(remedy)
        if remedy is not None and remedy.passes:
            break
        harmless = harmless or (remedy is not None and remedy.harmless == "yes")
    return remedies


def _trial(
    assessment: Assessment, what: str, size: float, case: Case, *, only_if_sufficient: bool
) -> Remedy | None:
    """A trial in all seaways; None as soon as it surely harms, or surely is not sufficient."""
    none, seaways = assessment.of(NONE), len(assessment.study.seeds)
    asked = "sufficiency" in assessment.asked
    limits = assessment.study.crane.limits_si if asked else {}
    outcomes: list[RunOutcome] = []
    for first in range(0, seaways, BLOCK):
        block = range(first, min(first + BLOCK, seaways))
        outcomes += [found for (found,) in assessment.study.outcomes([case], block)]
        worse = share_worse(outcomes, none[: len(outcomes)])
        limited = assessed_limits(outcomes, limits)
        decisions = [quantity.within for quantity in limited]
        if worse.value * len(outcomes) > assessment.allowed * seaways:
            return None
        if only_if_sufficient and "no" in decisions:
            return None
    swing = rms_of(np.array([outcome.rms_swing for outcome in outcomes]))
    return Remedy(
        what=what,
        size=size,
        harmless="yes" if worse.high <= assessment.allowed else "not decided",
        sufficient=all_of(decisions) if asked else None,
        worse=worse,
        swing=swing,
        beyond=tuple(quantity.words() for quantity in limited if quantity.within == "no"),
    )
