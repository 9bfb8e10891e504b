"""Verdict on a fit: acceptance criteria, and whether it is usable, for prediction only, or not."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from math import inf, isfinite, isinf
from typing import Literal, NamedTuple

import numpy as np

from swashplate.campaign.experiment import Experiment
from swashplate.errors import DomainError, InputError
from swashplate.identification.data_checks import contradicting_runs
from swashplate.identification.determination import WIDE, weak_unknowns, without_value
from swashplate.identification.drive_model import (
    CURRENTS,
    LIMIT_COLUMNS,
    LIMITS,
    DriveModel,
    limits_reached,
)
from swashplate.identification.faults import DRIFT, LOSS, Fault, measurement_error
from swashplate.identification.intervals import open_unknowns
from swashplate.identification.misfit import Alone, ChannelFit, LackOfFit, lack_of_fit
from swashplate.identification.solving import Solution
from swashplate.identification.stage_fit import StageFit
from swashplate.identification.validation import (
    FOLLOWS,
    RunQuality,
    Side,
    beyond_noise,
    following,
    percent,
    pooled,
)
from swashplate.results import Result, folded, listing
from swashplate.tables import Column, Table, listed

Grade = Literal["Usable", "Usable for prediction", "Not usable"]

POOR, SERIOUS = 0.5, 0.2
"""NRMSE from which a drive is not usable, as a constant gain does better on a step's record; and
below which held-out runs that are simulated less well than fitted ones are still of use: 80 % of
the movement is followed, about what Kruse (2001) reached on his worst kind of test."""
CARRIES_OVER, FAR = 1.5, 3.0
"""Factors on the fitted runs' RMSE: up to the first held-out runs count as simulated alike, as
maneuvers differ that much among the fitted ones; from twice that the fit does not carry over."""
REQUIRED, MOST = 0.10, 0.5
"""Largest error of held-out runs over their range, where the user requires nothing else; share of
parameters without a value of their own from which a fit has found nothing."""
MOVES, STANDS_OUT = 0.05, 5.0
"""A run that moves by less than this part of the channel's movement is not judged by itself; where
the measurement error is known, by less than five times that beyond the range of the noise alone."""
MISFIT, MODEL_ERROR = 1.2, 0.01
"""Residuals over their known measurement error from which there is lack of fit: 37 of 39 sound
campaigns of slew lay between 0.97 and 1.02, in two the search ended in another optimum; and the
error of held-out runs over their range from which it rules out prediction, as what is wrong is not
small on known maneuvers and larger on others."""
UNEXPLAINED = 0.003
"""The same where no measurement error is known: residuals beyond white noise over the range. Sound
tachos and positions of simulated machines have 0 to 0.2 %; one run with a scale 15 % off, a load in
half of the runs, play, or a drift of 9 % leave 0.4 to 1.9 %."""
OWN_SCALE, OWN_DELAY, OUTLIES, DOMINATES = 0.02, 0.01, 4.0, 0.5
"""Scale of one run's motion beside the median run's from which values are those of no machine, and
delay [s]; how many robust standard deviations of all runs that is at least, and which part of the
run's residuals a delay explains: a slow ramp begins later by a dead zone's small error. Scales of
sound campaigns lie below 0.3 %, those where fixed parameters are 10 % off below 1 %; a run whose
scale is 15 % off gave 12 %."""
DRIFTS, DRIFTS_AWAY = 0.01, 0.03
"""Change of a channel over the campaign from which values are those of a mean machine, and from
which no one set of parameters holds."""
FEWEST_RUNS = 4
"""Runs of which one can stand out."""
SAME = 1e-6
"""Costs that differ by less than this part are the same optimum."""


class Criterion(NamedTuple):
    """An acceptance criterion, applied."""

    name: str
    value: str
    """What was found, as it is printed."""
    limit: str
    reason: str
    """Why the limit is where it is; of one that was not judged, why not."""
    failure: str = ""
    """Clause that says what is wrong; empty where nothing is."""
    rules: Literal["use", "values"] = "use"
    """What is ruled out by a failure: any use, or the parameters' values."""
    judged: bool = True
    """Whether the data allow to judge it."""

    @property
    def state(self) -> Literal["met", "not met", "not judged"]:
        """What came of it."""
        return "not met" if self.failure else "met" if self.judged else "not judged"


def _open(name: str, limit: str, why: str) -> Criterion:
    """A criterion that the data do not allow to judge."""
    return Criterion(name, "-", limit, why, judged=False)


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
        """Its criteria, those that are not met first, then those that were not judged."""
        columns = (Column("criterion", wrap=True), Column("value", "s"), Column("limit", "s"))
        made = Table("Acceptance criteria", (*columns, Column(""), Column("reason", of="p")))
        order = ("not met", "not judged", "met")
        for each in sorted(self.criteria, key=lambda each: order.index(each.state)):
            state = "NOT MET" if each.failure else each.state
            made.add(each.name, each.value, each.limit, state, each.reason, look=state != "met")
        return made

    def html(self, between: str = "") -> str:
        """HTML: headline and sentences, other HTML, criteria; those that are met are folded."""
        table = self.table()
        opened = replace(table, rows=[row for row in table.rows if row.look])
        met = replace(table, title="", rows=[row for row in table.rows if not row.look])
        headline = f"<p><strong>{escape(self.headline)}</strong></p>"
        unmet = opened._repr_html_() if opened.rows else ""
        kept = folded(f"Criteria that are met: {len(met.rows)}", [met]) if met.rows else ""
        return f"{headline}{listing(self.remarks())}{between}{unmet}{kept}"

    def _repr_html_(self) -> str:
        return self.html()

    def remarks(self) -> list[str]:
        """What it holds for, what asks for attention, what is open and what is assumed."""
        validity = [self.validity] if self.validity else []
        assumed = [f"Assumed: {each[:1].lower()}{each[1:]}" for each in self.assumed]
        return [*validity, *self.sentences, *self.not_judged, *assumed]

    def _sentences(self) -> list[str]:
        return self.remarks()

    @property
    def usable(self) -> bool:
        """Whether nothing rules out the use."""
        return self.grade != "Not usable"

    @property
    def not_judged(self) -> tuple[str, ...]:
        """A sentence for each criterion that was not judged, with what would allow it."""
        left = [each for each in self.criteria if each.state == "not judged"]
        return tuple(f"Not judged: {each.name}, as {each.reason}." for each in left)


def verdict(
    stages: Sequence[StageFit],
    predicted: Sequence[RunQuality],
    *,
    planned: Sequence[str] = (),
    required: float = REQUIRED,
) -> Verdict:
    """Judge a fit by what it found and by what it predicts, or a drive by what it predicts.

    It is "Not usable" where a criterion on the use fails, "Usable for prediction" where only those
    on the parameters' values do. A criterion that the data do not allow to judge rules out nothing,
    and says what would be needed.

    Parameters
    ----------
    stages : sequence of StageFit
        Each stage of the fit; none for a drive that is only compared with runs.
    predicted : sequence of RunQuality
        Of runs that were held out of the fit, as `validation.predict` gives them.
    planned : sequence of str
        Names of all stages of the fit configuration, to tell those that were never begun.
    required : float
        Largest error of the runs predicted, over the range of each channel. [1]
    """
    runs = [each for stage in stages for each in stage.runs]
    fitted = Side.of("fitted", runs)
    fitted_to = {name for each in stages for name in each.problem.channels}
    # a current that no stage was fitted to is that of an amplifier that nobody identified
    asked = [
        each
        for each in predicted
        if not stages
        or each.channel in fitted_to
        or each.experiment[each.channel].kind not in CURRENTS
    ]
    out = Side.of("held-out" if stages else "predicted", asked)
    criteria, misfit, alone = [*_convergence(stages, planned)], None, list[Criterion]()
    for side in (fitted, out):
        criteria += [_followed(side), _no_worse_than_mean(side)] if side.qualities else []
    criteria.append(_required_accuracy(out, required))
    if stages:
        criteria += [
            _carried_over(fitted, out),
            _consistent(stages),
            _determined(stages),
            _bounded_predictions(stages, predicted),
        ]
        try:
            misfit = lack_of_fit(stages)
        except InputError as error:
            criteria.append(_open("lack of fit", f"{MISFIT:g}", str(error).rstrip(".")))
        else:
            criteria += _fits(misfit, out if out.qualities else fitted, stages)
            alone += _alike(misfit, stages)
            criteria += [*_nothing_left_out(misfit, fitted), *alone]
    criteria.append(_model_error(runs or predicted))

    unusable, untrusted = (
        "; ".join(each.failure for each in criteria if each.failure and each.rules == ruled)
        for ruled in ("use", "values")
    )
    grade: Grade = "Usable for prediction" if untrusted else "Usable"
    grade = "Not usable" if unusable else grade
    tested = {each.name: each for each in _fitted_runs(stages)}
    tested |= {each.experiment.name: each.experiment for each in out.qualities}
    assumed: list[str] = []
    if misfit is not None:
        units = f"The estimates are in units of the fixed {listed(misfit.units)}."
        assumed = [units] * bool(misfit.units) + [f"{e.assumption}." for e in misfit.assumed]
    if unusable:
        headline = f"Not usable: {'; '.join([unusable, *(e.failure for e in alone if e.failure)])}."
    elif not stages:
        number = len({each.experiment.name for each in out.qualities})
        headline = f"Predicts {out.accuracy} over {number} run{'s' if number > 1 else ''}."
    elif untrusted:
        accuracy = f"held-out {out.accuracy}" if out.qualities else f"fitted {fitted.accuracy}"
        headline = f"Usable for prediction of {_maneuvers(tested)} ({accuracy}); parameter values "
        headline += f"not to be trusted because {untrusted}."
    elif out.qualities:
        headline = f"Usable: predicts held-out {out.accuracy}."
    else:
        headline = f"Usable as far as tested: follows {fitted.accuracy}; no run was held out."
    return Verdict(
        headline,
        tuple(criteria),
        grade,
        tuple(_remarks(stages, fitted, out, runs or predicted, misfit)),
        _validity(stages, tested) if stages else "",
        tuple(assumed),
    )


def _fitted_runs(stages: Sequence[StageFit]) -> list[Experiment]:
    """The fitted runs of all stages, each once."""
    return list({e.name: e for a in stages for e in a.problem.experiments}.values())


def starts_of(stages: Sequence[StageFit]) -> dict[str, Sequence[Solution]]:
    """Starts by stage, of the stages that had several."""
    return {each.stage.name: each.starts for each in stages if len(each.starts) > 1}


# --- criteria -------------------------------------------------------------------------------------


def _convergence(stages: Sequence[StageFit], planned: Sequence[str]) -> Iterator[Criterion]:
    """That each stage came to its end."""
    why, done = "before the optimum neither values nor intervals are meaningful", []
    for each in stages:
        name, solution = each.stage.name, each.solution
        state, failure = "converged", ""
        if solution.interrupted:
            state = "interrupted"
            failure = f"stage {name} was interrupted, and its best so far is no optimum"
        elif not solution.converged:
            state, failure = "not converged", f"stage {name} did not converge ({solution.message})"
        done.append(name)
        yield Criterion(f"convergence of {name}", state, "converged", why, failure)
    missing = [name for name in planned if name not in done] if done else []
    if missing:
        failure = f"{listed(missing)} {'were' if len(missing) > 1 else 'was'} never fitted"
        yield Criterion("stages", f"{len(missing)} missing", "all", why, failure)


def _followed(side: Side) -> Criterion:
    """That each channel follows the movement at all."""
    errors = {k: m.nrmse for k, m in side.measures.items() if m.nrmse is not None}
    clauses = []
    for name, error in errors.items():
        words = "misses at least half of the movement"
        words = "is simulated no better than by its mean" if error >= 1.0 else words
        if error >= POOR:
            fits = 100.0 * (1.0 - error)
            clauses.append(f"{name} {words} in the {side.which} runs (fit {fits:z.0f} %)")
    return Criterion(
        f"RMSE / standard deviation, {side.which}",
        percent(max(errors.values(), default=0.0)),
        percent(POOR),
        "a constant gain does better on a step's record",
        "; ".join(clauses),
    )


def _no_worse_than_mean(side: Side) -> Criterion:
    """That no run that moves is simulated no better than by its own mean."""
    runs: dict[str, list[str]] = {}
    for each in side.qualities:
        own, channel = each.measures, each.experiment[each.channel]
        error, values = measurement_error(channel), channel.values[channel.used]
        # what noise alone reaches both ways in so many samples is no movement
        noise = 2.0 * np.sqrt(2.0 * np.log(max(values.size, 2)))
        if error is None:
            moves = own.spread > MOVES * side.measures[each.channel].spread
        else:
            moves = float(np.ptp(values)) > (STANDS_OUT + noise) * error
        if moves and (own.nrmse or 0.0) >= 1.0:
            runs.setdefault(each.channel, []).append(each.experiment.name)
    words = listed([f"{name} in {listed(names)}" for name, names in runs.items()])
    failure = f"simulated no better than by the mean of the run: {words}, which contradicts the "
    failure += "other runs, or shows what the model has not"
    return Criterion(
        f"{side.which} runs worse than mean",
        f"{sum(map(len, runs.values()))}",
        "0",
        "such a run belongs to another machine, or the model lacks what moves it",
        failure if runs else "",
    )


def _required_accuracy(out: Side, required: float) -> Criterion:
    """That the error of the runs predicted is what the user can live with."""
    name, limit = "error / range, runs predicted", percent(required)
    if not out.qualities:
        why = 'no run was held out: set role = "validate" in one of its [[runs]]'
        return _open(name, limit, why)
    parts = {each: part or 0.0 for each, part in out.parts.items()}
    worst = percent(max(parts.values()))
    late = next((each for each, part in parts.items() if part > required), None)
    failure = "" if late is None else f"predicts {late} to {worst} of its range only"
    return Criterion(name, worst, limit, "what is required of the model (--require)", failure)


def _ratios(fitted: Side, out: Side) -> dict[str, tuple[float, float]]:
    """RMSE of held-out over that of fitted runs, and NRMSE of held-out ones, by channel."""
    return {
        name: (found.rmse / fitted.measures[name].rmse, found.nrmse)
        for name, found in out.measures.items()
        if name in fitted.measures and fitted.measures[name].rmse > 0.0 and found.nrmse is not None
    }


def _carried_over(fitted: Side, out: Side) -> Criterion:
    """That runs that were held out are simulated about as well as those that were fitted."""
    found, name, limit = _ratios(fitted, out), "RMSE, held-out / fitted", f"{FAR:g}"
    if not found:
        return _open(name, limit, "no held-out run moves")
    serious = {name: ratio for name, (ratio, nrmse) in found.items() if nrmse >= SERIOUS}
    clauses = [
        f"held-out {name} has {ratio:.1f} times the RMSE of the fitted runs"
        for name, ratio in serious.items()
        if ratio > FAR
    ]
    value = f"{max(serious.values()):.2g}" if serious else "small"
    why = "twice the normal difference between maneuvers"
    return Criterion(name, value, limit, why, "; ".join(clauses))


def _consistent(stages: Sequence[StageFit]) -> Criterion:
    """That no run contradicts the others, by its sign or scale."""
    name, last = "runs contradicting others", stages[-1]
    if not isinstance(last.problem.model, DriveModel):
        why = "signs and scales of runs are compared through a drive, which this model is not"
        return _open(name, "0", why)
    found = contradicting_runs(_fitted_runs(stages), last.drive.parameters)
    names, failure = list(dict.fromkeys(str(each.run) for each in found)), ""
    if found:
        said = found[0].sentence.rstrip(".")
        failure = f"{listed(names)} contradicts the other runs ({said})"
    why = "its data are of another machine, unit or sign, and bias all estimates"
    return Criterion(name, f"{len(names)}", "0", why, failure)


def _determined(stages: Sequence[StageFit]) -> Criterion:
    """That most unknowns that all runs share have values of their own."""
    lost = sum(len(without_value(each)) for each in stages)
    total = sum(unknown.run is None for each in stages for unknown in each.problem.unknowns)
    name, value = "parameters without a value", f"{lost} of {total}"
    why = "a fit that determines few of its parameters has found nothing"
    failure = f"{value} parameters are at a bound or not determined" if lost > MOST * total else ""
    return Criterion(name, value, f"{100.0 * MOST:g} %", why, failure)


def _bounded_predictions(stages: Sequence[StageFit], predicted: Sequence[RunQuality]) -> Criterion:
    """That what is predicted depends on nothing that the fitted runs leave open."""
    name = "predictions left open"
    if not predicted or not isinstance(stages[-1].problem.model, DriveModel):
        why = "the model is none of a drive" if predicted else "no run was held out"
        return _open(name, "none", why)
    runs = {each.experiment.name: each.experiment for each in predicted}.values()
    found = dict.fromkeys(n for each in stages for n in open_unknowns(each, runs))
    names, why = listed(list(found)), "the prediction is then as uncertain as the parameter"
    failure = f"predictions depend on {names}, which the fitted runs leave open" if names else ""
    return Criterion(name, names or "none", "none", why, failure)


def _fits(misfit: LackOfFit, side: Side, stages: Sequence[StageFit]) -> Iterator[Criterion]:
    """That residuals are no larger than the known measurement error, and follow no fault."""
    likely, limit = f" (likely: {misfit.likely})" if misfit.likely else "", f"{MISFIT:g}"
    for name, ratio in misfit.ratios.items():
        error = max(side.parts.get(each) or 0.0 for each in (name, f"speed from {name}"))
        alike = [each for each in misfit.runs if each.channel == name]
        worst = max(alike, key=lambda each: each.ratio or 0.0)
        words = f"residuals of {name} are {ratio:.3g} times their known measurement error, most in "
        yield Criterion(
            f"lack of fit of {name}",
            f"{ratio:.3g}",
            limit,
            "sound campaigns lie between 0.97 and 1.02",
            f"{words}{worst.run}{likely}" if ratio > MISFIT else "",
            "use" if ratio > MISFIT and error > MODEL_ERROR else "values",
        )
    axis = _fitted_runs(stages)[0].axis
    for name in dict.fromkeys(name for each in stages for name in each.problem.channels):
        if name not in misfit.ratios:
            why = "its measurement error is not known: state its standard deviation at rest in the "
            why += f"campaign file, by a line noise = ... in [axes.{axis}.channels.{name}]"
            yield _open(f"lack of fit of {name}", limit, why)
    poor = any(ratio > MISFIT for ratio in misfit.ratios.values())
    wrong = [each for each in misfit.faults if _is_wrong(each, poor)]
    for each in misfit.faults:
        if each.kind is DRIFT:
            yield _drift(each)
        elif each.kind is LOSS:
            lost = each.significant and each.explains and each.near and poor
            words = "does not follow the largest speeds: its counter loses counts, or the machine "
            words += "has a stop there that is fixed farther out"
            channel = each.name.removeprefix(LOSS.words.format(""))
            why = "a counter that does not follow looks like a stop of the machine"
            state, failure = ("seen", f"{channel} {words}") if lost else ("not seen", "")
            yield Criterion(each.name, state, "none", why, failure)
        elif each.instrumental and each.visible and misfit.ratios:
            yield _of_instrument(each, wrong)
    if misfit.clipped:
        why = "values beyond it were not measured, and bias the fit"
        failure = misfit.clipped[0].rstrip(".")
        yield Criterion("clipped channels", f"{len(misfit.clipped)}", "0", why, failure)


def _is_wrong(fault: Fault, poor: bool) -> bool:
    """Whether an instrument is off by more than half of what occurs without notice.

    Where there is lack of fit, only a fault that explains it is told from what else is wrong.
    """
    told = fault.instrumental and fault.visible and fault.significant and fault.near
    return told and abs(fault.size) > fault.kind.tolerated and (fault.explains or not poor)


def _drift(fault: Fault) -> Criterion:
    part, size = abs(fault.size) / 100.0, f"{fault.size:+.2g} {fault.kind.unit}"
    drifts = part > DRIFTS and fault.significant and fault.explains and fault.near
    return Criterion(
        fault.name.removesuffix(" over the campaign"),
        size if drifts or part <= DRIFTS else "not seen",
        percent(DRIFTS),
        "no single set of parameters describes a machine that changes",
        f"{fault.name} by {size}" if drifts else "",
        "use" if part > DRIFTS_AWAY else "values",
    )


def _of_instrument(fault: Fault, wrong: Sequence[Fault]) -> Criterion:
    """That an instrument's error is small; of several that seem wrong the likeliest one is."""
    limit, size = fault.kind.tolerated, f"{fault.size:+.2g} {fault.kind.unit}"
    first = fault in wrong[:1]
    value = size if first or abs(fault.size) <= limit else "not seen"
    return Criterion(
        fault.name,
        f"see {wrong[0].name}" if fault in wrong[1:] else value,
        f"{limit:.2g} {fault.kind.unit}",
        "a larger error would be visible in these logs",
        f"{fault.words} off by {size}" if first else "",
        "values",
    )


def _nothing_left_out(misfit: LackOfFit, fitted: Side) -> Iterator[Criterion]:
    """That residuals of a motion whose measurement error is not known are white noise.

    Not of an ammeter, as currents ripple.
    """
    kinds = {e.channel: e.experiment[e.channel].kind for e in fitted.qualities}
    for name, kind in kinds.items():
        if kind in CURRENTS or name.removeprefix("speed from ") in misfit.ratios:
            continue
        part = beyond_noise(fitted.qualities, name)
        likely = f" (likely: {misfit.likely})" if misfit.likely else ""
        failure = f"residuals of {name} have {percent(part)} of its range beyond white noise, "
        failure += f"as the model leaves something out{likely}"
        yield Criterion(
            f"residuals beyond white noise, {name}",
            percent(part),
            percent(UNEXPLAINED),
            "sound machines have 0 to 0.2 % of the range",
            failure if part > UNEXPLAINED else "",
            "values",
        )


def _alike(misfit: LackOfFit, stages: Sequence[StageFit]) -> Iterator[Criterion]:
    """That no run's motion has another scale than that of the others, or is late beside them.

    One step cannot tell a large delay from a scale: what explains more of the run's residuals
    counts.
    """
    kinds = {n: c.kind for run in _fitted_runs(stages) for n, c in run.channels.items()}
    motions = [each for each in misfit.runs if kinds[each.channel] not in CURRENTS]
    scales = [(each, each.scale, each.late.share) for each in motions]
    why = "runs of one machine through one instrument have one scale"
    yield _of_one_run("scale", scales, 100.0, "%", 100.0 * OWN_SCALE, why)
    delays = [(each, each.late, max(each.scale.share, DOMINATES)) for each in motions]
    why = "runs of one machine and one logger have one delay"
    yield _of_one_run("delay", delays, 1e3, "ms", 1e3 * OWN_DELAY, why)


def _of_one_run(
    what: str,
    motions: Sequence[tuple[ChannelFit, Alone, float]],
    factor: float,
    unit: str,
    limit: float,
    why: str,
) -> Criterion:
    """That no run stands out from the others of its channel by more than a limit [unit].

    Beside each run's own size is the share of residuals that it must explain.
    """
    found, judged = list[tuple[float, str]](), False
    for name in dict.fromkeys(each.channel for each, _, _ in motions):
        alike = [each for each in motions if each[0].channel == name and isfinite(each[1].error)]
        if len(alike) < FEWEST_RUNS:
            continue
        judged = True
        apart = np.array([own.size for _, own, _ in alike])
        apart -= np.median(apart)
        usual = OUTLIES * float(np.median(np.abs(apart))) / 0.6745
        for (run, own, least), off in zip(alike, (factor * apart).tolist(), strict=True):
            if abs(off) > factor * max(usual, own.error) and own.share >= least:
                found.append((off, f"{name} in {run.run} by {off:+.2g} {unit}"))
    found.sort(key=lambda each: -abs(each[0]))
    far = [words for size, words in found if abs(size) > limit][:3]
    return Criterion(
        f"{what} of a run of its own",
        f"{found[0][0]:+.2g} {unit}" if found else "none" if judged else "-",
        f"{limit:g} {unit}",
        why if judged else f"fewer than {FEWEST_RUNS} runs measure the same motion",
        f"runs differ in {what} from the others: {listed(far)}" if far else "",
        "values",
        judged,
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
        return _open(name, limit, "the runs are shorter than 8 samples")
    value = f"{strongest:.2f}{'' if clauses else ', but residuals small'}" if strongest else "none"
    return Criterion(name, value, limit, "what the input causes grows with it", "; ".join(clauses))


# --- words ----------------------------------------------------------------------------------------


def _remarks(
    stages: Sequence[StageFit],
    fitted: Side,
    out: Side,
    own: Sequence[RunQuality],
    misfit: LackOfFit | None,
) -> Iterator[str]:
    """What asks for attention beside the criteria."""
    for name, found in (fitted.measures or out.measures).items():
        if found.nrmse is None:
            yield f"{name}: the measured signal never moves, so nothing can be judged."
    for name, (ratio, _) in _ratios(fitted, out).items():
        if ratio > CARRIES_OVER:
            yield (
                f"{name}: the RMSE of held-out runs is {ratio:.2f} times that of fitted runs: "
                f"larger errors on other tests (limit {CARRIES_OVER:g})."
            )
    for each in stages:
        if wide := weak_unknowns(each):
            name = each.stage.name
            yield f"{name}: not determined to within ±{percent(WIDE)}: {listed(wide)}."
    yield from misfit.clipped if misfit is not None else ()
    for name in dict.fromkeys(each.channel for each in own):
        tests, related = following(own, name)
        if related:
            yield (
                f"{name}: the residuals of {len(related)} of {tests} runs follow the input "
                f"(correlation up to {max(related, key=abs):+.2f}): the model leaves out something "
                "that the input causes."
            )
    for stage, results in starts_of(stages).items():
        costs = np.array([each.cost for each in results])
        best = float(costs.min())
        alike = int(np.count_nonzero(costs <= best * (1.0 + SAME)))
        said = f"{alike} of {len(results)} starts reached the best cost, {best:.6g}."
        yield f"{stage}: {said if best < inf else 'No start ended with a finite cost.'}"


def _maneuvers(tested: Mapping[str, Experiment]) -> str:
    """``ramps, steps and sines of up to 0.3 Hz from -9 to 9 V``."""
    runs, fastest = list(tested.values()), 0.0
    several = {each: f"{each}s" for each in ("ramp", "step", "sine", "chirp")}
    several["unnamed"] = "unnamed motions"
    kinds = dict[str, None]()
    for each in runs:
        word = each.maneuver.split(" ")[0]
        kinds[several.get(word, word)] = None
        if each.recognised is not None:
            fastest = max(fastest, each.recognised.frequency or 0.0)
    low = min(float(each.input.values.min()) for each in runs)
    high = max(float(each.input.values.max()) for each in runs)
    words = [f"sines of up to {fastest:.3g} Hz" if k == "sines" and fastest else k for k in kinds]
    return f"{listed(words)} from {low:.3g} to {high:.3g} {runs[0].input.unit}"


def _validity(stages: Sequence[StageFit], tested: Mapping[str, Experiment]) -> str:
    """What the fit holds for, which limits its runs never reach, and which the model has not."""
    said, stage = f"Holds for {_maneuvers(tested)}", stages[-1]
    if not isinstance(stage.problem.model, DriveModel):
        return f"{said}."
    try:
        runs, parameters = _fitted_runs(stages), stage.drive.parameters
        reached = {limit for each in runs for limit in limits_reached(each, parameters)}
    except (DomainError, InputError):
        return f"{said}."
    never, lacking = list[str](), list[str]()
    for name, words in LIMITS.items():
        columns = [column for column in LIMIT_COLUMNS if column.startswith(name)]
        unreached = [column for column in columns if column not in reached]
        absent = [column for column in unreached if isinf(parameters.numbers[column])]
        lacking += _limits_named(words, absent, columns)
        never += _limits_named(words, [c for c in unreached if c not in absent], columns)
    if never:
        said += f"; never reached: {listed(never)}"
    if lacking:
        said += f"; not in the model: {listed(lacking)}"
    return f"{said}."


def _limits_named(words: str, some: Sequence[str], columns: Sequence[str]) -> list[str]:
    """A limit in words, by its direction if only some of its columns are meant."""
    if not some:
        return []
    if len(some) == len(columns):
        return [words]
    ways = {"plus": "positive", "minus": "negative"}
    return [f"{words} in {ways[column.rpartition('_')[2]]} direction" for column in some]
