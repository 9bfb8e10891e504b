"""Small motions: linear models at an operating point, and frequency responses large and small."""

from swashplate.linear.discrete import linearize as linearize
from swashplate.linear.drive import OUTPUTS as OUTPUTS
from swashplate.linear.drive import linearize_drive as linearize_drive
from swashplate.linear.drive import model_tables as model_tables
from swashplate.linear.drive import slowest_lag as slowest_lag
from swashplate.linear.frequency_response import FrequencyResponse as FrequencyResponse
from swashplate.linear.frequency_response import SweptInput as SweptInput
from swashplate.linear.frequency_response import SweptOutput as SweptOutput
from swashplate.linear.frequency_response import response_table as response_table
from swashplate.linear.frequency_response import sweep as sweep
from swashplate.linear.margins import LoopMargins as LoopMargins
from swashplate.linear.margins import loop_margins as loop_margins
from swashplate.linear.model import LINEAR_MODEL as LINEAR_MODEL
from swashplate.linear.model import UNITS as UNITS
from swashplate.linear.model import Coulomb as Coulomb
from swashplate.linear.model import LinearDrive as LinearDrive
from swashplate.linear.model import LinearModel as LinearModel
from swashplate.linear.operating_point import DeadZoneError as DeadZoneError
from swashplate.linear.operating_point import Input as Input
from swashplate.linear.operating_point import OperatingPoint as OperatingPoint
