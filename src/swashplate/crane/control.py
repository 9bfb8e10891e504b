"""Control of a crane: shapers, delayed feedback, ship compensation, limits, laws of one's own.

Each is a value; `|` combines them: ``TipShaper("zv") | DelayedFeedback(0.2) | Clip()``. In the
loop they act in one order, whatever order they are written in: joint shaper, path of the tip, tip
shaper, offsets of the tip (feedback, ship, own), clip, inverse kinematics, position loop.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import isfinite
from typing import Any, ClassVar, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.equations import Model
from swashplate.errors import InputError

Array = NDArray[np.float64]
Shaping = Literal["zv", "zvd", "ei"]
IMPULSES: dict[str, tuple[float, ...]] = {
    "zv": (0.5, 0.5),
    "zvd": (0.25, 0.5, 0.25),
    "ei": (0.2625, 0.475, 0.2625),
}
"""Impulses half a period of the load apart, undamped; EI leaves 5 % at the rope it is meant for and
stays below that over the widest range of ropes (Singhose, Seering and Singer 1994)."""

SEEN = (
    *("swing_x", "swing_y"),
    *("rope", "slew", "boom"),
    *("wanted_x", "wanted_y"),
    *("surge", "sway", "heave", "roll", "pitch", "yaw"),
)
"""What a law of one's own may take as inputs: load less tip, horizontal, inertial [m]; rope [m];
slew and boom [rad]; the operator's tip in the ship's frame, shaped [m]; the ship's motion [m],
[rad]."""
GIVES = ("tip_x", "tip_y")
"""Signals of a law of one's own: what is added to the wanted tip in the ship's frame. [m]"""


class Control:
    """One stage of control, or several; see the module's text."""

    kind: ClassVar[str] = ""

    @property
    def stages(self) -> tuple[Control, ...]:
        """Single stages."""
        return (self,)

    def __or__(self, other: Control) -> Chain:
        return Chain((*self.stages, *other.stages))


@dataclass(frozen=True, repr=False)
class Chain(Control):
    """Several stages, each kind at most once.

    Raises
    ------
    InputError
        If two of them do the same.
    """

    parts: tuple[Control, ...]

    def __post_init__(self) -> None:
        kinds = [each.kind for each in self.parts]
        twice = [each for each in kinds if kinds.count(each) > 1]
        if twice:
            raise InputError(f"A controller has one {twice[0]}, not {kinds.count(twice[0])}.")

    def __repr__(self) -> str:
        return " | ".join(map(repr, self.parts))

    @property
    def stages(self) -> tuple[Control, ...]:
        """Single stages."""
        return self.parts


@dataclass(frozen=True)
class _Shaper(Control):
    shape: Shaping = "zv"
    kind: ClassVar[str] = "shaper"

    def __post_init__(self) -> None:
        if self.shape not in get_args(Shaping):
            raise InputError(f"A shaper is 'zv', 'zvd' or 'ei', not '{self.shape}'.")

    @property
    def impulses(self) -> tuple[float, ...]:
        """Their sizes, half a period apart."""
        return IMPULSES[self.shape]


class JointShaper(_Shaper):
    """Shaper of the stick's commands, each impulse half a period of the present rope later.

    It keeps the way of each joint only while the rope keeps its length, and calm only while the
    joints move the tip along a line.
    """


class TipShaper(_Shaper):
    """Shaper of the path that the operator's commands give the tip in the deck's plane.

    Swing is linear in that path, so what cancels in it cancels in the swing, in a turn as well; and
    the path ends where the operator's ends, whatever the rope does.
    """


def _positive(name: str, value: float) -> None:
    if not (isfinite(value) and value > 0.0):
        raise InputError(f"{name} is {value:g}, but must be above 0.")


@dataclass(frozen=True)
class DelayedFeedback(Control):
    """Delayed position feedback (Masoud and Nayfeh): the tip follows the load of a moment ago.

    Attributes
    ----------
    gain : float
        k, part of the load's horizontal distance from the tip that is added to the wanted tip.
    delay : float
        τ in periods of the present rope. The damping ratio is about k/2 at 0.25.
    """

    gain: float = 0.2
    delay: float = 0.25
    kind: ClassVar[str] = "feedback"

    def __post_init__(self) -> None:
        _positive("The gain of delayed feedback", self.gain)
        if not 0.0 < self.delay <= 1.0:
            raise InputError(
                f"Delayed feedback waits for {self.delay:g} periods, but more than 0 and at most 1 "
                "are possible."
            )


def feedback_damping(gain: ArrayLike, delay: ArrayLike) -> Array:
    """Damping ratio that delayed position feedback gives the load on ideal drives.

    Parameters
    ----------
    gain, delay : array_like
        k, above 0 and below 1, and τ in periods of the load; ``gain[:, None]`` and ``delay`` make a
        map.

    Returns
    -------
    array
        ζ = -Re(s)/abs(s) of the rightmost root with abs(s) < 2 ω₀; negative where the swing grows.

    Raises
    ------
    InputError
        For a gain out of range, with 1 or more of which every delay is unstable, or a delay that is
        not above 0 and at most 1.

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
    k, tau = k[..., None], tau[..., None]
    real, imaginary = np.meshgrid(np.linspace(-1.5, 0.5, 9), np.linspace(0.2, 4.0, 20))
    s = np.broadcast_to((real + 1j * imaginary).ravel(), (*k.shape[:-1], real.size))
    with np.errstate(all="ignore"):
        for _ in range(30):
            late = k * np.exp(-s * tau)
            s = s - (s * s * (1.0 + late) + 1.0) / (2.0 * s * (1.0 + late) - s * s * tau * late)
        left = np.abs(s * s * (1.0 + k * np.exp(-s * tau)) + 1.0)
    right = np.where((left < 1e-9) & (s.imag > 1e-6) & (np.abs(s) < 2.0), s, -np.inf)
    first = np.take_along_axis(right, np.argmax(right.real, axis=-1)[..., None], axis=-1)[..., 0]
    return np.asarray(-first.real / np.abs(first))


@dataclass(frozen=True)
class ShipCompensation(Control):
    """Compensation of the ship's motion: the wanted tip keeps its place over the sea."""

    kind: ClassVar[str] = "ship compensation"


@dataclass(frozen=True)
class Clip(Control):
    """Limit of what control may add to the operator's tip.

    Attributes
    ----------
    size : float or "auto"
        Along the boom [m]; by default the largest sine of the load's frequency ω₀ that luff and
        slew can follow, min(v/ω₀, a/ω₀²) with their limits of speed v and acceleration a, times
        `share`.
    share : float
        Part of it that is used.

    Notes
    -----
    It is static, so that it has no phase: it can take authority from the controller, but never feed
    the swing.
    """

    size: float | Literal["auto"] = "auto"
    share: float = 0.8
    kind: ClassVar[str] = "clip"

    def __post_init__(self) -> None:
        if self.size != "auto":
            _positive("The size of a clip", self.size)
        _positive("The share of a clip", self.share)


@dataclass(frozen=True)
class PositionLoop(Control):
    """Loop that brings slew and luff back to the wanted path; 0.7 /s without one.

    Attributes
    ----------
    gain : float
        Speed added for each radian of a shaft's error. [1/s]
    """

    gain: float = 0.7
    kind: ClassVar[str] = "position loop"

    def __post_init__(self) -> None:
        _positive("The gain of a position loop", self.gain)


@dataclass(frozen=True)
class Law(Control):
    """A law of one's own: an offset of the wanted tip, as a model of the engine with its own state.

    Attributes
    ----------
    model : Model
        Its inputs are of `SEEN`, its signals or states among others `GIVES`.
    values : named tuple
        Of its parameters.
    """

    model: Model
    values: Any = field(default=())
    kind: ClassVar[str] = "law"

    def __post_init__(self) -> None:
        strange = [each for each in self.model.external if each not in SEEN]
        if strange:
            raise InputError(
                f"The law {self.model.name} asks for '{strange[0]}', but a crane's controller sees "
                f"{', '.join(SEEN)}."
            )
        lacks = [each for each in GIVES if each not in self.model.signal_names]
        if lacks:
            raise InputError(
                f"The law {self.model.name} must have the signals {' and '.join(GIVES)}, what is "
                f"added to the wanted tip; {lacks[0]} is missing."
            )


class Settings(NamedTuple):
    """Numbers of a controller, as the loop takes them."""

    joint: tuple[float, float, float] = (1.0, 0.0, 0.0)
    tip: tuple[float, float, float] = (1.0, 0.0, 0.0)
    path: bool = False
    """Whether the tip's path is controlled, not only the stick's commands."""
    gain: float = 0.7
    feedback: float = 0.0
    delay: float = 0.25
    ship: bool = False
    clip: float = 0.0
    """[m]; 0: from the limits, by `share`; no clip if that is 0, too."""
    share: float = 0.0


def settings_of(control: Control | None) -> tuple[Settings, Law | None, int]:
    """Numbers of a controller, its law, and how many half periods its shaper takes."""
    made, law, halves = Settings(), None, 0
    for each in control.stages if control is not None else ():
        if isinstance(each, _Shaper):
            first, second, *third = each.impulses
            impulses = (first, second, third[0] if third else 0.0)
            halves = len(each.impulses) - 1
            joint = isinstance(each, JointShaper)
            made = made._replace(joint=impulses) if joint else made._replace(tip=impulses)
        elif isinstance(each, DelayedFeedback):
            made = made._replace(feedback=each.gain, delay=each.delay)
        elif isinstance(each, ShipCompensation):
            made = made._replace(ship=True)
        elif isinstance(each, Clip):
            size = 0.0 if each.size == "auto" else each.size
            made = made._replace(clip=float(size), share=each.share)
        elif isinstance(each, PositionLoop):
            made = made._replace(gain=each.gain)
        elif isinstance(each, Law):
            law = each
        else:
            raise InputError(f"{each!r} is no stage of a crane's control.")
        made = made._replace(path=made.path or not isinstance(each, JointShaper))
    return made, law, halves
