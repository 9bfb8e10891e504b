"""Parameter sets as TOML files: the packaged ones and the user's."""

from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, PositiveFloat

from swashplate.documents import parse_toml, read_text, validated
from swashplate.equations.replacement import Replacement, found_at
from swashplate.errors import InputError, ParameterError
from swashplate.parameters.definitions import Block, Definition, declare, find, options_of
from swashplate.parameters.parameter_set import (
    CardSwitch,
    CoulombSign,
    Motion,
    Pair,
    Parameter,
    ParameterSet,
    PressureRoot,
    Status,
    value_of,
)
from swashplate.units import to_si

# --- what stands in a file ------------------------------------------------------------------------

TwoNumbers = Annotated[list[float], Field(min_length=2, max_length=2)]


class Entry(BaseModel):
    """One parameter: ``Z16 = { value = [1.2e-4, 1.5e-4], unit = "m", source = "table 7.2" }``."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    value: float | TwoNumbers
    unit: str
    source: str = ""
    status: Status = "user"
    bounds: TwoNumbers | None = None


class ModelOptions(BaseModel):
    """Variants of the equations; the defaults are those the published values belong to."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    pressure_root: PressureRoot = "published"
    coulomb_sign: CoulombSign = "smooth"
    card_switch: CardSwitch = "sampled"
    rate: PositiveFloat | None = None
    """Samples a second that the recursion of the card's filter belongs to; none is the filter's
    differential equation, for any rate."""
    options: list[str] | None = None
    """Terms of the pump that count; where they are not given, those whose parameters are not 0."""
    equations: list[dict[str, str]] = []
    """One's own equations in place of the package's, each as ``module:name``."""
    motion: Motion = "shaft"


class CardFile(BaseModel):
    """A control card by itself, so that several sets can use it."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal[1] = 1
    name: str
    title: str = ""
    rate: PositiveFloat | None = None
    """Of the recursion that its filter belongs to."""
    control_card: dict[str, Entry]


class SetFile(BaseModel):
    """A whole drive; `control_card` is the name of a packaged card or the card's own table."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal[1] = 1
    name: str
    title: str = ""
    control_card: str | dict[str, Entry]
    card: str = ""
    """Name of a card that is given by its own table."""
    pump_motor: dict[str, Entry]
    model: ModelOptions = ModelOptions()
    refinements: dict[str, Entry] = {}
    """What goes beyond Kruse's equations; all of it is off where it is not given."""


# --- reading and writing --------------------------------------------------------------------------

AXES = ("hoist", "slew", "luff")  # Kruse's three axes.


def preset_names() -> tuple[str, ...]:
    """Names of the packaged sets, Kruse's axes first."""
    names = {path.name.removesuffix(".toml") for path in _folder("").iterdir() if path.is_file()}
    return (*AXES, *sorted(names - set(AXES) - {"__init__.py"}))


@cache
def load_preset(name: str) -> ParameterSet:
    """A packaged parameter set; the `ParameterError` for an unknown name lists the right ones."""
    if name not in preset_names():
        raise ParameterError(
            f"There is no packaged parameter set '{name}'; there are {', '.join(preset_names())}."
        )
    return read_set((_folder("") / f"{name}.toml").read_text("utf-8"), f"{name}.toml")


def load_set(path: str | Path) -> ParameterSet:
    """A parameter set from a TOML file; a `ParameterError` names file, parameter and rule."""
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
    own = _equations(contents.model, origin)
    parameters = {
        **_parameters(entries, "control_card", origin),
        **_parameters(contents.pump_motor, "pump_motor", origin),
        **_parameters(contents.refinements, "refinements", origin),
    }
    model = contents.model
    values = {symbol: each.values[0] for symbol, each in parameters.items()}
    return ParameterSet(
        *(contents.name, contents.title, card_name, parameters),
        *(model.pressure_root, model.coulomb_sign, model.card_switch, model.rate or rate),
        options_of(values) if model.options is None else frozenset(model.options),
        *(own, model.motion),
    )


def _equations(model: ModelOptions, origin: str) -> tuple[Replacement, ...]:
    """One's own equations; a file runs no code, so their module must be imported already."""
    found = []
    for places in model.equations:
        try:
            found.append(found_at(places))
        except (ImportError, InputError, TypeError) as error:
            raise ParameterError(f"{origin}: [model] equations: {error}") from None
        if found[-1].parameters is not None:
            declare(found[-1].parameters)
    return tuple(found)


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
    for name in ("pressure_root", "coulomb_sign", "card_switch"):
        options.add(name, getattr(parameters, name))
    if parameters.rate is not None:
        options.add("rate", parameters.rate)
    if parameters.options != options_of(parameters.numbers):
        options.add("options", sorted(parameters.options))
    if parameters.equations:
        options.add("equations", [each.places for each in parameters.equations])
    if parameters.motion != "shaft":
        options.add("motion", parameters.motion)
    text.add("model", options)
    for block in ("control_card", "pump_motor", "refinements"):
        entries = table()
        for symbol, parameter in parameters.items():
            if parameter.definition.block == block:
                entries.add(symbol, written(parameter))
        if entries:
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


def parameter_of(definition: Definition, entry: Entry) -> Parameter:
    """A parameter from its entry, in SI; what does not fit the definition is a `ParameterError`."""
    what = f"{definition.symbol} ({definition.name})"

    def si(numbers: list[float]) -> tuple[float, ...]:
        try:
            return tuple(to_si(each, entry.unit, definition.unit, what) for each in numbers)
        except InputError as error:
            raise ParameterError(str(error)) from None

    if not isinstance(entry.value, list):
        (number,) = si([entry.value])
        value = value_of(definition.symbol, definition, number)
    elif definition.directional:
        value = Pair(*si(entry.value))
    else:
        raise ParameterError(f"{what} has one value, not a plus and a minus one.")
    bounds = None if entry.bounds is None else si(entry.bounds)
    return Parameter(definition, value, entry.source, entry.status, bounds)  # type: ignore[arg-type]


def _folder(name: str) -> Any:
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
    made = {}
    for symbol, entry in entries.items():
        try:
            definition = find(symbol)
            if symbol != definition.symbol or definition.block != block:
                raise ParameterError(f"[{block}] has no parameter '{symbol}'.")
            made[symbol] = parameter_of(definition, entry)
        except ParameterError as error:
            raise ParameterError(f"{origin}: {error}") from None
    return made
