"""An experiment: one run of one axis, its input and what was measured, all in SI."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.recognition import UNNAMED, Recognised
from swashplate.campaign.schema import (
    Between,
    ChannelKind,
    InitialState,
    InputKind,
    Role,
    shown_unit,
)
from swashplate.errors import UnknownNameError, meant
from swashplate.results import Result, Tabular, figures
from swashplate.tables import UNIT, Column, Table

if TYPE_CHECKING:
    import polars

    from swashplate.machine.marching import Interpolation
    from swashplate.results import Figure

Array = NDArray[np.float64]

SUDDEN = 0.1
"""Change between two samples from which a command jumps, as a part of its range. [1]"""
LARGEST_NEIGHBOUR = 0.1
"""Largest change just before and just after a jump, as a part of the jump. [1]"""
LARGEST_CERTAIN_INTERVAL = 0.003
"""Largest interval of stamps within which a jump is taken as it is logged. [s]"""
JUMP_TIME = 3.0 / 512.0
"""Time that a jump takes in a simulation, three steps of the march. [s]"""
ROUNDED = 1e-6
"""Share of the largest input below which two levels are one. [1]"""
VARIED = 8
"""Changes of an encoder's steps from which their common divisor is the decoder's."""


class SignalOrigin(NamedTuple):
    """Origin of a signal: a log and its column."""

    file: Path
    column: str

    def __str__(self) -> str:
        return f"{self.file.name}: column '{self.column}'"


class CommandJump(NamedTuple):
    """A jump of a command between two samples, at an instant that was not logged."""

    row: int
    """Row of the last sample before it."""
    middle: float
    """Between both samples. [s]"""
    interval: float
    """Time between both samples. [s]"""


class Accuracy(NamedTuple):
    """Limits of an instrument's error, as a data sheet gives them."""

    gain: float = 0.0
    """Share of the reading. [1]"""
    zero: float = 0.0
    """In the signal's unit."""
    time: float | None = 0.0
    """Of its stamps against those of the other signals [s]; None: half the time between samples."""
    rounded: bool = True
    """Whether the steps of its converter are a further error; not if a zero is stated."""


ASSUMED_ACCURACY: Mapping[str, Accuracy] = MappingProxyType(
    {
        "voltage": Accuracy(0.0005, 0.001, None),
        "current": Accuracy(0.005, 0.0005, None),
        "other": Accuracy(time=None),
        "signed_current": Accuracy(0.005, 0.0005),
        "rectified_current": Accuracy(0.005, 0.0005),
        "current_plus": Accuracy(0.005, 0.0005),
        "current_minus": Accuracy(0.005, 0.0005),
        "shaft_speed": Accuracy(0.005),
        "position": Accuracy(0.001),
        "swash_angle": Accuracy(0.005),
        "stroker_pressure": Accuracy(0.005),
    }
)
"""What instruments may err by if a campaign file does not say so, by kind, SI: a logger of 14 to 16
bits over ±10 V after its calibration; shunts and closed-loop Hall transducers of class 0.5, zeroed
before the tests; tachogenerators; draw-wire sensors; transducers of class 0.5. Counts of an encoder
have no error of scale, and nothing is assumed of other kinds. A jump of an input lies somewhere
between two samples."""


class Encoder(NamedTuple):
    """Scale of an encoder's counts."""

    counts_per_turn: float
    """Counts per turn of the encoder's shaft, quadrature included."""
    gear_ratio: float
    """Turns of the encoder per turn of the axis's shaft."""
    sign: Literal[1, -1]
    """-1 if it counts down at positive speed."""
    rolls_over_at: int | None
    """Counts at which the counter wraps."""

    @property
    def angle_per_count(self) -> float:
        """Angle of the axis's shaft for one count, signed. [rad]"""
        return self.sign * 2.0 * np.pi / (self.counts_per_turn * self.gear_ratio)


@dataclass(frozen=True, eq=False)
class InputSignal(Result):
    """The input that drove the axis."""

    kind: InputKind
    """``"none"`` commands nothing and is 0 throughout."""
    unit: str
    """SI, or as written for the kind ``"other"``."""
    time: Array
    """(n,) stamps. [s]"""
    values: Array
    """(n,) samples, in `unit`."""
    interpolation: Between
    """What it is between two stamps: ``"jumps"`` is straight but for sudden changes, which come at
    once in the middle of both."""
    source: SignalOrigin
    limits: tuple[float, float] | None = None
    """Range of the instrument, in `unit`."""
    dropped: int = 0
    """Samples left out because they were missing."""
    settled: bool = True
    """Whether `interpolation` was stated, or found by a fit; if not, a fit finds it."""
    accuracy: Accuracy | None = None
    """As the campaign file states it."""

    @property
    def instrument(self) -> Accuracy:
        """Limits of the instrument's error: stated, or assumed of its kind."""
        return _instrument(self)

    @property
    def used(self) -> NDArray[np.bool_]:
        """(n,) whether a sample counts: all, because what is ignored is not read."""
        return np.ones(self.time.size, np.bool_)

    def joined(self, between: Between) -> InputSignal:
        """The signal joined in one way between its stamps, which is settled with that."""
        return replace(self, interpolation=between, settled=True)

    @property
    def is_held(self) -> bool:
        """Whether it stays at a sample until the next one."""
        return self.interpolation == "previous"

    @cached_property
    def jumps(self) -> NDArray[np.intp]:
        """(j,) indices of the last samples before sudden changes; it hardly moves next to these."""
        changes = np.abs(np.diff(self.values))
        padded = np.pad(changes, 1)
        larger_neighbours = np.maximum(padded[:-2], padded[2:])
        isolated = larger_neighbours < LARGEST_NEIGHBOUR * changes
        return np.flatnonzero((changes > SUDDEN * np.ptp(self.values)) & isolated)

    def with_jumps(self) -> InputSignal:
        """The signal with instantaneous jumps, midway between the samples before and after them.

        A straight line from sample to sample would pass a dead zone at its beginning, and the
        current's jump there would come up to half a sample too early.
        """
        rows = self.jumps
        middle = 0.5 * (self.time[rows] + self.time[rows + 1])
        instants = np.stack([np.nextafter(middle, -np.inf), middle], axis=1)
        levels = np.stack([self.values[rows], self.values[rows + 1]], axis=1)
        insert_at = np.repeat(rows + 1, 2)
        time = np.insert(self.time, insert_at, instants.ravel())
        values = np.insert(self.values, insert_at, levels.ravel())
        return replace(self, time=time, values=values)

    @cached_property
    def edges(self) -> tuple[CommandJump, ...]:
        """Jumps whose instants are uncertain, because the stamps around them are far apart.

        A command that is held has none: it jumps at a stamp.
        """
        if self.is_held:
            return ()
        intervals = np.diff(self.time)
        return tuple(
            CommandJump(
                row=int(k),
                middle=float(self.time[k] + 0.5 * intervals[k]),
                interval=float(intervals[k]),
            )
            for k in self.jumps
            if intervals[k] > LARGEST_CERTAIN_INTERVAL
        )

    def with_edges(self, late: Mapping[int, float]) -> InputSignal:
        """The signal with some edges shifted: by their rows, how much later than their middle [s].

        Each is rounded over `JUMP_TIME`, so that a simulation is a smooth function of the instant.
        """
        shifted = [(edge, edge.middle + late[edge.row]) for edge in self.edges if edge.row in late]
        rise_instants = [instant + JUMP_TIME * np.linspace(-0.5, 0.5, 9) for _, instant in shifted]
        time = np.unique(np.concatenate([self.time, *rise_instants]))
        values = self.at(time)
        for edge, instant in shifted:
            near = np.abs(time - edge.middle) <= 0.5 * edge.interval + JUMP_TIME
            earlier, later = self.time[edge.row : edge.row + 2]
            start_level = self.at(np.minimum(time[near], earlier))
            share = np.clip((time[near] - instant) / JUMP_TIME + 0.5, 0.0, 1.0)
            jump = self.at(np.maximum(time[near], later)) - start_level
            values[near] = start_level + jump * share**2 * (3.0 - 2.0 * share)
        return replace(self, time=time, values=values)

    def at(self, time: Array) -> Array:
        """The input at other instants [s]; before the first stamp the first sample holds."""
        return _between(self, time)


def _instrument(signal: InputSignal | Channel) -> Accuracy:
    """Limits of an instrument's error: stated, or assumed of its kind."""
    if signal.accuracy is not None:
        return signal.accuracy
    return assumed_accuracy(signal.kind, is_input=isinstance(signal, InputSignal))


def assumed_accuracy(kind: str, *, is_input: bool) -> Accuracy:
    """Assumed accuracy of an instrument whose accuracy is not stated."""
    assumed = ASSUMED_ACCURACY.get(kind, Accuracy())
    return assumed if is_input else assumed._replace(time=0.0)


LEVELS = 32
"""Levels of inputs from which the smallest distance between two of them is a converter's step."""


def resolution_of_inputs(inputs: Sequence[InputSignal]) -> float:
    """Step of the converter that inputs of one instrument were logged by, in their unit.

    The smallest distance between levels that they take; 0 if they take so few that nothing is known
    of levels between them.
    """
    levels = np.unique(np.concatenate([signal.values for signal in inputs]))
    # rounding of a decimal number, or of a scale, makes equal levels differ
    distances = np.diff(levels)
    distances = distances[distances > ROUNDED * float(np.abs(levels).max(initial=0.0))]
    return float(distances.min()) if distances.size + 1 >= LEVELS else 0.0


@dataclass(frozen=True, eq=False)
class Channel(Result):
    """One measured signal on its own time stamps."""

    name: str
    kind: ChannelKind
    unit: str
    """SI, or as written for the kind ``"other"``."""
    time: Array
    """(m,) stamps. [s]"""
    values: Array
    """(m,) samples, in `unit`; of an encoder the angle of the shaft."""
    weight: Array
    """(m,) factors on the squared error; 0 is ignored."""
    source: SignalOrigin
    noise: float | None = None
    """Standard deviation of the noise, in `unit`."""
    limits: tuple[float, float] | None = None
    """Range of the instrument, in `unit`."""
    dropped: int = 0
    """Samples left out because they were missing."""
    encoder: Encoder | None = None
    counts: Array | None = None
    """(m,) counts of an encoder, unwrapped; before the sign."""
    stated: float = 1.0
    """Size of the unit in which the campaign file states it, in `unit`."""
    rolls_over_at: float | None = None
    """Reading after which a position wraps, in `unit`; it is unwrapped."""
    interpolation: Interpolation = "linear"
    """What it is between two stamps, if a model takes it as an input."""
    accuracy: Accuracy | None = None
    """As the campaign file states it."""

    @property
    def instrument(self) -> Accuracy:
        """Limits of the instrument's error: stated, or assumed of its kind."""
        return _instrument(self)

    @property
    def used(self) -> NDArray[np.bool_]:
        """(m,) whether a sample counts."""
        return self.weight > 0.0

    @cached_property
    def resolution(self) -> float | None:
        """Step of an encoder's readings, None of other channels. [unit]

        A count; more if it moves only by multiples of more, as downstream of a decoder that counts
        every fourth edge.
        """
        if self.encoder is None:
            return None
        steps = np.diff(np.zeros(0) if self.counts is None else self.counts)
        # equal steps are a constant speed
        varied = np.count_nonzero(np.diff(steps)) > VARIED
        is_whole = varied and np.array_equal(steps, np.rint(steps))
        divisor = int(np.gcd.reduce(steps.astype(np.int64))) if is_whole else 1
        return divisor * abs(self.encoder.angle_per_count)

    @property
    def is_position(self) -> bool:
        """Whether it is an integral of the speed, with a free zero."""
        return self.kind in ("position", "encoder_counts")

    @property
    def shown_unit(self) -> str:
        """Its unit as of `swashplate.units.display_unit`, which knows a shaft's angle."""
        return shown_unit(self.kind, self.unit)

    def plot(
        self, *, window: tuple[float, float] | None = None, title: str | None = None
    ) -> Figure:
        """Figure of its samples; of a position also of the speed that it gives.

        With `window` as of `swashplate.report.figures.plot_channel`.
        """
        return cast("Figure", figures().plot_channel(self, window=window, title=title))

    def at(self, time: Array) -> Array:
        """Its readings at other instants [s]; before the first stamp the first one holds."""
        return _between(self, time)


def _between(signal: InputSignal | Channel, time: Array) -> Array:
    if signal.interpolation != "previous":
        return np.interp(time, signal.time, signal.values)
    rows = np.searchsorted(signal.time, time, side="right") - 1
    return signal.values[np.maximum(rows, 0)]


@dataclass(frozen=True, eq=False)
class Experiment(Tabular):
    """One run of one axis.

    Examples
    --------
    >>> from swashplate import Campaign, maneuvers, rig
    >>> file = rig.write(rig.run("hoist", {"step": maneuvers.step(9.0)}), "tests")
    >>> experiment = Campaign.from_toml(file)["hoist_step"]
    >>> experiment.role, experiment.input.kind, experiment["counts"].unit
    ('fit', 'voltage', 'rad')
    """

    name: str
    """The run's name, with the axis if a campaign has several: ``"trial1 boom"``."""
    axis: str
    run: str
    role: Role
    start: InitialState
    start_pressure: float | None
    """Stroking pressure at the first sample, if it is given. [Pa]"""
    input: InputSignal
    channels: Mapping[str, Channel]
    stated_maneuver: str | None = None
    """Name that the campaign file gives to the maneuver."""
    recognised: Recognised | None = None
    ignored: tuple[tuple[float, float, str], ...] = ()
    """Windows left out of every channel: first and last instant [s], and why."""
    recorded: float | None = None
    """When its first sample was taken, in seconds since 1970; None if no clock tells. [s]"""
    notes: tuple[str, ...] = ()
    """What reading did that nobody asked for, one sentence each: a channel left out, a split."""

    def __getitem__(self, channel: str) -> Channel:
        """A channel by its name.

        Raises
        ------
        InputError
            If there is none of that name.
        """
        if channel not in self.channels:
            names = ", ".join(self.channels)
            near = meant(channel, self.channels)
            raise UnknownNameError(f"{self.name} has no channel '{channel}'{near}; it has {names}.")
        return self.channels[channel]

    def of_kind(self, *kinds: ChannelKind) -> tuple[Channel, ...]:
        """Its channels of some kinds."""
        return tuple(channel for channel in self.channels.values() if channel.kind in kinds)

    def _signals(self) -> list[tuple[str, InputSignal | Channel]]:
        return [("input", self.input), *self.channels.items()]

    def to_polars(self) -> polars.DataFrame:
        """The input and every channel on its own stamps, a row a sample.

        Columns ``signal``, ``time`` [s], ``value``, ``unit``, and ``weight``: 0 if a sample is
        ignored, null for the input.
        """
        import polars as pl

        frames = []
        for name, recorded in self._signals():
            weight = (
                recorded.weight if isinstance(recorded, Channel) else [None] * recorded.time.size
            )
            frame = pl.DataFrame({"time": recorded.time, "value": recorded.values})
            signal, unit = pl.lit(name).alias("signal"), pl.lit(recorded.unit).alias("unit")
            weights = pl.Series("weight", weight, pl.Float64)
            frames.append(frame.select(signal, "time", "value", unit, weights))
        return pl.concat(frames)

    def table(self) -> Table:
        """Its input and channels: kind, samples, smallest and largest value."""
        numbers = Column("samples", "d", "1"), Column("lowest", ".4g"), Column("highest", ".4g")
        title = f"{self.name}, {self.maneuver}, {self.role}"
        table = Table(title, (Column("channel"), Column("kind"), *numbers, UNIT))
        for name, signal in self._signals():
            ends = float(signal.values.min()), float(signal.values.max())
            unit = shown_unit(signal.kind, signal.unit)
            table.add(name, signal.kind, signal.values.size, *ends, unit=unit)
        return table

    def plot(self, *, title: str | None = None) -> Figure:
        """Figure of its input and channels, as of `swashplate.report.figures.plot_campaign`."""
        return cast("Figure", figures().plot_campaign([self], title=title)[0])

    @property
    def maneuver(self) -> str:
        """The maneuver, as stated or as recognised: ``"step +4 V"``."""
        if self.stated_maneuver is not None:
            return self.stated_maneuver
        return self.recognised.name if self.recognised is not None else UNNAMED

    @property
    def begins(self) -> Literal["rest", "steady"]:
        """State of what a fit does not estimate: cut out of a motion, a card is settled."""
        return "steady" if self.start in ("steady", "estimated") else "rest"

    @cached_property
    def duration(self) -> float:
        """From the first sample of the input to the last. [s]"""
        return float(self.input.time[-1] - self.input.time[0])
