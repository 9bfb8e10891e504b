"""Whether the data are sound: runs against the model that was fitted to all of them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from swashplate.campaign import Experiment
from swashplate.identification.diagnostics.data_checks import (
    Finding,
    clipped_channels,
    contradicting_runs,
    refusal,
)
from swashplate.identification.diagnostics.discrepancy import (
    COMMANDED,
    USUAL_SPREAD,
    WORTH,
    ChannelErrors,
    ErrorsOfRuns,
    PredictionError,
    WindowCell,
    bound_of_variance,
    cells_of,
    errors_of_runs,
    log_ratio,
    raised,
    variance_function,
    window_weights,
    windowed,
    without_runs,
)
from swashplate.identification.estimation.drive_model import DriveModel
from swashplate.identification.optimum import Optimum
from swashplate.identification.validation import RunQuality

Array = NDArray[np.float64]

FALSE_ALARM = 0.01
"""Probability that a run of a sound campaign is taken for unsound."""
FEWEST_RUNS = 3
"""Of which one can stand out."""
WINDOW = 0.12
"""Time over which a run's error is explained. [s]"""
EXPLAINED = 0.25
"""Part of a run's squared error that may be left of it by what explains it."""
LATEST = 2.0
"""Delay that is looked for. [s]"""
STANDS_STILL = 0.5
"""Time for which the reading of a sound sensor on a moving machine does not stand still. [s]"""
MOVES, STEPS = 0.2, 10.0
"""Part of the largest speed from which a machine moves, and steps of the reading that it then moves
by at least."""


def unsound_data(
    fit: Optimum | None,
    predicted: Sequence[RunQuality],
    expected: Sequence[PredictionError] = (),
    commands: CommandRange | None = None,
) -> list[Finding]:
    """What in the data cannot be right, with the line to write in the campaign file.

    Parameters
    ----------
    fit : Optimum or None
        None for a drive that is only compared with runs.
    predicted : sequence of RunQuality
        Of runs that were held out.
    expected : sequence of PredictionError
        What the fit of a drive that is only compared with runs stated of a new maneuver.
    commands : CommandRange, optional
        Of the runs that such a drive was fitted to.
    """
    findings = list[Finding]()
    if fit is not None:
        fitted = {run.name: run for run in fit.problem.experiments}
        held_out = {quality.experiment.name: quality.experiment for quality in predicted}
        runs = list((fitted | held_out).values())
        if isinstance(fit.problem.model, DriveModel):
            findings += contradicting_runs(runs, fit.drive.parameters)
        findings += clipped_channels(runs)
    for search in (
        unexplained_runs(fit, predicted, expected, commands),
        outlying_runs(fit, predicted),
    ):
        named = {finding.run for finding in findings}
        findings += [finding for finding in search if finding.run not in named]
    return findings


class JudgedRuns(NamedTuple):
    """Runs of a fit that `unsound_data` can say something of."""

    compared: bool = True
    """Whether the fitted ones are enough to tell that one stands out."""
    held_out: int = 0
    """Those that were held out and are compared with the fitted ones."""
    beyond: tuple[str, ...] = ()
    """Those whose command goes beyond the fitted ones, so that they are not compared."""


def judged_runs(fit: Optimum, predicted: Sequence[RunQuality]) -> JudgedRuns:
    """The runs of a fit that are judged: those that move long enough to have an error."""
    commands = commands_of(fit.problem.experiments)
    beyond = [q.experiment.name for q in predicted if not commands.holds(q.experiment)]
    compared, held_out = 0, set[str]()
    for channel in fit.problem.channels:
        fitted, _ = cells_of(_records(fit, channel, (), ()))
        compared = max(compared, len({cell.run for cell in fitted}))
        if fitted:
            cells, _ = cells_of(_records(None, channel, predicted, ()))
            held_out |= {cell.run for cell in cells}
    return JudgedRuns(
        compared >= FEWEST_RUNS, len(held_out.difference(beyond)), tuple(dict.fromkeys(beyond))
    )


def unexplained_runs(
    fit: Optimum | None,
    predicted: Sequence[RunQuality],
    expected: Sequence[PredictionError] = (),
    commands: CommandRange | None = None,
) -> Iterator[Finding]:
    """Runs that were held out and that noise and discrepancy do not explain, each once.

    Parameters
    ----------
    fit, predicted, expected, commands
        As of `unsound_data`.

    Notes
    -----
    The fitted runs, each as if its maneuver had been left out, say how large the squared error of
    a new maneuver is: `discrepancy.bound_of_variance`, here for the probability that no run of a
    sound campaign exceeds it, shared among the runs (Bonferroni). A run that was held out
    is no part of this, so that several which are wrong, or all, cannot vouch for each other. What
    the instrument's gain may be off is expected of the motion, and so is what the fit leaves open
    of this run. Of a drive that is only compared
    with runs the errors that its fit stated say it. A run whose command goes beyond those of the
    fitted runs is an extrapolation, of which they let one expect nothing: it is not judged here,
    but the stated error is no less than its own.
    """
    if fit is not None:
        commands = commands_of(fit.problem.experiments)
    predicted = [q for q in predicted if commands is None or commands.holds(q.experiment)]
    if not predicted:
        return
    named = set[str]()
    runs = {quality.experiment.name for quality in predicted}
    level = 1.0 - FALSE_ALARM / len(runs)
    for expectation in _expectations(fit, predicted, expected, level):
        for finding in _beyond(expectation):
            if finding.run not in named:
                named.add(str(finding.run))
                yield finding


class CommandRange(NamedTuple):
    """Smallest and largest command of some runs."""

    kind: str
    """Of the command, as of `InputSignal.kind`."""
    low: float
    """[unit of the command]"""
    high: float
    """[unit of the command]"""

    def holds(self, run: Experiment) -> bool:
        """Whether the command of a run stays in the range, as far as one can tell."""
        values = run.input.values
        over = COMMANDED * max(abs(self.low), abs(self.high))
        inside = self.low - over <= values.min() and values.max() <= self.high + over
        return run.input.kind != self.kind or bool(inside)


def commands_of(runs: Sequence[Experiment]) -> CommandRange:
    """The range of the commands of one run at least, of those of the first one's kind."""
    kind = runs[0].input.kind
    values = [run.input.values for run in runs if run.input.kind == kind]
    low, high = min(each.min() for each in values), max(each.max() for each in values)
    return CommandRange(kind, float(low), float(high))


class _Expectation(NamedTuple):
    """What one channel of the runs that were held out is compared with."""

    channel: str
    records: ErrorsOfRuns
    cells: Sequence[WindowCell]
    median: Array
    """(3,) coefficients of the squared error that half of all new maneuvers do not exceed."""
    limit: Array
    """(3,) of the one that no run of a sound campaign exceeds."""
    level: float
    """Probability of that, for one run."""


def _expectations(
    fit: Optimum | None,
    predicted: Sequence[RunQuality],
    expected: Sequence[PredictionError],
    level: float,
) -> Iterator[_Expectation]:
    """Of each channel of a fit, or else of each channel whose error a fit stated."""
    for channel in fit.problem.channels if fit else ():
        records = errors_of_runs(channel, fit, predicted)
        cells, _ = cells_of(records)
        fitted = [cell for cell in cells if not cell.held_out]
        if not fitted:
            continue
        median, limit = bound_of_variance(fitted, 0.5), bound_of_variance(fitted, level)
        limit[1] += _gain(channel, predicted) ** 2 / 3.0
        yield _Expectation(channel, records, cells, median, limit, level)
    for stated in () if fit else expected:
        records = ErrorsOfRuns(
            tuple((q, None, True) for q in predicted if q.channel == stated.channel)
        )
        cells, reach = cells_of(records)
        if cells:
            median, limit = raised(stated, reach, 0.5), raised(stated, reach, level)
            yield _Expectation(stated.channel, records, cells, median, limit, level)


def _gain(channel: str, predicted: Sequence[RunQuality]) -> float:
    """How far the gain of a channel's instrument may be off. [1]"""
    gains = [q.experiment[channel].instrument.gain for q in predicted if q.channel == channel]
    return max(gains, default=0.0)


def _beyond(expectation: _Expectation) -> Iterator[Finding]:
    """Runs that were held out whose squares are beyond the limit."""
    channel, records, cells, median, limit, level = expectation
    by_run = defaultdict[str, list[WindowCell]](list)
    for cell in cells:
        if cell.held_out:
            by_run[cell.run].append(cell)
    for run, of_run in by_run.items():
        if log_ratio(of_run, limit, level) <= 0.0:
            continue
        record = next(record for record in records if record.run == run)
        error_ratio = float(np.exp(0.5 * log_ratio(of_run, median, 0.5)))
        fault = (
            f"{run}: '{channel}', which was held out, is {error_ratio:.2g} times as far from the "
            "prediction as the fitted runs lead one to expect"
        )
        yield refusal(run, channel, _sentence(record, fault, records))


def outlying_runs(fit: Optimum | None, predicted: Sequence[RunQuality]) -> Iterator[Finding]:
    """Runs whose errors are far larger than those of the others, each once, and why.

    The runs of a fit are compared with each other; without a fit those that are predicted. A
    maneuver of which every run stands out shows what the model lacks, and not an unsound log. The
    linearised fit is computed if it is not there yet.

    Notes
    -----
    Logarithms of the squared errors, each over what the variance function lets expect, are
    compared with their median; the run that is farthest above it is left out of the fit, so that
    it does not spoil those of the others, and compared again, until one does not stand out. The
    robust deviation is joined with what is usual, as in `discrepancy`; the limit is a quantile of
    Student's distribution, shared among the runs.
    """
    named = set[str]()
    channels = [quality.channel for quality in predicted]
    if fit is not None:
        runs = fit.problem.experiments
        kinds = {name: channel.kind for run in runs for name, channel in run.channels.items()}
        # what the model cannot describe tells of no single run
        channels = [n for n in fit.problem.channels if not fit.setup.counts_less(kinds[n])]
    for channel in dict.fromkeys(channels):
        for finding in _outliers_by_channel(fit, channel, predicted):
            if finding.run not in named:
                named.add(str(finding.run))
                yield finding


def _outliers_by_channel(
    fit: Optimum | None, channel: str, predicted: Sequence[RunQuality]
) -> list[Finding]:
    """The runs that one channel shows to be outliers, found one by one.

    None if these would be half of all: runs that all disagree show what the model lacks.
    """
    findings = list[Finding]()
    excluded = list[str]()
    while True:
        ratios = _ErrorRatios.of(_records(fit, channel, predicted, excluded), excluded)
        suspect = None if ratios is None else ratios.farthest
        if suspect is None:
            break
        # the suspect must stand out from a fit that it does not influence
        excluded.append(suspect)
        records = _records(fit, channel, predicted, excluded)
        ratios = _ErrorRatios.of(records, excluded)
        if ratios is None:
            break
        log_excess = ratios.excess(suspect)
        if log_excess <= ratios.limit or ratios.is_shared(suspect):
            break
        record = next(record for record in records if record.run == suspect)
        error_ratio = float(np.exp(0.5 * log_excess))
        fault = (
            f"{suspect}: '{channel}' is {error_ratio:.2g} times as far from the simulation as in "
            "the other runs"
        )
        findings.append(refusal(suspect, channel, _sentence(record, fault, records)))
        if 2 * len(findings) >= len(ratios.ratios):
            return []
    return findings


def _records(
    fit: Optimum | None,
    channel: str,
    predicted: Sequence[RunQuality],
    without: Sequence[str],
) -> ErrorsOfRuns:
    """A channel of the fitted runs, as the fit without some of them simulates it.

    Without a fit of the runs that are predicted.
    """
    if fit is None:
        return ErrorsOfRuns(tuple((q, None, True) for q in predicted if q.channel == channel))
    errors = dict[str, Array]()
    if without:
        errors = {
            run.name: error
            for run, error in without_runs(fit.linearised, without)
            if run.channel == channel
        }
    return ErrorsOfRuns(
        tuple(
            (quality, errors.get(quality.experiment.name), False)
            for quality in fit.qualities
            if quality.channel == channel
        )
    )


@dataclass(frozen=True)
class _ErrorRatios:
    """Logarithms of the runs' squared errors, to compare with those of the sound runs."""

    ratios: Mapping[str, float]
    """By run."""
    maneuvers: Mapping[str, str]
    sound: tuple[str, ...]
    """Runs that the others are compared with."""

    @classmethod
    def of(cls, records: Iterable[ChannelErrors], without: Sequence[str]) -> _ErrorRatios | None:
        """Those of some records; None if too few runs are left to compare with."""
        cells, _ = cells_of(records)
        runs = defaultdict[str, list[WindowCell]](list)
        for cell in cells:
            runs[cell.run].append(cell)
        sound = tuple(name for name in runs if name not in without)
        if len(sound) < FEWEST_RUNS - 1:
            return None
        coefficients = variance_function([cell for name in sound for cell in runs[name]])
        ratios = {
            name: log_ratio(cells_of_run, coefficients) for name, cells_of_run in runs.items()
        }
        maneuvers = {cell.run: cell.maneuver for cell in cells}
        return cls(ratios, maneuvers, sound)

    @property
    def _sound_ratios(self) -> Array:
        return np.array([self.ratios[name] for name in self.sound])

    def excess(self, run: str) -> float:
        """Logarithm of a run's squared error over the median of the sound ones."""
        if run not in self.ratios:
            return 0.0
        return self.ratios[run] - float(np.median(self._sound_ratios))

    @property
    def farthest(self) -> str | None:
        """The run that is farthest above the median."""
        if len(self.sound) < FEWEST_RUNS:
            return None
        return max(self.sound, key=lambda run: self.ratios[run])

    @property
    def limit(self) -> float:
        """How far a run may be above the median."""
        ratios = self._sound_ratios
        count = len(self.sound)
        squared = (float(np.median(np.abs(ratios - np.median(ratios)))) / 0.6745) ** 2
        freedom = count - 1.0 + WORTH
        variance = ((count - 1.0) * squared + WORTH * USUAL_SPREAD**2) / freedom
        quantile = float(stdtrit(freedom, 1.0 - FALSE_ALARM / (count + 1.0)))
        return quantile * float(np.sqrt(variance * (1.0 + 1.0 / count)))

    def is_shared(self, run: str) -> bool:
        """Whether each other run of its maneuver stands out, too."""
        others = [name for name in self.sound if self.maneuvers[name] == self.maneuvers[run]]
        half = 0.5 * self.excess(run)
        return bool(others) and all(self.excess(name) > half for name in others)


# --- why ------------------------------------------------------------------------------------------


def _sentence(record: ChannelErrors, fault: str, records: Iterable[ChannelErrors]) -> str:
    """What is wrong with a run, if that can be found out, and the line to write."""
    measured, simulated = _motion(record)
    mean_square = float(np.mean((simulated - measured) ** 2))
    ignored = 'leave it out with role = "ignore"'
    standstill = _standstill(record)
    if standstill is not None:
        first, last = standstill
        return (
            f"{fault}: it does not move from {first:.4g} to {last:.4g} s. Check the sensor; ignore "
            f"this window, or {ignored}."
        )
    delay, mean_square_delayed = _delayed(record, measured, simulated)
    if mean_square_delayed < EXPLAINED * mean_square:
        side = "late" if delay > 0.0 else "early"
        return (
            f"{fault}: it comes {1e3 * abs(delay):.3g} ms {side} relative to its command. Check "
            f"the logger's clock in this run, shift the log, or {ignored}."
        )
    gain = float(measured @ simulated) / float(simulated @ simulated or 1.0)
    if np.mean((gain * simulated - measured) ** 2) < EXPLAINED * mean_square:
        return (
            f"{fault}: it moves {gain:.3g} times as far. Check its unit, scale and "
            f"counts_per_turn, or {ignored}."
        )
    for other_record in records:
        if _follows(record, measured, other_record, EXPLAINED * mean_square):
            return (
                f"{fault}, but follows the command of {other_record.run}: are their logs swapped? "
                f"Give each run its own file, or {ignored}."
            )
    return f"{fault}. Is it a log of this axis and this command? If not, {ignored}."


def _follows(
    record: ChannelErrors, measured: Array, other_record: ChannelErrors, least: float
) -> bool:
    """Whether a run moves as another run of another maneuver is simulated."""
    if other_record.maneuver == record.maneuver or abs(other_record.step - record.step) > 1e-9:
        return False
    _, simulated = _motion(other_record)
    size = min(simulated.size, measured.size)
    if size < 0.5 * max(simulated.size, measured.size):
        return False
    return bool(np.mean((simulated[:size] - measured[:size]) ** 2) < least)


def _motion(record: ChannelErrors) -> tuple[Array, Array]:
    """(m,) what was measured and what is simulated over short windows; of a position speeds."""
    weights = window_weights(record, WINDOW)
    measured = windowed(record.measured, weights)
    simulated = windowed(record.measured + record.error, weights)
    complete = np.isfinite(measured)
    return measured[complete], simulated[complete]


def _delayed(record: ChannelErrors, measured: Array, simulated: Array) -> tuple[float, float]:
    """Delay of what was measured at which it is nearest [s], and the mean square left then."""
    most = min(int(LATEST / record.step), measured.size // 4)
    shifts = np.arange(-most, most + 1)
    mean_squares = np.full(shifts.size, np.inf)
    for k, shift in enumerate(shifts.tolist()):
        if shift >= 0:
            errors = measured[shift:] - simulated[: simulated.size - shift]
        else:
            errors = measured[:shift] - simulated[-shift:]
        mean_squares[k] = np.mean(errors**2)
    best = int(np.argmin(mean_squares))
    return float(shifts[best] * record.step), float(mean_squares[best])


def _standstill(record: ChannelErrors) -> tuple[float, float] | None:
    """First and last instant at which a position stands still though the model moves. [s]"""
    if not record.is_position:
        return None
    moves = np.abs(record.signal) > MOVES * float(np.abs(record.signal).max())
    is_still = (np.diff(record.measured, prepend=np.nan) == 0.0) & moves
    # a coarse encoder has many samples a count
    steps = np.abs(np.diff(record.measured))
    count = float(steps[steps > 0.0].min(initial=np.inf))
    simulated_way = np.abs(np.diff(np.cumsum(record.signal) * record.step, prepend=0.0))
    edges = np.flatnonzero(np.diff(is_still, prepend=False, append=False)).reshape(-1, 2)
    for first, stop in edges.tolist():
        long = (stop - first) * record.step > STANDS_STILL
        if long and float(simulated_way[first:stop].sum()) > STEPS * count:
            start, step = record.start, record.step
            return start + (first - 1) * step, start + (stop - 1) * step
    return None
