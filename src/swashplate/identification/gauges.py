"""Gauge freedoms of the drive: combinations of parameters that no speed measurement can tell."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import exp

import numpy as np
from numpy.typing import NDArray

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
