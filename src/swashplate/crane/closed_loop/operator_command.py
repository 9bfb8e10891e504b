"""Commands of the operator over time, as fractions of each drive's full speed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import cos, radians, sin

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.crane.axes import AXES, check_names
from swashplate.crane.crane import Crane
from swashplate.crane.kinematics import Boom, Home, luff_rope
from swashplate.errors import InputError
from swashplate.results import Result

Array = NDArray[np.float64]

LONGEST = 86_400.0
"""A day, longer than any run. [s]"""
TARGETS = {"hoist": "rope_m", "slew": "slew_deg", "luff": "boom_deg"}
"""Name of the target of each axis: rope below the tip, slew, elevation of the boom."""


@dataclass(frozen=True, eq=False)
class OperatorCommand(Result):
    """Commands of hoist, slew and luff, each from -1 to 1.

    Positive ones hoist, slew to starboard, lift the boom. Made by `trapezoid`, `record`, `rest`.

    Examples
    --------
    >>> from swashplate.crane import OperatorCommand
    >>> OperatorCommand.trapezoid(hoist=0.5, duration=10.0)
    OperatorCommand(length=60, start=1, ramp=0.5, parts={hoist}, until={}, duration=10, rate=512)
    """

    length: float
    """[s]"""
    start: float = 0.0
    ramp: float = 0.0
    parts: Mapping[str, float] = field(default_factory=dict)
    """Part of the full speed of each axis that moves."""
    until: Mapping[str, float] = field(default_factory=dict)
    """Targets by their names; of other axes `duration` counts."""
    duration: float | None = None
    samples: Array | None = field(default=None, repr=False)
    """(n, 3) commands at `rate`, in place of trapezoids."""
    rate: float = 512.0

    @classmethod
    def trapezoid(
        cls,
        *,
        hoist: float = 0.0,
        slew: float = 0.0,
        luff: float = 0.0,
        until: Mapping[str, float] | None = None,
        duration: float | None = None,
        start: float = 1.0,
        ramp: float = 0.5,
        length: float = 60.0,
    ) -> OperatorCommand:
        """Trapezoids of all axes from one moment on.

        Parameters
        ----------
        hoist, slew, luff : float
            Part of the full speed, -1 to 1; its sign is that of the direction.
        until : mapping of str to float, optional
            Where an ideal drive would end: ``slew_deg`` from forward, ``boom_deg``, ``rope_m``,
            with what the luff pays out; each needs the command of its axis.
        duration : float, optional
            Of an axis without target. [s]
        start, ramp, length : float
            Moment of the first ramp, time of each ramp, length of the record, at most a day. [s]

        Returns
        -------
        OperatorCommand
            Sampled when a run begins: how long an axis moves depends on the crane.

        Raises
        ------
        InputError
            For a part beyond -1 to 1, a target without a command of its axis, a command without
            target or duration, or times out of their range.

        Examples
        --------
        >>> from swashplate.crane import OperatorCommand
        >>> command = OperatorCommand.trapezoid(slew=1.0, until={"slew_deg": 45.0})
        >>> command.length
        60.0
        """
        parts = {"hoist": hoist, "slew": slew, "luff": luff}
        targets = dict(until or {})
        check_names("There is no target", targets, TARGETS.values())
        for axis, part in parts.items():
            target = TARGETS[axis]
            if not -1.0 <= part <= 1.0:
                raise InputError(f"The stick of the {axis} is {part:g}, but must be from -1 to 1.")
            if part == 0.0 and target in targets:
                raise InputError(f"There is a target {target}, but no command {axis}.")
            if part != 0.0 and target not in targets and duration is None:
                raise InputError(
                    f"The {axis} needs until={{'{target}': ...}} or a duration, so that the stick "
                    "returns."
                )
        if not (start >= 0.0 and ramp > 0.0 and 0.0 < length <= LONGEST):
            raise InputError(
                "A stick needs a start of 0 s or later, ramps above 0 s, and a length above 0 and "
                f"at most {LONGEST:g} s, not {start:g}, {ramp:g} and {length:g} s."
            )
        moving = {axis: part for axis, part in parts.items() if part != 0.0}
        return cls(length, start, ramp, moving, targets, duration)

    @classmethod
    def record(cls, commands: ArrayLike, rate: float = 512.0) -> OperatorCommand:
        """Commands as they were recorded, straight between samples.

        Parameters
        ----------
        commands : (n, 3) array_like
            Of hoist, slew and luff, -1 to 1; two rows or more.
        rate : float
            Samples a second. [Hz]

        Returns
        -------
        OperatorCommand
            As long as the record.

        Raises
        ------
        InputError
            For another shape, a number beyond -1 to 1, a rate that is not positive, or a record
            longer than a day.

        Examples
        --------
        >>> import numpy as np
        >>> from swashplate.crane import OperatorCommand
        >>> OperatorCommand.record(np.zeros((513, 3)), rate=512.0).length
        1.0
        """
        samples = np.array(commands, dtype=np.float64)
        if samples.ndim != 2 or samples.shape[1] != 3 or len(samples) < 2 or not rate > 0.0:
            raise InputError(
                "A recorded stick has two or more rows of hoist, slew and luff, at a rate above "
                "0 Hz."
            )
        length = (len(samples) - 1) / rate
        if not length <= LONGEST:
            raise InputError(
                f"The recorded stick lasts {length:g} s at {rate:g} Hz, but a run at most "
                f"{LONGEST:g} s: check its rate."
            )
        wrong = np.flatnonzero(~(np.abs(samples) <= 1.0).all(axis=1))
        if wrong.size:
            raise InputError(f"Row {wrong[0]} of the stick is not within -1 to 1 on every axis.")
        samples.flags.writeable = False
        return cls(length, samples=samples, rate=float(rate))

    @classmethod
    def rest(cls, length: float = 60.0) -> OperatorCommand:
        """Nothing: the stick stays at zero.

        Parameters
        ----------
        length : float
            How long, at most a day. [s]

        Returns
        -------
        OperatorCommand
            Zero on all axes.

        Raises
        ------
        InputError
            For a length that is not positive, or longer than a day.

        Examples
        --------
        >>> from swashplate.crane import OperatorCommand
        >>> OperatorCommand.rest(10.0).length
        10.0
        """
        return cls.trapezoid(length=length)

    def sample(self, crane: Crane, home: Home, rate: float) -> tuple[Array, float]:
        """Commands for a crane that starts at its home.

        Parameters
        ----------
        crane : Crane
            Whose full speeds and lengths count.
        home : Home
            Where the run starts, as of `Crane.home`.
        rate : float
            Samples a second. [Hz]

        Returns
        -------
        (n, 3) array
            Of hoist, slew and luff, -1 to 1.
        float
            When the last command ends. [s]

        Raises
        ------
        InputError
            If a command does not end within the record, or leads away from its target.

        Examples
        --------
        >>> from swashplate.crane import Crane, OperatorCommand
        >>> crane = Crane.preset("tg3637")
        >>> command = OperatorCommand.trapezoid(slew=1.0, until={"slew_deg": 45.0})
        >>> commands, end = command.sample(crane, crane.home(), 512.0)
        >>> commands.shape
        (30721, 3)
        >>> round(end, 1)
        12.1
        """
        time = np.arange(round(self.length * rate) + 1) / rate
        if self.samples is not None:
            return self._recorded(self.samples, time)
        commands = np.zeros((time.size, 3))
        end = 0.0
        luff_angle = 0.0
        for axis in ("luff", "hoist", "slew"):  # what the luff pays out counts for the hoist
            if axis not in self.parts:
                continue
            part = self.parts[axis]
            low, high = crane.inverse(axis).limits
            speed = part * high if part > 0.0 else -part * low
            duration = self._duration(axis, speed, crane, home, luff_angle)
            if axis == "luff":
                luff_angle = speed * (duration - self.ramp)
            corners = self.start + np.array([0.0, self.ramp, duration - self.ramp, duration])
            commands[:, AXES.index(axis)] = np.interp(time, corners, [0.0, part, part, 0.0])
            end = max(end, self.start + duration)
        return commands, end

    def _recorded(self, samples: Array, time: Array) -> tuple[Array, float]:
        """Recorded commands at other times, and when the last of them ends. [s]"""
        recorded_at = np.arange(len(samples)) / self.rate
        columns = [np.interp(time, recorded_at, column) for column in samples.T]
        moving = np.flatnonzero(np.any(samples != 0.0, axis=1))
        end = float(recorded_at[moving[-1]]) if moving.size else 0.0
        return np.stack(columns, axis=1), end

    def _duration(
        self, axis: str, speed: float, crane: Crane, home: Home, luff_angle: float
    ) -> float:
        """Time from zero to zero of an axis's command, by its target or as it is given. [s]

        `speed` is that of an ideal drive [rad/s], `luff_angle` what the luff's shaft turns [rad].
        """
        duration = self.duration or 0.0
        target = TARGETS[axis]
        if target in self.until:
            angle = _angle_to(axis, self.until[target], crane, home, luff_angle)
            if angle * speed <= 0.0:
                raise InputError(
                    f"The {axis} moves away from {target} = {self.until[target]:g}, or is already "
                    "there: change the sign of its command or the target."
                )
            duration = angle / speed + self.ramp
        if duration < 2.0 * self.ramp:
            raise InputError(
                f"The {axis} moves for {duration:.3g} s, less than its two ramps of {self.ramp:g} "
                "s: use a smaller command or shorter ramps."
            )
        if self.start + duration > self.length:
            raise InputError(
                f"The stick of the {axis} ends at {self.start + duration:.4g} s, but the record at "
                f"{self.length:g} s: use a longer record."
            )
        return duration


def _angle_to(axis: str, target: float, crane: Crane, home: Home, luff_angle: float) -> float:
    """Angle of an axis's shaft from home to a target of `TARGETS`. [rad]"""
    g = crane.geometry
    if axis == "hoist":
        return (home.rope - target + g.coupling * g.luff * luff_angle) / g.hoist
    if axis == "slew":
        return radians(target) - home.slew
    boom = Boom(cos(radians(target)), sin(radians(target)))
    return float((home.luff_rope - luff_rope(boom, g)) / g.luff)
