"""Kernels that Numba compiles: loops of users and of the crane. Imported when one is first called.

Kernels inline the equations that they call, which Numba's disk cache does not know: it looks at a
kernel's own file alone. Here the stamp is a hash of the kernel and of all that it reaches, so that
a changed equation is never answered by old machine code, and leaves all others' alone.
"""

import pickle
from functools import cached_property
from hashlib import blake2b
from pathlib import Path
from types import FunctionType
from typing import Any
from warnings import warn

from llvmlite import ir
from numba import __version__ as numba_version
from numba import njit, types
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.extending import intrinsic, overload, typeof_impl

from swashplate import progress
from swashplate.machine.cache import COMPILING, UNCACHED, exposed, told_folder, warn_exposed
from swashplate.machine.declaration import (
    closure_hash,
    compiled_functions,
    hash_of,
    is_function,
)
from swashplate.machine.marching.stepping import call_step


class _ExposedError(Exception):
    """Others can write to the folder of a cache; it and why."""


class _Index(IndexDataCacheFile):
    """Numba's index and data files, which survive damage and workers that write at once.

    Data are named by what they are for, so that no two signatures share a file. Both kinds of file
    begin with a hash of the rest: damaged ones are not unpickled.
    """

    def save(self, key: Any, data: Any) -> None:
        overloads = self._load_index()
        digest = blake2b(self._dump(key), digest_size=6).hexdigest()  # type: ignore[no-untyped-call]
        name = f"{self._index_name.removesuffix('.nbi')}.{digest}.nbc"
        overloads[key] = name
        try:
            self._save_data(name, data)
            self._save_index(overloads)
        except OSError as error:  # a full disk, or a folder of that name
            path = error.filename2 or error.filename or self._cache_path
            warn(
                f"swashplate cannot store the compiled kernel {path}: {error.strerror or error}. "
                "It is compiled again in every session; remove what blocks this path.",
                RuntimeWarning,
                stacklevel=2,
            )

    def load(self, key: Any) -> Any:
        try:
            return super().load(key)  # type: ignore[no-untyped-call]
        except Exception:  # whatever unpickling garbage may raise
            return None

    def _load_index(self) -> dict[Any, str]:
        try:
            stamp, overloads = self._unpickled(self._index_path)
        except Exception:  # damaged, or of another version of Numba
            return {}
        return overloads if stamp == self._source_stamp else {}

    def _save_index(self, overloads: dict[Any, str]) -> None:
        self._pickle((self._source_stamp, overloads), self._index_path)

    def _save_data(self, name: str, data: Any) -> None:
        self._pickle(data, self._data_path(name))  # type: ignore[no-untyped-call]

    def _load_data(self, name: str) -> Any:
        return self._unpickled(self._data_path(name))  # type: ignore[no-untyped-call]

    def _pickle(self, content: Any, path: str) -> None:
        payload = self._dump(content)  # type: ignore[no-untyped-call]
        with self._open_for_write(path) as file:
            file.write(blake2b(payload, digest_size=16).digest() + payload)

    def _unpickled(self, path: str) -> Any:
        if Path(path).parent.name != "__pycache__" and exposed(path):
            raise ValueError(path)
        content = Path(path).read_bytes()
        if blake2b(content[16:], digest_size=16).digest() != content[:16]:
            raise ValueError(path)
        return pickle.loads(content[16:])


class _KernelCache(FunctionCache):
    """Numba's cache of a function, stamped by all that the function reaches, when first asked."""

    def __init__(self, function: Any) -> None:
        self._name, self._py_func = repr(function), function
        self._impl = self._impl_class(function)  # type: ignore[no-untyped-call]
        self._cache_path = self._impl.locator.get_cache_path()
        for folder in {told_folder() or self._cache_path, self._cache_path}:
            if why := exposed(folder):
                raise _ExposedError(folder, why)
        self._compiling = list[progress.Work]()
        self.enable()  # type: ignore[no-untyped-call]

    @cached_property
    def _cache_file(self) -> _Index:  # type: ignore[override]
        stamp = f"{closure_hash(self._py_func)} {numba_version}"
        if self._py_func.__closure__ is not None:
            stamp += f" {_cells(self._py_func)}"
        base = self._impl.filename_base
        if "locals" in base:  # one of several functions of this name, which do not displace another
            base = f"{base}.{hash_of({'': stamp})[:12]}"
        return _Index(self._cache_path, base, stamp)  # type: ignore[no-untyped-call]

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        # the stamp says what a closure holds; Numba's own key has a compiled function's number of
        # this session
        return sig, codegen.magic_tuple()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            overload = super().load_overload(sig, target_context)  # type: ignore[no-untyped-call]
        except Exception:  # whole, and yet nothing that this Numba can use
            overload = None
        if overload is None:  # what Numba does next, up to `save_overload`, takes up to 3 s
            self._compiling.append(progress.begin(COMPILING, self._title))
        return overload

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]
        finally:
            progress.end(self._compiling.pop())

    @property
    def _title(self) -> str:
        return str(self._py_func.__name__)


def _cells(function: Any) -> list[tuple[str, str]]:
    """What a function closes over, by name: functions by what they reach, others as they are.

    The hash of a closure knows each function once, but not which of several names it has.
    """
    cells = [cell.cell_contents for cell in function.__closure__]
    identities = [closure_hash(cell) if is_function(cell) else repr(cell) for cell in cells]
    return list(zip(function.__code__.co_freevars, identities, strict=True))


def dispatcher_of(kernel: Any) -> Any:
    """What Numba makes of a kernel: strict arithmetic, no interpreter lock, cached on disk.

    Warns
    -----
    RuntimeWarning
        If there is no place for the cache; the function works all the same.
    """
    function = kernel.py_func
    typeof_impl.register(type(kernel), _type_of_kernel)
    options: dict[str, Any] = {"no_cfunc_wrapper": True}
    compiled: Any = njit(nogil=True, error_model="numpy", **options)(function)
    try:
        compiled._cache = _KernelCache(function)
    except _ExposedError as error:
        warn_exposed(*error.args)
    except RuntimeError:
        # typed into a session, it has no file to be known by; else no folder can be written
        if Path(function.__code__.co_filename).is_file():
            warn(UNCACHED, RuntimeWarning, stacklevel=3)
    return compiled


# --- what kernels call ----------------------------------------------------------------------------

_inlined = dict[FunctionType, Any]()


@typeof_impl.register(FunctionType)
def _type_of_function(function: FunctionType, _: Any) -> Any:
    """Type of an equation, which is compiled into what calls it."""
    if function not in compiled_functions:
        return None
    if function not in _inlined:
        _inlined[function] = njit(forceinline=True, error_model="numpy")(function)
    return types.Dispatcher(_inlined[function])


def _type_of_kernel(kernel: Any, _: Any) -> Any:
    return types.Dispatcher(kernel.dispatcher)


def _called(typing: Any, context: Any) -> Any:
    places = {name: place for place, name in enumerate(context.fields)}

    def generate(target: Any, builder: Any, signature: Any, values: Any) -> Any:
        (value,) = values
        array = builder.extract_value(value, places["words"])
        words = target.make_array(context.types[places["words"]])(target, builder, array).data
        kind = ir.FunctionType(ir.VoidType(), [words.type])
        address = builder.extract_value(value, places["code"])
        builder.call(builder.inttoptr(address, kind.as_pointer()), [words])
        return target.get_dummy_value()

    return types.none(context), generate


_called_at_address: Any = intrinsic(_called)


# Numba compares the arguments of both to the letter, types among them
overload(call_step, inline="always")(lambda context: lambda context: _called_at_address(context))
