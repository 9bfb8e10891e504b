"""``swashplate crane``: a crane's geometry, and runs of it with controllers and in seaways."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swashplate.cli.options import FigureFile, TableFile, argument, command, option
from swashplate.cli.terminal import Outputs, note, show, working
from swashplate.cli.words import drive_of, pairs_of
from swashplate.errors import InputError
from swashplate.tables import FIGURE, TABLE

if TYPE_CHECKING:
    from swashplate.crane import Crane, CraneRun, Seaway
    from swashplate.crane.control import Control

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
VARIANTS = """\
Drives behind the stick and, after a colon, control: inverse, volts or ideal; zv-joint, zvd-tip,
ei-tip and the like, feedback=GAIN, ship, clip=M, loop=GAIN, joined by +. May be repeated.\
"""
START = {"slew_deg": 0.0, "boom_deg": 45.0, "rope_m": 20.0}

app = typer.Typer(
    help="Whole cranes: boom, rope and load behind three drives, on a ship.",
    no_args_is_help=True,
    rich_markup_mode="rich",
)

CraneWord = Annotated[str, argument("CRANE|FILE.toml", "A packaged crane, tg3637, or your own.")]


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
    ship: Annotated[
        Path | None,
        option("The ship's transfer functions: .re1 of VERES, or .csv.", metavar="FILE"),
    ] = None,
    variant: Annotated[
        list[str] | None,
        option(VARIANTS, metavar="DRIVES[:CONTROL]", show_default="inverse"),
    ] = None,
    drive: Annotated[
        list[str] | None,
        option("Another drive: luff=mine.toml. May be repeated.", metavar="AXIS=SET"),
    ] = None,
    brake: Annotated[
        bool, option("Whether a brake holds the hoist at rest.", "--brake/--no-brake")
    ] = True,
    out: TableFile = None,
    plot: FigureFile = None,
) -> None:
    """Run a crane, once or with several variants of control and drives.

    The stick's commands are parts of the full speeds. Without a controller they
    are wanted speeds; with 'volts', as on the crane, 10 V for 1. The residual
    swing is the largest one for 25 s, from 4 s after the stick has returned and
    the controller has ended its command.
    """
    files = Outputs((out, TABLE), (plot, FIGURE))
    with working("Simulating"):
        from swashplate.crane import Stick, limit_table, run_table

        chosen = _crane(crane, drive or ())
        targets = _numbers("--until", until, "slew_deg=45")
        begin = START | _numbers("--at", at, "rope_m=25")
        strange = [each for each in begin if each not in START]
        if strange:
            raise InputError(f"--at has no {strange[0]}; it has {', '.join(START)}.")
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
    note(chosen.title)
    show(table, limit_table(runs))
    files.say()


def control_of(words: str) -> Control | None:
    """A controller of words such as ``zv-tip+feedback=0.2+clip``; None if there are none."""
    from swashplate.crane import control

    made: Control | None = None
    for word in filter(None, words.split("+")):
        name, _, text = word.partition("=")
        numbers = [_number(f"The control '{word}'", text)] if text else []
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
        elif name in kinds:
            stage = kinds[name](*numbers)
        else:
            raise InputError(
                f"There is no control '{word}'; there are zv-joint, zv-tip (zvd, ei), "
                "feedback=0.2, ship, clip=0.25 and loop=0.7."
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


def _write(runs: dict[str, CraneRun], path: Path) -> None:
    from swashplate.tables import write_table

    write_table(next(iter(runs.values())).to_polars(), path)


command(app, "show", SHOW_EXAMPLES)(show_crane)
command(app, "run", RUN_EXAMPLES)(run)
