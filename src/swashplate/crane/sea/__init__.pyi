from .confidence import rms_of as rms_of
from .seaway import RECORDS as RECORDS
from .transfer_functions import CRANE_SHIP as CRANE_SHIP
