"""From the words of a command line to drives, values and campaigns."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from swashplate.documents import parse_toml, read_text
from swashplate.errors import FileError, InputError, MissingFileError, UnknownParameterError
from swashplate.units import unit_text

if TYPE_CHECKING:
    from swashplate.analysis import FactorRange
    from swashplate.campaign import Campaign, Experiment
    from swashplate.drive import Drive
    from swashplate.identification import FitSetup, ModelSetup
    from swashplate.parameters import Change, ParameterSet

_NUMBER = r"[+-]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|inf\b|nan\b)"
_VALUE = re.compile(rf"\s*({_NUMBER})(?:/({_NUMBER}))?\s*((?:1/)?[^\W\d_].*|°.*)?")
SETUP_FILE, NUMBERS = "setup.toml", "parameters.toml"
"""In a folder that a fit wrote: its fit setup, or the numbers of a user-defined model."""
UNFELT, FEELING = "load_torque", ("motor_leakage", "motor_constant")
"""A load, and what makes the speed depend on it."""
SURPRISING = 1000.0
"""Factor from which a value that is set is questioned."""

# --- files and what they are ----------------------------------------------------------------------

KIND_NAMES = {
    "log": "a log",
    "campaign": "a campaign",
    "drive": "a drive",
    "setup": "a fit setup",
}
_MARKS = {"runs": "campaign", "stages": "setup", "control_card": "drive", "pump_motor": "drive"}
_INSTEAD = {
    ("log", "campaign"): "make a campaign of it with 'swashplate campaign init {}'",
    ("log", "drive"): "a drive is a packaged name, a parameter file or the folder of a fit",
    ("drive", "campaign"): "name the campaign first, and the initial drive with --from",
    ("setup", "campaign"): "name the campaign first, and this file with --setup",
    ("campaign", "drive"): "name a drive here, and the campaign in place of CAMPAIGN.toml",
    ("setup", "drive"): "name a drive here, and this file with --setup",
}


def file_kind(path: Path) -> str:
    """Kind of a file: ``"log"``, ``"campaign"``, ``"drive"``, ``"setup"``, or empty."""
    from swashplate.logs import SUFFIXES

    if path.name.lower().endswith((*SUFFIXES, ".xlsx", ".xls")):
        return "log"
    try:
        tables = parse_toml(read_text(path), str(path))
    except FileError:
        return ""
    return next((kind for mark, kind in _MARKS.items() if mark in tables), "")


def check_file_kind(path: Path, expected: str) -> None:
    """Refuse a file that is plainly of another kind than expected; say where such a file goes."""
    kind = file_kind(path)
    instead = _INSTEAD.get((kind, expected))
    if path.is_file() and instead is not None:
        raise InputError(
            f"{path} is {KIND_NAMES[kind]}, not {KIND_NAMES[expected]}: {instead.format(path)}."
        )


def title_of(campaign: Campaign) -> str:
    """Title of a campaign, marked if its tests are virtual."""
    return f"{campaign.title} (virtual)" if campaign.virtual else campaign.title


def campaign_of(path: Path, axis: str | None = None) -> tuple[Campaign, str]:
    """A campaign, and its axis of a name or its only one."""
    from swashplate.campaign import Campaign

    if not path.exists():
        raise MissingFileError(
            f"There is no file {path}: name a campaign, or make one of your logs with 'swashplate "
            "campaign init LOGS'."
        )
    check_file_kind(path, "campaign")
    campaign = Campaign.from_toml(path)
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

    file = set_file(word)
    if file is not None:
        check_file_kind(file, "drive")
    return file


def parameters_of(word: str) -> ParameterSet:
    """The packaged set of a name, the set in a TOML file, or the one that a fit's folder holds."""
    from swashplate.parameters import load_preset, load_set

    file = drive_file(word)
    return load_preset(word) if file is None else load_set(file)


def model_parameters_of(folder: str, file: Path, runs: Sequence[Experiment]) -> ModelSetup:
    """A user-defined model with the numbers that a fit wrote into its folder."""
    from swashplate.equations import is_real
    from swashplate.identification import ModelSetup

    setup = ModelSetup.from_file(file)
    numbers_file = Path(folder) / NUMBERS if Path(folder).is_dir() else Path(folder)
    table = parse_toml(read_text(numbers_file), str(numbers_file)).get(setup.name)
    nominal = setup.nominal(runs)
    if not isinstance(table, dict) or table.keys() != nominal.numbers.keys():
        raise InputError(
            f"{numbers_file} has no table [{setup.name}] with {', '.join(nominal.numbers)}: give "
            f"the folder that 'swashplate fit --model {file}' wrote."
        )
    for name, value in table.items():
        if isinstance(value, bool) or not is_real(value):
            raise InputError(
                f"{numbers_file}: {name} under [{setup.name}] is {value!r:.60}, which is not a "
                "number."
            )
    return replace(nominal, numbers={name: float(value) for name, value in table.items()})


# --- changes and design variables -----------------------------------------------------------------


def assignments_of(
    option: str,
    words: Iterable[str],
    example: str,
    definition_of: Callable[[str], Any],
    counts: Collection[int] = (1, 2),
    *,
    units: bool = False,
) -> dict[str, Any]:
    """Parse words such as ``Z16=1.2e-4/1.5e-4`` or ``Z16=0.12mm`` by name, each given once.

    `definition_of` gives a name's definition or raises, `counts` are how many numbers it may have;
    `units` may follow them, which are then turned into SI.
    """
    from swashplate.units import to_si

    values: dict[str, Any] = {}
    for word in words:
        name, _, value = (part.strip() for part in word.partition("="))
        match = _VALUE.fullmatch(value)
        definition = None
        numbers = list[float]()
        unit = ""
        if match is not None:
            definition = definition_of(name)
            unit = (match[3] or "").strip()
            numbers = [float(number) for number in match.group(1, 2) if number]
        if len(numbers) not in counts or (unit and not units):
            raise InputError(f"{option} cannot read '{word}'; write it as {example}.")
        if name in values:
            raise InputError(f"{option} gives {name} twice; give it once.")
        if unit and definition is not None:
            what = f"{name} ({definition.name})"
            numbers = [to_si(number, unit, definition.unit, what) for number in numbers]
        values[name] = numbers[0] if len(numbers) == 1 else (numbers[0], numbers[1])
    return values


def drive_of(word: str, values: Sequence[str] = (), factors: Sequence[str] = ()) -> Drive:
    """The drive of a name or file, with values set and then scaled."""
    from swashplate.drive import Drive

    drive = Drive(parameters_of(word))
    definitions = drive.parameters.definitions

    def settable(name: str) -> Any:
        if _is_design_variable(name):
            words = f"{name} is a design variable, which has no value: write --scale {name}=1.5."
            raise InputError(words)
        return definitions.find(name)

    set_as = "Z16=1.2e-4, Z16=1.2e-4/1.5e-4 (plus/minus) or Z16_plus=0.12mm"
    scaled_as = "Z16=1.5, Z16=1.5/1.2 (plus/minus) or orifice=1.5"
    scaled_variables = [
        word for word in factors if _is_design_variable(word.partition("=")[0].strip())
    ]
    scaling = [word for word in factors if word not in scaled_variables]

    def scalable(name: str) -> Any:
        try:
            return definitions.find(name)
        except UnknownParameterError:
            from swashplate.analysis import powers_of

            return powers_of(name)  # refuses it, and lists design variables as well

    changes = assignments_of("--set", values, set_as, settable, units=True)
    variable_factors = assignments_of("--scale", scaled_variables, scaled_as, str, (1,))
    drive = drive.replace(**changes)
    drive = drive.scale(**assignments_of("--scale", scaling, scaled_as, scalable))
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


def physical_values(words: Sequence[str]) -> dict[str, Change]:
    """Physical values in SI from words such as ``oil_volume=100cm^3``."""
    from swashplate.full_order import chosen_quantity

    example = "oil_volume=1e-4 or oil_volume=100cm^3"
    return assignments_of("--physical", words, example, chosen_quantity, units=True)


def factors_of(words: Sequence[str]) -> dict[str, float]:
    """Factors by design variable or parameter from words such as ``orifice=1.5``."""
    from swashplate.analysis import powers_of

    return assignments_of("--scale", words, "orifice=1.5", powers_of, (1,))


def factor_ranges_of(words: Sequence[str], usual: FactorRange) -> dict[str, FactorRange]:
    """Ranges of factors by design variable from words such as ``pump`` or ``pump=0.8/1.5``."""
    from swashplate.analysis import powers_of

    completed = [word if "=" in word else f"{word}={usual[0]}/{usual[1]}" for word in words]
    return assignments_of("--variable", completed, "pump or pump=0.8/1.5", powers_of, (2,))


def pairs_of(
    option: str, texts: Sequence[str] | None, example: str, *, often: bool = False
) -> list[tuple[str, str]]:
    """The text before and after each equals sign; the first is given once, or often."""
    pairs = list[tuple[str, str]]()
    for pair in texts or ():
        name, equals, value = pair.partition("=")
        if not equals:
            raise InputError(f"{option} {pair} has no equals sign: write {option} {example}.")
        if name in dict(pairs) and not often:
            raise InputError(f"{option} {name}=... is given twice; give it once.")
        pairs.append((name, value))
    return pairs


def changes_between(before: ParameterSet, after: ParameterSet) -> list[str]:
    """A line for each parameter of two sets that differs, with a question if it surprises."""
    symbols = {parameter.symbol for parameter in before.values()}
    added = [parameter for parameter in after.values() if parameter.symbol not in symbols]
    lines = [
        f"{parameter.symbol} ({parameter.name}): {'/'.join(f'{v:g}' for v in parameter.values)} "
        f"{unit_text(parameter.unit)}".rstrip()
        for parameter in added
    ]
    is_load_added = any(parameter.symbol == UNFELT for parameter in added)
    if is_load_added and not set(FEELING) & set(after.refinements):
        lines.append(f"! {UNFELT} changes nothing without {' or '.join(FEELING)}: set one as well.")
    for old in before.values():
        new = after[old.symbol]
        if new.value == old.value:
            continue
        words = ("/".join(f"{v:g}" for v in parameter.values) for parameter in (old, new))
        unit = unit_text(old.unit)
        lines.append(f"{old.symbol} ({old.name}): {' -> '.join(words)} {unit}".rstrip())
        ratios = [b / a for a, b in zip(old.values, new.values, strict=False) if a and isfinite(a)]
        far = [r for r in ratios if isfinite(r) and not 1.0 / SURPRISING < abs(r) < SURPRISING]
        if any(far):
            in_unit = f" ({unit})" if unit else ""
            lines.append(
                f"! {old.symbol} changes by a factor of {max(far):.3g}: check its unit{in_unit}."
            )
    return lines
