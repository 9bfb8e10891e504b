"""What a simulation returns: every signal of the chain, computed when it is first asked for."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from enum import IntFlag
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.equations.marching.part import Stored
from swashplate.equations.marching.record import Record
from swashplate.equations.marching.run import Instance, Started, marched
from swashplate.errors import InputError
from swashplate.models.displacement_control import Pump
from swashplate.results import Tabular, figures

if TYPE_CHECKING:
    import polars
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
Flags = NDArray[np.uint8]
T = TypeVar("T", bound=np.generic)

SIGNALS = (
    "voltage",
    "current",
    "current_positive",
    "current_negative",
    "solenoid_force",
    "spool_position",
    "orifice_opening",
    "stroker_pressure",
    "swash_angle",
    "shaft_speed",
    "shaft_position",
)
"""Signals of a simulation in the order of the chain."""
MOTOR = ("motor_torque", "motor_pressure_drop")
OUTPUTS = ("current_sum", *SIGNALS[1:], *MOTOR)
"""Signals that can be observed, or returned and compared by a batch."""
KEPT = (
    Stored(0, "signals", "current_positive"),
    Stored(0, "signals", "current_negative"),
    Stored(1, "state", "pressure"),
    Stored(1, "signals", "shaft_speed"),
)
"""What a march leaves; for all else it is marched again when it is first asked for."""
INSIDE = ("solenoid_force", "spool_position", "orifice_opening", "swash_angle", *MOTOR)


class Limit(IntFlag):
    """What holds the drive back; several can act at once."""

    DEAD_ZONE = 1
    """The current is within the solenoids' dead zone: no force."""
    CURRENT_RATE = 2
    """A rate limit of the card sets the current."""
    ORIFICE = 4
    """The in-line orifice, not the spool, limits the flow, and the plate moves: the acceleration
    limit."""
    SPOOL = 8
    """The spool is at its stop."""
    SWASH_STOP = 16
    """The swash plate is at a stop: the speed limit."""
    RELIEF = 32
    """The relief valve holds the stroking pressure at ±Z15."""


def check_output(signal: str) -> None:
    """Refuse a signal that is none of `OUTPUTS`; states of the equations may stay at zero."""
    if signal not in OUTPUTS:
        raise InputError(f"A drive has no signal '{signal}'; it has {', '.join(OUTPUTS)}.")


def read_only(array: NDArray[T]) -> NDArray[T]:
    """A view that cannot be written to."""
    view = array.view()
    view.flags.writeable = False
    return view


class Named:
    """An attribute of a result by its name: an array, computed when it is first asked for."""

    def __init__(self, made: Callable[[Any, str], Array]) -> None:
        self._made = made

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, result: object | None, owner: type | None = None) -> Array:
        if result is None:
            return self  # type: ignore[return-value]  # the class's own attribute
        # an attribute of that name is found before this
        found = result.__dict__[self._name] = self._made(result, self._name)
        return found


def signal(run: Signals, name: str) -> Array:
    """A signal at the record's samples."""
    return run.sampled(run.fine(name))


@dataclass(frozen=True, eq=False)
class Signals(Tabular):
    """Signals over one record, read-only arrays of the record's length, all SI."""

    name: str
    """Name of the parameter set."""
    record: Record
    """The input on the march's grid."""

    @property
    @abstractmethod
    def names(self) -> tuple[str, ...]:
        """The signals that it has, in the order of the chain, behind ``"time"``."""

    def __getitem__(self, signal: str) -> Array:
        """A signal by its name, SI: ``run["shaft_speed"]``.

        Raises
        ------
        InputError
            If there is none of that name.
        """
        if signal not in self.names:
            near = get_close_matches(str(signal), self.names, 1)
            meant = f"did you mean {near[0]}? It" if near else "it"
            raise InputError(
                f"A run of {self.name} has no signal '{signal}': {meant} has "
                f"{', '.join(self.names)}."
            )
        found: Array = getattr(self, signal)
        return found

    @abstractmethod
    def fine(self, signal: str) -> Array:
        """A signal on the march's grid, `substeps` points a sample."""

    def sampled(self, fine: NDArray[T]) -> NDArray[T]:
        """Samples of the record out of the march's grid."""
        return read_only(np.ascontiguousarray(fine[:: self.record.substeps]))

    @cached_property
    def time(self) -> Array:
        """Time stamps. [s]"""
        return self.record.time

    def turned(self) -> Array:
        """Trapezoidal integral of the shaft's speed on the march's grid, zero at the start."""
        speed = self.fine("shaft_speed")
        angle = np.zeros_like(speed)
        np.cumsum(0.5 * self.record.step * (speed[:-1] + speed[1:]), out=angle[1:])
        return angle


@dataclass(frozen=True, eq=False)
class Simulation(Signals):
    """Signals of one simulated record, read-only arrays of the record's length, all SI.

    Signs: positive voltage, current, force, opening, angle and speed go together; positive speed
    hoists, slews right, lifts the boom. The record is a voltage, or without a card a current.
    """

    instance: Instance = field(repr=False)
    """The model with its numbers."""
    driven_by: str
    """``"voltage"`` or ``"current"``."""
    started: Started = field(repr=False)
    """Where it began."""
    out: Array = field(repr=False)
    """`KEPT` on the march's grid."""
    measured: Mapping[str, Array] = field(default_factory=dict, repr=False)
    """Further inputs that were given as signals, on the march's grid."""

    def __repr__(self) -> str:
        samples = (self.record.values.size - 1) // self.record.substeps + 1
        return f"Simulation({self.name!r}, {samples} samples at {self.record.rate:g} Hz)"

    @property
    def names(self) -> tuple[str, ...]:
        """The signals that it has: `SIGNALS`, with refinements the motor's, behind ``"time"``."""
        there = SIGNALS if self.driven_by_voltage else SIGNALS[1:]
        motor = MOTOR if self.pump.motor_constant > 0.0 else MOTOR[:1] if self.refined else ()
        return ("time", *there, *motor)

    @property
    def driven_by_voltage(self) -> bool:
        """Whether the record is a voltage that went through the card."""
        return self.driven_by == "voltage"

    @property
    def pump(self) -> Pump:
        """Numbers of pump and motor."""
        made: Pump = self.instance.parts[1].p
        return made

    @property
    def refined(self) -> bool:
        """Whether an option beyond Kruse's equations is on, or the motor's constant known."""
        options = self.instance.parts[1].options
        names = ("friction", "hysteresis", "ripple", "damping", "leakage", "line")
        known = self.pump.motor_constant > 0.0
        return known or any(getattr(options, name) is not None for name in names)

    @cached_property
    def voltage(self) -> Array | None:
        """Command, None where a current was given instead. [V]"""
        return self.sampled(self.record.values) if self.driven_by_voltage else None

    @cached_property
    def _fine(self) -> dict[str, Array]:
        """Signals on the march's grid, as far as they were asked for."""
        names = ("current_positive", "current_negative", "stroker_pressure", "shaft_speed")
        return dict(zip(names, self.out, strict=True))

    @cached_property
    def _limits(self) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """Limits of card and pump on the march's grid, bits of each."""
        parts = self.instance.model.parts
        wanted = [Stored(1, "signals", name) for name in INSIDE]
        wanted += [Stored(i, "limits") for i in (0, 1) if parts[i].limits is not None]
        records = {self.driven_by: self.record.values, **self.measured}
        step, begun = self.record.step, self.started
        out = marched(self.instance, records, step, begun, tuple(wanted), self.driven_by)
        self._fine.update(zip(INSIDE, out, strict=False))
        *card, pump = out[len(INSIDE) :].astype(np.uint8)
        return card[0] if card else np.zeros_like(pump), pump

    def fine(self, signal: str) -> Array:
        """A signal on the march's grid, `substeps` points a sample.

        Parameters
        ----------
        signal : str
            One of `SIGNALS` from the current on, of the pump's further signals, or
            ``"current_sum"``.
        """
        found = self._fine
        if signal not in found:
            plus, minus = found["current_positive"], found["current_negative"]
            if signal == "current":
                found[signal] = plus - minus if self.driven_by_voltage else self.record.values
            elif signal == "current_sum":
                found[signal] = plus + minus
            elif signal == "shaft_position":
                found[signal] = self.turned()
            else:
                _ = self._limits
        return found[signal]

    current_positive = Named(signal)
    """Current of the solenoid towards positive speed, never negative. [A]"""
    current_negative = Named(signal)
    """Current of the other solenoid, never negative. [A]"""
    current = Named(signal)
    """Signed current, positive less negative; an ammeter reads the sum of both. [A]"""
    solenoid_force = Named(signal)
    """Net force of both solenoids on the spool. [N]"""
    spool_position = Named(signal)
    """Displacement of the spool, within its stroke. [m]"""
    orifice_opening = Named(signal)
    """Effective opening, what the orifices leave of the spool's displacement. [m]"""
    stroker_pressure = Named(signal)
    """Stroking pressure δP about its equilibrium. [Pa]"""
    swash_angle = Named(signal)
    """Angle of the swash plate. [rad]"""
    shaft_speed = Named(signal)
    """Speed of the shaft, of the turret for slew. [rad/s]"""
    shaft_position = Named(signal)
    """Trapezoidal integral of the speed on the march's grid, zero at the start. [rad]"""
    motor_torque = Named(signal)
    """Torque that the motor bears, positive where it drives towards positive speed. [N m]"""

    @cached_property
    def motor_pressure_drop(self) -> Array | None:
        """P_hi - P_lo over the motor, None where no motor_constant is given. [Pa]"""
        known = self.pump.motor_constant > 0.0
        return self.sampled(self.fine("motor_pressure_drop")) if known else None

    @cached_property
    def limits(self) -> Flags:
        """Limits that act at each sample, bits of `Limit`."""
        # the pump's limits in their order, with the card's between the first and the second
        card, pump = self._limits
        bits = (pump & 1) | ((pump & 0b11110) << 1) | (card << 1)
        return self.sampled(bits.astype(np.uint8))

    def active(self, limit: Limit | str) -> NDArray[np.bool_]:
        """Samples at which a limit, or any of several, acts; also by name, ``"orifice"``.

        Raises
        ------
        InputError
            If there is no such limit.
        """
        if isinstance(limit, str):
            names = {str(each.name).lower(): each for each in Limit}
            if limit.lower() not in names:
                raise InputError(f"There is no limit '{limit}'; there are {', '.join(names)}.")
            limit = names[limit.lower()]
        return np.asarray((self.limits & int(limit)) != 0)

    def rate_limited(self) -> NDArray[np.bool_]:
        """Points of the march's grid at which a rate limit of the card sets a current."""
        return np.asarray(self._limits[0] > 0)

    def at(self, time: ArrayLike, signal: str) -> Array:
        """A signal at other time stamps, by linear interpolation.

        Parameters
        ----------
        time : (m,) array_like
            Time stamps; outside the record its first or last value is held. [s]
        signal : str
            One of `SIGNALS`.
        """
        stamps = np.asarray(time, dtype=np.float64)
        return np.asarray(np.interp(stamps, self.time, getattr(self, signal)))

    def to_polars(self) -> polars.DataFrame:
        """Table of time, all signals and a true/false column for each limit.

        With refinements the motor's torque and, if known, its pressure drop follow.
        """
        import polars as pl

        chain = [name for name in self.names if name not in MOTOR]
        columns: dict[str, NDArray[np.generic]] = {name: self[name] for name in chain}
        for limit in Limit:
            columns[f"limit_{str(limit.name).lower()}"] = self.active(limit)
        return pl.DataFrame(columns | {name: self[name] for name in self.names if name in MOTOR})

    def plot(
        self,
        signals: Sequence[str] = (),
        *,
        ax: Axes | Sequence[Axes] | None = None,
        label: str = "",
        **how: Any,
    ) -> Figure:
        """Figure of the chain with its active limits shaded, or of some signals alone.

        Parameters
        ----------
        signals : sequence of str
            Names as of `names`, a panel each; by default the chain.
        ax : matplotlib axes or sequence of them, optional
            Where to draw the signals, one for each.
        label : str
            Of the curves, for a legend.
        **how :
            Without signals as of `swashplate.report.figures.plot_simulation`.
        """
        if isinstance(signals, str):
            signals = (signals,)
        if signals or ax is not None:
            chosen = signals or ("shaft_speed",)
            return cast("Figure", figures().plot_signals(self, chosen, ax=ax, label=label))
        return cast("Figure", figures().plot_simulation(self, **how))
