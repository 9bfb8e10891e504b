"""The verdict on a fit in words: how good, how sure, what stands against it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from swashplate.errors import InputError
from swashplate.identification.assessment import Assessment, RunQuality
from swashplate.identification.fit import Fit
from swashplate.identification.measures import Measures
from swashplate.identification.starts import StartResult
from swashplate.report.display_units import display_unit
from swashplate.report.fit_page.numbers import count, listed, plain
from swashplate.report.fit_page.runs import ShownRun, conditions, pooled

Weight = Literal["good", "look", "plain"]
CARRIES_OVER = 1.5
"""Up to this factor on the fitted runs' RMSE, held-out runs count as simulated alike."""
SAME = 1e-6
"""Costs that differ by less than this part are the same optimum."""


class Statement(NamedTuple):
    """One subject of the verdict."""

    subject: str
    weight: Weight
    """``"look"`` where something asks for attention."""
    sentences: tuple[str, ...]


def verdict(
    fit: Fit,
    assessments: Sequence[Assessment],
    runs: Sequence[ShownRun],
    starts: Sequence[StartResult],
    findings: int,
) -> tuple[Statement, ...]:
    """The statements in the order in which the report gives them.

    Parameters
    ----------
    fit : Fit
        What was fitted.
    assessments : sequence of Assessment
        One for each stage.
    runs : sequence of ShownRun
        Fitted and held out.
    starts : sequence of StartResult
        If there were several.
    findings : int
        Findings about the campaign's data.
    """
    fitted, held = (
        [each.quality for run in runs if run.validates == out for each in run.channels]
        for out in (False, True)
    )
    made = [Statement("Agreement", "plain", quality_sentences(fitted))]
    made += [_convergence(fit), _bounds(assessments)]
    made += [_identifiability(assessments), _errors(assessments)]
    made.append(_validation(fitted, held))
    if len(starts) > 1:
        made.append(_starts(starts))
    if findings:
        text = f"{count(findings, 'finding')} on the campaign's data: see the section on them."
        made.append(Statement("Data", "look", (text,)))
    return tuple(made)


def measures_words(name: str, unit: str, found: Measures) -> str:
    """``current: fit 96.1 % (RMSE 7.6 mA, R² 0.9985)``."""
    shown = display_unit(unit, found.rmse)
    rmse = f"RMSE {plain(shown.factor * found.rmse, 3)} {shown.name}".rstrip()
    if found.fit_percent is None or found.r_squared is None:
        return f"{name}: {rmse}; what was measured is constant, so there is no fit %"
    return f"{name}: fit {found.fit_percent:.2f} % ({rmse}, R² {found.r_squared:.4f})"


def quality_sentences(qualities: Sequence[RunQuality]) -> tuple[str, ...]:
    """One sentence for each channel: fit %, and what must stand beside it."""
    said = []
    for name, found in pooled(qualities).items():
        runs = [each.experiment for each in qualities if each.channel == name]
        words = measures_words(name, runs[0][name].unit, found)
        said.append(
            f"{words} over {count(len(runs), 'run')}, {count(found.samples, 'sample')}; "
            f"{conditions(runs, name)}."
        )
    return tuple(said)


def _convergence(fit: Fit) -> Statement:
    said, good = [], len(fit.stages) == len(fit.setup.stages)
    for each in fit.stages:
        solution = each.solution
        state = (
            "interrupted, the best so far is kept"
            if solution.interrupted
            else "converged"
            if solution.converged
            else "not converged"
        )
        good = good and solution.converged and not solution.interrupted
        said.append(
            f"{each.stage.name}: {state} after {count(solution.evaluations, 'evaluation')} in "
            f"{solution.seconds:.2f} s, cost {plain(solution.start_cost)} → {plain(solution.cost)}."
        )
    missing = [each.name for each in fit.setup.stages[len(fit.stages) :]]
    if missing:
        said.append(f"Not fitted: {listed(missing)}.")
    return Statement("Convergence", "good" if good else "look", tuple(said))


def _bounds(assessments: Sequence[Assessment]) -> Statement:
    said = [
        f"{name} stands at its {side} bound: no symmetric interval is given for it."
        for each in assessments
        for name, side in each.stage.problem.unknowns.at_bounds(each.stage.solution.vector).items()
    ]
    if not said:
        return Statement("Bounds", "good", ("No unknown stands at a bound.",))
    return Statement("Bounds", "look", tuple(said))


def _identifiability(assessments: Sequence[Assessment]) -> Statement:
    said, look = list[str](), False
    for each in assessments:
        found = each.identifiability
        if not found.complete or found.faint:
            look = True
        kept = [words for words in found.sentences() if " bound: no interval" not in words]
        said += [f"{each.stage.stage.name}: {words}" for words in kept]
    return Statement("Identifiability", "look" if look else "good", tuple(said))


def _errors(assessments: Sequence[Assessment]) -> Statement:
    said = [
        f"{each.stage.stage.name}: {words}"
        for each in assessments
        for words in uncertainty_sentences(each)
    ]
    return Statement("Errors", "plain", tuple(said))


def uncertainty_sentences(assessment: Assessment) -> tuple[str, ...]:
    """What the intervals rest on, or why there are none."""
    try:
        return assessment.uncertainty.sentences()
    except InputError as error:
        return (f"There are no intervals: {error}",)


def _validation(fitted: Sequence[RunQuality], held: Sequence[RunQuality]) -> Statement:
    if not held:
        text = "No run was held out: how the fit carries over to other tests was not tried."
        return Statement("Validation", "look", (text,))
    said, good = list(quality_sentences(held)), True
    reference = pooled(fitted)
    for name, found in pooled(held).items():
        if name not in reference or reference[name].rmse == 0.0:
            continue
        ratio = found.rmse / reference[name].rmse
        good = good and ratio <= CARRIES_OVER
        over = "the fit carries over" if ratio <= CARRIES_OVER else "the fit does not carry over"
        said.append(
            f"{name}: the RMSE of held-out runs is {ratio:.2f} times that of fitted runs; {over} "
            f"(up to {CARRIES_OVER:g} counts as alike)."
        )
    return Statement("Validation", "good" if good else "look", tuple(said))


def _starts(starts: Sequence[StartResult]) -> Statement:
    costs = np.array([each.cost for each in starts])
    if not np.isfinite(costs).any():
        return Statement("Starts", "look", ("No start ended with a finite cost.",))
    best = float(costs[np.isfinite(costs)].min())
    reached = int(np.count_nonzero(costs <= best * (1.0 + SAME)))
    text = f"{reached} of {len(starts)} starts reached the best cost, {plain(best)}."
    return Statement("Starts", "good" if reached > 1 else "look", (text,))
