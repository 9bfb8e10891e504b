"""Experiments from a log and the entries of a campaign file; of a long log, windows with motion.

A signal is read on its clock, in SI; a run is split where a counter may have gone round unseen.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import schema
from swashplate.campaign.experiment import (
    Accuracy,
    Channel,
    Encoder,
    Experiment,
    InputSignal,
    SignalOrigin,
    assumed_accuracy,
)
from swashplate.campaign.overview import BlockRanges, LogWindow, Overview
from swashplate.campaign.recognition import UNNAMED, Recognised, recognise
from swashplate.campaign.samples import ambiguous_gaps, unwrap_counts, unwrap_position
from swashplate.campaign.schema import applying, conversion, ends, inside
from swashplate.documents import toml_string, validated
from swashplate.errors import FileError, InputError
from swashplate.logs import (
    SINCE_1970,
    Log,
    LogColumn,
    Stamps,
    check_duration,
    check_stamps,
    in_parts,
    second_of_clock,
    seconds_to_1970,
    unit_of,
)

Array = NDArray[np.float64]
Axes = Mapping[str, schema.AxisEntry]
AnySignal = TypeVar("AnySignal", InputSignal, Channel)

LARGEST = 1e30
"""Magnitude in any SI unit that no signal of a machine has: then unit or scale is wrong."""


def read_run(
    origin: str, name: str, run: schema.RunEntry, axes: Axes, log: Log
) -> tuple[list[Experiment], Overview | None]:
    """Experiments of a run: one for each axis that it tests, window of a long log, and split.

    Parameters
    ----------
    origin : str
        The run, for sentences about the campaign file.
    name : str
        Name of the run.
    run : RunEntry
        What the file says of it.
    axes : Axes
        All axes of the campaign, by name.
    log : Log
        The run's log, as it was opened.

    Returns
    -------
    list of Experiment, and Overview or None
        The overview is that of a long log, None of a log that is one experiment for each axis.

    Raises
    ------
    FileError, InputError, ParameterError
        For the first thing that is wrong; the sentence names file, column and row.
    """
    tested = _axes_of(origin, run, axes)
    names = list(_columns_of(log, tested))
    log = in_parts(log, names)
    rows = log.rows_of(names)
    overview = None
    windows = [(log, False)]
    if rows is not None and rows > LONG:
        if any(axis.input.kind == "none" for axis in tested.values()):
            raise InputError(
                f"{log.path} has {rows} rows, but a run without an input has at most {LONG}: cut "
                "the log."
            )
        overview = _overview(name, tested, log, rows, run.span)
        windows = [
            (replace(log, first=window.first, last=window.last), window.resumes)
            for window in overview.windows
            if window.used
        ]
    experiments = list[Experiment]()
    for window_log, resumes in windows:
        columns = _Columns(window_log, tested)
        for key, axis in tested.items():
            others = ", ".join(toml_string(axis_name) for axis_name in tested if axis_name != key)
            without = f"only = [{others}]" if others else 'role = "ignore"'
            experiments += _experiments(
                name=f"{name} {key}" if len(axes) > 1 else name,
                run_name=name,
                key=key,
                run=run,
                axis=axis,
                columns=columns,
                windowed=overview is not None,
                resumes=resumes,
                without=without,
            )
    return experiments, overview


def _axes_of(run_origin: str, run: schema.RunEntry, axes: Axes) -> dict[str, schema.AxisEntry]:
    """The axes that a run tests, with what differs in it."""
    for name in (*run.only, *run.axes):
        if name not in axes:
            raise InputError(
                f"{run_origin} names the axis '{name}', but the axes are {', '.join(axes)}."
            )
    tested = {name: axes[name] for name in run.only or axes}
    for name in tested:
        changes = run.axes.get(name)
        if not changes:
            continue
        axis, origin = axes[name], f"{run_origin}: axes.{name}"
        _check_changed_channels(origin, axis, changes.get("channels"))
        content = _merged(axis.model_dump(by_alias=True, exclude_unset=True), changes)
        if not content["channels"]:
            raise InputError(f'{origin} has no channel left; write role = "ignore" instead.')
        tested[name] = validated(content, schema.AxisEntry, origin)
    return tested


def _check_changed_channels(origin: str, axis: schema.AxisEntry, changes: object) -> None:
    """Refuse changes of a channel that an axis does not have, unless they define a new one."""
    if not isinstance(changes, Mapping):
        return
    for key, change in changes.items():
        is_new = isinstance(change, Mapping) and "kind" in change
        if key not in axis.channels and not is_new:
            raise InputError(
                f"{origin} changes the channel '{key}', but the axis has "
                f"{', '.join(axis.channels)}; a new channel needs its kind and column."
            )


def _merged(content: dict[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """A table with some entries replaced, tables within it merged in turn.

    Ignored windows are added to those that there are; false takes a channel out.
    """
    merged = dict(content)
    for key, value in changes.items():
        old = merged.get(key)
        if isinstance(old, dict) and isinstance(value, Mapping):
            merged[key] = _merged(old, value)
        elif isinstance(old, dict) and value is False:
            del merged[key]
        elif key == "ignore" and isinstance(old, (list, tuple)) and isinstance(value, list):
            merged[key] = [*old, *value]
        else:
            merged[key] = value
    return merged


# --- signals in SI --------------------------------------------------------------------------------


def _described_signals(
    axis: schema.AxisEntry,
) -> dict[str, schema.InputEntry | schema.ChannelEntry]:
    """An axis's signals that have a column, by their descriptions in sentences."""
    signals: dict[str, schema.InputEntry | schema.ChannelEntry] = {}
    if axis.input.kind != "none":
        signals["the input"] = axis.input
    for name, channel in axis.channels.items():
        signals[f"channel '{name}'"] = channel
    return signals


def _columns_of(log: Log, axes: Axes) -> dict[str, LogColumn]:
    """Columns that some axes need, by the names in the campaign file."""
    column_of = dict[str, LogColumn]()
    for axis in axes.values():
        for what, signal in _described_signals(axis).items():
            clocks = [clock.column for clock in (signal.time, axis.time) if clock is not None]
            requested = [(signal.column, what), *((name, f"the time of {what}") for name in clocks)]
            for name, purpose in requested:
                if name is None:
                    continue
                try:
                    column_of[name] = log.find(name)
                except InputError as error:
                    raise InputError(f"For {purpose}: {error}") from None
    return column_of


class _Columns:
    """The columns of a log that some axes need, read together."""

    def __init__(self, log: Log, axes: Axes) -> None:
        self.log, self.columns = log, _columns_of(log, axes)
        self.values = log.read(list(self.columns))
        first = replace(log, first=0, last=1).read(list(self.columns)) if log.first else self.values
        self._begins = {name: values[:1] for name, values in first.items()}
        self._stamps: dict[tuple[schema.ClockEntry, int], Array] = {}
        self._seconds: dict[schema.ClockEntry, float] = {}

    def stamps(self, signal: schema.SignalEntry, axis: schema.AxisEntry) -> Array:
        """Increasing stamps of a signal; those of a calendar from the axis's first one on. [s]"""
        main = axis.time
        clock = signal.time or main
        size = self.values[signal.column].size
        # signals share an array: whoever compares stamps sees at once that they are the same
        if (clock, size) in self._stamps:
            return self._stamps[clock, size]
        with np.errstate(over="ignore"):
            if clock.column is None:
                rate, source = clock.rate or 1.0, "the rate"
                time = clock.offset + (self.log.first + np.arange(size)) / rate
            else:
                numbers, factor = self.values[clock.column], self._second(clock)
                source = f"column '{self.columns[clock.column].name}'"
                check_stamps(self.log, self.columns[clock.column].name, numbers)
                of_main = main if main.column is not None else clock
                second, first = self._second(of_main), self._first_stamp(of_main)
                time = clock.offset + factor * numbers
                if second * first >= SINCE_1970:
                    # the difference first: a float64 keeps a microsecond of a calendar's stamp
                    time = clock.offset + factor * (numbers - second / factor * first)
                    if factor != second:
                        # two calendars may have two zeros
                        own = seconds_to_1970(self._first_stamp(clock), factor)
                        time += seconds_to_1970(first, second) - own
            checked = check_duration(self.log, source, time)
        self._stamps[clock, size] = checked
        return checked

    def zero(self, axis: schema.AxisEntry, recorded: datetime | None) -> float | None:
        """Calendar time at which an axis's stamps are 0, in seconds since 1970; None if unknown.

        `recorded` is when the log begins, if the campaign file says so.
        """
        clock, begin = axis.time, 0.0
        if clock.column is not None:
            begin = self._second(clock) * self._first_stamp(clock)
        of_calendar = begin >= SINCE_1970
        if recorded is not None:
            first = clock.offset if of_calendar else begin + clock.offset
            return _seconds(recorded) - first
        if not of_calendar:
            return None
        return begin - seconds_to_1970(self._first_stamp(clock), self._second(clock)) - clock.offset

    def _first_stamp(self, clock: schema.ClockEntry) -> float:
        """The first number of a column of stamps in the whole log, in its unit."""
        begin = self._begins[clock.column or ""]
        return float(begin[0]) if begin.size else 0.0

    def _second(self, clock: schema.ClockEntry) -> float:
        """Size of the unit of a column of stamps [s]."""
        if clock not in self._seconds:
            name = clock.column or ""
            column = self.columns[name]
            unit = clock.unit or unit_of(column, name, "s")
            stamps = Stamps.of(self.values[name], self._first_stamp(clock))
            what = f"{self.log.path}: column '{column.name}' (the time)"
            self._seconds[clock] = second_of_clock(unit, stamps, what)
        return self._seconds[clock]

    def _described(self, what: str, signal: schema.SignalEntry) -> str:
        """Description of a signal in the sentence of an error."""
        return f"{self.log.path}: column '{self.columns[signal.column].name}' ({what})"

    def _conversion(
        self, what: str, signal: schema.InputEntry | schema.ChannelEntry
    ) -> tuple[str, float, float]:
        """The SI unit of a signal, with factor and zero, as of `schema.conversion`."""
        units = schema.KINDS[signal.kind].units
        usual = units[0] if units else "1"
        unit = signal.unit or unit_of(self.columns[signal.column], signal.column, usual)
        return conversion(signal.kind, unit, self._described(what, signal))

    def as_recorded(
        self, what: str, signal: schema.InputEntry | schema.ChannelEntry
    ) -> tuple[str, NDArray[np.float64]]:
        """The SI unit of a signal, and all its samples (n,) in it; NaN if one is not finite.

        Nothing is left out, and a counter that wraps does so.
        """
        si, factor, zero = self._conversion(what, signal)
        numbers = signal.scale * self.values[signal.column] + signal.offset
        if isinstance(signal, schema.ChannelEntry) and signal.counts_per_turn is not None:
            encoder = Encoder(signal.counts_per_turn, signal.gear_ratio, signal.sign, None)
            factor *= encoder.angle_per_count
        else:
            factor *= signal.sign
        values = factor * numbers + zero
        values[~np.isfinite(values)] = np.nan
        return si, values

    def samples(
        self,
        what: str,
        signal: schema.InputEntry | schema.ChannelEntry,
        axis: schema.AxisEntry,
        run: schema.RunEntry,
    ) -> tuple[dict[str, Any], float]:
        """Fields of a signal, in SI, and the size of its unit; no fields if all is missing."""
        column = self.columns[signal.column]
        numbers = self.values[signal.column]
        described = self._described(what, signal)
        time = self.stamps(signal, axis)
        is_input = isinstance(signal, schema.InputEntry)
        if time.size != numbers.size:
            raise FileError(f"{described} has {numbers.size} samples, but its time {time.size}.")
        used = np.ones(numbers.size, np.bool_) if run.span is None else inside(run.span, time)
        for window in signal.ignore if is_input else ():
            used &= ~inside(window, time)
        missing = used & ~np.isfinite(numbers)
        rows = np.flatnonzero(missing) + 1 + self.log.first
        if not is_input and rows.size and rows.size == used.sum():
            return {}, 1.0
        if rows.size and signal.missing == "refuse":
            others = f" and {rows.size - 1} others" if rows.size > 1 else ""
            raise FileError(
                f"{described} has no finite number in data row {rows[0]}{others}; correct the log, "
                "or write missing = 'drop' to omit such samples."
            )
        used &= ~missing
        usable = np.count_nonzero(used)
        if usable < 2:
            raise FileError(
                f"{described} has {usable} samples that can be used, but needs at least two."
            )
        si, factor, zero = self._conversion(what, signal)
        # an encoder's sign belongs to the scale of its counts, see `Encoder`
        sign = 1 if signal.kind == "encoder_counts" else signal.sign
        with np.errstate(over="ignore"):
            values = factor * sign * (signal.scale * numbers[used] + signal.offset) + zero
            largest = float(np.max(np.abs(values)))
        if not largest < LARGEST:
            far_off = ~(np.abs(values) < LARGEST)
            marks = time[used][far_off]
            if far_off.mean() < 0.5:
                mark = numbers[used][far_off][0]
                entry = f'{{ from = {marks[0]:.6g}, to = {marks[-1]:.6g}, why = "dropout" }}'
                raise InputError(
                    f"{described} reads {mark:.3g} in {marks.size} samples from {marks[0]:.6g} to "
                    f"{marks[-1]:.6g} s, an instrument's mark for no value: leave them out with "
                    f"ignore = [{entry}] in its table."
                )
            raise InputError(
                f"{described} reaches {largest:.3g} {si}; check its unit, scale and offset."
            )
        return {
            "kind": signal.kind,
            "unit": si,
            "time": time if used.all() else np.ascontiguousarray(time[used]),
            "values": values,
            "source": SignalOrigin(self.log.path, column.name),
            "limits": signal.limits and tuple(factor * end + zero for end in signal.limits),
            "accuracy": _accuracy(signal, factor),
            "dropped": rows.size,
        }, factor


def _accuracy(signal: schema.InputEntry | schema.ChannelEntry, factor: float) -> Accuracy | None:
    """Accuracy that a campaign file states of an instrument, SI; the rest as assumed of its kind.

    A command that is stated to be held is logged by its source: it changes at its samples.
    """
    is_held = isinstance(signal, schema.InputEntry) and signal.interpolation == "previous"
    if signal.accuracy is None and not is_held:
        return None
    stated = signal.accuracy or schema.AccuracyEntry()
    assumed = assumed_accuracy(signal.kind, is_input=isinstance(signal, schema.InputEntry))
    gain = assumed.gain if stated.gain is None else stated.gain
    zero = assumed.zero if stated.zero is None else factor * stated.zero
    time = stated.time
    if time is None:
        time = 0.0 if is_held else assumed.time
    return Accuracy(gain, zero, time, rounded=stated.zero is None)


# --- experiments ----------------------------------------------------------------------------------


def _experiments(
    *,
    name: str,
    run_name: str,
    key: str,
    run: schema.RunEntry,
    axis: schema.AxisEntry,
    columns: _Columns,
    windowed: bool,
    resumes: bool,
    without: str,
) -> Iterator[Experiment]:
    """One experiment, or several if a counter's position across a gap is not known.

    `windowed` names them by their first instant, as windows of a long log. With `resumes` the first
    one begins in the midst of a motion. `without` is the entry by which the run leaves the axis
    out.
    """
    drive = _input_of(axis, columns, run)
    notes = list[str]()
    signals = dict[str, Channel]()
    cuts = dict[float, str]()
    zero = columns.zero(axis, run.recorded)
    for channel, entry in axis.channels.items():
        parts, factor = columns.samples(f"channel '{channel}'", entry, axis, run)
        if not parts and entry.missing == "refuse":
            remedy = f"axes.{key}.channels.{channel} = false" if len(axis.channels) > 1 else without
            raise FileError(
                f"{columns.log.path}: column '{entry.column}' (channel '{channel}' of the axis "
                f"'{key}') contains no numbers; leave it out with {remedy} in this run."
            )
        if not parts:
            notes.append(f"'{channel}' has no sample here and is left out of this run")
            continue
        signals[channel] = _channel_of(channel, entry, parts, factor)
        if entry.rolls_over_at is not None:
            cuts |= _gaps_with_wraps(signals[channel], entry, factor)
    if not signals:
        raise InputError(
            f"{columns.log.path}: the channels of the axis '{key}' have 0 samples that can be "
            f"used; leave it out with {without} in this run."
        )
    unit = {"voltage": "V", "current": "A"}.get(drive.kind, drive.unit)
    for part, (begin, end) in enumerate(pairwise([-np.inf, *sorted(cuts), np.inf])):
        command = _within(drive, begin, end)
        within = {channel: _within(read, begin, end) for channel, read in signals.items()}
        measured = {channel: read for channel, read in within.items() if read.time.size > 1}
        if command.time.size < 2 or not measured:
            continue
        in_motion = part > 0 or resumes
        part_notes = list(notes) if part == 0 else []
        if np.isfinite(end):
            part_notes.append(f"split at {end:.4g} s; the rest is a separate run: {cuts[end]}")
        recognised = Recognised(UNNAMED)
        if command.kind != "none":
            recognised = recognise(command.time, command.values, unit=unit)
        maneuver = run.maneuver or recognised.name
        ignored = applying((*axis.ignore, *run.ignore), maneuver)
        yield Experiment(
            name=f"{name} from {command.time[0]:.6g} s" if part > 0 or windowed else name,
            axis=key,
            run=run_name,
            role=run.role,
            start="estimated" if in_motion else run.start or axis.start,
            start_pressure=None if in_motion else run.start_pressure,
            input=command,
            channels={
                channel: _finished(axis.channels[channel], read, command, maneuver, ignored, run)
                for channel, read in measured.items()
            },
            stated_maneuver=run.maneuver,
            recognised=recognised,
            ignored=tuple((*ends(window), window.why) for window in ignored),
            recorded=None if zero is None else zero + float(command.time[0]),
            notes=tuple(part_notes),
        )


def _input_of(axis: schema.AxisEntry, columns: _Columns, run: schema.RunEntry) -> InputSignal:
    """The input of an axis; one that commands nothing is 0 at the stamps of the first channel."""
    if axis.input.kind != "none":
        parts, _ = columns.samples("the input", axis.input, axis, run)
        between = axis.input.interpolation
        return InputSignal(**parts, interpolation=between or "linear", settled=between is not None)
    time = columns.stamps(next(iter(axis.channels.values())), axis)
    if run.span is not None:
        time = np.ascontiguousarray(time[inside(run.span, time)])
    origin = SignalOrigin(columns.log.path, "none")
    return InputSignal("none", "1", time, np.zeros(time.size), "linear", origin)


def _channel_of(
    name: str, entry: schema.ChannelEntry, parts: Mapping[str, Any], factor: float
) -> Channel:
    """Channel of a signal's fields and the size of its unit, its counts not yet unwrapped."""
    values, size = parts["values"], entry.rolls_over_at
    encoder = counts = wrap = None
    if entry.counts_per_turn is not None:
        modulus = None if size is None else int(size)
        encoder = Encoder(entry.counts_per_turn, entry.gear_ratio, entry.sign, modulus)
        counts = values
    elif size is not None:
        wrap = factor * size
    return Channel(
        name,
        **parts,
        weight=values,
        noise=None if entry.noise is None else factor * entry.noise,
        encoder=encoder,
        counts=counts,
        stated=factor,
        rolls_over_at=wrap,
        interpolation=entry.interpolation,
    )


def _gaps_with_wraps(
    channel: Channel, entry: schema.ChannelEntry, factor: float
) -> dict[float, str]:
    """Instants [s] after gaps in which a channel may have wrapped unseen, and sentences on them."""
    size = entry.rolls_over_at
    assert size is not None
    time = channel.time
    signal = "counter" if entry.kind == "encoder_counts" else "position"
    cuts = dict[float, str]()
    for row in ambiguous_gaps(time, channel.values, factor * size):
        cuts[float(time[row])] = (
            f"during the gap of {time[row] - time[row - 1]:.3g} s the {signal} '{channel.name}', "
            f"which wraps at {size:.12g}, may have wrapped once more or less"
        )
    return cuts


def _seconds(moment: datetime) -> float:
    """Seconds since 1970; one without a time zone is taken as UTC, as the order alone matters."""
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def _within(signal: AnySignal, begin: float, end: float) -> AnySignal:
    """The part of a signal from one instant to before another [s]."""
    is_within = (signal.time >= begin) & (signal.time < end)
    if is_within.all():
        return signal
    arrays: dict[str, Any] = {
        key: value[is_within]
        for key, value in vars(signal).items()
        if isinstance(value, np.ndarray)
    }
    return replace(signal, **arrays)


def _finished(
    entry: schema.ChannelEntry,
    read: Channel,
    drive: InputSignal,
    maneuver: str,
    ignored: Sequence[schema.TimeWindow],
    run: schema.RunEntry,
) -> Channel:
    """A channel whose counts are unwrapped, with the product of all factors that apply."""
    encoder, counts, values = read.encoder, read.counts, read.values
    try:
        if encoder is not None and counts is not None:
            size = encoder.rolls_over_at
            counts = counts if size is None else unwrap_counts(counts, size)
            values = counts * encoder.angle_per_count
        elif read.rolls_over_at is not None:
            values = unwrap_position(values, read.rolls_over_at)
    except InputError as error:
        raise InputError(f"{read.source}: {error}") from None
    weight = np.full(read.time.shape, run.weight * entry.weight)
    if entry.weight_by_input:
        levels, factors = np.transpose(entry.weight_by_input)
        weight *= np.interp(np.abs(drive.at(read.time)), levels, factors)
    for weighted in applying((*entry.weights, *run.weights), maneuver):
        weight[inside(weighted, read.time)] *= weighted.factor
    for window in (*ignored, *applying(entry.ignore, maneuver)):
        weight[inside(window, read.time)] = 0.0
    if weight.min() == weight.max():
        # most weights are all alike: then they take no memory
        weight = np.broadcast_to(weight[0], weight.shape)
    return replace(read, counts=counts, values=values, weight=weight)


# --- long logs ------------------------------------------------------------------------------------

LONG = 250_000
"""Rows beyond which a log is not one run but its windows with motion. A fit holds the derivatives
of its longest run, 2 kB a row: with this many 0.5 GB, and with the 1.8 million of an hour at 512 Hz
3.2 GB, which take more than five minutes."""
BLOCK = 250_000
"""Rows that are looked at together."""
GRAIN = 256
"""Rows of which the lowest and the highest sample are kept."""
MOVES = 0.02
"""Share of its largest excursion from rest beyond which an input moves."""
BEFORE, AFTER = 2.0, 5.0
"""Rest that a window has before the input moves and after it has stopped. [s]"""
HELD = 120_000
"""Rows of one log that a campaign takes at most, more than the 110,605 of Kruse's thirteen tests of
the hoist. A fit of two channels takes about 0.2 kB of memory for each, and 2 kB for each row of the
longest run."""
MOST_WINDOWS = 100
"""Windows of one log that a campaign takes at most. Each is a run, which takes a fit 0.12 s: a slow
logger's windows are many and short."""
PIECE = 60_000
"""A longer motion is cut into pieces of so many rows, of which the later ones begin in motion."""


class _Trace:
    """A signal of a long log, of which the extremes in each grain are kept."""

    def __init__(
        self,
        key: str,
        axis: schema.AxisEntry,
        what: str,
        name: str,
        signal: schema.InputEntry | schema.ChannelEntry,
        grains: int,
    ) -> None:
        self.key, self.axis, self.what, self.name, self.signal = key, axis, what, name, signal
        self.time = np.empty(grains)
        self.low = np.empty(grains)
        self.high = np.empty(grains)
        self.unit = ""
        self.end = -np.inf
        self.missing = 0
        self.period = np.inf
        self.longest = 0.0

    def take(self, columns: _Columns, first: int) -> None:
        """Take in a block of rows; of a later one than the first with the row before it."""
        time = columns.stamps(self.signal, self.axis)
        self.unit, values = columns.as_recorded(self.what, self.signal)
        intervals = np.diff(time)
        if intervals.size:
            self.period = min(self.period, float(np.median(intervals)))
            self.longest = max(self.longest, float(intervals.max()))
        if first > 0:
            # the row before was taken in with its own block
            time, values = time[1:], values[1:]
        self.end = float(time[-1])
        self.missing += int(np.count_nonzero(np.isnan(values)))
        edges = np.arange(0, values.size, GRAIN)
        here = slice(first // GRAIN, first // GRAIN + edges.size)
        self.time[here] = time[edges]
        self.low[here] = np.fmin.reduceat(values, edges)
        self.high[here] = np.fmax.reduceat(values, edges)

    def ranges(self) -> BlockRanges:
        """Lowest and highest values of each grain of rows, with the trace's stamps."""
        return BlockRanges(
            name=self.name,
            axis=self.key,
            kind=self.signal.kind,
            unit=self.unit,
            time=self.time,
            end=self.end,
            low=self.low,
            high=self.high,
            missing=self.missing,
            period=self.period,
            longest=self.longest,
        )


def _overview(
    name: str, axes: Axes, log: Log, rows: int, span: schema.TimeWindow | None
) -> Overview:
    """A log of more rows than `LONG` as a whole, and its windows in which an input moves.

    The windows are within the span of the run, if it has one. The log is looked through once, block
    after block, its stamps checked. A window takes in 2 s of rest before and 5 s after the motion;
    if all together have more rows than `HELD`, or are more than `MOST_WINDOWS`, one in several is
    used, evenly over the log.
    """
    grains = -(-rows // GRAIN)
    traces = list[_Trace]()
    for key, axis in axes.items():
        signal_names = ["input", *axis.channels]
        for signal_name, (what, signal) in zip(
            signal_names, _described_signals(axis).items(), strict=True
        ):
            traces.append(_Trace(key, axis, what, signal_name, signal, grains))
    step = BLOCK // GRAIN * GRAIN
    for first in range(0, rows, step):
        # with the row before, so that stamps are compared across blocks
        part = replace(log, first=max(first - 1, 0), last=min(first + step, rows))
        columns = _Columns(part, axes)
        for trace in traces:
            trace.take(columns, first)
    inputs = [trace for trace in traces if isinstance(trace.signal, schema.InputEntry)]
    moving = np.zeros(grains, dtype=np.bool_)
    for trace in inputs:
        extremes = np.stack((trace.low, trace.high), axis=1)
        if span is not None:
            extremes[~inside(span, trace.time)] = np.nan
        moving |= _moves(extremes)
    if not moving.any():
        raise InputError(
            f"{log.path} has {rows} rows, but its input never moves: leave the run out with "
            'role = "ignore".'
        )
    return Overview(
        run=name,
        rows=rows,
        signals=tuple(trace.ranges() for trace in traces),
        windows=_windows(moving, rows, min(trace.period for trace in inputs), inputs[0].time),
        read_from=log.table,
    )


def _windows(
    moving: NDArray[np.bool_], rows: int, period: float, time: Array
) -> tuple[LogWindow, ...]:
    """Windows of a log of so many rows, by the grains in which an input moves.

    `period` is the usual interval of its stamps [s], `time` the first stamp of each grain [s].
    """
    changes = np.flatnonzero(np.diff(np.concatenate([[False], moving, [False]])))
    first = np.maximum(changes[::2] * GRAIN - round(BEFORE / period), 0)
    last = np.minimum(changes[1::2] * GRAIN + round(AFTER / period), rows)
    gaps = np.flatnonzero(first[1:] > last[:-1])
    begins = first[[0, *(gaps + 1)]].tolist()
    ends_of_motion = last[[*gaps, last.size - 1]].tolist()
    grain_rows = np.arange(time.size) * GRAIN
    windows = list[LogWindow]()
    for begin, end in zip(begins, ends_of_motion, strict=True):
        for row in range(begin, end, PIECE):
            row_end = min(row + PIECE, end)
            window = LogWindow(
                first=row,
                last=row_end,
                begin=float(np.interp(row, grain_rows, time)),
                end=float(np.interp(row_end, grain_rows, time)),
                resumes=row > begin,
                used=True,
            )
            windows.append(window)
    stride = -(-len(windows) // MOST_WINDOWS)
    while stride < len(windows) and _rows_of(windows[::stride]) > HELD:
        stride += 1
    return tuple(
        window._replace(used=number % stride == 0) for number, window in enumerate(windows)
    )


def _rows_of(windows: Sequence[LogWindow]) -> int:
    """Rows of some windows together."""
    return sum(window.last - window.first for window in windows)


def _moves(extremes: Array) -> NDArray[np.bool_]:
    """Whether an input leaves its rest, where it is most often, by its extremes in each grain."""
    middle = extremes.mean(axis=1)
    finite = middle[np.isfinite(middle)]
    if not finite.size or finite.min() == finite.max():
        return np.zeros(middle.size, dtype=np.bool_)
    counts, edges = np.histogram(finite, 64)
    most = int(counts.argmax())
    rest = np.median(finite[(finite >= edges[most]) & (finite <= edges[most + 1])])
    away = np.max(np.abs(extremes - rest), axis=1)
    return np.asarray(np.nan_to_num(away) > MOVES * np.nanmax(away))
