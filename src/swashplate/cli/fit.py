"""``swashplate fit``: from a campaign to an identified drive."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from swashplate.cli.arguments import AxisName, CampaignPath, OwnModel
from swashplate.cli.fit_output import (
    estimates_table,
    folds_table,
    held_line,
    quality_table,
    written,
)
from swashplate.cli.inputs import parameters_of
from swashplate.cli.judging import Wanted, judged_fit
from swashplate.cli.terminal import Shown, Timing, long_work, note, say, show, waiting, working
from swashplate.cli.validate import check_folder, chosen_axis
from swashplate.cli.validation_tables import shown_verdict
from swashplate.errors import InputError

if TYPE_CHECKING:
    from swashplate.identification.fitting import Search
    from swashplate.identification.solving import Progress
    from swashplate.identification.staging import Parameters
    from swashplate.identification.starts import StartResult

EXAMPLES = """\
Examples:
  swashplate rig hoist --out virtual --perturb 0.1
  swashplate fit virtual/campaign.toml --out fitted
  swashplate fit harbour/campaign.toml --setup mine.toml --starts 50 --seed 1
  swashplate fit harbour/campaign.toml --folds 5 --bootstrap 1000 --profile Z16_plus
  swashplate fit valve/campaign.toml --model valve.py
  swashplate simulate fitted/drive.toml step:9
"""

INTERRUPTED = 130
"""Exit code after Ctrl-C, as of other programs."""
FEWEST_DRAWS = 40
"""Of a bootstrap: one beyond each end of a 95 % interval."""

Loss = Literal["linear", "soft_l1", "huber", "cauchy", "arctan"]
Figures = Literal["svg", "pdf"]


def fit(
    path: CampaignPath = Path("campaign.toml"),
    out: Annotated[
        Path, typer.Option(help="Folder for the fitted drive and its tables.", metavar="DIR")
    ] = Path("fitted"),
    axis: AxisName = None,
    setup: Annotated[
        str | None,
        typer.Option(
            help="What is free: a packaged set-up (hoist, slew, luff, hoist-source ...) or your "
            "own TOML file; by default the one of the axis's drive.",
            metavar="NAME|FILE",
            show_default=False,
        ),
    ] = None,
    model: OwnModel = None,
    joint: Annotated[
        bool,
        typer.Option("--joint", help="After the stages all unknowns at once, through the chain."),
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
    folds: Annotated[
        int, typer.Option(help="Cross-validate over so many parts of the runs; 0: not.", min=0)
    ] = 0,
    bootstrap: Annotated[
        int, typer.Option(help="Fit again to so many draws of the noise.", min=0)
    ] = 0,
    profile: Annotated[
        list[str] | None,
        typer.Option(
            help="Follow the cost along this unknown, or 'all'; may be repeated.",
            metavar="NAME",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Of starts, folds and bootstrap.", min=0)] = 0,
    jobs: Annotated[int, typer.Option(help="Processes for all of these; 0: all cores.", min=0)] = 0,
    dask: Annotated[
        str | None,
        typer.Option(
            help="Run them on the cluster of this scheduler.",
            metavar="ADDRESS",
            show_default=False,
        ),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the starts that DIR holds already.")
    ] = False,
    loss: Annotated[Loss, typer.Option(help="Robust losses forgive outliers.")] = "linear",
    require: Annotated[
        float,
        typer.Option(help="Largest error of held-out runs, in % of their range.", min=0.0),
    ] = 10.0,
    report: Annotated[
        bool, typer.Option(help="Write report.html, one file that works offline.")
    ] = True,
    figures: Annotated[
        Figures | None,
        typer.Option(help="Figures for print as well, in DIR/figures.", show_default=False),
    ] = None,
    timing: Annotated[bool, typer.Option("--timing", help="Say how long each part took.")] = False,
) -> None:
    """Identify a drive, or a model of your own, from its tests.

    Fits the runs with the role 'fit', stage after stage, predicts those with the
    role 'validate', and says what the data can and cannot tell. Writes the drive
    as a parameter file that 'simulate' takes, the estimates with their intervals,
    and what 'report' needs to write the report again. Ctrl-C keeps the best so
    far, of several starts those that ended, and the exit code is 130. It is 1 if
    the result is not usable.
    """
    if 0 < bootstrap < FEWEST_DRAWS:
        raise InputError(
            f"{bootstrap} draws do not reach the ends of a 95 % interval; take {FEWEST_DRAWS} or "
            "more, 1000 for smooth ones."
        )
    check_folder(out)
    clock = Timing()
    if model is not None and (setup is not None or begin is not None or joint):
        raise InputError(f"{model} says what is free and where it begins: leave out the others.")
    with working("Starting"):
        from swashplate.campaign import Campaign
        from swashplate.executors import Dask, Processes
        from swashplate.identification.fitting import fit as fitted
        from swashplate.identification.fitting import refined
        from swashplate.identification.own_model import ModelSetup
        from swashplate.identification.solving import longest_left
        from swashplate.identification.staging import setup_of
    clock.ended("start")
    with working(f"Reading {path}"):
        campaign = Campaign.from_toml(path)
        chosen = chosen_axis(campaign, axis)
        runs = campaign.select(axis=chosen, role="fit")
        if not runs:
            raise InputError(f"{path}: no run of the axis '{chosen}' has the role 'fit'.")
        nominal: Parameters
        if model is not None:
            nominal = ModelSetup.from_file(model).nominal(runs)
            plan = nominal.setup.setup
        else:
            plan = setup_of(campaign, chosen, setup)
            drive = campaign.drive(chosen) if begin is None else None
            nominal = parameters_of(begin or "") if drive is None else drive.parameters
    clock.ended("reading")
    executor = Dask(dask) if dask is not None else Processes(jobs or None)
    begun = perf_counter()
    with long_work("Fitting") as shown:

        def watch(stage: str, now: Progress) -> None:
            shown(
                f"{stage}: iteration {now.iteration}, cost {now.cost:.6g}",
                left=waiting(longest_left(now), "at most"),
            )

        search = _search(starts, seed, executor, out, resume, shown) if starts else None
        result = fitted(nominal, runs, plan, loss=loss, search=search, watch=watch)
        if joint and len(plan.stages) > 1 and not result.interrupted:
            result = refined(result, runs, watch=watch)
    seconds = perf_counter() - begun
    clock.ended("search, kernels loaded")
    if result.interrupted and starts:
        last = result.stages[-1]
        note(
            f"Interrupted in the stage '{last.stage.name}': {last.solution.message}. The same "
            "command with --resume goes on; nothing is written but the starts."
        )
        raise typer.Exit(INTERRUPTED)
    wanted = Wanted(folds, bootstrap, tuple(profile or ()), seed, executor, loss, require / 100.0)
    found = judged_fit(campaign, chosen, runs, nominal, plan, result, wanted)
    clock.ended("judging")
    lines = [
        *written(result, found.assessments, campaign, out, found.bootstraps),
        found.stored(out),
    ]
    if report:
        lines.append(found.reported(out))
    if figures is not None:
        lines.append(found.drawn(out, figures))
    clock.ended("report and files")
    note(f"{campaign.title}{' (virtual)' if campaign.virtual else ''}: fitted in {seconds:.2f} s")
    for each_run in runs:
        for sentence in each_run.notes:
            say(f"- {each_run.name}: {sentence}.")
    for sentence in result.doubts:
        say(f"! {sentence}")
    for each in found.assessments:
        name, solution = each.stage.stage.name, each.stage.solution
        show(estimates_table(each, found.bootstraps.get(name)))
        say(f"{name}: {solution.message} after {solution.evaluations} evaluations.")
        said = (*each.identifiability.sentences(), *each.uncertainty.sentences())
        drawn = found.bootstraps[name].sentences() if name in found.bootstraps else ()
        for sentence in (*said, *drawn):
            say(f"- {sentence}")
    for each_profile in found.profiles:
        for sentence in each_profile.profile.sentences(found.name_of(each_profile)):
            say(f"- {sentence}")
    say(held_line(result))
    fitted_runs = [quality for each in found.assessments for quality in each.runs]
    show(quality_table("Runs that were fitted", fitted_runs))
    if found.predicted:
        show(quality_table("Runs that were held back and predicted", found.predicted))
    if found.folds is not None:
        show(folds_table(found.folds))
        for sentence in found.folds.sentences():
            say(f"- {sentence}")
    for line in lines:
        note(line)
    if timing:
        clock.ended("tables")
        show(clock.table())
    if result.interrupted:
        note("Interrupted: this is the best so far, not an optimum.")
        raise typer.Exit(INTERRUPTED)
    shown_verdict(found.verdict)


def _search(
    starts: int, seed: int, executor: object, out: Path, resume: bool, shown: Shown
) -> Search:
    from swashplate.executors import Dask, Processes
    from swashplate.identification.fitting import Search
    from swashplate.identification.starts import time_left

    assert isinstance(executor, Processes | Dask)
    begun: dict[str, tuple[float, int]] = {}

    def watch(stage: str, result: StartResult, done: int) -> None:
        # results of an earlier run come all at once: the pace counts from the first new one
        first, kept = begun.setdefault(stage, (perf_counter(), done))
        left = time_left(done - kept, starts + 1 - done, perf_counter() - first)
        shown(
            f"{stage}: {done} of {starts + 1} starts, the last to cost {result.cost:.6g}",
            done / (starts + 1),
            waiting(left),
        )

    return Search(starts, seed, executor, out / "starts", resume, watch)
