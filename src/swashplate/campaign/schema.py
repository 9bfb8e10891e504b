"""Schema of a campaign's TOML file: kinds of signal, entries, and what each of them means."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from datetime import datetime
from fnmatch import fnmatchcase
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, field_validator, model_validator

from swashplate import entries
from swashplate.entries import Document, FileTable, Flag, Sign
from swashplate.errors import InputError
from swashplate.logs import TextOptions
from swashplate.units import of_shaft, scaling, speed_unit

InputKind = Literal["voltage", "current", "other", "none"]
ChannelKind = Literal[
    "signed_current",
    "rectified_current",
    "current_plus",
    "current_minus",
    "shaft_speed",
    "position",
    "encoder_counts",
    "stroker_pressure",
    "swash_angle",
    "spool_position",
    "swing_angle",
    "hook_position",
    "other",
]
CHANNEL_KINDS: tuple[ChannelKind, ...] = get_args(ChannelKind)


class Kind(NamedTuple):
    """Meaning of a kind of signal, and marks of a log's column that is of this kind."""

    units: tuple[str, ...]
    """SI units that it may have; the first is meant if none is given. None: as written."""
    signal: str
    """Simulated signal that it is compared with; none of an input or of anything else."""
    meaning: str
    """In words, with its sign convention."""
    words: str = ""
    """How names of such columns end: a regular expression on lower-case words."""
    marks: tuple[str, ...] = ()
    """Units in a header that say it, whatever the name."""


CURRENT = r"currents?|\w*strom|stroom|strøm|ström|courant|corriente|corrente"
TURNS = r"rpm|\w*drehzahl|toerental|turtall|omdrejningstal|varvtal"
ROD = r"ms|displacement|stroke|cylinder|rod|extension|hub|\w*weg"
"""Names of columns, as `Kind.words`: of currents; of speeds in turns a minute, where no unit is
given; of positions that are a rod's and not a shaft's."""

# fmt: off
KINDS: Mapping[str, Kind] = {
    "voltage": Kind(("V",), "", "the card's command, positive for positive speed",
        r"volts?|voltage|u|\w*spannung|spanning|spenning|spænding|spänning|voltaje", ("V", "mV")),
    "current": Kind(("A",), "", "signed current that drives the pump without a card"),
    "none": Kind(("1",), "", "no input: nothing is commanded"),
    # by its name an input: channels are of this kind only if somebody says so
    "other": Kind((), "", "any other quantity, in the unit of the log",
        "cmd|command|duty|setpoint|valve|stick|joystick|joy|stellgröße|stellgroesse|sollwert|hebel|"
        "consigne|consigna|manette|palanca|spak|pådrag"),
    "encoder_counts": Kind(("rad",), "shaft_position",
        "encoder counts; an angle from an arbitrary zero",
        "counts?|encoder|drehgeber|enc|ticks|pulses|impulse|inkremente|impulsen|impulser|impulsions|pulsos",
        ("counts", "count", "Impulse", "pulses")),
    "current_plus": Kind(("A",), "current_positive",
        "current of the positive solenoid, a magnitude",
        f"(?:{CURRENT}|i) (?:plus|positive|a|1|up)"),
    "current_minus": Kind(("A",), "current_negative",
        "current of the negative solenoid, a magnitude",
        f"(?:{CURRENT}|i) (?:minus|negative|b|2|down)"),
    "signed_current": Kind(("A",), "current",
        "positive solenoid's current minus the negative one's"),
    "rectified_current": Kind(("A",), "current_sum", "|I+| + |I-|, one ammeter around both leads",
        f"{CURRENT}|amps?|ammeter|i", ("A", "mA")),
    "stroker_pressure": Kind(("Pa",), "stroker_pressure",
        "stroking pressure about its equilibrium", "stroker pressure|delta p|dp|servo pressure"),
    "swash_angle": Kind(("rad",), "swash_angle",
        "angle of the swash plate, positive with the speed", "swash angle|swash|alpha"),
    "spool_position": Kind(("m",), "spool_position",
        "displacement of the spool, positive with the force", "spool position|spool"),
    "swing_angle": Kind(("rad",), "", "angle of a rope or load from the plumb line, with a sign",
        r"swing|sway|swing angle|sway angle|off lead|side lead|pendelwinkel|schwingwinkel"),
    "hook_position": Kind(("m",), "", "coordinate of a hook or load",
        r"(?:hook|load|haken|last) (?:x|y|z)"),
    "shaft_speed": Kind(("rad/s", "m/s"), "shaft_speed",
        "speed of the shaft, or of a cylinder's rod",
        rf"speed|omega|velocity|\w*geschwindigkeit|snelheid|hastighe[dt]|vitesse|velocidad|velocità|"
        rf"{TURNS}|n|n \w+",
        ("rad/s", "deg/s", "rpm", "m/s", "mm/s")),
    "position": Kind(("rad", "m"), "shaft_position", "integral of the speed from an arbitrary zero",
        r"position|pos|angle|pos fb|\w*winkel|hoek|vinkel|ángulo|angolo|posisjon|posición|"
        rf"posizione|{ROD}"),
}
# fmt: on
"""Every kind of input and channel, by its name in a campaign file.

`init` writes the first that a column's name or unit shows, so that names of two words stand before
those of one.
"""
SIGNALS: Mapping[ChannelKind, str] = {
    kind: KINDS[kind].signal for kind in CHANNEL_KINDS if KINDS[kind].signal
}
"""Simulated signals by the kinds of channel that measure them."""
CURRENTS: tuple[ChannelKind, ...] = (
    "signed_current",
    "rectified_current",
    "current_plus",
    "current_minus",
)
"""Kinds of channel that measure the amplifier's current."""


def shown_unit(kind: str, unit: str) -> str:
    """Unit to show a signal of a kind in, as of `display_unit`, of its SI unit."""
    return of_shaft(unit) if KINDS[kind].signal == "shaft_position" else unit


def conversion(kind: str, unit: str | None, what: str) -> tuple[str, float, float]:
    """The SI unit in which a signal of a kind is kept, with factor and zero: SI = factor x + zero.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    unit : str or None
        Unit that it comes in; None stands for the kind's first one. Of a shaft's speed, 1/min and
        the like are turns a minute, 1/s turns a second.
    what : str
        The signal, for the error's sentence.

    Raises
    ------
    InputError
        If the unit is unknown or measures something else than the kind.
    """
    units = KINDS[kind].units
    if not units or unit is None or kind == "encoder_counts":
        return (units[0] if units else unit or "1"), 1.0, 0.0
    if kind == "shaft_speed":
        unit = speed_unit(unit)
    for si in units[1:]:
        try:
            return si, *scaling(unit, si, what)
        except InputError:
            continue
    return units[0], *scaling(unit, units[0], what)


MAGNITUDES = (1e-30, 1e30)
"""Of a number that is not 0, in whatever unit: the prefixes of the SI end there."""
RATIOS = (1e-6, 1e12)
"""Of rates, from a sample in 12 days to one in a ps [Hz], and of counts and gears per turn: no
encoder has 40 bits."""


def _in_range(low: float, high: float) -> AfterValidator:
    """Refuse numbers that nobody means, whose products overflow or vanish."""

    def check(value: float) -> float:
        if value != 0.0 and not low <= abs(value) <= high:
            first, last = (low, high) if value > 0.0 else (-high, -low)
            raise ValueError(f"{value!r} is out of range, which is {first:g} to {last:g}")
        return value

    return AfterValidator(check)


Finite = Annotated[entries.Finite, _in_range(*MAGNITUDES)]
Positive = Annotated[entries.Positive, _in_range(*MAGNITUDES)]
NotNegative = Annotated[entries.NotNegative, _in_range(*MAGNITUDES)]
Ratio = Annotated[entries.Positive, _in_range(*RATIOS)]
LARGEST_PRESSURE = 1e10
"""At the stroking piston: the plausible sizes of Z15 end here. [Pa]"""
Between = Literal["previous", "linear", "jumps"]
"""What an input is between two samples: the earlier one, a straight line, or a line that jumps."""
Role = Literal["fit", "validate", "ignore"]
InitialState = Literal["rest", "steady", "given", "estimated"]
AnyWindow = TypeVar("AnyWindow", bound="TimeWindow")


class TimeWindow(FileTable):
    """A part of a run, on the log's clock after `time.offset`."""

    start: Finite | None = Field(None, alias="from", description="First instant [s].")
    stop: Finite | None = Field(None, alias="to", description="Last instant [s].")
    maneuver: str | None = Field(
        None,
        description="Only in runs of this maneuver, as recognised: 'step +4 V' or, with a "
        "pattern, 'step *' or 'sine * 0.1 Hz'.",
    )
    why: str = Field("", description="Reason, printed in the report.")

    @model_validator(mode="after")
    def _ordered(self) -> TimeWindow:
        if self.start is not None and self.stop is not None and self.stop <= self.start:
            raise ValueError(f"a window goes from {self.start} s to {self.stop} s; swap them")
        return self


def applying(windows: Iterable[AnyWindow], maneuver: str) -> tuple[AnyWindow, ...]:
    """The windows that hold in runs of a maneuver, such as ``"step +4 V"``."""
    return tuple(
        window
        for window in windows
        if window.maneuver is None or fnmatchcase(maneuver, window.maneuver)
    )


def ends(window: TimeWindow) -> tuple[float, float]:
    """First and last instant of a window, infinite if it has none. [s]"""
    return (
        -np.inf if window.start is None else window.start,
        np.inf if window.stop is None else window.stop,
    )


def inside(window: TimeWindow, time: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(m,) whether stamps [s] lie in a window, its ends included."""
    low, high = ends(window)
    within: NDArray[np.bool_] = (time >= low) & (time <= high)
    return within


class WeightWindow(TimeWindow):
    """A part of a run that counts more or less."""

    factor: NotNegative = Field(description="Factor on the squared error; windows multiply.")


class ClockEntry(FileTable):
    """The time stamps of a signal: a column, or a rate if the log has none."""

    column: str | None = Field(None, description="Column of the time stamps.")
    unit: str | None = Field(None, description="Unit (default: the header's, or s).")
    rate: Ratio | None = Field(None, description="Sampling rate, instead of a column [Hz].")
    offset: Finite = Field(0.0, description="Offset added to the time stamps [s].")

    @model_validator(mode="after")
    def _one_source(self) -> ClockEntry:
        if (self.column is None) == (self.rate is None):
            raise ValueError("give either the column of the time or a rate in Hz")
        if self.rate is not None and self.unit is not None:
            raise ValueError("a clock with a rate has no unit: leave it out")
        return self


class AccuracyEntry(FileTable):
    """Limits of an instrument's error, as its data sheet gives them."""

    gain: NotNegative | None = Field(
        None,
        lt=1.0,
        description="Share of the reading, such as 0.005 for 0.5 % (default: an assumed value).",
    )
    zero: NotNegative | None = Field(
        None,
        description="In `unit` (default: an assumed value, for an input with the steps of its "
        "converter).",
    )
    time: NotNegative | None = Field(
        None,
        description="Of its time stamps, relative to other signals [s] (default: half a sampling "
        "interval for an input, 0 for a channel and for an input stated to be held).",
    )


class SignalEntry(FileTable):
    """Where a signal is and how its numbers become physical: sign * (scale * number + offset)."""

    column: str = Field(description="Column of the log, with or without the unit in its header.")
    unit: str | None = Field(None, description="Unit after scaling (default: the header's, or SI).")
    scale: Finite = Field(1.0, description="Factor on the log's numbers.")
    offset: Finite = Field(0.0, description="Added after scaling, in `unit`.")
    sign: Sign = Field(1, description="-1 reverses the signal.")
    time: ClockEntry | None = Field(
        None, description="Clock of this signal, instead of the axis's."
    )
    missing: Literal["refuse", "drop"] = Field(
        "refuse",
        description="An empty or NaN cell: refuse the log, or leave those samples out (counted "
        "in the check; a channel without any sample is left out of the run).",
    )
    limits: tuple[Finite, Finite] | None = Field(
        None, description="Range of the instrument in `unit`, to detect clipping."
    )
    accuracy: AccuracyEntry | None = Field(
        None,
        description="Limits of the instrument's error, included in intervals; the documentation of "
        "campaign files lists the default of each kind.",
    )

    @model_validator(mode="after")
    def _sensible(self) -> SignalEntry:
        if self.scale == 0.0:
            raise ValueError("a scale of 0 leaves nothing of the signal")
        if self.limits is not None and self.limits[0] >= self.limits[1]:
            raise ValueError("the first of the limits must be below the second")
        return self


class InputEntry(SignalEntry):
    """The signal that drives the axis."""

    kind: InputKind = Field(
        "voltage",
        description="voltage, current (signed, no card), other; or none, if nothing is commanded, "
        "as while a load swings freely.",
    )
    column: str = Field(
        "",
        description="Column of the log, with or without the unit in its header; none of the kind "
        "none.",
    )
    interpolation: Between | None = Field(
        None,
        description="Between two samples: hold the earlier one, a straight line, or a straight "
        "line with sudden changes halfway. By default a fit takes what fits best, everything else "
        "the straight line.",
    )
    ignore: tuple[TimeWindow, ...] = Field(
        (), description="Windows whose samples are left out; the input continues across them."
    )

    @model_validator(mode="after")
    def _has_column(self) -> InputEntry:
        if self.kind != "none" and not self.column:
            raise ValueError("column is missing; if nothing is commanded, write kind = 'none'")
        return self

    @model_validator(mode="after")
    def _of_all_maneuvers(self) -> InputEntry:
        if any(window.maneuver is not None for window in self.ignore):
            raise ValueError(
                "a window of the input applies to every maneuver: leave out 'maneuver'"
            )
        return self


class ChannelEntry(SignalEntry):
    """A signal that was measured."""

    kind: ChannelKind = Field(description="What it measures.")
    counts_per_turn: Ratio | None = Field(
        None, description="Counts per turn of the encoder's shaft, quadrature included."
    )
    gear_ratio: Ratio = Field(1.0, description="Turns of the encoder per turn of the axis's shaft.")
    rolls_over_at: Positive | None = Field(
        None,
        description="Counts at which the counter wraps, 65536 for 16 bits; for a position "
        "the reading in `unit`, 360 for deg.",
    )
    noise: Positive | None = Field(
        None,
        description="Standard deviation of its noise in `unit`, which sets its weight among "
        "channels.",
    )
    interpolation: Literal["previous", "linear"] = Field(
        "linear",
        description="Interpolation between samples, if a user-defined model takes it as an input.",
    )
    weight: NotNegative = Field(1.0, description="Factor on its squared errors.")
    weights: tuple[WeightWindow, ...] = Field((), description="Windows with another weight.")
    weight_by_input: tuple[tuple[NotNegative, NotNegative], ...] = Field(
        (), description="[|input|, factor] pairs, a polyline: [[3, 1], [10, 0.5]]."
    )
    ignore: tuple[TimeWindow, ...] = Field((), description="Windows that are left out.")

    @model_validator(mode="after")
    def _encoder(self) -> ChannelEntry:
        if self.kind == "encoder_counts" and self.counts_per_turn is None:
            raise ValueError("encoder_counts need counts_per_turn, quadrature included")
        if self.kind != "encoder_counts" and self.counts_per_turn:
            raise ValueError("counts_per_turn applies only to encoder_counts")
        if self.kind not in ("encoder_counts", "position") and self.rolls_over_at:
            raise ValueError("rolls_over_at applies only to encoder_counts and positions")
        if self.kind == "encoder_counts" and not (self.rolls_over_at or 1.0).is_integer():
            raise ValueError("rolls_over_at of encoder_counts is a whole number of counts")
        levels = [level for level, _ in self.weight_by_input]
        if levels != sorted(set(levels)):
            raise ValueError("the inputs of weight_by_input must increase")
        return self


class AxisEntry(FileTable):
    """One drive of the machine: its model, its input and what is measured of it."""

    drive: str | None = Field(
        None, description="A packaged drive, or a parameter file next to this file."
    )
    time: ClockEntry = Field(description="Clock of all signals that state none.")
    input: InputEntry = Field(description="What commands it.")
    channels: dict[str, ChannelEntry] = Field(
        min_length=1, description="Measured signals, by names of your choice."
    )
    start: InitialState = Field("rest", description="State at the first sample.")
    ignore: tuple[TimeWindow, ...] = Field((), description="Windows left out of every channel.")


class RunEntry(FileTable):
    """One log: a run of the machine."""

    file: str = Field(description="Log, next to this file.")
    name: str | None = Field(
        None, description="Name in tables (default: the file's name without its ending)."
    )
    role: Role = Field(
        "fit", description="fit, validate or ignore: the log of an ignored run is not opened."
    )
    start: InitialState | None = Field(None, description="State at the first sample.")
    start_pressure: entries.Finite | None = Field(
        None,
        ge=-LARGEST_PRESSURE,
        le=LARGEST_PRESSURE,
        description="Stroking pressure at the first sample, with start = 'given' [Pa].",
    )
    recorded: datetime | None = Field(
        None,
        description="Start of its log, 2026-05-04T13:20:00 (default: from its time stamps, if they "
        "are dates). Runs are sorted by it.",
    )
    span: TimeWindow | None = Field(None, description="Part of the log to use.")
    only: tuple[str, ...] = Field((), description="Axes that this run tests (empty: all).")
    ignore: tuple[TimeWindow, ...] = Field((), description="Windows left out of every channel.")
    weights: tuple[WeightWindow, ...] = Field((), description="Windows with another weight.")
    weight: NotNegative = Field(1.0, description="Factor on the run's squared errors.")
    maneuver: str | None = Field(None, description="Name of the maneuver, if not recognised.")
    axes: dict[str, dict[str, Any]] = Field(
        {},
        description="Entries of an axis that differ in this run, as in [axes.NAME]; "
        "channels.NAME = false if the run has no such channel; ignored windows are added.",
    )

    @model_validator(mode="after")
    def _given(self) -> RunEntry:
        if (self.start == "given") != (self.start_pressure is not None):
            raise ValueError("start = 'given' and start_pressure go together")
        return self


class CampaignFile(Document):
    """A campaign: the tests of a machine, next to their logs."""

    title: str = Field("", description="For the report.")
    virtual: Flag = Field(False, description="Whether the tests are simulated.")
    format: TextOptions = Field(
        TextOptions(), description="Format of text logs, if it cannot be recognised."
    )
    axes: dict[str, AxisEntry] = Field(min_length=1, description="The drives, by name.")
    runs: tuple[RunEntry, ...] = Field(min_length=1, description="Tests, one log each.")

    @field_validator("format", mode="before")
    @classmethod
    def _whole_row(cls, format: Any) -> Any:
        row = format.get("header_row") if isinstance(format, Mapping) else None
        if isinstance(row, bool | str):
            raise ValueError(f"header_row is {row!r}, but must be a line number")
        return format
