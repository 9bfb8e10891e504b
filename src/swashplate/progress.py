"""Progress of what takes long: in the log, and as a line to a person who waits.

Work is announced with `working`. The logger ``"swashplate"`` gets its beginning and its end at
level INFO, details at DEBUG; as a library's logger it prints nothing by itself. To a person who
waits, the present state is shown as a line: in a notebook, and at a prompt or in a script whose
standard error is a terminal, where it is wiped out at the end. A script whose output goes elsewhere
shows nothing, nor does one that has the log. The command line shows it by its own means, see
`shown_by`.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from html import escape
from importlib import import_module
from shutil import get_terminal_size
from threading import RLock
from time import perf_counter
from typing import Any, Protocol, TypeVar

T = TypeVar("T")

LOGGER = logging.getLogger("swashplate")
OFTEN = 0.1
"""Least time between two details that are shown: a search has up to a thousand a second. [s]"""

enabled = True
"""Whether a line is shown; set it to False if the output is published."""


class Display(Protocol):
    """A display of lines of progress."""

    def show(self, line: str) -> None:
        """Show a line in the place of the one before."""

    def end(self, work: Work) -> None:
        """Show that the whole work is at its end."""


class Work:
    """Work under way, as `working` gives it."""

    def __init__(self, activity: str, detail: str = "") -> None:
        self.activity = activity
        self.detail = detail
        self.started = perf_counter()

    def at(self, detail: str) -> None:
        """Say how far it is."""
        self.detail = detail
        LOGGER.debug("%s: %s", self.activity, detail)
        _refresh(OFTEN)

    @property
    def line(self) -> str:
        """The work and how far it is."""
        return f"{self.activity}: {self.detail}" if self.detail else self.activity

    @property
    def seconds(self) -> float:
        """Time since it began. [s]"""
        return perf_counter() - self.started


class _State:
    """Work under way, the outermost first, and what shows it; threads share it."""

    def __init__(self) -> None:
        self.lock = RLock()
        self.works = list[Work]()
        self.displays = list[Display]()
        """Of `shown_by`, the innermost last."""
        self.display: Display | None = None
        """What shows the present work."""
        self.shown = 0.0
        """When a line was last shown. [s]"""


_state = _State()


@contextmanager
def working(activity: str) -> Iterator[Work]:
    """Announce work that may take long: log its beginning and end, show it to who waits.

    Parameters
    ----------
    activity : str
        Such as ``"Fitting hoist to 10 runs"``.
    """
    work = begin(activity)
    try:
        yield work
    finally:
        end(work)


def counted(items: Iterable[T], total: int, item_name: str, activity: str) -> Iterator[T]:
    """Iterate over items, and announce each one that is done: ``activity: 3 of 40 seaways``.

    Parameters
    ----------
    items : iterable
        Such as what an executor's ``run`` yields.
    total : int
        How many there will be.
    item_name : str
        In the plural.
    activity : str
        As of `working`.
    """
    with working(activity) as work:
        for done, item in enumerate(items, 1):
            yield item
            work.at(f"{done} of {total} {item_name}")


def begin(activity: str, detail: str = "") -> Work:
    """Begin work whose end is not in the same function; `end` must follow."""
    work = Work(activity, detail)
    LOGGER.info("%s", work.line)
    with _state.lock:
        if not _state.works:
            _state.display = _state.displays[-1] if _state.displays else _usual_display()
        _state.works.append(work)
    _refresh()
    return work


def end(work: Work) -> None:
    """End work, and all that began within it and was broken off."""
    LOGGER.info("%s: %.1f s", work.activity, work.seconds)
    with _state.lock:
        if work not in _state.works:
            return
        del _state.works[_state.works.index(work) :]
        if _state.works or _state.display is None:
            _refresh()
        else:
            _state.display.end(work)
            _state.display = None


@contextmanager
def shown_by(display: Display) -> Iterator[None]:
    """Have all work within shown by a display instead of the usual one."""
    with _state.lock:
        _state.displays.append(display)
    try:
        yield
    finally:
        with _state.lock:
            _state.displays.remove(display)


def _joined(outer: str, inner: str) -> str:
    """A work and what is done for it now, in one sentence."""
    return f"{outer}: {inner[:1].lower()}{inner[1:]}"


def _refresh(least: float = 0.0) -> None:
    """Show the outermost work, and what is done for it now, unless it was just shown."""
    with _state.lock:
        now = perf_counter()
        if _state.display is None or not _state.works or now - _state.shown < least:
            return
        _state.shown = now
        outer, *inner = _state.works
        _state.display.show(_joined(outer.activity, inner[-1].line) if inner else outer.line)


# --- a notebook and a terminal --------------------------------------------------------------------


def in_notebook() -> bool:
    """Whether a notebook's kernel runs this code."""
    ipython: Any = sys.modules.get("IPython")
    return ipython is not None and hasattr(ipython.get_ipython(), "kernel")


def _usual_display() -> Display | None:
    """A line in a notebook or on a terminal, unless the log says the same there."""
    if not enabled:
        return None
    if in_notebook():
        return _notebook_line
    if LOGGER.isEnabledFor(logging.INFO):
        return None
    on_terminal = sys.stderr is not None and sys.stderr.isatty()
    return TerminalLine() if on_terminal else None


class NotebookLine:
    """One grey line below a notebook's cell, which stays with the times that its works took."""

    def __init__(self) -> None:
        self._cell = -1
        self._handle: Any = None
        self._seconds = dict[str, float]()
        """Total times of the works of this cell that ended, by activity. [s]"""

    def show(self, line: str) -> None:
        """Replace the line; it stands after the works of the cell that ended."""
        cell = sys.modules["IPython"].get_ipython().execution_count
        if cell != self._cell:
            self._cell = cell
            self._handle = None
            self._seconds = {}
        ended = [f"{activity}: {seconds:.1f} s" for activity, seconds in self._seconds.items()]
        text = "; ".join([*ended, line] if line else ended)
        formats = {
            "text/plain": text,
            "text/html": f'<span style="opacity: 0.65">{escape(text)}</span>',
        }
        if self._handle is None:
            display = import_module("IPython.display").display
            self._handle = display(formats, raw=True, display_id=True)
        else:
            self._handle.update(formats, raw=True)

    def end(self, work: Work) -> None:
        """Show how long it took."""
        self._seconds[work.activity] = self._seconds.get(work.activity, 0.0) + work.seconds
        self.show("")


_notebook_line = NotebookLine()


class TerminalLine:
    """A line on standard error, a terminal, which is wiped out at the end."""

    def __init__(self) -> None:
        self._length = 0

    def show(self, line: str) -> None:
        """Show a line in the place of the one before, cut to the terminal's width."""
        width = get_terminal_size().columns - 1
        cut_line = line if len(line) <= width else f"{line[: width - 1]}…"
        sys.stderr.write(f"\r{cut_line:{self._length}}")
        sys.stderr.flush()
        self._length = len(cut_line)

    def end(self, work: Work) -> None:
        """Wipe out the line."""
        sys.stderr.write(f"\r{'':{self._length}}\r")
        sys.stderr.flush()
