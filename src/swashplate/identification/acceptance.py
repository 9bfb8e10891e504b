"""Acceptance criteria and verdict: what a fit can be used for, and why not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import inf, isfinite
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from swashplate.campaign.experiment import Experiment
from swashplate.errors import DomainError, InputError
from swashplate.identification.data_checks import contradicting_runs
from swashplate.identification.drive_model import DriveModel
from swashplate.identification.identifiability import WIDE, listed
from swashplate.identification.intervals import unbounded_predictions
from swashplate.identification.lack_of_fit import (
    EXPLAINS,
    LackOfFit,
    lack_of_fit,
    measurement_error,
)
from swashplate.identification.solving import StartResult
from swashplate.identification.validation import pooled, with_speeds
from swashplate.results import Result, short

if TYPE_CHECKING:
    from swashplate.identification.assessment import Assessment
    from swashplate.identification.validation import Measures, RunQuality
    from swashplate.tables import Table

Rules = Literal["use", "values"]

POOR = 0.5
"""NRMSE from which a drive is not usable: a constant gain does better on a step's record."""
SERIOUS = 0.2
"""NRMSE below which held-out runs that are simulated less well than fitted ones are still of use:
80 % of the movement is followed, about what Kruse (2001) reached on his worst kind of test."""
CARRIES_OVER = 1.5
"""Factor on the fitted runs' RMSE up to which held-out runs count as simulated alike: maneuvers
differ that much among the fitted ones."""
FAR = 3.0
"""Factor from which the fit does not carry over: twice the normal difference between maneuvers."""
REQUIRED = 0.10
"""Largest error of held-out runs over their range, where the user requires nothing else."""
MOST = 0.5
"""Share of parameters without a value of their own from which a fit has found nothing."""
MOVES = 0.05
"""A run that moves by less than this part of the channel's movement is not judged by itself; where
the measurement error is known, by less than five times that."""
MISFIT = 1.2
"""Residuals over their known measurement error from which there is lack of fit: 37 of 39 sound
campaigns of slew lay between 0.97 and 1.02; in two the search ended in another optimum."""
MODEL_ERROR = 0.01
"""Error of held-out runs over their range from which lack of fit rules out prediction: what is
wrong is not small on known maneuvers, and larger on others."""
DRIFTS, DRIFTS_AWAY = 0.01, 0.03
"""Change of a channel over the campaign from which values are those of a mean machine, and from
which no one set of parameters holds."""
FOLLOWS = 0.5
"""Correlation of residuals with the input that counts as model error: a quarter of their square."""
BANDS = 1.35
"""And how many of its 95 % bands it must reach: where a band is wide, about six independent looks
fit into the lags, and the largest of them stays below that."""
SURE = 0.9
"""A correlation from which no band is asked: in short runs of one slow movement it reaches 1."""
SAME = 1e-6
"""Costs that differ by less than this part are the same optimum."""


SIGNIFICANT = 5.0
"""Standard errors from which a fault's size is taken for one: a dozen are looked at in each fit."""


class Criterion(NamedTuple):
    """An acceptance criterion, applied."""

    name: str
    value: str
    """What was found, as it is printed."""
    limit: str
    reason: str
    """Why the limit is where it is."""
    rules: Rules
    """What is ruled out by a failure: any use, or the parameters' values."""
    failure: str = ""
    """Clause that says what is wrong; empty where it is passed."""

    @property
    def passed(self) -> bool:
        """Whether it is met."""
        return not self.failure


def range_of(qualities: Sequence[RunQuality]) -> float:
    """Largest less smallest value that was measured of a channel in some runs."""
    counted = [x.values[x.used] for x in (each.experiment[each.channel] for each in qualities)]
    return max(float(x.max()) for x in counted) - min(float(x.min()) for x in counted)


def part_of_range(qualities: Sequence[RunQuality], channel: str) -> float | None:
    """RMSE of a channel over the range that was measured of it, all runs together.

    None where nothing moved.
    """
    alike = [each for each in qualities if each.channel == channel]
    reach = range_of(alike)
    return pooled(alike)[channel].rmse / reach if reach > 0.0 else None


def percent(part: float) -> str:
    """A part in per cent, two digits."""
    number = 100.0 * part
    return f"{number:.0f} %" if number >= 9.95 else f"{number:.2g} %"


def convergence(assessments: Sequence[Assessment], planned: Sequence[str]) -> list[Criterion]:
    """That each stage came to its end."""
    made = []
    why = "before the optimum neither values nor intervals are meaningful"
    for each in assessments:
        name, solution = each.stage.stage.name, each.stage.solution
        state, failure = "converged", ""
        if solution.interrupted:
            state = "interrupted"
            failure = f"stage {name} was interrupted, and its best so far is no optimum"
        elif not solution.converged:
            state = "not converged"
            failure = f"stage {name} did not converge ({solution.message})"
        made.append(Criterion(f"convergence of {name}", state, "converged", why, "use", failure))
    done = {each.stage.stage.name for each in assessments}
    missing = [name for name in planned if name not in done] if assessments else []
    if missing:
        failure = f"{listed(missing)} {'were' if len(missing) > 1 else 'was'} never fitted"
        made.append(Criterion("stages", f"{len(missing)} missing", "all", why, "use", failure))
    return made


def followed(qualities: Sequence[RunQuality], which: str) -> Criterion:
    """That each channel follows the movement at all."""
    errors = {name: found for name, found in pooled(qualities).items() if found.nrmse is not None}
    clauses = []
    for name, found in errors.items():
        if (found.nrmse or 0.0) >= POOR:
            words = (
                "is simulated no better than by its mean"
                if (found.nrmse or 0.0) >= 1.0
                else "misses at least half of the movement"
            )
            clauses.append(f"{name} {words} in the {which} runs (fit {found.fit_percent:z.0f} %)")
    largest = max((each.nrmse or 0.0 for each in errors.values()), default=0.0)
    return Criterion(
        f"RMSE / standard deviation, {which}",
        percent(largest),
        percent(POOR),
        "a constant gain does better on a step's record",
        "use",
        "; ".join(clauses),
    )


def no_worse_than_mean(qualities: Sequence[RunQuality], which: str) -> Criterion:
    """That no run that moves is simulated no better than by its own mean."""
    found = pooled(qualities)
    worse = [each for each in qualities if _is_worse(each, found[each.channel])]
    failure = ""
    if worse:
        names = listed(list(dict.fromkeys(each.experiment.name for each in worse)))
        failure = (
            f"{worse[0].channel} is simulated no better than by its mean in {names}: it "
            "contradicts the other runs, or shows what the model has not"
        )
    return Criterion(
        f"{which} runs worse than mean",
        f"{len(worse)}",
        "0",
        "such a run belongs to another machine, or the model lacks what moves it",
        "use",
        failure,
    )


def _is_worse(quality: RunQuality, pool: Measures) -> bool:
    own, channel = quality.measures, quality.experiment[quality.channel]
    error = measurement_error(channel)
    range_ = float(np.ptp(channel.values[channel.used]))
    moves = own.spread > MOVES * pool.spread if error is None else range_ > 5.0 * error
    return moves and (own.nrmse or 0.0) >= 1.0


def required_accuracy(held: Sequence[RunQuality], required: float) -> Criterion:
    """That the error of the runs predicted is what the user can live with."""
    parts = {name: part_of_range(held, name) for name in pooled(held)}
    worst = max((each for each in parts.values() if each is not None), default=0.0)
    late = [name for name, part in parts.items() if part is not None and part > required]
    failure = ""
    if late:
        failure = f"predicts {late[0]} to {percent(worst)} of its range only"
    return Criterion(
        "error / range, runs predicted",
        percent(worst),
        percent(required),
        "what is required of the model (--require)",
        "use",
        failure,
    )


def held_over_fitted(
    fitted: Sequence[RunQuality], held: Sequence[RunQuality]
) -> dict[str, tuple[float, float]]:
    """RMSE of held-out over that of fitted runs, and NRMSE of held-out ones, by channel."""
    reference = pooled(fitted)
    return {
        name: (found.rmse / reference[name].rmse, found.nrmse)
        for name, found in pooled(held).items()
        if name in reference and reference[name].rmse > 0.0 and found.nrmse is not None
    }


def carried_over(fitted: Sequence[RunQuality], held: Sequence[RunQuality]) -> Criterion:
    """That runs that were held out are simulated about as well as those that were fitted."""
    serious = {
        name: ratio
        for name, (ratio, nrmse) in held_over_fitted(fitted, held).items()
        if nrmse >= SERIOUS
    }
    largest = max(serious.values(), default=0.0)
    return Criterion(
        "RMSE, held-out / fitted",
        f"{largest:.2g}" if largest else "small",
        f"{FAR:g}",
        "twice the normal difference between maneuvers",
        "use",
        "; ".join(
            f"held-out {name} has {ratio:.1f} times the RMSE of the fitted runs"
            for name, ratio in serious.items()
            if ratio > FAR
        ),
    )


def consistent(assessments: Sequence[Assessment]) -> Criterion:
    """That no run contradicts the others, by its sign or scale."""
    found = []
    if isinstance(assessments[-1].stage.problem.model, DriveModel):
        found = contradicting_runs(fitted_runs(assessments), assessments[-1].stage.drive.parameters)
    names = list(dict.fromkeys(str(each.run) for each in found))
    return Criterion(
        "runs contradicting others",
        f"{len(names)}",
        "0",
        "its data are of another machine, unit or sign, and bias all estimates",
        "use",
        f"{listed(names)} contradicts the other runs ({found[0].sentence.rstrip('.')})"
        if found
        else "",
    )


def determined(assessments: Sequence[Assessment]) -> Criterion:
    """That most unknowns that all runs share have values of their own."""
    lost, total = 0, 0
    for each in assessments:
        shared = {unknown.name for unknown in each.stage.problem.unknowns if unknown.run is None}
        found = each.identifiability
        lost += len(shared & {*found.at_bounds, *found.to_fix})
        total += len(shared)
    words = f"{lost} of {total} parameters are at a bound or not determined"
    return Criterion(
        "parameters without a value",
        f"{lost} of {total}",
        f"{MOST:.0%}",
        "a fit that determines few of its parameters has found nothing",
        "use",
        words if lost > MOST * total else "",
    )


def bounded_predictions(
    assessments: Sequence[Assessment], predicted: Sequence[RunQuality]
) -> Criterion:
    """That what is predicted depends on nothing that the fitted runs leave open."""
    runs = {each.experiment.name: each.experiment for each in predicted}.values()
    names = unbounded_predictions(assessments, list(runs))
    return Criterion(
        "predictions left open",
        listed(names) or "none",
        "none",
        "the prediction is then as uncertain as the parameter",
        "use",
        f"predictions depend on {listed(names)}, which the fitted runs leave open" if names else "",
    )


def misfit_criteria(misfit: LackOfFit, judged: Sequence[RunQuality]) -> list[Criterion]:
    """That residuals are no larger than the known measurement error, and follow no fault."""
    made = []
    likely = "; ".join(each.cause for each in misfit.causes)
    for name, ratio in misfit.ratios.items():
        shown = [each for each in pooled(judged) if each in (name, f"speed from {name}")]
        error = max((part_of_range(judged, each) or 0.0 for each in shown), default=0.0)
        worst = max((e for e in misfit.runs if e.channel == name), key=lambda e: e.ratio)
        words = (
            f"residuals of {name} are {ratio:.3g} times their known measurement error, most in "
            f"{worst.run}{f' (likely: {likely})' if likely else ''}"
        )
        fails = ratio > MISFIT
        made.append(
            Criterion(
                f"lack of fit of {name}",
                f"{ratio:.3g}",
                f"{MISFIT:g}",
                "sound campaigns lie between 0.97 and 1.02",
                "use" if fails and error > MODEL_ERROR else "values",
                words if fails else "",
            )
        )
    for fault in misfit.faults:
        significant = abs(fault.size) > SIGNIFICANT * fault.standard_error
        size = f"{fault.size:+.2g} {fault.unit}"
        if fault.name.startswith("drift of "):
            part = abs(fault.size) / 100.0
            drifts = significant and part > DRIFTS and fault.share > EXPLAINS
            made.append(
                Criterion(
                    fault.name.removesuffix(" over the campaign"),
                    size,
                    percent(DRIFTS),
                    "no single set of parameters describes a machine that changes",
                    "use" if part > DRIFTS_AWAY else "values",
                    f"{fault.name} by {size}" if drifts else "",
                )
            )
        elif isfinite(fault.plausible) and not fault.hidden:
            beyond = abs(fault.size) > fault.plausible / 3.0
            wrong = beyond and significant and fault.share > EXPLAINS
            made.append(
                Criterion(
                    fault.name,
                    size if wrong or not beyond else "not seen",
                    f"{fault.plausible / 3.0:.2g} {fault.unit}",
                    "a larger error would be visible in these logs",
                    "values",
                    f"{fault.name} off by {size}" if wrong else "",
                )
            )
    if misfit.clipped:
        made.append(
            Criterion(
                "clipped channels",
                f"{len(misfit.clipped)}",
                "0",
                "values beyond it were not measured, and bias the fit",
                "use",
                misfit.clipped[0].rstrip("."),
            )
        )
    return made


def model_error(qualities: Sequence[RunQuality]) -> Criterion:
    """That large residuals do not follow the input, which is the mark of a model error."""
    clauses, strongest = [], 0.0
    for name, found in pooled(qualities).items():
        tests, related = following(qualities, name)
        strongest = max([strongest, *map(abs, related)])
        error = found.nrmse or 0.0
        # from POOR on its disagreement is a reason already
        if SERIOUS <= error < POOR and 2 * len(related) > tests:
            clauses.append(
                f"the residuals of {name} follow the input and are {percent(error)} of its "
                "movement: the model leaves out something that the input causes"
            )
    return Criterion(
        "residuals follow input",
        f"{strongest:.2f}" if strongest else "none",
        f"{FOLLOWS:g}",
        "what the input causes grows with it",
        "use",
        "; ".join(clauses),
    )


def following(qualities: Sequence[RunQuality], name: str) -> tuple[int, list[float]]:
    """Runs of a channel that were tested, and correlations with the input that stand out."""
    tests = [each.test for each in qualities if each.channel == name and each.test is not None]
    related = [
        each.peak[1]
        for each in tests
        if abs(each.peak[1]) >= min(max(FOLLOWS, BANDS * each.cross_band), SURE)
    ]
    return len(tests), related


def fitted_runs(assessments: Sequence[Assessment]) -> list[Experiment]:
    """The fitted runs of all stages, each once."""
    return list({e.name: e for a in assessments for e in a.stage.problem.experiments}.values())


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
        f"{name}: the measured signal never moves, so nothing can be judged."
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
        words = "No run was held out: the prediction of other tests was not checked."
        return Statement("Validation", "look", (words,))
    said, look = list[str](), False
    for name, (ratio, nrmse) in held_over_fitted(fitted, held).items():
        words = "no sign of overfitting"
        if ratio > CARRIES_OVER:
            look = True
            near = ratio <= FAR or nrmse < SERIOUS
            words = (
                "larger errors on other tests" if near else "the fit does not predict other tests"
            )
        said.append(
            f"{name}: the RMSE of held-out runs is {ratio:.2f} times that of fitted runs; {words} "
            f"(limit {CARRIES_OVER:g})."
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


def _validity(assessments: Sequence[Assessment]) -> str:
    """What the fit holds for, and what of the drive the fitted runs never reach."""
    from swashplate.identification.excitation import acting, simulated_run

    experiments = fitted_runs(assessments)
    said = f"Holds for {_maneuvers(experiments)}"
    if isinstance(assessments[-1].stage.problem.model, DriveModel):
        parameters, longest = assessments[-1].stage.drive.parameters, dict[str, float]()
        try:
            for each in experiments:
                for name, seconds in acting(simulated_run(each, parameters), parameters).items():
                    longest[name] = max(longest.get(name, 0.0), seconds)
        except (DomainError, InputError):
            return f"{said}."
        reached = {
            prefix: any(s > 0.0 for name, s in longest.items() if name.startswith(prefix))
            for prefix in LIMITS
        }
        never = [words for prefix, words in LIMITS.items() if not reached[prefix]]
        never += [
            f"{words} in {'negative' if sign == 'minus' else 'positive'} direction"
            for prefix, words in LIMITS.items()
            for sign in ("plus", "minus")
            if reached[prefix] and longest.get(f"{prefix}_{sign}", 1.0) == 0.0
        ]
        if never:
            said += f"; never reached: {listed(never)}"
    return f"{said}."


LIMITS: Mapping[str, str] = {
    "Z13": "the swash plate's stop Z13",
    "Z14": "the spool's stop Z14",
    "Z15": "the relief valve Z15",
    "Z16": "the orifices' limit Z16",
}
"""What a drive may never have reached in the fitted runs, by symbol."""


def _assumptions(misfit: LackOfFit | None) -> tuple[str, ...]:
    """What cannot be checked, in sentences."""
    if misfit is None:
        return ()
    units = [f"The estimates are in units of the fixed {listed(misfit.units)}."]
    return (*(units if misfit.units else ()), *(f"{each.assumption}." for each in misfit.assumed))
