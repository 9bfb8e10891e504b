"""Variables of an exported model: name, value reference, unit, range, meaning.

Everything that names a variable outside Python follows from this table: the model description of an
FMU, the C header that its library is compiled with, and what a page may call a slider. Parameters
come from their definitions, a drive's signals from its samples.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite
from typing import Any, Literal, NamedTuple

from swashplate.export.c_source import Exported
from swashplate.machine import Definition
from swashplate.machine.code_generation import c_literal
from swashplate.machine.fields import declared_by

Causality = Literal["input", "output", "parameter", "independent"]
Variability = Literal["continuous", "tunable", "fixed"]

NONE = 1e30
"""What stands for infinity, "no limit", if a number must be finite: the numbers that follow from
it are the same to the last bit."""


class References(NamedTuple):
    """Value references: the first of each kind. They never change."""

    INPUT: int
    OUTPUT: int
    PARAMETER: int
    STEP: int
    START_STEADY: int
    CLIP: int
    OPTION: int
    TIME: int


DRIVE = References(0, 10, 100, 300, 310, 311, 400, 1000)
"""Those of a drive; tests/export/value_references.csv is the stored list."""
OWN = References(0, 10_000, 20_000, 30_000, 30_001, 30_002, 40_000, 50_000)
"""Those of a user-defined model, which may have any number of each."""


class Description(NamedTuple):
    """What a signal or an option is."""

    meaning: str
    unit: str = "1"
    name: str = ""
    """Its name outside the model, if it has another there."""


DRIVE_OPTIONS: dict[str, Description] = {
    "literal": Description("literal sign of the card's Coulomb term", name="literal_coulomb_sign"),
    "split": Description("the card's limits take over within a step", name="split_card_switch"),
    "symmetric": Description(
        "root of the supply pressure less the signed pressure", name="symmetric_root"
    ),
}
"""Options of a drive that can be set before a run, by the model's names."""


LONGEST_LINE = 1020
"""Steps that the delay line of the libraries can hold."""


@dataclass(frozen=True)
class Variable:
    """A variable of an exported model, SI."""

    name: str
    reference: int
    """Value reference, by which an importer asks for it."""
    causality: Causality
    variability: Variability
    description: str
    unit: str = "1"
    """SI unit; ``"1"`` for none."""
    start: float | bool | None = None
    """Value at the start; None if it is computed."""
    lower: float | None = None
    upper: float | None = None
    feedthrough: frozenset[str] = frozenset()
    """Of an output: inputs that it depends on at the same instant."""


def descriptions_of(exported: Exported) -> dict[str, Description]:
    """Meaning and unit of the inputs and signals of a model, as far as its types declare them."""
    return {
        name: Description(definition.name, definition.unit or "1")
        for name, definition in exported.model.definitions.items()
    }


def _declared(kind: type) -> Iterator[tuple[Definition, str]]:
    """What a named tuple declares, by the path of each value."""
    for definition in declared_by(kind):
        yield from ((definition, path) for path in definition.fields)


def variables(
    exported: Exported,
    values: Sequence[float],
    feedthrough: Mapping[str, frozenset[str]],
    descriptions: Mapping[str, Description],
    references: References,
) -> tuple[Variable, ...]:
    """Every variable of a model: inputs, outputs, parameters, settings.

    `values` are those of the C ``init``: step, parameters, givens, options, constants;
    `feedthrough` has the inputs that each output depends on at the same instant, `words` meaning
    and unit of signals and options.
    """
    parameters = exported.named("parameters")
    starts = {name: min(values[1 + index], NONE) for index, (_, _, name) in enumerate(parameters)}
    defaults, ranges = defaults_of(exported), exported.ranges

    def signal(
        name: str, number: int, kind: Literal["input", "output"], **attributes: Any
    ) -> Variable:
        option_description = descriptions.get(name, Description(f"{kind} {name}"))
        return Variable(
            name,
            number,
            kind,
            "continuous",
            option_description.meaning,
            option_description.unit,
            **attributes,
        )

    listed = [
        signal(
            name,
            number,
            "input",
            start=starts[defaults[name]] if name in defaults else 0.0,
            lower=ranges.get(name, (None, None))[0],
            upper=ranges.get(name, (None, None))[1],
        )
        for number, name in enumerate((*exported.signals, *exported.measured), references.INPUT)
    ]
    listed += [
        signal(name, number, "output", feedthrough=feedthrough[name])
        for number, name in enumerate(exported.names, references.OUTPUT)
    ]
    signal_names = {entry.name for entry in listed}
    declared = {
        (index, path): entry
        for index, part in enumerate(exported.model.parts)
        for entry, path in _declared(part.parameters)
    }
    farthest = {(tap.part, tap.tap.delay): LONGEST_LINE for tap in exported.windows}
    farthest |= {(tap.part, tap.tap.longest): exported.reach(tap) for tap in exported.histories}
    for index, (part_number, path, name) in enumerate(parameters):
        if defaults.get(name) == name:  # an input of that name has its value
            continue
        unique_name = f"{name}_parameter" if name in signal_names else name
        definition = declared[part_number, path]
        variable = _parameter(
            unique_name, references.PARAMETER + index, definition, path, starts[name]
        )
        if (part_number, path) in farthest:
            most = farthest[part_number, path] * values[0]
            variable = replace(variable, upper=min(variable.upper or most, most))
        listed.append(variable)
    longest = exported.model.longest if isfinite(exported.model.longest) else None
    meaning = "step of the model's own grid, whatever the master's steps are"
    listed.append(
        Variable(
            "step", references.STEP, "parameter", "fixed", meaning, "s", values[0], 0.0, longest
        )
    )
    settings = []
    if exported.settles:
        meaning = "start settled under the first inputs, not at rest"
        settings.append(("start_steady", references.START_STEADY, meaning, False))
    if exported.bounds:
        bounds = ", ".join(f"{name} beyond ±{bound:g}" for name, bound in exported.bounds.items())
        settings.append(("clip", references.CLIP, f"clip a {bounds} instead of failing", True))
    first_option = 1 + len(parameters) + len(exported.named("given"))
    for index, (full, option) in enumerate(
        zip(exported.option_names, exported.settable, strict=True)
    ):
        option_description = descriptions.get(option[1], Description(f"option {option[1]}"))
        if option not in exported.any_step:
            on = values[first_option + exported.options.index(option)] != 0.0
            settings.append(
                (
                    (option_description.name or full) if full == option[1] else full,
                    references.OPTION + index,
                    option_description.meaning,
                    on,
                )
            )
    for name, reference, meaning, on in settings:
        listed.append(Variable(name, reference, "parameter", "fixed", meaning, start=on))
    return tuple(listed)


def defaults_of(exported: Exported) -> dict[str, str]:
    """Name of the parameter that counts while an input is not set, by the input's name."""
    named = {(part_index, path): name for part_index, path, name in exported.named("parameters")}
    return {
        part.tap(name).signal: named[part_index, path]
        for part_index, part in enumerate(exported.model.parts)
        for name, path in part.defaults.items()
        if part.tap(name).signal in exported.measured
    }


def _parameter(
    name: str, reference: int, definition: Definition, path: str, value: float
) -> Variable:
    """A parameter's value as a variable that may change while the model runs."""
    meaning = definition.name
    if definition.directional:
        meaning += f", {'plus' if path == definition.fields[0] else 'minus'} direction"
    lower = definition.lower if isfinite(definition.lower) else None
    upper = definition.upper if isfinite(definition.upper) else None
    if upper is None and definition.can_be_off:
        meaning += f"; {NONE:g} for none"
        upper = NONE
    unit = definition.unit or "1"
    return Variable(name, reference, "parameter", "tunable", meaning, unit, value, lower, upper)


def c_header(exported: Exported, layout: int, references: References) -> str:
    """Text of ``variables.h``: what FMI's and the page's C code have of the model and this table.

    `layout` is a hash of the model's C sources, 64 bits: whose numbers the library can read.
    """
    numbers = "\n".join(
        f"#define SWP_FMI_{kind} {reference}u" for kind, reference in references._asdict().items()
    )
    signals = exported.signals
    arguments = "".join(f", (u)[{index}]" for index in range(len(signals)))
    defaults = defaults_of(exported)
    constants = exported.constants["PARAMETER_"]
    defaulted = ", ".join(constants[defaults[name]] for name in exported.measured)
    names = ", ".join(f'"{name}"' for name in (*signals, *exported.measured))
    bounds = ", ".join(c_literal(exported.bounds.get(name, 0.0)) for name in signals)
    pairs = [exported.ranges.get(name, (-inf, inf)) for name in (*signals, *exported.measured)]
    ranges = ", ".join(f"{{{c_literal(low)}, {c_literal(high)}}}" for low, high in pairs)
    options = exported.constants["OPTION_"]
    free = " && ".join(
        f"swp_get_option(m, {options[full]})"
        for full, option in zip(exported.option_names, exported.settable, strict=True)
        if option in exported.any_step
    )
    return f"""\
/* Made by swashplate: the model, value references and what goes with them. */
#ifndef SWASHPLATE_VARIABLES_H
#define SWASHPLATE_VARIABLES_H

#include "{exported.file}.h"

typedef {exported.type} swp_model;

{numbers}
#define SWP_FMI_LAYOUT {layout:#018x}u /* hash of the model's sources */
#define SWP_FMI_SIGNALS {len(signals)} /* inputs of a step; the others follow them */
#define SWP_FMI_CALL(f, m, u) f(m{arguments})
#define SWP_FMI_SETTLES {int(exported.settles)}
#define SWP_FMI_FREE_STEP(m) {f"({free})" if " && " in free else free or "1"}
#define SWP_FMI_BOUNDS {{{bounds or "0.0"}}} /* largest magnitudes of inputs, 0 for none */
#define SWP_FMI_INPUT_RANGES {{{ranges or "{0.0, 0.0}"}}} /* of all inputs, lowest and highest */
#define SWP_FMI_INPUT_NAMES {{{names or "NULL"}}}
#define SWP_FMI_INPUT_DEFAULTS {{{defaulted or "-1"}}} /* parameters */

#endif
"""
