"""``swashplate demo``: the main job, from tests of a virtual hoist to its parameters."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from swashplate.cli.fit import quality_table, reported, written
from swashplate.cli.terminal import note, progress, say, show, table

if TYPE_CHECKING:
    from rich.table import Table

    from swashplate.drive import Drive
    from swashplate.identification.assessment import Assessment
    from swashplate.identification.setup import Setup

EXAMPLES = """\
Examples:
  swashplate demo
  swashplate demo --out results --seed 3
"""
SPREAD = 0.05
"""Standard deviation of the logarithm by which true parameters differ from the published ones."""


def demo(
    out: Annotated[
        Path, typer.Option(help="Folder for logs, drive and report.", metavar="FOLDER")
    ] = Path("demo"),
    seed: Annotated[int, typer.Option(help="Of truth and noise.", min=0)] = 1,
) -> None:
    """Identify a virtual hoist from its tests, and hold the result against the truth.

    Draws a hoist that differs from the published one, logs the source's 13
    tests of it through a 12-bit command, an ammeter and an encoder, fits card,
    pump and motor to ten of them, predicts the other three and writes a report.
    Takes less than a minute.
    """
    from swashplate.campaign import rig
    from swashplate.campaign.campaign import Campaign
    from swashplate.drive import Drive
    from swashplate.identification.assessment import assess
    from swashplate.identification.fit import fit, refined
    from swashplate.identification.setup import load_setup
    from swashplate.identification.validation import predict

    setup = load_setup("hoist")
    nominal = Drive.preset("hoist")
    with progress(5) as begin:
        begin("testing the virtual hoist")
        truth = _drawn(nominal, setup, seed)
        tests = rig.run("hoist", truth=truth, seed=seed)
        path = rig.write(tests, out / "virtual", overwrite=True)
        begin("reading its logs")
        campaign = Campaign.from_toml(path)
        begin("fitting card and pump, then both together")
        begun = perf_counter()
        runs = campaign.select(role="fit")
        staged = fit(runs, campaign.drive("hoist").parameters, setup)
        result = refined(staged, runs)
        seconds = perf_counter() - begun
        begin("judging what the data tell")
        assessments = assess(result.stages)
        predicted = predict(result.parameters, campaign.select(role="validate"))
        shown = [_truth_beside_estimate(each, nominal, truth) for each in assessments]
        begin("writing the report")
        lines = written(result, assessments, out)
        lines.append(reported(result, campaign, assessments, predicted, out, seed))
    note(f"Campaign:  {path}")
    show(*(made for made, _, _ in shown))
    inside, counted = (sum(each) for each in zip(*(pair[1:] for pair in shown), strict=True))
    say(f"The truth lies within the 95 % interval for {inside} of {counted} unknowns.")
    show(quality_table("Held back from the fit, and predicted", predicted))
    note(f"Fitted in {seconds:.2f} s, compiling included where it was the first time.")
    for line in lines:
        note(line)


def _drawn(nominal: Drive, setup: Setup, seed: int) -> Drive:
    """A drive whose free parameters differ from the nominal ones."""
    import numpy as np

    from swashplate.parameters.parameter_set import columns_of

    random = np.random.default_rng(seed)
    names = [name for stage in setup.stages for name in columns_of(list(stage.free))]
    names += columns_of(["Z19", "Z21"])
    numbers = nominal.parameters.numbers
    factors = {name: float(np.exp(random.normal(0.0, SPREAD))) for name in names}
    return nominal.replace(**{name: numbers[name] * factor for name, factor in factors.items()})


def _truth_beside_estimate(
    assessment: Assessment, nominal: Drive, truth: Drive
) -> tuple[Table, int, int]:
    """The table of a stage, how many intervals hold the truth, and of how many."""
    from swashplate.identification.drive_model import DriveModel

    made = table(
        "Card, pump and motor, fitted together",
        "unknown",
        ">published",
        ">truth",
        ">estimate",
        ">95 % from",
        ">to",
        "holds",
    )
    model = assessment.stage.problem.model
    assert isinstance(model, DriveModel)
    published, true = (
        {**each.numbers, **(model.forces.values(each) if model.forces is not None else {})}
        for each in (nominal.parameters, truth.parameters)
    )
    inside, counted = 0, 0
    unknowns = assessment.stage.problem.unknowns
    for each, unknown in zip(assessment.uncertainty.estimates, unknowns, strict=True):
        if unknown.run is not None:
            continue
        value = true[unknown.targets[0]]
        begun = published[unknown.targets[0]]
        row = [each.name, f"{begun:.5g}", f"{value:.5g}", f"{each.value:.5g}"]
        if each.lower is None or each.upper is None:
            made.add_row(*row, each.status, "", "")
            continue
        holds = each.lower <= value <= each.upper
        inside, counted = inside + holds, counted + 1
        made.add_row(*row, f"{each.lower:.5g}", f"{each.upper:.5g}", "yes" if holds else "no")
    return made, inside, counted
