"""First drafts of a campaign file: what each column of some logs may be, and a file that says so.

A column is what the table of kinds, `swashplate.campaign.schema.KINDS`, says of its name and unit,
and what its numbers show. What is not known for sure is marked "guessed"; what cannot be told stays
open in a line "FIXME".
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from math import pi
from pathlib import Path
from typing import NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.quality import ESTIMATED, has_sign, moves_at_first
from swashplate.campaign.reading import read_run
from swashplate.campaign.samples import rolls_over_at, turns_over
from swashplate.campaign.schema import KINDS, ROD, TURNS, CampaignFile, InputKind, conversion
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
NO_TIME = "# time = { rate = 512 }"
NO_ENCODER = "# No column looks like an encoder's counts"
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
    in_header: bool = True
    """Whether its unit stands in brackets, or in a row of its own, where it is read from again."""
    rolls_over_at: float = 0.0
    """Reading after which an encoder's counter or an angle begins anew; 0 if it does not."""


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
    given, units, folder = dict(columns or {}), dict(units or {}), Path(folder).resolve()
    opened = [open_log(path) for path in logs]
    headers = dict[str, Column]()
    for column in (column for log in opened for column in log.columns):
        headers.setdefault(column.name, column)
    why = "" if logs else "A draft needs at least one log"
    for name in sorted({*given, *units} - {*headers}):
        why = why or f"No log has a column '{name}'; there are {', '.join(sorted(headers))}"
    for name, what in given.items():
        if what not in ("time", *KINDS):
            why = f"'{name}' cannot be a '{what}': it is time, {', '.join(KINDS)}"
    if why:
        raise InputError(f"{why}.")
    numbers = [_numbers(log, [column.name for column in log.columns]) for log in opened]
    parts = {name: [each[name] for each in numbers if name in each] for name in headers}
    guesses = _guesses(headers, parts, counts_per_turn, given, units)
    axes = _axes(guesses, Path(drive).stem if drive is not None else "drive")
    lines = [HEADER, f"title = {toml_string(folder.name)}", ""]
    for name, axis in axes.items():
        lines += _axis_lines(name, axis, guesses, parts, opened[0], drive, counts_per_turn)
    used = [each for axis in axes.values() for each in (*axis.inputs, *axis.channels.values())]
    first = {each.name for each in opened[0].columns} - {each.name for each in used}
    left = ", ".join(e.name for e in guesses if e.name in first and e.kind != "time")
    if left:
        lines += [f"{UNUSED}: {left}", ""]
    if counts_per_turn is not None and all(each.kind != "encoder_counts" for each in used):
        among = f" among {left}" if left else ""
        lines += [f"{NO_ENCODER}{among}; counts_per_turn = {counts_per_turn:.12g} is left out", ""]
    text, runs = "\n".join(lines), list[_Run]()
    stems = [log.path.stem for log in opened]
    for log, read in zip(opened, numbers, strict=True):
        made = _run(log, read, axes, folder, text)
        if stems.count(log.path.stem) > 1:
            # logs of one name in several folders, or formats
            near = log.path.resolve().parent.name, log.path.name
            made.more.insert(0, f"name = {toml_string('/'.join(near))}")
        runs.append(made)
    held_back = _held_back([each for each in runs if each.role == '"fit"'])
    for each in runs:
        role = '"validate"' if each is held_back else each.role
        lines += ["[[runs]]", f"file = {each.file}", f"role = {role}", *each.more, ""]
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


def _by_words(column: Column, name: str, unit: str | None) -> _Guess:
    """What a name and a unit say: the first kind in the table that has either."""
    words = _words(name)
    if re.fullmatch(TIME, _words(name.rpartition("/")[2])):
        return _Guess(column.name, "time", "", column.unit)
    matches = {
        kind: match
        for kind, each in KINDS.items()
        if each.words and (match := re.fullmatch(rf"(?:(.*) )?(?:{each.words}){OF}", words))
    }
    marked = speed_unit(unit or "")
    kinds = (kind for kind, each in KINDS.items() if kind in matches or marked in each.marks)
    axis = next((match[1] for match in matches.values()), "")
    return _Guess(column.name, next(kinds, ""), axis or "", column.unit)


def _by_header(column: Column, kind: str | None) -> _Guess:
    """What a header says, of a kind if one is given; the unit may be the end of its name."""
    name = re.sub(r"[\[(].*[\])]", "", column.name).strip()
    unit = column.unit or ("rpm" if re.search(TURNS, name.lower()) else None)
    whole = _by_words(column, name, unit)
    stem, _, ending = name.rpartition("_")
    short = _by_words(column, stem, None)
    if short.kind == "other" and ending in ("V", "mV"):
        short = short._replace(kind="voltage")
    if kind is not None:
        whole, short = (each._replace(kind=kind) for each in (whole, short))
    measured = short.kind == "time" or (short.kind in KINDS and KINDS[short.kind].units)
    if column.unit is None and measured and whole.kind not in HALVES:
        try:
            if short.kind == "time":
                to_si(1.0, ending, "s", "")
            else:
                conversion(short.kind, ending, "")
            return short._replace(unit=ending, in_header=False)
        except InputError:
            pass
    unit = unit if whole.kind == "shaft_speed" else column.unit
    return whole._replace(unit=unit, in_header=column.unit is not None)


def _guesses(
    headers: Mapping[str, Column],
    parts: Mapping[str, list[Array]],
    counts_per_turn: float | None,
    given: Mapping[str, str],
    units: Mapping[str, str],
) -> list[_Guess]:
    """Guesses by headers, and by the numbers of all logs.

    A column that is said to be time or input takes the place of those that were guessed. A current
    has a sign if it goes to minus its peak in any log; half a current without the other half is a
    whole one; whole numbers that begin anew at their end are an encoder's, whatever their name.
    """
    taken = {"time"} & {*given.values()}
    taken |= {*INPUTS} if {"voltage", "current"} & {*given.values()} else set()
    met = list[_Guess]()
    for name, column in headers.items():
        values = [part for part in parts[name] if part.size]
        each = _by_header(column, given.get(name))
        kind = given.get(name, "" if each.kind in taken else each.kind)
        each = each._replace(kind=kind, unit=units.get(name, each.unit))
        if kind == "encoder_counts" or not (kind or each.unit):
            size = max((rolls_over_at(part, counts_per_turn) for part in values), default=0)
            each = each._replace(kind="encoder_counts" if size else kind, rolls_over_at=size)
        if kind == "position":
            each = each._replace(rolls_over_at=_turn(values, each.unit or "deg"))
        if kind == "rectified_current" and name not in given and has_sign(values):
            each = each._replace(kind="signed_current")
        met.append(each)
    kinds = {(each.axis, each.kind) for each in met}
    for n, each in enumerate(met):
        alone = each.kind in HALVES and any((each.axis, half) not in kinds for half in HALVES)
        if alone and each.name not in given:
            met[n] = each._replace(kind="rectified_current")
    return met


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
    prefixes = dict.fromkeys(each.axis for each in guesses if each.kind in INPUTS and each.axis)
    axes = {prefix: _axis([e for e in guesses if e.axis == prefix]) for prefix in prefixes}
    axes = {prefix: axis for prefix, axis in axes.items() if axis.channels}
    return axes if len(axes) > 1 else {plain: _axis(guesses)}


def _axis(ours: Sequence[_Guess]) -> _Axis:
    made = _Axis([each for each in ours if each.kind in INPUTS], {})
    for each in ours:
        if each.kind not in ("", "time", *INPUTS):
            number = 1 + sum(each.kind == other.kind for other in made.channels.values())
            made.channels[each.kind if number == 1 else f"{each.kind}_{number}"] = each
    return made


# --- what the file says ---------------------------------------------------------------------------


def _axis_lines(
    name: str,
    axis: _Axis,
    guesses: Sequence[_Guess],
    parts: Mapping[str, list[Array]],
    log: Log,
    drive: str | None,
    counts_per_turn: float | None,
) -> list[str]:
    """Tables of an axis; what the first log does not show stays open."""
    from swashplate.parameters.files import preset_names

    own = '# drive = "hoist"    # a packaged drive or a parameter file, to be fitted'
    if drive is not None:
        own = f"drive = {toml_string(name if name in preset_names() else drive)}"
    clock = f"{NO_TIME}    # {FIXME}: no column of time found; samples a second"
    clocks = {each.name: _clock(each, guesses) for each in guesses}
    main = next((clocks[each.name] for each in (*axis.inputs, *guesses)), "") or clock
    start = 'start = "rest"    # at the first sample: rest, steady or estimated'
    which = f'column = "{FIXME}"    # which of {", ".join(repr(each.name) for each in log.columns)}'
    kind = f'kind = "voltage"    # {FIXME}: or current, or other'
    tables = {"input": [kind, f"{which} commands?"]}
    if not axis.channels:
        kind = f'kind = "shaft_speed"    # {FIXME}: or position, encoder_counts ...'
        tables["channels.measured"] = [kind, f"{which} was measured?"]
    signals = [("input", each) for each in axis.inputs[:1]]
    signals += [(f"channels.{toml_key(key)}", each) for key, each in axis.channels.items()]
    for table, each in signals:
        tables[table] = _signal_lines(each, parts[each.name], counts_per_turn)
        tables[table] += [clocks[each.name]] * (clocks[each.name] not in ("", main))
    held = 'interpolation = "previous"    # guessed: by the controller; of another logger "linear"'
    tables["input"] += [held, *(f"# another input? '{each.name}'" for each in axis.inputs[1:])]
    lines = [f"[axes.{toml_key(name)}]", own, main, start, ""]
    for table, entries in tables.items():
        lines += [f"[axes.{toml_key(name)}.{table}]", *entries, ""]
    return lines


def _clock(signal: _Guess, guesses: Sequence[_Guess]) -> str:
    """A signal's line of time: the first column of time in its group of the file, or of all."""

    def beside(each: _Guess) -> bool:
        return each.name.rpartition("/")[0] == signal.name.rpartition("/")[0]

    times = sorted((each for each in guesses if each.kind == "time"), key=beside, reverse=True)
    for time in times[:1]:
        unit = "" if time.in_header else f', unit = "{time.unit or "s"}"'
        return f"time = {{ column = {toml_string(time.name)}{unit} }}"
    return ""


def _signal_lines(each: _Guess, parts: Sequence[Array], counts_per_turn: float | None) -> list[str]:
    """Entries of an input or a channel."""
    percent = each.kind in ("other", "voltage") and each.unit == "%"
    kind, scale = ("voltage", 0.1) if percent else (each.kind, 1.0)
    known = KINDS[kind]
    lines = [f'kind = "{kind}"    # guessed: {known.meaning}', f"column = {toml_string(each.name)}"]
    if percent:
        lines += ['unit = "V"', "scale = 0.1    # guessed: 100 % stand for the 10 V of a card"]
    elif kind == "encoder_counts":
        unknown = f"# counts_per_turn = 1000    # {FIXME}: for one turn, quadrature included"
        stated = f"counts_per_turn = {counts_per_turn or 0:.12g}"
        lines.append(unknown if counts_per_turn is None else stated)
        lines.append("gear_ratio = 1.0    # turns of the encoder for one turn of the shaft")
    elif not each.in_header:
        rod = re.fullmatch(rf"(?:.* )?(?:{ROD}){OF}", _words(each.name))
        usual = "mm" if rod else (*known.units, "1")[0]
        usual = "deg" if each.rolls_over_at else usual
        why = "from its name" if each.unit else "guessed: the header gives none"
        lines.append(f"unit = {toml_string(each.unit or usual)}    # {why}")
    if size := each.rolls_over_at:
        lines.append(f"rolls_over_at = {size:.9g}    # guessed: begins anew there")
    if empty := sum(int(np.count_nonzero(~np.isfinite(part))) for part in parts):
        lines.append(f'missing = "drop"    # guessed: {empty} cells are empty')
    neutral = next((x for part in parts for x in part[np.isfinite(part)][:1].tolist()), 0.0)
    if neutral and each.kind == "other":
        why = "guessed: the first sample is neutral"
        lines.append(f"offset = {-scale * neutral:.9g}    # {why}")
    return lines


class _Run(NamedTuple):
    """Entries of a run, and for each of its axes kind and direction, and size, of its maneuver."""

    file: str
    role: str
    more: list[str]
    stratum: str = ""
    peak: float = 0.0


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
    tested, more = dict[str, _Axis](), list[str]()
    for name, axis in axes.items():
        lacking = {key: e.name for key, e in axis.channels.items() if e.name not in names}
        if all(e.name in names for e in axis.inputs[:1]) and (
            not axis.channels or any(e.name in names - empty for e in axis.channels.values())
        ):
            tested[name] = axis
            false = f"axes.{toml_key(name)}.channels.{{}} = false    # no column {{}}"
            more += [false.format(toml_key(k), toml_string(n)) for k, n in lacking.items()]
    if tested and len(tested) < len(axes):
        more.insert(0, f"only = [{', '.join(map(toml_string, tested))}]")
    made = _Run(f"{toml_string(file)}    # {rows} samples", '"fit"', more)
    if not tested:
        return made._replace(role='"ignore"    # it has no input')
    if f'column = "{FIXME}"' in text:
        return made
    whole = text.replace("# counts_per_turn = 1000", "counts_per_turn = 1000")
    whole = whole.replace(NO_TIME, NO_TIME.lstrip("# "))
    whole = "\n".join([whole, "[[runs]]", f"file = {made.file}", *more])
    try:
        content = validated(parse_toml(whole, "the draft"), CampaignFile, "the draft")
        experiments = list(read_run("the draft", "run", content.runs[0], content.axes, log))
    except (FileError, InputError) as error:
        return made._replace(role=f'"ignore"    # {FIXME}: {error}')
    said, stratum, peak, seen = made.file, "", 0.0, set[str]()
    for each in (each for each in experiments if each.axis not in seen):
        if not seen and NO_TIME not in text:
            rate = 1.0 / float(np.median(np.diff(each.input.time)))
            said += f", {each.duration:.4g} s at {rate:.4g} Hz"
        seen.add(each.axis)
        said += f", {each.maneuver}" if each.input.kind == "voltage" else ""
        if moves_at_first(each):
            more.append(f"axes.{toml_key(each.axis)}.{ESTIMATED}    # guessed: it begins in motion")
        away = each.input.values - each.input.values[0]
        low, high = -float(away.min()), float(away.max())
        both = min(low, high) > 0.25 * max(low, high)
        kind = each.recognised.kind if each.recognised else ""
        stratum += f"{kind} {'both' if both else 'up' if high > low else 'down'}, "
        peak = max(peak, low, high)
    return made._replace(file=said, stratum=stratum, peak=peak)


def _held_back(fitted: Sequence[_Run]) -> _Run | None:
    """The run to validate with: the others have its kind, its direction and more than its size."""
    largest = dict[str, _Run]()
    for each in fitted:
        if each.peak > largest.setdefault(each.stratum, each).peak:
            largest[each.stratum] = each
    others = [each for each in fitted if each is not largest[each.stratum]]
    return others[-1] if others and len(fitted) >= MANY else None
