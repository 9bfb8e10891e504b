"""What reaches the terminal: tables and notes, and a sign of life while a person waits."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from time import perf_counter
from typing import Protocol

from rich import box
from rich.console import Console
from rich.status import Status
from rich.table import Table

BEGUN = perf_counter()
# names of files and manoeuvres are printed as they are, whatever brackets and colons they hold
output = Console(markup=False, highlight=False, emoji=False)
side = Console(stderr=True, markup=False, highlight=False, emoji=False)
"""Standard error: what a pipe must not carry."""


def table(title: str | None, *columns: str, wrap: str = "") -> Table:
    """An empty table for 80 columns and more.

    Parameters
    ----------
    title : str or None
        A line above it.
    *columns : str
        Headers; one that begins with ``>`` is right-aligned.
    wrap : str
        The column that is broken into lines where the terminal is narrow.
    """
    made = Table(
        title=title,
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        show_edge=False,
        pad_edge=False,
        collapse_padding=True,
    )
    for column in columns:
        right, header = column.startswith(">"), column.removeprefix(">")
        made.add_column(header, justify="right" if right else "left", no_wrap=header != wrap)
    return made


def show(*tables: Table) -> None:
    """Print tables, empty lines around them."""
    for each in tables:
        output.print()
        output.print(each)
    output.print()


def say(text: str) -> None:
    """Print text, broken into lines where the terminal is narrow."""
    output.print(text)


def note(text: str) -> None:
    """Print a line, never broken, so that a path in it can be copied."""
    output.print(text, soft_wrap=True)


def say_error(error: Exception) -> None:
    """Print what went wrong as one line on standard error."""
    sentence = " ".join(str(error).split()).rstrip(".")
    side.print(f"Error: {sentence}.", soft_wrap=True)


def working(text: str) -> AbstractContextManager[Status]:
    """A spinner while something may take longer than a second; nothing in a pipe."""
    return side.status(f"{text} ...")


@contextmanager
def progress(steps: int) -> Iterator[Callable[[str], None]]:
    """A bar of so many steps; what it yields begins the next one, by its name."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (BarColumn(), MofNCompleteColumn(), TextColumn("{task.description}", markup=False))
    bar = Progress(*columns, console=side, transient=True, disable=not side.is_terminal)
    with bar:
        task = bar.add_task("", total=steps)
        begun = 0

        def begin(what: str) -> None:
            nonlocal begun
            bar.update(task, completed=begun, description=what, refresh=True)
            begun += 1

        yield begin


class Timing:
    """Wall time of the parts of a command, from the start of the program on."""

    def __init__(self) -> None:
        self._last = BEGUN
        self.parts: dict[str, float] = {}

    def ended(self, part: str) -> None:
        """A part ends now, which began where the one before ended. [s]"""
        now = perf_counter()
        self.parts[part], self._last = now - self._last, now

    def table(self) -> Table:
        """The parts, and all together."""
        made = table("Wall time", "part", ">s")
        for part, seconds in {**self.parts, "all": sum(self.parts.values())}.items():
            made.add_row(part, f"{seconds:.2f}")
        return made


class Shown(Protocol):
    """Says how far a long piece of work is."""

    def __call__(self, what: str, share: float | None = None, left: str = "") -> None:
        """Show what is done now, the share that is done if it is known, and the time left."""
        ...


@contextmanager
def long_work(text: str) -> Iterator[Shown]:
    """A bar with what is done now and the time left; nothing in a pipe."""
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn

    columns = (
        SpinnerColumn(),
        BarColumn(bar_width=20),
        TextColumn("{task.description}", markup=False),
        TextColumn("{task.fields[left]}", markup=False),
    )
    bar = Progress(*columns, console=side, transient=True, disable=not side.is_terminal)
    with bar:
        task = bar.add_task(text, total=None, left="")

        def show(what: str, share: float | None = None, left: str = "") -> None:
            total = None if share is None else 1.0
            bar.update(task, description=what, total=total, completed=share or 0.0, left=left)

        yield show


def counted(number: int, one: str, several: str) -> str:
    """A number and what it counts: ``"1 finding"``, ``"2 findings"``."""
    return f"{number} {one if number == 1 else several}"


def waiting(seconds: float | None, sort: str = "about") -> str:
    """A time left in words a person takes in at once: ``"about 12 s left"``."""
    if seconds is None:
        return ""
    if seconds < 90.0:
        return f"{sort} {max(seconds, 0.0):.0f} s left"
    return f"{sort} {seconds / 60.0:.0f} min left"
