"""What the statistics need to know of a fit's unknowns: names, values, scales, bounds reached."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Variables:
    """The unknowns as the solver moves them: ln(value) of a logarithmic one, else value/scale.

    A change of 0.01 in the solver's vector is one per cent: of the value of a logarithmic unknown,
    of the scale (its nominal value, as a rule) of any other. Make it with `of`, which checks.
    """

    names: tuple[str, ...]
    values: Array
    """(K,) at the optimum, in their own units."""
    scales: Array
    """(K,) what one unit of the vector means, in the same units; not used of logarithmic ones."""
    logarithmic: NDArray[np.bool_]
    """(K,)"""
    at_bound: NDArray[np.int8]
    """(K,) -1 at the lower bound, 1 at the upper, 0 between."""

    @classmethod
    def of(
        cls,
        names: Sequence[str],
        values: ArrayLike,
        *,
        scales: ArrayLike | None = None,
        logarithmic: ArrayLike | None = None,
        at_bound: ArrayLike | None = None,
    ) -> Variables:
        """Variables from what is known of them.

        Parameters
        ----------
        names : sequence of str
            K names, all different.
        values, scales : (K,) array_like
            Values, and what counts as 100 %; by default each value's size, 1 for a value of 0.
        logarithmic : (K,) array_like of bool, optional
            Which are moved by their logarithms; none by default.
        at_bound : (K,) array_like of int, optional
            -1, 0 or 1 as in `at_bound`; none at a bound by default.

        Raises
        ------
        InputError
            If lengths differ, a name appears twice, a number is not finite, a scale is not
            positive, or a logarithmic value is not.
        """
        number = np.asarray(values, dtype=np.float64)
        count = len(names)
        if count == 0:
            raise InputError("A fit needs at least one unknown.")
        if len(set(names)) < count:
            twice = next(name for name in names if list(names).count(name) > 1)
            raise InputError(f"The unknown {twice} appears twice; name each once.")
        size = (
            np.where(number == 0.0, 1.0, np.abs(number))
            if scales is None
            else np.asarray(scales, dtype=np.float64)
        )
        log = np.zeros(count, bool) if logarithmic is None else np.asarray(logarithmic, bool)
        bound = np.zeros(count, np.int8) if at_bound is None else np.asarray(at_bound, np.int8)
        for what, array in (
            ("values", number),
            ("scales", size),
            ("logarithmic", log),
            ("at_bound", bound),
        ):
            if array.shape != (count,):
                raise InputError(f"{count} unknowns need as many {what}, not {array.shape}.")
        for name, value, scale, by_log in zip(names, number, size, log, strict=True):
            if not np.isfinite(value) or not (np.isfinite(scale) and scale > 0.0):
                raise InputError(
                    f"{name} = {value:g} with the scale {scale:g}: both must be finite and the "
                    "scale positive."
                )
            if by_log and value <= 0.0:
                raise InputError(f"{name} = {value:g} has no logarithm; it must be positive.")
        return cls(tuple(names), number, size, log, bound)

    @property
    def count(self) -> int:
        """K."""
        return len(self.names)

    @property
    def free(self) -> NDArray[np.bool_]:
        """(K,) unknowns that are not at a bound."""
        free: NDArray[np.bool_] = self.at_bound == 0
        return free

    @property
    def vector(self) -> Array:
        """(K,) the solver's numbers."""
        return self.to_vector(self.values)

    @property
    def slopes(self) -> Array:
        """(K,) derivative of each value by its number in the vector."""
        return np.where(self.logarithmic, self.values, self.scales)

    def to_values(self, vector: Array) -> Array:
        """(..., K) values of vectors; a logarithm beyond any float's becomes inf or 0."""
        with np.errstate(over="ignore"):
            return np.where(
                self.logarithmic,
                np.exp(np.where(self.logarithmic, vector, 0.0)),
                np.where(self.logarithmic, 0.0, vector) * self.scales,
            )

    def to_vector(self, values: Array) -> Array:
        """(..., K) vectors of values, positive where logarithmic."""
        logarithms = np.log(np.where(self.logarithmic, values, 1.0))
        return np.where(self.logarithmic, logarithms, values / self.scales)

    def index(self, name: str) -> int:
        """Place of an unknown.

        Raises
        ------
        InputError
            If there is none of that name.
        """
        if name not in self.names:
            raise InputError(f"There is no unknown {name}; there are {', '.join(self.names)}.")
        return self.names.index(name)
