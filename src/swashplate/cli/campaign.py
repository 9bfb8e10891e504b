"""``swashplate campaign``: a first draft, a check and a picture of measured tests."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swashplate.cli.inputs import drive_file
from swashplate.cli.outputs import check_outputs
from swashplate.cli.quality_table import LEGEND, heading, quality_table, widths_of
from swashplate.cli.terminal import counted, note, say, show, working
from swashplate.errors import InputError
from swashplate.tables import FIGURE, write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from swashplate.campaign import Campaign

INIT_EXAMPLES = """\
Examples:
  swashplate campaign init logs/*.csv --drive hoist
  swashplate campaign init trial1.mat trial2.mat --out trials.toml
  swashplate campaign init log.csv --column voltage=u --column shaft_speed=n --unit n=1/min
"""
CHECK_EXAMPLES = """\
Examples:
  swashplate campaign check
  swashplate campaign check harbour/campaign.toml --strict
"""
PLOT_EXAMPLES = """\
Examples:
  swashplate campaign plot harbour/campaign.toml --out overview.png
  swashplate campaign plot --run hoistr6 --channel counts --from 5.8 --to 6.6
"""
SCHEMA_EXAMPLES = """\
Example:
  swashplate campaign schema > campaign.schema.json
"""

app = typer.Typer(
    help="Measured tests: make, check and look at a campaign file.",
    no_args_is_help=True,
    rich_markup_mode="rich",
)
CampaignArgument = Annotated[
    Path, typer.Argument(metavar="CAMPAIGN.toml", help="The campaign file, beside its logs.")
]


@app.command("init", epilog=INIT_EXAMPLES)
def init(
    logs: Annotated[
        list[Path], typer.Argument(metavar="LOGS...", help="The logs, one run of the machine each.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            help="The campaign file; by default campaign.toml beside the first log.",
            metavar="FILE",
            show_default=False,
        ),
    ] = None,
    drive: Annotated[
        str | None,
        typer.Option(
            help="A packaged drive or a parameter file that the tests belong to.",
            metavar="AXIS|SET.toml",
            show_default=False,
        ),
    ] = None,
    counts_per_turn: Annotated[
        float | None,
        typer.Option(
            help="Of the encoder, quadrature included; else it is left to be filled in.",
            metavar="COUNTS",
            show_default=False,
        ),
    ] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(
            help="What a column is: time, voltage, shaft_speed or another kind; may be repeated.",
            metavar="KIND=COLUMN",
            show_default=False,
        ),
    ] = None,
    unit: Annotated[
        list[str] | None,
        typer.Option(
            help="Unit of a column; may be repeated.",
            metavar="COLUMN=UNIT",
            show_default=False,
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an older file.")] = False,
) -> None:
    """Write the first draft of a campaign file from the headers of logs.

    What each column is gets guessed from its name and unit, and marked as such;
    what cannot be told says FIXME. Read the file, mend what is wrong, then run
    'swashplate campaign check'.
    """
    from swashplate.campaign.draft import FIXME, NO_ENCODER, UNUSED, draft_campaign

    target = out or logs[0].parent / "campaign.toml"
    if target.exists() and not force:
        raise InputError(f"{target} exists already; name another with --out, or say --force.")
    check_outputs((target, None))
    with working("Reading"):
        text = draft_campaign(
            logs,
            target.parent,
            _from(target.parent, drive),
            counts_per_turn,
            columns={name: kind for kind, name in _pairs("--column", column, "voltage=u")},
            units=dict(_pairs("--unit", unit, "u=mV")),
        )
    write_text(text, target)
    note(f"Draft: {target}")
    guessed = text.count("# guessed")
    note(f"{counted(guessed, 'entry is', 'entries are')} guessed: look for '# guessed'.")
    for line in text.splitlines():
        if (
            line.startswith((UNUSED, NO_ENCODER))
            or f"# {FIXME}" in line
            or f'column = "{FIXME}"' in line
        ):
            note(f"  {line.lstrip('# ')}")
    note("Then run")
    note(f"  swashplate campaign check {shlex.quote(str(target))}")


def _pairs(option: str, given: list[str] | None, example: str) -> list[tuple[str, str]]:
    """What stands before and behind the equals sign of each."""
    for each in given or ():
        if "=" not in each:
            raise InputError(f"{option} {each} has no equals sign: write {option} {example}.")
    return [(each.partition("=")[0], each.partition("=")[2]) for each in given or ()]


def _from(folder: Path, drive: str | None) -> str | None:
    """A drive as a campaign file in a folder names it."""
    file = None if drive is None else drive_file(drive)
    if file is None:
        return drive
    place, root = file.resolve(), folder.resolve()
    return (place.relative_to(root) if place.is_relative_to(root) else place).as_posix()


@app.command("check", epilog=CHECK_EXAMPLES)
def check(
    path: CampaignArgument = Path("campaign.toml"),
    strict: Annotated[
        bool, typer.Option("--strict", help="End with exit code 1 if there are findings.")
    ] = False,
) -> None:
    """Read a campaign with all its logs and say what the measurements are like.

    Each signal's rate, jitter, longest interval, range, clipping and lost
    counts, the manoeuvre recognised from the voltage, and below the table
    whatever someone should look into: also windows that no run takes, and runs
    that are far from what the axis's drive would do.
    """
    from swashplate.campaign import Campaign, campaign_findings, examine, unsigned_currents

    with working(f"Reading {path}"):
        campaign = Campaign.from_toml(path)
        unsigned = {name for _, name in unsigned_currents(campaign)}
        qualities = {each.name: examine(each, unsigned) for each in campaign}
        of_file = dict.fromkeys((*campaign_findings(campaign), *_beside_the_drives(campaign)))
    note(heading(campaign))
    widths = widths_of(qualities.values())
    for experiment in campaign:
        found = qualities[experiment.name]
        show(quality_table(experiment, found, widths))
        for text in experiment.notes:
            say(f"- {text}.")
        for each in found:
            for text in each.findings:
                say(f"! {each.signal}: {text}{'' if text.endswith('?') else '.'}")
    note(LEGEND)
    for text in of_file:
        say(f"! {text}.")
    findings = sum(len(each.findings) for found in qualities.values() for each in found)
    findings += len(of_file)
    if campaign.ignored:
        note(f"Ignored, and not opened: {', '.join(campaign.ignored)}.")
    if not campaign.select(role="fit"):
        note("No run has the role 'fit'.")
    note(
        f"{counted(findings, 'finding', 'findings')}, marked by '!'."
        if findings
        else "Nothing to look into."
    )
    if strict and findings:
        raise typer.Exit(1)


def _beside_the_drives(campaign: Campaign) -> list[str]:
    """What stands out when each axis's drive is simulated under the runs' commands."""
    from swashplate.campaign import beyond_the_card
    from swashplate.identification.data_checks import check_runs
    from swashplate.identification.fitting import smooth

    found = []
    for name, axis in campaign.axes.items():
        if axis.drive is None:
            continue
        nominal = smooth(campaign.drive(name).parameters)
        runs = campaign.select(axis=name)
        beyond = [said for each in runs for said in beyond_the_card(each)]
        found += [f"{said}; this run is not held against the drive" for said in beyond]
        runs = tuple(each for each in runs if not beyond_the_card(each))
        # a drive that is made up says nothing of what a machine does
        made_up = all(each.status == "assumed" for each in nominal.values())
        if runs and not made_up and all(each.input.kind != "other" for each in runs):
            found += [each.sentence.rstrip(".") for each in check_runs(runs, nominal)]
    return found


@app.command("plot", epilog=PLOT_EXAMPLES)
def plot(
    path: CampaignArgument = Path("campaign.toml"),
    out: Annotated[
        Path, typer.Option(help="The figure: .png, .svg or .pdf.", metavar="FILE")
    ] = Path("campaign.png"),
    run: Annotated[
        str | None,
        typer.Option(
            help="Look at one experiment closely; --channel must be given.",
            metavar="NAME",
            show_default=False,
        ),
    ] = None,
    channel: Annotated[
        str | None,
        typer.Option(
            help="An encoder or position: raw against smoothed, and its speed. A rectified "
            "current: measured against simulated.",
            metavar="NAME",
            show_default=False,
        ),
    ] = None,
    begin: Annotated[
        float | None, typer.Option("--from", help="Show from here on.", metavar="S")
    ] = None,
    end: Annotated[float | None, typer.Option("--to", help="Show up to here.", metavar="S")] = None,
) -> None:
    """Draw all runs and channels of a campaign, or one channel closely.

    The overview is one figure for each axis and eight runs, numbered if there
    are several.
    """
    from swashplate.campaign import Campaign
    from swashplate.report.figures import plot_campaign, save_figure

    check_outputs((out, FIGURE))
    with working(f"Reading {path}"):
        campaign = Campaign.from_toml(path)
    channels = () if run is None else campaign[run].channels
    if (run is None) != (channel is None):
        known = f"; {run} has {', '.join(channels)}" if channels else ""
        raise InputError(
            f"--run and --channel go together: give both, or none for the overview{known}."
        )
    with working("Drawing"):
        if run is not None and channel is not None:
            targets = [out]
            save_figure(_close_look(campaign, run, channel, begin, end), out)
        else:
            title = f"{campaign.title} (virtual)" if campaign.virtual else campaign.title
            figures = plot_campaign(campaign.experiments, title=title)
            targets = [
                out if len(figures) == 1 else out.with_stem(f"{out.stem}-{number}")
                for number in range(1, len(figures) + 1)
            ]
            for figure, target in zip(figures, targets, strict=True):
                save_figure(figure, target)
    for target in targets:
        note(f"Figure: {target}")


def _close_look(
    campaign: Campaign, run: str, channel: str, begin: float | None, end: float | None
) -> Figure:
    from swashplate.report.figures import plot_current, plot_encoder

    experiment = campaign[run]
    chosen = experiment[channel]
    window = None
    if begin is not None or end is not None:
        first, last = float(chosen.time[0]), float(chosen.time[-1])
        window = (first if begin is None else begin, last if end is None else end)
    title = f"{run}, {channel}"
    if chosen.is_position:
        return plot_encoder(chosen, window=window, title=title)
    if chosen.kind != "rectified_current":
        raise InputError(
            f"{run} {channel} is a {chosen.kind}; a close look is for encoders, positions and "
            "rectified currents."
        )
    drive = campaign.drive(experiment.axis)
    signal = experiment.input
    simulation = drive.simulate(signal.values, time=signal.time, interpolation=signal.interpolation)
    return plot_current(chosen, simulation, window=window, title=title)


@app.command("schema", epilog=SCHEMA_EXAMPLES)
def schema() -> None:
    """Print a campaign file's JSON Schema, for editors that check while one writes."""
    from swashplate.campaign import json_schema

    typer.echo(json_schema(), nl=False)
