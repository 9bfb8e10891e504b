"""Arguments and options that several commands share, and groups of them that go together.

A command whose parameter is one of the groups here gets the group's fields as options: `command`
spreads them in its signature and gathers them again.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_type_hints

import typer
from typer.models import ParameterInfo

from swashplate.cli.terminal import FORCED, RESOURCES, SAVED, check_output, note, say_saved
from swashplate.tables import FIGURE, TABLE, Form
from swashplate.units import show_rod, shown_in

if TYPE_CHECKING:
    from swashplate.drive import Drive

Interpolation = Literal["linear", "previous"]
Start = Literal["rest", "steady"]


def option(help: str, *names: str, metavar: str | None = None, **more: Any) -> Any:
    """An option of Typer's, its help first; one without a value is a switch by its name."""
    return typer.Option(*names, help=help, metavar=metavar, **more)


def argument(metavar: str, help: str) -> Any:
    """A positional argument of Typer's."""
    return typer.Argument(metavar=metavar, help=help, show_default=False)


AxisName = Annotated[
    str | None, option("The axis, where the campaign has several.", metavar="NAME")
]
TableFile = Annotated[
    Path | None,
    option("Write all numbers, in SI, to a .csv or .parquet file.", metavar="FILE"),
    TABLE,
]
FigureFile = Annotated[
    Path | None, option("Draw a figure: .png, .svg or .pdf.", metavar="FILE"), FIGURE
]
SetFile = Annotated[
    Path | None,
    option("Write the changed drive as a parameter file.", metavar="SET.toml"),
    Form("a parameter file", (".toml",)),
]
Required = Annotated[
    float, option("Largest error of a prediction, in % of the signal's range.", min=0.0)
]

SHARED = """
  begin --from AXIS|SET.toml: Begin at this drive instead of the campaign's.
  clip: Clip a voltage beyond ±10 V instead of refusing it.
  measured NAME=COLUMN: A column of FILE, or a number in SI, for pump_speed (1 at the speed of Z10),
      load_torque or supply_pressure. May be repeated.
  column NAME: Column of the voltage in FILE.
  command MANEUVER|FILE: A maneuver such as step:9 or "step +9 V", or a log with columns of time and
      voltage: text such as .csv, .parquet, .mat, .h5, .tdms or .mf4; a column may carry its unit:
      'time \\[ms]'.
  drive AXIS|SET.toml: A packaged drive (see 'swashplate axes'), your own TOML file, or the folder
      of a fit.
  factors --scale NAME=FACTOR: A factor on a parameter or a lever, after --set: Z16=1.5,
      orifice=1.5. May be repeated.
  force: Replace older files.
  interpolation: The voltage between rows or samples: linear, or zero-order hold. Must be given with
      a FILE.
  levers --lever LEVER[=LOW/HIGH]: A lever or parameter, by itself or with its lowest and highest
      factor; may be repeated. 'swashplate whatif --levers' lists them.
  model FILE.py: A Python file with a model of your own and what is free of it. The file is
      executed: name only one that you trust.
  path CAMPAIGN.toml: The campaign file, beside its logs.
  rate HZ: Samples a second, 10 to 100000.
  seed: Of everything drawn at random.
  setup NAME|FILE: What is free: a packaged fit configuration (hoist, slew, luff, neutral ...) or
      your own TOML file; by default the one of the axis's drive.
  start: Start from rest at 0 V, or settled at the first voltage.
  time_column NAME: Column of the time in FILE.
  units UNIT,UNIT: Units to show, such as rpm,bar; m/min is of rope, with --drum.
  values --set NAME=VALUE: Another value for a parameter: Z16=1.2e-4 in SI, Z16=1.2e-4/1.5e-4 for
      plus and minus, Z16_plus=0.12mm with a unit. May be repeated.
"""
"""Parameters that several commands have, described as in a command's own docstring."""


@dataclass(frozen=True)
class DriveChoice:
    """A drive as the command line names it, with values set and then scaled."""

    drive: str
    values: list[str] | None = None
    factors: list[str] | None = None

    @cached_property
    def chosen(self) -> Drive:
        """The drive."""
        from swashplate.cli.words import drive_of

        made = drive_of(self.drive, self.values or (), self.factors or ())
        if made.parameters.motion == "rod":
            show_rod()
        return made

    @property
    def title(self) -> str:
        """Its name for a heading; one from a file of another name goes by that, too."""
        path, name = Path(self.drive), self.chosen.name
        return name if path.stem == name else f"{path.name or self.drive} ({name})"

    @property
    def changes(self) -> list[str]:
        """A line for each parameter that is not as its file has it."""
        from swashplate.cli.words import changes_between, parameters_of

        return changes_between(parameters_of(self.drive), self.chosen.parameters)

    def warn(self) -> None:
        """Say it if the drive's fit calls it not usable, as its title does, or left limits open."""
        _, found, why = self.chosen.parameters.title.partition("Not usable")
        if found:
            note(f"! The fit of this drive says: {found}{why}.")
        self._warn_unreached()

    def _warn_unreached(self) -> None:
        sentence = self.chosen.parameters.unreached_sentence()
        if sentence:
            note(f"! {sentence}")

    def note(self, heading: str, *, unreached: bool = True) -> None:
        """Print a heading, what is changed, and which limits the drive's tests left open."""
        for line in (heading, *self.changes):
            note(line)
        if unreached:
            self._warn_unreached()


@dataclass(frozen=True)
class Sampling:
    """How a command is sampled, and read where it is a file; no options say how a run begins."""

    rate: float = 512.0
    interpolation: Interpolation | None = None
    time_column: str = "time"
    column: str = "voltage"
    start: Start = field(default="rest", init=False)
    clip: bool = field(default=False, init=False)
    measured: list[str] | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        """Refuse a rate out of range, before anything is sampled."""
        from swashplate.equations.marching.record import least_substeps

        least_substeps(self.rate)


@dataclass(frozen=True)
class Simulating(Sampling):
    """How a command is sampled, and simulated."""

    start: Start = "rest"
    clip: bool = False
    measured: list[str] | None = None


@dataclass(frozen=True)
class Replacing:
    """Whether files that are there may be replaced."""

    force: bool = False


@dataclass(frozen=True)
class ShownUnits:
    """Units that tables and figures are shown in."""

    units: str = ""
    drum: Annotated[float | None, option("Diameter of the drum on the shaft.", metavar="M")] = None


_ENTRY = re.compile(r"^  (\w+)((?: --[\w/-]+)*) ?([A-Z\[]\S*)?: (.*(?:\n   .*)*)", re.MULTILINE)
"""An entry of a docstring's options."""
FOLDERS = {"out", "c"}
"""Parameters of commands that write folders; those of files have a form."""
UNITLESS = {"axes", "damping", "doctor", "init", "schema"}
"""Commands that show no quantity, or only seconds."""


def command(
    app: typer.Typer, name: str, panel: str | None = None
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Register a command: its groups spread, --force and units added.

    Its docstring ends with "Options:", an entry for each parameter that no shared type here
    describes: name, flag if it has another, metavar, colon, help; a group's docstring may end so,
    too. Parameters before the ``*`` are arguments. Examples stand behind them, and are shown below
    the options. A parameter whose type has a `Form` is a file, which must be free beforehand.
    """

    def register(function: Callable[..., None]) -> Callable[..., None]:
        text = inspect.cleandoc(function.__doc__ or "")
        text, head, shown = text.partition("\n\nFor example:")
        text, _, entries = text.partition("\n\nOptions:\n")
        hints = get_type_hints(function, include_extras=True)
        given = inspect.signature(function).parameters.values()
        groups = {each.name: hints[each.name] for each in given if is_dataclass(hints[each.name])}
        forms = {
            name: form
            for name, hint in hints.items()
            for form in getattr(hint, "__metadata__", ())
            if isinstance(form, Form)
        }
        kinds = [kind for group in groups.values() for kind in group.__mro__[::-1]]
        shared = [inspect.cleandoc(each.__doc__ or "").partition("Options:\n")[2] for each in kinds]
        found = _ENTRY.finditer("\n".join([SHARED, *shared, entries]))
        said = {each[1]: each for each in found}
        flat = list[inspect.Parameter]()
        for each in given:
            own = [each.replace(annotation=hints[each.name])]
            flat += _spread(groups[each.name]) if each.name in groups else own
        flat += _spread(Replacing) if forms or FOLDERS & {each.name for each in given} else []
        flat += _spread(ShownUnits) if name not in UNITLESS else []
        flat = [_described(each, said) for each in flat]

        def run(**words: Any) -> None:
            units, drum = words.pop("units", ""), words.pop("drum", None)
            FORCED.set(words.pop("force", False))
            SAVED.set([])
            for name, form in forms.items():
                check_output(words[name], form)
            for name, group in groups.items():
                words[name] = group(**{each.name: words.pop(each.name) for each in _spread(group)})
            shown = [unit.strip() for unit in units.split(",") if unit.strip()]
            with shown_in(shown, drum), ExitStack() as resources:
                RESOURCES.set(resources)
                function(**words)
            say_saved()

        run.__doc__ = text
        run.__wrapped__ = function  # type: ignore[attr-defined]
        # Typer reads the options off the signature, which functions have without declaring it
        run.__signature__ = inspect.Signature(flat)  # type: ignore[attr-defined]
        run.__annotations__ = {each.name: each.annotation for each in flat}
        app.command(name, epilog=f"Examples:{shown}" * bool(head), rich_help_panel=panel)(run)
        return function

    return register


def _described(given: inspect.Parameter, entries: Mapping[str, re.Match[str]]) -> inspect.Parameter:
    """A parameter as Typer reads it, from its entry unless its type describes it."""
    kind, own = given.annotation, entries.get(given.name)
    told = any(isinstance(each, ParameterInfo) for each in getattr(kind, "__metadata__", ()))
    if own is not None and not told:
        flags, metavar, words = own[2].split(), own[3], " ".join(own[4].split())
        flags = flags or ([f"--{given.name}"] if kind is bool else [])
        least = {"min": 0} if kind is int else {}
        # a switch takes nothing, which Typer would show as <bool>
        metavar = metavar or {bool: " ", int: "N", float: "X"}.get(kind)
        more = option(words, *flags, metavar=metavar, **least)
        is_option = given.kind is inspect.Parameter.KEYWORD_ONLY
        kind = Annotated[kind, more if is_option else argument(own[3] or given.name.upper(), words)]
    return given.replace(annotation=kind, kind=inspect.Parameter.KEYWORD_ONLY)


def _spread(group: Any) -> list[inspect.Parameter]:
    """A group's fields as parameters; what must be given is an argument."""
    hints, made = get_type_hints(group, include_extras=True), []
    for each in fields(group):
        must, hint = each.default is MISSING, hints[each.name]
        kind = inspect.Parameter.POSITIONAL_OR_KEYWORD if must else inspect.Parameter.KEYWORD_ONLY
        default = inspect.Parameter.empty if must else each.default
        if each.init:
            made.append(inspect.Parameter(each.name, kind, default=default, annotation=hint))
    return made
