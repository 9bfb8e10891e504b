"""What values must satisfy, each alone and together; every rule is a sentence when broken.

The rules work on arrays, one element a parameter set, so that a thousand sets are checked at once
by the same lines as a single one.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from itertools import count
from math import isfinite, isinf, isnan
from typing import Any

import numpy as np
from numba.np.unsafe.ndarray import to_fixed_tuple
from numpy.typing import NDArray

from swashplate.equations.cache import kernel
from swashplate.equations.equation import JIT_OFF, inlined, interpreted
from swashplate.errors import ParameterError
from swashplate.models.channel import Channel, channel_level
from swashplate.models.displacement_control import (
    Pump,
    moment_sine,
    solenoid_force,
    solenoids_of,
)
from swashplate.parameters.definitions import (
    DEFAULTS,
    OPTIONS,
    REFINEMENTS,
    SWITCHES,
    Definition,
    find,
)

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Broken = tuple[Mask, Callable[[int], str]]
"""Sets that break a rule, and the sentence for one of them."""

FULL_VOLTAGE = 10.0  # Largest command, either way. [V]
VOLTAGES = np.linspace(0.0, FULL_VOLTAGE, 101)
"""Commands at which the static rules are checked. [V]"""
FIRST = 3
"""Single sets that a process checks in plain Python: commands that read one or two and simulate
nothing need not wait for machine code to be loaded."""
_alone = count()
SIDES = ("plus", "minus")
N_CHANNEL, N_PUMP = len(Channel._fields), len(Pump._fields)


def _plain_tuple(values: Array, length: int) -> tuple[float, ...]:
    return tuple(float(each) for each in values)


# compiled code needs to know the length; Numba's function for it does not run uncompiled
tuple_of: Any = _plain_tuple if JIT_OFF else to_fixed_tuple


def check_rules(owner: str, numbers: Mapping[str, float]) -> None:
    """Check what the parameters of one set must satisfy, alone and together.

    Parameters
    ----------
    owner : str
        Name of the set, for the sentence.
    numbers : mapping
        Every value by column, e.g. ``Z13_plus``.

    Raises
    ------
    ParameterError
        For the first broken rule, naming parameter, value and rule.
    """
    columns = {column: np.array([value]) for column, value in numbers.items()}
    for mask, sentence in broken_rules(columns):
        if mask[0]:
            raise ParameterError(f"{owner}: {sentence(0)}")


def check_options(owner: str, options: frozenset[str], numbers: Mapping[str, float]) -> None:
    """Check that what is on has a size.

    Raises
    ------
    ParameterError
        For an unknown option, or one whose parameters are all 0 where that has no meaning.
    """
    for option in sorted(options):
        if option not in OPTIONS:
            raise ParameterError(
                f"{owner}: there is no option '{option}'; there are {', '.join(OPTIONS)}."
            )
        own = [find(name) for name, each in SWITCHES.items() if each == option]
        sized = [each for each in own if each.least is not None]
        if sized and all(numbers.get(each.symbol, 0.0) == 0.0 for each in sized):
            raise ParameterError(
                f"{owner}: {option} is on, but {' and '.join(each.symbol for each in sized)} "
                f"{'are' if len(sized) > 1 else 'is'} 0; give at least {sized[0].least:g} "
                f"{sized[0].unit}, or take {option} out of the options."
            )


def broken_rules(numbers: Mapping[str, Array]) -> Iterator[Broken]:
    """Every rule with the sets that break it, those about single values first.

    Parameters
    ----------
    numbers : mapping of (m,) arrays
        Every value by column, one element a set.
    """
    for column, values in numbers.items():
        definition = find(column)
        yield (
            out_of_range(definition, values),
            partial(range_sentence, column, definition, values),
        )
    if not REFINEMENTS.keys().isdisjoint(numbers):
        yield from _of_refinements(numbers)
    pressure, ceiling = numbers["Z2"] / numbers["Z1"], np.minimum(numbers["Z9"], numbers["Z15"])
    yield (
        np.abs(pressure) >= ceiling,
        lambda i: (
            f"the pressure at rest Z2/Z1 is {pressure[i]:g} Pa, but must stay below "
            f"{ceiling[i]:g} Pa, the smaller of Z9 and Z15."
        ),
    )
    lowest, moment = _static(numbers)
    for k, side in enumerate(SIDES):
        yield from _of_side(numbers, side, lowest[:, k], moment[:, k])


def out_of_range(definition: Definition, values: Array) -> Mask:
    """Which values lie outside a definition's range."""
    # what is no number passes no comparison
    strict = definition.above is not None or not isfinite(definition.lower)
    allowed = values > definition.lower if strict else values >= definition.lower
    if isfinite(definition.upper) or not definition.can_be_off:
        allowed &= values < definition.upper
    return np.logical_not(allowed)


def range_sentence(column: str, definition: Definition, values: Array, i: int) -> str:
    """What is wrong with one of the values."""
    value, hint = float(values[i]), ""
    if value < 0.0 and definition.directional and not (isnan(value) or isinf(value)):
        hint = "; minus values are stored as magnitudes"
    unit = "" if definition.unit == "1" else f" {definition.unit}"
    return f"{column} ({definition.name}) is {value:g}{unit}, but must be {definition.range}{hint}."


def _of_refinements(numbers: Mapping[str, Array]) -> Iterator[Broken]:
    """Rules of refinements together; one that is not given is what it is without."""
    size = next(iter(numbers.values())).size
    n = {name: numbers.get(name, np.full(size, default)) for name, default in DEFAULTS.items()}
    time, stiffness = n["dither_time"], n["line_stiffness"]
    depth = n["cam_ripple"] + n["cam_ripple_per_torque"] * np.abs(n["load_torque"])
    yield (
        (n["spool_friction"] > 0.0) & np.isfinite(time) & (n["spool_presliding"] == 0.0),
        lambda i: (
            f"dither_time is {time[i]:g} s, but spool_presliding is 0: dither frees a spool that "
            "friction lets give a little; give that travel, of the order of 5e-5 m."
        ),
    )
    yield (
        (stiffness > 0.0) & (n["load_inertia"] == 0.0),
        lambda i: (
            f"line_stiffness is {stiffness[i]:g} N m/rad, but load_inertia is 0: give the inertia "
            "that the line has to turn, in kg m^2 at the shaft."
        ),
    )
    yield (
        depth >= 1.0,
        lambda i: (
            f"cam_ripple + cam_ripple_per_torque·|load_torque| is {depth[i]:.4g}, but must be "
            "below 1: a motor whose displacement vanishes somewhere would run away."
        ),
    )


def _of_side(
    numbers: Mapping[str, Array], side: str, lowest: Array, moment: Array
) -> Iterator[Broken]:
    """Rules of one direction, with its lowest steady current [A] and largest sin φ."""
    upper, lower = numbers[f"I_t1_{side}"], numbers[f"I_t2_{side}"]
    yield (
        lower >= upper,
        lambda i: (
            f"I_t2_{side} is {lower[i]:g} A, but must be below I_t1_{side} = {upper[i]:g} A: the "
            "decay begins at a lower current than the rate limit."
        ),
    )
    stop = numbers[f"Z13_{side}"]
    sine = numbers["Z3"] * np.tan(stop)
    yield (
        sine >= 1.0,
        lambda i: (
            f"Z3·tan Z13_{side} is {sine[i]:.4g}, but must be below 1: at its stop of "
            f"{stop[i]:g} rad the swash plate would turn the feedback arm past 90°."
        ),
    )
    yield (
        lowest < 0.0,
        lambda i: (
            f"the steady current of the {side} channel falls to {lowest[i]:.3g} A within "
            f"{FULL_VOLTAGE:g} V, but a current is a magnitude; check G1_{side}, G2_{side} and "
            f"G3_{side}."
        ),
    )
    yield (
        ~(moment < 1.0),
        lambda i: (
            f"Z5·F/√Z4 reaches {moment[i]:.4g} within {FULL_VOLTAGE:g} V ({side}), but must be "
            "below 1: the solenoid would overpower the feedback spring; check Z19 to Z22, Z4 and "
            "Z5."
        ),
    )


def _static(numbers: Mapping[str, Array]) -> tuple[Array, Array]:
    """Lowest steady current [A] and largest sin φ of every set (rows) and side (columns)."""
    size = next(iter(numbers.values())).size
    channels = np.stack(
        [
            np.stack([numbers[f"{name}_{side}"] for name in Channel._fields], axis=1)
            for side in SIDES
        ],
        axis=1,
    )
    pumps = np.stack(
        [
            numbers[name] if name in numbers else np.full(size, Pump._field_defaults[name])
            for name in Pump._fields
        ],
        axis=1,
    )
    lowest, moment = np.empty((size, 2)), np.empty((size, 2))
    if size == 1 and next(_alone) < FIRST:
        pump, extremes = Pump(*pumps[0].tolist()), interpreted(_extremes)
        for side in range(2):
            channel = Channel(*channels[0, side].tolist())
            lowest[0, side], moment[0, side] = extremes(channel, pump, side, VOLTAGES.tolist())
    else:
        static_extremes(channels, pumps, VOLTAGES, lowest, moment)
    return lowest, moment


@inlined
def _extremes(channel: Channel, pump: Pump, side: int, voltages: Array) -> tuple[float, float]:
    """Lowest steady current [A] and largest |sin φ| of one side within some voltages."""
    solenoids = solenoids_of(pump)
    least, most = np.inf, 0.0
    for voltage in voltages:
        current = channel_level(voltage, channel)
        force = solenoid_force(-current if side == 1 else current, solenoids)
        sine = abs(moment_sine(force, pump))
        # what is no number stays
        least = current if current < least or current != current else least
        most = sine if sine > most or sine != sine else most
    return least, most


@kernel
def static_extremes(
    channels: Array, pumps: Array, voltages: Array, lowest: Array, moment: Array
) -> None:
    """Lowest steady current and largest sin φ within some voltages, of many sets.

    Parameters
    ----------
    channels : (m, 2, 13) array
        Fields of `Channel` of every set, plus and minus.
    pumps : (m, 43) array
        Fields of `Pump`.
    voltages : (n,) array
        Constant commands towards each side. [V]
    lowest, moment : (m, 2) arrays
        Outputs: current [A] and |sin φ| of both sides; not a number where any is none.
    """
    for i in range(pumps.shape[0]):
        pump = Pump(*tuple_of(pumps[i], N_PUMP))
        for side in range(2):
            channel = Channel(*tuple_of(channels[i, side], N_CHANNEL))
            lowest[i, side], moment[i, side] = _extremes(channel, pump, side, voltages)
