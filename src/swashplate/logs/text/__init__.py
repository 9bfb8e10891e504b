"""Logs in text: comma-separated values and what else goes by that name."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from swashplate.errors import FileError
from swashplate.logs.log import Log
from swashplate.logs.text.encoding import text_source
from swashplate.logs.text.header import MARKER, Line, comment_marks, read_heading
from swashplate.logs.text.layout import TextOptions as TextOptions
from swashplate.logs.text.layout import find_layout
from swashplate.logs.text.rows import RowReader

name = "CSV"
suffixes = (".csv", ".tsv", ".txt", ".dat", ".asc", ".lvm", ".log")

_HEAD = 2000  # lines in which the header and the first row of data must be
_SAMPLE = 60  # lines by which delimiter and decimal sign are told, from the start and all over
_SAMPLED = 1 << 20  # bytes of them: fewer lines where there are thousands of columns


def open(path: Path, options: TextOptions) -> Log:
    """Look into a text file: encoding, delimiter, decimal sign, names, units, comments.

    Delimiter and decimal sign are those under which most rows have the same number of fields and
    most of their characters are in numbers. Where two are as good as each other, the file is
    refused and `TextOptions` must say.

    Raises
    ------
    FileError
        If it is no text, has no rows of numbers, or can be read in more than one way.
    """
    source = text_source(path, options.encoding)
    marks = comment_marks(options)
    head = next(source.pieces(), b"").split(b"\n")[:-1]
    lines = [Line(number, source.text(text)) for number, text in enumerate(head[:_HEAD], 1)]
    start = max((line.number for line in lines if line.text.startswith(MARKER)), default=0)
    some = _SAMPLE
    if head:
        some = max(4, min(some, _SAMPLED * len(head) // (sum(map(len, head)) + 1)))
    rest = head[start:]
    sample = _content([source.text(text) for text in rest[: 4 * some]], marks)[:some]
    sample += _content([source.text(text) for text in rest[some :: 1 + len(rest) // some]], marks)
    sample += _content(source.samples(some // 2), marks)
    if not sample:
        raise FileError(f"{path} has no rows of numbers, only comments and empty lines.")
    layout = find_layout(sample, options, path)
    heading = read_heading(lines, layout, options, path)
    notes = heading.notes
    if not source.ends_whole:
        cut = "The last line has no end; if the file was cut off, the last number may be short."
        notes = (*notes, cut)
    form = f"{layout}, {source.encoding_said}" if source.encoding_said else str(layout)
    load = RowReader(source, layout, heading, marks)
    return Log(path, form, heading.columns, load, heading.comments, notes)


def _content(lines: Sequence[str], marks: tuple[str, ...]) -> list[str]:
    return [
        line for line in lines if line.strip() and not (marks and line.lstrip().startswith(marks))
    ]
