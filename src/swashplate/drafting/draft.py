"""First drafts of a campaign file: what each column of some logs may be, and a file that says so.

A column is what the table of kinds, `swashplate.campaign.schema.KINDS`, says of its name and unit,
and what its numbers show. What is not known for sure is marked "guessed"; what cannot be known
stays open in a line "FIXME".
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from itertools import pairwise
from math import floor, inf, pi
from pathlib import Path
from typing import NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import (
    ASSUMED,
    ESTIMATED,
    KINDS,
    ROD,
    TURNS,
    Accuracy,
    CampaignFile,
    InputKind,
    conversion,
    has_sign,
    moves_at_first,
    read_run,
    rolls_over_at,
    turns_over,
)
from swashplate.documents import parse_toml, toml_key, toml_string, validated
from swashplate.errors import FileError, InputError
from swashplate.logs import Log, LogColumn, open_log
from swashplate.parameters import NEUTRAL, preset_names
from swashplate.units import speed_unit, to_si

Array = NDArray[np.float64]

HEADER = """\
# A draft, made from the headers of the logs: check each line that says "guessed", and fill in each
# that says "FIXME". Value of a signal: sign * (scale * number + offset), in its unit.
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
FIXME = "FIXME"
"""What the lines hold that say what the draft leaves out or open."""
TIME = (
    r"time|zeit|uhrzeit|zeitstempel|temps|heure|tijd|tid|tiempo|tempo|stamp|timestamp|time stamp|"
    r"datetime|date time|clock|t|seconds?|exp time"
)
"""Names of columns of time stamps; those of signals are in `KINDS`."""
OF = "(?: (?:of|der|des|du|de|del|della|do|da|van|av) .*)?"
"""What may follow in such a name: "Drehzahl der Trommel"."""
INPUTS = get_args(InputKind)
HALVES = {"current_plus", "current_minus"}
PLC = re.compile(
    r"(?:PIW|PEW|PQW|PAW|AIW|AQW|IW|EW)\d*[_ ](?P<after>.+)|(?P<before>.+)[_ ](?:W|WORD|INT|RAW)",
    re.IGNORECASE,
)
"""Names of a PLC's words, such as "PIW_STROKE" and "JOY_W"."""
SMALLEST_WORD, MILLIVOLTS, OVERRANGE = 100, 10_500, 32_511
"""Whole numbers that reach no further than the first are no PLC's words; those that reach further
than the second are no millivolts of a card; a SIMATIC's word, whose full scale is 27648, reaches to
the third at most."""
OPEN_UNITS = ("stroker_pressure", "swash_angle", "spool_position")
"""Kinds that hardly a logger writes in SI."""
TICKS = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Units of whole numbers that count the time, and their size. [s]"""
SLOWEST_LOG = 1.0
"""Rate from which a log of a drive's motion is plausible. [Hz]"""
OVERLAP = 0.1
"""Share of a log's length by which it may seem to begin before the one before it ended: file
systems round the time of writing to as much as 2 s. [1]"""
MANY = 4
"""Runs from which on one is held back for validation."""


class _Guess(NamedTuple):
    """What a column may be."""

    name: str
    kind: str = ""
    """``"time"``, a kind of input or of channel, or empty."""
    axis: str = ""
    """What stands before the word in its name, such as the "boom" of "Boom Cmd", or empty."""
    unit: str | None = None
    given: bool = False
    """Whether somebody said so."""
    in_header: bool = True
    """Whether its unit stands in brackets, or in a row of its own, where it is read from again."""
    rolls_over_at: float = 0.0
    """Reading after which an encoder's counter or an angle wraps; 0 if it does not."""
    why: str = "from its name"
    """What its unit rests on, for the comment beside it, if it does not stand in the header."""
    of_plc: bool = False
    """Whether its name is that of a PLC's word."""
    full_scale: int = 0
    """Reading of a PLC's word at full scale; 0 if the numbers are no such words."""


class _Axis(NamedTuple):
    """Columns of an axis: what may be its input, the first of which is; channels by their names."""

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
        What some columns are, ``"time"`` or a kind such as ``"voltage"``, and their units.
    title : str, optional
        Heading of the report; by default the folder's name, marked as guessed.

    Returns
    -------
    str
        Commented TOML that `Campaign.from_toml` reads, guesses marked as such. A run that could
        not be read has the role ``"ignore"``, with the reason. Where no column looks like an input
        or like a measurement the line says FIXME, and the file is refused until it is mended.

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
    kinds, units, folder = dict(columns or {}), dict(units or {}), Path(folder).resolve()
    opened = [open_log(path) for path in logs]
    headers = dict[str, LogColumn]()
    for column in (column for log in opened for column in log.columns):
        headers.setdefault(column.name, column)
    why = "" if logs else "A draft needs at least one log"
    for name in sorted({*kinds, *units} - {*headers}):
        why = why or f"No log has a column '{name}'; there are {', '.join(sorted(headers))}"
    for name, what in kinds.items():
        if what not in ("time", *KINDS):
            why = f"'{name}' cannot be a '{what}': it is time, {', '.join(KINDS)}"
    if why:
        raise InputError(f"{why}.")
    for name in sorted(kinds.keys() & units.keys()):
        _check_unit(kinds[name], units[name], f"Column '{name}' ({kinds[name]})")
    numbers = [_numbers(log, [column.name for column in log.columns]) for log in opened]
    blocks = {name: [number[name] for number in numbers if name in number] for name in headers}
    guesses = _guesses(headers, blocks, counts_per_turn, kinds, units)
    # an axis is called like its drive, but no machine like the start for any of them
    axes = _axes(guesses, "drive" if drive in (None, NEUTRAL) else Path(drive or "").stem)
    heading = f"title = {toml_string(title or folder.name)}"
    if title is None:
        heading += "    # guessed, the folder's name: the report's heading; machine, place, author"
    lines = [HEADER, heading, ""]
    for name, axis in axes.items():
        lines += _axis_lines(name, axis, guesses, blocks, opened[0], drive, counts_per_turn)
    used = [guess for axis in axes.values() for guess in (*axis.inputs, *axis.channels.values())]
    first = {column.name for column in opened[0].columns} - {guess.name for guess in used}
    unused = ", ".join(e.name for e in guesses if e.name in first and e.kind != "time")
    if unused:
        lines += [f"{UNUSED}: {unused}", ""]
    if counts_per_turn is not None and all(guess.kind != "encoder_counts" for guess in used):
        among = f" among {unused}" if unused else ""
        lines += [f"{NO_ENCODER}{among}; counts_per_turn = {counts_per_turn:.12g} is left out", ""]
    text, runs = "\n".join(lines), list[_Run]()
    stems = [log.path.stem for log in opened]
    for log, read in zip(opened, numbers, strict=True):
        drafted = _run(log, read, axes, folder, text)
        if stems.count(log.path.stem) > 1:
            # logs of one name in several folders, or formats
            near = log.path.resolve().parent.name, log.path.name
            drafted.more.insert(0, f"name = {toml_string('/'.join(near))}")
        runs.append(drafted)
    held_back = _held_back([run for run in runs if run.role == '"fit"'])
    runs, order = _in_time(runs)
    lines += order
    for run in runs:
        role = '"validate"' if run is held_back else run.role
        lines += ["[[runs]]", f"file = {run.file}", f"role = {role}", *run.more, ""]
    return "\n".join(lines).rstrip() + "\n"


def _numbers(log: Log, names: list[str]) -> dict[str, Array]:
    """Those columns that hold numbers; of the others nothing is wanted."""
    try:
        return log.read(names) if names else {}
    except FileError:
        half = len(names) // 2
        return {**_numbers(log, names[:half]), **_numbers(log, names[half:])} if half else {}


# --- what the columns are -------------------------------------------------------------------------


def _words(name: str) -> str:
    """A name in lower-case words."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])|[_./\-\s]+", " ", name).strip().lower()


def _by_words(column: LogColumn, name: str, unit: str | None) -> _Guess:
    """What a name and a unit say: the first kind in the table that has either."""
    words = _words(name)
    if re.fullmatch(TIME, _words(name.rpartition("/")[2])):
        return _Guess(column.name, "time", "", column.unit)
    matches = {
        kind: match
        for kind, meant in KINDS.items()
        if meant.words and (match := re.fullmatch(rf"(?:(.*) )?(?:{meant.words}){OF}", words))
    }
    marked = speed_unit(unit or "")
    kinds = (kind for kind, meant in KINDS.items() if kind in matches or marked in meant.marks)
    axis = next((match[1] for match in matches.values()), "")
    return _Guess(column.name, next(kinds, ""), axis or "", column.unit)


def _by_header(column: LogColumn, kind: str | None) -> _Guess:
    """What a header says, of a kind if one is given; the unit may be the end of its name."""
    name = re.sub(r"[\[(].*[\])]", "", column.name).strip()
    word = PLC.fullmatch(name) if column.unit is None else None
    if word is not None:
        name = word["after"] or word["before"]
    unit = column.unit or ("rpm" if re.search(TURNS, name.lower()) else None)
    by_name = _by_words(column, name, unit)
    split = re.fullmatch(r"(.*)[_\s]+([^_\s]+)", name)
    stem, ending = split.groups() if split else ("", name)
    by_last_word = _by_words(column, stem, None)
    if by_last_word.kind == "other" and ending in ("V", "mV"):
        by_last_word = by_last_word._replace(kind="voltage")
    if kind is not None:
        by_name, by_last_word = (guess._replace(kind=kind) for guess in (by_name, by_last_word))
    if column.unit is None and by_name.kind not in HALVES and _measures(by_last_word.kind, ending):
        return by_last_word._replace(unit=ending, in_header=False)
    unit = unit if by_name.kind == "shaft_speed" else column.unit
    in_header = column.unit is not None
    return by_name._replace(unit=unit, in_header=in_header, of_plc=word is not None)


def _check_unit(kind: str, unit: str, what: str) -> None:
    """Refuse a unit that does not measure what a column is: time or a kind of signal."""
    if kind == "time":
        to_si(1.0, unit, "s", what)
    else:
        conversion(kind, unit, what)


def _measures(kind: str, unit: str) -> bool:
    """Whether a unit is one of time or of a kind that has units; counts are none."""
    has_units = kind == "time" or (kind in KINDS and bool(KINDS[kind].units))
    if not has_units or kind == "encoder_counts":
        return False
    try:
        _check_unit(kind, unit, "")
    except InputError:
        return False
    return True


def _guesses(
    headers: Mapping[str, LogColumn],
    blocks: Mapping[str, list[Array]],
    counts_per_turn: float | None,
    kind_of: Mapping[str, str],
    units: Mapping[str, str],
) -> list[_Guess]:
    """Guesses by headers, and by the numbers of all logs.

    A column that is said to be time or input takes the place of those that were guessed. A current
    has a sign if it goes to minus its peak in any log; half a current without the other half is a
    whole one; whole numbers that begin anew at their end are an encoder's, whatever their name.
    """
    taken = {"time"} & {*kind_of.values()}
    taken |= {*INPUTS} if {"voltage", "current"} & {*kind_of.values()} else set()
    guesses = list[_Guess]()
    for name, column in headers.items():
        values = [part for part in blocks[name] if part.size]
        guess = _by_header(column, kind_of.get(name))
        kind = kind_of.get(name, "" if guess.kind in taken else guess.kind)
        guess = guess._replace(kind=kind, given=name in kind_of)
        if name in units:
            guess = guess._replace(unit=units[name], in_header=False, why="given")
        elif guess.unit is None:
            guess = _with_unit_of_numbers(guess, values)
        if kind == "encoder_counts" or not (kind or guess.unit):
            size = max((rolls_over_at(part, counts_per_turn) for part in values), default=0)
            guess = guess._replace(kind="encoder_counts" if size else kind, rolls_over_at=size)
        if kind == "position":
            guess = guess._replace(rolls_over_at=_turn(values, guess.unit or "deg"))
        if kind == "rectified_current" and name not in kind_of and has_sign(values):
            guess = guess._replace(kind="signed_current")
        guesses.append(guess)
    kinds = {(guess.axis, guess.kind) for guess in guesses}
    for n, guess in enumerate(guesses):
        alone = guess.kind in HALVES and any((guess.axis, half) not in kinds for half in HALVES)
        if alone and guess.name not in kind_of:
            guesses[n] = guess._replace(kind="rectified_current")
    return guesses


def _with_unit_of_numbers(signal: _Guess, blocks: Sequence[Array]) -> _Guess:
    """A column whose header gives no unit, with what its numbers say of one."""
    finite = [part[np.isfinite(part)] for part in blocks]
    if signal.kind == "time":
        unit, why = _time_unit(finite)
        return signal._replace(unit=unit, why=why)
    if signal.kind in ("", "encoder_counts", "position") or not finite:
        return signal
    full = _full_scale(finite, named=signal.of_plc)
    if full:
        return signal._replace(full_scale=full)
    largest = max(float(np.abs(part).max(initial=0.0)) for part in finite)
    if signal.kind == "voltage" and largest > SMALLEST_WORD and _whole(finite):
        return signal._replace(unit="mV", why=f"guessed: whole numbers up to {largest:.9g}")
    return signal


def _whole(blocks: Sequence[Array]) -> bool:
    """Whether all numbers are whole."""
    return all(bool(np.all(part == np.floor(part))) for part in blocks)


def _time_unit(blocks: Sequence[Array]) -> tuple[str, str]:
    """Unit of stamps without one, and why.

    Seconds, unless they are whole numbers of which a step of one second or more would make a log
    too slow for any motion: then the largest unit in which it is fast enough.
    """
    steps = [float(np.median(np.diff(part))) for part in blocks if part.size > 1]
    step = float(np.median(steps)) if steps else 0.0
    if step < 1.0 / SLOWEST_LOG or not _whole(blocks):
        return "s", "guessed: the header gives none"
    fast = (unit for unit, size in TICKS.items() if step * size <= 1.0 / SLOWEST_LOG)
    unit = next(fast, "ns")
    rate = 1.0 / (step * TICKS[unit])
    return unit, f"guessed: whole numbers that step by {step:.9g}, {rate:.4g} Hz in {unit}"


def _full_scale(blocks: Sequence[Array], *, named: bool) -> int:
    """Reading at full scale of what may be a PLC's word of 16 bits, or 0.

    A word is a whole number too large to be of a physical unit, or called so by its column. 27648
    is that of SIMATIC, 16384 and 32767 of others, whose words end there.
    """
    largest = max(float(np.abs(part).max(initial=0.0)) for part in blocks)
    least = SMALLEST_WORD if named else MILLIVOLTS
    if not _whole(blocks) or not least < largest <= 1 << 15:
        return 0
    if largest in (16383.0, 16384.0):
        return 16384
    return 27648 if largest <= OVERRANGE else max(int(largest), 32767)


def _turn(values: Sequence[Array], unit: str) -> float:
    """A whole turn in a unit if positions jump by it, 0 if not or if the unit is no angle's."""
    try:
        turn = to_si(2.0 * pi, "rad", unit, "")
    except InputError:
        return 0.0
    return turn if any(turns_over(part, turn) for part in values) else 0.0


def _axes(guesses: Sequence[_Guess], plain: str) -> dict[str, _Axis]:
    """Inputs and channels under the axis that their names begin with.

    An axis needs an input and a channel; columns without a prefix belong to the only axis.
    """
    prefixes = dict.fromkeys(guess.axis for guess in guesses if guess.kind in INPUTS and guess.axis)
    axes = {prefix: _axis([e for e in guesses if e.axis == prefix]) for prefix in prefixes}
    axes = {prefix: axis for prefix, axis in axes.items() if axis.channels}
    return axes if len(axes) > 1 else {plain: _axis(guesses)}


def _axis(guesses: Sequence[_Guess]) -> _Axis:
    axis = _Axis([guess for guess in guesses if guess.kind in INPUTS], {})
    for guess in guesses:
        if guess.kind not in ("", "time", *INPUTS):
            number = 1 + sum(guess.kind == channel.kind for channel in axis.channels.values())
            axis.channels[guess.kind if number == 1 else f"{guess.kind}_{number}"] = guess
    return axis


# --- what the file says ---------------------------------------------------------------------------


def _axis_lines(
    name: str,
    axis: _Axis,
    guesses: Sequence[_Guess],
    blocks: Mapping[str, list[Array]],
    log: Log,
    drive: str | None,
    counts_per_turn: float | None,
) -> list[str]:
    """Tables of an axis; what the first log does not show stays open."""
    drive_line = '# drive = "hoist"    # a packaged drive or a parameter file, to be fitted'
    if drive is not None:
        drive_line = f"drive = {toml_string(name if name in preset_names() else drive)}"
    clock = f"{NO_TIME}    # {FIXME}: no column of time found; samples a second"
    clocks = {guess.name: _clock(guess, guesses) for guess in guesses}
    main = next((clocks[guess.name] for guess in (*axis.inputs, *guesses)), "") or clock
    start = 'start = "rest"    # at the first sample: rest, steady or estimated'
    which = (
        f'column = "{FIXME}"    # which of {", ".join(repr(column.name) for column in log.columns)}'
    )
    kind = f'kind = "voltage"    # {FIXME}: or current, or other'
    tables = {"input": [kind, f"{which} commands?"]}
    if not axis.channels:
        kind = f'kind = "shaft_speed"    # {FIXME}: or position, encoder_counts ...'
        tables["channels.measured"] = [kind, f"{which} was measured?"]
    signals = [("input", guess) for guess in axis.inputs[:1]]
    signals += [(f"channels.{toml_key(key)}", channel) for key, channel in axis.channels.items()]
    for table, signal in signals:
        tables[table] = _signal_lines(signal, blocks[signal.name], counts_per_turn)
        tables[table] += [clocks[signal.name]] * (clocks[signal.name] not in ("", main))
    tables["input"] += [BETWEEN, *(f"# another input? '{guess.name}'" for guess in axis.inputs[1:])]
    lines = [f"[axes.{toml_key(name)}]", drive_line, main, start, ""]
    for table, entries in tables.items():
        lines += [f"[axes.{toml_key(name)}.{table}]", *entries, ""]
    return lines


def _clock(signal: _Guess, guesses: Sequence[_Guess]) -> str:
    """A signal's line of time: the first column of time in its group of the file, or of all."""

    def beside(guess: _Guess) -> bool:
        return guess.name.rpartition("/")[0] == signal.name.rpartition("/")[0]

    times = sorted((guess for guess in guesses if guess.kind == "time"), key=beside, reverse=True)
    if not times:
        return ""
    time = times[0]
    column = f"column = {toml_string(time.name)}"
    if time.in_header:
        return f"time = {{ {column} }}"
    return f"time = {{ {column}, unit = {toml_string(time.unit or 's')} }}    # {time.why}"


def _signal_lines(
    guess: _Guess, blocks: Sequence[Array], counts_per_turn: float | None
) -> list[str]:
    """Entries of an input or a channel."""
    percent = guess.kind in ("other", "voltage") and guess.unit == "%"
    command = percent or (guess.kind in ("other", "voltage") and guess.full_scale > 0)
    kind, scale = ("voltage" if command else guess.kind), 1.0
    kind_meant = KINDS[kind]
    guessed = "" if guess.given and kind == guess.kind else "guessed: "
    lines = [
        f'kind = "{kind}"    # {guessed}{kind_meant.meaning}',
        f"column = {toml_string(guess.name)}",
    ]
    if percent:
        scale = 0.1
        lines += ['unit = "V"', "scale = 0.1    # guessed: 100 % is taken as the 10 V of a card"]
    elif command:
        # rounded down, or the largest word would be beyond the 10 V that a card takes
        scale = floor(1e12 * 10.0 / guess.full_scale) / 1e12
        why = f"guessed: 10 V over {guess.full_scale}, a PLC's word at full scale"
        lines += ['unit = "V"', f"scale = {scale:.9g}    # {why}"]
    elif kind == "encoder_counts":
        unknown = f"# counts_per_turn = 1000    # {FIXME}: per turn, quadrature included"
        stated = f"counts_per_turn = {counts_per_turn or 0:.12g}"
        lines.append(unknown if counts_per_turn is None else stated)
        lines.append("gear_ratio = 1.0    # turns of the encoder per turn of the shaft")
    else:
        lines += _unit_lines(guess)
    if guess.full_scale and not command:
        why = f"range of the instrument over {guess.full_scale}, as of a PLC's word at full scale"
        lines.append(f"scale = 1.0    # {FIXME}: {why}")
    if size := guess.rolls_over_at:
        lines.append(f"rolls_over_at = {size:.9g}    # guessed: wraps there")
    if empty := sum(int(np.count_nonzero(~np.isfinite(part))) for part in blocks):
        lines.append(f'missing = "drop"    # guessed: {empty} cells are empty')
    neutral = next((x for part in blocks for x in part[np.isfinite(part)][:1].tolist()), 0.0)
    if neutral and guess.kind == "other":
        why = "guessed: the first sample is neutral"
        lines.append(f"offset = {-scale * neutral:.9g}    # {why}")
    return lines + _accuracy_lines(kind, "V" if command else guess.unit)


def _accuracy_lines(kind: str, unit: str | None) -> list[str]:
    """What is assumed of an instrument, as a comment that is easily made an entry."""
    assumed = ASSUMED.get(kind, Accuracy())
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
    why = f"share of the reading, and {unit or KINDS[kind].units[0]}; assumed, see its data sheet"
    return [f"# accuracy = {{ {stated} }}    # {why}"]


def _unit_lines(signal: _Guess) -> list[str]:
    """The entry of a signal's unit, none if the header has it."""
    units = KINDS[signal.kind].units
    usual = (*units, "1")[0]
    if signal.unit is not None and units and not _measures(signal.kind, signal.unit):
        why = f"'{signal.unit}', as the header has it, is not a unit of a {signal.kind}"
        return [f"unit = {toml_string(usual)}    # {FIXME}: {why}"]
    if signal.in_header:
        return []
    if signal.unit is not None:
        return [f"unit = {toml_string(signal.unit)}    # {signal.why}"]
    if signal.rolls_over_at:
        usual = "deg"
    elif signal.kind == "position" and re.fullmatch(rf"(?:.* )?(?:{ROD}){OF}", _words(signal.name)):
        usual = "mm"
    mark = FIXME if signal.kind in OPEN_UNITS else "guessed"
    return [f"unit = {toml_string(usual)}    # {mark}: the header gives none"]


class _Run(NamedTuple):
    """Entries of a run, and for each of its axes kind and direction, and size, of its maneuver."""

    file: str
    role: str
    more: list[str]
    stratum: str = ""
    peak: float = 0.0
    written: float = 0.0
    """When its file was last written, in seconds since 1970. [s]"""
    duration: float | None = None
    """None if it could not be read. [s]"""
    recorded: float | None = None
    """When it begins, if its stamps are of a calendar. [s]"""


def _run(
    log: Log, read: Mapping[str, Array], axes: Mapping[str, _Axis], folder: Path, text: str
) -> _Run:
    """A run of a log that was read; ignored if the file could not be read with it.

    The other lines of the file are the text.
    """
    path, names = log.path.resolve(), {column.name for column in log.columns}
    rows = max((column.size for column in read.values()), default=0)
    empty = {name for name, values in read.items() if not np.isfinite(values).any()}
    file = (path.relative_to(folder) if path.is_relative_to(folder) else path).as_posix()
    tested, entries = dict[str, _Axis](), list[str]()
    for name, axis in axes.items():
        lacking = {key: e.name for key, e in axis.channels.items() if e.name not in names}
        if all(e.name in names for e in axis.inputs[:1]) and (
            not axis.channels or any(e.name in names - empty for e in axis.channels.values())
        ):
            tested[name] = axis
            false = f"axes.{toml_key(name)}.channels.{{}} = false    # no column {{}}"
            entries += [false.format(toml_key(k), toml_string(n)) for k, n in lacking.items()]
    if tested and len(tested) < len(axes):
        entries.insert(0, f"only = [{', '.join(map(toml_string, tested))}]")
    written = path.stat().st_mtime
    run = _Run(f"{toml_string(file)}    # {rows} samples", '"fit"', entries, written=written)
    if not tested:
        return run._replace(role='"ignore"    # it has no input')
    if f'column = "{FIXME}"' in text:
        return run
    with_counts = text.replace("# counts_per_turn = 1000", "counts_per_turn = 1000")
    with_counts = with_counts.replace(NO_TIME, NO_TIME.lstrip("# "))
    with_counts = "\n".join([with_counts, "[[runs]]", f"file = {run.file}", *entries])
    try:
        content = validated(parse_toml(with_counts, "the draft"), CampaignFile, "the draft")
        experiments, overview = read_run("the draft", "run", content.runs[0], content.axes, log)
    except (FileError, InputError) as error:
        return run._replace(role=f'"ignore"    # {FIXME}: {error}')
    said, stratum, peak, seen = run.file, "", 0.0, set[str]()
    of_axis = [experiment for experiment in experiments if experiment.axis == experiments[0].axis]
    duration = float(experiments[-1].input.time[-1] - experiments[0].input.time[0])
    if overview is not None:
        duration = overview.end - overview.begin
    if NO_TIME not in text:
        rate = 1.0 / float(np.median(np.diff(of_axis[0].input.time)))
        said += f", {duration:.4g} s at {rate:.4g} Hz"
        if overview is not None:
            said += f", {len(of_axis)} of {len(overview.windows)} windows with motion used"
        elif len(of_axis) > 1:
            said += f" in {len(of_axis)} parts"
    for unseen in (experiment for experiment in experiments if experiment.axis not in seen):
        seen.add(unseen.axis)
        said += f", {unseen.maneuver}" if unseen.input.kind == "voltage" else ""
        if moves_at_first(unseen):
            entries.append(
                f"axes.{toml_key(unseen.axis)}.{ESTIMATED}    # guessed: it begins in motion"
            )
        away = unseen.input.values - unseen.input.values[0]
        low, high = -float(away.min()), float(away.max())
        two_sided = min(low, high) > 0.25 * max(low, high)
        kind = unseen.recognised.kind if unseen.recognised else ""
        direction = "up" if high > low else "down"
        if two_sided:
            direction = "two_sided"
        stratum += f"{kind} {direction}, "
        peak = max(peak, low, high)
    return run._replace(
        file=said,
        stratum=stratum,
        peak=peak,
        duration=duration,
        recorded=experiments[0].recorded,
    )


def _in_time(runs: Sequence[_Run]) -> tuple[list[_Run], list[str]]:
    """Runs in the order in which they were recorded, if clocks tell it, and lines on that.

    A log is written to its end. If files were written so far apart that none of their runs overlap,
    these are the times of a logger; those of copies lie closer together.
    """
    read = [run for run in runs if run.duration is not None]
    if len(read) < 2 or all(run.recorded is not None for run in read):
        return sorted(runs, key=lambda run: run.recorded or inf), []
    last_first = sorted(read, key=lambda run: run.written)
    apart = all(
        later.written - (1.0 - OVERLAP) * (later.duration or 0.0) >= earlier.written
        for earlier, later in pairwise(last_first)
    )
    if not apart:
        return [*runs], [UNORDERED, ""]
    dated = [_dated(run) if run.duration is not None else run for run in runs]
    return sorted(dated, key=lambda run: run.written), []


def _dated(run: _Run) -> _Run:
    """A run with the entry of when it was recorded, by its file."""
    began = datetime.fromtimestamp(run.written - (run.duration or 0.0), UTC)
    words = began.isoformat(timespec="seconds").replace("+00:00", "Z")
    line = f"recorded = {words}    # guessed: time of writing of its file, minus its duration"
    return run._replace(more=[line, *run.more])


def _held_back(fitted: Sequence[_Run]) -> _Run | None:
    """The run to validate with: the others have its kind, its direction and more than its size."""
    largest = dict[str, _Run]()
    for run in fitted:
        if run.peak > largest.setdefault(run.stratum, run).peak:
            largest[run.stratum] = run
    others = [run for run in fitted if run is not largest[run.stratum]]
    return others[-1] if others and len(fitted) >= MANY else None
