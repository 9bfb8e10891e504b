"""What is made once on a machine, kept on disk, in a folder that nobody else can write to.

What was not used for long is removed.
"""

import os
import sys
import tempfile
from functools import cache
from pathlib import Path
from stat import S_IWGRP, S_IWOTH
from time import time
from warnings import warn

from swashplate.environment import told_folder

UNCACHED = (
    "swashplate's compiled code cannot be stored, so that every session compiles again; set "
    "SWASHPLATE_CACHE_DIR to a writable folder."
)
OPEN = (
    "swashplate's compiled code is not read from {folder}, as {why}: what it holds is run. "
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
def warn_exposed(folder: str, why: str) -> None:
    """Say once of a folder that it is not used."""
    warn(OPEN.format(folder=folder, why=why), RuntimeWarning, stacklevel=2)


# --- what is generated ----------------------------------------------------------------------------


def _user_cache() -> Path:
    """The user's folder for what can be made again, as systems have it."""
    home = Path.home()
    if sys.platform == "win32":
        local = Path(os.environ.get("LOCALAPPDATA", home / "AppData" / "Local"))
        return local / "swashplate" / "Cache"
    if sys.platform == "darwin":
        return home / "Library" / "Caches" / "swashplate"
    return Path(os.environ.get("XDG_CACHE_HOME", home / ".cache")) / "swashplate"


@cache
def _folder(told: str) -> Path | None:
    """Where what is generated is kept, None if no folder can be written."""
    folder = Path(told) / "swashplate_generated" if told else _user_cache() / "generated"
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        warn(UNCACHED, RuntimeWarning, stacklevel=3)
        return None
    for each in (folder.parent, folder) if told else (folder,):
        if why := exposed(each):
            warn_exposed(str(each), why)
            return None
    return folder


def generated_folder() -> Path | None:
    """Folder in which what is generated is kept, None if nowhere."""
    return _folder(told_folder())


def no_cache_reason() -> str:
    """Why there is no folder for the cache, in a sentence, if `cache_folder` gives none."""
    folder = Path(told_folder() or ".")
    why = exposed(folder) if told_folder() else None
    return OPEN.format(folder=folder, why=why) if why else UNCACHED


def cache_folder() -> Path | None:
    """Folder below which all is kept, None if nowhere."""
    folder = generated_folder()
    if folder is None:
        return None
    return folder.parent if told_folder() else folder


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
        for path in [*folder.glob("*.*")]:
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
