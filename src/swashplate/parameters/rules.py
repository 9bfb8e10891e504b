"""Validity rules of parameter sets, for single values and for values together.

A rule is a condition with a sentence for a set that breaks it. The rules work on arrays with one
element for each parameter set, so that a thousand sets are checked at once by the same lines as a
single one.
"""

from collections.abc import Callable, Iterator, Mapping
from itertools import count
from math import inf, isfinite
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.equations import TEACHING, inlined, kernel
from swashplate.errors import ParameterError
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


class CheckedRule(NamedTuple):
    """A rule applied to parameter sets."""

    is_broken: Mask
    """Which sets break it."""
    sentence: Callable[[int], str]
    """The sentence for a set by its index."""


FULL_VOLTAGE = 10.0  # Largest command, either way. [V]
SIDES = ("plus", "minus")  # Endings of values for the two directions.
VOLTAGES = np.linspace(0.0, FULL_VOLTAGE, 101)
"""Commands at which the static rules are checked. [V]"""
MOST_INTERPRETED = 5000
"""Number of single sets whose check by Python takes as long as compiling the check does."""
_single_checks = count()
"""Counts the sets that are checked one by one."""
N_CHANNEL = len(CardChannel._fields)
N_PUMP = len(Pump._fields)

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
        lambda n: n["I_t2"] >= n["I_t1"],
        "I_t2_{side} is {I_t2:g} A, but must be below I_t1_{side} = {I_t1:g} A: the decay begins "
        "at a lower current than the rate limit.",
    ),
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


def refuse(owner: str, rules: Iterator[CheckedRule]) -> None:
    """Raise the sentence of the first rule that the first set breaks, as a `ParameterError`."""
    for rule in rules:
        if rule.is_broken[0]:
            raise ParameterError(f"{owner}: {rule.sentence(0)}")


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
            "I_t1": values[f"I_t1_{side}"],
            "I_t2": values[f"I_t2_{side}"],
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


def _steady_extremes(values: Values, set_count: int) -> _SteadyExtremes:
    sides = [[values[f"{name}_{side}"] for name in CardChannel._fields] for side in SIDES]
    channels = np.moveaxis(np.array(sides), -1, 0)
    pumps = np.column_stack([values[name] for name in Pump._fields])
    lowest = np.empty((set_count, 2))
    moment_sines = np.empty((set_count, 2))
    if set_count == 1 and next(_single_checks) < MOST_INTERPRETED:
        # commands that read a few sets and simulate nothing need not wait for machine code
        pump = Pump(*pumps[0].tolist())
        volts = VOLTAGES.tolist()
        for k in range(2):
            channel = CardChannel(*channels[0, k].tolist())
            lowest[0, k], moment_sines[0, k] = _extremes(channel, pump, k, volts)
    else:
        static_extremes(channels, pumps, VOLTAGES, lowest, moment_sines)
    return _SteadyExtremes(lowest, moment_sines)


@inlined
def _extremes(channel: CardChannel, pump: Pump, side: int, voltages: Array) -> tuple[float, float]:
    """Lowest steady current [A] and largest |sin φ| of one side within some voltages."""
    least, most = inf, 0.0
    for voltage in voltages:
        current = channel_level(voltage, channel)
        force = solenoid_force(-current if side == 1 else current, pump)
        sine = abs(moment_sine(force, pump))
        # NaN stays
        least = current if current < least or current != current else least
        most = sine if sine > most or sine != sine else most
    return least, most


def tuple_of(values: Array, length: int) -> tuple[float, ...]:
    """Numbers of an array whose length compiled code must know; see `_teach_tuple_of`."""
    return tuple(float(value) for value in values[:length])


def _teach_tuple_of() -> None:
    """Have Numba make tuples by its own function, which does not run uncompiled."""
    from numba import types
    from numba.extending import overload
    from numba.np.unsafe.ndarray import to_fixed_tuple

    to_fixed: Any = to_fixed_tuple

    def of(length: Any) -> Any:
        if not isinstance(length, types.IntegerLiteral):
            return None
        count = length.literal_value
        return lambda values, length: to_fixed(values, count)

    overload(tuple_of, prefer_literal=True)(lambda values, length: of(length))


TEACHING.append(_teach_tuple_of)


@kernel
def static_extremes(
    channels: Array, pumps: Array, voltages: Array, lowest: Array, moment_sines: Array
) -> None:
    """Lowest steady current [A] and largest |sin φ| of both sides of many sets, (m, 2) outputs.

    `channels` are the fields of `CardChannel` of every set and side, (m, 2, 13), `pumps` those of
    `Pump`, (m, N_PUMP); NaN if what is computed of a set and side has no value.
    """
    for i in range(pumps.shape[0]):
        pump = Pump(*tuple_of(pumps[i], N_PUMP))
        for side in range(2):
            channel = CardChannel(*tuple_of(channels[i, side], N_CHANNEL))
            lowest[i, side], moment_sines[i, side] = _extremes(channel, pump, side, voltages)
