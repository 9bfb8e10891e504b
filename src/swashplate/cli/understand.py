"""``swashplate limits``, ``whatif``, ``size``, ``sensitivity`` and ``compensate``."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import replace
from math import radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from swashplate.cli.options import (
    DriveChoice,
    FigureFile,
    Sampling,
    Simulating,
    TableFile,
    option,
)
from swashplate.cli.terminal import Outputs, bullets, note, say, show, working
from swashplate.cli.words import (
    changes_between,
    factors_of,
    maneuver_of,
    ranges_of,
    simulated,
    trial_of,
)
from swashplate.errors import InputError
from swashplate.tables import FIGURE, TABLE, joined, quantity

if TYPE_CHECKING:
    from swashplate.analysis.monte_carlo import Bands

LEVEL, SPAN = 0.95, (0.9, 1.1)
"""Of bands, and the factors of a lever that names none."""
CHOSEN = ("final_speed", "rise_time", "largest_acceleration", "tracking_error", "creep", "travel")
SIZED = ("orifice", "pump")
PULLED = (
    "orifice",
    "pump",
    "supply_pressure",
    "rate_limits",
    "dead_zone",
    "spool_stroke",
    "relief",
    "plussing",
)
OUTCOMES = ("final_speed", "rise_time", "largest_acceleration", "tracking_error", "creep")

Direction = Literal["both", "positive", "negative"]


def limits(
    drive: DriveChoice,
    command: str | None = None,
    *,
    out: TableFile = None,
    plot: FigureFile = None,
    sampling: Simulating,
) -> None:
    """Show what a drive can do, or what limits it under a command.

    Without a command: dead zone, gain, limits of speed and acceleration, rise
    times ('swashplate bode' says how it follows sines). With one: how often each
    limit acts, by how much the error falls without it, and so which component to
    change first. The error is the rms of the speed less that of a drive without
    limits. The shares need not add up to 100 %.

    Options:
      command MANEUVER|FILE: A maneuver or a log, as in 'swashplate simulate': what limits the drive
          under it. Without one, what the drive can do at all.

    For example:
      swashplate limits hoist
      swashplate limits hoist --plot envelope.png
      swashplate limits luff sine:9,0.1 --plot timeline.png
      swashplate limits mine.toml log.csv --interpolation previous --out shares.csv
    """
    files = Outputs((out, TABLE), (plot, FIGURE))
    if command is None:
        _say_envelope(drive, files, out, plot)
    else:
        _say_shares(drive, command, sampling, files, out, plot)
    files.say()


def _say_envelope(drive: DriveChoice, files: Outputs, out: Path | None, plot: Path | None) -> None:
    with working("Measuring"):
        from swashplate.analysis.capability import envelope

        found = envelope(drive.chosen)
    files.write(out, "Envelope, in SI", found.write)
    files.draw(plot, "plot_envelope", found)
    drive.note(f"{drive.title}: what it can do")
    show(found.table())


def _say_shares(
    drive: DriveChoice,
    command: str,
    sampling: Simulating,
    files: Outputs,
    out: Path | None,
    plot: Path | None,
) -> None:
    with working("Simulating"):
        from swashplate.analysis.limits import limit_shares

        name, run = simulated(drive.chosen, command, sampling)
        assert run.voltage is not None  # the command line simulates voltages only
        found = limit_shares(
            drive.chosen,
            run.voltage,
            run.record.rate,
            interpolation=sampling.interpolation,
            start=sampling.start,
        )
    title = f"{drive.title}, {name}"
    files.write(out, "Shares of each limit, in SI", found.write)
    files.draw(plot, "plot_limit_timeline", run, wanted=found.wanted, title=title)
    error = quantity(found.error, "rad/s", spec=".3f")
    drive.note(f"{title}: {error} rms from a drive without limits")
    shares = found.table(acting=True)
    if shares.rows:
        show(shares)
    for sentence in found.sentences():
        say(sentence)


def _list_levers(asked: bool) -> None:
    if asked:
        from swashplate.analysis.whatif import levers_table

        show(levers_table())
        raise typer.Exit


def whatif(
    drive: str,
    *,
    factors: list[str],
    maneuver: str = "sine:9,0.1",
    uncertainty: Path | None = None,
    campaign: Path | None = None,
    plot: FigureFile = None,
    out: Path | None = None,
    levers: Annotated[
        bool, option("List the levers and end.", "--levers", callback=_list_levers, is_eager=True)
    ] = False,
    sampling: Sampling,
) -> None:
    """Predict what a change of the machine does.

    Simulates the drive as it is and with its levers moved, over one command.
    The speed that is wanted is in proportion to the voltage, at the ratio of
    the drive as it is. With --uncertainty outcomes get intervals and the figure
    bands: drives are drawn from the errors of a fit's estimates.

    Options:
      factors --scale LEVER=FACTOR: A factor on a lever: orifice=1.5, pump=1.5, dead_zone=0 ... (see
          --levers), or on a parameter: Z16_plus=1.2. May be repeated.
      maneuver NAME|FILE: Command for both: a maneuver such as step:9 or "step +9 V", or a log.
      uncertainty DIR: Folder that 'fit' wrote: bands from the errors of its estimates.
      out SET.toml: Write the changed drive as a parameter file.
      campaign CAMPAIGN.toml: The campaign of that fit, if it is not where it was.

    For example:
      swashplate whatif hoist --scale orifice=1.5 --scale pump=1.5
      swashplate whatif slew --scale orifice_diameter=1.2 --maneuver step:6 --plot w.png
      swashplate whatif fitted --scale dead_zone=0 --uncertainty fitted
      swashplate whatif mine.toml --scale pump=1.2 --maneuver log.csv --interpolation previous
      swashplate whatif --levers
    """
    from swashplate.analysis.whatif import AS_IS, CHANGED, what_if

    files = Outputs((out, None), (plot, FIGURE))
    moved = factors_of(factors)
    choice = DriveChoice(drive)
    with working("Simulating"):
        name, trial = trial_of(choice.chosen, maneuver, sampling)
        result = what_if(choice.chosen, moved, trial, outcomes=CHOSEN)
    bands: dict[str, Bands] = {}
    said = list[str]()
    if uncertainty is not None:
        with working("Drawing drives"):
            from swashplate.analysis import monte_carlo

            before = monte_carlo.stored_draws(uncertainty, drive=choice.chosen, campaign=campaign)
            drawn = {AS_IS: before, CHANGED: before.pulled(moved)}
            bands = {
                name: monte_carlo.bands(each, trial, result.outcomes, level=LEVEL)
                for name, each in drawn.items()
            }
            said = [*_band_sentences(bands), *before.sentences()]
    title = f"{choice.title}, {name}"
    files.write(out, "Changed drive", result.after.drive.to_toml)
    words = ", ".join(f"{name} x {factor:g}" for name, factor in moved.items())
    files.draw(plot, "plot_whatif", result, bands=bands, title=f"{title}: {words}")
    note(title)
    for line in changes_between(result.before.drive.parameters, result.after.drive.parameters):
        note(line)
    show(result.table(bands))
    bullets(result.sentences(), said)
    files.say()


def _band_sentences(bands: Mapping[str, Bands]) -> list[str]:
    said = [f"± is half of the interval that holds {100.0 * LEVEL:g} % of the drives."]
    for name, band in bands.items():
        width, when = band.widest
        said.append(
            f"Band of {band.draws} drives, {name}: at most {quantity(width, 'rad/s', spec='.3g')} "
            f"wide, at {when:.3g} s."
        )
    return said


def size(
    drive: DriveChoice,
    *,
    speed_deg_s: float | None = None,
    acceleration_deg_s2: float | None = None,
    tracking_deg_s: float | None = None,
    maneuver: str | None = None,
    direction: Direction = "both",
    levers: list[str] | None = None,
    out: Path | None = None,
) -> None:
    """Find the smallest change that meets what is required.

    Smallest is the least sum of squares of the changes, each in per cent. What
    cannot be met is refused, with what can be reached. Levers are orifice and
    pump, from half to twice, unless others are named.

    Options:
      speed_deg_s DEG/S: Speed that is required.
      acceleration_deg_s2 DEG/S2: Acceleration that is required, after a full step from rest.
      tracking_deg_s DEG/S: Largest RMS error that is allowed while following the maneuver.
      maneuver NAME: What is to be followed: the speed in proportion to this maneuver's voltage, at
          the ratio of the drive as it is. Each candidate is commanded in proportion to it, at its
          own ratio.
      out SET.toml: Write the changed drive as a parameter file.
      direction: Where speed and acceleration are required.

    For example:
      swashplate size hoist --speed-deg-s 250 --lever pump
      swashplate size hoist --acceleration-deg-s2 200 --lever orifice=1/2 --lever pump=1/1.5
      swashplate size hoist --tracking-deg-s 19 --maneuver sine:9,0.1 --out larger.toml
    """
    from swashplate.analysis import sizing
    from swashplate.analysis.outcomes import proportional_speed, trial

    files = Outputs((out, None))
    if (tracking_deg_s is None) != (maneuver is None):
        raise InputError("--tracking-deg-s and --maneuver belong together: give both or neither.")
    given = (speed_deg_s, acceleration_deg_s2, tracking_deg_s)
    speed, acceleration, error = (None if each is None else radians(each) for each in given)
    required = sizing.Requirements(speed, acceleration, error, direction)
    with working("Sizing"):
        follow, ranges = None, ranges_of(levers or SIZED, sizing.WIDEST)
        if maneuver is not None:
            voltage = maneuver_of(maneuver, drive.chosen).sample()
            # a larger drive may well be what it takes to reach it
            wanted = proportional_speed(drive.chosen, voltage, limited=False)
            follow = trial(drive.chosen, voltage, wanted=wanted)
        found = sizing.size(drive.chosen, required, ranges, follow=follow)
    files.write(out, "Changed drive", found.drive.to_toml)
    drive.note(drive.title)
    show(*found.tables())
    if found.change == 0.0:
        say("The drive meets it as it is; nothing needs to be changed.")
    elif not drive.changes:  # whatif begins at a drive as its file has it
        words = ["swashplate", "whatif", drive.drive]
        for name, factor in found.factors.items():
            words += ["--scale", f"{name}={factor!r}"] if factor != 1.0 else []
        note(f"See it over a command: {shlex.join(words)}")
    files.say()


def sensitivity(
    drive: DriveChoice,
    *,
    levers: list[str] | None = None,
    outcomes: list[str] | None = None,
    maneuver: str = "step:9",
    plot: FigureFile = None,
    out: TableFile = None,
    sampling: Sampling,
) -> None:
    """Show which lever moves which outcome, each moved down and up by itself.

    Options:
      outcomes --outcome NAME: final_speed, peak_speed, rise_time, response_time,
          largest_acceleration, overshoot, tracking_error, creep or travel; may be repeated.
      maneuver NAME|FILE: Command: a maneuver such as step:9 or "step +9 V", or a log.

    For example:
      swashplate sensitivity hoist
      swashplate sensitivity hoist --lever orifice --lever pump=0.8/1.5 --plot tornado.png
      swashplate sensitivity slew --maneuver step:4 --out all.csv
    """
    from swashplate.analysis import one_at_a_time

    files = Outputs((out, TABLE), (plot, FIGURE))
    with working("Simulating"):
        name, trial = trial_of(drive.chosen, maneuver, sampling)
        ranges = ranges_of(levers or PULLED, SPAN)
        found = one_at_a_time(drive.chosen, ranges, trial, outcomes=tuple(outcomes or OUTCOMES))
    title = f"{drive.title}, {name}"
    files.write(out, "All numbers, in SI", joined(found.tables(every=True)).write)
    files.draw(plot, "plot_tornado", found, title=f"{title}: each lever by itself")
    drive.note(title)
    show(*found.tables())
    bullets(dict.fromkeys(found.sentences))
    files.say()


def compensate(
    drive: DriveChoice,
    stick: str | None = None,
    *,
    speeds_deg_s: list[float] | None = None,
    points: int = 101,
    out: Path | None = None,
    plot: FigureFile = None,
    sampling: Sampling,
) -> None:
    """Invert a drive's steady map: the voltage for a wanted speed.

    The map crosses the dead zone at once, ends where the speed saturates, and
    is straight between its points, so that any controller can follow it. With
    what a stick does, compares three controllers in simulation: a straight
    line, the map, and the map with the drive's lag made up for.

    Options:
      stick MANEUVER|FILE: What the stick does: ±10 V asks for the full speed of that way, in
          proportion. A maneuver or a log as in 'swashplate simulate'. Shows what the map gains
          under it.
      speeds_deg_s --speed-deg-s DEG/S: A wanted speed to print the voltage of; may be repeated.
      points N: Points of the map per direction, 2 to 10001.
      out FILE: Write the map, in SI: .toml for a controller, .csv or .parquet as a table.

    For example:
      swashplate compensate hoist --out hoist-inverse.toml
      swashplate compensate hoist --speed-deg-s 5 --speed-deg-s -120
      swashplate compensate luff sine:4,0.1 --plot inverse.png
    """
    from swashplate.analysis import compensation

    files = Outputs((out, compensation.INVERSE_MAP), (plot, FIGURE))
    with working("Inverting"):
        found = compensation.inverse_map(drive.chosen, points)
        tables = found.tables([radians(each) for each in speeds_deg_s or ()])
        bought = None
        if stick is not None:
            name, run = simulated(drive.chosen, stick, sampling)
            assert run.voltage is not None  # the command line simulates voltages only
            wanted = compensation.wanted_of_stick(found, run.voltage)
            bought = compensation.improvement(drive.chosen, wanted, run.record.rate, inverse=found)
            tables.append(replace(bought.table(), title=f"Error of the speed under {name}"))
    files.write(out, "Inverse map, in SI", found.write)
    files.draw(plot, "plot_compensation", found, bought)
    drive.note(f"{drive.title}: voltage for a wanted speed")
    show(*tables)
    files.say()
