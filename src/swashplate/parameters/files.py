"""Parameter sets as TOML files: the packaged ones and the user's."""

from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from swashplate.documents import parse_toml, read_text, validated
from swashplate.entries import (
    SCHEMA,
    FileTable,
    FormerlyFormat,
    Name,
    NotNegative,
    Number,
    Positive,
)
from swashplate.errors import InputError, MissingFileError, ParameterError, meant
from swashplate.machine import Replacement
from swashplate.machine.plausible import check_plausible
from swashplate.machine.replacement import replaced_once, replacement_at, uses_equation
from swashplate.parameters.definitions import Block, Definition, definitions_of, options_of
from swashplate.parameters.parameter_set import (
    CardSwitch,
    CoulombSign,
    LoggedCommand,
    Motion,
    Pair,
    Parameter,
    ParameterSet,
    PressureRoot,
    Status,
    meant_value,
)
from swashplate.units import to_si

if TYPE_CHECKING:
    from tomlkit.items import InlineTable

# --- what stands in a file ------------------------------------------------------------------------

TwoNumbers = Annotated[list[Number], Field(min_length=2, max_length=2)]


class ParameterEntry(FileTable):
    """One parameter: ``Z16 = { value = [1.2e-4, 1.5e-4], unit = "m", source = "table 7.2" }``."""

    value: Number | TwoNumbers
    unit: str
    source: str = ""
    status: Status = "user"
    bounds: TwoNumbers | None = None


class EquationPlaces(FileTable):
    """An equation in the place of another one, each as ``module:name``."""

    old: str
    new: str
    parameters: str | None = None


class CommandEntry(FileTable):
    """How the logs of a fitted drive hold its command: sign * (scale * number + offset)."""

    column: str
    unit: str = ""
    scale: Number = 1.0
    offset: Number = 0.0
    sign: Literal[1, -1] = 1


class ModelOptions(FileTable):
    """Variants of the equations; the defaults are those the published values belong to."""

    pressure_root: PressureRoot = "published"
    coulomb_sign: CoulombSign = "smooth"
    card_switch: CardSwitch = "sampled"
    rate: Positive | None = None
    """Samples a second that the recursion of the card's filter belongs to; none is the filter's
    differential equation, for any rate."""
    options: list[str] | None = None
    """Terms of the pump that count; if they are not given, those whose parameters are not 0."""
    equations: list[EquationPlaces] = Field([])
    """User-defined equations in place of the package's, each as ``module:name``."""
    motion: Motion = "shaft"
    unreached: dict[str, NotNegative] = Field({})
    """Limits that the tests never reached, by column, and how far they went. [SI]"""
    tested: Annotated[list[NotNegative], Field(min_length=2, max_length=2)] | None = None
    """Largest command of the tests each way, 0 for a way that none goes; none without tests. [V]"""


class CardFile(FormerlyFormat):
    """A control card by itself, so that several sets can use it."""

    name: Name
    title: str = ""
    rate: Positive | None = None
    """Of the recursion that its filter belongs to."""
    control_card: dict[str, ParameterEntry]


class SetFile(FormerlyFormat):
    """A whole drive; `control_card` is the name of a packaged card or the card's own table."""

    name: Name
    title: str = ""
    control_card: str | dict[str, ParameterEntry]
    card: Name = ""
    """Name of a card that is given by its own table."""
    pump_motor: dict[str, ParameterEntry]
    model: ModelOptions = ModelOptions()
    refinements: dict[str, ParameterEntry] = Field({})
    """Options beyond Kruse's equations; all are off by default."""
    command: CommandEntry | None = None


# --- reading --------------------------------------------------------------------------------------

AXES = ("hoist", "slew", "luff")  # Kruse's three axes.
SETS = files("swashplate.parameters").joinpath("sets")


NEUTRAL = "neutral"
"""The packaged set that is not that of a machine, but an initial set for any."""


def preset_names() -> tuple[str, ...]:
    """Names of the packaged sets, Kruse's axes first."""
    names = {path.name.removesuffix(".toml") for path in SETS.iterdir() if path.is_file()}
    return (*AXES, *sorted(names - set(AXES) - {"__init__.py"}))


@cache
def load_preset(name: str) -> ParameterSet:
    """A packaged parameter set; the `ParameterError` for an unknown name lists the right ones."""
    if name not in preset_names():
        names = preset_names()
        raise ParameterError(
            f"There is no packaged parameter set '{name}'{meant(str(name), names)}; there are "
            f"{', '.join(names)}; a parameter file is read with Drive.from_toml."
        )
    return read_set(SETS.joinpath(f"{name}.toml").read_text("utf-8"), f"{name}.toml")


def load_set(path: str | Path) -> ParameterSet:
    """A parameter set from a TOML file, or from a fit's folder.

    A `FileError` says that there is no such file, or that the folder holds no drive; a
    `ParameterError` names file, parameter and rule.
    """
    file = fitted_drive(path) if Path(path).is_dir() else Path(path)
    return read_set(read_text(file), str(file))


FITTED_DRIVE, FITTED_NUMBERS = "drive.toml", "parameters.toml"
"""In a folder that a fit wrote: the drive, or the numbers of a user-defined model."""


def fitted_drive(folder: str | Path) -> Path:
    """The parameter file in a fit's folder; a `MissingFileError` if it holds no drive."""
    file = Path(folder) / FITTED_DRIVE
    if file.is_file():
        return file
    if (Path(folder) / FITTED_NUMBERS).is_file():
        raise MissingFileError(
            f"{folder} is the fit of a user-defined model: name its file as well, such as --model "
            "valve.py, where a command has that option."
        )
    raise MissingFileError(
        f"There is no {FITTED_DRIVE} in {folder}: give a folder that 'swashplate fit' or "
        "Identification.save wrote, or a parameter file."
    )


def set_file(name: str | Path) -> Path | None:
    """The parameter file that a name means: a path, or a fit's folder; None for a packaged set.

    A packaged name goes before a file or folder of that name, which can be written ``./hoist``. A
    `MissingFileError` says that there is nothing of that name.
    """
    path = Path(name)
    if str(name) in preset_names():
        return None
    if path.is_dir():
        return fitted_drive(path)
    if path.suffix.lower() == ".toml" or len(path.parts) > 1 or path.is_file():
        return path
    raise MissingFileError(
        f"There is no packaged set, file or folder '{name}'{meant(str(name), preset_names())}; the "
        f"packaged sets are {', '.join(preset_names())}."
    )


def named_set(name: str | Path) -> ParameterSet:
    """The packaged set of a name, the set in a TOML file, or the one in a fit's folder.

    Raises
    ------
    FileError
        If there is no packaged set, file or folder of that name.
    ParameterError
        If an entry of the file is wrong.
    """
    file = set_file(name)
    return load_preset(str(name)) if file is None else load_set(file)


def read_set(text: str, origin: str) -> ParameterSet:
    """A parameter set from TOML text; `origin` names it in errors."""
    contents = validated(parse_toml(text, origin), SetFile, origin)
    model = contents.model
    rate = model.rate
    if isinstance(contents.control_card, str):
        card = _packaged_card(contents.control_card, origin)
        card_name = card.name
        entries = card.control_card
        rate = rate or card.rate
    else:
        card_name = contents.card or f"{contents.name} card"
        entries = contents.control_card
    equations = _replacements(model.equations, origin)
    blocks: dict[Block, Mapping[str, ParameterEntry]] = {
        "control_card": entries,
        "pump_motor": contents.pump_motor,
        "refinements": contents.refinements,
    }
    parameters: dict[str, Parameter] = {}
    kinds = (equation.parameters for equation in equations)
    try:
        definitions = definitions_of(tuple(kind for kind in kinds if kind is not None))
        for column in model.unreached:
            definitions.find(column)
        for block, table in blocks.items():
            for symbol, entry in table.items():
                definition = definitions.find(symbol)
                if symbol != definition.symbol or definition.block != block:
                    raise ParameterError(f"[{block}] has no parameter '{symbol}'.")
                parameters[symbol] = parameter_of(definition, entry)
    except ParameterError as error:
        raise ParameterError(f"{origin}: {error}") from None
    values = {symbol: parameter.values[0] for symbol, parameter in parameters.items()}
    return ParameterSet(
        name=contents.name,
        title=contents.title,
        card=card_name,
        parameters=parameters,
        pressure_root=model.pressure_root,
        coulomb_sign=model.coulomb_sign,
        card_switch=model.card_switch,
        rate=rate,
        options=options_of(values) if model.options is None else frozenset(model.options),
        equations=equations,
        motion=model.motion,
        unreached=model.unreached,
        tested=None if model.tested is None else (model.tested[0], model.tested[1]),
        command=_logged_command(contents.command, origin),
    )


def _logged_command(entry: CommandEntry | None, origin: str) -> LoggedCommand | None:
    """How logs hold the command, its unit and scale checked."""
    if entry is None:
        return None
    if entry.scale == 0.0:
        raise ParameterError(f"{origin}: [command] scale is 0, which leaves nothing of it.")
    try:
        to_si(1.0, entry.unit or "V", "V", "[command] unit")
    except InputError as error:
        raise ParameterError(f"{origin}: {error}") from None
    return LoggedCommand(**entry.model_dump())


def _replacements(entries: Sequence[EquationPlaces], origin: str) -> tuple[Replacement, ...]:
    """The equations that stand in the place of a drive's own."""
    if not entries:
        return ()
    from swashplate.models.drive import drive, pump_drive

    replacements = []
    model = drive
    pump_model = pump_drive
    for entry in entries:
        try:
            replacement = replacement_at(entry.model_dump(exclude_none=True))
            model = replaced_once(model, replacement)
            if uses_equation(pump_model, replacement.old):
                pump_model = replaced_once(pump_model, replacement)
            elif replacement.parameters is not None:
                raise InputError(f"{entry.old} is an equation of the card and takes no parameters.")
        except (ImportError, InputError) as error:
            raise ParameterError(f"{origin}: [model] equations: {error}") from None
        replacements.append(replacement)
    return tuple(replacements)


def _packaged_card(name: str, origin: str) -> CardFile:
    cards = SETS.joinpath("cards")
    names = sorted(path.name.removesuffix(".toml") for path in cards.iterdir())
    if name not in names:
        raise ParameterError(
            f"{origin}: there is no packaged control card '{name}'; there are "
            f"{', '.join(names)}, or give the card's own [control_card] table."
        )
    text = cards.joinpath(f"{name}.toml").read_text("utf-8")
    return validated(parse_toml(text, f"{name}.toml"), CardFile, f"{name}.toml")


def parameter_of(definition: Definition, entry: ParameterEntry) -> Parameter:
    """A parameter from its entry, in SI; a `ParameterError` if it does not fit the definition."""
    title = f"{definition.symbol} ({definition.name})"
    stated = entry.value if isinstance(entry.value, list) else [entry.value]
    try:
        numbers, bounds = (
            tuple(to_si(value, entry.unit, definition.unit, title) for value in values)
            for values in (stated, entry.bounds or ())
        )
    except InputError as error:
        raise ParameterError(str(error)) from None
    if len(numbers) == 2 and not definition.directional:
        raise ParameterError(f"{title} has one value, not a plus and a minus one.")
    change = numbers if len(numbers) == 2 else numbers[0]
    value = meant_value(definition.symbol, definition, change)
    check_plausible(f"a bound of {definition.symbol}", definition, *bounds)
    return Parameter(definition, value, entry.source, entry.status, bounds or None)  # type: ignore[arg-type]


# --- writing --------------------------------------------------------------------------------------


def dump_set(parameters: ParameterSet) -> str:
    """A parameter set as TOML text that `read_set` turns back into an equal set."""
    from tomlkit import comment, document, dumps

    blocks: dict[str, dict[str, object]] = {"model": _model_entries(parameters)}
    for symbol, parameter in parameters.items():
        blocks.setdefault(parameter.definition.block, {})[symbol] = _parameter_entry(parameter)
    text = document()
    text.add(comment("swashplate parameter set; SI units; [plus, minus] as magnitudes"))
    text.add("schema", SCHEMA)
    for name in ("name", "title", "card"):
        text.add(name, getattr(parameters, name))
    if parameters.command is not None:
        blocks["command"] = parameters.command._asdict()
    for block, entries in blocks.items():
        text.add(block, entries)
    return dumps(text)


def _model_entries(parameters: ParameterSet) -> dict[str, object]:
    """Entries of a set's table [model]."""
    from tomlkit import inline_table

    options: dict[str, object] = {
        name: getattr(parameters, name) for name in ("pressure_root", "coulomb_sign", "card_switch")
    }
    if parameters.rate is not None:
        options["rate"] = parameters.rate
    if parameters.options != options_of(parameters.numbers):
        options["options"] = sorted(parameters.options)
    if parameters.equations:
        options["equations"] = [equation.places for equation in parameters.equations]
    if parameters.motion != "shaft":
        options["motion"] = parameters.motion
    if parameters.unreached:
        unreached = inline_table()
        unreached.update(parameters.unreached)
        options["unreached"] = unreached
    if parameters.tested is not None:
        options["tested"] = list(parameters.tested)
    return options


def _parameter_entry(parameter: Parameter) -> "InlineTable":
    """A parameter as an inline table."""
    from tomlkit import inline_table

    entry = inline_table()
    entry.append(
        "value",
        list(parameter.values) if isinstance(parameter.value, Pair) else parameter.value,
    )
    entry.append("unit", parameter.unit)
    if parameter.source:
        entry.append("source", parameter.source)
    entry.append("status", parameter.status)
    if parameter.own_bounds is not None:
        entry.append("bounds", list(parameter.own_bounds))
    return entry
