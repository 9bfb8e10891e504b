"""What goes wrong, said in one sentence that names what is wrong and what would be right.

All errors that a user can cause and mend are a `SwashplateError`, and with it a ``ValueError``.
Those that Python has a word for are that as well: a missing file is a ``FileNotFoundError``, a
missing key a ``KeyError``, an argument of another kind a ``TypeError``.
"""

from collections.abc import Iterable
from difflib import get_close_matches


class SwashplateError(ValueError):
    """Base of all errors that a user can cause and mend."""

    def __str__(self) -> str:
        # KeyError, a base of some, would put the sentence in quotes
        return BaseException.__str__(self)


class InputError(SwashplateError):
    """A record, maneuver, option or argument that cannot be simulated."""


class InputTypeError(InputError, TypeError):
    """An argument that is not of a kind that a function takes; also a ``TypeError``."""


class UnsoundDataError(InputError):
    """Tests whose data cannot be right, so that no fit of them could mean anything."""


class UnknownNameError(InputError, KeyError):
    """A signal, channel, run or estimate that does not exist; also a ``KeyError``."""


class ParameterError(SwashplateError):
    """A parameter that is missing, unknown or breaks a rule."""


class UnknownParameterError(ParameterError, InputError, KeyError):
    """A name that no parameter has; also a ``KeyError``."""


class DomainError(SwashplateError):
    """A simulation that left the range in which the model's equations hold."""


# OSError comes first, since only its `__new__` can make these: what unpickles errors calls it
class FileError(OSError, SwashplateError):
    """A file that cannot be read or written; also an ``OSError``."""


class MissingFileError(FileError, FileNotFoundError):
    """A file or folder that does not exist; also a ``FileNotFoundError``."""


class EquationError(SwashplateError):
    """An equation that uses what equations may not, or that cannot be differentiated."""


def meant(name: str, names: Iterable[str]) -> str:
    """A clause that asks whether the nearest of some names is meant; empty if none is near."""
    near = get_close_matches(name, list(names), 1)
    return f" (did you mean {near[0]}?)" if near else ""
