"""A valve and a rod, the model of one's own that the calibration fits."""

from math import exp, sqrt
from typing import NamedTuple

from swashplate.equations import Model, equation, soft_threshold


class Valve(NamedTuple):
    """Its parameters."""

    dead_zone: float
    gain: float
    lag: float


class State(NamedTuple):
    """Its state."""

    opening: float
    rod: float


@equation
def step(state: State, valve: float, supply: float, p: Valve, h: float) -> State:
    """Opening with a lag, speed by what lies beyond the dead zone."""
    flow = soft_threshold(state.opening, p.dead_zone) * sqrt(supply / 100.0)
    share = 1.0 - exp(-h / p.lag)
    return State(state.opening + share * (valve - state.opening), state.rod + h * p.gain * flow)


model = Model("valve", parameters=Valve, state=State, step=step)
