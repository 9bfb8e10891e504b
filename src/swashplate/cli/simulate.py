"""``swashplate simulate``, ``compare``, ``axes`` and ``show``: drives under commands."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from swashplate.cli.options import (
    DriveChoice,
    FigureFile,
    Simulating,
    TableFile,
)
from swashplate.cli.terminal import Outputs, note, say, show, working
from swashplate.cli.words import (
    changes_between,
    drive_of,
    maneuver_of,
    parameters_of,
    simulated,
)
from swashplate.documents import parse_toml
from swashplate.tables import FIGURE, TABLE, Column, Table

if TYPE_CHECKING:
    from swashplate.drive import Drive
    from swashplate.simulation.result import Simulation


def simulate(
    drive: DriveChoice,
    command: str,
    *,
    sampling: Simulating,
    out: TableFile = None,
    plot: FigureFile = None,
    begin: float | None = None,
    end: float | None = None,
) -> None:
    """Simulate a drive over a maneuver or a measured voltage.

    Prints what the drive did: its largest speeds and currents, how far it went
    and how long each of its limits held it back, the dead zone only while the
    command is not 0 V. --out writes every signal, --plot draws them.
    'swashplate --help' lists the maneuvers.

    Options:
      begin --from S: Plot from here on.
      end --to S: Plot up to here.

    For example:
      swashplate simulate hoist step:9
      swashplate simulate hoist "step +9 V" --plot step.png --units rpm
      swashplate simulate hoist sine:6.5,0.1 --set Z16_plus=0.12mm --out sine.csv
      swashplate simulate mine.toml log.csv --interpolation previous --out run.csv
    """
    files = Outputs((out, TABLE), (plot, FIGURE))
    with working("Simulating"):
        from swashplate.analysis.outcomes import run_tables

        name, run = simulated(drive.chosen, command, sampling)
        tables, title = run_tables(run), f"{drive.title}, {name}"
    files.write(out, "All signals, in SI", run.write)
    window = None
    if begin is not None or end is not None:
        first, last = float(run.time[0]), float(run.time[-1])
        window = (first if begin is None else begin, last if end is None else end)
    files.draw(plot, "plot_simulation", run, window=window, title=title)
    duration = f"{run.time[-1] - run.time[0]:.6g} s"
    drive.note(f"{title}: {run.time.size} samples at {sampling.rate:g} Hz, {duration}")
    show(*tables)
    files.say()


def compare(
    first: str,
    second: str,
    *,
    maneuver: str = "step:9",
    rate: float = 512.0,
    plot: FigureFile = None,
    out: TableFile = None,
) -> None:
    """Compare two drives over the same maneuver.

    Shows outcomes of both, such as the final speed, at the last moment at which
    the voltage is at its largest. --out writes the voltage and both speeds.

    Options:
      first A: A packaged drive or a TOML file.
      second B: Another, compared with the first.
      maneuver NAME: Maneuver for both, such as step:9 or "step +9 V".

    For example:
      swashplate compare hoist luff
      swashplate compare hoist mine.toml --maneuver sine:6.5,0.1 --plot both.png
    """
    from swashplate.equations.marching.record import least_substeps

    files = Outputs((out, TABLE), (plot, FIGURE))
    least_substeps(rate)  # a rate out of range is refused before anything is sampled
    with working("Simulating"):
        from swashplate.analysis.outcomes import rms_difference, side_by_side
        from swashplate.tables import quantity

        drives = _labelled(first, second)
        command = maneuver_of(maneuver, *drives.values())
        voltage = command.sample(rate)
        runs = {label: drive.simulate(voltage, rate) for label, drive in drives.items()}
        made = side_by_side(runs)
        rms = rms_difference(*(run.shaft_speed for run in runs.values()))
    title = f"{' and '.join(runs)}, {command.name}"
    files.write(out, "Voltage and both speeds, in SI", lambda path: _write_speeds(runs, path))
    files.draw(plot, "plot_comparison", runs, title=title)
    note(title)
    show(made)
    note(f"rms difference of the speeds: {quantity(rms, 'rad/s', spec='.2f')}")
    files.say()


def _labelled(first: str, second: str) -> dict[str, Drive]:
    """Both drives by name, or by what was typed where they have the same name."""
    drives = (drive_of(first), drive_of(second))
    labels = (drives[0].name, drives[1].name)
    if labels[0] == labels[1]:
        labels = (first, second if second != first else f"{second} (2)")
    return dict(zip(labels, drives, strict=True))


def _write_speeds(runs: dict[str, Simulation], path: Path) -> None:
    import polars as pl

    from swashplate.tables import write_table

    run = next(iter(runs.values()))
    speeds = {f"shaft_speed {label}": each.shaft_speed for label, each in runs.items()}
    write_table(pl.DataFrame({"time": run.time, "voltage": run.voltage, **speeds}), path)


def axes() -> None:
    """List the packaged drives and their control cards.

    For example:
      swashplate axes
    """
    # their files as they stand: nothing is checked or compiled for a list of names
    made = Table("", (Column("name"), Column("drive", wrap=True), Column("control card")))
    for path in sorted(
        (resources.files("swashplate.parameters") / "sets").iterdir(), key=lambda p: p.name
    ):
        if path.name.endswith(".toml"):
            found = parse_toml(path.read_text("utf-8"), path.name)
            card = found["control_card"]
            made.add(found["name"], found["title"], card if isinstance(card, str) else "its own")
    show(made)


def show_parameters(drive: DriveChoice, *, toml: bool = False) -> None:
    """Show every parameter of a drive, with its unit and where it comes from.

    A parameter with a plus and a minus value has one for each direction; both
    are magnitudes. Units are SI.

    Options:
      toml: Print a TOML file, complete and ready to edit.

    For example:
      swashplate show hoist
      swashplate show hoist --toml > mine.toml    (a start for your own drive)
    """
    # in SI: a rod's drive has angles inside, which chosen units of its motion would change
    parameters = drive_of(drive.drive, drive.values or (), drive.factors or ()).parameters
    if toml:
        from swashplate.parameters.files import dump_set

        typer.echo(dump_set(parameters), nl=False)
        return
    say(f"{parameters.name}: {parameters.title}")
    for line in changes_between(parameters_of(drive.drive), parameters):
        note(line)
    show(*parameters.tables())
    rate = "any rate" if parameters.rate is None else f"{parameters.rate:g} Hz"
    say(
        f"Variants of the equations: pressure_root {parameters.pressure_root}, coulomb_sign "
        f"{parameters.coulomb_sign}, card_switch {parameters.card_switch}, card's filter for "
        f"{rate}, options {', '.join(sorted(parameters.options)) or 'none'}"
    )
