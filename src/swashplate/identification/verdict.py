"""Verdict on a fit: acceptance criteria, and whether it is usable, for prediction only, or not."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from swashplate.campaign.experiment import Experiment
from swashplate.errors import DomainError, InputError
from swashplate.identification.data_checks import contradicting_runs
from swashplate.identification.drive_model import DriveModel, limits_reached
from swashplate.identification.identifiability import WIDE
from swashplate.identification.intervals import open_unknowns
from swashplate.identification.lack_of_fit import (
    LOSS,
    Fault,
    LackOfFit,
    lack_of_fit,
    measurement_error,
)
from swashplate.identification.solving import Solution
from swashplate.identification.validation import (
    FOLLOWS,
    following,
    part_of_range,
    percent,
    pooled,
    range_of,
    with_speeds,
)
from swashplate.results import Result
from swashplate.tables import listed

if TYPE_CHECKING:
    from swashplate.identification.assessment import Assessment
    from swashplate.identification.validation import Measures, RunQuality
    from swashplate.tables import Table

Grade = Literal["Usable", "Usable for prediction", "Not usable"]
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
the measurement error is known, by less than five times that beyond the range of the noise alone."""
STANDS_OUT = 5.0
MISFIT = 1.2
"""Residuals over their known measurement error from which there is lack of fit: 37 of 39 sound
campaigns of slew lay between 0.97 and 1.02; in two the search ended in another optimum."""
MODEL_ERROR = 0.01
"""Error of held-out runs over their range from which lack of fit rules out prediction: what is
wrong is not small on known maneuvers, and larger on others."""
DRIFTS, DRIFTS_AWAY = 0.01, 0.03
"""Change of a channel over the campaign from which values are those of a mean machine, and from
which no one set of parameters holds."""
SAME = 1e-6
"""Costs that differ by less than this part are the same optimum."""
LIMITS: Mapping[str, str] = {
    "Z13": "the swash plate's stop Z13",
    "Z14": "the spool's stop Z14",
    "Z15": "the relief valve Z15",
    "Z16": "the orifices' limit Z16",
}
"""What a drive may never have reached in the fitted runs, by symbol."""


class Criterion(NamedTuple):
    """An acceptance criterion, applied."""

    name: str
    value: str
    """What was found, as it is printed."""
    limit: str
    reason: str
    """Why the limit is where it is; of one that was not judged, why not."""
    rules: Rules = "use"
    """What is ruled out by a failure: any use, or the parameters' values."""
    failure: str = ""
    """Clause that says what is wrong; empty where nothing is."""
    judged: bool = True
    """Whether the data allow to judge it."""

    @property
    def state(self) -> Literal["met", "not met", "not judged"]:
        """What came of it."""
        return "not met" if self.failure else "met" if self.judged else "not judged"


@dataclass(frozen=True)
class Verdict(Result):
    """The judgement on a fit, or on a drive over some runs."""

    headline: str
    """One sentence."""
    criteria: tuple[Criterion, ...] = ()
    grade: Grade = "Usable"
    sentences: tuple[str, ...] = ()
    """What asks for attention and is no criterion, and what was not judged."""
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
    def not_judged(self) -> tuple[str, ...]:
        """A sentence for each criterion that was not judged, with what would allow it."""
        return tuple(
            f"Not judged: {each.name}, as {each.reason}."
            for each in self.criteria
            if each.state == "not judged"
        )


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
        the parameters' values do. A criterion that the data do not allow to judge rules out
        nothing, and says what would be needed.

    Notes
    -----
    A position is judged by its speed where it has one: of a position nearly everything is its
    trend.
    """
    fitted = _judged([each for assessment in assessments for each in assessment.runs])
    held = _judged(predicted)
    own = [each for assessment in assessments for each in assessment.runs] or predicted
    misfit = None
    criteria = [*_convergence(assessments, planned)]
    for which, qualities in (
        ("fitted", fitted),
        ("held-out" if assessments else "predicted", held),
    ):
        if qualities:
            criteria += [_followed(qualities, which), _no_worse_than_mean(qualities, which)]
    criteria.append(_required_accuracy(held, required))
    if assessments:
        criteria += [
            _carried_over(fitted, held),
            _consistent(assessments),
            _determined(assessments),
            _bounded_predictions(assessments, predicted),
        ]
        try:
            misfit = lack_of_fit(assessments)
            criteria += _misfit_criteria(misfit, held or fitted, assessments)
        except InputError as error:
            why = str(error).rstrip(".")
            criteria.append(Criterion("lack of fit", "-", f"{MISFIT:g}", why, judged=False))
    criteria.append(_model_error(own))
    failed = {
        rules: [each for each in criteria if each.failure and each.rules == rules]
        for rules in ("use", "values")
    }
    grade: Grade = (
        "Not usable" if failed["use"] else "Usable for prediction" if failed["values"] else "Usable"
    )
    tested = {each.name: each for each in _fitted_runs(assessments)}
    tested |= {each.experiment.name: each.experiment for each in held}
    experiments = list(tested.values())
    words = _headline(bool(assessments), fitted, held, failed, experiments)
    units = misfit.units if misfit is not None else ()
    assumed = [f"The estimates are in units of the fixed {listed(units)}."] if units else []
    assumed += [f"{each.assumption}." for each in (misfit.assumed if misfit is not None else ())]
    return Verdict(
        words,
        tuple(criteria),
        grade,
        tuple(_remarks(assessments, fitted, held, own, misfit)),
        _validity(assessments, experiments) if assessments else "",
        tuple(assumed),
    )


def _judged(qualities: Sequence[RunQuality]) -> list[RunQuality]:
    """With speeds in place of the positions that have one, speeds first."""
    found = with_speeds(qualities)
    named = {each.channel for each in found}
    kept = [each for each in found if f"speed from {each.channel}" not in named]
    return sorted(kept, key=lambda each: each.experiment[each.channel].kind != "shaft_speed")


def _fitted_runs(assessments: Sequence[Assessment]) -> list[Experiment]:
    """The fitted runs of all stages, each once."""
    return list({e.name: e for a in assessments for e in a.stage.problem.experiments}.values())


def starts_of(
    assessments: Sequence[Assessment], starts: Sequence[Solution] = ()
) -> dict[str, Sequence[Solution]]:
    """Starts by stage, of the stages that had several; or those given, under no name."""
    own: dict[str, Sequence[Solution]] = {
        each.stage.stage.name: each.stage.starts
        for each in assessments
        if len(each.stage.starts) > 1
    }
    return own or ({"": starts} if len(starts) > 1 else {})


def weak_unknowns(assessment: Assessment) -> list[str]:
    """Unknowns of the machine with an interval wider than 10 % of the value, or without one."""
    try:
        found = {each.name: each.relative_half_width for each in assessment.uncertainty.estimates}
    except InputError:
        found = {}
    machine = [each.name for each in assessment.stage.problem.unknowns if each.run is None]
    bounds = assessment.identifiability.at_bounds
    return [name for name in machine if found.get(name, inf) > WIDE and name not in bounds]


# --- criteria -------------------------------------------------------------------------------------


def _convergence(assessments: Sequence[Assessment], planned: Sequence[str]) -> Iterator[Criterion]:
    """That each stage came to its end."""
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
        yield Criterion(f"convergence of {name}", state, "converged", why, "use", failure)
    done = [each.stage.stage.name for each in assessments]
    missing = [name for name in planned if name not in done] if done else []
    if missing:
        failure = f"{listed(missing)} {'were' if len(missing) > 1 else 'was'} never fitted"
        yield Criterion("stages", f"{len(missing)} missing", "all", why, "use", failure)


def _followed(qualities: Sequence[RunQuality], which: str) -> Criterion:
    """That each channel follows the movement at all."""
    errors = {k: m.nrmse for k, m in pooled(qualities).items() if m.nrmse is not None}
    clauses = []
    for name, error in errors.items():
        words = "misses at least half of the movement"
        words = "is simulated no better than by its mean" if error >= 1.0 else words
        if error >= POOR:
            fits = 100.0 * (1.0 - error)
            clauses.append(f"{name} {words} in the {which} runs (fit {fits:z.0f} %)")
    return Criterion(
        f"RMSE / standard deviation, {which}",
        percent(max(errors.values(), default=0.0)),
        percent(POOR),
        "a constant gain does better on a step's record",
        "use",
        "; ".join(clauses),
    )


def _no_worse_than_mean(qualities: Sequence[RunQuality], which: str) -> Criterion:
    """That no run that moves is simulated no better than by its own mean."""
    found = pooled(qualities)
    worse = [each for each in qualities if _is_worse(each, found[each.channel])]
    runs: dict[str, list[str]] = {}
    for each in worse:
        runs.setdefault(each.channel, []).append(each.experiment.name)
    words = listed([f"{name} in {listed(names)}" for name, names in runs.items()])
    return Criterion(
        f"{which} runs worse than mean",
        f"{len(worse)}",
        "0",
        "such a run belongs to another machine, or the model lacks what moves it",
        "use",
        f"simulated no better than by the mean of the run: {words}, which contradicts the other "
        "runs, or shows what the model has not"
        if worse
        else "",
    )


def _is_worse(quality: RunQuality, pool: Measures) -> bool:
    own, channel = quality.measures, quality.experiment[quality.channel]
    error, values = measurement_error(channel), channel.values[channel.used]
    if error is None:
        moves = own.spread > MOVES * pool.spread
    else:
        # what noise alone reaches both ways in so many samples is no movement
        noise = 2.0 * np.sqrt(2.0 * np.log(max(values.size, 2)))
        moves = float(np.ptp(values)) > (STANDS_OUT + noise) * error
    return moves and (own.nrmse or 0.0) >= 1.0


def _required_accuracy(held: Sequence[RunQuality], required: float) -> Criterion:
    """That the error of the runs predicted is what the user can live with."""
    name, limit = "error / range, runs predicted", percent(required)
    if not held:
        why = 'no run was held out: set role = "validate" in one of its [[runs]]'
        return Criterion(name, "-", limit, why, judged=False)
    parts = {each: part_of_range(held, each) or 0.0 for each in pooled(held)}
    worst = max(parts.values())
    late = next((each for each, part in parts.items() if part > required), None)
    return Criterion(
        name,
        percent(worst),
        limit,
        "what is required of the model (--require)",
        "use",
        "" if late is None else f"predicts {late} to {percent(worst)} of its range only",
    )


def _held_over_fitted(
    fitted: Sequence[RunQuality], held: Sequence[RunQuality]
) -> dict[str, tuple[float, float]]:
    """RMSE of held-out over that of fitted runs, and NRMSE of held-out ones, by channel."""
    reference = pooled(fitted)
    return {
        name: (found.rmse / reference[name].rmse, found.nrmse)
        for name, found in pooled(held).items()
        if name in reference and reference[name].rmse > 0.0 and found.nrmse is not None
    }


def _carried_over(fitted: Sequence[RunQuality], held: Sequence[RunQuality]) -> Criterion:
    """That runs that were held out are simulated about as well as those that were fitted."""
    found = _held_over_fitted(fitted, held)
    serious = {name: ratio for name, (ratio, nrmse) in found.items() if nrmse >= SERIOUS}
    largest = max(serious.values(), default=0.0)
    name, limit = "RMSE, held-out / fitted", f"{FAR:g}"
    if not found:
        return Criterion(name, "-", limit, "no held-out run moves", judged=False)
    return Criterion(
        name,
        f"{largest:.2g}" if largest else "small",
        limit,
        "twice the normal difference between maneuvers",
        "use",
        "; ".join(
            f"held-out {name} has {ratio:.1f} times the RMSE of the fitted runs"
            for name, ratio in serious.items()
            if ratio > FAR
        ),
    )


def _consistent(assessments: Sequence[Assessment]) -> Criterion:
    """That no run contradicts the others, by its sign or scale."""
    name, last = "runs contradicting others", assessments[-1].stage
    if not isinstance(last.problem.model, DriveModel):
        why = "signs and scales of runs are compared through a drive, which this model is not"
        return Criterion(name, "-", "0", why, judged=False)
    found = contradicting_runs(_fitted_runs(assessments), last.drive.parameters)
    names = list(dict.fromkeys(str(each.run) for each in found))
    return Criterion(
        name,
        f"{len(names)}",
        "0",
        "its data are of another machine, unit or sign, and bias all estimates",
        "use",
        f"{listed(names)} contradicts the other runs ({found[0].sentence.rstrip('.')})"
        if found
        else "",
    )


def _determined(assessments: Sequence[Assessment]) -> Criterion:
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


def _bounded_predictions(
    assessments: Sequence[Assessment], predicted: Sequence[RunQuality]
) -> Criterion:
    """That what is predicted depends on nothing that the fitted runs leave open."""
    name = "predictions left open"
    if not predicted or not isinstance(assessments[-1].stage.problem.model, DriveModel):
        why = "no run was held out" if not predicted else "the model is none of a drive"
        return Criterion(name, "-", "none", why, judged=False)
    runs = {each.experiment.name: each.experiment for each in predicted}.values()
    names = listed(
        list(dict.fromkeys(n for each in assessments for n in open_unknowns(each, runs)))
    )
    return Criterion(
        name,
        names or "none",
        "none",
        "the prediction is then as uncertain as the parameter",
        "use",
        f"predictions depend on {names}, which the fitted runs leave open" if names else "",
    )


def _misfit_criteria(
    misfit: LackOfFit, judged: Sequence[RunQuality], assessments: Sequence[Assessment]
) -> Iterator[Criterion]:
    """That residuals are no larger than the known measurement error, and follow no fault."""
    likely = misfit.likely
    for name, ratio in misfit.ratios.items():
        shown = [each for each in pooled(judged) if each in (name, f"speed from {name}")]
        error = max((part_of_range(judged, each) or 0.0 for each in shown), default=0.0)
        worst = max((e for e in misfit.runs if e.channel == name), key=lambda e: e.ratio)
        words = (
            f"residuals of {name} are {ratio:.3g} times their known measurement error, most in "
            f"{worst.run}{f' (likely: {likely})' if likely else ''}"
        )
        fails = ratio > MISFIT
        yield Criterion(
            f"lack of fit of {name}",
            f"{ratio:.3g}",
            f"{MISFIT:g}",
            "sound campaigns lie between 0.97 and 1.02",
            "use" if fails and error > MODEL_ERROR else "values",
            words if fails else "",
        )
    for name in dict.fromkeys(name for each in assessments for name in each.stage.problem.channels):
        if name not in misfit.ratios:
            where = f"axes.{_fitted_runs(assessments)[0].axis}.channels.{name}"
            why = (
                "its measurement error is not known: state its standard deviation at rest in the "
                f"campaign file, by a line noise = ... in [{where}]"
            )
            yield Criterion(f"lack of fit of {name}", "-", f"{MISFIT:g}", why, judged=False)
    poor = any(ratio > MISFIT for ratio in misfit.ratios.values())
    wrong = next((each for each in misfit.faults if _is_wrong(each, poor)), None)
    for fault in misfit.faults:
        yield from _fault_criterion(fault, poor, wrong)
    if misfit.clipped:
        yield Criterion(
            "clipped channels",
            f"{len(misfit.clipped)}",
            "0",
            "values beyond it were not measured, and bias the fit",
            "use",
            misfit.clipped[0].rstrip("."),
        )


def _is_wrong(fault: Fault, poor: bool) -> bool:
    """Whether an instrument is off by more than a third of what occurs without notice.

    Where there is lack of fit, only a fault that explains it is told from what else is wrong.
    """
    told = isfinite(fault.plausible) and fault.visible and fault.significant
    return told and abs(fault.size) > fault.plausible / 3.0 and (fault.explains or not poor)


def _fault_criterion(fault: Fault, poor: bool, wrong: Fault | None) -> Iterator[Criterion]:
    """That a fault has no size that matters; none of a fault that is no criterion.

    Of several instruments that seem `wrong` the one that explains most is.
    """
    size = f"{fault.size:+.2g} {fault.unit}"
    explains = fault.significant and fault.explains
    if fault.name.startswith("drift of "):
        part = abs(fault.size) / 100.0
        drifts = part > DRIFTS and explains
        yield Criterion(
            fault.name.removesuffix(" over the campaign"),
            size if drifts or part <= DRIFTS else "not seen",
            percent(DRIFTS),
            "no single set of parameters describes a machine that changes",
            "use" if part > DRIFTS_AWAY else "values",
            f"{fault.name} by {size}" if drifts else "",
        )
    elif fault.lost:
        seen = explains and poor
        words = "does not follow the largest speeds, which looks like a stop of the machine"
        yield Criterion(
            fault.name,
            "seen" if seen else "not seen",
            "none",
            "a counter that does not follow looks like a stop of the machine",
            "use",
            f"{fault.name.removeprefix(LOSS)} {words}" if seen else "",
        )
    elif isfinite(fault.plausible) and fault.visible:
        value = "not seen" if abs(fault.size) > fault.plausible / 3.0 else size
        if wrong is not None and wrong is not fault and _is_wrong(fault, poor):
            value = f"see {wrong.name}"
        yield Criterion(
            fault.name,
            size if fault is wrong else value,
            f"{fault.plausible / 3.0:.2g} {fault.unit}",
            "a larger error would be visible in these logs",
            "values",
            f"{fault.words} off by {size}" if fault is wrong else "",
        )


def _model_error(qualities: Sequence[RunQuality]) -> Criterion:
    """That large residuals do not follow the input, which is the mark of a model error."""
    clauses, strongest, tested = [], 0.0, 0
    for name, found in pooled(qualities).items():
        tests, related = following(qualities, name)
        tested += tests
        strongest = max([strongest, *map(abs, related)])
        error = found.nrmse or 0.0
        # from POOR on its disagreement is a reason already
        if SERIOUS <= error < POOR and 2 * len(related) > tests:
            clauses.append(
                f"the residuals of {name} follow the input and are {percent(error)} of its "
                "movement: the model leaves out something that the input causes"
            )
    name, limit = "residuals follow input", f"{FOLLOWS:g}"
    if not tested:
        return Criterion(name, "-", limit, "the runs are shorter than 8 samples", judged=False)
    return Criterion(
        name,
        f"{strongest:.2f}{'' if clauses else ', but residuals small'}" if strongest else "none",
        limit,
        "what the input causes grows with it",
        "use",
        "; ".join(clauses),
    )


# --- words ----------------------------------------------------------------------------------------


def _remarks(
    assessments: Sequence[Assessment],
    fitted: Sequence[RunQuality],
    held: Sequence[RunQuality],
    own: Sequence[RunQuality],
    misfit: LackOfFit | None,
) -> Iterator[str]:
    """What asks for attention beside the criteria."""
    for name, found in pooled(fitted or held).items():
        if found.nrmse is None:
            yield f"{name}: the measured signal never moves, so nothing can be judged."
    if assessments and not held:
        yield "No run was held out: the prediction of other tests was not checked."
    for name, (ratio, _) in _held_over_fitted(fitted, held).items() if assessments else ():
        if ratio > CARRIES_OVER:
            yield (
                f"{name}: the RMSE of held-out runs is {ratio:.2f} times that of fitted runs: "
                f"larger errors on other tests (limit {CARRIES_OVER:g})."
            )
    for each in assessments:
        if wide := weak_unknowns(each):
            name = each.stage.stage.name
            yield f"{name}: not determined to within ±{percent(WIDE)}: {listed(wide)}."
    if misfit is not None:
        if misfit.likely and any(ratio > MISFIT for ratio in misfit.ratios.values()):
            yield f"Likely cause of the lack of fit: {misfit.likely}."
        yield from misfit.clipped
    for name in pooled(own):
        tests, related = following(own, name)
        if related:
            yield (
                f"{name}: the residuals of {len(related)} of {tests} runs follow the input "
                f"(correlation up to {max(related, key=abs):+.2f}): the model leaves out something "
                "that the input causes."
            )
    for stage, results in starts_of(assessments).items():
        costs = np.array([each.cost for each in results])
        best = float(costs.min())
        alike = int(np.count_nonzero(costs <= best * (1.0 + SAME)))
        yield f"{stage}: " + (
            f"{alike} of {len(results)} starts reached the best cost, {best:.6g}."
            if np.isfinite(best)
            else "No start ended with a finite cost."
        )


def _headline(
    is_fit: bool,
    fitted: Sequence[RunQuality],
    held: Sequence[RunQuality],
    failed: Mapping[str, Sequence[Criterion]],
    experiments: Sequence[Experiment],
) -> str:
    unusable, untrusted = ("; ".join(c.failure for c in failed[key]) for key in ("use", "values"))
    if unusable:
        return f"Not usable: {unusable}."
    if not is_fit:
        runs = len({each.experiment.name for each in held})
        return f"Predicts {_accuracy(held)} over {runs} run{'s' if runs > 1 else ''}."
    if untrusted:
        accuracy = f"{'held-out ' if held else 'fitted '}{_accuracy(held or fitted)}"
        return (
            f"Usable for prediction of {_maneuvers(experiments)} ({accuracy}); parameter values "
            f"not to be trusted because {untrusted}."
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
    said, stage = f"Holds for {_maneuvers(tested)}", assessments[-1].stage
    if not isinstance(stage.problem.model, DriveModel):
        return f"{said}."
    parameters, reached = stage.drive.parameters, set[str]()
    try:
        for each in _fitted_runs(assessments):
            reached |= limits_reached(each, parameters)
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
    return f"{said}; never reached: {listed(never)}." if never else f"{said}."
