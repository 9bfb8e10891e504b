"""Sheets of paper that are filled from the top: text, figures and tables, into one PDF."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import wrap

from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure as Canvas
from matplotlib.lines import Line2D

from reproduction.content import Cell, Figure
from reproduction.drawing import draw_figure, height_of
from reproduction.wording import as_mathtext, length_of
from swashplate.report.style import FAINT, GREY, INK, SMALL, new_figure

WIDTH, HEIGHT = 8.27, 11.69
LEFT, TOP, BOTTOM = 0.85, 0.7, 0.75
"""A4 and its margins. [inch]"""
LETTER = 0.0073
"""Width of an average letter over its size. [inch/pt]"""
NUMERAL = 0.0081
"""The same of numbers, whose digits are wider. [inch/pt]"""
SPACING = 1.38 / 72.0
"""Height of a line over its letters' size. [inch/pt]"""


class Sheets:
    """A PDF that grows block by block; close it with `finish`."""

    def __init__(self, pdf: PdfPages) -> None:
        self._pdf = pdf
        self._canvas: Canvas | None = None
        self._used = TOP
        self._count = 0

    @property
    def width(self) -> float:
        """Of what can be written on. [inch]"""
        return WIDTH - 2.0 * LEFT

    def new_sheet(self) -> None:
        """Begin a new sheet, unless nothing is on this one."""
        if self._canvas is not None and self._used > TOP:
            self._close()

    def skip(self, height: float) -> None:
        """Leave some room. [inch]"""
        if self._canvas is not None:
            self._used += height

    def need(self, height: float) -> None:
        """Begin a new sheet if less than a height is left on this one. [inch]"""
        if self._used + height > HEIGHT - BOTTOM:
            self.new_sheet()

    def text(
        self, words: str, size: float = SMALL, color: str = INK, *, bold: bool = False
    ) -> None:
        """A paragraph over the whole width."""
        self._lines(self._wrapped(words, size, bold), size, color, bold)

    def heading(self, words: str, size: float, below: float = 0.6) -> None:
        """Words that do not stay alone: some room [inch] below them is on the same sheet."""
        self.need(size * SPACING + below)
        self.text(words, size, bold=True)
        self.skip(0.08)

    def figure(self, figure: Figure, title: str, remark: str) -> None:
        """A figure with its caption, on one sheet."""
        first = self._wrapped(title, SMALL, True)
        rest = self._wrapped(remark, SMALL, False)
        height = height_of(figure)
        self.need(height + (len(first) + len(rest)) * SMALL * SPACING + 0.03)
        draw_figure(self._page(), figure, LEFT, self._used, self.width)
        self._used += height + 0.03
        self._lines(first, SMALL, INK, True)
        self._lines(rest, SMALL, GREY, False)
        self._used += 0.14

    def table(self, columns: Sequence[str], rows: Sequence[Sequence[Cell]], size: float) -> None:
        """A table over the whole width; long cells are broken into lines."""
        cells = _with_header(columns, rows)
        widths = _widths(cells, self.width)
        for index, row in enumerate(cells):
            header = index == 0 and any(columns)
            self._row(row, widths, size, GREY if header else INK, strong=header)

    def height_of_table(
        self, columns: Sequence[str], rows: Sequence[Sequence[Cell]], size: float
    ) -> float:
        """Height of a table. [inch]"""
        cells = _with_header(columns, rows)
        widths = _widths(cells, self.width)
        return sum(_height(_lines_of(row, widths, size), size) for row in cells)

    def finish(self) -> None:
        """Write the last sheet."""
        self._close()

    def _row(
        self, row: Sequence[Cell], widths: Sequence[float], size: float, color: str, *, strong: bool
    ) -> None:
        broken = _lines_of(row, widths, size)
        height = _height(broken, size)
        self.need(height)
        left = LEFT
        for lines, width in zip(broken, widths, strict=True):
            for number, line in enumerate(lines):
                self._write(
                    as_mathtext(line), left, self._used + number * size * SPACING, size, color
                )
            left += width
        self._used += height
        self._rule(INK if strong else FAINT, 0.8 if strong else 0.4)

    def _lines(self, lines: Sequence[str], size: float, color: str, bold: bool) -> None:
        for line in lines:
            self.need(size * SPACING)
            self._write(as_mathtext(line), LEFT, self._used, size, color, bold)
            self._used += size * SPACING

    def _wrapped(self, words: str, size: float, bold: bool) -> list[str]:
        letter = LETTER * (1.12 if bold else 1.0)
        return wrap(words, max(int(self.width / (letter * size)), 10), break_on_hyphens=False)

    def _write(
        self, words: str, left: float, top: float, size: float, color: str, bold: bool = False
    ) -> None:
        self._page().text(
            left / WIDTH,
            1.0 - top / HEIGHT,
            words,
            fontsize=size,
            color=color,
            fontweight="bold" if bold else "normal",
            va="top",
        )

    def _rule(self, color: str, width: float) -> None:
        height = 1.0 - (self._used - 0.025) / HEIGHT
        ends = [LEFT / WIDTH, 1.0 - LEFT / WIDTH]
        page = self._page()
        page.add_artist(
            Line2D(ends, [height, height], color=color, linewidth=width, transform=page.transFigure)
        )

    def _page(self) -> Canvas:
        if self._canvas is None:
            self._canvas = new_figure(WIDTH, HEIGHT, layout="none")
            self._used = TOP
        return self._canvas

    def _close(self) -> None:
        if self._canvas is None:
            return
        self._count += 1
        self._canvas.text(
            0.5, 0.45 / HEIGHT, str(self._count), fontsize=SMALL, color=GREY, ha="center"
        )
        # matplotlib ships no types for PdfPages
        self._pdf.savefig(self._canvas)  # type: ignore[no-untyped-call]
        self._canvas, self._used = None, TOP


def _marked(cell: Cell) -> str:
    return f"{cell.text} [e{cell.mark}]" if cell.mark else cell.text


def _broken(text: str, width: float, size: float) -> list[str]:
    """Lines of a cell."""
    wide = sum(letter in "0123456789−" for letter in text) > len(text) // 2
    letters = int((width - 0.05) / ((NUMERAL if wide else LETTER) * size))
    if length_of(text) <= letters:
        return [text]
    return wrap(text, max(letters, 6), break_on_hyphens=False) or [""]


def _with_header(columns: Sequence[str], rows: Sequence[Sequence[Cell]]) -> list[Sequence[Cell]]:
    return [[Cell(column) for column in columns], *rows] if any(columns) else [*rows]


def _lines_of(row: Sequence[Cell], widths: Sequence[float], size: float) -> list[list[str]]:
    return [_broken(_marked(cell), width, size) for cell, width in zip(row, widths, strict=True)]


def _height(broken: Sequence[Sequence[str]], size: float) -> float:
    return max(map(len, broken)) * size * SPACING + 0.045


def _widths(cells: Sequence[Sequence[Cell]], room: float) -> list[float]:
    """Widths of columns, in proportion to their longest cell, neither tiny nor greedy. [inch]

    A header may be broken, but between words.
    """
    header, *rows = cells
    longest = [
        min(
            max(
                4,
                *(length_of(word) for word in header[column].text.split()),
                *(length_of(_marked(row[column])) for row in rows),
            ),
            27,
        )
        + 3
        for column in range(len(header))
    ]
    return [room * each / sum(longest) for each in longest]
