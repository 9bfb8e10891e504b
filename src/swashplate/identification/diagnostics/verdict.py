"""The verdict on a fit: are the data sound, may one predict with it, which values may be quoted."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from math import isinf, isnan, nan
from typing import get_args

from swashplate.campaign import SIGNALS, Channel, Experiment
from swashplate.errors import DomainError, InputError
from swashplate.identification.diagnostics.causes import Cause, causes_of, fixed_numbers
from swashplate.identification.diagnostics.data_checks import Finding
from swashplate.identification.diagnostics.discrepancy import (
    ClassError,
    LeftOpen,
    MotionClass,
    PredictionError,
    prediction_errors,
)
from swashplate.identification.diagnostics.reference_motions import motions_left_open
from swashplate.identification.diagnostics.soundness import (
    CommandRange,
    JudgedRuns,
    commands_of,
    judged_runs,
    unsound_data,
)
from swashplate.identification.estimation.drive_model import (
    LIMIT_COLUMNS,
    LIMITS,
    DriveModel,
    limits_reached,
)
from swashplate.identification.estimation.posterior import Posterior
from swashplate.identification.estimation.solving import Solution
from swashplate.identification.optimum import Optimum
from swashplate.identification.statistics.determination import WIDE, weak_unknowns
from swashplate.identification.validation import RunQuality, percent
from swashplate.parameters import COLUMNS
from swashplate.results import Result, listing
from swashplate.tables import UNIT, Column, Table, count, listed

REQUIRED = 0.10
"""Largest error of a prediction over the range, if the user requires nothing else."""
SHAFT = ("shaft_speed", "shaft_position")
"""Signals of a drive that are one motion."""
SAME = 1e-6
"""Costs that differ by less than this part are the same optimum."""
MOST_NAMED = 12
"""Values that a sentence lists; it counts more."""
MOTIONS: Mapping[MotionClass, str] = {
    "large": "large motion",
    "small": "small motion, near the dead zone",
    "fast": "fast motion",
}


@dataclass(frozen=True)
class Verdict(Result):
    """The assessment of a fit, or of a drive over some runs: three answers."""

    required: float
    """Largest error of a prediction over the range that is of use. [1]"""
    predictions: tuple[PredictionError, ...]
    """How far predictions of each channel may be off in a new maneuver."""
    decisive: tuple[str, ...]
    """Channels whose error must be within what is required: of several that measure the shaft's
    motion the one that knows it best."""
    fitted: bool = True
    """Whether it is on a fit; False for a drive that is compared with runs."""
    unfinished: tuple[str, ...] = ()
    """Clauses on a search that did not come to its end."""
    unsound: tuple[Finding, ...] = ()
    """Data that cannot be right, each with the line to write."""
    quotable: int = 0
    """Values of the machine whose interval is not wide."""
    undetermined: tuple[str, ...] = ()
    """Values of the machine with a wide interval, or none."""
    causes: tuple[Cause, ...] | None = None
    """What would explain the error, by a refit, the largest share first; empty if nothing does,
    None if the error is mostly noise or was not looked at."""
    validity: str = ""
    """Sentence that names the maneuvers and the range that it holds for, and what they never
    reach; empty for a drive that was not fitted."""
    fastest_sine: float = 0.0
    """Highest frequency of the sines that it was fitted to or tested with; 0 without sines. [Hz]"""
    commands: CommandRange | None = None
    """Of the runs that it was fitted to; None for a drive that was not fitted."""
    judged: JudgedRuns | None = None
    """Which runs the soundness of the data rests on; None in a file of a version that did not
    store it."""
    assumed: tuple[str, ...] = ()
    """What these logs cannot show, and what is assumed of it."""
    remarks: tuple[str, ...] = ()
    """What else asks for attention."""

    @property
    def sound(self) -> bool:
        """Whether nothing in the data stands out."""
        return not self.unsound

    @property
    def error(self) -> PredictionError | None:
        """The decisive channel that is spoken of; None if nothing moves.

        The first one, which is that of the shaft if there is one, unless another one errs by more
        than required.
        """
        channels = {prediction.channel: prediction for prediction in self.predictions}
        decisive = [channels[name] for name in self.decisive]
        late = [prediction for prediction in decisive if prediction.worst.error > self.required]
        if late:
            return max(late, key=lambda prediction: prediction.worst.error)
        return decisive[0] if decisive else None

    @property
    def predicts(self) -> bool:
        """Whether each class of motion is predicted as well as required."""
        return self.error is not None and self.error.worst.error <= self.required

    @property
    def usable(self) -> bool:
        """Whether the data are sound, the fit came to its end, and it predicts well enough."""
        return self.sound and not self.unfinished and self.predicts

    @property
    def headline(self) -> str:
        """Whether the fit is usable, and why, in one sentence."""
        if self.unfinished:
            return f"Not usable: {'; '.join(self.unfinished)}."
        if self.unsound:
            others = f" ({len(self.unsound) - 1} more.)" if len(self.unsound) > 1 else ""
            return f"Not usable, as the data are not sound: {self.unsound[0].sentence}{others}"
        error = self.error
        if error is None:
            return "Not usable: no channel moves, so no prediction can be assessed."
        within = f"{error.signal} within {percent(error.worst.error)} of its range"
        if not self.predicts:
            return (
                f"Not usable: predicts {within} in {MOTIONS[error.worst.motion]}; "
                f"{percent(self.required)} is required."
            )
        classes = ", ".join(f"{stated.motion} {percent(stated.error)}" for stated in error.classes)
        return f"Usable: predicts {within} in a new maneuver ({classes})."

    @property
    def data(self) -> str:
        """Whether the data are sound, in a sentence."""
        if self.unsound:
            return f"Not sound: {' '.join(finding.sentence for finding in self.unsound)}"
        if not self.fitted:
            return "Not assessed: a drive that was not fitted to these runs says little about them."
        judged = self.judged or JudgedRuns()
        clauses = ["no fitted run stands out from the others"]
        if not judged.compared:
            clauses = ["too few runs were fitted to compare them with each other"]
        if judged.held_out:
            predicted = count(judged.held_out, "held-out run is", "held-out runs are")
            clauses.append(f"{predicted} predicted as the fitted ones lead one to expect")
        sentence = f"Sound: {', '.join(clauses)}, none is clipped."
        if judged.beyond:
            return (
                f"{sentence} Not judged, as the command goes beyond the fitted ones: "
                f"{listed(judged.beyond)}."
            )
        return sentence if judged.held_out else f"{sentence} No held-out run was judged."

    @property
    def prediction(self) -> str:
        """What may be predicted, and how well, in a sentence."""
        if not self.predictions:
            return "Unknown: no channel moves."
        channels = {prediction.channel: prediction for prediction in self.predictions}
        decisive = [channels[name] for name in self.decisive]
        stated = [
            f"{prediction.signal} within {percent(prediction.worst.error)}"
            for prediction in decisive
        ]
        sentences = (
            f"In nine of ten new maneuvers {listed(stated)} of range; {percent(self.required)} is "
            "required."
        )
        for prediction in decisive:
            tested = {stated.motion for stated in prediction.classes}
            unknown = [
                description for motion, description in MOTIONS.items() if motion not in tested
            ]
            if unknown:
                sentences += (
                    f" {prediction.signal}: unknown in {listed(unknown)}, as no run has it."
                )
            beyond = [part for part in prediction.beyond if part.error > prediction.worst.error]
            if beyond:
                errors = [f"{percent(part.error)} in {part.motion}" for part in beyond]
                sentences += (
                    f" Faster than any test {prediction.signal} is known only within "
                    f"{listed(errors)}, with the largest commands."
                )
        return sentences

    @property
    def values(self) -> str:
        """Which values may be quoted, in a sentence; empty for a drive that was not fitted."""
        if not self.fitted:
            return ""
        total = self.quotable + len(self.undetermined)
        if not self.undetermined:
            return f"All {total} may be quoted with their intervals."
        others = listed(self.undetermined)
        if len(self.undetermined) > MOST_NAMED:
            others = (
                f"{len(self.undetermined)} others, which these tests show only together, as a "
                "prediction uses them (estimates.csv has each)"
            )
        return (
            f"{self.quotable} of {total} may be quoted with their intervals; not known to within "
            f"±{percent(WIDE)}: {others}."
        )

    @property
    def cause(self) -> str:
        """What would explain the error, in a sentence; empty if there is nothing to explain."""
        if self.causes is None:
            return ""
        if not self.causes:
            return (
                "No single cause that was tried explains half of it; the curves of the runs show "
                "when it occurs."
            )
        causes = "; ".join(cause.words for cause in self.causes)
        if len(self.causes) > 1:
            return f"one of these, which these data cannot distinguish: {causes}."
        return f"{causes}."

    def answers(self) -> dict[str, str]:
        """The three answers, and what would explain the error, by their names."""
        answers = {
            "Data": self.data,
            "Prediction": self.prediction,
            "Values": self.values,
            "Error beyond noise": self.cause,
        }
        return {name: text for name, text in answers.items() if text}

    def table(self) -> Table:
        """The stated error of each channel by class of motion."""
        table = Table(
            "Stated error in a new maneuver",
            (
                Column("signal"),
                Column("motion"),
                Column("error", ".3g", none="unknown"),
                UNIT,
                Column("of range", ".2%"),
                Column("runs", ".0f", "1"),
                Column("held out", ".0f", "1"),
                Column("required"),
            ),
        )
        for prediction in self.predictions:
            tested = {stated.motion: stated for stated in prediction.classes}
            is_decisive = prediction.channel in self.decisive
            for motion in get_args(MotionClass):
                stated = tested.get(motion, ClassError(motion, nan, 0, 0))
                table.add(
                    prediction.signal,
                    motion,
                    stated.error * prediction.reach,
                    stated.error,
                    float(stated.fitted + stated.held_out),
                    float(stated.held_out),
                    _state(stated, self.required) if is_decisive else "-",
                    unit=prediction.unit,
                    look=is_decisive and stated.error > self.required,
                )
        return table

    def html(self, between: str = "") -> str:
        """HTML: headline, answers and sentences, other HTML, the stated errors."""
        answers = "".join(
            f"<dt>{escape(name)}</dt><dd>{escape(text)}</dd>"
            for name, text in self.answers().items()
        )
        headline = f"<p><strong>{escape(self.headline)}</strong></p>"
        return (
            f"{headline}<dl>{answers}</dl>{listing(self.sentences)}{between}"
            f"{self.table()._repr_html_()}"
        )

    def _repr_html_(self) -> str:
        return self.html()

    @property
    def sentences(self) -> tuple[str, ...]:
        """What it holds for, what asks for attention, and what is assumed."""
        validity = (self.validity,) if self.validity else ()
        return (
            *validity,
            *self.remarks,
            *(f"Assumed: {assumption}." for assumption in self.assumed),
        )

    def summary(self) -> str:
        """Text: headline, answers, sentences, the stated errors."""
        answers = "\n".join(f"{name}: {text}" for name, text in self.answers().items())
        lines = "\n".join(f"- {sentence}" for sentence in self.sentences)
        parts = [self.headline, answers, lines, str(self.table())]
        return "\n\n".join(part for part in parts if part)


def assess_fit(
    fit: Optimum | None,
    predicted: Sequence[RunQuality],
    *,
    required: float = REQUIRED,
    of_fit: Verdict | None = None,
    posterior: Posterior | None = None,
) -> Verdict:
    """Judge a fit, or a drive by what it predicts.

    Parameters
    ----------
    fit : Optimum or None
        None for a drive that is only compared with runs.
    predicted : sequence of RunQuality
        Of runs that were held out of the fit, as `validation.predict` gives them.
    required : float
        Largest error of a prediction in a new maneuver, over the range of the signal. [1]
    of_fit : Verdict, optional
        The verdict on the fit of a drive that is only compared with runs: one that is farther off
        than the errors that it states lead one to expect is named.
    posterior : Posterior, optional
        What the fit leaves open of the machine's numbers, and so of a new maneuver.
    """
    expected = () if of_fit is None else of_fit.predictions
    commands = None if of_fit is None else of_fit.commands
    unsound = tuple(unsound_data(fit, predicted, expected, commands))
    named = {str(finding.run) for finding in unsound}
    held_out = {quality.experiment.name for quality in predicted}
    tested = {run.name: run for run in (fit.problem.experiments if fit else ())}
    tested |= {quality.experiment.name: quality.experiment for quality in predicted}
    motions = defaultdict[str, list[LeftOpen]](list)
    if fit is not None and posterior is not None:
        fastest = _fastest_sine(tested)
        for motion, channel, record in motions_left_open(fit, posterior, fastest):
            motions[channel].append(LeftOpen(record, motion.beyond))
    predictions = prediction_errors(fit, predicted, named & held_out, motions)
    decisive = _decisive(predictions, fit, predicted)
    if fit is None:
        return Verdict(required, predictions, decisive, fitted=False, unsound=unsound)
    unfinished = tuple(_unfinished(fit.solution))
    lost = set(weak_unknowns(fit))
    machine = [unknown.name for unknown in fit.problem.unknowns if unknown.run is None]
    causes = None if unfinished or unsound else causes_of(fit)
    return Verdict(
        required,
        predictions,
        decisive,
        unfinished=unfinished,
        unsound=unsound,
        quotable=sum(name not in lost for name in machine),
        undetermined=tuple(name for name in machine if name in lost),
        causes=causes,
        validity=_validity(fit, tested),
        fastest_sine=_fastest_sine(tested),
        commands=commands_of(fit.problem.experiments),
        judged=judged_runs(fit, predicted),
        assumed=tuple(_assumed(fit)),
        remarks=tuple(_starts(fit.starts)),
    )


# --- what decides ---------------------------------------------------------------------------------


def _decisive(
    predictions: Sequence[PredictionError],
    fit: Optimum | None,
    predicted: Sequence[RunQuality],
) -> tuple[str, ...]:
    """Channels that decide: of those that measure a drive's shaft the best, then all others."""
    fitted = fit.problem.experiments if fit else ()
    runs = [*fitted, *(quality.experiment for quality in predicted)]
    kinds = {name: channel.kind for run in runs for name, channel in run.channels.items()}
    drive = fit is None or isinstance(fit.problem.model, DriveModel)
    shaft = [
        prediction
        for prediction in predictions
        if drive and SIGNALS.get(kinds[prediction.channel]) in SHAFT
    ]
    best = min(shaft, key=lambda prediction: prediction.worst.error, default=None)
    others = [prediction.channel for prediction in predictions if prediction not in shaft]
    if best is None:
        return tuple(others)
    return (best.channel, *others)


def _unfinished(solution: Solution) -> Iterator[str]:
    """Clause on a search that did not come to its end."""
    if solution.interrupted:
        yield "the search was interrupted, and its best so far is not an optimum"
    elif not solution.converged:
        yield f"the search did not converge ({solution.message})"


# --- words ----------------------------------------------------------------------------------------


def _state(stated: ClassError, required: float) -> str:
    """Whether the stated error of a class is within what is required."""
    if isnan(stated.error):
        return "-"
    return "met" if stated.error <= required else "NOT MET"


def _starts(starts: Sequence[Solution]) -> Iterator[str]:
    """How many starts reached the best optimum, if there were several."""
    if len(starts) < 2:
        return
    costs = [solution.cost for solution in starts]
    best = min(costs)
    if isinf(best):
        yield "No start ended with a finite cost."
        return
    alike = sum(cost <= best * (1.0 + SAME) for cost in costs)
    yield f"{alike} of {len(costs)} starts reached the best cost, {best:.6g}."


def _assumed(fit: Optimum) -> Iterator[str]:
    """Phrases on what a fit cannot check: the channels' scales and the fixed parameters."""
    channels = dict[str, Channel]()
    for run in fit.problem.experiments:
        channels |= {name: run[name] for name in fit.problem.channels if name in run.channels}
    for name, channel in channels.items():
        if channel.encoder is not None:
            yield f"the scale of {name}, {channel.encoder.counts_per_turn:.6g} counts per turn"
        elif channel.instrument.gain > 0.0:
            yield f"the scale of {name} within {percent(channel.instrument.gain)}"
        else:
            yield f"the scale of {name}"
    fixed = fixed_numbers(fit)
    symbols = list(dict.fromkeys(COLUMNS[name] for name in fixed))
    if not symbols:
        return
    with_uncertainty = {name for together in fit.problem.uncertain for name in together}
    uncertain_symbols = list(
        dict.fromkeys(COLUMNS[name] for name in fixed if name in with_uncertainty)
    )
    phrase = f"the fixed {listed(symbols)} as stated"
    if uncertain_symbols:
        phrase += f", {listed(uncertain_symbols)} within a standard uncertainty"
    yield phrase


def maneuvers_tested(tested: Mapping[str, Experiment]) -> str:
    """``ramps, steps and sines of up to 0.3 Hz from -9 to 9 V``."""
    runs = list(tested.values())
    fastest = _fastest_sine(tested)
    several = {kind: f"{kind}s" for kind in ("ramp", "step", "sine", "chirp")}
    several["unnamed"] = "unnamed motions"
    kinds = dict[str, None]()
    for run in runs:
        word = run.maneuver.split(" ")[0]
        kinds[several.get(word, word)] = None
    low = min(float(experiment.input.values.min()) for experiment in runs)
    high = max(float(experiment.input.values.max()) for experiment in runs)
    phrases = [f"sines of up to {fastest:.3g} Hz" if k == "sines" and fastest else k for k in kinds]
    return f"{listed(phrases)} from {low:.3g} to {high:.3g} {runs[0].input.unit}"


def _fastest_sine(tested: Mapping[str, Experiment]) -> float:
    """Highest frequency of the sines among runs; 0 if there are none. [Hz]"""
    recognised = [run.recognised for run in tested.values() if run.recognised is not None]
    return max((maneuver.frequency or 0.0 for maneuver in recognised), default=0.0)


def _validity(fit: Optimum, tested: Mapping[str, Experiment]) -> str:
    """Sentence on the maneuvers that the fit holds for, and on limits never reached or modelled.

    Empty if nothing was commanded in any run.
    """
    if all(run.input.kind == "none" for run in tested.values()):
        return ""
    sentence = f"Holds for {maneuvers_tested(tested)}"
    if not isinstance(fit.problem.model, DriveModel):
        return f"{sentence}."
    try:
        runs = fit.problem.experiments
        parameters = fit.drive.parameters
        reached = {limit for run in runs for limit in limits_reached(run, parameters)}
    except (DomainError, InputError):
        return f"{sentence}."
    never_reached = list[str]()
    not_modelled = list[str]()
    for name, description in LIMITS.items():
        columns = [column for column in LIMIT_COLUMNS if column.startswith(name)]
        unreached = [column for column in columns if column not in reached]
        absent = [column for column in unreached if isinf(parameters.numbers[column])]
        modelled = [column for column in unreached if column not in absent]
        not_modelled += _limits_named(description, absent, columns)
        never_reached += _limits_named(description, modelled, columns)
    if never_reached:
        sentence += f"; never reached: {listed(never_reached)}"
    if not_modelled:
        sentence += f"; not in the model: {listed(not_modelled)}"
    return f"{sentence}."


def _limits_named(description: str, some: Sequence[str], columns: Sequence[str]) -> list[str]:
    """Description of a limit, with the direction if only some of its columns are meant."""
    if not some:
        return []
    if len(some) == len(columns):
        return [description]
    ways = {"plus": "positive", "minus": "negative"}
    return [f"{description} in {ways[column.rpartition('_')[2]]} direction" for column in some]
