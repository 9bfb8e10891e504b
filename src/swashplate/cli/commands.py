"""Registering commands, with groups of options spread into their signatures."""

from __future__ import annotations

import inspect
import json
import tomllib
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, NamedTuple, get_type_hints

import typer

from swashplate.cli.terminal import RESOURCES, SAVED, say_saved
from swashplate.documents import LARGEST, LARGEST_TOML
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

        outputs = {each.name: _output_of(each) for each in parameters}

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


class Output(NamedTuple):
    """What a command writes at the path that an option gives."""

    files: tuple[str, ...] = ()
    """Names or patterns of the files in that folder; none if the path is the file."""
    beside: str = ""
    """Argument whose folder it is unless one is given."""

    def written(self, path: Path | None, arguments: Mapping[str, object]) -> list[Path]:
        """Files that are there and would be replaced."""
        if path is None and self.beside:
            path = Path(str(arguments[self.beside])).parent
        if path is None:
            return []
        files = [found for name in self.files for found in path.glob(name)]
        return [file for file in (files if self.files else [path]) if file.is_file()]


def _output_of(parameter: inspect.Parameter) -> Output | None:
    """What an option has the command write; None if nothing."""
    for option in getattr(parameter.annotation, "__metadata__", ()):
        output = getattr(getattr(option, "callback", None), "writes", None)
        if isinstance(output, Output):
            return output
    return Output() if parameter.name == "out" else None


def _refuse_inputs_as_outputs(
    arguments: Mapping[str, object], outputs: Mapping[str, Output | None]
) -> None:
    """Refuse to write a file onto one that the same command reads, --force or not."""
    written = dict[Path, str]()
    for name, output in outputs.items():
        path = arguments.get(name)
        if output is not None and (path is None or isinstance(path, Path)):
            written |= dict.fromkeys(output.written(path, arguments), name)
    if not written:
        return
    read = list[Path]()
    for name, value in arguments.items():
        if outputs.get(name) is None:
            for each in value if isinstance(value, list) else [value]:
                read += _files_named(each)
    for path, name in written.items():
        same = next((each for each in read if path.samefile(each)), None)
        if same is not None:
            raise InputError(
                f"{path} is read by this command as {same}, so --{name.replace('_', '-')} cannot "
                "replace it, with --force or without: choose another path."
            )


FIT = "fit.json"
OF_FOLDER = ("drive.toml", "parameters.toml", "setup.toml", FIT)
"""Files that are read of the folder of a fit, or of the truth of virtual tests."""


def _files_named(value: object) -> list[Path]:
    """Files that an argument names: itself, behind NAME=, those of a fit and of a campaign."""
    if not isinstance(value, str | Path):
        return []
    files = list[Path]()
    for text in {str(value), str(value).partition("=")[2]}:
        with suppress(OSError, ValueError):
            path = Path(text)
            if text and path.is_dir():
                files += [path / name for name in OF_FOLDER if (path / name).is_file()]
            elif text and path.is_file():
                files += [path, *([path.with_name(FIT)] if path.with_name(FIT).is_file() else [])]
    for file in [each for each in files if each.name == FIT]:
        files += _campaign_of_fit(file)
    for file in [each for each in files if each.suffix.lower() == ".toml"]:
        with suppress(OSError, ValueError, RecursionError):  # the command says what is wrong
            if file.stat().st_size <= LARGEST_TOML:
                files += _files_within(tomllib.loads(file.read_text("utf-8")), file.parent)
    return files


def _campaign_of_fit(file: Path) -> list[Path]:
    """The campaign that a stored fit names, if it is still there."""
    with suppress(OSError, ValueError, RecursionError):  # the command says what is wrong
        if file.stat().st_size <= LARGEST:
            content = json.loads(file.read_text("utf-8"))
            return _files_within([content.get("campaign")], file.parent)
    return []


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
