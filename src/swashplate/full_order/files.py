"""Physical sets as TOML files: the packaged, assumed ones and the user's."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict

from swashplate.documents import parse_toml, read_text, validated
from swashplate.errors import InputError, ParameterError
from swashplate.full_order.completion import from_lumped
from swashplate.full_order.physical_set import PhysicalSet, PhysicalValue, quantity_of
from swashplate.full_order.quantities import CHOICES
from swashplate.parameters.files import AXES
from swashplate.parameters.files import load_preset as load_parameters
from swashplate.parameters.parameter_set import Pair
from swashplate.parameters.schema import Entry
from swashplate.units import to_si


class PhysicalFile(BaseModel):
    """A physical set; with `lumps`, what is not given follows from a packaged parameter set."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal[1] = 1
    name: str
    title: str = ""
    lumps: str | None = None
    physical: dict[str, Entry]


@cache
def load_preset(name: str) -> PhysicalSet:
    """A packaged set.

    Raises
    ------
    ParameterError
        For an unknown name; the sentence lists the right ones.
    """
    if name not in AXES:
        raise ParameterError(
            f"There is no packaged physical set '{name}'; there are {', '.join(AXES)}."
        )
    text = files("swashplate.full_order").joinpath("sets", f"{name}.toml").read_text("utf-8")
    return read_set(text, f"{name}.toml")


def load_set(path: str | Path) -> PhysicalSet:
    """A physical set from a TOML file; see `PhysicalSet.from_toml`."""
    return read_set(read_text(path), str(path))


def read_set(text: str, origin: str) -> PhysicalSet:
    """A physical set from TOML text; `origin` names it in errors."""
    contents = validated(parse_toml(text, origin), PhysicalFile, origin)
    try:
        entries = {
            name: _value(name, entry, contents.lumps is not None)
            for name, entry in contents.physical.items()
        }
        if contents.lumps is None:
            return PhysicalSet(contents.name, contents.title, entries)
        parameters = load_parameters(contents.lumps)
        return from_lumped(parameters, name=contents.name, title=contents.title, entries=entries)
    except (ParameterError, InputError) as error:
        raise ParameterError(f"{origin}: {error}") from None


def dump_set(physical: PhysicalSet) -> str:
    """A physical set as TOML text that `read_set` turns back into an equal set."""
    from tomlkit import comment, document, dumps, inline_table, table

    text = document()
    text.add(comment("swashplate physical set; SI units; [plus, minus] as magnitudes"))
    text.add("format", 1)
    text.add("name", physical.name)
    text.add("title", physical.title)
    entries = table()
    for name, each in physical.items():
        entry = inline_table()
        pair = isinstance(each.value, Pair)
        entry.append("value", list(each.values) if pair else each.value)
        entry.append("unit", each.quantity.unit)
        if each.source:
            entry.append("source", each.source)
        entry.append("status", each.status)
        entries.add(name, entry)
    text.add("physical", entries)
    return dumps(text)


def _value(name: str, entry: Entry, completed: bool) -> PhysicalValue:
    """One entry of a file, in SI."""
    quantity = CHOICES[name] if completed and name in CHOICES else quantity_of(name)
    if entry.bounds is not None:
        raise ParameterError(f"{name} has bounds, but nothing fits a physical set; leave them out.")
    given = entry.value if isinstance(entry.value, list) else [entry.value]
    if len(given) == 2 and not quantity.directional:
        raise ParameterError(f"{name} has one value, not a plus and a minus one.")
    numbers = [
        to_si(number, entry.unit, quantity.unit, f"{name} ({quantity.meaning})") for number in given
    ]
    value = Pair(numbers[0], numbers[-1]) if quantity.directional else numbers[0]
    return PhysicalValue(quantity, value, entry.source, entry.status)
