"""``swashplate crane``: geometry, runs, and the judgment of control over many seaways."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swashplate.cli.options import FigureFile, TableFile, command
from swashplate.cli.terminal import (
    FORCED,
    draw,
    long_work,
    note,
    save,
    say,
    say_saved,
    show,
    side,
    working,
)
from swashplate.cli.words import pairs_of
from swashplate.errors import InputError
from swashplate.tables import PAGE, Column, Form, Table

if TYPE_CHECKING:
    from swashplate.crane import (
        Crane,
        Hull,
        Judgment,
        Seaway,
        Spectrum,
        Sweep,
        TransferFunctions,
    )
    from swashplate.crane.control import Control
    from swashplate.crane.sea import Array

VERDICT = Form("a verdict", (".html", ".csv", ".parquet"))
LEAST_ALLOWED = 0.5
"""Percent of seaways below which a share is probably meant."""
START, AXES = ("slew_deg", "boom_deg", "rope_m"), ("hoist", "slew", "luff")

app = typer.Typer(
    help="Whole cranes: boom, rope and load behind three drives, on a ship.",
    no_args_is_help=True,
    rich_markup_mode="rich",
)


@dataclass(frozen=True)
class Placed:
    """A crane, its drives, and where it begins.

    Options:
      crane CRANE|FILE.toml: A packaged crane, tg3637, or your own.
      drive AXIS=SET: Another drive: luff=mine.toml, or the folder of a fit, whose verdict is shown.
          May be repeated.
      force: Replace older files, and take drives whose fit is not usable.
      at NAME=VALUE: Where it begins: slew_deg, boom_deg, rope_m, as rope_m=25. May be repeated.
    """

    crane: str
    drive: list[str] | None = None
    at: list[str] | None = None

    @cached_property
    def chosen(self) -> Crane:
        """The crane, with its drives; one whose fit is not usable is refused without --force."""
        drives = dict(pairs_of("--drive", self.drive, "luff=mine.toml"))
        crane = _crane_of(self.crane).with_drive(known=True, **drives)
        if not FORCED.get():
            _refuse_unusable(crane)
        return crane

    @property
    def pose(self) -> dict[str, Any]:
        """Where a run begins, as far as it is given."""
        return _numbers("--at", self.at, "rope_m=25", START)


@dataclass(frozen=True)
class AtSea(Placed):
    """A crane on its ship in a sea.

    Options:
      sea SEA: The sea: ss2, ss3, ss3-swell, ss4, ss5 or ss6; or significant height in m and peak
          period in s, with the peak factor if it is not 1, and 'spread' for directions spread by
          cos²: 1.5,8 or 1.5,8,3.3,spread.
      heading DEG: Where the waves come from: 0 astern, 90 starboard (the default), 180 ahead, 270
          port.
      ship FILE[,ULEN]: The ship's transfer functions: .re1 of VERES, .nc of Capytaine, .csv, or
          .4 of WAMIT with its ULEN, hull.4,175; by default the packaged hull's.
      roll_period S: Natural roll period of the packaged hull, assumed to be 13 s.
      roll_damping RATIO: Damping ratio of the packaged hull's roll, assumed to be 0.06.
      speed M/S: Speed of the ship, forward.
      list_deg --list DEG: Constant list, positive with starboard down.
      trim_deg --trim DEG: Constant trim, positive with the bow down.
      reference X,Y,Z: Point that the ship's transfer functions are given for, in the crane's axes:
          forward, port and up in m, by default 0,0,0.
    """

    sea: list[str] | None = None
    heading: float | None = None
    ship: str | None = None
    roll_period: float | None = None
    roll_damping: float | None = None
    speed: float | None = None
    list_deg: float | None = None
    trim_deg: float | None = None
    reference: str | None = None

    @property
    def _lean(self) -> dict[str, Any]:
        """List and trim, as far as they are given."""
        return _given(list_deg=self.list_deg, trim_deg=self.trim_deg)

    @property
    def _at_sea(self) -> dict[str, Any]:
        """What is given of waves and ship besides the sea and the lean, by the option's name."""
        return _given(
            heading=self.heading,
            ship=self.ship,
            roll_period=self.roll_period,
            roll_damping=self.roll_damping,
            speed=self.speed,
            reference=self.reference,
        )

    def seaway(
        self, default: str | None = None, *, seed: int | None = None, length: float = 0.0
    ) -> Seaway | None:
        """The seaway in its sea, or in a default one; None if there is neither.

        Its record is at least as long as a length. [s]
        """
        from swashplate.crane import Seaway
        from swashplate.crane.sea import RECORDS

        words = self.sea or ([] if default is None else [default])
        if not words:
            given = [*self._at_sea, *_given(seed=seed)]
            if given:
                option = given[0].replace("_", "-")
                raise InputError(f"--{option} needs a sea: give --sea, as --sea ss3.")
            return None
        if len(words) > 1:
            raise InputError(f"--sea {' --sea '.join(words)} is too much: write one sea.")
        sea, spread = _sea_of(words[0])
        options = self._lean | _given(heading_deg=self.heading, speed=self.speed, seed=seed)
        if self.reference is not None:
            options["reference"] = _vector("--reference", self.reference, "-12,0,9")
        record = max(RECORDS[0], length)
        return Seaway(sea, ship=self._hull(), spread=spread, record=record, **options)

    def motion(self, count: int) -> Array | None:
        """Motion of the ship in calm water, (count, 6): its lean; None if it is upright."""
        import numpy as np

        from swashplate.crane import Seaway

        if not self._lean:
            return None
        return np.tile(Seaway(**self._lean).lean, (count, 1))

    def _hull(self) -> Hull | TransferFunctions:
        """The ship of a file, or the packaged hull as its roll is given."""
        from swashplate.crane import read_ship
        from swashplate.crane.transfer_functions import CRANE_SHIP

        roll = _given(roll_period=self.roll_period, roll_damping=self.roll_damping)
        if self.ship is None:
            return replace(CRANE_SHIP, **roll)
        if roll:
            raise InputError(
                f"--ship {self.ship} has its own roll: leave --roll-period and --roll-damping out, "
                "which are of the packaged hull."
            )
        path, _, unit = self.ship.partition(",")
        return read_ship(path, _number(f"--ship {self.ship}", unit) if unit else None)


@dataclass(frozen=True)
class Operated(AtSea):
    """A crane on its ship, and the load on its rope.

    Options:
      suspension NAME=VALUE: How the load hangs: stiffness of the rope (EA) in N, as stiffness=6e7;
          damping ratio of its bounce on an elastic rope; hook in kg and sling in m. May be
          repeated.
      wind FORWARD,PORT: Velocity of the air in m/s. Needs --drag-area.
      drag_area M2: Drag area of the load, its drag coefficient times its area.
    """

    suspension: list[str] | None = None
    wind: str | None = None
    drag_area: float | None = None

    @property
    def setup(self) -> dict[str, Any]:
        """Where a run begins, and what hangs on the crane, as far as it is given."""
        from swashplate.crane import Suspension

        setup = self.pose | _given(drag_area=self.drag_area)
        names = [each.name for each in fields(Suspension)]
        values = _numbers("--suspension", self.suspension, "stiffness=6e7", names)
        if values:
            setup["suspension"] = Suspension(**values)
        if self.wind is not None:
            if self.drag_area is None:
                raise InputError(
                    f"--wind {self.wind} blows on nothing: give the load's --drag-area, as 12."
                )
            setup["wind"] = _vector("--wind", self.wind, "10,-5")
        return setup


@dataclass(frozen=True)
class Studied(Operated):
    """What a study of seaways is about.

    Options:
      control CONTROL: Control, as of 'run' behind the colon; by default as it is designed for
          ideal drives.
      seeds N: Number of seaways; judge takes 200 by default.
      drives NAMES: ideal: follow at once; identified: the crane's own; volts: these, 10 V for full
          speed; drawn: from the errors of the fits that the drives come from, while control
          knows the fits; by default ideal,identified. A verdict is on the last.
      scale AXIS.NAME=FACTOR: Drives with a lever or parameter moved, which control knows, judged
          last: luff.orifice=1.5. May be repeated.
    """

    control: str = "feedback=0.2/0.2+ship+loop=1.5"
    seeds: int | None = None
    drives: str | None = None
    scale: list[str] | None = None

    def through(self, study: Callable[..., Any], *first: Any, **more: Any) -> Any:
        """A study of the controller, whose progress is shown."""
        law = control_of(self.control)
        if law is None:
            raise InputError("--control is empty: there is nothing to judge.")
        how = self.setup | more
        if self.waters is not None:
            how["sea"] = self.waters
        if self.seeds is not None:
            how["seeds"] = range(self.seeds)
        if self.drives is not None or self.scale:
            how["drives"] = self.sets()
        with long_work("Seaways") as shown:
            how["progress"] = lambda done, of: shown(f"{done} of {of} seaways", done / of)
            return study(*first, law, **how)

    @cached_property
    def waters(self) -> Seaway | None:
        """The seaway, in ss3 if only the ship is given; None if nothing of either is."""
        return self.seaway(default="ss3" if self._at_sea or self._lean else None)

    def sets(self) -> dict[str, Any]:
        """Sets of drives by name."""
        from swashplate.analysis.whatif import find_lever
        from swashplate.crane import drawn_cranes, upgraded

        names = filter(None, map(str.strip, (self.drives or "ideal,identified").split(",")))
        sets: dict[str, Any] = {name: name for name in names}
        if "drawn" in sets:
            sources = self.chosen.sources
            drawn = [axis for axis, source in sources.items() if source.fit is not None]
            if not drawn:
                raise InputError("--drives drawn needs the folder of a fit: --drive luff=FOLDER.")
            sets["drawn"] = drawn_cranes(self.chosen)
            kept = [axis for axis in AXES if axis not in drawn]
            as_given = f"; as given, since they come from no fit: {', '.join(kept)}" if kept else ""
            side.print(f"Drawn: {', '.join(drawn)}{as_given}")
        crane, changed = self.chosen, []
        for name, text in pairs_of("--scale", self.scale, "luff.orifice=1.5"):
            (axis, _, lever), words = name.partition("."), f"--scale {name}={text}"
            if not lever or axis not in AXES:
                raise InputError(
                    f"{words}: write the axis first, luff.orifice=1.5; the axes are "
                    f"{', '.join(AXES)}."
                )
            find_lever(lever)
            factor = _number(words, text)
            crane = upgraded(crane, axis, {lever: factor})
            changed.append(f"{axis} {lever} ×{factor:g}")
        if changed:
            sets[", ".join(changed)] = crane
        return sets


def show_crane(crane: str, *, toml: bool = False) -> None:
    """Show a crane's geometry: values, which are assumed, and where they come from.

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
    chosen = _crane_of(crane)
    show(chosen.table())
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
          default, also called identified), volts or ideal; zv-joint, zvd-tip, ei-tip and the like,
          feedback=GAIN/DELAY, ship, clip=M, loop=GAIN, joined by +. May be repeated.
      brake --brake/--no-brake: Whether a brake holds the hoist at rest.
      scene FILE: Write the scene that moves: .html.

    For example:
      swashplate crane run tg3637 --slew 1 --until slew_deg=45
      swashplate crane run tg3637 --slew 1 --until slew_deg=45 --variant volts:zv-joint \
          --variant inverse:zv-joint --variant inverse:zv-tip --plot slew.png
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
        targets = _numbers("--until", until, "slew_deg=45")
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
    low = [f"{name}: {each}" for name, run in runs.items() for each in run.sentences()]
    _end(crane, tables, *_sentences(seaway), *low, *crane.provenance())


def judge(
    study: Studied,
    *,
    allowed: float = 5.0,
    remedies: bool = True,
    dask: str | None = None,
    out: Annotated[Path | None, VERDICT] = None,
    plot: FigureFile = None,
) -> None:
    """Judge control on a crane's drives over many seaways.

    Every variant goes through the same seaways. Control fails if it makes the
    swing worse than none in more than 5 % of them, as far as the 95 % interval
    of that share tells; a larger orifice of the luff drive and a clip are then
    tried. Where the interval holds the 5 % it is not decided, and the verdict
    says how many seaways would do. The exit code is 0 only if control works.

    Options:
      allowed PERCENT: Seaways in which control may be worse than none, in percent.
      remedies --remedies/--no-remedies: Whether to look for what would do.
      dask ADDRESS: Run on a Dask cluster: tcp://HOST:PORT.
      out FILE: Write the verdict's page, .html, or its numbers, .csv or .parquet.

    For example:
      swashplate crane judge tg3637 --sea ss3 --seeds 50
      swashplate crane judge tg3637 --scale luff.orifice=3 --out judge.html
      swashplate crane judge tg3637 --drive luff=fitted --drives identified,drawn
    """
    if 0.0 < allowed < LEAST_ALLOWED:
        raise InputError(
            f"--allowed is in percent, and {allowed:g} % of the seaways would ask for thousands of "
            f"them: did you mean --allowed {100.0 * allowed:g}?"
        )
    more: dict[str, Any] = {"allowed": allowed / 100.0, "remedies": remedies}
    if dask is not None:
        from swashplate.executors import Dask

        more["executor"] = Dask(dask)
    from swashplate.crane import judge as judge_control

    found: Judgment = study.through(judge_control, study.chosen, **more)
    what, write = "Numbers of every seaway, in SI", found.write
    if out is not None and out.suffix.lower() == ".html":
        from swashplate.report.scene import write_judgment

        what, write = "Verdict", partial(write_judgment, found)
    save(out, what, write)
    draw(plot, "plot_judgment", found)
    _end(study.chosen, found.tables(), *_sentences(study.waters), *found.sentences()[1:])
    say_saved()
    if not found.passed:
        side.print(found.headline)
        raise typer.Exit(1)
    say(found.headline)


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
    about_sea = _sentences(seaway) if at_sea.sea else ()
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

    bearing: of the boom, in degrees from the bow to starboard, in 4 seaways.
    height: significant height of waves in m, with a peak at 7.5 s whatever --sea
    is, in 40; the figure shows the share of seaways with less than 3 degrees.
    orifice: factors on the luff drive's in-line orifice, in 20.
    stick: part of the full speed in a slew by 45 degrees in a calm sea; the
    residual swing counts.

    Options:
      over bearing|height|orifice|stick: The quantity.
      points NUMBERS: Points of the sweep, joined by commas.

    For example:
      swashplate crane sweep tg3637 bearing --points 0,45,90,135,180 --plot sectors.png
      swashplate crane sweep tg3637 orifice --points 1,1.5,2,3 --plot orifice.png
      swashplate crane sweep tg3637 stick --control zv-joint --plot stick.png
    """
    more: dict[str, Any] = {}
    if points is not None:
        more["points"] = [_number(f"--points {points}", each) for each in points.split(",")]
    from swashplate.crane import sweep as swing_over

    found: Sweep = study.through(swing_over, study.chosen, over, **more)
    save(out, "Swing, in SI", found.tables()[0].write)
    draw(plot, "plot_sweep", found)
    _end(study.chosen, found.tables(), *_sentences(study.waters), *study.chosen.provenance())


def sectors(
    study: Studied, *, points: str | None = None, out: TableFile = None, plot: FigureFile = None
) -> None:
    """Show the swing over the bearing of the boom: 'sweep' over the bearing.

    Options:
      points NUMBERS: Bearings in degrees from the bow to starboard, joined by commas.

    For example:
      swashplate crane sectors tg3637 --points 0,45,90,135,180 --plot sectors.png
    """
    sweep(study, "bearing", points=points, out=out, plot=plot)


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


def control_of(words: str) -> Control | None:
    """A controller of words such as ``zv-tip+feedback=0.2+clip``; None if there are none."""
    from swashplate.crane import control

    kinds: dict[str, tuple[Any, int]] = {
        "feedback": (control.DelayedFeedback, 2),
        "ship": (control.ShipCompensation, 0),
        "clip": (control.Clip, 1),
        "loop": (control.PositionLoop, 1),
    }
    for where, shaper in (("tip", control.TipShaper), ("joint", control.JointShaper)):
        kinds |= {f"{shape}-{where}": (partial(shaper, shape), 0) for shape in control.IMPULSES}
    stages: list[Control] = []
    for word in filter(None, words.split("+")):
        name, _, text = word.partition("=")
        numbers = [_number(f"The control '{word}'", each) for each in text.split("/") if text]
        kind, most = kinds.get(name, (None, 0))
        if kind is None or len(numbers) > most:
            raise InputError(
                f"There is no control '{word}'; there are zv-joint, zv-tip (zvd, ei), "
                "feedback=0.2/0.25, ship, clip=0.25 and loop=0.7."
            )
        stages.append(kind(*numbers))
    return control.Chain(tuple(stages)) if stages else None


def _given(**options: Any) -> dict[str, Any]:
    """The options that are given."""
    return {name: value for name, value in options.items() if value is not None}


def _sentences(seaway: Seaway | None) -> tuple[str, ...]:
    """What a seaway does not simulate as it is asked for."""
    return () if seaway is None else seaway.sentences()


def _sea_of(text: str) -> tuple[str | Spectrum, bool]:
    """A sea's name or spectrum of words such as ``1.5,8,3.3,spread``, and whether it is spread."""
    from swashplate.crane import Spectrum

    first, *rest = (word.strip() for word in text.split(","))
    spread = rest[-1:] == ["spread"]
    numbers = rest[:-1] if spread else rest
    if first[:1].isalpha():
        if numbers:
            options = zip(("--heading", "--seed"), numbers, strict=False)
            instead = " ".join(f"{option} {number}" for option, number in options)
            raise InputError(
                f"--sea {text}: behind the name of a sea there are no numbers; write --sea {first} "
                f"{instead}."
            )
        return first, spread
    if not 1 <= len(numbers) <= 2:
        raise InputError(
            f"--sea {text}: write a name, --sea ss3, or significant height in m and peak period in "
            "s, --sea 1.5,8, with the peak factor, --sea 1.5,8,3.3."
        )
    height, *others = (_number(f"--sea {text}", word) for word in (first, *numbers))
    return Spectrum(height, *others), spread


def _vector(option: str, text: str, example: str) -> tuple[float, ...]:
    """As many numbers, joined by commas, as an example has."""
    numbers = tuple(_number(f"{option} {text}", word) for word in text.split(","))
    if len(numbers) != len(example.split(",")):
        raise InputError(f"{option} {text}: write {option} {example}.")
    return numbers


def _numbers(
    what: str, given: list[str] | None, example: str, known: Sequence[str] = ()
) -> dict[str, Any]:
    pairs = pairs_of(what, given, example)
    strange = [name for name, _ in pairs if known and name not in known]
    if strange:
        raise InputError(f"{what} has no {strange[0]}; it has {', '.join(known)}.")
    return {name: _number(f"{what} {name}={text}", text) for name, text in pairs}


def _number(what: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{what}: '{text}' is no number.") from None


def _crane_of(name: str) -> Crane:
    """A packaged crane by its name, or the crane of a file."""
    from swashplate.crane import Crane

    return Crane.from_toml(name) if name.endswith(".toml") else Crane.preset(name)


def _refuse_unusable(crane: Crane) -> None:
    """Refuse a drive whose fit is not usable."""
    for axis, source in crane.sources.items():
        if not source.usable:
            raise InputError(
                f"{axis}={source.place}: the verdict on the fit of this drive is "
                f"'{source.verdict.rstrip('.')}'; fit again until it is usable, as its report "
                f"advises, give another drive, or take this one all the same with --force."
            )


def _end(crane: Crane, tables: Iterable[Table], *said: str) -> None:
    """Print title, tables and sentences."""
    note(crane.title)
    show(*tables)
    for sentence in said:
        say(sentence)


command(app, "show")(show_crane)
command(app, "run")(run)
command(app, "judge")(judge)
command(app, "follow")(follow)
command(app, "sweep")(sweep)
command(app, "sectors")(sectors)
command(app, "damping")(damping)
