"""The reproduction as one PDF for print."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matplotlib
from matplotlib.backends.backend_pdf import PdfPages

from reproduction.content import Cell, Figure, Reproduction, Table
from reproduction.sheets import Sheets
from reproduction.wording import (
    ABSENT,
    LEAD,
    NOT_MEASURED,
    TITLE,
    chapters,
    errata_of,
)
from swashplate.report.style import GREY, NORMAL, SMALL
from swashplate.tables import write_whole

DENSE = 6.6
"""Size of letters in wide tables. [pt]"""


def write_pdf(
    reproduction: Reproduction, path: str | Path, *, begin: Callable[[str], None] | None = None
) -> None:
    """Write the PDF, whole or not at all; the same reproduction gives the same bytes.

    Parameters
    ----------
    reproduction : Reproduction
        What to show.
    path : path
        Of the PDF file.
    begin : callable, optional
        Told the name of each figure before it is drawn.

    Raises
    ------
    FileError
        If the file cannot be written.
    """

    def write(beside: Path) -> None:
        metadata = {"Title": TITLE, "CreationDate": None}
        with PdfPages(beside, metadata=metadata) as pdf:
            sheets = Sheets(pdf)
            _cover(sheets, reproduction)
            for number, heading, figures, tables in chapters(reproduction):
                sheets.skip(0.2)
                sheets.heading(f"{number} {heading}", 15.0, 3.2)
                for figure in figures:
                    if begin is not None:
                        begin(f"printing figure {figure.number}")
                    _figure(sheets, figure)
                for table in tables:
                    _table(sheets, table)
            _end(sheets, reproduction)
            sheets.finish()

    write_whole(path, write)


def _cover(sheets: Sheets, reproduction: Reproduction) -> None:
    sheets.text(TITLE, 20.0, bold=True)
    sheets.skip(0.12)
    sheets.text(LEAD, NORMAL)
    sheets.skip(0.1)
    sheets.text(NOT_MEASURED[0], NORMAL, bold=True)
    sheets.text(NOT_MEASURED[1], NORMAL)
    sheets.skip(0.1)
    sheets.text(ABSENT, SMALL, GREY)
    sheets.skip(0.2)
    sheets.heading("Contents", 12.0)
    for number, heading, figures, tables in chapters(reproduction):
        sheets.text(f"{number} {heading}", SMALL, bold=True)
        for figure in figures:
            sheets.text(f"Figure {figure.number}  {figure.title}{_virtual(figure)}", 7.0)
        for table in tables:
            sheets.text(f"Table {table.number}  {table.title}{_virtual(table)}", 7.0)
        sheets.skip(0.06)


def _figure(sheets: Sheets, figure: Figure) -> None:
    remark = figure.caption
    if figure.errata:
        remark += f" {'Errata' if len(figure.errata) > 1 else 'Erratum'} "
        remark += ", ".join(map(str, figure.errata)) + "."
    title = f"Figure {figure.number}. {figure.title}.{_virtual(figure)}"
    sheets.figure(figure, title, remark)


def _table(sheets: Sheets, table: Table) -> None:
    size = DENSE if table.virtual or table.number.startswith("8.") else SMALL
    below = sheets.height_of_table(table.columns, table.rows, size) + 0.4
    sheets.heading(f"Table {table.number}. {table.title}{_virtual(table)}", 10.0, below)
    sheets.table(table.columns, table.rows, size)
    sheets.skip(0.04)
    for note in table.notes:
        sheets.text(note, 7.0, GREY)
    sheets.skip(0.25)


def _end(sheets: Sheets, reproduction: Reproduction) -> None:
    sheets.skip(0.2)
    sheets.heading("Errata of the source that touch something here", 15.0, 2.0)
    rows = [(Cell(str(number)), Cell(words)) for number, words in errata_of(reproduction).items()]
    if rows:
        sheets.table(("", ""), rows, SMALL)
    sheets.skip(0.3)
    sheets.heading("Provenance", 15.0)
    drawn = ("drawn with", f"matplotlib {matplotlib.__version__}")
    sheets.table(
        ("", ""),
        [(Cell(what), Cell(words)) for what, words in (*reproduction.provenance, drawn)],
        SMALL,
    )


def _virtual(each: Figure | Table) -> str:
    return " [virtual]" if each.virtual else ""
