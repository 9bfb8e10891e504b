"""C source of a drive or a user-defined model, with its numbers, in a folder of its own."""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from swashplate.__about__ import __version__
from swashplate.drive import (
    Drive,
    Sample,
)
from swashplate.errors import FileError, InputError, InputTypeError
from swashplate.export.c_source import Exported, interface, numbers, rooms_of, writer_of
from swashplate.export.variable_list import (
    DRIVE,
    DRIVE_OPTIONS,
    OWN,
    Description,
    References,
    descriptions_of,
)
from swashplate.machine import Machine, Model
from swashplate.machine.code_generation import (
    c_comment,
    c_literal,
    c_name,
    comment_line,
    filled,
)
from swashplate.machine.fields import declared_by
from swashplate.machine.marching import SOURCE_RATE, check_rate
from swashplate.models.drive import drive as drive_model
from swashplate.parameters import ParameterSet
from swashplate.tables import write_text

Array = NDArray[np.float64]
LONGEST_STEP = 1.0 / SOURCE_RATE
LONGEST_IDENTIFIER = 63
"""Characters of a name that every C99 compiler looks at."""
FURTHER = ("main.c", "CMakeLists.txt", "README.md")
"""Files of a folder in addition to the model's own."""
OWN_LICENCE, THIRD_PARTY = "LICENSE.txt", "THIRD_PARTY.txt"
"""Texts of licences: binaries and sources must be passed on with them."""


def exported_drive(drive: Drive | None = None) -> Exported:
    """The drive as it is in C; with user-defined equations if the drive has some."""
    return _exported(drive_model if drive is None else drive.model)


@lru_cache(maxsize=8)
def _exported(model: Model) -> Exported:
    columns = {
        f"{model.prefix(part_index)}{path}": column
        for part_index, part in enumerate(model.parts)
        for definition in declared_by(part.parameters)
        for path, column in zip(definition.fields, definition.columns, strict=True)
    }
    return Exported(
        model,
        "swp",
        "A hydrostatic drive from joystick voltage to shaft speed.",
        parameters=columns,
        outputs=(*Sample._fields[1:], "motor_torque", "motor_pressure_drop"),
        notes={"voltage": "joystick voltage, positive towards positive speed [V]"},
    )


def drive_sources(drive: Drive | None = None) -> dict[str, str]:
    """Header and source of the drive, by file name: the same for every set of parameters."""
    return interface(exported_drive(drive))


def values_of(drive: Drive, step: float = LONGEST_STEP) -> Array:
    """All numbers that ``swp_init`` takes, as Python computed them.

    Parameters
    ----------
    drive : Drive
        Whose.
    step : float
        Step of its grid. [s]

    Returns
    -------
    (n,) array
        Step [s], parameters, options (0 or 1) and the constants that follow from them.

    Raises
    ------
    InputError
        If the card's filter is unstable at that step, or the step is none.
    """
    return content_of(drive, step).values


# --- what is exported -----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Content:
    """A drive, or a user-defined model, with its numbers, as it is exported."""

    exported: Exported
    machine: Machine
    values: Array
    """Numbers that its ``init`` takes."""
    packaged: bool
    """Whether the package's libraries have its equations."""
    references: References
    descriptions: Mapping[str, Description]
    """Meaning and unit of signals and options."""

    def __repr__(self) -> str:
        return f"Content({self.name!r}, {self.values.size} values)"

    @property
    def name(self) -> str:
        """Name of the machine."""
        return self.machine.name

    @property
    def shown(self) -> str:
        """The output that an example prints: the shaft's speed, or the last one."""
        names = self.exported.names
        return "shaft_speed" if "shaft_speed" in names else names[-1]

    @property
    def step(self) -> float:
        """Step of its grid. [s]"""
        return float(self.values[0])

    @property
    def identifier(self) -> str:
        """Its name as one of C's, of which C99 looks at 63 characters."""
        name = re.sub(r"\W", "_", self.name, flags=re.ASCII).strip("_").lower() or "model"
        return (f"_{name}" if name[0].isdigit() else name)[:LONGEST_IDENTIFIER]


def content_of(what: Drive | Machine, step: float, *, prefix: str = "swp") -> Content:
    """What is exported of a drive, or of a machine.

    Functions of the latter begin with `prefix`. A drive's recursion for another rate becomes its
    equation, with a warning.

    Raises
    ------
    InputError
        If the step is none, the filter of a drive is unstable at it, or numbers are none.
    """
    check_rate(step, "step", "s")
    if not isinstance(what, Machine):
        raise InputTypeError(
            f"{what!r} cannot be exported: give a Drive or a Machine{_nearest(what)}."
        )
    longest = what.model.longest
    if not step <= longest:
        raise InputError(
            f"The step is {step:g} s, but must be above 0 and at most 1/{1.0 / longest:g} s: an "
            f"FMU's master may use longer steps; in C, step several times per sample."
        )
    machine = what.at_step(step)
    if machine is not what:
        warnings.warn(
            f"{what.name}: the card's filter is a recursion for another rate; for a step of "
            f"{step:g} s the differential equation with the same poles is used instead.",
            stacklevel=3,
        )
    machine.check_step(step)
    for part in machine.model.parts:
        for name in part.defaults:
            if part.tap(name).longest and part.tap(name).signal in machine.model.external:
                raise InputError(
                    f"{machine.name}: {part.path} looks back at '{part.tap(name).signal}', for "
                    "which a parameter stands. This is not exported: leave out the default."
                )
    if isinstance(machine, Drive):  # its names and value references never change
        exported = exported_drive(machine)
        references, descriptions = DRIVE, DRIVE_OPTIONS | descriptions_of(exported)
    else:
        exported = Exported(machine.model, prefix, reaches=rooms_of(machine, step))
        references, descriptions = OWN, descriptions_of(exported)
    return Content(
        exported=exported,
        machine=machine,
        values=numbers(exported, machine, step),
        packaged=machine.model is drive_model,
        references=references,
        descriptions=descriptions,
    )


def _nearest(what: object) -> str:
    """How to get a drive from something else, as a clause after what must be given."""
    if isinstance(what, ParameterSet):
        return ": Drive(parameters)"
    if isinstance(what, str | Path):
        return ": Drive.preset(NAME) or Drive.from_toml(PATH)"
    if isinstance(what, Model):
        return ": Machine(model, parameters)"
    if hasattr(type(what), "drive"):  # an Identification, which stands above this package
        return ": its drive, as in export.fmu(identification.drive, PATH)"
    return ""


def source_text(name: str) -> str:
    """A text of the package's folder ``sources``."""
    return (files("swashplate.export") / "sources" / name).read_text("utf-8")


def licence_texts() -> dict[str, str]:
    """The package's licence and those of what is linked into its libraries, by a file's name.

    Texts of the package, the same as those at the repository's root.
    """
    folder = files("swashplate.export") / "licenses"
    return {name: (folder / name).read_text("utf-8") for name in (OWN_LICENCE, THIRD_PARTY)}


# --- a folder -------------------------------------------------------------------------------------


def c(what: Drive | Machine, folder: str | Path, step: float = LONGEST_STEP) -> list[Path]:
    """Write C source of a drive, or of a machine, with its numbers.

    Parameters
    ----------
    what : Drive or Machine
        What is exported.
    folder : path
        Where to; made if it is not there. Files of these names are overwritten.
    step : float
        Step of its grid; of a drive at most 1/512. [s]

    Returns
    -------
    list of Path
        Header, source, values, an example, ``CMakeLists.txt``, ``README.md`` and
        ``LICENSE.txt``.

    Raises
    ------
    EquationError
        If an equation has no counterpart in C; the sentence has file, line and name.
    InputError
        If the step is none, or the filter of the drive is unstable at it.
    FileError
        If the folder cannot be written.

    Warns
    -----
    UserWarning
        Where the recursion of the card's filter was converted to another step.

    Examples
    --------
    >>> from swashplate import Drive, export
    >>> sorted(path.name for path in export.c(Drive.preset("hoist"), "source"))[3:]
    ['hoist_values.h', 'main.c', 'swashplate_drive.c', 'swashplate_drive.h']
    """
    content = content_of(what, step, prefix=c_name(getattr(what, "name", "model")))
    exported, values, name = content.exported, content.values, content.identifier
    texts = interface(exported)
    placeholders = {
        "file": exported.file,
        "name": name,
        "type": exported.type,
        "p": exported.prefix,
        "P": exported.prefix.upper(),
        "output": exported.constants[""][content.shown],
        "commands": "".join(", 9.0" if s == "voltage" else ", 1.0" for s in exported.signals),
        "step": c_literal(step),
        "version": __version__,
    }
    texts[f"{name}_values.h"] = _initialiser(exported, values, name, content.machine.title)
    for file in FURTHER:
        texts[file] = filled(source_text(f"folder/{file}"), placeholders)
    # source alone: nothing of others is linked into it
    texts[OWN_LICENCE] = licence_texts()[OWN_LICENCE]
    to = Path(folder)
    try:
        to.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"The folder {to} cannot be created ({error.strerror}).") from None
    for file, text in texts.items():
        write_text(text, to / file)
    return [to / file for file in texts]


def _initialiser(exported: Exported, values: Array, name: str, title: str) -> str:
    """Values as an array of C, each with its name."""
    writer = writer_of(exported)
    units = {name: definition.unit for name, _, definition in writer.ranges()}
    names = ["step [s]"]
    for value_name, _ in writer.values():
        unit = units.get(value_name)
        names.append(f"{value_name} [{unit}]" if unit else value_name)
    texts = [
        f"    {c_literal(number)}, /* {comment_line(what)} */"
        for number, what in zip(values.tolist(), [*names, *writer.constant_names()], strict=True)
    ]
    if len(texts) > len(names):
        follows = (
            "    /* The rest follows from those above: do not edit these numbers, call set. */"
        )
        texts.insert(len(names), follows)
    guard = f"{name.upper()}_VALUES_H"
    head = f"Values of {name} for {exported.prefix}_init, computed by swashplate {__version__}."
    lines = [
        *c_comment(f"{head} {title}." if title else head),
        f"#ifndef {guard}",
        f"#define {guard}",
        "",
        "#include <math.h>",
        "",
        f"static const double {name}_values[{len(values)}] = {{",
        *texts,
    ]
    return "\n".join([*lines, "};", "", "#endif", ""])
