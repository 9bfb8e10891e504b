"""Lack of fit: what is left in residuals that noise does not explain, and what would explain it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import degrees, inf, isfinite, sqrt
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded

from swashplate.campaign.experiment import Channel, Experiment
from swashplate.errors import DomainError
from swashplate.identification.drive_model import CURRENTS, DriveModel
from swashplate.identification.model import OFFSET, Model, linearised, simulated
from swashplate.identification.problem import TOLERANCE, triangular_factor
from swashplate.parameters.definitions import CATALOGUE, COLUMNS, columns_of
from swashplate.tables import listed

if TYPE_CHECKING:
    from swashplate.identification.assessment import Assessment
    from swashplate.identification.problem import Problem

Array = NDArray[np.float64]

EXPLAINS = 0.2
"""Part of the residuals' squares from which a fault is named as a likely cause."""

SIGNIFICANT = 20.0
"""Standard errors from which a fault's size is taken for one. They are those of one step and of
independent samples: where fixed parameters are 3 % off, as stated, sizes that would matter reach 13
of them in sound campaigns, and 35 where an ammeter of slew reads 3 % too much."""

SAME_DIRECTION = 1e-6
"""Part of a fault's effect outside the estimates' below which both are the same: derivatives are
exact to about 1e-9, and a fault of 3 % would then leave 3e-8 of the signal."""

PLAUSIBLE_SCALE = 0.03
"""Error of an instrument's scale that occurs without notice: a wheel, a clamp, a gear. [1]"""

PLAUSIBLE_DELAY = 0.01
"""Error of time stamps that occurs without notice: a filter, a logger's buffer. [s]"""

COMMAND_CHANGE = 1e-3
"""Relative change of the command by which its effect is found, downwards: 10 V is the limit. [1]"""

SAME_STAMPS = 0.01
"""The same of late stamps and a longer delay, compared by whole samples: stamps have jitter. [1]"""

LAG = 0.01
"""Time constant by which the effect of a slow instrument or amplifier is found. [s]"""

EQUAL = 0.8
"""Part of what the best cause explains from which another one is about as good: sizes are those of
one step, and causes of different kind imitate each other to about that."""

MOST_CAUSES = 4
"""Causes that are named."""

FAR = 100.0
"""One-step estimate of a relative error beyond which one step says nothing, tau's apart. [%]"""

UNTOLD = 1e-4
"""Part of a fixed parameter's effect outside the estimates' below which it is a unit of them."""

LOSS, STAMPS, SLOW = "loss at the largest speeds of ", "time stamps of ", "lag of "
"""What names of faults begin with: a counter that does not follow, late stamps, slow instruments
or amplifiers."""

MEANS = {
    STAMPS: " (or a delay or lag that the model leaves out)",
    f"{SLOW}the command": " (an amplifier or filter that the model leaves out)",
    SLOW: " (a slow instrument)",
}
"""What else a fault may be, by what its name begins with."""

UNCERTAIN = "fixed: "
"""What the name of a fixed parameter with a standard uncertainty begins with: an estimate that its
value, as a measurement, is part of."""

FIXED_OFF = 0.1
"""Standard deviation by which a fixed parameter without a stated one may be off. [1]"""

FASTEST = 0.99
"""Part of the largest measured speed beyond which a counter is asked whether it follows."""

WINDOW = 0.0625
"""Time over which that speed is taken. [s]"""

DWELLS = 0.1
"""Time for which a noisy channel stands at its very largest value only if it is clipped. [s]"""


@dataclass(frozen=True, eq=False)
class Fault:
    """Something wrong with machine or instruments that would change what is measured in one way."""

    name: str
    """``"scale of counts"``, ``"time stamps of current"``, or a fixed parameter: ``"tau"``."""
    unit: str
    size: float
    """One-step estimate from the residuals, all estimates following. [unit]"""
    standard_error: float
    """Of the size, all estimates following; inf where they make up for it. [unit]"""
    share: float
    """Part of the residuals' squares that it explains beyond the estimates. [1]"""
    outside: float
    """Part of its effect that no change of the estimates makes up for. [1]"""
    same_as: tuple[str, ...]
    """Estimates that make up for it, the largest effect first."""
    plausible: float = inf
    """Size that occurs without notice; inf for what is no fault of an instrument. [unit]"""
    with_fixed: float = 0.0
    """Standard error of the size if each fixed parameter may be off by 10 %. [unit]"""
    fixed: tuple[str, ...] = ()
    """Fixed parameters that then make up for it, the largest effect first."""

    @property
    def visible(self) -> bool:
        """Whether the logs tell one of plausible size from other estimates."""
        return self.outside > SAME_DIRECTION and 2.0 * self.standard_error < self.plausible

    @property
    def hidden(self) -> bool:
        """Whether one of plausible size passes as other estimates, or as other fixed values."""
        told = self.visible and 2.0 * self.with_fixed < self.plausible
        return isfinite(self.plausible) and not told

    @property
    def significant(self) -> bool:
        """Whether its size is told from none."""
        return abs(self.size) > SIGNIFICANT * self.standard_error

    @property
    def explains(self) -> bool:
        """Whether it explains a large part of the residuals."""
        return self.share > EXPLAINS

    @property
    def words(self) -> str:
        """Its name, and the fixed parameters that might be wrong in its place."""
        either = self.visible and self.hidden and self.fixed
        return f"{self.name}, or of the fixed {listed(self.fixed)}," if either else self.name

    @property
    def near(self) -> bool:
        """Whether one step says how large it is, or it has no size; no lag is below 0."""
        if self.name.startswith(SLOW):
            return self.size > 0.0
        return self.unit != "%" or self.name == "tau" or self.lost or abs(self.size) <= FAR

    @property
    def lost(self) -> bool:
        """Whether it is a counter that does not follow."""
        return self.name.startswith(LOSS)

    @property
    def cause(self) -> str:
        """It as a likely cause, in words."""
        size = "" if self.lost else f" by {self.size:+.3g} {self.unit}"
        start = next((each for each in MEANS if self.name.startswith(each)), "")
        return f"{self.name}{MEANS.get(start, '')}{size}"

    @property
    def assumption(self) -> str:
        """It as an assumption, in words."""
        if self.visible:
            below = ""
            if isfinite(self.with_fixed):
                below = f" below {2.0 * self.with_fixed:.2g} {self.unit}"
            return f"{self.name}: an error{below} can be one of the fixed {listed(self.fixed)}"
        if isfinite(self.standard_error):
            return (
                f"{self.name}: an error below {2.0 * self.standard_error:.2g} {self.unit} is not "
                "visible"
            )
        others = ", ".join(self.same_as)
        return f"{self.name}: equal to other values of {others} for any measurement of these runs"


@dataclass(frozen=True)
class ChannelFit:
    """Residuals of one channel of one run against its known measurement error."""

    run: str
    channel: str
    ratio: float
    """Root mean square of the residuals, estimates adjusted within their errors, over the error."""
    samples: int


@dataclass(frozen=True, eq=False)
class LackOfFit:
    """What a fit leaves unexplained, and what would explain it."""

    runs: tuple[ChannelFit, ...]
    """Of the channels whose measurement error is known: counts, or noise that is stated."""
    faults: tuple[Fault, ...]
    """All that were looked at, those that explain most first."""
    units: tuple[str, ...]
    """Fixed parameters that no measurement of these channels tells: the estimates are in units of
    them."""
    clipped: tuple[str, ...]
    """Sentences on channels that stand at an end of their instrument."""

    @property
    def ratios(self) -> dict[str, float]:
        """Root mean square over all runs of each channel with a known error, over that error."""
        found = {}
        for name in dict.fromkeys(each.channel for each in self.runs):
            alike = [each for each in self.runs if each.channel == name]
            squares = sum(each.samples * each.ratio**2 for each in alike)
            found[name] = sqrt(squares / sum(each.samples for each in alike))
        return found

    @property
    def causes(self) -> tuple[Fault, ...]:
        """Faults that explain most of the residuals, and about equally, the likeliest first."""
        large = [each for each in self.faults if each.explains and each.near]
        return tuple(each for each in large if each.share >= EQUAL * large[0].share)[:MOST_CAUSES]

    @property
    def likely(self) -> str:
        """The causes in words; several where the residuals do not tell them apart."""
        said = [f"{each.cause} explains {100.0 * each.share:.0f} %" for each in self.causes]
        if len(said) < 2:
            return "".join(f"{each} of the remaining residuals" for each in said)
        return f"one of these, which the residuals hardly tell apart: {'; '.join(said)} of them"

    @property
    def assumed(self) -> tuple[Fault, ...]:
        """Faults of instruments that these logs cannot tell: they are assumed away."""
        return tuple(each for each in self.faults if each.hidden)

    def fault(self, name: str) -> Fault | None:
        """The fault of a name, None if it was not looked at."""
        return next((each for each in self.faults if each.name == name), None)


def measurement_error(channel: Channel) -> float | None:
    """Known standard deviation of a channel's measurement error, in its unit.

    The stated noise, or that of rounding to whole counts, 1/√12 of one; None where neither is
    known.
    """
    if channel.noise is not None:
        return channel.noise
    return None if channel.encoder is None else abs(channel.encoder.angle_per_count) / sqrt(12.0)


def lack_of_fit(assessments: Sequence[Assessment]) -> LackOfFit:
    """Test a fit for lack of fit, and look for causes.

    Parameters
    ----------
    assessments : sequence of Assessment
        Of all stages, in their order.

    Notes
    -----
    χ² against the known measurement error (Draper and Smith 1998, section 1.5, with the pure error
    known beforehand). A fixed parameter with a standard uncertainty may differ by about that much.
    Causes by Rao's score test (Rao 1948): each fault is a further unknown; its
    derivatives, freed of what the estimates can make up for, are projected on the residuals, which
    gives its size after one Gauss-Newton step and the part of their squares that it explains. All
    stages are taken together, each in units of its own noise, so that a later stage's residuals
    are not laid to what an earlier one does not know exactly. All follows from the triangular
    factor of all derivatives.
    """
    blocks = [block for each in assessments for block in _blocks(each, assessments)]
    places: dict[str, int] = {}
    counts = []
    for group in ("estimates", "fixed", "faults"):
        for block in blocks:
            for name in getattr(block, group):
                places.setdefault(name, len(places))
        counts.append(len(places))
    count, known, _ = counts
    names, meanings = list(places), {k: v for each in blocks for k, v in each.meanings.items()}
    constants, rows = names[count:known], np.eye(len(places) + 1)
    uncertain = [place for name, place in places.items() if name.startswith(UNCERTAIN)]
    triangle = triangular_factor(
        np.vstack([rows[uncertain], *(each.factor(places) for each in blocks)])
    )
    open_fixed = triangular_factor(np.vstack([rows[count:known] / FIXED_OFF, triangle]))
    basis, inverse = _span(triangle[:, :count])
    wider, instead = _span(open_fixed[:, :known])
    shift = inverse @ triangle[:, -1]
    left = triangle[:, -1] - basis @ (basis.T @ triangle[:, -1])
    squares, lengths = float(left @ left), np.linalg.norm(triangle, axis=0)
    deviation = sqrt(squares / max(sum(block.residual.size for block in blocks) - count, 1))
    found = []
    for name, place in [*places.items()][count:]:
        column, free, length = triangle[:, place], open_fixed[:, place], float(lengths[place])
        if not length > 0.0:
            continue
        beyond = column - basis @ (basis.T @ column)
        along = float(np.linalg.norm(beyond))
        told = along > SAME_DIRECTION * length and squares > 0.0
        pull = float(beyond @ left) if told else 0.0
        effect = np.abs(inverse @ column) * lengths[:count]
        order = [int(k) for k in np.argsort(-effect)[:4] if effect[k] > 0.01 * length]
        left_over = float(np.linalg.norm(free - wider @ (wider.T @ free)))
        moved = np.abs((instead @ free)[count:]) * lengths[count:known]
        fixed = [constants[k] for k in np.argsort(-moved)[:3] if moved[k] > 0.1 * moved.max()]
        factor, unit, plausible = meanings[name]
        found.append(
            Fault(
                name,
                unit,
                -factor * pull / along**2 if told else 0.0,
                factor * deviation / along if told else inf,
                pull**2 / (along**2 * squares) if told else 0.0,
                along / length,
                tuple(dict.fromkeys(names[k].split(": ")[1] for k in order)),
                plausible,
                factor * deviation / left_over if left_over > SAME_DIRECTION * length else inf,
                tuple(dict.fromkeys(COLUMNS.get(each, each) for each in fixed)),
            )
        )
    runs = {run.name: run for each in assessments for run in each.stage.problem.experiments}
    twins = [twin for each in assessments for twin in _late_commands(each)][:1]
    return LackOfFit(
        tuple(fit for block in blocks for fit in block.against_known(places, shift)),
        (*sorted(found, key=lambda each: -each.share), *twins),
        _units(triangle[:, :known], constants, found),
        clipped_channels(list(runs.values())),
    )


def clipped_channels(experiments: Sequence[Experiment]) -> tuple[str, ...]:
    """Sentences on channels that stand at an end of their instrument, with the limits to state.

    A channel is clipped where it reads its very largest or smallest value for 0.1 s and longer
    while the input moves by more than a tenth of its range: no noisy signal does that. Positions
    are passed over, as they stand still by themselves.
    """
    said = []
    for name in dict.fromkeys(name for each in experiments for name in each.channels):
        runs = [each for each in experiments if name in each.channels]
        if runs[0][name].is_position:
            continue
        low, high = (
            float(pick([pick(each[name].values) for each in runs])) for pick in (np.min, np.max)
        )
        inputs = [each.input.values for each in runs]
        reach = float(np.max([x.max() for x in inputs]) - np.min([x.min() for x in inputs]))
        for end in (low, high):
            if any(end in (each[name].limits or ()) for each in runs):
                continue
            moved = max((_moved_at(end, each, name) for each in runs), default=0.0)
            if moved > 0.1 * reach:
                # a rounded reading stands still by itself for as long as a step of it lasts
                shares = np.concatenate([each[name].values for each in runs]) / (high - low)
                coarse = float(np.diff(np.unique(np.round(shares, 9))).min())
                if moved <= (0.1 + 2.0 * coarse) * reach:
                    continue
                unit = runs[0][name].unit
                said.append(
                    f"'{name}' stands at exactly {end:.6g} {unit} while the input moves by "
                    f"{moved:.3g} {runs[0].input.unit}: it is clipped there. Set limits = "
                    f"[{low:.6g}, {high:.6g}] in its channel, and such samples are ignored."
                )
    return tuple(said)


def _moved_at(end: float, experiment: Experiment, name: str) -> float:
    """By how much the input moves in any stretch in which a channel stands at an end.

    In its first three quarters: a rounded reading that lags stays where it is when the input has
    left already.
    """
    channel = experiment[name]
    edges = np.flatnonzero(np.diff(np.concatenate([[0], channel.values == end, [0]])))
    most = 0.0
    for first, after in zip(edges[::2], edges[1::2], strict=True):
        if channel.time[after - 1] - channel.time[first] >= DWELLS:
            stretch = channel.time[first : after - (after - first) // 4]
            most = max(most, float(np.ptp(experiment.input.at(stretch))))
    return most


Meaning = tuple[float, str, float]
"""Factor to a fault's unit, unit, and plausible size."""


class _Block(NamedTuple):
    """One channel of one run: derivatives by all that could explain its residuals."""

    run: str
    channel: Channel
    residual: Array
    """(n,) in units of the noise."""
    weight: Array
    """(n,) factors from the channel's unit to those."""
    estimates: Mapping[str, Array]
    """(n,) derivatives by each number of the vectors, by ``"stage: unknown"``."""
    fixed: Mapping[str, Array]
    """(n,) by the logarithm of each fixed parameter."""
    faults: Mapping[str, Array]
    """(n,) by faults of instruments and of the campaign."""
    meanings: Mapping[str, Meaning]
    """Of each fixed parameter and fault."""

    def factor(self, places: Mapping[str, int]) -> Array:
        """(<= n, P + 1) triangular factor of its own columns and the residual, among all others."""
        columns = {**self.estimates, **self.fixed, **self.faults}
        factor = triangular_factor(np.column_stack([*columns.values(), self.residual]))
        made = np.zeros((len(factor), len(places) + 1))
        made[:, [*(places[name] for name in columns), -1]] = factor
        return made

    def against_known(self, places: Mapping[str, int], shift: Array) -> list[ChannelFit]:
        """The residuals, estimates shifted by (K,), over the known error; none if it is unknown."""
        error = measurement_error(self.channel)
        if not error:
            return []
        left = self.residual.copy()
        for name, values in self.estimates.items():
            left -= shift[places[name]] * values
        ratio = float(np.sqrt(np.mean((left / self.weight) ** 2))) / error
        return [ChannelFit(self.run, self.channel.name, ratio, left.size)]


def _blocks(assessment: Assessment, assessments: Sequence[Assessment]) -> Iterator[_Block]:
    """One for each channel of each run of a stage: by its own and earlier estimates, by faults."""
    stage, problem = assessment.stage, assessment.stage.problem
    vector, numbers, model = stage.solution.vector, stage.parameters.numbers, stage.problem.model
    earlier: list[Assessment] = []
    fixed = [name for together in problem.uncertain for name in together]
    if isinstance(model, DriveModel):
        part, voltages = model.part, all(e.input.kind == "voltage" for e in problem.experiments)
        if part == "pump" and stage.stage.current == "simulated" and voltages:
            part, before = "chain", assessments[: assessments.index(assessment)]
            earlier = [each for each in before if each.stage.stage.part == "card"]
        model = DriveModel(stage.drive.parameters, part, model.currents, model.forces)
        fixed = _constants(numbers, part, [each.stage.problem for each in assessments])
    runs = {(run.name, run.channel): run for run in assessment.linearised.runs}
    noise, free = _noise_units(assessment), assessment.linearised.variables.free
    fastest = {name: _fastest(name, problem.experiments) for name in problem.channels}
    for number, experiment in enumerate(problem.experiments):
        outputs, own = problem.outputs(vector, number), problem.model_values(vector, number)
        by_others = _by_others(model, own, experiment, numbers, fixed, earlier)
        values = problem.unknowns.targets(vector, experiment.name)
        commanded = _by_command(model, values, experiment)
        place = number / max(len(problem.experiments) - 1, 1) - 0.5
        for name, weights in problem.weights[number].items():
            run = runs.get((experiment.name, name))
            if run is None:
                continue
            used, scale = weights > 0.0, noise[name]
            weight = weights[used] / scale
            estimates = {
                f"{stage.stage.name}: {label}": run.jacobian[:, k] / scale
                for k, label in enumerate(problem.unknowns.names)
                if problem.unknowns[k].run in (None, experiment.name) and free[k]
            }
            constant: dict[str, Array] = {}
            for label, column in by_others.get(name, {}).items():
                (constant if label in fixed else estimates)[label] = weight * column[used]
            for together in problem.uncertain:
                known = [column for column in together if column in constant]
                if known:
                    estimates[f"{UNCERTAIN}{', '.join(known)}"] = np.sum(
                        [constant.pop(c) * (together[c] / abs(numbers[c])) for c in known], axis=0
                    )
            faults = _instrument_faults(experiment, name, outputs[name], place, fastest[name])
            faults |= commanded.get(name, {})
            yield _Block(
                experiment.run,
                experiment[name],
                run.residual / scale,
                weight,
                estimates,
                constant,
                {label: weight * column[used] for label, (column, _) in faults.items()},
                dict.fromkeys(constant, (100.0, "%", inf))
                | {label: meaning for label, (_, meaning) in faults.items()},
            )


def _constants(numbers: Mapping[str, float], part: str, problems: Sequence[Problem]) -> list[str]:
    """Columns of the drive that no stage estimates and that are not zero or infinite."""
    taken = {t for each in problems for unknown in each.unknowns for t in unknown.targets}
    if any(isinstance(p.model, DriveModel) and p.model.forces is not None for p in problems):
        taken |= set(columns_of(["Z19", "Z20", "Z21", "Z22"]))
    blocks = {"card": ("control_card",), "pump": ("pump_motor",)}
    return [
        name
        for name, symbol in COLUMNS.items()
        if CATALOGUE[symbol].block in blocks.get(part, ("control_card", "pump_motor"))
        and name not in taken
        and numbers[name] != 0.0
        and isfinite(numbers[name])
    ]


def _fastest(name: str, experiments: Sequence[Experiment]) -> float:
    """Largest measured rate of a position in any run, over short windows; 0 of others."""
    rates = [0.0]
    for channel in (each[name] for each in experiments if name in each.channels):
        time, values = channel.time[channel.used], channel.values[channel.used]
        if channel.is_position and time.size > 1:
            width = max(round(WINDOW / float(np.median(np.diff(time)))), 1)
            moved = np.abs(values[width:] - values[:-width])
            rates.append(float((moved / (time[width:] - time[:-width])).max(initial=0.0)))
    return max(rates)


def _by_others(
    model: Model,
    values: Mapping[str, float],
    experiment: Experiment,
    numbers: Mapping[str, float],
    fixed: Sequence[str],
    earlier: Sequence[Assessment],
) -> dict[str, dict[str, Array]]:
    """By channel, (m,) derivatives by earlier stages' estimates and fixed parameters."""
    targets = [
        [t for u in each.stage.problem.unknowns if u.run is None for t in u.targets]
        for each in earlier
    ]
    names = [*fixed, *(name for each in targets for name in each)]
    if not names:
        return {}
    made: dict[str, dict[str, Array]] = {}
    for channel, part in linearised(model, values, experiment, names).items():
        columns = {name: part.by[:, k] * numbers[name] for k, name in enumerate(fixed)}
        first = len(fixed)
        for each, own in zip(earlier, targets, strict=True):
            found, unknowns = each.stage, each.stage.problem.unknowns
            chain = unknowns.chain(found.solution.vector, own, "")
            by = part.by[:, first : first + len(own)] @ chain
            first += len(own)
            columns |= {
                f"{found.stage.name}: {unknown.name}": by[:, k]
                for k, unknown in enumerate(unknowns)
                if unknown.run is None and each.linearised.variables.free[k]
            }
        made[channel] = columns
    return made


Effects = dict[str, tuple[Array, Meaning]]
"""(m,) change of a reading, and its meaning, by fault."""


def _by_command(
    model: Model, values: Mapping[str, float], experiment: Experiment
) -> dict[str, Effects]:
    """By channel, the effects of a scale error and of a lag of the command, by differences."""
    if not isinstance(model, DriveModel) or model.part == "pump":
        return {}
    signal = experiment.input
    plain = {k: v for k, v in values.items() if not k.startswith(OFFSET)}
    changed = ((1.0 - COMMAND_CHANGE) * signal.values, _lagged(signal.time, signal.values))
    try:
        before, less, later = (
            simulated(model, plain, replace(experiment, input=replace(signal, values=x)))
            for x in (signal.values, *changed)
        )
    except DomainError:
        return {}
    scale, lag = (100.0, "%", 100.0 * PLAUSIBLE_SCALE), (1e3, "ms", inf)
    return {
        name: {
            "scale of the command": ((before[name] - less[name]) / COMMAND_CHANGE, scale),
            f"{SLOW}the command": ((later[name] - before[name]) / LAG, lag),
        }
        for name in before
    }


def _lagged(time: Array, values: Array) -> Array:
    """(m,) values behind a first-order lag of `LAG`, at rest before."""
    kept = np.exp(-np.diff(time) / LAG)
    bands = np.vstack([np.ones(time.size), np.append(-kept, 0.0)])
    driven = np.concatenate([values[:1], (1.0 - kept) * values[1:]])
    made: Array = solve_banded((1, 0), bands, driven)
    return made


def _instrument_faults(
    experiment: Experiment, name: str, output: Array, place: float, fastest: float
) -> Effects:
    """Effects (m,) of faults on a channel's reading, with factor, unit and plausible size.

    `place` is that of the run in the campaign, from -1/2 to 1/2; `fastest` the largest rate of a
    position that was measured in any run.
    """
    channel = experiment[name]
    time = channel.time
    slope = np.gradient(output, time) if time.size > 2 else np.zeros_like(output)
    about = output - output[0] if channel.is_position else output
    made = {
        f"scale of {name}": (output, (100.0, "%", 100.0 * PLAUSIBLE_SCALE)),
        f"{STAMPS}{name}": (-slope, (1e3, "ms", 1e3 * PLAUSIBLE_DELAY)),
        f"{SLOW}{name}": ((_lagged(time, output) - output) / LAG, (1e3, "ms", inf)),
        f"drift of {name} over the campaign": (about * place, (100.0, "%", inf)),
    }
    if channel.kind in CURRENTS:
        return made
    signal = experiment.input.at(time)
    turned = np.sign(np.diff(signal, prepend=signal[:1]))
    # the direction of the last change of the command, 0 before the first
    last = np.maximum.accumulate(np.where(turned != 0.0, np.arange(turned.size), 0))
    way = turned[last] * (np.abs(slope) > 1e-3 * np.abs(slope).max(initial=0.0))
    lost = np.ones_like(time)
    factor, unit = (degrees(1.0), "deg") if channel.unit.startswith("rad") else (1.0, channel.unit)
    if channel.is_position:
        step = np.diff(time, prepend=time[:1])
        way, lost = np.cumsum(way * step), time - time[0]
        unit = f"{unit}/s"
        beyond = np.sign(slope) * np.maximum(np.abs(slope) - FASTEST * fastest, 0.0)
        made[f"{LOSS}{name}"] = (-np.cumsum(beyond * step), (100.0, "%", inf))
    return {
        **made,
        f"load or leakage, as a loss of {name},": (-lost, (factor, unit, inf)),
        f"friction or hysteresis, as a lag of {name},": (-way, (factor, unit, inf)),
    }


def _late_commands(assessment: Assessment) -> list[Fault]:
    """Late stamps of the command beside a longer tau, where that is fixed: both by one sample."""
    stage = assessment.stage
    model, problem, tau = stage.problem.model, stage.problem, stage.parameters.numbers.get("tau")
    if not isinstance(model, DriveModel) or model.part == "pump" or tau is None:
        return []
    if any("tau" in each.targets for each in problem.unknowns):
        return []
    experiment, signal = problem.experiments[0], problem.experiments[0].input
    step = float(np.median(np.diff(signal.time)))
    late = replace(signal, values=np.concatenate([signal.values[:1], signal.values[:-1]]))
    targets = problem.unknowns.targets(stage.solution.vector, experiment.name)
    values = {k: v for k, v in targets.items() if not k.startswith(OFFSET)}
    first = simulated(model, values, replace(experiment, input=late))
    second = simulated(model, {**values, "tau": tau + step}, experiment)
    plain = simulated(model, values, experiment)
    apart, moved = (
        sum(float(np.sum((first[k] - other[k]) ** 2)) for k in first) for other in (second, plain)
    )
    outside = sqrt(apart / moved) if moved > 0.0 else inf
    same = (f"the fixed tau = {1e3 * tau:.3g} ms",)
    name, plausible = f"{STAMPS}the command", 1e3 * PLAUSIBLE_DELAY
    twin = Fault(name, "ms", 0.0, inf, 0.0, outside, same, plausible)
    return [twin] if outside <= SAME_STAMPS else []


def _noise_units(assessment: Assessment) -> dict[str, float]:
    """What a stage's residuals are divided by, by channel: noise that independent samples have.

    Where the measurement error is known, that; elsewhere the residuals themselves, with as many
    samples to one as their correlation says.
    """
    problem, colours = assessment.stage.problem, assessment.uncertainty.colours
    units = {}
    for name in problem.channels:
        runs = [run for run in assessment.linearised.runs if run.channel == name]
        channel = next(each[name] for each in problem.experiments if name in each.channels)
        error = measurement_error(channel)
        if error is not None:
            units[name] = error / problem.scales[name]
            continue
        squares = sum(float(run.residual @ run.residual) for run in runs)
        level = sqrt(squares / max(sum(run.residual.size for run in runs), 1))
        inflation = max((each.inflation for each in colours if each.channel == name), default=1.0)
        units[name] = max(level * sqrt(inflation), 1e-300)
    return units


def _span(matrix: Array) -> tuple[Array, Array]:
    """Orthonormal basis (m, rank) of a matrix's columns (m, k), and its pseudoinverse (k, m)."""
    lengths = np.linalg.norm(matrix, axis=0)
    moving = lengths > 1e-14 * lengths.max(initial=0.0)
    inverse = np.zeros(matrix.shape[::-1])
    if not moving.any():
        return np.zeros((matrix.shape[0], 0)), inverse
    left, sizes, right = np.linalg.svd(matrix[:, moving] / lengths[moving], full_matrices=False)
    kept = sizes > TOLERANCE * sizes[0]
    inverse[moving] = (right[kept].T / sizes[kept]) @ left[:, kept].T / lengths[moving, None]
    return left[:, kept], inverse


def _units(matrix: Array, fixed: Sequence[str], found: Sequence[Fault]) -> tuple[str, ...]:
    """Fixed parameters that nothing measured tells.

    Those, among the last columns of (m, K + F), with a part in a null direction of all, or with an
    effect that the estimates make up for.
    """
    lengths = np.linalg.norm(matrix, axis=0)
    moving = np.flatnonzero(lengths > 1e-12 * lengths.max(initial=0.0))
    if not moving.size:
        return ()
    _, sizes, right = np.linalg.svd(matrix[:, moving] / lengths[moving], full_matrices=True)
    null = right[np.count_nonzero(sizes > 1e-9 * sizes[0]) :]
    first = matrix.shape[1] - len(fixed)
    # of these directions those that move an estimate: fixed parameters among themselves are no unit
    turn, parts, _ = np.linalg.svd(null[:, moving < first], full_matrices=False)
    null = turn[:, parts > 1e-6].T @ null
    part = dict(zip(moving.tolist(), np.linalg.norm(null, axis=0).tolist(), strict=True))
    names = {name for k, name in enumerate(fixed, first) if part.get(k, 0.0) > 1e-4}
    names |= {each.name for each in found if each.outside < UNTOLD}
    return tuple(dict.fromkeys(COLUMNS[name] for name in fixed if name in names))
