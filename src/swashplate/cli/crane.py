"""``swashplate crane``: geometry, runs, judgment of control, operability over a year."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swashplate.cli.crane_options import (
    AXES,
    AtSea,
    Operated,
    Studied,
    control_of,
    crane_of,
    number_of,
    numbers_of,
    sea_sentences,
)
from swashplate.cli.options import FigureFile, TableFile, command
from swashplate.cli.terminal import draw, note, save, say, say_saved, show, side, working
from swashplate.errors import InputError
from swashplate.tables import PAGE, Column, Form, Table

if TYPE_CHECKING:
    from swashplate.crane import Crane, Judgment, Operability, Seaway, Sweep

VERDICT = Form("a verdict", (".html", ".csv", ".parquet"))
OPERABILITY = Form("an operability", (".html", ".csv", ".parquet"))
LEAST_ALLOWED = 0.5
"""Percent of seaways below which a share is probably meant."""

app = typer.Typer(
    help="Whole cranes: boom, rope and load behind three drives, on a ship.",
    no_args_is_help=True,
    rich_markup_mode="rich",
)


def show_crane(crane: str, *, toml: bool = False) -> None:
    """Show a crane's geometry and limits: which are assumed, and where they come from.

    Options:
      crane CRANE|FILE.toml: A packaged crane, tg3637, or your own.
      toml: Print the file, to begin your own from.

    For example:
      swashplate crane show tg3637
      swashplate crane show tg3637 --toml > mine.toml
    """
    if toml:
        from swashplate.crane.crane import preset_text
        from swashplate.documents import read_text

        read = read_text if crane.endswith(".toml") else preset_text
        typer.echo(read(crane), nl=False)
        return
    chosen = crane_of(crane)
    show(chosen.table(), *([chosen.limit_table()] if chosen.limits else []))
    for axis in AXES:
        note(f"{axis}: {getattr(chosen, axis).parameters.title}")
    for sentence in chosen.provenance():
        say(sentence)


def run(
    operated: Operated,
    *,
    slew: float = 0.0,
    luff: float = 0.0,
    hoist: float = 0.0,
    until: list[str] | None = None,
    duration: float | None = None,
    length: float = 60.0,
    seed: int | None = None,
    variant: list[str] | None = None,
    brake: bool = True,
    out: TableFile = None,
    plot: FigureFile = None,
    scene: Annotated[Path | None, PAGE] = None,
) -> None:
    r"""Run a crane, once or with several variants of control and drives.

    The stick's commands are parts of the full speeds. Without a controller they
    are wanted speeds; with 'volts', as on the crane, 10 V for 1. The residual
    swing is the largest one for 25 s, from 4 s after the stick has returned and
    the controller has ended its command.

    Options:
      slew: Stick of the slew, -1 to 1.
      luff: Stick of the luff, -1 to 1.
      hoist: Stick of the hoist, -1 to 1.
      until TARGET=VALUE: Where an axis is led to: slew_deg=45, boom_deg=53.5, rope_m=23. May be
          repeated.
      duration S: Time for which an axis without target moves.
      length S: Length of the run.
      seed N: Random seed of the seaway.
      variant DRIVES[:CONTROL]: Drives behind the stick and, after a colon, control: inverse (the
          default, also called identified), volts or ideal; zv-tip, zvd-tip, ei-tip,
          feedback=GAIN/DELAY, ship, clip=M, loop=GAIN, sensors=NOISE_DEG/DELAY/RATE (noise of the
          rope's angle, seconds, Hz), joined by +. May be repeated.
      brake --brake/--no-brake: Whether a brake holds the hoist at rest.
      scene FILE: Write the scene that moves: .html.

    For example:
      swashplate crane run tg3637 --slew 1 --until slew_deg=45
      swashplate crane run tg3637 --slew 1 --until slew_deg=45 --variant volts \
          --variant inverse --variant inverse:zv-tip --plot slew.png
      swashplate crane run tg3637 --sea ss3 --seed 1 --at slew_deg=90 --at rope_m=27 \
          --variant inverse --variant inverse:feedback=0.2+ship+clip
    """
    runs, first = {}, ""
    if out is not None and len(variant or ()) > 1:
        raise InputError("--out writes one run's signals: take one --variant.")
    with working("Simulating"):
        from swashplate.crane import Stick, run_tables, simulate
        from swashplate.crane.axes import RATE

        crane, seaway = operated.chosen, operated.seaway(seed=seed, length=length)
        targets = numbers_of("--until", until, "slew_deg=45")
        stick = Stick.trapezoid(
            hoist=hoist, slew=slew, luff=luff, until=targets, duration=duration, length=length
        )
        ship = seaway or operated.motion(round(stick.length * RATE) + 1)
        for first in variant or ["inverse"]:
            drives, _, law = first.partition(":")
            how: dict[str, Any] = {"control": control_of(law)}
            how["actuation"] = "inverse" if drives == "identified" else drives
            runs[first] = simulate(crane, stick, sea=ship, brake=brake, **how, **operated.setup)
        tables = run_tables(runs)
    save(out, "All signals, in SI", runs[first].write)
    draw(plot, "plot_crane", runs)
    if scene is not None:
        from swashplate.report.scene import write_scene

        save(scene, "Scene", lambda path: write_scene(runs, path))
    sentences = [f"{name}: {words}" for name, run in runs.items() for words in run.sentences()]
    damping = crane.swing_damping if operated.swing_damping is None else operated.swing_damping
    if seaway is not None and damping > 0.0:
        sentences.insert(0, _stationary_words(operated, seaway, damping))
    _end(crane, tables, *sea_sentences(seaway), *sentences, *crane.provenance())


def judge(
    study: Studied,
    *,
    allowed: float = 5.0,
    ask: str | None = None,
    remedies: bool = True,
    turns: bool = True,
    dask: str | None = None,
    out: Annotated[Path | None, VERDICT] = None,
    plot: FigureFile = None,
) -> None:
    """Judge control on a crane's drives over many seaways: does it harm, does it suffice?

    Every variant goes through the same seaways of ten minutes. Control harms if
    the swing is larger than without it in more than 5 % of them, as far as the
    95 % interval of that share tells. It suffices if in three hours all that the
    crane's file limits, from swing to the place of the load, stays within its
    limits. If it fails, a larger orifice and a clip are tried. The exit code is
    0 only if every question asked is answered with yes.

    Options:
      allowed PERCENT: Seaways in which control may be worse than none, in percent.
      ask QUESTIONS: What the exit code answers: harm, sufficiency, or both, joined by a comma; by
          default both, harm alone if the crane has no limits.
      remedies --remedies/--no-remedies: Whether to look for what would do.
      turns --turns/--no-turns: Whether to look for numbers, as the ship's roll period, that would
          turn the answer.
      dask ADDRESS: Run on a Dask cluster: tcp://HOST:PORT.
      out FILE: Write the verdict's page, .html, or its numbers, .csv or .parquet.

    For example:
      swashplate crane judge tg3637 --sea ss3
      swashplate crane judge tg3637 --control feedback=0.2/0.2+ship+clip --ask harm
      swashplate crane judge tg3637 --scale luff.orifice=3 --out judge.html
      swashplate crane judge tg3637 --drive luff=fitted --drives identified,drawn
    """
    if 0.0 < allowed < LEAST_ALLOWED:
        raise InputError(
            f"--allowed is in percent, and {allowed:g} % of the seaways would ask for thousands of "
            f"them: did you mean --allowed {100.0 * allowed:g}?"
        )
    more: dict[str, Any] = {"allowed": allowed / 100.0, "remedies": remedies, "turns": turns}
    if ask is not None:
        more["asked"] = [question.strip() for question in ask.split(",")]
    if dask is not None:
        from swashplate.executors import Dask

        more["executor"] = Dask(dask)
    from swashplate.crane import judge as judge_control
    from swashplate.crane.studies.judging import SEAWAYS, seaways_needed

    crane = study.chosen
    side.print(seaways_needed(study.seeds or SEAWAYS, allowed / 100.0))
    found: Judgment = study.through(judge_control, crane, **more)
    what, write = "Numbers of every seaway, in SI", found.write
    if out is not None and out.suffix.lower() == ".html":
        from swashplate.report.scene import write_judgment

        what, write = "Verdict", partial(write_judgment, found)
    save(out, what, write)
    draw(plot, "plot_judgment", found)
    _end(study.chosen, found.tables(), *found.sentences()[1:])
    say_saved()
    if not found.passed:
        side.print(found.headline)
        raise typer.Exit(1)
    say(found.headline)


def operability(
    study: Studied,
    scatter: str | None = None,
    *,
    headings: str | None = None,
    out: Annotated[Path | None, OPERABILITY] = None,
    plot: FigureFile = None,
) -> None:
    """Show the share of a year that a crane can work, and what limits it in each sea.

    A scatter diagram says how often each sea comes. Each sea and heading is held
    against the limits of the crane's file: in the frequency domain where that is
    enough, by simulation near a limit. The sea's height, period and heading come
    from the diagram; ship, peak factor and spreading from the options.

    Options:
      scatter FILE.csv: Columns hs, tp and share; without it a made-up diagram, of no place.
      headings NUMBERS: Headings of the waves in degrees, as likely as each other, joined by
          commas; by default 0,45,...,315.
      out FILE: Write the page, .html, or what limits each sea and heading, .csv or .parquet.

    For example:
      swashplate crane operability tg3637
      swashplate crane operability tg3637 site.csv --scale luff.orifice=3 --out year.html
      swashplate crane operability mine.toml site.csv --drive luff=fitted --ship ship.re1
    """
    from swashplate.crane import Scatter
    from swashplate.crane import operability as operable

    diagram = Scatter.packaged() if scatter is None else Scatter.from_csv(scatter)
    if study.heading is not None:
        raise InputError("--heading is of one sea: operability goes over --headings.")
    if study.sea:
        note("Of --sea the peak factor and the spreading count.")
    more: dict[str, Any] = {}
    if headings is not None:
        words = headings.split(",")
        more["headings"] = [number_of(f"--headings {headings}", word) for word in words]
    found: Operability = study.through(operable, study.chosen, scatter=diagram, **more)
    what, write = "Cells of the year, in SI", found.write
    if out is not None and out.suffix.lower() == ".html":
        from swashplate.report.scene import write_operability

        what, write = "Operability", partial(write_operability, found)
    save(out, what, write)
    draw(plot, "plot_operability", found)
    _end(study.chosen, found.tables(), *found.sentences(), *study.chosen.provenance())


def follow(at_sea: AtSea, *, out: TableFile = None, plot: FigureFile = None) -> None:
    """Show the largest sines of the tip that each axis can follow, and what seas ask for.

    By default of all packaged seas; with --sea only of that.

    For example:
      swashplate crane follow tg3637 --plot follow.png
      swashplate crane follow tg3637 --sea ss3 --at boom_deg=60
      swashplate crane follow tg3637 --sea 1.5,8 --roll-period 16
    """
    with working("Simulating"):
        from swashplate.crane import follow as largest_sines

        seaway = at_sea.seaway(default="ss3")
        more: dict[str, Any] = {}
        if at_sea.sea and seaway is not None:
            more["seas"] = (seaway.sea,)
        found = largest_sines(at_sea.chosen, seaway=seaway, **more, **at_sea.pose)
    save(out, "Amplitudes, in SI", found.tables()[0].write)
    draw(plot, "plot_follow", found)
    about_sea = sea_sentences(seaway) if at_sea.sea else ()
    _end(at_sea.chosen, found.tables(), *about_sea, *at_sea.chosen.provenance())


def sweep(
    study: Studied,
    over: str,
    *,
    points: str | None = None,
    out: TableFile = None,
    plot: FigureFile = None,
) -> None:
    """Show the swing over a quantity, without control and with it.

    bearing: of the boom, in degrees from the bow to starboard.
    height: significant height of the waves in m, with the period of --sea.
    orifice: factors on the luff drive's in-line orifice.
    Each point is simulated in 6 seaways of 10 min.

    Options:
      over bearing|height|orifice: The quantity.
      points NUMBERS: Points of the sweep, joined by commas.

    For example:
      swashplate crane sweep tg3637 bearing --points 0,45,90,135,180 --plot sectors.png
      swashplate crane sweep tg3637 orifice --points 1,1.5,2,3 --plot orifice.png
    """
    more: dict[str, Any] = {}
    if points is not None:
        more["points"] = [number_of(f"--points {points}", each) for each in points.split(",")]
    from swashplate.crane import sweep as swing_over

    found: Sweep = study.through(swing_over, study.chosen, over, **more)
    save(out, "Swing, in SI", found.tables()[0].write)
    draw(plot, "plot_sweep", found)
    _end(study.chosen, found.tables(), *sea_sentences(study.waters), *study.chosen.provenance())


def damping(
    log: str,
    *,
    column: str = "swing",
    time_column: str = "time",
    start: float | None = None,
    stop: float | None = None,
    rope: float | None = None,
) -> None:
    r"""Find the damping ratio of a load that swings freely, from a log of its angle.

    A decaying sine is fitted to the signed angle in one plane, with the crane at
    rest and at least five swings.

    Options:
      log LOG: The log: text such as .csv, .parquet, .mat, .h5, .tdms or .mf4.
      column NAME: Column of the angle; its unit stands in the header, 'swing \[deg]'.
      time_column NAME: Column of the time in LOG.
      start S: Time of the log from which on it swings freely.
      stop S: Time of the log up to which it does.
      rope M: Length of the rope, by which the period is checked.

    For example:
      swashplate crane damping swing.csv --column swing --start 12 --stop 90 --rope 20
    """
    from swashplate.crane import swing_damping
    from swashplate.logs import read_series

    series = read_series(log, column, "rad", time_column=time_column)
    first, last = float(series.time[0]), float(series.time[-1])
    begins = first if start is None else start
    ends = last if stop is None else stop
    if not first <= begins < ends <= last:
        raise InputError(
            f"{log} lasts from {first:g} to {last:g} s, but {begins:g} to {ends:g} s are asked for."
        )
    within = (begins <= series.time) & (series.time <= ends)
    try:
        found = swing_damping(series.time[within], series.values[within], rope=rope)
    except InputError as error:
        raise InputError(f"{log}, {column}: {error}") from None
    ratio = Column("damping ratio", ".3%")
    interval = [Column(name, ".3%") for name in ("from", "to")]
    table = Table("Free swing, 95 % interval", (ratio, *interval, Column("period", ".2f", "s")))
    table.add(*found)
    show(table)


def _end(crane: Crane, tables: Iterable[Table], *said: str) -> None:
    """Print title, tables and sentences."""
    note(crane.title)
    show(*tables)
    for sentence in said:
        say(sentence)


def _stationary_words(operated: Operated, seaway: Seaway, damping: float) -> str:
    """The swing without control that this sea has in the long run, by its spectrum."""
    from math import degrees

    from swashplate.crane import linear_response

    setup = operated.setup
    names = ("slew_deg", "boom_deg", "rope_m", "swing_damping", "load", "suspension")
    start = {"slew_deg": 0.0, "boom_deg": 45.0, "rope_m": 20.0}
    hung = start | {name: setup[name] for name in names if name in setup}
    found = linear_response(operated.chosen, seaway, **hung)
    return (
        f"Without control the load swings by {degrees(found.values['swing'].rms):.2f} deg RMS in "
        f"the long run, by the sea's spectrum and a damping of {100.0 * damping:g} %; a run begins "
        "at rest."
    )


command(app, "show")(show_crane)
command(app, "run")(run)
command(app, "judge")(judge)
command(app, "operability")(operability)
command(app, "follow")(follow)
command(app, "sweep")(sweep)
command(app, "damping")(damping)
