"""Registering commands, with groups of options spread into their signatures."""

from __future__ import annotations

import inspect
import tomllib
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from swashplate.cli.terminal import RESOURCES, SAVED, say_saved
from swashplate.errors import InputError
from swashplate.units import shown_in

Function = Callable[..., None]


@dataclass(frozen=True)
class DisplayUnits:
    """Units that tables and figures are shown in."""

    units: Annotated[
        str,
        typer.Option(
            metavar="UNIT,UNIT",
            help="Display units, such as rpm,bar. m/min (speed of a rope) needs --drum.",
        ),
    ] = ""
    drum: Annotated[
        float | None, typer.Option(metavar="M", help="Diameter of the drum on the shaft.")
    ] = None


def command(
    app: typer.Typer, name: str, *, examples: str, units: bool = True
) -> Callable[[Function], Function]:
    """Register a command: its docstring is its help, with the examples below the options.

    A parameter whose type is a dataclass stands for the fields of that class, each of them an
    argument or an option. The options --units and --drum are added unless the command shows no
    quantity.
    """

    def register(function: Function) -> Function:
        hints = get_type_hints(function, include_extras=True)
        groups: dict[str, Any] = {
            parameter: hint for parameter, hint in hints.items() if is_dataclass(hint)
        }
        parameters = list[inspect.Parameter]()
        for parameter in inspect.signature(function).parameters.values():
            if parameter.name in groups:
                parameters += _spread(groups[parameter.name])
            else:
                annotation = hints[parameter.name]
                parameters.append(
                    parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY, annotation=annotation)
                )
        if units:
            parameters += _spread(DisplayUnits)

        outputs = {parameter.name for parameter in parameters if _is_output(parameter)}

        @wraps(function)
        def run(**arguments: Any) -> None:
            display = _gathered(DisplayUnits, arguments) if units else DisplayUnits()
            _refuse_inputs_as_outputs(arguments, outputs)
            unit_names = [unit.strip() for unit in display.units.split(",") if unit.strip()]
            for parameter, group in groups.items():
                arguments[parameter] = _gathered(group, arguments)
            SAVED.set([])
            with shown_in(unit_names, display.drum), ExitStack() as resources:
                RESOURCES.set(resources)
                function(**arguments)
            say_saved()

        # Typer reads arguments and options off the signature
        run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
        app.command(name, epilog=_epilog(examples))(run)
        return function

    return register


def _is_output(parameter: inspect.Parameter) -> bool:
    """Whether an option names a file that the command writes."""
    options = getattr(parameter.annotation, "__metadata__", ())
    callbacks = [getattr(option, "callback", None) for option in options]
    return parameter.name == "out" or any(hasattr(each, "writes") for each in callbacks)


def _refuse_inputs_as_outputs(arguments: dict[str, Any], outputs: set[str]) -> None:
    """Refuse to write a file onto one that the same command reads, --force or not."""
    read = list[Path]()
    for name, value in arguments.items():
        if name not in outputs:
            for each in value if isinstance(value, list) else [value]:
                read += _files_named(each)
    for name in outputs:
        path = arguments.get(name)
        if isinstance(path, Path) and path.is_file():
            same = next((each for each in read if path.samefile(each)), None)
            if same is not None:
                raise InputError(
                    f"{path} is read by this command as {same}, so it cannot be its "
                    f"--{name.replace('_', '-')}, with --force or without: choose another path."
                )


def _files_named(value: object) -> list[Path]:
    """Files that an argument names: itself, behind NAME=, and those that a campaign names."""
    if not isinstance(value, str | Path):
        return []
    from swashplate.documents import LARGEST_TOML

    files = list[Path]()
    for text in {str(value), str(value).partition("=")[2]}:
        with suppress(OSError, ValueError):
            if text and Path(text).is_file():
                files.append(Path(text))
    for file in [each for each in files if each.suffix.lower() == ".toml"]:
        with suppress(OSError, ValueError, RecursionError):  # the command says what is wrong
            if file.stat().st_size <= LARGEST_TOML:
                files += _files_within(tomllib.loads(file.read_text("utf-8")), file.parent)
    return files


def _files_within(entry: object, folder: Path) -> list[Path]:
    """Files that the texts of a document name, from its folder."""
    if isinstance(entry, dict):
        entry = [*entry.values()]
    if isinstance(entry, list):
        return [file for each in entry for file in _files_within(each, folder)]
    with suppress(OSError, ValueError):  # a text that cannot be a name
        if isinstance(entry, str) and entry and (folder / entry).is_file():
            return [folder / entry]
    return []


def _spread(group: Any) -> list[inspect.Parameter]:
    """The fields of a group as parameters."""
    hints = get_type_hints(group, include_extras=True)
    return [
        inspect.Parameter(
            field.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=inspect.Parameter.empty if field.default is MISSING else field.default,
            annotation=hints[field.name],
        )
        for field in fields(group)
    ]


def _gathered(group: Any, arguments: dict[str, Any]) -> Any:
    """A group of its fields' arguments, which are taken out."""
    return group(**{field.name: arguments.pop(field.name) for field in fields(group)})


def _epilog(examples: str) -> str:
    """Examples as they stand below a command's options."""
    lines = [f"  {line}" for line in inspect.cleandoc(examples).splitlines()]
    return "\n".join(["Examples:", *lines])
