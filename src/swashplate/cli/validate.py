"""``swashplate validate``: a drive held against runs, predicted from the command alone."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from swashplate.cli.arguments import AxisName, CampaignPath, OwnModel
from swashplate.cli.inputs import model_parameters_of, parameters_of
from swashplate.cli.terminal import note, say, show, working
from swashplate.cli.validation_tables import (
    MEASURES,
    RESIDUALS,
    errors_table,
    left_out,
    measures_table,
    quality_tables,
    residual_table,
    shown_verdict,
)
from swashplate.errors import FileError, InputError

if TYPE_CHECKING:
    from swashplate.campaign import Campaign
    from swashplate.identification.assessment import RunQuality
    from swashplate.identification.staging import Parameters
    from swashplate.identification.verdict import Verdict

EXAMPLES = """\
Examples:
  swashplate validate fitted/drive.toml virtual/campaign.toml
  swashplate validate hoist harbour/campaign.toml --role all --out validation
"""

Role = Literal["validate", "fit", "all"]
Figures = Literal["svg", "pdf"]


def validate(
    drive: Annotated[
        str,
        typer.Argument(
            metavar="SET.toml",
            help="The drive: a parameter file, the folder of a fit, or a packaged one.",
            show_default=False,
        ),
    ],
    path: CampaignPath = Path("campaign.toml"),
    axis: AxisName = None,
    model: OwnModel = None,
    role: Annotated[
        Role, typer.Option(help="Runs that were held back, those to fit, or both.")
    ] = "validate",
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for report.html and measures.csv.", metavar="DIR"),
    ] = None,
    require: Annotated[
        float, typer.Option(help="Largest error, in % of a channel's range.", min=0.0)
    ] = 10.0,
    figures: Annotated[
        Figures | None,
        typer.Option(help="Figures for print as well, in DIR/figures.", show_default=False),
    ] = None,
) -> None:
    """Predict runs from their command alone and judge the drive by them.

    Prints errors run by run, the source's error tables with what they leave out,
    what is left in the residuals, and a verdict. The exit code is 1 if the drive
    is not usable for these runs.
    """
    from swashplate.campaign import Campaign
    from swashplate.identification.validation import (
        error_tables,
        predict,
        source_rules,
        with_speeds,
    )
    from swashplate.identification.verdict import verdict

    if figures is not None and out is None:
        raise InputError("--figures needs a folder to write them to: give --out DIR.")
    with working(f"Reading {path}"):
        parameters: Parameters | None = None if model else parameters_of(drive)
        campaign = Campaign.from_toml(path)
        chosen = chosen_axis(campaign, axis)
        wanted = ("fit", "validate") if role == "all" else (role,)
        runs = [each for each in campaign.select(axis=chosen) if each.role in wanted]
    if not runs:
        raise InputError(
            f"{path}: no run of the axis '{chosen}' has the role {' or '.join(map(repr, wanted))}; "
            "another one is asked for with --role."
        )
    with working("Predicting"):
        if parameters is None:
            assert model is not None
            parameters = model_parameters_of(drive, model, runs)
        predicted = predict(parameters, runs)
        if not predicted:
            raise InputError(f"{path}: all samples of these runs are ignored; nothing is left.")
        judged = verdict((), predicted, required=require / 100.0)
        qualities = with_speeds(predicted)
        errors = error_tables(qualities, source_rules(parameters.name))
    lines = []
    if out is not None:
        with working("Writing the report"):
            lines = _written(parameters, campaign, predicted, judged, out, figures, drive)
    virtual = " (virtual)" if campaign.virtual else ""
    note(f"{campaign.title}{virtual}, {chosen}: {parameters.name} from {drive}")
    show(*quality_tables(qualities))
    say(MEASURES)
    show(*(errors_table(each) for each in errors))
    for words in left_out(errors):
        say(f"- {words}")
    show(residual_table(predicted))
    say(RESIDUALS)
    for words in judged.sentences:
        say(f"- {words}")
    for line in lines:
        note(line)
    shown_verdict(judged)


def chosen_axis(campaign: Campaign, axis: str | None) -> str:
    """The axis that is named, or the campaign's only one."""
    if axis is None:
        if len(campaign.axes) > 1:
            raise InputError(
                f"{campaign.path} has the axes {', '.join(campaign.axes)}; name one with --axis."
            )
        return next(iter(campaign.axes))
    campaign.select(axis=axis)
    return axis


def made_folder(folder: Path) -> Path:
    """A folder that is there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"{folder} cannot be made: {error.strerror or error}.") from None
    return folder


def check_folder(folder: Path) -> None:
    """See to it, before long work, that a folder can be made and written to; nothing is made yet.

    Raises
    ------
    FileError
        If it cannot.
    """
    there = next(each for each in (folder.absolute(), *folder.absolute().parents) if each.exists())
    if not there.is_dir():
        raise FileError(f"{folder} cannot be made: {there} is no folder.")
    if not os.access(there, os.W_OK | os.X_OK):
        raise FileError(f"{folder} cannot be written to: {there} is read-only or another user's.")


def _written(
    parameters: Parameters,
    campaign: Campaign,
    predicted: Sequence[RunQuality],
    judged: Verdict,
    out: Path,
    figures: Figures | None,
    drive: str,
) -> list[str]:
    """Write the report and its tables; lines that say so."""
    import platform

    from swashplate.__about__ import __version__
    from swashplate.identification.validation import with_speeds
    from swashplate.report.fit_page import save_run_figures, write_validation_report
    from swashplate.tables import write_table

    made_folder(out)
    write_table(measures_table(with_speeds(predicted)), out / "measures.csv")
    notes = {"swashplate": __version__, "Python": platform.python_version(), "drive from": drive}
    write_validation_report(
        parameters, campaign, out / "report.html", predicted, judged=judged, notes=notes
    )
    lines = [f"Measures:  {out / 'measures.csv'}", f"Report:    {out / 'report.html'}"]
    if figures is not None:
        paths = save_run_figures(predicted, campaign, out / "figures", figures)
        lines.append(f"Figures:   {len(paths)} in {out / 'figures'}")
    return lines
