"""All that the package says to people, sentence by sentence, in one file for people to review.

    python tools/sentences.py [--write]

A sentence stands as in the source, what is filled in between braces. Tests of a message check what
it must name; its wording is reviewed here: tests/test_sentences.py compares this list with
tests/golden/sentences.txt, and ``make sentences`` writes that file again.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "swashplate"
REVIEWED = ROOT / "tests" / "golden" / "sentences.txt"
FEWEST_WORDS = 4
"""What is shorter is a label, a name or a key."""


def sentences() -> str:
    """Every sentence below the name of its module, in the order of the source."""
    blocks = []
    for path in sorted(SOURCE.rglob("*.py")):
        said = list(dict.fromkeys(said_by(path.read_text("utf-8"))))
        if said:
            module = path.relative_to(SOURCE).with_suffix("").as_posix()
            blocks.append("\n".join([f"## {module}", *said]))
    return "\n\n".join(blocks) + "\n"


def said_by(text: str) -> Iterator[str]:
    """Sentences of a module that are not docstrings, each on one line."""
    tree = ast.parse(text)
    inside = set()  # docstrings, and parts of f-strings that stand as a whole
    found = []
    for node in ast.walk(tree):
        if node in inside:
            continue
        if isinstance(node, ast.Expr):
            inside.add(node.value)
        elif isinstance(node, ast.JoinedStr):
            inside.update(ast.walk(node))
            found.append(node)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            found.append(node)
    for node in sorted(found, key=lambda node: (node.lineno, node.col_offset)):
        words = " ".join(text_of(node).split())
        if len(words.split(" ")) >= FEWEST_WORDS and words.isprintable():
            yield words


def text_of(node: ast.expr) -> str:
    """Text of a string or f-string, with what is filled in between braces."""
    if isinstance(node, ast.JoinedStr):
        return "".join(map(text_of, node.values))
    if isinstance(node, ast.FormattedValue):
        return "{" + ast.unparse(node.value) + "}"
    return str(node.value) if isinstance(node, ast.Constant) else ""


def main() -> None:
    """Print the sentences, or write them where they are reviewed."""
    if "--write" in sys.argv[1:]:
        REVIEWED.write_text(sentences(), "utf-8")
    else:
        print(sentences(), end="")


if __name__ == "__main__":
    main()
