"""swashplate: hydrostatic drives, from tests to a validated model, from the model to answers."""

import logging

import lazy_loader

from swashplate.__about__ import __version__ as __version__

# a library's logger prints nothing until the program that uses it says so
logging.getLogger("swashplate").addHandler(logging.NullHandler())

# names are imported when they are first used, so that `swashplate --help` is instant
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
