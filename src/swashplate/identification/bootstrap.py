"""Bootstrap: what would have been estimated from other noise of the same kind."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError
from swashplate.identification.resampling import Resampling
from swashplate.identification.unknowns import Unknowns

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Bootstrap:
    """Estimates from resampled noise."""

    variables: Unknowns
    vectors: Array
    """(draws, K) solver's vectors; held ones stay."""
    determined: NDArray[np.bool_]
    """(K,)"""
    failed: int
    """Refits that did not end."""
    blocks: tuple[float, ...]
    """Length of each run's blocks. [s]"""
    seed: int

    @property
    def values(self) -> Array:
        """(draws, K) in their own units."""
        return self.variables.to_values(self.vectors)

    @property
    def covariance(self) -> Array:
        """(K, K) of the solver's vector."""
        return np.cov(self.vectors, rowvar=False).reshape(2 * (self.variables.count,))

    def intervals(self, level: float = 0.95) -> tuple[tuple[float, float] | None, ...]:
        """Percentile intervals in own units; None for what is held or undetermined.

        Raises
        ------
        InputError
            If the level is not between 0 and 1, or too few draws reach its ends.
        """
        if not 0.0 < level < 1.0:
            raise InputError(f"The level {level:g} of an interval must lie between 0 and 1.")
        outside = 0.5 * (1.0 - level) * self.vectors.shape[0]
        if outside < 1.0:
            raise InputError(
                f"{self.vectors.shape[0]} draws do not reach the ends of a {100.0 * level:g} % "
                f"interval; take {int(np.ceil(2.0 / (1.0 - level)))} or more."
            )
        ends = np.quantile(self.values, [0.5 - 0.5 * level, 0.5 + 0.5 * level], axis=0)
        return tuple(
            (float(low), float(high)) if known else None
            for low, high, known in zip(*ends, self.determined, strict=True)
        )

    def sentences(self) -> tuple[str, ...]:
        """How it was done, and what failed."""
        draws = self.vectors.shape[0]
        shortest, longest = min(self.blocks), max(self.blocks)
        length = f"{longest:.2g} s" if shortest == longest else f"{shortest:.2g} to {longest:.2g} s"
        said = [f"{draws} draws of blocks of {length} of the innovations, seed {self.seed}."]
        if self.failed:
            said.append(
                f"{self.failed} of {draws + self.failed} refits did not end and are left out: the "
                "intervals are too narrow if those would have gone far."
            )
        return tuple(said)


def refit_bootstrap(
    resampling: Resampling,
    refit: Callable[[int], Array | None],
    draws: int = 1000,
    *,
    mapped: Callable[[Callable[[int], Array | None], Sequence[int]], Iterable[Array | None]] = map,
) -> Bootstrap:
    """Bootstrap in which each draw is fitted anew.

    Parameters
    ----------
    resampling : Resampling
        Of the fit's residuals.
    refit : callable
        From a draw's number to the (K,) vector fitted to ``resampling.differences(number)``, None
        if it did not end.
    draws : int
        How many, at least 2.
    mapped : callable
        Applies `refit` to all numbers, in order: `map`, or that of a pool of processes.

    Raises
    ------
    InputError
        If there are fewer than two draws, or fewer than two refits ended.
    """
    if draws < 2:
        raise InputError(f"{draws} draws do not make a distribution; take 1000.")
    found = list(mapped(refit, range(draws)))
    ended = [vector for vector in found if vector is not None]
    if len(ended) < 2:
        raise InputError(f"{len(ended)} of {draws} refits ended; there is nothing to compare.")
    fit = resampling.fit
    return Bootstrap(
        fit.variables,
        np.array(ended),
        fit.determined,
        draws - len(ended),
        resampling.blocks,
        resampling.seed,
    )
