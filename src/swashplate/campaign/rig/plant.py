"""The plant behind the instruments: the drive's own march, and effects where they are wanted."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.rig.plant_effects import (
    leaked_speed,
    play,
    remembered_current,
    rippled_position,
    rippled_speed,
)
from swashplate.drive import Drive
from swashplate.errors import InputError
from swashplate.simulation.result import Simulation

Array = NDArray[np.float64]
Level = Literal["off", "on", "strong"]

RATE = 512.0
"""Rate of the march and of the log, as in the source. [Hz]"""
STICTION_GAIN = {"on": 0.088, "strong": 0.176}
"""Share of a change of current by which the spool goes too far. [1]"""
STICTION_MEMORY = 0.6
"""Time constant with which it is set right. [s]"""
LEAKAGE = {"on": 0.02, "strong": 0.06}
"""Speed lost to the rated load, as a share of the full speed. [1]"""
BRAKE_RELEASED = 0.1
"""Share of the full speed from which the brake carries nothing. [1]"""
CAM_CYCLES = 5.5
"""Cycles of the cam ring's ripple in a turn of the drum, as the source counted them. [1]"""
CAM_RIPPLE = {"on": 0.04, "strong": 0.12}
"""Variation of the speed at rated load. [1]"""
BACKLASH = {"on": 0.002, "strong": 0.01}
"""Play between motor and encoder, at the shaft. [rad]"""


@dataclass(frozen=True)
class Effects:
    """What the plant has and the identified model has not: each "off", "on" or "strong"."""

    cam_ripple: Level = "off"
    """The cam ring modulates the speed 5.5 times a turn, in proportion to the load."""
    spool_stiction: Level = "off"
    """The spool goes too far behind a sudden change of current: speed overshoots, about 4 % ("on")
    on a 4 V step of the hoist."""
    backlash: Level = "off"
    """Play between motor and encoder; meant for slewing."""
    leakage: Level = "off"
    """Speed lost to the load: raised slower, lowered faster."""
    load: float = 0.5
    """Load as a share of the rated one, 0 to 1; cam ripple and leakage go with it. [1]"""

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if each.name == "load":
                if not 0.0 <= value <= 1.0:
                    raise InputError(f"load is a share of the rated load, 0 to 1, not {value}.")
            elif value not in ("off", "on", "strong"):
                raise InputError(f"{each.name} is 'off', 'on' or 'strong', not {value!r}.")

    @property
    def active(self) -> tuple[str, ...]:
        """Those that are not off, as ``"cam_ripple on"``."""
        return tuple(
            f"{name} {level}"
            for name, level in asdict(self).items()
            if name != "load" and level != "off"
        )


@dataclass(frozen=True, eq=False)
class Truth:
    """What really happened in a run, on the grid k/512 s; all arrays (n,) and SI."""

    simulation: Simulation
    """Card, pump and motor; the pump's signals inside are those that really were."""
    voltage: Array
    """Command. [V]"""
    current_plus: Array
    """Current of the card's positive channel, a magnitude. [A]"""
    current_minus: Array
    """Current of the other channel, a magnitude. [A]"""
    shaft_speed: Array
    """Speed of the shaft. [rad/s]"""
    shaft_position: Array
    """Angle of the shaft, 0 at first. [rad]"""
    encoder_position: Array
    """Angle of the shaft that the encoder sits on, the same unless there is backlash. [rad]"""

    @property
    def time(self) -> Array:
        """Instants. [s]"""
        return self.simulation.time


def simulate_plant(drive: Drive, voltage: Array, effects: Effects) -> Truth:
    """Simulate a test from rest with the package's own march, at 512 Hz.

    Without effects the truth is `Drive.simulate` to the last bit, so that the model that is
    identified contains it.

    Parameters
    ----------
    voltage : (n,) array
        Command on the grid k/512 s, joined by straight lines. [V]

    Raises
    ------
    InputError
        If the command goes beyond ±10 V.
    DomainError
        If the current of the stiction overpowers the feedback spring.
    """
    card = pump = drive.simulate(voltage, RATE)
    if effects.spool_stiction != "off":
        gain = STICTION_GAIN[effects.spool_stiction]
        moved = remembered_current(card.current, 1.0 / RATE, gain, STICTION_MEMORY)
        pump = drive.simulate_current(moved, RATE)
    speed, position = pump.shaft_speed, pump.shaft_position
    if effects.leakage != "off":
        full = drive["Z10"].values[0] * min(drive["Z13"].values)
        lost = LEAKAGE[effects.leakage] * effects.load * full
        speed = leaked_speed(speed, lost, BRAKE_RELEASED * full)
        position = _integral(speed)
    if effects.cam_ripple != "off":
        amplitude = CAM_RIPPLE[effects.cam_ripple] * effects.load
        position = rippled_position(position, CAM_CYCLES, amplitude)
        speed = rippled_speed(speed, position, CAM_CYCLES, amplitude)
    behind = position
    if effects.backlash != "off":
        behind = play(position, BACKLASH[effects.backlash])
    return Truth(
        pump, voltage, card.current_positive, card.current_negative, speed, position, behind
    )


def _integral(speed: Array) -> Array:
    """Trapezoidal integral on the grid, 0 at first."""
    position = np.zeros_like(speed)
    np.cumsum(0.5 * (speed[1:] + speed[:-1]) / RATE, out=position[1:])
    return position
