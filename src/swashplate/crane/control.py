"""Control of a crane: shaper, delayed feedback, ship compensation, limits, user-defined stages.

Each is a value; `|` combines them: ``TipShaper("zv") | DelayedFeedback(0.2) | Clip()``. In the
loop they act in one order, whatever order they are written in: path of the tip, tip shaper, offsets
of the tip (feedback, ship, user-defined), clip, inverse kinematics, position loop. Every stage
works on the path of the tip, and brings a position loop of 0.7 /s with it, by which the shafts
follow that path; `PositionLoop` sets another gain. A `Crew` is no such stage: its hand is at the
joysticks, before all others. `Sensors` says how well control sees the crane; without sensors it
sees the true signals. For controllers that are designed outside the package `swashplate.linearize`
takes the crane as a machine, `swashplate.crane.plant`, or its `body` alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians
from numbers import Real
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.crane.axes import RATE
from swashplate.crane.stages.crew import HumanOperator
from swashplate.crane.stages.seeing import Sensing
from swashplate.errors import InputError
from swashplate.machine import Model

Array = NDArray[np.float64]
Impulses = tuple[float, float, float]
Shaping = Literal["zv", "zvd", "ei"]
IMPULSES: dict[Shaping, Impulses] = {
    "zv": (0.5, 0.5, 0.0),
    "zvd": (0.25, 0.5, 0.25),
    "ei": (0.2625, 0.475, 0.2625),
}
"""Impulses half a period of the load apart, undamped; EI leaves 5 % at the rope it is meant for and
stays below that over the widest range of ropes (Singhose, Seering and Singer 1994)."""

SEEN = (
    *("swing_x", "swing_y"),
    *("rope", "slew", "boom"),
    *("reference_x", "reference_y"),
    *("surge", "sway", "heave", "roll", "pitch", "yaw"),
)
"""Signals that a user-defined controller may take as inputs: load less tip, horizontal, inertial
[m]; rope [m]; slew and boom [rad]; the operator's tip in the ship's frame, shaped [m]; the ship's
motion [m], [rad]."""
SENSED = (
    ("rope_angle_noise_deg", 0.0, 10.0),
    ("motion_noise_deg", 0.0, 10.0),
    ("delay", 0.0, 5.0),
    ("rate", 1.0, RATE),
)
"""Plausible ranges of the numbers of sensors."""
HUMAN = (
    ("delay", 0.0, 10.0),
    ("threshold_deg", 0.0, 30.0),
    ("gain", 0.001, 10.0),
    ("share", 0.001, 10.0),
    ("lag", 0.01, 10.0),
    ("return_time", 1.0, 1000.0),
)
"""Plausible ranges of the numbers of a crew."""
GIVES = ("tip_x", "tip_y")
"""Signals of a user-defined controller: what it adds to the reference tip, ship's frame. [m]"""


class Settings(NamedTuple):
    """Numbers of a controller, as the loop takes them."""

    tip: Impulses = (1.0, 0.0, 0.0)
    path: bool = False
    """Whether the tip's path is controlled, not only the stick's commands."""
    gain: float = 0.7
    """Of the position loop. [1/s]"""
    feedback: float = 0.0
    delay: float = 0.25
    ship: bool = False
    clip: float = 0.0
    """[m]; 0: from the limits, by `share`; no clip if that is 0, too."""
    share: float = 0.0
    sensing: Sensing | None = None
    crew: HumanOperator | None = None


class Control:
    """One stage of control, or several; see the module's text."""

    kind: ClassVar[str] = ""
    largest: ClassVar[Mapping[str, float]] = {}
    """Largest plausible value of each number, all of which are above 0."""

    def __post_init__(self) -> None:
        for name, most in self.largest.items():
            value = getattr(self, name)
            if value == "auto":
                continue
            if not (isinstance(value, Real) and 0.0 < float(value) <= most):
                raise InputError(
                    f"The {name} of {self.kind} is {value!r}, but must be a number above 0 and at "
                    f"most {most:g}."
                )

    def __or__(self, other: Control) -> Chain:
        return Chain((*self.stages, *other.stages))

    @property
    def stages(self) -> tuple[Control, ...]:
        """Single stages."""
        return (self,)

    def description(self) -> str:
        """Description with numbers: ``"delayed feedback of 0.2 at 0.25 periods"``."""
        return self.kind


@dataclass(frozen=True, repr=False)
class Chain(Control):
    """Several stages, each kind at most once; an `InputError` if two of them do the same."""

    parts: tuple[Control, ...]

    def __post_init__(self) -> None:
        kinds = [stage.kind for stage in self.parts]
        repeated = [kind for kind in kinds if kinds.count(kind) > 1]
        if repeated:
            raise InputError(f"A controller has one {repeated[0]}, not {kinds.count(repeated[0])}.")

    def __repr__(self) -> str:
        return " | ".join(map(repr, self.parts))

    def description(self) -> str:
        """All stages."""
        return ", ".join(stage.description() for stage in self.parts)

    @property
    def stages(self) -> tuple[Control, ...]:
        """Single stages."""
        return self.parts


@dataclass(frozen=True)
class TipShaper(Control):
    """Shaper of the path that the operator's commands give the tip in the deck's plane.

    Each impulse comes half a period of the present rope later. Swing is linear in that path, so
    what cancels in it cancels in the swing, in a turn as well; and the path ends where the
    operator's ends, whatever the rope does.

    Parameters
    ----------
    shape : {"zv", "zvd", "ei"}
        Impulses of the shaper.

    Raises
    ------
    InputError
        For another shape.

    Examples
    --------
    >>> from swashplate.crane import control
    >>> control.TipShaper("zvd").description()
    "shaper zvd of the tip's path"
    """

    shape: Shaping = "zv"
    kind = "shaper"

    def __post_init__(self) -> None:
        if self.shape not in IMPULSES:
            raise InputError(f"A shaper is 'zv', 'zvd' or 'ei', not '{self.shape}'.")

    def description(self) -> str:
        """Its shape."""
        return f"{self.kind} {self.shape} of the tip's path"


@dataclass(frozen=True)
class DelayedFeedback(Control):
    """Delayed position feedback (Masoud and Nayfeh): the tip follows the load of a moment ago.

    It comes with a position loop of 0.7 /s, see `PositionLoop`.

    Examples
    --------
    >>> from swashplate.crane import control
    >>> control.DelayedFeedback(gain=0.2, delay=0.25).description()
    'delayed feedback of 0.2 at 0.25 periods'
    """

    gain: float = 0.2
    """k, part of the load's horizontal distance from the tip that is added to the reference tip; at
    most 2, and unstable from 1 on."""
    delay: float = 0.25
    """τ in periods of the present rope, at most 1. The damping ratio is about k/2 at 0.25."""
    kind = "delayed feedback"
    largest: ClassVar[Mapping[str, float]] = {"gain": 2.0, "delay": 1.0}

    def description(self) -> str:
        """Gain and delay."""
        return f"{self.kind} of {self.gain:g} at {self.delay:g} periods"


@dataclass(frozen=True)
class ShipCompensation(Control):
    """Compensation of the ship's motion: the reference tip keeps its place over the sea.

    Examples
    --------
    >>> from swashplate.crane import Crane, OperatorCommand, control, simulate
    >>> crane, command = Crane.preset("tg3637"), OperatorCommand.rest(5.0)
    >>> run = simulate(crane, command, control=control.ShipCompensation())
    >>> round(run.residual_deg, 3)
    0.0
    """

    kind = "ship compensation"


@dataclass(frozen=True)
class Clip(Control):
    """Limit of what control may add to the operator's tip.

    It is static, so that it has no phase: it can take authority from the controller, but never feed
    the swing. Alone it still makes the path of the tip controlled, by a position loop of 0.7 /s.

    Examples
    --------
    >>> from swashplate.crane import control
    >>> feedback = control.DelayedFeedback() | control.Clip(1.5)
    >>> control.Clip(1.5).description()
    'a clip of 1.5 m'
    """

    size: float | Literal["auto"] = "auto"
    """Along the boom [m]; by default the largest sine of the load's frequency ω₀ that luff and slew
    can follow, min(v/ω₀, a/ω₀²) with their limits of speed v and acceleration a, times `share`. At
    most 100 m."""
    share: float = 0.8
    """Part of it that is used, at most 10."""
    kind = "a clip"
    largest: ClassVar[Mapping[str, float]] = {"size": 100.0, "share": 10.0}

    def description(self) -> str:
        """Its size, or the share of what slew and luff can follow."""
        if self.size == "auto":
            return f"{self.kind} at {self.share:g} of what slew and luff can follow"
        return f"{self.kind} of {self.size:g} m"


@dataclass(frozen=True)
class PositionLoop(Control):
    """Loop that brings slew and luff back to the reference path.

    It belongs to every control of the tip; without this stage its gain is 0.7 /s.
    """

    gain: float = 0.7
    """Speed added for each radian of a shaft's error, at most 50. [1/s]"""
    kind = "position loop"
    largest: ClassVar[Mapping[str, float]] = {"gain": 50.0}

    def description(self) -> str:
        """Its gain."""
        return f"{self.kind} of {self.gain:g} /s"


@dataclass(frozen=True)
class Sensors(Control):
    """Sensors through which control sees the crane: noise, delay and samples of the signals.

    Delayed feedback, ship compensation and a user-defined controller take the rope's direction, the
    rope's length, slew, boom and the ship's motion from them. A measurement holds until the next
    one; before the start it is that of the start. Noise is white, drawn again for each measurement.
    The run itself keeps the true signals. The default values are assumed, not those of a certain
    product.

    Examples
    --------
    >>> from swashplate.crane import control
    >>> control.PositionLoop(0.5) | control.Sensors(delay=0.1)
    PositionLoop(gain=0.5) | Sensors(rope_angle_noise_deg=0.1, ..., delay=0.1, rate=50.0, seed=0)
    """

    rope_angle_noise_deg: float = 0.1
    """Root mean square noise of the rope's direction in each of both horizontal axes, at most 10;
    assumed. [deg]"""
    motion_noise_deg: float = 0.05
    """Root mean square noise of roll and of pitch, at most 10; assumed. [deg]"""
    delay: float = 0.05
    """Time from a measurement until control has it, at most 5; assumed. [s]"""
    rate: float = 50.0
    """Measurements a second, 1 to 512; assumed. [Hz]"""
    seed: int = 0
    """Of the noise: the same for the same seed."""
    kind = "set of sensors"

    def description(self) -> str:
        """Noise, delay and rate."""
        return (
            f"sensors with {self.rope_angle_noise_deg:g} deg of noise, {self.delay:g} s late, at "
            f"{self.rate:g} Hz"
        )

    def __post_init__(self) -> None:
        for name, least, most in SENSED:
            value = getattr(self, name)
            if not (isinstance(value, Real) and least <= float(value) <= most):
                raise InputError(
                    f"The {name} of sensors is {value!r}, but must be a number from {least:g} to "
                    f"{most:g}."
                )
        if type(self.seed) is not int or self.seed < 0:
            raise InputError(
                f"The seed of sensors is {self.seed!r}, but must be a whole number of at least 0."
            )

    def sensing(self) -> Sensing:
        """As the loop takes it."""
        return Sensing(
            rate=float(self.rate) / RATE,
            delay=float(self.delay) * RATE,
            rope_angle=radians(self.rope_angle_noise_deg),
            motion=radians(self.motion_noise_deg),
            longest=float(self.delay) + 1.0 / float(self.rate) + 4.0 / RATE,
        )


@dataclass(frozen=True)
class Crew(Control):
    """An operator who damps the swing by hand: drives the tip over the load as it swings out.

    The hand is at the joysticks, in addition to the command; it cannot move the tip faster than the
    drives. The operator sees the swing from a cab that rolls with the ship, knows nothing of the
    ship's motion, and sees without `Sensors`. `swashplate.crane.stages.crew` has the equations.

    No number was measured on a crane's operator: all are assumed. Delay and lag are like those of
    people at a joystick who track a target on a screen (0.23 and 0.32 s, 9.6 and 12 rad/s, as
    models of the library ManualTracking have them); the threshold is far above the 0.05 deg/s from
    which people see motion in the laboratory (Pasternak and Merigan 1980), which is a swing of 0.1
    deg on 27 m of rope, seen from 40 m.

    Examples
    --------
    >>> from swashplate.crane import control
    >>> control.Crew(delay=0.4).description()
    'a crew that is 0.4 s late, sees swing from 0.5 deg on, and answers it with 0.3 /s, at ...'
    """

    delay: float = 0.3
    """Time from eye to hand, at most 10; assumed. [s]"""
    threshold_deg: float = 0.5
    """Swing that the operator does not answer, at most 30; assumed. [deg]"""
    gain: float = 0.3
    """Speed of the tip for each metre of swing, at most 10; assumed. [1/s]"""
    share: float = 0.8
    """Part that is used of the speed min(v, a/ω₀) that slew and luff can follow at the load's
    period, as of somebody who knows this crane, at most 10; assumed. 10 is the stick's whole travel
    on most cranes."""
    lag: float = 0.1
    """Time constant of arm and hand, 0.01 to 10; assumed. [s]"""
    return_time: float = 30.0
    """Time constant with which the operator brings the tip back to the place that the command gives
    it, and takes what hangs out for rest, 1 to 1000; assumed. [s]"""
    kind = "crew"

    def __post_init__(self) -> None:
        for name, least, most in HUMAN:
            value = getattr(self, name)
            if not (isinstance(value, Real) and least <= float(value) <= most):
                raise InputError(
                    f"The {name} of a crew is {value!r}, but must be a number from {least:g} to "
                    f"{most:g}."
                )

    def description(self) -> str:
        """Its delay, threshold, gain and share."""
        return (
            f"a crew that is {self.delay:g} s late, sees swing from {self.threshold_deg:g} deg on, "
            f"and answers it with {self.gain:g} /s, at {self.share:g} of what slew and luff can "
            "follow"
        )

    def operator(self) -> HumanOperator:
        """As the loop takes it."""
        return HumanOperator(
            gain=float(self.gain),
            delay=round(self.delay * RATE) / RATE,
            threshold=radians(self.threshold_deg),
            share=float(self.share),
            lag=float(self.lag),
            return_time=float(self.return_time),
        )


@dataclass(frozen=True)
class Controller(Control):
    """User-defined controller: a model of the engine whose outputs offset the reference tip.

    The position loop acts in addition to it, at 0.7 /s unless a `PositionLoop` says otherwise.
    """

    model: Model
    """Its inputs are of `SEEN`, its signals or states among others `GIVES`."""
    values: Any = ()
    """Named tuple of its parameters."""
    kind = "user-defined controller"

    def description(self) -> str:
        """Its model's name."""
        return f"{self.kind} {self.model.name}"

    def __post_init__(self) -> None:
        unknown = [name for name in self.model.external if name not in SEEN]
        if unknown:
            raise InputError(
                f"The controller {self.model.name} needs '{unknown[0]}', but a crane's controller "
                f"has {', '.join(SEEN)}."
            )
        missing = [name for name in GIVES if name not in self.model.signal_names]
        if missing:
            raise InputError(
                f"The controller {self.model.name} must have the signals {' and '.join(GIVES)}, "
                f"which are added to the reference tip; {missing[0]} is missing."
            )


class Stages(NamedTuple):
    """Parts of a controller, as a run takes them."""

    settings: Settings
    controller: Controller | None
    sensors: Sensors | None


def stages_of(control: Control | None) -> Stages:
    """Numbers of the stages of control, the user-defined controller and the sensors among them."""
    if control is None:
        return Stages(Settings(), None, None)
    if not isinstance(control, Control):
        raise InputError(f"{control!r} is not a crane control; see swashplate.crane.control.")
    settings: dict[str, Any] = {
        "path": any(not isinstance(stage, Sensors | Crew) for stage in control.stages)
    }
    controller: Controller | None = None
    sensors: Sensors | None = None
    for stage in control.stages:
        match stage:
            case TipShaper():
                settings["tip"] = IMPULSES[stage.shape]
            case DelayedFeedback():
                settings["feedback"] = stage.gain
                settings["delay"] = stage.delay
            case ShipCompensation():
                settings["ship"] = True
            case Clip(size):
                settings["clip"] = 0.0 if size == "auto" else float(size)
                settings["share"] = stage.share
            case PositionLoop():
                settings["gain"] = stage.gain
            case Sensors():
                settings["sensing"] = stage.sensing()
                sensors = stage
            case Crew():
                settings["crew"] = stage.operator()
            case Controller():
                controller = stage
    return Stages(Settings(**settings), controller, sensors)


def feedback_damping(gain: ArrayLike, delay: ArrayLike) -> Array:
    """Damping ratio that delayed position feedback gives the load on ideal drives.

    Of gains k, above 0 and below 1, and delays τ in periods of the load; ``gain[:, None]`` and
    ``delay`` make a map. ζ = -Re(s)/abs(s) of the rightmost root with abs(s) < 2 ω₀ is negative
    where the swing grows. With a gain of 1 or more every delay is unstable: it is refused.

    Notes
    -----
    s² (1 + k e^(-sτ)) + ω₀² = 0; roots by Newton's method from a grid of starts. Those of higher
    frequency tend to Re s = ln k/τ, which is stable for k < 1.
    """
    k, tau = np.broadcast_arrays(np.asarray(gain, float), 2.0 * np.pi * np.asarray(delay, float))
    if not ((k > 0.0) & (k < 1.0)).all():
        raise InputError("The gain of delayed feedback must be above 0 and below 1.")
    if not ((tau > 0.0) & (tau <= 2.0 * np.pi)).all():
        raise InputError("Delayed feedback waits for more than 0 and at most 1 period.")
    k = k[..., None]
    tau = tau[..., None]
    real, imaginary = np.meshgrid(np.linspace(-1.5, 0.5, 9), np.linspace(0.2, 4.0, 20))
    s = np.broadcast_to((real + 1j * imaginary).ravel(), (*k.shape[:-1], real.size))
    with np.errstate(all="ignore"):
        for _ in range(30):
            late = k * np.exp(-s * tau)
            s = s - (s * s * (1.0 + late) + 1.0) / (2.0 * s * (1.0 + late) - s * s * tau * late)
        residual = np.abs(s * s * (1.0 + k * np.exp(-s * tau)) + 1.0)
    roots = np.where((residual < 1e-9) & (s.imag > 1e-6) & (np.abs(s) < 2.0), s, -np.inf)
    index = np.argmax(roots.real, axis=-1)[..., None]
    rightmost = np.take_along_axis(roots, index, axis=-1)[..., 0]
    return np.asarray(-rightmost.real / np.abs(rightmost))
