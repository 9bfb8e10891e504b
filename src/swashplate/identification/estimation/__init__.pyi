from .drive_model import LIMIT_COLUMNS as LIMIT_COLUMNS
from .drive_model import at_rate_of as at_rate_of
from .drive_model import voltage_record as voltage_record
from .setup import Forces as Forces
from .stages import Parameters as Parameters
from .stages import setup_of as setup_of
from .stages import smooth as smooth
