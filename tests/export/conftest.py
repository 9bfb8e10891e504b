"""What tests of exported C need: a compiler, and a library of a model that Python can call."""

import ctypes
import shutil
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swashplate import Drive
from swashplate.export import drive_sources, values_of

COMPILER = shutil.which("gcc") or shutil.which("clang") or shutil.which("cc")
STRICT = "-std=c99 -O2 -ffp-contract=off -Wall -Wextra -Wconversion -Wshadow -pedantic -Werror"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip what compiles where there is no compiler."""
    if COMPILER is None:
        for item in items:
            if "compiled" in getattr(item, "fixturenames", ()):
                item.add_marker(pytest.mark.skip(reason="there is no C compiler here"))


Compile = Callable[..., Path]


@pytest.fixture(scope="session")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Compile:
    """Compiles sources, text by file name, into a shared library or a program."""

    def compile_(
        sources: dict[str, str], flags: Sequence[str] = (), program: str = "", strict: str = STRICT
    ) -> Path:
        assert COMPILER is not None
        folder = tmp_path_factory.mktemp("c")
        for name, text in sources.items():
            (folder / name).write_text(text, "utf-8")
        made = folder / (program or "made.so")
        shared = [] if program else ["-shared", "-fPIC"]
        files = [name for name in sources if name.endswith(".c")]
        command = [COMPILER, *strict.split(), *shared, *flags, *files, "-lm", "-o", str(made)]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        assert not done.stderr
        return made

    return compile_


class InC:
    """An exported model, through its C interface."""

    def __init__(self, library: Path, prefix: str, values: np.ndarray) -> None:
        self.library, self.prefix = ctypes.CDLL(str(library)), prefix
        for name in ("size", "value_count"):
            self.function(name).restype = ctypes.c_size_t
        for name in ("output", "get", "get_step"):
            self.function(name).restype = ctypes.c_double
        for name in ("sentence", "parameter_name", "output_name"):
            self.function(name).restype = ctypes.c_char_p
        for name in ("find", "find_output", "find_input", "find_option"):
            self.function(name).argtypes = [ctypes.c_char_p]
        self.function("limits").restype = ctypes.c_uint
        for name in ("get_option", "valid"):
            self.function(name).restype = ctypes.c_bool
        self.model = ctypes.create_string_buffer(self.function("size")())
        assert self.init(values) == 0

    def function(self, name: str) -> Any:
        return getattr(self.library, f"{self.prefix}_{name}")

    def __getattr__(self, name: str) -> Any:
        """A function of the interface, for this model."""

        def call(*arguments: Any) -> Any:
            given = [ctypes.c_double(a) if isinstance(a, float) else a for a in arguments]
            return self.function(name)(self.model, *given)

        return call

    def init(self, values: np.ndarray, count: int | None = None) -> int:
        pointer = values.ctypes.data_as(ctypes.c_void_p)
        size = ctypes.c_size_t(values.size if count is None else count)
        return int(self.function("init")(self.model, pointer, size))

    def number(self, kind: str, name: str) -> int:
        return int(self.function(f"find{kind}")(name.encode()))

    def run(self, command: np.ndarray, names: Sequence[str]) -> dict[str, np.ndarray]:
        """Outputs of a record."""
        places = [self.number("_output", name) for name in names]
        assert -1 not in places
        out = np.empty((command.size, len(places)))
        step, output, model = self.function("step"), self.function("output"), self.model
        step.argtypes = [ctypes.c_void_p, ctypes.c_double]
        for n, value in enumerate(command.tolist()):
            status = step(model, value)
            assert status == 0, f"{self.function('sentence')(status).decode()} at sample {n}"
            out[n] = [output(model, place) for place in places]
        return dict(zip(names, out.T, strict=True))


@pytest.fixture(scope="session")
def drive_library(compiled: Compile) -> Path:
    """The drive's library, of every set."""
    return compiled(drive_sources())


@pytest.fixture(scope="session")
def in_c(drive_library: Path) -> Callable[..., InC]:
    """A drive in C at a step."""

    def made(drive: Drive, step: float = 1.0 / 512.0, library: Path | None = None) -> InC:
        return InC(library or drive_library, "swp", values_of(drive, step))

    return made
