"""Signatures that can be read: few arguments by position."""

import ast
from pathlib import Path

import swashplate

MOST = 8
"""Arguments by position; the options of a command are none, they are given by name."""


def test_no_function_takes_many_arguments_by_position() -> None:
    package = Path(swashplate.__file__).parent
    found = []
    for path in sorted(package.rglob("*.py")):
        commands = path.parent.name == "cli"
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if not isinstance(node, ast.FunctionDef):
                continue
            taken = [a.arg for a in (*node.args.posonlyargs, *node.args.args)]
            own = [name for name in taken if name not in ("self", "cls")]
            if len(own) > MOST and not (commands and node.name == path.stem):
                found.append(f"{path.relative_to(package)}: {node.name} takes {len(own)}")
    assert found == []
