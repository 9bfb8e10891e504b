"""The command line: parse, call, print.

What takes long to import is imported inside the command that needs it, so that
``swashplate --help`` is instant.
"""

import io
import sys
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from swashplate.__about__ import __version__
from swashplate.cli import (
    advise,
    bode,
    campaign,
    compare,
    compensate,
    demo,
    excite,
    fit,
    limits,
    linearize,
    parameters,
    report,
    rig,
    sensitivity,
    simulate,
    size,
    tour,
    validate,
    whatif,
)
from swashplate.cli.terminal import say_error
from swashplate.errors import SwashplateError

HELP = """\
Hydrostatic drives: from a joystick's voltage to the speed of the shaft.

A drive is a control card, a pump and a motor. Packaged are three measured
ones, the hoist, slew and luff axes of a crane, and a neutral one to start
your own from. A command is a file of measured voltages or a manoeuvre: a
name and its numbers in V, s and Hz.

Manoeuvres, and some of the options that may follow their numbers:
  step:9                  9 V from 1 s to 6 s         start, stop, length
  ramp:1                  1 V/s up to 10 V            limit, settle
  sine:6.5,0.1            6.5 V at 0.1 Hz             start, settle, length
  stairs:2/4/0            2, 4 and 0 V, 2 s each      dwell
  chirp:4,0.05,2          4 V from 0.05 to 2 Hz       length
  multisine:4,0.1:2:8     8 sines from 0.1 to 2 Hz    seed, length
  step:9,stop=4,length=8  an option is written name=value
  "step +9 V"             a test of the source, by its name
"""
EPILOG = """\
Examples:
  swashplate axes                                     the packaged drives
  swashplate simulate hoist step:9 --plot step.png    one run, drawn
  swashplate simulate hoist log.csv --interpolation previous --out run.csv
  swashplate show hoist --toml > mine.toml            a drive of your own
  swashplate compare hoist mine.toml                  what that changes
  swashplate campaign init logs/*.csv                 tests of your machine
  swashplate rig hoist --out virtual                  tests of a virtual one
  swashplate fit virtual/campaign.toml                the drive behind them
  swashplate demo                                     everything at once

Files are written in SI, whole or not at all. What is wrong is said in one
sentence on standard error, with exit code 2. 'swashplate COMMAND --help'
tells more about a command.
"""


class Commands(TyperGroup):
    """The commands; what a user can mend ends as one sentence and exit code 2."""

    def invoke(self, ctx: Any) -> Any:
        """Run a command."""
        try:
            return super().invoke(ctx)
        except SwashplateError as error:
            say_error(error)
        except MemoryError:
            say_error(MemoryError("There is not enough memory for that many samples"))
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


def _version(asked: bool) -> None:
    if asked:
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


app.command("simulate", epilog=simulate.EXAMPLES)(simulate.simulate)
app.command("compare", epilog=compare.EXAMPLES)(compare.compare)
app.command("linearize", epilog=linearize.EXAMPLES)(linearize.linearize)
app.command("bode", epilog=bode.EXAMPLES)(bode.bode)
app.command("limits", epilog=limits.EXAMPLES)(limits.limits)
app.command("compensate", epilog=compensate.EXAMPLES)(compensate.compensate)
app.command("whatif", epilog=whatif.EXAMPLES)(whatif.whatif)
app.command("sensitivity", epilog=sensitivity.EXAMPLES)(sensitivity.sensitivity)
app.command("size", epilog=size.EXAMPLES)(size.size)
app.command("axes", epilog=parameters.AXES_EXAMPLES)(parameters.axes)
app.command("show", epilog=parameters.SHOW_EXAMPLES)(parameters.show_parameters)
app.add_typer(campaign.app, name="campaign")
app.command("rig", epilog=rig.EXAMPLES)(rig.rig)
app.command("excitation", epilog=excite.EXAMPLES)(excite.excitation)
app.command("advise", epilog=advise.EXAMPLES)(advise.advise)
app.command("fit", epilog=fit.EXAMPLES)(fit.fit)
app.command("validate", epilog=validate.EXAMPLES)(validate.validate)
app.command("report", epilog=report.EXAMPLES)(report.report)
app.command("tour", epilog=tour.EXAMPLES)(tour.tour)
app.command("demo", epilog=demo.EXAMPLES)(demo.demo)


def main() -> None:
    """Run the command line."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal without "±" or "−" shows "?"
    app(prog_name="swashplate")
