"""Units of the signals that linear models and frequency responses deal with."""

UNITS = {
    "voltage": "V",
    "current": "A",
    "current_rate": "A/s",
    "solenoid_force": "N",
    "spool_position": "m",
    "orifice_opening": "m",
    "stroker_pressure": "Pa",
    "swash_angle": "rad",
    "shaft_speed": "rad/s",
}
"""SI unit of each input, output and state of a continuous model."""
