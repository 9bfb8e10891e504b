"""Which further test would tell most: Fisher information of candidates beside that at hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError
from swashplate.identification.linearised import TOLERANCE, triangular_factor, whitening
from swashplate.identification.variables import Variables

Array = NDArray[np.float64]


KNOWN = 1.0
"""Standard error of a solver's number, 100 %, up to which an unknown counts as determined."""

WORTH = 1e-3
"""Relative gain below which nothing is said of it."""

NAMED = 6
"""Unknowns that a sentence names."""


class Candidate(NamedTuple):
    """A test that could be made."""

    name: str
    derivatives: Array
    """(m, K) of what it would measure by the solver's vector, over the noise's deviation; or their
    triangular factor."""
    inflation: float = 1.0
    """Samples that stand for one independent one."""
    duration: float | None = None
    """How long it takes, if that is to count. [s]"""

    @property
    def rows(self) -> Array:
        """(<= K, K) triangular factor with coloured noise counted."""
        return triangular_factor(self.derivatives / np.sqrt(self.inflation))


class Gain(NamedTuple):
    """What a candidate would do for one unknown."""

    name: str
    before: float
    """Standard error of the solver's number now; inf if undetermined."""
    after: float
    """And with the candidate."""

    @property
    def ratio(self) -> float:
        """After over before: 1 is no gain, 0 determines what was not."""
        if self.before == self.after:
            return 1.0
        return 0.0 if self.before == inf else self.after / self.before


@dataclass(frozen=True)
class Advice:
    """One candidate, judged."""

    candidate: str
    gains: tuple[Gain, ...]
    """For each free unknown."""
    newly_determined: tuple[str, ...]
    """Unknowns whose standard error it would be the first to bring below 100 %."""
    ranks: int
    """How many more combinations would be determined."""
    d_gain: float
    """Mean factor by which standard errors shrink along the directions determined already
    (D-criterion), 1 is none."""
    a_gain: float
    """Factor by which the root mean square standard error of the unknowns determined already
    shrinks (A-criterion), 1 is none."""
    duration: float | None

    @property
    def rank(self) -> tuple[int, int, float]:
        """Least for the best: unknowns newly determined, combinations, D-gain."""
        return -len(self.newly_determined), -self.ranks, -self.d_gain

    @property
    def best(self) -> Gain | None:
        """The unknown that gains most, of those that are then known to better than 100 %."""
        known = [gain for gain in self.gains if gain.after <= KNOWN]
        return min(known, key=lambda gain: gain.ratio) if known else None

    @property
    def sentence(self) -> str:
        """What an engineer would say."""
        if self.newly_determined:
            named = ", ".join(self.newly_determined[:NAMED])
            more = len(self.newly_determined) - NAMED
            first = f"{self.candidate} would be the first to determine {named}"
            first += f" and {more} more" if more > 0 else ""
        elif self.best is not None and self.best.ratio < 1.0 - WORTH:
            first = (
                f"{self.candidate} would tell most of {self.best.name}: its standard error would "
                f"shrink to {100.0 * self.best.ratio:.0f} %"
            )
        else:
            return f"{self.candidate} would tell next to nothing new."
        if self.d_gain < 1.0 + WORTH:
            return f"{first}."
        return f"{first}; what is known already would be known {self.d_gain:.3g} times better."


def advise(
    present: Array,
    candidates: Sequence[Candidate],
    variables: Variables,
    *,
    tolerance: float = TOLERANCE,
) -> tuple[Advice, ...]:
    """Rank candidate tests by what they would add.

    Parameters
    ----------
    present : (m, K) array
        What the tests made so far tell: derivatives of the weighted residuals over the deviation of
        an independent one; no rows if there are none.
    candidates : sequence of Candidate
        Tests to choose from.
    variables : Variables
        The unknowns; those at a bound count as known.
    tolerance : float
        As of `whitening`.

    Returns
    -------
    tuple of Advice
        Best first: most unknowns newly determined, most combinations, largest D-gain.

    Raises
    ------
    InputError
        If there is no candidate, a shape is wrong, a number is not finite, or an inflation is
        below 1.
    """
    if not candidates:
        raise InputError("There is no candidate to choose from.")
    _check("what is known at present", present, variables.count)
    for each in candidates:
        _check(each.name, each.derivatives, variables.count)
        if not 1.0 <= each.inflation < inf:
            raise InputError(f"{each.name}: {each.inflation:g} samples cannot stand for one.")
    judged = [_judge(present, each, variables, tolerance) for each in candidates]
    return tuple(sorted(judged, key=lambda each: each.rank))


def _judge(present: Array, candidate: Candidate, variables: Variables, tolerance: float) -> Advice:
    free = variables.free
    now, known_now = whitening(present, free, tolerance)
    both = np.vstack([present, candidate.rows])
    then, known_then = whitening(both, free, tolerance)
    before = np.where(known_now, np.sqrt(np.sum(now**2, axis=1)), inf)
    after = np.where(known_then, np.sqrt(np.sum(then**2, axis=1)), inf)
    names = variables.names
    # along the directions known now the candidate adds (candidate W)ᵀ(candidate W) to the identity;
    # what it says of them through directions unknown now has to be spent on those first
    hidden = _unknown_directions(present, free, tolerance)
    seen = candidate.rows @ now
    if hidden.shape[1]:
        basis = np.linalg.svd(candidate.rows @ hidden, full_matrices=False)
        spent = basis[0][:, basis[1] > tolerance * max(float(basis[1].max(initial=0.0)), 1e-300)]
        seen = seen - spent @ (spent.T @ seen)
    shrinking = np.log1p(np.linalg.svd(seen, compute_uv=False) ** 2).sum() if seen.size else 0.0
    both_known = known_now & known_then
    squares = float(np.sum(before[both_known] ** 2)), float(np.sum(after[both_known] ** 2))
    return Advice(
        candidate.name,
        tuple(
            Gain(names[k], float(before[k]), float(min(after[k], before[k])))
            for k in np.flatnonzero(free)
        ),
        tuple(names[k] for k in np.flatnonzero(free & (after <= KNOWN) & (before > KNOWN))),
        then.shape[1] - now.shape[1],
        float(np.exp(0.5 * shrinking / max(now.shape[1], 1))),
        float(np.sqrt(squares[0] / squares[1])) if squares[1] > 0.0 else 1.0,
        candidate.duration,
    )


def _unknown_directions(rows: Array, free: NDArray[np.bool_], tolerance: float) -> Array:
    """(K, k) basis of the directions of the free unknowns that rows do not determine."""
    moving = np.flatnonzero(free)
    rows = triangular_factor(rows)
    lengths = np.linalg.norm(rows[:, moving], axis=0)
    lengths = np.where(lengths > 0.0, lengths, 1.0)
    _, sizes, basis = np.linalg.svd(rows[:, moving] / lengths, full_matrices=True)
    rank = int(np.count_nonzero(sizes > tolerance * sizes.max(initial=0.0)))
    hidden = np.zeros((rows.shape[1], moving.size - rank))
    hidden[moving] = basis[rank:].T / lengths[:, None]
    return hidden


def _check(name: str, rows: Array, count: int) -> None:
    if rows.ndim != 2 or rows.shape[1] != count:
        raise InputError(f"{name}: {count} unknowns need as many columns, not {rows.shape}.")
    if not np.isfinite(rows).all():
        raise InputError(f"{name}: the derivatives must be finite.")
