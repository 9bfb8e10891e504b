"""Options of ``swashplate crane``: the crane, its ship, sea and load, and studies of seaways."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from swashplate.cli.options import NO_VALUE, force_option
from swashplate.cli.parsing import pairs_of
from swashplate.cli.terminal import long_work, side
from swashplate.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from swashplate.crane import Crane, Hull, Seaway, Spectrum, TransferFunctions
    from swashplate.crane.control import Control

START = ("slew_deg", "boom_deg", "rope_m")
AXES = ("hoist", "slew", "luff")


CraneArgument = Annotated[
    str,
    typer.Argument(
        metavar="CRANE|FILE.toml", help="Packaged crane, tg3637, or the file of another crane."
    ),
]


@dataclass(frozen=True)
class Placed:
    """A crane, its drives, and its initial position."""

    crane: CraneArgument
    drive: Annotated[
        list[str] | None,
        typer.Option(
            metavar="AXIS=SET",
            help=(
                "Drive of an axis: luff=mine.toml, or the folder of a fit, whose verdict is shown; "
                "may be repeated."
            ),
        ),
    ] = None
    at: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            help="Initial slew_deg, boom_deg or rope_m, such as rope_m=25; may be repeated.",
        ),
    ] = None
    force: Annotated[
        bool, force_option("Replace existing files, and accept drives whose fit is not usable.")
    ] = False

    @cached_property
    def loaded_crane(self) -> Crane:
        """The crane, with its drives; one whose fit is not usable is refused without --force."""
        drives = dict(pairs_of("--drive", self.drive, "luff=mine.toml"))
        crane = crane_of(self.crane).with_drive(known_to_controller=True, **drives)
        if not self.force:
            _refuse_unusable(crane)
        return crane

    @property
    def pose(self) -> dict[str, Any]:
        """The initial position, as far as it is given."""
        return named_numbers("--at", self.at, "rope_m=25", START)


@dataclass(frozen=True)
class WithLoad(Placed):
    """A crane, and the load on its rope."""

    load: Annotated[
        float | None,
        typer.Option(metavar="KG", help="Mass of the load (default: the crane's safe load)."),
    ] = None
    swing_damping: Annotated[
        float | None,
        typer.Option(
            metavar="RATIO",
            help="Damping ratio of the load's swing (default: the crane's; 0.005, assumed).",
        ),
    ] = None
    suspension: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            help=(
                "Property of the suspension: stiffness of the rope (EA) in N, such as "
                "stiffness=6e7; bounce_damping, the damping ratio of an elastic rope; hook in kg; "
                "sling in m; may be repeated."
            ),
        ),
    ] = None
    wind: Annotated[
        str | None,
        typer.Option(
            metavar="FORWARD,PORT", help="Velocity of the air in m/s; requires --drag-area."
        ),
    ] = None
    drag_area: Annotated[
        float | None,
        typer.Option(metavar="M2", help="Drag area of the load: drag coefficient times area."),
    ] = None

    @property
    def run_options(self) -> dict[str, Any]:
        """Pose of the crane at the start and load on its rope, as far as they are given."""
        from swashplate.crane import Suspension

        options = self.pose | _without_none(
            drag_area=self.drag_area, load=self.load, swing_damping=self.swing_damping
        )
        names = [field.name for field in fields(Suspension)]
        properties = named_numbers("--suspension", self.suspension, "stiffness=6e7", names)
        if properties:
            options["suspension"] = Suspension(**properties)
        if self.wind is not None:
            if self.drag_area is None:
                raise InputError(
                    f"--wind {self.wind} needs the load's drag area: give --drag-area, such as 12."
                )
            options["wind"] = _vector("--wind", self.wind, "10,-5")
        return options


@dataclass(frozen=True)
class AtSea(Placed):
    """A crane on its ship in a sea."""

    sea: Annotated[
        list[str] | None,
        typer.Option(
            metavar="SEA",
            help=(
                "Sea: ss2, ss3, ss3-swell, ss4, ss5 or ss6; or significant height in m and peak "
                "period in s, with the peak factor if it is not 1, and 'spread' for directions "
                "spread by cos²: 1.5,8 or 1.5,8,3.3,spread."
            ),
        ),
    ] = None
    heading: Annotated[
        float | None,
        typer.Option(
            metavar="DEG",
            help=(
                "Direction that the waves come from: 0 astern, 90 starboard, 180 ahead, 270 port "
                "(default: 90)."
            ),
        ),
    ] = None
    ship: Annotated[
        str | None,
        typer.Option(
            metavar="FILE[,ULEN]",
            help=(
                "Transfer functions of the ship: .re1 of VERES, .nc of Capytaine, .csv, or .4 of "
                "WAMIT with its ULEN, such as hull.4,175 (default: those of the packaged hull)."
            ),
        ),
    ] = None
    roll_period: Annotated[
        float | None,
        typer.Option(
            metavar="S", help="Natural roll period of the packaged hull (default: 13 s, assumed)."
        ),
    ] = None
    roll_damping: Annotated[
        float | None,
        typer.Option(
            metavar="RATIO",
            help="Damping ratio of the packaged hull's roll (default: 0.06, assumed).",
        ),
    ] = None
    speed: Annotated[
        float | None, typer.Option(metavar="M/S", help="Forward speed of the ship.")
    ] = None
    list_deg: Annotated[
        float | None,
        typer.Option("--list", metavar="DEG", help="Constant list, positive with starboard down."),
    ] = None
    trim_deg: Annotated[
        float | None,
        typer.Option("--trim", metavar="DEG", help="Constant trim, positive with the bow down."),
    ] = None
    reference: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z",
            help=(
                "Reference point of the ship's transfer functions in the crane's axes: forward, "
                "port and up in m (default: 0,0,0)."
            ),
        ),
    ] = None

    @property
    def _lean(self) -> dict[str, Any]:
        """List and trim, as far as they are given."""
        return _without_none(list_deg=self.list_deg, trim_deg=self.trim_deg)

    @property
    def _at_sea(self) -> dict[str, Any]:
        """The options of waves and ship that are given, except the sea and the lean, by name."""
        return _without_none(
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

        seas = self.sea or ([] if default is None else [default])
        if not seas:
            options_at_sea = [*self._at_sea, *_without_none(seed=seed)]
            if options_at_sea:
                option = options_at_sea[0].replace("_", "-")
                raise InputError(f"--{option} needs a sea: give --sea, such as --sea ss3.")
            return None
        if len(seas) > 1:
            raise InputError(f"--sea {' --sea '.join(seas)}: give one sea.")
        sea, spread = _sea_of(seas[0])
        options = self._lean | _without_none(heading_deg=self.heading, speed=self.speed, seed=seed)
        if self.reference is not None:
            options["reference"] = _vector("--reference", self.reference, "-12,0,9")
        record = max(RECORDS[0], length)
        return Seaway(sea, ship=self._hull(), spread=spread, record=record, **options)

    def motion(self, count: int) -> NDArray[np.float64] | None:
        """Motion of the ship in calm water, (count, 6): its lean; None if it is upright."""
        import numpy as np

        from swashplate.crane import Seaway

        if not self._lean:
            return None
        return np.tile(Seaway(**self._lean).lean, (count, 1))

    def _hull(self) -> Hull | TransferFunctions:
        """The ship of a file, or the packaged hull as its roll is given."""
        from swashplate.crane import read_ship
        from swashplate.crane.sea import CRANE_SHIP

        roll = _without_none(roll_period=self.roll_period, roll_damping=self.roll_damping)
        if self.ship is None:
            return replace(CRANE_SHIP, **roll)
        if roll:
            raise InputError(
                f"--ship {self.ship} has its own roll: leave --roll-period and --roll-damping out: "
                "they apply only to the packaged hull."
            )
        path, _, unit = self.ship.partition(",")
        return read_ship(path, number_of(f"--ship {self.ship}", unit) if unit else None)


@dataclass(frozen=True)
class Operated(WithLoad, AtSea):
    """A crane on its ship, and the load on its rope."""


@dataclass(frozen=True)
class Studied(Operated):
    """A study of many seaways."""

    control: Annotated[
        str,
        typer.Option(
            metavar="CONTROL",
            help=(
                "Control, written as after the colon of --variant of 'swashplate crane run'; the "
                "default is a design for ideal drives."
            ),
        ),
    ] = "feedback=0.2/0.2+ship+loop=1.5"
    seeds: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Number of seaways (assess: 120 by default; operability: at most 60 for a cell).",
        ),
    ] = None
    length: Annotated[
        float | None,
        typer.Option(metavar="S", help="Evaluated duration of each seaway (default: 600 s)."),
    ] = None
    run_in: Annotated[
        float | None,
        typer.Option(
            metavar="S",
            help=(
                "Duration before the evaluation (default: 120 s); each run starts in a stationary "
                "swing."
            ),
        ),
    ] = None
    drives: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES",
            help=(
                "Sets of drives, joined by commas (default: ideal,identified). ideal: without "
                "delay or limits; identified: the crane's own; volts: these, 10 V for full speed; "
                "drawn: from the errors of the fits, unknown to the controller. The verdict is on "
                "the last set."
            ),
        ),
    ] = None
    crew: Annotated[
        bool,
        typer.Option(
            "--crew",
            metavar=NO_VALUE,
            help=(
                "Add a variant in which the operator damps the swing by hand, on the crane's own "
                "drives."
            ),
        ),
    ] = False
    scale: Annotated[
        list[str] | None,
        typer.Option(
            metavar="AXIS.NAME=FACTOR",
            help=(
                "Factor on a design variable or parameter of a drive, known to the controller; "
                "added as the last set: luff.orifice=1.5; may be repeated."
            ),
        ),
    ] = None

    def through(self, study: Callable[..., Any], *arguments: Any, **keywords: Any) -> Any:
        """Run a study with the controller and the options, and show its progress."""
        from swashplate.crane.control import Crew

        controller = control_of(self.control)
        if controller is None:
            raise InputError("--control is empty: there is nothing to assess.")
        options = (
            self.run_options | _without_none(length=self.length, run_in=self.run_in) | keywords
        )
        if self.waters is not None:
            options["sea"] = self.waters
        if self.seeds is not None:
            options["seeds"] = range(self.seeds)
        if self.crew:
            options["crew"] = Crew()
        if self.drives is not None or self.scale:
            options["drives"] = self.drive_sets()
        with long_work("Seaways") as show:
            options["progress"] = lambda done, of: show(f"{done} of {of} seaways", done / of)
            return study(*arguments, controller, **options)

    @cached_property
    def waters(self) -> Seaway | None:
        """The seaway, in ss3 if only options of the ship are given; None if no option is."""
        from swashplate.crane.studies import EVALUATED_TIME, RUN_IN

        evaluated = EVALUATED_TIME if self.length is None else self.length
        run_in = RUN_IN if self.run_in is None else self.run_in
        is_stated = self._at_sea or self._lean or self.length or self.run_in
        return self.seaway(default="ss3" if is_stated else None, length=evaluated + run_in)

    def drive_sets(self) -> dict[str, Any]:
        """Sets of drives by name: those of --drives, and last the crane of --scale.

        A set is "ideal", "identified" or "volts", the crane with changed drives, or many cranes
        with drawn drives.
        """
        names = [name.strip() for name in (self.drives or "ideal,identified").split(",")]
        sets: dict[str, Any] = {name: name for name in names if name}
        if "drawn" in sets:
            sets["drawn"] = self._drawn_cranes()
        return sets | self._scaled_crane()

    def _drawn_cranes(self) -> tuple[Crane, ...]:
        """Cranes with drives drawn from the errors of their fits; says which axes are drawn."""
        from swashplate.crane import drawn_cranes

        sources = self.loaded_crane.sources
        fitted = [axis for axis, source in sources.items() if source.fit is not None]
        if not fitted:
            raise InputError("--drives drawn needs the folder of a fit: --drive luff=FOLDER.")
        cranes = drawn_cranes(self.loaded_crane)
        unfitted = [axis for axis in AXES if axis not in fitted]
        not_drawn = f"; not drawn, without a fit: {', '.join(unfitted)}" if unfitted else ""
        side.print(f"Drawn: {', '.join(fitted)}{not_drawn}")
        return cranes

    def _scaled_crane(self) -> dict[str, Crane]:
        """The crane with the changes of --scale, by their names; empty without changes."""
        from swashplate.analysis import powers_of
        from swashplate.crane import with_design_change

        crane = self.loaded_crane
        changes = []
        for name, text in pairs_of("--scale", self.scale, "luff.orifice=1.5"):
            axis, _, variable = name.partition(".")
            option = f"--scale {name}={text}"
            if not variable or axis not in AXES:
                raise InputError(
                    f"{option}: write the axis first, luff.orifice=1.5; the axes are "
                    f"{', '.join(AXES)}."
                )
            powers_of(variable)  # refuses an unknown one
            factor = number_of(option, text)
            crane = with_design_change(crane, axis, {variable: factor})
            changes.append(f"{axis} {variable} ×{factor:g}")
        return {", ".join(changes): crane} if changes else {}


def control_of(text: str) -> Control | None:
    """A controller of a text such as ``zv-tip+feedback=0.2+clip``; None if it is empty."""
    from swashplate.crane import control

    kinds: dict[str, tuple[Any, int]] = {
        "feedback": (control.DelayedFeedback, 2),
        "ship": (control.ShipCompensation, 0),
        "clip": (control.Clip, 1),
        "loop": (control.PositionLoop, 1),
        "sensors": (_sensors, 3),
        "crew": (control.Crew, 4),
    }
    for shape in control.IMPULSES:
        kinds[f"{shape}-tip"] = (partial(control.TipShaper, shape), 0)
    stages: list[Control] = []
    for stage in filter(None, text.split("+")):
        name, _, values = stage.partition("=")
        numbers = [
            number_of(f"The control '{stage}'", value) for value in values.split("/") if values
        ]
        kind, most_numbers = kinds.get(name, (None, 0))
        if kind is None or len(numbers) > most_numbers:
            raise InputError(
                f"There is no control '{stage}'; there are zv-tip (zvd, ei), "
                "feedback=0.2/0.25, ship, clip=0.25, loop=0.7, sensors=0.1/0.05/50 and "
                "crew=0.3/0.5/0.3/0.8."
            )
        stages.append(kind(*numbers))
    return control.Chain(tuple(stages)) if stages else None


def variant_of(text: str) -> dict[str, Any]:
    """Options of a run of a text such as ``inverse:zv-tip``: drives and control."""
    drives, _, controller = text.partition(":")
    actuation = "inverse" if drives == "identified" else drives
    return {"control": control_of(controller), "actuation": actuation}


def _sensors(noise_deg: float = 0.1, delay: float = 0.05, rate: float = 50.0) -> Control:
    """Sensors by the noise of the rope's angle [deg], delay [s] and rate [Hz]."""
    from swashplate.crane.control import Sensors

    return Sensors(rope_angle_noise_deg=noise_deg, delay=delay, rate=rate)


def _without_none(**options: Any) -> dict[str, Any]:
    """The options that are not None."""
    return {name: value for name, value in options.items() if value is not None}


def sea_sentences(seaway: Seaway | None) -> tuple[str, ...]:
    """Say how the simulated seaway differs from the requested one."""
    return () if seaway is None else seaway.sentences()


class _Sea(NamedTuple):
    sea: str | Spectrum
    """Name of a packaged sea, or its spectrum."""
    spread: bool
    """Whether its directions are spread."""


def _sea_of(text: str) -> _Sea:
    """A sea of a text such as ``ss3,spread`` or ``1.5,8,3.3``."""
    from swashplate.crane import Spectrum

    first, *rest = (word.strip() for word in text.split(","))
    spread = rest[-1:] == ["spread"]
    numbers = rest[:-1] if spread else rest
    if first[:1].isalpha():
        if numbers:
            options = zip(("--heading", "--seed"), numbers, strict=False)
            instead = " ".join(f"{option} {number}" for option, number in options)
            raise InputError(
                f"--sea {text}: the name of a sea takes no numbers; write --sea {first} {instead}."
            )
        return _Sea(first, spread)
    if not 1 <= len(numbers) <= 2:
        raise InputError(
            f"--sea {text}: write a name, --sea ss3, or significant height in m and peak period in "
            "s, --sea 1.5,8, with the peak factor, --sea 1.5,8,3.3."
        )
    height = number_of(f"--sea {text}", first)
    period = number_of(f"--sea {text}", numbers[0])
    if len(numbers) == 1:
        return _Sea(Spectrum(height, period), spread)
    peak_factor = number_of(f"--sea {text}", numbers[1])
    return _Sea(Spectrum(height, period, peak_factor), spread)


def _vector(option: str, text: str, example: str) -> tuple[float, ...]:
    """As many numbers, joined by commas, as an example has."""
    numbers = tuple(number_of(f"{option} {text}", word) for word in text.split(","))
    if len(numbers) != len(example.split(",")):
        raise InputError(f"{option} {text}: write {option} {example}.")
    return numbers


def named_numbers(
    option: str, assignments: list[str] | None, example: str, allowed: Sequence[str] = ()
) -> dict[str, Any]:
    """Numbers by name from an option's assignments; refuses a name that is not allowed."""
    pairs = pairs_of(option, assignments, example)
    unknown = [name for name, _ in pairs if allowed and name not in allowed]
    if unknown:
        raise InputError(f"{option} has no {unknown[0]}; it has {', '.join(allowed)}.")
    return {name: number_of(f"{option} {name}={text}", text) for name, text in pairs}


def number_of(option: str, text: str) -> float:
    """Parse a number; the error names the option if it is not a number."""
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{option}: '{text}' is not a number.") from None


def crane_of(name: str) -> Crane:
    """A packaged crane by its name, or the crane of a file."""
    from swashplate.crane import Crane

    return Crane.from_toml(name) if name.endswith(".toml") else Crane.preset(name)


def _refuse_unusable(crane: Crane) -> None:
    """Refuse a drive whose fit is not usable."""
    for axis, source in crane.sources.items():
        if not source.usable:
            raise InputError(
                f"{axis}={source.origin}: the verdict on the fit of this drive is "
                f"'{source.verdict.rstrip('.')}'; fit again until it is usable, as its report "
                f"advises, give another drive, or accept this one with --force."
            )
