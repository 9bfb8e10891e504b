"""``swashplate crane``: geometry, runs, and the judgment of control over many seaways."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swashplate.cli.options import FigureFile, TableFile, argument, command, option
from swashplate.cli.terminal import Outputs, long_work, note, say, show, side, working
from swashplate.cli.words import drive_of, pairs_of
from swashplate.errors import InputError
from swashplate.tables import FIGURE, TABLE, Form

if TYPE_CHECKING:
    from swashplate.crane import Crane, CraneRun, Judgment, Seaway
    from swashplate.crane.control import Control
    from swashplate.executors import Executor

SHOW_EXAMPLES = """\
Examples:
  swashplate crane show tg3637
  swashplate crane show tg3637 --toml > mine.toml
"""
RUN_EXAMPLES = """\
Examples:
  swashplate crane run tg3637 --slew 1 --until slew_deg=45
  swashplate crane run tg3637 --slew 1 --until slew_deg=45 --variant volts:zv-joint \\
      --variant inverse:zv-joint --variant inverse:zv-tip --plot slew.png
  swashplate crane run tg3637 --sea ss3,90,1 --at slew_deg=90 --at rope_m=27 \\
      --variant inverse --variant inverse:feedback=0.2+ship+clip
"""
JUDGE_EXAMPLES = """\
Examples:
  swashplate crane judge tg3637 --sea ss3 --seeds 50
  swashplate crane judge tg3637 --drives ideal,identified --scale luff.orifice=3 --out judge.html
  swashplate crane judge tg3637 --drive luff=fitted --drives identified,drawn
"""
FOLLOW_EXAMPLES = """\
Examples:
  swashplate crane follow tg3637 --plot follow.png
  swashplate crane follow tg3637 --sea ss3 --at boom_deg=60
"""
SECTORS_EXAMPLES = """\
Examples:
  swashplate crane sectors tg3637 --sea ss3 --plot sectors.png
"""
PAGE = Form("a page", (".html",))
MEANT = "feedback=0.2/0.2+ship+loop=1.5"
"""The controller that is judged by default, as it is designed for ideal drives."""
VARIANTS = """\
Drives behind the stick and, after a colon, control: inverse, volts or ideal; zv-joint, zvd-tip,
ei-tip and the like, feedback=GAIN/DELAY, ship, clip=M, loop=GAIN, joined by +. May be repeated.\
"""
START = {"slew_deg": 0.0, "boom_deg": 45.0, "rope_m": 20.0}

app = typer.Typer(
    help="Whole cranes: boom, rope and load behind three drives, on a ship.",
    no_args_is_help=True,
    rich_markup_mode="rich",
)

HELD = {"slew_deg": 90.0, "boom_deg": 45.0, "rope_m": 27.0}
"""Where a load is kept while seaways pass."""
CraneWord = Annotated[str, argument("CRANE|FILE.toml", "A packaged crane, tg3637, or your own.")]


SeaWord = Annotated[
    str,
    option("A sea and its heading, 90 abeam: ss2, ss3, ss3-swell, ss4.", metavar="SEA[,HEADING]"),
]
ShipFile = Annotated[
    Path | None,
    option("The ship's transfer functions: .re1 of VERES, or .csv.", metavar="FILE"),
]
ControlWord = Annotated[str, option("Control, as of 'run' behind the colon.", metavar="CONTROL")]
DriveWords = Annotated[
    list[str] | None,
    option(
        "Another drive: luff=mine.toml, or the folder of a fit. May be repeated.",
        metavar="AXIS=SET",
    ),
]
HeldAt = Annotated[
    list[str] | None,
    option("Where the load is kept: slew_deg=90, boom_deg=45, rope_m=27.", metavar="NAME=VALUE"),
]
Seeds = Annotated[int, option("Number of seaways.", min=1)]


def show_crane(
    crane: CraneWord,
    toml: Annotated[bool, option("Print the file, to begin your own from.", "--toml")] = False,
) -> None:
    """Show a crane's geometry: values, which are assumed, and where they come from."""
    if toml:
        from swashplate.crane.crane import preset_text
        from swashplate.documents import read_text

        own = crane.endswith(".toml")
        typer.echo(read_text(crane) if own else preset_text(crane), nl=False)
        return
    chosen = _crane(crane, ())
    show(chosen.table())
    for axis in ("hoist", "slew", "luff"):
        note(f"{axis}: {getattr(chosen, axis).parameters.title}")


def run(
    crane: CraneWord,
    slew: Annotated[float, option("Stick of the slew, -1 to 1.")] = 0.0,
    luff: Annotated[float, option("Stick of the luff, -1 to 1.")] = 0.0,
    hoist: Annotated[float, option("Stick of the hoist, -1 to 1.")] = 0.0,
    until: Annotated[
        list[str] | None,
        option(
            "Where an axis is led to: slew_deg=45, boom_deg=53.5, rope_m=23. May be repeated.",
            metavar="TARGET=VALUE",
        ),
    ] = None,
    duration: Annotated[
        float | None, option("Time for which an axis without target moves.", metavar="S")
    ] = None,
    length: Annotated[float, option("Length of the run.", metavar="S")] = 60.0,
    at: Annotated[
        list[str] | None,
        option("Where it begins: slew_deg=0, boom_deg=45, rope_m=20.", metavar="NAME=VALUE"),
    ] = None,
    sea: Annotated[
        str | None,
        option(
            "A seaway, its heading in degrees (90 abeam) and its seed: ss2, ss3, ss3-swell, ss4.",
            metavar="SEA[,HEADING[,SEED]]",
        ),
    ] = None,
    ship: ShipFile = None,
    variant: Annotated[
        list[str] | None,
        option(VARIANTS, metavar="DRIVES[:CONTROL]", show_default="inverse"),
    ] = None,
    drive: DriveWords = None,
    brake: Annotated[
        bool, option("Whether a brake holds the hoist at rest.", "--brake/--no-brake")
    ] = True,
    out: TableFile = None,
    plot: FigureFile = None,
    scene: Annotated[
        Path | None, option("Write the scene that moves: .html.", metavar="FILE")
    ] = None,
) -> None:
    """Run a crane, once or with several variants of control and drives.

    The stick's commands are parts of the full speeds. Without a controller they
    are wanted speeds; with 'volts', as on the crane, 10 V for 1. The residual
    swing is the largest one for 25 s, from 4 s after the stick has returned and
    the controller has ended its command.
    """
    files = Outputs((out, TABLE), (plot, FIGURE), (scene, PAGE))
    with working("Simulating"):
        from swashplate.crane import Stick, limit_table, run_table

        chosen = _crane(crane, drive or ())
        targets = _numbers("--until", until, "slew_deg=45")
        begin = _pose(START, at)
        stick = Stick.trapezoid(
            hoist=hoist, slew=slew, luff=luff, until=targets, duration=duration, length=length
        )
        seaway = _seaway(sea, ship)
        runs: dict[str, CraneRun] = {}
        for word in variant or ["inverse"]:
            actuation, _, law = word.partition(":")
            how: dict[str, Any] = {"actuation": actuation, "control": control_of(law), **begin}
            runs[word] = chosen.simulate(stick, sea=seaway, brake=brake, **how)
        table = run_table(runs)
    if out is not None and len(runs) > 1:
        raise InputError(f"--out writes one run's signals, but there are {len(runs)} variants.")
    files.write(out, "All signals, in SI", lambda path: _write(runs, path))
    files.draw(plot, "plot_crane", runs)
    files.write(scene, "Scene", lambda path: _write_scene(runs, path))
    note(chosen.title)
    show(table, limit_table(runs))
    files.say()


def judge(
    crane: CraneWord,
    control: ControlWord = MEANT,
    sea: SeaWord = "ss3,90",
    ship: ShipFile = None,
    seeds: Seeds = 200,
    drives: Annotated[
        str,
        option(
            "ideal: follow at once; identified: the crane's own; drawn: from the errors of the "
            "fits given with --drive. The verdict is on the last.",
            metavar="NAMES",
        ),
    ] = "ideal,identified",
    drive: DriveWords = None,
    scale: Annotated[
        list[str] | None,
        option(
            "Drives with a lever or parameter moved, judged last: luff.orifice=1.5. May be "
            "repeated.",
            metavar="AXIS.NAME=FACTOR",
        ),
    ] = None,
    at: HeldAt = None,
    allowed: Annotated[
        float, option("Seaways in which control may be worse than none, in %.", metavar="%")
    ] = 5.0,
    remedies: Annotated[
        bool, option("Whether to look for what would do.", "--remedies/--no-remedies")
    ] = True,
    dask: Annotated[
        str | None, option("Run on a Dask cluster: tcp://HOST:PORT.", metavar="ADDRESS")
    ] = None,
    out: Annotated[
        Path | None,
        option(
            "Write the verdict's page, .html, or its numbers, .csv or .parquet.", metavar="FILE"
        ),
    ] = None,
    plot: FigureFile = None,
) -> None:
    """Judge control on a crane's drives over many seaways.

    Every variant goes through the same seaways. Control fails if it makes the
    swing worse than none in more than 5 % of them; the exit code is then 1, and
    a larger orifice of the luff drive and a clip are tried.
    """
    files = Outputs((out, Form("a verdict", (".html", ".csv", ".parquet"))), (plot, FIGURE))
    chosen = _crane(crane, drive or ())
    law = control_of(control)
    if law is None:
        raise InputError("--control is empty: there is nothing to judge.")
    sets = _drives(chosen, drives, drive or (), scale or ())
    executor = _executor(dask)
    how: dict[str, Any] = _pose(HELD, at)
    with long_work("Seaways") as shown:

        def progress(done: int, of: int) -> None:
            shown(f"{done} of {of} seaways", done / of)

        found = chosen.judge(
            law, sea=_seaway(sea, ship), seeds=range(seeds), drives=sets, allowed=allowed / 100.0,
            remedies=remedies, executor=executor, progress=progress, **how,
        )  # fmt: skip
    files.write(out, "Verdict", lambda path: _write_judgment(found, path))
    files.draw(plot, "plot_judgment", found)
    note(chosen.title)
    show(*found.tables())
    for sentence in found.sentences()[1:]:
        say(sentence)
    files.say()
    if not found.passed:
        side.print(f"Fails: {found.verdict()}")
        raise typer.Exit(1)
    say(f"Works: {found.verdict()}")


def follow(
    crane: CraneWord,
    sea: Annotated[
        str | None, option("Only this sea; by default all.", metavar="SEA[,HEADING]")
    ] = None,
    ship: ShipFile = None,
    drive: DriveWords = None,
    at: HeldAt = None,
    out: TableFile = None,
    plot: FigureFile = None,
) -> None:
    """Show the largest sines of the tip that each axis can follow, and what seas ask for."""
    files = Outputs((out, TABLE), (plot, FIGURE))
    with working("Simulating"):
        chosen = _crane(crane, drive or ())
        seaway = _seaway(sea or "ss3", ship)
        names: dict[str, Any] = {} if sea is None else {"seas": (sea.split(",")[0],)}
        found = chosen.follow(seaway=seaway, **names, **_pose(HELD, at))
    files.write(out, "Amplitudes, in SI", found.tables()[0].write)
    files.draw(plot, "plot_follow", found)
    note(chosen.title)
    show(*found.tables())
    files.say()


def sectors(
    crane: CraneWord,
    control: ControlWord = MEANT,
    sea: SeaWord = "ss3,90",
    ship: ShipFile = None,
    seeds: Seeds = 4,
    step: Annotated[
        float, option("Between two bearings.", metavar="DEG", min=1.0, max=180.0)
    ] = 15.0,
    drives: Annotated[
        str, option("ideal, identified, drawn; as of 'judge'.", metavar="NAMES")
    ] = "ideal,identified",
    drive: DriveWords = None,
    scale: Annotated[
        list[str] | None, option("Drives changed, as of 'judge'.", metavar="AXIS.NAME=FACTOR")
    ] = None,
    at: HeldAt = None,
    out: TableFile = None,
    plot: FigureFile = None,
) -> None:
    """Show the swing over the bearing of the boom, without control and with it."""
    files = Outputs((out, TABLE), (plot, FIGURE))
    chosen = _crane(crane, drive or ())
    law = control_of(control)
    if law is None:
        raise InputError("--control is empty: there is nothing to compare.")
    sets, pose = _drives(chosen, drives, drive or (), scale or ()), _pose(HELD, at)
    del pose["slew_deg"]
    bearings = [step * k for k in range(round(360.0 / step))]
    with long_work("Seaways") as shown:
        found = chosen.sectors(
            law, sea=_seaway(sea, ship), seeds=range(seeds), drives=sets, bearings=bearings,
            progress=lambda done, of: shown(f"{done} of {of} seaways", done / of), **pose,
        )  # fmt: skip
    files.write(out, "Swing, in SI", found.table().write)
    files.draw(plot, "plot_sectors", found)
    note(chosen.title)
    show(found.table())
    files.say()


def control_of(words: str) -> Control | None:
    """A controller of words such as ``zv-tip+feedback=0.2+clip``; None if there are none."""
    from swashplate.crane import control

    made: Control | None = None
    for word in filter(None, words.split("+")):
        name, _, text = word.partition("=")
        parts = text.split("/") if text else []
        numbers = [_number(f"The control '{word}'", each) for each in parts]
        shape, _, place = name.partition("-")
        kinds: dict[str, Any] = {
            "feedback": control.DelayedFeedback,
            "clip": control.Clip,
            "loop": control.PositionLoop,
        }
        if place in ("joint", "tip") and not numbers:
            kind: Any = control.JointShaper if place == "joint" else control.TipShaper
            stage: Control = kind(shape)
        elif name == "ship" and not numbers:
            stage = control.ShipCompensation()
        elif name in kinds and len(numbers) <= (2 if name == "feedback" else 1):
            stage = kinds[name](*numbers)
        else:
            raise InputError(
                f"There is no control '{word}'; there are zv-joint, zv-tip (zvd, ei), "
                "feedback=0.2/0.25, ship, clip=0.25 and loop=0.7."
            )
        made = stage if made is None else made | stage
    return made


def _crane(word: str, drives: Any) -> Crane:
    from swashplate.crane import Crane

    chosen = Crane.from_toml(word) if word.endswith(".toml") else Crane.preset(word)
    changed = {}
    for axis, name in pairs_of("--drive", drives, "luff=mine.toml"):
        if axis not in ("hoist", "slew", "luff"):
            raise InputError(f"--drive {axis}={name}: the axes are hoist, slew and luff.")
        changed[axis] = drive_of(name)
    return chosen.with_drive(**changed)


def _pose(usual: dict[str, float], given: list[str] | None) -> dict[str, float]:
    """Where a run begins."""
    made = usual | _numbers("--at", given, "rope_m=25")
    strange = [each for each in made if each not in usual]
    if strange:
        raise InputError(f"--at has no {strange[0]}; it has {', '.join(usual)}.")
    return made


def _drives(crane: Crane, names: str, given: Any, scaled: Any) -> dict[str, Any]:
    """Sets of drives by name, as `Crane.judge` takes them."""
    from swashplate.analysis.whatif import find_lever, pulled

    made: dict[str, Any] = {}
    for name in filter(None, (each.strip() for each in names.split(","))):
        made[name] = _drawn(crane, given) if name == "drawn" else name
    factors: dict[str, dict[str, float]] = {}
    for name, text in pairs_of("--scale", scaled, "luff.orifice=1.5"):
        axis, _, lever = name.partition(".")
        if axis not in ("hoist", "slew", "luff") or not lever:
            raise InputError(f"--scale {name}={text}: write the axis first, luff.orifice=1.5.")
        find_lever(lever)
        factors.setdefault(axis, {})[lever] = _number(f"--scale {name}={text}", text)
    if factors:
        words = [
            f"{axis} {name} ×{x:g}" for axis, each in factors.items() for name, x in each.items()
        ]
        changed = {axis: pulled(getattr(crane, axis), each) for axis, each in factors.items()}
        made[", ".join(words)] = crane.with_drive(**changed)
    return made


def _drawn(crane: Crane, given: Any) -> tuple[Crane, ...]:
    """Cranes drawn from the errors of the fits whose folders were given."""
    from swashplate.analysis.monte_carlo import stored_draws

    pairs = dict(pairs_of("--drive", given, "luff=fitted"))
    folders = {axis: place for axis, place in pairs.items() if Path(place).is_dir()}
    if not folders:
        raise InputError("--drives drawn needs the folder of a fit: --drive luff=FOLDER.")
    return crane.drawn(**{axis: stored_draws(place) for axis, place in folders.items()})


def _executor(dask: str | None) -> Executor:
    from swashplate.executors import Dask, Threads

    return Threads() if dask is None else Dask(dask)


def _seaway(text: str | None, ship: Path | None) -> Seaway | None:
    from swashplate.crane import Seaway, read_csv, read_veres

    if text is None:
        if ship is not None:
            raise InputError(f"--ship {ship} needs a --sea to move in.")
        return None
    name, *rest = text.split(",")
    if len(rest) > 2:
        raise InputError(f"--sea {text} has too many parts: write --sea ss3,90,1.")
    numbers = [_number(f"--sea {text}", each) for each in rest]
    heading = numbers[0] if numbers else 90.0
    seed = int(numbers[1]) if len(numbers) > 1 else 0
    if ship is None:
        return Seaway(name, heading, seed)
    read = read_csv if ship.suffix.lower() == ".csv" else read_veres
    return Seaway(name, heading, seed, read(ship))


def _numbers(what: str, given: list[str] | None, example: str) -> dict[str, float]:
    pairs = pairs_of(what, given, example)
    return {name: _number(f"{what} {name}={text}", text) for name, text in pairs}


def _number(what: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{what}: '{text}' is no number.") from None


def _write_scene(runs: dict[str, CraneRun], path: Path) -> None:
    from swashplate.report.scene import write_scene

    write_scene(runs, path)


def _write_judgment(found: Judgment, path: Path) -> None:
    from swashplate.report.scene import write_judgment

    if path.suffix.lower() == ".html":
        write_judgment(found, path)
    else:
        found.write(path)


def _write(runs: dict[str, CraneRun], path: Path) -> None:
    from swashplate.tables import write_table

    write_table(next(iter(runs.values())).to_polars(), path)


command(app, "show", SHOW_EXAMPLES)(show_crane)
command(app, "run", RUN_EXAMPLES)(run)
command(app, "judge", JUDGE_EXAMPLES)(judge)
command(app, "follow", FOLLOW_EXAMPLES)(follow)
command(app, "sectors", SECTORS_EXAMPLES)(sectors)
