"""The mirror of the code's size and tangles counts right, and says what it cannot count."""

import subprocess
import sys
from pathlib import Path

import pytest
from tools.mirror import main

MIRROR = Path(__file__).parents[1] / "tools" / "mirror.py"
LAZY = """
import lazy_loader
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
"""
FILES = {
    "__init__.py": LAZY,
    "__init__.pyi": "from .machine import Model as Model\n",
    "__main__.py": "from swashplate.cli import main\nmain()\n",
    "errors.py": "class InputError(Exception): ...\n",
    "machine/__init__.py": LAZY,
    "machine/__init__.pyi": (
        "from . import graph as graph\n"
        "from .gone import nowhere as nowhere\n"
        "from .marching import Machine as Machine\n"
        "from .model import Model as Model\n"
        "from .model import equation as equation\n"
    ),
    "machine/graph.py": "",
    "machine/model.py": "class Model: ...\ndef equation(): ...\n",
    "machine/marching/__init__.py": LAZY,
    "machine/marching/__init__.pyi": "from .run import Machine as Machine\n",
    "machine/marching/run.py": (
        "from typing import TYPE_CHECKING\n"
        "from swashplate.machine.model import Model\n"
        "if TYPE_CHECKING:\n"
        "    from swashplate.cli import main\n"
        "class Machine:\n"
        "    def __init__(self, model):\n"
        "        assert isinstance(model, Model)\n"
    ),
    "cli/__init__.py": "from swashplate.cli.commands import main as main\n",
    "cli/commands.py": (
        "from typing import TYPE_CHECKING\n"
        "from swashplate.machine import Machine, graph, Model as Equations\n"
        "from swashplate.machine.marching import Machine as Again\n"
        "if TYPE_CHECKING:\n"
        "    from swashplate.machine import nowhere\n"
        "def asked(what):\n"
        "    return isinstance(what, Equations | Again) or isinstance(what, (int, str))\n"
        "def main():\n"
        "    asked(graph)\n"
    ),
}
"""A small package: `cli` takes names through two faces, one of them twice and one that is gone."""
PROGRAM = (
    'EQUATION = "from swashplate.cli.commands import asked as main_of\\nmain = lambda: main_of(1)"'
)


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A checkout of the small package, with nothing else in it."""
    for name, text in FILES.items():
        path = tmp_path / "src" / "swashplate" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, "utf-8")
    return tmp_path


def rows(printed: str, heading: str) -> dict[str, list[str]]:
    """Words of the lines below a heading, by the first of each line."""
    _, _, rest = printed.partition(f"\n{heading}")
    lines = rest.partition("\n\n")[0].splitlines()[1:]
    return {line.split()[0]: line.split()[1:] for line in lines}


def test_names_are_counted_where_they_stand(tree: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Behind two faces, under another name, as a module, for types: each once."""
    assert main(["--tree", str(tree)]) == 0
    printed = capsys.readouterr().out
    faces = rows(printed, "Faces")
    assert faces["machine"] == ["5", "3", "3"]  # Machine, graph, Model of three modules
    assert faces["cli"] == ["0", "1", "1"]
    assert faces["(top)"] == ["1", "0", "0"]
    assert "machine.marching 1" in printed
    kinds = rows(printed, "Questions of kind")
    assert kinds["cli"] == ["1", "Machine", "1,", "Model", "1"]
    assert kinds["machine"] == ["1", "Model", "1"]
    assert rows(printed, "Circles of modules: 1")
    assert rows(printed, "Circles of packages: 1")


@pytest.mark.slow
def test_trips_are_counted_and_a_tree_brings_its_own_program(
    tree: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tree / "tools").mkdir()
    (tree / "tools" / "mirror.py").write_text(PROGRAM, "utf-8")
    assert main(["--tree", str(tree), "--trips"]) == 0
    trips = capsys.readouterr().out.partition("Trips (files, functions):\n")[2].splitlines()
    assert [line.split()[-2:] for line in trips] == [["1", "2"]] * 3 + [["1", "1"]]


@pytest.mark.parametrize(
    ("commands", "named"),
    [
        ("def main(:\n", ["commands.py", "line 1", "mend"]),
        ("1 / 0\n", ["demo", "ZeroDivisionError", "--trips"]),
        ("def main(): raise SystemExit('no')\n", ["demo", "no", "--trips"]),
        ("import absent_library\n", ["absent_library", ".venv/bin/python"]),
    ],
)
def test_what_cannot_be_counted_is_said_in_a_sentence(
    tree: Path, commands: str, named: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    (tree / "src" / "swashplate" / "cli" / "commands.py").write_text(commands, "utf-8")
    assert main(["--tree", str(tree), "--trips"]) == 2
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1
    assert all(words in said for words in named)


@pytest.mark.parametrize(
    ("place", "named"),
    [
        ("src/swashplate/cli", "here --tree {tree}."),
        ("src/swashplate/errors.py", "here --tree {tree}."),
        ("absent", "does not exist"),
        ("..", "holds no folder src/swashplate"),
    ],
)
def test_a_folder_that_is_no_checkout_is_refused(
    tree: Path, place: str, named: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Who gives a folder within a checkout is told which one it is."""
    assert main(["--tree", str(tree / place)]) == 2
    said = capsys.readouterr()
    assert not said.out
    assert len(said.err.splitlines()) == 1
    assert named.format(tree=tree) in said.err


def test_no_library_is_needed_to_read(tree: Path) -> None:
    command = [sys.executable, "-S", str(MIRROR), "--tree", "."]  # -S: nothing that was installed
    done = subprocess.run(command, cwd=tree, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "Circles of modules" in done.stdout
