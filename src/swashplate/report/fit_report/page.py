"""The page of a report: blocks of sections as HTML in one file that works offline."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

from bokeh.resources import Resources
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from swashplate.tables import UNIT, Row, Table

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Block:
    """A piece of a section: text, list, table, figure, details, pair, tiles, or its own HTML."""

    kind: str
    content: Any
    caption: str = ""
    """Heading of a table, summary of details, caption of a figure; class of a text."""


@dataclass(frozen=True)
class Section:
    """A section of a page."""

    id: str
    heading: str
    blocks: Sequence[Block]


def text(words: str, look: str = "") -> Block:
    """A paragraph, in a look of `page.css`."""
    return Block("text", words, look)


def listed_block(sentences: Sequence[str]) -> list[Block]:
    """A list of sentences, nothing for none."""
    return [Block("list", sentences)] if sentences else []


def page(sections: Sequence[Section], content: Mapping[str, Any]) -> str:
    """HTML of a page."""
    environment = Environment(
        loader=PackageLoader("swashplate.report.fit_report", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals["html_table"] = html_table
    items = {name: _script_json(item) for name, item in content["items"].items()}
    made: str = environment.get_template("page.html").render(
        {**content, "items": items, "run_data": map(_script_json, content["run_data"])},
        sections=sections,
        bokeh=Markup(Resources(mode="inline", components=["bokeh"], log_level="warn").render()),
        css=Markup(resource("page.css")),
        js=Markup(resource("page.js")),
    )
    return made


def resource(name: str) -> str:
    """A file of this folder."""
    return files("swashplate.report.fit_report").joinpath(name).read_text("utf-8")


def html_table(table: Table, look: str = "") -> Markup:
    """A table's columns for a page. A meaning stands below its name, a role is a badge."""
    shown = table.of("p")
    heads, columns = shown.heads(), shown.columns
    parts = [Markup('<table class="{}"><thead><tr>').format(look)]
    for column, head in zip(columns, heads, strict=True):
        if column.name == "meaning":
            continue
        name = "unit" if column is UNIT else head
        classes = "n turned" if column.shade else "n" if column.spec else ""
        inner = Markup("<span>{}</span>").format(name) if column.shade else escape(name)
        parts.append(Markup('<th class="{}">{}</th>').format(classes, inner))
    parts.append(Markup("</tr></thead><tbody>"))
    for row in shown.rows:
        parts += _html_row(shown, row)
    return Markup("").join([*parts, Markup("</tbody></table>")])


def _html_row(table: Table, row: Row) -> list[Markup]:
    classes = " ".join(w for w, on in (("look", row.look), ("total", row.total)) if on)
    parts = [Markup('<tr class="{}">').format(classes) if classes else Markup("<tr>")]
    cells, raw = table.texts(row), iter(row.cells)
    meaning = next(
        (c for c, k in zip(cells, table.columns, strict=True) if k.name == "meaning"), ""
    )
    first = True
    for cell, column in zip(cells, table.columns, strict=True):
        value = cell if column is UNIT else next(raw)
        if column.name == "meaning":
            continue
        shown = (
            value if isinstance(value, Markup) else escape(typeset(cell) if column.spec else cell)
        )
        if column.name == "role":
            shown = Markup('<span class="badge {0}">{0}</span>').format(cell)
        if first:
            below = Markup(' <span class="meaning">{}</span>').format(meaning) if meaning else ""
            look = Markup(' class="n"') if column.spec else ""
            parts.append(Markup('<th scope="row"{}>{}{}</th>').format(look, shown, below))
        elif column.shade:
            share = getattr(value, "value", value)
            inner = Markup('<td class="n share" style="--share: {:.3f}">{}</td>')
            parts.append(inner.format(share, shown))
        else:
            missed = " miss" if column.name == "holds" and cell == "no" else ""
            look = "unit" if column is UNIT else f"n{missed}" if column.spec else missed.strip()
            inner = Markup('<td class="{}">{}</td>' if look else "<td{}>{}</td>")
            parts.append(inner.format(look, shown))
        first = False
    return [*parts, Markup("</tr>\n")]


def typeset(words: str) -> str:
    """Numbers as print shows them: a true minus, and powers of ten raised."""

    def power(match: re.Match[str]) -> str:
        return f" ·10{str(int(match[1])).translate(_RAISED)}"

    raised = re.sub(r"(?<=\d)e([+-]\d+)\b", power, words)
    return re.sub(r"(?<![\w.])-(?=\d)", "−", raised)


def _script_json(content: Any) -> Markup:
    """JSON that can stand in a script element: no text in it can end the element."""
    words = json.dumps(content, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return Markup(words.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e"))
