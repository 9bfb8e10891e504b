"""From a parameter set to the tuples that the march takes."""

from math import floor, tan
from typing import NamedTuple

from swashplate.errors import InputError
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.physics.card_dynamics import decay_factor
from swashplate.physics.component import uncompiled
from swashplate.physics.stroker import pressure_limits
from swashplate.physics.swash import TAN_22_5
from swashplate.simulation.constants import (
    CHANNEL_PARAMETERS,
    PUMP_PARAMETERS,
    Channel,
    Delay,
    Pump,
)

ALL_PARAMETERS = (
    *PUMP_PARAMETERS,
    *(f"{name}_plus" for name in CHANNEL_PARAMETERS),
    *(f"{name}_minus" for name in CHANNEL_PARAMETERS),
    "tau",
)
"""Columns of the sensitivities, in their order."""


class Constants(NamedTuple):
    """A drive, ready to be marched at one step."""

    delay: Delay
    plus: Channel
    minus: Channel
    pump: Pump
    step: float


def build(parameters: ParameterSet, step: float) -> Constants:
    """Constants of the march.

    Parameters
    ----------
    parameters : ParameterSet
        The drive.
    step : float
        h. [s]

    Raises
    ------
    InputError
        If the card's explicit filter is unstable at this step.
    """
    numbers = parameters.numbers
    for side in ("plus", "minus"):
        check_filter_stability(
            parameters.name, numbers[f"zeta_{side}"], numbers[f"omega_{side}"], side, step
        )
    plus, minus = (build_channel(parameters, side, step) for side in ("plus", "minus"))
    return Constants(build_delay(numbers["tau"], step), plus, minus, build_pump(parameters), step)


def build_channel(parameters: ParameterSet, side: str, step: float) -> Channel:
    """One channel of the card, ``"plus"`` or ``"minus"``."""
    numbers = parameters.numbers
    values = [numbers[f"{name}_{side}"] for name in CHANNEL_PARAMETERS]
    decay = uncompiled(decay_factor)(numbers[f"a_{side}"], step)
    literal = True if parameters.coulomb_sign == "literal" else None
    split = True if parameters.card_switch == "split" else None
    return Channel._make([*values, decay, literal, split])


def build_pump(parameters: ParameterSet) -> Pump:
    """Pump and motor, whatever the step.

    Raises
    ------
    InputError
        If the set has refinements, which the equations of the source leave out.
    """
    parameters.refuse_refinements("The source's plain equations")
    numbers = parameters.numbers
    Z13 = (numbers["Z13_plus"], numbers["Z13_minus"])
    limits = uncompiled(pressure_limits)(numbers["Z1"], numbers["Z2"], *Z13, numbers["Z15"])
    options = (
        numbers["Z7"] != 0.0,
        numbers["Z12"] != 0.0,
        tan(max(Z13)) >= TAN_22_5,
        parameters.pressure_root == "symmetric",
    )
    return Pump._make(
        [
            *(numbers[name] for name in PUMP_PARAMETERS),
            *limits,
            *(True if option else None for option in options),
        ]
    )


def build_delay(tau: float, step: float) -> Delay:
    """Delay τ in samples. Within half a sample, the share's interval is kept from looking ahead."""
    samples = tau / step
    share_end = max(samples, 0.5) - 0.5
    return Delay(
        floor(samples),
        samples - floor(samples),
        floor(share_end),
        share_end - floor(share_end),
        1.0 if samples >= 0.5 else 0.0,
    )


MOST_SUBSTEPS = 1000
"""Steps a sample that anyone would wait for."""


def check_filter_stability(owner: str, zeta: float, omega: float, side: str, step: float) -> None:
    """Refuse a step at which the explicit filter would settle on wrong values without a word.

    Raises
    ------
    InputError
        Unless ωh < 2ζ and ζωh < 1 + ω²h²/4; the sentence says how many steps a sample would do.

    Notes
    -----
    Jury's criterion for z² - 2(1 - ζωh) z + 1 - 2ζωh + ω²h². The first condition is the stricter
    one where damping is small: an explicit step adds to a swing what the damping has to take away.
    """
    if _stable(zeta, omega, step):
        return
    if omega * step >= 2.0 * zeta * MOST_SUBSTEPS:
        raise InputError(
            f"{owner}: the current filter of the {side} channel (zeta = {zeta:g}) has so little "
            f"damping that {MOST_SUBSTEPS} steps a sample would not do; raise zeta."
        )
    substeps = 2
    while not _stable(zeta, omega, step / substeps):
        substeps += 1
    raise InputError(
        f"{owner}: the current filter of the {side} channel (zeta = {zeta:g}, omega = {omega:g} "
        f"rad/s) is unstable at a step of 1/{1.0 / step:g} s; simulate with substeps={substeps} "
        "or more or at a higher rate, or lower omega."
    )


def _stable(zeta: float, omega: float, step: float) -> bool:
    w = omega * step
    return w < 2.0 * zeta and zeta * w < 1.0 + 0.25 * w * w
