"""``swashplate demo``: the main job, from tests of a virtual hoist to its parameters."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from swashplate.cli.fit_output import quality_table, written
from swashplate.cli.judging import Judged, Wanted, judged_fit
from swashplate.cli.terminal import note, progress, say, show, table

if TYPE_CHECKING:
    from rich.table import Table

    from swashplate.drive import Drive
    from swashplate.identification.assessment import Assessment

EXAMPLES = """\
Examples:
  swashplate demo
  swashplate demo --out results --seed 3
"""


def demo(
    out: Annotated[
        Path, typer.Option(help="Folder for logs, drive and report.", metavar="FOLDER")
    ] = Path("demo"),
    seed: Annotated[int, typer.Option(help="Of truth and noise.", min=0)] = 1,
) -> None:
    """Identify a virtual hoist from its tests, and compare it with the truth.

    Draws a hoist that differs from the published one, logs the source's 13
    tests of it through a 12-bit command, an ammeter and an encoder, fits card,
    pump and motor to ten of them, predicts the other three and writes a report.
    Takes less than a minute.
    """
    from swashplate.campaign import Campaign, rig
    from swashplate.drive import Drive
    from swashplate.identification.fitting import fit
    from swashplate.identification.setup import load_setup
    from swashplate.identification.staging import drawn

    setup = load_setup("hoist")
    nominal = Drive.preset("hoist")
    with progress(5) as begin:
        begin("testing the virtual hoist")
        truth = drawn(nominal, setup, seed)
        tests = rig.run("hoist", truth=truth, seed=seed)
        path = rig.write(tests, out / "virtual", overwrite=True)
        begin("reading its logs")
        campaign = Campaign.from_toml(path)
        begin("fitting the card, then pump and motor")
        begun = perf_counter()
        runs = campaign.select(role="fit")
        start = campaign.drive("hoist").parameters
        result = fit(start, runs, setup)
        seconds = perf_counter() - begun
        begin("judging what the data tell")
        found = judged_fit(campaign, "hoist", runs, start, setup, result, Wanted(seed=seed))
        shown = [_truth_beside_estimate(each, nominal, truth) for each in found.assessments]
        begin("writing the report")
        lines = [*written(result, found.assessments, campaign, out), found.stored(out)]
        lines.append(found.reported(out, truth.parameters))
        lines.append(_drawn(found, truth, out))
    note(f"Campaign:  {path}")
    show(*(made for made, _, _ in shown))
    inside, counted = (sum(each) for each in zip(*(pair[1:] for pair in shown), strict=True))
    say(f"The truth lies within the 95 % interval for {inside} of {counted} unknowns.")
    show(quality_table("Held back from the fit, and predicted", found.predicted))
    say(found.verdict.headline)
    note(f"Fitted in {seconds:.2f} s, compiling included where it was the first time.")
    for line in lines:
        note(line)


def _drawn(found: Judged, truth: Drive, out: Path) -> str:
    """Draw a predicted run and the estimates beside the truth; a line that says so."""
    from swashplate.identification.drive_model import DriveModel
    from swashplate.identification.staging import true_value
    from swashplate.identification.validation import with_speeds
    from swashplate.report.figures import plot_fit, save_figure

    speeds = [
        each
        for each in with_speeds(found.predicted)
        if each.experiment[each.channel].kind == "shaft_speed"
    ]
    values = {}
    for assessment in found.assessments:
        model = assessment.stage.problem.model
        assert isinstance(model, DriveModel)
        for unknown in assessment.stage.problem.unknowns:
            value = true_value(unknown, model, truth.parameters)
            if value is not None:
                values[unknown.name] = value
    save_figure(plot_fit(speeds[-1], found.assessments, values), out / "result.png")
    return f"Figure:    {out / 'result.png'}"


def _truth_beside_estimate(
    assessment: Assessment, nominal: Drive, truth: Drive
) -> tuple[Table, int, int]:
    """The table of a stage, how many intervals hold the truth, and of how many."""
    from swashplate.identification.drive_model import DriveModel
    from swashplate.identification.staging import true_value

    parts = {"card": "The control card", "pump": "Pump and motor"}
    name = assessment.stage.stage.name
    made = table(
        parts.get(name, name),
        "unknown",
        ">published",
        ">truth",
        ">estimate",
        ">95 % from",
        ">to",
        "held",
    )
    model = assessment.stage.problem.model
    assert isinstance(model, DriveModel)
    inside, counted = 0, 0
    unknowns = assessment.stage.problem.unknowns
    for each, unknown in zip(assessment.uncertainty.estimates, unknowns, strict=True):
        value = true_value(unknown, model, truth.parameters)
        begun = true_value(unknown, model, nominal.parameters)
        if value is None or begun is None:
            continue
        row = [each.name, f"{begun:.3g}", f"{value:.5g}", f"{each.value:.5g}"]
        if each.lower is None and each.upper is None:
            made.add_row(*row, each.status, "", "")
            continue
        lower = -float("inf") if each.lower is None else each.lower
        upper = float("inf") if each.upper is None else each.upper
        holds = lower <= value <= upper
        inside, counted = inside + holds, counted + 1
        made.add_row(*row, f"{lower:.5g}", f"{upper:.5g}", "yes" if holds else "no")
    return made, inside, counted
