"""Formats that are read in a process of their own, because a damaged file can end or hang it.

At some damage Polars aborts the whole process that reads a Parquet file, the HDF5 library goes
round in circles, asammdf prints what it meets. A second process, started at the first such file and
kept for the next, can be ended instead, and has a limit to its memory.
"""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import IO, Any, cast
from weakref import finalize

import numpy as np

from swashplate.errors import FileError, InputError, SwashplateError
from swashplate.logs.damage import INFLATION, printable
from swashplate.logs.log import Array, Column, Log

_PATIENCE = 30.0
"""How long a small file may take [s]."""
_PATIENCE_PER_MEGABYTE = 1.0
_LEAVE = 1.0
"""How long the other process has to end by itself, once it is asked no more [s]."""
_START = "import sys; sys.path[:] = {path!r}; from swashplate.logs.apart import serve; serve()"


def open_apart(module: str, path: Path) -> Log:
    """Look into a file as a reader of this package does, in the other process.

    Parameters
    ----------
    module : str
        Name of the reader's module: ``"parquet"``.

    Raises
    ------
    FileError
        As the reader does; or if the file ended the process, or took too long.
    """
    told = _Other.ask(module, path, None)[0]

    def load(positions: Sequence[int]) -> list[Array]:
        return _Other.ask(module, path, list(positions))[1]

    return Log(
        path,
        told["format"],
        tuple(Column(*column) for column in told["columns"]),
        load,
        tuple(told["comments"]),
        tuple(told["notes"]),
        told["left_out"],
    )


class _Other:
    """The other process. It is asked in a line of JSON and answers in one, arrays behind it."""

    lock = threading.Lock()
    running: _Other | None = None

    def __init__(self) -> None:
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 - closed in _ended
        threads = min(4, os.cpu_count() or 1)  # each takes a share of the memory that it may have
        self._process = subprocess.Popen(
            [sys.executable, "-c", _START.format(path=sys.path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            env={**os.environ, "POLARS_MAX_THREADS": str(threads), "RUST_BACKTRACE": "0"},
        )
        self._end = finalize(self, _ended, self._process, self._errors)

    @classmethod
    def ask(
        cls, module: str, path: Path, positions: list[int] | None
    ) -> tuple[dict[str, Any], list[Array]]:
        """What the other process has to say of a file, and these columns of it."""
        with cls.lock:
            if cls.running is None:
                try:
                    cls.running = cls()
                except OSError as error:
                    raise FileError(
                        f"{path} is read in a process of its own, which cannot be started: "
                        f"{error.strerror}."
                    ) from None
            other = cls.running
            try:
                said, arrays = other._answer(module, path, positions)
            except (
                BaseException
            ):  # also at Ctrl-C: what is half said must not meet the next question
                cls.running = None
                other._end()
                raise
        if "error" in said:
            raise (InputError if said["kind"] == "InputError" else FileError)(said["error"])
        return said, arrays

    def _answer(
        self, module: str, path: Path, positions: list[int] | None
    ) -> tuple[dict[str, Any], list[Array]]:
        asked = {
            "module": module,
            "path": str(path),
            "folder": str(Path.cwd()),
            "positions": positions,
        }
        source = cast(io.BufferedReader, self._process.stdout)
        sink = cast(io.BufferedWriter, self._process.stdin)
        try:
            sink.write(json.dumps(asked).encode() + b"\n")
            sink.flush()
        except BrokenPipeError:
            raise FileError(self._what_ended(path)) from None
        seconds = _PATIENCE + _PATIENCE_PER_MEGABYTE * path.stat().st_size / 1e6
        # a clock that ends the process, since not every system can wait for a pipe
        clock = threading.Timer(seconds, self._process.kill)
        clock.start()
        try:
            line = source.readline()
        finally:
            out_of_time = not clock.is_alive()
            clock.cancel()
        if out_of_time:
            raise FileError(
                f"{path} could not be read within {seconds:.0f} s; it is damaged or too large."
            )
        if not line.endswith(b"\n"):
            raise FileError(self._what_ended(path))
        said = json.loads(line)
        arrays = []
        for count in said.get("counts", []):
            array = np.empty(count)
            if source.readinto(array.view(np.uint8).data) < array.nbytes:
                raise FileError(self._what_ended(path))
            arrays.append(array)
        return said, arrays

    def _what_ended(self, path: Path) -> str:
        self._process.wait()
        self._errors.seek(0)
        lines = self._errors.read()[-2000:].decode("utf-8", "replace").split("\n")
        told = next((line for line in reversed(lines) if line[:1].isalpha()), "")
        reason = printable(told).strip().rstrip(".")[:200]
        return f"{path} is damaged so that reading it breaks off{': ' if reason else ''}{reason}."


def _ended(process: subprocess.Popen[bytes], errors: IO[bytes]) -> None:
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with suppress(BrokenPipeError):  # a question that was never read
                pipe.close()
    try:
        process.wait(_LEAVE)  # without more questions it ends by itself
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    errors.close()


# --- the other process ----------------------------------------------------------------------------

_SPARE = 3 << 30
"""Memory that reading takes at least, most of it addresses alone. [byte]"""
_USED = Path("/proc/self/statm")


def serve() -> None:
    """Answer questions: a line of JSON each, answered by a line and the arrays asked for."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries print must not get between the answers
    last: tuple[object, Log] | None = None
    for line in sys.stdin.buffer:
        asked = json.loads(line)
        os.chdir(asked["folder"])
        path = Path(asked["path"])
        try:
            from swashplate.logs.text import TextOptions

            reader = import_module(f"swashplate.logs.{asked['module']}")
            _limit_memory(path)
            known = (asked["module"], path.resolve(), path.stat().st_mtime_ns, path.stat().st_size)
            if last is None or last[0] != known:
                last = None
                last = known, reader.open(path, TextOptions())
            arrays = [] if asked["positions"] is None else last[1].load(asked["positions"])
            _answer(answers, _told(last[1]), arrays)
        except SwashplateError as error:
            kind = "InputError" if isinstance(error, InputError) else "FileError"
            _answer(answers, {"error": str(error), "kind": kind}, [])


def _told(log: Log) -> dict[str, Any]:
    return {
        "format": log.format,
        "columns": log.columns,
        "comments": log.comments,
        "notes": log.notes,
        "left_out": dict(log.left_out),
    }


def _answer(answers: Any, told: dict[str, Any], arrays: Sequence[Array]) -> None:
    told["counts"] = [array.size for array in arrays]
    answers.write(json.dumps(told).encode() + b"\n")
    for array in arrays:
        answers.write(array.view(np.uint8).data)
    answers.flush()


def _limit_memory(path: Path) -> None:
    """Let a file take no more than could be in it, where the system has such limits (Linux)."""
    if not _USED.exists():
        return
    import resource

    used = int(_USED.read_text().split()[0]) * resource.getpagesize()
    most = used + _SPARE + INFLATION * path.stat().st_size
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    resource.setrlimit(resource.RLIMIT_AS, (most if hard < 0 else min(most, hard), hard))
