"""The dead zone of card and solenoids, in which a drive has no linear model."""

from __future__ import annotations

from math import ceil

import numpy as np

from swashplate.errors import DomainError
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.simulation.constants import Channel, Pump
from swashplate.simulation.steady import steady_states

_DECIMALS = 4
"""Of the voltage that is proposed; rounded away from 0 V, so that it does have a model."""


class DeadZoneError(DomainError):
    """A point in a dead zone, where the gain is 0, and where there is a model instead.

    Parameters
    ----------
    where : str
        The point and its dead zone. Kept with what follows from it.
    instead : str
        What to linearise at: ``"linearise at +0.2064 V or more"``.
    """

    def __init__(self, where: str, instead: str) -> None:
        self.where, self.instead = f"{where}, so the gain is 0", instead
        super().__init__(f"{self.where}; {instead}, or the pump alone with input='solenoid_force'.")


def check_card(
    name: str, voltage: float, plus: Channel, minus: Channel, pump: Pump
) -> tuple[str, ...]:
    """Switches that a voltage lies on; refused in the dead zone of the card.

    Raises
    ------
    DeadZoneError
        If the card gives no current that small motions could change.
    """
    channel = plus if voltage >= 0.0 else minus
    if abs(voltage) > channel.V_dz:
        return ()
    if channel.V_dz == 0.0 and channel.J == 0.0:
        return ("card at 0 V: the side of positive voltage",)
    raise DeadZoneError(
        f"{name}: {voltage:g} V lies in the card's dead zone",
        _by_voltage(voltage, plus, minus, pump),
    )


def check_solenoid(
    name: str,
    current: float,
    voltage: float | None,
    plus: Channel,
    minus: Channel,
    pump: Pump,
) -> tuple[str, ...]:
    """Switches that a signed current [A] lies on; refused in the dead zone of the solenoids.

    Parameters
    ----------
    voltage : float or None
        The command that gives the current, None where the current itself is meant. [V]

    Raises
    ------
    DeadZoneError
        If the solenoids give no force that small motions could change.
    """
    if abs(current) > pump.Z17:
        return ()
    if pump.Z17 == 0.0:
        return ("solenoids at 0 A: the side of positive current",)
    zone = f"in the solenoids' dead zone of Z17 = ±{pump.Z17:g} A"
    if voltage is None:
        raise DeadZoneError(
            f"{name}: {current:.6g} A lies {zone}", f"linearise beyond ±{pump.Z17:g} A"
        )
    raise DeadZoneError(
        f"{name}: {voltage:g} V gives {current:.6g} A, which lies {zone}",
        _by_voltage(voltage, plus, minus, pump),
    )


def _by_voltage(voltage: float, plus: Channel, minus: Channel, pump: Pump) -> str:
    way = 1.0 if voltage >= 0.0 else -1.0
    channel, sign = (plus, "+") if way > 0.0 else (minus, "-")
    # a zone's end is part of it, so that the first step beyond has a model
    steps = np.arange(1, ceil(FULL_VOLTAGE * 10**_DECIMALS) + 1) / 10**_DECIMALS
    current, speed = np.empty(steps.size), np.empty(steps.size)
    steady_states(way * steps, plus, minus, pump, current, speed)
    answers = (steps > channel.V_dz) & (np.abs(current) > pump.Z17)
    if not answers.any():
        return f"no voltage up to {sign}{FULL_VOLTAGE:g} V leaves it: linearise on the other side"
    return f"linearise at {sign}{steps[int(np.argmax(answers))]:.{_DECIMALS}f} V or beyond"
