"""``swashplate full-order``: what the one-state model leaves out of a drive."""

from __future__ import annotations

from swashplate.cli.options import (
    DriveChoice,
    FigureFile,
    Simulating,
    TableFile,
)
from swashplate.cli.terminal import Outputs, note, say, show, working
from swashplate.cli.words import physical_values, simulated
from swashplate.errors import InputError
from swashplate.tables import FIGURE, TABLE


def full_order(
    drive: DriveChoice,
    command: str | None = None,
    *,
    like: str | None = None,
    physical: list[str] | None = None,
    out: TableFile = None,
    plot: FigureFile = None,
    sampling: Simulating,
) -> None:
    """Check whether one state is enough for a drive and a command.

    Gives spool and swash plate their mass back: a model with five states, whose
    physical values are completed from the drive's parameters and from assumed
    ones. Prints these, the modes, and by how much the speed of the one-state
    model differs. What is assumed can be replaced by what you know.

    Options:
      command MANEUVER|FILE: A maneuver or a log, as in 'swashplate simulate'. Without one, a table
          of maneuvers.
      like AXIS: Packaged axis whose assumed physical values count; by default the drive's own, or
          else hoist.
      physical NAME=VALUE: Another physical value: oil_volume=1e-4 in SI, oil_volume=100cm^3 with a
          unit. May be repeated.

    For example:
      swashplate full-order hoist
      swashplate full-order hoist step:9 --plot full.png
      swashplate full-order fitted/drive.toml sine:4,1 --like luff
      swashplate full-order hoist step:4 --physical load_torque=2kN*m --out run.csv
      swashplate full-order hoist log.csv --interpolation previous
    """
    files = Outputs((out, TABLE), (plot, FIGURE))
    if command is None and plot is not None:
        raise InputError("--plot draws one run; name a maneuver or a log, such as step:9.")
    given = physical_values(physical or ())
    with working("Completing the physical values"):
        from swashplate.full_order import (
            FullOrderDrive,
            compare,
            physical_set,
            validity,
            validity_table,
            validity_verdict,
        )

        chosen = drive.chosen
        axis = physical_set.nearest_set(chosen.name) if like is None else like
        full = FullOrderDrive.from_drive(chosen.plain, axis, **given)
        tables = [physical_set.choices_table(axis, given), full.modes().table()]
    head = [*drive.changes]
    if chosen.parameters.refinements:
        listed = ", ".join(chosen.parameters.refinements)
        head.append(f"Left out of both models, which do not know refinements: {listed}.")
    if command is None:
        from swashplate.equations.marching.record import least_substeps

        least_substeps(sampling.rate)  # one out of range is refused before anything is sampled
        with working("Simulating"):
            found = validity(full, sampling.rate)
        files.write(out, "Table", found.write)
        said = f"{len(found.rows)} maneuvers"
        title = drive.title
    else:
        with working("Simulating"):
            name, run = simulated(full.drive, command, sampling)
            both = compare(full, run, start=sampling.start)
            found = validity_table(full.physical.name, [(name, both)])
        title = f"{drive.title}, {name}"
        files.write(out, "All signals, in SI", both.write)
        files.draw(plot, "plot_full_order", both, title=f"{title}, five states against one")
        said = f"{both.time.size} samples at {sampling.rate:g} Hz"
    note(f"{title}, five states against one: {said}")
    for line in head:
        note(line)
    show(*tables, found)
    say(validity_verdict(found))
    files.say()
