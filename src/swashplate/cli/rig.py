"""``swashplate rig``: tests of a drive whose parameters are known, as a user would log them."""

from __future__ import annotations

from dataclasses import replace
from math import radians
from pathlib import Path
from typing import Annotated, Literal

import typer

from swashplate.cli.arguments import DriveWord
from swashplate.cli.inputs import drive_file, drive_of, maneuver_of
from swashplate.cli.terminal import note, show, table, working

EXAMPLES = """\
Examples:
  swashplate rig hoist --out virtual-hoist
  swashplate rig slew --out worn --seed 7 --severity harsh --backlash-deg 0.1
  swashplate rig hoist --out loaded --set load_torque=30kNm --set motor_leakage=1e-6
  swashplate rig hoist --out short --maneuver step:4 --maneuver sine:6,0.2 --perturb 0.1
  swashplate campaign check virtual-hoist/campaign.toml
"""

Severity = Literal["clean", "realistic", "harsh"]


def rig(
    drive: DriveWord,
    out: Annotated[
        Path, typer.Option(help="A new or empty folder for logs and campaign.", metavar="DIR")
    ],
    seed: Annotated[int, typer.Option(help="The same seed gives the same files.")] = 1,
    severity: Annotated[
        Severity,
        typer.Option(
            help="The instruments: perfect, as in a good campaign, or with everything wrong."
        ),
    ] = "realistic",
    values: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            help="Of the drive that is simulated, not of the one that a fit starts from: a "
            "refinement, for example. As in 'swashplate simulate'.",
            metavar="NAME=VALUE",
        ),
    ] = None,
    backlash_deg: Annotated[
        float, typer.Option(help="Play between shaft and encoder.", metavar="DEG")
    ] = 0.0,
    perturb: Annotated[
        float,
        typer.Option(help="Draw all true parameters, held ones too, within this share: 0.1."),
    ] = 0.0,
    maneuver: Annotated[
        list[str] | None,
        typer.Option(
            help="A test instead of the source's, such as step:4. May be repeated.",
            metavar="MANEUVER",
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Write into a folder that is not empty.")
    ] = False,
) -> None:
    """Write a virtual test campaign: logs, campaign.toml and, apart, the truth.

    A drive with known parameters is simulated over the tests of the source and
    read by instruments with chosen errors. Fit it as you would your machine's
    logs, then look into truth/. Every file says that it is virtual.
    """
    from swashplate.campaign import rig as bench

    with working("Simulating"):
        nominal = drive_of(drive)
        tools = replace(bench.SEVERITIES[severity], backlash=radians(backlash_deg))
        tests = bench.run(
            drive if drive_file(drive) is None else nominal,
            None if not maneuver else [maneuver_of(each, nominal) for each in maneuver],
            seed=seed,
            severity=severity,
            instruments=tools,
            truth=drive_of(drive, values) if values else None,
            perturb=perturb,
        )
    with working("Writing"):
        path = bench.write(tests, out, overwrite=force)
    made = table(None, "log", "manoeuvre", "role", ">rows", ">s", wrap="manoeuvre")
    for run in tests.runs.values():
        time = run.columns["time"]
        made.add_row(
            f"{run.stem}.csv",
            run.name,
            run.role,
            f"{time.size}",
            f"{time[-1] - time[0]:.4g}",
        )
    show(made)
    note(f"Campaign: {path}")
    note(f"Truth:    {path.parent / 'truth'} (look only after the fit)")
