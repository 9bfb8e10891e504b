"""First drafts of a campaign file: what each column of some logs may be, and a file that says so.

What is not known for sure is marked "guessed"; what cannot be told stays open in a line "FIXME".
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.campaign import read_run
from swashplate.campaign.quality import has_sign
from swashplate.campaign.recognition import recognise
from swashplate.campaign.samples import rolls_over_at
from swashplate.campaign.schema import (
    KINDS,
    CampaignFile,
    ChannelKind,
    InputKind,
    axis_lines,
    conversion,
    run_lines,
)
from swashplate.documents import parse_toml, toml_key, toml_string, validated
from swashplate.errors import FileError, InputError
from swashplate.logs import Column, Log, open_log
from swashplate.units import speed_unit, to_si

Array = NDArray[np.float64]

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
VOLTAGE = r"volts?|voltage|joystick voltage|u|spannung"
COMMAND = r"cmd|command|duty|setpoint|valve|stick|joystick|stellgröße|stellgroesse|sollwert"
ROD = r"ms|displacement|stroke|cylinder|rod|extension|hub|weg"
CHANNELS: tuple[tuple[ChannelKind, str], ...] = (
    ("encoder_counts", r"counts?|encoder|enc|ticks|pulses"),
    ("current_plus", r"current (?:plus|positive|a|up)|(?:i|strom) (?:plus|a)"),
    ("current_minus", r"current (?:minus|negative|b|down)|(?:i|strom) (?:minus|b)"),
    ("rectified_current", r"currents?|amps?|ammeter|strom|i"),
    ("stroker_pressure", r"stroker pressure|delta p|dp|servo pressure"),
    ("swash_angle", r"swash angle|swash|alpha"),
    ("spool_position", r"spool position|spool"),
    ("shaft_speed", r"speed|rpm|omega|velocity|drehzahl|n|n \w+"),
    ("position", r"position|pos|angle|pos fb"),
    ("position", ROD),
)
UNITS: Mapping[str, ChannelKind] = {
    **dict.fromkeys(("A", "mA"), "rectified_current"),
    **dict.fromkeys(("counts", "count"), "encoder_counts"),
    **dict.fromkeys(("rad/s", "deg/s", "rpm", "m/s", "mm/s"), "shaft_speed"),
}
GIVEN = ("time", "voltage", "current")
"""What one column alone can be said to be."""
MANY = 4
"""Runs from which on one is held back for validation."""


class ColumnGuess(NamedTuple):
    """What a column may be."""

    column: Column
    role: str
    """``"time"``, ``"input"``, ``"channel"`` or ``"unknown"``."""
    kind: InputKind | ChannelKind | None = None
    axis: str = ""
    """What stands before the word in its name, such as the "boom" of "Boom Cmd", or empty."""
    linear: bool = False
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
        found = _by_name(column, stem)._replace(unit=ending)
        try:
            if found.role == "time":
                to_si(1.0, ending, "s", "")
                return found
            if found.kind is not None:
                conversion(found.kind, ending, "")
                return found
        except InputError:
            pass
    found = _by_name(column, name)._replace(unit=column.unit)
    unit = found.unit or ("rpm" if re.search(r"rpm|drehzahl", name.lower()) else None)
    if found.kind == "shaft_speed":
        return found._replace(unit=unit)
    if found.role == "unknown" and unit is not None and speed_unit(unit) in UNITS:
        return found._replace(role="channel", kind=UNITS[speed_unit(unit)])
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
    axis = before(COMMAND)
    if axis is not None:
        return ColumnGuess(column, "input", "other", axis)
    for kind, words in CHANNELS:
        axis = before(words)
        if axis is not None:
            return ColumnGuess(column, "channel", kind, axis, words == ROD)
    return ColumnGuess(column, "unknown")


class _Look(NamedTuple):
    """What a log shows at first sight."""

    log: Log
    guesses: list[ColumnGuess]
    values: dict[str, Array]
    time: ColumnGuess | None


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
    if not logs:
        raise InputError("A draft needs at least one log.")
    given = dict(columns or {})
    for name, what in given.items():
        if what != "time" and what not in KINDS:
            raise InputError(f"'{name}' cannot be a '{what}': it is time, {', '.join(KINDS)}.")
    looks = [_look(open_log(path), given, dict(units or {})) for path in logs]
    met = {column.name for look in looks for column in look.log.columns}
    unmet = sorted({*given, *(units or {})} - met)
    if unmet:
        raise InputError(f"No log has a column '{unmet[0]}'; there are {', '.join(sorted(met))}.")
    axes = _by_axis(_refined(looks, counts_per_turn, given))
    plain = Path(drive).stem if drive is not None else "drive"
    named = {prefix or plain: guesses for prefix, guesses in axes.items()}
    lines = [HEADER, f"title = {toml_string(Path(folder).resolve().name)}", ""]
    for name, guesses in named.items():
        lines += _axis(name, guesses, looks[0], drive, counts_per_turn)
    used = [each for guesses in named.values() for each in guesses]
    taken = {each.column.name for each in used}
    others = [each for each in looks[0].guesses if each.role != "time"]
    left = ", ".join(each.column.name for each in others if each.column.name not in taken)
    if left:
        lines += [f"{UNUSED}: {left}", ""]
    if counts_per_turn is not None and all(each.kind != "encoder_counts" for each in used):
        among = f" among {left}" if left else ""
        lines += [f"{NO_ENCODER}{among}; counts_per_turn = {counts_per_turn:.12g} is left out", ""]
    runs = [_run(look, named, Path(folder)) for look in looks]
    _mark_unreadable(lines, runs, looks)
    _hold_back(runs)
    for each in runs:
        lines += run_lines(each.file, each.role, each.more, seen=each.seen, why=each.why)
    return "\n".join(lines).rstrip() + "\n"


def _look(log: Log, given: Mapping[str, str], units: Mapping[str, str]) -> _Look:
    # a column that is said to be time or input takes the place of those that were guessed
    said = {"time" if what == "time" else "input" for what in given.values() if what in GIVEN}
    guesses = []
    for column in log.columns:
        guessed, what = guess(column), given.get(column.name)
        if what is not None:
            role = "time" if what == "time" else "input" if what in (*GIVEN, "other") else "channel"
            kind = None if what == "time" else cast("InputKind | ChannelKind", what)
            guessed = guessed._replace(role=role, kind=kind)
        elif guessed.role in said:
            guessed = guessed._replace(role="unknown", kind=None)
        guesses.append(guessed._replace(unit=units.get(column.name, guessed.unit)))
    time = next((each for each in guesses if each.role == "time"), None)
    return _Look(log, guesses, _numbers(log, [each.column.name for each in guesses]), time)


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
    looks: Sequence[_Look], counts_per_turn: float | None, given: Mapping[str, str]
) -> list[ColumnGuess]:
    """Guesses of all logs' columns with what their numbers say, each column once.

    A current has a sign if it goes to minus its peak in any log; two of them are plus and minus;
    whole numbers that begin anew at their end are an encoder's, whatever their name.
    """
    met: dict[str, ColumnGuess] = {}
    for each in chain.from_iterable(look.guesses for look in looks):
        met.setdefault(each.column.name, each)
    for name, each in met.items():
        values = [look.values[name] for look in looks if look.values.get(name, np.zeros(0)).size]
        empty = sum(int(np.count_nonzero(~np.isfinite(part))) for part in values)
        met[name] = each = each._replace(empty=empty)
        if each.kind == "encoder_counts" or (each.role == "unknown" and each.unit is None):
            sizes = [rolls_over_at(part, counts_per_turn) or 0 for part in values]
            if size := max(sizes, default=0):
                met[name] = each._replace(role="channel", kind="encoder_counts", rolls_over_at=size)
        if each.kind == "rectified_current" and values and name not in given and has_sign(values):
            met[name] = each._replace(kind="signed_current")
    for name, each in met.items():
        twin = met.get(name[:-1] + {"A": "B", "a": "b", "1": "2"}.get(name[-1:], "?"))
        if name[-2:-1] == "_" and twin is not None and "current" in str(each.kind):
            met[name] = each._replace(kind="current_plus")
            met[twin.column.name] = twin._replace(
                role="channel", kind="current_minus", axis=each.axis, unit=each.unit
            )
    if not {"current_plus", "current_minus"} <= {each.kind for each in met.values()}:
        for name, each in met.items():
            if each.kind in ("current_plus", "current_minus") and name not in given:
                met[name] = each._replace(kind="rectified_current", axis="")
    return list(met.values())


def _by_axis(guesses: Iterable[ColumnGuess]) -> dict[str, list[ColumnGuess]]:
    """Inputs and channels under the axis that their names begin with.

    An axis needs an input and a channel; columns without a prefix belong to the only axis.
    """
    useful = [each for each in guesses if each.role in ("input", "channel")]
    prefixes = dict.fromkeys(each.axis for each in useful if each.role == "input")
    named = [p for p in prefixes if p and any(c.axis == p and c.role == "channel" for c in useful)]
    if len(named) > 1:
        return {axis: [each for each in useful if each.axis == axis] for axis in named}
    return {"": useful}


# --- axes -----------------------------------------------------------------------------------------


def _axis(
    name: str,
    guesses: list[ColumnGuess],
    look: _Look,
    drive: str | None,
    counts_per_turn: float | None,
) -> list[str]:
    from swashplate.parameters.files import preset_names

    own = ['# drive = "hoist"    # a packaged drive or a parameter file, to be fitted']
    if drive is not None:
        own = [f"drive = {toml_string(name if name in preset_names() else drive)}"]
    column = None if look.time is None else look.time.column
    clock = f"{{ rate = 512 }}    # {FIXME}: no column of time found; samples a second"
    if look.time is not None and column is not None:
        unit = f', unit = "{look.time.unit or "s"}"' if column.unit is None else ""
        clock = f"{{ column = {toml_string(column.name)}{unit} }}"
    own += [f"time = {clock}", 'start = "rest"    # at the first sample: rest, steady or estimated']
    names = ", ".join(repr(each.name) for each in look.log.columns)
    left_open = f'column = "{FIXME}"    # which of {names}'
    drives = _inputs(guesses)
    given = [f'kind = "voltage"    # {FIXME}: or current, or other', f"{left_open} commands?"]
    given = _signal(drives[0], look, None) if drives else given
    given.append('interpolation = "previous"    # guessed: held between samples; or "linear"')
    given += [f"# another input? '{each.column.name}'" for each in drives[1:]]
    kind = f'kind = "shaft_speed"    # {FIXME}: or position, encoder_counts ...'
    channels = {
        channel: _signal(each, look, counts_per_turn)
        for channel, each in _channels(guesses).items()
    } or {"measured": [kind, f"{left_open} was measured?"]}
    return axis_lines(name, own, given, channels)


def _channels(guesses: Iterable[ColumnGuess]) -> dict[str, ColumnGuess]:
    """An axis's channels by their names in the file: the kind, and a number from the second on."""
    named: dict[str, ColumnGuess] = {}
    for each in guesses:
        if each.role == "channel":
            number = 1 + sum(each.kind == other.kind for other in named.values())
            named[str(each.kind) if number == 1 else f"{each.kind}_{number}"] = each
    return named


def _signal(guessed: ColumnGuess, look: _Look, counts_per_turn: float | None) -> list[str]:
    column, kind = guessed.column, str(guessed.kind)
    percent = kind == "other" and guessed.unit == "%"
    kind = "voltage" if percent else kind
    lines = [
        f'kind = "{kind}"    # guessed: {KINDS[kind].meaning}',
        f"column = {toml_string(column.name)}",
    ]
    scale = 1.0
    if percent:
        scale = 0.1
        lines += ['unit = "V"', "scale = 0.1    # guessed: 100 % stand for the 10 V of a card"]
    elif kind == "encoder_counts":
        given = "" if counts_per_turn is None else f"{counts_per_turn:.12g}"
        lines += [
            f"counts_per_turn = {given}"
            if given
            else f"# counts_per_turn = 1000    # {FIXME}: for one turn, quadrature included",
            "gear_ratio = 1.0    # turns of the encoder for one turn of the shaft",
        ]
        if guessed.rolls_over_at is not None:
            size = guessed.rolls_over_at
            lines.append(f"rolls_over_at = {size}    # guessed: begins anew after {size} counts")
    elif column.unit is None:
        unit = "mm" if guessed.linear else next(iter(KINDS[kind].units), "1")
        why = "from its name" if guessed.unit else "guessed: the header gives none"
        lines.append(f"unit = {toml_string(guessed.unit or unit)}    # {why}")
    if guessed.empty:
        lines.append(f'missing = "drop"    # guessed: {guessed.empty} cells are empty')
    if guessed.role == "input" and str(guessed.kind) == "other":
        values = look.values.get(column.name, np.zeros(0))
        neutral = float(values[np.isfinite(values)][0]) if np.isfinite(values).any() else 0.0
        if neutral:
            lines.append(
                f"offset = {-scale * neutral:.9g}    # guessed: the first sample is neutral"
            )
    return lines


# --- runs -----------------------------------------------------------------------------------------


@dataclass
class _Draft:
    """A run's entries, and kind and direction, and the size, of its maneuver."""

    file: str
    seen: str
    more: list[str]
    stratum: str
    peak: float
    role: str
    why: str = ""


def _run(look: _Look, axes: Mapping[str, list[ColumnGuess]], folder: Path) -> _Draft:
    path, root = look.log.path.resolve(), folder.resolve()
    file = path.relative_to(root) if path.is_relative_to(root) else path
    names = {column.name for column in look.log.columns}
    tested, without = list[str](), list[str]()
    for axis, guesses in axes.items():
        drives, channels = _inputs(guesses)[:1], _channels(guesses)
        missing = [
            f"axes.{toml_key(axis)}.channels.{key} = false    # no column "
            f"{toml_string(each.column.name)}"
            for key, each in channels.items()
            if each.column.name not in names
        ]
        if all(d.column.name in names for d in drives) and len(missing) < max(len(channels), 1):
            tested.append(axis)
            without += missing
    if tested and len(tested) < len(axes):
        without.insert(0, f"only = [{', '.join(toml_string(axis) for axis in tested)}]")
    role, why = ("fit", "") if tested else ("ignore", "it has no input")
    seen, stratum, peak = _seen(look, axes)
    return _Draft(file.as_posix(), seen, without, stratum, peak, role, why)


def _inputs(guesses: Iterable[ColumnGuess]) -> list[ColumnGuess]:
    return [each for each in guesses if each.role == "input"]


def _seen(look: _Look, axes: Mapping[str, list[ColumnGuess]]) -> tuple[str, str, float]:
    """Length, rate and maneuvers of a run for a comment; their kind, direction and size."""
    time = None if look.time is None else look.values.get(look.time.column.name)
    if look.time is None or time is None or time.size < 2:
        return f"{len(next(iter(look.values.values()), []))} samples", "", 0.0
    seen = [f"{time.size} samples"]
    try:
        time = to_si(1.0, look.time.unit or "s", "s", "") * (time - time[0])
    except InputError:
        return seen[0], "", 0.0
    if not np.all(np.diff(time) > 0.0):
        return seen[0], "", 0.0
    seen.append(f"{np.ptp(time):.4g} s at {1.0 / np.median(np.diff(time)):.4g} Hz")
    strata, peak = [], 0.0
    for guesses in axes.values():
        for drive in _inputs(guesses)[:1]:
            values = look.values.get(drive.column.name)
            if values is None or not np.isfinite(values).all():
                continue
            unit, size = drive.unit or "V", 1.0
            if drive.kind == "voltage":
                unit, size, _ = conversion("voltage", unit, drive.column.name)
            found = recognise(time, size * values, unit=unit)
            if drive.kind == "voltage":
                seen.append(found.name)
            away = values - values[0]
            low, high = -float(away.min()), float(away.max())
            both = min(low, high) > 0.25 * max(low, high)
            strata.append(f"{found.kind} {'both' if both else 'up' if high > low else 'down'}")
            peak = max(peak, low, high)
    return ", ".join(seen), ", ".join(strata), peak


def _mark_unreadable(lines: list[str], runs: list[_Draft], looks: Sequence[_Look]) -> None:
    """Give the role "ignore" to runs that the file, as it stands, could not be read with."""
    text = "\n".join(lines).replace("# counts_per_turn = 1000", "counts_per_turn = 1000")
    if f'column = "{FIXME}"' in text:
        return
    for each, look in zip(runs, looks, strict=True):
        if each.role == "ignore":
            continue
        one = "\n".join([text, *run_lines(each.file, each.role, each.more)])
        try:
            file = validated(parse_toml(one, "the draft"), CampaignFile, "the draft")
            list(read_run("the draft", "run", file.runs[0], file.axes, look.log))
        except (FileError, InputError) as error:
            each.role, each.why = "ignore", f"{FIXME}: {error}"


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
