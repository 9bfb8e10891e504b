"""How text files are written, for the cases that the reader cannot tell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from swashplate.errors import InputError

_NAMED = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " ", "spaces": " ", "bar": "|"}


@dataclass(frozen=True)
class TextOptions:
    """Layout of a text log; what is None is told from the file. Other formats take no notice.

    Parameters
    ----------
    delimiter : str, optional
        One character, or ``"comma"``, ``"semicolon"``, ``"tab"``, ``"bar"``, ``"space"`` (any
        number of spaces and tabs), or ``"none"`` for a single column.
    decimal : {".", ","}, optional
        Decimal sign.
    comment : str, optional
        What lines begin with that are skipped; ``""`` if there are none. Told from the file, it
        is any of ``#``, ``%`` and ``//``.
    header_row : int, optional
        Line of the column names, the first is 1; 0 if there is none, the columns are then called
        ``column 1``, ``column 2`` and so on. Data begin below.
    encoding : str, optional
        Such as ``"latin-1"`` or ``"utf-16"``.

    Raises
    ------
    InputError
        If one of them makes no sense.
    """

    delimiter: str | None = None
    decimal: Literal[".", ","] | None = None
    comment: str | None = None
    header_row: int | None = None
    encoding: str | None = None

    # pydantic, where this is a part of a larger schema: a misspelt key is refused
    __pydantic_config__: ClassVar[Any] = {"extra": "forbid"}

    def __post_init__(self) -> None:
        """Check them."""
        delimiter = self.delimiter
        if delimiter is not None and delimiter != "none" and delimiter not in _NAMED:
            if len(delimiter) != 1 or not delimiter.isascii() or delimiter in '\r\n"\0':
                raise InputError(
                    f"delimiter must be one character, 'tab', 'space' or 'none', not {delimiter!r}."
                )
            if delimiter.isalnum() or delimiter in "+-.":
                raise InputError(f"delimiter {delimiter!r} is a part of numbers; name another.")
        if self.decimal not in (None, ".", ","):
            raise InputError(f"decimal must be '.' or ',', not {self.decimal!r}.")
        if self.header_row is not None and self.header_row < 0:
            raise InputError(
                f"header_row must be the line of the header, or 0, not {self.header_row!r}."
            )
        if self.encoding is not None:
            try:
                "".encode(self.encoding)  # zlib and the like are codecs, too, but not of text
            except (LookupError, UnicodeError, ValueError):
                raise InputError(
                    f"encoding {self.encoding!r} is unknown; take 'utf-8', 'latin-1' or 'utf-16'."
                ) from None

    @property
    def delimiters(self) -> tuple[str | None, ...]:
        """Delimiters that may be: the one given, or all that are looked for; None is no one."""
        if self.delimiter == "none":
            return (None,)
        if self.delimiter is not None:
            return (_NAMED.get(self.delimiter, self.delimiter),)
        return (",", ";", "\t", " ", "|", None)
