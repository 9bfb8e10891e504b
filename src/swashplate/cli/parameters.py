"""``swashplate axes`` and ``swashplate show``: which drives there are, and their parameters."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING, Annotated

import typer

from swashplate.cli.arguments import DriveWord
from swashplate.cli.inputs import parameters_of
from swashplate.cli.terminal import say, show, table, working

if TYPE_CHECKING:
    from rich.table import Table

    from swashplate.parameters.definitions import Block
    from swashplate.parameters.parameter_set import ParameterSet

AXES_EXAMPLES = """\
Example:
  swashplate axes
"""
SHOW_EXAMPLES = """\
Examples:
  swashplate show hoist
  swashplate show hoist --toml > mine.toml    (a start for your own drive)
"""


def axes() -> None:
    """List the packaged drives, their speeds and control cards."""
    import numpy as np

    from swashplate.drive import Drive
    from swashplate.parameters.files import preset_names

    columns = (">at -10 V", ">at 0 V", ">at +10 V")
    made = table(
        "Settled speeds in deg/s", "name", "drive and card", *columns, wrap="drive and card"
    )
    with working("Reading"):
        for name in preset_names():
            drive = Drive.preset(name)
            speeds = np.degrees(drive.steady_speed([-10.0, 0.0, 10.0]))
            what = f"{drive.parameters.title}\n{drive.parameters.card}"
            made.add_row(name, what, *(f"{speed:z.2f}" for speed in speeds))
            made.add_section()
    show(made)


def show_parameters(
    drive: DriveWord,
    toml: Annotated[
        bool, typer.Option("--toml", help="Print a TOML file, complete and ready to edit.")
    ] = False,
) -> None:
    """Show every parameter of a drive, with its unit and where it comes from.

    A parameter with a plus and a minus value has one for each direction; both
    are magnitudes. Units are SI.
    """
    parameters = parameters_of(drive)
    if toml:
        from swashplate.parameters.files import dump_set

        typer.echo(dump_set(parameters), nl=False)
        return
    say(f"{parameters.name}: {parameters.title}")
    show(
        _block(parameters, "control_card", f"Control card {parameters.card}"),
        _block(parameters, "pump_motor", "Pump and motor"),
    )
    if any(each.definition.block == "refinements" for each in parameters.values()):
        show(_block(parameters, "refinements", "Refinements"))
    rate = "any rate" if parameters.rate is None else f"{parameters.rate:g} Hz"
    say(
        f"Variants of the equations: pressure_root {parameters.pressure_root}, coulomb_sign "
        f"{parameters.coulomb_sign}, card_switch {parameters.card_switch}, card's filter for "
        f"{rate}, options {', '.join(sorted(parameters.options)) or 'none'}"
    )


def _block(parameters: ParameterSet, block: Block, title: str) -> Table:
    """One block's parameters, under the source that those next to each other share."""
    made = table(title, "symbol", "name", ">plus", ">minus", "unit", "status", wrap="name")
    members = [each for each in parameters.values() if each.definition.block == block]
    for source, group in groupby(members, key=lambda each: each.source):
        made.add_section()
        if source:
            made.add_row("", f"{source}:", style="italic")
        for each in group:
            plus, *minus = (f"{value:.6g}" for value in each.values)
            made.add_row(each.symbol, each.name, plus, "".join(minus), each.unit, each.status)
    return made
