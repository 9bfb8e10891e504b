"""A cylinder behind a proportional valve, as a user writes it for `swashplate fit --model`.

Beside the machine's equations it knows nothing: bounds and initial values are round numbers.
"""

from typing import NamedTuple

from swashplate.machine import Model, discretised, equation


class Cylinder(NamedTuple):
    """What is to be found."""

    lag: float
    d_plus: float
    d_minus: float
    K_plus: float
    K_minus: float
    omega: float
    zeta: float


class State(NamedTuple):
    """Opening of the valve [V]; position, speed and acceleration of the rod."""

    opening: float
    position: float
    speed: float
    acceleration: float


@equation
def rates(state: State, voltage: float, p: Cylinder) -> State:
    """By time."""
    flow = p.K_plus * max(state.opening - p.d_plus, 0.0)
    flow = flow - p.K_minus * max(-state.opening - p.d_minus, 0.0)
    jerk = p.omega**2 * (flow - state.speed) - 2.0 * p.zeta * p.omega * state.acceleration
    return State((voltage - state.opening) / p.lag, state.speed, state.acceleration, jerk)


model = Model("cylinder", parameters=Cylinder, state=State, step=discretised(rates, "midpoint"))
rate = 512.0  # of its own, since the stamps of a log are rounded and not even
substeps = 2
free = {
    "lag": (0.01, 0.1, 1.0, "s"),
    "d_plus": (0.0, 0.5, 2.0, "V"),
    "d_minus": (0.0, 0.5, 2.0, "V"),
    "K_plus": (0.005, 0.05, 0.5, "m/(V s)"),
    "K_minus": (0.005, 0.05, 0.5, "m/(V s)"),
    "omega": (5.0, 20.0, 100.0, "rad/s"),
    "zeta": (0.05, 0.5, 2.0, "1"),
    "start.position": (-0.01, 0.0, 0.01, "m"),
}
