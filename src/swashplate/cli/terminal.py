"""Output to the terminal: tables and notes, and a sign of life while a person waits."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any, NoReturn

import rich.table
from rich import box
from rich.console import Console
from rich.status import Status

from swashplate.errors import FileError
from swashplate.progress import Work, shown_by
from swashplate.tables import UNIT, Form, Table, check_place, ending

if TYPE_CHECKING:
    from swashplate.drive import KeyNumbers

SAVED: ContextVar[list[str]] = ContextVar("SAVED")
"""Lines on the files that a command wrote."""
RESOURCES: ContextVar[ExitStack] = ContextVar("RESOURCES")
"""Resources that are released when a command ends, such as the lock of a folder."""
BETWEEN = 2
"""Characters between two columns."""
NARROW = "\N{NO-BREAK SPACE}%"
LEAST = 9
"""Least width of the lines of a wrapped heading. [characters]"""
LONGEST = 30
"""Largest width of a name in a split table. [characters]"""
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


def _blocks(table: Table, line_width: int) -> Iterator[rich.table.Table]:
    """Lay a table out for a line width: as one block or, if it is too wide, as several.

    Numbers are never cut. Long headings are wrapped before the table is split; every block begins
    with the columns before the first column of numbers.
    """
    columns = table.columns
    all_columns = range(len(table.columns))
    headings = ["" if columns[k] is UNIT else name for k, name in enumerate(table.headings())]
    rows = [table.texts(row) for row in table.rows]
    natural_widths = _widths([headings, *rows])

    def total_width(shown_columns: Sequence[int], widths: Sequence[int]) -> int:
        gaps = BETWEEN * (len(shown_columns) - 1)
        return sum(widths[k] for k in shown_columns) + gaps

    def block(
        shown_columns: Sequence[int], fixed_widths: Sequence[int] | None = None
    ) -> rich.table.Table:
        rich_table = rich.table.Table(
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
        minimum_widths = _widths([headings, *rows])
        for k in shown_columns:
            is_number = bool(columns[k].spec)
            may_wrap = columns[k].wrap or fixed_widths is not None
            rich_table.add_column(
                headings[k],
                justify="right" if is_number else "left",
                no_wrap=is_number or not may_wrap,
                width=None if fixed_widths is None else fixed_widths[k],
                min_width=minimum_widths[k] if is_number else None,
                # a name that is too long goes on in the next line
                overflow="ellipsis" if is_number else "fold",
            )
        for row, cells in zip(table.rows, rows, strict=True):
            if row.section:
                rich_table.add_section()
            rich_table.add_row(*(cells[k] for k in shown_columns))
        return rich_table

    number_columns = [k for k in all_columns if columns[k].spec]
    fits = total_width(all_columns, natural_widths) <= line_width
    if fits or not number_columns or any(column.wrap for column in columns):
        yield block(all_columns)
        return
    for k, cell_width in enumerate(_widths(rows or [headings])):
        headings[k] = _wrapped_heading(headings[k], cell_width)
    fixed_widths = _widths([headings, *rows])
    for k in all_columns:
        if k not in number_columns:
            fixed_widths[k] = min(fixed_widths[k], LONGEST)
    leading_columns = list(all_columns[: number_columns[0]])
    block_columns = leading_columns
    for k in all_columns[number_columns[0] :]:
        extended = [*block_columns, k]
        if k + 1 in all_columns and columns[k + 1] is UNIT:
            extended.append(k + 1)
        # a unit stays in the block of its number
        is_full = columns[k] is not UNIT and total_width(extended, fixed_widths) > line_width
        if is_full and len(block_columns) > len(leading_columns):
            yield block(block_columns, fixed_widths)
            block_columns = leading_columns
        block_columns = [*block_columns, k]
    yield block(block_columns, fixed_widths)


def _wrapped_heading(heading: str, cell_width: int) -> str:
    """A heading broken into lines about as long as the column's cells; no line begins with %."""
    wrapped = fill(heading.replace(" %", NARROW), max(cell_width, LEAST))
    return wrapped.replace(NARROW, " %")


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


def show_numbers(numbers: KeyNumbers) -> None:
    """Print the numbers that matter of a machine, and what they say."""
    show(numbers.table())
    bullets(numbers.sentences)


def bullets(*groups: Iterable[str]) -> None:
    """Print sentences as a list, group after group."""
    for group in groups:
        for sentence in group:
            say(f"- {sentence}")


def say_error(error: Exception, lead: str = "Error") -> None:
    """Print what went wrong as one line on standard error."""
    sentence = " ".join(str(error).split()).rstrip(".")
    # the name of a file may hold what steers a terminal
    printable = "".join(
        character if character.isprintable() else "\N{REPLACEMENT CHARACTER}"
        for character in sentence
    )
    side.print(f"{lead}: {printable}.", soft_wrap=True)


class TerminalProgress:
    """Progress of the package's functions, as the text of a spinner or a bar."""

    def __init__(self, update: Callable[[str], object]) -> None:
        self._update = update

    def show(self, line: str) -> None:
        """Replace the text."""
        self._update(line)

    def end(self, work: Work) -> None:
        """Leave the last line as it is."""


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
    """A bar with the present step and the time left; nothing in a pipe.

    It yields a function to call with the name of the step and, if it is known, the share that is
    done. With `steps`, each call begins the next step, and the share is counted.
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

        def show(step: str, share: float | None = None) -> None:
            nonlocal steps_begun
            if steps:
                share = steps_begun / steps
                steps_begun += 1
            total = None if share is None else 1.0
            bar.update(task, description=step, total=total, completed=share or 0.0)

        with shown_by(TerminalProgress(lambda line: bar.update(task, description=line))):
            yield show


def check_free(*paths: Path, force: bool = False) -> None:
    """Refuse to replace a file, or to mix with what a folder holds, unless forced to."""
    if force:
        return
    for path in paths:
        if path.is_file() or (path.is_dir() and any(path.iterdir())):
            reason = "is not empty" if path.is_dir() else "exists already"
            raise FileError(f"{path} {reason}; choose another path, or replace it with --force.")


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


def save(path: Path | None, content: str, write: Callable[[Path], object]) -> None:
    """Write a file, if it was requested; `say_saved` names it with its content."""
    if path is not None:
        with spinner(f"Writing {path}"):
            write(path)
        SAVED.get().append(f"{content}: {path}")


def draw_figure(path: Path | None, figure: Any, *results: Any, **options: Any) -> None:
    """Save a figure, or one of `swashplate.report.figures` by its name, if it was requested."""
    if path is not None:
        with spinner(f"Drawing {path}"):
            from swashplate.report import figures

            drawing = getattr(figures, figure)(*results, **options) if results else figure
            figures.save_figure(drawing, path)
        SAVED.get().append(f"Figure: {path}")


def say_saved() -> None:
    """Name the files that were written; a command's end does it, if it was not done before."""
    for line in SAVED.get():
        note(line)
    SAVED.set([])
