"""Drives with one limit taken away: what a limit costs is seen when it is gone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import atan, inf

from swashplate.drive import Drive
from swashplate.parameters.parameter_set import Change
from swashplate.simulation.limits import Limit

FEEDBACK_ARM = 0.98
"""Sine of the feedback arm's angle at which a plate without a stop is still held: at 1 the closed
form of the spool ends."""
WIDEST = 1.5
"""Largest angle of a plate without a stop; the model ends at a right angle. [rad]"""


@dataclass(frozen=True)
class Removal:
    """A limit, the component behind it, and the changes that take it away."""

    limit: str
    """In words."""
    component: str
    """What would have to change in the machine."""
    lever: str
    """The same as a lever of `whatif`, or a parameter's symbol."""
    eases: float
    """A factor on the lever that eases the limit."""
    changes: Callable[[Drive], Mapping[str, Change]]
    flag: Limit | None = None
    """How a simulation marks it, None for what acts always or is not marked."""

    def of(self, drive: Drive) -> dict[str, Change]:
        """The changes that alter anything in this drive; none if it has no such limit."""
        numbers = drive.parameters.numbers
        made = {}
        for name, value in self.changes(drive).items():
            both = drive[name].values if name in drive.parameters else (numbers[name],)
            if any(value != old for old in both):
                made[name] = value
        return made


def _dead_zone(drive: Drive) -> dict[str, Change]:
    # with the card's jump left as it is, a solenoid's dead zone beyond it would stay
    numbers = drive.parameters.numbers
    return {
        "V_dz": 0.0,
        "Z17": min(numbers["Z17"], numbers["J_plus"], numbers["J_minus"]),
    }


def _swash_stop(drive: Drive) -> dict[str, Change]:
    widest = min(atan(FEEDBACK_ARM / drive.parameters.numbers["Z3"]), WIDEST)
    return {
        f"Z13_{side}": max(widest, drive.parameters.numbers[f"Z13_{side}"])
        for side in ("plus", "minus")
    }


REMOVALS = (
    Removal(
        "dead zone",
        "card: dead-zone compensation (V_dz, or an inverse map)",
        "dead_zone",
        0.0,
        _dead_zone,
        Limit.DEAD_ZONE,
    ),
    Removal(
        "current rate",
        "card: faster ramp (lim1, lim2)",
        "rate_limits",
        1.5,
        lambda _: {"lim1": inf, "lim2": inf},
        Limit.CURRENT_RATE,
    ),
    Removal(
        "final decay",
        "card: no decay of the current (I_t2)",
        "I_t2",
        0.5,
        lambda _: {"I_t2": 0.0},
    ),
    Removal(
        "delay",
        "card: shorter delay (tau)",
        "tau",
        0.5,
        lambda _: {"tau": 0.0},
    ),
    Removal(
        "orifice",
        "in-line orifice: larger bore (Z16)",
        "orifice",
        1.5,
        lambda _: {"Z16": inf},
        Limit.ORIFICE,
    ),
    Removal(
        "spool stop",
        "spool: longer stroke (Z14)",
        "spool_stroke",
        1.5,
        lambda _: {"Z14": inf},
        Limit.SPOOL,
    ),
    Removal(
        "swash stop",
        "pump: larger, or a smaller motor (Z10, Z13)",
        "pump",
        1.5,
        _swash_stop,
        Limit.SWASH_STOP,
    ),
    Removal(
        "relief valve",
        "relief valve: higher setting (Z15)",
        "relief",
        1.5,
        lambda _: {"Z15": inf},
        Limit.RELIEF,
    ),
    Removal(
        "plussing",
        "spool: centred at rest (Z18)",
        "plussing",
        0.0,
        lambda _: {"Z18": 0.0},
    ),
)
"""What can be taken away, in the order of the chain; the plussing, which no force limits, because
the creep that it makes is an error, too."""
