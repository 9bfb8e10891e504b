from .equation import EquationInC as EquationInC
from .equation import equation_in_c as equation_in_c
from .exported import Exported as Exported
from .model import feedthrough as feedthrough
from .model import newest as newest
from .model import numbers as numbers
from .model import writer_of as writer_of
from .model_interface import interface as interface
