"""A crew that damps the swing by hand: the operator's eyes, delay and arm, at the joysticks.

The operator sees how far the load hangs out, and drives the tip over it. A joystick asks for a
speed, so that the wanted speed of the tip is proportional to the swing, which damps it:

    u = K (d - θₜ L sgn d) for abs(d) > θₜ L, else 0,    T_n dv/dt + v = u(t - τ),

with the swing d [m] as it is seen from the cab, on its way out of rest on the rope L. On ideal
drives, without threshold, d'' + K d'(t - τ) + ω₀² d = 0: a small gain gives the damping ratio
K cos(ω₀ τ)/(2 ω₀), which is negative for delays between a quarter and three quarters of a period.

The structure is that of the crossover model: around and above ω₀ tip speed to swing is an
integrator, and a person in front of an integrator is a gain with a delay (McRuer and Krendel). None
of the numbers was measured on a crane's operator; `Crew` gives where they come from.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.crane.kinematics import Boom, Geometry, Vector, reach_rate
from swashplate.crane.rope import GRAVITY
from swashplate.machine import equation, inlined

Array = NDArray[np.float64]

HANG, HAND, COMMANDED = range(3)
"""Rows of the crew's state, across the boom and along it: swing that is taken for rest [m], speed
of the tip for which the hand asks [m/s], shaft angles of slew and luff by the command alone
[rad]."""


class HumanOperator(NamedTuple):
    """Numbers of a `Crew`, as the loop takes them."""

    gain: float = 0.0
    """Speed of the tip for each metre of swing; 0 without a crew. [1/s]"""
    delay: int = 0
    """[samples of the loop]"""
    threshold: float = 0.0
    """[rad]"""
    share: float = 1.0
    """Of what the drives can follow."""
    lag: float = 0.1
    """[s]"""
    return_time: float = 30.0
    """[s]"""


class Drivable(NamedTuple):
    """Limits of a drive's shaft."""

    low: float
    high: float
    """[rad/s]"""
    acceleration: float
    """[rad/s²]"""


class View(NamedTuple):
    """What the operator sees, each across the boom and along it, of slew and luff."""

    swing: tuple[float, float]
    """Load less tip. [m]"""
    plumb: tuple[float, float]
    """The same of a load at rest. [m]"""
    rope: float
    """[m]"""
    shafts: tuple[float, float]
    """[rad]"""
    arms: tuple[float, float]
    """Metres of the tip for each radian of the shaft."""


class CrewMemory(NamedTuple):
    """State of a crew, which the loop changes."""

    state: Array
    """(3, 2), rows `HANG`, `HAND` and `COMMANDED`."""
    wanted: Array
    """(2, n) speeds of the tip on their way from eye to hand, n a power of two. [m/s]"""


def new_memory(delay: int) -> CrewMemory:
    """Memory of a crew before its first sample, at rest; the delay is in samples of the loop."""
    return CrewMemory(np.zeros((3, 2)), np.zeros((2, 1 << (delay + 1).bit_length())))


@equation
def beyond_threshold(swing: float, threshold: float) -> float:
    """Part of a swing beyond the threshold of perception, 0 below it. [m]"""
    return swing - min(max(swing, -threshold), threshold)


@equation
def followable_speed(speed: float, acceleration: float, omega: float) -> float:
    """Amplitude of a tip's speed at ω [rad/s] that its limits allow, min(v, a/ω). [m/s]"""
    return min(speed, acceleration / omega)


@inlined
def boomwise(v: Vector, bearing: tuple[float, float]) -> tuple[float, float]:
    """Components across the boom, to starboard of one that points forward, and along it."""
    c, s = bearing
    return -v.x * s - v.y * c, v.x * c - v.y * s


@inlined
def view_of(
    hangs: tuple[Vector, Vector],
    rope: float,
    bearing: tuple[float, float],
    boom: Boom,
    shafts: tuple[float, float],
    g: Geometry,
) -> View:
    """View from the cab, which rolls with the ship.

    Load less tip as it hangs, and as it would at rest, in the ship's axes [m]; cosine and sine of
    the slew; angles of the shafts of slew and luff [rad].
    """
    # metres of the tip for each radian of the shaft: boom up is inwards
    arms = (g.foot + g.boom * boom.cos, -reach_rate(boom, g))
    return View(boomwise(hangs[0], bearing), boomwise(hangs[1], bearing), rope, shafts, arms)


@inlined
def catch_swing(
    reference: Array,
    view: View,
    drives: tuple[Drivable, Drivable],
    memory: CrewMemory,
    operator: HumanOperator,
    sample: int,
    h: float,
) -> None:
    """Add what the crew asks of slew and luff to the command's reference speeds. [rad/s]"""
    state = memory.state
    omega = sqrt(GRAVITY / view.rope)
    last = memory.wanted.shape[1] - 1
    for i in range(2):
        if sample == 0:
            state[HANG, i] = view.plumb[i]
        else:
            state[COMMANDED, i] += h * reference[i + 1]
        state[HANG, i] += h / operator.return_time * (view.swing[i] - state[HANG, i])
        out = beyond_threshold(view.swing[i] - state[HANG, i], operator.threshold * view.rope)
        away = view.arms[i] * (view.shafts[i] - state[COMMANDED, i])
        speed = operator.gain * out - away / operator.return_time
        arm = abs(view.arms[i])
        full = arm * min(drives[i].high, -drives[i].low)
        most = operator.share * followable_speed(full, arm * drives[i].acceleration, omega)
        memory.wanted[i, sample & last] = min(max(speed, -most), most)
        late = memory.wanted[i, (sample - operator.delay) & last]
        state[HAND, i] += h / operator.lag * (late - state[HAND, i])
        shaft_speed = reference[i + 1] + state[HAND, i] / view.arms[i]
        reference[i + 1] = min(max(shaft_speed, drives[i].low), drives[i].high)
