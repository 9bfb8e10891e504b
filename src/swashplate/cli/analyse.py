"""``swashplate limits``, ``whatif``, ``size`` and the other commands that analyse a drive."""

from __future__ import annotations

import shlex
from dataclasses import replace
from math import degrees, isfinite, radians
from pathlib import Path
from typing import Annotated, Literal

import typer

from swashplate.cli import words
from swashplate.cli.options import (
    DriveChoice,
    FigureFile,
    Interpolation,
    Sampling,
    SetFile,
    Simulating,
    TableFile,
    option,
)
from swashplate.cli.terminal import bullets, check_output, draw, note, save, say, show, working
from swashplate.errors import InputError
from swashplate.tables import joined, quantity

LEVEL, SPAN = 0.95, (0.9, 1.1)
"""Of bands, and the factors of a lever that names none."""
OUTCOMES = ("final_speed", "rise_time", "largest_acceleration", "tracking_error", "creep")
SIZED = ("orifice", "pump")
PULLED = (*SIZED, "supply_pressure", "rate_limits", "dead_zone", "spool_stroke", "relief")
MOST_POINTS = 2000
AMPLITUDES = (1.0, 4.0, 6.5, 9.0)

Direction = Literal["both", "positive", "negative"]
Input = Literal["voltage", "current", "solenoid_force"]


# --- limits and changes ---------------------------------------------------------------------------


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
    from swashplate.analysis.capability import envelope
    from swashplate.analysis.limits import shares_of

    if command is None:
        with working("Measuring"):
            found = envelope(drive.chosen)
        save(out, "Envelope, in SI", found.write)
        draw(plot, "plot_envelope", found)
        drive.note(f"{drive.title}: what it can do")
        show(found.table())
        return
    with working("Simulating"):
        chosen = words.at_rate(drive.chosen, sampling.rate)
        name, run = words.simulated(chosen, command, sampling)
        shares = shares_of(chosen, run)
    title = f"{drive.title}, {name}"
    save(out, "Shares of each limit, in SI", shares.write)
    draw(plot, "plot_limit_timeline", run, wanted=shares.wanted, title=title)
    error = quantity(shares.error, "rad/s", spec=".3f")
    # which of the limits that act here no test reached is said below, by the result itself
    drive.note(f"{title}: {error} rms from a drive without limits", unreached=False)
    acting = shares.table(acting=True)
    if acting.rows:
        show(acting)
    for sentence in shares.sentences():
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
    out: SetFile = None,
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
      campaign CAMPAIGN.toml: The campaign of that fit, if it is not where it was.

    For example:
      swashplate whatif hoist --scale orifice=1.5 --scale pump=1.5
      swashplate whatif slew --scale orifice_diameter=1.2 --maneuver step:6 --plot w.png
      swashplate whatif fitted --scale dead_zone=0 --uncertainty fitted
      swashplate whatif mine.toml --scale pump=1.2 --maneuver log.csv --interpolation previous
      swashplate whatif --levers
    """
    from swashplate.analysis import monte_carlo
    from swashplate.analysis.whatif import AS_IS, CHANGED, what_if

    moved = words.factors_of(factors)
    choice = DriveChoice(drive)
    with working("Simulating"):
        name, trial = words.trial_of(choice.chosen, maneuver, sampling)
        result = what_if(choice.chosen, moved, trial, outcomes=(*OUTCOMES, "travel"))
    bands, said = dict[str, monte_carlo.Bands](), list[str]()
    if uncertainty is not None:
        with working("Drawing drives"):
            draws = monte_carlo.stored_draws(uncertainty, drive=choice.chosen, campaign=campaign)
            drawn = {AS_IS: draws, CHANGED: draws.pulled(moved)}
            said.append(f"± is half of the interval that holds {100.0 * LEVEL:g} % of the drives.")
            for which, each in drawn.items():
                band = monte_carlo.bands(each, trial, result.outcomes, level=LEVEL)
                bands[which], (width, when) = band, band.widest
                said.append(
                    f"Band of {band.draws} drives, {which}: at most "
                    f"{quantity(width, 'rad/s', spec='.3g')} wide, at {when:.3g} s."
                )
            said += draws.sentences()
    save(out, "Changed drive", result.after.drive.to_toml)
    title = f"{choice.title}, {name}"
    changes = ", ".join(f"{name} x {factor:g}" for name, factor in moved.items())
    draw(plot, "plot_whatif", result, bands=bands, title=f"{title}: {changes}")
    choice.note(title)
    before, after = (each.drive.parameters for each in (result.before, result.after))
    for line in words.changes_between(before, after):
        note(line)
    show(result.table(bands))
    bullets(result.sentences(), said)


def size(
    drive: DriveChoice,
    *,
    speed_deg_s: float | None = None,
    acceleration_deg_s2: float | None = None,
    tracking_deg_s: float | None = None,
    maneuver: str | None = None,
    direction: Direction = "both",
    levers: list[str] | None = None,
    out: SetFile = None,
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
      direction: Where speed and acceleration are required.

    For example:
      swashplate size hoist --speed-deg-s 250 --lever pump
      swashplate size hoist --acceleration-deg-s2 200 --lever orifice=1/2 --lever pump=1/1.5
      swashplate size hoist --tracking-deg-s 19 --maneuver sine:9,0.1 --out larger.toml
    """
    from swashplate.analysis import sizing
    from swashplate.analysis.outcomes import proportional_speed, trial

    if (tracking_deg_s is None) != (maneuver is None):
        raise InputError("--tracking-deg-s and --maneuver belong together: give both or neither.")
    given = (speed_deg_s, acceleration_deg_s2, tracking_deg_s)
    speed, acceleration, error = (None if each is None else radians(each) for each in given)
    required = sizing.Requirements(speed, acceleration, error, direction)
    with working("Sizing"):
        follow, ranges = None, words.ranges_of(levers or SIZED, sizing.WIDEST)
        if maneuver is not None:
            voltage = words.maneuver_of(maneuver, drive.chosen).sample()
            # a larger drive may well be what it takes to reach it
            wanted = proportional_speed(drive.chosen, voltage, limited=False)
            follow = trial(drive.chosen, voltage, wanted=wanted)
        found = sizing.size(drive.chosen, required, ranges, follow=follow)
    save(out, "Changed drive", found.drive.to_toml)
    drive.note(drive.title)
    show(*found.tables())
    if found.change == 0.0:
        say("The drive meets it as it is; nothing needs to be changed.")
    elif not drive.changes:  # whatif begins at a drive as its file has it
        moved = [f"{name}={factor!r}" for name, factor in found.factors.items() if factor != 1.0]
        scales = [word for each in moved for word in ("--scale", each)]
        said = shlex.join(["swashplate", "whatif", drive.drive, *scales])
        note(f"See it over a command: {said}")


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

    with working("Simulating"):
        name, trial = words.trial_of(drive.chosen, maneuver, sampling)
        ranges = words.ranges_of(levers or (*PULLED, "plussing"), SPAN)
        found = one_at_a_time(drive.chosen, ranges, trial, outcomes=tuple(outcomes or OUTCOMES))
    title = f"{drive.title}, {name}"
    save(out, "All numbers, in SI", joined(found.tables(every=True)).write)
    draw(plot, "plot_tornado", found, title=f"{title}: each lever by itself")
    drive.note(title)
    show(*found.tables())
    bullets(dict.fromkeys(found.sentences))


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

    check_output(out, compensation.INVERSE_MAP)
    if stick is not None and stick.lstrip("+-").replace(".", "", 1).isdecimal():
        raise InputError(
            f"{stick} is a number, not what a stick does: for the voltage of a speed write "
            f"--speed-deg-s {stick}."
        )
    with working("Inverting"):
        chosen = words.at_rate(drive.chosen, sampling.rate)
        found, bought = compensation.inverse_map(chosen, points), None
        tables = found.tables([radians(each) for each in speeds_deg_s or ()])
        if stick is not None:
            name, run = words.simulated(chosen, stick, sampling)
            wanted = compensation.wanted_of_stick(found, run["voltage"])
            bought = compensation.improvement(chosen, wanted, run.record.rate, inverse=found)
            tables.append(replace(bought.table(), title=f"Error of the speed under {name}"))
    save(out, "Inverse map, in SI", found.write)
    draw(plot, "plot_compensation", found, bought)
    drive.note(f"{drive.title}: voltage for a wanted speed")
    show(*tables)


# --- other models of a drive ----------------------------------------------------------------------


def linearize(
    drive: DriveChoice,
    *,
    at: float | None = None,
    current: float | None = None,
    input: Input | None = None,
    sample_time: float | None = None,
    interpolation: Interpolation = "linear",
    loop_gain: float | None = None,
    frequency: float = 0.3,
    out: Path | None = None,
) -> None:
    """Linearise a drive at a voltage or a current.

    Prints the operating point, the gain, the lag of the pump, the poles, the
    bandwidth and what a speed loop closed over the drive can bear. The model is
    exact for small motions; 'swashplate bode' shows what becomes of large ones.

    Options:
      at V: Linearise at this constant voltage.
      current A: Or at this constant signed current.
      input: What moves the model; by default the voltage, or the current with --current.
      sample_time S: Sample the model, with the recurrences of the simulation.
      interpolation: The input between samples: linear, or zero-order hold.
      loop_gain V/(DEG/S): Print the margins of a proportional speed loop of this gain.
      frequency HZ: Frequency to print gain and phase at.
      out FILE: Write the model, in SI, to a .toml or .json file.

    For example:
      swashplate linearize hoist --at 4
      swashplate linearize hoist --at -2 --loop-gain 0.1
      swashplate linearize slew --at 2 --sample-time 0.01 --out slew.toml
      swashplate linearize luff --current 0 --input solenoid_force
    """
    from swashplate.drive import model_tables
    from swashplate.linear import LINEAR_MODEL

    check_output(out, LINEAR_MODEL)
    if (at is None) == (current is None):
        raise InputError(
            "A drive is linearised at a voltage or a current: give one of --at and --current."
        )
    if current is not None and input == "voltage":
        raise InputError("--input voltage needs --at, not --current.")
    with working("Linearising"):
        model = drive.chosen.linearize(at, current=current, input=input)
        if sample_time is not None:
            if not sample_time > 0.0:
                raise InputError(f"--sample-time is {sample_time:g} s, but must be above 0.")
            model = model.discrete(1.0 / sample_time, interpolation)
        tables = model_tables(model, frequency, None if loop_gain is None else degrees(loop_gain))
    save(out, "Model, in SI", model.write)
    kind = "" if sample_time is None else f", sampled at {sample_time:g} s"
    drive.note(f"{drive.title}, small motions of the {model.input.replace('_', ' ')}{kind}")
    for switch in model.operating_point.one_sided:
        note(f"One-sided at the {switch}.")
    coulomb = "C_plus" if (at or 0.0) >= 0.0 else "C_minus"
    if model.input == "voltage" and model.parameters.numbers[coulomb] > 0.0:
        note("The card's Coulomb term C, which only motions below 0.01 A/s see, is left out.")
    show(*tables)


def bode(
    drive: DriveChoice,
    *,
    amplitudes: list[float] | None = None,
    bias: float = 0.0,
    lowest: float = 0.02,
    highest: float = 5.0,
    points: int = 40,
    frequency: float = 0.3,
    linear_at: float | None = None,
    plot: FigureFile = None,
    out: TableFile = None,
) -> None:
    """Sweep sines of several amplitudes through a drive.

    Each sine is simulated until the answer repeats itself; gain and phase are
    those of its first harmonic, the distortion is all the rest of it. Prints the
    gain, the phase and the time by which the speed lags at one frequency: what a
    controller that is to damp a swing of that frequency has to make up for.

    Options:
      amplitudes --amplitude V: Amplitude of the sine; may be repeated. By default 1, 4, 6.5 and 9.
      bias V: Mean of the sine.
      lowest --from HZ: Lowest frequency.
      highest --to HZ: Highest frequency.
      points N: Frequencies, evenly spaced on a logarithmic axis.
      frequency HZ: Frequency to print and to mark.
      linear_at V: Draw the linear model at this voltage beside the sines.

    For example:
      swashplate bode hoist
      swashplate bode hoist --amplitude 1 --amplitude 9 --plot bode.png
      swashplate bode slew --bias 3 --amplitude 0.1 --linear-at 3 --out bode.csv
    """
    import numpy as np

    from swashplate.drive import response_table

    if not 2 <= points <= MOST_POINTS:
        raise InputError(f"--points is {points}, but must be 2 to {MOST_POINTS}.")
    if not (isfinite(lowest) and isfinite(highest) and 0.0 < lowest < highest):
        raise InputError(
            f"--from and --to must rise from above 0 Hz, not {lowest:g} to {highest:g}."
        )
    with working("Sweeping"):
        linear = None if linear_at is None else drive.chosen.linearize(linear_at)
        grid = np.union1d(np.geomspace(lowest, highest, points), [frequency])
        response = drive.chosen.frequency_response(grid, amplitudes or AMPLITUDES, bias=bias)
        made = response_table(response, frequency)
    save(out, "Gain, phase and distortion, in SI", response.write)
    draw(plot, "plot_bode", response, linear=linear, mark=frequency)
    span = f"{grid.size} frequencies from {grid[0]:g} to {grid[-1]:g} Hz"
    drive.note(f"{drive.title}, sines about {bias:g} V: {span}")
    note(f"At {frequency:g} Hz:")
    show(made)
    for each in response.still():
        say(f"{each}.")


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
    from swashplate import full_order as full
    from swashplate.full_order import physical_set

    if command is None and plot is not None:
        raise InputError("--plot draws one run; name a maneuver or a log, such as step:9.")
    given = words.physical_values(physical or ())
    with working("Completing the physical values"):
        chosen = words.at_rate(drive.chosen, sampling.rate)
        axis = physical_set.nearest_set(chosen.name) if like is None else like
        whole = full.FullOrderDrive.from_drive(chosen.plain, axis, **given)
        tables = [physical_set.choices_table(axis, given), whole.modes().table()]
    with working("Simulating"):
        if command is None:
            found = full.validity(whole, sampling.rate)
            title, said = drive.title, f"{len(found.rows)} maneuvers"
        else:
            name, run = words.simulated(whole.drive, command, sampling)
            both = full.compare(whole, run, start=sampling.start)
            found = full.validity_table(whole.physical.name, [(name, both)])
            title = f"{drive.title}, {name}"
            said = f"{both.time.size} samples at {sampling.rate:g} Hz"
    if command is None:
        save(out, "Table", found.write)
    else:
        save(out, "All signals, in SI", both.write)
        draw(plot, "plot_full_order", both, title=f"{title}, five states against one")
    drive.note(f"{title}, five states against one: {said}")
    if chosen.parameters.refinements:
        listed = ", ".join(chosen.parameters.refinements)
        note(f"Left out of both models, which do not know refinements: {listed}.")
    show(*tables, found)
    say(full.validity_verdict(found))
