"""What is made once on a machine, kept on disk.

Kernels inline the equations that they call, which Numba's disk cache does not know: it looks at a
kernel's own file alone. Here the stamp is a hash of the kernel and of all that it reaches, so that
a changed equation is never answered by old machine code, and leaves all others' alone. What was not
used for long is removed.
"""

import os
import pickle
import sys
import tempfile
from collections.abc import Callable
from functools import cache, cached_property
from glob import escape
from hashlib import blake2b
from pathlib import Path
from stat import S_IWGRP, S_IWOTH
from time import time
from typing import Any, ParamSpec, TypeVar
from warnings import warn

from numba import __version__ as numba_version
from numba import config, njit
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.misc.appdirs import AppDirs

from swashplate import progress
from swashplate.equations.declaration import (
    JIT_OFF,
    closure_hash,
    compiled_functions,
    hash_of,
    is_function,
)
from swashplate.equations.language import plain

P = ParamSpec("P")
R = TypeVar("R")

UNCACHED = (
    "swashplate's compiled kernels cannot be stored, so every session compiles them again; set "
    "SWASHPLATE_CACHE_DIR to a writable folder."
)
OPEN = (
    "swashplate's compiled kernels are not read from {folder}, as {why}: what it holds is run. "
    "Remove it, or set SWASHPLATE_CACHE_DIR to a folder that only you can write to."
)
COMPILING = "Compiling equations, once on this machine"
DAY = 86400.0
"""[s]"""
MOST_BYTES = 500_000_000
"""Of all that is kept; the oldest go first."""
UNUSED = 30.0 * DAY
"""Time after which what nobody used is removed, and made again. [s]"""


# --- who can write --------------------------------------------------------------------------------


def exposed(path: str | Path) -> str | None:
    """Why others can change a file or folder, None if nobody but its user and root can.

    A folder of byte code beside the source is as trustworthy as the source, whoever owns it.
    """
    if sys.platform == "win32" or Path(path).name == "__pycache__":
        return None
    try:
        status = Path(path).stat()
    except OSError:  # not made yet
        return None
    if status.st_uid not in (0, os.geteuid()):
        return "it belongs to another user"
    if status.st_mode & S_IWOTH:
        return "every user can write to it"
    if status.st_mode & S_IWGRP and not _is_own_group(status.st_gid):
        return "its group can write to it"
    return None


@cache
def _is_own_group(number: int) -> bool:
    """Whether a group is that of one user alone, as many systems make one for each.

    Its name is then the user's and it has no other members, by which OpenSSH of Debian knows it.
    """
    if sys.platform == "win32":
        return False
    import grp
    import pwd

    try:
        group, user = grp.getgrgid(number), pwd.getpwuid(os.geteuid())
    except KeyError:
        return False
    return group.gr_name == user.pw_name and {*group.gr_mem} <= {user.pw_name}


@cache
def _warn_exposed(folder: str, why: str) -> None:
    """Say once of a folder that it is not used."""
    warn(OPEN.format(folder=folder, why=why), RuntimeWarning, stacklevel=2)


# --- kernels --------------------------------------------------------------------------------------


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
        for folder in {str(config.CACHE_DIR or self._cache_path), self._cache_path}:  # type: ignore[attr-defined]
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
        The compiled function, or the plain one under ``SWASHPLATE_COMPILE=0``.

    Warns
    -----
    RuntimeWarning
        If there is no place for the cache; the function works all the same.
    """
    compiled_functions[plain(function)] = None
    options: dict[str, Any] = {"no_cfunc_wrapper": True}
    compiled: Any = njit(nogil=True, error_model="numpy", **options)(function)
    if not JIT_OFF:
        try:
            compiled._cache = _KernelCache(function)
        except _ExposedError as error:
            _warn_exposed(*error.args)
        except RuntimeError:
            # typed into a session, it has no file to be known by; else no folder can be written
            if Path(plain(function).__code__.co_filename).is_file():
                warn(UNCACHED, RuntimeWarning, stacklevel=2)
    return compiled  # type: ignore[no-any-return]


# --- what is generated ----------------------------------------------------------------------------


@cache
def _folder(numba_cache_dir: str) -> Path | None:
    """Where what is generated is kept, None if no folder can be written."""
    if numba_cache_dir:
        folder = Path(numba_cache_dir) / "swashplate_generated"
    else:
        user = AppDirs(appname="swashplate", appauthor=False).user_cache_dir  # type: ignore[no-untyped-call]
        folder = Path(user) / "generated"
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        warn(UNCACHED, RuntimeWarning, stacklevel=3)
        return None
    for each in (folder.parent, folder) if numba_cache_dir else (folder,):
        if why := exposed(each):
            _warn_exposed(str(each), why)
            return None
    return folder


def generated_folder() -> Path | None:
    """Folder in which what is generated is kept, None if nowhere."""
    return _folder(str(config.CACHE_DIR or ""))  # type: ignore[attr-defined]


def no_cache_reason() -> str:
    """Why there is no folder for the cache, in a sentence, if `cache_folder` gives none."""
    folder = Path(str(config.CACHE_DIR or "."))  # type: ignore[attr-defined]
    why = exposed(folder) if config.CACHE_DIR else None  # type: ignore[attr-defined]
    return OPEN.format(folder=folder, why=why) if why else UNCACHED


def cache_folder() -> Path | None:
    """Folder below which all is kept, None if nowhere."""
    folder = generated_folder()
    if folder is None:
        return None
    return folder.parent if config.CACHE_DIR else folder  # type: ignore[attr-defined]


def mark_used(path: Path) -> None:
    """Note that a file is still in use."""
    if time() - path.stat().st_mtime > DAY:
        path.touch()


def written(path: Path, content: bytes) -> Path | None:
    """A file written as a whole, whoever else writes it at once; None if it cannot be written."""
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.stem, suffix=".tmp")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(content)
            Path(temporary).replace(path)
        finally:
            Path(temporary).unlink(missing_ok=True)
    except OSError:  # a full disk, or something else of that name
        return None
    _tidy(path.parent)
    return path


def _tidy(folder: Path) -> None:
    """Remove what was not used lately, and the oldest beyond `MOST_BYTES`, once a day."""
    mark = folder / "tidied"
    try:
        if mark.exists() and time() - mark.stat().st_mtime < DAY:
            return
        mark.touch()
        # Numba keeps machine code in folders next to theirs
        sibling_folders = folder.parent.glob(f"{escape(folder.name)}_*")
        for swept in [folder, folder / "__pycache__", *sibling_folders]:
            for path in [*swept.glob("*.*")]:
                if time() - path.stat().st_mtime > UNUSED:
                    path.unlink()
        files = [(path.stat().st_mtime, path) for path in folder.glob("*.kept")]
        size = 0
        for _, path in sorted(files, reverse=True):
            size += path.stat().st_size
            if size > MOST_BYTES:
                path.unlink()
    except OSError:  # another process tidies at once, or the folder is no longer ours
        return
