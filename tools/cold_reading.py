"""Functions to read cold: ten of each of eight packages, drawn with a seed, without their context.

    python tools/cold_reading.py SEED [--key] > functions.md

The test of a name or a docstring is a reader who has never seen the code. For each function say in
writing what it does, what each name stands for and what it may touch; only then look up where it
stands (``--key``) and check. What was misread is renamed or rewritten.
"""

from __future__ import annotations

import argparse
import ast
import random
import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

SOURCE = Path(__file__).parents[1] / "src" / "swashplate"
PACKAGES = {
    "machine": ["machine"],
    "drive": ["models", "drive", "full_order"],
    "campaign": ["campaign", "drafting", "rig.py", "logs"],
    "identification": ["identification"],
    "analysis": ["analysis", "parameters"],
    "crane": ["crane"],
    "report": ["report"],
    "cli": ["cli"],
}
DRAWN = 10
SHORTEST = 6
"""Lines of a body; what is shorter says too little."""


class Function(NamedTuple):
    """A function as it stands, and where."""

    file: str
    line: int
    text: str


def main() -> None:
    """Print the functions, or where they stand."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("seed", type=int)
    parser.add_argument("--key", action="store_true", help="where the functions stand")
    chosen = parser.parse_args()
    for package, places in PACKAGES.items():
        functions = sorted(functions_of(places))
        for number, function in enumerate(drawn(functions, chosen.seed, package), start=1):
            if chosen.key:
                print(f"{package} {number}: {function.file}:{function.line}")
            else:
                print(f"### {package} {number}\n```python\n{function.text}\n```\n")


def drawn(functions: Sequence[Function], seed: int, package: str) -> list[Function]:
    """Some functions of a package; a seed gives each package a draw of its own."""
    return random.Random(f"{seed} {package}").sample(functions, DRAWN)


def functions_of(places: Sequence[str]) -> Iterator[Function]:
    """All functions of some files and folders that are long enough."""
    for place in places:
        path = SOURCE / place
        for file in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            text = file.read_text("utf-8")
            for node in ast.walk(ast.parse(text)):
                if isinstance(node, ast.FunctionDef) and is_long_enough(node):
                    yield Function(
                        file=file.relative_to(SOURCE).as_posix(),
                        line=node.lineno,
                        text=textwrap.dedent(source_of(node, text)),
                    )


def is_long_enough(node: ast.FunctionDef) -> bool:
    """Whether a function has enough lines besides its docstring."""
    body = node.body[1:] if ast.get_docstring(node) else node.body
    if node.name.startswith("__") or not body:
        return False
    return (body[-1].end_lineno or 0) - body[0].lineno + 1 >= SHORTEST


def source_of(node: ast.FunctionDef, text: str) -> str:
    """Lines of a function with its decorators."""
    first = min([node.lineno, *(mark.lineno for mark in node.decorator_list)])
    return "\n".join(text.splitlines()[first - 1 : node.end_lineno])


if __name__ == "__main__":
    main()
