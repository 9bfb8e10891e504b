"""The command line: parse, call, print.

A command's module is imported when the command is called, and slow libraries within the function
that needs them, so that no command waits for the imports of another.
"""

import gc
import io
import os
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from swashplate.__about__ import __version__
from swashplate.cli.terminal import Stream, close_output, say_error
from swashplate.errors import FileError, InputError, SwashplateError, UnsoundDataError
from swashplate.stopping import obeying

HELP = """\
Hydrostatic drives: from a joystick's voltage to the speed of the shaft.

A drive is a proportional amplifier (the control card), a pump and a motor.
Included: three identified drives, the hoist, slew and luff axes of a crane,
and a neutral one as a starting point. A command is a file of measured
voltages or a maneuver: a name and its numbers in V, s and Hz.

Maneuvers, and some of the options that may follow their numbers:
  step:9                  9 V from 1 s to 6 s         start, stop, length
  ramp:1                  1 V/s up to 10 V            limit, settle
  sine:6.5,0.1            6.5 V at 0.1 Hz             start, settle, length
  stairs:2/4/0            2, 4 and 0 V, 2 s each      dwell
  chirp:4,0.05,2          4 V from 0.05 to 2 Hz       length
  multisine:4,0.1:2:8     8 sines from 0.1 to 2 Hz    seed, length
  step:9,stop=4,length=8  an option is written name=value
  "step +9 V"             a test of Kruse (2001), by its name
"""
USAGE_ERROR: type[Exception] = typer.BadParameter.__mro__[1]
"""What the parser raises, also of an option that there is not, which it names."""
GONE = {
    "--folds": "give some runs role = 'validate', which the fit does not see and is judged by",
    "--joint": "all numbers are estimated at once",
}
"""What to do in place of options of earlier versions."""
EPILOG = """\
Examples:
  swashplate show                                     the packaged drives
  swashplate simulate hoist step:9 --plot step.png    one run, with a figure
  swashplate simulate hoist step:9 --units rpm,bar    in other units
  swashplate simulate hoist log.csv --interpolation previous --out run.csv
  swashplate show hoist --toml > mine.toml            its file, to edit
  swashplate compare hoist mine.toml                  its differences
  swashplate campaign init logs/*.csv                 tests of your machine
  swashplate rig hoist --out virtual                  tests of a virtual one
  swashplate fit virtual/campaign.toml                the drive from its tests
  swashplate limits fitted/drive.toml step:9          what limits it
  swashplate whatif hoist --scale orifice=1.5 --maneuver step:9
  swashplate full-order hoist step:9                  is one state enough
  swashplate crane run tg3637 --slew 1 --until slew_deg=45
  swashplate export hoist --fmu hoist.fmu             for other programs
  swashplate simulate valve.py step:2                 a machine of your own
  swashplate demo                                     all steps, on a virtual hoist

Files are in SI units and written atomically. Errors: one sentence on standard
error, exit code 2. Other exit codes: 0 done, 1 not usable or does not fit,
130 interrupted by Ctrl-C, 143 by SIGTERM. 'swashplate COMMAND --help' describes
a command.
"""


COMMANDS = {
    "Demonstration": {"demo": "identify"},
    "Simulate": {"simulate": "simulation", "compare": "simulation", "show": "simulation"},
    "Test": {"rig": "campaign", "campaign": "campaign"},
    "Identify": {
        "guess": "campaign",
        "advise": "campaign",
        "fit": "identify",
        "validate": "identify",
        "report": "identify",
    },
    "Analyse": {
        "limits": "analyse",
        "whatif": "analyse",
        "size": "analyse",
        "sensitivity": "analyse",
        "compensate": "analyse",
        "linearize": "analyse",
        "bode": "analyse",
        "full-order": "analyse",
        "crane": "crane",
    },
    "Export": {"export": "exports", "live": "exports"},
    "Installation": {"doctor": "installation"},
}
"""Module of each command, by the panel of the help that lists it."""


PANELS = {name: panel for panel, names in COMMANDS.items() for name in names}


@cache
def _group(module: str) -> Any:
    """The commands of a module, imported now."""
    return typer.main.get_group(import_module(f"swashplate.cli.{module}").app)


@cache
def _loaded(name: str) -> Any:
    """A command of the root, imported now."""
    panel = PANELS[name]
    loaded_command = _group(COMMANDS[panel][name]).commands[name]
    loaded_command.rich_help_panel = panel
    return loaded_command


class _Commands(Mapping[str, Any]):
    """The commands by name, each imported when it is first asked for."""

    def __getitem__(self, name: str) -> Any:
        return _loaded(name)

    def __iter__(self) -> Iterator[str]:
        return iter(PANELS)

    def __len__(self) -> int:
        return len(PANELS)


class Commands(TyperGroup):
    """The commands; an error that a user can correct ends as one sentence and exit code 2.

    Data that make every fit meaningless end with 1, as the verdict on a fit that finds them.
    """

    def __init__(self, **given: Any) -> None:
        super().__init__(**given)
        self.commands: Any = _Commands()

    def list_commands(self, ctx: Any) -> list[str]:
        """Their names, none of them imported."""
        return [*self.commands]

    def invoke(self, ctx: Any) -> Any:
        """Run a command."""
        try:
            return super().invoke(ctx)
        except UnsoundDataError as error:
            say_error(error, "Not usable, as the data are not sound")
            raise typer.Exit(1) from None
        except SwashplateError as error:
            say_error(error)
        except MemoryError:
            say_error(MemoryError("There is not enough memory for that many samples"))
        except USAGE_ERROR as error:
            option = getattr(error, "option_name", "")
            if option not in GONE:
                raise
            say_error(InputError(f"There is no {option} any more: {GONE[option]}"))
        raise typer.Exit(2)


app = typer.Typer(
    cls=Commands,
    help=HELP,
    epilog=EPILOG,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["--help", "-h"]},
)


def _version(requested: bool) -> None:
    if requested:
        typer.echo(f"swashplate {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    """Options before the command."""


def _check_surroundings() -> None:
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "0")
    if not epoch.isdecimal():
        raise InputError(
            f"SOURCE_DATE_EPOCH is '{epoch}', which is not a number of seconds since 1970"
        )
    try:
        Path.cwd()
    except OSError:
        raise InputError("The current folder no longer exists; change to another") from None


def main() -> None:
    """Run the command line."""
    with obeying():
        _run()


def _run() -> None:
    # the matrices are tall and thin, so that threads of the linear algebra mostly wait for each
    # other; runs, starts and draws are spread over the cores instead
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if isinstance(sys.stdout, io.TextIOWrapper):
        # a terminal without "±" or "−" shows "?"
        sys.stdout = Stream.around(sys.stdout, errors="replace")
    if isinstance(sys.stderr, io.TextIOWrapper):
        sys.stderr = Stream.around(sys.stderr, errors=sys.stderr.errors)
    # a process that lives for seconds need not look for cycles among what its libraries define:
    # that takes a fifth of a fit, and a second more at the end
    gc.set_threshold(50_000, 20, 50)
    # figures are drawn into files: what a user's own notebooks draw with is of no concern here
    os.environ.pop("MPLBACKEND", None)
    try:
        _check_surroundings()
        app(prog_name="swashplate")
    except InputError as error:
        say_error(error)
        sys.exit(2)
    except OSError as error:  # such as a full disk of > FILE
        say_error(FileError(f"The output cannot be written: {error.strerror or error}"))
        close_output()  # what is left in the buffer could not be written either
        sys.exit(2)
    finally:
        gc.freeze()
