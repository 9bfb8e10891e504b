"""Small motions: linear models at an operating point, and frequency responses large and small."""

from swashplate.linear.discrete import linearize as linearize
from swashplate.linear.drive import OUTPUTS as OUTPUTS
from swashplate.linear.drive import Coulomb as Coulomb
from swashplate.linear.drive import Input as Input
from swashplate.linear.drive import LinearDrive as LinearDrive
from swashplate.linear.drive import OperatingPoint as OperatingPoint
from swashplate.linear.drive import linearize_drive as linearize_drive
from swashplate.linear.drive import model_tables as model_tables
from swashplate.linear.frequency_response import FrequencyResponse as FrequencyResponse
from swashplate.linear.frequency_response import response_table as response_table
from swashplate.linear.frequency_response import sweep as sweep
from swashplate.linear.model import LINEAR_MODEL as LINEAR_MODEL
from swashplate.linear.model import LinearModel as LinearModel
from swashplate.linear.model import LoopMargins as LoopMargins
from swashplate.linear.model import loop_margins as loop_margins
