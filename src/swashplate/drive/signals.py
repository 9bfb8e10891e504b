"""Signals of a drive: names, units and meaning, in the order of the chain."""

from swashplate.errors import InputError

CHAIN = {
    "voltage": ("V", "command of the card within ±10 V, positive towards positive speed"),
    "current": ("A", "signed current, positive solenoid's less the negative one's"),
    "current_positive": ("A", "current of the solenoid towards positive speed, never negative"),
    "current_negative": ("A", "current of the other solenoid, never negative"),
    "solenoid_force": ("N", "net force of both solenoids on the spool"),
    "spool_position": ("m", "displacement of the spool, within its stroke"),
    "orifice_opening": ("m", "effective opening, what the orifices leave of the displacement"),
    "stroker_pressure": ("Pa", "stroking pressure about its equilibrium"),
    "swash_angle": ("rad", "angle of the swash plate"),
    "shaft_speed": ("rad/s", "speed of the shaft, of the turret for slew"),
    "shaft_position": ("rad", "integral of the speed, zero at the start"),
}
"""SI unit and meaning of each signal of a simulation, in the order of the chain."""
MOTOR = {
    "motor_torque": ("N m", "torque of the motor, positive if it drives towards positive speed"),
    "motor_pressure_drop": ("Pa", "pressure drop over the motor, 0 if motor_constant is not known"),
}
MEASURED = {
    "load_torque": ("N m", "static torque of the load, positive against positive speed"),
    "pump_speed": ("1", "speed of the prime mover, relative to that of Z10"),
    "supply_pressure": ("Pa", "supply pressure less static pressure; until it is set, Z9 counts"),
}
"""Those of inputs that may be measured in addition to the command."""
UNITS = {name: unit for name, (unit, _) in {**CHAIN, **MOTOR, **MEASURED}.items()}
SIGNALS = tuple(CHAIN)
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
