"""Binary formats are read in a process of their own, because a damaged file can end or hang it.

At some damage Polars aborts the whole process that reads a Parquet file, the HDF5 library goes
round in circles, asammdf prints what it meets. A second process, started at the first such file and
kept for the next, can be ended instead, has a limit to its memory, and turns whatever a library
raises into one sentence.
"""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
import tempfile
import threading
import warnings
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Any, cast
from weakref import finalize

import numpy as np

from swashplate.errors import FileError, InputError, SwashplateError
from swashplate.logs.log import Array, Column, Log, printable, reader_of, said

_PATIENCE = 30.0
"""How long a small file may take [s]."""
_PATIENCE_PER_MEGABYTE = 1.0
_LEAVE = 1.0
"""How long the other process has to end by itself, once it is asked no more [s]."""
_START = "import sys; sys.path[:] = {path!r}; from swashplate.logs.apart import serve; serve()"


def open_apart(reader: str, path: Path) -> Log:
    """Look into a file as a reader of this package does, in the other process.

    Parameters
    ----------
    reader : str
        Its name, as `reader_of` takes it.

    Raises
    ------
    FileError
        As the reader does; or if the file ended the process, or took too long.
    """
    told = _Other.ask(reader, path)[0]

    def load(positions: Sequence[int]) -> list[Array]:
        return _Other.ask(reader, path, positions)[1]

    def part(positions: Sequence[int], first: int, last: int) -> list[Array]:
        return _Other.ask(reader, path, positions, (first, last))[1]

    return Log(
        path,
        told["format"],
        tuple(Column(*column) for column in told["columns"]),
        load,
        tuple(told["comments"]),
        tuple(told["notes"]),
        told["left_out"],
        part=part if told["in_parts"] else None,
        rows=told["rows"],
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
        cls,
        reader: str,
        path: Path,
        positions: Sequence[int] | None = None,
        rows: tuple[int, int] | None = None,
    ) -> tuple[dict[str, Any], list[Array]]:
        """What the other process has to say of a file, and these columns of it."""
        question: dict[str, Any] = {
            "reader": reader,
            "path": str(path.absolute()),
            "said": str(path),
        }
        question |= {"positions": positions and list(positions), "rows": rows}
        with cls.lock:
            try:
                cls.running = other = cls.running or cls()
            except OSError as error:
                raise FileError(
                    f"{path} is read in a process of its own, which cannot be started: "
                    f"{error.strerror}."
                ) from None
            try:
                answer, arrays = other._answer(path, question)
            except BaseException:
                # also at Ctrl-C: what is half said must not meet the next question
                cls.running = None
                other._end()
                raise
        if "error" in answer:
            raise (InputError if answer["kind"] == "InputError" else FileError)(answer["error"])
        return answer, arrays

    def _answer(self, path: Path, question: dict[str, Any]) -> tuple[dict[str, Any], list[Array]]:
        source = cast(io.BufferedReader, self._process.stdout)
        sink = cast(io.BufferedWriter, self._process.stdin)
        try:
            sink.write(json.dumps(question).encode() + b"\n")
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
        answer = json.loads(line)
        arrays = []
        for count in answer.get("counts", []):
            array = np.empty(count)
            if source.readinto(array.view(np.uint8).data) < array.nbytes:
                raise FileError(self._what_ended(path))
            arrays.append(array)
        return answer, arrays

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
_INFLATION = 1032
"""No more bytes than this come out of one byte of zlib's; Parquet's codecs are no better."""
_USED = Path("/proc/self/statm")


def serve() -> None:
    """Answer questions: a line of JSON each, answered by a line and the arrays asked for."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries print must not get between the answers
    warnings.simplefilter("ignore")
    from swashplate.logs.dialect import TextOptions

    last: tuple[object, Log] | None = None
    for line in sys.stdin.buffer:
        asked = json.loads(line)
        path, reader = Path(asked["path"]), reader_of(asked["reader"])
        arrays: Sequence[Array] = []
        answer: dict[str, Any]
        try:
            _limit_memory(path)
            known = (asked["reader"], path, path.stat().st_mtime_ns, path.stat().st_size)
            if last is None or last[0] != known:
                last = None
                last = known, reader.open(path, TextOptions())
            log = last[1]
            if asked["positions"] is not None:
                log = log.between(*asked["rows"]) if asked["rows"] else log
                arrays = log.load(asked["positions"])
            answer = {key: getattr(log, key) for key in ("format", "columns", "comments", "notes")}
            answer |= {"left_out": dict(log.left_out), "rows": log.rows}
            answer |= {"in_parts": log.part is not None}
        except (KeyboardInterrupt, SystemExit):
            raise
        except BaseException as error:
            # libraries raise all there is at a broken byte, and Polars what is not an Exception
            what = str(error)
            if not isinstance(error, SwashplateError):
                what = (
                    f"{path} cannot be read as {reader.name}, it is damaged or of another kind: "
                    f"{said(error)}."
                )
            kind = "InputError" if isinstance(error, InputError) else "FileError"
            answer, arrays = {"error": what.replace(str(path), asked["said"]), "kind": kind}, []
        answer["counts"] = [array.size for array in arrays]
        answers.write(json.dumps(answer).encode() + b"\n")
        for array in arrays:
            answers.write(np.ascontiguousarray(array).view(np.uint8).data)
        answers.flush()


def _limit_memory(path: Path) -> None:
    """Let a file take no more than could be in it, where the system has such limits (Linux)."""
    if not _USED.exists():
        return
    import resource

    used = int(_USED.read_text().split()[0]) * resource.getpagesize()
    most = used + _SPARE + _INFLATION * path.stat().st_size
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    resource.setrlimit(resource.RLIMIT_AS, (most if hard < 0 else min(most, hard), hard))
