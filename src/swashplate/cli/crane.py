"""``swashplate crane``: geometry, runs, and the judgment of control over many seaways."""

from __future__ import annotations

from dataclasses import dataclass
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

PAGE = Form("a page", (".html",))
MEANT = "feedback=0.2/0.2+ship+loop=1.5"
"""The controller that is judged by default, as it is designed for ideal drives."""
VARIANTS = """\
Drives behind the stick and, after a colon, control: inverse, volts or ideal; zv-joint, zvd-tip,
ei-tip and the like, feedback=GAIN/DELAY, ship, clip=M, loop=GAIN, joined by +. May be repeated.\
"""
START = ("slew_deg", "boom_deg", "rope_m")

app = typer.Typer(
    help="Whole cranes: boom, rope and load behind three drives, on a ship.",
    no_args_is_help=True,
    rich_markup_mode="rich",
)

CraneWord = Annotated[str, argument("CRANE|FILE.toml", "A packaged crane, tg3637, or your own.")]
ShipFile = Annotated[
    str | None,
    option(
        "The ship's transfer functions: .re1 of VERES, .nc of Capytaine, .csv, or .4 of WAMIT with "
        "its ULEN, hull.4,175.",
        metavar="FILE[,ULEN]",
    ),
]
DriveWords = Annotated[
    list[str] | None,
    option(
        "Another drive: luff=mine.toml, or the folder of a fit. May be repeated.",
        metavar="AXIS=SET",
    ),
]
At = Annotated[
    list[str] | None,
    option(
        "Where it begins: slew_deg, boom_deg, rope_m, as rope_m=25. May be repeated.",
        metavar="NAME=VALUE",
    ),
]


@dataclass(frozen=True)
class Studied:
    """What a study of seaways is about."""

    crane: CraneWord
    control: Annotated[str, option("Control, as of 'run' behind the colon.", metavar="CONTROL")] = (
        MEANT
    )
    sea: Annotated[
        str,
        option(
            "A sea and its heading, 90 abeam: ss2, ss3, ss3-swell, ss4.", metavar="SEA[,HEADING]"
        ),
    ] = "ss3,90"
    ship: ShipFile = None
    seeds: Annotated[
        int | None, option("Number of seaways; judge takes 200 by default.", min=1)
    ] = None
    drives: Annotated[
        str | None,
        option(
            "ideal: follow at once; identified: the crane's own; drawn: from the errors of the "
            "fits given with --drive. A verdict is on the last.",
            metavar="NAMES",
            show_default="ideal,identified",
        ),
    ] = None
    drive: DriveWords = None
    scale: Annotated[
        list[str] | None,
        option(
            "Drives with a lever or parameter moved, judged last: luff.orifice=1.5. May be "
            "repeated.",
            metavar="AXIS.NAME=FACTOR",
        ),
    ] = None
    at: At = None

    def asked(self) -> tuple[Crane, Control, dict[str, Any]]:
        """The crane, the controller, and keywords of a study."""
        crane, law = _crane(self.crane, self.drive or ()), control_of(self.control)
        if law is None:
            raise InputError("--control is empty: there is nothing to judge.")
        how: dict[str, Any] = {"sea": _seaway(self.sea, self.ship), **_pose(self.at)}
        if self.seeds is not None:
            how["seeds"] = range(self.seeds)
        if self.drives is not None or self.scale:
            how["drives"] = _drives(
                crane, self.drives or "ideal,identified", self.drive or (), self.scale or ()
            )
        return crane, law, how


def show_crane(
    crane: CraneWord,
    toml: Annotated[bool, option("Print the file, to begin your own from.", "--toml")] = False,
) -> None:
    """Show a crane's geometry: values, which are assumed, and where they come from.

    For example:
      swashplate crane show tg3637
      swashplate crane show tg3637 --toml > mine.toml
    """
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
    at: At = None,
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
    r"""Run a crane, once or with several variants of control and drives.

    The stick's commands are parts of the full speeds. Without a controller they
    are wanted speeds; with 'volts', as on the crane, 10 V for 1. The residual
    swing is the largest one for 25 s, from 4 s after the stick has returned and
    the controller has ended its command.

    For example:
      swashplate crane run tg3637 --slew 1 --until slew_deg=45
      swashplate crane run tg3637 --slew 1 --until slew_deg=45 --variant volts:zv-joint \
          --variant inverse:zv-joint --variant inverse:zv-tip --plot slew.png
      swashplate crane run tg3637 --sea ss3,90,1 --at slew_deg=90 --at rope_m=27 \
          --variant inverse --variant inverse:feedback=0.2+ship+clip
    """
    files = Outputs((out, TABLE), (plot, FIGURE), (scene, PAGE))
    with working("Simulating"):
        from swashplate.crane import Stick, limit_table, run_table

        chosen = _crane(crane, drive or ())
        targets = _numbers("--until", until, "slew_deg=45")
        stick = Stick.trapezoid(
            hoist=hoist, slew=slew, luff=luff, until=targets, duration=duration, length=length
        )
        seaway = _seaway(sea, ship)
        runs: dict[str, CraneRun] = {}
        for word in variant or ["inverse"]:
            actuation, _, law = word.partition(":")
            how: dict[str, Any] = {"actuation": actuation, "control": control_of(law), **_pose(at)}
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
    study: Studied,
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

    For example:
      swashplate crane judge tg3637 --sea ss3 --seeds 50
      swashplate crane judge tg3637 --scale luff.orifice=3 --out judge.html
      swashplate crane judge tg3637 --drive luff=fitted --drives identified,drawn
    """
    files = Outputs((out, Form("a verdict", (".html", ".csv", ".parquet"))), (plot, FIGURE))
    chosen, law, how = study.asked()
    if dask is not None:
        from swashplate.executors import Dask

        how["executor"] = Dask(dask)
    with long_work("Seaways") as shown:
        found = chosen.judge(
            law, allowed=allowed / 100.0, remedies=remedies, **how,
            progress=lambda done, of: shown(f"{done} of {of} seaways", done / of),
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
    at: At = None,
    out: TableFile = None,
    plot: FigureFile = None,
) -> None:
    """Show the largest sines of the tip that each axis can follow, and what seas ask for.

    For example:
      swashplate crane follow tg3637 --plot follow.png
      swashplate crane follow tg3637 --sea ss3 --at boom_deg=60
    """
    files = Outputs((out, TABLE), (plot, FIGURE))
    with working("Simulating"):
        chosen = _crane(crane, drive or ())
        names: dict[str, Any] = {} if sea is None else {"seas": (sea.split(",")[0],)}
        found = chosen.follow(seaway=_seaway(sea or "ss3", ship), **names, **_pose(at))
    files.write(out, "Amplitudes, in SI", found.tables()[0].write)
    files.draw(plot, "plot_follow", found)
    note(chosen.title)
    show(*found.tables())
    files.say()


SWEEPS = {
    "sectors": """Show the swing over the bearing of the boom, without control and with it.

    Bearings are in degrees from the bow to starboard, in 4 seaways by default.

    For example:
      swashplate crane sectors tg3637 --over 0,45,90,135,180 --plot sectors.png
    """,
    "operability": """Show the swing over the height of the waves, without control and with it.

    Significant heights are in m, at a peak period of 7.5 s, in 40 seaways by
    default; of --sea the heading counts. The figure shows the share of seaways
    with less than 3 degrees.

    For example:
      swashplate crane operability tg3637 --over 0.3,0.6,0.9 --plot operability.png
    """,
    "orifices": """Show the swing over the size of the luff drive's in-line orifice.

    Factors are on the identified orifice, in 20 seaways by default, beside ideal
    drives and no control.

    For example:
      swashplate crane orifices tg3637 --over 1,1.5,2,3 --plot orifices.png
    """,
}
"""Commands that sweep a quantity, with their help."""


def _sweep(name: str, text: str) -> None:
    """Register a command that sweeps a quantity."""
    grid, figure = {
        "sectors": ("bearings", "plot_sectors"),
        "operability": ("heights", "plot_operability"),
        "orifices": ("factors", "plot_orifice"),
    }[name]

    def sweep(
        study: Studied,
        over: Annotated[
            str | None, option("Points of the sweep, joined by commas.", metavar="NUMBERS")
        ] = None,
        out: TableFile = None,
        plot: FigureFile = None,
    ) -> None:
        files = Outputs((out, TABLE), (plot, FIGURE))
        chosen, law, how = study.asked()
        if over is not None:
            how[grid] = [_number(f"--over {over}", each) for each in over.split(",")]
        with long_work("Seaways") as shown:
            found = getattr(chosen, name)(
                law, **how, progress=lambda done, of: shown(f"{done} of {of} seaways", done / of)
            )
        files.write(out, "Swing, in SI", found.table().write)
        files.draw(plot, figure, found)
        note(chosen.title)
        show(found.table())
        files.say()

    sweep.__doc__ = text
    command(app, name)(sweep)


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


def _pose(given: list[str] | None) -> dict[str, float]:
    """Where a run begins, as far as it is given."""
    made = _numbers("--at", given, "rope_m=25")
    strange = [each for each in made if each not in START]
    if strange:
        raise InputError(f"--at has no {strange[0]}; it has {', '.join(START)}.")
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


def _seaway(text: str | None, ship: str | None) -> Seaway | None:
    from swashplate.crane import Seaway, read_ship

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
    path, _, unit = ship.partition(",")
    length = _number(f"--ship {ship}", unit) if unit else None
    return Seaway(name, heading, seed, read_ship(path, length))


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


command(app, "show")(show_crane)
command(app, "run")(run)
command(app, "judge")(judge)
command(app, "follow")(follow)
for _name, _text in SWEEPS.items():
    _sweep(_name, _text)
