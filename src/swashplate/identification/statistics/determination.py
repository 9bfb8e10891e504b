"""Identifiability: what tests can tell of the unknowns, and what they cannot."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf, isfinite, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space, qr

from swashplate.errors import InputError
from swashplate.identification.estimation.arrow import dense_factor, triangular_factor, whitening
from swashplate.identification.estimation.problem import TOLERANCE
from swashplate.identification.estimation.unknowns import Unknown, Unknowns
from swashplate.identification.stage_fit import StageFit, once_per_stage
from swashplate.identification.statistics.intervals import estimates_of, uncertainty_of
from swashplate.models.displacement_control import FORCE, MOTION, PRESSURE, TRAVEL, ZERO
from swashplate.parameters.definitions import CATALOGUE, DEFINITIONS
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.results import Result
from swashplate.tables import listed

Array = NDArray[np.float64]
Known = Mapping[str, float]
Move = Callable[[float, Known], float]
"""Derivative of a parameter along a gauge, from its value and those of all by symbol."""

WIDE = 0.1
"""Half width of a 95 % interval, of the value or the scale, from which an unknown is weak. [1]"""
VAGUE = 1.0
"""Half width of a 95 % interval, of the value or the scale, from which an unknown is hardly known.
[1]"""
HALF = 1.96
"""Half width of a 95 % interval, in standard errors."""
MENTIONED, NAMED = 0.02, 6
"""Parts of a direction below this share of its largest, by effect, are not part of it; changes that
a sentence names, the largest first."""


@dataclass(frozen=True, eq=False)
class Gauge:
    """Parameters that can move together without changing what is measured."""

    name: str
    moves: Mapping[str, Move]
    """By the parameter's symbol, without direction or number."""
    determined: str
    """What the tests can tell instead, as an engineer writes it."""
    fix: tuple[str, ...]
    """Symbols to fix, the best first; the others then follow."""

    def tangent(self, variables: Unknowns, fixed: Known | None = None) -> Array:
        """Derivative (K,) of the solver's vector along the gauge.

        0 for what does not move, and throughout if a value that the gauge needs is neither among
        the unknowns nor among the `fixed` ones, by symbol.
        """
        symbols = [symbol_of(unknown) for unknown in variables]
        pairs = [*zip(symbols, variables.estimates.tolist(), strict=True)]
        known = {**(fixed or {}), **dict(pairs)}
        try:
            slopes = [self.moves[s](v, known) if s in self.moves else 0.0 for s, v in pairs]
        except KeyError:
            return np.zeros(len(variables))
        return np.array(slopes) / variables.slopes


def symbol_of(unknown: Unknown) -> str:
    """Symbol of a parameter, such as Z16 of ``Z16_plus``; of any other unknown its kind."""
    if unknown.kind != "parameter":
        return unknown.kind
    column = unknown.name.rsplit(".", 1)[-1]
    return column.removesuffix("_plus").removesuffix("_minus")


def _gauge(
    name: str, symmetry: str, determined: str, fix: str, *others: str, **more: Move
) -> Gauge:
    """A gauge along one of the models' symmetries, with others in proportion and `more` moves."""
    powers = {
        symbol: definition.symmetry[symmetry]
        for symbol, definition in CATALOGUE.items()
        if symmetry in definition.symmetry
    } | dict.fromkeys(others, 1.0)

    def power(exponent: float) -> Move:
        return lambda value, known: exponent * value

    moves = {symbol: power(definition) for symbol, definition in powers.items()} | more
    return Gauge(name, moves, f"only {determined} determined", tuple(fix.split()))


GAUGES = (
    _gauge(
        "scale of pressure",
        PRESSURE,
        "Z1·Z9, Z1·Z15 and Z8·√Z1 are",
        "Z1 Z9 Z8",
        "start pressure",
    ),
    _gauge(
        "zero of pressure",
        ZERO,
        "Z9 - Z2/Z1 is",
        "Z2 Z9",
        Z2=lambda value, known: known["Z1"] * known["Z9"],
    ),
    _gauge(
        "scale of spool travel",
        TRAVEL,
        "Z4/Z5², Z14/Z5, Z16/Z5, Z18/Z5 and Z8·Z5 are",
        "Z5 Z8 Z16",
    ),
    _gauge("scale of force", FORCE, "the solenoid force over √Z4 is", "Z4 Z19 force", "force"),
    _gauge(
        "piston motion against flow gain",
        MOTION,
        "Z8/(1+Z6) is",
        "Z6 Z8",
        Z6=lambda value, known: 1.0 + value,
    ),
)
"""Those of the model, in an order in which none undoes an earlier one; the sentence on Z8/(1+Z6)
holds away from the swash plate's stops."""


class NullDirection(NamedTuple):
    """A way for the unknowns to move together that the tests do not see, or hardly."""

    changes: Mapping[str, float]
    """By name, strongest effect first, in per cent of the value (of the scale, where the unknown
    is not logarithmic); the largest is 1 %. [%]"""
    half_width: float
    """Of the 95 % interval of the unknown to fix, of its value or scale; inf for no effect. [1]"""
    gauge: Gauge | None
    """The known gauge that it is, if it is one that changes nothing."""
    fix: str
    """The unknown to fix; in a weak direction only if its value is known, as a wrong one shows in
    the others."""

    @property
    def weak(self) -> bool:
        """Whether it has some effect."""
        return isfinite(self.half_width)

    @property
    def precision(self) -> str:
        """How well the unknown to fix is known; beyond its own size a percentage says nothing."""
        if self.half_width >= VAGUE:
            return "to no better than ±100 %"
        return f"to ±{100.0 * self.half_width:.3g} %"

    @property
    def sentence(self) -> str:
        """What an engineer would say."""
        if self.gauge is not None:
            names = listed(sorted(self.changes, key=_in_order))
            how = f"change together without effect ({self.gauge.name})"
            return f"{names} {how}: {self.gauge.determined}. Fix {self.fix}."
        moves = ", ".join(f"{name} {by:+.2g} %" for name, by in [*self.changes.items()][:NAMED])
        if len(self.changes) > NAMED:
            moves += f" and {len(self.changes) - NAMED} others"
        if self.weak:
            along = f" ({moves} have little effect together)" if len(self.changes) > 1 else ""
            return (
                f"Weak: {self.fix} is known {self.precision} only{along}. Add a "
                "test that determines it, or fix one whose value you know."
            )
        change = "together change" if len(self.changes) > 1 else "changes"
        return f"{moves} {change} nothing. Fix {self.fix}."


def _in_order(name: str) -> tuple[str | int, ...]:
    """Z4 before Z16."""
    return tuple(int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name))


@dataclass(frozen=True, eq=False)
class Identifiability(Result):
    """Verdict on a fit's unknowns, before a fit or after."""

    variables: Unknowns
    sensitivity: Array
    """(K,) length of the change of all weighted residuals for 1 % of each unknown."""
    rank: int
    """How many combinations of the unknowns are determined."""
    unexcited: tuple[str, ...]
    """Unknowns that change nothing by themselves: no test exercises them."""
    null: tuple[NullDirection, ...]
    """Directions that change nothing."""
    weak: tuple[NullDirection, ...]
    """Directions along which intervals are wider than ±10 %, those before it fixed."""

    @property
    def complete(self) -> bool:
        """Whether every unknown that is free is determined."""
        return not self.unexcited and not self.null

    @property
    def to_fix(self) -> tuple[str, ...]:
        """Unknowns to fix so that all others are determined; nothing is lost by it."""
        return (*self.unexcited, *(direction.fix for direction in self.null))

    @property
    def at_bounds(self) -> dict[str, str]:
        """Unknowns at a bound, by name: ``"lower"`` or ``"upper"``."""
        sides = zip(self.variables.names, self.variables.at_bound, strict=True)
        return {name: "lower" if side < 0 else "upper" for name, side in sides if side}

    def sentences(self) -> tuple[str, ...]:
        """The verdict in words, one sentence each."""
        free, rank = int(np.count_nonzero(self.variables.free)), self.rank
        told = f"{rank} combination{'' if rank == 1 else 's'} of {free} free parameters"
        told = f"all {free} free parameters" if rank == free else told
        vague = [direction.fix for direction in self.weak if direction.half_width >= VAGUE]
        if vague and rank > len(vague):
            clear = rank - len(vague)
            told = f"{clear} combination{'' if clear == 1 else 's'} of {free} free parameters"
            told += f", and hardly {listed(vague)}"
        elif self.weak and rank == free:
            told += f", {len(self.weak)} of them weakly"
        said = [f"The tests determine {told if rank else 'none of the parameters'}."]
        if not free:
            said = ["All parameters are at a bound: there is nothing left to determine."]
        if self.unexcited:
            them = "them" if len(self.unexcited) > 1 else "it"
            names = ", ".join(self.unexcited)
            said.append(f"No test exercises {names}: fix {them}, or add a test that does.")
        said += [direction.sentence for direction in self.null]
        if len(self.weak) == 1:
            said.append(self.weak[0].sentence)
        elif self.weak:
            known = [f"{direction.fix} {direction.precision}" for direction in self.weak]
            said.append(
                f"Weak, each with those before it fixed: {listed(known)}. Add tests that determine "
                "them, or fix those whose values you know."
            )
        for name, side in self.at_bounds.items():
            said.append(
                f"{name} = {self.variables.estimates[self.variables.index(name)]:.4g} is at its "
                f"{side} bound and has no interval; the intervals of the others let it change."
            )
        return tuple(said)


def identifiability(
    derivatives: Array,
    variables: Unknowns,
    *,
    covariance: Array | None = None,
    tolerance: float = TOLERANCE,
    fixed: Known | None = None,
) -> Identifiability:
    """Judge what derivatives tell of the unknowns; an `InputError` if one is not finite.

    Parameters
    ----------
    derivatives : (m, K) array
        Derivatives of all weighted residuals by the solver's vector, or their triangular factor.
    variables : Unknowns
        The unknowns; those at a bound count as fixed.
    covariance : (K, K) array, optional
        Of the solver's vector, by which directions are weak; by default that of residuals that are
        independent and of variance 1.
    tolerance : float
        See `problem.TOLERANCE`.
    fixed : mapping of str to float, optional
        Values of parameters that are no unknowns, by symbol; some gauges need them.
    """
    triangle, names = np.asarray(derivatives, dtype=np.float64), variables.names
    if not np.isfinite(triangle).all():
        column = int(np.argwhere(~np.isfinite(triangle))[0][1])
        raise InputError(f"The derivatives by {names[column]} are not all finite.")
    if triangle.shape[0] > len(variables):
        triangle = triangular_factor(triangle)
    lengths = np.linalg.norm(triangle, axis=0)
    # a column of mere rounding is none
    moving = variables.free & (lengths > 1e-14 * lengths.max(initial=0.0))
    places = np.flatnonzero(moving)

    def direction(
        moved: Array,
        places: NDArray[np.intp],
        place: int,
        gauge: Gauge | None = None,
        half: float = inf,
    ) -> NullDirection:
        """From changes (k,) of some of the solver's numbers, one of which is to be fixed."""
        # a short column needs a large change for the same effect: judged by effect, not by size
        effect = np.abs(moved) * lengths[places]
        least = MENTIONED * effect.max()
        order = [k for k in np.argsort(-effect, kind="stable") if effect[k] >= least]
        largest = max((float(moved[k]) for k in order), key=abs)
        changes = {names[places[k]]: float(moved[k]) / largest for k in order}
        return NullDirection(changes, half, gauge, names[places[place]])

    null, rank = [], 0
    if places.size:
        scale = lengths[places]
        symbols = [symbol_of(variables[int(k)]) for k in places]
        _, sizes, rows = np.linalg.svd(triangle[:, places] / scale, full_matrices=True)
        rank = int(np.count_nonzero(sizes > tolerance * sizes[0]))
        free, fixes = rows[rank:].T, list[int]()
        for gauge in GAUGES:
            vector = gauge.tangent(variables, fixed)[places] * scale
            vector /= np.linalg.norm(vector) or 1.0
            # as long as its part in the null space: it changes nothing
            if np.linalg.norm(free.T @ vector) >= 1.0 - 1e-6:
                wanted = [k for fix in gauge.fix for k, s in enumerate(symbols) if s == fix]
                place = _fixing([*wanted, *np.argsort(-np.abs(vector))], vector, free, fixes)
                if place is not None:
                    fixes.append(place)
                    null.append(direction(vector / scale, places, place, gauge))
        # what is left when those are fixed, with one unknown of its own for each direction
        left = free @ null_space(free[fixes]) if fixes else free
        if left.shape[1]:
            order = qr(left.T, mode="r", pivoting=True)[1][: left.shape[1]]
            for column, place in zip((left @ np.linalg.inv(left[order])).T, order, strict=True):
                null.append(direction(column / scale, places, int(place)))

    # weak ones: how the others follow an unknown is its column of the covariance over its variance;
    # each found is fixed, so that the next ones are what is left without it
    weak, places = [], places[~np.isin(places, [names.index(direction.fix) for direction in null])]
    if covariance is None:
        every = np.ones(places.size, dtype=np.bool_)
        inverse = whitening(dense_factor(triangle[:, places]), every, TOLERANCE).matrix
        left = inverse @ inverse.T
    else:
        left = covariance[np.ix_(places, places)]
    machine = np.array([unknown.run is None for unknown in variables])
    while places.size:
        variances = np.where(machine[places], np.diag(left), 0.0)
        place = int(np.argmax(variances))
        half = HALF * sqrt(max(variances[place], 0.0))
        if half <= WIDE:
            break
        follow = left[place] / left[place, place]
        weak.append(direction(follow, places, place, half=half))
        rest = np.arange(places.size) != place
        left = (left - np.outer(left[place], follow))[rest][:, rest]
        places = places[rest]
    unexcited = tuple(names[k] for k in np.flatnonzero(variables.free & ~moving))
    return Identifiability(variables, 0.01 * lengths, rank, unexcited, tuple(null), tuple(weak))


def _fixing(places: list[int], vector: Array, null: Array, fixed: list[int]) -> int | None:
    """The first unknown that removes a gauge beside those fixed already; None if none does."""
    for place in map(int, places):
        if abs(vector[place]) >= 1e-3 and place not in fixed:
            singular = np.linalg.svd(null[[*fixed, place]], compute_uv=False)
            if singular.size == len(fixed) + 1 and singular[-1] > 1e-6:
                return place
    return None


# --- of a stage -----------------------------------------------------------------------------------


@once_per_stage
def identifiability_of(stage: StageFit) -> Identifiability:
    """Which unknowns of a stage the tests determine."""
    linearised, names = stage.linearised, stage.problem.unknowns.names
    fixed = {name: value for name, value in stage.parameters.numbers.items() if name not in names}
    try:
        quoted = uncertainty_of(stage).quoted.matrix
    except InputError:  # too few samples to tell the noise from
        quoted = None
    return identifiability(
        linearised.triangle,
        linearised.variables,
        covariance=quoted,
        tolerance=linearised.tolerance,
        fixed=fixed,
    )


def bounds_reached(stage: StageFit) -> tuple[str, ...]:
    """Sentences on unknowns of the machine that ended at a bound, and what to do about it."""
    point = stage.problem.unknowns.at(stage.solution.vector)
    ends = {-1: "lower", 1: "upper"}
    definitions = DEFINITIONS
    if isinstance(stage.parameters, ParameterSet):
        definitions = stage.parameters.definitions
    return tuple(
        f"{unknown.name} ended at its {ends[side]} bound: "
        f"{stage.stage.beyond(unknown, side, definitions)}."
        for unknown, side in zip(point, point.at_bound.tolist(), strict=True)
        if unknown.run is None and side
    )


def without_value(stage: StageFit) -> list[str]:
    """Unknowns of the machine that ended at a bound, or that the tests do not determine."""
    found = identifiability_of(stage)
    lost = {*found.at_bounds, *found.to_fix}
    machine = (unknown.name for unknown in stage.problem.unknowns if unknown.run is None)
    return [name for name in machine if name in lost]


def weak_unknowns(stage: StageFit) -> list[str]:
    """Unknowns of the machine with an interval wider than 10 % of the value, or without one."""
    pairs = zip(estimates_of(stage), stage.problem.unknowns, strict=True)
    machine = [estimate for estimate, unknown in pairs if unknown.run is None]
    return [unknown.name for unknown in machine if unknown.relative_half_width > WIDE]
