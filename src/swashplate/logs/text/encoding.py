"""Text files as UTF-8 in pieces of whole lines, whatever they are encoded in."""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from swashplate.errors import FileError
from swashplate.logs.damage import check_kind

PIECE = 1 << 22
"""Bytes that are read at a time: large enough for every core, small beside a column."""

LONGEST_LINE = 1 << 24
"""A line of more bytes is no row of a table."""

_MARKS = {
    codecs.BOM_UTF8: "utf-8",
    codecs.BOM_UTF16_LE: "utf-16-le",
    codecs.BOM_UTF16_BE: "utf-16-be",
}
# in these, the characters that tables are made of are the bytes of ASCII, and no others
_LIKE_ASCII = re.compile(
    r"ascii|utf-8|iso8859-\d+|cp125\d|latin-1|koi8-.|mac-?roman|cp437|cp850|cp858"
)
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x19\x1b-\x1f\x7f]")


@dataclass(frozen=True)
class TextSource:
    """A text file, its encoding known."""

    path: Path
    encoding: str
    """Canonical name, as `codecs.lookup` has it."""
    mark: int = 0
    """Bytes of a byte-order mark at the beginning."""

    @property
    def encoding_said(self) -> str:
        """Encoding for people, empty for UTF-8."""
        names = {"utf-8": "", "ascii": "", "iso8859-1": "Latin-1"}
        return names.get(self.encoding, self.encoding.upper().removesuffix("-LE"))

    @cached_property
    def _as_it_is(self) -> bool:
        return _LIKE_ASCII.fullmatch(self.encoding) is not None

    def text(self, line: bytes) -> str:
        """A line of `pieces` as text."""
        return line.decode(self.encoding if self._as_it_is else "utf-8", "replace")

    def pieces(self) -> Iterator[bytes]:
        """The file in pieces of whole lines, every line ended by a line feed.

        Columns of numbers are the same bytes in nearly all encodings; only others are recoded.

        Raises
        ------
        FileError
            For bytes that are no such text, or an endless line.
        """
        rest = b""
        for block in self._blocks():
            cut = block.rfind(b"\n") + 1
            if cut == 0:
                rest += block
                if len(rest) > LONGEST_LINE:
                    raise FileError(
                        f"{self.path} has a line of more than {LONGEST_LINE >> 20} MB; it is no "
                        "table of text."
                    )
                continue
            piece = b"".join((rest, memoryview(block)[:cut]))
            rest = block[cut:]
            # looked for first: to find one byte is much faster than to find two
            yield piece.replace(b"\r\n", b"\n") if b"\r" in piece else piece
        if rest:
            yield rest + b"\n"

    def samples(self, count: int, size: int = 1 << 16) -> list[str]:
        """Lines from the middle and the end of a file of several pieces, so many of each."""
        total = self.path.stat().st_size
        if not self._as_it_is or total < PIECE:
            return []
        lines = []
        with self.path.open("rb") as file:
            for place in (total // 2, max(total - size, 0)):
                file.seek(place)
                whole = file.read(size).replace(b"\r\n", b"\n").replace(b"\r", b"\n").split(b"\n")
                lines += [self.text(line) for line in whole[1:-1][:count]]
        return lines

    @cached_property
    def ends_whole(self) -> bool:
        """Whether the last line has a line end."""
        if not self._as_it_is:
            return True
        with self.path.open("rb") as file:
            file.seek(-1, 2)
            return file.read() in b"\r\n\x1a"

    def _blocks(self) -> Iterator[bytes]:
        """The file block by block; the last one ends with a line feed."""
        decoder = codecs.getincrementaldecoder(self.encoding)("strict")
        lone_returns = None
        last = b""
        with self.path.open("rb") as file:
            file.seek(self.mark)
            while block := file.read(PIECE):
                if not self._as_it_is:
                    block = self._recoded(decoder, block)
                if lone_returns is None:
                    lone_returns = b"\n" not in block and b"\r" in block
                if last:
                    yield last
                last = block.replace(b"\r", b"\n") if lone_returns else block
        if not self._as_it_is:
            self._recoded(decoder, b"", final=True)
        last = last.rstrip(b"\x1a")  # old programs end a text so
        if last:
            yield last if last.endswith(b"\n") else last + b"\n"

    def _recoded(
        self, decoder: codecs.IncrementalDecoder, block: bytes, final: bool = False
    ) -> bytes:
        try:
            return decoder.decode(block, final).encode()
        except UnicodeError as error:
            raise FileError(f"{self.path} is no text in {self.encoding}: {error}.") from None


def text_source(path: Path, encoding: str | None) -> TextSource:
    """Find out how a text file is encoded.

    Parameters
    ----------
    encoding : str or None
        As the user gave it, or None to find out: by a byte-order mark, by the zeros that UTF-16
        has between Latin letters, as UTF-8, or else as Latin-1.

    Raises
    ------
    FileError
        If it is no text.
    """
    with path.open("rb") as file:
        head = file.read(1 << 16)
    mark, found = next(
        ((len(mark), name) for mark, name in _MARKS.items() if head.startswith(mark)), (0, None)
    )
    if encoding is not None:
        name = codecs.lookup(encoding).name
        if name == "utf-16":
            name = found or "utf-16-le"
        source = TextSource(path, "utf-8" if name == "utf-8-sig" else name, mark)
    else:
        source = TextSource(path, found or _guessed(head), mark)
    _check_text(source, head[mark:])
    return source


def _guessed(head: bytes) -> str:
    even, odd = head[0::2].count(0), head[1::2].count(0)
    if odd > 0.4 * len(head[1::2]) and even == 0:
        return "utf-16-le"
    if even > 0.4 * len(head[0::2]) and odd == 0:
        return "utf-16-be"
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        return "iso8859-1"
    return "utf-8"


def _check_text(source: TextSource, head: bytes) -> None:
    try:
        text = codecs.getincrementaldecoder(source.encoding)("strict").decode(head)
    except UnicodeError as error:
        check_kind(source.path)
        raise FileError(f"{source.path} is no text in {source.encoding}: {error}.") from None
    control = _CONTROL.search(text)
    if control:
        check_kind(source.path)
        line = len(re.findall(r"\r\n|\n|\r", text[: control.start()])) + 1
        what = "a NUL byte" if control[0] == "\0" else f"the byte {ord(control[0]):#04x}"
        raise FileError(f"{source.path} has {what} in line {line}; it is damaged or no text file.")
