"""``swashplate campaign``, ``rig``, ``guess`` and ``advise``: tests, and what they are worth."""

from __future__ import annotations

import shlex
from dataclasses import replace
from math import radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import typer

from swashplate.cli import parsing, trials
from swashplate.cli.commands import command
from swashplate.cli.options import (
    CAMPAIGN,
    NO_VALUE,
    AxisOption,
    CampaignArgument,
    DriveChoice,
    Force,
    InitialDrive,
    ModelFile,
    SeedOption,
    SetupOption,
    new_file,
    new_folder,
)
from swashplate.cli.terminal import (
    bullets,
    check_free,
    check_writable,
    draw_figure,
    note,
    save,
    say,
    show,
    show_numbers,
    spinner,
)
from swashplate.errors import InputError
from swashplate.tables import (
    FIGURE,
    TABLE,
    Column,
    Form,
    Table,
    check_folder,
    count,
    ended,
    made_folder,
    write_text,
)
from swashplate.units import unit_text

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from swashplate.identification import Advice, RunInformation, Sensor

LEGEND = (
    "jitter and longest gap in ms; clip: % of the samples at the ends of the instrument's range;\n"
    "lost: jumps that no motion explains"
)
INFORMATION = (
    "Under 'runs', one symbol per run: # gives 20 % or more of the information, + gives less, . "
    "gives none, - is not fitted here. 'effect' is the change of all residuals together for 1 % of "
    "the value; 1 is one standard deviation of noise."
)
Severity = Literal["clean", "realistic", "harsh"]
CAMPAIGN_FILE = Form("a campaign file")

app = typer.Typer(rich_markup_mode="rich")
files = typer.Typer(
    help="Campaigns of measured tests: create, check and plot.",
    no_args_is_help=True,
    rich_markup_mode="rich",
)
app.add_typer(files, name="campaign")


# --- campaign files -------------------------------------------------------------------------------


@command(
    files,
    "init",
    examples="""
        swashplate campaign init logs/*.csv --drive hoist --title "Winch 3, harbour, J. Weber"
        swashplate campaign init trial1.mat trial2.mat --out trials.toml
        swashplate campaign init log.csv --column voltage=u --column shaft_speed=n --unit n=1/min
    """,
    units=False,
)
def init(
    *,
    logs: Annotated[list[Path], typer.Argument(metavar="LOGS...", help="Logs, one run each.")],
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Campaign file (default: campaign.toml next to the first log)."
        ),
    ] = None,
    drive: Annotated[
        str | None,
        typer.Option(
            metavar="AXIS|SET.toml", help="Packaged drive or parameter file of the tested machine."
        ),
    ] = None,
    counts_per_turn: Annotated[
        float | None,
        typer.Option(
            metavar="COUNTS",
            help="Encoder counts per revolution incl. quadrature; if omitted, a FIXME is written.",
        ),
    ] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KIND=COLUMN",
            help="Kind of a column: time, voltage, shaft_speed or another; may be repeated.",
        ),
    ] = None,
    unit: Annotated[
        list[str] | None,
        typer.Option(metavar="COLUMN=UNIT", help="Unit of a column; may be repeated."),
    ] = None,
    layout: Annotated[
        list[str] | None,
        typer.Option(
            "--format",
            metavar="KEY=VALUE",
            help="Layout of text logs: delimiter, decimal, thousands, comment, header_row or "
            "encoding; may be repeated.",
        ),
    ] = None,
    title: Annotated[
        str | None,
        typer.Option(
            metavar="TEXT",
            help="Title of the report: machine, place, author (default: name of the folder).",
        ),
    ] = None,
    force: Force = False,
) -> None:
    """Draft a campaign file from the headers of logs.

    Columns are identified from name and unit and marked "guessed"; unknown
    entries are marked FIXME. A command in the words of a PLC, 27648 or 32767 at
    full scale, is scaled to volts; a sensor in such words needs its range.
    Correct the entries, then run 'swashplate campaign check'.
    """
    from swashplate.campaign import FIXME
    from swashplate.drafting import LEFT_OUT, NO_ENCODER, SEVERAL, UNUSED, draft_campaign

    target = out or logs[0].parent / "campaign.toml"
    check_writable(target, CAMPAIGN_FILE, force=force)
    file = None if drive is None else parsing.drive_file(drive)
    if file is not None:  # a drive as a campaign file names it
        resolved = file.resolve()
        root = target.parent.resolve()
        drive = (
            resolved.relative_to(root) if resolved.is_relative_to(root) else resolved
        ).as_posix()
    kinds = {
        name: kind for kind, name in parsing.pairs_of("--column", column, "voltage=u", often=True)
    }
    units = dict(parsing.pairs_of("--unit", unit, "u=mV"))
    options = parsing.text_options(layout)
    with spinner("Reading"):
        text = draft_campaign(
            logs,
            target.parent,
            drive,
            counts_per_turn,
            columns=kinds,
            units=units,
            title=title,
            options=options,
        )
    write_text(text, target)
    note(f"Draft: {target}")
    guessed = text.count("# guessed")
    note(f"{count(guessed, 'entry is', 'entries are')} guessed: look for '# guessed'.")
    table = ""
    open_ends = (f"# {FIXME}", f'column = "{FIXME}"', f"# {LEFT_OUT}", "# another input?")
    for line in text.splitlines():
        if line.startswith(("[", "file = ")):  # a run is known by its file
            table = line.partition("    #")[0]
        if line.startswith((UNUSED, NO_ENCODER, SEVERAL)):
            note(f"  {line.lstrip('# ')}")
        elif any(end in line for end in open_ends):
            note(f"  {table} {line.lstrip('# ')}")
    note(f"Then run\n  swashplate campaign check {shlex.quote(str(target))}")


@command(
    files,
    "check",
    examples="""
        swashplate campaign check
        swashplate campaign check harbour/campaign.toml --strict
    """,
)
def check(
    path: CampaignArgument = CAMPAIGN,
    *,
    strict: Annotated[
        bool,
        typer.Option("--strict", metavar=NO_VALUE, help="Exit with code 1 if there are findings."),
    ] = False,
) -> None:
    """Check a campaign and the measurements in all its logs.

    Prints rate, jitter, longest interval, range, clipping and lost counts of
    each signal and the maneuver recognised from the voltage. Findings follow
    below each table, also windows that belong to no run and runs far from the
    simulation of the axis's drive.
    """
    from swashplate import campaign as tests
    from swashplate.identification.diagnostics import beside_the_drives

    parsing.check_file_kind(path, "campaign")
    with spinner(f"Reading {path}"):
        campaign = tests.Campaign.from_toml(path)
        unsigned = {name for _, name in tests.unsigned_currents(campaign)}
        qualities = {
            experiment.name: tests.examine(experiment, unsigned) for experiment in campaign
        }
        of_file = dict.fromkeys((*tests.campaign_findings(campaign), *beside_the_drives(campaign)))
        if campaign.without_runs:
            of_file = {campaign.without_runs: None}
    roles = [experiment.role for experiment in campaign]
    counts_by_role = ", ".join(f"{roles.count(role)} to {role}" for role in dict.fromkeys(roles))
    in_roles = f" ({counts_by_role})" if roles else ""
    note(f"{parsing.title_of(campaign)}: {len(campaign)} experiments{in_roles}")
    for overview in campaign.overviews:
        show(overview.table())
        bullets([overview.sentence])
    for experiment in campaign:
        qualities_of_run = qualities[experiment.name]
        show(tests.quality_table(experiment, qualities_of_run))
        bullets(f"{text}." for text in experiment.notes)
        for quality in qualities_of_run:
            for text in quality.findings:  # unbroken: a line to paste may be in it
                note(ended(f"! {quality.signal}: {text}"))
    if len(campaign):
        note(LEGEND)
    for text in of_file:
        say(ended(f"! {text}"))
    findings = len(of_file)
    for qualities_of_run in qualities.values():
        findings += sum(len(quality.findings) for quality in qualities_of_run)
    if campaign.ignored:
        note(f"Ignored, and not opened: {', '.join(campaign.ignored)}.")
    if not campaign.select(role="fit"):
        note("No run has the role 'fit'.")
    note(f"{count(findings, 'finding')}, marked by '!'." if findings else "No findings.")
    if strict and findings:
        raise typer.Exit(1)


@command(
    files,
    "plot",
    examples="""
        swashplate campaign plot harbour/campaign.toml --out overview.png
        swashplate campaign plot --run hoistr6 --channel counts --from 5.8 --to 6.6
    """,
)
def plot(
    path: CampaignArgument = CAMPAIGN,
    *,
    out: Annotated[Path, new_file(FIGURE, "Figure: .png, .svg or .pdf.")] = Path("campaign.png"),
    run: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Run to plot in detail; requires --channel."),
    ] = None,
    channel: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help=(
                "Channel to plot: a position with its speed, another channel with the simulation "
                "of the axis's drive."
            ),
        ),
    ] = None,
    begin: Annotated[
        float | None, typer.Option("--from", metavar="S", help="Start of the plot.")
    ] = None,
    end: Annotated[float | None, typer.Option("--to", metavar="S", help="End of the plot.")] = None,
    force: Force = False,
) -> None:
    """Plot all runs and channels of a campaign, or one channel in detail.

    The overview is one figure for each axis and eight runs, numbered if there
    are several. A log of more than 250,000 rows has a figure of its own that
    marks the windows in use.
    """
    from swashplate.campaign import SIGNALS, Campaign
    from swashplate.identification import predict

    with spinner(f"Reading {path}"):
        campaign = Campaign.from_toml(path)
    if campaign.without_runs:
        raise InputError(f"{campaign.without_runs}.")
    channels = () if run is None else campaign[run].channels
    if (run is None) != (channel is None):
        channels_listed = f"; {run} has {', '.join(channels)}" if channels else ""
        raise InputError(
            "--run and --channel go together: give both, or none for the overview"
            f"{channels_listed}."
        )
    if run is not None and channel is not None:
        experiment = campaign[run]
        signal = experiment[channel]
        simulated = None
        drive = campaign.axes[experiment.axis].drive
        if signal.kind in SIGNALS and drive is not None and not signal.is_position:
            for prediction in predict(campaign.drive(experiment.axis), [experiment]):
                if prediction.channel == channel:
                    simulated = prediction.simulated
        window = trials.window_of(signal.time, begin, end)
        labels = {"window": window, "title": f"{run}, {channel}"}
        draw_figure(out, "plot_channel", signal, simulated, **labels)
    else:
        figures = campaign.plot(title=parsing.title_of(campaign))
        several = [out.with_stem(f"{out.stem}-{k}") for k in range(1, len(figures) + 1)]
        check_free(*several, force=force)
        for path, figure in zip([out] if len(figures) == 1 else several, figures, strict=True):
            draw_figure(path, figure)


# --- virtual tests --------------------------------------------------------------------------------


@command(
    app,
    "rig",
    examples="""
        swashplate rig hoist --out virtual-hoist
        swashplate rig slew --out worn --seed 7 --severity harsh --backlash-deg 0.1
        swashplate rig hoist --out loaded --set load_torque=30kN*m --set motor_leakage=1e-6
        swashplate rig hoist --out short --maneuver step:4 --maneuver sine:6,0.2 --perturb 0.1
        swashplate campaign check virtual-hoist/campaign.toml
    """,
)
def rig(
    drive: DriveChoice,
    *,
    out: Annotated[
        Path,
        new_folder(
            "New or empty folder for logs and campaign.", "campaign.toml", "*.csv", "truth/*"
        ),
    ],
    seed: SeedOption = 1,
    severity: Annotated[
        Severity, typer.Option(help="Quality of the instruments: perfect, good, or poor.")
    ] = "realistic",
    backlash_deg: Annotated[
        float, typer.Option(metavar="DEG", help="Backlash between shaft and encoder.")
    ] = 0.0,
    perturb: Annotated[
        float,
        typer.Option(
            metavar="X",
            help="Random change of all true parameters, also fixed ones, as a share: 0.1.",
        ),
    ] = 0.0,
    maneuver: Annotated[
        list[str] | None,
        typer.Option(
            metavar="MANEUVER",
            help="Test in place of those of Kruse (2001), such as step:4; may be repeated.",
        ),
    ] = None,
    force: Force = False,
) -> None:
    """Create a virtual test campaign: logs, campaign file and the true parameters.

    Simulates a drive with known parameters over the tests of Kruse (2001), read
    by instruments with the chosen errors. --set and --scale change the simulated
    drive, not the one that a fit starts from. Fit it like logs of your machine,
    then compare with the folder truth. All files are marked as virtual.
    """
    from swashplate import rig as bench

    check_free(out, force=force)
    with spinner("Simulating"):
        nominal = parsing.drive_of(drive.drive)
        tests = bench.run(
            nominal if parsing.drive_file(drive.drive) else drive.drive,
            [trials.named_maneuver(word, nominal) for word in maneuver or ()] or None,
            seed=seed,
            severity=severity,
            instruments=replace(bench.SEVERITIES[severity], backlash=radians(backlash_deg)),
            truth=drive.loaded_drive if drive.values or drive.factors else None,
            perturb=perturb,
        )
    with spinner("Writing"):
        path = bench.write(tests, out, overwrite=force)
    text = (Column("log"), Column("maneuver", wrap=True), Column("role"))
    table = Table("", (*text, Column("rows", "d"), Column("s", ".4g")))
    for run in tests.runs.values():
        time = run.columns["time"]
        table.add(f"{run.stem}.csv", run.name, run.role, time.size, float(time[-1] - time[0]))
    show(table)
    note(f"Campaign: {path}")
    note(f"Truth:    {path.parent / 'truth'} (open it only after the fit)")


# --- before a fit, and between fits ---------------------------------------------------------------


@command(
    app,
    "guess",
    examples="""
        swashplate campaign init logs/*.csv --drive neutral
        swashplate guess logs/campaign.toml
        swashplate fit logs/campaign.toml --from logs/start.toml
    """,
)
def guess(
    path: CampaignArgument = CAMPAIGN,
    *,
    axis: AxisOption = None,
    out: Annotated[
        Path | None,
        new_folder(
            "Folder for start.toml (default: the campaign's).",
            "start.toml",
            beside="path",
        ),
    ] = None,
    force: Force = False,
) -> None:
    """Estimate dead zones, gains, limits, delays and creep of an unknown machine.

    Needs logs of the command and of a speed or a position. If a current is
    measured, the amplifier is estimated from it. Writes an
    initial drive for a fit, start.toml, and the parameters to estimate with
    their bounds, setup.toml.
    """
    from swashplate import drafting
    from swashplate.analysis import key_numbers
    from swashplate.campaign import spiked
    from swashplate.drive import Drive
    from swashplate.identification import logged_command, motion_of, runs_to_fit

    folder = path.parent if out is None else out
    start = folder / "start.toml"
    with spinner(f"Reading {path}"):
        check_free(start, force=force)
        campaign, axis_name = parsing.campaign_of(path, axis)
        check_folder(folder)
        runs = runs_to_fit(campaign, axis_name)
        guessed = drafting.guess_drive(runs)
        parameters = replace(
            drafting.guessed_set(guessed, path.name),
            command=logged_command(campaign, axis_name),
            motion=motion_of(runs),
        )
        made_folder(folder)
        Drive(parameters).to_toml(start)
        numbers = key_numbers(Drive(parameters))
    note(f"{guessed.axis}: first guess of the numbers that matter")
    show_numbers(numbers)
    if guessed.amplifier is not None:
        show(drafting.amplifier_table(guessed.amplifier))
        card = guessed.amplifier.card
        like = f"like that of the packaged card {card}" if card else "a plain one"
        say(f"Its filter is {like}; fit {guessed.amplifier.fit_percent:.1f} % of the currents.")
    for sentence, _ in spiked(runs).values():
        note(f"! {sentence}.")
    note(
        f"With these numbers alone: fit {guessed.fit_percent:.1f} % of the mean speeds (100 % is "
        "best)."
    )
    note(f"Start: {start}")
    then = ["swashplate", "fit", str(path), "--from", str(start)]
    note(f"Then run\n  {shlex.join(then)}")


@command(
    app,
    "advise",
    examples="""
        swashplate advise harbour/campaign.toml                      before a fit
        swashplate advise harbour/campaign.toml --setup mine.toml --from worn.toml
        swashplate advise harbour/campaign.toml --drive fitted/drive.toml     after it
        swashplate advise harbour/campaign.toml --maneuver step:-9 --top 1
        swashplate advise harbour/campaign.toml --runs runs.csv --out tests.csv
        swashplate advise hoist                                      before any test
        swashplate advise valve/campaign.toml --model valve.py       a machine of your own
    """,
)
def advise(
    subject: Annotated[
        str,
        typer.Argument(
            metavar="CAMPAIGN.toml|DRIVE",
            help="Campaign with the tests made so far, or a drive that has not been tested.",
        ),
    ] = str(CAMPAIGN),
    *,
    axis: AxisOption = None,
    setup: SetupOption = None,
    begin: InitialDrive = None,
    drive: Annotated[
        str | None,
        typer.Option(
            metavar="SET.toml",
            help=(
                "Fitted drive: noise is that of its residuals, and the default of --setup is the "
                "setup.toml next to it; with --model the folder of its fit."
            ),
        ),
    ] = None,
    model: ModelFile = None,
    maneuver: Annotated[
        list[str] | None,
        typer.Option(
            metavar="MANEUVER", help="Test to rank in place of the usual ones; may be repeated."
        ),
    ] = None,
    largest: Annotated[
        float | None,
        typer.Option(
            metavar="V",
            min=0.1,
            max=10.0,
            help=(
                "Largest command that the usual tests may have (default: the range of the input "
                "that the campaign states, or the largest command of its runs, or of the fit)."
            ),
        ),
    ] = None,
    top: Annotated[int, typer.Option(metavar="N", min=0, help="Number of tests to list.")] = 10,
    tests: Annotated[
        int, typer.Option(metavar="N", min=0, help="Number of tests in the plan.")
    ] = 4,
    runs: Annotated[
        Path | None,
        new_file(TABLE, "Write each run's share of the information: .csv or .parquet."),
    ] = None,
    out: Annotated[
        Path | None, new_file(TABLE, "Write the ranked tests: .csv or .parquet.")
    ] = None,
    force: Force = False,
) -> None:
    """Show which parameters the tests determine, and which test to make next.

    For the tests of a campaign: how much each parameter changes what was
    measured, in which run, and which parameters can change together without
    effect: fix these, or make further tests. Then tests are ranked by the
    information that they would add. All of it holds at the values of one drive:
    the initial one before a fit, the fitted one after it (--drive). Errors are
    standard errors from noise alone, without the errors of the model.
    """
    from swashplate.campaign import KINDS
    from swashplate.drive import Drive
    from swashplate.identification import (
        advise,
        load_setup,
        prior_information,
        run_information,
        whole_drive,
    )
    from swashplate.identification.diagnostics import check_runs, refuse_unsound
    from swashplate.identification.estimation import smooth
    from swashplate.identification.statistics import (
        default_maneuvers,
        largest_of_machine,
        ranges_of_input,
        sequential_plan,
    )

    if model is not None or parsing.machine_word(subject) is not None:
        given: dict[str, object] = {"--setup": setup, "--from": begin, "--largest": largest}
        for option, stated in given.items():
            if stated is not None:
                raise InputError(
                    f"{option} is for a drive: leave it out; the model file states what is free."
                )
        if model is None:
            raise InputError(
                f"{subject} has no tests: name their campaign first, and this file with --model, "
                "as what is measured, and how well, is that of the tests."
            )
        shown = _advice_on_model(Path(subject), axis, model, drive, maneuver or (), tests)
        _show_advice(shown, top, runs=runs, out=out)
        return
    tested = parsing.file_kind(Path(subject)) == "campaign"
    options = {"--axis": axis, "--from": begin, "--drive": drive, "--runs": runs}
    for option, value in options.items():
        if value is not None and not tested:
            raise InputError(f"{option} needs a campaign: {subject} is a drive without tests.")
    if begin is not None and drive is not None:
        raise InputError(
            "--from is the initial drive before a fit, --drive the fitted one: give one of them."
        )
    if setup is None:
        setup = _setup_beside(drive if tested else subject)
    information = None
    doubts = tuple[str, ...]()
    run_names = list[str]()
    commanded = list[tuple[float, float]]()
    with spinner("Evaluating the tests"):
        if tested:
            basis = parsing.fit_basis(Path(subject), axis, setup, drive or begin)
            experiments = basis.experiments
            start = smooth(basis.start)
            doubts = refuse_unsound(check_runs(experiments, start))
            information = run_information(basis.setup, start, experiments)
            run_names = [experiment.name for experiment in experiments]
            prior = prior_information(start, basis.setup, experiments, fitted=drive is not None)
            commanded = ranges_of_input(experiments)
        else:
            untested = parsing.parameters_of(subject)
            of_fit = parsing.fit_of(subject, untested.numbers)
            commands = None if of_fit is None else of_fit.verdict.commands
            if commands is not None and commands.kind == "voltage":
                commanded = [(commands.low, commands.high)]
            basis_setup = whole_drive(untested) if setup is None else load_setup(setup)
            prior = prior_information(smooth(untested), basis_setup)
        machine = Drive(prior.parameters)
        most = largest_of_machine(commanded) if largest is None else (largest, largest)
        requested = [trials.named_maneuver(word, machine) for word in maneuver or ()]
        maneuvers = {test.name: test for test in requested or default_maneuvers(most)}
        candidates = [prior.candidate(test) for test in maneuvers.values()]
        ranked = advise(prior.present, candidates, prior.variables)
        plan_of_tests = sequential_plan(prior.present, candidates, prior.variables, tests)
    sensors = {str(sensor.kind): sensor for sensor in prior.sensors}
    units = {name: KINDS[sensor.kind].units[0] for name, sensor in sensors.items()}
    shown = ShownAdvice(information, run_names, doubts, ranked, plan_of_tests, sensors, units)
    _show_advice(shown, top, runs=runs, out=out)


class ShownAdvice(NamedTuple):
    """What the tests determine, and which come next."""

    information: RunInformation | None
    """None before any test."""
    run_names: Sequence[str]
    doubts: Sequence[str]
    ranked: Sequence[Advice]
    plan: Sequence[Advice]
    sensors: Mapping[str, Sensor]
    """What is measured, by its kind or channel."""
    units: Mapping[str, str]
    """Unit of each."""


def _advice_on_model(
    path: Path,
    axis: str | None,
    model: Path,
    fitted: str | None,
    maneuvers: Sequence[str],
    count_of_tests: int,
) -> ShownAdvice:
    """Advice on the tests of a user-defined model; `fitted` is the folder of its fit."""
    from swashplate.cli.machines import fitted_setup
    from swashplate.identification import (
        advise,
        model_prior_information,
        model_run_information,
        runs_to_fit,
    )
    from swashplate.identification.diagnostics import check_model, refuse_unsound
    from swashplate.identification.statistics import sequential_plan, usual_maneuvers
    from swashplate.maneuvers import parse

    with spinner("Evaluating the tests"):
        campaign, axis_name = parsing.campaign_of(path, axis)
        experiments = runs_to_fit(campaign, axis_name)
        setup = fitted_setup(model, fitted)
        doubts = refuse_unsound(check_model(experiments, setup))
        information = model_run_information(setup, experiments)
        prior = model_prior_information(setup, experiments, fitted=fitted is not None)
        tests = [parse(word) for word in maneuvers] or usual_maneuvers(experiments)
        candidates = [
            prior.candidate(test) for test in {each.name: each for each in tests}.values()
        ]
        return ShownAdvice(
            information=information,
            run_names=[experiment.name for experiment in experiments],
            doubts=doubts,
            ranked=advise(prior.present, candidates, prior.variables),
            plan=sequential_plan(prior.present, candidates, prior.variables, count_of_tests),
            sensors=prior.sensors,
            units={name: unit_text(prior.run[name].unit) for name in prior.sensors},
        )


def _show_advice(shown: ShownAdvice, top: int, *, runs: Path | None, out: Path | None) -> None:
    """Print what the tests determine, then the tests to come."""
    from swashplate.identification.statistics import advice_table, best_tests_table

    if shown.information is not None:
        shares = shown.information.table(shown.run_names)
        save(runs, "Shares of the information", shares.write)
    save(out, "Tests", advice_table("", shown.ranked).write)
    for sentence in shown.doubts:
        say(f"! {sentence}")
    if shown.information is not None:
        _show_determined(shown.information, shown.run_names)
    show(advice_table("Tests", shown.ranked[:top]))
    if shown.plan:
        show(advice_table("Plan, each test in addition to those before it", shown.plan))
        errors = zip(shown.plan[-1].names, shown.plan[-1].after, strict=True)
        undetermined = [name for name, error in errors if not error <= 1.0]
        if undetermined:
            say(f"- Still not determined after these: {', '.join(undetermined)}.")
    show(best_tests_table(shown.ranked))
    for name, sensor in shown.sensors.items():
        noise = f"{sensor.noise:.3g} {shown.units[name]} ({sensor.origin})"
        note(f"{name}: noise {noise}, one independent sample every {sensor.memory:.3g} s")
    say(
        "Errors are standard errors in per cent of the value, from noise alone, at these values of "
        "the machine; '-': not determined (100 % and more). 'better' is the mean factor by which "
        "the errors of the parameters that are determined already would shrink."
    )


def _setup_beside(drive: str | None) -> str | None:
    """The fit setup that a fit wrote next to the drive that it found; None if there is none."""
    file = None if drive is None else parsing.drive_file(drive)
    if file is None:
        return None
    estimated = file.parent / parsing.SETUP_FILE
    return str(estimated) if estimated.is_file() else None


def _show_determined(information: RunInformation, run_names: Sequence[str]) -> None:
    """Print what the runs determine of the parameters."""
    show(information.table(run_names))
    bullets(information.sentences())
    note("")
    for number, name in enumerate(run_names, start=1):
        note(f"run {number}: {name}")
    say(INFORMATION)
    if information.identifiability.complete and not information.is_known_beforehand:
        note("The fit setup needs no change.")
