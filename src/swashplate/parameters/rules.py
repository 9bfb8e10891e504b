"""What values must satisfy, each alone and together; every rule is a sentence when broken.

The rules work on arrays, one element a parameter set, so that a thousand sets are checked at once
by the same lines as a single one.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from math import isfinite, isinf, isnan

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import ParameterError
from swashplate.parameters.catalogue import CATALOGUE, COLUMNS, Definition
from swashplate.parameters.refinements import REFINEMENTS

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Broken = tuple[Mask, Callable[[int], str]]
"""Sets that break a rule, and the sentence for one of them."""

FULL_VOLTAGE = 10.0
"""Largest command, either way. [V]"""
VOLTAGES = np.linspace(0.0, FULL_VOLTAGE, 101)
"""Commands at which the static rules are checked. [V]"""


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


def check_bounds(
    owner: str, column: str, definition: Definition, value: float, bounds: tuple[float, float]
) -> None:
    """Check one value against bounds that the set's author gave, besides the catalogue's."""
    if not bounds[0] <= value <= bounds[1]:
        raise ParameterError(
            f"{owner}: {column} ({definition.name}) is {value:g} {definition.unit}, outside its "
            f"bounds {bounds[0]:g} to {bounds[1]:g}."
        )


def broken_rules(numbers: Mapping[str, Array]) -> Iterator[Broken]:
    """Every rule with the sets that break it, those about single values first.

    Parameters
    ----------
    numbers : mapping of (m,) arrays
        Every value by column, one element a set.
    """
    for column, values in numbers.items():
        definition = REFINEMENTS[column] if column in REFINEMENTS else CATALOGUE[COLUMNS[column]]
        yield (
            _out_of_range(definition, values),
            partial(_range_sentence, column, definition, values),
        )
    if not REFINEMENTS.keys().isdisjoint(numbers):
        yield _dither(numbers)
        yield _line(numbers)
        yield _cam_ring(numbers)
    yield _rest(numbers)
    for side in ("plus", "minus"):
        yield _thresholds(numbers, side)
        yield _feedback_arm(numbers, side)
        current = _steady(numbers, side)
        yield _negative_current(current, side)
        yield _solenoid_moment(numbers, current, side)


def _out_of_range(definition: Definition, values: Array) -> Mask:
    low = values <= definition.lower if definition.above else values < definition.lower
    high = np.isposinf(values) & (not definition.can_be_off)
    if isfinite(definition.upper):
        high = values >= definition.upper
    return low | high | np.isnan(values) | np.isneginf(values)


def _range_sentence(column: str, definition: Definition, values: Array, i: int) -> str:
    value, hint = float(values[i]), ""
    if value < 0.0 and definition.directional and not (isnan(value) or isinf(value)):
        hint = "; minus values are stored as magnitudes"
    return (
        f"{column} ({definition.name}) is {value:g} {definition.unit}, but must be "
        f"{definition.range}{hint}."
    )


def _dither(numbers: Mapping[str, Array]) -> Broken:
    friction, travel = (_refinement(numbers, s) for s in ("spool_friction", "spool_presliding"))
    time = _refinement(numbers, "dither_time")
    return (
        (friction > 0.0) & np.isfinite(time) & (travel == 0.0),
        lambda i: (
            f"dither_time is {time[i]:g} s, but spool_presliding is 0: dither frees a spool that "
            "friction lets give a little; give that travel, of the order of 5e-5 m."
        ),
    )


def _line(numbers: Mapping[str, Array]) -> Broken:
    stiffness, inertia = (_refinement(numbers, s) for s in ("line_stiffness", "load_inertia"))
    return (
        (stiffness > 0.0) & (inertia == 0.0),
        lambda i: (
            f"line_stiffness is {stiffness[i]:g} N m/rad, but load_inertia is 0: give the inertia "
            "that the line has to turn, in kg m^2 at the shaft."
        ),
    )


def _cam_ring(numbers: Mapping[str, Array]) -> Broken:
    torque = np.abs(_refinement(numbers, "load_torque"))
    depth = _refinement(numbers, "cam_ripple")
    depth = depth + _refinement(numbers, "cam_ripple_per_torque") * torque
    return (
        depth >= 1.0,
        lambda i: (
            f"cam_ripple + cam_ripple_per_torque·|load_torque| is {depth[i]:.4g}, but must be "
            "below 1: a motor whose displacement vanishes somewhere would run away."
        ),
    )


def _refinement(numbers: Mapping[str, Array], symbol: str) -> Array:
    """A refinement's values, of all sets, or what it is where none is given."""
    size = next(iter(numbers.values())).size
    return numbers.get(symbol, np.full(size, REFINEMENTS[symbol].default))


def _rest(numbers: Mapping[str, Array]) -> Broken:
    pressure = numbers["Z2"] / numbers["Z1"]
    ceiling = np.minimum(numbers["Z9"], numbers["Z15"])
    return (
        np.abs(pressure) >= ceiling,
        lambda i: (
            f"the pressure at rest Z2/Z1 is {pressure[i]:g} Pa, but must stay below "
            f"{ceiling[i]:g} Pa, the smaller of Z9 and Z15."
        ),
    )


def _thresholds(numbers: Mapping[str, Array], side: str) -> Broken:
    upper, lower = numbers[f"I_t1_{side}"], numbers[f"I_t2_{side}"]
    return (
        lower >= upper,
        lambda i: (
            f"I_t2_{side} is {lower[i]:g} A, but must be below I_t1_{side} = {upper[i]:g} A: the "
            "decay begins at a lower current than the rate limit."
        ),
    )


def _feedback_arm(numbers: Mapping[str, Array], side: str) -> Broken:
    stop = numbers[f"Z13_{side}"]
    sine = numbers["Z3"] * np.tan(stop)
    return (
        sine >= 1.0,
        lambda i: (
            f"Z3·tan Z13_{side} is {sine[i]:.4g}, but must be below 1: at its stop of "
            f"{stop[i]:g} rad the swash plate would turn the feedback arm past 90°."
        ),
    )


def _negative_current(current: Array, side: str) -> Broken:
    lowest = current.min(axis=0)
    return (
        lowest < 0.0,
        lambda i: (
            f"the steady current of the {side} channel falls to {lowest[i]:.3g} A within "
            f"{FULL_VOLTAGE:g} V, but a current is a magnitude; check G1_{side}, G2_{side} and "
            f"G3_{side}."
        ),
    )


def _solenoid_moment(numbers: Mapping[str, Array], current: Array, side: str) -> Broken:
    effective = np.maximum(current - numbers["Z17"], 0.0)
    signed = effective if side == "plus" else -effective
    c1, c2, c3, c4 = (numbers[f"Z{k}_{side}"] for k in (19, 20, 21, 22))
    force = signed * (c1 + signed * (c2 + signed * (c3 + signed * c4)))
    with np.errstate(divide="ignore", invalid="ignore"):
        sine = np.abs(force).max(axis=0) * numbers["Z5"] / np.sqrt(numbers["Z4"])
    return (
        ~(sine < 1.0),
        lambda i: (
            f"Z5·F/√Z4 reaches {sine[i]:.4g} within {FULL_VOLTAGE:g} V ({side}), but must be "
            "below 1: the solenoid would overpower the feedback spring; check Z19 to Z22, Z4 and "
            "Z5."
        ),
    )


def _steady(numbers: Mapping[str, Array], side: str) -> Array:
    """Steady current at `VOLTAGES` (rows) of every set (columns), the jump included. [A]"""
    V_dz, J, G1, G2, G3 = (numbers[f"{name}_{side}"] for name in ("V_dz", "J", "G1", "G2", "G3"))
    voltage = VOLTAGES[:, np.newaxis]
    d = np.maximum(voltage - V_dz, 0.0)
    return np.asarray(np.where(voltage > V_dz, J, 0.0) + d * (G1 + d * (G2 + d * G3)))
