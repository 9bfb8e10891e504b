"""Arguments and options that several commands share, each with its one help text."""

from pathlib import Path
from typing import Annotated

import typer

from swashplate.cli.inputs import Interpolation, Start

DriveWord = Annotated[
    str,
    typer.Argument(
        metavar="AXIS|SET.toml",
        help="A packaged drive (see 'swashplate axes'), your own TOML file, or the folder of a "
        "fit.",
        show_default=False,
    ),
]
CampaignPath = Annotated[
    Path,
    typer.Argument(metavar="CAMPAIGN.toml", help="The campaign file, beside its logs."),
]
AxisName = Annotated[
    str | None,
    typer.Option(help="The axis, where the campaign has several.", show_default=False),
]
OwnModel = Annotated[
    Path | None,
    typer.Option(
        "--model",
        help="A Python file with a model of your own and what is free of it.",
        metavar="FILE.py",
        show_default=False,
    ),
]
Values = Annotated[
    list[str] | None,
    typer.Option("--set", help="As in 'swashplate simulate'.", metavar="NAME=VALUE"),
]
Factors = Annotated[
    list[str] | None,
    typer.Option("--scale", help="As in 'swashplate simulate'.", metavar="NAME=FACTOR"),
]
Rate = Annotated[float, typer.Option(help="Samples a second, 10 to 100000.", metavar="HZ")]
FileInterpolation = Annotated[
    Interpolation | None,
    typer.Option(help="Of a FILE, as in 'swashplate simulate'.", show_default=False),
]
TimeColumn = Annotated[str, typer.Option(help="Column of the time in FILE.", metavar="NAME")]
VoltageColumn = Annotated[str, typer.Option(help="Column of the voltage in FILE.", metavar="NAME")]
StartFrom = Annotated[
    Start, typer.Option(help="Start from rest at 0 V, or settled at the first voltage.")
]
Clip = Annotated[
    bool, typer.Option("--clip", help="Clip a voltage beyond ±10 V instead of refusing it.")
]
Figure = Annotated[
    Path | None, typer.Option(help="Draw a figure: .png, .svg or .pdf.", metavar="FILE")
]
