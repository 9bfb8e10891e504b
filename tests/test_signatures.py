"""Signatures that can be read: few arguments by position."""

import ast
import inspect
from pathlib import Path

import typer

import swashplate
from swashplate.cli import app

MOST = 8
"""Arguments by position; the options of a command are none, they are given by name."""


def test_no_function_takes_many_arguments_by_position() -> None:
    package = Path(swashplate.__file__).parent
    found_commands = [*typer.main.get_group(app).commands.values()]
    for each in found_commands:
        found_commands += getattr(each, "commands", {}).values()
    functions = [inspect.unwrap(each.callback) for each in found_commands if each.callback]
    commands = {(Path(inspect.getfile(each)), each.__name__) for each in functions}
    assert len(commands) > 20
    found = []
    for path in sorted(package.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if not isinstance(node, ast.FunctionDef):
                continue
            taken = [a.arg for a in (*node.args.posonlyargs, *node.args.args)]
            own = [name for name in taken if name not in ("self", "cls")]
            if len(own) > MOST and (path, node.name) not in commands:
                found.append(f"{path.relative_to(package)}: {node.name} takes {len(own)}")
    assert found == []
