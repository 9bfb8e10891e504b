"""Pages of the reference that would only repeat what the package says of itself.

The API from `api.toml` and docstrings, the command line from its own help, campaign files and
fit setups from their schemas. The tables of the nomenclature, a page that is kept, are made of the
parameters' definitions: ``python docs/generate.py`` writes them anew.
"""

import importlib
import inspect
import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import typer.main
from pydantic import BaseModel
from sphinx.pycode import ModuleAnalyzer

from swashplate.campaign import CampaignFile, json_schema
from swashplate.cli import EPILOG, HELP, app
from swashplate.identification import FitSetup
from swashplate.parameters import CATALOGUE, REFINEMENTS, Block, Definition, SetFile
from swashplate.results import Drawn

HERE = Path(__file__).parent


def pages(folder: Path) -> None:
    """Write all pages; a page that is the same stays untouched, so that it is not built again."""
    folder.mkdir(exist_ok=True)
    made = {f"api-{name}.md": text for name, text in api_pages()}
    made["command-line.md"] = command_line()
    made["campaign-file.md"] = schema_page("Campaign file", CampaignFile, CAMPAIGN)
    made["parameter-file.md"] = schema_page("Parameter file", SetFile, PARAMETERS)
    made["campaign.schema.json"] = json_schema()
    made["fit-setup-file.md"] = schema_page("Fit setup file", FitSetup, SETUP)
    for path in folder.iterdir():
        if path.name not in made:
            path.unlink()
    for name, text in made.items():
        path = folder / name
        if not path.exists() or path.read_text("utf-8") != text:
            path.write_text(text, "utf-8")


CAMPAIGN = """\
A campaign says where the logs of a machine are and what their columns mean.
`swashplate campaign init` writes a draft from your logs. An introduction:
[campaigns](../campaign.md). The same as a JSON Schema, with which
[editors complete entries](../campaign.md#completion-in-an-editor):
{download}`campaign.schema.json`."""
PARAMETERS = """\
A drive in numbers. `swashplate show hoist --toml > mine.toml` writes one to start from; symbols,
units and ranges: [nomenclature](../nomenclature.md)."""
SETUP = """\
The parameters that a fit estimates, if not every number of the drive. `swashplate advise` shows
which of them your tests determine; [identification](../identification.md) has an example."""


def api_pages() -> Iterator[tuple[str, str]]:
    """One page a subject, each object from its docstring."""
    wanted = tomllib.loads((HERE / "api.toml").read_text("utf-8"))
    for page in wanted["page"]:
        lines = [f"# {page['title']}", "", page["text"], ""]
        for name in page["objects"]:
            found = resolved(name)
            kind = directive(found)
            short = name.rpartition(".")[2]
            lines += [f"## {short}", "", "```{eval-rst}", f".. {kind}:: {name}"]
            if kind == "autoclass":
                excluded = ", ".join(["model_config", *fields_without_docstring(found)])
                lines += ["   :members:", f"   :exclude-members: {excluded}"]
                if issubclass(found, Drawn):
                    lines += ["", f"   .. automethod:: {name}.plot"]
            lines += ["```", ""]
        yield page["name"], "\n".join(lines)


def resolved(name: str) -> Any:
    """The object behind a dotted name."""
    module, _, attribute = name.rpartition(".")
    return getattr(importlib.import_module(module), attribute)


def directive(found: Any) -> str:
    """autodoc's word for it."""
    if inspect.isclass(found):
        return "autoexception" if issubclass(found, Exception) else "autoclass"
    return "autofunction" if callable(found) else "autodata"


def fields_without_docstring(kind: type) -> list[str]:
    """Fields of a named tuple of which autodoc would say no more than their position."""
    documented = ModuleAnalyzer.for_module(kind.__module__).find_attr_docs()
    fields = getattr(kind, "_fields", ())
    return [field for field in fields if (kind.__qualname__, field) not in documented]


def command_line() -> str:
    """Every command with its own help, as a reader of the terminal gets it."""
    root = typer.main.get_command(app)
    lines = ["# Command line", "", "```text", HELP.rstrip(), "", EPILOG.rstrip(), "```", ""]
    for words, command in commands(root, ("swashplate",)):
        lines += [f"## {' '.join(words)}", "", first_paragraphs(command.help), ""]
        lines += ["```text", usage(command, words), "```", ""]
        options = [option_row(each, command) for each in command.params if shown(each)]
        if options:
            lines += ["| argument or option | meaning |", "|---|---|", *options, ""]
        if command.epilog:
            lines += ["```text", command.epilog.strip(), "```", ""]
    return "\n".join(lines)


def commands(group: Any, words: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any]]:
    """All commands below a group, in the order of its help."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands(command, (*words, name))
        else:
            yield (*words, name), command


def first_paragraphs(text: str | None) -> str:
    """A command's help, without what is for the terminal alone."""
    return inspect.cleandoc(text or "").replace("\b", "").strip()


def usage(command: Any, words: tuple[str, ...]) -> str:
    """How it is called."""
    context = command.context_class(command, info_name=" ".join(words))
    return " ".join(command.get_usage(context).removeprefix("Usage: ").split())


def shown(parameter: Any) -> bool:
    """Whether its help is for users."""
    return not getattr(parameter, "hidden", False) and parameter.name != "help"


def option_row(parameter: Any, command: Any) -> str:
    """A row of the table of arguments and options."""
    name, text = parameter.get_help_record(command.context_class(command))
    if parameter.param_type_name == "argument":
        name = parameter.metavar or name
    return f"| `{name.replace('|', chr(92) + '|')}` | {cell(' '.join(text.split()))} |"


def cell(text: str) -> str:
    """Text that cannot end a cell, or pass for markup."""
    return text.replace("|", "\\|").replace("<", "&lt;")


def schema_page(title: str, model: type[BaseModel], text: str) -> str:
    """A file's tables and keys from its schema."""
    schema = model.model_json_schema()
    parts = [(model.__name__, schema), *schema.get("$defs", {}).items()]
    tables = {name for name, part in parts if "properties" in part}
    lines = [f"# {title}", "", text, ""]
    for name, part in parts:
        if name not in tables:
            continue
        lines += [f"## {name}", "", first_paragraphs(part.get("description")), ""]
        lines += ["| key | value | default | meaning |", "|---|---|---|---|"]
        for key, entry in part["properties"].items():
            default = "required" if key in part.get("required", ()) else shown_default(entry)
            meaning = cell(" ".join(entry.get("description", "").split()))
            lines.append(
                f"| `{key}` | {type_words(entry, tables, schema)} | {default} | {meaning} |"
            )
        lines.append("")
    return "\n".join(lines)


def shown_default(entry: Mapping[str, Any]) -> str:
    """A key's default, short."""
    default = entry.get("default")
    return "" if default in (None, "", [], {}) or isinstance(default, dict) else f"`{default}`"


def type_words(entry: Mapping[str, Any], tables: set[str], schema: Mapping[str, Any]) -> str:
    """What a key takes, in words."""
    if "$ref" in entry:
        name = entry["$ref"].rpartition("/")[2]
        if name in tables:
            return f"[{name}](#{name.lower()})"
        return type_words(schema["$defs"][name], tables, schema)
    if "anyOf" in entry or "oneOf" in entry:
        forms = [
            type_words(each, tables, schema)
            for each in entry.get("anyOf", entry.get("oneOf"))
            if each.get("type") != "null"
        ]
        return " or ".join(dict.fromkeys(forms))
    if "enum" in entry:
        return ", ".join(f"`{each}`" for each in entry["enum"])
    if "const" in entry:
        return f"`{entry['const']}`"
    if entry.get("type") == "array":
        items = entry.get("items") or {}
        return f"list of {type_words(items, tables, schema)}" if items else "list"
    if entry.get("type") == "object" and isinstance(entry.get("additionalProperties"), dict):
        return f"table of {type_words(entry['additionalProperties'], tables, schema)}"
    return {"string": "text", "integer": "whole number", "boolean": "true or false"}.get(
        entry.get("type", ""), entry.get("type", "any")
    )


# --- nomenclature ---------------------------------------------------------------------------------

NOMENCLATURE = HERE / "nomenclature.md"
HEADS: Mapping[Block, tuple[str, ...]] = {
    "control_card": ("equation",),
    "pump_motor": ("lumped from", "equation"),
    "refinements": ("not given", "option", "of"),
}
"""Columns of a block's table after those of all tables."""


def nomenclature(text: str) -> str:
    """The page with its tables as the definitions have them, each behind the heading of its block.

    Parameters
    ----------
    text : str
        The page; a table begins with a row ``| symbol | name | unit | per direction | ...``.
    """
    tables = iter(HEADS)

    def made(_: re.Match[str]) -> str:
        return parameter_table(next(tables))

    return re.sub(r"^\| symbol \| name \| unit \|.*\n(\|.*\n)+", made, text, flags=re.MULTILINE)


def parameter_table(block: Block) -> str:
    """All parameters of a block, a row each."""
    heads = ("symbol", "name", "unit", "per direction", "range", "plausible", *HEADS[block])
    members = [d for d in (*CATALOGUE.values(), *REFINEMENTS.values()) if d.block == block]
    lines = [row(heads), "|" + "---|" * len(heads), *(row(cells(each)) for each in members)]
    return "\n".join(lines) + "\n"


def cells(each: Definition) -> tuple[str, ...]:
    """A parameter's row."""
    directional = "yes" if each.directional else "no"
    first = (each.symbol, each.name, each.unit, directional, each.range, each.plausible_range)
    match each.block:
        case "control_card":
            return (*first, each.source)
        case "pump_motor":
            return (*first, each.stands_for or "—", each.source)
        case "refinements":
            return (*first, f"{each.default:g}", each.switch or "—", each.stands_for)


def row(cells: tuple[str, ...]) -> str:
    """Cells between bars."""
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    NOMENCLATURE.write_text(nomenclature(NOMENCLATURE.read_text("utf-8")), "utf-8")
