"""``swashplate size``: the smallest change that meets what is required."""

from __future__ import annotations

import shlex
from math import ceil, copysign
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from swashplate.cli.arguments import DriveWord
from swashplate.cli.inputs import drive_of, maneuver_of, title_of
from swashplate.cli.levers import ranges_from
from swashplate.cli.outputs import check_outputs
from swashplate.cli.terminal import note, say, show, table, working
from swashplate.errors import InputError

if TYPE_CHECKING:
    from rich.table import Table

    from swashplate.analysis.outcomes import Wanted
    from swashplate.analysis.sizing import Requirements, Sizing
    from swashplate.drive import Drive

EXAMPLES = """\
Examples:
  swashplate size hoist --speed-deg-s 250 --lever pump
  swashplate size hoist --acceleration-deg-s2 200 --lever orifice=1/2 --lever pump=1/1.5
  swashplate size hoist --tracking-deg-s 19 --maneuver sine:9,0.1 --out larger.toml
"""
Direction = Literal["both", "positive", "negative"]
LEVERS = ("orifice", "pump")


def size(
    drive: DriveWord,
    speed_deg_s: Annotated[
        float | None,
        typer.Option(help="Speed that is required.", metavar="DEG/S", show_default=False),
    ] = None,
    acceleration_deg_s2: Annotated[
        float | None,
        typer.Option(
            "--acceleration-deg-s2",
            help="Acceleration that is required, after a full step from rest.",
            metavar="DEG/S2",
            show_default=False,
        ),
    ] = None,
    tracking_deg_s: Annotated[
        float | None,
        typer.Option(
            help="Largest RMS error that is allowed while following the manoeuvre.",
            metavar="DEG/S",
            show_default=False,
        ),
    ] = None,
    maneuver: Annotated[
        str | None,
        typer.Option(
            help="What is to be followed: the speed in proportion to this manoeuvre's voltage, at "
            "the ratio of the drive as it is. Each candidate is commanded in proportion to it, at "
            "its own ratio.",
            metavar="NAME",
            show_default=False,
        ),
    ] = None,
    direction: Annotated[
        Direction, typer.Option(help="Where speed and acceleration are required.")
    ] = "both",
    levers: Annotated[
        list[str] | None,
        typer.Option(
            "--lever",
            help="A lever that may be moved, with its lowest and highest factor, 0.5/2 unless "
            "given; may be repeated. By default orifice and pump.",
            metavar="LEVER[=LOW/HIGH]",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Write the changed drive as a parameter file.", metavar="SET.toml"),
    ] = None,
) -> None:
    """Find the smallest change that meets what is required.

    Smallest is the least sum of squares of the changes, each in per cent. What
    cannot be met is refused, with what can be reached.
    """
    from swashplate.analysis.outcomes import proportional_speed, wanted
    from swashplate.analysis.sizing import WIDEST, Requirements
    from swashplate.analysis.sizing import size as sized

    check_outputs((out, None))
    if (tracking_deg_s is None) != (maneuver is None):
        raise InputError("--tracking-deg-s and --maneuver belong together: give both or neither.")
    required = Requirements(
        _radians(speed_deg_s),
        _radians(acceleration_deg_s2),
        _radians(tracking_deg_s),
        direction,
    )
    with working("Sizing"):
        chosen = drive_of(drive)
        follow = None
        if maneuver is not None:
            follow = wanted(proportional_speed(chosen, maneuver_of(maneuver, chosen).sample()))
        found = sized(chosen, required, ranges_from(levers or LEVERS, WIDEST), follow=follow)
    if out is not None:
        found.drive.to_toml(out)
    note(title_of(drive, chosen))
    show(_levers(found), _performance(found, required))
    if found.change == 0.0:
        say("The drive meets it as it is; nothing needs to be changed.")
    else:
        words = ["swashplate", "whatif", drive]
        for name, factor in _rounded(found, chosen, required, follow).items():
            words += ["--scale", f"{name}={factor:.9g}"]
        note(f"See it over a command: {shlex.join(words)}")
    if out is not None:
        note(f"Changed drive: {out}")


def _rounded(
    found: Sizing, drive: Drive, required: Requirements, follow: Wanted | None
) -> dict[str, float]:
    """Factors that someone can type: short, and still enough.

    Each is rounded away from 1, to as few decimals, four or more, as meet what is required.
    """
    from swashplate.analysis.outcomes import performance
    from swashplate.analysis.whatif import pulled

    moved = {name: factor for name, factor in found.factors.items() if factor != 1.0}
    for decimals in range(4, 9):
        factors = {name: _away_from_one(factor, decimals) for name, factor in moved.items()}
        after = performance(pulled(drive, factors), follow, direction=required.direction)
        if min(required.slacks(after).values()) >= 0.0:
            return factors
    return moved


def _away_from_one(factor: float, decimals: int) -> float:
    # round() drops what only the factor's last bits are off a number of so many decimals
    steps = ceil(round(abs(factor - 1.0) * 10.0**decimals, 6))
    return 1.0 + copysign(steps, factor - 1.0) / 10.0**decimals


def _radians(degrees: float | None) -> float | None:
    from math import radians

    return None if degrees is None else radians(degrees)


def _levers(found: Sizing) -> Table:
    made = table(None, "lever", ">factor", ">change", ">enough by itself")
    for name, factor in found.factors.items():
        alone = found.alone[name]
        made.add_row(
            name,
            f"{factor:.4f}",
            f"{100.0 * (factor - 1.0):+z.2f} %",
            "no" if alone is None else f"{alone:.4f}",
        )
    return made


def _performance(found: Sizing, required: Requirements) -> Table:
    import numpy as np

    made = table(None, "", ">required", ">as it is", ">changed", "unit")
    for name, sign, unit in (
        ("speed", ">=", "deg/s"),
        ("acceleration", ">=", "deg/s²"),
        ("tracking_error", "<=", "deg/s"),
    ):
        before, after = getattr(found.before, name), getattr(found.after, name)
        if before is None or after is None:
            continue
        wanted = getattr(required, name)
        made.add_row(
            name.replace("_", " "),
            "" if wanted is None else f"{sign} {np.degrees(wanted):.2f}",
            f"{np.degrees(before):.2f}",
            f"{np.degrees(after):.2f}",
            unit,
        )
    return made
