"""Examples as a user runs them: as scripts, each in a folder of its own."""

import contextlib
import importlib.util
import io
import runpy
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import pytest

ROOT = Path(__file__).parents[2]


class Run(NamedTuple):
    """What an example left behind."""

    names: dict[str, Any]
    printed: str
    folder: Path


@pytest.fixture(scope="module")
def run_example(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Run]:
    def run(name: str, *arguments: str) -> Run:
        path = ROOT / "examples" / f"{name}.py"
        folder, printed = tmp_path_factory.mktemp(name), io.StringIO()
        with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(printed):
            patch.chdir(folder)
            patch.setattr(sys, "argv", [str(path), *arguments])
            names = runpy.run_path(str(path), run_name="__main__")
        return Run(names, printed.getvalue(), folder)

    return run


@pytest.fixture(scope="module")
def load_example() -> Iterator[Callable[[str], ModuleType]]:
    """Import an example as a module, to call its functions.

    Numba stores with what it compiles which module it belongs to, and imports that when it loads
    it again: the module has to be known by its name, in the next session as in this one.
    """
    with pytest.MonkeyPatch.context() as patch:

        def load(name: str) -> ModuleType:
            path = ROOT / "examples" / f"{name}.py"
            spec = importlib.util.spec_from_file_location(name, path)
            assert spec is not None
            assert spec.loader is not None
            module = importlib.util.module_from_spec(spec)
            patch.setitem(sys.modules, name, module)
            spec.loader.exec_module(module)
            return module

        yield load
