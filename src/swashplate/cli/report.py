"""``swashplate report``: the report of a fit once more, without fitting again."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from swashplate.cli.arguments import OwnModel
from swashplate.cli.inputs import parameters_of
from swashplate.cli.terminal import note, say, working
from swashplate.cli.validate import made_folder
from swashplate.errors import InputError

if TYPE_CHECKING:
    from swashplate.campaign import Campaign
    from swashplate.identification.own_model import ModelSetup
    from swashplate.identification.storing import StoredFit

EXAMPLES = """\
Examples:
  swashplate fit virtual/campaign.toml --out fitted
  swashplate report fitted virtual/campaign.toml --truth virtual/truth
  swashplate report fitted virtual/campaign.toml --figures pdf
"""

Figures = Literal["svg", "pdf"]
STORED = "fit.json"
"""What a fit keeps of itself, beside the drive that it found."""


def report(
    fitted: Annotated[
        Path,
        typer.Argument(
            metavar="FITTED",
            help="The folder that 'fit' wrote, or its drive.toml.",
            show_default=False,
        ),
    ],
    path: Annotated[
        Path, typer.Argument(metavar="CAMPAIGN.toml", help="The campaign that was fitted.")
    ] = Path("campaign.toml"),
    model: OwnModel = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for report.html; by default where the fit is.",
            metavar="DIR",
            show_default=False,
        ),
    ] = None,
    figures: Annotated[
        Figures | None,
        typer.Option(help="Figures for print as well, in the folder figures.", show_default=False),
    ] = None,
    truth: Annotated[
        str | None,
        typer.Option(
            help="Of virtual tests: the folder or parameter file of what was simulated, to stand "
            "beside the estimates.",
            metavar="TRUTH",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Write the report of a fit again, from what the fit stored.

    Nothing is fitted. The campaign must be the one that was fitted: if its
    samples, weights or ignored windows have changed, the report is refused.
    """
    from swashplate.campaign import Campaign
    from swashplate.identification.assessment import assess
    from swashplate.identification.own_model import ModelSetup
    from swashplate.identification.validation import predict
    from swashplate.identification.verdict import verdict
    from swashplate.report.fit_page import save_fit_figures, write_fit_report

    with working(f"Reading {path}"):
        true = None if truth is None else parameters_of(truth)
        campaign = Campaign.from_toml(path)
        if true is not None and not campaign.virtual:
            raise InputError(f"{path} is not virtual: nobody knows its truth, leave out --truth.")
        own = None if model is None else ModelSetup.from_file(model)
        stored = _stored(fitted, campaign, own)
    with working("Judging"):
        assessments = assess(stored.fit.stages)
        names = {each.name for each in stored.experiments}
        held = [
            each
            for each in campaign.select(axis=stored.axis, role="validate")
            if each.name not in names
        ]
        predicted = predict(stored.fit.parameters, held)
        planned = [each.name for each in stored.fit.setup.stages]
        judged = verdict(assessments, predicted, planned=planned)
    folder = made_folder(out if out is not None else _folder(fitted))
    with working("Writing the report"):
        write_fit_report(
            stored.fit,
            campaign,
            folder / "report.html",
            assessments=assessments,
            validation=predicted,
            profiles=stored.profiles,
            folds=stored.folds,
            truth=true,
            judged=judged,
            notes=stored.notes,
        )
    note(f"Report:    {folder / 'report.html'}")
    if figures is not None:
        with working("Drawing"):
            paths = save_fit_figures(
                stored.fit,
                campaign,
                folder / "figures",
                figures,
                assessments=assessments,
                validation=predicted,
            )
        note(f"Figures:   {len(paths)} in {folder / 'figures'}")
    say(judged.headline)


def _folder(fitted: Path) -> Path:
    return fitted if fitted.is_dir() else fitted.parent


def _stored(fitted: Path, campaign: Campaign, model: ModelSetup | None) -> StoredFit:
    """The stored fit; of a drive that is named, the one beside it that found it."""
    from swashplate.identification.storing import load_fit

    place = _folder(fitted) / STORED
    if not place.is_file():
        raise InputError(
            f"There is no {STORED} in {_folder(fitted)}: give a folder that 'swashplate fit' "
            "wrote, or judge a drive alone with 'swashplate validate'."
        )
    stored = load_fit(place, campaign, model=model)
    if fitted.suffix.lower() == ".toml":
        given = parameters_of(str(fitted)).numbers
        other = [
            name for name, value in stored.fit.parameters.numbers.items() if given[name] != value
        ]
        if other:
            raise InputError(
                f"{fitted} is not the drive that {place} found ({', '.join(other[:3])} differ): "
                "judge it with 'swashplate validate'."
            )
    return stored
