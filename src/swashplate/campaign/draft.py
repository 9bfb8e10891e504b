"""First drafts of a campaign file: what each column of some logs may be, and a file that says so.

What is not known for sure is marked "guessed"; what cannot be told stays open in a line "FIXME".
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.quality import has_sign
from swashplate.campaign.reading import read_run
from swashplate.campaign.recognition import recognise
from swashplate.campaign.samples import rolls_over_at
from swashplate.campaign.schema import (
    CHANNEL_KINDS,
    KINDS,
    CampaignFile,
    conversion,
)
from swashplate.documents import parse_toml, toml_key, toml_string, validated
from swashplate.errors import FileError, InputError
from swashplate.logs import Column, Log, open_log
from swashplate.units import speed_unit, to_si

Array = NDArray[np.float64]
Values = Mapping[str, Array]

HEADER = """\
# A draft, made from the headers of the logs: check each line that says "guessed", and fill in each
# that says "FIXME". What a signal is: sign * (scale * number + offset), in its unit.
# Every entry is explained by `swashplate campaign schema`; `swashplate campaign check` reads
# all logs and says what is wrong with them.
"""
UNUSED = "# Columns that are not used"
NO_ENCODER = "# No column looks like an encoder's counts"
FIXME = "FIXME"
"""What the lines hold that say what the draft leaves out or open."""

TIME = r"time|zeit|uhrzeit|stamp|timestamp|time stamp|datetime|date time|clock|t|seconds?|exp time"
COMMAND = r"cmd|command|duty|setpoint|valve|stick|joystick|stellgröße|stellgroesse|sollwert"
VOLTAGE = r"volts?|voltage|joystick voltage|u|spannung"
ROD = r"ms|displacement|stroke|cylinder|rod|extension|hub|weg"
WORDS = {
    "encoder_counts": r"counts?|encoder|enc|ticks|pulses",
    "current_plus": r"current (?:plus|positive|a|up)|(?:i|strom) (?:plus|a)",
    "current_minus": r"current (?:minus|negative|b|down)|(?:i|strom) (?:minus|b)",
    "rectified_current": r"currents?|amps?|ammeter|strom|i",
    "stroker_pressure": r"stroker pressure|delta p|dp|servo pressure",
    "swash_angle": r"swash angle|swash|alpha",
    "spool_position": r"spool position|spool",
    "shaft_speed": r"speed|rpm|omega|velocity|drehzahl|n|n \w+",
    "position": rf"position|pos|angle|pos fb|{ROD}",
}
"""Last words of the names of columns by kinds of channel, the first that fits; and their units."""
UNITS = {
    **dict.fromkeys(("A", "mA"), "rectified_current"),
    **dict.fromkeys(("counts", "count"), "encoder_counts"),
    **dict.fromkeys(("rad/s", "deg/s", "rpm", "m/s", "mm/s"), "shaft_speed"),
}
MANY = 4
"""Runs from which on one is held back for validation."""


@dataclass(frozen=True)
class ColumnGuess:
    """What a column may be."""

    column: Column
    role: str = "unknown"
    """``"time"``, ``"input"``, ``"channel"`` or ``"unknown"``."""
    kind: str | None = None
    axis: str = ""
    """What stands before the word in its name, such as the "boom" of "Boom Cmd", or empty."""
    rod: bool = False
    """Whether its name is that of a rod's displacement and not of a shaft's angle."""
    unit: str | None = None
    """From the header, or from the end of its name as in ``time_ms``."""
    rolls_over_at: int | None = None
    """Counts after which an encoder's counter begins anew, where its numbers show it."""
    empty: int = 0
    """Cells without a number, in all logs."""


def guess(column: Column) -> ColumnGuess:
    """What a column's name and unit say."""
    name = re.sub(r"[\[(].*[\])]", "", column.name).strip()
    stem, _, ending = name.rpartition("_")
    if column.unit is None and stem:
        found = _by_name(column, stem)
        if found.kind == "other" and ending in ("V", "mV"):
            found = replace(found, kind="voltage")
        try:
            if found.role == "time":
                to_si(1.0, ending, "s", "")
            elif found.kind is not None:
                conversion(found.kind, ending, "")
            if found.role != "unknown":
                return replace(found, unit=ending)
        except InputError:
            pass
    found = replace(_by_name(column, name), unit=column.unit)
    unit = found.unit or ("rpm" if re.search(r"rpm|drehzahl", name.lower()) else None)
    if found.kind == "shaft_speed":
        return replace(found, unit=unit)
    if found.role == "unknown" and unit is not None and speed_unit(unit) in UNITS:
        return replace(found, role="channel", kind=UNITS[speed_unit(unit)])
    return found


def _by_name(column: Column, name: str) -> ColumnGuess:
    name = re.sub(r"(?<=[a-z])(?=[A-Z])|[_./\-\s]+", " ", name).strip().lower()

    def before(words: str) -> str | None:
        match = re.fullmatch(rf"(?:(.*) )?(?:{words})", name)
        return (match[1] or "") if match else None

    if re.fullmatch(TIME, name):
        return ColumnGuess(column, "time")
    if column.unit in ("V", "mV") or before(VOLTAGE) is not None:
        return ColumnGuess(column, "input", "voltage", before(f"{VOLTAGE}|{COMMAND}") or "")
    if (axis := before(COMMAND)) is not None:
        return ColumnGuess(column, "input", "other", axis)
    for kind, words in WORDS.items():
        if (axis := before(words)) is not None:
            return ColumnGuess(column, "channel", kind, axis, before(ROD) is not None)
    return ColumnGuess(column)


def draft_campaign(
    logs: Sequence[str | Path],
    folder: str | Path,
    drive: str | None = None,
    counts_per_turn: float | None = None,
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
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
        Of all encoders. Without it the entry is left to be filled in, and the file is refused
        until it is.
    columns : mapping of str to str, optional
        What some columns are, by column: ``"time"`` or a kind such as ``"voltage"``.
    units : mapping of str to str, optional
        Units of some columns.

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
        If there is no log, or none has a column that is named.
    """
    given, units = dict(columns or {}), dict(units or {})
    opened = [open_log(path) for path in logs]
    met = {column.name: column for log in reversed(opened) for column in reversed(log.columns)}
    unmet = sorted({*given, *units} - {*met})
    why = "" if logs else "A draft needs at least one log"
    for name, what in given.items():
        if what != "time" and what not in KINDS:
            why = why or f"'{name}' cannot be a '{what}': it is time, {', '.join(KINDS)}"
    if unmet and not why:
        why = f"No log has a column '{unmet[0]}'; there are {', '.join(sorted(met))}"
    if why:
        raise InputError(f"{why}.")
    values = [_numbers(log, [column.name for column in log.columns]) for log in opened]
    ordered = {name: met[name] for log in opened for name in (each.name for each in log.columns)}
    guesses = _refined(ordered, values, counts_per_turn, given, units)
    axes = _by_axis(guesses.values(), Path(drive).stem if drive is not None else "drive")
    lines = [HEADER, f"title = {toml_string(Path(folder).resolve().name)}", ""]
    for name, ours in axes.items():
        lines += _axis(name, ours, guesses, opened[0], values[0], drive, counts_per_turn)
    used = [each for ours in axes.values() for each in ours]
    others = (guesses[each.name] for each in opened[0].columns)
    left = ", ".join(e.column.name for e in others if e.role != "time" and e not in used)
    if left:
        lines += [f"{UNUSED}: {left}", ""]
    if counts_per_turn is not None and all(each.kind != "encoder_counts" for each in used):
        among = f" among {left}" if left else ""
        lines += [f"{NO_ENCODER}{among}; counts_per_turn = {counts_per_turn:.12g} is left out", ""]
    text = "\n".join(lines)
    runs = [
        _run(log, numbers, guesses, axes, Path(folder), text)
        for log, numbers in zip(opened, values, strict=True)
    ]
    _hold_back(runs)
    for each in runs:
        lines += _run_lines(each)
    return "\n".join(lines).rstrip() + "\n"


def _numbers(log: Log, names: list[str]) -> dict[str, Array]:
    """Those columns that hold numbers; of the others nothing is wanted."""
    try:
        return log.read(names) if names else {}
    except FileError:
        if len(names) == 1:
            return {}
        half = len(names) // 2
        return {**_numbers(log, names[:half]), **_numbers(log, names[half:])}


def _refined(
    columns: Mapping[str, Column],
    logs: Sequence[Values],
    counts_per_turn: float | None,
    given: Mapping[str, str],
    units: Mapping[str, str],
) -> dict[str, ColumnGuess]:
    """Guesses by names and units, and by what the numbers of all logs say.

    A column that is said to be time or input takes the place of those that were guessed. A current
    has a sign if it goes to minus its peak in any log; two of them are plus and minus; whole
    numbers that begin anew at their end are an encoder's, whatever their name.
    """
    roles = {what: "time" if what == "time" else "channel" for what in ("time", *CHANNEL_KINDS)}
    roles |= dict.fromkeys(("voltage", "current", "other"), "input")
    taken = {roles[what] for what in given.values() if what != "other"} - {"channel"}
    met: dict[str, ColumnGuess] = {}
    for name, column in columns.items():
        each = guess(column)
        if name in given:
            kind = None if given[name] == "time" else given[name]
            each = replace(each, role=roles[given[name]], kind=kind)
        elif each.role in taken:
            each = replace(each, role="unknown", kind=None)
        values = [log[name] for log in logs if log.get(name, np.zeros(0)).size]
        empty = sum(int(np.count_nonzero(~np.isfinite(part))) for part in values)
        each = replace(each, unit=units.get(name, each.unit), empty=empty)
        if each.kind == "encoder_counts" or (each.role == "unknown" and each.unit is None):
            sizes = [rolls_over_at(part, counts_per_turn) or 0 for part in values]
            if size := max(sizes, default=0):
                each = replace(each, role="channel", kind="encoder_counts", rolls_over_at=size)
        if each.kind == "rectified_current" and name not in given and has_sign(values):
            each = replace(each, kind="signed_current")
        met[name] = each
    for name, each in met.items():
        twin = met.get(name[:-1] + {"A": "B", "a": "b", "1": "2"}.get(name[-1:], "?"))
        if name[-2:-1] == "_" and twin is not None and "current" in str(each.kind):
            met[name] = replace(each, kind="current_plus")
            met[twin.column.name] = replace(
                twin, role="channel", kind="current_minus", axis=each.axis, unit=each.unit
            )
    if not {"current_plus", "current_minus"} <= {each.kind for each in met.values()}:
        for name, each in met.items():
            if each.kind in ("current_plus", "current_minus") and name not in given:
                met[name] = replace(each, kind="rectified_current", axis="")
    return met


def _by_axis(guesses: Iterable[ColumnGuess], plain: str) -> dict[str, list[ColumnGuess]]:
    """Inputs and channels under the axis that their names begin with.

    An axis needs an input and a channel; columns without a prefix belong to the only axis.
    """
    useful = [each for each in guesses if each.role in ("input", "channel")]
    axes = dict.fromkeys(each.axis for each in useful if each.role == "input")
    named = {axis: [each for each in useful if each.axis == axis] for axis in axes if axis}
    named = {axis: ours for axis, ours in named.items() if any(e.role == "channel" for e in ours)}
    return named if len(named) > 1 else {plain: useful}


# --- axes -----------------------------------------------------------------------------------------


def _axis(
    name: str,
    ours: list[ColumnGuess],
    guesses: Mapping[str, ColumnGuess],
    log: Log,
    values: Values,
    drive: str | None,
    counts_per_turn: float | None,
) -> list[str]:
    from swashplate.parameters.files import preset_names

    own = ['# drive = "hoist"    # a packaged drive or a parameter file, to be fitted']
    if drive is not None:
        own = [f"drive = {toml_string(name if name in preset_names() else drive)}"]
    time = _time(log, guesses)
    clock = f"{{ rate = 512 }}    # {FIXME}: no column of time found; samples a second"
    if time is not None:
        unit = f', unit = "{time.unit or "s"}"' if time.column.unit is None else ""
        clock = f"{{ column = {toml_string(time.column.name)}{unit} }}"
    own += [f"time = {clock}", 'start = "rest"    # at the first sample: rest, steady or estimated']
    names = ", ".join(repr(each.name) for each in log.columns)
    left_open = f'column = "{FIXME}"    # which of {names}'
    drives = [each for each in ours if each.role == "input"]
    given = [f'kind = "voltage"    # {FIXME}: or current, or other', f"{left_open} commands?"]
    given = _signal(drives[0], values, None) if drives else given
    given.append('interpolation = "previous"    # guessed: held between samples; or "linear"')
    given += [f"# another input? '{each.column.name}'" for each in drives[1:]]
    kind = f'kind = "shaft_speed"    # {FIXME}: or position, encoder_counts ...'
    channels = {
        channel: _signal(each, values, counts_per_turn) for channel, each in _channels(ours).items()
    } or {"measured": [kind, f"{left_open} was measured?"]}
    table = f"axes.{toml_key(name)}"
    lines = [f"[{table}]", *own, "", f"[{table}.input]", *given, ""]
    for channel, entries in channels.items():
        lines += [f"[{table}.channels.{toml_key(channel)}]", *entries, ""]
    return lines


def _time(log: Log, guesses: Mapping[str, ColumnGuess]) -> ColumnGuess | None:
    """The column of a log's time stamps."""
    found = (guesses[column.name] for column in log.columns)
    return next((each for each in found if each.role == "time"), None)


def _channels(ours: Iterable[ColumnGuess]) -> dict[str, ColumnGuess]:
    """An axis's channels by their names in the file: the kind, and a number from the second on."""
    named: dict[str, ColumnGuess] = {}
    for each in ours:
        if each.role == "channel":
            number = 1 + sum(each.kind == other.kind for other in named.values())
            named[str(each.kind) if number == 1 else f"{each.kind}_{number}"] = each
    return named


def _signal(guessed: ColumnGuess, values: Values, counts_per_turn: float | None) -> list[str]:
    """Entries of an input or a channel."""
    column, kind, scale = guessed.column, str(guessed.kind), 1.0
    percent = kind == "other" and guessed.unit == "%"
    kind = "voltage" if percent else kind
    lines = [
        f'kind = "{kind}"    # guessed: {KINDS[kind].meaning}',
        f"column = {toml_string(column.name)}",
    ]
    if percent:
        scale = 0.1
        lines += ['unit = "V"', "scale = 0.1    # guessed: 100 % stand for the 10 V of a card"]
    elif kind == "encoder_counts":
        left_open = f"# counts_per_turn = 1000    # {FIXME}: for one turn, quadrature included"
        known = f"counts_per_turn = {counts_per_turn or 0:.12g}"
        lines += [
            left_open if counts_per_turn is None else known,
            "gear_ratio = 1.0    # turns of the encoder for one turn of the shaft",
        ]
        if size := guessed.rolls_over_at:
            lines.append(f"rolls_over_at = {size}    # guessed: begins anew after {size} counts")
    elif column.unit is None:
        unit = "mm" if guessed.rod else next(iter(KINDS[kind].units), "1")
        why = "from its name" if guessed.unit else "guessed: the header gives none"
        lines.append(f"unit = {toml_string(guessed.unit or unit)}    # {why}")
    if guessed.empty:
        lines.append(f'missing = "drop"    # guessed: {guessed.empty} cells are empty')
    if guessed.role == "input" and guessed.kind == "other":
        known_values = values.get(column.name, np.zeros(0))
        neutral = next(iter(known_values[np.isfinite(known_values)].tolist()), 0.0)
        if neutral:
            why = "guessed: the first sample is neutral"
            lines.append(f"offset = {-scale * neutral:.9g}    # {why}")
    return lines


# --- runs -----------------------------------------------------------------------------------------


@dataclass
class _Draft:
    """A run's entries, and kind and direction, and the size, of its maneuver."""

    file: str
    more: list[str]
    role: str
    why: str
    seen: str
    stratum: str
    peak: float


def _run(
    log: Log,
    values: Values,
    guesses: Mapping[str, ColumnGuess],
    axes: Mapping[str, list[ColumnGuess]],
    folder: Path,
    text: str,
) -> _Draft:
    """A run; ignored if the file, whose other lines are the text, could not be read with it."""
    path, root = log.path.resolve(), folder.resolve()
    file = (path.relative_to(root) if path.is_relative_to(root) else path).as_posix()
    names = {column.name for column in log.columns}
    tested, more = list[str](), list[str]()
    for axis, ours in axes.items():
        drives, channels = [each for each in ours if each.role == "input"][:1], _channels(ours)
        missing = [
            f"axes.{toml_key(axis)}.channels.{key} = false    # no column "
            f"{toml_string(each.column.name)}"
            for key, each in channels.items()
            if each.column.name not in names
        ]
        if all(d.column.name in names for d in drives) and len(missing) < max(len(channels), 1):
            tested.append(axis)
            more += missing
    if tested and len(tested) < len(axes):
        more.insert(0, f"only = [{', '.join(toml_string(axis) for axis in tested)}]")
    role, why = ("fit", "") if tested else ("ignore", "it has no input")
    made = _Draft(file, more, role, why, *_seen(values, _time(log, guesses), axes))
    if tested and f'column = "{FIXME}"' not in text:
        one = text.replace("# counts_per_turn = 1000", "counts_per_turn = 1000")
        one = "\n".join([one, *_run_lines(made)])
        try:
            read = validated(parse_toml(one, "the draft"), CampaignFile, "the draft")
            list(read_run("the draft", "run", read.runs[0], read.axes, log))
        except (FileError, InputError) as error:
            made.role, made.why = "ignore", f"{FIXME}: {error}"
    return made


def _run_lines(run: _Draft) -> list[str]:
    why = f"    # {run.why}" if run.why else ""
    file = f"file = {toml_string(run.file)}    # {run.seen}"
    return ["[[runs]]", file, f'role = "{run.role}"{why}', *run.more, ""]


def _seen(
    values: Values, clock: ColumnGuess | None, axes: Mapping[str, list[ColumnGuess]]
) -> tuple[str, str, float]:
    """Length, rate and maneuvers of a run for a comment; their kind, direction and size."""
    time = values.get(clock.column.name) if clock is not None else None
    if clock is None or time is None or time.size < 2:
        return f"{len(next(iter(values.values()), []))} samples", "", 0.0
    seen, strata, peak = [f"{time.size} samples"], list[str](), 0.0
    try:
        time = to_si(1.0, clock.unit or "s", "s", "") * (time - time[0])
    except InputError:
        return seen[0], "", 0.0
    if not np.all(np.diff(time) > 0.0):
        return seen[0], "", 0.0
    seen.append(f"{np.ptp(time):.4g} s at {1.0 / np.median(np.diff(time)):.4g} Hz")
    for ours in axes.values():
        drive = next((each for each in ours if each.role == "input"), None)
        command = None if drive is None else values.get(drive.column.name)
        if drive is None or command is None or not np.isfinite(command).all():
            continue
        unit, size = drive.unit or "V", 1.0
        if drive.kind == "voltage":
            unit, size, _ = conversion("voltage", unit, drive.column.name)
        found = recognise(time, size * command, unit=unit)
        seen += [found.name] * (drive.kind == "voltage")
        away = command - command[0]
        low, high = -float(away.min()), float(away.max())
        both = min(low, high) > 0.25 * max(low, high)
        strata.append(f"{found.kind} {'both' if both else 'up' if high > low else 'down'}")
        peak = max(peak, low, high)
    return ", ".join(seen), ", ".join(strata), peak


def _hold_back(runs: list[_Draft]) -> None:
    """Hold one run back for validation, of which the others have kind, direction and size."""
    fitted = [each for each in runs if each.role == "fit"]
    largest: dict[str, _Draft] = {}
    for each in fitted:
        if each.peak > largest.setdefault(each.stratum, each).peak:
            largest[each.stratum] = each
    others = [each for each in fitted if each is not largest[each.stratum]]
    if len(fitted) >= MANY and others:
        others[-1].role = "validate"
