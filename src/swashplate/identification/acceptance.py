"""Acceptance criteria of a fit: value, limit, reason, and what a failure rules out."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from swashplate.campaign.experiment import Experiment
from swashplate.identification.data_checks import contradicting_runs
from swashplate.identification.drive_model import DriveModel
from swashplate.identification.intervals import unbounded_predictions
from swashplate.identification.lack_of_fit import (
    LOSS,
    Fault,
    LackOfFit,
    measurement_error,
)
from swashplate.identification.validation import pooled
from swashplate.tables import listed

if TYPE_CHECKING:
    from swashplate.identification.assessment import Assessment
    from swashplate.identification.validation import Measures, RunQuality

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
FOLLOWS = 0.5
"""Correlation of residuals with the input that counts as model error: a quarter of their square."""
BANDS = 1.35
"""And how many of its 95 % bands it must reach: where a band is wide, about six independent looks
fit into the lags, and the largest of them stays below that."""
SURE = 0.9
"""A correlation from which no band is asked: in short runs of one slow movement it reaches 1."""


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
        runs: dict[str, list[str]] = {}
        for each in worse:
            runs.setdefault(each.channel, []).append(each.experiment.name)
        words = listed([f"{name} in {listed(names)}" for name, names in runs.items()])
        failure = (
            f"simulated no better than by the mean of the run: {words}, which contradicts the "
            "other runs, or shows what the model has not"
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
    error, values = measurement_error(channel), channel.values[channel.used]
    if error is None:
        moves = own.spread > MOVES * pool.spread
    else:
        # what noise alone reaches both ways in so many samples is no movement
        noise = 2.0 * np.sqrt(2.0 * np.log(max(values.size, 2)))
        moves = float(np.ptp(values)) > (STANDS_OUT + noise) * error
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
    poor = any(ratio > MISFIT for ratio in misfit.ratios.values())
    wrong = next((each for each in misfit.faults if _is_wrong(each, poor)), None)
    made += [each for fault in misfit.faults for each in _fault_criterion(fault, poor, wrong)]
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


def _is_wrong(fault: Fault, poor: bool) -> bool:
    """Whether an instrument is off by more than a third of what occurs without notice.

    Where there is lack of fit, only a fault that explains it is told from what else is wrong.
    """
    told = isfinite(fault.plausible) and fault.visible and fault.significant
    return told and abs(fault.size) > fault.plausible / 3.0 and (fault.explains or not poor)


def _fault_criterion(fault: Fault, poor: bool, wrong: Fault | None) -> list[Criterion]:
    """That a fault has no size that matters; none of a fault that is no criterion.

    Of several instruments that seem `wrong` the one that explains most is.
    """
    size = f"{fault.size:+.2g} {fault.unit}"
    explains = fault.significant and fault.explains
    if fault.name.startswith("drift of "):
        part = abs(fault.size) / 100.0
        drifts = part > DRIFTS and explains
        return [
            Criterion(
                fault.name.removesuffix(" over the campaign"),
                size if drifts or part <= DRIFTS else "not seen",
                percent(DRIFTS),
                "no single set of parameters describes a machine that changes",
                "use" if part > DRIFTS_AWAY else "values",
                f"{fault.name} by {size}" if drifts else "",
            )
        ]
    if fault.lost:
        lost = explains and poor
        return [
            Criterion(
                fault.name,
                "seen" if lost else "not seen",
                "none",
                "a counter that does not follow looks like a stop of the machine",
                "use",
                f"{fault.name.removeprefix(LOSS)} does not follow the largest speeds, which looks "
                "like a stop of the machine"
                if lost
                else "",
            )
        ]
    if not (isfinite(fault.plausible) and fault.visible):
        return []
    value = "not seen" if abs(fault.size) > fault.plausible / 3.0 else size
    if wrong is not None and wrong is not fault and _is_wrong(fault, poor):
        value = f"see {wrong.name}"
    return [
        Criterion(
            fault.name,
            size if fault is wrong else value,
            f"{fault.plausible / 3.0:.2g} {fault.unit}",
            "a larger error would be visible in these logs",
            "values",
            f"{fault.words} off by {size}" if fault is wrong else "",
        )
    ]


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
        f"{strongest:.2f}{'' if clauses else ', but residuals small'}" if strongest else "none",
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
