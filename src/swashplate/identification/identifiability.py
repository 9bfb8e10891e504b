"""Identifiability: what tests can tell of the unknowns, and what they cannot."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import exp
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space, qr

from swashplate.errors import InputError
from swashplate.identification.linearised import TOLERANCE, triangular_factor, whitening
from swashplate.identification.unknowns import Unknowns
from swashplate.models.pump import ANGLE, FORCE, MOTION, PRESSURE, TILT, TRAVEL, ZERO
from swashplate.parameters.definitions import CATALOGUE

Array = NDArray[np.float64]

Known = Mapping[str, float]
Move = Callable[[float, float, Known], float]
"""Value, t and all values by symbol to the value moved by t along the gauge; t = 0 leaves it."""

STEP = 1e-3
"""Of the central differences along a gauge, extrapolated once: truncation 1e-13, rounding 1e-13."""


def scaled(power: float) -> Move:
    """Multiply by exp(power·t)."""
    return lambda value, t, known: value * exp(power * t)


@dataclass(frozen=True)
class Gauge:
    """Parameters that can move together without changing what is measured."""

    name: str
    moves: Mapping[str, Move]
    """By the parameter's symbol, without direction or number."""
    determined: str
    """What the tests can tell instead, as an engineer writes it."""
    hold: tuple[str, ...]
    """Symbols to hold, the best first; the others then follow."""
    needs: frozenset[str] = frozenset()
    """Symbols whose values the moves depend on."""

    def tangent(self, variables: Unknowns, fixed: Known | None = None) -> Array:
        """Derivative of the solver's vector along the gauge.

        Parameters
        ----------
        variables : Unknowns
            The unknowns.
        fixed : mapping of str to float, optional
            Values of parameters that are no unknowns, by symbol.

        Returns
        -------
        (K,) array
            0 for what does not move, and throughout if a value that the gauge needs is not known.
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
    Gauge(
        "scale of the spool's tilt",
        _powers(TILT, "force"),
        "only the force, Z16 and Z18 over Z3 and Z8·Z3 are determined well: a small tilt is its "
        "own tangent",
        ("Z3", "Z8", "Z16"),
    ),
    Gauge(
        "scale of the swash angle",
        _powers(ANGLE),
        "only Z1·Z10, Z3/Z10 and Z13·Z10 are determined well: a small angle is its own tangent",
        ("Z10", "Z13", "Z3"),
    ),
)
"""Those of the model; the sentence on Z8/(1+Z6) holds away from the swash plate's stops."""


MENTIONED = 0.02
"""Parts of a direction below this share of its largest, by effect, are not part of it."""

NAMED = 6
"""Changes, or correlated pairs, that a sentence names, the largest first."""


class Direction(NamedTuple):
    """A way for the unknowns to move that the tests do not see, or hardly."""

    changes: Mapping[str, float]
    """By name, strongest effect first, in per cent of the value (of the scale, where the unknown
    is not logarithmic); the largest is 1 %. [%]"""
    sharpness: float
    """Effect, as a part of that of the best determined direction; 0 for none."""
    gauge: Gauge | None
    """The known gauge that it is, if it is one."""
    hold: str
    """The unknown to hold, by which the least is lost; in a faint direction only if its value is
    known, as a wrong one shows in the others."""

    @property
    def sentence(self) -> str:
        """What an engineer would say."""
        faint = self.sharpness > 0.0
        advice = (
            "; hold one of them only if you know it, or make a test that tells them apart."
            if faint
            else f". Hold {self.hold}."
        )
        if self.gauge is not None:
            together = _listed(sorted(self.changes, key=_in_order))
            how = "move together all but unseen" if faint else "can move together unseen"
            words = f"{together} {how} ({self.gauge.name}): {self.gauge.determined}"
            return f"{'Faint: ' if faint else ''}{words}{advice}"
        named = list(self.changes.items())[:NAMED]
        moves = ", ".join(f"{name} {change:+.2g} %" for name, change in named)
        if len(self.changes) > NAMED:
            moves += f" and {len(self.changes) - NAMED} others"
        if not faint:
            together = "together change nothing" if len(self.changes) > 1 else "changes nothing"
            return f"{moves} {together}{advice}"
        return (
            f"Faint: {moves} move together and change the residuals {1.0 / self.sharpness:,.0f} "
            f"times less than the clearest direction{advice}"
        )


class Space(NamedTuple):
    """Derivatives with columns of length 1, of those unknowns that change anything."""

    scaled: Array
    """(m, k)"""
    lengths: Array
    """(k,) lengths of the columns before."""
    places: NDArray[np.intp]
    """(k,) numbers of these unknowns."""

    def without(self, numbers: Sequence[int]) -> Space:
        """The same without some unknowns."""
        kept = ~np.isin(self.places, numbers)
        return Space(self.scaled[:, kept], self.lengths[kept], self.places[kept])

    def along(self, tangent: Array) -> Array:
        """(k,) unit vector of a tangent (K,) in scaled coordinates; 0 if it moves nothing here."""
        scaled = tangent[self.places] * self.lengths
        length = float(np.linalg.norm(scaled))
        return scaled / length if length > 0.0 else scaled


def null_directions(
    space: Space,
    variables: Unknowns,
    gauges: Sequence[Gauge],
    fixed: Known,
    tolerance: float,
) -> list[Direction]:
    """Directions that change nothing, known gauges first, each with the unknown to hold.

    Parameters
    ----------
    space : Space
        Derivatives.
    variables : Unknowns
        All unknowns.
    gauges : sequence of Gauge
        Those to recognise.
    fixed : mapping of str to float
        Values of parameters that are no unknowns, by symbol.
    tolerance : float
        Singular values below this part of the largest count as zero.
    """
    sizes, rows = _singular(space)
    null = rows[np.count_nonzero(sizes > tolerance * sizes[0]) :].T
    found, held = [], list[int]()
    for gauge in gauges:
        vector = space.along(gauge.tangent(variables, fixed))
        # as long as its part in the null space: it changes nothing
        if np.linalg.norm(null.T @ vector) < 1.0 - 1e-6:
            continue
        place = _place_to_hold(gauge, vector, null, held, space, variables)
        if place is not None:
            held.append(place)
            found.append(_direction(vector, 0.0, gauge, place, space, variables))
    # what is left when those are held, with one unknown of its own for each direction
    left = null if not held else null @ null_space(null[held])
    if left.shape[1]:
        order = qr(left.T, mode="r", pivoting=True)[1][: left.shape[1]]
        for column, place in zip((left @ np.linalg.inv(left[order])).T, order, strict=True):
            found.append(_direction(column, 0.0, None, int(place), space, variables))
    return found


def faint_directions(
    space: Space,
    variables: Unknowns,
    gauges: Sequence[Gauge],
    fixed: Known,
    faint: float,
) -> list[Direction]:
    """Directions that change hardly anything, each with those before it held, the faintest first.

    Parameters
    ----------
    space : Space
        Derivatives without null directions.
    variables, gauges, fixed :
        As of `null_directions`.
    faint : float
        Singular values below this part of the largest are faint.
    """
    found: list[Direction] = []
    while space.places.size:
        sizes, rows = _singular(space)
        if sizes[-1] > faint * sizes[0]:
            break
        direction, place = _faintest(space, sizes, rows[-1], variables, gauges, fixed, faint)
        found.append(direction)
        space = space.without([int(space.places[place])])
    return found


def _faintest(
    space: Space,
    sizes: Array,
    row: Array,
    variables: Unknowns,
    gauges: Sequence[Gauge],
    fixed: Known,
    faint: float,
) -> tuple[Direction, int]:
    """The faintest direction, by a gauge's name if it is nearly one, and which unknown to hold."""
    for gauge in gauges:
        vector = space.along(gauge.tangent(variables, fixed))
        sharpness = float(np.linalg.norm(space.scaled @ vector)) / sizes[0]
        if np.count_nonzero(vector) > 1 and sharpness <= faint:
            place = _place_to_hold(gauge, vector, vector[:, None], [], space, variables)
            if place is not None:
                return _direction(vector, sharpness, gauge, place, space, variables), place
    # of those whose holding removes the direction the one that moves most: it costs least
    part = np.abs(row)
    place = int(np.argmax(np.where(part >= 0.5 * part.max(), part / space.lengths, 0.0)))
    return _direction(row, float(sizes[-1] / sizes[0]), None, place, space, variables), place


def _singular(space: Space) -> tuple[Array, Array]:
    _, sizes, rows = np.linalg.svd(space.scaled, full_matrices=True)
    return sizes, rows


def _place_to_hold(
    gauge: Gauge,
    vector: Array,
    null: Array,
    held: Sequence[int],
    space: Space,
    variables: Unknowns,
) -> int | None:
    """The unknown that removes a gauge beside those held already; None if none does."""
    symbols = [symbol_of(variables.names[k]) for k in space.places]
    wanted = [k for symbol in gauge.hold for k, each in enumerate(symbols) if each == symbol]
    for place in (*wanted, *np.argsort(-np.abs(vector))):
        if abs(vector[place]) < 1e-3 or place in held:
            continue
        singular = np.linalg.svd(null[[*held, int(place)]], compute_uv=False)
        if singular.size == len(held) + 1 and singular[-1] > 1e-6:
            return int(place)
    return None


def _direction(
    vector: Array,
    sharpness: float,
    gauge: Gauge | None,
    place: int,
    space: Space,
    variables: Unknowns,
) -> Direction:
    # a short column needs a large change for the same effect: judged by effect, not by size
    spoken = np.abs(vector) >= MENTIONED * np.abs(vector).max()
    relative = np.where(spoken, vector / space.lengths, 0.0)
    # written with the largest change as +1 %
    relative = relative / relative[np.argmax(np.abs(relative))]
    names = [variables.names[k] for k in space.places]
    order = [k for k in np.argsort(-np.abs(vector), kind="stable") if spoken[k]]
    changes = {names[k]: float(relative[k]) for k in order}
    return Direction(changes, sharpness, gauge, names[place])


def _in_order(name: str) -> tuple[str | int, ...]:
    """Z4 before Z16."""
    return tuple(int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name))


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


FAINT = 1e-3
"""Singular values below this part of the largest are reported as hardly determined."""

CORRELATED = 0.95
"""Correlations from here on are listed."""


class Pair(NamedTuple):
    """Two unknowns whose estimates move together."""

    first: str
    second: str
    correlation: float


@dataclass(frozen=True, eq=False)
class Identifiability:
    """Verdict on a fit's unknowns, before a fit or after."""

    variables: Unknowns
    sensitivity: Array
    """(K,) length of the change of all weighted residuals for 1 % of each unknown."""
    singular_values: Array
    """(k,) of the derivatives with columns scaled to length 1, largest first, of those unknowns
    that are free and change anything."""
    tolerance: float
    """Part of the largest below which a singular value counts as zero."""
    rank: int
    """How many combinations of the unknowns are determined."""
    unexcited: tuple[str, ...]
    """Unknowns that change nothing by themselves: no test exercises them."""
    null: tuple[Direction, ...]
    """Directions that change nothing."""
    faint: tuple[Direction, ...]
    """Directions that change hardly anything, when those to hold are held."""
    correlated: tuple[Pair, ...]
    """Pairs of estimates with a correlation beyond 0.95 when those to hold are held."""

    @property
    def complete(self) -> bool:
        """Whether every unknown that is free is determined."""
        return not self.unexcited and not self.null

    @property
    def to_hold(self) -> tuple[str, ...]:
        """Unknowns to hold so that all others are determined; nothing is lost by it."""
        return (*self.unexcited, *(each.hold for each in self.null))

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
        said = [self._summary(free)]
        if self.unexcited:
            said.append(
                f"No test exercises {', '.join(self.unexcited)}: hold "
                f"{'them' if len(self.unexcited) > 1 else 'it'}, or add a test that does."
            )
        said += [each.sentence for each in (*self.null, *self.faint)]
        said += [
            f"{name} = {self.variables.estimates[self.variables.index(name)]:.4g} stands at its "
            f"{side} bound: no interval is given for it; those of the others let it move."
            for name, side in self.at_bounds.items()
        ]
        if self.correlated:
            named = [
                f"{pair.first} and {pair.second} {pair.correlation:+.3f}"
                for pair in self.correlated[:NAMED]
            ]
            more = len(self.correlated) - len(named)
            said.append(
                f"Strongly correlated estimates: {', '.join(named)}"
                f"{f', and {more} more pairs' if more else ''}."
            )
        return tuple(said)

    def _summary(self, free: int) -> str:
        if not free:
            return "All unknowns stand at a bound: there is nothing left to determine."
        if not self.rank:
            return "The tests determine none of the unknowns."
        smallest = self.singular_values[self.rank - 1] / self.singular_values[0]
        noun = "combination" if self.rank == 1 else "combinations"
        what = (
            f"{self.rank} {noun} of {free} free unknowns"
            if self.rank < free
            else f"all {free} free unknowns"
        )
        return (
            f"The tests determine {what}; the faintest direction has {smallest:.1e} of the "
            f"effect of the clearest, and below {self.tolerance:.0e} counts as none."
        )


def identifiability(
    derivatives: Array,
    variables: Unknowns,
    *,
    covariance: Array | None = None,
    tolerance: float = TOLERANCE,
    fixed: Known | None = None,
    gauges: Sequence[Gauge] = GAUGES,
) -> Identifiability:
    """Judge what derivatives tell of the unknowns.

    Parameters
    ----------
    derivatives : (m, K) array
        Derivatives of all weighted residuals by the solver's vector, or their triangular factor.
    variables : Unknowns
        The unknowns; those at a bound count as held.
    covariance : (K, K) array, optional
        Of the solver's vector, for the correlations; by default that of white noise.
    tolerance : float
        Singular values below this part of the largest count as zero: 1e-10 for exact derivatives,
        1e-6 for central differences.
    fixed : mapping of str to float, optional
        Values of parameters that are no unknowns, by symbol; some gauges need them.
    gauges : sequence of Gauge
        Null directions that have a name.

    Raises
    ------
    InputError
        If the shape is wrong or a number is not finite.
    """
    triangle = np.asarray(derivatives, dtype=np.float64)
    if triangle.ndim != 2 or triangle.shape[1] != variables.count:
        raise InputError(
            f"The derivatives have the shape {triangle.shape}; {variables.count} unknowns need as "
            "many columns."
        )
    if not np.isfinite(triangle).all():
        column = int(np.argwhere(~np.isfinite(triangle))[0][1])
        raise InputError(f"The derivatives by {variables.names[column]} are not all finite.")
    if triangle.shape[0] > variables.count:
        triangle = triangular_factor(triangle)
    lengths = np.linalg.norm(triangle, axis=0)
    # a column of mere rounding is none
    moving = variables.free & (lengths > 1e-14 * lengths.max(initial=0.0))
    places = np.flatnonzero(moving)
    unexcited = tuple(
        name
        for name, free, moves in zip(variables.names, variables.free, moving, strict=True)
        if free and not moves
    )
    space = Space(triangle[:, places] / lengths[places], lengths[places], places)
    sizes: Array = np.zeros(0)
    null, faint = list[Direction](), list[Direction]()
    kept = space
    if places.size:
        sizes = np.asarray(np.linalg.svd(space.scaled, compute_uv=False), dtype=np.float64)
        null = null_directions(space, variables, gauges, fixed or {}, tolerance)
        kept = space.without([variables.names.index(each.hold) for each in null])
        faint = faint_directions(kept, variables, gauges, fixed or {}, FAINT)
        kept = kept.without([variables.names.index(each.hold) for each in faint])
    return Identifiability(
        variables,
        0.01 * lengths,
        sizes,
        tolerance,
        int(np.count_nonzero(sizes > tolerance * sizes[0])) if sizes.size else 0,
        unexcited,
        tuple(null),
        tuple(faint),
        correlated_pairs(kept, variables, covariance, tolerance),
    )


def correlated_pairs(
    space: Space, variables: Unknowns, covariance: Array | None, tolerance: float
) -> tuple[Pair, ...]:
    """Pairs of unknowns in `space` with a correlation beyond 0.95, the strongest first."""
    if covariance is None:
        free = np.ones(space.places.size, dtype=np.bool_)
        inverse, _ = whitening(space.scaled, free, tolerance)
        part = inverse @ inverse.T
    else:
        part = covariance[np.ix_(space.places, space.places)]
    errors = np.sqrt(np.maximum(np.diag(part), 0.0))
    scaled = part / np.outer(
        np.where(errors > 0.0, errors, 1.0), np.where(errors > 0.0, errors, 1.0)
    )
    names = [variables.names[k] for k in space.places]
    pairs = [
        Pair(names[i], names[k], float(scaled[i, k]))
        for i in range(len(names))
        for k in range(i + 1, len(names))
        if abs(scaled[i, k]) >= CORRELATED
    ]
    return tuple(sorted(pairs, key=lambda pair: -abs(pair.correlation)))
