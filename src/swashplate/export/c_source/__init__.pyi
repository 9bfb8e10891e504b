from swashplate.equations.printing_c import HELPERS as HELPERS
from swashplate.equations.printing_c import c_name as c_name
from swashplate.equations.printing_c import literal as literal

from .model import Exported as Exported
from .model import feedthrough as feedthrough
from .model import newest as newest
from .model import numbers as numbers
from .model_interface import interface as interface
