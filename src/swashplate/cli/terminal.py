"""What reaches the terminal: tables and notes, and a sign of life while a person waits."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from pathlib import Path
from textwrap import fill
from typing import Any, NoReturn

import rich.table
from rich import box
from rich.console import Console
from rich.status import Status

from swashplate.errors import FileError
from swashplate.progress import Work, shown_by
from swashplate.tables import UNIT, Form, Table, check_place, ending

SAVED: ContextVar[list[str]] = ContextVar("SAVED")
"""Lines on the files that a command wrote."""
RESOURCES: ContextVar[ExitStack] = ContextVar("RESOURCES")
"""What is released when a command ends, such as the lock of a folder."""
BETWEEN = 2
"""Characters between two columns."""
NARROW = "\N{NO-BREAK SPACE}%"
LEAST, LONGEST = 9, 30
"""Characters of a head that is broken, and of a name beside too many numbers."""
CLOSED_PIPE = 141
"""Exit code if whoever reads the output has closed it, as a shell reports a SIGPIPE: 128 + 13."""


class Stream(io.TextIOWrapper):
    """Standard output or error that ends the process quietly once nobody reads it any more.

    Python ignores SIGPIPE, which would end another program here, so that a worker or a cluster that
    goes away is an exception and not the end of this process: it leaves with the exit code that a
    shell reports for the signal. What takes the exception first otherwise, Typer or Rich, leaves
    with 1, which is a verdict here.
    """

    def write(self, text: str, /) -> int:
        """Write text."""
        try:
            return super().write(text)
        except BrokenPipeError:
            end_quietly()

    def flush(self) -> None:
        """Write what is buffered."""
        try:
            super().flush()
        except BrokenPipeError:
            end_quietly()

    @classmethod
    def around(cls, stream: io.TextIOWrapper, errors: str | None) -> Stream:
        """A stream that writes to where another one does."""
        stream.flush()
        return cls(
            stream.buffer,
            encoding=stream.encoding,
            errors=errors,
            line_buffering=stream.line_buffering,
            write_through=stream.write_through,
        )


def end_quietly() -> NoReturn:
    """End as a program that SIGPIPE ended, seen from a shell."""
    close_output()
    raise SystemExit(CLOSED_PIPE)


def close_output() -> None:
    """Let what is still in the buffers of standard output and error go nowhere."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, Stream):
            os.dup2(nowhere, stream.fileno())


# names of files and maneuvers are printed as they are, whatever brackets and colons they hold
output = Console(markup=False, highlight=False, emoji=False)
side = Console(stderr=True, markup=False, highlight=False, emoji=False)
"""Standard error: what a pipe must not carry."""


def _widths(rows: Sequence[Sequence[str]]) -> list[int]:
    """Letters of the longest line of each column."""
    widths = [0] * len(rows[0])
    for row in rows:
        for index, cell in enumerate(row):
            longest = max(len(line) for line in cell.split("\n"))
            widths[index] = max(widths[index], longest)
    return widths


def _blocks(table: Table, line: int) -> Iterator[rich.table.Table]:
    """A table for lines of a length, in one block or, of too many numbers, in several.

    Numbers are never cut. Heads are broken first; every block begins with the columns before the
    first number.
    """
    columns = table.columns
    every = range(len(table.columns))
    heads = ["" if columns[k] is UNIT else head for k, head in enumerate(table.heads())]
    rows = [table.texts(row) for row in table.rows]
    unbroken = _widths([heads, *rows])
    broken = list[int]()

    def length(columns: Sequence[int]) -> int:
        return sum((broken or unbroken)[k] for k in columns) + BETWEEN * (len(columns) - 1)

    def block(columns_shown: Sequence[int]) -> rich.table.Table:
        shown = rich.table.Table(
            title=table.title or None,
            title_justify="left",
            title_style="bold",
            caption=table.caption or None,
            caption_justify="left",
            box=box.SIMPLE_HEAD,
            show_edge=False,
            pad_edge=False,
            collapse_padding=True,
        )
        least = _widths([heads, *rows])
        for k in columns_shown:
            shown.add_column(
                heads[k],
                justify="right" if columns[k].spec else "left",
                no_wrap=bool(columns[k].spec) or not (columns[k].wrap or broken),
                width=broken[k] if broken else None,
                min_width=least[k] if columns[k].spec else None,
                # a name that is too long goes on in the next line
                overflow="ellipsis" if columns[k].spec else "fold",
            )
        for row, cells in zip(table.rows, rows, strict=True):
            if row.section:
                shown.add_section()
            shown.add_row(*(cells[k] for k in columns_shown))
        return shown

    numbers = [k for k in every if columns[k].spec]
    if length(every) <= line or not numbers or any(column.wrap for column in columns):
        yield block(every)
        return
    for k, cells in enumerate(_widths(rows or [heads])):
        words = fill(heads[k].replace(" %", NARROW), max(cells, LEAST))
        heads[k] = words.replace(NARROW, " %")
    wide = enumerate(_widths([heads, *rows]))
    broken = [column if k in numbers else min(column, LONGEST) for k, column in wide]
    lead = list(every[: numbers[0]])
    columns_of_block = lead
    for k in every[numbers[0] :]:
        unit = [k + 1] if k + 1 in every and columns[k + 1] is UNIT else []
        full = columns[k] is not UNIT and length([*columns_of_block, k, *unit]) > line
        if full and len(columns_of_block) > len(lead):
            yield block(columns_of_block)
            columns_of_block = lead
        columns_of_block = [*columns_of_block, k]
    yield block(columns_of_block)


def show(*tables: Table) -> None:
    """Print tables, empty lines around them."""
    for table in tables:
        for block in _blocks(table.of("t"), output.width):
            output.print()
            output.print(block)
    output.print()


def say(text: str) -> None:
    """Print text, broken into lines if the terminal is narrow."""
    output.print(text)


def note(text: str) -> None:
    """Print a line, never broken, so that a path in it can be copied."""
    output.print(text, soft_wrap=True)


def bullets(*groups: Iterable[str]) -> None:
    """Print sentences as a list, group after group."""
    for group in groups:
        for sentence in group:
            say(f"- {sentence}")


def say_error(error: Exception, lead: str = "Error") -> None:
    """Print what went wrong as one line on standard error."""
    sentence = " ".join(str(error).split()).rstrip(".")
    # the name of a file may hold what steers a terminal
    shown = "".join(
        character if character.isprintable() else "\N{REPLACEMENT CHARACTER}"
        for character in sentence
    )
    side.print(f"{lead}: {shown}.", soft_wrap=True)


class TerminalProgress:
    """Progress of the package's functions, in the words of a spinner or a bar."""

    def __init__(self, update: Callable[[str], object]) -> None:
        self._update = update

    def show(self, line: str) -> None:
        """Replace the words."""
        self._update(line)

    def end(self, work: Work) -> None:
        """Leave the last line where it is."""


@contextmanager
def spinner(text: str) -> Iterator[Status]:
    """A spinner while something may take longer than a second; nothing in a pipe.

    Not inside another one, nor inside `long_work`: rich before 14.1 refuses a second.
    """
    with (
        side.status(f"{text} ...") as status,
        shown_by(TerminalProgress(lambda line: status.update(f"{line} ..."))),
    ):
        yield status


@contextmanager
def long_work(text: str, steps: int = 0) -> Iterator[Callable[..., None]]:
    """A bar with what is done now and the time left; nothing in a pipe.

    What it gives is called with words and, if it is known, the share that is done. With `steps`,
    each call begins the next step, and the share is counted.
    """
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeRemainingColumn

    with Progress(
        SpinnerColumn(),
        BarColumn(bar_width=12),
        TextColumn("{task.description}", markup=False),
        TimeRemainingColumn(),
        console=side,
        transient=True,
        disable=not side.is_terminal,
    ) as bar:
        task = bar.add_task(text, total=None)
        steps_begun = 0

        def show(what: str, share: float | None = None) -> None:
            nonlocal steps_begun
            if steps:
                share = steps_begun / steps
                steps_begun += 1
            total = None if share is None else 1.0
            bar.update(task, description=what, total=total, completed=share or 0.0)

        with shown_by(TerminalProgress(lambda line: bar.update(task, description=line))):
            yield show


def check_free(*paths: Path, force: bool = False) -> None:
    """Refuse to replace a file, or to mix with what a folder holds, unless forced to."""
    if force:
        return
    for path in paths:
        if path.is_file() or (path.is_dir() and any(path.iterdir())):
            what = "is not empty" if path.is_dir() else "exists already"
            raise FileError(f"{path} {what}; choose another path, or replace it with --force.")


def lock(folder: Path) -> None:
    """Keep other processes from writing into a folder until the command ends; see `locked`."""
    from swashplate.locks import locked

    RESOURCES.get().enter_context(locked(folder))


def check_writable(path: Path | None, form: Form, *, force: bool) -> None:
    """Refuse a file that cannot or must not be written, before anything is computed."""
    if path is not None:
        ending(path, form)
        check_place(path)
        check_free(path, force=force)


def save(path: Path | None, what: str, write: Callable[[Path], object]) -> None:
    """Write a file, if it was asked for; `say_saved` names it."""
    if path is not None:
        with spinner(f"Writing {path}"):
            write(path)
        SAVED.get().append(f"{what}: {path}")


def draw_figure(path: Path | None, figure: Any, *shown: Any, **options: Any) -> None:
    """Save a figure, or one of `swashplate.report.figures` by its name, if it was asked for."""
    if path is not None:
        with spinner(f"Drawing {path}"):
            from swashplate.report import figures

            drawing = getattr(figures, figure)(*shown, **options) if shown else figure
            figures.save_figure(drawing, path)
        SAVED.get().append(f"Figure: {path}")


def say_saved() -> None:
    """Name the files that were written; a command's end does it, if it was not done before."""
    for line in SAVED.get():
        note(line)
    SAVED.set([])
