"""Drives with one limit taken away: what a limit costs is seen when it is gone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import atan, inf

from swashplate.drive import Drive
from swashplate.parameters.parameter_set import Change
from swashplate.simulation.result import Limit

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
    changes: Callable[[Drive], Mapping[str, Change]]
    eased_by: Callable[[Drive], Mapping[str, float]]
    """Factors on levers that ease the limit under the same command; none where that needs another
    command as well."""
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


def _covered(drive: Drive) -> float:
    """Dead zone of the solenoids that the card's jump covers both ways. [A]"""
    numbers = drive.parameters.numbers
    return min(numbers["Z17"], numbers["J_plus"], numbers["J_minus"])


def _dead_zone(drive: Drive) -> dict[str, Change]:
    # with the card's jump left as it is, a solenoid's dead zone beyond it would stay
    return {"V_dz": 0.0, "Z17": _covered(drive)}


def _less_dead_zone(drive: Drive) -> dict[str, float]:
    left = drive.parameters.numbers["Z17"]
    covered = _covered(drive)
    return {"dead_zone": 0.0} if covered == left else {"dead_zone": 0.0, "Z17": covered / left}


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
        _dead_zone,
        _less_dead_zone,
        Limit.DEAD_ZONE,
    ),
    Removal(
        "current rate",
        "card: faster ramp (lim1, lim2)",
        lambda _: {"lim1": inf, "lim2": inf},
        lambda _: {"rate_limits": 1.5},
        Limit.CURRENT_RATE,
    ),
    Removal(
        "final decay",
        "card: no decay of the current (I_t2)",
        lambda _: {"I_t2": 0.0},
        lambda _: {"I_t2": 0.5},
    ),
    Removal(
        "delay",
        "card: shorter delay (tau)",
        lambda _: {"tau": 0.0},
        lambda _: {"tau": 0.5},
    ),
    Removal(
        "orifice",
        "in-line orifice: larger bore (Z16)",
        lambda _: {"Z16": inf},
        lambda _: {"orifice": 1.5},
        Limit.ORIFICE,
    ),
    Removal(
        "spool stop",
        "spool: longer stroke (Z14)",
        lambda _: {"Z14": inf},
        lambda _: {"spool_stroke": 1.5},
        Limit.SPOOL,
    ),
    Removal(
        "swash stop",
        "pump: larger, or a smaller motor (Z10, Z13)",
        _swash_stop,
        lambda _: {},
        Limit.SWASH_STOP,
    ),
    Removal(
        "relief valve",
        "relief valve: higher setting (Z15)",
        lambda _: {"Z15": inf},
        lambda _: {"relief": 1.5},
        Limit.RELIEF,
    ),
    Removal(
        "plussing",
        "spool: centred at rest (Z18)",
        lambda _: {"Z18": 0.0},
        lambda _: {"plussing": 0.0},
    ),
)
"""What can be taken away, in the order of the chain; the plussing, which no force limits, because
the creep that it makes is an error, too."""
