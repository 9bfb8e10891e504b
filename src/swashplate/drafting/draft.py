"""First drafts of a campaign file: a guess of what each column of a log is, and the text.

The kind of a column follows from its name and unit by the table of kinds,
`swashplate.campaign.schema.KINDS`, and from its numbers. What is not known for sure is marked
"guessed"; what cannot be known stays open in a line "FIXME".
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from itertools import pairwise
from math import floor, inf, isclose, pi
from pathlib import Path
from typing import NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import (
    ASSUMED_ACCURACY,
    CURRENTS,
    ESTIMATED_START,
    FIXME,
    KINDS,
    MANY_ROWS,
    ROD,
    SHORTEST_LOG,
    SLOWEST_LOG,
    TURNS,
    Accuracy,
    CampaignFile,
    Experiment,
    InputKind,
    Overview,
    beyond_any_machine,
    conversion,
    has_sign,
    moves_at_first,
    read_run,
    rolls_over_at,
    solenoid_side,
    stamp_statistics,
    turns_over,
)
from swashplate.documents import parse_toml, toml_key, toml_string, validated
from swashplate.entries import SCHEMA
from swashplate.errors import FileError, InputError
from swashplate.logs import (
    SINCE_1970,
    Calendar,
    Log,
    LogColumn,
    Stamps,
    TextOptions,
    calendar_of,
    open_log,
    second_of,
    split_unit,
)
from swashplate.parameters import NEUTRAL, preset_names
from swashplate.units import ambiguous_angle, plain_unit, speed_unit, to_si

Array = NDArray[np.float64]

HEADER = """\
# A draft, made from the headers of the logs: check each line that says "guessed", and settle each
# that says "FIXME": write the entry without a # in front, and delete the mark. No command reads
# the file before. Value of a signal: sign * (scale * number + offset), in its unit.
# Every entry is explained in the reference, "Campaign file"; `swashplate campaign check` reads
# all logs and says what is wrong with them.
"""
UNUSED = "# Columns that are not used"
BETWEEN = '# interpolation = "previous"    # held, "linear" or "jumps"; if omitted, a fit tries all'
NO_TIME = "# time = { rate = 512 }"
NO_ENCODER = "# No column looks like an encoder's counts"
UNORDERED = (
    "# No clock gives the time at which each run was recorded. A drift over the campaign is found "
    "only in the\n# order of time: sort the runs, or state recorded = 2026-05-04T13:20:00 in each."
)
SEVERAL = "# Several axes"
LEFT_OUT = "left out"
"""Marks what is said of logs that hold several axes, and of a log or a channel that is not read."""
TIME = (
    r"time|zeit|uhrzeit|zeitstempel|temps|heure|tijd|tid|tiempo|tempo|stamp|timestamp|time stamp|"
    r"datetime|date time|clock|t|seconds?|exp time|datenum|filetime"
)
"""Names of columns of time stamps; those of signals are in `KINDS`."""
PER = r"[_\s]+(?:(?:per|pro|je|par|por)[_\s]+)?(s|sec|sek|min)"
"""End of a unit whose fraction is written in words or without its bar: "deg_s", "deg per s"."""
COMPLEMENT = "(?: (?:of|der|des|du|de|del|della|do|da|van|av) .*)?"
"""Complement that may follow in such a name: "Drehzahl der Trommel"."""
DEGREES_AS_GRAD = re.compile(
    r"\b(?:\w*zeit|zeitstempel|\w*spannung|\w*drehzahl|\w*winkel|\w*strom|\w*druck|\w*wert|\w*weg|"
    r"\w*geschwindigkeit|hebel|stellgröße|stellgroesse|drehgeber|trommel|"
    r"tid|\w*vinkel|\w*hastighe[dt]|turtall|varvtal|omdrejningstal|sp[eæä]n[nd]ing|str[øö]m)\b"
)
"""German and Scandinavian words in the names of columns: there "grad" is a degree."""
INPUTS = get_args(InputKind)
HALVES = {"current_plus", "current_minus"}
SIGNED_NAME = r"\b(?:plus|minus|positive|negative)\b"
"""Names of the solenoids' currents that say which is which."""
PLC = re.compile(
    r"(?:PIW|PEW|PQW|PAW|AIW|AQW|IW|EW)\d*[_ ](?P<after>.+)|(?P<before>.+)[_ ](?:W|WORD|INT|RAW)",
    re.IGNORECASE,
)
"""Names of a PLC's words, such as "PIW_STROKE" and "JOY_W"."""
SMALLEST_WORD = 100
"""Whole numbers that reach no further are not a PLC's words, but percentages or volts."""
MILLIVOLTS = 10_500
"""Whole numbers that reach further are not the millivolts of a card, which takes 10 V."""
SIMATIC, SIMATIC_OVERRANGE = 27_648, 32_511
"""Full scale of a SIMATIC's word, and the largest one that it gives (Siemens, analog values)."""
OPEN_UNITS = ("stroker_pressure", "swash_angle", "spool_position")
"""Kinds whose unit stays open, as hardly a logger writes them in SI."""
TIME_UNITS = ("s", "sec", "ms", "us", "ns", "min", "h")
"""Units, in lower case, that a clock's name may end with."""
TICKS = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Units of whole numbers that count the time, and their size. [s]"""
COMMON, COMMON_LEVELS = 0.9, 0.98
"""Shares of a log's numbers, and of their different values, beyond which some may be marks for no
value: these last for up to a tenth of a log, and repeat themselves. [1]"""
SLOW_LOG = 20.0
"""Rate up to which microseconds may well be ticks of 100 ns: ten samples in half a second, in which
a drive has reached its speed, are few. [Hz]"""
OVERLAP = 0.1
"""Share of a log's length by which it may seem to begin before the one before it ended: file
systems round the time of writing to as much as 2 s. [1]"""
HELD_BACK_FROM = 4
"""Runs from which on one is held back for validation."""


TWO_SIDED = 0.25
"""Deflection to the smaller side, over the larger one, from which a maneuver has two sides. [1]"""


class _Guess(NamedTuple):
    """Guess of what a column is."""

    name: str
    kind: str = ""
    """``"time"``, a kind of input or of channel, or empty."""
    axis: str = ""
    """Beginning of its name, such as the "boom" of "Boom Cmd", or empty."""
    unit: str | None = None
    is_stated: bool = False
    """Whether the caller stated the kind."""
    in_header: bool = True
    """Whether its unit stands in brackets, or in a row of its own, where it is read from again."""
    rolls_over_at: float = 0.0
    """Reading after which an encoder's counter or an angle wraps; 0 if it does not."""
    unit_comment: str = "from its name"
    """Reason for its unit, next to the entry, if it is not in the header."""
    has_plc_name: bool = False
    """Whether its name is that of a PLC's word."""
    seems_input: bool = False
    """Whether it looks like an input, even where another column is stated to be it."""
    full_scale: int = 0
    """Reading of a PLC's word at full scale; 0 if the numbers are not such words."""


class _Axis(NamedTuple):
    """Columns of an axis: channels by name, and candidates for its input, best first."""

    inputs: list[_Guess]
    channels: dict[str, _Guess]


def draft_campaign(
    logs: Sequence[str | Path],
    folder: str | Path,
    drive: str | None = None,
    counts_per_turn: float | None = None,
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    title: str | None = None,
    options: TextOptions | None = None,
) -> str:
    """Text of a campaign file for some logs.

    Parameters
    ----------
    logs : sequence of paths
        The logs, one run each.
    folder : path
        Where the campaign file will lie; the logs are named from there.
    drive : str, optional
        A packaged drive or a parameter file for all axes; an axis that is called like a packaged
        drive has that one.
    counts_per_turn : float, optional
        Of all encoders. Without it the entry stays open, and the file is refused until it is given.
    columns, units : mapping of str to str, optional
        Kinds of some columns, ``"time"`` or one such as ``"voltage"``, and their units.
    title : str, optional
        Heading of the report; by default the folder's name, marked as guessed.
    options : TextOptions, optional
        Layout of text logs where it is ambiguous, such as the separator of thousands.

    Returns
    -------
    str
        Commented TOML that `Campaign.from_toml` reads, guesses marked as such. A run that could
        not be read has the role ``"ignore"``, and what no entry uses is in a comment, both with the
        reason. Where no column looks like an input or like a measurement, or a unit may mean two
        things, the line says FIXME, and the file is refused until it is mended.

    Raises
    ------
    FileError
        If a log cannot be opened.
    InputError
        If there is no log, none has a column that is named, or a unit that is given measures
        something else than the column's kind.

    Examples
    --------
    >>> from pathlib import Path
    >>> from swashplate import drafting, maneuvers, rig
    >>> file = rig.write(rig.run("hoist", {"step": maneuvers.step(9.0)}), "tests")
    >>> text = drafting.draft_campaign(sorted(Path("tests").glob("*.csv")), "tests", "hoist", 4096)
    >>> "[axes.hoist." in text
    True
    """
    if not logs:
        raise InputError("A draft needs at least one log.")
    kinds, units, folder = dict(columns or {}), dict(units or {}), Path(folder).resolve()
    opened = _with_common_names(
        [open_log(path, options=options) for path in logs], {*kinds, *units}
    )
    headers = dict[str, LogColumn]()
    for log in opened:
        for column in log.columns:
            headers.setdefault(column.name, column)
    _check_stated(headers, kinds, units)
    numbers = [_readable_columns(log, [column.name for column in log.columns]) for log in opened]
    blocks = {name: [log[name] for log in numbers if name in log] for name in headers}
    guesses = _guesses(headers, blocks, counts_per_turn, kinds, units)
    # an axis is called like its drive, but no machine like the start for any of them
    axes = _axes(guesses, "drive" if drive in (None, NEUTRAL) else Path(drive or "").stem)
    heading = f"schema = {SCHEMA}\ntitle = {toml_string(title or folder.name)}"
    if title is None:
        heading += "    # guessed, the folder's name: the report's heading; machine, place, author"
    lines = [HEADER, heading, "", *_format_lines(options)]
    for name, axis in axes.items():
        lines += _axis_lines(name, axis, guesses, blocks, opened[0], drive, counts_per_turn)
    lines += _several_lines(axes)
    lines += _unused_lines(guesses, axes, opened, numbers, counts_per_turn)
    lines += _run_lines(opened, numbers, axes, folder, text="\n".join(lines))
    return "\n".join(lines).rstrip() + "\n"


def _format_lines(options: TextOptions | None) -> list[str]:
    """The table of a text log's layout, none if it is recognised."""
    stated = {} if options is None else {k: v for k, v in vars(options).items() if v is not None}
    if not stated:
        return []
    entries = [
        f"{key} = {toml_string(value) if isinstance(value, str) else value}"
        for key, value in stated.items()
    ]
    return ["[format]", *entries, ""]


def _check_stated(
    headers: Mapping[str, LogColumn], kinds: Mapping[str, str], units: Mapping[str, str]
) -> None:
    """Refuse stated kinds and units that no column of the logs can have."""
    for name, kind in kinds.items():
        if kind not in ("time", *KINDS):
            raise InputError(f"'{name}' cannot be a '{kind}': it is time, {', '.join(KINDS)}.")
    for name in sorted({*kinds, *units}):
        if name not in headers:
            names = ", ".join(sorted(headers))
            raise InputError(f"No log has a column '{name}'; there are {names}.")
    for name in sorted(kinds.keys() & units.keys()):
        _check_unit(kinds[name], units[name], f"Column '{name}' ({kinds[name]})")


def _with_common_names(logs: Sequence[Log], stated: set[str]) -> list[Log]:
    """Logs in which a column whose unit changes from log to log is called without its unit.

    A logger that scales itself writes "Voltage [V]" in one log and "Voltage [mV]" in the next, or
    "Voltage_V" and "Voltage_mV". Columns that the caller states keep their names.
    """
    units = dict[str, dict[str, LogColumn]]()
    for log in logs:
        for column in log.columns:
            bare = _without_unit(column)
            if bare.unit is not None and column.name not in stated:
                units.setdefault(bare.name, {})[column.name] = bare
    renamed = {
        name: column
        for columns in units.values()
        if len(columns) > 1
        and all(_has_one(log, columns) for log in logs)
        and _is_one_quantity(list(columns.values()))
        for name, column in columns.items()
    }
    return [
        replace(log, columns=tuple(renamed.get(column.name, column) for column in log.columns))
        for log in logs
    ]


def _without_unit(column: LogColumn) -> LogColumn:
    """A column called without its unit, which stands in brackets or behind an underline."""
    if column.unit is not None:
        return column._replace(name=_without_brackets(column.name))
    stem, _, ending = column.name.rpartition("_")
    if stem and _by_header(column, None).unit == ending:
        return LogColumn(stem, ending)
    return column


def _without_brackets(name: str) -> str:
    """A name without what stands in brackets."""
    return re.sub(r"[\[(].*[\])]", "", name).strip()


def _has_one(log: Log, columns: Mapping[str, LogColumn]) -> bool:
    """Whether the common name of some columns means one of them in a log, or the log has none."""
    bare = next(iter(columns.values())).name
    if not any(_without_unit(column).name == bare for column in log.columns):
        return True
    try:
        return log.find(bare).name in columns
    except (FileError, InputError):
        return False


def _is_one_quantity(columns: Sequence[LogColumn]) -> bool:
    """Whether columns are of one kind, and their units of one quantity, as they are converted."""
    (kind, *others) = {_by_header(column, None).kind for column in columns}
    if others or not all(_is_unit_of(column.unit or "", kind) for column in columns):
        return False
    return kind == "time" or len({conversion(kind, column.unit, "")[0] for column in columns}) == 1


def _readable_columns(log: Log, names: list[str]) -> dict[str, Array]:
    """Those columns that hold numbers; the others are left out."""
    if not names:
        return {}
    try:
        return log.read(names)
    except FileError:
        half = len(names) // 2
        if half == 0:
            return {}
        return _readable_columns(log, names[:half]) | _readable_columns(log, names[half:])


# --- guesses of the columns -----------------------------------------------------------------------


def _words(name: str) -> str:
    """A name in lower-case words."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])|[_./\-\s]+", " ", name).strip().lower()


def _by_words(column: LogColumn, name: str, unit: str | None) -> _Guess:
    """Guess from a name and a unit: the first kind in the table that has either."""
    words = _words(name)
    if re.fullmatch(TIME, _words(name.rpartition("/")[2])):
        return _Guess(column.name, "time", "", column.unit)
    rotational_unit = speed_unit(plain_unit(unit or ""))
    first_kind = ""
    axis: str | None = None
    for kind, entry in KINDS.items():
        match = None
        if entry.words:
            match = re.fullmatch(rf"(?:(.*) )?(?:{entry.words}){COMPLEMENT}", words)
        if match is not None and axis is None:
            axis = match[1] or ""
        if not first_kind and (match is not None or rotational_unit in entry.marks):
            first_kind = kind
    numbered = re.fullmatch(r"(.+) (\d+|[ab]|left|right|links|rechts)", words)
    if axis is None and numbered is not None:
        of_name = _by_words(column, numbered[1], unit)
        if numbered[2] in ("a", "b") and of_name.kind in CURRENTS:
            # the solenoids of one card
            return _Guess(column.name, first_kind, "", column.unit)
        return of_name._replace(axis=f"{of_name.axis} {numbered[2]}".strip())
    return _Guess(column.name, first_kind, axis or "", column.unit)


def _by_header(column: LogColumn, kind: str | None) -> _Guess:
    """Guess from a header, of a kind if it is stated; the unit may be the end of its name."""
    name = _without_brackets(column.name)
    plc_name = PLC.fullmatch(name) if column.unit is None else None
    if plc_name is not None:
        name = plc_name["after"] or plc_name["before"]
    unit = column.unit or ("rpm" if re.search(TURNS, name.lower()) else None)
    by_name = _by_words(column, name, unit)
    if kind is not None:
        by_name = by_name._replace(kind=kind)
    for stem, ending in _units_behind(name) if column.unit is None else ():
        by_stem = _by_words(column, stem, None)
        if by_stem.kind == "other" and ending in ("V", "mV"):
            by_stem = by_stem._replace(kind="voltage")
        if kind is not None:
            by_stem = by_stem._replace(kind=kind)
        is_unit = _is_unit_of(ending, by_stem.kind) or _counts_in_grad(by_stem.kind, ending)
        if is_unit and by_name.kind not in HALVES and not ending.isdigit():
            return by_stem._replace(unit=ending, in_header=False)
    return by_name._replace(
        unit=unit if by_name.kind == "shaft_speed" else column.unit,
        in_header=column.unit is not None,
        has_plc_name=plc_name is not None,
    )


def _units_behind(name: str) -> Iterator[tuple[str, str]]:
    """What may be units at the end of a name, longest first, each with the name before it.

    "speed_deg_s", "speed deg per s" and "speed in deg/s" are in deg/s; without the words of a
    signal before it, the last word is the unit.
    """
    quotient = re.fullmatch(rf"(.+?)[_\s]+([^_\s]+){PER}", name)
    if quotient:
        yield _without_in(quotient[1]), f"{quotient[2]}/{quotient[3]}"
    stem, _, ending = re.sub(r"[_\s]+", " ", name).rpartition(" ")
    yield _without_in(stem), ending


def _without_in(name: str) -> str:
    """A name without the "in" that leads to its unit."""
    return re.sub(r"[_\s]+in$", "", name)


def _check_unit(kind: str, unit: str, what: str) -> None:
    """Refuse a unit in which a kind of signal, or time, is not measured."""
    if kind == "time":
        second_of(unit, what)
    else:
        conversion(kind, unit, what)


def _is_unit_of(unit: str, kind: str) -> bool:
    """Whether a kind of signal, or time, is measured in a unit; encoder counts have no unit."""
    has_units = kind == "time" or (kind in KINDS and bool(KINDS[kind].units))
    if not has_units or kind == "encoder_counts":
        return False
    try:
        _check_unit(kind, unit, "")
    except InputError:
        return False
    return True


def _counts_in_grad(kind: str, unit: str | None) -> bool:
    """Whether a kind measures an angle or its rate, and a unit counts that in "grad"."""
    of_angle = kind in KINDS and not {"rad", "rad/s"}.isdisjoint(KINDS[kind].units)
    return of_angle and bool(ambiguous_angle(unit or ""))


def _signal_of_clock(name: str) -> str:
    """The signal, in words, whose clock a column such as "Speed time" or "t_speed" is, or empty."""
    if re.fullmatch(TIME, _words(name.rpartition("/")[2])):
        return ""  # the clock of a group
    clock = "(?:time|zeit|timestamp|time stamp|stamp|t)"
    match = re.fullmatch(rf"{clock} (.+)|(.+) {clock}", _words(split_unit(name)[0]))
    return match[1] or match[2] if match else ""


def _is_clock(column: LogColumn, blocks: Sequence[Array]) -> bool:
    """Whether a column is called like a clock of something, "t_cmd", and its numbers increase."""
    if not _signal_of_clock(column.name) or not _is_unit_of(column.unit or "s", "time"):
        return False
    finite = [part[np.isfinite(part)] for part in blocks]
    return all(part.size > 1 and bool(np.all(np.diff(part) > 0.0)) for part in finite)


def _clock_by_header(column: LogColumn) -> _Guess:
    """Guess of a clock called like something else; of "TimeMs" that is its unit."""
    ending = _signal_of_clock(column.name)
    unit = ending if column.unit is None and ending in TIME_UNITS else column.unit
    return _Guess(column.name, "time", "", unit, in_header=column.unit is not None)


def _guesses(
    headers: Mapping[str, LogColumn],
    blocks: Mapping[str, list[Array]],
    counts_per_turn: float | None,
    kinds: Mapping[str, str],
    units: Mapping[str, str],
) -> list[_Guess]:
    """Guesses by headers, and by the numbers of all logs.

    A column that is stated to be time or input takes the place of those that were guessed. Half a
    current without the other half is a whole one.
    """
    taken = set[str]()
    if "time" in kinds.values():
        taken.add("time")
    if "voltage" in kinds.values() or "current" in kinds.values():
        taken.update(INPUTS)
    is_german = any(DEGREES_AS_GRAD.search(_words(name)) for name in headers)
    guesses = list[_Guess]()
    names = {_words(split_unit(name)[0]) for name in headers}
    unnamed = _unnamed_clock(headers, blocks, kinds)
    for name, column in headers.items():
        guess = _by_header(column, kinds.get(name))
        if _signal_of_clock(name) in names or _is_clock(column, blocks[name]):
            guess = _clock_by_header(column)
        guess = guess._replace(seems_input=guess.kind in INPUTS)
        if name in kinds:
            guess = guess._replace(kind=kinds[name], is_stated=True)
        elif guess.kind in taken:
            guess = guess._replace(kind="")
        values = [part for part in blocks[name] if part.size]
        if is_german and _counts_in_grad(guess.kind, guess.unit):
            degrees, _ = ambiguous_angle(guess.unit or "")
            comment = f"guessed: {guess.unit}, of a log with German or Scandinavian names"
            guess = guess._replace(unit=degrees, in_header=False, unit_comment=comment)
        if name in units:
            guess = guess._replace(unit=units[name], in_header=False, unit_comment="given")
        else:
            if guess.kind == "time" or name == unnamed:
                guess = _of_calendar(guess, _calendar(values))
            if guess.unit is None:
                guess = _with_unit_of_numbers(guess, values)
        guesses.append(_by_numbers(guess, values, counts_per_turn))
    guesses = _with_halves(guesses, blocks)
    present = {(guess.axis, guess.kind) for guess in guesses}
    for index, guess in enumerate(guesses):
        is_half = guess.kind in HALVES and not guess.is_stated
        if is_half and any((guess.axis, half) not in present for half in HALVES):
            guesses[index] = guess._replace(kind="rectified_current")
    return guesses


def _with_halves(guesses: Sequence[_Guess], blocks: Mapping[str, list[Array]]) -> list[_Guess]:
    """Guesses in which two currents that take turns are those of both solenoids.

    Which is which follows from the command while each flows, whatever they are called, unless their
    names say plus and minus.
    """
    changed = {guess.name: guess for guess in guesses}
    for axis in dict.fromkeys(guess.axis for guess in guesses):
        of_axis = [guess for guess in guesses if guess.axis == axis]
        currents = [
            guess
            for guess in of_axis
            if guess.kind in ("rectified_current", *HALVES) and not guess.is_stated
        ]
        command = next((guess for guess in of_axis if guess.kind in INPUTS), None)
        named = any(re.search(SIGNED_NAME, _words(guess.name)) for guess in currents)
        if len(currents) != 2 or command is None or named:
            continue
        first, second = currents
        side = solenoid_side(blocks[command.name], blocks[first.name], blocks[second.name])
        kinds = ("current_plus", "current_minus")[:: side or 1]
        for guess, kind in zip(currents, kinds, strict=True):
            if side:
                changed[guess.name] = guess._replace(kind=kind)
    return list(changed.values())


def _by_numbers(guess: _Guess, blocks: Sequence[Array], counts_per_turn: float | None) -> _Guess:
    """Guess of a column with what its numbers tell of its kind and its range.

    A current has a sign if it goes to minus its peak in any log; whole numbers that begin again at
    their end are an encoder's, whatever their name.
    """
    if guess.kind == "encoder_counts" or not (guess.kind or guess.unit):
        size = max((rolls_over_at(part, counts_per_turn) for part in blocks), default=0)
        kind = "encoder_counts" if size else guess.kind
        return guess._replace(kind=kind, rolls_over_at=size)
    if guess.kind == "position":
        return guess._replace(rolls_over_at=_turn(blocks, guess.unit or "deg"))
    if guess.kind == "rectified_current" and not guess.is_stated and has_sign(blocks):
        return guess._replace(kind="signed_current")
    return guess


def _calendar(blocks: Sequence[Array]) -> Calendar | None:
    """The calendar that a column's numbers can only be of, if they are and increase."""
    calendars = {calendar_of(Stamps.of(part)) for part in blocks}
    finite = [part[np.isfinite(part)] for part in blocks]
    increase = all(bool(np.all(np.diff(part) > 0.0)) for part in finite)
    return calendars.pop() if increase and len(calendars) == 1 else None


def _unnamed_clock(
    headers: Mapping[str, LogColumn], blocks: Mapping[str, list[Array]], kinds: Mapping[str, str]
) -> str:
    """The only column whose numbers are a calendar's, if none is called like a clock; or empty."""
    guesses = [_by_header(column, kinds.get(name)) for name, column in headers.items()]
    if any(guess.kind == "time" for guess in guesses):
        return ""
    dated = [name for name in headers if name not in kinds and _calendar(blocks[name])]
    return dated[0] if len(dated) == 1 else ""


def _of_calendar(guess: _Guess, calendar: Calendar | None) -> _Guess:
    """Guess of a clock with the unit of its calendar, unless its own is of the same size."""
    if calendar is None:
        return guess
    guess = guess._replace(kind="time")
    if guess.unit is not None and _is_unit_of(guess.unit, "time"):
        size = second_of(calendar.unit, "")
        if isclose(second_of(guess.unit, ""), size, rel_tol=1e-6):
            return guess
    reason = f"from its numbers, {calendar.name}"
    return guess._replace(unit=calendar.unit, in_header=False, unit_comment=reason)


def _with_unit_of_numbers(signal: _Guess, blocks: Sequence[Array]) -> _Guess:
    """Guess of a column whose header gives no unit, with one that its numbers suggest."""
    finite = [part[np.isfinite(part)] for part in blocks]
    if signal.kind == "time":
        unit, comment = _time_unit(finite)
        return signal._replace(unit=unit, unit_comment=comment)
    if signal.kind in ("", "encoder_counts", "position") or not finite:
        return signal
    full = _full_scale(finite, has_plc_name=signal.has_plc_name)
    if full:
        return signal._replace(full_scale=full)
    largest = max(float(np.abs(part).max(initial=0.0)) for part in finite)
    if signal.kind == "voltage" and largest > SMALLEST_WORD and _are_whole_numbers(finite):
        comment = f"guessed: whole numbers up to {largest:.9g}"
        return signal._replace(unit="mV", unit_comment=comment)
    return signal


def _are_whole_numbers(blocks: Sequence[Array]) -> bool:
    """Whether all numbers are whole."""
    return all(bool(np.all(part == np.floor(part))) for part in blocks)


def _time_unit(blocks: Sequence[Array]) -> tuple[str, str]:
    """Unit of stamps without one, and the comment that gives the reason.

    Seconds, unless they are whole numbers of which a step of one second or more would make a log
    too slow for any motion: then the largest unit in which it is fast enough. Open if seconds make
    a log too slow, or too short, for any motion.
    """
    steps = [float(np.median(np.diff(part))) for part in blocks if part.size > 1]
    step = float(np.median(steps)) if steps else 0.0
    spans = [float(np.ptp(part)) for part in blocks if part.size >= MANY_ROWS]
    if step > 1.0 / SLOWEST_LOG and not _are_whole_numbers(blocks):
        return "s", f"{FIXME}: the header gives none, and in s it has {1.0 / step:.3g} Hz"
    if spans and max(spans) < SHORTEST_LOG:
        return "s", f"{FIXME}: the header gives none, and in s it lasts {max(spans):.3g} s"
    if step < 1.0 / SLOWEST_LOG or not _are_whole_numbers(blocks):
        return "s", "guessed: the header gives none"
    fast = (unit for unit, size in TICKS.items() if step * size <= 1.0 / SLOWEST_LOG)
    unit = next(fast, "ns")
    rate = 1.0 / (step * TICKS[unit])
    since_1970 = bool(blocks[0].size) and TICKS[unit] * float(blocks[0][0]) > SINCE_1970
    if unit == "us" and rate <= SLOW_LOG and not since_1970:
        readings = f"{rate:.4g} Hz in us, {10.0 * rate:.4g} Hz in 100 ns"
        return unit, f"{FIXME}: whole numbers that step by {step:.9g}, {readings}"
    return unit, f"guessed: whole numbers that step by {step:.9g}, {rate:.4g} Hz in {unit}"


def _full_scale(blocks: Sequence[Array], *, has_plc_name: bool) -> int:
    """Reading at full scale of numbers that may be a PLC's words of 16 bits, or 0.

    A word is a whole number too large to be of a physical unit, or called so by its column. 27648
    is the full scale of SIMATIC, 16384 and 32767 that of others, whose words end there.
    """
    largest = max(float(np.abs(part).max(initial=0.0)) for part in blocks)
    least = SMALLEST_WORD if has_plc_name else MILLIVOLTS
    if not _are_whole_numbers(blocks) or not least < largest <= 1 << 15:
        return 0
    if largest in (16383.0, 16384.0):
        return 16384
    return SIMATIC if largest <= SIMATIC_OVERRANGE else max(int(largest), 32767)


def _turn(values: Sequence[Array], unit: str) -> float:
    """A whole turn in a unit if positions jump by it, 0 if not or if the unit is not an angle's."""
    try:
        turn = 2.0 * pi / to_si(1.0, unit, "rad", "")
    except InputError:
        return 0.0
    return turn if any(turns_over(part, turn) for part in values) else 0.0


def _axes(guesses: Sequence[_Guess], plain: str) -> dict[str, _Axis]:
    """Inputs and channels under the axis that their names begin with.

    An axis needs an input and a channel; columns without a prefix belong to the only axis.
    """
    prefixes = dict.fromkeys(guess.axis for guess in guesses if guess.kind in INPUTS and guess.axis)
    axes = dict[str, _Axis]()
    for prefix in prefixes:
        axis = _axis_of([guess for guess in guesses if guess.axis == prefix])
        if axis.channels:
            axes[prefix] = axis
    if len(axes) > 1:
        return axes
    others = _of_other_axes(guesses)
    return {plain: _axis_of([guess for guess in guesses if guess.name not in others])}


def _of_other_axes(guesses: Sequence[_Guess]) -> dict[str, str]:
    """Channels of other axes than the only one that has an input here: their names and axes.

    By the beginning of their names, if the input has a channel that begins as it does: another
    column that begins like the channel looks like an input, or both axes measure one quantity.
    """
    own = next((guess.axis for guess in guesses if guess.kind in INPUTS), "")
    channels = [guess for guess in guesses if guess.kind not in ("", "time", *INPUTS)]
    measured = {guess.kind for guess in channels if guess.axis == own}
    if not own or not measured:
        return {}
    commanded = {guess.axis for guess in guesses if guess.seems_input}
    return {
        guess.name: guess.axis
        for guess in channels
        if guess.axis not in ("", own)
        and not guess.is_stated
        and (guess.axis in commanded or guess.kind in measured)
    }


def _axis_of(guesses: Sequence[_Guess]) -> _Axis:
    """Inputs and channels among the columns of an axis."""
    axis = _Axis([guess for guess in guesses if guess.kind in INPUTS], {})
    for guess in guesses:
        if guess.kind not in ("", "time", *INPUTS):
            number = 1 + sum(guess.kind == channel.kind for channel in axis.channels.values())
            axis.channels[guess.kind if number == 1 else f"{guess.kind}_{number}"] = guess
    return axis


# --- text of the file -----------------------------------------------------------------------------


def _axis_lines(
    name: str,
    axis: _Axis,
    guesses: Sequence[_Guess],
    blocks: Mapping[str, list[Array]],
    log: Log,
    drive: str | None,
    counts_per_turn: float | None,
) -> list[str]:
    """Lines of an axis' tables; entries that the first log does not show stay open."""
    drive_line = '# drive = "hoist"    # a packaged drive or a parameter file, to be fitted'
    if drive is not None:
        drive_line = f"drive = {toml_string(name if name in preset_names() else drive)}"
    clocks = {guess.name: _clock(guess, guesses, blocks, log.left_out) for guess in guesses}
    main = next((clocks[guess.name] for guess in (*axis.inputs, *guesses)), "")
    if not main:
        main = f"{NO_TIME}    # {FIXME}: no column of time found; samples a second"
    start = 'start = "rest"    # at the first sample: rest, steady or estimated'
    names = ", ".join(repr(column.name) for column in log.columns)
    open_column = f'column = "{FIXME}"    # which of {names}'
    input_kind = f'kind = "voltage"    # {FIXME}: or current, or other'
    tables = {"input": [input_kind, f"{open_column} commands?"]}
    if not axis.channels:
        channel_kind = f'kind = "shaft_speed"    # {FIXME}: or position, encoder_counts ...'
        tables["channels.measured"] = [channel_kind, f"{open_column} was measured?"]
    signals = [("input", guess) for guess in axis.inputs[:1]]
    signals += [(f"channels.{toml_key(key)}", channel) for key, channel in axis.channels.items()]
    for table, signal in signals:
        tables[table] = _signal_lines(signal, blocks[signal.name], counts_per_turn)
        if clocks[signal.name] not in ("", main):
            tables[table].append(clocks[signal.name])
    tables["input"].append(BETWEEN)
    for guess in axis.inputs[1:]:
        tables["input"].append(f"# another input? '{guess.name}'")
    lines = [f"[axes.{toml_key(name)}]", drive_line, main, start, ""]
    for table, entries in tables.items():
        lines += [f"[axes.{toml_key(name)}.{table}]", *entries, ""]
    return lines


def _clock(
    signal: _Guess,
    guesses: Sequence[_Guess],
    blocks: Mapping[str, Sequence[Array]],
    left_out: Mapping[str, str],
) -> str:
    """A signal's line of time: its own column of time, or the first of its group, or of all.

    Of several clocks that are called like something else it is the only one of its length; it is
    open if there are more, or if its own is left out of the log, by its name in `left_out`.
    """
    times = [guess for guess in guesses if guess.kind == "time"]
    if not times:
        return ""
    words, group = _words(split_unit(signal.name)[0]), signal.name.rpartition("/")[0]
    for name in (f"{signal.name} time", f"{group}/time"):
        if name in left_out:
            return f"{NO_TIME}    # {FIXME}: '{name}': {left_out[name]}"
    own = [guess for guess in times if _signal_of_clock(guess.name) == words]
    # the clock of another signal is no clock of all
    common = [guess for guess in times if not _signal_of_clock(guess.name)] or times
    rows = [part.size for part in blocks[signal.name]]
    if common == times:
        common = [guess for guess in times if [p.size for p in blocks[guess.name]] == rows] or times
    of_group = [guess for guess in common if guess.name.rpartition("/")[0] == group]
    time = [*own, *of_group, *common][0]
    column = f"column = {toml_string(time.name)}"
    if not own and len(common) > 1 and all(_signal_of_clock(guess.name) for guess in common):
        choices = " or ".join(repr(guess.name) for guess in common)
        reason = f"the clock of '{signal.name}' is {choices}"
        return f"# time = {{ {column} }}    # {FIXME}: {reason}"
    if time.in_header:
        return f"time = {{ {column} }}"
    return f"time = {{ {column}, unit = {toml_string(time.unit or 's')} }}    # {time.unit_comment}"


def _signal_lines(
    guess: _Guess, blocks: Sequence[Array], counts_per_turn: float | None
) -> list[str]:
    """Entries of an input or a channel."""
    may_be_command = guess.kind in ("other", "voltage")
    is_percent = may_be_command and guess.unit == "%"
    is_scaled_command = is_percent or (may_be_command and guess.full_scale > 0)
    kind = "voltage" if is_scaled_command else guess.kind
    scale = 1.0
    mark = "" if guess.is_stated and kind == guess.kind else "guessed: "
    lines = [
        f'kind = "{kind}"    # {mark}{KINDS[kind].meaning}',
        f"column = {toml_string(guess.name)}",
    ]
    if is_percent:
        scale = 0.1
        lines += ['unit = "V"', "scale = 0.1    # guessed: 100 % is taken as the 10 V of a card"]
    elif is_scaled_command:
        # rounded down, or the largest word would be beyond the 10 V that a card takes
        scale = floor(1e12 * 10.0 / guess.full_scale) / 1e12
        reason = f"guessed: 10 V over {guess.full_scale}, a PLC's word at full scale"
        lines += ['unit = "V"', f"scale = {scale:.9g}    # {reason}"]
    elif kind == "encoder_counts":
        lines += _encoder_lines(counts_per_turn)
    else:
        lines += _unit_lines(guess, blocks)
    if guess.full_scale and not is_scaled_command:
        reason = (
            f"range of the instrument over {guess.full_scale}, as of a PLC's word at full scale"
        )
        lines.append(f"# scale = 1.0    # {FIXME}: {reason}")
    if guess.rolls_over_at:
        lines.append(f"rolls_over_at = {guess.rolls_over_at:.9g}    # guessed: wraps there")
    empty = sum(int(np.count_nonzero(~np.isfinite(part))) for part in blocks)
    if empty:
        lines.append(f'missing = "drop"    # guessed: {empty} cells are empty')
    neutral = _first_number(blocks)
    if neutral and guess.kind == "other":
        reason = "guessed: the first sample is neutral"
        lines.append(f"offset = {-scale * neutral:.9g}    # {reason}")
    return lines + _accuracy_lines(kind, "V" if is_scaled_command else guess.unit)


def _first_number(blocks: Sequence[Array]) -> float:
    """The first finite number of the logs, 0 without one."""
    for part in blocks:
        finite = part[np.isfinite(part)]
        if finite.size:
            return float(finite[0])
    return 0.0


def _common_peak(sizes: Array) -> float:
    """What many of some numbers (n,), or of their different values, go beyond."""
    levels = np.quantile(np.unique(sizes), COMMON_LEVELS, method="lower")
    return max(float(np.quantile(sizes, COMMON)), float(levels))


def _encoder_lines(counts_per_turn: float | None) -> list[str]:
    """Entries of an encoder, whose counts for a turn stay open if they are not stated."""
    counts = f"# counts_per_turn = 1000    # {FIXME}: per turn, quadrature included"
    if counts_per_turn is not None:
        counts = f"counts_per_turn = {counts_per_turn:.12g}"
    return [counts, "gear_ratio = 1.0    # turns of the encoder per turn of the shaft"]


def _accuracy_lines(kind: str, unit: str | None) -> list[str]:
    """Assumed accuracy of an instrument, as a comment that is easily made an entry."""
    assumed = ASSUMED_ACCURACY.get(kind, Accuracy())
    limits = {"gain": assumed.gain, "zero": assumed.zero}
    if not any(limits.values()):
        return []
    try:
        _, factor, _ = conversion(kind, unit, kind)
    except InputError:
        # `_unit_lines` has left the unit open, so a zero in it means nothing yet
        return []
    limits["zero"] /= factor
    stated = ", ".join(f"{name} = {limit:.3g}" for name, limit in limits.items())
    unit = unit or KINDS[kind].units[0]
    meaning = f"share of the reading, and {unit}; assumed, see its data sheet"
    return [f"# accuracy = {{ {stated} }}    # {meaning}"]


def _unit_lines(signal: _Guess, blocks: Sequence[Array]) -> list[str]:
    """The entry of a signal's unit, none if the header has it, open if no guess fits it."""
    units = KINDS[signal.kind].units
    usual = units[0] if units else "1"
    if signal.unit is not None and units and not _is_unit_of(signal.unit, signal.kind):
        choices = " or ".join(ambiguous_angle(signal.unit))
        reason = f"'{signal.unit}', as the header has it, is not a unit of a {signal.kind}"
        if choices and _counts_in_grad(signal.kind, signal.unit):
            reason = f"'{signal.unit}', as the header has it, is ambiguous: {choices}"
        return [f"# unit = {toml_string(usual)}    # {FIXME}: {reason}"]
    if signal.in_header:
        return []
    if signal.unit is not None:
        return [f"unit = {toml_string(signal.unit)}    # {signal.unit_comment}"]
    if signal.rolls_over_at:
        usual = "deg"
    elif signal.kind == "position" and _is_rod(signal.name):
        usual = "mm"
    if signal.kind in OPEN_UNITS:
        return [f"# unit = {toml_string(usual)}    # {FIXME}: the header gives none"]
    if beyond := _beyond_guessed_unit(signal.kind, usual, blocks):
        reason = f"the header gives none, and in {usual} it would reach {beyond}"
        return [f"# unit = {toml_string(usual)}    # {FIXME}: {reason}"]
    return [f"unit = {toml_string(usual)}    # guessed: the header gives none"]


def _beyond_guessed_unit(kind: str, unit: str, blocks: Sequence[Array]) -> str:
    """A value that a signal would have in a guessed unit, and why it cannot; empty if it can.

    A few numbers far beyond all others may be marks for no value.
    """
    finite = [np.abs(part[np.isfinite(part)]) for part in blocks]
    peak = max((_common_peak(part) for part in finite if part.size), default=0.0)
    if kind == "voltage":
        beyond_card = f"{peak:.4g} V, but a card takes 10 V"
        return beyond_card if peak > 10.0 * SIMATIC_OVERRANGE / SIMATIC else ""
    if not KINDS[kind].units:
        return ""
    si, factor, zero = conversion(kind, unit, "")
    return beyond_any_machine(kind, si, factor * peak + zero)


def _is_rod(name: str) -> bool:
    """Whether a column is called like the position of a rod."""
    return bool(re.fullmatch(rf"(?:.* )?(?:{ROD}){COMPLEMENT}", _words(name)))


def _several_lines(axes: Mapping[str, _Axis]) -> list[str]:
    """A comment if the logs hold several axes, or seem to."""
    if len(axes) > 1:
        return [f"{SEVERAL}, by the beginnings of the columns' names: {', '.join(axes)}", ""]
    (axis,) = axes.values()
    kinds = Counter(guess.kind for guess in axis.channels.values())
    alike = [guess for guess in axis.channels.values() if kinds[guess.kind] > 1]
    if len(axis.inputs) > 1 and alike:
        listed = f"Inputs: {_names(axis.inputs)}; channels: {_names(axis.channels.values())}"
    elif len({guess.axis for guess in alike}) > 1:
        listed = f"Channels alike: {_names(alike)}"
    else:
        return []
    return [
        f"{SEVERAL}? {listed}: keep those of one axis here, and write another [axes.NAME] for each "
        "other one",
        "",
    ]


def _names(guesses: Iterable[_Guess]) -> str:
    """Names of columns in a row."""
    return ", ".join(guess.name for guess in guesses)


def _unused_lines(
    guesses: Sequence[_Guess],
    axes: Mapping[str, _Axis],
    logs: Sequence[Log],
    numbers: Sequence[Mapping[str, Array]],
    counts_per_turn: float | None,
) -> list[str]:
    """Comments on what no entry uses: columns of the logs, with a reason, and counts of a turn."""
    used = [guess for axis in axes.values() for guess in (*axis.inputs, *axis.channels.values())]
    taken = {guess.name for guess in (*used, *guesses) if guess in used or guess.kind == "time"}
    reasons = {name: f"of axis '{axis}'" for name, axis in _of_other_axes(guesses).items()}
    where = dict[str, list[str]]()
    for log, readable in zip(logs, numbers, strict=True):
        for column in log.columns:
            if column.name not in readable:
                reasons.setdefault(column.name, "it holds cells that are no numbers")
            if column.name not in taken:
                where.setdefault(column.name, []).append(log.path.name)
        for name, reason in log.left_out.items():
            reasons.setdefault(name, reason)
            where.setdefault(name, []).append(log.path.name)
    unused = list[str]()
    for name, files in where.items():
        remarks = [reasons[name]] if name in reasons else []
        if len(files) < len(logs):
            remarks.append(f"only in {', '.join(files)}")
        unused.append(f"{name} ({'; '.join(remarks)})" if remarks else name)
    lines = list[str]()
    if unused:
        lines += [f"{UNUSED}: {', '.join(unused)}", ""]
    if counts_per_turn is not None and all(guess.kind != "encoder_counts" for guess in used):
        among = f" among {', '.join(where)}" if where else ""
        lines += [f"{NO_ENCODER}{among}; counts_per_turn = {counts_per_turn:.12g} is left out", ""]
    return lines


# --- runs -----------------------------------------------------------------------------------------


class _DraftedRun(NamedTuple):
    """Entries of a run, and what its place among the others depends on."""

    file: str
    """Value of the entry, and its comment."""
    role: str
    """Value of the entry, and its comment."""
    entries: list[str]
    """The lines after these two."""
    stratum: str = ""
    """Kinds and directions of its maneuvers, axis by axis."""
    peak: float = 0.0
    """Largest change of an input from its first sample. [unit of the input]"""
    written: float = 0.0
    """When its file was last written, in seconds since 1970. [s]"""
    duration: float | None = None
    """None if it could not be read. [s]"""
    recorded: float | None = None
    """When it begins, if its stamps are of a calendar. [s]"""


def _run_lines(
    logs: Sequence[Log],
    numbers: Sequence[Mapping[str, Array]],
    axes: Mapping[str, _Axis],
    folder: Path,
    text: str,
) -> list[str]:
    """Lines of all runs, in the order of time; the lines of the file above them are the text."""
    runs = list[_DraftedRun]()
    stems = [log.path.stem for log in logs]
    for log, columns in zip(logs, numbers, strict=True):
        run = _drafted_run(log, columns, axes, folder, text)
        if stems.count(log.path.stem) > 1:
            # logs of one name in several folders, or formats
            path = log.path.resolve()
            run.entries.insert(0, f"name = {toml_string(f'{path.parent.name}/{path.name}')}")
        runs.append(run)
    held_back = _held_back([run for run in runs if run.role == '"fit"'])
    runs, lines = _sorted_by_recording(runs)
    for run in runs:
        role = '"validate"' if run is held_back else run.role
        lines += ["[[runs]]", f"file = {run.file}", f"role = {role}", *run.entries, ""]
    return lines


def _drafted_run(
    log: Log, columns: Mapping[str, Array], axes: Mapping[str, _Axis], folder: Path, text: str
) -> _DraftedRun:
    """Run of a log, with its columns of numbers; ignored if the file could not be read with it.

    The other lines of the file are the text.
    """
    path = log.path.resolve()
    file = (path.relative_to(folder) if path.is_relative_to(folder) else path).as_posix()
    rows = max((column.size for column in columns.values()), default=0)
    tested, entries = _tested_axes(log, columns, axes)
    run = _DraftedRun(
        file=f"{toml_string(file)}    # {rows} samples",
        role='"fit"',
        entries=entries,
        written=path.stat().st_mtime,
    )
    if not tested:
        reason = _untested_reason(log, axes)
        return run._replace(role=f'"ignore"    # {LEFT_OUT}: {reason}')
    if f'column = "{FIXME}"' in text:
        return run
    try:
        experiments, overview = _trial_reading(log, run, text)
    except (FileError, InputError) as error:
        return run._replace(role=f'"ignore"    # {LEFT_OUT}: {error}')
    duration = float(experiments[-1].input.time[-1] - experiments[0].input.time[0])
    if overview is not None:
        duration = overview.end - overview.begin
    comment = ""
    if NO_TIME not in text:
        comment = _sampling_words(experiments, overview, duration)
    first_of_axis = dict[str, Experiment]()
    for experiment in experiments:
        first_of_axis.setdefault(experiment.axis, experiment)
    stratum, peak = "", 0.0
    for experiment in first_of_axis.values():
        if experiment.input.kind == "voltage":
            comment += f", {experiment.maneuver}"
        if moves_at_first(experiment):
            entry = f"axes.{toml_key(experiment.axis)}.{ESTIMATED_START}"
            entries.append(f"{entry}    # guessed: it begins in motion")
        deflection = _deflection(experiment)
        kind = experiment.recognised.kind if experiment.recognised else ""
        stratum += f"{kind} {deflection.direction}, "
        peak = max(peak, deflection.peak)
    return run._replace(
        file=run.file + comment,
        stratum=stratum,
        peak=peak,
        duration=duration,
        recorded=experiments[0].recorded,
    )


def _tested_axes(
    log: Log, columns: Mapping[str, Array], axes: Mapping[str, _Axis]
) -> tuple[list[str], list[str]]:
    """Axes that a log tests, and entries that say which of them, and which channels it lacks.

    It tests an axis if it has its input and any of its channels with a number in it.
    """
    names = {column.name for column in log.columns}
    empty = {name for name, values in columns.items() if not np.isfinite(values).any()}
    tested, entries = list[str](), list[str]()
    for name, axis in axes.items():
        channels = axis.channels.values()
        has_input = not axis.inputs or axis.inputs[0].name in names
        has_channel = not channels or any(guess.name in names - empty for guess in channels)
        if not (has_input and has_channel):
            continue
        tested.append(name)
        for key, guess in axis.channels.items():
            if guess.name not in names:
                entry = f"axes.{toml_key(name)}.channels.{toml_key(key)} = false"
                entries.append(f"{entry}    # {LEFT_OUT}: no column {toml_string(guess.name)}")
    if tested and len(tested) < len(axes):
        entries.insert(0, f"only = [{', '.join(map(toml_string, tested))}]")
    return tested, entries


def _untested_reason(log: Log, axes: Mapping[str, _Axis]) -> str:
    """Reason for which a log tests no axis."""
    names = {column.name for column in log.columns}
    inputs = [axis.inputs[0].name for axis in axes.values() if axis.inputs]
    listed = ", ".join(repr(column.name) for column in log.columns)
    if inputs and names.isdisjoint(inputs):
        missing = " or ".join(map(repr, inputs))
        return f"it has no input: no column {missing} among {listed}"
    return f"it has no number of any channel in {listed}"


def _trial_reading(
    log: Log, run: _DraftedRun, text: str
) -> tuple[Sequence[Experiment], Overview | None]:
    """Experiments of a run as the drafted file has it, with entries in place of open ones."""
    text = re.sub(rf"^# (?=\w+ = .*# {FIXME})", "", text, flags=re.MULTILINE)
    text = "\n".join([text, "[[runs]]", f"file = {run.file}", *run.entries])
    content = validated(parse_toml(text, "the draft"), CampaignFile, "the draft")
    return read_run("the draft", "run", content.runs[0], content.axes, log)


def _sampling_words(
    experiments: Sequence[Experiment], overview: Overview | None, duration: float
) -> str:
    """Duration [s] and rate of a run, and its parts, for the comment next to its file."""
    of_axis = [experiment for experiment in experiments if experiment.axis == experiments[0].axis]
    rate = stamp_statistics(of_axis[0].input.time).rate
    comment = f", {duration:.4g} s at {rate:.4g} Hz"
    if overview is not None:
        comment += f", {len(of_axis)} of {len(overview.windows)} windows with motion used"
    elif len(of_axis) > 1:
        comment += f" in {len(of_axis)} parts"
    return comment


class _Deflection(NamedTuple):
    """Change of an input from its first sample."""

    direction: str
    """``"up"``, ``"down"`` or ``"two_sided"``."""
    peak: float
    """[unit of the input]"""


def _deflection(experiment: Experiment) -> _Deflection:
    """Direction and peak of an experiment's input."""
    change = experiment.input.values - experiment.input.values[0]
    low, high = -float(change.min()), float(change.max())
    larger = max(low, high)
    if min(low, high) > TWO_SIDED * larger:
        direction = "two_sided"
    elif high > low:
        direction = "up"
    else:
        direction = "down"
    return _Deflection(direction, larger)


def _sorted_by_recording(
    runs: Sequence[_DraftedRun],
) -> tuple[list[_DraftedRun], list[str]]:
    """Runs in the order in which they were recorded, and lines of comment if it is not known.

    It is known if all runs state when they were recorded, or from the times at which their files
    were written. File times are trusted only if runs that ended then do not overlap: copying sets
    them all close together.
    """
    with_duration = [run for run in runs if run.duration is not None]
    if len(with_duration) < 2 or all(run.recorded is not None for run in with_duration):
        return sorted(runs, key=lambda run: run.recorded or inf), []
    by_writing = sorted(with_duration, key=lambda run: run.written)
    if not all(_follows(later, earlier) for earlier, later in pairwise(by_writing)):
        blank_line = ""
        return [*runs], [UNORDERED, blank_line]
    dated = [_with_guessed_date(run) if run.duration is not None else run for run in runs]
    return sorted(dated, key=lambda run: run.written), []


def _follows(later: _DraftedRun, earlier: _DraftedRun) -> bool:
    """Whether a run began after the file of an earlier one was written, a little overlap aside."""
    duration = later.duration or 0.0
    return later.written - (1.0 - OVERLAP) * duration >= earlier.written


def _with_guessed_date(run: _DraftedRun) -> _DraftedRun:
    """A run with the entry of when it was recorded, from the time of its file."""
    began = datetime.fromtimestamp(run.written - (run.duration or 0.0), UTC)
    date = began.isoformat(timespec="seconds").replace("+00:00", "Z")
    line = f"recorded = {date}    # guessed: time of writing of its file, minus its duration"
    return run._replace(entries=[line, *run.entries])


def _held_back(fitted: Sequence[_DraftedRun]) -> _DraftedRun | None:
    """The run to validate with: the others have its kind, its direction and more than its size."""
    largest = dict[str, _DraftedRun]()
    for run in fitted:
        if run.peak > largest.setdefault(run.stratum, run).peak:
            largest[run.stratum] = run
    others = [run for run in fitted if run is not largest[run.stratum]]
    return others[-1] if others and len(fitted) >= HELD_BACK_FROM else None
