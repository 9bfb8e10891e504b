"""What equations need beyond arithmetic: tables, roots and loops."""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.equation import inlined
from swashplate.equations.terms import INTERPOLATE, REPEATED, ROOT

S = TypeVar("S")

STEPS = 128
"""Most steps of the search for a root; some 10 are usual."""
PRECISION = 4.4e-16
TINY = 1e-300


@inlined
def root(residual: Callable[..., float], low: float, high: float, *arguments: Any) -> float:
    """Where a residual is zero within a bracket.

    Parameters
    ----------
    residual : equation
        Of the unknown and the arguments; of different signs at both ends.
    low, high : float
        Ends of the bracket.
    *arguments
        What else the residual depends on.

    Returns
    -------
    float
        The root, to the last bits. Where the residual has one sign in all of the bracket, the end
        at which it is smaller.

    Notes
    -----
    Inverse quadratic interpolation where it is safe, bisection elsewhere (Chandrupatla 1997). By
    the implicit function theorem the derivatives are those of the residual by its arguments over
    that by the unknown, with the other sign; at an end of the bracket they are those of the end,
    and where the residual is flat they count as zero.
    """
    x_1, x_2 = high, low
    f_1, f_2 = residual(high, *arguments), residual(low, *arguments)
    if f_2 == 0.0:
        return low
    if f_1 == 0.0:
        return high
    if (f_1 > 0.0) == (f_2 > 0.0):
        return low if abs(f_2) <= abs(f_1) else high
    t = 0.5
    best = low
    for _ in range(STEPS):
        x = x_1 + t * (x_2 - x_1)
        f = residual(x, *arguments)
        if (f > 0.0) == (f_1 > 0.0):
            x_3, f_3 = x_1, f_1
        else:
            x_3, f_3 = x_2, f_2
            x_2, f_2 = x_1, f_1
        x_1, f_1 = x, f
        best, smallest = (x_1, f_1) if abs(f_1) < abs(f_2) else (x_2, f_2)
        reach = (PRECISION * abs(best) + TINY) / abs(x_2 - x_1)
        if reach > 0.5 or smallest == 0.0:
            break
        xi = (x_1 - x_2) / (x_3 - x_2)
        phi = (f_1 - f_2) / (f_3 - f_2)
        t = 0.5
        if phi * phi < xi and (1.0 - phi) * (1.0 - phi) < 1.0 - xi:
            t = f_1 / (f_2 - f_1) * (f_3 / (f_2 - f_3))
            t += (x_3 - x_1) / (x_2 - x_1) * (f_1 / (f_3 - f_1)) * (f_2 / (f_3 - f_2))
        t = min(max(t, reach), 1.0 - reach)
    return best


@inlined
def located(
    x: float, knots: tuple[float, ...], values: tuple[float, ...]
) -> tuple[float, float, int, float]:
    """Value of a table, its slope, and where x lies: after which knot, and how far to the next."""
    at = 0
    for i in range(1, len(knots) - 1):
        if x >= knots[i]:
            at = i
    wide = knots[at + 1] - knots[at]
    rise = values[at + 1] - values[at]
    share = min(max((x - knots[at]) / wide, 0.0), 1.0)
    inside = knots[0] <= x < knots[len(knots) - 1]
    return values[at] + share * rise, rise / wide if inside else 0.0, at, share


@inlined
def hat(at: int, share: float, i: int) -> float:
    """Weight of the value at knot i where x lies `share` of the way from knot `at` to the next."""
    if i == at:
        return 1.0 - share
    return share if i == at + 1 else 0.0


@inlined
def interpolate(x: float, knots: tuple[float, ...], values: tuple[float, ...]) -> float:
    """Piecewise linear interpolation in a table; beyond its ends the last values hold.

    Parameters
    ----------
    x : float
        Where.
    knots, values : tuple of float
        The table, knots ascending. Both may be parameters: there are derivatives by all of them.

    Returns
    -------
    float
        The value. At a knot the derivative by x is the slope to the right of it.
    """
    value, _, _, _ = located(x, knots, values)
    return value


@inlined
def repeated(step: Callable[..., S], count: float, state: S, *arguments: Any) -> S:
    """State after a step has been done several times.

    Parameters
    ----------
    step : equation
        Of the state, the number of the repetition, from 0.0, and the arguments; returns the next
        state.
    count : float
        How often, 0 or more.
    state : named tuple of floats
        Where it begins.
    *arguments
        What else the step depends on.

    Notes
    -----
    For sub-steps of a march: how many there are is known only when it runs, and the code does not
    grow with them. The derivatives are those of the loop, carried along with the state.
    """
    for number in range(int(count)):
        state = step(state, float(number), *arguments)
    return state


@inlined
def blank(size: int) -> NDArray[np.float64]:
    """Derivatives that are carried along, all zero."""
    return np.zeros(size)


ROOT.append(root)
INTERPOLATE.append(interpolate)
REPEATED.append(repeated)
