"""``swashplate campaign``, ``rig`` and ``guess``: measured tests, virtual ones, a first guess."""

from __future__ import annotations

import shlex
from dataclasses import replace
from math import radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from swashplate.cli.options import (
    AxisName,
    DriveChoice,
    command,
)
from swashplate.cli.terminal import (
    FORCED,
    Outputs,
    check_free,
    note,
    say,
    show,
    working,
)
from swashplate.cli.words import (
    campaign_of,
    drive_file,
    drive_of,
    maneuver_of,
    pairs_of,
    runs_to_fit,
)
from swashplate.errors import InputError
from swashplate.tables import FIGURE, count, ended, write_text

if TYPE_CHECKING:
    from swashplate.campaign import Campaign

LEGEND = (
    "jitter and longest gap in ms; clip: % of the samples at the ends of the instrument's range;\n"
    "lost: jumps that no motion explains"
)
Severity = Literal["clean", "realistic", "harsh"]
CAMPAIGN = Path("campaign.toml")

app = typer.Typer(
    help="Measured tests: make, check and look at a campaign file.",
    no_args_is_help=True,
    rich_markup_mode="rich",
)


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
) -> None:
    """Write the first draft of a campaign file from the headers of logs.

    What each column is gets guessed from its name and unit, and marked as such;
    what cannot be told says FIXME. Read the file, mend what is wrong, then run
    'swashplate campaign check'.

    Options:
      out FILE: The campaign file; by default campaign.toml beside the first log.
      drive AXIS|SET.toml: A packaged drive or a parameter file that the tests belong to.
      counts_per_turn COUNTS: Of the encoder, quadrature included; else it is left to be filled in.
      column KIND=COLUMN: What a column is: time, voltage, shaft_speed or another kind; may be
          repeated.
      unit COLUMN=UNIT: Unit of a column; may be repeated.

    For example:
      swashplate campaign init logs/*.csv --drive hoist
      swashplate campaign init trial1.mat trial2.mat --out trials.toml
      swashplate campaign init log.csv --column voltage=u --column shaft_speed=n --unit n=1/min
    """
    from swashplate.campaign.draft import FIXME, NO_ENCODER, UNUSED, draft_campaign

    target = out or logs[0].parent / "campaign.toml"
    Outputs((target, None))
    with working("Reading"):
        text = draft_campaign(
            logs,
            target.parent,
            _from(target.parent, drive),
            counts_per_turn,
            columns={name: kind for kind, name in pairs_of("--column", column, "voltage=u")},
            units=dict(pairs_of("--unit", unit, "u=mV")),
        )
    write_text(text, target)
    note(f"Draft: {target}")
    guessed = text.count("# guessed")
    note(f"{count(guessed, 'entry is', 'entries are')} guessed: look for '# guessed'.")
    for line in text.splitlines():
        open_ends = (f"# {FIXME}", f'column = "{FIXME}"')
        if line.startswith((UNUSED, NO_ENCODER)) or any(each in line for each in open_ends):
            note(f"  {line.lstrip('# ')}")
    note("Then run")
    note(f"  swashplate campaign check {shlex.quote(str(target))}")


def _from(folder: Path, drive: str | None) -> str | None:
    """A drive as a campaign file in a folder names it."""
    file = None if drive is None else drive_file(drive)
    if file is None:
        return drive
    place, root = file.resolve(), folder.resolve()
    return (place.relative_to(root) if place.is_relative_to(root) else place).as_posix()


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
    from swashplate.campaign import (
        Campaign,
        campaign_findings,
        examine,
        quality_table,
        unsigned_currents,
    )
    from swashplate.cli.words import check_kind
    from swashplate.identification.data_checks import beside_the_drives

    check_kind(path, "campaign")
    with working(f"Reading {path}"):
        campaign = Campaign.from_toml(path)
        unsigned = {name for _, name in unsigned_currents(campaign)}
        qualities = {each.name: examine(each, unsigned) for each in campaign}
        of_file = dict.fromkeys((*campaign_findings(campaign), *beside_the_drives(campaign)))
    roles = [each.role for each in campaign]
    counted = ", ".join(f"{roles.count(role)} to {role}" for role in dict.fromkeys(roles))
    virtual = " (virtual)" if campaign.virtual else ""
    note(f"{campaign.title}{virtual}: {len(campaign)} experiments ({counted})")
    for experiment in campaign:
        show(quality_table(experiment, qualities[experiment.name]))
        for text in experiment.notes:
            say(f"- {text}.")
        for each in qualities[experiment.name]:
            for text in each.findings:
                say(ended(f"! {each.signal}: {text}"))
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
    out: Path = Path("campaign.png"),
    run: str | None = None,
    channel: str | None = None,
    begin: float | None = None,
    end: float | None = None,
) -> None:
    """Draw all runs and channels of a campaign, or one channel closely.

    The overview is one figure for each axis and eight runs, numbered if there
    are several.

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
    from swashplate.report.figures import plot_campaign

    files = Outputs((out, FIGURE))
    with working(f"Reading {path}"):
        campaign = Campaign.from_toml(path)
    channels = () if run is None else campaign[run].channels
    if (run is None) != (channel is None):
        known = f"; {run} has {', '.join(channels)}" if channels else ""
        raise InputError(
            f"--run and --channel go together: give both, or none for the overview{known}."
        )
    if run is not None and channel is not None:
        _close_look(files, out, campaign, run, channel, begin, end)
    else:
        title = f"{campaign.title} (virtual)" if campaign.virtual else campaign.title
        figures = plot_campaign(campaign.experiments, title=title)
        several = [out.with_stem(f"{out.stem}-{k}") for k in range(1, len(figures) + 1)]
        check_free(*several)
        for path, figure in zip([out] if len(figures) == 1 else several, figures, strict=True):
            files.draw(path, figure)
    files.say()


def _close_look(
    files: Outputs,
    out: Path,
    campaign: Campaign,
    run: str,
    name: str,
    begin: float | None,
    end: float | None,
) -> None:
    from swashplate.identification.drive_model import SIGNALS

    experiment, channel = campaign[run], campaign[run][name]
    first, last = float(channel.time[0]), float(channel.time[-1])
    window = (first if begin is None else begin, last if end is None else end)
    how = {"window": None if begin is end is None else window, "title": f"{run}, {name}"}
    simulated = None
    known = channel.kind in SIGNALS and campaign.axes[experiment.axis].drive is not None
    if known and not channel.is_position:
        from swashplate.identification import predict

        found = predict(campaign.drive(experiment.axis), [experiment])
        simulated = next((each.simulated for each in found if each.channel == name), None)
    files.draw(out, "plot_channel", channel, simulated, **how)


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
    from swashplate.campaign import rig as bench
    from swashplate.tables import Column, Table

    check_free(out)
    with working("Simulating"):
        nominal = drive_of(drive.drive)
        tests = bench.run(
            nominal if drive_file(drive.drive) else drive.drive,
            None if not maneuver else [maneuver_of(each, nominal) for each in maneuver],
            seed=seed,
            severity=severity,
            instruments=replace(bench.SEVERITIES[severity], backlash=radians(backlash_deg)),
            truth=drive.chosen if drive.values or drive.factors else None,
            perturb=perturb,
        )
    with working("Writing"):
        path = bench.write(tests, out, overwrite=FORCED.get())
    numbers = (Column("rows", "d"), Column("s", ".4g"))
    words = (Column("log"), Column("maneuver", wrap=True), Column("role"))
    made = Table("", (*words, *numbers))
    for run in tests.runs.values():
        time = run.columns["time"]
        made.add(f"{run.stem}.csv", run.name, run.role, time.size, float(time[-1] - time[0]))
    show(made)
    note(f"Campaign: {path}")
    note(f"Truth:    {path.parent / 'truth'} (open it only after the fit)")


def guess(path: Path = CAMPAIGN, *, axis: AxisName = None, out: Path | None = None) -> None:
    """Read a machine's dead zones, gains, limits, delay and lag off its logs.

    For a machine of unknown numbers: needs the command and a speed or a position,
    no current. Writes a drive to start a fit from, start.toml, and what the fit
    is to change within which bounds, setup.toml.

    Options:
      out DIR: Folder for start.toml and setup.toml; by default the campaign's.

    For example:
      swashplate campaign init logs/*.csv --drive neutral
      swashplate guess logs/campaign.toml
      swashplate fit logs/campaign.toml --from logs/start.toml --setup logs/setup.toml
    """
    from swashplate.campaign import (
        fit_configuration,
        guess_drive,
        guess_table,
        guessed_set,
        spiked,
    )
    from swashplate.drive import Drive

    with working(f"Reading {path}"):
        campaign, chosen = campaign_of(path, axis)
        runs = runs_to_fit(campaign, chosen)
        folder = path.parent if out is None else out
        start, setup = folder / "start.toml", folder / "setup.toml"
        check_free(start, setup)
        for sentence, _ in spiked(runs).values():
            note(f"! {sentence}.")
        found = guess_drive(runs)
        parameters = guessed_set(found, path.name)
        folder.mkdir(parents=True, exist_ok=True)
        Drive(parameters).to_toml(start)
        write_text(fit_configuration(found, parameters), setup)
    show(guess_table(found))
    note(f"These numbers alone: fit {found.fit_percent:.1f} % of the mean speeds (100 % is best).")
    note(f"Start:             {start}")
    note(f"Fit configuration: {setup}")
    note("Then run")
    words = ["swashplate", "fit", str(path), "--from", str(start), "--setup", str(setup)]
    note(f"  {shlex.join(words)}")
