"""``swashplate reproduce``: what the source reports, computed anew."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from swashplate.cli.terminal import note, progress, say
from swashplate.cli.validate import made_folder

EXAMPLES = """\
Examples:
  swashplate reproduce
  swashplate reproduce --out results/thesis --seed 3
"""
PAGE, PRINT = "reproduction.html", "reproduction.pdf"


def reproduce(
    out: Annotated[
        Path,
        typer.Option(help="Folder for the page and the PDF, made if missing.", metavar="DIR"),
    ] = Path("reproduction"),
    seed: Annotated[int, typer.Option(help="Of the virtual tests and the fits.", min=0)] = 1,
) -> None:
    """Reproduce the figures and tables of the model's source.

    All figures of chapters 4 and 7 and figure 9.1 of Kruse (2001) with the
    published parameters, and her tables; her error tables on virtual
    campaigns, beside her own numbers. Nothing in it is measured. Writes
    one HTML page and one PDF. Takes less than a minute.
    """
    from swashplate.reproduction import build

    folder = made_folder(out)
    with progress(len(build.ALL)) as begin:
        made = build.reproduce(seed=seed, begin=begin)
    from swashplate.report.fit_page.numbers import count
    from swashplate.report.reproduction import write_page, write_pdf

    with progress(2 * len(made.figures)) as begin:
        write_page(made, folder / PAGE, begin=begin)
        write_pdf(made, folder / PRINT, begin=begin)
    figures, tables = count(len(made.figures), "figure"), count(len(made.tables), "table")
    say(f"{figures} and {tables}, every curve simulated.")
    note(f"Page:      {folder / PAGE}")
    note(f"Print:     {folder / PRINT}")
