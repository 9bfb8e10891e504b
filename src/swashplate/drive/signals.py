"""Signals of a drive by name, in the order of the chain; its model says units and meaning."""

from swashplate.errors import InputError
from swashplate.models.drive import drive

SIGNALS = (
    "voltage",
    "current",
    "current_positive",
    "current_negative",
    "solenoid_force",
    "spool_position",
    "orifice_opening",
    "stroker_pressure",
    "swash_angle",
    "shaft_speed",
    "shaft_position",
)
"""Signals of a simulation, in the order of the chain."""
MOTOR = ("motor_torque", "motor_pressure_drop")
"""Those of the motor, which only a drive with refinements shows."""
MEASURED = ("load_torque", "pump_speed", "supply_pressure")
"""Those of inputs that may be measured in addition to the command."""
UNITS = {name: drive.definitions[name].unit for name in (*SIGNALS, *MOTOR, *MEASURED)}
"""SI unit of each."""
OUTPUTS = ("current_sum", *SIGNALS[1:], *MOTOR)
"""Signals that can be observed, or returned and compared by a batch."""
FIRST_SIGNALS = (
    "current",
    "current_positive",
    "current_negative",
    "stroker_pressure",
    "shaft_speed",
)
"""Signals of the first march; the drive is marched again when another is first asked for."""


def check_output(signal: str) -> None:
    """Refuse a signal that is none of `OUTPUTS`; states of the equations may stay at zero."""
    if signal not in OUTPUTS:
        raise InputError(f"A drive has no signal '{signal}'; it has {', '.join(OUTPUTS)}.")
