"""The limits of a drive that can act on a sample."""

from enum import IntFlag


class Limit(IntFlag):
    """What holds the drive back; several can act at once."""

    DEAD_ZONE = 1
    """The current is within the solenoids' dead zone: no force."""
    CURRENT_RATE = 2
    """A rate limit of the card sets the current."""
    ORIFICE = 4
    """The in-line orifice, not the spool, limits the flow, and the plate moves: the acceleration
    limit."""
    SPOOL = 8
    """The spool is at its stop."""
    SWASH_STOP = 16
    """The swash plate is at a stop: the speed limit."""
    RELIEF = 32
    """The relief valve holds the stroking pressure at ±Z15."""


DEAD_ZONE = int(Limit.DEAD_ZONE)
CURRENT_RATE = int(Limit.CURRENT_RATE)
ORIFICE = int(Limit.ORIFICE)
SPOOL = int(Limit.SPOOL)
SWASH_STOP = int(Limit.SWASH_STOP)
RELIEF = int(Limit.RELIEF)
