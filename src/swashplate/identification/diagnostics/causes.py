"""Causes of an error that is not noise: each is a further unknown, tried by a refit with it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded

from swashplate.campaign import Experiment
from swashplate.errors import DomainError, InputError, ParameterError
from swashplate.identification.estimation.drive_model import (
    CURRENTS,
    DriveModel,
    measured_current,
    simulated_current,
)
from swashplate.identification.estimation.model import EquationModel, linearised
from swashplate.identification.estimation.problem import Problem
from swashplate.identification.estimation.solving import Solution, solve
from swashplate.identification.estimation.unknowns import Unknown, Unknowns
from swashplate.identification.optimum import Optimum
from swashplate.identification.statistics.effects import (
    HYSTERESIS,
    Changes,
    RunParts,
    SimulatedRun,
    source_of,
)
from swashplate.identification.validation import percent
from swashplate.parameters import CATALOGUE, COLUMNS, SWITCHES
from swashplate.results import Result
from swashplate.units import display_unit

Array = NDArray[np.float64]

EXPLAINED = 0.5
"""Part of the squared residuals that a cause must remove, and that must not be noise for anything
to be explained."""
BLOCK = 0.05
"""Time over which residuals are averaged, so that noise and ripple do not count. [s]"""
TRIED, NAMED = 5, 3
"""Causes that are tried by a refit, those first that explain most to first order; and that are
named at most."""
WORTH_TRYING = 0.2
"""Part that a cause must remove to first order to be tried: half of it may lie in the curvature."""
TOLERANCE, FEWEST_EVALUATIONS, MOST_EVALUATIONS = 1e-6, 6, 30
"""Of a refit, which begins at the optimum without the cause."""
WORK = 20_000_000
"""Samples that one refit may march in all: about 6 s."""
SAME_DIRECTION = 1e-4
"""Part of a cause's effect outside the estimates' below which both are the same: its square is a
difference, which has 16 digits less those of this one."""
COMMAND_GAIN, COMMAND_LAG = "scale of the command", "lag of the command"
RESISTED = "loss of speed under a load that resists, {}"
PULLED = "loss of speed under a load that pulls one way, {}"
SCALE, DRIFT = "scale of {}", "drift of {} over the campaign"
LATEST = 0.5
"""Delay or lag that is plausible. [s]"""
SMALL_GAIN, SMALL_LAG = 1e-3, 0.01
"""Relative change of a command, and time constant, by which their effects are found. [1], [s]"""


class Cause(NamedTuple):
    """What would explain an error that is not noise."""

    name: str
    size: float
    """Found by a refit. [SI, or 1]"""
    share: float
    """Part of the squared residuals that the refit with it removes. [1]"""
    statement: str
    """A clause that says what would be wrong, and by how much."""
    advice: str
    """What to do, as an imperative clause."""

    @property
    def words(self) -> str:
        """It in words: what would explain how much, and what to do."""
        share = f"{100.0 * self.share:.0f} %"
        return f"{self.statement}, which would explain {share} of it ({self.advice})"


@dataclass(frozen=True)
class CandidateCause(Result):
    """One thing that may be wrong, or that the model may leave out."""

    name: str
    least: float
    most: float
    """Sizes that are plausible. [SI, or 1]"""
    freed: Callable[[float], Problem]
    """The problem with it, for its size to first order."""
    states: Callable[[float], str]
    """A clause that says what would be wrong, for a size."""
    advice: str
    free: str = ""
    """Unknown that the refit estimates it by; without one it stays at its size."""


def causes_of(fit: Optimum) -> tuple[Cause, ...] | None:
    """What explains the residuals of a fit.

    Parameters
    ----------
    fit : Optimum

    Returns
    -------
    tuple of Cause, or None
        At most `NAMED`, the largest share first: each removes at least half of the squared
        residuals in a refit, and is of a plausible size. Empty if none does; None if more than half
        of the squares are noise, or the model is not one of equations.

    Notes
    -----
    Rao's score test (Rao 1948) says which are tried first: the derivative of the residuals by each
    cause, freed of what the estimates can make up for, is projected on the residuals.
    """
    # a robust loss has taken what stands out already; any object with simulate may take minutes
    if fit.solution.loss != "linear" or not isinstance(fit.problem.model, EquationModel):
        return None
    original_squares = squares_of(fit.problem, fit.solution.vector)
    if original_squares.noise_share >= EXPLAINED:
        return None
    plausible = [
        score
        for score in _scores(fit)
        if score.candidate.least < score.size < score.candidate.most and score.share > WORTH_TRYING
    ]
    plausible.sort(key=lambda score: -score.share)
    causes = list[Cause]()
    for score in plausible[:TRIED]:
        cause = _refitted(fit, score, original_squares)
        if cause is not None:
            causes.append(cause)
    causes.sort(key=lambda cause: -cause.share)
    return tuple(causes[:NAMED])


class Squares(NamedTuple):
    """Sums of squared residuals of a fit."""

    slow: float
    """Of their means over `BLOCK`."""
    fast: float
    """Of what differs from these."""
    block: float
    """Samples to a block, on average."""

    @property
    def noise_share(self) -> float:
        """Part of the slow squares that noise as large as the fast ones makes. [1]"""
        if not self.slow > 0.0:
            return 1.0
        return self.fast / (max(self.block - 1.0, 1.0) * self.slow)


def squares_of(problem: Problem, vector: Array) -> Squares:
    """Squared residuals at a point, of what is slow in them and of what is noise or ripple."""
    slow = total = samples = blocks = 0.0
    for number, run in enumerate(problem.experiments):
        for name, residual in problem.residuals(vector, number).items():
            used = run[name].used
            time = run[name].time[used]
            used_residual = residual[used]
            if time.size < 2:
                continue
            block = max(round(BLOCK / float(np.median(np.diff(time)))), 2)
            starts = np.arange(0, used_residual.size, block)
            counts = np.diff(np.append(starts, used_residual.size))
            slow += float(np.sum(np.add.reduceat(used_residual, starts) ** 2 / counts))
            total += float(used_residual @ used_residual)
            samples += used_residual.size
            blocks += starts.size
    return Squares(slow, max(total - slow, 0.0), samples / max(blocks, 1.0))


# --- to first order -------------------------------------------------------------------------------


class _Score(NamedTuple):
    candidate: CandidateCause
    size: float
    """After one Gauss-Newton step. [SI, or 1]"""
    share: float
    """Part of the squares that it removes to first order. [1]"""


def _scores(fit: Optimum) -> Iterator[_Score]:
    """Each candidate, to first order."""
    linearised_fit = fit.linearised
    candidates = {candidate.name: candidate for candidate in _candidates(fit)}
    squares = dict[str, float]()
    products = dict[str, float]()
    along = dict[str, Array]()
    scales = dict[str, list[_RunScale]]()
    jacobians = linearised_fit.jacobians()
    for number in range(len(fit.problem.experiments)):
        parts = RunParts(fit, number, jacobians)
        for name, changes in _effects(fit, number):
            if name not in candidates:
                continue
            for run, _, change in parts.weighted(changes):
                squares[name] = squares.get(name, 0.0) + float(change @ change)
                products[name] = products.get(name, 0.0) + float(change @ run.residual)
                if name == SCALE.format(run.channel):
                    # a position has a free zero
                    motion = change - change.mean()
                    run_scale = _RunScale(
                        position=number,
                        product=float(motion @ run.residual),
                        square=float(motion @ motion),
                    )
                    scales.setdefault(run.channel, []).append(run_scale)
            along[name] = along.get(name, 0.0) + parts.along(changes)
    for name, square in squares.items():
        # what the estimates cannot make up for
        remaining = square - float(along[name] @ along[name])
        if square > 0.0 and remaining > SAME_DIRECTION**2 * square:
            size = -products[name] / remaining
            share = products[name] ** 2 / (remaining * linearised_fit.squares)
            for channel, of_runs in scales.items():
                if name == DRIFT.format(channel):
                    share *= _in_order(of_runs)
            yield _Score(candidates[name], size, share)


class _RunScale(NamedTuple):
    """What the residuals of one run say of the scale of its motion."""

    position: int
    """Of the run among all."""
    product: float
    """Of motion and residuals."""
    square: float
    """Of the motion."""


def _in_order(runs: Sequence[_RunScale]) -> float:
    """Part of the differences between the scales of runs that is a straight line over their order.

    Freed of what a line explains by chance (adjusted R², Draper and Smith 1998, section 5.1): a
    machine that differs between maneuvers differs between runs too, in whatever order they stand.
    """
    moving = [run_scale for run_scale in runs if run_scale.square > 0.0]
    if len(moving) < 3:
        return 0.0
    positions = np.array([float(run_scale.position) for run_scale in moving])
    scales = np.array([run_scale.product / run_scale.square for run_scale in moving])
    total = float(np.sum((scales - scales.mean()) ** 2))
    along = positions - positions.mean()
    if not total > 0.0:
        return 0.0
    line = float(along @ scales) ** 2 / float(along @ along)
    return max(1.0 - (1.0 - line / total) * (scales.size - 1) / (scales.size - 2), 0.0)


def _effects(fit: Optimum, number: int) -> Iterator[tuple[str, Changes]]:
    """By what the residuals of one run change with one unit of each candidate."""
    problem = fit.problem
    experiment = problem.experiments[number]
    simulation = SimulatedRun(fit, number)
    outputs = simulation.of(experiment)
    position = number / max(len(problem.experiments) - 1, 1) - 0.5
    for name in problem.channels:
        if name in outputs and name in experiment.channels:
            for effect, change in _of_channel(experiment, name, outputs[name], position).items():
                yield effect, {name: change}
    if _drives(fit, experiment):
        yield from _effects_of_command(simulation, experiment, outputs)
    width = fit.setup.current_hysteresis
    if width > 0.0:
        late = simulation.behind_hysteresis(experiment)
        # half of the width is the parameter
        yield "solenoid_hysteresis", {name: 2.0 * late[name] / width for name in late}
    names = fixed_numbers(fit)
    if names:
        values = problem.model_values(fit.solution.vector, number)
        by = linearised(source_of(fit)(experiment), values, experiment, names)
        for k, name in enumerate(names):
            yield name, {channel: part.by[:, k] for channel, part in by.items()}


def _effects_of_command(
    simulation: SimulatedRun, experiment: Experiment, outputs: Mapping[str, Array]
) -> Iterator[tuple[str, Changes]]:
    """By what a run changes with one unit of what may be wrong with its command."""
    command = experiment.input
    lagged = replace(command, values=behind_lag(command.time, command.values))
    weaker = replace(command, values=(1.0 - SMALL_GAIN) * command.values)
    for effect, signal, size in (
        (COMMAND_GAIN, weaker, -SMALL_GAIN),
        (COMMAND_LAG, lagged, SMALL_LAG),
    ):
        changed = simulation.of(replace(experiment, input=signal))
        yield effect, {name: (changed[name] - outputs[name]) / size for name in outputs}


def _of_channel(
    experiment: Experiment, name: str, output: Array, position: float
) -> dict[str, Array]:
    """Changes (m,) of simulated less measured for one unit of each fault of a channel.

    Faults are those of its instrument, and a motion that the model leaves out. `position` is that
    of the run among all, from -0.5 to 0.5.
    """
    channel, time = experiment[name], experiment[name].time
    slope = np.gradient(output, time) if time.size > 2 else np.zeros_like(output)
    motion = output - output[0] if channel.is_position else output
    effects = {
        SCALE.format(name): motion,
        f"time stamps of {name}": -slope,
        f"lag of {name}": (behind_lag(time, output) - output) / SMALL_LAG,
    }
    if channel.kind not in CURRENTS:
        effects[DRIFT.format(name)] = motion * position
        effects[RESISTED.format(name)] = -lost(experiment, name, output, resisting=True)
        effects[PULLED.format(name)] = -lost(experiment, name, output, resisting=False)
    return effects


def lost(experiment: Experiment, name: str, output: Array, *, resisting: bool) -> Array:
    """(m,) what a channel lacks if its motion is slower by one unit, under a load.

    Of one that resists it while it moves, and of one that pulls one way always.
    """
    channel, time = experiment[name], experiment[name].time
    if not resisting:
        return time - time[0] if channel.is_position else np.ones_like(time)
    speed = np.gradient(output, time) if channel.is_position else output
    moves = np.abs(speed) > 0.01 * float(np.abs(speed).max(initial=0.0))
    direction = np.sign(speed) * moves
    if not channel.is_position:
        return direction
    return np.cumsum(direction * np.diff(time, prepend=time[:1]))


def behind_lag(time: Array, values: Array, lag: float = SMALL_LAG) -> Array:
    """(m,) values after a first-order lag [s], at rest before."""
    decay = np.exp(-np.diff(time) / lag)
    bands = np.vstack([np.ones(time.size), np.append(-decay, 0.0)])
    lagged = solve_banded((1, 0), bands, np.append(values[:1], (1.0 - decay) * values[1:]))
    # a full command stays one, whatever the last digit
    return np.asarray(np.clip(lagged, values.min(), values.max()))


# --- what is looked for ---------------------------------------------------------------------------


def _candidates(fit: Optimum) -> Iterator[CandidateCause]:
    """Everything that may be freed."""
    for name in fit.problem.channels:
        yield from _of_readings(fit, name)
    if isinstance(fit.problem.model, DriveModel):
        yield from _of_commands(fit)
        yield from _of_numbers(fit)


def _of_readings(fit: Optimum, name: str) -> Iterator[CandidateCause]:
    """What may be wrong with an instrument, or with the motion that it reads."""
    channels = [run[name] for run in fit.problem.experiments if name in run.channels]
    read = partial(_with_reading, fit, name)
    check = f"check the instrument of {name}"
    yield CandidateCause(
        name=SCALE.format(name),
        least=-0.3,
        most=0.3,
        freed=partial(read, _scaled),
        states=lambda size: (
            f"{name} reads {percent(abs(size))} too {'much' if size > 0.0 else 'little'}"
        ),
        advice=check,
    )
    yield CandidateCause(
        name=f"time stamps of {name}",
        least=-LATEST,
        most=LATEST,
        freed=partial(read, _late),
        states=lambda size: f"{name} is {_time(abs(size))} {'late' if size > 0.0 else 'early'}",
        advice="compare its clock with that of the command, and check for a delay of the machine",
    )
    yield CandidateCause(
        name=f"lag of {name}",
        least=0.0,
        most=LATEST,
        freed=partial(read, _undone_lag),
        states=lambda size: f"{name} lags by {_time(size)}",
        advice=f"{check} for a filter",
    )
    if channels[0].kind in CURRENTS:
        return
    yield CandidateCause(
        name=DRIFT.format(name),
        least=-0.5,
        most=0.5,
        freed=partial(read, _undone_drift),
        states=lambda size: (
            f"{name} {'rises' if size > 0.0 else 'falls'} by {percent(abs(size))} from the first "
            "run to the last"
        ),
        advice="warm the oil to its working temperature, and test again",
    )
    unit = channels[0].unit
    unit = unit if unit.endswith("/s") else f"{unit}/s"
    for kind, resisting, load in (
        (RESISTED, True, "a load that resists the motion"),
        (PULLED, False, "a load that pulls one way"),
    ):
        yield CandidateCause(
            name=kind.format(name),
            least=0.0 if resisting else -np.inf,
            most=np.inf,
            freed=partial(read, partial(_undone_loss, resisting=resisting)),
            states=partial(_lost_speed, unit, load),
            advice="check for that load, and for a leaking motor",
        )


def _time(size: float) -> str:
    return f"{1e3 * size:.3g} ms"


def _lost_speed(unit: str, load: str, size: float) -> str:
    display = display_unit(unit, abs(size))
    return f"{display.factor * size:.3g} {display.name} of speed are lost to {load}"


def _of_commands(fit: Optimum) -> Iterator[CandidateCause]:
    """What may be wrong with the command, or with what takes it."""
    yield CandidateCause(
        name=COMMAND_GAIN,
        least=-0.3,
        most=0.3,
        freed=partial(_with_command, fit, _gained),
        # what acts is larger than what is read
        states=lambda size: (
            f"the command reads {percent(abs(size))} too {'little' if size > 0.0 else 'much'}"
        ),
        advice="check its converter",
    )
    yield CandidateCause(
        name=COMMAND_LAG,
        least=0.0,
        most=LATEST,
        freed=partial(_with_command, fit, _lagging),
        states=lambda size: f"the command lags by {_time(size)} on its way to the amplifier",
        advice="check for a filter or delay there",
    )


def _of_numbers(fit: Optimum) -> Iterator[CandidateCause]:
    """What of the drive is fixed, and the hysteresis that it is taken not to have."""
    runs = fit.problem.experiments
    largest = max(float(np.abs(_driving(fit, run)).max()) for run in runs)
    name = "solenoid_hysteresis"
    yield CandidateCause(
        name=name,
        least=0.0,
        most=0.1 * largest,
        freed=partial(_with_freed_number, fit, name),
        states=lambda size: (
            f"spool and solenoids have a friction or hysteresis of ±{1e3 * size:.3g} mA, "
            f"{percent(size / largest)} of the largest current"
        ),
        advice=f"check the dither; let the fit setup estimate {name}",
        free=name,
    )
    numbers = fit.parameters.numbers
    for name in fixed_numbers(fit):
        value, definition = numbers[name], CATALOGUE[COLUMNS[name]]
        low, high = sorted((-0.5 * value, value))
        if definition.unit == "s":
            low, high = -value, LATEST
        yield CandidateCause(
            name=name,
            least=low,
            most=high,
            freed=partial(_with_freed_number, fit, name),
            states=partial(_other_value, name, definition.unit, value),
            advice=f"measure it ({definition.name}), or let the fit setup estimate it",
            free=name,
        )


def _other_value(name: str, unit: str, stated: float, size: float) -> str:
    return f"{name} is {stated + size:.3g} {unit} instead of the stated {stated:.3g}"


def fixed_numbers(fit: Optimum) -> list[str]:
    """Columns of the drive that the fitted part has, that are not estimated, and that act."""
    model = fit.problem.model
    if not isinstance(model, DriveModel):
        return []
    taken = {target for unknown in fit.problem.unknowns for target in unknown.targets}
    if model.forces is not None:
        taken |= {name for name in COLUMNS if COLUMNS[name] in ("Z19", "Z20", "Z21", "Z22")}
    block = {"card": ("control_card",), "pump": ("pump_motor",)}.get(
        model.part, ("control_card", "pump_motor")
    )
    numbers = fit.parameters.numbers
    return [
        name
        for name, symbol in COLUMNS.items()
        if CATALOGUE[symbol].block in block and name not in taken
        if numbers.get(name, 0.0) != 0.0 and isfinite(numbers[name])
    ]


def _drives(fit: Optimum, experiment: Experiment) -> bool:
    """Whether the command of a run acts on what is simulated of it."""
    model = fit.problem.model
    if not isinstance(model, DriveModel) or experiment.input.kind != "voltage":
        return False
    return model.part != "pump" or fit.setup.current == "simulated"


def _driving(fit: Optimum, experiment: Experiment) -> Array:
    """(m,) the current of a run, or its input. [A]"""
    model = fit.problem.model
    assert isinstance(model, DriveModel)
    record = model.currents.get(experiment.name)
    return experiment.input.values if record is None else record.values


# --- a refit with it ------------------------------------------------------------------------------


def _refitted(fit: Optimum, score: _Score, original_squares: Squares) -> Cause | None:
    """A candidate after a refit; None if it does not remove half of the squares."""
    candidate = score.candidate
    best = _solved(fit, candidate, score.size, original_squares)
    if best is None:
        return None
    size, share = best
    if not candidate.free:
        # along the size the squares are a parabola: its slope at 0 is known
        curvature = share - 2.0 * score.share
        if curvature < 0.0 and abs(score.share / curvature + 1.0) > 0.1:
            other_size = -score.share / curvature * score.size
            other_fit = _solved(fit, candidate, other_size, original_squares)
            if other_fit is not None and other_fit[1] > share:
                size, share = other_fit
    if share < EXPLAINED or not candidate.least < size < candidate.most:
        return None
    return Cause(candidate.name, size, share, candidate.states(size), candidate.advice)


def _solved(
    fit: Optimum, candidate: CandidateCause, size: float, original_squares: Squares
) -> tuple[float, float] | None:
    """Size of a candidate and the share of the squares that a refit removes; None if it fails."""
    problem, vector = fit.problem, fit.solution.vector
    try:
        freed = candidate.freed(size)
        start = freed.start.copy()
        estimated = dict(zip(problem.unknowns.names, vector, strict=True))
        for k, name in enumerate(freed.unknowns.names):
            if name in estimated:
                start[k] = estimated[name]
        most = min(max(WORK // problem.samples, FEWEST_EVALUATIONS), MOST_EVALUATIONS)
        solution: Solution = solve(freed, start, tolerance=TOLERANCE, max_evaluations=most)
        share = 1.0 - squares_of(freed, solution.vector).slow / original_squares.slow
    except (DomainError, InputError, ParameterError):
        return None
    if candidate.free:
        value = freed.unknowns.values(solution.vector)[candidate.free]
        size = value - fit.parameters.numbers.get(candidate.free, 0.0)
    return size, share


def _with_freed_number(fit: Optimum, name: str, change: float) -> Problem:
    """The problem with a fixed number of the drive as a further unknown.

    `change` is that of the number to first order, from which the refit starts.
    """
    problem = fit.problem
    model = problem.model
    assert isinstance(model, DriveModel)
    value = fit.parameters.numbers.get(name, 0.0)
    start = value + change
    if name in HYSTERESIS:
        freed = Unknown(name, start, 0.01 * start, 20.0 * start, log=True)
        options = model.parameters.options | {SWITCHES[name]}
        model = replace(model, parameters=model.parameters.with_numbers({name: start}, options))
    else:
        is_time = CATALOGUE[COLUMNS[name]].unit == "s"
        if is_time:
            low = 0.0
            high = value + LATEST
        else:
            low, high = sorted((0.4 * value, 2.1 * value))
        freed = Unknown(name, start, low, high)
    unknowns = Unknowns((*problem.unknowns.items, freed))
    return replace(problem, model=model, unknowns=unknowns)


def _with_reading(fit: Optimum, name: str, undo: Callable[..., Experiment], size: float) -> Problem:
    """The problem with one channel as it would read without a fault of a size."""
    problem, runs = fit.problem, list[Experiment]()
    count = len(problem.experiments)
    for number, run in enumerate(problem.experiments):
        if name in run.channels:
            output = problem.outputs(fit.solution.vector, number)[name]
            position = number / max(count - 1, 1) - 0.5
            run = undo(run, name, output, position, size)
        runs.append(run)
    return replace(problem, experiments=tuple(runs))


def _with_values(run: Experiment, name: str, values: Array) -> Experiment:
    channels = {**run.channels, name: replace(run[name], values=values, counts=None)}
    return replace(run, channels=channels)


def _from_zero(run: Experiment, name: str) -> tuple[Array, Array]:
    """Readings of a channel relative to its zero, and the zero (1,): a position's first reading."""
    values = run[name].values
    zero = values[:1] if run[name].is_position else np.zeros(1)
    return values - zero, zero


def _scaled(run: Experiment, name: str, _: Array, __: float, size: float) -> Experiment:
    readings, zero = _from_zero(run, name)
    return _with_values(run, name, zero + readings / (1.0 + size))


def _undone_drift(run: Experiment, name: str, _: Array, position: float, size: float) -> Experiment:
    readings, zero = _from_zero(run, name)
    return _with_values(run, name, zero + readings / (1.0 + size * position))


def _late(run: Experiment, name: str, _: Array, __: float, size: float) -> Experiment:
    channel = replace(run[name], time=run[name].time - size)
    return replace(run, channels={**run.channels, name: channel})


def _undone_lag(run: Experiment, name: str, output: Array, _: float, size: float) -> Experiment:
    """As read by an instrument without a lag: what it lacks is added as it is simulated."""
    lacks = output - behind_lag(run[name].time, output, size)
    return _with_values(run, name, run[name].values + lacks)


def _undone_loss(
    run: Experiment, name: str, output: Array, _: float, size: float, *, resisting: bool
) -> Experiment:
    lacks = lost(run, name, output, resisting=resisting)
    return _with_values(run, name, run[name].values + size * lacks)


def _with_command(
    fit: Optimum, change: Callable[[Array, Array, float], Array], size: float
) -> Problem:
    """The problem with another command, and the currents that follow from it."""
    problem, model = fit.problem, fit.problem.model
    assert isinstance(model, DriveModel)
    runs, currents = list[Experiment](), dict(model.currents)
    for run in problem.experiments:
        signal = run.input
        largest = float(np.abs(signal.values).max())
        values = np.clip(change(signal.time, signal.values, size), -largest, largest)
        shifted = replace(run, input=replace(signal, values=values))
        runs.append(shifted)
        if run.name in currents:
            if _drives(fit, run):
                currents[run.name] = simulated_current(shifted, model.parameters)
            else:
                currents[run.name] = measured_current(shifted, fit.setup.current_scale)
    return replace(problem, experiments=tuple(runs), model=replace(model, currents=currents))


def _gained(_: Array, values: Array, size: float) -> Array:
    return (1.0 + size) * values


def _lagging(time: Array, values: Array, size: float) -> Array:
    return behind_lag(time, values, size)
