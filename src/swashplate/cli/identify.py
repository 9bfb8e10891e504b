"""``swashplate fit``, ``validate``, ``report`` and ``demo``: from tests to a judged drive."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter, process_time
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from swashplate.cli import words
from swashplate.cli.options import AxisName, Required, option
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
    side,
    working,
)
from swashplate.errors import InputError
from swashplate.tables import PRINTED, TABLE, check_folder, joined, made_folder

if TYPE_CHECKING:
    from swashplate.identification.assessment import Identification
    from swashplate.identification.judging import Verdict
    from swashplate.identification.stages import Parameters
    from swashplate.parameters.parameter_set import ParameterSet

INTERRUPTED = 130
"""Exit code after Ctrl-C, as of other programs."""
MOST_EVALUATIONS = 600
FILES = {
    "drive.toml": "Drive",
    "parameters.toml": "Numbers",
    "setup.toml": "Settings",
    "estimates.csv": "Estimates",
    "fit.json": "Fit",
}
"""What `Identification.save` writes, of a drive or of a user-defined model."""
MEASURES = (
    "NRMSE is the RMSE over the standard deviation of what was measured, fit % is 100 (1 - NRMSE); "
    "'of range' below means over the largest less the smallest value of the signal."
)

Loss = Literal["linear", "soft_l1", "cauchy"]
Role = Literal["validate", "fit", "all"]
CAMPAIGN = Path("campaign.toml")


class Clock:
    """Where the time goes, part after part; kernels are loaded in any of them, and count apart."""

    def __init__(self) -> None:
        self.parts = {"start and kernels": process_time()}

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Count what is done to a part."""
        begun = perf_counter()
        from swashplate.equations.functions import generating_time

        before = generating_time()
        yield
        kernels = generating_time() - before
        self.parts["start and kernels"] += kernels
        self.parts[name] = self.parts.get(name, 0.0) + perf_counter() - begun - kernels

    def __str__(self) -> str:
        return ", ".join(f"{name} {seconds:.2f} s" for name, seconds in self.parts.items())


def fit(
    path: Path = CAMPAIGN,
    *,
    out: Path = Path("fitted"),
    axis: AxisName = None,
    setup: str | None = None,
    model: Path | None = None,
    joint: bool = False,
    begin: str | None = None,
    starts: Annotated[
        int | None,
        option(
            "More starts, spread over the bounds; 0 tries none, even if residuals ask for some.",
            min=0,
            metavar="N",
        ),
    ] = None,
    evaluations: Annotated[
        int, option("Evaluations of the model that a search may take.", min=1, metavar="N")
    ] = MOST_EVALUATIONS,
    folds: int = 0,
    profile: list[str] | None = None,
    seed: int = 0,
    jobs: int = 0,
    dask: str | None = None,
    resume: bool = False,
    loss: Loss = "linear",
    require: Required = 10.0,
    report: Annotated[bool, option("Write report.html, one file that works offline.")] = True,
    timing: bool = False,
) -> None:
    """Identify a drive, or a model of your own, from its tests.

    Fits the runs with the role 'fit', stage after stage, predicts those with the
    role 'validate', and says what the data determine. Writes the drive as a
    parameter file that 'simulate' takes, the fit configuration, the estimates
    with their intervals, and what 'report' needs to write the report again.
    Ctrl-C or SIGTERM keeps the best so far, of several starts those that ended,
    and the exit code is 130. It is 1 if the result is not usable.

    Options:
      out DIR: Folder for the fitted drive and its tables.
      joint: After the stages, estimate all parameters at once, through the whole drive.
      folds: Cross-validate over so many parts of the runs; 0 = off.
      profile NAME: Profile the cost along this parameter, or 'all'; may be repeated.
      jobs: Processes for all of these; 0 = all cores.
      dask ADDRESS: Run them on the cluster of this scheduler.
      resume: Continue a search: keep the starts that DIR holds already.
      loss: Robust loss functions reduce the weight of outliers.
      timing: Print where the time went, from the start of the process.

    For example:
      swashplate rig hoist --out virtual --perturb 0.1
      swashplate fit virtual/campaign.toml --out fitted
      swashplate fit harbour/campaign.toml --setup mine.toml --starts 50 --seed 1
      swashplate fit harbour/campaign.toml --folds 5 --profile Z16_plus
      swashplate fit valve/campaign.toml --model valve.py
      swashplate simulate fitted/drive.toml step:9
    """
    clock = Clock()
    check_folder(out)
    lock(out)
    if not resume:
        check_free(*(out / name for name in FILES))
        if report:
            check_free(out / "report.html")
    if model is not None and (setup is not None or begin is not None or joint):
        raise InputError(f"{model} says what is free and where it begins: leave out the others.")
    with working("Starting"), clock.part("start and kernels"):
        from swashplate.executors import Dask, Processes
        from swashplate.identification.identifying import identify
    with working(f"Reading {path}"), clock.part("reading"):
        campaign, chosen = words.campaign_of(path, axis)
        start: Path | ParameterSet | None = model
        if begin is not None:
            start = words.parameters_of(begin)
    with working("Fitting"), clock.part("search"):
        result = identify(
            campaign,
            start,
            setup,
            axis=chosen,
            joint=joint,
            starts=starts,
            folds=folds,
            profiles=profile or (),
            seed=seed,
            loss=loss,
            max_evaluations=evaluations,
            required=require / 100.0,
            executor=Dask(dask) if dask is not None else Processes(jobs or None),
            store=out / "starts",
            resume=resume,
        )
    if result.fit.interrupted and starts:
        last = result.fit.stages[-1]
        note(
            f"Interrupted in the stage '{last.stage.name}': {last.solution.message}. The same "
            "command with --resume goes on; nothing is written but the starts."
        )
        raise typer.Exit(INTERRUPTED)
    with working("Judging"), clock.part("judging"):
        verdict = result.verdict
    with clock.part("report"):
        lines = _written(result, out)
        lines += [_reported(result, out)] if report else []
    note(f"{campaign.title}{' (virtual)' * campaign.virtual}")
    _say_fit(result)
    for line in [*lines, f"Time:      {clock}"] if timing else lines:
        note(line)
    if result.fit.interrupted:
        note("Interrupted: this is the best so far, not an optimum.")
        raise typer.Exit(INTERRUPTED)
    _say_verdict(verdict)


def _say_fit(found: Identification) -> None:
    """What was found, stage by stage, and how well each run is followed."""
    from swashplate.identification.assessment import parts_of

    text_above = False
    for part in parts_of(found):
        if part.heading:
            note(f"\n{part.heading}" if text_above else part.heading)
        if part.tables:
            show(*part.tables)
        for remark in part.remarks:
            say(remark)
        bullets(part.sentences)
        text_above = bool(part.remarks or part.sentences)


def _written(found: Identification, out: Path) -> list[str]:
    """Write the folder of a fit; lines that name its files."""
    return [f"{FILES[file.name] + ':':10} {file}" for file in found.save(out)]


def _reported(found: Identification, out: Path, truth: ParameterSet | None = None) -> str:
    """Write the report; a line that says so."""
    with working("Writing the report"):
        found.report(out / "report.html", truth=truth)
    return f"Report:    {out / 'report.html'}"


def _say_verdict(verdict: Verdict) -> None:
    """Print the stated errors, what the verdict rests on, its answers, and the headline.

    Ends with code 1 if what was judged is not usable.
    """
    show(verdict.table())
    bullets(verdict.remarks)
    if verdict.assumed:
        say("Assumed, as these logs cannot show it:")
    bullets(verdict.assumed)
    for name, answer in verdict.answers().items():
        say(f"{name}: {answer}")
    if not verdict.usable:
        side.print(verdict.headline)
        raise typer.Exit(1)
    say(verdict.headline)
    if verdict.validity:
        say(verdict.validity)


def validate(
    drive: str,
    path: Path = CAMPAIGN,
    *,
    axis: AxisName = None,
    model: Path | None = None,
    role: Role = "validate",
    out: Path | None = None,
    require: Required = 10.0,
) -> None:
    """Predict runs from their command alone and judge the drive by them.

    Prints errors run by run, what is left in the residuals, and a verdict. The
    exit code is 1 if the drive is not usable for these runs.

    Options:
      drive SET.toml: The drive: a parameter file, the folder of a fit, or a packaged one.
      role: Runs that were held out, those to fit, or both.
      out DIR: Folder for report.html and measures.csv.

    For example:
      swashplate validate fitted/drive.toml virtual/campaign.toml
      swashplate validate hoist harbour/campaign.toml --role all --out validation
    """
    from swashplate.identification import tables
    from swashplate.identification.assessment import versions
    from swashplate.identification.data_checks import refuse_unsound, spike_findings
    from swashplate.identification.judging import verdict
    from swashplate.identification.validation import predict, with_speeds

    if out is not None:
        check_folder(out)
        check_free(out / "measures.csv", out / "report.html")
    with working(f"Reading {path}"):
        parameters: Parameters | None = None if model else words.parameters_of(drive)
        campaign, chosen = words.campaign_of(path, axis)
        wanted = ("fit", "validate") if role == "all" else (role,)
        runs = [each for each in campaign.select(axis=chosen) if each.role in wanted]
    if not runs:
        raise InputError(
            f"{path}: no run of the axis '{chosen}' has the role {' or '.join(map(repr, wanted))}; "
            "another one is asked for with --role."
        )
    with working("Predicting"):
        refuse_unsound(spike_findings(runs, "linear"))
        if model is not None:
            parameters = words.model_parameters_of(drive, model, runs)
        assert parameters is not None
        predicted = predict(parameters, runs)
        if not predicted:
            raise InputError(f"{path}: all samples of these runs are ignored; nothing is left.")
        judged = verdict((), predicted, required=require / 100.0)
        measures = tables.runs_tables(with_speeds(predicted))
    lines = []
    if out is not None:
        from swashplate.report.fit_report import write_validation_report

        with working("Writing the report"):
            joined(measures).write(made_folder(out) / "measures.csv")
            page, notes = out / "report.html", {**versions(), "drive from": drive}
            write_validation_report(
                parameters, campaign, page, predicted, judged=judged, notes=notes
            )
        lines = [f"Measures:  {out / 'measures.csv'}", f"Report:    {page}"]
    virtual = " (virtual)" * campaign.virtual
    note(f"{campaign.title}{virtual}, {chosen}: {parameters.name} from {drive}")
    show(*measures)
    say(MEASURES)
    for line in lines:
        note(line)
    _say_verdict(judged)


def report(
    fitted: Path,
    path: Path | None = None,
    *,
    model: Path | None = None,
    pdf: Annotated[Path | None, PRINTED] = None,
    data: Annotated[Path | None, TABLE] = None,
    truth: str | None = None,
) -> None:
    """Write the report of a fit again, from what the fit stored.

    Nothing is fitted. The campaign must be the one that was fitted: if its
    samples, weights or ignored windows have changed, the report is refused.

    Options:
      fitted FITTED: The folder that 'fit' wrote, or its drive.toml.
      path PATH: The campaign that was fitted; where 'fit' found it, if omitted.
      pdf FILE: Print the report to this PDF as well, by Chromium.
      data FILE: Write all samples, measured and simulated, as one table: .csv or .parquet.
      truth TRUTH: Of virtual tests: the folder or parameter file of what was simulated, to stand
          beside the estimates.

    For example:
      swashplate fit virtual/campaign.toml --out fitted
      swashplate report fitted virtual/campaign.toml --truth virtual/truth
      swashplate report fitted virtual/campaign.toml --pdf report.pdf
    """
    from swashplate.identification.assessment import Identification
    from swashplate.report.fit_report import find_browser, print_report, shown_runs, write_samples

    if pdf is not None:
        find_browser()
    folder = fitted if fitted.is_dir() else fitted.parent
    with working(f"Reading {folder / 'fit.json'}"):
        true = None if truth is None else words.parameters_of(truth)
        found = Identification.load(fitted, path, model=model)
        if true is not None and not found.campaign.virtual:
            raise InputError(
                f"{found.campaign.path} is not virtual: nobody knows its truth, leave out --truth."
            )
        if fitted.suffix.lower() == ".toml":
            given, numbers = words.parameters_of(str(fitted)).numbers, found.fit.parameters
            other = [name for name, value in numbers.numbers.items() if given[name] != value]
            if other:
                raise InputError(
                    f"{fitted} is not the drive that {folder / 'fit.json'} found "
                    f"({', '.join(other[:3])} differ): judge it with 'swashplate validate'."
                )
    with working("Judging"):
        verdict = found.verdict
    note(_reported(found, folder, true))
    save(pdf, "Printed", lambda to: print_report(folder / "report.html", to))
    runs = shown_runs(found.fit.stages, found.predicted)
    save(data, "Samples, in SI", lambda to: write_samples(runs, to))
    say_saved()
    say(verdict.headline)


def demo(*, out: Path = Path("demo"), seed: int = 1) -> None:
    """Identify a virtual hoist from its tests, and compare it with the truth.

    Draws a hoist that differs from the published one, logs the 13 tests of
    Kruse (2001) through a 12-bit command, an ammeter and an encoder, fits card,
    pump and motor to ten of them, predicts the other three and writes a report.
    Takes less than a minute. An earlier demo is replaced.

    Options:
      out FOLDER: Folder for logs, drive and report.

    For example:
      swashplate demo
      swashplate demo --out results --seed 3
    """
    from swashplate import rig
    from swashplate.campaign import Campaign
    from swashplate.drive import Drive
    from swashplate.identification import tables
    from swashplate.identification.fitting import drawn
    from swashplate.identification.identifying import identify
    from swashplate.identification.setup import load_setup
    from swashplate.identification.validation import with_speeds
    from swashplate.report.figures import plot_channel, save_figure

    if not (out / "virtual" / "truth").is_dir():  # an earlier demo is replaced, nothing else
        check_free(out)
    lock(out)
    setup = load_setup("hoist")
    with long_work("", 5) as begin:
        begin("testing the virtual hoist")
        truth = drawn(Drive.preset("hoist").at_every_rate(), setup, seed)
        path = rig.write(rig.run("hoist", truth=truth, seed=seed), out / "virtual", overwrite=True)
        begin("reading its logs")
        campaign = Campaign.from_toml(path)
        begin("fitting the card, then pump and motor")
        found = identify(campaign, seed=seed)
        begin("computing intervals and verdict")
        verdict = found.verdict
        begin("writing the report")
        lines = [*_written(found, out), _reported(found, out, truth.parameters)]
        runs = with_speeds(found.predicted)
        run = [e for e in runs if e.experiment[e.channel].kind == "shaft_speed"][-1]
        title = f"{run.experiment.run}: held out, predicted from the voltage"
        if run.measures.fit_percent is not None:
            title += f", fit {run.measures.fit_percent:.1f} %"
        figure = plot_channel(run.experiment[run.channel], run.simulated, title=title)
        save_figure(figure, out / "result.png")
    note(f"Campaign:  {path}")
    made = [tables.estimates_table(e, truth=truth.parameters) for e in found.fit.stages]
    show(*made)
    inside, counted = tables.truth_count(made)
    say(f"The truth lies within the 95 % interval for {inside} of {counted} parameters.")
    note("\nHeld out of the fit, and predicted")
    show(*tables.runs_tables(found.predicted))
    say(verdict.headline)
    for line in [*lines, f"Figure:    {out / 'result.png'}"]:
        note(line)
