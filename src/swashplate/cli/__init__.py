"""The command line: parse, call, print.

What takes long to import is imported inside the command that needs it, so that
``swashplate --help`` is instant.
"""

import gc
import io
import os
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
    doctor,
    excite,
    fit,
    full_order,
    guess,
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
  swashplate limits fitted/drive.toml step:9          what limits it
  swashplate whatif hoist --scale orifice=1.5 --maneuver step:9
  swashplate full-order hoist step:9                  is one state enough
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


app.command("demo", epilog=demo.EXAMPLES, rich_help_panel="Everything at once")(demo.demo)
app.command("tour", epilog=tour.EXAMPLES, rich_help_panel="Everything at once")(tour.tour)
app.command("simulate", epilog=simulate.EXAMPLES, rich_help_panel="Simulate")(simulate.simulate)
app.command("compare", epilog=compare.EXAMPLES, rich_help_panel="Simulate")(compare.compare)
app.command("axes", epilog=parameters.AXES_EXAMPLES, rich_help_panel="Simulate")(parameters.axes)
app.command("show", epilog=parameters.SHOW_EXAMPLES, rich_help_panel="Simulate")(
    parameters.show_parameters
)
app.command("rig", epilog=rig.EXAMPLES, rich_help_panel="Test")(rig.rig)
app.add_typer(campaign.app, name="campaign", rich_help_panel="Test")
app.command("guess", epilog=guess.EXAMPLES, rich_help_panel="Identify")(guess.guess)
app.command("excitation", epilog=excite.EXAMPLES, rich_help_panel="Identify")(excite.excitation)
app.command("fit", epilog=fit.EXAMPLES, rich_help_panel="Identify")(fit.fit)
app.command("validate", epilog=validate.EXAMPLES, rich_help_panel="Identify")(validate.validate)
app.command("advise", epilog=advise.EXAMPLES, rich_help_panel="Identify")(advise.advise)
app.command("report", epilog=report.EXAMPLES, rich_help_panel="Identify")(report.report)
app.command("limits", epilog=limits.EXAMPLES, rich_help_panel="Understand")(limits.limits)
app.command("whatif", epilog=whatif.EXAMPLES, rich_help_panel="Understand")(whatif.whatif)
app.command("size", epilog=size.EXAMPLES, rich_help_panel="Understand")(size.size)
app.command("sensitivity", epilog=sensitivity.EXAMPLES, rich_help_panel="Understand")(
    sensitivity.sensitivity
)
app.command("compensate", epilog=compensate.EXAMPLES, rich_help_panel="Understand")(
    compensate.compensate
)
app.command("linearize", epilog=linearize.EXAMPLES, rich_help_panel="Understand")(
    linearize.linearize
)
app.command("bode", epilog=bode.EXAMPLES, rich_help_panel="Understand")(bode.bode)
app.command("full-order", epilog=full_order.EXAMPLES, rich_help_panel="Understand")(
    full_order.full_order
)
app.command("doctor", epilog=doctor.EXAMPLES, rich_help_panel="This installation")(doctor.doctor)


def main() -> None:
    """Run the command line."""
    # the matrices are tall and thin, so that threads of the linear algebra mostly wait for each
    # other; runs, starts and draws are spread over the cores instead
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal without "±" or "−" shows "?"
    # a process that lives for seconds need not look for cycles among what its libraries define:
    # that takes a fifth of a fit, and a second more at the end
    gc.set_threshold(50_000, 20, 50)
    try:
        app(prog_name="swashplate")
    finally:
        gc.freeze()
