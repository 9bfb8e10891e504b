"""``swashplate campaign``, ``rig``, ``guess``, ``excitation``, ``advise``: tests, their worth."""

from __future__ import annotations

import shlex
from dataclasses import replace
from math import radians
from pathlib import Path
from typing import Annotated, Literal

import typer

from swashplate.cli import words
from swashplate.cli.options import AxisName, DriveChoice, TableFile, command
from swashplate.cli.terminal import (
    FORCED,
    bullets,
    check_free,
    check_output,
    draw,
    note,
    save,
    say,
    show,
    working,
)
from swashplate.errors import InputError
from swashplate.tables import (
    FIGURE,
    Column,
    Table,
    check_folder,
    count,
    ended,
    joined,
    made_folder,
    write_text,
)

LEGEND = (
    "jitter and longest gap in ms; clip: % of the samples at the ends of the instrument's range;\n"
    "lost: jumps that no motion explains"
)
INFORMATION = (
    "Under 'runs', one letter a run: # gives 20 % or more of the information, + gives less, . "
    "gives none, - is not fitted here. 'effect' is how much 1 % of the value changes all residuals "
    "together; 1 is one standard deviation of noise."
)
Severity = Literal["clean", "realistic", "harsh"]
CAMPAIGN = Path("campaign.toml")

app = typer.Typer(
    help="Measured tests: make, check and look at a campaign file.",
    no_args_is_help=True,
    rich_markup_mode="rich",
)


# --- campaign files -------------------------------------------------------------------------------


def init(
    *,
    logs: Annotated[
        list[Path], typer.Argument(metavar="LOGS...", help="The logs, one run of the machine each.")
    ],
    out: Path | None = None,
    drive: str | None = None,
    counts_per_turn: float | None = None,
    column: list[str] | None = None,
    unit: list[str] | None = None,
    title: str | None = None,
) -> None:
    """Write the first draft of a campaign file from the headers of logs.

    What each column is gets guessed from its name and unit, and marked as such;
    what cannot be told says FIXME. A PLC's words, 27648 or 32767 at full scale,
    are scaled to volts if they are the command; for a sensor they need its range.
    Read the file, mend what is wrong, then run 'swashplate campaign check'.

    Options:
      out FILE: The campaign file; by default campaign.toml beside the first log.
      drive AXIS|SET.toml: A packaged drive or a parameter file that the tests belong to.
      counts_per_turn COUNTS: Of the encoder, quadrature included; else it is left to be filled in.
      column KIND=COLUMN: What a column is: time, voltage, shaft_speed or another kind; may be
          repeated.
      unit COLUMN=UNIT: Unit of a column; may be repeated.
      title TEXT: Heading of the report: machine, place, author; by default the folder's name.

    For example:
      swashplate campaign init logs/*.csv --drive hoist --title "Winch 3, harbour, J. Weber"
      swashplate campaign init trial1.mat trial2.mat --out trials.toml
      swashplate campaign init log.csv --column voltage=u --column shaft_speed=n --unit n=1/min
    """
    from swashplate.drafting.draft import FIXME, NO_ENCODER, UNUSED, draft_campaign

    target = out or logs[0].parent / "campaign.toml"
    check_output(target)
    file = None if drive is None else words.drive_file(drive)
    if file is not None:  # a drive as a campaign file names it
        place, root = file.resolve(), target.parent.resolve()
        drive = (place.relative_to(root) if place.is_relative_to(root) else place).as_posix()
    kinds = {
        name: kind for kind, name in words.pairs_of("--column", column, "voltage=u", often=True)
    }
    units = dict(words.pairs_of("--unit", unit, "u=mV"))
    with working("Reading"):
        text = draft_campaign(
            logs,
            target.parent,
            drive,
            counts_per_turn,
            columns=kinds,
            units=units,
            title=title,
        )
    write_text(text, target)
    note(f"Draft: {target}")
    guessed = text.count("# guessed")
    note(f"{count(guessed, 'entry is', 'entries are')} guessed: look for '# guessed'.")
    table, open_ends = "", (f"# {FIXME}", f'column = "{FIXME}"')
    for line in text.splitlines():
        if line.startswith(("[", "file = ")):  # a run is known by its file
            table = line.partition("    #")[0]
        if line.startswith((UNUSED, NO_ENCODER)):
            note(f"  {line.lstrip('# ')}")
        elif any(each in line for each in open_ends):
            note(f"  {table} {line.lstrip('# ')}")
    note(f"Then run\n  swashplate campaign check {shlex.quote(str(target))}")


def check(path: Path = CAMPAIGN, *, strict: bool = False) -> None:
    """Check a campaign and the measurements in all its logs.

    Each signal's rate, jitter, longest interval, range, clipping and lost
    counts, the maneuver recognised from the voltage, and below the table
    whatever someone should look into: also windows that no run takes, and runs
    that are far from what the axis's drive would do.

    Options:
      strict: End with exit code 1 if there are findings.

    For example:
      swashplate campaign check
      swashplate campaign check harbour/campaign.toml --strict
    """
    from swashplate import campaign as tests
    from swashplate.identification.data_checks import beside_the_drives

    words.check_kind(path, "campaign")
    with working(f"Reading {path}"):
        campaign = tests.Campaign.from_toml(path)
        unsigned = {name for _, name in tests.unsigned_currents(campaign)}
        qualities = {each.name: tests.examine(each, unsigned) for each in campaign}
        of_file = dict.fromkeys((*tests.campaign_findings(campaign), *beside_the_drives(campaign)))
    roles = [each.role for each in campaign]
    counted = ", ".join(f"{roles.count(role)} to {role}" for role in dict.fromkeys(roles))
    virtual = " (virtual)" * campaign.virtual
    note(f"{campaign.title}{virtual}: {len(campaign)} experiments ({counted})")
    for overview in campaign.overviews:
        show(overview.table())
        bullets([overview.sentence])
    for experiment in campaign:
        found = qualities[experiment.name]
        show(tests.quality_table(experiment, found))
        bullets(f"{text}." for text in experiment.notes)
        for each in found:
            for text in each.findings:  # unbroken: a line to paste may be in it
                note(ended(f"! {each.signal}: {text}"))
    note(LEGEND)
    for text in of_file:
        say(ended(f"! {text}"))
    findings = sum(len(each.findings) for found in qualities.values() for each in found)
    findings += len(of_file)
    if campaign.ignored:
        note(f"Ignored, and not opened: {', '.join(campaign.ignored)}.")
    if not campaign.select(role="fit"):
        note("No run has the role 'fit'.")
    note(f"{count(findings, 'finding')}, marked by '!'." if findings else "No findings.")
    if strict and findings:
        raise typer.Exit(1)


def plot(
    path: Path = CAMPAIGN,
    *,
    out: Annotated[Path, FIGURE] = Path("campaign.png"),
    run: str | None = None,
    channel: str | None = None,
    begin: float | None = None,
    end: float | None = None,
) -> None:
    """Draw all runs and channels of a campaign, or one channel closely.

    The overview is one figure for each axis and eight runs, numbered if there
    are several. A log of more than 250,000 rows has a figure of its own: all of
    it, with the windows that are used.

    Options:
      out FILE: The figure: .png, .svg or .pdf.
      run NAME: Look at one experiment closely; --channel must be given.
      channel NAME: The channel: a position with its speed, another against what the axis's drive
          does.
      begin --from S: Show from here on.
      end --to S: Show up to here.

    For example:
      swashplate campaign plot harbour/campaign.toml --out overview.png
      swashplate campaign plot --run hoistr6 --channel counts --from 5.8 --to 6.6
    """
    from swashplate.campaign import Campaign
    from swashplate.identification import predict
    from swashplate.identification.drive_model import SIGNALS

    with working(f"Reading {path}"):
        campaign = Campaign.from_toml(path)
    channels = () if run is None else campaign[run].channels
    if (run is None) != (channel is None):
        known = f"; {run} has {', '.join(channels)}" if channels else ""
        raise InputError(
            f"--run and --channel go together: give both, or none for the overview{known}."
        )
    if run is not None and channel is not None:
        experiment, shown, simulated = campaign[run], campaign[run][channel], None
        drive = campaign.axes[experiment.axis].drive
        if shown.kind in SIGNALS and drive is not None and not shown.is_position:
            found = predict(campaign.drive(experiment.axis), [experiment])
            simulated = next((each.simulated for each in found if each.channel == channel), None)
        window = words.window_of(shown.time, begin, end)
        how = {"window": window, "title": f"{run}, {channel}"}
        draw(out, "plot_channel", shown, simulated, **how)
    else:
        figures = campaign.plot(title=campaign.title + " (virtual)" * campaign.virtual)
        several = [out.with_stem(f"{out.stem}-{k}") for k in range(1, len(figures) + 1)]
        check_free(*several)
        for path, figure in zip([out] if len(figures) == 1 else several, figures, strict=True):
            draw(path, figure)


def schema() -> None:
    """Print a campaign file's JSON Schema, for editors that check while one writes.

    For example:
      swashplate campaign schema > campaign.schema.json
    """
    from swashplate.campaign import json_schema

    typer.echo(json_schema(), nl=False)


command(app, "init")(init)
command(app, "check")(check)
command(app, "plot")(plot)
command(app, "schema")(schema)


# --- virtual tests --------------------------------------------------------------------------------


def rig(
    drive: DriveChoice,
    *,
    out: Path,
    seed: int = 1,
    severity: Severity = "realistic",
    backlash_deg: float = 0.0,
    perturb: float = 0.0,
    maneuver: list[str] | None = None,
) -> None:
    """Write a virtual test campaign: logs, campaign.toml and, apart, the truth.

    A drive with known parameters is simulated over the tests of Kruse (2001)
    and read by instruments with chosen errors. --set and --scale change the
    drive that is simulated, not the one that a fit starts from. Fit it as you
    would your machine's logs, then look into truth/. Every file says that it is
    virtual.

    Options:
      out DIR: A new or empty folder for logs and campaign.
      severity: The instruments: perfect, as in a good campaign, or with everything wrong.
      backlash_deg DEG: Play between shaft and encoder.
      perturb: Draw all true parameters, fixed ones too, within this share: 0.1.
      maneuver MANEUVER: A test instead of those of Kruse (2001), such as step:4. May be repeated.

    For example:
      swashplate rig hoist --out virtual-hoist
      swashplate rig slew --out worn --seed 7 --severity harsh --backlash-deg 0.1
      swashplate rig hoist --out loaded --set load_torque=30kN*m --set motor_leakage=1e-6
      swashplate rig hoist --out short --maneuver step:4 --maneuver sine:6,0.2 --perturb 0.1
      swashplate campaign check virtual-hoist/campaign.toml
    """
    from swashplate import rig as bench

    check_free(out)
    with working("Simulating"):
        nominal = words.drive_of(drive.drive)
        tests = bench.run(
            nominal if words.drive_file(drive.drive) else drive.drive,
            [words.maneuver_of(each, nominal) for each in maneuver or ()] or None,
            seed=seed,
            severity=severity,
            instruments=replace(bench.SEVERITIES[severity], backlash=radians(backlash_deg)),
            truth=drive.chosen if drive.values or drive.factors else None,
            perturb=perturb,
        )
    with working("Writing"):
        path = bench.write(tests, out, overwrite=FORCED.get())
    text = (Column("log"), Column("maneuver", wrap=True), Column("role"))
    made = Table("", (*text, Column("rows", "d"), Column("s", ".4g")))
    for run in tests.runs.values():
        time = run.columns["time"]
        made.add(f"{run.stem}.csv", run.name, run.role, time.size, float(time[-1] - time[0]))
    show(made)
    note(f"Campaign: {path}")
    note(f"Truth:    {path.parent / 'truth'} (open it only after the fit)")


# --- before a fit, and between fits ---------------------------------------------------------------


def guess(path: Path = CAMPAIGN, *, axis: AxisName = None, out: Path | None = None) -> None:
    """Read dead zones, gains, limits, delays and creep of a machine off its logs.

    For a machine of unknown numbers: needs the command and a speed or a position.
    If a current is measured, the amplifier is read off it and fitted first.
    Writes a drive to start a fit from, start.toml, and what the fit is to change
    within which bounds, setup.toml.

    Options:
      out DIR: Folder for start.toml and setup.toml; by default the campaign's.

    For example:
      swashplate campaign init logs/*.csv --drive neutral
      swashplate guess logs/campaign.toml
      swashplate fit logs/campaign.toml --from logs/start.toml --setup logs/setup.toml
    """
    from swashplate import drafting
    from swashplate.campaign import spiked
    from swashplate.drive import Drive
    from swashplate.identification.identifying import runs_to_fit

    folder = path.parent if out is None else out
    start, setup = folder / "start.toml", folder / "setup.toml"
    with working(f"Reading {path}"):
        check_free(start, setup)
        campaign, chosen = words.campaign_of(path, axis)
        check_folder(folder)
        runs = runs_to_fit(campaign, chosen)
        found = drafting.guess_drive(runs)
        parameters = drafting.guessed_set(found, path.name)
        made_folder(folder)
        Drive(parameters).to_toml(start)
        write_text(drafting.fit_configuration(found, parameters), setup)
    show(drafting.guess_table(found))
    if found.amplifier is not None:
        show(drafting.amplifier_table(found.amplifier))
        card = found.amplifier.card
        like = f"like that of the packaged card {card}" if card else "a plain one"
        say(
            f"Its filter is {like}; fit {found.amplifier.fit_percent:.1f} % of the currents. The "
            "first stage fits the amplifier to the current, the second one the machine."
        )
    for sentence, _ in spiked(runs).values():
        note(f"! {sentence}.")
    note(f"These numbers alone: fit {found.fit_percent:.1f} % of the mean speeds (100 % is best).")
    note(f"Start:             {start}")
    note(f"Fit configuration: {setup}")
    then = ["swashplate", "fit", str(path), "--from", str(start), "--setup", str(setup)]
    note(f"Then run\n  {shlex.join(then)}")


def excitation(
    path: Path = CAMPAIGN,
    *,
    axis: AxisName = None,
    setup: str | None = None,
    begin: str | None = None,
    out: TableFile = None,
) -> None:
    """Show before a fit which parameters the runs determine, and what to fix.

    Simulates the runs with the drive as it is: how much each parameter changes
    what was measured, by which run, and which can change together without
    effect: those are to be fixed, or tested further.

    For example:
      swashplate excitation virtual/campaign.toml
      swashplate excitation harbour/campaign.toml --setup mine.toml --from worn.toml
      swashplate excitation harbour/campaign.toml --out runs.csv
    """
    from swashplate.identification.data_checks import check_runs, refuse_unsound
    from swashplate.identification.experiment_design import outlook
    from swashplate.identification.stages import smooth

    with working(f"Reading {path}"):
        _, runs, plan, drive = words.fit_of(path, axis, setup, begin)
    with working("Simulating"):
        doubts = refuse_unsound(check_runs(runs, smooth(drive)))
        looks = [outlook(stage, smooth(drive), runs) for stage in plan.stages]
    names = [each.name for each in runs]
    shown = [look.table(names) for look in looks]
    save(out, "Table", joined(shown).write)
    for sentence in doubts:
        say(f"! {sentence}")
    for look, table in zip(looks, shown, strict=True):
        show(table)
        # what no run exercises is said with its reason
        bullets(replace(look.identifiability, unexcited=()).sentences(), look.sentences())
    note("")
    for number, name in enumerate(names, start=1):
        note(f"run {number}: {name}")
    say(INFORMATION)
    if all(look.identifiability.complete for look in looks):
        note("The fit configuration can stay as it is.")


def advise(
    word: str,
    *,
    drive: str | None = None,
    axis: AxisName = None,
    setup: str | None = None,
    maneuver: list[str] | None = None,
    top: int = 10,
    tests: int = 4,
    out: TableFile = None,
) -> None:
    """Recommend the test that determines each parameter best.

    Ranks tests by the information that they would add to those made so far, at
    the drive's present values. Errors are standard errors from noise alone; a
    drive that differs from its model is known less well.

    Options:
      word CAMPAIGN.toml|AXIS|SET.toml: Tests made so far; or only a drive, for a fresh plan.
      drive SET.toml: The fitted drive: noise is then that of its residuals, and
        free is what the setup.toml beside it estimates.
      maneuver MANEUVER: A test to judge instead of the usual ones. May be repeated.
      top: Tests to list.
      tests: Tests in the plan.

    For example:
      swashplate advise hoist                                      a fresh plan
      swashplate advise harbour/campaign.toml --drive fitted/drive.toml
      swashplate advise harbour/campaign.toml --maneuver step:-9 --top 1
    """
    from swashplate.campaign import KINDS
    from swashplate.drive import Drive
    from swashplate.identification import experiment_design as design
    from swashplate.identification.setup import load_setup
    from swashplate.identification.stages import smooth

    tested = words.file_kind(Path(word)) == "campaign"
    fitted = words.drive_file(drive or word) if drive or not tested else None
    with working("Judging tests"):
        # what a fit estimated stands beside the drive that it found
        if fitted is not None and (fitted.parent / words.CONFIGURATION).is_file():
            setup = setup or str(fitted.parent / words.CONFIGURATION)
        if tested:
            _, runs, plan, start = words.fit_of(Path(word), axis, setup, drive)
            bench = design.bench(smooth(start), plan, runs, fitted=drive is not None)
        else:
            if axis is not None:
                raise InputError("--axis belongs to a campaign; a drive is one axis.")
            start = words.parameters_of(drive or word)
            plan = load_setup(setup or start.name)
            bench = design.bench(smooth(start), plan)
        machine = Drive(bench.parameters)
        named = [words.maneuver_of(each, machine) for each in maneuver or ()]
        trials = {each.name: each for each in named or design.default_maneuvers()}
        at_hand = [bench.candidate(each) for each in trials.values()]
        ranked = design.advise(bench.present, at_hand, bench.variables)
        in_turn = design.in_turn(bench.present, at_hand, bench.variables, tests)
    save(out, "Table", design.advice_table("", ranked).write)
    show(design.advice_table("Tests", ranked[:top]))
    if in_turn:
        title = "A plan, each test chosen in addition to those before it"
        show(design.advice_table(title, in_turn))
        errors = zip(in_turn[-1].names, in_turn[-1].after, strict=True)
        undetermined = [name for name, error in errors if not error <= 1.0]
        if undetermined:
            say(f"- After these, {', '.join(undetermined)} would still not be known to 100 %.")
    show(design.best_tests_table(ranked))
    for each in bench.sensors:
        noise = f"{each.noise:.3g} {KINDS[each.kind].units[0]} ({each.origin})"
        note(f"{each.kind}: noise {noise}, one independent sample every {each.memory:.3g} s")
    say(
        "Errors are standard errors in per cent of the value, from noise alone and at these values "
        "of the drive; '-' is not determined (100 % and more). 'better' is by how much what is "
        "known already would be known better, on the mean."
    )
