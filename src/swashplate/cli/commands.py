"""Registering commands, with groups of options spread into their signatures."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import wraps
from typing import Annotated, Any, get_type_hints

import typer

from swashplate.cli.terminal import RESOURCES, SAVED, say_saved
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

        @wraps(function)
        def run(**arguments: Any) -> None:
            display = _gathered(DisplayUnits, arguments) if units else DisplayUnits()
            for parameter, group in groups.items():
                arguments[parameter] = _gathered(group, arguments)
            unit_names = [unit.strip() for unit in display.units.split(",") if unit.strip()]
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
