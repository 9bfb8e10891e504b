"""Identifiability: what tests can tell of the unknowns, and what they cannot."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import exp, inf, isfinite, sqrt
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space, qr

from swashplate.errors import InputError
from swashplate.identification.drive_model import DriveModel, true_value
from swashplate.identification.problem import TOLERANCE, triangular_factor, whitening
from swashplate.identification.unknowns import Unknowns
from swashplate.models.displacement_control import (
    FORCE,
    MOTION,
    PRESSURE,
    TRAVEL,
    ZERO,
)
from swashplate.parameters.definitions import CATALOGUE
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.results import Result
from swashplate.tables import listed

if TYPE_CHECKING:
    from swashplate.identification.fitting import Fit, StageFit

Array = NDArray[np.float64]

Known = Mapping[str, float]
Move = Callable[[float, float, Known], float]
"""Value, t and all values by symbol to the value moved by t along the gauge; t = 0 leaves it."""

STEP = 1e-3
"""Of the central differences along a gauge, extrapolated once: truncation 1e-13, rounding 1e-13."""


def scaled(power: float) -> Move:
    """Multiply by exp(power·t)."""
    return lambda value, t, known: value * exp(power * t)


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
    needs: frozenset[str] = frozenset()
    """Symbols whose values the moves depend on."""

    def tangent(self, variables: Unknowns, fixed: Known | None = None) -> Array:
        """Derivative (K,) of the solver's vector along the gauge.

        0 for what does not move, and throughout if a value that the gauge needs is neither among
        the unknowns nor among the `fixed` ones, by symbol.
        """
        symbols = [symbol_of(name) for name in variables.names]
        estimates = map(float, variables.estimates)
        known = {**(fixed or {}), **dict(zip(symbols, estimates, strict=True))}
        slopes = np.zeros(variables.count)
        if not self.needs <= known.keys():
            return slopes
        for k, symbol in enumerate(symbols):
            move = self.moves.get(symbol)
            if move is None:
                continue
            value = float(variables.estimates[k])

            def slope(step: float, move: Move = move, value: float = value) -> float:
                return (move(value, step, known) - move(value, -step, known)) / (2.0 * step)

            by_value = (4.0 * slope(0.5 * STEP) - slope(STEP)) / 3.0
            slopes[k] = by_value / variables.slopes[k]
        return slopes


def symbol_of(name: str) -> str:
    """Symbol of an unknown: ``Z16_plus`` is Z16, ``force_plus_2`` force, the run falls away."""
    bare = re.sub(r"\s*\(.*\)$", "", name.rsplit(".", 1)[-1])
    return re.sub(r"(_plus|_minus)?(_\d+)?$", "", bare)


def _plus_one(power: float) -> Move:
    """Multiply 1 + value by exp(power·t)."""
    return lambda value, t, known: (1.0 + value) * exp(power * t) - 1.0


def _tangent_offset(value: float, t: float, known: Known) -> float:
    return value + known["Z1"] * known["Z9"] * (exp(t) - 1.0)


def _powers(symmetry: str, *others: str) -> dict[str, Move]:
    """Moves of the parameters along one of the models' symmetries, and of others in proportion."""
    powers = {
        symbol: definition.symmetry[symmetry]
        for symbol, definition in CATALOGUE.items()
        if symmetry in definition.symmetry
    }
    return {name: scaled(power) for name, power in (powers | dict.fromkeys(others, 1.0)).items()}


_PRESSURES = ("initial pressure", "start_pressure", "start pressure")

GAUGES: Sequence[Gauge] = (
    Gauge(
        "scale of pressure",
        _powers(PRESSURE, *_PRESSURES),
        "only Z1·Z9, Z1·Z15 and Z8·√Z1 are determined",
        ("Z1", "Z9", "Z8"),
    ),
    Gauge(
        "zero of pressure",
        {**_powers(ZERO), "Z2": _tangent_offset},
        "only Z9 - Z2/Z1 is determined",
        ("Z2", "Z9"),
        frozenset({"Z1", "Z9"}),
    ),
    Gauge(
        "scale of spool travel",
        _powers(TRAVEL),
        "only Z4/Z5², Z14/Z5, Z16/Z5, Z18/Z5 and Z8·Z5 are determined",
        ("Z5", "Z8", "Z16"),
    ),
    Gauge(
        "scale of force",
        _powers(FORCE, "force"),
        "only the solenoid force over √Z4 is determined",
        ("Z4", "Z19", "force"),
    ),
    Gauge(
        "piston motion against flow gain",
        {"Z6": _plus_one(1.0), **_powers(MOTION)},
        "only Z8/(1+Z6) is determined",
        ("Z6", "Z8"),
    ),
)
"""Those of the model; the sentence on Z8/(1+Z6) holds away from the swash plate's stops."""


MENTIONED = 0.02
"""Parts of a direction below this share of its largest, by effect, are not part of it."""

NAMED = 6
"""Changes that a sentence names, the largest first."""

WIDE = 0.1
"""Half width of a 95 % interval, of the value or the scale, from which an unknown is weak. [1]"""

HALF = 1.96
"""Half width of a 95 % interval, in standard errors."""


class Direction(NamedTuple):
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
                f"Weak: {self.fix} is known to ±{100.0 * self.half_width:.3g} % only{along}. Add a "
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
    null: tuple[Direction, ...]
    """Directions that change nothing."""
    weak: tuple[Direction, ...]
    """Directions along which intervals are wider than ±10 %, those before it fixed."""

    @property
    def complete(self) -> bool:
        """Whether every unknown that is free is determined."""
        return not self.unexcited and not self.null

    @property
    def to_fix(self) -> tuple[str, ...]:
        """Unknowns to fix so that all others are determined; nothing is lost by it."""
        return (*self.unexcited, *(each.fix for each in self.null))

    @property
    def at_bounds(self) -> dict[str, str]:
        """Unknowns at a bound, by name: ``"lower"`` or ``"upper"``."""
        return {
            name: "lower" if side < 0 else "upper"
            for name, side in zip(self.variables.names, self.variables.at_bound, strict=True)
            if side
        }

    def sentences(self) -> tuple[str, ...]:
        """The verdict in words, one sentence each."""
        free = int(np.count_nonzero(self.variables.free))
        noun = "combination" if self.rank == 1 else "combinations"
        said = [
            "All parameters are at a bound: there is nothing left to determine."
            if not free
            else "The tests determine none of the parameters."
            if not self.rank
            else f"The tests determine {self.rank} {noun} of {free} free parameters."
            if self.rank < free
            else f"The tests determine all {free} free parameters."
        ]
        if self.unexcited:
            said.append(
                f"No test exercises {', '.join(self.unexcited)}: fix "
                f"{'them' if len(self.unexcited) > 1 else 'it'}, or add a test that does."
            )
        said += [each.sentence for each in self.null]
        if len(self.weak) == 1:
            said.append(self.weak[0].sentence)
        elif self.weak:
            known = [f"{each.fix} to ±{100.0 * each.half_width:.3g} %" for each in self.weak]
            said.append(
                f"Weak, each with those before it fixed: {listed(known)}. Add tests that determine "
                "them, or fix those whose values you know."
            )
        return (
            *said,
            *(
                f"{name} = {self.variables.estimates[self.variables.index(name)]:.4g} is at its "
                f"{side} bound and has no interval; the intervals of the others let it change."
                for name, side in self.at_bounds.items()
            ),
        )


def identifiability(
    derivatives: Array,
    variables: Unknowns,
    *,
    covariance: Array | None = None,
    tolerance: float = TOLERANCE,
    fixed: Known | None = None,
) -> Identifiability:
    """Judge what derivatives tell of the unknowns.

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
        Singular values below this part of the largest count as zero: 1e-10 for exact derivatives,
        1e-6 for central differences.
    fixed : mapping of str to float, optional
        Values of parameters that are no unknowns, by symbol; some gauges need them.

    Raises
    ------
    InputError
        If a derivative is not finite.
    """
    triangle = np.asarray(derivatives, dtype=np.float64)
    if not np.isfinite(triangle).all():
        column = int(np.argwhere(~np.isfinite(triangle))[0][1])
        raise InputError(f"The derivatives by {variables.names[column]} are not all finite.")
    if triangle.shape[0] > variables.count:
        triangle = triangular_factor(triangle)
    lengths = np.linalg.norm(triangle, axis=0)
    # a column of mere rounding is none
    moving = variables.free & (lengths > 1e-14 * lengths.max(initial=0.0))
    unexcited = variables.free & ~moving
    space = _Space(triangle, lengths, np.flatnonzero(moving), variables)
    null, rank = space.null(tolerance, {each: each.tangent(variables, fixed) for each in GAUGES})
    left = space.without([variables.names.index(each.fix) for each in null])
    return Identifiability(
        variables,
        0.01 * lengths,
        rank,
        tuple(name for name, none in zip(variables.names, unexcited, strict=True) if none),
        tuple(null),
        tuple(left.weak(covariance)),
    )


@dataclass(frozen=True, eq=False)
class _Space:
    """The unknowns that change anything."""

    triangle: Array
    """(m, K)"""
    lengths: Array
    """(K,) of the columns."""
    places: NDArray[np.intp]
    """(k,) numbers of these unknowns."""
    variables: Unknowns

    def without(self, numbers: Sequence[int]) -> _Space:
        """The same without some unknowns."""
        return replace(self, places=self.places[~np.isin(self.places, numbers)])

    def null(
        self, tolerance: float, tangents: Mapping[Gauge, Array]
    ) -> tuple[list[Direction], int]:
        """Directions that change nothing, known gauges first, and the rank of the others."""
        if not self.places.size:
            return [], 0
        lengths = self.lengths[self.places]
        _, sizes, rows = np.linalg.svd(self.triangle[:, self.places] / lengths, full_matrices=True)
        rank = int(np.count_nonzero(sizes > tolerance * sizes[0]))
        null, found, fixed = rows[rank:].T, list[Direction](), list[int]()
        for gauge, tangent in tangents.items():
            vector = tangent[self.places] * lengths
            vector /= np.linalg.norm(vector) or 1.0
            # as long as its part in the null space: it changes nothing
            if np.linalg.norm(null.T @ vector) < 1.0 - 1e-6:
                continue
            place = self._place_to_fix(gauge, vector, null, fixed)
            if place is not None:
                fixed.append(place)
                found.append(self._direction(vector / lengths, inf, gauge, place))
        # what is left when those are fixed, with one unknown of its own for each direction
        left = null if not fixed else null @ null_space(null[fixed])
        if left.shape[1]:
            order = qr(left.T, mode="r", pivoting=True)[1][: left.shape[1]]
            for column, place in zip((left @ np.linalg.inv(left[order])).T, order, strict=True):
                found.append(self._direction(column / lengths, inf, None, int(place)))
        return found, rank

    def weak(self, covariance: Array | None) -> list[Direction]:
        """Directions along which an unknown's interval is wide, the widest first.

        How the others follow an unknown is its column of the covariance, over its variance. Each
        found is fixed, so that the next ones are what is left without it.
        """
        if covariance is None:
            every = np.ones(self.places.size, dtype=np.bool_)
            inverse, _ = whitening(self.triangle[:, self.places], every, TOLERANCE)
            left = inverse @ inverse.T
        else:
            left = covariance[np.ix_(self.places, self.places)]
        found, space = list[Direction](), self
        machine = np.array([each.run is None for each in self.variables])
        while space.places.size:
            variances = np.where(machine[space.places], np.diag(left), 0.0)
            place = int(np.argmax(variances))
            half = HALF * sqrt(max(variances[place], 0.0))
            if half <= WIDE:
                break
            vector = left[place] / left[place, place]
            found.append(space._direction(vector, half, None, place))
            rest = np.arange(space.places.size) != place
            left = (left - np.outer(left[place], left[place]) / left[place, place])[rest][:, rest]
            space = space.without([int(space.places[place])])
        return found

    def _place_to_fix(
        self, gauge: Gauge, vector: Array, null: Array, fixed: Sequence[int]
    ) -> int | None:
        """The unknown that removes a gauge beside those fixed already; None if none does."""
        symbols = [symbol_of(self.variables.names[k]) for k in self.places]
        wanted = [k for symbol in gauge.fix for k, each in enumerate(symbols) if each == symbol]
        for place in (*wanted, *np.argsort(-np.abs(vector))):
            if abs(vector[place]) < 1e-3 or place in fixed:
                continue
            singular = np.linalg.svd(null[[*fixed, int(place)]], compute_uv=False)
            if singular.size == len(fixed) + 1 and singular[-1] > 1e-6:
                return int(place)
        return None

    def _direction(
        self, moved: Array, half_width: float, gauge: Gauge | None, place: int
    ) -> Direction:
        """From changes (k,) of the solver's numbers."""
        # a short column needs a large change for the same effect: judged by effect, not by size
        effect = np.abs(moved) * self.lengths[self.places]
        least = MENTIONED * effect.max()
        order = [k for k in np.argsort(-effect, kind="stable") if effect[k] >= least]
        largest = max((float(moved[k]) for k in order), key=abs)
        names = [self.variables.names[k] for k in self.places]
        changes = {names[k]: float(moved[k]) / largest for k in order}
        return Direction(changes, half_width, gauge, names[place])


SCALES = (
    "scale of pressure",
    "zero of pressure",
    "scale of spool travel",
    "scale of force",
    "piston motion against flow gain",
)
"""Gauges along which nothing that is measured changes (the last one, away from the stops), in an
order in which none undoes an earlier one."""


def true_values(stage: StageFit, truth: ParameterSet) -> dict[str, float]:
    """What the stage's unknowns of the machine really are, by name, in their units."""
    model = stage.problem.model
    assert isinstance(model, DriveModel)
    unknowns = stage.problem.unknowns
    found = {
        name: true_value(unknown, model, truth)
        for name, unknown in zip(unknowns.names, unknowns, strict=True)
    }
    return {name: value for name, value in found.items() if value is not None}


def moved_columns(fit: Fit) -> set[str]:
    """Columns of the drive's parameters that some stage moved."""
    moved: set[str] = set()
    for each in fit.stages:
        for unknown in each.problem.unknowns:
            moved |= set(unknown.targets)
        if isinstance(each.problem.model, DriveModel) and each.problem.model.forces is not None:
            moved |= set(each.problem.model.forces.columns)
    return moved
