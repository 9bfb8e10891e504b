from .model import Exported as Exported
from .model import feedthrough as feedthrough
from .model import newest as newest
from .model import numbers as numbers
from .model_interface import interface as interface
