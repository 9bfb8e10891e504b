"""Kernels: loops of users and of the crane, which Numba compiles when they are first called."""

from collections.abc import Callable
from functools import cached_property, update_wrapper
from typing import Any, ParamSpec, TypeVar, cast

from swashplate.machine.declaration import JIT_OFF, compiled_functions

P = ParamSpec("P")
R = TypeVar("R")


class Kernel:
    """A function that is compiled when it is first called, see `kernel`.

    Attributes
    ----------
    py_func : callable
        The plain function.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self.py_func = function
        update_wrapper(self, function)

    @cached_property
    def dispatcher(self) -> Any:
        """The compiled function."""
        from swashplate.machine.numba_kernels import dispatcher_of

        return dispatcher_of(self)

    def __call__(self, *arguments: Any) -> Any:
        """Run it, without the interpreter's lock."""
        return self.dispatcher(*arguments)

    @property
    def stats(self) -> Any:
        """Hits and misses of its cache."""
        return self.dispatcher.stats


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function of arrays: strict arithmetic, no interpreter lock, cached on disk.

    Parameters
    ----------
    function : callable
        A function of arrays and numbers, such as a loop over samples. The equations and kernels
        that it calls are compiled with it.

    Returns
    -------
    callable
        What compiles it when it is first called; the plain function is its ``.py_func``. Under
        ``SWASHPLATE_COMPILE=0`` it is the plain function.
    """
    compiled_functions[function] = None
    return function if JIT_OFF else cast("Callable[P, R]", Kernel(function))
