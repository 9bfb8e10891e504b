"""Variables of an exported drive: name, value reference, unit, range, meaning.

Everything that names a variable outside Python follows from this table: the model description of an
FMU, the C header that its library is compiled with, and what a page may call a slider. Parameters
come from their definitions, signals from the drive's samples.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Literal

from swashplate.equations.c_source import Exported
from swashplate.linear.model import UNITS
from swashplate.parameters.definitions import find
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.rules import FULL_VOLTAGE

Causality = Literal["input", "output", "parameter", "independent"]
Variability = Literal["continuous", "tunable", "fixed"]

NONE = 1e30
"""What stands for infinity, "no limit", where a number must be finite: the numbers that follow from
it are the same to the last bit."""
LONGEST_STEP = 1.0 / 512.0
"""Longest step of the model's own grid. [s]"""

# Value references. They never change: tests/export/value_references.csv is the stored list.
INPUT, OUTPUT, PARAMETER, STEP, START_STEADY, CLIP, OPTION, TIME = (
    0,
    10,
    100,
    300,
    310,
    311,
    400,
    1000,
)
DEFAULTS = {"pump_speed": "pump_speed", "load_torque": "load_torque", "supply_pressure": "Z9"}
"""Parameter that counts while an input beside the voltage is not set."""

_SIGNALS = {
    "voltage": "command of the card within ±10 V, positive towards positive speed",
    "pump_speed": "speed of the prime mover, relative to that of Z10",
    "load_torque": "static torque of the load at the shaft, positive against positive speed",
    "supply_pressure": "supply pressure less static pressure; until it is set, Z9 counts",
    "current_positive": "current of the solenoid towards positive speed, never negative",
    "current_negative": "current of the other solenoid, never negative",
    "current": "signed current, positive solenoid's less the negative one's",
    "solenoid_force": "net force of both solenoids on the spool",
    "spool_position": "displacement of the spool, within its stroke",
    "orifice_opening": "effective opening, what the orifices leave of the spool's displacement",
    "stroker_pressure": "stroking pressure about its equilibrium",
    "swash_angle": "angle of the swash plate",
    "shaft_speed": "speed of the shaft, of the turret for slew",
    "shaft_position": "integral of the speed, zero at the start",
    "motor_torque": "torque that the motor bears, positive where it drives to positive speed",
    "motor_pressure_drop": "pressure drop over the motor, 0 where motor_constant is not known",
}
_UNITS = {
    **UNITS,
    "current_positive": UNITS["current"],
    "current_negative": UNITS["current"],
    "shaft_position": "rad",
}
_OPTIONS = {
    "literal": ("literal_coulomb_sign", "literal sign of the card's Coulomb term"),
    "split": ("split_card_switch", "the card's limits take over within a step"),
    "symmetric": ("symmetric_root", "root of the supply pressure less the signed pressure"),
}
"""Options that can be set before a run, by the model's names; the others follow from parameters."""


@dataclass(frozen=True)
class Variable:
    """A variable of an exported drive, SI."""

    name: str
    reference: int
    """Value reference, by which an importer asks for it."""
    causality: Causality
    variability: Variability
    description: str
    unit: str = "1"
    """SI unit; ``"1"`` for none."""
    start: float | bool | None = None
    """Value at the start; None where it is computed."""
    lower: float | None = None
    upper: float | None = None
    feedthrough: frozenset[str] = frozenset()
    """Of an output: inputs that it depends on at the same instant."""


def finite(value: float) -> float:
    """A number with infinity as `NONE`."""
    return value if isfinite(value) else NONE


def variables(
    exported: Exported,
    parameters: ParameterSet,
    step: float,
    feedthrough: Mapping[str, Collection[str]],
) -> tuple[Variable, ...]:
    """Every variable of a drive, inputs first, then outputs, parameters and settings.

    Parameters
    ----------
    exported : Exported
        The drive as it is in C, whose order of inputs, outputs, options and parameters counts.
    parameters : ParameterSet
        The drive's, for the start values.
    step : float
        Step of the model's grid. [s]
    feedthrough : mapping
        By output, the inputs that it depends on at the same instant.
    """
    starts = {name: finite(parameters[name].values[0]) for name in ("Z9", "load_torque")}
    at_first = {"voltage": 0.0, "pump_speed": 1.0}
    at_first |= {name: starts[DEFAULTS[name]] for name in ("load_torque", "supply_pressure")}
    found = [
        Variable(
            name, INPUT + i, "input", "continuous", _SIGNALS[name], _UNITS[name], at_first[name]
        )
        for i, name in enumerate(("voltage", *exported.measured))
    ]
    for i, name in enumerate(exported.names):
        direct = frozenset(feedthrough.get(name, ()))
        found.append(
            Variable(
                name,
                OUTPUT + i,
                "output",
                "continuous",
                _SIGNALS[name],
                _UNITS[name],
                feedthrough=direct,
            )
        )
    numbers = parameters.numbers
    for i, (_, _, name) in enumerate(exported.named("parameters")):
        if name not in exported.measured:  # an input of that name has its value
            value = numbers[name] if name in numbers else parameters[name].values[0]
            found.append(_parameter(name, PARAMETER + i, value))
    words = "step of the model's own grid, whatever the master's steps are"
    found.append(
        Variable(
            "step", STEP, "parameter", "fixed", words, "s", step, lower=0.0, upper=LONGEST_STEP
        )
    )
    forms = {
        "literal": parameters.coulomb_sign == "literal",
        "split": parameters.card_switch == "split",
        "symmetric": parameters.pressure_root == "symmetric",
    }
    settings = [
        ("start_steady", START_STEADY, "start settled under the first voltage, not at rest", False),
        ("clip", CLIP, f"clip a voltage beyond ±{FULL_VOLTAGE:g} V instead of failing", True),
    ]
    settings += [
        (_OPTIONS[name][0], OPTION + i, _OPTIONS[name][1], forms[name])
        for i, name in enumerate(name for _, name in exported.settable)
        if name in _OPTIONS
    ]
    for name, reference, meaning, on in settings:
        found.append(Variable(name, reference, "parameter", "fixed", meaning, start=on))
    return tuple(found)


def _parameter(column: str, reference: int, value: float) -> Variable:
    """A parameter's value as a variable that may change while the drive runs."""
    definition = find(column)
    words = definition.name
    if column != definition.symbol:
        words += f", {column.rpartition('_')[2]} direction"
    lower = definition.lower if isfinite(definition.lower) else None
    upper = definition.upper if isfinite(definition.upper) else None
    if upper is None and definition.can_be_off:
        words += f"; {NONE:g} for none"
        upper = NONE
    return Variable(
        column,
        reference,
        "parameter",
        "tunable",
        words,
        definition.unit,
        finite(value),
        lower,
        upper,
    )


def c_header(exported: Exported, layout: int) -> str:
    """Text of ``fmi_variables.h``: what the FMU's C code has of this table.

    Parameters
    ----------
    exported : Exported
        The drive as it is in C.
    layout : int
        Hash of the drive's C sources, 64 bits: whose numbers the library can read.
    """
    names = ("OUTPUT", "PARAMETER", "STEP", "START_STEADY", "CLIP", "OPTION", "TIME")
    known = globals()
    references = "\n".join(f"#define SWP_FMI_{name} {known[name]}u" for name in names)
    defaults = ", ".join(f"SWP_PARAMETER_{DEFAULTS[name]}" for name in exported.measured)
    inputs = ", ".join(f'"{name}"' for name in exported.measured)
    return f"""\
/* Made by swashplate from its table of variables: value references and what goes with them. */
#ifndef SWASHPLATE_FMI_VARIABLES_H
#define SWASHPLATE_FMI_VARIABLES_H

{references}
#define SWP_FMI_FULL_VOLTAGE {FULL_VOLTAGE!r}
#define SWP_FMI_LONGEST_STEP {LONGEST_STEP!r}
#define SWP_FMI_LAYOUT {layout:#018x}u /* hash of the drive's sources */
#define SWP_FMI_INPUT_NAMES {{{inputs}}}
#define SWP_FMI_INPUT_DEFAULTS {{{defaults}}}

#endif
"""
