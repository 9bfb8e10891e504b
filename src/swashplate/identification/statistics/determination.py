"""Identifiability: what tests can tell of the unknowns, and what they cannot."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from math import inf, isfinite, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space, qr

from swashplate.errors import InputError
from swashplate.identification.estimation.arrow import dense_factor, triangular_factor, whitening
from swashplate.identification.estimation.problem import (
    TOLERANCE,
    RoundedUnknown,
    rounded_unknowns,
)
from swashplate.identification.estimation.unknowns import Unknown, Unknowns
from swashplate.identification.optimum import Optimum, once_per_fit
from swashplate.identification.statistics.intervals import estimates_of, uncertainty_of
from swashplate.models.displacement_control import FORCE, MOTION, PRESSURE, TRAVEL, ZERO
from swashplate.parameters import CATALOGUE, DEFINITIONS, ParameterSet
from swashplate.results import Result
from swashplate.tables import listed

Array = NDArray[np.float64]
Values = Mapping[str, float]
GaugeDerivative = Callable[[float, Values], float]
"""Derivative of a parameter along a gauge, from its value and the values of all, by symbol."""

WIDE = 0.1
"""Half width of a 95 % interval, of the value or the scale, from which an unknown is weak. [1]"""
VAGUE = 1.0
"""Half width of a 95 % interval, of the value or the scale, from which an unknown is hardly known.
[1]"""
HALF = 1.96
"""Half width of a 95 % interval, in standard errors."""
LEAST_EFFECT = 0.02
"""Effect of an unknown's change that still belongs to a direction, over the largest effect. [1]"""
NAMED = 6
"""Changes that a sentence names, the largest first."""


@dataclass(frozen=True, eq=False)
class Gauge:
    """Parameters that can change together without changing what is measured."""

    name: str
    derivatives: Mapping[str, GaugeDerivative]
    """Those of the parameters that change, by symbol, without direction or number."""
    determined: str
    """What the tests can tell instead, as an engineer writes it."""
    fix: tuple[str, ...]
    """Symbols to fix, the best first; the others then follow."""

    def tangent(self, variables: Unknowns, fixed: Values | None = None) -> Array:
        """Direction (K,) of the solver's vector in which the measured signals do not change.

        An element is 0 if its unknown is not part of the gauge. All are 0 if a value that the gauge
        needs is neither that of an unknown nor among the `fixed` ones, by symbol.
        """
        symbols = [symbol_of(unknown) for unknown in variables]
        estimates = variables.estimates.tolist()
        values = dict(fixed or {})
        values.update(zip(symbols, estimates, strict=True))
        changes = np.zeros(len(variables))
        try:
            for k, (symbol, value) in enumerate(zip(symbols, estimates, strict=True)):
                if symbol in self.derivatives:
                    changes[k] = self.derivatives[symbol](value, values)
        except KeyError:
            return np.zeros(len(variables))
        # from the parameters to the solver's vector, which has logarithms of some
        return np.asarray(changes / variables.slopes)


def symbol_of(unknown: Unknown) -> str:
    """Symbol of a parameter, such as Z16 of ``Z16_plus``; of any other unknown its kind."""
    if unknown.kind != "parameter":
        return unknown.kind
    column = unknown.name.rsplit(".", 1)[-1]
    return column.removesuffix("_plus").removesuffix("_minus")


def _gauge(
    name: str,
    symmetry: str,
    determined: str,
    fix: str,
    *others: str,
    **derivatives: GaugeDerivative,
) -> Gauge:
    """A gauge along one of the models' symmetries.

    `others` also change in proportion to their values; `derivatives` adds parameters, or replaces
    their derivatives.
    """
    powers = {
        symbol: definition.symmetry[symmetry]
        for symbol, definition in CATALOGUE.items()
        if symmetry in definition.symmetry
    } | dict.fromkeys(others, 1.0)

    def power(exponent: float) -> GaugeDerivative:
        return lambda value, values: exponent * value

    in_proportion = {symbol: power(exponent) for symbol, exponent in powers.items()}
    return Gauge(
        name=name,
        derivatives=in_proportion | derivatives,
        determined=f"only {determined} determined",
        fix=tuple(fix.split()),
    )


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
        Z2=lambda value, values: values["Z1"] * values["Z9"],
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
        Z6=lambda value, values: 1.0 + value,
    ),
)
"""Those of the model, in an order in which none undoes an earlier one; the sentence on Z8/(1+Z6)
holds away from the swash plate's stops."""


class NullDirection(NamedTuple):
    """A common change of the unknowns that the tests do not see, or hardly."""

    changes: Mapping[str, float]
    """By name, strongest effect first, in per cent of the value (of the scale, if the unknown is
    not logarithmic); the largest is 1 %. [%]"""
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
    """Which unknowns the tests determine, before a fit or after."""

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
    rounded: tuple[RoundedUnknown, ...] = ()
    """Unknowns that the model rounds, so that their derivatives say nothing."""

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
        sentences = [self._determined()]
        rounded = {unknown.name for unknown in self.rounded}
        unexcited = [name for name in self.unexcited if name not in rounded]
        if unexcited:
            them = "them" if len(unexcited) > 1 else "it"
            names = ", ".join(unexcited)
            sentences.append(f"No test exercises {names}: fix {them}, or add a test that does.")
        sentences += [unknown.sentence for unknown in self.rounded]
        sentences += [direction.sentence for direction in self.null]
        if len(self.weak) == 1:
            sentences.append(self.weak[0].sentence)
        elif self.weak:
            precisions = [f"{direction.fix} {direction.precision}" for direction in self.weak]
            sentences.append(
                f"Weak, each with those before it fixed: {listed(precisions)}. Add tests that "
                "determine them, or fix those whose values you know."
            )
        for name, side in self.at_bounds.items():
            value = self.variables.estimates[self.variables.index(name)]
            sentences.append(
                f"{name} = {value:.4g} is at its {side} bound and has no interval; the intervals "
                "of the others let it change."
            )
        return tuple(sentences)

    def _determined(self) -> str:
        """How many combinations of the unknowns the tests determine, in a sentence."""
        free, rank = int(np.count_nonzero(self.variables.free)), self.rank
        if not free:
            return "All parameters are at a bound: there is nothing left to determine."
        if not rank:
            return "The tests determine none of the parameters."
        vague = [direction.fix for direction in self.weak if direction.half_width >= VAGUE]
        if vague and rank > len(vague):
            clear = _combinations(rank - len(vague), free)
            return f"The tests determine {clear}, and hardly {listed(vague)}."
        if rank < free:
            return f"The tests determine {_combinations(rank, free)}."
        weakly = f", {len(self.weak)} of them weakly" if self.weak else ""
        return f"The tests determine all {free} free parameters{weakly}."


def _combinations(number: int, free: int) -> str:
    return f"{number} combination{'' if number == 1 else 's'} of {free} free parameters"


def identifiability(
    derivatives: Array,
    variables: Unknowns,
    *,
    covariance: Array | None = None,
    tolerance: float = TOLERANCE,
    fixed: Values | None = None,
    rounded: tuple[RoundedUnknown, ...] = (),
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
        Values of parameters that are not unknowns, by symbol; some gauges need them.
    rounded : tuple of RoundedUnknown
        What the model rounds, see `problem.rounded_unknowns`.
    """
    triangle = np.asarray(derivatives, dtype=np.float64)
    names = variables.names
    if not np.isfinite(triangle).all():
        column = int(np.argwhere(~np.isfinite(triangle))[0][1])
        raise InputError(f"The derivatives by {names[column]} are not all finite.")
    if triangle.shape[0] > len(variables):
        triangle = triangular_factor(triangle)
    column_norms = np.linalg.norm(triangle, axis=0)
    # a column of mere rounding changes nothing
    moving = variables.free & (column_norms > 1e-14 * column_norms.max(initial=0.0))
    columns = np.flatnonzero(moving)
    null, rank = _null_directions(
        triangle, variables, columns, column_norms, tolerance=tolerance, fixed=fixed
    )
    # those found are fixed, so that the weak ones are what is left without them
    fixed_columns = [names.index(direction.fix) for direction in null]
    columns = columns[~np.isin(columns, fixed_columns)]
    if covariance is None:
        every = np.ones(columns.size, dtype=np.bool_)
        inverse = whitening(dense_factor(triangle[:, columns]), every, TOLERANCE).matrix
        remaining = inverse @ inverse.T
    else:
        remaining = covariance[np.ix_(columns, columns)]
    return Identifiability(
        variables=variables,
        sensitivity=0.01 * column_norms,
        rank=rank,
        unexcited=tuple(names[k] for k in np.flatnonzero(variables.free & ~moving)),
        null=tuple(null),
        weak=tuple(_weak_directions(remaining, variables, columns, column_norms)),
        rounded=rounded,
    )


def _null_directions(
    triangle: Array,
    variables: Unknowns,
    columns: NDArray[np.intp],
    column_norms: Array,
    *,
    tolerance: float,
    fixed: Values | None,
) -> tuple[list[NullDirection], int]:
    """Directions that change nothing, the model's gauges first, and the rank of the others.

    Of the unknowns in some columns; `column_norms` (K,) are those of all columns of the triangle.
    """
    null = list[NullDirection]()
    if not columns.size:
        return null, 0
    scale = column_norms[columns]
    symbols = [symbol_of(variables[int(k)]) for k in columns]
    _, sizes, rows = np.linalg.svd(triangle[:, columns] / scale, full_matrices=True)
    rank = int(np.count_nonzero(sizes > tolerance * sizes[0]))
    free = rows[rank:].T
    fixes = list[int]()
    for gauge in GAUGES:
        vector = gauge.tangent(variables, fixed)[columns] * scale
        vector /= np.linalg.norm(vector) or 1.0
        # as long as its part in the null space: it changes nothing
        if np.linalg.norm(free.T @ vector) >= 1.0 - 1e-6:
            preferred = [k for fix in gauge.fix for k, s in enumerate(symbols) if s == fix]
            fix = _fixing([*preferred, *np.argsort(-np.abs(vector))], vector, free, fixes)
            if fix is not None:
                fixes.append(fix)
                null.append(
                    _direction(
                        vector / scale, variables, columns, column_norms, fix=fix, gauge=gauge
                    )
                )
    # the rest of the null space, with one unknown to fix for each direction
    rest = free @ null_space(free[fixes]) if fixes else free
    if rest.shape[1]:
        order = qr(rest.T, mode="r", pivoting=True)[1][: rest.shape[1]]
        for vector, fix in zip((rest @ np.linalg.inv(rest[order])).T, order, strict=True):
            null.append(_direction(vector / scale, variables, columns, column_norms, fix=int(fix)))
    return null, rank


def _weak_directions(
    covariance: Array, variables: Unknowns, columns: NDArray[np.intp], column_norms: Array
) -> Iterator[NullDirection]:
    """Directions with wide intervals, each with those before it fixed.

    How the others follow an unknown is its column of the covariance over its variance.
    """
    machine = np.array([unknown.run is None for unknown in variables])
    while columns.size:
        variances = np.where(machine[columns], np.diag(covariance), 0.0)
        widest = int(np.argmax(variances))
        half_width = HALF * sqrt(max(variances[widest], 0.0))
        if half_width <= WIDE:
            return
        follow = covariance[widest] / covariance[widest, widest]
        yield _direction(
            follow, variables, columns, column_norms, fix=widest, half_width=half_width
        )
        others = np.arange(columns.size) != widest
        covariance = (covariance - np.outer(covariance[widest], follow))[others][:, others]
        columns = columns[others]


def _direction(
    changes_of_columns: Array,
    variables: Unknowns,
    columns: NDArray[np.intp],
    column_norms: Array,
    *,
    fix: int,
    gauge: Gauge | None = None,
    half_width: float = inf,
) -> NullDirection:
    """The null direction, scaled so that its largest change is 1, without negligible effects.

    `changes_of_columns` (k,) are those of the unknowns in the columns (k,); the one at index `fix`
    of these is to be fixed. `column_norms` (K,) are those of all columns.
    """
    # a column of small norm needs a large change for the same effect: effects are compared
    effect = np.abs(changes_of_columns) * column_norms[columns]
    least = LEAST_EFFECT * effect.max()
    order = [k for k in np.argsort(-effect, kind="stable") if effect[k] >= least]
    largest = max((float(changes_of_columns[k]) for k in order), key=abs)
    names = variables.names
    changes = {names[columns[k]]: float(changes_of_columns[k]) / largest for k in order}
    return NullDirection(
        changes=changes,
        half_width=half_width,
        gauge=gauge,
        fix=names[columns[fix]],
    )


def _fixing(candidates: list[int], vector: Array, null: Array, fixed: list[int]) -> int | None:
    """The first unknown that removes a gauge if it is fixed, too; None if none does."""
    for candidate in map(int, candidates):
        if abs(vector[candidate]) >= 1e-3 and candidate not in fixed:
            singular = np.linalg.svd(null[[*fixed, candidate]], compute_uv=False)
            if singular.size == len(fixed) + 1 and singular[-1] > 1e-6:
                return candidate
    return None


# --- of a fit -------------------------------------------------------------------------------------


@once_per_fit
def identifiability_of(fit: Optimum) -> Identifiability:
    """Which unknowns of a fit the tests determine."""
    linearised = fit.linearised
    names = fit.problem.unknowns.names
    fixed = {name: value for name, value in fit.parameters.numbers.items() if name not in names}
    try:
        quoted = uncertainty_of(fit).quoted.matrix
    except InputError:  # too few samples to tell the noise from
        quoted = None
    return identifiability(
        linearised.triangle,
        linearised.variables,
        covariance=quoted,
        tolerance=linearised.tolerance,
        fixed=fixed,
        rounded=rounded_unknowns(fit.problem, fit.solution.vector),
    )


def bounds_reached(fit: Optimum) -> tuple[str, ...]:
    """Sentences on unknowns of the machine that ended at a bound, and what to do about it."""
    point = fit.problem.unknowns.at(fit.solution.vector)
    ends = {-1: "lower", 1: "upper"}
    definitions = DEFINITIONS
    if isinstance(fit.parameters, ParameterSet):
        definitions = fit.parameters.definitions
    return tuple(
        f"{unknown.name} ended at its {ends[side]} bound: "
        f"{fit.setup.beyond(unknown, side, definitions)}."
        for unknown, side in zip(point, point.at_bound.tolist(), strict=True)
        if unknown.run is None and side
    )


def without_value(fit: Optimum) -> list[str]:
    """Unknowns of the machine that ended at a bound, or that the tests do not determine."""
    judged = identifiability_of(fit)
    lost = {*judged.at_bounds, *judged.to_fix}
    machine = (unknown.name for unknown in fit.problem.unknowns if unknown.run is None)
    return [name for name in machine if name in lost]


def weak_unknowns(fit: Optimum) -> list[str]:
    """Unknowns of the machine with an interval wider than 10 % of the value, or without one."""
    pairs = zip(estimates_of(fit), fit.problem.unknowns, strict=True)
    machine = [estimate for estimate, unknown in pairs if unknown.run is None]
    return [estimate.name for estimate in machine if estimate.relative_half_width > WIDE]
