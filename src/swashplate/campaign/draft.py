"""A first draft of a campaign file, from the headers of its logs."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.guesses import Guess, by_axis, guess, refined
from swashplate.campaign.kinds import KINDS
from swashplate.campaign.recognition import recognise
from swashplate.errors import FileError, InputError
from swashplate.logs import Log, open_log

Array = NDArray[np.float64]

HEADER = """\
# A draft, made from the headers of the logs: check each line that says "guessed".
# What a signal is: sign * (scale * number + offset), in its unit.
# Every entry is explained by `swashplate campaign schema`; `swashplate campaign check` reads
# all logs and says what is wrong with them.
"""


UNUSED = "# Columns that are not used"
NO_ENCODER = "# No column looks like an encoder's counts"
"""How the lines begin that say what the draft leaves out."""


class _Look(NamedTuple):
    """What a log shows at first sight."""

    log: Log
    guesses: list[Guess]
    values: dict[str, Array]

    @property
    def time(self) -> Guess | None:
        return next((each for each in self.guesses if each.role == "time"), None)


def draft(
    logs: Sequence[str | Path],
    folder: str | Path,
    drive: str | None = None,
    counts_per_turn: float | None = None,
) -> str:
    """The text of a campaign file for some logs.

    Parameters
    ----------
    logs : sequence of paths
        The logs, one run each.
    folder : path
        Where the campaign file will lie; the logs are named from there.
    drive : str, optional
        A packaged drive or a parameter file for all axes.
    counts_per_turn : float, optional
        Of all encoders. Without it the entry is left to be filled in, and the file is refused
        until it is.

    Returns
    -------
    str
        Commented TOML that `Campaign.from_toml` reads, guesses marked as such.

    Raises
    ------
    FileError
        If a log cannot be read.
    InputError
        If no column of the first log looks like an input, or none like a measurement.
    """
    if not logs:
        raise InputError("A draft needs at least one log.")
    looks = [_look(open_log(path), counts_per_turn) for path in logs]
    first = looks[0]
    axes = by_axis(_with_counters(looks))
    plain = Path(drive).stem if drive is not None else "drive"
    named = {prefix or plain: guesses for prefix, guesses in axes.items()}
    for guesses in named.values():
        _demand(first.log, guesses)
    lines = [HEADER, f'title = "{_quoted(Path(folder).resolve().name)}"', ""]
    for name, guesses in named.items():
        lines += _axis(name, guesses, first, drive, counts_per_turn)
    taken = {each.column.name for guesses in named.values() for each in guesses}
    left = [
        each.column.name
        for each in first.guesses
        if each.column.name not in taken and each.role != "time"
    ]
    if left:
        lines += [f"{UNUSED}: {', '.join(left)}", ""]
    kinds = {each.kind for guesses in named.values() for each in guesses}
    if counts_per_turn is not None and "encoder_counts" not in kinds:
        among = f" among {', '.join(left)}" if left else ""
        lines += [f"{NO_ENCODER}{among}; counts_per_turn = {counts_per_turn:.12g} is left out", ""]
    for number, look in enumerate(looks):
        held_back = len(looks) >= 4 and number == len(looks) - 1
        lines += _run(look, named, Path(folder), held_back)
    return "\n".join(lines).rstrip() + "\n"


def _look(log: Log, counts_per_turn: float | None) -> _Look:
    guesses = [guess(column) for column in log.columns]
    unknown = [each.column.name for each in guesses if each.role == "unknown"]
    wanted = [each.column.name for each in guesses if each.role != "unknown"]
    values = {**_numbers(log, unknown), **log.read(wanted)}
    none = np.zeros(0)
    return _Look(
        log,
        [refined(each, values.get(each.column.name, none), counts_per_turn) for each in guesses],
        values,
    )


def _numbers(log: Log, names: list[str]) -> dict[str, Array]:
    """Those columns that hold numbers; of the others nothing is wanted."""
    try:
        return log.read(names) if names else {}
    except FileError:
        if len(names) == 1:
            return {}
        return {key: each for name in names for key, each in _numbers(log, [name]).items()}


def _with_counters(looks: list[_Look]) -> list[Guess]:
    """Guesses of the first log; whether a counter begins anew, any of the logs may show."""
    rolled = {
        each.column.name: each
        for look in reversed(looks)
        for each in look.guesses
        if each.rolls_over_at is not None
    }
    return [rolled.get(each.column.name, each) for each in looks[0].guesses]


def _demand(log: Log, guesses: list[Guess]) -> None:
    for role, what in (("input", "a command or voltage"), ("channel", "a measured signal")):
        if not any(each.role == role for each in guesses):
            names = ", ".join(repr(each.name) for each in log.columns)
            raise InputError(
                f"{log.path}: no column looks like {what} among {names}; name the columns "
                "'voltage [V]', 'current [A]', 'counts' or the like, or write the campaign file "
                "by hand."
            )


def _axis(
    name: str,
    guesses: list[Guess],
    look: _Look,
    drive: str | None,
    counts_per_turn: float | None,
) -> list[str]:
    lines = [f"[axes.{_key(name)}]"]
    if drive is not None:
        lines.append(f'drive = "{_quoted(drive)}"')
    else:
        lines.append('# drive = "hoist"    # a packaged drive or a parameter file, to be fitted')
    lines += [
        _clock(look),
        'start = "rest"    # at the first sample: rest, steady or estimated',
        "",
    ]
    drives = [each for each in guesses if each.role == "input"]
    lines += [f"[axes.{_key(name)}.input]"]
    lines += _signal(drives[0], look, None)
    lines += ['interpolation = "previous"    # guessed: held between samples; or "linear"', ""]
    for each in drives[1:]:
        lines += [f"# another input? '{each.column.name}'"]
    used: set[str] = set()
    for each in guesses:
        if each.role != "channel":
            continue
        channel = str(each.kind)
        while channel in used:
            channel += "_2"
        used.add(channel)
        lines += [
            f"[axes.{_key(name)}.channels.{channel}]",
            *_signal(each, look, counts_per_turn),
            "",
        ]
    return lines


def _clock(look: _Look) -> str:
    if look.time is None:
        return "time = { rate = 512 }    # guessed: no column of time found; samples a second"
    column = look.time.column
    unit = "" if column.unit else ', unit = "s"'
    return f'time = {{ column = "{_quoted(column.name)}"{unit} }}'


def _signal(guessed: Guess, look: _Look, counts_per_turn: float | None) -> list[str]:
    column, kind = guessed.column, str(guessed.kind)
    lines = [
        f'kind = "{kind}"    # guessed: {KINDS[kind].meaning}',
        f'column = "{_quoted(column.name)}"',
    ]
    if kind == "encoder_counts":
        given = "" if counts_per_turn is None else f"{counts_per_turn:.12g}"
        lines += [
            f"counts_per_turn = {given}"
            if given
            else "# counts_per_turn = 1000    # fill in: for one turn, quadrature included",
            "gear_ratio = 1.0    # turns of the encoder for one turn of the shaft",
        ]
        if guessed.rolls_over_at is not None:
            size = guessed.rolls_over_at
            lines.append(f"rolls_over_at = {size}    # guessed: begins anew after {size} counts")
    elif column.unit is None:
        unit = "mm" if guessed.linear else next(iter(KINDS[kind].units), "1")
        lines.append(f'unit = "{unit}"    # guessed: the header gives none')
    if guessed.role == "input" and kind == "other":
        neutral = float(look.values[column.name][0])
        if neutral:
            lines.append(f"offset = {-neutral:.9g}    # guessed: the first sample is neutral")
    return lines


def _run(look: _Look, axes: dict[str, list[Guess]], folder: Path, held_back: bool) -> list[str]:
    path = look.log.path.resolve()
    root = folder.resolve()
    file = path.relative_to(root) if path.is_relative_to(root) else path
    lines = ["[[runs]]", f'file = "{_quoted(file.as_posix())}"    # {_seen(look, axes)}']
    lines.append('role = "validate"' if held_back else 'role = "fit"')
    names = {column.name for column in look.log.columns}
    missing = {
        axis: [each.column.name for each in guesses if each.column.name not in names]
        for axis, guesses in axes.items()
    }
    complete = [axis for axis in axes if not missing[axis]]
    if len(complete) < len(axes):
        absent = sorted({name for each in missing.values() for name in each})
        lines.append(f"# without the columns {', '.join(absent)}")
        lines.append(f"only = [{', '.join(_string(axis) for axis in complete)}]")
    return [*lines, ""]


def _seen(look: _Look, axes: dict[str, list[Guess]]) -> str:
    """Length, rate and manoeuvres of a run, for a comment."""
    if look.time is None or look.values[look.time.column.name].size < 2:
        return f"{len(next(iter(look.values.values())))} samples"
    time = look.values[look.time.column.name]
    seen = [f"{time.size} samples"]
    if np.all(np.diff(time) > 0.0) and look.time.column.unit in (None, "s"):
        seen.append(f"{np.ptp(time):.4g} s at {1.0 / np.median(np.diff(time)):.4g} Hz")
        for guesses in axes.values():
            drive = next(each for each in guesses if each.role == "input")
            values = look.values.get(drive.column.name)
            if drive.kind == "voltage" and values is not None and np.isfinite(values).all():
                seen.append(recognise(time, values).name)
    return ", ".join(seen)


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _string(name)


def _string(text: str) -> str:
    return f'"{_quoted(text)}"'


def _quoted(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"')
