"""Directions of the unknowns that change nothing, or hardly anything, and which to hold."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space, qr

from swashplate.identification.gauges import Gauge, Known, symbol_of
from swashplate.identification.unknowns import Unknowns

Array = NDArray[np.float64]

MENTIONED = 0.02
"""Parts of a direction below this share of its largest, by effect, are not part of it."""

NAMED = 6
"""Changes that a sentence names, the largest by effect."""


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
