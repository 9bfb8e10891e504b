"""``swashplate limits``, ``whatif``, ``size`` and the other commands that analyse a drive."""

from __future__ import annotations

import shlex
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from math import degrees, isfinite, radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple, get_args

import typer

from swashplate.cli import parsing, trials
from swashplate.cli.commands import command
from swashplate.cli.machines import OwnMachine, limits_table, without_empty
from swashplate.cli.operating_points import (
    linear_model,
    linear_tables,
    operating_point,
    outputs_named,
    rates_under,
)
from swashplate.cli.options import (
    NO_VALUE,
    CommandSampling,
    DriveArgument,
    DriveChoice,
    FigureFile,
    Force,
    Interpolation,
    MachineChoice,
    ManeuverOrLog,
    OptionalCommand,
    OutputOption,
    SetFile,
    Simulating,
    StepRate,
    TableFile,
    VariablesOption,
)
from swashplate.cli.terminal import (
    bullets,
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
from swashplate.tables import joined, quantity
from swashplate.units import unit_text

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from swashplate.machine.linear import FrequencyResponse, LinearModel

LEVEL, SPAN = 0.95, (0.9, 1.1)
"""Level of the bands, and the usual factors of a design variable."""
OUTCOMES = ("final_speed", "rise_time", "largest_acceleration", "tracking_error", "creep")
SIZED = ("orifice", "pump")
VARIED = (*SIZED, "supply_pressure", "rate_limits", "dead_zone", "spool_stroke", "relief")
MOST_POINTS = 2000
AMPLITUDES = (1.0, 4.0, 6.5, 9.0)


Direction = Literal["both", "positive", "negative"]
Input = Literal["voltage", "current", "solenoid_force"]

app = typer.Typer(rich_markup_mode="rich")


# --- limits and changes ---------------------------------------------------------------------------


@command(
    app,
    "limits",
    examples="""
        swashplate limits hoist
        swashplate limits hoist --plot envelope.png
        swashplate limits luff sine:9,0.1 --plot timeline.png
        swashplate limits mine.toml log.csv --interpolation previous --out shares.csv
        swashplate limits valve.py step:2 --measured supply=100
    """,
)
def limits(
    machine: MachineChoice,
    maneuver: OptionalCommand = None,
    *,
    out: TableFile = None,
    plot: FigureFile = None,
    sampling: Simulating,
    force: Force = False,
) -> None:
    """Show the limits of a machine, or those that act under a command.

    Of a drive without a command: the numbers that matter, with the intervals of
    its fit, what limits it up to the largest command of its tests and what to
    change first; then what it can do at full voltage ('swashplate bode' shows the
    frequency response).
    With a command: how often each limit acts and by how much the error falls
    without it, which tells which component to change first. The error is the RMS
    difference of the speed from that of a drive without limits. The shares need
    not add up to 100 %. Of a machine of your own: the limits that its model
    declares and the ranges of its signals, with a command how long each acts.
    """
    if machine.own is not None:
        _own_limits(machine, machine.own, maneuver, sampling, out=out, plot=plot)
        return
    from swashplate.analysis import envelope, shares_of

    drive = machine.loaded_drive
    if maneuver is None:
        with spinner("Measuring"):
            capability = envelope(drive)
            numbers = parsing.key_numbers_of(machine.drive, drive)
        save(out, "Envelope, in SI", capability.write)
        draw_figure(plot, "plot_envelope", capability)
        machine.note(f"{machine.title}: the numbers that matter")
        show_numbers(numbers)
        plus, minus = capability.largest
        note(f"\nUp to {plus:.3g} and -{minus:.3g} V at the card")
        show(capability.table(rest=True))
        return
    with spinner("Simulating"):
        marched = trials.at_rate(drive, sampling.rate)
        name, run = trials.simulated_as(marched, maneuver, sampling)
        shares = shares_of(marched, run)
    title = f"{machine.title}, {name}"
    save(out, "Shares of each limit, in SI", shares.write)
    draw_figure(plot, "plot_limit_timeline", run, reference=shares.reference, title=title)
    error = quantity(shares.error, "rad/s", spec=".3f")
    # the sentences of the result name the limits that act here and that no test reached
    machine.note(f"{title}: {error} rms from a drive without limits", unreached=False)
    acting = shares.table(acting=True)
    if acting.rows:
        show(acting)
    for sentence in shares.sentences():
        say(sentence)


def _own_limits(
    machine: MachineChoice,
    own: OwnMachine,
    maneuver: str | None,
    sampling: Simulating,
    *,
    out: Path | None,
    plot: Path | None,
) -> None:
    """Show the limits that a model declares; with a command how long each acts."""
    equations = own.model.name
    if maneuver is None:
        machine.refuse_without("a command", plot=plot)
        table = limits_table(own)
        title = machine.title
    else:
        with spinner("Simulating"):
            name, run = trials.run_of(machine, maneuver, sampling)
            table = limits_table(own, run)
        title = f"{machine.title}, {name}"
        if plot is not None:
            draw_figure(plot, run.plot(title=title))
    if not table.rows:
        raise InputError(
            f"{machine.title}: {equations} declares no limits: give its Model limits=..., an "
            "equation that returns a named tuple of bool, or its signals a range by a Definition."
        )
    save(out, "Limits", table.write)
    machine.note(f"{title}: limits")
    show(without_empty(table))


def _list_variables(requested: bool) -> None:
    if requested:
        from swashplate.analysis import design_variables_table

        show(design_variables_table())
        raise typer.Exit


@command(
    app,
    "whatif",
    examples="""
        swashplate whatif hoist --scale orifice=1.5 --scale pump=1.5
        swashplate whatif slew --scale orifice_diameter=1.2 --maneuver step:6 --plot w.png
        swashplate whatif fitted --scale dead_zone=0 --uncertainty fitted
        swashplate whatif mine.toml --scale pump=1.2 --maneuver log.csv --interpolation previous
        swashplate whatif --variables
    """,
)
def whatif(
    drive: DriveArgument,
    *,
    factors: Annotated[
        list[str],
        typer.Option(
            "--scale",
            metavar="NAME=FACTOR",
            help=(
                "Factor on a design variable, such as orifice=1.5, pump=1.5 or dead_zone=0 (see "
                "--variables), or on a parameter, such as Z16_plus=1.2; may be repeated."
            ),
        ),
    ],
    maneuver: ManeuverOrLog = "sine:9,0.1",
    uncertainty: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder of a fit: show bands from the errors of its estimates."
        ),
    ] = None,
    campaign: Annotated[
        Path | None,
        typer.Option(
            metavar="CAMPAIGN.toml", help="Campaign of that fit, if it has been moved since."
        ),
    ] = None,
    plot: FigureFile = None,
    out: SetFile = None,
    list_variables: Annotated[
        bool,
        typer.Option(
            "--variables",
            metavar=NO_VALUE,
            help="List the design variables and exit.",
            callback=_list_variables,
            is_eager=True,
        ),
    ] = False,
    sampling: CommandSampling,
    force: Force = False,
) -> None:
    """Predict the effect of a change to the machine.

    Simulates the drive as it is and with design variables changed, over one
    command. The reference speed is proportional to the voltage, with the gain of
    the drive as it is. With --uncertainty, metrics get intervals and the
    figure gets bands: drives are drawn from the errors of a fit's estimates.
    """
    from swashplate import analysis
    from swashplate.analysis import AS_IS, CHANGED, what_if

    scaled = parsing.factors_of(factors)
    choice = DriveChoice(drive)
    with spinner("Simulating"):
        name, trial = trials.named_trial(choice.loaded_drive, maneuver, sampling)
        result = what_if(choice.loaded_drive, scaled, trial, outcomes=(*OUTCOMES, "travel"))
    bands = dict[str, analysis.Bands]()
    sentences = list[str]()
    if uncertainty is not None:
        with spinner("Drawing drives"):
            draws = analysis.stored_draws(uncertainty, drive=choice.loaded_drive, campaign=campaign)
            draws_by_variant = {AS_IS: draws, CHANGED: draws.with_factors(scaled)}
            sentences.append(
                f"± is half of the interval that contains {100.0 * LEVEL:g} % of the drives."
            )
            for variant, draws_of_variant in draws_by_variant.items():
                band = analysis.bands(draws_of_variant, trial, result.outcomes, level=LEVEL)
                bands[variant] = band
                widest = band.widest
                sentences.append(
                    f"Band of {band.draws} drives, {variant}: at most "
                    f"{quantity(widest.width, 'rad/s', spec='.3g')} wide, at {widest.time:.3g} s."
                )
            sentences += draws.sentences()
    save(out, "Changed drive", result.after.drive.to_toml)
    title = f"{choice.title}, {name}"
    changes = ", ".join(f"{name} x {factor:g}" for name, factor in scaled.items())
    draw_figure(plot, "plot_whatif", result, bands=bands, title=f"{title}: {changes}")
    choice.note(title)
    for line in parsing.changes_between(
        result.before.drive.parameters, result.after.drive.parameters
    ):
        note(line)
    show(result.table(bands))
    bullets(result.sentences(), sentences)


@command(
    app,
    "size",
    examples="""
        swashplate size hoist --speed-deg-s 250 --variable pump
        swashplate size hoist --acceleration-deg-s2 200 --variable orifice=1/2 --variable pump=1/1.5
        swashplate size hoist --tracking-deg-s 19 --maneuver sine:9,0.1 --out larger.toml
    """,
)
def size(
    drive: DriveChoice,
    *,
    speed_deg_s: Annotated[
        float | None, typer.Option(metavar="DEG/S", help="Required speed.")
    ] = None,
    acceleration_deg_s2: Annotated[
        float | None,
        typer.Option(metavar="DEG/S2", help="Required acceleration after a full step from rest."),
    ] = None,
    tracking_deg_s: Annotated[
        float | None,
        typer.Option(
            metavar="DEG/S", help="Largest acceptable RMS error while following the maneuver."
        ),
    ] = None,
    maneuver: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help=(
                "Maneuver to follow: the reference speed is proportional to its voltage, with the "
                "gain of the drive as it is. Each candidate is commanded in proportion to that "
                "speed, with its own gain."
            ),
        ),
    ] = None,
    direction: Annotated[
        Direction, typer.Option(help="Direction in which speed and acceleration are required.")
    ] = "both",
    variables: VariablesOption = None,
    out: SetFile = None,
    force: Force = False,
) -> None:
    """Find the smallest change that meets requirements.

    The smallest change is the one with the least sum of squares of the changes
    in per cent. Infeasible requirements are rejected, with the values that can
    be reached. The design variables are orifice and pump, from half to twice,
    unless others are named.
    """
    from swashplate import analysis
    from swashplate.analysis import proportional_speed, trial_of

    if (tracking_deg_s is None) != (maneuver is None):
        raise InputError("--tracking-deg-s and --maneuver belong together: give both or neither.")
    requirements = analysis.Requirements(
        _radians(speed_deg_s), _radians(acceleration_deg_s2), _radians(tracking_deg_s), direction
    )
    with spinner("Sizing"):
        trial_to_follow = None
        ranges = parsing.factor_ranges_of(variables or SIZED, analysis.DEFAULT_RANGE)
        if maneuver is not None:
            voltage = trials.named_maneuver(maneuver, drive.loaded_drive).sample()
            # not limited to the speeds of the present drive: a larger one may reach more
            reference = proportional_speed(drive.loaded_drive, voltage, limited=False)
            trial_to_follow = trial_of(drive.loaded_drive, voltage, reference=reference)
        result = analysis.size(drive.loaded_drive, requirements, ranges, follow=trial_to_follow)
    save(out, "Changed drive", result.drive.to_toml)
    drive.note(drive.title)
    show(*result.tables())
    if result.change == 0.0:
        say("The drive meets the requirements as it is.")
    elif not drive.changes:  # whatif has no --set: it begins at the drive of the file
        arguments = ["swashplate", "whatif", drive.drive]
        for name, factor in result.factors.items():
            if factor != 1.0:
                arguments += ["--scale", f"{name}={factor!r}"]
        note(f"To simulate the change: {shlex.join(arguments)}")


def _radians(degrees: float | None) -> float | None:
    return None if degrees is None else radians(degrees)


@command(
    app,
    "sensitivity",
    examples="""
        swashplate sensitivity hoist
        swashplate sensitivity hoist --variable orifice --variable pump=0.8/1.5 --plot tornado.png
        swashplate sensitivity slew --maneuver step:4 --out all.csv
    """,
)
def sensitivity(
    drive: DriveChoice,
    *,
    variables: VariablesOption = None,
    outcomes: Annotated[
        list[str] | None,
        typer.Option(
            "--outcome",
            metavar="NAME",
            help=(
                "Metric: final_speed, peak_speed, rise_time, response_time, largest_acceleration, "
                "overshoot, tracking_error, creep or travel; may be repeated."
            ),
        ),
    ] = None,
    maneuver: ManeuverOrLog = "step:9",
    plot: FigureFile = None,
    out: TableFile = None,
    sampling: CommandSampling,
    force: Force = False,
) -> None:
    """Show the effect of each design variable, changed down and up by itself."""
    from swashplate.analysis import one_at_a_time

    with spinner("Simulating"):
        name, trial = trials.named_trial(drive.loaded_drive, maneuver, sampling)
        ranges = parsing.factor_ranges_of(variables or (*VARIED, "spool_offset"), SPAN)
        names = tuple(outcomes or OUTCOMES)
        result = one_at_a_time(drive.loaded_drive, ranges, trial, outcomes=names)
    title = f"{drive.title}, {name}"
    save(out, "All numbers, in SI", joined(result.tables(every=True)).write)
    draw_figure(plot, "plot_tornado", result, title=f"{title}: one design variable at a time")
    drive.note(title)
    show(*result.tables())
    bullets(dict.fromkeys(result.sentences))


@command(
    app,
    "compensate",
    examples="""
        swashplate compensate hoist --out hoist-inverse.toml
        swashplate compensate hoist --speed-deg-s 5 --speed-deg-s -120
        swashplate compensate luff sine:4,0.1 --plot inverse.png
    """,
)
def compensate(
    drive: DriveChoice,
    stick: Annotated[
        str | None,
        typer.Argument(
            metavar="MANEUVER|FILE",
            help=(
                "Position of the joystick over time, as a maneuver or a log: ±10 V requests full "
                "speed in that direction. Shows the effect of the map."
            ),
        ),
    ] = None,
    *,
    speeds_deg_s: Annotated[
        list[float] | None,
        typer.Option(
            "--speed-deg-s",
            metavar="DEG/S",
            help="Required speed whose voltage is printed; may be repeated.",
        ),
    ] = None,
    points: Annotated[
        int,
        typer.Option(metavar="N", min=0, help="Number of points per direction, 2 to 10001."),
    ] = 101,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write the map in SI units: .toml for a controller, .csv or .parquet as a table.",
        ),
    ] = None,
    plot: FigureFile = None,
    sampling: CommandSampling,
    force: Force = False,
) -> None:
    """Invert a drive's steady-state map: find the voltage for a required speed.

    The map steps across the dead zone, ends where the speed saturates, and is
    linear between its points, so that any controller can evaluate it. With a
    joystick command, three controllers are compared in simulation: a straight
    line, the map, and the map with compensation of the drive's lag.
    """
    from swashplate import analysis

    check_writable(out, analysis.INVERSE_MAP, force=force)
    if stick is not None and stick.lstrip("+-").replace(".", "", 1).isdecimal():
        raise InputError(
            f"{stick} is a number, not a maneuver or a log: for the voltage of a speed, write "
            f"--speed-deg-s {stick}."
        )
    with spinner("Inverting"):
        numbers = parsing.key_numbers_of(drive.drive, drive.loaded_drive)
        marched = trials.at_rate(drive.loaded_drive, sampling.rate)
        creeping = not any(number.unseen for number in numbers.numbers if number.name == "creep")
        inverse = analysis.inverse_map(marched if creeping else marched.replace(Z18=0.0), points)
        improvement = None
        tables = inverse.tables([radians(speed) for speed in speeds_deg_s or ()])
        if stick is not None:
            name, run = trials.simulated_run(marched, stick, sampling)
            reference = analysis.speed_of_command(inverse, run["voltage"])
            improvement = analysis.improvement(marched, reference, run.record.rate, inverse=inverse)
            tables.append(replace(improvement.table(), title=f"Error of the speed under {name}"))
    save(out, "Inverse map, in SI", inverse.write)
    draw_figure(plot, "plot_compensation", inverse, improvement)
    drive.note(f"{drive.title}: voltage for a required speed")
    if not creeping:
        note(f"Creep at rest: {numbers['creep'].shown}. The map takes it as none (Z18 = 0).")
    if inverse.logged is not None:
        note(f"{inverse.logged.sentence}; the tables give both.")
    show(*tables)


# --- other models of a drive ----------------------------------------------------------------------


@command(
    app,
    "linearize",
    examples="""
        swashplate linearize hoist --at 4
        swashplate linearize hoist --at -2 --loop-gain 0.1
        swashplate linearize slew --at 2 --sample-time 0.01 --out slew.toml
        swashplate linearize luff --current 0 --input solenoid_force
        swashplate linearize valve.py --at valve=2 --at supply=100 --output rod
    """,
)
def linearize(
    machine: MachineChoice,
    *,
    at: Annotated[
        list[str] | None,
        typer.Option(
            metavar="V|INPUT=VALUE",
            help=(
                "Constant voltage of the operating point; of a machine of your own a constant "
                "input, such as supply=100, may be repeated."
            ),
        ),
    ] = None,
    current: Annotated[
        float | None,
        typer.Option(metavar="A", help="Constant signed current of the operating point."),
    ] = None,
    input: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help=(
                "Input of the model: voltage, current or solenoid_force (default: voltage, or "
                "current with --current); of a machine of your own any, may be repeated (default: "
                "all)."
            ),
        ),
    ] = None,
    outputs: OutputOption = None,
    rate: StepRate = None,
    sample_time: Annotated[
        float | None,
        typer.Option(
            metavar="S", help="Discretise the model, with the recurrences of the simulation."
        ),
    ] = None,
    interpolation: Annotated[
        Interpolation,
        typer.Option(help="Input between samples: linear, or zero-order hold."),
    ] = "linear",
    loop_gain: Annotated[
        float | None,
        typer.Option(
            metavar="V/(DEG/S)", help="Print the margins of a proportional speed loop of this gain."
        ),
    ] = None,
    frequency: Annotated[
        float, typer.Option(metavar="HZ", help="Frequency at which gain and phase are printed.")
    ] = 0.3,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the model in SI units: .toml or .json."),
    ] = None,
    force: Force = False,
) -> None:
    """Linearise a drive at a voltage or a current, or a machine of your own.

    Prints the operating point, the gain, the lag of the pump, the poles, the
    bandwidth and the largest gain of a speed loop closed over the drive. The
    model is exact for small motions; 'swashplate bode' shows large ones. Of a
    machine of your own: operating point, gains and poles of its step. It settles
    by its model's equation, or by a march under the constant inputs; --set
    start.PATH=VALUE gives its states instead.
    """
    from swashplate.machine.linear import LINEAR_MODEL

    check_writable(out, LINEAR_MODEL, force=force)
    if machine.own is not None:
        machine.refuse(current=current, sample_time=sample_time, loop_gain=loop_gain)
        own = machine.own
        with spinner("Linearising"):
            inputs = own.constants("--at", at or ())
            own.check_needed([*inputs], "--at")
            steps = own.steps_a_second(rate)
            point = operating_point(own, inputs, steps)
            small = linear_model(
                own,
                inputs,
                steps,
                point,
                inputs=[own.input_named(name) for name in input] if input else None,
                outputs=outputs_named(own, outputs),
            )
            tables = linear_tables(own, inputs, point, small, frequency)
        save(out, "Model, in SI", small.write)
        machine.note(f"{machine.title}, small motions, in steps of 1/{steps:g} s")
        show(*tables)
        return
    machine.refuse(output=outputs, rate=rate)
    volts = _number_of_drive("--at", at)
    kind = _input_of_drive(input)
    if (volts is None) == (current is None):
        raise InputError(
            "A drive is linearised at a voltage or a current: give one of --at and --current."
        )
    if current is not None and kind == "voltage":
        raise InputError("--input voltage needs --at, not --current.")
    from swashplate.drive import model_tables

    with spinner("Linearising"):
        model = machine.loaded_drive.linearize(volts, current=current, input=kind)
        if sample_time is not None:
            if not sample_time > 0.0:
                raise InputError(f"--sample-time is {sample_time:g} s, but must be above 0.")
            model = model.discrete(1.0 / sample_time, interpolation)
        # from V/(deg/s) to V/(rad/s)
        gain = None if loop_gain is None else degrees(loop_gain)
        tables = model_tables(model, frequency, gain)
    save(out, "Model, in SI", model.write)
    sampled = "" if sample_time is None else f", sampled at {sample_time:g} s"
    motions = f"small motions of the {model.input.replace('_', ' ')}{sampled}"
    machine.warn_of_fit()
    machine.note(f"{machine.title}, {motions}")
    for switch in model.operating_point.one_sided:
        note(f"One-sided at the {switch}.")
    coulomb_term = "C_plus" if (volts or 0.0) >= 0.0 else "C_minus"
    if model.input == "voltage" and model.parameters.numbers[coulomb_term] > 0.0:
        note("The card's Coulomb term C is left out: it acts only on motions below 0.01 A/s.")
    show(*tables)


def _number_of_drive(option: str, words: Sequence[str] | None) -> float | None:
    """The one number of an option of a drive; None if it is not given."""
    if not words:
        return None
    try:
        (number,) = map(float, words)
    except ValueError:
        raise InputError(
            f"{option} {' '.join(words)}: of a drive it is one number, such as {option} 4."
        ) from None
    return number


def _input_of_drive(words: Sequence[str] | None) -> Input | None:
    """The one input of a drive that --input names; None if it is not given."""
    if not words:
        return None
    for name in get_args(Input):
        if [name] == [*words]:
            chosen: Input = name
            return chosen
    raise InputError(
        f"--input {' '.join(words)}: of a drive it is one of {', '.join(get_args(Input))}."
    )


@command(
    app,
    "bode",
    examples="""
        swashplate bode hoist
        swashplate bode hoist --amplitude 1 --amplitude 9 --plot bode.png
        swashplate bode slew --bias 3 --amplitude 0.1 --linear-at 3 --out bode.csv
        swashplate bode valve.py --at supply=100 --amplitude 2 --output opening
    """,
)
def bode(
    machine: MachineChoice,
    *,
    amplitudes: Annotated[
        list[float] | None,
        typer.Option(
            "--amplitude",
            metavar="V",
            help=(
                "Amplitude of the sine; may be repeated (default: 1, 4, 6.5 and 9; of a machine of "
                "your own 1)."
            ),
        ),
    ] = None,
    bias: Annotated[float, typer.Option(metavar="V", help="Mean of the sine.")] = 0.0,
    at: Annotated[
        list[str] | None,
        typer.Option(
            metavar="INPUT=VALUE",
            help="Constant further input of a machine of your own; may be repeated.",
        ),
    ] = None,
    input: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Input of a machine of your own that is moved (default: the first).",
        ),
    ] = None,
    output: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Signal of a machine of your own that answers (default: its first output).",
        ),
    ] = None,
    rate: StepRate = None,
    lowest: Annotated[float, typer.Option("--from", metavar="HZ", help="Lowest frequency.")] = 0.02,
    highest: Annotated[float, typer.Option("--to", metavar="HZ", help="Highest frequency.")] = 5.0,
    points: Annotated[
        int,
        typer.Option(
            metavar="N", min=0, help="Number of frequencies, evenly spaced on a logarithmic axis."
        ),
    ] = 40,
    frequency: Annotated[
        float, typer.Option(metavar="HZ", help="Frequency to print, and to mark in the figure.")
    ] = 0.3,
    linear_at: Annotated[
        float | None,
        typer.Option(metavar="V", help="Also draw the linear model at this input."),
    ] = None,
    plot: FigureFile = None,
    out: TableFile = None,
    force: Force = False,
) -> None:
    """Measure the frequency response of a machine by simulated sines.

    Each sine is simulated until the response is periodic. Gain and phase are
    those of its first harmonic, the distortion is the rest. Prints the gain, the
    phase and the time lag of the speed at one frequency: the lag that a
    controller for a swing of that frequency has to compensate.
    """
    import numpy as np

    from swashplate.drive import response_table

    if not 2 <= points <= MOST_POINTS:
        raise InputError(f"--points is {points}, but must be 2 to {MOST_POINTS}.")
    if not (isfinite(lowest) and isfinite(highest) and 0.0 < lowest < highest):
        raise InputError(
            f"--from and --to must rise from above 0 Hz, not {lowest:g} to {highest:g}."
        )
    grid = np.union1d(np.geomspace(lowest, highest, points), [frequency])
    linear: LinearModel | None = None
    with spinner("Sweeping"):
        if machine.own is not None:
            others = machine.own.constants("--at", at or ())
            response, linear = _own_response(
                machine.own,
                grid,
                Sine(amplitudes or [1.0], bias, linear_at),
                _ends(machine.own, input, output, others),
                others,
                machine.own.steps_a_second(rate),
            )
            table = response.table()
        else:
            machine.refuse(at=at, input=input, output=output, rate=rate)
            drive = machine.loaded_drive
            linear = None if linear_at is None else drive.linearize(linear_at)
            response = drive.frequency_response(grid, amplitudes or AMPLITUDES, bias=bias)
            table = response_table(response, frequency)
    save(out, "Gain, phase and distortion, in SI", response.write)
    draw_figure(plot, "plot_bode", response, linear=linear, mark=frequency)
    span = f"{grid.size} frequencies from {grid[0]:g} to {grid[-1]:g} Hz"
    about = f"{bias:g} {unit_text(response.units.get(response.input, ''))}".rstrip()
    moved = "" if machine.own is None else f" of {response.input} to {response.output}"
    machine.warn_of_fit()
    machine.note(f"{machine.title}, sines{moved} about {about}: {span}")
    if machine.own is None:
        note(f"At {frequency:g} Hz:")
    show(table)
    for sentence in response.sentences_on_no_motion():
        say(f"{sentence}.")


class Sine(NamedTuple):
    """What moves the input of a frequency response."""

    amplitudes: Sequence[float]
    bias: float
    linear_at: float | None
    """Where the linear model is taken; None for no such model."""


def _ends(
    own: OwnMachine, input: str | None, output: str | None, given: Collection[str]
) -> tuple[str, str]:
    """Input and output of a frequency response, by their full names; others are given."""
    moved = own.driven(given) if input is None else own.input_named(input)
    named = outputs_named(own, None if output is None else [output])
    usual = [name for name in own.model.outputs if name not in own.model.integrals]
    return moved, (named or usual or own.model.last_signals)[0]


def _own_response(
    own: OwnMachine,
    grid: NDArray[np.float64],
    sine: Sine,
    ends: tuple[str, str],
    at: Mapping[str, float],
    rate: float,
) -> tuple[FrequencyResponse, LinearModel | None]:
    """Frequency response of a machine of a user's own, and its linear model."""
    from swashplate.machine.linear import sweep

    input, output = ends
    if input in at:
        raise InputError(f"--at gives {input}, which is moved: its mean is --bias.")
    own.check_needed([input, *at], "--at")
    rate_of_output = rates_under(own, {input: sine.bias, **at}, rate).get(output, 0.0)
    if rate_of_output:
        raise InputError(
            f"{output} runs on under this mean, by {rate_of_output:.4g} a second, so that sines "
            "have no lasting answer: take another --bias, or an --output that comes back."
        )
    response = sweep(
        own.machine,
        grid,
        sine.amplitudes,
        rate,
        input=input,
        output=output,
        bias=sine.bias,
        at=at,
    )
    if sine.linear_at is None:
        return response, None
    inputs = {input: sine.linear_at, **at}
    point = operating_point(own, inputs, rate)
    linear = linear_model(own, inputs, rate, point, inputs=[input], outputs=[output])
    return response, linear


@command(
    app,
    "full-order",
    examples="""
        swashplate full-order hoist
        swashplate full-order hoist step:9 --plot full.png
        swashplate full-order fitted/drive.toml sine:4,1 --like luff
        swashplate full-order hoist step:4 --physical load_torque=2kN*m --out run.csv
        swashplate full-order hoist log.csv --interpolation previous
    """,
)
def full_order(
    drive: DriveChoice,
    maneuver: OptionalCommand = None,
    *,
    like: Annotated[
        str | None,
        typer.Option(
            metavar="AXIS",
            help=(
                "Packaged axis that supplies the assumed physical values (default: the drive's "
                "own, otherwise hoist)."
            ),
        ),
    ] = None,
    physical: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            help=(
                "Physical value in place of the assumed one: oil_volume=1e-4 in SI units, "
                "oil_volume=100cm^3 with a unit; may be repeated."
            ),
        ),
    ] = None,
    out: TableFile = None,
    plot: FigureFile = None,
    sampling: Simulating,
    force: Force = False,
) -> None:
    """Check whether one state is enough for a drive and a command.

    Compares the drive with a model of five states, in which spool and swash
    plate have mass. Its physical values follow from the drive's parameters and
    from assumed values, which you can replace. Prints these values, the modes,
    and the difference in speed. Without a command, a table of maneuvers.
    """
    from swashplate import full_order as full

    if maneuver is None and plot is not None:
        raise InputError("--plot draws one run; name a maneuver or a log, such as step:9.")
    physical_values = parsing.physical_values(physical or ())
    with spinner("Completing the physical values"):
        marched = trials.at_rate(drive.loaded_drive, sampling.rate)
        axis = full.nearest_set(marched.name) if like is None else like
        full_drive = full.FullOrderDrive.from_drive(marched.plain, axis, **physical_values)
        tables = [full.choices_table(axis, physical_values), full_drive.modes().table()]
    with spinner("Simulating"):
        if maneuver is None:
            domain = full.validity(full_drive, sampling.rate)
            title = drive.title
            heading = f"{len(domain.rows)} maneuvers"
        else:
            name, run = trials.simulated_as(full_drive.drive, maneuver, sampling)
            comparison = full.compare(full_drive, run, start=sampling.start)
            domain = full.validity_table(full_drive.physical.name, [(name, comparison)])
            title = f"{drive.title}, {name}"
            heading = f"{comparison.time.size} samples at {sampling.rate:g} Hz"
    if maneuver is None:
        save(out, "Table", domain.write)
    else:
        save(out, "All signals, in SI", comparison.write)
        draw_figure(plot, "plot_full_order", comparison, title=f"{title}, five states versus one")
    drive.note(f"{title}, five states versus one: {heading}")
    if marched.parameters.refinements:
        listed = ", ".join(marched.parameters.refinements)
        note(f"Neither model has refinements; these are left out: {listed}.")
    show(*tables, domain)
    say(full.validity_verdict(domain))
