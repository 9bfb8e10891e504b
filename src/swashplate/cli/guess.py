"""``swashplate guess``: where the fit of an unknown machine begins, read off its logs."""

from __future__ import annotations

import shlex
from math import degrees, isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swashplate.cli.arguments import AxisName, CampaignPath
from swashplate.cli.terminal import note, show, table, working
from swashplate.cli.validate import chosen_axis
from swashplate.errors import InputError
from swashplate.tables import write_text

if TYPE_CHECKING:
    from rich.table import Table

    from swashplate.campaign import Guess

EXAMPLES = """\
Examples:
  swashplate campaign init logs/*.csv --drive neutral
  swashplate guess logs/campaign.toml
  swashplate fit logs/campaign.toml --from logs/start.toml --setup logs/setup.toml
"""


def guess(
    path: CampaignPath = Path("campaign.toml"),
    axis: AxisName = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for start.toml and setup.toml; by default the campaign's.",
            metavar="DIR",
            show_default=False,
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace older files.")] = False,
) -> None:
    """Read a machine's dead zones, gains, limits, delay and lag off its logs.

    For a machine of unknown numbers: needs the command and a speed or a position,
    no current. Writes a drive to start a fit from, start.toml, and what the fit
    is to change within which bounds, setup.toml.
    """
    from swashplate.campaign import Campaign, fit_configuration, guess_drive, guessed_set
    from swashplate.drive import Drive

    with working(f"Reading {path}"):
        campaign = Campaign.from_toml(path)
        chosen = chosen_axis(campaign, axis)
        runs = campaign.select(axis=chosen, role="fit")
        if not runs:
            raise InputError(f"{path}: no run of the axis '{chosen}' has the role 'fit'.")
        folder = path.parent if out is None else out
        start, setup = folder / "start.toml", folder / "setup.toml"
        for each in (start, setup):
            if each.exists() and not force:
                raise InputError(
                    f"{each} exists already; name a folder with --out, or say --force."
                )
        found = guess_drive(runs)
        parameters = guessed_set(found, path.name)
        folder.mkdir(parents=True, exist_ok=True)
        Drive(parameters).to_toml(start)
        write_text(fit_configuration(found, parameters), setup)
    show(guess_table(found))
    note(f"These numbers alone follow the mean speeds to {found.fit_percent:.1f} %.")
    note(f"Start:             {start}")
    note(f"Fit configuration: {setup}")
    note("Then run")
    words = ["swashplate", "fit", str(path), "--from", str(start), "--setup", str(setup)]
    note(f"  {shlex.join(words)}")


def guess_table(found: Guess) -> Table:
    """What was guessed, each way."""
    angular = found.unit == "rad/s"
    unit = "deg/s" if angular else "mm/s"

    def shown(value: float) -> str:
        return (
            f"{degrees(value) if angular else 1e3 * value:.4g}" if isfinite(value) else "not seen"
        )

    made = table(f"Axis {found.axis}, at first sight", "", ">plus", ">minus", "unit")
    ways = [bool(each) for each in found.command]
    rows = (
        ("dead zone", [f"{each:.3g}" for each in found.dead_zone], "V"),
        ("gain beyond it", [shown(each) for each in found.gain], f"{unit}/V"),
        ("top speed", [shown(each) for each in found.top_speed], unit),
        ("acceleration", [shown(each) for each in found.acceleration], f"{unit}²"),
    )
    for name, cells, of in rows:
        made.add_row(
            name, *(c if tried else "not tried" for c, tried in zip(cells, ways, strict=True)), of
        )
    made.add_row("delay", f"{1e3 * found.delay:.3g}", "", "ms")
    made.add_row("lag", f"{1e3 * found.lag:.3g}", "", "ms")
    return made
