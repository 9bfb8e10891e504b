"""From a parameter set to a model with numbers: its options, and the limit of its filter."""

from __future__ import annotations

from cmath import log, sqrt
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError
from swashplate.machine import Machine, Model, Replacement
from swashplate.machine.marching import PartNumbers
from swashplate.machine.replacement import check_members, replaced_once, uses_equation
from swashplate.machine.rules import CheckedRule, MemberRules
from swashplate.models.amplifier import Card, CardChannel, CardOptions
from swashplate.models.displacement_control import Pump, PumpOptions, steep_stops
from swashplate.models.drive import Source as CurrentSource
from swashplate.models.drive import (
    drive,
    flowing_drive,
    flowing_pump_drive,
    pump_drive,
    settled_drive,
)
from swashplate.models.pump import searched_pressure, settled_pressure
from swashplate.parameters import SIDES, ParameterSet, check_rules

Array = NDArray[np.float64]

START = "start."
"""What the column of a number of the state at the first sample begins with, before its path."""
PRESSURE_PATH = "pump.pressure"
"""Path of δP. Its value at the first sample is the column ``start.pump.pressure``."""


class Models(NamedTuple):
    """The drive's models: driven by a voltage or a current, in samples or in time, and settled."""

    drive: Model
    pump_drive: Model
    flowing_drive: Model
    flowing_pump_drive: Model
    settled_drive: Model


@lru_cache(maxsize=64)
def models_of(equations: tuple[Replacement, ...]) -> Models:
    """The drive's models with user-defined equations in them."""
    models = Models(drive, pump_drive, flowing_drive, flowing_pump_drive, settled_drive)
    if any(uses_equation(pump_drive, replacement.old) for replacement in equations):
        # where the spool closes is known in closed form of the package's equations alone
        equations = (*equations, Replacement(settled_pressure, searched_pressure))
    for replacement in equations:
        changed = [
            replaced_once(model, replacement) if uses_equation(model, replacement.old) else model
            for model in models
        ]
        models = Models._make(changed)
    return models


def with_equation(parameters: ParameterSet, replacement: Replacement) -> ParameterSet:
    """The set with a user-defined equation; see `Drive.with_equation`."""
    members = replacement._asdict()
    check_members(members, {what: repr(member) for what, member in members.items()})
    equations = (*parameters.equations, replacement)
    models = models_of(parameters.equations)
    if not uses_equation(models.drive, replacement.old):
        raise InputError(
            f"{replacement.old.__name__} is not an equation of the drive: those are in "
            "swashplate.models.amplifier, swashplate.models.displacement_control, "
            "swashplate.models.pump and swashplate.models.refinements."
        )
    if replacement.parameters is not None and not uses_equation(models.pump_drive, replacement.old):
        raise InputError(
            f"{replacement.old.__name__} is an equation of the card: its replacement must "
            "take the same arguments; only replacements of the pump's equations can add "
            "parameters."
        )
    models_of(equations)  # refuses what does not fit
    changed = replace(parameters, equations=equations)
    if replacement.parameters is None:
        return changed
    defaults = replacement.parameters._field_defaults
    return changed.with_numbers(defaults, changed.options)


def card_of(parameters: ParameterSet) -> Card:
    """The card's numbers."""
    numbers = parameters.numbers
    plus, minus = (
        CardChannel(**{name: numbers[f"{name}_{side}"] for name in CardChannel._fields})
        for side in SIDES
    )
    return Card(plus, minus, numbers["tau"])


def pump_of(parameters: ParameterSet) -> Pump:
    """The pump's numbers; of the refinements those that are given."""
    kind: Any = models_of(parameters.equations).pump_drive.parts[1].parameters
    numbers = parameters.numbers
    pump: Pump = kind(**{name: numbers[name] for name in kind._fields if name in numbers})
    return pump


def card_options(parameters: ParameterSet) -> CardOptions:
    """Forms of the card."""
    return CardOptions(
        literal=True if parameters.coulomb_sign == "literal" else None,
        split=True if parameters.card_switch == "split" else None,
        exact=True if parameters.rate is None else None,
    )


def pump_options(parameters: ParameterSet) -> PumpOptions:
    """Forms of the pump."""
    on = set(parameters.options)
    if steep_stops(pump_of(parameters)):
        on.add("steep")
    if parameters.pressure_root == "symmetric":
        on.add("symmetric")
    return PumpOptions(**dict.fromkeys(on, True))


@lru_cache(maxsize=256)
def drive_instance(parameters: ParameterSet, *, by_voltage: bool) -> Machine:
    """A parameter set as a model with numbers.

    Parameters
    ----------
    parameters : ParameterSet
        The drive.
    by_voltage : bool
        Whether a voltage drives the card, or a signed current the pump alone.
    """
    pump = PartNumbers(pump_of(parameters), pump_options(parameters))
    if by_voltage:
        card = PartNumbers(card_of(parameters), card_options(parameters))
        model = models_of(parameters.equations).drive
    else:
        card = PartNumbers(CurrentSource())
        model = models_of(parameters.equations).pump_drive
    rules = MemberRules(DriveRules(parameters))
    return Machine.of_parts(model, (card, pump), parameters.name, (rules,))


@dataclass(frozen=True)
class DriveRules:
    """Rules of `swashplate.parameters` for numbers of a drive's machine."""

    parameters: ParameterSet
    """The drive: what the machine has no number of is as in this set."""

    def __call__(self, numbers: Mapping[str, Array]) -> Iterator[CheckedRule]:
        """The rules applied to (m,) values by path."""
        definitions = self.parameters.definitions
        count = next(iter(numbers.values())).size
        columns = {name: np.full(count, n) for name, n in self.parameters.numbers.items()}
        defaults = Pump._field_defaults
        for column, path in definitions.paths.items():
            given = column in columns or np.any(numbers.get(path) != defaults.get(column))
            if path in numbers and given:
                columns[column] = numbers[path]
        return check_rules(columns, definitions)


def without_ripple(instance: Machine) -> Machine:
    """The drive at the mean of a turn: the cam ring's ripple does not change it."""
    card, pump = instance.parts
    smooth = pump._replace(options=pump.options._replace(ripple=None))
    return Machine.of_parts(instance.model, (card, smooth), instance.name)


def at_every_rate(parameters: ParameterSet) -> ParameterSet:
    """The set with the filter's differential equation in place of the recursion for one rate.

    Both have the same poles, z = e^(sh) at the recursion's rate, and the same band C/ω² in which
    the Coulomb term holds the current. By that their delays are alike as well: 2ζ/ω of the
    equation, a sample less by the old ζ and ω of the recursion.

    Raises
    ------
    InputError
        If the recursion changes its sign from sample to sample, as no differential equation does.
    """
    if parameters.rate is None:
        return parameters
    changes: dict[str, float] = {}
    for side in SIDES:
        zeta, omega, C = (parameters.numbers[f"{name}_{side}"] for name in ("zeta", "omega", "C"))
        w = omega / parameters.rate
        middle = 1.0 - zeta * w
        half = w * sqrt(complex(zeta * zeta - 1.0))
        poles = middle + half, middle - half
        if any(pole.imag == 0.0 and pole.real <= 0.0 for pole in poles):
            raise InputError(
                f"{parameters.name}: the recursion of the {side} channel's filter (zeta = "
                f"{zeta:g}, omega = {omega:g} rad/s at {parameters.rate:g} Hz) swings from sample "
                "to sample, as no filter of another rate does; lower omega."
            )
        first, second = (parameters.rate * log(pole) for pole in poles)
        replacement = float(sqrt(first * second).real)
        changes[f"omega_{side}"] = replacement
        changes[f"zeta_{side}"] = -float((first + second).real) / (2.0 * replacement)
        changes[f"C_{side}"] = C * (replacement / omega) ** 2
    return replace(parameters.with_numbers(changes, parameters.options), rate=None)
