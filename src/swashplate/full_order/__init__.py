"""The drive with five states: physical sets, simulation, comparison with one state."""

import lazy_loader

# names are imported when they are first used: a physical set needs no drive
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
