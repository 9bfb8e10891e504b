"""Sensors of tests to come: what they measure, and how well."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from swashplate.campaign import ChannelKind
from swashplate.campaign.rig import COUNTS_PER_TURN
from swashplate.drive import Drive
from swashplate.errors import InputError
from swashplate.identification.drive_model import CURRENTS, SIGNALS, Part
from swashplate.maneuvers import step
from swashplate.parameters.rules import FULL_VOLTAGE

RATE = 512.0
"""At which tests to come are simulated. [Hz]"""
TRANSDUCER = 0.005
"""Noise that is assumed of a sensor, over the largest value that the drive makes it read. [1]"""
MEMORY = 0.1
"""Time over which errors of a measurement are assumed to stay correlated. [s]"""
ADDED: tuple[ChannelKind, ...] = (
    "current_plus",
    "current_minus",
    "spool_position",
    "stroker_pressure",
    "swash_angle",
    "shaft_speed",
)
"""Sensors that could be added."""


class Sensor(NamedTuple):
    """What is measured in a test, and how well."""

    kind: ChannelKind
    noise: float
    """Standard deviation. [SI unit of the kind]"""
    memory: float = MEMORY
    """Time for which one sample stands. [s]"""
    origin: str = "stated"
    """Where the noise is known from, for people."""

    @property
    def deviation(self) -> float:
        """Of a sample of the candidates, so that each counts as an independent one."""
        return self.noise * float(np.sqrt(max(self.memory * RATE, 1.0)))


def default_sensors(drive: Drive) -> tuple[Sensor, ...]:
    """Those of the source's tests: an ammeter around both leads and, where known, its encoder."""
    if drive.name not in COUNTS_PER_TURN:
        return assumed_sensors(drive, ("rectified_current", "shaft_speed"))
    rounding = 2.0 * np.pi / COUNTS_PER_TURN[drive.name] / np.sqrt(12.0)
    encoder = Sensor("encoder_counts", float(rounding), origin="rounding of the source's encoder")
    return (*assumed_sensors(drive, ("rectified_current",)), encoder)


def assumed_sensors(drive: Drive, kinds: Sequence[ChannelKind]) -> tuple[Sensor, ...]:
    """Sensors of which nothing is known: noise of 0.5 % of what full command makes them read.

    Raises
    ------
    InputError
        If a kind is none that the drive has.
    """
    full = [drive.simulate(step(sign * FULL_VOLTAGE).sample(RATE), RATE) for sign in (1.0, -1.0)]
    made = []
    for kind in kinds:
        if kind not in SIGNALS:
            raise InputError(f"There is no sensor '{kind}'; there are {', '.join(SIGNALS)}.")
        signal = "current" if kind in ("rectified_current", "signed_current") else SIGNALS[kind]
        largest = max(float(np.abs(getattr(run, signal)).max()) for run in full)
        made.append(
            Sensor(kind, TRANSDUCER * largest, origin=f"assumed, {100.0 * TRANSDUCER:g} % of range")
        )
    return tuple(made)


def measurable(part: Part, kinds: Sequence[ChannelKind]) -> tuple[ChannelKind, ...]:
    """Kinds of sensor that tell of a part of the drive."""
    return tuple(
        kind for kind in kinds if part == "chain" or (kind in CURRENTS) == (part == "card")
    )
