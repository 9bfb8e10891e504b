"""From the arguments of a command line to drives, values and campaigns."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import fields, replace
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from swashplate.documents import parse_toml, read_text
from swashplate.errors import (
    FileError,
    InputError,
    MissingFileError,
    ParameterError,
    UnknownParameterError,
)
from swashplate.units import unit_text

if TYPE_CHECKING:
    from swashplate.analysis import FactorRange
    from swashplate.campaign import Campaign, Experiment
    from swashplate.drive import Drive, KeyNumbers
    from swashplate.identification import FitSetup, ModelSetup, StoredVerdict
    from swashplate.logs import TextOptions
    from swashplate.parameters import Change, Parameter, ParameterSet

_NUMBER = r"[+-]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|inf\b|nan\b)"
_VALUE = re.compile(rf"\s*({_NUMBER})(?:/({_NUMBER}))?\s*((?:1/)?[^\W\d_].*|°.*)?")
_MACHINE_WORD = re.compile(r"(.+\.py)(?::(.*))?")
SETUP_FILE, NUMBERS, FIT_FILE = "setup.toml", "parameters.toml", "fit.json"
"""In a folder that a fit wrote: its fit setup, the numbers of a user-defined model, the fit."""
LOAD = "load_torque"
SENSITIVE_TO_LOAD = ("motor_leakage", "motor_constant")
"""Refinements that make the speed depend on the load."""
SUSPICIOUS_RATIO = 1000.0
"""Ratio of new to old value from which a unit is questioned."""

# --- files and what they are ----------------------------------------------------------------------

KIND_NAMES = {
    "log": "a log",
    "campaign": "a campaign",
    "drive": "a drive",
    "setup": "a fit setup",
    "model": "a model file",
}
_MARKS = {
    "runs": "campaign",
    "free": "setup",
    "stages": "setup",
    "control_card": "drive",
    "pump_motor": "drive",
}
_INSTEAD = {
    ("log", "campaign"): "make a campaign of it with 'swashplate campaign init {}'",
    ("log", "drive"): "a drive is a packaged name, a parameter file or the folder of a fit",
    ("drive", "campaign"): "name the campaign first, and the initial drive with --from",
    ("setup", "campaign"): "name the campaign first, and this file with --setup",
    ("campaign", "drive"): "name a drive here, and the campaign in place of CAMPAIGN.toml",
    ("setup", "drive"): "name a drive here, and this file with --setup",
    (
        "model",
        "drive",
    ): "simulate, show, limits, linearize, bode and export take it",
    ("model", "campaign"): "name the campaign first, and this file with --model",
}


def file_kind(path: Path) -> str:
    """Kind of a file: ``"log"``, ``"model"`` and others of `KIND_NAMES`, or empty."""
    from swashplate.logs import SUFFIXES

    if path.suffix == ".py":
        return "model"
    if path.name.lower().endswith((*SUFFIXES, ".xlsx", ".xls")):
        return "log"
    try:
        tables = parse_toml(read_text(path), str(path))
    except FileError:
        return ""
    return next((kind for mark, kind in _MARKS.items() if mark in tables), "")


def check_file_kind(path: Path, expected: str) -> None:
    """Refuse a file of another kind than expected; name the right place for such a file."""
    kind = file_kind(path)
    instead = _INSTEAD.get((kind, expected))
    if path.is_file() and instead is not None:
        raise InputError(
            f"{path} is {KIND_NAMES[kind]}, not {KIND_NAMES[expected]}: {instead.format(path)}."
        )


class MachineWord(NamedTuple):
    """Where a machine of a user's own is found."""

    file: Path
    """Python file."""
    name: str = ""
    """Name in it; empty for its machine."""
    fitted: str = ""
    """Folder of the fit whose numbers it has; empty for nominal ones."""


def machine_word(word: str, model: Path | None = None) -> MachineWord | None:
    """What a word such as ``valve.py:loop`` names; None if it names a drive.

    With the file of a model the word is the folder of a fit of it.
    """
    match = _MACHINE_WORD.fullmatch(word)
    if model is not None:
        if match is not None:
            raise InputError(
                f"{word} is a model file itself: leave out --model, or name the folder of a fit."
            )
        return MachineWord(model, fitted=word)
    return None if match is None else MachineWord(Path(match[1]), match[2] or "")


def title_of(campaign: Campaign) -> str:
    """Title of a campaign, marked if its tests are virtual."""
    return f"{campaign.title} (virtual)" if campaign.virtual else campaign.title


def campaign_of(path: Path, axis: str | None = None) -> tuple[Campaign, str]:
    """Read a campaign file; return the campaign and the given axis, or its only one."""
    from swashplate.campaign import Campaign

    if not path.exists():
        raise MissingFileError(
            f"There is no file {path}: name a campaign, or make one of your logs with 'swashplate "
            "campaign init LOGS'."
        )
    check_file_kind(path, "campaign")
    campaign = Campaign.from_toml(path)
    if campaign.without_runs:
        raise InputError(f"{campaign.without_runs}.")
    if axis is None and len(campaign.axes) > 1:
        raise InputError(f"{path} has the axes {', '.join(campaign.axes)}; name one with --axis.")
    if axis is not None:
        campaign.select(axis=axis)
    return campaign, axis or next(iter(campaign.axes))


class FitBasis(NamedTuple):
    """Campaign, runs, setup and initial drive of a fit."""

    campaign: Campaign
    experiments: tuple[Experiment, ...]
    """Runs to fit."""
    setup: FitSetup
    start: ParameterSet
    """The drive that the fit begins at."""


def fit_basis(path: Path, axis: str | None, setup: str | None, begin: str | None) -> FitBasis:
    """Read campaign, runs, setup and initial drive of a fit."""
    from swashplate.identification import runs_to_fit
    from swashplate.identification.estimation import setup_of

    campaign, axis_name = campaign_of(path, axis)
    start = campaign.drive(axis_name).parameters if begin is None else parameters_of(begin)
    return FitBasis(
        campaign=campaign,
        experiments=runs_to_fit(campaign, axis_name),
        setup=setup_of(campaign, axis_name, start, setup),
        start=start,
    )


def drive_file(word: str) -> Path | None:
    """The parameter file that a word means, as `swashplate.parameters.files.set_file` has it.

    A file that is plainly of another kind is refused.
    """
    from swashplate.parameters import set_file

    own = machine_word(word)
    if own is not None:
        check_file_kind(own.file, "drive")
    file = set_file(word)
    if file is not None:
        check_file_kind(file, "drive")
    return file


def parameters_of(word: str) -> ParameterSet:
    """A packaged set by its name, or the set in a TOML file or in the folder of a fit."""
    from swashplate.parameters import load_preset, load_set

    file = drive_file(word)
    return load_preset(word) if file is None else load_set(file)


def model_parameters_of(folder: str, file: Path, runs: Sequence[Experiment]) -> ModelSetup:
    """Read a user-defined model from its file, and its numbers from the folder of its fit."""
    from swashplate.identification import ModelSetup

    setup = ModelSetup.from_file(file)
    nominal = setup.nominal(runs)
    word = MachineWord(file, fitted=folder)
    numbers = fitted_numbers(word, setup, nominal.numbers.keys(), others=False)
    return replace(nominal, numbers=numbers)


def fitted_numbers(
    word: MachineWord, setup: ModelSetup, needed: Collection[str], *, others: bool = True
) -> dict[str, float]:
    """Numbers in the folder of a fit, which must have those needed; `others` may be there, too."""
    from swashplate.machine.fields import is_real

    folder = Path(word.fitted)
    file = folder / NUMBERS if folder.is_dir() else folder
    table = parse_toml(read_text(file), str(file)).get(setup.name)
    names = set(table) if isinstance(table, dict) else set[str]()
    is_whole = set(needed) <= names if others else set(needed) == names
    if not isinstance(table, dict) or not is_whole:
        raise InputError(
            f"{file} has no table [{setup.name}] with {', '.join(needed)}: give the folder that "
            f"'swashplate fit --model {word.file}' wrote."
        )
    for name, value in table.items():
        if isinstance(value, bool) or not is_real(value):
            raise InputError(
                f"{file}: {name} under [{setup.name}] is {value!r:.60}, which is not a number."
            )
    return {name: float(value) for name, value in table.items()}


def fit_of(word: str, numbers: Mapping[str, float]) -> StoredVerdict | None:
    """The verdict on the fit whose folder, or a file in it, is named, and what it rests on.

    None if there is no such fit, or if these numbers are not its own.
    """
    from swashplate.identification import read_verdict

    place = Path(word) if Path(word).is_dir() else Path(word).parent
    try:
        stored = read_verdict(place / FIT_FILE)
    except (FileError, ParameterError):
        # a packaged drive has no fit, and one of another version is no reason against a drive
        return None
    if stored is None or stored.numbers != dict(numbers):
        return None
    return stored


def key_numbers_of(word: str, drive: Drive) -> KeyNumbers:
    """The numbers that matter of a drive, with intervals if it is that of the named fit."""
    from swashplate.analysis import key_numbers

    stored = fit_of(word, drive.parameters.numbers)
    return (stored and stored.key_numbers) or key_numbers(drive)


def doubt_of(word: str, drive: Drive) -> str:
    """What speaks against the fit that a drive comes from, as its verdict says; empty if nothing.

    That is its headline if it is not usable, else what would explain the error that is not noise,
    else the first of what asks for attention.
    """
    file = drive_file(word)
    if file is None or not file.with_name(FIT_FILE).is_file():
        return drive.parameters.doubt
    stored = fit_of(str(file), drive.parameters.numbers)
    if stored is None:
        return drive.parameters.doubt
    verdict = stored.verdict
    if not verdict.usable:
        return verdict.headline
    if verdict.causes:
        return f"Not all of its error is noise. It would be explained by {verdict.cause}"
    return verdict.remarks[0] if verdict.remarks else ""


# --- changes and design variables -----------------------------------------------------------------


def assignments_of(
    option: str,
    assignments: Iterable[str],
    example: str,
    definition_of: Callable[[str], Any],
    counts: Collection[int] = (1, 2),
    *,
    units: bool = False,
) -> dict[str, Any]:
    """Parse assignments such as ``Z16=1.2e-4/1.5e-4`` or ``Z16=0.12mm``; a name occurs only once.

    `definition_of` returns a name's definition or raises an error. `counts` are the allowed numbers
    of values. With `units`, a unit may follow them, and they are converted to SI.
    """
    from swashplate.units import to_si

    values: dict[str, Any] = {}
    for assignment in assignments:
        name, _, value = (part.strip() for part in assignment.partition("="))
        match = _VALUE.fullmatch(value)
        definition = None
        numbers = list[float]()
        unit = ""
        if match is not None:
            definition = definition_of(name)
            unit = (match[3] or "").strip()
            numbers = [float(number) for number in match.group(1, 2) if number]
        if len(numbers) not in counts or (unit and not units):
            raise InputError(f"{option} cannot read '{assignment}'; write it as {example}.")
        if name in values:
            raise InputError(f"{option} gives {name} twice; give it once.")
        if unit and definition is not None:
            title = f"{name} ({definition.name})"
            numbers = [to_si(number, unit, definition.unit, title) for number in numbers]
        values[name] = numbers[0] if len(numbers) == 1 else (numbers[0], numbers[1])
    return values


def drive_of(word: str) -> Drive:
    """The drive of a name or file."""
    from swashplate.drive import Drive

    return Drive(parameters_of(word))


def changed_drive(drive: Drive, values: Sequence[str] = (), factors: Sequence[str] = ()) -> Drive:
    """A drive with values set and then scaled."""
    definitions = drive.parameters.definitions

    def definition_to_set(name: str) -> Any:
        if _is_design_variable(name):
            raise InputError(
                f"{name} is a design variable, which has no value: write --scale {name}=1.5."
            )
        return definitions.find(name)

    set_as = "Z16=1.2e-4, Z16=1.2e-4/1.5e-4 (plus/minus) or Z16_plus=0.12mm"
    scaled_as = "Z16=1.5, Z16=1.5/1.2 (plus/minus) or orifice=1.5"
    scaled_variables = list[str]()
    scaled_parameters = list[str]()
    for assignment in factors:
        name = assignment.partition("=")[0].strip()
        scaled = scaled_variables if _is_design_variable(name) else scaled_parameters
        scaled.append(assignment)

    def definition_to_scale(name: str) -> Any:
        """Definition of a parameter; an error that lists the design variables, too, if unknown."""
        try:
            return definitions.find(name)
        except UnknownParameterError:
            from swashplate.analysis import powers_of

            return powers_of(name)

    changes = assignments_of("--set", values, set_as, definition_to_set, units=True)
    variable_factors = assignments_of("--scale", scaled_variables, scaled_as, str, (1,))
    drive = drive.replace(**changes)
    parameter_factors = assignments_of("--scale", scaled_parameters, scaled_as, definition_to_scale)
    drive = drive.scale(**parameter_factors)
    if variable_factors:
        from swashplate.analysis import with_factors

        drive = with_factors(drive, variable_factors)
    return drive


def _is_design_variable(name: str) -> bool:
    from swashplate.parameters import CATALOGUE, COLUMNS, REFINEMENTS

    if name in CATALOGUE or name in COLUMNS or name in REFINEMENTS:
        return False
    from swashplate.analysis import DESIGN_VARIABLES

    return name in DESIGN_VARIABLES


def physical_values(assignments: Sequence[str]) -> dict[str, Change]:
    """Physical values in SI from assignments such as ``oil_volume=100cm^3``."""
    from swashplate.full_order import chosen_quantity

    example = "oil_volume=1e-4 or oil_volume=100cm^3"
    return assignments_of("--physical", assignments, example, chosen_quantity, units=True)


def factors_of(assignments: Sequence[str]) -> dict[str, float]:
    """Factors by design variable or parameter from assignments such as ``orifice=1.5``."""
    from swashplate.analysis import powers_of

    return assignments_of("--scale", assignments, "orifice=1.5", powers_of, (1,))


def factor_ranges_of(variables: Sequence[str], default: FactorRange) -> dict[str, FactorRange]:
    """Ranges of factors by design variable, from texts such as ``pump`` or ``pump=0.8/1.5``."""
    from swashplate.analysis import powers_of

    lowest, highest = default
    assignments = [
        variable if "=" in variable else f"{variable}={lowest}/{highest}" for variable in variables
    ]
    return assignments_of("--variable", assignments, "pump or pump=0.8/1.5", powers_of, (2,))


def pairs_of(
    option: str, texts: Sequence[str] | None, example: str, *, often: bool = False
) -> list[tuple[str, str]]:
    """Name and value of each assignment; a name may occur twice only with `often`."""
    pairs = list[tuple[str, str]]()
    for pair in texts or ():
        name, equals, value = pair.partition("=")
        if not equals:
            raise InputError(f"{option} {pair} has no equals sign: write {option} {example}.")
        if name in dict(pairs) and not often:
            raise InputError(f"{option} {name}=... is given twice; give it once.")
        pairs.append((name, value))
    return pairs


def text_options(assignments: Sequence[str] | None) -> TextOptions | None:
    """Layout of text logs by the assignments of ``--format``; None without any."""
    from swashplate.logs import TextOptions

    pairs: dict[str, Any] = dict(pairs_of("--format", assignments, "thousands=,"))
    if not pairs:
        return None
    known = [field.name for field in fields(TextOptions)]
    for key in pairs:
        if key not in known:
            raise InputError(f"--format has no '{key}': it is {', '.join(known)}.")
    row = pairs.get("header_row", "0")
    if not row.isdigit():
        raise InputError(f"--format header_row={row} must be the number of a line.")
    if "header_row" in pairs:
        pairs["header_row"] = int(row)
    return TextOptions(**pairs)


def changes_between(old_set: ParameterSet, new_set: ParameterSet) -> list[str]:
    """A line for each parameter that differs between two sets, with a warning if it should."""
    symbols = {parameter.symbol for parameter in old_set.values()}
    added = [parameter for parameter in new_set.values() if parameter.symbol not in symbols]
    lines = list[str]()
    for parameter in added:
        value = f"{_joined_values(parameter)} {unit_text(parameter.unit)}"
        lines.append(f"{parameter.symbol} ({parameter.name}): {value}".rstrip())
    is_load_added = any(parameter.symbol == LOAD for parameter in added)
    if is_load_added and not set(SENSITIVE_TO_LOAD) & set(new_set.refinements):
        lines.append(
            f"! {LOAD} changes nothing without {' or '.join(SENSITIVE_TO_LOAD)}: set one as well."
        )
    for old in old_set.values():
        new = new_set[old.symbol]
        if new.value == old.value:
            continue
        unit = unit_text(old.unit)
        change = f"{_joined_values(old)} -> {_joined_values(new)}"
        lines.append(f"{old.symbol} ({old.name}): {change} {unit}".rstrip())
        ratios = [b / a for a, b in zip(old.values, new.values, strict=False) if a and isfinite(a)]
        suspicious = [ratio for ratio in ratios if _is_suspicious(ratio)]
        if any(suspicious):
            in_unit = f" ({unit})" if unit else ""
            lines.append(
                f"! {old.symbol} changes by a factor of {max(suspicious):.3g}: check its "
                f"unit{in_unit}."
            )
    return lines


def _joined_values(parameter: Parameter) -> str:
    return "/".join(f"{value:g}" for value in parameter.values)


def _is_suspicious(ratio: float) -> bool:
    return isfinite(ratio) and not 1.0 / SUSPICIOUS_RATIO < abs(ratio) < SUSPICIOUS_RATIO
