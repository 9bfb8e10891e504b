"""C source of a drive or a model of one's own, with its numbers, in a folder of its own."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swashplate.drive import Drive
from swashplate.equations.c_source import Exported, c_name, interface, literal
from swashplate.equations.c_source.model import Writer
from swashplate.equations.fields import numbers_of
from swashplate.equations.marching.record import SOURCE_RATE
from swashplate.equations.marching.run import Instance, called
from swashplate.equations.marching.use import instance_of as instance_of_model
from swashplate.equations.model import Model
from swashplate.errors import FileError, InputError
from swashplate.export.variables import DRIVE, DRIVE_WORDS, OWN, References, Words, words_of
from swashplate.models.card import stable_step
from swashplate.models.displacement_control import steep_stops
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.simulation.instance import (
    PATHS,
    check_filter_stability,
    instance_of,
    models_of,
)
from swashplate.simulation.stepper import Sample
from swashplate.tables import write_text

Array = NDArray[np.float64]
LONGEST_STEP = 1.0 / SOURCE_RATE


def exported_drive(drive: Drive | None = None) -> Exported:
    """The drive as it is in C; with equations of one's own if the drive has some."""
    equations = () if drive is None else drive.parameters.equations
    model = models_of(equations).drive
    columns = {path: column for column, path in PATHS.items()}
    return Exported(
        model,
        "swp",
        "A hydrostatic drive from joystick voltage to shaft speed.",
        parameters=columns,
        outputs=(*Sample._fields[1:], "motor_torque", "motor_pressure_drop"),
        bounds={"voltage": FULL_VOLTAGE},
        stable={0: stable_step},
        follows={(1, "steep"): steep_stops},
        internal=frozenset({"own"}),
        longest=LONGEST_STEP,
        free_step="exact",
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


def _values(instance: Instance, step: float) -> Array:
    options, constants = list[float](), list[float]()
    for model, part in zip(instance.model.parts, instance.parts, strict=True):
        if model.options is not None:
            options += [0.0 if each is None else 1.0 for each in part.options]
        if model.constants is not None:
            known = {"p": part.p, "options": part.options, "given": part.given, "h": step}
            constants += numbers_of(called(model.constants, known))
    return np.array([step, *instance.params, *instance.given, *options, *constants])


# --- what is exported -----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Content:
    """A drive, or a model of one's own, with its numbers, as it is exported."""

    exported: Exported
    instance: Instance
    values: Array
    """Numbers that its ``init`` takes."""
    name: str
    title: str
    packaged: bool
    """Whether the package's libraries have its equations."""
    references: References
    words: Mapping[str, Words]
    """Meaning and unit of signals and options."""

    def __repr__(self) -> str:
        return f"Content({self.name!r}, {self.values.size} values)"

    @property
    def step(self) -> float:
        """Step of its grid. [s]"""
        return float(self.values[0])

    @property
    def identifier(self) -> str:
        """Its name as one of C's."""
        made = re.sub(r"\W", "_", self.name, flags=re.ASCII).strip("_").lower() or "model"
        return f"_{made}" if made[0].isdigit() else made


def content_of(
    what: Drive | Model,
    step: float,
    *,
    parameters: Any = None,
    options: Any = None,
    given: Any = None,
    prefix: str = "swp",
) -> Content:
    """What is exported of a drive, or of a model of one's own with its numbers.

    Functions of the latter begin with `prefix`; the other arguments are those of `c`.

    Raises
    ------
    InputError
        If the step is none, the filter of a drive is unstable at it, or numbers are none.
    """
    if isinstance(what, Drive):
        if not 0.0 < step <= LONGEST_STEP:
            raise InputError(
                f"The step is {step:g} s, but must be above 0 and at most 1/{SOURCE_RATE:g} s; "
                "the steps of an FMU's master may be longer."
            )
        check_filter_stability(what.parameters, step)
        exported, instance = exported_drive(what), instance_of(what.parameters, True)
        name, title, references, words = what.name, what.parameters.title, DRIVE, DRIVE_WORDS
    else:
        if not step > 0.0:
            raise InputError(f"The step is {step:g} s, but must be above 0.")
        instance = instance_of_model(what, parameters, options=options, given=given)
        exported, name, title = Exported(what, prefix), what.name, f"Model {what.name}"
        references, words = OWN, words_of(exported)
    values = _values(instance, step)
    packaged = isinstance(what, Drive) and not what.parameters.equations
    return Content(exported, instance, values, name, title, packaged, references, words)


# --- a folder -------------------------------------------------------------------------------------


def c(
    what: Drive | Model,
    folder: str | Path,
    step: float = LONGEST_STEP,
    *,
    parameters: Any = None,
    options: Any = None,
    given: Any = None,
) -> list[Path]:
    """Write C source of a drive, or of a model of one's own, with its numbers.

    Parameters
    ----------
    what : Drive or Model
        What is exported.
    folder : path
        Where to; made if it is not there. Files of these names are overwritten.
    step : float
        Step of its grid; of a drive at most 1/512. [s]
    parameters, options, given : named tuple
        Numbers of a model of one's own, as `swashplate.equations.simulate` takes them.

    Returns
    -------
    list of Path
        Header, source, values, an example, ``CMakeLists.txt`` and ``README.md``.

    Raises
    ------
    EquationError
        If an equation has no counterpart in C; the sentence has file, line and name.
    InputError
        If the step is none, or the filter of the drive is unstable at it.
    FileError
        If the folder cannot be written.
    """
    own = "swp" if isinstance(what, Drive) else c_name(what.name)
    content = content_of(
        what, step, parameters=parameters, options=options, given=given, prefix=own
    )
    exported, values, name = content.exported, content.values, content.identifier
    texts = interface(exported)
    words = {
        "file": exported.file,
        "name": name,
        "type": exported.type,
        "p": exported.prefix,
        "P": exported.prefix.upper(),
        "output": exported.names[-1 if not isinstance(what, Drive) else _SPEED],
        "commands": "".join(", 9.0" if s == "voltage" else ", 1.0" for s in exported.signals),
        "step": literal(step),
    }
    title = what.parameters.title if isinstance(what, Drive) else ""
    texts[f"{name}_values.h"] = _initialiser(exported, values, name, title)
    for file, text in FILES.items():
        for key, value in words.items():
            text = text.replace(f"@{key}@", value)
        texts[file] = text
    to = Path(folder)
    try:
        to.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"The folder {to} cannot be made ({error.strerror}).") from None
    for file, text in texts.items():
        write_text(text, to / file)
    return [to / file for file in texts]


_SPEED = Sample._fields[1:].index("shaft_speed")


def _initialiser(exported: Exported, values: Array, name: str, title: str) -> str:
    """Values as an array of C, each with its name."""
    names = ["step [s]", *(each for each, _ in Writer(exported).values())]
    guard = f"{name.upper()}_VALUES_H"
    head = f"Values of {name} for {exported.prefix}_init, as swashplate computed them."
    head = f"{head} {title}".strip().replace("*/", "* /")
    lines = [f"/* {head} */",
             f"#ifndef {guard}", f"#define {guard}", "", "#include <math.h>", "",
             f"static const double {name}_values[{len(values)}] = {{"]  # fmt: skip
    for value, what in zip(values.tolist(), names, strict=True):
        lines.append(f"    {literal(value)}, /* {what} */")
    return "\n".join([*lines, "};", "", "#endif", ""])


FILES: Mapping[str, str] = {
    "main.c": """\
/* An example: two seconds of a constant command, a line for every tenth of a second. */
#include "@file@.h"
#include "@name@_values.h"

#include <stdio.h>

static @type@ model; /* some kilobytes: better not on a small stack */

int main(void)
{
    int status = @p@_init(&model, @name@_values, sizeof @name@_values / sizeof @name@_values[0]);
    const long samples = (long)(2.0 / @p@_get_step(&model));
    const long every = samples >= 20 ? samples / 20 : 1;
    for (long n = 0; n <= samples && status == @P@_OK; n++) {
        status = @p@_step(&model@commands@);
        if (n % every == 0) {
            printf("%8.4f %.9g\\n", (double)n * @p@_get_step(&model),
                @p@_output(&model, @P@_@output@));
        }
    }
    if (status != @P@_OK) {
        fprintf(stderr, "%s\\n", @p@_sentence(status));
    }
    return status;
}
""",
    "CMakeLists.txt": """\
cmake_minimum_required(VERSION 3.10)
project(@name@ C)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()

add_library(@file@ STATIC @file@.c)
set_target_properties(@file@ PROPERTIES C_STANDARD 99 C_EXTENSIONS OFF)
target_include_directories(@file@ PUBLIC ${CMAKE_CURRENT_SOURCE_DIR})
if(MSVC)
  target_compile_options(@file@ PRIVATE /fp:precise)
else()
  target_compile_options(@file@ PRIVATE -ffp-contract=off)
  target_link_libraries(@file@ PUBLIC m)
endif()

add_executable(example main.c)
target_link_libraries(example @file@)
""",
    "README.md": """\
# @name@ in C

C99 from the equations of swashplate: `@file@.h` has the interface and `@file@.c` the equations, one
function for each; `@name@_values.h` has the values of @name@ at a step of @step@ s; `main.c` is an
example.

    cmake -B build && cmake --build build && build/example

or, without CMake,

    cc -std=c99 -O3 -ffp-contract=off main.c @file@.c -lm -o example

Keep `-ffp-contract=off` (gcc and clang) or `/fp:precise` (MSVC): fused operations change the last
digits. `-D@P@_LINE=64` shortens the delay line, and with it the
state. There is no allocation, no global variable and no input or output: a copy of the struct is a
copy of the state.
""",
}
"""Further files of a folder, with names in place of ``@name@``."""
