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
from typing import Any, cast
from weakref import finalize

import numpy as np

from swashplate.errors import FileError, InputError, SwashplateError
from swashplate.logs.binary import look
from swashplate.logs.log import Array, Log, LogColumn, first_sentence, printable
from swashplate.stopping import let_signals_end_waits, undone

_PATIENCE = 30.0
"""How long a small file may take, the start of the other process included [s]."""
_PATIENCE_PER_MEGABYTE = 1.0
_LEAVE = 1.0
"""How long the other process has to end by itself, once it is asked no more [s]."""
_START = """\
import sys
sys.path[:] = {path!r}
from swashplate.logs.subprocess_reader import serve
serve()
"""


def open_in_subprocess(reader: str, path: Path) -> Log:
    """Look into a file by `swashplate.logs.binary.look`, in the other process."""

    def ask(*what: Any) -> tuple[dict[str, Any], list[Array]]:
        return _ReaderProcess.ask(path, [reader, str(path.absolute()), str(path), *what])

    def load(positions: Sequence[int], first: int = 0, last: int | None = None) -> list[Array]:
        return ask([*positions], first, last)[1]

    contents = ask()[0]
    columns = tuple(LogColumn(*column) for column in contents["columns"])
    return Log(
        path, contents["format"], columns, load, contents["left_out"], tuple(contents["lengths"])
    )


class _ReaderProcess:
    """The other process. It is asked in a line of JSON and answers in one, arrays after it."""

    lock = threading.Lock()
    running: _ReaderProcess | None = None

    def __init__(self) -> None:
        # what it says of an error, and what libraries leave of a damaged file
        self._scratch = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        self._error_file = Path(self._scratch.name) / "errors"
        threads = min(4, os.cpu_count() or 1)  # each takes a share of the memory that it may have
        with self._error_file.open("wb") as errors:
            self._process = subprocess.Popen(
                [sys.executable, "-c", _START.format(path=sys.path)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                env={
                    **os.environ,
                    **dict.fromkeys(("TMPDIR", "TEMP", "TMP"), self._scratch.name),
                    "POLARS_MAX_THREADS": str(threads),
                    "RUST_BACKTRACE": "0",
                    # a block is read with little ahead of it, and given back before the next
                    "POLARS_ROW_GROUP_PREFETCH_SIZE": "2",
                    "_RJEM_MALLOC_CONF": "dirty_decay_ms:0,muzzy_decay_ms:0",
                },
            )
        self._end = finalize(self, _ended, self._process, self._scratch)

    @classmethod
    def ask(cls, path: Path, question: Sequence[Any]) -> tuple[dict[str, Any], list[Array]]:
        """What the other process has to say of a file, and the columns asked for."""
        with cls.lock:
            try:
                cls.running = process = cls.running or cls()
            except OSError as error:
                raise FileError(
                    f"{path} is read in a separate process, which cannot be started: "
                    f"{error.strerror}."
                ) from None
            try:
                with undone(process._process.kill):
                    answer, arrays = process._answer(path, question)
            except BaseException:
                # also at Ctrl-C: what is half said must not meet the next question, and nobody
                # waits for the rest
                cls.running = None
                process._process.kill()
                process._end()
                raise
        if "error" in answer:
            raise (InputError if answer["kind"] == "InputError" else FileError)(answer["error"])
        return answer, arrays

    def _answer(self, path: Path, question: Sequence[Any]) -> tuple[dict[str, Any], list[Array]]:
        source = cast(io.BufferedReader, self._process.stdout)
        sink = cast(io.BufferedWriter, self._process.stdin)
        seconds = _PATIENCE + _PATIENCE_PER_MEGABYTE * path.stat().st_size / 1e6
        # a clock that ends the process, since not every system can wait for a pipe
        clock = threading.Timer(seconds, self._process.kill)
        clock.start()
        line = b""
        let_signals_end_waits()
        try:
            with suppress(BrokenPipeError):
                sink.write(json.dumps(question).encode() + b"\n")
                sink.flush()
                line = source.readline()
        finally:  # also at Ctrl-C: Python does not end before its clocks
            in_time = clock.is_alive()
            clock.cancel()
        if not in_time:
            raise FileError(
                f"{path} could not be read within {seconds:.0f} s; it is damaged or too large."
            )
        answer = json.loads(line) if line.endswith(b"\n") else {}
        arrays = [np.empty(size) for size in answer.get("sizes", [])]
        read = [source.readinto(array.view(np.uint8).data) == array.nbytes for array in arrays]
        if not answer or not all(read):
            self._process.wait()
            lines = self._error_file.read_bytes()[-2000:].decode("utf-8", "replace").split("\n")
            last = next((line for line in reversed(lines) if line[:1].isalpha()), "")
            reason = printable(last).strip().rstrip(".")[:200]
            why = f": {reason}" if reason else ""
            raise FileError(f"{path} is damaged: reading it stops{why}.")
        return answer, arrays


def _ended(process: subprocess.Popen[bytes], scratch: tempfile.TemporaryDirectory[str]) -> None:
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with suppress(BrokenPipeError):  # a question that was never read
                pipe.close()
    try:
        process.wait(_LEAVE)  # without more questions it ends by itself
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    scratch.cleanup()


# --- the other process ----------------------------------------------------------------------------

_SPARE = 3 << 30
"""Memory that reading takes at least, most of it mere addresses. [byte]"""
_INFLATION = 1032
"""No more bytes than this come out of one byte of zlib's; Parquet's codecs are no better."""
_USED = Path("/proc/self/statm")


def serve() -> None:
    """Answer questions: a line of JSON each, answered by a line and the arrays asked for."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries print must not get between the answers
    warnings.simplefilter("ignore")
    for line in sys.stdin.buffer:
        reader, name, name_in_messages, *requested = json.loads(line)
        answer, arrays = dict[str, Any](), list[Array]()
        try:
            _limit_memory(Path(name))
            answer, arrays = look(reader, Path(name), *requested)
        except (KeyboardInterrupt, SystemExit):
            raise
        except BaseException as error:
            # libraries raise all there is at a broken byte, and Polars what is not an Exception
            what = str(error)
            if not isinstance(error, SwashplateError):
                what = (
                    f"{name} cannot be read as {reader}, it is damaged or of another kind: "
                    f"{first_sentence(error)}."
                )
            answer = {"error": what.replace(name, name_in_messages), "kind": type(error).__name__}
        answer["sizes"] = [array.size for array in arrays]
        answers.write(json.dumps(answer).encode() + b"\n")
        for array in arrays:
            answers.write(np.ascontiguousarray(array).view(np.uint8).data)
        answers.flush()


def _limit_memory(path: Path) -> None:
    """Let a file take no more than could be in it, if the system has such limits (Linux)."""
    if not _USED.exists():
        return
    import resource

    used = int(_USED.read_text().split()[0]) * resource.getpagesize()
    most = used + _SPARE + _INFLATION * path.stat().st_size
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    resource.setrlimit(resource.RLIMIT_AS, (most if hard < 0 else min(most, hard), hard))
