"""What a fit's tests can tell of its unknowns, and what they cannot, in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError
from swashplate.identification.gauges import GAUGES, Gauge, Known
from swashplate.identification.linearised import TOLERANCE, triangular_factor, whitening
from swashplate.identification.null_directions import (
    Direction,
    Space,
    faint_directions,
    null_directions,
)
from swashplate.identification.unknowns import Unknowns

Array = NDArray[np.float64]

FAINT = 1e-3
"""Singular values below this part of the largest are reported as hardly determined."""

CORRELATED = 0.95
"""Correlations from here on are listed."""

NAMED = 6
"""Correlated pairs that the sentence names."""


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
            f"{side} bound: no interval is given for it, and the others' hold with it held there."
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
