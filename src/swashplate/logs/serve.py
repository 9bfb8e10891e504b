"""The process in which `apart` has formats read; it ends when its standard input does."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from swashplate.errors import InputError, SwashplateError
from swashplate.logs.damage import INFLATION
from swashplate.logs.log import Array, Log
from swashplate.logs.text.options import TextOptions

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
