"""Solenoid forces at chosen currents, in place of the coefficients of a polynomial.

The coefficients Z19 to Z22 of one direction form a valley: only their sum matters. The forces that
they make at four currents within the tested range do not, and one linear map leads from the ones
to the others.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from swashplate.parameters.parameter_set import ParameterSet

Array = NDArray[np.float64]
SYMBOLS = ("Z19", "Z20", "Z21", "Z22")


@dataclass(frozen=True)
class Forces:
    """Forces at four effective currents each way, as magnitudes.

    ``"force_plus_1"`` is the force at the first of `plus`; the effective current is what is left
    of the current beyond the dead zone Z17.
    """

    plus: tuple[float, float, float, float]
    """Effective currents of the positive direction, increasing. [A]"""
    minus: tuple[float, float, float, float]
    """Of the negative direction, as magnitudes. [A]"""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the eight forces."""
        return tuple(f"force_{side}_{k}" for side in ("plus", "minus") for k in (1, 2, 3, 4))

    @property
    def columns(self) -> tuple[str, ...]:
        """The parameters that they stand for."""
        return tuple(f"{symbol}_{side}" for side in ("plus", "minus") for symbol in SYMBOLS)

    @cached_property
    def _maps(self) -> dict[str, Array]:
        """For each direction the (4, 4) map from forces to coefficients."""
        signs = {"plus": np.ones(4), "minus": np.array([1.0, -1.0, 1.0, -1.0])}
        return {
            side: np.linalg.inv(
                np.power.outer(np.array(getattr(self, side)), np.arange(1, 5)) * signs[side]
            )
            for side in ("plus", "minus")
        }

    def values(self, parameters: ParameterSet) -> dict[str, float]:
        """The forces of a parameter set, by name. [N]"""
        forces = {}
        for side, map_ in self._maps.items():
            coefficients = [parameters.numbers[f"{symbol}_{side}"] for symbol in SYMBOLS]
            for k, force in enumerate(np.linalg.solve(map_, coefficients), start=1):
                forces[f"force_{side}_{k}"] = float(force)
        return forces

    def coefficients(
        self, values: Mapping[str, float], parameters: ParameterSet
    ) -> dict[str, float]:
        """Coefficients for some forces; those not named are as in the parameter set. [N/Aᵏ]"""
        forces = {**self.values(parameters), **{k: v for k, v in values.items() if k in self.names}}
        made = {}
        for side, map_ in self._maps.items():
            of_side = np.array([forces[f"force_{side}_{k}"] for k in (1, 2, 3, 4)])
            for symbol, coefficient in zip(SYMBOLS, map_ @ of_side, strict=True):
                made[f"{symbol}_{side}"] = float(coefficient)
        return made

    def slopes(self, name: str) -> dict[str, float]:
        """Derivatives of the coefficients by one force. [1/Aᵏ]"""
        _, side, number = name.split("_")
        column = self._maps[side][:, int(number) - 1]
        return {
            f"{symbol}_{side}": float(slope) for symbol, slope in zip(SYMBOLS, column, strict=True)
        }
