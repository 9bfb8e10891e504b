"""``swashplate crane``: geometry, runs, assessment of control, operability over a year."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swashplate.cli.commands import command
from swashplate.cli.crane_options import (
    AXES,
    AtSea,
    CraneArgument,
    Operated,
    Studied,
    WithLoad,
    crane_of,
    named_numbers,
    number_of,
    sea_sentences,
    variant_of,
)
from swashplate.cli.exports import ExportFiles
from swashplate.cli.machines import OwnMachine
from swashplate.cli.operating_points import answers_table, modes_table, outputs_named
from swashplate.cli.options import (
    LOG_FORMATS,
    NO_VALUE,
    DaskOption,
    FigureFile,
    TableFile,
    new_file,
)
from swashplate.cli.terminal import (
    check_writable,
    draw_figure,
    note,
    save,
    say,
    say_saved,
    show,
    side,
    spinner,
)
from swashplate.errors import InputError
from swashplate.tables import PAGE, UNIT, Column, Form, Table

if TYPE_CHECKING:
    from swashplate.crane import Assessment, Crane, Operability, Seaway, Sweep

LINEAR_OUTPUTS = ("off_lead", "side_lead", "rope", "body.slew", "boom")
"""Signals of the linear crane unless others are named."""
VERDICT = Form("a verdict", (".html", ".csv", ".parquet"))
OPERABILITY = Form("an operability", (".html", ".csv", ".parquet"))
LEAST_ALLOWED = 0.5
"""Percentage of seaways below which --allowed was probably given as a share."""

app = typer.Typer(rich_markup_mode="rich")
cranes = typer.Typer(
    help="Cranes on a ship: boom, rope and load, moved by three drives.",
    no_args_is_help=True,
    rich_markup_mode="rich",
)
app.add_typer(cranes, name="crane")


@command(
    cranes,
    "show",
    examples="""
        swashplate crane show tg3637
        swashplate crane show tg3637 --toml > mine.toml
    """,
)
def show_crane(
    crane: CraneArgument,
    *,
    toml: Annotated[
        bool,
        typer.Option(
            "--toml",
            metavar=NO_VALUE,
            help="Print the crane's file, as a template for another crane.",
        ),
    ] = False,
) -> None:
    """Show a crane's geometry and limits, their sources, and what is assumed."""
    if toml:
        from swashplate.crane import preset_text
        from swashplate.documents import read_text

        read = read_text if crane.endswith(".toml") else preset_text
        typer.echo(read(crane), nl=False)
        return
    loaded_crane = crane_of(crane)
    tables = [loaded_crane.table()]
    if loaded_crane.limits:
        tables.append(loaded_crane.limit_table())
    show(*tables)
    for axis in AXES:
        note(f"{axis}: {getattr(loaded_crane, axis).parameters.title}")
    for sentence in loaded_crane.provenance():
        say(sentence)


@command(
    cranes,
    "run",
    examples="""
        swashplate crane run tg3637 --slew 1 --until slew_deg=45
        swashplate crane run tg3637 --slew 1 --until slew_deg=45 --variant volts \\
            --variant inverse --variant inverse:zv-tip --plot slew.png
        swashplate crane run tg3637 --sea ss3 --seed 1 --at slew_deg=90 --at rope_m=27 \\
            --variant inverse --variant inverse:feedback=0.2+ship+clip
    """,
)
def run(
    operated: Operated,
    *,
    slew: Annotated[
        float, typer.Option(metavar="X", help="Joystick position of the slew, -1 to 1.")
    ] = 0.0,
    luff: Annotated[
        float, typer.Option(metavar="X", help="Joystick position of the luff, -1 to 1.")
    ] = 0.0,
    hoist: Annotated[
        float, typer.Option(metavar="X", help="Joystick position of the hoist, -1 to 1.")
    ] = 0.0,
    until: Annotated[
        list[str] | None,
        typer.Option(
            metavar="TARGET=VALUE",
            help="Target of an axis: slew_deg=45, boom_deg=53.5, rope_m=23; may be repeated.",
        ),
    ] = None,
    duration: Annotated[
        float | None,
        typer.Option(metavar="S", help="Duration of the motion of an axis without a target."),
    ] = None,
    length: Annotated[float, typer.Option(metavar="S", help="Duration of the run.")] = 60.0,
    seed: Annotated[
        int | None, typer.Option(metavar="N", help="Random seed of the seaway.")
    ] = None,
    variant: Annotated[
        list[str] | None,
        typer.Option(
            metavar="DRIVES[:CONTROL]",
            help=(
                "Command of the drives and, after a colon, control. Drives: inverse (the default, "
                "also called identified), volts or ideal. Control: zv-tip, zvd-tip, ei-tip, "
                "feedback=GAIN/DELAY, ship, clip=M, loop=GAIN, sensors=NOISE_DEG/DELAY/RATE "
                "(noise of the rope's angle, seconds, Hz), joined by +; or "
                "crew=DELAY/THRESHOLD_DEG/GAIN/SHARE, an operator who damps by hand (seconds, "
                "swing, 1/s, part of what slew and luff can follow). May be repeated."
            ),
        ),
    ] = None,
    brake: Annotated[
        bool,
        typer.Option("--brake/--no-brake", metavar=NO_VALUE, help="Brake the hoist at rest."),
    ] = True,
    out: TableFile = None,
    plot: FigureFile = None,
    scene: Annotated[Path | None, new_file(PAGE, "Write an animated scene: .html.")] = None,
) -> None:
    """Run a crane, once or with several variants of control and drives.

    Joystick positions are fractions of full speed: speeds, or with
    'volts', as on the crane, a voltage of 10 V at 1. The residual swing is the
    largest one within 25 s, counted from 4 s after the joystick has returned and
    the controller has ended its command.
    """
    runs = {}
    variants = variant or ["inverse"]
    if out is not None and len(variant or ()) > 1:
        raise InputError("--out writes one run's signals: use one --variant.")
    with spinner("Simulating"):
        from swashplate.crane import RATE, OperatorCommand, run_tables, simulate

        crane = operated.loaded_crane
        seaway = operated.seaway(seed=seed, length=length)
        targets = named_numbers("--until", until, "slew_deg=45")
        command = OperatorCommand.trapezoid(
            hoist=hoist, slew=slew, luff=luff, until=targets, duration=duration, length=length
        )
        ship = seaway or operated.motion(round(command.length * RATE) + 1)
        for variant_name in variants:
            options = operated.run_options | variant_of(variant_name)
            runs[variant_name] = simulate(crane, command, sea=ship, brake=brake, **options)
        tables = run_tables(runs)
    save(out, "All signals, in SI", runs[variants[-1]].write)
    draw_figure(plot, "plot_crane", runs)
    if scene is not None:
        from swashplate.report.scene import write_scene

        save(scene, "Scene", lambda path: write_scene(runs, path))
    sentences = list[str]()
    for name, simulated in runs.items():
        sentences += [f"{name}: {sentence}" for sentence in simulated.sentences()]
    damping = crane.swing_damping if operated.swing_damping is None else operated.swing_damping
    if seaway is not None and damping > 0.0:
        sentences.insert(0, _stationary_sentence(operated, seaway, damping))
    _print_result(crane, tables, [*sea_sentences(seaway), *sentences, *crane.provenance()])


@command(
    cranes,
    "assess",
    examples="""
        swashplate crane assess tg3637 --sea ss3
        swashplate crane assess tg3637 --control feedback=0.2/0.2+ship+clip --ask harm
        swashplate crane assess tg3637 --scale luff.orifice=3 --out assessment.html
        swashplate crane assess tg3637 --drive luff=fitted --drives identified,drawn
    """,
)
def assess(
    study: Studied,
    *,
    allowed: Annotated[
        float,
        typer.Option(
            metavar="PERCENT",
            help="Acceptable percentage of seaways in which control is worse than none.",
        ),
    ] = 5.0,
    ask: Annotated[
        str | None,
        typer.Option(
            metavar="QUESTIONS",
            help=(
                "Questions that the exit code answers: harm, sufficiency, or both, joined by a "
                "comma (default: both; harm alone if the crane has no limits)."
            ),
        ),
    ] = None,
    remedies: Annotated[
        bool,
        typer.Option(
            "--remedies/--no-remedies", metavar=NO_VALUE, help="Search for changes that suffice."
        ),
    ] = True,
    tipping_points: Annotated[
        bool,
        typer.Option(
            "--tipping-points/--no-tipping-points",
            metavar=NO_VALUE,
            help="Search for inputs, such as the ship's roll period, that would change the answer.",
        ),
    ] = True,
    dask: DaskOption = None,
    out: Annotated[
        Path | None,
        new_file(VERDICT, "Write the verdict as a page, .html, or its numbers, .csv or .parquet."),
    ] = None,
    plot: FigureFile = None,
) -> None:
    """Assess control over many seaways: does it harm, and is it sufficient?

    All variants go through the same seaways of ten minutes. Control harms if the
    swing is larger than without it in more than 5 % of them, based on the 95 %
    interval; "not decided" if the interval contains 5 %. Control is sufficient if
    all quantities that the crane's file limits, from the swing to the position of
    the load, stay within their limits in three hours. If not, a larger orifice
    and a clip are tried. The exit code is 0 only if each answer is favourable.
    """
    if 0.0 < allowed < LEAST_ALLOWED:
        raise InputError(
            f"--allowed is in percent, and {allowed:g} % of the seaways would need thousands of "
            f"them: did you mean --allowed {100.0 * allowed:g}?"
        )
    keywords: dict[str, Any] = {
        "allowed_share_worse": allowed / 100.0,
        "remedies": remedies,
        "tipping_points": tipping_points,
    }
    if ask is not None:
        keywords["questions"] = [question.strip() for question in ask.split(",")]
    if dask is not None:
        from swashplate.executors import Dask

        keywords["executor"] = Dask(dask)
    from swashplate.crane import assess as assess_control
    from swashplate.crane.studies import SEAWAYS, seaways_needed

    crane = study.loaded_crane
    side.print(seaways_needed(study.seeds or SEAWAYS, allowed / 100.0))
    assessment: Assessment = study.through(assess_control, crane, **keywords)
    content = "Numbers of every seaway, in SI"
    write = assessment.write
    if out is not None and out.suffix.lower() == ".html":
        from swashplate.report.scene import write_assessment

        content = "Verdict"
        write = partial(write_assessment, assessment)
    save(out, content, write)
    draw_figure(plot, "plot_assessment", assessment)
    _print_result(study.loaded_crane, assessment.tables(), assessment.sentences()[1:])
    say_saved()
    if not assessment.passed:
        side.print(assessment.headline)
        raise typer.Exit(1)
    say(assessment.headline)


@command(
    cranes,
    "operability",
    examples="""
        swashplate crane operability tg3637
        swashplate crane operability tg3637 site.csv --scale luff.orifice=3 --out year.html
        swashplate crane operability mine.toml site.csv --drive luff=fitted --ship ship.re1
    """,
)
def operability(
    study: Studied,
    scatter: Annotated[
        str | None,
        typer.Argument(
            metavar="FILE.csv",
            help="Scatter diagram: columns hs, tp and share (default: a fictitious one).",
        ),
    ] = None,
    *,
    headings: Annotated[
        str | None,
        typer.Option(
            metavar="NUMBERS",
            help=(
                "Wave headings in degrees, equally likely, joined by commas (default: "
                "0,45,...,315)."
            ),
        ),
    ] = None,
    out: Annotated[
        Path | None,
        new_file(
            OPERABILITY,
            "Write a page, .html, or the limiting quantity of each sea and heading, .csv or "
            ".parquet.",
        ),
    ] = None,
    plot: FigureFile = None,
) -> None:
    """Show the share of a year in which a crane can work, and its limits.

    A scatter diagram states how often each sea occurs. Each sea and heading is
    compared with the limits of the crane's file: in the frequency domain if that
    is accurate enough, by simulation near a limit. Height, period and heading of
    the waves come from the diagram; ship, peak factor and spreading from the
    options.
    """
    from swashplate.crane import Scatter
    from swashplate.crane import operability as operable

    diagram = Scatter.packaged() if scatter is None else Scatter.from_csv(scatter)
    if study.heading is not None:
        raise InputError("--heading belongs to one sea: for operability give --headings.")
    if study.sea:
        note("Only the peak factor and the spreading of --sea are used.")
    keywords: dict[str, Any] = {}
    if headings is not None:
        keywords["headings"] = [
            number_of(f"--headings {headings}", heading) for heading in headings.split(",")
        ]
    year: Operability = study.through(operable, study.loaded_crane, scatter=diagram, **keywords)
    content = "Cells of the year, in SI"
    write = year.write
    if out is not None and out.suffix.lower() == ".html":
        from swashplate.report.scene import write_operability

        content = "Operability"
        write = partial(write_operability, year)
    save(out, content, write)
    draw_figure(plot, "plot_operability", year)
    crane = study.loaded_crane
    _print_result(crane, year.tables(), [*year.sentences(), *crane.provenance()])


@command(
    cranes,
    "follow",
    examples="""
        swashplate crane follow tg3637 --plot follow.png
        swashplate crane follow tg3637 --sea ss3 --at boom_deg=60
        swashplate crane follow tg3637 --sea 1.5,8 --roll-period 16
    """,
)
def follow(at_sea: AtSea, *, out: TableFile = None, plot: FigureFile = None) -> None:
    """Show the largest sines of the tip that each axis can follow in a sea.

    These are compared with the motion that the sea demands: all packaged seas, or
    that of --sea.
    """
    with spinner("Simulating"):
        from swashplate.crane import follow as largest_sines

        seaway = at_sea.seaway(default="ss3")
        keywords: dict[str, Any] = {}
        if at_sea.sea and seaway is not None:
            keywords["seas"] = (seaway.sea,)
        followable = largest_sines(at_sea.loaded_crane, seaway=seaway, **keywords, **at_sea.pose)
    save(out, "Amplitudes, in SI", followable.tables()[0].write)
    draw_figure(plot, "plot_follow", followable)
    about_sea = sea_sentences(seaway) if at_sea.sea else ()
    crane = at_sea.loaded_crane
    _print_result(crane, followable.tables(), [*about_sea, *crane.provenance()])


@command(
    cranes,
    "sweep",
    examples="""
        swashplate crane sweep tg3637 bearing --points 0,45,90,135,180 --plot sectors.png
        swashplate crane sweep tg3637 orifice --points 1,1.5,2,3 --plot orifice.png
    """,
)
def sweep(
    study: Studied,
    over: Annotated[
        str, typer.Argument(metavar="bearing|height|orifice", help="Quantity to sweep.")
    ],
    *,
    points: Annotated[
        str | None,
        typer.Option(metavar="NUMBERS", help="Points of the sweep, joined by commas."),
    ] = None,
    out: TableFile = None,
    plot: FigureFile = None,
) -> None:
    """Show the swing over a quantity, without control and with it.

    bearing: of the boom, in degrees from the bow to starboard.
    height: significant height of the waves in m, with the period of --sea.
    orifice: factors on the luff drive's in-line orifice.
    Each point is simulated in 6 seaways of 10 min.
    """
    keywords: dict[str, Any] = {}
    if points is not None:
        keywords["points"] = [number_of(f"--points {points}", word) for word in points.split(",")]
    from swashplate.crane import sweep as swing_over

    swept: Sweep = study.through(swing_over, study.loaded_crane, over, **keywords)
    save(out, "Swing, in SI", swept.tables()[0].write)
    draw_figure(plot, "plot_sweep", swept)
    sentences = [*sea_sentences(study.waters), *study.loaded_crane.provenance()]
    _print_result(study.loaded_crane, swept.tables(), sentences)


@command(
    cranes,
    "damping",
    examples="""
        swashplate crane damping swing.csv --start 12 --stop 90 --rope 20
        swashplate crane damping swing.csv --column swing --across sway --rope 20
    """,
    units=False,
)
def damping(
    log: Annotated[str, typer.Argument(metavar="LOG", help=f"Log: {LOG_FORMATS}.")],
    *,
    column: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="Column of the angle, with its unit in the header: 'off_lead \\[deg]'.",
        ),
    ] = "off_lead",
    across: Annotated[
        str, typer.Option(metavar="NAME", help="Column of the angle across.")
    ] = "side_lead",
    time_column: Annotated[
        str, typer.Option(metavar="NAME", help="Column of the time in LOG.")
    ] = "time",
    start: Annotated[
        float | None, typer.Option(metavar="S", help="Start of the free swing in the log.")
    ] = None,
    stop: Annotated[
        float | None, typer.Option(metavar="S", help="End of the free swing in the log.")
    ] = None,
    rope: Annotated[
        float | None,
        typer.Option(metavar="M", help="Length of the rope, to check the period."),
    ] = None,
    drag: Annotated[
        float | None,
        typer.Option(
            metavar="K",
            help="Resistance with the square of the speed in 1/m, if it is known; 0 for none.",
        ),
    ] = None,
) -> None:
    """Estimate the damping ratio of a freely swinging load from a log of its angles.

    The load of a crane at rest is fitted to signed angles in two planes, over at
    least five swings. A log that does not show the damping is refused.
    """
    import numpy as np

    from swashplate.crane import swing_damping
    from swashplate.logs import read_series

    series = read_series(log, column, "rad", time_column=time_column)
    first = float(series.time[0])
    last = float(series.time[-1])
    begins = first if start is None else start
    ends = last if stop is None else stop
    if not first <= begins < ends <= last:
        raise InputError(
            f"{log} lasts from {first:g} to {last:g} s, but {begins:g} to {ends:g} s are requested."
        )
    within = (begins <= series.time) & (series.time <= ends)
    other = read_series(log, across, "rad", time_column=time_column)
    if not np.array_equal(other.time, series.time):
        raise InputError(
            f"{log}: columns {column} and {across} have values at different times, but must "
            "have them at the same."
        )
    angles = series.values[within], other.values[within]
    try:
        free_swing = swing_damping(series.time[within], *angles, rope=rope, drag=drag)
    except InputError as error:
        raise InputError(f"{log}, {column}: {error}") from None
    columns = [Column(name, ".5g", none="-") for name in ("estimate", "lower", "upper")]
    table = Table("Free swing, 95 % intervals", (Column("number"), *columns, UNIT))
    rows = (
        ("damping ratio", free_swing.damping, "%", 100.0),
        ("drag", free_swing.drag, "1/m", 1.0),
        ("rope", free_swing.rope, "m", 1.0),
    )
    for name, number, unit, factor in rows:
        interval = [None if end is None else factor * end for end in number.interval]
        value = 0.0 if number.status == "at its lower bound" else number.value
        table.add(name, factor * value, *interval, unit=unit)
    show(table)
    for sentence in free_swing.sentences():
        say(sentence)


@command(
    cranes,
    "export",
    examples="""
        swashplate crane export tg3637 --fmu crane.fmu
        swashplate crane export tg3637 --at rope_m=27 --c crane --compile
        swashplate crane export tg3637 --variant inverse:feedback=0.2+clip --fmu damped.fmu
        swashplate crane export mine.toml --drive luff=fitted --fmu crane.fmu --platforms linux64
    """,
    units=False,
)
def export_crane(
    hanging: WithLoad,
    files: ExportFiles,
    *,
    variant: Annotated[
        str | None,
        typer.Option(
            metavar="DRIVES[:CONTROL]",
            help=(
                "Export the crane in closed loop, from the stick on: command of the drives and, "
                "after a colon, control, as in 'swashplate crane run' (default: the drives' "
                "voltages are inputs, and there is no controller)."
            ),
        ),
    ] = None,
    brake: Annotated[
        bool,
        typer.Option("--brake/--no-brake", metavar=NO_VALUE, help="Brake the hoist at rest."),
    ] = True,
) -> None:
    """Export a crane with its drives as FMU, C source or WebAssembly.

    Inputs are the voltages of the three drives and the ship's motion: surge,
    sway, heave in m, roll, pitch, yaw in rad. With --variant they are the stick's
    positions, -1 to 1, in place of the voltages, and with sensors their noise.
    Outputs are the signals of the drives, and tip, load, hook, rope, swing and
    tension, and with --variant those of control. It is compiled when it is
    exported.
    """
    files.check(force=hanging.force)
    with spinner("Exporting"):
        from swashplate.crane import RATE, controlled, plant

        crane = hanging.loaded_crane
        options = hanging.run_options | {"brake": brake}
        if variant is None:
            machine = plant(crane, **options)
        else:
            machine = controlled(crane, **options | variant_of(variant))
    files.write(machine, 1.0 / RATE)
    for sentence in crane.provenance():
        say(sentence)


@command(
    cranes,
    "linearize",
    examples="""
        swashplate crane linearize tg3637 --at rope_m=27
        swashplate crane linearize tg3637 --voltage luff=4 --output off_lead --out crane.toml
        swashplate crane linearize tg3637 --suspension hook=2000 --suspension sling=6
    """,
)
def linearize_crane(
    hanging: WithLoad,
    *,
    voltage: Annotated[
        list[str] | None,
        typer.Option(
            metavar="AXIS=V",
            help="Constant voltage of a drive (default: 0, in its dead zone); may be repeated.",
        ),
    ] = None,
    input: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help=(
                "Input of the model, such as luff.voltage or roll (default: the three voltages); "
                "may be repeated."
            ),
        ),
    ] = None,
    output: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help=(
                "Signal of drives or crane (default: off_lead, side_lead, rope, slew and boom); "
                "may be repeated."
            ),
        ),
    ] = None,
    frequency: Annotated[
        float, typer.Option(metavar="HZ", help="Frequency at which gain and phase are printed.")
    ] = 0.1,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the model in SI units: .toml or .json."),
    ] = None,
) -> None:
    """Linearise a crane with its drives, and show its modes and gains.

    The load hangs at rest below the tip, and the drives run at constant voltages,
    without the brake. Modes are those of the drives, whose lags follow from the
    voltages, and of the load: along the boom and across it. The model is in steps
    of 1/512 s and exact for small motions.
    """
    from swashplate.machine.linear import LINEAR_MODEL

    check_writable(out, LINEAR_MODEL, force=hanging.force)
    with spinner("Linearising"):
        from swashplate.crane import RATE, plant
        from swashplate.machine import linearize

        crane = hanging.loaded_crane
        machine = plant(crane, brake=False, **hanging.run_options)
        own = OwnMachine(machine, crane.title or crane.name)
        at = dict.fromkeys(own.needed, 0.0)
        for axis, volts in named_numbers("--voltage", voltage, "luff=4", AXES).items():
            at[f"{axis}.voltage"] = volts
        inputs = input or [f"{axis}.voltage" for axis in AXES]
        model = linearize(
            machine,
            at,
            RATE,
            inputs=[own.input_named(name) for name in inputs],
            outputs=outputs_named(own, output or LINEAR_OUTPUTS),
        )
        tables = [modes_table(model, (*AXES, "body")), answers_table(own, model, frequency)]
    save(out, "Model, in SI", model.write)
    answered = {row.cells[0] for row in tables[1].rows}
    still = [name for name in model.inputs if name not in answered]
    none = f"No output answers {', '.join(still)}: a drive in its dead zone does not move."
    sentences = [*([none] if still else []), *crane.provenance()]
    _print_result(crane, [table for table in tables if table.rows], sentences)


def _print_result(crane: Crane, tables: Iterable[Table], sentences: Iterable[str]) -> None:
    """Print title, tables and sentences."""
    note(crane.title)
    show(*tables)
    for sentence in sentences:
        say(sentence)


def _stationary_sentence(operated: Operated, seaway: Seaway, damping: float) -> str:
    """The swing without control that this sea has in the long run, by its spectrum."""
    from math import degrees

    from swashplate.crane import linear_response

    options = operated.run_options
    names = ("slew_deg", "boom_deg", "rope_m", "swing_damping", "load", "suspension")
    start = {"slew_deg": 0.0, "boom_deg": 45.0, "rope_m": 20.0}
    hung = start | {name: options[name] for name in names if name in options}
    response = linear_response(operated.loaded_crane, seaway, **hung)
    return (
        f"Without control the long-run swing is {degrees(response.values['swing'].rms):.2f} deg "
        f"RMS, from the sea's spectrum and a damping of {100.0 * damping:g} %; a run begins at "
        "rest."
    )
