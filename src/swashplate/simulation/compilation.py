"""Compiling and caching of the kernels, the functions that march arrays.

Kernels inline the components of `swashplate.physics`, which Numba's disk cache does not know: it
looks at the kernel's own file alone. Here the cache's stamp is a hash of every source file that a
kernel can inline, so a changed component is never answered by old machine code.
"""

from collections.abc import Callable
from functools import cache
from hashlib import blake2b
from pathlib import Path
from typing import Any, ParamSpec, TypeVar
from warnings import warn

from numba import config, njit
from numba.core.caching import CompileResultCacheImpl, FunctionCache

P = ParamSpec("P")
R = TypeVar("R")

PACKAGE = Path(__file__).parent.parent
KERNEL_SOURCES = ("physics", "simulation")
UNCACHED = (
    "swashplate's compiled kernels cannot be kept, so that every session compiles them anew; set "
    "NUMBA_CACHE_DIR to a folder that can be written."
)


@cache
def kernel_sources_hash() -> str:
    """Hash over names and contents of all files that hold components or kernels."""
    digest = blake2b(digest_size=16)
    for folder in KERNEL_SOURCES:
        for path in sorted((PACKAGE / folder).glob("*.py")):
            digest.update(f"{folder}/{path.name}".encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()


@cache
def _file_hash(path: str) -> str:
    return blake2b(Path(path).read_bytes(), digest_size=16).hexdigest()


def _stamp(locator: Any) -> str:
    """Hash of all components, and of the kernel's own file where that is another."""
    own = getattr(locator, "_py_file", None)  # a kernel typed in at a prompt has none
    return kernel_sources_hash() + (_file_hash(own) if own is not None else "")


def _stamped(locator: type[Any]) -> type[Any]:
    """A cache locator of Numba's whose stamp is the hash, not one file's time and size."""
    return type(f"Stamped{locator.__name__}", (locator,), {"get_source_stamp": _stamp})


class _KernelCacheImpl(CompileResultCacheImpl):
    _locator_classes = [_stamped(each) for each in CompileResultCacheImpl._locator_classes]  # noqa: RUF012


class _KernelCache(FunctionCache):
    _impl_class = _KernelCacheImpl


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function of arrays: strict arithmetic, no interpreter lock, cached on disk.

    Parameters
    ----------
    function : callable
        A march. Its components come in by inlining.

    Returns
    -------
    callable
        The compiled function, or the plain one under ``NUMBA_DISABLE_JIT=1``.

    Warns
    -----
    RuntimeWarning
        If there is no place for the cache; the function works all the same.
    """
    compiled: Any = njit(nogil=True, error_model="numpy")(function)
    if not config.DISABLE_JIT:  # type: ignore[attr-defined]
        try:
            compiled._cache = _KernelCache(function)  # type: ignore[no-untyped-call]
        except RuntimeError:  # no folder to cache in can be written
            warn(UNCACHED, RuntimeWarning, stacklevel=2)
    return compiled  # type: ignore[no-any-return]
