"""``swashplate fit``: from a campaign to an identified drive."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from swashplate.cli.inputs import parameters_of
from swashplate.cli.terminal import note, say, show, table, working
from swashplate.errors import InputError

if TYPE_CHECKING:
    from rich.status import Status
    from rich.table import Table

    from swashplate.campaign.campaign import Campaign
    from swashplate.identification.assessment import Assessment, RunQuality
    from swashplate.identification.fit import Fit, Search
    from swashplate.identification.solving import Progress

EXAMPLES = """\
Examples:
  swashplate rig hoist --out virtual --perturb 0.1
  swashplate fit virtual/campaign.toml --out fitted
  swashplate fit harbour/campaign.toml --setup mine.toml --starts 50 --seed 1
  swashplate simulate fitted/drive.toml step:9
"""

Method = Literal["trf", "slsqp"]
Loss = Literal["linear", "soft_l1", "huber", "cauchy", "arctan"]


def fit(
    path: Annotated[
        Path, typer.Argument(metavar="CAMPAIGN.toml", help="The campaign file, beside its logs.")
    ] = Path("campaign.toml"),
    out: Annotated[
        Path, typer.Option(help="Folder for the fitted drive and its tables.", metavar="DIR")
    ] = Path("fitted"),
    axis: Annotated[
        str | None,
        typer.Option(help="The axis, where the campaign has several.", show_default=False),
    ] = None,
    setup: Annotated[
        str | None,
        typer.Option(
            help="What is free: hoist, slew, luff, or your own TOML file; by default the one of "
            "the axis's drive.",
            metavar="NAME|FILE",
            show_default=False,
        ),
    ] = None,
    joint: Annotated[
        bool,
        typer.Option(
            "--joint",
            help="After the stages all unknowns at once, through the whole chain: intervals then "
            "take in what the card's stage does not know.",
        ),
    ] = False,
    begin: Annotated[
        str | None,
        typer.Option(
            "--from",
            help="Start from this drive instead of the campaign's.",
            metavar="AXIS|SET.toml",
            show_default=False,
        ),
    ] = None,
    starts: Annotated[int, typer.Option(help="More starts, spread over the bounds.", min=0)] = 0,
    seed: Annotated[int, typer.Option(help="Of the starts.", min=0)] = 0,
    jobs: Annotated[int, typer.Option(help="Processes for the starts; 0: all cores.", min=0)] = 0,
    dask: Annotated[
        str | None,
        typer.Option(
            help="Run the starts on the cluster of this scheduler.",
            metavar="ADDRESS",
            show_default=False,
        ),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the starts that DIR holds already.")
    ] = False,
    method: Annotated[
        Method, typer.Option(help="Trust region on exact derivatives, or SQP by differences.")
    ] = "trf",
    loss: Annotated[Loss, typer.Option(help="Robust losses forgive outliers.")] = "linear",
    report: Annotated[
        bool, typer.Option(help="Write report.html, one file that works offline.")
    ] = True,
) -> None:
    """Identify a drive from its tests.

    Fits the runs with the role 'fit', stage after stage, predicts those with the
    role 'validate', and says what the data can and cannot tell. Writes the drive
    as a parameter file that 'simulate' takes, and the estimates with their
    intervals. Ctrl-C keeps the best so far.
    """
    from swashplate.campaign.campaign import Campaign
    from swashplate.identification.assessment import assess
    from swashplate.identification.fit import fit as fitted
    from swashplate.identification.fit import refined
    from swashplate.identification.staging import setup_of
    from swashplate.identification.validation import predict

    with working(f"Reading {path}"):
        campaign = Campaign.from_toml(path)
        chosen = _axis(campaign, axis)
        plan = setup_of(campaign, chosen, setup)
        nominal = parameters_of(begin) if begin is not None else campaign.drive(chosen).parameters
        runs = campaign.select(axis=chosen, role="fit")
    if not runs:
        raise InputError(f"{path}: no run of the axis '{chosen}' has the role 'fit'.")
    begun = perf_counter()
    with working("Fitting") as status:

        def watch(stage: str, now: Progress) -> None:
            status.update(
                f"{stage}: iteration {now.iteration}, cost {now.cost:.6g}, {now.seconds:.1f} s"
            )

        search = _search(starts, seed, jobs, dask, out, resume, status)
        result = fitted(runs, nominal, plan, method=method, loss=loss, search=search, watch=watch)
        if joint and len(plan.stages) > 1 and not result.stages[-1].solution.interrupted:
            result = refined(result, runs, watch=watch)
    seconds = perf_counter() - begun
    with working("Judging"):
        assessments = assess(result.stages)
        predicted = predict(result.parameters, campaign.select(axis=chosen, role="validate"))
        lines = written(result, assessments, out)
    if report:
        with working("Writing the report"):
            lines.append(reported(result, campaign, assessments, predicted, out, seed))
    note(f"{campaign.title}{' (virtual)' if campaign.virtual else ''}: fitted in {seconds:.2f} s")
    for each in assessments:
        show(_estimates(each))
        solution = each.stage.solution
        say(
            f"{each.stage.stage.name}: {solution.message} after {solution.evaluations} evaluations."
        )
        for sentence in (*each.identifiability.sentences(), *each.uncertainty.sentences()):
            say(f"- {sentence}")
    show(quality_table("Runs that were fitted", [q for each in assessments for q in each.runs]))
    if predicted:
        show(quality_table("Runs that were held back and predicted", predicted))
    for line in lines:
        note(line)
    if result.stages[-1].solution.interrupted:
        note("Interrupted: this is the best so far, not an optimum.")


def reported(
    result: Fit,
    campaign: Campaign,
    assessments: Sequence[Assessment],
    predicted: Sequence[RunQuality],
    out: Path,
    seed: int,
) -> str:
    """Write report.html; a line that says so."""
    import platform

    from swashplate.__about__ import __version__
    from swashplate.report.fit_page import write_fit_report

    write_fit_report(
        result,
        campaign,
        out / "report.html",
        assessments=assessments,
        validation=predicted,
        starts=result.stages[-1].starts,
        notes={
            "swashplate": __version__,
            "Python": platform.python_version(),
            "seed of the starts": str(seed),
            "campaign": str(campaign.path),
        },
    )
    return f"Report:    {out / 'report.html'}"


def _axis(campaign: Campaign, axis: str | None) -> str:
    if axis is None:
        if len(campaign.axes) > 1:
            raise InputError(
                f"{campaign.path} has the axes {', '.join(campaign.axes)}; name one with --axis."
            )
        return next(iter(campaign.axes))
    campaign.select(axis=axis)
    return axis


def _search(
    starts: int, seed: int, jobs: int, dask: str | None, out: Path, resume: bool, status: Status
) -> Search | None:
    from swashplate.identification.executors import Dask, Processes
    from swashplate.identification.fit import Search

    if not starts:
        return None
    return Search(
        starts,
        seed,
        Dask(dask) if dask is not None else Processes(jobs or None),
        out / "starts",
        resume,
        lambda stage, result, done: status.update(
            f"{stage}: {done} of {starts + 1} starts, the last to cost {result.cost:.6g}"
        ),
    )


def _estimates(assessment: Assessment) -> Table:
    made = table(
        f"Stage {assessment.stage.stage.name}",
        "unknown",
        ">nominal",
        ">estimate",
        ">95 % interval",
        "",
        "unit",
    )
    unknowns = assessment.stage.problem.unknowns
    for each, unknown in zip(assessment.uncertainty.estimates, unknowns, strict=True):
        if unknown.run is not None:
            continue
        low, high = (
            ("", "")
            if each.lower is None or each.upper is None
            else (f"{each.lower:.5g}", f"{each.upper:.5g}")
        )
        made.add_row(
            unknown.name,
            f"{unknown.start:.5g}",
            f"{each.value:.5g}",
            low if low else each.status,
            high,
            unknown.unit,
        )
    return made


def quality_table(title: str, runs: Sequence[RunQuality]) -> Table:
    """Errors and fit % of runs, with start and ignored share beside them."""
    from math import degrees

    made = table(title, "run", "channel", "start", ">ignored", ">RMSE", "", ">fit %", wrap="run")
    for each in runs:
        channel = each.experiment[each.channel]
        rmse, unit = each.measures.rmse, channel.unit
        if unit.startswith("rad"):
            rmse, unit = degrees(rmse), unit.replace("rad", "deg")
        elif unit == "A":
            rmse, unit = 1e3 * rmse, "mA"
        ignored = 1.0 - channel.used.mean()
        made.add_row(
            each.experiment.run,
            each.channel,
            each.experiment.start,
            f"{100.0 * ignored:.3g} %",
            f"{rmse:.3g}",
            unit,
            "-" if each.measures.fit_percent is None else f"{each.measures.fit_percent:.2f}",
        )
    return made


def written(result: Fit, assessments: Sequence[Assessment], out: Path) -> list[str]:
    """Write the drive and the estimates; lines that say so."""
    import polars as pl

    from swashplate.drive import Drive
    from swashplate.errors import FileError
    from swashplate.tables import write_table

    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"{out} cannot be made: {error.strerror or error}.") from None
    Drive(result.parameters).to_toml(out / "drive.toml")
    rows = [
        {
            "stage": each.stage.stage.name,
            "unknown": estimate.name,
            "unit": unknown.unit,
            "nominal": unknown.start,
            "estimate": estimate.value,
            "lower 95 %": estimate.lower,
            "upper 95 %": estimate.upper,
            "standard error": estimate.standard_error,
            "status": estimate.status,
        }
        for each in assessments
        for estimate, unknown in zip(
            each.uncertainty.estimates, each.stage.problem.unknowns, strict=True
        )
    ]
    write_table(pl.DataFrame(rows), out / "estimates.csv")
    return [f"Drive:     {out / 'drive.toml'}", f"Estimates: {out / 'estimates.csv'}"]
