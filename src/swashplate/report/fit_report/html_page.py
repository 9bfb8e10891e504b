"""The page of a report: blocks of sections as HTML in one file that works offline."""

from __future__ import annotations

import json
import os
import re
from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import date
from hashlib import sha256
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from shutil import which
from subprocess import TimeoutExpired, run
from tempfile import TemporaryDirectory
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from swashplate.errors import FileError
from swashplate.tables import PRINTED, UNIT, Column, Row, Table, ending, write_whole

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class PageBlock:
    """A piece of a section: its kind, of those that `page.html` has, and its content."""

    kind: str
    content: Any
    caption: str = ""
    """Heading of a table, summary of details, caption of a figure; class of a text."""


@dataclass(frozen=True)
class Section:
    """A section of a page."""

    id: str
    heading: str
    blocks: Sequence[PageBlock]


def text(paragraph: str, css_class: str = "") -> PageBlock:
    """A paragraph, with a class of `page.css`."""
    return PageBlock("text", paragraph, css_class)


def listed_block(sentences: Sequence[str]) -> list[PageBlock]:
    """A list of sentences, nothing for none."""
    return [PageBlock("list", sentences)] if sentences else []


def titled(table: Table, css_class: str = "") -> list[PageBlock]:
    """A table under its title, its caption a remark."""
    remark = [text(table.caption, "remark")] if table.caption else []
    heading = PageBlock("heading", table.title, "h3")
    return [heading, PageBlock("table", table, css_class), *remark]


def page(
    sections: Sequence[Section],
    *,
    what: str,
    title: str,
    facts: str,
    virtual: bool = False,
    run_data: Iterable[Mapping[str, Any]] = (),
) -> str:
    """HTML of a report's page; sections without blocks are left out."""
    kinds = {block.kind for section in sections for block in section.blocks}
    return rendered(
        "fit_report/page.html",
        ("curves.js", "page.js"),
        ("page.css",),
        embedded=LIVE_SCRIPTS if "live" in kinds else (),
        sections=[section for section in sections if section.blocks],
        what=what,
        title=title,
        facts=facts,
        virtual=virtual,
        run_data=map(script_json, run_data),
    )


def rendered(
    template: str,
    scripts: Sequence[str],
    looks: Sequence[str],
    style: str = "",
    *,
    embedded: Sequence[str] = (),
    **content: Any,
) -> str:
    """HTML of a template, with scripts in a scope of their own and looks from its folder.

    The page allows these scripts to run and no other, whatever a name or a title in it holds; see
    `content_policy`. `embedded` are the scripts of a live page within it.
    """
    environment = Environment(
        loader=PackageLoader("swashplate.report", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals["html_table"] = html_table
    folder = files("swashplate.report") / template.partition("/")[0]
    css = [(folder / name).read_text("utf-8") for name in looks]
    script = _scoped(folder, scripts)
    allowed = [script]
    if embedded:
        allowed.append(_scoped(folder, embedded))
    live = LIVE_SCRIPTS in (scripts, embedded)
    page: str = environment.get_template(template).render(
        content,
        css=Markup("".join(css) + style),
        js=Markup(script),
        policy=content_policy(allowed, compiles=live),
        date=f"{date.today():%d %B %Y}",
    )
    # control characters of a name, and what turns the direction of writing, are not part of HTML
    return re.sub(
        "[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]",
        "\ufffd",
        page,
    )


LIVE_SCRIPTS = ("curves.js", "live.js")
"""Of a live page, which compiles the drive's WebAssembly."""


def _scoped(folder: Traversable, scripts: Sequence[str]) -> str:
    """Scripts of a folder as the text of one element, in a scope of their own."""
    code = "\n".join((folder / name).read_text("utf-8") for name in scripts)
    return f'"use strict";\n(() => {{\n{code}}})();'


def content_policy(scripts: Sequence[str], *, compiles: bool = False) -> str:
    """Content-Security-Policy of a page: what of it a browser runs and loads.

    Parameters
    ----------
    scripts : sequence of str
        Texts of the script elements that may run, known by their hashes; no other script does, no
        attribute such as ``onclick``, and no `eval`.
    compiles : bool
        Whether they may compile WebAssembly.

    Returns
    -------
    str
        A policy under which nothing is loaded but images in the page itself, nothing is sent, and
        styles may stand in attributes, as in Matplotlib's SVG.
    """
    sources = [f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'" for text in scripts]
    if compiles:
        sources.append("'wasm-unsafe-eval'")
    return (
        f"default-src 'none'; script-src {' '.join(sources)}; style-src 'unsafe-inline'; "
        "img-src data:; base-uri 'none'; form-action 'none'"
    )


def html_table(table: Table, css_class: str = "") -> Markup:
    """HTML of a table for a page. A symbol stands below its meaning, a role is a badge."""
    page_table = table.of("p")
    pieces = [f'<table class="{escape(css_class)}"><thead><tr>']
    for column, heading in zip(page_table.columns, page_table.headings(), strict=True):
        if column.name != "meaning":
            pieces.append(f'<th class="{"n" if column.spec else ""}">{escape(heading)}</th>')
    pieces.append("</tr></thead><tbody>")
    pieces += [_html_row(page_table, row) for row in page_table.rows]
    return Markup("".join([*pieces, "</tbody></table>"]))


def _html_row(table: Table, row: Row) -> str:
    """HTML of a row; the text of its column "meaning" is put before the symbol in the first cell.

    Every piece is escaped when it is inserted: Markup's own formatting takes ten times as long.
    """
    row_classes = []
    if row.look:
        row_classes.append("look")
    if row.total:
        row_classes.append("total")
    classes = " ".join(row_classes)
    pieces = [f'<tr class="{classes}">' if classes else "<tr>"]
    cells = list(zip(table.columns, row.cells, table.texts(row), strict=True))
    meanings = [cell_text for column, _, cell_text in cells if column.name == "meaning"]
    meaning = meanings[0] if meanings else ""
    for position, (column, value, cell_text) in enumerate(cells):
        if column.name == "meaning":
            continue
        if column.name == "role":
            content = Markup('<span class="badge {0}">{0}</span>').format(cell_text)
        elif isinstance(value, Markup):
            content = value
        else:
            content = escape(typeset(cell_text, column))
        if position == 0:
            if meaning:
                content = Markup(f'{escape(meaning)} <span class="symbol">{content}</span>')
            number_class = ' class="n"' if column.spec else ""
            pieces.append(f'<th scope="row"{number_class}>{content}</th>')
            continue
        cell_class = _cell_class(column, cell_text)
        start = f'<td class="{cell_class}">' if cell_class else "<td>"
        pieces.append(f"{start}{content}</td>")
    return "".join([*pieces, "</tr>\n"])


def _cell_class(column: Column, cell_text: str) -> str:
    """CSS classes of a cell: of units, of numbers, and of an interval that misses the truth."""
    if column is UNIT:
        return "unit"
    classes = ["n"] if column.spec else []
    if column.name == "holds" and cell_text == "no":
        classes.append("miss")
    return " ".join(classes)


def typeset(cell_text: str, column: Column) -> str:
    """Typeset numbers of a column: with a true minus, and powers of ten raised."""
    if not column.spec:
        return cell_text

    def power(match: re.Match[str]) -> str:
        return f" ·10{str(int(match[1])).translate(_RAISED)}"

    raised = re.sub(r"(?<=\d)e([+-]\d+)\b", power, cell_text)
    return re.sub(r"(?<![\w.])-(?=\d)", "−", raised)


def script_json(content: Any) -> Markup:
    """JSON that can stand in a script element: no text in it can end the element."""
    document = json.dumps(content, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    for character in "&<>":
        document = document.replace(character, f"\\u{ord(character):04x}")
    return Markup(document)


# --- on paper -------------------------------------------------------------------------------------

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "msedge")
PATIENCE = 180.0
"""Time after which a browser that has not printed is stopped. [s]"""


def find_browser() -> str:
    """Path of a Chromium, which prints pages; a `FileError` if there is none."""
    browser_path = next(
        (path for browser in BROWSERS if (path := which(browser)) is not None), None
    )
    if browser_path is None:
        raise FileError(
            f"No browser was found that prints a PDF ({', '.join(BROWSERS)}): install Chromium, or "
            "open report.html in any browser and print it there."
        )
    return browser_path


def print_report(page: str | Path, path: str | Path) -> None:
    """Print a report's page as PDF, whole or not at all, by a Chromium without a window.

    The PDF replaces an older one.

    Raises
    ------
    FileError
        If there is no Chromium, it prints nothing, or the file cannot be written or does not end
        in ``.pdf``.
    """
    ending(path, PRINTED)
    browser = find_browser()
    address = Path(page).absolute().as_uri()

    def write(temporary: Path) -> None:
        with TemporaryDirectory() as profile:
            arguments = [
                browser,
                "--headless",
                "--disable-gpu",
                "--no-pdf-header-footer",
                f"--user-data-dir={profile}",
                f"--print-to-pdf={temporary.absolute()}",
            ]
            if hasattr(os, "geteuid") and os.geteuid() == 0:
                arguments.append("--no-sandbox")  # Chromium has none for the superuser
            with suppress(TimeoutExpired):
                run([*arguments, address], capture_output=True, timeout=PATIENCE, check=False)
        if not temporary.stat().st_size:
            raise OSError(0, f"{browser} printed nothing")

    write_whole(path, write)
