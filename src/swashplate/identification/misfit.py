"""Lack of fit: what is left in residuals that noise does not explain, and what would explain it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.experiment import Channel, Experiment
from swashplate.identification import faults
from swashplate.identification.arrow import (
    Block,
    arrow_factor,
    triangular_factor,
    triangular_factor_of,
)
from swashplate.identification.drive_model import DriveModel
from swashplate.identification.effects import follows_card, source_of
from swashplate.identification.faults import (
    DRIFT,
    FIXED,
    SAME_DIRECTION,
    Fault,
    Kind,
    measurement_error,
)
from swashplate.identification.intervals import uncertainty_of
from swashplate.identification.model import Model, linearised
from swashplate.identification.problem import TOLERANCE
from swashplate.identification.stage_fit import StageFit
from swashplate.parameters.definitions import CATALOGUE, COLUMNS, columns_of

Array = NDArray[np.float64]

EQUAL, MOST_CAUSES = 0.8, 4
"""Part of what the best cause explains from which another one is about as good, as sizes are those
of one step and causes of different kind imitate each other to about that; how many are named."""
UNTOLD = 1e-4
"""Part of a fixed parameter's effect outside the estimates' below which it is a unit of them."""
UNCERTAIN = "fixed: "
"""What the name of a fixed parameter with a standard uncertainty begins with: an estimate that its
value, as a measurement, is part of."""
FIXED_OFF = 0.1
"""Standard deviation by which a fixed parameter without a stated one may be off. [1]"""


class Alone(NamedTuple):
    """One-step estimate of a fault from what the fit leaves of one run alone."""

    size: float
    """[1], or s of late stamps."""
    error: float
    """Standard error, of independent noise; inf where nothing moves."""
    share: float
    """Part of the run's squares that it explains. [1]"""


class ChannelFit(NamedTuple):
    """One channel of one run, estimates adjusted within their errors."""

    run: str
    channel: str
    place: float
    """Of the run among those of its stage, from -1/2 to 1/2."""
    samples: int
    ratio: float | None
    """Root mean square of the residuals over the known measurement error: of counts, or noise that
    is stated."""
    scale: Alone
    """Of its scale less 1. [1]"""
    late: Alone
    """Of how late its stamps are. [s]"""


@dataclass(frozen=True, eq=False)
class LackOfFit:
    """What a fit leaves unexplained, and what would explain it."""

    runs: tuple[ChannelFit, ...]
    """Of each channel in each run."""
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
        sums: dict[str, Array] = {}
        for each in self.runs:
            if each.ratio is not None:
                own = np.array([each.samples * each.ratio**2, each.samples])
                sums[each.channel] = sums.get(each.channel, np.zeros(2)) + own
        return {name: sqrt(squares / samples) for name, (squares, samples) in sums.items()}

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


ESTIMATE, CONSTANT, FAULT = range(3)
"""What a column of derivatives is by: what the fit moves, what it keeps, what is looked for."""
Key = tuple[int, str]


class _Block(NamedTuple):
    """One channel of one run of a stage, in units of its noise: products of its columns alone."""

    run: str
    experiment: str
    """Stage and experiment, whose channels share their own estimates."""
    place: float
    """Of the run among those of the stage, from -1/2 to 1/2."""
    channel: Channel
    samples: int
    keys: tuple[Key, ...]
    """What its columns are by; those that belong to the experiment alone come first."""
    own: int
    """How many of these there are."""
    triangle: Array
    """(<= P + 2, P + 2) factor of its columns, of the residual, and of the weight by which a
    difference is multiplied to be a residual."""
    differences: Array
    """(<= P + 1, P + 1) factor of its columns and the residual, without that weight."""
    kinds: dict[str, Kind]
    """Of constants and faults, by name."""

    def rows(self, places: Mapping[Key, int], shared: int) -> Block:
        """Its columns and the residual as rows of the factor of all blocks.

        `places` are numbers of keys; after those that belong to single experiments `shared` others
        follow, the residual among them.
        """
        numbers = [places[key] for key in self.keys]
        own, others = numbers[: self.own], numbers[self.own :]
        first = len(places) + 1 - shared
        rows = np.zeros((len(self.triangle), self.own + shared))
        rows[:, : self.own] = self.triangle[:, : self.own]
        rows[:, self.own + np.array(others, np.intp) - first] = self.triangle[:, self.own : -2]
        rows[:, -1] = self.triangle[:, -2]
        return Block(self.experiment, np.array(own, np.intp), rows)

    def fit(self, places: Mapping[Key, int], shift: Array) -> ChannelFit:
        """What is left of it with the estimates shifted by (K,)."""
        moves = np.array([0.0 if key[0] else shift[places[key]] for key in self.keys])
        left, ratio = self.triangle[:, -2] - self.triangle[:, :-2] @ moves, None
        if error := measurement_error(self.channel):
            differences = self.differences[:, -1] - self.differences[:, :-1] @ moves
            ratio = float(np.linalg.norm(differences)) / sqrt(self.samples) / error
        scale, late = (self._alone(kind, left) for kind in (faults.SCALE, faults.LATE))
        name, channel = self.run, self.channel.name
        return ChannelFit(name, channel, self.place, self.samples, ratio, scale, late)

    def _alone(self, kind: Kind, left: Array) -> Alone:
        name = FAULT, kind.words.format(self.channel.name)
        column, weight = self.triangle[:, self.keys.index(name)], self.triangle[:, -1]
        if self.channel.is_position:
            # a position has a free zero
            column = column - weight * (weight @ column) / (weight @ weight)
        square = float(column @ column)
        if not square > 0.0:
            return Alone(0.0, inf, 0.0)
        # a reading that is larger than what is simulated leaves a negative residual
        size, squares = -float(column @ left) / square, float(left @ left)
        return Alone(size, 1.0 / sqrt(square), size**2 * square / squares if squares else 0.0)


def lack_of_fit(stages: Sequence[StageFit]) -> LackOfFit:
    """Test a fit for lack of fit, and look for causes.

    Parameters
    ----------
    stages : sequence of StageFit
        All stages, in their order.

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
    blocks = [block for each in stages for block in _blocks(each, stages)]
    alone = dict.fromkeys(key for block in blocks for key in block.keys[: block.own])
    others = dict.fromkeys(key for block in blocks for key in block.keys[block.own :])
    keys = [*alone, *sorted(others, key=lambda key: key[0])]
    places = {key: place for place, key in enumerate(keys)}
    names, kinds = [name for _, name in keys], {k: v for b in blocks for k, v in b.kinds.items()}
    count, known = (sum(group <= last for group, _ in keys) for last in (ESTIMATE, CONSTANT))
    constants, rows = names[count:known], np.eye(len(keys) + 1)
    doubted = [k for k, name in enumerate(names) if name.startswith(UNCERTAIN)]
    shared = np.arange(len(alone), len(keys) + 1)
    parts = [Block("", np.arange(0), rows[None, k, len(alone) :]) for k in doubted]
    parts += [block.rows(places, shared.size) for block in blocks]
    triangle = arrow_factor(len(keys) + 1, shared, parts).dense()
    opened = triangular_factor(np.vstack([rows[count:known] / FIXED_OFF, triangle]))

    (basis, inverse), (wider, instead) = _span(triangle[:, :count]), _span(opened[:, :known])
    residual, columns, lengths = triangle[:, -1], triangle[:, :-1], np.linalg.norm(triangle, axis=0)
    left = residual - basis @ (basis.T @ residual)
    beyond = columns - basis @ (basis.T @ columns)
    along = np.linalg.norm(beyond, axis=0)
    apart = np.linalg.norm(opened - wider @ (wider.T @ opened), axis=0)
    # how far the estimates, and the fixed parameters, move to make up for each
    follow = np.abs(inverse @ columns) * lengths[:count, None]
    replaced = np.abs(instead @ opened)[count:] * lengths[count:known, None]
    squares = float(left @ left)
    deviation = sqrt(squares / max(sum(each.samples for each in blocks) - count, 1))
    shift = inverse @ residual
    runs = tuple(block.fit(places, shift) for block in blocks)
    found = []
    for k in np.flatnonzero(lengths[count:-1] > 0.0) + count:
        kind, name, length = kinds[names[k]], names[k], lengths[k]
        told = along[k] > SAME_DIRECTION * length and squares > 0.0
        pull = float(beyond[:, k] @ left) if told else 0.0
        order = [names[i] for i in np.argsort(-follow[:, k])[:4] if follow[i, k] > 0.01 * length]
        most = replaced[:, k].max(initial=0.0)
        largest = np.argsort(-replaced[:, k])[:3]
        fixed = [constants[i] for i in largest if replaced[i, k] > 0.1 * most]
        share = pull**2 / (along[k] ** 2 * squares) if told else 0.0
        if kind is DRIFT:
            share *= _in_order([each for each in runs if DRIFT.words.format(each.channel) == name])
        found.append(
            Fault(
                kind,
                name,
                -kind.factor * pull / along[k] ** 2 if told else 0.0,
                kind.factor * deviation / along[k] if told else inf,
                share,
                along[k] / length,
                tuple(dict.fromkeys(each.split(": ")[1] for each in order)),
                kind.factor * deviation / apart[k] if apart[k] > SAME_DIRECTION * length else inf,
                tuple(dict.fromkeys(COLUMNS.get(each, each) for each in fixed)),
            )
        )
    experiments = {run.name: run for each in stages for run in each.problem.experiments}
    late = [fault for each in stages if (fault := faults.late_command(each))][:1]
    return LackOfFit(
        runs,
        (*sorted(found, key=lambda each: -each.share), *late),
        _units(columns[:, :known], constants, found),
        faults.clipped_channels(list(experiments.values())),
    )


def _in_order(runs: Sequence[ChannelFit]) -> float:
    """Part of the differences between the scales of runs that is a straight line over their order.

    Freed of what a line explains by chance (adjusted R², Draper and Smith 1998, section 5.1): a
    machine that differs between maneuvers differs between runs too, in whatever order they stand.
    """
    moving = [each for each in runs if isfinite(each.scale.error)]
    rows = [(each.place, each.scale.size, each.scale.error**-2) for each in moving]
    place, own, weight = np.reshape(rows, (-1, 3)).T
    if own.size < 3:
        return float(own.size == 2)
    own, about = own - np.average(own, weights=weight), place - np.average(place, weights=weight)
    total, length = float(weight @ own**2), float(weight @ about**2)
    if not (total > 0.0 and length > 0.0):
        return 1.0
    line = float(weight @ (own * about)) ** 2 / length
    return float(max(1.0 - (1.0 - line / total) * (own.size - 1) / (own.size - 2), 0.0))


def _blocks(stage: StageFit, stages: Sequence[StageFit]) -> Iterator[_Block]:
    """One for each channel of each run of a stage: by its own and earlier estimates, by faults."""
    problem, linearised = stage.problem, stage.linearised
    vector, numbers, source = stage.solution.vector, stage.parameters.numbers, source_of(stage)
    earlier = [each for each in stage.earlier if follows_card(stage, each)]
    fixed = [name for together in problem.uncertain for name in together]
    if isinstance(problem.model, DriveModel):
        sources = [source(each) for each in problem.experiments]
        parts = {each.part for each in sources if isinstance(each, DriveModel)}
        fixed = _constants(numbers, "chain" if "chain" in parts else parts.pop(), stages)
    jacobians, unknowns = linearised.jacobians(), problem.unknowns
    noise, free = _noise_units(stage), linearised.variables.free
    fastest = {name: faults.fastest(name, problem.experiments) for name in problem.channels}
    for number, experiment in enumerate(problem.experiments):
        outputs, model = problem.outputs(vector, number), source(experiment)
        values = problem.model_values(vector, number)
        others = _by_others(model, values, experiment, numbers, fixed, earlier)
        commanded = faults.of_command(model, values, experiment)
        place = number / max(len(problem.experiments) - 1, 1) - 0.5
        for name, weights in problem.weights[number].items():
            used, scale = weights > 0.0, noise[name]
            if not used.any():
                continue
            run, jacobian = next(jacobians)
            weight = weights[used] / scale
            columns: dict[Key, Array] = {
                (ESTIMATE, f"{stage.stage.name}: {unknowns.names[k]}"): jacobian[:, j] / scale
                for j, k in enumerate(unknowns.columns(experiment.name).tolist())
                if free[k]
            }
            own = sum(bool(free[k]) for k in unknowns.of_run(experiment.name).tolist())
            columns |= {key: weight * each[used] for key, each in others.get(name, {}).items()}
            for together in problem.uncertain:
                known = [each for each in together if (CONSTANT, each) in columns]
                if known:
                    columns[ESTIMATE, f"{UNCERTAIN}{', '.join(known)}"] = np.sum(
                        [
                            columns.pop((CONSTANT, c)) * (together[c] / abs(numbers[c]))
                            for c in known
                        ],
                        axis=0,
                    )
            effects = faults.of_instrument(experiment, name, outputs[name], place, fastest[name])
            effects |= commanded.get(name, {})
            columns |= {(FAULT, key): weight * each[used] for key, (_, each) in effects.items()}
            kinds = {key: kind for key, (kind, _) in effects.items()}
            residual = run.residual / scale
            triangle = triangular_factor_of([*columns.values(), residual, weight])
            differences = triangle[:-1, :-1] / weight[0]
            if weight.min() < weight.max():
                measured = [each / weight for each in (*columns.values(), residual)]
                differences = triangular_factor_of(measured)
            yield _Block(
                experiment.run,
                f"{stage.stage.name}: {experiment.name}",
                place,
                experiment[name],
                run.residual.size,
                tuple(columns),
                own,
                triangle,
                differences,
                {key: FIXED for group, key in columns if group == CONSTANT} | kinds,
            )


def _constants(numbers: Mapping[str, float], part: str, stages: Sequence[StageFit]) -> list[str]:
    """Columns of the drive that no stage estimates and that are not zero or infinite.

    An estimate at a bound is as fixed as these: it stays there whatever else moves.
    """
    problems = [each.problem for each in stages]
    taken = {
        target
        for each in stages
        for k, unknown in enumerate(each.problem.unknowns)
        if each.linearised.variables.free[k]
        for target in unknown.targets
    }
    if any(isinstance(p.model, DriveModel) and p.model.forces is not None for p in problems):
        taken |= set(columns_of(["Z19", "Z20", "Z21", "Z22"]))
    blocks = {"card": ("control_card",), "pump": ("pump_motor",)}
    wanted = blocks.get(part, ("control_card", "pump_motor"))
    return [
        name
        for name, symbol in COLUMNS.items()
        if CATALOGUE[symbol].block in wanted and name not in taken
        if numbers[name] != 0.0 and isfinite(numbers[name])
    ]


def _by_others(
    model: Model,
    values: Mapping[str, float],
    experiment: Experiment,
    numbers: Mapping[str, float],
    fixed: Sequence[str],
    earlier: Sequence[StageFit],
) -> dict[str, dict[Key, Array]]:
    """By channel, (m,) derivatives by earlier stages' estimates and fixed parameters' parts."""
    targets = [each.problem.unknowns.machine_targets for each in earlier]
    names = [*fixed, *(name for each in targets for name in each)]
    made: dict[str, dict[Key, Array]] = {}
    for channel, part in linearised(model, values, experiment, names).items() if names else ():
        columns: dict[Key, Array] = {}
        first = len(fixed)
        for each, own in zip(earlier, targets, strict=True):
            unknowns = each.problem.unknowns
            by = part.by[:, first : first + len(own)]
            by = by @ unknowns.chain(each.solution.vector, own, "")
            first += len(own)
            columns |= {
                (ESTIMATE, f"{each.stage.name}: {unknown.name}"): by[:, k]
                for k, unknown in enumerate(unknowns)
                if unknown.run is None and each.linearised.variables.free[k]
            }
        columns |= {(CONSTANT, f): part.by[:, k] * numbers[f] for k, f in enumerate(fixed)}
        made[channel] = columns
    return made


def _noise_units(stage: StageFit) -> dict[str, float]:
    """What a stage's residuals are divided by, by channel: noise that independent samples have.

    Where the measurement error is known, that; elsewhere the residuals themselves, with as many
    samples to one as their correlation says.
    """
    problem, colours = stage.problem, uncertainty_of(stage).colours
    units = {}
    for name in problem.channels:
        channel = next(each[name] for each in problem.experiments if name in each.channels)
        error = measurement_error(channel)
        if error is not None:
            units[name] = error / problem.scales[name]
            continue
        left = [run.residual for run in stage.linearised.runs if run.channel == name]
        squares, samples = sum(float(r @ r) for r in left), sum(r.size for r in left)
        inflation = max((each.inflation for each in colours if each.channel == name), default=1.0)
        units[name] = max(sqrt(squares / max(samples, 1) * inflation), 1e-300)
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
    part = np.zeros(matrix.shape[1])
    part[moving] = np.linalg.norm(turn[:, parts > 1e-6].T @ null, axis=0)
    alike = {each.name for each in found if each.outside < UNTOLD}
    named = [name for k, name in enumerate(fixed, first) if part[k] > 1e-4 or name in alike]
    return tuple(dict.fromkeys(COLUMNS[name] for name in named))
