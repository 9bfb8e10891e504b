"""From the words of a command line to drives, changes and simulations."""

from __future__ import annotations

import re
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

from swashplate.errors import InputError

if TYPE_CHECKING:
    from swashplate.campaign import Experiment
    from swashplate.drive import Drive
    from swashplate.identification.own_model import ModelParameters
    from swashplate.maneuvers import Maneuver
    from swashplate.parameters.parameter_set import Change, ParameterSet
    from swashplate.simulation.result import Simulation

Interpolation = Literal["linear", "previous"]
Start = Literal["rest", "steady"]

_NUMBER = r"[+-]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|inf\b|nan\b)"
_VALUE = re.compile(rf"\s*({_NUMBER})(?:/({_NUMBER}))?\s*((?:1/)?[^\W\d_].*|°.*)?")
DRIVE = "drive.toml"
"""The drive in a folder that a fit wrote."""
NUMBERS = "parameters.toml"
"""What a fit of a model of one's own writes in the place of a drive."""
_ENDING = re.compile(r"\.[A-Za-z]\w*$")


def drive_file(word: str) -> Path | None:
    """The parameter file that a word means, None for a packaged set.

    A folder means the drive.toml that 'fit' wrote into it; a packaged name goes before a folder of
    that name, which can be written ``./hoist``.

    Raises
    ------
    InputError
        If it is none of these, or a folder without a drive.
    """
    from swashplate.parameters.files import preset_names

    place = Path(word)
    if word in preset_names():
        return None
    if place.is_dir():
        if not (place / DRIVE).is_file():
            raise InputError(
                f"There is no {DRIVE} in {word}: give a folder that 'swashplate fit' wrote, or a "
                "parameter file."
            )
        return place / DRIVE
    if place.suffix.lower() == ".toml" or len(place.parts) > 1 or place.is_file():
        return place
    raise InputError(
        f"There is no packaged set, file or folder '{word}'; packaged are "
        f"{', '.join(preset_names())}."
    )


def parameters_of(word: str) -> ParameterSet:
    """The packaged set of a name, the set in a TOML file, or the one that a fit's folder holds."""
    from swashplate.parameters.files import load_preset, load_set

    file = drive_file(word)
    return load_preset(word) if file is None else load_set(file)


def model_parameters_of(folder: str, file: Path, runs: Sequence[Experiment]) -> ModelParameters:
    """A model of one's own with the numbers that a fit wrote into its folder.

    Raises
    ------
    InputError
        If the folder has none of this model.
    """
    from dataclasses import replace

    from swashplate.documents import parse_toml, read_text
    from swashplate.identification.own_model import ModelSetup

    setup = ModelSetup.from_file(file)
    place = Path(folder) / NUMBERS if Path(folder).is_dir() else Path(folder)
    table = parse_toml(read_text(place), str(place)).get(setup.name)
    nominal = setup.nominal(runs)
    if not isinstance(table, dict) or table.keys() != nominal.numbers.keys():
        raise InputError(
            f"{place} has no table [{setup.name}] with {', '.join(nominal.numbers)}: give the "
            f"folder that 'swashplate fit --model {file}' wrote."
        )
    return replace(nominal, numbers={name: float(value) for name, value in table.items()})


def drive_of(word: str, values: Sequence[str] = (), factors: Sequence[str] = ()) -> Drive:
    """The drive of a name or file, with values set and then scaled."""
    from swashplate.drive import Drive

    drive = Drive(parameters_of(word))
    return drive.replace(**_changes("--set", values)).scale(**_changes("--scale", factors))


def title_of(word: str, drive: Drive) -> str:
    """A drive's name for a heading; one from a file of another name goes by that, too."""
    path = Path(word)
    return drive.name if path.stem == drive.name else f"{path.name or word} ({drive.name})"


def changes_said(word: str, drive: Drive) -> list[str]:
    """A line for each parameter that is not as its set has it."""
    lines = []
    for old in parameters_of(word).values():
        new = drive[old.symbol]
        if new.value != old.value:
            before, after = ("/".join(f"{v:g}" for v in each.values) for each in (old, new))
            lines.append(f"{old.symbol} ({old.name}): {before} -> {after} {old.unit}")
    return lines


def _changes(option: str, words: Sequence[str]) -> dict[str, Change]:
    changes: dict[str, Change] = {}
    for word in words:
        name, change = _change(option, word)
        if name in changes:
            raise InputError(f"{option} gives {name} twice; give it once.")
        changes[name] = change
    return changes


def _change(option: str, word: str) -> tuple[str, Change]:
    from swashplate.parameters.definitions import find
    from swashplate.units import to_si

    scaled = option == "--scale"
    name, equals, given = (part.strip() for part in word.partition("="))
    read = numbers_and_unit(given) if equals else None
    if read is None or (scaled and read[1]):
        examples = (
            "Z16=1.5 or Z16=1.5/1.2 (plus/minus)"
            if scaled
            else "Z16=1.2e-4, Z16=1.2e-4/1.5e-4 (plus/minus) or Z16_plus=0.12mm"
        )
        raise InputError(f"{option} cannot read '{word}'; write it as {examples}.")
    definition = find(name)
    numbers, unit = read
    if unit:
        what = f"{name} ({definition.name})"
        numbers = [to_si(number, unit, definition.unit, what) for number in numbers]
    return name, numbers[0] if len(numbers) == 1 else (numbers[0], numbers[1])


def numbers_and_unit(given: str) -> tuple[list[float], str] | None:
    """One number or two, and their unit, from ``1.2e-4``, ``0.12mm`` or ``1.2/1.5``."""
    match = _VALUE.fullmatch(given)
    if match is None:
        return None
    return [float(number) for number in match.group(1, 2) if number], (match[3] or "").strip()


def maneuver_of(word: str, *drives: Drive) -> Maneuver:
    """A manoeuvre such as ``step:9``, or the source's test of that name for these drives."""
    from swashplate.maneuvers import parse, source_tests
    from swashplate.parameters.files import AXES

    axes = [drive.name for drive in drives if drive.name in AXES]
    tests = {name: test for axis in reversed(axes) for name, test in source_tests(axis).items()}
    if word in tests:
        return tests[word]
    try:
        return parse(word)
    except InputError as error:
        if ":" in word or not tests:
            raise
        said = str(error).rstrip(".")
        near = get_close_matches(word, tests, 1) or [*tests]
        raise InputError(
            f'{said}; or name one of the tests of {" or ".join(axes)}, such as "{near[0]}".'
        ) from None


class Options(NamedTuple):
    """How a command is to be read and simulated."""

    rate: float
    interpolation: Interpolation | None
    start: Start
    clip: bool
    time_column: str
    column: str


def simulated(drive: Drive, command: str, options: Options) -> tuple[str, Simulation]:
    """Name of a command, a manoeuvre or a file, and the drive's simulation over it."""
    from swashplate.equations.marching.record import least_substeps

    least_substeps(options.rate)  # a rate out of range is refused before anything is sampled
    if _is_file(command, drive):
        return Path(command).name, _simulated_file(drive, command, options)
    maneuver = maneuver_of(command, drive)
    return maneuver.name, drive.simulate(
        maneuver.sample(options.rate),
        options.rate,
        interpolation=options.interpolation,
        start=options.start,
        clip=options.clip,
    )


def _is_file(word: str, drive: Drive) -> bool:
    from swashplate.logs import SUFFIXES

    if word.lower().endswith(SUFFIXES):
        return True
    head = word.partition(":")[0]  # stairs:2/4/0 is no path
    return "/" in head or _ENDING.search(head) is not None or Path(word).is_file()


def _simulated_file(drive: Drive, path: str, options: Options) -> Simulation:
    from swashplate.logs import read_series

    _check_columns(path, options)
    series = read_series(path, options.column, "V", time_column=options.time_column)
    if options.interpolation is None:
        raise InputError(
            f"{path} needs --interpolation linear (a straight line from row to row) or "
            "--interpolation previous (each row held until the next)."
        )
    try:
        return drive.simulate(
            series.values,
            options.rate,
            time=series.time,
            interpolation=options.interpolation,
            start=options.start,
            clip=options.clip,
        )
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _check_columns(path: str, options: Options) -> None:
    """Say with which option another column is named, if one is not there."""
    from swashplate.logs import open_log

    log = open_log(path)
    for option, name in (("--time-column", options.time_column), ("--column", options.column)):
        try:
            log.find(name)
        except InputError as error:
            raise InputError(f"{str(error).rstrip('.')}, with {option}.") from None
