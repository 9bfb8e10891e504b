"""How the command line ends when it is told to, by Ctrl-C or SIGTERM, whatever it is doing.

The first signal raises `Stopped` in the main thread, which unwinds like any exception. That alone
is not enough: an exception that is raised within a callback of C or a finaliser is dropped there, a
long computation in C returns to Python after minutes, and an executor waits for its threads. So a
thread hears the signal too, and ends the process from outside if it lives longer than `GRACE`.
"""

from __future__ import annotations

import atexit
import os
import signal
import socket
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from threading import Thread, Timer, current_thread, main_thread
from types import FrameType
from typing import Any

GRACE = 3.0
"""Time that a command has to end by itself: people press Ctrl-C again after about that. [s]"""
AGAIN = 0.02
"""Time after which an import is looked at again. [s]"""
SIGNALS = (signal.SIGINT, signal.SIGTERM)

_undoings = dict[object, Callable[[], object]]()
"""What is to be undone if the process is ended from outside, by an object of its own each."""


class Stopped(BaseException):
    """The process was told to end.

    No `KeyboardInterrupt`, which a search takes to return its best point so far, and no
    `Exception`, which libraries take for an error that they may pass over.
    """


class _Told:
    """What was told to stop; the main thread writes it."""

    obeying = False
    """Whether signals are obeyed."""
    told = 0
    """Number of the first signal, 0 if there was none."""
    put_off = False
    """Whether `Stopped` waits for the end of `as_a_whole`."""
    over = False
    """Whether the command has ended, and the interpreter is about to."""


@contextmanager
def obeying() -> Iterator[None]:
    """End the process with 128 + the number of the signal, as a shell reports it, if there is one.

    For the main thread of a program, around all that it does.
    """
    if _Told.obeying:
        yield
        return
    _Told.obeying = True
    hears, rings = socket.socketpair()
    rings.setblocking(False)
    signal.set_wakeup_fd(rings.detach(), warn_on_full_buffer=False)  # open until the process ends
    Thread(target=_watch, args=(hears,), daemon=True).start()
    sys.unraisablehook = _unraisable
    for number in SIGNALS:
        signal.signal(number, _tell)
    atexit.register(_ignore_signals)
    try:
        yield
    except (Stopped, KeyboardInterrupt):  # Polars raises one of its own at Ctrl-C
        sys.exit(128 + (_Told.told or signal.SIGINT))
    finally:
        _Told.over = True
        if _Told.told:  # whatever became of the exception, and whatever it led to
            sys.exit(128 + _Told.told)


@contextmanager
def undone(undo: Callable[[], object]) -> Iterator[None]:
    """Have something undone if the process is ended from outside meanwhile.

    Parameters
    ----------
    undo : callable
        Quick, and without locks that the main thread may hold. An `OSError` is passed over.
    """
    key = object()
    _undoings[key] = undo
    try:
        yield
    finally:
        del _undoings[key]


@contextmanager
def as_a_whole() -> Iterator[None]:
    """Put `Stopped` off to the end of what takes less than `GRACE`, such as a folder's files."""
    if _Told.put_off or current_thread() is not main_thread():
        yield
        return
    _Told.put_off = True
    try:
        yield
    finally:
        _Told.put_off = False
        if _Told.told:
            raise Stopped


def let_signals_end_waits(number: int = signal.SIGINT) -> None:
    """Let a signal end what the main thread waits for from now on.

    Polars, once imported, has the system go on with a wait that a signal interrupts, so that Python
    does not hear of it before the wait is over.
    """
    if hasattr(signal, "siginterrupt"):  # not on Windows
        signal.siginterrupt(number, True)


def _tell(number: int, frame: FrameType | None) -> None:
    """Handle a signal, in the main thread."""
    if _Told.told:
        return  # it is ending, by itself or by the thread that watches
    if _Told.over:
        _end(number)
    if _imports(frame) and hasattr(signal, "pthread_kill"):
        # compiled modules panic if what they import for themselves ends half-way
        again = Timer(AGAIN, signal.pthread_kill, (main_thread().ident or 0, number))
        again.daemon = True
        again.start()
    else:
        _Told.told = number
        if not _Told.put_off:
            raise Stopped


def _imports(frame: FrameType | None) -> bool:
    """Whether a module is being imported where the main thread is."""
    while frame is not None and "<frozen importlib" not in frame.f_code.co_filename:
        frame = frame.f_back
    return frame is not None


def _ignore_signals() -> None:
    """Let the interpreter end as the command has: a signal now would end it without a word."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def _watch(bell: socket.socket) -> None:
    """Wait for a signal, and end the process if it has not ended a while after."""
    number = 0
    while number not in SIGNALS:
        number = bell.recv(1)[0]
    let_signals_end_waits(number)
    if hasattr(signal, "pthread_kill"):  # again, in case it waits since before
        signal.pthread_kill(main_thread().ident or 0, number)
    # the main thread may be deaf all the same, so that it has not been told yet
    bell.settimeout(GRACE)
    with suppress(TimeoutError):
        while True:  # further signals change nothing: some programs send each twice
            bell.recv(1)
    _end(number)


def _unraisable(what: Any) -> None:
    """End the process where its `Stopped` is dropped; what else is dropped is printed."""
    if isinstance(what.exc_value, Stopped):
        _end(_Told.told)
    sys.__unraisablehook__(what)


def _end(number: int) -> None:
    """End the process at once, with its workers and without half-written files."""
    for undo in [*_undoings.values()]:
        with suppress(OSError):
            undo()
    if "multiprocessing.util" in sys.modules:
        # semaphores of workers: else a process of Python's reports them as leaked
        sys.modules["multiprocessing.util"]._run_finalizers(0)
    os._exit(128 + number)
