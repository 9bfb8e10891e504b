"""Files that a command is to write: refused before anything is simulated, all of them at once."""

from __future__ import annotations

from pathlib import Path

from swashplate.tables import Form, check_place, ending


def check_outputs(*outputs: tuple[Path | None, Form | None]) -> None:
    """See to it that all files can be written, so that none is left of a command that fails.

    Parameters
    ----------
    *outputs : (path or None, Form or None)
        What was asked for, and the endings that it may have; None for any.

    Raises
    ------
    FileError
        For a wrong ending, a folder that does not exist, or a folder in the file's place.
    """
    for path, form in outputs:
        if path is None:
            continue
        if form is not None:
            ending(path, form)
        check_place(path)
