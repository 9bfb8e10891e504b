"""How two formulas are compared: at points drawn at random, always the same ones."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
import pytest
import sympy as sp

POINTS = 6
DIGITS = 40
USUAL = (0.2, 1.4)

Ranges = Mapping[sp.Symbol, tuple[float, float]]


class Gap(NamedTuple):
    """Relative difference between two formulas over the points."""

    smallest: float
    largest: float


def drawn(
    symbols: list[sp.Symbol], ranges: Ranges, rng: np.random.Generator
) -> dict[sp.Symbol, sp.Rational]:
    """One point: a rational number with three decimals for each symbol."""
    return {
        each: sp.Rational(round(1000 * rng.uniform(*ranges.get(each, USUAL))), 1000)
        for each in symbols
    }


def gap_of(left: sp.Expr, right: sp.Expr, ranges: Ranges | None = None) -> Gap:
    left, right = sp.sympify(left), sp.sympify(right)
    rng = np.random.default_rng(2001)
    symbols = sorted(left.free_symbols | right.free_symbols, key=str)
    gaps = []
    for _ in range(POINTS):
        point = drawn(symbols, ranges or {}, rng)
        one, other = (sp.N(each.subs(point), DIGITS) for each in (left, right))
        largest = max(abs(one), abs(other))
        gaps.append(float(abs(one - other) / largest) if largest else 0.0)
    return Gap(min(gaps), max(gaps))


@pytest.fixture(scope="session")
def gap() -> Callable[..., Gap]:
    """Relative difference of two SymPy expressions, in 40 digits, at six points drawn at random.

    Symbols lie between 0.2 and 1.4 unless a range is given. An identity leaves a gap below 1e-30;
    a false one, a gap that nobody takes for rounding.
    """
    return gap_of


@pytest.fixture
def points() -> Callable[..., list[tuple[float, ...]]]:
    """Twenty points drawn evenly from the ranges that are given, as arguments of a component."""
    rng = np.random.default_rng(2001)

    def draw(*ranges: tuple[float, float]) -> list[tuple[float, ...]]:
        return [tuple(float(rng.uniform(*each)) for each in ranges) for _ in range(20)]

    return draw
