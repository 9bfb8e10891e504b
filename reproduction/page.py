"""The reproduction as one HTML file that needs nothing else."""

from __future__ import annotations

import io
from base64 import b64encode
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import matplotlib
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from reproduction.content import Figure, Reproduction
from reproduction.drawing import is_wide, own_canvas
from reproduction.wording import (
    ABSENT,
    LEAD,
    NOT_MEASURED,
    TITLE,
    as_html,
    chapters,
    errata_of,
)
from swashplate.tables import write_text


def write_page(
    reproduction: Reproduction, path: str | Path, *, begin: Callable[[str], None] | None = None
) -> None:
    """Write the page, whole or not at all; the same reproduction gives the same bytes.

    Parameters
    ----------
    reproduction : Reproduction
        What to show.
    path : path
        Of the HTML file.
    begin : callable, optional
        Told the name of each figure before it is drawn.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    pictures = {}
    for figure in reproduction.figures:
        if begin is not None:
            begin(f"drawing figure {figure.number}")
        pictures[figure.number] = _picture(figure)
    environment = Environment(
        loader=PackageLoader("reproduction", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["sub"] = as_html
    look = files("swashplate.report.fit_report").joinpath("page.css").read_text("utf-8")
    own = files("reproduction").joinpath("page.css").read_text("utf-8")
    text = environment.get_template("page.html").render(
        title=TITLE,
        lead=LEAD,
        not_measured=NOT_MEASURED,
        absent=ABSENT,
        css=Markup(look + own),
        chapters=chapters(reproduction),
        pictures=pictures,
        wide={each.number for each in reproduction.figures if is_wide(each)},
        errata=errata_of(reproduction),
        provenance=(
            *reproduction.provenance,
            ("drawn with", f"matplotlib {matplotlib.__version__}"),
        ),
    )
    write_text(text, path)


def _picture(figure: Figure) -> str:
    """The figure as an address that holds all of it.

    A picture of its own keeps the names inside one SVG from meeting those of another.
    """
    buffer = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": f"swashplate {figure.number}"}):
        own_canvas(figure).savefig(buffer, format="svg", metadata={"Date": None})
    return f"data:image/svg+xml;base64,{b64encode(buffer.getvalue()).decode('ascii')}"
