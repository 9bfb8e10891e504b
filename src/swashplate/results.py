"""Results as Python shows them: a line at the prompt, tables in a notebook, frames elsewhere.

A class that inherits `Result` has a short ``repr`` whatever arrays it holds. If it has
``tables()`` or ``table()``, a notebook shows these and `Result.summary` prints them, and its
``sentences`` after them. A ``headline`` stands at the very beginning, and then its sentences do,
too, before the tables. Only a class that can be drawn has a ``plot()``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence, Set
from dataclasses import fields, is_dataclass
from html import escape
from importlib import import_module
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar, cast, overload

from swashplate.errors import InputError
from swashplate.tables import Table, write_table

if TYPE_CHECKING:
    import numpy as np
    import polars
    from matplotlib.axes import Axes as Axes
    from matplotlib.figure import Figure as Figure
    from numpy.typing import NDArray

GivenAxes = TypeVar("GivenAxes", bound="Axes | Sequence[Axes]")
"""Matplotlib axes that a caller gives to draw in, and gets back."""

LONGEST = 320
"""Characters of a repr at most: four lines of a terminal."""
SPELT_OUT = 4
"""Items of a sequence, or numbers of an array, that are shown one by one."""


def short(value: object) -> str:
    """Short form of a result for `repr`: its fields, arrays by shape, others by name."""
    if is_dataclass(value):
        names = [field.name for field in fields(value) if field.repr]
    else:  # a model of pydantic's, or a named tuple
        kind: Any = type(value)
        shown = [name for name, field in getattr(kind, "model_fields", {}).items() if field.repr]
        names = shown or list(getattr(kind, "_fields", ()))
    text = ", ".join(f"{name}={_brief(getattr(value, name))}" for name in names)
    kind = type(value).__name__
    return f"{kind}({shorten(text, LONGEST - len(kind) - 2, placeholder=' ...')})"


def _brief(value: Any) -> str:
    """A value in a few words."""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, str | bytes | Path):
        text = repr(str(value) if isinstance(value, Path) else value)
        return text if len(text) <= 60 else f"{text[:56]}...{text[-1]}"
    if hasattr(value, "shape") and hasattr(value, "dtype"):
        if value.ndim == 1 and value.size <= SPELT_OUT:
            return f"[{', '.join(map(_brief, value.tolist()))}]"
        return f"<{' x '.join(map(str, value.shape))} {value.dtype}>"
    if type(value).__module__.partition(".")[0] == "swashplate":
        name = getattr(value, "name", None)
        return f"{type(value).__name__}({repr(name) if isinstance(name, str) else '...'})"
    if isinstance(value, Mapping):
        keys = ", ".join(map(str, value))
        return f"{{{keys if len(keys) <= 60 else f'{len(value)} entries'}}}"
    if isinstance(value, Sequence | Set):
        items = list(value)
        plain = all(isinstance(item, str | int | float) for item in items)
        if plain and len(items) <= SPELT_OUT:
            return f"[{', '.join(map(_brief, items))}]"
        return f"<{len(items)} {type(items[0]).__name__}>"
    text = object.__repr__(value) if callable(value) else repr(value)
    return text if len(text) <= 60 and not callable(value) else f"<{type(value).__name__}>"


class Named:
    """An attribute that is what ``result[name]`` gives."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, result: Any, owner: type | None = None) -> NDArray[np.float64]:
        if result is None:
            return self  # type: ignore[return-value]  # the class's own attribute
        return cast("NDArray[np.float64]", result[self._name])


class Result:
    """A result that shows itself: shortly as text, with its tables if it has some."""

    def __init_subclass__(cls, **options: Any) -> None:
        """Keep the inherited repr, in whose place a dataclass would write one of its own."""
        super().__init_subclass__(**options)
        if "__repr__" not in cls.__dict__:
            setattr(cls, "__repr__", cls.__repr__)  # noqa: B010  mypy takes it for a mistake

    def __repr__(self) -> str:
        return short(self)

    def _tables(self) -> list[Table]:
        make_tables = getattr(self, "tables", None) or getattr(self, "table", None)
        tables = make_tables() if callable(make_tables) else []
        return [tables] if isinstance(tables, Table) else list(tables)

    def _headline(self) -> str:
        """The sentence that a reader must not miss, empty if there is none."""
        return str(getattr(self, "headline", ""))

    def _sentences(self) -> list[str]:
        """Conclusions from the tables, sentence by sentence."""
        sentences = getattr(self, "sentences", ())
        return list(sentences() if callable(sentences) else sentences)

    def _repr_html_(self) -> str | None:
        headline = self._headline()
        tables = self._tables()
        html = "".join(table._repr_html_() for table in tables)
        sentences = listing(self._sentences())
        if headline:
            return f"<p><strong>{escape(headline)}</strong></p>{sentences}{html}"
        return f"{html}{sentences}" or None

    def summary(self) -> str:
        """Text: its headline or its repr, its tables in the units that people read, sentences."""
        headline = self._headline()
        tables = [str(table) for table in self._tables()]
        lines = "\n".join(f"- {sentence}" for sentence in self._sentences())
        paragraphs = [headline, lines, *tables] if headline else [repr(self), *tables, lines]
        return "\n\n".join(part for part in paragraphs if part)


class Drawn(Result):
    """A result that one function of `swashplate.report.figures` draws, also on given axes."""

    drawn_by: ClassVar[str]
    """Name of that function."""

    @overload
    def plot(self, *, ax: None = None, title: str | None = None) -> Figure: ...

    @overload
    def plot(self, *, ax: GivenAxes, title: str | None = None) -> GivenAxes: ...

    def plot(
        self, *, ax: Axes | Sequence[Axes] | None = None, title: str | None = None
    ) -> Figure | Axes | Sequence[Axes]:
        """Figure of the result, as the function `drawn_by` of `swashplate.report.figures` says.

        By default a new figure; with `ax` it is drawn there, and `ax` returned. A `title` stands in
        the place of the words that say what is shown.
        """
        draw = getattr(figures(), self.drawn_by)
        return cast("Figure", draw(self, ax=ax, title=title))


def listing(sentences: Sequence[str]) -> str:
    """HTML of a list of sentences, empty if there are none."""
    items = "".join(f"<li>{escape(sentence)}</li>" for sentence in sentences)
    return f"<ul>{items}</ul>" if items else ""


def folded(title: str, tables: Sequence[Table], sentences: Sequence[str] = ()) -> str:
    """HTML of tables and sentences that are shown when a reader opens them by their title."""
    html = "".join(table._repr_html_() for table in tables)
    return f"<details><summary>{escape(title)}</summary>{html}{listing(sentences)}</details>"


class Tabular(Result, ABC):
    """A result that is a table of columns, SI."""

    @abstractmethod
    def to_polars(self) -> polars.DataFrame:
        """The table, SI."""

    def to_pandas(self) -> Any:
        """The table of `to_polars` as a ``pandas.DataFrame``.

        Raises
        ------
        InputError
            If pandas is not installed.
        """
        return pandas_frame(self.to_polars())

    def to_xarray(self) -> Any:
        """The table of `to_polars` as an ``xarray.Dataset`` along its first column.

        Raises
        ------
        InputError
            If xarray is not installed.
        """
        along, *others = (column for column in self.to_polars().iter_columns())
        data = {other.name: (along.name, other.to_numpy()) for other in others}
        return _library("xarray").Dataset(data, {along.name: along.to_numpy()})

    def _repr_html_(self) -> str | None:
        frame = self.to_polars()
        return super()._repr_html_() or str(frame._repr_html_())

    def write(self, path: str | Path) -> None:
        """Write the table of `to_polars` as CSV or Parquet, by the path's ending.

        The file appears whole or not at all: it is written under another name and renamed.

        Raises
        ------
        FileError
            For another ending, or a folder that cannot be written.
        """
        write_table(self.to_polars(), path)


def figures() -> Any:
    """The package of figures, imported when one is drawn; by name, as it stands above results."""
    return import_module("swashplate.report.figures")


def pandas_frame(frame: polars.DataFrame) -> Any:
    """A table as a ``pandas.DataFrame``; an `InputError` if pandas is not installed."""
    return _library("pandas").DataFrame(frame.to_dict(as_series=False))


def _library(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError:
        raise InputError(
            f"{name} is not installed: install it ('pip install {name}'), or use to_polars()."
        ) from None
