"""A drive as it looks at first sight: dead zones, jumps, gains, limits and one lag, as a model."""

from __future__ import annotations

from math import exp
from typing import NamedTuple

from swashplate.machine import Model, equation

SHORTEST_LAG = 1e-4
"""Lag below which one is marched as this one, a fiftieth of the march's step. [s]"""


class PlainDrive(NamedTuple):
    """Numbers of both ways as magnitudes; speeds in rad/s or m/s."""

    dead_zone_plus: float
    """[V]"""
    dead_zone_minus: float
    gain_plus: float
    """Speed for a volt beyond the dead zone."""
    gain_minus: float
    top_speed_plus: float
    top_speed_minus: float
    acceleration_plus: float
    acceleration_minus: float
    jump_plus: float
    """Speed right beyond the dead zone."""
    jump_minus: float
    lag: float
    """[s]"""
    creep: float
    """Speed at rest, with its sign."""


class SpeedState(NamedTuple):
    """State of a plain drive."""

    speed: float
    """[rad/s] or [m/s]"""


class JumpWidth(NamedTuple):
    """Width of the jumps of a run: no parameter of the drive."""

    edge: float
    """Command over which a jump is complete. [V]"""


@equation
def speed_at(command: float, p: PlainDrive, given: JumpWidth) -> float:
    """Settled speed at a command in V."""
    plus = max(command - p.dead_zone_plus, 0.0)
    minus = max(-command - p.dead_zone_minus, 0.0)
    forward = p.gain_plus * plus + p.jump_plus * min(plus / given.edge, 1.0)
    backward = p.gain_minus * minus + p.jump_minus * min(minus / given.edge, 1.0)
    return min(max(p.creep + forward - backward, -p.top_speed_minus), p.top_speed_plus)


@equation
def step(
    state: SpeedState, command: float, p: PlainDrive, given: JumpWidth, h: float
) -> SpeedState:
    """Speed after a step of h seconds with a command in V."""
    share = 1.0 - exp(-h / max(p.lag, SHORTEST_LAG))
    change = share * (speed_at(command, p, given) - state.speed)
    return SpeedState(
        state.speed + min(max(change, -h * p.acceleration_minus), h * p.acceleration_plus)
    )


MODEL = Model(
    "plain_drive",
    parameters=PlainDrive,
    state=SpeedState,
    step=step,
    given=JumpWidth,
    integrals={"position": "speed"},
)
