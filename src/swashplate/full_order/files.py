"""Physical sets as TOML files: the packaged, assumed ones and the user's."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType
from typing import Literal

from pydantic import BaseModel, ConfigDict

from swashplate.documents import parse_toml, read_text, validated
from swashplate.errors import InputError, ParameterError
from swashplate.full_order.completion import from_lumped
from swashplate.full_order.physical_set import PhysicalSet, PhysicalValue, quantity_of
from swashplate.full_order.quantities import CHOICES, Quantity
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
    return read_set(_packaged(name), f"{name}.toml")


@cache
def load_choices(name: str) -> Mapping[str, PhysicalValue]:
    """What a packaged set assumes; everything else in it follows from the lumps.

    Raises
    ------
    ParameterError
        For an unknown name; the sentence lists the right ones.
    """
    origin = f"{name}.toml"
    contents = validated(parse_toml(_packaged(name), origin), PhysicalFile, origin)
    return MappingProxyType(_entries(contents))


def nearest_set(name: str) -> str:
    """Name of the packaged set that a drive of this name is taken to be like: its own, or hoist."""
    return name if name in AXES else AXES[0]


def _packaged(name: str) -> str:
    if name not in AXES:
        raise ParameterError(
            f"There is no packaged physical set '{name}'; there are {', '.join(AXES)}."
        )
    return files("swashplate.full_order").joinpath("sets", f"{name}.toml").read_text("utf-8")


def load_set(path: str | Path) -> PhysicalSet:
    """A physical set from a TOML file; see `PhysicalSet.from_toml`."""
    return read_set(read_text(path), str(path))


def read_set(text: str, origin: str) -> PhysicalSet:
    """A physical set from TOML text; `origin` names it in errors."""
    contents = validated(parse_toml(text, origin), PhysicalFile, origin)
    try:
        entries = _entries(contents)
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


def si_value(quantity: Quantity, number: float, unit: str) -> float:
    """A quantity's number in SI.

    Raises
    ------
    InputError
        If the unit is unknown or measures something else.
    """
    return to_si(number, unit, quantity.unit, f"{quantity.name} ({quantity.meaning})")


def _entries(contents: PhysicalFile) -> dict[str, PhysicalValue]:
    completed = contents.lumps is not None
    return {name: _value(name, entry, completed) for name, entry in contents.physical.items()}


def _value(name: str, entry: Entry, completed: bool) -> PhysicalValue:
    """One entry of a file, in SI."""
    quantity = CHOICES[name] if completed and name in CHOICES else quantity_of(name)
    if entry.bounds is not None:
        raise ParameterError(f"{name} has bounds, but nothing fits a physical set; leave them out.")
    given = entry.value if isinstance(entry.value, list) else [entry.value]
    if len(given) == 2 and not quantity.directional:
        raise ParameterError(f"{name} has one value, not a plus and a minus one.")
    numbers = [si_value(quantity, number, entry.unit) for number in given]
    value = Pair(numbers[0], numbers[-1]) if quantity.directional else numbers[0]
    return PhysicalValue(quantity, value, entry.source, entry.status)
