"""Validity rules of parameter sets, for single values and for values together.

A rule is a condition with a sentence for a set that breaks it. The rules work on arrays with one
element for each parameter set, so that a thousand sets are checked at once by the same lines as a
single one.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from math import isfinite
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import ParameterError
from swashplate.machine import Derived, derive, equation
from swashplate.machine.rules import CheckedRule
from swashplate.models.amplifier import CardChannel, channel_level
from swashplate.models.displacement_control import (
    Pump,
    moment_sine,
    solenoid_force,
)
from swashplate.parameters.definitions import (
    DEFINITIONS,
    OPTIONS,
    SWITCHES,
    Definition,
    Definitions,
)

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Values = dict[str, Any]
"""Values by column and derived values by name, as arrays with an element for each set; or texts."""


class ParameterRule(NamedTuple):
    """A rule for values of parameter sets."""

    is_broken: Callable[[Values], Mask]
    """Which sets break it."""
    sentence: str
    """For a set that breaks it; the names in braces are those of the values."""


FULL_VOLTAGE = 10.0  # Largest command, either way. [V]
SIDES = ("plus", "minus")  # Endings of values for the two directions.
VOLTAGES = np.linspace(0.0, FULL_VOLTAGE, 101)
"""Commands at which the static rules are checked. [V]"""
AT_ONCE = 50
"""Sets that are checked at once: what is computed of more leaves the processor's cache."""

REFINEMENT_RULES: tuple[ParameterRule, ...] = (
    ParameterRule(
        lambda n: (
            (n["spool_friction"] > 0.0)
            & np.isfinite(n["dither_time"])
            & (n["spool_presliding"] == 0.0)
        ),
        "dither_time is {dither_time:g} s, but spool_presliding is 0: dither acts on the small "
        "travel that friction permits; give that travel, of the order of 5e-5 m.",
    ),
    ParameterRule(
        lambda n: (n["line_stiffness"] > 0.0) & (n["load_inertia"] == 0.0),
        "line_stiffness is {line_stiffness:g} N m/rad, but load_inertia is 0: give the inertia "
        "that the line has to turn, in kg m^2 at the shaft.",
    ),
    ParameterRule(
        lambda n: n["ripple_depth"] >= 1.0,
        "cam_ripple + cam_ripple_per_torque·|load_torque| is {ripple_depth:.4g}, but must be below "
        "1: a motor whose displacement vanishes somewhere would run away.",
    ),
)
RULE_AT_REST = ParameterRule(
    lambda n: np.abs(n["rest"]) >= n["ceiling"],
    "the pressure at rest Z2/Z1 is {rest:g} Pa, but must stay below {ceiling:g} Pa, the smaller of "
    "Z9 and Z15.",
)
SIDE_RULES: tuple[ParameterRule, ...] = (
    ParameterRule(
        lambda n: n["arm_sine"] >= 1.0,
        "Z3·tan Z13_{side} is {arm_sine:.4g}, but must be below 1: at its stop of {Z13:g} rad the "
        "swash plate would turn the feedback arm past 90°.",
    ),
    ParameterRule(
        lambda n: n["lowest"] < 0.0,
        f"the steady current of the {{side}} channel falls to {{lowest:.3g}} A within "
        f"{FULL_VOLTAGE:g} V, but a current is a magnitude; check G1_{{side}}, G2_{{side}} and "
        "G3_{side}.",
    ),
    ParameterRule(
        lambda n: ~(n["moment_sine"] < 1.0),
        f"Z5·F/√Z4 reaches {{moment_sine:.4g}} within {FULL_VOLTAGE:g} V ({{side}}), but must be "
        "below 1: the solenoid would overpower the feedback spring; check Z19 to Z22, Z4 and Z5.",
    ),
)


def check_options(owner: str, options: frozenset[str], numbers: Mapping[str, float]) -> None:
    """Check that each option that is on has a parameter other than 0.

    Raises
    ------
    ParameterError
        For an unknown option, or one whose parameters are all 0 if that has no meaning.
    """
    for option in sorted(options):
        if option not in OPTIONS:
            raise ParameterError(
                f"{owner}: there is no option '{option}'; there are {', '.join(OPTIONS)}."
            )
        switched = [DEFINITIONS.find(name) for name, switch in SWITCHES.items() if switch == option]
        sized = [definition for definition in switched if definition.least is not None]
        if sized and all(numbers.get(definition.symbol, 0.0) == 0.0 for definition in sized):
            symbols = " and ".join(definition.symbol for definition in sized)
            raise ParameterError(
                f"{owner}: {option} is on, but {symbols} "
                f"{'are' if len(sized) > 1 else 'is'} 0; give at least {sized[0].least:g} "
                f"{sized[0].unit}, or take {option} out of the options."
            )


def check_rules(
    numbers: Mapping[str, Array], definitions: Definitions = DEFINITIONS
) -> Iterator[CheckedRule]:
    """Apply every rule to many sets, those about single values first.

    Parameters
    ----------
    numbers : mapping of (m,) arrays
        Every value by column, with an element for each set.
    definitions : Definitions
        Of the sets' parameters.
    """
    for column, column_values in numbers.items():
        yield check_range(definitions.find(column), column, column_values)
    values: Values = dict(numbers)
    values["rest"] = values["Z2"] / values["Z1"]
    values["ceiling"] = np.minimum(values["Z9"], values["Z15"])
    set_count = values["rest"].size
    for name, default in Pump._field_defaults.items():
        if name not in numbers:  # a refinement that the sets leave out
            values[name] = np.full(set_count, default)
    ripple_by_torque = values["cam_ripple_per_torque"] * np.abs(values["load_torque"])
    values["ripple_depth"] = values["cam_ripple"] + ripple_by_torque
    for rule in (*REFINEMENT_RULES, RULE_AT_REST):
        yield apply_rule(rule, values)
    extremes = _steady_extremes(values, set_count)
    for k, side in enumerate(SIDES):
        side_values = {
            "side": side,
            "Z13": values[f"Z13_{side}"],
            "arm_sine": values["Z3"] * np.tan(values[f"Z13_{side}"]),
            "lowest": extremes.lowest_current[:, k],
            "moment_sine": extremes.moment_sine[:, k],
        }
        for rule in SIDE_RULES:
            yield apply_rule(rule, side_values)


def apply_rule(rule: ParameterRule, values: Values) -> CheckedRule:
    """Apply a rule to sets by their values."""

    def sentence(index: int) -> str:
        values_of_set = {
            name: value if isinstance(value, str) else float(value[index])
            for name, value in values.items()
        }
        return rule.sentence.format_map(values_of_set)

    return CheckedRule(rule.is_broken(values), sentence)


def check_range(definition: Definition, column: str, values: Array) -> CheckedRule:
    """Apply the range of a definition to one value of many sets."""

    def sentence(i: int) -> str:
        value = float(values[i])
        hint = ""
        if value < 0.0 and definition.directional and isfinite(value):
            hint = "; minus values are stored as magnitudes"
        return f"{definition.broken(column, value)}{hint}."

    return CheckedRule(np.logical_not(definition.holds(values)), sentence)


# --- rules of the steady state --------------------------------------------------------------------


class _SteadyExtremes(NamedTuple):
    """Extremes of every set (rows) and side (columns) in the steady state."""

    lowest_current: Array
    """[A]"""
    moment_sine: Array
    """Largest |sin φ|, the solenoid's moment over the greatest moment of the feedback spring."""


@cache
def _steady() -> Derived:
    """What many sets settle at, at once."""
    return derive(steady_point, ())


def _steady_extremes(values: Values, set_count: int) -> _SteadyExtremes:
    lowest, moment_sines = np.empty((2, set_count, len(SIDES)))
    signs = np.array([[1.0], [-1.0]])
    for first in range(0, set_count, AT_ONCE):
        some = np.s_[first : first + AT_ONCE]
        channel = CardChannel._make(
            np.stack([values[f"{name}_{side}"][some, None] for side in SIDES], axis=1)
            for name in CardChannel._fields
        )
        pump = Pump._make(values[name][some, None, None] for name in Pump._fields)
        currents, sines = _steady().over(VOLTAGES, channel, signs, pump)
        lowest[some], moment_sines[some] = currents.min(axis=2), sines.max(axis=2)  # NaN stays
    return _SteadyExtremes(lowest, moment_sines)


class SteadyPoint(NamedTuple):
    """What a side settles at under a voltage."""

    current: float
    """[A]"""
    moment_sine: float
    """|sin φ|"""


@equation
def steady_point(voltage: float, channel: CardChannel, sign: float, pump: Pump) -> SteadyPoint:
    """What a side settles at under a voltage in its direction, with the `sign` of its force. [V]"""
    current = channel_level(voltage, channel)
    return SteadyPoint(current, abs(moment_sine(solenoid_force(sign * current, pump), pump)))
