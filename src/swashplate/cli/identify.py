"""``swashplate fit``, ``validate``, ``report`` and ``demo``: from tests to an assessed drive."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter, process_time
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from swashplate.cli import parsing
from swashplate.cli.commands import command
from swashplate.cli.options import (
    CAMPAIGN,
    NO_VALUE,
    AxisOption,
    CampaignArgument,
    DaskOption,
    DriveArgument,
    Force,
    InitialDrive,
    ModelFile,
    RequiredOption,
    SeedOption,
    SetupOption,
    new_file,
    new_folder,
)
from swashplate.cli.terminal import (
    bullets,
    check_free,
    lock,
    long_work,
    note,
    save,
    say,
    say_saved,
    show,
    show_numbers,
    side,
    spinner,
)
from swashplate.errors import InputError
from swashplate.stopping import Stopped, as_a_whole
from swashplate.tables import PRINTED, TABLE, check_folder, count, joined, made_folder

if TYPE_CHECKING:
    from swashplate.identification import Identification, Verdict
    from swashplate.identification.estimation import Parameters
    from swashplate.parameters import ParameterSet

MOST_EVALUATIONS = 600
FILES = {
    "drive.toml": "Drive",
    "parameters.toml": "Numbers",
    "setup.toml": "Settings",
    "estimates.csv": "Estimates",
    "fit.json": "Fit",
}
"""Files that `Identification.save` writes, of a drive or of a user-defined model."""
PAGE, MEASURES_FILE = "report.html", "measures.csv"
MEASURES = (
    "NRMSE is the RMSE over the standard deviation of what was measured, fit % is 100 (1 - "
    "NRMSE); 'of range' below: over the range of the signal, its largest minus its smallest value."
)

Loss = Literal["linear", "soft_l1", "cauchy"]
Role = Literal["validate", "fit", "all"]

app = typer.Typer(rich_markup_mode="rich")


class StageClock:
    """Time spent in each part; loading kernels, which happens in any of them, counts separately."""

    def __init__(self) -> None:
        self.parts = {"start and kernels": process_time()}

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Count what is done to a part."""
        begin = perf_counter()
        from swashplate.machine.code_generation import generating_time

        generated_before = generating_time()
        yield
        kernels = generating_time() - generated_before
        self.parts["start and kernels"] += kernels
        self.parts[name] = self.parts.get(name, 0.0) + perf_counter() - begin - kernels

    def __str__(self) -> str:
        return ", ".join(f"{name} {seconds:.2f} s" for name, seconds in self.parts.items())


@command(
    app,
    "fit",
    examples="""
        swashplate rig hoist --out virtual --perturb 0.1
        swashplate fit virtual/campaign.toml --out fitted
        swashplate fit harbour/campaign.toml --setup mine.toml --starts 50 --seed 1
        swashplate fit harbour/campaign.toml --profile Z16_plus
        swashplate fit valve/campaign.toml --model valve.py
        swashplate simulate fitted/drive.toml step:9
    """,
)
def fit(
    path: CampaignArgument = CAMPAIGN,
    *,
    out: Annotated[
        Path, new_folder("Folder for the fitted drive and its tables.", *FILES, PAGE)
    ] = Path("fitted"),
    axis: AxisOption = None,
    setup: SetupOption = None,
    model: ModelFile = None,
    begin: InitialDrive = None,
    starts: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=0,
            help=(
                "Number of additional starts, spread over the bounds (0: none, even if residuals "
                "call for some)."
            ),
        ),
    ] = None,
    evaluations: Annotated[
        int,
        typer.Option(metavar="N", min=1, help="Largest number of model evaluations per search."),
    ] = MOST_EVALUATIONS,
    profile: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Parameter whose cost profile is computed, or 'all'; may be repeated.",
        ),
    ] = None,
    seed: SeedOption = 0,
    jobs: Annotated[
        int, typer.Option(metavar="N", min=0, help="Number of worker processes (0: all cores).")
    ] = 0,
    dask: DaskOption = None,
    resume: Annotated[
        bool,
        typer.Option(
            "--resume",
            metavar=NO_VALUE,
            help="Continue an interrupted search with the starts saved in DIR.",
        ),
    ] = False,
    loss: Annotated[
        Loss, typer.Option(help="Loss function; the robust ones reduce the weight of outliers.")
    ] = "linear",
    require: RequiredOption = 10.0,
    report: Annotated[
        bool,
        typer.Option(
            "--report/--no-report",
            metavar=NO_VALUE,
            help="Write report.html, a single file that works offline.",
        ),
    ] = True,
    timing: Annotated[
        bool,
        typer.Option("--timing", metavar=NO_VALUE, help="Print the time spent in each part."),
    ] = False,
    force: Force = False,
) -> None:
    """Identify a drive, or a user-defined model, from its tests.

    Fits the runs with the role 'fit', predicts those with the role
    'validate', and shows which parameters the data determine. Writes the
    fitted drive as a parameter file, the fit setup, the estimates with
    their intervals, and the data that 'report' needs. Exit code 1: the result is
    not usable. Ctrl-C (exit code 130) and SIGTERM (143) end it within 5 s
    and leave no result, or the whole one without its report; of several starts,
    those that have ended are kept for --resume.
    """
    clock = StageClock()
    check_folder(out)
    lock(out)
    if not resume:
        check_free(*(out / name for name in FILES), force=force)
        if report:
            check_free(out / PAGE, force=force)
    if model is not None and (setup is not None or begin is not None):
        raise InputError(
            f"{model} defines its free parameters and their initial values: leave out --setup "
            "and --from."
        )
    with spinner("Starting"), clock.part("start and kernels"):
        from swashplate.executors import Dask, Processes
        from swashplate.identification import identify
    with spinner(f"Reading {path}"), clock.part("reading"):
        campaign, axis_name = parsing.campaign_of(path, axis)
        start: Path | ParameterSet | None = model
        if begin is not None:
            start = parsing.parameters_of(begin)
    with spinner("Fitting"), clock.part("search"):
        try:
            result = identify(
                campaign,
                start,
                setup,
                axis=axis_name,
                starts=starts,
                profiles=profile or (),
                seed=seed,
                loss=loss,
                max_evaluations=evaluations,
                required=require / 100.0,
                executor=Dask(dask) if dask is not None else Processes(jobs or None),
                store=out / "starts",
                resume=resume,
            )
        except Stopped:
            if ended := len([*(out / "starts").glob("start-*.json")]):
                note(
                    f"Interrupted: {count(ended, 'finished start is', 'finished starts are')} kept "
                    f"in {out / 'starts'}; the same command with --resume continues."
                )
            raise
    with spinner("Assessing"), clock.part("assessment"):
        verdict = result.verdict
    with clock.part("report"):
        lines = _written(result, out)
        lines += [_reported(result, out)] if report else []
    note(parsing.title_of(campaign))
    if result.key_numbers is not None:
        show_numbers(result.key_numbers)
    _say_verdict(verdict)
    _say_fit(result)
    for line in [*lines, f"Time:      {clock}"] if timing else lines:
        note(line)
    _end(verdict)


def _say_fit(result: Identification) -> None:
    """Print the estimates, and how well each run is followed."""
    from swashplate.identification import parts_of

    text_above = False
    for part in parts_of(result):
        if part.heading:
            note(f"\n{part.heading}" if text_above else part.heading)
        if part.tables:
            show(*part.tables)
        for remark in part.remarks:
            say(remark)
        bullets(part.sentences)
        text_above = bool(part.remarks or part.sentences)


def _written(result: Identification, out: Path) -> list[str]:
    """Write the folder of a fit; lines that name its files."""
    with as_a_whole():
        return [f"{FILES[file.name] + ':':10} {file}" for file in result.save(out)]


def _reported(result: Identification, out: Path, truth: ParameterSet | None = None) -> str:
    """Write the report; a line that says so."""
    with spinner("Writing the report"):
        result.report(out / PAGE, truth=truth)
    return f"Report:    {out / 'report.html'}"


def _say_verdict(verdict: Verdict) -> None:
    """Print the verdict: its headline, the stated errors, what it rests on, and its answers."""
    note("")
    if verdict.usable:
        say(verdict.headline)
    if verdict.validity:
        say(verdict.validity)
    show(verdict.table())
    bullets(verdict.remarks)
    if verdict.assumed:
        say("Assumed, as these logs cannot show it:")
    bullets(verdict.assumed)
    for name, answer in verdict.answers().items():
        say(f"{name}: {answer}")


def _end(verdict: Verdict) -> None:
    """End with the headline if the assessed drive is usable, otherwise with it and code 1."""
    if not verdict.usable:
        side.print(verdict.headline)
        raise typer.Exit(1)
    say(verdict.headline)


@command(
    app,
    "validate",
    examples="""
        swashplate validate fitted/drive.toml virtual/campaign.toml
        swashplate validate hoist harbour/campaign.toml --role all --out validation
    """,
)
def validate(
    drive: DriveArgument,
    path: CampaignArgument = CAMPAIGN,
    *,
    axis: AxisOption = None,
    model: ModelFile = None,
    role: Annotated[
        Role, typer.Option(help="Runs to predict: those held out, those to fit, or both.")
    ] = "validate",
    out: Annotated[
        Path | None, new_folder("Folder for report.html and measures.csv.", MEASURES_FILE, PAGE)
    ] = None,
    require: RequiredOption = 10.0,
    force: Force = False,
) -> None:
    """Predict runs from their command alone and assess the drive by them.

    Prints the errors of each run, the structure left in the residuals, and a
    verdict. Exit code 1: the drive is not usable for these runs.
    """
    from swashplate.drive import Drive
    from swashplate.identification import assess_fit, predict, runs_tables, versions, with_speeds
    from swashplate.identification.diagnostics import refuse_unsound, spike_findings
    from swashplate.parameters import ParameterSet

    if out is not None:
        check_folder(out)
        check_free(out / MEASURES_FILE, out / PAGE, force=force)
    with spinner(f"Reading {path}"):
        parameters: Parameters | None = None if model else parsing.parameters_of(drive)
        campaign, axis_name = parsing.campaign_of(path, axis)
        roles = ("fit", "validate") if role == "all" else (role,)
        runs = [
            experiment for experiment in campaign.select(axis=axis_name) if experiment.role in roles
        ]
    if not runs:
        raise InputError(
            f"{path}: no run of the axis '{axis_name}' has the role "
            f"{' or '.join(map(repr, roles))}; select another with --role."
        )
    with spinner("Predicting"):
        refuse_unsound(spike_findings(runs, "linear"))
        if model is not None:
            parameters = parsing.model_parameters_of(drive, model, runs)
        assert parameters is not None
        of_fit = parsing.fit_of(drive, parameters.numbers)
        predicted = predict(parameters, runs, None if of_fit is None else of_fit.posterior)
        if not predicted:
            raise InputError(f"{path}: all samples of these runs are ignored; nothing is left.")
        stated = None if of_fit is None else of_fit.verdict
        verdict = assess_fit(None, predicted, required=require / 100.0, of_fit=stated)
        measures = runs_tables(with_speeds(predicted))
        numbers = None
        if isinstance(parameters, ParameterSet):
            numbers = parsing.key_numbers_of(drive, Drive(parameters))
    lines = []
    if out is not None:
        from swashplate.report.fit_report import write_validation_report

        with spinner("Writing the report"):
            joined(measures).write(made_folder(out) / MEASURES_FILE)
            page = out / PAGE
            notes = {**versions(), "drive from": drive}
            write_validation_report(
                parameters,
                campaign,
                page,
                predicted,
                verdict=verdict,
                notes=notes,
                key_numbers=numbers,
            )
        lines = [f"Measures:  {out / 'measures.csv'}", f"Report:    {page}"]
    note(f"{parsing.title_of(campaign)}, {axis_name}: {parameters.name} from {drive}")
    if numbers is not None:
        show_numbers(numbers)
    _say_verdict(verdict)
    show(*measures)
    say(MEASURES)
    for line in lines:
        note(line)
    _end(verdict)


@command(
    app,
    "report",
    examples="""
        swashplate fit virtual/campaign.toml --out fitted
        swashplate report fitted virtual/campaign.toml --truth virtual/truth
        swashplate report fitted virtual/campaign.toml --pdf report.pdf
    """,
)
def report(
    fitted: Annotated[
        Path,
        typer.Argument(metavar="FITTED", help="Folder that 'fit' wrote, or its drive.toml."),
    ],
    path: Annotated[
        Path | None,
        typer.Argument(
            metavar="CAMPAIGN.toml",
            help="Campaign that was fitted (default: where 'fit' found it).",
        ),
    ] = None,
    *,
    model: ModelFile = None,
    pdf: Annotated[
        Path | None, new_file(PRINTED, "Also print the report to PDF; needs Chromium.")
    ] = None,
    data: Annotated[
        Path | None,
        new_file(TABLE, "Write all samples, measured and simulated: .csv or .parquet."),
    ] = None,
    truth: Annotated[
        str | None,
        typer.Option(
            metavar="TRUTH",
            help=(
                "True parameters of virtual tests, shown next to the estimates: folder or "
                "parameter file."
            ),
        ),
    ] = None,
    force: Force = False,
) -> None:
    """Write the report of a fit again, from the data that the fit stored.

    Nothing is fitted. The campaign must be the one that was fitted: if its
    samples, weights or ignored windows have changed, the report is refused.
    """
    from swashplate.identification import Identification
    from swashplate.report.fit_report import find_browser, print_report, shown_runs, write_samples

    if pdf is not None:
        find_browser()
    folder = fitted if fitted.is_dir() else fitted.parent
    with spinner(f"Reading {folder / 'fit.json'}"):
        true = None if truth is None else parsing.parameters_of(truth)
        result = Identification.load(fitted, path, model=model)
        if true is not None and not result.campaign.virtual:
            raise InputError(
                f"{result.campaign.path} is not virtual, so its true parameters are unknown: leave "
                "out --truth."
            )
        if fitted.suffix.lower() == ".toml":
            fitted_numbers = parsing.parameters_of(str(fitted)).numbers
            numbers = result.fit.parameters
            differing = [
                name for name, value in numbers.numbers.items() if fitted_numbers[name] != value
            ]
            if differing:
                raise InputError(
                    f"{fitted} is not the drive that {folder / 'fit.json'} found "
                    f"({', '.join(differing[:3])} differ): assess it with 'swashplate validate'."
                )
    with spinner("Assessing"):
        verdict = result.verdict
    note(_reported(result, folder, true))
    save(pdf, "Printed", lambda to: print_report(folder / PAGE, to))
    runs = shown_runs(result.fit, result.predicted)
    save(data, "Samples, in SI", lambda to: write_samples(runs, to))
    say_saved()
    say(verdict.headline)


@command(
    app,
    "demo",
    examples="""
        swashplate demo
        swashplate demo --out results --seed 3
    """,
)
def demo(
    *,
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder for logs, drive and report.")
    ] = Path("demo"),
    seed: SeedOption = 1,
    force: Force = False,
) -> None:
    """Identify a virtual hoist from its tests, and compare it with the truth.

    Draws a hoist that differs from the published one, records the 13 tests of
    Kruse (2001) with a 12-bit command, an ammeter and an encoder, fits amplifier,
    pump and motor to ten of them, predicts the other three and writes a report.
    Takes less than a minute. Replaces an earlier demo.
    """
    from swashplate import rig
    from swashplate.campaign import Campaign
    from swashplate.drive import Drive
    from swashplate.identification import (
        drawn_drive,
        estimates_table,
        identify,
        runs_tables,
        truth_count,
        whole_drive,
        with_speeds,
    )
    from swashplate.report.figures import plot_channel, save_figure

    if not (out / "virtual" / "truth").is_dir():  # only an earlier demo is replaced
        check_free(out, force=force)
    lock(out)
    with long_work("", 5) as begin:
        begin("testing the virtual hoist")
        nominal = Drive.preset("hoist").at_every_rate()
        truth = drawn_drive(nominal, whole_drive(nominal.parameters), seed)
        path = rig.write(rig.run("hoist", truth=truth, seed=seed), out / "virtual", overwrite=True)
        begin("reading its logs")
        campaign = Campaign.from_toml(path)
        begin("fitting amplifier, pump and motor")
        result = identify(campaign, seed=seed)
        begin("computing intervals and verdict")
        verdict = result.verdict
        begin("writing the report")
        lines = [*_written(result, out), _reported(result, out, truth.parameters)]
        runs = with_speeds(result.predicted)
        run = [e for e in runs if e.experiment[e.channel].kind == "shaft_speed"][-1]
        title = f"{run.experiment.run}: held out, predicted from the voltage"
        if run.measures.fit_percent is not None:
            title += f", fit {run.measures.fit_percent:.1f} %"
        figure = plot_channel(run.experiment[run.channel], run.simulated, title=title)
        save_figure(figure, out / "result.png")
    note(f"Campaign:  {path}")
    estimates = estimates_table(result.fit, truth=truth.parameters)
    show(estimates)
    inside, total = truth_count(estimates)
    say(f"The truth lies within the 95 % interval for {inside} of {total} parameters.")
    note("\nHeld out of the fit, and predicted")
    show(*runs_tables(result.predicted))
    say(verdict.headline)
    for line in [*lines, f"Figure:    {out / 'result.png'}"]:
        note(line)
