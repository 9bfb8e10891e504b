"""What values must satisfy, each alone and together: conditions with the sentence when broken.

The rules work on arrays, one element a parameter set, so that a thousand sets are checked at once
by the same lines as a single one.
"""

from collections.abc import Callable, Iterator, Mapping
from itertools import count
from math import inf, isfinite
from typing import Any

import numpy as np
from numba.np.unsafe.ndarray import to_fixed_tuple
from numpy.typing import NDArray

from swashplate.equations import JIT_OFF, inlined, interpreted, kernel
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
"""Arrays by column, one element a set, and what follows from them; or words."""
Rule = tuple[Callable[[Values], Mask], str]
"""Which sets break it, and the sentence for one of them, by the names of the values."""
Broken = tuple[Mask, Callable[[int], str]]
"""Sets that break a rule, and the sentence for one of them."""

FULL_VOLTAGE = 10.0  # Largest command, either way. [V]
SIDES = ("plus", "minus")  # Endings of what has two directions.
VOLTAGES = np.linspace(0.0, FULL_VOLTAGE, 101)
"""Commands at which the static rules are checked. [V]"""
FEW, _alone = 5000, count()
"""Sets checked one by one for which Python takes as long as compiling does, and how many there
were."""
N_CHANNEL, N_PUMP = len(CardChannel._fields), len(Pump._fields)

OF_REFINEMENTS: tuple[Rule, ...] = (
    (
        lambda n: (
            (n["spool_friction"] > 0.0)
            & np.isfinite(n["dither_time"])
            & (n["spool_presliding"] == 0.0)
        ),
        "dither_time is {dither_time:g} s, but spool_presliding is 0: dither acts on the small "
        "travel that friction permits; give that travel, of the order of 5e-5 m.",
    ),
    (
        lambda n: (n["line_stiffness"] > 0.0) & (n["load_inertia"] == 0.0),
        "line_stiffness is {line_stiffness:g} N m/rad, but load_inertia is 0: give the inertia "
        "that the line has to turn, in kg m^2 at the shaft.",
    ),
    (
        lambda n: n["depth"] >= 1.0,
        "cam_ripple + cam_ripple_per_torque·|load_torque| is {depth:.4g}, but must be below 1: a "
        "motor whose displacement vanishes somewhere would run away.",
    ),
)
AT_REST: Rule = (
    lambda n: np.abs(n["rest"]) >= n["ceiling"],
    "the pressure at rest Z2/Z1 is {rest:g} Pa, but must stay below {ceiling:g} Pa, the smaller of "
    "Z9 and Z15.",
)
OF_A_SIDE: tuple[Rule, ...] = (
    (
        lambda n: n["I_t2"] >= n["I_t1"],
        "I_t2_{side} is {I_t2:g} A, but must be below I_t1_{side} = {I_t1:g} A: the decay begins "
        "at a lower current than the rate limit.",
    ),
    (
        lambda n: n["arm_sine"] >= 1.0,
        "Z3·tan Z13_{side} is {arm_sine:.4g}, but must be below 1: at its stop of {Z13:g} rad the "
        "swash plate would turn the feedback arm past 90°.",
    ),
    (
        lambda n: n["lowest"] < 0.0,
        f"the steady current of the {{side}} channel falls to {{lowest:.3g}} A within "
        f"{FULL_VOLTAGE:g} V, but a current is a magnitude; check G1_{{side}}, G2_{{side}} and "
        "G3_{side}.",
    ),
    (
        lambda n: ~(n["moment_sine"] < 1.0),
        f"Z5·F/√Z4 reaches {{moment_sine:.4g}} within {FULL_VOLTAGE:g} V ({{side}}), but must be "
        "below 1: the solenoid would overpower the feedback spring; check Z19 to Z22, Z4 and Z5.",
    ),
)


def refuse(owner: str, rules: Iterator[Broken]) -> None:
    """Raise the sentence of the first rule that the first set breaks, as a `ParameterError`."""
    for mask, sentence in rules:
        if mask[0]:
            raise ParameterError(f"{owner}: {sentence(0)}")


def check_options(owner: str, options: frozenset[str], numbers: Mapping[str, float]) -> None:
    """Check that what is on has a size.

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


def broken_rules(
    numbers: Mapping[str, Array], definitions: Definitions = DEFINITIONS
) -> Iterator[Broken]:
    """Every rule with the sets that break it, those about single values first.

    Parameters
    ----------
    numbers : mapping of (m,) arrays
        Every value by column, one element a set.
    definitions : Definitions
        Of the sets' parameters.
    """
    for column, values in numbers.items():
        yield range_rule(definitions.find(column), column, values)
    n: Values = dict(numbers)
    n["rest"], n["ceiling"] = n["Z2"] / n["Z1"], np.minimum(n["Z9"], n["Z15"])
    size = n["rest"].size
    # a refinement that is not given is what it is without
    off = Pump._field_defaults.items()
    n |= {name: np.full(size, value) for name, value in off if name not in numbers}
    n["depth"] = n["cam_ripple"] + n["cam_ripple_per_torque"] * np.abs(n["load_torque"])
    for rule in (*OF_REFINEMENTS, AT_REST):
        yield applied(rule, n)
    lowest, moment_sines = _static(n, size)
    for k, side in enumerate(SIDES):
        side_values = {name: n[f"{name}_{side}"] for name in ("I_t1", "I_t2", "Z13")}
        side_values |= {"side": side, "lowest": lowest[:, k], "moment_sine": moment_sines[:, k]}
        side_values["arm_sine"] = n["Z3"] * np.tan(side_values["Z13"])
        for rule in OF_A_SIDE:
            yield applied(rule, side_values)


def applied(rule: Rule, n: Values) -> Broken:
    """A rule with the sets that break it."""
    breaks, words = rule

    def sentence(i: int) -> str:
        return words.format_map({k: v if isinstance(v, str) else float(v[i]) for k, v in n.items()})

    return breaks(n), sentence


def range_rule(definition: Definition, column: str, values: Array) -> Broken:
    """Mark values outside a definition's range, and say what is wrong with one of them."""

    def sentence(i: int) -> str:
        value = float(values[i])
        hint = ""
        if value < 0.0 and definition.directional and isfinite(value):
            hint = "; minus values are stored as magnitudes"
        return f"{definition.broken(column, value)}{hint}."

    return np.logical_not(definition.holds(values)), sentence


# --- static rules ---------------------------------------------------------------------------------


def _static(n: Values, size: int) -> tuple[Array, Array]:
    """Lowest steady current [A] and largest |sin φ| of every set (rows) and side (columns).

    sin φ is the solenoid's moment over the greatest moment of the feedback spring.
    """
    sides = [[n[f"{name}_{side}"] for name in CardChannel._fields] for side in SIDES]
    channels = np.moveaxis(np.array(sides), -1, 0)
    pumps = np.column_stack([n[name] for name in Pump._fields])
    lowest = np.empty((size, 2))
    moment_sines = np.empty((size, 2))
    if size == 1 and next(_alone) < FEW:
        # commands that read a few sets and simulate nothing need not wait for machine code
        pump = Pump(*pumps[0].tolist())
        volts = VOLTAGES.tolist()
        for k in range(2):
            channel = CardChannel(*channels[0, k].tolist())
            lowest[0, k], moment_sines[0, k] = interpreted(_extremes)(channel, pump, k, volts)
    else:
        static_extremes(channels, pumps, VOLTAGES, lowest, moment_sines)
    return lowest, moment_sines


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


def _plain_tuple(values: Array, length: int) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


# compiled code needs to know the length; Numba's function for it does not run uncompiled
tuple_of: Any = _plain_tuple if JIT_OFF else to_fixed_tuple


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
