"""``swashplate simulate``, ``compare``, ``axes`` and ``show``: drives under commands."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

import typer

from swashplate.cli import words
from swashplate.cli.options import DriveChoice, FigureFile, Sampling, Simulating, TableFile
from swashplate.cli.terminal import draw, note, save, say, show, working
from swashplate.documents import parse_toml
from swashplate.tables import Column, Table, quantity, write_table


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
    with working("Simulating"):
        chosen = words.at_rate(drive.chosen, sampling.rate)
        name, run = words.simulated(chosen, command, sampling)
        tables, title = run.tables(), f"{drive.title}, {name}"
    save(out, "All signals, in SI", run.write)
    window = words.window_of(run.time, begin, end)
    draw(plot, "plot_simulation", run, window=window, title=title)
    duration = f"{run.time[-1] - run.time[0]:.6g} s"
    drive.note(f"{title}: {run.time.size} samples at {sampling.rate:g} Hz, {duration}")
    show(*tables)


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
    with working("Simulating"):
        from swashplate.analysis.outcomes import rms_difference, side_by_side

        pair = [words.at_rate(words.drive_of(each), rate) for each in (first, second)]
        labels = [each.name for each in pair]
        if labels[0] == labels[1]:  # then by what was typed
            labels = [first, second if second != first else f"{second} (2)"]
        drives = dict(zip(labels, pair, strict=True))
        command = words.maneuver_of(maneuver, *pair)
        voltage = command.sample(Sampling(rate).rate)
        runs = {label: drive.simulate(voltage, rate) for label, drive in drives.items()}
        made = side_by_side(runs)
        rms = rms_difference(*(run.shaft_speed for run in runs.values()))
    title = f"{' and '.join(runs)}, {command.name}"

    def write(path: Path) -> None:
        import polars as pl

        run, speeds = runs[labels[0]], {f"shaft_speed {k}": e.shaft_speed for k, e in runs.items()}
        write_table(pl.DataFrame({"time": run.time, "voltage": run.voltage, **speeds}), path)

    save(out, "Voltage and both speeds, in SI", write)
    draw(plot, "plot_comparison", runs, title=title)
    note(title)
    show(made)
    note(f"rms difference of the speeds: {quantity(rms, 'rad/s', spec='.2f')}")


def axes() -> None:
    """List the packaged drives and their control cards.

    For example:
      swashplate axes
    """
    # their files as they stand: nothing is checked or compiled for a list of names
    made = Table("", (Column("name"), Column("drive", wrap=True), Column("control card")))
    sets = (resources.files("swashplate.parameters") / "sets").iterdir()
    for path in sorted((each for each in sets if each.name.endswith(".toml")), key=str):
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
    parameters = words.drive_of(drive.drive, drive.values or (), drive.factors or ()).parameters
    if toml:
        from swashplate.parameters.files import dump_set

        typer.echo(dump_set(parameters), nl=False)
        return
    say(f"{parameters.name}: {parameters.title}")
    for line in words.changes_between(words.parameters_of(drive.drive), parameters):
        note(line)
    show(*parameters.tables())
    rate = "any rate" if parameters.rate is None else f"{parameters.rate:g} Hz"
    say(
        f"Variants of the equations: pressure_root {parameters.pressure_root}, coulomb_sign "
        f"{parameters.coulomb_sign}, card_switch {parameters.card_switch}, card's filter for "
        f"{rate}, options {', '.join(sorted(parameters.options)) or 'none'}"
    )
