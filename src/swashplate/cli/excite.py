"""``swashplate excitation``: what a campaign's runs can tell of a set-up, before a fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swashplate.cli.arguments import AxisName, CampaignPath
from swashplate.cli.inputs import parameters_of
from swashplate.cli.outputs import check_outputs
from swashplate.cli.terminal import note, say, show, table, working
from swashplate.cli.validate import chosen_axis
from swashplate.errors import InputError
from swashplate.tables import TABLE

if TYPE_CHECKING:
    from rich.table import Table

    from swashplate.identification.excitation import Outlook

EXAMPLES = """\
Examples:
  swashplate excitation virtual/campaign.toml
  swashplate excitation harbour/campaign.toml --setup mine.toml --from worn.toml
  swashplate excitation harbour/campaign.toml --write fewer.toml --out runs.csv
  swashplate fit harbour/campaign.toml --setup fewer.toml
"""
LEGEND = (
    "Under 'runs', one letter a run: # tells much of what is known (20 % and more), + tells "
    "something, o has what is needed but no sample that counts shows it, . has it not, - is not "
    "fitted here. 's' is how long it happens in all runs, 'effect' how much 1 % of the value "
    "changes all residuals together; 1 is one standard deviation of noise."
)
_LETTERS = {"most": "#", "some": "+", "unseen": "o", "none": "."}


def excitation(
    path: CampaignPath = Path("campaign.toml"),
    axis: AxisName = None,
    setup: Annotated[
        str | None,
        typer.Option(
            help="What is free: hoist, slew, luff, or your own TOML file; by default the one of "
            "the axis's drive.",
            metavar="NAME|FILE",
            show_default=False,
        ),
    ] = None,
    begin: Annotated[
        str | None,
        typer.Option(
            "--from",
            help="Judge at this drive's values instead of the campaign's drive.",
            metavar="AXIS|SET.toml",
            show_default=False,
        ),
    ] = None,
    write: Annotated[
        Path | None,
        typer.Option(
            help="Write a set-up with the proposal taken.", metavar="FILE", show_default=False
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Write the whole table, run by run, as .csv or .parquet.",
            metavar="FILE",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Say before a fit what the runs can tell of each unknown, and what to fix.

    Simulates the runs with the drive as it is: which thresholds and limits they
    reach, how much each unknown changes what was measured, and which unknowns
    can move together unseen. Proposes a set-up in which all is determined.
    """
    from swashplate.campaign import Campaign
    from swashplate.identification.data_checks import check_sound, refuse_unsound
    from swashplate.identification.excitation import outlook, propose, proposed_setup
    from swashplate.identification.fitting import smooth
    from swashplate.identification.setup import setup_text
    from swashplate.identification.staging import setup_of
    from swashplate.tables import write_text

    check_outputs((write, None), (out, TABLE))
    with working(f"Reading {path}"):
        campaign = Campaign.from_toml(path)
        chosen = chosen_axis(campaign, axis)
        plan = setup_of(campaign, chosen, setup)
        drive = parameters_of(begin) if begin is not None else campaign.drive(chosen).parameters
        runs = campaign.select(axis=chosen, role="fit")
    if not runs:
        raise InputError(f"{path}: no run of the axis '{chosen}' has the role 'fit'.")
    with working("Simulating"):
        doubts = refuse_unsound(check_sound(runs, smooth(drive), plan, rank=False))
        looks = [outlook(stage, smooth(drive), runs) for stage in plan.stages]
        proposals = [propose(each) for each in looks]
    comments = {each.stage.name: each.comments() for each in proposals}
    if write is not None:
        write_text(setup_text(proposed_setup(plan, proposals), comments), write)
    if out is not None:
        _written(looks, out)
    for sentence in doubts:
        say(f"! {sentence}")
    names = [each.name for each in runs]
    for look, proposal in zip(looks, proposals, strict=True):
        show(_table(look, names))
        # what no run exercises is said with its reason
        verdict = replace(look.identifiability, unexcited=())
        for sentence in (*verdict.sentences(), *look.sentences()):
            say(f"- {sentence}")
        for sentence in proposal.sentences():
            say(f"* {sentence}")
    note("")
    for number, name in enumerate(names, start=1):
        note(f"run {number}: {name}")
    say(LEGEND)
    if not any(each.changes for each in proposals):
        note("The set-up can stay as it is.")
    elif write is not None:
        note(f"Set-up: {write}")
    elif any(each.proposed is not None for each in proposals):
        note("With the starred lines (*) taken, the set-up is (--write FILE keeps it):")
        note("")
        note(setup_text(proposed_setup(plan, proposals), comments).rstrip())
    if out is not None:
        note(f"Table: {out}")


def _table(look: Outlook, runs: Sequence[str]) -> Table:
    made = table(
        f"Stage {look.stage.name}", "unknown", "needs", ">s", ">effect", "runs", wrap="needs"
    )
    for k, name in enumerate(look.names):
        letters = {r: _LETTERS[m] for r, m in zip(look.simulations, look.marks(name), strict=True)}
        made.add_row(
            name,
            look.need(name),
            f"{look.seconds[:, k].sum():.3g}",
            f"{look.effect(name):.3g}",
            "".join(letters.get(run, "-") for run in runs),
        )
    return made


def _written(looks: Sequence[Outlook], out: Path) -> None:
    import polars as pl

    from swashplate.tables import write_table

    rows = []
    for look in looks:
        for k, name in enumerate(look.names):
            share = look.shares[:, look.linearised.variables.index(name)]
            rows += [
                {
                    "stage": look.stage.name,
                    "unknown": name,
                    "needs": look.need(name),
                    "run": run,
                    "seconds": float(look.seconds[r, k]),
                    "share": float(share[r]),
                    "effect of 1 %": look.effect(name) * float(share[r]) ** 0.5,
                }
                for r, run in enumerate(look.simulations)
            ]
    write_table(pl.DataFrame(rows), out)
