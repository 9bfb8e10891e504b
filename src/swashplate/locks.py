"""A folder that one process, and one thread of it, writes into at a time."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path
from threading import get_ident
from warnings import warn

from swashplate.errors import FileError
from swashplate.stopping import undone
from swashplate.tables import made_folder

NAME = ".swashplate.lock"
"""The file in the folder; it names the process that writes, and is gone when that has ended."""
_owners = dict[Path, int]()
"""Threads of this process that have locked a folder, by its path."""
POSITION = 2**30
"""Byte that is locked on Windows, where nobody else could read what stands before. [byte]"""


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other processes from writing into a folder meanwhile; it is made if there is none.

    The operating system holds the lock, so that it ends with the process however that ends: a lock
    file that a killed process has left is taken over. It holds between machines too, if their
    network file system has locks, as NFS with its lock service does. The thread that has locked a
    folder may lock it again: a command does so, and what it saves there does as well.

    Raises
    ------
    FileError
        If another process, or another thread, writes into the folder; the sentence names the
        process, its machine and since when. Also if the folder cannot be made or written to.

    Warns
    -----
    RuntimeWarning
        If the file system has no locks; then nobody is kept out.
    """
    resolved = folder.resolve()
    if _owners.get(resolved) == get_ident():
        yield
        return
    created = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    path = made_folder(folder) / NAME
    handle = _open_locked(path, folder)
    try:
        _owners[resolved] = get_ident()
        os.truncate(handle, 0)
        os.write(handle, _description().encode())
        with undone(path.unlink):
            yield
    finally:
        del _owners[resolved]
        if sys.platform == "win32":  # an open file cannot be removed there
            os.close(handle)
        with suppress(OSError):
            path.unlink()
        if sys.platform != "win32":
            os.close(handle)
        with suppress(OSError):  # the first folder that is not empty, and those above it, stay
            for parent in created:
                parent.rmdir()


def _open_locked(path: Path, folder: Path) -> int:
    """Descriptor of the lock file, locked."""
    while True:
        try:
            handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:
            raise FileError(f"{folder} cannot be locked: {error.strerror or error}.") from None
        try:
            _lock(handle)
        except BlockingIOError:
            os.close(handle)
            raise FileError(
                f"{folder} is in use: {_user_of(path)} is writing a fit into it. Wait until it "
                "ends, or name another folder (with --out)."
            ) from None
        except OSError as error:
            warn(
                f"{folder} cannot be locked ({error.strerror or error}): make sure that no other "
                "fit writes into it.",
                RuntimeWarning,
                stacklevel=4,
            )
            return handle
        # between opening and locking, the process before may have removed the file
        with suppress(OSError):
            if os.path.samestat(os.fstat(handle), path.stat()):
                return handle
        os.close(handle)


def _lock(handle: int) -> None:
    """Lock a file until it is closed; a `BlockingIOError` if another process has done so."""
    if sys.platform == "win32":
        import msvcrt

        os.lseek(handle, POSITION, os.SEEK_SET)
        try:
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        except PermissionError:
            raise BlockingIOError from None
        finally:
            os.lseek(handle, 0, os.SEEK_SET)
    else:
        import fcntl

        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _description() -> str:
    """Description of this process in a sentence of another one."""
    now = datetime.now().astimezone().isoformat(" ", "seconds")
    return f"process {os.getpid()} on {platform.node() or 'this machine'}, since {now},"


def _user_of(path: Path) -> str:
    """The process that a lock file names."""
    try:
        text = path.read_text("utf-8", "replace")[:200]
    except OSError:
        text = ""
    # it says so a moment after it has locked
    return text if text.isprintable() and text else "another process"
