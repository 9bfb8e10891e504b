"""Parameters of the refinements: what goes beyond the source's equations, off unless given.

Each belongs to a component of `swashplate.physics`; docs/refinements.md says what it explains.
"""

from dataclasses import dataclass
from math import inf
from typing import Unpack

from swashplate.parameters.catalogue import Definition, Rules


@dataclass(frozen=True)
class Refinement(Definition):
    """A parameter that a set need not have."""

    default: float = 0.0
    """What it is where it is not given."""
    switch: bool = False
    """Whether the model is another one as soon as it is not zero."""


def _of(
    symbol: str,
    name: str,
    unit: str,
    *,
    default: float = 0.0,
    switch: bool = False,
    **rules: Unpack[Rules],
) -> Refinement:
    return Refinement(symbol, name, unit, "refinements", default=default, switch=switch, **rules)


_ALL = (
    _of("spool_friction", "friction of spool and solenoid", "N", lower=0.0, switch=True),
    _of("spool_presliding", "travel over which that friction builds up", "m", lower=0.0),
    _of(
        "dither_time",
        "time constant with which dither frees the spool",
        "s",
        lower=0.0,
        above=True,
        can_be_off=True,
        default=inf,
    ),
    _of(
        "solenoid_hysteresis",
        "half-width of the solenoids' hysteresis",
        "A",
        lower=0.0,
        switch=True,
    ),
    _of("load_torque", "static torque of the load at the shaft", "N m"),
    _of("load_inertia", "inertia of motor and load at the shaft", "kg m^2", lower=0.0),
    _of(
        "motor_leakage", "speed lost to leakage for a torque", "rad/(s N m)", lower=0.0, switch=True
    ),
    _of(
        "cam_ripple",
        "variation of the motor's displacement without load",
        "1",
        lower=0.0,
        upper=1.0,
        switch=True,
    ),
    _of(
        "cam_ripple_per_torque",
        "growth of that variation with the load",
        "1/(N m)",
        lower=0.0,
        switch=True,
    ),
    _of("cam_cycles", "cycles of the cam ring in a turn", "1", lower=0.0, above=True, default=5.5),
    _of("cam_phase", "phase of the cam ring at the start", "rad"),
    _of("swash_damping", "time constant of the swash plate's damping", "s", lower=0.0, switch=True),
    _of(
        "line_stiffness",
        "stiffness of the line's oil at the shaft",
        "N m/rad",
        lower=0.0,
        switch=True,
    ),
    _of("motor_constant", "motor speed for a flow", "rad/m^3", lower=0.0, switch=True),
)

REFINEMENTS: dict[str, Refinement] = {each.symbol: each for each in _ALL}
"""Definitions by symbol, along the chain; each has one value."""
