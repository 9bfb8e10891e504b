"""Labels of ordinates in as many lines as fit beside a panel."""

from __future__ import annotations

import re

LINES = 3
"""That a label may take."""


def in_lines(label: str, letters: int) -> str:
    """A label broken into lines: after words, and after underscores where a word is too long.

    Parameters
    ----------
    label : str
        In one line; a unit in parentheses at its end is never left out.
    letters : int
        That fit along the axis.
    """
    most = max(letters, 8)
    pieces = list[str]()
    for word in re.findall(r"\([^()]*\)$|\S+", label):
        whole = f"{word} "
        pieces += [whole] if len(word) <= most else re.findall(r"[^_]*_|[^_]+", whole)
    lines = [""]
    for piece in pieces:
        if lines[-1] and len(lines[-1]) + len(piece.rstrip()) > most:
            lines.append("")
        lines[-1] += piece
    lines = [each.strip() for each in lines]
    if len(lines) > LINES:
        lines = [*lines[: LINES - 2], f"{lines[LINES - 2].rstrip('_')}…", lines[-1]]
    # a single word that is too long loses its middle
    half = most // 2
    return "\n".join(
        each if len(each) <= most else f"{each[:half]}…{each[1 - half :]}" for each in lines
    )
