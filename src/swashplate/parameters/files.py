"""Parameter sets as TOML files: the packaged ones and the user's."""

from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path

from swashplate.documents import parse_toml, read_text, validated
from swashplate.errors import InputError, ParameterError
from swashplate.parameters.definitions import Block, find, options_of
from swashplate.parameters.parameter_set import Pair, Parameter, ParameterSet
from swashplate.parameters.schema import CardFile, Entry, SetFile
from swashplate.units import to_si

AXES = ("hoist", "slew", "luff")  # The source's three axes.


def preset_names() -> tuple[str, ...]:
    """Names of the packaged sets, the source's axes first."""
    names = {path.name.removesuffix(".toml") for path in _folder("").iterdir() if path.is_file()}
    return (*AXES, *sorted(names - set(AXES) - {"__init__.py"}))


@cache
def load_preset(name: str) -> ParameterSet:
    """A packaged parameter set.

    Raises
    ------
    ParameterError
        For an unknown name; the sentence lists the right ones.
    """
    if name not in preset_names():
        raise ParameterError(
            f"There is no packaged parameter set '{name}'; there are {', '.join(preset_names())}."
        )
    return read_set((_folder("") / f"{name}.toml").read_text("utf-8"), f"{name}.toml")


def load_set(path: str | Path) -> ParameterSet:
    """A parameter set from a TOML file.

    Raises
    ------
    FileError
        If the file cannot be read or is not TOML.
    ParameterError
        If an entry is missing, unknown, malformed or breaks a rule.
    """
    return read_set(read_text(path), str(path))


def read_set(text: str, origin: str) -> ParameterSet:
    """A parameter set from TOML text; `origin` names it in errors."""
    contents = validated(parse_toml(text, origin), SetFile, origin)
    if isinstance(contents.control_card, str):
        card = _load_card(contents.control_card, origin)
        card_name, entries, rate = card.name, card.control_card, card.rate
    else:
        rate = None
        card_name, entries = contents.card or f"{contents.name} card", contents.control_card
    parameters = {
        **_parameters(entries, "control_card", origin),
        **_parameters(contents.pump_motor, "pump_motor", origin),
        **_parameters(contents.refinements, "refinements", origin),
    }
    model = contents.model
    values = {symbol: each.values[0] for symbol, each in parameters.items()}
    return ParameterSet(
        contents.name,
        contents.title,
        card_name,
        parameters,
        model.pressure_root,
        model.coulomb_sign,
        model.card_switch,
        model.rate or rate,
        options_of(values) if model.options is None else frozenset(model.options),
    )


def dump_set(parameters: ParameterSet) -> str:
    """A parameter set as TOML text that `read_set` turns back into an equal set."""
    from tomlkit import comment, document, dumps, table

    text = document()
    text.add(comment("swashplate parameter set; SI units; [plus, minus] as magnitudes"))
    text.add("format", 1)
    text.add("name", parameters.name)
    text.add("title", parameters.title)
    text.add("card", parameters.card)
    options = table()
    options.add("pressure_root", parameters.pressure_root)
    options.add("coulomb_sign", parameters.coulomb_sign)
    options.add("card_switch", parameters.card_switch)
    if parameters.rate is not None:
        options.add("rate", parameters.rate)
    if parameters.options != options_of(parameters.numbers):
        options.add("options", sorted(parameters.options))
    text.add("model", options)
    for block in ("control_card", "pump_motor", "refinements"):
        if all(parameter.definition.block != block for parameter in parameters.values()):
            continue
        entries = table()
        for parameter in parameters.values():
            if parameter.definition.block != block:
                continue
            entries.add(parameter.symbol, written(parameter))
        text.add(block, entries)
    return dumps(text)


def written(parameter: Parameter) -> Mapping[str, object]:
    """A parameter as an entry of a file."""
    from tomlkit import inline_table

    entry = inline_table()
    pair = isinstance(parameter.value, Pair)
    entry.append("value", list(parameter.values) if pair else parameter.value)
    entry.append("unit", parameter.unit)
    if parameter.source:
        entry.append("source", parameter.source)
    entry.append("status", parameter.status)
    if parameter.own_bounds is not None:
        entry.append("bounds", list(parameter.own_bounds))
    return entry


def _folder(name: str):  # type: ignore[no-untyped-def]
    folder = files("swashplate.parameters").joinpath("sets")
    return folder.joinpath(name) if name else folder


def _load_card(name: str, origin: str) -> CardFile:
    cards = _folder("cards")
    names = sorted(path.name.removesuffix(".toml") for path in cards.iterdir())
    if name not in names:
        raise ParameterError(
            f"{origin}: there is no packaged control card '{name}'; there are "
            f"{', '.join(names)}, or give the card's own [control_card] table."
        )
    text = (cards / f"{name}.toml").read_text("utf-8")
    return validated(parse_toml(text, f"{name}.toml"), CardFile, f"{name}.toml")


def _parameters(entries: Mapping[str, Entry], block: Block, origin: str) -> dict[str, Parameter]:
    return {symbol: _parameter(symbol, entry, block, origin) for symbol, entry in entries.items()}


def _parameter(symbol: str, entry: Entry, block: Block, origin: str) -> Parameter:
    try:
        definition = find(symbol)
        if symbol != definition.symbol or definition.block != block:
            raise ParameterError(f"[{block}] has no parameter '{symbol}'.")
        what = f"{symbol} ({definition.name})"
        pair = isinstance(entry.value, list)
        given = entry.value if isinstance(entry.value, list) else [entry.value]
        numbers = [to_si(number, entry.unit, definition.unit, what) for number in given]
        bounds = None
        if entry.bounds is not None:
            low, high = (to_si(b, entry.unit, definition.unit, what) for b in entry.bounds)
            bounds = (low, high)
    except (ParameterError, InputError) as error:
        raise ParameterError(f"{origin}: {error}") from None
    if pair and not definition.directional:
        raise ParameterError(f"{origin}: {what} has one value, not a plus and a minus one.")
    value = Pair(*(numbers if pair else numbers * 2)) if definition.directional else numbers[0]
    return Parameter(definition, value, entry.source, entry.status, bounds)
