"""Small motions: linear models at an operating point, and frequency responses large and small."""

from swashplate.linear.discrete import linearize
from swashplate.linear.drive import OUTPUTS, linearize_drive, slowest_lag
from swashplate.linear.frequency_response import (
    FEWEST_STEPS,
    SLOWEST_CYCLE,
    FrequencyResponse,
    SweptInput,
    SweptOutput,
    sweep,
)
from swashplate.linear.margins import LoopMargins, loop_margins
from swashplate.linear.model import (
    LINEAR_MODEL,
    UNITS,
    Coulomb,
    LinearDrive,
    LinearModel,
    pade_polynomials,
)
from swashplate.linear.operating_point import DeadZoneError, Input, OperatingPoint

__all__ = [
    "FEWEST_STEPS",
    "LINEAR_MODEL",
    "OUTPUTS",
    "SLOWEST_CYCLE",
    "UNITS",
    "Coulomb",
    "DeadZoneError",
    "FrequencyResponse",
    "Input",
    "LinearDrive",
    "LinearModel",
    "LoopMargins",
    "OperatingPoint",
    "SweptInput",
    "SweptOutput",
    "linearize",
    "linearize_drive",
    "loop_margins",
    "pade_polynomials",
    "slowest_lag",
    "sweep",
]
