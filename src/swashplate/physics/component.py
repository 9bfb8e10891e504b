"""How a component is compiled: inlined into whatever marches it, strict IEEE arithmetic.

Strict arithmetic (no fast-math, no fused multiply-add) is what makes the march, the stepper, the
sensitivities and the side-by-side march agree to the last bit: each of them inlines the same
functions and nothing lets the compiler reorder them. Divisions by zero give infinities as in
NumPy, not exceptions, because an exception test in the inner loop would stop vectorisation; the
callers check the domain instead.
"""

from collections.abc import Callable
from typing import ParamSpec, TypeVar

from numba import njit

P = ParamSpec("P")
R = TypeVar("R")


def component(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a scalar function of floats so that its callers inline it.

    Parameters
    ----------
    function : callable
        Pure function of floats that calls nothing but `math` and other components.

    Returns
    -------
    callable
        The compiled function; the plain one stays available as ``.py_func``.
    """
    return njit(forceinline=True, error_model="numpy")(function)


def uncompiled(function: Callable[P, R]) -> Callable[P, R]:
    """The plain Python form of a component, for one call where compiling would cost more."""
    return getattr(function, "py_func", function)
