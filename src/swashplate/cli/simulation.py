"""``swashplate simulate``, ``compare`` and ``show``: drives under commands."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swashplate.cli import parsing, trials
from swashplate.cli.commands import command
from swashplate.cli.machines import run_tables
from swashplate.cli.options import (
    NO_VALUE,
    CommandArgument,
    FigureFile,
    Force,
    MachineChoice,
    ModelFile,
    RateOption,
    ScaleOption,
    SetOption,
    Simulating,
    TableFile,
)
from swashplate.cli.terminal import bullets, draw_figure, note, save, say, show, spinner
from swashplate.documents import parse_toml
from swashplate.errors import InputError
from swashplate.tables import Column, Table, quantity, write_table

if TYPE_CHECKING:
    import polars

    from swashplate.identification import Band
    from swashplate.machine import Run

app = typer.Typer(rich_markup_mode="rich")


@command(
    app,
    "simulate",
    examples="""
        swashplate simulate hoist step:9
        swashplate simulate hoist "step +9 V" --plot step.png --units rpm
        swashplate simulate hoist sine:6.5,0.1 --set Z16_plus=0.12mm --out sine.csv
        swashplate simulate mine.toml log.csv --interpolation previous --out run.csv
        swashplate simulate valve.py step:2 --measured supply=100 --set gain=0.03
    """,
)
def simulate(
    machine: MachineChoice,
    maneuver: CommandArgument,
    *,
    sampling: Simulating,
    out: TableFile = None,
    plot: FigureFile = None,
    begin: Annotated[
        float | None, typer.Option("--from", metavar="S", help="Start of the plot.")
    ] = None,
    end: Annotated[float | None, typer.Option("--to", metavar="S", help="End of the plot.")] = None,
    force: Force = False,
) -> None:
    """Simulate a drive, or a machine of your own, over a maneuver or a log.

    Of a drive: the largest speeds and currents, the distance travelled, and how
    long each limit acted (the dead zone only while the command is not 0 V). Of a
    machine of your own: lowest, highest and last value of each signal, and how
    long each limit acted. Of a fitted drive also the band in which the machine's
    own speed lies. --out writes all signals, --plot draws them, with the band.
    'swashplate --help' lists the maneuvers.
    """
    with spinner("Simulating"):
        name, run = trials.run_of(machine, maneuver, sampling)
        tables = run_tables(machine.own, run)
        title = f"{machine.title}, {name}"
        band = trials.band_of(machine, run)
    save(out, "All signals, in SI", lambda path: write_table(_with_band(run, band), path))
    window = trials.window_of(run.time, begin, end)
    if band is not None:
        draw_figure(plot, "plot_simulation", run, band=band, window=window, title=title)
    elif plot is not None:
        draw_figure(plot, run.plot(window=window, title=title))
    duration = f"{run.time[-1] - run.time[0]:.6g} s"
    machine.note(f"{title}: {run.time.size} samples at {run.record.rate:g} Hz, {duration}")
    show(*tables)
    if band is not None:
        say(band.sentence)


def _with_band(run: Run, band: Band | None) -> polars.DataFrame:
    """All signals of a run, and both ends of a band of its speed."""
    frame = run.to_polars()
    if band is None:
        return frame
    return frame.with_columns(band.to_polars().select("shaft_speed_lower", "shaft_speed_upper"))


@command(
    app,
    "compare",
    examples="""
        swashplate compare hoist luff
        swashplate compare hoist mine.toml --maneuver sine:6.5,0.1 --plot both.png
    """,
)
def compare(
    first: Annotated[str, typer.Argument(metavar="A", help="Packaged drive or parameter file.")],
    second: Annotated[str, typer.Argument(metavar="B", help="Drive to compare with the first.")],
    *,
    maneuver: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help=(
                'Maneuver for both, such as step:9 or "step +9 V" (default: a step to the largest '
                "command that was tested with both)."
            ),
        ),
    ] = None,
    rate: RateOption = 512.0,
    plot: FigureFile = None,
    out: TableFile = None,
    force: Force = False,
) -> None:
    """Compare two drives: the numbers that matter, and both over the same maneuver.

    Of a fitted drive the numbers have the intervals of its fit. Of the maneuver
    it prints performance metrics, such as the final speed: the speed at the last
    moment at which the voltage is at its largest. --out writes the voltage and
    both speeds.
    """
    with spinner("Simulating"):
        from swashplate.analysis import rms_difference, side_by_side, tested_step

        named = [parsing.drive_of(word) for word in (first, second)]
        numbers = [
            parsing.key_numbers_of(word, drive)
            for word, drive in zip((first, second), named, strict=True)
        ]
        pair = [trials.at_rate(drive, rate) for drive in named]
        labels = [drive.name for drive in pair]
        if labels[0] == labels[1]:  # then by what was typed
            labels = [first, second if second != first else f"{second} (2)"]
        drives = dict(zip(labels, pair, strict=True))
        if maneuver is None:
            maneuver = f"step:{min(tested_step(drive) for drive in named):g}"
        test = trials.named_maneuver(maneuver, *pair)
        voltage = test.sample(rate)
        runs = {label: drive.simulate(voltage, rate) for label, drive in drives.items()}
        table = side_by_side(runs)
        rms = rms_difference(*(run.shaft_speed for run in runs.values()))
    title = f"{' and '.join(runs)}, {test.name}"

    def write(path: Path) -> None:
        import polars as pl

        run = runs[labels[0]]
        speeds = {f"shaft_speed {k}": e.shaft_speed for k, e in runs.items()}
        write_table(pl.DataFrame({"time": run.time, "voltage": run.voltage, **speeds}), path)

    save(out, "Voltage and both speeds, in SI", write)
    draw_figure(plot, "plot_comparison", runs, title=title)
    for label, one in zip(runs, numbers, strict=True):
        note(f"{label}: the numbers that matter")
        show(one.table())
        bullets(one.what_limits)
        note("")
    bullets(dict.fromkeys(sentence for one in numbers for sentence in one.basis))
    note("")
    note(title)
    show(table)
    note(f"rms difference of the speeds: {quantity(rms, 'rad/s', spec='.2f')}")


@command(
    app,
    "show",
    examples="""
        swashplate show
        swashplate show hoist
        swashplate show hoist --toml > mine.toml    (a file to edit)
        swashplate show valve.py
    """,
)
def show_parameters(
    drive: Annotated[
        str | None,
        typer.Argument(
            metavar="AXIS|SET.toml|FILE.py",
            help=(
                "Packaged drive, parameter file, folder of a fit, or a machine of your own; "
                "without one, a list."
            ),
        ),
    ] = None,
    *,
    values: SetOption = None,
    factors: ScaleOption = None,
    model: ModelFile = None,
    toml: Annotated[
        bool,
        typer.Option(
            "--toml", metavar=NO_VALUE, help="Print a parameter file, complete and ready to edit."
        ),
    ] = False,
) -> None:
    """Show the parameters of a drive or of your own machine, or list drives.

    Each parameter is shown with its unit and its source. A parameter with a plus
    and a minus value has one for each direction; both are magnitudes. Units are
    SI.
    """
    if drive is None:
        if toml or values or factors:
            raise InputError("Name the drive to show: 'swashplate show' lists the packaged ones.")
        show(packaged_drives())
        return
    machine = MachineChoice(drive, values, factors, model)
    if machine.own is not None:
        machine.refuse(toml=toml)
        machine.note(machine.title)
        show(machine.own.table(), machine.own.signals_table())
        return
    # in SI: a rod's drive has angles inside, which chosen units of its motion would change
    parameters = parsing.changed_drive(machine.named_drive, values or (), factors or ()).parameters
    if toml:
        from swashplate.parameters import dump_set

        typer.echo(dump_set(parameters), nl=False)
        return
    say(f"{parameters.name}: {parameters.title}")
    for line in parsing.changes_between(machine.named_drive.parameters, parameters):
        note(line)
    show(*parameters.tables())
    rate = "any rate" if parameters.rate is None else f"{parameters.rate:g} Hz"
    say(
        f"Variants of the equations: pressure_root {parameters.pressure_root}, coulomb_sign "
        f"{parameters.coulomb_sign}, card_switch {parameters.card_switch}, card's filter for "
        f"{rate}, options {', '.join(sorted(parameters.options)) or 'none'}"
    )


def packaged_drives() -> Table:
    """The packaged drives and their control cards."""
    # their files as they stand: nothing is checked or compiled for a list of names
    table = Table("", (Column("name"), Column("drive", wrap=True), Column("control card")))
    sets = (resources.files("swashplate.parameters") / "sets").iterdir()
    for path in sorted((entry for entry in sets if entry.name.endswith(".toml")), key=str):
        contents = parse_toml(path.read_text("utf-8"), path.name)
        card = contents["control_card"]
        table.add(contents["name"], contents["title"], card if isinstance(card, str) else "its own")
    return table
